//! Harmonic balance: M x" + C x' + K x + sum_e w_e law_e(w_e.x, w_e.x') = f(t) on Fourier coefficients.
//!
//! `basis` says which terms, `grid` transforms, `aft` evaluates one element, `linear` gives the dynamic stiffness of the retained
//! coordinates, `problem` adds them to a residual with its exact Jacobian.
pub mod monodromy;
pub mod propagator;
pub mod stability;

pub mod aft;
pub mod autonomous;
pub mod basis;
mod blocks;
pub mod condensed;
pub mod condensed_banded;
mod contact;
pub mod crossings;
pub mod element;
pub mod estimate;
pub mod exponents;
pub mod factor;
pub mod family;
pub mod grid;
pub mod linear;
pub mod modal;
pub mod peak;
mod periodic_state;
pub mod problem;
mod ramps;
pub mod refined;
pub mod response;
pub mod rows;
mod scales;
pub mod start;
mod tail;
pub mod tangents;
mod test_functions;
pub mod truncation;
