//! Alternating frequency and time: coefficients of u -> samples -> law -> coefficients of the force, and the exact Jacobian.
//!
//! With c_k the Fourier coefficients of g = df/du at the samples, the Jacobian of the force coefficients is
//! dFc_j/da_h = Re(c_{j-h} + c_{j+h}), dFc_j/db_h = Im(c_{j-h} - c_{j+h}), dFs_j/da_h = -Im(c_{j-h} + c_{j+h}),
//! dFs_j/db_h = Re(c_{j-h} - c_{j+h}), the row j = 0 halved: exact on the grid, aliasing included.
//! Sharp contacts of periodic motions are not sampled but integrated exactly (`ramps`).
//! Laws with sliders are marched over two periods, the derivative of each sample carried along; the second period counts. States
//! with a rate are those of a periodic motion (`periodic_state`). A law of m coordinates has m forces and m x m blocks of Jacobians.
//! Source: docs/theory.md (11.4), (11.5); T. M. Cameron, J. H. Griffin, J. Appl. Mech. 56 (1989) 149-154.
mod march;
mod tail;

use num_complex::Complex64 as c64;
use num_dual::Dual64;

use super::basis::{Basis, Slots};
use super::element::Force;
use super::grid::{Grid, Slot};
use super::periodic_state::{Change, PeriodicState, Samples};
use super::ramps::{Contact, Ramp};
use crate::error::Result;
use crate::force::AnyLaw;
use march::March;
use tail::Tail;

/// Plans, tables and scratch of one thread. Coefficients are [a0, a1, b1, a2, b2, ...].
pub struct Aft {
    grid: Grid,
    slots: Slots,
    n_c: usize,
    /// coordinates of the law that was evaluated last; samples and coefficients of one lie one after the other
    m: usize,
    phase: Vec<f64>,
    /// exp(i k tau/2) per term where the samples lie in the middle of the usual intervals, else empty
    turn: Vec<c64>,
    spectrum: Vec<c64>,
    u: Vec<f64>,
    v: Vec<f64>,
    dv: Vec<f64>,
    f: Vec<f64>,
    f_u: Vec<f64>,
    f_v: Vec<f64>,
    rate: Vec<f64>,
    memory: Option<March>,
    /// of the first term
    first: f64,
    /// the terms of a periodic motion, and the coefficients of the last one as the samples see it; no terms on a torus
    terms: Vec<i32>,
    motion: Vec<f64>,
    /// of a contact, n_c x n_c by rows
    product: Vec<f64>,
    /// Forces in the terms beyond those of the basis, where they are asked for.
    pub tail: Tail,
    /// Force coefficients, (m, n_c).
    pub force: Vec<f64>,
    /// Derivative of `force` along the parameter that moves the frequencies, (m, n_c).
    pub force_slope: Vec<f64>,
    /// d force / d coefficients of u, (m, m) blocks n_c x n_c by rows.
    pub jacobian: Vec<f64>,
    /// The part of the force that multiplies the rate: matrix of df/dv, (m, m) blocks n_c x n_c by rows (for stability).
    pub damping: Vec<f64>,
}

/// What `Aft::element` is to compute.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Want {
    Force,
    Jacobian,
    /// df/du and df/dv at the samples, no coefficients
    Tangents,
    /// their means over the intervals around the samples
    Means,
}

impl Aft {
    pub fn new(basis: &Basis, dims: &[usize], with_memory: bool) -> Aft {
        let grid = Grid::new(dims);
        let slots = Slots::new(basis, &grid);
        let (n, n_c) = (grid.n_samples(), basis.n_coefficients());
        let last = dims[dims.len() - 1];
        // tau of the first dimension, in terms of the excitation
        let tau = |i: usize| std::f64::consts::TAU * (i / (n / dims[0])) as f64 / dims[0] as f64;
        let phase: Vec<f64> = (0..n).map(tau).collect();
        let memory = (with_memory && dims.len() == 1).then(|| March::new(basis, last));
        Aft {
            spectrum: vec![c64::new(0.0, 0.0); grid.spectrum_len()],
            grid,
            slots,
            n_c,
            m: 1,
            phase: phase.iter().map(|t| t * basis.subharmonic).collect(),
            turn: Vec::new(),
            u: vec![0.0; n],
            v: vec![0.0; n],
            dv: vec![0.0; n],
            f: vec![0.0; n],
            f_u: vec![0.0; n],
            f_v: vec![0.0; n],
            rate: vec![0.0; n_c],
            memory,
            first: basis.indices.first().map_or(1.0, |k| f64::from(k[0])),
            terms: if dims.len() == 1 { basis.indices.iter().map(|k| k[0]).collect() } else { Vec::new() },
            motion: vec![0.0; n_c],
            product: Vec::new(),
            tail: Tail::default(),
            force: vec![0.0; n_c],
            force_slope: vec![0.0; n_c],
            jacobian: vec![0.0; n_c * n_c],
            damping: vec![0.0; n_c * n_c],
        }
    }

    /// For periodic motions alone: `n` samples at the middles of n intervals of the period, without tables for laws with memory.
    pub fn between(basis: &Basis, n: usize) -> Aft {
        let half = std::f64::consts::PI / n as f64;
        let mut aft = Aft::new(basis, &[n], false);
        aft.turn = basis.indices.iter().map(|k| c64::cis(f64::from(k[0]) * half)).collect();
        for phase in &mut aft.phase {
            *phase += half * basis.subharmonic;
        }
        aft
    }

    /// Every force also in the terms beyond those of the basis that the samples resolve; their index vectors come back.
    pub fn resolve_tail(&mut self, basis: &Basis) -> Vec<Vec<i32>> {
        let (tail, indices) = Tail::new(basis, self.grid.dims());
        self.tail = tail;
        indices
    }

    /// Samples per dimension.
    pub fn dims(&self) -> &[usize] {
        self.grid.dims()
    }

    /// Room for a law of m coordinates.
    fn shape(&mut self, m: usize) {
        if self.m == m {
            return;
        }
        self.m = m;
        let (n, n_c) = (self.phase.len(), self.n_c);
        for samples in [&mut self.u, &mut self.v, &mut self.dv, &mut self.f] {
            samples.resize(m * n, 0.0);
        }
        for samples in [&mut self.f_u, &mut self.f_v] {
            samples.resize(m * m * n, 0.0);
        }
        for coefficients in [&mut self.motion, &mut self.force, &mut self.force_slope] {
            coefficients.resize(m * n_c, 0.0);
        }
        for blocks in [&mut self.jacobian, &mut self.damping] {
            blocks.resize(m * m * n_c * n_c, 0.0);
        }
    }

    /// The forces on the motion with the coefficients `u` (m, n_c); `frequency` of every term and its `slope` along the parameter.
    pub fn element(&mut self, force: &Force, u: &[f64], frequency: &[f64], slope: &[f64], want: Want) -> Result<()> {
        self.shape(force.coordinates());
        let (n, n_c) = (self.phase.len(), self.n_c);
        for (a, u) in u.chunks_exact(n_c).enumerate() {
            let turned: Vec<f64>;
            let u = if self.turn.is_empty() {
                u
            } else {
                turned = rotated(u, &self.turn);
                &turned
            };
            let own = a * n..(a + 1) * n;
            synthesise(&mut self.grid, &self.slots, &mut self.spectrum, u, &mut self.u[own.clone()]);
            self.motion[a * n_c..(a + 1) * n_c].copy_from_slice(u);
            if force.uses_velocity() {
                derivative(u, frequency, &mut self.rate);
                synthesise(&mut self.grid, &self.slots, &mut self.spectrum, &self.rate, &mut self.v[own.clone()]);
                if want == Want::Jacobian {
                    derivative(u, slope, &mut self.rate);
                    synthesise(&mut self.grid, &self.slots, &mut self.spectrum, &self.rate, &mut self.dv[own]);
                }
            } else {
                self.v[own].fill(0.0);
            }
        }
        match force {
            Force::Known { law, numbers, start } if law.has_rates() => {
                self.follow(*law, (numbers, start), frequency, slope, want)?;
            }
            Force::Known { law, numbers, start } if law.has_map() => self.march(*law, (numbers, start), want)?,
            Force::Known { law, numbers, .. } => {
                let ramps = if self.terms.is_empty() { Vec::new() } else { Ramp::of(*law, numbers) };
                self.sample(*law, numbers, want);
                self.leave_out(&ramps, want);
                self.gather(law.uses_velocity(), frequency, want);
                self.add_contacts(&ramps, want);
            }
            Force::Sampled(law) => {
                law.evaluate(&self.u, &self.v, &mut self.f, &mut self.f_u, &mut self.f_v)?;
                self.gather(true, frequency, want);
            }
        }
        Ok(())
    }

    /// Force, and its tangents if wanted, at the samples.
    fn sample(&mut self, law: AnyLaw, p: &[f64], want: Want) {
        if want == Want::Force {
            for i in 0..self.u.len() {
                self.f[i] = law.force_at(self.phase[i], self.u[i], self.v[i], p, &[], &mut []);
            }
            return;
        }
        let mut duals = [Dual64::from(0.0); 16];
        let heap: Vec<Dual64>;
        let pd: &[Dual64] = if p.len() <= duals.len() {
            duals.iter_mut().zip(p).for_each(|(d, &x)| *d = Dual64::from(x));
            &duals[..p.len()]
        } else {
            heap = p.iter().map(|&x| Dual64::from(x)).collect();
            &heap
        };
        for i in 0..self.u.len() {
            let (tau, u, v) = (self.phase[i], self.u[i], self.v[i]);
            let along_u = law.force_at(tau, Dual64::new(u, 1.0), Dual64::from(v), pd, &[], &mut []);
            self.f[i] = along_u.re;
            self.f_u[i] = along_u.eps;
            if law.uses_velocity() {
                let along_v = law.force_at(tau, Dual64::from(u), Dual64::new(v, 1.0), pd, &[], &mut []);
                self.f_v[i] = along_v.eps;
            }
        }
    }

    /// The samples of a law without its ramps.
    fn leave_out(&mut self, ramps: &[Ramp], want: Want) {
        if ramps.is_empty() || matches!(want, Want::Tangents | Want::Means) {
            return;
        }
        for ((u, f), f_u) in self.u.iter().zip(&mut self.f).zip(&mut self.f_u) {
            for (force, slope) in ramps.iter().map(|r| r.force(*u)) {
                *f -= force;
                *f_u -= slope;
            }
        }
    }

    /// What the ramps add to the coefficients and their Jacobian, or to the means of the slope.
    fn add_contacts(&mut self, ramps: &[Ramp], want: Want) {
        if want == Want::Tangents || !self.u.iter().all(|u| u.is_finite()) {
            return;
        }
        let (n_c, terms) = (self.n_c, &self.terms);
        for ramp in ramps {
            let contact = Contact::new(ramp, terms, &self.motion, &self.u);
            if want == Want::Means {
                contact.add_means(ramp.slope, &mut self.f_u);
                continue;
            }
            let most = terms.iter().map(|k| k.unsigned_abs() as usize).max().unwrap_or(0);
            let chi = contact.spectrum(most + most.max(self.tail.top()));
            let coefficient = |l: i32| {
                let c = chi[l.unsigned_abs() as usize];
                if l < 0 { c.conj() } else { c }
            };
            let term = |j: usize| if j == 0 { 0 } else { terms[j - 1] };
            let pair = |j: usize, h: usize| (coefficient(term(j) - term(h)), coefficient(term(j) + term(h)));
            self.product.resize(n_c * n_c, 0.0);
            product_matrix(pair, n_c, &mut self.product);
            for (row, product) in self.product.chunks_exact(n_c).enumerate() {
                let sum: f64 = product.iter().zip(&self.motion).map(|(p, u)| p * u).sum();
                self.force[row] += ramp.slope * (sum - product[0] * ramp.at);
            }
            self.tail.add_ramp(ramp, coefficient, terms, &self.motion);
            if want == Want::Jacobian {
                self.jacobian.iter_mut().zip(&self.product).for_each(|(j, p)| *j += ramp.slope * p);
            }
        }
    }

    /// Coefficients of the samples, and the Jacobian from the tangents if wanted.
    fn gather(&mut self, moving: bool, frequency: &[f64], want: Want) {
        if matches!(want, Want::Tangents | Want::Means) {
            if !moving {
                self.f_v.fill(0.0);
            }
            return;
        }
        self.analyse_force();
        if want == Want::Force {
            return;
        }
        let (n, block) = (self.phase.len(), self.n_c * self.n_c);
        for pair in 0..self.m * self.m {
            self.grid.analyse(&self.f_u[pair * n..][..n], &mut self.spectrum);
            let out = &mut self.jacobian[pair * block..][..block];
            product_matrix(sampled(&self.slots, &self.spectrum), self.n_c, out);
        }
        self.force_slope.fill(0.0);
        if moving {
            (0..self.m * self.m).for_each(|pair| self.add_rate_terms(pair, frequency));
            (0..self.m).for_each(|a| self.gather_slope(a));
        } else {
            self.damping.fill(0.0);
            self.f_v.fill(0.0);
        }
    }

    /// The block of df/dv of a pair, and what it adds to that of the Jacobian.
    fn add_rate_terms(&mut self, pair: usize, frequency: &[f64]) {
        let (n_c, n) = (self.n_c, self.phase.len());
        self.grid.analyse(&self.f_v[pair * n..][..n], &mut self.spectrum);
        let own = pair * n_c * n_c..(pair + 1) * n_c * n_c;
        let (jacobian, damping) = (&mut self.jacobian[own.clone()], &mut self.damping[own]);
        product_matrix(sampled(&self.slots, &self.spectrum), n_c, damping);
        for (jacobian, damping) in jacobian.chunks_exact_mut(n_c).zip(damping.chunks_exact(n_c)) {
            for (h, w) in frequency.iter().enumerate() {
                let (cos, sin) = (2 * h + 1, 2 * h + 2);
                // u' has the cosine coefficient w b and the sine coefficient -w a
                jacobian[cos] -= w * damping[sin];
                jacobian[sin] += w * damping[cos];
            }
        }
    }

    /// How the force on coordinate a changes with the frequencies.
    fn gather_slope(&mut self, a: usize) {
        let (n, n_c) = (self.phase.len(), self.n_c);
        let by_rates = self.f_v[a * self.m * n..][..self.m * n].chunks_exact(n).zip(self.dv.chunks_exact(n));
        let changes = &mut self.f[a * n..][..n];
        changes.fill(0.0);
        for (f_v, dv) in by_rates {
            changes.iter_mut().zip(f_v.iter().zip(dv)).for_each(|(change, (f_v, dv))| *change += f_v * dv);
        }
        self.grid.analyse(changes, &mut self.spectrum);
        collect(&self.slots, &self.spectrum, &mut self.force_slope[a * n_c..][..n_c]);
    }

    fn march(&mut self, law: AnyLaw, (p, start): (&[f64], &[f64]), want: Want) -> Result<()> {
        let n = self.u.len();
        let mut z = start.to_vec();
        self.force_slope.fill(0.0);
        self.damping.fill(0.0);
        let Some(march) = self.memory.as_mut().filter(|_| want == Want::Jacobian) else {
            for step in 0..2 * n {
                self.f[step % n] = law.eval(self.u[step % n], 0.0, p, &mut z);
            }
            self.analyse_force();
            return Ok(());
        };
        self.jacobian.fill(0.0);
        march.columns.fill(0.0);
        self.f.fill(0.0);
        // sliders of a parallel set do not see each other, so that each is marched by itself
        for (i, rest) in start.iter().enumerate() {
            let (part, numbers) = law.part(i)?;
            march.slider(part, (&p[numbers], *rest), &self.u, &mut self.f, self.n_c);
        }
        self.analyse_columns();
        self.analyse_force();
        Ok(())
    }

    /// A law whose states have rates, its states periodic.
    fn follow(
        &mut self,
        law: AnyLaw,
        (p, start): (&[f64], &[f64]),
        frequency: &[f64],
        slope: &[f64],
        want: Want,
    ) -> Result<()> {
        let n = self.u.len();
        let omega = frequency.first().map_or(f64::NAN, |w| w / self.first);
        let interval = std::f64::consts::TAU / (omega * n as f64);
        // a faster motion has shorter intervals
        let stretch = -slope.first().map_or(0.0, |s| s / self.first) / omega;
        self.damping.fill(0.0);
        self.f.fill(0.0);
        let (mut moved, mut dz) = (vec![0.0; n], vec![0.0; n]);
        let with_columns = want == Want::Jacobian;
        if let Some(march) = self.memory.as_mut().filter(|_| with_columns) {
            march.columns.fill(0.0);
        }
        for (i, rest) in start.iter().enumerate() {
            let (part, numbers) = law.part(i)?;
            let samples = Samples { u: &self.u, v: &self.v, interval };
            let state = PeriodicState::new(part, &p[numbers], samples, *rest)?;
            self.f.iter_mut().zip(&state.at).for_each(|(f, at)| *f += at.force[0]);
            let Some(march) = self.memory.as_mut().filter(|_| with_columns) else { continue };
            for c in 0..self.n_c {
                march.motion(c, frequency, self.n_c, (&mut self.f_u, &mut self.f_v));
                state.along(&Change { u: Some(&self.f_u), v: Some(&self.f_v), stretch: 0.0 }, &mut dz);
                let column = &mut march.columns[c * n..][..n];
                for (j, at) in state.at.iter().enumerate() {
                    column[j] += at.force[1] * self.f_u[j] + at.force[2] * self.f_v[j] + at.force[3] * dz[j];
                }
            }
            let faster = part.uses_velocity().then_some(self.dv.as_slice());
            state.along(&Change { u: None, v: faster, stretch }, &mut dz);
            for (j, at) in state.at.iter().enumerate() {
                moved[j] += at.force[3] * dz[j] + faster.map_or(0.0, |dv| at.force[2] * dv[j]);
            }
        }
        self.force_slope.fill(0.0);
        if with_columns {
            self.analyse_columns();
            self.grid.analyse(&moved, &mut self.spectrum);
            collect(&self.slots, &self.spectrum, &mut self.force_slope);
        }
        self.analyse_force();
        Ok(())
    }

    /// The Jacobian from the samples of its columns.
    fn analyse_columns(&mut self) {
        let n = self.u.len();
        let Some(march) = &self.memory else { return };
        for c in 0..self.n_c {
            self.grid.analyse(&march.columns[c * n..][..n], &mut self.spectrum);
            collect(&self.slots, &self.spectrum, &mut self.rate);
            for (row, value) in self.rate.iter().enumerate() {
                self.jacobian[row * self.n_c + c] = *value;
            }
        }
    }

    fn analyse_force(&mut self) {
        let n = self.phase.len();
        self.tail.force.clear();
        for (f, force) in self.f.chunks_exact(n).zip(self.force.chunks_exact_mut(self.n_c)) {
            self.grid.analyse(f, &mut self.spectrum);
            collect(&self.slots, &self.spectrum, force);
            self.tail.collect(&self.spectrum);
        }
    }

    /// Displacements of a coordinate of the last element at the samples.
    pub fn displacements(&self, coordinate: usize) -> &[f64] {
        &self.u[coordinate * self.phase.len()..][..self.phase.len()]
    }

    /// Displacements and rates (m,) of the last element at a sample.
    pub fn motion_at(&self, sample: usize) -> (Vec<f64>, Vec<f64>) {
        let of = |x: &[f64]| x.iter().skip(sample).step_by(self.phase.len()).copied().collect();
        (of(&self.u), of(&self.v))
    }

    /// Phases of the excitation at the samples.
    pub fn phases(&self) -> &[f64] {
        &self.phase
    }

    /// df/du and df/dv of a force of the last element by one of its coordinates, at the samples; only for laws without memory.
    pub fn tangents(&self, force: usize, by: usize) -> (&[f64], &[f64]) {
        let n = self.phase.len();
        let own = (force * self.m + by) * n..(force * self.m + by + 1) * n;
        (&self.f_u[own.clone()], &self.f_v[own])
    }
}

fn at(spectrum: &[c64], slot: Slot) -> c64 {
    if slot < 0 { spectrum[!slot as usize].conj() } else { spectrum[slot as usize] }
}

fn put(spectrum: &mut [c64], slot: Slot, c: c64) {
    if slot < 0 {
        spectrum[!slot as usize] = c.conj();
    } else {
        spectrum[slot as usize] = c;
    }
}

fn synthesise(grid: &mut Grid, slots: &Slots, spectrum: &mut [c64], coefficients: &[f64], samples: &mut [f64]) {
    spectrum.fill(c64::new(0.0, 0.0));
    spectrum[0].re = coefficients[0];
    for (h, slot) in slots.own.iter().enumerate() {
        let c = c64::new(coefficients[2 * h + 1], -coefficients[2 * h + 2]) * 0.5;
        put(spectrum, *slot, c);
        if let Some(mirror) = slots.mirror[h] {
            put(spectrum, mirror, c.conj());
        }
    }
    grid.synthesise(spectrum, samples);
}

/// Coefficients of the same motion seen a little later: every term turned by its phase.
fn rotated(u: &[f64], turn: &[c64]) -> Vec<f64> {
    let mut out = u.to_vec();
    for (h, t) in turn.iter().enumerate() {
        let c = c64::new(u[2 * h + 1], -u[2 * h + 2]) * t;
        (out[2 * h + 1], out[2 * h + 2]) = (c.re, -c.im);
    }
    out
}

fn collect(slots: &Slots, spectrum: &[c64], coefficients: &mut [f64]) {
    coefficients[0] = spectrum[0].re;
    for (h, slot) in slots.own.iter().enumerate() {
        let c = at(spectrum, *slot);
        coefficients[2 * h + 1] = 2.0 * c.re;
        coefficients[2 * h + 2] = -2.0 * c.im;
    }
}

/// Coefficients of du/dt for term frequencies w: (w b, -w a).
pub fn derivative(u: &[f64], w: &[f64], rate: &mut [f64]) {
    rate[0] = 0.0;
    for (h, w) in w.iter().enumerate() {
        rate[2 * h + 1] = w * u[2 * h + 2];
        rate[2 * h + 2] = -w * u[2 * h + 1];
    }
}

/// The coefficients k_j - k_h and k_j + k_h of a function that was sampled.
fn sampled<'a>(slots: &'a Slots, spectrum: &'a [c64]) -> impl Fn(usize, usize) -> (c64, c64) + 'a {
    let n = slots.own.len() + 1;
    move |j, h| (at(spectrum, slots.minus[j * n + h]), at(spectrum, slots.plus[j * n + h]))
}

/// Matrix of the product with a function, in the real coefficients: `pair` has its coefficients k_j - k_h and k_j + k_h.
fn product_matrix(pair: impl Fn(usize, usize) -> (c64, c64), n_c: usize, out: &mut [f64]) {
    let n = n_c.div_ceil(2);
    for j in 0..n {
        for h in 0..n {
            let (minus, plus) = pair(j, h);
            let (sum, difference) = (minus + plus, minus - plus);
            let scale = if j == 0 { 0.5 } else { 1.0 };
            let cos_row = (2 * j).saturating_sub(1) * n_c;
            let cos = (2 * h).saturating_sub(1);
            out[cos_row + cos] = scale * sum.re;
            if h > 0 {
                out[cos_row + 2 * h] = scale * difference.im;
            }
            if j > 0 {
                let sin_row = 2 * j * n_c;
                out[sin_row + cos] = -sum.im;
                if h > 0 {
                    out[sin_row + 2 * h] = difference.re;
                }
            }
        }
    }
}

#[cfg(test)]
mod tests;
