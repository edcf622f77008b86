//! Internal states of laws with z' = g(u, v, z), as schemes carry them.
//!
//! A motion remembers the pair (z0, c) of z = z0 + c g(u, v, z) for every such law: c = 0 at the ends of steps, the gain of the
//! scheme within an implicit step, infinite where the law rests. The element solves its own equation, so that its force is one of
//! displacement and rate, and tangents and derivatives of a step hold those of the state. One-step schemes of order two carry z by
//! the trapezoidal rule, z1 = z0 + h/2 (g0 + g1); the others by their own formulas.
use std::borrow::Cow;

use crate::spatial::Real;
use crate::system::connector::{Numbers, continued_motion_of};
use crate::system::topology::{BoundLaw, Connector};

use super::{Equations, Instant, Motion};

/// A law with states, and its coordinate.
struct Rated<'a, T> {
    law: &'a BoundLaw,
    u: T,
    v: T,
}

impl BoundLaw {
    /// Places in the memory.
    pub fn places(&self) -> std::ops::Range<usize> {
        self.memory..self.memory + self.law.n_memory()
    }
}

impl<'a, T: Real> Equations<'a, T> {
    /// Connectors that act and have a law with z' = g.
    pub(super) fn connectors_with_rates(&self) -> impl Iterator<Item = &'a Connector> {
        let topology = self.topology();
        self.rated.iter().map(move |c| &topology.connectors[*c])
    }

    pub fn has_state_rates(&self) -> bool {
        !self.rated.is_empty()
    }

    fn laws_with_rates(&self, m: &Motion<T>) -> Vec<Rated<'a, T>> {
        if self.rated.is_empty() {
            return Vec::new();
        }
        let placement = self.place(m);
        let mut all = Vec::new();
        for c in self.connectors_with_rates() {
            let numbers = Numbers { x: &self.x, memory: &m.memory, t: m.t };
            let moved = continued_motion_of(self.topology(), &self.geometry, &placement, numbers, c);
            let laws = c.laws.iter().filter(|l| l.law.has_rates());
            all.extend(laws.map(|law| Rated { law, u: moved[law.component].0, v: moved[law.component].1 }));
        }
        all
    }

    fn law_numbers(&self, law: &BoundLaw) -> &[T] {
        &self.x[law.x..law.x + law.law.n_params()]
    }

    /// z' at the places of z in the memory, zeros elsewhere; empty without such laws.
    pub fn state_rates(&self, m: &Motion<T>) -> Vec<T> {
        if self.rated.is_empty() {
            return Vec::new();
        }
        let mut out = vec![T::zero(); m.memory.len()];
        for Rated { law, u, v } in self.laws_with_rates(m) {
            let own = law.places();
            let rate = law.law.state_rate(u, v, self.law_numbers(law), &m.memory[own.clone()]);
            out[own].copy_from_slice(&rate);
        }
        out
    }

    /// The states themselves, c = 0.
    pub fn close_states(&self, m: &mut Motion<T>) {
        for Rated { law, u, v } in self.laws_with_rates(m) {
            law.law.eval(u, v, self.law_numbers(law), &mut m.memory[law.places()]);
        }
    }

    /// The states, in the places of the memory; empty without laws that have such.
    pub fn states(&self, m: &Motion<T>) -> Vec<T> {
        if self.rated.is_empty() {
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
        for c in self.connectors_with_rates() {
            for law in c.laws.iter().filter(|l| l.law.has_rates()) {
                let (own, n) = (law.places(), law.law.n_states());
                m.memory[own.start..own.start + n].copy_from_slice(&base[own.start..own.start + n]);
                m.memory[own.start + n] = T::from(gain);
            }
        }
    }
}

impl Equations<'_, f64> {
    /// The start of a step of the trapezoidal rule.
    pub fn opened<'i>(&self, from: &'i Instant, h: f64) -> Cow<'i, Instant> {
        if self.rated.is_empty() {
            return Cow::Borrowed(from);
        }
        let mut out = from.clone();
        self.open_states(&mut out.motion, 0.5 * h);
        Cow::Owned(out)
    }

    /// A motion with changed states, c = 0.
    pub(super) fn with_states<'i>(&self, from: &'i Motion<f64>, change: &[f64]) -> Cow<'i, Motion<f64>> {
        if self.rated.is_empty() {
            return Cow::Borrowed(from);
        }
        let mut out = from.clone();
        let base: Vec<f64> = from.memory.iter().zip(change).map(|(z, d)| z + d).collect();
        self.set_states(&mut out, &base, 0.0);
        Cow::Owned(out)
    }

    /// Sizes of states, infinite at other places of the memory; empty without such laws.
    pub fn state_scales(&self) -> Vec<f64> {
        if self.rated.is_empty() {
            return Vec::new();
        }
        let mut out = vec![f64::INFINITY; self.topology().n_memory];
        for c in self.connectors_with_rates() {
            for law in c.laws.iter().filter(|l| l.law.has_rates()) {
                let length = if c.turn_of(law.component).is_some() { 1.0 } else { self.system.length };
                let size = law.law.state_size(self.law_numbers(law), length);
                out[law.memory..law.memory + law.law.n_states()].fill(size);
            }
        }
        out
    }

    /// Local error of the trapezoidal rule in the states: the difference to two half steps along the cubic through displacements
    /// and rates at both ends, times 4/3.
    pub fn state_error(&self, from: &Motion<f64>, to: &Motion<f64>, h: f64) -> Vec<f64> {
        if self.rated.is_empty() {
            return Vec::new();
        }
        let mut out = vec![0.0; from.memory.len()];
        for (a, b) in self.laws_with_rates(from).iter().zip(&self.laws_with_rates(to)) {
            let (law, p, own) = (&a.law.law, self.law_numbers(a.law), a.law.places());
            let half = (0.5 * (a.u + b.u) + 0.125 * h * (a.v - b.v), 1.5 * (b.u - a.u) / h - 0.25 * (a.v + b.v));
            let step = |z: &mut [f64], from: (f64, f64), to: (f64, f64), h: f64| {
                let rate = law.state_rate(from.0, from.1, p, z);
                law.eval(from.0, from.1, p, z);
                z.iter_mut().zip(&rate).for_each(|(z, g)| *z += 0.5 * h * g);
                if let Some(gain) = z.last_mut() {
                    *gain = 0.5 * h;
                }
                law.eval(to.0, to.1, p, z);
            };
            let (mut once, mut twice) = (from.memory[own.clone()].to_vec(), from.memory[own.clone()].to_vec());
            step(&mut once, (a.u, a.v), (b.u, b.v), h);
            step(&mut twice, (a.u, a.v), half, 0.5 * h);
            step(&mut twice, half, (b.u, b.v), 0.5 * h);
            for (i, k) in own.enumerate() {
                out[k] = (once[i] - twice[i]) * 4.0 / 3.0;
            }
        }
        out
    }

    /// States between two motions, by the cubic through both ends and their rates.
    pub(super) fn interpolate_states(&self, from: &Motion<f64>, to: &Motion<f64>, inside: &mut [Motion<f64>]) {
        if self.rated.is_empty() {
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
        if self.rated.is_empty() {
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
}
