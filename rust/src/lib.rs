//! Vibration and motion of spatial multibody systems.
//!
//! ```text
//! M(q) v' + Phi_q^T lam + D^T mu = Q(t, q, v),   Phi(t, q) = 0,   D(q) v + d(t, q) = 0,   q' = N(q) v
//! M x" + (C + G) x' + (K + N) x + sum_e w_e law_e(w_e.x, w_e.x') = f_e(t)
//! ```
//! `expressions` evaluates programs of parameters and of users' functions, `model` reads the Tables, `kinematics` relates two markers, `system` assembles and linearises, `analysis` solves, `aero` is the air around it;
//! `python` is the only door to Python.
pub mod aero;
pub mod analysis;
pub mod error;
pub mod expressions;
pub mod force;
pub mod joint;
pub mod kinematics;
pub mod linalg;
pub mod memory;
pub mod model;
pub mod run;
pub mod second_order;
pub mod solve;
pub mod spatial;
pub mod system;
pub mod tolerances;

#[cfg(feature = "python")]
mod python;
