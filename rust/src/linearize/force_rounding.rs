//! What rounding may leave of generalised forces: strains and arms are differences of places, which are as large as their distance from
//! the origin.
//!
//! ```text
//! |dr| <= sum_e |w_e^T k_e d_e| + sum_b |T_b^T F_b|
//! ```
//! w_e: rows of strains of an element by the coordinates, d_e: rounding of its strains; T_b: twist of a body by the coordinates, F_b:
//! rounding of the forces on it and of their moments about its origin.
use nalgebra::DMatrix;

use crate::linearize::strain_rows::{Element, Motions, elements, origins, strain_rows};
use crate::linearize::{Linearization, Setting};
use crate::multibody::placement::place;
use crate::tolerances::matrices::ENTRY_ROUNDING;

/// What rounding may make of the strains of each element, and of the force on each body and its moment about the body's origin.
pub struct ForceRounding<'a> {
    motions: Motions<'a>,
    elements: Vec<Element>,
    on_body: Vec<[f64; 2]>,
}

impl<'a> ForceRounding<'a> {
    /// O(elements + bodies).
    pub fn at(setting: &Setting<'_>, made: &'a Linearization) -> Self {
        let system = setting.system;
        let rate = setting.rate::<f64>();
        let placement = place(&system.topology, &system.geometry, &setting.state.q, rate.as_deref());
        let mut scene = setting.scene(&placement, rate.as_deref());
        scene.acceleration = made.acceleration.as_deref();
        let motions = Motions { twist: &made.body_map, position: origins(system, &placement) };
        let mut on_body = vec![[0.0; 2]; system.n_bodies()];
        let unit = ENTRY_ROUNDING * f64::EPSILON;
        scene.each_force(|nodes, point, acting| {
            for node in nodes.into_iter().flatten() {
                let body = system.topology.nodes[node].body;
                let arm = point.norm() + motions.position[body].norm();
                on_body[body][0] += unit * acting.force;
                on_body[body][1] += unit * (acting.moment + arm * acting.force);
            }
        });
        let elements = elements(system, &placement, setting.effects);
        ForceRounding { motions, elements, on_body }
    }

    /// (columns, sources): the generalised forces along some coordinates that each of them may make. O(columns (strains + bodies)).
    pub fn sources(&self, columns: &[usize]) -> DMatrix<f64> {
        let strains = strain_rows(&self.motions, &self.elements, columns).rows;
        let twist = self.motions.twist;
        let mut out = DMatrix::zeros(columns.len(), strains.nrows() + twist.nrows());
        let mut first = 0;
        for element in &self.elements {
            let n = element.gradients.len();
            let force = DMatrix::from_fn(n, n, |i, j| element.k[i][j] * element.rounding[j]);
            out.columns_mut(first, n).copy_from(&strains.rows(first, n).tr_mul(&force));
            first += n;
        }
        for row in 0..twist.nrows() {
            let size = self.on_body[row / 6][row % 6 / 3];
            for (k, column) in columns.iter().enumerate() {
                out[(k, first + row)] = twist[(row, *column)] * size;
            }
        }
        out
    }

    /// The sum of all of them along a coordinate.
    pub fn total(&self, column: usize) -> f64 {
        self.sources(&[column]).iter().map(|v| v.abs()).sum()
    }
}

/// The generalised force along each coordinate that rounding may hide (dof,).
pub fn hidden_forces(setting: &Setting<'_>, made: &Linearization) -> Vec<f64> {
    let rounding = ForceRounding::at(setting, made);
    (0..made.body_map.ncols()).map(|column| rounding.total(column)).collect()
}
