//! The first try of a step: does it pass a kink that counts, and where?
use crate::error::Result;
use crate::force::Side;
use crate::tolerances::steps::{KINK_CHANGE, KINK_EFFECT, SEEN_KINK};

use super::super::Motion;
use super::super::kink_search::Place;
use super::{Sides, Within, plain};

/// Parts of a step at which kinks are looked for, besides its end.
const LOOKED: [f64; 7] = [0.125, 0.25, 0.375, 0.5, 0.625, 0.75, 0.875];

impl Sides<'_, '_> {
    /// The first try of a step.
    pub(super) fn begun(
        &mut self,
        (t, h): (f64, f64),
        (now, end): (Vec<f64>, &Motion<f64>),
        step: &mut dyn Within,
    ) -> Result<Option<f64>> {
        self.longest = f64::INFINITY;
        let mut path = vec![(0.0, plain(&self.last))];
        let motions = step.between(&LOOKED)?;
        for (x, m) in LOOKED.iter().zip(&motions) {
            let here = plain(&self.distances(m));
            self.refresh(&here);
            path.push((*x, here));
        }
        path.push((1.0, now));
        if self.exact && self.is_on_both_sides(&path) {
            return Ok(Some(LOOKED[0]));
        }
        let n = path.len() - 1;
        let is_behind = !self.left(&path[n].1, self.zero).is_empty();
        let first = (1..n).find(|j| !self.left(&path[*j].1, SEEN_KINK).is_empty());
        if !self.exact && (is_behind || first.is_some()) {
            let (change, time) = self.change(h, &path, (&motions, end), step);
            let is_lasting =
                (0..n).any(|j| self.left(&path[j + 1].1, self.zero).iter().any(|k| self.kinks[*k].is_lasting()));
            if change < KINK_EFFECT * step.allowed() && !is_lasting {
                self.passed = self.left(&path[n].1, self.zero);
                return Ok(None);
            }
            if change.is_finite() && change > 0.0 {
                self.longest = time * (KINK_CHANGE / change).sqrt();
            }
        }
        match first {
            _ if is_behind => self.search_from(t, h, path, first.unwrap_or(n), step).map(Some),
            Some(j) => {
                self.inside = self.left(&path[j].1, SEEN_KINK).first().copied();
                Ok(Some(path[j].0))
            }
            None => self.touched(h, &path, step),
        }
    }

    /// What laws on the other sides of their kinks change in the step, and the time in which they do. They are farthest from these at the
    /// end, or inside where they come back.
    fn change(
        &self,
        h: f64,
        path: &[Place],
        (inside, end): (&[Motion<f64>], &Motion<f64>),
        step: &mut dyn Within,
    ) -> (f64, f64) {
        let left: Vec<Vec<usize>> = path.iter().map(|(_, d)| self.left(d, self.zero)).collect();
        let Some(begin) = left.iter().position(|l| !l.is_empty()) else { return (0.0, h) };
        let n = path.len() - 1;
        let back = (0..self.sides.len()).filter(|k| !left[n].contains(k) && left.iter().any(|l| l.contains(k)));
        let farthest = back.filter_map(|k| {
            let behind = (1..n).filter(|j| left[*j].contains(&k));
            behind.max_by(|i, j| path[*i].1[k].abs().total_cmp(&path[*j].1[k].abs()))
        });
        let mut places: Vec<usize> = farthest.chain([n]).collect();
        places.dedup();
        let changes = places.into_iter().filter(|j| !left[*j].is_empty()).map(|j| {
            let time = h * (path[j].0 - path[begin].0 + LOOKED[0]);
            (self.effect(&left[j], inside.get(j - 1).unwrap_or(end), time, step), time)
        });
        changes.fold((0.0, h), |most, own| if own.0 > most.0 || own.0.is_nan() { own } else { most })
    }

    /// What it changes up to a motion that laws were not on the other sides of these kinks for a time.
    pub(super) fn effect(&self, kinks: &[usize], m: &Motion<f64>, time: f64, step: &mut dyn Within) -> f64 {
        let mut sides = self.sides.clone();
        kinks.iter().for_each(|k| sides[*k] = sides[*k].opposite());
        step.effect(&self.eq.held(&self.kinked, &sides), m, time)
    }

    /// Is the side of a kink undecided, and the motion on both within the step?
    fn is_on_both_sides(&self, path: &[Place]) -> bool {
        let is_on = |k: usize, side: Side| {
            path.iter().any(|(_, d)| Side::of(d[k]) == side && self.is_beyond(k, d[k], self.zero))
        };
        (0..self.sides.len()).any(|k| self.is_undecided(k) && is_on(k, Side::Above) && is_on(k, Side::Below))
    }

    /// Where a distance is least between two places, beyond the kink.
    fn touched(&mut self, h: f64, path: &[Place], step: &mut dyn Within) -> Result<Option<f64>> {
        for (k, j) in (0..self.sides.len()).flat_map(|k| (1..path.len() - 1).map(move |j| (k, j))) {
            let own = |j: usize| if self.sides[k] == Side::Below { -path[j].1[k] } else { path[j].1[k] };
            let [a, b, c] = [own(j - 1), own(j), own(j + 1)];
            let (bend, slope) = (a - 2.0 * b + c, 0.5 * (c - a));
            // up to half the way to the next place, and at the ends of the step all of it
            let reach = |is_last: bool| if is_last { bend } else { 0.5 * bend };
            let is_within = slope <= reach(j == 1) && -slope <= reach(j + 2 == path.len());
            let is_least = self.sides[k] != Side::Free && is_within && bend > 0.0;
            // the parabola is as good as the bend is even
            if !is_least || b - 0.5 * slope * slope / bend > bend {
                continue;
            }
            let x = path[j].0 - slope / bend * LOOKED[0];
            for m in step.between(&[x])? {
                let there = plain(&self.eq.kink_distances(&self.kinked, &m, &self.sides));
                let is_seen = self.left(&there, SEEN_KINK).contains(&k);
                let is_small = |step: &mut dyn Within| {
                    let change = self.effect(&[k], &m, h * LOOKED[0], step);
                    change < KINK_EFFECT * step.allowed() && !self.kinks[k].is_lasting()
                };
                if is_seen && (self.exact || !is_small(step)) {
                    self.inside = Some(k);
                    return Ok(Some(x));
                }
            }
        }
        Ok(None)
    }
}
