//! Many designs of a model for Python: a plan made once, rows of values in, arrays of numbers out.
use std::sync::Arc;

use numpy::{IntoPyArray, PyReadonlyArray2};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::designs::{Analysis, Design, Inputs, Place, Plan, Point, Port, Rule, Transfer, designs};
use crate::error::{Error, Result};
use crate::spatial::V3;

use super::expressions::program;
use super::model_work::{DERIVATIVES, fits, run};
use super::system::PySystem;

pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<PyPlan>()
}

/// An entry of V, or numbers of x: the other one is None or empty.
type GivenPlace = (Option<usize>, Vec<usize>);

fn places(all: Vec<GivenPlace>, n_v: usize, n_x: usize) -> Result<Vec<Place>> {
    let one = |(parameter, numbers): GivenPlace| match parameter {
        Some(i) if i < n_v => Ok(Place::Parameter(i)),
        None if numbers.iter().all(|i| *i < n_x) => Ok(Place::Numbers(numbers)),
        _ => Err(Error::model("a column of the designs does not fit the model")),
    };
    all.into_iter().map(one).collect()
}

fn rule((name, a, b): (String, usize, usize), n_x: usize) -> Result<Rule> {
    let (made, end) = match name.as_str() {
        "positive" => (Rule::Positive(a), a + 1),
        "not negative" => (Rule::NotNegative(a), a + 1),
        "not zero" => (Rule::NotZero(a, b), a + b),
        "inertia" => (Rule::Inertia(a), a + 6),
        "apart" => (Rule::Apart(a, b), a.max(b) + 3),
        _ => return Err(Error::model(format!("no rule is called '{name}'"))),
    };
    if end > n_x { Err(Error::model("a rule does not fit the model")) } else { Ok(made) }
}

/// Body (None: ground), its point ("origin", "world" with three numbers, "marker" with its place in x), direction, rotation?, base?
type GivenPort = (Option<usize>, (String, Vec<f64>, usize), [f64; 3], bool, bool);

fn port((body, (at, world, place), direction, rotation, base): GivenPort, bodies: usize, n_x: usize) -> Result<Port> {
    let point = match (at.as_str(), &world[..]) {
        ("origin", _) => Point::Origin,
        ("world", [x, y, z]) => Point::World(V3::new(*x, *y, *z)),
        ("marker", _) if place + 3 <= n_x => Point::Marker(place),
        _ => return Err(Error::model("the point of a port does not fit the model")),
    };
    if body.is_some_and(|b| b >= bodies) {
        return Err(Error::model("a port does not fit the model"));
    }
    Ok(Port { body, point, direction: V3::from(direction), rotation, base })
}

/// What is computed of every design of a model, see `Numbers`.
#[pyclass(frozen, name = "DesignPlan")]
pub struct PyPlan(Arc<Plan>);

#[pymethods]
impl PyPlan {
    /// `columns` and `by`: (entry of V, []) or (None, places in x). `driven`: (place in x, node of the program). Modes, until another
    /// analysis is asked for.
    #[new]
    #[allow(clippy::too_many_arguments)]
    fn new(
        system: PyRef<'_, PySystem>,
        parameters: Vec<f64>,
        columns: Vec<GivenPlace>,
        nodes: &Bound<'_, PyAny>,
        driven: Vec<(usize, usize)>,
        rules: Vec<(String, usize, usize)>,
        by: Vec<GivenPlace>,
        equilibrium: bool,
    ) -> PyResult<Self> {
        fits(&system.0, &DERIVATIVES)?;
        let (n_v, n_x) = (parameters.len(), system.0.x.len());
        let program = program(nodes, Vec::new())?;
        if driven.iter().any(|(slot, node)| *slot >= n_x || *node >= program.n_nodes()) || program.n_inputs() > n_v {
            return Err(Error::model("the expressions do not fit the model").into());
        }
        let rules = rules.into_iter().map(|given| rule(given, n_x)).collect::<Result<_>>()?;
        let columns = places(columns, n_v, n_x)?;
        let inputs = Inputs { parameters, columns, program, driven, rules };
        let by = places(by, n_v, n_x)?;
        let analysis = Analysis::Modes { n: None, elastic: None };
        Ok(PyPlan(Arc::new(Plan { system: system.0.clone(), inputs, analysis, by, equilibrium })))
    }

    /// `n` lowest modes; `elastic`: whether the stiffness holds elastic elements alone, whatever the design.
    #[pyo3(signature = (n, elastic))]
    fn modes(&self, n: Option<usize>, elastic: Option<bool>) -> Self {
        self.with(Analysis::Modes { n, elastic })
    }

    /// Transfer functions at `omega` (rad/s).
    fn transfer(
        &self,
        inputs: Vec<GivenPort>,
        outputs: Vec<GivenPort>,
        omega: Vec<f64>,
        order_out: u32,
    ) -> PyResult<Self> {
        let (bodies, n_x) = (self.0.system.n_bodies(), self.0.system.x.len());
        let all = |ports: Vec<GivenPort>| ports.into_iter().map(|one| port(one, bodies, n_x)).collect::<Result<_>>();
        Ok(self.with(Analysis::Transfer(Transfer { inputs: all(inputs)?, outputs: all(outputs)?, omega, order_out })))
    }

    /// Places of the bodies.
    fn rest(&self) -> Self {
        self.with(Analysis::Rest)
    }

    /// Rows of values (m, columns), by so many threads: `count` of each design, -1 where Python has to compute it; the `arrays` of all
    /// designs one behind the other; `seconds` of each, and whether Python has a `remark` on it.
    fn compute<'py>(
        &self,
        py: Python<'py>,
        rows: PyReadonlyArray2<'py, f64>,
        threads: usize,
    ) -> PyResult<Bound<'py, PyDict>> {
        let rows: Vec<Vec<f64>> = rows.as_array().rows().into_iter().map(|row| row.to_vec()).collect();
        if rows.iter().any(|row| row.len() != self.0.inputs.columns.len()) {
            return Err(Error::model("a design has as many values as there are columns").into());
        }
        let plan = self.0.clone();
        let made: Vec<Design> =
            run(py, &self.0.system, move |_, cancel| designs(&plan, &rows, threads.max(1), cancel))?;
        let done = || made.iter().filter_map(|d| d.numbers.as_ref());
        let arrays = (0..done().next().map_or(0, |n| n.arrays.len())).map(|k| {
            let all: Vec<f64> = done().flat_map(|n| n.arrays[k].iter().copied()).collect();
            all.into_pyarray(py)
        });
        let count = made.iter().map(|d| d.numbers.as_ref().map_or(-1, |n| n.count as i64));
        let remark = made.iter().map(|d| d.numbers.as_ref().is_some_and(|n| n.remark));
        let out = PyDict::new(py);
        out.set_item("arrays", arrays.collect::<Vec<_>>())?;
        out.set_item("count", count.collect::<Vec<i64>>().into_pyarray(py))?;
        out.set_item("remark", remark.collect::<Vec<bool>>().into_pyarray(py))?;
        out.set_item("seconds", made.iter().map(|d| d.seconds).collect::<Vec<f64>>().into_pyarray(py))?;
        Ok(out)
    }
}

impl PyPlan {
    fn with(&self, analysis: Analysis) -> Self {
        PyPlan(Arc::new(Plan { analysis, ..Plan::clone(&self.0) }))
    }
}
