//! On which sides of the kinks of its laws a motion is, and the search for steps that end at kinks.
//!
//! Between two kinks all laws are held on their sides and go on smoothly across them (`Equations::held`), so that a step over a kink is one
//! of smooth equations: its error is that of its length alone, and its end tells truly on which side it is. Only steps whose error was
//! accepted are looked at. The length of a step that ends at a kink is a zero of the distance at its end (`kink_search`); from there on the
//! law is held on the other side. Along every step that the motion goes on from, all distances are on their sides; a kink for which that
//! cannot be had is named.
//!
//! A motion that is differentiated needs kinks to rounding. In others a kink is found as far as the tolerance asks, one that changes a step
//! by less than its tolerance is passed, and a law that passes its kink again and again is left as it is for a while.
mod search;
mod step;

use crate::error::Result;
use crate::force::Side;
use crate::multibody::System;
use crate::run::Counts;
use crate::tolerances::steps::{CLOSED, FIXED_SOLVED, KINK_CROWD, NOISE_SHARE, SEEN_KINK};

use super::explicit8::Explicit8;
use super::kink_rest::Rests;
use super::kink_search::Search;
use super::kinks::{AtKinks, Distance, Kinked, Missed, SharpKink, Smooth};
use super::{Equations, Instant, Motion, Scheme, scaled_size};

/// A side was left beyond so many times the distance at which a step ends at its kink.
const BESIDE_FOUND: f64 = 3.0;
const JUMPS: &str = "its force jumps";
const ENDLESS: &str = "it passes its kink again and again without end";
const WITHIN: &str = "it passes its kink within a step";
const RESTS: &str = "it rests on its kink";
const UNREACHED: &str = "no step ends at its kink";

/// The step just made, for those who look at kinks in it.
pub(super) trait Within {
    /// Motions at fractions of it.
    fn between(&mut self, fractions: &[f64]) -> Result<Vec<Motion<f64>>>;

    /// The error of a step in which laws were not held as here for a time up to a motion.
    fn effect(&mut self, held: &System, m: &Motion<f64>, time: f64) -> f64;

    /// What an error may be.
    fn allowed(&self) -> f64;
}

/// Where a motion is beside the kinks of its laws.
pub(super) struct Sides<'e, 's> {
    eq: &'e Equations<'s, f64>,
    kinked: Vec<Kinked<'s>>,
    kinks: Vec<SharpKink>,
    /// kinks are found to rounding, for derivatives
    exact: bool,
    sides: Vec<Side>,
    /// those that it changed to and was not beyond the kink on yet
    fresh: Vec<bool>,
    /// when each law went to its other side: not twice in a moment
    turned_at: Vec<f64>,
    /// kinks of laws that do not act, or that are passed by steps of any length, which is said
    ignored: Vec<bool>,
    rests: Rests,
    /// at the start of the step before, at that of the step, and at the end that was judged
    before: Vec<Distance>,
    last: Vec<Distance>,
    /// when the step begins, and how long the one before was
    begin: f64,
    length: f64,
    ahead: Option<Vec<Distance>>,
    /// the largest distances so far, of values and of rates
    sizes: Vec<[f64; 2]>,
    /// the largest acceleration and the largest rate so far
    hardest: f64,
    fastest: f64,
    /// distances below this part of the largest are zero, and below this one at the kink
    zero: f64,
    at: f64,
    search: Option<Search>,
    /// a kink inside a step from this time is nearer than any step can end
    unseen: Option<f64>,
    inside: Option<usize>,
    /// kinks that the step passes without an effect
    passed: Vec<usize>,
    /// the length of a step in which the last kink that was passed changes the motion by a part of itself
    longest: f64,
    /// the sides are other ones than the equations are held on, and by more than a step tells
    changed: bool,
    turned: bool,
    smooth: Vec<Smooth>,
    missed: Vec<Missed>,
    /// kinks at which steps ended
    met: u64,
}

fn plain(distances: &[Distance]) -> Vec<f64> {
    distances.iter().map(|d| d.distance).collect()
}

impl<'e, 's> Sides<'e, 's> {
    /// None where no law has a kink; `rtol`: of controlled steps; `exact`: for derivatives.
    pub fn new(eq: &'e Equations<'s, f64>, start: &Instant, rtol: Option<f64>, exact: bool) -> Option<Self> {
        let kinked = eq.kinked(!exact);
        let kinks = eq.sharp_kinks(&kinked);
        let of_states = kinks.iter().filter(|k| k.acts && k.is_of_state()).count();
        let crowded = !exact && of_states > KINK_CROWD;
        let ignored: Vec<bool> = kinks.iter().map(|k| !k.acts || crowded && k.is_of_state()).collect();
        let n = kinks.len();
        if ignored.iter().all(|i| *i) {
            return None;
        }
        // what is noise at the end of a step
        let zero = FIXED_SOLVED.max(rtol.map_or(0.0, |rtol| NOISE_SHARE * rtol));
        let at = if exact { CLOSED } else { zero / BESIDE_FOUND };
        let mut made = Sides {
            eq,
            kinked,
            kinks,
            exact,
            sides: vec![Side::Free; n],
            fresh: vec![false; n],
            turned_at: vec![f64::NAN; n],
            ignored,
            rests: Rests::new(n),
            before: Vec::new(),
            last: Vec::new(),
            begin: start.motion.t,
            length: 0.0,
            ahead: None,
            sizes: vec![[0.0; 2]; n],
            hardest: 0.0,
            fastest: 0.0,
            zero,
            at,
            search: None,
            unseen: None,
            inside: None,
            passed: Vec::new(),
            longest: f64::INFINITY,
            changed: false,
            turned: false,
            smooth: Vec::new(),
            missed: Vec::new(),
            met: 0,
        };
        made.restart(start);
        Some(made)
    }

    /// What is known of kinks at the end of the motion; derivatives need to know where laws were held.
    pub fn passed(self, counts: &mut Counts) -> AtKinks {
        for (what, n) in [("kinks met", self.met), ("kinks passed over", self.missed.len() as u64)] {
            if n > 0 {
                counts.add(what, n);
            }
        }
        if self.exact { AtKinks { smooth: self.smooth, missed: self.missed } } else { AtKinks::default() }
    }

    /// The system with all laws on their sides.
    pub fn held(&mut self) -> System {
        (self.changed, self.turned) = (false, false);
        self.eq.held(&self.kinked, &self.sides)
    }

    pub fn have_changed(&self) -> bool {
        self.changed
    }

    /// Did they change at a kink, where histories end?
    pub fn have_turned(&self) -> bool {
        self.turned
    }

    /// Are all laws held that have sharp kinks, so that no step is over one, and all sliders?
    pub fn are_held(&self) -> (bool, bool) {
        let held = (0..self.sides.len()).all(|k| self.sides[k] != Side::Free || !self.kinks[k].acts);
        (held, held && !self.exact)
    }

    fn distances(&mut self, m: &Motion<f64>) -> Vec<Distance> {
        let now = self.eq.kink_distances(&self.kinked, m, &self.sides);
        self.fastest = self.fastest.max(scaled_size(&m.rate, &self.eq.scales()));
        for (k, d) in now.iter().enumerate() {
            let size = &mut self.sizes[k][usize::from(self.kinks[k].is_rate(self.sides[k]))];
            *size = size.max(d.distance.abs());
        }
        now
    }

    fn is_beyond(&self, k: usize, distance: f64, part: f64) -> bool {
        let (kink, side) = (&self.kinks[k], self.sides[k]);
        let size = self.sizes[k][usize::from(kink.is_rate(side))];
        distance.abs() > (part * size).max(kink.rounding(side, self.fastest))
    }

    /// Kinks that were left by more than this part of the largest distances.
    fn left(&self, distances: &[f64], part: f64) -> Vec<usize> {
        let left = |k: &usize| self.sides[*k].is_left_by(distances[*k]) && self.is_beyond(*k, distances[*k], part);
        (0..self.sides.len()).filter(left).collect()
    }

    fn is_undecided(&self, k: usize) -> bool {
        self.sides[k] == Side::Free && !self.ignored[k]
    }

    /// Sides that are undecided are where the distances are.
    fn decide(&mut self, distances: &[f64]) {
        for (k, d) in distances.iter().enumerate() {
            if self.is_undecided(k) && self.is_beyond(k, *d, self.zero) {
                self.sides[k] = Side::of(*d);
            }
        }
    }

    /// The motion begins anew: rates or loads may have jumped.
    pub fn restart(&mut self, here: &Instant) {
        let now = self.distances(&here.motion);
        let free = |k: &usize| !self.ignored[*k];
        let open: Vec<usize> = (0..self.sides.len()).filter(free).collect();
        let before = self.sides.clone();
        for k in open {
            (self.sides[k], self.fresh[k]) = (Side::Free, false);
        }
        self.decide(&plain(&now));
        (self.before, self.last) = (Vec::new(), self.distances(&here.motion));
        self.begin = here.motion.t;
        self.search = None;
        (self.changed, self.turned) = (true, true);
        if self.smooth.is_empty() || before != self.sides {
            self.stretch_from(here.motion.t);
        }
    }

    /// Sides of kinks on which the motion is, a moment later.
    pub fn look_ahead(&mut self, here: &Instant, moment: f64, counts: &mut Counts) {
        if !(0..self.sides.len()).any(|k| self.is_undecided(k)) {
            return;
        }
        if let Ok(ahead) = Explicit8::default().step(self.eq, here, moment, false, counts) {
            let there = self.distances(&ahead.end.motion);
            self.decide(&plain(&there));
        }
        if let Some(stretch) = self.smooth.last_mut() {
            stretch.sides.clone_from(&self.sides);
        }
        self.last = self.distances(&here.motion);
    }

    /// Back to an instant before.
    pub fn return_to(&mut self, here: &Instant) {
        let t = here.motion.t;
        self.smooth.retain(|s| s.from <= t);
        self.missed.retain(|m| m.0 <= t);
        if let Some(stretch) = self.smooth.last() {
            self.sides.clone_from(&stretch.sides);
        }
        self.begin = t;
        (self.before, self.last) = (Vec::new(), self.eq.kink_distances(&self.kinked, &here.motion, &self.sides));
        self.fresh.fill(false);
        self.search = None;
        (self.changed, self.turned) = (true, true);
    }

    fn stretch_from(&mut self, t: f64) {
        self.smooth.retain(|s| s.from < t);
        self.smooth.push(Smooth { from: t, sides: self.sides.clone() });
    }

    /// The search ends without a kink.
    pub fn give_up(&mut self) {
        self.search = None;
    }

    /// A law is as it is, on no side.
    fn leave(&mut self, k: usize) {
        (self.ignored[k], self.sides[k]) = (true, Side::Free);
    }

    /// All laws are as they are from here on, since no step can be made; false where they were before.
    pub fn let_go(&mut self, here: &Instant) -> bool {
        let held: Vec<usize> = (0..self.sides.len()).filter(|k| !self.ignored[*k]).collect();
        let search = self.search.take();
        if let Some(k) = search.and_then(|s| s.targets.first().copied()).or(held.first().copied()) {
            self.miss(here.motion.t, k, UNREACHED);
        }
        held.iter().for_each(|k| self.leave(*k));
        (self.changed, self.turned) = (true, true);
        self.stretch_from(here.motion.t);
        !held.is_empty()
    }

    /// How long the step behind the kink may be.
    pub fn longest(&mut self) -> f64 {
        std::mem::replace(&mut self.longest, f64::INFINITY)
    }

    /// The length of another step over that of this one, of length h and a good error; None where the motion may go on from its end.
    pub fn judge(&mut self, (from, end): (&Instant, &Instant), h: f64, step: &mut dyn Within) -> Result<Option<f64>> {
        let t = from.motion.t;
        self.ahead = None;
        self.passed.clear();
        if self.unseen == Some(t) {
            return Ok(None);
        }
        self.search.take_if(|s| s.from != t);
        let now = self.distances(&end.motion);
        let at = plain(&now);
        self.refresh(&at);
        let far = self.search.is_none() && self.is_far(&now, h);
        self.ahead = Some(now);
        match self.search.take() {
            _ if far => Ok(None),
            Some(search) => Ok(self.searched(search, h, (at, &end.motion), step)),
            None => self.begun((t, h), (at, &end.motion), step),
        }
    }

    /// Does the step stay far from all kinks? Laws that are on no side are as they are, unless derivatives need to know.
    fn is_far(&self, now: &[Distance], h: f64) -> bool {
        let far = |k: usize| {
            let free = self.ignored[k] || !self.exact && self.sides[k] == Side::Free;
            free || self.sides[k] != Side::Free && {
                let before = self.before.get(k).map(|d| (d, self.length));
                self.kinks[k].is_far(self.sides[k], (before, &self.last[k], &now[k]), h)
            }
        };
        (0..self.sides.len()).all(far)
    }

    /// Sides on which the motion was beyond the kink are not fresh.
    fn refresh(&mut self, distances: &[f64]) {
        for (k, d) in distances.iter().enumerate() {
            if self.fresh[k] && !self.sides[k].is_left_by(*d) && self.is_beyond(k, *d, self.zero) {
                self.fresh[k] = false;
            }
        }
    }

    /// The kink is nearer to the start of the step than any step can end.
    pub fn is_here(&mut self, here: &Instant) {
        let search = self.search.take();
        let passed = search.as_ref().map_or_else(Vec::new, |s| self.passed_by(s, &s.behind.1));
        if !passed.is_empty() {
            return self.turn_over(&here.motion, &passed);
        }
        // what was looked for is noise, or comes back: the next step passes it
        self.unseen = Some(here.motion.t);
        let inside = self.inside.take().or(search.and_then(|s| s.targets.first().copied()));
        inside.into_iter().for_each(|k| self.miss(here.motion.t, k, WITHIN));
    }

    fn miss(&mut self, t: f64, k: usize, what: &'static str) {
        let name = self.eq.topology().owner_name(self.kinks[k].owner).to_string();
        self.missed.push((t, name, what));
    }

    /// The motion goes on beyond these kinks.
    fn turn_over(&mut self, m: &Motion<f64>, kinks: &[usize]) {
        for &k in kinks {
            self.rests.meet(k);
            let again = std::mem::replace(&mut self.turned_at[k], m.t) == m.t;
            if again || self.fresh[k] || !self.exact && self.rests.is_met_again(k) {
                self.leave(k);
                self.rests.begin(k);
                self.miss(m.t, k, ENDLESS);
                continue;
            }
            if self.exact
                && self.kinks[k].may_jump()
                && self.eq.jumps_at(m, (&self.kinked, &self.sides), k, self.hardest)
            {
                self.miss(m.t, k, JUMPS);
            }
            (self.sides[k], self.fresh[k]) = (self.sides[k].opposite(), true);
            self.met += 1;
        }
        (self.changed, self.turned) = (true, true);
        self.stretch_from(m.t);
    }

    /// The motion goes on from the end of a step.
    pub fn accept(&mut self, end: &Instant) {
        let there = self.ahead.take().unwrap_or_else(|| self.distances(&end.motion));
        let now = plain(&there);
        self.hardest = self.hardest.max(scaled_size(&end.acceleration, &self.eq.scales()));
        let t = end.motion.t;
        let mut over = self.left(&now, self.zero);
        let found = self.search.as_mut().map_or_else(Vec::new, |s| std::mem::take(&mut s.found));
        over.retain(|k| !self.passed.contains(k) && !found.contains(k));
        over.iter().for_each(|k| self.miss(t, *k, WITHIN));
        if let Some(search) = self.search.take() {
            let is_end = |k: &usize| !found.contains(k) && (search.is_last || !self.is_beyond(*k, now[*k], self.at));
            let ended: Vec<usize> = self.passed_by(&search, &search.behind.1).into_iter().filter(is_end).collect();
            let far: Vec<usize> =
                ended.iter().copied().filter(|k| self.is_beyond(*k, now[*k], SEEN_KINK.max(self.at))).collect();
            far.into_iter().for_each(|k| self.miss(t, k, WITHIN));
            over.extend(ended);
        }
        over.extend(found);
        over.sort_unstable();
        over.dedup();
        self.say_where_it_rests(&now, &end.motion);
        self.rests.pass();
        (self.begin, self.length) = (t, t - self.begin);
        let before = self.sides.clone();
        for k in std::mem::take(&mut self.passed) {
            self.sides[k] = self.sides[k].opposite();
        }
        self.rest(&now);
        self.decide(&now);
        if before != self.sides {
            if self.exact {
                self.smooth.iter_mut().last().into_iter().for_each(|s| s.sides.clone_from(&self.sides));
            } else {
                self.changed = true;
                self.stretch_from(t);
            }
        }
        self.before = std::mem::replace(&mut self.last, there);
        if !over.is_empty() {
            self.turn_over(&end.motion, &over);
        }
        if before != self.sides && self.kinks.iter().any(SharpKink::is_lasting) {
            // limits of sliders are other distances on other sides
            self.last = self.distances(&end.motion);
        }
    }

    /// Kinks that were passed again and again are looked at again after a while.
    fn rest(&mut self, now: &[f64]) {
        if self.exact {
            return;
        }
        for (k, distance) in now.iter().enumerate() {
            let is_left = self.is_beyond(k, *distance, self.zero);
            if let Some(goes_on) = self.rests.goes_on(k, is_left) {
                self.ignored[k] = goes_on;
            }
        }
    }

    /// Where it neither is beside a kink nor passes it, laws have no slope.
    fn say_where_it_rests(&mut self, now: &[f64], m: &Motion<f64>) {
        if !self.exact {
            return;
        }
        for (k, d) in now.iter().enumerate() {
            let is_beyond = self.is_beyond(k, self.last[k].distance, self.zero) || self.is_beyond(k, *d, self.zero);
            let rests = self.is_undecided(k) && !is_beyond;
            if rests && self.eq.bends_at(m, (&self.kinked, &self.sides), k) {
                self.leave(k);
                self.miss(m.t, k, RESTS);
            }
        }
    }
}
