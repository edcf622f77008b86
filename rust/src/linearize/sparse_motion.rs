//! How the bodies of a moving open tree move with its coordinates, as rows that are sparse.
//!
//! With y = exp(s t) z of the tree coordinates, the twists x_f = B z about points fixed where the centres of mass are now have
//! ```text
//! x_f' = s x_f + d,   x_f" = s^2 x_f + 2 s d + e,   d = B' z,   e = B" z
//! ```
//! and x_f, d, e are carried from body to body, each with the columns of its joint and with their rates. The centre of mass itself moves:
//! x = T x_f, T' and T" by its velocity and acceleration. With W the wrench of a body and all that it carries, rho_i = S_i . W changes by
//! S_i . dW + dS_i . W, where what carries the axis turns it: forces in joints need no multipliers here, and none of the forces must be in
//! balance.
use crate::linearize::sparse_form::Entries;
use crate::multibody::assemble::Scene;
use crate::multibody::topology::Topology;
use crate::spatial::{Six, V3};

pub struct Motion {
    /// number of tree coordinates
    pub n_tree: usize,
    /// what a body takes over from the one that carries it: (row, column, value) over the coordinates of bodies
    pub carried: Entries,
    /// columns of the tree coordinates and their first and second rates: (row, tree coordinate, value)
    pub columns: [Entries; 3],
    /// T' and T" at T = 1
    pub turned: [Entries; 2],
    /// what the wrench of a body about the fixed point changes by, since its force moves along: over the coordinates of bodies
    pub shifted: Entries,
    /// dS_i . W by the body that carries a joint (tree coordinate, column), and by its coordinates before (tree coordinate, the same)
    pub weighed: [Entries; 2],
}

/// `accelerations` of the centres of mass, per node of the tree.
pub fn motion(tree: &Scene<'_, f64>, free: &Topology, accelerations: &[Six<f64>]) -> Motion {
    let (topology, placement) = (tree.topology, tree.placement);
    let first = |node: usize| free.nodes[free.node_of_body[topology.nodes[node].body]].first;
    let (by_rate, by_acceleration) = tree.inertia(true).column_rates();
    let mut out = Motion {
        n_tree: topology.n_tree,
        carried: Vec::new(),
        columns: [Vec::new(), Vec::new(), Vec::new()],
        turned: [Vec::new(), Vec::new()],
        shifted: Vec::new(),
        weighed: [Vec::new(), Vec::new()],
    };
    let own = tree.body_wrenches(None);
    let sums = tree.subtree_wrenches(own.clone());
    for (i, node) in topology.nodes.iter().enumerate() {
        let row = first(i);
        if let Some(p) = node.parent {
            let arm = placement.pose[i].p - placement.pose[p].p;
            for j in 0..6 {
                let moved = unit(j).motion_at(&arm);
                push(&mut out.carried, row, first(p) + j, &moved);
            }
        }
        for d in node.first..node.first + node.n {
            for (columns, s) in out.columns.iter_mut().zip([&placement.column[d], &by_rate[d], &by_acceleration[d]]) {
                push(columns, row, d, s);
            }
        }
        for j in 0..3 {
            push(&mut out.shifted, row, row + j, &Six::new(V3::zeros(), unit(j).l.cross(&own[i].l)));
        }
        weigh(&mut out.weighed, tree, i, node.parent.map(|p| (p, first(p))), &sums[i]);
        let velocity = placement.velocity.as_ref().map_or_else(V3::zeros, |v| v.body[i].l);
        for (turned, along) in out.turned.iter_mut().zip([velocity, accelerations[i].l]) {
            for j in 3..6 {
                push(turned, row, row + j, &Six::new(unit(j).a.cross(&along), V3::zeros()));
            }
        }
    }
    out
}

/// The columns of a node turned by what carries them, times the wrench that they feel.
fn weigh(out: &mut [Entries; 2], tree: &Scene<'_, f64>, i: usize, parent: Option<(usize, usize)>, wrench: &Six<f64>) {
    let (topology, placement) = (tree.topology, tree.placement);
    let node = &topology.nodes[i];
    let dofs = node.first..node.first + node.n;
    let stage = |d: usize| topology.dofs[d].freedom.stage;
    for d in dofs.clone() {
        let s = &placement.column[d];
        if let Some((p, column)) = parent {
            let arm = placement.pose[i].p - placement.pose[p].p;
            let change = |j: usize| unit(j).motion_at(&arm).cross_motion(s).dot(wrench);
            out[0].extend((0..6).map(|j| (d, column + j, change(j))).filter(|e| e.2 != 0.0));
        }
        let before = dofs.clone().filter(|b| stage(*b) < stage(d));
        out[1].extend(before.map(|b| (d, b, placement.column[b].cross_motion(s).dot(wrench))).filter(|e| e.2 != 0.0));
    }
}

fn unit(j: usize) -> Six<f64> {
    let at = |k: usize| if k == j { 1.0 } else { 0.0 };
    Six::new(V3::new(at(0), at(1), at(2)), V3::new(at(3), at(4), at(5)))
}

fn push(out: &mut Entries, row: usize, column: usize, s: &Six<f64>) {
    out.extend((0..6).map(|k| (row + k, column, s.get(k))).filter(|e| e.2 != 0.0));
}
