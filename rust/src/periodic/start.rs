//! The first solution of a problem: from a guess, and if that fails by raising all forces from zero along a branch.
use super::problem::{Parameter, Problem};
use crate::error::Result;
use crate::run::Cancel;
use crate::solve::continuation::{Advance, Branch};
use crate::solve::corrector::{self, Corrector, Predictor};
use crate::solve::newton::{self, Options, Outcome};
use crate::solve::{Curve, Linearisation};
use crate::tolerances::roots::EVENT_SOLVED;

const RAMP_STEPS: usize = 2000;
/// Of the whole force and of the scale of the unknowns.
const LONGEST_RAMP: f64 = 0.2;

/// Solves at the present frequencies and level; y is guess and answer. `ramp_forces`: where the guess leads nowhere they are raised from
/// zero, which takes long where the equations are rough.
pub fn solve(
    problem: &mut Problem,
    y: &mut [f64],
    options: Options,
    ramp_forces: bool,
    cancel: &Cancel,
) -> Result<Outcome> {
    let parameter = problem.parameter;
    problem.parameter = Parameter::Ramp;
    let mut out = Linearisation::new(problem.size());
    let mut guess = y.to_vec();
    let mut outcome = newton::solve(problem, y, 1.0, options, &mut out, cancel)?;
    if !outcome.converged && guess.iter().all(|x| *x == 0.0) && outcome.iterations == 1 {
        // at rest a structure that only its nonlinear elements hold has no stiffness
        let size = stirring(&out);
        for factor in [1.0, 10.0, 0.1] {
            for (i, (x, g)) in y.iter_mut().zip(guess.iter_mut()).enumerate() {
                *g = factor * size * (1.0 + i as f64).cos();
                *x = *g;
            }
            outcome = newton::solve(problem, y, 1.0, options, &mut out, cancel)?;
            if outcome.converged {
                break;
            }
        }
    }
    if !outcome.converged && ramp_forces && problem.broken.is_none() {
        let reached = std::mem::replace(&mut outcome, ramp(problem, y, options, cancel)?);
        if !outcome.converged {
            // the point that Newton's method reached is nearer to what was asked than a ramp that stopped half way
            outcome = reached;
            y.copy_from_slice(&guess);
            newton::solve(problem, y, 1.0, options, &mut out, cancel)?;
        }
    }
    problem.ramp = 1.0;
    problem.parameter = parameter;
    Ok(outcome)
}

/// A displacement of the size that the forces cause in the largest stiffness.
fn stirring(out: &Linearisation) -> f64 {
    let force = out.residual.iter().fold(0.0_f64, |a, b| a.max(b.abs()));
    let stiffness = out.jacobian.norm_max();
    if stiffness > 0.0 && force.is_finite() { force / stiffness } else { 0.0 }
}

fn ramp(problem: &mut Problem, y: &mut [f64], options: Options, cancel: &Cancel) -> Result<Outcome> {
    let stopped =
        |reason| Outcome { converged: false, iterations: options.max_iterations, step: f64::INFINITY, reason };
    let steps = corrector::Options {
        predictor: Predictor::Tangent,
        corrector: Corrector::PseudoArclength,
        tolerance: options.tolerance,
        max_corrections: 10,
        // one that is too long is repeated
        first_step: LONGEST_RAMP,
        least_step: EVENT_SOLVED,
        largest_step: LONGEST_RAMP,
        parameter_scale: 1.0,
    };
    y.fill(0.0);
    // laws may carry a force at rest, which no factor on the loads takes away
    let mut out = Linearisation::new(y.len());
    let rest = newton::solve(problem, y, 0.0, options, &mut out, cancel)?;
    if !rest.converged {
        return Ok(stopped("no solution without forces was found"));
    }
    let Some(mut branch) = Branch::start(problem, y, 0.0, &Branch::along_parameter(y.len(), 1.0), steps)? else {
        return Ok(stopped("no branch starts at zero force"));
    };
    for _ in 0..RAMP_STEPS {
        if branch.advance(problem, cancel)? == Advance::Stalled {
            return Ok(stopped("the force could not be raised further"));
        }
        if branch.point().p() >= 1.0 {
            let Some(point) = branch.land(problem, 1.0)? else {
                return Ok(stopped("the full force was passed but not met"));
            };
            y.copy_from_slice(point.y());
            return newton::solve(problem, y, 1.0, options, &mut out, cancel);
        }
    }
    Ok(stopped("the ramp of the force took too many steps"))
}
