//! Places of the bodies of a design, and how they move with its parameters.
use nalgebra::Vector3;

use super::{Numbers, Plan, Scene};
use crate::error::Result;
use crate::model::layout::body::COM;
use crate::multibody::placement::place;
use crate::run::Cancel;
use crate::spatial::V3;

impl Plan {
    pub(super) fn rest(&self, scene: &Scene<'_>, cancel: &Cancel) -> Result<Option<Numbers>> {
        let system = scene.setting.system;
        let placement = place(&system.topology, &system.geometry, &scene.setting.state.q, None);
        let n = system.n_bodies();
        let (mut position, mut rotation) = (vec![0.0; 3 * n], vec![0.0; 9 * n]);
        for (node, pose) in system.topology.nodes.iter().zip(&placement.pose) {
            let origin = pose.p - pose.r * system.geometry.bodies[node.body].com;
            position[3 * node.body..3 * node.body + 3].copy_from_slice(origin.as_slice());
            rotation[9 * node.body..9 * node.body + 9].copy_from_slice(pose.r.transpose().as_slice());
        }
        let mut arrays = vec![position, rotation];
        if !self.by.is_empty() {
            let Some(changes) = self.changes(scene, false, cancel)? else { return Ok(None) };
            let n_p = changes.all.len();
            let (mut moved, mut turned) = (vec![0.0; 3 * n * n_p], vec![0.0; 3 * n * n_p]);
            for (p, (change, dx)) in changes.all.iter().zip(&changes.along).enumerate() {
                for (node, pose) in system.topology.nodes.iter().zip(&placement.pose) {
                    let (b, own) = (node.body, &change.body_motion[6 * node.body..6 * node.body + 6]);
                    let (centre, turn) = (Vector3::from_column_slice(&own[..3]), Vector3::from_column_slice(&own[3..]));
                    let at = system.topology.tables.bodies[b].x + COM;
                    let dcom = V3::from_fn(|k, _| dx.iter().filter(|(i, _)| *i == at + k).map(|(_, d)| d).sum());
                    let arm = pose.r * system.geometry.bodies[b].com;
                    let origin = centre - turn.cross(&arm) - pose.r * dcom;
                    for k in 0..3 {
                        moved[(3 * b + k) * n_p + p] = origin[k];
                        turned[(3 * b + k) * n_p + p] = turn[k];
                    }
                }
            }
            arrays.extend([moved, turned]);
        }
        Ok(Some(Numbers { arrays, count: 1, remark: false }))
    }
}
