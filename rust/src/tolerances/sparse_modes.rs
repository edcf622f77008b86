//! Modes of large sparse systems.

/// Residual of a Ritz pair, over its value, at which it has converged. Larger: shapes are less accurate. Smaller: cycles in rounding.
pub const CONVERGED: f64 = 1e-11;

/// Part of a vector that is left of it beside the others, from which on it is rounding of their span. Larger: new directions are thrown
/// away. Smaller: a basis that is not orthogonal. Pinned by `test_oscillators_of_few_kinds`, from below.
pub const DEPENDENT: f64 = 1e-13;
/// The same of a random vector, which has a large part outside of any span that is not the whole space. Not seen: beside a span that is not
/// the whole space a random vector keeps far more, beside the whole space far less.
pub const DEPENDENT_RANDOM: f64 = 1e-10;

/// The same of a correction of a shape, whose solution is not that accurate. Larger: shapes stay as inaccurate as they are. Smaller:
/// the subspace grows by noise.
pub const INSIDE: f64 = 1e-3;

/// Moduli of two Ritz values that are equal but for rounding: a conjugate pair stays together. Larger: values of two pairs are
/// mixed in their order. Smaller: a pair is cut.
pub const SAME_MODULUS: f64 = 1e-12;

/// Relative change of eigenvalues after a restart with new random vectors below which none was missing. Larger: a missing one passes.
/// Smaller: restarts for nothing.
pub const SAME_VALUE: f64 = 1e-9;
/// The same of damped roots, of which rounding makes more. Pinned by `test_oscillators_of_few_kinds`, from below.
pub const SAME_DAMPED: f64 = 1e-8;

/// Estimated error of an eigenvalue, over it, at which the rounds of widening end. Larger: digits are given away. Smaller: rounds
/// that change nothing.
pub const RESOLVED: f64 = 1e-12;

/// Rounding of a sum of some ten thousand positive energies, over the sum. Larger: errors are pessimistic. Smaller: they are too small.
pub const SUM_ROUNDING: f64 = 1e-14;

/// Values of the whole operator below this part of its largest are zeros that constraints leave. Larger: stiff modes are lost. Smaller:
/// constraints are told as modes. Pinned by `test_a_stiff_mode_beside_a_constraint_is_a_mode`, from above.
pub const CONSTRAINED: f64 = 1e-13;

/// First negative shift, over the largest ratio of the diagonals of K and M. It only comes nearer to zero from there. Larger: slower
/// convergence. Smaller: factors near to a singular matrix. Not seen: no answer depends on it.
pub const FIRST_SHIFT: f64 = 1e-4;

/// Values below this part of a shift are not elastic, where the next shift is looked for. Larger: soft modes are far from the shift.
/// Smaller: rounding of rigid modes attracts it. Not seen: no answer depends on it.
pub const ELASTIC: f64 = 1e-7;

/// A gap behind the last wanted eigenvalue, over its distance from the shift, that can be counted through. Larger: wide groups are taken as
/// one. Smaller: a group is cut in two and found incomplete. Not seen: a group that is cut costs another search, and finds the same.
pub const GAP: f64 = 1e-6;

/// Distance behind the last wanted eigenvalue at which others are counted where the next one is far, over its distance from the shift.
/// Larger: more eigenvalues must be known. Smaller: pivots of a nearly singular matrix are counted. Not seen: no answer depends on it.
pub const COUNT_MARGIN: f64 = 1e-3;

/// Eigenvalues of assembled matrices below this part of the shift cannot be told from zero. Larger: soft modes are rigid. Smaller: rigid
/// modes get roots of rounding. Pinned by `test_a_chain_on_a_weak_spring_is_not_free`, from above. Not seen from below: what rounding of
/// the entries leaves is added to it, and is more.
pub const RIGID: f64 = 1e-12;
/// The same where energies come from strains: this part of the largest ratio of the diagonals.
pub const RIGID_BY_STRAINS: f64 = 1e-26;

/// An elastic eigenvalue below this part of the shift is soft beside it, and the shift moves nearer. Larger: factors without need.
/// Smaller: soft modes are less accurate.
pub const SOFT: f64 = 1e-6;

/// Roots below this part of the shift are double zeros of rigid motion, which rounding moves by its root. Larger: slow modes are rigid.
/// Smaller: rigid motions oscillate. Pinned by `test_a_rigid_motion_beside_a_slow_one_is_one_zero_root`, from below.
pub const RIGID_PAIR: f64 = 1e-5;

/// Part of a shape of a double zero, in the metric of M, that is left of it beside the rigid shapes before, from which on it is another
/// one: these shapes are right to about the root of the precision. Larger: a rigid motion is lost. Smaller: rounding is another one.
pub const ANOTHER_RIGID: f64 = 1e-3;

/// Relative difference of the energy of a shape and the work of the forces that hold it, above which a saddle system does not hold what it
/// should. Larger: wrong factors pass. Smaller: rounding refuses the route.
pub const ENERGY_IS_WORK: f64 = 1e-5;

/// Slowest root over the largest ratio of strain and kinetic energy, above which a system without shift is regular: roots of rounding lie
/// below. Larger: shifts without need. Smaller: rigid motions oscillate. Used by tests/linear/test_sparse_general.py.
pub const HELD: f64 = 1e-6;
/// Estimated error of a root of a system that is not symmetric, above which the search has failed. Larger: roots with few digits are
/// returned. Smaller: near the onset of flutter large models are refused. Pinned by
/// `test_roots_that_circulation_hardly_parts_are_told_where_they_have_six_digits`.
pub const TOLD: f64 = 1e-6;
/// Relative distance of two roots of a system that is not symmetric, below which they are repeated: left and right vectors are then no
/// pairs, and no quotient of theirs makes the root better. Larger: digits of close roots are given away. Smaller: quotients of vectors that
/// are nearly orthogonal. Pinned by `test_roots_that_are_nearly_equal_are_repeated`.
pub const SAME_ROOT: f64 = 1e-7;
/// Real part of a root, over its modulus, above which a vibration grows, where the estimated error is smaller. Larger: slow flutter is
/// called vibration. Smaller: rounding of undamped roots is called flutter. Used by tests/linear/test_sparse_general.py.
pub const GROWS: f64 = 1e-10;
/// Turn of the argument of a determinant, in radians, that the last terms of its series may make on one panel of a path. Larger: wrong counts
/// of roots. Smaller: determinants without need.
/// Pinned by `roots_in_discs_are_counted`, from above.
pub const COUNT_TURN: f64 = 0.02;
/// Distance of all turns from a whole number of half turns, in radians, up to which it counts roots. Larger: a root is lost. Smaller:
/// rounding leaves counts open.
/// Pinned by `roots_in_discs_are_counted`, from below.
pub const COUNT_DOUBT: f64 = 0.3;
/// Panels of a path after which a count is left open. Larger: work without end where roots lie on the path. Smaller: counts are left open
/// that need not be.
pub const COUNT_PANELS: usize = 400;

/// Part of EPS that the rounding of single entries usually leaves in a root, typical of chains (measured). Larger: estimates are
/// pessimistic. Smaller: they are too small.
pub const ENTRY_NOISE: f64 = 0.01;
/// Distance of a factor from the root whose left vector it gives, over the root. Larger: more steps of inverse iteration. Smaller: a
/// pivot of zero.
pub const BESIDE: f64 = 1e-13;
/// Residual of a Ritz pair, over its value, up to which it may be a root where a moving shift looks for the lowest one. Larger: the shift
/// runs after rounding. Smaller: it stays away from roots that are close together. Not seen: no answer depends on it.
pub const PLAUSIBLE: f64 = 0.1;
/// The same, at which the shift no longer moves. Larger: it stops too far from the roots. Smaller: factors without need. Not seen: no
/// answer depends on it.
pub const NEARLY_ROOT: f64 = 1e-4;
/// Imaginary part of a root, over its modulus, below which it is real. Larger: heavily damped pairs are taken as two real roots. Smaller: a
/// real root gets a conjugate.
pub const REAL_ROOT: f64 = 1e-12;
/// A gap between the moduli of neighbouring roots, over them, that a circle can pass. Larger: counts are left open that need not be. Smaller:
/// rounding decides on which side of the circle a root lies.
pub const NARROW: f64 = 1e-13;
/// Distance of a shift from the lowest of roots that are close together, over the extent of those seen. Larger: it sees fewer of them.
/// Smaller: its factors see this one alone. Not seen: no answer depends on it.
pub const BESIDE_CROWD: f64 = 0.01;
