//! Translations along x and y, rotation about z.
use super::coordinate::{slide, turn};
use super::{ANGLE_Z, Axes, Coordinate, Freedom, Joint, Role};
use crate::spatial::{M3, Real};
use Coordinate::{Dot, Translation as T};

pub struct Planar;

impl Joint for Planar {
    const NAME: &'static str = "planar";
    const ROLE: Role = Role::Carries;
    const FREEDOMS: &'static [Freedom] = &[slide(0, "x"), slide(1, "y"), turn(2, 1, "rz")];
    const REVERSED: &'static [Freedom] = Self::FREEDOMS;
    const QUATERNION: Option<usize> = None;
    const COORDINATES: &'static [Coordinate] = &[T(0), T(1), ANGLE_Z];
    const CONSTRAINTS: &'static [Coordinate] = &[T(2), Dot(0, 2), Dot(1, 2)];
    const VELOCITY_CONSTRAINTS: &'static [Coordinate] = &[];
    const HAS_LENGTH: bool = false;

    fn frames<T: Real>(axes: &Axes<T>) -> [M3<T>; 2] {
        let frame = axes.frame();
        [frame, frame]
    }
}
