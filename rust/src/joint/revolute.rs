//! A hinge: rotation about z.
use super::coordinate::turn;
use super::{ANGLE_Z, Axes, Coordinate, Freedom, Joint, Role, angle, turned};
use crate::spatial::{M3, Pose, Real};
use Coordinate::{Dot, Translation as T};

pub struct Revolute;

impl Joint for Revolute {
    const NAME: &'static str = "revolute";
    const ROLE: Role = Role::Carries;
    const FREEDOMS: &'static [Freedom] = &[turn(2, 0, "")];
    const REVERSED: &'static [Freedom] = Self::FREEDOMS;
    const QUATERNION: Option<usize> = None;
    const COORDINATES: &'static [Coordinate] = &[ANGLE_Z];
    const CONSTRAINTS: &'static [Coordinate] = &[T(0), T(1), T(2), Dot(0, 2), Dot(1, 2)];
    const VELOCITY_CONSTRAINTS: &'static [Coordinate] = &[];
    const HAS_LENGTH: bool = false;

    fn frames<T: Real>(axes: &Axes<T>) -> [M3<T>; 2] {
        let frame = axes.frame();
        [frame, frame]
    }

    fn pose<T: Real>(q: &[T], reversed: bool, _: T) -> Pose<T> {
        turned(q[0], reversed)
    }

    fn coordinates(x: &Pose<f64>, reversed: bool, _: f64) -> Vec<f64> {
        vec![angle(&x.r, reversed)]
    }
}
