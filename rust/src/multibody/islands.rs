//! Islands: bodies that joints, elements, couplers or constraints connect, ground left out. No force passes from one to another, so that what counts
//! as rounding of one does not depend on the others.
use crate::model::tables::{BodyRef, Tables};
use crate::multibody::assemble::Scene;
use crate::multibody::connector::{Wanted, interaction, load_interaction};
use crate::multibody::topology::{Connector, Node, Topology};
use crate::spatial::{Real, Six, V3};

/// The island of each node, counted from zero.
pub fn islands(tables: &Tables, nodes: &[Node], node_of_body: &[usize], connectors: &[Connector]) -> Vec<usize> {
    let mut root: Vec<usize> = (0..nodes.len()).collect();
    let mut join = |i: usize, j: usize| {
        let (a, b) = (find(&mut root, i), find(&mut root, j));
        root[a.max(b)] = a.min(b);
    };
    let bodies = |ends: [BodyRef; 2]| ends.into_iter().flatten().map(|b| node_of_body[b]).collect::<Vec<_>>();
    for (i, node) in nodes.iter().enumerate() {
        node.parent.into_iter().for_each(|p| join(i, p));
    }
    let joints = tables.joints.iter().map(|j| bodies([j.a, j.b]));
    let elastic = connectors.iter().map(|c| bodies([c.a, c.b]));
    let coupled = tables.couplers.iter().map(|c| {
        let ends = c.joints.iter().flat_map(|j| bodies([tables.joints[*j].a, tables.joints[*j].b]));
        ends.collect::<Vec<_>>()
    });
    let bound = (0..tables.constraints.len()).map(|c| {
        let ends = tables.motions_of(c).flat_map(|(j, _)| bodies([tables.joints[j].a, tables.joints[j].b]));
        ends.collect::<Vec<_>>()
    });
    for ends in joints.chain(elastic).chain(coupled).chain(bound) {
        ends.windows(2).for_each(|pair| join(pair[0], pair[1]));
    }
    let roots: Vec<usize> = (0..nodes.len()).map(|i| find(&mut root, i)).collect();
    let mut first: Vec<usize> = roots.clone();
    first.sort_unstable();
    first.dedup();
    roots.iter().map(|r| first.partition_point(|f| f < r)).collect()
}

fn find(root: &mut [usize], mut i: usize) -> usize {
    while root[i] != i {
        root[i] = root[root[i]];
        i = root[i];
    }
    i
}

impl Topology {
    /// The island of a tree coordinate.
    pub fn island_of(&self, coordinate: usize) -> usize {
        self.island[self.dofs[coordinate].node]
    }

    pub fn n_islands(&self) -> usize {
        self.island.iter().max().map_or(0, |i| i + 1)
    }
}

/// Sizes of the force and of the moment of a wrench.
#[derive(Debug, Clone, Copy)]
pub struct Acting {
    pub force: f64,
    pub moment: f64,
}

fn size<T: Real>(w: &Six<T>) -> Acting {
    Acting { force: w.l.map(|v| v.re()).norm(), moment: w.a.map(|v| v.re()).norm() }
}

impl<T: Real> Scene<'_, T> {
    /// All forces at work, weight and inertia, loads, air, connectors: the nodes that each acts on, the point about which its moment
    /// counts, and its size.
    pub(crate) fn each_force(&self, mut visit: impl FnMut([Option<usize>; 2], &V3<T>, Acting)) {
        self.each_load(&mut visit);
        self.each_connector(&mut visit);
    }

    /// All of them but connectors.
    fn each_load(&self, visit: &mut impl FnMut([Option<usize>; 2], &V3<T>, Acting)) {
        let topology = self.topology;
        let inertia = self.inertia(self.effects.centrifugal).forces().unwrap_or_default();
        for (node, w) in inertia.iter().enumerate() {
            visit([Some(node), None], &self.placement.pose[node].p, size(w));
        }
        let wanted = self.effects.wanted();
        for (i, load) in topology.tables.loads.iter().enumerate().filter(|(_, l)| l.mode.is_none()) {
            let acting = load_interaction(topology, self.geometry, self.placement, i, self.t, wanted);
            visit([Some(topology.node_of_body[load.body]), None], &acting.point, size(&acting.wrench));
        }
        for acting in self.air_forces() {
            visit([topology.node(acting.b), None], &acting.point, size(&acting.wrench));
        }
    }

    fn each_connector(&self, visit: &mut impl FnMut([Option<usize>; 2], &V3<T>, Acting)) {
        let topology = self.topology;
        for c in &topology.connectors {
            let acting = interaction(topology, self.geometry, self.placement, self.numbers(), c, Wanted::FORCES);
            visit([topology.node(c.a), topology.node(c.b)], &acting.point, size(&acting.wrench));
        }
    }

    /// The sum of the sizes of all forces at work in each island, moments over a length, and whether any of them is a load.
    pub fn force_sizes(&self, length: f64) -> (Vec<f64>, Vec<bool>) {
        let mut sizes = vec![0.0; self.topology.n_islands()];
        self.each_load(&mut self.adding(&mut sizes, length));
        let are_loaded = sizes.iter().map(|s| *s > 0.0).collect();
        self.each_connector(&mut self.adding(&mut sizes, length));
        (sizes, are_loaded)
    }

    /// Adds the size of each force to that of its island.
    fn adding(&self, sizes: &mut [f64], length: f64) -> impl FnMut([Option<usize>; 2], &V3<T>, Acting) {
        let topology = self.topology;
        move |nodes, _, acting| {
            if let Some(node) = nodes[0].or(nodes[1]) {
                sizes[topology.island[node]] += acting.force * length + acting.moment;
            }
        }
    }
}
