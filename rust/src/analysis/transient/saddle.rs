//! [A J^T; J 0] with rows that may be redundant, and whose rank may change from one instant to the next.
//!
//! ```text
//! [A   J^T ] [x  ]   [r]      A = D A' D,  J = R J' D: unit diagonal of A', rows of J' of length one
//! [J  -eps ] [lam] = [s]
//! ```
//! The regularised matrix has full rank for every J. Solving again for what is left (the proximal point iteration) takes the
//! regularisation out: a component along a singular value sigma of J' A'^-1/2 shrinks by eps/(eps + sigma^2) each time. Along
//! redundant combinations lam stays zero (minimum norm in the scaled rows) and rows that contradict each other are met as well as
//! they can be.
use faer::prelude::*;
use nalgebra::{DMatrix, DVector};

use crate::error::{Error, Result};

const PROXIMAL: f64 = 1e-9;
const REFINEMENTS: usize = 6;
/// Below this size nalgebra factorises faster than faer.
const SMALL: usize = 20;

enum Factor {
    Small(nalgebra::LU<f64, nalgebra::Dyn, nalgebra::Dyn>),
    Large(faer::linalg::solvers::PartialPivLu<f64>),
}

pub struct Saddle {
    n: usize,
    /// scaled [A' J'^T; J' 0], for the remainders
    matrix: DMatrix<f64>,
    column: Vec<f64>,
    row: Vec<f64>,
    factor: Factor,
}

impl Saddle {
    /// A may be nonsymmetric; its diagonal sets the scale and must be positive.
    pub fn new(a: &DMatrix<f64>, jacobian: &DMatrix<f64>) -> Result<Self> {
        let (n, m) = (a.nrows(), jacobian.nrows());
        if let Some(i) = (0..n).find(|i| !(a[(*i, *i)] > 0.0 && a[(*i, *i)].is_finite())) {
            return Err(Error::singular(format!(
                "the equations of motion are singular: tree coordinate {i} has the inertia {:.3e}",
                a[(i, i)]
            )));
        }
        let column: Vec<f64> = (0..n).map(|i| 1.0 / a[(i, i)].sqrt()).collect();
        let row: Vec<f64> = (0..m)
            .map(|i| {
                let size = (0..n)
                    .map(|j| (jacobian[(i, j)] * column[j]).powi(2))
                    .sum::<f64>()
                    .sqrt();
                if size > 0.0 { 1.0 / size } else { 1.0 }
            })
            .collect();
        let mut matrix = DMatrix::zeros(n + m, n + m);
        for j in 0..n {
            for i in 0..n {
                matrix[(i, j)] = a[(i, j)] * column[i] * column[j];
            }
            for i in 0..m {
                let v = jacobian[(i, j)] * row[i] * column[j];
                matrix[(n + i, j)] = v;
                matrix[(j, n + i)] = v;
            }
        }
        let mut regular = matrix.clone();
        for i in n..n + m {
            regular[(i, i)] = -PROXIMAL;
        }
        let factor = if n + m <= SMALL {
            Factor::Small(regular.lu())
        } else {
            let view = MatRef::from_column_major_slice(regular.as_slice(), n + m, n + m);
            Factor::Large(view.partial_piv_lu())
        };
        Ok(Saddle {
            n,
            matrix,
            column,
            row,
            factor,
        })
    }

    /// x and lam with A x + J^T lam = r, J x = s.
    pub fn solve(
        &self,
        r: &DVector<f64>,
        s: &DVector<f64>,
    ) -> Result<(DVector<f64>, DVector<f64>)> {
        let (n, m) = (self.n, self.row.len());
        let right = DVector::from_fn(n + m, |i, _| {
            if i < n {
                r[i] * self.column[i]
            } else {
                s[i - n] * self.row[i - n]
            }
        });
        let mut z = self.once(&right)?;
        let mut left = f64::INFINITY;
        for _ in 0..REFINEMENTS {
            let miss = &right - &self.matrix * &z;
            let size = miss.amax();
            // rows that contradict each other leave a remainder for ever
            if size <= 4.0 * f64::EPSILON * (right.amax() + z.amax()) || size > 0.5 * left {
                break;
            }
            left = size;
            z += self.once(&miss)?;
        }
        Ok((
            DVector::from_fn(n, |i, _| z[i] * self.column[i]),
            DVector::from_fn(m, |i, _| z[n + i] * self.row[i]),
        ))
    }

    fn once(&self, right: &DVector<f64>) -> Result<DVector<f64>> {
        let solution = match &self.factor {
            Factor::Small(lu) => lu.solve(right),
            Factor::Large(lu) => {
                let b = Mat::from_fn(right.len(), 1, |i, _| right[i]);
                let x = lu.solve(&b);
                Some(DVector::from_fn(right.len(), |i, _| x[(i, 0)]))
            }
        };
        solution
            .filter(|x| x.iter().all(|v| v.is_finite()))
            .ok_or_else(|| {
                Error::singular(
                    "the equations of motion are singular here: a motion without inertia",
                )
            })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn redundant_rows_share_and_the_solution_is_that_without_them() {
        let a = DMatrix::from_fn(3, 3, |i, j| if i == j { 2.0 + i as f64 } else { 0.3 });
        let once = DMatrix::from_row_slice(1, 3, &[1.0, -1.0, 0.5]);
        let twice = DMatrix::from_row_slice(2, 3, &[1.0, -1.0, 0.5, 2.0, -2.0, 1.0]);
        let r = DVector::from_row_slice(&[1.0, 0.2, -0.4]);
        let s = 0.3;
        let (x, lam) = Saddle::new(&a, &once)
            .unwrap()
            .solve(&r, &DVector::from_row_slice(&[s]))
            .unwrap();
        let (y, mu) = Saddle::new(&a, &twice)
            .unwrap()
            .solve(&r, &DVector::from_row_slice(&[s, 2.0 * s]))
            .unwrap();
        assert!((&x - &y).amax() < 1e-14);
        assert!((&a * &x + once.transpose() * &lam - &r).amax() < 1e-14);
        assert!((lam[0] - mu[0] - 2.0 * mu[1]).abs() < 1e-13);
        assert!(
            (mu[0] - 2.0 * mu[1]).abs() < 1e-7,
            "rows of one direction carry alike when scaled"
        );
    }
}
