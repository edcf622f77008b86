//! Every number that decides something: its meaning, its unit, and what goes wrong when it is too large or too small.
//!
//! "Pinned by": a test fails at a hundred times the number and at a hundredth of it, or on one of these sides. "Used by": tests
//! of what it decides, which pass at both. "Not seen": why no test can tell, from above and below or from one of them.
//! `benches/tolerances.py` tells which, and on which side.

pub mod frequency_response;
pub mod matrices;
pub mod modes;
pub mod periodic;
pub mod roots;
pub mod singular_poses;
pub mod sparse_modes;
pub mod steps;

/// Rank, redundancy and closure of constraints.
pub mod constraints {

    /// Singular values between the tolerance and this many times it make a constraint that is named as doubtful.
    /// Larger: sound models are called doubtful. Smaller: a lock by an inaccurate drawing is not explained.
    /// Pinned by `constraints_near_the_tolerance_are_doubtful`.
    pub const DOUBTFUL: f64 = 1e3;

    /// The same of constraints that lie far below all others of their block: no mechanism is that slender in one direction alone.
    /// Larger: genuine constraints are called doubtful. Smaller: axes that are off by a hundredth of a degree lock a linkage without a
    /// word.
    /// Pinned by `constraints_far_below_all_others_are_doubtful_for_longer`.
    pub const LOCKED: f64 = 1e4;

    /// How far below. Larger and smaller: as of `LOCKED`, the other way round.
    /// Pinned by `weak_constraints_are_apart_from_their_bound_on`.
    pub const APART: f64 = 1e2;

    /// How far redundant rows may open in motion, over the tolerance of the drawing: rows that part by s per radian of the freed direction
    /// open by up to some ten s over a large motion. Larger: a lost constraint is seen late. Smaller: doubtful linkages stop. Not seen:
    /// four-bars that are drawn within the tolerance open by less than it, others are locked where they are drawn.
    pub const REDUNDANT_OPEN: f64 = 1e2;

    /// Second-order form of a redundant combination on the motions that the rows leave free, over the tolerance of the drawing, from which
    /// on its pose is singular: there the constraints part like the square of the way. Larger: bifurcations are linearised. Smaller:
    /// linkages that are drawn inaccurately are called singular. Pinned by `test_a_third_parallel_link_may_be_longer_by_thirty_tolerances`.
    pub const SINGULAR_POSE: f64 = 1e2;

    /// Length of the look beside a drawn pose, in lengths of the loop or radians, by which a pose of lower rank is seen. Larger: the way
    /// back to the constraints is long. Smaller: the second-order part of a change point drowns in the tolerance. Not seen: poses whose
    /// rank rises beside them are named by their second order as well.
    pub const PROBE: f64 = 1e-2;

    /// Rounding of poses behind some joints: of an entry of a strain row in units of eps times the size of its terms, beside one for each
    /// body, and of a closed row in units of the rounding of its entries. Too small: a coordinate that no element strains counts as held,
    /// and Newton's method circles in rounding. Too large: weak levers are lost, and loops stay open by more than rounding. Pinned by
    /// `test_a_lever_of_some_hundred_last_digits_is_one`, from above. Not seen from below: hinges beside springs on their axes stay free,
    /// since the rank of equilibrated rows has a bound of its own.
    pub const POSE_ROUNDING: f64 = 32.0;

    /// What rounding may leave of poses where something amplifies it, in lengths of a loop, characteristic lengths or radians: a closing
    /// that does not go on, levers in loops, turned rates within a step, local errors near singular poses, and corrections over the motion
    /// within a step that matrices of the step itself do not shrink. Larger: rates and energies drift by openings, weak levers in loops are
    /// lost, a branch is lost in slow motion, and steps are called solved that are not. Smaller: models far from the origin do not close, a
    /// coordinate that no element strains counts as held, and steps at rest or near singular poses are repeated without end. Pinned by
    /// `test_right_or_stopped_with_the_pose`, from below. Not seen from above: loops, levers and motions of tests close to rounding,
    /// whatever they may leave.
    pub const CLOSED_ENOUGH: f64 = 1e-10;

    /// Singular values of a least-squares problem below this part of the largest belong to directions that no row feels.
    /// Larger: weak directions are left out. Smaller: rounding of states of self-stress is divided by. Entries are free of units.
    /// Pinned by `directions_that_no_row_feels_are_left_alone`.
    pub const FELT: f64 = 1e-10;
}

/// Coordinates of joints.
pub mod coordinates {
    /// Cosine of the angle between a hinge and the axis of a measured angle, as drawn, from which on turns of the hinge are turns of the
    /// angle: below 45 degrees they are, whatever the frame in which it is measured. Larger: angles between oblique shafts lose their
    /// turns, and a motion in which a spring needs them stops. Smaller: turns are counted that the angle does not make. Pinned by
    /// `tests/system/test_coordinates.py` between 40 and 50 degrees.
    pub const NEARLY_PARALLEL: f64 = std::f64::consts::FRAC_1_SQRT_2;

    /// How far the quaternion of a state that is handed over may be from length one. Larger: what is no rotation is taken for one.
    /// Smaller: states read from text with five digits are refused. Pinned by `tests/system/test_coordinates.py` between 1e-5 and 1e-3.
    pub const UNIT_QUATERNION: f64 = 1e-4;

    /// Points nearer to each other than this part of the size of the model or of their distance from the origin are one: nothing has a
    /// direction between them, and a spring is not stretched. Larger: short parts collapse. Smaller: rounding has a direction.
    /// Pinned by `test_a_spring_that_shrank_to_a_point_says_so` and `test_a_spring_that_is_longer_than_rounding_has_a_direction`.
    pub const SAME_POINT: f64 = 1e-12;
}

/// Static equilibrium.
pub mod equilibrium {
    /// Stiffness below this part of the largest of its island counts as none. Coordinates that are held softly, by less than the root of
    /// it, are stretched before. Larger: soft springs do not hold. Smaller: rounding holds what nothing restrains. Pinned by
    /// `test_what_a_weak_spring_holds_is_not_free`.
    pub const NO_STIFFNESS: f64 = 1e-12;

    /// A force along a direction without stiffness, over the size of the forces in its island, that moves it; left over along any
    /// coordinate it is more than a balance may leave. Larger: a weak push along a free direction passes, and what is not in
    /// balance is called converged. Smaller: rounding of forces in balance is an error. Pinned by tests/linear/test_equilibrium.py and
    /// tests/linear/test_equilibrium_estimate.py (converged is a claim about the residual).
    pub const PUSHED: f64 = 1e-9;

    /// What rounding usually makes, over what it may: the part of the bounds of places and forces that counts in the error of an
    /// equilibrium. Larger: errors are overstated. Smaller: they are understated far from the origin. Pinned by
    /// `test_the_error_far_from_the_origin_is_stated`, from below, and
    /// `test_estimated_error_is_the_true_one_over_random_cases`, from above.
    pub const USUAL: f64 = 0.125;

    /// Force that velocity rows which steer carry, over the size of the forces in its island, from which on a place is one of a family.
    /// Larger: the place of a family is followed. Smaller: the accuracy of an equilibrium refuses its derivatives. Pinned by
    /// `test_an_edge_that_carries_rounding_makes_no_family`.
    pub const FAMILY: f64 = 1e-7;

    /// A full step from a state whose unbalance, or whose open loops, may be rounding goes on if it leaves less than this part. Larger: steps in
    /// rounding. Smaller: digits are given away. Pinned by tests/linear/test_equilibrium_estimate.py, from above. Not seen from below: the digits are
    /// those of rounding.
    pub const SETTLED: f64 = 0.5;

    /// Skew part of the stiffness, over its island, that forces without an energy make. Larger: searches by energy go the wrong way.
    /// Smaller: rounding sends them the long way. Not seen: at a hundredth of it searches far from the origin still go by energy, at a
    /// thousandth one of `test_far_equilibrium` fails, and skew parts of tests are more than a hundred times as large.
    pub const NO_POTENTIAL: f64 = 1e-7;

    /// Negative stiffness, over the largest of its island, from which on an equilibrium is not stable. Larger: weak instabilities are
    /// called stable. Smaller: what is neutral falls by rounding.
    /// Pinned by `test_a_stiffness_that_is_negative_by_rounding_does_not_fall`.
    pub const FALLS: f64 = 1e-9;

    /// Unbalance, free of units, and step, in characteristic lengths or radians, that end the search: either alone at rounding; both
    /// together. Larger: digits are given away. Smaller: steps in rounding. Not seen: a search that ends early makes one last step, which
    /// leaves the square, and one that ends late in `test_far_equilibrium` some steps more.
    pub const BALANCED: f64 = 1e-14;
    /// See `BALANCED`. Pinned by `test_a_link_beyond_its_buckling_load`, from below. Not seen from above: the last step leaves its square.
    pub const NEARLY_BALANCED: f64 = 1e-11;

    /// Newton's step, in characteristic lengths or radians, from which on a slow search may descend in energy instead, where its last step
    /// was not shortened. Larger: loads without a potential and energies of rounding are descended in. Smaller: Newton's method goes to and
    /// fro. Pinned by
    /// tests/invariance/test_far_equilibrium.py, from above, and `test_a_chain_drawn_level_falls`, from below.
    pub const CLOSE: f64 = 1e-3;
}

/// Linearised matrices.
pub mod linearisation {
    /// Multiple of eps times the sum of the sizes of the terms of an entry below which the entry is rounding. Too small: rounding passes
    /// for stiffness, circulation or damping. Too large: weak effects beside strong ones in the same entry are lost. Pinned by
    /// tests/truth/test_terms_of_linearisations.py, from below, and `test_what_two_springs_across_leave_of_each_other_is_kept`, from above.
    pub const ENTRY: f64 = 8.0;

    /// Rounding of a few dozen terms of inertia that cancel, relative to their size. Too small: the turning of a shaft is held by a
    /// stiffness of rounding. Too large: soft supports of fast shafts are lost. Pinned by tests/truth/test_steady_rotation.py, from below,
    /// and by `test_a_soft_spring_of_a_fast_shaft_is_kept`, from above.
    pub const CANCELLED: f64 = 1e-14;

    /// An unbalanced force above this part of all forces makes a linearisation at rest questionable, and is told. Larger: matrices of a
    /// state that does not last pass without a word. Smaller: models in balance but for the digits of their drawing are warned of.
    /// Pinned by `test_a_millionth_of_the_forces_may_be_out_of_balance`.
    pub const BALANCED: f64 = 1e-6;

    /// Change of the given velocities, over their size, from which on it is told that they contradict the joints. Larger: contradictions
    /// pass. Smaller: rounding is told. Pinned by `test_velocities_that_contradict_joints_are_told`.
    pub const VELOCITY_CORRECTED: f64 = 1e-9;

    /// Displacements below this, in characteristic lengths or radians, do not count as strains where forces are called small. Larger: weak
    /// forces of soft springs are small. Smaller: rounding of places is a force. Pinned by
    /// `test_a_spring_that_is_stretched_by_more_than_rounding_is_out_of_balance`, from above. Not seen from below: springs stretched by
    /// 1e-14 of their length and less are in balance either way.
    pub const UNRESOLVED: f64 = 1e-8;
}

/// Motion in time.
pub mod motion {

    /// Part of a diagonal entry of M that the recursion over a tree must leave of it, or M is singular to rounding there and the dense
    /// route decides. Free of units. Larger: trees with heavy tips take the slow route. Smaller: accelerations of coordinates that
    /// move no inertia are rounding over rounding. Pinned by tests/system/test_tree_accelerations.py.
    pub const ARTICULATED: f64 = 1e4 * f64::EPSILON;

    /// Factor on the length of the next step that the error estimate proposes. Larger: more steps are repeated. Smaller: more steps are
    /// made. A choice of cost; seen by the step counts of tests/motion/test_motion_zoo.py, from below.  Pinned by
    /// `test_matrices_are_kept_and_the_explicit_method_has_none`.
    pub const SAFETY: f64 = 0.85;

    /// Iterations of simplified Newton methods within a step. Larger: steps that are too long are given up late. Smaller: steps that
    /// would converge are repeated. Seen by tests/motion/test_radau.py, not scanned.
    pub const NEWTON_ITERATIONS: usize = 12;

    /// A spline is quiet where its curvature is below this part of the largest. Larger: steps are held short where little happens. Smaller:
    /// a long step passes what comes after a stretch that is at rest but for rounding. Pinned by
    /// `a_spline_wakes_behind_a_stretch_that_bends_by_less_than_a_thousandth`.
    pub const QUIET: f64 = 1e-3;

    /// Repetitions that find the rotation vector of three rates that act together: each gains the turn within a step. Smaller: fast
    /// turns are refused. Seen by tests/motion/test_motion_rotations.py, not scanned.
    pub const ROTATION_REPETITIONS: usize = 40;
}

/// Rolling in motion.
pub mod rolling {
    /// Straight rolling: B''' and the third power of E, over the speed (lengths over the characteristic length) to the same power, and
    /// forces along the path over their terms and over the sum of all forces. Larger: motion on slow curves is linearised as if straight,
    /// and weak forces along the path pass unseen; smaller: rounding of a drawn model refuses it. Pinned by
    /// `test_a_path_that_bends_by_a_hundred_millionth_is_a_curve`.
    pub const ROLLS_STEADILY: f64 = 1e-9;

    /// Force that a displacement along the path of rolling makes, over the terms that it is made of, which counts as none where such
    /// displacements are looked for. Free of units. Rounding leaves 1e-15, the smallest force of a bicycle's lean 2e-3. Larger: a lean
    /// is taken for a heading and the bicycle refused; smaller: no heading is found and it is refused too. Never an answer: what is
    /// found is held against the other two. Pinned by `a_force_is_seen_from_its_bound_on` of linearize/rolling.rs and
    /// `test_a_bicycle_in_any_direction` of tests/truth/test_rolling.py.
    pub const UNFELT: f64 = 1e-8;

    /// Sine of the angle between the displacements that no force follows and the motions that rows allow, from which on they are apart;
    /// 0.9 of bicycles. E loses the digits of its inverse, 2e-12 here, and forces along the path are held to 1e-9. Larger: motions are
    /// refused whose answer has digits; smaller than 1e-7: what is left is rounding. Pinned by `directions_are_apart_from_their_bound_on`
    /// of linearize/rolling.rs.
    pub const APART: f64 = 1e-4;
}

/// Air forces on the sections of blades.
pub mod aero {
    /// Smallest inflow angle (rad) of an annulus through which the wind still blows. Too large: heavily loaded annuli reverse too early;
    /// too small: a hovering rotor in a breath of wind is taken for a windmill that blocks it. Pinned by
    /// `a_breath_of_wind_makes_no_windmill_of_a_hovering_rotor`, from below. Not seen from above: it takes inflow angles below 1e-4, a
    /// thousandth of those of rotors.
    pub const SMALLEST_INFLOW: f64 = 1e-6;

    /// k = a / (1 - a) at the axial induction a = 0.4 above which Buhl's parabola, which meets momentum theory there, replaces it. Larger:
    /// momentum theory is used where the wake is turbulent. Smaller: the parabola where momentum theory holds. Pinned by
    /// `thrust_is_that_of_momentum_and_of_buhl_from_two_fifths_on`.
    pub const HIGH_LOAD: f64 = 2.0 / 3.0;

    /// Steps of the search for an inflow angle that bisects every third. A count. Too small: roots are cut off; too large: nothing.
    pub const MOST_ANNULUS_STEPS: usize = 180;
}

/// Derivatives of motions.
pub mod sensitivity {
    /// A given rate jumps where it changes by more than this part of itself: an impact. Larger: impacts have derivatives that are wrong.
    /// Smaller: rounding of pieces of a motion is an impact.
    /// Pinned by `test_a_rate_that_changes_by_rounding_is_no_impact`.
    pub const IMPACT: f64 = 1e-9;
}
