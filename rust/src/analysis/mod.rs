//! One file per analysis.
pub mod eigen_sensitivity;
pub mod modal;
