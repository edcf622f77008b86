//! What `bdf_bfgs` looks back on, as seen from the present instant, and its first steps.
use crate::error::{Error, Result};
use crate::run::Counts;

use super::explicit8::Explicit8;
use super::{Equations, Instant, LocalError, Motion, Scheme, scaled_size};

/// Growth of the step that keeps formulas of order four stable at unequal steps.
pub const GROWTH: f64 = 1.25;
/// A step shorter than this part of a past one starts anew.
const WIDEST: f64 = 1.6;
/// Error of a start step in characteristic lengths or radians: for fixed steps, and over a tolerance for the motion.
const START_ERROR: f64 = 1e-10;
const OF_TOLERANCE: f64 = 1e-3;
const LEAST_ERROR: f64 = 1e-12;
/// Parts of a start step, of all start steps between two steps of the method (four start it), and the shortest over its step.
const MOST_PARTS: usize = 4096;
const MOST_SPENT: usize = 16 * MOST_PARTS;
const SHORTEST: f64 = 1e-7;

/// Accepted instants before the present one, latest first.
pub struct History {
    pub past: Vec<Instant>,
    start_error: f64,
    /// starts of the parts of the last start step
    parts: Vec<Instant>,
    /// parts since the last step of the method
    spent: usize,
}

/// A start step.
pub struct Start {
    pub end: Instant,
    pub parts: usize,
    /// the errors of its parts, added up
    pub error: LocalError,
}

/// A past motion: its increments from the present pose, and its rates.
pub struct Past {
    pub t: f64,
    pub theta: Vec<f64>,
    pub rate: Vec<f64>,
    /// states of laws
    pub state: Vec<f64>,
}

impl History {
    pub fn new(rtol: Option<f64>) -> Self {
        let start_error = rtol.map_or(START_ERROR, |r| (OF_TOLERANCE * r).max(LEAST_ERROR));
        History { past: Vec::new(), start_error, parts: Vec::new(), spent: 0 }
    }

    pub fn clear(&mut self) {
        self.past.clear();
    }

    /// A step of the method was made.
    pub fn passed(&mut self) {
        self.spent = 0;
    }

    /// The motion at a time within the last start step: by a part that ends there, whatever happens within the step.
    pub fn between(&self, eq: &Equations<'_, f64>, t: f64, counts: &mut Counts) -> Result<Option<Motion<f64>>> {
        let Some(part) = self.parts.iter().rev().find(|p| p.motion.t < t) else {
            return Ok(self.parts.first().map(|p| p.motion.clone()));
        };
        let made = Explicit8::default().step(eq, part, t - part.motion.t, false, counts)?;
        Ok(Some(made.end.motion))
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
            state: eq.states(&p.motion),
        };
        std::iter::once(from).chain(&self.past).map(seen).collect()
    }

    /// A step of order eight in as many parts as keep each part's own estimate negligible.
    pub fn start(&mut self, eq: &Equations<'_, f64>, from: &Instant, h: f64, counts: &mut Counts) -> Result<Start> {
        let scales = eq.scales();
        let scaled = |v: &[f64]| match v.iter().any(|v| v.is_nan()) {
            true => f64::INFINITY,
            false => scaled_size(v, &scales),
        };
        let (rate, acceleration) = (scaled(&from.motion.rate), scaled(&from.acceleration));
        let speed = rate.max(acceleration.sqrt());
        // an error of the rates counts for the time of the motion
        let time = if speed > 0.0 { h.max(1.0 / speed) } else { h };
        let states = eq.state_scales();
        let of_states = |e: &LocalError| match e.state.iter().any(|z| z.is_nan()) {
            true => f64::INFINITY,
            false => scaled_size(&e.state, &states),
        };
        let size =
            |e: &LocalError| scaled(&e.position).max(time * scaled(&e.rate)).max(of_states(e)) / self.start_error;
        let (mut scheme, mut here) = (Explicit8::default(), from.clone());
        let none = vec![0.0; eq.n()];
        let mut whole = LocalError { position: none.clone(), rate: none, state: vec![0.0; states.len()] };
        let (mut part, mut done) = (h, 0.0);
        self.parts.clear();
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
                    self.parts.push(std::mem::replace(&mut here, step.end));
                    self.spent += 1;
                    if let Some(e) = &step.error {
                        // by the measure that the parts are held to
                        add_sizes(&mut whole.position, 1.0, &e.position);
                        add_sizes(&mut whole.position, time, &e.rate);
                        add_sizes(&mut whole.state, 1.0, &e.state);
                    }
                    counts.add("start steps", 1);
                    done = if length < left { done + length } else { h };
                    part = wanted;
                }
                Err(error) if length < SHORTEST * h => return Err(error),
                _ => part = wanted.min(0.5 * length),
            }
            if self.parts.len() > MOST_PARTS || self.spent > MOST_SPENT || part < SHORTEST * h {
                return Err(too_fast(part));
            }
        }
        here.motion.t = from.motion.t + h;
        Ok(Start { end: here, parts: self.parts.len(), error: whole })
    }
}

fn add_sizes(to: &mut [f64], factor: f64, errors: &[f64]) {
    to.iter_mut().zip(errors).for_each(|(a, e)| *a += factor * e.abs());
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
