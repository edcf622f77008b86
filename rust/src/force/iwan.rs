//! Parallel elements of Jenkins: the model of Iwan.
use super::jenkins::Jenkins;
use super::law::{At, Class, Law, Scalar, State};

/// sum k_i (u - z_i), each within +- f_i; parameters k_1 f_1 k_2 f_2 ...
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Iwan {
    n: usize,
}

impl Law for Iwan {
    fn with(n: usize) -> Option<Self> {
        (n > 0 && n.is_multiple_of(2)).then_some(Iwan { n: n / 2 })
    }

    fn n_params(&self) -> usize {
        2 * self.n
    }

    fn force<D: Scalar>(&self, at: At<D>, p: &[D], z: &[D], after: &mut [D]) -> D {
        let sliders = p.chunks_exact(2).zip(z.chunks_exact(1)).zip(after.chunks_exact_mut(1));
        sliders.fold(D::from(0.0), |sum, ((p, z), after)| sum + Jenkins.force(at, p, z, after))
    }

    fn state(&self) -> State {
        State::Map(self.n)
    }

    fn parallel(&self) -> usize {
        self.n
    }

    fn class(&self) -> Class {
        Class::Friction
    }
}
