//! Nothing moves.
use super::{Axes, Coordinate, Freedom, Joint, Role};
use crate::spatial::{M3, Pose, Real};
use Coordinate::{Dot, Translation as T};

pub struct Fixed;

impl Joint for Fixed {
    const NAME: &'static str = "fixed";
    const ROLE: Role = Role::Carries;
    const FREEDOMS: &'static [Freedom] = &[];
    const REVERSED: &'static [Freedom] = Self::FREEDOMS;
    const QUATERNION: Option<usize> = None;
    const COORDINATES: &'static [Coordinate] = &[];
    const CONSTRAINTS: &'static [Coordinate] = &[T(0), T(1), T(2), Dot(0, 2), Dot(1, 2), Dot(1, 0)];
    const VELOCITY_CONSTRAINTS: &'static [Coordinate] = &[];
    const HAS_LENGTH: bool = false;

    fn frames<T: Real>(axes: &Axes<T>) -> [M3<T>; 2] {
        let frame = axes.frame();
        [frame, frame]
    }

    fn pose<T: Real>(_: &[T], _: bool, _: T) -> Pose<T> {
        Pose::identity()
    }

    fn coordinates(_: &Pose<f64>, _: bool, _: f64) -> Vec<f64> {
        Vec::new()
    }
}
