//! Transfer functions of a design, and their derivatives.
use faer::{Mat, c64};
use nalgebra::DMatrix;
use num_dual::Dual64;

use super::{Changes, Numbers, Plan, Scene};
use crate::error::Result;
use crate::linearize::model_modes::linear_system;
use crate::model::geometry::Geometry;
use crate::model::layout::body::AT;
use crate::multibody::placement::place;
use crate::run::{Cancel, Counts};
use crate::second_order::frf_resonances::{missed, unseen};
use crate::second_order::frf_sensitivity::{self, Entry, Variation};
use crate::second_order::ports::Ports;
use crate::sensitivity::direction::{Directional, Entries};
use crate::spatial::{M3, Real, V3, lift33, skew};

/// Where a port acts on its body.
#[derive(Debug, Clone, Copy)]
pub enum Point {
    Origin,
    /// world, as drawn
    World(V3<f64>),
    /// three numbers of x, world, as drawn
    Marker(usize),
}

/// One scalar input or output: a force or motion along a direction, or a torque or rotation about it; a `base` input is a translation of
/// ground. Ports without a body are on ground.
#[derive(Debug, Clone, Copy)]
pub struct Port {
    pub body: Option<usize>,
    pub point: Point,
    pub direction: V3<f64>,
    pub rotation: bool,
    pub base: bool,
}

#[derive(Debug, Clone)]
pub struct Transfer {
    pub inputs: Vec<Port>,
    pub outputs: Vec<Port>,
    /// rad/s
    pub omega: Vec<f64>,
    /// 0 for displacements per input, 1 and 2 for their rates
    pub order_out: u32,
}

impl Plan {
    pub(super) fn transfer(&self, scene: &Scene<'_>, asked: &Transfer, cancel: &Cancel) -> Result<Option<Numbers>> {
        if scene.setting.state.moving() && asked.inputs.iter().any(|port| port.base) {
            return Ok(None);
        }
        let system = linear_system(scene.lin, scene.parts)?;
        let body = Bodies::new(scene);
        let ports = body.ports(asked);
        let found = system.evaluate(&ports, &asked.omega, None, true, cancel)?;
        let poles = system.poles(&mut Counts::default()).unwrap_or_default();
        let suspects = unseen(poles, &asked.omega);
        let peaks = match suspects.is_empty() {
            true => Vec::new(),
            false => system.evaluate(&ports, &suspects, None, false, cancel)?.h,
        };
        let hidden = !missed(&asked.omega, &found.h, &suspects, &peaks).is_empty();
        let mut arrays = vec![flat(&found.h)];
        if !self.by.is_empty() {
            let Some(changes) = self.changes(scene, true, cancel)? else { return Ok(None) };
            let all: Vec<Variation> = (0..changes.all.len()).map(|p| body.variation(asked, &changes, p)).collect();
            let made = frf_sensitivity::sensitivity(system.quadratic(), &ports, &all, &asked.omega, cancel)?;
            arrays.push(flat(&made.dh));
        }
        Ok(Some(Numbers { arrays, count: 1, remark: hidden || !found.singular.is_empty() }))
    }
}

fn flat(values: &[c64]) -> Vec<f64> {
    values.iter().flat_map(|v| [v.re, v.im]).collect()
}

/// Rows and columns of ports by the motion of the bodies.
struct Bodies<'a> {
    scene: &'a Scene<'a>,
    /// from body to world axes, now
    rotation: Vec<M3<f64>>,
}

impl<'a> Bodies<'a> {
    fn new(scene: &'a Scene<'a>) -> Self {
        let system = scene.setting.system;
        let placement = place(&system.topology, &system.geometry, &scene.setting.state.q, None);
        let rotation = system.topology.node_of_body.iter().map(|node| placement.pose[*node].r).collect();
        Bodies { scene, rotation }
    }

    fn ports(&self, asked: &Transfer) -> Ports {
        let lin = self.scene.lin;
        let n = lin.matrices.mass.nrows();
        let coupling = &lin.ground_coupling;
        let mut f = Mat::zeros(n, asked.inputs.len());
        for (j, port) in asked.inputs.iter().enumerate() {
            let column = if port.base { pushed(coupling, &port.direction) } else { self.row(port) };
            column.into_iter().enumerate().for_each(|(i, v)| f[(i, j)] = v);
        }
        let rows: Vec<_> = asked.outputs.iter().map(|port| self.row(port)).collect();
        let follows = |i: usize, j: usize| {
            let (out, base) = (&asked.outputs[i], &asked.inputs[j]);
            if base.base && !out.rotation { out.direction.dot(&base.direction) } else { 0.0 }
        };
        let d0 = Mat::from_fn(rows.len(), asked.inputs.len(), follows);
        Ports {
            l: Mat::from_fn(rows.len(), n, |i, k| rows[i][k]),
            f,
            order_in: asked.inputs.iter().map(|port| if port.base { 2 } else { 0 }).collect(),
            order_out: asked.order_out,
            d0: Some(d0).filter(|d| d.norm_max() != 0.0),
        }
    }

    /// The motion of a port by the coordinates.
    fn row(&self, port: &Port) -> Vec<f64> {
        let map = &self.scene.lin.body_map;
        let Some(body) = port.body else { return vec![0.0; map.ncols()] };
        let arm = self.arm(port, body);
        let one = |j: usize| seen(port, &part(map, body, 0, j), &part(map, body, 3, j), &arm);
        (0..map.ncols()).map(one).collect()
    }

    /// From the origin of the body to the point of a port, now, world axes.
    fn arm(&self, port: &Port, body: usize) -> V3<f64> {
        let system = self.scene.setting.system;
        self.rotation[body] * self.local(port, body, &system.geometry, &system.x)
    }

    /// The same in body axes.
    fn local<T: Real>(&self, port: &Port, body: usize, geometry: &Geometry<T>, x: &[T]) -> V3<T> {
        let at = |i: usize| V3::new(x[i], x[i + 1], x[i + 2]);
        let point = match port.point {
            Point::Origin => return V3::zeros(),
            Point::World(p) => p.map(T::from),
            Point::Marker(i) => at(i),
        };
        let origin = at(self.scene.setting.system.topology.tables.bodies[body].x + AT);
        geometry.bodies[body].drawn.r.transpose() * (point - origin)
    }

    /// What direction p changes.
    fn variation(&self, asked: &Transfer, changes: &Changes, p: usize) -> Variation {
        let (lin, change) = (self.scene.lin, &changes.all[p]);
        let n = lin.matrices.mass.nrows();
        let system = self.scene.setting.system;
        let mut x: Vec<Dual64> = system.x.iter().map(|v| Dual64::from(*v)).collect();
        changes.along[p].iter().for_each(|(i, d)| x[*i].eps += d);
        let geometry = Geometry::derive(&system.topology.tables, &x);
        let row = |port: &Port| self.row_change(port, change, &geometry, &x);
        let column = |port: &Port| match (&change.ground_coupling, port.base) {
            (Some(d), true) => pushed(d, &port.direction),
            (None, true) => vec![0.0; n],
            _ => row(port),
        };
        let columns: Vec<_> = asked.inputs.iter().map(column).collect();
        let rows: Vec<_> = asked.outputs.iter().map(row).collect();
        let any = |all: &[Vec<f64>]| all.iter().flatten().any(|v| *v != 0.0);
        Variation {
            entries: entries(
                [&change.mass, &change.damping, &change.stiffness],
                [true, changes.skew_damping[p], changes.skew_stiffness[p]],
                n,
            ),
            df: any(&columns).then(|| Mat::from_fn(n, columns.len(), |i, j| columns[j][i])),
            dl: any(&rows).then(|| Mat::from_fn(rows.len(), n, |i, j| rows[i][j])),
            dd0: None,
        }
    }

    fn row_change(&self, port: &Port, change: &Directional, geometry: &Geometry<Dual64>, x: &[Dual64]) -> Vec<f64> {
        let map = &self.scene.lin.body_map;
        let Some(body) = port.body else { return vec![0.0; map.ncols()] };
        let turn = V3::from_column_slice(&change.body_motion[6 * body + 3..6 * body + 6]);
        let rotation = lift33::<Dual64>(&self.rotation[body]);
        let rotation = rotation.zip_map(&(skew(&turn) * self.rotation[body]), |r, d| Dual64::new(r.re, d));
        let arm = rotation * self.local(port, body, geometry, x);
        let dual = |j: usize, first: usize| {
            let own = part(map, body, first, j);
            let slope = change.body_map.as_ref().map_or_else(V3::zeros, |d| part(d, body, first, j));
            own.zip_map(&slope, Dual64::new)
        };
        (0..map.ncols()).map(|j| seen(port, &dual(j, 0), &dual(j, 3), &arm).eps).collect()
    }
}

/// Three rows of a map of the bodies' twists.
fn part(map: &DMatrix<f64>, body: usize, first: usize, column: usize) -> V3<f64> {
    V3::from_fn(|k, _| map[(6 * body + first + k, column)])
}

/// What a port sees of a twist at the origin of its body.
fn seen<T: Real>(port: &Port, moved: &V3<T>, turned: &V3<T>, arm: &V3<T>) -> T {
    let direction: V3<T> = port.direction.map(T::from);
    if port.rotation { direction.dot(turned) } else { direction.dot(&(moved + turned.cross(arm))) }
}

/// Forces by the acceleration of ground along a direction.
fn pushed(coupling: &DMatrix<f64>, direction: &V3<f64>) -> Vec<f64> {
    (0..coupling.nrows()).map(|i| -(0..3).map(|k| coupling[(i, k)] * direction[k]).sum::<f64>()).collect()
}

/// Entries of dM, dD and dS row by row; of those that are not `whole` the symmetric part.
fn entries(of: [&Entries; 3], whole: [bool; 3], n: usize) -> Vec<Entry> {
    let mut sums = vec![[0.0; 3]; n * n];
    for (k, (matrix, whole)) in of.into_iter().zip(whole).enumerate() {
        let share = if whole { 1.0 } else { 0.5 };
        for ((i, j), v) in matrix.rows.iter().zip(&matrix.columns).zip(&matrix.values) {
            let (i, j) = (*i as usize, *j as usize);
            sums[n * i + j][k] += share * v;
            if !whole {
                sums[n * j + i][k] += share * v;
            }
        }
    }
    let filled = sums.into_iter().enumerate().filter(|(_, v)| v.iter().any(|v| *v != 0.0));
    filled.map(|(at, [dm, dd, ds])| Entry { row: at / n, col: at % n, dm, dd, ds }).collect()
}
