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

/// Growth rates of perturbations below this fraction of the base frequency count as zero. Free of units. Too large: weak
/// instabilities are called stable; too small: rounding of the multipliers of undamped systems is called unstable.
/// Pinned by tests/truth/test_hbm_events.py.
pub const NEUTRAL: f64 = 1e-9;

/// Largest |Re s| over the base frequency of an exponent that crosses the imaginary axis at a point that was solved for. Free of
/// units. Too large: jumps of the exponents where a contact closes are called bifurcations; too small: bifurcations of stiff systems,
/// whose exponents have rounding, are lost. Pinned by tests/truth/test_hbm_events.py.
pub const AXIS: f64 = 1e-6;

/// The same on the unstable side of a border that was bracketed, where two exponents that meet on the axis part like the root of the
/// distance. Free of units; failures as of `AXIS`. Pinned by tests/truth/test_hbm_events.py.
pub const AXIS_ROOT: f64 = 1e-3;

/// How many times the regularity at a branch point may exceed what a linear decrease to zero leaves at the width of the bracket. Free of
/// units. Too large: corners, where the determinant jumps through zero, are called branch points; too small: branch points of
/// strongly curved branches are lost. Pinned by tests/truth/test_hbm_events.py.
pub const BRANCHING: f64 = 1e3;

/// Steps of the finest integration over which a contact must last to be seen by the stability of a motion. A count. Too large:
/// the stability of short contacts is not told; too small: it is told wrongly. Pinned by tests/truth/test_hbm_events.py.
pub const CONTACT_STEPS: usize = 8;

/// Part of the range of an element's stiffness over the period by which it jumps where a contact opens or closes. Free of units.
/// Too large: partial contacts are missed; too small: smooth laws that bend fast count as contacts.
/// Pinned by tests/truth/test_hbm_events.py.
pub const CONTACT_JUMP: f64 = 0.1;
