//! Floquet exponents of periodic motions: Hill's quadratic eigenproblem, and the monodromy matrix as a check that needs no sorting.
//!
//! A perturbation exp(s t) sum_k v_k (1, cos, sin) gives (s^2 D2 + s D1 + dR/dy) v = 0 with D2 = I x M and D1 = C plus 2 kappa M
//! between cosine and sine plus the rate part of the laws. Of its 2 n (2H + 1) roots the 2 n of smallest |Im| are the exponents.
//! Their sum must be -tr M^-1 (C + mean rate tangent) (Liouville): where it is not, the truncation has mixed up the roots and the
//! monodromy matrix is integrated instead. So it is where Hill's matrix would be large, for condensed problems, and along a branch
//! on whose first point both agree, since for smooth laws it costs less. Each part of a system that nothing connects with another is told
//! by itself, and a linear one by its eigenvalues.
use faer::Mat;
use faer::prelude::*;
use num_complex::Complex64 as c64;

use super::exponents::{Exponents, Own};
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
    pub exponents: Exponents,
    /// false where a part was integrated
    pub by_hill: bool,
    /// a contact opens or closes within the error of the motion, or is shorter than the steps resolve: the exponents may be others
    pub doubtful: bool,
}

/// What the stability of the solutions of one problem needs.
pub struct Stability {
    splitting: Splitting,
    parts: Vec<Way>,
    /// as fine as what told the exponents last
    sampler: Option<Aft>,
    /// parameter of the system that the matrices belong to, where they depend on it
    value: Option<f64>,
}

/// How the exponents of a part are told.
struct Way {
    /// None where Hill's matrix is not at hand, or large
    inertia: Option<Inertia>,
    /// whether it has agreed with the monodromy matrix, once that is known
    agreed: Option<bool>,
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
        let all = splitting.size() == 2 * problem.n();
        let small = |own: &[usize]| all && 2 * own.len() * problem.basis.n_coefficients() <= LARGEST_HILL;
        let inertia = |own: &[usize]| if small(own) { Inertia::new(problem, own) } else { None };
        let parts = splitting.coordinates().map(|own| Way { inertia: inertia(own), agreed: None }).collect();
        Ok(Some(Stability { splitting, parts, sampler: None, value }))
    }

    /// Follows a system that depends on the parameter.
    pub fn renew(&mut self, problem: &mut Problem) -> Result<()> {
        if self.value != problem.family.as_ref().map(|f| f.value)
            && let Some(renewed) = Stability::new(problem, None)?
        {
            let known = std::mem::replace(self, renewed).parts;
            self.parts.iter_mut().zip(known).for_each(|(way, known)| way.agreed = known.agreed);
        }
        Ok(())
    }

    /// Exponents of the solution y; `jacobian` is dR/dy there.
    pub fn exponents(&mut self, problem: &mut Problem, jacobian: MatRef<'_, f64>, y: &[f64]) -> Result<Floquet> {
        self.renew(problem)?;
        let by_hill = self.by_hill(problem, jacobian, y)?;
        let unknown = |part: &usize| by_hill[*part].is_none() && self.splitting.poles(*part).is_none();
        let needed: Vec<usize> = (0..self.parts.len()).filter(unknown).collect();
        let unchecked = |part: &usize| by_hill[*part].is_some() && self.parts[*part].agreed.is_none();
        let checked: Vec<usize> = (0..self.parts.len()).filter(unchecked).collect();
        let made = self.splitting.monodromy(problem, y, &[needed.as_slice(), &checked].concat())?;
        let (integrated, checks) = made.split_at(needed.len());
        for (part, check) in checked.iter().zip(checks) {
            let period = std::f64::consts::TAU / problem.base_frequency();
            let exponents = by_hill[*part].as_deref().unwrap_or_default();
            self.parts[*part].agreed = Some(check.steps <= FEW_STEPS && agree(exponents, period, check)?);
        }
        for (part, made) in needed.iter().zip(integrated) {
            let way = &mut self.parts[*part];
            way.agreed = way.agreed.map(|agreed| agreed && made.steps <= FEW_STEPS);
        }
        let exponents = self.gather(problem, by_hill, &needed, integrated)?;
        Ok(Floquet { exponents, by_hill: needed.is_empty(), doubtful: false })
    }

    /// Exponents of the parts that Hill's problem tells.
    fn by_hill(&self, problem: &mut Problem, jacobian: MatRef<'_, f64>, y: &[f64]) -> Result<Vec<Option<Vec<c64>>>> {
        let mut rate = None;
        let one = |(part, way): (usize, &Way)| {
            let (Some(inertia), None, None | Some(false)) = (&way.inertia, self.splitting.poles(part), way.agreed)
            else {
                return Ok(None);
            };
            let rate = match &rate {
                Some(rate) => rate,
                None => rate.insert(problem.rate_matrix(y)?),
            };
            let (jacobian, rate) = (inertia.of(problem, jacobian), inertia.of(problem, rate.as_ref()));
            let exponents = hill(problem, inertia, &jacobian, &rate)?;
            Ok(Some(exponents).filter(|exponents| inertia.trace_fits(problem, &rate, exponents)))
        };
        self.parts.iter().enumerate().map(one).collect()
    }

    /// Exponents of all parts, of which these were integrated.
    fn gather(
        &self,
        problem: &Problem,
        mut known: Vec<Option<Vec<c64>>>,
        needed: &[usize],
        integrated: &[Monodromy],
    ) -> Result<Exponents> {
        let w0 = problem.base_frequency();
        for (part, made) in needed.iter().zip(integrated) {
            known[*part] = Some(from_monodromy(&made.matrix, made.sum, w0)?);
        }
        let one = |(part, roots): (usize, Option<Vec<c64>>)| match self.splitting.poles(part) {
            Some(poles) => {
                let folded = |s: &c64| c64::new(s.re, s.im - w0 * (s.im / w0).round());
                Own { roots: poles.iter().map(folded).collect(), constant: self.value.is_none() }
            }
            None => Own { roots: roots.unwrap_or_default(), constant: false },
        };
        Ok(Exponents(known.into_iter().enumerate().map(one).collect()))
    }

    /// Exponents by integration over a period of a motion with other terms, which has samplers of its own.
    pub fn integrated(&mut self, problem: &mut Problem, y: &[f64], samplers: &mut Vec<Aft>) -> Result<Exponents> {
        let needed: Vec<usize> = (0..self.parts.len()).filter(|part| self.splitting.poles(*part).is_none()).collect();
        let made = self.splitting.monodromy_with(problem, y, &needed, samplers)?;
        self.gather(problem, vec![None; self.parts.len()], &needed, &made)
    }

    /// What deviations of the coordinates of the motion y leave open: whether contacts open or close within them, or last too short
    /// for the samples that told its exponents, and per part of the system the change of the stiffness along the motion, 1/s^2.
    pub fn deviate(
        &mut self,
        problem: &mut Problem,
        y: &[f64],
        deviations: &[f64],
        by_hill: bool,
    ) -> Result<(bool, Vec<f64>)> {
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
        let all: Vec<usize> = (0..self.parts.len()).collect();
        for part in self.splitting.monodromy(problem, y, &all)? {
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

/// Of one part of a system.
struct Inertia {
    own: Vec<usize>,
    mass: Mat<f64>,
    damping: Mat<f64>,
    inverse: Mat<f64>,
}

impl Inertia {
    fn new(problem: &Problem, own: &[usize]) -> Option<Inertia> {
        let (mass, damping, _) = problem.linear.matrices()?;
        let (n, own) = (own.len(), own.to_vec());
        let of = |a: &Mat<f64>| Mat::from_fn(n, n, |i, j| a[(own[i], own[j])]);
        let (mass, damping) = (of(&mass), of(&damping));
        let inverse = mass.partial_piv_lu().solve(Mat::<f64>::identity(n, n));
        Some(Inertia { own, mass, damping, inverse })
    }

    /// The rows and columns of its coordinates, of all terms.
    fn of(&self, problem: &Problem, a: MatRef<'_, f64>) -> Mat<f64> {
        let (all, n) = (problem.n(), self.own.len());
        let at = |i: usize| i / n * all + self.own[i % n];
        let size = a.nrows() / all * n;
        Mat::from_fn(size, size, |i, j| a[(at(i), at(j))])
    }

    fn trace_fits(&self, problem: &Problem, rate: &Mat<f64>, exponents: &[c64]) -> bool {
        let n = self.own.len();
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

fn hill(problem: &Problem, inertia: &Inertia, jacobian: &Mat<f64>, rate: &Mat<f64>) -> Result<Vec<c64>> {
    let (n, size) = (inertia.own.len(), jacobian.nrows());
    let w0 = problem.base_frequency();
    let frequencies = problem.basis.frequencies(&problem.omega);
    let mut d1 = rate.clone();
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

/// Whether every exponent has its multiplier, to a part of the largest one.
fn agree(exponents: &[c64], period: f64, monodromy: &Monodromy) -> Result<bool> {
    let multipliers = eigenvalues(&monodromy.matrix)?;
    let largest = multipliers.iter().map(|m| m.norm()).fold(1.0, f64::max);
    Ok(exponents.iter().all(|s| {
        let multiplier = (s * period).exp();
        multipliers.iter().any(|m| (m - multiplier).norm() <= EXPONENT * largest)
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
