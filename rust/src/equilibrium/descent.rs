//! Descent in energy to an equilibrium, by trust regions: for states from which Newton's method does not find one.
//!
//! ```text
//! p = -sum_k v_k (v_k . r)/(|kappa_k| + sigma),   sigma >= 0 such that |p| <= radius,   K v_k = kappa_k v_k
//! ```
//! A step is taken where the energy falls by a part of what r . p + p . K p/2 promises. Straight steps stretch what is stiff on
//! curved paths (a chain that bends, a body on a stiff strut); second-order corrections -(|K(p)| + sigma)^-1 (r(p) - r - K p) take that back
//! before the energy is judged (J. Nocedal and S. J. Wright, Numerical Optimization, 2006, sections 4.3 and 15.6). With one of them, by the
//! K from which the step came, steps along a strut of a hundred million times the other stiffnesses were ten times shorter. Loads without a
//! potential count by their work.
use nalgebra::DVector;

use crate::error::{Error, Result};
use crate::integrate::{Equations, Motion};
use crate::linearize::strain_rows::{Element, elements};
use crate::multibody::System;
use crate::multibody::assemble::Effects;
use crate::multibody::connector::{Wanted, load_interaction};
use crate::multibody::placement::State;
use crate::run::Counts;
use crate::spatial::{Pose, Six, V3, log_so3};

use crate::equilibrium::local::{self, LONGEST_STEP, Local, Spectrum, moved};

/// Least part of the promised fall of the energy.
const TAKEN: f64 = 0.05;
/// Second-order corrections of a step, of which each squares what the one before left.
const CORRECTIONS: usize = 3;
/// Of a translation, in characteristic lengths.
const LONGEST_TRAVEL: f64 = 1e3;

/// Energies of springs and gravity in one state, and the loads there.
struct Level {
    stored: f64,
    /// what rounding leaves of it
    rounding: f64,
    loads: Vec<(Pose<f64>, V3<f64>, Six<f64>)>,
}

impl Level {
    /// Energy above `before`.
    fn above(&self, before: &Level) -> f64 {
        let work = self.loads.iter().zip(&before.loads).map(|(now, then)| {
            let twice = now.2 + then.2;
            let turned = log_so3(&(now.0.r * then.0.r.transpose()));
            0.5 * (twice.l.dot(&(now.1 - then.1)) + twice.a.dot(&turned))
        });
        self.stored - before.stored - work.sum::<f64>()
    }
}

/// The energy of an element that rounding of places may make: the work of its forces along what it makes of the strains, and their own.
fn hidden_energy(element: &Element) -> f64 {
    let n = element.gradients.len();
    let along = |i: usize| {
        let stretched = (0..n).map(|j| element.k[i][j].abs() * element.rounding[j]).sum::<f64>();
        (element.force[i].abs() + stretched) * element.rounding[i]
    };
    (0..n).map(along).sum()
}

pub struct Descent<'s> {
    eq: Equations<'s, f64>,
    system: &'s System,
    effects: Effects,
    radius: f64,
}

impl<'s> Descent<'s> {
    pub fn new(system: &'s System, effects: Effects) -> Self {
        let geometry = (*system.geometry).clone();
        Descent {
            eq: Equations::with_geometry(system, system.x.to_vec(), geometry, effects),
            system,
            effects,
            radius: LONGEST_STEP,
        }
    }

    fn level(&self, state: &State) -> Level {
        let topology = &*self.system.topology;
        let motion = Motion { t: 0.0, q: state.q.clone(), rate: vec![0.0; self.eq.n()], memory: topology.at_rest(&[]) };
        let placement = self.eq.place(&motion);
        let energies = self.eq.energies(&motion);
        let stored = energies.elements.iter().map(|e| e.merit);
        let size = stored.clone().map(f64::abs).sum::<f64>() + energies.gravity.abs();
        let load = |i: usize| {
            let geometry = &self.eq.geometry;
            let acting = load_interaction(topology, geometry, &placement, i, 0.0, Wanted::FORCES);
            let pose = placement.pose[topology.node_of_body[topology.tables.loads[i].body]];
            (pose, acting.point, acting.wrench)
        };
        Level {
            stored: stored.sum::<f64>() + energies.gravity,
            rounding: f64::EPSILON * (energies.elements.len() + self.system.n_bodies()) as f64 * size
                + elements(self.system, &placement, self.effects).iter().map(hidden_energy).sum::<f64>(),
            loads: (0..topology.tables.loads.len()).map(load).collect(),
        }
    }

    /// One accepted step, or None where no step lowers the energy.
    pub fn step(
        &mut self,
        state: &State,
        local: &Local,
        spectrum: &Spectrum,
        counts: &mut Counts,
    ) -> Result<Option<(State, Local)>> {
        let start = self.level(state);
        while self.radius > f64::EPSILON.sqrt() {
            counts.add("descent steps", 1);
            let limits = self.limits(local);
            let (sigma, p) = shortened(spectrum, &local.r, &limits);
            let promised = local.r.dot(&p) + 0.5 * p.dot(&(&local.k * &p));
            let noise = start.rounding;
            let good = |rise: f64| rise <= TAKEN * promised + noise;
            let mut found = self.tried(state, local, &p, &start, counts)?;
            for _ in 0..CORRECTIONS {
                let Some((trial, next, rise)) = &found else { break };
                if good(*rise) || !same_coordinates(self.system, local, next) {
                    break;
                }
                counts.add("second-order corrections", 1);
                let extra = &next.r - &local.r - &local.k * &p;
                let c = answer(&local::spectrum(next)?, &extra, sigma);
                found = self.tried(trial, next, &c, &start, counts)?;
            }
            let part = reach(&p, &limits).min(1.0);
            match found {
                Some((next_state, next, rise)) if good(rise) => {
                    let ratio = rise / promised;
                    if ratio > 0.7 {
                        self.radius = f64::max(self.radius, 2.0 * part * self.radius).min(LONGEST_TRAVEL);
                    } else if ratio < 0.25 {
                        self.radius *= 0.5 * part;
                    }
                    return Ok(Some((next_state, next)));
                }
                _ => self.radius *= 0.3 * part,
            }
        }
        self.radius = LONGEST_STEP;
        Ok(None)
    }

    /// Longest change of each coordinate: rotations end at what a straight step makes sense for, travels may grow on.
    fn limits(&self, local: &Local) -> Vec<f64> {
        let dofs = &self.system.topology.dofs;
        let coordinates = local.linearization.coordinates(self.system.n_tree());
        let longest = |i: &usize| {
            if dofs[*i].freedom.rotation { self.radius.min(LONGEST_STEP) } else { self.radius }
        };
        coordinates.iter().map(longest).collect()
    }

    /// The state after a step and its energy above the start; None where loops do not close there.
    fn tried(
        &self,
        state: &State,
        local: &Local,
        step: &DVector<f64>,
        start: &Level,
        counts: &mut Counts,
    ) -> Result<Option<(State, Local, f64)>> {
        let (system, effects) = (self.system, self.effects);
        let made = moved(system, state, local, step, 1.0, effects, counts)
            .and_then(|s| Local::at(system, &s, effects, counts).map(|l| (s, l)));
        match made {
            Ok((s, l)) => {
                let rise = self.level(&s).above(start);
                Ok((rise.is_finite() && l.r.iter().all(|v| v.is_finite())).then_some((s, l, rise)))
            }
            Err(Error::Assembly(_) | Error::Singular(_)) => Ok(None),
            Err(other) => Err(other),
        }
    }
}

pub fn same_coordinates(system: &System, a: &Local, b: &Local) -> bool {
    let n = system.n_tree();
    a.linearization.coordinates(n) == b.linearization.coordinates(n)
}

fn answer(spectrum: &Spectrum, r: &DVector<f64>, sigma: f64) -> DVector<f64> {
    let mut step = DVector::zeros(r.len());
    for (k, value) in spectrum.values.iter().enumerate() {
        let stiffness = value.abs() + sigma;
        if stiffness > spectrum.none[k] {
            let v = spectrum.vectors.column(k);
            step -= v * (v.dot(r) / stiffness);
        }
    }
    step
}

/// The part of its limits that a step uses.
fn reach(p: &DVector<f64>, limits: &[f64]) -> f64 {
    let parts = p.iter().zip(limits).map(|(p, limit)| p.abs() / limit);
    parts.fold(0.0, f64::max)
}

/// sigma and the step within these limits.
fn shortened(spectrum: &Spectrum, r: &DVector<f64>, limits: &[f64]) -> (f64, DVector<f64>) {
    let full = answer(spectrum, r, 0.0);
    if reach(&full, limits) <= 1.0 {
        return (0.0, full);
    }
    // |p_i| <= |row i of the vectors| |vectors^T r|/sigma bounds sigma from above
    let pushed = spectrum.vectors.tr_mul(r).norm();
    let highest = (0..r.len()).map(|i| spectrum.vectors.row(i).norm() * pushed / limits[i]).fold(0.0, f64::max);
    let (mut low, mut high) = (0.0, highest);
    let mut p = answer(spectrum, r, high);
    let mut sigma = high;
    for _ in 0..40 {
        // down by two decades at a time to a bracket, whose geometric means follow; which ones only costs steps
        let middle = if low > 0.0 { f64::sqrt(low * high) } else { 0.01 * high };
        let q = answer(spectrum, r, middle);
        let part = reach(&q, limits);
        if part > 1.0 {
            low = middle;
        } else {
            (high, sigma) = (middle, middle);
            p = q;
            if part > 0.9 {
                break;
            }
        }
    }
    (sigma, p)
}
