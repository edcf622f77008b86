//! One small dense complex system, solved in place: a library's preparations for large ones cost more than the work itself.
use num_complex::Complex64 as c64;

/// Elimination with row pivots of a matrix by rows, which is used up; `x` is the right-hand side and then the solution, not finite where the
/// matrix is singular.
pub fn solve_in_place(a: &mut [c64], x: &mut [c64]) {
    let n = x.len();
    for column in 0..n {
        let size = |row: usize| a[row * n + column].norm_sqr();
        let pivot = (column..n).max_by(|i, j| size(*i).total_cmp(&size(*j))).unwrap_or(column);
        if pivot != column {
            (0..n).for_each(|j| a.swap(pivot * n + j, column * n + j));
            x.swap(pivot, column);
        }
        let (above, below) = a.split_at_mut((column + 1) * n);
        let own = &above[column * n..];
        let inverse = own[column].inv();
        for (i, row) in below.chunks_exact_mut(n).enumerate() {
            let factor = row[column] * inverse;
            if factor != c64::new(0.0, 0.0) {
                row[column + 1..].iter_mut().zip(&own[column + 1..]).for_each(|(r, o)| *r -= factor * o);
                let known = x[column];
                x[column + 1 + i] -= factor * known;
            }
        }
    }
    for row in (0..n).rev() {
        let known: c64 = (row + 1..n).map(|j| a[row * n + j] * x[j]).sum();
        x[row] = (x[row] - known) / a[row * n + row];
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn entry(i: usize, j: usize) -> c64 {
        let at = (7 * i + 3 * j + 1) as f64;
        c64::new(at.sin(), (1.7 * at).cos())
    }

    #[test]
    fn the_solution_solves_and_a_zero_pivot_is_exchanged() {
        for n in 1..6 {
            let mut a: Vec<c64> = (0..n * n).map(|at| entry(at / n, at % n)).collect();
            if n > 1 {
                a[0] = c64::new(0.0, 0.0);
            }
            let exact: Vec<c64> = (0..n).map(|i| entry(i, 11)).collect();
            let mut x: Vec<c64> = (0..n).map(|i| (0..n).map(|j| a[i * n + j] * exact[j]).sum()).collect();
            solve_in_place(&mut a, &mut x);
            assert!(x.iter().zip(&exact).all(|(x, e)| (x - e).norm() < 1e-11), "{n}: {x:?} {exact:?}");
        }
    }

    #[test]
    fn a_singular_matrix_has_no_finite_solution() {
        let (one, two) = (c64::new(1.0, 0.0), c64::new(2.0, 0.0));
        let mut x = [one, one];
        solve_in_place(&mut [one, two, one, two], &mut x);
        assert!(x.iter().any(|x| !x.norm().is_finite()));
    }
}
