//! What was decided about the ranks of a system's constraints; `rank` decides it.
use std::sync::Arc;

use crate::linalg::rows::RowBlocks;

/// A constraint whose independence the drawing decides only just.
#[derive(Debug, Clone)]
pub struct Doubt {
    /// the joints, drives, couplers and constraints of its loops
    pub joints: Vec<String>,
    /// opening per radian of the freed direction, over the length of the loop
    pub singular_value: f64,
    /// was it taken for redundant?
    pub redundant: bool,
}

/// The ranks of a system's constraints, and the closed drawn pose at which they were found.
#[derive(Debug, Clone)]
pub struct Decision {
    pub rows: Arc<RowBlocks>,
    pub doubts: Vec<Doubt>,
    /// blocks whose drawn pose has a lower rank than its neighbours
    pub singular: Vec<usize>,
    pub closed: Vec<f64>,
    pub iterations: usize,
    pub tolerance: f64,
}
