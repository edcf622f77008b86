//! Four-step BDF whose equations are solved without any tangent: the derivative-free multibody solver of J. Algorithms & Comput.
//! Technol. (2017), doi 10.1177/1748301817729990.
//!
//! Taylor predictor of second order, corrector of order four with constraints on position and velocity level (`bdf_step`), solved
//! by inverse quasi-Newton updates whose inverse H goes on from step to step. H is formed from differences at the start and where
//! the iteration does not converge any more; after that Broyden's update takes over for the step. Four steps of order eight start
//! it, divided where the scene is too stiff for them. Unequal steps use the weights of the polynomial through the actual times.
use nalgebra::{DMatrix, DVector};

use crate::error::{Error, Result};
use crate::run::Counts;
use crate::solve::Residual;
use crate::solve::differences;
use crate::solve::inverse::{Family, Guard, Inverse};
use crate::solve::inverse_bfgs::{Options, Outcome, Start, Status, solve};
use crate::solve::line_search::Rule;

use super::bdf_step::{BdfStep, Form, Guess, Sizes, derivative_weights, value_weights};
use super::explicit::independent_rows;
use super::explicit8::Explicit8;
use super::interpolate::quintic;
use super::saddle::Saddle;
use super::{Equations, Instant, LocalError, Motion, Scheme, Step};

const STEPS: usize = 4;
/// Norm at which the equations of a step count as solved, over the motion within the step and the root of their number.
const SOLVED: f64 = 1e-12;
/// Limits of that norm: rounding of rows and of increments, and what any step has to reach.
const ROUNDING_OF_ROWS: f64 = 1e-15;
const ROUNDING: f64 = 1e-17;
const LOOSEST: f64 = 1e-14;
/// Least cosine between y and s for an update: where BFGS meets a nonsymmetric or indefinite Jacobian, smaller ones ruin H.
const CURVATURE: f64 = 0.1;
/// Where rounding stops the iteration above that, this is taken.
const ACCEPTABLE: f64 = 1e-11;
const MAX_ITERATIONS: usize = 40;
const PATIENCE: usize = 4;
const DIFFERENCE: f64 = 1e-7;
/// Failures of inverse BFGS after which Broyden's update stays.
const STRIKES: u32 = 2;
/// Error of a start step in characteristic lengths or radians.
const START_ERROR: f64 = 1e-10;
const MOST_DIVISIONS: u32 = 12;
/// Leading term of the error over the fifth difference: (1/5)/(25/12).
const LEADING: f64 = 12.0 / 125.0;
/// Growth of the step that keeps formulas of order four stable at unequal steps.
const GROWTH: f64 = 1.25;

pub struct BdfBfgs {
    form: Form,
    family: Family,
    /// whether the update may become Broyden's for good
    settles: bool,
    /// steps at which inverse BFGS failed
    strikes: u32,
    /// accepted instants before the present one, latest first
    past: Vec<Instant>,
    sizes: Option<Sizes>,
    kept: Option<Kept>,
    lam: Option<(f64, Vec<f64>)>,
    tried: Option<Vec<f64>>,
    divisions: u32,
}

/// A past motion: its increments from the present pose, and its rates.
struct Past {
    t: f64,
    theta: Vec<f64>,
    rate: Vec<f64>,
}

/// An inverse and the factors of the equations it belongs to.
struct Kept {
    inverse: Inverse,
    row_factor: Vec<f64>,
    g: f64,
}

impl BdfBfgs {
    /// Without a family inverse BFGS runs until it has failed twice, Broyden's update from there on.
    pub fn new(form: Form, family: Option<Family>) -> Self {
        BdfBfgs {
            form,
            family: family.unwrap_or(Family::Bfgs),
            settles: family.is_none(),
            strikes: 0,
            past: Vec::new(),
            sizes: None,
            kept: None,
            lam: None,
            tried: None,
            divisions: 0,
        }
    }

    fn sizes(&mut self, eq: &Equations<'_, f64>, m: &Motion<f64>) -> Sizes {
        let make = || {
            let jacobian = eq.rows(m).1;
            let kept = independent_rows(eq.system, &jacobian);
            Sizes::new(eq, &eq.mass(m), kept)
        };
        self.sizes.get_or_insert_with(make).clone()
    }

    /// Multipliers of the kept rows at an instant.
    fn multipliers(
        &self,
        eq: &Equations<'_, f64>,
        from: &Instant,
        sizes: &Sizes,
    ) -> Result<Vec<f64>> {
        if let Some((t, lam)) = &self.lam
            && *t == from.motion.t
        {
            return Ok(lam.clone());
        }
        if sizes.kept.is_empty() {
            return Ok(Vec::new());
        }
        let jacobian = eq.rows(&from.motion).1;
        let kept = DMatrix::from_fn(sizes.kept.len(), eq.n(), |r, i| {
            jacobian[(sizes.kept[r], i)]
        });
        let load = jacobian.transpose() * DVector::from_column_slice(&from.lam);
        // M x + J_k^T lam_k = J^T lam with J_k x = 0: x vanishes, the kept rows carry what all carried
        let saddle = Saddle::new(&eq.mass(&from.motion), &kept)?;
        let (_, lam) = saddle.solve(&load, &DVector::zeros(kept.nrows()))?;
        Ok(lam.as_slice().to_vec())
    }

    /// A step of order eight, divided until its own estimate is negligible.
    fn start(
        &mut self,
        eq: &Equations<'_, f64>,
        from: &Instant,
        h: f64,
        counts: &mut Counts,
    ) -> Result<Instant> {
        let scales = eq.scales();
        let scaled = |v: &[f64], unit: f64| {
            let sizes = v.iter().zip(&scales).map(|(v, s)| (v / s).abs() * unit);
            sizes.fold(0.0_f64, |a, b| if b > a || b.is_nan() { b } else { a })
        };
        loop {
            let parts = 1_u64 << self.divisions;
            let part = h / parts as f64;
            let (mut scheme, mut here) = (Explicit8::default(), from.clone());
            let mut good = true;
            for _ in 0..parts {
                let made = scheme.step(eq, &here, part, true, counts);
                let small = |e: &LocalError| {
                    scaled(&e.position, 1.0) < START_ERROR && scaled(&e.rate, h) < START_ERROR
                };
                match made {
                    Ok(step) if step.error.as_ref().is_some_and(small) => here = step.end,
                    Err(error) if self.divisions >= MOST_DIVISIONS => return Err(error),
                    _ => {
                        good = false;
                        break;
                    }
                }
            }
            if good {
                counts.add("start steps", parts);
                here.motion.t = from.motion.t + h;
                return Ok(here);
            }
            if self.divisions >= MOST_DIVISIONS {
                return Err(Error::Convergence {
                    message: format!(
                        "the start of 'bdf-bfgs' needs steps below {part:.2e} s: something vibrates much faster than the step; \
                         take a smaller step or another method"
                    ),
                    best: Vec::new(),
                    residual: f64::NAN,
                });
            }
            self.divisions += 1;
        }
    }

    /// The present first.
    fn history(&self, eq: &Equations<'_, f64>, from: &Instant, h: f64) -> Vec<Past> {
        let mut times = vec![from.motion.t];
        times.extend(self.past.iter().map(|p| p.motion.t));
        let widest = times.windows(2).fold(0.0_f64, |a, w| a.max(w[0] - w[1]));
        let covered = times[times.len() - 1] <= from.motion.t - h * self.past.len() as f64;
        let motions = if widest > GROWTH * h && covered {
            self.between(eq, from, h, &times)
        } else {
            self.past.iter().map(|p| p.motion.clone()).collect()
        };
        let seen = |m: &Motion<f64>| Past {
            t: m.t,
            theta: eq.difference(&from.motion, m),
            rate: m.rate.clone(),
        };
        let mut all = vec![seen(&from.motion)];
        all.extend(motions.iter().map(seen));
        all
    }

    /// Past motions at distances h, between the instants there are: behind a shortened step old distances would set the error.
    fn between(
        &self,
        eq: &Equations<'_, f64>,
        from: &Instant,
        h: f64,
        times: &[f64],
    ) -> Vec<Motion<f64>> {
        let oldest = times.len() - 1;
        let mut out = Vec::new();
        for j in 1..=oldest {
            let t = from.motion.t - h * j as f64;
            let newer = (0..oldest)
                .find(|k| times[k + 1] <= t)
                .unwrap_or(oldest - 1);
            let to = if newer == 0 {
                from
            } else {
                &self.past[newer - 1]
            };
            let gap = times[newer] - times[newer + 1];
            let part = [(t - times[newer + 1]) / gap];
            out.extend(quintic(eq, &self.past[newer], to, gap, &part));
        }
        out
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
            *factor = if largest > 0.0 && largest.is_finite() {
                1.0 / largest
            } else {
                1.0
            };
            (0..x.len()).for_each(|c| j[(r, c)] *= *factor);
        }
        let inverse = Inverse::of(&j)
            .or_else(|| Inverse::regularised(&j))
            .ok_or_else(|| lost(step.t))?;
        self.kept = Some(Kept {
            inverse,
            row_factor: step.row_factor.clone(),
            g: step.g,
        });
        Ok(())
    }

    fn tolerance(&self, step: &BdfStep<'_, '_>) -> f64 {
        let moved = step.guess.theta.iter().zip(&step.sizes.sigma);
        let size = moved.fold(0.0_f64, |a, (v, s)| a.max((v / s).abs()));
        let floor = if step.sizes.kept.is_empty() {
            ROUNDING
        } else {
            ROUNDING_OF_ROWS
        };
        (SOLVED * size).clamp(floor, LOOSEST)
    }

    /// The equations of a step: with the H there is, with a new one, with a new one and Broyden's update.
    fn solve(&mut self, step: &mut BdfStep<'_, '_>, n: usize) -> Result<Vec<f64>> {
        // far from the length it was made for an inverse is worth less than a new one
        if self
            .kept
            .as_ref()
            .is_some_and(|k| !(0.5..=2.0).contains(&(step.g / k.g)))
        {
            self.kept = None;
        }
        let goal = (n as f64).sqrt();
        let solved = goal * self.tolerance(step);
        let mut x = vec![0.0; n];
        let mut last = f64::INFINITY;
        for attempt in 0..3 {
            if attempt > 0 || self.kept.is_none() {
                self.form_inverse(step, &x, DIFFERENCE)?;
            }
            let before = self.family;
            let family = self.family_of(attempt);
            if attempt > 0 && family != before {
                step.counts.add("fallback steps", 1);
            }
            let out = self.attempt(step, &x, family, solved)?;
            last = out.f.iter().map(|v| v * v).sum::<f64>().sqrt();
            if last <= ACCEPTABLE * goal {
                if last > solved {
                    step.counts.add("steps at rounding", 1);
                }
                return Ok(out.x);
            }
            if last.is_finite() {
                x = out.x;
            }
        }
        self.kept = None;
        Err(Error::Convergence {
            message: format!(
                "the equations of the step to t = {:.9} s did not converge without a Jacobian",
                step.t
            ),
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

    fn attempt(
        &mut self,
        step: &mut BdfStep<'_, '_>,
        x: &[f64],
        family: Family,
        tolerance: f64,
    ) -> Result<Outcome> {
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
            rule: Rule {
                max_backtracks: 12,
                ..Rule::default()
            },
            guard: Guard {
                curvature: CURVATURE,
                ..Options::default().guard
            },
            start: Start::Identity,
            patience: PATIENCE,
            restarts: 0,
            fallback: false,
            ..Options::default()
        };
        let out = solve(step, x, &options, &mut inverse)?;
        let counts = &mut *step.counts;
        counts.add("iterations", out.iterations as u64);
        counts.add("backtracks", out.backtracks as u64);
        counts.add("updates left out", out.skipped as u64);
        if out.status != Status::Broken
            && let Some(inverse) = inverse
        {
            self.kept = Some(Kept {
                inverse,
                row_factor: step.row_factor.clone(),
                g,
            });
        }
        Ok(out)
    }

    fn corrected(
        &mut self,
        eq: &Equations<'_, f64>,
        from: &Instant,
        h: f64,
        counts: &mut Counts,
    ) -> Result<Step> {
        let sizes = self.sizes(eq, &from.motion);
        let history = self.history(eq, from, h);
        let t = from.motion.t + h;
        let times: Vec<f64> = history.iter().map(|p| p.t).collect();
        let mut nodes = vec![t];
        nodes.extend(&times[..STEPS]);
        let weights = derivative_weights(&nodes);
        let past = |of: &dyn Fn(usize) -> Vec<f64>| combined(&weights[1..], of, eq.n());
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
            guess,
            row_factor: vec![1.0; n],
            counts,
        };
        let x = self.solve(&mut step, n)?;
        let at = step.meaning(&x);
        let counts = &mut *step.counts;
        let mut motion = at.motion;
        if self.form == Form::Symmetric && !sizes.kept.is_empty() {
            eq.align(&mut motion, counts)?;
        }
        let error = (history.len() > STEPS).then(|| {
            let ahead = value_weights(&times[..=STEPS], t);
            let miss = |now: &[f64], of: &dyn Fn(usize) -> Vec<f64>| -> Vec<f64> {
                let expected = combined(&ahead, of, eq.n());
                let both = now.iter().zip(expected);
                both.map(|(y, e)| LEADING * (y - e)).collect()
            };
            LocalError {
                position: miss(&at.theta, &|j| history[j].theta.clone()),
                rate: miss(&motion.rate, &|j| history[j].rate.clone()),
            }
        });
        self.tried = Some(at.lam);
        let end = eq.instant(motion, counts)?;
        Ok(Step { end, error })
    }
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

fn lost(t: f64) -> Error {
    Error::Convergence {
        message: format!("a force is no number at t = {t:.9} s"),
        best: Vec::new(),
        residual: f64::NAN,
    }
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
        if self.past.len() >= STEPS - 1 + usize::from(estimate) {
            return self.corrected(eq, from, h, counts);
        }
        self.tried = None;
        let end = self.start(eq, from, h, counts)?;
        let none = || LocalError {
            position: vec![0.0; eq.n()],
            rate: vec![0.0; eq.n()],
        };
        Ok(Step {
            end,
            error: estimate.then(none),
        })
    }

    fn accept(&mut self, _: &Equations<'_, f64>, from: &Instant, step: &Step, _: f64) {
        self.past.insert(0, from.clone());
        self.past.truncate(STEPS);
        self.lam = self.tried.take().map(|lam| (step.end.motion.t, lam));
    }

    fn reset(&mut self) {
        self.past.clear();
        self.lam = None;
        self.divisions = 0;
    }

    fn remark(&self) -> Option<String> {
        (self.settles && self.family == Family::Broyden).then(|| {
            "inverse BFGS failed twice, Broyden's update took over (the Jacobian is not symmetric)"
                .into()
        })
    }

    fn largest_growth(&self) -> f64 {
        if self.past.len() < STEPS { 1.0 } else { GROWTH }
    }
}
