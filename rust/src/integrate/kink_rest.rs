//! Kinks that are passed again and again: laws are left as they are for a while, so that no motion is held up.
use crate::tolerances::steps::{KINK_AGAIN, KINK_REST, LONGEST_REST};

/// Numbers of steps, by kink.
pub(super) struct Rests {
    /// for which a kink is ignored still
    left: Vec<usize>,
    /// how often it was
    often: Vec<u32>,
    /// that ended at it, fading with those that did not
    again: Vec<usize>,
}

impl Rests {
    pub fn new(n: usize) -> Self {
        Rests { left: vec![0; n], often: vec![0; n], again: vec![0; n] }
    }

    /// A step ends at a kink.
    pub fn meet(&mut self, k: usize) {
        self.again[k] += 2;
    }

    /// Did more than half of the steps end at it for long?
    pub fn is_met_again(&self, k: usize) -> bool {
        self.again[k] > KINK_AGAIN
    }

    pub fn begin(&mut self, k: usize) {
        (self.left[k], self.again[k]) = (KINK_REST << self.often[k].min(LONGEST_REST), 0);
        self.often[k] += 1;
    }

    /// A step was made.
    pub fn pass(&mut self) {
        self.again.iter_mut().for_each(|n| *n = n.saturating_sub(1));
    }

    /// Of a kink that rests, whether it does so after another step, at least while it is not left; None of others.
    pub fn goes_on(&mut self, k: usize, is_left: bool) -> Option<bool> {
        let left = self.left[k].checked_sub(1)?;
        self.left[k] = left.max(usize::from(!is_left));
        Some(self.left[k] > 0)
    }
}
