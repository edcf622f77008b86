//! Exact condensation by all modes of the local coordinates with the retained ones held: S is a sum over modes, O(n) per entry.
//!
//! With Phi^T M_ll Phi = 1, Phi^T K_ll Phi = diag(lambda), Phi^T C_ll Phi = diag(c) the inverse of Z_ll is
//! sum_k phi_k phi_k^T / (lambda_k - w^2 + i w c_k); nothing is truncated.
use std::sync::Arc;

use faer::Mat;
use num_complex::Complex64 as c64;

use super::linear::{Block, DynamicStiffness, Forces, Matrices, reordered};
use crate::error::{Error, Result};

/// Symmetric matrices in modal coordinates; made once, shared by all copies.
pub struct Modes {
    pub n: usize,
    pub retained: Vec<usize>,
    pub local: Vec<usize>,
    /// mass, damping and stiffness of the retained coordinates, n_r x n_r by rows
    pub rr: [Vec<f64>; 3],
    /// Phi^T X_lr for the same three, n_l x n_r by rows
    pub lr: [Vec<f64>; 3],
    pub stiffness: Vec<f64>,
    pub damping: Vec<f64>,
    /// n_l x n_l
    pub shape: Mat<f64>,
    pub forces: Forces,
    /// M, C, K of all coordinates, kept for stability where the system is small
    pub matrices: Option<Matrices>,
    /// Phi^T f_l per term
    pub modal_forces: Vec<Option<Vec<c64>>>,
}

#[derive(Clone)]
pub struct Modal(pub Arc<Modes>);

impl Modes {
    pub fn project_forces(&mut self) {
        let project = |f: &Vec<c64>| -> Vec<c64> {
            let column = |k: usize| self.local.iter().enumerate().map(|(l, old)| f[*old] * self.shape[(l, k)]).sum();
            (0..self.local.len()).map(column).collect()
        };
        // a force on retained coordinates alone does not move the modes
        let moves = |f: &&Vec<c64>| self.local.iter().any(|old| f[*old] != c64::new(0.0, 0.0));
        self.modal_forces = self.forces.iter().map(|f| f.as_ref().filter(moves).map(project)).collect();
    }

    /// Sums of the absolute terms of S, given what the pole of a mode is uncertain in proportion to.
    fn sizes(&self, w: f64, uncertain: impl Fn(usize) -> f64, out: &mut [f64]) {
        let n_r = self.retained.len();
        let size = |parts: &[Vec<f64>; 3], at: usize| {
            parts[2][at].abs() + w * w * parts[0][at].abs() + (w * parts[1][at]).abs()
        };
        for (at, out) in out.iter_mut().enumerate() {
            let (i, j) = (at / n_r, at % n_r);
            let mode = |k: usize| {
                let pole = self.pole(k, w).norm();
                let growth = 1.0 + (uncertain(k) + w * w) / pole;
                size(&self.lr, k * n_r + i) * size(&self.lr, k * n_r + j) / pole * growth
            };
            *out = size(&self.rr, at) + (0..self.local.len()).map(mode).sum::<f64>();
        }
    }

    fn pole(&self, k: usize, w: f64) -> c64 {
        c64::new(self.stiffness[k] - w * w, w * self.damping[k])
    }

    /// S and dS/dw that the modes add to a single retained coordinate: the hot loop of large systems with one element, in lanes so
    /// that the compiler may use vector instructions.
    fn add_single(&self, w: f64, s: &mut c64, slope: &mut c64) {
        const LANES: usize = 4;
        let [m, c, k] = &self.lr;
        let mut sums = [[0.0; LANES]; 4];
        let whole = self.stiffness.len() / LANES * LANES;
        for start in (0..whole).step_by(LANES) {
            let part = start..start + LANES;
            let (m, c, k) = (&m[part.clone()], &c[part.clone()], &k[part.clone()]);
            let (lambda, d) = (&self.stiffness[part.clone()], &self.damping[part]);
            for l in 0..LANES {
                let added = single_mode(w, m[l], c[l], k[l], lambda[l], d[l]);
                for (sum, a) in sums.iter_mut().zip(added) {
                    sum[l] += a;
                }
            }
        }
        let mut total = sums.map(|lanes| lanes.iter().sum::<f64>());
        for i in whole..self.stiffness.len() {
            let added = single_mode(w, m[i], c[i], k[i], self.stiffness[i], self.damping[i]);
            for (sum, a) in total.iter_mut().zip(added) {
                *sum += a;
            }
        }
        *s += c64::new(total[0], total[1]);
        *slope += c64::new(total[2], total[3]);
    }
}

/// z q and 2 z' q + q^2 p' of one mode, as real and imaginary parts; q = -z / p.
#[inline(always)]
fn single_mode(w: f64, m: f64, c: f64, k: f64, lambda: f64, d: f64) -> [f64; 4] {
    let (z_re, z_im) = (k - w * w * m, w * c);
    let (p_re, p_im) = (lambda - w * w, w * d);
    let inverse = -1.0 / (p_re * p_re + p_im * p_im);
    let q_re = (z_re * p_re + z_im * p_im) * inverse;
    let q_im = (z_im * p_re - z_re * p_im) * inverse;
    let (dz_re, dz_im) = (-4.0 * w * m, 2.0 * c);
    let (qq_re, qq_im) = (q_re * q_re - q_im * q_im, 2.0 * q_re * q_im);
    let dp_re = -2.0 * w;
    [
        z_re * q_re - z_im * q_im,
        z_re * q_im + z_im * q_re,
        dz_re * q_re - dz_im * q_im + qq_re * dp_re - qq_im * d,
        dz_re * q_im + dz_im * q_re + qq_re * d + qq_im * dp_re,
    ]
}

fn finite(block: &Block, w: f64) -> Result<()> {
    if block.s.iter().all(|x| x.re.is_finite() && x.im.is_finite()) {
        Ok(())
    } else {
        Err(Error::singular(format!("the condensed coordinates are in undamped resonance at {w} rad/s")))
    }
}

fn z(parts: &[Vec<f64>; 3], at: usize, w: f64) -> c64 {
    c64::new(parts[2][at] - w * w * parts[0][at], w * parts[1][at])
}

fn z_slope(parts: &[Vec<f64>; 3], at: usize, w: f64) -> c64 {
    c64::new(-2.0 * w * parts[0][at], parts[1][at])
}

impl DynamicStiffness for Modal {
    fn size(&self) -> usize {
        self.0.retained.len()
    }

    fn full_size(&self) -> usize {
        self.0.n
    }

    fn evaluate(&mut self, w: f64, term: usize, block: &mut Block) -> Result<()> {
        let modes = &self.0;
        let n_r = modes.retained.len();
        for at in 0..n_r * n_r {
            block.s[at] = z(&modes.rr, at, w);
            block.s_slope[at] = z_slope(&modes.rr, at, w);
        }
        let force = modes.forces.get(term).and_then(Option::as_ref);
        let modal = modes.modal_forces.get(term).and_then(Option::as_ref);
        for i in 0..n_r {
            block.force[i] = force.map_or(c64::new(0.0, 0.0), |f| f[modes.retained[i]]);
            block.force_slope[i] = c64::new(0.0, 0.0);
        }
        if n_r == 1 && modal.is_none() {
            modes.add_single(w, &mut block.s[0], &mut block.s_slope[0]);
            return finite(block, w);
        }
        let mut coupling = vec![(c64::new(0.0, 0.0), c64::new(0.0, 0.0)); n_r];
        for k in 0..modes.local.len() {
            let inverse = modes.pole(k, w).inv();
            let pole_slope = c64::new(-2.0 * w, modes.damping[k]);
            for (j, c) in coupling.iter_mut().enumerate() {
                let at = k * n_r + j;
                // participation q = -z / pole and its slope
                let q = -z(&modes.lr, at, w) * inverse;
                *c = (q, -(z_slope(&modes.lr, at, w) + q * pole_slope) * inverse);
            }
            for i in 0..n_r {
                let (z_i, dz_i) = (z(&modes.lr, k * n_r + i, w), z_slope(&modes.lr, k * n_r + i, w));
                for (j, (q, dq)) in coupling.iter().enumerate() {
                    block.s[i * n_r + j] += z_i * q;
                    block.s_slope[i * n_r + j] += dz_i * q + z_i * dq;
                }
                if let Some(f) = modal {
                    block.force[i] += coupling[i].0 * f[k];
                    block.force_slope[i] += coupling[i].1 * f[k];
                }
            }
        }
        finite(block, w)
    }

    fn sizes(&self, w: f64, out: &mut [f64]) {
        self.0.sizes(w, |k| self.0.stiffness[k].abs(), out);
    }

    /// Squares of natural frequencies are found to eps times the largest one.
    fn uncertain_sizes(&self, w: f64, out: &mut [f64]) {
        let largest = self.0.stiffness.iter().fold(0.0_f64, |a, k| a.max(k.abs()));
        self.0.sizes(w, |_| largest, out);
    }

    fn expand(&mut self, w: f64, term: usize, factor: f64, y: &[c64], x: &mut [c64]) -> Result<()> {
        let modes = &self.0;
        let n_r = modes.retained.len();
        for (i, old) in modes.retained.iter().enumerate() {
            x[*old] = y[i];
        }
        let modal = modes.modal_forces.get(term).and_then(Option::as_ref);
        let mut amplitude = Mat::<f64>::zeros(modes.local.len(), 2);
        for k in 0..modes.local.len() {
            let mut q = modal.map_or(c64::new(0.0, 0.0), |f| f[k] * factor);
            for (j, y) in y.iter().enumerate() {
                q -= z(&modes.lr, k * n_r + j, w) * y;
            }
            q /= modes.pole(k, w);
            (amplitude[(k, 0)], amplitude[(k, 1)]) = (q.re, q.im);
        }
        let motion = &modes.shape * amplitude;
        for (l, old) in modes.local.iter().enumerate() {
            x[*old] = c64::new(motion[(l, 0)], motion[(l, 1)]);
        }
        Ok(())
    }

    fn retained(&self) -> Vec<usize> {
        self.0.retained.clone()
    }

    fn matrices(&self) -> Option<Matrices> {
        let order = [self.0.retained.as_slice(), &self.0.local].concat();
        let (m, c, k) = self.0.matrices.as_ref()?;
        Some((reordered(m, &order), reordered(c, &order), reordered(k, &order)))
    }

    fn restrict(&self, x: &[f64], y: &mut [f64]) {
        for (y, old) in y.iter_mut().zip(&self.0.retained) {
            *y = x[*old];
        }
    }

    fn copied(&self) -> Result<Box<dyn DynamicStiffness>> {
        Ok(Box::new(self.clone()))
    }

    fn retain(&self, direction: &[(usize, f64)]) -> Result<Vec<(usize, f64)>> {
        let one = |&(i, w): &(usize, f64)| match self.0.retained.binary_search(&i) {
            Ok(at) => Ok((at, w)),
            Err(_) => Err(Error::model(format!("an element acts on coordinate {i}, which is condensed"))),
        };
        direction.iter().map(one).collect()
    }
}
