//! What a run is asked for, and what comes back.
use std::sync::atomic::{AtomicU64, Ordering};

use super::Instant;
use super::kept::KeptSteps;
use super::kinks::AtKinks;
use crate::tolerances::motion::SAFETY;

/// The next step over the last one, at least.
const SHRINK: f64 = 0.2;

/// How steps are chosen.
#[derive(Debug, Clone, Copy)]
pub enum Steps {
    Fixed(f64),
    /// sum of the local errors of positions (characteristic lengths, radians) and of rates (over the largest rate)
    Controlled {
        rtol: f64,
        first: Option<f64>,
        longest: f64,
    },
}

impl Steps {
    pub(super) fn tolerance(&self) -> Option<f64> {
        match self {
            Steps::Fixed(_) => None,
            Steps::Controlled { rtol, .. } => Some(*rtol),
        }
    }

    /// The next step by a scheme's own proposal; one that was cut short for an output or the end says little.
    pub(super) fn proposed(&self, wanted: f64, length: f64, factor: f64) -> f64 {
        let Steps::Controlled { longest, .. } = *self else {
            return self.longest();
        };
        let next = length * factor;
        (if length < 0.5 * wanted { next.max(wanted * factor.min(1.0)) } else { next }).min(longest)
    }

    pub(super) fn next(&self, wanted: f64, length: f64, size: f64, power: f64, growth: f64) -> f64 {
        let Steps::Controlled { longest, .. } = *self else {
            return self.longest();
        };
        let factor = (SAFETY * size.max(f64::MIN_POSITIVE).powf(-1.0 / power)).clamp(SHRINK, growth);
        let next = length * factor;
        // a step that was cut short says little about longer ones
        (if length < wanted { next.max(wanted * factor.min(1.0)) } else { next }).min(longest)
    }

    pub(super) fn longest(&self) -> f64 {
        match self {
            Steps::Fixed(h) => *h,
            Steps::Controlled { longest, .. } => *longest,
        }
    }
}

pub struct Plan {
    pub end: f64,
    pub steps: Steps,
    /// None: every accepted step
    pub outputs: Option<Vec<f64>>,
    /// times at which a step must end and histories start anew, ascending
    pub breaks: Vec<f64>,
    pub max_steps: usize,
    /// steps are solved to rounding and kept, at most so many
    pub kept: Option<usize>,
    /// steps end at kinks of laws to rounding, fixed ones too: for derivatives; without it controlled steps end there within their tolerance
    pub exact_kinks: bool,
    /// ends of fixed steps, in place of a grid
    pub ends: Option<Vec<f64>>,
    /// how many tolerances the errors may add up to of schemes that hold that of a unit of time: where what they add up to does not
    /// last, the error of the motion is one (`share`)
    pub share: f64,
}

#[derive(Debug, Clone)]
pub enum End {
    Finished,
    Interrupted,
    /// when, and why
    Stopped {
        t: f64,
        message: String,
    },
}

/// An instant, and the coordinates of all joints (`Equations::joint_coordinates`), angles continuous over turns.
pub struct Output {
    pub instant: Instant,
    pub joints: Vec<f64>,
}

pub struct Run {
    pub outputs: Vec<Output>,
    /// times of all accepted steps, the start included
    pub steps: Vec<f64>,
    /// orders of all accepted steps (`Scheme::formula`)
    pub formulas: Vec<i32>,
    /// estimated local error of every step over its tolerance
    pub local: Vec<f64>,
    pub rejected: usize,
    /// where they were asked for, and the scheme that was asked for made them all
    pub kept: Option<KeptSteps>,
    /// of steps that end at kinks to rounding
    pub at_kinks: AtKinks,
    pub end: End,
    pub last: Output,
}

/// Progress as a part of the whole, readable from another thread.
#[derive(Debug, Default)]
pub struct Progress(AtomicU64);

impl Progress {
    pub(super) fn set(&self, part: f64) {
        self.0.store(part.to_bits(), Ordering::Relaxed);
    }

    pub fn get(&self) -> f64 {
        f64::from_bits(self.0.load(Ordering::Relaxed))
    }
}
