//! Another scheme for a while, where the rows lose rank.
use crate::run::Counts;

use super::{Equations, Instant, Scheme};

/// Parts of a step of order eight far from all its stages: there the pose is to lie.
const GAPS: [f64; 3] = [0.19, 0.45, 0.75];
/// The first step may differ from the one that the tolerance suggests by this factor.
const NEARLY: f64 = 3.0;

/// One long step to the other side of a singular pose, and others until it is left behind.
pub(super) struct Detour {
    pub scheme: Box<dyn Scheme>,
    until: f64,
    /// length of its first step
    pub length: f64,
    /// the step of the scheme that is left
    pub before: f64,
}

impl Detour {
    /// Across the pose that `here` is near to, None where there is none; `natural`: a step that the scheme could make.
    pub fn across(
        eq: &Equations<'_, f64>,
        here: &Instant,
        scheme: Box<dyn Scheme>,
        before: f64,
        natural: f64,
        counts: &mut Counts,
    ) -> Option<Detour> {
        // a failed factorisation is not a reason to go another way
        let ahead = eq.way_to_singular_pose(here, counts).ok()??;
        let length = GAPS
            .iter()
            .map(|gap| ahead / gap)
            .filter(|h| (natural / NEARLY..NEARLY * natural).contains(h))
            .min_by(|a, b| off(*a, natural).total_cmp(&off(*b, natural)))
            .unwrap_or(natural);
        counts.add("detours", 1);
        Some(Detour { scheme, until: here.motion.t + length, length, before })
    }

    /// The time at which it ends, where a step of this length would go beyond it.
    pub fn end_within(&self, t: f64, length: f64) -> Option<f64> {
        (t + length > self.until).then_some(self.until)
    }

    /// Whether the way around is behind; it goes on where it would end near the pose.
    pub fn is_behind(&mut self, eq: &Equations<'_, f64>, here: &Instant, counts: &mut Counts) -> bool {
        if here.motion.t < self.until {
            return false;
        }
        let near = eq.way_to_singular_pose(here, counts);
        if near.is_ok_and(|way| way.is_some()) {
            self.until += self.length;
            return false;
        }
        true
    }
}

fn off(h: f64, natural: f64) -> f64 {
    (h / natural).ln().abs()
}
