//! Modes of dense matrices.
use numpy::Complex64;
use pyo3::prelude::*;

use super::border::{Dense, Vector};
use crate::error::Result;
use crate::memory;
use crate::run::Counts;
use crate::second_order::linear_system::LinearSystem;
use crate::second_order::modal::Modal;
use crate::tolerances::{
    frequency_response::NO_FEEDTHROUGH, linearisation::BALANCED, matrices::ENTRY_ROUNDING, modes::SAME_ROOT,
};

pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("BALANCED", BALANCED)?;
    module.add("ENTRY_ROUNDING", ENTRY_ROUNDING)?;
    module.add("NO_FEEDTHROUGH", NO_FEEDTHROUGH)?;
    module.add("SAME_ROOT", SAME_ROOT)
}

/// Refuses so many matrices of so many entries each that do not fit into memory.
pub fn holds(entries: usize, parts: usize) -> Result<()> {
    let what = format!("a linear system of {parts} dense matrices, for its modes or its reduction,");
    memory::require(
        8.0 * (entries * parts) as f64,
        &what,
        "give them sparse: the lowest modes (n=) and transfer functions then take no dense ones",
    )
}

/// Refuses a system whose modes do not fit into memory.
pub fn fits(system: &LinearSystem) -> Result<()> {
    // square matrices held at a time: 28 to 37 measured without and 51 to 60 with damping, n = 400 to 800
    let (size, squares) = (system.size() as f64, if system.given().is_undamped() { 40.0 } else { 64.0 });
    let what = format!("all modes of {size} coordinates");
    memory::require(8.0 * squares * size * size, &what, "ask for the lowest ones (n=) of sparse matrices")
}

/// Modes as Python has them.
#[derive(IntoPyObject)]
pub struct Modes {
    eigenvalue: Vector<Complex64>,
    partner: Vector<Complex64>,
    shape: Dense<Complex64>,
    left: Option<Dense<Complex64>>,
    partner_mode: Vector<usize>,
    partner_shape: Dense<Complex64>,
    partner_left: Option<Dense<Complex64>>,
    kind: Vec<&'static str>,
    near_defective: Vector<bool>,
    groups: Vec<(usize, usize)>,
    backward_error: Vector<f64>,
    condition: Vector<f64>,
    error: Vector<f64>,
    route: &'static str,
    blurred: bool,
    counts: Counts,
}

impl Modes {
    /// `counts`: what the call has cost that hands them over.
    pub fn new(r: Modal, counts: Counts) -> Self {
        Modes {
            blurred: r.blurred(),
            eigenvalue: Vector(r.s),
            partner: Vector(r.partner),
            shape: Dense(r.shape),
            left: r.left.map(Dense),
            partner_mode: Vector(r.partner_mode),
            partner_shape: Dense(r.partner_shape),
            partner_left: r.partner_left.map(Dense),
            kind: r.kind.iter().map(|k| k.name()).collect(),
            near_defective: Vector(r.near_defective),
            groups: r.groups,
            backward_error: Vector(r.backward_error),
            condition: Vector(r.condition),
            error: Vector(r.error),
            route: r.route,
            counts,
        }
    }
}
