//! Parallel elements of Jenkins: the model of Iwan.
use super::jenkins::Jenkins;
use super::law::{At, Class, Law, Scalar, Slider, State};

/// sum k_i (u - z_i), each within +- f_i; parameters k_1 f_1 k_2 f_2 ...
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Iwan {
    n: usize,
    held: [Slider; MOST_HELD],
}

/// So many sliders can be held.
const MOST_HELD: usize = 32;

impl Law for Iwan {
    fn with(n: usize) -> Option<Self> {
        (n > 0 && n.is_multiple_of(2)).then_some(Iwan { n: n / 2, held: [Slider::Free; MOST_HELD] })
    }

    fn n_params(&self) -> usize {
        2 * self.n
    }

    fn force<D: Scalar>(&self, at: At<D>, p: &[D], z: &[D], after: &mut [D]) -> D {
        let states = z.chunks_exact(1).zip(after.chunks_exact_mut(1));
        let held = self.held.iter().chain(std::iter::repeat(&Slider::Free));
        let sliders = p.chunks_exact(2).zip(held).zip(states);
        sliders.fold(D::from(0.0), |sum, ((p, held), (z, after))| {
            sum + Jenkins::default().sliding(&[*held]).force(at, p, z, after)
        })
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

    fn sliders(&self, p: &[f64]) -> Vec<f64> {
        if self.n > MOST_HELD { Vec::new() } else { p.chunks_exact(2).map(|p| p[1] / p[0]).collect() }
    }

    fn sliding(mut self, sliders: &[Slider]) -> Self {
        self.held.iter_mut().zip(sliders).for_each(|(own, held)| *own = *held);
        self
    }
}
