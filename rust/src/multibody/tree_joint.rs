//! What a joint of the tree does at its point on the outer body, and the wrench that it carries there.
//!
//! A joint that carries the wrench W does the work S_k . W, S_k the twist of its coordinate k: none where a state is in balance, elsewhere
//! that of the unbalanced force. In tree coordinates this force stays the same, and so it does in absolute ones if W keeps its work. Seen
//! from the inner body
//! ```text
//! S_k . dW = -dS_k . W,   dS_k = sum_j (S_j x S_k) y_j   [j carries k],   y_j = D_j . xi
//! ```
//! so dW = -sum D_k ((S_j x S_k) . W) (D_j . xi), where D_k . S_k = 1 and D_k . S_l = 0 of the others. The forces f on the bodies are in
//! balance with these wrenches, and nothing is left of (dT/dy)^T f in the change of T^T f.
use crate::model::geometry::Geometry;
use crate::multibody::connector::Interaction;
use crate::multibody::placement::{Placement, markers};
use crate::multibody::topology::{Node, Topology};
use crate::spatial::{Map6, Six, V3};

/// The joint that carries a node, at the outer marker; of nodes whose columns are coordinates, so of none of a flexible body.
pub struct TreeJoint<'a> {
    topology: &'a Topology,
    node: &'a Node,
    /// from the centre of mass of the outer body to the point
    arm: V3<f64>,
    pub point: V3<f64>,
    /// S: the twist of the outer body against the inner one for each coordinate, world axes
    columns: Vec<Six<f64>>,
    /// D: the coordinates of a relative twist that the joint allows
    pub duals: Vec<Six<f64>>,
}

impl<'a> TreeJoint<'a> {
    pub fn new(
        topology: &'a Topology,
        geometry: &Geometry<f64>,
        placement: &Placement<f64>,
        index: usize,
    ) -> TreeJoint<'a> {
        let (node, pose) = (&topology.nodes[index], &placement.pose[index]);
        let point = pose.then(&markers(topology, geometry, node).1).p;
        let arm = point - pose.p;
        let dofs = node.first..node.first + node.n;
        let columns: Vec<_> = dofs.clone().map(|d| placement.column[d].motion_at(&arm)).collect();
        // freedoms are perpendicular to each other
        let axis = |(d, s): (usize, &Six<f64>)| match topology.dofs[d].freedom.rotation {
            true => Six::new(V3::zeros(), s.a),
            false => Six::new(s.l, V3::zeros()),
        };
        let duals = dofs.zip(&columns).map(axis).collect();
        TreeJoint { topology, node, arm, point, columns, duals }
    }

    /// The wrench that balances `wrench` of the outer body and all that it carries (about its centre of mass).
    pub fn carrying(&self, wrench: &Six<f64>) -> Interaction<f64> {
        let wrench = wrench.wrench_at(&self.arm);
        let stage = |k: usize| self.topology.dofs[self.node.first + k].freedom.stage;
        let mut tangent = Map6::zero();
        for k in 0..self.node.n {
            for j in (0..self.node.n).filter(|j| stage(*j) < stage(k)) {
                let turned = self.columns[j].cross_motion(&self.columns[k]).dot(&wrench);
                tangent.add_outer(&self.duals[k], &self.duals[j], -turned);
            }
        }
        Interaction {
            a: self.node.parent.map(|p| self.topology.nodes[p].body),
            b: Some(self.node.body),
            point: self.point,
            wrench,
            damped: false,
            elastic: None,
            tangent: Some((tangent, Map6::zero())),
        }
    }
}
