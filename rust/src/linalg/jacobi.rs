//! Singular values and right singular vectors with high relative accuracy: one-sided Jacobi rotations after a QR factorisation
//! with sorted rows and pivoted columns.
//!
//! Z. Drmac and K. Veselic, New fast and accurate Jacobi SVD algorithm, SIAM J. Matrix Anal. Appl. 29 (2008) 1322-1362. Errors of
//! small singular values are those of the matrix with its rows and columns scaled to one size, not of its norm.
use faer::{Mat, MatRef};

use super::dense::EPS;

const SWEEPS: usize = 40;

/// The `rank` largest singular values of g (any shape) in ascending order and their right singular vectors (n x rank), or None
/// where the sweeps did not converge. O(m n^2) and some sweeps of O(n rank^2).
pub fn right_singular(g: MatRef<'_, f64>, rank: usize) -> Option<(Vec<f64>, Mat<f64>)> {
    let (m, n) = (g.nrows(), g.ncols());
    let size = |i: usize| (0..n).fold(0.0f64, |s, j| s.max(g[(i, j)].abs()));
    let sizes: Vec<f64> = (0..m).map(size).collect();
    let mut order: Vec<usize> = (0..m).collect();
    order.sort_by(|&a, &b| sizes[b].total_cmp(&sizes[a]));
    let sorted = Mat::from_fn(m, n, |i, j| g[(order[i], j)]);
    let qr = sorted.col_piv_qr();
    let r = qr.thin_R();
    let column = qr.P().arrays().0;
    let mut vectors: Vec<Vec<f64>> = (0..rank.min(r.nrows()))
        .map(|i| {
            let mut v = vec![0.0; n];
            (i..n).for_each(|j| v[column[j]] = r[(i, j)]);
            v
        })
        .collect();
    let mut sigma = orthogonalise(&mut vectors)?;
    let mut ascending: Vec<usize> = (0..sigma.len()).collect();
    ascending.sort_by(|&a, &b| sigma[a].total_cmp(&sigma[b]));
    let v = Mat::from_fn(n, ascending.len(), |i, j| vectors[ascending[j]][i] / sigma[ascending[j]]);
    sigma.sort_by(f64::total_cmp);
    Some((sigma, v))
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// Rotates vectors until all are orthogonal to working precision; returns their lengths.
fn orthogonalise(a: &mut [Vec<f64>]) -> Option<Vec<f64>> {
    let tolerance = 0.5 * EPS * (a.first().map_or(1, Vec::len).max(4) as f64).sqrt();
    for _ in 0..SWEEPS {
        let mut still = true;
        for p in 0..a.len() {
            for q in p + 1..a.len() {
                let (head, tail) = a.split_at_mut(q);
                still &= !rotate(&mut head[p], &mut tail[0], tolerance);
            }
        }
        if still {
            let lengths: Vec<f64> = a.iter().map(|v| dot(v, v).sqrt()).collect();
            return lengths.iter().all(|s| s.is_finite() && *s > 0.0).then_some(lengths);
        }
    }
    None
}

/// True where the pair had to be rotated.
fn rotate(p: &mut [f64], q: &mut [f64], tolerance: f64) -> bool {
    let (alpha, beta, gamma) = (dot(p, p), dot(q, q), dot(p, q));
    if gamma.abs() <= tolerance * (alpha.sqrt() * beta.sqrt()) {
        return false;
    }
    let zeta = (beta - alpha) / (2.0 * gamma);
    let t =
        if zeta.is_finite() { 1.0f64.copysign(zeta) / (zeta.abs() + zeta.hypot(1.0)) } else { gamma / (beta - alpha) };
    let c = 1.0 / t.hypot(1.0);
    let s = c * t;
    for (p, q) in p.iter_mut().zip(q) {
        (*p, *q) = (c * *p - s * *q, s * *p + c * *q);
    }
    true
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn small_singular_values_of_graded_columns_keep_their_digits() {
        // orthonormal columns times lengths: these are the singular values, exactly, and the unit vectors belong to them
        let q = [[2.0, -2.0, 1.0], [1.0, 2.0, 2.0], [2.0, 1.0, -2.0]];
        let lengths = [3e-5, 3e-9, 3.0];
        let g = Mat::from_fn(3, 3, |i, j| q[i][j] / 3.0 * lengths[j]);
        let (sigma, v) = right_singular(g.as_ref(), 3).unwrap();
        for (k, column) in [1, 0, 2].into_iter().enumerate() {
            assert!((sigma[k] / lengths[column] - 1.0).abs() < 1e-14);
            assert!((v[(column, k)].abs() - 1.0).abs() < 1e-14);
        }
    }
}
