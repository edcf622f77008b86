//! Numbers that decide. All are free of units; each is compared with a bound of rounding or with a stated error.

// Modes

/// Multiple of u (2^-53) times the sum of the sizes of the terms of an entry that counts as rounding of the entry made before
/// the solver saw it. Too small: roots of assembled matrices differ by more than their error. Too large: errors are pessimistic,
/// and soft modes are called rigid. Pinned by tests/truth/test_graded_modes.py (errors against 50 digits, rigid or soft).
pub const DATA_ROUNDING: f64 = 4.0;

/// Relative error of a squared frequency (algorithm only) above which the expensive route is taken: factors, Jacobi's singular
/// values, residuals in twice the precision. Too large: roots lose digits that the matrices hold. Too small: only time is lost.
/// Pinned by tests/truth/test_graded_modes.py.
pub const SHARP: f64 = 1e-12;

/// Two roots whose distance is below this share of their geometric mean are rotated together (Rayleigh-Ritz) instead of divided
/// by their distance. Too large: a group's quotients lose accuracy. Too small: corrections of close roots blow up.
/// Pinned by tests/truth/test_graded_modes.py (repeated soft modes).
pub const CLOSE: f64 = 1e-6;

/// Cosine (in the metric of M) above which two approximate shapes are the same one: a root was then found twice and another is
/// missing, and no error estimate holds. Pinned by tests/truth/test_graded_modes.py.
pub const SAME_SHAPE: f64 = 1e-3;

/// Relative effect on a squared frequency up to which damping between two undamped modes is left out; it is added to the error.
/// Too large: shapes of coupled damping are real although they are not. Too small: rounding of proportional damping sends a
/// system to the general route. Pinned by tests/test_modal.py (proportional damping) and tests/truth/test_graded_modes.py.
pub const UNCOUPLED: f64 = 1e-13;
