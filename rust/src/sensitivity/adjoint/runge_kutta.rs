//! A Runge-Kutta step backwards: the exact reverse of `Along::runge_kutta`.
//!
//! ```text
//! end:      y1^, v1^ through the projections, then   Y_i^ += h b_i y1^,   a_i^ += h b_i v1^
//! stage i:  (y_i^, v_i^) by Y_i and a_i, then        Y_j^ += h a_ij y_i^, a_j^ += h a_ij v_i^   for all j before it
//! ```
//! with stages from the last to the first, which is the start of the step.
use crate::error::Result;
use crate::integrate::dop853_numbers::Row;
use crate::integrate::{Equations, Instant};
use crate::multibody::rotations::Maps;

use super::super::march::Here;
use super::super::runge_kutta::{Stages, end_row, slope_maps, stage_row};
use super::closing::{accelerations_back, by_inertia, ended_back, turned_back};
use super::increments::{add_numbers, before_move, by_increments};
use super::recorder::{Adjoint, Recorder, add, state_rates_back};

/// Adjoints of the start of a step: by increments, rates and memories.
struct Start {
    q: Vec<f64>,
    rate: Vec<f64>,
    memory: Vec<f64>,
}

/// Adjoints of Y, a and g of a stage.
#[derive(Clone)]
struct Slope {
    y: Vec<f64>,
    v: Vec<f64>,
    z: Vec<f64>,
}

/// How a point depends on the start and on slopes: its increment, and the weights of its sums.
struct Sum<'a> {
    increment: &'a [f64],
    row: Row,
    h: f64,
}

/// From the adjoints at the end of a step to those at its start; `seed` adds what is read of a stage.
pub fn step_back(
    recorder: &mut Recorder<'_>,
    (from, end): (&Here, &Here),
    by: &Stages,
    at: Adjoint,
    seed: &mut dyn FnMut(&mut Recorder<'_>, usize, &Instant, &mut Adjoint) -> Result<()>,
) -> Result<Adjoint> {
    let eq = recorder.eq;
    let mut before = Adjoint::none(from);
    let (q, at) = ended_back(recorder, by, end, at, &[])?;
    let none = |n: usize| vec![0.0; n];
    let (n, n_z) = (eq.n(), at.memory.len());
    let mut slopes = vec![Slope { y: none(n), v: none(n), z: none(n_z) }; by.all.len()];
    let mut start = Start { q: none(n), rate: none(n), memory: none(n_z) };
    let sum = Sum { increment: &by.increment, row: end_row(), h: by.h };
    sum.back(eq, (q, none(n), &at), &mut slopes, &mut start);
    for (i, own) in by.all.iter().enumerate().rev() {
        let (motion, slope) = (&own.at.motion, slopes[i].clone());
        let mut at = Adjoint::none(from);
        seed(recorder, i, &own.at, &mut at)?;
        if eq.has_state_rates() {
            state_rates_back(recorder, motion, &slope.z, &mut at);
        }
        if i == 0 {
            add(&mut before.acceleration, &slope.v);
            add(&mut start.rate, &slope.y);
            super::recorder::add_all(&mut before, &at);
            break;
        }
        add(&mut at.acceleration, &slope.v);
        let mut y = slope_back(eq, (&own.increment, &motion.rate), &slope.y, &mut at.rate);
        if at.feels_acceleration() {
            let solved = by_inertia(eq, motion, &at)?;
            let mut held = Adjoint::none(from);
            accelerations_back(recorder, motion, &own.at, solved, &mut at, &mut held);
            add(&mut at.memory, &held.memory);
        }
        let q = by_increments(eq, motion, &at.q);
        let sum = Sum { increment: &own.increment, row: stage_row(i), h: by.h };
        sum.back(eq, (q, std::mem::take(&mut y), &at), &mut slopes, &mut start);
    }
    add_numbers(eq, &from.instant.motion, &start.q, &mut before.q);
    add(&mut before.rate, &start.rate);
    add(&mut before.memory, &start.memory);
    Ok(before)
}

impl Sum<'_> {
    /// Adjoints of a point, by increments there and along its own increment, to those of slopes and of the start.
    fn back(
        &self,
        eq: &Equations<'_, f64>,
        (mut q, mut y, at): (Vec<f64>, Vec<f64>, &Adjoint),
        slopes: &mut [Slope],
        start: &mut Start,
    ) {
        add(&mut y, &turned_back(eq, self.increment, &q));
        before_move(eq, self.increment, &mut q);
        add(&mut start.q, &q);
        add(&mut start.rate, &at.rate);
        add(&mut start.memory, &at.memory);
        for (j, weight) in self.row {
            let slope = &mut slopes[*j];
            for (to, d) in [(&mut slope.y, &y), (&mut slope.v, &at.rate), (&mut slope.z, &at.memory)] {
                to.iter_mut().zip(d).for_each(|(to, d)| *to += self.h * weight * d);
            }
        }
    }
}

/// Y = J_l^-1(y) v backwards: adjoints of y come back, those of v are added.
pub fn slope_back(eq: &Equations<'_, f64>, (y, v): (&[f64], &[f64]), by: &[f64], rate: &mut [f64]) -> Vec<f64> {
    let [by_y, by_v] = slope_maps(eq, y, v);
    let mut own = by.to_vec();
    let mut out = vec![0.0; by.len()];
    let times = |maps: &Maps, k: usize, to: &mut [f64]| {
        let (first, map) = &maps[k];
        for l in 0..3 {
            to[first + l] += (0..3).map(|row| map[row][l] * by[first + row]).sum::<f64>();
        }
    };
    for (k, (first, _)) in by_y.iter().enumerate() {
        own[*first..first + 3].fill(0.0);
        times(&by_y, k, &mut out);
        times(&by_v, k, &mut own);
    }
    add(rate, &own);
    out
}
