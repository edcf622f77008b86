//! A rod between two points.
use super::{Axes, Coordinate, Freedom, Joint, Role};
use crate::spatial::{M3, Pose, Real};
use Coordinate::Length;

pub struct Distance;

impl Joint for Distance {
    const NAME: &'static str = "distance";
    const ROLE: Role = Role::Restricts;
    const FREEDOMS: &'static [Freedom] = &[];
    const REVERSED: &'static [Freedom] = Self::FREEDOMS;
    const QUATERNION: Option<usize> = None;
    const COORDINATES: &'static [Coordinate] = &[];
    const CONSTRAINTS: &'static [Coordinate] = &[Length];
    const VELOCITY_CONSTRAINTS: &'static [Coordinate] = &[];
    const HAS_LENGTH: bool = true;

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
