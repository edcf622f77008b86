//! Modes of models with thousands of bodies, and the sparse matrices behind them.
use faer::Mat;
use numpy::ndarray::Array2;
use numpy::{Complex64, IntoPyArray, PyReadonlyArray1};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use super::border::{interruptible, to_numpy_complex};
use super::modal::Modes;
use super::sparse::advised;
use super::system::{PySystem, effects, state_of};
use crate::linearize::sparse_bodies::{BodyModes, modes};
use crate::linearize::sparse_form::{Entries, SparseForm};
use crate::memory;
use crate::multibody::System;
use crate::multibody::topology::Owner;
use crate::run::Counts;

pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(sparse_model_modes, module)?)?;
    module.add_function(wrap_pyfunction!(sparse_model_form, module)?)
}

/// The n lowest modes at a state: the dict of `dense_modes` with shapes of the minimal coordinates, and the motion of
/// the bodies about their centres of mass (6 n_bodies, n).
#[pyfunction]
#[pyo3(signature = (system, q, rate, acceleration, without, n, sigma=None))]
#[allow(clippy::too_many_arguments)]
fn sparse_model_modes<'py>(
    py: Python<'py>,
    system: PyRef<'py, PySystem>,
    q: PyReadonlyArray1<'py, f64>,
    rate: PyReadonlyArray1<'py, f64>,
    acceleration: Vec<f64>,
    without: Vec<String>,
    n: usize,
    sigma: Option<f64>,
) -> PyResult<Bound<'py, PyDict>> {
    let state = state_of(&system.0, &q, &rate)?;
    let effects = effects(&without)?;
    let owned = system.0.clone();
    // vectors over tree coordinates and bodies, complex: the basis of the search holds twice as many as are wanted
    let (size, count) = ((system.0.n_tree() + 6 * system.0.n_bodies()) as f64, n as f64);
    let what = format!("{n} modes of {} coordinates", system.0.n_tree());
    memory::require(16.0 * 4.0 * size * count, &what, "ask for fewer modes")?;
    let (mut found, shape, body) = interruptible(py, move |cancel| {
        let found = advised(modes(&owned, (&state, acceleration.as_slice()), effects, n, sigma, cancel))?;
        let shape = mapped(&found, |x| found.form.minimal(&owned, x));
        let body = mapped(&found, |x| found.form.bodies(&owned, x));
        Ok((found, shape, body))
    })?;
    let system = &system.0;
    found.modal.counts.merge(&found.counts);
    let counts = found.modal.counts.clone();
    let out = Modes::new(found.modal, counts).into_pyobject(py)?;
    out.set_item("shape", to_numpy_complex(py, shape.as_ref()))?;
    out.set_item("motion", to_numpy_complex(py, found.shape.as_ref()))?;
    out.set_item("body", to_numpy_complex(py, body.as_ref()))?;
    out.set_item("error", found.error.into_pyarray(py))?;
    out.set_item("residual", found.residual.into_pyarray(py))?;
    out.set_item("verified", found.verified)?;
    let names: Vec<&str> = match &found.form.loops {
        None => system.topology.names.iter().map(String::as_str).collect(),
        Some(l) => l.independent.iter().map(|i| system.topology.names[*i].as_str()).collect(),
    };
    out.set_item("coordinates", names)?;
    let (unbalanced, worst) = found.form.unbalanced;
    out.set_item("unbalanced", unbalanced)?;
    out.set_item("worst", system.topology.names.get(worst))?;
    out.set_item("arm", arms(system, &found.form).into_pyarray(py))?;
    Ok(out)
}

/// What a linear map makes of the shapes.
fn mapped(found: &BodyModes, map: impl Fn(&[f64]) -> Vec<f64>) -> Mat<Complex64> {
    let part = |k: usize, f: &dyn Fn(Complex64) -> f64| {
        let x: Vec<f64> = (0..found.shape.nrows()).map(|i| f(found.shape[(i, k)])).collect();
        map(&x)
    };
    let columns: Vec<_> = (0..found.shape.ncols()).map(|k| (part(k, &|v| v.re), part(k, &|v| v.im))).collect();
    let rows = columns.first().map_or(0, |c| c.0.len());
    Mat::from_fn(rows, columns.len(), |i, k| Complex64::new(columns[k].0[i], columns[k].1[i]))
}

/// From the centres of mass to the bodies' origins, world axes.
fn arms(system: &System, form: &SparseForm) -> Array2<f64> {
    let topology = &*system.topology;
    let mut out = Array2::zeros((topology.nodes.len(), 3));
    for (i, node) in topology.nodes.iter().enumerate() {
        let arm = form.placement.pose[i].r * system.geometry.bodies[node.body].com;
        for k in 0..3 {
            out[(node.body, k)] = -arm[k];
        }
    }
    out
}

/// Masses and the body of each coordinate, elastic rows with their weights and owners, stiffness without the elastic rows and damping, absolute coordinates.
#[pyfunction]
fn sparse_model_form<'py>(
    py: Python<'py>,
    system: PyRef<'py, PySystem>,
    q: PyReadonlyArray1<'py, f64>,
    rate: PyReadonlyArray1<'py, f64>,
    acceleration: Vec<f64>,
    without: Vec<String>,
) -> PyResult<Bound<'py, PyDict>> {
    let state = state_of(&system.0, &q, &rate)?;
    let effects = effects(&without)?;
    let owned = system.0.clone();
    let form =
        interruptible(py, move |_| SparseForm::new(&owned, &state, &acceleration, effects, &mut Counts::default()))?;
    let out = PyDict::new(py);
    let body_of: Vec<i64> = form.free.dofs[..form.size()].iter().map(|d| form.free.nodes[d.node].body as i64).collect();
    put_entries(&out, "mass", &form.mass)?;
    put_entries(&out, "rows", &form.rows)?;
    put_entries(&out, "stiffness", &form.stiffness)?;
    put_entries(&out, "damping", &form.damping)?;
    out.set_item("compliance", form.compliance.into_pyarray(py))?;
    let owner = |c: &Option<usize>| c.map_or(-1, |c| c as i64);
    let owners: Vec<i64> = form.connector.iter().map(owner).collect();
    out.set_item("connector", owners.into_pyarray(py))?;
    let tables = &system.0.topology.tables;
    let elements = system.0.topology.connectors.iter().map(|c| match c.owner {
        Owner::Element(i) => tables.elements[i].name.as_str(),
        Owner::Joint(j) => tables.joints[j].name.as_str(),
    });
    let flexible = tables.flexible.iter().map(|f| tables.bodies[f.body].name.as_str());
    out.set_item("names", elements.chain(flexible).collect::<Vec<_>>())?;
    out.set_item("body", body_of.into_pyarray(py))?;
    Ok(out)
}

fn put_entries(out: &Bound<'_, PyDict>, key: &str, entries: &Entries) -> PyResult<()> {
    let py = out.py();
    let index =
        |f: &dyn Fn(&(usize, usize, f64)) -> usize| -> Vec<i64> { entries.iter().map(|e| f(e) as i64).collect() };
    let values: Vec<f64> = entries.iter().map(|e| e.2).collect();
    out.set_item(key, (index(&|e| e.0).into_pyarray(py), index(&|e| e.1).into_pyarray(py), values.into_pyarray(py)))
}
