//! Many designs of a model for Python: a plan made once, rows of values in, arrays of numbers out.
use std::sync::Arc;

use numpy::{IntoPyArray, PyReadonlyArray2};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::analysis::designs::{Design, Inputs, Numbers, Place, Plan, Rule, designs};
use crate::error::{Error, Result};

use super::expressions::program;
use super::system::{LINEARIZATION, PySystem, fits, run};

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

/// What is computed of every design of a model: modes, and their derivatives by `by`.
#[pyclass(frozen, name = "DesignPlan")]
pub struct PyPlan(Arc<Plan>);

#[pymethods]
impl PyPlan {
    /// `columns` and `by`: (entry of V, []) or (None, places in x). `driven`: (place in x, node of the program).
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
        n: Option<usize>,
        equilibrium: bool,
        elastic: Option<bool>,
    ) -> PyResult<Self> {
        fits(&system.0, "derivatives of a linearisation", 2.0 * LINEARIZATION)?;
        let (n_v, n_x) = (parameters.len(), system.0.x.len());
        let program = program(nodes, Vec::new())?;
        if driven.iter().any(|(slot, node)| *slot >= n_x || *node >= program.n_nodes()) || program.n_inputs() > n_v {
            return Err(Error::model("the expressions do not fit the model").into());
        }
        let rules = rules.into_iter().map(|given| rule(given, n_x)).collect::<Result<_>>()?;
        let columns = places(columns, n_v, n_x)?;
        let inputs = Inputs { parameters, columns, program, driven, rules };
        let by = places(by, n_v, n_x)?;
        Ok(PyPlan(Arc::new(Plan { system: system.0.clone(), inputs, n, by, equilibrium, elastic })))
    }

    /// Rows of values (m, columns): `count` of modes of each design, -1 where Python has to compute it; all frequencies, damping ratios
    /// and derivatives one behind the other; `seconds` of each, and whether Python has a `remark` on it.
    fn compute<'py>(&self, py: Python<'py>, rows: PyReadonlyArray2<'py, f64>) -> PyResult<Bound<'py, PyDict>> {
        let rows: Vec<Vec<f64>> = rows.as_array().rows().into_iter().map(|row| row.to_vec()).collect();
        if rows.iter().any(|row| row.len() != self.0.inputs.columns.len()) {
            return Err(Error::model("a design has as many values as there are columns").into());
        }
        let plan = self.0.clone();
        let made: Vec<Design> = run(py, &self.0.system, move |_, cancel| designs(&plan, &rows, cancel))?;
        let all = |pick: fn(&Numbers) -> &Vec<f64>| {
            let done = made.iter().filter_map(|d| d.numbers.as_ref());
            done.flat_map(|n| pick(n).iter().copied()).collect::<Vec<f64>>().into_pyarray(py)
        };
        let count = made.iter().map(|d| d.numbers.as_ref().map_or(-1, |n| n.frequency.len() as i64));
        let remark = made.iter().map(|d| d.numbers.as_ref().is_some_and(|n| n.remark));
        let out = PyDict::new(py);
        out.set_item("count", count.collect::<Vec<i64>>().into_pyarray(py))?;
        out.set_item("remark", remark.collect::<Vec<bool>>().into_pyarray(py))?;
        out.set_item("seconds", made.iter().map(|d| d.seconds).collect::<Vec<f64>>().into_pyarray(py))?;
        out.set_item("frequency", all(|n| &n.frequency))?;
        out.set_item("damping", all(|n| &n.damping))?;
        out.set_item("frequency_derivative", all(|n| &n.frequency_derivative))?;
        out.set_item("damping_derivative", all(|n| &n.damping_derivative))?;
        Ok(out)
    }
}
