//! Matrix exponential and the phi functions phi_k(A) = sum_j A^j / (j + k)!.
//!
//! Scaling and squaring with diagonal Pade approximants: N. J. Higham, The scaling and squaring method for the matrix exponential
//! revisited, SIAM J. Matrix Anal. Appl. 26(4), 2005 (degrees 3, 5, 7, 9, 13 and their bounds theta of table 2.3).
use faer::prelude::*;
use faer::{Mat, MatRef};

use crate::error::{Error, Result};

const THETA: [(usize, f64); 4] = [
    (3, 1.495_585_217_958_292e-2),
    (5, 2.539_398_330_063_23e-1),
    (7, 9.504_178_996_162_932e-1),
    (9, 2.097_847_961_257_068),
];
const THETA_13: f64 = 5.371_920_351_148_152;

/// Coefficients of the numerator of the [m/m] approximant: (2m - j)! m! / ((2m)! (m - j)! j!), scaled to b_m = 1.
fn coefficients(m: usize) -> Vec<f64> {
    let mut b = vec![1.0; m + 1];
    for j in (0..m).rev() {
        // b_j / b_{j+1} = (2m - j) (j + 1) / (m - j)
        b[j] = b[j + 1] * ((2 * m - j) * (j + 1)) as f64 / (m - j) as f64;
    }
    b
}

fn norm_1(a: MatRef<'_, f64>) -> f64 {
    (0..a.ncols())
        .map(|j| a.col(j).norm_l1())
        .fold(0.0, f64::max)
}

/// exp(A).
pub fn expm(a: MatRef<'_, f64>) -> Result<Mat<f64>> {
    let n = a.nrows();
    let norm = norm_1(a);
    if !norm.is_finite() {
        return Err(Error::model(
            "the exponential of a matrix with NaN or infinite entries",
        ));
    }
    if let Some((m, _)) = THETA.iter().find(|(_, theta)| norm <= *theta) {
        return pade(a, *m);
    }
    let squarings = (norm / THETA_13).log2().ceil().max(0.0);
    if squarings > 200.0 {
        return Err(Error::model(format!(
            "a time step is {norm:.1e} times longer than the fastest motion; use shorter steps"
        )));
    }
    let shrink = (-squarings).exp2();
    let mut e = pade(Mat::from_fn(n, n, |i, j| a[(i, j)] * shrink).as_ref(), 13)?;
    for _ in 0..squarings as usize {
        e = &e * &e;
    }
    Ok(e)
}

fn pade(a: MatRef<'_, f64>, m: usize) -> Result<Mat<f64>> {
    let n = a.nrows();
    let b = coefficients(m);
    let a2 = a * a;
    let mut powers = vec![Mat::<f64>::identity(n, n), a2.clone()];
    let mut odd = Mat::<f64>::zeros(n, n);
    let mut even = Mat::<f64>::zeros(n, n);
    if m < 13 {
        while powers.len() <= m / 2 {
            let next = powers[powers.len() - 1].as_ref() * a2.as_ref();
            powers.push(next);
        }
        for (k, power) in powers.iter().enumerate() {
            odd += faer::Scale(b[2 * k + 1]) * power;
            even += faer::Scale(b[2 * k]) * power;
        }
    } else {
        let a4 = &a2 * &a2;
        let a6 = &a4 * &a2;
        let sum = |c6: f64, c4: f64, c2: f64| {
            Mat::from_fn(n, n, |i, j| {
                c6 * a6[(i, j)] + c4 * a4[(i, j)] + c2 * a2[(i, j)]
            })
        };
        odd = &a6 * sum(b[13], b[11], b[9]) + sum(b[7], b[5], b[3]);
        even = &a6 * sum(b[12], b[10], b[8]) + sum(b[6], b[4], b[2]);
        for i in 0..n {
            odd[(i, i)] += b[1];
            even[(i, i)] += b[0];
        }
    }
    let u = a * &odd;
    let e = (&even - &u).partial_piv_lu().solve(&even + &u);
    if super::quadratic::is_finite(e.as_ref()) {
        Ok(e)
    } else {
        Err(Error::singular(
            "the matrix exponential overflowed: an unstable motion over a step that is far too long",
        ))
    }
}

/// exp(A), phi_1(A), phi_2(A), phi_3(A) from one exponential of four times the size
/// (Al-Mohy and Higham, SIAM J. Sci. Comput. 33(2), 2011, theorem 2.1).
pub fn phi_functions(a: MatRef<'_, f64>) -> Result<[Mat<f64>; 4]> {
    let n = a.nrows();
    let big = Mat::from_fn(4 * n, 4 * n, |i, j| {
        let (bi, bj, ri, rj) = (i / n, j / n, i % n, j % n);
        if bi == 0 && bj == 0 {
            a[(ri, rj)]
        } else if bj == bi + 1 && ri == rj {
            1.0
        } else {
            0.0
        }
    });
    let e = expm(big.as_ref())?;
    Ok(std::array::from_fn(|k| {
        e.submatrix(0, k * n, n, n).to_owned()
    }))
}

/// exp(A) and phi_k(A) B, k = 1..3: as `phi_functions`, but only as wide as B.
pub fn phi_products(a: MatRef<'_, f64>, b: MatRef<'_, f64>) -> Result<(Mat<f64>, [Mat<f64>; 3])> {
    let (n, w) = (a.nrows(), b.ncols());
    let size = n + 3 * w;
    // B is scaled down to the size of A so that it does not add squarings
    let scale = (norm_1(a).max(1.0) / norm_1(b).max(f64::MIN_POSITIVE))
        .log2()
        .floor()
        .clamp(-900.0, 0.0)
        .exp2();
    let big = Mat::from_fn(size, size, |i, j| {
        if i < n && j < n {
            a[(i, j)]
        } else if i < n && j < n + w {
            b[(i, j - n)] * scale
        } else if i >= n && j == i + w {
            1.0
        } else {
            0.0
        }
    });
    let e = expm(big.as_ref())?;
    let phi = std::array::from_fn(|k| Mat::from_fn(n, w, |i, j| e[(i, n + k * w + j)] / scale));
    Ok((e.submatrix(0, 0, n, n).to_owned(), phi))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rotation_and_its_phi_functions() {
        for angle in [1e-3_f64, 0.2, 0.8, 1.9, 30.0] {
            let a = Mat::from_fn(2, 2, |i, j| [[0.0, angle], [-angle, 0.0]][i][j]);
            let [e, p1, p2, _] = phi_functions(a.as_ref()).unwrap();
            assert!((e[(0, 0)] - angle.cos()).abs() < 1e-13);
            assert!((e[(0, 1)] - angle.sin()).abs() < 1e-13);
            // phi_1 = A^-1 (e^A - 1)
            assert!((p1[(0, 0)] - angle.sin() / angle).abs() < 1e-13);
            let versine = 2.0 * (0.5 * angle).sin().powi(2);
            assert!((p2[(0, 0)] - versine / (angle * angle)).abs() < 1e-13);
        }
    }

    #[test]
    fn products_equal_functions() {
        let a = Mat::from_fn(3, 3, |i, j| ((2 * i + 5 * j) as f64).sin());
        let b = Mat::from_fn(3, 2, |i, j| 1e6 * ((i + j) as f64 + 0.5).cos());
        let [e, p1, p2, p3] = phi_functions(a.as_ref()).unwrap();
        let (e2, q) = phi_products(a.as_ref(), b.as_ref()).unwrap();
        assert!((&e - &e2).norm_l2() < 1e-13 * e.norm_l2());
        for (p, q) in [p1, p2, p3].iter().zip(&q) {
            let expected = p * &b;
            assert!((&expected - q).norm_l2() < 1e-13 * expected.norm_l2());
        }
    }
}
