//! Poses in which rows lose rank, in motion.

/// How much less firmly rows hold than they have done in this motion where it is near a singular pose. Larger: harmless poses are watched.
/// Smaller: rates before and behind the pose are compared so near to it that they carry its noise. Pinned by
/// `tests/motion/test_singular_poses.py`, from below. Not seen from above: what is watched more often is passed as well.
pub const NEAR: f64 = 0.1;

/// Part of all rates by which they may differ behind a singular pose from what the accelerations before and behind it explain. Larger:
/// branches that part by a small angle are confused. Smaller: motions that change their speed quickly are taken for lost. Not seen: of
/// twelve motions of rows of parallelograms twelve finish by "radau" and eleven by "bdf", none of them wrong, either way.
pub const TURNED: f64 = 0.3;

/// Rounding of rates at the distance one from a singular pose, over eps and over all rates: at the distance d it is greater by 1/d^2. There
/// no tolerance is tighter, crossings begin before it exceeds the tolerance, and where it exceeds `TURNED` it may have chosen the branch.
/// Larger: crossings are begun far from the pose, and cost more steps; motions at the tightest tolerances err more; linkages that turn
/// quickly in earnest are taken for lost. Smaller: steps end where rounding exceeds the tolerance, and a lost branch is not seen. Pinned by
/// `test_bdf_finishes_nearly_all_of_some_rows`, from above. Not seen from below: as many rows finish.
pub const NOISE: f64 = 10.0;

/// Steps longer than so many distances at which rounding counts are left to luck. Larger: crossings are planned where nothing threatens.
/// Smaller: some steps have a stage next to the pose, and are made again. Pinned by
/// `test_a_linkage_far_from_its_singular_poses_looks_for_none`, from above. Not seen from below: as many rows of parallelograms finish, and
/// of ten one less where it is nothing.
pub const LUCK: f64 = 400.0;

/// Distance to the pose, characteristic lengths or radians, at which schemes with short steps cross it by a long one. Larger: the long step
/// errs. Smaller: its stages lie in the noise of the pose. Pinned by `test_bdf_finishes_nearly_all_of_some_rows`, from below. Not seen from
/// above: as many rows finish.
pub const FARTHEST_CROSSING: f64 = 0.05;

/// Steps that are shorter than that into the region near a pose by this factor are lost in it. Larger: motions that only slow down there
/// are stopped. Smaller: many steps are made that lead nowhere. Not seen: of twelve motions of rows of parallelograms twelve finish by
/// "radau" and eleven by "bdf" either way.
pub const COLLAPSED: f64 = 1e-3;

/// First look ahead to a pose, over the distance that the hold allows; later ones go half the way that is left. Also the part of the way to
/// it, or of that on which the hold falls to nothing, after which a pose that the next step does not meet is looked for again. Larger: the
/// hold is read beyond the pose, where it rises, and motions that quicken meet it unseen. Smaller: the slope of the hold is known less
/// well, and each step looks, which costs as much as three corrections of rows. Pinned by `test_bdf_finishes_nearly_all_of_some_rows`, from
/// above. Not seen from below: as many rows finish.
pub const LOOK: f64 = 0.1;
