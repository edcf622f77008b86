//! Any damping, gyroscopic and circulatory terms: zero roots are split off by rank decisions, the others are those of a state
//! matrix.
use faer::{Mat, MatRef};

use super::pairing::{RealRoot, pair};
use super::quality::Correction;
use super::rigid::{general_null, no_svd, polished, rank_tolerance, symmetric_null};
use super::state::{Candidate, Factor, back_substitute, candidates, right_vectors, state_matrix};
use super::subspace::aligned;
use super::{Raw, RawMode};
use crate::error::Result;
use crate::linalg::dense::{C, completed, frobenius, real, reduced, symmetrised, to_complex};
use crate::linalg::eigen;
use crate::run::Counts;
use crate::second_order::SecondOrder;

/// The system in mass-orthonormal coordinates.
pub struct Hat {
    pub d: Mat<f64>,
    pub s: Mat<f64>,
    /// Orthonormal right and left null vectors of s.
    pub right: Mat<f64>,
    pub left: Mat<f64>,
    pub symmetric: bool,
    pub has_left: bool,
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
    let mut vectors: Vec<&mut Vec<C>> = modes.iter_mut().flat_map(RawMode::vectors).collect();
    back_substitute(l, &mut vectors); // out of the mass-orthonormal coordinates
    Ok(Raw {
        modes,
        route: route(system, conservative),
        may_be_defective: !conservative,
        correction: if system.mf.is_some() {
            // the residual of an assembled M would undo what its factor knows
            Correction::None
        } else if conservative {
            Correction::Imaginary
        } else {
            Correction::Any
        },
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
    let d = system.velocity().map_or_else(|| Mat::zeros(n, n), |d| reduced(l.as_ref(), d.as_ref()));
    let (right, left) = if system.n.is_some() {
        general_null(system.position().as_ref(), counts)?
    } else {
        let null = symmetric_null(system.k.as_ref(), counts)?;
        (null.clone(), null)
    };
    let orthonormal = |z: &Mat<f64>| completed((l.transpose() * z).as_ref()).0;
    let (mut right, mut left) = (orthonormal(&right), orthonormal(&left));
    if right.ncols() > 0 {
        (right, left) = polished(s.as_ref(), &right, &left);
        if system.n.is_none() {
            left = right.clone();
        }
    }
    Ok(Hat {
        d,
        s,
        right,
        left,
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
    let inner = Hat { d: inside(&whole.d), s: symmetrised(inside(&whole.s)), right: held.clone(), left: held, ..whole };
    Ok((inner, Some(basis), free))
}

/// Splits span(z) into directions that `a` moves and directions with |a z| <= floor.
fn split_null(a: &Mat<f64>, z: &Mat<f64>, floor: f64) -> Result<(Mat<f64>, Mat<f64>)> {
    let r = z.ncols();
    let image = a * z;
    let tall = Mat::from_fn(image.nrows().max(r), r, |i, j| if i < image.nrows() { image[(i, j)] } else { 0.0 });
    let svd = tall.thin_svd().map_err(|_| no_svd(r))?;
    let sigma = svd.S().column_vector();
    let rank = (0..r).filter(|&i| sigma[i] > floor).count();
    let turned = z * svd.V();
    Ok((turned.subcols(0, rank).to_owned(), turned.subcols(rank, r - rank).to_owned()))
}

/// C = N = 0 and K > 0: A is skew, so i A is Hermitian and the roots are exactly imaginary.
fn conservative_modes(hat: &Hat, factor: &Factor, counts: &mut Counts) -> Result<Vec<RawMode>> {
    counts.add("hermitian eigensolutions", 1);
    let a = state_matrix(hat, factor);
    let n = hat.s.nrows();
    let ia = Mat::from_fn(2 * n, 2 * n, |i, j| C::new(0.0, 0.5 * (a[(i, j)] - a[(j, i)])));
    let (w, vectors) = eigen::hermitian(ia.as_ref())?;
    let s: Vec<C> = (0..n).map(|j| C::new(0.0, -w[j])).collect();
    let shapes = right_vectors(hat, factor, &s, vectors.as_ref());
    let mode = |(s, x): (C, Vec<C>)| {
        let y = x.iter().map(|v| v.conj()).collect();
        oscillation(s, x, Some(y))
    };
    Ok(s.into_iter().zip(shapes).map(mode).collect())
}

fn oscillation(s: C, x: Vec<C>, y: Option<Vec<C>>) -> RawMode {
    RawMode {
        s,
        partner: if s == C::ZERO { s } else { s.conj() },
        x,
        y,
        partner_x: None,
        partner_y: None,
        rigid: false,
        known: None,
    }
}

fn damped_modes(hat: &Hat, factor: &Factor, counts: &mut Counts) -> Result<Vec<RawMode>> {
    let (singles, doubles) = zero_directions(hat)?;
    let q = doubles.0.ncols();
    let roots = without_smallest(candidates(hat, factor, counts)?, q);
    let mut modes: Vec<RawMode> = (0..q).map(|j| zero_mode(hat, &doubles, j)).collect();
    let mut reals: Vec<RealRoot> = (0..singles.0.ncols())
        .map(|j| {
            let (x, y) = zero_vectors(hat, &singles, j);
            real_root(hat, 0.0, x, y, true)
        })
        .collect();
    for Candidate { s, x, y } in roots {
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
        if count == 0 { Mat::zeros(a.nrows(), 0) } else { real_aligned(a.subcols(from, count)) }
    };
    Ok(((part(&right, 0, rank), part(&left, 0, rank)), (part(&right, rank, r - rank), part(&left, rank, r - rank))))
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
    RawMode { rigid: true, ..oscillation(C::ZERO, x, y) }
}

fn double_zero(free: &Mat<f64>, j: usize, has_left: bool) -> RawMode {
    let x: Vec<C> = (0..free.nrows()).map(|i| real(free[(i, j)])).collect();
    let y = has_left.then(|| x.clone());
    RawMode { rigid: true, ..oscillation(C::ZERO, x, y) }
}

/// All roots but the `q` smallest, which are zero roots blurred by rounding. A complex pair counts twice.
fn without_smallest(mut roots: Vec<Candidate>, q: usize) -> Vec<Candidate> {
    roots.sort_by(|a, b| a.s.norm().total_cmp(&b.s.norm()));
    let mut left = q;
    roots.retain(|root| {
        let weight = if root.s.im > 0.0 { 2 } else { 1 };
        let dropped = weight <= left;
        left -= if dropped { weight } else { 0 };
        !dropped
    });
    roots
}

fn real_root(hat: &Hat, s: f64, x: Vec<C>, y: Option<Vec<C>>, zero: bool) -> RealRoot {
    let n = x.len();
    let square: f64 = x.iter().map(|v| v.norm_sqr()).sum();
    let damping: f64 = (0..n).map(|i| x[i].re * (0..n).map(|j| hat.d[(i, j)] * x[j].re).sum::<f64>()).sum();
    let scale = 2.0 * s.abs() * square + damping.abs();
    let sign = if scale > 0.0 { (2.0 * s * square + damping) / scale } else { 0.0 };
    RealRoot { s, sign, x, y, zero }
}

fn lift(mode: &mut RawMode, basis: MatRef<'_, f64>) {
    for v in mode.vectors() {
        let mut out = vec![C::ZERO; basis.nrows()];
        for (j, value) in v.iter().enumerate() {
            for (i, out) in out.iter_mut().enumerate() {
                *out += value * basis[(i, j)];
            }
        }
        *v = out;
    }
}
