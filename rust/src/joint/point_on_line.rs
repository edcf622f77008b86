//! A point of the second body on the line z of the first, as of a pin in a slot or a bead on a wire: it may slide and turn in any way.
use super::{Axes, Coordinate, Freedom, Joint, Role};
use crate::spatial::{M3, Pose, Real};
use Coordinate::Translation as T;

pub struct PointOnLine;

impl Joint for PointOnLine {
    const NAME: &'static str = "point_on_line";
    const ROLE: Role = Role::Restricts;
    const FREEDOMS: &'static [Freedom] = &[];
    const REVERSED: &'static [Freedom] = Self::FREEDOMS;
    const QUATERNION: Option<usize> = None;
    const COORDINATES: &'static [Coordinate] = &[T(2)];
    const CONSTRAINTS: &'static [Coordinate] = &[T(0), T(1)];
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
