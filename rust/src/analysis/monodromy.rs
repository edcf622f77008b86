//! The monodromy matrix of a periodic motion by splitting: the linear part moves exactly, the tangents of the elements kick.
//!
//! One step of length h is E(h/2) K E(h/2) with E the exact propagator of M x" + C x' + K x = 0 and K a kick of rank n_e with the
//! tangents at the middle of the step. The product is symmetric in time, so that its error has even powers of h only and
//! extrapolation gains two orders per doubling (Hairer, Lubich, Wanner, Geometric Numerical Integration, Springer 2006, II.4, V.3).
//! In modal coordinates a step costs O(n_e n^2); where the modes are too skew it is done in states at O(n^3).
use faer::Mat;
use faer::prelude::*;
use num_complex::Complex64 as c64;

use super::hbm::aft::Aft;
use super::hbm::linear::Matrices;
use super::hbm::problem::{Problem, Tangents};
use crate::error::{Error, Result};

/// Coarsest number of steps per period, and how often it is doubled at most.
const COARSEST: usize = 32;
const DOUBLINGS: usize = 7;
/// Change between the last two extrapolated matrices, relative to their size, that ends the doubling.
const TOLERANCE: f64 = 1e-10;
/// Modes worse conditioned than this are not used as coordinates.
const SKEW: f64 = 1e6;

/// What does not change along a branch: the linear part in coordinates in which its motion is known.
pub struct Splitting {
    n: usize,
    /// poles, or None where the states themselves are the coordinates
    poles: Option<Vec<c64>>,
    /// [x; v] = to_state z
    to_state: Mat<c64>,
    from_state: Mat<c64>,
    companion: Mat<f64>,
    /// effect of element forces on z, (2n, n_e), and displacements and rates of the elements, (n_e, 2n)
    kick: Mat<c64>,
    see_u: Mat<c64>,
    see_v: Mat<c64>,
    samplers: Vec<Aft>,
}

impl Splitting {
    /// Matrices whose first coordinates are those that the problem retains.
    pub fn new(problem: &Problem, (mass, damping, stiffness): &Matrices) -> Result<Splitting> {
        let (n, n_e) = (mass.nrows(), problem.elements.len());
        let lu = mass.partial_piv_lu();
        let (c, k) = (lu.solve(damping), lu.solve(stiffness));
        let companion = Mat::from_fn(2 * n, 2 * n, |i, j| match (i < n, j < n) {
            (true, _) => f64::from(u8::from(j == i + n)),
            (false, true) => -k[(i - n, j)],
            (false, false) => -c[(i - n, j - n)],
        });
        if !(0..2 * n).all(|i| companion[(i, i)].is_finite()) {
            return Err(Error::singular(
                "stability needs a regular mass matrix; remove coordinates without mass",
            ));
        }
        let mut w = Mat::<f64>::zeros(n, n_e);
        for (e, direction) in problem.retained().iter().enumerate() {
            for &(i, weight) in direction {
                w[(i, e)] += weight;
            }
        }
        let push = lu.solve(&w);
        let complex = |m: &Mat<f64>, offset: usize| {
            Mat::from_fn(2 * n, n_e, |i, e| {
                c64::new(
                    if i >= offset && i < offset + n {
                        m[(i - offset, e)]
                    } else {
                        0.0
                    },
                    0.0,
                )
            })
        };
        let (poles, to_state) =
            modes(&companion).map_or((None, Mat::identity(2 * n, 2 * n)), |(s, v)| (Some(s), v));
        let from_state = to_state
            .partial_piv_lu()
            .solve(Mat::<c64>::identity(2 * n, 2 * n));
        Ok(Splitting {
            n,
            kick: &from_state * complex(&push, n) * Scale(c64::new(-1.0, 0.0)),
            see_u: complex(&w, 0).transpose() * &to_state,
            see_v: complex(&w, n).transpose() * &to_state,
            poles,
            to_state,
            from_state,
            companion,
            samplers: Vec::new(),
        })
    }

    /// Coordinates of the state, 2 n.
    pub fn size(&self) -> usize {
        2 * self.n
    }

    /// Fundamental matrix of [x; v] over one period of the motion y, and the sum of the exponents (Liouville).
    pub fn monodromy(&mut self, problem: &mut Problem, y: &[f64]) -> Result<(Mat<f64>, f64)> {
        let period = std::f64::consts::TAU / problem.base_frequency();
        let top = problem.basis.reach()[0].max(1);
        let coarsest = COARSEST.max((2 * top).next_power_of_two());
        // rows of the extrapolation table: products with growing numbers of steps
        let mut last: Vec<Mat<c64>> = Vec::new();
        let mut sum = 0.0;
        for level in 0..=DOUBLINGS {
            let steps = coarsest << level;
            let tangents = self.tangents(problem, y, level, 2 * steps)?;
            sum = self.sum_of_exponents(&tangents);
            let mut row = vec![self.product(&tangents, steps, period)];
            for (order, coarse) in last.iter().enumerate() {
                let gain = 4.0_f64.powi(order as i32 + 1) - 1.0;
                let fine = &row[order];
                row.push(fine + (fine - coarse) * Scale(c64::new(1.0 / gain, 0.0)));
            }
            let change = match (row.len(), last.last()) {
                (2.., Some(before)) => (&row[row.len() - 1] - before).norm_max(),
                _ => f64::INFINITY,
            };
            let done = change <= TOLERANCE * row[row.len() - 1].norm_max() || level == DOUBLINGS;
            last = row;
            if done {
                break;
            }
        }
        let phi = &self.to_state * &last[last.len() - 1] * &self.from_state;
        Ok((
            Mat::from_fn(2 * self.n, 2 * self.n, |i, j| phi[(i, j)].re),
            sum,
        ))
    }

    /// Mean trace of the variational equation.
    fn sum_of_exponents(&self, tangents: &Tangents) -> f64 {
        let linear: f64 = (0..2 * self.n).map(|i| self.companion[(i, i)]).sum();
        tangents
            .iter()
            .enumerate()
            .fold(linear, |sum, (e, (_, f_v))| {
                let own: c64 = (0..2 * self.n)
                    .map(|i| self.see_v[(e, i)] * self.kick[(i, e)])
                    .sum();
                sum + own.re * f_v.iter().sum::<f64>() / f_v.len() as f64
            })
    }

    fn tangents(
        &mut self,
        problem: &mut Problem,
        y: &[f64],
        level: usize,
        samples: usize,
    ) -> Result<Tangents> {
        if self.samplers.len() <= level {
            self.samplers
                .push(Aft::new(&problem.basis, &[samples], false));
        }
        problem.tangents(y, &mut self.samplers[level])
    }

    fn product(&self, tangents: &Tangents, steps: usize, period: f64) -> Mat<c64> {
        let h = period / steps as f64;
        let kicker = Kicker {
            split: self,
            tangents,
            h,
        };
        let size = 2 * self.n;
        let mut phi = Mat::<c64>::identity(size, size);
        match &self.poles {
            Some(poles) => {
                let whole: Vec<c64> = poles.iter().map(|s| (s * h).exp()).collect();
                let half: Vec<c64> = poles.iter().map(|s| (s * (0.5 * h)).exp()).collect();
                scale_rows(&mut phi, &half);
                for step in 0..steps {
                    kicker.apply(step, &mut phi);
                    scale_rows(&mut phi, if step + 1 < steps { &whole } else { &half });
                }
            }
            None => {
                let complex =
                    |m: Mat<f64>| Mat::from_fn(size, size, |i, j| c64::new(m[(i, j)], 0.0));
                let half = complex(exponential(&(&self.companion * Scale(0.5 * h))));
                let whole = &half * &half;
                phi = half.clone();
                for step in 0..steps {
                    kicker.apply(step, &mut phi);
                    phi = if step + 1 < steps {
                        &whole * &phi
                    } else {
                        &half * &phi
                    };
                }
            }
        }
        phi
    }
}

fn scale_rows(phi: &mut Mat<c64>, factors: &[c64]) {
    for j in 0..phi.ncols() {
        for (x, f) in phi.col_as_slice_mut(j).iter_mut().zip(factors) {
            *x *= f;
        }
    }
}

/// Eigenvalues and vectors, unless they are too skew to be coordinates.
fn modes(companion: &Mat<f64>) -> Option<(Vec<c64>, Mat<c64>)> {
    let eigen = companion.eigen().ok()?;
    let poles: Vec<c64> = eigen.S().column_vector().iter().copied().collect();
    let mut vectors = eigen.U().to_owned();
    for j in 0..vectors.ncols() {
        let length = vectors.col(j).norm_l2();
        for x in vectors.col_as_slice_mut(j) {
            *x /= length;
        }
    }
    let inverse = vectors
        .partial_piv_lu()
        .solve(Mat::<c64>::identity(poles.len(), poles.len()));
    let condition = vectors.norm_l2() * inverse.norm_l2();
    (condition < SKEW).then_some((poles, vectors))
}

struct Kicker<'a> {
    split: &'a Splitting,
    tangents: &'a Tangents,
    h: f64,
}

impl Kicker<'_> {
    /// z += h B g with (1 - h/2 F_v P) g = F_u u + F_v v: exact where there is no F_v, the midpoint rule otherwise.
    fn apply(&self, step: usize, phi: &mut Mat<c64>) {
        let (split, sample) = (self.split, 2 * step + 1);
        let n_e = self.tangents.len();
        if n_e == 1 {
            let (f_u, f_v) = (self.tangents[0].0[sample], self.tangents[0].1[sample]);
            let own: c64 = (0..phi.nrows())
                .map(|i| split.see_v[(0, i)] * split.kick[(i, 0)])
                .sum();
            let factor = self.h / (1.0 - 0.5 * self.h * f_v * own);
            let kick = split.kick.col_as_slice(0);
            let seen: Vec<c64> = (0..phi.nrows())
                .map(|i| (split.see_u[(0, i)] * f_u + split.see_v[(0, i)] * f_v) * factor)
                .collect();
            for j in 0..phi.ncols() {
                let column = phi.col_as_slice_mut(j);
                let g: c64 = column.iter().zip(&seen).map(|(z, s)| s * z).sum();
                for (z, b) in column.iter_mut().zip(kick) {
                    *z += b * g;
                }
            }
            return;
        }
        let f = |e: usize| (self.tangents[e].0[sample], self.tangents[e].1[sample]);
        let seen = Mat::from_fn(n_e, phi.nrows(), |e, i| {
            split.see_u[(e, i)] * f(e).0 + split.see_v[(e, i)] * f(e).1
        });
        let mut g = &seen * &*phi;
        if self.tangents.iter().any(|t| t.1[sample] != 0.0) {
            let own = &split.see_v * &split.kick;
            let matrix = Mat::from_fn(n_e, n_e, |a, b| {
                c64::new(f64::from(u8::from(a == b)), 0.0) - own[(a, b)] * (0.5 * self.h * f(a).1)
            });
            matrix.partial_piv_lu().solve_in_place(&mut g);
        }
        *phi += &split.kick * g * Scale(c64::new(self.h, 0.0));
    }
}

/// exp(A) by Taylor's series on A / 2^k with norm below 1/4, squared back.
fn exponential(a: &Mat<f64>) -> Mat<f64> {
    let n = a.nrows();
    let norm = (0..n)
        .map(|i| (0..n).map(|j| a[(i, j)].abs()).sum::<f64>())
        .fold(0.0, f64::max);
    let halvings = if norm > 0.25 {
        (norm / 0.25).log2().ceil() as i32
    } else {
        0
    };
    let small = a * Scale(0.5_f64.powi(halvings));
    let mut sum = Mat::<f64>::identity(n, n);
    for order in (1..=11).rev() {
        let next = &small * &sum * Scale(1.0 / f64::from(order));
        sum = Mat::<f64>::identity(n, n) + next;
    }
    for _ in 0..halvings {
        sum = &sum * &sum;
    }
    sum
}
