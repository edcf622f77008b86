//! Derivatives of transfer functions: dH = dL Z^-1 F + L Z^-1 dF - L Z^-1 dZ Z^-1 F, with dZ = dS - omega^2 dM + i omega dD.
//!
//! One factorisation per frequency serves all parameters; a parameter costs what its non-zero entries cost.
use faer::prelude::*;
use faer::{Mat, MatRef, c64};

use super::ports::{Ports, complex, i_omega};
use crate::error::{Error, Result};
use crate::linalg::dense::is_singular;
use crate::linalg::quadratic::{Quadratic, is_finite_complex};
use crate::run::{Cancel, Counts};

/// Derivative of one matrix entry triple (M, D, S).
#[derive(Debug, Clone, Copy)]
pub struct Entry {
    pub row: usize,
    pub col: usize,
    pub dm: f64,
    pub dd: f64,
    pub ds: f64,
}

/// Everything that one parameter changes.
#[derive(Debug, Clone, Default)]
pub struct Variation {
    pub entries: Vec<Entry>,
    pub df: Option<Mat<f64>>,
    pub dl: Option<Mat<f64>>,
    pub dd0: Option<Mat<f64>>,
}

pub struct Derivatives {
    /// (n_out, n_in, n_freq, n_p), last index fastest
    pub dh: Vec<c64>,
    /// relative error of the solutions, computed at three frequencies
    pub error: f64,
    pub singular: Vec<usize>,
    pub counts: Counts,
}

pub fn sensitivity(
    q: &Quadratic,
    ports: &Ports,
    variations: &[Variation],
    omega: &[f64],
    cancel: &Cancel,
) -> Result<Derivatives> {
    ports.check(q.n())?;
    if omega.iter().any(|w| !w.is_finite()) {
        return Err(Error::model("omega contains NaN or infinite values"));
    }
    let (n_out, n_in, n_freq, n_p) = (ports.l.nrows(), ports.f.ncols(), omega.len(), variations.len());
    let mut counts = Counts::default();
    let mut dh = vec![c64::new(0.0, 0.0); n_out * n_in * n_freq * n_p];
    let mut singular = Vec::new();
    let solver = Solver::new(q, ports);
    for (k, &w) in omega.iter().enumerate() {
        cancel.check()?;
        counts.add("factorisations", 1);
        let solved = solver.at(w);
        if solved.is_none() {
            singular.push(k);
        }
        for (p, variation) in variations.iter().enumerate() {
            let value = solved.as_ref().map(|(x, y)| one(variation, ports, w, x, y));
            for i in 0..n_out {
                for j in 0..n_in {
                    let at = ((i * n_in + j) * n_freq + k) * n_p + p;
                    dh[at] = match &value {
                        Some(value) => value[(i, j)],
                        None => c64::new(f64::NAN, f64::NAN),
                    };
                }
            }
        }
    }
    let error = sampled_error(q, ports, omega, &solver.scale);
    Ok(Derivatives { dh, error, singular, counts })
}

struct Solver<'a> {
    q: &'a Quadratic,
    l: Mat<c64>,
    f: Mat<c64>,
    scale: Vec<f64>,
}

impl<'a> Solver<'a> {
    fn new(q: &'a Quadratic, ports: &Ports) -> Self {
        Solver {
            l: complex(ports.l.transpose().to_owned().as_ref()),
            f: complex(ports.f.as_ref()),
            scale: q.unit_scale(),
            q,
        }
    }

    /// X = Z^-1 F and Y = Z^-T L^T.
    fn at(&self, w: f64) -> Option<(Mat<c64>, Mat<c64>)> {
        let (n, scale) = (self.q.n(), &self.scale);
        let z = self.q.dynamic(w);
        let lu = Mat::from_fn(n, n, |i, j| z[(i, j)] * scale[i] * scale[j]).partial_piv_lu();
        let scaled = |a: MatRef<'_, c64>| Mat::from_fn(n, a.ncols(), |i, j| a[(i, j)] * scale[i]);
        let mut x = scaled(self.f.as_ref());
        lu.solve_in_place(&mut x);
        let mut y = scaled(self.l.as_ref());
        lu.solve_transpose_in_place(&mut y);
        let (x, y) = (scaled(x.as_ref()), scaled(y.as_ref()));
        let growth = x.norm_l2() * z.norm_l2() / self.f.norm_l2().max(f64::MIN_POSITIVE);
        let regular = is_finite_complex(x.as_ref()) && is_finite_complex(y.as_ref()) && !is_singular(growth);
        regular.then_some((x, y))
    }
}

fn one(variation: &Variation, ports: &Ports, w: f64, x: &Mat<c64>, y: &Mat<c64>) -> Mat<c64> {
    let (n_out, n_in) = (y.ncols(), x.ncols());
    let mut out = Mat::<c64>::zeros(n_out, n_in);
    if !variation.entries.is_empty() {
        // W = dZ X has few non-zero rows; entries come sorted by row
        let mut row = vec![c64::new(0.0, 0.0); n_in];
        let mut entries = variation.entries.iter().peekable();
        while let Some(e) = entries.next() {
            let dz = c64::new(e.ds - w * w * e.dm, w * e.dd);
            for (j, sum) in row.iter_mut().enumerate() {
                *sum += dz * x[(e.col, j)];
            }
            if entries.peek().is_none_or(|next| next.row != e.row) {
                for i in 0..n_out {
                    for (j, sum) in row.iter().enumerate() {
                        out[(i, j)] -= y[(e.row, i)] * sum;
                    }
                }
                row.fill(c64::new(0.0, 0.0));
            }
        }
    }
    if let Some(dl) = &variation.dl {
        out += complex(dl.as_ref()) * x;
    }
    if let Some(df) = &variation.df {
        out += y.transpose() * complex(df.as_ref());
    }
    Mat::from_fn(n_out, n_in, |i, j| {
        let feed = variation.dd0.as_ref().map_or(0.0, |d| d[(i, j)]);
        out[(i, j)] * i_omega(w, ports.order_in[j] + ports.order_out) + i_omega(w, ports.order_out) * feed
    })
}

/// Two solves enter each derivative, each with the error of a plain direct solution.
fn sampled_error(q: &Quadratic, ports: &Ports, omega: &[f64], scale: &[f64]) -> f64 {
    let n = omega.len();
    if n == 0 {
        return 0.0;
    }
    let load = Mat::from_fn(q.n(), 1, |i, _| c64::new((0..ports.f.ncols()).map(|j| ports.f[(i, j)]).sum(), 0.0));
    [0, n / 2, n - 1]
        .iter()
        .filter_map(|k| q.solve(omega[*k], load.as_ref(), scale, 2))
        .map(|solved| 2.0 * solved.error)
        .fold(f64::EPSILON, f64::max)
}
