//! What algorithms need of numbers that may be real or complex.
use std::ops::{Add, Div, Mul, Sub};

use faer::traits::ComplexField;
use faer::{Mat, MatRef, c64};

pub trait Field:
    ComplexField<Real = f64>
    + Copy
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Mul<f64, Output = Self>
    + Div<f64, Output = Self>
{
    fn real(x: f64) -> Self;
    fn wide(self) -> c64;
    fn conjugate(self) -> Self;
    /// From numbers uniform in (-1/2, 1/2).
    fn random(next: impl FnMut() -> f64) -> Self;
    /// Columns that span a vector and, where it is one of a conjugate pair, its conjugate.
    fn columns(vector: &[c64], paired: bool) -> Vec<Vec<Self>>;
    /// basis times coefficients.
    fn combined(basis: MatRef<'_, Self>, coefficients: MatRef<'_, c64>) -> Mat<c64>;
}

impl Field for f64 {
    fn real(x: f64) -> Self {
        x
    }

    fn wide(self) -> c64 {
        c64::new(self, 0.0)
    }

    fn conjugate(self) -> Self {
        self
    }

    fn random(mut next: impl FnMut() -> f64) -> Self {
        next()
    }

    fn columns(vector: &[c64], paired: bool) -> Vec<Vec<Self>> {
        let mut out = vec![vector.iter().map(|z| z.re).collect()];
        if paired {
            out.push(vector.iter().map(|z| z.im).collect());
        }
        out
    }

    fn combined(basis: MatRef<'_, f64>, coefficients: MatRef<'_, c64>) -> Mat<c64> {
        let part = |f: &dyn Fn(c64) -> f64| {
            basis * Mat::from_fn(coefficients.nrows(), coefficients.ncols(), |i, j| f(coefficients[(i, j)]))
        };
        let (re, im) = (part(&|z| z.re), part(&|z| z.im));
        Mat::from_fn(re.nrows(), re.ncols(), |i, j| c64::new(re[(i, j)], im[(i, j)]))
    }
}

impl Field for c64 {
    fn real(x: f64) -> Self {
        c64::new(x, 0.0)
    }

    fn wide(self) -> c64 {
        self
    }

    fn conjugate(self) -> Self {
        self.conj()
    }

    fn random(mut next: impl FnMut() -> f64) -> Self {
        c64::new(next(), next())
    }

    fn columns(vector: &[c64], _paired: bool) -> Vec<Vec<Self>> {
        vec![vector.to_vec()]
    }

    fn combined(basis: MatRef<'_, c64>, coefficients: MatRef<'_, c64>) -> Mat<c64> {
        basis * coefficients
    }
}
