//! Derivatives of an instant along all directions, one column for each, and how increments go along with the motion.
//!
//! ```text
//! exp(y1) q1 = exp(theta) exp(y0) q0:   y1 = Ad(exp theta) y0 + J_l(theta) dtheta
//! ```
//! Only three rotations that act together turn each other; all other increments add up.
use nalgebra::DMatrix;

use crate::integrate::ali3p::Linear;
use crate::multibody::rotations::{Maps, add_turning, rotation_triples};
use crate::multibody::topology::Topology;
use crate::spatial::{V3, exp_so3};

/// Increments of the configuration, rates, accelerations, multipliers, memories.
#[derive(Debug, Clone)]
pub struct Slopes {
    pub x: DMatrix<f64>,
    pub v: DMatrix<f64>,
    pub a: DMatrix<f64>,
    pub lam: DMatrix<f64>,
    pub z: DMatrix<f64>,
}

fn three(v: &[f64], first: usize, sign: f64) -> V3<f64> {
    V3::new(v[first], v[first + 1], v[first + 2]) * sign
}

/// Ad(exp theta) X.
pub fn carried(topology: &Topology, theta: &[f64], x: &DMatrix<f64>) -> DMatrix<f64> {
    let mut out = x.clone();
    for (first, sign) in rotation_triples(topology) {
        let turned = exp_so3(&three(theta, first, sign)) * x.fixed_rows::<3>(first);
        out.fixed_rows_mut::<3>(first).copy_from(&turned);
    }
    out
}

/// The rate of the same at theta = 0: theta x X.
pub fn crossed(topology: &Topology, theta: &[f64], x: &DMatrix<f64>) -> DMatrix<f64> {
    let mut out = DMatrix::zeros(x.nrows(), x.ncols());
    for (first, sign) in rotation_triples(topology) {
        let theta = three(theta, first, sign);
        for (mut to, x) in out.column_iter_mut().zip(x.column_iter()) {
            let turned = theta.cross(&three(x.as_slice(), first, 1.0));
            to.fixed_rows_mut::<3>(first).copy_from(&turned);
        }
    }
    out
}

/// What J_l(theta), or another map of three rotations, makes of changes, added to X.
pub fn add_mapped(maps: &Maps, by: &DMatrix<f64>, x: &mut DMatrix<f64>) {
    let mut by = by.clone();
    for (first, map) in maps {
        for mut column in by.column_iter_mut() {
            let old = three(column.as_slice(), *first, 1.0);
            for (k, row) in map.iter().enumerate() {
                column[first + k] = row[0] * old[0] + row[1] * old[1] + row[2] * old[2];
            }
        }
    }
    *x += by;
}

/// The derivative of -h^2/12 v0 x v1, added to those of an increment.
pub fn add_turning_slopes(
    topology: &Topology,
    h: f64,
    (v0, v1): (&[f64], &[f64]),
    (d0, d1): (&DMatrix<f64>, &DMatrix<f64>),
    onto: &mut DMatrix<f64>,
) {
    for (mut column, (d0, d1)) in onto.column_iter_mut().zip(d0.column_iter().zip(d1.column_iter())) {
        let column = column.as_mut_slice();
        add_turning(topology, h, (d0.as_slice(), v1), column);
        add_turning(topology, h, (v0, d1.as_slice()), column);
    }
}

impl Linear {
    /// K X + D V + M A.
    pub fn along(&self, x: &DMatrix<f64>, v: &DMatrix<f64>, a: &DMatrix<f64>) -> DMatrix<f64> {
        let t = &self.tangent;
        let mut out = &t.stiffness * x;
        out.gemm(1.0, &t.mass, a, 1.0);
        for d in [&t.damping, &t.gyroscopic].into_iter().flatten() {
            out.gemm(1.0, d, v, 1.0);
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spatial::skew;

    /// d/de exp(theta + e d) = skew(J_l d) exp(theta), and conjugation by exp theta.
    #[test]
    fn increments_are_turned_by_the_motion() {
        let theta = V3::new(0.3, -0.8, 0.5);
        let y = V3::new(0.2, 0.1, -0.7);
        let e = 1e-6;
        let r = exp_so3(&theta);
        let conjugated = r * skew(&y) * r.transpose();
        assert!((conjugated - skew(&(r * y))).norm() < 1e-15);
        let rate = (exp_so3(&(theta * e)) * y - exp_so3(&(theta * -e)) * y) / (2.0 * e);
        assert!((rate - theta.cross(&y)).norm() < 1e-9);
    }
}
