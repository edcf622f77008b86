//! Modes of a dense system as transfer functions and responses use them.
use faer::prelude::*;
use faer::{Mat, MatRef, Side, c64};

use super::ports::complex;
use crate::error::Result;
use crate::linalg::quadratic::NormalForm;
use crate::tolerances::modes::UNCOUPLED;

pub struct RealModes {
    /// (n, n) mass-normalised shapes and the squares of the natural frequencies; rigid modes are exactly zero
    pub shape: Mat<f64>,
    pub lambda: Vec<f64>,
    pub damping: Vec<f64>,
}

pub struct ComplexModes {
    pub pole: Vec<c64>,
    /// rows of the eigenvectors that belong to z
    pub top: Mat<c64>,
    pub lu: faer::linalg::solvers::PartialPivLu<c64>,
    /// 1-norm condition estimate of the eigenvectors
    pub condition: f64,
}

impl ComplexModes {
    /// V^-1 B: real states in modal coordinates.
    pub fn coordinates(&self, states: MatRef<'_, f64>) -> Mat<c64> {
        let mut x = complex(states);
        self.lu.solve_in_place(&mut x);
        x
    }

    /// C V for an output map of the states that sees their first half only.
    pub fn outputs(&self, c: MatRef<'_, f64>) -> Mat<c64> {
        complex(c.subcols(0, self.top.nrows())) * &self.top
    }
}

pub fn real_modes(form: &NormalForm) -> Result<Option<RealModes>> {
    let n = form.n();
    let Ok(eigen) = form.s.self_adjoint_eigen(Side::Lower) else {
        return Ok(None);
    };
    let mut lambda: Vec<f64> = (0..n).map(|r| eigen.S()[r]).collect();
    let largest = lambda.iter().fold(0.0_f64, |a, l| a.max(l.abs()));
    for l in &mut lambda {
        if l.abs() <= n as f64 * f64::EPSILON * largest {
            *l = 0.0;
        }
    }
    let mut damping = vec![0.0; n];
    if let Some(d) = &form.d {
        let modal = eigen.U().transpose() * d * eigen.U();
        // coupling that a rounding of D could have made: the damping is proportional
        let tol = UNCOUPLED * modal.norm_max();
        for j in 0..n {
            for i in 0..n {
                if i != j && modal[(i, j)].abs() > tol {
                    return Ok(None);
                }
            }
            damping[j] = if modal[(j, j)].abs() <= tol { 0.0 } else { modal[(j, j)] };
        }
    }
    let mut shape = eigen.U().to_owned();
    form.l.transpose().solve_upper_triangular_in_place(&mut shape);
    Ok(Some(RealModes { shape, lambda, damping }))
}

pub fn complex_modes(form: &NormalForm) -> Option<ComplexModes> {
    let rate = form.rate();
    let eigen = form.state_matrix(rate).eigen().ok()?;
    let n = form.n();
    let vectors = eigen.U().to_owned();
    let finite = (0..2 * n).all(|j| eigen.S()[j].is_finite());
    if !finite {
        return None;
    }
    let lu = vectors.partial_piv_lu();
    let condition = vectors_condition(vectors.as_ref(), &lu);
    Some(ComplexModes {
        pole: (0..2 * n).map(|j| eigen.S()[j]).collect(),
        top: vectors.subrows(0, n).to_owned(),
        lu,
        condition,
    })
}

/// Hager's estimate of |V|_1 |V^-1|_1 (Higham, Accuracy and Stability of Numerical Algorithms, algorithm 15.4 without its last test).
fn vectors_condition(v: MatRef<'_, c64>, lu: &faer::linalg::solvers::PartialPivLu<c64>) -> f64 {
    let n = v.nrows();
    let column_sum = |a: MatRef<'_, c64>, j: usize| (0..n).map(|i| a[(i, j)].norm()).sum::<f64>();
    let norm = (0..n).map(|j| column_sum(v, j)).fold(0.0, f64::max);
    let mut x = Mat::from_fn(n, 1, |_, _| c64::new(1.0 / n as f64, 0.0));
    let mut estimate = 0.0_f64;
    for _ in 0..5 {
        lu.solve_in_place(&mut x);
        let size = column_sum(x.as_ref(), 0);
        if !size.is_finite() {
            return f64::INFINITY;
        }
        if size <= estimate {
            break;
        }
        estimate = size;
        let mut sign = Mat::from_fn(n, 1, |i, _| {
            let a = x[(i, 0)];
            if a.norm() > 0.0 { a / a.norm() } else { c64::new(1.0, 0.0) }
        });
        lu.solve_adjoint_in_place(&mut sign);
        let largest = (0..n).max_by(|a, b| sign[(*a, 0)].norm().total_cmp(&sign[(*b, 0)].norm()));
        let Some(largest) = largest else { break };
        x = Mat::zeros(n, 1);
        x[(largest, 0)] = c64::new(1.0, 0.0);
    }
    norm * estimate
}

/// Roots of s^2 + c s + lambda without cancellation.
pub fn quadratic_roots(lambda: f64, c: f64) -> [c64; 2] {
    let discriminant = 0.25 * c * c - lambda;
    if discriminant < 0.0 {
        let im = (-discriminant).sqrt();
        [c64::new(-0.5 * c, im), c64::new(-0.5 * c, -im)]
    } else {
        let large = -0.5 * c - discriminant.sqrt().copysign(c);
        let small = if large != 0.0 { lambda / large } else { 0.0 };
        [c64::new(small, 0.0), c64::new(large, 0.0)]
    }
}
