//! The routes to L Z^-1 F, each bound to its ports, and the check of a route against refined direct solves.
use faer::linalg::matmul::matmul;
use faer::{Accum, Mat, MatRef, Par, c64};

use super::ports::Ports;
use crate::linalg::hessenberg::Hessenberg;
use crate::linalg::quadratic::Quadratic;
use crate::tolerances::frequency_response::ZERO_POLE;

/// One route bound to its ports; `at` gives L Z^-1 F, or None where Z is (nearly) singular.
pub enum Evaluator<'a> {
    Real { lambda: Vec<f64>, damping: Vec<f64>, left: Mat<f64>, right: Mat<c64>, noise: f64 },
    Complex { pole: Vec<c64>, left: Mat<c64>, right: Mat<c64>, noise: f64, largest: f64 },
    Hessenberg { reduced: &'a Hessenberg, cq: Mat<f64>, qb: Mat<f64> },
    Direct { q: &'a Quadratic, scale: &'a [f64], l: Mat<c64>, f: Mat<c64>, refinements: usize },
}

impl Evaluator<'_> {
    pub fn at(&self, w: f64) -> Option<Mat<c64>> {
        match self {
            Evaluator::Real { lambda, damping, left, right, noise } => {
                let mut receptance = Vec::with_capacity(lambda.len());
                for (l, c) in lambda.iter().zip(damping) {
                    let den = c64::new(l - w * w, w * c);
                    if den.norm() <= *noise {
                        return None;
                    }
                    receptance.push(den.inv());
                }
                let weighted = Mat::from_fn(left.nrows(), left.ncols(), |i, r| left[(i, r)] * receptance[r]);
                Some(product(weighted.as_ref(), right.as_ref()))
            }
            Evaluator::Complex { pole, left, right, noise, largest } => {
                let s = c64::new(0.0, w);
                let mut factor = Vec::with_capacity(pole.len());
                for pole in pole {
                    // a zero root is known to the accuracy of a defective one only, so omega = 0 is judged by S itself
                    let limit = if w == 0.0 { ZERO_POLE * largest } else { *noise };
                    if (s - pole).norm() <= limit {
                        return None;
                    }
                    factor.push((s - pole).inv());
                }
                let weighted = Mat::from_fn(left.nrows(), left.ncols(), |i, r| left[(i, r)] * factor[r]);
                Some(product(weighted.as_ref(), right.as_ref()))
            }
            Evaluator::Hessenberg { reduced, cq, qb } => {
                if w == 0.0 {
                    return None;
                }
                reduced.transfer(c64::new(0.0, w), cq.as_ref(), qb.as_ref())
            }
            Evaluator::Direct { q, scale, l, f, refinements } => {
                let solved = q.solve(w, f.as_ref(), scale, *refinements)?;
                Some(product(l.as_ref(), solved.x.as_ref()))
            }
        }
    }
}

/// A refined direct solution for one mix of the inputs.
pub struct Check {
    pub index: usize,
    pub plain_error: f64,
    pub reference: Mat<c64>,
    /// largest mass-normalised coordinate: an output that is eps of it counts as zero
    pub motion: f64,
    pub mix: Vec<f64>,
    pub unit: Vec<f64>,
}

impl Check {
    /// Relative to the largest output, each output measured in units of its map.
    pub fn distance(&self, value: Option<Mat<c64>>) -> f64 {
        let Some(value) = value else {
            return 0.0; // singular: another routine answers there
        };
        let (mut worst, mut size) = (0.0_f64, f64::EPSILON * self.motion);
        for (i, unit) in self.unit.iter().enumerate().filter(|(_, unit)| **unit > 0.0) {
            let mixed: c64 = (0..value.ncols()).map(|j| value[(i, j)] * self.mix[j]).sum();
            worst = worst.max((mixed - self.reference[(i, 0)]).norm() / unit);
            size = size.max(self.reference[(i, 0)].norm() / unit);
        }
        if worst == 0.0 { 0.0 } else { worst / size }
    }
}

/// Inputs weighed alike, with signs that do not let symmetric ones cancel.
pub fn input_mix(ports: &Ports) -> Vec<f64> {
    (0..ports.n_in())
        .map(|j| {
            let size = ports.f.col(j).norm_l2();
            let weight = 0.7 + 0.3 * ((j as f64) * 2.399_963).sin();
            if size > 0.0 { weight / size } else { 0.0 }
        })
        .collect()
}

fn product(a: MatRef<'_, c64>, b: MatRef<'_, c64>) -> Mat<c64> {
    let mut out = Mat::zeros(a.nrows(), b.ncols());
    matmul(&mut out, Accum::Replace, a, b, c64::new(1.0, 0.0), Par::Seq);
    out
}
