//! What rounding may leave of generalised forces: strains and arms are differences of places, which are as large as their distance from
//! the origin.
//!
//! ```text
//! |dr| <= sum_e |w_e^T k_e d_e| + sum_b |T_b^T F_b|
//! ```
//! w_e: rows of strains of an element by the coordinates, d_e: rounding of its strains; T_b: twist of a body by the coordinates, F_b:
//! rounding of the forces on it and of their moments about its origin.
use nalgebra::DMatrix;

use crate::linearize::strain_rows::{Motions, elements, origins, strain_rows};
use crate::linearize::{Linearization, Setting};
use crate::multibody::placement::place;
use crate::tolerances::matrices::ENTRY_ROUNDING;

/// (dof, sources): the generalised forces that rounding of each strain and of each force on a body may make. O(dof (strains + bodies)).
pub fn force_rounding(setting: &Setting<'_>, made: &Linearization) -> DMatrix<f64> {
    let system = setting.system;
    let rate = setting.rate::<f64>();
    let placement = place(&system.topology, &system.geometry, &setting.state.q, rate.as_deref());
    let mut scene = setting.scene(&placement, rate.as_deref());
    scene.acceleration = made.acceleration.as_deref();
    let motions = Motions { twist: &made.body_map, position: origins(system, &placement) };
    let mut on_body = vec![[0.0; 2]; system.n_bodies()];
    scene.each_force(|nodes, point, acting| {
        for node in nodes.into_iter().flatten() {
            let body = system.topology.nodes[node].body;
            let arm = point.norm() + motions.position[body].norm();
            on_body[body][0] += acting.force;
            on_body[body][1] += acting.moment + arm * acting.force;
        }
    });
    let elements = elements(system, &placement, setting.effects);
    let columns: Vec<usize> = (0..made.body_map.ncols()).collect();
    let strains = strain_rows(&motions, &elements, &columns).rows;
    let mut out = DMatrix::zeros(columns.len(), strains.nrows() + made.body_map.nrows());
    let mut first = 0;
    for element in &elements {
        let n = element.gradients.len();
        let force = DMatrix::from_fn(n, n, |i, j| element.k[i][j] * element.rounding[j]);
        out.columns_mut(first, n).copy_from(&strains.rows(first, n).tr_mul(&force));
        first += n;
    }
    for (row, twist) in made.body_map.row_iter().enumerate() {
        let size = ENTRY_ROUNDING * f64::EPSILON * on_body[row / 6][row % 6 / 3];
        out.column_mut(first + row).copy_from(&(twist.transpose() * size));
    }
    out
}

/// The sum of all of them by coordinate (dof,).
pub fn hidden(setting: &Setting<'_>, made: &Linearization) -> Vec<f64> {
    force_rounding(setting, made).row_iter().map(|row| row.iter().map(|v| v.abs()).sum()).collect()
}
