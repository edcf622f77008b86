//! Modes of a dense system as transfer functions and responses sum them up.
use std::f64::consts::SQRT_2;

use faer::linalg::solvers::PartialPivLu;
use faer::prelude::*;
use faer::{Mat, MatRef, c64};

use super::modal::Eigensolution;
use super::ports::complex;
use crate::linalg::dense::{is_finite, real_times};
use crate::linalg::quadratic::NormalForm;

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
    /// conjugates side by side, the one with Im > 0 first
    pub pole: Vec<c64>,
    /// rows of the eigenvectors that belong to z
    top: Mat<c64>,
    /// of the eigenvectors V, of a pair v, conj(v) their real and imaginary parts times sqrt 2: V times a unitary matrix
    lu: PartialPivLu<f64>,
    /// 1-norm condition estimate of the eigenvectors
    pub condition: f64,
}

impl ComplexModes {
    /// V^-1 B: real states in modal coordinates.
    pub fn coordinates(&self, states: MatRef<'_, f64>) -> Mat<c64> {
        let mut parts = states.to_owned();
        self.lu.solve_in_place(&mut parts);
        Mat::from_fn(parts.nrows(), parts.ncols(), |i, j| match self.pole[i].im {
            im if im > 0.0 => c64::new(parts[(i, j)], -parts[(i + 1, j)]) / SQRT_2,
            im if im < 0.0 => c64::new(parts[(i - 1, j)], parts[(i, j)]) / SQRT_2,
            _ => c64::new(parts[(i, j)], 0.0),
        })
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
    /// The modes of a system, whose mass-normalised form, if its mass matrix has one, is `form`.
    pub fn new<'a>(solved: &Eigensolution, form: impl FnOnce() -> Option<&'a NormalForm>) -> Self {
        if solved.is_uncoupled() {
            return Expansion::real(solved);
        }
        form().and_then(|form| ComplexModes::new(form, solved)).map_or(Expansion::None, Expansion::Complex)
    }

    fn real(solved: &Eigensolution) -> Self {
        let Some((pairs, shape)) = solved.uncoupled() else { return Expansion::None };
        Expansion::Real(RealModes {
            shape,
            noise: solved.noise(),
            lambda: pairs.iter().map(|(s, partner)| (s * partner).re).collect(),
            damping: pairs.iter().map(|(s, partner)| -(s + partner).re).collect(),
            pole: pairs.iter().flat_map(|(s, partner)| [*s, *partner]).collect(),
        })
    }

    /// All 2n poles in rad/s.
    pub fn poles(&self) -> Option<&[c64]> {
        match self {
            Expansion::Real(modes) => Some(&modes.pole),
            Expansion::Complex(modes) => Some(&modes.pole),
            Expansion::None => None,
        }
    }
}

impl ComplexModes {
    /// Columns (z, z'/rate) of unit length; None where a vector is not finite.
    fn new(form: &NormalForm, solved: &Eigensolution) -> Option<Self> {
        let (n, rate) = (form.n(), form.rate());
        let (roots, shape) = solved.roots();
        let z = real_times(form.l.transpose(), shape.as_ref());
        let (mut pole, mut top) = (Vec::with_capacity(2 * n), Mat::<c64>::zeros(n, 2 * n));
        let mut parts = Mat::<f64>::zeros(2 * n, 2 * n);
        for (k, &s) in roots.iter().enumerate() {
            let (j, own) = (pole.len(), z.col(k));
            let pair = s.im > 0.0;
            if j + pair as usize >= 2 * n {
                return None;
            }
            let size = own.norm_l2() * (1.0 + (s / rate).norm_sqr()).sqrt();
            for i in 0..n {
                let v = [own[i] / size, own[i] * s / (rate * size)];
                top[(i, j)] = v[0];
                if pair {
                    top[(i, j + 1)] = v[0].conj();
                }
                for (row, v) in [i, n + i].into_iter().zip(v) {
                    parts[(row, j)] = if pair { SQRT_2 * v.re } else { v.re };
                    if pair {
                        parts[(row, j + 1)] = SQRT_2 * v.im;
                    }
                }
            }
            pole.push(s);
            pole.extend(pair.then(|| s.conj()));
        }
        if pole.len() < 2 * n || !is_finite(parts.as_ref()) {
            return None;
        }
        let lu = parts.partial_piv_lu();
        let condition = vectors_condition(parts.as_ref(), &lu);
        Some(ComplexModes { pole, top, lu, condition })
    }
}

/// Hager's estimate of |V|_1 |V^-1|_1 (Higham, Accuracy and Stability of Numerical Algorithms, algorithm 15.4 without its last test).
fn vectors_condition(v: MatRef<'_, f64>, lu: &PartialPivLu<f64>) -> f64 {
    let n = v.nrows();
    let column_sum = |a: MatRef<'_, f64>, j: usize| (0..n).map(|i| a[(i, j)].abs()).sum::<f64>();
    let norm = (0..n).map(|j| column_sum(v, j)).fold(0.0, f64::max);
    let mut x = Mat::from_fn(n, 1, |_, _| 1.0 / n as f64);
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
        let mut sign = Mat::from_fn(n, 1, |i, _| 1.0_f64.copysign(x[(i, 0)]));
        lu.solve_transpose_in_place(&mut sign);
        let largest = (0..n).max_by(|a, b| sign[(*a, 0)].abs().total_cmp(&sign[(*b, 0)].abs()));
        let Some(largest) = largest else { break };
        x = Mat::zeros(n, 1);
        x[(largest, 0)] = 1.0;
    }
    norm * estimate
}
