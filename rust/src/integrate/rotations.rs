//! How three rotations that act together turn within a step: maps between their increments, their rates and the pose at its end.
use crate::multibody::rotations::{
    Maps, increment_rates, left_jacobian, left_jacobian_parts, on_rotations, rotation_triples, rows, three,
};
use crate::spatial::{M3, Real, skew};

use super::Equations;

impl<T: Real> Equations<'_, T> {
    /// Rates of the increments from the joint rates.
    pub fn increment_rates(&self, increment: &[T], rate: &[T]) -> Vec<T> {
        increment_rates(self.topology(), increment, rate)
    }

    /// The way back: omega = J_l(theta) theta'.
    pub fn rates_of_increments(&self, increment: &[T], speed: &[T]) -> Vec<T> {
        on_rotations(self.topology(), increment, speed, |theta, d| {
            let (a, b) = left_jacobian_parts(theta.dot(&theta));
            let turned = theta.cross(&d);
            d + turned * a + theta.cross(&turned) * b
        })
    }
}

impl Equations<'_, f64> {
    /// J_l of every three rotations that act together.
    pub fn rotation_maps(&self, theta: &[f64]) -> Maps {
        let of = |(first, sign)| (first, rows(&left_jacobian(&(three(theta, first) * sign))));
        rotation_triples(self.topology()).map(of).collect()
    }

    /// How the end of a step turns with x, its increment theta = x - h^2/12 v0 x v1 and v1 = f x + ...: J_l(theta) (1 - h^2 f/12 v0^).
    pub fn step_maps(&self, theta: &[f64], v0: &[f64], h: f64, f: f64) -> Maps {
        let factor = h * h * f / 12.0;
        let of = |(first, sign)| {
            let turned = M3::identity() - skew(&three(v0, first)) * (sign * factor);
            (first, rows(&(left_jacobian(&(three(theta, first) * sign)) * turned)))
        };
        rotation_triples(self.topology()).map(of).collect()
    }

    /// The largest angle of three rotations together.
    pub fn widest_rotation(&self, theta: &[f64]) -> f64 {
        rotation_triples(self.topology()).map(|(i, _)| three(theta, i).norm()).fold(0.0, f64::max)
    }
}
