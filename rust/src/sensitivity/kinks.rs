//! Where a motion has no derivative: kinks of laws that it passes, and impacts of drives.
//!
//! Steps end at sharp kinks of laws (`integrate::kinks`), where the derivative keeps its order: forces are continuous. Over others, sliders
//! and kinks that are rounded over less than a step, it is one-sided and first order in the step; a jump of an imposed rate makes rates jump at a fixed time, whatever the parameters do.
use crate::error::{Error, Result};
use crate::force::{AnyLaw, Class, Surface};
use crate::integrate::{Equations, Instant};
use crate::multibody::connector::motion_of;
use crate::multibody::topology::{BoundLaw, Owner};
use crate::tolerances::sensitivity::IMPACT;

/// A kink that the motion passed.
#[derive(Debug, Clone)]
pub struct Kink {
    pub t: f64,
    pub element: String,
    pub what: &'static str,
}

/// Signed distance of a law from its kink, and the width over which the kink is rounded.
#[derive(Debug, Clone, Copy)]
struct Distance {
    from: f64,
    width: f64,
}

/// The laws with kinks at which no step ends, and where they stood at the last instant.
pub struct Watch<'a> {
    eq: &'a Equations<'a, f64>,
    /// steps end at sharp kinks
    to_kinks: bool,
    last: Vec<Vec<Distance>>,
    pub found: Vec<Kink>,
}

const FRICTION: &str = "its friction changes its sign within a step";
const SLIDER: &str = "its slider begins or ceases to slide";
const REVERSAL: &str = "its rate or its state changes its sign within a step";
const GAP: &str = "its gap closes or opens";

fn what(law: AnyLaw) -> &'static str {
    match law.class() {
        _ if law.has_map() => SLIDER,
        _ if law.has_rates() => REVERSAL,
        Class::Friction => FRICTION,
        _ => GAP,
    }
}

impl<'a> Watch<'a> {
    pub fn new(eq: &'a Equations<'a, f64>, first: &Instant, to_kinks: bool) -> Self {
        let mut watch = Watch { eq, to_kinks, last: Vec::new(), found: Vec::new() };
        watch.last = watch.distances(first, first);
        watch
    }

    /// Note what was passed between two instants.
    pub fn pass(&mut self, from: &Instant, end: &Instant) {
        if self.last.is_empty() {
            return;
        }
        let now = self.distances(from, end);
        let (t0, t1) = (from.motion.t, end.motion.t);
        for (((owner, bound), before), after) in self.laws().into_iter().zip(&self.last).zip(&now) {
            for (a, b) in before.iter().zip(after) {
                let moved = (b.from - a.from).abs();
                if (a.from > 0.0) == (b.from > 0.0) || moved <= a.width {
                    continue;
                }
                self.found.push(Kink {
                    t: t0 + (t1 - t0) * (a.from.abs() / moved).min(1.0),
                    element: self.eq.topology().owner_name(owner).to_string(),
                    what: what(bound.law),
                });
            }
        }
        self.last = now;
    }

    fn has_kinks(&self, l: &BoundLaw) -> bool {
        l.law.has_map() || !self.surfaces(l).is_empty()
    }

    /// Kinks of a law at which no step ends.
    fn surfaces(&self, l: &BoundLaw) -> Vec<Surface> {
        let p = &self.eq.x[l.x..l.x + l.law.n_params()];
        let passed = |s: &Surface| if s.is_sharp() { !self.to_kinks } else { s.kink };
        l.law.surfaces(p).into_iter().filter(passed).collect()
    }

    fn laws(&self) -> Vec<(Owner, &'a BoundLaw)> {
        let all = self.eq.topology().connectors.iter();
        all.flat_map(|c| c.laws.iter().map(|l| (c.owner, l))).filter(|(_, l)| self.has_kinks(l)).collect()
    }

    fn distances(&self, from: &Instant, end: &Instant) -> Vec<Vec<Distance>> {
        let eq = self.eq;
        let topology = eq.topology();
        let connectors = topology.connectors.iter();
        let kinky: Vec<_> = connectors.filter(|c| c.laws.iter().any(|l| self.has_kinks(l))).collect();
        if kinky.is_empty() {
            return Vec::new();
        }
        let placement = eq.place(&end.motion);
        let mut out = Vec::new();
        for c in kinky {
            let moved = motion_of(topology, &eq.geometry, &placement, &eq.x, c);
            for law in c.laws.iter().filter(|l| self.has_kinks(l)) {
                let (u, v) = moved[law.component];
                let (before, after) = (&from.motion.memory[law.places()], &end.motion.memory[law.places()]);
                out.push(match law.law.has_map() {
                    true => slid(before, after),
                    false => self.surfaces(law).iter().map(|s| distance(s, u, v, after)).collect(),
                });
            }
        }
        out
    }
}

fn slid(before: &[f64], after: &[f64]) -> Vec<Distance> {
    let one = |(a, b)| Distance { from: if a == b { -1.0 } else { 1.0 }, width: 0.0 };
    before.iter().zip(after).map(one).collect()
}

fn distance(s: &Surface, u: f64, v: f64, z: &[f64]) -> Distance {
    Distance { from: s.distance(u, v, z), width: if s.width.is_finite() { s.width } else { 0.0 } }
}

/// Refuse motions of drives whose rates jump on the way: an impact.
pub fn no_impact(eq: &Equations<'_, f64>, start: f64, end: f64) -> Result<()> {
    if !eq.effects.drives {
        return Ok(());
    }
    for drive in &eq.topology().tables.drives {
        let motion = &eq.geometry.motions[drive.motion];
        for t in motion.kinks().into_iter().filter(|t| *t > start && *t <= end) {
            let before = t - 4.0 * f64::EPSILON * t.abs();
            let (a, b) = (motion.at(before)[1], motion.at(t)[1]);
            if (a - b).abs() > IMPACT * a.abs().max(b.abs()) {
                return Err(Error::NotDifferentiable(format!(
                    "the rate that '{}' imposes jumps from {a} to {b} at t = {t:.9} s: an impact, and the motion is not \
                     differentiable there; end before it, or impose a motion with a continuous rate (mb.Sine, mb.Polynomial)",
                    drive.name
                )));
            }
        }
    }
    Ok(())
}
