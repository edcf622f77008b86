//! The matrix polynomial Z(s) = s^2 M + s D + S of a second-order system, its dynamic stiffness and its mass-normalised form.
use faer::linalg::solvers::PartialPivLu;
use faer::prelude::*;
use faer::{Mat, MatRef, Side, c64};

use super::dense::is_singular;
use super::double_double::{Dd, Sums};
use crate::tolerances::matrices::{PIVOT, SAME_ENTRY};

/// M, D = C + G (None where there is none) and S = K + N, dense.
#[derive(Debug, Clone)]
pub struct Quadratic {
    /// M
    pub m: Mat<f64>,
    /// D
    pub d: Option<Mat<f64>>,
    /// S
    pub s: Mat<f64>,
}

/// In coordinates z = L^T y with M = L L^T: z'' + d z' + s z = L^-1 f. Units and mass ratios are gone, so norms mean something.
#[derive(Debug, Clone)]
pub struct NormalForm {
    pub l: Mat<f64>,
    pub d: Option<Mat<f64>>,
    pub s: Mat<f64>,
}

/// One solution of Z(i omega) x = f, refined, with the size of the last correction as its relative error.
pub struct Solved {
    pub x: Mat<c64>,
    pub error: f64,
}

pub fn is_finite(a: MatRef<'_, f64>) -> bool {
    (0..a.ncols()).all(|j| (0..a.nrows()).all(|i| a[(i, j)].is_finite()))
}

pub fn is_finite_complex(a: MatRef<'_, c64>) -> bool {
    (0..a.ncols()).all(|j| (0..a.nrows()).all(|i| a[(i, j)].re.is_finite() && a[(i, j)].im.is_finite()))
}

pub fn max_abs(a: MatRef<'_, f64>) -> f64 {
    a.norm_max()
}

/// Symmetric up to rounding of the entries' common scale.
pub fn is_symmetric(a: MatRef<'_, f64>) -> bool {
    let tol = SAME_ENTRY * max_abs(a);
    (0..a.ncols()).all(|j| (0..j).all(|i| (a[(i, j)] - a[(j, i)]).abs() <= tol))
}

impl Quadratic {
    /// Finite matrices of one size.
    pub fn new(m: Mat<f64>, d: Option<Mat<f64>>, s: Mat<f64>) -> Self {
        // without damping is cheaper: an all-zero damping matrix is left out
        let d = d.filter(|d| max_abs(d.as_ref()) > 0.0);
        Quadratic { m, d, s }
    }

    /// Number of coordinates.
    pub fn n(&self) -> usize {
        self.m.nrows()
    }

    /// S - omega^2 M + i omega D.
    pub fn dynamic(&self, omega: f64) -> Mat<c64> {
        let w2 = omega * omega;
        Mat::from_fn(self.n(), self.n(), |i, j| {
            let d = self.d.as_ref().map_or(0.0, |d| d[(i, j)]);
            c64::new(self.s[(i, j)] - w2 * self.m[(i, j)], omega * d)
        })
    }

    /// f - Z(i omega) x in double-double: exact enough that one more solve with it shows the error of x.
    pub fn residual(&self, omega: f64, x: MatRef<'_, c64>, f: MatRef<'_, c64>) -> Mat<c64> {
        let n = self.n();
        let w2 = Dd::product(omega, omega);
        let mut r = Mat::<c64>::zeros(n, x.ncols());
        for k in 0..x.ncols() {
            let part = |a: MatRef<'_, f64>| {
                let (mut re, mut im) = (Sums::zeros(n), Sums::zeros(n));
                re.add_product(a, |j| x[(j, k)].re);
                im.add_product(a, |j| x[(j, k)].im);
                (re, im)
            };
            let (s_re, s_im) = part(self.s.as_ref());
            let (m_re, m_im) = part(self.m.as_ref());
            let damped = self.d.as_ref().map(|d| part(d.as_ref()));
            for i in 0..n {
                let mut re = Dd::new(f[(i, k)].re).minus(s_re.get(i)).plus(w2.times(m_re.get(i)));
                let mut im = Dd::new(f[(i, k)].im).minus(s_im.get(i)).plus(w2.times(m_im.get(i)));
                if let Some((d_re, d_im)) = &damped {
                    re = re.plus(Dd::new(omega).times(d_im.get(i)));
                    im = im.minus(Dd::new(omega).times(d_re.get(i)));
                }
                r[(i, k)] = c64::new(re.value(), im.value());
            }
        }
        r
    }

    /// Powers of two that bring the masses to about one, so that pivoting does not depend on units.
    pub fn unit_scale(&self) -> Vec<f64> {
        (0..self.n())
            .map(|i| {
                let m = self.m[(i, i)];
                let size = if m > 0.0 { m } else { self.s[(i, i)].abs() };
                if size > 0.0 && size.is_finite() { (-0.5 * size.log2()).round().exp2() } else { 1.0 }
            })
            .collect()
    }

    /// Z(i omega), factored in coordinates of unit masses.
    pub fn factored<'a>(&'a self, omega: f64, scale: &'a [f64]) -> Factored<'a> {
        let (n, z) = (self.n(), self.dynamic(omega));
        let scaled = Mat::from_fn(n, n, |i, j| z[(i, j)] * scale[i] * scale[j]);
        Factored { q: self, omega, scale, size: scaled.norm_l2(), lu: scaled.partial_piv_lu() }
    }

    /// Solve Z(i omega) x = f by one factorisation and up to `refinements` corrections from exact residuals.
    /// None where Z is singular to working precision.
    pub fn solve(&self, omega: f64, f: MatRef<'_, c64>, scale: &[f64], refinements: usize) -> Option<Solved> {
        self.factored(omega, scale).solve(f, refinements)
    }

    /// Fails where M is not symmetric positive definite.
    pub fn normal_form(&self) -> Option<NormalForm> {
        if !is_symmetric(self.m.as_ref()) {
            return None;
        }
        let n = self.n();
        // a massless coordinate may survive the factorisation by rounding: its pivot is then noise of the diagonal it came from
        let l = self.m.llt(Side::Lower).ok()?.L().to_owned();
        let regular = (0..n).all(|i| l[(i, i)] * l[(i, i)] > PIVOT * self.m[(i, i)]);
        if !regular || !is_finite(l.as_ref()) {
            return None;
        }
        let congruent = |a: &Mat<f64>| {
            let mut x = a.clone();
            l.solve_lower_triangular_in_place(&mut x);
            let mut y = x.transpose().to_owned();
            l.solve_lower_triangular_in_place(&mut y);
            y.transpose().to_owned()
        };
        Some(NormalForm { d: self.d.as_ref().map(congruent), s: congruent(&self.s), l })
    }
}

/// Z(i omega) for any right sides.
pub struct Factored<'a> {
    q: &'a Quadratic,
    omega: f64,
    scale: &'a [f64],
    /// Frobenius norm of what was factored.
    size: f64,
    lu: PartialPivLu<c64>,
}

impl Factored<'_> {
    /// Without corrections.
    pub fn plain(&self, f: MatRef<'_, c64>) -> Mat<c64> {
        let mut y = Mat::from_fn(f.nrows(), f.ncols(), |i, k| f[(i, k)] * self.scale[i]);
        self.lu.solve_in_place(&mut y);
        Mat::from_fn(f.nrows(), f.ncols(), |i, k| y[(i, k)] * self.scale[i])
    }

    /// See `Quadratic::solve`.
    pub fn solve(&self, f: MatRef<'_, c64>, refinements: usize) -> Option<Solved> {
        let (n, scale) = (f.nrows(), self.scale);
        let mut x = self.plain(f);
        if !is_finite_complex(x.as_ref()) {
            return None;
        }
        let size = |a: MatRef<'_, c64>| {
            let mut sum = 0.0;
            for k in 0..a.ncols() {
                for i in 0..n {
                    sum += (a[(i, k)] / scale[i]).norm_sqr();
                }
            }
            sum.sqrt()
        };
        // without refinement only the growth of the solution tells a singular Z from a regular one
        let load = (0..f.ncols()).map(|k| (0..n).map(|i| (f[(i, k)] * scale[i]).norm_sqr()).sum::<f64>());
        if is_singular(size(x.as_ref()) * self.size / load.sum::<f64>().sqrt().max(f64::MIN_POSITIVE)) {
            return None;
        }
        let mut error = f64::NAN;
        for pass in 0..refinements {
            let correction = self.plain(self.q.residual(self.omega, x.as_ref(), f).as_ref());
            let norm = size(x.as_ref());
            let ratio = if norm > 0.0 { size(correction.as_ref()) / norm } else { 0.0 };
            if !ratio.is_finite() || ratio > 0.3 {
                return None;
            }
            if pass == 0 {
                error = ratio; // of the plain solution; what follows only improves x
            }
            x += &correction;
            if ratio < f64::EPSILON {
                break;
            }
        }
        Some(Solved { x, error })
    }
}

impl NormalForm {
    pub fn n(&self) -> usize {
        self.l.nrows()
    }

    pub fn is_symmetric(&self) -> bool {
        is_symmetric(self.s.as_ref()) && self.d.as_ref().is_none_or(|d| is_symmetric(d.as_ref()))
    }

    /// L^-1 F: input map of the normalised coordinates.
    pub fn inputs(&self, f: MatRef<'_, f64>) -> Mat<f64> {
        let mut x = f.to_owned();
        self.l.solve_lower_triangular_in_place(&mut x);
        x
    }

    /// (output map) L^-T.
    pub fn outputs(&self, map: MatRef<'_, f64>) -> Mat<f64> {
        let mut x = map.transpose().to_owned();
        self.l.solve_lower_triangular_in_place(&mut x);
        x.transpose().to_owned()
    }

    /// The time scale that makes the two halves of the state matrix equally large.
    pub fn rate(&self) -> f64 {
        let rate = self.s.norm_l2().sqrt();
        if rate > 0.0 { rate } else { self.d.as_ref().map_or(1.0, |d| d.norm_l2()).max(f64::MIN_POSITIVE) }
    }

    /// A of x = (z, z'/rate): [[0, rate], [-s/rate, -d]].
    pub fn state_matrix(&self, rate: f64) -> Mat<f64> {
        let n = self.n();
        Mat::from_fn(2 * n, 2 * n, |i, j| match (i < n, j < n) {
            (true, true) => 0.0,
            (true, false) => {
                if j - n == i {
                    rate
                } else {
                    0.0
                }
            }
            (false, true) => -self.s[(i - n, j)] / rate,
            (false, false) => self.d.as_ref().map_or(0.0, |d| -d[(i - n, j - n)]),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn entries_are_the_same_within_their_bound() {
        let symmetric = |gap: f64| is_symmetric(faer::mat![[1.0, 0.5], [0.5 + gap, 1.0]].as_ref());
        assert!(symmetric(1e-15) && !symmetric(1e-13));
    }

    #[test]
    fn a_pivot_of_rounding_has_no_normal_form() {
        let regular = |p: f64| {
            let q = Quadratic::new(faer::mat![[1.0, 1.0], [1.0, 1.0 + p]], None, Mat::identity(2, 2));
            q.normal_form().is_some()
        };
        assert!(regular(1e-12) && !regular(1e-14));
    }

    #[test]
    fn refined_solution_is_exact_to_the_last_digits() {
        // invented: stiffness ratio 1e12, off resonance
        let m = Mat::from_fn(2, 2, |i, j| if i == j { 1.0 } else { 0.0 });
        let s = Mat::from_fn(2, 2, |i, j| if i == j { 1e12 + 1.0 } else { -1e12 });
        let q = Quadratic::new(m, None, s);
        let f = Mat::from_fn(2, 1, |i, _| c64::new(if i == 0 { 1.0 } else { 0.0 }, 0.0));
        let solved = q.solve(2.0, f.as_ref(), &q.unit_scale(), 3).unwrap();
        // modes (1, 1): 1/(1 - 4); (1, -1): 1/(2e12 + 1 - 4)
        let expected = 0.5 / (1.0 - 4.0) + 0.5 / (2e12 + 1.0 - 4.0);
        assert!((solved.x[(0, 0)].re / expected - 1.0).abs() < 1e-15);
    }
}
