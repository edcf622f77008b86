//! First-order form x' = A x + B u of a second-order system, x = (z, z'/rate) in mass-normalised coordinates.
use faer::Mat;

use super::ports::Ports;
use crate::error::Error;
use crate::linalg::quadratic::{NormalForm, Quadratic};
use crate::tolerances::frequency_response::NO_FEEDTHROUGH;

/// State matrices of a second-order system in any coordinates with unit mass: x = (z, z'/rate).
#[derive(Debug, Clone)]
pub struct StateSpace {
    pub a: Mat<f64>,
    /// input matrix for the loads themselves, before their derivative orders
    pub b: Mat<f64>,
    pub c: Mat<f64>,
}

impl StateSpace {
    pub fn new(form: &NormalForm, ports: &Ports) -> Self {
        let n = form.n();
        let rate = form.rate();
        let (l, f) = (form.outputs(ports.l.as_ref()), form.inputs(ports.f.as_ref()));
        StateSpace {
            a: form.state_matrix(rate),
            b: Mat::from_fn(2 * n, f.ncols(), |i, j| if i < n { 0.0 } else { f[(i - n, j)] / rate }),
            c: Mat::from_fn(l.nrows(), 2 * n, |i, j| if j < n { l[(i, j)] } else { 0.0 }),
        }
    }

    /// A^p B with the derivative order p of each input.
    pub fn driven(&self, order_in: &[u32]) -> Mat<f64> {
        let mut b = self.b.clone();
        let highest = order_in.iter().copied().max().unwrap_or(0);
        let mut power = self.b.clone();
        for p in 1..=highest {
            power = &self.a * &power;
            for (j, order) in order_in.iter().enumerate() {
                if *order == p {
                    b.col_mut(j).copy_from(power.col(j));
                }
            }
        }
        b
    }

    /// C, C A, C A^2.
    pub fn outputs(&self) -> [Mat<f64>; 3] {
        let velocity = &self.c * &self.a;
        let acceleration = &velocity * &self.a;
        [self.c.clone(), velocity, acceleration]
    }

    /// Per output derivative q: the matrices T_r of sum_r T_r u^(r), with T_r = C A^(p+q-1-r) B + [r = q] D0. What cancels up to
    /// rounding (the absolute motion of a body on a moving base) is zero.
    pub fn direct(&self, order_in: &[u32], d0: Option<&Mat<f64>>) -> [Vec<Mat<f64>>; 3] {
        let (n_out, n_in) = (self.c.nrows(), self.b.ncols());
        let highest = order_in.iter().copied().max().unwrap_or(0) as usize;
        let mut markov = Vec::new();
        let mut power = self.b.clone();
        for _ in 0..highest + 2 {
            markov.push(&self.c * &power);
            power = &self.a * &power;
        }
        std::array::from_fn(|q| {
            let top = highest + q;
            (0..=top.max(q))
                .map(|r| {
                    Mat::from_fn(n_out, n_in, |i, j| {
                        let m = order_in[j] as usize + q;
                        let through = if m > r { markov[m - 1 - r][(i, j)] } else { 0.0 };
                        let feed = match d0 {
                            Some(d0) if r == q => d0[(i, j)],
                            _ => 0.0,
                        };
                        let sum = through + feed;
                        if sum.abs() <= NO_FEEDTHROUGH * through.abs().max(feed.abs()) { 0.0 } else { sum }
                    })
                })
                .collect()
        })
    }
}

pub fn initial(form: &NormalForm, x0: &[f64], v0: &[f64]) -> Mat<f64> {
    let n = form.n();
    let rate = form.rate();
    let z = form.l.transpose() * Mat::from_fn(n, 2, |i, k| if k == 0 { x0[i] } else { v0[i] / rate });
    Mat::from_fn(2 * n, 1, |i, _| if i < n { z[(i, 0)] } else { z[(i - n, 1)] })
}

pub fn massless(q: &Quadratic) -> Error {
    let worst = (0..q.n()).min_by(|a, b| q.m[(*a, *a)].total_cmp(&q.m[(*b, *b)])).unwrap_or(0);
    Error::singular(format!(
        "the mass matrix is not symmetric positive definite (smallest diagonal entry {:.3e} at coordinate {worst}): \
         give every coordinate a mass or remove it",
        q.m[(worst, worst)]
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The rate of a load drives an output through and beside the system, of opposite size but for a part.
    #[test]
    fn a_feedthrough_that_cancels_but_for_rounding_is_none() {
        let one = || Mat::from_fn(1, 1, |_, _| 1.0);
        let state = StateSpace { a: Mat::zeros(1, 1), b: one(), c: one() };
        let left = |part: f64| state.direct(&[1], Some(&Mat::from_fn(1, 1, |_, _| part - 1.0)))[0][0][(0, 0)];
        assert_eq!(left(1e-11), 0.0);
        assert!((left(1e-9) - 1e-9).abs() < 1e-15);
    }
}
