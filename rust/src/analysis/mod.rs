//! One file per analysis.
pub mod hbm;
pub mod stability;
