//! Whether a step is good enough, and whether it may go over a kink of a law.
use super::super::sides::{Sides, Within};
use super::super::way::{Verdict, Way, active, scaled};
use super::super::{Equations, Instant, LocalError, Motion, Scheme, Step};
use super::{Driver, Steps};
use crate::error::Result;
use crate::multibody::System;
use crate::run::Counts;
use crate::tolerances::motion::SAFETY;

/// The step that was just made.
struct Made<'a, 'e, 's, 'p> {
    driver: &'a Driver<'e, 's, 'p>,
    scheme: &'a mut dyn Scheme,
    /// with the laws of the step
    eq: &'a Equations<'a, f64>,
    here: &'a Instant,
    step: &'a Step,
    h: f64,
    allowed: f64,
    counts: &'a mut Counts,
}

impl Within for Made<'_, '_, '_, '_> {
    fn between(&mut self, fractions: &[f64]) -> Result<Vec<Motion<f64>>> {
        self.scheme.between(self.eq, self.here, self.step, self.h, fractions, self.counts)
    }

    /// As if what forces and rates of states are off grew evenly from nothing.
    fn effect(&mut self, held: &System, m: &Motion<f64>, time: f64) -> f64 {
        let other = self.driver.eq.on_sides(held);
        let mut m = m.clone();
        self.eq.close_states(&mut m);
        let mut at =
            |eq: &Equations<'_, f64>| Some((eq.instant(m.clone(), self.counts).ok()?.acceleration, eq.state_rates(&m)));
        let (Some((a, z)), Some((b, w))) = (at(self.eq), at(&other)) else { return f64::INFINITY };
        let off = |a: &[f64], b: &[f64], by: f64| a.iter().zip(b).map(|(a, b)| by * (b - a)).collect();
        let error = LocalError {
            position: off(&a, &b, time * time / 6.0),
            rate: off(&a, &b, 0.5 * time),
            state: off(&z, &w, 0.5 * time),
        };
        let speed = self.driver.speed.max(self.driver.scaled(&m.rate));
        self.driver.size(&error, speed, self.scheme.rate_time(self.h))
    }

    fn allowed(&self) -> f64 {
        self.allowed
    }
}

impl Driver<'_, '_, '_> {
    /// A step that is good enough may go over a kink, or end before one.
    pub(super) fn at_kinks(
        &mut self,
        judged: Verdict,
        eq: &Equations<'_, f64>,
        way: &mut Way,
        scheme: &mut dyn Scheme,
        h: f64,
        counts: &mut Counts,
    ) -> Verdict {
        let Verdict::Accepted(step, _, allowed) = &judged else { return judged };
        let Some(mut sides) = self.sides.take() else { return judged };
        let scheme = active(&mut way.detour, scheme);
        let here = &way.here;
        let mut made = Made { driver: self, scheme, eq, here, step, h, allowed: *allowed, counts };
        let found = sides.judge((here, &step.end), h, &mut made);
        self.sides = Some(sides);
        match found {
            Ok(None) => judged,
            Ok(Some(part)) => Verdict::Kinked(part),
            Err(error) => Verdict::of_error(error),
        }
    }

    /// Does a law that is not held beside its kinks pass one?
    pub(super) fn passes_kink(&self, from: &Motion<f64>, to: &Motion<f64>) -> bool {
        self.eq.passes_kink(from, to, self.held_beside())
    }

    /// Are all laws with sharp kinks held, and all sliders?
    fn held_beside(&self) -> (bool, bool) {
        self.sides.as_ref().map_or((false, false), Sides::are_held)
    }

    /// `allowed`: local error of the step; `patience`, `power`: of the scheme
    pub(super) fn judged(
        &self,
        tried: Result<Step>,
        way: &Way,
        (allowed, per_unit_step): (f64, bool),
        (patience, power): (f64, f64),
    ) -> Verdict {
        let here = &way.here;
        let step = match tried {
            Ok(step) => step,
            Err(error) => return Verdict::of_error(error),
        };
        let Some(error) = &step.error else {
            return Verdict::Accepted(Box::new(step), 0.0, allowed);
        };
        // what starts from rest without force has no rate of its own yet
        let reached = self.scaled(&step.end.motion.rate);
        let error_size = self.size(error, self.speed.max(reached), patience);
        let (mut size, mut allowed) = (error_size / allowed, allowed);
        let passes = || way.kinked || self.passes_kink(&here.motion, &step.end.motion);
        // at a kink the error falls with a lower power of the step: a kink may cost what a unit of time may
        let kinked = size > 1.0 && passes();
        if let (Steps::Controlled { rtol, .. }, true, true) = (self.plan.steps, kinked, per_unit_step) {
            allowed = allowed.max(rtol);
            size = error_size / allowed;
        }
        if size <= 1.0 {
            let turn = match self.plan.steps {
                Steps::Controlled { rtol, .. } => {
                    self.eq.reversal(&here.motion, &step.end.motion, rtol, self.held_beside().1)
                }
                Steps::Fixed(_) => None,
            };
            return match turn {
                Some(part) => Verdict::Turned(part),
                None => Verdict::Accepted(Box::new(step), size, allowed),
            };
        }
        let reason = match kinked {
            true => "where a law has a kink or a slider turns",
            false => "where something jumps or changes faster than any step can follow",
        };
        let why = format!(
            "no step is short enough: the estimated error of '{}' is {size:.1e} times the tolerance, {reason}; take a larger rtol, or \
             another method",
            self.culprit(error)
        );
        let factor = if size.is_finite() { (SAFETY * size.powf(-1.0 / power)).clamp(0.1, 0.9) } else { 0.1 };
        Verdict::Rejected(factor, why)
    }

    /// What the local error of a step may be; infinite for fixed steps.
    pub(super) fn tolerance(&self, scheme: &dyn Scheme, h: f64) -> f64 {
        match self.plan.steps {
            Steps::Fixed(_) => f64::INFINITY,
            Steps::Controlled { rtol, .. } if scheme.per_unit_step() => {
                rtol * (self.plan.share * h / (self.plan.end - self.start)).min(1.0)
            }
            Steps::Controlled { rtol, .. } => rtol,
        }
    }

    /// Errors of rates count for the time of the motion, or for `patience` where that is shorter.
    pub(super) fn size(&self, error: &LocalError, speed: f64, patience: f64) -> f64 {
        let rate = self.scaled(&error.rate) * (1.0 / speed.max(f64::MIN_POSITIVE)).min(patience);
        let position = self.scaled(&error.position);
        let state = scaled(&error.state, &self.states);
        if rate.is_nan() || position.is_nan() || state.is_nan() { f64::NAN } else { rate.max(position).max(state) }
    }

    /// The coordinate whose error is the largest.
    fn culprit(&self, error: &LocalError) -> &str {
        let size = |i: usize| {
            (error.position[i].abs().max(error.rate[i].abs() / self.speed.max(f64::MIN_POSITIVE))) / self.scales[i]
        };
        let worst = (0..self.scales.len()).max_by(|i, j| size(*i).total_cmp(&size(*j)));
        worst.map_or("", |i| &self.eq.topology().names[i])
    }
}
