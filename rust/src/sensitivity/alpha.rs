//! A step of generalised-alpha as equations to be differentiated.
//!
//! ```text
//! h^2 b r(q1, v*, s1, lam) = 0,  Phi(q1) = 0 (rows on velocity level: h b/g (J v* + Phi_t) = 0)      for s1 = v' and lam
//! M (v1 - v*) + J^T kappa = 0,  J v1 + Phi_t = 0;   M a + h + J^T lam = 0,  J a + gamma = 0        at q1
//! ```
//! with q1, v*, a1 of a0, s0, s1 as in `generalized_alpha::reached`. The closing after a step moves by rounding only: the step has
//! closed its rows, so that the derivative of the closing is none.
use nalgebra::{DMatrix, DVector};
use num_dual::Dual64;

use crate::error::{Error, Result};
use crate::integrate::ali3p::{Linear, closure_by, lifted};
use crate::integrate::generalized_alpha::{Carried, Parameters, reached};
use crate::integrate::{Equations, Motion};
use crate::linalg::kkt::Kkt;
use crate::linalg::matrix::turn_columns;
use crate::multibody::topology::Level;
use crate::run::Counts;
use crate::spatial::Real;

use super::closing::Aligned;
use super::march::Here;

/// What a scheme carries, over T.
#[derive(Clone)]
pub struct Load<T> {
    pub a: Vec<T>,
    pub rate_slope: Vec<T>,
    /// change of the acceleration in the last step over its length; empty before the first
    pub slope: Vec<T>,
    pub h: f64,
}

impl Load<f64> {
    pub fn of(c: &Carried) -> Self {
        Load { a: c.a.clone(), rate_slope: c.rate_slope.clone(), slope: c.slope.clone().unwrap_or_default(), h: c.h }
    }
}

impl<T: Real> Load<T> {
    /// How a follows the slope where the step changes.
    pub fn shift(&self, p: Parameters, h: f64) -> f64 {
        (p.am - p.af) * (h - self.h)
    }

    /// a at the start of a step of length h.
    pub fn shifted(&self, p: Parameters, h: f64) -> Vec<T> {
        let shift = self.shift(p, h);
        let mut a = self.a.clone();
        for (a, s) in a.iter_mut().zip(&self.slope) {
            *a += *s * shift;
        }
        a
    }
}

/// What keeps the loops closed, in the units of the step.
pub fn closure<T: Real>(eq: &Equations<'_, T>, p: Parameters, m: &Motion<T>, h: f64) -> DVector<T> {
    let (b, g) = p.slopes();
    closure_by(eq, m, h * b / g)
}

/// The step at its solution: matrices factorised.
pub struct Solved {
    pub step: Kkt,
    /// how v* became v1
    pub end: Aligned,
    pub s1: Vec<f64>,
    pub lam: Vec<f64>,
    pub linear: Linear,
}

fn lost() -> Error {
    Error::model("a step of generalised-alpha was not kept")
}

impl Solved {
    pub fn new(
        eq: &Equations<'_, f64>,
        p: Parameters,
        from: &Here,
        end: &Here,
        h: f64,
        counts: &mut Counts,
    ) -> Result<Self> {
        let (b, g) = p.slopes();
        let before = Load::of(from.carried.as_ref().ok_or_else(lost)?);
        let after = end.carried.as_ref().ok_or_else(lost)?;
        let (s1, lam) = (after.rate_slope.clone(), after.lam.clone());
        let a0 = before.shifted(p, h);
        let start = &from.instant.motion;
        let (dq, m, _) = reached(eq, p, start, (&a0, &before.rate_slope, &s1), h);
        let linear = eq.linearised(&m, &s1, &lam, h * b / g, counts).2;
        let maps = eq.step_maps(&dq, &start.rate, h, g / (h * b));
        let mut matrix = linear.combined(h * g, 0.0);
        let mut stiffness = &linear.tangent.stiffness * (h * h * b);
        turn_columns(&mut stiffness, &maps);
        matrix += stiffness;
        let jacobian = &linear.jacobian;
        let mut right = jacobian.clone();
        turn_columns(&mut right, &maps);
        if eq.topology().has_velocity_rows() {
            velocity_row_slopes(eq, p, start, (&a0, &before.rate_slope, &s1), h, &mut right);
        }
        counts.add("factorisations", 2);
        let step = eq.kkt_of(&matrix, jacobian, &right)?;
        let there = Motion { memory: start.memory.clone(), ..end.instant.motion.clone() };
        let end = Aligned::new(eq, &there, &m.rate)?;
        Ok(Solved { step, end, s1, lam, linear })
    }
}

/// Rows of velocity level: derivative of h b/g (J v*) by w = h^2 b s1, column by column with a dual number.
fn velocity_row_slopes(
    eq: &Equations<'_, f64>,
    p: Parameters,
    from: &Motion<f64>,
    (a0, s0, s1): (&[f64], &[f64], &[f64]),
    h: f64,
    right: &mut DMatrix<f64>,
) {
    let dual = lifted(eq);
    let lift = |v: &[f64]| v.iter().map(|x| Dual64::from(*x)).collect::<Vec<_>>();
    let start = Motion { t: from.t, q: lift(&from.q), rate: lift(&from.rate), memory: lift(&from.memory) };
    let (a0, s0) = (lift(a0), lift(s0));
    for j in 0..s1.len() {
        let mut s1 = lift(s1);
        s1[j].eps = 1.0 / (h * h * p.slopes().0);
        let (_, m, _) = reached(&dual, p, &start, (&a0, &s0, &s1), h);
        let rates = closure(&dual, p, &m, h);
        for (i, row) in eq.topology().rows.iter().enumerate() {
            if row.level == Level::Velocity {
                right[(i, j)] = rates[i].eps;
            }
        }
    }
}
