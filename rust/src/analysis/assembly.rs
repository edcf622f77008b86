//! From the drawn configuration to a consistent state: loops closed, velocities made to agree with all constraints.
use faer::prelude::*;
use nalgebra::{DMatrix, DVector};
use num_dual::Dual64;

use super::transient::matrix::Matrix;
use super::transient::saddle::{Ordering, Saddle};
use crate::error::{Error, Result};
use crate::linalg::entries::Entries;
use crate::model::geometry::Geometry;
use crate::model::joint::{Coordinate, JointKind};
use crate::model::layout;
use crate::run::Counts;
use crate::spatial::{Pose, Real, Six, V3, rotation_of_quaternion};
use crate::system::System;
use crate::system::assemble::{Effects, Scene};
use crate::system::loops::{column_scales, gap, row_scales};
use crate::system::placement::{Placement, State, advance, drawn_relative, place, relative_from_poses};
use crate::system::rows::explicit_rates;
use crate::system::topology::{Level, Node, Purpose, Topology};

const CLOSED: f64 = 1e-13;
const MAX_ITERATIONS: usize = 60;

pub struct Assembled {
    pub state: State,
    /// largest change of a given velocity by the projection, metres per second with the characteristic length
    pub velocity_correction: f64,
    pub iterations: usize,
}

/// The drawn state: two-point joints brought together, loops closed by the smallest change, velocities projected.
///
/// `hold`: drives stand still at their values of t = 0, as linear analyses take them; else they give their rates.
pub fn assemble(system: &System, hold: bool, effects: Effects, counts: &mut Counts) -> Result<Assembled> {
    let mut state = State { relative: start(system), rate: Vec::new() };
    let iterations = close(system, &mut state, effects, counts)?;
    let velocity_correction = set_velocities(system, &mut state, hold, effects)?;
    Ok(Assembled { state, velocity_correction, iterations })
}

/// The drawn relative poses, or those of the user's first guess.
pub fn start(system: &System) -> Vec<Pose<f64>> {
    let topology = &*system.topology;
    let mut relative = drawn_relative(topology, &system.geometry);
    if topology.tables.poses.is_empty() {
        return relative;
    }
    let mut poses: Vec<Pose<f64>> = system.geometry.bodies.iter().map(|b| b.drawn).collect();
    for &(body, x) in &topology.tables.poses {
        let r = rotation_of_quaternion(&system.x[x + layout::pose::ORIENTATION..x + layout::pose::ORIENTATION + 4]);
        let origin = V3::from_fn(|k, _| system.x[x + layout::pose::AT + k]);
        poses[body] = Pose { p: origin + r * system.geometry.bodies[body].com, r };
    }
    let guessed = relative_from_poses(topology, &system.geometry, &poses);
    let touched = |node: &Node| {
        let given = |b: usize| topology.tables.poses.iter().any(|(body, _)| *body == b);
        given(node.body) || node.parent.is_some_and(|p| given(topology.nodes[p].body))
    };
    for (i, node) in topology.nodes.iter().enumerate() {
        if touched(node) {
            relative[i] = guessed[i];
        }
    }
    relative
}

pub fn scene<'a>(system: &'a System, placement: &'a Placement<f64>) -> Scene<'a, f64> {
    Scene {
        topology: &system.topology,
        geometry: &system.geometry,
        x: &system.x,
        memory: &[],
        placement,
        rate: None,
        acceleration: None,
        t: 0.0,
        effects: Effects::ALL,
    }
}

fn with<'a>(system: &'a System, placement: &'a Placement<f64>, effects: Effects) -> Scene<'a, f64> {
    Scene { effects, ..scene(system, placement) }
}

/// Newton on the position rows with the minimum-norm step; returns the number of steps.
pub fn close(system: &System, state: &mut State, effects: Effects, counts: &mut Counts) -> Result<usize> {
    if system.topology.rows.is_empty() {
        return Ok(0);
    }
    let rows = row_scales(&system.topology, system.length);
    let columns = column_scales(&system.topology, system.length);
    let mut best = f64::INFINITY;
    for iteration in 0..MAX_ITERATIONS {
        let placement = place(&system.topology, &system.geometry, &state.relative, None);
        let mut jacobian = rows_of(system);
        let phi = with(system, &placement, effects).constraints_into(&mut jacobian);
        if phi.iter().any(|v| !v.is_finite()) {
            return Err(system
                .topology
                .tables
                .failure()
                .unwrap_or_else(|| Error::Assembly("the constraints cannot be evaluated in this state".into())));
        }
        let (size, worst) = gap(&system.topology, &phi, &rows);
        if size <= CLOSED {
            check_orientation(system, &placement)?;
            return Ok(iteration);
        }
        // rounding level reached: no further progress is possible
        if iteration > 3 && size >= best && best < 1e-11 {
            return Ok(iteration);
        }
        if iteration > 12 && size > 0.9 * best && size > 1e-9 {
            return Err(cannot_close(system, &phi, worst, size));
        }
        best = best.min(size);
        // velocity rows do not say where anything is: they neither close a loop nor hinder it
        let closes = |i: usize| system.topology.rows[i].level == Level::Position;
        let scaled = jacobian.scaled(|i| if closes(i) { rows[i] } else { 0.0 }, |j| columns[j]);
        let right = DVector::from_fn(phi.len(), |i, _| -phi[i] * rows[i]);
        let mut step = smallest(&scaled, &right)?;
        let longest = step.amax();
        if longest > 0.5 {
            step *= 0.5 / longest;
        }
        let dy: Vec<f64> = step.iter().zip(&columns).map(|(s, c)| s * c).collect();
        advance(&system.topology, &mut state.relative, &dy);
        counts.add("assembly iterations", 1);
    }
    let placement = place(&system.topology, &system.geometry, &state.relative, None);
    let (phi, _) = with(system, &placement, effects).constraints();
    let (size, worst) = gap(&system.topology, &phi, &rows);
    if size < 1e-9 { Ok(MAX_ITERATIONS) } else { Err(cannot_close(system, &phi, worst, size)) }
}

fn cannot_close(system: &System, phi: &DVector<f64>, worst: Option<usize>, size: f64) -> Error {
    let Some(row) = worst else {
        return Error::Assembly("the loops cannot close".into());
    };
    let spec = &system.topology.rows[row];
    let joint = &system.topology.tables.joints[spec.joint];
    let (what, unit) = match spec.coordinate {
        c if spec.purpose != Purpose::Joint => {
            let kind = if matches!(spec.purpose, Purpose::Drive(_)) { "drive" } else { "coupler" };
            let unit = if c.is_length() { "m" } else { "rad" };
            return Error::Assembly(format!(
                "{kind} '{}' asks for a value of joint '{}' that the model cannot take: it is off by {:.6} {unit} at the closest approach; \
                 check its value at t = 0 and whether another drive or a closed loop already fixes this coordinate",
                system.topology.row_name(row),
                joint.name,
                phi[row].abs()
            ));
        }
        c if c.is_length() => ("points are apart by", "m"),
        _ => ("axes are off by", "rad"),
    };
    let bodies =
        format!("'{}' and '{}'", system.topology.tables.body_name(joint.a), system.topology.tables.body_name(joint.b));
    Error::Assembly(format!(
        "the loop cannot close at joint '{}' between {bodies}: its {what} {:.6} {unit} at the closest approach (relative gap {size:.1e}); \
         check the points and lengths of the joints in this loop",
        joint.name,
        phi[row].abs()
    ))
}

/// Dot rows also vanish for axes that point opposite ways; a joint assembled so would work backwards.
fn check_orientation(system: &System, placement: &Placement<f64>) -> Result<()> {
    for &j in &system.topology.cut {
        let spec = &system.topology.tables.joints[j];
        let aligned = spec.kind.constraints().contains(&Coordinate::Dot(0, 2));
        let pair = &system.geometry.joints[j];
        let world = |body, local: &Pose<f64>| {
            crate::system::placement::marker_pose(&system.topology, &placement.pose, body, local)
        };
        let (a, b) = (world(spec.a, &pair.a), world(spec.b, &pair.b));
        if aligned && a.r.column(2).dot(&b.r.column(2)) < 0.0 {
            return Err(Error::Assembly(format!(
                "joint '{}' closes only with its axis reversed; draw its bodies closer to the assembled pose",
                spec.name
            )));
        }
    }
    Ok(())
}

/// Above this number of coordinates and rows singular values take too long.
const DENSE: usize = 300;

fn rows_of(system: &System) -> Matrix {
    let (rows, columns) = (system.topology.rows.len(), system.n_tree());
    Matrix::zeros(rows, columns, rows + columns > DENSE)
}

/// The smallest x with m x = right, as well as that can be.
fn smallest(m: &Matrix, right: &DVector<f64>) -> Result<DVector<f64>> {
    if let Matrix::Dense(m) = m {
        return minimum_norm(m, right);
    }
    let n = m.shape().1;
    let mut identity = Matrix::zeros(n, n, true);
    (0..n).for_each(|i| identity.add(i, i, 1.0));
    let saddle = Saddle::of(&identity, m, Some(&Ordering::default()))?;
    Ok(saddle.solve(&DVector::zeros(n), right)?.0)
}

/// Least-squares solution of smallest norm; directions below the rank tolerance are left alone.
pub fn minimum_norm(m: &DMatrix<f64>, right: &DVector<f64>) -> Result<DVector<f64>> {
    let a = Mat::from_fn(m.nrows(), m.ncols(), |i, j| m[(i, j)]);
    let svd =
        a.thin_svd().map_err(|_| Error::singular("the singular values of the constraint rows could not be found"))?;
    let (u, s, v) = (svd.U(), svd.S().column_vector(), svd.V());
    let mut x = DVector::zeros(m.ncols());
    let largest = if s.nrows() > 0 { s[0] } else { 0.0 };
    for k in 0..s.nrows() {
        if s[k] > 1e-10 * largest {
            let weight = (0..m.nrows()).map(|i| u[(i, k)] * right[i]).sum::<f64>() / s[k];
            for i in 0..m.ncols() {
                x[i] += weight * v[(i, k)];
            }
        }
    }
    Ok(x)
}

/// Rates of the tree coordinates from the bodies' given velocities, made to satisfy the cut joints.
fn set_velocities(system: &System, state: &mut State, hold: bool, effects: Effects) -> Result<f64> {
    let topology = &*system.topology;
    let given = |node: usize| {
        let x = topology.tables.bodies[topology.nodes[node].body].x;
        let at = |i: usize| V3::new(system.x[x + i], system.x[x + i + 1], system.x[x + i + 2]);
        (at(layout::body::VELOCITY), at(layout::body::ANGULAR_VELOCITY))
    };
    let resting = |n: usize| given(n).0.amax() == 0.0 && given(n).1.amax() == 0.0;
    let placement = place(topology, &system.geometry, &state.relative, None);
    let prescribed = explicit_rates(topology, &system.geometry, effects, 0.0).0;
    let driven = prescribed.amax() != 0.0;
    if (0..topology.nodes.len()).all(resting) && (hold || !driven) {
        return Ok(0.0);
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
        if node.kind == JointKind::Node {
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
    let moving = place(topology, &system.geometry, &state.relative, Some(&rate));
    let mut correction: f64 = 0.0;
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
        correction = correction.max((origin.l - velocity).norm()).max((origin.a - omega).norm() * system.length);
    }
    state.rate = held;
    Ok(correction)
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
        if node.kind == JointKind::Node {
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
    if system.topology.rows.is_empty() {
        return Ok(());
    }
    let rows = row_scales(&system.topology, system.length);
    let columns = column_scales(&system.topology, system.length);
    let mut jacobian = rows_of(system);
    with(system, placement, effects).constraints_into(&mut jacobian);
    let mut given = explicit_rates(&system.topology, &system.geometry, effects, 0.0).0;
    if hold {
        given.fill(0.0);
    }
    let scaled = jacobian.scaled(|i| rows[i], |j| columns[j]);
    let y: Vec<f64> = rate.iter().zip(&columns).map(|(r, c)| r / c).collect();
    let given = DVector::from_fn(given.len(), |i, _| given[i] * rows[i]);
    let step = smallest(&scaled, &-(scaled.times(&y) + given))?;
    for i in 0..rate.len() {
        rate[i] += step[i] * columns[i];
    }
    Ok(())
}
