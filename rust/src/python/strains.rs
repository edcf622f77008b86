//! Strains of elastic elements, and the factor of the stiffness that they make, for Python.
use numpy::ndarray::Array2;
use numpy::{IntoPyArray, PyArray2, PyReadonlyArray2};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};

use crate::linearize::stiffness_factor;
use crate::linearize::strain_rows::{Motions, clear_strains, elements, strain_rows};
use crate::linearize::{Setting, linearize};
use crate::multibody::System;
use crate::multibody::assemble::Effects;
use crate::multibody::placement::{State, place};
use crate::multibody::topology::Owner;
use crate::run::Counts;
use crate::spatial::V3;

use super::model_work::{LINEARIZATION, fits, run};
use super::system::{array, table};

type Arrays<'a, 'py> = (&'a PyReadonlyArray2<'py, f64>, &'a PyReadonlyArray2<'py, f64>);

/// See `PySystem::strains`.
pub fn strains<'py>(
    py: Python<'py>,
    system: &System,
    state: &State,
    effects: Effects,
    (twist, position): Arrays<'_, 'py>,
) -> PyResult<Bound<'py, PyDict>> {
    let topology = &system.topology;
    let placement = place(topology, &system.geometry, &state.q, None);
    let elements = elements(system, &placement, effects);
    let (names, stiffness) = (PyList::empty(py), PyList::empty(py));
    for element in &elements {
        let n = element.gradients.len();
        names.append(match element.owner {
            Owner::Element(i) => &topology.tables.elements[i].name,
            Owner::Joint(i) => &topology.tables.joints[i].name,
        })?;
        stiffness.append(Array2::from_shape_fn((n, n), |(i, j)| element.k[i][j]).into_pyarray(py))?;
    }
    let places = position.as_array();
    let position = places.rows().into_iter().map(|p| V3::new(p[0], p[1], p[2])).collect();
    let twist = table(twist);
    let columns: Vec<usize> = (0..twist.ncols()).collect();
    let made = strain_rows(&Motions { twist: &twist, position }, &elements, &columns);
    let body = |b: Option<usize>| b.map_or(-1, |b| b as i64);
    let bodies = Array2::from_shape_fn((elements.len(), 2), |(i, k)| body(elements[i].bodies[k]));
    let all: Vec<_> = elements.iter().flat_map(|e| &e.gradients).collect();
    let out = PyDict::new(py);
    out.set_item("bodies", bodies.into_pyarray(py))?;
    out.set_item("gradients", Array2::from_shape_fn((all.len(), 6), |(i, k)| all[i].get(k)).into_pyarray(py))?;
    out.set_item("names", names)?;
    out.set_item("stiffness", stiffness)?;
    out.set_item("rows", array(&made.rows).into_pyarray(py))?;
    out.set_item("sizes", array(&made.sizes).into_pyarray(py))?;
    Ok(out)
}

/// See `PySystem::stiffness_factor`.
pub fn stiffness_factor<'py>(
    py: Python<'py>,
    system: &System,
    state: State,
    effects: Effects,
) -> PyResult<Option<Bound<'py, PyArray2<f64>>>> {
    fits(system, &LINEARIZATION)?;
    let made = run(py, system, move |system, _| {
        let setting = Setting { system, state: &state, memory: &[], acceleration: &[], effects };
        let base = linearize(&setting, &mut Counts::default())?;
        let columns: Vec<usize> = (0..base.matrices.mass.nrows()).collect();
        Ok(stiffness_factor::stiffness_factor(&clear_strains(&setting, &base, &columns)))
    })?;
    Ok(made.map(|f| array(&f).into_pyarray(py)))
}
