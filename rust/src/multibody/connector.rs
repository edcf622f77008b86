//! Forces and tangents of everything between two markers.
//!
//! A connector makes a wrench W on b about the fixed point where p_B is now, and the opposite on a. Its tangent by the relative
//! twist xi is dW = K xi + C xi' with K = -sum g k g^T (kept as the gradients g and k, so that what has no stiffness has none but
//! for rounding of single products) and terms proportional to the force. Constraint rows are connectors whose force is the
//! multiplier. `path` spreads both over the tree coordinates.

use crate::joint::Coordinate;
use crate::kinematics::relative::{Relative, Row};
use crate::model::geometry::{Geometry, MarkerPair};
use crate::model::tables::{BodyRef, ElementKind};
use crate::multibody::connector_force::response;
use crate::multibody::numbers::Numbers;
use crate::multibody::placement::{Placement, marker_pose};
use crate::multibody::topology::{Connector, Natural, Owner, Topology};
pub use crate::multibody::wanted::Wanted;
use crate::spatial::{Map6, Pose, Real, Six, V3, absent, product_of_transpose, skew, turned, turned_back};
use crate::tolerances::coordinates::SAME_POINT;
use crate::tolerances::matrices::ENTRY_ROUNDING;

/// A wrench on b about the current place of p_B (world axes), the opposite on a; tangents where they were asked for.
#[derive(Debug, Clone)]
pub struct Interaction<T: Real> {
    pub a: BodyRef,
    pub b: BodyRef,
    pub point: V3<T>,
    pub wrench: Six<T>,
    /// does its force depend on the rate?
    pub damped: bool,
    /// gradients of the coordinates (world axes) with their slopes; None of given forces
    pub elastic: Option<Elastic<T>>,
    /// K without the elastic part, and C
    pub tangent: Option<(Map6<T>, Map6<T>)>,
}

/// Slopes of up to six forces by as many coordinates and their rates.
#[derive(Debug, Clone)]
pub struct Elastic<T: Real> {
    pub gradients: Vec<Six<T>>,
    pub k: [[T; 6]; 6],
    pub c: [[T; 6]; 6],
}

/// Differences of places are known to this part of the places, after the rotations along a short path.
const ROUNDING: f64 = 32.0 * f64::EPSILON;

pub(crate) fn pair_of<T: Real>(geometry: &Geometry<T>, owner: Owner) -> &MarkerPair<T> {
    match owner {
        Owner::Element(i) => &geometry.elements[i],
        Owner::Joint(i) => &geometry.joints[i],
    }
}

/// Two markers as they are, and how they move against each other.
pub(crate) struct Local<T: Real> {
    pub a: Pose<T>,
    pub b: Pose<T>,
    pub relative: Relative<T>,
    /// relative twist at p_B in the axes of A; None at rest
    pub twist: Option<Six<T>>,
}

impl<T: Real> Local<T> {
    /// The size of what is subtracted for a coordinate: places, or a radian.
    fn place(&self, coordinate: Coordinate) -> f64 {
        let far = |p: &V3<T>| p.iter().map(|v| v.re().abs()).fold(0.0, f64::max);
        match coordinate {
            Coordinate::Translation(_) | Coordinate::Length => far(&self.a.p) + far(&self.b.p) + far(&self.relative.u),
            _ => 1.0,
        }
    }
}

pub(crate) fn local<T: Real>(
    topology: &Topology,
    placement: &Placement<T>,
    a: BodyRef,
    b: BodyRef,
    pair: &MarkerPair<T>,
) -> Local<T> {
    let pa = marker_pose(topology, &placement.pose, a, &pair.a);
    let pb = marker_pose(topology, &placement.pose, b, &pair.b);
    let relative = relative_between(&pa, &pb, pair, placement, topology);
    let twist = placement.velocity.as_ref().map(|velocity| {
        let at = |body: BodyRef| {
            topology.node(body).map_or_else(Six::zero, |n| velocity.body[n].motion_at(&(pb.p - placement.pose[n].p)))
        };
        (at(b) - at(a)).rotated_back(&pa.r)
    });
    Local { a: pa, b: pb, relative, twist }
}

/// The relative pose of a marker pair.
pub fn relative_of<T: Real>(
    topology: &Topology,
    placement: &Placement<T>,
    a: BodyRef,
    b: BodyRef,
    pair: &MarkerPair<T>,
) -> Relative<T> {
    let pa = marker_pose(topology, &placement.pose, a, &pair.a);
    let pb = marker_pose(topology, &placement.pose, b, &pair.b);
    relative_between(&pa, &pb, pair, placement, topology)
}

fn relative_between<T: Real>(
    a: &Pose<T>,
    b: &Pose<T>,
    pair: &MarkerPair<T>,
    placement: &Placement<T>,
    topology: &Topology,
) -> Relative<T> {
    Relative {
        u: turned_back(&a.r, &(b.p - a.p)),
        r: product_of_transpose(&a.r, &b.r),
        radius: pair.radius,
        pitch: pair.pitch,
        turned: placement.turned(topology, pair.number),
    }
}

/// Displacement and rate of every coordinate of a connector; rates are zero at rest.
pub fn motion_of<T: Real>(
    topology: &Topology,
    geometry: &Geometry<T>,
    placement: &Placement<T>,
    x: &[T],
    connector: &Connector,
) -> Vec<(T, T)> {
    let here = local(topology, placement, connector.a, connector.b, pair_of(geometry, connector.owner));
    let rows: Vec<_> = connector.coordinates.iter().map(|c| here.relative.row(*c)).collect();
    let rate = |g: &Six<T>| here.twist.as_ref().map_or_else(T::zero, |v| g.dot(v));
    let e = strains(connector, geometry, Numbers { x, memory: &[], t: 0.0 }, &here, &rows);
    e.into_iter().zip(&rows).map(|(e, r)| (e, rate(&r.g))).collect()
}

/// The force of an element or joint spring, and its tangents.
pub fn interaction<T: Real>(
    topology: &Topology,
    geometry: &Geometry<T>,
    placement: &Placement<T>,
    numbers: Numbers<'_, T>,
    connector: &Connector,
    wanted: Wanted,
) -> Interaction<T> {
    let pair = pair_of(geometry, connector.owner);
    let here = local(topology, placement, connector.a, connector.b, pair);
    let n = connector.coordinates.len();
    let rows: Vec<_> = connector.coordinates.iter().map(|c| here.relative.row(*c)).collect();
    let e = strains(connector, geometry, numbers, &here, &rows);
    let rates: Option<Vec<T>> = here.twist.as_ref().map(|v| rows.iter().map(|r| r.g.dot(v)).collect());
    let response = response(connector, numbers, &e, rates.as_deref(), wanted);
    let wrench = (0..n).fold(Six::zero(), |w, i| w + -rows[i].g.scaled(response.force[i]));
    let tangent = wanted.tangent.then(|| {
        let (mut k, mut c) = (Map6::zero(), Map6::zero());
        for i in 0..n {
            for j in 0..n {
                let cij = response.c[i][j];
                if response.damped && !absent(&cij) {
                    c.add_outer(&rows[i].g, &rows[j].g, -cij);
                    if let Some(v) = here.twist.as_ref() {
                        let slope = rate_gradient(&here.relative, connector.coordinates[j], &rows[j].g, v);
                        k.add_outer(&rows[i].g, &slope, -cij);
                    }
                }
            }
        }
        if wanted.geometric {
            add_geometric(&mut k, &here.relative, &connector.coordinates, &response.force[..n], &wrench);
        }
        (k.rotated(&here.a.r), c.rotated(&here.a.r))
    });
    let elastic = wanted.tangent.then(|| Elastic {
        gradients: rows.iter().map(|r| r.g.rotated(&here.a.r)).collect(),
        k: response.k,
        c: response.c,
    });
    Interaction {
        a: connector.a,
        b: connector.b,
        point: here.b.p,
        wrench: wrench.rotated(&here.a.r),
        damped: response.damped,
        elastic,
        tangent,
    }
}

/// Gradients of a connector's coordinates (world axes about `point`), the forces along them, their slopes by displacement and rate, and
/// what rounding of places may make of its displacements.
pub struct CoordinateTangent<T: Real> {
    pub point: V3<T>,
    pub gradients: Vec<Six<T>>,
    pub force: [T; 6],
    pub k: [[T; 6]; 6],
    pub c: [[T; 6]; 6],
    pub rounding: Vec<f64>,
}

/// The tangent of a connector before it is spread to bodies or coordinates, at rest.
pub fn coordinate_tangent<T: Real>(
    topology: &Topology,
    geometry: &Geometry<T>,
    placement: &Placement<T>,
    numbers: Numbers<'_, T>,
    connector: &Connector,
    wanted: Wanted,
) -> CoordinateTangent<T> {
    let pair = pair_of(geometry, connector.owner);
    let here = local(topology, placement, connector.a, connector.b, pair);
    let rows: Vec<_> = connector.coordinates.iter().map(|c| here.relative.row(*c)).collect();
    let gradients = rows.iter().map(|r| r.g.rotated(&here.a.r)).collect();
    let e = strains(connector, geometry, numbers, &here, &rows);
    let made = response(connector, numbers, &e, None, wanted);
    // differences of places carry several roundings of these, angles one of a radian
    let hidden = |(e, c): (&T, &Coordinate)| {
        let unit = if c.is_length() { ENTRY_ROUNDING * f64::EPSILON } else { f64::EPSILON };
        here.place(*c) * if e.re() == 0.0 { ROUNDING } else { unit }
    };
    let rounding = e.iter().zip(&connector.coordinates).map(hidden).collect();
    CoordinateTangent { point: here.b.p, gradients, force: made.force, k: made.k, c: made.c, rounding }
}

/// d(e')/d(xi) at a given relative twist field: (h xi) . v + g_l . (omega x xi_t).
fn rate_gradient<T: Real>(relative: &Relative<T>, coordinate: Coordinate, g: &Six<T>, v: &Six<T>) -> Six<T> {
    let mut q = relative.curvature(coordinate).apply_transposed(v);
    q.l += g.l.cross(&v.a);
    q
}

fn add_geometric<T: Real>(
    k: &mut Map6<T>,
    relative: &Relative<T>,
    coordinates: &[Coordinate],
    force: &[T],
    wrench: &Six<T>,
) {
    for (coordinate, f) in coordinates.iter().zip(force) {
        if absent(f) || matches!(coordinate, Coordinate::Translation(_)) {
            continue;
        }
        let h = relative.curvature(*coordinate);
        k.ll -= h.ll * *f;
        k.la -= h.la * *f;
        k.aa -= h.aa * *f;
    }
    // the point of the wrench moves with b
    k.al -= skew(&wrench.l);
}

/// The name of a spring or rod whose two ends are in one place.
pub fn collapsed<'t>(
    topology: &'t Topology,
    geometry: &Geometry<f64>,
    placement: &Placement<f64>,
    length: f64,
) -> Option<&'t str> {
    let tables = &topology.tables;
    let apart = |a, b, pair: &MarkerPair<f64>| {
        let pa = marker_pose(topology, &placement.pose, a, &pair.a);
        let pb = marker_pose(topology, &placement.pose, b, &pair.b);
        (pb.p - pa.p).norm()
    };
    let springs = tables.elements.iter().zip(&geometry.elements);
    let rods = tables.joints.iter().zip(&geometry.joints);
    let spring = springs
        .filter(|(e, _)| e.kind == ElementKind::SpringDamper)
        .find(|(e, pair)| apart(e.a, e.b, pair) <= SAME_POINT * length)
        .map(|(e, _)| e.name.as_str());
    spring.or_else(|| {
        rods.filter(|(j, _)| j.kind.has_length())
            .find(|(j, pair)| apart(j.a, j.b, pair) <= SAME_POINT * length)
            .map(|(j, _)| j.name.as_str())
    })
}

/// Displacements from the natural state. What is rounding of the places it is the difference of is exactly zero, so that a
/// spring at its drawn length carries no force.
pub(crate) fn strains<T: Real>(
    connector: &Connector,
    geometry: &Geometry<T>,
    numbers: Numbers<'_, T>,
    here: &Local<T>,
    rows: &[Row<T>],
) -> Vec<T> {
    let mut all: Vec<T> = rows.iter().map(|r| r.e).collect();
    offset_natural(connector, geometry, numbers.x, &mut all[0]);
    for (e, coordinate) in all.iter_mut().zip(&connector.coordinates) {
        if e.re().abs() <= ROUNDING * here.place(*coordinate) {
            *e -= T::from(e.re());
        }
    }
    all
}

fn offset_natural<T: Real>(connector: &Connector, geometry: &Geometry<T>, x: &[T], e: &mut T) {
    match connector.natural {
        Natural::Zero => {}
        Natural::Value { x: at } => *e -= x[at],
        Natural::Length { x: at, given } => {
            *e -= x[at];
            if let (false, Owner::Element(i)) = (given, connector.owner) {
                *e -= geometry.element_length[i];
            }
        }
    }
}

/// The wrench of a set of constraint rows of one joint with given multipliers, W = -sum lam g, with its tangent.
pub fn constraint_interaction<T: Real>(
    topology: &Topology,
    geometry: &Geometry<T>,
    placement: &Placement<T>,
    joint: usize,
    rows: &[(Coordinate, T)],
    wanted: Wanted,
) -> Interaction<T> {
    let spec = &topology.tables.joints[joint];
    let here = local(topology, placement, spec.a, spec.b, &geometry.joints[joint]);
    let wrench = rows.iter().fold(Six::zero(), |w, (c, lam)| w + -here.relative.row(*c).g.scaled(*lam));
    let tangent = wanted.tangent.then(|| {
        let mut k = Map6::zero();
        let (coordinates, forces): (Vec<_>, Vec<_>) = rows.iter().copied().unzip();
        add_geometric(&mut k, &here.relative, &coordinates, &forces, &wrench);
        (k.rotated(&here.a.r), Map6::zero())
    });
    Interaction {
        a: spec.a,
        b: spec.b,
        point: here.b.p,
        wrench: wrench.rotated(&here.a.r),
        damped: false,
        elastic: None,
        tangent,
    }
}

/// Values of constraint rows and their gradients in world axes about p_B.
pub fn constraint_rows<T: Real>(
    topology: &Topology,
    geometry: &Geometry<T>,
    placement: &Placement<T>,
    joint: usize,
    coordinates: &[Coordinate],
) -> (V3<T>, Vec<(T, Six<T>)>) {
    let spec = &topology.tables.joints[joint];
    let here = local(topology, placement, spec.a, spec.b, &geometry.joints[joint]);
    let rows = coordinates.iter().map(|c| {
        let row = here.relative.row(*c);
        (row.e, row.g.rotated(&here.a.r))
    });
    (here.b.p, rows.collect())
}

/// The rates of coordinates of a joint.
pub fn constraint_rates<T: Real>(
    topology: &Topology,
    geometry: &Geometry<T>,
    placement: &Placement<T>,
    joint: usize,
    coordinates: &[Coordinate],
) -> Vec<T> {
    let spec = &topology.tables.joints[joint];
    let here = local(topology, placement, spec.a, spec.b, &geometry.joints[joint]);
    let rate = |c: &Coordinate| {
        let g = here.relative.row(*c).g;
        here.twist.as_ref().map_or_else(T::zero, |v| g.dot(v))
    };
    coordinates.iter().map(rate).collect()
}

/// The second rates of coordinates of a joint at given accelerations of the bodies: g . xi' + xi . h xi, in axes that move with a.
pub fn constraint_bias<T: Real>(
    topology: &Topology,
    geometry: &Geometry<T>,
    placement: &Placement<T>,
    joint: usize,
    coordinates: &[Coordinate],
    accelerations: &[Six<T>],
) -> Vec<T> {
    let spec = &topology.tables.joints[joint];
    let here = local(topology, placement, spec.a, spec.b, &geometry.joints[joint]);
    let (Some(xi), Some(velocity)) = (here.twist, placement.velocity.as_ref()) else {
        return vec![T::zero(); coordinates.len()];
    };
    let at = |body: BodyRef, of: &[Six<T>]| {
        topology.node(body).map_or_else(Six::zero, |n| of[n].motion_at(&(here.b.p - placement.pose[n].p)))
    };
    let (va, vb) = (at(spec.a, &velocity.body), at(spec.b, &velocity.body));
    let spatial = at(spec.b, accelerations) - at(spec.a, accelerations);
    // the point moves with b; then the turning of the axes of a is taken out
    let relative = vb - va;
    let turned =
        Six::new(spatial.l + relative.a.cross(&vb.l) - va.a.cross(&relative.l), spatial.a - va.a.cross(&relative.a))
            .rotated_back(&here.a.r);
    let bias = |c: &Coordinate| {
        let h = here.relative.curvature(*c);
        here.relative.row(*c).g.dot(&turned) + xi.dot(&h.apply(&xi))
    };
    coordinates.iter().map(bias).collect()
}

/// What motions add to a load's value at time t, in the axes in which the value is constant.
fn varying<T: Real>(topology: &Topology, geometry: &Geometry<T>, load: usize, t: f64) -> V3<T> {
    let tables = &topology.tables;
    let mut value = V3::zeros();
    for m in tables.load_motions.iter().filter(|m| m.load == load) {
        value[m.component] += geometry.motions[m.motion].at(t)[0];
    }
    let spec = &tables.loads[load];
    if spec.follower { geometry.bodies[spec.body].drawn.r.transpose() * value } else { value }
}

/// The force of a load on a modal coordinate.
pub fn modal_load<T: Real>(topology: &Topology, geometry: &Geometry<T>, load: usize, t: f64) -> T {
    geometry.loads[load].1.x + varying(topology, geometry, load, t).x
}

/// Local point and value of a load at time t, the value in body axes of a follower and in those of the world otherwise.
pub(crate) fn load_parts<T: Real>(topology: &Topology, geometry: &Geometry<T>, load: usize, t: f64) -> (V3<T>, V3<T>) {
    let (local, value) = &geometry.loads[load];
    (*local, value + varying(topology, geometry, load, t))
}

/// A load: dead (constant in the world) or follower (carried along), as an interaction of ground with its body.
pub fn load_interaction<T: Real>(
    topology: &Topology,
    geometry: &Geometry<T>,
    placement: &Placement<T>,
    load: usize,
    t: f64,
    wanted: Wanted,
) -> Interaction<T> {
    let spec = &topology.tables.loads[load];
    let pose = &placement.pose[topology.node_of_body[spec.body]];
    let (local, value) = load_parts(topology, geometry, load, t);
    let value = if spec.follower { pose.r * value } else { value };
    let wrench = if spec.torque { Six::new(V3::zeros(), value) } else { Six::new(value, V3::zeros()) };
    let tangent = (wanted.tangent && wanted.geometric).then(|| {
        let mut k = Map6::zero();
        k.al = -skew(&wrench.l);
        if spec.follower {
            k.la = -skew(&wrench.l);
            k.aa = -skew(&wrench.a);
        }
        (k, Map6::zero())
    });
    Interaction {
        a: None,
        b: Some(spec.body),
        point: pose.p + turned(&pose.r, &local),
        wrench,
        damped: false,
        elastic: None,
        tangent,
    }
}
