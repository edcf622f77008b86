//! Q(s) = s^2 M + s D + S of sparse matrices at real or complex s: factors in one order, and the number of roots in a disc.
//!
//! The count is the argument principle: along a closed path the argument of det Q, over 2 pi, grows by the number of the roots inside.
use std::f64::consts::PI;

use faer::c64;

use crate::error::Result;
use crate::linalg::field::Field;
use crate::linalg::sparse::{Csc, Lu, LuPlan, argument_of_determinant};
use crate::run::{Cancel, Counts};
use crate::tolerances::sparse_modes::{COUNT_PANELS, COUNT_TURN};

pub struct Polynomial {
    /// the union of the patterns, its values do not matter
    pattern: Csc,
    m: Vec<f64>,
    d: Vec<f64>,
    s: Vec<f64>,
    plan: LuPlan,
}

/// A disc about zero, the roots known near its edge, and how far from `centre` no other is known.
pub struct Disc<'a> {
    pub radius: f64,
    /// with Im s >= 0; those above the real axis count with their conjugates
    pub known: &'a [c64],
    pub centre: c64,
    pub seen: f64,
}

impl Polynomial {
    pub fn new(m: &Csc, d: &Csc, s: &Csc) -> Self {
        let pattern = m.combined(1.0, 1.0, d).combined(1.0, 1.0, s);
        let [m, d, s] = [m, d, s].map(|a| a.spread_over(&pattern));
        Polynomial { pattern, m, d, s, plan: LuPlan::default() }
    }

    fn values<T: Field>(&self, s: T) -> Vec<T> {
        let square = s * s;
        (0..self.s.len()).map(|k| square * self.m[k] + s * self.d[k] + T::real(self.s[k])).collect()
    }

    pub fn factors<T: Field>(&self, s: T) -> Result<Lu<T>> {
        Lu::new(&self.pattern, &self.values(s), &self.plan)
    }

    /// How many roots in a disc are not among the known ones; None where the path cannot be followed.
    pub fn unknown_inside(&self, disc: &Disc<'_>, counts: &mut Counts, cancel: &Cancel) -> Result<Option<usize>> {
        // half of the circle: the other half mirrors it
        let mut open = vec![(0.0, PI)];
        let (mut turned, mut doubt, mut panels) = (0.0, 0.0, 0);
        while let Some((from, to)) = open.pop() {
            let step: f64 = to - from;
            let middle = 0.5 * (from + to);
            if step * disc.radius <= disc.clear(middle) {
                cancel.check()?;
                panels += 1;
                counts.add("determinants", 2 * NODES as u64);
                let Some(rates) = self.rates(disc, from, step)?.filter(|_| panels <= COUNT_PANELS) else {
                    return Ok(None);
                };
                let (turn, rest) = integral(&rates);
                if rest * step <= COUNT_TURN {
                    turned += turn * step;
                    doubt += rest * step;
                    continue;
                }
            }
            open.extend([(middle, to), (from, middle)]);
        }
        let found = (turned / PI).round();
        // another half turn, of the half circle, would be another count: half of what leads there is left to the estimate
        let sure = (turned - PI * found).abs() + doubt <= 0.25 * PI;
        Ok((sure && found >= 0.0).then_some(found as usize))
    }

    /// d arg f / d theta at the nodes of a panel, f = det Q over the product of the known factors.
    fn rates(&self, disc: &Disc<'_>, from: f64, step: f64) -> Result<Option<[f64; NODES]>> {
        // where no root lies within the panel's length of it, the argument turns by less than a right angle over this angle
        let apart = step / (8 * self.pattern.rows) as f64;
        let mut out = [0.0; NODES];
        for (k, rate) in out.iter_mut().enumerate() {
            let theta = from + 0.5 * step * (1.0 + node(k));
            let (Some(a), Some(b)) =
                (self.argument(disc, theta - 0.5 * apart)?, self.argument(disc, theta + 0.5 * apart)?)
            else {
                return Ok(None);
            };
            let turn = b - a;
            *rate = (turn - 2.0 * PI * (turn / (2.0 * PI)).round()) / apart;
        }
        Ok(Some(out))
    }

    /// arg f, up to whole turns.
    fn argument(&self, disc: &Disc<'_>, theta: f64) -> Result<Option<f64>> {
        let s = c64::from_polar(disc.radius, theta);
        let known: f64 = disc.known.iter().map(|k| argument_of_factor(s, *k)).sum();
        Ok(argument_of_determinant(&self.pattern, &self.values(s), &self.plan)?.map(|a| a - known))
    }
}

/// The argument of (s - k)(s - conj k), or of s - k for real k.
fn argument_of_factor(s: c64, k: c64) -> f64 {
    (s - k).arg() + if k.im == 0.0 { 0.0 } else { (s - k.conj()).arg() }
}

impl Disc<'_> {
    /// A guess of the distance of the path from unknown roots, which wrong ones only make slower.
    fn clear(&self, theta: f64) -> f64 {
        let away = (c64::from_polar(self.radius, theta) - self.centre).norm();
        (self.seen - away).max(0.5 * away)
    }
}

/// Nodes of Fejer's first rule on each panel.
const NODES: usize = 8;

fn node(k: usize) -> f64 {
    (PI * (k as f64 + 0.5) / NODES as f64).cos()
}

/// The mean of a function over its panel, and the size of the last terms of its Chebyshev series.
fn integral(f: &[f64; NODES]) -> (f64, f64) {
    let coefficient = |j: usize| {
        let sum: f64 = (0..NODES).map(|k| f[k] * (PI * j as f64 * (k as f64 + 0.5) / NODES as f64).cos()).sum();
        sum * if j == 0 { 1.0 } else { 2.0 } / NODES as f64
    };
    let mean = (0..NODES).step_by(2).map(|j| coefficient(j) / (1.0 - (j * j) as f64)).sum();
    (mean, coefficient(NODES - 1).abs() + coefficient(NODES - 2).abs())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Unit masses on springs 1.5 with springs 1 between them and a dashpot; every root by the dense route.
    #[test]
    fn roots_in_discs_are_counted() {
        let n = 40;
        let mut k = Vec::new();
        for i in 0..n {
            k.push((i, i, 3.5));
            if i > 0 {
                k.extend([(i, i - 1, -1.1), (i - 1, i, -0.9)]);
            }
        }
        let m = Csc::from_entries(n, n, (0..n).map(|i| (i, i, 1.0)).collect());
        let d = Csc::from_entries(n, n, vec![(7, 7, 0.4), (20, 20, 9.0)]);
        let s = Csc::from_entries(n, n, k);
        let dense = |a: &Csc| faer::Mat::from_fn(n, n, |i, j| a.get(i, j));
        let q = crate::linalg::quadratic::Quadratic::new(dense(&m), Some(dense(&d)), dense(&s));
        let form = q.normal_form().unwrap();
        let eigen = form.state_matrix(form.rate()).eigen().unwrap();
        let mut all: Vec<c64> = (0..2 * n).map(|k| eigen.S()[k]).filter(|s| s.im >= 0.0).collect();
        all.sort_by(|a, b| a.norm().total_cmp(&b.norm()));
        let p = Polynomial::new(&m, &d, &s);
        let conjugates = |known: &[c64]| known.iter().map(|s| if s.im == 0.0 { 1 } else { 2 }).sum::<usize>();
        let mut counts = Counts::default();
        for cut in [1, 4, 11, 30] {
            let radius = 0.5 * (all[cut - 1].norm() + all[cut].norm());
            for missing in [0, 1, 3_usize] {
                let known = &all[missing.min(cut)..(cut + 5).min(all.len())];
                let disc = Disc { radius, known, centre: all[0], seen: 0.1 };
                let found = p.unknown_inside(&disc, &mut counts, &Cancel::default()).unwrap();
                assert_eq!(found, Some(conjugates(&all[..missing.min(cut)])), "cut {cut}, missing {missing}");
            }
        }
        let work = counts.0["determinants"];
        assert!(work < 3000, "{work} determinants");
    }
}
