//! Translation along z and rotation about it.
use super::coordinate::{slide, turn};
use super::{ANGLE_Z, Axes, Coordinate, Freedom, Joint, Role, angle, sign, turned};
use crate::spatial::{M3, Pose, Real, V3};
use Coordinate::{Dot, Translation as T};

pub struct Cylindrical;

impl Joint for Cylindrical {
    const NAME: &'static str = "cylindrical";
    const ROLE: Role = Role::Carries;
    const FREEDOMS: &'static [Freedom] = &[slide(2, "z"), turn(2, 0, "rz")];
    const REVERSED: &'static [Freedom] = Self::FREEDOMS;
    const QUATERNION: Option<usize> = None;
    const COORDINATES: &'static [Coordinate] = &[T(2), ANGLE_Z];
    const CONSTRAINTS: &'static [Coordinate] = &[T(0), T(1), Dot(0, 2), Dot(1, 2)];
    const VELOCITY_CONSTRAINTS: &'static [Coordinate] = &[];
    const HAS_LENGTH: bool = false;

    fn frames<T: Real>(axes: &Axes<T>) -> [M3<T>; 2] {
        let frame = axes.frame();
        [frame, frame]
    }

    fn pose<T: Real>(q: &[T], reversed: bool, _: T) -> Pose<T> {
        Pose { p: V3::new(T::zero(), T::zero(), q[0] * sign(reversed)), ..turned(q[1], reversed) }
    }

    fn coordinates(x: &Pose<f64>, reversed: bool, _: f64) -> Vec<f64> {
        vec![x.p.z * sign(reversed), angle(&x.r, reversed)]
    }
}
