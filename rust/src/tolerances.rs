//! Every number that decides: its meaning, its unit, what goes wrong when it is too large or too small, and the test that pins it.

/// Part of the sum of the absolute terms of an entry of the condensed dynamic stiffness within which a change hides in the entry's
/// own rounding: two units in the last place. Free of units. Too large: S is extrapolated where it has visibly changed, and Newton's
/// method goes to the wrong place before the accepted residual stops it; too small: one factorisation more per correction.
/// Pinned by tests/truth/test_frequency_blocks.py.
pub const HIDDEN: f64 = 2.0 * f64::EPSILON;

/// Part of the natural size of an entry of the condensed dynamic stiffness that rounding of a factorisation may change, by its
/// bound, before the entry is refined. Free of units. Too large: curves of finely divided structures carry the rounding; too small:
/// refinements that change nothing. Pinned by tests/test_hbm_rounding.py.
pub const FELT: f64 = 1e-6;

/// Correction of an entry by a residual, relative to its natural size, after which the next correction, about its square, would not
/// count. Free of units. Too large: S keeps a visible error; too small: structures are refused that are known well enough.
/// Pinned by tests/test_hbm_rounding.py.
pub const SETTLED: f64 = 1e-7;

/// An entry of the condensed dynamic stiffness below this part of its rounding in plain arithmetic is zero: what is left of it after
/// refinement is rounding of the refinement. Free of units. Too large: small entries are not refined; too small: structures that are
/// free at rest are refused. Pinned by tests/truth/test_frequency_blocks.py.
pub const ABSENT: f64 = 1e-10;

/// Rounding of a residual in units of eps times the sum of the absolute terms of its row. Free of units. Too large: residuals that
/// are not rounding pass; too small: points that are as good as the arithmetic allows are refused.
/// Pinned by tests/truth/test_frequency_blocks.py.
pub const ROW_ROUNDING: f64 = 16.0;
