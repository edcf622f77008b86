//! Where a motion has no derivative: kinks of laws that it passes, and impacts of drives.
//!
//! Forces of all laws are continuous, so that a passed kink leaves the derivative of the discrete motion as it is, one-sided there
//! and first order in the step; a jump of an imposed rate makes rates jump at a fixed time, whatever the parameters do.
use crate::error::{Error, Result};
use crate::force::{AnyLaw, Class};
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

/// The laws with kinks, and where they stood at the last instant.
pub struct Watch<'a> {
    eq: &'a Equations<'a, f64>,
    last: Vec<Vec<Distance>>,
    pub found: Vec<Kink>,
}

const FRICTION: &str = "its friction changes its sign within a step";
const SLIDER: &str = "its slider begins or ceases to slide";
const GAP: &str = "its gap closes or opens";

fn what(law: AnyLaw) -> &'static str {
    match law.class() {
        _ if law.has_map() => SLIDER,
        Class::Friction => FRICTION,
        _ => GAP,
    }
}

impl<'a> Watch<'a> {
    pub fn new(eq: &'a Equations<'a, f64>, first: &Instant) -> Self {
        let mut watch = Watch { eq, last: Vec::new(), found: Vec::new() };
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
        let p = &self.eq.x[l.x..l.x + l.law.n_params()];
        l.law.has_map() || l.law.surfaces(p).iter().any(|s| s.kink)
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
                let p = &eq.x[law.x..law.x + law.law.n_params()];
                let memory = law.memory..law.memory + law.law.n_memory();
                let slid = (&from.motion.memory[memory.clone()], &end.motion.memory[memory]);
                out.push(distances(law.law, p, u, v, slid));
            }
        }
        out
    }
}

fn distances(law: AnyLaw, p: &[f64], u: f64, v: f64, (before, after): (&[f64], &[f64])) -> Vec<Distance> {
    let one = |from: f64, width: f64| Distance { from, width };
    if law.has_map() {
        return (before.iter().zip(after)).map(|(a, b)| one(if a == b { -1.0 } else { 1.0 }, 0.0)).collect();
    }
    let kinks = law.surfaces(p).into_iter().filter(|s| s.kink);
    kinks.map(|s| one(s.distance(u, v), s.width)).collect()
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
