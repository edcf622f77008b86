//! Whether a motion that passed near a singular pose goes on in the direction in which it came.
//!
//! Two branches of the motion meet in such a pose, and both keep all constraints and the energy. Rates and accelerations far enough
//! before and behind it tell them apart: on one branch v1 - v0 = (t1 - t0) (a0 + a1)/2 + O((t1 - t0)^3), from one branch to the other
//! the rates turn by as much as they are. A linkage that only comes near to such a pose turns as quickly in earnest; what decides is
//! whether the accelerations of the steps explain it, or rounding could have done it.
use crate::run::Counts;

use super::singular::LosingRank;
use super::{Equations, Instant, Motion, scaled_size};
use crate::tolerances::singular_poses::{COLLAPSED, NEAR, NOISE, TURNED};

/// The hold falls at most so much faster than the motion moves.
const STEEPEST: f64 = 4.0;
/// A step may move by this part of the hold before it is looked at again.
const UNSEEN: f64 = 0.1;
/// Growth of the rates towards a pose that may be impossible to reach.
const QUICK: f64 = 3.0;
/// Part of the best hold below which two branches may be confused.
const CLOSE: f64 = 1e-2;
/// Part of the best hold from which on rounding is no greater than elsewhere.
const FIRM: f64 = 0.5;
/// Growth of the rates towards a pose that some motion still passes.
const PASSABLE: f64 = 10.0;

/// What was recorded until an instant.
#[derive(Debug, Clone, Copy)]
pub(super) struct Mark {
    pub outputs: usize,
    pub next_output: usize,
    pub steps: usize,
}

/// The last instant before a region near a singular pose.
pub(super) struct Shore {
    pub instant: Instant,
    pub mark: Mark,
    /// the step that was made from here
    pub h: f64,
    /// the smallest hold since, and where
    least: f64,
    pose: Motion<f64>,
    /// by a step that led across the pose
    crossed: bool,
    /// changes of the rates that the accelerations of single steps do not explain
    unexplained: Vec<f64>,
}

/// How firmly the rows hold along the motion.
pub(super) struct Watch {
    scales: Vec<f64>,
    active: bool,
    best: f64,
    pub hold: f64,
    moved: f64,
    pub shore: Option<Shore>,
    /// how often the pose was crossed again
    pub again: usize,
    /// no crossing before this time
    pub own_until: f64,
}

/// What a step near a singular pose was.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Seen {
    Sound,
    /// the direction behind a singular pose is not that before it
    Turned,
    /// rates grow beyond all bounds towards a pose that cannot be reached
    Impossible,
}

impl Watch {
    pub fn new(eq: &Equations<'_, f64>, start: &Instant, counts: &mut Counts) -> Self {
        let active = eq.constrained() && eq.position_rows().contains(&true);
        let hold = if active { eq.hold(&start.motion, counts) } else { f64::INFINITY };
        Watch {
            scales: eq.scales(),
            active,
            best: hold,
            hold,
            moved: 0.0,
            shore: None,
            again: 0,
            own_until: f64::NEG_INFINITY,
        }
    }

    /// Something jumps here: what was before says nothing of what follows.
    pub fn forget(&mut self) {
        self.shore = None;
    }

    /// What rounding makes of rates here, where the rows hold less firmly than they have done.
    pub fn noise(&self) -> f64 {
        let weak = self.active && self.hold < FIRM * self.best;
        if weak { noise_of_rates(self.hold) } else { 0.0 }
    }

    /// Is such a step next to nothing beside that from the shore?
    pub fn collapsed(&self, h: f64) -> bool {
        self.shore.as_ref().is_some_and(|shore| h < COLLAPSED * shore.h)
    }

    /// Back to the shore.
    pub fn return_to(&mut self, eq: &Equations<'_, f64>, here: &Instant, counts: &mut Counts) {
        self.shore = None;
        self.again += 1;
        self.moved = 0.0;
        self.hold = eq.hold(&here.motion, counts);
    }

    /// The hold at `here`, where it may be small enough for a pose within `reach`; else None.
    pub fn near(&mut self, eq: &Equations<'_, f64>, here: &Instant, reach: f64, counts: &mut Counts) -> Option<f64> {
        let most = STEEPEST * reach;
        if !self.active || self.hold - STEEPEST * self.moved > most {
            return None;
        }
        if self.moved > 0.0 {
            self.hold = eq.hold(&here.motion, counts);
            self.moved = 0.0;
        }
        (self.hold <= most).then_some(self.hold)
    }

    /// A step was made; `crossed`: it was to lead across a singular pose, so that its ends are far from it.
    pub fn see(
        &mut self,
        eq: &Equations<'_, f64>,
        (from, end): (&Instant, &Instant),
        (mark, crossed): (Mark, bool),
        counts: &mut Counts,
    ) -> Seen {
        if !self.active {
            return Seen::Sound;
        }
        if crossed && self.shore.is_none() {
            let (instant, h) = (from.clone(), end.motion.t - from.motion.t);
            let unexplained = vec![0.0; self.scales.len()];
            self.shore =
                Some(Shore { instant, mark, h, least: self.hold, pose: from.motion.clone(), crossed, unexplained });
        }
        if let Some(shore) = &mut self.shore {
            shore.crossed |= crossed;
            let miss = unexplained(from, end);
            shore.unexplained.iter_mut().zip(miss).for_each(|(sum, m)| *sum += m);
        }
        self.moved += scaled_size(&eq.difference(&from.motion, &end.motion), &self.scales);
        if self.moved < UNSEEN * self.hold {
            return Seen::Sound;
        }
        self.moved = 0.0;
        self.hold = eq.hold(&end.motion, counts);
        self.best = self.best.max(self.hold);
        let near = self.hold < NEAR * self.best;
        match (&mut self.shore, near) {
            (None, true) => {
                let (instant, h) = (from.clone(), end.motion.t - from.motion.t);
                let pose = end.motion.clone();
                self.shore = Some(Shore {
                    instant,
                    mark,
                    h,
                    least: self.hold,
                    pose,
                    crossed,
                    unexplained: unexplained(from, end),
                });
            }
            (Some(shore), true) if self.hold < shore.least => {
                shore.least = self.hold;
                shore.pose.clone_from(&end.motion);
                let suspect = self.hold < CLOSE * self.best && shore.quickens(&self.scales) > QUICK;
                if suspect && !eq.goes_beyond(end, self.hold, counts) {
                    return Seen::Impossible;
                }
            }
            (Some(shore), false) => {
                let passed = shore.crossed || shore.least < CLOSE * self.best;
                if passed && shore.turned(end, &self.scales) {
                    return Seen::Turned;
                }
                self.shore = None;
                self.again = 0;
            }
            _ => {}
        }
        Seen::Sound
    }

    /// The joints and drives that lose rank near `here`, None far from a singular pose.
    pub fn losing_rank(
        &self,
        eq: &Equations<'_, f64>,
        here: &Instant,
        counts: &mut Counts,
    ) -> Option<(f64, LosingRank)> {
        if !self.active {
            return None;
        }
        if let Some(shore) = &self.shore {
            return Some((shore.pose.t, eq.losing_rank(&shore.pose, counts)));
        }
        let near = eq.hold(&here.motion, counts) < NEAR * self.best;
        near.then(|| (here.motion.t, eq.losing_rank(&here.motion, counts)))
    }
}

impl Shore {
    /// The time from the shore to where the rows held least.
    pub fn pose_after(&self) -> f64 {
        self.pose.t - self.instant.motion.t
    }

    /// Rates where the rows held least, over those at the shore.
    fn quickens(&self, scales: &[f64]) -> f64 {
        let [there, here] = [&self.pose.rate, &self.instant.motion.rate].map(|v| scaled_size(v, scales));
        if here > 0.0 { there / here } else { 0.0 }
    }

    /// Is the pose one that a motion passes? Rates go on there as they are; towards one that cannot be reached they grow.
    pub fn is_passable(&self, scales: &[f64]) -> bool {
        self.quickens(scales) < PASSABLE
    }

    /// Do the rates differ from those before by more than the accelerations explain, and were they turned by rounding or at once?
    fn turned(&self, end: &Instant, scales: &[f64]) -> bool {
        let from = &self.instant;
        let whole = scaled_size(&from.motion.rate, scales).max(scaled_size(&end.motion.rate, scales));
        let much = |v: &[f64]| scaled_size(v, scales) > TURNED * whole;
        let by_rounding = noise_of_rates(self.least) > TURNED;
        much(&unexplained(from, end)) && (by_rounding || much(&self.unexplained))
    }
}

/// Rounding of rates over all rates, where the rows hold this firmly.
fn noise_of_rates(hold: f64) -> f64 {
    NOISE * f64::EPSILON / (hold * hold).max(f64::MIN_POSITIVE)
}

/// v1 - v0 - (t1 - t0) (a0 + a1)/2.
fn unexplained(from: &Instant, end: &Instant) -> Vec<f64> {
    let time = end.motion.t - from.motion.t;
    let slopes = from.acceleration.iter().zip(&end.acceleration).map(|(a, b)| 0.5 * (a + b));
    let changes = from.motion.rate.iter().zip(&end.motion.rate).map(|(a, b)| b - a);
    changes.zip(slopes).map(|(change, slope)| change - time * slope).collect()
}
