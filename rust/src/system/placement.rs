//! Where everything is in a state: poses of the centres of mass, the motion column of every tree coordinate, velocities.
use crate::joint::JointKind;
use crate::model::geometry::{Geometry, MarkerPair};
use crate::model::tables::BodyRef;
use crate::spatial::{M3, Pose, Real, Six, V3, exp_so3, lift, product};
use crate::system::flexible::{deformed, modal_coordinates, node_columns, node_rates, node_values};
use crate::system::topology::{Node, Topology};

/// A state of the model: the relative pose of each tree joint (outer marker in the inner marker's frame), and the rates of
/// the tree coordinates. Loops are closed to the accuracy that assembly reached.
#[derive(Debug, Clone)]
pub struct State {
    pub relative: Vec<Pose<f64>>,
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
    /// per node: pose of the centre of mass in the world
    pub pose: Vec<Pose<T>>,
    /// per tree coordinate: the twist it gives its body, at the body's centre of mass, world axes
    pub column: Vec<Six<T>>,
    pub velocity: Option<Velocity<T>>,
    /// modal coordinates of all flexible bodies, in the order of tree coordinates
    pub modal: Vec<T>,
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

fn markers<T: Real>(topology: &Topology, geometry: &Geometry<T>, node: &Node) -> (Pose<T>, Pose<T>) {
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

/// The drawn relative pose of each tree joint: zero but for two-point joints, of which the free translations are kept.
pub fn drawn_relative<T: Real>(topology: &Topology, geometry: &Geometry<T>) -> Vec<Pose<T>> {
    let drawn = |body: BodyRef| body.map_or_else(Pose::identity, |b| geometry.bodies[b].drawn);
    let relative = |node: &Node| {
        let Some(j) = node.joint else {
            return Pose::identity();
        };
        let joint = &topology.tables.joints[j];
        let (pa, pb) = (drawn(joint.a).then(&geometry.joints[j].a), drawn(joint.b).then(&geometry.joints[j].b));
        let (inner, outer) = if node.reversed { (pb, pa) } else { (pa, pb) };
        let u = inner.r.transpose() * (outer.p - inner.p);
        let mut kept = V3::zeros();
        for f in node.kind.freedoms(node.reversed).iter().filter(|f| !f.rotation) {
            kept[f.axis] = u[f.axis];
        }
        Pose { p: kept, r: M3::identity() }
    };
    let mut all: Vec<_> = topology.nodes.iter().map(relative).collect();
    all.resize(topology.n_poses(), Pose::identity());
    all
}

/// The relative pose of each tree joint from given poses of the centres of mass (per body), as far as the joint allows it.
pub fn relative_from_poses(topology: &Topology, geometry: &Geometry<f64>, poses: &[Pose<f64>]) -> Vec<Pose<f64>> {
    let relative = |node: &Node| {
        let (inner_marker, outer_marker) = markers(topology, geometry, node);
        let carrier = node.parent.map_or_else(Pose::identity, |p| poses[topology.nodes[p].body]);
        let found = carrier.then(&inner_marker).inverse().then(&poses[node.body].then(&outer_marker));
        allowed(node, &found)
    };
    topology.nodes.iter().map(relative).collect()
}

/// The part of a relative pose that a joint's freedoms can make.
fn allowed(node: &Node, found: &Pose<f64>) -> Pose<f64> {
    let mut p = V3::zeros();
    for f in node.kind.freedoms(node.reversed).iter().filter(|f| !f.rotation) {
        p[f.axis] = found.p[f.axis];
    }
    let r = &found.r;
    let about = |axis: usize, angle: f64| {
        let mut w = V3::zeros();
        w[axis] = angle;
        exp_so3(&w)
    };
    let r = match node.kind {
        JointKind::Free | JointKind::Spherical => *r,
        JointKind::Revolute | JointKind::Cylindrical | JointKind::Planar => about(2, r[(1, 0)].atan2(r[(0, 0)])),
        JointKind::Universal => {
            // R = Rz(alpha) Rx(beta) from a to b; a reversed joint holds its transpose
            let ab = if node.reversed { r.transpose() } else { *r };
            let ab = about(2, ab[(1, 0)].atan2(ab[(0, 0)])) * about(0, ab[(2, 1)].atan2(ab[(2, 2)]));
            if node.reversed { ab.transpose() } else { ab }
        }
        _ => M3::identity(),
    };
    Pose { p, r }
}

/// The relative poses of a state over T: constant but for the drawn two-point offsets, which follow the geometry.
pub fn lifted_relative<T: Real>(topology: &Topology, geometry: &Geometry<T>, state: &State) -> Vec<Pose<T>> {
    let drawn = drawn_relative(topology, geometry);
    state
        .relative
        .iter()
        .zip(drawn)
        .map(|(pose, drawn)| {
            let lifted = Pose::<f64>::lifted::<T>(pose);
            Pose { p: lifted.p + drawn.p.map(|x| x - x.re()), r: lifted.r }
        })
        .collect()
}

/// Advance relative poses by increments of the tree coordinates.
pub fn advance<T: Real>(topology: &Topology, relative: &mut [Pose<T>], dy: &[T]) {
    for (node, pose) in topology.nodes.iter().zip(relative.iter_mut()) {
        if !node.kind.is_modal() {
            advance_joint(node, pose, &dy[node.first..node.first + node.n]);
        }
    }
    for modal in &topology.modal {
        for k in 0..modal.m {
            relative[modal.pose + k / 3].p[k % 3] += dy[modal.first + k];
        }
    }
}

fn advance_joint<T: Real>(node: &Node, pose: &mut Pose<T>, dy: &[T]) {
    let sign = lift::<T>(if node.reversed { -1.0 } else { 1.0 });
    let mut inner: V3<T> = V3::zeros();
    let mut outer: V3<T> = V3::zeros();
    for (freedom, d) in node.kind.freedoms(node.reversed).iter().zip(dy) {
        let d = *d * sign;
        match (freedom.rotation, freedom.outer) {
            (false, _) => pose.p[freedom.axis] += d,
            (true, false) => inner[freedom.axis] += d,
            (true, true) => outer[freedom.axis] += d,
        }
    }
    pose.r = product(&exp_so3(&inner), &pose.r);
    if node.kind == JointKind::Universal {
        pose.r = product(&pose.r, &exp_so3(&outer));
    }
}

/// Poses, motion columns and (if `rate` is given) velocities.
pub fn place<T: Real>(
    topology: &Topology,
    geometry: &Geometry<T>,
    relative: &[Pose<T>],
    rate: Option<&[T]>,
) -> Placement<T> {
    let n = topology.nodes.len();
    let mut pose: Vec<Pose<T>> = Vec::with_capacity(n);
    let mut column = vec![Six::zero(); topology.dofs.len()];
    let modal = modal_coordinates(topology, relative);
    for (i, node) in topology.nodes.iter().enumerate() {
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
        let outer = inner.then(&relative[i]);
        let body = outer.then(&outer_marker.inverse());
        let arm = body.p - outer.p;
        let sign = lift::<T>(if node.reversed { -1.0 } else { 1.0 });
        for (k, freedom) in node.kind.freedoms(node.reversed).iter().enumerate() {
            let frame = if freedom.outer { &outer.r } else { &inner.r };
            let axis: V3<T> = frame.column(freedom.axis) * sign;
            column[node.first + k] =
                if freedom.rotation { Six::new(axis.cross(&arm), axis) } else { Six::new(axis, V3::zeros()) };
        }
        pose.push(body);
    }
    let velocity = rate.map(|rate| {
        let nodes = node_rates(topology, geometry, rate);
        velocities(topology, &pose, &column, rate, nodes)
    });
    Placement { pose, column, velocity, modal }
}

impl<T: Real> Placement<T> {
    /// The same place at other rates.
    pub fn at_rates(mut self, topology: &Topology, geometry: &Geometry<T>, rate: &[T]) -> Self {
        let nodes = node_rates(topology, geometry, rate);
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
