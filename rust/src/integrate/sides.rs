//! On which sides of the kinks of its laws a motion is, and the search for steps that end at kinks.
//!
//! Between two kinks all laws are held on their sides and go on smoothly across them (`Equations::held`), so that a step over a kink is one
//! of smooth equations: its error is that of its length alone, and its end tells truly on which side it is. Only steps whose error was
//! accepted are looked at. The length of a step that ends at a kink is a zero of the distance at its end, which the rule of false position
//! with the weights of Illinois finds on the steps themselves; from there on the law is held on the other side. Along every step that
//! the motion goes on from, all distances are on their sides; a kink for which that cannot be had is named.
use crate::error::Result;
use crate::force::Side;
use crate::multibody::System;
use crate::run::Counts;
use crate::tolerances::steps::{AT_KINK, BESIDE_KINK, KINK_POLISH, KINK_SEARCH, NOISE_SHARE, SEEN_KINK};

use super::explicit8::Explicit8;
use super::kinks::{AtKinks, Missed, SharpKink, Smooth};
use super::{Equations, Instant, Motion, Scheme, scaled_size};

/// Parts of a step at which kinks are looked for, besides its end.
const LOOKED: [f64; 7] = [0.125, 0.25, 0.375, 0.5, 0.625, 0.75, 0.875];
/// Bounds of a guess in the rest of the step, so that its ends move.
const EDGE: f64 = 0.01;
const JUMPS: &str = "its force jumps";
const ENDLESS: &str = "it passes its kink again and again without end";
const WITHIN: &str = "it passes its kink within a step";
const RESTS: &str = "it rests on its kink";

/// Motions within the step just tried, at fractions of it.
pub(super) type Between<'b> = dyn FnMut(&[f64]) -> Result<Vec<Motion<f64>>> + 'b;
/// A fraction of a step, and the distances there.
type Place = (f64, Vec<f64>);

/// The search for a step that ends at a kink: lengths and distances of steps that end before and behind it.
struct Search {
    from: f64,
    /// kinks that steps of some length pass
    targets: Vec<usize>,
    before: Place,
    behind: Place,
    /// weights of the distances, and which end moved last
    weights: [f64; 2],
    moved: Option<bool>,
    tries: usize,
    /// tries with both ends at the kink but for the noise of steps
    near: usize,
    /// distances do not come nearer to zero: the step before is the one
    is_last: bool,
}

/// Where a distance is zero between two of different sign, as a part; the middle where they have the same one.
fn zero_between(f0: f64, f1: f64) -> f64 {
    if f0 * f1 < 0.0 { f0 / (f0 - f1) } else { 0.5 }
}

impl Search {
    /// The length of the next step, between both.
    fn guess(&self, left: &[usize]) -> f64 {
        let [a, b] = self.weights;
        let part = |k: &usize| zero_between(a * self.before.1[*k], b * self.behind.1[*k]);
        let first = left.iter().map(part).fold(1.0, f64::min);
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
pub(super) struct Sides<'e, 's> {
    eq: &'e Equations<'s, f64>,
    kinks: Vec<SharpKink>,
    sides: Vec<Side>,
    /// those that it changed to and was not beyond the kink on yet
    fresh: Vec<bool>,
    /// kinks of laws that do not act, or that are passed by steps of any length, which is said
    ignored: Vec<bool>,
    /// distances at the start of the step
    last: Vec<f64>,
    /// the largest distances so far
    sizes: Vec<f64>,
    /// the largest acceleration and the largest rate so far
    hardest: f64,
    fastest: f64,
    /// distances below this part of the largest are zero
    zero: f64,
    search: Option<Search>,
    /// a kink inside a step from this time is nearer than any step can end
    unseen: Option<f64>,
    inside: Option<usize>,
    /// the sides are other ones than the equations are held on
    changed: bool,
    smooth: Vec<Smooth>,
    missed: Vec<Missed>,
}

impl<'e, 's> Sides<'e, 's> {
    /// None where no law has a kink; `rtol`: of controlled steps.
    pub fn new(eq: &'e Equations<'s, f64>, start: &Instant, rtol: Option<f64>) -> Option<Self> {
        let kinks = eq.sharp_kinks();
        let (n, ignored) = (kinks.len(), kinks.iter().map(|k| !k.acts).collect());
        let mut made = Sides {
            eq,
            kinks,
            sides: vec![Side::Free; n],
            fresh: vec![false; n],
            ignored,
            last: Vec::new(),
            sizes: vec![0.0; n],
            hardest: 0.0,
            fastest: 0.0,
            zero: rtol.map_or(BESIDE_KINK, |rtol| BESIDE_KINK.max(NOISE_SHARE * rtol)),
            search: None,
            unseen: None,
            inside: None,
            changed: false,
            smooth: Vec::new(),
            missed: Vec::new(),
        };
        made.restart(start);
        (n > 0).then_some(made)
    }

    pub fn passed(self) -> AtKinks {
        AtKinks { smooth: self.smooth, missed: self.missed }
    }

    /// The system with all laws on their sides.
    pub fn held(&mut self) -> System {
        self.changed = false;
        self.eq.held(&self.sides)
    }

    pub fn have_changed(&self) -> bool {
        self.changed
    }

    fn distances(&mut self, m: &Motion<f64>) -> Vec<f64> {
        let now = self.eq.kink_distances(m);
        self.fastest = self.fastest.max(scaled_size(&m.rate, &self.eq.scales()));
        for (size, d) in self.sizes.iter_mut().zip(&now) {
            *size = size.max(d.abs());
        }
        now
    }

    fn is_beyond(&self, k: usize, distance: f64, part: f64) -> bool {
        let kink = &self.kinks[k];
        let rounding = kink.rounding.max(kink.rounding_of_rate * self.fastest);
        distance.abs() > (part * self.sizes[k]).max(rounding)
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
        self.decide(&now);
        self.last = now;
        self.search = None;
        self.changed = true;
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
            self.decide(&there);
        }
        if let Some(stretch) = self.smooth.last_mut() {
            stretch.sides.clone_from(&self.sides);
        }
    }

    /// Back to an instant before.
    pub fn return_to(&mut self, here: &Instant) {
        let t = here.motion.t;
        self.smooth.retain(|s| s.from <= t);
        self.missed.retain(|m| m.0 <= t);
        if let Some(stretch) = self.smooth.last() {
            self.sides.clone_from(&stretch.sides);
        }
        self.last = self.eq.kink_distances(&here.motion);
        self.fresh.fill(false);
        self.search = None;
        self.changed = true;
    }

    fn stretch_from(&mut self, t: f64) {
        self.smooth.retain(|s| s.from < t);
        self.smooth.push(Smooth { from: t, sides: self.sides.clone() });
    }

    /// The search ends without a kink.
    pub fn give_up(&mut self) {
        self.search = None;
    }

    /// The length of another step over that of this one, of length h and a good error; None where the motion may go on from its end.
    pub fn judge(
        &mut self,
        (from, end): (&Instant, &Instant),
        h: f64,
        between: &mut Between<'_>,
    ) -> Result<Option<f64>> {
        let t = from.motion.t;
        if self.unseen == Some(t) {
            return Ok(None);
        }
        self.search.take_if(|s| s.from != t);
        let now = self.distances(&end.motion);
        self.refresh(&now);
        match self.search.take() {
            Some(search) => Ok(self.searched(search, h, now)),
            None => self.begun(t, h, now, between),
        }
    }

    /// Sides on which the motion was beyond the kink are not fresh.
    fn refresh(&mut self, distances: &[f64]) {
        for (k, d) in distances.iter().enumerate() {
            if self.fresh[k] && !self.sides[k].is_left_by(*d) && self.is_beyond(k, *d, self.zero) {
                self.fresh[k] = false;
            }
        }
    }

    /// The first try of a step.
    fn begun(&mut self, t: f64, h: f64, now: Vec<f64>, between: &mut Between<'_>) -> Result<Option<f64>> {
        let mut path = vec![(0.0, self.last.clone())];
        for (x, m) in LOOKED.iter().zip(between(&LOOKED)?) {
            let here = self.distances(&m);
            self.refresh(&here);
            path.push((*x, here));
        }
        path.push((1.0, now));
        if self.is_on_both_sides(&path) {
            return Ok(Some(LOOKED[0]));
        }
        let n = path.len() - 1;
        let is_behind = !self.left(&path[n].1, self.zero).is_empty();
        let first = (1..n).find(|j| !self.left(&path[*j].1, SEEN_KINK).is_empty());
        match first {
            _ if is_behind => Ok(Some(self.search_from(t, h, path, first.unwrap_or(n)))),
            Some(j) => {
                self.inside = self.left(&path[j].1, SEEN_KINK).first().copied();
                Ok(Some(path[j].0))
            }
            None => self.touched(&path, between),
        }
    }

    /// Is the side of a kink undecided, and the motion on both within the step?
    fn is_on_both_sides(&self, path: &[Place]) -> bool {
        let is_on = |k: usize, side: Side| {
            path.iter().any(|(_, d)| Side::of(d[k]) == side && self.is_beyond(k, d[k], self.zero))
        };
        (0..self.sides.len()).any(|k| self.is_undecided(k) && is_on(k, Side::Above) && is_on(k, Side::Below))
    }

    /// The first guess is on the way to the place j.
    fn search_from(&mut self, t: f64, h: f64, mut path: Vec<Place>, j: usize) -> f64 {
        let ((x0, d0), (x1, d1)) = (&path[j - 1], &path[j]);
        let part = |k: &usize| zero_between(d0[*k], d1[*k]);
        let first = self.left(d1, self.zero).iter().map(part).fold(1.0, f64::min);
        let guess = x0 + first.clamp(EDGE, 1.0 - EDGE) * (x1 - x0);
        let behind = path.pop().map_or_else(Vec::new, |(_, d)| d);
        self.search = Some(Search {
            from: t,
            targets: self.left(&behind, self.zero),
            before: (0.0, self.last.clone()),
            behind: (h, behind),
            weights: [1.0; 2],
            moved: None,
            tries: 0,
            near: 0,
            is_last: false,
        });
        guess
    }

    /// Where a distance is least between two places, beyond the kink.
    fn touched(&mut self, path: &[Place], between: &mut Between<'_>) -> Result<Option<f64>> {
        for (k, j) in (0..self.sides.len()).flat_map(|k| (1..path.len() - 1).map(move |j| (k, j))) {
            let own = |j: usize| if self.sides[k] == Side::Below { -path[j].1[k] } else { path[j].1[k] };
            let [a, b, c] = [own(j - 1), own(j), own(j + 1)];
            let (bend, slope) = (a - 2.0 * b + c, 0.5 * (c - a));
            let is_least = self.sides[k] != Side::Free && b <= a && b <= c && bend > 0.0;
            // the parabola is as good as the bend is even
            if !is_least || b - 0.5 * slope * slope / bend > bend {
                continue;
            }
            let x = path[j].0 - slope / bend * LOOKED[0];
            let there = between(&[x])?;
            if there.iter().any(|m| self.left(&self.eq.kink_distances(m), SEEN_KINK).contains(&k)) {
                self.inside = Some(k);
                return Ok(Some(x));
            }
        }
        Ok(None)
    }

    fn searched(&mut self, mut search: Search, h: f64, now: Vec<f64>) -> Option<f64> {
        search.targets.extend(self.left(&now, self.zero));
        let is_behind = !self.passed_by(&search, &now).is_empty();
        let is_at = |k: &usize| !self.is_beyond(*k, now[*k], AT_KINK);
        let next = if search.is_last || !is_behind && self.passed_by(&search, &search.behind.1).iter().any(is_at) {
            None
        } else {
            search.narrow(h, now, is_behind);
            search.near += usize::from(self.left(&search.behind.1, self.zero).is_empty());
            search.is_last = search.tries > KINK_SEARCH || search.near > KINK_POLISH;
            let passed = self.passed_by(&search, &search.behind.1);
            Some(if search.is_last { search.before.0 } else { search.guess(&passed) } / h)
        };
        self.search = Some(search);
        next
    }

    /// Kinks of a search behind which distances are.
    fn passed_by(&self, search: &Search, distances: &[f64]) -> Vec<usize> {
        self.left(distances, AT_KINK).into_iter().filter(|k| search.targets.contains(k)).collect()
    }

    /// The kink is nearer to the start of the step than any step can end.
    pub fn is_here(&mut self, here: &Instant) {
        match self.search.take() {
            Some(search) => self.turn_over(&here.motion, &self.passed_by(&search, &search.behind.1)),
            None => {
                self.unseen = Some(here.motion.t);
                let inside = self.inside.take();
                inside.into_iter().for_each(|k| self.miss(here.motion.t, k, WITHIN));
            }
        }
    }

    fn miss(&mut self, t: f64, k: usize, what: &'static str) {
        let name = self.eq.topology().owner_name(self.kinks[k].owner).to_string();
        self.missed.push((t, name, what));
    }

    /// The motion goes on beyond these kinks.
    fn turn_over(&mut self, m: &Motion<f64>, kinks: &[usize]) {
        for &k in kinks {
            if self.fresh[k] {
                (self.ignored[k], self.sides[k]) = (true, Side::Free);
                self.miss(m.t, k, ENDLESS);
                continue;
            }
            if self.kinks[k].may_jump && self.eq.jumps_at(m, &self.sides, k, self.hardest) {
                self.miss(m.t, k, JUMPS);
            }
            (self.sides[k], self.fresh[k]) = (self.sides[k].opposite(), true);
        }
        self.changed = true;
        self.stretch_from(m.t);
    }

    /// The motion goes on from the end of a step.
    pub fn accept(&mut self, end: &Instant) {
        let now = self.distances(&end.motion);
        self.hardest = self.hardest.max(scaled_size(&end.acceleration, &self.eq.scales()));
        let t = end.motion.t;
        let mut over = self.left(&now, self.zero);
        over.iter().for_each(|k| self.miss(t, *k, WITHIN));
        if let Some(search) = self.search.take() {
            let is_end = |k: &usize| search.is_last || !self.is_beyond(*k, now[*k], AT_KINK);
            let ended: Vec<usize> = self.passed_by(&search, &search.behind.1).into_iter().filter(is_end).collect();
            let far: Vec<usize> = ended.iter().copied().filter(|k| self.is_beyond(*k, now[*k], SEEN_KINK)).collect();
            far.into_iter().for_each(|k| self.miss(t, k, WITHIN));
            over.extend(ended);
        }
        over.sort_unstable();
        over.dedup();
        self.say_where_it_rests(&now, &end.motion);
        let before = self.sides.clone();
        self.decide(&now);
        if let Some(stretch) = self.smooth.last_mut().filter(|_| before != self.sides) {
            stretch.sides.clone_from(&self.sides);
        }
        self.last = now;
        if !over.is_empty() {
            self.turn_over(&end.motion, &over);
        }
    }

    /// Where it neither is beside a kink nor passes it, laws have no slope.
    fn say_where_it_rests(&mut self, now: &[f64], m: &Motion<f64>) {
        for (k, d) in now.iter().enumerate() {
            let is_beyond = self.is_beyond(k, self.last[k], self.zero) || self.is_beyond(k, *d, self.zero);
            let rests = self.is_undecided(k) && !is_beyond;
            if rests && self.eq.bends_at(m, &self.sides, k) {
                self.ignored[k] = true;
                self.miss(m.t, k, RESTS);
            }
        }
    }
}
