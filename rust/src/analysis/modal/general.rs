//! Any damping, gyroscopic and circulatory terms: a state matrix in energy coordinates.
//!
//! With unit masses and a full-rank factorisation K + N = F B the state (x', B x) obeys
//! `A = [-(C + G), -F; B, 0]`. It carries its own scaling (|F| = |B| = |K|^(1/2), what Fan, Lin and Van Dooren, SIMAX 26 (2004),
//! obtain for the quadratic problem), it is skew for conservative gyroscopic systems, and it leaves out one zero root for
//! every direction without stiffness.
use faer::prelude::*;
use faer::{Mat, MatRef, Side};

use super::pairing::{RealRoot, pair};
use super::rigid::{general_null, no_svd, rank_tolerance, symmetric_null};
use super::subspace::aligned;
use super::{Raw, RawMode};
use crate::error::Result;
use crate::linalg::dense::{C, completed, frobenius, real, reduced, symmetrised, to_complex};
use crate::linalg::eigen::{self, Roots};
use crate::run::Counts;
use crate::second_order::SecondOrder;

/// The system in mass-orthonormal coordinates.
struct Hat {
    d: Mat<f64>,
    s: Mat<f64>,
    /// Orthonormal right and left null vectors of s.
    right: Mat<f64>,
    left: Mat<f64>,
    symmetric: bool,
    has_left: bool,
    conservative: bool,
}

pub fn solve(system: &SecondOrder, l: &Mat<f64>, counts: &mut Counts) -> Result<Raw> {
    let whole = hat(system, l, counts)?;
    let (inner, basis, double) = deflated(whole)?;
    let factor = Factor::new(&inner, counts)?;
    let conservative = inner.conservative && matches!(factor, Factor::Cholesky { .. });
    let mut modes: Vec<RawMode> = if conservative {
        conservative_modes(&inner, &factor, counts)?
    } else {
        damped_modes(&inner, &factor, counts)?
    };
    if let Some(basis) = &basis {
        for mode in &mut modes {
            lift(mode, basis.as_ref());
        }
    }
    modes.extend((0..double.ncols()).map(|j| double_zero(&double, j, inner.has_left)));
    for mode in &mut modes {
        to_coordinates(mode, l);
    }
    Ok(Raw {
        modes,
        route: route(system, conservative),
        may_be_defective: !conservative,
    })
}

fn route(system: &SecondOrder, conservative: bool) -> &'static str {
    match (conservative, &system.n, &system.g) {
        (true, _, _) => "gyroscopic conservative",
        (_, Some(_), _) => "circulatory",
        (_, None, Some(_)) => "gyroscopic",
        (_, None, None) => "general damping",
    }
}

fn hat(system: &SecondOrder, l: &Mat<f64>, counts: &mut Counts) -> Result<Hat> {
    let n = system.size();
    let s = match &system.n {
        None => symmetrised(reduced(l.as_ref(), system.k.as_ref())),
        Some(_) => reduced(l.as_ref(), system.position().as_ref()),
    };
    let d = system
        .velocity()
        .map_or_else(|| Mat::zeros(n, n), |d| reduced(l.as_ref(), d.as_ref()));
    let (right, left) = if system.n.is_some() {
        general_null(system.position().as_ref(), counts)?
    } else {
        let null = symmetric_null(system.k.as_ref(), counts)?;
        (null.clone(), null)
    };
    let orthonormal = |z: &Mat<f64>| completed((l.transpose() * z).as_ref()).0;
    Ok(Hat {
        d,
        s,
        right: orthonormal(&right),
        left: orthonormal(&left),
        symmetric: system.n.is_none(),
        has_left: !system.is_symmetric(),
        conservative: system.c.is_none() && system.n.is_none(),
    })
}

/// Splits off the directions that neither stiffness nor velocity terms touch: each is a double zero root of its own. Returns
/// the rest, the basis of the rest (None where nothing was split off) and those directions.
fn deflated(whole: Hat) -> Result<(Hat, Option<Mat<f64>>, Mat<f64>)> {
    let n = whole.s.nrows();
    if !whole.symmetric || whole.right.ncols() == 0 {
        return Ok((whole, None, Mat::zeros(n, 0)));
    }
    let floor = rank_tolerance(n) * frobenius(whole.d.as_ref());
    let (kept, free) = split_null(&whole.d, &whole.right, floor)?;
    if free.ncols() == 0 {
        return Ok((whole, None, free));
    }
    let (free, basis) = completed(free.as_ref());
    let inside = |a: &Mat<f64>| basis.transpose() * a * &basis;
    let held = completed((basis.transpose() * &kept).as_ref()).0;
    let inner = Hat {
        d: inside(&whole.d),
        s: symmetrised(inside(&whole.s)),
        right: held.clone(),
        left: held,
        ..whole
    };
    Ok((inner, Some(basis), free))
}

/// Splits span(z) into directions that `a` moves and directions with |a z| <= floor.
fn split_null(a: &Mat<f64>, z: &Mat<f64>, floor: f64) -> Result<(Mat<f64>, Mat<f64>)> {
    let r = z.ncols();
    let image = a * z;
    let tall = Mat::from_fn(image.nrows().max(r), r, |i, j| {
        if i < image.nrows() {
            image[(i, j)]
        } else {
            0.0
        }
    });
    let svd = tall.thin_svd().map_err(|_| no_svd(r))?;
    let sigma = svd.S().column_vector();
    let rank = (0..r).filter(|&i| sigma[i] > floor).count();
    let turned = z * svd.V();
    Ok((
        turned.subcols(0, rank).to_owned(),
        turned.subcols(rank, r - rank).to_owned(),
    ))
}

/// K + N = F B with F of full column and B of full row rank.
enum Factor {
    Cholesky {
        lower: Mat<f64>,
    },
    /// U diag(sigma) V^T without its zero part.
    Split {
        u: Mat<f64>,
        sigma: Vec<f64>,
        v: Mat<f64>,
    },
    Plain {
        gamma: f64,
    },
}

impl Factor {
    fn new(hat: &Hat, counts: &mut Counts) -> Result<Self> {
        let n = hat.s.nrows();
        let r = hat.right.ncols();
        if hat.symmetric {
            if r == 0
                && let Ok(factor) = hat.s.llt(Side::Lower)
            {
                counts.add("cholesky factorisations", 1);
                let l = factor.L();
                let lower = Mat::from_fn(n, n, |i, j| if i >= j { l[(i, j)] } else { 0.0 });
                return Ok(Factor::Cholesky { lower });
            }
            counts.add("symmetric eigensolutions", 1);
            let (values, vectors) = eigen::symmetric(hat.s.as_ref())?;
            let mut order: Vec<usize> = (0..n).collect();
            order.sort_by(|&a, &b| values[b].abs().total_cmp(&values[a].abs()));
            order.truncate(n - r);
            let pick = |sign: bool| {
                Mat::from_fn(n, n - r, |i, j| {
                    let k = order[j];
                    let flip = if sign { values[k].signum() } else { 1.0 };
                    flip * vectors[(i, k)]
                })
            };
            let sigma = order.iter().map(|&k| values[k].abs()).collect();
            return Ok(Factor::Split {
                u: pick(true),
                sigma,
                v: pick(false),
            });
        }
        if r == 0 {
            let gamma = frobenius(hat.s.as_ref()).sqrt();
            return Ok(Factor::Plain { gamma });
        }
        counts.add("singular value decompositions", 1);
        let svd = hat.s.svd().map_err(|_| no_svd(n))?;
        Ok(Factor::Split {
            u: svd.U().subcols(0, n - r).to_owned(),
            sigma: (0..n - r).map(|j| svd.S()[j]).collect(),
            v: svd.V().subcols(0, n - r).to_owned(),
        })
    }

    fn matrices(&self, s: &Mat<f64>) -> (Mat<f64>, Mat<f64>) {
        let n = s.nrows();
        match self {
            Factor::Cholesky { lower } => (lower.clone(), lower.transpose().to_owned()),
            Factor::Split { u, sigma, v } => (
                Mat::from_fn(n, sigma.len(), |i, j| u[(i, j)] * sigma[j].sqrt()),
                Mat::from_fn(sigma.len(), n, |i, j| v[(j, i)] * sigma[i].sqrt()),
            ),
            Factor::Plain { gamma } => (
                Mat::from_fn(n, n, |i, j| s[(i, j)] / gamma),
                Mat::from_fn(n, n, |i, j| if i == j { *gamma } else { 0.0 }),
            ),
        }
    }

    /// x from B x = w; what B does not see is taken from `other` along `null`.
    fn right(&self, w: &[C], other: &[C], null: &Mat<f64>) -> Vec<C> {
        match self {
            Factor::Cholesky { lower } => back_substituted(lower, w),
            Factor::Split { sigma, v, .. } => combined(v, sigma, w, other, null),
            Factor::Plain { gamma } => w.iter().map(|w| w / gamma).collect(),
        }
    }

    /// y from F^T y = w, or None where only `other` is at hand.
    fn left(&self, w: &[C], other: &[C], null: &Mat<f64>) -> Option<Vec<C>> {
        match self {
            Factor::Cholesky { lower } => Some(back_substituted(lower, w)),
            Factor::Split { u, sigma, .. } => Some(combined(u, sigma, w, other, null)),
            Factor::Plain { .. } => None,
        }
    }
}

fn back_substituted(lower: &Mat<f64>, w: &[C]) -> Vec<C> {
    let n = w.len();
    let mut parts = Mat::from_fn(n, 2, |i, j| if j == 0 { w[i].re } else { w[i].im });
    lower
        .transpose()
        .solve_upper_triangular_in_place(parts.as_mut());
    (0..n)
        .map(|i| C::new(parts[(i, 0)], parts[(i, 1)]))
        .collect()
}

fn combined(v: &Mat<f64>, sigma: &[f64], w: &[C], other: &[C], null: &Mat<f64>) -> Vec<C> {
    let mut x = vec![C::ZERO; other.len()];
    let mut add = |column: ColRef<'_, f64>, weight: C| {
        for (i, x) in x.iter_mut().enumerate() {
            *x += weight * column[i];
        }
    };
    for (j, s) in sigma.iter().enumerate() {
        add(v.col(j), w[j] / s.sqrt());
    }
    for j in 0..null.ncols() {
        let along = (0..other.len()).map(|i| other[i] * null[(i, j)]).sum();
        add(null.col(j), along);
    }
    x
}

fn state_matrix(hat: &Hat, factor: &Factor) -> Mat<f64> {
    let n = hat.s.nrows();
    let (f, b) = factor.matrices(&hat.s);
    let size = n + b.nrows();
    Mat::from_fn(size, size, |i, j| match (i < n, j < n) {
        (true, true) => -hat.d[(i, j)],
        (true, false) => -f[(i, j - n)],
        (false, true) => b[(i - n, j)],
        (false, false) => 0.0,
    })
}

/// C = N = 0 and K > 0: A is skew, so i A is Hermitian and the roots are exactly imaginary.
fn conservative_modes(hat: &Hat, factor: &Factor, counts: &mut Counts) -> Result<Vec<RawMode>> {
    counts.add("hermitian eigensolutions", 1);
    let a = state_matrix(hat, factor);
    let n = hat.s.nrows();
    let ia = Mat::from_fn(2 * n, 2 * n, |i, j| {
        C::new(0.0, 0.5 * (a[(i, j)] - a[(j, i)]))
    });
    let (w, vectors) = eigen::hermitian(ia.as_ref())?;
    Ok((0..n)
        .map(|j| {
            let s = C::new(0.0, -w[j]);
            let x = right_vector(hat, factor, s, vectors.col(j));
            let y = x.iter().map(|v| v.conj()).collect();
            oscillation(s, x, Some(y))
        })
        .collect())
}

fn oscillation(s: C, x: Vec<C>, y: Option<Vec<C>>) -> RawMode {
    RawMode {
        s,
        partner: s.conj(),
        x,
        y,
        partner_x: None,
        partner_y: None,
        rigid: false,
        known: None,
    }
}

fn damped_modes(hat: &Hat, factor: &Factor, counts: &mut Counts) -> Result<Vec<RawMode>> {
    counts.add("general eigensolutions", 1);
    let (singles, doubles) = zero_directions(hat)?;
    let q = doubles.0.ncols();
    let roots = eigen::general(&state_matrix(hat, factor), hat.has_left)?;
    let kept = without_smallest(&roots.s, q);
    let mut modes: Vec<RawMode> = (0..q).map(|j| zero_mode(hat, &doubles, j)).collect();
    let mut reals: Vec<RealRoot> = (0..singles.0.ncols())
        .map(|j| {
            let (x, y) = zero_vectors(hat, &singles, j);
            real_root(hat, 0.0, x, y, true)
        })
        .collect();
    for j in kept {
        let (s, x, y) = vectors(hat, factor, &roots, j);
        if s.im > 0.0 {
            modes.push(oscillation(s, x, y));
        } else {
            reals.push(real_root(hat, s.re, x, y, false));
        }
    }
    modes.extend(pair(reals, !hat.has_left));
    Ok(modes)
}

type Sides = (Mat<f64>, Mat<f64>);

/// Directions without stiffness: those with a single zero root, and those with a double one (left^T D right singular there).
fn zero_directions(hat: &Hat) -> Result<(Sides, Sides)> {
    let r = hat.right.ncols();
    let empty = Mat::zeros(hat.s.nrows(), 0);
    if r == 0 {
        return Ok(((empty.clone(), empty.clone()), (empty.clone(), empty)));
    }
    let small = hat.left.transpose() * &hat.d * &hat.right;
    let svd = small.svd().map_err(|_| no_svd(r))?;
    let floor = rank_tolerance(hat.s.nrows()) * frobenius(hat.d.as_ref());
    let rank = (0..r).filter(|&i| svd.S()[i] > floor).count();
    let right = &hat.right * svd.V();
    let left = &hat.left * svd.U();
    let part = |a: &Mat<f64>, from: usize, count: usize| {
        if count == 0 {
            Mat::zeros(a.nrows(), 0)
        } else {
            real_aligned(a.subcols(from, count))
        }
    };
    Ok((
        (part(&right, 0, rank), part(&left, 0, rank)),
        (part(&right, rank, r - rank), part(&left, rank, r - rank)),
    ))
}

fn real_aligned(a: MatRef<'_, f64>) -> Mat<f64> {
    let turned = aligned(to_complex(a).as_ref());
    completed(Mat::from_fn(a.nrows(), a.ncols(), |i, j| turned[(i, j)].re).as_ref()).0
}

fn zero_vectors(hat: &Hat, sides: &Sides, j: usize) -> (Vec<C>, Option<Vec<C>>) {
    let column = |a: &Mat<f64>| (0..a.nrows()).map(|i| real(a[(i, j)])).collect();
    (column(&sides.0), hat.has_left.then(|| column(&sides.1)))
}

fn zero_mode(hat: &Hat, sides: &Sides, j: usize) -> RawMode {
    let (x, y) = zero_vectors(hat, sides, j);
    RawMode {
        rigid: true,
        ..oscillation(C::ZERO, x, y)
    }
}

fn double_zero(free: &Mat<f64>, j: usize, has_left: bool) -> RawMode {
    let x: Vec<C> = (0..free.nrows()).map(|i| real(free[(i, j)])).collect();
    let y = has_left.then(|| x.clone());
    RawMode {
        rigid: true,
        ..oscillation(C::ZERO, x, y)
    }
}

/// All roots but the `q` smallest, which are zero roots blurred by rounding. A complex pair counts twice.
fn without_smallest(s: &[C], q: usize) -> Vec<usize> {
    let mut order: Vec<usize> = (0..s.len()).collect();
    order.sort_by(|&a, &b| s[a].norm().total_cmp(&s[b].norm()));
    let mut left = q;
    order.retain(|&j| {
        let weight = if s[j].im > 0.0 { 2 } else { 1 };
        let dropped = weight <= left;
        left -= if dropped { weight } else { 0 };
        !dropped
    });
    order
}

/// The state vector holds x twice; the larger part is the accurate one.
fn right_vector(hat: &Hat, factor: &Factor, s: C, z: ColRef<'_, C>) -> Vec<C> {
    let n = hat.s.nrows();
    let top: Vec<C> = (0..n).map(|i| z[i]).collect();
    let bottom: Vec<C> = (n..z.nrows()).map(|i| z[i]).collect();
    if norm(&top) >= norm(&bottom) || bottom.is_empty() {
        return top;
    }
    let other: Vec<C> = top.iter().map(|v| v / s).collect();
    unit(factor.right(&bottom, &other, &hat.right))
}

fn left_vector(hat: &Hat, factor: &Factor, s: C, z: ColRef<'_, C>) -> Vec<C> {
    let n = hat.s.nrows();
    let top: Vec<C> = (0..n).map(|i| z[i]).collect();
    let bottom: Vec<C> = (n..z.nrows()).map(|i| -s * z[i]).collect();
    if s.norm() * norm(&top) >= norm(&bottom) {
        return top;
    }
    factor.left(&bottom, &top, &hat.left).map_or(top, unit)
}

fn norm(v: &[C]) -> f64 {
    v.iter().map(|v| v.norm_sqr()).sum::<f64>().sqrt()
}

fn unit(mut v: Vec<C>) -> Vec<C> {
    let size = norm(&v);
    if size > 0.0 {
        v.iter_mut().for_each(|v| *v /= size);
    }
    v
}

fn vectors(hat: &Hat, factor: &Factor, roots: &Roots, j: usize) -> (C, Vec<C>, Option<Vec<C>>) {
    let s = roots.s[j];
    let x = right_vector(hat, factor, s, roots.right.col(j));
    let y = roots
        .left
        .as_ref()
        .map(|left| left_vector(hat, factor, s, left.col(j)));
    (s, x, y)
}

fn real_root(hat: &Hat, s: f64, x: Vec<C>, y: Option<Vec<C>>, zero: bool) -> RealRoot {
    let n = x.len();
    let square: f64 = x.iter().map(|v| v.norm_sqr()).sum();
    let damping: f64 = (0..n)
        .map(|i| x[i].re * (0..n).map(|j| hat.d[(i, j)] * x[j].re).sum::<f64>())
        .sum();
    let scale = 2.0 * s.abs() * square + damping.abs();
    let sign = if scale > 0.0 {
        (2.0 * s * square + damping) / scale
    } else {
        0.0
    };
    RealRoot {
        s,
        sign,
        x,
        y,
        zero,
    }
}

fn each_vector(mode: &mut RawMode, change: impl Fn(&mut Vec<C>)) {
    change(&mut mode.x);
    for v in [&mut mode.y, &mut mode.partner_x, &mut mode.partner_y]
        .into_iter()
        .flatten()
    {
        change(v);
    }
}

fn lift(mode: &mut RawMode, basis: MatRef<'_, f64>) {
    each_vector(mode, |v| {
        *v = (0..basis.nrows())
            .map(|i| (0..basis.ncols()).map(|j| v[j] * basis[(i, j)]).sum())
            .collect();
    });
}

/// Out of the mass-orthonormal coordinates: x = L^-T x^.
fn to_coordinates(mode: &mut RawMode, l: &Mat<f64>) {
    each_vector(mode, |v| *v = back_substituted(l, v));
}
