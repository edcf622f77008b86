//! The nonlinear part of the oscillator of van der Pol.
use super::law::{At, Law, Scalar};

/// mu u^2 v
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct VanDerPol;

impl Law for VanDerPol {
    fn with(n: usize) -> Option<Self> {
        (n == 1).then_some(VanDerPol)
    }

    fn n_params(&self) -> usize {
        1
    }

    fn force<D: Scalar>(&self, at: At<D>, p: &[D], _z: &[D], _after: &mut [D]) -> D {
        p[0] * at.u * at.u * at.v
    }

    fn uses_velocity(&self) -> bool {
        true
    }

    fn degree(&self) -> Option<usize> {
        Some(3)
    }
}
