//! Derivative-free solution of F(x) = 0 for Python functions.
use std::sync::{Mutex, PoisonError};

use numpy::{IntoPyArray, PyArray1, PyArray2, PyReadonlyArray1, PyReadonlyArray2, PyUntypedArrayMethods};
use pyo3::prelude::*;

use super::border::{Vector, called, guarded};
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

/// Options of `root_solve`, by name.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
struct Asked {
    broyden: bool,
    tolerance: f64,
    max_iterations: usize,
    max_evaluations: u64,
    patience: usize,
    restarts: usize,
    fallback: bool,
    rho: f64,
    sigma1: f64,
    sigma2: f64,
    beta: f64,
    max_backtracks: usize,
    invariant: bool,
    curvature: f64,
    determinant: (f64, f64),
    /// relative step of a first Jacobian by differences
    differences: Option<f64>,
    /// (start, row) of its compressed columns
    pattern: Option<(Vec<i64>, Vec<i64>)>,
    memory: Option<usize>,
}

impl Asked {
    fn options(self, n: usize) -> Result<Options> {
        let start = match (self.differences, &self.pattern) {
            (_, Some((start, row))) => Start::Pattern(Csc::new("sparsity", n, n, start, row, &vec![1.0; row.len()])?),
            (None, None) => Start::Identity,
            (Some(_), None) => Start::Differences,
        };
        Ok(Options {
            family: if self.broyden { Family::Broyden } else { Family::Bfgs },
            left: None,
            tolerance: self.tolerance,
            max_iterations: self.max_iterations,
            max_evaluations: self.max_evaluations,
            rule: Rule {
                rho: self.rho,
                sigma1: self.sigma1,
                sigma2: self.sigma2,
                beta: self.beta,
                max_backtracks: self.max_backtracks,
                invariant: self.invariant,
            },
            guard: Guard { curvature: self.curvature, determinant: self.determinant },
            start,
            memory: self.memory,
            difference: self.differences.unwrap_or(f64::EPSILON.sqrt()),
            patience: self.patience,
            restarts: self.restarts,
            fallback: self.fallback,
        })
    }
}

/// An outcome as Python has it.
#[derive(IntoPyObject)]
struct Report {
    status: &'static str,
    x: Vector<f64>,
    fun: Vector<f64>,
    norms: Vector<f64>,
    iterations: usize,
    backtracks: usize,
    evaluations: u64,
    skipped: usize,
    restarts: usize,
    singular: usize,
    fallback: Option<usize>,
    broyden: bool,
    inverse: Option<RootInverse>,
}

/// `function` takes and returns arrays (n,) of float64; `observer(x, f)` says whether to stop.
#[pyfunction]
fn root_solve(
    py: Python<'_>,
    function: Py<PyAny>,
    observer: Option<Py<PyAny>>,
    x0: Vec<f64>,
    options: Asked,
    inverse: Option<Py<RootInverse>>,
) -> PyResult<Report> {
    let n = x0.len();
    let options = options.options(n)?;
    let mut h = inverse.map(|h| {
        let h = &h.get().h;
        h.lock().unwrap_or_else(PoisonError::into_inner).clone()
    });
    let mut problem = Function { call: function, observer };
    let outcome = guarded(py, || solve(&mut problem, &x0, &options, &mut h))?;
    Ok(report(outcome, h.map(|h| RootInverse { h: Mutex::new(h), n })))
}

fn report(outcome: Outcome, inverse: Option<RootInverse>) -> Report {
    let status = match outcome.status {
        Status::Converged => "converged",
        Status::MaxIterations => "max-iterations",
        Status::MaxEvaluations => "max-evaluations",
        Status::LineSearch => "line-search",
        Status::Stalled => "stalled",
        Status::Stopped => "stopped",
        Status::Broken => "not-finite",
    };
    Report {
        status,
        x: Vector(outcome.x),
        fun: Vector(outcome.f),
        norms: Vector(outcome.norms),
        iterations: outcome.iterations,
        backtracks: outcome.backtracks,
        evaluations: outcome.evaluations,
        skipped: outcome.skipped,
        restarts: outcome.restarts,
        singular: outcome.singular,
        fallback: outcome.fallback,
        broyden: outcome.family == Family::Broyden,
        inverse,
    }
}
