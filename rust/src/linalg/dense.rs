//! Small services on dense matrices that faer leaves to its users.
use faer::prelude::*;
use faer::{Mat, MatRef, Side};
use nalgebra::{DMatrix, DVector};

use crate::error::{Error, Result};
use crate::tolerances::constraints::FELT;
use crate::tolerances::matrices::ENTRY_ROUNDING;

pub type C = faer::c64;

pub const EPS: f64 = f64::EPSILON;

pub fn real(x: f64) -> C {
    C::new(x, 0.0)
}

/// True where a value is not at most the limit: nan never passes.
pub fn exceeds(value: f64, limit: f64) -> bool {
    value > limit || value.is_nan()
}

/// May rounding of entries change all of a solution? `growth`: of its size over the load times that of the matrix.
pub fn is_singular(growth: f64) -> bool {
    exceeds(ENTRY_ROUNDING * EPS * growth, 1.0)
}

pub fn frobenius(a: MatRef<'_, f64>) -> f64 {
    a.norm_l2()
}

pub fn is_finite(a: MatRef<'_, f64>) -> bool {
    (0..a.ncols()).all(|j| (0..a.nrows()).all(|i| a[(i, j)].is_finite()))
}

pub fn is_zero(a: MatRef<'_, f64>) -> bool {
    (0..a.ncols()).all(|j| (0..a.nrows()).all(|i| a[(i, j)] == 0.0))
}

/// `a` with every entry replaced by its modulus.
pub fn absolute(a: MatRef<'_, f64>) -> Mat<f64> {
    Mat::from_fn(a.nrows(), a.ncols(), |i, j| a[(i, j)].abs())
}

pub fn modulus(a: MatRef<'_, C>) -> Mat<f64> {
    Mat::from_fn(a.nrows(), a.ncols(), |i, j| abs(a[(i, j)]))
}

/// |z| as `norm` has it, by a square root where squares neither vanish nor overflow: several times as fast.
pub fn abs(z: C) -> f64 {
    let square = z.norm_sqr();
    if (f64::MIN_POSITIVE / EPS..f64::MAX).contains(&square) { square.sqrt() } else { z.norm() }
}

/// (a + a^T) / 2, to keep rounding from breaking a symmetry that later steps rely on.
pub fn symmetrised(a: Mat<f64>) -> Mat<f64> {
    let n = a.nrows();
    Mat::from_fn(n, n, |i, j| 0.5 * (a[(i, j)] + a[(j, i)]))
}

/// Largest |a_ij - sign a_ji| relative to the largest |a_ij|, and where it is.
pub fn asymmetry(a: MatRef<'_, f64>, sign: f64) -> (f64, usize, usize) {
    let (mut worst, mut largest) = ((0.0, 0, 0), 0.0f64);
    for j in 0..a.ncols() {
        for i in 0..=j {
            largest = largest.max(a[(i, j)].abs()).max(a[(j, i)].abs());
            let gap = (a[(i, j)] - sign * a[(j, i)]).abs();
            if gap > worst.0 {
                worst = (gap, i, j);
            }
        }
    }
    if largest > 0.0 {
        worst.0 /= largest;
    }
    worst
}

/// Real times complex as two real products, one where the imaginary part vanishes.
pub fn real_times(a: MatRef<'_, f64>, x: MatRef<'_, C>) -> Mat<C> {
    let re = Mat::from_fn(x.nrows(), x.ncols(), |i, j| x[(i, j)].re);
    let product_re = a * &re;
    let is_real = (0..x.ncols()).all(|j| (0..x.nrows()).all(|i| x[(i, j)].im == 0.0));
    if is_real {
        return to_complex(product_re.as_ref());
    }
    let im = Mat::from_fn(x.nrows(), x.ncols(), |i, j| x[(i, j)].im);
    let product_im = a * &im;
    Mat::from_fn(a.nrows(), x.ncols(), |i, j| C::new(product_re[(i, j)], product_im[(i, j)]))
}

pub fn to_complex(a: MatRef<'_, f64>) -> Mat<C> {
    Mat::from_fn(a.nrows(), a.ncols(), |i, j| real(a[(i, j)]))
}

/// Lower Cholesky factor of a matrix of unit scale (diagonal about 1), or the row whose pivot is not positive within
/// rounding.
pub fn cholesky(a: MatRef<'_, f64>) -> std::result::Result<Mat<f64>, usize> {
    let n = a.nrows();
    let floor = 4.0 * n as f64 * EPS;
    match a.llt(Side::Lower) {
        Ok(factor) => {
            let l = factor.L();
            match (0..n).find(|&i| l[(i, i)].powi(2) <= floor * a[(i, i)].abs()) {
                Some(i) => Err(i),
                None => Ok(Mat::from_fn(n, n, |i, j| if i >= j { l[(i, j)] } else { 0.0 })),
            }
        }
        Err(faer::linalg::cholesky::llt::factor::LltError::NonPositivePivot { index }) => Err(index.min(n - 1)),
    }
}

/// L^-1 a L^-T.
pub fn reduced(l: MatRef<'_, f64>, a: MatRef<'_, f64>) -> Mat<f64> {
    let mut half = a.to_owned();
    l.solve_lower_triangular_in_place(half.as_mut());
    let mut full = half.transpose().to_owned();
    l.solve_lower_triangular_in_place(full.as_mut());
    full.transpose().to_owned()
}

/// An orthonormal basis of the columns of `z` (n x r, full rank) followed by one of their complement.
pub fn completed(z: MatRef<'_, f64>) -> (Mat<f64>, Mat<f64>) {
    let (n, r) = (z.nrows(), z.ncols());
    let q = z.qr().compute_Q();
    (q.subcols(0, r).to_owned(), q.subcols(r, n - r).to_owned())
}

/// The columns of `a` and then those of `b`.
pub fn beside<T: Copy>(a: MatRef<'_, T>, b: MatRef<'_, T>) -> Mat<T> {
    let split = a.ncols();
    Mat::from_fn(
        a.nrows().max(b.nrows()),
        split + b.ncols(),
        |i, j| {
            if j < split { a[(i, j)] } else { b[(i, j - split)] }
        },
    )
}

/// sum_i a_i b_i without conjugation.
pub fn dot(a: ColRef<'_, C>, b: ColRef<'_, C>) -> C {
    (0..a.nrows()).map(|i| a[i] * b[i]).sum()
}

/// Least-squares solution of smallest norm; directions that no row feels are left alone.
pub fn minimum_norm(m: &DMatrix<f64>, right: &DVector<f64>) -> Result<DVector<f64>> {
    let (rows, columns) = m.shape();
    let mut x = DVector::zeros(columns);
    if rows == 0 || columns == 0 {
        return Ok(x);
    }
    let svd = MatRef::from_column_major_slice(m.as_slice(), rows, columns)
        .thin_svd()
        .map_err(|_| Error::singular("the singular values of the constraint rows could not be found"))?;
    let (u, s, v) = (svd.U(), svd.S().column_vector(), svd.V());
    for k in (0..s.nrows()).filter(|k| s[*k] > FELT * s[0]) {
        let weight = (0..rows).map(|i| u[(i, k)] * right[i]).sum::<f64>() / s[k];
        for i in 0..columns {
            x[i] += weight * v[(i, k)];
        }
    }
    Ok(x)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn directions_that_no_row_feels_are_left_alone() -> Result<()> {
        let along = |felt: f64| -> Result<f64> {
            let m = DMatrix::from_row_slice(2, 2, &[1.0, 0.0, 0.0, felt]);
            Ok(minimum_norm(&m, &DVector::from_vec(vec![0.0, 1.0]))?[1])
        };
        assert!((along(1e-9)? * 1e-9 - 1.0).abs() < 1e-9 && along(1e-11)? == 0.0);
        Ok(())
    }
}
