//! Modes of a linearised model, with the factors of its own mass and stiffness where assembled matrices have lost digits.
use faer::{Mat, MatRef};
use nalgebra::DMatrix;

use crate::error::Result;
use crate::linearize::parts::Parts;
use crate::linearize::stiffness_factor::{is_strained, stiffness_factor};
use crate::linearize::strain_rows::clear_strains;
use crate::linearize::{Linearization, Setting};
use crate::multibody::placement::place;
use crate::second_order::SecondOrder;
use crate::second_order::linear_system::{LinearSystem, Matrices};
use crate::second_order::modal::{Kind, Modal, is_light, modes};
use crate::spatial::V3;

fn square(x: &DMatrix<f64>) -> Mat<f64> {
    MatRef::from_column_major_slice(x.as_slice(), x.nrows(), x.ncols()).to_owned()
}

/// The system of a linearised state.
pub fn linear_system(made: &Linearization, parts: &Parts) -> Result<LinearSystem> {
    let given = |x: &Option<DMatrix<f64>>| x.as_ref().map(square);
    LinearSystem::new(Matrices {
        m: square(&made.matrices.mass),
        c: given(&parts.damping),
        g: given(&parts.gyroscopic),
        k: square(&parts.stiffness),
        n: given(&parts.circulatory),
    })
}

/// All modes. `elastic`: whether the stiffness holds elastic elements alone; None where the caller has to decide that, if it matters.
/// None is returned where the caller has to solve: that, and light bodies beside flexible ones.
pub fn model_modes(
    setting: &Setting<'_>,
    made: &Linearization,
    parts: &Parts,
    plain: &SecondOrder,
    elastic: Option<bool>,
) -> Result<Option<Modal>> {
    let is_light = is_light(&plain.m);
    if is_light && setting.system.topology.is_flexible() {
        return Ok(None);
    }
    let heavy = is_light.then(|| mass_factor(setting, made));
    let found = match &heavy {
        None => modes(plain)?,
        Some(factor) => modes(&plain.clone().with_mass_factor(factor.clone())?)?,
    };
    let rigid: Vec<usize> = (0..found.kind.len()).filter(|i| found.kind[*i] == Kind::Rigid).collect();
    let graded = matches!(found.route, "undamped" | "proportional") && (found.blurred() || !rigid.is_empty());
    if !graded || elastic == Some(false) || setting.state.moving() || parts.circulatory.is_some() {
        return Ok(Some(found));
    }
    if elastic.is_none() {
        return Ok(None);
    }
    let columns: Vec<usize> = (0..made.matrices.mass.nrows()).collect();
    let Some(factor) = stiffness_factor(&clear_strains(setting, made, &columns)) else { return Ok(Some(found)) };
    let shape = DMatrix::from_fn(columns.len(), rigid.len(), |i, k| found.shape[(i, rigid[k])].re);
    if !found.blurred() && !is_strained(&factor, &shape, &made.matrices.mass) {
        return Ok(Some(found));
    }
    let system = SecondOrder { kf: Some(square(&factor)), ..plain.clone() };
    Ok(Some(modes(&match heavy {
        None => system,
        Some(factor) => system.with_mass_factor(factor)?,
    })?))
}

/// (6 n_bodies, dof) F with M = F^T F of rigid bodies: it keeps light bodies whose mass M adds to a heavy one's.
fn mass_factor(setting: &Setting<'_>, made: &Linearization) -> Mat<f64> {
    let (system, map) = (setting.system, &made.body_map);
    let placement = place(&system.topology, &system.geometry, &setting.state.q, None);
    let mut out = Mat::zeros(map.nrows(), map.ncols());
    for (node, pose) in system.topology.nodes.iter().zip(&placement.pose) {
        let body = &system.geometry.bodies[node.body];
        let principal = body.inertia.symmetric_eigen();
        let (arm, axes) = (pose.r * body.com, pose.r * principal.eigenvectors);
        for j in 0..map.ncols() {
            let at = |k: usize| map[(6 * node.body + k, j)];
            let (moved, turned) = (V3::new(at(0), at(1), at(2)), V3::new(at(3), at(4), at(5)));
            let moved = (moved - arm.cross(&turned)) * body.mass.sqrt();
            let turned = axes.transpose() * turned;
            for k in 0..3 {
                out[(6 * node.body + k, j)] = moved[k];
                out[(6 * node.body + 3 + k, j)] = turned[k] * principal.eigenvalues[k].max(0.0).sqrt();
            }
        }
    }
    out
}
