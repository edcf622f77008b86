//! Radau IIA with three stages: nodes c, weights A, and the eigenvalues of A^-1 with their vectors.
//!
//! The nodes are those of Radau's quadrature with the end of the step, A integrates the polynomial through the stages, so that a
//! step of s stages has order 2s - 1 and its end is the last stage. A^-1 has one real eigenvalue mu and pairs of complex ones:
//! ```text
//! A^-1 = column_0 mu_0 row_0 + 2 Re sum_k column_k mu_k row_k,        row_k column_l = delta_kl
//! ```
//! E. Hairer, G. Wanner, Solving Ordinary Differential Equations II, 2nd edition, Springer 1996, sections IV.5 and IV.8. `estimate`
//! are the differences of the weights at the stages between the embedded formula of order s, which has weight 1/mu_0 at the start
//! of the step, and the method (IV.8, (8.18)).
#![allow(clippy::excessive_precision)]

use nalgebra::Complex;

/// A simple eigenvalue with its right and left vector.
pub struct Mode<T: 'static> {
    pub mu: T,
    pub column: &'static [T],
    pub row: &'static [T],
}

pub struct Tableau {
    pub c: &'static [f64],
    pub a: &'static [&'static [f64]],
    pub real: Mode<f64>,
    pub pairs: &'static [Mode<(f64, f64)>],
    pub estimate: &'static [f64],
}

impl Tableau {
    pub fn stages(&self) -> usize {
        self.c.len()
    }

    /// Of the method, and of its error in one step.
    pub fn order(&self) -> u32 {
        2 * self.c.len() as u32 - 1
    }

    /// Weights with which values at the stages give that of their polynomial at a fraction of the step.
    pub fn weights_at(&self, x: f64) -> Vec<f64> {
        let factor = |j: usize, k: usize| (x - self.c[k]) / (self.c[j] - self.c[k]);
        let all = 0..self.stages();
        all.clone().map(|j| all.clone().filter(|k| *k != j).map(|k| factor(j, k)).product()).collect()
    }
}

/// A pair as a complex number.
pub fn complex(v: (f64, f64)) -> Complex<f64> {
    Complex::new(v.0, v.1)
}

/// 3 stages, order 5.
pub const FIVE: Tableau = Tableau {
    c: &[0.1550510257216822, 0.6449489742783178, 1.0],
    a: &[
        &[0.1968154772236604, -0.06553542585019839, 0.02377097434822015],
        &[0.3944243147390873, 0.2920734116652285, -0.04154875212599793],
        &[0.37640306270046725, 0.5124858261884216, 0.1111111111111111],
    ],
    real: Mode {
        mu: 3.637834252744496,
        column: &[0.09443876248897524, 0.2502131229653333, 1.0],
        row: &[4.178718591551905, 0.32768282076106237, 0.5233764454994495],
    },
    pairs: &[Mode {
        mu: (2.6810828736277523, 3.0504301992474105),
        column: &[(-0.1412552950209542, 0.030029194105147424), (0.20412935229379994, -0.3829421127572619), (1.0, 0.0)],
        row: &[
            (-2.0893592957759526, -0.2514363174728934),
            (-0.16384141038053118, 1.2859634749278026),
            (0.23831177725027522, -0.29801960241411246),
        ],
    }],
    estimate: &[-0.42829829411536813, 0.24503907438491654, -0.0916296098652258],
};

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_weights_integrate_polynomials_and_the_modes_are_those_of_their_inverse() {
        let t = &FIVE;
        let s = t.stages();
        let inverse = |i: usize, k: usize| {
            t.pairs.iter().fold(t.real.column[i] * t.real.mu * t.real.row[k], |sum, m| {
                sum + 2.0 * (complex(m.column[i]) * complex(m.mu) * complex(m.row[k])).re
            })
        };
        for i in 0..s {
            for k in 0..s {
                let power = |c: f64| c.powi(k as i32);
                let integral: f64 = (0..s).map(|j| t.a[i][j] * power(t.c[j])).sum();
                assert!((integral - t.c[i].powi(k as i32 + 1) / (k as f64 + 1.0)).abs() < 1e-15);
                let product: f64 = (0..s).map(|j| t.a[i][j] * inverse(j, k)).sum();
                assert!((product - if i == k { 1.0 } else { 0.0 }).abs() < 1e-13);
            }
        }
        // quadrature of order 2s - 1; the embedded formula has order s
        for k in 0..2 * s - 1 {
            let integral: f64 = (0..s).map(|j| t.a[s - 1][j] * t.c[j].powi(k as i32)).sum();
            assert!((integral - 1.0 / (k as f64 + 1.0)).abs() < 1e-14);
        }
        for k in 0..s {
            let start = if k == 0 { 1.0 / t.real.mu } else { 0.0 };
            let integral: f64 = (0..s).map(|j| t.estimate[j] * t.c[j].powi(k as i32)).sum();
            assert!((integral + start).abs() < 1e-14);
        }
    }
}
