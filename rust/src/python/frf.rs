//! Transfer functions and time response at the border.
use std::sync::Arc;

use faer::{Mat, c64};
use numpy::{
    Complex64, IntoPyArray, PyArray1, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2, PyReadonlyArray3,
    PyUntypedArrayMethods,
};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use super::border::{counts_dict, interruptible, matrix, to_numpy};
use crate::error::{Error, Result};
use crate::linalg::quadratic::Quadratic;
use crate::memory;
use crate::second_order::frf::Reduction;
use crate::second_order::frf_resonances;
use crate::second_order::frf_sensitivity;
use crate::second_order::frf_sensitivity::Entry;
use crate::second_order::frf_sensitivity::Variation;
use crate::second_order::history::History;
use crate::second_order::ports::Ports;
use crate::second_order::response;
use crate::second_order::response::Linear;
use crate::second_order::response_sensitivity;

pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(resonances, module)?)?;
    module.add_function(wrap_pyfunction!(unseen_resonances, module)?)?;
    module.add_function(wrap_pyfunction!(missed_resonances, module)?)?;
    module.add_class::<FrfReduction>()
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

/// What does not depend on frequency or ports: reduced once, used for any number of evaluations.
#[pyclass(frozen, module = "mbrs._core")]
pub struct FrfReduction {
    inner: Arc<Reduction>,
}

#[pymethods]
impl FrfReduction {
    #[new]
    #[pyo3(signature = (m, d, s))]
    fn new(py: Python<'_>, m: M2<'_>, d: Option<M2<'_>>, s: M2<'_>) -> PyResult<Self> {
        let n = m.shape()[0] as f64;
        memory::require(
            8.0 * REDUCTION * n * n,
            &format!("a reduction of {n} coordinates"),
            "reduce the system to its lowest modes",
        )?;
        let (m, d, s) = (matrix(&m), d.map(|d| matrix(&d)), matrix(&s));
        let inner = interruptible(py, move |_| Reduction::new(Quadratic::new(m, d, s)?))?;
        Ok(FrfReduction { inner: Arc::new(inner) })
    }

    /// Poles in rad/s, or None where the mass matrix is not positive definite.
    #[getter]
    fn poles<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyArray1<Complex64>>> {
        self.inner.poles().map(|p| p.into_pyarray(py))
    }

    #[getter]
    fn counts<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        counts_dict(py, &self.inner.counts)
    }

    #[pyo3(signature = (l, f, order_in, d0, order_out, omega, modes=None, checked=true))]
    #[allow(clippy::too_many_arguments)]
    fn evaluate<'py>(
        &self,
        py: Python<'py>,
        l: M2<'_>,
        f: M2<'_>,
        order_in: Vec<u32>,
        d0: Option<M2<'_>>,
        order_out: u32,
        omega: PyReadonlyArray1<'_, f64>,
        modes: Option<usize>,
        checked: bool,
    ) -> PyResult<Bound<'py, PyDict>> {
        let ports = ports(&l, &f, order_in, d0.as_ref(), order_out);
        let omega: Vec<f64> = omega.as_array().to_vec();
        let shape = [ports.l.nrows(), ports.f.ncols(), omega.len()];
        values_fit("transfer functions", &shape)?;
        let inner = self.inner.clone();
        let values = interruptible(py, move |cancel| inner.evaluate(&ports, &omega, modes, checked, cancel))?;
        let out = PyDict::new(py);
        out.set_item("value", values.h.into_pyarray(py).reshape(shape)?)?;
        out.set_item("route", values.route.name())?;
        out.set_item("error", values.error)?;
        out.set_item("singular", values.singular)?;
        out.set_item("counts", counts_dict(py, &values.counts)?)?;
        Ok(out)
    }

    /// dH along parameters; matrices (n, n, n_p) and the like, or None where nothing changes.
    #[pyo3(signature = (l, f, order_in, d0, order_out, omega, n_p, dm, dd, ds, df, dl, dd0))]
    #[allow(clippy::too_many_arguments)]
    fn sensitivity<'py>(
        &self,
        py: Python<'py>,
        l: M2<'_>,
        f: M2<'_>,
        order_in: Vec<u32>,
        d0: Option<M2<'_>>,
        order_out: u32,
        omega: PyReadonlyArray1<'_, f64>,
        n_p: usize,
        dm: Option<M3<'_>>,
        dd: Option<M3<'_>>,
        ds: Option<M3<'_>>,
        df: Option<M3<'_>>,
        dl: Option<M3<'_>>,
        dd0: Option<M3<'_>>,
    ) -> PyResult<Bound<'py, PyDict>> {
        let ports = ports(&l, &f, order_in, d0.as_ref(), order_out);
        let omega: Vec<f64> = omega.as_array().to_vec();
        let n = self.inner.q.n();
        let shapes = shapes(n, &ports);
        let variations = (0..n_p)
            .map(|p| {
                let slice = |name, a: &Option<M3<'_>>| parameter_slice(name, a, shapes(name), n_p, p);
                Ok(Variation {
                    entries: entries(slice("dM", &dm)?, slice("dD", &dd)?, slice("dS", &ds)?),
                    df: slice("dF", &df)?,
                    dl: slice("dL", &dl)?,
                    dd0: slice("dD0", &dd0)?,
                })
            })
            .collect::<Result<Vec<_>>>()?;
        let shape = [ports.l.nrows(), ports.f.ncols(), omega.len(), n_p];
        values_fit("derivatives of transfer functions", &shape)?;
        let inner = self.inner.clone();
        let values = interruptible(py, move |cancel| {
            frf_sensitivity::sensitivity(&inner.q, &ports, &variations, &omega, cancel)
        })?;
        let out = PyDict::new(py);
        out.set_item("value", values.dh.into_pyarray(py).reshape(shape)?)?;
        out.set_item("error", values.error)?;
        out.set_item("singular", values.singular)?;
        out.set_item("counts", counts_dict(py, &values.counts)?)?;
        Ok(out)
    }

    /// Motion of the outputs under loads u (n_in, n_t), linear between the times t.
    #[pyo3(signature = (l, f, order_in, d0, t, u, bulge, x0, v0))]
    #[allow(clippy::too_many_arguments)]
    fn response<'py>(
        &self,
        py: Python<'py>,
        l: M2<'_>,
        f: M2<'_>,
        order_in: Vec<u32>,
        d0: Option<M2<'_>>,
        t: PyReadonlyArray1<'_, f64>,
        u: M2<'_>,
        bulge: M2<'_>,
        x0: PyReadonlyArray1<'_, f64>,
        v0: PyReadonlyArray1<'_, f64>,
    ) -> PyResult<Bound<'py, PyDict>> {
        let ports = ports(&l, &f, order_in, d0.as_ref(), 0);
        let history = history(&t, &u, &bulge);
        let (x0, v0) = (x0.as_array().to_vec(), v0.as_array().to_vec());
        let inner = self.inner.clone();
        let (motion, route) = interruptible(py, move |cancel| {
            let linear = Linear::new(&inner, &ports, &x0, &v0)?;
            Ok((linear.run(&history, cancel)?, linear.route))
        })?;
        let out = motion_dict(py, &motion)?;
        out.set_item("route", route)?;
        Ok(out)
    }

    /// Derivative of the motion along parameters, one dict per parameter.
    #[pyo3(signature = (l, f, order_in, d0, t, u, bulge, x0, v0, n_p, dm, dd, ds, df, dl, dd0))]
    #[allow(clippy::too_many_arguments)]
    fn response_sensitivity<'py>(
        &self,
        py: Python<'py>,
        l: M2<'_>,
        f: M2<'_>,
        order_in: Vec<u32>,
        d0: Option<M2<'_>>,
        t: PyReadonlyArray1<'_, f64>,
        u: M2<'_>,
        bulge: M2<'_>,
        x0: PyReadonlyArray1<'_, f64>,
        v0: PyReadonlyArray1<'_, f64>,
        n_p: usize,
        dm: Option<M3<'_>>,
        dd: Option<M3<'_>>,
        ds: Option<M3<'_>>,
        df: Option<M3<'_>>,
        dl: Option<M3<'_>>,
        dd0: Option<M3<'_>>,
    ) -> PyResult<Vec<Bound<'py, PyDict>>> {
        let ports = ports(&l, &f, order_in, d0.as_ref(), 0);
        let history = history(&t, &u, &bulge);
        let (x0, v0) = (x0.as_array().to_vec(), v0.as_array().to_vec());
        let shapes = shapes(self.inner.q.n(), &ports);
        let changes = (0..n_p)
            .map(|p| {
                let slice = |name: &'static str, a: &Option<M3<'_>>| -> Result<Mat<f64>> {
                    let (rows, cols) = shapes(name);
                    let value = parameter_slice(name, a, (rows, cols), n_p, p)?;
                    Ok(value.unwrap_or_else(|| Mat::zeros(rows, cols)))
                };
                Ok(response_sensitivity::Variation {
                    dm: slice("dM", &dm)?,
                    dd: slice("dD", &dd)?,
                    ds: slice("dS", &ds)?,
                    df: slice("dF", &df)?,
                    dl: slice("dL", &dl)?,
                    dd0: slice("dD0", &dd0)?,
                })
            })
            .collect::<Result<Vec<_>>>()?;
        let inner = self.inner.clone();
        let motions = interruptible(py, move |cancel| {
            response_sensitivity::sensitivities(&inner, &ports, &changes, (&x0, &v0), &history, cancel)
        })?;
        motions.iter().map(|m| motion_dict(py, m)).collect()
    }
}

/// Square matrices of a reduction, 48 measured at n = 400 with the linearisation, and bytes of one value of a transfer function: it
/// exists three times while it crosses to Python, and its size once.
const REDUCTION: f64 = 56.0;
const VALUE: f64 = 64.0;

/// Refuses results that do not fit; outputs, inputs, frequencies, parameters.
pub(super) fn values_fit(what: &str, shape: &[usize]) -> Result<()> {
    let count: f64 = shape.iter().map(|n| *n as f64).product();
    let sizes: Vec<String> = shape.iter().map(usize::to_string).collect();
    let what = format!("{what} of {} values (outputs x inputs x frequencies)", sizes.join(" x "));
    memory::require(VALUE * count, &what, "ask for fewer ports or frequencies at a time")
}

fn motion_dict<'py>(py: Python<'py>, motion: &response::Motion) -> PyResult<Bound<'py, PyDict>> {
    let out = PyDict::new(py);
    for (q, name) in ["displacement", "velocity", "acceleration"].iter().enumerate() {
        out.set_item(*name, to_numpy(py, motion.y[q].as_ref()))?;
        out.set_item(format!("{name}_error"), to_numpy(py, motion.error[q].as_ref()))?;
    }
    out.set_item("counts", counts_dict(py, &motion.counts)?)?;
    Ok(out)
}

fn ports(l: &M2<'_>, f: &M2<'_>, order_in: Vec<u32>, d0: Option<&M2<'_>>, order_out: u32) -> Ports {
    Ports { l: matrix(l), f: matrix(f), order_in, order_out, d0: d0.map(matrix) }
}

fn history(t: &PyReadonlyArray1<'_, f64>, u: &M2<'_>, bulge: &M2<'_>) -> History {
    History { t: t.as_array().to_vec(), u: matrix(u), bulge: matrix(bulge) }
}

fn shapes(n: usize, ports: &Ports) -> impl Fn(&str) -> (usize, usize) + use<> {
    let (n_out, n_in) = (ports.l.nrows(), ports.f.ncols());
    move |name| match name {
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
