//! Places of the numbers of each object in its block of x (docs/tables.md). Written by `python -m mbrs.model.layout` from
//! the schema of Python; do not edit.
#![allow(dead_code, reason = "the whole table is here, whoever reads it")]

/// What `tolerance` of a model must stay below.
pub const LARGEST_TOLERANCE: f64 = 0.1;
/// `tolerance` of a model that does not say.
pub const DRAWING_TOLERANCE: f64 = 1e-07;

/// Bits of `flags` of joints and elements.
pub mod flag {
    /// `k` is given.
    pub const HAS_K: i64 = 1;
    /// `c` is given.
    pub const HAS_C: i64 = 2;
    /// `preload` is given.
    pub const HAS_PRELOAD: i64 = 4;
    /// `orientation` is given.
    pub const FRAME_FROM_ORIENTATION: i64 = 8;
    /// `length` is given.
    pub const LENGTH_GIVEN: i64 = 16;
}

/// Names of the joints by their code in `joint_type`.
pub mod joint_type {
    pub const NAMES: [&str; 13] = [
        "fixed",
        "revolute",
        "prismatic",
        "cylindrical",
        "universal",
        "spherical",
        "planar",
        "free",
        "distance",
        "knife_edge",
        "rolling_disc",
        "screw",
        "point_on_line",
    ];
}

/// Codes of `element_type`.
pub mod element_type {
    pub const SPRING_DAMPER: i64 = 0;
    pub const BUSHING: i64 = 1;
    pub const TORSION: i64 = 2;
}

/// Codes of `load_type`.
pub mod load_type {
    pub const FORCE: i64 = 0;
    pub const TORQUE: i64 = 1;
    pub const MODAL_FORCE: i64 = 2;
}

/// Codes of `air_inflow`.
pub mod air_inflow {
    pub const GIVEN: i64 = 0;
    pub const MOMENTUM: i64 = 1;
}

/// Bits of `air_unsteady`.
pub mod air_unsteady {
    pub const INFLOW: i64 = 1;
    pub const ATTACHED: i64 = 2;
    pub const STALL: i64 = 4;
}

/// The numbers of a body.
pub mod body {
    pub const AT: usize = 0;
    pub const ORIENTATION: usize = 3;
    pub const COM: usize = 7;
    pub const MASS: usize = 10;
    pub const INERTIA: usize = 11;
    pub const VELOCITY: usize = 17;
    pub const ANGULAR_VELOCITY: usize = 20;
    pub const SIZE: usize = 23;
}

/// The numbers of a joint.
pub mod joint {
    pub const AT_A: usize = 0;
    pub const AT_B: usize = 3;
    pub const AXIS: usize = 6;
    pub const AXIS2: usize = 9;
    pub const ORIENTATION: usize = 12;
    pub const K: usize = 16;
    pub const C: usize = 22;
    pub const PRELOAD: usize = 28;
    pub const LENGTH: usize = 34;
    pub const RADIUS: usize = 35;
    pub const PITCH: usize = 36;
    pub const SIZE: usize = 37;
}

/// The numbers of a spring damper.
pub mod spring_damper {
    pub const AT_A: usize = 0;
    pub const AT_B: usize = 3;
    pub const K: usize = 6;
    pub const C: usize = 7;
    pub const LENGTH: usize = 8;
    pub const PRELOAD: usize = 9;
    pub const SIZE: usize = 10;
}

/// The numbers of a bushing.
pub mod bushing {
    pub const AT_A: usize = 0;
    pub const AT_B: usize = 3;
    pub const ORIENTATION: usize = 6;
    pub const K: usize = 10;
    pub const C: usize = 46;
    pub const PRELOAD: usize = 82;
    pub const SIZE: usize = 88;
}

/// The numbers of a torsion.
pub mod torsion {
    pub const AT: usize = 0;
    pub const AXIS: usize = 3;
    pub const K: usize = 6;
    pub const C: usize = 7;
    pub const ANGLE: usize = 8;
    pub const PRELOAD: usize = 9;
    pub const SIZE: usize = 10;
}

/// The numbers of a load.
pub mod load {
    pub const AT: usize = 0;
    pub const VALUE: usize = 3;
    pub const SIZE: usize = 6;
}

/// The numbers of a marker.
pub mod marker {
    pub const AT: usize = 0;
    pub const ORIENTATION: usize = 3;
    pub const SIZE: usize = 7;
}

/// The numbers of a pose.
pub mod pose {
    pub const AT: usize = 0;
    pub const ORIENTATION: usize = 3;
    pub const SIZE: usize = 7;
}

/// The numbers of a gravity.
pub mod gravity {
    pub const GRAVITY: usize = 0;
    pub const SIZE: usize = 3;
}

/// The numbers of a coupler.
pub mod coupler {
    pub const RATIO: usize = 0;
    pub const OFFSET: usize = 1;
    pub const SIZE: usize = 2;
}

/// The numbers of a flexible.
pub mod flexible {
    pub const S: usize = 0;
    pub const fn p1(m: usize) -> usize {
        3 * m
    }
    pub const fn p2(m: usize) -> usize {
        12 * m
    }
    pub const fn k(m: usize) -> usize {
        12 * m + 9 * m * m
    }
    pub const fn c(m: usize) -> usize {
        12 * m + 10 * m * m
    }
    pub const fn kg(m: usize) -> usize {
        12 * m + 11 * m * m
    }
    pub const fn size(m: usize) -> usize {
        12 * m + 23 * m * m
    }
}

/// The numbers of a node.
pub mod node {
    pub const POSITION: usize = 0;
    pub const SHAPE: usize = 3;
    pub const fn size(m: usize) -> usize {
        3 + 6 * m
    }
}

/// The numbers of a quadratic.
pub mod quadratic {
    pub const DISPLACEMENT: usize = 0;
    pub const fn size(m: usize) -> usize {
        3 * m * m
    }
}

/// The numbers of a air.
pub mod air {
    pub const DENSITY: usize = 0;
    pub const SPEED: usize = 1;
    pub const SHEAR: usize = 2;
    pub const REFERENCE_HEIGHT: usize = 3;
    pub const DIRECTION: usize = 4;
    pub const UP: usize = 7;
    pub const AXIS: usize = 10;
    pub const PITCH: usize = 13;
    pub const GROUND: usize = 14;
    pub const STALL: usize = 15;
    pub const SIZE: usize = 16;
}

/// The numbers of a section.
pub mod section {
    pub const POSITION: usize = 0;
    pub const WIDTH: usize = 3;
    pub const CHORD: usize = 4;
    pub const TWIST: usize = 5;
    pub const CENTRE: usize = 6;
    pub const REAR: usize = 7;
    pub const SHARE: usize = 8;
    pub const SOLIDITY: usize = 9;
    pub const LOSS: usize = 10;
    pub const RADIUS: usize = 12;
    pub const SPAN: usize = 13;
    pub const SLOPE: usize = 14;
    pub const ZERO: usize = 15;
    pub const SIZE: usize = 16;
}
