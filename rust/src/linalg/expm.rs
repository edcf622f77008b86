//! Matrix exponential and the phi functions phi_k(A) = sum_j A^j / (j + k)!, with derivatives along directions dA.
//!
//! Scaling and squaring with diagonal Pade approximants: N. J. Higham, The scaling and squaring method for the matrix exponential
//! revisited, SIAM J. Matrix Anal. Appl. 26(4), 2005 (degrees 3, 5, 7, 9, 13 and their bounds theta of table 2.3). The derivative
//! of the approximant is that of the exponential (Al-Mohy and Higham, SIAM J. Matrix Anal. Appl. 30(4), 2009), so the same text
//! runs on matrices and on jets.
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

/// What the approximant needs: sums, products, and a quotient.
trait Algebra: Sized {
    /// Share of the bounds theta that holds for all parts.
    const SAFETY: f64;
    fn norm_1(&self) -> f64;
    fn times(&self, other: &Self) -> Self;
    /// sum of c x plus a multiple of the identity
    fn combination(terms: &[(f64, &Self)], identity: f64) -> Self;
    /// (even - odd)^-1 (even + odd)
    fn quotient(even: &Self, odd: &Self) -> Self;
    fn is_finite(&self) -> bool;
}

impl Algebra for Mat<f64> {
    const SAFETY: f64 = 1.0;

    fn norm_1(&self) -> f64 {
        (0..self.ncols()).map(|j| self.col(j).norm_l1()).fold(0.0, f64::max)
    }

    fn times(&self, other: &Self) -> Self {
        self * other
    }

    fn combination(terms: &[(f64, &Self)], identity: f64) -> Self {
        let n = terms.first().map_or(0, |t| t.1.nrows());
        Mat::from_fn(n, n, |i, j| {
            let sum: f64 = terms.iter().map(|(c, x)| c * x[(i, j)]).sum();
            sum + if i == j { identity } else { 0.0 }
        })
    }

    fn quotient(even: &Self, odd: &Self) -> Self {
        (even - odd).partial_piv_lu().solve(even + odd)
    }

    fn is_finite(&self) -> bool {
        super::quadratic::is_finite(self.as_ref())
    }
}

/// A matrix and its derivatives along some directions.
#[derive(Debug, Clone)]
pub struct Jet {
    pub value: Mat<f64>,
    pub along: Vec<Mat<f64>>,
}

impl Algebra for Jet {
    // table 6.1 of Al-Mohy and Higham 2009 has bounds for the derivative that are .73 to .88 of theta
    const SAFETY: f64 = 0.7;

    fn norm_1(&self) -> f64 {
        self.value.norm_1()
    }

    fn times(&self, other: &Self) -> Self {
        let product = |(da, db): (&Mat<f64>, &Mat<f64>)| da * &other.value + &self.value * db;
        Jet { value: &self.value * &other.value, along: self.along.iter().zip(&other.along).map(product).collect() }
    }

    fn combination(terms: &[(f64, &Self)], identity: f64) -> Self {
        let values: Vec<_> = terms.iter().map(|(c, x)| (*c, &x.value)).collect();
        let directions = terms.first().map_or(0, |t| t.1.along.len());
        let along = |p: usize| {
            let parts: Vec<_> = terms.iter().map(|(c, x)| (*c, &x.along[p])).collect();
            Mat::combination(&parts, 0.0)
        };
        Jet { value: Mat::combination(&values, identity), along: (0..directions).map(along).collect() }
    }

    fn quotient(even: &Self, odd: &Self) -> Self {
        let lu = (&even.value - &odd.value).partial_piv_lu();
        let value = lu.solve(&even.value + &odd.value);
        let derivative = |(de, d_odd): (&Mat<f64>, &Mat<f64>)| {
            let rhs = de + d_odd - (de - d_odd) * &value;
            lu.solve(rhs)
        };
        let along = even.along.iter().zip(&odd.along).map(derivative).collect();
        Jet { value, along }
    }

    fn is_finite(&self) -> bool {
        self.value.is_finite() && self.along.iter().all(Algebra::is_finite)
    }
}

/// Coefficients of the numerator of the [m/m] approximant: (2m - j)! m! / ((2m)! (m - j)! j!), scaled to b_m = 1.
fn coefficients(m: usize) -> Vec<f64> {
    let mut b = vec![1.0; m + 1];
    for j in (0..m).rev() {
        // b_j / b_{j+1} = (2m - j) (j + 1) / (m - j)
        b[j] = b[j + 1] * ((2 * m - j) * (j + 1)) as f64 / (m - j) as f64;
    }
    b
}

fn exponential<T: Algebra>(a: &T) -> Result<T> {
    let norm = a.norm_1();
    if !norm.is_finite() {
        return Err(Error::model("the exponential of a matrix with NaN or infinite entries"));
    }
    let small = THETA.iter().find(|(_, theta)| norm <= T::SAFETY * theta);
    let (m, squarings) = match small {
        Some((m, _)) => (*m, 0.0),
        None => (13, (norm / (T::SAFETY * THETA_13)).log2().ceil().max(0.0)),
    };
    if squarings > 200.0 {
        return Err(Error::model(format!(
            "a time step is {norm:.1e} times longer than the fastest motion; use shorter steps"
        )));
    }
    let mut e = if squarings > 0.0 { pade(&T::combination(&[((-squarings).exp2(), a)], 0.0), m) } else { pade(a, m) };
    for _ in 0..squarings as usize {
        e = e.times(&e);
    }
    if e.is_finite() {
        Ok(e)
    } else {
        Err(Error::singular("the matrix exponential overflowed: an unstable motion over a step that is far too long"))
    }
}

fn pade<T: Algebra>(a: &T, m: usize) -> T {
    let b = coefficients(m);
    let a2 = a.times(a);
    if m == 13 {
        let a4 = a2.times(&a2);
        let a6 = a4.times(&a2);
        let part = |c: [f64; 3], identity: f64| T::combination(&[(c[0], &a6), (c[1], &a4), (c[2], &a2)], identity);
        let inner = part([b[13], b[11], b[9]], 0.0);
        let odd = T::combination(&[(1.0, &a6.times(&inner)), (1.0, &part([b[7], b[5], b[3]], b[1]))], 0.0);
        let inner = part([b[12], b[10], b[8]], 0.0);
        let even = T::combination(&[(1.0, &a6.times(&inner)), (1.0, &part([b[6], b[4], b[2]], b[0]))], 0.0);
        return T::quotient(&even, &a.times(&odd));
    }
    let mut powers = vec![a2];
    while powers.len() < m / 2 {
        powers.push(powers[powers.len() - 1].times(&powers[0]));
    }
    let terms =
        |first: usize| -> Vec<(f64, &T)> { powers.iter().enumerate().map(|(k, p)| (b[2 * k + first], p)).collect() };
    let odd = T::combination(&terms(3), b[1]);
    let even = T::combination(&terms(2), b[0]);
    T::quotient(&even, &a.times(&odd))
}

/// exp(A) and phi_k(A) B, k = 1..3, from one exponential of [[A, B, 0], [0, 0, 1], [0, 0, 0]]
/// (Al-Mohy and Higham, SIAM J. Sci. Comput. 33(2), 2011, theorem 2.1).
pub fn phi_products(a: MatRef<'_, f64>, b: MatRef<'_, f64>) -> Result<(Mat<f64>, [Mat<f64>; 3])> {
    let (n, w) = (a.nrows(), b.ncols());
    let scale = input_scale(a, b);
    let e = exponential(&augmented(a, b, scale, 1.0))?;
    Ok(split(&e, n, w, scale))
}

/// As `phi_products`, with the derivatives of all four along directions (dA, dB).
#[allow(clippy::type_complexity)]
pub fn phi_derivatives(
    a: MatRef<'_, f64>,
    b: MatRef<'_, f64>,
    directions: &[(Mat<f64>, Mat<f64>)],
) -> Result<((Mat<f64>, [Mat<f64>; 3]), Vec<(Mat<f64>, [Mat<f64>; 3])>)> {
    let (n, w) = (a.nrows(), b.ncols());
    let scale = input_scale(a, b);
    let along = directions.iter().map(|(da, db)| augmented(da.as_ref(), db.as_ref(), scale, 0.0));
    let jet = Jet { value: augmented(a, b, scale, 1.0), along: along.collect() };
    let e = exponential(&jet)?;
    let derivatives = e.along.iter().map(|d| split(d, n, w, scale)).collect();
    Ok((split(&e.value, n, w, scale), derivatives))
}

/// A power of two that brings B down to the size of A, so that it does not add squarings.
fn input_scale(a: MatRef<'_, f64>, b: MatRef<'_, f64>) -> f64 {
    let (a, b) = (a.to_owned().norm_1().max(1.0), b.to_owned().norm_1().max(f64::MIN_POSITIVE));
    (a / b).log2().floor().clamp(-900.0, 0.0).exp2()
}

fn augmented(a: MatRef<'_, f64>, b: MatRef<'_, f64>, scale: f64, identity: f64) -> Mat<f64> {
    let (n, w) = (a.nrows(), b.ncols());
    let size = n + 3 * w;
    Mat::from_fn(size, size, |i, j| {
        if i < n && j < n {
            a[(i, j)]
        } else if i < n && j < n + w {
            b[(i, j - n)] * scale
        } else if i >= n && j == i + w {
            identity
        } else {
            0.0
        }
    })
}

fn split(e: &Mat<f64>, n: usize, w: usize, scale: f64) -> (Mat<f64>, [Mat<f64>; 3]) {
    let phi = std::array::from_fn(|k| Mat::from_fn(n, w, |i, j| e[(i, n + k * w + j)] / scale));
    (e.submatrix(0, 0, n, n).to_owned(), phi)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rotation_and_its_phi_functions() {
        for angle in [1e-3_f64, 0.2, 0.8, 1.9, 30.0] {
            let a = Mat::from_fn(2, 2, |i, j| [[0.0, angle], [-angle, 0.0]][i][j]);
            let one = Mat::<f64>::identity(2, 2);
            let (e, [p1, p2, _]) = phi_products(a.as_ref(), one.as_ref()).unwrap();
            assert!((e[(0, 0)] - angle.cos()).abs() < 1e-13);
            assert!((e[(0, 1)] - angle.sin()).abs() < 1e-13);
            // phi_1 = A^-1 (e^A - 1)
            assert!((p1[(0, 0)] - angle.sin() / angle).abs() < 1e-13);
            let versine = 2.0 * (0.5 * angle).sin().powi(2);
            assert!((p2[(0, 0)] - versine / (angle * angle)).abs() < 1e-13);
        }
    }

    #[test]
    fn large_inputs_change_nothing() {
        let a = Mat::from_fn(3, 3, |i, j| ((2 * i + 5 * j) as f64).sin());
        let b = Mat::from_fn(3, 2, |i, j| ((i + j) as f64 + 0.5).cos());
        let (_, small) = phi_products(a.as_ref(), b.as_ref()).unwrap();
        let (_, large) = phi_products(a.as_ref(), (faer::Scale(1e9) * &b).as_ref()).unwrap();
        for (p, q) in small.iter().zip(&large) {
            let expected = faer::Scale(1e9) * p;
            assert!((&expected - q).norm_l2() < 1e-13 * expected.norm_l2());
        }
    }

    #[test]
    fn derivative_of_a_rotation_by_its_angle() {
        for angle in [0.01_f64, 0.5, 1.4, 3.0, 40.0] {
            let da = Mat::from_fn(2, 2, |i, j| [[0.0, 1.0], [-1.0, 0.0]][i][j]);
            let a = faer::Scale(angle) * &da;
            let b = Mat::<f64>::zeros(2, 1);
            let (_, along) = phi_derivatives(a.as_ref(), b.as_ref(), &[(da, b.clone())]).unwrap();
            assert!((along[0].0[(0, 0)] + angle.sin()).abs() < 1e-13);
            assert!((along[0].0[(0, 1)] - angle.cos()).abs() < 1e-13);
        }
    }
}
