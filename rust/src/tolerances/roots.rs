//! Newton's method, continuation, quasi-Newton methods.

/// What a step of a search along a direction must gain, over its length squared: sigma1 and sigma2 of Li and Fukushima's rule, as `mb.root`
/// has them. Larger: full steps are halved that would do. Smaller: steps that gain next to nothing are taken. Pinned by
/// `a_full_step_gains_a_thousandth_of_its_square`.
pub const DESCENT: f64 = 1e-3;

/// Residual to which points of a search within a segment are solved, at most, and the shortest step of such a search; width of a bracket
/// over the segment, and a value over those at its ends, below which both are rounding of these points. Where a row is singular it leaves
/// the root of itself, by which the two sides of a bracket may part. Larger: events and peaks are less accurate. Smaller: points are
/// refused for their rounding, and bisections change nothing. Pinned by `a_circle_is_followed_all_around`, from above, and
/// `test_stability_of_a_thousand_masses_is_told`, from below.
pub const EVENT_SOLVED: f64 = 1e-11;

/// Part of a segment down to which a jump is bracketed. Larger: jumps are told less accurately. Smaller: both sides cannot be told apart.
/// Pinned by `a_jump_is_bracketed_to_a_billionth_of_its_segment`.
pub const NARROW: f64 = 1e-9;

/// Part of a segment to which a bracket that cannot be narrowed any more must have come for its sides to be compared. Larger: sides far
/// apart pass as one branch. Smaller: jumps beside a singular point are called torn. Pinned by
/// `the_sides_of_a_gap_are_one_branch_where_it_is_narrower_than_a_thousandth`.
pub const NARROWED: f64 = 1e-3;

/// Part of the natural size of an entry of the condensed dynamic stiffness that rounding of a factorisation may change, by its bound,
/// before the entry is refined, and part of a solution that a step of Newton's method may change which no step makes smaller. Free of
/// units. Too large: curves of finely divided structures carry the rounding; too small: refinements that change nothing, and curves of
/// long chains that stop. Pinned by `test_rounding_of_a_divided_beam_leaves_six_digits`, from above. Not seen from below: beams of tests gain
/// the eighth digit at most.
pub const FELT: f64 = 1e-6;
