//! Steps of the explicit scheme, and the places where laws act, for Python.
use num_dual::Dual64;
use numpy::IntoPyArray;
use numpy::ndarray::{Array2, Array3};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};

use crate::analysis::transient::explicit::{Motion, Run};
use crate::error::{Error, Result};
use crate::run::{Cancel, Counts};
use crate::spatial::{Real, V3};
use crate::system::System;
use crate::system::connector::{Numbers, Wanted, coordinate_tangent, motion_of};
use crate::system::placement::{State, place};

use super::border::counts_dict;
use super::system::run;

/// A number with a derivative along the one direction of a run; f64 has none.
trait Seed: Real {
    fn seeded(value: f64, slope: f64) -> Self;
    fn slope(&self) -> f64;
}

impl Seed for f64 {
    fn seeded(value: f64, _: f64) -> Self {
        value
    }

    fn slope(&self) -> f64 {
        0.0
    }
}

impl Seed for Dual64 {
    fn seeded(value: f64, slope: f64) -> Self {
        Dual64::new(value, slope)
    }

    fn slope(&self) -> f64 {
        self.eps
    }
}

/// Real parts of a motion, and the derivative of its positions.
#[derive(Default)]
struct History {
    q: Vec<Vec<f64>>,
    rate: Vec<Vec<f64>>,
    memory: Vec<Vec<f64>>,
    position: Vec<Vec<V3<f64>>>,
    derivative: Vec<Vec<V3<f64>>>,
}

struct Plan {
    state: State,
    direction: Vec<(usize, f64)>,
    step: f64,
    n_steps: usize,
}

fn follow<T: Seed>(system: &System, plan: &Plan, cancel: &Cancel, counts: &mut Counts) -> Result<History> {
    let mut x: Vec<T> = system.x.iter().map(|v| T::from(*v)).collect();
    for (i, d) in &plan.direction {
        x[*i] = T::seeded(system.x[*i], *d);
    }
    let start = Motion {
        t: 0.0,
        q: plan.state.q.iter().map(|q| T::from(*q)).collect(),
        rate: plan.state.rate.iter().map(|r| T::from(*r)).collect(),
        memory: vec![T::zero(); system.topology.n_memory],
    };
    let run = Run::new(system, x, &start);
    let mut history = History::default();
    let real = |v: &[T]| v.iter().map(|x| x.re()).collect();
    for motion in run.integrate(start, plan.step, plan.n_steps, cancel, counts)? {
        let positions = run.positions(&motion);
        history.q.push(real(&motion.q));
        history.rate.push(real(&motion.rate));
        history.memory.push(real(&motion.memory));
        history.position.push(positions.iter().map(|p| p.map(|v| v.re())).collect());
        history.derivative.push(positions.iter().map(|p| p.map(|v| v.slope())).collect());
    }
    Ok(history)
}

/// `q` (n + 1, n_q), `rate` (n + 1, n_tree), `memory` (n + 1, n_memory), `position` (n + 1, n_bodies, 3) of the
/// origins and, along a direction, its `derivative`.
pub fn integrate<'py>(
    py: Python<'py>,
    system: &System,
    mut state: State,
    step: f64,
    n_steps: usize,
    direction: Option<(Vec<usize>, Vec<f64>)>,
) -> PyResult<Bound<'py, PyDict>> {
    if !step.is_finite() {
        return Err(Error::model("the step must be a finite number").into());
    }
    state.rate.resize(system.n_tree(), 0.0);
    let differentiate = direction.is_some();
    let (indices, weights) = direction.unwrap_or_default();
    if indices.len() != weights.len() || indices.iter().any(|i| *i >= system.x.len()) {
        return Err(Error::model("the direction does not fit the value vector").into());
    }
    let plan = Plan { state, direction: indices.into_iter().zip(weights).collect(), step, n_steps };
    let (history, counts) = run(py, system, move |system, cancel| {
        let mut counts = Counts::default();
        let history = if differentiate {
            follow::<Dual64>(system, &plan, cancel, &mut counts)?
        } else {
            follow::<f64>(system, &plan, cancel, &mut counts)?
        };
        Ok((history, counts))
    })?;
    let out = PyDict::new(py);
    let (n, bodies) = (n_steps + 1, system.n_bodies());
    let points = |of: &[Vec<V3<f64>>]| Array3::from_shape_fn((n, bodies, 3), |(i, b, k)| of[i][b][k]).into_pyarray(py);
    let rows = |of: &[Vec<f64>]| Array2::from_shape_fn((n, of[0].len()), |(i, k)| of[i][k]).into_pyarray(py);
    out.set_item("q", rows(&history.q))?;
    out.set_item("rate", rows(&history.rate))?;
    out.set_item("memory", rows(&history.memory))?;
    out.set_item("position", points(&history.position))?;
    if differentiate {
        out.set_item("derivative", points(&history.derivative))?;
    }
    out.set_item("counts", counts_dict(py, &counts)?)?;
    Ok(out)
}

/// Per law, in the order of its numbers: where these start in x, the bodies a and b (-1 ground), the world point (3,) and the row
/// (6,) that takes the relative twist of b there to the rate of the law's displacement, then displacement and rate.
pub fn law_places<'py>(py: Python<'py>, system: &System, state: &State) -> PyResult<Bound<'py, PyList>> {
    let topology = &*system.topology;
    let rate = state.moving().then_some(state.rate.as_slice());
    let placement = place(topology, &system.geometry, &state.q, rate);
    let numbers = Numbers { x: &system.x, memory: &[], t: 0.0 };
    let out = PyList::empty(py);
    for c in topology.connectors.iter().filter(|c| !c.laws.is_empty()) {
        let moved = motion_of(topology, &system.geometry, &placement, &system.x, c);
        let here = coordinate_tangent(topology, &system.geometry, &placement, numbers, c, Wanted::FORCES);
        for law in &c.laws {
            let (e, v) = moved[law.component];
            let gradient = here.gradients[law.component];
            let row: Vec<f64> = (0..6).map(|k| gradient.get(k)).collect();
            let body = |b: Option<usize>| b.map_or(-1, |b| b as i64);
            let point = here.point.as_slice().to_vec().into_pyarray(py);
            out.append((law.x, body(c.a), body(c.b), point, row.into_pyarray(py), e, v))?;
        }
    }
    Ok(out)
}

/// The same of functions of several coordinates: their number, the bodies, the point, rows (m, 6), displacements and rates (m,).
pub fn function_places<'py>(py: Python<'py>, system: &System, state: &State) -> PyResult<Bound<'py, PyList>> {
    let topology = &*system.topology;
    let rate = state.moving().then_some(state.rate.as_slice());
    let placement = place(topology, &system.geometry, &state.q, rate);
    let numbers = Numbers { x: &system.x, memory: &[], t: 0.0 };
    let out = PyList::empty(py);
    for c in topology.connectors.iter().filter(|c| !c.functions.is_empty()) {
        let moved = motion_of(topology, &system.geometry, &placement, &system.x, c);
        let here = coordinate_tangent(topology, &system.geometry, &placement, numbers, c, Wanted::FORCES);
        for f in &c.functions {
            let own: Vec<(f64, f64)> = f.coordinates.iter().map(|i| moved[*i]).collect();
            let (e, v): (Vec<f64>, Vec<f64>) = own.into_iter().unzip();
            let rows = Array2::from_shape_fn((e.len(), 6), |(i, k)| here.gradients[f.coordinates[i]].get(k));
            let body = |b: Option<usize>| b.map_or(-1, |b| b as i64);
            let point = here.point.as_slice().to_vec().into_pyarray(py);
            out.append((f.index, body(c.a), body(c.b), point, rows.into_pyarray(py), e, v))?;
        }
    }
    Ok(out)
}
