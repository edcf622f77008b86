//! The numbers that a state is evaluated with.
use crate::spatial::Real;

/// The numbers of the model and what its laws remember.
#[derive(Debug, Clone, Copy)]
pub struct Numbers<'a, T: Real> {
    pub x: &'a [T],
    pub memory: &'a [T],
    /// s; linear analyses hold it at zero
    pub t: f64,
}
