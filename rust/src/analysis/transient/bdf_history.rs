//! What `bdf_bfgs` looks back on, as seen from the present instant, and its first steps.
use crate::error::{Error, Result};
use crate::run::Counts;

use super::explicit8::Explicit8;
use super::{Equations, Instant, LocalError, Scheme};

/// Growth of the step that keeps formulas of order four stable at unequal steps.
pub const GROWTH: f64 = 1.25;
/// A step shorter than this part of a past one starts anew.
const WIDEST: f64 = 1.6;
/// Error of a start step in characteristic lengths or radians: for fixed steps, and over a tolerance for the motion.
const START_ERROR: f64 = 1e-10;
const OF_TOLERANCE: f64 = 1e-3;
const MOST_DIVISIONS: u32 = 12;

/// Accepted instants before the present one, latest first.
pub struct History {
    pub past: Vec<Instant>,
    /// start steps are divided into 2^divisions
    divisions: u32,
    start_error: f64,
}

/// A past motion: its increments from the present pose, and its rates.
pub struct Past {
    pub t: f64,
    pub theta: Vec<f64>,
    pub rate: Vec<f64>,
}

impl History {
    pub fn new(rtol: Option<f64>) -> Self {
        History {
            past: Vec::new(),
            divisions: 0,
            start_error: rtol.map_or(START_ERROR, |r| (OF_TOLERANCE * r).max(START_ERROR)),
        }
    }

    pub fn clear(&mut self) {
        self.past.clear();
        self.divisions = 0;
    }

    /// Whether old distances would set the error of a step of length h: the polynomial through them is no better near its end
    /// than at their own length.
    pub fn too_wide(&self, from: &Instant, h: f64) -> bool {
        let times = std::iter::once(from).chain(&self.past).map(|p| p.motion.t);
        let times: Vec<f64> = times.collect();
        times.windows(2).any(|w| w[0] - w[1] > WIDEST * h)
    }

    /// The present first.
    pub fn seen_from(&self, eq: &Equations<'_, f64>, from: &Instant) -> Vec<Past> {
        let seen = |p: &Instant| Past {
            t: p.motion.t,
            theta: eq.difference(&from.motion, &p.motion),
            rate: p.motion.rate.clone(),
        };
        std::iter::once(from).chain(&self.past).map(seen).collect()
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
                    scaled(&e.position, 1.0) < self.start_error
                        && scaled(&e.rate, h) < self.start_error
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
                // a kink on the way says nothing about the next step
                self.divisions = self.divisions.saturating_sub(1);
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
