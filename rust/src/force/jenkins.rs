//! A spring in series with a slider: the element of Jenkins.
use super::law::{At, Class, Law, Scalar, State};

/// k (u - z) while it does not exceed `slip`; beyond, the slider at z follows. Parameters k, slip.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Jenkins;

impl Law for Jenkins {
    fn with(n: usize) -> Option<Self> {
        (n == 2).then_some(Jenkins)
    }

    fn n_params(&self) -> usize {
        2
    }

    fn force<D: Scalar>(&self, at: At<D>, p: &[D], z: &[D], after: &mut [D]) -> D {
        let (k, slip) = (p[0], p[1]);
        let trial = k * (at.u - z[0]);
        if trial.re().abs() <= slip.re() {
            after[0] = z[0];
            return trial;
        }
        let force = if trial.re() > 0.0 { slip } else { -slip };
        after[0] = at.u - force / k;
        force
    }

    fn state(&self) -> State {
        State::Map(1)
    }

    fn class(&self) -> Class {
        Class::Friction
    }
}
