//! Eigenvalues and shapes.

/// Multiple of u (2^-53) times the sum of the sizes of the terms of an entry that counts as rounding of the entry made before
/// the solver saw it. Too small: roots of assembled matrices differ by more than their error. Too large: errors are pessimistic,
/// and soft modes are called rigid. Pinned by tests/truth/test_graded_modes.py (errors against 50 digits, rigid or soft).
pub const DATA_ROUNDING: f64 = 4.0;

/// Relative error of a squared frequency (algorithm only) above which the expensive route is taken: factors, Jacobi's singular values,
/// residuals in twice the precision. Too large: roots lose digits that the matrices hold. Too small: time is lost. Pinned by
/// tests/truth/test_graded_modes.py, from above, and `test_a_thin_beam_has_no_inertia_about_itself`, from below.
pub const SHARP: f64 = 1e-12;

/// Relative effect on a squared frequency up to which damping between two undamped modes is left out; it is added to the error.
/// Too large: shapes of coupled damping are real although they are not. Too small: rounding of proportional damping sends a
/// system to the general route. Pinned by
/// `test_damping_between_modes_counts_by_its_square_over_their_distance`.
pub const UNCOUPLED: f64 = 1e-13;

/// Product of backward error and normwise condition above which a root of the general route is checked by Newton's method with residuals in
/// twice the precision. What stays unchecked is off by about the square of this. Too small: every root costs a factorisation. Too large:
/// small roots of graded systems are wrong unseen. Pinned by `roots_whose_vectors_may_be_wrong_by_a_millionth_are_doubtful`.
pub const DOUBTFUL: f64 = 1e-6;

/// Share of Q''(s) times the distance to the nearest root that |psi^T Q'(s) phi| must reach for two roots alone to meet there; then a root
/// moves like the square root of its residual. Too small: errors at defects of order three and more are too small. Pinned by
/// `more_than_two_roots_meet_where_the_slope_is_less_than_a_tenth_of_that_of_two`.
pub const DOUBLE_ROOT: f64 = 0.1;

/// Distances, over that of the nearest root, of the roots that meet at a defect of order three and more. Too small: some of them are not
/// counted and the error is too small by their share. Too large: roots beside the defect make the estimate larger, by their number. Pinned
/// by `roots_within_ten_times_the_nearest_meet_with_it`.
pub const MEETING: f64 = 10.0;

/// Krylov cycles after which a zero shift is moved nearer to the lowest eigenvalues. Too small: factorisations are wasted on problems
/// that would have converged. Too large: crowded spectra waste cycles first. No answer depends on it: inertia counts prove that none
/// is missing. Pinned by tests/truth/test_crowded_modes.py.
pub const PATIENCE: usize = 15;

/// Bisections by inertia counts for that shift, at most: the range of 2^-50 of the largest eigenvalue is below rounding.
pub const BISECTIONS: usize = 50;

/// Part of each diagonal entry of M that is added before its factorisation is asked whether M is semidefinite: rounding of the inertia of a
/// rod about its own axis stays below. Too small: rods are refused. Too large: negative masses pass. Pinned by
/// `test_a_mass_may_be_negative_by_rounding`.
pub const SEMIDEFINITE: f64 = 1e-12;

/// What a factor of M holds of a coordinate beyond the others, over the length of its column, that is rounding of arms: the coordinate then
/// has no inertia of its own. A share of 1e-12 of a column is 1e-24 of a mass. Larger: light bodies on heavy ones are refused. Smaller:
/// roots of rounding. Pinned by `test_a_body_too_light_to_be_told_from_rounding_is_refused`.
pub const MASSLESS: f64 = 1e-12;

/// Sum of the sizes of the terms of a Rayleigh quotient over its value from which on it is taken in twice the precision. Below, its
/// rounding is part of the error of the data. Too small: work. Too large: soft modes of matrices lose digits that the entries hold. Pinned
/// by `test_soft_roots_of_exact_matrices_keep_their_digits`, from above. Not seen from below: only time depends on it.
pub const CANCELLING: f64 = 1e5;

/// Relative error of an assembled model's frequency, and relative strain of a rigid mode, from which on the factor of its stiffness is
/// worth a second solution. Too small: ordinary models are solved twice. Too large: soft modes keep the rounding of stiff springs. Pinned
/// by `test_a_model_is_solved_from_its_springs_where_the_sum_of_them_is_not_enough`.
pub const GRADED: f64 = 1e-9;

/// Roots that a symmetry makes equal come out this far apart: positions and closed loops carry some rounding. Derivatives treat them as
/// one. Larger: roots that differ lose their own derivatives. Smaller: derivatives of rounding's choice of shapes. Pinned by
/// `test_roots_that_rounding_has_parted_are_one_group` and `test_roots_that_differ_are_no_group`.
pub const SAME_ROOT: f64 = 1e-11;

/// A smaller pivot of M means that M is ill-conditioned: light bodies are lost in the rounding of heavy ones. Then a factor of M is used.
/// Too small: light bodies keep that rounding. Too large: time is lost. Pinned by tests/truth/test_soft_and_stiff.py, from below. Not seen
/// from above: only time depends on it.
pub const LIGHTEST: f64 = 1e-5;

/// |psi^T Q'(s) phi| relative to its terms, below which a root counts as near-defective: two roots of one mode then agree to about this,
/// and a damping ratio is within about its square of one. Larger: healthy roots are told as defective. Smaller: shapes of a defect, which
/// rounding chooses, pass without a word.
/// Pinned by `test_roots_that_nearly_meet_are_told`.
pub const NEAR_DEFECTIVE: f64 = 1e-6;

/// Roots further apart than this, over their size, are never called repeated, however badly conditioned they are; undamped ones that are
/// closer are rotated together instead of divided by their distance, damped ones that are closer and have one shape were found twice.
/// Larger: distinct roots share a shape. Smaller: the two of a defect, which part like the root of rounding, are called distinct. Pinned by
/// `test_roots_are_repeated_within_a_hundred_millionth_at_most`.
pub const CLOSEST: f64 = 1e-8;

/// Separation of a root (as of `NEAR_DEFECTIVE`) below which a first-order correction says nothing. Larger: corrections are left
/// out that would gain digits. Smaller: corrections of rounding.
/// Pinned by `roots_that_are_hardly_separated_are_not_corrected`.
pub const SEPARATED: f64 = 1e-4;

/// First-order change of a root, over it, or of orthonormal null vectors, that is no correction any more; Newton's method whose last step
/// is larger has not converged. Larger: roots move by what the first order does not know. Smaller: corrections are left out that would gain
/// digits. Pinned by `large_steps_are_no_corrections`.
pub const LARGEST_CORRECTION: f64 = 1e-3;

/// Pivots of an equilibrated matrix, and the smallest eigenvalue in units of the masses over the largest, above which nothing is rigid and
/// rank needs no eigenproblem. Larger: time is lost. Smaller: rank is decided by pivots, which see it to within a factor of the size of the
/// matrix. Pinned by `test_pivots_of_rounding_leave_the_rank_to_an_eigenproblem`.
pub const CLEARLY_REGULAR: f64 = 1e-8;

/// Roots of less modulus than this share of |A| come from the reversed problem, where they are the large ones. Larger: work is done twice.
/// Smaller: small roots keep the rounding of the large ones. Pinned by
/// `test_roots_a_million_times_slower_than_others_come_from_the_reversed_problem`.
pub const BLURRED: f64 = 1e-6;

/// |x^T A x| over the largest |x^T A y| of a group below which x is isotropic to rounding and is mixed with another of the group. Larger:
/// bases turn for nothing. Smaller: vectors are divided by rounding. Pinned by
/// `a_vector_that_is_isotropic_to_a_ten_thousandth_is_mixed_with_another`.
pub const ISOTROPIC: f64 = 1e-4;

/// Relative commutator of stiffness and damping above which damping is not proportional, before any eigenproblem is solved. Larger: an
/// eigenproblem is solved for nothing. Smaller: rounding sends proportional damping to the general route.
/// Pinned by `test_damping_that_does_not_commute_is_not_tried_as_proportional`.
pub const COMMUTING: f64 = 1e-8;

/// Sign characteristic of a real root, over its terms, that counts as zero. Larger: overdamped pairs are formed by likeness alone.
/// Smaller: rounding forms pairs.
/// Pinned by `a_sign_counts_from_its_bound_on`.
pub const NEUTRAL: f64 = 1e-10;

/// Change of a rigid mode's stiffness by a parameter, over its terms, below which the mode stays rigid. Larger: soft springs that hold a
/// mode have no derivative. Smaller: rounding holds it. Pinned by `test_a_rigid_mode_stays_rigid_under_rounding_only`.
pub const STILL_RIGID: f64 = 1e-10;

/// Part by which the square of an entry must exceed the product of its diagonal entries for no semidefinite matrix to have it.
/// Larger: indefinite entries of rounding stay. Smaller: entries at the limit, those of a spring between two masses, count as rounding.
/// Pinned by `an_entry_of_rounding_that_no_semidefinite_matrix_has_is_dropped`.
pub const INDEFINITE: f64 = 1e-12;

/// Length of the first correction of an undamped mode by damping, up to which damping is light: roots are then found by corrections
/// of all modes at once. Larger: passes are made that do not converge, before the state matrix is solved. Smaller: state matrices
/// are solved where it takes several times as long. No answer depends on it. Pinned by
/// `light_damping_takes_no_state_matrix`.
pub const LIGHT: f64 = 0.65;
