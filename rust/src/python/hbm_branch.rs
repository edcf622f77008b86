//! Branches of harmonic balance for Python: stepped in chunks, so that the caller sees points, progress and Ctrl-C.
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use numpy::{Complex64, PyReadonlyArray1, PyReadonlyArray2};
use pyo3::prelude::*;

use super::border::{Rows, Vector, interruptible};
use super::hbm::{HbmProblem, lock, matrices, parameter_called};
use crate::error::{Error, Result};
use crate::periodic::crossings::Kind;
use crate::periodic::peak;
use crate::periodic::peak::Quantity;
use crate::periodic::problem::{Parameter, Problem};
use crate::periodic::response::{Event, Follower, Record, Settings, Status};
use crate::periodic::start;
use crate::run::Cancel;
use crate::solve::corrector::{Corrector, Options, Predictor};
use crate::solve::{Curve, newton};
use crate::tolerances::roots::EVENT_SOLVED;

pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<HbmBranch>()
}

/// A branch with its problem; every call of `run` appends points.
#[pyclass(frozen)]
pub struct HbmBranch {
    inner: Shared,
}

type Shared = Arc<Mutex<Option<Follower>>>;

/// The follower while it runs: out of its lock, since laws may be Python functions, and back there however the run ends.
struct Running {
    place: Shared,
    follower: Option<Follower>,
}

impl Running {
    /// A call that Ctrl-C has cut puts the follower back within a moment.
    fn new(place: Shared) -> Result<Self> {
        for _ in 0..20 {
            let follower = lock(&place).take();
            if follower.is_some() {
                return Ok(Running { place, follower });
            }
            std::thread::sleep(Duration::from_millis(5));
        }
        Err(Error::model("this branch is running already, within a function that it calls or after Ctrl-C"))
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        *lock(&self.place) = self.follower.take();
    }
}

/// What is followed, by name: first along `towards` = [dy, dp], and until the parameter, "omega", "level" or "scale" (of all frequencies),
/// leaves the range from `start` to `stop`. With `across` the first point lies in the plane through y across `towards`.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
struct Path<'py> {
    parameter: String,
    begin: f64,
    start: f64,
    stop: f64,
    towards: Option<PyReadonlyArray1<'py, f64>>,
    across: bool,
}

/// Options of a branch, by name.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
struct Asked {
    predictor: String,
    corrector: String,
    first_step: f64,
    least_step: f64,
    largest_step: f64,
    tolerance: f64,
    stability: bool,
    events: bool,
}

impl Asked {
    fn options(&self, scale: f64) -> Result<Options> {
        let steps = [self.first_step, self.least_step, self.largest_step];
        options(&self.predictor, &self.corrector, steps, self.tolerance, scale)
    }
}

/// New points of a branch, a column each, and what its run has cost so far; `exponents` where all points have them.
#[derive(IntoPyObject)]
struct Chunk {
    p: Vector<f64>,
    error: Vector<f64>,
    aliasing: Vector<f64>,
    step: Vector<f64>,
    iterations: Vector<f64>,
    /// how many exponents grow, nan where that is not known
    growing: Vector<f64>,
    /// false where the truncation of the motion decides that
    settled: Vector<bool>,
    y: Rows<f64>,
    exponents: Option<Rows<Complex64>>,
    monodromies: usize,
    events: Vec<Special>,
    corrections: u64,
    factorisations: u64,
    refinements: u64,
    broken: Option<usize>,
    status: &'static str,
}

/// A special point.
#[derive(IntoPyObject)]
struct Special {
    kind: &'static str,
    p: f64,
    y: Vector<f64>,
    exponent: Option<(f64, f64)>,
    settled: bool,
    before: usize,
}

#[pymethods]
impl HbmBranch {
    /// Solves at `path.begin` from the guess y, `at` = (omega, level), and follows the branch; `model` as of `HbmProblem.floquet`.
    #[new]
    #[pyo3(signature = (problem, y, at, path, options, model=None))]
    fn new(
        py: Python<'_>,
        problem: &HbmProblem,
        y: PyReadonlyArray1<'_, f64>,
        at: (Vec<f64>, f64),
        path: Path<'_>,
        options: Asked,
        model: Option<[PyReadonlyArray2<'_, f64>; 3]>,
    ) -> PyResult<Self> {
        let settings = Settings {
            options: options.options((path.stop - path.start).abs())?,
            from: path.start,
            to: path.stop,
            stability: options.stability,
            events: options.events,
        };
        let tolerance = options.tolerance;
        let parameter = parameter_called(&path.parameter)?;
        let mut y = y.as_slice()?.to_vec();
        let finer = problem.finer.clone();
        let mut copy = problem.separate()?;
        let (omega, level) = at;
        if omega.len() != copy.omega.len() {
            return Err(Error::model("frequencies of a wrong number").into());
        }
        copy.unit.clone_from(&omega);
        copy.omega = omega;
        copy.level = level;
        if matches!(parameter, Parameter::Omega(i) if i >= copy.omega.len()) {
            return Err(Error::model("there is no such base frequency").into());
        }
        if parameter == Parameter::Family && copy.family.is_none() {
            return Err(Error::model("a branch in a parameter of the system needs its family").into());
        }
        copy.parameter = parameter;
        let (begin, across) = (path.begin, path.across);
        let towards = path.towards.map(|t| t.as_slice().map(<[f64]>::to_vec)).transpose()?;
        if y.len() != copy.size() || towards.as_ref().is_some_and(|t| t.len() != y.len() + 1) {
            return Err(Error::model("a branch starts with coefficients of a wrong size").into());
        }
        let model = model.as_ref().map(matrices);
        let follower = interruptible(py, move |cancel| {
            copy.set_parameter(begin)?;
            if !across {
                first(&mut copy, &mut y, tolerance, cancel)?;
            }
            Follower::start(copy, &finer, &y, towards.as_deref(), settings, model.as_ref())
        })?;
        Ok(Self { inner: Arc::new(Mutex::new(Some(follower))) })
    }

    /// Goes on for at most so many points and seconds; returns what is new.
    fn run(&self, py: Python<'_>, points: usize, seconds: f64) -> PyResult<Chunk> {
        let inner = self.inner.clone();
        interruptible(py, move |cancel| {
            let begin = Instant::now();
            let mut running = Running::new(inner)?;
            let Some(follower) = running.follower.as_mut() else {
                return Err(Error::Interrupted);
            };
            while follower.status == Status::Going
                && follower.records.len() < points
                && begin.elapsed().as_secs_f64() < seconds
            {
                follower.advance(cancel)?;
            }
            Chunk::taken(follower)
        })
    }
}

/// The first point, found from the guess y.
fn first(problem: &mut Problem, y: &mut [f64], tolerance: f64, cancel: &Cancel) -> Result<()> {
    let newton = newton::Options { tolerance, max_iterations: 60 };
    let outcome = start::solve(problem, y, newton, true, cancel)?;
    if outcome.converged {
        return Ok(());
    }
    let what = match problem.ever_broken {
        Some(e) => format!("elements[{e}] returned a force that is not finite"),
        None => outcome.reason.to_string(),
    };
    let message = format!("the first point of the branch was not found: {what}; begin elsewhere or give x0");
    Err(Error::Convergence { message, best: y.to_vec(), residual: outcome.step })
}

pub fn options(predictor: &str, corrector: &str, steps: [f64; 3], tolerance: f64, scale: f64) -> Result<Options> {
    let predictor = match predictor {
        "tangent" => Predictor::Tangent,
        "secant" => Predictor::Secant,
        "lagrange" => Predictor::Lagrange(3),
        other => match other.strip_prefix("lagrange").and_then(|order| order.parse().ok()) {
            Some(order @ 1..=5) => Predictor::Lagrange(order),
            _ => return Err(Error::model(format!("no predictor is called {other}"))),
        },
    };
    let corrector = match corrector {
        "pseudo-arclength" => Corrector::PseudoArclength,
        "arclength" => Corrector::Arclength,
        "moore-penrose" => Corrector::MoorePenrose,
        other => {
            let message = format!("no corrector is called {other}; use pseudo-arclength, arclength or moore-penrose");
            return Err(Error::model(message));
        }
    };
    Ok(Options {
        predictor,
        corrector,
        tolerance,
        max_corrections: 8,
        first_step: steps[0],
        least_step: steps[1],
        largest_step: steps[2],
        parameter_scale: scale,
    })
}

impl Chunk {
    /// Takes what is new from the follower.
    fn taken(follower: &mut Follower) -> Result<Self> {
        let base = follower.problem.base_frequency();
        let records = std::mem::take(&mut follower.records);
        let column = |of: &dyn Fn(&Record) -> f64| Vector(records.iter().map(of).collect());
        let growing = |r: &Record| match &r.floquet {
            Some(f) if r.settled && !f.doubtful && f.exponents.all().all(|s| s.re.is_finite()) => {
                f.exponents.unstable(base) as f64
            }
            _ => f64::NAN,
        };
        let exponents: Vec<_> =
            records.iter().filter_map(|r| r.floquet.as_ref().map(|f| f.exponents.all().collect())).collect();
        let known = !exponents.is_empty() && exponents.len() == records.len();
        Ok(Chunk {
            p: column(&|r| r.p),
            error: column(&|r| r.error),
            aliasing: column(&|r| r.aliasing),
            step: column(&|r| r.step),
            iterations: column(&|r| r.iterations as f64),
            growing: column(&growing),
            settled: Vector(records.iter().map(|r| r.settled).collect()),
            y: Rows::new(records.iter().map(|r| r.y.clone()).collect())?,
            exponents: if known { Some(Rows::new(exponents)?) } else { None },
            monodromies: records.iter().filter(|r| r.floquet.as_ref().is_some_and(|f| !f.by_hill)).count(),
            events: std::mem::take(&mut follower.events).into_iter().map(Special::from).collect(),
            corrections: follower.corrections(),
            factorisations: follower.factorisations(),
            refinements: follower.refinements(),
            broken: follower.problem.ever_broken,
            status: match follower.status {
                Status::Going => "going",
                Status::End => "end",
                Status::Start => "start",
                Status::Stalled => "stalled",
            },
        })
    }
}

impl From<Event> for Special {
    fn from(event: Event) -> Self {
        Special {
            kind: match event.kind {
                Kind::Fold => "fold",
                Kind::BranchPoint => "branch-point",
                Kind::NeimarkSacker => "neimark-sacker",
                Kind::PeriodDoubling => "period-doubling",
                Kind::Grazing => "grazing",
                Kind::Unresolved => "unresolved",
            },
            p: event.p,
            y: Vector(event.y),
            exponent: event.exponent.map(|s| (s.re, s.im)),
            settled: event.settled,
            before: event.before,
        }
    }
}

/// The largest amplitude of a term (or the largest displacement) of one displacement near the solution y: (omega, y).
pub fn find_peak(
    problem: &mut Problem,
    y: &[f64],
    towards: Option<&[f64]>,
    quantity: &Quantity,
    cancel: &Cancel,
) -> Result<(f64, Vec<f64>)> {
    let scale = problem.omega[0];
    let options = options("tangent", "pseudo-arclength", [0.05, EVENT_SOLVED, 0.05], EVENT_SOLVED, scale)?;
    let point = peak::find(problem, y, towards, quantity, options, cancel)?;
    Ok((point.p(), point.y().to_vec()))
}
