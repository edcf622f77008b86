//! Newton's method, continuation, quasi-Newton methods.

/// Shortest part of a Newton step that a line search tries. Larger: stiff problems are given up early. Smaller: late. Not seen: starts far
/// from a solution are found, or refused, either way.
pub const LEAST_DAMPING: f64 = 1e-6;

/// Newton step over the scale of the unknowns that an ill-conditioned Jacobian may keep above the tolerance; below this the point is taken
/// and the step told. Larger: points that have not converged pass. Smaller: points near to folds are refused. Not seen: the residual by row
/// has to be rounding as well, which decides first.
pub const STEP_ROUNDING: f64 = 1e-7;

/// Singular values of a Jacobian near this part of the largest are damped in its regularised inverse. Larger: slow convergence. Smaller:
/// steps along directions that the equations do not feel. Not seen: what `mb.root` and curves find is the same either way.
pub const REGULARISED: f64 = 1e-8;

/// Residual to which points of a search within a segment are solved, at most. Larger: events are less accurate. Smaller: rounding. Not
/// seen: events of curves are the same to the digits of tests.
pub const EVENT_SOLVED: f64 = 1e-11;

/// Width of a bracket over the segment, and a value over those at its ends, that are rounding. Larger: events are less accurate. Smaller:
/// bisections that change nothing. Not seen: events of curves are the same to the digits of tests.
pub const BRACKET: f64 = 1e-13;

/// Part of a segment down to which a jump is bracketed. Larger: jumps are told less accurately. Smaller: both sides cannot be told apart.
/// Not seen: jumps of curves are the same to the digits of tests.
pub const NARROW: f64 = 1e-9;

/// Part of a segment to which a bracket that cannot be narrowed any more must have come for its sides to be compared. Larger: sides far
/// apart pass as one branch. Smaller: jumps beside a singular point are called torn. Not scanned.
pub const NARROWED: f64 = 1e-3;

/// Distance between the two sides of a jump, over the scale of the unknowns, up to which they are one branch though the bracket is
/// narrower. Larger: torn branches pass as one. Smaller: rounding tears a branch. Not seen: contacts and branch points of tests are the
/// same either way.
pub const TORN: f64 = 1e-6;

/// How far one update of a step of bdf-bfgs may change the determinant of the inverse, this factor and over it. Beyond, the update is left
/// out. Larger: updates of use are left out. Smaller: one bad update ruins the inverse. Not seen: motions by "bdf-bfgs" are the same either
/// way.
pub const DETERMINANT: f64 = 1e-10;

/// Relative increment of forward differences and of power iterations by differences, about the root of eps. Larger: truncation. Smaller:
/// rounding. Not seen: motions by "bdf-bfgs", and the choice of methods, are the same either way.
pub const DIFFERENCE: f64 = 1e-7;
