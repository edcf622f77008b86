//! A step of "bdf" backwards: the exact reverse of `Along::bdf`.
use nalgebra::DMatrix;

use crate::error::Result;
use crate::integrate::bdf::record::{Origin, Recharted, Recorded};
use crate::integrate::{Equations, Motion};
use crate::run::Counts;

use super::super::bdf::{Formulas, Past, binomials, collected};
use super::super::direct::slopes::Slopes;
use super::super::march::Here;
use super::super::runge_kutta::{Stages, inverse_maps};
use super::super::stages::{Coupled, Probe, places_of_states, sums};
use super::closing::{ended_back, turned_back};
use super::increments::{add_numbers, before_move};
use super::recorder::{Adjoint, Recorder, add, column, state_rates_back};
use super::runge_kutta::slope_back;
use super::stages::{Back, solved_back};

/// From the adjoints at the end of a step and of the history there to those at its start.
pub fn step_back(
    recorder: &mut Recorder<'_>,
    (from, end): (&Here, &Here),
    (by, step, probe): (&Stages, &Recorded, &Probe<'_>),
    mut at: Adjoint,
    counts: &mut Counts,
) -> Result<Adjoint> {
    let (eq, formulas) = (recorder.eq, Formulas::of(step));
    let mut past = at.past.take().unwrap_or_else(|| Past::none(eq.n(), at.memory.len(), 1));
    recharted_back(eq, step.after.as_ref(), &mut past);
    let [y, v, z] = past.d.each_ref().map(|d| sums(&formulas.new.transpose(), d).remove(0));
    past.map(&formulas.next.transpose());
    add(&mut at.rate, v.as_slice());
    add(&mut at.memory, z.as_slice());
    // y = theta + J_l^-1(theta) dy, dy from where the step arrived to its end
    let moved = eq.difference(&by.open, &by.end);
    let mut by_dy = vec![0.0; eq.n()];
    let mut theta = slope_back(eq, (&by.increment, &moved), y.as_slice(), &mut by_dy);
    add(&mut theta, y.as_slice());
    let [by_open, by_end] = seen_back(eq, &moved, &by_dy);
    let (mut q, last) = ended_back(recorder, by, end, at, &by_end)?;
    add(&mut q, &by_open);
    let mut all = Back::none(1);
    let none = Adjoint::none(from);
    all.push(&q, &theta, &Adjoint { rate: last.rate, memory: last.memory, ..none.clone() });
    let coupled = Coupled::new(probe, DMatrix::from_element(1, 1, step.c), by, counts)?;
    let mut base = solved_back(recorder, (by, probe), &coupled, all)?;
    past.x += &base.x;
    let mut by_states = DMatrix::zeros(base.z.nrows(), 1);
    for place in places_of_states(eq) {
        std::mem::swap(&mut by_states[place], &mut base.z[place]);
    }
    for (d, own) in past.d.iter_mut().zip([&base.theta[0], &base.v[0], &by_states]) {
        for (m, d) in d.iter_mut().enumerate() {
            *d += own * formulas.base[m];
        }
    }
    recharted_back(eq, step.before.as_ref(), &mut past);
    past.map(&formulas.stretch.transpose());
    let mut before = none;
    add(&mut before.memory, base.z.as_slice());
    before.past = originated_back(recorder, from, (by.h, &step.origin), past, &mut before);
    Ok(before)
}

/// The history that begins with a step: what is left are points before its start.
fn originated_back(
    recorder: &mut Recorder<'_>,
    from: &Here,
    (h, origin): (f64, &Origin),
    past: Past,
    before: &mut Adjoint,
) -> Option<Past> {
    let (eq, m) = (recorder.eq, &from.instant.motion);
    match origin {
        Origin::Before => Some(past),
        Origin::Rates => {
            let [y, v, z] = &past.d;
            add_numbers(eq, m, past.x.as_slice(), &mut before.q);
            add(&mut before.rate, (&y[1] * h + &v[0]).as_slice());
            add(&mut before.acceleration, (&v[1] * h).as_slice());
            add(&mut before.memory, z[0].as_slice());
            if eq.has_state_rates() {
                state_rates_back(recorder, m, (&z[1] * h).as_slice(), before);
            }
            None
        }
        Origin::Points(seen) => {
            let weights = collected(seen.len()).transpose();
            let [y, v, z] = past.d.each_ref().map(|d| sums(&weights, d));
            let mut here = past.x.as_slice().to_vec();
            let mut points = Vec::new();
            for (j, (seen, y)) in seen.iter().zip(&y).enumerate() {
                let [by_last, own] = seen_back(eq, seen, y.as_slice());
                add(&mut here, &by_last);
                let none = DMatrix::zeros(0, 1);
                points.push(Slopes { x: column(&own), v: v[j].clone(), a: none.clone(), lam: none, z: z[j].clone() });
            }
            add_numbers(eq, m, &here, &mut before.q);
            let mut out = Past { points: points.into_iter().rev().collect(), ..past };
            pointed_back(eq, m, &mut out, before);
            Some(out)
        }
    }
}

/// What a history that begins later takes from the start of a step.
pub fn pointed_back(eq: &Equations<'_, f64>, m: &Motion<f64>, past: &mut Past, before: &mut Adjoint) {
    let Some(point) = past.points.pop() else { return };
    add_numbers(eq, m, point.x.as_slice(), &mut before.q);
    add(&mut before.rate, point.v.as_slice());
    add(&mut before.memory, point.z.as_slice());
}

/// The increment that leads from one pose to another backwards: to both.
fn seen_back(eq: &Equations<'_, f64>, y: &[f64], by: &[f64]) -> [Vec<f64>; 2] {
    let mut row = DMatrix::from_row_slice(1, by.len(), by);
    crate::linalg::matrix::turn_columns(&mut row, &inverse_maps(eq, y));
    let to = row.as_slice().to_vec();
    let mut from: Vec<f64> = to.iter().map(|d| -d).collect();
    before_move(eq, y, &mut from);
    [from, to]
}

fn recharted_back(eq: &Equations<'_, f64>, by: Option<&Recharted>, past: &mut Past) {
    let Some(by) = by else { return };
    let (points, map) = (by.before.len(), binomials(by.before.len()).transpose());
    let seen = sums(&map, &past.d[0][..points]);
    let mut poses = vec![vec![0.0; eq.n()]; points];
    add(&mut poses[0], past.x.as_slice());
    for (j, (y, by_y)) in by.after.iter().zip(&seen).enumerate() {
        let [from, to] = seen_back(eq, y, by_y.as_slice());
        add(&mut poses[0], &from);
        add(&mut poses[j], &to);
    }
    past.x.fill(0.0);
    let mut back = Vec::new();
    for (y, mut q) in by.before.iter().zip(poses) {
        back.push(column(&turned_back(eq, y, &q)));
        before_move(eq, y, &mut q);
        add(past.x.as_mut_slice(), &q);
    }
    past.d[0][..points].clone_from_slice(&sums(&map, &back));
}
