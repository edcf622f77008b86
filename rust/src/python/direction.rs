//! Derivatives of a linearisation along many directions, for Python: matrices as entries, maps as arrays.
use numpy::ndarray::{Array2, Array3};
use numpy::{IntoPyArray, PyReadonlyArray1};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::error::{Error, Result};
use crate::linearize::{Setting, linearize};
use crate::run::Counts;
use crate::sensitivity::direction;
use crate::sensitivity::direction::Common;
use crate::sensitivity::direction::Directional;
use crate::sensitivity::direction::Entries;

use super::model_work::{DERIVATIVES, fits, run};
use super::system::{PySystem, effects, state_of};
use crate::multibody::System;

pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(directions, module)?)
}

fn entries<'py>(
    py: Python<'py>,
    all: &[Directional],
    pick: impl Fn(&Directional) -> &Entries,
) -> PyResult<Bound<'py, PyAny>> {
    let mut joined = Entries::default();
    let mut direction: Vec<i64> = Vec::new();
    for (k, d) in all.iter().enumerate() {
        let one = pick(d);
        joined.rows.extend(&one.rows);
        joined.columns.extend(&one.columns);
        joined.values.extend(&one.values);
        direction.resize(joined.values.len(), k as i64);
    }
    let parts = (
        joined.rows.into_pyarray(py),
        joined.columns.into_pyarray(py),
        direction.into_pyarray(py),
        joined.values.into_pyarray(py),
    );
    Ok(parts.into_pyobject(py)?.into_any())
}

fn stacked(
    all: &[Directional],
    rows: usize,
    columns: usize,
    pick: impl Fn(&Directional) -> Option<&nalgebra::DMatrix<f64>>,
) -> Array3<f64> {
    let mut out = Array3::zeros((rows, columns, all.len()));
    for (k, d) in all.iter().enumerate() {
        if let Some(m) = pick(d) {
            for j in 0..columns {
                for i in 0..rows {
                    out[(i, j, k)] = m[(i, j)];
                }
            }
        }
    }
    out
}

fn columns(all: &[Directional], pick: impl Fn(&Directional) -> &[f64]) -> Array2<f64> {
    let n = all.iter().map(|d| pick(d).len()).max().unwrap_or(0);
    Array2::from_shape_fn((n, all.len()), |(i, k)| pick(&all[k]).get(i).copied().unwrap_or(0.0))
}

/// Derivatives along sparse directions (indices into the values, weights). `follow`: "equilibrium" moves along, "drawn" follows the
/// given velocities, "steady" moves along on all tree coordinates but the `driven` ones, "hold"; `maps`: also those of the body map
/// and the ground coupling.
#[pyfunction]
#[pyo3(signature = (system, q, rate, without, directions, follow, maps, driven=Vec::new(), memory=Vec::new()))]
#[allow(clippy::too_many_arguments)]
fn directions<'py>(
    py: Python<'py>,
    system: PyRef<'py, PySystem>,
    q: PyReadonlyArray1<'py, f64>,
    rate: PyReadonlyArray1<'py, f64>,
    without: Vec<String>,
    directions: Vec<(Vec<usize>, Vec<f64>)>,
    follow: &str,
    maps: bool,
    driven: Vec<usize>,
    memory: Vec<f64>,
) -> PyResult<Bound<'py, PyDict>> {
    let state = state_of(&system.0, &q, &rate)?;
    let memory = remembered(&system.0, &memory)?;
    let effects = effects(&without)?;
    let (follow, drawn) = (matches!(follow, "equilibrium" | "steady"), follow == "drawn");
    let n_x = system.0.x.len();
    if directions.iter().any(|(i, v)| i.len() != v.len() || i.iter().any(|i| *i >= n_x)) {
        return Err(Error::model("a direction does not fit the value vector").into());
    }
    fits(&system.0, &DERIVATIVES)?;
    let (all, dof) = run(py, &system.0, move |system, cancel| {
        let setting = Setting { system, state: &state, memory: &memory, acceleration: &[], effects };
        let base = linearize(&setting, &mut Counts::default())?;
        let sparse: Vec<Vec<_>> = directions.into_iter().map(|(i, v)| i.into_iter().zip(v).collect()).collect();
        let common = Common { follow, drawn, maps, driven: &driven };
        let all = direction::directions(&setting, &base, &sparse, common, cancel)?;
        Ok((all, base.matrices.mass.nrows()))
    })?;
    let out = PyDict::new(py);
    out.set_item("dM", entries(py, &all, |d| &d.mass)?)?;
    out.set_item("dD", entries(py, &all, |d| &d.damping)?)?;
    out.set_item("dS", entries(py, &all, |d| &d.stiffness)?)?;
    if maps {
        let n = 6 * system.0.n_bodies();
        out.set_item("dT", stacked(&all, n, dof, |d| d.body_map.as_ref()).into_pyarray(py))?;
        out.set_item("d_ground_coupling", stacked(&all, dof, 6, |d| d.ground_coupling.as_ref()).into_pyarray(py))?;
    }
    out.set_item("tree_coordinates", columns(&all, |d| &d.dy).into_pyarray(py))?;
    out.set_item("body_motion", columns(&all, |d| &d.body_motion).into_pyarray(py))?;
    out.set_item("multipliers", columns(&all, |d| &d.lam).into_pyarray(py))?;
    Ok(out)
}

/// What laws remember has to fit the model, empty means centred; states with rates are taken at rest, whatever they were.
pub fn remembered(system: &System, memory: &[f64]) -> Result<Vec<f64>> {
    let n = system.topology.n_memory;
    if !(memory.is_empty() || memory.len() == n) || memory.iter().any(|z| !z.is_finite()) {
        return Err(Error::model(format!(
            "the laws of this model remember {n} finite numbers, a state gives {}; compute the state again from this model",
            memory.len()
        )));
    }
    Ok(if memory.is_empty() { Vec::new() } else { system.topology.at_rest(memory) })
}
