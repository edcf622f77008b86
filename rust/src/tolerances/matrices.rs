//! Entries and factors of matrices.

/// Rounding of an entry in units of eps times the sum of the sizes of what was added up for it: of a constraint row, of a force or a
/// stiffness of an equilibrium (also times one and the distance from the origin) or a steady motion, of the force of a slider, of the distance from a kink of a law, of an entry beside a diagonal in
/// units of the masses. Larger: a model far from the origin has doubtful loops, the search for an equilibrium ends early, sliders that stick
/// close to their limit slip, and weak negative coupling of unheld directions is lost. Smaller: rows of rounding lock a door on two hinges,
/// models far from the origin have no equilibrium, and rigid directions get roots of rounding. Pinned by
/// `test_a_door_far_from_the_origin_is_no_doubtful_one`, `test_a_door_far_from_the_origin_is_locked_by_hinges_that_are_off`,
/// tests/linear/test_equilibrium_estimate.py, tests/truth/test_steady_rotation.py (with jitter), `the_rate_decides_at_the_limit` of `force::jenkins`, tests/truth/test_damped_modes.py and
/// `test_a_weak_coupling_of_what_nothing_holds_lets_it_diverge`.
pub const ENTRY_ROUNDING: f64 = 4.0;

/// Two entries across the diagonal are the same within this part of the largest entry: a route for symmetric matrices may be taken.
/// Larger: a weak circulation is lost. Smaller: rounding of an assembly sends a symmetric system to the general route.
/// Pinned by `entries_are_the_same_within_their_bound`.
pub const SAME_ENTRY: f64 = 1e-14;

/// Relative asymmetry of given matrices up to which they count as symmetric, or skew, but for the digits that they were written with.
/// Larger: weak circulation is taken for noise. Smaller: matrices that were read from a file are refused.
/// Pinned by `asymmetry_counts_from_its_bound_on`.
pub const ASYMMETRY: f64 = 1e-10;

/// The same of one spring, from which on its stiffness is not that of an energy; and eigenvalues of it, over the largest, of directions in
/// which it does not act. Larger: energy balances are off without a word. Smaller: turned matrices of a symmetric stiffness have no energy.
/// Pinned by `test_a_bushing_that_is_symmetric_to_rounding_has_an_energy`.
pub const NO_ENERGY: f64 = 1e-12;

/// Sizes within this of the largest count as equal, so that neither rounding nor units choose a pivot, or the sign and the rows that a
/// shape is told by: the first is taken. Larger: short pivots, and smaller components decide. Smaller: rounding decides. A choice, never
/// an answer, depends on it.
/// Pinned by `of_equal_components_the_first_is_the_largest`.
pub const TIE: f64 = 1e-6;

/// Components of a direction, over its largest, whose coordinates or rows are named in messages. Larger: none is. Smaller: those that hardly
/// take part are.
/// Pinned by `test_a_free_direction_is_named_by_its_large_coordinates`.
pub const NAMED: f64 = 0.3;

/// A pivot below this part of the diagonal entry from which it came is rounding, and the matrix singular. Larger: light coordinates behind
/// heavy ones are called massless. Smaller: rounding over rounding.
/// Pinned by `a_pivot_of_rounding_has_no_normal_form`.
pub const PIVOT: f64 = 1e-13;

/// The same of M in the sparse route, which refuses then. Larger: graded masses are refused. Smaller: coordinates without mass pass.
/// Pinned by `masses_are_refused_from_their_bound_on`.
pub const MASS_PIVOT: f64 = 1e-14;

/// The same of K, where a shift at zero is no longer worth it, since free or nearly free motions answer. Only speed depends on it.
/// Pinned by `a_zero_shift_is_given_up_from_its_bound_on`.
pub const STIFFNESS_PIVOT: f64 = 1e-12;

/// Residual of a solution with L D L^T without pivots, over the size of its terms, from which on its inertia is not believed. Larger:
/// counts of a wrong factor pass. Smaller: counts of crowded spectra are refused. Pinned by
/// `inertia_is_told_where_small_pivots_leave_eleven_digits`.
pub const INERTIA_RESIDUAL: f64 = 1e-11;

/// Residual of a row over the sum of its absolute terms that is no more than rounding: the solution is that of a matrix whose entries differ
/// by so much of themselves. Larger: digits are given away. Smaller: corrections of nothing, and solutions of slow routes.
/// Pinned by `a_remainder_counts_from_its_bound_on` and `random_systems_are_solved_as_by_dense_factorisation`.
pub const BACKWARD: f64 = 1e-15;

/// Corrections of a solution of a band without pivots, by its residual. Larger: frequencies at which leading blocks are singular, which no
/// correction helps, cost more. Smaller: many others go to direct solutions. Only speed depends on it.
pub const CORRECTIONS: usize = 2;

/// A root moves no more when its step was below this part of its size; what is left of a single root is its square then. Larger: roots that
/// lie on each other stop short of their digits. Smaller: rounding moves roots for ever, and the slow route answers. Pinned by
/// `poles_of_narrow_bands_need_no_modes`, from below. Not seen from above: of a single root the square of the last step is left.
pub const SETTLED: f64 = 1e-12;

/// Steps of each root, of which a single one takes three to ten and one that lies on another forty. Larger: time is lost where some
/// roots are real. Smaller: those on others are left to the slow route.
/// Pinned by tests/linear/test_frf_poles.py.
pub const MOST_SWEEPS: usize = 50;

/// Radius over its size of a disc that is known to hold a root, from which on it counts as not found. Larger: a root may be missing that
/// lies close to another. Smaller: rounding sends large systems to the slow route.
/// Pinned by `discs_tell_roots_that_are_missing_or_inexact`.
pub const ENCLOSED: f64 = 1e-9;
