//! From the drawn configuration to a consistent state: loops closed, velocities made to agree with all constraints.
use nalgebra::{DMatrix, DVector};
use num_dual::Dual64;

use crate::constraint::closure::{drawn_start, scene_at_rest};
use crate::constraint::loops::column_scales;
use crate::error::Result;
use crate::linalg::dense::minimum_norm;
use crate::linalg::entries::Entries;
use crate::linalg::kkt::{Kkt, Ordering};
use crate::linalg::matrix::Matrix;
use crate::model::geometry::Geometry;
use crate::model::layout;
use crate::multibody::System;
use crate::multibody::assemble::Effects;
use crate::multibody::placement::{Placement, State, place};
use crate::multibody::topology::{Node, Topology};
use crate::run::Counts;
use crate::spatial::{Real, Six, V3};
use crate::tolerances::linearisation::VELOCITY_CORRECTED;

/// Above this number of rows and coordinates sparse factors are faster.
const DENSE: usize = 300;

pub struct Assembled {
    pub state: State,
    pub velocities: Projected,
    pub iterations: usize,
}

/// What the projection made of given velocities; angular ones times the characteristic length.
#[derive(Debug, Clone, Copy, Default)]
pub struct Projected {
    /// largest change of a given velocity
    pub change: f64,
    /// largest velocity that was given or is there now
    pub largest: f64,
}

impl Projected {
    /// Whether the given velocities contradict the joints.
    pub fn contradicts(&self) -> bool {
        self.change > VELOCITY_CORRECTED * self.largest
    }
}

/// The drawn state: two-point joints brought together, loops closed by the smallest change, velocities projected.
///
/// `hold`: drives stand still at their values of t = 0, as linear analyses take them; else they give their rates.
pub fn assemble(system: &System, hold: bool, effects: Effects, counts: &mut Counts) -> Result<Assembled> {
    let (mut state, iterations) = if system.topology.rows.is_empty() {
        (State { q: drawn_start(system), rate: Vec::new() }, 0)
    } else {
        let decision = system.decision(effects)?;
        counts.add("assembly iterations", decision.iterations as u64);
        (State { q: decision.closed.clone(), rate: Vec::new() }, decision.iterations)
    };
    let velocities = set_velocities(system, &mut state, hold, effects)?;
    Ok(Assembled { state, velocities, iterations })
}

/// Rates of the tree coordinates from the bodies' given velocities, made to satisfy the cut joints.
fn set_velocities(system: &System, state: &mut State, hold: bool, effects: Effects) -> Result<Projected> {
    let topology = &*system.topology;
    let given = |node: usize| {
        let x = topology.tables.bodies[topology.nodes[node].body].x;
        let at = |i: usize| V3::new(system.x[x + i], system.x[x + i + 1], system.x[x + i + 2]);
        (at(layout::body::VELOCITY), at(layout::body::ANGULAR_VELOCITY))
    };
    let resting = |n: usize| given(n).0.amax() == 0.0 && given(n).1.amax() == 0.0;
    let placement = place(topology, &system.geometry, &state.q, None);
    let prescribed = scene_at_rest(system, &placement, effects).explicit_rates();
    let driven = prescribed.amax() != 0.0;
    if (0..topology.nodes.len()).all(resting) && (hold || !driven) {
        return Ok(Projected::default());
    }
    let mut rate = vec![0.0; topology.n_tree];
    let mut body: Vec<Six<f64>> = Vec::new();
    for (n, node) in topology.nodes.iter().enumerate() {
        let (velocity, omega) = given(n);
        let pose = &placement.pose[n];
        let arm = pose.r * from_origin(system.topology.as_ref(), &system.geometry, node.body);
        let wanted = Six::new(velocity, omega).motion_at(&arm);
        let carried = node.parent.map_or_else(Six::zero, |p| body[p].motion_at(&(pose.p - placement.pose[p].p)));
        let relative = wanted - carried;
        if node.kind.is_modal() {
            body.push(carried);
            continue;
        }
        let (m, right) = weighted_columns(system.length, &placement, node, &relative);
        let solution = minimum_norm(&m, &right)?;
        let mut v = carried;
        for k in 0..node.n {
            rate[node.first + k] = solution[k];
            v += placement.column[node.first + k].scaled(solution[k]);
        }
        body.push(v);
    }
    let mut held = rate.clone();
    project_rates(system, &placement, &mut rate, false, effects)?;
    if hold && driven {
        project_rates(system, &placement, &mut held, true, effects)?;
    } else {
        held.clone_from(&rate);
    }
    let moving = place(topology, &system.geometry, &state.q, Some(&rate));
    let mut velocities = Projected::default();
    let speed = |linear: V3<f64>, angular: V3<f64>| linear.norm().max(angular.norm() * system.length);
    for (n, node) in topology.nodes.iter().enumerate() {
        let Some(v) = moving.velocity.as_ref().map(|v| v.body[n]) else {
            continue;
        };
        let pose = &placement.pose[n];
        if topology.tables.bodies[node.body].tip.is_some() {
            continue;
        }
        let origin = v.motion_at(&-(pose.r * system.geometry.bodies[node.body].com));
        let (velocity, omega) = given(n);
        // a body without a given velocity takes that of the drives
        if driven && resting(n) {
            continue;
        }
        velocities.change = velocities.change.max(speed(origin.l - velocity, origin.a - omega));
        velocities.largest = velocities.largest.max(speed(velocity, omega)).max(speed(origin.l, origin.a));
    }
    state.rate = held;
    Ok(velocities)
}

/// From the origin, whose velocity was given, to the point whose twist is wanted: the undeformed body's, body axes.
fn from_origin<T: Real>(topology: &Topology, geometry: &Geometry<T>, body: usize) -> V3<T> {
    let tables = &topology.tables;
    let Some(tip) = tables.bodies[body].tip else {
        return geometry.bodies[body].com;
    };
    let frame = tables.flexible[tables.tips[tip].flexible].body;
    geometry.bodies[frame].com + geometry.tips[tip].offset
}

fn weighted_columns<T: Real>(
    length: T,
    placement: &Placement<T>,
    node: &Node,
    relative: &Six<T>,
) -> (DMatrix<T>, DVector<T>) {
    let weight = |i: usize| if i < 3 { T::one() } else { length };
    let m = DMatrix::from_fn(6, node.n, |i, k| placement.column[node.first + k].get(i) * weight(i));
    (m, DVector::from_fn(6, |i, _| relative.get(i) * weight(i)))
}

/// The rates of the tree coordinates that come closest to the bodies' given velocities, joint by joint from ground outwards, over
/// duals: their derivative along that of the numbers.
pub fn given_rates(
    system: &System,
    geometry: &Geometry<Dual64>,
    x: &[Dual64],
    placement: &Placement<Dual64>,
) -> Result<Vec<Dual64>> {
    let topology = &*system.topology;
    let length = topology.characteristic_length(geometry, x);
    let mut rate = vec![Dual64::from(0.0); topology.n_tree];
    let mut body: Vec<Six<Dual64>> = Vec::new();
    for (n, node) in topology.nodes.iter().enumerate() {
        let start = topology.tables.bodies[node.body].x;
        let at = |i: usize| V3::new(x[start + i], x[start + i + 1], x[start + i + 2]);
        let pose = &placement.pose[n];
        let arm = pose.r * from_origin(topology, geometry, node.body);
        let carried = node.parent.map_or_else(Six::zero, |p| body[p].motion_at(&(pose.p - placement.pose[p].p)));
        let relative =
            Six::new(at(layout::body::VELOCITY), at(layout::body::ANGULAR_VELOCITY)).motion_at(&arm) - carried;
        if node.kind.is_modal() {
            body.push(carried);
            continue;
        }
        let (m, right) = weighted_columns(length, placement, node, &relative);
        let mut v = carried;
        for (k, r) in dual_least_squares(&m, &right)?.into_iter().enumerate() {
            rate[node.first + k] = r;
            v += placement.column[node.first + k].scaled(r);
        }
        body.push(v);
    }
    Ok(rate)
}

/// min |m x - b| for full column rank: the normal equations of the derivative, m^T m x' = (m^T (b - m x))'.
fn dual_least_squares(m: &DMatrix<Dual64>, b: &DVector<Dual64>) -> Result<Vec<Dual64>> {
    let real = m.map(|v| v.re);
    let x = minimum_norm(&real, &b.map(|v| v.re))?;
    let miss = m.transpose() * (b - m * x.map(Dual64::from));
    let slope = minimum_norm(&(real.transpose() * &real), &miss.map(|v| v.eps))?;
    Ok(x.iter().zip(&slope).map(|(x, d)| Dual64::new(*x, *d)).collect())
}

/// The closest rates (scaled by the characteristic length) that satisfy all rows, drives moving or held.
fn project_rates(
    system: &System,
    placement: &Placement<f64>,
    rate: &mut [f64],
    hold: bool,
    effects: Effects,
) -> Result<()> {
    let topology = &*system.topology;
    if topology.rows.is_empty() {
        return Ok(());
    }
    let n = topology.n_tree;
    let sparse = topology.rows.len() + n > DENSE;
    let mut jacobian = Matrix::zeros(topology.rows.len(), n, sparse);
    let scene = scene_at_rest(system, placement, effects);
    scene.constraints_into(&mut jacobian);
    let mut given = scene.explicit_rates();
    if hold {
        given.fill(0.0);
    }
    let miss = -(jacobian.times(rate) + given);
    let mut metric = Matrix::zeros(n, n, sparse);
    for (i, c) in column_scales(topology, system.length).into_iter().enumerate() {
        metric.add(i, i, c.powi(-2));
    }
    let decision = system.decision(effects)?;
    let kkt = Kkt::new(&metric, &jacobian, &decision.rows, sparse.then_some(&Ordering::default()))?;
    let step = kkt.solve_one(&DVector::zeros(n), &miss)?.0;
    rate.iter_mut().zip(step.iter()).for_each(|(r, s)| *r += s);
    Ok(())
}
