//! The joints: which relative motions they forbid, and which they leave free in which order.
use crate::error::{Error, Result};
use crate::model::layout::joint_type;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum JointKind {
    Fixed,
    Revolute,
    Prismatic,
    Cylindrical,
    Universal,
    Spherical,
    Planar,
    Free,
    Distance,
    KnifeEdge,
    RollingDisc,
    /// between the frame of a flexible body and a moving node: displacement, then rotations about x, y and z in turn. Its six
    /// columns belong to the modal coordinates, as the node's shape says.
    Node,
}

/// A scalar that depends on the relative motion u = A^T (p_B - p_A), R = A^T B of two markers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Coordinate {
    /// u_i
    Translation(usize),
    /// (log R)_i
    RotationVector(usize),
    /// atan2(R[s], R[c]) of two entries of R
    Angle { s: (usize, usize), c: (usize, usize) },
    /// |u|
    Length,
    /// A_i . B_j = R_ij
    Dot(usize, usize),
    /// velocity of p_B along B_z; no displacement belongs to it
    Edge,
    /// motion of the disc's material point at its lowest place: 0 along the normal (the height of the disc), 1 along the track,
    /// 2 across it; displacements belong to the first alone
    Disc(usize),
}

impl Coordinate {
    /// Measured in metres?
    pub fn is_length(self) -> bool {
        !matches!(self, Coordinate::RotationVector(_) | Coordinate::Angle { .. } | Coordinate::Dot(..))
    }
}

/// Rotation about the common z axis.
pub const ANGLE_Z: Coordinate = Coordinate::Angle { s: (1, 0), c: (0, 0) };
/// Second angle of a universal joint, R = Rz(alpha) Rx(beta).
pub const ANGLE_BETA: Coordinate = Coordinate::Angle { s: (2, 1), c: (2, 2) };

/// How a tree coordinate moves the outer body: along or about an axis of the joint frame carried by the inner or the outer body.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Freedom {
    pub rotation: bool,
    pub axis: usize,
    /// the axis belongs to the outer body's joint frame
    pub outer: bool,
    /// freedoms of stage 0 carry those of stage 1
    pub stage: usize,
    pub suffix: &'static str,
}

const fn slide(axis: usize, suffix: &'static str) -> Freedom {
    Freedom { rotation: false, axis, outer: false, stage: 0, suffix }
}

const fn turn(axis: usize, stage: usize, suffix: &'static str) -> Freedom {
    Freedom { rotation: true, axis, outer: false, stage, suffix }
}

const REVOLUTE: [Freedom; 1] = [turn(2, 0, "")];
const PRISMATIC: [Freedom; 1] = [slide(2, "")];
const CYLINDRICAL: [Freedom; 2] = [slide(2, "z"), turn(2, 0, "rz")];
const UNIVERSAL: [Freedom; 2] =
    [turn(2, 0, "alpha"), Freedom { rotation: true, axis: 0, outer: true, stage: 1, suffix: "beta" }];
const UNIVERSAL_REVERSED: [Freedom; 2] =
    [Freedom { rotation: true, axis: 2, outer: true, stage: 1, suffix: "alpha" }, turn(0, 0, "beta")];
const SPHERICAL: [Freedom; 3] = [turn(0, 0, "rx"), turn(1, 0, "ry"), turn(2, 0, "rz")];
const PLANAR: [Freedom; 3] = [slide(0, "x"), slide(1, "y"), turn(2, 1, "rz")];
const FREE: [Freedom; 6] =
    [slide(0, "x"), slide(1, "y"), slide(2, "z"), turn(0, 1, "rx"), turn(1, 1, "ry"), turn(2, 1, "rz")];

const fn late(freedom: Freedom, stage: usize) -> Freedom {
    Freedom { stage, ..freedom }
}

const NODE: [Freedom; 6] = [slide(0, ""), slide(1, ""), slide(2, ""), turn(0, 1, ""), turn(1, 2, ""), turn(2, 3, "")];
const NODE_REVERSED: [Freedom; 6] = [
    late(slide(0, ""), 3),
    late(slide(1, ""), 3),
    late(slide(2, ""), 3),
    turn(0, 2, ""),
    turn(1, 1, ""),
    turn(2, 0, ""),
];
/// A modal coordinate: it moves nothing by itself, but the nodes.
pub const MODAL: Freedom = slide(0, "");

impl JointKind {
    /// How many groups of coordinates carry each other.
    pub fn stages(self) -> usize {
        if self == JointKind::Node { 4 } else { 2 }
    }

    pub fn from_code(code: i64) -> Result<Self> {
        use JointKind::*;
        Ok(match code {
            joint_type::FIXED => Fixed,
            joint_type::REVOLUTE => Revolute,
            joint_type::PRISMATIC => Prismatic,
            joint_type::CYLINDRICAL => Cylindrical,
            joint_type::UNIVERSAL => Universal,
            joint_type::SPHERICAL => Spherical,
            joint_type::PLANAR => Planar,
            joint_type::FREE => Free,
            joint_type::DISTANCE => Distance,
            joint_type::KNIFE_EDGE => KnifeEdge,
            joint_type::ROLLING_DISC => RollingDisc,
            _ => return Err(Error::model(format!("joint type {code} does not exist"))),
        })
    }

    /// Does it have rows that restrict velocities alone?
    pub fn is_nonholonomic(self) -> bool {
        matches!(self, JointKind::KnifeEdge | JointKind::RollingDisc)
    }

    /// May this joint carry a body in the spanning tree before the free joints are looked at?
    pub fn in_tree(self) -> bool {
        !matches!(self, JointKind::Free | JointKind::Distance | JointKind::KnifeEdge | JointKind::RollingDisc)
    }

    /// Position-level constraint rows, zero when satisfied (docs/tables.md).
    pub fn constraints(self) -> &'static [Coordinate] {
        use Coordinate::{Dot, Length, Translation as T};
        match self {
            JointKind::Fixed => &[T(0), T(1), T(2), Dot(0, 2), Dot(1, 2), Dot(1, 0)],
            JointKind::Revolute => &[T(0), T(1), T(2), Dot(0, 2), Dot(1, 2)],
            JointKind::Prismatic => &[T(0), T(1), Dot(0, 2), Dot(1, 2), Dot(1, 0)],
            JointKind::Cylindrical => &[T(0), T(1), Dot(0, 2), Dot(1, 2)],
            JointKind::Universal => &[T(0), T(1), T(2), Dot(2, 0)],
            JointKind::Spherical => &[T(0), T(1), T(2)],
            JointKind::Planar => &[T(2), Dot(0, 2), Dot(1, 2)],
            JointKind::Distance => &[Length],
            JointKind::Free | JointKind::KnifeEdge | JointKind::RollingDisc | JointKind::Node => &[],
        }
    }

    /// Free coordinates in the order of `k`, `c` and `preload`.
    pub fn free_coordinates(self) -> &'static [Coordinate] {
        use Coordinate::{RotationVector as R, Translation as T};
        match self {
            JointKind::Revolute => &[ANGLE_Z],
            JointKind::Prismatic => &[T(2)],
            JointKind::Cylindrical => &[T(2), ANGLE_Z],
            JointKind::Universal => &[ANGLE_Z, ANGLE_BETA],
            JointKind::Spherical => &[R(0), R(1), R(2)],
            JointKind::Planar => &[T(0), T(1), ANGLE_Z],
            JointKind::Free => &[T(0), T(1), T(2), R(0), R(1), R(2)],
            _ => &[],
        }
    }

    /// Tree coordinates; `reversed` where the joint's first body is the outer one.
    pub fn freedoms(self, reversed: bool) -> &'static [Freedom] {
        match self {
            JointKind::Revolute => &REVOLUTE,
            JointKind::Prismatic => &PRISMATIC,
            JointKind::Cylindrical => &CYLINDRICAL,
            JointKind::Universal if reversed => &UNIVERSAL_REVERSED,
            JointKind::Universal => &UNIVERSAL,
            JointKind::Spherical => &SPHERICAL,
            JointKind::Planar => &PLANAR,
            JointKind::Free => &FREE,
            JointKind::Node if reversed => &NODE_REVERSED,
            JointKind::Node => &NODE,
            _ => &[],
        }
    }

    pub fn name(self) -> &'static str {
        match self {
            JointKind::Fixed => "fixed",
            JointKind::Revolute => "revolute",
            JointKind::Prismatic => "prismatic",
            JointKind::Cylindrical => "cylindrical",
            JointKind::Universal => "universal",
            JointKind::Spherical => "spherical",
            JointKind::Planar => "planar",
            JointKind::Free => "free",
            JointKind::Distance => "distance",
            JointKind::KnifeEdge => "knife_edge",
            JointKind::RollingDisc => "rolling_disc",
            JointKind::Node => "node",
        }
    }
}
