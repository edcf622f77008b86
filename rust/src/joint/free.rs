//! Three translations and three rotations.
use super::coordinate::{slide, turn};
use super::{Axes, Coordinate, Freedom, Joint, Role};
use crate::spatial::{M3, Real};
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
}
