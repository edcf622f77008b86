//! One file per analysis.
pub mod frf;
pub mod frf_sensitivity;
pub mod frf_singular;
pub mod response;
pub mod sparse_damped;
pub mod sparse_modal;
