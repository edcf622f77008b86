//! Derivative-free solution of F(x) = 0 for Python functions.
use std::sync::{Mutex, PoisonError};

use numpy::{IntoPyArray, PyArray1, PyArray2, PyReadonlyArray1, PyReadonlyArray2, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use super::border::{called, guarded};
use crate::error::{Error, Result};
use crate::linalg::sparse::Csc;
use crate::solve::Residual;
use crate::solve::inverse::{Family, Guard, Inverse};
use crate::solve::inverse_bfgs::{Options, Outcome, Start, Status, solve};
use crate::solve::line_search::Rule;

pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<RootInverse>()?;
    module.add_function(wrap_pyfunction!(root_solve, module)?)
}

/// H of a solve, to be handed to another one.
#[pyclass(frozen)]
pub struct RootInverse {
    h: Mutex<Inverse>,
    /// of how many unknowns
    #[pyo3(get)]
    n: usize,
}

#[pymethods]
impl RootInverse {
    /// Of the dense form, from H.
    #[new]
    fn new(h: PyReadonlyArray2<'_, f64>) -> PyResult<Self> {
        let n = h.shape()[0];
        if n != h.shape()[1] {
            return Err(Error::model("the inverse must be square").into());
        }
        let h = h.as_array().iter().copied().collect();
        let h = Mutex::new(Inverse::Dense { n, h });
        Ok(RootInverse { h, n })
    }

    /// H, or None for limited memory.
    fn matrix<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyArray2<f64>>>> {
        match &*self.h.lock().unwrap_or_else(PoisonError::into_inner) {
            Inverse::Dense { n, h } => {
                let array = numpy::ndarray::Array2::from_shape_vec((*n, *n), h.clone());
                let array = array.map_err(|e| Error::model(e.to_string()))?;
                Ok(Some(array.into_pyarray(py)))
            }
            Inverse::Limited { .. } => Ok(None),
        }
    }

    /// H r.
    fn apply<'py>(&self, py: Python<'py>, r: PyReadonlyArray1<'_, f64>) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let h = self.h.lock().unwrap_or_else(PoisonError::into_inner);
        if r.len() != self.n {
            return Err(Error::model(format!("the vector needs {} entries", self.n)).into());
        }
        let r: Vec<f64> = r.as_array().iter().copied().collect();
        let mut out = vec![0.0; r.len()];
        h.apply(&r, &mut out);
        Ok(out.into_pyarray(py))
    }
}

/// A Python function, and who watches its iterates.
struct Function {
    call: Py<PyAny>,
    observer: Option<Py<PyAny>>,
}

impl Residual for Function {
    fn residual(&mut self, x: &[f64], out: &mut [f64]) -> Result<()> {
        called(|py| {
            py.check_signals()?;
            let value = self.call.call1(py, (PyArray1::from_slice(py, x),))?;
            let value: PyReadonlyArray1<'_, f64> = value.extract(py)?;
            for (out, v) in out.iter_mut().zip(value.as_array()) {
                *out = *v;
            }
            Ok(())
        });
        Ok(())
    }

    fn accepted(&mut self, x: &[f64], f: &[f64]) -> Result<bool> {
        let Some(observer) = &self.observer else {
            return Ok(false);
        };
        Ok(called(|py| {
            let arrays = (PyArray1::from_slice(py, x), PyArray1::from_slice(py, f));
            observer.call1(py, arrays)?.extract(py)
        }))
    }
}

/// `function` takes and returns arrays (n,) of float64; `observer(x, f)` says whether to stop. `rule` is (rho, sigma1, sigma2,
/// beta, max_backtracks), `guard` (curvature, least and largest determinant ratio), `limits` (iterations, evaluations, patience,
/// restarts), `pattern` (start, row) of compressed columns.
#[pyfunction]
#[allow(clippy::too_many_arguments)]
fn root_solve<'py>(
    py: Python<'py>,
    function: Py<PyAny>,
    observer: Option<Py<PyAny>>,
    x0: Vec<f64>,
    broyden: bool,
    tolerance: f64,
    rule: (f64, f64, f64, f64, usize, bool),
    guard: (f64, f64, f64),
    limits: (usize, u64, usize, usize),
    fallback: bool,
    differences: Option<f64>,
    pattern: Option<(Vec<i64>, Vec<i64>)>,
    memory: Option<usize>,
    inverse: Option<Py<RootInverse>>,
) -> PyResult<Bound<'py, PyDict>> {
    let start = match (differences, pattern) {
        (_, Some((start, row))) => {
            let ones = vec![1.0; row.len()];
            Start::Pattern(Csc::new("sparsity", x0.len(), x0.len(), &start, &row, &ones)?)
        }
        (None, None) => Start::Identity,
        (Some(_), None) => Start::Differences,
    };
    let defaults = Options::default();
    let options = Options {
        left: None,
        family: if broyden { Family::Broyden } else { Family::Bfgs },
        tolerance,
        max_iterations: limits.0,
        max_evaluations: limits.1,
        rule: Rule {
            rho: rule.0,
            sigma1: rule.1,
            sigma2: rule.2,
            beta: rule.3,
            max_backtracks: rule.4,
            invariant: rule.5,
        },
        guard: Guard { curvature: guard.0, determinant: (guard.1, guard.2) },
        start,
        memory,
        difference: differences.unwrap_or(defaults.difference),
        patience: limits.2,
        restarts: limits.3,
        fallback,
    };
    let mut h = inverse.map(|h| {
        let h = &h.get().h;
        h.lock().unwrap_or_else(PoisonError::into_inner).clone()
    });
    let mut problem = Function { call: function, observer };
    let outcome = guarded(py, || solve(&mut problem, &x0, &options, &mut h))?;
    let out = report(py, outcome)?;
    let n = x0.len();
    let kept = |h| Py::new(py, RootInverse { h: Mutex::new(h), n });
    let h = h.map(kept);
    out.set_item("inverse", h.transpose()?)?;
    Ok(out)
}

fn report(py: Python<'_>, outcome: Outcome) -> PyResult<Bound<'_, PyDict>> {
    let status = match outcome.status {
        Status::Converged => "converged",
        Status::MaxIterations => "max-iterations",
        Status::MaxEvaluations => "max-evaluations",
        Status::LineSearch => "line-search",
        Status::Stalled => "stalled",
        Status::Stopped => "stopped",
        Status::Broken => "not-finite",
    };
    let out = PyDict::new(py);
    out.set_item("status", status)?;
    out.set_item("x", outcome.x.into_pyarray(py))?;
    out.set_item("fun", outcome.f.into_pyarray(py))?;
    out.set_item("norms", outcome.norms.into_pyarray(py))?;
    out.set_item("iterations", outcome.iterations)?;
    out.set_item("backtracks", outcome.backtracks)?;
    out.set_item("evaluations", outcome.evaluations)?;
    out.set_item("skipped", outcome.skipped)?;
    out.set_item("restarts", outcome.restarts)?;
    out.set_item("singular", outcome.singular)?;
    out.set_item("fallback", outcome.fallback)?;
    out.set_item("broyden", outcome.family == Family::Broyden)?;
    Ok(out)
}
