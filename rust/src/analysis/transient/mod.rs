//! Motion in time, one file per scheme.
pub mod explicit;
