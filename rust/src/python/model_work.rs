//! Work on a compiled model: on a thread of its own where it is long, so that Ctrl-C reaches it, and refused where it does not fit.
use pyo3::prelude::*;

use super::border::{guarded, interruptible};
use crate::error::Result;
use crate::memory;
use crate::model::tables::Tables;
use crate::multibody::System;
use crate::run::Cancel;

/// Below this number of tree coordinates, rows and elements a thread of its own costs more than it protects.
const SHORT: usize = 60;
/// The same for a pass over an open tree, which takes some milliseconds then.
const SHORT_PASS: usize = 1000;

/// What is made of dense matrices: the squares of the tree coordinates that it holds at a time, beside the maps of bodies and loops, and
/// what helps where they do not fit.
pub struct DenseWork {
    what: &'static str,
    squares: f64,
    remedy: &'static str,
}

// Measured as the largest resident memory over that of the model, n = 400 and 800, one coordinate a body, with a third to spare:
// a linearisation has 6 squares beside its body map (12 n n_bodies with its copy), an equilibrium 15.
pub const LINEARIZATION: DenseWork = DenseWork {
    what: "a linearisation",
    squares: 10.0,
    remedy: "the lowest modes alone take sparse matrices, mb.modes(m, n=...); for all else divide the model, or put elastic bodies \
             (mb.flexible.craig_bampton) in place of parts of it",
};
pub const EQUILIBRIUM: DenseWork = DenseWork {
    what: "an equilibrium",
    squares: 20.0,
    remedy: "a model that is drawn in balance needs none, and mb.modes(m, n=...) takes it as it is drawn; otherwise divide the model, or \
             put elastic bodies (mb.flexible.craig_bampton) in place of parts of it",
};
pub const REACTIONS: DenseWork =
    DenseWork { what: "reactions", squares: LINEARIZATION.squares, remedy: "divide the model into parts" };
pub const DERIVATIVES: DenseWork = DenseWork {
    what: "derivatives of a linearisation",
    squares: 2.0 * LINEARIZATION.squares,
    remedy: "divide the model, or take differences of mb.modes(m, n=...), which takes sparse matrices",
};
const BODY_MAPS: f64 = 14.0;
const LOOP_MAPS: f64 = 6.0;

/// Run where Ctrl-C can reach long work.
pub fn run<T: Send + 'static>(
    py: Python<'_>,
    system: &System,
    work: impl FnOnce(&System, &Cancel) -> Result<T> + Send + 'static,
) -> PyResult<T> {
    run_below(SHORT, py, system, work)
}

/// The same for work that passes over the tree without iterations, in a time of O(n^2) where no loops are closed.
pub fn run_pass<T: Send + 'static>(
    py: Python<'_>,
    system: &System,
    work: impl FnOnce(&System, &Cancel) -> Result<T> + Send + 'static,
) -> PyResult<T> {
    run_below(if system.topology.rows.is_empty() { SHORT_PASS } else { SHORT }, py, system, work)
}

fn run_below<T: Send + 'static>(
    short: usize,
    py: Python<'_>,
    system: &System,
    work: impl FnOnce(&System, &Cancel) -> Result<T> + Send + 'static,
) -> PyResult<T> {
    let (system, topology) = (system.clone(), &system.topology);
    if system.n_tree() + topology.rows.len() + topology.connectors.len() + topology.tables.loads.len() < short {
        guarded(py, move || work(&system, &Cancel::default()))
    } else {
        interruptible(py, move |cancel| work(&system, cancel))
    }
}

/// A model from its tables.
pub fn compile(py: Python<'_>, read: Tables) -> PyResult<System> {
    if read.bodies.len() + read.elements.len() < SHORT {
        guarded(py, move || System::new(read))
    } else {
        interruptible(py, move |_| System::new(read))
    }
}

/// Refuses what is made of dense matrices where they do not fit.
pub fn fits(system: &System, made: &DenseWork) -> Result<()> {
    let topology = &system.topology;
    let [n, rows, bodies] = [system.n_tree(), topology.rows.len(), system.n_bodies()].map(|n| n as f64);
    memory::require(
        8.0 * n * (made.squares * n + LOOP_MAPS * rows + BODY_MAPS * bodies),
        &format!("{} of {n} coordinates of the tree by dense matrices", made.what),
        made.remedy,
    )
}
