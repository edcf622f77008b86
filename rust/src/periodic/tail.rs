//! What the terms beyond those of an error estimate may hold: the linear answer, with the laws' mean slope, to the forces that the laws have
//! there. Where such a term meets a natural frequency, a small force moves much, and the next few terms do not tell.
use faer::MatRef;
use num_complex::Complex64 as c64;

use super::basis::Basis;
use super::linear::Block;
use super::problem::Problem;
use crate::error::Result;
use crate::linalg::complex_lanes::LANES;
use crate::linalg::complex_solve::solve_in_place;
use crate::tolerances::periodic::ROW_ROUNDING;

pub struct Tail {
    basis: Basis,
    /// of the terms of the problem, unused, and of a few terms at once
    blocks: Vec<Block>,
    matrix: Vec<c64>,
}

impl Tail {
    /// The terms that the samples of a problem resolve beyond its basis.
    pub fn new(problem: &mut Problem) -> Tail {
        let basis = Basis { indices: problem.resolve_tail(), subharmonic: problem.basis.subharmonic };
        Tail { basis, blocks: Vec::new(), matrix: Vec::new() }
    }

    /// Per retained coordinate the sum of amplitudes in these terms, after an evaluation of the problem with this Jacobian.
    pub fn amplitudes(
        &mut self,
        problem: &mut Problem,
        jacobian: MatRef<'_, f64>,
        weights: &[f64],
    ) -> Result<Vec<f64>> {
        let n = problem.n();
        let mut sums = vec![0.0; n];
        let terms = self.loads(problem, weights);
        let slope = mean_slope(problem, jacobian);
        let frequencies = self.basis.frequencies(&problem.omega);
        let first = problem.basis.n_harmonics() + 1;
        self.blocks.resize_with(first + LANES, || Block::new(n));
        for some in terms.chunks(LANES) {
            let tasks: Vec<(usize, f64)> =
                some.iter().enumerate().map(|(lane, k)| (first + lane, frequencies[*k])).collect();
            problem.linear.evaluate_all(&tasks, &mut self.blocks)?;
            problem.factorisations += tasks.len() as u64;
            for (k, (at, w)) in some.iter().zip(tasks) {
                let s = &self.blocks[at].s;
                self.matrix.clear();
                let entry = |i: usize| (s[i] + slope.at(i, w)) / (weights[i / n] * weights[i % n]);
                self.matrix.extend((0..n * n).map(entry));
                let mut x: Vec<c64> = problem.tail()[k * n..][..n].iter().zip(weights).map(|(f, w)| f / w).collect();
                solve_in_place(&mut self.matrix, &mut x);
                sums.iter_mut().zip(&x).zip(weights).for_each(|((sum, x), w)| *sum += x.norm() / w);
            }
        }
        Ok(sums)
    }

    /// The terms whose forces are more than rounding, those of condensed coordinates, which cost a factorisation each, at most as many as
    /// the problem has, the largest forces first.
    fn loads(&self, problem: &Problem, weights: &[f64]) -> Vec<usize> {
        let n = problem.n();
        let mut size = vec![0.0; n];
        for (direction, push) in problem.pushes() {
            direction.iter().for_each(|(i, w)| size[*i] += w.abs() * push / weights[*i]);
        }
        let rounding = ROW_ROUNDING * f64::EPSILON * size.iter().fold(0.0_f64, |a, s| a.max(*s));
        let load = |k: usize| -> f64 {
            problem.tail()[k * n..][..n].iter().zip(weights).map(|(f, w)| f.l1_norm() / w).fold(0.0, f64::max)
        };
        let mut loads: Vec<(usize, f64)> =
            (0..self.basis.n_harmonics()).map(|k| (k, load(k))).filter(|(_, load)| *load > rounding).collect();
        if problem.linear.size() < problem.linear.full_size() && loads.len() > problem.basis.n_harmonics() {
            loads.sort_by(|a, b| b.1.total_cmp(&a.1));
            loads.truncate(problem.basis.n_harmonics());
        }
        loads.into_iter().map(|(k, _)| k).collect()
    }
}

/// The mean slope k + i w c of the laws, as the fastest term of a problem sees it.
struct MeanSlope {
    stiffness: Vec<f64>,
    damping: Vec<f64>,
}

impl MeanSlope {
    fn at(&self, entry: usize, w: f64) -> c64 {
        c64::new(self.stiffness[entry], w * self.damping[entry])
    }
}

fn mean_slope(problem: &Problem, jacobian: MatRef<'_, f64>) -> MeanSlope {
    let n = problem.n();
    let frequencies = problem.basis.frequencies(&problem.omega);
    let fastest = (0..frequencies.len()).max_by(|a, b| frequencies[*a].abs().total_cmp(&frequencies[*b].abs()));
    let Some(j) = fastest else {
        return MeanSlope { stiffness: vec![0.0; n * n], damping: vec![0.0; n * n] };
    };
    let (cos, sin, s) = ((2 * j + 1) * n, (2 * j + 2) * n, &problem.blocks()[j + 1].s);
    let entries = |of: &dyn Fn(usize, usize) -> f64| (0..n * n).map(|at| of(at / n, at % n)).collect::<Vec<f64>>();
    let stiffness =
        entries(&|i, l| 0.5 * (jacobian[(cos + i, cos + l)] + jacobian[(sin + i, sin + l)]) - s[i * n + l].re);
    let damping = entries(&|i, l| {
        (0.5 * (jacobian[(cos + i, sin + l)] - jacobian[(sin + i, cos + l)]) - s[i * n + l].im) / frequencies[j]
    });
    MeanSlope { stiffness, damping }
}
