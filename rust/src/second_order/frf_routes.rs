//! The routes to L Z^-1 F, each bound to its ports, and the check of a route against refined direct solves.
use faer::linalg::matmul::matmul;
use faer::{Accum, Mat, MatRef, Par, c64};

use super::frf_banded::Banded;
use super::ports::Ports;
use crate::linalg::hessenberg::Hessenberg;
use crate::linalg::quadratic::Quadratic;
use crate::tolerances::frequency_response::BESIDE;

/// One route bound to its ports; `at` gives L Z^-1 F, or None where Z is (nearly) singular.
pub enum Evaluator<'a> {
    Real {
        lambda: Vec<f64>,
        damping: Vec<f64>,
        noise: Vec<f64>,
        left: Mat<f64>,
        right: Mat<c64>,
    },
    Complex {
        pole: Vec<c64>,
        left: Mat<c64>,
        right: Mat<c64>,
        noise: f64,
    },
    /// With direct solves where a band without pivots loses digits.
    Banded {
        banded: Banded<'a>,
        direct: Box<Evaluator<'a>>,
    },
    Hessenberg {
        reduced: &'a Hessenberg,
        cq: Mat<f64>,
        qb: Mat<f64>,
    },
    Direct {
        q: &'a Quadratic,
        scale: &'a [f64],
        l: Mat<c64>,
        f: Mat<c64>,
        refinements: usize,
    },
}

impl Evaluator<'_> {
    /// `at` for each of up to `LANES` frequencies.
    pub fn several(&self, omega: &[f64]) -> Vec<Option<Mat<c64>>> {
        match self {
            Evaluator::Banded { banded, direct } => {
                let found = banded.several(omega);
                omega.iter().zip(found).map(|(w, value)| value.or_else(|| direct.at(*w))).collect()
            }
            _ => omega.iter().map(|w| self.at(*w)).collect(),
        }
    }

    pub fn at(&self, w: f64) -> Option<Mat<c64>> {
        match self {
            Evaluator::Real { lambda, damping, noise, left, right } => {
                let mut receptance = Vec::with_capacity(lambda.len());
                for ((l, c), noise) in lambda.iter().zip(damping).zip(noise) {
                    let den = c64::new(l - w * w, w * c);
                    if den.norm() <= *noise {
                        return None;
                    }
                    receptance.push(den.inv());
                }
                let weighted = Mat::from_fn(left.nrows(), left.ncols(), |i, r| left[(i, r)] * receptance[r]);
                Some(product(weighted.as_ref(), right.as_ref()))
            }
            Evaluator::Complex { pole, left, right, noise } => {
                let s = c64::new(0.0, w);
                let mut factor = Vec::with_capacity(pole.len());
                for pole in pole {
                    if (s - pole).norm() <= *noise {
                        return None;
                    }
                    factor.push((s - pole).inv());
                }
                let weighted = Mat::from_fn(left.nrows(), left.ncols(), |i, r| left[(i, r)] * factor[r]);
                Some(product(weighted.as_ref(), right.as_ref()))
            }
            Evaluator::Banded { .. } => self.several(&[w]).pop()?,
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
pub struct Check<'a> {
    pub index: usize,
    pub plain_error: f64,
    pub reference: Mat<c64>,
    /// largest mass-normalised coordinate: an output that is eps of it counts as zero
    pub motion: f64,
    pub mix: Vec<f64>,
    pub unit: Vec<f64>,
    pub entries: Entries<'a>,
}

/// Direct solutions entry by entry, for some of the inputs and outputs where there are many.
pub struct Entries<'a> {
    pub outputs: Vec<usize>,
    pub inputs: Vec<usize>,
    /// of Z(i omega), for what no plain solution can tell
    pub refined: Box<dyn Fn() -> Option<Solution> + 'a>,
    pub plain: Solution,
}

/// Entries by one direct solution.
pub struct Solution {
    /// (outputs, inputs) L Z^-1 F
    pub value: Mat<c64>,
    /// what an entry and its error may be to count as zero: rounding of the motions of output and input under themselves
    pub zero: Mat<f64>,
}

impl Entries<'_> {
    /// The largest error of an entry over its own size, here or, where it passes through zero, close by. Plain solutions decide where they
    /// agree within `limit`, refined ones elsewhere.
    pub fn distance(&self, evaluator: &Evaluator<'_>, w: f64, limit: f64) -> f64 {
        let Some(value) = evaluator.at(w) else {
            return 0.0; // singular: another routine answers there
        };
        let beside = [1.0 - BESIDE, 1.0 + BESIDE].map(|side| evaluator.at(side * w));
        let own = |solution: &Solution| self.worst(&value, &beside, solution);
        let plain = own(&self.plain);
        if plain <= limit { plain } else { (self.refined)().map_or(0.0, |refined| own(&refined)) }
    }

    fn worst(&self, value: &Mat<c64>, beside: &[Option<Mat<c64>>; 2], solution: &Solution) -> f64 {
        let mut worst = 0.0_f64;
        for (i, &output) in self.outputs.iter().enumerate() {
            for (j, &input) in self.inputs.iter().enumerate() {
                let (reference, zero) = (solution.value[(i, j)], solution.zero[(i, j)]);
                let error = (value[(output, input)] - reference).norm();
                if reference.norm().max(error) <= zero {
                    continue;
                }
                let close = beside.each_ref().map(|v| v.as_ref().map_or(0.0, |v| v[(output, input)].norm()));
                let size = reference.norm().max(close[0].min(close[1])).max(zero);
                let relative = if error == 0.0 { 0.0 } else { error / size };
                worst = if relative.is_nan() { f64::INFINITY } else { worst.max(relative) };
            }
        }
        worst
    }
}

impl Check<'_> {
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

#[cfg(test)]
mod tests {
    use super::*;

    /// What two modes of lambda 1 and 3 give, against `reference`.
    fn distance(size: [f64; 2], w: f64, reference: f64, zero: f64) -> f64 {
        let left = Mat::from_fn(1, 2, |_, r| size[r]);
        let right = Mat::from_fn(2, 1, |_, _| c64::new(1.0, 0.0));
        let modes = Evaluator::Real { lambda: vec![1.0, 3.0], damping: vec![0.0; 2], noise: vec![0.0; 2], left, right };
        let solution = |value: f64| Solution {
            value: Mat::from_fn(1, 1, |_, _| c64::new(value, 0.0)),
            zero: Mat::from_fn(1, 1, |_, _| zero),
        };
        let entries = Entries {
            outputs: vec![0],
            inputs: vec![0],
            refined: Box::new(move || Some(solution(reference))),
            plain: solution(f64::NAN),
        };
        entries.distance(&modes, w, 1.0)
    }

    #[test]
    fn entries_are_compared_over_their_own_size() {
        let zero = crate::tolerances::frequency_response::ZERO_ENTRY;
        // 1e-9 of a small entry
        let (small, exact) = ([1e-7, 0.0], 1e-7 / (1.0 - 0.25));
        assert!(distance(small, 0.5, exact, zero) < 4.0 * f64::EPSILON);
        assert!((distance(small, 0.5, exact * (1.0 + 1e-9), zero) / 1e-9 - 1.0).abs() < 1e-3);
        // what rounding has left of nothing, and what it has not
        assert!(distance([3e-14, 0.0], 0.5, 0.0, zero) == 0.0);
        assert!(distance([3e-13, 0.0], 0.5, 0.0, zero) > 0.5);
        // at an antiresonance the entry has the size that it has close by: there 1/(1 - w^2) + 1/(3 - w^2) changes by 4 w dw = 8e-3
        let missed = distance([1.0, 1.0], 2.0_f64.sqrt(), 1e-12, zero);
        assert!((missed / (1e-12 / 8e-3) - 1.0).abs() < 0.01, "{missed}");
    }
}
