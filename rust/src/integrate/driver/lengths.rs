//! Lengths of steps: the first, and those that end at outputs, breaks and the end.
use super::super::way::{Aim, Way};
use super::super::{Instant, Scheme, before_break};
use super::{Driver, Steps};
use crate::tolerances::steps::{ON_GRID, SAME_INSTANT, SAME_LENGTH};

impl Driver<'_, '_, '_> {
    /// A length from the motion itself: a small turn, or a small change of the rates.
    pub(super) fn first_step(&self, start: &Instant, rtol: f64, order: u32) -> f64 {
        let (v, a) = (self.scaled(&start.motion.rate), self.scaled(&start.acceleration));
        let time = (1.0 / v.max(f64::MIN_POSITIVE)).min((1.0 / a.max(f64::MIN_POSITIVE)).sqrt());
        time * rtol.powf(1.0 / f64::from(order + 1)) * 0.5
    }

    pub(super) fn departure(&self, scheme: &dyn Scheme, here: Instant) -> Way {
        let h = match self.plan.steps {
            Steps::Fixed(h) => h,
            Steps::Controlled { rtol, first, longest } => {
                first.unwrap_or_else(|| self.first_step(&here, rtol, scheme.order())).min(longest)
            }
        };
        Way {
            here,
            h,
            failures: 0,
            after_rejection: false,
            detour: None,
            to_kink: None,
            to_output: None,
            kinked: false,
            recent: 0.0,
        }
    }

    /// The length of the next step, and what it ends at.
    pub(super) fn aim(&self, way: &Way) -> Aim {
        if let Some(length) = way.to_kink {
            return Aim { length, target: None, broken: None };
        }
        let t = way.here.motion.t;
        if let Some(until) = way.to_output {
            return Aim { length: until - t, target: Some(until), broken: None };
        }
        let (mut length, mut target) = self.fitted(&way.here, way.h);
        if let Some(until) = way.detour.as_ref().and_then(|d| d.end_within(t, length)) {
            (length, target) = (until - t, Some(until));
        }
        let end = self.plan.end;
        let broken = target.filter(|t| *t < end && self.plan.breaks.contains(t));
        if broken.is_some() {
            length = before_break(length, self.start, end);
            target = None;
        }
        Aim { length, target, broken }
    }

    /// The step that does not pass the end or a break, and the time it must hit exactly.
    fn fitted(&self, here: &Instant, h: f64) -> (f64, Option<f64>) {
        let t = here.motion.t;
        let ahead = self.plan.breaks.iter().copied().find(|b| *b > t + SAME_INSTANT * self.plan.end.abs());
        // what changes at a break must not change within the step that ends there
        let (target, left) = match ahead.filter(|b| *b <= self.plan.end) {
            // no step follows on a break that is the end but for rounding
            Some(b) if self.vanishes(self.plan.end - b, b) => (self.plan.end, b - t - 4.0 * f64::EPSILON * b.abs()),
            Some(b) => (b, b - t - 4.0 * f64::EPSILON * b.abs()),
            None => (self.plan.end, self.plan.end - t),
        };
        if let Steps::Fixed(grid) = self.plan.steps {
            return self.on_grid(t, h, grid, target, left);
        }
        if h >= left * (1.0 - SAME_LENGTH) {
            (left, Some(target))
        } else if h > 0.5 * left {
            // two equal steps instead of one and a splinter
            (0.5 * left, None)
        } else {
            (h, None)
        }
    }

    /// To the next multiple of the fixed step, or to a break or the end before it.
    fn on_grid(&self, t: f64, h: f64, grid: f64, target: f64, left: f64) -> (f64, Option<f64>) {
        let next = match &self.plan.ends {
            Some(ends) => ends.iter().copied().find(|e| !self.vanishes(e - t, t)).unwrap_or(target),
            None => self.start + grid * (((t - self.start) / grid + ON_GRID).floor() + 1.0),
        };
        let cut = next >= target - SAME_LENGTH * grid;
        let aim = if cut { target } else { next };
        if h < (aim - t) * (1.0 - ON_GRID) {
            (h, None)
        } else if cut && left < target - t {
            // a whole step would end behind the break
            (left, Some(aim))
        } else if (aim - t - grid).abs() < SAME_LENGTH * grid {
            // whole steps have one length, so that factorisations and histories stay
            (grid, Some(aim))
        } else {
            (aim - t, Some(aim))
        }
    }
}
