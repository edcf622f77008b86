//! Derivatives along all directions together with the motion: the tangent linear model of each step on the factors of that step.
//!
//! Directions go in chunks of `WIDTH` through vector-valued dual numbers; what is known of a step is evaluated with its derivative,
//! what is not yet known as a constant, and the linear system of the step gives the derivative of the unknown.
use nalgebra::{Const, DMatrix, DVector, SVector, U1};
use num_dual::{Derivative, Dual, Dual64, DualSVec64};

use crate::analysis::transient::ali3p::{
    Record, Weight, balance, closure, lifted, metric_times, pulled, stars,
};
use crate::analysis::transient::penalty::Penalty;
use crate::analysis::transient::{Equations, Instant, Motion};
use crate::error::Result;
use crate::run::{Cancel, Counts};
use crate::spatial::Pose;
use crate::system::System;
use crate::system::assemble::Effects;

use super::quantity::{Point, Quantity, evaluate};
use super::start::{Start, Starting};
use super::{Direction, Plan, advance};

pub const WIDTH: usize = 4;
type Many = DualSVec64<WIDTH>;
type Slopes = SVector<f64, WIDTH>;

fn many(re: f64, slope: Slopes) -> Many {
    Many::new(re, Derivative::some(slope))
}

fn slopes(x: &Many) -> Slopes {
    x.eps.unwrap_generic(Const::<WIDTH>, U1)
}

fn lift(v: &[f64]) -> Vec<Many> {
    v.iter().map(|x| Many::from(*x)).collect()
}

/// Minus the derivatives of a vector, (n, WIDTH).
fn missing(v: &DVector<Many>) -> DMatrix<f64> {
    let mut out = DMatrix::zeros(v.len(), WIDTH);
    for (i, x) in v.iter().enumerate() {
        let s = slopes(x);
        for k in 0..WIDTH {
            out[(i, k)] = -s[k];
        }
    }
    out
}

/// Add the rows of (n, WIDTH) to the derivatives of numbers.
fn add_slopes(to: &mut [Many], d: &DMatrix<f64>, factor: f64) {
    for (i, x) in to.iter_mut().enumerate() {
        let s = slopes(x) + Slopes::from_fn(|k, _| d[(i, k)] * factor);
        *x = many(x.re, s);
    }
}

/// The factors of a step at its solution.
pub struct Factors {
    pub step: Penalty,
    pub projection: Option<Penalty>,
}

impl Factors {
    pub fn new(
        eq: &Equations<'_, f64>,
        from: &Instant,
        record: &Record,
        weight: Weight,
        counts: &mut Counts,
    ) -> Result<Self> {
        let step = eq.step_matrix(from, &record.dq, &record.lam, record.h, counts)?;
        let projection = if eq.n_rows() > 0 {
            let (m, a) = stars(eq, &from.motion, &from.acceleration, &record.dq, record.h);
            let jacobian = eq.rows(&m).1;
            Some(eq.projection_matrix(&m, &a, &jacobian, record.h, weight, counts)?)
        } else {
            None
        };
        Ok(Factors { step, projection })
    }
}

/// A chunk of directions on its way.
struct Chunk<'a> {
    eq: Equations<'a, Many>,
    lifted: Option<Equations<'a, Dual<Many>>>,
    motion: Motion<Many>,
    acceleration: Vec<Many>,
    lam: Vec<Many>,
    used: usize,
}

impl<'a> Chunk<'a> {
    fn new(
        system: &'a System,
        effects: Effects,
        directions: &[Direction],
        first: usize,
        starting: &Starting<'_>,
        counts: &mut Counts,
    ) -> Result<Self> {
        let mut x: Vec<Many> = lift(&system.x);
        let mut starts = Vec::with_capacity(directions.len());
        for (k, direction) in directions.iter().enumerate() {
            let mut alone: Vec<Dual64> = system.x.iter().map(|v| Dual64::from(*v)).collect();
            for (i, d) in direction {
                let mut s = slopes(&x[*i]);
                s[k] += d;
                x[*i] = many(x[*i].re, s);
                alone[*i].eps += d;
            }
            let dual = Equations::new(system, alone, effects);
            starts.push(starting.along(&dual, first + k, counts)?);
        }
        let joined = |of: &dyn Fn(&Start) -> Dual64| {
            let slope = Slopes::from_fn(|k, _| starts.get(k).map_or(0.0, |s| of(s).eps));
            many(starts.first().map_or(0.0, |s| of(s).re), slope)
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
        Ok(Chunk {
            lifted: (eq.n_rows() > 0).then(|| lifted(&eq)),
            motion,
            acceleration: vector(one.acceleration.len(), &|s, i| s.acceleration[i]),
            lam: vector(one.lam.len(), &|s, i| s.lam[i]),
            eq,
            used: directions.len(),
        })
    }

    fn step(
        &mut self,
        record: &Record,
        t: f64,
        by: &Factors,
        weight: Weight,
        counts: &mut Counts,
    ) -> Result<()> {
        let (eq, h) = (&self.eq, record.h);
        counts.add("tangent linear steps", 1);
        let (mut dq, mut lam) = (lift(&record.dq), lift(&record.lam));
        let (m, a) = stars(eq, &self.motion, &self.acceleration, &dq, h);
        let f = missing(&balance(eq, &m, &a, &lam, h, counts));
        let g = if eq.n_rows() > 0 {
            missing(&closure(eq, &m, h))
        } else {
            DMatrix::zeros(0, WIDTH)
        };
        let (x, y) = by.step.solve(&f, &g)?;
        add_slopes(&mut dq, &x, 1.0);
        add_slopes(&mut lam, &y, 4.0 / (h * h));
        let (star, a_star) = stars(eq, &self.motion, &self.acceleration, &dq, h);
        let mut end = star.clone();
        let mut a_end = a_star.clone();
        if let (Some(projection), Some(lifted)) = (&by.projection, &self.lifted) {
            let jacobian = eq.rows(&star).1;
            let metric = |delta: &[f64], y: &[f64]| {
                metric_times(eq, lifted, &star, &a_star, &lift(delta), h, weight)
                    + pulled(&jacobian, y)
            };
            for (v, d) in end.rate.iter_mut().zip(&record.dv) {
                *v += *d;
            }
            let f = missing(&metric(&record.dv, &record.kappa));
            let g = missing(&eq.row_rates_of(&end, &jacobian));
            add_slopes(&mut end.rate, &projection.solve(&f, &g)?.0, 1.0);
            for (v, d) in a_end.iter_mut().zip(&record.da) {
                *v += *d;
            }
            let f = missing(&metric(&record.da, &record.nu));
            let carried = &jacobian * DVector::from_column_slice(&a_end);
            let g = missing(&(eq.row_bias(&end) + carried));
            add_slopes(&mut a_end, &projection.solve(&f, &g)?.0, 1.0);
        }
        end.t = t;
        eq.remember(&mut end, counts);
        self.motion = end;
        self.acceleration = a_end;
        self.lam = lam;
        Ok(())
    }

    fn read(&self, wanted: &[Quantity], out: &mut [f64], first: usize, n_p: usize) {
        let at = Point {
            motion: &self.motion,
            acceleration: &self.acceleration,
            lam: &self.lam,
        };
        for (i, x) in evaluate(&self.eq, &at, wanted).iter().enumerate() {
            let s = slopes(x);
            for k in 0..self.used {
                out[i * n_p + first + k] = s[k];
            }
        }
    }
}

/// Instants, the wanted numbers at them (n_t, n) and their derivatives (n_t, n, n_p), flat.
pub struct Sensitivities {
    pub instants: Vec<Instant>,
    pub values: Vec<f64>,
    pub derivatives: Vec<f64>,
    pub width: usize,
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
    let mut chunks = Vec::new();
    if n_p > 0 {
        let starting = Starting::new(eq, &first, &plan.follow)?;
        for (c, part) in directions.chunks(WIDTH).enumerate() {
            chunks.push(Chunk::new(
                eq.system,
                eq.effects,
                part,
                c * WIDTH,
                &starting,
                counts,
            )?);
        }
    }
    let width: usize = wanted.iter().map(|q| q.width(eq)).sum();
    let n_t = plan.times.len();
    let mut out = Sensitivities {
        instants: Vec::with_capacity(n_t),
        values: Vec::with_capacity(n_t * width),
        derivatives: vec![0.0; n_t * width * n_p],
        width,
    };
    let mut here = first;
    for i in 0..n_t {
        if i > 0 {
            let (end, record) = advance(eq, plan, i - 1, &here, cancel, counts)?;
            if n_p > 0 {
                let by = Factors::new(eq, &here, &record, plan.weight, counts)?;
                for chunk in &mut chunks {
                    chunk.step(&record, end.motion.t, &by, plan.weight, counts)?;
                }
            }
            here = end;
        }
        let at = Point {
            motion: &here.motion,
            acceleration: &here.acceleration,
            lam: &here.lam,
        };
        out.values.extend(evaluate(eq, &at, wanted));
        let place = &mut out.derivatives[i * width * n_p..(i + 1) * width * n_p];
        for (c, chunk) in chunks.iter().enumerate() {
            chunk.read(wanted, place, c * WIDTH, n_p);
        }
        out.instants.push(here.clone());
    }
    Ok(out)
}
