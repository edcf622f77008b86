//! One file per analysis.
pub mod assembly;
pub mod equilibrium;
pub mod linearize;
pub mod reactions;
pub mod modal;
pub mod frf;
pub mod frf_sensitivity;
pub mod frf_singular;
pub mod response;
pub mod hbm;
