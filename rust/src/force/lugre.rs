//! Friction of elastic bristles: the model of Lund and Grenoble.
//!
//! ```text
//! f = s0 z + s1 z' + s2 v,    z' = v - s0 |v| z / g(v),    g = f_c + (f_s - f_c) exp(-(v / v_s)^2)
//! ```
//! C. Canudas de Wit, H. Olsson, K. J. Astrom, P. Lischinsky, IEEE Trans. Automatic Control 40 (1995) 419-425, eqs. 1 to 4.
use super::law::{At, Class, Law, Scalar, Side, State, Stored, Surface};

/// Parameters f_c, f_s, v_s, s0, s1, s2; z is the deflection of the bristles.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct LuGre {
    rate: Side,
}

impl LuGre {
    /// z'
    fn slip<D: Scalar>(self, v: D, p: &[D], z: D) -> D {
        let x = v / p[2];
        let bound = p[0] + (p[1] - p[0]) * (-(x * x)).exp();
        let fast = if self.rate.is_above(v.re() >= 0.0) { v } else { -v };
        v - p[3] * fast * z / bound
    }
}

impl Law for LuGre {
    fn with(n: usize) -> Option<Self> {
        (n == 6).then(LuGre::default)
    }

    fn n_params(&self) -> usize {
        6
    }

    fn force<D: Scalar>(&self, at: At<D>, p: &[D], z: &[D], _after: &mut [D]) -> D {
        p[3] * z[0] + p[4] * self.slip(at.v, p, z[0]) + p[5] * at.v
    }

    fn state(&self) -> State {
        State::Rate(1)
    }

    fn rate<D: Scalar>(&self, at: At<D>, p: &[D], z: &[D], rate: &mut [D]) {
        rate[0] = self.slip(at.v, p, z[0]);
    }

    /// dz/du = 1 - s0 |z| / f_s at a small rate.
    fn rest<D: Scalar>(&self, u: D, p: &[D], z: &mut [D]) {
        let far = if u.re() < 0.0 { -u } else { u };
        let deflection = -(p[1] / p[3]) * (-(p[3] * far) / p[1]).exp_m1();
        z[0] = if u.re() < 0.0 { -deflection } else { deflection };
    }

    fn state_size(&self, p: &[f64], length: f64) -> f64 {
        (p[0].max(p[1]) / p[3]).min(length)
    }

    fn uses_velocity(&self) -> bool {
        true
    }

    fn class(&self) -> Class {
        Class::Friction
    }

    fn stored(&self, _u: f64, p: &[f64], z: &[f64]) -> Stored {
        Stored::Energy(0.5 * p[3] * z[0] * z[0])
    }

    fn surfaces(&self, _p: &[f64]) -> Vec<Surface> {
        vec![Surface::of_rate()]
    }

    fn held(self, sides: &[Side]) -> Self {
        sides.first().map_or(self, |rate| LuGre { rate: *rate })
    }
}
