//! Harmonic balance for Python: a problem object that solves, estimates and follows branches.
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use faer::Mat;
use numpy::{Complex64, PyArray1, PyReadonlyArray1, PyReadonlyArray2};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use super::border::{guarded, interruptible, matrix, to_numpy};
use crate::analysis::hbm::basis::Basis;
use crate::analysis::hbm::estimate::{Estimate, Estimator};
use crate::analysis::hbm::linear::{DynamicStiffness, Full};
use crate::analysis::hbm::problem::{Element, Parameter, Problem};
use crate::error::{Error, Result};
use crate::laws::Law;
use crate::run::Cancel;
use crate::solve::newton::{self, Options, Outcome};
use crate::solve::{Curve, Linearisation};

pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(law_force, module)?)?;
    module.add_class::<HbmProblem>()?;
    module.add_class::<HbmElements>()
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

fn row_major(m: &Mat<f64>) -> Vec<f64> {
    (0..m.nrows() * m.ncols())
        .map(|i| m[(i / m.ncols(), i % m.ncols())])
        .collect()
}

/// Force of one law along a history of displacements and rates; the memory starts at zero.
#[pyfunction]
fn law_force<'py>(
    py: Python<'py>,
    code: i64,
    values: Vec<f64>,
    u: PyReadonlyArray1<'_, f64>,
    v: PyReadonlyArray1<'_, f64>,
) -> PyResult<Bound<'py, PyArray1<f64>>> {
    let law = Law::from_code(code, values.len())?;
    let (u, v) = (u.as_array(), v.as_array());
    let mut memory = vec![0.0; law.n_memory()];
    let force = u
        .iter()
        .zip(v.iter())
        .map(|(u, v)| law.eval(*u, *v, &values, &mut memory))
        .collect();
    Ok(PyArray1::from_vec(py, force))
}

/// Laws on directions; the parameters of all of them lie in one vector.
#[pyclass(frozen)]
pub struct HbmElements(Vec<Element>);

#[pymethods]
impl HbmElements {
    /// Element e has the law `code[e]` with `count[e]` numbers, and the entries `start[e]..start[e+1]` of its direction.
    #[new]
    fn new(
        code: Vec<i64>,
        count: Vec<usize>,
        values: Vec<f64>,
        start: Vec<usize>,
        index: Vec<usize>,
        weight: Vec<f64>,
    ) -> PyResult<Self> {
        let n = code.len();
        if count.len() != n || start.len() != n + 1 || index.len() != weight.len() {
            return Err(Error::model("elements: arrays of different lengths").into());
        }
        let mut elements = Vec::new();
        let mut at = 0;
        for e in 0..n {
            let law = Law::from_code(code[e], count[e])?;
            let params = values.get(at..at + count[e]);
            let range = start[e]..start[e + 1];
            let (Some(params), Some(index), Some(weight)) =
                (params, index.get(range.clone()), weight.get(range))
            else {
                return Err(Error::model(format!("element {e}: numbers are missing")).into());
            };
            at += count[e];
            let direction = index.iter().copied().zip(weight.iter().copied()).collect();
            elements.push(Element {
                law,
                params: params.to_vec(),
                direction,
            });
        }
        Ok(Self(elements))
    }
}

/// One set of terms, forces and samples; `omega` may be changed by every call.
#[pyclass(frozen)]
pub struct HbmProblem {
    inner: Arc<Mutex<Problem>>,
    fine: Vec<usize>,
}

#[pymethods]
impl HbmProblem {
    /// `indices` (n_terms, p); `forces` (n_terms + 1, n) complex; `dims`, `fine` samples per dimension, the second for estimates.
    #[new]
    #[expect(clippy::too_many_arguments)]
    fn new(
        m: PyReadonlyArray2<'_, f64>,
        c: PyReadonlyArray2<'_, f64>,
        k: PyReadonlyArray2<'_, f64>,
        elements: &HbmElements,
        indices: Vec<Vec<i32>>,
        subharmonic: i32,
        forces: PyReadonlyArray2<'_, Complex64>,
        omega: Vec<f64>,
        dims: Vec<usize>,
        fine: Vec<usize>,
    ) -> PyResult<Self> {
        let (m, c, k) = (matrix(&m), matrix(&c), matrix(&k));
        let n = m.nrows();
        let basis = Basis {
            indices,
            subharmonic: f64::from(subharmonic),
        };
        check(&basis, &elements.0, n, &dims, &fine, &omega)?;
        let forces: Vec<Option<Vec<Complex64>>> = forces
            .as_array()
            .outer_iter()
            .map(|f| f.iter().any(|x| x.norm() > 0.0).then(|| f.to_vec()))
            .collect();
        let linear: Box<dyn DynamicStiffness> = Box::new(Full {
            n,
            m: row_major(&m),
            c: row_major(&c),
            k: row_major(&k),
        });
        let problem = Problem::new(
            basis,
            linear,
            elements.0.clone(),
            Arc::new(forces),
            omega,
            &dims,
        );
        Ok(Self {
            inner: Arc::new(Mutex::new(problem)),
            fine,
        })
    }

    /// Residual and Jacobian at the coefficients y (harmonic by harmonic) for the base frequencies omega.
    fn residual<'py>(
        &self,
        py: Python<'py>,
        y: PyReadonlyArray1<'_, f64>,
        omega: Vec<f64>,
    ) -> PyResult<Bound<'py, PyDict>> {
        let y = y.as_slice()?.to_vec();
        let out = guarded(py, || {
            let mut problem = self.at(&omega, y.len())?;
            let mut out = Linearisation::new(y.len());
            problem.parameter = Parameter::Omega(0);
            problem.linearise(&y, omega[0], &mut out)?;
            Ok(out)
        })?;
        let dict = PyDict::new(py);
        dict.set_item("residual", PyArray1::from_vec(py, out.residual))?;
        dict.set_item("jacobian", to_numpy(py, out.jacobian.as_ref()))?;
        dict.set_item("slope", PyArray1::from_vec(py, out.slope))?;
        Ok(dict)
    }

    /// One solution, started at y.
    #[pyo3(signature = (y, omega, level=1.0, tolerance=1e-10, max_iterations=50))]
    fn solve<'py>(
        &self,
        py: Python<'py>,
        y: PyReadonlyArray1<'_, f64>,
        omega: Vec<f64>,
        level: f64,
        tolerance: f64,
        max_iterations: usize,
    ) -> PyResult<Bound<'py, PyDict>> {
        let mut y = y.as_slice()?.to_vec();
        drop(self.at(&omega, y.len())?);
        let (inner, fine) = (self.inner.clone(), self.fine.clone());
        let options = Options {
            tolerance,
            max_iterations,
        };
        let solved = interruptible(py, move |cancel| {
            let mut problem = lock(&inner);
            problem.omega = omega;
            problem.evaluations = 0;
            problem.parameter = Parameter::Level { with_static: true };
            let outcome = one_solution(&mut problem, &mut y, level, options, cancel)?;
            let estimate = Estimator::new(&problem, &fine).estimate(&problem, &y)?;
            let all = problem.expand(&y)?;
            Ok(Solved {
                y,
                all,
                outcome,
                estimate,
                evaluations: problem.evaluations,
                broken: problem.broken,
            })
        })?;
        solved.to_dict(py)
    }

    /// All coordinates (n, n_c) of a vector y.
    fn expand<'py>(
        &self,
        py: Python<'py>,
        y: PyReadonlyArray1<'_, f64>,
        omega: Vec<f64>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let y = y.as_slice()?.to_vec();
        let all = guarded(py, || self.at(&omega, y.len())?.expand(&y))?;
        Ok(to_numpy(py, all.as_ref()).into_any())
    }

    /// The vector y of all coordinates X (n, n_c).
    fn restrict<'py>(
        &self,
        py: Python<'py>,
        x: PyReadonlyArray2<'_, f64>,
    ) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let x = matrix(&x);
        let problem = lock(&self.inner);
        if x.nrows() != problem.linear.full_size() || x.ncols() != problem.basis.n_coefficients() {
            return Err(Error::model("coefficients of a wrong shape").into());
        }
        let mut y = vec![0.0; problem.size()];
        for (c, part) in y.chunks_exact_mut(problem.n()).enumerate() {
            let column: Vec<f64> = (0..x.nrows()).map(|i| x[(i, c)]).collect();
            problem.linear.restrict(&column, part);
        }
        Ok(PyArray1::from_vec(py, y))
    }
}

impl HbmProblem {
    fn at(&self, omega: &[f64], size: usize) -> Result<MutexGuard<'_, Problem>> {
        let mut problem = lock(&self.inner);
        if omega.len() != problem.omega.len() || size != problem.size() {
            return Err(Error::model("coefficients or frequencies of a wrong size"));
        }
        problem.omega.copy_from_slice(omega);
        Ok(problem)
    }
}

struct Solved {
    y: Vec<f64>,
    all: Mat<f64>,
    outcome: Outcome,
    estimate: Estimate,
    evaluations: u64,
    broken: Option<usize>,
}

impl Solved {
    fn to_dict<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let dict = PyDict::new(py);
        dict.set_item("y", PyArray1::from_slice(py, &self.y))?;
        dict.set_item("X", to_numpy(py, self.all.as_ref()))?;
        dict.set_item("converged", self.outcome.converged)?;
        dict.set_item("reason", self.outcome.reason)?;
        dict.set_item("iterations", self.outcome.iterations)?;
        dict.set_item("evaluations", self.evaluations)?;
        dict.set_item("step", self.outcome.step)?;
        dict.set_item("error", self.estimate.error)?;
        dict.set_item("error_retained", self.estimate.retained)?;
        dict.set_item("broken", self.broken)?;
        Ok(dict)
    }
}

fn one_solution(
    problem: &mut Problem,
    y: &mut [f64],
    level: f64,
    options: Options,
    cancel: &Cancel,
) -> Result<Outcome> {
    let mut out = Linearisation::new(problem.size());
    newton::solve(problem, y, level, options, &mut out, cancel)
}

/// What the core relies on; Python has said the same in the words of the user before.
fn check(
    basis: &Basis,
    elements: &[Element],
    n: usize,
    dims: &[usize],
    fine: &[usize],
    omega: &[f64],
) -> Result<()> {
    let p = dims.len();
    if n == 0
        || p == 0
        || fine.len() != p
        || omega.len() != p
        || basis.indices.iter().any(|k| k.len() != p)
    {
        return Err(Error::model(
            "harmonic balance: frequencies, indices and samples do not match",
        ));
    }
    let reach = basis.reach();
    if dims
        .iter()
        .chain(fine)
        .zip(reach.iter().cycle())
        .any(|(n, k)| *n < 2 * k + 1)
    {
        return Err(Error::model(
            "harmonic balance: fewer samples than coefficients",
        ));
    }
    if elements
        .iter()
        .any(|e| e.direction.iter().any(|(i, _)| *i >= n))
    {
        return Err(Error::model(
            "harmonic balance: a direction beyond the last coordinate",
        ));
    }
    if basis.subharmonic < 1.0 {
        return Err(Error::model(
            "harmonic balance: a subharmonic order below one",
        ));
    }
    Ok(())
}
