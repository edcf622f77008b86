//! Where everything is in a state: poses of the centres of mass, the motion column of every tree coordinate, velocities.
use crate::model::geometry::{Geometry, MarkerPair};
use crate::model::tables::BodyRef;
use crate::multibody::flexible::{deformed, modal_coordinates, node_columns, node_rates, node_values};
use crate::multibody::topology::{Node, Topology};
use crate::spatial::{M3, Pose, Real, Six, V3, lift};

/// A state of the model: coordinates q of the joints by node (`crate::joint`), then modal coordinates, and the rates of the tree
/// coordinates. Loops are closed to the accuracy that assembly reached.
#[derive(Debug, Clone)]
pub struct State {
    pub q: Vec<f64>,
    /// empty at rest
    pub rate: Vec<f64>,
}

impl State {
    pub fn moving(&self) -> bool {
        self.rate.iter().any(|r| *r != 0.0)
    }
}

#[derive(Debug, Clone)]
pub struct Placement<T: Real> {
    pub q: Vec<T>,
    /// per node: pose of the centre of mass in the world
    pub pose: Vec<Pose<T>>,
    /// per tree coordinate: the twist it gives its body, at the body's centre of mass, world axes
    pub column: Vec<Six<T>>,
    pub velocity: Option<Velocity<T>>,
    /// modal coordinates of all flexible bodies, in the order of tree coordinates
    pub modal: Vec<T>,
    /// how far the two angles of each marker pair have turned, where q does not tell
    pub turns: Option<Vec<[f64; 2]>>,
}

#[derive(Debug, Clone)]
pub struct Velocity<T: Real> {
    /// per node: twist at the centre of mass
    pub body: Vec<Six<T>>,
    /// per tree coordinate: twist, at its body's centre of mass, of the frame that carries its axis
    pub before: Vec<Six<T>>,
    /// rates of the columns of moving nodes
    pub nodes: Vec<T>,
}

impl<T: Real> Velocity<T> {
    /// The rate of a column.
    pub fn of(&self, rate: &[T], column: usize) -> T {
        rate.get(column).copied().unwrap_or_else(|| self.nodes[column - rate.len()])
    }
}

/// The markers of a node's joint on its inner and on its outer body.
fn inner_outer<T: Real>(pair: &MarkerPair<T>, reversed: bool) -> (&Pose<T>, &Pose<T>) {
    if reversed { (&pair.b, &pair.a) } else { (&pair.a, &pair.b) }
}

pub(crate) fn markers<T: Real>(topology: &Topology, geometry: &Geometry<T>, node: &Node) -> (Pose<T>, Pose<T>) {
    if node.kind.is_modal() {
        let rest = Pose { p: geometry.tips[topology.tip(node)].offset, r: M3::identity() };
        let own = Pose::identity();
        return if node.reversed { (own, rest) } else { (rest, own) };
    }
    match node.joint {
        // an implicit free joint: world axes at the drawn centre of mass
        None => {
            let drawn = &geometry.bodies[node.body].drawn;
            (Pose { p: drawn.p, r: M3::identity() }, Pose { p: V3::zeros(), r: drawn.r.transpose() })
        }
        Some(j) => {
            let (inner, outer) = inner_outer(&geometry.joints[j], node.reversed);
            (*inner, *outer)
        }
    }
}

/// The drawn coordinates: zero but for two-point joints, of which the free translations are kept.
pub fn drawn_q<T: Real>(topology: &Topology, geometry: &Geometry<T>) -> Vec<T> {
    let drawn = |body: BodyRef| body.map_or_else(Pose::identity, |b| geometry.bodies[b].drawn);
    let mut q = Vec::with_capacity(topology.n_q);
    for node in &topology.nodes {
        q.extend(node.kind.identity::<T>());
        let Some(j) = node.joint else { continue };
        let joint = &topology.tables.joints[j];
        let (pa, pb) = (drawn(joint.a).then(&geometry.joints[j].a), drawn(joint.b).then(&geometry.joints[j].b));
        let (inner, outer) = if node.reversed { (pb, pa) } else { (pa, pb) };
        let u = inner.r.transpose() * (outer.p - inner.p);
        for (k, f) in node.kind.freedoms(node.reversed).iter().enumerate().filter(|(_, f)| !f.rotation) {
            q[node.q + k] = u[f.axis] * T::from(node.sign());
        }
    }
    q.resize(topology.n_q, T::zero());
    q
}

/// The coordinates of each node's joint from given poses of the centres of mass (per body), as far as the joint allows them.
pub fn coordinates_of_poses(topology: &Topology, geometry: &Geometry<f64>, poses: &[Pose<f64>]) -> Vec<Vec<f64>> {
    let coordinates = |node: &Node| {
        let (inner_marker, outer_marker) = markers(topology, geometry, node);
        let carrier = node.parent.map_or_else(Pose::identity, |p| poses[topology.nodes[p].body]);
        let found = carrier.then(&inner_marker).inverse().then(&poses[node.body].then(&outer_marker));
        node.kind.coordinates(&found, node.reversed, node.joint.map_or(0.0, |j| geometry.joints[j].pitch))
    };
    topology.nodes.iter().map(coordinates).collect()
}

/// The coordinates of a state over T: constant but for the drawn two-point offsets, which follow the geometry.
pub fn lifted_q<T: Real>(topology: &Topology, geometry: &Geometry<T>, state: &State) -> Vec<T> {
    let drawn = drawn_q(topology, geometry);
    state.q.iter().zip(drawn).map(|(q, drawn)| drawn - drawn.re() + *q).collect()
}

/// Advance coordinates by increments of the tree coordinates.
pub fn advance<T: Real>(topology: &Topology, q: &mut [T], dy: &[T]) {
    for node in &topology.nodes {
        let own = &mut q[node.q..node.q + node.kind.nq()];
        if !own.is_empty() {
            node.kind.integrate(node.reversed, own, &dy[node.first..node.first + node.n]);
        }
    }
    for modal in &topology.modal {
        let own = q[modal.q..].iter_mut().zip(&dy[modal.first..modal.first + modal.m]);
        own.for_each(|(q, d)| *q += *d);
    }
}

/// The increments that lead from one q to another; three rotations together are at most half a turn.
pub fn difference<T: Real>(topology: &Topology, from: &[T], to: &[T]) -> Vec<T> {
    let mut out = vec![T::zero(); topology.n_tree];
    for node in topology.nodes.iter().filter(|n| n.kind.nq() > 0) {
        let own = node.q..node.q + node.kind.nq();
        let out = &mut out[node.first..node.first + node.n];
        node.kind.difference(node.reversed, &from[own.clone()], &to[own], out);
    }
    for modal in &topology.modal {
        for k in 0..modal.m {
            out[modal.first + k] = to[modal.q + k] - from[modal.q + k];
        }
    }
    out
}

/// Poses, motion columns and (if `rate` is given) velocities.
pub fn place<T: Real>(topology: &Topology, geometry: &Geometry<T>, q: &[T], rate: Option<&[T]>) -> Placement<T> {
    let n = topology.nodes.len();
    let mut pose: Vec<Pose<T>> = Vec::with_capacity(n);
    let mut column = vec![Six::zero(); topology.dofs.len()];
    let modal = modal_coordinates(topology, q);
    for node in &topology.nodes {
        let (inner_marker, outer_marker) = markers(topology, geometry, node);
        let carrier = node.parent.map_or_else(Pose::identity, |p| pose[p]);
        let inner = carrier.then(&inner_marker);
        if node.kind.is_modal() {
            let w = node_values(topology, geometry, node, &modal);
            let moved = inner.then(&deformed(&w, node.reversed)).then(&outer_marker.inverse());
            let frame = if node.reversed { &moved } else { &carrier };
            let tip = if node.reversed { &inner } else { &moved };
            let own = &mut column[node.first..node.first + 6];
            node_columns(frame, &tip.p, &moved.p, &w, node.reversed, own);
            pose.push(moved);
            continue;
        }
        let pitch = node.joint.map_or_else(T::zero, |j| geometry.joints[j].pitch);
        let relative = node.kind.pose(&q[node.q..node.q + node.kind.nq()], node.reversed, pitch);
        let outer = inner.then(&relative);
        let body = outer.then(&outer_marker.inverse());
        let arm = body.p - outer.p;
        let sign = lift::<T>(if node.reversed { -1.0 } else { 1.0 });
        for (k, freedom) in node.kind.freedoms(node.reversed).iter().enumerate() {
            let frame = if freedom.outer { &outer.r } else { &inner.r };
            let axis: V3<T> = frame.column(freedom.axis) * sign;
            column[node.first + k] = freedom.twist(&axis, &arm, pitch);
        }
        pose.push(body);
    }
    let velocity = rate.map(|rate| {
        let nodes = node_rates(topology, geometry, &modal, rate);
        velocities(topology, &pose, &column, rate, nodes)
    });
    Placement { q: q.to_vec(), pose, column, velocity, modal, turns: None }
}

/// The same place in a topology without joints in its tree: each body with its own six columns, translations and rotations of its
/// centre of mass in world axes, each node of a flexible body behind its frame.
pub fn place_free(
    free: &Topology,
    topology: &Topology,
    geometry: &Geometry<f64>,
    placement: &Placement<f64>,
    rate: Option<&[f64]>,
) -> Placement<f64> {
    let place = |body: usize| topology.node_of_body[body];
    let pose: Vec<_> = free.nodes.iter().map(|n| placement.pose[place(n.body)]).collect();
    let mut column = vec![Six::zero(); free.dofs.len()];
    for (i, node) in free.nodes.iter().enumerate() {
        let own = &mut column[node.first..node.first + node.n];
        if !node.kind.is_modal() {
            for (k, freedom) in node.kind.freedoms(false).iter().enumerate() {
                let axis = M3::identity().column(freedom.axis).into_owned();
                own[k] = freedom.twist(&axis, &V3::zeros(), 0.0);
            }
            continue;
        }
        let w = node_values(free, geometry, node, &placement.modal);
        let carrier = node.parent.map_or_else(Pose::identity, |p| pose[p]);
        let rest = carrier.then(&markers(free, geometry, node).0);
        let (frame, tip) = if node.reversed { (&pose[i], &rest.p) } else { (&carrier, &pose[i].p) };
        node_columns(frame, tip, &pose[i].p, &w, node.reversed, own);
    }
    let velocity = rate.zip(placement.velocity.as_ref()).map(|(rate, v)| {
        let rate = free_rates(free, topology, rate, v);
        let nodes = node_rates(free, geometry, &placement.modal, &rate);
        velocities(free, &pose, &column, &rate, nodes)
    });
    let pairs = topology.tables.joints.len() + topology.tables.elements.len();
    let turns = Some((0..pairs).map(|pair| placement.turned(topology, pair)).collect());
    Placement { q: Vec::new(), pose, column, velocity, modal: placement.modal.clone(), turns }
}

/// Rates of the coordinates of `place_free`.
pub fn free_rates(free: &Topology, topology: &Topology, rate: &[f64], velocity: &Velocity<f64>) -> Vec<f64> {
    let mut out = vec![0.0; free.n_tree];
    for node in free.nodes.iter().filter(|n| !n.kind.is_modal()) {
        let v = &velocity.body[topology.node_of_body[node.body]];
        (0..6).for_each(|k| out[node.first + k] = v.get(k));
    }
    for (own, given) in free.modal.iter().zip(&topology.modal) {
        out[own.first..own.first + own.m].copy_from_slice(&rate[given.first..given.first + given.m]);
    }
    out
}

impl<T: Real> Placement<T> {
    /// About how far the two angles of a marker pair have turned.
    pub(crate) fn turned(&self, topology: &Topology, pair: usize) -> [f64; 2] {
        self.turns.as_ref().map_or_else(|| topology.turned(&self.q, pair), |all| all[pair])
    }

    /// The same place at other rates.
    pub fn at_rates(mut self, topology: &Topology, geometry: &Geometry<T>, rate: &[T]) -> Self {
        let nodes = node_rates(topology, geometry, &self.modal, rate);
        self.velocity = Some(velocities(topology, &self.pose, &self.column, rate, nodes));
        self
    }
}

fn velocities<T: Real>(
    topology: &Topology,
    pose: &[Pose<T>],
    column: &[Six<T>],
    rate: &[T],
    nodes: Vec<T>,
) -> Velocity<T> {
    let mut body: Vec<Six<T>> = Vec::with_capacity(pose.len());
    let mut before = vec![Six::zero(); column.len()];
    let of = |d: usize| {
        if d < rate.len() { rate[d] } else { nodes[d - rate.len()] }
    };
    for (i, node) in topology.nodes.iter().enumerate() {
        let mut v = node.parent.map_or_else(Six::zero, |p| body[p].motion_at(&(pose[i].p - pose[p].p)));
        let dofs = node.first..node.first + node.n;
        for stage in 0..node.kind.stages() {
            let carried = v;
            for d in dofs.clone().filter(|d| topology.dofs[*d].freedom.stage == stage) {
                before[d] = carried;
                v += column[d].scaled(of(d));
            }
        }
        body.push(v);
    }
    Velocity { body, before, nodes }
}

/// World pose of a marker that is given in the frame of its body's centre of mass.
pub fn marker_pose<T: Real>(topology: &Topology, pose: &[Pose<T>], body: BodyRef, local: &Pose<T>) -> Pose<T> {
    topology.node(body).map_or(*local, |node| pose[node].then(local))
}
