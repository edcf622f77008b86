//! One file per analysis.
pub mod frf;
mod frf_routes;
pub mod frf_sensitivity;
mod frf_singular;
pub mod frf_sparse;
pub mod history;
mod modes_of;
pub mod ports;
pub mod response;
pub mod sparse_damped;
pub mod sparse_modal;
pub mod sparse_pencil;
mod state;
