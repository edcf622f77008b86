//! A step of ALI3-P backwards on the tape, for scenes that the virtual power does not know (flexible bodies).
//!
//! The equations are those of `adjoint_ali3p`. Each right side is a number, written on a tape by the generic text of the scheme and
//! differentiated by one pass backwards. Poses count with all twelve numbers, so that no chart is needed.
use nalgebra::{DMatrix, DVector};

use crate::analysis::transient::ali3p::{
    Factors, Record, Weight, balance, closure, lifted, metric_times, pulled, stars,
};
use crate::analysis::transient::{Instant, Motion};
use crate::error::Result;
use crate::run::Counts;

use super::march::Here;
use super::recorder::{
    Adjoint, Recorder, add, add_all, column, constant, remembered_back, weighed, weighed_poses,
};
use super::tape::Taped;

/// x^T A for the metric of the projections: what a change of v* or a* does to the right sides.
pub fn transposed_times(by: &DMatrix<f64>, u: &DVector<f64>) -> Vec<f64> {
    by.tr_mul(u).as_slice().to_vec()
}

/// From the adjoints at the end of a step to those at its start.
pub fn step_back(
    recorder: &mut Recorder<'_>,
    from: &Here,
    end: &Here,
    (record, factors): (&Record, &Factors),
    weight: Weight,
    mut at: Adjoint,
    counts: &mut Counts,
) -> Result<Adjoint> {
    let eq = recorder.eq;
    let h = record.h;
    let mut before = Adjoint::none(from);
    if !at.memory.is_empty() {
        remembered_back(recorder, from, end, &mut at);
        std::mem::swap(&mut before.memory, &mut at.memory);
    }
    let (from, end) = (&from.instant, &end.instant);
    // the projections: from v1, a1 to v*, a* and the configuration
    let (mut star_rate, mut star_acceleration) = (at.rate.clone(), at.acceleration.clone());
    let (star, a_star) = stars(eq, &from.motion, &from.acceleration, &record.dq, h);
    if let Some(projection) = &factors.projection {
        let none = DMatrix::zeros(eq.n_rows(), 1);
        let (u3, w3) = projection.solve_transposed(&column(&at.acceleration), &none)?;
        let bias = bias_back(recorder, end, &w3);
        add(&mut at.pose, &bias.pose);
        add(&mut at.rate, &bias.rate);
        let (u2, w2) = projection.solve_transposed(&column(&at.rate), &none)?;
        star_rate = transposed_times(&projection.matrix(), &u2.column(0).into_owned());
        star_acceleration = transposed_times(&projection.matrix(), &u3.column(0).into_owned());
        let weights = [&u2, &w2, &u3, &w3].map(|m| m.as_slice().to_vec());
        let found = metrics_back(recorder, &star, &a_star, end, record, weight, &weights);
        add(&mut at.pose, &found.pose);
        add(&mut star_rate, &found.rate);
        add(&mut star_acceleration, &found.acceleration);
        add(&mut before.memory, &found.memory);
    }
    let f = 2.0 / h;
    let mut increment = vec![0.0; eq.n()];
    for i in 0..eq.n() {
        increment[i] = f * star_rate[i] + f * f * star_acceleration[i];
        before.rate[i] -= star_rate[i] + 2.0 * f * star_acceleration[i];
        before.acceleration[i] -= star_acceleration[i];
    }
    moved_back(
        recorder,
        from,
        record,
        &at.pose,
        &mut increment,
        &mut before,
    );
    let c = 0.25 * h * h;
    let multipliers: Vec<f64> = at.lam.iter().map(|l| l / c).collect();
    let (u1, w1) = factors
        .step
        .solve_transposed(&column(&increment), &column(&multipliers))?;
    let eqt = recorder.begin();
    let leaves = recorder.leaves(&from.motion, &from.acceleration, &[], &[]);
    let (dq, lam) = (constant(&record.dq), constant(&record.lam));
    let (m, a) = stars(&eqt, &leaves.motion, &leaves.acceleration, &dq, h);
    let r = balance(&eqt, &m, &a, &lam, h, counts);
    let mut sum = -weighed(r.as_slice(), u1.as_slice());
    if eq.n_rows() > 0 {
        sum -= weighed(closure(&eqt, &m, h).as_slice(), w1.as_slice());
    }
    let (found, _) = recorder.finish(sum, &leaves);
    add_all(
        &mut before,
        &Adjoint {
            lam: Vec::new(),
            ..found
        },
    );
    Ok(before)
}

/// -w.(J a1 + gamma) by the configuration and v1; J a1 comes with the metrics, so that only gamma is taken here.
fn bias_back(recorder: &mut Recorder<'_>, end: &Instant, w: &DMatrix<f64>) -> Adjoint {
    let eq = recorder.begin();
    let leaves = recorder.leaves(&end.motion, &[], &[], &[]);
    let sum = -weighed(eq.row_bias(&leaves.motion).as_slice(), w.as_slice());
    let (found, _) = recorder.finish(sum, &leaves);
    found
}

/// -u2.(W dv + J^T kappa) - w2.(J v1 + Phi_t) - u3.(W da + J^T nu) - w3.J a1 by the configuration, v*, a* and the memory.
#[allow(clippy::too_many_arguments)]
fn metrics_back(
    recorder: &mut Recorder<'_>,
    star: &Motion<f64>,
    a_star: &[f64],
    end: &Instant,
    record: &Record,
    weight: Weight,
    [u2, w2, u3, w3]: &[Vec<f64>; 4],
) -> Adjoint {
    let eq = recorder.begin();
    let dual = (weight == Weight::Tangent).then(|| lifted(&eq));
    let leaves = recorder.leaves(star, a_star, &[], &[]);
    let (m, a) = (&leaves.motion, &leaves.acceleration);
    let jacobian = eq.rows(m).1;
    let mut sum = Taped::from(0.0);
    for (u, delta, y) in [
        (u2, &record.dv, &record.kappa),
        (u3, &record.da, &record.nu),
    ] {
        let metric = metric_times(&eq, dual.as_ref(), m, a, &constant(delta), record.h, weight);
        sum -= weighed(metric.as_slice(), u);
        sum -= weighed(pulled(&jacobian, y).as_slice(), u);
    }
    let moving = Motion {
        rate: constant(&end.motion.rate),
        ..m.clone()
    };
    let rates = eq.row_rates_of(&moving, &jacobian);
    let carried = &jacobian * DVector::from_vec(constant(&end.acceleration));
    sum -= weighed(rates.as_slice(), w2) + weighed(carried.as_slice(), w3);
    recorder.finish(sum, &leaves).0
}

/// The configuration at the end as a function of that at the start and of the increment.
fn moved_back(
    recorder: &mut Recorder<'_>,
    from: &Instant,
    record: &Record,
    pose: &[f64],
    increment: &mut [f64],
    before: &mut Adjoint,
) {
    let eq = recorder.begin();
    let leaves = recorder.leaves(&from.motion, &[], &[], &record.dq);
    let moved = leaves.motion.moved(eq.topology(), &leaves.extra);
    let sum = weighed_poses(&moved, pose);
    let (found, by_increment) = recorder.finish(sum, &leaves);
    add(&mut before.pose, &found.pose);
    add(increment, &by_increment);
}
