//! Modes of a dense system as transfer functions and responses use them: made from its modal solution, not solved for again.
use faer::prelude::*;
use faer::{Mat, MatRef, c64};

use super::modal::Modal;
use super::ports::complex;
use crate::linalg::quadratic::{NormalForm, Quadratic, is_finite, is_finite_complex};

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

/// Real modes of systems that their undamped modes diagonalise; None for others.
pub fn real_modes(modal: &Modal, q: &Quadratic) -> Option<RealModes> {
    if !modal.is_real() {
        return None;
    }
    let n = q.n();
    let mut shape = Mat::from_fn(n, n, |i, j| modal.shape[(i, j)].re);
    let weighed = &q.m * &shape;
    for j in 0..n {
        let square: f64 = (0..n).map(|i| shape[(i, j)] * weighed[(i, j)]).sum();
        let norm = square.sqrt();
        (0..n).for_each(|i| shape[(i, j)] /= norm);
    }
    if !is_finite(shape.as_ref()) {
        return None;
    }
    let pairs = || modal.s.iter().zip(&modal.partner);
    Some(RealModes {
        shape,
        lambda: pairs().map(|(s, p)| (s * p).re).collect(),
        damping: pairs().map(|(s, p)| -(s + p).re + 0.0).collect(),
    })
}

/// All roots with their vectors as states (z, z'/rate), z = L^T x; None where they are not finite.
pub fn complex_modes(modal: &Modal, form: &NormalForm) -> Option<ComplexModes> {
    let (n, rate) = (form.n(), form.rate());
    let mut pole = Vec::with_capacity(2 * n);
    let mut x = Mat::<c64>::zeros(n, 2 * n);
    for j in 0..n {
        let own = modal.partner_mode.iter().position(|k| *k == j);
        let beside = |i: usize| match own {
            Some(c) => modal.partner_shape[(i, c)],
            None if modal.s[j].im != 0.0 => modal.shape[(i, j)].conj(),
            None => modal.shape[(i, j)],
        };
        for i in 0..n {
            x[(i, 2 * j)] = modal.shape[(i, j)];
            x[(i, 2 * j + 1)] = beside(i);
        }
        pole.extend([modal.s[j], modal.partner[j]]);
    }
    let z = complex(form.l.transpose()) * x;
    let mut vectors = Mat::from_fn(2 * n, 2 * n, |i, j| if i < n { z[(i, j)] } else { z[(i - n, j)] * pole[j] / rate });
    for j in 0..2 * n {
        let norm = vectors.col(j).norm_l2();
        (0..2 * n).for_each(|i| vectors[(i, j)] /= norm);
    }
    if !is_finite_complex(vectors.as_ref()) || pole.iter().any(|s| !s.is_finite()) {
        return None;
    }
    let lu = vectors.partial_piv_lu();
    let condition = vectors_condition(vectors.as_ref(), &lu);
    Some(ComplexModes { pole, top: vectors.subrows(0, n).to_owned(), lu, condition })
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
