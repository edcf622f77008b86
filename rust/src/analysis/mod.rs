//! One file per analysis.
pub mod assembly;
pub mod equilibrium;
pub mod linearize;
pub mod reactions;
pub mod modal;
