//! A point that does not move along z of the second body.
use super::{Axes, Coordinate, Freedom, Joint, Role};
use crate::spatial::{M3, Pose, Real};

pub struct KnifeEdge;

impl Joint for KnifeEdge {
    const NAME: &'static str = "knife_edge";
    const ROLE: Role = Role::Restricts;
    const FREEDOMS: &'static [Freedom] = &[];
    const REVERSED: &'static [Freedom] = Self::FREEDOMS;
    const QUATERNION: Option<usize> = None;
    const COORDINATES: &'static [Coordinate] = &[];
    const CONSTRAINTS: &'static [Coordinate] = &[];
    const VELOCITY_CONSTRAINTS: &'static [Coordinate] = &[Coordinate::Edge];
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
