//! Floquet exponents of periodic motions: Hill's quadratic eigenproblem, and the monodromy matrix as a check that needs no sorting.
//!
//! A perturbation exp(s t) sum_k v_k (1, cos, sin) gives (s^2 D2 + s D1 + dR/dy) v = 0 with D2 = I x M and D1 = C plus 2 kappa M
//! between cosine and sine plus the rate part of the laws. Of its 2 n (2H + 1) roots the 2 n of smallest |Im| are the exponents.
//! Their sum must be -tr M^-1 (C + mean rate tangent) (Liouville): where it is not, the truncation has mixed up the roots and the
//! monodromy matrix is integrated instead. So it is where Hill's matrix would be large, for condensed problems, and along a branch
//! on whose first point both agree, since for smooth laws it costs less.
use faer::Mat;
use faer::prelude::*;
use num_complex::Complex64 as c64;

use super::monodromy::{Monodromy, Splitting};
use crate::error::{Error, Result};
use crate::linalg::balance::Balanced;
use crate::periodic::aft::Aft;
use crate::periodic::linear::{Block, Matrices};
use crate::periodic::problem::Problem;
use crate::tolerances::periodic::{EXPONENT, REDUCED_MODEL, VISIBLE};

/// Largest Hill matrix; beyond, a period of integration is cheaper.
const LARGEST_HILL: usize = 130;

/// Steps of the finest product beyond which it is no longer cheaper.
const FEW_STEPS: usize = 512;

/// Exponents (1/s), and by which way they were found.
#[derive(Debug, Clone)]
pub struct Floquet {
    pub exponents: Vec<c64>,
    pub by_hill: bool,
    /// a contact opens or closes within the error of the motion, or is shorter than the steps resolve: the exponents may be others
    pub doubtful: bool,
}

/// What the stability of the solutions of one problem needs.
pub struct Stability {
    inertia: Option<Inertia>,
    splitting: Splitting,
    /// whether the two ways have agreed, once that is known
    agreed: Option<bool>,
    /// as fine as what told the exponents last
    sampler: Option<Aft>,
    /// parameter of the system that the matrices belong to, where they depend on it
    value: Option<f64>,
}

impl Stability {
    /// `model`: matrices of a reduced model of a large system, the retained coordinates first. None for laws with memory,
    /// quasi-periodic motions, condensed problems without matrices, and a reduced model that is not one of the system.
    pub fn new(problem: &mut Problem, model: Option<&Matrices>) -> Result<Option<Stability>> {
        if problem.elements.iter().any(|e| e.force.has_memory()) || problem.omega.len() != 1 {
            return Ok(None);
        }
        let reduced = match model {
            Some(model) if represents(problem, model)? => Some(model),
            _ => None,
        };
        let own = problem.linear.matrices();
        let Some(matrices) = reduced.or(own.as_ref()) else {
            return Ok(None);
        };
        let splitting = Splitting::new(problem, matrices)?;
        let value = problem.family.as_ref().map(|f| f.value);
        let small = 2 * problem.n() * problem.basis.n_coefficients() <= LARGEST_HILL;
        let inertia = if small && splitting.size() == 2 * problem.n() { Inertia::new(problem) } else { None };
        Ok(Some(Stability { inertia, splitting, agreed: None, sampler: None, value }))
    }

    /// Follows a system that depends on the parameter.
    pub fn renew(&mut self, problem: &mut Problem) -> Result<()> {
        if self.value != problem.family.as_ref().map(|f| f.value)
            && let Some(renewed) = Stability::new(problem, None)?
        {
            let agreed = self.agreed;
            *self = renewed;
            self.agreed = agreed;
        }
        Ok(())
    }

    /// Exponents of the solution y; `jacobian` is dR/dy there.
    pub fn exponents(&mut self, problem: &mut Problem, jacobian: MatRef<'_, f64>, y: &[f64]) -> Result<Floquet> {
        self.renew(problem)?;
        if let (Some(inertia), None | Some(false)) = (&self.inertia, self.agreed) {
            let rate = problem.rate_matrix(y)?;
            let exponents = hill(problem, inertia, jacobian, rate.as_ref())?;
            if inertia.trace_fits(problem, &rate, &exponents) {
                if self.agreed.is_none() {
                    let parts = self.splitting.monodromy(problem, y)?;
                    let period = std::f64::consts::TAU / problem.base_frequency();
                    let cheap = self.splitting.finest <= FEW_STEPS;
                    self.agreed = Some(cheap && agree(&exponents, period, &parts)?);
                }
                return Ok(Floquet { exponents, by_hill: true, doubtful: false });
            }
        }
        let exponents = self.integrated(problem, y, None)?;
        if self.agreed == Some(true) && self.splitting.finest > FEW_STEPS {
            self.agreed = Some(false);
        }
        Ok(Floquet { exponents, by_hill: false, doubtful: false })
    }

    /// Exponents by integration over a period; a motion with other terms has samplers of its own.
    pub fn integrated(
        &mut self,
        problem: &mut Problem,
        y: &[f64],
        samplers: Option<&mut Vec<Aft>>,
    ) -> Result<Vec<c64>> {
        let parts = match samplers {
            Some(samplers) => self.splitting.monodromy_with(problem, y, samplers)?,
            None => self.splitting.monodromy(problem, y)?,
        };
        let mut exponents = Vec::with_capacity(self.splitting.size());
        for part in &parts {
            exponents.extend(from_monodromy(&part.matrix, part.sum, problem.base_frequency())?);
        }
        Ok(exponents)
    }

    /// What deviations of the coordinates of the motion y leave open: whether contacts open or close within them, or last too short
    /// for the samples that told its exponents, and per part of the system the number of its exponents and the change of the
    /// stiffness along the motion, 1/s^2.
    pub fn deviate(
        &mut self,
        problem: &mut Problem,
        y: &[f64],
        deviations: &[f64],
        by_hill: bool,
    ) -> Result<(bool, Vec<(usize, f64)>)> {
        let samples = if by_hill { problem.dims()[0] } else { self.splitting.finest };
        let mut sampler = match self.sampler.take() {
            Some(sampler) if sampler.dims()[0] == samples => sampler,
            _ => Aft::between(&problem.basis, samples),
        };
        let found = problem.deviate(y, deviations, &mut sampler);
        self.sampler = Some(sampler);
        let found = found?;
        Ok((found.iter().any(|d| d.unresolved), self.splitting.changes(&found, problem.base_frequency())))
    }

    /// Fundamental matrix of the state [x; x'] over one period.
    pub fn monodromy(&mut self, problem: &mut Problem, y: &[f64]) -> Result<Mat<f64>> {
        let n = self.splitting.size() / 2;
        let mut phi = Mat::zeros(2 * n, 2 * n);
        for part in self.splitting.monodromy(problem, y)? {
            let m = part.own.len();
            let at = |i: usize| part.own[i % m] + n * (i / m);
            (0..2 * m).for_each(|i| (0..2 * m).for_each(|j| phi[(at(i), at(j))] = part.matrix[(i, j)]));
        }
        Ok(phi)
    }
}

/// Whether a reduced model has the dynamic stiffness of the retained coordinates at all frequencies up to the first harmonic that
/// is left out, half ones included, between which the exponents lie.
fn represents(problem: &mut Problem, model: &Matrices) -> Result<bool> {
    let n_r = problem.n();
    let (m, c, k) = model;
    let mut block = Block::new(n_r);
    let top = problem.basis.reach()[0] + 1;
    for half in 0..=2 * top {
        let w = 0.5 * half as f64 * problem.base_frequency();
        if problem.linear.evaluate(w, usize::MAX, &mut block).is_err() {
            continue; // an undamped resonance of what is condensed; its neighbours tell as much
        }
        let z = Mat::from_fn(m.nrows(), m.nrows(), |i, j| c64::new(k[(i, j)] - w * w * m[(i, j)], w * c[(i, j)]));
        let n_l = m.nrows() - n_r;
        let inner = z.submatrix(n_r, n_r, n_l, n_l).partial_piv_lu();
        let influence = inner.solve(z.submatrix(n_r, 0, n_l, n_r));
        let reduced = z.submatrix(0, 0, n_r, n_r) - z.submatrix(0, n_r, n_r, n_l) * influence;
        let exact = Mat::from_fn(n_r, n_r, |i, j| block.s[i * n_r + j]);
        let off = (&reduced - &exact).norm_max();
        if off.is_nan() || off > REDUCED_MODEL * exact.norm_max() {
            return Ok(false);
        }
    }
    Ok(true)
}

struct Inertia {
    mass: Mat<f64>,
    damping: Mat<f64>,
    inverse: Mat<f64>,
}

impl Inertia {
    fn new(problem: &Problem) -> Option<Inertia> {
        let (mass, damping, _) = problem.linear.matrices()?;
        let inverse = mass.partial_piv_lu().solve(Mat::<f64>::identity(mass.nrows(), mass.nrows()));
        Some(Inertia { mass, damping, inverse })
    }

    fn trace_fits(&self, problem: &Problem, rate: &Mat<f64>, exponents: &[c64]) -> bool {
        let n = problem.n();
        let mut trace = 0.0;
        for i in 0..n {
            for j in 0..n {
                trace += self.inverse[(i, j)] * (self.damping[(j, i)] + rate[(j, i)]);
            }
        }
        let sum: f64 = exponents.iter().map(|s| s.re).sum();
        exponents.len() == 2 * n && (sum + trace).abs() <= EXPONENT * (problem.base_frequency() + trace.abs())
    }
}

fn hill(problem: &Problem, inertia: &Inertia, jacobian: MatRef<'_, f64>, rate: MatRef<'_, f64>) -> Result<Vec<c64>> {
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
                    d1[(c * n + i, partner * n + j)] += if c % 2 == 1 { gyration } else { -gyration };
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
    roots.retain(|s| (s.im + 0.5).abs() >= EXPONENT);
    roots.sort_by(|a, b| a.im.abs().total_cmp(&b.im.abs()).then(b.im.total_cmp(&a.im)));
    roots.truncate(2 * n);
    Ok(roots.iter().map(|s| s * w0).collect())
}

/// Whether every exponent has its multiplier, to a part of the largest one of its part of the system.
fn agree(exponents: &[c64], period: f64, parts: &[Monodromy]) -> Result<bool> {
    let mut multipliers = Vec::with_capacity(exponents.len());
    for part in parts {
        let own = eigenvalues(&part.matrix)?;
        let largest = own.iter().map(|m| m.norm()).fold(1.0, f64::max);
        multipliers.extend(own.into_iter().map(|m| (m, largest)));
    }
    Ok(exponents.iter().all(|s| {
        let multiplier = (s * period).exp();
        multipliers.iter().any(|(m, largest)| (m - multiplier).norm() <= EXPONENT * largest)
    }))
}

/// Of the balanced matrix: coordinates may have any units.
fn eigenvalues(a: &Mat<f64>) -> Result<Vec<c64>> {
    let balanced = Balanced::new(a).matrix;
    balanced
        .eigenvalues()
        .map_err(|_| Error::singular("the eigenvalues for stability did not converge; switch stability off"))
}

/// ln(mu) / T for the multipliers mu, 0 <= Im <= w0/2 or its conjugate. Multipliers below rounding are not seen; the mean of
/// their exponents is what the sum of all leaves to them.
fn from_monodromy(phi: &Mat<f64>, sum: f64, w0: f64) -> Result<Vec<c64>> {
    let period = std::f64::consts::TAU / w0;
    let phi = Balanced::new(phi).matrix;
    let multipliers = eigenvalues(&phi)?;
    let visible = VISIBLE * phi.norm_max().max(f64::MIN_POSITIVE);
    let exponent = |mu: &c64| {
        let turn = if mu.im == 0.0 && mu.re < 0.0 { std::f64::consts::PI } else { mu.arg() };
        c64::new(mu.norm().ln(), turn) / period
    };
    let mut exponents: Vec<c64> = multipliers.iter().filter(|mu| mu.norm() > visible).map(exponent).collect();
    let hidden = multipliers.len() - exponents.len();
    let rest = sum - exponents.iter().map(|s| s.re).sum::<f64>();
    exponents.extend((0..hidden).map(|_| c64::new(rest / hidden as f64, 0.0)));
    Ok(exponents)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn multipliers_that_rounding_hides_follow_from_the_trace() -> Result<()> {
        let slowest = |decayed: f64| -> Result<f64> {
            let phi = Mat::from_fn(2, 2, |i, j| [1.0, decayed][i] * f64::from(u8::from(i == j)));
            let found = from_monodromy(&phi, -7.0, std::f64::consts::TAU)?;
            Ok(found.iter().fold(0.0, |a, s| a.min(s.re)))
        };
        assert!((slowest(1e-12)? + 7.0).abs() < 1e-12);
        assert!((slowest(1e-10)? - 1e-10_f64.ln()).abs() < 1e-4);
        Ok(())
    }
}
