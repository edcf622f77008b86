//! Dense and sparse linear algebra that faer does not bring ready-made.
