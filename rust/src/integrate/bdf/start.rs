//! Equal first steps without a tangent: each of order eight, in as many parts as keep its own error negligible, since orders one to
//! three at full step would leave a global order of two.
use crate::error::{Error, Result};
use crate::run::Counts;
use crate::tolerances::steps::{FIXED_SOLVED, NOISE_SHARE};

use super::super::explicit8::Explicit8;
use super::super::{Equations, Instant, LocalError, Motion, Scheme, Step, scaled_size};

/// Parts of a start step.
const MOST_PARTS: usize = 4096;

/// Steps of order eight that each keep a share of the tolerance.
pub struct Start {
    /// error of a part, characteristic lengths or radians
    allowed: f64,
    /// the tolerance over it
    strict: f64,
    /// starts of the parts of the last step
    parts: Vec<Instant>,
}

impl Start {
    pub fn new(rtol: Option<f64>) -> Self {
        let allowed = rtol.map_or(FIXED_SOLVED, |r| (NOISE_SHARE * r).max(FIXED_SOLVED));
        Start { allowed, strict: rtol.map_or(1.0, |r| r / allowed), parts: Vec::new() }
    }

    /// How many times an error counts.
    pub fn strict(&self) -> f64 {
        self.strict
    }

    /// Whether the last step was made at once.
    pub fn undivided(&self) -> bool {
        self.parts.len() == 1
    }

    /// The motion at a time within the last step: by a part that ends there, whatever happens within the step.
    pub fn between(&self, eq: &Equations<'_, f64>, t: f64, counts: &mut Counts) -> Result<Option<Motion<f64>>> {
        let Some(part) = self.parts.iter().rev().find(|p| p.motion.t < t) else {
            return Ok(self.parts.first().map(|p| p.motion.clone()));
        };
        let made = Explicit8::default().step(eq, part, t - part.motion.t, false, counts)?;
        Ok(Some(made.end.motion))
    }

    /// A step of length h, and the errors of its parts, added up.
    pub fn step(&mut self, eq: &Equations<'_, f64>, from: &Instant, h: f64, counts: &mut Counts) -> Result<Step> {
        let measure = Measure::new(eq, from, h);
        let (mut scheme, mut here) = (Explicit8::default(), from.clone());
        let none = vec![0.0; eq.n()];
        let mut whole = LocalError { position: none.clone(), rate: none, state: vec![0.0; measure.states.len()] };
        let (mut part, mut done) = (h, 0.0);
        self.parts.clear();
        while done < h {
            let left = h - done;
            let length = part.min(left);
            let made = scheme.step(eq, &here, length, true, counts);
            let size = match &made {
                Ok(step) => step.error.as_ref().map_or(f64::INFINITY, |e| measure.of(e) / self.allowed),
                Err(_) => f64::INFINITY,
            };
            let wanted = length * (0.8 * size.max(f64::MIN_POSITIVE).powf(-0.125)).clamp(0.1, 5.0);
            match made {
                Ok(step) if size <= 1.0 => {
                    self.parts.push(std::mem::replace(&mut here, step.end));
                    if let Some(e) = &step.error {
                        measure.add(&mut whole, e);
                    }
                    counts.add("start steps", 1);
                    done = if length < left { done + length } else { h };
                    part = wanted;
                }
                Err(error) if length < f64::EPSILON.sqrt() * h => return Err(error),
                _ => part = wanted.min(0.5 * length),
            }
            if self.parts.len() > MOST_PARTS || part < f64::EPSILON.sqrt() * h {
                return Err(too_fast(part));
            }
        }
        here.motion.t = from.motion.t + h;
        Ok(Step { end: here, error: Some(whole) })
    }
}

/// Sizes of errors in characteristic lengths or radians.
struct Measure {
    scales: Vec<f64>,
    states: Vec<f64>,
    /// an error of the rates counts for the time of the motion
    time: f64,
}

impl Measure {
    fn new(eq: &Equations<'_, f64>, from: &Instant, h: f64) -> Self {
        let scales = eq.scales();
        let speed = or_infinite(&from.motion.rate, &scales).max(or_infinite(&from.acceleration, &scales).sqrt());
        let time = if speed > 0.0 { h.max(1.0 / speed) } else { h };
        Measure { scales, states: eq.state_scales(), time }
    }

    fn of(&self, e: &LocalError) -> f64 {
        let rate = self.time * or_infinite(&e.rate, &self.scales);
        or_infinite(&e.position, &self.scales).max(rate).max(or_infinite(&e.state, &self.states))
    }

    /// Errors of one more part, rates by what they move.
    fn add(&self, to: &mut LocalError, e: &LocalError) {
        let add = |to: &mut [f64], factor: f64, errors: &[f64]| {
            to.iter_mut().zip(errors).for_each(|(a, e)| *a += factor * e.abs());
        };
        add(&mut to.position, 1.0, &e.position);
        add(&mut to.position, self.time, &e.rate);
        add(&mut to.state, 1.0, &e.state);
    }
}

fn or_infinite(v: &[f64], scales: &[f64]) -> f64 {
    if v.iter().any(|v| v.is_nan()) { f64::INFINITY } else { scaled_size(v, scales) }
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
