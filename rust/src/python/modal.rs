//! Modes of dense matrices.
use faer::Mat;
use numpy::{Complex64, IntoPyArray, PyReadonlyArray2, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use super::border::{counts_dict, guarded, interruptible, matrix, to_numpy_complex};
use super::system::table;
use crate::linearize::stiffness_factor;
use crate::memory;
use crate::second_order::SecondOrder;
use crate::second_order::modal::{Modal, modes};
use crate::tolerances::{linearisation::BALANCED, modes::SAME_ROOT};

pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("BALANCED", BALANCED)?;
    module.add("SAME_ROOT", SAME_ROOT)?;
    module.add_function(wrap_pyfunction!(dense_modes, module)?)?;
    module.add_function(wrap_pyfunction!(is_strained, module)?)
}

pub(super) type Optional<'py> = Option<PyReadonlyArray2<'py, f64>>;

pub(super) fn optional(array: &Optional<'_>) -> Option<Mat<f64>> {
    array.as_ref().map(matrix)
}

/// Sizes from which on a solve may outlast what a user waits for Ctrl-C, and a thread of its own costs nothing in comparison.
pub(super) const LARGE: usize = 64;

#[pyfunction]
#[pyo3(signature = (m, c, g, k, n, kf, mf=None))]
#[allow(clippy::too_many_arguments)]
fn dense_modes<'py>(
    py: Python<'py>,
    m: PyReadonlyArray2<'py, f64>,
    c: Optional<'py>,
    g: Optional<'py>,
    k: PyReadonlyArray2<'py, f64>,
    n: Optional<'py>,
    kf: Optional<'py>,
    mf: Optional<'py>,
) -> PyResult<Bound<'py, PyDict>> {
    // square matrices held at a time: 28 to 37 measured without and 51 to 60 with damping, n = 400 to 800
    let (size, squares) = (m.shape()[0] as f64, if c.is_none() && g.is_none() && n.is_none() { 40.0 } else { 64.0 });
    let what = format!("all modes of {size} coordinates");
    memory::require(8.0 * squares * size * size, &what, "ask for the lowest ones (n=) of sparse matrices")?;
    let (m, k) = (matrix(&m), matrix(&k));
    let (c, g, n, kf) = (optional(&c), optional(&g), optional(&n), optional(&kf));
    let mf = optional(&mf);
    let large = m.nrows() >= LARGE;
    let work = move || {
        let system = SecondOrder::new(m, c, g, k, n, kf)?;
        match mf {
            None => modes(&system),
            Some(mf) => modes(&system.with_mass_factor(mf)?),
        }
    };
    let result = if large { interruptible(py, move |_| work())? } else { guarded(py, work)? };
    as_dict(py, result)
}

pub(super) fn as_dict<'py>(py: Python<'py>, r: Modal) -> PyResult<Bound<'py, PyDict>> {
    let (light, blurred) = (r.light(), r.blurred());
    let dict = PyDict::new(py);
    dict.set_item("eigenvalue", complex(py, &r.s))?;
    dict.set_item("partner", complex(py, &r.partner))?;
    dict.set_item("shape", to_numpy_complex(py, r.shape.as_ref()))?;
    let left = r.left.map(|left| to_numpy_complex(py, left.as_ref()));
    dict.set_item("left", left)?;
    dict.set_item("partner_mode", r.partner_mode.into_pyarray(py))?;
    dict.set_item("partner_shape", to_numpy_complex(py, r.partner_shape.as_ref()))?;
    let left = r.partner_left.map(|left| to_numpy_complex(py, left.as_ref()));
    dict.set_item("partner_left", left)?;
    dict.set_item("kind", r.kind.iter().map(|k| k.name()).collect::<Vec<_>>())?;
    dict.set_item("near_defective", r.near_defective.into_pyarray(py))?;
    dict.set_item("groups", r.groups)?;
    dict.set_item("backward_error", r.backward_error.into_pyarray(py))?;
    dict.set_item("condition", r.condition.into_pyarray(py))?;
    dict.set_item("error", r.error.into_pyarray(py))?;
    dict.set_item("route", r.route)?;
    dict.set_item("light", light)?;
    dict.set_item("blurred", blurred)?;
    dict.set_item("counts", counts_dict(py, &r.counts)?)?;
    Ok(dict)
}

/// Does a column of `shape` (phi^T M phi = 1) strain a row of the stiffness factor by more than rounding?
#[pyfunction]
fn is_strained(
    factor: PyReadonlyArray2<'_, f64>,
    shape: PyReadonlyArray2<'_, f64>,
    mass: PyReadonlyArray2<'_, f64>,
) -> bool {
    stiffness_factor::is_strained(&table(&factor), &table(&shape), &table(&mass))
}

fn complex<'py>(py: Python<'py>, values: &[Complex64]) -> Bound<'py, numpy::PyArray1<Complex64>> {
    values.to_vec().into_pyarray(py)
}
