//! Damping that couples the undamped modes lightly: all roots and shapes by corrections of the undamped ones, without an eigensolution of
//! a state matrix.
//!
//! In undamped modal coordinates `(s^2 + s D + Lambda) y = 0`. The start is the unit vectors; each pair stays near an undamped mode of
//! its own, so that none is found twice.
use faer::{Mat, Scale};

use super::general::Hat;
use super::simultaneous::{Corrections, Projections};
use super::state::Candidate;
use super::symmetric::quadratic_roots;
use crate::error::Result;
use crate::linalg::dense::{C, EPS, frobenius, symmetrised};
use crate::linalg::eigen;
use crate::run::Counts;
use crate::tolerances::modes::{BLURRED, LIGHT};

/// Fewer coordinates: an eigensolution of the state matrix costs no more.
const FEWEST: usize = 40;
const PASSES: usize = 10;
/// Share of the last correction above which the next one is no progress.
const SHRINKING: f64 = 0.8;

/// All roots with Im > 0 and their vectors; None where the damping is not light. `lower` is the Cholesky factor of the stiffness.
pub fn candidates(hat: &Hat, lower: &Mat<f64>, counts: &mut Counts) -> Result<Option<Vec<Candidate>>> {
    let n = hat.s.nrows();
    let size = frobenius(lower.as_ref()); // root of the sum of all squared frequencies
    if n < FEWEST || hat.has_left || frobenius(hat.d.as_ref()) > size {
        return Ok(None);
    }
    counts.add("symmetric eigensolutions", 1);
    let (lambda, q) = undamped(hat, lower)?;
    if lambda[0] <= (BLURRED * size).powi(2) {
        return Ok(None);
    }
    let damping = symmetrised(q.transpose() * &hat.d * &q);
    let Some(mut pairs) = Pairs::new(damping, lambda) else { return Ok(None) };
    if !pairs.converge(counts) {
        return Ok(None);
    }
    let (re, im) = (&q * &pairs.re, &q * &pairs.im);
    let vector = |j: usize| (0..n).map(|i| C::new(re[(i, j)], im[(i, j)])).collect();
    Ok(Some(pairs.s.iter().enumerate().map(|(j, &s)| Candidate { s, x: vector(j), y: None }).collect()))
}

/// Squared frequencies and modes, the soft ones as accurate as the factor of the stiffness: its Gram matrix in the computed modes gives
/// frequencies, and first-order corrections of the modes.
fn undamped(hat: &Hat, lower: &Mat<f64>) -> Result<(Vec<f64>, Mat<f64>)> {
    let n = hat.s.nrows();
    let (_, q) = eigen::symmetric(hat.s.as_ref())?;
    let strain = lower.transpose() * &q;
    let gram = strain.transpose() * &strain;
    let lambda: Vec<f64> = (0..n).map(|j| gram[(j, j)]).collect();
    let stiffest = lambda.iter().fold(0.0f64, |m, v| m.max(*v)).sqrt();
    let turn = Mat::from_fn(n, n, |k, j| {
        let (coupling, gap) = (gram[(k, j)], lambda[j] - lambda[k]);
        let rounding = 16.0 * EPS * stiffest * (lambda[k].sqrt() + lambda[j].sqrt());
        // two frequencies that are equal within rounding are not told apart
        if coupling.abs() <= rounding || coupling.abs() > EPS.cbrt() * gap.abs() { 0.0 } else { coupling / gap }
    });
    let turned = &q * &turn;
    let second = &turned * &turn; // of the exponential of `turn`, which is a rotation
    Ok((lambda, q + turned + Scale(0.5) * second))
}

/// Approximate roots with Im > 0 and vectors (columns) of all modes.
struct Pairs {
    damping: Mat<f64>,
    lambda: Vec<f64>,
    s: Vec<C>,
    re: Mat<f64>,
    im: Mat<f64>,
    /// y^T Q'(s) y
    slope: Vec<C>,
}

impl Pairs {
    /// The undamped modes with the damping of each alone; None where one does not vibrate.
    fn new(damping: Mat<f64>, lambda: Vec<f64>) -> Option<Self> {
        let n = lambda.len();
        let s: Vec<C> = (0..n).map(|j| quadratic_roots(damping[(j, j)], lambda[j]).0).collect();
        if s.iter().any(|s| s.im <= 0.0) {
            return None;
        }
        let slope = (0..n).map(|j| 2.0 * s[j] + damping[(j, j)]).collect();
        Some(Pairs { re: Mat::identity(n, n), im: Mat::zeros(n, n), damping, lambda, s, slope })
    }

    /// Corrects all pairs until the next correction of each would be rounding; false where that does not come about.
    fn converge(&mut self, counts: &mut Counts) -> bool {
        let n = self.s.len();
        let mut moving: Vec<usize> = (0..n).collect();
        let mut limit = LIGHT;
        for pass in 0..PASSES {
            let found = if pass == 0 { self.coupling() } else { self.projections(&moving) };
            let step = Corrections::new(&found, &self.s, &self.slope, &moving);
            let sizes = step.sizes();
            let largest = sizes.iter().fold(0.0f64, |m, v| if v.is_nan() { f64::INFINITY } else { m.max(*v) });
            if largest > limit {
                return false;
            }
            limit = SHRINKING * largest;
            counts.add("corrections of modes", moving.len() as u64);
            self.apply(&found, &step, &moving);
            moving = step.unsettled(&sizes, &moving);
            if moving.is_empty() {
                return true;
            }
        }
        false
    }

    /// The projections at the start, where the vectors are unit vectors.
    fn coupling(&self) -> Projections {
        let n = self.s.len();
        let entry = |k: usize, j: usize| if k == j { C::ZERO } else { self.s[j] * self.damping[(k, j)] };
        let plain = Mat::from_fn(n, n, entry);
        Projections { conjugate: plain.clone(), plain }
    }

    fn projections(&mut self, moving: &[usize]) -> Projections {
        let (n, m) = (self.s.len(), moving.len());
        let columns = |a: &Mat<f64>| Mat::from_fn(n, m, |i, c| a[(i, moving[c])]);
        let (re, im) = (columns(&self.re), columns(&self.im));
        let (damped_re, damped_im) = (&self.damping * &re, &self.damping * &im);
        let (mut r_re, mut r_im) = (Mat::zeros(n, m), Mat::zeros(n, m));
        for (c, &j) in moving.iter().enumerate() {
            let s = self.s[j];
            let mut slope = C::ZERO;
            for i in 0..n {
                let (y, damped) = (C::new(re[(i, c)], im[(i, c)]), C::new(damped_re[(i, c)], damped_im[(i, c)]));
                let r = (s * s + self.lambda[i]) * y + s * damped;
                (r_re[(i, c)], r_im[(i, c)]) = (r.re, r.im);
                slope += y * (2.0 * s * y + damped);
            }
            self.slope[j] = slope;
        }
        let (a, b) = (self.re.transpose(), self.im.transpose());
        let (aa, bb, ab, ba) = (a * &r_re, b * &r_im, a * &r_im, b * &r_re);
        Projections {
            plain: Mat::from_fn(n, m, |k, c| C::new(aa[(k, c)] - bb[(k, c)], ab[(k, c)] + ba[(k, c)])),
            conjugate: Mat::from_fn(n, m, |k, c| C::new(aa[(k, c)] + bb[(k, c)], ab[(k, c)] - ba[(k, c)])),
        }
    }

    fn apply(&mut self, found: &Projections, step: &Corrections, moving: &[usize]) {
        let (n, m) = (self.s.len(), moving.len());
        let part = |f: &dyn Fn(C, C) -> f64| Mat::from_fn(n, m, |k, c| f(step.own[(k, c)], step.other[(k, c)]));
        let (sum_re, sum_im) = (part(&|a, b| a.re + b.re), part(&|a, b| a.im + b.im));
        let (difference_re, difference_im) = (part(&|a, b| a.re - b.re), part(&|a, b| a.im - b.im));
        let re = &self.re * &sum_re - &self.im * &difference_im;
        let im = &self.re * &sum_im + &self.im * &difference_re;
        for (c, &j) in moving.iter().enumerate() {
            let change = found.plain[(j, c)] / self.slope[j];
            self.s[j] -= change;
            add(self.re.as_mut().col_mut(j), re.as_ref().col(c));
            add(self.im.as_mut().col_mut(j), im.as_ref().col(c));
        }
    }
}

fn add(mut to: faer::ColMut<'_, f64>, from: faer::ColRef<'_, f64>) {
    to += from;
}
