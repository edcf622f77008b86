//! Which forces of connectors and loads act, and what of their tangents is wanted.
use crate::force::{AnyLaw, Class};
use crate::multibody::topology::{Connector, Topology};

/// What of a tangent is wanted.
#[derive(Debug, Clone, Copy)]
pub struct Wanted {
    pub tangent: bool,
    /// terms that are proportional to the force
    pub geometric: bool,
    pub damping: bool,
    /// slopes of the laws; harmonic balance takes them from the elements instead
    pub laws: bool,
    pub friction: bool,
    pub contact: bool,
}

impl Wanted {
    /// Forces alone, all of them.
    pub const FORCES: Wanted =
        Wanted { tangent: false, geometric: false, damping: true, laws: false, friction: true, contact: true };

    /// Slopes of springs and laws, without the terms that are proportional to their forces.
    pub const SLOPES: Wanted = Wanted { tangent: true, laws: true, ..Wanted::FORCES };

    /// The tangent of given forces, such as multipliers.
    pub const GEOMETRY: Wanted = Wanted { tangent: true, geometric: true, ..Wanted::FORCES };

    /// Does anything of a connector act? One whose effects are all left out is not looked at.
    pub(crate) fn acts(&self, c: &Connector) -> bool {
        c.k.is_some()
            || c.preload.is_some()
            || self.damping && c.c.is_some()
            || c.laws.iter().any(|l| self.law(l.law))
            || !c.functions.is_empty()
    }

    /// Connectors that have a law that acts and whose states have rates.
    pub(crate) fn with_state_rates(&self, topology: &Topology) -> Vec<usize> {
        let rated = |c: &Connector| c.laws.iter().any(|l| l.law.has_rates() && self.law(l.law));
        (0..topology.connectors.len()).filter(|i| rated(&topology.connectors[*i])).collect()
    }

    pub(crate) fn law(&self, law: AnyLaw) -> bool {
        match law.class() {
            Class::Friction => self.friction,
            Class::Contact => self.contact,
            Class::Spring => true,
        }
    }
}
