//! Sliders that turn within a step.
//!
//! Within a step the memory z of a law is constant, so that its force f(u, z) is followed exactly while u goes one way. Where u
//! turns at u* the slider has moved there, which a step that ends behind the turn would miss: an error that no difference of
//! orders sees. Steps end at such turns. u between the ends of a step is taken as the cubic with the values and rates there.
use crate::force::{AnyLaw, Crossing, Surface};
use crate::multibody::connector::motion_of;
use crate::multibody::topology::BoundLaw;

use super::{Equations, Motion};

impl Equations<'_, f64> {
    /// The part of a step after which a slider turns first, where missing that would change its force by more than `tolerance` of it.
    /// `held`: sliders that can be held are.
    pub fn reversal(&self, from: &Motion<f64>, to: &Motion<f64>, tolerance: f64, held: bool) -> Option<f64> {
        if from.memory.is_empty() {
            return None;
        }
        let topology = self.topology();
        let slides = |l: &BoundLaw| self.slides(l, held);
        let connectors = topology.connectors.iter();
        let sliding: Vec<_> = connectors.filter(|c| c.laws.iter().any(slides)).collect();
        if sliding.is_empty() {
            return None;
        }
        let (before, after) = (self.place(from), self.place(to));
        let mut first: Option<f64> = None;
        for c in sliding {
            let moved = |place| motion_of(topology, &self.geometry, place, &self.x, c);
            let (start, end) = (moved(&before), moved(&after));
            for law in c.laws.iter().filter(|l| slides(l)) {
                let way = Way::new(start[law.component], end[law.component], to.t - from.t);
                let p = &self.x[law.x..law.x + law.law.n_params()];
                let memory = &from.memory[law.memory..law.memory + law.law.n_memory()];
                let turns = way.turns();
                if let Some(turn) = turns.first()
                    && way.missed(&turns, &law.law, p, memory) > tolerance
                {
                    first = Some(first.map_or(*turn, |f| f.min(*turn)));
                }
            }
        }
        first
    }

    /// Has a law sliders that are not held?
    fn slides(&self, l: &BoundLaw, held: bool) -> bool {
        l.law.has_map() && (!held || l.law.sliders(&self.x[l.x..l.x + l.law.n_params()]).is_empty())
    }
}

impl Equations<'_, f64> {
    /// Does a law pass a kink between two motions, or does a slider begin or cease to slide? `held`: laws are held on the sides of sharp
    /// kinks, and sliders.
    pub fn passes_kink(&self, from: &Motion<f64>, to: &Motion<f64>, (held, sliders): (bool, bool)) -> bool {
        let topology = self.topology();
        // friction that is rounded over a width has no kink that a step could pass
        let sharp = |s: &Surface| (s.crossing == Crossing::Displacement || s.width == 0.0) && !(held && s.is_sharp());
        let surfaces = |l: &BoundLaw| {
            let all = l.law.surfaces(&self.x[l.x..l.x + l.law.n_params()]);
            all.into_iter().filter(sharp).collect::<Vec<_>>()
        };
        let kinky = |l: &BoundLaw| self.slides(l, sliders) || !surfaces(l).is_empty();
        let connectors: Vec<_> = topology.connectors.iter().filter(|c| c.laws.iter().any(kinky)).collect();
        if connectors.is_empty() {
            return false;
        }
        let (before, after) = (self.place(from), self.place(to));
        connectors.into_iter().any(|c| {
            let moved = |place| motion_of(topology, &self.geometry, place, &self.x, c);
            let (start, end) = (moved(&before), moved(&after));
            c.laws.iter().filter(|l| kinky(l)).any(|l| {
                let p = &self.x[l.x..l.x + l.law.n_params()];
                let (u0, u1) = (start[l.component], end[l.component]);
                if surfaces(l)
                    .iter()
                    .any(|s| (s.distance(u0.0, u0.1, &[]) > 0.0) != (s.distance(u1.0, u1.1, &[]) > 0.0))
                {
                    return true;
                }
                if !self.slides(l, sliders) {
                    return false;
                }
                let memory = &from.memory[l.memory..l.memory + l.law.n_memory()];
                let mut slid = memory.to_vec();
                l.law.eval(u1.0, u1.1, p, &mut slid);
                slid != memory
            })
        })
    }
}

/// A coordinate along a step: values and rates times the step at both ends.
struct Way {
    e: [f64; 2],
    d: [f64; 2],
    rate: f64,
}

impl Way {
    fn new(start: (f64, f64), end: (f64, f64), h: f64) -> Self {
        Way { e: [start.0, end.0], d: [h * start.1, h * end.1], rate: end.1 }
    }

    fn at(&self, s: f64) -> f64 {
        let ([e0, e1], [d0, d1]) = (self.e, self.d);
        let gap = e1 - e0;
        e0 + s * (d0 + s * ((3.0 * gap - 2.0 * d0 - d1) + s * (d0 + d1 - 2.0 * gap)))
    }

    /// Where the cubic turns, inside the step, in order.
    fn turns(&self) -> Vec<f64> {
        let ([e0, e1], [d0, d1]) = (self.e, self.d);
        let gap = e1 - e0;
        // d0 + 2 b s + a s^2 = 0, without cancellation
        let (a, b) = (3.0 * (d0 + d1 - 2.0 * gap), 3.0 * gap - 2.0 * d0 - d1);
        let inside = b * b - a * d0;
        if inside <= 0.0 {
            return Vec::new();
        }
        let q = -(b + inside.sqrt().copysign(b));
        let mut roots: Vec<f64> =
            [q / a, d0 / q].into_iter().filter(|s| s.is_finite() && *s > 0.0 && *s < 1.0).collect();
        roots.sort_by(f64::total_cmp);
        roots
    }

    /// How much the force at the end differs between a slider that goes along and one that only sees the end.
    fn missed(&self, turns: &[f64], law: &AnyLaw, p: &[f64], memory: &[f64]) -> f64 {
        let mut blind = memory.to_vec();
        let short = law.eval(self.e[1], self.rate, p, &mut blind);
        let mut along = memory.to_vec();
        let mut size = short.abs();
        for s in turns {
            size = size.max(law.eval(self.at(*s), 0.0, p, &mut along).abs());
        }
        let whole = law.eval(self.e[1], self.rate, p, &mut along);
        (whole - short).abs() / size.max(whole.abs()).max(f64::MIN_POSITIVE)
    }
}

#[cfg(test)]
mod tests {
    use super::Way;

    #[test]
    fn turns_of_a_parabola() {
        // e = s (0.6 - s): turns at 0.3
        let way = Way::new((0.0, 0.6), (-0.4, -1.4), 1.0);
        assert!((way.turns()[0] - 0.3).abs() < 1e-14 && way.turns().len() == 1);
        assert!((way.at(0.3) - 0.09).abs() < 1e-15);
    }

    #[test]
    fn one_way_has_no_turn() {
        assert!(Way::new((0.0, 1.0), (1.0, 1.0), 1.0).turns().is_empty());
        assert!(Way::new((0.0, 0.0), (0.0, 0.0), 1.0).turns().is_empty());
    }
}
