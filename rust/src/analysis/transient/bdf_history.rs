//! What `bdf_bfgs` looks back on, as seen from the present instant, and its first steps.
use crate::error::{Error, Result};
use crate::run::Counts;

use super::explicit8::Explicit8;
use super::{Equations, Instant, LocalError, Scheme, scaled_size};

/// Growth of the step that keeps formulas of order four stable at unequal steps.
pub const GROWTH: f64 = 1.25;
/// A step shorter than this part of a past one starts anew.
const WIDEST: f64 = 1.6;
/// Error of a start step in characteristic lengths or radians: for fixed steps, and over a tolerance for the motion.
const START_ERROR: f64 = 1e-10;
const OF_TOLERANCE: f64 = 1e-3;
const LEAST_ERROR: f64 = 1e-12;
/// Parts of a start step, and the shortest of them over its length.
const MOST_PARTS: u64 = 4096;
const SHORTEST: f64 = 1e-7;

/// Accepted instants before the present one, latest first.
pub struct History {
    pub past: Vec<Instant>,
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
        History { past: Vec::new(), start_error: rtol.map_or(START_ERROR, |r| (OF_TOLERANCE * r).max(LEAST_ERROR)) }
    }

    pub fn clear(&mut self) {
        self.past.clear();
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

    /// A step of order eight in as many parts as keep each part's own estimate negligible, and how many those were.
    pub fn start(
        &mut self,
        eq: &Equations<'_, f64>,
        from: &Instant,
        h: f64,
        counts: &mut Counts,
    ) -> Result<(Instant, u64)> {
        let scales = eq.scales();
        let scaled = |v: &[f64]| match v.iter().any(|v| v.is_nan()) {
            true => f64::INFINITY,
            false => scaled_size(v, &scales),
        };
        let (rate, acceleration) = (scaled(&from.motion.rate), scaled(&from.acceleration));
        let speed = rate.max(acceleration.sqrt());
        // an error of the rates counts for the time of the motion
        let time = if speed > 0.0 { h.max(1.0 / speed) } else { h };
        let size = |e: &LocalError| scaled(&e.position).max(time * scaled(&e.rate)) / self.start_error;
        let (mut scheme, mut here) = (Explicit8::default(), from.clone());
        let (mut parts, mut part, mut done) = (0, h, 0.0);
        while done < h {
            let left = h - done;
            let length = part.min(left);
            let made = scheme.step(eq, &here, length, true, counts);
            let error = match &made {
                Ok(step) => step.error.as_ref().map_or(f64::INFINITY, size),
                Err(_) => f64::INFINITY,
            };
            let wanted = length * (0.8 * error.max(1e-30).powf(-0.125)).clamp(0.1, 5.0);
            match made {
                Ok(step) if error <= 1.0 => {
                    here = step.end;
                    parts += 1;
                    counts.add("start steps", 1);
                    done = if length < left { done + length } else { h };
                    part = wanted;
                }
                Err(error) if length < SHORTEST * h => return Err(error),
                _ => part = wanted.min(0.5 * length),
            }
            if parts > MOST_PARTS || part < SHORTEST * h {
                return Err(too_fast(h / parts.max(1) as f64));
            }
        }
        here.motion.t = from.motion.t + h;
        Ok((here, parts))
    }
}

fn too_fast(part: f64) -> Error {
    Error::Convergence {
        message: format!(
            "the start of 'bdf-bfgs' needs steps below {part:.2e} s: something vibrates much faster than the step; \
             take a smaller step or another method"
        ),
        best: Vec::new(),
        residual: f64::NAN,
    }
}
