//! Generalised-alpha on the Lie group, index 3, scaled by the step.
//!
//! ```text
//! dq = h v0 + h^2 ((1/2 - beta) a0 + beta a1),   q1 = q0 exp(dq),   v1 = v0 + h ((1 - gamma) a0 + gamma a1)
//! (1 - alpha_m) a1 + alpha_m a0 = (1 - alpha_f) v1' + alpha_f v0'
//! M v1' + h(q1, v1) + J^T lam = 0,   Phi(q1) = 0      (rows on velocity level: J v1 + Phi_t = 0)
//! ```
//! after O. Bruels, A. Cardona, M. Arnold, Mechanism and Machine Theory 48 (2012) 121-137, with the parameters of J. Chung and
//! G. Hulbert (1993) from the spectral radius at infinity. Newton corrects w = d(dq) and h^2 lam, so that no entry of
//! [M + h g D + h^2 b K, J^T; J, 0] grows as h falls. Rates are projected at the end of every step, which takes the noise eps/h
//! out that index 3 leaves in them, and accelerations and multipliers of the output come from the equations at that instant.
use nalgebra::{DMatrix, DVector};

use crate::error::{Error, Result};
use crate::run::Counts;
use crate::system::topology::Level;

use super::saddle::Saddle;
use super::{Equations, Instant, LocalError, Motion, Scheme, Step};

const MAX_ITERATIONS: usize = 12;
/// A kept factorisation is renewed when the corrections shrink more slowly.
const SLOW: f64 = 0.1;
/// Corrections stop at this part of h^2 a: far below the error of the step.
const SOLVED: f64 = 1e-9;

#[derive(Debug, Clone, Copy)]
struct Parameters {
    am: f64,
    af: f64,
    beta: f64,
    gamma: f64,
}

impl Parameters {
    fn of(rho: f64) -> Self {
        let (am, af) = ((2.0 * rho - 1.0) / (rho + 1.0), rho / (rho + 1.0));
        let gamma = 0.5 + af - am;
        Parameters {
            am,
            af,
            beta: 0.25 * (gamma + 0.5) * (gamma + 0.5),
            gamma,
        }
    }

    /// d(dq)/dv' over h^2 and dv/dv' over h.
    fn slopes(&self) -> (f64, f64) {
        let f = (1.0 - self.af) / (1.0 - self.am);
        (self.beta * f, self.gamma * f)
    }
}

/// What the method carries from step to step besides the instant.
#[derive(Debug, Clone)]
struct Carried {
    t: f64,
    /// the algorithmic acceleration a
    a: Vec<f64>,
    /// v' of the equation in the step
    rate_slope: Vec<f64>,
    lam: Vec<f64>,
    /// change of a in the step that led here, over its length
    slope: Option<Vec<f64>>,
    h: f64,
}

pub struct GeneralizedAlpha {
    p: Parameters,
    carried: Option<Carried>,
    tried: Option<Carried>,
    kept: Option<(f64, Saddle)>,
}

/// An unknown end of a step.
struct Unknown {
    rate_slope: Vec<f64>,
    lam: Vec<f64>,
}

impl GeneralizedAlpha {
    /// `rho`: part of an infinitely fast oscillation that is left after a step, 0 to 1.
    pub fn new(rho: f64) -> Self {
        GeneralizedAlpha {
            p: Parameters::of(rho),
            carried: None,
            tried: None,
            kept: None,
        }
    }

    fn start(&self, from: &Instant) -> Carried {
        self.carried
            .clone()
            .filter(|c| c.t == from.motion.t)
            .unwrap_or_else(|| Carried {
                t: from.motion.t,
                a: from.acceleration.clone(),
                rate_slope: from.acceleration.clone(),
                lam: from.lam.clone(),
                slope: None,
                h: 0.0,
            })
    }

    /// Increment, motion and algorithmic acceleration that belong to a guess of v'.
    fn end(
        &self,
        eq: &Equations<'_, f64>,
        from: &Motion<f64>,
        c: &Carried,
        u: &Unknown,
        h: f64,
    ) -> (Vec<f64>, Motion<f64>, Vec<f64>) {
        let p = self.p;
        let n = eq.n();
        let a1: Vec<f64> = (0..n)
            .map(|i| {
                ((1.0 - p.af) * u.rate_slope[i] + p.af * c.rate_slope[i] - p.am * c.a[i])
                    / (1.0 - p.am)
            })
            .collect();
        let dq: Vec<f64> = (0..n)
            .map(|i| h * from.rate[i] + h * h * ((0.5 - p.beta) * c.a[i] + p.beta * a1[i]))
            .collect();
        let mut m = from.moved(eq.topology(), &dq);
        m.t = from.t + h;
        for i in 0..n {
            m.rate[i] += h * ((1.0 - p.gamma) * c.a[i] + p.gamma * a1[i]);
        }
        (dq, m, a1)
    }

    fn factor(
        &mut self,
        eq: &Equations<'_, f64>,
        m: &Motion<f64>,
        u: &Unknown,
        dq: &[f64],
        h: f64,
        counts: &mut Counts,
    ) -> Result<()> {
        let (b, g) = self.p.slopes();
        let tangent = eq.tangent(m, &u.rate_slope, &u.lam, counts);
        let turned = eq.turned_columns(&(tangent.stiffness * (h * h * b)), dq);
        let mut matrix = tangent.mass + turned;
        for d in [&tangent.damping, &tangent.gyroscopic]
            .into_iter()
            .flatten()
        {
            matrix += d * (h * g);
        }
        let jacobian = eq.turned_columns(&eq.rows(m).1, dq);
        counts.add("factorisations", 1);
        self.kept = Some((h, Saddle::new(&matrix, &jacobian)?));
        Ok(())
    }

    /// Rows whose zero the step demands, in lengths and angles.
    fn rows(&self, eq: &Equations<'_, f64>, m: &Motion<f64>, h: f64) -> DVector<f64> {
        let (b, g) = self.p.slopes();
        let (mut phi, jacobian) = eq.rows(m);
        if eq.topology().has_velocity_rows() {
            let rates = eq.row_rates_of(m, &jacobian);
            for (i, row) in eq.topology().rows.iter().enumerate() {
                if row.level == Level::Velocity {
                    phi[i] = rates[i] * h * b / g;
                }
            }
        }
        phi
    }

    fn solve(
        &mut self,
        eq: &Equations<'_, f64>,
        from: &Motion<f64>,
        c: &Carried,
        u: &mut Unknown,
        h: f64,
        counts: &mut Counts,
    ) -> Result<()> {
        let (b, _) = self.p.slopes();
        let scales = eq.scales();
        let size = |v: &[f64]| {
            v.iter()
                .zip(&scales)
                .fold(0.0_f64, |s, (v, c)| s.max((v / c).abs()))
        };
        let mut last = f64::INFINITY;
        // a factorisation of another step length is of no use
        if self
            .kept
            .as_ref()
            .is_some_and(|(kept, _)| (kept / h - 1.0).abs() > 0.2)
        {
            self.kept = None;
        }
        let mut renewed = false;
        for _ in 0..MAX_ITERATIONS {
            counts.add("iterations", 1);
            let (dq, m, _) = self.end(eq, from, c, u, h);
            let r = eq.residual(&m, &u.rate_slope, &u.lam, counts) * (h * h * b);
            let phi = self.rows(eq, &m, h);
            if r.iter().chain(phi.iter()).any(|v| !v.is_finite()) {
                return Err(lost(m.t));
            }
            if self.kept.is_none() {
                self.factor(eq, &m, u, &dq, h, counts)?;
                renewed = true;
            }
            let Some((_, saddle)) = &self.kept else { break };
            let (w, mu) = saddle.solve(&-r, &-phi)?;
            for (s, w) in u.rate_slope.iter_mut().zip(w.iter()) {
                *s += w / (h * h * b);
            }
            for (l, d) in u.lam.iter_mut().zip(mu.iter()) {
                *l += d / (h * h * b);
            }
            let step = size(w.as_slice());
            let goal = SOLVED * h * h * size(&u.rate_slope) + 4.0 * f64::EPSILON;
            let rate = step / last;
            // the first correction says nothing about how fast they shrink
            if step <= goal || last.is_finite() && rate < 1.0 && step * rate / (1.0 - rate) <= goal
            {
                return Ok(());
            }
            if rate > SLOW && !renewed {
                self.kept = None;
            } else if rate > 2.0 && last.is_finite() {
                break;
            } else if rate > 0.5 && step < 1e-13 {
                // rounding is reached
                return Ok(());
            }
            renewed = false;
            last = step;
        }
        self.kept = None;
        Err(Error::Convergence {
            message: format!("the equations of a step of {h:.2e} s did not converge"),
            best: Vec::new(),
            residual: last,
        })
    }

    /// Leading terms of the local error, from the change of a (C h^3 q''' in the increment, C' h^3 q'''' in the rate).
    fn estimate(&self, c: &Carried, a1: &[f64], h: f64) -> LocalError {
        let p = self.p;
        let shift = p.am - p.af;
        let position = shift / 2.0 + p.beta - 1.0 / 6.0;
        let rate = 0.5
            * ((1.0 - p.gamma) * shift * shift + p.gamma * (1.0 + shift) * (1.0 + shift))
            - 1.0 / 6.0;
        let slope = |i: usize| (a1[i] - c.a[i]) / h;
        let second = |i: usize| {
            c.slope
                .as_ref()
                .map_or(0.0, |s| 2.0 * (slope(i) - s[i]) / (h + c.h))
        };
        LocalError {
            position: (0..a1.len())
                .map(|i| position * h.powi(3) * slope(i))
                .collect(),
            rate: (0..a1.len())
                .map(|i| rate * h.powi(3) * second(i))
                .collect(),
        }
    }
}

fn lost(t: f64) -> Error {
    Error::Convergence {
        message: format!("a force is no number at t = {t:.9} s"),
        best: Vec::new(),
        residual: f64::NAN,
    }
}

impl Scheme for GeneralizedAlpha {
    fn order(&self) -> u32 {
        2
    }

    fn step(
        &mut self,
        eq: &Equations<'_, f64>,
        from: &Instant,
        h: f64,
        estimate: bool,
        counts: &mut Counts,
    ) -> Result<Step> {
        let c = self.start(from);
        let mut u = Unknown {
            rate_slope: c.rate_slope.clone(),
            lam: c.lam.clone(),
        };
        self.solve(eq, &from.motion, &c, &mut u, h, counts)?;
        let (_, m, a1) = self.end(eq, &from.motion, &c, &u, h);
        let error = estimate.then(|| self.estimate(&c, &a1, h));
        let end = eq.consistent(m, counts)?;
        let slope = Some((0..a1.len()).map(|i| (a1[i] - c.a[i]) / h).collect());
        self.tried = Some(Carried {
            t: end.motion.t,
            a: a1,
            rate_slope: u.rate_slope,
            lam: u.lam,
            slope,
            h,
        });
        Ok(Step { end, error })
    }

    fn accept(&mut self, _: &Equations<'_, f64>, _: &Instant, _: &Step, _: f64) {
        self.carried = self.tried.take();
    }

    fn reset(&mut self) {
        self.carried = None;
        self.kept = None;
    }
}

impl Equations<'_, f64> {
    /// X J_l(theta): columns of three rotations together, so that X acts on changes of an increment theta.
    pub fn turned_columns(&self, x: &DMatrix<f64>, theta: &[f64]) -> DMatrix<f64> {
        let mut out = x.clone();
        let n = self.n();
        for node in &self.topology().nodes {
            if node.n < 3
                || !matches!(
                    node.kind,
                    crate::model::joint::JointKind::Spherical
                        | crate::model::joint::JointKind::Free
                )
            {
                continue;
            }
            let first = node.first + node.n - 3;
            for k in 0..3 {
                let mut unit = vec![0.0; n];
                unit[first + k] = 1.0;
                let mapped = self.rates_of_increments(theta, &unit);
                for r in 0..x.nrows() {
                    out[(r, first + k)] =
                        (0..3).map(|l| x[(r, first + l)] * mapped[first + l]).sum();
                }
            }
        }
        out
    }
}
