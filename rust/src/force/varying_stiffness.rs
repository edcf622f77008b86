//! A stiffness that follows the phase of the excitation (parametric excitation).
use super::law::{At, Law, Scalar, Stored};

/// k cos(order phase + offset) u; parameters k, order, offset.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct VaryingStiffness;

impl Law for VaryingStiffness {
    fn with(n: usize) -> Option<Self> {
        (n == 3).then_some(VaryingStiffness)
    }

    fn n_params(&self) -> usize {
        3
    }

    fn force<D: Scalar>(&self, at: At<D>, p: &[D], _z: &[D], _after: &mut [D]) -> D {
        p[0] * (p[1] * at.phase + p[2]).cos() * at.u
    }

    fn degree(&self) -> Option<usize> {
        Some(1)
    }

    fn stored(&self, _u: f64, _p: &[f64], _z: &[f64]) -> Stored {
        Stored::Unknown
    }
}
