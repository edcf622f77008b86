//! Every number that decides something: its meaning, its unit, and what goes wrong when it is too large or too small.

// --- Constraints: rank, redundancy, closure ---

/// Relative accuracy of a drawing where the model does not say: lengths over those of their loop, angles in radians.
/// Larger: loops that are locked by a small angle move. Smaller: linkages drawn with eight digits are locked.
/// Pinned by `tests/invariance/test_four_bar.py`.
pub const DRAWING: f64 = 1e-7;

/// Rounding of one entry of a constraint row, in units of the sizes of what was subtracted for it, over eps.
/// Larger: a model far from the origin has doubtful loops. Smaller: rows of rounding lock a door on two hinges.
/// Pinned by `rank::tests::rows_of_rounding_are_redundant`.
pub const ENTRY_ROUNDING: f64 = 4.0;

/// Singular values between the tolerance and this many times it make a constraint that is named as doubtful.
/// Larger: sound models are called doubtful. Smaller: a lock by an inaccurate drawing is not explained.
/// Pinned by `tests/invariance/test_four_bar.py`.
pub const DOUBTFUL: f64 = 1e3;

/// How far redundant rows may open in motion, over the tolerance of the drawing: rows that part by s per radian of the freed
/// direction open by up to some ten s over a large motion. Larger: a lost constraint is seen late. Smaller: doubtful linkages stop.
/// Pinned by `tests/invariance/test_four_bar.py`.
pub const REDUNDANT_OPEN: f64 = 1e2;

/// Length of the look beside a drawn pose, in lengths of the loop or radians, by which a pose of lower rank is seen.
/// Larger: the way back to the constraints is long. Smaller: the second-order part of a change point drowns in the tolerance.
/// Pinned by `rank::tests`.
pub const PROBE: f64 = 1e-2;

/// Rows that are as long as the longest but for this part are equally good pivots: the first is taken, so that neither rounding nor
/// units choose. Larger: short pivots. Smaller: rounding chooses. A choice, never an answer, depends on it.
pub const TIE: f64 = 1e-6;

/// Rows are closed when smaller than this, over the length of their loop or in radians.
/// Larger: states are less accurate than they could be. Smaller: Newton's method circles in rounding.
/// Pinned by `closure` through every assembled model of `tests/`.
pub const CLOSED: f64 = 1e-13;

/// The same in units of the rounding of a row's entries, for models far from the origin; and how much more than `CLOSED` a closing
/// that does not go on may leave. Larger: loops stay open by more than rounding. Smaller: models far from the origin do not close.
pub const CLOSED_ROUNDING: f64 = 1e2;

/// Singular values of a least-squares problem below this part of the largest belong to directions that no row feels.
/// Larger: weak directions are left out. Smaller: rounding of states of self-stress is divided by. Entries are free of units.
pub const FELT: f64 = 1e-10;

// --- Rolling ---

/// Straight rolling: B''' and the third power of E, over the speed (lengths over the characteristic length) to the same power, and
/// forces along the path over their terms. Larger: motion on slow curves is linearised as if straight; smaller: rounding of a drawn
/// model refuses it. Pinned by `a_curve_and_a_trailer_are_refused` and the bicycle of tests/truth/test_rolling.py.
pub const ROLLS_STEADILY: f64 = 1e-9;

/// Rounding that forces which cancel leave in their tangent, over the sum of their sizes. Larger: a weak force along the path of
/// rolling passes unseen; smaller: weight alone refuses. Pinned by the bicycle of tests/truth/test_rolling.py.
pub const ROUNDING_OF_FORCES: f64 = 1e-12;
