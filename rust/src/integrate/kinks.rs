//! Kinks of laws that a motion passes: distances from them, and the equations on one side of each.
//!
//! A step over a kink of a force or of the rate of a state loses its order, and so does its derivative. Forces are continuous, so that a
//! kink needs no jump of the motion or of its derivatives: steps that end there, of laws that are held on the side on which the motion
//! is, have the order of smooth ones. `sides` finds these steps.
use std::borrow::Cow;
use std::sync::Arc;

use crate::force::{AnyLaw, Crossing, Side, Slider, Surface, constants};
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

/// Part of the range of a distance within a step that it keeps from zero where the step is far from the kink: errors of the cubic.
const MARGIN: f64 = 0.5;

/// What a distance from a kink is made of.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    Value(Crossing),
    /// of the upper or the lower limit of a slider: u against the limit where it sticks, and the rate where it slides there
    Limit(Side),
    /// of a function
    Function,
}

/// A sharp kink of a law.
#[derive(Debug, Clone, Copy)]
pub struct SharpKink {
    pub owner: Owner,
    kind: Kind,
    /// laws of effects that are left out do not act
    pub acts: bool,
    /// rounding of a place or a state, and of a rate over the largest rate of the motion
    rounding: f64,
    rounding_of_rate: f64,
}

impl SharpKink {
    /// The force of a function may jump.
    pub fn may_jump(&self) -> bool {
        self.kind == Kind::Function
    }

    /// What passes may change the state for good.
    pub fn is_lasting(&self) -> bool {
        matches!(self.kind, Kind::Limit(_))
    }

    /// The rate of a state bends there, and no force does.
    pub fn is_of_state(&self) -> bool {
        matches!(self.kind, Kind::Value(Crossing::Rate | Crossing::State))
    }

    /// On this side the distance is a rate.
    pub fn is_rate(&self, side: Side) -> bool {
        match self.kind {
            Kind::Value(crossing) => crossing == Crossing::Rate,
            Kind::Limit(slides) => side == slides,
            Kind::Function => false,
        }
    }

    /// Rounding of the distance on this side, by the largest rate so far.
    pub fn rounding(&self, side: Side, fastest: f64) -> f64 {
        match (self.kind, self.is_rate(side)) {
            (Kind::Function, _) => 0.0,
            (_, true) => self.rounding_of_rate * fastest,
            (_, false) => self.rounding,
        }
    }

    /// Does the cubic through displacements and rates at both ends of a step stay far from the kink? Of a function the parabola through
    /// the distances at both ends and at the start of the step before, with its length.
    pub fn is_far(
        &self,
        side: Side,
        (before, from, to): (Option<(&Distance, f64)>, &Distance, &Distance),
        h: f64,
    ) -> bool {
        let (rise, start, end) = (to.u - from.u, h * from.v, h * to.v);
        let (d0, d1) = (from.distance, to.distance);
        // the curve lies within the hull of these
        let hull = match self.kind {
            Kind::Function => {
                let Some((before, length)) = before else { return false };
                let (last, own) = ((d0 - before.distance) / length, (d1 - d0) / h);
                let slope = last + (own - last) * length / (h + length);
                [d0, d0 + 0.5 * h * slope, d1, d1]
            }
            Kind::Value(Crossing::State) => [d0, d1, d0, d1],
            _ if self.is_rate(side) => [start, 3.0 * rise - start - end, end, end],
            _ => [d0, d0 + start / 3.0, d1 - end / 3.0, d1],
        };
        let (low, high) = hull.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, g), x| (l.min(*x), g.max(*x)));
        hull.iter().all(|x| x.is_finite()) && low * high > 0.0 && low.abs().min(high.abs()) > MARGIN * (high - low)
    }
}

/// A signed distance from a kink, and the displacement and the rate of its law.
#[derive(Debug, Clone, Copy)]
pub struct Distance {
    pub distance: f64,
    u: f64,
    v: f64,
}

/// A law, and its kinks.
struct KinkedLaw<'a> {
    law: &'a BoundLaw,
    acts: bool,
    surfaces: Vec<Surface>,
    sliders: Vec<f64>,
}

impl KinkedLaw<'_> {
    fn kinds(&self) -> impl Iterator<Item = Kind> {
        let limits = self.sliders.iter().flat_map(|_| [Kind::Limit(Side::Above), Kind::Limit(Side::Below)]);
        self.surfaces.iter().map(|s| Kind::Value(s.crossing)).chain(limits)
    }

    fn held(&self, sides: &[Side]) -> AnyLaw {
        let (values, limits) = sides.split_at(self.surfaces.len().min(sides.len()));
        let law = self.law.law.held(values);
        if self.sliders.is_empty() {
            return law;
        }
        law.sliding(&limits.chunks_exact(2).map(|s| Slider::of(s[0], s[1])).collect::<Vec<_>>())
    }

    fn distances(&self, (u, v): (f64, f64), z: &[f64], sides: &[Side]) -> Vec<Distance> {
        let of = |d: f64| Distance { distance: if self.acts { d } else { 0.0 }, u, v };
        let mut out: Vec<Distance> = self.surfaces.iter().map(|s| of(s.distance(u, v, z))).collect();
        for (lag, z) in self.sliders.iter().zip(z) {
            for (slides, limit) in [(Side::Above, u - z - lag), (Side::Below, u - z + lag)] {
                out.push(of(if sides.get(out.len()) == Some(&slides) { v } else { limit }));
            }
        }
        out
    }
}

/// A connector with laws that act and have sharp kinks, or with functions: all its laws and their kinks.
pub struct Kinked<'a> {
    connector: &'a Connector,
    laws: Vec<KinkedLaw<'a>>,
}

/// Laws with kinks, and their sides.
pub type Beside<'k, 'a> = (&'k [Kinked<'a>], &'k [Side]);

impl<'a> Equations<'a, f64> {
    /// What is to be held beside its kinks; sliders that begin or cease to slide have some too.
    pub fn kinked(&self, with_sliders: bool) -> Vec<Kinked<'a>> {
        let wanted = self.effects.wanted();
        let topology = self.topology();
        let law = |law: &'a BoundLaw| {
            let p = &self.x[law.x..law.x + law.law.n_params()];
            let surfaces = law.law.surfaces(p).into_iter().filter(Surface::is_sharp).collect();
            let sliders = if with_sliders { law.law.sliders(p) } else { Vec::new() };
            KinkedLaw { law, acts: wanted.law(law.law), surfaces, sliders }
        };
        let all = topology.connectors.iter();
        let all = all.map(|connector| Kinked { connector, laws: connector.laws.iter().map(law).collect() });
        let has = |k: &Kinked<'_>| {
            let own = k.laws.iter().any(|l| l.acts && l.kinds().next().is_some());
            own || !k.connector.functions.is_empty()
        };
        all.filter(has).collect()
    }
}

impl Equations<'_, f64> {
    /// Distances from the sharp kinks of laws that are on these sides, in their order.
    pub fn kink_distances(&self, kinked: &[Kinked<'_>], m: &Motion<f64>, sides: &[Side]) -> Vec<Distance> {
        let mut out = Vec::new();
        let of_states = |s: &Surface| s.crossing == Crossing::State;
        let mut closed = Cow::Borrowed(m);
        if kinked.iter().flat_map(|k| &k.laws).any(|l| l.surfaces.iter().any(of_states)) {
            self.close_states(closed.to_mut());
        }
        let (m, placement) = (&*closed, self.place(m));
        for k in kinked {
            let c = k.connector;
            let moved = motion_of(self.topology(), &self.geometry, &placement, &self.x, c);
            for l in &k.laws {
                let own = sides.get(out.len()..).unwrap_or_default();
                out.extend(l.distances(moved[l.law.component], &m.memory[l.law.places()], own));
            }
            if !c.functions.is_empty() {
                let (u, v): (Vec<f64>, Vec<f64>) = moved.into_iter().unzip();
                for f in &c.functions {
                    let all = f.law.distances(m.t, &f.own(Some(&u)), &f.own(Some(&v)), f.numbers(&self.x));
                    out.extend(all.into_iter().map(|distance| Distance { distance, u: f64::NAN, v: f64::NAN }));
                }
            }
        }
        out
    }

    fn kinks_of_function(&self, c: &Connector, f: &BoundFunction) -> usize {
        let none = f.own(Some(&vec![0.0; c.coordinates.len()]));
        f.law.distances(0.0, &none, &none, f.numbers(&self.x)).len()
    }

    /// All sharp kinks, in the order of their distances.
    pub fn sharp_kinks(&self, kinked: &[Kinked<'_>]) -> Vec<SharpKink> {
        let (mut out, length) = (Vec::new(), self.system.length);
        for k in kinked {
            let c = k.connector;
            for l in &k.laws {
                let law = l.law;
                let unit = if c.coordinates[law.component].is_length() { length } else { 1.0 };
                let state = law.law.state_size(&self.x[law.x..law.x + law.law.n_params()], unit);
                let far = unit * (1.0 + self.far);
                out.extend(l.kinds().map(|kind| {
                    let place = if kind == Kind::Value(Crossing::State) { state } else { far };
                    let [rounding, rounding_of_rate] = [place, far].map(|x| ENTRY_ROUNDING * f64::EPSILON * x);
                    SharpKink { owner: c.owner, kind, acts: l.acts, rounding, rounding_of_rate }
                }));
            }
            let n: usize = c.functions.iter().map(|f| self.kinks_of_function(c, f)).sum();
            let kind = Kind::Function;
            let own = SharpKink { owner: c.owner, kind, acts: true, rounding: 0.0, rounding_of_rate: 0.0 };
            out.extend(vec![own; n]);
        }
        out
    }

    /// Has a law that acts sharp kinks? `with_sliders`: or sliders that begin or cease to slide.
    pub fn has_kinks(&self, with_sliders: bool) -> bool {
        self.sharp_kinks(&self.kinked(with_sliders)).iter().any(|k| k.acts)
    }

    /// The same equations of a system whose laws are held on sides.
    pub fn on_sides<'b>(&self, held: &'b System) -> Equations<'b, f64> {
        Equations::with_geometry(held, self.x.clone(), self.geometry.clone(), self.effects)
    }

    /// The system with all laws held on these sides of their kinks.
    pub fn held(&self, kinked: &[Kinked<'_>], sides: &[Side]) -> System {
        let mut topology = (*self.system.topology).clone();
        let mut left = sides;
        let mut take = |n: usize| {
            let (own, rest) = left.split_at(n.min(left.len()));
            left = rest;
            own
        };
        let mut connectors = topology.connectors.iter_mut();
        for k in kinked {
            let Some(c) = connectors.find(|c| c.owner == k.connector.owner) else { break };
            for (law, own) in c.laws.iter_mut().zip(&k.laws) {
                law.law = own.held(take(own.kinds().count()));
            }
            let counts: Vec<usize> = c.functions.iter().map(|f| self.kinks_of_function(c, f)).collect();
            for (f, n) in c.functions.iter_mut().zip(counts) {
                f.law = f.law.held(take(n));
            }
        }
        System { topology: Arc::new(topology), ..self.system.clone() }
    }

    /// The systems on both sides of one kink.
    fn on_both_sides(&self, kinked: &[Kinked<'_>], sides: &[Side], k: usize) -> [System; 2] {
        [Side::Above, Side::Below].map(|side| {
            let mut sides = sides.to_vec();
            sides[k] = side;
            self.held(kinked, &sides)
        })
    }

    /// Do accelerations jump at a kink, by their largest size so far?
    pub fn jumps_at(&self, m: &Motion<f64>, (kinked, sides): Beside<'_, '_>, k: usize, hardest: f64) -> bool {
        let [above, below] = self.on_both_sides(kinked, sides, k).map(|system| {
            let held = self.on_sides(&system);
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
    pub fn bends_at(&self, m: &Motion<f64>, (kinked, sides): Beside<'_, '_>, k: usize) -> bool {
        let mut m = m.clone();
        self.close_states(&mut m);
        let [above, below] = self.on_both_sides(kinked, sides, k).map(|system| self.slopes_of_laws(&m, &system));
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
                let numbers = constants(&self.x[law.x..law.x + law.law.n_params()]);
                let found = law.law.state_slopes(u, v, &numbers, z);
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
