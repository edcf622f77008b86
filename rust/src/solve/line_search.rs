//! Derivative-free line search by approximate norm descent: D.-H. Li and M. Fukushima, Optim. Methods Softw. 13 (2000) 181-201.
//!
//! The full step is taken if |F(x + d)| <= rho |F| - sigma2 |d|^2; otherwise the largest lambda = beta^i with
//! |F(x + lambda d)| <= (1 + eta_k) |F| - sigma1 |lambda d|^2, where eta_k = 1/(k + 1)^2 has a finite sum. No slope is needed,
//! so d need not be a descent direction, and for small lambda the test always passes.
use super::Residual;
use crate::error::Result;
use crate::tolerances::roots::DESCENT;

#[derive(Debug, Clone, Copy)]
pub struct Rule {
    pub rho: f64,
    pub sigma1: f64,
    pub sigma2: f64,
    pub beta: f64,
    pub max_backtracks: usize,
    /// sigma1 and sigma2 times min(1, |F|/|d|^2) of the first direction: without it a residual whose unit is large refuses every
    /// full step.
    pub invariant: bool,
}

impl Default for Rule {
    fn default() -> Rule {
        Rule { rho: 0.9, sigma1: DESCENT, sigma2: DESCENT, beta: 0.5, max_backtracks: 60, invariant: true }
    }
}

/// A point that the search took.
#[derive(Debug, Clone, Copy)]
pub struct Taken {
    pub lambda: f64,
    pub norm: f64,
}

/// Where the search starts: the point, the direction, |F(x)| and the number k of the iteration.
pub struct From<'a> {
    pub x: &'a [f64],
    pub d: &'a [f64],
    pub norm: f64,
    pub k: usize,
    /// factor of sigma1 and sigma2
    pub unit: f64,
}

/// Searches from x along d; `trial` and `f` end as the last point tried and its residual. None: no point passed the test.
/// A residual that is not finite fails the test, which shortens the step.
pub fn search(
    problem: &mut dyn Residual,
    rule: &Rule,
    from: &From<'_>,
    trial: &mut [f64],
    f: &mut [f64],
) -> Result<(Option<Taken>, usize)> {
    let (x, d, norm) = (from.x, from.d, from.norm);
    let length2 = from.unit * dot(d, d);
    let eta = 1.0 / ((from.k + 1) as f64).powi(2);
    let mut lambda = 1.0;
    for backtracks in 0..=rule.max_backtracks {
        for ((t, x), d) in trial.iter_mut().zip(x).zip(d) {
            *t = x + lambda * d;
        }
        problem.residual(trial, f)?;
        let reached = norm2(f);
        let full = backtracks == 0 && reached <= rule.rho * norm - rule.sigma2 * length2;
        if full || reached <= (1.0 + eta) * norm - rule.sigma1 * lambda * lambda * length2 {
            let taken = Taken { lambda, norm: reached };
            return Ok((Some(taken), backtracks + 1));
        }
        lambda *= rule.beta;
    }
    Ok((None, rule.max_backtracks + 1))
}

pub fn norm2(v: &[f64]) -> f64 {
    v.iter().map(|v| v * v).sum::<f64>().sqrt()
}

pub fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Residuals of a full step and of shorter ones.
    struct Falls(f64);

    impl Residual for Falls {
        fn residual(&mut self, x: &[f64], f: &mut [f64]) -> Result<()> {
            f[0] = if x[0] == 1.0 { 1.0 - self.0 } else { 0.5 };
            Ok(())
        }
    }

    #[test]
    fn a_full_step_gains_a_thousandth_of_its_square() {
        let lambda = |gain: f64| {
            let from = From { x: &[0.0], d: &[1.0], norm: 1.0, k: 1_000_000, unit: 1.0 };
            let (taken, _) = search(&mut Falls(gain), &Rule::default(), &from, &mut [0.0], &mut [0.0]).unwrap();
            taken.unwrap().lambda
        };
        assert_eq!([1e-4, 1e-2].map(lambda), [0.5, 1.0]);
    }
}
