//! Floquet exponents of periodic motions: Hill's quadratic eigenproblem, and the monodromy matrix as a check that needs no sorting.
//!
//! A perturbation exp(s t) sum_k v_k (1, cos, sin) gives (s^2 D2 + s D1 + dR/dy) v = 0 with D2 = I x M and D1 = C plus 2 kappa M
//! between cosine and sine plus the rate part of the laws. Of its 2 n (2H + 1) roots the 2 n of smallest |Im| are the exponents.
//! Their sum must be -tr M^-1 (C + mean rate tangent) (Liouville): where it is not, the truncation has mixed up the roots and the
//! monodromy matrix is integrated instead (fourth-order Magnus steps; A. Iserles, S. P. Norsett, Phil. Trans. R. Soc. A 357 (1999)).
use faer::Mat;
use faer::prelude::*;
use num_complex::Complex64 as c64;

use super::hbm::problem::Problem;
use crate::error::{Error, Result};

/// Largest difference between the sum of the exponents and the trace, relative to the base frequency, that passes.
const TRACE_TOLERANCE: f64 = 1e-6;
/// Exponents nearer than this (relative to the base frequency) to |Im| = omega/2 count as lying there.
const EDGE: f64 = 1e-7;

/// Exponents (1/s), and by which way they were found.
#[derive(Debug, Clone)]
pub struct Floquet {
    pub exponents: Vec<c64>,
    pub by_hill: bool,
}

/// Exponents of the solution y; `jacobian` is dR/dy there. None for laws with memory and for condensed problems.
pub fn exponents(
    problem: &mut Problem,
    jacobian: MatRef<'_, f64>,
    y: &[f64],
) -> Result<Option<Floquet>> {
    if problem.elements.iter().any(|e| e.law.n_memory() > 0) || problem.omega.len() != 1 {
        return Ok(None);
    }
    let Some(inertia) = Inertia::new(problem)? else {
        return Ok(None);
    };
    let rate = problem.rate_matrix(y);
    let found = hill(problem, &inertia, jacobian, rate.as_ref())?;
    let n = problem.n();
    let mut trace = 0.0;
    for i in 0..n {
        for j in 0..n {
            trace += inertia.inverse[(i, j)] * (inertia.damping[(j, i)] + rate[(j, i)]);
        }
    }
    let w0 = problem.base_frequency();
    let sum: f64 = found.iter().map(|s| s.re).sum();
    if found.len() == 2 * n && (sum + trace).abs() <= TRACE_TOLERANCE * (w0 + trace.abs()) {
        return Ok(Some(Floquet {
            exponents: found,
            by_hill: true,
        }));
    }
    let exponents = from_monodromy(&monodromy(problem, y)?, w0)?;
    Ok(Some(Floquet {
        exponents,
        by_hill: false,
    }))
}

struct Inertia {
    mass: Mat<f64>,
    damping: Mat<f64>,
    stiffness: Mat<f64>,
    inverse: Mat<f64>,
}

impl Inertia {
    fn new(problem: &Problem) -> Result<Option<Inertia>> {
        let Some((mass, damping, stiffness)) = problem.linear.matrices() else {
            return Ok(None);
        };
        let inverse = mass
            .partial_piv_lu()
            .solve(Mat::<f64>::identity(mass.nrows(), mass.nrows()));
        if !(0..inverse.nrows()).all(|i| inverse[(i, i)].is_finite()) {
            return Err(Error::singular(
                "stability needs a regular mass matrix; remove coordinates without mass",
            ));
        }
        Ok(Some(Inertia {
            mass,
            damping,
            stiffness,
            inverse,
        }))
    }
}

fn hill(
    problem: &Problem,
    inertia: &Inertia,
    jacobian: MatRef<'_, f64>,
    rate: MatRef<'_, f64>,
) -> Result<Vec<c64>> {
    let (n, size) = (problem.n(), jacobian.nrows());
    let w0 = problem.base_frequency();
    let frequencies = problem.basis.frequencies(&problem.omega);
    let mut d1 = rate.to_owned();
    for c in 0..size / n {
        let partner = if c == 0 { 0 } else { c - 1 + 2 * (c % 2) };
        for i in 0..n {
            for j in 0..n {
                d1[(c * n + i, c * n + j)] += inertia.damping[(i, j)];
                if c > 0 {
                    let gyration = 2.0 * frequencies[(c - 1) / 2] * inertia.mass[(i, j)];
                    d1[(c * n + i, partner * n + j)] +=
                        if c % 2 == 1 { gyration } else { -gyration };
                }
            }
        }
    }
    // time in units of 1/w0: otherwise the companion matrix is badly balanced
    let mut companion = Mat::zeros(2 * size, 2 * size);
    for i in 0..size {
        companion[(i, size + i)] = 1.0;
    }
    for c in 0..size / n {
        for col in 0..size {
            for i in 0..n {
                let (mut k, mut d) = (0.0, 0.0);
                for l in 0..n {
                    k += inertia.inverse[(i, l)] * jacobian[(c * n + l, col)];
                    d += inertia.inverse[(i, l)] * d1[(c * n + l, col)];
                }
                companion[(size + c * n + i, col)] = -k / (w0 * w0);
                companion[(size + c * n + i, size + col)] = -d / w0;
            }
        }
    }
    let mut roots = eigenvalues(&companion)?;
    // a root on the edge comes with its copy on the other edge, which is the same exponent
    roots.retain(|s| (s.im + 0.5).abs() >= EDGE);
    roots.sort_by(|a, b| {
        a.im.abs()
            .total_cmp(&b.im.abs())
            .then(b.im.total_cmp(&a.im))
    });
    roots.truncate(2 * n);
    Ok(roots.iter().map(|s| s * w0).collect())
}

fn eigenvalues(a: &Mat<f64>) -> Result<Vec<c64>> {
    a.eigenvalues().map_err(|_| {
        Error::singular("the eigenvalues for stability did not converge; switch stability off")
    })
}

/// Fundamental matrix over one period of the state [x, x'/w0].
pub fn monodromy(problem: &mut Problem, y: &[f64]) -> Result<Mat<f64>> {
    let Some(inertia) = Inertia::new(problem)? else {
        return Err(Error::model(
            "the monodromy matrix needs a problem that is not condensed",
        ));
    };
    let mut steps = 64;
    let mut before = product_of_steps(problem, &inertia, y, steps);
    loop {
        steps *= 2;
        let now = product_of_steps(problem, &inertia, y, steps);
        let size = now.norm_max();
        if (&now - &before).norm_max() <= 1e-9 * (1.0 + size) || steps >= 4096 {
            return Ok(now);
        }
        before = now;
    }
}

fn product_of_steps(problem: &mut Problem, inertia: &Inertia, y: &[f64], steps: usize) -> Mat<f64> {
    let n = problem.n();
    let w0 = problem.base_frequency();
    let tangents = problem.tangents(y, 2 * steps);
    let at = |sample: usize| -> Mat<f64> {
        let (k, c) = problem.tangent_matrices(&tangents, sample % (2 * steps));
        let k = &inertia.inverse * (&inertia.stiffness + k);
        let c = &inertia.inverse * (&inertia.damping + c);
        Mat::from_fn(2 * n, 2 * n, |i, j| match (i < n, j < n) {
            (true, _) => f64::from(u8::from(j == i + n)),
            (false, true) => -k[(i - n, j)] / (w0 * w0),
            (false, false) => -c[(i - n, j - n)] / w0,
        })
    };
    let h = std::f64::consts::TAU / steps as f64;
    let mut phi = Mat::<f64>::identity(2 * n, 2 * n);
    let mut first = at(0);
    for step in 0..steps {
        let (middle, last) = (at(2 * step + 1), at(2 * step + 2));
        let commutator = &last * &first - &first * &last;
        let omega = Mat::from_fn(2 * n, 2 * n, |i, j| {
            h / 6.0 * (first[(i, j)] + 4.0 * middle[(i, j)] + last[(i, j)])
                + h * h / 12.0 * commutator[(i, j)]
        });
        phi = exponential(&omega) * phi;
        first = last;
    }
    phi
}

/// exp(A) by Taylor's series on A / 2^k with norm below 1/4, squared back.
fn exponential(a: &Mat<f64>) -> Mat<f64> {
    let n = a.nrows();
    let norm = (0..n)
        .map(|i| (0..n).map(|j| a[(i, j)].abs()).sum::<f64>())
        .fold(0.0, f64::max);
    let halvings = if norm > 0.25 {
        (norm / 0.25).log2().ceil() as i32
    } else {
        0
    };
    let small = a * Scale(0.5_f64.powi(halvings));
    let mut sum = Mat::<f64>::identity(n, n);
    for order in (1..=11).rev() {
        let next = &small * &sum * Scale(1.0 / f64::from(order));
        sum = Mat::<f64>::identity(n, n) + next;
    }
    for _ in 0..halvings {
        sum = &sum * &sum;
    }
    sum
}

/// ln(mu) / T for the multipliers mu, 0 <= Im <= w0/2 or its conjugate.
fn from_monodromy(phi: &Mat<f64>, w0: f64) -> Result<Vec<c64>> {
    let period = std::f64::consts::TAU / w0;
    let exponent = |mu: c64| {
        // a multiplier below rounding cannot be told from zero; its exponent is then only a bound
        let size = mu.norm().max(f64::MIN_POSITIVE);
        c64::new(
            size.ln(),
            if mu.im == 0.0 && mu.re < 0.0 {
                std::f64::consts::PI
            } else {
                mu.arg()
            },
        ) / period
    };
    Ok(eigenvalues(phi)?.into_iter().map(exponent).collect())
}
