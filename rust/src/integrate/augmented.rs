//! The saddle systems of ALI3-P as the literature solves them: by penalties a and passes that update the multipliers.
//!
//! ```text
//! A x + L y = f,  R x = g:     (A + L a R) x_k = f - L (y_k-1 - a g),   y_k = y_k-1 + a (R x_k - g),   y_0 = 0
//! ```
//! The error of the rows shrinks by about 1/(1 + a/m) in each pass, m the effective mass of a row, in which a is counted.
//! E. Bayo, J. Garcia de Jalon, M. A. Serna, Computer Methods in Applied Mechanics and Engineering 71 (1988) 183-195.
use nalgebra::{DMatrix, DVector, Dyn, LU};

use crate::error::{Error, Result};

#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Penalty {
    /// in effective masses of the rows
    pub factor: f64,
    pub passes: usize,
}

pub struct Augmented {
    lu: LU<f64, Dyn, Dyn>,
    left: DMatrix<f64>,
    right: DMatrix<f64>,
    penalties: DVector<f64>,
    kept: Vec<usize>,
    rows: usize,
    passes: usize,
}

impl Augmented {
    /// Of the rows `kept`, which carry the rank; L is the transpose of `jacobian`.
    pub fn new(a: &DMatrix<f64>, jacobian: &DMatrix<f64>, right: &DMatrix<f64>, kept: &[usize], by: Penalty) -> Self {
        let (rows, left) = (jacobian.nrows(), jacobian.select_rows(kept).transpose());
        let right = right.select_rows(kept);
        let mobility = |row: usize| (0..a.nrows()).map(|j| left[(j, row)] * right[(row, j)] / a[(j, j)]).sum::<f64>();
        let penalties = DVector::from_fn(kept.len(), |row, _| by.factor / mobility(row).abs());
        let mut scaled = right.clone();
        for (mut row, a) in scaled.row_iter_mut().zip(penalties.iter()) {
            row *= *a;
        }
        let lu = (a + &left * scaled).lu();
        Augmented { lu, left, right, penalties, kept: kept.to_vec(), rows, passes: by.passes }
    }

    pub fn passes(&self) -> usize {
        self.passes
    }

    /// x, and y with zeros for the rows that do not act.
    pub fn solve(&self, f: &DVector<f64>, g: &DVector<f64>) -> Result<(DVector<f64>, DVector<f64>)> {
        let g = DVector::from_fn(self.kept.len(), |k, _| g[self.kept[k]]);
        let pushed = |miss: &DVector<f64>| miss.component_mul(&self.penalties);
        let mut y = DVector::zeros(self.kept.len());
        let mut x = DVector::zeros(f.len());
        for _ in 0..self.passes {
            let rhs = f - &self.left * (&y - pushed(&g));
            x = self
                .lu
                .solve(&rhs)
                .ok_or_else(|| Error::singular("the matrix with penalties of a step is singular"))?;
            y += pushed(&(&self.right * &x - &g));
        }
        let mut whole = DVector::zeros(self.rows);
        self.kept.iter().zip(y.iter()).for_each(|(row, y)| whole[*row] = *y);
        Ok((x, whole))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn passes_lead_to_the_saddle_point() {
        let a = DMatrix::from_row_slice(3, 3, &[2.0, 0.3, 0.0, 0.3, 50.0, -1.0, 0.0, -1.0, 0.4]);
        let rows = DMatrix::from_row_slice(2, 3, &[1.0, 0.2, -0.3, 0.0, 4.0, 1.0]);
        let (f, g) = (DVector::from_vec(vec![1.0, -2.0, 0.5]), DVector::from_vec(vec![0.1, -0.7]));
        let mut before = f64::INFINITY;
        for passes in 1..6 {
            let by = Penalty { factor: 100.0, passes };
            let (x, y) = Augmented::new(&a, &rows, &rows, &[0, 1], by).solve(&f, &g).unwrap();
            let miss = (&rows * &x - &g).amax();
            assert!((&a * &x + rows.transpose() * &y - &f).amax() < 1e-12);
            assert!(miss < 0.05 * before || miss < 1e-13, "{passes}: {miss}");
            before = miss;
        }
    }
}
