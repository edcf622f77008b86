//! Constraint rows in blocks that share no column: what each block's rank is, and which rows carry it at a pose.
//!
//! A rank is decided once (`system::rank`) and kept; at each pose the rows with the largest remainders of a Gram-Schmidt process
//! carry the block, as many as its rank. Rows that are redundant agree with them, so that the choice changes no motion.
use nalgebra::{DMatrix, RowDVector};

use crate::linalg::matrix::Matrix;
use crate::tolerances::constraints::TIE;

/// Which rows are asked for: those that say where things are, or all.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Level {
    Position,
    All,
}

/// Rows that are coupled by common columns.
#[derive(Debug, Clone, Default)]
pub struct Block {
    /// position rows, then rows of velocities alone
    pub rows: Vec<usize>,
    pub n_position: usize,
    pub columns: Vec<usize>,
    /// how many of the position rows, and of all, are independent
    pub position_rank: usize,
    pub rank: usize,
    /// the rows that carry a block too large to choose at each pose
    pub fixed: Option<Vec<usize>>,
}

impl Block {
    pub fn is_redundant(&self) -> bool {
        self.rank < self.rows.len() || self.position_rank < self.n_position
    }

    /// Do its rows have to be chosen at each pose?
    fn is_chosen(&self, level: Level) -> bool {
        let (rows, rank) = self.rows_at(level);
        self.fixed.is_none() && rank < rows.len()
    }

    /// The rows of this block among all, and their number at a level.
    pub fn rows_at(&self, level: Level) -> (&[usize], usize) {
        match level {
            Level::Position => (&self.rows[..self.n_position], self.position_rank),
            Level::All => (&self.rows, self.rank),
        }
    }
}

/// All rows that act, with the factors that free rows and columns of units.
#[derive(Debug, Clone, Default)]
pub struct RowBlocks {
    pub blocks: Vec<Block>,
    pub row_scale: Vec<f64>,
    pub column_scale: Vec<f64>,
}

/// The dense part of a matrix that belongs to a block, rows and columns free of units.
pub fn gather(j: &Matrix, rows: &[usize], columns: &[usize], blocks: &RowBlocks) -> DMatrix<f64> {
    let scale = |i: usize, c: usize| blocks.row_scale[i] * blocks.column_scale[c];
    match j {
        Matrix::Dense(m) => {
            DMatrix::from_fn(rows.len(), columns.len(), |i, c| m[(rows[i], columns[c])] * scale(rows[i], columns[c]))
        }
        Matrix::Sparse(_) => {
            let mut out = DMatrix::zeros(rows.len(), columns.len());
            j.each(|i, c, v| {
                if let (Some(r), Ok(k)) = (rows.iter().position(|x| *x == i), columns.binary_search(&c)) {
                    out[(r, k)] += v * scale(i, c);
                }
            });
            out
        }
    }
}

impl RowBlocks {
    /// Is any row superfluous?
    pub fn is_redundant(&self) -> bool {
        self.blocks.iter().any(Block::is_redundant)
    }

    /// Every row of a matrix by itself: nothing is known of their rank.
    pub fn independent(rows: usize, columns: usize) -> Self {
        let block = Block {
            rows: (0..rows).collect(),
            n_position: rows,
            columns: (0..columns).collect(),
            position_rank: rows,
            rank: rows,
            fixed: None,
        };
        let blocks = if rows > 0 { vec![block] } else { Vec::new() };
        RowBlocks { blocks, row_scale: vec![1.0; rows], column_scale: vec![1.0; columns] }
    }

    /// The rows that carry all blocks at this pose, ascending.
    pub fn select(&self, j: &Matrix, level: Level) -> Vec<usize> {
        match j {
            Matrix::Dense(m) => self.select_dense(m, level),
            Matrix::Sparse(_) => self.carrying(self.sparse_parts(j, level), level),
        }
    }

    pub fn select_dense(&self, m: &DMatrix<f64>, level: Level) -> Vec<usize> {
        let part = |b: &Block| {
            let rows = b.rows_at(level).0;
            let scale = |i: usize, c: usize| self.row_scale[i] * self.column_scale[c];
            let entry = |i: usize, c: usize| m[(i, c)] * scale(i, c);
            DMatrix::from_fn(rows.len(), b.columns.len(), |i, c| entry(rows[i], b.columns[c]))
        };
        let parts = self.blocks.iter().map(|b| b.is_chosen(level).then(|| part(b))).collect();
        self.carrying(parts, level)
    }

    fn carrying(&self, parts: Vec<Option<DMatrix<f64>>>, level: Level) -> Vec<usize> {
        let mut kept = Vec::new();
        for (block, part) in self.blocks.iter().zip(parts) {
            let (rows, rank) = block.rows_at(level);
            match (part, &block.fixed) {
                _ if rank == rows.len() => kept.extend_from_slice(rows),
                (_, Some(fixed)) => {
                    kept.extend(fixed.iter().filter(|i| level == Level::All || rows.contains(i)));
                }
                (Some(m), None) => {
                    let ranks = [block.position_rank, rank];
                    kept.extend(largest_rows(m, block.n_position, ranks).into_iter().map(|i| rows[i]));
                }
                (None, None) => {}
            }
        }
        kept.sort_unstable();
        kept
    }

    /// The matrices of the blocks whose rows have to be chosen, in one pass over a sparse matrix.
    fn sparse_parts(&self, j: &Matrix, level: Level) -> Vec<Option<DMatrix<f64>>> {
        if !self.blocks.iter().any(|b| b.is_chosen(level)) {
            return vec![None; self.blocks.len()];
        }
        let mut place = vec![(usize::MAX, 0); self.row_scale.len()];
        let mut parts: Vec<Option<DMatrix<f64>>> = Vec::with_capacity(self.blocks.len());
        for (k, b) in self.blocks.iter().enumerate() {
            let rows = b.rows_at(level).0;
            parts.push(b.is_chosen(level).then(|| DMatrix::zeros(rows.len(), b.columns.len())));
            if b.is_chosen(level) {
                rows.iter().enumerate().for_each(|(r, i)| place[*i] = (k, r));
            }
        }
        j.each(|i, c, v| {
            let (k, r) = place[i];
            if let Some(Some(part)) = parts.get_mut(k)
                && let Ok(at) = self.blocks[k].columns.binary_search(&c)
            {
                part[(r, at)] += v * self.row_scale[i] * self.column_scale[c];
            }
        });
        parts
    }
}

/// As many rows as the ranks say, those with the largest remainders first, position rows before others.
pub fn largest_rows(m: DMatrix<f64>, n_position: usize, ranks: [usize; 2]) -> Vec<usize> {
    let mut left: Vec<Option<RowDVector<f64>>> = m.row_iter().map(|r| Some(r.into_owned())).collect();
    let mut kept = Vec::with_capacity(ranks[1]);
    while kept.len() < ranks[1] {
        let open = if kept.len() < ranks[0] { 0..n_position.min(left.len()) } else { 0..left.len() };
        let size = |i: usize| left[i].as_ref().map_or(-1.0, |r| r.norm_squared());
        let most = open.clone().map(size).fold(-1.0, f64::max);
        let Some(best) = open.into_iter().find(|i| size(*i) >= (1.0 - TIE) * most && left[*i].is_some()) else {
            break;
        };
        let Some(row) = left[best].take() else { break };
        kept.push(best);
        let square = row.norm_squared();
        if square > 0.0 {
            for other in left.iter_mut().flatten() {
                let part = row.dot(other) / square;
                *other -= &row * part;
            }
        }
    }
    kept
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_that_repeat_others_are_not_chosen_and_positions_come_first() {
        let m = DMatrix::from_row_slice(4, 3, &[1.0, 0.0, 2.0, 2.0, 0.0, 4.0, 0.3, 1.0, 0.0, 9.0, 0.0, 0.0]);
        let mut blocks = RowBlocks::independent(4, 3);
        blocks.blocks[0] = Block { n_position: 3, position_rank: 2, rank: 3, ..blocks.blocks[0].clone() };
        let dense = Matrix::Dense(m.clone());
        assert_eq!(blocks.select(&dense, Level::All), [1, 2, 3]);
        assert_eq!(blocks.select(&dense, Level::Position), [1, 2]);
        let mut list = Matrix::zeros(4, 3, true);
        dense.each(|i, j, v| crate::linalg::entries::Entries::add(&mut list, i, j, v));
        assert_eq!(blocks.select(&list, Level::All), [1, 2, 3]);
    }
}
