//! Sparse modes at the border: matrices arrive as the three arrays of a compressed-column matrix.
use numpy::{IntoPyArray, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use super::border::{counts_dict, interruptible, matrix, to_numpy, to_numpy_complex};
use super::frf::values_fit;
use crate::error::{Error, Result};
use crate::linalg::sparse::Csc;
use crate::second_order;
use crate::second_order::frf_sparse::SparseSystem;
use crate::second_order::ports::Ports;
use crate::second_order::sparse_damped;
use crate::second_order::sparse_damped::Damped;
use crate::second_order::sparse_modal;
use crate::second_order::sparse_modal::SymmetricModes;
use crate::second_order::sparse_pencil::{Assembled, Mixed, Pencil};

pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(sparse_modes, module)?)?;
    module.add_function(wrap_pyfunction!(check_symmetry, module)?)?;
    module.add_function(wrap_pyfunction!(sparse_count, module)?)?;
    module.add_function(wrap_pyfunction!(sparse_frf, module)?)?;
    module.add_function(wrap_pyfunction!(mixed_modes, module)?)
}

/// (column pointers, row indices, values), square.
type Arrays<'py> = (PyReadonlyArray1<'py, i64>, PyReadonlyArray1<'py, i64>, PyReadonlyArray1<'py, f64>);

fn csc(name: &str, arrays: &Arrays<'_>) -> Result<Csc> {
    let (start, row, value) = arrays;
    let n = start.as_array().len().saturating_sub(1);
    let contiguous = |_| Error::model(format!("the arrays of {name} are not contiguous"));
    Csc::new(
        name,
        n,
        n,
        start.as_slice().map_err(contiguous)?,
        row.as_slice().map_err(contiguous)?,
        value.as_slice().map_err(contiguous)?,
    )
}

/// What a user can do where modes without damping are not found.
pub(super) fn advised<T>(found: Result<T>) -> Result<T> {
    found.map_err(|error| match error {
        Error::Convergence { message, best, residual } => Error::Convergence {
            message: format!("{message}; give shift=, a frequency near the wanted modes"),
            best,
            residual,
        },
        Error::Singular(message) => Error::Singular(format!("{message}; give another shift=")),
        other => other,
    })
}

/// The n lowest modes of (s^2 M + s D + S) y = 0; D None and S symmetric: K x = lambda M x.
#[pyfunction]
#[pyo3(signature = (m, d, s, n, sigma=None))]
fn sparse_modes<'py>(
    py: Python<'py>,
    m: Arrays<'_>,
    d: Option<Arrays<'_>>,
    s: Arrays<'_>,
    n: usize,
    sigma: Option<f64>,
) -> PyResult<Bound<'py, PyDict>> {
    let (m, s) = (csc("M", &m)?, csc("S", &s)?);
    let d = d.map(|d| csc("D", &d)).transpose()?;
    let undamped = d.as_ref().is_none_or(|d| d.value.iter().all(|v| *v == 0.0));
    if undamped && s.is_symmetric() {
        let modes =
            interruptible(py, move |cancel| advised(sparse_modal::lowest(&Assembled::new(m, s)?, n, sigma, cancel)))?;
        return symmetric_dict(py, modes);
    }
    let d = d.unwrap_or_else(|| Csc::from_entries(m.rows, m.cols, Vec::new()));
    if sigma.is_some() {
        return Err(Error::model("a shift needs symmetric matrices without damping").into());
    }
    let modes = interruptible(py, move |cancel| sparse_damped::lowest(&Damped::new(m, d, s)?, n, cancel))?;
    let out = PyDict::new(py);
    out.set_item("eigenvalue", modes.s.into_pyarray(py))?;
    out.set_item("shape", to_numpy_complex(py, modes.shape.as_ref()))?;
    out.set_item("residual", modes.residual.into_pyarray(py))?;
    out.set_item("error", modes.error.into_pyarray(py))?;
    out.set_item("rigid", modes.rigid)?;
    out.set_item("verified", modes.verified)?;
    out.set_item("counts", counts_dict(py, &modes.counts)?)?;
    out.set_item("route", "sparse shift-invert, damped")?;
    Ok(out)
}

/// As of dense matrices: an error where entries i, j of a matrix differ by more than rounding, `gap` of the largest entry.
#[pyfunction]
fn check_symmetry(name: &str, gap: f64, i: usize, j: usize) -> PyResult<()> {
    Ok(second_order::check_symmetry(name, gap, i, j)?)
}

/// Number of eigenvalues of K x = lambda M x below a value, None where inertia cannot tell.
#[pyfunction]
fn sparse_count(py: Python<'_>, m: Arrays<'_>, k: Arrays<'_>, below: f64) -> PyResult<Option<usize>> {
    let (m, k) = (csc("M", &m)?, csc("K", &k)?);
    interruptible(py, move |_| Ok(Assembled::new(m, k)?.count_below(below)))
}

/// Transfer functions of a large sparse system, one factorisation per frequency.
#[pyfunction]
#[pyo3(signature = (m, d, s, l, f, order_in, d0, order_out, omega))]
#[allow(clippy::too_many_arguments)]
fn sparse_frf<'py>(
    py: Python<'py>,
    m: Arrays<'_>,
    d: Option<Arrays<'_>>,
    s: Arrays<'_>,
    l: PyReadonlyArray2<'_, f64>,
    f: PyReadonlyArray2<'_, f64>,
    order_in: Vec<u32>,
    d0: Option<PyReadonlyArray2<'_, f64>>,
    order_out: u32,
    omega: PyReadonlyArray1<'_, f64>,
) -> PyResult<Bound<'py, PyDict>> {
    let (m, s) = (csc("M", &m)?, csc("S", &s)?);
    let d = d.map(|d| csc("D", &d)).transpose()?;
    let ports = Ports { l: matrix(&l), f: matrix(&f), order_in, order_out, d0: d0.as_ref().map(matrix) };
    let omega: Vec<f64> = omega.as_array().to_vec();
    let shape = [ports.n_out(), ports.n_in(), omega.len()];
    values_fit("transfer functions", &shape)?;
    let values =
        interruptible(py, move |cancel| SparseSystem::new(&m, d.as_ref(), &s)?.evaluate(&ports, &omega, cancel))?;
    let out = PyDict::new(py);
    out.set_item("value", values.h.into_pyarray(py).reshape(shape)?)?;
    out.set_item("error", values.error)?;
    out.set_item("singular", values.singular)?;
    out.set_item("route", "sparse direct")?;
    out.set_item("counts", counts_dict(py, &values.counts)?)?;
    Ok(out)
}

/// The n lowest modes from the augmented matrix [[K_geo, G^T], [G, -compliance]] at zero shift; M (n_x, n_x) belongs to its first rows.
#[pyfunction]
#[pyo3(signature = (m, a, n, sigma=None))]
fn mixed_modes<'py>(
    py: Python<'py>,
    m: Arrays<'_>,
    a: Arrays<'_>,
    n: usize,
    sigma: Option<f64>,
) -> PyResult<Bound<'py, PyDict>> {
    let (m, a) = (csc("M", &m)?, csc("A", &a)?);
    let modes = interruptible(py, move |cancel| advised(sparse_modal::lowest(&Mixed::new(m, a)?, n, sigma, cancel)))?;
    symmetric_dict(py, modes)
}

fn symmetric_dict(py: Python<'_>, modes: SymmetricModes) -> PyResult<Bound<'_, PyDict>> {
    let out = PyDict::new(py);
    out.set_item("lambda", modes.lambda.into_pyarray(py))?;
    out.set_item("shape", to_numpy(py, modes.shape.as_ref()))?;
    out.set_item("residual", modes.residual.into_pyarray(py))?;
    out.set_item("error", modes.error.into_pyarray(py))?;
    out.set_item("rigid", modes.rigid)?;
    out.set_item("sigma", modes.sigma)?;
    out.set_item("verified", modes.verified)?;
    out.set_item("counts", counts_dict(py, &modes.counts)?)?;
    out.set_item("route", "sparse shift-invert, symmetric")?;
    Ok(out)
}
