//! Translations along x and y, rotation about z.
use super::coordinate::{slide, turn};
use super::{ANGLE_Z, Axes, Coordinate, Freedom, Joint, Role, angle, sign, turned};
use crate::spatial::{M3, Pose, Real, V3};
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

    fn pose<T: Real>(q: &[T], reversed: bool, _: T) -> Pose<T> {
        let s = sign(reversed);
        Pose { p: V3::new(q[0] * s, q[1] * s, T::zero()), ..turned(q[2], reversed) }
    }

    fn coordinates(x: &Pose<f64>, reversed: bool, _: f64) -> Vec<f64> {
        let s = sign(reversed);
        vec![x.p.x * s, x.p.y * s, angle(&x.r, reversed)]
    }
}
