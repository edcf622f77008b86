//! Gradients of a motion: the derivative of the discrete solution of ALI3-P, forwards along directions and backwards.
//!
//! Steps, iteration counts and multiplier updates are those of the motion itself: every step is the solution of three linear-implicit
//! systems (`transient::ali3p`), each differentiated by the implicit function theorem with the matrices of the step.
//!
//! | file | |
//! |---|---|
//! | `quantity` | what can be read of an instant, over any number type |
//! | `start` | the first instant and its derivative: loops closed, rates consistent, accelerations |
//! | `direct` | all directions along with the motion |
//! | `adjoint` | the steps backwards, with checkpoints |
//! | `tape` | numbers that remember where they come from |
pub mod adjoint;
pub mod direct;
pub mod quantity;
pub mod start;
pub mod tape;

use crate::error::{Error, Result};
use crate::run::{Cancel, Counts};

use super::transient::ali3p::{Record, Weight};
use super::transient::{Equations, Instant, Motion};

/// One direction dx/dp of the numbers, sparse.
pub type Direction = Vec<(usize, f64)>;

/// What is run: times of all instants, the first one that of the start.
#[derive(Debug, Clone)]
pub struct Plan {
    pub times: Vec<f64>,
    pub weight: Weight,
    pub follow: Follow,
    /// the way back keeps a motion of at most so many numbers whole; of a longer one checkpoints, as many as the root of its steps
    pub keep: usize,
}

/// What the first instant follows besides closing its loops by the smallest change.
#[derive(Debug, Clone, Default)]
pub struct Follow {
    /// offsets of two-point joints follow the drawing
    pub drawn: bool,
    /// rates follow the bodies' given velocities
    pub velocities: bool,
    /// tree increments per direction, those of an equilibrium that moves along; empty: none
    pub shift: Vec<Vec<f64>>,
}

impl Plan {
    /// Steps must go forwards.
    pub fn check(&self) -> Result<()> {
        if self.times.is_empty() || !self.times.is_sorted_by(|a, b| a < b) {
            return Err(Error::model("the times of the steps must increase"));
        }
        Ok(())
    }

    pub fn n_steps(&self) -> usize {
        self.times.len() - 1
    }

    pub fn step(&self, i: usize) -> f64 {
        self.times[i + 1] - self.times[i]
    }
}

/// The next instant, memories included, and how it came about.
pub fn advance(
    eq: &Equations<'_, f64>,
    plan: &Plan,
    i: usize,
    from: &Instant,
    cancel: &Cancel,
    counts: &mut Counts,
) -> Result<(Instant, Record)> {
    cancel.check()?;
    let (mut end, record) = eq
        .ali3p_step(from, plan.step(i), plan.weight, counts)
        .map_err(|e| at_time(e, from.motion.t))?;
    end.motion.t = plan.times[i + 1];
    eq.remember(&mut end.motion, counts);
    counts.add("steps", 1);
    Ok((end, record))
}

fn at_time(error: Error, t: f64) -> Error {
    match error {
        Error::Convergence {
            message,
            best,
            residual,
        } => Error::Convergence {
            message: format!("at t = {t} s {message}; take smaller steps"),
            best,
            residual,
        },
        other => other,
    }
}

/// The consistent first instant.
pub fn first(eq: &Equations<'_, f64>, start: Motion<f64>, counts: &mut Counts) -> Result<Instant> {
    eq.consistent(start, counts)
}
