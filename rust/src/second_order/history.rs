//! Load histories: values at given times, linear between them.
use faer::{Mat, MatRef};

use crate::error::{Error, Result};
use crate::linalg::quadratic::is_finite;

/// Loads at the times, and the height of a parabola over each step by which the true load may deviate from its chord.
pub struct History {
    pub t: Vec<f64>,
    pub u: Mat<f64>,
    pub bulge: Mat<f64>,
}

impl History {
    pub fn check(&self, n_in: usize) -> Result<()> {
        let n_t = self.t.len();
        if n_t < 2 {
            return Err(Error::model("t needs at least two times"));
        }
        if self.t.iter().any(|t| !t.is_finite()) || self.t.windows(2).any(|p| p[1] <= p[0]) {
            return Err(Error::model("t must be finite and strictly increasing"));
        }
        let shapes = self.u.nrows() == n_in
            && self.u.ncols() == n_t
            && self.bulge.nrows() == n_in
            && self.bulge.ncols() == n_t - 1;
        if !shapes {
            return Err(Error::model(format!(
                "the loads must be ({n_in}, {n_t}), they are ({}, {})",
                self.u.nrows(),
                self.u.ncols()
            )));
        }
        if !is_finite(self.u.as_ref()) || !is_finite(self.bulge.as_ref()) {
            return Err(Error::model("a load history contains NaN or infinite values"));
        }
        Ok(())
    }

    /// Index of the representative of each step, and the representatives. Steps that differ by the rounding of t are one.
    pub fn steps(&self) -> (Vec<usize>, Vec<f64>) {
        let n = self.t.len() - 1;
        let (first, last) = (self.t[0], self.t[n]);
        let noise = 4.0 * f64::EPSILON * first.abs().max(last.abs());
        let mean = (last - first) / n as f64;
        let uniform = (0..=n).all(|k| (self.t[k] - (first + k as f64 * mean)).abs() <= noise);
        if uniform {
            return (vec![0; n], vec![mean]);
        }
        let h: Vec<f64> = self.t.windows(2).map(|p| p[1] - p[0]).collect();
        let mut order: Vec<usize> = (0..n).collect();
        order.sort_by(|a, b| h[*a].total_cmp(&h[*b]));
        let (mut index, mut values) = (vec![0; n], Vec::<f64>::new());
        for k in order {
            if values.last().is_none_or(|v| h[k] - v > noise) {
                values.push(h[k]);
            }
            index[k] = values.len() - 1;
        }
        (index, values)
    }

    /// Derivative of the load at the times by second-order differences; only outputs that see u' or u'' ask for it.
    pub fn derivative(&self, order: usize) -> Mat<f64> {
        let mut u = self.u.clone();
        for _ in 0..order {
            u = differences(&self.t, u.as_ref());
        }
        u
    }
}

fn differences(t: &[f64], u: MatRef<'_, f64>) -> Mat<f64> {
    let n = t.len();
    let slope = |i: usize, k: usize| (u[(i, k + 1)] - u[(i, k)]) / (t[k + 1] - t[k]);
    Mat::from_fn(u.nrows(), n, |i, k| {
        if n == 2 {
            return slope(i, 0);
        }
        let (left, right) = match k {
            0 => (0, 1),
            _ if k == n - 1 => (n - 3, n - 2),
            _ => (k - 1, k),
        };
        let (h0, h1) = (t[left + 1] - t[left], t[right + 1] - t[right]);
        let (s0, s1) = (slope(i, left), slope(i, right));
        let curvature = (s1 - s0) / (h0 + h1);
        // the parabola through three points, differentiated at t_k
        s0 + curvature * (2.0 * t[k] - t[left] - t[left + 1])
    })
}
