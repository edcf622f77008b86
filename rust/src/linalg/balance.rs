//! Balancing of a general real matrix, which faer's eigensolver leaves out.
//!
//! The purpose is that of LAPACK's gebal: a permutation isolates eigenvalues that can be read off, and a diagonal similarity
//! with powers of two makes the norms of matching rows and columns alike (James, Langou and Lowery, arXiv 1401.5766: 2-norms).
use faer::Mat;

/// `matrix = D^-1 P^T A P D`: the transformation that takes its eigenvectors back to those of `A`.
pub struct Balanced {
    pub matrix: Mat<f64>,
    order: Vec<usize>,
    scale: Vec<f64>,
}

impl Balanced {
    pub fn new(a: &Mat<f64>) -> Self {
        let (order, active) = isolate(a);
        let n = a.nrows();
        let mut matrix = Mat::from_fn(n, n, |i, j| a[(order[i], order[j])]);
        let scale = equilibrate(&mut matrix, active);
        Balanced { matrix, order, scale }
    }

    /// Row of `A` that row `i` of `matrix` came from, and the factor of a right eigenvector's entry there.
    pub fn right(&self, i: usize) -> (usize, f64) {
        (self.order[i], self.scale[i])
    }

    /// The same for a left eigenvector.
    pub fn left(&self, i: usize) -> (usize, f64) {
        (self.order[i], 1.0 / self.scale[i])
    }
}

/// An order of the indices in which the block outside `active` is upper triangular.
fn isolate(a: &Mat<f64>) -> (Vec<usize>, std::ops::Range<usize>) {
    let n = a.nrows();
    let mut order: Vec<usize> = (0..n).collect();
    let (mut low, mut high) = (0, n);
    let alone = |order: &[usize], at: usize, low: usize, high: usize, row: bool| {
        (low..high).all(|j| {
            let (p, q) = (order[at], order[j]);
            j == at || (if row { a[(p, q)] } else { a[(q, p)] }) == 0.0
        })
    };
    while let Some(at) = (low..high).rev().find(|&i| alone(&order, i, low, high, true)) {
        order.swap(at, high - 1);
        high -= 1;
    }
    while let Some(at) = (low..high).find(|&i| alone(&order, i, low, high, false)) {
        order.swap(at, low);
        low += 1;
    }
    (order, low..high)
}

fn equilibrate(a: &mut Mat<f64>, active: std::ops::Range<usize>) -> Vec<f64> {
    const SWEEPS: usize = 30;
    const GAIN: f64 = 0.95;
    let n = a.nrows();
    let mut scale = vec![1.0; n];
    for _ in 0..SWEEPS {
        let mut changed = false;
        for i in active.clone() {
            let (mut row, mut column) = (0.0, 0.0);
            for j in active.clone().filter(|&j| j != i) {
                row += a[(i, j)] * a[(i, j)];
                column += a[(j, i)] * a[(j, i)];
            }
            if row == 0.0 || column == 0.0 || !(row + column).is_finite() {
                continue;
            }
            // (column f^2 + row / f^2) is least at f^4 = row / column; a power of two makes the scaling exact
            let f = ((row / column).log2() / 4.0).round().exp2();
            let better = column * f * f + row / (f * f) < GAIN * (column + row);
            // squares of the factors stay numbers
            let range = f64::MIN_POSITIVE.sqrt();
            if !better || !(range..range.recip()).contains(&(scale[i] * f)) {
                continue;
            }
            changed = true;
            scale[i] *= f;
            for j in 0..n {
                a[(i, j)] /= f;
                a[(j, i)] *= f;
            }
        }
        if !changed {
            break;
        }
    }
    scale
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scaling_and_permutation_are_undone_exactly() {
        let a = faer::mat![[1.0, 1e6, 0.0, 2.0], [1e-6, 2.0, 0.0, 1e3], [5.0, 7.0, 3.0, 1.0], [0.0, 1e-4, 0.0, 4.0]];
        let b = Balanced::new(&a);
        for i in 0..4 {
            for j in 0..4 {
                let ((p, f), (q, g)) = (b.right(i), b.right(j));
                assert_eq!(b.matrix[(i, j)] * f / g, a[(p, q)]);
            }
        }
        // the third eigenvalue is isolated; its row may grow, the block of the others may not
        assert_eq!(b.right(0).0, 2);
        assert!(b.matrix.submatrix(1, 1, 3, 3).norm_max() <= 4.0);
    }
}
