//! The tangent linear model of every step, on the factors of that step: all directions together with the motion.
//!
//! | file | |
//! |---|---|
//! | `along`, `slopes`, `runge_kutta`, `stages`, `bdf`, `closing` | by the tangents of the steps |
//! | `chunk`, `explicit`, `lanes` | what tangents do not give: by the numbers themselves, in several directions at once |
mod along;
mod bdf;
pub(crate) mod chunk;
mod closing;
pub(crate) mod explicit;
mod runge_kutta;
pub(crate) mod slopes;
mod stages;

use nalgebra::DMatrix;

use crate::error::{Error, Result};
use crate::integrate::ali3p::{Factors, Record, Weight, stars};
use crate::integrate::generalized_alpha::{Parameters, reached};
use crate::integrate::{Instant, Motion};
use crate::run::{Cancel, Counts};

use self::along::Along;
use self::chunk::Moving;
use self::slopes::{Slopes, add_mapped, add_turning_slopes, carried};
use super::alpha::{Load, Solved};
use super::bdf::Past;
use super::closing::accelerating;
use super::kinks::{Kink, Watch};
use super::march::{Here, Made, March};
use super::quantity::{Quantity, read};
use super::stages::Probes;
use super::stretches::Stretches;
use super::{Direction, Plan};

/// What generalised-alpha carries on, by all directions.
struct Carry {
    a: DMatrix<f64>,
    rate_slope: DMatrix<f64>,
    slope: DMatrix<f64>,
}

/// What schemes carry on besides an instant, by all directions.
struct Carried {
    alpha: Carry,
    past: Past,
}

impl Carried {
    /// Before the first step.
    fn first(now: &Slopes) -> Self {
        let alpha = Carry { a: now.a.clone(), rate_slope: now.a.clone(), slope: &now.a * 0.0 };
        Carried { alpha, past: Past::none(now.x.nrows(), now.z.nrows(), now.x.ncols()) }
    }
}

impl Along<'_> {
    fn ali3p(&mut self, from: &Here, end: &Here, record: &Record, by: &Factors, counts: &mut Counts) -> Result<()> {
        let Some(linear) = &by.linear else {
            return Ok(());
        };
        let (eq, h) = (self.eq, record.h);
        let (c, f) = (0.25 * h * h, 2.0 / h);
        let (start, a0) = (&from.instant.motion, &from.instant.acceleration);
        let (theta, mut m, a) = stars(eq, start, a0, &record.straight, h);
        let renewed = (!by.exact).then(|| eq.tangents_of(&m, &a, &record.lam, counts));
        let linear = renewed.as_ref().unwrap_or(linear);
        let mut x = carried(eq.topology(), &theta, &self.now.x);
        let mut v = -&self.now.v;
        let mut turning = self.zeros(eq.n());
        add_turning_slopes(eq.topology(), h, (&start.rate, &m.rate), (&self.now.v, &v), &mut turning);
        add_mapped(&eq.rotation_maps(&theta), &turning, &mut x);
        let mut da = &v * (2.0 * f) - &self.now.a;
        let r = self.residual(linear, (&m, &a, &record.lam), [&x, &v, &da], counts) * -c;
        let z = &self.now.z;
        let at = Moving { motion: &m, x: &x, v: &v, z };
        let g = -self.closure(&linear.jacobian, at, 0.5 * h);
        let (straight, lam) = by.step.solve(&r, &g)?;
        add_mapped(&eq.step_maps(&theta, &start.rate, h, f), &straight, &mut x);
        da += &straight * (f * f);
        v += straight * f;
        if let Some(projection) = &by.projection {
            let changes =
                [(record.dv.as_slice(), record.kappa.as_slice()), (record.da.as_slice(), record.nu.as_slice())];
            let factors = match by.weight {
                Weight::Mass => (0.0, 0.0),
                Weight::Tangent => (0.5 * h, c),
            };
            let metrics = self.metrics((&m, &a), changes, factors, [&x, &v, &da], counts);
            m.rate.clone_from(&end.instant.motion.rate);
            let last = (&m, end.instant.acceleration.as_slice());
            self.projected(projection, last, &metrics, &x, (&mut v, Some(&mut da)))?;
        }
        self.now = Slopes { x, v, a: da, lam: lam / c, z: self.now.z.clone() };
        Ok(())
    }

    fn alpha(
        &mut self,
        from: &Here,
        end: &Here,
        (p, h): (Parameters, f64),
        (by, carry): (&Solved, &Carry),
        counts: &mut Counts,
    ) -> Result<Option<Carry>> {
        let Some(own) = &from.carried else {
            return Ok(None);
        };
        let eq = self.eq;
        let load = Load::of(own);
        let values = (load.shifted(p, h), load.rate_slope.clone(), by.s1.clone());
        let (theta, m, _) = reached(eq, p, &from.instant.motion, (&values.0, &values.1, &values.2), h);
        let a0 = &carry.a + &carry.slope * load.shift(p, h);
        let mut a1 = (&carry.rate_slope * p.af - &a0 * p.am) / (1.0 - p.am);
        let mut dq = &self.now.v * h + (&a0 * (0.5 - p.beta) + &a1 * p.beta) * (h * h);
        let mut v = &self.now.v + (&a0 * (1.0 - p.gamma) + &a1 * p.gamma) * h;
        let rate = &from.instant.motion.rate;
        add_turning_slopes(eq.topology(), h, (rate, &m.rate), (&self.now.v, &v), &mut dq);
        let mut x = carried(eq.topology(), &theta, &self.now.x);
        add_mapped(&eq.rotation_maps(&theta), &dq, &mut x);
        let (b, g) = p.slopes();
        let none = self.zeros(eq.n());
        let r = self.residual(&by.linear, (&m, &by.s1, &by.lam), [&x, &v, &none], counts);
        let z = &self.now.z;
        let at = Moving { motion: &m, x: &x, v: &v, z };
        let miss = -self.closure(&by.linear.jacobian, at, h * b / g);
        let (w, _) = by.step.solve(&(r * (-h * h * b)), &miss)?;
        let s1 = &w / (h * h * b);
        a1 += &s1 * ((1.0 - p.af) / (1.0 - p.am));
        add_mapped(&eq.step_maps(&theta, rate, h, g / (h * b)), &w, &mut x);
        v += &w * (g / (h * b));
        let there = Motion { memory: from.instant.motion.memory.clone(), ..end.instant.motion.clone() };
        (self.now.x, self.now.v) = (x, v);
        self.aligned(&by.end, &there, counts)?;
        let before = std::mem::replace(&mut self.now.a, none);
        self.accelerate(&there, &end.instant, &by.end.by, counts)?;
        Ok(Some(Carry { a: a1, rate_slope: s1, slope: (&self.now.a - before) / h }))
    }
}

/// Instants, the wanted numbers (n_r, n) of all rows of the plan and their derivatives (n_r, n, n_p), flat.
pub struct Sensitivities {
    pub instants: Vec<Instant>,
    pub values: Vec<f64>,
    pub derivatives: Vec<f64>,
    pub width: usize,
    pub kinks: Vec<Kink>,
}

/// A step along all directions.
fn stepped(
    along: &mut Along<'_>,
    (from, end, made): (&Here, &Here, &Made),
    (carried, probes): (&mut Carried, &Probes<'_>),
    stage: &mut dyn FnMut(usize, &Along<'_>, &Instant) -> Result<()>,
    counts: &mut Counts,
) -> Result<()> {
    counts.add("tangent linear steps", 1);
    match (made, probes) {
        (Made::RungeKutta(stages), _) => {
            along.runge_kutta(stages, &end.instant, stage, counts)?;
            along.remember(&stages.end, &end.instant.motion, counts);
        }
        (Made::Radau(stages), Probes { radau: Some(probe), .. }) => {
            along.pointed(&mut carried.past);
            along.radau(stages, &end.instant, probe, stage, counts)?;
            along.remember(&stages.end, &end.instant.motion, counts);
        }
        (Made::Bdf(stages, step), Probes { bdf: Some(probe), .. }) => {
            along.bdf((from, end), (stages, step), &mut carried.past, probe, counts)?;
        }
        _ => {
            let from = &*along.open(from, made.length());
            match made {
                Made::Ali3p(record, by) => along.ali3p(from, end, record, by, counts)?,
                Made::Alpha(p, h) => {
                    let by = Solved::new(along.eq, *p, from, end, *h, counts)?;
                    if let Some(next) = along.alpha(from, end, (*p, *h), (&by, &carried.alpha), counts)? {
                        carried.alpha = next;
                    }
                }
                _ => return Err(Error::model("a step was not prepared for its derivative")),
            }
            along.remember(&from.instant.motion, &end.instant.motion, counts);
        }
    }
    Ok(())
}

#[allow(clippy::too_many_arguments)]
pub fn direct(
    eqs: &Stretches<'_>,
    first: Instant,
    plan: &Plan,
    wanted: &[Quantity],
    directions: &[Direction],
    cancel: &Cancel,
    counts: &mut Counts,
) -> Result<Sensitivities> {
    plan.check()?;
    let (n_p, eq) = (directions.len(), eqs.first());
    let mut along = Along::new(eq, &first, plan, directions, counts)?;
    let mut carried = Carried::first(&along.now);
    let width: usize = wanted.iter().map(|q| q.width(eq)).sum();
    let (n_t, n_r) = (plan.times.len(), plan.n_values());
    let mut out = Sensitivities {
        instants: Vec::with_capacity(n_t),
        values: vec![0.0; n_r * width],
        derivatives: vec![0.0; n_r * width * n_p],
        width,
        kinks: Vec::new(),
    };
    let probed = |eq| if n_p > 0 { Probes::of(eq, plan.rule) } else { Probes { radau: None, bdf: None } };
    let mut probes = probed(eq);
    let mut watch = Watch::new(eq, &first, !plan.smooth.is_empty());
    let mut here = Here::first(first, plan.rule);
    if !plan.rule.opens_states() {
        // laws at rest begin with the states that belong to the drawn pose
        here = along.open(&here, 0.0).into_owned();
    }
    let kept = plan.kept_from(eq, &here, counts);
    let mut march = March::new(eqs, plan, kept).with_tangents();
    for i in 0..n_t {
        if i > 0 {
            let (end, made) = march.step(i - 1, &here, cancel, counts)?;
            let first = plan.inner_row(i - 1);
            for (k, inner) in made.inner().into_iter().enumerate().filter(|_| plan.inner) {
                out.values[(first + k) * width..(first + k + 1) * width].copy_from_slice(&read(eq, inner, wanted)?);
            }
            if n_p > 0 {
                let derivatives = &mut out.derivatives;
                let mut row = first;
                let mut stage = |k: usize, along: &Along<'_>, at: &Instant| {
                    if !plan.inner || made.node_of(k).is_none() {
                        return Ok(());
                    }
                    row += 1;
                    along.read(at, wanted, &mut derivatives[(row - 1) * width * n_p..row * width * n_p])
                };
                stepped(&mut along, (&here, &end, &made), (&mut carried, &probes), &mut stage, counts)?;
            }
            watch.pass(&here.instant, &end.instant);
            here = match march.anew(i - 1, &end, counts)? {
                None => end,
                Some(anew) => {
                    let next = eqs.from(plan.times[i]);
                    if !std::ptr::eq(next, along.eq) {
                        along = along.over(next, directions);
                        probes = probed(next);
                    }
                    if n_p > 0 {
                        let by = accelerating(next, &anew.instant.motion)?.0;
                        along.accelerate(&anew.instant.motion, &anew.instant, &by, counts)?;
                        carried = Carried::first(&along.now);
                    }
                    anew
                }
            };
        }
        let now = &here.instant;
        if plan.reads(i) {
            out.values[i * width..(i + 1) * width].copy_from_slice(&read(eq, now, wanted)?);
            let place = &mut out.derivatives[i * width * n_p..(i + 1) * width * n_p];
            along.read(now, wanted, place)?;
        }
        let mut shown = now.clone();
        eq.close_states(&mut shown.motion);
        out.instants.push(shown);
    }
    out.kinks = watch.found;
    Ok(out)
}
