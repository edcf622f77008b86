//! Steps in time: instants, what a step has to solve, start of the multistep methods.

/// Instants that differ by less, over the whole time, are one: rounding of t. A step ends by as much before a break, so that nothing in it
/// is from behind the break. Larger: breaks that are close are passed, and there are gaps in the motion. Smaller: steps that do not change
/// t, and rounding takes steps across breaks. Pinned by `test_breaks_beside_the_grid_of_fixed_steps_are_on_it` and
/// `test_steps_that_end_at_breaks_leave_no_gap`, from above, and `test_a_step_that_cannot_be_made_says_why`, from below.
pub const SAME_INSTANT: f64 = 1e-14;

/// Lengths of steps that agree so well are one length: no splinter is made, no factorisation anew, and differences of a multistep method
/// stay as they are. Larger: steps do not end where they are said to. Smaller: splinters. Pinned by
/// `test_breaks_beside_the_grid_of_fixed_steps_are_on_it`.
pub const SAME_LENGTH: f64 = 1e-9;

/// An instant within this part of a fixed step from a multiple of it is on the grid. Larger: steps are left out. Smaller: rounding of a
/// long motion makes splinters. Pinned by `test_breaks_beside_the_grid_of_fixed_steps_are_on_it`.
pub const ON_GRID: f64 = 1e-6;

/// Newton's remainder over the increment within a step whose next correction would be about its square: rounding. Larger: steps are not
/// solved, and derivatives of them are off. Smaller: one iteration more for nothing. Pinned by
/// `test_the_values_are_those_of_the_simulation`, from above, and `test_steps_are_not_solved_below_rounding`, from below.
pub const QUADRATIC: f64 = 1e-9;

/// What is solved where there is no tolerance to share, over the motion within the step: the remainder of Newton's method in a fixed step,
/// and in a controlled one that is kept for its derivatives; the norm of a step of "bdf-bfgs" that passes where a fresh inverse cannot
/// better it, and the error of its start steps (characteristic lengths or radians). So much is noise of a distance from a kink, over the
/// largest of the motion. Larger: the remainder shows in measured orders and in derivatives. Smaller: rounding is solved. Pinned by
/// `test_order_five_at_oblique_axes`, from above, and `test_motion_and_derivatives_have_the_order_of_radau`, from below.
pub const FIXED_SOLVED: f64 = 1e-12;
/// Over the tolerance of a controlled step, also of positions of the stages of an explicit one. Larger: the remainder is a part of its
/// error. Smaller: iterations for nothing. Pinned by `test_a_stiff_governor`, from above, and
/// `test_matrices_are_kept_and_the_explicit_method_has_none`, from below.
pub const SHARE_OF_TOLERANCE: f64 = 0.01;

/// What the equations of a step may leave where rounding alone is allowed: loops, over lengths of their loop or radians (what shrinks no
/// more ends at `constraints::CLOSED_ENOUGH`), the equations of a fixed step of "bdf-bfgs" over the motion within it, where that is more than
/// `NOISE_SHARE` of its error (remainders are of accelerations and add up twice), and the distance from a kink at which a step ends for derivatives, over the largest of the motion.
/// Larger: energy drifts by openings, and shorter steps err more. Smaller: rounding is corrected. Pinned by
/// `test_shorter_fixed_steps_err_less`, from above, and `test_work_of_steps_that_keep_matrices_and_lengths`, from below.
pub const CLOSED: f64 = 1e-14;

/// What starts from rest has no rates: they count at least as if the motion took this part of the characteristic length, or a radian, and
/// an acceleration counts as a rate for this part of the motion, at most for a step. Larger: slow motions keep long steps of which they
/// know nothing, and drives that push for a moment set the scale of all. Smaller: the first steps from rest are far too long, and made
/// again. Pinned by `test_a_table_that_wakes_up_is_not_passed_over`, from above. Not seen from below: smooth motions of tests take the same
/// steps but for one in two hundred.
pub const FROM_REST: f64 = 1e-3;

/// What is noise beside the tolerance of controlled steps, over it: distances from a kink in steps and at their ends, over the largest of the
/// motion, and the error of a start step of "bdf-bfgs", which has to be far below that of the steps that follow on it; beside what a fixed
/// step of "bdf-bfgs" errs in its rates: what its equations are left with adds up, while errors of steps take turns in sign. Larger: kinks
/// are passed by as much and not seen, differences of the first points show the errors of the start, and shorter fixed steps err more.
/// Smaller: remainders of Newton's method are taken for passages, start steps are divided, and fixed steps solved, for nothing. Pinned by
/// tests/gradients/test_gradient_bounces.py and `test_shorter_fixed_steps_err_less`, from above, and
/// `test_a_fixed_step_is_solved_to_a_share_of_what_it_errs`, from below.
pub const NOISE_SHARE: f64 = 1e-3;
/// What a kink changes in a step, over its tolerance, below which the step may pass it, and what a law changes between a kink and the end of
/// a step that is to end there. Larger: kinks add to the error of steps. Smaller: kinks are searched that no error shows. Pinned by
/// `test_steps_end_at_kinks_that_errors_show`.
pub const KINK_EFFECT: f64 = 0.05;
/// Steps in a row that end at one kink, above which the law passes it again and again. Larger: sliding on a law that chatters is followed in
/// vain. Smaller: true contacts are not met.
pub const KINK_AGAIN: usize = 12;
/// Steps for which such a kink is ignored at first; twice as many each time, and so often at most. Larger: kinks behind are not met. Smaller:
/// chatter costs time.
pub const KINK_REST: usize = 16;
/// See `KINK_REST`.
pub const LONGEST_REST: u32 = 12;
/// Kinks of states of a model, reversals of rates or states, above which steps end at none of them and the error control passes all: twenty
/// hinges with hysteresis reverse more often than steps end. Larger: motions of many such laws take twice the time. Smaller: few laws are
/// less accurate. Pinned by `test_hinges_with_hysteresis_reverse_more_often_than_steps_end`, from above.
pub const KINK_CROWD: usize = 4;
/// What a kink changes in a motion within the step behind it, over the rates or the characteristic length, at most; the change grows with
/// the square of the step. Larger: a step goes over many vibrations of a stiff contact before its error shows them. Smaller: steps behind kinks
/// are short for nothing. Pinned by `test_steps_behind_contacts_are_good_at_once`, from above, and
/// `test_steps_behind_kinks_are_not_short_for_nothing`, from below.
pub const KINK_CHANGE: f64 = 1.0;
/// Steps between two that are both at a kink by the noise of steps, to find it to rounding. Larger: noise is searched. Smaller: laws are
/// held on their side for too long.
pub const KINK_POLISH: usize = 5;
/// Distances from a kink inside a step, whose motion is interpolated there, and of kinks that lie together, over the largest. Larger: a kink
/// that is passed forth and back within a step is not seen. Smaller: errors of the interpolation are taken for one, and stops at one place
/// for two. Pinned by `test_a_stop_that_is_hardly_touched_within_a_step`, from above. Not seen from below: the interpolation of steps to the
/// tolerance of derivatives is as good.
pub const SEEN_KINK: f64 = 1e-7;
/// Accelerations on both sides of a kink of a function that differ by more, over the largest of the motion, jump; slopes on both sides of
/// a kink on which a motion rests, over their own. Larger: a small jump is taken for a kink, and its part of a derivative is left out.
/// Smaller: what the end of a step is off its kink is taken for a jump. Pinned by `test_a_small_jump_is_one_and_a_stiff_contact_none`.
pub const JUMP: f64 = 1e-4;
/// Steps of the search for one that ends at a kink. Larger: a law that jumps holds the motion up. Smaller: kinks are missed, and said so.
pub const KINK_SEARCH: usize = 60;

/// Lower limit of the norm of the equations of a step of "bdf-bfgs", over the root of their number: rounding of constraint rows. Larger:
/// steps are not solved, and orders and lengths of steps follow what is left. Smaller: rounding is solved, and no run past singular poses
/// is good enough. Pinned by `test_rows_of_a_loop_are_solved_to_their_rounding`.
pub const ROW_ROUNDING: f64 = 1e-15;

/// How much looser a trial run is that shows how much of its local errors lasts. Larger: its error is no longer in proportion. Smaller:
/// trials cost more than they save. Pinned by `test_a_trial_costs_little_and_tells_how_much_of_errors_lasts`.
pub const TRIAL: f64 = 1e3;
/// Tolerance of the loosest trial. Larger: motions that bend within a step are taken for damped. Smaller: loose tolerances get no trial.
/// Pinned by `tests/motion/test_shares.py`.
pub const LOOSEST_TRIAL: f64 = 0.2;
/// What the error of a motion may be over the tolerance by its trials. Larger: unlucky motions miss the tolerance. Smaller: steps for
/// nothing. Pinned by `tests/motion/test_shares.py`.
pub const LASTING: f64 = 0.5;
/// The smallest share: where errors grow as those of a chaotic motion do, no tolerance holds them. Larger: motions that amplify errors miss
/// the tolerance. Smaller: chaotic motions take steps for nothing. Pinned by `tests/motion/test_shares.py`, from above. Not seen from
/// below: only work depends on it.
pub const LEAST_SHARE: f64 = 0.04;

/// Iterations of steps of "radau" that are recorded for a gradient: their lengths were chosen before, and to a looser tolerance. Larger: steps
/// that cannot be solved are given up late. Smaller: gradients stop at steps that their motion made. Not scanned.
pub const RECORDED_ITERATIONS: usize = 5 * super::motion::NEWTON_ITERATIONS;
/// Matrices with which more iterations than these are to be expected are made anew. Larger: iterations for nothing. Smaller: matrices for
/// nothing. Pinned by `test_work_of_steps_that_keep_matrices_and_lengths` and `test_matrices_are_kept_and_the_explicit_method_has_none`.
pub const PATIENCE: f64 = 5.0;
/// Matrices with which corrections shrank more slowly than `SLOW`, in more iterations than these, are made anew for the next step. Larger:
/// iterations for nothing. Smaller: matrices for nothing. Only work depends on it. Not scanned.
pub const FEW: usize = 2;
/// See `FEW`; of the contraction. Also what matrices that served before are trusted to shrink a first correction by, at most: it says
/// nothing of how fast they shrink. Pinned by `test_work_of_steps_that_keep_matrices_and_lengths`.
pub const SLOW: f64 = 0.1;
/// Matrices that shrink corrections more slowly by this factor than when they were new have aged; others are as good as new ones: what they
/// leave out is of the order of the step. Larger: iterations for nothing. Smaller: matrices for nothing. Pinned by
/// `test_work_of_steps_that_keep_matrices_and_lengths` and `test_matrices_are_kept_and_the_explicit_method_has_none`.
pub const AGED: f64 = 2.0;
/// Steps that would grow by less keep their length and its factors. Larger: steps are short. Smaller: factors for nothing. Pinned by
/// `test_work_of_steps_that_keep_matrices_and_lengths`.
pub const WORTHWHILE: f64 = 1.2;
/// The error of a step over a power of its estimate. Larger: motions are better than asked. Smaller: they are worse. Pinned by
/// `tests/motion/test_radau.py`.
pub const LEVEL: f64 = 10.0;
