//! The steps backwards: the exact reverse of what `direct` does forwards, whatever the number of parameters.
//!
//! ```text
//! a1:  [W J^T; J 0]^T (u, w) = (a1^, 0)       then -u.(W da + J^T nu) - w.(J a + gamma) by all it is made of
//! v1:  [W J^T; J 0]^T (u, w) = (v1^, 0)       then -u.(W dv + J^T kappa) - w.(J v + Phi_t)
//! dq:  [A J^T; R 0]^T (u, w) = (dq^, lam^/c)  then -u.balance - w.closure
//! ```
//! Each right side is a number, written on a tape by the generic text of the scheme and differentiated by one pass backwards. Poses
//! count with all twelve numbers, so that no chart is needed. Instants are kept at checkpoints; a stretch between two is run again.
use nalgebra::{DMatrix, DVector, Matrix3, Vector3};

use crate::analysis::transient::ali3p::{
    Record, Weight, balance, closure, lifted, metric_times, pulled, stars,
};
use crate::analysis::transient::{Equations, Instant, Motion};
use crate::error::Result;
use crate::model::geometry::Geometry;
use crate::run::{Cancel, Counts};
use crate::spatial::Pose;

use super::direct::Factors;
use super::quantity::{Point, Quantity, evaluate};
use super::start::Starting;
use super::tape::{Taped, backwards, clear, leaf};
use super::{Direction, Plan, advance};

/// Adjoints of an instant; poses with twelve numbers each.
#[derive(Clone)]
struct Adjoint {
    pose: Vec<f64>,
    rate: Vec<f64>,
    acceleration: Vec<f64>,
    memory: Vec<f64>,
    lam: Vec<f64>,
}

impl Adjoint {
    fn none(at: &Instant) -> Self {
        Adjoint {
            pose: vec![0.0; 12 * at.motion.relative.len()],
            rate: vec![0.0; at.motion.rate.len()],
            acceleration: vec![0.0; at.acceleration.len()],
            memory: vec![0.0; at.motion.memory.len()],
            lam: vec![0.0; at.lam.len()],
        }
    }
}

fn add(to: &mut [f64], d: &[f64]) {
    for (a, b) in to.iter_mut().zip(d) {
        *a += b;
    }
}

/// An instant on the tape, and where its numbers start among the leaves.
struct Leaves {
    motion: Motion<Taped>,
    acceleration: Vec<Taped>,
    lam: Vec<Taped>,
    extra: Vec<Taped>,
    places: [usize; 6],
}

/// The model on the tape: numbers and what is derived from them are leaves, so that the geometry is derived once, at the end.
struct Recorder<'a> {
    eq: &'a Equations<'a, f64>,
    n_x: usize,
    n_geometry: usize,
    /// adjoints of numbers and of the geometry, summed over all steps
    numbers: Vec<f64>,
}

impl<'a> Recorder<'a> {
    fn new(eq: &'a Equations<'a, f64>) -> Self {
        let mut n_geometry = 0;
        let _ = eq.geometry.map(|v: f64| {
            n_geometry += 1;
            v
        });
        let n_x = eq.x.len();
        Recorder {
            eq,
            n_x,
            n_geometry,
            numbers: vec![0.0; n_x + n_geometry],
        }
    }

    fn begin(&self) -> Equations<'a, Taped> {
        clear();
        let x = self.eq.x.iter().map(|v| leaf(*v)).collect();
        let geometry = self.eq.geometry.map(leaf);
        Equations::with_geometry(self.eq.system, x, geometry, self.eq.effects)
    }

    /// An instant as leaves; `extra`: more numbers, such as an increment.
    fn leaves(&self, m: &Motion<f64>, a: &[f64], lam: &[f64], extra: &[f64]) -> Leaves {
        let all = |v: &[f64]| v.iter().map(|x| leaf(*x)).collect::<Vec<_>>();
        let relative: Vec<Pose<Taped>> = m
            .relative
            .iter()
            .map(|p| {
                let numbers = all(&twelve(p));
                Pose {
                    p: Vector3::from_fn(|i, _| numbers[i]),
                    r: Matrix3::from_fn(|i, j| numbers[3 + 3 * i + j]),
                }
            })
            .collect();
        let sizes = [
            12 * relative.len(),
            m.rate.len(),
            m.memory.len(),
            a.len(),
            lam.len(),
        ];
        let mut places = [self.n_x + self.n_geometry; 6];
        for (i, n) in sizes.iter().enumerate() {
            places[i + 1] = places[i] + n;
        }
        Leaves {
            motion: Motion {
                t: m.t,
                relative,
                rate: all(&m.rate),
                memory: all(&m.memory),
            },
            acceleration: all(a),
            lam: all(lam),
            extra: all(extra),
            places,
        }
    }

    /// Differentiate a sum: numbers of the model are added up here, the instant's adjoints and those of `extra` come back.
    fn finish(&mut self, sum: Taped, of: &Leaves) -> (Adjoint, Vec<f64>) {
        let n = of.places[5] + of.extra.len();
        let d = backwards(sum, n);
        let own = self.n_x + self.n_geometry;
        add(&mut self.numbers, &d[..own]);
        let part = |i: usize| d[of.places[i]..of.places[i + 1]].to_vec();
        let found = Adjoint {
            pose: part(0),
            rate: part(1),
            memory: part(2),
            acceleration: part(3),
            lam: part(4),
        };
        (found, d[of.places[5]..].to_vec())
    }

    /// Adjoints of the numbers x, those of the geometry carried to them.
    fn numbers(&self) -> Vec<f64> {
        clear();
        let x: Vec<Taped> = self.eq.x.iter().map(|v| leaf(*v)).collect();
        let geometry = Geometry::derive(&self.eq.system.topology.tables, &x);
        let mut sum = Taped::from(0.0);
        let mut place = self.n_x;
        let _ = geometry.map(|v: Taped| {
            sum += v * self.numbers[place];
            place += 1;
            0.0
        });
        let mut out = backwards(sum, self.n_x);
        add(&mut out, &self.numbers[..self.n_x]);
        out
    }
}

fn twelve(p: &Pose<f64>) -> [f64; 12] {
    std::array::from_fn(|k| {
        if k < 3 {
            p.p[k]
        } else {
            p.r[((k - 3) / 3, (k - 3) % 3)]
        }
    })
}

fn weighed(v: &[Taped], by: &[f64]) -> Taped {
    v.iter()
        .zip(by)
        .fold(Taped::from(0.0), |s, (v, w)| s + *v * *w)
}

fn column(v: &[f64]) -> DMatrix<f64> {
    DMatrix::from_column_slice(v.len(), 1, v)
}

/// x^T A for the metric of the projections: what a change of v* or a* does to the right sides.
fn transposed_times(by: &DMatrix<f64>, u: &DVector<f64>) -> Vec<f64> {
    by.tr_mul(u).as_slice().to_vec()
}

/// Read quantities of an instant.
fn seed(
    recorder: &mut Recorder<'_>,
    at: &Instant,
    wanted: &[Quantity],
    seeds: &[f64],
    onto: &mut Adjoint,
) {
    if seeds.iter().all(|s| *s == 0.0) {
        return;
    }
    let eq = recorder.begin();
    let leaves = recorder.leaves(&at.motion, &at.acceleration, &at.lam, &[]);
    let point = Point {
        motion: &leaves.motion,
        acceleration: &leaves.acceleration,
        lam: &leaves.lam,
    };
    let sum = weighed(&evaluate(&eq, &point, wanted), seeds);
    let (found, _) = recorder.finish(sum, &leaves);
    add_all(onto, &found);
}

fn add_all(to: &mut Adjoint, d: &Adjoint) {
    add(&mut to.pose, &d.pose);
    add(&mut to.rate, &d.rate);
    add(&mut to.acceleration, &d.acceleration);
    add(&mut to.memory, &d.memory);
    add(&mut to.lam, &d.lam);
}

/// From the adjoints at the end of a step to those at its start.
fn step_back(
    recorder: &mut Recorder<'_>,
    from: &Instant,
    end: &Instant,
    record: &Record,
    weight: Weight,
    mut at: Adjoint,
    counts: &mut Counts,
) -> Result<Adjoint> {
    let eq = recorder.eq;
    let h = record.h;
    let factors = Factors::new(eq, from, record, weight, counts)?;
    counts.add("adjoint steps", 1);
    let mut before = Adjoint::none(from);
    if !at.memory.is_empty() {
        remembered_back(recorder, from, end, &mut at);
        std::mem::swap(&mut before.memory, &mut at.memory);
    }
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
    let dq: Vec<Taped> = record.dq.iter().map(|v| Taped::from(*v)).collect();
    let lam: Vec<Taped> = record.lam.iter().map(|v| Taped::from(*v)).collect();
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
    let dual = lifted(&eq);
    let leaves = recorder.leaves(star, a_star, &[], &[]);
    let (m, a) = (&leaves.motion, &leaves.acceleration);
    let constant = |v: &[f64]| v.iter().map(|x| Taped::from(*x)).collect::<Vec<_>>();
    let jacobian = eq.rows(m).1;
    let mut sum = Taped::from(0.0);
    for (u, delta, y) in [
        (u2, &record.dv, &record.kappa),
        (u3, &record.da, &record.nu),
    ] {
        let metric = metric_times(&eq, &dual, m, a, &constant(delta), record.h, weight);
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
    let mut sum = Taped::from(0.0);
    for (b, p) in moved.relative.iter().enumerate() {
        for k in 0..12 {
            let v = if k < 3 {
                p.p[k]
            } else {
                p.r[((k - 3) / 3, (k - 3) % 3)]
            };
            sum += v * pose[12 * b + k];
        }
    }
    let (found, by_increment) = recorder.finish(sum, &leaves);
    add(&mut before.pose, &found.pose);
    add(increment, &by_increment);
}

/// What laws remember after the step, by what they remembered before and by where the step ended.
fn remembered_back(recorder: &mut Recorder<'_>, from: &Instant, end: &Instant, at: &mut Adjoint) {
    let eq = recorder.begin();
    let start = Motion {
        memory: from.motion.memory.clone(),
        ..end.motion.clone()
    };
    let leaves = recorder.leaves(&start, &[], &[], &[]);
    let mut m = leaves.motion.clone();
    eq.remember(&mut m, &mut Counts::default());
    let sum = weighed(&m.memory, &at.memory);
    let (found, _) = recorder.finish(sum, &leaves);
    add(&mut at.pose, &found.pose);
    add(&mut at.rate, &found.rate);
    at.memory = found.memory;
}

/// The first instant: accelerations and multipliers backwards; what is left are adjoints of poses and rates.
fn first_back(
    recorder: &mut Recorder<'_>,
    starting: &Starting<'_>,
    first: &Instant,
    mut at: Adjoint,
) -> Result<Adjoint> {
    let (u, w) = starting
        .accelerating()
        .solve_transposed(&column(&at.acceleration), &column(&at.lam))?;
    let eq = recorder.begin();
    let leaves = recorder.leaves(&first.motion, &[], &[], &[]);
    let constant = |v: &[f64]| v.iter().map(|x| Taped::from(*x)).collect::<Vec<_>>();
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
    checkpoints: Vec<Instant>,
    /// all of a short motion
    whole: Option<Stretch>,
}

struct Stretch {
    instants: Vec<Instant>,
    records: Vec<Record>,
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
    let numbers = 12 * eq.topology().nodes.len() + 6 * eq.n() + 4 * eq.n_rows();
    let every = if n * numbers <= plan.keep {
        n.max(1)
    } else {
        (n as f64).sqrt().ceil() as usize
    };
    let mut out = Forward {
        values: Vec::new(),
        width: wanted.iter().map(|q| q.width(eq)).sum(),
        every,
        checkpoints: Vec::new(),
        whole: (every >= n).then(|| Stretch {
            instants: vec![first.clone()],
            records: Vec::new(),
        }),
    };
    let mut here = first;
    for i in 0..=n {
        if i > 0 {
            let (end, record) = advance(eq, plan, i - 1, &here, cancel, counts)?;
            if let Some(whole) = &mut out.whole {
                whole.instants.push(end.clone());
                whole.records.push(record);
            }
            here = end;
        }
        if i % every == 0 && i < n.max(1) {
            out.checkpoints.push(here.clone());
        }
        let at = Point {
            motion: &here.motion,
            acceleration: &here.acceleration,
            lam: &here.lam,
        };
        out.values.extend(evaluate(eq, &at, wanted));
    }
    counts.add("checkpoints", out.checkpoints.len() as u64);
    Ok(out)
}

fn repeat(
    eq: &Equations<'_, f64>,
    plan: &Plan,
    from: &Instant,
    steps: std::ops::Range<usize>,
    cancel: &Cancel,
    counts: &mut Counts,
) -> Result<Stretch> {
    let mut out = Stretch {
        instants: vec![from.clone()],
        records: Vec::new(),
    };
    for (k, i) in steps.enumerate() {
        let (end, record) = advance(eq, plan, i, &out.instants[k], cancel, counts)?;
        out.instants.push(end);
        out.records.push(record);
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
    for (k, checkpoint) in run.checkpoints.iter().enumerate().rev() {
        let (a, b) = (k * run.every, ((k + 1) * run.every).min(n));
        let again;
        let stretch = match &run.whole {
            Some(whole) => whole,
            None => {
                again = repeat(eq, plan, checkpoint, a..b, cancel, counts)?;
                &again
            }
        };
        for i in (a..b).rev() {
            cancel.check()?;
            let (from, end) = (&stretch.instants[i - a], &stretch.instants[i - a + 1]);
            let own = &seeds[(i + 1) * w..(i + 2) * w];
            seed(&mut recorder, end, wanted, own, &mut at);
            at = step_back(
                &mut recorder,
                from,
                end,
                &stretch.records[i - a],
                plan.weight,
                at,
                counts,
            )?;
        }
    }
    seed(&mut recorder, first, wanted, &seeds[..w], &mut at);
    let starting = Starting::new(eq, first, &plan.follow)?;
    let at = first_back(&mut recorder, &starting, first, at)?;
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
