//! Two rotations, R = Rz(alpha) Rx(beta) from the first body to the second.
use super::coordinate::{turn, turn_outer};
use super::{ANGLE_BETA, ANGLE_Z, Axes, Coordinate, Freedom, Joint, Role};
use crate::spatial::{M3, Real};
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
}
