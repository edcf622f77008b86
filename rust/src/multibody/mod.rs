//! The compiled model: an immutable topology shared by all values of the numbers, and what is computed on it.
//!
//! ```text
//! topology    spanning tree (tree), tree coordinates, cut rows, connectors   (once per structure; compile makes it)
//! placement   poses and motion columns of a state                      (per state)
//! binding     elements, joints with springs and laws as connectors
//! air         forces of the air on the sections of blades
//! articulated M x = f on a tree without M               (per state)
//! inertia     M and the velocity and gravity terms, by recursion       (per state)
//! flexible    modal coordinates: their inertia, and the nodes that they move
//! connector   forces and tangents of elements and constraints
//! path        the same in tree coordinates, along the way between two bodies
//! tree_joint  the wrench that a joint of the tree carries, and how it turns
//! sparse      everything once more in absolute coordinates, for thousands of bodies
//! constraint  functions of several coordinates as rows
//! rows        values and Jacobian of all constraint rows
//! loop_lengths  of the loop that each row closes, and its rounding
//! spectrum    singular values of rows against their rounding
//! rank        which of them are redundant, decided once
//! decision    what was decided
//! potential   which forces have none
//! remoteness  rounding of places beside the arms of bodies
//! islands     bodies that nothing connects
//! singular_pose  where they depend on each other to first order only
//! closure     from the drawing to closed loops
//! loops       dependent coordinates, the transformation B''
//! ```
pub mod air;
pub mod articulated;
pub mod assemble;
mod binding;
mod compile;
pub mod connector;
pub mod connector_force;
pub mod decision;
pub mod flexible;
pub mod flexible_inertia;
mod flexible_scene;
pub mod inertia;
pub mod inertia_input;
pub mod islands;
pub mod numbers;
pub mod parts;
pub mod path;
pub mod placement;
pub mod potential;
pub mod remoteness;
pub mod rotations;
pub mod topology;
mod tree;
pub mod tree_joint;
pub mod wanted;

use std::sync::{Arc, OnceLock};

use crate::error::Result;
use crate::model::geometry::Geometry;
use crate::model::tables::Tables;
use crate::multibody::decision::Decision;
use crate::multibody::topology::Topology;

/// Topology plus values: immutable and cheap to clone; new values keep the topology.
#[derive(Debug, Clone)]
pub struct System {
    /// what does not depend on the numbers: shared with all other values of the model
    pub topology: Arc<Topology>,
    /// the numbers of the model, as of its Tables
    pub x: Arc<Vec<f64>>,
    pub(crate) geometry: Arc<Geometry<f64>>,
    /// characteristic length: makes ranks and minimum-norm reactions independent of units
    pub length: f64,
    /// accuracy of what was drawn: of lengths over `length`, and of angles (rad)
    pub tolerance: f64,
    /// ranks of the constraints, for every choice of effects that leave rows out
    pub(crate) decisions: Arc<[OnceLock<Arc<Decision>>; 4]>,
    pub(crate) row_scales: Arc<OnceLock<Vec<f64>>>,
}

impl System {
    /// Checks the Tables and compiles them. Errors name what is wrong in them. O(n) without loops.
    pub fn new(tables: Tables) -> Result<Self> {
        tables.check()?;
        let x = tables.x.clone();
        let topology = Arc::new(Topology::new(tables)?);
        Ok(Self::from_parts(topology, x))
    }

    /// The same model with other numbers in place of `x`; the topology is kept.
    pub fn with_values(&self, x: Vec<f64>) -> Result<Self> {
        if x.len() != self.x.len() {
            return Err(crate::error::Error::model(format!(
                "{} values were given, {} are needed",
                x.len(),
                self.x.len()
            )));
        }
        if let Some(i) = x.iter().position(|v| !v.is_finite()) {
            return Err(crate::error::Error::model(format!("value {i} is not finite")));
        }
        Ok(Self::from_parts(self.topology.clone(), x))
    }

    fn from_parts(topology: Arc<Topology>, x: Vec<f64>) -> Self {
        let geometry = Geometry::derive(&topology.tables, &x);
        let length = topology.characteristic_length(&geometry, &x);
        let tolerance = topology.tables.tolerance;
        let (decisions, row_scales) = (Arc::default(), Arc::default());
        System { topology, x: Arc::new(x), geometry: Arc::new(geometry), length, tolerance, decisions, row_scales }
    }

    /// Times after `start` at which a motion is not smooth, ascending.
    pub fn kinks(&self, start: f64) -> Vec<f64> {
        let all = self.geometry.motions.iter().flat_map(|m| m.kinks());
        let mut times: Vec<f64> = all.filter(|t| *t > start).collect();
        times.sort_by(f64::total_cmp);
        times.dedup();
        times
    }

    /// Times after `start` at which a table wakes after a quiet time.
    pub fn wakes(&self, start: f64) -> Vec<f64> {
        let all = self.geometry.motions.iter().flat_map(|m| m.wakes());
        all.filter(|t| *t > start).collect()
    }

    /// Bodies, then moving nodes of flexible ones.
    pub fn n_bodies(&self) -> usize {
        self.topology.nodes.len()
    }

    /// Number of tree coordinates.
    pub fn n_tree(&self) -> usize {
        self.topology.n_tree
    }
}
