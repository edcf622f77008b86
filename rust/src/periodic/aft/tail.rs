//! Forces in the terms that samples resolve beyond those of a basis: what an error estimate asks for.
use std::collections::HashSet;

use num_complex::Complex64 as c64;

use crate::periodic::basis::Basis;
use crate::periodic::ramps::Ramp;

#[derive(Default)]
pub struct Tail {
    /// where the terms lie in the half spectrum
    places: Vec<usize>,
    /// of periodic motions their numbers
    terms: Vec<i32>,
    /// amplitudes a - i b per coordinate of the last law and term
    pub force: Vec<c64>,
}

impl Tail {
    /// The terms below half of the samples in every dimension, one of each pair +-k, with their index vectors.
    pub fn new(basis: &Basis, dims: &[usize]) -> (Tail, Vec<Vec<i32>>) {
        let known: HashSet<Vec<i32>> =
            basis.indices.iter().flat_map(|k| [k.clone(), k.iter().map(|k| -k).collect()]).collect();
        let last = dims.len() - 1;
        let half = dims[last] / 2 + 1;
        let size = dims[..last].iter().product::<usize>() * half;
        let index = |place: usize| -> Option<Vec<i32>> {
            let mut k = vec![(place % half) as i32; dims.len()];
            let mut rest = place / half;
            for (k, n) in k[..last].iter_mut().zip(dims).rev() {
                let i = rest % n;
                *k = if i > n / 2 { i as i32 - *n as i32 } else { i as i32 };
                rest /= n;
            }
            let resolved = k.iter().zip(dims).all(|(k, n)| 2 * k.unsigned_abs() as usize != *n);
            let first = if k[last] > 0 { 1 } else { k.iter().copied().find(|k| *k != 0)? };
            (resolved && first > 0 && !known.contains(&k)).then_some(k)
        };
        let (places, indices): (Vec<usize>, Vec<Vec<i32>>) =
            (0..size).filter_map(|place| index(place).map(|k| (place, k))).unzip();
        let terms = if last == 0 { indices.iter().map(|k| k[0]).collect() } else { Vec::new() };
        (Tail { places, terms, force: Vec::new() }, indices)
    }

    pub fn len(&self) -> usize {
        self.places.len()
    }

    /// The largest term of a periodic motion.
    pub fn top(&self) -> usize {
        self.terms.last().map_or(0, |k| *k as usize)
    }

    /// The force on one more coordinate of a law.
    pub fn collect(&mut self, spectrum: &[c64]) {
        self.force.extend(self.places.iter().map(|place| 2.0 * spectrum[*place]));
    }

    /// The force slope (u - at) chi, given the coefficients of chi, where u has these terms and coefficients.
    pub fn add_ramp(&mut self, ramp: &Ramp, chi: impl Fn(i32) -> c64, terms: &[i32], u: &[f64]) {
        for (k, force) in self.terms.iter().zip(&mut self.force) {
            let mut sum = 2.0 * (u[0] - ramp.at) * chi(*k);
            for (h, c) in terms.iter().zip(u[1..].chunks_exact(2)) {
                let c = c64::new(c[0], -c[1]);
                sum += chi(k - h) * c + chi(k + h) * c.conj();
            }
            *force += ramp.slope * sum;
        }
    }
}
