//! The joints. Each is one file that implements `Joint`, and one line of the table below; nothing else lists them.
//!
//! A joint lets the outer body move against the inner one by nv freedoms with the rates v. Its coordinates q are nv numbers, or
//! nv + 1 where a unit quaternion stands for three rotations that act together:
//! ```text
//! relative pose of the outer marker in the inner one   X(q),   q = 0 (quaternion 1) as drawn
//! its twist                                            sum over k of S_k(q) v_k,   S_k fixed in the frame that carries freedom k
//! q' = N(q) v:    q_k' = v_k,   quaternion' = (0, omega) quaternion / 2,   omega in the axes of the inner marker
//! ```
//! An angle is a number that grows over turns. Coordinates count the motion of the joint's second body against its first. A joint is
//! `reversed` where the first body is the outer one: its freedoms are then those of the first body against the second, and coordinates
//! count them backwards (a quaternion is that of X itself).
pub mod coordinate;
mod cylindrical;
mod distance;
mod fixed;
mod free;
mod knife_edge;
mod node;
mod planar;
mod point_on_line;
mod prismatic;
mod revolute;
mod rolling_disc;
mod screw;
mod spherical;
mod universal;

use crate::error::{Error, Result};
use crate::spatial::{
    M3, Pose, Real, V3, frame_of_axis, log_so3, product, quaternion_of_vector, quaternion_product, rotation_about,
    rotation_of_quaternion,
};

pub use coordinate::{ANGLE_BETA, ANGLE_Z, Coordinate, Freedom, MODAL};

/// What a joint does for the spanning tree.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Role {
    /// carries a body, or is cut where the tree reaches the body another way
    Carries,
    /// carries a body that no other joint reaches, and holds nothing elsewhere
    Frees,
    /// restricts motion by its rows alone, never carries
    Restricts,
    /// carries a node of a flexible body, its columns are moved by modal coordinates
    Modal,
}

/// The axes that a joint is drawn with.
#[derive(Debug, Clone, Copy)]
pub struct Axes<T: Real> {
    pub given: Option<M3<T>>,
    pub first: V3<T>,
    pub second: V3<T>,
}

impl<T: Real> Axes<T> {
    /// The frame that was given, else one with the first axis for z.
    pub fn frame(&self) -> M3<T> {
        self.given.unwrap_or_else(|| frame_of_axis(&self.first))
    }
}

/// A kind of joint. There are no defaults: what is left out does not compile.
pub trait Joint {
    const NAME: &'static str;
    const ROLE: Role;
    /// Freedoms of the tree, in the order of its coordinates; perpendicular to each other.
    const FREEDOMS: &'static [Freedom];
    const REVERSED: &'static [Freedom];
    /// Place of a unit quaternion at the end of q, and of its three rotations at the end of v.
    const QUATERNION: Option<usize>;
    /// Coordinates in the order of `k`, `c`, `preload`, of drives and couplers.
    const COORDINATES: &'static [Coordinate];
    /// Rows on position level where the joint is cut, zero when satisfied (docs/tables.md).
    const CONSTRAINTS: &'static [Coordinate];
    /// Rows that restrict velocities alone.
    const VELOCITY_CONSTRAINTS: &'static [Coordinate];
    /// Is its row held against a natural length, drawn or given?
    const HAS_LENGTH: bool;

    /// The joint frames on the first and the second body as drawn (world axes).
    fn frames<T: Real>(axes: &Axes<T>) -> [M3<T>; 2];

    /// X(q): the outer marker in the inner one; `pitch` of the joint in metres per radian.
    fn pose<T: Real>(q: &[T], reversed: bool, pitch: T) -> Pose<T>;

    /// The coordinates of the pose that comes closest to another, angles within half a turn.
    fn coordinates(pose: &Pose<f64>, reversed: bool, pitch: f64) -> Vec<f64>;
}

/// -1 where coordinates count backwards.
fn sign(reversed: bool) -> f64 {
    if reversed { -1.0 } else { 1.0 }
}

/// Turned about z.
fn turned<T: Real>(angle: T, reversed: bool) -> Pose<T> {
    Pose { p: V3::zeros(), r: rotation_about(2, angle * sign(reversed)) }
}

/// The angle about z, within half a turn.
fn angle(r: &M3<f64>, reversed: bool) -> f64 {
    r[(1, 0)].atan2(r[(0, 0)]) * sign(reversed)
}

macro_rules! joints {
    ($($kind:ident in $file:ident),+ $(,)?) => {
        /// The kinds of joints, one file each.
        #[derive(Debug, Clone, Copy, PartialEq, Eq)]
        pub enum JointKind {
            $(#[doc = concat!("`", stringify!($file), "`")] $kind),+
        }

        impl JointKind {
            /// In the order of their codes.
            pub const ALL: &'static [JointKind] = &[$(JointKind::$kind),+];

            /// As Tables and messages tell it.
            pub fn name(self) -> &'static str {
                match self { $(JointKind::$kind => $file::$kind::NAME),+ }
            }

            /// Whether it carries bodies in the tree, or adds rows.
            pub fn role(self) -> Role {
                match self { $(JointKind::$kind => $file::$kind::ROLE),+ }
            }

            /// Freedoms of the tree; `reversed` where the joint's first body is the outer one.
            pub fn freedoms(self, reversed: bool) -> &'static [Freedom] {
                match (self, reversed) {
                    $((JointKind::$kind, false) => $file::$kind::FREEDOMS,
                    (JointKind::$kind, true) => $file::$kind::REVERSED),+
                }
            }

            /// Where its q holds a unit quaternion, and its v three rotations that act together.
            pub fn quaternion(self) -> Option<usize> {
                match self { $(JointKind::$kind => $file::$kind::QUATERNION),+ }
            }

            /// Free coordinates in the order of `k`, `c` and `preload`.
            pub fn free_coordinates(self) -> &'static [Coordinate] {
                match self { $(JointKind::$kind => $file::$kind::COORDINATES),+ }
            }

            /// Position-level constraint rows, zero when satisfied (docs/tables.md).
            pub fn constraints(self) -> &'static [Coordinate] {
                match self { $(JointKind::$kind => $file::$kind::CONSTRAINTS),+ }
            }

            /// Rows that restrict velocities alone.
            pub fn velocity_constraints(self) -> &'static [Coordinate] {
                match self { $(JointKind::$kind => $file::$kind::VELOCITY_CONSTRAINTS),+ }
            }

            /// Is its row held against a natural length, drawn or given?
            pub fn has_length(self) -> bool {
                match self { $(JointKind::$kind => $file::$kind::HAS_LENGTH),+ }
            }

            /// The joint frames on the first and the second body as drawn (world axes).
            pub fn frames<T: Real>(self, axes: &Axes<T>) -> [M3<T>; 2] {
                match self { $(JointKind::$kind => $file::$kind::frames(axes)),+ }
            }

            /// X(q): the outer marker in the inner one.
            pub fn pose<T: Real>(self, q: &[T], reversed: bool, pitch: T) -> Pose<T> {
                match self { $(JointKind::$kind => $file::$kind::pose(q, reversed, pitch)),+ }
            }

            /// The coordinates of the pose that comes closest to another, angles within half a turn.
            pub fn coordinates(self, pose: &Pose<f64>, reversed: bool, pitch: f64) -> Vec<f64> {
                match self { $(JointKind::$kind => $file::$kind::coordinates(pose, reversed, pitch)),+ }
            }
        }
    };
}

joints! {
    Fixed in fixed,
    Revolute in revolute,
    Prismatic in prismatic,
    Cylindrical in cylindrical,
    Universal in universal,
    Spherical in spherical,
    Planar in planar,
    Free in free,
    Distance in distance,
    KnifeEdge in knife_edge,
    RollingDisc in rolling_disc,
    Screw in screw,
    PointOnLine in point_on_line,
    Node in node,
}

impl JointKind {
    /// The joint of a name of the Tables.
    pub fn named(name: &str) -> Result<Self> {
        let mut all = Self::ALL.iter().filter(|k| k.role() != Role::Modal);
        all.find(|k| k.name() == name)
            .copied()
            .ok_or_else(|| Error::model(format!("joint type '{name}' does not exist")))
    }

    /// How many groups of freedoms carry each other.
    pub fn stages(self) -> usize {
        let last = |freedoms: &[Freedom]| freedoms.iter().map(|f| f.stage + 1).max();
        last(self.freedoms(false)).max(last(self.freedoms(true))).unwrap_or(0)
    }

    /// Does it have rows that restrict velocities alone?
    pub fn is_nonholonomic(self) -> bool {
        !self.velocity_constraints().is_empty()
    }

    /// Do modal coordinates move its columns, which are no coordinates of their own?
    pub fn is_modal(self) -> bool {
        self.role() == Role::Modal
    }
}

/// The manifold of q.
impl JointKind {
    /// How many numbers q has; those of nodes of flexible bodies are modal coordinates.
    pub fn nq(self) -> usize {
        if self.is_modal() { 0 } else { self.freedoms(false).len() + usize::from(self.quaternion().is_some()) }
    }

    /// q as drawn: the pose is the identity.
    pub fn identity<T: Real>(self) -> Vec<T> {
        let mut q = vec![T::zero(); self.nq()];
        if let Some(k) = self.quaternion() {
            q[k] = T::one();
        }
        q
    }

    /// Moves q by increments dy of the rates: numbers add up, a quaternion is turned by a rotation vector.
    pub fn integrate<T: Real>(self, reversed: bool, q: &mut [T], dy: &[T]) {
        let plain = self.quaternion().unwrap_or(dy.len());
        for (q, d) in q.iter_mut().zip(&dy[..plain]) {
            *q += *d;
        }
        if let Some((now, d)) = split(self, q, dy) {
            let theta = d * T::from(sign(reversed));
            let next = quaternion_product(&quaternion_of_vector(&theta), &now);
            // one step of Newton's method for the length keeps rounding from adding up
            let length = next.iter().fold(T::zero(), |s, x| s + *x * *x);
            let factor = (T::from(3.0) - length) * 0.5;
            q[plain..].iter_mut().zip(next).for_each(|(q, x)| *q = x * factor);
        }
    }

    /// The increments that lead from one q to another; three rotations together are at most half a turn.
    pub fn difference<T: Real>(self, reversed: bool, from: &[T], to: &[T], out: &mut [T]) {
        let plain = self.quaternion().unwrap_or(out.len());
        for (i, d) in out[..plain].iter_mut().enumerate() {
            *d = to[i] - from[i];
        }
        if self.quaternion().is_some() {
            let r = product(&rotation_of_quaternion(&to[plain..]), &rotation_of_quaternion(&from[plain..]).transpose());
            let theta = log_so3(&r) * T::from(sign(reversed));
            out[plain..].copy_from_slice(theta.as_slice());
        }
    }

    /// N(q)^T f: what numbers that count along q count along the increments.
    pub fn pull(self, reversed: bool, q: &[f64], f: &[f64], out: &mut [f64]) {
        let plain = self.quaternion().unwrap_or(out.len());
        out[..plain].copy_from_slice(&f[..plain]);
        if self.quaternion().is_some() {
            for (k, out) in out[plain..].iter_mut().enumerate() {
                let along = quaternion_rate(&q[plain..], V3::ith(k, sign(reversed)));
                *out = along.iter().zip(&f[plain..]).map(|(a, b)| a * b).sum();
            }
        }
    }

    /// Numbers f along a unit q with N(q)^T f = by, added up.
    pub fn push(self, reversed: bool, q: &[f64], by: &[f64], onto: &mut [f64]) {
        let plain = self.quaternion().unwrap_or(by.len());
        onto.iter_mut().zip(&by[..plain]).for_each(|(f, b)| *f += b);
        if let Some((_, by)) = split(self, q, by) {
            // N^T N = 1/4 of a unit quaternion
            let f = quaternion_rate(&q[plain..], by * (4.0 * sign(reversed)));
            onto[plain..].iter_mut().zip(f).for_each(|(o, f)| *o += f);
        }
    }
}

/// The quaternion in q and its three numbers of v.
fn split<T: Real>(kind: JointKind, q: &[T], v: &[T]) -> Option<([T; 4], V3<T>)> {
    let k = kind.quaternion()?;
    Some(([q[k], q[k + 1], q[k + 2], q[k + 3]], V3::new(v[k], v[k + 1], v[k + 2])))
}

/// (0, omega) quaternion / 2.
fn quaternion_rate(q: &[f64], omega: V3<f64>) -> [f64; 4] {
    quaternion_product(&[0.0, omega.x / 2.0, omega.y / 2.0, omega.z / 2.0], &[q[0], q[1], q[2], q[3]])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spatial::{log_so3, quaternion_of_rotation};
    use num_dual::Dual64;

    const PITCH: f64 = -0.37;

    fn numbers(n: usize, seed: usize) -> Vec<f64> {
        (0..n).map(|i| ((i + 1) as f64 * 0.618 + seed as f64 * 0.377).fract() * 2.2 - 1.1).collect()
    }

    fn somewhere(kind: JointKind, reversed: bool, seed: usize) -> Vec<f64> {
        let mut q = kind.identity();
        kind.integrate(reversed, &mut q, &numbers(kind.freedoms(false).len(), seed));
        q
    }

    fn in_tree() -> impl Iterator<Item = (JointKind, bool)> {
        let kinds = JointKind::ALL.iter().filter(|k| k.nq() > 0);
        kinds.flat_map(|k| [(*k, false), (*k, true)])
    }

    /// Dual numbers along q' = N v against the freedoms, whatever a joint says of both.
    #[test]
    fn the_pose_moves_along_the_freedoms() {
        for (kind, reversed) in in_tree() {
            let q = somewhere(kind, reversed, 3);
            for (k, freedom) in kind.freedoms(reversed).iter().enumerate() {
                let mut moved: Vec<Dual64> = q.iter().map(|v| Dual64::from(*v)).collect();
                let mut dy = vec![Dual64::from(0.0); kind.freedoms(reversed).len()];
                dy[k].eps = 1.0;
                kind.integrate(reversed, &mut moved, &dy);
                let there: Pose<Dual64> = kind.pose(&moved, reversed, Dual64::from(PITCH));
                let (r, spin) = (there.real().r, there.r.map(|x| x.eps));
                let w = spin * r.transpose();
                let omega = V3::new(w[(2, 1)], w[(0, 2)], w[(1, 0)]);
                let axis = if freedom.outer { r.column(freedom.axis).into_owned() } else { V3::ith(freedom.axis, 1.0) };
                let expected = axis * sign(reversed);
                let twist = freedom.twist(&expected, &V3::zeros(), PITCH);
                assert!((omega - twist.a).norm() < 1e-13, "{kind:?} {reversed} {k}");
                assert!((there.p.map(|x| x.eps) - twist.l).norm() < 1e-13, "{kind:?} {reversed} {k}");
            }
        }
    }

    #[test]
    fn coordinates_and_increments_come_back() {
        for (kind, reversed) in in_tree() {
            let (from, to) = (somewhere(kind, reversed, 1), somewhere(kind, reversed, 2));
            let n = kind.freedoms(reversed).len();
            let mut dy = vec![0.0; n];
            kind.difference(reversed, &from, &to, &mut dy);
            let mut q = from.clone();
            kind.integrate(reversed, &mut q, &dy);
            let x: Pose<f64> = kind.pose(&to, reversed, PITCH);
            for other in [q, kind.coordinates(&x, reversed, PITCH)] {
                let y: Pose<f64> = kind.pose(&other, reversed, PITCH);
                assert!((x.p - y.p).norm() + (x.r - y.r).norm() < 1e-13, "{kind:?} {reversed}");
            }
            // adjoints: N^T (push by) = by, and N^T f against the pose of a dual number
            let mut f = vec![0.0; kind.nq()];
            kind.push(reversed, &to, &dy, &mut f);
            let mut back = vec![0.0; n];
            kind.pull(reversed, &to, &f, &mut back);
            assert!(back.iter().zip(&dy).all(|(a, b)| (a - b).abs() < 1e-13), "{kind:?} {reversed}");
            for k in 0..n {
                let mut moved: Vec<Dual64> = to.iter().map(|v| Dual64::from(*v)).collect();
                let mut along = vec![Dual64::from(0.0); n];
                along[k].eps = 1.0;
                kind.integrate(reversed, &mut moved, &along);
                let slope: f64 = moved.iter().zip(&f).map(|(q, f)| q.eps * f).sum();
                assert!((slope - back[k]).abs() < 1e-13, "{kind:?} {reversed} {k}");
            }
        }
    }

    #[test]
    fn an_angle_grows_and_a_quaternion_keeps_its_length() {
        let (mut hinge, mut ball) = (JointKind::Revolute.identity(), JointKind::Spherical.identity());
        for _ in 0..100_000 {
            JointKind::Revolute.integrate(false, &mut hinge, &[0.7]);
            JointKind::Spherical.integrate(false, &mut ball, &[0.3, -0.5, 0.4]);
        }
        assert!((hinge[0] - 70_000.0_f64).abs() < 1e-6);
        let length: f64 = ball.iter().map(|x: &f64| x * x).sum();
        assert!((length - 1.0).abs() < 1e-14);
        let w = V3::new(0.3, -0.5, 0.4);
        for size in [0.0, 1e-4, 0.2, 1.0, 4.0] {
            let r = rotation_of_quaternion(&quaternion_of_vector(&(w * size)));
            assert!((log_so3(&r) - w * size).norm() < 1e-14 && quaternion_of_rotation(&r)[0] > 0.0);
        }
    }

    /// Rows and freedoms of a joint that may be cut add up to six, and both directions have the same freedoms.
    #[test]
    fn freedoms_and_rows_are_six() {
        for kind in JointKind::ALL {
            assert_eq!(kind.freedoms(false).len(), kind.freedoms(true).len());
            if kind.role() == Role::Carries || kind.role() == Role::Frees {
                assert_eq!(kind.freedoms(false).len() + kind.constraints().len(), 6, "{}", kind.name());
                assert_eq!(kind.freedoms(false).len(), kind.free_coordinates().len(), "{}", kind.name());
            }
            assert_eq!(kind.is_modal(), JointKind::named(kind.name()).is_err());
        }
    }
}
