//! Internal states of laws with z' = g(u, v, z) and of sections in the air, as schemes carry them.
//!
//! A motion remembers the pair (z0, c) of z = z0 + c g(u, v, z) for every such law and section: c = 0 at the ends of steps, the gain of the
//! scheme within an implicit step, infinite where the law rests. The element solves its own equation, so that its force is one of
//! displacement and rate, and tangents and derivatives of a step hold those of the state. One-step schemes of order two carry z by
//! the trapezoidal rule, z1 = z0 + h/2 (g0 + g1); the others by their own formulas.
use std::borrow::Cow;
use std::ops::Range;

use nalgebra::{DMatrix, DVector};
use num_dual::Dual64;

use crate::aero::unsteady::Memory;
use crate::model::air::AirGeometry;
use crate::multibody::air::Here;
use crate::multibody::connector::motion_of;
use crate::multibody::topology::{BoundLaw, Connector};
use crate::spatial::Real;

use super::{Equations, Instant, Motion};

/// Newton's method for the states of a law; it is quadratic.
const STATE_ITERATIONS: usize = 25;

/// What has states with rates, where it is.
enum Rated<'a, T: Real> {
    /// a law, its numbers, its displacement and rate
    Law(&'a BoundLaw, &'a [T], T, T),
    /// a section in the air, and the places of its memory
    Section(Here<'a, T>, Range<usize>),
}

impl BoundLaw {
    /// Places in the memory.
    pub fn places(&self) -> Range<usize> {
        self.memory..self.memory + self.law.n_memory()
    }
}

impl<T: Real> Rated<'_, T> {
    /// Places in the memory: those of the states, then that of c.
    fn places(&self) -> Range<usize> {
        match self {
            Rated::Law(law, ..) => law.places(),
            Rated::Section(_, own) => own.clone(),
        }
    }

    /// z' at the states that belong to the memory, and a zero.
    fn rate(&self, memory: &[T]) -> Vec<T> {
        match self {
            Rated::Law(law, p, u, v) => law.law.state_rate(*u, *v, p, memory),
            Rated::Section(here, own) => {
                let flow = with_memory(here, memory).flow();
                let mut out = flow.rates[..own.len() - 1].to_vec();
                out.push(T::zero());
                out
            }
        }
    }

    /// The states that belong to the memory, c = 0.
    fn close(&self, memory: &mut [T]) {
        match self {
            Rated::Law(law, p, u, v) => {
                law.law.eval(*u, *v, p, memory);
            }
            Rated::Section(here, _) => close_section(here, memory),
        }
    }
}

fn with_memory<'p, T: Real>(here: &Here<'p, T>, memory: &[T]) -> Here<'p, T> {
    Here { memory: Memory::read(memory), ..*here }
}

/// The states of a section, c = 0.
pub(super) fn close_section<T: Real>(here: &Here<'_, T>, memory: &mut [T]) {
    let flow = with_memory(here, memory).flow();
    if let Some((gain, states)) = memory.split_last_mut() {
        states.copy_from_slice(&flow.states[..states.len()]);
        *gain = T::zero();
    }
}

/// The size of a velocity in the air: that of the wind, or what moves one length in a second where there is none.
fn air_speed<T: Real>(air: &AirGeometry<T>, length: f64) -> f64 {
    if air.speed.re() > 0.0 { air.speed.re() } else { length }
}

impl<'a, T: Real> Equations<'a, T> {
    /// Connectors that act and have a law with z' = g.
    pub(super) fn connectors_with_rates(&self) -> impl Iterator<Item = &'a Connector> {
        let topology = self.topology();
        self.rated.iter().map(move |c| &topology.connectors[*c])
    }

    pub fn has_state_rates(&self) -> bool {
        !(self.rated.is_empty() && self.rated_air.is_empty())
    }

    /// Places in the memory of all that has states with rates.
    fn rated_places(&self) -> impl Iterator<Item = Range<usize>> {
        let laws = self.connectors_with_rates().flat_map(|c| c.laws.iter().filter(|l| l.law.has_rates()));
        let topology = self.topology();
        laws.map(BoundLaw::places).chain(self.rated_air.iter().map(|i| topology.section_memory(*i)))
    }

    fn all_rated(&self, m: &Motion<T>) -> Vec<Rated<'_, T>> {
        if !self.has_state_rates() {
            return Vec::new();
        }
        let placement = self.place(m);
        let mut all = Vec::new();
        for c in self.connectors_with_rates() {
            let moved = motion_of(self.topology(), &self.geometry, &placement, &self.x, c);
            let laws = c.laws.iter().filter(|l| l.law.has_rates());
            let one = |law: &'a BoundLaw| (law, moved[law.component]);
            all.extend(laws.map(one).map(|(law, (u, v))| Rated::Law(law, self.law_numbers(law), u, v)));
        }
        let topology = self.topology();
        let section = |i: &usize| {
            let here = Here::new(topology, &self.geometry, &placement, self.numbers(m), *i);
            Rated::Section(here, topology.section_memory(*i))
        };
        all.extend(self.rated_air.iter().map(section));
        all
    }

    fn law_numbers(&self, law: &BoundLaw) -> &[T] {
        &self.x[law.x..law.x + law.law.n_params()]
    }

    /// z' at the places of z in the memory, zeros elsewhere; empty without such laws.
    pub fn state_rates(&self, m: &Motion<T>) -> Vec<T> {
        if !self.has_state_rates() {
            return Vec::new();
        }
        let mut out = vec![T::zero(); m.memory.len()];
        for one in self.all_rated(m) {
            let own = one.places();
            let rate = one.rate(&m.memory[own.clone()]);
            out[own].copy_from_slice(&rate);
        }
        out
    }

    /// The states themselves, c = 0.
    pub fn close_states(&self, m: &mut Motion<T>) {
        let mut memory = std::mem::take(&mut m.memory);
        for one in self.all_rated(m) {
            one.close(&mut memory[one.places()]);
        }
        m.memory = memory;
    }

    /// The states, in the places of the memory; empty without laws that have such.
    pub fn states(&self, m: &Motion<T>) -> Vec<T> {
        if !self.has_state_rates() {
            return Vec::new();
        }
        let mut closed = m.clone();
        self.close_states(&mut closed);
        closed.memory
    }

    /// The pair of the trapezoidal rule over a step of twice the gain, for laws whose states are known here.
    pub fn open_states(&self, m: &mut Motion<T>, gain: f64) {
        let rates = self.state_rates(m);
        self.close_states(m);
        let base: Vec<T> = m.memory.iter().zip(&rates).map(|(z, g)| *z + *g * gain).collect();
        self.set_states(m, &base, gain);
    }

    /// Pairs (base, c); `base` has the length of the memory, of which only places of z count.
    pub fn set_states(&self, m: &mut Motion<T>, base: &[T], gain: f64) {
        for own in self.rated_places() {
            let states = own.start..own.end - 1;
            m.memory[states.clone()].copy_from_slice(&base[states]);
            m.memory[own.end - 1] = T::from(gain);
        }
    }
}

impl Equations<'_, f64> {
    /// The start of a step of the trapezoidal rule.
    pub fn opened<'i>(&self, from: &'i Instant, h: f64) -> Cow<'i, Instant> {
        if !self.has_state_rates() {
            return Cow::Borrowed(from);
        }
        let mut out = from.clone();
        self.open_states(&mut out.motion, 0.5 * h);
        Cow::Owned(out)
    }

    /// A motion with changed states, c = 0.
    pub(super) fn with_states<'i>(&self, from: &'i Motion<f64>, change: &[f64]) -> Cow<'i, Motion<f64>> {
        if !self.has_state_rates() {
            return Cow::Borrowed(from);
        }
        let mut out = from.clone();
        let base: Vec<f64> = from.memory.iter().zip(change).map(|(z, d)| z + d).collect();
        self.set_states(&mut out, &base, 0.0);
        Cow::Owned(out)
    }

    /// Sizes of states, infinite at other places of the memory; empty without such laws.
    pub fn state_scales(&self) -> Vec<f64> {
        if !self.has_state_rates() {
            return Vec::new();
        }
        let mut out = vec![f64::INFINITY; self.topology().n_memory];
        for c in self.connectors_with_rates() {
            for law in c.laws.iter().filter(|l| l.law.has_rates()) {
                let length = if c.coordinates[law.component].is_length() { self.system.length } else { 1.0 };
                let size = law.law.state_size(self.law_numbers(law), length);
                out[law.memory..law.memory + law.law.n_states()].fill(size);
            }
        }
        for i in &self.rated_air {
            let (own, of) = (self.topology().section_memory(*i), self.topology().tables.sections[*i].air);
            let unsteady = self.topology().tables.air[of].unsteady;
            let speed = air_speed(&self.geometry.air[of], self.system.length);
            for k in 0..unsteady.states() {
                out[own.start + k] = if unsteady.is_velocity(k) { speed } else { 1.0 };
            }
        }
        out
    }

    /// Local error of the trapezoidal rule in the states: the difference to two half steps along the cubic through displacements
    /// and rates at both ends, times 4/3.
    pub fn state_error(&self, from: &Motion<f64>, to: &Motion<f64>, h: f64) -> Vec<f64> {
        if !self.has_state_rates() {
            return Vec::new();
        }
        let mut out = vec![0.0; from.memory.len()];
        let middle = self.halfway(from, to, h);
        let (start, end) = (self.all_rated(from), self.all_rated(to));
        let sections = middle.as_ref().map(|m| self.all_rated(m));
        for (k, (a, b)) in start.iter().zip(&end).enumerate() {
            let half = match (a, b) {
                (Rated::Law(law, p, u0, v0), Rated::Law(_, _, u1, v1)) => {
                    let u = 0.5 * (u0 + u1) + 0.125 * h * (v0 - v1);
                    Rated::Law(law, p, u, 1.5 * (u1 - u0) / h - 0.25 * (v0 + v1))
                }
                _ => match sections.as_ref().map(|s| &s[k]) {
                    Some(Rated::Section(here, own)) => Rated::Section(Here { ..*here }, own.clone()),
                    _ => continue,
                },
            };
            let own = a.places();
            let step = |z: &mut [f64], from: &Rated<'_, f64>, to: &Rated<'_, f64>, h: f64| {
                let rate = from.rate(z);
                from.close(z);
                z.iter_mut().zip(&rate).for_each(|(z, g)| *z += 0.5 * h * g);
                if let Some(gain) = z.last_mut() {
                    *gain = 0.5 * h;
                }
                to.close(z);
            };
            let (mut once, mut twice) = (from.memory[own.clone()].to_vec(), from.memory[own.clone()].to_vec());
            step(&mut once, a, b, h);
            step(&mut twice, a, &half, 0.5 * h);
            step(&mut twice, &half, b, 0.5 * h);
            for (i, k) in own.enumerate() {
                out[k] = (once[i] - twice[i]) * 4.0 / 3.0;
            }
        }
        out
    }

    /// The motion in the middle of a step, by the cubic through displacements and rates at both ends, where sections need it.
    fn halfway(&self, from: &Motion<f64>, to: &Motion<f64>, h: f64) -> Option<Motion<f64>> {
        if self.rated_air.is_empty() {
            return None;
        }
        let way = self.difference(from, to);
        let rates = || from.rate.iter().zip(&to.rate);
        let half: Vec<f64> = way.iter().zip(rates()).map(|(d, (a, b))| 0.5 * d + 0.125 * h * (a - b)).collect();
        let mut out = from.moved(self.topology(), &half);
        out.rate = way.iter().zip(rates()).map(|(d, (a, b))| 1.5 * d / h - 0.25 * (a + b)).collect();
        out.t += 0.5 * h;
        Some(out)
    }

    /// States between two motions, by the cubic through both ends and their rates.
    pub(super) fn interpolate_states(&self, from: &Motion<f64>, to: &Motion<f64>, inside: &mut [Motion<f64>]) {
        if !self.has_state_rates() {
            return;
        }
        let h = to.t - from.t;
        let (mut start, mut end) = (from.clone(), to.clone());
        self.close_states(&mut start);
        self.close_states(&mut end);
        let (g0, g1) = (self.state_rates(&start), self.state_rates(&end));
        for m in inside {
            let x = (m.t - from.t) / h;
            let at = |i: usize| {
                let (z0, gap) = (start.memory[i], end.memory[i] - start.memory[i]);
                let (d0, d1) = (h * g0[i], h * g1[i]);
                z0 + x * (d0 + x * ((3.0 * gap - 2.0 * d0 - d1) + x * (d0 + d1 - 2.0 * gap)))
            };
            let base: Vec<f64> = (0..m.memory.len()).map(at).collect();
            self.set_states(m, &base, 0.0);
        }
    }

    /// The states go along with a sudden change of the displacements, whose rates these increments are times any short time.
    pub(super) fn carry_states(&self, from: &Motion<f64>, increment: &[f64], to: &mut Motion<f64>) {
        if !self.has_state_rates() {
            return;
        }
        let mut fast = from.clone();
        fast.rate.iter_mut().zip(increment).for_each(|(v, d)| *v += d);
        let (before, after) = (self.state_rates(from), self.state_rates(&fast));
        let mut start = from.clone();
        self.close_states(&mut start);
        let base: Vec<f64> = (0..before.len()).map(|i| start.memory[i] + after[i] - before[i]).collect();
        self.set_states(to, &base, 0.0);
    }

    /// The same motion as the end of an implicit part of a step: tangents then contain what the states answer to it.
    pub(super) fn with_answering_states(&self, m: &Motion<f64>, gain: f64) -> Motion<f64> {
        let mut out = m.clone();
        self.close_states(&mut out);
        let rates = self.state_rates(&out);
        let base: Vec<f64> = out.memory.iter().zip(&rates).map(|(z, g)| z - gain * g).collect();
        self.set_states(&mut out, &base, gain);
        out
    }

    /// States of the stages of a Runge-Kutta method, Z_i = z0 + h sum_j a_ij g(u_j, v_j, Z_j), into their motions; false where Newton's
    /// method does not find them.
    pub(super) fn stage_states(&self, from: &Motion<f64>, a: &[&[f64]], h: f64, motions: &mut [Motion<f64>]) -> bool {
        if !self.has_state_rates() {
            return true;
        }
        let start = self.states(from);
        let at: Vec<Vec<Rated<'_, f64>>> = motions.iter().map(|m| self.all_rated(m)).collect();
        let mut found = vec![start.clone(); motions.len()];
        for k in 0..at[0].len() {
            let own = at[0][k].states();
            let stages: Vec<&Rated<'_, f64>> = at.iter().map(|r| &r[k]).collect();
            let Some(z) = coupled_states(&start[own.clone()], &stages, a, h) else { return false };
            for (i, stage) in found.iter_mut().enumerate() {
                stage[own.clone()].copy_from_slice(&z[i]);
            }
        }
        for (m, z) in motions.iter_mut().zip(&found) {
            self.set_states(m, z, 0.0);
        }
        true
    }

    /// (1/c - g_z)^-1 of slopes of the states: the filter of an estimate.
    pub(super) fn filtered_states(&self, m: &Motion<f64>, slopes: &[f64], c: f64) -> Vec<f64> {
        let mut out = vec![0.0; slopes.len()];
        for one in self.all_rated(m) {
            let own = one.states();
            let g_z = one.slope(&m.memory[own.clone()]).1;
            let matrix = DMatrix::<f64>::identity(own.len(), own.len()) / c - g_z;
            let right = DVector::from_column_slice(&slopes[own.clone()]);
            if let Some(x) = matrix.lu().solve(&right) {
                out[own].copy_from_slice(x.as_slice());
            }
        }
        out
    }
}

/// States of one law or section at all stages.
fn coupled_states(start: &[f64], stages: &[&Rated<'_, f64>], a: &[&[f64]], h: f64) -> Option<Vec<Vec<f64>>> {
    let (s, n) = (stages.len(), start.len());
    let mut z = vec![start.to_vec(); s];
    for _ in 0..STATE_ITERATIONS {
        let slopes: Vec<(Vec<f64>, DMatrix<f64>)> = z.iter().zip(stages).map(|(z, stage)| stage.slope(z)).collect();
        let mut left = DVector::<f64>::zeros(s * n);
        let mut matrix = DMatrix::<f64>::identity(s * n, s * n);
        for i in 0..s {
            for p in 0..n {
                left[i * n + p] = start[p] - z[i][p];
                for (j, (g, g_z)) in slopes.iter().enumerate() {
                    left[i * n + p] += h * a[i][j] * g[p];
                    for q in 0..n {
                        matrix[(i * n + p, j * n + q)] -= h * a[i][j] * g_z[(p, q)];
                    }
                }
            }
        }
        let change = matrix.lu().solve(&left)?;
        let mut settled = true;
        for (k, d) in change.iter().enumerate() {
            let own = &mut z[k / n][k % n];
            *own += d;
            settled &= d.abs() <= 8.0 * f64::EPSILON * (own.abs() + start[k % n].abs());
        }
        if settled {
            return Some(z);
        }
        if !change.iter().all(|d| d.is_finite()) {
            return None;
        }
    }
    // rounding circles about the solution where states are differences of large numbers
    Some(z)
}

impl Rated<'_, f64> {
    /// Places of the states in the memory.
    fn states(&self) -> Range<usize> {
        let own = self.places();
        own.start..own.end - 1
    }

    /// g and its derivatives by the states.
    fn slope(&self, z: &[f64]) -> (Vec<f64>, DMatrix<f64>) {
        let lift = |x: f64| Dual64::from_re(x);
        let along = |q: usize| -> Vec<Dual64> {
            let mut memory: Vec<Dual64> = z.iter().map(|x| lift(*x)).collect();
            memory[q].eps = 1.0;
            memory.push(lift(0.0));
            match self {
                Rated::Law(law, p, u, v) => {
                    let p: Vec<Dual64> = p.iter().map(|x| lift(*x)).collect();
                    law.law.state_rate(lift(*u), lift(*v), &p, &memory)
                }
                Rated::Section(here, _) => {
                    here.with(lift, |here| with_memory(here, &memory).flow().rates[..z.len()].to_vec())
                }
            }
        };
        let mut matrix = DMatrix::<f64>::zeros(z.len(), z.len());
        let mut slope = vec![0.0; z.len()];
        for q in 0..z.len() {
            for (i, g) in along(q).iter().take(z.len()).enumerate() {
                slope[i] = g.re;
                matrix[(i, q)] = g.eps;
            }
        }
        (slope, matrix)
    }
}
