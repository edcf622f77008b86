//! Stages that are solved for together backwards: the exact reverse of `Along::solved`.
//!
//! ```text
//! all stages:   [A L; R 0]^T (u, y; w) = (a_i^ + by T and w of q_i^, v_i^; z_i^; lam_i^)     the system of `gradient::stages`
//! then          -u_i.r - w_i.(rows) + (w^T y)_i.g     by q_i, v_i, z_i and the numbers, and from there to the base
//! ```
use nalgebra::DMatrix;

use crate::error::Result;
use crate::integrate::ali3p::pulled;
use crate::integrate::{Equations, Instant};
use crate::run::Counts;

use super::super::march::Here;
use super::super::runge_kutta::{Stages, weights};
use super::super::stages::{Base, Chart, Coupled, Probe, Rows};
use super::closing::{ended_back, turned_back};
use super::increments::{add_numbers, before_move, by_increments};
use super::recorder::{Adjoint, Recorder, add, column, state_rates_back};

/// Adjoints of all stages: poses, increments besides, rates, accelerations, multipliers and memories, one column each.
pub struct Back {
    q: Vec<DMatrix<f64>>,
    theta: Vec<DMatrix<f64>>,
    v: Vec<DMatrix<f64>>,
    a: Vec<DMatrix<f64>>,
    lam: Vec<DMatrix<f64>>,
    z: Vec<DMatrix<f64>>,
}

impl Back {
    pub fn none(stages: usize) -> Self {
        let none = || Vec::with_capacity(stages);
        Back { q: none(), theta: none(), v: none(), a: none(), lam: none(), z: none() }
    }

    /// Those of a pose count by its increments.
    pub fn push(&mut self, q: &[f64], theta: &[f64], at: &Adjoint) {
        let all = [
            (&mut self.q, q),
            (&mut self.theta, theta),
            (&mut self.v, &at.rate),
            (&mut self.a, &at.acceleration),
            (&mut self.lam, &at.lam),
            (&mut self.z, &at.memory),
        ];
        all.into_iter().for_each(|(to, own)| to.push(column(own)));
    }

    /// Adjoints of increments and rates of the base.
    fn base(&self, eq: &Equations<'_, f64>, by: &Stages, chart: &Chart) -> [Vec<DMatrix<f64>>; 2] {
        let own = by.all.iter().zip(&self.q).zip(&self.theta);
        let turned = own.map(|((s, q), theta)| column(&turned_back(eq, &s.increment, q.as_slice())) + theta);
        let [theta, v] = chart.increments_back(&turned.collect::<Vec<_>>());
        [theta, v.into_iter().zip(&self.v).map(|(d, v)| d + v).collect()]
    }
}

/// A step of Radau's method, from the adjoints at its end to those at its start; `seed` adds what is read of a stage.
pub fn radau_back(
    recorder: &mut Recorder<'_>,
    (from, end): (&Here, &Here),
    (by, probe): (&Stages, &Probe<'_>),
    at: Adjoint,
    seed: &mut dyn FnMut(&mut Recorder<'_>, usize, &Instant, &mut Adjoint) -> Result<()>,
    counts: &mut Counts,
) -> Result<Adjoint> {
    let eq = recorder.eq;
    let coupled = Coupled::new(probe, weights(by.h), by, counts)?;
    let mut last = Some(ended_back(recorder, by, end, at, &[])?);
    let (mut all, none) = (Back::none(by.all.len()), vec![0.0; eq.n()]);
    for (i, own) in by.all.iter().enumerate() {
        let mut read = Adjoint::none(from);
        seed(recorder, i, &own.at, &mut read)?;
        let mut q = by_increments(eq, &own.at.motion, &read.q);
        if let Some((by_end, last)) = last.take_if(|_| i + 1 == by.all.len()) {
            add(&mut q, &by_end);
            add(&mut read.rate, &last.rate);
            add(&mut read.memory, &last.memory);
        }
        all.push(&q, &none, &read);
    }
    let base = solved_back(recorder, (by, probe), &coupled, all)?;
    let mut before = Adjoint::none(from);
    add_numbers(eq, &from.instant.motion, base.x.as_slice(), &mut before.q);
    base.v.iter().for_each(|v| add(&mut before.rate, v.as_slice()));
    add(&mut before.memory, base.z.as_slice());
    Ok(before)
}

/// From adjoints of all stages to those of their base.
pub fn solved_back(
    recorder: &mut Recorder<'_>,
    (by, probe): (&Stages, &Probe<'_>),
    coupled: &Coupled,
    mut all: Back,
) -> Result<Base> {
    let eq = recorder.eq;
    differentiated(recorder, (by, probe), coupled, &mut all)?;
    let [theta, v] = all.base(eq, by, &coupled.chart);
    let mut x = DMatrix::zeros(eq.n(), 1);
    for (own, by_q) in by.all.iter().zip(&mut all.q) {
        before_move(eq, &own.increment, by_q.as_mut_slice());
        x += &*by_q;
    }
    Ok(Base { x, theta, v, z: all.z.iter().sum() })
}

/// Accelerations, multipliers and states of all stages by their increments, rates and memories: adjoints are added.
fn differentiated(
    recorder: &mut Recorder<'_>,
    (by, probe): (&Stages, &Probe<'_>),
    coupled: &Coupled,
    all: &mut Back,
) -> Result<()> {
    let eq = recorder.eq;
    let (s, n, rows, k) = (by.all.len(), eq.n(), eq.n_rows(), probe.states.len());
    let by_rates = coupled.chart.sums_back(&all.base(eq, by, &coupled.chart)[1]);
    let mut f = DMatrix::zeros(s * (n + k), 1);
    let mut g = DMatrix::zeros(s * rows, 1);
    for i in 0..s {
        f.rows_mut(i * n, n).copy_from(&(&all.a[i] + &by_rates[i]));
        g.rows_mut(i * rows, rows).copy_from(&all.lam[i]);
        for (p, place) in probe.states.iter().enumerate() {
            f[s * n + i * k + p] = all.z[i][*place];
        }
    }
    let (u, w) = coupled.system.solve_transposed(&f, &g)?;
    let w = w / coupled.rows_by;
    let spread = |i: usize| {
        let mut out = DMatrix::zeros(all.z[i].nrows(), 1);
        probe.states.iter().enumerate().for_each(|(p, place)| out[*place] = u[s * n + i * k + p]);
        out
    };
    let slopes = coupled.chart.sums_back(&(0..s).map(spread).collect::<Vec<_>>());
    for (i, own) in by.all.iter().enumerate() {
        let (m, a, lam) = (&own.at.motion, &own.at.acceleration, &own.at.lam);
        let (u, w) = (&u.as_slice()[i * n..(i + 1) * n], &w.as_slice()[i * rows..(i + 1) * rows]);
        let mut found = recorder.hand.balance(m, a, lam, (u, &[]), 1.0, 0.0);
        match probe.rows {
            Rows::Accelerations if rows > 0 => {
                let (q, rate) = recorder.hand.row_bias(m, a, w);
                add(&mut found.q, &q);
                add(&mut found.rate, &rate);
            }
            Rows::Rates if rows > 0 => {
                let pulled = pulled(&coupled.linear[i].jacobian, w);
                found.rate.iter_mut().zip(pulled.iter()).for_each(|(v, d)| *v -= d);
                add(&mut found.q, &recorder.hand.row_rates(m, w));
            }
            _ => {}
        }
        if k > 0 {
            let mut by_states = Adjoint { q: vec![0.0; m.q.len()], rate: found.rate, memory: found.memory, ..empty() };
            state_rates_back(recorder, m, slopes[i].as_slice(), &mut by_states);
            add(&mut found.q, &by_increments(eq, m, &by_states.q));
            (found.rate, found.memory) = (by_states.rate, by_states.memory);
        }
        add(all.q[i].as_mut_slice(), &found.q);
        add(all.v[i].as_mut_slice(), &found.rate);
        add(all.z[i].as_mut_slice(), &found.memory);
    }
    Ok(())
}

fn empty() -> Adjoint {
    Adjoint {
        q: Vec::new(),
        rate: Vec::new(),
        acceleration: Vec::new(),
        memory: Vec::new(),
        lam: Vec::new(),
        load: None,
        past: None,
    }
}
