//! What follows from the numbers: local markers, inertia tensors, natural lengths, over any number type.
//!
//! Tables hold world points of the drawn configuration; everything local is derived here and nowhere else, so that a derivative
//! with respect to a drawn point has one source.
use crate::joint::Axes;
use crate::model::air::{AirGeometry, SectionGeometry};
use crate::model::flexible::{FlexibleGeometry, TipGeometry, TipSpec};
use crate::model::layout::{self, bushing, flag, joint, load, spring_damper, torsion};
use crate::model::motion::MotionLaw;
use crate::model::tables::{BodyRef, ElementKind, Tables};
use crate::spatial::{M3, Pose, Real, V3, frame_of_axis, rotation_of_quaternion, vector};

#[derive(Debug, Clone)]
pub struct BodyGeometry<T: Real> {
    pub mass: T,
    /// about the centre of mass, body axes
    pub inertia: M3<T>,
    /// drawn pose: centre of mass in the world, body axes to world
    pub drawn: Pose<T>,
    /// centre of mass from the origin, body axes
    pub com: V3<T>,
}

/// Two markers: poses in the frame of their body's centre of mass, or in the world on ground.
#[derive(Debug, Clone)]
pub struct MarkerPair<T: Real> {
    pub a: Pose<T>,
    pub b: Pose<T>,
    /// of a rolling disc; zero elsewhere
    pub radius: T,
    /// of a screw, metres per radian; zero elsewhere
    pub pitch: T,
    /// among all pairs: joints, then elements
    pub number: usize,
}

#[derive(Debug, Clone)]
pub struct Geometry<T: Real> {
    pub bodies: Vec<BodyGeometry<T>>,
    pub joints: Vec<MarkerPair<T>>,
    pub elements: Vec<MarkerPair<T>>,
    /// drawn distance of a spring-damper or distance joint; zero elsewhere
    pub element_length: Vec<T>,
    pub joint_length: Vec<T>,
    pub motions: Vec<MotionLaw<T>>,
    /// local point and value; a follower's value in body axes, a dead load's in the world
    pub loads: Vec<(V3<T>, V3<T>)>,
    pub gravity: Option<V3<T>>,
    /// of flexible bodies and their moving nodes
    pub flexible: Vec<FlexibleGeometry<T>>,
    pub tips: Vec<TipGeometry<T>>,
    pub air: Vec<AirGeometry<T>>,
    pub sections: Vec<SectionGeometry<T>>,
}

impl<T: Real> Geometry<T> {
    pub fn derive(tables: &Tables, x: &[T]) -> Self {
        let tips: Vec<_> = tables.tips.iter().map(|tip| tip_geometry(tables, tip, x)).collect();
        let bodies: Vec<_> = tables
            .bodies
            .iter()
            .map(|b| {
                let own = body(&x[b.x..b.x + layout::body::SIZE]);
                match b.tip {
                    None => own,
                    Some(i) => massless(&own, &tips[i]),
                }
            })
            .collect();
        let local = |body: BodyRef, world: &Pose<T>| match body {
            None => *world,
            Some(b) => bodies[b].drawn.inverse().then(world),
        };
        let pair = |number: usize, a: BodyRef, b: BodyRef, pa: V3<T>, pb: V3<T>, frame: [M3<T>; 2]| MarkerPair {
            a: local(a, &Pose { p: pa, r: frame[0] }),
            b: local(b, &Pose { p: pb, r: frame[1] }),
            radius: T::zero(),
            pitch: T::zero(),
            number,
        };
        let mut joints = Vec::with_capacity(tables.joints.len());
        let mut joint_length = Vec::with_capacity(tables.joints.len());
        for (i, j) in tables.joints.iter().enumerate() {
            let n = &x[j.x..j.x + joint::SIZE];
            let (pa, pb) = (vector(n, joint::AT_A), vector(n, joint::AT_B));
            let frames = j.kind.frames(&joint_axes(j.flags, n));
            joints.push(MarkerPair {
                radius: n[joint::RADIUS],
                pitch: n[joint::PITCH],
                ..pair(i, j.a, j.b, pa, pb, frames)
            });
            joint_length.push(if j.kind.has_length() { distance(&pa, &pb) } else { T::zero() });
        }
        let mut elements = Vec::with_capacity(tables.elements.len());
        let mut element_length = Vec::with_capacity(tables.elements.len());
        for (i, e) in tables.elements.iter().enumerate() {
            let n = &x[e.x..];
            let (pa, pb, frame) = match e.kind {
                ElementKind::SpringDamper => {
                    (vector(n, spring_damper::AT_A), vector(n, spring_damper::AT_B), M3::identity())
                }
                ElementKind::Bushing => {
                    (vector(n, bushing::AT_A), vector(n, bushing::AT_B), turned(n, bushing::ORIENTATION))
                }
                ElementKind::Torsion => {
                    (vector(n, torsion::AT), vector(n, torsion::AT), frame_of_axis(&vector(n, torsion::AXIS)))
                }
            };
            elements.push(pair(tables.joints.len() + i, e.a, e.b, pa, pb, [frame, frame]));
            element_length.push(if e.kind == ElementKind::SpringDamper { distance(&pa, &pb) } else { T::zero() });
        }
        let loads = tables.loads.iter().map(|l| {
            let drawn = &bodies[l.body].drawn;
            let point = drawn.r.transpose() * (vector(x, l.x + load::AT) - drawn.p);
            let value = vector(x, l.x + load::VALUE);
            (point, if l.follower { drawn.r.transpose() * value } else { value })
        });
        Geometry {
            loads: loads.collect(),
            joints,
            elements,
            element_length,
            joint_length,
            motions: tables.motions.iter().map(|m| MotionLaw::derive(m, x)).collect(),
            gravity: tables.gravity.map(|g| vector(x, g)),
            flexible: (tables.flexible.iter()).map(|f| FlexibleGeometry::derive(f, x, &bodies[f.body].com)).collect(),
            tips,
            air: tables.air.iter().map(|a| AirGeometry::derive(&x[a.x..])).collect(),
            sections: tables
                .sections
                .iter()
                .map(|s| SectionGeometry::derive(&x[s.x..], &reference(tables, s.body, x)))
                .collect(),
            bodies,
        }
    }
}

impl<T: Real> Geometry<T> {
    /// The same numbers as others, one by one in a fixed order.
    pub fn map<U: Real>(&self, mut f: impl FnMut(T) -> U) -> Geometry<U> {
        fn pose<T: Real, U: Real>(p: &Pose<T>, f: &mut impl FnMut(T) -> U) -> Pose<U> {
            Pose { p: p.p.map(&mut *f), r: p.r.map(&mut *f) }
        }
        fn pairs<T: Real, U: Real>(all: &[MarkerPair<T>], f: &mut impl FnMut(T) -> U) -> Vec<MarkerPair<U>> {
            all.iter()
                .map(|p| MarkerPair {
                    a: pose(&p.a, f),
                    b: pose(&p.b, f),
                    radius: f(p.radius),
                    pitch: f(p.pitch),
                    number: p.number,
                })
                .collect()
        }
        let bodies = self.bodies.iter().map(|b| BodyGeometry {
            mass: f(b.mass),
            inertia: b.inertia.map(&mut f),
            drawn: pose(&b.drawn, &mut f),
            com: b.com.map(&mut f),
        });
        Geometry {
            bodies: bodies.collect(),
            joints: pairs(&self.joints, &mut f),
            elements: pairs(&self.elements, &mut f),
            element_length: self.element_length.iter().map(|v| f(*v)).collect(),
            joint_length: self.joint_length.iter().map(|v| f(*v)).collect(),
            motions: self.motions.iter().map(|m| m.map(&mut f)).collect(),
            loads: self.loads.iter().map(|(p, v)| (p.map(&mut f), v.map(&mut f))).collect(),
            gravity: self.gravity.map(|g| g.map(&mut f)),
            flexible: self.flexible.iter().map(|g| g.map(&mut f)).collect(),
            tips: self.tips.iter().map(|t| t.map(&mut f)).collect(),
            air: self.air.iter().map(|a| a.map(&mut f)).collect(),
            sections: self.sections.iter().map(|s| s.map(&mut f)).collect(),
        }
    }
}

/// Where a body's centre of mass is, or a node, from the origin of its frame, body axes.
fn reference<T: Real>(tables: &Tables, body: usize, x: &[T]) -> V3<T> {
    match tables.bodies[body].tip {
        Some(tip) => vector(x, tables.tips[tip].x + layout::node::POSITION),
        None => vector(x, tables.bodies[body].x + layout::body::COM),
    }
}

fn tip_geometry<T: Real>(tables: &Tables, tip: &TipSpec, x: &[T]) -> TipGeometry<T> {
    let f = &tables.flexible[tip.flexible];
    let com = vector(x, tables.bodies[f.body].x + layout::body::COM);
    TipGeometry::derive(tip, x, f.m, &com)
}

/// A moving node: its undeformed place in its flexible body.
fn massless<T: Real>(frame: &BodyGeometry<T>, tip: &TipGeometry<T>) -> BodyGeometry<T> {
    BodyGeometry {
        mass: T::zero(),
        inertia: M3::zeros(),
        drawn: Pose { p: frame.drawn.p + frame.drawn.r * tip.offset, r: frame.drawn.r },
        com: V3::zeros(),
    }
}

/// The rotation of the quaternion at a place.
fn turned<T: Real>(n: &[T], at: usize) -> M3<T> {
    rotation_of_quaternion(&n[at..at + 4])
}

/// From xx yy zz xy xz yz.
pub fn inertia<T: Real>(n: &[T]) -> M3<T> {
    M3::new(n[0], n[3], n[4], n[3], n[1], n[5], n[4], n[5], n[2])
}

fn body<T: Real>(n: &[T]) -> BodyGeometry<T> {
    use layout::body::{AT, COM, INERTIA, MASS, ORIENTATION};
    let (r, com) = (turned(n, ORIENTATION), vector(n, COM));
    BodyGeometry { mass: n[MASS], inertia: inertia(&n[INERTIA..]), drawn: Pose { p: vector(n, AT) + r * com, r }, com }
}

/// The axes that a joint is drawn with.
fn joint_axes<T: Real>(flags: i64, n: &[T]) -> Axes<T> {
    Axes {
        given: (flags & flag::FRAME_FROM_ORIENTATION != 0).then(|| turned(n, joint::ORIENTATION)),
        first: vector(n, joint::AXIS),
        second: vector(n, joint::AXIS2),
    }
}

fn distance<T: Real>(a: &V3<T>, b: &V3<T>) -> T {
    let d = b - a;
    let s = d.dot(&d);
    // coincident points have no direction; what needs one refuses them, the others must not see NaN
    if s.re() == 0.0 { T::zero() } else { s.sqrt() }
}
