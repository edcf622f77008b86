//! Time response of a linear system, exact for loads that are linear between the given times.
//!
//! x' = A x + B u with the motion of the outputs C x. Over one step h, with u linear, the exact solution is
//! x_{k+1} = e^{hA} x_k + h [(phi_1 - phi_2) B u_k + phi_2 B u_{k+1}]; a parabola of height b over the step adds
//! h (4 phi_2 - 8 phi_3) B b, which is how the interpolation error of a smooth load travels through the system.
use std::collections::BTreeMap;

use faer::Mat;

use super::expansion::{ComplexModes, Expansion, RealModes};
use super::history::History;
use super::linear_system::LinearSystem;
use super::ports::Ports;
use super::state::{StateSpace, initial, massless};
use crate::error::{Error, Result};
use crate::linalg::expm::phi_products;
use crate::linalg::quadratic::NormalForm;
use crate::run::{Cancel, Counts};

/// Small systems take one dense propagator: nothing is faster, and nothing is more robust.
const DENSE_STATES: usize = 60;

/// One uncoupled part of the system.
#[derive(Debug, Clone)]
pub struct Block {
    pub a: Mat<f64>,
    pub b: Mat<f64>,
    pub x0: Vec<f64>,
    /// displacement, velocity and acceleration of the outputs: C, C A, C A^2
    pub c: [Mat<f64>; 3],
}

/// Uncoupled blocks, and per output derivative q the matrices that multiply u, u', u'' directly.
pub struct Linear {
    pub blocks: Vec<Block>,
    pub direct: [Vec<Mat<f64>>; 3],
    pub n_out: usize,
    pub route: &'static str,
    counts: Counts,
}

pub struct Motion {
    /// displacement, velocity, acceleration: (n_out, n_t)
    pub y: [Mat<f64>; 3],
    /// what the bulges add to them
    pub error: [Mat<f64>; 3],
    pub counts: Counts,
}

/// The exact solution over one step, row-major.
pub struct Propagator {
    size: usize,
    inputs: usize,
    e: Vec<f64>,
    start: Vec<f64>,
    end: Vec<f64>,
    bulge: Vec<f64>,
}

impl Linear {
    /// The cheapest uncoupled form: real modes, complex modes where their vectors are well conditioned, else one dense block.
    pub fn new(system: &LinearSystem, ports: &Ports, x0: &[f64], v0: &[f64]) -> Result<Self> {
        let n = system.quadratic().n();
        ports.check(n)?;
        check_state(n, x0, v0)?;
        let Some(form) = system.normal() else {
            return Err(massless(system.quadratic()));
        };
        let mut counts = Counts::default();
        let direct = StateSpace::new(form, ports).direct(&ports.order_in, ports.d0.as_ref());
        let (blocks, route) = if let Expansion::Real(modes) = system.expansion(&mut counts) {
            (real_blocks(system, modes, ports, x0, v0), "real modes")
        } else {
            let modes = if 2 * n > DENSE_STATES { system.trusted_modes(ports, &mut counts) } else { None };
            match modes {
                Some(modes) => (complex_blocks(form, modes, ports, x0, v0), "complex modes"),
                None => (vec![dense_block(form, ports, x0, v0)], "exponential"),
            }
        };
        Ok(Linear { blocks, direct, n_out: ports.l.nrows(), route, counts })
    }

    pub fn run(&self, history: &History, cancel: &Cancel) -> Result<Motion> {
        let n_in = self.blocks.first().map_or(0, |b| b.b.ncols());
        history.check(n_in)?;
        let n_t = history.t.len();
        let (index, values) = history.steps();
        let mut counts = self.counts.clone();
        let mut y: [Mat<f64>; 3] = std::array::from_fn(|_| Mat::zeros(self.n_out, n_t));
        let mut error = y.clone();
        add_direct(&self.direct, &mut y, history);
        // direct terms carry bulges only between the times, so the error starts at zero
        for block in &self.blocks {
            let mut cache = BTreeMap::new();
            for (which, h) in values.iter().enumerate() {
                cancel.check()?;
                counts.add("propagators", 1);
                cache.insert(which, Propagator::new(block, *h)?);
            }
            block.propagate(history, &index, &cache, &mut y, &mut error, cancel)?;
        }
        counts.add("steps", (n_t - 1) as u64);
        counts.add("blocks", self.blocks.len() as u64);
        Ok(Motion { y, error, counts })
    }
}

/// What outputs see of the loads themselves.
pub fn add_direct(direct: &[Vec<Mat<f64>>; 3], y: &mut [Mat<f64>; 3], history: &History) {
    for (y, terms) in y.iter_mut().zip(direct) {
        for (order, term) in terms.iter().enumerate() {
            if term.norm_max() > 0.0 {
                *y += term * history.derivative(order);
            }
        }
    }
}

impl Propagator {
    fn new(block: &Block, h: f64) -> Result<Self> {
        let k = block.a.nrows();
        let scaled = Mat::from_fn(k, k, |i, j| h * block.a[(i, j)]);
        let (e, phi) = phi_products(scaled.as_ref(), block.b.as_ref())?;
        Ok(Self::from_functions(&e, &phi, h))
    }

    /// From e^{hA} and phi_k(hA) B, or from their derivatives.
    pub fn from_functions(e: &Mat<f64>, phi: &[Mat<f64>; 3], h: f64) -> Self {
        let (k, w) = (e.nrows(), phi[0].ncols());
        let [p1, p2, p3] = phi;
        let rows = |cols: usize, value: &dyn Fn(usize, usize) -> f64| {
            let places = (0..k).flat_map(|i| (0..cols).map(move |j| (i, j)));
            places.map(|(i, j)| value(i, j)).collect()
        };
        Propagator {
            size: k,
            inputs: w,
            e: rows(k, &|i, j| e[(i, j)]),
            start: rows(w, &|i, j| h * (p1[(i, j)] - p2[(i, j)])),
            end: rows(w, &|i, j| h * p2[(i, j)]),
            bulge: rows(w, &|i, j| h * (4.0 * p2[(i, j)] - 8.0 * p3[(i, j)])),
        }
    }

    /// The state after a step, with the load going from u to next.
    pub fn advance(&self, x: &[f64], u: &[f64], next: &[f64]) -> Vec<f64> {
        let (k, w) = (self.size, self.inputs);
        let row = |i: usize| {
            dot(&self.e[i * k..(i + 1) * k], x)
                + dot(&self.start[i * w..(i + 1) * w], u)
                + dot(&self.end[i * w..(i + 1) * w], next)
        };
        (0..k).map(row).collect()
    }

    /// What deviations e of the state and bulges b of the load have become after a step.
    pub fn advance_error(&self, e: &[f64], b: &[f64]) -> Vec<f64> {
        let (k, w) = (self.size, self.inputs);
        let row = |i: usize| dot(&self.e[i * k..(i + 1) * k], e) + dot(&self.bulge[i * w..(i + 1) * w], b);
        (0..k).map(row).collect()
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}

impl Block {
    fn propagate(
        &self,
        history: &History,
        index: &[usize],
        cache: &BTreeMap<usize, Propagator>,
        y: &mut [Mat<f64>; 3],
        error: &mut [Mat<f64>; 3],
        cancel: &Cancel,
    ) -> Result<()> {
        let mut x = self.x0.clone();
        let mut e = vec![0.0; x.len()];
        let bulging = history.bulge.norm_max() > 0.0;
        add_outputs(&self.c, &x, y, 0);
        for (step, which) in index.iter().enumerate() {
            if step % 256 == 0 {
                cancel.check()?;
            }
            let Some(p) = cache.get(which) else { continue };
            x = p.advance(&x, &column(&history.u, step), &column(&history.u, step + 1));
            add_outputs(&self.c, &x, y, step + 1);
            if bulging {
                e = p.advance_error(&e, &column(&history.bulge, step));
                add_outputs(&self.c, &e, error, step + 1);
            }
        }
        Ok(())
    }
}

pub fn column(m: &Mat<f64>, j: usize) -> Vec<f64> {
    (0..m.nrows()).map(|i| m[(i, j)]).collect()
}

pub fn add_outputs(c: &[Mat<f64>; 3], x: &[f64], y: &mut [Mat<f64>; 3], column: usize) {
    for (c, y) in c.iter().zip(y.iter_mut()) {
        for i in 0..c.nrows() {
            let mut sum = 0.0;
            for (j, xj) in x.iter().enumerate() {
                sum += c[(i, j)] * xj;
            }
            y[(i, column)] += sum;
        }
    }
}

pub fn check_state(n: usize, x0: &[f64], v0: &[f64]) -> Result<()> {
    for (name, v) in [("x0", x0), ("v0", v0)] {
        if v.len() != n {
            return Err(Error::model(format!("{name} has {} entries, the system has {n} coordinates", v.len())));
        }
        if v.iter().any(|a| !a.is_finite()) {
            return Err(Error::model(format!("{name} contains NaN or infinite entries")));
        }
    }
    Ok(())
}

fn dense_block(form: &NormalForm, ports: &Ports, x0: &[f64], v0: &[f64]) -> Block {
    let state = StateSpace::new(form, ports);
    let start = initial(form, x0, v0);
    Block {
        b: state.driven(&ports.order_in),
        c: state.outputs(),
        x0: (0..start.nrows()).map(|i| start[(i, 0)]).collect(),
        a: state.a,
    }
}

fn real_blocks(system: &LinearSystem, modes: &RealModes, ports: &Ports, x0: &[f64], v0: &[f64]) -> Vec<Block> {
    let n = x0.len();
    let seen = &ports.l * &modes.shape;
    let driven = modes.shape.transpose() * &ports.f;
    let state = Mat::from_fn(n, 2, |i, k| if k == 0 { x0[i] } else { v0[i] });
    let start = modes.shape.transpose() * (&system.quadratic().m * state);
    (0..n)
        .map(|r| {
            let (lambda, c) = (modes.lambda[r], modes.damping[r]);
            let rate = lambda.abs().sqrt().max(c.abs());
            let rate = if rate > 0.0 { rate } else { 1.0 };
            let space = StateSpace {
                a: Mat::from_fn(2, 2, |i, j| [[0.0, rate], [-lambda / rate, -c]][i][j]),
                b: Mat::from_fn(2, driven.ncols(), |i, j| if i == 0 { 0.0 } else { driven[(r, j)] / rate }),
                c: Mat::from_fn(seen.nrows(), 2, |i, j| if j == 0 { seen[(i, r)] } else { 0.0 }),
            };
            Block {
                b: space.driven(&ports.order_in),
                c: space.outputs(),
                x0: vec![start[(r, 0)], start[(r, 1)] / rate],
                a: space.a,
            }
        })
        .collect()
}

/// A conjugate pair xi, conj(xi) with xi' = s xi + beta u becomes the real pair (Re xi, Im xi); the outputs take twice the real part.
fn complex_blocks(form: &NormalForm, modes: &ComplexModes, ports: &Ports, x0: &[f64], v0: &[f64]) -> Vec<Block> {
    let space = StateSpace::new(form, ports);
    let driven = modes.coordinates(space.driven(&ports.order_in).as_ref());
    let start = modes.coordinates(initial(form, x0, v0).as_ref());
    let seen = modes.outputs(space.c.as_ref());
    let mut blocks = Vec::new();
    for (r, s) in modes.pole.iter().enumerate() {
        if s.im < 0.0 {
            continue;
        }
        let size = if s.im > 0.0 { 2 } else { 1 };
        let twice = size as f64;
        let part = |z: faer::c64, i: usize| if i == 0 { z.re } else { z.im };
        let c =
            Mat::from_fn(seen.nrows(), size, |i, j| twice * if j == 0 { seen[(i, r)].re } else { -seen[(i, r)].im });
        let block = StateSpace {
            a: Mat::from_fn(size, size, |i, j| [[s.re, -s.im], [s.im, s.re]][i][j]),
            b: Mat::from_fn(size, driven.ncols(), |i, j| part(driven[(r, j)], i)),
            c,
        };
        blocks.push(Block {
            c: block.outputs(),
            x0: (0..size).map(|i| part(start[(r, 0)], i)).collect(),
            a: block.a,
            b: block.b,
        });
    }
    blocks
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::second_order::linear_system::Matrices;

    #[test]
    fn ramp_on_an_oscillator_is_exact_in_one_step() {
        let one = |v: f64| Mat::from_fn(1, 1, |_, _| v);
        let system = LinearSystem::new(Matrices { m: one(2.0), c: None, g: None, k: one(8.0), n: None }).unwrap();
        let ports = Ports { l: one(1.0), f: one(1.0), order_in: vec![0], order_out: 0, d0: None };
        let history =
            History { t: vec![0.0, 1.3], u: Mat::from_fn(1, 2, |_, j| 1.3 * j as f64), bulge: Mat::zeros(1, 1) };
        let linear = Linear::new(&system, &ports, &[0.0], &[0.0]).unwrap();
        let motion = linear.run(&history, &Cancel::default()).unwrap();
        // 2 y'' + 8 y = t: y = (t - sin(2 t) / 2) / 8
        let expected = (1.3 - (2.6_f64).sin() / 2.0) / 8.0;
        assert!((motion.y[0][(0, 1)] - expected).abs() < 1e-15);
    }
}
