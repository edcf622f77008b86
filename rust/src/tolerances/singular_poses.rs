//! Poses in which rows lose rank, in motion.

/// How much less firmly rows hold than they have done in this motion where it is near a singular pose. Larger: harmless poses are watched.
/// Smaller: rates before and behind the pose are compared so near to it that they carry its noise. Pinned by
/// `tests/motion/test_singular_poses.py`.
pub const NEAR: f64 = 0.1;

/// Part of all rates by which they may differ behind a singular pose from what the accelerations before and behind it explain. Larger:
/// branches that part by a small angle are confused. Smaller: motions that change their speed quickly are taken for lost. Used by
/// `tests/motion/test_singular_poses.py`. Not seen: these tests pass either way.
pub const TURNED: f64 = 0.3;

/// Rounding of rates near a singular pose (eps over the square of the hold) that can turn them to the other branch. Larger: a lost branch
/// is not seen. Smaller: linkages that come near to such a pose and turn quickly in earnest are taken for lost. Used by
/// `tests/motion/test_singular_poses.py`. Not seen: these tests pass either way.
pub const TURNED_BY_ROUNDING: f64 = 1e-5;

/// Rounding of rates at the distance one from a singular pose, over eps: at the distance d it is greater by 1/d^2. Larger: crossings are
/// begun far from the pose, and cost more steps. Smaller: steps end where rounding exceeds the tolerance. Used by
/// `tests/motion/test_singular_poses.py`. Not seen: these tests pass either way.
pub const NOISE_OF_RATES: f64 = 100.0;

/// Rounding of rates over eps and the square of the hold that a step near a singular pose cannot avoid: no tolerance is tighter there.
/// Larger: motions at the tightest tolerances err more near such poses. Smaller: steps there shrink until nothing moves. Used by
/// `tests/motion/test_singular_poses.py`. Not seen: these tests pass either way.
pub const NOISE_OF_STEPS: f64 = 10.0;

/// Steps longer than so many distances at which rounding counts are left to luck. Larger: crossings are planned where nothing threatens.
/// Smaller: some steps have a stage next to the pose, and are made again. Only work depends on it. Not seen: no answer depends on it.
pub const LUCK: f64 = 400.0;

/// Distance to the pose, characteristic lengths or radians, at which schemes with short steps cross it by a long one. Larger: the long step
/// errs. Smaller: its stages lie in the noise of the pose. Used by `tests/motion/test_singular_poses.py`. Not seen: these tests pass either
/// way.
pub const FARTHEST_CROSSING: f64 = 0.05;

/// Distance below which no crossing begins any more: its first rates are noise. Larger: poses are passed by luck. Smaller: crossings carry
/// the noise of the pose. Used by `tests/motion/test_singular_poses.py`. Not seen: these tests pass either way.
pub const NEAREST_CROSSING: f64 = 0.012;

/// What a step without a tangent leaves of constraint rows, over their scales. Larger: crossings are planned where nothing threatens.
/// Smaller: "bdf-bfgs" makes steps so near to a singular pose that another branch solves their equations as well. Used by
/// `tests/motion/test_singular_poses.py`. Not seen: these tests pass either way.
pub const ROWS_WITHOUT_TANGENT: f64 = 2e-13;

/// Distance of a pose by one look, over what steps reach, from which on it is not looked for any closer. Larger: looks at poses that no
/// step meets. Smaller: a pose that seems far at the first look, before the hold falls in proportion, is met unseen.  Used by
/// `tests/motion/test_singular_poses.py`. Not seen: it passes either way.
pub const FAR: f64 = 3.0;

/// Steps that are shorter than that into the region near a pose by this factor are lost in it. Larger: motions that only slow down there
/// are stopped. Smaller: many steps are made that lead nowhere. Not scanned.
pub const COLLAPSED: f64 = 1e-3;

/// First look ahead to a pose, over the distance that the hold allows; and the part of the way to it, as it is known, that the next look
/// goes. Larger: the hold is read beyond the pose, where it rises. Smaller: the slope of the hold is known less well, and a pose is not met
/// where it was foreseen. Not scanned.
pub const FIRST_LOOK: f64 = 0.1;
/// See `FIRST_LOOK`.
pub const NEXT_LOOK: f64 = 0.7;

/// Part of the way to a pose, or of that on which the hold falls to nothing, after which a pose that the next step does not meet is looked
/// for again. Larger: motions that quicken meet it unseen. Smaller: each step looks, which costs as much as three corrections of rows.
/// Used by `tests/motion/test_singular_poses.py`. Not seen: it passes either way.
pub const LATER: f64 = 0.15;
