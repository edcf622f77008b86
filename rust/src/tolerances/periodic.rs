//! Periodic motions: dynamic stiffness, residuals, events.

/// A coordinate counts at least as if it held this part of the largest root of an energy. Larger: steps of what is small beside the rest
/// are not measured. Smaller: what vanishes by symmetry measures steps by rounding, and branches do not begin. Pinned by
/// `test_script_agrees_with_its_references` (stewart_friction.py), from below. Not seen from above: responses in any units are the same
/// either way.
pub const LEAST_SCALE: f64 = 1e-6;

/// Time of a complex product in lanes, eight frequencies at once, over that of one in a sparse factor. Free of units. Larger: narrow bands
/// are factorised frequency by frequency. Smaller: wide ones are factorised as bands where sparse factors are faster. Only speed depends
/// on it. Pinned by `narrow_bands_are_condensed_in_lanes`.
pub const LANE_PRODUCT: f64 = 2.0;

/// Half-bandwidth times coordinates, 400 bytes each, up to which a band is factorised at eight frequencies at once. A count. Larger: memory
/// of many hundreds of megabytes. Smaller: long chains are factorised frequency by frequency. Only speed and memory depend on it. Pinned by
/// `narrow_bands_are_condensed_in_lanes`.
pub const MOST_LANES: f64 = 5e5;

/// Rounding of a row of equations, in units of eps times the sum of its absolute terms; of a law's state after a period, in units of eps
/// and the number of samples. Free of units. Too large: points and states that solve nothing pass; too small: points that are as good as
/// the arithmetic allows, and laws that relax fast, are refused. Pinned by `states_are_solved_up_to_their_bound` and
/// `every_accepted_state_solves_its_equations` of `periodic::periodic_state`, and used by tests/truth/test_frequency_blocks.py and
/// tests/nonlinear/test_state_laws.py.
pub const ROW_ROUNDING: f64 = 16.0;

/// Growth rates of perturbations below this fraction of the base frequency count as zero. Free of units. Too large: weak
/// instabilities are called stable; too small: rounding of the multipliers of undamped systems is called unstable.
/// Pinned by tests/truth/test_hbm_events.py.
/// Also by `growth_counts_from_its_bound_on`.
pub const NEUTRAL: f64 = 1e-9;

/// Accuracy of exponents, over the base frequency: |Re s| of one that crosses the imaginary axis at a point that was solved for (on the
/// unstable side of a border that was bracketed, where two exponents part like the root of the distance, the root of it); the sum of all
/// beside the trace; the distance from |Im s| = omega/2 of one that lies there; multipliers of the monodromy matrix beside those of Hill's
/// problem, whose place it takes. Free of units. Too large: jumps of the exponents where a contact closes are called bifurcations, and
/// wrong or lost exponents pass; too small: bifurcations of stiff systems, whose exponents have rounding, are lost, and Hill's problem is
/// solved at each point. Pinned by `where_an_exponent_crosses_tells_the_kind`.
pub const EXPONENT: f64 = 1e-6;

/// Growth over the base frequency at which the search for the place where an exponent crosses the axis ends. Free of units. Too large:
/// events are less accurate; too small: solutions with more harmonics that move them by less than their error. Pinned by
/// `test_exponents_at_borders_are_on_the_axis`, from above. Not seen from below: borders take one or two solutions more.
pub const CROSSED: f64 = 1e-11;

/// Steps of the finest integration over which a contact must last to be seen by the stability of a motion. A count. Too large:
/// the stability of short contacts is not told; too small: it is told wrongly. Pinned by tests/truth/test_hbm_events.py.
pub const CONTACT_STEPS: usize = 8;

/// Part of the range of an element's stiffness over the period by which it jumps where a contact opens or closes. Free of units. Too large:
/// partial contacts are missed; too small: smooth laws that bend fast count as contacts. Pinned by
/// `test_stability_is_open_where_a_stop_lies_within_the_error_of_the_peak` and `test_a_law_that_bends_smoothly_is_no_stop`.
pub const CONTACT_JUMP: f64 = 0.1;

/// Difference of |Im s| of two exponents over their sum up to which they are one pair. Free of units. Too large: a real exponent that
/// crosses beside a pair is taken for it; too small: a pair whose frequency drifts between two points is not known again. Pinned by
/// `exponents_whose_frequencies_differ_by_a_thousandth_are_one_pair`.
pub const SAME_PAIR: f64 = 1e-3;

/// How often a segment between two points of a branch is divided to exclude that an exponent crosses the axis and comes back. A
/// count. Too large: curves that come near the axis without a crossing cost more; too small: narrow bands without stability are
/// missed. Pinned by tests/truth/test_hidden_bands.py.
pub const HIDDEN: usize = 4;

/// How many times as steep as between two points of a branch the growth of an exponent may be just beside them. Free of units. Too large:
/// points are solved for where nothing crosses; too small: bands without stability whose flanks are steep are missed. Pinned by
/// `growths_between_two_places_may_be_twice_as_steep_as_beside_them`.
pub const STEEPER: f64 = 2.0;

/// Distance of Im s from 0 and from half of the base frequency, over the base frequency, within which a crossing exponent is real or
/// doubles the period. Free of units. Too large: slow tori are called branch points; too small: rounding of a double exponent
/// makes a torus of a branch point.
/// Pinned by `where_an_exponent_crosses_tells_the_kind`.
pub const RESONANT: f64 = 1e-4;

/// Expected error of the extrapolated monodromy matrix, relative to its size, that ends the doubling of steps; changes above the root of it
/// do not tell yet how fast the next ones will shrink. Free of units. Too large: multipliers of weakly damped motions have visible errors;
/// too small: steps are doubled down to rounding. Pinned by `doubling_ends_where_the_next_change_is_below_a_ten_billionth`.
pub const MONODROMY: f64 = 1e-10;

/// Largest relative difference of dynamic stiffness between a system and the reduced model that tells its stability. Free of units. Too
/// large: stability is told of another system; too small: it is computed from the full system, which takes longer. Pinned by
/// `test_a_reduced_model_whose_stiffness_is_off_by_a_thousandth_tells_nothing`.
pub const REDUCED_MODEL: f64 = 1e-3;

/// Multipliers below this part of the norm of the monodromy matrix are rounding of it, and the trace tells their exponents. Free of units.
/// Too large: fast decays are averaged; too small: they are rounding.
/// Pinned by `multipliers_that_rounding_hides_follow_from_the_trace`.
pub const VISIBLE: f64 = 1e-11;

/// How many times the estimated change of an exponent by the error of the motion counts before the exponent is believed without more
/// harmonics: the estimate sees the next harmonics only, and that of the change is of first order. Free of units. Too large: points are
/// solved for with more harmonics in vain; too small: a sign that the truncation decides is told. Pinned by
/// `test_exponents_that_the_error_is_far_from_turning_are_not_refined` and `test_what_more_harmonics_would_turn_is_not_told`.
pub const TURNING: f64 = 4.0;

/// How many times what the last doubling of the harmonics changed the next ones may change. Free of units. Too large: stability that is
/// known is called unresolved; too small: the truncation decides, where it does not fall at once: durations of contacts. Pinned by
/// `test_what_more_harmonics_confirm_is_told` and `test_what_more_harmonics_would_turn_is_not_told`.
pub const DECIDED: f64 = 2.0;

/// Even harmonics below this part of the error of a motion of odd ones are rounding. Free of units. Too large: motions without symmetry are
/// refined as if they had it; too small: symmetric ones cost four to eight times as much. Pinned by
/// `even_harmonics_of_a_millionth_of_the_error_are_rounding`.
pub const SYMMETRIC: f64 = 1e-6;

/// Unknowns up to which a motion is solved for with more harmonics. A count. Larger: a point takes minutes; smaller: more is
/// unresolved. Not scanned.
pub const MOST_REFINED: usize = 4000;
