//! Constraint rows in blocks that share no column: what each block's rank is, and which rows carry it at a pose.
//!
//! A rank is decided once (`system::rank`) and kept; at each pose the rows with the largest remainders of a Gram-Schmidt process
//! carry the block, as many as its rank. Rows that are redundant agree with them, so that the choice changes no motion.
use nalgebra::{DMatrix, DVector};

use crate::linalg::matrix::Matrix;
use crate::tolerances::matrices::TIE;

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

/// Rows and columns free of units: the factors of each.
#[derive(Debug, Clone, Copy)]
pub struct Units<'a> {
    pub row: &'a [f64],
    pub column: &'a [f64],
}

/// The dense parts of a matrix that belong to blocks, rows at a level, in one pass over its entries; None for blocks that are not
/// `wanted`. O(entries + sizes of the parts).
pub fn parts(
    j: &Matrix,
    blocks: &[Block],
    level: Level,
    units: Units<'_>,
    wanted: impl Fn(&Block) -> bool,
) -> Vec<Option<DMatrix<f64>>> {
    const NOWHERE: (usize, usize) = (usize::MAX, 0);
    let mut place = vec![NOWHERE; units.row.len()];
    let mut found: Vec<Option<DMatrix<f64>>> = Vec::with_capacity(blocks.len());
    for (k, block) in blocks.iter().enumerate() {
        let rows = block.rows_at(level).0;
        found.push(wanted(block).then(|| DMatrix::zeros(rows.len(), block.columns.len())));
        if found[k].is_some() {
            rows.iter().enumerate().for_each(|(r, i)| place[*i] = (k, r));
        }
    }
    if let Matrix::Dense(m) = j {
        for (part, block) in found.iter_mut().zip(blocks) {
            let Some(part) = part else { continue };
            for (r, i) in block.rows_at(level).0.iter().enumerate() {
                for (k, c) in block.columns.iter().enumerate() {
                    part[(r, k)] = m[(*i, *c)] * units.row[*i] * units.column[*c];
                }
            }
        }
        return found;
    }
    j.each(|i, c, v| {
        let (k, r) = place[i];
        if let Some(Some(part)) = found.get_mut(k)
            && let Ok(at) = blocks[k].columns.binary_search(&c)
        {
            part[(r, at)] += v * units.row[i] * units.column[c];
        }
    });
    found
}

impl RowBlocks {
    pub fn units(&self) -> Units<'_> {
        Units { row: &self.row_scale, column: &self.column_scale }
    }

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
        let chosen = |b: &Block| b.is_chosen(level);
        if !self.blocks.iter().any(chosen) {
            return self.carrying(vec![None; self.blocks.len()], level);
        }
        self.carrying(parts(j, &self.blocks, level, self.units(), chosen), level)
    }

    /// The same of a dense matrix.
    pub fn select_dense(&self, m: &DMatrix<f64>, level: Level) -> Vec<usize> {
        let part = |b: &Block| {
            let rows = b.rows_at(level).0;
            let entry = |i: usize, c: usize| m[(i, c)] * self.row_scale[i] * self.column_scale[c];
            DMatrix::from_fn(rows.len(), b.columns.len(), |r, k| entry(rows[r], b.columns[k]))
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
}

/// As many rows as the ranks say, those with the largest remainders first, position rows before others.
pub fn largest_rows(m: DMatrix<f64>, n_position: usize, ranks: [usize; 2]) -> Vec<usize> {
    let mut left: Vec<Option<DVector<f64>>> = m.row_iter().map(|r| Some(r.transpose())).collect();
    let mut square: Vec<f64> = left.iter().flatten().map(DVector::norm_squared).collect();
    let mut kept = Vec::with_capacity(ranks[1]);
    while kept.len() < ranks[1] {
        let open = if kept.len() < ranks[0] { 0..n_position.min(left.len()) } else { 0..left.len() };
        let size = |i: usize| if left[i].is_some() { square[i] } else { -1.0 };
        let most = open.clone().map(size).fold(-1.0, f64::max);
        let Some(best) = open.into_iter().find(|i| size(*i) >= (1.0 - TIE) * most && left[*i].is_some()) else {
            break;
        };
        let Some(row) = left[best].take() else { break };
        kept.push(best);
        let own = square[best];
        if own > 0.0 {
            for (other, square) in left.iter_mut().zip(&mut square) {
                let Some(other) = other else { continue };
                let part = row.dot(other) / own;
                // most rows of a long mechanism share no column with this one
                if part != 0.0 {
                    other.axpy(-part, &row, 1.0);
                    *square = other.norm_squared();
                }
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
