//! Generalised-alpha on the Lie group, index 3, scaled by the step.
//!
//! ```text
//! dq = h v0 + h^2 ((1/2 - beta) a0 + beta a1) - h^2/12 v0 x v1,   q1 = q0 exp(dq),   v1 = v0 + h ((1 - gamma) a0 + gamma a1)
//! (1 - alpha_m) a1 + alpha_m a0 = (1 - alpha_f) v1' + alpha_f v0'
//! M v1' + h(q1, v1) + J^T lam = 0,   Phi(q1) = 0      (rows on velocity level: J v1 + Phi_t = 0)
//! ```
//! after O. Bruels, A. Cardona, M. Arnold, Mechanism and Machine Theory 48 (2012) 121-137, with the parameters of J. Chung and
//! G. Hulbert (1993) from the spectral radius at infinity. The product v0 x v1, of three rotations that act together, is the
//! commutator that the rotation vector of a step has beside the integral of its rate (`rotations`): without it the error of a fast
//! top is twenty times larger. Newton corrects w = h^2 b dv' and h^2 lam, so that no entry of [M + h g D + h^2 b K, J^T; J, 0] grows
//! as h falls. Rates are projected at the end of every step, which takes the noise eps/h
//! out that index 3 leaves in them, and accelerations and multipliers of the output come from the equations at that instant.
use nalgebra::DVector;

use crate::error::{Error, Result};
use crate::multibody::topology::Level;
use crate::run::Counts;
use crate::spatial::Real;

use super::{Equations, Instant, LocalError, Motion, Scheme, Step, scaled_size};
use crate::linalg::kkt::Kkt;
use crate::multibody::rotations::add_turning;
use crate::tolerances::steps::{QUADRATIC, SLOW};

/// In a singular pose Newton's method gains one bit at a time.
const MAX_ITERATIONS: usize = 50;
/// Accelerations of an instant that change so much more than those of the scheme are not decided by the pose.
const SINGULAR: f64 = 30.0;
/// Part of a step after which the first rate of the acceleration is taken.
const AHEAD: f64 = 1e-2;
/// Rounding of the equations of a step, over the rounding of its pose: near singular poses rows lose digits.
const NOISE: f64 = 512.0;

#[derive(Debug, Clone, Copy)]
pub struct Parameters {
    pub am: f64,
    pub af: f64,
    pub beta: f64,
    pub gamma: f64,
}

impl Parameters {
    pub fn of(rho: f64) -> Self {
        let (am, af) = ((2.0 * rho - 1.0) / (rho + 1.0), rho / (rho + 1.0));
        let gamma = 0.5 + af - am;
        Parameters { am, af, beta: 0.25 * (gamma + 0.5) * (gamma + 0.5), gamma }
    }

    /// d(dq)/dv' over h^2 and dv/dv' over h.
    pub fn slopes(&self) -> (f64, f64) {
        let f = (1.0 - self.af) / (1.0 - self.am);
        (self.beta * f, self.gamma * f)
    }
}

/// What the method carries from step to step besides the instant.
#[derive(Debug, Clone)]
pub struct Carried {
    pub t: f64,
    /// the algorithmic acceleration a
    pub a: Vec<f64>,
    /// v' of the equation in the step
    pub rate_slope: Vec<f64>,
    pub lam: Vec<f64>,
    /// change of a in the step that led here, over its length
    pub slope: Option<Vec<f64>>,
    pub h: f64,
}

/// Increment, motion and algorithmic acceleration that belong to v' = s1 at the end of a step; a0 and s0: a and v' at its start.
pub fn reached<T: Real>(
    eq: &Equations<'_, T>,
    p: Parameters,
    from: &Motion<T>,
    (a0, s0, s1): (&[T], &[T], &[T]),
    h: f64,
) -> (Vec<T>, Motion<T>, Vec<T>) {
    let n = eq.n();
    let a1: Vec<T> = (0..n).map(|i| (s1[i] * (1.0 - p.af) + s0[i] * p.af - a0[i] * p.am) / (1.0 - p.am)).collect();
    let mut dq: Vec<T> =
        (0..n).map(|i| from.rate[i] * h + (a0[i] * (0.5 - p.beta) + a1[i] * p.beta) * (h * h)).collect();
    let rate: Vec<T> = (0..n).map(|i| from.rate[i] + (a0[i] * (1.0 - p.gamma) + a1[i] * p.gamma) * h).collect();
    add_turning(eq.topology(), h, (&from.rate, &rate), &mut dq);
    let mut m = from.moved(eq.topology(), &dq);
    m.t = from.t + h;
    m.rate = rate;
    (dq, m, a1)
}

pub struct GeneralizedAlpha {
    p: Parameters,
    /// part of h^2 a at which Newton's method stops; zero: at rounding
    solved: f64,
    carried: Option<Carried>,
    tried: Option<Carried>,
    kept: Option<(f64, Kkt)>,
    error: Option<LocalError>,
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
            solved: QUADRATIC,
            carried: None,
            tried: None,
            kept: None,
            error: None,
        }
    }

    /// Corrections go on to rounding: derivatives are those of a step that is solved.
    pub fn to_rounding(rho: f64) -> Self {
        GeneralizedAlpha { solved: 0.0, ..Self::new(rho) }
    }

    /// What it carries from the last accepted step.
    pub fn carried(&self) -> Option<&Carried> {
        self.carried.as_ref()
    }

    /// Go on from a step that was accepted before, factorisations forgotten.
    pub fn resume(&mut self, carried: Option<Carried>) {
        self.carried = carried;
        self.kept = None;
    }

    /// a is the acceleration at t + (alpha_m - alpha_f) h: it is shifted when the step changes, and at the start.
    fn start(
        &self,
        eq: &Equations<'_, f64>,
        from: &Instant,
        h: f64,
        estimate: bool,
        counts: &mut Counts,
    ) -> Result<Carried> {
        let shift = self.p.am - self.p.af;
        let mut c = match self.carried.clone().filter(|c| c.t == from.motion.t) {
            Some(c) => c,
            None => Carried {
                t: from.motion.t,
                a: from.acceleration.clone(),
                rate_slope: from.acceleration.clone(),
                lam: from.lam.clone(),
                slope: if estimate { Some(self.jerk(eq, from, h, counts)?) } else { None },
                h: 0.0,
            },
        };
        if let Some(slope) = &c.slope {
            for (a, s) in c.a.iter_mut().zip(slope) {
                *a += shift * (h - c.h) * s;
            }
        }
        Ok(c)
    }

    /// The rate of the acceleration, from the instant a small part of a step later.
    fn jerk(&self, eq: &Equations<'_, f64>, from: &Instant, h: f64, counts: &mut Counts) -> Result<Vec<f64>> {
        let d = AHEAD * h;
        let mut m = eq.opened(from, d).motion.clone();
        let increment: Vec<f64> =
            (from.motion.rate.iter().zip(&from.acceleration)).map(|(v, a)| d * (v + 0.5 * d * a)).collect();
        m = m.moved(eq.topology(), &increment);
        m.t += d;
        for (v, a) in m.rate.iter_mut().zip(&from.acceleration) {
            *v += d * a;
        }
        let ahead = eq.consistent(m, counts)?;
        Ok((ahead.acceleration.iter().zip(&from.acceleration)).map(|(a, b)| (a - b) / d).collect())
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
        let steps = (c.a.as_slice(), &c.rate_slope[..], &u.rate_slope[..]);
        reached(eq, self.p, from, steps, h)
    }

    #[allow(clippy::too_many_arguments)]
    fn factor(
        &mut self,
        eq: &Equations<'_, f64>,
        from: &Motion<f64>,
        m: &Motion<f64>,
        u: &Unknown,
        dq: &[f64],
        h: f64,
        counts: &mut Counts,
    ) -> Result<()> {
        let (b, g) = self.p.slopes();
        let factors = (h * g, h * h * b);
        let maps = eq.step_maps(dq, &from.rate, h, g / (h * b));
        let (matrix, jacobian) = eq.iteration_matrices(m, &u.rate_slope, &u.lam, factors, &maps, counts);
        self.kept = Some((h, Kkt::new(&matrix, &jacobian, &eq.rows, None)?));
        Ok(())
    }

    /// Rows whose zero the step demands, in lengths and angles.
    fn rows(&self, eq: &Equations<'_, f64>, m: &Motion<f64>, h: f64) -> DVector<f64> {
        let (b, g) = self.p.slopes();
        let (mut phi, jacobian) = eq.row_matrix(m);
        if eq.topology().has_velocity_rows() {
            let rates = jacobian.times(&m.rate) + eq.explicit_rates(m).0;
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
        let size = |v: &[f64]| scaled_size(v, &scales);
        let mut last = f64::INFINITY;
        let mut fresh = false;
        // a factorisation of another step length is of no use
        if self.kept.as_ref().is_some_and(|(kept, _)| (kept / h - 1.0).abs() > 0.2) {
            self.kept = None;
        }
        for _ in 0..MAX_ITERATIONS {
            counts.add("iterations", 1);
            let (dq, m, _) = self.end(eq, from, c, u, h);
            let r = eq.residual(&m, &u.rate_slope, &u.lam, counts) * (h * h * b);
            let phi = self.rows(eq, &m, h);
            if r.iter().chain(phi.iter()).any(|v| !v.is_finite()) {
                return Err(lost(m.t));
            }
            if self.kept.is_none() {
                self.factor(eq, from, &m, u, &dq, h, counts)?;
                fresh = true;
            }
            let Some((_, saddle)) = &self.kept else { break };
            let (w, mu) = saddle.solve_one(&-r, &-phi)?;
            for (s, w) in u.rate_slope.iter_mut().zip(w.iter()) {
                *s += w / (h * h * b);
            }
            for (l, d) in u.lam.iter_mut().zip(mu.iter()) {
                *l += d / (h * h * b);
            }
            let step = size(w.as_slice());
            let moved = h * h * size(&u.rate_slope).max(size(&c.rate_slope));
            let goal = self.solved * moved;
            let rate = step / last;
            // the first correction says nothing about how fast they shrink
            if step <= goal || last.is_finite() && rate < 1.0 && step * rate / (1.0 - rate) <= goal {
                return Ok(());
            }
            // rows are no more exact than the pose; corrections that an own factorisation does not shrink are rounding
            let pose = eq.rounding(&m);
            let noise = 4.0 * (f64::EPSILON * moved + if eq.constrained() { pose } else { 0.0 });
            if last.is_finite() && step <= noise || fresh && rate > 0.5 && step < (NOISE * pose).max(QUADRATIC * moved)
            {
                return Ok(());
            }
            if rate > SLOW {
                self.kept = None;
                fresh = false;
            }
            if rate > 1e3 && last.is_finite() {
                break;
            }
            last = step;
        }
        self.kept = None;
        Err(Error::Convergence {
            message: format!("the equations of a step of {h:.2e} s did not converge"),
            best: Vec::new(),
            residual: last,
        })
    }

    /// Leading terms of the local error, C h^3 q''' in the increment and C' h^3 q'''' in the rate. The accelerations of the instants
    /// are taken for it: those of the scheme carry the noise of index 3 along the constraints.
    fn estimate(&self, eq: &Equations<'_, f64>, c: &Carried, a1: &[f64], slope: &[f64], h: f64) -> LocalError {
        let own: Vec<f64> = a1.iter().zip(&c.a).map(|(a, b)| (a - b) / h).collect();
        let scales = eq.scales();
        let size = |v: &[f64]| scaled_size(v, &scales);
        // in a singular pose those of the instant are undecided, and those of the scheme go on
        let singular = size(slope) > SINGULAR * size(&own);
        let slope = if singular { &own } else { slope };
        let p = self.p;
        let shift = p.am - p.af;
        let position = shift / 2.0 + p.beta - 1.0 / 6.0;
        let rate = 0.5 * ((1.0 - p.gamma) * shift * shift + p.gamma * (1.0 + shift) * (1.0 + shift)) - 1.0 / 6.0;
        let second =
            |i: usize| c.slope.as_ref().filter(|_| !singular).map_or(0.0, |s| 2.0 * (slope[i] - s[i]) / (h + c.h));
        let third = h.powi(3);
        LocalError {
            position: slope.iter().map(|s| position * third * s).collect(),
            rate: (0..slope.len()).map(|i| rate * third * second(i)).collect(),
            state: Vec::new(),
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
        let c = self.start(eq, from, h, estimate, counts)?;
        let start = &from.motion;
        let from = &*eq.opened(from, h);
        let mut u = Unknown { rate_slope: c.rate_slope.clone(), lam: c.lam.clone() };
        self.solve(eq, &from.motion, &c, &mut u, h, counts)?;
        let (_, m, a1) = self.end(eq, &from.motion, &c, &u, h);
        let rate = m.rate.clone();
        let end = eq.consistent(m, counts)?;
        if estimate {
            eq.same_branch(&rate, &end, h)?;
        }
        let slope: Vec<f64> = (end.acceleration.iter().zip(&from.acceleration)).map(|(a, b)| (a - b) / h).collect();
        let mut error = estimate.then(|| self.estimate(eq, &c, &a1, &slope, h));
        if let Some(error) = &mut error {
            error.state = eq.state_error(start, &end.motion, h);
        }
        self.error.clone_from(&error);
        self.tried =
            Some(Carried { t: end.motion.t, a: a1, rate_slope: u.rate_slope, lam: u.lam, slope: Some(slope), h });
        Ok(Step { end, error })
    }

    fn accept(&mut self, _: &Equations<'_, f64>, _: &Instant, step: &Step, _: f64) {
        // the driver may have rounded the time to an output or the end
        self.carried = self.tried.take().map(|c| Carried { t: step.end.motion.t, ..c });
    }

    /// A new step costs a factorisation: only for a gain.
    fn proposal(&mut self, size: &dyn Fn(&LocalError) -> f64) -> Option<f64> {
        let error = self.error.take()?;
        let factor = (0.85 / size(&error).max(f64::MIN_POSITIVE).sqrt()).clamp(0.2, 2.0);
        Some(if (0.95..1.2).contains(&factor) { 1.0 } else { factor })
    }

    fn per_unit_step(&self) -> bool {
        true
    }

    fn reset(&mut self) {
        self.carried = None;
        self.kept = None;
    }
}
