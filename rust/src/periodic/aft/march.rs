//! Tables of laws with memory, whose samples carry the derivatives by all coefficients along.
use num_dual::Dual64;

use crate::force::AnyLaw;
use crate::periodic::basis::Basis;

/// Tables of the march of laws with memory (periodic motion only).
pub struct March {
    /// basis functions at the samples, n_samples x n_c by rows
    pub gamma: Vec<f64>,
    /// d samples / d coefficients, one contiguous column of samples each
    pub columns: Vec<f64>,
}

impl March {
    pub fn new(basis: &Basis, n: usize) -> March {
        let n_c = basis.n_coefficients();
        let mut gamma = vec![1.0; n * n_c];
        for j in 0..n {
            for (h, k) in basis.indices.iter().enumerate() {
                let phase = std::f64::consts::TAU * f64::from(k[0]) * j as f64 / n as f64;
                gamma[j * n_c + 2 * h + 1] = phase.cos();
                gamma[j * n_c + 2 * h + 2] = phase.sin();
            }
        }
        March { gamma, columns: vec![0.0; n * n_c] }
    }

    /// u and v at the samples by one coefficient.
    pub fn motion(&self, c: usize, frequency: &[f64], n_c: usize, (u, v): (&mut [f64], &mut [f64])) {
        for (j, u) in u.iter_mut().enumerate() {
            *u = self.gamma[j * n_c + c];
        }
        // cos' = -w sin, sin' = w cos
        let (other, factor) = match c {
            0 => (0, 0.0),
            c if c % 2 == 1 => (c + 1, -frequency[c / 2]),
            c => (c - 1, frequency[c / 2 - 1]),
        };
        for (j, v) in v.iter_mut().enumerate() {
            *v = factor * self.gamma[j * n_c + other];
        }
    }

    /// One memory over two periods from its start; adds force and columns of the second one.
    pub fn slider(&mut self, law: AnyLaw, (p, start): (&[f64], f64), u: &[f64], f: &mut [f64], n_c: usize) {
        let n = u.len();
        let pd: Vec<Dual64> = p.iter().map(|&x| Dual64::from(x)).collect();
        let (mut z, mut dz) = (start, vec![0.0; n_c]);
        for step in 0..2 * n {
            let j = step % n;
            let mut new = [Dual64::from(0.0)];
            let by_u = law.force(Dual64::new(u[j], 1.0), Dual64::from(0.0), &pd, &[Dual64::from(z)], &mut new);
            let z_u = new[0];
            let by_z = law.force(Dual64::from(u[j]), Dual64::from(0.0), &pd, &[Dual64::new(z, 1.0)], &mut new);
            let z_z = new[0].eps;
            let gamma = &self.gamma[j * n_c..][..n_c];
            if step >= n {
                f[j] += by_u.re;
                for c in 0..n_c {
                    self.columns[c * n + j] += by_u.eps * gamma[c] + by_z.eps * dz[c];
                }
            }
            if z_u.eps != 0.0 || z_z != 1.0 {
                for c in 0..n_c {
                    dz[c] = z_u.eps * gamma[c] + z_z * dz[c];
                }
            }
            z = z_u.re;
        }
    }
}
