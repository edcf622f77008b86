//! Linear contact behind a gap, on one side or on both.
use super::law::{At, Class, Law, Scalar, Side, Surface};

/// k max(u - gap, 0); with smoothing s > 0 the hyperbola k (d + sqrt(d^2 + s^2)) / 2 of d = u - gap. Parameters k, gap, s.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Gap {
    side: Side,
}

/// The gap on both sides: force(u) - force(-u).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct GapBilateral {
    sides: [Side; 2],
}

fn one_sided<D: Scalar>(u: D, p: &[D], side: Side) -> D {
    let [k, gap, smoothing] = [p[0], p[1], p[2]];
    let d = u - gap;
    if smoothing.re() > 0.0 {
        let root = (d * d + smoothing * smoothing).sqrt();
        // the second form is the first without its cancellation
        let opening = if d.re() >= 0.0 { d + root } else { smoothing * smoothing / (root - d) };
        k * opening * 0.5
    } else if side.is_above(d.re() > 0.0) {
        k * d
    } else {
        D::from(0.0)
    }
}

impl Law for Gap {
    fn with(n: usize) -> Option<Self> {
        (n == 3).then(Gap::default)
    }

    fn n_params(&self) -> usize {
        3
    }

    fn force<D: Scalar>(&self, at: At<D>, p: &[D], _z: &[D], _after: &mut [D]) -> D {
        one_sided(at.u, p, self.side)
    }

    fn class(&self) -> Class {
        Class::Contact
    }

    fn surfaces(&self, p: &[f64]) -> Vec<Surface> {
        vec![Surface::kink(p[1], p[2])]
    }

    fn held(self, sides: &[Side]) -> Self {
        sides.first().map_or(self, |side| Gap { side: *side })
    }
}

impl Law for GapBilateral {
    fn with(n: usize) -> Option<Self> {
        (n == 3).then(GapBilateral::default)
    }

    fn n_params(&self) -> usize {
        3
    }

    fn force<D: Scalar>(&self, at: At<D>, p: &[D], _z: &[D], _after: &mut [D]) -> D {
        one_sided(at.u, p, self.sides[0]) - one_sided(-at.u, p, self.sides[1].opposite())
    }

    fn class(&self) -> Class {
        Class::Contact
    }

    fn surfaces(&self, p: &[f64]) -> Vec<Surface> {
        vec![Surface::kink(p[1], p[2]), Surface::kink(-p[1], p[2])]
    }

    fn held(self, sides: &[Side]) -> Self {
        sides.try_into().map_or(self, |sides| GapBilateral { sides })
    }
}
