//! Springs in series with dashpots, side by side: the generalised element of Maxwell (a chain of Kelvin elements is another form of
//! the same relation of force and displacement).
//!
//! ```text
//! f = sum k_i (u - z_i),   z_i' = (u - z_i) / tau_i;       on u exp(i w t): f = sum k_i (i w tau_i) / (1 + i w tau_i) u
//! ```
use super::law::{At, Law, Scalar, State, Stored};

/// Parameters k_1 tau_1 k_2 tau_2 ...; the dashpots have the constants k_i tau_i, and z_i is their displacement.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Maxwell {
    n: usize,
}

impl Law for Maxwell {
    fn with(n: usize) -> Option<Self> {
        (n > 0 && n.is_multiple_of(2)).then_some(Maxwell { n: n / 2 })
    }

    fn n_params(&self) -> usize {
        2 * self.n
    }

    fn force<D: Scalar>(&self, at: At<D>, p: &[D], z: &[D], _after: &mut [D]) -> D {
        p.chunks_exact(2).zip(z).fold(D::from(0.0), |sum, (p, z)| sum + p[0] * (at.u - *z))
    }

    fn state(&self) -> State {
        State::Rate(self.n)
    }

    fn rate<D: Scalar>(&self, at: At<D>, p: &[D], z: &[D], rate: &mut [D]) {
        for ((p, z), rate) in p.chunks_exact(2).zip(z).zip(rate) {
            *rate = (at.u - *z) / p[1];
        }
    }

    fn rest<D: Scalar>(&self, u: D, _p: &[D], z: &mut [D]) {
        z.fill(u);
    }

    fn parallel(&self) -> usize {
        self.n
    }

    fn stored(&self, u: f64, p: &[f64], z: &[f64]) -> Stored {
        Stored::Energy(p.chunks_exact(2).zip(z).map(|(p, z)| 0.5 * p[0] * (u - z) * (u - z)).sum())
    }
}
