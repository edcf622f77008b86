//! Corrections of approximate pairs of roots and vectors by all of them at once.
//!
//! Of `Q(s) y = (s^2 M + s C + K) y = 0` with symmetric matrices and complex pairs, `Q(s)^-1 = sum_k y_k y_k^T / (a_k (s - s_k))` over all
//! roots and their conjugates, with `a_k = y_k^T Q'(s_k) y_k`. Newton's step for each approximate pair, with this inverse made of all the
//! others and `r_j = Q(s_j) y_j`, is
//!
//! `s_j <- s_j - y_j^T r_j / a_j`, `y_j <- y_j + sum_{k != j} y_k (y_k^T r_j) / (a_k (s_k - s_j)) + sum_k conj(y_k) (y_k^H r_j) /
//! (conj(a_k) (conj(s_k) - s_j))`,
//!
//! products of matrices. It converges quadratically, as the iteration of Ogita and Aishima (Japan J. Indust. Appl. Math. 35, 2018) does for
//! symmetric matrices.
use faer::Mat;

use crate::linalg::dense::{C, EPS, exceeds};

/// y_k^T r_j and y_k^H r_j of all vectors k and some columns j.
pub struct Projections {
    pub plain: Mat<C>,
    pub conjugate: Mat<C>,
}

/// What the columns become: `Y own + conj(Y) other` is added.
pub struct Corrections {
    pub own: Mat<C>,
    pub other: Mat<C>,
}

impl Corrections {
    /// Of the pairs `columns`. Two pairs that nearly coincide, and are coupled by no more than rounding, stay as they are.
    pub fn new(found: &Projections, s: &[C], slope: &[C], columns: &[usize]) -> Self {
        let (n, m) = (s.len(), columns.len());
        let own = |k: usize, c: usize| {
            let (j, p) = (columns[c], found.plain[(k, c)]);
            let (gap, rounding) = (s[k] - s[j], ROUNDING * (slope[k] * s[j]).norm() * (1.0 + (s[j] / s[k]).norm()));
            let is_one = gap.norm() <= EPS.sqrt() * s[j].norm() && p.norm() <= rounding;
            if k == j || is_one { C::ZERO } else { p / (slope[k] * gap) }
        };
        let other = |k: usize, c: usize| found.conjugate[(k, c)] / (slope[k] * (s[k] - s[columns[c]].conj())).conj();
        Corrections { own: Mat::from_fn(n, m, own), other: Mat::from_fn(n, m, other) }
    }

    /// Share of vector k in correction c, as energies measure it: vectors of soft modes are long.
    fn share(&self, k: usize, c: usize, weight: &[f64], own: f64) -> f64 {
        (self.own[(k, c)].norm() + self.other[(k, c)].norm()) * weight[k] / own
    }

    /// Length of each column's correction.
    pub fn sizes(&self, weight: &[f64], columns: &[usize]) -> Vec<f64> {
        let length = |(c, &j): (usize, &usize)| {
            (0..weight.len()).map(|k| self.share(k, c, weight, weight[j]).powi(2)).sum::<f64>().sqrt()
        };
        columns.iter().enumerate().map(length).collect()
    }

    /// The columns whose error of second order, by the corrections of those that they took part of, is more than rounding.
    pub fn unsettled(&self, sizes: &[f64], weight: &[f64], columns: &[usize]) -> Vec<usize> {
        let mut error = vec![0.0; weight.len()];
        for (c, &j) in columns.iter().enumerate() {
            error[j] = sizes[c];
        }
        let left = |c: usize, j: usize| {
            (0..weight.len()).map(|k| self.share(k, c, weight, weight[j]) * (error[k] + sizes[c])).sum::<f64>()
        };
        columns.iter().enumerate().filter(|&(c, &j)| exceeds(left(c, j), EPS)).map(|(_, &j)| j).collect()
    }
}

/// Coupling of two pairs, relative to their slopes and roots, that cannot be told from rounding.
const ROUNDING: f64 = 8.0 * EPS;
