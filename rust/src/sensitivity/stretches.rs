//! Stretches of a motion between kinks of laws: in each of them laws are held on the sides on which the motion is.
//!
//! A stage that ends at a kink, or lies a rounding behind it, has the slopes of the side it belongs to; on the other side they are others,
//! and the derivative would lose its order.
use crate::integrate::Equations;
use crate::integrate::kinks::Smooth;
use crate::multibody::System;
use crate::multibody::assemble::Effects;

/// The systems of all stretches; the one system of a motion without kinks.
pub fn systems(system: &System, effects: Effects, smooth: &[Smooth]) -> Vec<System> {
    if smooth.is_empty() {
        return vec![system.clone()];
    }
    let eq = Equations::new(system, system.x.to_vec(), effects);
    let kinked = eq.kinked(false);
    smooth.iter().map(|s| eq.held(&kinked, &s.sides)).collect()
}

/// The equations of motion from each kink on.
pub struct Stretches<'a> {
    from: Vec<f64>,
    all: Vec<Equations<'a, f64>>,
}

impl<'a> Stretches<'a> {
    pub fn new(systems: &'a [System], effects: Effects, smooth: &[Smooth]) -> Self {
        Stretches {
            from: smooth.iter().skip(1).map(|s| s.from).collect(),
            all: systems.iter().map(|s| Equations::new(s, s.x.to_vec(), effects)).collect(),
        }
    }

    /// Of what follows a time.
    pub fn from(&self, t: f64) -> &Equations<'a, f64> {
        &self.all[self.from.partition_point(|from| *from <= t)]
    }

    pub fn first(&self) -> &Equations<'a, f64> {
        &self.all[0]
    }
}
