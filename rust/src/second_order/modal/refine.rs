//! Newton's method on the eigenvalue problem itself, for the few pairs that the eigensolver left inaccurate.
use faer::Mat;
use faer::linalg::solvers::PartialPivLu;
use faer::prelude::*;

use super::RawMode;
use super::quality::{Correction, Quality, Terms, evaluate};
use super::simultaneous::{Corrections, Projections};
use crate::linalg::dense::{C, EPS};
use crate::linalg::double_double::{Dd, matrix_times};
use crate::run::Counts;
use crate::tolerances::modes::{CLOSEST, LARGEST_CORRECTION, LIGHT};

const STEPS: usize = 2;

/// Backward error that is good enough: rounding grows with the size.
pub fn good_enough(n: usize) -> f64 {
    n.max(16) as f64 * EPS
}

/// Improves each mode whose backward error is too large; a step that does not lower it is dropped. Modes whose vectors may be
/// wrong although their residuals are small beside the matrices are followed by Newton's method until they stand still.
pub fn refine(terms: &Terms, modes: &mut [RawMode], quality: &mut [Quality], counts: &mut Counts) {
    let goal = good_enough(terms.m.nrows());
    for _ in 0..STEPS {
        if !correct_at_once(terms, modes, quality, counts) {
            break;
        }
    }
    let mut followed = Vec::new();
    for (j, (mode, quality)) in modes.iter_mut().zip(quality.iter_mut()).enumerate() {
        if mode.rigid || mode.known.is_some() {
            continue;
        }
        if quality.is_doubtful() {
            follow(terms, mode, quality, counts);
            followed.push(j);
            continue;
        }
        for _ in 0..STEPS {
            if quality.backward <= goal {
                break;
            }
            counts.add("refinements", 1);
            let Some((s, x, y)) = step(terms, mode, quality.denominator) else {
                break;
            };
            let better = judged(terms, s, &x, y.as_deref());
            if better.backward.is_nan() || better.backward >= quality.backward {
                break;
            }
            *quality = better;
            set(mode, s, x, y);
        }
    }
    for &j in &followed {
        let found_twice = |k: usize| k != j && (modes[k].s - modes[j].s).norm() <= CLOSEST * modes[j].s.norm();
        if (0..modes.len()).any(|k| found_twice(k) && cosine(&modes[k].x, &modes[j].x) > 1.0 - CLOSEST) {
            quality[j].error = f64::INFINITY;
        }
    }
}

/// Corrects all modes whose backward errors are too large by all modes, without a factorisation; false where none has become better.
/// Only complex pairs with equal right and left vectors.
fn correct_at_once(terms: &Terms, modes: &mut [RawMode], quality: &mut [Quality], counts: &mut Counts) -> bool {
    let is_pair = |m: &RawMode| m.s.im > 0.0 && m.y.is_none() && m.known.is_none();
    if !modes.iter().all(is_pair) {
        return false;
    }
    let goal = good_enough(terms.m.nrows());
    let poor: Vec<usize> =
        (0..modes.len()).filter(|&j| quality[j].backward > goal && !quality[j].is_doubtful()).collect();
    if poor.len() < 2 {
        return false;
    }
    counts.add("corrections of modes", poor.len() as u64);
    let (mut roots, vectors, sizes) = corrected_by_all(terms, modes, quality, &poor);
    let judged = evaluate(terms, &mut roots, vectors.as_ref(), None, Correction::None);
    let mut is_better = false;
    for (c, &j) in poor.iter().enumerate() {
        if sizes[c] <= LIGHT && judged[c].backward < quality[j].backward {
            quality[j] = judged[c];
            set(&mut modes[j], roots[c], vectors.col(c).iter().copied().collect(), None);
            is_better = true;
        }
    }
    is_better
}

/// Roots and vectors (columns) of the modes `poor`, corrected once by all modes, and the length of each correction.
fn corrected_by_all(
    terms: &Terms,
    modes: &[RawMode],
    quality: &[Quality],
    poor: &[usize],
) -> (Vec<C>, Mat<C>, Vec<f64>) {
    let n = terms.m.nrows();
    let x = Mat::from_fn(n, modes.len(), |i, j| modes[j].x[i]);
    let residuals: Vec<Vec<C>> = poor.iter().map(|&j| residual(terms, modes[j].s, &modes[j].x)).collect();
    let r = Mat::from_fn(n, poor.len(), |i, c| residuals[c][i]);
    let found = Projections { plain: x.transpose() * &r, conjugate: x.adjoint() * &r };
    let s: Vec<C> = modes.iter().map(|m| m.s).collect();
    let slope: Vec<C> = quality.iter().map(|q| q.denominator).collect();
    let step = Corrections::new(&found, &s, &slope, poor);
    let change = &x * &step.own + x.conjugate() * &step.other;
    let vectors = Mat::from_fn(n, poor.len(), |i, c| x[(i, poor[c])] + change[(i, c)]);
    let roots = poor.iter().enumerate().map(|(c, &j)| s[j] - found.plain[(j, c)] / slope[j]).collect();
    (roots, vectors, step.sizes())
}

const FOLLOWED: usize = 8;

fn set(mode: &mut RawMode, s: C, x: Vec<C>, y: Option<Vec<C>>) {
    (mode.s, mode.x, mode.y) = (s, x, y);
    if mode.partner.im != 0.0 {
        mode.partner = s.conj();
    }
}

fn cosine(a: &[C], b: &[C]) -> f64 {
    let norm = |v: &[C]| v.iter().map(|v| v.norm_sqr()).sum::<f64>().sqrt();
    a.iter().zip(b).map(|(a, b)| a.conj() * b).sum::<C>().norm() / (norm(a) * norm(b))
}

/// Newton's method until the root is constant; its last step is part of the error. A root that does not come to rest near its start
/// stays where it was, with the error that its residual allows.
fn follow(terms: &Terms, mode: &mut RawMode, quality: &mut Quality, counts: &mut Counts) {
    let start = (mode.s, mode.x.clone(), mode.y.clone());
    let before = *quality;
    let mut last = f64::INFINITY;
    for _ in 0..FOLLOWED {
        counts.add("refinements", 1);
        let Some((s, x, y)) = step(terms, mode, quality.denominator) else {
            last = f64::INFINITY;
            break;
        };
        let moved = (s - mode.s).norm() / s.norm();
        if moved >= last || moved.is_nan() {
            break;
        }
        last = moved;
        *quality = judged(terms, s, &x, y.as_deref());
        set(mode, s, x, y);
        if last <= 4.0 * EPS {
            break;
        }
    }
    let is_near = (mode.s - start.0).norm() <= 0.5 * start.0.norm();
    let is_solved = quality.backward <= before.backward.max(good_enough(mode.x.len()));
    if is_near && is_solved && last <= LARGEST_CORRECTION {
        quality.error = if quality.error.is_nan() { quality.error } else { quality.error.max(last) };
    } else {
        set(mode, start.0, start.1, start.2);
        *quality = before;
        quality.error = quality.error.max((quality.backward * quality.normwise).min(1.0));
    }
}

fn judged(terms: &Terms, s: C, x: &[C], y: Option<&[C]>) -> Quality {
    let column = |v: &[C]| Mat::from_fn(v.len(), 1, |i, _| v[i]);
    let (x, y) = (column(x), y.map(column));
    let left = y.as_ref().map(|y| y.as_ref());
    evaluate(terms, &mut [s], x.as_ref(), left, Correction::None)[0]
}

type Triple = (C, Vec<C>, Option<Vec<C>>);

/// One bordered Newton step: [Q, Q' x; x^H, 0] [dx; ds] = -[Q x; 0], and the left vector from the same factors.
fn step(terms: &Terms, mode: &RawMode, denominator: C) -> Option<Triple> {
    let n = mode.x.len();
    let q = terms.dynamic(mode.s, false);
    let x = Col::from_fn(n, |i| mode.x[i]);
    let slope = slope_times(terms, mode.s, &x);
    let bordered = Mat::from_fn(n + 1, n + 1, |i, j| match (i < n, j < n) {
        (true, true) => q[(i, j)],
        (true, false) => slope[i],
        (false, true) => x[j].conj(),
        (false, false) => C::ZERO,
    });
    let lu = bordered.partial_piv_lu();
    let qx = residual(terms, mode.s, &mode.x);
    let mut step = Mat::from_fn(n + 1, 1, |i, _| if i < n { -qx[i] } else { C::ZERO });
    lu.solve_in_place(step.as_mut());
    let ds = step[(n, 0)];
    let s = keep_real(mode, mode.s + ds);
    let mut refined: Vec<C> = (0..n).map(|i| mode.x[i] + step[(i, 0)]).collect();
    if mode.x.iter().all(|v| v.im == 0.0) {
        refined.iter_mut().for_each(|v| v.im = 0.0);
    }
    let y = mode.y.as_ref().map(|_| left_vector(&lu, n, denominator));
    let finite = s.is_finite() && refined.iter().all(|v| v.is_finite());
    finite.then_some((s, refined, y))
}

/// Q(s) x with sums in twice the precision.
fn residual(terms: &Terms, s: C, x: &[C]) -> Vec<C> {
    let part = |f: &dyn Fn(&C) -> f64| x.iter().map(|v| Dd::new(f(v))).collect::<Vec<Dd>>();
    let (re, im) = (part(&|v| v.re), part(&|v| v.im));
    let both = |a: &Mat<f64>| (matrix_times(a.as_ref(), &re, false), matrix_times(a.as_ref(), &im, false));
    let (square_re, square_im) =
        (Dd::product(s.re, s.re).minus(Dd::product(s.im, s.im)), Dd::product(2.0 * s.re, s.im));
    let mut sum = both(&terms.k);
    let mut add = |(re, im): (Vec<Dd>, Vec<Dd>), a: Dd, b: Dd| {
        for i in 0..re.len() {
            sum.0[i] = sum.0[i].plus(a.times(re[i])).minus(b.times(im[i]));
            sum.1[i] = sum.1[i].plus(a.times(im[i])).plus(b.times(re[i]));
        }
    };
    add(both(&terms.m), square_re, square_im);
    if let Some(d) = &terms.d {
        add(both(d), Dd::new(s.re), Dd::new(s.im));
    }
    sum.0.iter().zip(&sum.1).map(|(re, im)| C::new(re.value(), im.value())).collect()
}

fn keep_real(mode: &RawMode, s: C) -> C {
    if mode.s.im == 0.0 { C::new(s.re, 0.0) } else { s }
}

fn left_vector(lu: &PartialPivLu<C>, n: usize, denominator: C) -> Vec<C> {
    let mut y = Mat::from_fn(n + 1, 1, |i, _| if i < n { C::ZERO } else { denominator });
    lu.solve_transpose_in_place(y.as_mut());
    (0..n).map(|i| y[(i, 0)]).collect()
}

fn slope_times(terms: &Terms, s: C, x: &Col<C>) -> Vec<C> {
    let n = x.nrows();
    (0..n)
        .map(|i| {
            (0..n)
                .map(|j| {
                    let d = terms.d.as_ref().map_or(0.0, |d| d[(i, j)]);
                    (2.0 * s * terms.m[(i, j)] + d) * x[j]
                })
                .sum()
        })
        .collect()
}
