//! Condensation where rounding would spoil it: residuals in twice the precision, and solutions in two parts.
//!
//! Of finely divided structures the entries of K are many orders larger than those after condensation (a beam of n elements:
//! n^4), and so is the rounding of a factorisation. With x an approximation of -Z_ll^-1 Z_lr and r = -Z_lr - Z_ll x its residual,
//! S = Z_rr + Z_rl x - l^T r, where l^T = -Z_rl Z_ll^-1, is off by the product of the errors of l and x only. Residuals as in N. J.
//! Higham, Accuracy and Stability of Numerical Algorithms, 2nd ed., SIAM 2002, chapter 12.
use faer::Mat;
use num_complex::Complex64 as c64;

use super::condensed::Entry;
use crate::linalg::double_double::Dd;

#[derive(Debug, Clone, Copy, Default)]
struct Pair {
    re: Dd,
    im: Dd,
}

impl Pair {
    /// Plus sign z (x + rest): the stiffness in twice the precision, what is small beside it as it is.
    fn add_entry(&mut self, e: &Entry, w: f64, sign: f64, x: c64, rest: c64) {
        self.re.add_product(sign * e.k, x.re);
        self.im.add_product(sign * e.k, x.im);
        let small = c64::new(-w * w * e.m, w * e.c) * x + e.k * rest;
        self.re.add(sign * small.re);
        self.im.add(sign * small.im);
    }

    fn value(self) -> c64 {
        c64::new(self.re.value(), self.im.value())
    }
}

/// A solution x + rest of Z_ll (x + rest) = b, by columns.
pub struct Solution {
    pub x: Mat<c64>,
    pub rest: Mat<c64>,
}

impl Solution {
    pub fn new(x: Mat<c64>) -> Solution {
        let rest = Mat::zeros(x.nrows(), x.ncols());
        Solution { x, rest }
    }

    /// b - Z_lr y - Z_ll (x + rest), column by column.
    pub fn residual(&self, ll: &[Entry], lr: &[Entry], y: &Mat<c64>, b: Option<&Mat<c64>>, w: f64) -> Mat<c64> {
        let mut out = Mat::zeros(self.x.nrows(), self.x.ncols());
        let mut sums = vec![Pair::default(); self.x.nrows()];
        let zero = c64::new(0.0, 0.0);
        for j in 0..self.x.ncols() {
            let (x, rest) = (self.x.col_as_slice(j), self.rest.col_as_slice(j));
            sums.fill(Pair::default());
            if let Some(b) = b {
                for (sum, b) in sums.iter_mut().zip(b.col_as_slice(j)) {
                    sum.re.add(b.re);
                    sum.im.add(b.im);
                }
            }
            for e in lr.iter().filter(|e| y[(e.column, j)] != zero) {
                sums[e.row].add_entry(e, w, -1.0, y[(e.column, j)], zero);
            }
            for e in ll {
                sums[e.row].add_entry(e, w, -1.0, x[e.column], rest[e.column]);
            }
            let column = out.col_as_slice_mut(j);
            column.iter_mut().zip(&sums).for_each(|(o, s)| *o = s.value());
        }
        out
    }

    /// Adds a correction.
    pub fn add(&mut self, correction: &Mat<c64>) {
        for j in 0..self.x.ncols() {
            let rest = self.rest.col_as_slice_mut(j);
            let x = self.x.col_as_slice_mut(j);
            for ((x, rest), d) in x.iter_mut().zip(rest).zip(correction.col_as_slice(j)) {
                let total = *rest + d;
                let sum = *x + total;
                *rest = total - (sum - *x);
                *x = sum;
            }
        }
    }

    /// Z_rr + Z_rl (x + rest)
    pub fn schur(&self, rr: &[Entry], rl: &[Entry], w: f64) -> Mat<c64> {
        let n_r = self.x.ncols();
        let (one, zero) = (c64::new(1.0, 0.0), c64::new(0.0, 0.0));
        let mut sums = vec![Pair::default(); n_r * n_r];
        for e in rr {
            sums[e.row * n_r + e.column].add_entry(e, w, 1.0, one, zero);
        }
        for j in 0..n_r {
            let (x, rest) = (self.x.col_as_slice(j), self.rest.col_as_slice(j));
            for e in rl {
                sums[e.row * n_r + j].add_entry(e, w, 1.0, x[e.column], rest[e.column]);
            }
        }
        Mat::from_fn(n_r, n_r, |i, j| sums[i * n_r + j].value())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn products_and_sums_keep_what_one_number_would_lose() {
        let mut sum = Dd::default();
        let (a, b) = (1.0 + 2.0_f64.powi(-30), 1.0 - 2.0_f64.powi(-30));
        sum.add_product(a, b); // 1 - 2^-60
        sum.add(-1.0);
        assert_eq!(sum.value(), -(2.0_f64.powi(-60)));
        sum.add(1e20);
        sum.add(-1e20);
        assert_eq!(sum.value(), -(2.0_f64.powi(-60)));
    }
}
