//! The state matrix in energy coordinates, its roots, and the reversed problem for roots that it blurs.
//!
//! With unit masses and a full-rank factorisation K + N = F B the state (x', B x) obeys `A = [-(C + G), -F; B, 0]`. It carries
//! its own scaling (|F| = |B| = |K|^(1/2), as the scaling of Fan, Lin and Van Dooren gives the quadratic problem), it is skew for conservative gyroscopic systems, and it leaves out one zero root for every direction without
//! stiffness.
use faer::prelude::*;
use faer::{Mat, MatRef, Side};

use super::general::Hat;
use super::light_damping;
use super::rigid::no_svd;
use crate::error::Result;
use crate::linalg::dense::{C, frobenius, reduced};
use crate::linalg::eigen;
use crate::run::Counts;
use crate::tolerances::modes::BLURRED;

/// A root (of a complex pair the one with Im > 0) with its vectors in mass-orthonormal coordinates.
pub struct Candidate {
    pub s: C,
    pub x: Vec<C>,
    pub y: Option<Vec<C>>,
}

impl Candidate {
    /// Number of roots that it represents.
    fn weight(&self) -> usize {
        if self.s.im > 0.0 { 2 } else { 1 }
    }
}

/// All roots: from the undamped ones where damping is light, else those of the state matrix.
pub fn candidates(hat: &Hat, factor: &Factor, counts: &mut Counts) -> Result<Vec<Candidate>> {
    if let Factor::Cholesky { lower } = factor
        && let Some(found) = light_damping::candidates(hat, lower, counts)?
    {
        return Ok(found);
    }
    counts.add("general eigensolutions", 1);
    let a = state_matrix(hat, factor);
    let roots = eigen::general(&a, hat.has_left)?;
    let right = right_vectors(hat, factor, &roots.s, roots.right.as_ref());
    let mut left = roots.left.as_ref().map(|left| left_vectors(hat, factor, &roots.s, left.as_ref()).into_iter());
    let candidate = |(s, x): (&C, Vec<C>)| Candidate { s: *s, x, y: left.as_mut().and_then(Iterator::next) };
    let forward: Vec<Candidate> = roots.s.iter().zip(right).map(candidate).collect();
    let smallest = roots.s.iter().fold(f64::INFINITY, |m, s| m.min(s.norm()));
    match factor {
        Factor::Cholesky { lower } if smallest < BLURRED * frobenius(a.as_ref()) => {
            let (backward, scale) = reversed(hat, lower, counts)?;
            let meeting = (frobenius(a.as_ref()) / scale).sqrt();
            Ok(merged(forward, backward, meeting))
        }
        _ => Ok(forward),
    }
}

/// The roots from those of mu^2 K + mu (C + G) + 1, mu = 1/s, and the norm of its state matrix.
fn reversed(hat: &Hat, lower: &Mat<f64>, counts: &mut Counts) -> Result<(Vec<Candidate>, f64)> {
    counts.add("general eigensolutions", 1);
    let n = lower.nrows();
    let d = reduced(lower.as_ref(), hat.d.as_ref());
    let mut inverse = Mat::<f64>::identity(n, n);
    lower.solve_lower_triangular_in_place(inverse.as_mut());
    let a = Mat::from_fn(2 * n, 2 * n, |i, j| match (i < n, j < n) {
        (true, true) => -d[(i, j)],
        (true, false) => -inverse[(i, j - n)],
        (false, true) => inverse[(j, i - n)],
        (false, false) => 0.0,
    });
    let roots = eigen::general(&a, hat.has_left)?;
    let candidate = |j: usize| {
        let mu = roots.s[j];
        let z = roots.right.col(j);
        let (top, bottom) = halves(z, n);
        let x = if norm(&top) > norm(&bottom) { back_substituted(lower, &top) } else { bottom };
        let y = roots.left.as_ref().map(|left| {
            let (top, bottom) = halves(left.col(j), n);
            if norm(&top) > mu.norm() * norm(&bottom) { back_substituted(lower, &top) } else { bottom }
        });
        upper(mu.inv(), unit(x), y.map(unit))
    };
    Ok(((0..roots.s.len()).map(candidate).collect(), frobenius(a.as_ref())))
}

/// The member of a complex pair with Im s > 0.
fn upper(s: C, x: Vec<C>, y: Option<Vec<C>>) -> Candidate {
    let conjugate = |v: Vec<C>| v.into_iter().map(|v| v.conj()).collect();
    if s.im < 0.0 { Candidate { s: s.conj(), x: conjugate(x), y: y.map(conjugate) } } else { Candidate { s, x, y } }
}

/// The small roots of the reversed and the large ones of the forward problem. Both lists stand for the same roots in ascending
/// |s|; they are joined after a number of roots at which neither splits a complex pair, as near to `meeting` as possible.
fn merged(mut forward: Vec<Candidate>, mut backward: Vec<Candidate>, meeting: f64) -> Vec<Candidate> {
    let ascending = |a: &Candidate, b: &Candidate| a.s.norm().total_cmp(&b.s.norm());
    forward.sort_by(ascending);
    backward.sort_by(ascending);
    let boundaries = |list: &[Candidate]| -> Vec<usize> {
        list.iter()
            .scan(0, |sum, c| {
                *sum += c.weight();
                Some(*sum)
            })
            .collect()
    };
    let (ahead, behind) = (boundaries(&forward), boundaries(&backward));
    let mut best = (f64::INFINITY, 0, 0);
    for (f, count) in ahead.iter().enumerate() {
        let Ok(b) = behind.binary_search(count) else {
            continue;
        };
        let next = forward.get(f + 1).map_or(f64::INFINITY, |c| c.s.norm());
        let middle = (backward[b].s.norm() * next.min(1e300)).sqrt();
        let distance = (middle / meeting).ln().abs();
        if distance < best.0 {
            best = (distance, f + 1, b + 1);
        }
    }
    backward.truncate(best.2);
    backward.extend(forward.into_iter().skip(best.1));
    backward
}

fn halves(z: ColRef<'_, C>, n: usize) -> (Vec<C>, Vec<C>) {
    ((0..n).map(|i| z[i]).collect(), (n..z.nrows()).map(|i| z[i]).collect())
}

/// K + N = F B with F of full column and B of full row rank.
pub enum Factor {
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
    pub fn new(hat: &Hat, counts: &mut Counts) -> Result<Self> {
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
            return Ok(Factor::Split { u: pick(true), sigma, v: pick(false) });
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

    /// y from F^T y = w, or `other` where nothing else is at hand.
    fn left(&self, w: &[C], other: &[C], null: &Mat<f64>) -> Vec<C> {
        match self {
            Factor::Cholesky { lower } => back_substituted(lower, w),
            Factor::Split { u, sigma, .. } => combined(u, sigma, w, other, null),
            Factor::Plain { .. } => other.to_vec(),
        }
    }
}

fn back_substituted(lower: &Mat<f64>, w: &[C]) -> Vec<C> {
    let mut x = w.to_vec();
    back_substitute(lower, &mut [&mut x]);
    x
}

/// L^-T of vectors, all at once.
pub fn back_substitute(lower: &Mat<f64>, vectors: &mut [&mut Vec<C>]) {
    let n = lower.nrows();
    let mut parts = Mat::from_fn(n, 2 * vectors.len(), |i, j| {
        let z = vectors[j / 2][i];
        if j % 2 == 0 { z.re } else { z.im }
    });
    lower.transpose().solve_upper_triangular_in_place(parts.as_mut());
    for (j, v) in vectors.iter_mut().enumerate() {
        for (i, z) in v.iter_mut().enumerate() {
            *z = C::new(parts[(i, 2 * j)], parts[(i, 2 * j + 1)]);
        }
    }
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

pub fn state_matrix(hat: &Hat, factor: &Factor) -> Mat<f64> {
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

/// The state vector holds x twice; the larger part is the accurate one.
pub fn right_vectors(hat: &Hat, factor: &Factor, s: &[C], z: MatRef<'_, C>) -> Vec<Vec<C>> {
    let n = hat.s.nrows();
    let part = |j: usize| {
        let (top, bottom) = halves(z.col(j), n);
        if norm(&top) >= norm(&bottom) || bottom.is_empty() {
            return Part::Ready(top);
        }
        let other = if s[j] == C::ZERO { vec![C::ZERO; n] } else { top.iter().map(|v| v / s[j]).collect() };
        Part::Behind { factor: bottom, other }
    };
    ahead((0..s.len()).map(part).collect(), factor, |w, other| factor.right(w, other, &hat.right))
}

fn left_vectors(hat: &Hat, factor: &Factor, s: &[C], z: MatRef<'_, C>) -> Vec<Vec<C>> {
    let n = hat.s.nrows();
    let part = |j: usize| {
        let (top, mut bottom) = halves(z.col(j), n);
        bottom.iter_mut().for_each(|v| *v *= -s[j]);
        if matches!(factor, Factor::Plain { .. }) || s[j].norm() * norm(&top) >= norm(&bottom) {
            return Part::Ready(top);
        }
        Part::Behind { factor: bottom, other: top }
    };
    ahead((0..s.len()).map(part).collect(), factor, |w, other| factor.left(w, other, &hat.left))
}

/// A vector, or its product with a factor of the stiffness and what the other half of the state tells of it.
enum Part {
    Ready(Vec<C>),
    Behind { factor: Vec<C>, other: Vec<C> },
}

/// All vectors, of those behind a factor units; a triangular one serves all at once.
fn ahead(parts: Vec<Part>, factor: &Factor, single: impl Fn(&[C], &[C]) -> Vec<C>) -> Vec<Vec<C>> {
    let mut behind = Vec::new();
    let mut out: Vec<Vec<C>> = Vec::with_capacity(parts.len());
    for part in parts {
        match (part, factor) {
            (Part::Ready(x), _) => out.push(x),
            (Part::Behind { factor: w, .. }, Factor::Cholesky { .. }) => {
                behind.push(out.len());
                out.push(w);
            }
            (Part::Behind { factor: w, other }, _) => out.push(unit(single(&w, &other))),
        }
    }
    if let Factor::Cholesky { lower } = factor {
        let mut is_behind = behind.into_iter().peekable();
        let chosen = |(j, _): &(usize, &mut Vec<C>)| is_behind.next_if_eq(j).is_some();
        let mut vectors: Vec<&mut Vec<C>> = out.iter_mut().enumerate().filter(chosen).map(|(_, v)| v).collect();
        back_substitute(lower, &mut vectors);
        vectors.into_iter().for_each(|v| *v = unit(std::mem::take(v)));
    }
    out
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
