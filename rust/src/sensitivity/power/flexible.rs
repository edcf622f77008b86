//! Flexible bodies in the virtual power: what the modal coordinates of a body add, and the columns of its moving nodes.
//!
//! Seen from its own frame a body knows nothing but the three twists of that frame and its modal coordinates. That small function goes
//! on the tape; how it turns with the body follows from its being invariant: d x* of the adjoints of the twists, summed.
use num_dual::{Dual, Dual64};

use crate::model::flexible::FlexibleGeometry;
use crate::multibody::flexible::{movers, node_accelerations, node_rates};
use crate::multibody::flexible_inertia::Shapes;
use crate::multibody::placement::Placement;
use crate::multibody::topology::{Modal, Node};
use crate::spatial::{M3, Real, Six, V3};

use super::tree::{Bodies, Twists};
use super::{Columns, Forces, Power, Slopes};
use crate::ad::tape::{Taped, backwards, clear, leaf};

/// Numbers that can be put on the tape, with their derivatives.
pub trait OnTape: Real {
    type Number: Real;
    fn leaf(self) -> Self::Number;
    /// Derivatives by the first n leaves.
    fn slopes(sum: Self::Number, n: usize) -> Vec<Self>;
}

impl OnTape for f64 {
    type Number = Taped;

    fn leaf(self) -> Taped {
        leaf(self)
    }

    fn slopes(sum: Taped, n: usize) -> Vec<f64> {
        backwards(sum, n)
    }
}

impl OnTape for Dual64 {
    type Number = Dual<Taped>;

    fn leaf(self) -> Dual<Taped> {
        Dual::new(leaf(self.re), leaf(self.eps))
    }

    /// The derivative of what moves along: its slope by the motion is the value's, that by the value is the slope's.
    fn slopes(sum: Dual<Taped>, n: usize) -> Vec<Dual64> {
        let d = backwards(sum.eps, 2 * n);
        (0..n).map(|i| Dual64::new(d[2 * i + 1], d[2 * i])).collect()
    }
}

/// A flexible body seen from its frame: u, v, a of the frame, of the modal coordinates q, q', q" and u.
struct Body<'m, N: Real> {
    modal: &'m Modal,
    mass: N,
    inertia: M3<N>,
    twists: [Six<N>; 3],
    q: Vec<N>,
    rate: Vec<N>,
    acceleration: Vec<N>,
    virtual_: Vec<N>,
    geometry: FlexibleGeometry<N>,
}

impl<N: Real> Body<'_, N> {
    /// u.(inertia) + u.(K q + C q'), as far as they count.
    fn power(&self, turning: bool, elastic: bool, damped: bool) -> N {
        let [u, v, a] = &self.twists;
        let rate = turning.then_some(self.rate.as_slice());
        let v = turning.then_some(v);
        let shapes = Shapes::new(self.modal, &self.geometry, M3::identity(), &self.q, rate, Some(&self.acceleration));
        let (h, j) = shapes.composite();
        let j = self.inertia + j;
        let momentum = |x: &Six<N>| Six::new(x.l * self.mass + x.a.cross(&h), h.cross(&x.l) + j * x.a);
        let mut force = momentum(a) + shapes.force(v);
        if let Some(v) = v {
            force += v.cross_force(&momentum(v));
        }
        let mut sum = u.dot(&force);
        let m = self.q.len();
        for (k, f) in shapes.residual(v, Some(a)).into_iter().enumerate() {
            let mut f = f;
            for l in 0..m {
                if elastic {
                    f += self.geometry.k[k * m + l] * self.q[l];
                }
                if damped {
                    f += self.geometry.c[k * m + l] * self.rate[l];
                }
            }
            sum += self.virtual_[k] * f;
        }
        sum
    }
}

impl<T: OnTape> Power<'_, '_, T> {
    /// Values of all columns at a place: those of the coordinates, and of the nodes that they move.
    pub fn columns(&self, at: &Placement<T>) -> Columns<T> {
        let (topology, geometry) = (self.eq.topology(), &self.eq.geometry);
        let whole = |mut v: Vec<T>| {
            v.resize(self.eq.n(), T::zero());
            v
        };
        let with = |mut v: Vec<T>, nodes: Vec<T>| {
            v.extend(nodes);
            v
        };
        let moved = |v: Vec<T>| {
            let nodes = node_rates(topology, geometry, &at.modal, &v);
            with(v, nodes)
        };
        let (rate, acceleration) = (whole(self.motion.rate.clone()), whole(self.acceleration.to_vec()));
        let turning = self.turning().then_some(rate.as_slice());
        let pushed = node_accelerations(topology, geometry, &at.modal, turning, Some(&acceleration));
        Columns {
            acceleration: with(acceleration, pushed),
            virtual_: moved(whole(self.rates.iter().map(|u| T::from(*u)).collect())),
            rate: moved(rate),
        }
    }

    /// The inertia of flexible bodies, and the stiffness and damping of their modes.
    pub fn flexible_back(
        &self,
        at: &Placement<T>,
        twists: &Twists<T>,
        columns: &Columns<T>,
        bodies: &mut Bodies<T>,
        out: &mut Slopes<T>,
    ) {
        let topology = self.eq.topology();
        for (i, modal) in topology.modal.iter().enumerate() {
            let (node, own) = (modal.node, modal.first..modal.first + modal.m);
            let first = modal.first - topology.modal[0].first;
            let velocity = at.velocity.as_ref().map_or_else(Six::zero, |v| v.body[node]);
            let world = [twists.virtual_[node], velocity, twists.acceleration[node]];
            let r = &at.pose[node].r;
            let body = &self.eq.geometry.bodies[topology.nodes[node].body];
            clear();
            let mut n = 0;
            let mut put = |v: T| {
                n += 1;
                v.leaf()
            };
            let six =
                |v: &Six<T>, put: &mut dyn FnMut(T) -> T::Number| Six { l: v.l.map(&mut *put), a: v.a.map(&mut *put) };
            let t = r.transpose();
            let held = Body {
                modal,
                twists: world.map(|v| six(&v.rotated(&t), &mut put)),
                mass: put(body.mass),
                inertia: body.inertia.map(&mut put),
                q: at.modal[first..first + modal.m].iter().map(|v| put(*v)).collect(),
                rate: columns.rate[own.clone()].iter().map(|v| put(*v)).collect(),
                acceleration: columns.acceleration[own.clone()].iter().map(|v| put(*v)).collect(),
                virtual_: columns.virtual_[own.clone()].iter().map(|v| put(*v)).collect(),
                geometry: self.eq.geometry.flexible[i].map(&mut put),
            };
            let (all, damping) = (self.forces == Forces::All, self.eq.effects.damping);
            let sum = held.power(self.turning(), all, all && damping) * T::Number::from(self.factor);
            let d = T::slopes(sum, n);
            let mut slopes = d.iter();
            let mut next = move || slopes.next().copied().unwrap_or_else(T::zero);
            let by: [Six<T>; 3] = std::array::from_fn(|_| {
                let l = V3::from_fn(|_, _| next());
                Six::new(l, V3::from_fn(|_, _| next())).rotated(r)
            });
            let onto = &mut out.geometry.bodies[topology.nodes[node].body];
            onto.mass += next();
            onto.inertia = onto.inertia.map(|v| v + next());
            for k in own.clone() {
                out.q[k] += next();
            }
            for k in own.clone() {
                out.rate[k] += next();
            }
            for k in own.clone() {
                out.acceleration[k] += next();
            }
            for _ in own {
                next();
            }
            let onto = &mut out.geometry.flexible[i];
            *onto = onto.map(&mut |v| v + next());
            for (v, d) in world.iter().zip(&by) {
                bodies.displaced[node] += -v.cross_force(d);
            }
            bodies.virtual_[node] += by[0];
            bodies.velocity[node] += by[1];
            bodies.acceleration[node] += by[2];
        }
    }

    /// Columns of moving nodes to the modal coordinates and to the nodes' shapes.
    pub fn fold_back(&self, at: &Placement<T>, columns: &Columns<T>, out: &mut Slopes<T>) {
        let topology = self.eq.topology();
        let first = topology.modal.first().map_or(0, |m| m.first);
        for node in topology.nodes.iter().filter(|n| n.kind.is_modal()) {
            let (tip, own) = movers(topology, node);
            let geometry = &self.eq.geometry.tips[tip];
            for (k, modal) in own.clone().enumerate() {
                let c = first + modal;
                for i in 0..6 {
                    let (w, column) = (geometry.shape[k][i], node.first + i);
                    let (q, v, a) = (out.q[column], out.rate[column], out.acceleration[column]);
                    out.q[c] += w * q;
                    out.rate[c] += w * v;
                    out.acceleration[c] += w * a;
                    out.geometry.tips[tip].shape[k][i] += at.modal[modal] * q
                        + columns.rate[c] * v
                        + columns.acceleration[c] * a
                        + columns.virtual_[c] * out.virtual_[column];
                }
            }
            if !geometry.quadratic.is_empty() {
                self.second_back(at, columns, node, (tip, own), out);
            }
        }
    }

    /// The same of psi: w = psi q q / 2, w' = psi q q', w" = psi (q q" + q' q'), u_w = psi q u.
    fn second_back(
        &self,
        at: &Placement<T>,
        columns: &Columns<T>,
        node: &Node,
        (tip, own): (usize, std::ops::Range<usize>),
        out: &mut Slopes<T>,
    ) {
        let m = own.len();
        let start = self.eq.topology().modal[0].first + own.start;
        let all = start..start + m;
        let (q, u) = (&at.modal[own], &columns.virtual_[all.clone()]);
        let (v, a) = (&columns.rate[all.clone()], &columns.acceleration[all]);
        let three = |from: &[T]| V3::from_fn(|i, _| from[node.first + i]);
        let (by_q, by_v, by_a, by_u) =
            (three(&out.q), three(&out.rate), three(&out.acceleration), three(&out.virtual_));
        let turning = self.turning();
        for k in 0..m {
            for l in 0..m {
                let psi = self.eq.geometry.tips[tip].quadratic[k * m + l];
                let [p, r, s, t] = [by_q, by_v, by_a, by_u].map(|by| psi.dot(&by));
                out.q[start + k] += p * q[l] + r * v[l] + s * a[l] + t * u[l];
                out.rate[start + k] += r * q[l];
                out.acceleration[start + k] += s * q[l];
                let mut by =
                    by_q * (q[k] * q[l] * 0.5) + by_v * (q[k] * v[l]) + by_a * (q[k] * a[l]) + by_u * (q[k] * u[l]);
                if turning {
                    out.rate[start + k] += s * v[l] * 2.0;
                    by += by_a * (v[k] * v[l]);
                }
                out.geometry.tips[tip].quadratic[k * m + l] += by;
            }
        }
    }
}
