//! Between two instants: the polynomial of degree five through increments, rates and accelerations at both ends.
//!
//! Increments theta are counted from the start; at the end theta' = J_l^-1(theta) v, and theta" is a minus the turning of that
//! map, which a difference along the motion gives to more than the accuracy of the polynomial.
use super::{Equations, Instant, Motion, scaled_size};

pub fn quintic(eq: &Equations<'_, f64>, from: &Instant, to: &Instant, h: f64, fractions: &[f64]) -> Vec<Motion<f64>> {
    let n = eq.n();
    let theta = eq.difference(&from.motion, &to.motion);
    let (v0, a0) = (&from.motion.rate, &from.acceleration);
    let v1 = eq.increment_rates(&theta, &to.motion.rate);
    let a1 = end_acceleration(eq, &theta, &v1, to);
    let curve = |x: f64| {
        let mut increment = vec![0.0; n];
        let mut speed = vec![0.0; n];
        for i in 0..n {
            let ends = [theta[i], h * v0[i], h * v1[i], h * h * a0[i], h * h * a1[i]];
            (increment[i], speed[i]) = value_and_slope(x, ends);
            speed[i] /= h;
        }
        (increment, speed)
    };
    inside(eq, from, to, (h, fractions), &curve)
}

/// Motions at fractions of a step by increments from its start, and their rates; states of laws by their own.
pub fn inside(
    eq: &Equations<'_, f64>,
    from: &Instant,
    to: &Instant,
    (h, fractions): (f64, &[f64]),
    curve: &dyn Fn(f64) -> (Vec<f64>, Vec<f64>),
) -> Vec<Motion<f64>> {
    let mut inside: Vec<Motion<f64>> = fractions
        .iter()
        .map(|x| {
            let (increment, speed) = curve(*x);
            let mut m = from.motion.moved(eq.topology(), &increment);
            m.t = from.motion.t + x * h;
            m.rate = eq.rates_of_increments(&increment, &speed);
            m
        })
        .collect();
    eq.interpolate_states(&from.motion, &to.motion, &mut inside);
    inside
}

/// theta" at the end: d/dt of J_l^-1(theta) v along the motion.
fn end_acceleration(eq: &Equations<'_, f64>, theta: &[f64], speed: &[f64], to: &Instant) -> Vec<f64> {
    let size = scaled_size(speed, &eq.scales());
    let d = f64::EPSILON.cbrt() / if size > 0.0 { size } else { 1.0 };
    let at = |s: f64| {
        let moved: Vec<f64> = theta.iter().zip(speed).map(|(y, v)| y + s * v).collect();
        let rate: Vec<f64> = to.motion.rate.iter().zip(&to.acceleration).map(|(v, a)| v + s * a).collect();
        eq.increment_rates(&moved, &rate)
    };
    let plain = eq.increment_rates(theta, &to.acceleration);
    if plain == to.acceleration && eq.increment_rates(theta, &to.motion.rate) == to.motion.rate {
        return plain;
    }
    let (ahead, behind) = (at(d), at(-d));
    ahead.iter().zip(&behind).map(|(p, q)| (p - q) / (2.0 * d)).collect()
}

/// [y1, y0', y1', y0", y1"] on the unit interval, y0 = 0.
fn value_and_slope(x: f64, ends: [f64; 5]) -> (f64, f64) {
    let [y1, d0, d1, s0, s1] = ends;
    let (r, dr, ddr) = (y1 - d0 - 0.5 * s0, d1 - d0 - s0, s1 - s0);
    let c3 = 10.0 * r - 4.0 * dr + 0.5 * ddr;
    let c4 = -15.0 * r + 7.0 * dr - ddr;
    let c5 = 6.0 * r - 3.0 * dr + 0.5 * ddr;
    let value = x * (d0 + x * (0.5 * s0 + x * (c3 + x * (c4 + x * c5))));
    let slope = d0 + x * (s0 + x * (3.0 * c3 + x * (4.0 * c4 + x * 5.0 * c5)));
    (value, slope)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_polynomial_of_degree_five_is_met() {
        let y = |x: f64| 0.3 * x + 0.7 * x * x - 1.1 * x.powi(3) + 0.4 * x.powi(4) + 2.0 * x.powi(5);
        let d = |x: f64| 0.3 + 1.4 * x - 3.3 * x * x + 1.6 * x.powi(3) + 10.0 * x.powi(4);
        let s = |x: f64| 1.4 - 6.6 * x + 4.8 * x * x + 40.0 * x.powi(3);
        for x in [0.0, 0.2, 0.77, 1.0] {
            let (value, slope) = value_and_slope(x, [y(1.0), d(0.0), d(1.0), s(0.0), s(1.0)]);
            assert!((value - y(x)).abs() < 1e-14 && (slope - d(x)).abs() < 1e-13);
        }
    }
}
