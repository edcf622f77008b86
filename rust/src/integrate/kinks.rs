//! Kinks of laws that a motion passes: distances from them, and the equations on one side of each.
//!
//! A step over a kink of a force or of the rate of a state loses its order, and so does its derivative. Forces are continuous, so that a
//! kink needs no jump of the motion or of its derivatives: steps that end there, of laws that are held on the side on which the motion
//! is, have the order of smooth ones. `sides` finds these steps.
use std::sync::Arc;

use crate::force::{Crossing, Side, Surface};
use crate::multibody::System;
use crate::multibody::connector::motion_of;
use crate::multibody::topology::{BoundFunction, BoundLaw, Connector, Owner};
use crate::run::Counts;
use crate::tolerances::matrices::ENTRY_ROUNDING;
use crate::tolerances::steps::JUMP;

use super::{Equations, Motion, scaled_size};

fn sharp<'l>(law: &'l BoundLaw, x: &'l [f64]) -> impl Iterator<Item = Surface> + 'l {
    law.law.surfaces(&x[law.x..law.x + law.law.n_params()]).into_iter().filter(Surface::is_sharp)
}

/// A sharp kink of a law.
#[derive(Debug, Clone, Copy)]
pub struct SharpKink {
    pub owner: Owner,
    /// of a function, whose force may jump there
    pub may_jump: bool,
    /// laws of effects that are left out do not act
    pub acts: bool,
    /// rounding of the distance: of a place or a state, and over the largest rate of the motion
    pub rounding: f64,
    pub rounding_of_rate: f64,
}

impl SharpKink {
    fn of_law(owner: Owner, crossing: Crossing, length: f64, state: f64) -> Self {
        let (rounding, rounding_of_rate) = match crossing {
            Crossing::Displacement => (length, 0.0),
            Crossing::Rate => (0.0, length),
            Crossing::State => (state, 0.0),
        };
        SharpKink {
            owner,
            may_jump: false,
            acts: true,
            rounding: ENTRY_ROUNDING * f64::EPSILON * rounding,
            rounding_of_rate: ENTRY_ROUNDING * f64::EPSILON * rounding_of_rate,
        }
    }
}

impl Equations<'_, f64> {
    /// Connectors with laws that act and have sharp kinks.
    fn kinked(&self) -> impl Iterator<Item = &Connector> {
        let wanted = self.effects.wanted();
        let has = move |c: &&Connector| {
            c.laws.iter().any(|l| wanted.law(l.law) && sharp(l, &self.x).next().is_some()) || !c.functions.is_empty()
        };
        self.topology().connectors.iter().filter(has)
    }

    /// Signed distances from all sharp kinks of laws, in the order of `held`; empty without any.
    pub fn kink_distances(&self, m: &Motion<f64>) -> Vec<f64> {
        let mut out = Vec::new();
        if self.kinked().next().is_none() {
            return out;
        }
        let mut m = m.clone();
        self.close_states(&mut m);
        let (placement, wanted) = (self.place(&m), self.effects.wanted());
        for c in self.kinked() {
            let moved = motion_of(self.topology(), &self.geometry, &placement, &self.x, c);
            for law in &c.laws {
                let ((u, v), z) = (moved[law.component], &m.memory[law.places()]);
                // a law that does not act has no kink to pass
                let acts = f64::from(u8::from(wanted.law(law.law)));
                out.extend(sharp(law, &self.x).map(|s| acts * s.distance(u, v, z)));
            }
            let (u, v): (Vec<f64>, Vec<f64>) = moved.into_iter().unzip();
            for f in &c.functions {
                out.extend(f.law.distances(m.t, &f.own(Some(&u)), &f.own(Some(&v)), f.numbers(&self.x)));
            }
        }
        out
    }

    fn kinks_of_function(&self, c: &Connector, f: &BoundFunction) -> usize {
        let none = f.own(Some(&vec![0.0; c.coordinates.len()]));
        f.law.distances(0.0, &none, &none, f.numbers(&self.x)).len()
    }

    /// All sharp kinks, in the order of their distances.
    pub fn sharp_kinks(&self) -> Vec<SharpKink> {
        let (mut out, length) = (Vec::new(), self.system.length);
        for c in self.kinked() {
            for law in &c.laws {
                let unit = if c.coordinates[law.component].is_length() { length } else { 1.0 };
                let state = law.law.state_size(&self.x[law.x..law.x + law.law.n_params()], unit);
                let far = unit * (1.0 + self.far);
                let of = |s: Surface| SharpKink {
                    acts: self.effects.wanted().law(law.law),
                    ..SharpKink::of_law(c.owner, s.crossing, far, state)
                };
                out.extend(sharp(law, &self.x).map(of));
            }
            let n: usize = c.functions.iter().map(|f| self.kinks_of_function(c, f)).sum();
            let own = SharpKink { owner: c.owner, may_jump: true, acts: true, rounding: 0.0, rounding_of_rate: 0.0 };
            out.extend(vec![own; n]);
        }
        out
    }

    /// The system with all laws held on these sides of their kinks.
    pub fn held(&self, sides: &[Side]) -> System {
        let mut topology = (*self.system.topology).clone();
        let owners: Vec<Owner> = self.kinked().map(|c| c.owner).collect();
        let mut left = sides;
        let mut take = |n: usize| {
            let (own, rest) = left.split_at(n.min(left.len()));
            left = rest;
            own
        };
        for c in topology.connectors.iter_mut().filter(|c| owners.contains(&c.owner)) {
            for law in &mut c.laws {
                let n = sharp(law, &self.x).count();
                law.law = law.law.held(take(n));
            }
            let counts: Vec<usize> = c.functions.iter().map(|f| self.kinks_of_function(c, f)).collect();
            for (f, n) in c.functions.iter_mut().zip(counts) {
                f.law = f.law.held(take(n));
            }
        }
        System { topology: Arc::new(topology), ..self.system.clone() }
    }

    /// The systems on both sides of one kink.
    fn on_both_sides(&self, sides: &[Side], k: usize) -> [System; 2] {
        [Side::Above, Side::Below].map(|side| {
            let mut sides = sides.to_vec();
            sides[k] = side;
            self.held(&sides)
        })
    }

    /// Do accelerations jump at a kink, by their largest size so far?
    pub fn jumps_at(&self, m: &Motion<f64>, sides: &[Side], k: usize, hardest: f64) -> bool {
        let [above, below] = self.on_both_sides(sides, k).map(|system| {
            let held = Equations::new(&system, self.x.clone(), self.effects);
            held.instant(m.clone(), &mut Counts::default()).map(|i| i.acceleration)
        });
        let apart = |a: Vec<f64>, b: Vec<f64>| {
            let change: Vec<f64> = a.iter().zip(&b).map(|(a, b)| a - b).collect();
            scaled_size(&change, &self.scales()) > JUMP * hardest
        };
        match (above, below) {
            (Ok(a), Ok(b)) => apart(a, b),
            _ => true,
        }
    }

    /// Are the slopes of laws other ones above a kink than below?
    pub fn bends_at(&self, m: &Motion<f64>, sides: &[Side], k: usize) -> bool {
        let mut m = m.clone();
        self.close_states(&mut m);
        let [above, below] = self.on_both_sides(sides, k).map(|system| self.slopes_of_laws(&m, &system));
        above.iter().zip(&below).any(|(a, b)| (a - b).abs() > JUMP * (a.abs() + b.abs()))
    }

    /// Slopes of laws with kinks, as another system has them, at a motion with closed states.
    fn slopes_of_laws(&self, m: &Motion<f64>, other: &System) -> Vec<f64> {
        let (placement, mut out) = (self.place(m), Vec::new());
        for c in &other.topology.connectors {
            let moved = motion_of(self.topology(), &self.geometry, &placement, &self.x, c);
            for law in c.laws.iter().filter(|l| sharp(l, &self.x).next().is_some()) {
                let (u, v) = moved[law.component];
                let z = m.memory[law.places()].first().copied().unwrap_or(0.0);
                let found = law.law.state_slopes(u, v, &self.x[law.x..law.x + law.law.n_params()], z);
                out.extend(found.force.into_iter().chain(found.rate).skip(1));
            }
            let (u, v): (Vec<f64>, Vec<f64>) = moved.into_iter().unzip();
            for f in &c.functions {
                let (u, v) = (f.own(Some(&u)), f.own(Some(&v)));
                let found = f.law.slopes(m.t, &u, &v, f.numbers(&self.x), true);
                out.extend(found.k.into_iter().chain(found.c).flatten());
            }
        }
        out
    }
}

/// From a time on, laws are held on these sides.
#[derive(Debug, Clone)]
pub struct Smooth {
    pub from: f64,
    pub sides: Vec<Side>,
}

/// A kink that no step ended at, or that has no derivative: when, whose, and what is the matter.
pub type Missed = (f64, String, &'static str);

/// Kinks of laws that a motion passed: the stretches between those at which steps ended, and others.
#[derive(Default)]
pub struct AtKinks {
    pub smooth: Vec<Smooth>,
    pub missed: Vec<Missed>,
}
