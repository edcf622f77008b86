//! The monodromy matrix of a periodic motion by splitting: the linear part moves exactly, the tangents of the elements kick.
//!
//! One step of length h is E(h/2) K E(h/2) with E the exact propagator of M x" + C x' + K x = 0 and K a kick with the tangents at
//! the middle of the step. The product is symmetric in time, so that its error has even powers of h only and extrapolation gains two
//! orders per doubling (Hairer, Lubich, Wanner, Geometric Numerical Integration, Springer 2006, II.4, V.3). With few elements in many
//! coordinates a step is made in modal coordinates at O(n_e n^2), else on the states at O(n^3) in real numbers.
use faer::Mat;
use faer::prelude::*;

use super::hbm::aft::Aft;
use super::hbm::linear::Matrices;
use super::hbm::problem::{Problem, Tangents};
use super::propagator::{Modes, States};
use crate::error::{Error, Result};

/// Coarsest number of steps per period, and how often it is doubled at most.
const COARSEST: usize = 32;
const DOUBLINGS: usize = 7;
/// Expected error of the extrapolated matrix, relative to its size, that ends the doubling.
const TOLERANCE: f64 = 1e-10;
/// Changes larger than this do not tell yet how fast the next ones will shrink.
const SETTLED: f64 = 1e-5;

/// What does not change along a branch: the linear part in coordinates in which its motion is known.
pub struct Splitting {
    n: usize,
    /// trace of -M^-1 C and, per element, of the effect of its rate
    linear_trace: f64,
    own: Vec<f64>,
    coordinates: Coordinates,
    /// sqrt(M_ii): coordinates of any units are compared as momenta are
    unit: Vec<f64>,
    samplers: Vec<Aft>,
    /// steps of the finest product that was needed last
    pub finest: usize,
}

enum Coordinates {
    Modes(Modes),
    States(States),
}

impl Splitting {
    /// Matrices whose first coordinates are those that the problem retains.
    pub fn new(problem: &Problem, (mass, damping, stiffness): &Matrices) -> Result<Splitting> {
        let (n, n_e) = (mass.nrows(), problem.elements.len());
        let lu = mass.partial_piv_lu();
        let (c, k) = (lu.solve(damping), lu.solve(stiffness));
        if !(0..n).all(|i| c[(i, i)].is_finite() && k[(i, i)].is_finite()) {
            return Err(Error::singular("stability needs a regular mass matrix; remove coordinates without mass"));
        }
        let mut see = Mat::<f64>::zeros(n, n_e);
        for (e, direction) in problem.retained().iter().enumerate() {
            for &(i, weight) in direction {
                see[(i, e)] += weight;
            }
        }
        let push = lu.solve(&see);
        let own = |e: usize| -> f64 { (0..n).map(|i| see[(i, e)] * push[(i, e)]).sum() };
        // operations of a step: 8 (2n)^2 (1 + 2 n_e) in complex modes, 2 (2n)^3 + 4 n_e n^2 on the states
        let many = n > 2 + 3 * n_e;
        let modes = many.then(|| Modes::new(&c, &k, &push, &see)).flatten();
        Ok(Splitting {
            n,
            linear_trace: -(0..n).map(|i| c[(i, i)]).sum::<f64>(),
            own: (0..n_e).map(own).collect(),
            coordinates: match modes {
                Some(modes) => Coordinates::Modes(modes),
                None => Coordinates::States(States::new(c, k, &push, &see)),
            },
            unit: (0..n).map(|i| mass[(i, i)].abs().sqrt()).collect(),
            samplers: Vec::new(),
            finest: 0,
        })
    }

    /// Coordinates of the state, 2 n.
    pub fn size(&self) -> usize {
        2 * self.n
    }

    /// Fundamental matrix of [x; v] over one period of the motion y, and the sum of the exponents (Liouville).
    pub fn monodromy(&mut self, problem: &mut Problem, y: &[f64]) -> Result<(Mat<f64>, f64)> {
        let w0 = problem.base_frequency();
        let top = problem.basis.reach()[0].max(1);
        let coarsest = COARSEST.max((2 * top + 2).next_power_of_two());
        // rows of the extrapolation table: products with growing numbers of steps, rates in units of w0
        let mut last: Vec<Mat<f64>> = Vec::new();
        let (mut sum, mut before) = (0.0, f64::INFINITY);
        for level in 0..=DOUBLINGS {
            let steps = coarsest << level;
            let tangents = self.tangents(problem, y, level, steps)?;
            self.finest = steps;
            sum = self.sum_of_exponents(&tangents);
            let product = match &self.coordinates {
                Coordinates::Modes(modes) => modes.product(&tangents, steps, w0),
                Coordinates::States(states) => states.product(&tangents, steps, w0),
            };
            let unit = |i: usize| self.unit[i % self.n];
            let product = Mat::from_fn(2 * self.n, 2 * self.n, |i, j| product[(i, j)] * (unit(i) / unit(j)));
            let mut row = vec![product];
            for (order, coarse) in last.iter().enumerate() {
                let gain = 4.0_f64.powi(order as i32 + 1) - 1.0;
                let fine = &row[order];
                row.push(fine + (fine - coarse) * Scale(1.0 / gain));
            }
            let size = row[row.len() - 1].norm_max();
            let change = match last.last() {
                Some(coarser) => (&row[row.len() - 1] - coarser).norm_max() / size,
                None => f64::INFINITY,
            };
            // where changes shrink, the next one shrinks at least as fast: it is the error of the present value
            let next = if change <= SETTLED { change * (change / before).min(1.0) } else { change };
            (last, before) = (row, change);
            if next <= TOLERANCE {
                break;
            }
        }
        let n = self.n;
        let phi = &last[last.len() - 1];
        let unit = |i: usize| if i < n { 1.0 / self.unit[i] } else { w0 / self.unit[i - n] };
        let states = Mat::from_fn(2 * n, 2 * n, |i, j| phi[(i, j)] * unit(i) / unit(j));
        Ok((states, sum))
    }

    /// Mean trace of the variational equation.
    fn sum_of_exponents(&self, tangents: &Tangents) -> f64 {
        let mean = |f: &[f64]| f.iter().sum::<f64>() / f.len() as f64;
        let rates = tangents.iter().zip(&self.own);
        self.linear_trace - rates.map(|((_, f_v), own)| own * mean(f_v)).sum::<f64>()
    }

    /// df/du and df/dv of the elements at the middles of the steps.
    fn tangents(&mut self, problem: &mut Problem, y: &[f64], level: usize, steps: usize) -> Result<Tangents> {
        if self.samplers.len() <= level {
            self.samplers.push(Aft::between(&problem.basis, steps));
        }
        problem.tangents(y, &mut self.samplers[level])
    }
}
