//! How the bodies of a moving open tree move with its coordinates, as rows that are sparse.
//!
//! With y = exp(s t) z of the tree coordinates, the twists x_f = B z about points fixed where the centres of mass are now have
//! ```text
//! x_f' = s x_f + d,   x_f" = s^2 x_f + 2 s d + e,   d = B' z,   e = B" z
//! ```
//! and x_f, d, e are carried from body to body, each with the columns of its joint and with their rates. The centre of mass itself moves:
//! x = T x_f, T' and T" by its velocity and acceleration. What joints carry now keeps its work in the coordinates by its stiffness
//! (`multibody::tree_joint`), so that what is added to it does none, in balance or not.
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
    };
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
        let velocity = placement.velocity.as_ref().map_or_else(V3::zeros, |v| v.body[i].l);
        for (turned, along) in out.turned.iter_mut().zip([velocity, accelerations[i].l]) {
            for j in 3..6 {
                push(turned, row, row + j, &Six::new(unit(j).a.cross(&along), V3::zeros()));
            }
        }
    }
    out
}

fn unit(j: usize) -> Six<f64> {
    let at = |k: usize| if k == j { 1.0 } else { 0.0 };
    Six::new(V3::new(at(0), at(1), at(2)), V3::new(at(3), at(4), at(5)))
}

fn push(out: &mut Entries, row: usize, column: usize, s: &Six<f64>) {
    out.extend((0..6).map(|k| (row + k, column, s.get(k))).filter(|e| e.2 != 0.0));
}
