//! How good each pair is: backward error, condition, first-order error, distance from a defective root.
use faer::prelude::*;
use faer::{Mat, MatRef};

use crate::linalg::dense::{C, EPS, abs, absolute, dot, exceeds, frobenius, modulus, real_times};
use crate::second_order::SecondOrder;
use crate::tolerances::modes::{
    CLOSEST, DOUBLE_ROOT, DOUBTFUL, LARGEST_CORRECTION, MEETING, NEAR_DEFECTIVE, SEPARATED,
};

/// Q(s) = s^2 m + s d + k with the norms that backward errors refer to.
pub struct Terms {
    pub m: Mat<f64>,
    pub d: Option<Mat<f64>>,
    pub k: Mat<f64>,
    norms: [f64; 3],
}

impl Terms {
    pub fn new(system: &SecondOrder) -> Self {
        let (m, d, k) = (system.m.clone(), system.velocity(), system.position());
        let norms = [frobenius(m.as_ref()), d.as_ref().map_or(0.0, |d| frobenius(d.as_ref())), frobenius(k.as_ref())];
        Terms { m, d, k, norms }
    }

    /// |s|^2 |M| + |s| |D| + |S| in the Frobenius norm.
    fn norm(&self, s: f64) -> f64 {
        s * s * self.norms[0] + s * self.norms[1] + self.norms[2]
    }

    /// Q(s), or its transpose.
    pub fn dynamic(&self, s: C, transposed: bool) -> Mat<C> {
        let n = self.m.nrows();
        Mat::from_fn(n, n, |i, j| {
            let (i, j) = if transposed { (j, i) } else { (i, j) };
            let damping = self.d.as_ref().map_or(C::ZERO, |d| s * d[(i, j)]);
            s * s * self.m[(i, j)] + damping + self.k[(i, j)]
        })
    }

    /// The products of m, d and k (transposed where asked) with the columns of x.
    fn products(&self, x: MatRef<'_, C>, transposed: bool) -> Products {
        let turn = |a: &Mat<f64>| {
            if transposed { real_times(a.transpose(), x) } else { real_times(a.as_ref(), x) }
        };
        Products { m: turn(&self.m), d: self.d.as_ref().map(turn), k: turn(&self.k) }
    }
}

struct Products {
    m: Mat<C>,
    d: Option<Mat<C>>,
    k: Mat<C>,
}

impl Products {
    fn residual(&self, s: C, i: usize, j: usize) -> C {
        let damping = self.d.as_ref().map_or(C::ZERO, |d| s * d[(i, j)]);
        s * s * self.m[(i, j)] + damping + self.k[(i, j)]
    }
}

impl Quality {
    /// Whether a root of this kind may have been found from a vector that is wrong.
    pub fn is_doubtful(&self) -> bool {
        exceeds(self.backward * self.normwise, DOUBTFUL)
    }

    /// Where more than two roots almost meet, a root moves like a higher root of its residual. One of m roots of p that almost meet is
    /// at most m |p / p'| from here, whatever their order: m times the first-order estimate at the computed root, which rounding has
    /// moved away from the others. `distances` are those to all other roots.
    pub fn heed_neighbours(&mut self, s: C, distances: &[f64]) {
        let nearest = distances.iter().copied().fold(f64::INFINITY, f64::min);
        let pairwise = DOUBLE_ROOT * self.curvature * nearest / s.norm().max(f64::MIN_POSITIVE);
        if self.separation < NEAR_DEFECTIVE && self.denominator.norm() < pairwise {
            let meeting = 1 + distances.iter().filter(|d| **d <= MEETING * nearest).count();
            self.error = self.error.max(meeting as f64 * self.single);
        }
    }
}

#[derive(Debug, Clone, Copy)]
pub struct Quality {
    /// |Q(s) x| / ((|s|^2 |M| + |s| |D| + |S|) |x|), the larger of right and left.
    pub backward: f64,
    /// Relative change of s for a relative change of every matrix entry.
    pub condition: f64,
    /// First-order relative error of s by this residual, and what rounding may hide in it.
    pub error: f64,
    /// The same without regard to a second root that may be near, but with the rounding of all entries.
    pub single: f64,
    /// |s| |psi^T M phi|: half of psi^T Q''(s) phi, times |s|.
    pub curvature: f64,
    /// Relative change of s for relative changes of the matrices as a whole.
    pub normwise: f64,
    /// psi^T Q(s) phi and psi^T Q'(s) phi.
    pub defect: C,
    pub denominator: C,
    /// Absolute distance within which another root cannot be told from this one.
    pub tolerance: f64,
    /// |psi^T Q'(s) phi| relative to the sum of its terms' moduli.
    pub separation: f64,
}

/// Share of EPS that the rounding of a residual usually leaves in each of its terms.
const ROUNDING: f64 = 0.25 * EPS;
const BLUR: f64 = 16.0 * EPS;

/// How an evaluation may move the roots by their first-order error y^T Q(s) x / y^T Q'(s) x, which it computes anyway.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Correction {
    None,
    /// Real roots stay real.
    Any,
    /// Roots are known to be imaginary.
    Imaginary,
}

pub fn evaluate(
    terms: &Terms,
    s: &mut [C],
    x: MatRef<'_, C>,
    y: Option<MatRef<'_, C>>,
    correction: Correction,
) -> Vec<Quality> {
    let products = terms.products(x, false);
    let left = y.map(|y| (y, terms.products(y, true)));
    let size = modulus(x);
    let moduli = [
        absolute(terms.m.as_ref()) * &size,
        terms.d.as_ref().map_or_else(|| Mat::zeros(0, 0), |d| absolute(d.as_ref()) * &size),
        absolute(terms.k.as_ref()) * &size,
    ];
    let mut all = Vec::with_capacity(s.len());
    for (j, s) in s.iter_mut().enumerate() {
        let (x, y) = (x.col(j), left.as_ref().map_or(x, |(y, _)| *y).col(j));
        let judged = |s: C| judge(terms, s, j, &products, &moduli, x, y);
        let mut quality = judged(*s);
        let step = quality.defect / quality.denominator;
        if let Some(better) = corrected(*s, step, quality.separation, correction) {
            *s = better;
            quality = judged(better);
        }
        if let Some((y, products)) = &left {
            let backward = backward_error(terms, *s, j, products, y.col(j));
            quality.backward = quality.backward.max(backward);
        }
        all.push(quality);
    }
    all
}

/// Moves the roots by their first-order errors, without estimates of what is left.
pub fn corrected_roots(terms: &Terms, s: &mut [C], x: MatRef<'_, C>, y: MatRef<'_, C>, correction: Correction) {
    if correction == Correction::None {
        return;
    }
    let products = terms.products(x, false);
    for (j, s) in s.iter_mut().enumerate() {
        let (y, m) = (y.col(j), products.m.col(j));
        let (mut denominator, mut slope) = (2.0 * *s * dot(y, m), 2.0 * s.norm() * m.norm_l2());
        if let Some(d) = &products.d {
            denominator += dot(y, d.col(j));
            slope += d.col(j).norm_l2();
        }
        slope *= y.norm_l2();
        let defect: C = (0..y.nrows()).map(|i| y[i] * products.residual(*s, i, j)).sum();
        let separation = if slope > 0.0 { denominator.norm() / slope } else { 0.0 };
        *s = corrected(*s, defect / denominator, separation, correction).unwrap_or(*s);
    }
}

/// `step` is the first-order error.
fn corrected(s: C, mut step: C, separation: f64, correction: Correction) -> Option<C> {
    // near a double root the first order says nothing
    if correction == Correction::None || separation < SEPARATED {
        return None;
    }
    match correction {
        Correction::Imaginary => step.re = 0.0,
        _ if s.im == 0.0 => step.im = 0.0,
        _ => {}
    }
    (step.norm() > 0.0 && step.norm() < LARGEST_CORRECTION * s.norm()).then(|| s - step)
}

fn backward_error(terms: &Terms, s: C, j: usize, products: &Products, x: ColRef<'_, C>) -> f64 {
    let n = x.nrows();
    let residual: f64 = (0..n).map(|i| products.residual(s, i, j).norm_sqr()).sum();
    let scale = terms.norm(s.norm()) * x.norm_l2();
    if residual == 0.0 { 0.0 } else { residual.sqrt() / scale }
}

fn judge(
    terms: &Terms,
    s: C,
    j: usize,
    products: &Products,
    moduli: &[Mat<f64>; 3],
    x: ColRef<'_, C>,
    y: ColRef<'_, C>,
) -> Quality {
    let r = s.norm();
    let mut denominator = 2.0 * s * dot(y, products.m.col(j));
    if let Some(d) = &products.d {
        denominator += dot(y, d.col(j));
    }
    let (mut defect, mut spread, mut slope) = (C::ZERO, 0.0, 0.0);
    for i in 0..x.nrows() {
        let (left, m, k) = (abs(y[i]), moduli[0][(i, j)], moduli[2][(i, j)]);
        let d = if products.d.is_some() { moduli[1][(i, j)] } else { 0.0 };
        defect += y[i] * products.residual(s, i, j);
        spread += left * (r * r * m + r * d + k);
        slope += left * (2.0 * r * m + d);
    }
    let scale = r * denominator.norm();
    // nan must never pass for zero
    let relative = |v: f64| if v == 0.0 { 0.0 } else { v / scale };
    let normwise = relative(terms.norm(r) * x.norm_l2() * y.norm_l2());
    let condition = relative(spread);
    let residual = defect.norm() + ROUNDING * spread;
    // where two roots almost meet, s moves like the square root of the residual, with Q'' = 2 M
    let curvature = r * r * dot(y, products.m.col(j)).norm();
    let single = relative(residual);
    let double = if residual == 0.0 { 0.0 } else { (residual / curvature).sqrt() };
    let error = if single.is_nan() || double.is_nan() { f64::NAN } else { single.min(double) };
    let backward = backward_error(terms, s, j, products, x);
    Quality {
        backward,
        condition,
        error,
        single: single.max(EPS * condition),
        curvature: curvature / r.max(f64::MIN_POSITIVE),
        normwise,
        defect,
        denominator,
        tolerance: r * (error + BLUR * normwise).min(CLOSEST),
        separation: if slope > 0.0 { denominator.norm() / slope } else { 0.0 },
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn roots_that_are_hardly_separated_are_not_corrected() {
        let (s, step) = (C::new(-0.1, 2.0), C::new(1e-6, -1e-6));
        let by = |separation: f64| corrected(s, step, separation, Correction::Any);
        assert!(by(1e-5).is_none() && by(1e-3) == Some(s - step));
    }

    /// A root one unit from zero that almost meets others.
    fn meeting(denominator: f64) -> Quality {
        Quality {
            backward: 0.0,
            condition: 0.0,
            error: 0.0,
            single: 1e-9,
            curvature: 1.0,
            normwise: 1.0,
            defect: C::ZERO,
            denominator: C::new(denominator, 0.0),
            tolerance: 0.0,
            separation: 0.0,
        }
    }

    #[test]
    fn roots_within_ten_times_the_nearest_meet_with_it() {
        let mut quality = meeting(0.0);
        quality.heed_neighbours(C::I, &[1e-3, 5e-3, 5e-2]);
        assert_eq!(quality.error, 3.0 * quality.single);
    }

    /// Where p = (s - a)(s - b) alone, p' at a is the whole curvature times the distance; a third root makes it less.
    #[test]
    fn more_than_two_roots_meet_where_the_slope_is_less_than_a_tenth_of_that_of_two() {
        let error = |part: f64| {
            let mut quality = meeting(part * 1e-3);
            quality.heed_neighbours(C::I, &[1e-3]);
            quality.error
        };
        assert_eq!([0.3, 0.03].map(error), [0.0, 2e-9]);
    }

    /// By a vector that is wrong by a millionth a root is wrong by the square of it.
    #[test]
    fn roots_whose_vectors_may_be_wrong_by_a_millionth_are_doubtful() {
        let is_doubtful = |backward: f64| Quality { backward, ..meeting(0.0) }.is_doubtful();
        assert_eq!([1e-7, 1e-5].map(is_doubtful), [false, true]);
    }

    #[test]
    fn large_steps_are_no_corrections() {
        let s = C::new(-0.1, 2.0);
        let by = |part: f64| corrected(s, s * part, 1.0, Correction::Any);
        assert!(by(1e-2).is_none() && by(1e-4) == Some(s - s * 1e-4));
    }
}
