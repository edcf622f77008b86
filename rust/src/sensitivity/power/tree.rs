//! What a change of bodies does to the tree: from adjoints of poses and twists to those of coordinates and joint frames.
//!
//! Twists, displacements and their adjoints (wrenches) count about points fixed in space, so that a twist does not change by moving
//! the body it belongs to. With D, V, U, A the adjoints of displacement, velocity, virtual velocity and acceleration of the bodies that
//! coordinate k moves, S its column and B the twist of the frame that carries it,
//! ```text
//! q^_k = S.D,   v^_k = S.V + (B x S).A,   a^_k = S.A
//! S^ = v V + u U + a A - v B x* A,   carried on by   D += S x* S^,   V += v S x* A
//! ```
use crate::model::tables::BodyRef;
use crate::multibody::placement::Placement;
use crate::multibody::topology::Topology;
use crate::spatial::{M3, Pose, Real, Six, V3, skew};

use super::flexible::OnTape;
use super::{Columns, Power, Slopes};

/// Twists of the bodies by virtual rates, and their accelerations (-g of ground included).
pub struct Twists<T: Real> {
    pub virtual_: Vec<Six<T>>,
    pub acceleration: Vec<Six<T>>,
}

/// Adjoints of all bodies about their centres of mass: of displacement, velocity, virtual velocity and acceleration.
pub struct Bodies<T: Real> {
    pub displaced: Vec<Six<T>>,
    pub velocity: Vec<Six<T>>,
    pub virtual_: Vec<Six<T>>,
    pub acceleration: Vec<Six<T>>,
}

impl<T: Real> Bodies<T> {
    pub fn none(n: usize) -> Self {
        let nothing = || vec![Six::zero(); n];
        Bodies { displaced: nothing(), velocity: nothing(), virtual_: nothing(), acceleration: nothing() }
    }
}

/// Adjoint of a marker's numbers in its body, from the wrench that is the adjoint of its displacement, about the marker's point.
/// Of the nine numbers of a rotation only what turns it counts: half of m x R belongs to the moment m.
pub fn marker_back<T: Real>(onto: &mut Pose<T>, local: &Pose<T>, body: &M3<T>, wrench: &Six<T>) {
    let t = body.transpose();
    onto.p += t * wrench.l;
    onto.r += turned(&(t * wrench.a), &local.r);
}

/// Adjoint of the nine numbers of R by the moment m: m.w for dR = w x R.
pub fn turned<T: Real>(m: &V3<T>, r: &M3<T>) -> M3<T> {
    skew(&(m * T::from(0.5))) * r
}

pub fn body_rotation<T: Real>(topology: &Topology, at: &Placement<T>, body: BodyRef) -> M3<T> {
    topology.node(body).map_or_else(M3::identity, |n| at.pose[n].r)
}

impl<T: OnTape> Power<'_, '_, T> {
    /// Virtual twists and accelerations of all bodies.
    pub fn twists(&self, at: &Placement<T>, columns: &Columns<T>) -> Twists<T> {
        let topology = self.eq.topology();
        let base = match self.gravity() {
            Some(g) => Six::new(-g, V3::zeros()),
            None => Six::zero(),
        };
        let n = topology.nodes.len();
        let (mut virtual_, mut acceleration): (Vec<Six<T>>, Vec<Six<T>>) =
            (Vec::with_capacity(n), Vec::with_capacity(n));
        for (i, node) in topology.nodes.iter().enumerate() {
            let (mut u, mut a) = match node.parent {
                None => (Six::zero(), base),
                Some(p) => {
                    let d = at.pose[i].p - at.pose[p].p;
                    (virtual_[p].motion_at(&d), acceleration[p].motion_at(&d))
                }
            };
            for k in node.first..node.first + node.n {
                let s = &at.column[k];
                u += s.scaled(columns.virtual_[k]);
                a += s.scaled(columns.acceleration[k]);
                if let (true, Some(v)) = (self.turning(), &at.velocity) {
                    a += v.before[k].cross_motion(s).scaled(columns.rate[k]);
                }
            }
            virtual_.push(u);
            acceleration.push(a);
        }
        Twists { virtual_, acceleration }
    }

    /// Bodies back to coordinates, joint frames and gravity.
    pub fn tree_back(&self, at: &Placement<T>, columns: &Columns<T>, mut bodies: Bodies<T>, out: &mut Slopes<T>) {
        let topology = self.eq.topology();
        for i in (0..topology.nodes.len()).rev() {
            let (inner, by_velocity) = self.joint_back(at, columns, i, &bodies, out);
            self.frames_back(at, i, &inner, &bodies.displaced[i], out);
            let (by_virtual, by_acceleration) = (bodies.virtual_[i], bodies.acceleration[i]);
            let Some(p) = topology.nodes[i].parent else {
                if let (Some(_), Some(g)) = (self.gravity(), &mut out.geometry.gravity) {
                    *g -= by_acceleration.l;
                }
                continue;
            };
            let d = at.pose[p].p - at.pose[i].p;
            bodies.displaced[p] += inner.wrench_at(&d);
            bodies.velocity[p] += by_velocity.wrench_at(&d);
            bodies.virtual_[p] += by_virtual.wrench_at(&d);
            bodies.acceleration[p] += by_acceleration.wrench_at(&d);
        }
    }

    /// The coordinates of a joint, outermost first; adjoints of displacement and velocity of what carries them all.
    fn joint_back(
        &self,
        at: &Placement<T>,
        columns: &Columns<T>,
        i: usize,
        bodies: &Bodies<T>,
        out: &mut Slopes<T>,
    ) -> (Six<T>, Six<T>) {
        let topology = self.eq.topology();
        let node = &topology.nodes[i];
        let (by_virtual, by_acceleration) = (&bodies.virtual_[i], &bodies.acceleration[i]);
        let (mut displaced, mut velocity) = (bodies.displaced[i], bodies.velocity[i]);
        for stage in (0..node.kind.stages()).rev() {
            let (mut d, mut v) = (Six::zero(), Six::zero());
            for k in node.first..node.first + node.n {
                if topology.dofs[k].freedom.stage != stage {
                    continue;
                }
                let (s, rate) = (&at.column[k], columns.rate[k]);
                out.q[k] += s.dot(&displaced);
                let pitched = topology.dofs[k].freedom.pitched;
                out.rate[k] += s.dot(&velocity);
                out.acceleration[k] += s.dot(by_acceleration);
                out.virtual_[k] += s.dot(by_virtual);
                let mut column = velocity.scaled(rate)
                    + by_virtual.scaled(columns.virtual_[k])
                    + by_acceleration.scaled(columns.acceleration[k]);
                if let (true, Some(own)) = (self.turning(), &at.velocity) {
                    let before = &own.before[k];
                    out.rate[k] += before.cross_motion(s).dot(by_acceleration);
                    column += -before.cross_force(by_acceleration).scaled(rate);
                    v += s.cross_force(by_acceleration).scaled(rate);
                }
                if let Some(j) = node.joint.filter(|_| pitched) {
                    // the axis times the angle moves the body, and the column goes along it
                    let turned = self.motion.q[node.q + k - node.first];
                    out.geometry.joints[j].pitch += s.a.dot(&(displaced.l * turned + column.l));
                }
                d += s.cross_force(&column);
            }
            displaced += d;
            velocity += v;
        }
        (displaced, velocity)
    }

    /// The frames of a tree joint: the inner one moves all that follows it, the outer one moves its body the other way.
    fn frames_back(&self, at: &Placement<T>, i: usize, inner: &Six<T>, body: &Six<T>, out: &mut Slopes<T>) {
        let topology = self.eq.topology();
        let (node, pose) = (&topology.nodes[i], &at.pose[i]);
        let own = (-*body).rotated(&pose.r.transpose());
        let geometry = &self.eq.geometry;
        let Some(j) = node.joint else {
            if node.kind.is_modal() {
                // the node's undeformed place is the inner frame, or of a reversed one the outer
                let carrier = node.parent.map_or_else(M3::identity, |p| at.pose[p].r);
                let tip = &mut out.geometry.tips[topology.tip(node)].offset;
                *tip += if node.reversed { own.l } else { carrier.transpose() * inner.l };
            } else {
                // world axes at the drawn centre of mass, the drawn axes in the body
                let drawn = &geometry.bodies[node.body].drawn;
                let onto = &mut out.geometry.bodies[node.body].drawn;
                onto.p += inner.l;
                onto.r += turned(&own.a, &drawn.r.transpose()).transpose();
            }
            return;
        };
        let (of, onto) = (&geometry.joints[j], &mut out.geometry.joints[j]);
        let ((of_inner, onto_inner), (of_outer, onto_outer)) = if node.reversed {
            ((&of.b, &mut onto.b), (&of.a, &mut onto.a))
        } else {
            ((&of.a, &mut onto.a), (&of.b, &mut onto.b))
        };
        let carrier = node.parent.map_or_else(Pose::identity, |p| at.pose[p]);
        let place = carrier.p + carrier.r * of_inner.p;
        let wrench = inner.wrench_at(&(place - pose.p));
        marker_back(onto_inner, of_inner, &carrier.r, &wrench);
        let there = own.wrench_at(&of_outer.p);
        onto_outer.p += there.l;
        onto_outer.r += turned(&there.a, &of_outer.r);
    }
}
