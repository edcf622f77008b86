//! Closed loops: dependent coordinates, and the transformation B'' from minimal to tree coordinates.
//!
//! Rows and columns are scaled by the lengths of their loops, so that no choice depends on units; the ranks are those of `rank`. B'' = [-J_d^-1 J_i; 1]; for redundant rows the inverse is a left inverse, valid while the rows agree.
use faer::prelude::*;
use nalgebra::{DMatrix, DVector};

use crate::error::{Error, Result};
use crate::linalg::matrix::Matrix;
use crate::linalg::rows::{Level as Asked, gather};
use crate::spatial::Real;
use crate::system::System;
use crate::system::rank::Decision;
use crate::system::topology::{ConstraintRow, Topology};
use crate::tolerances::constraints::TIE;

#[derive(Debug, Clone)]
pub struct Loops {
    pub dependent: Vec<usize>,
    pub independent: Vec<usize>,
    /// left inverse of J_d over the position and velocity rows, (r, n_rows)
    pub left_inverse: DMatrix<f64>,
    /// orthonormal left null space of the scaled rows, (n_rows, n_redundant), and its rows unscaled
    pub redundant: DMatrix<f64>,
    /// indices of rows that could be dropped
    pub dropped: Vec<usize>,
    pub row_scale: Vec<f64>,
    /// the shortest pivot, free of units, and its block: where it is below the tolerance the pose has lost rank
    pub weakest: Option<(f64, usize)>,
}

pub fn row_scales(topology: &Topology, length: f64) -> Vec<f64> {
    let scale = |row: &ConstraintRow| {
        if row.coordinate.is_length() { 1.0 / length } else { 1.0 }
    };
    topology.rows.iter().map(scale).collect()
}

pub fn column_scales(topology: &Topology, length: f64) -> Vec<f64> {
    (0..topology.n_tree).map(|i| topology.scale(i, length)).collect()
}

fn to_faer(m: &DMatrix<f64>) -> Mat<f64> {
    Mat::from_fn(m.nrows(), m.ncols(), |i, j| m[(i, j)])
}

/// Column-pivoted QR of a matrix whose rank is known: the pivots, and how long the last of them is. Of columns as long as each other
/// the first is taken, so that neither rounding nor units choose.
fn pivots(m: &DMatrix<f64>, rank: usize) -> (Vec<usize>, f64) {
    let (mut a, n) = (m.clone(), m.ncols());
    let mut order: Vec<usize> = (0..n).collect();
    let mut last = f64::INFINITY;
    for k in 0..rank.min(n) {
        let lengths: Vec<f64> = (k..n).map(|j| a.column(j).norm()).collect();
        let longest = lengths.iter().copied().fold(0.0, f64::max);
        last = last.min(longest);
        if longest == 0.0 {
            break;
        }
        let tied = lengths.iter().position(|l| *l >= (1.0 - TIE) * longest);
        let chosen = k + tied.unwrap_or(0);
        // the others keep their order
        order[k..=chosen].rotate_right(1);
        for j in (k..chosen).rev() {
            a.swap_columns(j, j + 1);
        }
        let q = a.column(k) / a.column(k).norm();
        for j in k + 1..n {
            for _ in 0..2 {
                let part = q.dot(&a.column(j));
                a.column_mut(j).axpy(-part, &q, 1.0);
            }
        }
    }
    order.truncate(rank);
    (order, last)
}

impl Loops {
    /// Dependent coordinates of rows whose ranks are decided; None where no row acts.
    pub fn analyse(system: &System, jacobian: &DMatrix<f64>, decision: &Decision) -> Result<Option<Loops>> {
        let rows = &decision.rows;
        if system.topology.rows.is_empty() {
            return Ok(None);
        }
        let jacobian = Matrix::Dense(jacobian.clone());
        let n_rows = system.topology.rows.len();
        let mut parts = Vec::with_capacity(rows.blocks.len());
        let mut weakest: Option<(f64, usize)> = None;
        for (k, block) in rows.blocks.iter().enumerate() {
            let m = gather(&jacobian, &block.rows, &block.columns, rows);
            let (order, last) = pivots(&m, block.rank);
            if block.rank > 0 && weakest.is_none_or(|(w, _)| last < w) {
                weakest = Some((last, k));
            }
            let jd = DMatrix::from_fn(m.nrows(), order.len(), |i, k| m[(i, order[k])]);
            let (inverse, null) = left_inverse(&jd)?;
            parts.push((block, order, inverse, null));
        }
        let mut dependent: Vec<usize> =
            parts.iter().flat_map(|(b, order, ..)| order.iter().map(|c| b.columns[*c])).collect();
        dependent.sort_unstable();
        let independent = (0..system.n_tree()).filter(|j| dependent.binary_search(j).is_err()).collect();
        let mut left = DMatrix::zeros(dependent.len(), n_rows);
        let redundant_rows = parts.iter().map(|p| p.3.ncols()).sum();
        let (mut redundant, mut at) = (DMatrix::zeros(n_rows, redundant_rows), 0);
        for (block, order, inverse, null) in &parts {
            for (k, c) in order.iter().enumerate() {
                let column = block.columns[*c];
                let Ok(place) = dependent.binary_search(&column) else { continue };
                for (i, row) in block.rows.iter().enumerate() {
                    left[(place, *row)] = rows.column_scale[column] * inverse[(k, i)] * rows.row_scale[*row];
                }
            }
            for k in 0..null.ncols() {
                block.rows.iter().enumerate().for_each(|(i, row)| redundant[(*row, at + k)] = null[(i, k)]);
            }
            at += null.ncols();
        }
        let kept = rows.select(&jacobian, Asked::All);
        let dropped = (0..n_rows).filter(|i| kept.binary_search(i).is_err()).collect();
        Ok(Some(Loops {
            dependent,
            independent,
            left_inverse: left,
            redundant,
            dropped,
            row_scale: rows.row_scale.clone(),
            weakest,
        }))
    }

    /// B'' restricted to the dependent coordinates, -J_d^-1 J_i.
    pub fn dependent_map<T: Real>(&self, jacobian: &DMatrix<T>) -> DMatrix<T> {
        let ji = DMatrix::from_fn(jacobian.nrows(), self.independent.len(), |i, k| jacobian[(i, self.independent[k])]);
        self.balanced(jacobian, &ji)
    }

    /// -J_d^-1 R over any number type: Newton corrections of the real inverse give each further order of a dual number exactly.
    pub fn balanced<T: Real>(&self, jacobian: &DMatrix<T>, right: &DMatrix<T>) -> DMatrix<T> {
        let jd = DMatrix::from_fn(jacobian.nrows(), self.dependent.len(), |i, k| jacobian[(i, self.dependent[k])]);
        let inverse = self.left_inverse.map(T::from);
        let mut b = -(&inverse * right);
        for _ in 0..T::NDERIV.max(1) {
            let miss = right + &jd * &b;
            b -= &inverse * miss;
        }
        b
    }

    /// How far rows with this Jacobian are from agreeing: the redundant combinations of J B'', scaled.
    pub fn disagreement<T: Real>(&self, jacobian: &DMatrix<T>, dependent_map: &DMatrix<T>) -> DMatrix<T> {
        let n = jacobian.nrows();
        let jd = DMatrix::from_fn(n, self.dependent.len(), |i, k| jacobian[(i, self.dependent[k])] * self.row_scale[i]);
        let ji =
            DMatrix::from_fn(n, self.independent.len(), |i, k| jacobian[(i, self.independent[k])] * self.row_scale[i]);
        self.redundant.transpose().map(T::from) * (ji + jd * dependent_map)
    }

    /// Multipliers that balance generalised forces on the dependent coordinates, of minimum norm in the scaled rows.
    pub fn multipliers<T: Real>(&self, jacobian: &DMatrix<T>, tau: &DVector<T>) -> DVector<T> {
        let n = jacobian.nrows();
        let jd = DMatrix::from_fn(n, self.dependent.len(), |i, k| jacobian[(i, self.dependent[k])]);
        let right = DVector::from_fn(self.dependent.len(), |k, _| -tau[self.dependent[k]]);
        let inverse = self.left_inverse.transpose().map(T::from);
        let mut lam = &inverse * &right;
        for _ in 0..T::NDERIV.max(1) {
            let miss = &right - jd.transpose() * &lam;
            lam += &inverse * miss;
        }
        lam
    }

    /// X'' = B''^T X B''.
    pub fn reduce<T: Real>(&self, x: &DMatrix<T>, b: &DMatrix<T>) -> DMatrix<T> {
        let pick = |rows: &[usize], columns: &[usize]| {
            DMatrix::from_fn(rows.len(), columns.len(), |i, j| x[(rows[i], columns[j])])
        };
        let (d, i) = (&self.dependent, &self.independent);
        let right_d = pick(d, i) + pick(d, d) * b;
        let right_i = pick(i, i) + pick(i, d) * b;
        right_i + b.transpose() * right_d
    }

    pub fn reduce_vector<T: Real>(&self, tau: &DVector<T>, b: &DMatrix<T>) -> DVector<T> {
        let pick = |rows: &[usize]| DVector::from_fn(rows.len(), |i, _| tau[rows[i]]);
        pick(&self.independent) + b.transpose() * pick(&self.dependent)
    }

    /// All tree coordinates from minimal ones.
    pub fn expand<T: Real>(&self, b: &DMatrix<T>, z: &DVector<T>) -> DVector<T> {
        let mut y = DVector::zeros(self.dependent.len() + self.independent.len());
        let yd = b * z;
        for (k, i) in self.independent.iter().enumerate() {
            y[*i] = z[k];
        }
        for (k, d) in self.dependent.iter().enumerate() {
            y[*d] = yd[k];
        }
        y
    }
}

/// Pseudo-inverse of a matrix of full column rank and an orthonormal basis of its left null space, by the SVD.
fn left_inverse(m: &DMatrix<f64>) -> Result<(DMatrix<f64>, DMatrix<f64>)> {
    let (n, r) = m.shape();
    if r == 0 {
        return Ok((DMatrix::zeros(0, n), DMatrix::identity(n, n)));
    }
    let svd = to_faer(m)
        .svd()
        .map_err(|_| Error::singular("the singular values of the constraint rows could not be found"))?;
    let (u, s, v) = (svd.U(), svd.S().column_vector(), svd.V());
    let inverse = DMatrix::from_fn(r, n, |i, j| (0..r).map(|k| v[(i, k)] / s[k] * u[(j, k)]).sum());
    let null = DMatrix::from_fn(n, n - r, |i, j| u[(i, r + j)]);
    Ok((inverse, null))
}

/// Names of the redundant rows: what makes them and how many of them the others already enforce. Rows that do not act are none.
pub fn redundant_names(
    topology: &Topology,
    loops: &Loops,
    acts: impl Fn(&ConstraintRow) -> bool,
) -> Vec<(String, usize)> {
    let mut found: Vec<(String, usize)> = Vec::new();
    for row in loops.dropped.iter().filter(|i| acts(&topology.rows[**i])) {
        let name = topology.row_name(*row);
        match found.iter_mut().find(|(n, _)| n == name) {
            Some((_, n)) => *n += 1,
            None => found.push((name.to_owned(), 1)),
        }
    }
    found
}
