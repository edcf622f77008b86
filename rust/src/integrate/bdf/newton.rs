//! The equations of a step by Newton's method with factorisations that are kept.
use crate::error::{Error, Result};
use crate::linalg::kkt::Kkt;
use crate::run::Counts;
use crate::tolerances::constraints::CLOSED_ENOUGH;
use crate::tolerances::motion::{NEWTON_ITERATIONS, ROTATION_REPETITIONS};
use crate::tolerances::steps::{FIXED_SOLVED, SHARE_OF_TOLERANCE};

use super::super::{Equations, least_motion, scaled_size};
use super::{Ahead, Corrector, Trial};

/// A kept factorisation serves steps within this part of its own.
const NEAR: f64 = 0.25;
/// A kept factorisation with which more iterations than these are to be expected is renewed.
const PATIENCE: f64 = 4.0;

pub struct Newton {
    /// allowed remainder, in the units of the tolerance
    solved: f64,
    kept: Option<(f64, Kkt)>,
}

impl Newton {
    pub fn new(rtol: Option<f64>) -> Self {
        Newton { solved: rtol.map_or(FIXED_SOLVED, |r| SHARE_OF_TOLERANCE * r), kept: None }
    }

    /// As far as fixed steps are solved.
    pub fn until_rounding(self) -> Self {
        Newton { solved: self.solved.min(FIXED_SOLVED), ..self }
    }
}

impl Corrector for Newton {
    fn solve(&mut self, eq: &Equations<'_, f64>, ahead: &Ahead<'_>, counts: &mut Counts) -> Result<Trial> {
        let Ahead { guess, psi, from, c, t, .. } = ahead;
        let (c, t) = (*c, *t);
        let scales = eq.scales();
        let size = |v: &[f64]| scaled_size(v, &scales);
        let n = eq.n();
        let speed =
            size(&guess.v).max(size(&from.motion.rate)).max(c * size(&from.acceleration)).max(least_motion() / c);
        let (mut v, mut y, mut lam) = (guess.v.clone(), guess.y.clone(), from.lam.clone());
        if self.kept.as_ref().is_some_and(|(kept, _)| (kept / c - 1.0).abs() > NEAR) {
            self.kept = None;
        }
        let known: Vec<f64> = guess.y.iter().zip(&psi.y).map(|(g, p)| g - p).collect();
        let base = ahead.state_base();
        let at = |y: &[f64], v: &[f64]| {
            let mut m = ahead.chart.moved(eq.topology(), y);
            m.t = t;
            m.rate = v.to_vec();
            m.memory.clone_from(&from.motion.memory);
            eq.set_states(&mut m, &base, c);
            m
        };
        let mut last = f64::INFINITY;
        let mut fresh = false;
        for iteration in 1..=NEWTON_ITERATIONS {
            counts.add("iterations", 1);
            settle(eq, &known, c, &v, &mut y);
            let m = at(&y, &v);
            let a: Vec<f64> = (0..n).map(|i| (psi.v[i] + v[i] - guess.v[i]) / c).collect();
            let r = eq.residual(&m, &a, &lam, counts) * (c * c);
            let rates = eq.row_rates_sparse(&m) * c;
            if r.iter().chain(rates.iter()).any(|v| !v.is_finite()) {
                return Err(Error::Convergence {
                    message: format!("a force is not a number at t = {t:.9} s"),
                    best: Vec::new(),
                    residual: f64::NAN,
                });
            }
            if self.kept.is_none() {
                let (matrix, jacobian) = eq.iteration_matrices(&m, &a, &lam, (c, c * c), &Vec::new(), counts);
                self.kept = Some((c, Kkt::new(&matrix, &jacobian, &eq.rows, None)?));
                fresh = true;
            }
            let Some((_, saddle)) = &self.kept else { break };
            let (w, mu) = saddle.solve_one(&-r, &-rates)?;
            for (v, w) in v.iter_mut().zip(w.iter()) {
                *v += w / c;
            }
            for (l, d) in lam.iter_mut().zip(mu.iter()) {
                *l += d / (c * c);
            }
            let step = size(w.as_slice()).max(size(w.as_slice()) / (c * speed));
            let rate = step / last;
            let near = eq.correction_tells(fresh, iteration) && step <= 0.1 * self.solved
                || last.is_finite() && rate < 1.0 && step * rate / (1.0 - rate) <= self.solved;
            if near || last.is_finite() && fresh && rate > 0.3 && step < CLOSED_ENOUGH {
                settle(eq, &known, c, &v, &mut y);
                return Ok(Trial { motion: at(&y, &v), y, lam, unsolved: None });
            }
            if last.is_finite() && rate > 2.0 && fresh {
                break;
            }
            if last.is_finite() && !fresh && iteration as f64 + expected(step, rate, self.solved) > PATIENCE {
                self.kept = None;
            }
            last = step;
        }
        self.kept = None;
        Err(Error::Convergence {
            message: format!("the equations of a step to t = {t:.9} s did not converge"),
            best: Vec::new(),
            residual: last,
        })
    }

    fn reset(&mut self) {
        self.kept = None;
    }
}

/// theta = known + c J_l^-1(theta) v.
fn settle(eq: &Equations<'_, f64>, known: &[f64], c: f64, v: &[f64], y: &mut Vec<f64>) {
    for _ in 0..ROTATION_REPETITIONS {
        let slope = eq.increment_rates(y, v);
        let next: Vec<f64> = known.iter().zip(&slope).map(|(k, s)| k + c * s).collect();
        let turns = |(a, b): (&f64, &f64)| (a - b).abs() > 2.0 * f64::EPSILON * a.abs().max(b.abs());
        let settled = !next.iter().zip(y.iter()).any(turns);
        *y = next;
        if settled {
            return;
        }
    }
}

/// Iterations until the remainder falls below the goal, corrections shrinking as they did.
fn expected(step: f64, rate: f64, goal: f64) -> f64 {
    if rate < 1.0 { ((goal * (1.0 - rate) / step).ln() / rate.ln()).ceil().max(1.0) } else { f64::INFINITY }
}
