//! Deterministic bases of the subspaces that belong to repeated roots, and deterministic signs.
use faer::linalg::solvers::DenseSolveCore;
use faer::{ColRef, Mat, MatRef};

use crate::linalg::dense::C;
use crate::tolerances::matrices::TIE;
use crate::tolerances::modes::ISOTROPIC;

/// First index among the components of largest modulus.
pub fn largest_component(x: ColRef<'_, C>, scale: &[f64]) -> usize {
    let size = |i: usize| x[i].norm() * scale[i];
    let largest = (0..x.nrows()).fold(0.0f64, |m, i| m.max(size(i)));
    (0..x.nrows()).find(|&i| size(i) >= (1.0 - TIE) * largest).unwrap_or(0)
}

/// The basis of span(x) that is the unit matrix in its most significant rows. Which rows these are depends on the span only.
pub fn aligned(x: MatRef<'_, C>) -> Mat<C> {
    let basis = orthonormal(x);
    let g = basis.ncols();
    let rows = significant_rows(&basis);
    let pivot = Mat::from_fn(g, g, |i, j| basis[(rows[i], j)]);
    let lu = pivot.partial_piv_lu();
    let inverse = lu.inverse();
    basis * inverse
}

fn orthonormal(x: MatRef<'_, C>) -> Mat<C> {
    x.qr().compute_thin_Q()
}

/// Greedy choice by the norms of the rows of an orthonormal basis, which do not depend on the basis.
fn significant_rows(basis: &Mat<C>) -> Vec<usize> {
    let (n, g) = (basis.nrows(), basis.ncols());
    let mut rest = basis.clone();
    let mut rows = Vec::with_capacity(g);
    for _ in 0..g {
        let norms: Vec<f64> = (0..n).map(|i| (0..g).map(|j| rest[(i, j)].norm_sqr()).sum::<f64>()).collect();
        let largest = norms.iter().fold(0.0f64, |m, v| m.max(*v));
        let row = (0..n).find(|&i| norms[i] >= (1.0 - TIE) * largest).unwrap_or(0);
        rows.push(row);
        if largest == 0.0 {
            continue;
        }
        let direction: Vec<C> = (0..g).map(|j| rest[(row, j)].conj() / norms[row].sqrt()).collect();
        for i in 0..n {
            let along: C = (0..g).map(|j| rest[(i, j)] * direction[j]).sum();
            for (j, d) in direction.iter().enumerate() {
                rest[(i, j)] -= along * d.conj();
            }
        }
    }
    rows.sort_unstable();
    rows
}

/// Gram-Schmidt, twice, in the inner product x^H m y.
pub fn hermitian_gram_schmidt(x: &mut Mat<C>, m: MatRef<'_, f64>) {
    for j in 0..x.ncols() {
        for _ in 0..2 {
            let mx = mass_times(m, x.col(j));
            for i in 0..j {
                let along: C = (0..x.nrows()).map(|r| x[(r, i)].conj() * mx[r]).sum();
                subtract(x, i, j, along);
            }
        }
        let mx = mass_times(m, x.col(j));
        let square: f64 = (0..x.nrows()).map(|r| (x[(r, j)].conj() * mx[r]).re).sum();
        rescale(x, j, C::new(1.0 / square.sqrt(), 0.0));
    }
}

/// Gram-Schmidt in the bilinear form x^T a y (a complex symmetric, not conjugated) to x^T a x = target. Vectors that the form
/// makes isotropic are mixed with a later one first. False where the form is singular on the span.
pub fn bilinear_gram_schmidt(x: &mut Mat<C>, form: impl Fn(ColRef<'_, C>) -> Vec<C>, target: C) -> bool {
    let g = x.ncols();
    for j in 0..g {
        for _ in 0..2 {
            let ax = form(x.col(j));
            for i in 0..j {
                let along: C = (0..x.nrows()).map(|r| x[(r, i)] * ax[r]).sum::<C>() / target;
                subtract(x, i, j, along);
            }
        }
        let ax = form(x.col(j));
        let products: Vec<C> = (j..g).map(|k| (0..x.nrows()).map(|r| x[(r, k)] * ax[r]).sum()).collect();
        let (best, size) =
            products.iter().enumerate().fold((0, 0.0), |b, (k, p)| if p.norm() > b.1 { (k, p.norm()) } else { b });
        if best > 0 && products[0].norm() < ISOTROPIC * size {
            for r in 0..x.nrows() {
                let other = x[(r, j + best)];
                x[(r, j)] += other;
            }
        }
        let ax = form(x.col(j));
        let square: C = (0..x.nrows()).map(|r| x[(r, j)] * ax[r]).sum();
        if square.norm() == 0.0 {
            return false;
        }
        rescale(x, j, (target / square).sqrt());
    }
    true
}

pub fn mass_times(m: MatRef<'_, f64>, x: ColRef<'_, C>) -> Vec<C> {
    let n = x.nrows();
    let mut out = vec![C::ZERO; n];
    for j in 0..n {
        for (i, o) in out.iter_mut().enumerate() {
            *o += x[j] * m[(i, j)];
        }
    }
    out
}

pub fn rescale(x: &mut Mat<C>, j: usize, factor: C) {
    for i in 0..x.nrows() {
        x[(i, j)] *= factor;
    }
}

fn subtract(x: &mut Mat<C>, from: usize, to: usize, along: C) {
    for r in 0..x.nrows() {
        let part = along * x[(r, from)];
        x[(r, to)] -= part;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// x^T x = `square` of the first vector, of the second 1.
    fn orthonormal(square: f64) -> Mat<C> {
        let other = C::new(0.0, (1.0 - square).sqrt());
        let mut x = Mat::from_fn(2, 2, |i, j| {
            if i == 0 {
                C::new(1.0, 0.0)
            } else if j == 0 {
                other
            } else {
                C::ZERO
            }
        });
        let form = |v: ColRef<'_, C>| v.iter().copied().collect();
        assert!(bilinear_gram_schmidt(&mut x, form, C::new(1.0, 0.0)));
        x
    }

    #[test]
    fn a_vector_that_is_isotropic_to_a_ten_thousandth_is_mixed_with_another() {
        let x = orthonormal(1e-5);
        let product = |i: usize, j: usize| (0..2).map(|r| x[(r, i)] * x[(r, j)]).sum::<C>();
        assert!([(0, 0, 1.0), (0, 1, 0.0), (1, 1, 1.0)].iter().all(|(i, j, e)| (product(*i, *j) - e).norm() < 1e-13));
        // another keeps its direction
        let x = orthonormal(1e-3);
        assert!((x[(1, 0)] / x[(0, 0)] - C::new(0.0, 0.999_f64.sqrt())).norm() < 1e-13);
    }

    #[test]
    fn of_equal_components_the_first_is_the_largest() {
        let first = |less: f64| {
            let x = [C::new(1.0 - less, 0.0), C::new(0.0, 1.0)];
            largest_component(ColRef::from_slice(&x), &[1.0, 1.0])
        };
        assert!(first(1e-7) == 0 && first(1e-5) == 1);
    }
}
