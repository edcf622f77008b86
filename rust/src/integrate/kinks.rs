//! Kinks of laws that a motion passes: distances from them, and the search for a step that ends at one.
//!
//! A step over a kink of a force or of the rate of a state loses its order, and so does its derivative. Forces are continuous, so that a
//! kink needs no jump of the motion or of its derivatives: steps that end there, and laws that are held on the side on which the motion
//! is (`System::held`), have the order of smooth ones. The length of the step is a zero of the distance at its end, which the rule
//! of false position with the weights of Illinois finds on the steps themselves.
use std::sync::Arc;

use crate::error::Result;
use crate::force::{Side, Surface};
use crate::multibody::System;
use crate::multibody::connector::motion_of;
use crate::multibody::topology::{BoundFunction, BoundLaw, Connector, Owner};
use crate::run::Counts;
use crate::tolerances::steps::{AT_KINK, JUMP, KINK_SEARCH, KINK_SHARE, SEEN_KINK};

use super::interpolate::quintic;
use super::way::Verdict as OfStep;
use super::{Equations, Instant, Motion, Step, scaled_size};

/// Parts of a step at which kinks are looked for, besides its end.
const LOOKED: [f64; 3] = [0.25, 0.5, 0.75];
/// Bounds of a guess in what is left of the step, so that its ends move.
const EDGE: f64 = 1e-3;

fn sharp<'l>(law: &'l BoundLaw, x: &'l [f64]) -> impl Iterator<Item = Surface> + 'l {
    law.law.surfaces(&x[law.x..law.x + law.law.n_params()]).into_iter().filter(Surface::is_sharp)
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

    /// Signed distances from all sharp kinks of laws, in the order of `System::held`; empty without any.
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

    /// Whose kinks they are, and whether they are those of a function, which may jump there.
    pub fn kink_owners(&self) -> Vec<(Owner, bool)> {
        let mut out = Vec::new();
        for c in self.kinked() {
            let of_laws: usize = c.laws.iter().map(|l| sharp(l, &self.x).count()).sum();
            let none = vec![0.0; c.coordinates.len()];
            let of = |f: &BoundFunction| {
                let at = f.own(Some(&none));
                f.law.distances(0.0, &at, &at, f.numbers(&self.x)).len()
            };
            let of_functions: usize = c.functions.iter().map(of).sum();
            out.extend(vec![(c.owner, false); of_laws]);
            out.extend(vec![(c.owner, true); of_functions]);
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
            for f in &mut c.functions {
                let none = vec![0.0; f.coordinates.len()];
                let n = f.law.distances(0.0, &none, &none, f.numbers(&self.x)).len();
                f.law = f.law.held(take(n));
            }
        }
        System { topology: Arc::new(topology), ..self.system.clone() }
    }
}

/// From a time on, laws are held on these sides.
#[derive(Debug, Clone)]
pub struct Smooth {
    pub from: f64,
    pub sides: Vec<Side>,
}

/// Kinks of laws that a motion passed: the stretches between those at which steps ended, and others, with whose they are.
#[derive(Default)]
pub struct AtKinks {
    pub smooth: Vec<Smooth>,
    pub missed: Vec<(f64, String)>,
}

/// What a step does at kinks.
pub(super) enum Verdict {
    Passes,
    /// it goes over one, or ends before one: the length of the next try over its own
    Again(f64),
}

impl Verdict {
    /// What becomes of a step, whatever its error: a longer one is worth a try only if this one is good enough.
    pub fn over(self, of_error: OfStep) -> OfStep {
        match (self, of_error) {
            (Verdict::Again(part), OfStep::Rejected(..)) if part < 1.0 => OfStep::Kinked(part),
            (Verdict::Again(part), OfStep::Accepted(..) | OfStep::Turned(_)) => OfStep::Kinked(part),
            (_, of_error) => of_error,
        }
    }
}

/// The search for a step that ends at a kink: lengths and distances of steps that end before and behind it.
struct Search {
    from: f64,
    sides: Vec<Side>,
    before: (f64, Vec<f64>),
    behind: (f64, Vec<f64>),
    /// weights of the distances, and which end moved last
    weights: [f64; 2],
    moved: Option<bool>,
    tries: usize,
}

impl Search {
    /// The length of the next step, between both.
    fn guess(&self) -> f64 {
        let [a, b] = self.weights;
        let fraction = |k: usize| {
            let (f0, f1) = (a * self.before.1[k], b * self.behind.1[k]);
            if f0 * f1 < 0.0 { f0 / (f0 - f1) } else { 0.5 }
        };
        let passed = (0..self.sides.len()).filter(|k| self.sides[*k].is_left_by(self.behind.1[*k]));
        let first = passed.map(fraction).fold(1.0, f64::min);
        self.before.0 + first.clamp(EDGE, 1.0 - EDGE) * (self.behind.0 - self.before.0)
    }

    fn narrow(&mut self, h: f64, distances: Vec<f64>, is_behind: bool) {
        self.tries += 1;
        self.weights = match (is_behind, self.moved == Some(is_behind)) {
            (true, true) => [0.5 * self.weights[0], 1.0],
            (false, true) => [1.0, 0.5 * self.weights[1]],
            _ => [1.0, 1.0],
        };
        self.moved = Some(is_behind);
        *(if is_behind { &mut self.behind } else { &mut self.before }) = (h, distances);
    }
}

/// Where a motion is beside the kinks of its laws.
pub(super) struct Kinks {
    sides: Vec<Side>,
    /// at the start of the step
    last: Vec<f64>,
    /// the largest distances so far
    sizes: Vec<f64>,
    owners: Vec<(Owner, bool)>,
    /// the largest acceleration so far
    hardest: f64,
    /// distances below this part of the largest are zero
    zero: f64,
    search: Option<Search>,
    /// no kink is looked for in a step from here
    unseen: Option<f64>,
    /// stretches of the motion between kinks
    smooth: Vec<Smooth>,
    /// kinks at which no step ended, and jumps
    missed: Vec<(f64, String)>,
}

impl Kinks {
    /// `rtol`: of controlled steps
    pub fn new(eq: &Equations<'_, f64>, start: &Instant, rtol: Option<f64>) -> Self {
        let last = eq.kink_distances(&start.motion);
        let floor = AT_KINK * eq.system.length;
        Kinks {
            sides: vec![Side::Free; last.len()],
            sizes: last.iter().map(|d| d.abs().max(floor)).collect(),
            owners: eq.kink_owners(),
            hardest: 0.0,
            zero: rtol.map_or(AT_KINK, |rtol| AT_KINK.max(KINK_SHARE * rtol)),
            search: None,
            unseen: None,
            smooth: vec![Smooth { from: start.motion.t, sides: vec![Side::Free; last.len()] }],
            missed: Vec::new(),
            last,
        }
    }

    pub fn passed(self) -> AtKinks {
        AtKinks { smooth: self.smooth, missed: self.missed }
    }

    pub fn any(&self) -> bool {
        !self.sides.is_empty()
    }

    fn is_zero(&self, k: usize, distance: f64) -> bool {
        distance.abs() <= self.zero * self.sizes[k]
    }

    /// Kinks that were left by more than this part of the largest distances.
    fn left(&self, sides: &[Side], distances: &[f64], beyond: f64) -> Vec<usize> {
        let left = |k: &usize| sides[*k].is_left_by(distances[*k]) && distances[*k].abs() > beyond * self.sizes[*k];
        (0..sides.len()).filter(left).collect()
    }

    /// Sides that are free are where the distances are.
    fn settled(&self, mut sides: Vec<Side>, distances: &[f64], beyond: f64) -> Vec<Side> {
        for (k, d) in distances.iter().enumerate() {
            if sides[k] == Side::Free && d.abs() > beyond * self.sizes[k] {
                sides[k] = Side::of(*d);
            }
        }
        sides
    }

    /// What a step that was tried does at kinks, where steps are to end there.
    pub fn tried(
        own: &mut Option<Kinks>,
        eq: &Equations<'_, f64>,
        (from, tried): (&Instant, &Result<Step>),
        h: f64,
    ) -> Verdict {
        match (own, tried) {
            (Some(kinks), Ok(step)) => kinks.judge(eq, from, &step.end, h),
            _ => Verdict::Passes,
        }
    }

    /// Does a step of length h go over a kink?
    fn judge(&mut self, eq: &Equations<'_, f64>, from: &Instant, end: &Instant, h: f64) -> Verdict {
        if !self.any() || self.unseen == Some(from.motion.t) {
            return Verdict::Passes;
        }
        self.search.take_if(|s| s.from != from.motion.t);
        let now = eq.kink_distances(&end.motion);
        for (size, d) in self.sizes.iter_mut().zip(&now) {
            *size = size.max(d.abs());
        }
        let Some(search) = &self.search else { return self.begun(eq, (from, end), h, now) };
        let behind = !self.left(&search.sides, &now, self.zero).is_empty();
        if !behind && self.touched(&search.sides, &now).next().is_some() {
            return Verdict::Passes;
        }
        self.searched(h, now, behind)
    }

    /// Kinks at which the distances are zero, which they were not at the start of the step.
    fn touched<'k>(&'k self, sides: &'k [Side], now: &'k [f64]) -> impl Iterator<Item = usize> + 'k {
        let at =
            move |k: &usize| sides[*k] != Side::Free && self.is_zero(*k, now[*k]) && !self.is_zero(*k, self.last[*k]);
        (0..sides.len()).filter(at)
    }

    /// The kink is nearer to the start of the step, at time t, than any step can end.
    pub fn is_here(&mut self, t: f64) {
        let Some(search) = self.search.take() else {
            self.unseen = Some(t);
            return;
        };
        let left = self.left(&search.sides, &search.behind.1, self.zero);
        self.sides = search.sides;
        for k in left {
            (self.sides[k], self.last[k]) = (Side::Free, 0.0);
        }
        self.smooth.retain(|s| s.from < t);
        self.smooth.push(Smooth { from: t, sides: self.sides.clone() });
    }

    /// The search ends without a kink.
    pub fn give_up(&mut self) {
        self.search = None;
    }

    /// The first try of a step.
    fn begun(&mut self, eq: &Equations<'_, f64>, (from, end): (&Instant, &Instant), h: f64, now: Vec<f64>) -> Verdict {
        let mut sides = self.settled(self.sides.clone(), &self.last, self.zero);
        // it may go over a kink and back
        let mut first = None;
        for (part, m) in LOOKED.iter().zip(quintic(eq, from, end, h, &LOOKED)) {
            let inside = eq.kink_distances(&m);
            if first.is_none() && !self.left(&sides, &inside, SEEN_KINK).is_empty() {
                first = Some(*part);
            }
            sides = self.settled(sides, &inside, SEEN_KINK);
        }
        let behind = !self.left(&sides, &now, self.zero).is_empty();
        match first {
            _ if behind => {}
            Some(part) => return Verdict::Again(part),
            None => return Verdict::Passes,
        }
        let before = (0.0, self.last.clone());
        let search =
            Search { from: from.motion.t, sides, before, behind: (h, now), weights: [1.0; 2], moved: None, tries: 0 };
        let part = search.guess() / h;
        self.search = Some(search);
        Verdict::Again(part)
    }

    fn searched(&mut self, h: f64, now: Vec<f64>, behind: bool) -> Verdict {
        let Some(search) = &mut self.search else { return Verdict::Passes };
        search.narrow(h, now, behind);
        if search.tries > KINK_SEARCH { Verdict::Passes } else { Verdict::Again(search.guess() / h) }
    }

    /// Do accelerations jump where a function passes a kink?
    fn jumps(&self, eq: &Equations<'_, f64>, at: &Motion<f64>, sides: &[Side], k: usize) -> bool {
        let accelerations = |side: Side| {
            let mut sides = sides.to_vec();
            sides[k] = side;
            let system = eq.held(&sides);
            let held = Equations::new(&system, eq.x.clone(), eq.effects);
            held.instant(at.clone(), &mut Counts::default()).map(|i| i.acceleration)
        };
        let apart = |a: Vec<f64>, b: Vec<f64>| {
            let change: Vec<f64> = a.iter().zip(&b).map(|(a, b)| a - b).collect();
            scaled_size(&change, &eq.scales()) > JUMP * self.hardest
        };
        let may = self.owners[k].1;
        may && match (accelerations(Side::Above), accelerations(Side::Below)) {
            (Ok(a), Ok(b)) => apart(a, b),
            _ => true,
        }
    }

    /// The motion goes on from the end of a step; true where the laws are other ones from there on.
    pub fn accept(&mut self, eq: &Equations<'_, f64>, end: &Instant) -> bool {
        if !self.any() {
            return false;
        }
        let now = eq.kink_distances(&end.motion);
        self.hardest = self.hardest.max(scaled_size(&end.acceleration, &eq.scales()));
        let sides = match self.search.take() {
            Some(search) => search.sides,
            None => self.settled(self.sides.clone(), &self.last, self.zero),
        };
        let touched: Vec<usize> = self.touched(&sides, &now).collect();
        let missed = self.left(&sides, &now, self.zero);
        let jumps = touched.iter().filter(|k| self.jumps(eq, &end.motion, &sides, **k));
        let name = |k: &usize| eq.topology().owner_name(self.owners[*k].0).to_string();
        let named: Vec<_> = missed.iter().chain(jumps).map(|k| (end.motion.t, name(k))).collect();
        self.missed.extend(named);
        self.sides = self.settled(sides, &now, self.zero);
        if let Some(stretch) = self.smooth.last_mut() {
            stretch.sides.clone_from(&self.sides);
        }
        self.last = now;
        let ended = !(touched.is_empty() && missed.is_empty());
        if ended {
            touched.into_iter().chain(missed).for_each(|k| self.sides[k] = Side::Free);
            self.smooth.push(Smooth { from: end.motion.t, sides: self.sides.clone() });
        }
        ended
    }
}
