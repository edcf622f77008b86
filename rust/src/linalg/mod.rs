//! Dense and sparse linear algebra that faer does not bring ready-made.
pub mod balance;
pub mod dense;
pub mod eigen;
