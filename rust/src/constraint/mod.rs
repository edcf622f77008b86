//! Constraint rows of a system: their values and slopes, which of them are redundant (decided once), closed loops, minimal coordinates.
pub mod assembly;
pub mod closure;
pub mod functions;
pub mod loop_lengths;
pub mod loops;
pub mod rank;
pub mod rows;
pub mod singular_pose;
pub mod spectrum;
