//! A polynomial spring.
use super::law::{At, Law, Scalar};

/// c_0 + c_1 u + c_2 u^2 + ...; parameters c_0, c_1, ...
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Polynomial {
    n: usize,
}

/// c_0 + c_1 x + c_2 x^2 + ...
pub fn horner<D: Scalar>(x: D, c: &[D]) -> D {
    c.iter().rev().fold(D::from(0.0), |sum, &c| sum * x + c)
}

impl Law for Polynomial {
    fn with(n: usize) -> Option<Self> {
        (n > 0).then_some(Polynomial { n })
    }

    fn n_params(&self) -> usize {
        self.n
    }

    fn force<D: Scalar>(&self, at: At<D>, p: &[D], _z: &[D], _after: &mut [D]) -> D {
        horner(at.u, p)
    }

    fn degree(&self) -> Option<usize> {
        Some(self.n - 1)
    }
}
