//! Energies and powers along a motion, and the coordinates of all joints.
use crate::force::{AnyLaw, FunctionLaw, Stored, Surface};
use crate::model::flexible::FlexibleGeometry;
use crate::multibody::assemble::Scene;
use crate::multibody::connector::{Wanted, load_interaction, modal_load, motion_of, relative_of};
use crate::multibody::placement::Placement;
use crate::multibody::topology::{Connector, Modal};
use crate::spatial::{Six, V3, log_so3};

use super::{Equations, Motion};
use crate::tolerances::matrices::NO_ENERGY;

/// Of one element: what it stores (None where it has no potential) and the power it takes from the mechanism.
#[derive(Debug, Clone, Copy)]
pub struct ElementEnergy {
    pub stored: Option<f64>,
    pub power: f64,
    /// what is stored as far as it is known, with the work of functions on straight ways: for a descent
    pub merit: f64,
}

pub struct Energies {
    pub kinetic: f64,
    pub gravity: f64,
    /// of all connectors, then of flexible bodies
    pub elements: Vec<ElementEnergy>,
    /// power that loads take: negative where they drive
    pub loads: Vec<f64>,
    /// of the air, one for each of the model's airs
    pub air: Vec<f64>,
}

/// Nodes and weights of Gauss-Legendre quadrature with 5 points on [0, 1].
const GAUSS: [(f64, f64); 5] = [
    (0.046_910_077_030_668, 0.118_463_442_528_095),
    (0.230_765_344_947_158, 0.239_314_335_249_683),
    (0.5, 0.284_444_444_444_444),
    (0.769_234_655_052_842, 0.239_314_335_249_683),
    (0.953_089_922_969_332, 0.118_463_442_528_095),
];
/// Pieces of the path from zero to the displacement where a law is smooth.
const PIECES: usize = 64;
/// Towards the kink of a contact law pieces are halved so often.
const HALVINGS: i32 = 45;

/// What a law has stored at displacement e and memory z; None where that is not known.
fn stored(law: AnyLaw, p: &[f64], e: f64, z: &[f64]) -> Option<f64> {
    match law.stored(e, p, z) {
        Stored::Work => Some(work(law, p, e)),
        Stored::Energy(energy) => Some(energy),
        Stored::Unknown => None,
    }
}

/// The work of a function on the straight way from zero, held still at time t.
fn ray_work(law: &FunctionLaw, t: f64, p: &[f64], u: &[f64]) -> f64 {
    let rest = vec![0.0; u.len()];
    let power = |s: f64| {
        let there: Vec<f64> = u.iter().map(|u| s * u).collect();
        law.force(t, &there, &rest, p).iter().zip(u).map(|(f, u)| f * u).sum::<f64>()
    };
    let piece = |k: usize| GAUSS.iter().map(|(s, w)| w * power((k as f64 + s) / PIECES as f64)).sum::<f64>();
    (0..PIECES).map(piece).sum::<f64>() / PIECES as f64
}

/// The work of a law from zero displacement.
fn work(law: AnyLaw, p: &[f64], e: f64) -> f64 {
    let mut ends = vec![0.0];
    ends.extend(joints_of_path(&law.surfaces(p), e));
    ends.push(e);
    let force = |u: f64| law.force(u, 0.0, p, &[], &mut []);
    let piece = |from: f64, to: f64| {
        let sum: f64 = GAUSS.iter().map(|(s, w)| w * force(from + s * (to - from))).sum();
        sum * (to - from)
    };
    ends.windows(2).map(|w| piece(w[0], w[1])).sum()
}

/// Where to cut the way from 0 to e: at kinks and knots, and ever finer towards a kink, where forces have no derivatives.
fn joints_of_path(surfaces: &[Surface], e: f64) -> Vec<f64> {
    let near = |kink: f64| {
        let span = kink.abs().max((e - kink).abs());
        (0..HALVINGS).flat_map(move |k| {
            let d = span * 0.5_f64.powi(k);
            [kink - d, kink + d]
        })
    };
    let mut out: Vec<f64> = surfaces.iter().map(|s| s.at).collect();
    out.extend(surfaces.iter().filter(|s| s.kink).flat_map(|s| near(s.at)));
    if surfaces.is_empty() {
        out.extend((1..PIECES).map(|k| e * k as f64 / PIECES as f64));
    }
    out.retain(|u| u * e > 0.0 && u.abs() < e.abs());
    out.sort_by(|a, b| a.abs().total_cmp(&b.abs()));
    out
}

impl Equations<'_, f64> {
    pub fn energies(&self, m: &Motion<f64>) -> Energies {
        let placement = self.place(m);
        let topology = self.topology();
        let (mut kinetic, mut gravity) = (0.0, 0.0);
        let g = self.geometry.gravity.filter(|_| self.effects.gravity);
        for (i, node) in topology.nodes.iter().enumerate() {
            let body = &self.geometry.bodies[node.body];
            let pose = &placement.pose[i];
            if let Some(v) = placement.velocity.as_ref().map(|v| &v.body[i]) {
                let omega = pose.r.transpose() * v.a;
                kinetic += 0.5 * (body.mass * v.l.dot(&v.l) + omega.dot(&(body.inertia * omega)));
            }
            if let Some(g) = g {
                gravity -= body.mass * g.dot(&pose.p);
            }
        }
        let scene = self.scene(m, &placement, None);
        kinetic += scene.modal_kinetic();
        if let Some(g) = g {
            gravity -= scene.modal_moment().dot(&g);
        }
        let connectors = topology.connectors.iter();
        let elements = connectors.map(|c| self.element_energy(&placement, m, c));
        let elements = elements.chain(self.modal_energies(&placement, m)).collect();
        let loads = (0..topology.tables.loads.len()).map(|i| -self.load_power(i, &placement, m)).collect();
        let air = self.air_powers(&scene, &placement);
        Energies { kinetic, gravity, elements, loads, air }
    }

    fn air_powers(&self, scene: &Scene<'_, f64>, placement: &Placement<f64>) -> Vec<f64> {
        let topology = self.topology();
        let mut out = vec![0.0; topology.tables.air.len()];
        let Some(velocity) = placement.velocity.as_ref() else {
            return out;
        };
        for (acting, section) in scene.air_forces().zip(&topology.tables.sections) {
            let node = topology.node_of_body[section.body];
            let arm = acting.point - placement.pose[node].p;
            out[section.air] -= acting.wrench.dot(&velocity.body[node].motion_at(&arm));
        }
        out
    }

    fn load_power(&self, load: usize, placement: &Placement<f64>, m: &Motion<f64>) -> f64 {
        let topology = self.topology();
        let spec = &topology.tables.loads[load];
        if let Some(mode) = spec.mode {
            let coordinate = topology.modal_coordinate(spec.body, mode);
            let rate = coordinate.map_or(0.0, |i| m.rate[i]);
            return rate * modal_load(topology, &self.geometry, load, m.t);
        }
        let Some(velocity) = placement.velocity.as_ref() else {
            return 0.0;
        };
        let forces = Wanted::FORCES;
        let acting = load_interaction(topology, &self.geometry, placement, load, m.t, forces);
        let node = topology.node_of_body[spec.body];
        let arm = acting.point - placement.pose[node].p;
        acting.wrench.dot(&velocity.body[node].motion_at(&arm))
    }

    /// Strain energy of flexible bodies, and what their stiffness and damping take.
    fn modal_energies(&self, placement: &Placement<f64>, m: &Motion<f64>) -> Vec<ElementEnergy> {
        let topology = self.topology();
        let first = topology.n_tree - placement.modal.len();
        let of = |(modal, g): (&Modal, &FlexibleGeometry<f64>)| {
            let (n, q) = (modal.m, &placement.modal[modal.first - first..]);
            let v = &m.rate[modal.first..];
            let (mut stored, mut power) = (0.0, 0.0);
            for k in 0..n {
                for l in 0..n {
                    stored += 0.5 * q[k] * g.k[k * n + l] * q[l];
                    power += v[k] * g.k[k * n + l] * q[l];
                    if self.effects.damping && g.damped {
                        power += v[k] * g.c[k * n + l] * v[l];
                    }
                }
            }
            ElementEnergy { stored: Some(stored), merit: stored, power }
        };
        let all = topology.modal.iter().zip(&self.geometry.flexible);
        all.map(of).collect()
    }

    fn element_energy(&self, placement: &Placement<f64>, m: &Motion<f64>, c: &Connector) -> ElementEnergy {
        let x = &self.x;
        let moved = motion_of(self.topology(), &self.geometry, placement, x, c);
        let n = moved.len();
        let (mut stored, mut power, mut skew) = (0.0, 0.0, false);
        for (i, (e, v)) in moved.iter().enumerate() {
            let preload = c.preload.map_or(0.0, |s| x[s + i]);
            stored += preload * e;
            power += preload * v;
            for (j, (ej, vj)) in moved.iter().enumerate() {
                let k = entry(x, c, c.k, n, i, j);
                skew |= (k - entry(x, c, c.k, n, j, i)).abs() > NO_ENERGY * k.abs();
                stored += 0.5 * e * k * ej;
                power += v * k * ej;
                if self.effects.damping {
                    power += v * entry(x, c, c.c, n, i, j) * vj;
                }
            }
        }
        let mut known = !skew;
        let (e, v): (Vec<f64>, Vec<f64>) = moved.iter().copied().unzip();
        for law in &c.laws {
            let (e, v) = moved[law.component];
            let p = &x[law.x..law.x + law.law.n_params()];
            let mut memory = m.memory[law.memory..law.memory + law.law.n_memory()].to_vec();
            power += law.law.eval(e, v, p, &mut memory) * v;
            match self::stored(law.law, p, e, &memory) {
                Some(energy) => stored += energy,
                None => known = false,
            }
        }
        for function in &c.functions {
            let (u, v) = (function.own(Some(&e)), function.own(Some(&v)));
            let p = function.numbers(x);
            power += function.law.force(m.t, &u, &v, p).iter().zip(&v).map(|(f, v)| f * v).sum::<f64>();
            known &= function.law.m() == 1 && !function.law.uses_rate() && !function.law.uses_time();
            stored += ray_work(&function.law, m.t, p, &u);
        }
        ElementEnergy { stored: known.then_some(stored), merit: stored, power }
    }

    /// Free coordinates of every joint of the model, in their order, then of the bodies that no joint carries.
    pub fn joint_coordinates(&self, m: &Motion<f64>) -> Vec<f64> {
        let (topology, placement) = (self.topology(), self.place(m));
        let mut out = Vec::new();
        for (joint, pair) in topology.tables.joints.iter().zip(&self.geometry.joints) {
            let coordinates = joint.kind.free_coordinates();
            if !coordinates.is_empty() {
                let here = relative_of(topology, &placement, joint.a, joint.b, pair);
                out.extend(coordinates.iter().map(|c| here.row(*c).e));
            }
        }
        for node in topology.nodes.iter().filter(|n| n.is_loose()) {
            let pose = node.kind.pose(&m.q[node.q..node.q + node.kind.nq()], node.reversed, 0.0);
            out.extend(pose.p.iter().chain(log_so3(&pose.r).iter()));
        }
        out
    }

    /// Twist of each body's origin (world), in the order of the model.
    pub fn origins(&self, placement: &Placement<f64>) -> Vec<(V3<f64>, Six<f64>)> {
        let topology = self.topology();
        let mut out = vec![(V3::zeros(), Six::zero()); topology.nodes.len()];
        for (i, node) in topology.nodes.iter().enumerate() {
            let pose = &placement.pose[i];
            let arm = -(pose.r * self.geometry.bodies[node.body].com);
            let v = placement.velocity.as_ref().map_or_else(Six::zero, |v| v.body[i].motion_at(&arm));
            out[node.body] = (pose.p + arm, v);
        }
        out
    }
}

fn entry(x: &[f64], c: &Connector, start: Option<usize>, n: usize, i: usize, j: usize) -> f64 {
    match start {
        Some(s) if c.full => x[s + i * n + j],
        Some(s) if i == j => x[s + i],
        _ => 0.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Integrals by hand; the hyperbola's is k (d (d + r) + s^2 asinh(d/s))/4 with r = sqrt(d^2 + s^2), d + r without cancellation.
    #[test]
    fn contacts_store_what_their_integrals_say() {
        let (k, gap, s) = (1e9, 0.013, 1e-6);
        let hyperbola = |d: f64| {
            let r = (d * d + s * s).sqrt();
            let sum = if d < 0.0 { s * s / (r - d) } else { d + r };
            0.25 * k * (d * sum + s * s * (d / s).asinh())
        };
        for e in [0.0135, 0.0131, -0.02, 0.5] {
            let d = f64::max(e - gap, 0.0);
            let cases = [
                (3, [k, gap, 0.0], 0.5 * k * d * d),
                (6, [k, 1.5, gap], k * d.powf(2.5) / 2.5),
                (3, [k, gap, s], hyperbola(e - gap) - hyperbola(-gap)),
            ];
            for (code, p, exact) in cases {
                let law = AnyLaw::from_code(code, 3).unwrap();
                let found = work(law, &p, e);
                let size = 1e-9 * exact.abs() + 1e-16 * k * gap * gap;
                assert!((found - exact).abs() <= size, "{law:?} {e}: {found} {exact}");
            }
        }
    }
}
