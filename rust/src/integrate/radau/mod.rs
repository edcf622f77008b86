//! Radau IIA of orders five and nine, an implicit Runge-Kutta method that damps what is infinitely fast.
//!
//! ```text
//! v_i = v0 + h sum_j a_ij a_j,   theta_i = h sum_j a_ij J_l^-1(theta_j) v_j          stages i, at t0 + c_i h; the last is the end
//! M(q_i) a_i + h(q_i, v_i, t_i) + J_i^T lam_i = 0,   J_i a_i + gamma_i = 0,         q_i = q0 exp(theta_i)
//! ```
//! after E. Hairer, G. Wanner, Solving Ordinary Differential Equations II, 2nd edition, Springer 1996, section IV.8, with the
//! constraints at the level of accelerations, where stages have their full order (E. Hairer, C. Lubich, M. Roche, The Numerical
//! Solution of Differential-Algebraic Systems by Runge-Kutta Methods, Springer 1989), and positions and rates projected in the metric
//! of M at the end of each step. The unknowns are a_i and lam_i: theta_i follow from the rates exactly, so that Newton's matrices
//! (`linear`) hold no derivative of a chart. The embedded formula of order s, filtered by the real matrix, gives the estimate e, which
//! falls with h^(s+1); the error of a step falls with h^(2s) and is taken as (10 e)^(2s/(s+1)), as in the code RADAU5. Five stages after
//! E. Hairer, G. Wanner, Stiff differential equations solved by Radau methods, J. Comput. Appl. Math. 111 (1999) 93-111.
mod linear;
mod numbers;
mod outputs;

use nalgebra::DVector;

use crate::error::{Error, Result};
use crate::run::Counts;
use crate::tolerances::constraints::CLOSED_ENOUGH;
use crate::tolerances::motion::{NEWTON_ITERATIONS, ROTATION_REPETITIONS, SAFETY};

use super::explicit8::RecordedStage;
use super::interpolate::quintic;
use super::kept::Parts;
use super::methods::STIFF;
use super::refine::Between;
use super::{Equations, Instant, LocalError, Motion, Scheme, Step, least_motion, scaled_size};
use crate::tolerances::steps::{
    AGED, FEW, FIXED_SOLVED, LEVEL, PATIENCE, RECORDED_ITERATIONS, SHARE_OF_TOLERANCE, SLOW, WORTHWHILE,
};
use linear::{Linear, Stages};
pub use numbers::{FIVE, NINE, Tableau};

/// Stages up to which the polynomial through their slopes is of no higher degree than the one through both ends.
const QUINTIC: usize = 4;

/// A step: its stages and its length.
struct Past {
    t: f64,
    h: f64,
    stages: Stages,
    trial: Trial,
}

pub struct Radau {
    tableau: &'static Tableau,
    fixed: bool,
    /// allowed remainder of Newton's method
    solved: f64,
    linear: Option<Linear>,
    /// how fast the last corrections shrank, and how fast they did with matrices of their own step
    contraction: f64,
    freshest: f64,
    /// iterations of the last step
    iterations: usize,
    past: Option<Past>,
    tried: Option<Past>,
    rejected: bool,
    error: Option<LocalError>,
    /// length and error of the last accepted step, over its tolerance
    before: Option<(f64, f64)>,
    /// largest rate so far, in characteristic lengths or radians per second
    speed: f64,
    /// stages of the last step, where they are asked for
    record: Option<Vec<RecordedStage>>,
    /// of the whole run
    time: f64,
    /// the time below which vibrations are much faster than the motion, in a scene that has such; looked for once
    patience: Option<Option<f64>>,
}

/// The stages where the iteration has arrived.
struct Trial {
    theta: Vec<Vec<f64>>,
    motions: Vec<Motion<f64>>,
}

impl Radau {
    /// Without a tolerance: fixed steps.
    pub fn new(tableau: &'static Tableau, rtol: Option<f64>) -> Self {
        Radau {
            tableau,
            fixed: rtol.is_none(),
            solved: rtol.map_or(FIXED_SOLVED, |r| SHARE_OF_TOLERANCE * r),
            linear: None,
            contraction: 1.0,
            freshest: 0.0,
            iterations: 0,
            past: None,
            tried: None,
            rejected: false,
            error: None,
            before: None,
            speed: 0.0,
            time: f64::INFINITY,
            patience: None,
            record: None,
        }
    }

    /// As far as fixed steps are solved.
    pub fn until_rounding(self) -> Self {
        Radau { solved: self.solved.min(FIXED_SOLVED), ..self }
    }

    /// Keep the stages of each step.
    pub fn recording(self) -> Self {
        Radau { record: Some(Vec::new()), ..self }
    }

    /// The stages of the last step.
    pub fn recorded(&mut self) -> Vec<RecordedStage> {
        self.record.as_mut().map(std::mem::take).unwrap_or_default()
    }

    fn note(&mut self, stages: &Stages, trial: &Trial) {
        if let Some(record) = &mut self.record {
            let stage = |(i, motion): (usize, &Motion<f64>)| {
                let [acceleration, lam] = [&stages.a[i], &stages.lam[i]].map(|v| v.as_slice().to_vec());
                let at = Instant { motion: motion.clone(), acceleration, lam };
                RecordedStage { increment: trial.theta[i].clone(), at }
            };
            *record = trial.motions.iter().enumerate().map(stage).collect();
        }
    }

    /// The polynomial of the last step, or constant accelerations.
    fn guess(&self, from: &Instant, h: f64) -> Stages {
        let s = self.tableau.stages();
        let Some(past) = self.past.as_ref().filter(|p| p.t == from.motion.t) else {
            let constant = |v: &[f64]| vec![DVector::from_column_slice(v); s];
            return Stages { a: constant(&from.acceleration), lam: constant(&from.lam) };
        };
        let ahead = |v: &[DVector<f64>]| {
            let at = |c: &f64| {
                let weights = self.tableau.weights_at(1.0 + c * h / past.h);
                v.iter().zip(weights).fold(DVector::zeros(v[0].len()), |sum, (v, w)| sum + v * w)
            };
            self.tableau.c.iter().map(at).collect()
        };
        Stages { a: ahead(&past.stages.a), lam: ahead(&past.stages.lam) }
    }

    /// h A v of a vector for each stage.
    fn integral(&self, h: f64, v: &[impl AsRef<[f64]>], i: usize) -> Vec<f64> {
        let mut out = vec![0.0; v[0].as_ref().len()];
        for (weight, v) in self.tableau.a[i].iter().zip(v) {
            out.iter_mut().zip(v.as_ref()).for_each(|(o, v)| *o += h * weight * v);
        }
        out
    }

    fn trial(&self, eq: &Equations<'_, f64>, from: &Motion<f64>, h: f64, a: &[DVector<f64>]) -> Trial {
        let s = self.tableau.stages();
        let accelerations: Vec<&[f64]> = a.iter().map(|a| a.as_slice()).collect();
        let rates: Vec<Vec<f64>> = (0..s)
            .map(|i| {
                let dv = self.integral(h, &accelerations, i);
                from.rate.iter().zip(dv).map(|(v, d)| v + d).collect()
            })
            .collect();
        let mut theta: Vec<Vec<f64>> = (0..s).map(|i| self.integral(h, &rates, i)).collect();
        if eq.widest_rotation(&rates[s - 1]) > 0.0 || eq.widest_rotation(&rates[0]) > 0.0 {
            self.settle(eq, h, &rates, &mut theta);
        }
        let motion = |(i, rate): (usize, Vec<f64>)| {
            let mut m = from.moved(eq.topology(), &theta[i]);
            m.t = from.t + self.tableau.c[i] * h;
            m.rate = rate;
            m
        };
        let mut motions: Vec<Motion<f64>> = rates.into_iter().enumerate().map(motion).collect();
        if !eq.stage_states(from, self.tableau.a, h, &mut motions) {
            // no force is known there
            motions.iter_mut().for_each(|m| m.rate.fill(f64::NAN));
        }
        Trial { theta, motions }
    }

    /// theta_i = h sum_j a_ij J_l^-1(theta_j) v_j.
    fn settle(&self, eq: &Equations<'_, f64>, h: f64, rates: &[Vec<f64>], theta: &mut Vec<Vec<f64>>) {
        for _ in 0..ROTATION_REPETITIONS {
            let slopes: Vec<Vec<f64>> = theta.iter().zip(rates).map(|(y, v)| eq.increment_rates(y, v)).collect();
            let next: Vec<Vec<f64>> = (0..theta.len()).map(|i| self.integral(h, &slopes, i)).collect();
            let turns = |(a, b): (&f64, &f64)| (a - b).abs() > 2.0 * f64::EPSILON * a.abs().max(b.abs());
            let settled = !next.iter().flatten().zip(theta.iter().flatten()).any(turns);
            *theta = next;
            if settled {
                return;
            }
        }
    }

    /// What the stages leave over in their equations.
    fn remainder(
        &self,
        eq: &Equations<'_, f64>,
        trial: &Trial,
        stages: &Stages,
        counts: &mut Counts,
    ) -> Result<Stages> {
        let (mut a, mut lam) = (Vec::new(), Vec::new());
        for (i, m) in trial.motions.iter().enumerate() {
            counts.add("force evaluations", 1);
            let placement = eq.place(m);
            let scene = eq.scene(m, &placement, Some(stages.a[i].as_slice()));
            let lams = stages.lam[i].as_slice();
            a.push(scene.residual((!lams.is_empty()).then_some(lams)));
            let rows = eq.constrained();
            lam.push(if rows {
                eq.row_accelerations(m, &placement, stages.a[i].as_slice())
            } else {
                DVector::zeros(lams.len())
            });
            if a[i].iter().chain(lam[i].iter()).any(|v| !v.is_finite()) {
                return Err(failed(format!("a force is not a number at t = {:.9} s", m.t), f64::NAN));
            }
        }
        Ok(Stages { a, lam })
    }

    /// Size of a change of all accelerations: in poses, and in rates over the speed.
    fn size(&self, h: f64, change: &[DVector<f64>], (speed, scales): (f64, &[f64])) -> f64 {
        let s = self.tableau.stages();
        let accelerations: Vec<&[f64]> = change.iter().map(|a| a.as_slice()).collect();
        let rates: Vec<Vec<f64>> = (0..s).map(|i| self.integral(h, &accelerations, i)).collect();
        (0..s).fold(0.0, |size, i| {
            let moved = scaled_size(&self.integral(h, &rates, i), scales);
            size.max(moved).max(scaled_size(&rates[i], scales) / speed)
        })
    }

    fn solve(
        &mut self,
        eq: &Equations<'_, f64>,
        from: &Instant,
        h: f64,
        mut stages: Stages,
        counts: &mut Counts,
    ) -> Result<(Stages, Trial)> {
        let scales = eq.scales();
        let speed = self.speed.max(h * scaled_size(&from.acceleration, &scales)).max(least_motion() / h);
        let (mut last, mut fresh) = (f64::INFINITY, false);
        let most = if self.fixed && self.record.is_some() { RECORDED_ITERATIONS } else { NEWTON_ITERATIONS };
        for iteration in 1..=most {
            counts.add("iterations", 1);
            self.iterations = iteration;
            let trial = self.trial(eq, &from.motion, h, &stages.a);
            // rotation vectors are ambiguous at a whole turn
            if trial.theta.iter().any(|y| eq.widest_rotation(y) >= std::f64::consts::PI) {
                break;
            }
            let left = self.remainder(eq, &trial, &stages, counts)?;
            if self.linear.is_none() {
                let middle = self.tableau.stages() / 2;
                let (m, a, lam) = (&trial.motions[middle], &stages.a[middle], &stages.lam[middle]);
                let m = &eq.with_answering_states(m, h / self.tableau.real.mu);
                self.linear = Some(Linear::new(eq, m, a.as_slice(), lam.as_slice(), counts));
                fresh = true;
            }
            let Some(linear) = &mut self.linear else { break };
            linear.factor(self.tableau, h, counts)?;
            let Some(change) = linear.correction(self.tableau, &left)? else { break };
            for (own, d) in stages.a.iter_mut().zip(&change.a).chain(stages.lam.iter_mut().zip(&change.lam)) {
                *own += d;
            }
            let step = self.size(h, &change.a, (speed, &scales));
            // a first correction says nothing of how fast they shrink
            let rate = if last.is_finite() { step / last } else { self.contraction.max(SLOW) };
            let small = step <= 0.1 * self.solved || rate < 1.0 && step * rate / (1.0 - rate) <= self.solved;
            let near = small && eq.correction_tells(fresh, iteration);
            if last.is_finite() && step > CLOSED_ENOUGH {
                self.contraction = rate;
                if fresh {
                    self.freshest = rate;
                }
            }
            if near || last.is_finite() && fresh && rate > 0.3 && step < CLOSED_ENOUGH {
                let trial = self.trial(eq, &from.motion, h, &stages.a);
                return Ok((stages, trial));
            }
            if last.is_finite() && rate > 2.0 && fresh || !step.is_finite() {
                break;
            }
            let slow = iteration as f64 + expected(step, rate, self.solved) > PATIENCE;
            if last.is_finite() && !fresh && slow && rate > AGED * self.freshest {
                self.linear = None;
            }
            last = step;
        }
        self.linear = None;
        self.contraction = 1.0;
        let t = from.motion.t + h;
        Err(failed(format!("the equations of a step to t = {t:.9} s did not converge"), last))
    }

    /// An undamped vibration that moves less than the tolerance, but not slowly beside the motion, would hold steps at its own period,
    /// where the method does not damp it: its rates are not counted.
    fn patience(&mut self, eq: &Equations<'_, f64>, at: &Instant, counts: &mut Counts) -> Result<Option<f64>> {
        if let Some(known) = self.patience {
            return Ok(known);
        }
        let stiff = eq.is_stiff(at, self.time, counts)?;
        let found = stiff.then(|| 1.0 / (STIFF * eq.pace(at, self.time)));
        self.patience = Some(found);
        Ok(found)
    }

    /// The embedded formula, filtered and brought to the order of the method.
    fn estimate(
        &mut self,
        eq: &Equations<'_, f64>,
        from: &Instant,
        (stages, trial): (&Stages, &Trial),
        speed: f64,
        counts: &mut Counts,
    ) -> Result<LocalError> {
        let mu = self.tableau.real.mu;
        let (mut moved, mut turned) = (from.motion.rate.clone(), from.acceleration.clone());
        for (i, weight) in self.tableau.estimate.iter().enumerate() {
            let slope = eq.increment_rates(&trial.theta[i], &trial.motions[i].rate);
            moved.iter_mut().zip(&slope).for_each(|(m, s)| *m += mu * weight * s);
            turned.iter_mut().zip(stages.a[i].iter()).for_each(|(t, a)| *t += mu * weight * a);
        }
        let patience = self.patience(eq, from, counts)?;
        let filtered = self.linear.as_mut().map(|l| l.filtered(self.tableau, (&moved, &turned), patience, counts));
        let filtered = filtered.transpose()?;
        let (position, rate) = filtered.flatten().unwrap_or((moved, turned));
        let scales = eq.scales();
        let state = self.state_estimate(eq, from, trial);
        let size = scaled_size(&position, &scales).max(scaled_size(&rate, &scales) / speed);
        let size = size.max(scaled_size(&state, &eq.state_scales()));
        let s = self.tableau.stages() as f64;
        let power = 2.0 * s / (s + 1.0);
        let factor = LEVEL.powf(power) * size.powf(power - 1.0);
        let scaled = |v: Vec<f64>| v.into_iter().map(|e| e * factor).collect();
        Ok(LocalError { position: scaled(position), rate: scaled(rate), state: scaled(state) })
    }

    fn state_estimate(&self, eq: &Equations<'_, f64>, from: &Instant, trial: &Trial) -> Vec<f64> {
        let mu = self.tableau.real.mu;
        let mut slopes = eq.state_rates(&from.motion);
        if slopes.is_empty() {
            return slopes;
        }
        for (m, weight) in trial.motions.iter().zip(self.tableau.estimate) {
            slopes.iter_mut().zip(eq.state_rates(m)).for_each(|(s, g)| *s += mu * weight * g);
        }
        let h = (trial.motions[0].t - from.motion.t) / self.tableau.c[0];
        eq.filtered_states(&trial.motions[0], &slopes, h / mu)
    }
}

fn failed(message: String, residual: f64) -> Error {
    Error::Convergence { message, best: Vec::new(), residual }
}

/// Iterations until what is left falls below the goal, corrections shrinking as they did.
fn expected(step: f64, rate: f64, goal: f64) -> f64 {
    if rate < 1.0 { ((goal * (1.0 - rate) / step).ln() / rate.ln()).ceil().max(1.0) } else { f64::INFINITY }
}

impl Scheme for Radau {
    fn order(&self) -> u32 {
        self.tableau.order()
    }

    fn power(&self) -> f64 {
        2.0 * self.tableau.stages() as f64
    }

    fn step(
        &mut self,
        eq: &Equations<'_, f64>,
        from: &Instant,
        h: f64,
        estimate: bool,
        counts: &mut Counts,
    ) -> Result<Step> {
        self.rejected = self.tried.take().is_some();
        self.error = None;
        let scales = eq.scales();
        self.speed = self.speed.max(scaled_size(&from.motion.rate, &scales));
        let guess = self.guess(from, h);
        let kept = self.linear.is_some();
        let (stages, trial) = match self.solve(eq, from, h, guess, counts) {
            // before a shorter step: the same one from the instant that it starts from, with matrices of its own
            Err(Error::Convergence { .. }) if kept || self.past.is_some() => {
                self.past = None;
                let guess = self.guess(from, h);
                self.solve(eq, from, h, guess, counts)?
            }
            made => made?,
        };
        self.note(&stages, &trial);
        let Some(reached) = trial.motions.last() else {
            return Err(Error::singular("a method without stages"));
        };
        let before = reached.rate.clone();
        let end = eq.consistent(reached.clone(), counts)?;
        if estimate {
            eq.same_branch(&before, &end, h)?;
            let speed = self.speed.max(scaled_size(&end.motion.rate, &scales)).max(f64::MIN_POSITIVE);
            self.error = Some(self.estimate(eq, from, (&stages, &trial), speed, counts)?);
        }
        self.tried = Some(Past { t: end.motion.t, h, stages, trial });
        Ok(Step { end, error: self.error.clone() })
    }

    fn over(&mut self, time: f64) {
        self.time = time;
    }

    fn parts(&mut self) -> Option<Parts> {
        let stages = self.recorded();
        (!stages.is_empty()).then_some(Parts { stages, history: None })
    }

    fn accept(&mut self, _: &Equations<'_, f64>, _: &Instant, step: &Step, _: f64) {
        // the driver may have rounded the time to an output or the end
        self.past = self.tried.take().map(|p| Past { t: step.end.motion.t, ..p });
        if self.iterations > FEW && self.contraction > (AGED * self.freshest).max(SLOW) {
            self.linear = None;
        }
    }

    /// By the errors of two steps (K. Gustafsson, ACM Transactions on Mathematical Software 20 (1994) 496-517).
    fn proposal(&mut self, size: &dyn Fn(&LocalError) -> f64) -> Option<f64> {
        if self.fixed {
            return None;
        }
        let error = size(&self.error.take()?).max(f64::MIN_POSITIVE);
        let h = self.past.as_ref()?.h;
        let power = 1.0 / self.power();
        let mut factor = SAFETY * error.powf(-power);
        if let Some((h0, error0)) = self.before {
            factor = factor.min(SAFETY * h / h0 * (error0 / (error * error)).powf(power));
        }
        self.before = Some((h, error.max(1e-2)));
        let most = if self.rejected { 1.0 } else { 8.0 };
        let factor = factor.clamp(0.2, most);
        Some(if (1.0..WORTHWHILE).contains(&factor) { 1.0 } else { factor })
    }

    fn between(
        &mut self,
        eq: &Equations<'_, f64>,
        from: &Instant,
        step: &Step,
        h: f64,
        fractions: &[f64],
        _counts: &mut Counts,
    ) -> Result<Vec<Motion<f64>>> {
        if let Some(own) = self.tried.as_ref().filter(|_| self.tableau.stages() > QUINTIC) {
            return Ok(self.through_stages(eq, from, &step.end, (h, &own.trial), fractions));
        }
        let (start, end) = self.end_accelerations(from, step);
        let with = |i: &Instant, acceleration| Instant { acceleration, ..i.clone() };
        Ok(quintic(eq, &with(from, start), &with(&step.end, end), h, fractions))
    }

    fn outputs(
        &mut self,
        eq: &Equations<'_, f64>,
        from: &Instant,
        step: &Step,
        h: f64,
        fractions: &[f64],
        counts: &mut Counts,
    ) -> Result<Vec<Between>> {
        self.outputs_within(eq, from, step, h, fractions, counts)
    }

    fn misfit(&self, h: f64, difference: &[f64], filtered: bool) -> Result<Option<LocalError>> {
        self.misfit_of(h, difference, filtered).map(Some)
    }

    fn reset(&mut self) {
        self.linear = None;
        self.contraction = 1.0;
        self.past = None;
        self.tried = None;
        self.before = None;
    }
}
