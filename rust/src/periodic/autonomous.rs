//! Motions of which one frequency is their own, limit cycles and tori behind a Neimark-Sacker point: the frequency is unknown, and a
//! condition says where its phase begins.
use faer::prelude::*;

use super::aft::derivative;
use super::basis::Finer;
use super::problem::{Parameter, Problem};
use super::tail::Tail;
use crate::error::Result;
use crate::run::Cancel;
use crate::solve::newton::{self, Options, Outcome};
use crate::solve::{Curve, Linearisation, nan_or_largest};

/// Unknowns [y, omega_free]; the added equation is phase . y = 0.
pub struct Cycle<'a> {
    problem: &'a mut Problem,
    phase: Vec<f64>,
    inner: Linearisation,
}

impl<'a> Cycle<'a> {
    /// The phase of the motion y is held: changes are orthogonal to its derivative by the phase of the free frequency.
    pub fn new(problem: &'a mut Problem, y: &[f64], free: usize) -> Cycle<'a> {
        problem.parameter = Parameter::Omega(free);
        let mut phase = rate(problem, y, free);
        let size = phase.iter().fold(0.0_f64, |a, b| a.max(b.abs()));
        phase.iter_mut().for_each(|p| *p /= size);
        let inner = Linearisation::new(y.len());
        Cycle { problem, phase, inner }
    }
}

/// Coefficients of dx/dtau_i for those of x: the direction in which the phase of frequency i changes.
pub fn rate(problem: &Problem, y: &[f64], frequency: usize) -> Vec<f64> {
    let (n, n_c) = (problem.n(), problem.basis.n_coefficients());
    let harmonics = problem.basis.slope(frequency);
    let mut out = vec![0.0; y.len()];
    let mut rate = vec![0.0; n_c];
    for i in 0..n {
        let own: Vec<f64> = y.iter().skip(i).step_by(n).copied().collect();
        derivative(&own, &harmonics, &mut rate);
        for (c, r) in rate.iter().enumerate() {
            out[c * n + i] = *r;
        }
    }
    out
}

impl Curve for Cycle<'_> {
    fn size(&self) -> usize {
        self.phase.len() + 1
    }

    fn linearise(&mut self, z: &[f64], _: f64, out: &mut Linearisation) -> Result<()> {
        let n = self.phase.len();
        self.problem.linearise(&z[..n], z[n], &mut self.inner)?;
        out.residual[..n].copy_from_slice(&self.inner.residual);
        out.residual[n] = self.phase.iter().zip(z).map(|(p, y)| p * y).sum();
        out.jacobian.as_mut().submatrix_mut(0, 0, n, n).copy_from(&self.inner.jacobian);
        for i in 0..n {
            out.jacobian[(i, n)] = self.inner.slope[i];
            out.jacobian[(n, i)] = self.phase[i];
        }
        out.jacobian[(n, n)] = 0.0;
        Ok(())
    }

    fn row_excess(&mut self, z: &[f64], _: f64, tolerance: f64) -> Result<f64> {
        let n = self.phase.len();
        self.problem.row_excess(&z[..n], z[n], tolerance)
    }

    fn scale(&self, z: &[f64], out: &mut [f64]) {
        let n = self.phase.len();
        self.problem.scale(&z[..n], &mut out[..n]);
        out[n] = z[n].abs().max(f64::MIN_POSITIVE);
    }
}

/// Newton's method from z = [y, omega_free], which ends as the motion.
pub fn solve(problem: &mut Problem, z: &mut [f64], free: usize, options: Options, cancel: &Cancel) -> Result<Outcome> {
    let n = z.len() - 1;
    let mut cycle = Cycle::new(problem, &z[..n], free);
    let mut out = Linearisation::new(z.len());
    newton::solve(&mut cycle, z, 0.0, options, &mut out, cancel)
}

/// Relative error of the coefficients and of the frequency: one Newton step with more terms and samples, and one by what rounding of the
/// equations may change.
pub fn estimate(problem: &Problem, z: &[f64], free: usize, finer: &Finer) -> Result<f64> {
    let n = z.len() - 1;
    let mut larger = problem.on(problem.basis.extended(&finer.extra), &finer.dims)?;
    let mut tail = Tail::new(&mut larger);
    let size = larger.size();
    let mut extended = vec![0.0; size + 1];
    extended[..n].copy_from_slice(&z[..n]);
    extended[size] = z[n];
    let mut cycle = Cycle::new(&mut larger, &extended[..size], free);
    let mut out = Linearisation::new(size + 1);
    cycle.linearise(&extended, 0.0, &mut out)?;
    let rounding = cycle.problem.row_rounding(&extended[..size]);
    let mut step = faer::Mat::from_fn(size + 1, 2, |i, column| match column {
        0 => out.residual[i],
        _ => rounding.get(i).copied().unwrap_or(0.0),
    });
    out.jacobian.partial_piv_lu().solve_in_place(&mut step);
    let weights = problem.weights();
    let weight = |i: usize| weights[i % weights.len()];
    let largest = nan_or_largest((0..n).map(|i| (z[i] * weight(i)).abs()));
    let change = |column: usize| {
        let coefficients = (0..size).map(|i| (step[(i, column)] * weight(i)).powi(2)).sum::<f64>().sqrt();
        coefficients / largest + (step[(size, column)] / z[n]).abs()
    };
    let Cycle { problem: larger, inner, .. } = cycle;
    let beyond = tail.amplitudes(larger, inner.jacobian.as_ref(), &weights)?;
    let left_out = nan_or_largest(beyond.iter().zip(&weights).map(|(amplitude, w)| amplitude * w)) / largest;
    Ok(change(0) + change(1) + left_out)
}
