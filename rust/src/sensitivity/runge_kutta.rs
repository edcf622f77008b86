//! A step of the explicit Runge-Kutta method as equations to be differentiated.
//!
//! ```text
//! y_i = h sum_j a_ij Y_j,   v_i = v0 + h sum_j a_ij a_j,   z_i = z0 + h sum_j a_ij g_j          q_i = exp(y_i) q0
//! Y_i = J_l^-1(y_i) v_i,    M a_i + h_i + J^T lam_i = 0,   J a_i + gamma_i = 0,   g_i = g(q_i, v_i, z_i)
//! ```
//! and the same sums with weights b for y, v*, z of the end, which is then moved to the constraints by the smallest change in
//! kinetic energy (`closing`).
use nalgebra::DMatrix;
use num_dual::Dual64;

use crate::error::{Error, Result};
use crate::integrate::dop853_numbers::{A, B, C, Row};
use crate::integrate::explicit8::{Coordinates, Explicit8, RecordedStage};
use crate::integrate::radau::FIVE;
use crate::integrate::{Equations, Instant, Motion, Scheme};
use crate::multibody::rotations::{Maps, increment_slope, rotation_triples};
use crate::run::Counts;
use crate::spatial::V3;

/// A step with its stages; of the explicit method the first is its start, of an implicit one the last is its end.
pub struct Stages {
    pub h: f64,
    pub all: Vec<RecordedStage>,
    /// where the stages lead, with its increments; and the end, which is moved to the constraints
    pub open: Motion<f64>,
    pub increment: Vec<f64>,
    /// with the memories before laws march theirs
    pub end: Motion<f64>,
}

impl Stages {
    /// Of a method whose end is its last stage.
    pub fn implicit(h: f64, all: Vec<RecordedStage>, end: &Instant) -> Result<Self> {
        let last = all.last().ok_or_else(|| Error::model("a step without stages was recorded"))?;
        let (open, increment) = (last.at.motion.clone(), last.increment.clone());
        Ok(Stages { h, open, increment, end: end.motion.clone(), all })
    }
}

/// h A of Radau's method.
pub fn weights(h: f64) -> DMatrix<f64> {
    DMatrix::from_fn(FIVE.stages(), FIVE.stages(), |i, j| h * FIVE.a[i][j])
}

/// How the sums of stage i weigh the stages before it.
pub fn stage_row(i: usize) -> Row {
    A[i]
}

/// How the end weighs all stages.
pub fn end_row() -> Row {
    B
}

/// Stages after the first that the end weighs: (stage, fraction of the step, weight).
pub fn inner_nodes() -> impl Iterator<Item = (usize, f64, f64)> {
    B.iter().filter(|(i, _)| *i > 0).map(|(i, b)| (*i, C[*i], *b))
}

/// What the start of a step counts in a quadrature over the step.
pub fn start_weight() -> f64 {
    B.iter().find(|(i, _)| *i == 0).map_or(0.0, |(_, b)| *b)
}

/// Numbers that a step keeps for going back.
pub fn kept(stages: usize, n: usize, rows: usize) -> usize {
    stages * (4 * n + rows)
}

/// A step of length h, and its stages.
pub fn step(eq: &Equations<'_, f64>, from: &Instant, h: f64, counts: &mut Counts) -> Result<(Instant, Stages)> {
    let mut scheme = Explicit8::new(Coordinates::Tree, None).recording();
    let end = scheme.step(eq, from, h, false, counts)?.end;
    let all = scheme.recorded();
    let (mut increment, mut rate) = (vec![0.0; eq.n()], from.motion.rate.clone());
    for (i, weight) in end_row() {
        let own = &all[*i];
        let slope = eq.increment_rates(&own.increment, &own.at.motion.rate);
        increment.iter_mut().zip(&slope).for_each(|(y, s)| *y += h * weight * s);
        rate.iter_mut().zip(&own.at.acceleration).for_each(|(v, a)| *v += h * weight * a);
    }
    eq.same_branch(&rate, &end, h)?;
    let open = Motion { rate, ..from.motion.moved(eq.topology(), &increment) };
    let open = Motion { t: end.motion.t, memory: end.motion.memory.clone(), ..open };
    let stages = Stages { h, all, open, increment, end: end.motion.clone() };
    Ok((end, stages))
}

/// Derivatives of Y = J_l^-1(y) v by y and by v, for every three rotations that act together; elsewhere Y is v.
pub fn slope_maps(eq: &Equations<'_, f64>, y: &[f64], v: &[f64]) -> [Maps; 2] {
    let mut out = [Vec::new(), Vec::new()];
    for (first, sign) in rotation_triples(eq.topology()) {
        let lift = |of: &[f64], along: Option<usize>| {
            let part = |k: usize| Dual64::new(sign * of[first + k], if along == Some(k) { sign } else { 0.0 });
            V3::new(part(0), part(1), part(2))
        };
        for (which, maps) in out.iter_mut().enumerate() {
            let mut map = [[0.0; 3]; 3];
            for k in 0..3 {
                let along = |of: usize| (of == which).then_some(k);
                let d = increment_slope(lift(y, along(0)), lift(v, along(1)));
                for (row, d) in map.iter_mut().zip(d.iter()) {
                    row[k] = sign * d.eps;
                }
            }
            maps.push((first, map));
        }
    }
    out
}

/// J_l^-1 of every three rotations that act together.
pub fn inverse_maps(eq: &Equations<'_, f64>, y: &[f64]) -> Maps {
    let [_, by_v] = slope_maps(eq, y, &vec![0.0; y.len()]);
    by_v
}
