//! Polynomials in displacement or rate.
use super::Scalar;

/// k3 u^3
pub fn cubic<D: Scalar>(u: D, k3: D) -> D {
    k3 * u * u * u
}

/// c_0 + c_1 x + c_2 x^2 + ...
pub fn horner<D: Scalar>(x: D, c: &[D]) -> D {
    c.iter().rev().fold(D::from(0.0), |sum, &c| sum * x + c)
}
