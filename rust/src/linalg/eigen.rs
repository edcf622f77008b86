//! Eigensolvers of dense matrices with the checks that faer leaves to its users.
use faer::diag::Diag;
use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::evd::{ComputeEigenvectors, evd_real, evd_scratch};
use faer::{Mat, MatRef, Par, Side};

use super::balance::Balanced;
use super::dense::C;
use crate::error::{Error, Result};

/// Eigenvalues in ascending order and orthonormal vectors.
pub fn symmetric(a: MatRef<'_, f64>) -> Result<(Vec<f64>, Mat<f64>)> {
    if a.nrows() == 0 {
        return Ok((Vec::new(), Mat::zeros(0, 0)));
    }
    let eigen = a.self_adjoint_eigen(Side::Lower).map_err(|_| no_convergence("symmetric", a.nrows()))?;
    let values = eigen.S().column_vector().iter().copied().collect();
    Ok((values, eigen.U().to_owned()))
}

/// Eigenvalues in ascending order.
pub fn symmetric_values(a: MatRef<'_, f64>) -> Result<Vec<f64>> {
    a.self_adjoint_eigenvalues(Side::Lower).map_err(|_| no_convergence("symmetric", a.nrows()))
}

pub fn hermitian(a: MatRef<'_, C>) -> Result<(Vec<f64>, Mat<C>)> {
    if a.nrows() == 0 {
        return Ok((Vec::new(), Mat::zeros(0, 0)));
    }
    let eigen = a.self_adjoint_eigen(Side::Lower).map_err(|_| no_convergence("Hermitian", a.nrows()))?;
    let values = eigen.S().column_vector().iter().map(|s| s.re).collect();
    Ok((values, eigen.U().to_owned()))
}

/// Roots of a real matrix, of each complex pair the one with Im > 0: `a x = s x` and, where asked for, `y^T a = s y^T`.
pub struct Roots {
    pub s: Vec<C>,
    pub right: Mat<C>,
    pub left: Option<Mat<C>>,
}

/// Balanced real eigenproblem.
pub fn general(a: &Mat<f64>, want_left: bool) -> Result<Roots> {
    let n = a.nrows();
    if n == 0 {
        return Ok(Roots { s: Vec::new(), right: Mat::zeros(0, 0), left: want_left.then(|| Mat::zeros(0, 0)) });
    }
    let balanced = Balanced::new(a);
    let (mut re, mut im) = (Diag::<f64>::zeros(n), Diag::<f64>::zeros(n));
    let mut right = Mat::<f64>::zeros(n, n);
    let mut left = want_left.then(|| Mat::<f64>::zeros(n, n));
    let wanted = if want_left { ComputeEigenvectors::Yes } else { ComputeEigenvectors::No };
    let scratch = evd_scratch::<f64>(n, wanted, ComputeEigenvectors::Yes, Par::Seq, Default::default());
    evd_real(
        balanced.matrix.as_ref(),
        re.as_mut(),
        im.as_mut(),
        left.as_mut().map(|u| u.as_mut()),
        Some(right.as_mut()),
        Par::Seq,
        MemStack::new(&mut MemBuffer::new(scratch)),
        Default::default(),
    )
    .map_err(|_| no_convergence("general", n))?;
    let columns = upper_half(&im, n);
    let s = columns.iter().map(|&j| C::new(re[j], im[j].abs())).collect();
    let right = unpack(&right, &im, &columns, 1.0, |i| balanced.right(i));
    // faer's left vectors satisfy u^H a = s u^H; ours are transposed, not conjugated
    let left = left.map(|u| unpack(&u, &im, &columns, -1.0, |i| balanced.left(i)));
    Ok(Roots { s, right, left })
}

fn upper_half(im: &Diag<f64>, n: usize) -> Vec<usize> {
    let (mut j, mut columns) = (0, Vec::with_capacity(n));
    while j < n {
        columns.push(j);
        j += if im[j] == 0.0 { 1 } else { 2 };
    }
    columns
}

/// Complex vectors from packed (re, im) columns, out of the balanced coordinates.
fn unpack(
    packed: &Mat<f64>,
    im: &Diag<f64>,
    columns: &[usize],
    sign: f64,
    place: impl Fn(usize) -> (usize, f64),
) -> Mat<C> {
    let n = packed.nrows();
    let mut x = Mat::zeros(n, columns.len());
    for (k, &j) in columns.iter().enumerate() {
        for i in 0..n {
            let (row, scale) = place(i);
            let imaginary = if im[j] == 0.0 { 0.0 } else { sign * im[j].signum() * packed[(i, j + 1)] };
            x[(row, k)] = C::new(packed[(i, j)], imaginary) * scale;
        }
    }
    x
}

fn no_convergence(kind: &str, n: usize) -> Error {
    Error::Convergence {
        message: format!("the {kind} eigensolver did not converge (size {n}); scale the model or use the sparse route"),
        best: Vec::new(),
        residual: f64::NAN,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_vectors_satisfy_their_equation() {
        let a = Mat::from_fn(7, 7, |i, j| ((3 * i + 5 * j + i * j) as f64).sin() * 10f64.powi(i as i32 - j as i32));
        let roots = general(&a, true).unwrap();
        let left = roots.left.unwrap();
        let pairs = roots.s.iter().filter(|s| s.im > 0.0).count();
        assert_eq!(roots.s.len() + pairs, 7);
        assert!(pairs > 0);
        for (k, &s) in roots.s.iter().enumerate() {
            let (mut worst, mut scale) = (0.0f64, 0.0f64);
            for i in 0..7 {
                let ax: C = (0..7).map(|j| roots.right[(j, k)] * a[(i, j)]).sum();
                worst = worst.max((ax - s * roots.right[(i, k)]).norm() * 10f64.powi(-(i as i32)));
                scale = scale.max(roots.right[(i, k)].norm() * 10f64.powi(-(i as i32)));
            }
            assert!(worst < 1e-12 * scale, "right {k}: {worst}");
            let (mut worst, mut scale) = (0.0f64, 0.0f64);
            for j in 0..7 {
                let ya: C = (0..7).map(|i| left[(i, k)] * a[(i, j)]).sum();
                worst = worst.max((ya - s * left[(j, k)]).norm() * 10f64.powi(j as i32));
                scale = scale.max(left[(j, k)].norm() * 10f64.powi(j as i32));
            }
            assert!(worst < 1e-12 * scale, "left {k}: {worst} of {scale}");
        }
    }
}
