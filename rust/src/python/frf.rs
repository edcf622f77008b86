//! Transfer functions and time response at the border.
use std::sync::Arc;

use faer::{Mat, c64};
use numpy::{Complex64, IntoPyArray, PyArray1, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2, PyReadonlyArray3};
use pyo3::prelude::*;

use super::border::{Dense, Given, interruptible, matrix};
use crate::error::{Error, Result};
use crate::memory;
use crate::run::Counts;
use crate::second_order::frf_resonances;
use crate::second_order::frf_sensitivity::{self, Entry, Variation};
use crate::second_order::history::History;
use crate::second_order::linear_system::LinearSystem;
use crate::second_order::ports::Ports;
use crate::second_order::response::{Linear, Motion};
use crate::second_order::response_sensitivity;

pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(resonances, module)?)?;
    module.add_function(wrap_pyfunction!(unseen_resonances, module)?)?;
    module.add_function(wrap_pyfunction!(missed_resonances, module)?)
}

type M2<'py> = PyReadonlyArray2<'py, f64>;
type M3<'py> = PyReadonlyArray3<'py, f64>;

type Roots<'py> = PyReadonlyArray1<'py, Complex64>;

/// Poles from `low` to `high` rad/s that make a peak, repeated ones once.
#[pyfunction]
fn resonances<'py>(py: Python<'py>, poles: Roots<'py>, low: f64, high: f64) -> Bound<'py, PyArray1<Complex64>> {
    frf_resonances::resonances(&poles.as_array().to_vec(), low, high).into_pyarray(py)
}

/// Resonances (rad/s) whose half-power band lies between two neighbours of `omega`.
#[pyfunction]
fn unseen_resonances(poles: Roots<'_>, omega: Vec<f64>) -> Vec<f64> {
    frf_resonances::unseen(&poles.as_array().to_vec(), &omega)
}

/// Those of the suspects (rad/s) whose peaks (entries, suspects) show beside H (entries, omega), both flat.
#[pyfunction]
fn missed_resonances(omega: Vec<f64>, h: Roots<'_>, suspects: Vec<f64>, peaks: Roots<'_>) -> Vec<f64> {
    frf_resonances::missed(&omega, &h.as_array().to_vec(), &suspects, &peaks.as_array().to_vec())
}

/// Output map L (n_out, n), input map F (n, n_in), the derivative of each input that acts, and what outputs see of the inputs at once.
#[derive(FromPyObject)]
pub struct Maps<'py>(M2<'py>, M2<'py>, Vec<u32>, Given<'py>);

/// rad/s
pub type Omega<'py> = PyReadonlyArray1<'py, f64>;

/// Times, loads (n_in, n_t), their bulges, and the state before the first time.
#[derive(FromPyObject)]
pub struct Loads<'py>(
    PyReadonlyArray1<'py, f64>,
    M2<'py>,
    M2<'py>,
    PyReadonlyArray1<'py, f64>,
    PyReadonlyArray1<'py, f64>,
);

/// Number of parameters, and derivatives of M, D, S, F, L and D0 with a last axis of that size, or None where nothing changes.
#[derive(FromPyObject)]
pub struct Changes<'py>(
    usize,
    Option<M3<'py>>,
    Option<M3<'py>>,
    Option<M3<'py>>,
    Option<M3<'py>>,
    Option<M3<'py>>,
    Option<M3<'py>>,
);

/// Names of the derivatives in `Changes`.
const CHANGES: [&str; 6] = ["dM", "dD", "dS", "dF", "dL", "dD0"];

/// Transfer functions as Python has them.
#[derive(IntoPyObject)]
pub struct Values<'py> {
    value: Bound<'py, PyAny>,
    route: &'static str,
    error: f64,
    singular: Vec<usize>,
    counts: Counts,
}

/// Their derivatives.
#[derive(IntoPyObject)]
pub struct Derivatives<'py> {
    value: Bound<'py, PyAny>,
    error: f64,
    singular: Vec<usize>,
    counts: Counts,
}

/// Motion of the outputs (n_out, n_t), with what the bulges of the loads add to it.
#[derive(IntoPyObject)]
pub struct Moved {
    displacement: Dense<f64>,
    displacement_error: Dense<f64>,
    velocity: Dense<f64>,
    velocity_error: Dense<f64>,
    acceleration: Dense<f64>,
    acceleration_error: Dense<f64>,
    route: &'static str,
    counts: Counts,
}

impl Moved {
    fn new(motion: Motion, route: &'static str) -> Self {
        let ([y, v, a], [dy, dv, da]) = (motion.y.map(Dense), motion.error.map(Dense));
        Moved {
            displacement: y,
            displacement_error: dy,
            velocity: v,
            velocity_error: dv,
            acceleration: a,
            acceleration_error: da,
            route,
            counts: motion.counts,
        }
    }
}

impl Maps<'_> {
    pub fn ports(self, order_out: u32) -> Ports {
        Ports { l: matrix(&self.0), f: matrix(&self.1), order_in: self.2, order_out, d0: self.3.as_ref().map(matrix) }
    }
}

impl Loads<'_> {
    fn history(&self) -> History {
        History { t: self.0.as_array().to_vec(), u: matrix(&self.1), bulge: matrix(&self.2) }
    }

    fn start(&self) -> (Vec<f64>, Vec<f64>) {
        (self.3.as_array().to_vec(), self.4.as_array().to_vec())
    }
}

impl Changes<'_> {
    /// What parameter p changes, in the order of `CHANGES`: None where it is all zero.
    fn slices(&self, n: usize, ports: &Ports, p: usize) -> Result<[Option<Mat<f64>>; 6]> {
        let all = [&self.1, &self.2, &self.3, &self.4, &self.5, &self.6];
        let mut out = [const { None }; 6];
        for ((out, name), a) in out.iter_mut().zip(CHANGES).zip(all) {
            *out = parameter_slice(name, a, shape(name, n, ports), self.0, p)?;
        }
        Ok(out)
    }
}

pub fn evaluate<'py>(
    py: Python<'py>,
    system: Arc<LinearSystem>,
    ports: Ports,
    omega: &Omega<'_>,
    modes: Option<usize>,
    checked: bool,
) -> PyResult<Values<'py>> {
    fits(&system)?;
    let omega: Vec<f64> = omega.as_array().to_vec();
    let shape = [ports.l.nrows(), ports.f.ncols(), omega.len()];
    values_fit("transfer functions", &shape)?;
    let found = interruptible(py, move |cancel| system.evaluate(&ports, &omega, modes, checked, cancel))?;
    Ok(Values {
        value: found.h.into_pyarray(py).reshape(shape)?.into_any(),
        route: found.route.name(),
        error: found.error,
        singular: found.singular,
        counts: found.counts,
    })
}

pub fn sensitivity<'py>(
    py: Python<'py>,
    system: Arc<LinearSystem>,
    ports: Ports,
    omega: &Omega<'_>,
    changes: &Changes<'_>,
) -> PyResult<Derivatives<'py>> {
    let omega: Vec<f64> = omega.as_array().to_vec();
    let one = |p| {
        let [dm, dd, ds, df, dl, dd0] = changes.slices(system.size(), &ports, p)?;
        Ok(Variation { entries: entries(dm, dd, ds), df, dl, dd0 })
    };
    let variations = (0..changes.0).map(one).collect::<Result<Vec<_>>>()?;
    let shape = [ports.l.nrows(), ports.f.ncols(), omega.len(), changes.0];
    values_fit("derivatives of transfer functions", &shape)?;
    let found = interruptible(py, move |cancel| {
        frf_sensitivity::sensitivity(system.quadratic(), &ports, &variations, &omega, cancel)
    })?;
    Ok(Derivatives {
        value: found.dh.into_pyarray(py).reshape(shape)?.into_any(),
        error: found.error,
        singular: found.singular,
        counts: found.counts,
    })
}

pub fn response(py: Python<'_>, system: Arc<LinearSystem>, ports: Ports, loads: Loads<'_>) -> PyResult<Moved> {
    fits(&system)?;
    let (history, (x0, v0)) = (loads.history(), loads.start());
    interruptible(py, move |cancel| {
        let linear = Linear::new(&system, &ports, &x0, &v0)?;
        Ok(Moved::new(linear.run(&history, cancel)?, linear.route))
    })
}

pub fn response_sensitivity(
    py: Python<'_>,
    system: Arc<LinearSystem>,
    ports: Ports,
    loads: Loads<'_>,
    changes: &Changes<'_>,
) -> PyResult<Vec<Moved>> {
    let (history, (x0, v0)) = (loads.history(), loads.start());
    let n = system.size();
    let one = |p| {
        let found = changes.slices(n, &ports, p)?;
        let full = |(a, name): (Option<Mat<f64>>, &str)| {
            let (rows, columns) = shape(name, n, &ports);
            a.unwrap_or_else(|| Mat::zeros(rows, columns))
        };
        let [dm, dd, ds, df, dl, dd0] = found;
        let [dm, dd, ds] = [(dm, "dM"), (dd, "dD"), (ds, "dS")].map(full);
        let [df, dl, dd0] = [(df, "dF"), (dl, "dL"), (dd0, "dD0")].map(full);
        Ok(response_sensitivity::Variation { dm, dd, ds, df, dl, dd0 })
    };
    let variations = (0..changes.0).map(one).collect::<Result<Vec<_>>>()?;
    let motions = interruptible(py, move |cancel| {
        response_sensitivity::sensitivities(&system, &ports, &variations, (&x0, &v0), &history, cancel)
    })?;
    Ok(motions.into_iter().map(|m| Moved::new(m, "block exponential")).collect())
}

/// Refuses a system whose expansion does not fit into memory.
pub fn fits(system: &LinearSystem) -> Result<()> {
    let n = system.size() as f64;
    let what = format!("a reduction of {n} coordinates");
    let squares = if system.given().is_undamped() { UNDAMPED_REDUCTION } else { REDUCTION };
    memory::require(
        8.0 * squares * n * n,
        &what,
        "give sparse matrices, which are solved frequency by frequency, or reduce the system to its lowest modes",
    )
}

/// Square matrices of a reduction with its checks: 36 to 43 measured at n = 300 to 600 without, 76 to 86 with damping.
const UNDAMPED_REDUCTION: f64 = 56.0;
const REDUCTION: f64 = 96.0;
/// Bytes of one value of a transfer function: it exists three times while it crosses to Python, and its size once.
const VALUE: f64 = 64.0;

/// Refuses results that do not fit; outputs, inputs, frequencies, parameters.
pub(super) fn values_fit(what: &str, shape: &[usize]) -> Result<()> {
    let count: f64 = shape.iter().map(|n| *n as f64).product();
    let sizes: Vec<String> = shape.iter().map(usize::to_string).collect();
    let what = format!("{what} of {} values (outputs x inputs x frequencies)", sizes.join(" x "));
    memory::require(VALUE * count, &what, "ask for fewer ports or frequencies at a time")
}

/// The shape of a derivative in `Changes`, without its last axis.
fn shape(name: &str, n: usize, ports: &Ports) -> (usize, usize) {
    let (n_out, n_in) = (ports.l.nrows(), ports.f.ncols());
    match name {
        "dF" => (n, n_in),
        "dL" => (n_out, n),
        "dD0" => (n_out, n_in),
        _ => (n, n),
    }
}

/// The derivative of one matrix along parameter p, or None where it is all zero.
fn parameter_slice(
    name: &str,
    a: &Option<M3<'_>>,
    shape: (usize, usize),
    n_p: usize,
    p: usize,
) -> Result<Option<Mat<f64>>> {
    let Some(a) = a else { return Ok(None) };
    let view = a.as_array();
    let (rows, cols) = shape;
    if view.shape() != [rows, cols, n_p] {
        return Err(Error::model(format!("{name} has shape {:?}; it must be ({rows}, {cols}, {n_p})", view.shape())));
    }
    let value = Mat::from_fn(rows, cols, |i, j| view[(i, j, p)]);
    if !crate::linalg::quadratic::is_finite(value.as_ref()) {
        return Err(Error::model(format!("{name} contains NaN or infinite entries")));
    }
    Ok((value.norm_max() > 0.0).then_some(value))
}

fn entries(dm: Option<Mat<f64>>, dd: Option<Mat<f64>>, ds: Option<Mat<f64>>) -> Vec<Entry> {
    let Some(first) = dm.as_ref().or(dd.as_ref()).or(ds.as_ref()) else {
        return Vec::new();
    };
    let n = first.nrows();
    let at = |a: &Option<Mat<f64>>, i, j| a.as_ref().map_or(0.0, |a: &Mat<f64>| a[(i, j)]);
    let mut entries = Vec::new();
    for row in 0..n {
        for col in 0..n {
            let (m, d, s) = (at(&dm, row, col), at(&dd, row, col), at(&ds, row, col));
            if m != 0.0 || d != 0.0 || s != 0.0 {
                entries.push(Entry { row, col, dm: m, dd: d, ds: s });
            }
        }
    }
    entries
}

// faer's complex number and NumPy's are the same type; a change in either must not compile
const _: fn(c64) -> Complex64 = |z| z;
