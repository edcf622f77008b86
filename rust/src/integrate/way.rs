//! Where the driver stands between two steps, and what it decides about one.
use crate::error::Error;
use crate::joint::Coordinate;
use crate::kinematics::relative::whole_turns;
use crate::multibody::connector::{local, pair_of};
use crate::multibody::topology::Owner;

use super::detour::Detour;
use super::{Equations, Instant, Motion, Scheme, Step};

/// Where the march stands, and how it goes on.
pub(super) struct Way {
    pub here: Instant,
    pub h: f64,
    pub failures: usize,
    pub after_rejection: bool,
    pub detour: Option<Detour>,
    /// the length of the next step, which is to end at a kink of a law
    pub to_kink: Option<f64>,
    /// the output at which the next step is to end
    pub to_output: Option<f64>,
    /// the last step passed a kink of a law
    pub kinked: bool,
    /// length of the last step that was accepted
    pub recent: f64,
}

/// Springs, laws, couplers and constraints of angles whose turns no coordinate counts.
pub(super) struct Uncounted<'e, 's> {
    eq: &'e Equations<'s, f64>,
    /// joint or element, and its angle
    pairs: Vec<(Owner, Coordinate)>,
}

impl<'e, 's> Uncounted<'e, 's> {
    pub fn new(eq: &'e Equations<'s, f64>) -> Self {
        let topology = eq.topology();
        let tables = &topology.tables;
        let felt = topology.connectors.iter().filter(|c| c.k.is_some() || !c.laws.is_empty());
        let springs = felt.flat_map(|c| c.coordinates.iter().map(move |x| (c.owner, *x)));
        let coupled = tables.couplers.iter().flat_map(|c| c.joints.into_iter().zip(c.coordinates));
        let coupled = coupled.map(|(j, k)| (Owner::Joint(j), tables.joints[j].kind.free_coordinates()[k]));
        let bound = (0..tables.constraints.len()).flat_map(|c| tables.motions_of(c));
        let bound = bound.map(|(j, x)| (Owner::Joint(j), x));
        let lost = |(owner, x): &(Owner, Coordinate)| {
            let ((a, b), pair) = (topology.ends(*owner), pair_of(&eq.geometry, *owner));
            matches!(x, Coordinate::Angle { .. }) && topology.loses_turns(pair.number, a, b)
        };
        Uncounted { eq, pairs: springs.chain(coupled).chain(bound).filter(lost).collect() }
    }

    /// Whose angle goes over half a turn between two motions, where it jumps: value and rate no longer belong together.
    pub fn jump(&self, from: &Motion<f64>, to: &Motion<f64>) -> Option<&'s str> {
        if self.pairs.is_empty() {
            return None;
        }
        let (eq, topology) = (self.eq, self.eq.topology());
        let places = [eq.place(from), eq.place(to)];
        let jumps = |(owner, x): &&(Owner, Coordinate)| {
            let ((a, b), pair) = (topology.ends(*owner), pair_of(&eq.geometry, *owner));
            let [(e0, v0), (e1, v1)] = places.each_ref().map(|p| {
                let here = local(topology, p, a, b, pair);
                let row = here.relative.row(*x);
                (row.e, here.twist.map_or(0.0, |v| row.g.dot(&v)))
            });
            whole_turns(e1 - e0 - 0.5 * (v0 + v1) * (to.t - from.t)) != 0.0
        };
        self.pairs.iter().find(jumps).map(|(owner, _)| topology.owner_name(*owner))
    }
}

/// As `scaled_size`, but no number where an entry is none: such a step must not pass.
pub(super) fn scaled(v: &[f64], scales: &[f64]) -> f64 {
    v.iter().zip(scales).fold(0.0_f64, |s, (v, c)| {
        let v = (v / c).abs();
        if v > s || v.is_nan() { v } else { s }
    })
}

/// A step to try: its length, the time it hits exactly, the break it ends at.
pub(super) struct Aim {
    pub length: f64,
    pub target: Option<f64>,
    pub broken: Option<f64>,
}

/// What makes the next step: the detour's scheme while there is one.
pub(super) fn active<'s>(detour: &'s mut Option<Detour>, scheme: &'s mut dyn Scheme) -> &'s mut dyn Scheme {
    match detour {
        Some(d) => d.scheme.as_mut(),
        None => scheme,
    }
}

pub(super) enum Verdict {
    /// with its local error over what it may be, and that
    Accepted(Box<Step>, f64, f64),
    Rejected(f64, String),
    /// a slider turns after this part of the step
    Turned(f64),
    /// a step over a kink of a law: the length of another over its own
    Kinked(f64),
    /// the curve within the step is not accurate at the output of this time
    Cut(f64),
    Fatal(Error),
}

impl Verdict {
    /// A shorter step may have no error.
    pub fn of_error(error: Error) -> Self {
        match error {
            Error::Convergence { .. } | Error::Singular(_) => Verdict::Rejected(0.25, error.to_string()),
            error => Verdict::Fatal(error),
        }
    }
}
