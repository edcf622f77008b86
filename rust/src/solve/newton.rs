//! Newton's method with the natural monotonicity test of P. Deuflhard (Newton Methods for Nonlinear Problems, Springer 2004,
//! section 3.2): steps are judged by J^-1 R, which does not depend on how equations or unknowns are scaled.
use faer::Mat;
use faer::prelude::*;

use super::{Curve, Linearisation, nan_or_largest};
use crate::error::Result;
use crate::run::Cancel;
use crate::tolerances::roots::FELT;

#[derive(Debug, Clone, Copy)]
pub struct Options {
    /// A full step below this, relative to the scale of the unknowns, ends the iteration.
    pub tolerance: f64,
    pub max_iterations: usize,
}

#[derive(Debug, Clone)]
pub struct Outcome {
    pub converged: bool,
    pub iterations: usize,
    /// last step relative to the scale of the unknowns
    pub step: f64,
    pub reason: &'static str,
}

/// Solves R(y, p) = 0 for y at fixed p; `out` ends as the linearisation one step before the returned y.
pub fn solve(
    curve: &mut dyn Curve,
    y: &mut [f64],
    parameter: f64,
    options: Options,
    out: &mut Linearisation,
    cancel: &Cancel,
) -> Result<Outcome> {
    let n = curve.size();
    let mut scale = vec![1.0; n];
    let mut trial = y.to_vec();
    let mut damping = 1.0;
    let mut step_size = f64::INFINITY;
    curve.linearise(y, parameter, out)?;
    for iterations in 1..=options.max_iterations {
        cancel.check()?;
        if !out.is_finite() {
            return Ok(gave_up(iterations, step_size, "the residual is not finite"));
        }
        let lu = out.jacobian.partial_piv_lu();
        let step = negative_solution(&lu, &out.residual);
        if !step.iter().all(|x| x.is_finite()) {
            return Ok(gave_up(iterations, step_size, "the Jacobian is singular"));
        }
        for i in 0..n {
            trial[i] = y[i] + step[i];
        }
        curve.scale(&trial, &mut scale);
        step_size = relative(&step, &scale);
        if step_size <= options.tolerance && curve.row_excess(&trial, parameter, options.tolerance)? <= 1.0 {
            y.copy_from_slice(&trial);
            return Ok(Outcome { converged: true, iterations, step: step_size, reason: "converged" });
        }
        damping = f64::min(1.0, 4.0 * damping);
        loop {
            for i in 0..n {
                trial[i] = y[i] + damping * step[i];
            }
            curve.linearise(&trial, parameter, out)?;
            if out.is_finite() {
                let next = relative(&negative_solution(&lu, &out.residual), &scale);
                if next <= (1.0 - 0.25 * damping) * step_size || next <= options.tolerance {
                    break;
                }
            }
            damping *= 0.5;
            if damping < f64::EPSILON.sqrt() {
                // what an ill-conditioned Jacobian may keep above the tolerance
                if step_size <= FELT && curve.row_excess(y, parameter, options.tolerance)? <= 1.0 {
                    return Ok(Outcome { converged: true, iterations, step: step_size, reason: "rounding" });
                }
                return Ok(gave_up(iterations, step_size, "no step reduces the residual"));
            }
        }
        y.copy_from_slice(&trial);
    }
    Ok(gave_up(options.max_iterations, step_size, "the iteration limit was reached"))
}

fn gave_up(iterations: usize, step: f64, reason: &'static str) -> Outcome {
    Outcome { converged: false, iterations, step, reason }
}

fn negative_solution(lu: &faer::linalg::solvers::PartialPivLu<f64>, r: &[f64]) -> Vec<f64> {
    let mut x = Mat::from_fn(r.len(), 1, |i, _| -r[i]);
    lu.solve_in_place(&mut x);
    (0..r.len()).map(|i| x[(i, 0)]).collect()
}

/// Largest |x_i| / scale_i.
pub fn relative(x: &[f64], scale: &[f64]) -> f64 {
    nan_or_largest(x.iter().zip(scale).map(|(x, s)| (x / s).abs()))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// atan(y) = p: plain Newton diverges from |y| > 1.392.
    struct Atan;

    impl Curve for Atan {
        fn size(&self) -> usize {
            1
        }

        fn linearise(&mut self, y: &[f64], p: f64, out: &mut Linearisation) -> Result<()> {
            out.jacobian[(0, 0)] = 1.0 / (1.0 + y[0] * y[0]);
            out.residual[0] = y[0].atan() - p;
            Ok(())
        }

        fn scale(&self, y: &[f64], out: &mut [f64]) {
            out[0] = y[0].abs().max(1e-3);
        }

        fn row_excess(&mut self, y: &[f64], p: f64, tolerance: f64) -> Result<f64> {
            Ok((y[0].atan() - p).abs() / (tolerance * (y[0].atan().abs() + p.abs())))
        }
    }

    #[test]
    fn damping_makes_atan_converge() {
        let options = Options { tolerance: 1e-12, max_iterations: 40 };
        let mut out = Linearisation::new(1);
        for (start, p) in [(0.0, 0.3), (10.0, 0.3), (-50.0, 1.2)] {
            let mut y = [start];
            let outcome = solve(&mut Atan, &mut y, p, options, &mut out, &Cancel::default()).unwrap();
            assert!(outcome.converged && (y[0] - p.tan()).abs() < 1e-12, "{outcome:?} {y:?}");
        }
        let mut y = [0.0];
        let outcome = solve(&mut Atan, &mut y, 2.0, options, &mut out, &Cancel::default()).unwrap();
        assert!(!outcome.converged);
    }
}
