//! Harmonic balance for Python: a problem object that solves, estimates and follows branches.
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use numpy::{Complex64, PyArray1, PyReadonlyArray1, PyReadonlyArray2};
use pyo3::prelude::*;

use super::border::{Dense, Vector, called, guarded, interruptible, matrix, to_numpy};
use super::hbm_branch::{find_peak, options};
use super::hbm_elements::HbmElements;
use super::hbm_linear::HbmLinear;
use crate::error::{Error, Result};
use crate::periodic::autonomous;
use crate::periodic::basis::{Basis, Finer};
use crate::periodic::element::Element;
use crate::periodic::estimate::{Estimate, Estimator, error_at};
use crate::periodic::family::{Family, Member, Placed};
use crate::periodic::linear::{DynamicStiffness, Matrices};
use crate::periodic::peak::Quantity;
use crate::periodic::problem::{Parameter, Problem};
use crate::periodic::stability::Stability;
use crate::periodic::start;
use crate::periodic::truncation::{Judge, Solution, Verdict};
use crate::solve::newton::Options;
use crate::solve::{Curve, Linearisation};
use crate::tolerances::roots::EVENT_SOLVED;

pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<HbmProblem>()?;
    module.add_class::<HbmLinear>()
}

pub fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Python's `family(value)`, which returns (HbmLinear, HbmElements).
struct PythonFamily(Py<PyAny>);

impl Family for PythonFamily {
    fn member(&self, value: f64) -> Result<Member> {
        Ok(called(|py| {
            let answer = self.0.call1(py, (value,))?;
            let (linear, elements): (Bound<'_, HbmLinear>, Bound<'_, HbmElements>) = answer.extract(py)?;
            let linear = lock(&linear.get().0).copied()?;
            Ok(Member { linear, elements: elements.get().0.clone() })
        }))
    }
}

/// M, C, K from Python.
pub fn matrices(parts: &[PyReadonlyArray2<'_, f64>; 3]) -> Matrices {
    let [m, c, k] = parts.each_ref().map(matrix);
    (m, c, k)
}

/// One set of terms, forces and samples; `omega` may be changed by every call.
#[pyclass(frozen)]
pub struct HbmProblem {
    inner: Arc<Mutex<Problem>>,
    pub finer: Finer,
}

#[pymethods]
impl HbmProblem {
    /// `indices` (n_terms, p) of the terms whose forces `linear` holds; `dims` samples per dimension. The
    /// error estimate adds the terms `extra` and takes `fine` samples.
    #[new]
    #[expect(clippy::too_many_arguments)]
    fn new(
        linear: &HbmLinear,
        elements: &HbmElements,
        indices: Vec<Vec<i32>>,
        subharmonic: i32,
        omega: Vec<f64>,
        dims: Vec<usize>,
        extra: Vec<Vec<i32>>,
        fine: Vec<usize>,
    ) -> PyResult<Self> {
        let linear = lock(&linear.0).copied()?;
        let basis = Basis { indices, subharmonic: f64::from(subharmonic) };
        let finer = Finer { extra, dims: fine };
        check(&basis, &elements.0, linear.as_ref(), &dims, &omega)?;
        let extended = basis.extended(&finer.extra);
        check(&extended, &elements.0, linear.as_ref(), &finer.dims, &omega)?;
        let problem = Problem::new(basis, linear, elements.0.clone(), omega, &dims)?;
        Ok(Self { inner: Arc::new(Mutex::new(problem)), finer })
    }

    /// Number of unknowns.
    #[getter]
    fn size(&self) -> usize {
        lock(&self.inner).size()
    }

    /// Lets the system depend on a parameter: `family(value)` returns (HbmLinear, HbmElements); `step` is that of differences.
    fn with_family(&self, family: Py<PyAny>, value: f64, step: f64) {
        lock(&self.inner).family = Some(Placed { family: Arc::new(PythonFamily(family)), value, step });
    }

    /// Residual, Jacobian and slope by the parameter ("omega", "level", "scale" or "family") at the coefficients y (harmonic by harmonic).
    #[pyo3(signature = (y, omega, level=1.0, parameter="omega", value=None))]
    fn residual(
        &self,
        py: Python<'_>,
        y: PyReadonlyArray1<'_, f64>,
        omega: Vec<f64>,
        level: f64,
        parameter: &str,
        value: Option<f64>,
    ) -> PyResult<Tangent> {
        let y = y.as_slice()?.to_vec();
        let parameter = parameter_called(parameter)?;
        let mut problem = self.separate()?;
        if y.len() != problem.size() || omega.len() != problem.omega.len() {
            return Err(Error::model("coefficients or frequencies of a wrong size").into());
        }
        problem.omega.clone_from(&omega);
        problem.unit = omega;
        problem.level = level;
        problem.parameter = parameter;
        let out = interruptible(py, move |_| {
            let mut out = Linearisation::new(y.len());
            let value = value.unwrap_or_else(|| problem.parameter_value());
            problem.linearise(&y, value, &mut out)?;
            Ok(out)
        })?;
        Ok(Tangent { residual: Vector(out.residual), jacobian: Dense(out.jacobian), slope: Vector(out.slope) })
    }

    /// One solution, started at y; where that fails and `ramp`, by raising the forces from zero.
    #[pyo3(signature = (y, omega, *, tolerance, max_iterations, ramp=true))]
    fn solve(
        &self,
        py: Python<'_>,
        y: PyReadonlyArray1<'_, f64>,
        omega: Vec<f64>,
        tolerance: f64,
        max_iterations: usize,
        ramp: bool,
    ) -> PyResult<Solved> {
        let mut y = y.as_slice()?.to_vec();
        drop(self.at(&omega, y.len(), 1.0)?);
        let (mut problem, finer) = (self.separate()?, self.finer.clone());
        let options = Options { tolerance, max_iterations };
        interruptible(py, move |cancel| {
            problem.omega = omega;
            problem.level = 1.0;
            problem.evaluations = 0;
            problem.ever_broken = None;
            let outcome = start::solve(&mut problem, &mut y, options, ramp, cancel)?;
            let estimate = Estimator::new(&problem, &finer)?.estimate(&problem, &y)?;
            let all = problem.expand(&y)?;
            Ok(Solved {
                y: Vector(y),
                all: Dense(all),
                converged: outcome.converged,
                reason: outcome.reason,
                iterations: outcome.iterations,
                step: outcome.step,
                evaluations: problem.evaluations,
                factorisations: problem.factorisations,
                error: estimate.error,
                aliasing: estimate.aliasing,
                broken: problem.ever_broken,
            })
        })
    }

    /// Estimated relative error of a solution y at (omega, level, value of the parameter of a family).
    fn estimate(
        &self,
        py: Python<'_>,
        y: PyReadonlyArray1<'_, f64>,
        at: (Vec<f64>, f64, Option<f64>),
    ) -> PyResult<f64> {
        let (omega, level, value) = at;
        let y = y.as_slice()?.to_vec();
        drop(self.at(&omega, y.len(), level)?);
        let (problem, finer) = (self.separate()?, self.finer.clone());
        interruptible(py, move |_| error_at(problem, &finer, &y, value))
    }

    /// A motion of which one frequency is its own, from the guess z = [y, omega[free]]; `at`: all frequencies, and the free one.
    #[pyo3(signature = (z, at, *, tolerance, max_iterations))]
    fn cycle(
        &self,
        py: Python<'_>,
        z: PyReadonlyArray1<'_, f64>,
        at: (Vec<f64>, usize),
        tolerance: f64,
        max_iterations: usize,
    ) -> PyResult<Cycle> {
        let (mut z, (omega, free)) = (z.as_slice()?.to_vec(), at);
        if free >= omega.len() {
            return Err(Error::model("there is no such frequency").into());
        }
        drop(self.at(&omega, z.len().saturating_sub(1), 1.0)?);
        let (mut problem, finer) = (self.separate()?, self.finer.clone());
        let options = Options { tolerance, max_iterations };
        interruptible(py, move |cancel| {
            let outcome = autonomous::solve(&mut problem, &mut z, free, options, cancel)?;
            let error = autonomous::estimate(&problem, &z, free, &finer)?;
            Ok(Cycle {
                z: Vector(z),
                converged: outcome.converged,
                reason: outcome.reason,
                iterations: outcome.iterations,
                evaluations: problem.evaluations,
                error,
            })
        })
    }

    /// Floquet exponents of a solution, None where they cannot be told, and the monodromy matrix if asked for. `error` is that of the
    /// solution: where it may turn an exponent, those of a motion with more harmonics. `free`: a limit cycle.
    /// `model`: M, C, K of a reduced model of a large system, retained coordinates first.
    #[pyo3(signature = (y, omega, *, error=0.0, free=false, monodromy=false, model=None))]
    #[expect(clippy::too_many_arguments)]
    fn floquet(
        &self,
        py: Python<'_>,
        y: PyReadonlyArray1<'_, f64>,
        omega: Vec<f64>,
        error: f64,
        free: bool,
        monodromy: bool,
        model: Option<[PyReadonlyArray2<'_, f64>; 3]>,
    ) -> PyResult<Told> {
        let y = y.as_slice()?.to_vec();
        drop(self.at(&omega, y.len(), 1.0)?);
        let (mut problem, finer) = (self.separate()?, self.finer.clone());
        let model = model.as_ref().map(matrices);
        interruptible(py, move |_| {
            let mut out = Linearisation::new(y.len());
            problem.linearise_here(&y, &mut out)?;
            let Some(mut stability) = Stability::new(&mut problem, model.as_ref())? else {
                return Ok(Told { exponents: None, settled: true, monodromy: None });
            };
            let matrix = if monodromy { Some(stability.monodromy(&mut problem, &y)?) } else { None };
            let verdict = judged(&mut problem, stability, &finer, &y, &out, error, free)?;
            Ok(Told {
                exponents: Some(Vector(verdict.floquet.exponents.all().collect())),
                settled: verdict.settled && !verdict.floquet.doubtful,
                monodromy: matrix.map(Dense),
            })
        })
    }

    /// The maximum of one harmonic, or without a term of the displacement, near the solution y: (omega, y). The displacement is
    /// weights . x; `towards` is a step [dy, domega] along the branch.
    #[expect(clippy::too_many_arguments)]
    fn peak<'py>(
        &self,
        py: Python<'py>,
        y: PyReadonlyArray1<'_, f64>,
        omega: f64,
        level: f64,
        weights: PyReadonlyArray1<'_, f64>,
        term: Option<usize>,
        towards: Option<PyReadonlyArray1<'_, f64>>,
    ) -> PyResult<(f64, Bound<'py, PyArray1<f64>>)> {
        let y = y.as_slice()?.to_vec();
        let mut problem = self.separate()?;
        let weights = weights.as_slice()?.to_vec();
        let towards = towards.map(|t| t.as_slice().map(<[f64]>::to_vec)).transpose()?;
        if y.len() != problem.size()
            || weights.len() != problem.linear.full_size()
            || towards.as_ref().is_some_and(|t| t.len() != y.len() + 1)
            || term.is_some_and(|t| t > problem.basis.n_harmonics())
        {
            return Err(Error::model("no such displacement or harmonic").into());
        }
        problem.omega[0] = omega;
        problem.level = level;
        let quantity = Quantity { weights, term };
        let (omega, y) =
            interruptible(py, move |cancel| find_peak(&mut problem, &y, towards.as_deref(), &quantity, cancel))?;
        Ok((omega, PyArray1::from_vec(py, y)))
    }

    /// All coordinates (n, n_c) of a vector y.
    #[pyo3(signature = (y, omega, level=1.0))]
    fn expand<'py>(
        &self,
        py: Python<'py>,
        y: PyReadonlyArray1<'_, f64>,
        omega: Vec<f64>,
        level: f64,
    ) -> PyResult<Bound<'py, PyAny>> {
        let y = y.as_slice()?.to_vec();
        let all = guarded(py, || self.at(&omega, y.len(), level)?.expand(&y))?;
        Ok(to_numpy(py, all.as_ref()).into_any())
    }

    /// The vector y of all coordinates X (n, n_c).
    fn restrict<'py>(&self, py: Python<'py>, x: PyReadonlyArray2<'_, f64>) -> PyResult<Bound<'py, PyArray1<f64>>> {
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
    /// A copy that another computation may change.
    pub fn separate(&self) -> Result<Problem> {
        let problem = lock(&self.inner);
        problem.on(problem.basis.clone(), &problem.dims())
    }

    fn at(&self, omega: &[f64], size: usize, level: f64) -> Result<MutexGuard<'_, Problem>> {
        let mut problem = lock(&self.inner);
        if omega.len() != problem.omega.len() || size != problem.size() {
            return Err(Error::model("coefficients or frequencies of a wrong size"));
        }
        problem.omega.copy_from_slice(omega);
        problem.level = level;
        Ok(problem)
    }
}

/// Exponents of a single solution: of a free motion across the direction in which its phase changes, else at its frequency.
fn judged(
    problem: &mut Problem,
    stability: Stability,
    finer: &Finer,
    y: &[f64],
    out: &Linearisation,
    error: f64,
    free: bool,
) -> Result<Verdict> {
    let p = problem.parameter_value();
    let mut along = if free { autonomous::rate(problem, y, 0) } else { vec![0.0; y.len()] };
    along.push(if free { 0.0 } else { 1.0 });
    let z: Vec<f64> = y.iter().copied().chain([p]).collect();
    let steps = [1.0, EVENT_SOLVED, 1.0];
    let options = options("tangent", "pseudo-arclength", steps, EVENT_SOLVED, p)?;
    let estimate = Estimate::bound(problem, y, error);
    Judge::new(stability, finer, options, free).judge(problem, out, Solution { z: &z, along: &along }, &estimate, false)
}

/// Exponents, whether the harmonics that were left out do not decide which of them grow, and the monodromy matrix.
#[derive(IntoPyObject)]
struct Told {
    exponents: Option<Vector<Complex64>>,
    settled: bool,
    monodromy: Option<Dense<f64>>,
}

/// Residual with its derivatives by the coefficients and by the parameter.
#[derive(IntoPyObject)]
struct Tangent {
    residual: Vector<f64>,
    jacobian: Dense<f64>,
    slope: Vector<f64>,
}

/// A solution: coefficients y of the retained coordinates, and of all.
#[derive(IntoPyObject)]
struct Solved {
    y: Vector<f64>,
    #[pyo3(item("X"))]
    all: Dense<f64>,
    converged: bool,
    reason: &'static str,
    iterations: usize,
    evaluations: u64,
    factorisations: u64,
    step: f64,
    error: f64,
    aliasing: f64,
    broken: Option<usize>,
}

/// A motion z = [y, omega[free]].
#[derive(IntoPyObject)]
struct Cycle {
    z: Vector<f64>,
    converged: bool,
    reason: &'static str,
    iterations: usize,
    evaluations: u64,
    error: f64,
}

pub fn parameter_called(name: &str) -> Result<Parameter> {
    match name {
        "omega" => Ok(Parameter::Omega(0)),
        "level" => Ok(Parameter::Level),
        "scale" => Ok(Parameter::Scale),
        "family" => Ok(Parameter::Family),
        other => match other.strip_prefix("omega").map(str::parse) {
            Some(Ok(i)) => Ok(Parameter::Omega(i)),
            _ => Err(Error::model(format!("no continuation parameter is called {other}"))),
        },
    }
}

/// What the core relies on; Python has said the same in the words of the user before.
fn check(
    basis: &Basis,
    elements: &[Element],
    linear: &dyn DynamicStiffness,
    dims: &[usize],
    omega: &[f64],
) -> Result<()> {
    let (n, p) = (linear.full_size(), dims.len());
    if n == 0 || p == 0 || omega.len() != p || basis.indices.iter().any(|k| k.len() != p) {
        return Err(Error::model("harmonic balance: frequencies, indices and samples do not match"));
    }
    let reach = basis.reach();
    if dims.iter().zip(&reach).any(|(n, k)| *n < 2 * k + 1) {
        return Err(Error::model("harmonic balance: fewer samples than coefficients"));
    }
    if elements.iter().any(|e| e.directions.iter().flatten().any(|(i, _)| *i >= n)) {
        return Err(Error::model("harmonic balance: a direction beyond the last coordinate"));
    }
    if p > 1 && elements.iter().any(|e| e.force.has_memory()) {
        return Err(Error::model("laws with memory have no quasi-periodic form; use laws without memory"));
    }
    if basis.subharmonic < 1.0 {
        return Err(Error::model("harmonic balance: a subharmonic order below one"));
    }
    check_memory(basis, elements, linear.size(), dims)
}

/// Bytes beyond which a problem is refused: what it asks for was hardly meant.
const MOST_MEMORY: f64 = 4e9;

/// Before anything is allocated, which an operating system may answer by ending the process.
fn check_memory(basis: &Basis, elements: &[Element], n: usize, dims: &[usize]) -> Result<()> {
    let n_c = basis.n_coefficients() as f64;
    let samples: f64 = dims.iter().map(|d| *d as f64).product();
    let with_memory = elements.iter().any(|e| e.force.has_memory());
    let tables = if with_memory { 2.0 * n_c } else { 0.0 };
    let m = elements.iter().map(|e| e.directions.len()).max().unwrap_or(1) as f64;
    let of_samples = 8.0 * samples * (8.0 * m + 4.0 * m * m + tables);
    let of_unknowns = 8.0 * (3.0 * (n as f64 * n_c).powi(2) + 3.0 * (m * n_c).powi(2));
    if of_samples > MOST_MEMORY {
        return Err(Error::model(format!(
            "{samples:.3e} samples would take {:.1} GB; take fewer samples or harmonics",
            of_samples / 1e9
        )));
    }
    if of_unknowns > MOST_MEMORY {
        return Err(Error::model(format!(
            "{:.3e} unknowns would take {:.1} GB; condense the system or take fewer harmonics",
            n as f64 * n_c,
            of_unknowns / 1e9
        )));
    }
    Ok(())
}
