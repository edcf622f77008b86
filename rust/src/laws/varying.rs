//! A stiffness that follows the phase of the excitation (parametric excitation).
use super::Scalar;

/// k cos(order tau + phase) u
pub fn force<D: Scalar>(tau: f64, u: D, k: D, order: D, phase: D) -> D {
    k * (order * tau + phase).cos() * u
}
