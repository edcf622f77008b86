//! The cubic spring.
use super::law::{At, Law, Scalar};

/// k3 u^3
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Cubic;

impl Law for Cubic {
    fn with(n: usize) -> Option<Self> {
        (n == 1).then_some(Cubic)
    }

    fn n_params(&self) -> usize {
        1
    }

    fn force<D: Scalar>(&self, at: At<D>, p: &[D], _z: &[D], _after: &mut [D]) -> D {
        p[0] * at.u * at.u * at.u
    }

    fn degree(&self) -> Option<usize> {
        Some(3)
    }
}
