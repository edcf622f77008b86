//! Derivatives along all directions together with the motion: the tangent linear model of each step on the factors of that step.
//!
//! Directions go in chunks through numbers with several derivatives; what is known of a step is evaluated with its derivative, what
//! is not yet known as a constant, and the linear system of the step gives the derivative of the unknown.
use nalgebra::{DMatrix, DVector};
use num_dual::{Dual, Dual64, DualSVec64};

use crate::analysis::transient::ali3p::{
    Factors, Record, Weight, balance, closure, lifted, metric_times, pulled, stars,
};
use crate::analysis::transient::generalized_alpha::{Parameters, reached};
use crate::analysis::transient::penalty::Penalty;
use crate::analysis::transient::{Equations, Instant, Motion};
use crate::error::Result;
use crate::run::{Cancel, Counts};
use crate::spatial::Pose;
use crate::system::System;
use crate::system::assemble::Effects;

use super::alpha::{self, Load, Solved};
use super::kinks::{Kink, Watch};
use super::lanes::Lanes;
use super::march::{Here, Made, March, Rule};
use super::quantity::{Point, Quantity, evaluate};
use super::start::{Start, Starting};
use super::{Direction, Plan};

/// Directions of a chunk, where there are more than one left.
pub const WIDTH: usize = 4;

fn lift<T: Lanes>(v: &[f64]) -> Vec<T> {
    v.iter().map(|x| T::from(*x)).collect()
}

/// Minus the derivatives of a vector, (n, N).
fn missing<T: Lanes>(v: &DVector<T>) -> DMatrix<f64> {
    DMatrix::from_fn(v.len(), T::N, |i, k| -v[i].slope(k))
}

/// Add the rows of (n, N) to the derivatives of numbers.
fn add_slopes<T: Lanes>(to: &mut [T], d: &DMatrix<f64>, factor: f64) {
    for (i, x) in to.iter_mut().enumerate() {
        *x = x.moved(|k| d[(i, k)] * factor);
    }
}

/// The same derivatives at the values of the motion itself.
fn rebased<T: Lanes>(m: &mut Motion<T>, to: &Motion<f64>) {
    for (p, q) in m.relative.iter_mut().zip(&to.relative) {
        *p = Pose {
            p: p.p.zip_map(&q.p, |d, v| d.at(v)),
            r: p.r.zip_map(&q.r, |d, v| d.at(v)),
        };
    }
}

/// A chunk of directions on its way, whatever its numbers.
trait Along {
    fn step(
        &mut self,
        end: &Here,
        made: &Made,
        solved: Option<&Solved>,
        counts: &mut Counts,
    ) -> Result<()>;
    fn anew(&mut self, here: &Here, by: &Penalty, counts: &mut Counts) -> Result<()>;
    fn read(&self, wanted: &[Quantity], out: &mut [f64], first: usize, n_p: usize) -> Result<()>;
}

/// A chunk of directions on its way.
struct Chunk<'a, T: Lanes> {
    eq: Equations<'a, T>,
    lifted: Option<Equations<'a, Dual<T>>>,
    motion: Motion<T>,
    acceleration: Vec<T>,
    lam: Vec<T>,
    load: Option<Load<T>>,
    weight: Weight,
    used: usize,
}

impl<'a, T: Lanes> Chunk<'a, T> {
    fn new(
        system: &'a System,
        effects: Effects,
        directions: &[Direction],
        first: usize,
        starting: &Starting<'_>,
        rule: Rule,
        counts: &mut Counts,
    ) -> Result<Self> {
        let mut x: Vec<T> = lift(&system.x);
        let mut starts = Vec::with_capacity(directions.len());
        for (k, direction) in directions.iter().enumerate() {
            let mut alone: Vec<Dual64> = system.x.iter().map(|v| Dual64::from(*v)).collect();
            for (i, d) in direction {
                x[*i] = x[*i].moved(|l| if l == k { *d } else { 0.0 });
                alone[*i].eps += d;
            }
            let dual = Equations::new(system, alone, effects);
            starts.push(starting.along(&dual, first + k, counts)?);
        }
        let joined = |of: &dyn Fn(&Start) -> Dual64| {
            let value = starts.first().map_or(0.0, |s| of(s).re);
            T::with(value, |k| starts.get(k).map_or(0.0, |s| of(s).eps))
        };
        let one = &starts[0];
        let vector = |n: usize, of: &dyn Fn(&Start, usize) -> Dual64| {
            (0..n).map(|i| joined(&|s| of(s, i))).collect::<Vec<_>>()
        };
        let relative = (0..one.motion.relative.len()).map(|b| Pose {
            p: nalgebra::Vector3::from_fn(|i, _| joined(&|s| s.motion.relative[b].p[i])),
            r: nalgebra::Matrix3::from_fn(|i, j| joined(&|s| s.motion.relative[b].r[(i, j)])),
        });
        let motion = Motion {
            t: one.motion.t,
            relative: relative.collect(),
            rate: vector(one.motion.rate.len(), &|s, i| s.motion.rate[i]),
            memory: vector(one.motion.memory.len(), &|s, i| s.motion.memory[i]),
        };
        let eq = Equations::new(system, x, effects);
        let acceleration = vector(one.acceleration.len(), &|s, i| s.acceleration[i]);
        let (load, weight) = match rule {
            Rule::Ali3p(weight) => (None, weight),
            Rule::Alpha(_) => (Some(Load::first(&acceleration)), Weight::Mass),
        };
        Ok(Chunk {
            lifted: (eq.n_rows() > 0 && weight == Weight::Tangent).then(|| lifted(&eq)),
            motion,
            acceleration,
            lam: vector(one.lam.len(), &|s, i| s.lam[i]),
            load,
            weight,
            eq,
            used: directions.len(),
        })
    }

    fn ali3p(
        &mut self,
        end: &Here,
        record: &Record,
        by: &Factors,
        counts: &mut Counts,
    ) -> Result<()> {
        let (eq, h) = (&self.eq, record.h);
        let (mut dq, mut lam) = (lift::<T>(&record.dq), lift::<T>(&record.lam));
        let (m, a) = stars(eq, &self.motion, &self.acceleration, &dq, h);
        let f = missing(&balance(eq, &m, &a, &lam, h, counts));
        let g = if eq.n_rows() > 0 {
            missing(&closure(eq, &m, h))
        } else {
            DMatrix::zeros(0, T::N)
        };
        let (x, y) = by.step.solve(&f, &g)?;
        add_slopes(&mut dq, &x, 1.0);
        add_slopes(&mut lam, &y, 4.0 / (h * h));
        let (star, a_star) = stars(eq, &self.motion, &self.acceleration, &dq, h);
        let mut last = star.clone();
        let mut a_end = a_star.clone();
        if let Some(projection) = &by.projection {
            let jacobian = eq.rows(&star).1;
            let metric = |delta: &[f64], y: &[f64]| {
                metric_times(
                    eq,
                    self.lifted.as_ref(),
                    &star,
                    &a_star,
                    &lift::<T>(delta),
                    h,
                    self.weight,
                ) + pulled(&jacobian, y)
            };
            for (v, d) in last.rate.iter_mut().zip(&record.dv) {
                *v += *d;
            }
            let f = missing(&metric(&record.dv, &record.kappa));
            let g = missing(&eq.row_rates_of(&last, &jacobian));
            add_slopes(&mut last.rate, &projection.solve(&f, &g)?.0, 1.0);
            for (v, d) in a_end.iter_mut().zip(&record.da) {
                *v += *d;
            }
            let f = missing(&metric(&record.da, &record.nu));
            let carried = &jacobian * DVector::from_column_slice(&a_end);
            let g = missing(&(eq.row_bias(&last) + carried));
            add_slopes(&mut a_end, &projection.solve(&f, &g)?.0, 1.0);
        }
        last.t = end.instant.motion.t;
        eq.remember(&mut last, counts);
        self.motion = last;
        self.acceleration = a_end;
        self.lam = lam;
        Ok(())
    }

    fn alpha(
        &mut self,
        end: &Here,
        p: Parameters,
        h: f64,
        by: &Solved,
        counts: &mut Counts,
    ) -> Result<()> {
        let eq = &self.eq;
        let Some(load) = &self.load else {
            return Ok(());
        };
        let a0 = load.shifted(p, h);
        let mut s1 = lift::<T>(&by.s1);
        let m = reached(eq, p, &self.motion, (&a0, &load.rate_slope, &s1), h).1;
        let f = missing(&alpha::balance(eq, p, &m, &s1, &lift(&by.lam), h, counts));
        let g = missing(&alpha::closure(eq, p, &m, h));
        let (w, _) = by.step.solve(&f, &g)?;
        add_slopes(&mut s1, &w, 1.0 / (h * h * p.slopes().0));
        let (_, mut last, a1) = reached(eq, p, &self.motion, (&a0, &load.rate_slope, &s1), h);
        let there = &end.instant;
        rebased(&mut last, &there.motion);
        let jacobian = eq.rows(&last).1;
        if eq.n_rows() > 0 {
            for (v, d) in last.rate.iter_mut().zip(&by.dv) {
                *v += *d;
            }
            let moved = eq.mass(&last) * DVector::from_vec(lift::<T>(&by.dv));
            let f = missing(&(moved + pulled(&jacobian, &by.kappa)));
            let g = missing(&eq.row_rates_of(&last, &jacobian));
            add_slopes(&mut last.rate, &by.end.solve(&f, &g)?.0, 1.0);
        }
        let (a, lam) = accelerated(eq, &last, &jacobian, there, &by.end, counts)?;
        let slope = (a.iter().zip(&self.acceleration)).map(|(a, b)| (*a - *b) / h);
        self.load = Some(Load {
            a: a1,
            rate_slope: s1,
            slope: slope.collect(),
            h,
        });
        last.t = there.motion.t;
        eq.remember(&mut last, counts);
        self.motion = last;
        self.acceleration = a;
        self.lam = lam;
        Ok(())
    }
}

/// Accelerations and multipliers of an instant, its motion known with derivatives.
fn accelerated<T: Lanes>(
    eq: &Equations<'_, T>,
    m: &Motion<T>,
    jacobian: &DMatrix<T>,
    there: &Instant,
    by: &Penalty,
    counts: &mut Counts,
) -> Result<(Vec<T>, Vec<T>)> {
    let (mut a, mut lam) = (lift::<T>(&there.acceleration), lift::<T>(&there.lam));
    let f = missing(&eq.residual(m, &a, &lam, counts));
    let g = missing(&(eq.row_bias(m) + jacobian * DVector::from_column_slice(&a)));
    let (da, dlam) = by.solve(&f, &g)?;
    add_slopes(&mut a, &da, 1.0);
    add_slopes(&mut lam, &dlam, 1.0);
    Ok((a, lam))
}

impl<T: Lanes> Along for Chunk<'_, T> {
    fn step(
        &mut self,
        end: &Here,
        made: &Made,
        solved: Option<&Solved>,
        counts: &mut Counts,
    ) -> Result<()> {
        counts.add("tangent linear steps", 1);
        match (made, solved) {
            (Made::Ali3p(record, by), _) => self.ali3p(end, record, by, counts),
            (Made::Alpha(p, h), Some(by)) => self.alpha(end, *p, *h, by, counts),
            (Made::Alpha(..), None) => Ok(()),
        }
    }

    fn anew(&mut self, here: &Here, by: &Penalty, counts: &mut Counts) -> Result<()> {
        let jacobian = self.eq.rows(&self.motion).1;
        let there = &here.instant;
        (self.acceleration, self.lam) =
            accelerated(&self.eq, &self.motion, &jacobian, there, by, counts)?;
        self.load = (self.load.is_some()).then(|| Load::first(&self.acceleration));
        Ok(())
    }

    fn read(&self, wanted: &[Quantity], out: &mut [f64], first: usize, n_p: usize) -> Result<()> {
        let at = Point {
            motion: &self.motion,
            acceleration: &self.acceleration,
            lam: &self.lam,
        };
        for (i, x) in evaluate(&self.eq, &at, wanted)?.iter().enumerate() {
            for k in 0..self.used {
                out[i * n_p + first + k] = x.slope(k);
            }
        }
        Ok(())
    }
}

/// All directions in chunks, each with the first of its directions.
fn chunks<'a>(
    eq: &Equations<'a, f64>,
    first: &Instant,
    plan: &Plan,
    directions: &[Direction],
    counts: &mut Counts,
) -> Result<Vec<(usize, Box<dyn Along + 'a>)>> {
    let mut out: Vec<(usize, Box<dyn Along + 'a>)> = Vec::new();
    if directions.is_empty() {
        return Ok(out);
    }
    let starting = Starting::new(eq, first, &plan.follow)?;
    let (system, effects, rule) = (eq.system, eq.effects, plan.rule);
    for (c, part) in directions.chunks(WIDTH).enumerate() {
        let at = c * WIDTH;
        out.push((
            at,
            if part.len() == 1 {
                Box::new(Chunk::<Dual64>::new(
                    system, effects, part, at, &starting, rule, counts,
                )?)
            } else {
                Box::new(Chunk::<DualSVec64<WIDTH>>::new(
                    system, effects, part, at, &starting, rule, counts,
                )?)
            },
        ));
    }
    Ok(out)
}

/// Instants, the wanted numbers at them (n_t, n) and their derivatives (n_t, n, n_p), flat.
pub struct Sensitivities {
    pub instants: Vec<Instant>,
    pub values: Vec<f64>,
    pub derivatives: Vec<f64>,
    pub width: usize,
    pub kinks: Vec<Kink>,
}

#[allow(clippy::too_many_arguments)]
pub fn direct(
    eq: &Equations<'_, f64>,
    first: Instant,
    plan: &Plan,
    wanted: &[Quantity],
    directions: &[Direction],
    cancel: &Cancel,
    counts: &mut Counts,
) -> Result<Sensitivities> {
    plan.check()?;
    let n_p = directions.len();
    let mut chunks = chunks(eq, &first, plan, directions, counts)?;
    let width: usize = wanted.iter().map(|q| q.width(eq)).sum();
    let n_t = plan.times.len();
    let mut out = Sensitivities {
        instants: Vec::with_capacity(n_t),
        values: Vec::with_capacity(n_t * width),
        derivatives: vec![0.0; n_t * width * n_p],
        width,
        kinks: Vec::new(),
    };
    let (mut march, mut watch) = (March::new(eq, plan), Watch::new(eq, &first));
    let mut here = Here::first(first, plan.rule);
    for i in 0..n_t {
        if i > 0 {
            let (end, made) = march.step(i - 1, &here, cancel, counts)?;
            let solved = match &made {
                Made::Alpha(p, h) if n_p > 0 => Some(Solved::new(eq, *p, &here, &end, *h, counts)?),
                _ => None,
            };
            for (_, chunk) in &mut chunks {
                chunk.step(&end, &made, solved.as_ref(), counts)?;
            }
            watch.pass(&here.instant, &end.instant);
            here = match march.anew(i - 1, &end, counts)? {
                None => end,
                Some(anew) => {
                    let by = alpha::accelerating(eq, &anew.instant.motion)?.0;
                    for (_, chunk) in &mut chunks {
                        chunk.anew(&anew, &by, counts)?;
                    }
                    anew
                }
            };
        }
        let now = &here.instant;
        let at = Point {
            motion: &now.motion,
            acceleration: &now.acceleration,
            lam: &now.lam,
        };
        out.values.extend(evaluate(eq, &at, wanted)?);
        let place = &mut out.derivatives[i * width * n_p..(i + 1) * width * n_p];
        for (first, chunk) in &chunks {
            chunk.read(wanted, place, *first, n_p)?;
        }
        out.instants.push(now.clone());
    }
    out.kinks = watch.found;
    Ok(out)
}
