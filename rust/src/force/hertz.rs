//! Contact after Hertz.
use super::law::{At, Class, Law, Scalar, Side, Surface};

/// k max(u - gap, 0)^exponent; parameters k, exponent, gap.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Hertz {
    side: Side,
}

impl Law for Hertz {
    fn with(n: usize) -> Option<Self> {
        (n == 3).then(Hertz::default)
    }

    fn n_params(&self) -> usize {
        3
    }

    fn force<D: Scalar>(&self, at: At<D>, p: &[D], _z: &[D], _after: &mut [D]) -> D {
        let d = at.u - p[2];
        match (self.side.is_above(d.re() > 0.0), d.re() > 0.0) {
            (true, true) => p[0] * d.powd(p[1]),
            // a power above one ends with a slope of zero
            (true, false) if p[1].re() == 1.0 => p[0] * d,
            _ => D::from(0.0),
        }
    }

    fn class(&self) -> Class {
        Class::Contact
    }

    fn surfaces(&self, p: &[f64]) -> Vec<Surface> {
        // a power above one closes with a continuous slope
        vec![Surface::kink(p[2], if p[1] > 1.0 { f64::INFINITY } else { 0.0 })]
    }

    fn held(self, sides: &[Side]) -> Self {
        sides.first().map_or(self, |side| Hertz { side: *side })
    }
}
