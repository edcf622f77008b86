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

use crate::linalg::dense::{C, EPS, abs, exceeds};

/// y_k^T r_j and y_k^H r_j of all vectors k and some columns j.
pub struct Projections {
    pub plain: Mat<C>,
    pub conjugate: Mat<C>,
}

/// What the columns become: `Y own + conj(Y) other` is added.
pub struct Corrections {
    pub own: Mat<C>,
    pub other: Mat<C>,
    /// Share of each vector in a correction, as energies measure it: vectors of soft modes are long.
    share: Mat<f64>,
}

impl Corrections {
    /// Of the pairs `columns`. Two pairs that nearly coincide, and are coupled by no more than rounding, stay as they are.
    pub fn new(found: &Projections, s: &[C], slope: &[C], columns: &[usize]) -> Self {
        let (n, m) = (s.len(), columns.len());
        let weight: Vec<f64> = s.iter().map(|s| abs(*s)).collect();
        let own = Mat::from_fn(n, m, |k, c| {
            let (j, p) = (columns[c], found.plain[(k, c)]);
            let gap = s[k] - s[j];
            let rounding = || ROUNDING * abs(slope[k] * s[j]) * (1.0 + weight[j] / weight[k]);
            let is_one = abs(gap) <= EPS.sqrt() * weight[j] && abs(p) <= rounding();
            if k == j || is_one { C::ZERO } else { p / (slope[k] * gap) }
        });
        let other =
            Mat::from_fn(n, m, |k, c| found.conjugate[(k, c)] / (slope[k] * (s[k] - s[columns[c]].conj())).conj());
        let share = Mat::from_fn(n, m, |k, c| (abs(own[(k, c)]) + abs(other[(k, c)])) * weight[k] / weight[columns[c]]);
        Corrections { own, other, share }
    }

    /// Length of each column's correction.
    pub fn sizes(&self) -> Vec<f64> {
        self.share.col_iter().map(|share| share.iter().map(|v| v * v).sum::<f64>().sqrt()).collect()
    }

    /// The columns whose error of second order, by the corrections of those that they took part of, is more than rounding.
    pub fn unsettled(&self, sizes: &[f64], columns: &[usize]) -> Vec<usize> {
        let mut error = vec![0.0; self.share.nrows()];
        for (size, &j) in sizes.iter().zip(columns) {
            error[j] = *size;
        }
        let left = |c: usize| (0..error.len()).map(|k| self.share[(k, c)] * (error[k] + sizes[c])).sum::<f64>();
        columns.iter().enumerate().filter(|(c, _)| exceeds(left(*c), EPS)).map(|(_, &j)| j).collect()
    }
}

/// Coupling of two pairs, relative to their slopes and roots, that cannot be told from rounding.
const ROUNDING: f64 = 8.0 * EPS;
