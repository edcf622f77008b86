//! Kinks that are passed again and again, and those of many states: laws are left as they are for a while, so that no motion is held up.
use crate::tolerances::steps::{CROWD_REST, KINK_AGAIN, KINK_CROWD, KINK_REST, LONGEST_REST};

/// Numbers of steps, by kink.
pub(super) struct Rests {
    /// for which a kink is ignored still
    left: Vec<usize>,
    /// how often it was
    often: Vec<u32>,
    /// that ended at it, fading with those that did not
    again: Vec<usize>,
    /// the same at kinks of states together, and how often they were too many
    crowd: usize,
    crowded: u32,
}

impl Rests {
    pub fn new(n: usize) -> Self {
        Rests { left: vec![0; n], often: vec![0; n], again: vec![0; n], crowd: 0, crowded: 0 }
    }

    /// A step ends at a kink.
    pub fn meet(&mut self, k: usize, is_of_state: bool) {
        self.again[k] += 2;
        self.crowd += 2 * usize::from(is_of_state);
    }

    /// Did more than half of the steps end at it for long?
    pub fn is_met_again(&self, k: usize) -> bool {
        self.again[k] > KINK_AGAIN
    }

    /// Are kinks of states more than steps?
    pub fn are_crowded(&self) -> bool {
        self.crowd > KINK_CROWD
    }

    pub fn begin(&mut self, k: usize) {
        (self.left[k], self.again[k]) = (KINK_REST << self.often[k].min(LONGEST_REST), 0);
        self.often[k] += 1;
    }

    pub fn begin_together(&mut self, all: &[usize]) {
        all.iter().for_each(|k| self.left[*k] = CROWD_REST << self.crowded.min(LONGEST_REST));
        (self.crowd, self.crowded) = (0, self.crowded + 1);
    }

    /// A step was made.
    pub fn pass(&mut self) {
        self.again.iter_mut().chain([&mut self.crowd]).for_each(|n| *n = n.saturating_sub(1));
    }

    /// Of a kink that rests, whether it does so after another step, at least while it is not left; None of others.
    pub fn goes_on(&mut self, k: usize, is_left: bool) -> Option<bool> {
        let left = self.left[k].checked_sub(1)?;
        self.left[k] = left.max(usize::from(!is_left));
        Some(self.left[k] > 0)
    }
}
