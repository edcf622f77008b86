//! Modes of a dense system as transfer functions and responses sum them up.
use faer::prelude::*;
use faer::{Mat, MatRef, c64};

use super::modal::{Eigensolution, Modal};
use super::ports::complex;
use crate::linalg::quadratic::{NormalForm, is_finite_complex};

pub struct RealModes {
    /// (n, n) mass-normalised shapes and the squares of the natural frequencies; rigid modes are exactly zero
    pub shape: Mat<f64>,
    pub lambda: Vec<f64>,
    pub damping: Vec<f64>,
    /// what rounding may hide in each of `lambda`
    pub noise: Vec<f64>,
    pub pole: Vec<c64>,
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

/// What a sum over modes takes, or that there is none.
pub enum Expansion {
    /// Modes that are real and uncoupled.
    Real(RealModes),
    /// All others.
    Complex(ComplexModes),
    /// Without modes.
    None,
}

impl Expansion {
    /// Modes that are uncoupled.
    pub fn real(solved: &Eigensolution) -> Self {
        let Some((pairs, shape)) = solved.uncoupled() else { return Expansion::None };
        Expansion::Real(RealModes {
            shape,
            noise: solved.noise(),
            lambda: pairs.iter().map(|(s, partner)| (s * partner).re).collect(),
            damping: pairs.iter().map(|(s, partner)| -(s + partner).re).collect(),
            pole: pairs.iter().flat_map(|(s, partner)| [*s, *partner]).collect(),
        })
    }

    /// All modes of the system that `form`, if its mass matrix has one, belongs to.
    pub fn complex(modal: &Modal, form: Option<&NormalForm>) -> Self {
        form.and_then(|form| ComplexModes::new(form, modal)).map_or(Expansion::None, Expansion::Complex)
    }

    /// All 2n poles in rad/s.
    pub fn poles(&self) -> Option<Vec<c64>> {
        match self {
            Expansion::Real(modes) => Some(modes.pole.clone()),
            Expansion::Complex(modes) => Some(modes.pole.clone()),
            Expansion::None => None,
        }
    }
}

impl ComplexModes {
    /// Columns (z, z'/rate) of unit length; None where a vector is not finite.
    fn new(form: &NormalForm, modal: &Modal) -> Option<Self> {
        let (n, rate) = (form.n(), form.rate());
        let z = complex(form.l.transpose()) * &modal.shape;
        let own = complex(form.l.transpose()) * &modal.partner_shape;
        let mut pole = Vec::with_capacity(2 * n);
        let mut vectors = Mat::<c64>::zeros(2 * n, 2 * n);
        let mut put = |s: c64, of: &dyn Fn(usize) -> c64| {
            let j = pole.len();
            let size = (0..n).map(|i| of(i).norm_sqr() * (1.0 + (s / rate).norm_sqr())).sum::<f64>().sqrt();
            for i in 0..n {
                vectors[(i, j)] = of(i) / size;
                vectors[(n + i, j)] = of(i) * s / (rate * size);
            }
            pole.push(s);
        };
        for (j, (&s, &partner)) in modal.s.iter().zip(&modal.partner).enumerate() {
            put(s, &|i| z[(i, j)]);
            match modal.partner_mode.iter().position(|mode| *mode == j) {
                Some(k) => put(partner, &|i| own[(i, k)]),
                None => put(partner, &|i| z[(i, j)].conj()),
            }
        }
        if !is_finite_complex(vectors.as_ref()) {
            return None;
        }
        let lu = vectors.partial_piv_lu();
        let condition = vectors_condition(vectors.as_ref(), &lu);
        Some(ComplexModes { pole, top: vectors.subrows(0, n).to_owned(), lu, condition })
    }
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
