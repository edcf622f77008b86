//! Three rotations that act together, those of spherical and free joints: their increments are rotation vectors in the axes of the
//! joint's first body, their rates angular velocities in the same axes.
//!
//! ```text
//! R1 = exp(theta) R0,   theta' = J_l^-1(theta) omega = omega - theta x omega/2 + ...
//! omega even between v0 and v1:   theta = h (v0 + v1)/2 - h^2/12 v0 x v1 + O(h^5)
//! ```
//! The second line is Magnus' series (A. Iserles, H. Z. Munthe-Kaas, S. P. Norsett, A. Zanna, Acta Numerica 9 (2000) 215-365); its
//! commutator has the other sign in body axes. Coordinates of a reversed joint count backwards: rotation vectors and angular
//! velocities are their negatives.
use crate::multibody::topology::Topology;
use crate::spatial::{M3, Real, V3, left_jacobian_coefficient, skew};

/// Coordinate of the first of three rotations, and what the coordinates mean to it: one number for each three.
pub type Maps = Vec<(usize, [[f64; 3]; 3])>;

/// First coordinate and sign of every three rotations that act together.
pub fn rotation_triples(topology: &Topology) -> impl Iterator<Item = (usize, f64)> + use<'_> {
    topology.nodes.iter().filter_map(|n| Some((n.first + n.kind.quaternion()?, n.sign())))
}

pub(crate) fn three<T: Real>(v: &[T], first: usize) -> V3<T> {
    V3::new(v[first], v[first + 1], v[first + 2])
}

/// v0 x v1 times `factor`, added to increments.
pub fn add_commutator<T: Real>(topology: &Topology, factor: f64, (v0, v1): (&[T], &[T]), onto: &mut [T]) {
    for (first, sign) in rotation_triples(topology) {
        let turned = three(v0, first).cross(&three(v1, first)) * T::from(sign * factor);
        for k in 0..3 {
            onto[first + k] += turned[k];
        }
    }
}

/// The commutator of a step of length h, -h^2/12 v0 x v1, added to its increments.
pub fn add_turning<T: Real>(topology: &Topology, h: f64, rates: (&[T], &[T]), onto: &mut [T]) {
    add_commutator(topology, -h * h / 12.0, rates, onto);
}

/// Rates of the increments theta from the joint rates: theta' = J_l^-1(theta) omega where three rotations act together.
pub fn increment_rates<T: Real>(topology: &Topology, increment: &[T], rate: &[T]) -> Vec<T> {
    on_rotations(topology, increment, rate, increment_slope)
}

/// J_l^-1(theta) omega.
pub fn increment_slope<T: Real>(theta: V3<T>, omega: V3<T>) -> V3<T> {
    let (b, _) = left_jacobian_coefficient(theta.dot(&theta));
    omega - theta.cross(&omega) * T::from(0.5) + theta.cross(&theta.cross(&omega)) * b
}

pub(crate) fn on_rotations<T: Real>(
    topology: &Topology,
    increment: &[T],
    rate: &[T],
    map: impl Fn(V3<T>, V3<T>) -> V3<T>,
) -> Vec<T> {
    let mut out = rate.to_vec();
    for (first, sign) in rotation_triples(topology) {
        let sign = T::from(sign);
        let mapped = map(three(increment, first) * sign, three(rate, first) * sign);
        for i in 0..3 {
            out[first + i] = mapped[i] * sign;
        }
    }
    out
}

pub(crate) fn left_jacobian(theta: &V3<f64>) -> M3<f64> {
    let (a, b) = left_jacobian_parts(theta.dot(theta));
    let s = skew(theta);
    M3::identity() + s * a + s * s * b
}

pub(crate) fn rows(m: &M3<f64>) -> [[f64; 3]; 3] {
    std::array::from_fn(|i| std::array::from_fn(|k| m[(i, k)]))
}

/// (1 - cos t)/t^2 and (t - sin t)/t^3 of s = t^2: J_l = 1 + a theta^ + b theta^ theta^.
pub(crate) fn left_jacobian_parts<T: Real>(s: T) -> (T, T) {
    if s.re() < 0.05 {
        let term = |c: [f64; 5]| c.iter().rev().fold(T::zero(), |sum, c| sum * s + *c);
        let a = [1.0 / 2.0, -1.0 / 24.0, 1.0 / 720.0, -1.0 / 40_320.0, 1.0 / 3_628_800.0];
        let b = [1.0 / 6.0, -1.0 / 120.0, 1.0 / 5040.0, -1.0 / 362_880.0, 1.0 / 39_916_800.0];
        return (term(a), term(b));
    }
    let t = s.sqrt();
    ((T::one() - t.cos()) / s, (t - t.sin()) / (s * t))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spatial::{exp_so3, log_so3};

    /// R' = omega^ R with omega = v0 + a t, by many small turns.
    #[test]
    fn the_commutator_leaves_an_error_of_fifth_order() {
        let (v0, a) = (V3::new(0.7, -1.3, 0.4), V3::new(-4.0, 3.7, 3.0));
        let miss = |h: f64| {
            let v1 = v0 + a * h;
            let n = 4000;
            let mut r = M3::identity();
            for i in 0..n {
                let s = (i as f64 + 0.5) / n as f64;
                r = exp_so3(&((v0 * (1.0 - s) + v1 * s) * (h / n as f64))) * r;
            }
            let theta = (v0 + v1) * (0.5 * h) - v0.cross(&v1) * (h * h / 12.0);
            (log_so3(&r) - theta).norm()
        };
        let (a, b) = (miss(0.4), miss(0.2));
        assert!((a / b).log2() > 4.5, "{a} {b}");
    }

    #[test]
    fn the_left_jacobian_is_the_derivative_of_the_exponential() {
        for size in [1e-3, 0.2, 1.7] {
            let (theta, d) = (V3::new(0.3, -0.8, 0.5) * size, V3::new(0.2, 0.9, -0.4));
            let e = 1e-5;
            let slope = (exp_so3(&(theta + d * e)) - exp_so3(&(theta - d * e))) / (2.0 * e);
            let turned = skew(&(left_jacobian(&theta) * d)) * exp_so3(&theta);
            assert!((slope - turned).norm() < 1e-9);
        }
    }
}
