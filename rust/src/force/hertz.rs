//! Contact after Hertz.
use super::law::{At, Class, Law, Scalar, Surface};

/// k max(u - gap, 0)^exponent; parameters k, exponent, gap.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Hertz;

impl Law for Hertz {
    fn with(n: usize) -> Option<Self> {
        (n == 3).then_some(Hertz)
    }

    fn n_params(&self) -> usize {
        3
    }

    fn force<D: Scalar>(&self, at: At<D>, p: &[D], _z: &[D], _after: &mut [D]) -> D {
        let d = at.u - p[2];
        if d.re() > 0.0 { p[0] * d.powd(p[1]) } else { D::from(0.0) }
    }

    fn class(&self) -> Class {
        Class::Contact
    }

    fn surfaces(&self, p: &[f64]) -> Vec<Surface> {
        // a power above one closes with a continuous slope
        vec![Surface::kink(p[2], if p[1] > 1.0 { f64::INFINITY } else { 0.0 })]
    }
}
