//! Poses in which the constraints of a loop depend on each other to first order but not to second.
//!
//! ```text
//! J z = 0,  u^T J = 0,  Q_u(z) = u^T (d2 Phi/dy2)(z, z)
//! ```
//! A motion z goes on only if Q_u(z) = 0 for every u. Where some Q_u is definite nothing goes on: the loop is *shaky*, locked but with an
//! infinitesimal motion (two bars in one line between fixed hinges). Where none is, motions branch (a parallelogram drawn flat).
//! R. Connelly and W. Whiteley, SIAM J. Discrete Math. 9 (1996) 453-491, prestress stability.
use nalgebra::{DMatrix, DVector};

use crate::constraint::closure::shown;
use crate::constraint::loop_lengths::bounds_at;
use crate::constraint::loops::{LoopBlock, LoopBlocks, column_scales};
use crate::constraint::rows::block_names;
use crate::constraint::spectrum::{of_rows, spectrum};
use crate::error::{Error, Result};
use crate::linalg::entries::Triplets;
use crate::linalg::matrix::Matrix;
use crate::linalg::rows::{Block, Level as Asked, RowBlocks, parts};
use crate::multibody::System;
use crate::multibody::assemble::Scene;
use crate::multibody::decision::Decision;
use crate::run::Counts;
use crate::tolerances::constraints::SINGULAR_POSE;

/// Dependent coordinates of rows at a pose, or the error of a pose that is singular; None where no row acts.
pub fn reduction(
    system: &System,
    scene: &Scene<'_, f64>,
    jacobian: &Matrix,
    decision: &Decision,
) -> Result<Option<LoopBlocks>> {
    let Some(loops) = LoopBlocks::analyse(system, jacobian, decision)? else {
        return Ok(None);
    };
    if let Some((_, block)) = loops.weakest.filter(|w| w.0 <= decision.tolerance) {
        return Err(singular_pose(scene, system, decision, block));
    }
    check_pose(system, scene, jacobian, decision, &loops)?;
    Ok(Some(loops))
}

/// Redundant rows that agree to first order but not to second. Blocks share no coordinate: one combination of each is looked at in
/// one assembly.
fn check_pose(
    system: &System,
    scene: &Scene<'_, f64>,
    jacobian: &Matrix,
    decision: &Decision,
    loops: &LoopBlocks,
) -> Result<()> {
    let most = loops.blocks.iter().map(|b| b.redundant.ncols()).max().unwrap_or(0);
    if most == 0 {
        return Ok(());
    }
    let rows = &decision.rows;
    let scale = column_scales(&system.topology, system.length);
    let is_redundant = |b: &Block| b.is_redundant();
    let own = parts(jacobian, &rows.blocks, Asked::All, rows.units(), is_redundant);
    let motions: Vec<Option<DMatrix<f64>>> =
        loops.blocks.iter().zip(&own).map(|(b, m)| m.as_ref().map(|m| minimal_motions(b, m, rows, &scale))).collect();
    for k in 0..most {
        let mut lam = vec![0.0; rows.row_scale.len()];
        for block in loops.blocks.iter().filter(|b| k < b.redundant.ncols()) {
            let column = block.redundant.column(k);
            block.rows.iter().zip(column.iter()).for_each(|(i, v)| lam[*i] = v * rows.row_scale[*i]);
        }
        let forms = curvatures(scene, &lam, &rows.blocks);
        for (b, motion) in motions.iter().enumerate().filter(|(b, _)| k < loops.blocks[*b].redundant.ncols()) {
            let Some(motion) = motion else { continue };
            let reduced = motion.tr_mul(&forms[b]) * motion;
            if (0.5 * (&reduced + reduced.transpose())).amax() > SINGULAR_POSE * system.tolerance {
                return Err(singular_pose(scene, system, decision, b));
            }
        }
    }
    Ok(())
}

/// Motions of a block's columns for a natural unit of each of its independent ones.
fn minimal_motions(block: &LoopBlock, m: &DMatrix<f64>, rows: &RowBlocks, scale: &[f64]) -> DMatrix<f64> {
    let free: Vec<usize> = (0..block.columns.len()).filter(|c| !block.dependent.contains(c)).collect();
    let unit = |c: usize| rows.column_scale[block.columns[c]];
    let followed = -(&block.inverse * m.select_columns(&free));
    let mut out = DMatrix::zeros(block.columns.len(), free.len());
    for (k, c) in free.iter().enumerate() {
        let natural = scale[block.columns[*c]];
        out[(*c, k)] = natural;
        for (r, d) in block.dependent.iter().enumerate() {
            out[(*d, k)] = followed[(r, k)] * unit(*d) * natural / unit(*c);
        }
    }
    out
}

/// d(J^T lam)/dy over the columns of each block.
fn curvatures(scene: &Scene<'_, f64>, lam: &[f64], blocks: &[Block]) -> Vec<DMatrix<f64>> {
    let n = scene.topology.n_tree;
    let mut entries = Triplets::new(n, n);
    scene.multiplier_stiffness_into(lam, &mut entries, &mut Counts::default());
    let mut block_of = vec![usize::MAX; n];
    for (b, block) in blocks.iter().enumerate() {
        block.columns.iter().for_each(|c| block_of[*c] = b);
    }
    let size = |b: &Block| DMatrix::zeros(b.columns.len(), b.columns.len());
    let mut out: Vec<DMatrix<f64>> = blocks.iter().map(size).collect();
    for (i, j, v) in &entries.list {
        let (i, j) = (*i as usize, *j as usize);
        let b = block_of[i];
        if let (Some(form), true) = (out.get_mut(b), b == block_of[j])
            && let (Ok(r), Ok(c)) = (blocks[b].columns.binary_search(&i), blocks[b].columns.binary_search(&j))
        {
            form[(r, c)] += v;
        }
    }
    out
}

/// A pose where the rank of a block is lower than beside it.
pub fn singular_pose(scene: &Scene<'_, f64>, system: &System, decision: &Decision, block: usize) -> Error {
    let names = shown(&block_names(system, &decision.rows.blocks[block]));
    if is_shaky(scene, system, decision, &decision.rows.blocks[block]).unwrap_or(false) {
        return Error::singular(format!(
            "the mechanism is shaky: around the loop through {names} the constraints allow an infinitesimal motion here that they lock at \
             second order, so that forces along it are not defined; draw it off this pose, or free the loop"
        ));
    }
    Error::singular(format!(
        "the mechanism is in a singular pose: around the loop through {names} the constraints lose rank here, where its mobility changes; \
         draw it slightly off this pose, or add what decides its branch"
    ))
}

/// Whether the second-order form of some combination of the rows, free of units, is definite on the motions that they leave free.
fn is_shaky(scene: &Scene<'_, f64>, system: &System, decision: &Decision, block: &Block) -> Result<bool> {
    if block.fixed.is_some() || block.n_position != block.rows.len() {
        return Ok(false);
    }
    let rows = &decision.rows;
    let blocks = std::slice::from_ref(block);
    let mut jacobian = Matrix::zeros(system.topology.rows.len(), system.n_tree(), true);
    scene.constraints_into(&mut jacobian);
    let bounds = bounds_at(system, &scene.placement.pose, scene.effects, rows);
    let Some(Some(m)) = parts(&jacobian, blocks, Asked::All, rows.units(), |_| true).pop() else {
        return Ok(false);
    };
    let found = spectrum(&m, &of_rows(&block.rows, &bounds), system.tolerance)?;
    let free = found.right.ncols().saturating_sub(found.rank);
    let motions = DMatrix::from_fn(block.columns.len(), free, |i, k| {
        found.right[(i, found.rank + k)] * rows.column_scale[block.columns[i]]
    });
    let form = |u: &DVector<f64>| {
        let mut lam = vec![0.0; rows.row_scale.len()];
        block.rows.iter().zip(u.iter()).for_each(|(i, v)| lam[*i] = v * rows.row_scale[*i]);
        let own = &curvatures(scene, &lam, blocks)[0];
        let q = motions.transpose() * own * &motions;
        0.5 * (&q + q.transpose())
    };
    let least = SINGULAR_POSE * system.tolerance;
    let definite = |q: &DMatrix<f64>| {
        let values = q.symmetric_eigenvalues();
        free > 0 && (values.iter().all(|v| *v > least) || values.iter().all(|v| *v < -least))
    };
    let forms: Vec<DMatrix<f64>> =
        (found.rank..found.left.ncols()).map(|k| form(&found.left.column(k).into_owned())).collect();
    let pairs = || (0..forms.len()).flat_map(|a| (0..a).map(move |b| (a, b)));
    let sums = pairs().flat_map(|(a, b)| [&forms[a] + &forms[b], &forms[a] - &forms[b]]);
    Ok(forms.iter().any(definite) || sums.into_iter().any(|q| definite(&q)))
}
