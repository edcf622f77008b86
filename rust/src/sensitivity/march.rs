//! The motion itself, step by step, with what is needed to differentiate each step.
use std::borrow::Cow;

use crate::error::{Error, Result};
use crate::integrate::ali3p::{Factors, Record, Trend, Weight};
use crate::integrate::bdf::Bdf;
use crate::integrate::bdf::record::{Kept, Kind, Recorded};
use crate::integrate::dop853_numbers::STAGES;
use crate::integrate::generalized_alpha::{Carried, GeneralizedAlpha, Parameters};
use crate::integrate::kept::{KeptStep, KeptSteps};
use crate::integrate::methods::Method;
use crate::integrate::radau::{FIVE, Radau};
use crate::integrate::{Equations, Instant, Motion, Scheme};
use crate::run::{Cancel, Counts};

use super::Plan;
use super::bdf;
use super::runge_kutta::{self, Stages, inner_nodes, start_weight};
use super::stretches::Stretches;

/// The scheme, with what distinguishes its variants.
#[derive(Debug, Clone, Copy)]
pub enum Rule {
    Ali3p(Weight),
    /// spectral radius at infinity
    Alpha(f64),
    Explicit,
    Radau,
    /// backward differences, in the ways of `Plan::kinds`
    Bdf,
}

/// A quadrature over each step: what its start and its end count, and (fraction of the step, weight) of nodes inside.
pub struct Quadrature {
    pub ends: [f64; 2],
    pub inner: Vec<(f64, f64)>,
}

impl Quadrature {
    /// Of those that read no stage: order two.
    fn trapezoidal() -> Self {
        Quadrature { ends: [0.5, 0.5], inner: Vec::new() }
    }
}

impl Rule {
    /// Of a run whose steps may be kept.
    pub fn of(method: &Method) -> Option<Self> {
        match method {
            Method::Radau(tableau) if tableau.stages() == FIVE.stages() => Some(Rule::Radau),
            Method::Bdf => Some(Rule::Bdf),
            _ => None,
        }
    }

    /// The scheme's own: an integral is as accurate as the motion. That of "bdf" is in its first steps: see `bdf::weights`.
    pub fn quadrature(&self) -> Quadrature {
        match self {
            Rule::Explicit => {
                Quadrature { ends: [start_weight(), 0.0], inner: inner_nodes().map(|(_, c, b)| (c, b)).collect() }
            }
            // at all stages, the last of them before the end is moved to the constraints: as a state would be integrated
            Rule::Radau | Rule::Bdf => {
                let weights = FIVE.a.last().copied().unwrap_or_default();
                let inner = FIVE.c.iter().zip(weights).map(|(c, b)| (*c, *b)).collect();
                Quadrature { ends: [0.0, 0.0], inner }
            }
            Rule::Ali3p(_) | Rule::Alpha(_) => Quadrature::trapezoidal(),
        }
    }

    pub fn n_inner(&self) -> usize {
        match self {
            Rule::Explicit => inner_nodes().count(),
            Rule::Radau | Rule::Bdf => FIVE.stages(),
            Rule::Ali3p(_) | Rule::Alpha(_) => 0,
        }
    }

    /// What an integral over the motion counts of all rows of a plan: ends of steps, then nodes inside them.
    pub fn weights(&self, times: &[f64], kinds: &[Kind]) -> Vec<f64> {
        if let Rule::Bdf = self {
            return bdf::weights(times, kinds, &self.quadrature());
        }
        let Quadrature { ends: [first, last], inner } = self.quadrature();
        let mut out = vec![0.0; times.len()];
        for (i, t) in times.windows(2).enumerate() {
            out[i] += first * (t[1] - t[0]);
            out[i + 1] += last * (t[1] - t[0]);
        }
        out.extend(times.windows(2).flat_map(|t| inner.iter().map(move |(_, b)| b * (t[1] - t[0]))));
        out
    }

    /// Does a step solve for the states of laws by the trapezoidal rule?
    pub fn opens_states(&self) -> bool {
        matches!(self, Rule::Ali3p(_) | Rule::Alpha(_))
    }

    /// Numbers that an instant and its step need.
    pub fn numbers(&self, eq: &Equations<'_, f64>) -> [usize; 2] {
        let place = eq.topology().n_q + 6 * eq.n() + 4 * eq.n_rows();
        [place, place + self.kept(eq.n(), eq.n_rows())]
    }

    /// Numbers of the factors of one step.
    fn kept(&self, n: usize, rows: usize) -> usize {
        match self {
            Rule::Ali3p(_) => 4 * n * n + 4 * n * rows,
            Rule::Alpha(_) => 0,
            Rule::Explicit => runge_kutta::kept(STAGES, n, rows),
            Rule::Radau => runge_kutta::kept(FIVE.stages(), n, rows),
            Rule::Bdf => runge_kutta::kept(bdf::HELD, n, rows),
        }
    }
}

/// An instant, and what the scheme carries on from it.
#[derive(Clone)]
pub struct Here {
    pub instant: Instant,
    pub carried: Option<Carried>,
    /// with which ALI3-P foresees the next accelerations: a step is the same, to the last digit, wherever a run of them begins
    pub trend: Trend,
    /// of "bdf"
    pub kept: Option<Kept>,
}

impl Here {
    /// Before the first step.
    pub fn first(instant: Instant, rule: Rule) -> Self {
        let carried = match rule {
            Rule::Ali3p(_) | Rule::Explicit | Rule::Radau | Rule::Bdf => None,
            Rule::Alpha(_) => Some(Carried {
                t: instant.motion.t,
                a: instant.acceleration.clone(),
                rate_slope: instant.acceleration.clone(),
                lam: instant.lam.clone(),
                slope: None,
                h: 0.0,
            }),
        };
        Here { carried, ..Here::at(instant) }
    }

    /// Nothing is carried on.
    fn at(instant: Instant) -> Self {
        Here { instant, carried: None, trend: Trend::default(), kept: None }
    }
}

/// How a step came about.
pub enum Made {
    Ali3p(Record, Box<Factors>),
    Alpha(Parameters, f64),
    RungeKutta(Box<Stages>),
    Radau(Box<Stages>),
    Bdf(Box<Stages>, Box<Recorded>),
}

impl Here {
    /// The start of a step of this length: states of laws as the step solves for them.
    pub fn opened(&self, eq: &Equations<'_, f64>, h: f64) -> Cow<'_, Here> {
        if !eq.has_state_rates() {
            return Cow::Borrowed(self);
        }
        Cow::Owned(Here { instant: eq.opened(&self.instant, h).into_owned(), ..self.clone() })
    }
}

impl Made {
    /// Length of the step.
    pub fn length(&self) -> f64 {
        match self {
            Made::Ali3p(record, _) => record.h,
            Made::Alpha(_, h) => *h,
            Made::RungeKutta(stages) | Made::Radau(stages) | Made::Bdf(stages, _) => stages.h,
        }
    }

    /// The start of the step as the scheme takes it.
    pub fn start<'h>(&self, eq: &Equations<'_, f64>, from: &'h Here) -> Cow<'h, Here> {
        match self {
            Made::RungeKutta(_) | Made::Radau(_) | Made::Bdf(..) => Cow::Borrowed(from),
            _ => from.opened(eq, self.length()),
        }
    }

    /// Stages at the nodes inside the step.
    pub fn inner(&self) -> Vec<&Instant> {
        match self {
            Made::RungeKutta(stages) => inner_nodes().map(|(i, ..)| &stages.all[i].at).collect(),
            Made::Radau(stages) => stages.all.iter().map(|s| &s.at).collect(),
            _ => Vec::new(),
        }
    }

    /// Which node inside the step a stage is.
    pub fn node_of(&self, stage: usize) -> Option<usize> {
        match self {
            Made::RungeKutta(_) => inner_nodes().position(|(s, ..)| s == stage),
            Made::Radau(_) => Some(stage),
            _ => None,
        }
    }
}

/// A motion with controlled steps that was solved to rounding and kept; it serves the same start, times and numbers.
pub struct KeptMotion {
    pub steps: KeptSteps,
    pub times: Vec<f64>,
    pub x: Vec<f64>,
}

impl KeptMotion {
    pub fn serves(&self, eq: &Equations<'_, f64>, plan: &Plan, start: &Here) -> bool {
        let (own, there) = (&self.steps.start.motion, &start.instant.motion);
        let same = own.t == there.t && own.q == there.q && own.rate == there.rate && own.memory == there.memory;
        same && self.steps.steps.len() == plan.n_steps() && self.times == plan.times && self.x == eq.x
    }
}

/// Goes from step to step; a kept factorisation of the motion is all that it holds.
pub struct March<'a> {
    eqs: &'a Stretches<'a>,
    plan: &'a Plan,
    /// of a motion that was made before
    kept: Option<&'a KeptSteps>,
    alpha: Option<GeneralizedAlpha>,
    radau: Option<Radau>,
    bdf: Option<Bdf>,
    /// tangents come along with the factors; on the way back they are of no use
    tangents: bool,
}

impl<'a> March<'a> {
    pub fn new(eqs: &'a Stretches<'a>, plan: &'a Plan, kept: Option<&'a KeptSteps>) -> Self {
        March { eqs, plan, kept, alpha: None, radau: None, bdf: None, tangents: false }
    }

    pub fn with_tangents(self) -> Self {
        March { tangents: true, ..self }
    }

    /// Forget factorisations: steps from here on are the same whatever was before.
    pub fn forget(&mut self) {
        self.alpha = None;
        self.radau = None;
        self.bdf = None;
    }

    /// The end of step i, memories included, and how it came about.
    pub fn step(&mut self, i: usize, from: &Here, cancel: &Cancel, counts: &mut Counts) -> Result<(Here, Made)> {
        cancel.check()?;
        if let Some(kept) = self.kept.and_then(|k| k.steps.get(i)) {
            return self.as_kept(i, kept);
        }
        counts.add("steps", 1);
        self.made(i, from, counts).map_err(|e| at_time(e, from.instant.motion.t))
    }

    /// The scheme starts anew where a load, a drive or a law is not smooth: accelerations and multipliers of what follows.
    pub fn anew(&mut self, i: usize, end: &Here, counts: &mut Counts) -> Result<Option<Here>> {
        if !self.plan.starts_anew(self.plan.times[i + 1]) {
            return Ok(None);
        }
        self.forget();
        let instant = match self.kept.and_then(|k| k.steps.get(i)?.anew.clone()) {
            Some(anew) => anew,
            None => self.eqs.from(self.plan.times[i + 1]).instant(end.instant.motion.clone(), counts)?,
        };
        Ok(Some(Here::first(instant, self.plan.rule)))
    }

    /// A step that was made before.
    fn as_kept(&self, i: usize, step: &KeptStep) -> Result<(Here, Made)> {
        let before = Instant {
            motion: Motion { memory: step.memory.clone(), ..step.end.motion.clone() },
            acceleration: Vec::new(),
            lam: Vec::new(),
        };
        let stages = Box::new(Stages::implicit(step.h, step.parts.stages.clone(), &before)?);
        let mut end = step.end.clone();
        end.motion.t = self.plan.times[i + 1];
        let made = match &step.parts.history {
            Some(history) => Made::Bdf(stages, Box::new(history.clone())),
            None => Made::Radau(stages),
        };
        Ok((Here::at(end), made))
    }

    fn made(&mut self, i: usize, from: &Here, counts: &mut Counts) -> Result<(Here, Made)> {
        let (h, t) = (self.plan.step(i), self.plan.times[i + 1]);
        let eq = self.eqs.from(self.plan.times[i]);
        match self.plan.rule {
            Rule::Ali3p(weight) => {
                let mut trend = from.trend.clone();
                let opened = eq.opened(&from.instant, h);
                let (mut end, record, mut by) = eq.ali3p_step(&opened, h, &trend, (weight, None), counts)?;
                if !by.settled {
                    eq.renew(&opened, &record, &mut by, counts)?;
                }
                trend.pass(&from.instant.acceleration, &end.acceleration, h);
                end.motion.t = t;
                by.linear = by.linear.filter(|_| self.tangents);
                eq.remember(&mut end.motion, counts);
                let here = Here { trend, ..Here::at(end) };
                Ok((here, Made::Ali3p(record, Box::new(by))))
            }
            Rule::Alpha(rho) => {
                let scheme = self.alpha.get_or_insert_with(|| {
                    let mut scheme = GeneralizedAlpha::to_rounding(rho);
                    scheme.resume(from.carried.clone());
                    scheme
                });
                let mut step = scheme.step(eq, &from.instant, h, false, counts)?;
                step.end.motion.t = t;
                eq.remember(&mut step.end.motion, counts);
                scheme.accept(eq, &from.instant, &step, h);
                let here = Here { carried: scheme.carried().cloned(), ..Here::at(step.end) };
                Ok((here, Made::Alpha(Parameters::of(rho), h)))
            }
            Rule::Explicit => {
                let (mut end, stages) = runge_kutta::step(eq, &from.instant, h, counts)?;
                end.motion.t = t;
                eq.remember(&mut end.motion, counts);
                Ok((Here::at(end), Made::RungeKutta(Box::new(stages))))
            }
            Rule::Radau => {
                let scheme = self.radau.get_or_insert_with(|| Radau::new(&FIVE, None).recording());
                let mut step = scheme.step(eq, &from.instant, h, false, counts)?;
                let stages = Stages::implicit(h, scheme.recorded(), &step.end)?;
                eq.same_branch(&stages.open.rate, &step.end, h)?;
                step.end.motion.t = t;
                eq.remember(&mut step.end.motion, counts);
                scheme.accept(eq, &from.instant, &step, h);
                Ok((Here::at(step.end), Made::Radau(Box::new(stages))))
            }
            Rule::Bdf => self.multistep(i, from, counts),
        }
    }

    fn multistep(&mut self, i: usize, from: &Here, counts: &mut Counts) -> Result<(Here, Made)> {
        let (eq, h) = (self.eqs.from(self.plan.times[i]), self.plan.step(i));
        let kind = *self.plan.kinds.get(i).ok_or_else(|| Error::model("a step of bdf has no order"))?;
        let scheme = self.bdf.get_or_insert_with(|| {
            let mut scheme = Bdf::scripted();
            scheme.resume(from.kept.clone());
            scheme
        });
        scheme.next(kind);
        let mut step = scheme.step(eq, &from.instant, h, false, counts)?;
        let end = step.end.clone();
        step.end.motion.t = self.plan.times[i + 1];
        eq.remember(&mut step.end.motion, counts);
        scheme.accept(eq, &from.instant, &step, h);
        let here = Here { kept: Some(scheme.kept()), ..Here::at(step.end) };
        let (recorded, mut stages) = scheme.recorded();
        let own = recorded.filter(|r| r.stage.is_some());
        if let Some(stage) = own.as_ref().and_then(|r| r.stage.clone()) {
            stages = vec![stage];
        }
        let stages = Stages::implicit(h, stages, &end)?;
        eq.same_branch(&stages.open.rate, &end, h)?;
        let made = match own {
            Some(own) => Made::Bdf(Box::new(stages), Box::new(own)),
            None => Made::Radau(Box::new(stages)),
        };
        Ok((here, made))
    }
}

fn at_time(error: Error, t: f64) -> Error {
    match error {
        Error::Convergence { message, best, residual } => {
            Error::Convergence { message: format!("at t = {t} s {message}; take smaller steps"), best, residual }
        }
        other => other,
    }
}
