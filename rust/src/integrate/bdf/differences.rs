//! Coefficients of the numerical differentiation formulas, and backward differences on a grid that changes.
use nalgebra::DMatrix;

use super::super::LocalError;

/// Sum of 1/j up to k: the weight of the difference of order k in the slope.
pub fn gamma(k: usize) -> f64 {
    (1..=k).map(|j| 1.0 / j as f64).sum()
}

/// Formulas of one family by their order: kappa moves the slope by a part of the first difference that is left out.
#[derive(Debug, Clone, Copy)]
pub struct Formula {
    kappa: [f64; 6],
}

impl Formula {
    /// Backward differentiation.
    pub const BDF: Formula = Formula { kappa: [0.0; 6] };
    /// Shampine's and Reichelt's: smaller errors, a little less stable at orders three and four.
    pub const NDF: Formula = Formula { kappa: [0.0, -0.1850, -1.0 / 9.0, -0.0823, -0.0415, 0.0] };

    pub fn alpha(&self, k: usize) -> f64 {
        (1.0 - self.kappa[k]) * gamma(k)
    }

    pub fn error_constant(&self, k: usize) -> f64 {
        let kappa = self.kappa.get(k).copied().unwrap_or(0.0);
        kappa * gamma(k) + 1.0 / (k as f64 + 1.0)
    }
}

/// Increments from the chart, rates, and states of laws in the places of the memory.
#[derive(Debug, Clone)]
pub struct Pair {
    pub y: Vec<f64>,
    pub v: Vec<f64>,
    pub z: Vec<f64>,
}

impl Pair {
    /// Of n coordinates and so many states.
    pub fn zero(n: usize, states: usize) -> Self {
        Pair { y: vec![0.0; n], v: vec![0.0; n], z: vec![0.0; states] }
    }

    pub fn add(&mut self, o: &Pair, factor: f64) {
        for (own, other) in [(&mut self.y, &o.y), (&mut self.v, &o.v), (&mut self.z, &o.z)] {
            own.iter_mut().zip(other).for_each(|(a, b)| *a += factor * b);
        }
    }

    pub fn error(&self, factor: f64) -> LocalError {
        LocalError {
            position: self.y.iter().map(|v| v * factor).collect(),
            rate: self.v.iter().map(|v| v * factor).collect(),
            state: self.z.iter().map(|v| v * factor).collect(),
        }
    }
}

/// Of points with equal distances, the last one first.
pub fn backward_differences(points: Vec<Pair>) -> Vec<Pair> {
    let mut row = points;
    let mut differences = Vec::with_capacity(row.len());
    while let Some(first) = row.first() {
        differences.push(first.clone());
        let next = |w: &[Pair]| {
            let mut next = w[0].clone();
            next.add(&w[1], -1.0);
            next
        };
        row = row.windows(2).map(next).collect();
    }
    differences
}

/// (R U)^T, by which differences up to an order count on a grid with steps longer by `factor` (Shampine and Reichelt).
pub fn stretching(order: usize, factor: f64) -> DMatrix<f64> {
    let map = |factor: f64| {
        let mut m = DMatrix::zeros(order + 1, order + 1);
        m.row_mut(0).fill(1.0);
        for i in 1..=order {
            for j in 1..=order {
                m[(i, j)] = m[(i - 1, j)] * (i as f64 - 1.0 - factor * j as f64) / i as f64;
            }
        }
        m
    };
    let (r, u) = (map(factor), map(1.0));
    DMatrix::from_fn(order + 1, order + 1, |i, j| (0..=order).map(|k| r[(j, k)] * u[(k, i)]).sum())
}

/// Differences on a grid with steps longer by `factor`.
pub fn stretched(d: &mut [Pair], order: usize, factor: f64) {
    let weights = stretching(order, factor);
    let (n, states) = (d[0].y.len(), d[0].z.len());
    let old: Vec<Pair> = d[..=order].to_vec();
    for (i, target) in d.iter_mut().enumerate().take(order + 1) {
        *target = Pair::zero(n, states);
        for (j, source) in old.iter().enumerate().filter(|(j, _)| weights[(i, *j)] != 0.0) {
            target.add(source, weights[(i, j)]);
        }
    }
}

impl LocalError {
    pub fn scale(&mut self, factor: f64) {
        for part in [&mut self.position, &mut self.rate, &mut self.state] {
            part.iter_mut().for_each(|e| *e *= factor);
        }
    }

    /// Without what may be noise of this size.
    pub fn lessen(&mut self, noise: &LocalError) {
        for (own, noise) in [(&mut self.position, &noise.position), (&mut self.rate, &noise.rate)] {
            own.iter_mut().zip(noise).for_each(|(e, n)| *e = e.signum() * (e.abs() - n).max(0.0));
        }
    }
}
