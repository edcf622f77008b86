//! Where a march stands, what it aims at, and what becomes of a step.
use crate::error::Error;

use super::detour::{Detour, FINEST};
use super::{Instant, Scheme, Step};

/// Where the march stands, and how it goes on.
pub struct Way {
    pub here: Instant,
    pub h: f64,
    pub failures: usize,
    pub after_rejection: bool,
    pub detour: Option<Detour>,
    /// the longest step of late, fading with time: shrinking steps do not hide what they shrink from
    pub recent: f64,
}

/// A step to try: its length, the time it hits exactly, the break it ends at.
pub struct Aim {
    pub length: f64,
    pub target: Option<f64>,
    pub broken: Option<f64>,
}

/// The smallest tolerance that the pose allows which a detour passes.
pub fn finest(way: &Way) -> f64 {
    way.detour.as_ref().map_or(0.0, |_| FINEST)
}

/// What makes the next step: the detour's scheme while there is one.
pub fn active<'s>(
    detour: &'s mut Option<Detour>,
    scheme: &'s mut dyn Scheme,
) -> &'s mut dyn Scheme {
    match detour {
        Some(d) => d.scheme.as_mut(),
        None => scheme,
    }
}

pub enum Verdict {
    Accepted(Box<Step>, f64),
    Rejected(f64, String),
    /// a slider turns after this part of the step
    Turned(f64),
    Fatal(Error),
}
