//! Steps that are to end at a kink.
use crate::error::Result;
use crate::tolerances::steps::{KINK_EFFECT, KINK_POLISH, KINK_SEARCH};

use super::super::Motion;
use super::super::kink_search::{Place, Search, first_zero, secant};
use super::{Sides, Within, plain};

/// A kink is near to the end of a step within this part of the first one.
const NEAR_KINK: f64 = 0.1;
/// Interpolations in search of a first guess.
const INTERPOLATED: usize = 6;

impl Sides<'_, '_> {
    /// The first guess is on the way to the place j.
    pub(super) fn search_from(
        &mut self,
        t: f64,
        h: f64,
        mut path: Vec<Place>,
        j: usize,
        step: &mut dyn Within,
    ) -> Result<f64> {
        let behind = path.last().map_or_else(Vec::new, |(_, d)| d.clone());
        let targets = self.left(&behind, self.zero);
        let (mut b, mut a) = (path.swap_remove(j), path.swap_remove(j - 1));
        let mut guess = first_zero(&a, &b, &self.left(&b.1, self.zero));
        let (mut before, mut last) = (a.clone(), b.clone());
        for _ in 0..INTERPOLATED {
            let Some(m) = step.between(&[guess])?.pop() else { break };
            let there = (guess, plain(&self.distances(&m)));
            *(if self.left(&there.1, self.at).is_empty() { &mut a } else { &mut b }) = there.clone();
            before = std::mem::replace(&mut last, there);
            let left = self.left(&b.1, self.at);
            let next = secant(&before, &last, &left);
            guess = if next > a.0 && next < b.0 { next } else { first_zero(&a, &b, &left) };
            if left.iter().any(|k| !self.is_beyond(*k, last.1[*k], self.zero)) {
                break;
            }
        }
        let start = (0.0, plain(&self.last));
        self.search = Some(Search::new(t, start, (h, behind), [&before, &last], targets));
        Ok(guess)
    }

    /// A try of the search: the length of the next one over that of this, or None where this one is the end.
    pub(super) fn searched(
        &mut self,
        mut search: Search,
        h: f64,
        (now, end): (Vec<f64>, &Motion<f64>),
        step: &mut dyn Within,
    ) -> Option<f64> {
        search.targets.extend(self.left(&now, self.zero));
        let is_behind = !self.passed_by(&search, &now).is_empty();
        let is_at = |k: &usize| !self.is_beyond(*k, now[*k], self.at);
        search.found = self.found(&search, &now, end, step);
        let is_end = search.is_last || !search.found.is_empty();
        let next = if is_end || !is_behind && self.passed_by(&search, &search.behind.1).iter().any(is_at) {
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

    /// Kinks that a step ends so near to that no error shows what laws change in between.
    fn found(&self, search: &Search, now: &[f64], end: &Motion<f64>, step: &mut dyn Within) -> Vec<usize> {
        if self.exact {
            return Vec::new();
        }
        let time = |k: usize| search.time(k, now[k]);
        let mut near = self.passed_by(search, now);
        if near.is_empty() {
            let ahead = self.passed_by(search, &search.behind.1);
            near = ahead.into_iter().min_by(|a, b| time(*a).total_cmp(&time(*b))).into_iter().collect();
        }
        let longest = near.iter().map(|k| time(*k)).fold(0.0, f64::max);
        let is_near = !near.is_empty() && longest < NEAR_KINK * search.behind.0;
        let is_found = is_near && self.effect(&near, end, longest, step) < KINK_EFFECT * step.allowed();
        if is_found { near } else { Vec::new() }
    }

    /// Kinks of a search behind which distances are.
    pub(super) fn passed_by(&self, search: &Search, distances: &[f64]) -> Vec<usize> {
        self.left(distances, self.at).into_iter().filter(|k| search.targets.contains(k)).collect()
    }
}
