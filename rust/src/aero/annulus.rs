//! Balance of blade elements and momentum in one annulus.
//!
//! ```text
//! phi + atan2(s cl, 4 F |sin phi| + s cd) = atan2(axial, tangential),   s the solidity
//! ```
//! S. A. Ning, Wind Energy 17 (2014) 1327; above an axial induction of 0.4 Buhl's parabola (NREL/TP-500-36834, 2005). The left side
//! brackets its root for any wind and any polar with positive drag. Derivatives are those of the root.
use std::f64::consts::{FRAC_2_PI, FRAC_PI_2, PI};

use num_dual::Dual64;

use super::polar::Airfoil;
use crate::solve::bracket::Bracket;
use crate::spatial::{Real, arctan2};
use crate::tolerances::aero::{HIGH_LOAD, MOST_ANNULUS_STEPS, SMALLEST_INFLOW};

/// An annulus without its wind: exponents of Prandtl's losses at tip and hub, zero where there is none.
#[derive(Debug, Clone, Copy)]
pub struct Annulus<'p, T: Real> {
    pub airfoil: Airfoil<'p, T>,
    pub twist: T,
    pub solidity: T,
    pub loss: [T; 2],
}

/// What the equations are of at an inflow angle: they are written for winds of positive components, others are mirrored.
#[derive(Debug, Clone, Copy)]
struct Side {
    x: f64,
    y: f64,
    empirical: bool,
}

/// Components of the wind far away over that of the relative wind times 4 F |sin phi|, and that factor.
struct Far<T> {
    axial: T,
    tangential: T,
    direction: T,
    factor: T,
}

impl<'p, T: Real> Annulus<'p, T> {
    /// The relative wind (axial, tangential) that acts at the section in a wind far away.
    pub fn relative_wind(&self, axial: T, tangential: T) -> (T, T) {
        let (vx, vy) = (axial.re(), tangential.re());
        if vx == 0.0 && vy == 0.0 {
            return (axial, tangential);
        }
        let sign = |v: f64| if v < 0.0 { -1.0 } else { 1.0 };
        let (sx, sy) = (sign(vx), sign(vy));
        let (x, y) = (axial * sx, tangential * sy);
        let real = self.map(|v| v.re());
        let (root, side) = real.solve((sx, sy), y.re().atan2(x.re()));
        let wind = arctan2(x, y);
        let mut phi = T::from(root);
        if T::NDERIV > 0 {
            let slope = self.map(|v| Dual64::from_re(v.re())).far(Dual64::new(root, 1.0), side).direction.eps;
            for _ in 0..T::NDERIV {
                let step = (self.far(phi, side).direction - wind) / slope;
                if step.re().is_finite() {
                    phi -= step;
                }
            }
        }
        let far = self.far(phi, side);
        let size = (far.axial * far.axial + far.tangential * far.tangential).sqrt();
        let speed = (x * x + y * y).sqrt();
        let relative = if size.re() > 0.0 { far.factor * speed / size } else { T::zero() };
        let (s, c) = phi.sin_cos();
        (relative * s * sx, relative * c * sy)
    }

    /// The same annulus with other numbers.
    fn map<U: Real>(&self, f: impl Fn(&T) -> U) -> Annulus<'p, U> {
        Annulus {
            airfoil: self.airfoil.with_share(f(&self.airfoil.share)),
            twist: f(&self.twist),
            solidity: f(&self.solidity),
            loss: [f(&self.loss[0]), f(&self.loss[1])],
        }
    }

    fn far(&self, phi: T, side: Side) -> Far<T> {
        let (s, c) = phi.sin_cos();
        let alpha = arctan2(s * side.x, c * side.y) - self.twist;
        let [cl, cd, _] = self.airfoil.coefficients(alpha);
        let (lift, drag) = (self.solidity * cl * (side.x * side.y), self.solidity * cd);
        let size = if s.re() < 0.0 { -s } else { s };
        let f = self.loss_factor(size);
        let factor = f * size * 4.0;
        let normal = lift * c + drag * s;
        let tangential = factor * c + drag * c - lift * s;
        let above = side.empirical && s.re() > 0.0 && normal.re() > 4.0 * HIGH_LOAD * f.re() * s.re() * s.re();
        if above {
            let root = (normal * 0.5 - f * (-f + 4.0 / 3.0) * s * s).sqrt();
            let axial = f * s * 4.0 * ((-f + 5.0 / 3.0) * s + root);
            return Far { axial, tangential, direction: axial.atan2(tangential), factor };
        }
        Far { axial: factor * s + normal, tangential, direction: phi + lift.atan2(factor + drag), factor }
    }

    /// Product of Prandtl's factors (2/pi) acos(exp(-e / |sin phi|)).
    fn loss_factor(&self, sine: T) -> T {
        let sine = if sine.re() < f64::MIN_POSITIVE { T::from(f64::MIN_POSITIVE) } else { sine };
        let one = |e: &T| {
            let exponent = *e / sine;
            // without loss, or further in than it reaches
            if e.re() <= 0.0 || exponent.re() > 700.0 { T::one() } else { (-exponent).exp().acos() * FRAC_2_PI }
        };
        self.loss.iter().map(one).fold(T::one(), |product, f| product * f)
    }
}

impl Annulus<'_, f64> {
    /// The root, and on which branch it lies. `complement` is the angle between the wind and the axis.
    fn solve(&self, (x, y): (f64, f64), complement: f64) -> (f64, Side) {
        let wind = FRAC_PI_2 - complement;
        let side = |empirical| Side { x, y, empirical };
        let at = |phi: f64, empirical: bool| self.far(phi, side(empirical)).direction;
        let through = at(SMALLEST_INFLOW, true) < wind && at(PI, true) >= wind;
        let reversed = !through && at(SMALLEST_INFLOW, false) >= wind;
        let (low, high) = if through {
            (SMALLEST_INFLOW, PI)
        } else if reversed {
            (-PI, SMALLEST_INFLOW)
        } else {
            (wind - FRAC_PI_2, wind + FRAC_PI_2)
        };
        (root(|phi| at(phi, through) - wind, low, high), side(through))
    }
}

/// A root between two ends, to the last bits; every third step halves the bracket.
fn root(function: impl Fn(f64) -> f64, low: f64, high: f64) -> f64 {
    let mut bracket = Bracket::new((low, function(low), ()), (high, function(high), ()));
    let mut best = low;
    for step in 0..MOST_ANNULUS_STEPS {
        let [one, other] = bracket.ends();
        best = if one.1.abs() < other.1.abs() { one.0 } else { other.0 };
        let least = 2.0 * f64::EPSILON * best.abs() + f64::MIN_POSITIVE;
        if bracket.width() <= 2.0 * least || one.1 == 0.0 || other.1 == 0.0 {
            break;
        }
        let x = if step % 3 == 0 { bracket.middle() } else { bracket.next(least) };
        bracket.add((x, function(x), ()));
    }
    best
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::aero::polar::Polar;

    /// A section of constant coefficients.
    fn section(lift: f64, drag: f64) -> Polar {
        let mut pieces = vec![0.0; 12];
        (pieces[0], pieces[1]) = (lift, drag);
        Polar::new(vec![-PI, PI], &pieces).unwrap()
    }

    fn annulus(polar: &Polar, solidity: f64) -> Annulus<'_, f64> {
        Annulus { airfoil: Airfoil { polars: [polar, polar], share: 0.0 }, twist: 0.0, solidity, loss: [0.0; 2] }
    }

    #[test]
    fn thrust_is_that_of_momentum_and_of_buhl_from_two_fifths_on() {
        let polar = section(0.9, 0.02);
        let induction = [0.01, 0.02, 0.028, 0.03, 0.035, 0.05].map(|solidity| {
            let (x, y) = annulus(&polar, solidity).relative_wind(1.0, 6.0);
            let a = 1.0 - x;
            let thrust = solidity * x.hypot(y) * (0.9 * y + 0.02 * x);
            let truth = if a < 0.4 { 4.0 * a * (1.0 - a) } else { (8.0 - 4.0 * a + 14.0 * a * a) / 9.0 };
            assert!((thrust / truth - 1.0).abs() < 1e-9, "{a}: {thrust} {truth}");
            a
        });
        assert!(induction.is_sorted() && induction[2] > 0.3 && induction[2] < 0.4 && induction[3] > 0.4);
    }

    #[test]
    fn a_hovering_rotor_is_an_actuator_disc() {
        // T = 2 rho A |u| du: u = sqrt(V^2 / 4 + T / (2 rho A)) - V / 2 in a climb at V
        let (speed, solidity, lift) = (3e3, 1e-6, 0.7);
        for (sign, climb) in [(1.0, 1e-9), (1.0, 0.3), (-1.0, 1e-9), (-1.0, 0.3)] {
            let polar = section(-sign * lift, 0.0);
            let axial = annulus(&polar, solidity).relative_wind(sign * climb, speed).0;
            let quarter = solidity * lift * speed * speed / 4.0;
            let truth = sign * ((climb * climb / 4.0 + quarter).sqrt() + climb / 2.0);
            assert!((axial / truth - 1.0).abs() < 1e-5, "{sign} {climb}: {axial} {truth}");
        }
    }

    #[test]
    fn a_breath_of_wind_makes_no_windmill_of_a_hovering_rotor() {
        // its wake goes against the wind: T = 2 rho A |u| (|u| + V), but for drag, which is 3e-4 of the force along the axis
        let (speed, solidity, lift, breath) = (3e3, 1e-6, 0.7, 0.3);
        for sign in [1.0, -1.0] {
            let polar = section(sign * lift, 0.3);
            let axial = annulus(&polar, solidity).relative_wind(sign * breath, speed).0;
            let quarter = solidity * lift * speed * speed / 4.0;
            let truth = -sign * ((breath * breath / 4.0 + quarter).sqrt() - breath / 2.0);
            assert!((axial / truth - 1.0).abs() < 5e-4, "{sign}: {axial} {truth}");
        }
    }
}
