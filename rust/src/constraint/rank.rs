//! Which constraints are redundant: decided once for a system, and kept by every analysis.
//!
//! ```text
//! block          rows that share columns: the loops of one biconnected part of the graph of bodies and joints
//! units          rotations as they are; displacements over the length l of their loop, sliding columns times l
//! rounding       |error of an entry| <= 4 eps (rotation), 4 eps (|P| + |p|)/l (displacement; world points P, p)
//!                f = |E|_F + eps max(m, n) s_1
//! rank           number of singular values s > t = max(tolerance of the drawing, f)
//! ```
//! s <= f is redundant beyond doubt, s > 1e3 t independent; what lies between is *doubtful* and named. Moving by one radian along
//! the freed direction opens the joint by s l. A pose may have a lower rank than its neighbours (a parallelogram drawn flat): the
//! rank is the largest over the drawn pose and two poses closed beside it.
use std::sync::Arc;

use nalgebra::{DMatrix, DVector};

use crate::constraint::closure::{check_redundant, close_drawn, close_with, drawn_start, rows_at, rows_into};
use crate::constraint::loop_lengths::{bounds, loop_lengths};
use crate::constraint::rows::block_names;
use crate::constraint::rows::row_scales;
use crate::constraint::spectrum::{Spectrum, of_rows, singular_values, spectrum};
use crate::error::Result;
use crate::linalg::elimination::{Candidate, eliminate};
use crate::linalg::matrix::Matrix;
use crate::linalg::rows::{Block, Level as Asked, RowBlocks, largest_rows, parts};
use crate::multibody::System;
use crate::multibody::assemble::Effects;
use crate::multibody::decision::{Decision, Doubt};
use crate::multibody::placement::advance;
use crate::multibody::topology::Level;
use crate::tolerances::constraints::{APART, DOUBTFUL, LOCKED, PROBE};

/// Blocks with more entries are decided by elimination, not by singular values.
const DENSE_BLOCK: usize = 40_000;

impl System {
    /// Ranks and redundancy with these effects.
    pub fn decision(&self, effects: Effects) -> Result<Arc<Decision>> {
        let slot = &self.decisions[usize::from(effects.drives) + 2 * usize::from(effects.nonholonomic)];
        if let Some(known) = slot.get() {
            return Ok(known.clone());
        }
        let made = Arc::new(decide(self, effects)?);
        Ok(slot.get_or_init(|| made).clone())
    }
}

fn decide(system: &System, effects: Effects) -> Result<Decision> {
    let mut rows = structure(system, effects);
    let mut q = drawn_start(system);
    let iterations = close_drawn(system, &mut q, effects, &rows)?;
    let mut doubts = Vec::new();
    let jacobian = rows_at(system, &q, effects).1;
    let bounds = bounds(system, &q, effects, &rows);
    let small = parts(&jacobian, &rows.blocks, Asked::All, rows.units(), |b| !is_large(b));
    for (k, part) in small.into_iter().enumerate() {
        let block = &rows.blocks[k];
        let found = match part {
            Some(m) => rank_of_block(&m, block, &bounds, system.tolerance)?,
            None => eliminated(&jacobian, &rows, block, &bounds, system.tolerance)?,
        };
        doubts.extend(doubts_of(system, &rows.blocks[k], &found));
        let block = &mut rows.blocks[k];
        (block.position_rank, block.rank, block.fixed) = (found.position_rank, found.rank, found.fixed);
    }
    close_with(system, &mut q, effects, &rows)?;
    let mut singular = Vec::new();
    if rows.is_redundant() {
        singular = raise_ranks(system, &q, effects, &mut rows, &bounds)?;
    }
    let rows = Arc::new(rows);
    let decision = Decision { rows, doubts, singular, closed: q, iterations, tolerance: system.tolerance };
    check_redundant(system, &decision.closed, effects, &decision)?;
    Ok(decision)
}

/// Blocks of rows that share columns, each with its own length. Rows of effects that are left out belong to none.
fn structure(system: &System, effects: Effects) -> RowBlocks {
    let topology = &*system.topology;
    let mut jacobian = Matrix::zeros(topology.rows.len(), topology.n_tree, true);
    rows_into(system, &drawn_start(system), effects, &mut jacobian);
    let mut root: Vec<usize> = (0..topology.rows.len()).collect();
    let mut owner = vec![usize::MAX; topology.n_tree];
    jacobian.each(|i, j, _| match owner[j] {
        usize::MAX => owner[j] = i,
        other => {
            let (a, b) = (find(&mut root, i), find(&mut root, other));
            root[a.max(b)] = a.min(b);
        }
    });
    let lengths = loop_lengths(system);
    let mut column_length = vec![0.0_f64; topology.n_tree];
    jacobian.each(|i, j, _| column_length[j] = column_length[j].max(lengths[i]));
    let length = |c: usize| if column_length[c] > 0.0 { column_length[c] } else { system.length };
    let column_scale = (0..topology.n_tree).map(|c| topology.scale(c, length(c))).collect();
    let row_scale = row_scales(system, |i| lengths[i]);
    let mut number = std::collections::BTreeMap::new();
    let mut blocks: Vec<Block> = Vec::new();
    for (i, row) in topology.rows.iter().enumerate().filter(|(_, r)| effects.row(r)) {
        let r = find(&mut root, i);
        let k = *number.entry(r).or_insert_with(|| {
            blocks.push(Block::default());
            blocks.len() - 1
        });
        if row.level == Level::Position {
            let at = blocks[k].n_position;
            blocks[k].rows.insert(at, i);
            blocks[k].n_position += 1;
        } else {
            blocks[k].rows.push(i);
        }
    }
    for (c, row) in owner.iter().enumerate().filter(|(_, r)| **r != usize::MAX) {
        let r = find(&mut root, *row);
        if let Some(k) = number.get(&r) {
            blocks[*k].columns.push(c);
        }
    }
    for b in &mut blocks {
        (b.position_rank, b.rank) = (b.n_position, b.rows.len());
    }
    RowBlocks { blocks, row_scale, column_scale }
}

fn find(root: &mut [usize], mut i: usize) -> usize {
    while root[i] != i {
        root[i] = root[root[i]];
        i = root[i];
    }
    i
}

/// The ranks of one block, what was decided only just, and the rows that carry a large one.
struct Ranks {
    position_rank: usize,
    rank: usize,
    /// singular values that are no rounding and not far above the tolerance
    doubtful: Vec<f64>,
    tolerance: f64,
    fixed: Option<Vec<usize>>,
}

fn is_large(block: &Block) -> bool {
    block.rows.len() * block.columns.len() > DENSE_BLOCK
}

/// From the rows of a block, free of units, those of positions first.
fn rank_of_block(m: &DMatrix<f64>, block: &Block, bounds: &[f64], tolerance: f64) -> Result<Ranks> {
    let all = spectrum(m, &of_rows(&block.rows, bounds), tolerance)?;
    let position_rank = position_rank(m, block, &all, bounds, tolerance)?;
    let limit = tolerance.max(all.floor);
    let most = DOUBTFUL * limit * if is_apart(&all.values, LOCKED * limit) { LOCKED / DOUBTFUL } else { 1.0 };
    let doubtful = all.values.iter().copied().filter(|s| *s > all.floor && *s <= most).collect();
    Ok(Ranks { position_rank, rank: all.rank, doubtful, tolerance: limit, fixed: None })
}

fn position_rank(m: &DMatrix<f64>, block: &Block, all: &Spectrum, bounds: &[f64], tolerance: f64) -> Result<usize> {
    if block.n_position == block.rows.len() {
        return Ok(all.rank);
    }
    let own = m.rows(0, block.n_position).into_owned();
    Ok(spectrum(&own, &of_rows(block.rows_at(Asked::Position).0, bounds), tolerance)?.rank)
}

/// Singular values below a limit are far below all others: constraints that an inaccurate drawing makes, not a slender mechanism.
fn is_apart(values: &[f64], limit: f64) -> bool {
    let weak = values.iter().copied().filter(|s| *s <= limit).fold(0.0, f64::max);
    values.iter().all(|s| *s <= limit || *s >= APART * weak)
}

/// A large block: what elimination leaves below the limit is decided by its singular values.
fn eliminated(j: &Matrix, rows: &RowBlocks, block: &Block, bounds: &[f64], tolerance: f64) -> Result<Ranks> {
    let mut place = vec![usize::MAX; rows.row_scale.len()];
    block.rows.iter().enumerate().for_each(|(k, i)| place[*i] = k);
    let mut entries: Vec<Vec<(u32, f64)>> = vec![Vec::new(); block.rows.len()];
    j.each(|i, c, v| {
        if let (Some(row), Ok(k)) = (entries.get_mut(place[i]), block.columns.binary_search(&c))
            && v != 0.0
        {
            row.push((k as u32, v * rows.row_scale[i] * rows.column_scale[c]));
        }
    });
    let candidate = |(k, mut row): (usize, Vec<(u32, f64)>)| {
        row.sort_by_key(|e| e.0);
        row.dedup_by(|b, a| {
            a.0 == b.0 && {
                a.1 += b.1;
                true
            }
        });
        Candidate { entries: row, rounding: bounds[block.rows[k]], group: usize::from(k >= block.n_position) }
    };
    let found =
        eliminate(entries.into_iter().enumerate().map(candidate).collect(), block.columns.len(), DOUBTFUL * tolerance);
    let (values, _, _) = singular_values(&found.remainder)?;
    let floor = found.rounding * (found.weak.len() as f64).sqrt();
    let limit = tolerance.max(floor);
    let more = values.iter().filter(|s| **s > limit).count();
    let position = |k: &&usize| **k < block.n_position;
    let weak_positions = found.weak.iter().filter(position).count();
    let weak = largest_rows(found.remainder.clone(), weak_positions, [more.min(weak_positions), more]);
    let carrying: Vec<usize> =
        found.independent.iter().copied().chain(weak.into_iter().map(|k| found.weak[k])).collect();
    let position_rank = carrying.iter().filter(position).count();
    let mut fixed: Vec<usize> = carrying.iter().map(|k| block.rows[*k]).collect();
    fixed.sort_unstable();
    let doubtful = values.into_iter().filter(|s| *s > floor && *s <= DOUBTFUL * limit).collect();
    Ok(Ranks { position_rank, rank: fixed.len(), doubtful, tolerance: limit, fixed: Some(fixed) })
}

/// What a drawing decides only just, with the names of the joints in the loops.
fn doubts_of(system: &System, block: &Block, found: &Ranks) -> Vec<Doubt> {
    let joints = if found.doubtful.is_empty() { Vec::new() } else { block_names(system, block) };
    let doubt = |s: &f64| Doubt { joints: joints.clone(), singular_value: *s, redundant: *s <= found.tolerance };
    found.doubtful.iter().map(doubt).collect()
}

/// Ranks at two poses beside a closed one, each a small way along a direction that the rows leave free; the blocks whose rank is
/// larger there.
fn raise_ranks(
    system: &System,
    q: &[f64],
    effects: Effects,
    rows: &mut RowBlocks,
    bounds: &[f64],
) -> Result<Vec<usize>> {
    let probed = |b: &Block| b.is_redundant() && b.fixed.is_none();
    let jacobian = rows_at(system, q, effects).1;
    let here = parts(&jacobian, &rows.blocks, Asked::All, rows.units(), probed);
    let mut raised = rows.clone();
    for seed in [1_u64, 2] {
        let mut dy = vec![0.0; system.n_tree()];
        for (block, m) in rows.blocks.iter().zip(&here) {
            let Some(m) = m else { continue };
            let found = spectrum(m, &of_rows(&block.rows, bounds), system.tolerance)?;
            let free = found.right.ncols().saturating_sub(found.rank);
            let mut direction = DVector::zeros(block.columns.len());
            for k in 0..free {
                direction += found.right.column(found.rank + k) * weight(seed, k);
            }
            if free > 0 {
                direction *= PROBE / direction.norm();
            }
            for (c, d) in block.columns.iter().zip(direction.iter()) {
                dy[*c] = d * rows.column_scale[*c];
            }
        }
        let mut beside = q.to_vec();
        advance(&system.topology, &mut beside, &dy);
        // a pose that cannot be closed beside this one tells nothing of its rank
        if close_with(system, &mut beside, effects, rows).is_err() {
            continue;
        }
        let there = rows_at(system, &beside, effects).1;
        let there = parts(&there, &rows.blocks, Asked::All, rows.units(), probed);
        for (b, m) in raised.blocks.iter_mut().zip(&there) {
            let Some(m) = m else { continue };
            // what is doubtful there was decided at the closed pose
            let tolerance = DOUBTFUL * system.tolerance;
            let all = spectrum(m, &of_rows(&b.rows, bounds), tolerance)?;
            b.position_rank = b.position_rank.max(position_rank(m, b, &all, bounds, tolerance)?);
            b.rank = b.rank.max(all.rank);
        }
    }
    let grown = |k: &usize| raised.blocks[*k].rank > rows.blocks[*k].rank;
    let singular = (0..rows.blocks.len()).filter(grown).collect();
    *rows = raised;
    Ok(singular)
}

/// Fixed weights in [-1, 1], none of them small.
fn weight(seed: u64, k: usize) -> f64 {
    let angle = (seed as f64) * 1.7 + (k as f64) * 2.399_963;
    let w = angle.sin();
    if w < 0.0 { w - 0.2 } else { w + 0.2 }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Which singular values of rows with these are doubtful at a tolerance of 1e-7.
    fn doubtful(values: &[f64]) -> Result<Vec<f64>> {
        let n = values.len();
        let all: Vec<usize> = (0..n).collect();
        let block = Block { rows: all.clone(), n_position: n, columns: all, position_rank: n, rank: n, fixed: None };
        let m = DMatrix::from_diagonal(&DVector::from_row_slice(values));
        Ok(rank_of_block(&m, &block, &vec![0.0; n], 1e-7)?.doubtful)
    }

    #[test]
    fn constraints_near_the_tolerance_are_doubtful() -> Result<()> {
        // beside others that are nearly as weak
        assert_eq!(doubtful(&[2e-3, 5e-5])?, [5e-5]);
        assert!(doubtful(&[1e-2, 5e-4])?.is_empty());
        Ok(())
    }

    #[test]
    fn constraints_far_below_all_others_are_doubtful_for_longer() -> Result<()> {
        assert_eq!(doubtful(&[1.0, 5e-4])?, [5e-4]);
        assert!(doubtful(&[1.0, 5e-3])?.is_empty());
        Ok(())
    }

    #[test]
    fn weak_constraints_are_apart_from_their_bound_on() {
        assert!(is_apart(&[0.1, 1e-4], 1e-3) && !is_apart(&[2e-3, 1e-4], 1e-3));
    }
}
