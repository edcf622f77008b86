//! What a step was made of, for those who differentiate it, and steps whose orders were chosen before.
use crate::error::Result;
use crate::run::Counts;

use super::super::explicit8::RecordedStage;
use super::super::kept::Parts;
use super::super::radau::{FIVE, Radau};
use super::super::{Equations, Instant, Scheme, Step};
use super::begin::Begin;
use super::differences::Formula;
use super::newton::Newton;
use super::{Bdf, FIXED, History, LONGER, Trial};
use crate::tolerances::steps::SAME_LENGTH;

/// `Scheme::formula` of steps without an order of their own: a start step of another method, one that begins a history from rates.
pub const START: i32 = 0;
/// See `START`.
pub const RATES: i32 = -1;

/// How a step comes about.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// by Radau's method: there is no history yet
    Start,
    /// at order one, from the rates of its start
    Rates,
    /// at order four, from the points of the steps before
    Points,
    /// at this order
    Goes(usize),
}

impl Kind {
    /// Of a step that a run with a tolerance made.
    pub fn of(formula: i32) -> Kind {
        match usize::try_from(formula) {
            Err(_) => Kind::Rates,
            Ok(0) => Kind::Start,
            Ok(order) => Kind::Goes(order),
        }
    }

    /// Of all fixed steps between these times, histories ending at breaks.
    pub fn fixed(times: &[f64], breaks: &[f64]) -> Vec<Kind> {
        let mut out: Vec<Kind> = Vec::new();
        let (mut equal, mut order, mut last) = (0, 0, 0.0);
        for t in times.windows(2) {
            let h = t[1] - t[0];
            if breaks.contains(&t[0]) {
                (equal, order) = (0, 0);
            }
            let same = (last / h - 1.0_f64).abs() < SAME_LENGTH;
            let kind = match order {
                0 if equal == FIXED && same => Kind::Points,
                0 => Kind::Start,
                // behind a step that was divided: the order climbs again
                _ if h > LONGER * last => Kind::Goes(1),
                _ => Kind::Goes(FIXED.min(order + 1)),
            };
            (equal, order) = match kind {
                Kind::Start => (if same && equal > 0 { equal + 1 } else { 1 }, 0),
                Kind::Goes(k) => (0, k),
                Kind::Points | Kind::Rates => (0, FIXED),
            };
            out.push(kind);
            last = h;
        }
        out
    }
}

/// Where the history of a step comes from.
#[derive(Debug, Clone)]
pub enum Origin {
    Before,
    Rates,
    /// increments of the points from the last one, which is the first of them
    Points(Vec<Vec<f64>>),
}

/// Points of a history, the last one first, in the chart before and from the pose of the last one.
#[derive(Debug, Clone)]
pub struct Recharted {
    pub before: Vec<Vec<f64>>,
    pub after: Vec<Vec<f64>>,
}

/// In the order in which it happens: the history, its steps longer by `stretch`, a new chart, the equations of the step at their
/// solution (increments count from the chart), a new chart.
#[derive(Debug, Clone)]
pub struct Recorded {
    pub origin: Origin,
    pub stretch: f64,
    pub before: Option<Recharted>,
    pub order: usize,
    pub c: f64,
    pub stage: Option<RecordedStage>,
    pub after: Option<Recharted>,
    /// the history took more turns, in shorter and shorter steps, than is held here
    pub lost: bool,
}

impl Recorded {
    fn new(origin: Origin) -> Self {
        Recorded { origin, stretch: 1.0, before: None, order: 1, c: 0.0, stage: None, after: None, lost: false }
    }

    /// Of a shorter step from the history as the last try left it.
    pub(super) fn again(self) -> Self {
        Recorded { lost: self.lost || self.before.is_some(), stage: None, ..self }
    }

    pub(super) fn solved(&mut self, order: usize, c: f64, trial: &Trial, acceleration: Vec<f64>) {
        (self.order, self.c) = (order, c);
        let at = Instant { motion: trial.motion.clone(), acceleration, lam: trial.lam.clone() };
        self.stage = Some(RecordedStage { increment: trial.y.clone(), at });
    }
}

/// What a scheme carries from step to step.
#[derive(Clone, Default)]
pub struct Kept {
    history: Option<History>,
    points: Vec<Instant>,
}

impl Bdf {
    /// Steps that are solved to rounding, in ways that were chosen before, and recorded.
    pub fn scripted() -> Self {
        let start = Begin::Radau(Box::new(Radau::new(&FIVE, None).recording()));
        Bdf::with(Box::new(Newton::new(None)), Formula::NDF, start, false)
    }

    /// Steps by a tolerance of a motion that is differentiated.
    pub fn from_rates(rtol: f64) -> Self {
        Bdf::with(Box::new(Newton::new(Some(rtol))), Formula::NDF, Begin::Rates, false)
    }

    /// The same, solved to rounding and kept.
    pub fn keeping(rtol: f64) -> Self {
        let newton = Newton::new(Some(rtol)).until_rounding();
        Bdf { keeps: true, ..Bdf::with(Box::new(newton), Formula::NDF, Begin::Rates, false) }
    }

    /// The next step of a run that is kept: from the history as it is, or one that begins with it.
    pub(super) fn keep_next(&mut self) {
        if !self.keeps {
            return;
        }
        self.record = Some(match self.record.take() {
            _ if self.begun => Recorded::new(Origin::Rates),
            Some(tried) => tried.again(),
            None => Recorded::new(Origin::Before),
        });
    }

    /// Differences from now on count from the last pose; false if they did.
    pub(super) fn recharts(&mut self, eq: &Equations<'_, f64>) -> bool {
        let order = self.order;
        let Some(history) = self.history.as_mut().filter(|h| eq.widest_rotation(&h.d[0].y) > 0.0) else {
            return false;
        };
        let turned = super::recharted(eq, history, order);
        history.equal = 0;
        if let Some(record) = &mut self.record {
            record.before = Some(turned);
        }
        true
    }

    /// What the last step was made of.
    pub(super) fn kept_parts(&mut self) -> Option<Parts> {
        let own = self.record.take().filter(|r| self.keeps && !r.lost)?;
        Some(Parts { stages: vec![own.stage.clone()?], history: Some(own) })
    }

    pub fn resume(&mut self, kept: Option<Kept>) {
        let Kept { history, points } = kept.unwrap_or_default();
        (self.history, self.points) = (history, points);
    }

    pub fn kept(&self) -> Kept {
        Kept { history: self.history.clone(), points: self.points.clone() }
    }

    /// How the next step comes about.
    pub fn next(&mut self, kind: Kind) {
        self.script = Some(kind);
        self.record = Some(Recorded::new(if kind == Kind::Rates { Origin::Rates } else { Origin::Before }));
    }

    /// The last step, and the stages of one of Radau's method.
    pub fn recorded(&mut self) -> (Option<Recorded>, Vec<RecordedStage>) {
        let stages = match &mut self.begin {
            Begin::Radau(start) => start.recorded(),
            _ => Vec::new(),
        };
        (self.record.take(), stages)
    }

    /// The history of the next step; or that step, where there is none yet.
    pub(super) fn follow(
        &mut self,
        eq: &Equations<'_, f64>,
        from: &Instant,
        h: f64,
        kind: Kind,
        counts: &mut Counts,
    ) -> Result<Option<Step>> {
        match (kind, &mut self.begin) {
            (Kind::Start, Begin::Radau(start)) => {
                self.history = None;
                let made = start.step(eq, from, h, false, counts)?;
                if !self.continues(from, h) {
                    self.points = vec![from.clone()];
                }
                return Ok(Some(made));
            }
            (Kind::Rates, _) => self.begin_from_rates(eq, from, h),
            (Kind::Points, _) => self.collect(eq, h),
            (Kind::Goes(order), _) => self.order = order,
            (Kind::Start, _) => {}
        }
        Ok(None)
    }
}
