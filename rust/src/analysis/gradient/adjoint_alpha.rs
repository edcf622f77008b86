//! A step of generalised-alpha backwards: the exact reverse of `Chunk::alpha`.
//!
//! ```text
//! a, lam:   [M J^T; J 0]^T (u, w) = (a^, lam^)    then -u.r - w.(J a + gamma) by q1, v1
//! v1:       [M J^T; J 0]^T (u, w) = (v1^, 0)      then -u.(M dv + J^T kappa) - w.(J v1 + Phi_t) by q1, and M u for v*
//! s1:       [A J^T; R 0]^T (u, w) = (s1^/(h^2 b), 0)   then -u.balance - w.closure by q0, v0, a0, s0
//! ```
use nalgebra::{DMatrix, DVector};

use crate::analysis::transient::Motion;
use crate::analysis::transient::ali3p::pulled;
use crate::analysis::transient::generalized_alpha::{Parameters, reached};
use crate::analysis::transient::penalty::Penalty;
use crate::error::Result;
use crate::run::Counts;

use super::adjoint_taped::transposed_times;
use super::alpha::{Load, Solved, accelerating, balance, closure};
use super::march::Here;
use super::recorder::{
    Adjoint, Leaves, Recorder, add, column, constant, remembered_back, weighed, weighed_poses,
};

/// From the adjoints at the end of a step to those at its start.
pub fn step_back(
    recorder: &mut Recorder<'_>,
    from: &Here,
    end: &Here,
    p: Parameters,
    h: f64,
    mut at: Adjoint,
    counts: &mut Counts,
) -> Result<Adjoint> {
    let mut before = Adjoint::none(from);
    let (Some(carried), Some(load)) = (&from.carried, at.load.take()) else {
        return Ok(before);
    };
    let by = Solved::new(recorder.eq, p, from, end, h, counts)?;
    if !at.memory.is_empty() {
        remembered_back(recorder, from, end, &mut at);
        std::mem::swap(&mut before.memory, &mut at.memory);
    }
    for (i, d) in load.slope.iter().enumerate() {
        at.acceleration[i] += d / h;
        before.acceleration[i] -= d / h;
    }
    let there = Motion {
        memory: from.instant.motion.memory.clone(),
        ..end.instant.motion.clone()
    };
    accelerations_back(recorder, &there, end, &by.end, &mut at, &mut before)?;
    let star = rates_back(recorder, &there, &by, &mut at)?;
    let start = Load::of(carried);
    let own = stage_back(
        recorder,
        from,
        &start,
        p,
        h,
        &by,
        (&at, &star, &load),
        &mut before,
        counts,
    )?;
    let shift = start.shift(p, h);
    let slope = match start.slope.is_empty() {
        true => vec![0.0; own.0.len()],
        false => own.0.iter().map(|d| shift * d).collect(),
    };
    before.load = Some(Load {
        a: own.0,
        rate_slope: own.1,
        slope,
        h: 0.0,
    });
    Ok(before)
}

/// Accelerations and multipliers of the end by its poses, rates and what laws remembered.
fn accelerations_back(
    recorder: &mut Recorder<'_>,
    there: &Motion<f64>,
    end: &Here,
    by: &Penalty,
    at: &mut Adjoint,
    before: &mut Adjoint,
) -> Result<()> {
    let (u, w) = by.solve_transposed(&column(&at.acceleration), &column(&at.lam))?;
    let eq = recorder.begin();
    let leaves = recorder.leaves(there, &[], &[], &[]);
    let (a, lam) = (
        constant(&end.instant.acceleration),
        constant(&end.instant.lam),
    );
    let r = eq.residual(&leaves.motion, &a, &lam, &mut Counts::default());
    let mut sum = -weighed(r.as_slice(), u.as_slice());
    if !w.is_empty() {
        let carried = eq.rows(&leaves.motion).1 * DVector::from_vec(a);
        sum -= weighed(
            (eq.row_bias(&leaves.motion) + carried).as_slice(),
            w.as_slice(),
        );
    }
    let (found, _) = recorder.finish(sum, &leaves);
    add(&mut at.pose, &found.pose);
    add(&mut at.rate, &found.rate);
    add(&mut before.memory, &found.memory);
    Ok(())
}

/// A scheme that starts anew: from the adjoints after that to those before it.
pub fn anew_back(
    recorder: &mut Recorder<'_>,
    end: &Here,
    anew: &Here,
    mut at: Adjoint,
) -> Result<Adjoint> {
    at.first();
    let mut before = Adjoint::none(end);
    let m = &anew.instant.motion;
    let by = accelerating(recorder.eq, m)?.0;
    accelerations_back(recorder, m, anew, &by, &mut at, &mut before)?;
    before.pose = at.pose;
    before.rate = at.rate;
    add(&mut before.memory, &at.memory);
    Ok(before)
}

/// Rates of the end by its poses (added to `at`) and by v* (returned).
fn rates_back(
    recorder: &mut Recorder<'_>,
    there: &Motion<f64>,
    by: &Solved,
    at: &mut Adjoint,
) -> Result<Vec<f64>> {
    let rows = recorder.eq.n_rows();
    if rows == 0 {
        return Ok(at.rate.clone());
    }
    let (u, w) = by
        .end
        .solve_transposed(&column(&at.rate), &DMatrix::zeros(rows, 1))?;
    let eq = recorder.begin();
    let leaves = recorder.leaves(there, &[], &[], &[]);
    let m = Motion {
        rate: constant(&there.rate),
        ..leaves.motion.clone()
    };
    let jacobian = eq.rows(&m).1;
    let moved = eq.mass(&m) * DVector::from_vec(constant(&by.dv)) + pulled(&jacobian, &by.kappa);
    let rates = eq.row_rates_of(&m, &jacobian);
    let sum = -weighed(moved.as_slice(), u.as_slice()) - weighed(rates.as_slice(), w.as_slice());
    let (found, _) = recorder.finish(sum, &leaves);
    add(&mut at.pose, &found.pose);
    Ok(transposed_times(
        &by.end.matrix(),
        &u.column(0).into_owned(),
    ))
}

/// The step itself; adjoints of a0 and s0.
#[allow(clippy::too_many_arguments)]
fn stage_back(
    recorder: &mut Recorder<'_>,
    from: &Here,
    start: &Load<f64>,
    p: Parameters,
    h: f64,
    by: &Solved,
    (at, star, load): (&Adjoint, &[f64], &Load<f64>),
    before: &mut Adjoint,
    counts: &mut Counts,
) -> Result<(Vec<f64>, Vec<f64>)> {
    let n = recorder.eq.n();
    let numbers = [start.shifted(p, h), start.rate_slope.clone(), by.s1.clone()].concat();
    let moved = &from.instant.motion;
    let collect = |found: Adjoint, before: &mut Adjoint| {
        add(&mut before.pose, &found.pose);
        add(&mut before.rate, &found.rate);
        add(&mut before.memory, &found.memory);
    };
    let parts = |leaves: &Leaves| {
        let e = &leaves.extra;
        (e[..n].to_vec(), e[n..2 * n].to_vec(), e[2 * n..].to_vec())
    };
    let eq = recorder.begin();
    let leaves = recorder.leaves(moved, &[], &[], &numbers);
    let (a0, s0, s1) = parts(&leaves);
    let (_, m, a1) = reached(&eq, p, &leaves.motion, (&a0, &s0, &s1), h);
    let sum = weighed_poses(&m, &at.pose) + weighed(&m.rate, star) + weighed(&a1, &load.a);
    let (found, mut own) = recorder.finish(sum, &leaves);
    collect(found, before);
    let unit = 1.0 / (h * h * p.slopes().0);
    let wanted: Vec<f64> = (own[2 * n..].iter().zip(&load.rate_slope))
        .map(|(a, b)| (a + b) * unit)
        .collect();
    let none = DMatrix::zeros(recorder.eq.n_rows(), 1);
    let (u, w) = by.step.solve_transposed(&column(&wanted), &none)?;
    let eq = recorder.begin();
    let leaves = recorder.leaves(moved, &[], &[], &numbers);
    let (a0, s0, _) = parts(&leaves);
    let s1 = constant(&by.s1);
    let (_, m, _) = reached(&eq, p, &leaves.motion, (&a0, &s0, &s1), h);
    let r = balance(&eq, p, &m, &s1, &constant(&by.lam), h, counts);
    let sum = -weighed(r.as_slice(), u.as_slice())
        - weighed(closure(&eq, p, &m, h).as_slice(), w.as_slice());
    let (found, more) = recorder.finish(sum, &leaves);
    collect(found, before);
    add(&mut own, &more);
    Ok((own[..n].to_vec(), own[n..2 * n].to_vec()))
}
