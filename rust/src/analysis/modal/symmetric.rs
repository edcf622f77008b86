//! Undamped systems, and damped ones whose undamped modes diagonalise the damping: one symmetric eigenproblem.
use faer::Mat;
use faer::prelude::*;

use super::quality::Correction;
use super::rigid::{factor_null, no_svd, polished, symmetric_null};
use super::{Raw, RawMode};
use crate::error::Result;
use crate::linalg::dense::{C, EPS, absolute, beside, completed, frobenius, real, reduced, symmetrised};
use crate::linalg::eigen;
use crate::run::Counts;
use crate::second_order::SecondOrder;

/// Squared undamped frequencies and shapes in mass-orthonormal coordinates; the first `rigid` are zero.
struct Spectrum {
    lambda: Vec<f64>,
    vectors: Mat<f64>,
    rigid: usize,
    known: Option<Vec<(f64, f64)>>,
}

/// None where the damping couples the undamped modes.
pub fn solve(system: &SecondOrder, l: &Mat<f64>, counts: &mut Counts) -> Result<Option<Raw>> {
    let k = symmetrised(reduced(l.as_ref(), system.k.as_ref()));
    let c = system.c.as_ref().map(|c| symmetrised(reduced(l.as_ref(), c.as_ref())));
    if let Some(c) = &c {
        let product = &k * c;
        let skew = frobenius((&product - product.transpose()).as_ref());
        if skew > COMMUTING * frobenius(k.as_ref()) * frobenius(c.as_ref()) {
            return Ok(None);
        }
    }
    let mut spectrum = match &system.kf {
        Some(kf) => from_factor(l, kf, counts)?,
        None => from_stiffness(system, l, &k, counts)?,
    };
    let damping = match &c {
        None => vec![0.0; system.size()],
        Some(c) => match diagonalised(c, &mut spectrum) {
            Some(damping) => damping,
            None => return Ok(None),
        },
    };
    let mut x = spectrum.vectors.clone();
    l.transpose().solve_upper_triangular_in_place(x.as_mut());
    if spectrum.known.is_none() {
        sharpen(system, &x, &mut spectrum);
    }
    let modes = (0..system.size()).map(|j| mode(&spectrum, &damping, &x, j)).collect();
    Ok(Some(Raw {
        modes,
        route: if c.is_none() { "undamped" } else { "proportional" },
        may_be_defective: c.is_some(),
        correction: Correction::None,
    }))
}

/// Larger commutators of stiffness and damping rule out proportional damping before any eigenproblem is solved.
const COMMUTING: f64 = 1e-8;

fn from_stiffness(system: &SecondOrder, l: &Mat<f64>, k: &Mat<f64>, counts: &mut Counts) -> Result<Spectrum> {
    counts.add("symmetric eigensolutions", 1);
    let (lambda, vectors) = eigen::symmetric(k.as_ref())?;
    let largest = lambda.iter().fold(0.0f64, |m, v| m.max(v.abs()));
    let smallest = lambda.iter().fold(f64::INFINITY, |m, v| m.min(v.abs()));
    // far from zero no rank test is needed; the margin is wide because masses, unlike the test, scale lambda
    let free =
        if smallest > 1e-7 * largest { Mat::zeros(k.nrows(), 0) } else { symmetric_null(system.k.as_ref(), counts)? };
    if free.ncols() == 0 {
        return Ok(Spectrum { lambda, vectors, rigid: 0, known: None });
    }
    let still = completed((l.transpose() * &free).as_ref()).0;
    let (still, _) = polished(k.as_ref(), &still, &still);
    let (still, moving) = completed(still.as_ref());
    counts.add("symmetric eigensolutions", 1);
    let inner = symmetrised(moving.transpose() * k * &moving);
    let (lambda, vectors) = eigen::symmetric(inner.as_ref())?;
    let rigid = free.ncols();
    Ok(Spectrum {
        lambda: [vec![0.0; rigid], lambda].concat(),
        vectors: beside(still.as_ref(), (&moving * &vectors).as_ref()),
        rigid,
        known: None,
    })
}

/// Singular values of kf L^-T: relative accuracy of about EPS times the root of the stiffness ratio instead of the ratio.
fn from_factor(l: &Mat<f64>, kf: &Mat<f64>, counts: &mut Counts) -> Result<Spectrum> {
    let n = l.nrows();
    let free = factor_null(kf.as_ref(), counts)?;
    let rigid = free.ncols();
    let (still, moving) = completed((l.transpose() * &free).as_ref());
    let mut basis = moving.clone();
    l.transpose().solve_upper_triangular_in_place(basis.as_mut());
    let product = kf * &basis;
    let b =
        Mat::from_fn(product.nrows().max(n), n - rigid, |i, j| if i < product.nrows() { product[(i, j)] } else { 0.0 });
    counts.add("singular value decompositions", 1);
    let svd = b.thin_svd().map_err(|_| no_svd(n))?;
    let m = n - rigid;
    let sigma: Vec<f64> = (0..m).map(|j| svd.S()[m - 1 - j]).collect();
    let v = Mat::from_fn(m, m, |i, j| svd.V()[(i, m - 1 - j)]);
    let u = Mat::from_fn(b.nrows(), m, |i, j| svd.U()[(i, m - 1 - j)]);
    let judged = (0..m).map(|j| judge_singular(&b, sigma[j], u.col(j), v.col(j)));
    Ok(Spectrum {
        known: Some(std::iter::repeat_n((0.0, f64::NAN), rigid).chain(judged).collect()),
        lambda: [vec![0.0; rigid], sigma.iter().map(|s| s * s).collect()].concat(),
        vectors: beside(still.as_ref(), (&moving * &v).as_ref()),
        rigid,
    })
}

/// First-order error of a singular value from its residuals, and its componentwise condition, both relative.
fn judge_singular(b: &Mat<f64>, sigma: f64, u: ColRef<'_, f64>, v: ColRef<'_, f64>) -> (f64, f64) {
    let forward = b * v - Scale(sigma) * u;
    let backward = b.transpose() * u - Scale(sigma) * v;
    let (mut error, mut condition) = (0.0, 0.0);
    for i in 0..b.nrows() {
        error += u[i].abs() * forward[i].abs();
        let row: f64 = (0..b.ncols()).map(|j| b[(i, j)].abs() * v[j].abs()).sum();
        condition += u[i].abs() * row;
    }
    for j in 0..b.ncols() {
        error += v[j].abs() * backward[j].abs();
    }
    (error / sigma, condition / sigma)
}

/// Damping of each mode, or None where it couples them. Inside repeated frequencies the damping chooses the shapes.
fn diagonalised(c: &Mat<f64>, spectrum: &mut Spectrum) -> Option<Vec<f64>> {
    let n = c.nrows();
    let tolerance = 16.0 * (n as f64).sqrt() * EPS * frobenius(c.as_ref());
    let mut modal = spectrum.vectors.transpose() * c * &spectrum.vectors;
    if rotate_groups(spectrum, &modal, tolerance) {
        modal = spectrum.vectors.transpose() * c * &spectrum.vectors;
    }
    for j in 0..n {
        for i in 0..n {
            if i != j && modal[(i, j)].abs() > tolerance {
                return None;
            }
        }
    }
    let clean = |d: f64| if d.abs() <= tolerance { 0.0 } else { d };
    Some((0..n).map(|i| clean(modal[(i, i)])).collect())
}

fn rotate_groups(spectrum: &mut Spectrum, modal: &Mat<f64>, tolerance: f64) -> bool {
    let n = spectrum.lambda.len();
    let largest = spectrum.lambda.iter().fold(0.0f64, |m, v| m.max(v.abs()));
    let close = 64.0 * (n as f64).sqrt() * EPS * largest;
    let (mut start, mut rotated) = (0, false);
    while start < n {
        let mut end = start + 1;
        while end < n
            && (end < spectrum.rigid) == (start < spectrum.rigid)
            && spectrum.lambda[end] - spectrum.lambda[end - 1] <= close
        {
            end += 1;
        }
        let size = end - start;
        let block = modal.submatrix(start, start, size, size);
        let coupled = (0..size).any(|i| (0..i).any(|j| block[(i, j)].abs() > 0.01 * tolerance));
        if coupled && let Ok((_, rotation)) = eigen::symmetric(block) {
            let turned = spectrum.vectors.subcols(start, size) * &rotation;
            spectrum.vectors.subcols_mut(start, size).copy_from(&turned);
            let mean = spectrum.lambda[start..end].iter().sum::<f64>() / size as f64;
            spectrum.lambda[start..end].fill(mean);
            rotated = true;
        }
        start = end;
    }
    rotated
}

/// Rayleigh quotients with the unreduced matrices: their error is that of single entries, not of the largest eigenvalue.
fn sharpen(system: &SecondOrder, x: &Mat<f64>, spectrum: &mut Spectrum) {
    let kx = &system.k * x;
    let masses: Vec<f64> = match &system.mf {
        None => {
            let mx = &system.m * x;
            let mass = |j: usize| x.col(j).transpose() * mx.col(j);
            (0..x.ncols()).map(mass).collect()
        }
        Some(mf) => {
            let moved = mf * x;
            (0..x.ncols()).map(|j| moved.col(j).squared_norm_l2()).collect()
        }
    };
    for (j, mass) in masses.iter().enumerate().skip(spectrum.rigid) {
        spectrum.lambda[j] = (x.col(j).transpose() * kx.col(j)) / mass;
    }
    if system.mf.is_some() {
        let size = absolute(system.k.as_ref()) * absolute(x.as_ref());
        let judged = |j: usize| {
            let strain: f64 = (0..x.nrows()).map(|i| x[(i, j)].abs() * size[(i, j)]).sum();
            let condition = strain / (spectrum.lambda[j].abs() * masses[j]);
            (0.5 * EPS * (condition + 1.0), condition)
        };
        let known = (0..x.ncols()).map(|j| match j < spectrum.rigid {
            true => (0.0, f64::NAN),
            false => judged(j),
        });
        spectrum.known = Some(known.collect());
    }
}

fn mode(spectrum: &Spectrum, damping: &[f64], x: &Mat<f64>, j: usize) -> RawMode {
    let (s, partner) = quadratic_roots(damping[j], spectrum.lambda[j]);
    RawMode {
        s,
        partner,
        x: (0..x.nrows()).map(|i| real(x[(i, j)])).collect(),
        y: None,
        partner_x: None,
        partner_y: None,
        // a negative damper on a free body makes it diverge; its zero root is then the partner
        rigid: j < spectrum.rigid && s == C::ZERO,
        known: spectrum.known.as_ref().map(|known| known[j]),
    }
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
