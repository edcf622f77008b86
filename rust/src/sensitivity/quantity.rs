//! What can be read of an instant: one text for values, derivatives and the tape.
use crate::error::{Error, Result};
use crate::integrate::{Equations, Instant, Motion};
use crate::model::tables::BodyRef;
use crate::multibody::connector::relative_of;
use crate::multibody::flexible::node_accelerations;
use crate::multibody::placement::Placement;
use crate::multibody::topology::Modal;
use crate::spatial::{Real, Six, V3, turned, turned_back};

use super::reactions::joint_reactions;

/// A point fixed in a body, given in the drawn world.
#[derive(Debug, Clone, Copy)]
pub enum Drawn {
    /// its numbers start here in x
    At(usize),
    Fixed([f64; 3]),
    /// the body's origin
    Origin,
}

#[derive(Debug, Clone, Copy)]
pub enum Quantity {
    /// position, velocity or acceleration (order 0, 1, 2) of a point of a body, world (3)
    Point(BodyRef, Drawn, u8),
    /// rotation matrix, row by row (9)
    Rotation(usize),
    /// angular velocity or acceleration (order 1, 2), world (3)
    Turning(usize, u8),
    /// free coordinates of a joint
    Joint(usize),
    /// wrench on the second body of a joint at its point, world (6)
    Reaction(usize),
    /// modal coordinates of a body, their rates or accelerations (order 0, 1, 2)
    Modal(usize, u8),
}

/// An instant over T.
pub struct Point<'a, T: Real> {
    pub motion: &'a Motion<T>,
    pub acceleration: &'a [T],
    pub lam: &'a [T],
}

impl Quantity {
    /// How many numbers it has.
    pub fn width(&self, eq: &Equations<'_, f64>) -> usize {
        match self {
            Quantity::Point(..) | Quantity::Turning(..) => 3,
            Quantity::Rotation(_) => 9,
            Quantity::Joint(j) => eq.topology().tables.joints[*j].kind.free_coordinates().len(),
            Quantity::Reaction(_) => 6,
            Quantity::Modal(body, _) => modal_of(eq, *body).map_or(0, |m| m.m),
        }
    }

    fn needs_accelerations(&self) -> bool {
        matches!(self, Quantity::Point(_, _, 2) | Quantity::Turning(_, 2))
    }
}

/// The modal coordinates of a body; None of a rigid one.
fn modal_of<'a, T: Real>(eq: &Equations<'a, T>, body: usize) -> Option<&'a Modal> {
    let topology = eq.topology();
    let place = topology.tables.flexible.iter().position(|f| f.body == body)?;
    topology.modal.get(place)
}

/// Quantities belong to the model.
pub fn check(eq: &Equations<'_, f64>, wanted: &[Quantity]) -> Result<()> {
    let tables = &eq.topology().tables;
    for q in wanted {
        let fits = match q {
            Quantity::Point(b, at, order) => {
                let x = match at {
                    Drawn::At(x) => x + 3 <= eq.x.len(),
                    _ => true,
                };
                b.is_none_or(|b| b < tables.bodies.len()) && x && *order < 3
            }
            Quantity::Rotation(b) => *b < tables.bodies.len(),
            Quantity::Turning(b, order) => *b < tables.bodies.len() && matches!(order, 1 | 2),
            Quantity::Joint(j) | Quantity::Reaction(j) => *j < tables.joints.len(),
            Quantity::Modal(body, order) => modal_of(eq, *body).is_some() && *order < 3,
        };
        if !fits {
            return Err(Error::model("a quantity does not belong to the model"));
        }
    }
    Ok(())
}

/// The same of an instant.
pub fn read(eq: &Equations<'_, f64>, at: &Instant, wanted: &[Quantity]) -> Result<Vec<f64>> {
    evaluate(eq, &Point { motion: &at.motion, acceleration: &at.acceleration, lam: &at.lam }, wanted)
}

/// All wanted numbers one after the other.
pub fn evaluate<T: Real>(eq: &Equations<'_, T>, at: &Point<'_, T>, wanted: &[Quantity]) -> Result<Vec<T>> {
    let placement = eq.place(at.motion);
    let accelerations =
        wanted.iter().any(Quantity::needs_accelerations).then(|| body_accelerations(eq, at, &placement));
    let reactions = wanted
        .iter()
        .any(|q| matches!(q, Quantity::Reaction(_)))
        .then(|| joint_reactions(eq, at, &placement))
        .transpose()?;
    let mut out = Vec::new();
    for q in wanted {
        match q {
            Quantity::Point(body, drawn, order) => {
                let v = point(eq, &placement, accelerations.as_deref(), *body, *drawn, *order);
                out.extend(v.iter().copied());
            }
            Quantity::Rotation(body) => {
                let r = placement.pose[eq.topology().node_of_body[*body]].r;
                out.extend((0..9).map(|k| r[(k / 3, k % 3)]));
            }
            Quantity::Turning(body, order) => {
                let node = eq.topology().node_of_body[*body];
                let v = match order {
                    1 => placement.velocity.as_ref().map_or_else(V3::zeros, |v| v.body[node].a),
                    _ => accelerations.as_ref().map_or_else(V3::zeros, |a| a[node].a),
                };
                out.extend(v.iter().copied());
            }
            Quantity::Joint(j) => {
                let spec = &eq.topology().tables.joints[*j];
                let pair = &eq.geometry.joints[*j];
                let here = relative_of(eq.topology(), &placement, spec.a, spec.b, pair);
                out.extend(spec.kind.free_coordinates().iter().map(|c| here.row(*c).e));
            }
            Quantity::Reaction(j) => {
                let w = reactions.as_ref().map_or_else(Six::zero, |r| r[*j]);
                out.extend((0..6).map(|i| w.get(i)));
            }
            Quantity::Modal(body, order) => {
                if let Some(m) = modal_of(eq, *body) {
                    out.extend_from_slice(match order {
                        0 => &at.motion.q[m.q..m.q + m.m],
                        1 => &at.motion.rate[m.first..m.first + m.m],
                        _ => &at.acceleration[m.first..m.first + m.m],
                    });
                }
            }
        }
    }
    Ok(out)
}

fn point<T: Real>(
    eq: &Equations<'_, T>,
    placement: &Placement<T>,
    accelerations: Option<&[Six<T>]>,
    body: BodyRef,
    drawn: Drawn,
    order: u8,
) -> V3<T> {
    let world = match drawn {
        Drawn::At(x) => Some(V3::new(eq.x[x], eq.x[x + 1], eq.x[x + 2])),
        Drawn::Fixed(p) => Some(V3::new(p[0], p[1], p[2]).map(T::from)),
        Drawn::Origin => None,
    };
    let Some(body) = body else {
        let fixed = world.unwrap_or_else(V3::zeros);
        return if order == 0 { fixed } else { V3::zeros() };
    };
    let node = eq.topology().node_of_body[body];
    let geometry = &eq.geometry.bodies[body];
    let local = world.map_or_else(|| -geometry.com, |p| turned_back(&geometry.drawn.r, &(p - geometry.drawn.p)));
    let pose = &placement.pose[node];
    let arm = turned(&pose.r, &local);
    if order == 0 {
        return pose.p + arm;
    }
    let v = placement.velocity.as_ref().map_or_else(Six::zero, |v| v.body[node]);
    if order == 1 {
        return v.l + v.a.cross(&arm);
    }
    let a = accelerations.map_or_else(Six::zero, |a| a[node]);
    a.l + a.a.cross(&arm) + v.a.cross(&v.a.cross(&arm))
}

/// Per node: acceleration of the centre of mass and angular acceleration, world.
fn body_accelerations<T: Real>(eq: &Equations<'_, T>, at: &Point<'_, T>, placement: &Placement<T>) -> Vec<Six<T>> {
    let topology = eq.topology();
    let Some(velocity) = placement.velocity.as_ref() else {
        return vec![Six::zero(); topology.nodes.len()];
    };
    // spatial accelerations first, which add up like velocities
    let mut spatial: Vec<Six<T>> = Vec::with_capacity(topology.nodes.len());
    let rate = Some(at.motion.rate.as_slice());
    let nodes = node_accelerations(topology, &eq.geometry, &placement.modal, rate, Some(at.acceleration));
    let n = at.acceleration.len();
    for (i, node) in topology.nodes.iter().enumerate() {
        let mut a =
            node.parent.map_or_else(Six::zero, |p| spatial[p].motion_at(&(placement.pose[i].p - placement.pose[p].p)));
        for d in node.first..node.first + node.n {
            let s = &placement.column[d];
            let speed = velocity.of(&at.motion.rate, d);
            a += velocity.before[d].cross_motion(s).scaled(speed);
            a += s.scaled(if d < n { at.acceleration[d] } else { nodes[d - n] });
        }
        spatial.push(a);
    }
    spatial.iter().zip(&velocity.body).map(|(a, v)| Six::new(a.l + v.a.cross(&v.l), a.a)).collect()
}
