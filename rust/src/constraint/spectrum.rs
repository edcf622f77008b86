//! Singular values of the rows of a block, against what rounding can have made of them.

use faer::prelude::*;
use nalgebra::DMatrix;

use crate::error::{Error, Result};

/// Singular values of a block's rows and what they mean.
pub(crate) struct Spectrum {
    pub values: Vec<f64>,
    pub left: DMatrix<f64>,
    pub right: DMatrix<f64>,
    /// rounding
    pub floor: f64,
    pub rank: usize,
}

pub(crate) fn of_rows(rows: &[usize], bounds: &[f64]) -> Vec<f64> {
    rows.iter().map(|i| bounds[*i]).collect()
}

/// Singular values of some rows of a block, free of units, against the rounding of each and the tolerance of the drawing.
pub(crate) fn spectrum(m: &DMatrix<f64>, bounds: &[f64], tolerance: f64) -> Result<Spectrum> {
    let (values, left, right) = singular_values(m)?;
    let first = values.first().copied().unwrap_or(0.0);
    let size = m.nrows().max(m.ncols()) as f64;
    // rounding of an entry, where the row has one
    let noise: f64 = (bounds.iter().enumerate())
        .map(|(r, bound)| bound.powi(2) * m.row(r).iter().filter(|v| **v != 0.0).count() as f64)
        .sum();
    let floor = noise.sqrt() + f64::EPSILON * size * first;
    let rank = values.iter().filter(|s| **s > tolerance.max(floor)).count();
    Ok(Spectrum { values, left, right, floor, rank })
}

/// Singular values, descending, with both sides complete.
pub fn singular_values(m: &DMatrix<f64>) -> Result<(Vec<f64>, DMatrix<f64>, DMatrix<f64>)> {
    let (rows, columns) = m.shape();
    if rows == 0 || columns == 0 {
        return Ok((Vec::new(), DMatrix::identity(rows, rows), DMatrix::identity(columns, columns)));
    }
    let svd = MatRef::from_column_major_slice(m.as_slice(), rows, columns)
        .svd()
        .map_err(|_| Error::singular("the singular values of the constraint rows could not be found"))?;
    let values = (0..rows.min(columns)).map(|k| svd.S().column_vector()[k]).collect();
    let left = DMatrix::from_fn(rows, rows, |i, j| svd.U()[(i, j)]);
    let right = DMatrix::from_fn(columns, columns, |i, j| svd.V()[(i, j)]);
    Ok((values, left, right))
}
