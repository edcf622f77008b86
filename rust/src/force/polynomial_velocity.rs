//! A polynomial spring and damper.
use super::law::{At, Law, Scalar};
use super::polynomial::horner;

/// sum c_i u^i + sum d_i v^i; parameters c_0 ... c_m d_0 ... d_m.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PolynomialVelocity {
    /// coefficients of each polynomial
    n: usize,
}

impl Law for PolynomialVelocity {
    fn with(n: usize) -> Option<Self> {
        (n > 0 && n.is_multiple_of(2)).then_some(PolynomialVelocity { n: n / 2 })
    }

    fn n_params(&self) -> usize {
        2 * self.n
    }

    fn force<D: Scalar>(&self, at: At<D>, p: &[D], _z: &[D], _after: &mut [D]) -> D {
        horner(at.u, &p[..self.n]) + horner(at.v, &p[self.n..])
    }

    fn uses_velocity(&self) -> bool {
        true
    }

    fn degree(&self) -> Option<usize> {
        Some(self.n - 1)
    }
}
