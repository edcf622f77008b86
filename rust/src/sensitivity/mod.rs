//! Gradients of a motion: the derivative of the discrete solution, forwards along directions and backwards, of ALI3-P, of
//! generalised-alpha, of the explicit Runge-Kutta method of order eight, of Radau IIA of order five and of backward differences.
//!
//! Steps, iteration counts and multiplier updates are those of the motion itself: every step is the solution of three implicit
//! systems (`integrate::ali3p`, `alpha`), each differentiated by the implicit function theorem with the matrices of the step, or a
//! row of explicit stages (`runge_kutta`), or stages that are solved for together (`stages`).
//!
//! | file | |
//! |---|---|
//! | `quantity`, `reactions` | what can be read of an instant, over any number type |
//! | `start` | the first instant and its derivative: loops closed, rates consistent, accelerations |
//! | `march` | the motion itself, step by step |
//! | `kinks` | where a motion has no derivative |
//! | `stretches` | the equations between kinks of laws |
//! | `alpha` | a step of generalised-alpha as equations |
//! | `runge_kutta` | a step of the explicit method as equations |
//! | `stages` | stages that are solved for: their equations, one linear system for all of a step |
//! | `closing` | what a step does at its end |
//! | `bdf` | the history of "bdf": what makes the base of its stage, and moves on |
//! | `direct/` | all directions along with the motion |
//! | `adjoint/` | the steps backwards, with checkpoints |
//! | `power/` | the virtual power of a step and its derivative by everything |
//! | `tape` | numbers that remember where they come from |
pub mod direction;
pub mod local_direction;

pub mod adjoint;
mod alpha;
pub mod bdf;
mod closing;
pub mod direct;
pub mod kinks;
pub mod march;
mod power;
pub mod quantity;
mod reactions;
pub mod runge_kutta;
pub mod stages;
pub mod start;
pub mod stretches;

use std::sync::Arc;

use crate::error::{Error, Result};
use crate::run::Counts;

use crate::integrate::bdf::record::Kind;
use crate::integrate::kept::KeptSteps;
use crate::integrate::kinks::Smooth;
use crate::integrate::{Equations, Instant, Motion, before_break};
use march::{Here, KeptMotion, Rule};

/// One direction dx/dp of the numbers, sparse.
pub type Direction = Vec<(usize, f64)>;

/// What is run: times of all instants, the first one that of the start.
#[derive(Clone)]
pub struct Plan {
    pub times: Vec<f64>,
    pub rule: Rule,
    pub follow: Follow,
    /// times of steps after which the scheme starts anew, because a load or a drive is not smooth there; what jumps belongs to what follows
    pub breaks: Vec<f64>,
    /// stretches between kinks of laws, where steps end and the scheme starts anew; empty: no law has any
    pub smooth: Vec<Smooth>,
    /// how each step of "bdf" comes about
    pub kinds: Vec<Kind>,
    /// the way back keeps a motion of at most so many numbers whole; of a longer one checkpoints, as many as the root of its steps
    pub keep: usize,
    /// instants at which quantities are wanted, going forwards, zeros elsewhere; empty: at all
    pub read: Vec<bool>,
    /// quantities are also wanted inside the steps, at the nodes of the scheme's quadrature
    pub inner: bool,
    /// the run that chose the steps, where it kept them
    pub kept: Option<Arc<KeptMotion>>,
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

    /// The steps that the motion from here was made with, and their work; none where it is to be made.
    pub fn kept_from(&self, eq: &Equations<'_, f64>, here: &Here, counts: &mut Counts) -> Option<&KeptSteps> {
        let kept = self.kept.as_ref().filter(|k| k.serves(eq, self, here))?;
        counts.merge(&kept.steps.counts);
        Some(&kept.steps)
    }

    /// Are quantities wanted at instant i?
    pub fn reads(&self, i: usize) -> bool {
        self.read.get(i).copied().unwrap_or(true)
    }

    /// Rows of values: those of all instants, then those of the nodes inside all steps.
    pub fn n_values(&self) -> usize {
        self.times.len() + self.n_steps() * self.n_inner()
    }

    /// Nodes inside a step.
    pub fn n_inner(&self) -> usize {
        if self.inner { self.rule.n_inner() } else { 0 }
    }

    /// The first row of the nodes inside step i.
    pub fn inner_row(&self, i: usize) -> usize {
        self.times.len() + i * self.n_inner()
    }

    pub fn n_steps(&self) -> usize {
        self.times.len() - 1
    }

    /// Does the scheme start anew at this time?
    pub fn starts_anew(&self, t: f64) -> bool {
        self.breaks.contains(&t) || self.smooth.iter().skip(1).any(|s| s.from == t)
    }

    /// The length of step i.
    pub fn step(&self, i: usize) -> f64 {
        let (length, last) = (self.times[i + 1] - self.times[i], self.n_steps());
        if i + 1 < last && self.breaks.contains(&self.times[i + 1]) {
            return before_break(length, self.times[0], self.times[last]);
        }
        length
    }
}

/// The consistent first instant.
pub fn first(eq: &Equations<'_, f64>, start: Motion<f64>, counts: &mut Counts) -> Result<Instant> {
    eq.consistent(start, counts)
}
