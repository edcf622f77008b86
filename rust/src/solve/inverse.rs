//! An estimate H of the inverse Jacobian, dense or of limited memory, and its rank-one and rank-two updates.
use std::sync::{Arc, Mutex, PoisonError};

use faer::Mat;
use faer::linalg::solvers::DenseSolveCore;

use super::limited_memory::Pairs;
use super::line_search::{dot, norm2};
use crate::linalg::dense::{is_finite, is_singular};
use crate::linalg::sparse::Factor;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Family {
    /// H+ = (I - s y^T/(y^T s)) H (I - y s^T/(y^T s)) + s s^T/(y^T s): keeps symmetry.
    Bfgs,
    /// H+ = H + (s - H y) s^T H/(s^T H y), the inverse of Broyden's first update.
    Broyden,
}

/// When an update is left out, so that H stays regular.
#[derive(Debug, Clone, Copy)]
pub struct Guard {
    /// Least |cos| of the angle between y and s (BFGS).
    pub curvature: f64,
    /// Bounds of |det H+ / det H|.
    pub determinant: (f64, f64),
}

/// H before the pairs of a limited memory.
#[derive(Clone)]
pub enum Base {
    Identity,
    Lu(Arc<Mutex<Factor>>),
}

#[derive(Clone)]
pub enum Inverse {
    /// Row-major, n x n.
    Dense { n: usize, h: Vec<f64> },
    Limited {
        base: Base,
        pairs: Pairs,
        /// What the pairs mean.
        family: Family,
    },
}

/// One accepted step, as the updates need it: s = -lambda H f.
pub struct Step<'a> {
    pub s: &'a [f64],
    pub y: &'a [f64],
    /// The residual at the start of the step.
    pub f: &'a [f64],
    pub lambda: f64,
}

impl Inverse {
    pub fn limited(base: Base, room: usize, family: Family) -> Inverse {
        let pairs = Pairs::new(room);
        Inverse::Limited { base, pairs, family }
    }

    pub fn identity(n: usize) -> Inverse {
        let mut h = vec![0.0; n * n];
        (0..n).for_each(|i| h[i * n + i] = 1.0);
        Inverse::Dense { n, h }
    }

    /// The inverse of a Jacobian, or None where not a digit of it is sure. O(n^3).
    pub fn of(jacobian: &Mat<f64>) -> Option<Inverse> {
        let n = jacobian.nrows();
        if !is_finite(jacobian.as_ref()) {
            return None;
        }
        let inverse = jacobian.partial_piv_lu().inverse();
        let regular = (0..n).all(|j| (0..n).all(|i| inverse[(i, j)].is_finite()))
            && !is_singular(10.0 * inverse.norm_l2() * jacobian.norm_l2());
        regular.then(|| Inverse::dense(&inverse))
    }

    /// V S (S^2 + mu^2)^-1 U^T with mu = 1e-8 of the largest singular value: a bounded stand-in where the inverse does not exist.
    pub fn regularised(jacobian: &Mat<f64>) -> Option<Inverse> {
        let n = jacobian.nrows();
        if !is_finite(jacobian.as_ref()) {
            return None;
        }
        let svd = jacobian.svd().ok()?;
        let (u, v) = (svd.U(), svd.V());
        let sigma: Vec<f64> = (0..n).map(|i| svd.S().column_vector()[i]).collect();
        let mu = f64::EPSILON.sqrt() * sigma.first().copied().filter(|s| *s > 0.0)?;
        let scaled = Mat::from_fn(n, n, |i, j| v[(i, j)] * sigma[j] / (sigma[j] * sigma[j] + mu * mu));
        Some(Inverse::dense(&(scaled * u.transpose())))
    }

    fn dense(h: &Mat<f64>) -> Inverse {
        let n = h.nrows();
        let h = (0..n * n).map(|k| h[(k / n, k % n)]).collect();
        Inverse::Dense { n, h }
    }

    /// A limited form only serves the family of its pairs.
    pub fn serves(&self, wanted: Family) -> bool {
        !matches!(self, Inverse::Limited { family, .. } if *family != wanted)
    }

    /// out = H r. O(n^2), or O(m n).
    pub fn apply(&self, r: &[f64], out: &mut [f64]) {
        match self {
            Inverse::Dense { n, h } => {
                for (o, row) in out.iter_mut().zip(h.chunks_exact(*n)) {
                    *o = dot(row, r);
                }
            }
            Inverse::Limited { base, pairs, family } => {
                out.copy_from_slice(r);
                match family {
                    Family::Bfgs => pairs.apply_bfgs(out, |v| base.apply(v)),
                    Family::Broyden => pairs.apply_broyden(out, |v| base.apply(v)),
                }
            }
        }
    }

    /// Takes the step into H unless the guard forbids it; returns whether it did.
    pub fn update(&mut self, family: Family, guard: &Guard, step: &Step<'_>) -> bool {
        let mut hy = vec![0.0; step.s.len()];
        self.apply(step.y, &mut hy);
        match family {
            Family::Bfgs => self.update_bfgs(guard, step, &hy),
            Family::Broyden => self.update_broyden(guard, step, &hy),
        }
    }

    fn update_bfgs(&mut self, guard: &Guard, step: &Step<'_>, hy: &[f64]) -> bool {
        let ys = dot(step.y, step.s);
        // s^T H^-1 s = -lambda s^T f because s = -lambda H f: the determinant costs nothing
        let ratio = -step.lambda * dot(step.s, step.f) / ys;
        let turned = ys.abs() > guard.curvature * norm2(step.y) * norm2(step.s);
        if !(turned && guard.admits(ratio)) {
            return false;
        }
        match self {
            Inverse::Dense { n, h } => {
                let mut yh = vec![0.0; *n];
                for (y, row) in step.y.iter().zip(h.chunks_exact(*n)) {
                    for (out, v) in yh.iter_mut().zip(row) {
                        *out += y * v;
                    }
                }
                let twice = (1.0 + dot(step.y, hy) / ys) / ys;
                for (i, row) in h.chunks_exact_mut(*n).enumerate() {
                    let (a, b) = (step.s[i] / ys, hy[i] / ys);
                    for (j, v) in row.iter_mut().enumerate() {
                        *v += twice * step.s[i] * step.s[j] - a * yh[j] - b * step.s[j];
                    }
                }
            }
            Inverse::Limited { pairs, .. } => pairs.push(step.s, step.y),
        }
        true
    }

    fn update_broyden(&mut self, guard: &Guard, step: &Step<'_>, hy: &[f64]) -> bool {
        let shy = dot(step.s, hy);
        if !guard.admits(dot(step.s, step.s) / shy) {
            return false;
        }
        let a: Vec<f64> = step.s.iter().zip(hy).map(|(s, h)| (s - h) / shy).collect();
        match self {
            Inverse::Dense { n, h } => {
                let mut sh = vec![0.0; *n];
                for (s, row) in step.s.iter().zip(h.chunks_exact(*n)) {
                    for (out, v) in sh.iter_mut().zip(row) {
                        *out += s * v;
                    }
                }
                for (a, row) in a.iter().zip(h.chunks_exact_mut(*n)) {
                    for (v, sh) in row.iter_mut().zip(&sh) {
                        *v += a * sh;
                    }
                }
            }
            Inverse::Limited { pairs, .. } => {
                if pairs.s.len() == pairs.room {
                    pairs.clear();
                } else {
                    pairs.push(step.s, &a);
                }
            }
        }
        true
    }
}

impl Guard {
    fn admits(&self, ratio: f64) -> bool {
        ratio.abs() >= self.determinant.0 && ratio.abs() <= self.determinant.1
    }
}

impl Base {
    fn apply(&self, r: &mut [f64]) {
        if let Base::Lu(factor) = self {
            let mut x = Mat::from_fn(r.len(), 1, |i, _| r[i]);
            let factor = factor.lock().unwrap_or_else(PoisonError::into_inner);
            factor.solve(x.as_mut());
            r.iter_mut().enumerate().for_each(|(i, v)| *v = x[(i, 0)]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const GUARD: Guard = Guard { curvature: 1e-12, determinant: (1e-10, 1e10) };

    /// H y = s after an update of either family, dense or limited, and both forms apply alike.
    #[test]
    fn secant_equation_and_forms_agree() {
        for family in [Family::Bfgs, Family::Broyden] {
            let mut whole = Inverse::identity(3);
            let mut few = Inverse::limited(Base::Identity, 5, family);
            for k in 0..4 {
                let f = [1.0, -0.5 + k as f64, 0.3];
                let mut s = [0.0; 3];
                whole.apply(&f, &mut s);
                s.iter_mut().for_each(|v| *v *= -0.5);
                let y = [0.9 * s[0] + 0.2 * s[1], 1.5 * s[1] - 0.1 * s[2], 0.7 * s[2]];
                let step = Step { s: &s, y: &y, f: &f, lambda: 0.5 };
                assert_eq!(whole.update(family, &GUARD, &step), few.update(family, &GUARD, &step));
                let (mut a, mut b) = ([0.0; 3], [0.0; 3]);
                whole.apply(&y, &mut a);
                few.apply(&y, &mut b);
                for i in 0..3 {
                    assert!((a[i] - s[i]).abs() < 1e-12, "{family:?} {a:?} {s:?}");
                    assert!((a[i] - b[i]).abs() < 1e-12, "{family:?} {a:?} {b:?}");
                }
            }
        }
    }

    #[test]
    fn nothing_is_made_of_what_is_no_number() {
        let j = Mat::from_fn(2, 2, |i, _| if i == 0 { f64::NAN } else { 1.0 });
        assert!(Inverse::of(&j).is_none() && Inverse::regularised(&j).is_none());
    }
}
