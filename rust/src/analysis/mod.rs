//! One file per analysis.
pub mod assembly;
pub mod equilibrium;
pub mod linearize;
pub mod reactions;
