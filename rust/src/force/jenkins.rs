//! A spring in series with a slider: the element of Jenkins.
use super::law::{At, Class, Law, Scalar, Slider, State};
use crate::tolerances::matrices::ENTRY_ROUNDING;

/// k (u - z) while it does not exceed `slip`; beyond, the slider at z follows. Parameters k, slip.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Jenkins {
    slider: Slider,
}

impl Law for Jenkins {
    fn with(n: usize) -> Option<Self> {
        (n == 2).then(Jenkins::default)
    }

    fn n_params(&self) -> usize {
        2
    }

    fn force<D: Scalar>(&self, at: At<D>, p: &[D], z: &[D], after: &mut [D]) -> D {
        let (k, slip) = (p[0], p[1]);
        let trial = k * (at.u - z[0]);
        match self.slider {
            Slider::Free => {}
            Slider::Sticks => {
                after[0] = z[0];
                return trial;
            }
            Slider::SlidesUp | Slider::SlidesDown => {
                let force = if self.slider == Slider::SlidesUp { slip } else { -slip };
                after[0] = at.u - force / k;
                return force;
            }
        }
        // where a slider has just stopped the force is the limit but for rounding: it slips on if the rate says so
        let size = k.re().abs() * (at.u.re().abs() + z[0].re().abs()) + slip.re().abs();
        let rounding = ENTRY_ROUNDING * f64::EPSILON * size;
        let onward = if trial.re() * at.v.re() > 0.0 { -rounding } else { rounding };
        if trial.re().abs() <= slip.re() + onward {
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

    fn sliders(&self, p: &[f64]) -> Vec<f64> {
        vec![p[1] / p[0]]
    }

    fn sliding(self, sliders: &[Slider]) -> Self {
        sliders.first().map_or(self, |slider| Jenkins { slider: *slider })
    }
}

#[cfg(test)]
mod tests {
    use num_dual::Dual64;

    use super::*;

    /// dF/du at the limit of a slider that has moved to u, with rate v; `off` in units of the last place of z.
    fn stiffness(u: f64, v: f64, off: i64) -> f64 {
        let (k, slip) = (813.7, 2.9);
        let z = u - slip / k;
        let z = f64::from_bits((z.to_bits() as i64 + off) as u64);
        let at = At { phase: 0.0, u: Dual64::from(u).derivative(), v: Dual64::from(v) };
        let mut after = [Dual64::from(0.0)];
        Jenkins::default().force(at, &[Dual64::from(k), Dual64::from(slip)], &[Dual64::from(z)], &mut after).eps
    }

    #[test]
    fn the_rate_decides_at_the_limit() {
        for u in [0.0123, 0.3171, 7.77, -2.31] {
            for off in [-1, 0, 1] {
                assert_eq!(stiffness(u, 0.4, off), 0.0);
                assert_eq!(stiffness(u, -0.4, off), 813.7);
            }
        }
        // a thousand last places away from the limit it sticks at any rate
        assert_eq!(stiffness(0.3171, 0.4, 1000), 813.7);
    }
}
