//! Directions that touch single elements or single masses: only these are differentiated, and only along their paths.
//!
//! Applies where nothing else can move: an open tree at rest, with the numbers of elements, joint springs, laws or masses, as
//! long as they change no force (then an equilibrium stays where it is).
use nalgebra::DMatrix;
use num_dual::Dual64;

use crate::linearize::{Linearization, Setting};
use crate::model::geometry::{Geometry, inertia as inertia_of};
use crate::model::layout::{body, joint};
use crate::model::tables::Tables;
use crate::multibody::connector::{Interaction, Wanted, coordinate_tangent, interaction};
use crate::multibody::numbers::Numbers;
use crate::multibody::path::{add_slopes, add_tangent, add_wrench, path};
use crate::multibody::placement::{Placement, place};
use crate::multibody::topology::{Connector, Owner, Topology};
use crate::sensitivity::direction::{Directional, Entries, Request};
use crate::spatial::{Pose, Six, V3};

/// What a direction touches, if it touches nothing else.
#[derive(Default)]
struct Touched {
    connectors: Vec<usize>,
    bodies: Vec<usize>,
}

fn inside(index: usize, start: usize, from: usize, to: usize) -> bool {
    index >= start + from && index < start + to
}

fn owner_range(tables: &Tables, connector: &Connector, index: usize) -> bool {
    let own = match connector.owner {
        Owner::Element(i) => {
            let e = &tables.elements[i];
            inside(index, e.x, 0, e.kind.size())
        }
        Owner::Joint(i) => inside(index, tables.joints[i].x, joint::K, joint::PRELOAD + 6),
    };
    let law = |x: usize, n: usize| inside(index, x, 0, n);
    own || connector.laws.iter().any(|l| law(l.x, l.law.n_params()))
        || connector.functions.iter().any(|f| law(f.x, f.law.n_params()))
}

fn touched(topology: &Topology, dx: &[(usize, f64)]) -> Option<Touched> {
    let mut found = Touched::default();
    for (index, weight) in dx {
        if *weight == 0.0 {
            continue;
        }
        let connector = topology.connectors.iter().position(|c| owner_range(&topology.tables, c, *index));
        let body = topology.tables.bodies.iter().position(|b| inside(*index, b.x, body::MASS, body::INERTIA + 6));
        match (connector, body) {
            (Some(c), _) if !found.connectors.contains(&c) => found.connectors.push(c),
            (None, Some(b)) if !found.bodies.contains(&b) => found.bodies.push(b),
            (None, None) => return None,
            _ => {}
        }
    }
    Some(found)
}

/// The derivative the short way; None where this direction needs the whole model.
pub fn local_direction(
    setting: &Setting<'_>,
    base: &Linearization,
    dx: &[(usize, f64)],
    request: Request<'_>,
) -> Option<Directional> {
    let (system, topology) = (setting.system, &*setting.system.topology);
    let effects = setting.effects;
    let plain = base.loops.is_none()
        && !topology.is_flexible()
        && !setting.state.moving()
        && effects.preload_stiffness
        && effects.constraint_force_stiffness;
    if !plain {
        return None;
    }
    let touched = touched(topology, dx)?;
    let gravity = effects.gravity && system.geometry.gravity.is_some_and(|g| g.amax() > 0.0);
    if gravity && !touched.bodies.is_empty() {
        return None;
    }
    let placed = place(topology, &system.geometry, &setting.state.q, None);
    let n = topology.dofs.len();
    let mut mass = Entries::default();
    let mut coupling = DMatrix::zeros(n, 6);
    for body in &touched.bodies {
        add_body(topology, &placed, *body, dx, &mut mass, request.maps.then_some(&mut coupling));
    }
    let (mut stiffness, mut damping) = (Entries::default(), Entries::default());
    if !touched.connectors.is_empty() {
        let (k, d) = connectors(setting, &placed, &touched.connectors, dx)?;
        stiffness = Entries::filled(&k);
        damping = Entries::filled(&d);
    }
    Some(Directional {
        mass,
        damping,
        stiffness,
        body_map: None,
        ground_coupling: (request.maps && !touched.bodies.is_empty()).then_some(coupling),
        dy: vec![0.0; n],
        body_motion: vec![0.0; 6 * system.n_bodies()],
        lam: Vec::new(),
    })
}

/// dM = B_b^T dI_b B_b over the coordinates that move body b.
fn add_body(
    topology: &Topology,
    placed: &Placement<f64>,
    body: usize,
    dx: &[(usize, f64)],
    mass: &mut Entries,
    coupling: Option<&mut DMatrix<f64>>,
) {
    let start = topology.tables.bodies[body].x;
    let mut d = [0.0; body::SIZE];
    for (index, weight) in dx.iter().filter(|(i, _)| inside(*i, start, 0, body::SIZE)) {
        d[index - start] += weight;
    }
    let node = topology.node_of_body[body];
    let pose = &placed.pose[node];
    let inertia = pose.r * inertia_of(&d[body::INERTIA..]) * pose.r.transpose();
    let chain = chain(topology, placed, node);
    let momenta: Vec<Six<f64>> = chain.iter().map(|(_, s)| Six::new(s.l * d[body::MASS], inertia * s.a)).collect();
    for ((i, _), p) in chain.iter().zip(&momenta) {
        for (j, s) in &chain {
            mass.push(*i, *j, p.dot(s));
        }
    }
    if let Some(coupling) = coupling {
        for ((i, _), p) in chain.iter().zip(&momenta) {
            let at_origin = p.wrench_at(&-pose.p);
            for k in 0..6 {
                coupling[(*i, k)] += at_origin.get(k);
            }
        }
    }
}

/// Coordinates that move a body, with their twists at its centre of mass.
fn chain(topology: &Topology, placed: &Placement<f64>, node: usize) -> Vec<(usize, Six<f64>)> {
    let mut out = Vec::new();
    let mut at = Some(node);
    while let Some(k) = at {
        let spec = &topology.nodes[k];
        let arm = placed.pose[node].p - placed.pose[k].p;
        out.extend((spec.first..spec.first + spec.n).map(|d| (d, placed.column[d].motion_at(&arm))));
        at = spec.parent;
    }
    out
}

fn lifted(placed: &Placement<f64>) -> Placement<Dual64> {
    let v = |v: &V3<f64>| v.map(Dual64::from_re);
    let six = |s: &Six<f64>| Six::new(v(&s.l), v(&s.a));
    Placement {
        q: placed.q.iter().map(|v| Dual64::from(*v)).collect(),
        pose: placed.pose.iter().map(Pose::<f64>::lifted).collect(),
        column: placed.column.iter().map(six).collect(),
        velocity: None,
        modal: Vec::new(),
        turns: None,
    }
}

/// Changes of stiffness and damping by the touched connectors; None where their forces change.
///
/// Numbers that move nothing change slopes alone: these are spread by the paths as they are. Others take all of the connector over dual
/// numbers.
fn connectors(
    setting: &Setting<'_>,
    placed: &Placement<f64>,
    touched: &[usize],
    dx: &[(usize, f64)],
) -> Option<(DMatrix<f64>, DMatrix<f64>)> {
    let system = setting.system;
    let topology = &*system.topology;
    let mut x: Vec<Dual64> = system.x.iter().map(|v| Dual64::from(*v)).collect();
    for (i, d) in dx {
        x[*i].eps = *d;
    }
    let memory: Vec<Dual64> = setting.memory.iter().map(|z| Dual64::from(*z)).collect();
    let geometry = Geometry::derive(&topology.tables, &x);
    let placement = lifted(placed);
    let numbers = Numbers { x: &x, memory: &memory, t: 0.0 };
    let e = setting.effects;
    let wanted = Wanted {
        tangent: true,
        geometric: true,
        damping: e.damping,
        laws: e.law_slopes,
        friction: e.friction,
        contact: e.contact,
    };
    let n = topology.dofs.len();
    let (mut stiffness, mut damping) = (DMatrix::zeros(n, n), DMatrix::zeros(n, n));
    let mut others = Vec::new();
    for c in touched {
        let connector = &topology.connectors[*c];
        let made = coordinate_tangent(topology, &geometry, &placement, numbers, connector, wanted);
        if changes(&made.point) || made.gradients.iter().any(|g| changes(&g.l) || changes(&g.a)) {
            others.push(connector);
            continue;
        }
        if made.force.iter().any(|f| f.eps != 0.0) {
            return None;
        }
        let point = made.point.map(|v| v.re);
        let gradients: Vec<_> = made.gradients.iter().map(|g| Six::new(g.l.map(|v| v.re), g.a.map(|v| v.re))).collect();
        let entries = path(topology, placed, connector.a, connector.b, &point);
        for (slopes, out) in [(&made.k, &mut stiffness), (&made.c, &mut damping)] {
            add_slopes(&entries, &gradients, &slopes.map(|row| row.map(|v| v.eps)), out);
        }
    }
    if others.is_empty() {
        return Some((stiffness, damping));
    }
    let (mut dual_k, mut dual_d) = (DMatrix::zeros(n, n), DMatrix::zeros(n, n));
    let mut sums = vec![Six::zero(); topology.nodes.len()];
    for connector in others {
        let acting: Interaction<Dual64> = interaction(topology, &geometry, &placement, numbers, connector, wanted);
        add_tangent(topology, &placement, &acting, true, &mut dual_k, Some(&mut dual_d));
        add_wrench(topology, &placement, &acting, &mut sums);
    }
    let slopes = |m: &DMatrix<Dual64>| m.map(|v| v.eps);
    let moves = sums.iter().any(|w| changes(&w.l) || changes(&w.a));
    (!moves).then(|| (stiffness + slopes(&dual_k), damping + slopes(&dual_d)))
}

fn changes(v: &V3<Dual64>) -> bool {
    v.iter().any(|x| x.eps != 0.0)
}
