//! Scalars of a relative motion, by which joints hold, drive and spring, and the directions in which joints let bodies move.
use crate::spatial::{Real, Six, V3};

/// A scalar that depends on the relative motion u = A^T (p_B - p_A), R = A^T B of two markers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Coordinate {
    /// u_i
    Translation(usize),
    /// (log R)_i
    RotationVector(usize),
    /// atan2(R[s], R[c]) of two entries of R, on the turn that the coordinates of hinges tell; the joint's first or second angle
    Angle { s: (usize, usize), c: (usize, usize), index: usize },
    /// |u|
    Length,
    /// A_i . B_j = R_ij
    Dot(usize, usize),
    /// u_z - pitch angle about z, on the turn that u_z tells
    Thread,
    /// velocity of p_B along B_z; no displacement belongs to it
    Edge,
    /// motion of the disc's material point at its lowest place: 0 along the normal (the height of the disc), 1 along the track,
    /// 2 across it; displacements belong to the first alone
    Disc(usize),
}

impl Coordinate {
    /// Measured in metres?
    pub fn is_length(self) -> bool {
        match self {
            Coordinate::Translation(_)
            | Coordinate::Length
            | Coordinate::Thread
            | Coordinate::Edge
            | Coordinate::Disc(_) => true,
            Coordinate::RotationVector(_) | Coordinate::Angle { .. } | Coordinate::Dot(..) => false,
        }
    }
}

/// Rotation about the common z axis.
pub const ANGLE_Z: Coordinate = Coordinate::Angle { s: (1, 0), c: (0, 0), index: 0 };
/// Second angle of a universal joint, R = Rz(alpha) Rx(beta).
pub const ANGLE_BETA: Coordinate = Coordinate::Angle { s: (2, 1), c: (2, 2), index: 1 };

/// A direction in which a joint lets the outer body move: along or about an axis of the joint frame of the inner or the outer body.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Freedom {
    pub rotation: bool,
    /// a rotation that goes along its axis by the pitch of the joint
    pub pitched: bool,
    pub axis: usize,
    /// the axis belongs to the outer body's joint frame
    pub outer: bool,
    /// freedoms of stage 0 carry those of stage 1
    pub stage: usize,
    pub suffix: &'static str,
}

/// Along an axis of the inner body.
pub const fn slide(axis: usize, suffix: &'static str) -> Freedom {
    Freedom { rotation: false, pitched: false, axis, outer: false, stage: 0, suffix }
}

/// About an axis of the inner body.
pub const fn turn(axis: usize, stage: usize, suffix: &'static str) -> Freedom {
    Freedom { rotation: true, pitched: false, axis, outer: false, stage, suffix }
}

/// About an axis of the outer body.
pub const fn turn_outer(axis: usize, stage: usize, suffix: &'static str) -> Freedom {
    Freedom { rotation: true, pitched: false, axis, outer: true, stage, suffix }
}

/// About and along an axis of the inner body.
pub const fn thread(axis: usize, suffix: &'static str) -> Freedom {
    Freedom { pitched: true, ..turn(axis, 0, suffix) }
}

impl Freedom {
    /// The twist of the outer body for a unit rate, `arm` from a point on the axis.
    pub fn twist<T: Real>(&self, axis: &V3<T>, arm: &V3<T>, pitch: T) -> Six<T> {
        match (self.rotation, self.pitched) {
            (false, _) => Six::new(*axis, V3::zeros()),
            (true, false) => Six::new(axis.cross(arm), *axis),
            (true, true) => Six::new(axis.cross(arm) + axis * pitch, *axis),
        }
    }
}

/// A modal coordinate: it moves nothing by itself, but the nodes.
pub const MODAL: Freedom = slide(0, "");
