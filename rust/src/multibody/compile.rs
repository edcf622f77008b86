//! From Tables to the topology: spanning tree, coordinates and their names, rows of cut joints and of what is imposed, connectors.
use crate::error::{Error, Result};
use crate::joint::MODAL;
use crate::model::geometry::{Geometry, MarkerPair};
use crate::model::layout::{self};
use crate::model::tables::{BodyRef, Tables};
use crate::multibody::binding::connectors;
use crate::multibody::islands::islands;
use crate::multibody::topology::{ConstraintRow, Dof, Level, Modal, Node, Purpose, Topology, Turning};
use crate::multibody::tree::spanning_tree;
use crate::spatial::{M3, V3};
use crate::tolerances::coordinates::NEARLY_PARALLEL;

impl Topology {
    /// Checks that there are bodies, and compiles. O(n) without loops.
    pub fn new(tables: Tables) -> Result<Self> {
        if tables.bodies.is_empty() {
            return Err(Error::model("the model has no body: add one with m.body(...)"));
        }
        let (nodes, cut) = spanning_tree(&tables);
        let mut node_of_body = vec![0; nodes.len()];
        let mut dofs = Vec::new();
        let mut names = Vec::new();
        for (i, node) in nodes.iter().enumerate() {
            node_of_body[node.body] = i;
            if node.kind.is_modal() {
                continue;
            }
            let freedoms = node.kind.freedoms(node.reversed);
            let stem = node.joint.map_or(&tables.bodies[node.body].name, |j| &tables.joints[j].name);
            for freedom in freedoms {
                names.push(if freedoms.len() == 1 { stem.clone() } else { format!("{stem}.{}", freedom.suffix) });
                dofs.push(Dof { node: i, freedom: *freedom, sign: node.sign() });
            }
        }
        let mut nodes = nodes;
        let modal = flexible(&tables, &mut nodes, &node_of_body, &mut dofs, &mut names);
        let n_tree = names.len();
        let mut rows: Vec<_> = cut.iter().flat_map(|j| cut_rows(&tables, *j)).collect();
        rows.extend(imposed_rows(&tables));
        let (connectors, of_laws) = connectors(&tables)?;
        let mut air_memory = vec![of_laws];
        for section in &tables.sections {
            air_memory.push(air_memory[air_memory.len() - 1] + tables.air[section.air].unsteady.memory());
        }
        let island = islands(&tables, &nodes, &node_of_body, &connectors);
        let n_q = nodes.iter().map(|n| n.kind.nq()).sum::<usize>() + modal.iter().map(|m| m.m).sum::<usize>();
        let mut made = Topology {
            tables,
            nodes,
            node_of_body,
            island,
            dofs,
            n_tree,
            modal,
            names,
            cut,
            rows,
            connectors,
            n_q,
            n_memory: air_memory[air_memory.len() - 1],
            air_memory,
            turning: Vec::new(),
        };
        // without a tree no hinge has a coordinate
        made.turning = match made.tables.absolute {
            true => vec![Default::default(); made.tables.joints.len() + made.tables.elements.len()],
            false => made.turning_hinges(),
        };
        Ok(made)
    }

    /// Hinges between two bodies whose drawn axes are nearly that of an angle between them turn it with themselves: their sum tells
    /// on which turn the angle is, where only its sine and cosine are known.
    fn turning_hinges(&self) -> Vec<[Turning; 2]> {
        let tables = &self.tables;
        let geometry = Geometry::<f64>::derive(tables, &tables.x);
        let drawn = |body: BodyRef| body.map_or_else(M3::identity, |b| geometry.bodies[b].drawn.r);
        let hinges = |a: BodyRef, b: BodyRef, axis: &V3<f64>| -> Turning {
            let own = |(n, of_b): (usize, bool)| {
                let node = &self.nodes[n];
                (node.first..node.first + node.n).map(move |d| (d, of_b))
            };
            let dofs = self.sides_between(a, b).into_iter().flat_map(own);
            dofs.filter_map(|(d, of_b)| {
                let dof = &self.dofs[d];
                let node = &self.nodes[dof.node];
                let frame = self.hinge_frame(node, dof, &geometry)?;
                let along = (drawn(frame.0) * frame.1).column(dof.freedom.axis).dot(axis);
                let sign = if of_b { dof.sign } else { -dof.sign };
                (along.abs() > NEARLY_PARALLEL).then(|| (d, sign * along.signum()))
            })
            .collect()
        };
        let pairs = geometry.joints.iter().chain(&geometry.elements);
        let ends = tables.joints.iter().map(|j| (j.a, j.b)).chain(tables.elements.iter().map(|e| (e.a, e.b)));
        let of = |(pair, (a, b)): (&MarkerPair<f64>, (BodyRef, BodyRef))| {
            let axes = drawn(a) * pair.a.r;
            [2, 0].map(|k| hinges(a, b, &axes.column(k).into_owned()))
        };
        pairs.zip(ends).map(of).collect()
    }

    /// Body and drawn marker of a hinge of the tree, whose coordinate is a number.
    fn hinge_frame(&self, node: &Node, dof: &Dof, geometry: &Geometry<f64>) -> Option<(BodyRef, M3<f64>)> {
        let joint = node.joint.filter(|_| dof.freedom.rotation && node.kind.quaternion().is_none())?;
        Some((self.tables.joints[joint].a, geometry.joints[joint].a.r))
    }
}

fn cut_rows(tables: &Tables, joint: usize) -> Vec<ConstraintRow> {
    let row = |coordinate, level| ConstraintRow { joint, coordinate, level, purpose: Purpose::Joint };
    let kind = tables.joints[joint].kind;
    let position = kind.constraints().iter().map(|c| row(*c, Level::Position));
    position.chain(kind.velocity_constraints().iter().map(|c| row(*c, Level::Velocity))).collect()
}

/// Rows of drives, of couplers, then of functions: on coordinates of tree joints and of cut joints alike.
fn imposed_rows(tables: &Tables) -> Vec<ConstraintRow> {
    let row = |joint: usize, coordinate: usize, purpose| ConstraintRow {
        joint,
        coordinate: tables.joints[joint].kind.free_coordinates()[coordinate],
        level: Level::Position,
        purpose,
    };
    let drives = tables.drives.iter().enumerate();
    let couplers = tables.couplers.iter().enumerate();
    let mut rows: Vec<_> = drives
        .map(|(i, d)| row(d.joint, d.coordinate, Purpose::Drive(i)))
        .chain(couplers.map(|(i, c)| row(c.joints[1], c.coordinates[1], Purpose::Coupler(i))))
        .collect();
    for (i, constraint) in tables.constraints.iter().enumerate() {
        let level = if constraint.function.of_velocities() { Level::Velocity } else { Level::Position };
        let (joint, coordinate) = constraint.motions[0];
        let one = ConstraintRow { level, ..row(joint, coordinate, Purpose::Constraint(i)) };
        rows.extend(std::iter::repeat_n(one, constraint.function.n_rows()));
    }
    rows
}

/// Modal coordinates behind those of the joints, and behind them the columns of moving nodes.
fn flexible(
    tables: &Tables,
    nodes: &mut [Node],
    node_of_body: &[usize],
    dofs: &mut Vec<Dof>,
    names: &mut Vec<String>,
) -> Vec<Modal> {
    let mut all = Vec::new();
    let mut q: usize = nodes.iter().map(|n| n.kind.nq()).sum();
    for spec in &tables.flexible {
        let node = node_of_body[spec.body];
        let body = &tables.bodies[spec.body];
        let (mass, m) = (tables.x[body.x + layout::body::MASS], spec.m);
        let size = |k: usize| {
            let p2 = spec.x + layout::flexible::p2(m) + 9 * (k * m + k);
            let modal = tables.x[p2] + tables.x[p2 + 4] + tables.x[p2 + 8];
            if modal > 0.0 { (modal / mass).sqrt() } else { 1.0 }
        };
        all.push(Modal { node, first: names.len(), m, q, size: (0..m).map(size).collect() });
        q += m;
        for k in 0..m {
            names.push(format!("{}.q{}", body.name, k + 1));
            dofs.push(Dof { node, freedom: MODAL, sign: 1.0 });
        }
    }
    for (i, node) in nodes.iter_mut().enumerate().filter(|(_, n)| n.kind.is_modal()) {
        node.first = dofs.len();
        dofs.extend(node.kind.freedoms(node.reversed).iter().map(|freedom| Dof {
            node: i,
            freedom: *freedom,
            sign: node.sign(),
        }));
    }
    all
}
