//! Two rotations, R = Rz(alpha) Rx(beta) from the first body to the second.
use super::coordinate::{turn, turn_outer};
use super::{ANGLE_BETA, ANGLE_Z, Axes, Coordinate, Freedom, Joint, Role};
use crate::spatial::{M3, Pose, Real, V3, product, rotation_about};
use Coordinate::{Dot, Translation as T};

pub struct Universal;

impl Joint for Universal {
    const NAME: &'static str = "universal";
    const ROLE: Role = Role::Carries;
    const FREEDOMS: &'static [Freedom] = &[turn(2, 0, "alpha"), turn_outer(0, 1, "beta")];
    const REVERSED: &'static [Freedom] = &[turn_outer(2, 1, "alpha"), turn(0, 0, "beta")];
    const QUATERNION: Option<usize> = None;
    const COORDINATES: &'static [Coordinate] = &[ANGLE_Z, ANGLE_BETA];
    const CONSTRAINTS: &'static [Coordinate] = &[T(0), T(1), T(2), Dot(2, 0)];
    const VELOCITY_CONSTRAINTS: &'static [Coordinate] = &[];
    const HAS_LENGTH: bool = false;

    fn frames<T: Real>(axes: &Axes<T>) -> [M3<T>; 2] {
        let z = axes.first / axes.first.dot(&axes.first).sqrt();
        let x = axes.second - z * z.dot(&axes.second);
        let x = x / x.dot(&x).sqrt();
        let frame = axes.given.unwrap_or_else(|| M3::from_columns(&[x, z.cross(&x), z]));
        [frame, frame]
    }

    fn pose<T: Real>(q: &[T], reversed: bool, _: T) -> Pose<T> {
        let r = product(&rotation_about(2, q[0]), &rotation_about(0, q[1]));
        Pose { p: V3::zeros(), r: if reversed { r.transpose() } else { r } }
    }

    fn coordinates(x: &Pose<f64>, reversed: bool, _: f64) -> Vec<f64> {
        let r = if reversed { x.r.transpose() } else { x.r };
        vec![r[(1, 0)].atan2(r[(0, 0)]), r[(2, 1)].atan2(r[(2, 2)])]
    }
}
