//! The steps of a run as they were made and solved, kept for those who differentiate it.
use crate::run::Counts;

use super::bdf::record::Recorded;
use super::explicit8::RecordedStage;
use super::plan::Run;
use super::{Instant, Scheme, Step};

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

impl Run {
    /// The step is kept, as far as there is room and its scheme tells what it was made of.
    pub(super) fn keep(
        &mut self,
        scheme: &mut dyn Scheme,
        step: &Step,
        (memory, h): (Option<Vec<f64>>, f64),
        most: Option<usize>,
    ) {
        let room = |k: &KeptSteps| most.is_some_and(|most| k.steps.len() < most);
        let (Some(mut kept), Some(memory)) = (self.kept.take().filter(room), memory) else { return };
        let Some(parts) = scheme.parts() else { return };
        kept.steps.push(KeptStep { h, parts, end: step.end.clone(), memory, anew: None });
        self.kept = Some(kept);
    }

    /// The scheme starts anew from this instant.
    pub(super) fn begun_anew(&mut self, after: Instant) -> Instant {
        if let Some(last) = self.kept.as_mut().and_then(|k| k.steps.last_mut()) {
            last.anew = Some(after.clone());
        }
        after
    }

    /// Back to an instant before: what is kept is no longer all of the run.
    pub(super) fn cut(&mut self, outputs: usize, steps: usize) {
        self.kept = None;
        self.outputs.truncate(outputs);
        self.steps.truncate(steps);
        self.local.truncate(steps - 1);
    }
}
