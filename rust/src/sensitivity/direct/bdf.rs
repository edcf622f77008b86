//! All directions along a step of "bdf".
use nalgebra::DMatrix;

use crate::error::Result;
use crate::integrate::bdf::record::{Origin, Recharted, Recorded};
use crate::run::Counts;

use super::super::bdf::{Formulas, Past, binomials, collected};
use super::super::march::Here;
use super::super::runge_kutta::{Stages, inverse_maps};
use super::super::stages::{Base, Coupled, Probe, places_of_states, sums};
use super::along::Along;
use super::slopes::{add_mapped, carried};

impl Along<'_> {
    /// The end of a step and the history behind it; the history is that of its start before.
    pub fn bdf(
        &mut self,
        (from, end): (&Here, &Here),
        (by, step): (&Stages, &Recorded),
        past: &mut Past,
        probe: &Probe<'_>,
        counts: &mut Counts,
    ) -> Result<()> {
        let formulas = Formulas::of(step);
        self.originated(from, (by.h, &step.origin), past);
        past.map(&formulas.stretch);
        self.recharted(step.before.as_ref(), past);
        let [theta, v, z] = past.d.each_ref().map(|d| sums(&formulas.base, d));
        let mut base = Base { x: past.x.clone(), theta, v, z: self.now.z.clone() };
        for place in places_of_states(self.eq) {
            base.z.row_mut(place).copy_from(&z[0].row(place));
        }
        let coupled = Coupled::new(probe, DMatrix::from_element(1, 1, step.c), by, counts)?;
        let theta = self.solved(by, &coupled, &base, probe, &mut |_, _, _| Ok(()), counts)?;
        let open = self.now.x.clone();
        self.ended(by, &end.instant, counts)?;
        let moved = self.eq.difference(&by.open, &by.end);
        let dy = self.seen(&moved, &open, &self.now.x);
        let y = theta.clone() + self.slope((&by.increment, &moved), (&theta, &dy));
        self.remember(&by.end, &end.instant.motion, counts);
        past.map(&formulas.next);
        for (d, new) in past.d.iter_mut().zip([&y, &self.now.v, &self.now.z]) {
            for (i, d) in d.iter_mut().enumerate() {
                *d += new * formulas.new[i];
            }
        }
        self.recharted(step.after.as_ref(), past);
        Ok(())
    }

    /// The history that begins with a step.
    fn originated(&self, from: &Here, (h, origin): (f64, &Origin), past: &mut Past) {
        let now = &self.now;
        let fresh = || Past::none(now.x.nrows(), now.z.nrows(), now.x.ncols());
        match origin {
            Origin::Before => {}
            Origin::Rates => {
                *past = fresh();
                past.x.clone_from(&now.x);
                let rates = self.rates(&from.instant);
                past.d[0][1] = &now.v * h;
                past.d[1][0].clone_from(&now.v);
                past.d[1][1] = &now.a * h;
                past.d[2][0].clone_from(&now.z);
                past.d[2][1] = rates * h;
            }
            Origin::Points(seen) => {
                let mut points = std::mem::replace(past, fresh()).points;
                points.push(now.clone());
                let of = |part: &dyn Fn(usize) -> DMatrix<f64>| (0..seen.len()).map(part).collect::<Vec<_>>();
                let at = |j: usize| &points[points.len() - 1 - j];
                let weights = collected(seen.len());
                past.d = [
                    sums(&weights, &of(&|j| self.seen(&seen[j], &now.x, &at(j).x))),
                    sums(&weights, &of(&|j| at(j).v.clone())),
                    sums(&weights, &of(&|j| at(j).z.clone())),
                ];
                past.x.clone_from(&now.x);
            }
        }
    }

    /// Changes of the increment that leads from one pose to another, by those of the poses.
    fn seen(&self, y: &[f64], from: &DMatrix<f64>, to: &DMatrix<f64>) -> DMatrix<f64> {
        let difference = to - carried(self.eq.topology(), y, from);
        let mut out = DMatrix::zeros(to.nrows(), to.ncols());
        add_mapped(&inverse_maps(self.eq, y), &difference, &mut out);
        out
    }

    /// The points of the history seen from the last one.
    fn recharted(&self, by: Option<&Recharted>, past: &mut Past) {
        let Some(by) = by else { return };
        let map = binomials(by.before.len());
        let points = sums(&map, &past.d[0][..by.before.len()]);
        let poses = points.iter().zip(&by.before).map(|(dy, y)| self.reached(&past.x, y, dy));
        let poses: Vec<_> = poses.collect();
        let seen: Vec<_> = poses.iter().zip(&by.after).map(|(x, y)| self.seen(y, &poses[0], x)).collect();
        past.d[0][..by.before.len()].clone_from_slice(&sums(&map, &seen));
        past.x.clone_from(&poses[0]);
    }

    /// A point from which a history may begin.
    pub fn pointed(&self, past: &mut Past) {
        past.points.push(self.now.clone());
    }
}
