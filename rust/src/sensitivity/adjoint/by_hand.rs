//! What the steps backwards ask of the virtual power: residual, rows, their rates, metrics; derivatives by numbers add up here.
use num_dual::Dual64;

use crate::integrate::ali3p::{Weight, lifted};
use crate::integrate::{Equations, Motion};
use crate::model::geometry::Geometry;
use crate::model::motion::MotionLaw;
use crate::multibody::topology::Level;

use super::super::power::{Forces, Power, Slopes};
use super::increments::add_small_move;
use crate::ad::tape::{Taped, backwards, clear, leaf};

/// Derivatives by tree increments, rates, accelerations and memories.
pub struct Found {
    pub q: Vec<f64>,
    pub rate: Vec<f64>,
    pub acceleration: Vec<f64>,
    pub memory: Vec<f64>,
}

/// A direction in which an instant moves.
struct Along<'a> {
    increment: &'a [f64],
    rate: &'a [f64],
    /// how increments and rates count
    factors: [f64; 2],
}

pub struct ByHand<'a> {
    eq: &'a Equations<'a, f64>,
    dual: Equations<'a, Dual64>,
    plain: Slopes<f64>,
    along: Slopes<Dual64>,
}

impl<'a> ByHand<'a> {
    pub fn new(eq: &'a Equations<'a, f64>) -> Self {
        ByHand { eq, dual: lifted(eq), plain: Slopes::none(eq), along: Slopes::none(eq) }
    }

    pub fn over(&mut self, eq: &'a Equations<'a, f64>) {
        (self.eq, self.dual) = (eq, lifted(eq));
    }

    /// -u.r - w.(rows), r with multipliers, times f; rows on velocity level times `speed`.
    #[allow(clippy::too_many_arguments)]
    pub fn balance(
        &mut self,
        m: &Motion<f64>,
        a: &[f64],
        lam: &[f64],
        (u, w): (&[f64], &[f64]),
        f: f64,
        speed: f64,
    ) -> Found {
        let rows = &self.eq.topology().rows;
        let of = |level: Level, factor: f64| -> Vec<f64> {
            let one = |(i, w): (usize, &f64)| {
                if rows[i].level == level { -factor * w } else { 0.0 }
            };
            w.iter().enumerate().map(one).collect()
        };
        let kappa: Vec<f64> = lam.iter().map(|l| -f * l).collect();
        let power = Power {
            eq: self.eq,
            motion: m,
            time: m.t,
            acceleration: a,
            rates: u,
            factor: -f,
            forces: Forces::All,
            alpha: &of(Level::Position, 1.0),
            beta: &of(Level::Velocity, speed),
            kappa: &kappa,
        };
        power.back(&mut self.plain);
        self.plain_found(m.t)
    }

    /// -w.Phi of the position rows by the configuration.
    pub fn row_values(&mut self, m: &Motion<f64>, w: &[f64]) -> Vec<f64> {
        let rows = &self.eq.topology().rows;
        let one = |(i, w): (usize, &f64)| if rows[i].level == Level::Position { -w } else { 0.0 };
        let alpha: Vec<f64> = w.iter().enumerate().map(one).collect();
        self.rows(m, &alpha, &[])
    }

    /// -w.(J v + Phi_t) by the configuration.
    pub fn row_rates(&mut self, m: &Motion<f64>, w: &[f64]) -> Vec<f64> {
        let beta: Vec<f64> = w.iter().map(|w| -w).collect();
        self.rows(m, &[], &beta)
    }

    /// alpha.Phi + beta.(J v + Phi_t) by the configuration.
    fn rows(&mut self, m: &Motion<f64>, alpha: &[f64], beta: &[f64]) -> Vec<f64> {
        let power = Power {
            eq: self.eq,
            motion: m,
            time: m.t,
            acceleration: &[],
            rates: &[],
            factor: 0.0,
            forces: Forces::None,
            alpha,
            beta,
            kappa: &[],
        };
        power.back(&mut self.plain);
        self.plain_found(m.t).q
    }

    /// -w.(J a + gamma) by configuration and rates: J v + Phi_t in the direction of the motion.
    pub fn row_bias(&mut self, m: &Motion<f64>, a: &[f64], w: &[f64]) -> (Vec<f64>, Vec<f64>) {
        let along = Along { increment: &m.rate, rate: a, factors: [1.0, 1.0] };
        let beta: Vec<_> = w.iter().map(|w| Dual64::from(-w)).collect();
        let moved = self.moved(m, &along);
        let power = Power {
            eq: &self.dual,
            motion: &moved,
            time: Dual64::new(m.t, 1.0),
            acceleration: &[],
            rates: &[],
            factor: 0.0,
            forces: Forces::None,
            alpha: &[],
            beta: &beta,
            kappa: &[],
        };
        power.back(&mut self.along);
        let mut found = self.along_found(m.t, &along, true);
        // the direction is that of the rates
        for (d, q) in found.rate.iter_mut().zip(&self.along.q) {
            *d += q.re;
        }
        (found.q, found.rate)
    }

    /// -u.(W d + J^T y) for a metric of the projections.
    #[allow(clippy::too_many_arguments)]
    pub fn metric(
        &mut self,
        m: &Motion<f64>,
        a: &[f64],
        (d, y): (&[f64], &[f64]),
        u: &[f64],
        h: f64,
        weight: Weight,
    ) -> Found {
        if weight == Weight::Mass {
            return self.mass(m, (d, y), u);
        }
        let along = Along { increment: d, rate: d, factors: [0.25 * h * h, 0.5 * h] };
        let moved = self.moved(m, &along);
        let a: Vec<_> = a.iter().zip(d).map(|(a, d)| Dual64::new(*a, *d)).collect();
        let kappa: Vec<_> = y.iter().map(|y| Dual64::new(0.0, -y)).collect();
        let power = Power {
            eq: &self.dual,
            motion: &moved,
            time: Dual64::from(m.t),
            acceleration: &a,
            rates: u,
            factor: -1.0,
            forces: Forces::All,
            alpha: &[],
            beta: &[],
            kappa: &kappa,
        };
        power.back(&mut self.along);
        self.along_found(m.t, &along, false)
    }

    /// -u.(M d + J^T y) by the configuration.
    pub fn mass(&mut self, m: &Motion<f64>, (d, y): (&[f64], &[f64]), u: &[f64]) -> Found {
        let kappa: Vec<f64> = y.iter().map(|y| -y).collect();
        let power = Power {
            eq: self.eq,
            motion: m,
            time: m.t,
            acceleration: d,
            rates: u,
            factor: -1.0,
            forces: Forces::Mass,
            alpha: &[],
            beta: &[],
            kappa: &kappa,
        };
        power.back(&mut self.plain);
        let mut found = self.plain_found(m.t);
        // d is no acceleration of the motion
        found.acceleration.fill(0.0);
        found
    }

    fn moved(&self, m: &Motion<f64>, along: &Along<'_>) -> Motion<Dual64> {
        let [f, g] = along.factors;
        let pair = |v: &f64, d: &f64| Dual64::new(*v, g * d);
        let start = Motion {
            t: m.t,
            q: m.q.iter().map(|v| Dual64::from(*v)).collect(),
            rate: m.rate.iter().zip(along.rate).map(|(v, d)| pair(v, d)).collect(),
            memory: m.memory.iter().map(|v| Dual64::from(*v)).collect(),
        };
        let dy: Vec<_> = along.increment.iter().map(|d| Dual64::new(0.0, f * d)).collect();
        start.moved(self.eq.topology(), &dy)
    }

    fn plain_found(&mut self, t: f64) -> Found {
        let by: Vec<_> = self.plain.motions.iter().map(|[v, d]| [*v, *d, 0.0]).collect();
        motions_back(self.eq, t, &by, &mut self.plain.geometry);
        Found {
            q: self.plain.q.clone(),
            rate: self.plain.rate.clone(),
            acceleration: self.plain.acceleration.clone(),
            memory: self.plain.memory.clone(),
        }
    }

    /// The derivative along the direction; `timed` where time runs along.
    fn along_found(&mut self, t: f64, along: &Along<'_>, timed: bool) -> Found {
        let of = |v: &[Dual64]| v.iter().map(|d| d.eps).collect::<Vec<_>>();
        let found = &self.along;
        let mut q = of(&found.q);
        let values: Vec<f64> = found.q.iter().map(|d| d.re).collect();
        let theta: Vec<f64> = along.increment.iter().map(|d| along.factors[0] * d).collect();
        add_small_move(self.eq, &theta, &values, &mut q);
        let run = if timed { 1.0 } else { 0.0 };
        let by = |[v, d]: &[Dual64; 2]| [v.eps, run * v.re + d.eps, run * d.re];
        let by: Vec<_> = found.motions.iter().map(by).collect();
        let found =
            Found { q, rate: of(&found.rate), acceleration: of(&found.acceleration), memory: of(&found.memory) };
        motions_back(self.eq, t, &by, &mut self.plain.geometry);
        found
    }

    /// Adjoints of numbers and geometry, in the order of the recorder, added up.
    pub fn add_numbers(&self, onto: &mut [f64]) {
        let (plain, along) = (&self.plain, &self.along);
        let mut slots = onto.iter_mut();
        let mut put = |v: f64| {
            if let Some(slot) = slots.next() {
                *slot += v;
            }
            0.0
        };
        for (a, b) in plain.x.iter().zip(&along.x) {
            put(a + b.eps);
        }
        let mut by_geometry = Vec::new();
        let _ = plain.geometry.map(|v: f64| {
            by_geometry.push(v);
            0.0
        });
        let mut rest = by_geometry.iter();
        let _ = along.geometry.map(|v: Dual64| put(rest.next().unwrap_or(&0.0) + v.eps));
    }
}

/// Motions by their numbers; `by`: weights of value, rate and acceleration of each.
fn motions_back(eq: &Equations<'_, f64>, t: f64, by: &[[f64; 3]], onto: &mut Geometry<f64>) {
    for (i, by) in by.iter().enumerate() {
        let law = &eq.geometry.motions[i];
        // a function in Python has no numbers
        if by.iter().all(|w| *w == 0.0) || matches!(law, MotionLaw::Function(..)) {
            continue;
        }
        clear();
        let mut n = 0;
        let law: MotionLaw<Taped> = law.map(&mut |v| {
            n += 1;
            leaf(v)
        });
        let sum = (law.at(t).iter().zip(by)).fold(Taped::from(0.0), |s, (v, w)| s + *v * *w);
        let d = backwards(sum, n);
        let mut slopes = d.iter();
        onto.motions[i] = onto.motions[i].map(&mut |v| v + slopes.next().unwrap_or(&0.0));
    }
}
