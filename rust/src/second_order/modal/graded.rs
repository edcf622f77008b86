//! First approximations of shapes where stiffnesses or masses differ by many orders: singular vectors of a factor of K.
//!
//! With K = F^T F and M = L L^T, coordinates in ascending order of the columns of F (M with unit diagonal), the singular values of
//! F L^-T are the frequencies. Jacobi's method keeps the small ones, which an eigensolver on L^-1 K L^-T loses in rounding of the
//! largest. Z. Drmac, SIAM J. Numer. Anal. 35 (1998) 191-218.
use faer::Mat;

use super::triangular;
use crate::linalg::dense::{EPS, beside, cholesky, completed};
use crate::linalg::{jacobi, pivoted_cholesky};
use crate::run::Counts;
use crate::second_order::SecondOrder;

/// Shapes x with x^T M x = 1 in the coordinates of the system; the first `candidates` have no stiffness in the factor.
pub struct Start {
    pub x: Mat<f64>,
    pub candidates: usize,
}

/// From the pivoted Cholesky factor of K; None where K is indefinite or the method failed.
pub fn from_stiffness(system: &SecondOrder, counts: &mut Counts) -> Option<Start> {
    let n = system.size();
    counts.add("pivoted cholesky factorisations", 1);
    let factor = pivoted_cholesky::factor(system.k.as_ref(), 2.0 * n as f64 * EPS)?;
    let rank = factor.nrows();
    from_factor(system, &factor, rank, counts)
}

/// From a factor (any number of rows, at least `rank`) of known rank.
pub fn from_factor(system: &SecondOrder, factor: &Mat<f64>, rank: usize, counts: &mut Counts) -> Option<Start> {
    let n = system.size();
    counts.add("jacobi singular value decompositions", 1);
    let size = |j: usize| (0..factor.nrows()).map(|i| factor[(i, j)].powi(2)).sum::<f64>();
    let sizes: Vec<f64> = (0..n).map(size).collect();
    let mut order: Vec<usize> = (0..n).collect();
    order.sort_by(|&a, &b| sizes[a].total_cmp(&sizes[b]));
    let l = ordered_mass_factor(system, &order)?;
    let mut g = Mat::from_fn(n, factor.nrows(), |i, j| factor[(j, order[i])]);
    l.solve_lower_triangular_in_place(g.as_mut());
    let (sigma, v) = jacobi::right_singular(g.transpose(), rank)?;
    let still = completed(v.as_ref()).1;
    let mut y = beside(still.as_ref(), v.as_ref());
    l.transpose().solve_upper_triangular_in_place(y.as_mut());
    let mut place = vec![0; n];
    order.iter().enumerate().for_each(|(k, &i)| place[i] = k);
    Some(Start { x: Mat::from_fn(n, n, |i, j| y[(place[i], j)]), candidates: n - sigma.len() })
}

fn ordered_mass_factor(system: &SecondOrder, order: &[usize]) -> Option<Mat<f64>> {
    let n = order.len();
    match &system.mf {
        None => cholesky(Mat::from_fn(n, n, |i, j| system.m[(order[i], order[j])]).as_ref()).ok(),
        Some(mf) => triangular(&Mat::from_fn(mf.nrows(), n, |i, j| mf[(i, order[j])])).ok(),
    }
}
