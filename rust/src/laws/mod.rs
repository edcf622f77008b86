//! Force laws `law(u, v, p, z) -> (force, z')` of one relative coordinate: u displacement, v its rate, p parameters, z memory.
//!
//! Each law is one text, generic over the number type: force, tangents (duals in u and v), derivatives by parameters (duals in
//! p) and the march of a memory all come from it. `force` resists: the system feels `w force(w.x, w.x')` on its left-hand side.
//!
//! | code | law | parameters |
//! |---|---|---|
//! | 0 | cubic | k3 |
//! | 1 | polynomial in u | c_0 c_1 ... |
//! | 2 | polynomials in u and in v | c_0 ... c_m d_0 ... d_m (same length) |
//! | 3 | one-sided gap | k, gap, smoothing |
//! | 4 | two-sided gap | k, gap, smoothing |
//! | 5 | regularised Coulomb friction | friction force, v_ref |
//! | 6 | Hertz contact | k, exponent, gap |
//! | 7 | table, monotone cubic spline | u_0 ... u_m f_0 ... f_m |
//! | 8 | Van der Pol | mu |
//! | 9 | Jenkins, one memory | k, slip force |
//! | 10 | Iwan, one memory per slider | k_1 f_1 k_2 f_2 ... |
//! | 11 | stiffness that varies with the phase tau | k, order, phase |
mod contact;
mod friction;
mod jenkins;
mod polynomial;
mod table;
mod van_der_pol;
mod varying;

use num_dual::DualNum;

use crate::error::{Error, Result};

/// What a law computes with: f64, duals, hyper-duals.
pub trait Scalar: DualNum<Primitive = f64> + Copy {}
impl<T: DualNum<Primitive = f64> + Copy> Scalar for T {}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Law {
    Cubic,
    Polynomial { n: usize },
    PolynomialVelocity { n: usize },
    Gap,
    GapBilateral,
    CoulombTanh,
    Hertz,
    Table { n: usize },
    VanDerPol,
    Jenkins,
    Iwan { n: usize },
    VaryingStiffness,
}

impl Law {
    /// The law with this code and `n` parameters.
    pub fn from_code(code: i64, n: usize) -> Result<Law> {
        let law = match code {
            0 => Law::Cubic,
            1 => Law::Polynomial { n },
            2 => Law::PolynomialVelocity { n: n / 2 },
            3 => Law::Gap,
            4 => Law::GapBilateral,
            5 => Law::CoulombTanh,
            6 => Law::Hertz,
            7 => Law::Table { n: n / 2 },
            8 => Law::VanDerPol,
            9 => Law::Jenkins,
            10 => Law::Iwan { n: n / 2 },
            11 => Law::VaryingStiffness,
            _ => return Err(Error::model(format!("no law has the code {code}"))),
        };
        let least = if matches!(law, Law::Table { .. }) { 4 } else { 1 };
        if n != law.n_params() || n < least {
            return Err(Error::model(format!("{law:?} (code {code}) cannot have {n} parameters")));
        }
        Ok(law)
    }

    pub fn n_params(&self) -> usize {
        match *self {
            Law::Cubic | Law::VanDerPol => 1,
            Law::Polynomial { n } => n,
            Law::PolynomialVelocity { n } | Law::Table { n } | Law::Iwan { n } => 2 * n,
            Law::CoulombTanh | Law::Jenkins => 2,
            Law::Gap | Law::GapBilateral | Law::Hertz | Law::VaryingStiffness => 3,
        }
    }

    /// Numbers that the law remembers from one instant to the next; they start at zero (the slider is centred).
    pub fn n_memory(&self) -> usize {
        match *self {
            Law::Jenkins => 1,
            Law::Iwan { n } => n,
            _ => 0,
        }
    }

    /// False where the force does not depend on v: a velocity tangent is then not even computed.
    pub fn uses_velocity(&self) -> bool {
        matches!(self, Law::PolynomialVelocity { .. } | Law::CoulombTanh | Law::VanDerPol)
    }

    /// Degree of the law as a polynomial in (u, v), None where it is none: decides how many samples are alias-free.
    pub fn degree(&self) -> Option<usize> {
        match *self {
            Law::Cubic | Law::VanDerPol => Some(3),
            Law::Polynomial { n } | Law::PolynomialVelocity { n } => Some(n - 1),
            Law::VaryingStiffness => Some(1),
            _ => None,
        }
    }

    /// The force; `z` is the memory before, `z_new` after (both of length `n_memory`), `p` the `n_params` parameters.
    pub fn force<D: Scalar>(&self, u: D, v: D, p: &[D], z: &[D], z_new: &mut [D]) -> D {
        self.force_at(0.0, u, v, p, z, z_new)
    }

    /// The force at the phase `tau` of the excitation (rad), on which only `VaryingStiffness` depends.
    #[inline]
    pub fn force_at<D: Scalar>(&self, tau: f64, u: D, v: D, p: &[D], z: &[D], z_new: &mut [D]) -> D {
        match *self {
            Law::Cubic => polynomial::cubic(u, p[0]),
            Law::Polynomial { .. } => polynomial::horner(u, p),
            Law::PolynomialVelocity { n } => polynomial::horner(u, &p[..n]) + polynomial::horner(v, &p[n..]),
            Law::Gap => contact::gap(u, p[0], p[1], p[2]),
            Law::GapBilateral => contact::gap(u, p[0], p[1], p[2]) - contact::gap(-u, p[0], p[1], p[2]),
            Law::CoulombTanh => friction::coulomb_tanh(v, p[0], p[1]),
            Law::Hertz => contact::hertz(u, p[0], p[1], p[2]),
            Law::Table { n } => table::pchip(u, &p[..n], &p[n..]),
            Law::VanDerPol => van_der_pol::force(u, v, p[0]),
            Law::Jenkins => jenkins::force(u, p[0], p[1], z[0], &mut z_new[0]),
            Law::Iwan { n } => {
                (0..n).fold(D::from(0.0), |sum, i| sum + jenkins::force(u, p[2 * i], p[2 * i + 1], z[i], &mut z_new[i]))
            }
            Law::VaryingStiffness => varying::force(tau, u, p[0], p[1], p[2]),
        }
    }

    /// The force, the memory updated in place.
    pub fn eval<D: Scalar>(&self, u: D, v: D, p: &[D], memory: &mut [D]) -> D {
        let mut old = [D::from(0.0); 8];
        if memory.len() <= old.len() {
            let old = &mut old[..memory.len()];
            old.copy_from_slice(memory);
            self.force(u, v, p, old, memory)
        } else {
            let old = memory.to_vec();
            self.force(u, v, p, &old, memory)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use num_dual::Dual64;

    fn all() -> Vec<(Law, Vec<f64>)> {
        vec![
            (Law::Cubic, vec![0.7]),
            (Law::Polynomial { n: 4 }, vec![0.1, 2.0, -0.3, 0.5]),
            (Law::PolynomialVelocity { n: 3 }, vec![0.0, 1.0, 0.2, 0.0, 0.3, 0.4]),
            (Law::Gap, vec![5.0, 0.2, 0.0]),
            (Law::Gap, vec![5.0, 0.2, 0.05]),
            (Law::GapBilateral, vec![5.0, 0.2, 0.01]),
            (Law::CoulombTanh, vec![2.0, 0.1]),
            (Law::Hertz, vec![3.0, 1.5, 0.1]),
            (Law::Table { n: 5 }, vec![-1.0, -0.5, 0.0, 0.5, 1.0, -3.0, -1.0, 0.0, 0.4, 2.0]),
            (Law::VanDerPol, vec![1.3]),
            (Law::Jenkins, vec![4.0, 1.1]),
            (Law::Iwan { n: 2 }, vec![4.0, 1.1, 2.0, 0.3]),
            (Law::VaryingStiffness, vec![2.0, 1.0, 0.3]),
        ]
    }

    fn value(law: Law, x: [f64; 2], p: &[f64]) -> f64 {
        let z = vec![0.05; law.n_memory()];
        law.force(x[0], x[1], p, &z, &mut z.clone())
    }

    #[test]
    fn tangents_are_the_slopes_of_the_force() {
        for (law, p) in all() {
            assert_eq!(Law::from_code(code(law), p.len()).ok(), Some(law));
            for (u, v) in [(0.37, -0.2), (-0.61, 0.4), (1.4, 0.03), (0.0, 0.0)] {
                let pd: Vec<Dual64> = p.iter().map(|&x| Dual64::from(x)).collect();
                let z = vec![Dual64::from(0.05); law.n_memory()];
                for arg in 0..2 {
                    let seed = |i: usize, x: f64| Dual64::new(x, f64::from(u8::from(i == arg)));
                    let slope = law.force(seed(0, u), seed(1, v), &pd, &z, &mut z.clone()).eps;
                    let h = 1e-6;
                    let at = |d: f64| value(law, if arg == 0 { [u + d, v] } else { [u, v + d] }, &p);
                    let difference = (at(h) - at(-h)) / (2.0 * h);
                    assert!(
                        (slope - difference).abs() < 1e-7 * (1.0 + slope.abs()),
                        "{law:?} {u} {v} {slope} {difference}"
                    );
                }
            }
        }
    }

    fn code(law: Law) -> i64 {
        match law {
            Law::Cubic => 0,
            Law::Polynomial { .. } => 1,
            Law::PolynomialVelocity { .. } => 2,
            Law::Gap => 3,
            Law::GapBilateral => 4,
            Law::CoulombTanh => 5,
            Law::Hertz => 6,
            Law::Table { .. } => 7,
            Law::VanDerPol => 8,
            Law::Jenkins => 9,
            Law::Iwan { .. } => 10,
            Law::VaryingStiffness => 11,
        }
    }

    #[test]
    fn a_table_is_monotone_and_goes_through_its_points() {
        let (u, f): ([f64; 5], [f64; 5]) = ([0.0, 1.0, 2.0, 3.0, 10.0], [0.0, 0.1, 5.0, 5.0, 6.0]);
        for (x, y) in u.iter().zip(f) {
            assert!((table::pchip(*x, &u, &f) - y).abs() < 1e-14);
        }
        let samples: Vec<f64> = (0..=1000).map(|i| table::pchip(0.01 * f64::from(i), &u, &f)).collect();
        assert!(samples.windows(2).all(|w| w[1] >= w[0] - 1e-14));
    }

    #[test]
    fn friction_far_from_the_sticking_point_has_no_nan() {
        let slope = Law::CoulombTanh.force(
            Dual64::from(0.0),
            Dual64::new(1e6, 1.0),
            &[Dual64::from(2.0), Dual64::from(1e-6)],
            &[],
            &mut [],
        );
        assert!(slope.re == 2.0 && slope.eps == 0.0);
    }

    #[test]
    fn wrong_codes_and_counts_are_errors() {
        assert!(Law::from_code(99, 1).is_err());
        assert!(Law::from_code(0, 2).is_err());
        assert!(Law::from_code(7, 5).is_err());
        assert!(Law::from_code(1, 0).is_err());
    }
}
