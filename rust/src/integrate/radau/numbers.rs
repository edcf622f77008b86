//! Radau IIA with three and with five stages: nodes c, weights A, and the eigenvalues of A^-1 with their vectors.
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
#[derive(Debug)]
pub struct Mode<T: 'static> {
    pub mu: T,
    pub column: &'static [T],
    pub row: &'static [T],
}

#[derive(Debug)]
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
        lagrange(self.c, x)
    }

    /// Weights with which slopes at the stages give the integral of their polynomial up to a fraction of the step.
    pub fn integrals(&self, x: f64) -> Vec<f64> {
        let mut out = vec![0.0; self.stages()];
        for (c, b) in self.c.iter().zip(self.a[self.stages() - 1]) {
            out.iter_mut().zip(lagrange(self.c, x * c)).for_each(|(o, l)| *o += x * b * l);
        }
        out
    }

    /// The polynomial through slopes at the start and at the stages, at a fraction of the step: its integral from the start, exact by the
    /// quadrature of the method, and itself.
    pub fn curve(&self, x: f64, h: f64, slopes: &[Vec<f64>]) -> (Vec<f64>, Vec<f64>) {
        let nodes: Vec<f64> = std::iter::once(0.0).chain(self.c.iter().copied()).collect();
        let at = |y: f64| {
            let mut out = vec![0.0; slopes[0].len()];
            for (w, slope) in lagrange(&nodes, y).iter().zip(slopes) {
                out.iter_mut().zip(slope).for_each(|(o, s)| *o += w * s);
            }
            out
        };
        let mut integral = vec![0.0; slopes[0].len()];
        for (c, b) in self.c.iter().zip(self.a[self.stages() - 1]) {
            integral.iter_mut().zip(at(x * c)).for_each(|(o, s)| *o += x * h * b * s);
        }
        (integral, at(x))
    }
}

/// Weights with which values at the nodes give that of their polynomial at x.
pub fn lagrange(nodes: &[f64], x: f64) -> Vec<f64> {
    let factor = |j: usize, k: usize| (x - nodes[k]) / (nodes[j] - nodes[k]);
    let all = 0..nodes.len();
    all.clone().map(|j| all.clone().filter(|k| *k != j).map(|k| factor(j, k)).product()).collect()
}

/// The same for the slope of that polynomial.
pub fn lagrange_slopes(nodes: &[f64], x: f64) -> Vec<f64> {
    let all = 0..nodes.len();
    let without = |j: usize, k: usize| {
        let others = all.clone().filter(move |m| *m != j && *m != k);
        others.map(|m| (x - nodes[m]) / (nodes[j] - nodes[m])).product::<f64>() / (nodes[j] - nodes[k])
    };
    all.clone().map(|j| all.clone().filter(|k| *k != j).map(|k| without(j, k)).sum()).collect()
}

/// A pair as a complex number.
pub fn complex(v: (f64, f64)) -> Complex<f64> {
    Complex::new(v.0, v.1)
}

/// 3 stages, order 5.
pub static FIVE: Tableau = Tableau {
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

/// 5 stages, order 9.
pub static NINE: Tableau = Tableau {
    c: &[0.05710419611451768, 0.2768430136381238, 0.5835904323689168, 0.8602401356562195, 1.0],
    a: &[
        &[0.07299886431790333, -0.02673533110794557, 0.018676929763984353, -0.01287910609330644, 0.005042839233882015],
        &[0.15377523147918246, 0.14621486784749352, -0.03644456890512809, 0.02123306311930472, -0.007935579902728777],
        &[0.14006304568480987, 0.29896712949128346, 0.16758507013524895, -0.03396910168661774, 0.010944288744192253],
        &[0.14489430810953477, 0.2765000687601592, 0.32579792291042103, 0.12875675325490976, -0.015708917378805327],
        &[0.14371356079122594, 0.28135601514946207, 0.31182652297574126, 0.22310390108357075, 0.04],
    ],
    real: Mode {
        mu: 6.2867047517292765,
        column: &[0.013576867344947943, 0.0016179004017190875, 0.07915785334744721, 0.41225608268046143, 1.0],
        row: &[27.697693775684087, 12.783337911304406, 3.20848938671343, -0.9514904122489162, 0.7415504960259897],
    },
    pairs: &[
        Mode {
            mu: (5.70095329867179, 3.2102656003085497),
            column: &[
                (-0.011478515255229515, 0.01401985889287541),
                (-0.007668830749180163, -0.024708578426518527),
                (0.01939846399882895, -0.08180035370375117),
                (0.40760117128019907, -0.19968242788680252),
                (1.0, 0.0),
            ],
            row: &[
                (-16.5209401067595, -4.305721989937646),
                (-8.688476739531783, 4.849995704764404),
                (-0.08606453162700278, 0.9573643198484372),
                (-0.04958488899127132, 1.20934600304247),
                (0.2656140579191533, -0.5237317439676688),
            ],
        },
        Mode {
            mu: (3.655694325463572, 6.543736899360077),
            column: &[
                (-0.010242047817908826, -0.04767387729029572),
                (0.05017286451737106, 0.09433181918161143),
                (-0.23053953404341795, -0.1027030453801259),
                (0.37789390224886127, -0.46674413033249434),
                (1.0, 0.0),
            ],
            row: &[
                (2.672093218917456, 1.8740299037199024),
                (2.2968077838795806, -1.9924828681719424),
                (-1.5181801617297122, -0.5222078208040094),
                (0.5253300951157295, 0.5920492840689743),
                (-0.13638930593214812, -0.22495888507839018),
            ],
        },
    ],
    estimate: &[
        -0.2523433122495464,
        0.16035712210296996,
        -0.11627313434096281,
        0.08100664894556402,
        -0.03181316888549383,
    ],
};

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_weights_integrate_polynomials_and_the_modes_are_those_of_their_inverse() {
        met(&FIVE);
        met(&NINE);
    }

    fn met(t: &Tableau) {
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
        for x in [0.0, 0.3, 1.0] {
            let slopes: Vec<Vec<f64>> =
                std::iter::once(&0.0).chain(t.c).map(|c| vec![2.0 - c + c.powi(s as i32)]).collect();
            let powers: Vec<f64> = t.c.iter().map(|c| c.powi(s as i32 - 1)).collect();
            let sum = |weights: Vec<f64>| weights.iter().zip(&powers).map(|(w, p)| w * p).sum::<f64>();
            assert!((sum(t.integrals(x)) - x.powi(s as i32) / s as f64).abs() < 1e-14);
            assert!((sum(lagrange_slopes(t.c, x)) - (s as f64 - 1.0) * x.powi(s as i32 - 2)).abs() < 1e-12);
            let (value, slope) = t.curve(x, 0.5, &slopes);
            let whole = 2.0 * x - x * x / 2.0 + x.powi(s as i32 + 1) / (s as f64 + 1.0);
            assert!((value[0] - 0.5 * whole).abs() < 1e-14);
            assert!((slope[0] - (2.0 - x + x.powi(s as i32))).abs() < 1e-13);
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
