//! Strains of elastic elements by the coordinates, e = w y, and the size of the terms that were added up in each entry of w.
use nalgebra::{DMatrix, DVectorView};

use crate::joint::Coordinate;
use crate::linearize::{Linearization, Setting};
use crate::multibody::System;
use crate::multibody::assemble::Effects;
use crate::multibody::connector::coordinate_tangent;
use crate::multibody::numbers::Numbers;
use crate::multibody::placement::{Placement, place};
use crate::multibody::topology::{Connector, Owner};
use crate::multibody::wanted::Wanted;
use crate::spatial::{Six, V3};
use crate::tolerances::constraints::{CLOSED_ENOUGH, POSE_ROUNDING};

/// One elastic element: its bodies (None: ground), its point in the world, the gradients of its strains by the relative twist there, and
/// the forces along them, its stiffness over them, the slopes of its laws included, and what rounding of places may make of each strain.
pub struct Element {
    pub owner: Owner,
    pub bodies: [Option<usize>; 2],
    pub point: V3<f64>,
    pub gradients: Vec<Six<f64>>,
    pub force: [f64; 6],
    pub k: [[f64; 6]; 6],
    pub rounding: Vec<f64>,
}

/// Twists T (6 n_bodies, dof) of the bodies' origins by the coordinates, world axes, and their positions.
pub struct Motions<'a> {
    pub twist: &'a DMatrix<f64>,
    pub position: Vec<V3<f64>>,
}

/// Rows w (strains, columns) and sizes (strains, columns).
pub struct StrainRows {
    pub rows: DMatrix<f64>,
    pub sizes: DMatrix<f64>,
}

/// The elastic elements and joints with stiffness of a system.
pub fn elements(system: &System, placement: &Placement<f64>, effects: Effects) -> Vec<Element> {
    let wanted =
        Wanted { laws: effects.law_slopes, friction: effects.friction, contact: effects.contact, ..Wanted::SLOPES };
    let numbers = Numbers { x: &system.x, memory: &[], t: 0.0 };
    let (topology, geometry) = (&*system.topology, &*system.geometry);
    let one = |c| {
        let made = coordinate_tangent(topology, geometry, placement, numbers, c, wanted);
        let (gradients, rounding) = (made.gradients, made.rounding);
        Element {
            owner: c.owner,
            bodies: [c.a, c.b],
            point: made.point,
            gradients,
            force: made.force,
            k: made.k,
            rounding,
        }
    };
    topology.connectors.iter().map(one).collect()
}

/// The largest stiffness of an elastic element or joint over a radian or the characteristic length, those of laws as they are at rest.
pub fn stiffest(setting: &Setting<'_>) -> f64 {
    let (system, topology) = (setting.system, &*setting.system.topology);
    let given = |c: &Connector| {
        let n = c.coordinates.len();
        let own = |(i, coordinate): (usize, &Coordinate)| {
            let k = c.k.map_or(0.0, |k| system.x[k + if c.full { i * (n + 1) } else { i }]);
            k.abs() * if coordinate.is_length() { system.length * system.length } else { 1.0 }
        };
        c.coordinates.iter().enumerate().map(own).fold(0.0, f64::max)
    };
    let linear = topology.connectors.iter().map(given).fold(0.0, f64::max);
    if !topology.connectors.iter().any(Connector::has_laws) {
        return linear;
    }
    let placement = place(topology, &system.geometry, &setting.state.q, None);
    let slope = |e: &Element| {
        let size = |g: &Six<f64>| g.l.norm() * system.length + g.a.norm();
        (0..e.gradients.len()).map(|i| e.k[i][i].abs() * size(&e.gradients[i]).powi(2)).fold(0.0, f64::max)
    };
    elements(system, &placement, setting.effects).iter().map(slope).fold(linear, f64::max)
}

/// Rows and sizes for some of the coordinates.
pub fn strain_rows(motions: &Motions<'_>, elements: &[Element], columns: &[usize]) -> StrainRows {
    let count = elements.iter().map(|e| e.gradients.len()).sum();
    let mut made =
        StrainRows { rows: DMatrix::zeros(count, columns.len()), sizes: DMatrix::zeros(count, columns.len()) };
    for (c, j) in columns.iter().enumerate() {
        let twist = motions.twist.column(*j);
        let mut row = 0;
        for element in elements {
            let end = |k: usize| motions.end(&twist, element.bodies[k], &element.point);
            let ((a, size_a), (b, size_b)) = (end(0), end(1));
            for g in &element.gradients {
                let (force, moment) = (g.l.norm(), g.a.norm());
                made.rows[(row, c)] = g.l.dot(&(b.l - a.l)) + g.a.dot(&(b.a - a.a));
                made.sizes[(row, c)] = force * (size_a.0 + size_b.0) + moment * (size_a.1 + size_b.1);
                row += 1;
            }
        }
    }
    made
}

impl Motions<'_> {
    /// Twist of a body's point in the motion of one coordinate, with the sizes of what was added up in its displacement and rotation.
    fn end(&self, twist: &DVectorView<'_, f64>, body: Option<usize>, point: &V3<f64>) -> (Six<f64>, (f64, f64)) {
        let Some(body) = body else { return (Six::zero(), (0.0, 0.0)) };
        let at = |k: usize| twist[6 * body + k];
        let (moved, turned) = (V3::new(at(0), at(1), at(2)), V3::new(at(3), at(4), at(5)));
        let position = &self.position[body];
        let reach = point.norm() + position.norm();
        let twist = Six::new(moved - (point - position).cross(&turned), turned);
        (twist, (moved.norm() + reach * turned.norm(), turned.norm()))
    }
}

/// Positions of the bodies' origins, in the order of the model.
pub fn origins(system: &System, placement: &Placement<f64>) -> Vec<V3<f64>> {
    let mut out = vec![V3::zeros(); system.n_bodies()];
    for (node, pose) in system.topology.nodes.iter().zip(&placement.pose) {
        out[node.body] = pose.p - pose.r * system.geometry.bodies[node.body].com;
    }
    out
}

/// Strains of all that is elastic, flexible bodies behind the elements: rows without entries of rounding, bounds of the entries that were
/// dropped, and the stiffnesses, each over its own rows.
pub struct Clear {
    pub rows: DMatrix<f64>,
    pub dropped: DMatrix<f64>,
    pub stiffness: Vec<DMatrix<f64>>,
}

/// At rest, for some of the coordinates. An entry of a row below the rounding of poses (of closed loops: of their closure) is dropped.
pub fn clear_strains(setting: &Setting<'_>, made: &Linearization, columns: &[usize]) -> Clear {
    let (system, topology) = (setting.system, &*setting.system.topology);
    let placement = place(topology, &system.geometry, &setting.state.q, None);
    let elements = elements(system, &placement, setting.effects);
    let motions = Motions { twist: &made.body_map, position: origins(system, &placement) };
    let elastic = strain_rows(&motions, &elements, columns);
    let of_poses = (POSE_ROUNDING + system.n_bodies() as f64) * f64::EPSILON;
    let rounding = if made.lam.is_empty() { of_poses } else { CLOSED_ENOUGH };
    let count = elastic.rows.nrows();
    let n_modal: usize = topology.tables.flexible.iter().map(|f| f.m).sum();
    let mut rows = elastic.rows.resize_vertically(count + n_modal, 0.0);
    let mut dropped = (elastic.sizes * rounding).resize_vertically(count + n_modal, 0.0);
    for (w, bound) in rows.iter_mut().zip(dropped.iter_mut()) {
        *(if w.abs() <= *bound { w } else { bound }) = 0.0;
    }
    if n_modal > 0 {
        let modal = made.modal_map(topology);
        for (c, j) in columns.iter().enumerate() {
            rows.view_mut((count, c), (n_modal, 1)).copy_from(&modal.column(*j));
        }
    }
    let own = elements.iter().map(|e| DMatrix::from_fn(e.gradients.len(), e.gradients.len(), |i, j| e.k[i][j]));
    let flexible = system.geometry.flexible.iter().map(|f| DMatrix::from_row_slice(f.m(), f.m(), &f.k));
    Clear { rows, dropped, stiffness: own.chain(flexible).collect() }
}
