//! Solvers for R(y, p) = 0 that know nothing of mechanics.
pub mod bracket;
pub mod continuation;
pub mod corrector;
pub mod differences;
pub mod inverse;
pub mod inverse_bfgs;
pub mod limited_memory;
pub mod line_search;
pub mod newton;
pub mod segment;

use faer::Mat;

use crate::error::Result;

/// R, dR/dy and dR/dp at one point; owned by the caller and used again.
#[derive(Debug, Clone)]
pub struct Linearisation {
    pub residual: Vec<f64>,
    pub jacobian: Mat<f64>,
    pub slope: Vec<f64>,
}

impl Linearisation {
    pub fn new(n: usize) -> Linearisation {
        Linearisation { residual: vec![0.0; n], jacobian: Mat::zeros(n, n), slope: vec![0.0; n] }
    }

    /// For residuals alone.
    pub fn without_jacobian(n: usize) -> Linearisation {
        Linearisation { residual: vec![0.0; n], jacobian: Mat::zeros(0, 0), slope: vec![0.0; n] }
    }

    pub fn is_finite(&self) -> bool {
        self.residual.iter().all(|x| x.is_finite())
    }
}

/// n equations in n unknowns y and one parameter p.
pub trait Curve {
    fn size(&self) -> usize;
    /// Residual, Jacobian and slope by the parameter.
    fn linearise(&mut self, y: &[f64], parameter: f64, out: &mut Linearisation) -> Result<()>;
    /// Sizes of the unknowns, all positive: what steps are measured against.
    fn scale(&self, y: &[f64], out: &mut [f64]);
    /// Largest residual of a row, evaluated afresh at this point, over what the tolerance of a step and rounding allow in that row;
    /// a solution has at most 1. Nan where the residual is not a number.
    fn row_excess(&mut self, y: &[f64], parameter: f64, tolerance: f64) -> Result<f64>;
}

/// The largest value, or nan where there is one: `f64::max` would drop it.
pub fn nan_or_largest(values: impl Iterator<Item = f64>) -> f64 {
    values.fold(0.0, |a, b| if a.is_nan() || b <= a { a } else { b })
}

/// The largest |x_i|, or nan where there is one.
pub fn largest(x: &[f64]) -> f64 {
    nan_or_largest(x.iter().map(|x| x.abs()))
}

/// F(x) = 0 of which only values are known.
pub trait Residual {
    fn residual(&mut self, x: &[f64], out: &mut [f64]) -> Result<()>;

    /// Called with every accepted point; true stops the iteration.
    fn accepted(&mut self, _x: &[f64], _f: &[f64]) -> Result<bool> {
        Ok(false)
    }
}
