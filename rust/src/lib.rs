//! Vibration and motion of spatial multibody systems.
//!
//! ```text
//! M(q) v' + Phi_q^T lam + D^T mu = Q(t, q, v),   Phi(t, q) = 0,   D(q) v + d(t, q) = 0,   q' = N(q) v
//! M x" + (C + G) x' + (K + N) x + sum_e w_e law_e(w_e.x, w_e.x') = f_e(t)
//! ```
//! `expressions` evaluates programs of parameters and of users' functions, `model` reads the Tables, `kinematics` relates two markers,
//! `constraint` and `multibody` assemble, `linearize` makes the matrices of `second_order`; `equilibrium`, `integrate` and `periodic`
//! solve, `sensitivity` differentiates, `designs` repeats, `aero` is the air around it; `python` is the only door to Python. Modules are
//! private: what Rust programs may use, from Tables to modes and transfer functions, is named below.
#![warn(missing_docs)]
// the border uses most of the core; without it dead code cannot be told
#![cfg_attr(not(feature = "python"), allow(dead_code, unused_imports))]

mod ad;
mod aero;
mod constraint;
mod designs;
mod equilibrium;
mod error;
mod expressions;
mod force;
mod integrate;
mod joint;
mod kinematics;
mod linalg;
mod linearize;
mod memory;
mod model;
mod multibody;
mod periodic;
mod run;
mod second_order;
mod sensitivity;
mod solve;
mod spatial;
mod tolerances;

#[cfg(feature = "python")]
mod python;

pub use constraint::assembly::assemble;
pub use equilibrium::{Equilibrium, equilibrium};
pub use error::{Error, Result};
pub use joint::JointKind;
pub use linearize::{Linearization, Setting, linearize};
pub use model::layout::{DRAWING_TOLERANCE, flag};
pub use model::tables::{BodyRef, BodySpec, ElementKind, ElementSpec, JointSpec, Tables};
pub use multibody::System;
pub use multibody::assemble::Effects;
pub use run::{Cancel, Counts};
pub use second_order::SecondOrder;
pub use second_order::linear_system::{LinearSystem, Matrices};
pub use second_order::modal::{Kind, modes};
pub use second_order::ports::Ports;
