//! The steps of a run as they were made and solved, kept for those who differentiate it.
use crate::run::Counts;

use super::Instant;
use super::bdf::record::Recorded;
use super::explicit8::RecordedStage;

/// What a scheme made a step of: its stages, and the history of a multistep method.
pub struct Parts {
    pub stages: Vec<RecordedStage>,
    pub history: Option<Recorded>,
}

pub struct KeptStep {
    pub h: f64,
    pub parts: Parts,
    pub end: Instant,
    /// memories before laws march theirs
    pub memory: Vec<f64>,
    /// where the scheme then started anew
    pub anew: Option<Instant>,
}

/// All steps of a run, and its work.
pub struct KeptSteps {
    pub start: Instant,
    pub steps: Vec<KeptStep>,
    pub counts: Counts,
}

impl KeptSteps {
    pub fn from(start: &Instant) -> Self {
        KeptSteps { start: start.clone(), steps: Vec::new(), counts: Counts::default() }
    }
}
