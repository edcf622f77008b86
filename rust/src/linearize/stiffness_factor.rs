//! The factor F of a model's stiffness, K = F^T F: rows sqrt(k) w of its elements, which an assembled K loses in rounding.
use nalgebra::DMatrix;

use crate::linearize::strain_rows::Clear;
use crate::tolerances::modes::GRADED;

/// F (rows, dof) of the strains of all that is elastic; None where an element has negative or unsymmetric stiffness.
pub fn stiffness_factor(clear: &Clear) -> Option<DMatrix<f64>> {
    let mut made = DMatrix::zeros(clear.rows.nrows(), clear.rows.ncols());
    let mut first = 0;
    for k in &clear.stiffness {
        let n = k.nrows();
        made.rows_mut(first, n).copy_from(&(root(k)? * clear.rows.rows(first, n)));
        first += n;
    }
    Some(made)
}

/// True where a column of `shape` (phi^T M phi = 1) strains a row of the factor by more than rounding. The measure of a row is its
/// strain when every coordinate moves by 1/sqrt(M_ii).
pub fn is_strained(factor: &DMatrix<f64>, shape: &DMatrix<f64>, mass: &DMatrix<f64>) -> bool {
    let unit = mass.diagonal().map(|m| 1.0 / m.sqrt());
    let size = factor.abs() * unit;
    let strain = factor * shape;
    strain.column_iter().any(|e| e.iter().zip(size.iter()).any(|(e, s)| e.abs() > GRADED * s))
}

/// R with k = R^T R, rows of sqrt(k) where the stiffness is diagonal; None where it is not semidefinite.
fn root(k: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    let n = k.nrows();
    let diagonal = k.diagonal();
    let off = |i: usize, j: usize| if i == j { 0.0 } else { k[(i, j)] };
    if (0..n).all(|j| (0..n).all(|i| off(i, j) == 0.0)) {
        return diagonal.iter().all(|d| *d >= 0.0).then(|| DMatrix::from_diagonal(&diagonal.map(f64::sqrt)));
    }
    if k.transpose() != *k {
        return None;
    }
    let scale = diagonal.map(|d| if d > 0.0 { d.sqrt() } else { 1.0 });
    let eigen = DMatrix::from_fn(n, n, |i, j| k[(i, j)] / (scale[i] * scale[j])).symmetric_eigen();
    if eigen.eigenvalues.iter().any(|v| *v < -16.0 * n as f64 * f64::EPSILON) {
        return None;
    }
    let v = &eigen.eigenvectors;
    Some(DMatrix::from_fn(n, n, |i, j| eigen.eigenvalues[i].max(0.0).sqrt() * v[(j, i)] * scale[j]))
}
