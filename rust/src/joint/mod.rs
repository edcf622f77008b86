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
mod prismatic;
mod revolute;
mod rolling_disc;
mod spherical;
mod universal;

use crate::error::{Error, Result};
use crate::spatial::{M3, Real, V3, frame_of_axis};

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
    /// Place of a unit quaternion in q, and of its three rotations in v.
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
}

macro_rules! joints {
    ($($kind:ident in $file:ident),+ $(,)?) => {
        #[derive(Debug, Clone, Copy, PartialEq, Eq)]
        pub enum JointKind {
            $($kind),+
        }

        impl JointKind {
            pub const ALL: &'static [JointKind] = &[$(JointKind::$kind),+];

            pub fn name(self) -> &'static str {
                match self { $(JointKind::$kind => $file::$kind::NAME),+ }
            }

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

#[cfg(test)]
mod tests {
    use super::*;

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
