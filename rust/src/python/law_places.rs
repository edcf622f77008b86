//! The places where laws act at a state, for Python.
use numpy::IntoPyArray;
use numpy::ndarray::Array2;
use pyo3::prelude::*;
use pyo3::types::PyList;

use crate::multibody::System;
use crate::multibody::connector::{CoordinateTangent, Wanted, coordinate_tangent, motion_of};
use crate::multibody::numbers::Numbers;
use crate::multibody::placement::{State, place};
use crate::multibody::topology::Connector;

/// A connector as it is at a state: displacement and rate of each coordinate, and their gradients.
struct Place<'a> {
    connector: &'a Connector,
    moved: Vec<(f64, f64)>,
    tangent: CoordinateTangent<f64>,
}

impl Place<'_> {
    /// The bodies a and b; -1 is ground.
    fn bodies(&self) -> (i64, i64) {
        let number = |b: Option<usize>| b.map_or(-1, |b| b as i64);
        (number(self.connector.a), number(self.connector.b))
    }

    fn point(&self) -> Vec<f64> {
        self.tangent.point.as_slice().to_vec()
    }

    /// Rows (m, 6) that take the relative twist of b at the point to the rates of coordinates.
    fn rows(&self, coordinates: &[usize]) -> Array2<f64> {
        Array2::from_shape_fn((coordinates.len(), 6), |(i, k)| self.tangent.gradients[coordinates[i]].get(k))
    }
}

fn places<'a>(system: &'a System, state: &State, acts: fn(&Connector) -> bool) -> Vec<Place<'a>> {
    let (topology, geometry) = (&*system.topology, &system.geometry);
    let rate = state.moving().then_some(state.rate.as_slice());
    let placement = place(topology, geometry, &state.q, rate);
    let numbers = Numbers { x: &system.x, memory: &[], t: 0.0 };
    let all = topology.connectors.iter().filter(|c| acts(c));
    let one = |connector: &'a Connector| Place {
        connector,
        moved: motion_of(topology, geometry, &placement, &system.x, connector),
        tangent: coordinate_tangent(topology, geometry, &placement, numbers, connector, Wanted::FORCES),
    };
    all.map(one).collect()
}

/// Per law, in the order of its numbers: where these start in x, the bodies a and b (-1 ground), the world point (3,) and the row
/// (6,) that takes the relative twist of b there to the rate of the law's displacement, then displacement and rate, and where its
/// memory starts.
pub fn law_places<'py>(py: Python<'py>, system: &System, state: &State) -> PyResult<Bound<'py, PyList>> {
    let out = PyList::empty(py);
    for place in places(system, state, |c| !c.laws.is_empty()) {
        let (a, b) = place.bodies();
        for law in &place.connector.laws {
            let (e, v) = place.moved[law.component];
            let row = place.rows(&[law.component]).row(0).to_vec();
            out.append((law.x, a, b, place.point().into_pyarray(py), row.into_pyarray(py), e, v, law.memory))?;
        }
    }
    Ok(out)
}

/// The same of functions of several coordinates: their number, the bodies, the point, rows (m, 6), displacements and rates (m,).
pub fn function_places<'py>(py: Python<'py>, system: &System, state: &State) -> PyResult<Bound<'py, PyList>> {
    let out = PyList::empty(py);
    for place in places(system, state, |c| !c.functions.is_empty()) {
        let (a, b) = place.bodies();
        for f in &place.connector.functions {
            let (e, v): (Vec<f64>, Vec<f64>) = f.coordinates.iter().map(|i| place.moved[*i]).unzip();
            let rows = place.rows(&f.coordinates).into_pyarray(py);
            out.append((f.index, a, b, place.point().into_pyarray(py), rows, e, v))?;
        }
    }
    Ok(out)
}
