//! Three translations and three rotations.
use super::coordinate::{slide, turn};
use super::{Axes, Coordinate, Freedom, Joint, Role, sign};
use crate::spatial::{M3, Pose, Real, V3, quaternion_of_rotation, rotation_of_quaternion};
use Coordinate::{RotationVector as R, Translation as T};

pub struct Free;

impl Joint for Free {
    const NAME: &'static str = "free";
    const ROLE: Role = Role::Frees;
    const FREEDOMS: &'static [Freedom] =
        &[slide(0, "x"), slide(1, "y"), slide(2, "z"), turn(0, 1, "rx"), turn(1, 1, "ry"), turn(2, 1, "rz")];
    const REVERSED: &'static [Freedom] = Self::FREEDOMS;
    const QUATERNION: Option<usize> = Some(3);
    const COORDINATES: &'static [Coordinate] = &[T(0), T(1), T(2), R(0), R(1), R(2)];
    const CONSTRAINTS: &'static [Coordinate] = &[];
    const VELOCITY_CONSTRAINTS: &'static [Coordinate] = &[];
    const HAS_LENGTH: bool = false;

    fn frames<T: Real>(axes: &Axes<T>) -> [M3<T>; 2] {
        let frame = axes.frame();
        [frame, frame]
    }

    fn pose<T: Real>(q: &[T], reversed: bool, _: T) -> Pose<T> {
        Pose { p: V3::new(q[0], q[1], q[2]) * T::from(sign(reversed)), r: rotation_of_quaternion(&q[3..]) }
    }

    fn coordinates(x: &Pose<f64>, reversed: bool, _: f64) -> Vec<f64> {
        let p = x.p * sign(reversed);
        p.iter().copied().chain(quaternion_of_rotation(&x.r)).collect()
    }
}
