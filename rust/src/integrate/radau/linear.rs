//! Newton's matrices of a step, and what they are made of.
//!
//! With a = T (accelerations of modes), A = T diag(1/mu) T^-1, the coupled systems of the stages fall apart into
//! ```text
//! [M + c D + c^2 K  J^T] [da  ]   [-r]
//! [J                 0 ] [dlam] = [-g]        c = h/mu, real once, complex for each pair
//! ```
//! The matrices of a frequency response: their derivatives of g, of order h times the rates, are left out. A complex system is solved
//! as a real one of twice the size.
use nalgebra::{Complex, DVector};

use crate::error::Result;
use crate::linalg::entries::Entries;
use crate::linalg::kkt::Kkt;
use crate::linalg::matrix::Matrix;
use crate::linalg::rows::Level;
use crate::multibody::assemble::Tangent;
use crate::run::Counts;

use super::super::{Equations, Motion};
use super::numbers::{Mode, Tableau, complex};

/// The tangent at one motion; factors for one step length.
pub struct Linear {
    mass: Matrix,
    damping: Matrix,
    stiffness: Matrix,
    jacobian: Matrix,
    kept: Vec<usize>,
    factors: Option<Factors>,
    /// of the time below which vibrations are much faster than the motion
    slow: Option<(f64, Kkt)>,
}

struct Factors {
    h: f64,
    real: Kkt,
    pairs: Vec<Kkt>,
}

/// Accelerations and multipliers of every stage, or what they leave over.
#[derive(Debug, Clone)]
pub struct Stages {
    pub a: Vec<DVector<f64>>,
    pub lam: Vec<DVector<f64>>,
}

impl Linear {
    pub fn new(eq: &Equations<'_, f64>, m: &Motion<f64>, a: &[f64], lam: &[f64], counts: &mut Counts) -> Self {
        counts.add("tangents", 1);
        let placement = eq.place(m);
        let scene = eq.scene(m, &placement, Some(a));
        let lam = (!lam.is_empty()).then_some(lam);
        let n = eq.n();
        let mut tangent: Tangent<f64, Matrix> = scene.tangent_into(lam, counts, || eq.matrix(n));
        eq.hold_rates(m, a, &mut tangent);
        let mut damping = eq.matrix(n);
        for part in [&tangent.damping, &tangent.gyroscopic].into_iter().flatten() {
            damping.add_scaled(part, 1.0);
        }
        let mut jacobian = eq.matrix(eq.n_rows());
        scene.constraints_into(&mut jacobian);
        let kept = eq.rows.select(&jacobian, Level::All);
        Linear { mass: tangent.mass, damping, stiffness: tangent.stiffness, jacobian, kept, factors: None, slow: None }
    }

    /// Factors that serve steps of length h.
    pub fn factor(&mut self, tableau: &Tableau, h: f64, counts: &mut Counts) -> Result<()> {
        if self.factors.as_ref().is_some_and(|f| f.h == h && f.pairs.len() == tableau.pairs.len()) {
            return Ok(());
        }
        self.factors = None;
        counts.add("factorisations", 1);
        let pair = |m: &Mode<(f64, f64)>| self.doubled(Complex::from(h) / complex(m.mu));
        let pairs = tableau.pairs.iter().map(pair).collect::<Result<_>>()?;
        self.factors = Some(Factors { h, real: self.real(h / tableau.real.mu)?, pairs });
        Ok(())
    }

    fn real(&self, c: f64) -> Result<Kkt> {
        let mut a = self.mass.clone();
        a.add_scaled(&self.damping, c);
        a.add_scaled(&self.stiffness, c * c);
        Kkt::with_rows(&a, &self.jacobian, self.kept.clone(), None)
    }

    /// [Re -Im; Im Re] of the complex system.
    fn doubled(&self, c: Complex<f64>) -> Result<Kkt> {
        let (n, m) = (self.mass.shape().0, self.jacobian.shape().0);
        let sparse = self.mass.is_sparse();
        let mut a = Matrix::zeros(2 * n, 2 * n, sparse);
        let parts = [(&self.mass, Complex::from(1.0)), (&self.damping, c), (&self.stiffness, c * c)];
        for (part, factor) in parts {
            part.each(|i, j, v| {
                if v == 0.0 {
                    return;
                }
                a.add(i, j, v * factor.re);
                a.add(n + i, n + j, v * factor.re);
                if factor.im != 0.0 {
                    a.add(i, n + j, -v * factor.im);
                    a.add(n + i, j, v * factor.im);
                }
            });
        }
        let mut rows = Matrix::zeros(2 * m, 2 * n, sparse);
        self.jacobian.each(|i, j, v| {
            rows.add(i, j, v);
            rows.add(m + i, n + j, v);
        });
        let kept = self.kept.iter().copied().chain(self.kept.iter().map(|i| m + i)).collect();
        Kkt::with_rows(&a, &rows, kept, None)
    }

    /// The correction of all stages that takes their remainders away.
    pub fn correction(&self, tableau: &Tableau, left: &Stages) -> Result<Option<Stages>> {
        let Some(factors) = &self.factors else { return Ok(None) };
        let s = tableau.stages();
        let (n, m) = (left.a[0].len(), left.lam[0].len());
        let mut out = Stages { a: vec![DVector::zeros(n); s], lam: vec![DVector::zeros(m); s] };
        let sum = |v: &[DVector<f64>], row: &dyn Fn(usize) -> f64, n: usize| {
            (0..s).fold(DVector::zeros(n), |mut sum, j| {
                sum.axpy(-row(j), &v[j], 1.0);
                sum
            })
        };
        let real = |j: usize| tableau.real.row[j];
        let (x, y) = factors.real.solve_one(&sum(&left.a, &real, n), &sum(&left.lam, &real, m))?;
        for i in 0..s {
            out.a[i].axpy(tableau.real.column[i], &x, 1.0);
            out.lam[i].axpy(tableau.real.column[i], &y, 1.0);
        }
        for (mode, system) in tableau.pairs.iter().zip(&factors.pairs) {
            let (re, im) = (|j: usize| mode.row[j].0, |j: usize| mode.row[j].1);
            let f = stacked(&sum(&left.a, &re, n), &sum(&left.a, &im, n));
            let g = stacked(&sum(&left.lam, &re, m), &sum(&left.lam, &im, m));
            let (x, y) = system.solve_one(&f, &g)?;
            for i in 0..s {
                let (re, im) = mode.column[i];
                for k in 0..n {
                    out.a[i][k] += 2.0 * (re * x[k] - im * x[n + k]);
                }
                for k in 0..m {
                    out.lam[i][k] += 2.0 * (re * y[k] - im * y[m + k]);
                }
            }
        }
        Ok(Some(out))
    }

    /// (1/c - f')^-1 of slopes, the filter that takes fast motions out of the estimate: changes of position and rate. What a vibration
    /// much faster than the step moves is in the positions; its rates, greater by its frequency, pass the filter once more. `patience`:
    /// vibrations faster than its inverse are so much faster than the motion that their rates do not count where steps are short either.
    pub fn filtered(
        &mut self,
        tableau: &Tableau,
        slopes: (&[f64], &[f64]),
        patience: Option<f64>,
        counts: &mut Counts,
    ) -> Result<Option<(Vec<f64>, Vec<f64>)>> {
        let patience = patience.filter(|c| self.factors.as_ref().is_some_and(|f| f.h / tableau.real.mu < *c));
        if let Some(c) = patience.filter(|c| self.slow.as_ref().is_none_or(|s| s.0 != *c)) {
            counts.add("factorisations", 1);
            self.slow = Some((c, self.real(c)?));
        }
        let Some(factors) = &self.factors else { return Ok(None) };
        let c = factors.h / tableau.real.mu;
        let (moved, turned) = slopes;
        let f = self.mass.times(turned) * c - self.stiffness.times(moved) * (c * c);
        let g = self.jacobian.times(turned) * c;
        let rate = factors.real.solve_one(&f, &g)?.0;
        let position = rate.iter().zip(moved).map(|(v, p)| c * (v + p)).collect();
        let mut slow = self.slower(&factors.real, &rate)?;
        if let Some((_, filter)) = self.slow.as_ref().filter(|_| patience.is_some()) {
            slow = self.slower(filter, &self.slower(filter, &slow)?)?;
        }
        Ok(Some((position, slow.as_slice().to_vec())))
    }

    /// Differences of accelerations without what is fast beside the step.
    pub fn damped(&self, difference: &[f64]) -> Result<Vec<f64>> {
        let Some(factors) = &self.factors else { return Ok(difference.to_vec()) };
        Ok(self.slower(&factors.real, &DVector::from_column_slice(difference))?.as_slice().to_vec())
    }

    /// Rates without those of vibrations and decays that are fast beside a filter's time.
    fn slower(&self, filter: &Kkt, rate: &DVector<f64>) -> Result<DVector<f64>> {
        let (f, g) = (self.mass.times(rate.as_slice()), self.jacobian.times(rate.as_slice()));
        Ok(filter.solve_one(&f, &g)?.0)
    }
}

fn stacked(a: &DVector<f64>, b: &DVector<f64>) -> DVector<f64> {
    DVector::from_iterator(a.len() + b.len(), a.iter().chain(b.iter()).copied())
}
