//! Cholesky factorisation with complete diagonal pivoting, of matrices that may be singular.
//!
//! N. J. Higham, Accuracy and Stability of Numerical Algorithms, 2nd ed., SIAM 2002, section 10.3.
use faer::{Mat, MatRef};

/// F (rank x n) with A = F^T F up to `floor` times each diagonal entry, rows in the order of their pivots; None where A has a
/// negative direction beyond `floor`. A is scaled by powers of two, so that `floor` refers to a unit diagonal. O(rank n^2).
pub fn factor(a: MatRef<'_, f64>, floor: f64) -> Option<Mat<f64>> {
    let n = a.nrows();
    let d: Vec<f64> = (0..n).map(|i| unit_scale(a[(i, i)])).collect();
    let mut rest = Mat::from_fn(n, n, |i, j| a[(i, j)] * d[i] * d[j]);
    let mut rows: Vec<Vec<f64>> = Vec::with_capacity(n);
    let mut open = vec![true; n];
    for _ in 0..n {
        let pivot =
            (0..n).filter(|&i| open[i]).max_by(|&i, &j| rest[(i, i)].total_cmp(&rest[(j, j)])).unwrap_or_default();
        if rest[(pivot, pivot)] <= floor {
            break;
        }
        let root = rest[(pivot, pivot)].sqrt();
        let row: Vec<f64> = (0..n).map(|j| if open[j] { rest[(pivot, j)] / root } else { 0.0 }).collect();
        open[pivot] = false;
        for j in (0..n).filter(|&j| open[j] && row[j] != 0.0) {
            for (i, rest) in rest.col_mut(j).iter_mut().enumerate() {
                *rest -= row[i] * row[j];
            }
        }
        rows.push((0..n).map(|j| if j == pivot { root } else { row[j] }).collect());
    }
    let rounding = (0..n).all(|j| !open[j] || (0..n).all(|i| !open[i] || rest[(i, j)].abs() <= 4.0 * floor));
    rounding.then(|| Mat::from_fn(rows.len(), n, |i, j| rows[i][j] / d[j]))
}

fn unit_scale(x: f64) -> f64 {
    if x > 0.0 { (-0.5 * x.log2()).round().exp2() } else { 1.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn singular_and_indefinite_matrices_are_told_apart() {
        let w = Mat::from_fn(3, 4, |i, j| ((3 * i + 5 * j + i * j) as f64).sin() * 10f64.powi(3 * i as i32));
        let a = w.transpose() * &w;
        let f = factor(a.as_ref(), 1e-14).unwrap();
        assert_eq!(f.nrows(), 3);
        let back = f.transpose() * &f;
        for j in 0..4 {
            for i in 0..4 {
                assert!((back[(i, j)] - a[(i, j)]).abs() <= 1e-13 * (a[(i, i)] * a[(j, j)]).sqrt());
            }
        }
        let indefinite = faer::mat![[1.0, 2.0], [2.0, 1.0]];
        assert!(factor(indefinite.as_ref(), 1e-14).is_none());
    }
}
