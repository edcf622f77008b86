//! What objectives read and laws remember on the tape: which numbers are leaves, and where their derivatives go.
use nalgebra::{DMatrix, DVector};

use crate::error::Result;
use crate::integrate::{Equations, Instant, Motion};
use crate::model::geometry::Geometry;
use crate::run::Counts;

use super::super::alpha::Load;
use super::super::bdf::Past;
use super::super::march::Here;
use super::super::quantity::{Point, Quantity, evaluate};
use super::by_hand::ByHand;
use crate::ad::tape::{Taped, backwards, clear, leaf};

/// Adjoints of an instant, by the numbers of q.
#[derive(Clone)]
pub struct Adjoint {
    pub q: Vec<f64>,
    pub rate: Vec<f64>,
    pub acceleration: Vec<f64>,
    pub memory: Vec<f64>,
    pub lam: Vec<f64>,
    /// of what generalised-alpha carries on
    pub load: Option<Load<f64>>,
    /// of what "bdf" carries on
    pub past: Option<Past>,
}

impl Adjoint {
    pub fn none(here: &Here) -> Self {
        let at = &here.instant;
        let nothing = || vec![0.0; at.acceleration.len()];
        Adjoint {
            q: vec![0.0; at.motion.q.len()],
            rate: vec![0.0; at.motion.rate.len()],
            acceleration: vec![0.0; at.acceleration.len()],
            memory: vec![0.0; at.motion.memory.len()],
            lam: vec![0.0; at.lam.len()],
            load: here.carried.as_ref().map(|_| Load { a: nothing(), rate_slope: nothing(), slope: nothing(), h: 0.0 }),
            past: None,
        }
    }

    /// Is anything read of accelerations or multipliers?
    pub fn feels_acceleration(&self) -> bool {
        self.acceleration.iter().chain(&self.lam).any(|d| *d != 0.0)
    }

    /// What the first step takes from the accelerations.
    pub fn first(&mut self) {
        if let Some(load) = &self.load {
            add(&mut self.acceleration, &load.a);
            add(&mut self.acceleration, &load.rate_slope);
        }
    }
}

pub fn add(to: &mut [f64], d: &[f64]) {
    for (a, b) in to.iter_mut().zip(d) {
        *a += b;
    }
}

/// An instant on the tape, and where its numbers start among the leaves.
pub struct Leaves {
    pub motion: Motion<Taped>,
    pub acceleration: Vec<Taped>,
    pub lam: Vec<Taped>,
    places: [usize; 6],
}

/// The model on the tape: numbers and what is derived from them are leaves, so that the geometry is derived once, at the end.
pub struct Recorder<'a> {
    pub eq: &'a Equations<'a, f64>,
    n_x: usize,
    n_geometry: usize,
    /// adjoints of numbers and of the geometry, summed over all steps
    numbers: Vec<f64>,
    /// what needs no tape
    pub hand: ByHand<'a>,
}

impl<'a> Recorder<'a> {
    pub fn new(eq: &'a Equations<'a, f64>) -> Self {
        let mut n_geometry = 0;
        let _ = eq.geometry.map(|v: f64| {
            n_geometry += 1;
            v
        });
        let n_x = eq.x.len();
        Recorder { eq, n_x, n_geometry, numbers: vec![0.0; n_x + n_geometry], hand: ByHand::new(eq) }
    }

    /// Over equations of the same model that hold from here on; were they others?
    pub fn over(&mut self, eq: &'a Equations<'a, f64>) -> bool {
        let others = !std::ptr::eq(self.eq, eq);
        if others {
            self.eq = eq;
            self.hand.over(eq);
        }
        others
    }

    fn begin(&self) -> Equations<'a, Taped> {
        clear();
        let x = self.eq.x.iter().map(|v| leaf(*v)).collect();
        let geometry = self.eq.geometry.map(leaf);
        Equations::with_geometry(self.eq.system, x, geometry, self.eq.effects)
    }

    /// An instant as leaves.
    fn leaves(&self, m: &Motion<f64>, a: &[f64], lam: &[f64]) -> Leaves {
        let all = |v: &[f64]| v.iter().map(|x| leaf(*x)).collect::<Vec<_>>();
        let q = all(&m.q);
        let sizes = [q.len(), m.rate.len(), m.memory.len(), a.len(), lam.len()];
        let mut places = [self.n_x + self.n_geometry; 6];
        for (i, n) in sizes.iter().enumerate() {
            places[i + 1] = places[i] + n;
        }
        Leaves {
            motion: Motion { t: m.t, q, rate: all(&m.rate), memory: all(&m.memory) },
            acceleration: all(a),
            lam: all(lam),
            places,
        }
    }

    /// Differentiate a sum: numbers of the model are added up here, the instant's adjoints come back.
    fn finish(&mut self, sum: Taped, of: &Leaves) -> Adjoint {
        let d = backwards(sum, of.places[5]);
        let own = self.n_x + self.n_geometry;
        add(&mut self.numbers, &d[..own]);
        let part = |i: usize| d[of.places[i]..of.places[i + 1]].to_vec();
        Adjoint {
            q: part(0),
            rate: part(1),
            memory: part(2),
            acceleration: part(3),
            lam: part(4),
            load: None,
            past: None,
        }
    }

    /// Adjoints of the numbers x, those of the geometry carried to them.
    pub fn numbers(&self) -> Vec<f64> {
        let mut all = self.numbers.clone();
        self.hand.add_numbers(&mut all);
        clear();
        let x: Vec<Taped> = self.eq.x.iter().map(|v| leaf(*v)).collect();
        let geometry = Geometry::derive(&self.eq.system.topology.tables, &x);
        let mut sum = Taped::from(0.0);
        let mut place = self.n_x;
        let _ = geometry.map(|v: Taped| {
            sum += v * all[place];
            place += 1;
            0.0
        });
        let mut out = backwards(sum, self.n_x);
        add(&mut out, &all[..self.n_x]);
        out
    }
}

fn weighed(v: &[Taped], by: &[f64]) -> Taped {
    v.iter().zip(by).fold(Taped::from(0.0), |s, (v, w)| s + *v * *w)
}

pub fn column(v: &[f64]) -> DMatrix<f64> {
    DMatrix::from_column_slice(v.len(), 1, v)
}

/// Read quantities of an instant.
pub fn seed(
    recorder: &mut Recorder<'_>,
    at: &Instant,
    wanted: &[Quantity],
    seeds: &[f64],
    onto: &mut Adjoint,
) -> Result<()> {
    if seeds.iter().all(|s| *s == 0.0) {
        return Ok(());
    }
    let eq = recorder.begin();
    let leaves = recorder.leaves(&at.motion, &at.acceleration, &at.lam);
    let point = Point { motion: &leaves.motion, acceleration: &leaves.acceleration, lam: &leaves.lam };
    let sum = weighed(&evaluate(&eq, &point, wanted)?, seeds);
    let found = recorder.finish(sum, &leaves);
    add_all(onto, &found);
    Ok(())
}

pub fn add_all(to: &mut Adjoint, d: &Adjoint) {
    add(&mut to.q, &d.q);
    add(&mut to.rate, &d.rate);
    add(&mut to.acceleration, &d.acceleration);
    add(&mut to.memory, &d.memory);
    add(&mut to.lam, &d.lam);
}

/// What laws remember after the step, by what they remembered before and by where the step ended.
pub fn remembered_back(recorder: &mut Recorder<'_>, held: &[f64], end: &Motion<f64>, at: &mut Adjoint) {
    let eq = recorder.begin();
    let start = Motion { memory: held.to_vec(), ..end.clone() };
    let leaves = recorder.leaves(&start, &[], &[]);
    let mut m = leaves.motion.clone();
    eq.remember(&mut m, &mut Counts::default());
    let sum = weighed(&m.memory, &at.memory);
    let found = recorder.finish(sum, &leaves);
    add(&mut at.q, &found.q);
    add(&mut at.rate, &found.rate);
    at.memory = found.memory;
}

/// Rates of states of laws by where the motion is and by the states: adjoints are added.
pub fn state_rates_back(recorder: &mut Recorder<'_>, m: &Motion<f64>, by: &[f64], at: &mut Adjoint) {
    if by.iter().all(|d| *d == 0.0) {
        return;
    }
    let eq = recorder.begin();
    let leaves = recorder.leaves(m, &[], &[]);
    let sum = weighed(&eq.state_rates(&leaves.motion), by);
    let found = recorder.finish(sum, &leaves);
    add(&mut at.q, &found.q);
    add(&mut at.rate, &found.rate);
    add(&mut at.memory, &found.memory);
}

/// States of laws as a step of this length solves for them, by what they were and by the start of the step.
pub fn opened_back(recorder: &mut Recorder<'_>, from: &Here, h: f64, at: &mut Adjoint) {
    if at.memory.iter().all(|m| *m == 0.0) {
        return;
    }
    let eq = recorder.begin();
    let leaves = recorder.leaves(&from.instant.motion, &[], &[]);
    let mut m = leaves.motion.clone();
    eq.open_states(&mut m, 0.5 * h);
    let sum = weighed(&m.memory, &at.memory);
    let found = recorder.finish(sum, &leaves);
    add(&mut at.q, &found.q);
    add(&mut at.rate, &found.rate);
    at.memory = found.memory;
}

/// x^T A for the metric of the projections: what a change of v* or a* does to the right sides.
pub fn transposed_times(by: &DMatrix<f64>, u: &DVector<f64>) -> Vec<f64> {
    by.tr_mul(u).as_slice().to_vec()
}
