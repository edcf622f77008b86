//! LU factors of a small dense matrix with row pivots: a library's preparations for large ones cost more than the work itself.
use nalgebra::DMatrix;

pub struct SmallLu {
    /// unit lower and upper factor in one place
    factors: DMatrix<f64>,
    /// the row that row k was exchanged with
    pivots: Vec<usize>,
}

impl SmallLu {
    /// A singular matrix gives solutions that are not finite.
    pub fn new(mut a: DMatrix<f64>) -> Self {
        let n = a.nrows();
        let mut pivots = Vec::with_capacity(n);
        for k in 0..n {
            let larger = |p: usize, i: usize| {
                if a[(i, k)].abs() > a[(p, k)].abs() { i } else { p }
            };
            let p = (k + 1..n).fold(k, larger);
            pivots.push(p);
            a.swap_rows(k, p);
            for i in k + 1..n {
                a[(i, k)] /= a[(k, k)];
            }
            for j in k + 1..n {
                let u = a[(k, j)];
                for i in k + 1..n {
                    a[(i, j)] -= a[(i, k)] * u;
                }
            }
        }
        SmallLu { factors: a, pivots }
    }

    /// The smallest entry on the diagonal of the upper factor.
    pub fn smallest_pivot(&self) -> f64 {
        (0..self.pivots.len())
            .map(|k| self.factors[(k, k)].abs())
            .fold(f64::INFINITY, |a, b| if b < a || b.is_nan() { b } else { a })
    }

    /// A x = b, x in the place of b.
    pub fn solve(&self, b: &mut DMatrix<f64>) {
        let (a, n) = (&self.factors, self.pivots.len());
        for (k, p) in self.pivots.iter().enumerate() {
            b.swap_rows(k, *p);
        }
        for mut x in b.column_iter_mut() {
            for j in 0..n {
                for i in j + 1..n {
                    x[i] -= a[(i, j)] * x[j];
                }
            }
            for j in (0..n).rev() {
                x[j] /= a[(j, j)];
                for i in 0..j {
                    x[i] -= a[(i, j)] * x[j];
                }
            }
        }
    }

    /// A^T x = b.
    pub fn solve_transposed(&self, b: &mut DMatrix<f64>) {
        let (a, n) = (&self.factors, self.pivots.len());
        for mut x in b.column_iter_mut() {
            for j in 0..n {
                let known: f64 = (0..j).map(|i| a[(i, j)] * x[i]).sum();
                x[j] = (x[j] - known) / a[(j, j)];
            }
            for j in (0..n).rev() {
                let known: f64 = (j + 1..n).map(|i| a[(i, j)] * x[i]).sum();
                x[j] -= known;
            }
        }
        for (k, p) in self.pivots.iter().enumerate().rev() {
            b.swap_rows(k, *p);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn solves_both_ways_and_tells_a_singular_matrix() {
        // zero first pivot: rows must be exchanged
        let a = DMatrix::from_row_slice(3, 3, &[0.0, 2.0, 1.0, 1.0, -1.0, 0.5, 4.0, 0.3, -2.0]);
        let b = DMatrix::from_row_slice(3, 2, &[1.0, -2.0, 0.5, 3.0, -1.5, 0.25]);
        let lu = SmallLu::new(a.clone());
        let (mut x, mut y) = (b.clone(), b.clone());
        lu.solve(&mut x);
        lu.solve_transposed(&mut y);
        assert!((&a * x - &b).amax() < 1e-14);
        assert!((a.transpose() * y - &b).amax() < 1e-14);
        let mut lost = b;
        SmallLu::new(DMatrix::from_element(3, 3, 1.0)).solve(&mut lost);
        assert!(lost.iter().any(|v| !v.is_finite()));
    }
}
