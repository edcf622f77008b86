//! The nonlinear part of the oscillator of van der Pol.
use super::Scalar;

/// mu u^2 v
pub fn force<D: Scalar>(u: D, v: D, mu: D) -> D {
    mu * u * u * v
}
