//! Modes of large sparse systems.

/// Residual of a Ritz pair, over its value, at which it has converged. Larger: shapes are less accurate. Smaller: cycles in rounding. Not
/// seen: roots of chains agree with closed forms and with LAPACK either way.
pub const CONVERGED: f64 = 1e-11;

/// Part of a vector that is left of it beside the others, of a value of the whole operator over its largest, and of a strain (its square of
/// an energy), from which on they are rounding: of a span, of zeros that constraints leave, of rigid motion. Larger: new directions and
/// stiff modes are lost, and rows on soft springs are free. Smaller: a basis that is not orthogonal, constraints are told as modes, and
/// rigid motions have roots. Pinned by `test_a_stiff_mode_beside_a_constraint_is_a_mode`, `test_a_row_on_a_spring_of_any_softness` and
/// `test_a_free_row_of_any_springs_has_one_rigid_motion`.
pub const VANISHED: f64 = 1e-13;

/// Roots within this, over their size, are one: after a restart with new random vectors none was missing, a root and its conjugate are a
/// real one, no circle passes between them, and a factor at one of them stays this far away. Larger: a missing root passes. Smaller:
/// restarts for nothing. Pinned by `roots_that_differ_by_more_than_a_hundred_millionth_are_told_apart` and `test_oscillators_of_few_kinds`.
pub const SAME_VALUE: f64 = 1e-8;

/// First negative shift, over the largest ratio of the diagonals of K and M. It only comes nearer to zero from there. Larger: slower
/// convergence. Smaller: factors near to a singular matrix. Pinned by `test_a_free_chain_of_springs_of_all_sizes`.
pub const FIRST_SHIFT: f64 = 1e-4;

/// Values below this part of a shift are not elastic, where the next shift is looked for; one that turns out to be moves the shift nearer.
/// Larger: soft modes are far from the shift. Smaller: rounding of rigid modes attracts it. Pinned by
/// `test_a_free_chain_of_springs_of_all_sizes`, from below. Not seen from above: such chains take the same shifts.
pub const ELASTIC: f64 = 1e-7;

/// Eigenvalues of assembled matrices below this part of the shift cannot be told from zero. Larger: soft modes are rigid. Smaller: rigid
/// modes get roots of rounding. Pinned by `test_a_chain_on_a_weak_spring_is_not_free`, from above. Not seen from below: what rounding of
/// the entries leaves is added to it, and is more.
pub const RIGID: f64 = 1e-12;

/// Roots below this part of the shift are double zeros of rigid motion, which rounding moves by its root. Larger: slow modes are rigid.
/// Smaller: rigid motions oscillate. Pinned by `test_a_rigid_motion_beside_a_slow_one_is_one_zero_root`.
pub const RIGID_PAIR: f64 = 1e-5;

/// Slowest root over the largest ratio of strain and kinetic energy, above which a system without shift is regular: roots of rounding lie
/// below. Larger: shifts without need. Smaller: rigid motions oscillate. Pinned by `test_a_large_row_in_cross_coupled_bearings`, from
/// above. Not seen from below: the same roots are found from a shift beside zero and without one.
pub const HELD: f64 = 1e-6;
/// Estimated error of a root of a system that is not symmetric, above which the search has failed, and of the quotient of work and energy,
/// above which a saddle system without shift is singular. Larger: roots with few digits are returned. Smaller: near the onset of flutter
/// large models are refused. Pinned by `test_roots_that_circulation_hardly_parts_are_told_where_they_have_six_digits`.
pub const TOLD: f64 = 1e-6;
/// Relative distance of two roots of a system that is not symmetric, below which they are repeated: left and right vectors are then no
/// pairs, and no quotient of theirs makes the root better. Larger: digits of close roots are given away. Smaller: quotients of vectors that
/// are nearly orthogonal. Pinned by `test_roots_that_are_nearly_equal_are_repeated`.
pub const SAME_ROOT: f64 = 1e-7;
/// Turn of the argument of a determinant, in radians, that the last terms of its series may make on one panel of a path. Larger: wrong
/// counts of roots. Smaller: determinants without need. Pinned by `roots_in_discs_are_counted`.
pub const COUNT_TURN: f64 = 0.02;
/// Panels of a path after which a count is left open. Larger: work without end where roots lie on the path. Smaller: counts are left open
/// that need not be.
pub const COUNT_PANELS: usize = 400;

/// Share of eps |K|/|M| by which the rounding of single entries usually moves a root, typical of chains (measured). Larger: estimates are
/// pessimistic. Smaller: they are too small. Pinned by `test_estimates_over_random_chains`.
pub const ENTRY_NOISE: f64 = 0.05;
/// Residual of a Ritz pair, over its value, up to which it may be a root where a shift moves to the lowest one, and stays. Larger: the shift
/// runs after rounding. Smaller: it stays away from roots that are close together. Not seen: the roots of rows of 500 and 900 masses with
/// dampers, gyroscopes and circulation are the same at a hundredth and at a hundred times it.
pub const PLAUSIBLE: f64 = 0.1;
/// Distance of a shift from the lowest of roots that are close together, over the extent of those seen. Larger: it sees fewer of them.
/// Smaller: its factors see this one alone. Pinned by `test_crowded_general_roots_of_a_twin_row` and
/// `test_crowded_general_roots_are_those_of_the_state_matrix`.
pub const BESIDE_CROWD: f64 = 0.01;
