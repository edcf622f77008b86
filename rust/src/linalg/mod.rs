//! Dense and sparse linear algebra that faer does not bring ready-made.
pub mod balance;
pub mod dense;
pub mod double_double;
pub mod eigen;
pub mod elimination;
pub mod entries;
pub mod expm;
pub mod hessenberg;
pub mod kkt;
pub mod krylov;
pub mod matrix;
pub mod quadratic;
pub mod rows;
pub mod small_lu;
pub mod sparse;
pub mod symmetric;
