//! Between the frame of a flexible body and a moving node: displacement, then rotations about x, y and z in turn. Its six columns
//! belong to the modal coordinates, as the node's shape says.
use super::coordinate::{slide, turn};
use super::{Axes, Coordinate, Freedom, Joint, Role};
use crate::spatial::{M3, Pose, Real};

pub struct Node;

const fn late(freedom: Freedom) -> Freedom {
    Freedom { stage: 3, ..freedom }
}

impl Joint for Node {
    const NAME: &'static str = "node";
    const ROLE: Role = Role::Modal;
    const FREEDOMS: &'static [Freedom] =
        &[slide(0, ""), slide(1, ""), slide(2, ""), turn(0, 1, ""), turn(1, 2, ""), turn(2, 3, "")];
    const REVERSED: &'static [Freedom] =
        &[late(slide(0, "")), late(slide(1, "")), late(slide(2, "")), turn(0, 2, ""), turn(1, 1, ""), turn(2, 0, "")];
    const QUATERNION: Option<usize> = None;
    const COORDINATES: &'static [Coordinate] = &[];
    const CONSTRAINTS: &'static [Coordinate] = &[];
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
