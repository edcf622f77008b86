//! One file per analysis.
pub mod hbm;
