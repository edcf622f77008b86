//! Some parts of the residual alone: those that a few numbers of the model belong to.
//!
//! A number that moves no body (a stiffness, a mass, the end of a spring) is felt by one or two parts; the residual of a state that is
//! held changes by their wrenches alone.
use crate::multibody::assemble::Scene;
use crate::multibody::connector::{constraint_interaction, interaction, load_interaction};
use crate::multibody::inertia_input::InertiaInput;
use crate::multibody::path::add_wrench;
use crate::spatial::{Real, Six};

/// Connectors, rigid bodies (by node, their inertia), loads and cut joints (their multipliers).
#[derive(Debug, Clone, Default)]
pub struct Parts {
    pub connectors: Vec<usize>,
    pub inertias: Vec<usize>,
    pub loads: Vec<usize>,
    pub joints: Vec<usize>,
}

impl Parts {
    pub fn len(&self) -> usize {
        self.connectors.len() + self.inertias.len() + self.loads.len() + self.joints.len()
    }

    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The nodes that they act on.
    pub fn nodes<T: Real>(&self, scene: &Scene<'_, T>) -> Vec<usize> {
        let (topology, tables) = (scene.topology, &scene.topology.tables);
        let mut out = self.inertias.clone();
        for c in self.connectors.iter().map(|c| &topology.connectors[*c]) {
            out.extend([c.a, c.b].into_iter().filter_map(|b| topology.node(b)));
        }
        for joint in self.joints.iter().map(|j| &tables.joints[*j]) {
            out.extend([joint.a, joint.b].into_iter().filter_map(|b| topology.node(b)));
        }
        out.extend(self.loads.iter().map(|l| topology.node_of_body[tables.loads[*l].body]));
        out.sort_unstable();
        out.dedup();
        out
    }
}

impl<T: Real> Scene<'_, T> {
    /// Per node: wrenches of these parts about the centre of mass, with their sign in the residual. `accelerations` are those of
    /// `loaded_accelerations` of a node. Only poses and twists of the nodes concerned are read.
    pub fn part_wrenches(&self, of: &Parts, accelerations: impl Fn(usize) -> Six<T>, lam: Option<&[T]>) -> Vec<Six<T>> {
        let (topology, geometry, placement) = (self.topology, self.geometry, self.placement);
        let wanted = self.effects.wanted();
        let numbers = self.numbers();
        let mut sums = vec![Six::zero(); topology.nodes.len()];
        for c in &of.connectors {
            let connector = &topology.connectors[*c];
            let acting = interaction(topology, geometry, placement, numbers, connector, wanted);
            add_wrench(topology, placement, &acting, &mut sums);
        }
        for load in &of.loads {
            let acting = load_interaction(topology, geometry, placement, *load, self.t, wanted);
            add_wrench(topology, placement, &acting, &mut sums);
        }
        if let Some(lam) = lam.filter(|_| !of.joints.is_empty()) {
            let all = self.cut_multipliers(lam);
            for (joint, rows) in all.iter().filter(|(j, _)| of.joints.contains(j)) {
                let acting = constraint_interaction(topology, geometry, placement, *joint, rows, wanted);
                add_wrench(topology, placement, &acting, &mut sums);
            }
        }
        for sum in &mut sums {
            *sum = -*sum;
        }
        let inertia = self.inertia(self.effects.centrifugal);
        for node in &of.inertias {
            sums[*node] += inertia.rigid_force(*node, &accelerations(*node));
        }
        sums
    }

    /// Per node: its acceleration, gravity taken off.
    pub fn loaded_accelerations(&self) -> Vec<Six<T>> {
        self.inertia(self.effects.centrifugal).body_accelerations()
    }

    /// The same without gravity.
    pub fn free_accelerations(&self) -> Vec<Six<T>> {
        let all = InertiaInput { gravity: None, ..self.inertia(true) };
        all.body_accelerations()
    }

    /// A wrench about the centre of mass of a node, by all columns that move it.
    pub fn spread(&self, node: usize, wrench: Six<T>, mut to: impl FnMut(usize, T)) {
        let (mut at, mut w) = (node, wrench);
        loop {
            let spec = &self.topology.nodes[at];
            for d in spec.first..spec.first + spec.n {
                to(d, self.placement.column[d].dot(&w));
            }
            let Some(parent) = spec.parent else { return };
            w = w.wrench_at(&(self.placement.pose[parent].p - self.placement.pose[at].p));
            at = parent;
        }
    }
}
