//! Where the driver stands between two steps, and what it decides about one.
use crate::error::Error;

use super::detour::{Detour, FINEST};
use super::{Equations, Instant, Motion, Scheme, Step};

/// Where the march stands, and how it goes on.
pub(super) struct Way {
    pub here: Instant,
    pub h: f64,
    pub failures: usize,
    pub after_rejection: bool,
    pub detour: Option<Detour>,
    /// the last step passed a kink of a law
    pub kinked: bool,
    /// the longest step of late, fading with time: shrinking steps do not hide what they shrink from
    pub recent: f64,
}

impl Equations<'_, f64> {
    /// A step in which no angle of a joint turns by half a turn, beyond which poses do not tell how far: v h + a h^2/2 <= 2.
    pub(super) fn half_turn(&self, here: &Instant) -> f64 {
        const TURN: f64 = 2.0;
        let nodes = self.topology().nodes.iter();
        let counted = nodes.filter(|n| !n.kind.is_modal() && n.kind.quaternion().is_none());
        let dofs = counted.flat_map(|n| n.first..n.first + n.n);
        let turning = dofs.filter(|d| self.topology().dofs[*d].freedom.rotation);
        turning.fold(f64::INFINITY, |h, d| {
            let (v, a) = (here.motion.rate[d].abs(), here.acceleration[d].abs());
            h.min(2.0 * TURN / (v + (v * v + 2.0 * a * TURN).sqrt()))
        })
    }
}

impl Equations<'_, f64> {
    /// Are there springs or couplers that continue angles from pose to pose?
    pub(super) fn remembers_turns(&self) -> bool {
        let topology = self.topology();
        !topology.tables.couplers.is_empty() || topology.connectors.iter().any(|c| c.turns.is_some())
    }

    /// Coordinates of the joints that a motion foretells from those before, by the mean of both rates.
    pub(super) fn foretold(&self, joints: &[f64], from: &Motion<f64>, to: &Motion<f64>) -> Vec<f64> {
        let half = 0.5 * (to.t - from.t);
        let rates = self.joint_rates(from).into_iter().zip(self.joint_rates(to));
        joints.iter().zip(rates).map(|(e, (v0, v1))| e + half * (v0 + v1)).collect()
    }
}

/// A step to try: its length, the time it hits exactly, the break it ends at.
pub(super) struct Aim {
    pub length: f64,
    pub target: Option<f64>,
    pub broken: Option<f64>,
}

/// The smallest tolerance that the pose allows which a detour passes.
pub(super) fn finest(way: &Way) -> f64 {
    way.detour.as_ref().map_or(0.0, |_| FINEST)
}

/// What makes the next step: the detour's scheme while there is one.
pub(super) fn active<'s>(detour: &'s mut Option<Detour>, scheme: &'s mut dyn Scheme) -> &'s mut dyn Scheme {
    match detour {
        Some(d) => d.scheme.as_mut(),
        None => scheme,
    }
}

pub(super) enum Verdict {
    /// with its local error over what it may be, and that
    Accepted(Box<Step>, f64, f64),
    Rejected(f64, String),
    /// a slider turns after this part of the step
    Turned(f64),
    Fatal(Error),
}
