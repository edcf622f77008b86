//! Every number that decides something: its meaning, its unit, and what goes wrong when it is too large or too small.

/// Rank, redundancy and closure of constraints.
pub mod constraints {
    /// Relative accuracy of a drawing where the model does not say: lengths over those of their loop, angles in radians.
    /// Larger: loops that are locked by a small angle move. Smaller: linkages drawn with eight digits are locked.
    /// Seen by `tests/invariance/test_tilted_four_bar.py`; not scanned.
    pub const DRAWING: f64 = 1e-7;

    /// Rounding of one entry of a constraint row, in units of the sizes of what was subtracted for it, over eps.
    /// Larger: a model far from the origin has doubtful loops. Smaller: rows of rounding lock a door on two hinges.
    /// Seen by `tests/invariance/test_rank.py`; not scanned.
    pub const ENTRY_ROUNDING: f64 = 4.0;

    /// Singular values between the tolerance and this many times it make a constraint that is named as doubtful.
    /// Larger: sound models are called doubtful. Smaller: a lock by an inaccurate drawing is not explained.
    /// Seen by `tests/invariance/test_tilted_four_bar.py`; not scanned.
    pub const DOUBTFUL: f64 = 1e3;

    /// The same of constraints that lie far below all others of their block: no mechanism is that slender in one direction alone.
    /// Larger: genuine constraints are called doubtful. Smaller: axes that are off by a hundredth of a degree lock a linkage without a
    /// word. Seen by `tests/invariance/test_tilted_four_bar.py`; not scanned.
    pub const LOCKED: f64 = 1e4;

    /// How far below. Larger and smaller: as of `LOCKED`, the other way round.
    pub const APART: f64 = 1e2;

    /// How far redundant rows may open in motion, over the tolerance of the drawing: rows that part by s per radian of the freed
    /// direction open by up to some ten s over a large motion. Larger: a lost constraint is seen late. Smaller: doubtful linkages stop.
    /// Seen by `tests/invariance/test_tilted_four_bar.py`; not scanned.
    pub const REDUNDANT_OPEN: f64 = 1e2;

    /// Second-order form of a redundant combination on the motions that the rows leave free, over the tolerance of the drawing, from
    /// which on its pose is singular: there the constraints part like the square of the way. Larger: bifurcations are linearised.
    /// Smaller: linkages that are drawn inaccurately are called singular. Pinned by `tests/system/test_loops.py`.
    pub const SINGULAR_POSE: f64 = 1e2;

    /// Length of the look beside a drawn pose, in lengths of the loop or radians, by which a pose of lower rank is seen.
    /// Larger: the way back to the constraints is long. Smaller: the second-order part of a change point drowns in the tolerance.
    /// Seen by `tests/invariance/test_rank.py`; not scanned.
    pub const PROBE: f64 = 1e-2;

    /// Rows that are as long as the longest but for this part are equally good pivots: the first is taken, so that neither rounding nor
    /// units choose. Larger: short pivots. Smaller: rounding chooses. A choice, never an answer, depends on it.
    pub const TIE: f64 = 1e-6;

    /// Rows are closed when smaller than this, over the length of their loop or in radians.
    /// Larger: states are less accurate than they could be. Smaller: Newton's method circles in rounding.
    /// No test pins it alone.
    pub const CLOSED: f64 = 1e-13;

    /// The same in units of the rounding of a row's entries, for models far from the origin; and how much more than `CLOSED` a closing
    /// that does not go on may leave. Larger: loops stay open by more than rounding. Smaller: models far from the origin do not close.
    pub const CLOSED_ROUNDING: f64 = 1e2;

    /// Singular values of a least-squares problem below this part of the largest belong to directions that no row feels.
    /// Larger: weak directions are left out. Smaller: rounding of states of self-stress is divided by. Entries are free of units.
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
    /// Smaller: states read from text with five digits are refused. Pinned by `tests/system/test_coordinates.py` between 1e-6 and 1e-2.
    pub const UNIT_QUATERNION: f64 = 1e-4;
}

/// Static equilibrium.
pub mod equilibrium {
    /// Stiffness below this part of the largest of its island counts as none. Coordinates that are held softly are stretched before.
    /// Larger: soft springs do not hold. Smaller: rounding holds what nothing restrains.
    /// Pinned by tests/truth/test_soft_and_stiff.py (hanging chains) and tests/linear/test_equilibrium.py.
    pub const NO_STIFFNESS: f64 = 1e-12;

    /// A force along a direction without stiffness, over the size of the forces in its island, that moves it; left over along any
    /// coordinate it is more than a balance may leave. Larger: a weak push along a free direction passes, and what is not in
    /// balance is called converged. Smaller: rounding of forces in balance is an error. Pinned by tests/linear/test_equilibrium.py and
    /// tests/linear/test_equilibrium_estimate.py (converged is a claim about the residual).
    pub const PUSHED: f64 = 1e-9;

    /// Forces at work in an island, over its stiffness (times a radian or the characteristic length), that are no load but what the
    /// last digits of a drawing make: then a rounding of places that is not small beside them is not told. Larger: forces in stiff parts
    /// are called converged that are rounding. Smaller: unloaded models, drawn with noise in the last digits, are called unresolved.
    /// Pinned by tests/linear/test_equilibrium_estimate.py and the suite with jitter.
    pub const UNLOADED: f64 = 1e-11;

    /// Diagonal entries of the stiffness (radians, characteristic lengths) below this part of the largest of their island are made as
    /// large by stretching their coordinates, before eigenvalues are told from zero. Larger: searches go other ways than the
    /// stiffness does. Smaller: springs of very different stiffness drown each other. Pinned by tests/truth/test_soft_and_stiff.py.
    pub const GRADED: f64 = 1e-6;

    /// Rounding of a force or of an entry of the stiffness, in units of the sizes of what was added up for it and of the distance from
    /// the origin, over eps. Larger: the search ends early. Smaller: models far from the origin have no equilibrium.
    /// Pinned by tests/invariance/test_same_equilibrium.py (moved).
    pub const ENTRY_ROUNDING: f64 = 4.0;

    /// Force that velocity rows which steer carry, over the size of the forces in its island, from which on a place is one of a family.
    /// Larger: the place of a family is followed. Smaller: the accuracy of an equilibrium refuses its derivatives.
    /// Pinned by tests/invariance/test_knife_edge.py.
    pub const FAMILY: f64 = 1e-7;

    /// A full step from a state whose unbalance may be rounding goes on if it leaves less than this part. Larger: steps in rounding.
    /// Smaller: digits are given away. Pinned by tests/invariance/test_same_equilibrium.py (moved).
    pub const SETTLED: f64 = 0.5;
}

/// Linearised matrices.
pub mod linearisation {
    /// Multiple of eps times the sum of the sizes of the terms of an entry below which the entry is rounding. Too small: rounding passes for
    /// stiffness, circulation or damping. Too large: weak effects beside strong ones in the same entry are lost.
    /// Pinned by tests/truth/test_terms_of_linearisations.py.
    pub const ENTRY: f64 = 8.0;

    /// Entries above this share of the natural size of their row and column cannot be rounding: then no sizes are added up. Too small:
    /// rounding stays. Too large: work without need; no entry changes. Pinned by the same tests.
    pub const CLEAR: f64 = 1e-10;

    /// Rounding of a few dozen terms of inertia that cancel, relative to their size. Too small: the turning of a shaft is held by a
    /// stiffness of rounding. Too large: soft supports of fast shafts are lost. Seen by tests/truth/test_steady_rotation.py; not scanned.
    pub const CANCELLED: f64 = 1e-14;

    /// Multiple of eps times the size of its terms below which an entry of a strain row is rounding of poses and axes, beside one for each
    /// body. Too small: a coordinate that no element strains counts as held. Too large: weak levers are lost.
    /// Pinned by tests/truth/test_graded_modes.py (rows on arbitrary axes).
    pub const POSE_ROUNDING: f64 = 32.0;

    /// The same of poses in closed loops, which carry the tolerance of their closure.
    pub const LOOP_ROUNDING: f64 = 1e5;

    /// An unbalanced force above this part of all forces makes a linearisation at rest questionable, and is told. Larger: matrices of a
    /// state that does not last pass without a word. Smaller: models in balance but for the digits of their drawing are warned of.
    pub const BALANCED: f64 = 1e-6;

    /// Change of the given velocities, over their size, from which on it is told that they contradict the joints. Larger: contradictions
    /// pass. Smaller: rounding is told.
    pub const VELOCITY_CORRECTED: f64 = 1e-9;
}

/// Eigenvalues and shapes.
pub mod modes {
    /// Multiple of u (2^-53) times the sum of the sizes of the terms of an entry that counts as rounding of the entry made before
    /// the solver saw it. Too small: roots of assembled matrices differ by more than their error. Too large: errors are pessimistic,
    /// and soft modes are called rigid. Pinned by tests/truth/test_graded_modes.py (errors against 50 digits, rigid or soft).
    pub const DATA_ROUNDING: f64 = 4.0;

    /// Relative error of a squared frequency (algorithm only) above which the expensive route is taken: factors, Jacobi's singular
    /// values, residuals in twice the precision. Too large: roots lose digits that the matrices hold. Too small: only time is lost.
    /// Pinned by tests/truth/test_graded_modes.py.
    pub const SHARP: f64 = 1e-12;

    /// Two roots whose distance is below this share of their geometric mean are rotated together (Rayleigh-Ritz) instead of divided
    /// by their distance. Too large: a group's quotients lose accuracy. Too small: corrections of close roots blow up.
    /// Pinned by tests/truth/test_graded_modes.py (repeated soft modes).
    pub const CLOSE: f64 = 1e-6;

    /// Cosine (in the metric of M) above which two approximate shapes are the same one: a root was then found twice and another is
    /// missing, and no error estimate holds. Pinned by tests/truth/test_graded_modes.py.
    pub const SAME_SHAPE: f64 = 1e-3;

    /// Relative effect on a squared frequency up to which damping between two undamped modes is left out; it is added to the error.
    /// Too large: shapes of coupled damping are real although they are not. Too small: rounding of proportional damping sends a
    /// system to the general route. Pinned by tests/linear/test_modal.py (proportional damping) and tests/truth/test_graded_modes.py.
    pub const UNCOUPLED: f64 = 1e-13;

    /// Multiple of the last place of a diagonal entry (in units of the masses) up to which an entry that no semidefinite matrix can have
    /// is rounding. Too small: rigid directions get roots of rounding. Too large: weak negative coupling of unheld directions is lost.
    /// Pinned by tests/truth/test_damped_modes.py (rounding beside damping).
    pub const ENTRY_ROUNDING: f64 = 4.0;

    /// Product of backward error and normwise condition above which a root of the general route is checked by Newton's method with
    /// residuals in twice the precision. What stays unchecked is off by about the square of this. Too small: every root costs a
    /// factorisation. Too large: small roots of graded systems are wrong unseen. Pinned by tests/truth/test_damped_modes.py.
    pub const DOUBTFUL: f64 = 1e-6;

    /// Share of Q''(s) times the distance to the nearest root that |psi^T Q'(s) phi| must reach for two roots alone to meet there; then
    /// a root moves like the square root of its residual. Too small: errors at defects of order three and more are too small.
    /// Pinned by tests/truth/test_damped_modes.py (defects of orders two to four).
    pub const DOUBLE_ROOT: f64 = 0.1;

    /// Distances, over that of the nearest root, of the roots that meet at a defect of order three and more. Too small: some of them are
    /// not counted and the error is too small by their share. Too large: roots beside the defect make the estimate larger, by their
    /// number. Pinned by tests/truth/test_damped_modes.py (defects of orders two to four).
    pub const MEETING: f64 = 10.0;

    /// Krylov cycles after which a zero shift is moved nearer to the lowest eigenvalues. Too small: factorisations are wasted on problems
    /// that would have converged. Too large: crowded spectra waste cycles first. No answer depends on it: inertia counts prove that none
    /// is missing. Pinned by tests/truth/test_crowded_modes.py.
    pub const PATIENCE: usize = 15;

    /// Bisections by inertia counts for that shift, at most: the range of 2^-50 of the largest eigenvalue is below rounding.
    pub const BISECTIONS: usize = 50;

    /// Part of each diagonal entry of M that is added before its factorisation is asked whether M is semidefinite: rounding of the
    /// inertia of a rod about its own axis stays below. Too small: rods are refused. Too large: negative masses pass. Pinned by
    /// tests/truth/test_crowded_modes.py (point masses and rods).
    pub const SEMIDEFINITE: f64 = 1e-12;

    /// What a factor of M holds of a coordinate beyond the others, over the length of its column, that is rounding of arms: the coordinate
    /// then has no inertia of its own. A share of 1e-12 of a column is 1e-24 of a mass. Larger: light bodies on heavy ones are refused.
    /// Smaller: roots of rounding. Pinned by tests/truth/test_soft_and_stiff.py and tests/linear/test_bad_input.py.
    pub const MASSLESS: f64 = 1e-12;

    /// Sum of the sizes of the terms of a Rayleigh quotient over its value from which on it is taken in twice the precision. Below, its
    /// rounding is part of the error of the data. Too small: work. Too large: soft modes of matrices lose digits that the entries hold.
    /// Pinned by tests/truth/test_graded_modes.py.
    pub const CANCELLING: f64 = 1e5;

    /// Relative strain of a rigid mode that cannot be rounding of its shape. Too small: the factor of the stiffness is made once more than
    /// needed. Too large: a strained mode stays rigid. Pinned by tests/truth/test_graded_modes.py (soft modes of models).
    pub const STRAINED: f64 = 1e-9;

    /// Relative error of an assembled model's frequency from which on the factor of its stiffness is worth a second solution. Too small:
    /// ordinary models are solved twice. Too large: soft modes keep the rounding of stiff springs. Pinned by
    /// tests/truth/test_graded_modes.py.
    pub const GRADED: f64 = 1e-9;

    /// Roots that a symmetry makes equal come out this far apart: positions and closed loops carry some rounding. Derivatives treat them as
    /// one. Larger: roots that differ lose their own derivatives. Smaller: derivatives of rounding's choice of shapes.
    pub const SAME_ROOT: f64 = 1e-11;

    /// A smaller pivot of M means that M is ill-conditioned: light bodies are lost in the rounding of heavy ones. Then a factor of M is
    /// used. Too small: light bodies keep that rounding. Too large: only time is lost. Pinned by tests/truth/test_soft_and_stiff.py.
    pub const LIGHTEST: f64 = 1e-5;
}

/// Motion in time.
pub mod motion {
    /// Rounding of the force of a slider that moves on, in units of eps times the sum of its absolute terms: within it the sign of the rate
    /// tells whether it slips. Free of units. Too large: sliders that stick close to their limit slip; too small: the last bit decides.
    /// Pinned by `the_rate_decides_at_the_limit` of `force::jenkins`.
    pub const SLIDER_ROUNDING: f64 = 4.0;

    /// Part of a diagonal entry of M that the recursion over a tree must leave of it, or M is singular to rounding there and the dense
    /// route decides. Free of units. Larger: trees with heavy tips take the slow route. Smaller: accelerations of coordinates that
    /// move no inertia are rounding over rounding. Pinned by tests/system/test_tree_accelerations.py.
    pub const ARTICULATED: f64 = 1e4 * f64::EPSILON;

    /// Factor on the length of the next step that the error estimate proposes. Larger: more steps are repeated. Smaller: more steps are
    /// made. A choice of cost; seen by the step counts of tests/motion/test_motion_zoo.py, not scanned.
    pub const SAFETY: f64 = 0.85;

    /// Iterations of simplified Newton methods within a step. Larger: steps that are too long are given up late. Smaller: steps that
    /// would converge are repeated. Seen by tests/motion/test_radau.py, not scanned.
    pub const NEWTON_ITERATIONS: usize = 12;

    /// Corrections that matrices of the step itself do not shrink are rounding below this part of the motion within the step. Larger:
    /// steps are called solved that are not. Smaller: steps at the limit of rounding are repeated without end.
    /// Seen by tests/motion/test_motion_hard.py, not scanned.
    pub const CORRECTION_ROUNDING: f64 = 1e-10;

    /// Motions within a step below this, characteristic lengths or radians, are solved as if they were of this size: at rest there is
    /// nothing but rounding to be relative to. Larger: slow motions are solved loosely. Smaller: rest is solved to rounding of
    /// rounding. Seen by tests/motion/test_motion_hard.py, not scanned.
    pub const LEAST_MOTION: f64 = 1e-6;

    /// Repetitions that find the rotation vector of three rates that act together: each gains the turn within a step. Smaller: fast
    /// turns are refused. Seen by tests/motion/test_motion_rotations.py, not scanned.
    pub const ROTATION_REPETITIONS: usize = 40;
}

/// Rolling in motion.
pub mod rolling {
    /// Straight rolling: B''' and the third power of E, over the speed (lengths over the characteristic length) to the same power, and
    /// forces along the path over their terms and over the sum of all forces. Larger: motion on slow curves is linearised as if
    /// straight, and weak forces along the path pass unseen; smaller: rounding of a drawn model refuses it. Pinned by `a_curve_and_a_trailer_are_refused` and the bicycle of tests/truth/test_rolling.py.
    pub const ROLLS_STEADILY: f64 = 1e-9;

    /// Force that a displacement along the path of rolling makes, over the terms that it is made of, which counts as none where such
    /// displacements are looked for. Free of units. Rounding leaves 1e-15, the smallest force of a bicycle's lean 2e-3. Larger: a lean
    /// is taken for a heading and the bicycle refused; smaller: no heading is found and it is refused too. Never an answer: what is
    /// found is held against the other two. Pinned by `a_force_is_seen_from_its_bound_on` of analysis/rolling.rs and
    /// `test_a_bicycle_in_any_direction` of tests/truth/test_rolling.py.
    pub const UNFELT: f64 = 1e-8;

    /// Sine of the angle between the displacements that no force follows and the motions that rows allow, from which on they are apart;
    /// 0.9 of bicycles. E loses the digits of its inverse, 2e-12 here, and forces along the path are held to 1e-9. Larger: motions are
    /// refused whose answer has digits; smaller than 1e-7: what is left is rounding. Pinned by `directions_are_apart_from_their_bound_on`
    /// of analysis/rolling.rs.
    pub const APART: f64 = 1e-4;
}

/// Periodic motions: dynamic stiffness, residuals, events.
pub mod periodic {
    /// A coordinate counts at least as if it held this part of the largest root of an energy. Larger: steps of what is small beside the
    /// rest are not measured. Smaller: what vanishes by symmetry measures steps by rounding. Not scanned.
    pub const LEAST_SCALE: f64 = 1e-6;

    /// Part of the sum of the absolute terms of an entry of the condensed dynamic stiffness within which a change hides in the entry's
    /// own rounding: two units in the last place. Free of units. Too large: S is extrapolated where it has visibly changed, and Newton's
    /// method goes to the wrong place before the accepted residual stops it; too small: one factorisation more per correction.
    /// Pinned by tests/truth/test_frequency_blocks.py.
    pub const HIDDEN: f64 = 2.0 * f64::EPSILON;

    /// Part of the natural size of an entry of the condensed dynamic stiffness that rounding of a factorisation may change, by its
    /// bound, before the entry is refined. Free of units. Too large: curves of finely divided structures carry the rounding; too small:
    /// refinements that change nothing. Pinned by tests/nonlinear/test_hbm_rounding.py.
    pub const FELT: f64 = 1e-6;

    /// Correction of an entry by a residual, relative to its natural size, after which the next correction, about its square, would not
    /// count. Free of units. Too large: S keeps a visible error; too small: structures are refused that are known well enough.
    /// Pinned by tests/nonlinear/test_hbm_rounding.py.
    pub const SETTLED: f64 = 1e-7;

    /// An entry of the condensed dynamic stiffness below this part of its rounding in plain arithmetic is zero: what is left of it after
    /// refinement is rounding of the refinement. Free of units. Too large: small entries are not refined; too small: structures that are
    /// free at rest are refused. Pinned by tests/truth/test_frequency_blocks.py.
    pub const ABSENT: f64 = 1e-10;

    /// Rounding of a residual in units of eps times the sum of the absolute terms of its row. Free of units. Too large: residuals that
    /// are not rounding pass; too small: points that are as good as the arithmetic allows are refused.
    /// Pinned by tests/truth/test_frequency_blocks.py.
    pub const ROW_ROUNDING: f64 = 16.0;

    /// Growth rates of perturbations below this fraction of the base frequency count as zero. Free of units. Too large: weak
    /// instabilities are called stable; too small: rounding of the multipliers of undamped systems is called unstable.
    /// Pinned by tests/truth/test_hbm_events.py.
    pub const NEUTRAL: f64 = 1e-9;

    /// A period that takes less than this part out of a change of a law's state leaves the state free. Free of units. Too large: weakly
    /// dissipating cycles keep the state of their start; too small: rounding of a thousand steps decides.
    /// Pinned by tests/nonlinear/test_state_laws.py.
    pub const STATE_FREE: f64 = 1e-11;

    /// Rounding of a law's state after a period, over its largest value. Free of units. Too large: states that are not periodic pass; too
    /// small: periods are repeated for nothing. Pinned by tests/nonlinear/test_state_laws.py.
    pub const STATE_CLOSED: f64 = 1e-13;

    /// Rounding of the equations between two samples of a law's state, in units of eps times the sum of their absolute terms. Free of
    /// units. Too large: states that solve nothing pass; too small: laws that relax fast are refused.
    /// Pinned by `every_accepted_state_solves_its_equations` of `hbm::periodic_state`.
    pub const STATE_ROUNDING: f64 = 16.0;

    /// Largest |Re s| over the base frequency of an exponent that crosses the imaginary axis at a point that was solved for. Free of
    /// units. Too large: jumps of the exponents where a contact closes are called bifurcations; too small: bifurcations of stiff systems,
    /// whose exponents have rounding, are lost. Pinned by tests/truth/test_hbm_events.py.
    pub const AXIS: f64 = 1e-6;

    /// The same on the unstable side of a border that was bracketed, where two exponents that meet on the axis part like the root of the
    /// distance. Free of units; failures as of `AXIS`. Pinned by tests/truth/test_hbm_events.py.
    pub const AXIS_ROOT: f64 = 1e-3;

    /// How many times the regularity at a branch point may exceed what a linear decrease to zero leaves at the width of the bracket. Free of
    /// units. Too large: corners, where the determinant jumps through zero, are called branch points; too small: branch points of
    /// strongly curved branches are lost. Pinned by tests/truth/test_hbm_events.py.
    pub const BRANCHING: f64 = 1e3;

    /// Steps of the finest integration over which a contact must last to be seen by the stability of a motion. A count. Too large:
    /// the stability of short contacts is not told; too small: it is told wrongly. Pinned by tests/truth/test_hbm_events.py.
    pub const CONTACT_STEPS: usize = 8;

    /// Part of the range of an element's stiffness over the period by which it jumps where a contact opens or closes. Free of units.
    /// Too large: partial contacts are missed; too small: smooth laws that bend fast count as contacts.
    /// Pinned by tests/truth/test_hbm_events.py.
    pub const CONTACT_JUMP: f64 = 0.1;
}

/// Air forces on the sections of blades.
pub mod aero {
    /// Smallest inflow angle (rad) of an annulus through which the wind still blows. Too large: heavily loaded annuli reverse too early;
    /// too small: a hovering rotor in a breath of wind is taken for a windmill that blocks it.
    /// Pinned by tests/aero/test_coupled_sections.py.
    pub const SMALLEST_INFLOW: f64 = 1e-6;

    /// k = a / (1 - a) at the axial induction a = 0.4 above which Buhl's parabola, which meets momentum theory there, replaces it.
    pub const HIGH_LOAD: f64 = 2.0 / 3.0;

    /// Steps of the search for an inflow angle that bisects every third. A count. Too small: roots are cut off; too large: nothing.
    pub const MOST_ANNULUS_STEPS: usize = 180;
}
