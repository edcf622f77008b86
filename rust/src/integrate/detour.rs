//! One long explicit step across a pose where the rows lose rank, its stages far from the pose.
use super::explicit8::Explicit8;
use super::{Equations, Scheme, scaled_size};
use crate::tolerances::constraints::CLOSED_ENOUGH;
use crate::tolerances::singular_poses::{FARTHEST_CROSSING, LUCK, NOISE};

/// Parts of a step of order eight far from all its stages: there the pose is to lie.
const GAPS: [f64; 3] = [0.45, 0.75, 0.19];
/// A crossing may be longer than the step that the scheme would make by this factor.
const LONGER: f64 = 1.1;
/// A step would end so near before the pose, over its length, that the next could not cross.
const SHORT_OF: f64 = 0.8;
/// Parts of the way to the pose to go before another crossing, where one is too long; other ones where the pose was crossed in vain.
const NEARER: [f64; 4] = [0.6, 0.45, 0.7, 0.3];
/// Steps that would end next to the pose are made shorter by this factor, and those before a crossing go this part of the way.
const SHORTER: f64 = 0.6;
/// So many distances of noise fit in the steps of schemes that step over the pose.
const STRIDE: f64 = 10.0;

/// One long step to the other side of a singular pose.
pub(super) struct Detour {
    pub scheme: Box<dyn Scheme>,
    pub until: f64,
    /// the part of the time to the pose after which a crossing is tried again
    pub nearer: f64,
    /// the step of the scheme that is left
    pub before: f64,
}

/// How a singular pose ahead is to be passed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Passage {
    /// by the scheme's own steps
    Own,
    /// by its own step of this length
    Shorter(f64),
    /// by a crossing of this length
    Crossing(f64),
}

/// Where the pose is to lie in another crossing of it, None after enough of them.
pub(super) fn again(times: usize) -> Option<f64> {
    GAPS.get(times).copied()
}

impl Detour {
    /// From t across the pose `ahead`; `again`: how often the pose was crossed in vain.
    pub fn of((t, ahead): (f64, f64), length: f64, before: f64, again: usize) -> Detour {
        let part = NEARER[again.min(NEARER.len() - 1)];
        Detour { scheme: Explicit8::across_singular_poses(), until: t + length, nearer: part * ahead, before }
    }

    /// The time at which it ends, where a step of this length would go beyond it.
    pub fn end_within(&self, t: f64, length: f64) -> Option<f64> {
        (t + length > self.until).then_some(self.until)
    }
}

/// What decides how a singular pose ahead is passed.
pub(super) struct Approach {
    /// time to the pose
    pub ahead: f64,
    /// the scheme's step
    pub h: f64,
    /// of the motion, characteristic lengths or radians
    pub speed: f64,
    /// how fast the rows lose their hold
    pub slope: f64,
    pub rtol: f64,
}

/// The hold at which what a scheme leaves of its rows makes of rates what a step may err.
pub(super) fn noisy(rtol: f64, rounding: f64) -> f64 {
    (NOISE * rounding / rtol.max(CLOSED_ENOUGH)).sqrt()
}

/// The way past a pose.
pub(super) fn passage(at: &Approach, scheme: &dyn Scheme) -> Passage {
    let Approach { ahead, h, .. } = *at;
    if scheme.crossing() == Some(true) {
        let crossing = GAPS.iter().map(|gap| ahead / gap).filter(|length| *length <= LONGER * h);
        return match crossing.fold(0.0, f64::max) {
            length if length > 0.0 => Passage::Crossing(length),
            _ if ahead > h / SHORT_OF => Passage::Own,
            _ => Passage::Shorter(SHORTER * ahead),
        };
    }
    let noise = noisy(at.rtol, scheme.rounding());
    if at.slope * h > STRIDE * noise {
        let next_to = (ahead - h).abs() * at.slope < 2.0 * noise;
        return if next_to { Passage::Shorter(SHORTER * h) } else { Passage::Own };
    }
    if at.speed * (ahead - h) > FARTHEST_CROSSING { Passage::Own } else { Passage::Crossing(ahead / GAPS[0]) }
}

impl Equations<'_, f64> {
    /// Does rounding count where steps of this length meet a singular pose? Longer ones hardly ever end or have a stage next to it.
    pub(super) fn minds_singular_poses(&self, rates: &[f64], h: f64, rtol: f64, rounding: f64) -> bool {
        scaled_size(rates, &self.scales()) * h < LUCK * noisy(rtol, rounding)
    }
}
