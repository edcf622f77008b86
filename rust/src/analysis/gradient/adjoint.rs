//! The steps backwards: the exact reverse of what `direct` does forwards, whatever the number of parameters.
//!
//! ```text
//! a1:  [W J^T; J 0]^T (u, w) = (a1^, 0)       then -u.(W da + J^T nu) - w.(J a + gamma) by all it is made of
//! v1:  [W J^T; J 0]^T (u, w) = (v1^, 0)       then -u.(W dv + J^T kappa) - w.(J v + Phi_t)
//! dq:  [A J^T; R 0]^T (u, w) = (dq^, lam^/c)  then -u.balance - w.closure
//! ```
//! Each right side is a number, written on a tape by the generic text of the scheme and differentiated by one pass backwards. Poses
//! count with all twelve numbers, so that no chart is needed. Instants are kept at checkpoints; a stretch between two is run again.
use nalgebra::{DMatrix, DVector};

use crate::analysis::transient::ali3p::{
    Factors, Record, Weight, balance, closure, lifted, metric_times, pulled, stars,
};
use crate::analysis::transient::{Equations, Instant, Motion};
use crate::error::Result;
use crate::run::{Cancel, Counts};

use super::adjoint_alpha;
use super::kinks::{Kink, Watch};
use super::march::{Here, Made, March, Rule};
use super::quantity::{Point, Quantity, evaluate};
use super::recorder::{
    Adjoint, Recorder, add, add_all, column, constant, remembered_back, seed, weighed,
    weighed_poses,
};
use super::start::Starting;
use super::tape::Taped;
use super::{Direction, Plan};

/// x^T A for the metric of the projections: what a change of v* or a* does to the right sides.
pub fn transposed_times(by: &DMatrix<f64>, u: &DVector<f64>) -> Vec<f64> {
    by.tr_mul(u).as_slice().to_vec()
}

/// From the adjoints at the end of a step to those at its start.
fn step_back(
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

/// The first instant: accelerations and multipliers backwards; what is left are adjoints of poses and rates.
fn first_back(
    recorder: &mut Recorder<'_>,
    starting: &Starting<'_>,
    first: &Instant,
    mut at: Adjoint,
) -> Result<Adjoint> {
    at.first();
    let (u, w) = starting
        .accelerating()
        .solve_transposed(&column(&at.acceleration), &column(&at.lam))?;
    let eq = recorder.begin();
    let leaves = recorder.leaves(&first.motion, &[], &[], &[]);
    let a = constant(&first.acceleration);
    let r = eq.residual(
        &leaves.motion,
        &a,
        &constant(&first.lam),
        &mut Counts::default(),
    );
    let mut sum = -weighed(r.as_slice(), u.as_slice());
    if eq.n_rows() > 0 {
        let jacobian = eq.rows(&leaves.motion).1;
        let g = eq.row_bias(&leaves.motion) + jacobian * DVector::from_vec(a);
        sum -= weighed(g.as_slice(), w.as_slice());
    }
    let (found, _) = recorder.finish(sum, &leaves);
    add(&mut at.pose, &found.pose);
    add(&mut at.rate, &found.rate);
    Ok(at)
}

/// The motion with its values, kept for going back.
pub struct Forward {
    pub values: Vec<f64>,
    pub width: usize,
    every: usize,
    checkpoints: Vec<Here>,
    /// all of a short motion
    whole: Option<Stretch>,
    pub kinks: Vec<Kink>,
}

/// A step, and its end where the scheme then started anew.
type Gone = (Made, Option<Here>);

struct Stretch {
    places: Vec<Here>,
    steps: Vec<Gone>,
}

impl Stretch {
    fn at(first: &Here) -> Self {
        Stretch {
            places: vec![first.clone()],
            steps: Vec::new(),
        }
    }
}

/// Steps between checkpoints: all of a motion that may be kept whole, else so many that checkpoints and the stretch between two of
/// them need about the same.
fn stride(eq: &Equations<'_, f64>, plan: &Plan) -> usize {
    let n = plan.n_steps();
    let place = 12 * eq.topology().nodes.len() + 6 * eq.n() + 4 * eq.n_rows();
    let step = place + plan.rule.kept(eq.n(), eq.n_rows());
    if n * step <= plan.keep {
        return n.max(1);
    }
    let balanced = (n as f64 * place as f64 / step as f64).sqrt().ceil() as usize;
    balanced.clamp(1, n)
}

/// The motion forwards, with its values at all instants.
pub fn forward(
    eq: &Equations<'_, f64>,
    first: Instant,
    plan: &Plan,
    wanted: &[Quantity],
    cancel: &Cancel,
    counts: &mut Counts,
) -> Result<Forward> {
    plan.check()?;
    let n = plan.n_steps();
    let every = stride(eq, plan);
    let mut here = Here::first(first, plan.rule);
    let mut out = Forward {
        values: Vec::new(),
        width: wanted.iter().map(|q| q.width(eq)).sum(),
        every,
        checkpoints: Vec::new(),
        kinks: Vec::new(),
        whole: (every >= n).then(|| Stretch::at(&here)),
    };
    let (mut march, mut watch) = (March::new(eq, plan), Watch::new(eq, &here.instant));
    for i in 0..=n {
        if i > 0 {
            let (end, gone) = stepped(&mut march, i - 1, &here, cancel, counts)?;
            watch.pass(&here.instant, &end.instant);
            if let Some(whole) = &mut out.whole {
                whole.places.push(end.clone());
                whole.steps.push(gone);
            }
            here = end;
        }
        if i % every == 0 && i < n.max(1) {
            out.checkpoints.push(here.clone());
            march.forget();
        }
        let at = Point {
            motion: &here.instant.motion,
            acceleration: &here.instant.acceleration,
            lam: &here.instant.lam,
        };
        out.values.extend(evaluate(eq, &at, wanted)?);
    }
    out.kinks = watch.found;
    counts.add("checkpoints", out.checkpoints.len() as u64);
    let whole = out.whole.as_ref().map_or(0, |w| w.steps.len());
    counts.add("stored states", (out.checkpoints.len() + whole) as u64);
    Ok(out)
}

/// The next place, and how it came about.
fn stepped(
    march: &mut March<'_>,
    i: usize,
    from: &Here,
    cancel: &Cancel,
    counts: &mut Counts,
) -> Result<(Here, Gone)> {
    let (end, made) = march.step(i, from, cancel, counts)?;
    Ok(match march.anew(i, &end, counts)? {
        None => (end, (made, None)),
        Some(anew) => (anew, (made, Some(end))),
    })
}

fn repeat(
    eq: &Equations<'_, f64>,
    plan: &Plan,
    from: &Here,
    steps: std::ops::Range<usize>,
    cancel: &Cancel,
    counts: &mut Counts,
) -> Result<Stretch> {
    let mut out = Stretch::at(from);
    let mut march = March::new(eq, plan);
    for (k, i) in steps.enumerate() {
        let (end, gone) = stepped(&mut march, i, &out.places[k], cancel, counts)?;
        out.places.push(end);
        out.steps.push(gone);
    }
    Ok(out)
}

/// Derivatives of sum(seeds * values) along directions, for one set of seeds (n_t, width).
#[allow(clippy::too_many_arguments)]
pub fn backward(
    eq: &Equations<'_, f64>,
    run: &Forward,
    plan: &Plan,
    wanted: &[Quantity],
    seeds: &[f64],
    directions: &[Direction],
    cancel: &Cancel,
    counts: &mut Counts,
) -> Result<Vec<f64>> {
    let (n, w) = (plan.n_steps(), run.width);
    let mut recorder = Recorder::new(eq);
    let first = &run.checkpoints[0];
    let mut at = Adjoint::none(first);
    let mut longest = 0;
    for (k, checkpoint) in run.checkpoints.iter().enumerate().rev() {
        let (a, b) = (k * run.every, ((k + 1) * run.every).min(n));
        let again;
        let stretch = match &run.whole {
            Some(whole) => whole,
            None => {
                again = repeat(eq, plan, checkpoint, a..b, cancel, counts)?;
                longest = longest.max(again.steps.len());
                &again
            }
        };
        for i in (a..b).rev() {
            cancel.check()?;
            let (from, end) = (&stretch.places[i - a], &stretch.places[i - a + 1]);
            let own = &seeds[(i + 1) * w..(i + 2) * w];
            seed(&mut recorder, &end.instant, wanted, own, &mut at)?;
            counts.add("adjoint steps", 1);
            let (made, before) = &stretch.steps[i - a];
            let end = match before {
                None => end,
                Some(before) => {
                    at = adjoint_alpha::anew_back(&mut recorder, before, end, at)?;
                    before
                }
            };
            at = match (made, plan.rule) {
                (Made::Ali3p(record, by), Rule::Ali3p(weight)) => {
                    step_back(&mut recorder, from, end, (record, by), weight, at, counts)?
                }
                (Made::Alpha(p, h), _) => {
                    adjoint_alpha::step_back(&mut recorder, from, end, *p, *h, at, counts)?
                }
                _ => at,
            };
        }
    }
    counts.add("stored states", longest as u64);
    seed(&mut recorder, &first.instant, wanted, &seeds[..w], &mut at)?;
    let starting = Starting::new(eq, &first.instant, &plan.follow)?;
    let at = first_back(&mut recorder, &starting, &first.instant, at)?;
    let numbers = recorder.numbers();
    directions
        .iter()
        .enumerate()
        .map(|(p, direction)| {
            let mut d: f64 = direction.iter().map(|(i, v)| numbers[*i] * v).sum();
            if !starting.is_constant() {
                d += starting.weighed(eq, direction, p, &at.pose, &at.rate)?;
            }
            Ok(d)
        })
        .collect()
}
