//! Newton's method on the eigenvalue problem itself, for the few pairs that the eigensolver left inaccurate.
use faer::Mat;
use faer::linalg::solvers::PartialPivLu;
use faer::prelude::*;

use super::RawMode;
use super::quality::{Correction, Quality, Terms, evaluate};
use crate::linalg::dense::{C, EPS};
use crate::run::Counts;

const STEPS: usize = 2;

/// Backward error that is good enough: rounding grows with the size.
pub fn good_enough(n: usize) -> f64 {
    n.max(16) as f64 * EPS
}

/// Improves each mode whose backward error is too large; a step that does not lower it is dropped.
pub fn refine(terms: &Terms, modes: &mut [RawMode], quality: &mut [Quality], counts: &mut Counts) {
    let goal = good_enough(terms.m.nrows());
    for (mode, quality) in modes.iter_mut().zip(quality) {
        for _ in 0..STEPS {
            let poor = quality.backward > goal || quality.backward.is_nan();
            if mode.rigid || mode.known.is_some() || !poor {
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
            (mode.s, mode.x, mode.y) = (s, x, y);
            if mode.partner.im != 0.0 {
                mode.partner = s.conj();
            }
        }
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
    let qx = &q * &x;
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
