//! A disc that rolls without slip on the plane z = 0 of the first body; its axis is z of the second frame.
use super::{Axes, Coordinate, Freedom, Joint, Role};
use crate::spatial::{M3, Pose, Real, frame_of_axis};

pub struct RollingDisc;

impl Joint for RollingDisc {
    const NAME: &'static str = "rolling_disc";
    const ROLE: Role = Role::Restricts;
    const FREEDOMS: &'static [Freedom] = &[];
    const REVERSED: &'static [Freedom] = Self::FREEDOMS;
    const QUATERNION: Option<usize> = None;
    const COORDINATES: &'static [Coordinate] = &[];
    const CONSTRAINTS: &'static [Coordinate] = &[Coordinate::Disc(0)];
    const VELOCITY_CONSTRAINTS: &'static [Coordinate] = &[Coordinate::Disc(1), Coordinate::Disc(2)];
    const HAS_LENGTH: bool = false;

    fn frames<T: Real>(axes: &Axes<T>) -> [M3<T>; 2] {
        [axes.frame(), frame_of_axis(&axes.second)]
    }

    fn pose<T: Real>(_: &[T], _: bool, _: T) -> Pose<T> {
        Pose::identity()
    }

    fn coordinates(_: &Pose<f64>, _: bool, _: f64) -> Vec<f64> {
        Vec::new()
    }
}
