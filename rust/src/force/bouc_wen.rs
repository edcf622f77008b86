//! Smooth hysteresis after Bouc and Wen.
//!
//! ```text
//! f = alpha k u + (1 - alpha) k z,     z' = v - beta |v| |z|^(n-1) z - gamma v |z|^n
//! ```
//! Y.-K. Wen, J. Eng. Mech. Div. ASCE 102 (1976) 249-263, with A = 1: the slope at z = 0 is k. z is a displacement and tends to
//! (beta + gamma)^(-1/n). Stored energy and dissipation, which is not negative for beta >= |gamma|, after S. Erlicher and N. Point,
//! C. R. Mecanique 332 (2004) 51-57.
use super::law::{At, Law, Scalar, Side, State, Stored, Surface};

/// Parameters k, alpha, beta, gamma, n.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct BoucWen {
    rate: Side,
    state: Side,
}

/// Steps of the way from rest to a displacement, over which z bends to its bound.
const STEPS: usize = 256;
/// Beyond this multiple of its bound z has reached it, to rounding, on the way from rest.
const FAR: f64 = 40.0;

fn absolute<D: Scalar>(x: D, side: Side) -> D {
    if side.is_above(x.re() >= 0.0) { x } else { -x }
}

/// |z|^n, n >= 1; zero has no logarithm, and beyond the side on which it is held there is none.
fn power<D: Scalar>(z: D, n: D, side: Side) -> D {
    let size = absolute(z, side);
    match (size.re() <= 0.0, n.re() == 1.0) {
        (true, true) => size,
        (true, false) => D::from(0.0),
        _ => size.powd(n),
    }
}

impl Law for BoucWen {
    fn with(n: usize) -> Option<Self> {
        (n == 5).then(BoucWen::default)
    }

    fn n_params(&self) -> usize {
        5
    }

    fn force<D: Scalar>(&self, at: At<D>, p: &[D], z: &[D], _after: &mut [D]) -> D {
        p[0] * (p[1] * at.u + (-p[1] + 1.0) * z[0])
    }

    fn state(&self) -> State {
        State::Rate(1)
    }

    fn rate<D: Scalar>(&self, at: At<D>, p: &[D], z: &[D], rate: &mut [D]) {
        let speed = absolute(at.v, self.rate);
        let along = if self.state.is_above(z[0].re() >= 0.0) { speed } else { -speed };
        rate[0] = at.v - power(z[0], p[4], self.state) * (p[2] * along + p[3] * at.v);
    }

    /// The curve of first loading, dz/du = 1 - (beta + gamma) z^n of |u| by the method of order four.
    fn rest<D: Scalar>(&self, u: D, p: &[D], z: &mut [D]) {
        let sum = p[2] + p[3];
        let bound = if sum.re() > 0.0 { sum.re().powf(-1.0 / p[4].re()) } else { f64::INFINITY };
        if u.re().abs() > FAR * bound {
            let end = sum.powd(-p[4].recip());
            z[0] = if u.re() < 0.0 { -end } else { end };
            return;
        }
        let h = absolute(u, Side::Free) / STEPS as f64;
        let slope = |z: D| -(sum * power(z, p[4], Side::Free)) + 1.0;
        let mut y = D::from(0.0);
        for _ in 0..STEPS {
            let a = slope(y);
            let b = slope(y + h * a * 0.5);
            let c = slope(y + h * b * 0.5);
            let d = slope(y + h * c);
            y += h * (a + (b + c) * 2.0 + d) / 6.0;
        }
        z[0] = if u.re() < 0.0 { -y } else { y };
    }

    fn state_size(&self, p: &[f64], length: f64) -> f64 {
        let sum = p[2] + p[3];
        if sum > 0.0 { sum.powf(-1.0 / p[4]).min(length) } else { length }
    }

    fn uses_velocity(&self) -> bool {
        true
    }

    fn stored(&self, u: f64, p: &[f64], z: &[f64]) -> Stored {
        Stored::Energy(0.5 * p[0] * (p[1] * u * u + (1.0 - p[1]) * z[0] * z[0]))
    }

    fn surfaces(&self, _p: &[f64]) -> Vec<Surface> {
        vec![Surface::of_rate(), Surface::of_state()]
    }

    fn held(self, sides: &[Side]) -> Self {
        let &[rate, state] = sides else { return self };
        BoucWen { rate, state }
    }
}
