//! Dense and sparse linear algebra that faer does not bring ready-made.
pub mod balance;
pub mod dense;
pub mod double_double;
pub mod eigen;
pub mod entries;
pub mod expm;
pub mod hessenberg;
pub mod jacobi;
pub mod krylov;
pub mod pivoted_cholesky;
pub mod quadratic;
pub mod small_lu;
pub mod sparse;
pub mod symmetric;
