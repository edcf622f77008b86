//! Outputs: within steps, and at their ends.
use super::super::way::{Aim, Verdict, Way, active};
use super::super::{Equations, Scheme, Step};
use super::Driver;
use crate::error::Result;
use crate::run::Counts;

impl Driver<'_, '_, '_> {
    /// A step that is good enough may hold outputs where the curve between its ends is not: then it ends at the first of them.
    pub(super) fn at_outputs(
        &mut self,
        judged: Verdict,
        eq: &Equations<'_, f64>,
        way: &mut Way,
        scheme: &mut dyn Scheme,
        aim: &Aim,
        counts: &mut Counts,
    ) -> Verdict {
        self.inside.clear();
        let (Verdict::Accepted(step, _, allowed), Some(times)) = (&judged, &self.plan.outputs) else { return judged };
        let end = aim.target.unwrap_or(step.end.motion.t);
        let inside: Vec<f64> = times[self.next_output..].iter().copied().take_while(|t| *t < end).collect();
        if inside.is_empty() {
            return judged;
        }
        match self.interpolated(eq, way, scheme, (step, aim.length, *allowed), &inside, counts) {
            Ok(None) => judged,
            Ok(Some(t)) => Verdict::Cut(t),
            Err(error) => Verdict::of_error(error),
        }
    }

    /// The instants of outputs within a step, up to the first one that is not accurate.
    fn interpolated(
        &mut self,
        eq: &Equations<'_, f64>,
        way: &mut Way,
        scheme: &mut dyn Scheme,
        (step, h, allowed): (&Step, f64, f64),
        times: &[f64],
        counts: &mut Counts,
    ) -> Result<Option<f64>> {
        let scheme = active(&mut way.detour, scheme);
        let start = way.here.motion.t;
        let fractions: Vec<f64> = times.iter().map(|t| (t - start) / h).collect();
        let between = scheme.outputs(eq, &way.here, step, h, &fractions, counts)?;
        for (one, t) in between.into_iter().zip(times) {
            counts.add("interpolations", 1);
            let mut m = one.motion;
            m.t = *t;
            let instant = eq.consistent(m, counts)?;
            if let Some(slope) = one.slope.filter(|_| allowed.is_finite() && !self.vanishes(t - start, *t)) {
                let off: Vec<f64> = instant.acceleration.iter().zip(&slope).map(|(a, s)| a - s).collect();
                let speed = self.speed.max(self.scaled(&instant.motion.rate));
                let size = |filtered: bool| -> Result<f64> {
                    let error = scheme.misfit(h, &off, filtered)?;
                    Ok(error.map_or(0.0, |e| self.size(&e, speed, scheme.rate_time(h))))
                };
                if size(false)? > allowed && size(true)? > allowed {
                    return Ok(Some(*t));
                }
            }
            self.inside.push(instant);
        }
        Ok(None)
    }

    /// Another step, which ends at an output.
    pub(super) fn cut(&mut self, way: &mut Way, t: f64, counts: &mut Counts) -> bool {
        counts.add("steps to outputs", 1);
        self.sides.iter_mut().for_each(super::Sides::give_up);
        (way.to_kink, way.to_output) = (None, Some(t));
        true
    }

    /// Outputs up to the end of the step, then the memory of the laws.
    pub(super) fn record(&mut self, eq: &Equations<'_, f64>, step: &mut Step, counts: &mut Counts) {
        for instant in std::mem::take(&mut self.inside) {
            self.next_output += 1;
            self.put(instant);
        }
        eq.remember(&mut step.end.motion, counts);
        let end = step.end.motion.t;
        let at_end = match &self.plan.outputs {
            None => 1,
            Some(times) => times[self.next_output..].iter().take_while(|t| **t <= end).count(),
        };
        self.next_output += if self.plan.outputs.is_some() { at_end } else { 0 };
        for _ in 0..at_end {
            self.put(step.end.clone());
        }
    }
}
