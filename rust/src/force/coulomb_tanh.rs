//! Friction without memory.
use super::law::{At, Class, Crossing, Law, Scalar, Stored, Surface};

/// limit tanh(v / v_ref); parameters limit, v_ref. Written with expm1 of a negative number: sinh/cosh, which duals use, overflows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct CoulombTanh;

impl Law for CoulombTanh {
    fn with(n: usize) -> Option<Self> {
        (n == 2).then_some(CoulombTanh)
    }

    fn n_params(&self) -> usize {
        2
    }

    fn force<D: Scalar>(&self, at: At<D>, p: &[D], _z: &[D], _after: &mut [D]) -> D {
        let x = at.v / p[1];
        let positive = x.re() >= 0.0;
        let y = if positive { x } else { -x } * -2.0;
        let t = -y.exp_m1() / (y.exp() + 1.0);
        p[0] * if positive { t } else { -t }
    }

    fn uses_velocity(&self) -> bool {
        true
    }

    fn class(&self) -> Class {
        Class::Friction
    }

    fn stored(&self, _u: f64, _p: &[f64], _z: &[f64]) -> Stored {
        Stored::Energy(0.0)
    }

    fn surfaces(&self, p: &[f64]) -> Vec<Surface> {
        vec![Surface { crossing: Crossing::Rate, at: 0.0, width: p[1], kink: true }]
    }
}
