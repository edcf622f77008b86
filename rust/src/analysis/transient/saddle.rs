//! [A J^T; J 0] with rows that may be redundant, and whose rank may change from one instant to the next.
//!
//! ```text
//! [A   J^T ] [x  ]   [r]      A = D A' D,  J = R J' D: unit diagonal of A', rows of J' of length one
//! [J  -eps ] [lam] = [s]
//! ```
//! The regularised matrix has full rank for every J. Solving again for what is left (the proximal point iteration) takes the
//! regularisation out: a component along a singular value sigma of J' A'^-1/2 shrinks by eps/(eps + sigma^2) each time. Along
//! redundant combinations lam stays zero (minimum norm in the scaled rows) and rows that contradict each other are met as well as
//! they can be. Large symmetric ones are quasi-definite by the same eps, so that L D L^T exists in the order of least fill.
use std::cell::RefCell;
use std::sync::Arc;

use faer::prelude::*;
use nalgebra::{DMatrix, DVector};

use crate::error::{Error, Result};
use crate::linalg::sparse::{Csc, Factor as SparseFactor};
use crate::linalg::symmetric::{Ldl, Pattern};

use super::matrix::Matrix;

const PROXIMAL: f64 = 1e-9;
/// Without pivoting a row may be eliminated before its columns, which loses 1/eps: less may be lost.
const PROXIMAL_LDL: f64 = 1e-7;
const REFINEMENTS: usize = 8;
/// Rows below this part of the largest carry nothing.
const ROUNDING: f64 = 1e-12;
/// Below this size nalgebra factorises faster than faer.
const SMALL: usize = 20;

/// The ordering of a pattern, kept from one factorisation to the next.
pub type Ordering = RefCell<Option<Arc<Pattern>>>;

enum Factor {
    Small(nalgebra::LU<f64, nalgebra::Dyn, nalgebra::Dyn>),
    Large(Box<faer::linalg::solvers::PartialPivLu<f64>>),
    Symmetric(Ldl),
    Sparse(Box<SparseFactor>),
}

/// The scaled matrix without its regularisation.
enum Scaled {
    Dense(DMatrix<f64>),
    List(Vec<(u32, u32, f64)>),
}

pub struct Saddle {
    n: usize,
    matrix: Scaled,
    column: Vec<f64>,
    row: Vec<f64>,
    factor: Factor,
}

impl Saddle {
    /// A may be nonsymmetric; its diagonal sets the scale.
    pub fn new(a: &DMatrix<f64>, jacobian: &DMatrix<f64>) -> Result<Self> {
        let (a, j) = (Matrix::Dense(a.clone()), Matrix::Dense(jacobian.clone()));
        Self::of(&a, &j, None)
    }

    /// `ordering`: A is symmetric positive definite with places that stay; None: it may be anything.
    pub fn of(a: &Matrix, jacobian: &Matrix, ordering: Option<&Ordering>) -> Result<Self> {
        let (n, m) = (a.shape().0, jacobian.shape().0);
        let diagonal = a.diagonal();
        if let Some(i) = diagonal.iter().position(|d| *d == 0.0 || !d.is_finite()) {
            return Err(Error::singular(format!(
                "the equations of motion are singular: tree coordinate {i} has the inertia {:.3e}",
                diagonal[i]
            )));
        }
        let column: Vec<f64> = diagonal.iter().map(|d| 1.0 / d.abs().sqrt()).collect();
        let mut row = vec![0.0; m];
        jacobian.each(|i, j, v| row[i] += (v * column[j]).powi(2));
        let largest = row.iter().copied().fold(0.0, f64::max);
        for r in &mut row {
            // rows of rounding alone, as those across the plane of a flat loop, must not be blown up to constraints
            let size = if *r > ROUNDING * ROUNDING * largest { *r } else { largest };
            *r = if size > 0.0 { 1.0 / size.sqrt() } else { 1.0 };
        }
        if a.is_sparse() {
            return Self::sparse(a, jacobian, column, row, ordering);
        }
        let mut matrix = DMatrix::zeros(n + m, n + m);
        a.each(|i, j, v| matrix[(i, j)] = v * column[i] * column[j]);
        jacobian.each(|i, j, v| {
            let v = v * row[i] * column[j];
            matrix[(n + i, j)] = v;
            matrix[(j, n + i)] = v;
        });
        let mut regular = matrix.clone();
        for i in n..n + m {
            regular[(i, i)] = -PROXIMAL;
        }
        let factor = if n + m <= SMALL {
            Factor::Small(regular.lu())
        } else {
            let view = MatRef::from_column_major_slice(regular.as_slice(), n + m, n + m);
            Factor::Large(Box::new(view.partial_piv_lu()))
        };
        let matrix = Scaled::Dense(matrix);
        Ok(Saddle { n, matrix, column, row, factor })
    }

    fn sparse(
        a: &Matrix,
        jacobian: &Matrix,
        column: Vec<f64>,
        row: Vec<f64>,
        ordering: Option<&Ordering>,
    ) -> Result<Self> {
        let (n, m) = (column.len(), row.len());
        let mut list = Vec::new();
        a.each(|i, j, v| list.push((i as u32, j as u32, v * column[i] * column[j])));
        jacobian.each(|i, j, v| {
            let v = v * row[i] * column[j];
            list.push(((n + i) as u32, j as u32, v));
            list.push((j as u32, (n + i) as u32, v));
        });
        let eps = if ordering.is_some() { PROXIMAL_LDL } else { PROXIMAL };
        let regular = (n..n + m).map(|i| (i as u32, i as u32, -eps));
        let all = || list.iter().copied().chain(regular.clone());
        let factor = match ordering {
            Some(ordering) => {
                let mut kept = ordering.borrow_mut();
                let pattern = match kept.as_ref() {
                    Some(p) => p.clone(),
                    None => {
                        let places: Vec<(u32, u32)> = all().map(|(i, j, _)| (i, j)).collect();
                        let made = Arc::new(Pattern::new(n + m, &places)?);
                        *kept = Some(made.clone());
                        made
                    }
                };
                Factor::Symmetric(pattern.factor(all().map(|(_, _, v)| v))?)
            }
            None => {
                let entries = all().map(|(i, j, v)| (i as usize, j as usize, v)).collect();
                let lu = SparseFactor::lu(&Csc::from_entries(n + m, n + m, entries))?;
                Factor::Sparse(Box::new(lu))
            }
        };
        Ok(Saddle { n, matrix: Scaled::List(list), column, row, factor })
    }

    /// x and lam with A x + J^T lam = r, J x = s.
    pub fn solve(&self, r: &DVector<f64>, s: &DVector<f64>) -> Result<(DVector<f64>, DVector<f64>)> {
        let (n, m) = (self.n, self.row.len());
        if n + m == 0 {
            return Ok((DVector::zeros(0), DVector::zeros(0)));
        }
        let right =
            DVector::from_fn(n + m, |i, _| if i < n { r[i] * self.column[i] } else { s[i - n] * self.row[i - n] });
        let mut z = self.once(&right)?;
        let mut left = f64::INFINITY;
        for _ in 0..REFINEMENTS {
            let miss = &right - self.times(&z);
            let size = miss.amax();
            // rows that contradict each other leave a remainder for ever
            if size <= 4.0 * f64::EPSILON * (right.amax() + z.amax()) || size > 0.5 * left {
                break;
            }
            left = size;
            z += self.once(&miss)?;
        }
        Ok((DVector::from_fn(n, |i, _| z[i] * self.column[i]), DVector::from_fn(m, |i, _| z[n + i] * self.row[i])))
    }

    fn times(&self, z: &DVector<f64>) -> DVector<f64> {
        match &self.matrix {
            Scaled::Dense(m) => m * z,
            Scaled::List(list) => {
                let mut out = DVector::zeros(z.len());
                for (i, j, v) in list {
                    out[*i as usize] += v * z[*j as usize];
                }
                out
            }
        }
    }

    fn once(&self, right: &DVector<f64>) -> Result<DVector<f64>> {
        let column = |x: Mat<f64>| Some(DVector::from_fn(right.len(), |i, _| x[(i, 0)]));
        let as_matrix = || Mat::from_fn(right.len(), 1, |i, _| right[i]);
        let solution = match &self.factor {
            Factor::Small(lu) => lu.solve(right),
            Factor::Large(lu) => column(lu.solve(&as_matrix())),
            Factor::Symmetric(ldl) => Some(DVector::from_vec(ldl.solve(right.as_slice()))),
            Factor::Sparse(lu) => {
                let mut x = as_matrix();
                lu.solve(x.as_mut());
                column(x)
            }
        };
        solution
            .filter(|x| x.iter().all(|v| v.is_finite()))
            .ok_or_else(|| Error::singular("the equations of motion are singular here: a motion without inertia"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::linalg::entries::{Entries, Triplets};

    fn listed(m: &DMatrix<f64>) -> Matrix {
        let mut t = Triplets::new(m.nrows(), m.ncols());
        for i in 0..m.nrows() {
            for j in 0..m.ncols() {
                t.add(i, j, m[(i, j)]);
            }
        }
        Matrix::Sparse(t)
    }

    #[test]
    fn redundant_rows_share_and_the_solution_is_that_without_them() {
        let a = DMatrix::from_fn(3, 3, |i, j| if i == j { 2.0 + i as f64 } else { 0.3 });
        let once = DMatrix::from_row_slice(1, 3, &[1.0, -1.0, 0.5]);
        let twice = DMatrix::from_row_slice(2, 3, &[1.0, -1.0, 0.5, 2.0, -2.0, 1.0]);
        let r = DVector::from_row_slice(&[1.0, 0.2, -0.4]);
        let s = 0.3;
        let (x, lam) = Saddle::new(&a, &once).unwrap().solve(&r, &DVector::from_row_slice(&[s])).unwrap();
        let ordering = Ordering::default();
        for saddle in [
            Saddle::new(&a, &twice).unwrap(),
            Saddle::of(&listed(&a), &listed(&twice), Some(&ordering)).unwrap(),
            Saddle::of(&listed(&a), &listed(&twice), None).unwrap(),
        ] {
            let (y, mu) = saddle.solve(&r, &DVector::from_row_slice(&[s, 2.0 * s])).unwrap();
            assert!((&x - &y).amax() < 1e-14);
            assert!((&a * &x + once.transpose() * &lam - &r).amax() < 1e-14);
            assert!((lam[0] - mu[0] - 2.0 * mu[1]).abs() < 1e-13);
            assert!((mu[0] - 2.0 * mu[1]).abs() < 1e-7, "rows of one direction carry alike when scaled");
        }
    }
}
