//! The end of a step backwards: the exact reverse of `direct::closing`.
//!
//! ```text
//! a, lam:   [M J^T; J 0]^T (u, w) = (a^, lam^)    then -u.r - w.(J a + gamma) by q, v
//! v:        [M J^T; J 0]^T (u, w) = (v^, 0)       then -u.(M dv + J^T kappa) - w.(J v + Phi_t) by q, and M u for v before
//! q:        [M J^T; J 0]^T (u, w) = (J_l^T q^, 0) then -u.(M dy + J^T mu) - w.(Phi + J dy) by q before, for each correction
//! ```
use nalgebra::DMatrix;

use crate::error::Result;
use crate::integrate::{Equations, Instant, Motion};
use crate::linalg::kkt::Kkt;

use super::super::closing::{Aligned, Correction, accelerating, corrections};
use super::super::march::Here;
use super::super::runge_kutta::Stages;
use super::increments::{add_numbers, before_move, by_increments};
use super::recorder::{Adjoint, Recorder, add, column, remembered_back, transposed_times};

/// The end of a step: what is read of it and of its accelerations by increments (returned), rates and memories of where the step arrived.
pub fn ended_back(
    recorder: &mut Recorder<'_>,
    by: &Stages,
    end: &Here,
    mut at: Adjoint,
    more: &[f64],
) -> Result<(Vec<f64>, Adjoint)> {
    let eq = recorder.eq;
    if at.memory.iter().any(|m| *m != 0.0) {
        remembered_back(recorder, &by.end.memory, &end.instant.motion, &mut at);
    }
    let aligned = if eq.n_rows() > 0 { Some(Aligned::new(eq, &by.end, &by.open.rate)?) } else { None };
    if at.feels_acceleration() {
        let solved = match &aligned {
            Some(aligned) => by_saddle(&aligned.by, &at)?,
            None => by_inertia(eq, &by.end, &at)?,
        };
        let mut held = Adjoint::none(end);
        accelerations_back(recorder, &by.end, &end.instant, solved, &mut at, &mut held);
        add(&mut at.memory, &held.memory);
    }
    if let Some(aligned) = &aligned {
        at.rate = aligned_back(recorder, &by.end, aligned, &mut at)?;
    }
    let mut q = by_increments(eq, &by.end, &at.q);
    add(&mut q, more);
    for one in corrections(eq, &by.open, &by.end)?.iter().rev() {
        q = corrected_back(recorder, one, q)?;
    }
    Ok((q, at))
}

/// (u, w): adjoints of the equations that accelerations and multipliers solve.
pub type Weights = (Vec<f64>, Vec<f64>);

/// From [M J^T; J 0]^T (u, w) = (a^, lam^).
pub fn by_saddle(by: &Kkt, at: &Adjoint) -> Result<Weights> {
    let (u, w) = by.solve_transposed(&column(&at.acceleration), &column(&at.lam))?;
    Ok((u.as_slice().to_vec(), w.as_slice().to_vec()))
}

/// The same at a motion for which nothing is factorised: by the recursion over the tree where that serves.
pub fn by_inertia(eq: &Equations<'_, f64>, m: &Motion<f64>, at: &Adjoint) -> Result<Weights> {
    match eq.tree_solution(m, &at.acceleration) {
        Some(u) => Ok((u, vec![0.0; at.lam.len()])),
        None => by_saddle(&accelerating(eq, m)?.0, at),
    }
}

/// Accelerations and multipliers of an instant by its poses, rates and what laws remembered.
pub fn accelerations_back(
    recorder: &mut Recorder<'_>,
    there: &Motion<f64>,
    end: &Instant,
    (u, w): Weights,
    at: &mut Adjoint,
    before: &mut Adjoint,
) {
    let hand = &mut recorder.hand;
    let mut found = hand.balance(there, &end.acceleration, &end.lam, (&u, &[]), 1.0, 0.0);
    if !w.is_empty() {
        let (q, rate) = hand.row_bias(there, &end.acceleration, &w);
        add(&mut found.q, &q);
        add(&mut found.rate, &rate);
    }
    add_numbers(recorder.eq, there, &found.q, &mut at.q);
    add(&mut at.rate, &found.rate);
    add(&mut before.memory, &found.memory);
}

/// Rates of the end by its poses (added to `at`) and by those before (returned).
pub fn aligned_back(
    recorder: &mut Recorder<'_>,
    there: &Motion<f64>,
    by: &Aligned,
    at: &mut Adjoint,
) -> Result<Vec<f64>> {
    let rows = recorder.eq.n_rows();
    if rows == 0 {
        return Ok(at.rate.clone());
    }
    let (u, w) = by.by.solve_transposed(&column(&at.rate), &DMatrix::zeros(rows, 1))?;
    let (hand, u1) = (&mut recorder.hand, u.as_slice());
    let mut q = hand.mass(there, (&by.dv, &by.kappa), u1).q;
    add(&mut q, &hand.row_rates(there, w.as_slice()));
    add_numbers(recorder.eq, there, &q, &mut at.q);
    Ok(transposed_times(&by.by.matrix(), &u.column(0).into_owned()))
}

/// Increments after a correction by those before it.
fn corrected_back(recorder: &mut Recorder<'_>, one: &Correction, mut q: Vec<f64>) -> Result<Vec<f64>> {
    let (eq, hand) = (recorder.eq, &mut recorder.hand);
    let by_dy = turned_back(eq, &one.dy, &q);
    let (u, w) = one.by.solve_transposed(&column(&by_dy), &DMatrix::zeros(eq.n_rows(), 1))?;
    before_move(eq, &one.dy, &mut q);
    add(&mut q, &hand.row_values(&one.at, w.as_slice()));
    if !one.is_none() {
        add(&mut q, &hand.mass(&one.at, (&one.dy, &one.mu), u.as_slice()).q);
        add(&mut q, &hand.row_rates(&one.moving(), w.as_slice()));
        add(&mut q, &hand.row_rates(&one.still(), (-w).as_slice()));
    }
    Ok(q)
}

/// J_l(theta)^T q^: of changes of an increment, by those of the pose that it leads to.
pub fn turned_back(eq: &Equations<'_, f64>, theta: &[f64], q: &[f64]) -> Vec<f64> {
    eq.turned_columns(DMatrix::from_row_slice(1, q.len(), q), theta).as_slice().to_vec()
}
