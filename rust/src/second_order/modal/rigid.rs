//! Rank decisions on the stiffness: which directions nothing holds.
use faer::prelude::*;
use faer::{Mat, MatRef, Side};

use crate::error::{Error, Result};
use crate::linalg::dense::{EPS, completed, frobenius, is_finite};
use crate::linalg::eigen;
use crate::run::Counts;
use crate::tolerances::modes::{CLEARLY_REGULAR, LARGEST_CORRECTION};

/// Relative size below which a singular value of an equilibrated matrix counts as zero. Assembly leaves a few EPS, growing
/// with the root of the size; a stiffness ratio of 1e12 stays above it.
pub fn rank_tolerance(n: usize) -> f64 {
    32.0 * (n as f64).sqrt() * EPS
}

/// Null space of a symmetric matrix, n x r, independent of units.
pub fn symmetric_null(k: MatRef<'_, f64>, counts: &mut Counts) -> Result<Mat<f64>> {
    let n = k.nrows();
    let (a, d) = equilibrated(k);
    if let Ok(factor) = a.llt(Side::Lower) {
        let l = factor.L();
        if (0..n).all(|i| l[(i, i)].powi(2) > CLEARLY_REGULAR) {
            return Ok(Mat::zeros(n, 0));
        }
    }
    counts.add("rank tests", 1);
    let (values, vectors) = eigen::symmetric(a.as_ref())?;
    let largest = values.iter().fold(0.0f64, |m, v| m.max(v.abs()));
    let zero: Vec<usize> = (0..n).filter(|&i| values[i].abs() <= rank_tolerance(n) * largest).collect();
    Ok(Mat::from_fn(n, zero.len(), |i, j| d[i] * vectors[(i, zero[j])]))
}

/// Right and left null space of a square matrix.
pub fn general_null(s: MatRef<'_, f64>, counts: &mut Counts) -> Result<(Mat<f64>, Mat<f64>)> {
    let n = s.nrows();
    let (a, rows, columns) = equilibrated_sides(s);
    let lu = a.partial_piv_lu();
    if (0..n).all(|i| lu.U()[(i, i)].abs() > CLEARLY_REGULAR) {
        return Ok((Mat::zeros(n, 0), Mat::zeros(n, 0)));
    }
    counts.add("rank tests", 1);
    let svd = a.svd().map_err(|_| no_svd(n))?;
    let sigma = svd.S().column_vector();
    let floor = rank_tolerance(n) * sigma[0];
    let rank = (0..n).filter(|&i| sigma[i] > floor).count();
    let right = Mat::from_fn(n, n - rank, |i, j| columns[i] * svd.V()[(i, rank + j)]);
    let left = Mat::from_fn(n, n - rank, |i, j| rows[i] * svd.U()[(i, rank + j)]);
    Ok((right, left))
}

/// Null space of a factor `f` (any number of rows): the geometry decides, not the stiffnesses in its rows.
pub fn factor_null(f: MatRef<'_, f64>, counts: &mut Counts) -> Result<Mat<f64>> {
    counts.add("rank tests", 1);
    let n = f.ncols();
    let tall = Mat::from_fn(f.nrows().max(n), n, |i, j| if i < f.nrows() { f[(i, j)] } else { 0.0 });
    let (a, _, columns) = equilibrated_sides(tall.as_ref());
    let svd = a.thin_svd().map_err(|_| no_svd(n))?;
    let sigma = svd.S().column_vector();
    let floor = rank_tolerance(n) * sigma[0];
    let rank = (0..n).filter(|&i| sigma[i] > floor).count();
    Ok(Mat::from_fn(n, n - rank, |i, j| columns[i] * svd.V()[(i, rank + j)]))
}

/// One Newton step on orthonormal right and left null vectors of `s`: orthonormalising vectors whose entries differ by orders
/// has left errors in them. With s + |s| left right^T in place of s the equations are regular.
pub fn polished(s: MatRef<'_, f64>, right: &Mat<f64>, left: &Mat<f64>) -> (Mat<f64>, Mat<f64>) {
    let shifted = s + Scale(frobenius(s)) * (left * right.transpose());
    let lu = shifted.partial_piv_lu();
    let step = |z: &Mat<f64>, mut w: Mat<f64>, transposed: bool| {
        if transposed {
            lu.solve_transpose_in_place(w.as_mut());
        } else {
            lu.solve_in_place(w.as_mut());
        }
        let finite = is_finite(w.as_ref()) && frobenius(w.as_ref()) < LARGEST_CORRECTION;
        let better = z - &w + z * (z.transpose() * &w);
        if finite { completed(better.as_ref()).0 } else { z.clone() }
    };
    (step(right, s * right, false), step(left, s.transpose() * left, true))
}

pub fn no_svd(n: usize) -> Error {
    Error::Convergence {
        message: format!("the singular value decomposition of size {n} did not converge"),
        best: Vec::new(),
        residual: f64::NAN,
    }
}

const SWEEPS: usize = 4;

fn power_of_two(x: f64) -> f64 {
    if x > 0.0 { (-0.5 * x.log2()).round().exp2() } else { 1.0 }
}

/// d a d with largest entries about 1 in every row, and d (powers of two: no rounding).
fn equilibrated(a: MatRef<'_, f64>) -> (Mat<f64>, Vec<f64>) {
    let n = a.nrows();
    let mut d = vec![1.0; n];
    for _ in 0..SWEEPS {
        let largest: Vec<f64> =
            (0..n).map(|i| (0..n).fold(0.0f64, |m, j| m.max((a[(i, j)] * d[i] * d[j]).abs()))).collect();
        for i in 0..n {
            d[i] *= power_of_two(largest[i]);
        }
    }
    (Mat::from_fn(n, n, |i, j| a[(i, j)] * d[i] * d[j]), d)
}

/// rows a columns with largest entries about 1 in every row and column.
fn equilibrated_sides(a: MatRef<'_, f64>) -> (Mat<f64>, Vec<f64>, Vec<f64>) {
    let (m, n) = (a.nrows(), a.ncols());
    let (mut r, mut c) = (vec![1.0; m], vec![1.0; n]);
    for _ in 0..SWEEPS {
        for i in 0..m {
            let largest = (0..n).fold(0.0f64, |s, j| s.max((a[(i, j)] * r[i] * c[j]).abs()));
            r[i] *= power_of_two(largest);
        }
        for j in 0..n {
            let largest = (0..m).fold(0.0f64, |s, i| s.max((a[(i, j)] * r[i] * c[j]).abs()));
            c[j] *= power_of_two(largest);
        }
    }
    (Mat::from_fn(m, n, |i, j| a[(i, j)] * r[i] * c[j]), r, c)
}
