//! The length of the loop that each row closes, and the rounding of the row's entries beside it.

use crate::linalg::rows::RowBlocks;
use crate::model::geometry::BodyGeometry;
use crate::model::layout;
use crate::multibody::System;
use crate::multibody::assemble::Effects;
use crate::multibody::placement::place;
use crate::multibody::topology::{ConstraintRow, Purpose};
use crate::spatial::{Pose, V3};
use crate::tolerances::matrices::ENTRY_ROUNDING;

/// The drawn points of a joint on its two bodies, world.
pub(crate) fn joint_points(system: &System, joint: usize) -> [V3<f64>; 2] {
    let start = system.topology.tables.joints[joint].x;
    [layout::joint::AT_A, layout::joint::AT_B].map(|at| V3::from_fn(|k, _| system.x[start + at + k]))
}

/// The length of the loop that each row closes: twice the largest distance of its joints from their mean, and never below the
/// size of the bodies that it joins.
pub(crate) fn loop_lengths(system: &System) -> Vec<f64> {
    let topology = &*system.topology;
    let tables = &topology.tables;
    let sizes = body_sizes(system);
    let mut of_joint: std::collections::HashMap<usize, f64> = std::collections::HashMap::new();
    let lengths = topology.rows.iter().map(|row| {
        *of_joint.entry(row.joint).or_insert_with(|| {
            let joint = &tables.joints[row.joint];
            let mut points = joint_points(system, row.joint).to_vec();
            let between = topology.nodes_between(joint.a, joint.b);
            for n in between {
                match topology.nodes[n].joint {
                    Some(j) => points.extend(joint_points(system, j)),
                    None => points.push(system.geometry.bodies[topology.nodes[n].body].drawn.p),
                }
            }
            let mean = points.iter().sum::<V3<f64>>() / points.len() as f64;
            let spread = points.iter().map(|p| (p - mean).norm()).fold(0.0, f64::max);
            let own = [joint.a, joint.b].into_iter().flatten().map(|b| sizes[b]).fold(0.0, f64::max);
            let length = (2.0 * spread).max(own);
            if length > 0.0 { length } else { system.length }
        })
    });
    lengths.collect()
}

/// Distance of the farthest joint from the centre of mass, or the radius of gyration where that is larger.
pub(crate) fn body_sizes(system: &System) -> Vec<f64> {
    let tables = &system.topology.tables;
    let gyration = |b: &BodyGeometry<f64>| match b.mass > 0.0 {
        true => (0.5 * b.inertia.trace().max(0.0) / b.mass).sqrt(),
        false => 0.0,
    };
    let mut size: Vec<f64> = system.geometry.bodies.iter().map(gyration).collect();
    for (j, joint) in tables.joints.iter().enumerate() {
        let [a, b] = joint_points(system, j);
        for (body, point) in [(joint.a, a), (joint.b, b)] {
            if let Some(b) = body {
                size[b] = size[b].max((point - system.geometry.bodies[b].drawn.p).norm());
            }
        }
    }
    size
}

/// Rounding of the entries of each row, columns free of units.
pub(crate) fn bounds(system: &System, q: &[f64], effects: Effects, rows: &RowBlocks) -> Vec<f64> {
    let poses = place(&system.topology, &system.geometry, q, None).pose;
    bounds_at(system, &poses, effects, rows)
}

pub(crate) fn bounds_at(system: &System, poses: &[Pose<f64>], effects: Effects, rows: &RowBlocks) -> Vec<f64> {
    let topology = &*system.topology;
    let far = |b: Option<usize>| topology.node(b).map_or(0.0, |n| poses[n].p.norm());
    let unit = ENTRY_ROUNDING * f64::EPSILON;
    let reach = |joint: usize| {
        let joint = &topology.tables.joints[joint];
        let along = topology.nodes_between(joint.a, joint.b).into_iter().map(|n| poses[n].p.norm());
        along.fold(far(joint.a).max(far(joint.b)), f64::max)
    };
    let lengths = if topology.tables.constraints.is_empty() { Vec::new() } else { loop_lengths(system) };
    let bound = |(i, row): (usize, &ConstraintRow)| match row.purpose {
        _ if !effects.row(row) => 0.0,
        Purpose::Constraint(c) => {
            let lengthy = topology.tables.motions_of(c).filter(|(_, x)| x.is_length());
            unit * (1.0 + 2.0 * lengthy.map(|(j, _)| reach(j) / lengths[i]).fold(0.0, f64::max))
        }
        _ if row.coordinate.is_length() => unit * (1.0 + 2.0 * reach(row.joint) * rows.row_scale[i]),
        _ => unit,
    };
    topology.rows.iter().enumerate().map(bound).collect()
}
