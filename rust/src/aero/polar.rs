//! Section coefficients over the angle of attack: piecewise cubics, clipped where a table ends.
use std::f64::consts::{PI, TAU};

use crate::error::{Error, Result};
use crate::spatial::Real;

/// Lift, drag and moment coefficient.
pub type Coefficients<T> = [T; 3];

/// A table of piecewise cubics. `pieces[i][power][coefficient]` holds from angle i to the next.
#[derive(Debug, Clone)]
pub struct Polar {
    angle: Vec<f64>,
    pieces: Vec<[[f64; 3]; 4]>,
}

impl Polar {
    /// # Errors
    /// Angles that do not increase, or pieces that are not one fewer than the angles.
    pub fn new(angle: Vec<f64>, pieces: &[f64]) -> Result<Self> {
        let n = angle.len();
        if n < 2 || pieces.len() != 12 * (n - 1) || angle.windows(2).any(|w| w[0].is_nan() || w[0] >= w[1]) {
            return Err(Error::model("a polar needs angles that increase, and a cubic between each two"));
        }
        let piece = |c: &[f64]| std::array::from_fn(|power| std::array::from_fn(|k| c[3 * power + k]));
        Ok(Polar { angle, pieces: pieces.chunks(12).map(piece).collect() })
    }

    /// Beyond the table the values of its nearest end.
    pub fn coefficients<T: Real>(&self, angle: T) -> Coefficients<T> {
        let turns = if angle.re().abs() <= PI { 0.0 } else { ((angle.re() + PI) / TAU).floor() * TAU };
        let mut a = angle - turns;
        let (first, last) = (self.angle[0], self.angle[self.angle.len() - 1]);
        if a.re() < first {
            a = T::from(first);
        } else if a.re() > last {
            a = T::from(last);
        }
        let i = (self.angle.partition_point(|x| *x <= a.re()).max(1) - 1).min(self.pieces.len() - 1);
        let (x, c) = (a - self.angle[i], &self.pieces[i]);
        std::array::from_fn(|k| ((x * c[3][k] + c[2][k]) * x + c[1][k]) * x + c[0][k])
    }
}

/// Two polars of which the second has a share.
#[derive(Debug, Clone, Copy)]
pub struct Airfoil<'p, T: Real> {
    pub polars: [&'p Polar; 2],
    pub share: T,
}

impl<'p, T: Real> Airfoil<'p, T> {
    pub fn coefficients(&self, angle: T) -> Coefficients<T> {
        let a = self.polars[0].coefficients(angle);
        if std::ptr::eq(self.polars[0], self.polars[1]) {
            return a;
        }
        let b = self.polars[1].coefficients(angle);
        std::array::from_fn(|k| a[k] + self.share * (b[k] - a[k]))
    }

    /// The same airfoil with other numbers.
    pub fn with_share<U: Real>(&self, share: U) -> Airfoil<'p, U> {
        Airfoil { polars: self.polars, share }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use num_dual::Dual64;

    /// A cubic over two pieces: values; slopes inside; ends; turns.
    #[test]
    fn a_cubic_is_itself() {
        let value = |x: f64, k: f64| 0.3 + k * x - 0.7 * x * x + 1.1 * x * x * x;
        let (angle, mut pieces) = (vec![-0.4, 0.1, 0.9], Vec::new());
        for from in &angle[..2] {
            let slope = |k: f64| k - 1.4 * from + 3.3 * from * from;
            let rows = [value(*from, 1.0), slope(1.0), -0.7 + 3.3 * from, 1.1];
            for (power, v) in rows.iter().enumerate() {
                let other = |k: f64| [value(*from, k), slope(k), rows[2], rows[3]][power];
                pieces.extend([*v, other(2.0), other(-3.0)]);
            }
        }
        let polar = Polar::new(angle, &pieces).unwrap();
        for x in [-0.4, -0.13, 0.1, 0.52, 0.9] {
            for turn in [-TAU, 0.0, TAU] {
                let c = polar.coefficients(Dual64::new(x + turn, 1.0));
                for (c, k) in c.iter().zip([1.0, 2.0, -3.0]) {
                    assert!((c.re - value(x, k)).abs() < 1e-14);
                    // beyond the ends the polar is level: rounding of the turn decides on which side of one an angle lies
                    let at_end = x == -0.4 || x == 0.9;
                    assert!(at_end || (c.eps - (k - 1.4 * x + 3.3 * x * x)).abs() < 1e-13);
                }
            }
        }
        let beyond = polar.coefficients(Dual64::new(1.3, 1.0));
        assert!((beyond[1].re - value(0.9, 2.0)).abs() < 1e-14 && beyond[1].eps == 0.0);
        assert!(Polar::new(vec![0.0, 0.0], &[0.0; 12]).is_err());
    }
}
