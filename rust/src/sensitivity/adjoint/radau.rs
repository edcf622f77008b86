//! A step of Radau's method backwards: the exact reverse of `Along::radau`.
//!
//! ```text
//! all stages:   [A L; R 0]^T (u, y; w) = (a_i^ + by T and h A of q_i^, v_i^; z_i^; lam_i^)     the system of `gradient::radau`
//! then          -u_i.r - w_i.(J a + gamma) + (h A^T y)_i.g     by q_i, v_i, z_i and the numbers, and from there to q0, v0, z0
//! ```
use nalgebra::DMatrix;

use crate::error::Result;
use crate::integrate::{Equations, Instant};
use crate::run::Counts;

use super::super::march::Here;
use super::super::radau::{Chart, Coupled, Probe};
use super::super::runge_kutta::Stages;
use super::increments::{add_numbers, before_move, by_increments};
use super::recorder::{Adjoint, Recorder, add, column, state_rates_back};
use super::runge_kutta::ended_back;

/// Adjoints of all stages: increments, rates, accelerations, multipliers and memories, one column each.
struct Back {
    q: Vec<DMatrix<f64>>,
    v: Vec<DMatrix<f64>>,
    a: Vec<DMatrix<f64>>,
    lam: Vec<DMatrix<f64>>,
    z: Vec<DMatrix<f64>>,
}

impl Back {
    fn none(stages: usize) -> Self {
        let none = || Vec::with_capacity(stages);
        Back { q: none(), v: none(), a: none(), lam: none(), z: none() }
    }

    fn push(&mut self, q: &[f64], at: &Adjoint) {
        let all = [
            (&mut self.q, q),
            (&mut self.v, &at.rate),
            (&mut self.a, &at.acceleration),
            (&mut self.lam, &at.lam),
            (&mut self.z, &at.memory),
        ];
        all.into_iter().for_each(|(to, own)| to.push(column(own)));
    }

    /// Adjoints of the rates, with what the increments make of them.
    fn rates(&self, eq: &Equations<'_, f64>, by: &Stages, chart: &Chart) -> Vec<DMatrix<f64>> {
        let turned = |(q, own): (&DMatrix<f64>, &[f64])| eq.turned_columns(q.transpose(), own).transpose();
        let theta: Vec<_> = self.q.iter().zip(by.all.iter().map(|s| &s.increment[..])).map(turned).collect();
        chart.increments_back(&theta).into_iter().zip(&self.v).map(|(d, v)| d + v).collect()
    }
}

/// From the adjoints at the end of a step to those at its start; `seed` adds what is read of a stage.
pub fn step_back(
    recorder: &mut Recorder<'_>,
    (from, end): (&Here, &Here),
    (by, probe): (&Stages, &Probe<'_>),
    at: Adjoint,
    seed: &mut dyn FnMut(&mut Recorder<'_>, usize, &Instant, &mut Adjoint) -> Result<()>,
    counts: &mut Counts,
) -> Result<Adjoint> {
    let eq = recorder.eq;
    let coupled = Coupled::new(probe, by, counts)?;
    let mut last = Some(ended_back(recorder, by, end, at)?);
    let mut all = Back::none(by.all.len());
    for (i, own) in by.all.iter().enumerate() {
        let mut read = Adjoint::none(from);
        seed(recorder, i, &own.at, &mut read)?;
        let mut q = by_increments(eq, &own.at.motion, &read.q);
        if let Some(last) = last.take_if(|_| i + 1 == by.all.len()) {
            add(&mut q, &by_increments(eq, &by.end, &last.q));
            add(&mut read.rate, &last.rate);
            add(&mut read.memory, &last.memory);
        }
        all.push(&q, &read);
    }
    solved_back(recorder, (by, probe), &coupled, &mut all)?;
    let mut before = Adjoint::none(from);
    let mut q = vec![0.0; eq.n()];
    for (own, by_q) in by.all.iter().zip(&all.q) {
        let mut own_q = by_q.as_slice().to_vec();
        before_move(eq, &own.increment, &mut own_q);
        add(&mut q, &own_q);
    }
    add_numbers(eq, &from.instant.motion, &q, &mut before.q);
    all.rates(eq, by, &coupled.chart).iter().for_each(|v| add(&mut before.rate, v.as_slice()));
    all.z.iter().for_each(|z| add(&mut before.memory, z.as_slice()));
    Ok(before)
}

/// Accelerations, multipliers and states of all stages by their increments, rates and memories: adjoints are added.
fn solved_back(
    recorder: &mut Recorder<'_>,
    (by, probe): (&Stages, &Probe<'_>),
    coupled: &Coupled,
    all: &mut Back,
) -> Result<()> {
    let eq = recorder.eq;
    let (s, n, rows, k) = (by.all.len(), eq.n(), eq.n_rows(), probe.states.len());
    let by_rates = coupled.chart.sums_back(&all.rates(eq, by, &coupled.chart));
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
        if rows > 0 {
            let (q, rate) = recorder.hand.row_bias(m, a, w);
            add(&mut found.q, &q);
            add(&mut found.rate, &rate);
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
    }
}
