//! Newton's method onto a branch R(y, p) = 0 from a predicted point: arc length, pseudo arc length, Moore-Penrose.
use faer::Mat;
use faer::prelude::*;

use super::{Curve, Linearisation, nan_or_largest};
use crate::error::Result;
use crate::tolerances::roots::FELT;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Predictor {
    Tangent,
    Secant,
    /// the polynomial of this order through the last points; of lower order while there are fewer
    Lagrange(usize),
}

impl Predictor {
    /// Points of the branch that the prediction reads.
    pub fn points(self) -> usize {
        match self {
            Predictor::Tangent => 1,
            Predictor::Secant => 2,
            Predictor::Lagrange(order) => order + 1,
        }
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Corrector {
    PseudoArclength,
    Arclength,
    MoorePenrose,
}

#[derive(Debug, Clone, Copy)]
pub struct Options {
    pub predictor: Predictor,
    pub corrector: Corrector,
    /// last Newton step relative to the scale of the unknowns
    pub tolerance: f64,
    pub max_corrections: usize,
    pub first_step: f64,
    pub least_step: f64,
    pub largest_step: f64,
    /// size of the parameter: a step of the same length changes y by 100 % or p by this
    pub parameter_scale: f64,
}

/// A solution with its unit tangent; `z` is [y, p].
#[derive(Debug, Clone)]
pub struct Point {
    pub z: Vec<f64>,
    /// dz/ds in the units of z
    pub tangent: Vec<f64>,
    /// the unknowns of the continuation are z / scale
    pub scale: Vec<f64>,
    /// sign of the determinant of [J; t]: changes at branch points, not at folds
    pub orientation: f64,
    /// about the smallest singular value of [J; t] with rows and unknowns scaled: vanishes at branch points
    pub regularity: f64,
    pub iterations: usize,
    pub step: f64,
}

impl Point {
    pub fn y(&self) -> &[f64] {
        &self.z[..self.z.len() - 1]
    }

    pub fn p(&self) -> f64 {
        self.z[self.z.len() - 1]
    }

    /// dp/ds relative to its scale: the cosine between branch and parameter axis; zero at folds.
    pub fn p_slope(&self) -> f64 {
        let n = self.z.len() - 1;
        self.tangent[n] / self.scale[n]
    }
}

/// Scratch of one branch; after a successful correction `out` is the linearisation there.
pub struct Workspace {
    pub out: Linearisation,
    bordered: Mat<f64>,
    rhs: Mat<f64>,
    pub corrections: u64,
    regularity: f64,
}

impl Workspace {
    pub fn new(n: usize) -> Workspace {
        Workspace {
            out: Linearisation::new(n),
            bordered: Mat::zeros(n + 1, n + 1),
            rhs: Mat::zeros(n + 1, 3),
            corrections: 0,
            regularity: f64::NAN,
        }
    }

    /// Solves [R_z; border] [d, t] = [[-R, 0], [-defect, 1]] in scaled unknowns; the sign is that of the determinant.
    fn solve(&mut self, scale: &[f64], border: &[f64], defect: f64) -> f64 {
        let n = scale.len() - 1;
        for i in 0..n {
            let slope = self.out.slope[i] * scale[n];
            let mut size = slope.abs();
            for (j, d) in scale[..n].iter().enumerate() {
                let value = self.out.jacobian[(i, j)] * d;
                self.bordered[(i, j)] = value;
                size = size.max(value.abs());
            }
            let factor = if size > 0.0 { 1.0 / size } else { 1.0 };
            for j in 0..n {
                self.bordered[(i, j)] *= factor;
            }
            self.bordered[(i, n)] = slope * factor;
            self.rhs[(i, 0)] = -self.out.residual[i] * factor;
            self.rhs[(i, 1)] = 0.0;
            self.rhs[(i, 2)] = (1.0 + i as f64).cos();
        }
        for (j, b) in border.iter().enumerate() {
            self.bordered[(n, j)] = *b;
        }
        self.rhs[(n, 0)] = -defect;
        self.rhs[(n, 1)] = 1.0;
        self.rhs[(n, 2)] = (1.0 + n as f64).cos();
        let lu = self.bordered.partial_piv_lu();
        let before = self.rhs.col(2).norm_l2();
        lu.solve_in_place(&mut self.rhs);
        self.regularity = before / self.rhs.col(2).norm_l2();
        determinant_sign(&lu)
    }
}

fn determinant_sign(lu: &faer::linalg::solvers::PartialPivLu<f64>) -> f64 {
    let (permutation, _) = lu.P().arrays();
    let mut seen = vec![false; permutation.len()];
    let mut sign = 1.0;
    for start in 0..permutation.len() {
        let (mut at, mut length) = (start, 0);
        while !seen[at] {
            seen[at] = true;
            at = permutation[at];
            length += 1;
        }
        if length > 0 && length % 2 == 0 {
            sign = -sign;
        }
    }
    let u = lu.U();
    for i in 0..permutation.len() {
        if u[(i, i)] < 0.0 {
            sign = -sign;
        }
    }
    sign
}

pub(super) fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// z = [y, p] on the branch through a plane (or sphere) around a known point.
pub(super) struct Target<'a> {
    pub scale: &'a [f64],
    /// scaled centre of the step and its scaled direction
    pub centre: &'a [f64],
    pub direction: &'a [f64],
    pub distance: f64,
    pub corrector: Corrector,
}

impl Target<'_> {
    /// Border row and defect of the last equation at the scaled point x.
    fn border(&self, x: &[f64], turning: &[f64]) -> (Vec<f64>, f64) {
        let offset: Vec<f64> = x.iter().zip(self.centre).map(|(x, c)| x - c).collect();
        match self.corrector {
            Corrector::PseudoArclength => (self.direction.to_vec(), dot(self.direction, &offset) - self.distance),
            Corrector::MoorePenrose => (turning.to_vec(), 0.0),
            Corrector::Arclength => {
                let length = dot(&offset, &offset).sqrt();
                (offset.iter().map(|o| o / length).collect(), length - self.distance)
            }
        }
    }
}

/// The solution in the plane through [y, p] across a direction, from any start; None where the iteration does not contract.
pub fn across(
    curve: &mut dyn Curve,
    work: &mut Workspace,
    (through, towards): (&[f64], &[f64]),
    start: &[f64],
    options: &Options,
) -> Result<Option<Point>> {
    let mut scale = vec![0.0; through.len()];
    renew_scale(curve, &through[..through.len() - 1], options.parameter_scale, &mut scale);
    let centre = scaled(through, &scale);
    let mut direction = scaled(towards, &scale);
    let length = dot(&direction, &direction).sqrt();
    direction.iter_mut().for_each(|d| *d /= length);
    let target = Target {
        scale: &scale,
        centre: &centre,
        direction: &direction,
        distance: 0.0,
        corrector: Corrector::PseudoArclength,
    };
    correct(curve, work, &target, scaled(start, &scale), options)
}

/// Newton iteration onto the branch; None where it does not contract. `x` is the scaled start.
pub(super) fn correct(
    curve: &mut dyn Curve,
    work: &mut Workspace,
    target: &Target<'_>,
    mut x: Vec<f64>,
    options: &Options,
) -> Result<Option<Point>> {
    let n = x.len() - 1;
    let scale = target.scale;
    let mut turning = target.direction.to_vec();
    let mut last = f64::INFINITY;
    let mut z = vec![0.0; n + 1];
    for iterations in 1..=options.max_corrections {
        for i in 0..=n {
            z[i] = x[i] * scale[i];
        }
        curve.linearise(&z[..n], z[n], &mut work.out)?;
        work.corrections += 1;
        let (border, defect) = target.border(&x, &turning);
        let sign = work.solve(scale, &border, defect);
        let mut size = 0.0_f64;
        for (i, x) in x.iter_mut().enumerate() {
            *x += work.rhs[(i, 0)];
            size = nan_or_largest([size, work.rhs[(i, 0)].abs()].into_iter());
        }
        let length = (0..=n).map(|i| work.rhs[(i, 1)].powi(2)).sum::<f64>().sqrt();
        if !size.is_finite() || !length.is_finite() || (iterations > 2 && size > 2.0 * last) {
            return Ok(None);
        }
        turning.iter_mut().enumerate().for_each(|(i, t)| *t = work.rhs[(i, 1)] / length);
        // rounding of the equations may keep the step above the tolerance, where it no longer gets smaller
        let stuck = iterations > 3 && size <= FELT && size > 0.1 * last;
        if size <= options.tolerance || stuck {
            for i in 0..=n {
                z[i] = x[i] * scale[i];
            }
            if curve.row_excess(&z[..n], z[n], options.tolerance)? <= 1.0 {
                return Ok(Some(finish(curve, &x, &turning, target, (sign, work.regularity), iterations, options)));
            }
        }
        last = size;
    }
    Ok(None)
}

fn finish(
    curve: &dyn Curve,
    x: &[f64],
    turning: &[f64],
    target: &Target<'_>,
    (sign, regularity): (f64, f64),
    iterations: usize,
    options: &Options,
) -> Point {
    let (scale, direction) = (target.scale, target.direction);
    let n = x.len() - 1;
    let z: Vec<f64> = (0..=n).map(|i| x[i] * scale[i]).collect();
    let forward = if dot(turning, direction) < 0.0 { -1.0 } else { 1.0 };
    let mut new_scale = vec![0.0; n + 1];
    renew_scale(curve, &z[..n], options.parameter_scale, &mut new_scale);
    let mut tangent: Vec<f64> = (0..=n).map(|i| forward * turning[i] * scale[i]).collect();
    normalise(&mut tangent, &new_scale);
    Point { z, tangent, scale: new_scale, orientation: sign * forward, regularity, iterations, step: 0.0 }
}

/// Scales in which the solution y has at most length one, whatever the number of unknowns.
fn renew_scale(curve: &dyn Curve, y: &[f64], parameter_scale: f64, out: &mut [f64]) {
    let n = y.len();
    curve.scale(y, &mut out[..n]);
    let length = y.iter().zip(out.iter()).map(|(y, d)| (y / d).powi(2)).sum::<f64>().sqrt();
    if length > 1.0 {
        out[..n].iter_mut().for_each(|d| *d *= length);
    }
    out[n] = parameter_scale;
}

fn normalise(tangent: &mut [f64], scale: &[f64]) {
    let length = tangent.iter().zip(scale).map(|(t, d)| (t / d).powi(2)).sum::<f64>().sqrt();
    tangent.iter_mut().for_each(|t| *t /= length);
}

pub(super) fn scaled(z: &[f64], scale: &[f64]) -> Vec<f64> {
    z.iter().zip(scale).map(|(z, d)| z / d).collect()
}
