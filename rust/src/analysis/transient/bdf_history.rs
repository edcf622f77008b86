//! What `bdf_bfgs` looks back on: instants at equal distances as seen from the present one, and the first of them.
use crate::error::{Error, Result};
use crate::run::Counts;

use super::explicit8::Explicit8;
use super::interpolate::quintic;
use super::{Equations, Instant, LocalError, Motion, Scheme};

/// Growth of the step that keeps formulas of order four stable at unequal steps.
pub const GROWTH: f64 = 1.25;
/// Error of a start step in characteristic lengths or radians.
const START_ERROR: f64 = 1e-10;
const MOST_DIVISIONS: u32 = 12;

/// Accepted instants before the present one, latest first.
#[derive(Default)]
pub struct History {
    pub past: Vec<Instant>,
    /// start steps are divided into 2^divisions
    divisions: u32,
}

/// A past motion: its increments from the present pose, and its rates.
pub struct Past {
    pub t: f64,
    pub theta: Vec<f64>,
    pub rate: Vec<f64>,
}

impl History {
    pub fn clear(&mut self) {
        *self = History::default();
    }

    /// The present first.
    pub fn seen_from(&self, eq: &Equations<'_, f64>, from: &Instant, h: f64) -> Vec<Past> {
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

    /// A step of order eight, divided until its own estimate is negligible.
    pub fn start(
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
}
