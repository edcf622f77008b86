//! The maximum of one harmonic along a branch, d|a - i b|^2/ds = 0, or of the displacement, d max_t |x(t)|/ds = 0.
use super::problem::{Parameter, Problem};
use crate::error::{Error, Result};
use crate::run::Cancel;
use crate::solve::Linearisation;
use crate::solve::continuation::{Advance, Branch};
use crate::solve::corrector::{Options, Point};

const STEPS: usize = 400;

/// What is largest at the peak: a term (0 is the constant one) of the displacement weights . x, or without a term the largest
/// displacement over the period.
pub struct Quantity {
    pub weights: Vec<f64>,
    pub term: Option<usize>,
}

impl Quantity {
    /// Coefficients of the displacement and how they change along the branch.
    fn series(&self, problem: &mut Problem, point: &Point) -> Result<(Vec<f64>, Vec<f64>)> {
        let here = self.coefficients(problem, &point.z)?;
        let length = point.z.iter().zip(&point.scale).map(|(z, s)| (z / s).powi(2)).sum::<f64>().sqrt();
        let h = f64::EPSILON.cbrt() * length.max(1.0);
        let mut slope = vec![0.0; here.len()];
        // fourth order: what is kept is linear in y and smooth in omega
        for (steps, weight) in [(1.0, 2.0 / 3.0), (2.0, -1.0 / 12.0)] {
            for sign in [1.0, -1.0] {
                let z: Vec<f64> = point.z.iter().zip(&point.tangent).map(|(z, t)| z + sign * steps * h * t).collect();
                let moved = self.coefficients(problem, &z)?;
                slope.iter_mut().zip(&moved).for_each(|(s, c)| *s += sign * weight * c / h);
            }
        }
        problem.omega[0] = point.p();
        Ok((here, slope))
    }

    fn coefficients(&self, problem: &mut Problem, z: &[f64]) -> Result<Vec<f64>> {
        let n = z.len() - 1;
        problem.omega[0] = z[n];
        let all = problem.expand(&z[..n])?;
        let seen: Vec<(usize, f64)> = self.weights.iter().copied().enumerate().filter(|(_, w)| *w != 0.0).collect();
        let sum = |c: usize| -> f64 { seen.iter().map(|&(i, w)| w * all[(i, c)]).sum() };
        Ok((0..all.ncols()).map(sum).collect())
    }

    /// Half the slope of the squared amplitude along the branch, or that of the largest displacement.
    fn slope(&self, problem: &mut Problem, point: &Point) -> Result<f64> {
        let (x, dx) = self.series(problem, point)?;
        let part = |c: usize| x[c] * dx[c];
        Ok(match self.term {
            Some(0) => part(0),
            Some(term) => part(2 * term - 1) + part(2 * term),
            None => {
                let harmonics: Vec<f64> = problem.basis.indices.iter().map(|k| f64::from(k[0])).collect();
                extremum_slope(&x, &dx, &harmonics)
            }
        })
    }
}

/// From a solution near it, the point where the quantity is largest. `towards` is a step along the branch, without which it is
/// taken along the parameter: at a fold there is no branch in that direction.
pub fn find(
    problem: &mut Problem,
    y: &[f64],
    towards: Option<&[f64]>,
    quantity: &Quantity,
    options: Options,
    cancel: &Cancel,
) -> Result<Point> {
    problem.parameter = Parameter::Omega(0);
    let p = problem.omega[0];
    let lost = |what| Error::Convergence {
        message: format!("the peak was not found: {what}"),
        best: y.to_vec(),
        residual: f64::NAN,
    };
    let along = towards.map_or_else(|| Branch::along_parameter(y.len(), 1.0), <[f64]>::to_vec);
    let start = |problem: &mut Problem, sign: f64| -> Result<Branch> {
        let along: Vec<f64> = along.iter().map(|t| sign * t).collect();
        Branch::start(problem, y, p, &along, options)?.ok_or_else(|| lost("no branch passes the start"))
    };
    let mut branch = start(problem, 1.0)?;
    if quantity.slope(problem, branch.point())? < 0.0 {
        branch = start(problem, -1.0)?;
    }
    for _ in 0..STEPS {
        let before = quantity.slope(problem, branch.point())?;
        if branch.advance(problem, cancel)? == Advance::Stalled {
            return Err(lost("the branch ends before it"));
        }
        let after = quantity.slope(problem, branch.point())?;
        if let Some(segment) = branch.segment().filter(|_| before > 0.0 && after <= 0.0) {
            let slope = |problem: &mut Problem, p: &Point, _: &Linearisation| Ok((quantity.slope(problem, p)?, ()));
            let found = segment.zero(problem, &mut branch.work, cancel, (before, after), slope)?;
            return found.map(|(point, ())| point).ok_or_else(|| lost("the corrector failed"));
        }
    }
    Err(lost("the amplitude keeps growing"))
}

/// d max |x(tau)|/ds for the coefficients x and their derivative dx along the branch: dx at the instant of the maximum, since there
/// x does not change with time.
fn extremum_slope(x: &[f64], dx: &[f64], harmonics: &[f64]) -> f64 {
    let value = |c: &[f64], tau: f64, order: i32| -> f64 {
        let constant = if order == 0 { c[0] } else { 0.0 };
        harmonics.iter().enumerate().fold(constant, |sum, (j, h)| {
            // each derivative turns the phase by a quarter
            let phase = h * tau + f64::from(order) * std::f64::consts::FRAC_PI_2;
            sum + h.powi(order) * (c[2 * j + 1] * phase.cos() + c[2 * j + 2] * phase.sin())
        })
    };
    let n_t = 16.0 * harmonics.iter().fold(1.0, |a, b| f64::max(a, *b));
    let instants = (0..n_t as usize).map(|i| std::f64::consts::TAU * i as f64 / n_t);
    let mut tau = instants.max_by(|a, b| value(x, *a, 0).abs().total_cmp(&value(x, *b, 0).abs())).unwrap_or(0.0);
    for _ in 0..6 {
        let step = value(x, tau, 1) / value(x, tau, 2);
        if step.is_finite() && step.abs() < std::f64::consts::TAU / n_t {
            tau -= step;
        }
    }
    value(x, tau, 0).signum() * value(dx, tau, 0)
}
