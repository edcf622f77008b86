//! Closed loops: dependent coordinates, and the transformation B'' from minimal to tree coordinates.
//!
//! Rows and columns are scaled by the lengths of their loops, so that no choice depends on units; the ranks are those of `rank`. B'' = [-J_d^-1 J_i; 1]; for redundant rows the inverse is a left inverse, valid while the rows agree.
use std::collections::HashMap;

use faer::prelude::*;
use nalgebra::{DMatrix, DVector};

use crate::error::{Error, Result};
use crate::linalg::matrix::Matrix;
use crate::linalg::rows::{Level as Asked, RowBlocks, parts};
use crate::multibody::System;
use crate::multibody::decision::Decision;
use crate::multibody::topology::{ConstraintRow, Topology};
use crate::spatial::Real;
use crate::tolerances::matrices::TIE;

/// Blocks with more entries are refused: their inverses are dense.
const LARGEST_BLOCK: usize = 20_000_000;

/// The rows of one block at a pose.
#[derive(Debug, Clone)]
pub struct LoopBlock {
    /// rows and columns of the whole, positions first; see `RowBlocks`
    pub rows: Vec<usize>,
    pub columns: Vec<usize>,
    /// the dependent ones of the columns, as places among them
    pub dependent: Vec<usize>,
    /// left inverse of the dependent columns, (r, n_rows), rows and columns free of units
    pub inverse: DMatrix<f64>,
    /// orthonormal left null space of the rows, free of units, (n_rows, n_redundant)
    pub redundant: DMatrix<f64>,
}

/// Dependent coordinates block by block: O(blocks), whatever the size of the model.
#[derive(Debug, Clone)]
pub struct LoopBlocks {
    pub blocks: Vec<LoopBlock>,
    pub dependent: Vec<usize>,
    pub independent: Vec<usize>,
    /// indices of rows that could be dropped
    pub dropped: Vec<usize>,
    /// the shortest pivot, free of units, and its block: where it is below the tolerance the pose has lost rank
    pub weakest: Option<(f64, usize)>,
}

/// The same as dense matrices over all coordinates.
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

impl LoopBlocks {
    /// Dependent coordinates of rows whose ranks are decided; None where no row acts.
    pub fn analyse(system: &System, jacobian: &Matrix, decision: &Decision) -> Result<Option<LoopBlocks>> {
        let rows = &decision.rows;
        if system.topology.rows.is_empty() {
            return Ok(None);
        }
        if let Some(large) = rows.blocks.iter().find(|b| b.rows.len().saturating_mul(b.columns.len()) > LARGEST_BLOCK) {
            return Err(Error::route(format!(
                "{} constraints on {} coordinates hang together in loops; this is dense work, limited to {LARGEST_BLOCK} entries: replace \
                 joints that close loops by bushings, or make the model smaller",
                large.rows.len(),
                large.columns.len()
            )));
        }
        let n_rows = system.topology.rows.len();
        let mut blocks = Vec::with_capacity(rows.blocks.len());
        let mut weakest: Option<(f64, usize)> = None;
        let all = parts(jacobian, &rows.blocks, Asked::All, rows.units(), |_| true);
        for (k, (block, m)) in rows.blocks.iter().zip(all).enumerate() {
            let Some(m) = m else { continue };
            let (dependent, last) = pivots(&m, block.rank);
            if block.rank > 0 && weakest.is_none_or(|(w, _)| last < w) {
                weakest = Some((last, k));
            }
            let (inverse, redundant) = left_inverse(&m.select_columns(&dependent))?;
            let (rows, columns) = (block.rows.clone(), block.columns.clone());
            blocks.push(LoopBlock { rows, columns, dependent, inverse, redundant });
        }
        let mut dependent: Vec<usize> = blocks.iter().flat_map(|b| b.dependent.iter().map(|c| b.columns[*c])).collect();
        dependent.sort_unstable();
        let independent = (0..system.n_tree()).filter(|j| dependent.binary_search(j).is_err()).collect();
        let kept = rows.select(jacobian, Asked::All);
        let dropped = (0..n_rows).filter(|i| kept.binary_search(i).is_err()).collect();
        Ok(Some(LoopBlocks { blocks, dependent, independent, dropped, weakest }))
    }

    /// Multipliers that balance generalised forces on the dependent coordinates, of minimum norm in the scaled rows.
    pub fn multipliers(&self, jacobian: &Matrix, rows: &RowBlocks, tau: &[f64]) -> Vec<f64> {
        let mut lam = vec![0.0; rows.row_scale.len()];
        let all = parts(jacobian, &rows.blocks, Asked::All, rows.units(), |_| true);
        for (block, m) in self.blocks.iter().zip(all) {
            let Some(m) = m else { continue };
            let jd = m.select_columns(&block.dependent);
            let force = |k: &usize| -tau[block.columns[*k]] * rows.column_scale[block.columns[*k]];
            let right = DVector::from_iterator(block.dependent.len(), block.dependent.iter().map(force));
            let mut own = block.inverse.tr_mul(&right);
            let miss = &right - jd.tr_mul(&own);
            own += block.inverse.tr_mul(&miss);
            for (i, v) in block.rows.iter().zip(own.iter()) {
                lam[*i] = v * rows.row_scale[*i];
            }
        }
        lam
    }
}

impl Loops {
    /// Dependent coordinates of rows whose ranks are decided; None where no row acts.
    pub fn analyse(system: &System, jacobian: &DMatrix<f64>, decision: &Decision) -> Result<Option<Loops>> {
        let blocks = LoopBlocks::analyse(system, &Matrix::Dense(jacobian.clone()), decision)?;
        Ok(blocks.map(|b| Loops::dense(b, decision)))
    }

    /// Blocks as dense matrices.
    pub fn dense(found: LoopBlocks, decision: &Decision) -> Loops {
        let rows = &decision.rows;
        let n_rows = rows.row_scale.len();
        let mut left = DMatrix::zeros(found.dependent.len(), n_rows);
        let redundant_rows = found.blocks.iter().map(|b| b.redundant.ncols()).sum();
        let (mut redundant, mut at) = (DMatrix::zeros(n_rows, redundant_rows), 0);
        for block in &found.blocks {
            for (k, c) in block.dependent.iter().enumerate() {
                let column = block.columns[*c];
                let Ok(place) = found.dependent.binary_search(&column) else { continue };
                for (i, row) in block.rows.iter().enumerate() {
                    left[(place, *row)] = rows.column_scale[column] * block.inverse[(k, i)] * rows.row_scale[*row];
                }
            }
            for k in 0..block.redundant.ncols() {
                block.rows.iter().enumerate().for_each(|(i, row)| redundant[(*row, at + k)] = block.redundant[(i, k)]);
            }
            at += block.redundant.ncols();
        }
        Loops {
            dependent: found.dependent,
            independent: found.independent,
            left_inverse: left,
            redundant,
            dropped: found.dropped,
            row_scale: rows.row_scale.clone(),
        }
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
    dropped: &[usize],
    acts: impl Fn(&ConstraintRow) -> bool,
) -> Vec<(String, usize)> {
    let mut found: Vec<(String, usize)> = Vec::new();
    let mut place: HashMap<&str, usize> = HashMap::new();
    for row in dropped.iter().filter(|i| acts(&topology.rows[**i])) {
        let name = topology.row_name(*row);
        let k = *place.entry(name).or_insert(found.len());
        match found.get_mut(k) {
            Some((_, n)) => *n += 1,
            None => found.push((name.to_owned(), 1)),
        }
    }
    found
}
