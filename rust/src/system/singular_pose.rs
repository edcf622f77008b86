//! Poses in which the constraints of a loop depend on each other to first order but not to second.
//!
//! ```text
//! J z = 0,  u^T J = 0,  Q_u(z) = u^T (d2 Phi/dy2)(z, z)
//! ```
//! A motion z goes on only if Q_u(z) = 0 for every u. Where some Q_u is definite nothing goes on: the loop is *shaky*, locked but with an
//! infinitesimal motion (two bars in one line between fixed hinges). Where none is, motions branch (a parallelogram drawn flat).
//! R. Connelly and W. Whiteley, SIAM J. Discrete Math. 9 (1996) 453-491, prestress stability.
use nalgebra::{DMatrix, DVector};

use crate::error::{Error, Result};
use crate::linalg::rows::{Block, Level as Asked};
use crate::run::Counts;
use crate::system::System;
use crate::system::assemble::Scene;
use crate::system::closure::shown;
use crate::system::loops::{Loops, column_scales};
use crate::system::rank::{Decision, block_names, bounds_at, spectrum};
use crate::tolerances::constraints::SINGULAR_POSE;

/// Redundant rows that agree to first order but not to second.
pub fn check_pose(
    system: &System,
    scene: &Scene<'_, f64>,
    decision: &Decision,
    (loops, b): (&Loops, &DMatrix<f64>),
) -> Result<()> {
    let scale = column_scales(&system.topology, system.length);
    for k in 0..loops.redundant.ncols() {
        let lam: Vec<f64> = loops.redundant.column(k).iter().zip(&loops.row_scale).map(|(v, s)| v * s).collect();
        let curvature = scene.multiplier_stiffness(&lam, &mut Counts::default());
        let reduced = loops.reduce(&curvature, b);
        let sym = DMatrix::from_fn(reduced.nrows(), reduced.ncols(), |i, j| {
            0.5 * (reduced[(i, j)] + reduced[(j, i)]) * scale[loops.independent[i]] * scale[loops.independent[j]]
        });
        if sym.amax() > SINGULAR_POSE * system.tolerance {
            let worst = lam.iter().enumerate().max_by(|a, b| a.1.abs().total_cmp(&b.1.abs())).map_or(0, |(i, _)| i);
            let block = decision.rows.blocks.iter().position(|b| b.rows.contains(&worst)).unwrap_or(0);
            return Err(singular_pose(scene, system, decision, block));
        }
    }
    Ok(())
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
    let jacobian = crate::linalg::matrix::Matrix::Dense(scene.constraints().1);
    let bounds = bounds_at(system, &scene.placement.pose, scene.effects, rows);
    let found = spectrum(&jacobian, rows, block, Asked::All, &bounds, system.tolerance)?;
    let free = found.right.ncols().saturating_sub(found.rank);
    let motions = DMatrix::from_fn(block.columns.len(), free, |i, k| {
        found.right[(i, found.rank + k)] * rows.column_scale[block.columns[i]]
    });
    let form = |u: &DVector<f64>| {
        let mut lam = vec![0.0; rows.row_scale.len()];
        block.rows.iter().zip(u.iter()).for_each(|(i, v)| lam[*i] = v * rows.row_scale[*i]);
        let all = scene.multiplier_stiffness(&lam, &mut Counts::default());
        let own = DMatrix::from_fn(block.columns.len(), block.columns.len(), |i, j| {
            all[(block.columns[i], block.columns[j])]
        });
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
