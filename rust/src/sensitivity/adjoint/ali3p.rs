//! A step of ALI3-P backwards, by hand: adjoints of configurations count along tree increments.
//!
//! ```text
//! a1:  [W J^T; J 0]^T (u, w) = (a1^, 0)       then -u.(W da + J^T nu) - w.(J a + gamma) by all it is made of
//! v1:  [W J^T; J 0]^T (u, w) = (v1^, 0)       then -u.(W dv + J^T kappa) - w.(J v + Phi_t)
//! dq:  [A J^T; R 0]^T (u, w) = (dq^, lam^/c)  then -u.balance - w.closure
//! ```
use nalgebra::DMatrix;

use crate::error::Result;
use crate::integrate::ali3p::{Factors, Record, Weight, stars};
use crate::integrate::{Equations, Instant};

use super::super::march::Here;
use super::by_hand::ByHand;
use super::closing::turned_back;
use super::increments::{add_numbers, add_turning_back, before_move, by_increments};
use super::recorder::{Adjoint, Recorder, add, column, remembered_back, transposed_times};

/// Adjoints at the end of the step: of the configuration by increments, of v* and a*.
struct Star {
    q: Vec<f64>,
    rate: Vec<f64>,
    acceleration: Vec<f64>,
}

/// From the adjoints at the end of a step to those at its start.
pub fn step_back(
    recorder: &mut Recorder<'_>,
    (from, end): (&Here, &Here),
    (record, factors): (&Record, &Factors),
    weight: Weight,
    mut at: Adjoint,
) -> Result<Adjoint> {
    let (eq, h) = (recorder.eq, record.h);
    let mut before = Adjoint::none(from);
    if at.memory.iter().any(|m| *m != 0.0) {
        remembered_back(recorder, &from.instant.motion.memory, &end.instant.motion, &mut at);
        std::mem::swap(&mut before.memory, &mut at.memory);
    }
    let hand = &mut recorder.hand;
    let (from, end) = (&from.instant, &end.instant);
    let mut star = projections_back(hand, eq, (from, end), (record, factors), weight, &at, &mut before)?;
    let f = 2.0 / h;
    let (theta, m, a) = stars(eq, &from.motion, &from.acceleration, &record.straight, h);
    let rates = (&from.motion.rate[..], &m.rate[..]);
    let turned = |q: &[f64], onto: (&mut [f64], &mut [f64])| {
        let by = turned_back(eq, &theta, q);
        add_turning_back(eq, h, rates, &by, onto);
        by
    };
    let (mut ignored, mut rate) = (vec![0.0; eq.n()], star.rate.clone());
    let mut increment = turned(&star.q, (&mut ignored, &mut rate));
    for i in 0..eq.n() {
        increment[i] += f * rate[i] + f * f * star.acceleration[i];
    }
    let c = 0.25 * h * h;
    let multipliers: Vec<f64> = at.lam.iter().map(|l| l / c).collect();
    let (u, w) = factors.step.solve_transposed(&column(&increment), &column(&multipliers))?;
    let found = hand.balance(&m, &a, &record.lam, (u.as_slice(), w.as_slice()), c, 0.5 * h);
    add(&mut star.q, &found.q);
    add(&mut star.rate, &found.rate);
    add(&mut star.acceleration, &found.acceleration);
    add(&mut before.memory, &found.memory);
    turned(&star.q, (&mut before.rate, &mut star.rate));
    for i in 0..eq.n() {
        before.rate[i] -= star.rate[i] + 2.0 * f * star.acceleration[i];
        before.acceleration[i] -= star.acceleration[i];
    }
    before_move(eq, &theta, &mut star.q);
    add_numbers(eq, &from.motion, &star.q, &mut before.q);
    Ok(before)
}

/// The projections: from v1, a1 to v*, a* and the configuration.
fn projections_back(
    hand: &mut ByHand<'_>,
    eq: &Equations<'_, f64>,
    (from, end): (&Instant, &Instant),
    (record, factors): (&Record, &Factors),
    weight: Weight,
    at: &Adjoint,
    before: &mut Adjoint,
) -> Result<Star> {
    let mut star =
        Star { q: by_increments(eq, &end.motion, &at.q), rate: at.rate.clone(), acceleration: at.acceleration.clone() };
    let Some(projection) = &factors.projection else {
        return Ok(star);
    };
    let none = DMatrix::zeros(eq.n_rows(), 1);
    let (u3, w3) = projection.solve_transposed(&column(&star.acceleration), &none)?;
    let (q, rate) = hand.row_bias(&end.motion, &end.acceleration, w3.as_slice());
    add(&mut star.q, &q);
    add(&mut star.rate, &rate);
    let (u2, w2) = projection.solve_transposed(&column(&star.rate), &none)?;
    add(&mut star.q, &hand.row_rates(&end.motion, w2.as_slice()));
    let matrix = projection.matrix();
    star.rate = transposed_times(&matrix, &u2.column(0).into_owned());
    star.acceleration = transposed_times(&matrix, &u3.column(0).into_owned());
    let (_, m, a) = stars(eq, &from.motion, &from.acceleration, &record.straight, record.h);
    for (u, change) in [(&u2, (&record.dv[..], &record.kappa[..])), (&u3, (&record.da[..], &record.nu[..]))] {
        let found = hand.metric(&m, &a, change, u.as_slice(), record.h, weight);
        add(&mut star.q, &found.q);
        add(&mut star.rate, &found.rate);
        add(&mut star.acceleration, &found.acceleration);
        add(&mut before.memory, &found.memory);
    }
    Ok(star)
}
