//! One file per analysis.
pub mod modal;
