//! A screw: rotation about z, and with it a translation along z, u_z = pitch angle (pitch in metres per radian; negative: left-handed).
use super::coordinate::thread;
use super::{ANGLE_Z, Axes, Coordinate, Freedom, Joint, Role, angle, sign, turned};
use crate::spatial::{M3, Pose, Real, V3};
use Coordinate::{Dot, Thread, Translation as T};

pub struct Screw;

impl Joint for Screw {
    const NAME: &'static str = "screw";
    const ROLE: Role = Role::Carries;
    const FREEDOMS: &'static [Freedom] = &[thread(2, "")];
    const REVERSED: &'static [Freedom] = Self::FREEDOMS;
    const QUATERNION: Option<usize> = None;
    const COORDINATES: &'static [Coordinate] = &[ANGLE_Z];
    const CONSTRAINTS: &'static [Coordinate] = &[T(0), T(1), Dot(0, 2), Dot(1, 2), Thread];
    const VELOCITY_CONSTRAINTS: &'static [Coordinate] = &[];
    const HAS_LENGTH: bool = false;

    fn frames<T: Real>(axes: &Axes<T>) -> [M3<T>; 2] {
        let frame = axes.frame();
        [frame, frame]
    }

    fn pose<T: Real>(q: &[T], reversed: bool, pitch: T) -> Pose<T> {
        Pose { p: V3::new(T::zero(), T::zero(), q[0] * pitch * sign(reversed)), ..turned(q[0], reversed) }
    }

    fn coordinates(x: &Pose<f64>, reversed: bool, _: f64) -> Vec<f64> {
        vec![angle(&x.r, reversed)]
    }
}
