//! Samples on a torus and their Fourier coefficients: one dimension per base frequency, real data, half a spectrum.
use std::sync::Arc;

use num_complex::Complex64 as c64;
use realfft::{ComplexToReal, RealFftPlanner, RealToComplex};

/// Where a Fourier coefficient lies in the half spectrum; negative: the complex conjugate of what lies at `!slot`.
pub type Slot = i32;

/// Sizes, plans and scratch. Samples are stored with the last dimension fastest, spectra likewise with n_last/2 + 1 columns.
pub struct Grid {
    dims: Vec<usize>,
    half: usize,
    forward: Arc<dyn RealToComplex<f64>>,
    inverse: Arc<dyn ComplexToReal<f64>>,
    axes: Vec<Axis>,
    scratch: Vec<c64>,
    rows: Vec<f64>,
    half_row: Vec<c64>,
}

/// Complex transform of a leading dimension, made of two real ones.
struct Axis {
    n: usize,
    stride: usize,
    plan: Arc<dyn RealToComplex<f64>>,
    re: Vec<f64>,
    im: Vec<f64>,
    re_hat: Vec<c64>,
    im_hat: Vec<c64>,
    scratch: Vec<c64>,
}

impl Grid {
    pub fn new(dims: &[usize]) -> Grid {
        let mut planner = RealFftPlanner::<f64>::new();
        let last = dims[dims.len() - 1];
        let half = last / 2 + 1;
        let forward = planner.plan_fft_forward(last);
        let inverse = planner.plan_fft_inverse(last);
        let length = forward.get_scratch_len().max(inverse.get_scratch_len());
        let mut axes = Vec::new();
        let mut stride = half;
        for &n in dims[..dims.len() - 1].iter().rev() {
            let plan = planner.plan_fft_forward(n);
            axes.push(Axis {
                n,
                stride,
                re: vec![0.0; n],
                im: vec![0.0; n],
                re_hat: plan.make_output_vec(),
                im_hat: plan.make_output_vec(),
                scratch: plan.make_scratch_vec(),
                plan,
            });
            stride *= n;
        }
        Grid {
            dims: dims.to_vec(),
            half,
            forward,
            inverse,
            axes,
            scratch: vec![c64::new(0.0, 0.0); length],
            rows: vec![0.0; last],
            half_row: vec![c64::new(0.0, 0.0); half],
        }
    }

    pub fn dims(&self) -> &[usize] {
        &self.dims
    }

    pub fn n_samples(&self) -> usize {
        self.dims.iter().product()
    }

    pub fn spectrum_len(&self) -> usize {
        self.n_samples() / self.dims[self.dims.len() - 1] * self.half
    }

    /// Slot of the coefficient with this index vector, aliased onto the grid.
    pub fn slot(&self, index: &[i32]) -> Slot {
        let last = self.dims.len() - 1;
        let wrap = |k: i32, n: usize| k.rem_euclid(n as i32) as usize;
        let conjugate = wrap(index[last], self.dims[last]) > self.dims[last] / 2;
        let sign = if conjugate { -1 } else { 1 };
        let mut at = 0;
        for (k, &n) in index[..last].iter().zip(&self.dims) {
            at = at * n + wrap(sign * k, n);
        }
        let at = (at * self.half + wrap(sign * index[last], self.dims[last])) as Slot;
        if conjugate { !at } else { at }
    }

    /// c_k = mean of samples exp(-i k.tau)
    pub fn analyse(&mut self, samples: &[f64], spectrum: &mut [c64]) {
        let n = self.rows.len();
        let scale = 1.0 / samples.len() as f64;
        for (row, out) in samples.chunks_exact(n).zip(spectrum.chunks_exact_mut(self.half)) {
            self.rows.copy_from_slice(row);
            // lengths match by construction, the only thing that realfft checks here
            let _ = self.forward.process_with_scratch(&mut self.rows, out, &mut self.scratch);
            for c in out.iter_mut() {
                *c *= scale;
            }
        }
        for axis in &mut self.axes {
            axis.transform(spectrum, false);
        }
    }

    /// samples = sum over all k (both signs) of c_k exp(i k.tau); the spectrum is used up.
    pub fn synthesise(&mut self, spectrum: &mut [c64], samples: &mut [f64]) {
        for axis in self.axes.iter_mut().rev() {
            axis.transform(spectrum, true);
        }
        let n = self.rows.len();
        for (row, out) in spectrum.chunks_exact(self.half).zip(samples.chunks_exact_mut(n)) {
            self.half_row.copy_from_slice(row);
            // rounding may leave imaginary parts where a real series has none, and realfft then refuses
            self.half_row[0].im = 0.0;
            if n.is_multiple_of(2) {
                self.half_row[self.half - 1].im = 0.0;
            }
            let _ = self.inverse.process_with_scratch(&mut self.half_row, out, &mut self.scratch);
        }
    }
}

impl Axis {
    fn transform(&mut self, data: &mut [c64], inverse: bool) {
        let sign = if inverse { -1.0 } else { 1.0 };
        let n = self.n;
        for block in data.chunks_exact_mut(self.stride * n) {
            for column in 0..self.stride {
                for i in 0..n {
                    let c = block[i * self.stride + column];
                    self.re[i] = c.re;
                    self.im[i] = sign * c.im;
                }
                let _ = self.plan.process_with_scratch(&mut self.re, &mut self.re_hat, &mut self.scratch);
                let _ = self.plan.process_with_scratch(&mut self.im, &mut self.im_hat, &mut self.scratch);
                for i in 0..n {
                    let (r, m) = if i <= n / 2 {
                        (self.re_hat[i], self.im_hat[i])
                    } else {
                        (self.re_hat[n - i].conj(), self.im_hat[n - i].conj())
                    };
                    block[i * self.stride + column] = c64::new(r.re - m.im, sign * (r.im + m.re));
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_dimensions_against_the_sum() {
        let mut grid = Grid::new(&[7, 6]);
        let mut spectrum = vec![c64::new(0.0, 0.0); grid.spectrum_len()];
        let terms = [([2, -1], 0.3, -0.7), ([0, 2], 1.1, 0.4), ([1, 0], -0.2, 0.9), ([3, 1], 0.5, 0.25)];
        let value = |t: [f64; 2]| -> f64 {
            terms
                .iter()
                .map(|(k, a, b)| {
                    let phase = f64::from(k[0]) * t[0] + f64::from(k[1]) * t[1];
                    a * phase.cos() + b * phase.sin()
                })
                .sum()
        };
        let step = std::f64::consts::TAU;
        let mut samples: Vec<f64> =
            (0..42).map(|i| value([step * f64::from(i / 6) / 7.0, step * f64::from(i % 6) / 6.0])).collect();
        let original = samples.clone();
        grid.analyse(&samples, &mut spectrum);
        for (k, a, b) in terms {
            let slot = grid.slot(&k);
            let c = if slot < 0 { spectrum[!slot as usize].conj() } else { spectrum[slot as usize] };
            assert!((c - c64::new(a / 2.0, -b / 2.0)).norm() < 1e-14, "{k:?} {c}");
        }
        grid.synthesise(&mut spectrum, &mut samples);
        assert!(samples.iter().zip(&original).all(|(a, b)| (a - b).abs() < 1e-14));
    }
}
