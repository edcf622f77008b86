//! Arrays, errors, panics and the interrupt: how everything crosses between Python and the core.
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use faer::MatRef;
use numpy::{Complex64, PyArray2, PyReadonlyArray2, PyUntypedArrayMethods};
use pyo3::create_exception;
use pyo3::exceptions::{PyException, PyKeyboardInterrupt};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::error::{Error, Result};
use crate::run::{Cancel, Counts};

create_exception!(_core, CoreError, PyException, "Base of the errors that the core raises; mbrs.errors maps them.");
create_exception!(_core, CoreModelError, CoreError);
create_exception!(_core, CoreRouteError, CoreModelError);
create_exception!(_core, CoreAssemblyError, CoreError);
create_exception!(_core, CoreSingularError, CoreError);
create_exception!(_core, CoreConvergenceError, CoreError);
create_exception!(_core, CoreNotDifferentiableError, CoreError);

pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    let py = module.py();
    module.add("CoreError", py.get_type::<CoreError>())?;
    module.add("CoreModelError", py.get_type::<CoreModelError>())?;
    module.add("CoreRouteError", py.get_type::<CoreRouteError>())?;
    module.add("CoreAssemblyError", py.get_type::<CoreAssemblyError>())?;
    module.add("CoreSingularError", py.get_type::<CoreSingularError>())?;
    module.add("CoreConvergenceError", py.get_type::<CoreConvergenceError>())?;
    module.add("CoreNotDifferentiableError", py.get_type::<CoreNotDifferentiableError>())?;
    Ok(())
}

impl From<Error> for PyErr {
    fn from(error: Error) -> PyErr {
        let text = error.to_string();
        match error {
            Error::Model(_) => CoreModelError::new_err(text),
            Error::Route(_) => CoreRouteError::new_err(text),
            Error::Assembly(_) => CoreAssemblyError::new_err(text),
            Error::Singular(_) => CoreSingularError::new_err(text),
            Error::Convergence { best, residual, .. } => CoreConvergenceError::new_err((text, best, residual)),
            Error::NotDifferentiable(_) => CoreNotDifferentiableError::new_err(text),
            Error::Interrupted => PyKeyboardInterrupt::new_err("interrupted"),
        }
    }
}

/// Short work: runs here without the GIL, a panic becomes an error.
pub fn guarded<T: Send>(py: Python<'_>, work: impl FnOnce() -> Result<T> + Send) -> PyResult<T> {
    let outcome = py.detach(|| catch_unwind(AssertUnwindSafe(work)));
    flatten(outcome)
}

/// Work that may be long: runs on a thread of its own while this one looks for Ctrl-C every 50 ms. A faer call cannot be
/// interrupted; the thread then finishes by itself and its result is dropped, so all that it uses must be owned.
pub fn interruptible<T: Send + 'static>(
    py: Python<'_>,
    work: impl FnOnce(&Cancel) -> Result<T> + Send + 'static,
) -> PyResult<T> {
    let cancel = std::sync::Arc::new(Cancel::default());
    let (sender, receiver) = channel();
    let receiver = Mutex::new(receiver); // a receiver alone may not be shared with a section that has released the GIL
    let flag = cancel.clone();
    std::thread::Builder::new()
        .stack_size(64 << 20)
        .spawn(move || {
            let _ = sender.send(catch_unwind(AssertUnwindSafe(|| work(&flag))));
        })
        .map_err(|e| CoreError::new_err(format!("no thread could be started: {e}")))?;
    loop {
        let outcome = py.detach(|| lock(&receiver).recv_timeout(Duration::from_millis(50)));
        match outcome {
            Ok(outcome) => return flatten(outcome),
            Err(RecvTimeoutError::Timeout) => {
                if let Err(interrupt) = py.check_signals() {
                    cancel.stop();
                    return Err(interrupt);
                }
            }
            Err(RecvTimeoutError::Disconnected) => {
                return Err(CoreError::new_err("the worker thread ended without a result"));
            }
        }
    }
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

fn flatten<T>(outcome: std::thread::Result<Result<T>>) -> PyResult<T> {
    match outcome {
        Ok(Ok(value)) => Ok(value),
        Ok(Err(error)) => Err(error.into()),
        Err(panic) => {
            let text = panic
                .downcast_ref::<String>()
                .cloned()
                .or_else(|| panic.downcast_ref::<&str>().map(|s| (*s).to_string()))
                .unwrap_or_default();
            Err(CoreError::new_err(format!("internal error, please report it: {text}")))
        }
    }
}

/// A NumPy matrix of any strides as a faer matrix, copied so that it outlives the GIL.
pub fn matrix(array: &PyReadonlyArray2<'_, f64>) -> faer::Mat<f64> {
    let view = array.as_array();
    faer::Mat::from_fn(view.nrows(), view.ncols(), |i, j| view[(i, j)])
}

pub fn to_numpy<'py>(py: Python<'py>, m: MatRef<'_, f64>) -> Bound<'py, PyArray2<f64>> {
    let rows = m.nrows();
    let array = PyArray2::<f64>::zeros(py, [rows, m.ncols()], false);
    fill(&array, |i, j| m[(i, j)]);
    array
}

pub fn to_numpy_complex<'py>(py: Python<'py>, m: MatRef<'_, Complex64>) -> Bound<'py, PyArray2<Complex64>> {
    let array = PyArray2::<Complex64>::zeros(py, [m.nrows(), m.ncols()], false);
    fill(&array, |i, j| m[(i, j)]);
    array
}

fn fill<T: numpy::Element + Copy>(array: &Bound<'_, PyArray2<T>>, value: impl Fn(usize, usize) -> T) {
    let [rows, cols] = [array.shape()[0], array.shape()[1]];
    // a new array is writable, contiguous and not shared yet
    let slice = unsafe { numpy::PyArrayMethods::as_slice_mut(array) };
    if let Ok(slice) = slice {
        for i in 0..rows {
            for j in 0..cols {
                slice[i * cols + j] = value(i, j);
            }
        }
    }
}

pub fn counts_dict<'py>(py: Python<'py>, counts: &Counts) -> PyResult<Bound<'py, PyDict>> {
    let dict = PyDict::new(py);
    for (what, n) in &counts.0 {
        dict.set_item(*what, *n)?;
    }
    Ok(dict)
}
