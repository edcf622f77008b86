//! A step of generalised-alpha backwards: the exact reverse of `Along::alpha`.
//!
//! ```text
//! a, lam, v1: `closing`
//! s1:       [A J^T; R 0]^T (u, w) = (s1^/(h^2 b), 0)   then -u.balance - w.closure by q0, v0, a0, s0
//! ```
use nalgebra::DMatrix;

use crate::error::Result;
use crate::integrate::generalized_alpha::{Parameters, reached};
use crate::integrate::{Equations, Motion};
use crate::run::Counts;

use super::super::alpha::{Load, Solved};
use super::super::march::Here;
use super::closing::{accelerations_back, aligned_back, by_inertia, by_saddle, turned_back};
use super::increments::{add_numbers, add_turning_back, before_move, by_increments};
use super::recorder::{Adjoint, Recorder, add, column, remembered_back};

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
    if at.memory.iter().any(|m| *m != 0.0) {
        remembered_back(recorder, &from.instant.motion.memory, &end.instant.motion, &mut at);
        std::mem::swap(&mut before.memory, &mut at.memory);
    }
    for (i, d) in load.slope.iter().enumerate() {
        at.acceleration[i] += d / h;
        before.acceleration[i] -= d / h;
    }
    let there = Motion { memory: from.instant.motion.memory.clone(), ..end.instant.motion.clone() };
    let solved = by_saddle(&by.end.by, &at)?;
    accelerations_back(recorder, &there, &end.instant, solved, &mut at, &mut before);
    let star = aligned_back(recorder, &there, &by.end, &mut at)?;
    let start = Load::of(carried);
    let of = (&from.instant.motion, &there);
    let found = (&at, &star[..], &load);
    let own = stage_back(recorder, of, &start, (p, h), &by, found, &mut before)?;
    let shift = start.shift(p, h);
    let slope = match start.slope.is_empty() {
        true => vec![0.0; own.0.len()],
        false => own.0.iter().map(|d| shift * d).collect(),
    };
    before.load = Some(Load { a: own.0, rate_slope: own.1, slope, h: 0.0 });
    Ok(before)
}

/// A scheme that starts anew: from the adjoints after that to those before it.
pub fn anew_back(recorder: &mut Recorder<'_>, end: &Here, anew: &Here, mut at: Adjoint) -> Result<Adjoint> {
    at.first();
    let mut before = Adjoint::none(end);
    let m = &anew.instant.motion;
    let solved = by_inertia(recorder.eq, m, &at)?;
    accelerations_back(recorder, m, &anew.instant, solved, &mut at, &mut before);
    before.q = at.q;
    before.rate = at.rate;
    add(&mut before.memory, &at.memory);
    Ok(before)
}

/// Adjoints of what `reached` takes: increments and rates of the start, a0, s0, s1.
struct Taken {
    q: Vec<f64>,
    rate: Vec<f64>,
    a0: Vec<f64>,
    s0: Vec<f64>,
    s1: Vec<f64>,
}

/// `reached` backwards, from adjoints of the configuration (by increments), of v* and of a1; `rates`: v0 and v*.
fn reached_back(
    eq: &Equations<'_, f64>,
    (p, h): (Parameters, f64),
    (dq, rates): (&[f64], (&[f64], &[f64])),
    q: &[f64],
    star: &[f64],
    a1: &[f64],
) -> Taken {
    let by_dq = turned_back(eq, dq, q);
    let mut out = Taken { q: q.to_vec(), rate: vec![0.0; q.len()], a0: Vec::new(), s0: Vec::new(), s1: Vec::new() };
    before_move(eq, dq, &mut out.q);
    let mut star = star.to_vec();
    add_turning_back(eq, h, rates, &by_dq, (&mut out.rate, &mut star));
    for (i, v) in star.iter().enumerate() {
        let (d, unit) = (by_dq[i], 1.0 / (1.0 - p.am));
        let a = a1[i] + h * h * p.beta * d + h * p.gamma * v;
        out.rate[i] += h * d + v;
        out.a0.push(h * h * (0.5 - p.beta) * d + h * (1.0 - p.gamma) * v - p.am * unit * a);
        out.s0.push(p.af * unit * a);
        out.s1.push((1.0 - p.af) * unit * a);
    }
    out
}

/// The step itself, from its start to `there`; adjoints of a0 and s0.
fn stage_back(
    recorder: &mut Recorder<'_>,
    (from, there): (&Motion<f64>, &Motion<f64>),
    start: &Load<f64>,
    (p, h): (Parameters, f64),
    by: &Solved,
    (at, star, load): (&Adjoint, &[f64], &Load<f64>),
    before: &mut Adjoint,
) -> Result<(Vec<f64>, Vec<f64>)> {
    let (eq, hand) = (recorder.eq, &mut recorder.hand);
    let a0 = start.shifted(p, h);
    let (dq, m, _) = reached(eq, p, from, (&a0, &start.rate_slope, &by.s1), h);
    let q = by_increments(eq, there, &at.q);
    let turned = (&dq[..], (&from.rate[..], &m.rate[..]));
    let mut taken = reached_back(eq, (p, h), turned, &q, star, &load.a);
    let (b, g) = p.slopes();
    let unit = 1.0 / (h * h * b);
    let wanted: Vec<f64> = (taken.s1.iter().zip(&load.rate_slope)).map(|(a, b)| (a + b) * unit).collect();
    let none = DMatrix::zeros(eq.n_rows(), 1);
    let (u, w) = by.step.solve_transposed(&column(&wanted), &none)?;
    let uw = (u.as_slice(), w.as_slice());
    let found = hand.balance(&m, &by.s1, &by.lam, uw, h * h * b, h * b / g);
    let nothing = vec![0.0; eq.n()];
    let more = reached_back(eq, (p, h), turned, &found.q, &found.rate, &nothing);
    add(&mut taken.q, &more.q);
    add(&mut taken.rate, &more.rate);
    add(&mut taken.a0, &more.a0);
    add(&mut taken.s0, &more.s0);
    add_numbers(eq, from, &taken.q, &mut before.q);
    add(&mut before.rate, &taken.rate);
    add(&mut before.memory, &found.memory);
    Ok((taken.a0, taken.s0))
}
