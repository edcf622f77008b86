//! The equations of a step, solved by inverse quasi-Newton updates whose inverse goes on from step to step.
//!
//! H is formed from differences at the start and where the iteration does not converge any more; where that does not help either,
//! or after two failures of inverse BFGS, Broyden's update takes over.
use crate::error::{Error, Result};
use crate::solve::Residual;
use crate::solve::differences;
use crate::solve::inverse::{Family, Guard, Inverse};
use crate::solve::inverse_bfgs::{Options, Outcome, Start, Status, solve};
use crate::solve::line_search::Rule;

use super::equations::BdfStep;
use crate::tolerances::steps::{CLOSED, FIXED_SOLVED, NOISE_SHARE, ROW_ROUNDING, SHARE_OF_TOLERANCE};

/// Least cosine between y and s for an update: where BFGS meets a nonsymmetric or indefinite Jacobian, smaller ones ruin H.
const CURVATURE: f64 = 0.1;
/// A norm that is taken where the iteration stops short of the goal, over the goal.
const NEAR: f64 = 30.0;
const MAX_ITERATIONS: usize = 40;
const PATIENCE: usize = 4;
/// Failures of inverse BFGS after which Broyden's update stays.
const STRIKES: u32 = 2;
/// How much of the slowest iteration a step remembers of the step before.
const FADING: f64 = 0.8;

pub struct StepSolver {
    family: Family,
    /// whether the update may become Broyden's for good
    settles: bool,
    /// steps at which inverse BFGS failed
    strikes: u32,
    solved: f64,
    kept: Option<Kept>,
    /// norm that a fresh inverse could not get below: rounding
    floor: f64,
    /// the largest part of the norm that an iteration behind the first one left, fading from step to step
    left: Option<f64>,
    /// norm of the equations of the last step that was solved
    pub reached: f64,
}

/// An inverse and the factors of the equations it belongs to.
struct Kept {
    inverse: Inverse,
    row_factor: Vec<f64>,
    g: f64,
}

impl StepSolver {
    /// Without a family inverse BFGS runs until it has failed twice, Broyden's update from there on.
    pub fn new(family: Option<Family>, rtol: Option<f64>) -> Self {
        StepSolver {
            solved: rtol.map_or(CLOSED, |r| (SHARE_OF_TOLERANCE * r).min(FIXED_SOLVED)),
            family: family.unwrap_or(Family::Bfgs),
            settles: family.is_none(),
            strikes: 0,
            kept: None,
            floor: 0.0,
            left: None,
            reached: 0.0,
        }
    }

    /// What became of the update, where that was left open.
    pub fn remark(&self) -> Option<String> {
        (self.settles && self.family == Family::Broyden)
            .then(|| "inverse BFGS failed twice, Broyden's update took over (the Jacobian is not symmetric)".into())
    }

    /// H and factors of the equations from a difference Jacobian at x.
    fn form_inverse(&mut self, step: &mut BdfStep<'_, '_>, x: &[f64], relative: f64) -> Result<()> {
        step.row_factor.fill(1.0);
        let mut f = vec![0.0; x.len()];
        step.residual(x, &mut f)?;
        let mut evaluations = 0;
        let mut j = differences::dense(step, x, &f, relative, &mut evaluations)?;
        step.counts.add("inverse formations", 1);
        for (r, factor) in step.row_factor.iter_mut().enumerate() {
            let largest = (0..x.len()).fold(0.0_f64, |a, c| a.max(j[(r, c)].abs()));
            *factor = if largest > 0.0 && largest.is_finite() { 1.0 / largest } else { 1.0 };
            (0..x.len()).for_each(|c| j[(r, c)] *= *factor);
        }
        let inverse = Inverse::of(&j).or_else(|| Inverse::regularised(&j)).ok_or_else(|| lost(step.t))?;
        self.kept = Some(Kept { inverse, row_factor: step.row_factor.clone(), g: step.g });
        Ok(())
    }

    /// The norm to reach, a part of the motion within the step, and what passes short of it. For fixed steps a share of what they err is as
    /// good: no less is asked for.
    fn tolerance(&self, step: &BdfStep<'_, '_>) -> (f64, f64) {
        let moved = step.moved.iter().zip(&step.sizes.sigma);
        let size = moved.fold(0.0_f64, |a, (v, s)| a.max((v / s).abs()));
        // rounding of increments shows itself, where a fresh inverse gets no lower
        let floor = if step.sizes.kept.is_empty() { 0.0 } else { ROW_ROUNDING };
        let (own, share) = ((self.solved * size).clamp(floor, FIXED_SOLVED), NOISE_SHARE * step.rate_error);
        let goal = own.max(share.min(FIXED_SOLVED));
        (goal, goal.max(NEAR * own))
    }

    /// The equations of a step: with the H there is, with a new one, with a new one and Broyden's update.
    pub fn solve(&mut self, step: &mut BdfStep<'_, '_>, n: usize) -> Result<Vec<f64>> {
        // far from the length it was made for an inverse is worth less than a new one
        if self.kept.as_ref().is_some_and(|k| !(0.5..=2.0).contains(&(step.g / k.g))) {
            self.kept = None;
        }
        let goal = (n as f64).sqrt();
        let (solved, near) = self.tolerance(step);
        let (solved, near) = (goal * solved, goal * near);
        let mut x = vec![0.0; n];
        let mut last = f64::INFINITY;
        for attempt in 0..3 {
            if attempt > 0 || self.kept.is_none() {
                self.form_inverse(step, &x, f64::EPSILON.sqrt())?;
            }
            let before = self.family;
            let family = self.family_of(attempt);
            if attempt > 0 && family != before {
                step.counts.add("fallback steps", 1);
            }
            let out = self.attempt(step, &x, family, solved)?;
            last = out.reached;
            // short of the goal only what a fresh inverse could not better either
            if last <= f64::max(near, 2.0 * self.floor) || attempt == 2 && last <= FIXED_SOLVED * goal {
                if attempt == 2 {
                    self.floor = last;
                }
                if last > solved {
                    step.counts.add("steps at rounding", 1);
                }
                self.reached = last;
                return Ok(out.x);
            }
            if last.is_finite() {
                x = out.x;
            }
        }
        self.kept = None;
        Err(Error::Convergence {
            message: format!("the equations of the step to t = {:.9} s did not converge without a Jacobian", step.t),
            best: Vec::new(),
            residual: last,
        })
    }

    /// A second failure with one update calls for the other; where the update may settle, the first does.
    fn family_of(&mut self, attempt: usize) -> Family {
        if attempt == 1 && self.settles && self.family == Family::Bfgs {
            self.strikes += 1;
        }
        if self.strikes >= STRIKES {
            self.family = Family::Broyden;
        }
        match attempt {
            0 => self.family,
            1 if !self.settles => self.family,
            _ => Family::Broyden,
        }
    }

    fn attempt(&mut self, step: &mut BdfStep<'_, '_>, x: &[f64], family: Family, tolerance: f64) -> Result<Outcome> {
        let kept = self.kept.take();
        let (mut inverse, g) = match kept {
            Some(kept) => {
                step.row_factor = kept.row_factor;
                (Some(kept.inverse), kept.g)
            }
            None => (None, step.g),
        };
        let options = Options {
            family,
            tolerance,
            max_iterations: MAX_ITERATIONS,
            max_evaluations: u64::MAX,
            rule: Rule { max_backtracks: 12, ..Rule::default() },
            // an update that changes the determinant by more leaves no digits
            guard: Guard { curvature: CURVATURE, determinant: (f64::EPSILON, f64::EPSILON.recip()) },
            start: Start::Identity,
            memory: None,
            difference: f64::EPSILON.sqrt(),
            left: self.left,
            patience: PATIENCE,
            restarts: 0,
            fallback: false,
        };
        let out = solve(step, x, &options, &mut inverse)?;
        // the first iteration corrects what was foreseen, along what all steps have in common: it falls by more than the next ones
        let left = out.norms.windows(2).skip(1).map(|n| n[1] / n[0]).reduce(f64::max);
        self.left = left.map(|now| now.max(FADING * self.left.unwrap_or(0.0))).or(self.left);
        let counts = &mut *step.counts;
        counts.add("iterations", out.iterations as u64 + u64::from(out.foreseen));
        counts.add("steps not evaluated", u64::from(out.foreseen));
        counts.add("backtracks", out.backtracks as u64);
        counts.add("updates left out", out.skipped as u64);
        if out.status != Status::Broken
            && let Some(inverse) = inverse
        {
            self.kept = Some(Kept { inverse, row_factor: step.row_factor.clone(), g });
        }
        Ok(out)
    }
}

fn lost(t: f64) -> Error {
    Error::Convergence {
        message: format!("a force is no number at t = {t:.9} s"),
        best: Vec::new(),
        residual: f64::NAN,
    }
}
