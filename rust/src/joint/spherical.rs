//! Three rotations about a point.
use super::coordinate::turn;
use super::{Axes, Coordinate, Freedom, Joint, Role};
use crate::spatial::{M3, Pose, Real, V3, quaternion_of_rotation, rotation_of_quaternion};
use Coordinate::{RotationVector as R, Translation as T};

pub struct Spherical;

impl Joint for Spherical {
    const NAME: &'static str = "spherical";
    const ROLE: Role = Role::Carries;
    const FREEDOMS: &'static [Freedom] = &[turn(0, 0, "rx"), turn(1, 0, "ry"), turn(2, 0, "rz")];
    const REVERSED: &'static [Freedom] = Self::FREEDOMS;
    const QUATERNION: Option<usize> = Some(0);
    const COORDINATES: &'static [Coordinate] = &[R(0), R(1), R(2)];
    const CONSTRAINTS: &'static [Coordinate] = &[T(0), T(1), T(2)];
    const VELOCITY_CONSTRAINTS: &'static [Coordinate] = &[];
    const HAS_LENGTH: bool = false;

    fn frames<T: Real>(axes: &Axes<T>) -> [M3<T>; 2] {
        let frame = axes.frame();
        [frame, frame]
    }

    fn pose<T: Real>(q: &[T], _: bool, _: T) -> Pose<T> {
        Pose { p: V3::zeros(), r: rotation_of_quaternion(q) }
    }

    fn coordinates(x: &Pose<f64>, _: bool, _: f64) -> Vec<f64> {
        quaternion_of_rotation(&x.r).to_vec()
    }
}
