//! How a history begins.
//!
//! By a tolerance: one step of a one-step method, Radau's of order five or, without a tangent, the explicit one of order eight, as long as
//! its error allows; points within it are the first four of the history. Orders one to three behind every kink of a law would err more in
//! their few steps than all others together.
//!
//! Stiff scenes, whose fast vibrations low orders damp, and motions that are differentiated begin with a point and its rates at order one.
//! Fixed steps begin with four equal ones, by Radau's method or, without a tangent, in parts of order eight; so do steps without a tangent
//! of models without kinks, since parts may be far shorter than steps of the method and differences of such short ones show the rounding
//! of its equations.
use super::differences::{Pair, backward_differences};
use super::record::Origin;
use super::start::Start;
use super::{Bdf, FIXED, History, LONGER, MOST};
use crate::error::Result;
use crate::integrate::explicit8::Explicit8;
use crate::integrate::radau::{FIVE, Radau};
use crate::integrate::{Equations, Instant, LocalError, Scheme, Step};
use crate::run::Counts;
use crate::tolerances::motion::SAFETY;
use crate::tolerances::steps::{NOISE_SHARE, SAME_LENGTH};

/// Growth of first steps.
const REGROWTH: f64 = 5.0;
/// First steps that would grow by more are followed by a longer one.
const GROWS: f64 = 1.5;
/// The same at most.
const FASTEST: f64 = 8.0;
/// Places of the points within a step.
const WITHIN: [f64; FIXED - 1] = [0.25, 0.5, 0.75];

pub(super) enum Begin {
    /// at order one
    Rates,
    /// equal steps of Radau's method
    Radau(Box<Radau>),
    /// equal steps of order eight in parts
    Parts(Start),
    /// points within one step
    OneStep(OneStep),
}

/// A one-step method, and the error of its last step.
pub(super) struct OneStep {
    pub scheme: Box<dyn Scheme>,
    /// its states of laws within a step are as accurate as at its ends
    states: bool,
    /// an error counts so many times
    strict: f64,
    /// the history is of equal steps, since the scheme knows states within one less well
    repeats: bool,
    /// as long as its steps grow it goes on
    grows: bool,
    error: Option<LocalError>,
}

impl OneStep {
    /// Radau's method.
    pub fn stiff(rtol: Option<f64>) -> Self {
        OneStep {
            scheme: Box::new(Radau::new(&FIVE, rtol)),
            states: false,
            strict: 1.0,
            repeats: false,
            grows: true,
            error: None,
        }
    }

    /// Order eight, as accurate as the parts of a start.
    pub fn smooth(start: &Start) -> Self {
        let scheme = Box::new(Explicit8::default());
        OneStep { scheme, states: true, strict: start.strict(), repeats: false, grows: false, error: None }
    }

    pub fn power(&self) -> f64 {
        self.scheme.power()
    }

    fn step(
        &mut self,
        eq: &Equations<'_, f64>,
        from: &Instant,
        h: f64,
        estimate: bool,
        counts: &mut Counts,
    ) -> Result<Step> {
        let mut made = self.scheme.step(eq, from, h, estimate, counts)?;
        // points a whole step apart: the formula of order four behind them errs more than the step
        self.repeats = !self.states && eq.has_state_rates();
        let strict = if self.repeats { self.strict / NOISE_SHARE } else { self.strict };
        if let Some(error) = &mut made.error {
            error.scale(strict);
        }
        self.error.clone_from(&made.error);
        Ok(made)
    }

    fn factor(&self, size: &dyn Fn(&LocalError) -> f64) -> f64 {
        let error = self.error.as_ref().map_or(1.0, size).max(f64::MIN_POSITIVE);
        (SAFETY * error.powf(-1.0 / self.power())).min(FASTEST)
    }
}

impl Bdf {
    /// The step that begins a history, or the history of the next step.
    pub(super) fn begins(
        &mut self,
        eq: &Equations<'_, f64>,
        from: &Instant,
        h: f64,
        estimate: bool,
        counts: &mut Counts,
    ) -> Result<Option<Step>> {
        let is_first = self.stiff.is_none();
        if is_first && !self.fixed && !self.corrector.per_unit_step() {
            self.stiff = Some(eq.is_stiff(from, self.time, counts)?);
        }
        // orders one and two damp fast vibrations, which those above them would have to follow
        let vibrates = is_first && self.stiff == Some(true);
        match &mut self.begin {
            Begin::OneStep(_) if vibrates => self.begin_from_rates(eq, from, h),
            Begin::Rates => self.begin_from_rates(eq, from, h),
            Begin::OneStep(start) => {
                let is_ready = self.points.len() > FIXED && self.points[FIXED].motion.t == from.motion.t;
                if !is_ready {
                    return start.step(eq, from, h, estimate, counts).map(Some);
                }
                let spacing = (from.motion.t - self.points[0].motion.t) / FIXED as f64;
                self.collect(eq, spacing);
            }
            Begin::Radau(_) | Begin::Parts(_) => return self.equally(eq, from, h, counts),
        }
        Ok(None)
    }

    /// The next of equal steps, or their history.
    fn equally(
        &mut self,
        eq: &Equations<'_, f64>,
        from: &Instant,
        h: f64,
        counts: &mut Counts,
    ) -> Result<Option<Step>> {
        if self.divided(from, h) {
            self.begin_from_rates(eq, from, h);
            return Ok(None);
        }
        let step = self.first_step(eq, from, h, counts)?;
        if step.is_none() {
            self.collect(eq, h);
        }
        Ok(step)
    }

    /// The motion goes on from the end of a step that has no history.
    pub(super) fn begun_by(&mut self, eq: &Equations<'_, f64>, from: &Instant, step: &Step, h: f64) {
        let goes_on = self.continues(from, h);
        match &mut self.begin {
            Begin::Radau(start) => start.accept(eq, from, step, h),
            Begin::OneStep(start) => {
                if start.repeats {
                    if !goes_on {
                        self.points = vec![from.clone()];
                    }
                } else {
                    let inside = start.scheme.between(eq, from, step, h, &WITHIN, &mut Counts::default());
                    let inside =
                        inside.unwrap_or_default().into_iter().map(|motion| Instant { motion, ..from.clone() });
                    self.points = std::iter::once(from.clone()).chain(inside).collect();
                }
                start.scheme.accept(eq, from, step, h);
            }
            Begin::Rates | Begin::Parts(_) => {}
        }
        self.points.push(step.end.clone());
    }

    /// The length of the step behind one without a history, over its own.
    pub(super) fn first_factor(&mut self, size: &dyn Fn(&LocalError) -> f64) -> f64 {
        let Begin::OneStep(start) = &self.begin else { return self.back() };
        let (factor, repeats) = (start.factor(size), start.repeats);
        if start.grows && factor > GROWS && (!repeats || self.points.len() == 2) {
            self.points.clear();
            return factor;
        }
        if repeats { 1.0 } else { factor.min(1.0) / FIXED as f64 }
    }

    /// Order one, from rates.
    pub(super) fn begin_from_rates(&mut self, eq: &Equations<'_, f64>, from: &Instant, h: f64) {
        let n = from.motion.rate.len();
        let scaled = |v: &[f64]| v.iter().map(|x| x * h).collect();
        let mut d = vec![Pair::zero(n, eq.states(&from.motion).len()); MOST + 3];
        d[0].v.clone_from(&from.motion.rate);
        d[0].z = eq.states(&from.motion);
        let z = scaled(&eq.state_rates(&from.motion));
        d[1] = Pair { y: scaled(&from.motion.rate), v: scaled(&from.acceleration), z };
        self.order = 1;
        self.begun = true;
        self.history = Some(History { t: from.motion.t, h, chart: from.motion.clone(), d, equal: 0, made: h });
    }

    /// The next of the equal first steps; none where they are through.
    fn first_step(
        &mut self,
        eq: &Equations<'_, f64>,
        from: &Instant,
        h: f64,
        counts: &mut Counts,
    ) -> Result<Option<Step>> {
        if !self.continues(from, h) {
            self.points = vec![from.clone()];
        }
        let first = self.first_steps();
        let made = match &mut self.begin {
            Begin::Parts(start) if self.points.len() <= first => Some(start.step(eq, from, h, counts)?),
            Begin::Radau(start) if self.points.len() <= first => Some(start.step(eq, from, h, false, counts)?),
            _ => None,
        };
        Ok(made)
    }

    /// With fixed steps the difference of the highest order drops out of the formula, and what foresees its point is another.
    fn first_steps(&self) -> usize {
        if self.fixed && matches!(self.begin, Begin::Parts(_)) { FIXED - 1 } else { FIXED }
    }

    /// Whether fixed steps go on behind a first step that was divided.
    fn divided(&self, from: &Instant, h: f64) -> bool {
        let [.., a, b] = self.points.as_slice() else { return false };
        self.fixed && b.motion.t == from.motion.t && h > LONGER * (b.motion.t - a.motion.t)
    }

    /// First steps are equal, but behind a kink they grow back to the length that steps had before it: in differences of short ones
    /// rounding, over the step, would pass for an error.
    fn back(&self) -> f64 {
        match (&self.begin, self.points.as_slice()) {
            (Begin::Parts(start), [.., a, b]) if start.undivided() => {
                (self.usual / (b.motion.t - a.motion.t)).clamp(1.0, REGROWTH)
            }
            _ => 1.0,
        }
    }

    /// Whether a step of this length goes on from the first points as they lie.
    pub(super) fn continues(&self, from: &Instant, h: f64) -> bool {
        let times: Vec<f64> = self.points.iter().map(|p| p.motion.t).collect();
        times.last() == Some(&from.motion.t) && times.windows(2).all(|w| ((w[1] - w[0]) / h - 1.0).abs() < SAME_LENGTH)
    }

    /// Differences of equally distant points, the last one first.
    pub(super) fn collect(&mut self, eq: &Equations<'_, f64>, h: f64) {
        let points = std::mem::take(&mut self.points);
        let Some(last) = points.last() else { return };
        let pair = |p: &Instant| Pair {
            y: eq.difference(&last.motion, &p.motion),
            v: p.motion.rate.clone(),
            z: eq.states(&p.motion),
        };
        let pairs: Vec<Pair> = points.iter().rev().map(pair).collect();
        if let Some(record) = &mut self.record {
            record.origin = Origin::Points(pairs.iter().map(|p| p.y.clone()).collect());
        }
        let mut d = backward_differences(pairs);
        d.resize(MOST + 3, Pair::zero(eq.n(), eq.states(&last.motion).len()));
        self.order = FIXED;
        self.history = Some(History { t: last.motion.t, h, chart: last.motion.clone(), d, equal: 0, made: h });
    }
}
