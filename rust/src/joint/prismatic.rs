//! A slider: translation along z.
use super::coordinate::slide;
use super::{Axes, Coordinate, Freedom, Joint, Role, sign};
use crate::spatial::{M3, Pose, Real, V3};
use Coordinate::{Dot, Translation as T};

pub struct Prismatic;

impl Joint for Prismatic {
    const NAME: &'static str = "prismatic";
    const ROLE: Role = Role::Carries;
    const FREEDOMS: &'static [Freedom] = &[slide(2, "")];
    const REVERSED: &'static [Freedom] = Self::FREEDOMS;
    const QUATERNION: Option<usize> = None;
    const COORDINATES: &'static [Coordinate] = &[T(2)];
    const CONSTRAINTS: &'static [Coordinate] = &[T(0), T(1), Dot(0, 2), Dot(1, 2), Dot(1, 0)];
    const VELOCITY_CONSTRAINTS: &'static [Coordinate] = &[];
    const HAS_LENGTH: bool = false;

    fn frames<T: Real>(axes: &Axes<T>) -> [M3<T>; 2] {
        let frame = axes.frame();
        [frame, frame]
    }

    fn pose<T: Real>(q: &[T], reversed: bool, _: T) -> Pose<T> {
        Pose { p: V3::new(T::zero(), T::zero(), q[0] * sign(reversed)), r: M3::identity() }
    }

    fn coordinates(x: &Pose<f64>, reversed: bool, _: f64) -> Vec<f64> {
        vec![x.p.z * sign(reversed)]
    }
}
