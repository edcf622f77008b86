//! Undamped systems, and damped ones whose undamped modes diagonalise the damping: one symmetric eigenproblem.
use faer::Mat;
use faer::prelude::*;

use super::certificate::Approximation;
use super::quality::Correction;
use super::rigid::{factor_null, no_svd, polished, symmetric_null};
use super::{Known, Raw, RawMode, graded};
use crate::error::Result;
use crate::linalg::dense::{C, EPS, absolute, beside, completed, exceeds, frobenius, real, reduced, symmetrised};
use crate::linalg::eigen;
use crate::run::Counts;
use crate::second_order::SecondOrder;
use crate::tolerances::modes::{CLEARLY_REGULAR, COMMUTING, UNCOUPLED};

/// Squared undamped frequencies and shapes with x^T M x = 1; the first `rigid` are zero.
struct Spectrum {
    lambda: Vec<f64>,
    x: Mat<f64>,
    rigid: usize,
    judged: Vec<Known>,
}

/// None where the damping couples the undamped modes.
pub fn solve(system: &SecondOrder, l: &Mat<f64>, counts: &mut Counts) -> Result<Option<Raw>> {
    let k = symmetrised(reduced(l.as_ref(), system.k.as_ref()));
    if let Some(c) = &system.c {
        let c = symmetrised(reduced(l.as_ref(), c.as_ref()));
        let product = &k * &c;
        let skew = frobenius((&product - product.transpose()).as_ref());
        if skew > COMMUTING * frobenius(k.as_ref()) * frobenius(c.as_ref()) {
            return Ok(None);
        }
    }
    let mut spectrum = match &system.kf {
        Some(kf) => from_factor(system, kf, counts)?,
        None => from_stiffness(system, l, &k, counts)?,
    };
    let damping = match &system.c {
        None => vec![0.0; system.size()],
        Some(c) => match diagonalised(c, &mut spectrum) {
            Some(damping) => damping,
            None => return Ok(None),
        },
    };
    let modes = (0..system.size()).map(|j| mode(&spectrum, &damping, j)).collect();
    Ok(Some(Raw {
        modes,
        route: if system.c.is_none() { "undamped" } else { "proportional" },
        may_be_defective: system.c.is_some(),
        correction: Correction::None,
    }))
}

fn from_stiffness(system: &SecondOrder, l: &Mat<f64>, k: &Mat<f64>, counts: &mut Counts) -> Result<Spectrum> {
    let (x, candidates) = eigenvectors(system, l, k, counts)?;
    let mut found = Approximation::new(system, x, candidates, counts);
    if !found.is_sharp() {
        if let Some(start) = graded::from_stiffness(system, counts) {
            let other = Approximation::new(system, start.x, start.candidates, counts);
            if other.worst() < found.worst() {
                found = other;
            }
        }
        found.improve(counts);
    }
    Ok(settled(found, system.mf.is_none()))
}

/// Shapes by an eigensolver; the first ones, of which the number is returned, may be free of stiffness.
fn eigenvectors(system: &SecondOrder, l: &Mat<f64>, k: &Mat<f64>, counts: &mut Counts) -> Result<(Mat<f64>, usize)> {
    counts.add("symmetric eigensolutions", 1);
    let (lambda, mut vectors) = eigen::symmetric(k.as_ref())?;
    let largest = lambda.iter().fold(0.0f64, |m, v| m.max(v.abs()));
    let smallest = lambda.iter().fold(f64::INFINITY, |m, v| m.min(v.abs()));
    // far from zero no rank test is needed
    let free = if smallest > CLEARLY_REGULAR * largest {
        Mat::zeros(k.nrows(), 0)
    } else {
        symmetric_null(system.k.as_ref(), counts)?
    };
    if free.ncols() > 0 {
        let still = completed((l.transpose() * &free).as_ref()).0;
        let (still, _) = polished(k.as_ref(), &still, &still);
        let (still, moving) = completed(still.as_ref());
        counts.add("symmetric eigensolutions", 1);
        let inner = symmetrised(moving.transpose() * k * &moving);
        let moved = eigen::symmetric(inner.as_ref())?.1;
        vectors = beside(still.as_ref(), (&moving * &moved).as_ref());
    }
    l.transpose().solve_upper_triangular_in_place(vectors.as_mut());
    Ok((vectors, free.ncols()))
}

/// Singular values of a factor of K: their error does not grow with the ratio of stiffnesses. The geometry in its rows decides
/// what is rigid.
fn from_factor(system: &SecondOrder, kf: &Mat<f64>, counts: &mut Counts) -> Result<Spectrum> {
    let n = system.size();
    let rank = n - factor_null(kf.as_ref(), counts)?.ncols();
    let start = graded::from_factor(system, kf, rank, counts).ok_or_else(|| no_svd(n))?;
    let mut found = Approximation::with_rigid(system, start.x, start.candidates, counts);
    if !found.is_sharp() {
        found.improve(counts);
    }
    Ok(settled(found, false))
}

fn settled(found: Approximation<'_>, residual_counts: bool) -> Spectrum {
    let judged = (0..found.lambda.len()).map(|j| match j < found.rigid {
        true => Known { error: found.noise(j).sqrt(), condition: f64::NAN, residual_counts },
        false => Known { error: 0.5 * found.bound[j] + found.data(j), condition: found.condition(j), residual_counts },
    });
    Spectrum { judged: judged.collect(), lambda: found.lambda, x: found.x, rigid: found.rigid }
}

/// Damping of each mode, or None where it couples them. Inside repeated frequencies the damping chooses the shapes.
fn diagonalised(c: &Mat<f64>, spectrum: &mut Spectrum) -> Option<Vec<f64>> {
    let n = c.nrows();
    let rounding = 16.0 * (n as f64).sqrt() * EPS;
    let moduli = absolute(spectrum.x.as_ref());
    let size = moduli.transpose() * absolute(c.as_ref()) * &moduli;
    let mut modal = spectrum.x.transpose() * c * &spectrum.x;
    if rotate_groups(spectrum, &modal, &(&size * Scale(0.01 * rounding))) {
        modal = spectrum.x.transpose() * c * &spectrum.x;
    }
    for j in 0..n {
        let mut coupling = 0.0;
        for i in (0..n).filter(|&i| i != j) {
            let d = modal[(i, j)].abs();
            if d > rounding * size[(i, j)] {
                coupling += coupling_effect(d, spectrum.lambda[i], spectrum.lambda[j]);
            }
        }
        if exceeds(coupling, UNCOUPLED) {
            return None;
        }
        if j >= spectrum.rigid {
            spectrum.judged[j].error += 0.5 * coupling;
        }
    }
    Some((0..n).map(|i| if modal[(i, i)].abs() <= rounding * size[(i, i)] { 0.0 } else { modal[(i, i)] }).collect())
}

/// Relative change of lambda_j by damping d between modes i and j: (s d)^2/((lambda_i - lambda_j) lambda_j), at most d/|s|.
fn coupling_effect(d: f64, other: f64, own: f64) -> f64 {
    let first = d / own.abs().sqrt();
    let second = d * d / (other - own).abs();
    if own == 0.0 { f64::INFINITY } else { first.min(second) }
}

fn rotate_groups(spectrum: &mut Spectrum, modal: &Mat<f64>, rounding: &Mat<f64>) -> bool {
    let n = spectrum.lambda.len();
    let blur = |j: usize| 2.0 * spectrum.judged[j].error + 32.0 * (n as f64).sqrt() * EPS;
    let blurs: Vec<f64> = (0..n).map(blur).collect();
    let (mut start, mut rotated) = (0, false);
    while start < n {
        let mut end = start + 1;
        while end < n
            && (end < spectrum.rigid) == (start < spectrum.rigid)
            && spectrum.lambda[end] - spectrum.lambda[end - 1]
                <= (blurs[end] + blurs[end - 1]) * spectrum.lambda[end].abs()
        {
            end += 1;
        }
        let size = end - start;
        let block = modal.submatrix(start, start, size, size);
        let coupled = (0..size).any(|i| (0..i).any(|j| block[(i, j)].abs() > rounding[(start + i, start + j)]));
        if coupled && let Ok((_, rotation)) = eigen::symmetric(block) {
            let turned = spectrum.x.subcols(start, size) * &rotation;
            spectrum.x.subcols_mut(start, size).copy_from(&turned);
            let mean = spectrum.lambda[start..end].iter().sum::<f64>() / size as f64;
            spectrum.lambda[start..end].fill(mean);
            rotated = true;
        }
        start = end;
    }
    rotated
}

fn mode(spectrum: &Spectrum, damping: &[f64], j: usize) -> RawMode {
    let (s, partner) = quadratic_roots(damping[j], spectrum.lambda[j]);
    let is_still = j < spectrum.rigid;
    let error = match (spectrum.judged[j].error, damping[j] == 0.0 || is_still) {
        (error, true) => error,
        (error, false) => moved(s, damping[j], 2.0 * error * spectrum.lambda[j].abs()),
    };
    RawMode {
        s,
        partner,
        x: (0..spectrum.x.nrows()).map(|i| real(spectrum.x[(i, j)])).collect(),
        y: None,
        partner_x: None,
        partner_y: None,
        // a negative damper on a free body makes it diverge; its zero root is then the partner
        rigid: is_still && s == C::ZERO,
        known: (!is_still || s == C::ZERO).then_some(Known { error, ..spectrum.judged[j] }),
    }
}

/// Relative change of a root of s^2 + c s + lambda by that of lambda; a double root moves like its square root.
fn moved(s: C, c: f64, change: f64) -> f64 {
    (change / (2.0 * s + c).norm()).min(change.sqrt()) / s.norm()
}

/// Roots of s^2 + c s + lambda: of a complex pair first the one with Im > 0, of two real ones first the larger.
pub fn quadratic_roots(c: f64, lambda: f64) -> (C, C) {
    let half = 0.5 * c;
    let discriminant = half * half - lambda;
    if discriminant < 0.0 {
        let s = C::new(-half, (-discriminant).sqrt());
        return (s, s.conj());
    }
    // the root without cancellation first, the other from their product
    let far = -(half + discriminant.sqrt().copysign(half));
    let near = if far == 0.0 { 0.0 } else { lambda / far };
    (real(far.max(near) + 0.0), real(far.min(near) + 0.0))
}
