//! [A L; R 0] with redundant rows, solved by its penalty matrix and multiplier updates.
//!
//! ```text
//! P = A + alpha L R,   P dx = f - A x - L y + alpha L (g - R x),   y += alpha (R dx - (g - R x))
//! ```
//! repeated until nothing changes: the method of multipliers on a linear problem. A pass shrinks the error by about 1/alpha where
//! rows are independent; along redundant combinations y stays zero. Rows and columns are scaled by the diagonal of A, so that
//! alpha counts effective masses of rows (METHODS.md e.2b: 1e7).
use faer::linalg::solvers::PartialPivLu;
use faer::prelude::*;
use nalgebra::{DMatrix, DVector};

use crate::error::{Error, Result};
use crate::linalg::small_lu::SmallLu;

const ALPHA: f64 = 1e7;
const PASSES: usize = 40;
/// Rows below this part of the largest carry nothing.
const ROUNDING: f64 = 1e-9;

pub struct Penalty {
    a: DMatrix<f64>,
    left: DMatrix<f64>,
    right: DMatrix<f64>,
    column: Vec<f64>,
    row: Vec<f64>,
    lu: Lu,
}

/// Up to this size plain loops are faster than a library.
const SMALL: usize = 16;

enum Lu {
    Small(SmallLu),
    Large(PartialPivLu<f64>),
}

impl Penalty {
    /// `left` (n, m) and `right` (m, n) are nearly transposes of each other.
    pub fn new(a: &DMatrix<f64>, left: &DMatrix<f64>, right: &DMatrix<f64>) -> Result<Self> {
        let (n, m) = (a.nrows(), right.nrows());
        let column: Vec<f64> = (0..n)
            .map(|i| {
                let d = a[(i, i)].abs();
                if d > 0.0 { 1.0 / d.sqrt() } else { 1.0 }
            })
            .collect();
        let sizes: Vec<f64> =
            (0..m).map(|i| (0..n).map(|j| (right[(i, j)] * column[j]).powi(2)).sum::<f64>().sqrt()).collect();
        let largest = sizes.iter().copied().fold(0.0, f64::max);
        // a row that is rounding only, as those across the plane of a flat loop, must not be blown up to a constraint
        let row: Vec<f64> = sizes
            .iter()
            .map(|s| match s {
                s if *s > ROUNDING * largest => 1.0 / s,
                _ if largest > 0.0 => 1.0 / largest,
                _ => 1.0,
            })
            .collect();
        let a = DMatrix::from_fn(n, n, |i, j| a[(i, j)] * column[i] * column[j]);
        let left = DMatrix::from_fn(n, m, |i, j| left[(i, j)] * column[i] * row[j]);
        let right = DMatrix::from_fn(m, n, |i, j| right[(i, j)] * row[i] * column[j]);
        let p = &a + &left * &right * ALPHA;
        if p.iter().any(|v| !v.is_finite()) {
            return Err(Error::singular("the equations of a step are no numbers"));
        }
        let lu = if n <= SMALL {
            Lu::Small(SmallLu::new(p))
        } else {
            Lu::Large(MatRef::from_column_major_slice(p.as_slice(), n, n).partial_piv_lu())
        };
        Ok(Penalty { a, left, right, column, row, lu })
    }

    /// A, without its scales.
    pub fn matrix(&self) -> DMatrix<f64> {
        let n = self.column.len();
        DMatrix::from_fn(n, n, |i, j| self.a[(i, j)] / (self.column[i] * self.column[j]))
    }

    /// x (n, k) and y (m, k) with A x + L y = f, R x = g.
    pub fn solve(&self, f: &DMatrix<f64>, g: &DMatrix<f64>) -> Result<(DMatrix<f64>, DMatrix<f64>)> {
        self.passes(f, g, false)
    }

    /// x and y with A^T x + R^T y = f, L^T x = g.
    pub fn solve_transposed(&self, f: &DMatrix<f64>, g: &DMatrix<f64>) -> Result<(DMatrix<f64>, DMatrix<f64>)> {
        self.passes(f, g, true)
    }

    pub fn solve_one(&self, f: &DVector<f64>, g: &DVector<f64>) -> Result<(DVector<f64>, DVector<f64>)> {
        let (x, y) = self.solve(
            &DMatrix::from_column_slice(f.len(), 1, f.as_slice()),
            &DMatrix::from_column_slice(g.len(), 1, g.as_slice()),
        )?;
        Ok((x.column(0).into_owned(), y.column(0).into_owned()))
    }

    fn passes(&self, f: &DMatrix<f64>, g: &DMatrix<f64>, transposed: bool) -> Result<(DMatrix<f64>, DMatrix<f64>)> {
        let (n, m, k) = (self.column.len(), self.row.len(), f.ncols());
        let f = DMatrix::from_fn(n, k, |i, j| f[(i, j)] * self.column[i]);
        let g = DMatrix::from_fn(m, k, |i, j| g[(i, j)] * self.row[i]);
        let (mut x, mut y) = (DMatrix::zeros(n, k), DMatrix::zeros(m, k));
        let mut last = f64::INFINITY;
        for pass in 0..PASSES {
            let (r1, r2) = if pass == 0 {
                (f.clone(), g.clone())
            } else if transposed {
                (&f - self.a.tr_mul(&x) - self.right.tr_mul(&y), &g - self.left.tr_mul(&x))
            } else {
                (&f - &self.a * &x - &self.left * &y, &g - &self.right * &x)
            };
            let dx = if transposed {
                self.back(r1 + self.right.tr_mul(&r2) * ALPHA, true)
            } else {
                self.back(r1 + &self.left * &r2 * ALPHA, false)
            };
            if dx.iter().any(|v| !v.is_finite()) {
                return Err(Error::singular("the equations of a step are singular: a motion without inertia"));
            }
            let reached = if transposed { self.left.tr_mul(&dx) } else { &self.right * &dx };
            // R dx - r2, not R x - g: the rounding of x would come back alpha-fold
            let dy = (reached - r2) * ALPHA;
            x += &dx;
            y += &dy;
            let change = relative(&dx, &x).max(relative(&dy, &y));
            if m == 0 || change <= 4.0 * f64::EPSILON || change > 0.3 * last && pass > 1 {
                break;
            }
            last = change;
        }
        Ok((
            DMatrix::from_fn(n, k, |i, j| x[(i, j)] * self.column[i]),
            DMatrix::from_fn(m, k, |i, j| y[(i, j)] * self.row[i]),
        ))
    }

    fn back(&self, mut b: DMatrix<f64>, transposed: bool) -> DMatrix<f64> {
        match &self.lu {
            Lu::Small(lu) if transposed => lu.solve_transposed(&mut b),
            Lu::Small(lu) => lu.solve(&mut b),
            Lu::Large(lu) => {
                let (n, k) = b.shape();
                let x = MatMut::from_column_major_slice_mut(b.as_mut_slice(), n, k);
                if transposed {
                    lu.solve_transpose_in_place(x);
                } else {
                    lu.solve_in_place(x);
                }
            }
        }
        b
    }
}

/// Largest change of any column over its size.
fn relative(change: &DMatrix<f64>, of: &DMatrix<f64>) -> f64 {
    change
        .column_iter()
        .zip(of.column_iter())
        .map(|(d, x)| {
            let (d, x) = (d.amax(), x.amax());
            if d == 0.0 { 0.0 } else { d / x.max(1e-300) }
        })
        .fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn solves_with_redundant_rows_and_transposed() -> Result<()> {
        let a = DMatrix::from_fn(4, 4, |i, j| if i == j { 3.0 + i as f64 } else { 0.2 * i as f64 - 0.1 * j as f64 });
        let r = DMatrix::from_row_slice(3, 4, &[1.0, -1.0, 0.5, 0.0, 2.0, -2.0, 1.0, 0.0, 0.0, 1.0, 1.0, 2.0]);
        let p = Penalty::new(&a, &r.transpose(), &r)?;
        let f = DMatrix::from_fn(4, 2, |i, j| (i + 2 * j) as f64 - 1.5);
        let g = DMatrix::from_fn(3, 2, |i, j| if i == 1 { 2.0 * (0.3 + j as f64) } else { 0.3 + j as f64 });
        let (x, y) = p.solve(&f, &g)?;
        assert!((&a * &x + r.transpose() * &y - &f).amax() < 1e-14);
        assert!((&r * &x - &g).amax() < 1e-14);
        let (x, y) = p.solve_transposed(&f, &g)?;
        assert!((a.transpose() * &x + r.transpose() * &y - &f).amax() < 1e-14);
        assert!((&r * &x - &g).amax() < 1e-14);
        Ok(())
    }
}
