//! The maximum of one harmonic along a branch, d|a - i b|^2/ds = 0, or of the displacement, d max_t |x(t)|/ds = 0.
use super::problem::{Parameter, Problem};
use crate::error::{Error, Result};
use crate::run::Cancel;
use crate::solve::continuation::{Advance, Branch};
use crate::solve::corrector::{Options, Point};

const STEPS: usize = 400;

/// From a solution near it, the point where the amplitude of `term` (0 is the constant one) of a retained coordinate is largest;
/// without a term the largest displacement over the period.
pub fn find(
    problem: &mut Problem,
    y: &[f64],
    coordinate: usize,
    term: Option<usize>,
    options: Options,
    cancel: &Cancel,
) -> Result<Point> {
    problem.parameter = Parameter::Omega(0);
    let (n, p) = (problem.n(), problem.omega[0]);
    let harmonics: Vec<f64> = problem.basis.indices.iter().map(|k| f64::from(k[0])).collect();
    let slope = |point: &Point| -> f64 {
        let part = |c: usize| point.z[c * n + coordinate] * point.tangent[c * n + coordinate];
        match term {
            Some(0) => part(0),
            Some(term) => part(2 * term - 1) + part(2 * term),
            None => {
                let series = |z: &[f64]| -> Vec<f64> { z.iter().skip(coordinate).step_by(n).copied().collect() };
                extremum_slope(&series(point.y()), &series(&point.tangent[..point.y().len()]), &harmonics)
            }
        }
    };
    let lost = |what| Error::Convergence {
        message: format!("the peak was not found: {what}"),
        best: y.to_vec(),
        residual: f64::NAN,
    };
    let start = |problem: &mut Problem, direction: f64| -> Result<Branch> {
        Branch::start(problem, y, p, &Branch::along_parameter(y.len(), direction), options)?
            .ok_or_else(|| lost("no branch passes the start"))
    };
    let mut branch = start(problem, 1.0)?;
    if slope(branch.point()) < 0.0 {
        branch = start(problem, -1.0)?;
    }
    for _ in 0..STEPS {
        let before = slope(branch.point());
        if branch.advance(problem, cancel)? == Advance::Stalled {
            return Err(lost("the branch ends before it"));
        }
        let after = slope(branch.point());
        if let Some(segment) = branch.segment().filter(|_| before > 0.0 && after <= 0.0) {
            let found = segment.zero(problem, &mut branch.work, cancel, (before, after), |_, p, _| Ok(slope(p)))?;
            return found.ok_or_else(|| lost("the corrector failed"));
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
