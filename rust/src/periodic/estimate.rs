//! How far a truncated solution may be off: one Newton step on a larger set of terms and a finer grid, started at the solution.
//!
//! Terms beyond the larger set that its samples resolve count with the linear answer to the laws' forces there (`tail`).
//! The step holds both the omitted terms and what they change in the retained ones, and through the finer grid the aliasing. What rounding of
//! the equations may change is added: a step by eps times the sizes of what their rows are summed of.
//! Source: docs/theory.md (11.9).
use faer::prelude::*;

use super::basis::Finer;
use super::problem::{Parameter, Problem};
use super::tail::Tail;
use crate::error::Result;
use crate::solve::{Curve as _, Linearisation, nan_or_largest};

pub struct Estimator {
    larger: Problem,
    tail: Tail,
    out: Linearisation,
    y: Vec<f64>,
}

/// The first two relative to the largest coefficient, coordinates weighed by `Problem::weights`.
#[derive(Debug, Clone, Default)]
pub struct Estimate {
    /// the part of the omitted terms, and what rounding may change
    pub error: f64,
    pub rounding: f64,
    /// what the finer grid alone changes in the retained terms
    pub aliasing: f64,
    /// the part of even terms that were left out
    pub even: f64,
    /// per retained coordinate, in its unit: a bound of the deviation at any instant
    pub deviations: Vec<f64>,
}

impl Estimate {
    /// The larger one of each.
    pub fn larger(&self, other: &Estimate) -> Estimate {
        Estimate {
            error: self.error.max(other.error),
            rounding: self.rounding.max(other.rounding),
            aliasing: self.aliasing.max(other.aliasing),
            even: self.even.max(other.even),
            deviations: self.deviations.iter().zip(&other.deviations).map(|(a, b)| a.max(*b)).collect(),
        }
    }

    /// What a relative error of the solution y allows at most.
    pub fn bound(problem: &Problem, y: &[f64], error: f64) -> Estimate {
        let weights = problem.weights();
        let weighed = amplitudes(y, problem.n()).zip(weights.iter().cycle()).map(|(a, w)| a * w);
        let size = error * nan_or_largest(weighed);
        Estimate {
            error,
            rounding: 0.0,
            aliasing: error,
            even: error,
            deviations: weights.iter().map(|w| size / w).collect(),
        }
    }
}

impl Estimator {
    pub fn new(problem: &Problem, finer: &Finer) -> Result<Estimator> {
        let mut larger = problem.on(problem.basis.extended(&finer.extra), &finer.dims)?;
        let (n, tail) = (larger.size(), Tail::new(&mut larger));
        Ok(Estimator { larger, tail, out: Linearisation::new(n), y: vec![0.0; n] })
    }

    pub fn factorisations(&self) -> u64 {
        self.larger.factorisations
    }

    /// `y` is a solution of `problem` at its present parameter.
    pub fn estimate(&mut self, problem: &Problem, y: &[f64]) -> Result<Estimate> {
        self.larger.follow(problem)?;
        self.y.fill(0.0);
        // `extended` keeps the order of the old terms and appends the new ones
        self.y[..y.len()].copy_from_slice(y);
        self.larger.linearise_here(&self.y, &mut self.out)?;
        let n_own = y.len();
        let rounding = self.larger.row_rounding(&self.y);
        let mut steps = faer::Mat::from_fn(self.y.len(), 3, |i, column| match column {
            0 => self.out.residual[i],
            1 if i < n_own => self.out.residual[i],
            2 => rounding[i],
            _ => 0.0,
        });
        self.out.jacobian.partial_piv_lu().solve_in_place(&mut steps);
        let step = steps.col_as_slice(0);
        let n = problem.n();
        let weights = problem.weights();
        let largest = nan_or_largest(amplitudes(y, n).zip(weights.iter().cycle()).map(|(a, w)| a * w));
        let mut deviations = coordinate_sums(step, n);
        let beyond = self.tail.amplitudes(&mut self.larger, self.out.jacobian.as_ref(), &weights)?;
        deviations.iter_mut().zip(&beyond).for_each(|(sum, b)| *sum += b);
        if largest == 0.0 && step.iter().all(|x| *x == 0.0) {
            return Ok(Estimate { deviations, ..Estimate::default() });
        }
        // on the grid of the solution the first residuals vanish
        let relative = |sums: &[f64]| nan_or_largest(sums.iter().zip(&weights).map(|(d, w)| d * w)) / largest;
        let aliasing = relative(&coordinate_sums(&steps.col_as_slice(1)[..n_own], n));
        let rounding = relative(&coordinate_sums(&steps.col_as_slice(2)[..n_own], n));
        let even = relative(&coordinate_sums(&self.even_extra(step, n_own), n));
        Ok(Estimate { error: relative(&deviations) + rounding, rounding, aliasing, even, deviations })
    }

    /// The step without its own terms and without odd ones.
    fn even_extra(&self, step: &[f64], n_own: usize) -> Vec<f64> {
        let n = self.larger.n();
        let odd = |i: usize| self.larger.basis.indices[(i / n - 1) / 2][0] % 2 != 0;
        (0..step.len()).map(|i| if i < n_own || odd(i) { 0.0 } else { step[i] }).collect()
    }
}

/// The estimated error of a solution y by itself; `value` is that of the parameter of a family.
pub fn error_at(mut problem: Problem, finer: &Finer, y: &[f64], value: Option<f64>) -> Result<f64> {
    if let Some(value) = value {
        problem.parameter = Parameter::Family;
        problem.set_parameter(value)?;
    }
    problem.linearise_here(y, &mut Linearisation::new(y.len()))?;
    Ok(Estimator::new(&problem, finer)?.estimate(&problem, y)?.error)
}

/// Amplitudes sqrt(a^2 + b^2) of all terms and coordinates.
fn amplitudes(y: &[f64], n: usize) -> impl Iterator<Item = f64> + '_ {
    let terms = (y.len() / n).div_ceil(2);
    (0..terms * n).map(move |i| amplitude(y, n, i / n, i % n))
}

fn amplitude(y: &[f64], n: usize, term: usize, coordinate: usize) -> f64 {
    if term == 0 { y[coordinate].abs() } else { y[(2 * term - 1) * n + coordinate].hypot(y[2 * term * n + coordinate]) }
}

/// Per coordinate the sum of amplitudes: a bound of the deviation at any instant.
fn coordinate_sums(y: &[f64], n: usize) -> Vec<f64> {
    let terms = (y.len() / n).div_ceil(2);
    (0..n).map(|i| (0..terms).map(|t| amplitude(y, n, t, i)).sum()).collect()
}
