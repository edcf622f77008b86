//! Reactions of all joints at a state: wrenches on the second body at the joint's point, world axes.
//!
//! Redundant joints share their forces in a way that rigid bodies do not decide: of all distributions in balance this is the one
//! of minimum norm over all joints, moments divided by the characteristic length.
use nalgebra::{DMatrix, DVector};

use crate::constraint::loops::Loops;
use crate::error::Result;
use crate::linalg::dense::minimum_norm;
use crate::linearize::{Linearization, Setting};
use crate::model::geometry::Geometry;
use crate::multibody::System;
use crate::multibody::assemble::Scene;
use crate::multibody::connector::{Wanted, constraint_interaction};
use crate::multibody::placement::{Placement, marker_pose, place};
use crate::multibody::topology::{Purpose, Topology};
use crate::spatial::{Real, Six};

/// Per joint of the model, then per drive (on the second body of its joint): force and moment. A joint's reaction does not contain
/// what its drive does.
pub fn reactions(setting: &Setting<'_>, base: &Linearization) -> Result<Vec<Six<f64>>> {
    let system = setting.system;
    let rate = setting.state.moving().then(|| setting.state.rate.clone());
    let placement = place(&system.topology, &system.geometry, &setting.state.q, rate.as_deref());
    let scene = Scene {
        topology: &system.topology,
        geometry: &system.geometry,
        x: &system.x,
        memory: setting.memory,
        placement: &placement,
        rate: rate.as_deref(),
        acceleration: base.acceleration.as_deref(),
        t: 0.0,
        effects: setting.effects,
    };
    shared(system, &scene, &placement, &base.lam, base.loops.as_ref())
}

/// Reactions from multipliers, redundant ones shared with the smallest norm.
pub fn shared(
    system: &System,
    scene: &Scene<'_, f64>,
    placement: &Placement<f64>,
    lam: &[f64],
    loops: Option<&Loops>,
) -> Result<Vec<Six<f64>>> {
    let (topology, geometry) = (&*system.topology, &*system.geometry);
    let mut all = joint_wrenches(topology, geometry, scene, placement, scene.body_wrenches(Some(lam)), lam);
    let Some(loops) = loops.filter(|l| l.redundant.ncols() > 0) else {
        return Ok(all);
    };
    let states: Vec<Vec<Six<f64>>> = (0..loops.redundant.ncols())
        .map(|k| {
            let lam: Vec<f64> = loops.redundant.column(k).iter().zip(&loops.row_scale).map(|(v, s)| v * s).collect();
            joint_wrenches(topology, geometry, scene, placement, scene.multiplier_wrenches(&lam), &lam)
        })
        .collect();
    let entry = |w: &[Six<f64>], i: usize| w[i / 6].get(i % 6) / if i % 6 < 3 { 1.0 } else { system.length };
    let n = 6 * all.len();
    let m = DMatrix::from_fn(n, states.len(), |i, k| entry(&states[k], i));
    let alpha = minimum_norm(&m, &DVector::from_fn(n, |i, _| -entry(&all, i)))?;
    for (k, state) in states.iter().enumerate() {
        for (w, s) in all.iter_mut().zip(state) {
            *w += s.scaled(alpha[k]);
        }
    }
    Ok(all)
}

/// The wrenches that balance `sums` of the bodies, of joints and of drives; `lam` those of the cut rows.
pub fn joint_wrenches<T: Real>(
    topology: &Topology,
    geometry: &Geometry<T>,
    scene: &Scene<'_, T>,
    placement: &Placement<T>,
    sums: Vec<Six<T>>,
    lam: &[T],
) -> Vec<Six<T>> {
    let subtree = scene.subtree_wrenches(sums);
    let mut all = vec![Six::zero(); topology.tables.joints.len() + topology.tables.drives.len()];
    let point = |joint: usize| {
        marker_pose(topology, &placement.pose, topology.tables.joints[joint].b, &geometry.joints[joint].b).p
    };
    for (i, node) in topology.nodes.iter().enumerate() {
        if let Some(j) = node.joint {
            let w = subtree[i].wrench_at(&(point(j) - placement.pose[i].p));
            all[j] = if node.reversed { -w } else { w };
        }
    }
    let wanted = Wanted::FORCES;
    for c in scene.carried(lam) {
        let place = match c.purpose {
            Purpose::Joint => c.joint,
            Purpose::Drive(i) => topology.tables.joints.len() + i,
            Purpose::Coupler(_) | Purpose::Constraint(_) => continue,
        };
        all[place] = constraint_interaction(topology, geometry, placement, c.joint, &c.rows, wanted).wrench;
    }
    all
}
