//! Steps in time: instants, what a step has to solve, start of the multistep methods.

/// Instants that differ by less, over the whole time, are one: rounding of t. Larger: breaks that are close are passed. Smaller: steps that
/// do not change t. Pinned by `test_a_step_that_cannot_be_made_says_why`, from below. Not seen from above: it takes breaks closer than
/// 1e-12 of the motion.
pub const SAME_INSTANT: f64 = 1e-14;

/// How far before a break a step ends, over the whole time, so that nothing in it is from behind the break. Larger: a gap in the motion.
/// Smaller: rounding takes the step across. Pinned by `test_steps_that_end_at_breaks_leave_no_gap`, from above. Not seen from below:
/// instants are rounded to less than 1e-15.
pub const BEFORE_BREAK: f64 = 1e-13;

/// Lengths of steps that agree so well are one length: no splinter is made, and no factorisation anew. Larger: steps do not end where they
/// are said to. Smaller: splinters. Not seen: times of ends are set, whatever lengths are called one; only lengths that differ by so little
/// depend on it.
pub const SAME_LENGTH: f64 = 1e-9;

/// An instant within this part of a fixed step from a multiple of it is on the grid. Larger: steps are left out. Smaller: rounding of a
/// long motion makes splinters. Not seen: it takes 1e8 steps until rounding of their sum reaches it, or a break this close to the grid.
pub const ON_GRID: f64 = 1e-6;

/// Steps whose ratio differs from one by less leave the differences of a multistep method as they are. Larger: the history is off by this
/// part. Smaller: histories are stretched by rounding. Not seen: it takes steps that differ by so little.
pub const SAME_STEP: f64 = 1e-12;

/// Newton's remainder over the increment within a step whose next correction would be about its square: rounding. Larger: steps are not
/// solved, and derivatives of them are off. Smaller: one iteration more for nothing. Pinned by
/// `test_the_values_are_those_of_the_simulation`, from above. Not seen from below: what one iteration more finds is rounding.
pub const QUADRATIC: f64 = 1e-9;
/// The same from which on tangents are the same too: derivatives of a motion part by less than 1e-10. Not seen: gradients of "ali3p" agree
/// with differences either way.
pub const EXACT: f64 = 1e-11;

/// Remainder of Newton's method over the motion within a fixed step, which has no tolerance, and within a controlled one that is kept for
/// its derivatives. Larger: the remainder shows in measured orders and in derivatives. Smaller: rounding is solved. Pinned by
/// `test_order_five_at_oblique_axes`, from above, and tests/gradients/test_gradient_radau.py, from below.
pub const FIXED_SOLVED: f64 = 1e-12;
/// The norm of the equations over the motion within a fixed step of "bdf-bfgs": remainders are of accelerations, and add up twice. Larger:
/// shorter steps err more. Smaller: evaluations for nothing. Pinned by `test_shorter_fixed_steps_err_less`, from above. Not seen from below:
/// no answer depends on it.
pub const FIXED_WITHOUT_TANGENT: f64 = 1e-14;
/// Over the tolerance of a controlled step. Larger: the remainder is a part of its error. Smaller: iterations for nothing. Pinned by
/// `test_a_stiff_governor`, from above, and `test_matrices_are_kept_and_the_explicit_method_has_none`, from below.
pub const SHARE_OF_TOLERANCE: f64 = 0.01;

/// Closing of loops within a step, over lengths of their loop or radians, at which no further step is made; what shrinks no more ends at
/// `constraints::CLOSED_ENOUGH`. Larger: energy drifts by openings. Smaller: rounding is corrected. Not seen: motions of loops, their
/// energies and gradients pass either way.
pub const CLOSED: f64 = 1e-14;
/// Loosest closing of the stages of a step far from singular poses. Larger: accelerations of stages miss the tolerance. Smaller: time is
/// lost. Not seen: it takes tolerances above 1e-5.
pub const COARSELY_CLOSED: f64 = 1e-7;

/// Turned rates that move less than this within a step, characteristic lengths or radians, are rounding of a motion at rest. Larger: a
/// branch may be lost in slow motion. Smaller: rest cannot go on. Not seen: motions through singular poses, and from rest, pass either way.
pub const STILL: f64 = 1e-10;

/// Local errors near singular poses below this are lost in the rounding that the pose amplifies: a tolerance that asks for less is held to
/// it. Larger: crossings are less accurate. Smaller: crossings are refused. Not seen: motions through singular poses pass either way, with
/// a hundredth of it in twice the time.
pub const FINEST_CROSSING: f64 = 1e-10;

/// Step of the differences by which the acceleration of a rotation vector is found at the end of a step, characteristic lengths or radians:
/// these are central, of a smooth map alone. Larger: truncation. Smaller: rounding. Only what is read between steps depends on it. Not
/// seen: either way orientations between steps change by less than 1e-9, and the polynomial through the ends errs by more.
pub const INTERPOLATED: f64 = 1e-5;

/// Error of a start step of bdf-bfgs, characteristic lengths or radians: for fixed steps; and the least under a tolerance. Larger: the
/// start shows in the error. Smaller: rounding divides start steps without end. Not seen: start steps of tests err by less, and are made at
/// once.
pub const START_ERROR: f64 = 1e-10;
/// See `START_ERROR`. Not seen: start steps of tests err by less, and are made at once.
pub const LEAST_START_ERROR: f64 = 1e-12;
/// The same over a tolerance. Larger: differences of the first points show the errors of the start, and steps are rejected. Smaller: more
/// parts. Not seen: start steps of tests err by less, and are made at once.
pub const START_SHARE: f64 = 1e-3;
/// Shortest part of a start step, over the step. Larger: kinks at the start refuse the motion. Smaller: they hold it up. Not seen: motions
/// of "bdf-bfgs" pass either way.
pub const SHORTEST_START: f64 = 1e-7;

/// What starts from rest has no rates: they count at least as if the motion took this part of the characteristic length, or a radian, and
/// an acceleration counts as a rate for this part of the motion, at most for a step. Larger: slow motions keep long steps of which they
/// know nothing, and drives that push for a moment set the scale of all. Smaller: the first steps from rest are far too long, and made
/// again.
pub const FROM_REST: f64 = 1e-3;
/// How fast the length of past steps is forgotten, over time in such lengths. Larger: one short step makes the detour around a pose short.
/// Smaller: a detour is as long as steps were long ago. Not scanned.
pub const FADING: f64 = 0.3;

/// Distances from a kink of a law over the largest of the motion at which a step ends at the kink. Larger: a law is held on its side
/// for as much too long, which derivatives behind stiff contacts show. Smaller: rounding is searched. Pinned by
/// `tests/gradients/test_gradient_bounces.py`, from above.
pub const AT_KINK: f64 = 1e-14;
/// The same beyond which a motion is on the other side. Larger: kinks are passed by as much and not seen. Smaller: remainders of Newton's
/// method are taken for passages. Pinned by `tests/gradients/test_gradient_at_kinks.py`.
pub const BESIDE_KINK: f64 = 1e-11;
/// The same over the tolerance of controlled steps, below which the ends of steps are noise. Larger and smaller: as of `BESIDE_KINK`.
pub const KINK_SHARE: f64 = 1e-3;
/// Distances over the largest of the motion, and over the tolerance, at which a step ends at the kink where no derivative is wanted: a law that is
/// held as much too long errs by the square of it. Larger: stiff contacts show it. Smaller: another step for each kink.
pub const KINK_FOUND: f64 = 0.01;
/// How far another interpolation moves the first guess of the length of a step to a kink, over the step, below which it is as good as the
/// interpolation. Larger: more steps. Smaller: interpolations for nothing. Only work depends on it.
pub const KINK_GUESSED: f64 = 1e-6;
/// What a kink changes in a step, over its tolerance, below which the step may pass it. Larger: kinks add to the error of steps. Smaller:
/// kinks are searched that no error shows. Pinned by `tests/motion/test_kinks.py`.
pub const KINK_EFFECT: f64 = 0.05;
/// Steps in a row that end at one kink, above which the law passes it again and again. Larger: sliding on a law that chatters is followed in
/// vain. Smaller: true contacts are not met.
pub const KINK_AGAIN: usize = 12;
/// Steps for which such a kink is ignored at first; twice as many each time, and so often at most. Larger: kinks behind are not met. Smaller:
/// chatter costs time.
pub const KINK_REST: usize = 16;
/// See `KINK_REST`.
pub const LONGEST_REST: u32 = 12;
/// Steps that end at kinks of states beyond those that do not, from which on they are passed by the error control: twenty hinges with
/// hysteresis reverse more often than steps end. Larger: motions of many such laws take twice the time. Smaller: few laws are less accurate.
pub const KINK_CROWD: usize = 8;
/// Steps for which they are, at first; twice as many each time. Larger: as of a smaller `KINK_CROWD`. Smaller: as of a larger one.
pub const CROWD_REST: usize = 64;
/// Steps between two that are both at a kink by the noise of steps, to find it to rounding. Larger: noise is searched. Smaller: as of a
/// larger `AT_KINK`.
pub const KINK_POLISH: usize = 5;
/// Part of a natural time of a motion after which it is beside a kink on which it begins. Larger: it may be back again. Smaller: it is
/// still on it, to rounding. Not scanned.
pub const AHEAD: f64 = 1e-5;
/// The same inside a step, whose motion is interpolated there. Larger: a kink that is passed forth and back within a step is not seen.
/// Smaller: errors of the interpolation are taken for one, and steps are shorter.
pub const SEEN_KINK: f64 = 1e-7;
/// Rounding of the distance from a kink, over the characteristic length or the largest rate: it is zero below that. Larger: a kink is
/// passed by as much, which no derivative shows. Smaller: rounding of a motion that rests on a kink is taken for passages without end.
pub const ROUNDED_DISTANCE: f64 = 16.0 * f64::EPSILON;
/// Accelerations on both sides of a kink of a function that differ by more, over the largest of the motion, jump; slopes on both sides of
/// a kink on which a motion rests, over their own. Larger: a small jump is taken for a kink, and its part of a derivative is left out.
/// Smaller: what the end of a step is off its kink is taken for a jump.
pub const JUMP: f64 = 1e-4;
/// Steps of the search for one that ends at a kink. Larger: a law that jumps holds the motion up. Smaller: kinks are missed, and said so.
pub const KINK_SEARCH: usize = 60;

/// Norm of the equations of a step of bdf-bfgs over a tolerance for the motion, which about a thousand steps share. Larger: the remainder
/// adds up to the tolerance. Smaller: evaluations for nothing. Not seen: motions of tests err by less than their tolerance either way.
pub const SHARE_OF_MOTION: f64 = 1e-5;
/// Lower limit of that norm, over the root of the number of equations: rounding of constraint rows. Larger: steps are not solved, and
/// orders and lengths of steps follow what is left. Smaller: rounding is solved. Not seen: motions with constraints pass either way.
pub const ROW_ROUNDING: f64 = 1e-15;
/// The same where there are no rows: rounding of increments. Larger: shorter fixed steps err more. Pinned by
/// `test_shorter_fixed_steps_err_less`, from above.
pub const INCREMENT_ROUNDING: f64 = 1e-17;
/// The norm that passes where a fresh inverse cannot better it. Larger: unsolved steps pass. Smaller: motions near to singular poses stop.
/// Not seen: motions of tests pass either way.
pub const FRESH_INVERSE: f64 = 1e-11;

/// How much looser a trial run is that shows how much of its local errors lasts. Larger: its error is no longer in proportion. Smaller:
/// trials cost more than they save. Used by `tests/motion/test_shares.py`. Not seen: these tests pass either way.
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
/// nothing.  Pinned by `test_matrices_are_kept_and_the_explicit_method_has_none`, from below. Not seen from above: no answer depends on it.
pub const PATIENCE: f64 = 5.0;
/// Matrices with which corrections shrank more slowly than `SLOW`, in more iterations than these, are made anew for the next step. Larger:
/// iterations for nothing. Smaller: matrices for nothing. Only work depends on it. Not scanned.
pub const FEW: usize = 2;
/// See `FEW`; of the contraction. Not seen: no answer depends on it.
pub const SLOW: f64 = 0.1;
/// Matrices that shrink corrections more slowly by this factor than when they were new have aged; others are as good as new ones: what they
/// leave out is of the order of the step. Larger: iterations for nothing. Smaller: matrices for nothing.  Pinned by
/// `test_matrices_are_kept_and_the_explicit_method_has_none`, from below. Not seen from above: no answer depends on it.
pub const AGED: f64 = 2.0;
/// A first correction says nothing of how fast they shrink: matrices that served before are not trusted to shrink it by more. Larger: one
/// iteration more for nothing. Smaller: steps are called solved that are not.  Not seen: motions by "radau" pass either way.
pub const TRUSTED: f64 = 0.1;
/// Three rotations that act together turn at most so far in a step (radians): rotation vectors are ambiguous at a whole turn. Larger: a
/// body that spins is lost in its chart. Smaller: short steps. Used by `tests/motion/test_radau.py`. Not seen: these tests pass either way.
pub const WIDEST: f64 = 3.0;
/// Steps that would grow by less keep their length and its factors. Larger: steps are short. Smaller: factors for nothing.  Not seen: no
/// answer depends on it.
pub const WORTHWHILE: f64 = 1.2;
/// The error of a step over a power of its estimate. Larger: motions are better than asked. Smaller: they are worse. Pinned by
/// `tests/motion/test_radau.py`.
pub const LEVEL: f64 = 10.0;
