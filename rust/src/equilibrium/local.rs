//! The balance at one pose, free of units, and the spectrum of its stiffness.
use faer::Side;
use faer::prelude::*;
use nalgebra::{DMatrix, DVector};

use crate::constraint::closure::close;
use crate::constraint::loops::column_scales;
use crate::error::{Error, Result};
use crate::linearize::force_rounding::ForceRounding;
use crate::linearize::{Linearization, Setting, linearize, stiffness_terms};
use crate::multibody::System;
use crate::multibody::assemble::Effects;
use crate::multibody::placement::{State, advance, place};
use crate::run::Counts;
use crate::tolerances::equilibrium::{FALLS, NO_POTENTIAL, NO_STIFFNESS, PUSHED};
use crate::tolerances::matrices::ENTRY_ROUNDING;

/// Diagonal entries of the stiffness below this part of the largest of their island are made as large by stretching their coordinates: far
/// from what counts as no stiffness and from one.
fn graded() -> f64 {
    NO_STIFFNESS.sqrt()
}

/// Longest step, radians or characteristic lengths.
pub(crate) const LONGEST_STEP: f64 = 0.4;

/// The scaled problem at one iterate: K and r over coordinates of the order of a radian.
pub(crate) struct Local {
    pub k: DMatrix<f64>,
    pub m: DMatrix<f64>,
    pub r: DVector<f64>,
    pub scale: Vec<f64>,
    pub linearization: Linearization,
    /// sizes of the forces in the island of each coordinate
    pub sizes: Vec<f64>,
    pub islands: Vec<usize>,
    /// distance of the farthest body from the origin of the world, characteristic lengths
    pub far: f64,
    /// what a unit of each coordinate counts as where a step is judged, and whether its stiffness is more than rounding
    pub weight: Vec<f64>,
}

impl Local {
    pub fn at(system: &System, state: &State, effects: Effects, counts: &mut Counts) -> Result<Local> {
        let setting = Setting { system, state, memory: &[], acceleration: &[], effects };
        let linearization = linearize(&setting, counts)?;
        let topology = &*system.topology;
        let all = column_scales(topology, system.length);
        let coordinates = linearization.coordinates(system.n_tree());
        let scale: Vec<f64> = coordinates.iter().map(|i| all[*i]).collect();
        let n = scale.len();
        let scaled = |x: &DMatrix<f64>| DMatrix::from_fn(n, n, |i, j| x[(i, j)] * scale[i] * scale[j]);
        let (k, m) = (scaled(&linearization.matrices.stiffness), scaled(&linearization.matrices.mass));
        let r = DVector::from_fn(n, |i, _| linearization.residual[i] * scale[i]);
        let sizes = linearization.force_sizes.iter().map(|f| f.max(f64::MIN_POSITIVE)).collect();
        let islands: Vec<usize> = coordinates.iter().map(|i| topology.island_of(*i)).collect();
        let poses = place(topology, &system.geometry, &state.q, None).pose;
        let far = poses.iter().map(|p| p.p.norm()).fold(0.0, f64::max) / system.length;
        let weight = vec![1.0; n];
        let scale = scale.clone();
        let mut made = Local { k, m, r, scale, linearization, sizes, islands, far, weight };
        if made.is_graded() {
            made.weigh(&scaled(&stiffness_terms(&setting, &made.linearization)));
        }
        Ok(made)
    }

    /// The largest entry of the stiffness among the coordinates that coordinate i has to do with.
    pub(crate) fn stiffest(&self, i: usize) -> f64 {
        self.together(i).map(|j| self.k[(j, j)].abs()).fold(0.0, f64::max)
    }

    pub(crate) fn together(&self, i: usize) -> impl Iterator<Item = usize> + '_ {
        (0..self.islands.len()).filter(move |j| self.islands[*j] == self.islands[i])
    }

    pub(crate) fn is_graded(&self) -> bool {
        (0..self.r.len()).any(|i| self.k[(i, i)].abs() < graded() * self.stiffest(i))
    }

    /// Coordinates that are held softly beside stiff ones are stretched, those that are not held at all are not.
    pub(crate) fn weigh(&mut self, terms: &DMatrix<f64>) {
        for i in 0..self.r.len() {
            let own = self.k[(i, i)].abs();
            let rounding = ENTRY_ROUNDING * f64::EPSILON * (1.0 + self.far) * terms[(i, i)];
            let least = graded() * self.stiffest(i);
            if own > rounding && own < least {
                self.weight[i] = (least / own).sqrt();
            }
        }
    }

    /// The largest force that is left over, each over the size of the forces in its island.
    pub(crate) fn unbalance(&self) -> f64 {
        self.r.iter().zip(&self.sizes).map(|(r, size)| (r / size).abs()).fold(0.0, nan_or_larger)
    }

    pub(crate) fn relative(&self, r: &DVector<f64>) -> f64 {
        r.iter().zip(&self.sizes).map(|(r, size)| (r / size).powi(2)).sum::<f64>().sqrt()
    }

    /// What rounding of the places of bodies may make of the forces, with it of arms and of the strains of springs: (dof, sources).
    pub(crate) fn rounding(&self, setting: &Setting<'_>) -> DMatrix<f64> {
        let all: Vec<usize> = (0..self.r.len()).collect();
        let mut sources = ForceRounding::at(setting, &self.linearization).sources(&all);
        for (mut row, scale) in sources.row_iter_mut().zip(&self.scale) {
            row *= *scale;
        }
        sources
    }

    /// Whether what is left over may be that, or rounding of the coordinates and of the directions of forces.
    pub(crate) fn is_rounding(&self, setting: &Setting<'_>) -> bool {
        let rounding = ForceRounding::at(setting, &self.linearization);
        let unit = ENTRY_ROUNDING * f64::EPSILON;
        let most = |i: usize| {
            let natural: f64 = self.k.row(i).iter().map(|v| v.abs()).sum();
            unit * (self.sizes[i] + (1.0 + self.far) * natural) + rounding.total(i) * self.scale[i]
        };
        // the first one that is more answers
        let mut order: Vec<usize> = (0..self.r.len()).collect();
        let size = |i: usize| (self.r[i] / self.sizes[i]).abs();
        order.sort_by(|i, j| size(*j).total_cmp(&size(*i)));
        order.into_iter().all(|i| self.r[i].abs() <= most(i))
    }

    /// Coordinates along which more is left over than a balance may leave of the forces at work, if there are any.
    pub(crate) fn unresolved(&self) -> Option<DVector<f64>> {
        let acted_on = &self.linearization.acted_on;
        let left = DVector::from_fn(self.r.len(), |i, _| if acted_on[i] { self.r[i] / self.sizes[i] } else { 0.0 });
        let balanced = left.iter().all(|r| r.abs() <= PUSHED);
        (!balanced).then_some(left)
    }

    /// The skew part of the stiffness is small in every island.
    pub(crate) fn skew_below(&self, stiffness: f64, force: f64) -> bool {
        let n = self.r.len();
        let mut bounds = vec![(0.0_f64, 0.0_f64); self.islands.iter().max().map_or(0, |i| i + 1)];
        for (i, island) in self.islands.iter().enumerate() {
            let own = &mut bounds[*island];
            *own = (own.0.max(self.k.row(i).amax()), own.1.max(self.r[i].abs()));
        }
        let bound = |i: usize| stiffness * bounds[self.islands[i]].0 + force * bounds[self.islands[i]].1;
        (0..n).all(|i| {
            let most = bound(i);
            (0..i).all(|j| (self.k[(i, j)] - self.k[(j, i)]).abs() <= most)
        })
    }

    pub(crate) fn conservative(&self) -> bool {
        self.skew_below(NO_POTENTIAL, 0.0)
    }

    /// Off balance rotations about three axes make K skew by the moments that are left: no sign of missing potential.
    pub(crate) fn may_be_conservative(&self) -> bool {
        self.skew_below(NO_POTENTIAL, 2.0)
    }
}

/// W K W v_k = kappa_k v_k with W the weights of the coordinates, island by island: K^-1 = sum_k (W v_k)(W v_k)^T/kappa_k.
pub(crate) struct Spectrum {
    pub values: Vec<f64>,
    /// columns W v_k
    pub vectors: DMatrix<f64>,
    /// below this a value counts as none
    pub none: Vec<f64>,
    /// the size of the forces that work along each vector
    pub forces: Vec<f64>,
}

impl Spectrum {
    pub fn is_held(&self, k: usize) -> bool {
        self.values[k].abs() > self.none[k]
    }

    /// The force along a vector, over the size of the forces there.
    pub(crate) fn push(&self, k: usize, r: &DVector<f64>) -> f64 {
        let v = self.vectors.column(k);
        v.dot(r).abs() / (v.norm() * self.forces[k])
    }

    /// No stiffness is negative beyond rounding.
    pub(crate) fn stable(&self) -> bool {
        self.values.iter().zip(&self.none).all(|(v, none)| *v >= -FALLS / NO_STIFFNESS * none)
    }
}

/// Eigenvalues in ascending order.
pub(crate) fn spectrum(local: &Local) -> Result<Spectrum> {
    let n = local.r.len();
    let mut found: Vec<(f64, f64, f64, DVector<f64>)> = Vec::with_capacity(n);
    let mut islands = local.islands.clone();
    islands.sort_unstable();
    islands.dedup();
    for island in islands {
        let own: Vec<usize> = (0..n).filter(|i| local.islands[*i] == island).collect();
        let w = |i: usize| local.weight[own[i]];
        let entry = |i: usize, j: usize| 0.5 * (local.k[(own[i], own[j])] + local.k[(own[j], own[i])]) * w(i) * w(j);
        let eigen = Mat::from_fn(own.len(), own.len(), entry)
            .self_adjoint_eigen(Side::Lower)
            .map_err(|_| Error::singular("the stiffness has no eigenvalues: it is not finite"))?;
        let values: Vec<f64> = (0..own.len()).map(|i| eigen.S().column_vector()[i]).collect();
        let none = NO_STIFFNESS * values.iter().fold(0.0, |m: f64, v| m.max(v.abs()));
        let size = own.first().map_or(0.0, |i| local.sizes[*i]);
        for (k, value) in values.into_iter().enumerate() {
            let mut vector = DVector::zeros(n);
            own.iter().enumerate().for_each(|(i, at)| vector[*at] = eigen.U()[(i, k)] * w(i));
            found.push((value, none, size, vector));
        }
    }
    found.sort_by(|a, b| a.0.total_cmp(&b.0));
    Ok(Spectrum {
        values: found.iter().map(|f| f.0).collect(),
        none: found.iter().map(|f| f.1).collect(),
        forces: found.iter().map(|f| f.2).collect(),
        vectors: DMatrix::from_fn(n, n, |i, k| found[k].3[i]),
    })
}

/// The pose a step away, closed.
pub(crate) fn moved(
    system: &System,
    state: &State,
    local: &Local,
    step: &DVector<f64>,
    alpha: f64,
    effects: Effects,
    counts: &mut Counts,
) -> Result<State> {
    let z = DVector::from_fn(step.len(), |i, _| step[i] * alpha * local.scale[i]);
    let dy = match (&local.linearization.loops, &local.linearization.dependent_map) {
        (Some(l), Some(b)) => l.expand(b, &z),
        _ => z,
    };
    let mut next = state.clone();
    advance(&system.topology, &mut next.q, dy.as_slice());
    close(system, &mut next, effects, counts)?;
    Ok(next)
}

pub(crate) fn nan_or_larger(a: f64, b: f64) -> f64 {
    if a.is_nan() || a > b { a } else { b }
}
