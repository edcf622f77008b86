//! What rounding may leave of generalised forces: strains and arms are differences of places, which are as large as their distance from
//! the origin.
//!
//! ```text
//! |dr| <= sum_e |w_e^T k_e d_e| + sum_b |T_b^T F_b|
//! ```
//! w_e: rows of strains of an element by the coordinates, d_e: rounding of its strains; T_b: twist of a body by the coordinates, F_b:
//! rounding of the forces on it and of their moments about its origin. What turns adds the centrifugal forces of its rounded places,
//! m W^2 eps |r|, also where it is balanced and no force is left.
use nalgebra::DMatrix;

use crate::linearize::strain_rows::{Element, Motions, elements, origins, strain_rows};
use crate::linearize::{Linearization, Setting};
use crate::multibody::assemble::Scene;
use crate::multibody::placement::{Placement, place};
use crate::spatial::{Six, V3};
use crate::tolerances::matrices::ENTRY_ROUNDING;

/// What rounding may make of the strains of each element, and of the force on each body and its moment about the body's origin.
pub struct ForceRounding<'a> {
    motions: Motions<'a>,
    elements: Vec<Element>,
    on_body: Vec<[f64; 2]>,
    /// the part of `on_body` that is centrifugal
    centrifugal: Vec<[f64; 2]>,
}

/// The forces at work where a linearisation was made.
fn with_scene<R>(
    setting: &Setting<'_>,
    made: &Linearization,
    use_it: impl FnOnce(&Placement<f64>, &Scene<'_, f64>) -> R,
) -> R {
    let rate = setting.rate::<f64>();
    let system = setting.system;
    let placement = place(&system.topology, &system.geometry, &setting.state.q, rate.as_deref());
    let mut scene = setting.scene(&placement, rate.as_deref());
    scene.acceleration = made.acceleration.as_deref();
    use_it(&placement, &scene)
}

impl<'a> ForceRounding<'a> {
    /// O(elements + bodies).
    pub fn at(setting: &Setting<'_>, made: &'a Linearization) -> Self {
        with_scene(setting, made, |placement, scene| {
            let system = setting.system;
            let motions = Motions { twist: &made.body_map, position: origins(system, placement) };
            let centrifugal = centrifugal(setting, placement, &motions.position);
            let mut on_body = centrifugal.clone();
            let unit = ENTRY_ROUNDING * f64::EPSILON;
            scene.each_force(|nodes, point, acting| {
                for node in nodes.into_iter().flatten() {
                    let body = system.topology.nodes[node].body;
                    let arm = point.norm() + motions.position[body].norm();
                    on_body[body][0] += unit * acting.force;
                    on_body[body][1] += unit * (acting.moment + arm * acting.force);
                }
            });
            let elements = elements(system, placement, setting.effects);
            ForceRounding { motions, elements, on_body, centrifugal }
        })
    }

    /// The sum of all bounds in each island.
    fn of_islands(&self, setting: &Setting<'_>) -> Vec<f64> {
        let (topology, length) = (&setting.system.topology, setting.system.length);
        let mut out = vec![0.0; topology.n_islands()];
        for (node, spec) in topology.nodes.iter().enumerate() {
            let [force, moment] = self.on_body[spec.body];
            out[topology.island[node]] += force * length + moment;
        }
        for element in &self.elements {
            let Some(body) = element.bodies[0].or(element.bodies[1]) else { continue };
            let force = |i: usize| element.k[i].iter().zip(&element.rounding).map(|(k, d)| (k * d).abs()).sum::<f64>();
            let wrench = |(i, g): (usize, &Six<f64>)| force(i) * (g.l.norm() * length + g.a.norm());
            out[topology.island[topology.node_of_body[body]]] +=
                element.gradients.iter().enumerate().map(wrench).sum::<f64>();
        }
        out
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

/// Centrifugal forces of rounded places and axes: each body has those of the bodies that carry it too. Moments about its origin.
fn centrifugal(setting: &Setting<'_>, placement: &Placement<f64>, origin: &[V3<f64>]) -> Vec<[f64; 2]> {
    let (topology, geometry) = (&setting.system.topology, &setting.system.geometry);
    let mut out = vec![[0.0; 2]; origin.len()];
    let Some(velocity) = placement.velocity.as_ref().filter(|_| setting.effects.centrifugal) else { return out };
    let unit = ENTRY_ROUNDING * f64::EPSILON;
    let mut acceleration: Vec<f64> = Vec::with_capacity(topology.nodes.len());
    for (i, node) in topology.nodes.iter().enumerate() {
        let carrier = node.parent.map_or(0.0, |p| placement.pose[p].p.norm());
        let own = velocity.body[i].a.norm_squared() * (placement.pose[i].p.norm() + carrier);
        acceleration.push(unit * own + node.parent.map_or(0.0, |p| acceleration[p]));
        let body = &geometry.bodies[node.body];
        let force = body.mass * acceleration[i];
        let arm = (placement.pose[i].p - origin[node.body]).norm();
        out[node.body][0] = force;
        out[node.body][1] = arm * force + unit * body.inertia.norm() * velocity.body[i].a.norm_squared();
    }
    out
}

/// What rounding may hide along each coordinate (dof,).
pub struct Hidden {
    /// generalised force
    pub force: Vec<f64>,
    /// the part of it that is centrifugal
    pub centrifugal: Vec<f64>,
    /// whether all forces in its island may be that
    pub is_idle: Vec<bool>,
}

pub fn hidden_forces(setting: &Setting<'_>, made: &Linearization) -> Hidden {
    let rounding = ForceRounding::at(setting, made);
    let (map, topology) = (&made.body_map, &setting.system.topology);
    let spun = |row: usize| rounding.centrifugal[row / 6][row % 6 / 3];
    let centrifugal = |c: usize| map.column(c).iter().enumerate().map(|(row, t)| t.abs() * spun(row)).sum::<f64>();
    let free: Vec<usize> = match &made.loops {
        Some(loops) => loops.independent.clone(),
        None => (0..topology.n_tree).collect(),
    };
    // of each island: whether the sizes of all forces, moments over the length of the model, are within the bounds
    let (sizes, _) = with_scene(setting, made, |_, scene| scene.force_sizes(setting.system.length));
    let is_idle: Vec<bool> =
        sizes.iter().zip(rounding.of_islands(setting)).map(|(size, bound)| *size <= bound).collect();
    Hidden {
        force: (0..map.ncols()).map(|c| rounding.total(c)).collect(),
        centrifugal: (0..map.ncols()).map(centrifugal).collect(),
        is_idle: free.iter().map(|i| is_idle[topology.island_of(*i)]).collect(),
    }
}
