//! Another scheme for a while, where the rows lose rank.
use crate::run::Counts;

use super::{Equations, Instant, Scheme};

/// Local errors below this drown in what the pose makes of rounding.
pub(super) const FINEST: f64 = 1e-10;

pub(super) struct Detour {
    pub scheme: Box<dyn Scheme>,
    until: f64,
    /// length of its first step
    pub length: f64,
    /// the step of the scheme that is left
    pub before: f64,
}

impl Detour {
    /// Around the pose that `here` is near to, None where there is none; `length`: a step that the scheme could make.
    pub fn around(
        eq: &Equations<'_, f64>,
        here: &Instant,
        scheme: Box<dyn Scheme>,
        before: f64,
        length: f64,
        counts: &mut Counts,
    ) -> Option<Detour> {
        if !is_near(eq, here, counts) {
            return None;
        }
        counts.add("detours", 1);
        Some(Detour {
            scheme,
            until: here.motion.t + length,
            length,
            before,
        })
    }

    /// It lasts until then at least.
    pub fn reach(&mut self, t: f64) {
        self.until = self.until.max(t);
    }

    /// The time at which it ends, where a step of this length would go beyond it.
    pub fn end_within(&self, t: f64, length: f64) -> Option<f64> {
        (t + length > self.until).then_some(self.until)
    }

    /// Whether the way around is behind; it goes on where it would end near the pose.
    pub fn is_behind(
        &mut self,
        eq: &Equations<'_, f64>,
        here: &Instant,
        counts: &mut Counts,
    ) -> bool {
        if here.motion.t < self.until {
            return false;
        }
        let near = is_near(eq, here, counts);
        if near {
            self.until += self.length;
        }
        !near
    }
}

/// What cannot be factorised is no reason to go another way.
fn is_near(eq: &Equations<'_, f64>, here: &Instant, counts: &mut Counts) -> bool {
    eq.near_singular_pose(here, counts).unwrap_or(false)
}
