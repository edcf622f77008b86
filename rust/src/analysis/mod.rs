//! One file per analysis.
pub mod assembly;
pub mod eigen_sensitivity;
pub mod equilibrium;
pub mod frf;
pub mod frf_sensitivity;
pub mod frf_singular;
pub mod hbm;
pub mod linearize;
pub mod modal;
pub mod reactions;
pub mod response;
pub mod sparse_bodies;
pub mod sparse_damped;
pub mod sparse_modal;
pub mod stability;
pub mod transient;
