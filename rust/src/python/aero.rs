//! Velocities of vortex filaments.
use numpy::{PyArray2, PyReadonlyArray1, PyReadonlyArray2, PyUntypedArrayMethods};
use pyo3::prelude::*;

use super::border::interruptible;
use crate::aero::filaments::{Core, Filaments, velocities};
use crate::error::{Error, Result};
use crate::tolerances::aero::{HIGH_LOAD, MOST_ANNULUS_STEPS, SMALLEST_INFLOW};

pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("HIGH_LOAD", HIGH_LOAD)?;
    module.add("MOST_ANNULUS_STEPS", MOST_ANNULUS_STEPS)?;
    module.add("SMALLEST_INFLOW", SMALLEST_INFLOW)?;
    module.add_function(wrap_pyfunction!(induced_velocity, module)?)
}

fn vectors(name: &str, array: &PyReadonlyArray2<'_, f64>) -> Result<Vec<[f64; 3]>> {
    if array.shape()[1] != 3 {
        return Err(Error::model(format!("{name} must have three columns")));
    }
    Ok(array.as_array().rows().into_iter().map(|row| [row[0], row[1], row[2]]).collect())
}

/// Velocities (n, 3) at points (n, 3) of straight filaments (m, 3) with a core model and its exponent; 0 threads are as many as the
/// machine has.
#[pyfunction]
#[allow(clippy::too_many_arguments)]
fn induced_velocity<'py>(
    py: Python<'py>,
    points: PyReadonlyArray2<'_, f64>,
    start: PyReadonlyArray2<'_, f64>,
    end: PyReadonlyArray2<'_, f64>,
    circulation: PyReadonlyArray1<'_, f64>,
    core_radius: PyReadonlyArray1<'_, f64>,
    core: &str,
    exponent: f64,
    threads: usize,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let core = match core {
        "rosenhead-moore" => Core::RosenheadMoore,
        "lamb-oseen" => Core::LambOseen,
        "vatistas" => Core::Vatistas(exponent),
        other => return Err(Error::model(format!("there is no core {other:?}")).into()),
    };
    let (points, start, end) = (vectors("points", &points)?, vectors("start", &start)?, vectors("end", &end)?);
    let circulation: Vec<f64> = circulation.as_array().iter().copied().collect();
    let core_radius: Vec<f64> = core_radius.as_array().iter().copied().collect();
    let found = interruptible(py, move |cancel| {
        let filaments = Filaments { start: &start, end: &end, circulation: &circulation, core_radius: &core_radius };
        velocities(&filaments, core, &points, threads, cancel)
    })?;
    let out = numpy::ndarray::Array2::from_shape_fn((found.len(), 3), |(i, k)| found[i][k]);
    Ok(PyArray2::from_owned_array(py, out))
}
