//! Four-step BDF whose equations are solved without any tangent: the derivative-free multibody solver of J. Algorithms & Comput.
//! Technol. (2017), doi 10.1177/1748301817729990.
//!
//! Taylor predictor of second order, corrector of order four with constraints on position and velocity level (`bdf_step`), solved
//! by inverse quasi-Newton updates (`bdf_solver`). Four steps of order eight start it, divided where the scene is too stiff for
//! them (`bdf_history`). Unequal steps use the weights of the polynomial through the actual times.
use nalgebra::DVector;

use crate::error::Result;
use crate::run::Counts;
use crate::solve::inverse::Family;

use super::bdf_history::{GROWTH, History};
use super::bdf_solver::StepSolver;
use super::bdf_step::{BdfStep, Form, Guess, Sizes, derivative_weights, value_weights};
use super::interpolate::quintic;
use super::{Equations, Instant, LocalError, Motion, Scheme, Step};
use crate::linalg::kkt::Kkt;
use crate::linalg::rows::Level as Asked;

const STEPS: usize = 4;
/// Growth of start steps.
const REGROWTH: f64 = 5.0;
/// Leading term of the error over the fifth difference: (1/5)/(25/12).
const LEADING: f64 = 12.0 / 125.0;
/// A fifth difference sums 32 values: what it may show of the norm that the equations of a step are left with.
const UNSOLVED: f64 = 32.0;

pub struct BdfBfgs {
    form: Form,
    solver: StepSolver,
    history: History,
    sizes: Option<Sizes>,
    /// multipliers of the kept rows at the last accepted instant, and of the step that is tried
    lam: Option<(f64, Vec<f64>)>,
    tried: Option<Vec<f64>>,
    /// the step that is tried leaves the history behind
    restarted: bool,
    /// length and parts of the step that is tried, where it is a start step
    started: Option<(f64, usize)>,
    /// length of the last step with the formula
    usual: f64,
}

impl BdfBfgs {
    pub fn new(form: Form, family: Option<Family>, rtol: Option<f64>) -> Self {
        BdfBfgs {
            form,
            solver: StepSolver::new(family, rtol),
            history: History::new(rtol),
            sizes: None,
            lam: None,
            tried: None,
            restarted: false,
            started: None,
            usual: 0.0,
        }
    }

    fn sizes(&mut self, eq: &Equations<'_, f64>, m: &Motion<f64>) -> Sizes {
        let make = || {
            let jacobian = eq.rows(m).1;
            let kept = eq.rows.select_dense(&jacobian, Asked::All);
            Sizes::new(eq, &eq.mass(m), kept)
        };
        self.sizes.get_or_insert_with(make).clone()
    }

    /// Multipliers of the kept rows at an instant.
    fn multipliers(&self, eq: &Equations<'_, f64>, from: &Instant, sizes: &Sizes) -> Result<Vec<f64>> {
        if let Some((t, lam)) = &self.lam
            && *t == from.motion.t
        {
            return Ok(lam.clone());
        }
        if sizes.kept.is_empty() {
            return Ok(Vec::new());
        }
        let jacobian = eq.rows(&from.motion).1;
        let load = jacobian.transpose() * DVector::from_column_slice(&from.lam);
        // M x + J_k^T lam_k = J^T lam with J_k x = 0: x vanishes, the kept rows carry what all carried
        let mass = eq.mass(&from.motion);
        let saddle = Kkt::with_columns(&mass, &jacobian.transpose(), &jacobian, sizes.kept.clone())?;
        let (_, lam) = saddle.solve_one(&load, &DVector::zeros(eq.n_rows()))?;
        Ok(sizes.kept.iter().map(|i| lam[*i]).collect())
    }

    fn corrected(&mut self, eq: &Equations<'_, f64>, from: &Instant, h: f64, counts: &mut Counts) -> Result<Step> {
        let sizes = self.sizes(eq, &from.motion);
        let history = self.history.seen_from(eq, from);
        let t = from.motion.t + h;
        let times: Vec<f64> = history.iter().map(|p| p.t).collect();
        let mut nodes = vec![t];
        nodes.extend(&times[..STEPS]);
        let weights = derivative_weights(&nodes);
        let past = |of: &dyn Fn(usize) -> Vec<f64>| combined(&weights[1..], of, eq.n());
        let states = history[0].state.len();
        let mut state_base = combined(&weights[1..], &|j| history[j].state.clone(), states);
        state_base.iter_mut().for_each(|z| *z /= -weights[0]);
        let (v, a) = (&from.motion.rate, &from.acceleration);
        let guess = Guess {
            theta: (0..eq.n()).map(|i| h * v[i] + 0.5 * h * h * a[i]).collect(),
            rate: (0..eq.n()).map(|i| v[i] + h * a[i]).collect(),
            lam: self.multipliers(eq, from, &sizes)?,
        };
        let n = sizes.unknowns(self.form);
        let mut step = BdfStep {
            eq,
            form: self.form,
            sizes: &sizes,
            base: &from.motion,
            t,
            g: 1.0 / weights[0],
            theta_past: past(&|j| history[j].theta.clone()),
            rate_past: past(&|j| history[j].rate.clone()),
            state_base,
            guess,
            row_factor: vec![1.0; n],
            counts,
        };
        let x = self.solver.solve(&mut step, n)?;
        let at = step.meaning(&x);
        let counts = &mut *step.counts;
        let mut motion = at.motion;
        if self.form == Form::Symmetric && !sizes.kept.is_empty() {
            eq.align(&mut motion, counts)?;
        }
        let error = (history.len() > STEPS).then(|| {
            let ahead = value_weights(&times[..=STEPS], t);
            let miss = |now: &[f64], of: &dyn Fn(usize) -> Vec<f64>, unit: f64| -> Vec<f64> {
                let expected = combined(&ahead, of, eq.n());
                let both = now.iter().zip(expected).zip(&sizes.sigma);
                both.map(|((y, e), s)| LEADING * beyond(y - e, unit * s)).collect()
            };
            // what the equations leave unsolved says nothing about the length of the step
            let unsolved = UNSOLVED * self.solver.reached;
            LocalError {
                position: miss(&at.theta, &|j| history[j].theta.clone(), unsolved),
                rate: miss(&motion.rate, &|j| history[j].rate.clone(), unsolved * weights[0]),
                state: {
                    let expected = combined(&ahead, &|j| history[j].state.clone(), states);
                    eq.states(&motion).iter().zip(expected).map(|(z, e)| LEADING * (z - e)).collect()
                },
            }
        });
        if let Some(e) = &error
            && e.rate.iter().all(|v| *v == 0.0)
        {
            counts.add("steps within rounding", 1);
        }
        self.tried = Some(at.lam);
        let end = eq.instant(motion, counts)?;
        Ok(Step { end, error })
    }
}

fn beyond(value: f64, noise: f64) -> f64 {
    value.signum() * (value.abs() - noise).max(0.0)
}

fn combined(weights: &[f64], of: &dyn Fn(usize) -> Vec<f64>, n: usize) -> Vec<f64> {
    let mut sum = vec![0.0; n];
    for (j, w) in weights.iter().enumerate() {
        for (s, v) in sum.iter_mut().zip(of(j)) {
            *s += w * v;
        }
    }
    sum
}

impl Scheme for BdfBfgs {
    fn order(&self) -> u32 {
        STEPS as u32
    }

    fn step(
        &mut self,
        eq: &Equations<'_, f64>,
        from: &Instant,
        h: f64,
        estimate: bool,
        counts: &mut Counts,
    ) -> Result<Step> {
        // the last step of a run with fixed steps may be shorter: one start step is nothing lost
        self.restarted = self.history.too_wide(from, h);
        self.started = None;
        if !self.restarted && self.history.past.len() >= STEPS - 1 + usize::from(estimate) {
            return self.corrected(eq, from, h, counts);
        }
        self.tried = None;
        let start = self.history.start(eq, from, h, counts)?;
        self.started = Some((h, start.parts));
        Ok(Step { end: start.end, error: estimate.then_some(start.error) })
    }

    fn accept(&mut self, _: &Equations<'_, f64>, from: &Instant, step: &Step, h: f64) {
        if self.started.is_none() {
            self.usual = h;
            self.history.passed();
        }
        if self.restarted {
            self.history.past.clear();
        }
        self.history.past.insert(0, from.clone());
        self.history.past.truncate(STEPS);
        self.lam = self.tried.take().map(|lam| (step.end.motion.t, lam));
    }

    /// Behind a kink start steps grow back to the length that steps had before it: in short ones rounding, which a difference of
    /// rates shows over the step, would pass for an error.
    fn proposal(&mut self, _: &dyn Fn(&LocalError) -> f64) -> Option<f64> {
        let (h, parts) = self.started?;
        let back = (self.usual / h).clamp(1.0, REGROWTH);
        Some(if parts == 1 { back } else { 1.0 })
    }

    /// Start steps hold a part of the tolerance in each of their parts.
    fn per_unit_step(&self) -> bool {
        self.started.is_none()
    }

    fn between(
        &mut self,
        eq: &Equations<'_, f64>,
        from: &Instant,
        step: &Step,
        h: f64,
        fractions: &[f64],
        counts: &mut Counts,
    ) -> Result<Vec<Motion<f64>>> {
        if self.started.is_none() {
            return Ok(quintic(eq, from, &step.end, h, fractions));
        }
        let at = |x: &f64| self.history.between(eq, from.motion.t + x * h, counts);
        Ok(fractions.iter().map(at).collect::<Result<Vec<_>>>()?.into_iter().flatten().collect())
    }

    fn reset(&mut self) {
        self.history.clear();
        self.lam = None;
    }

    fn remark(&self) -> Option<String> {
        self.solver.remark()
    }

    fn largest_growth(&self) -> f64 {
        if self.history.past.len() < STEPS { 1.0 } else { GROWTH }
    }
}
