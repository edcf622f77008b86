//! Arrays, errors, panics, callbacks and the interrupt: how everything crosses between Python and the core.
use std::any::Any;
use std::cell::RefCell;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::Arc;
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::time::Duration;

use faer::MatRef;
use numpy::ndarray::{Array2, ShapeBuilder};
use numpy::{Complex64, PyArray1, PyArray2, PyReadonlyArray2, PyUntypedArrayMethods};
use pyo3::create_exception;
use pyo3::exceptions::{PyException, PyKeyboardInterrupt};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::error::{Error, Result};
use crate::memory;
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
    module.add_function(wrap_pyfunction!(available_memory, module)?)?;
    module.add_function(wrap_pyfunction!(require_memory, module)?)
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
            Error::Interrupted => interrupt(),
        }
    }
}

/// What a function of the user raised, on its way out of the core.
struct Raised(PyErr);

/// Leaves the core with what a Python function raised. The calls in between have no use for it: they unwind, and the border raises
/// it again as it is, with type and traceback. (Unwinding without a panic: no message is printed.)
pub fn leave(raised: PyErr) -> ! {
    resume_unwind(Box::new(Raised(raised)))
}

#[cfg(panic = "abort")]
compile_error!("errors of Python functions and panics reach the border by unwinding; build with panic = \"unwind\"");

thread_local! {
    /// Tells the thread of a call whether the call has been cut.
    static OWN_CANCEL: RefCell<Option<Arc<Cancel>>> = const { RefCell::new(None) };
}

fn own_cancel() -> Option<Arc<Cancel>> {
    OWN_CANCEL.with_borrow(Option::clone)
}

/// Calls Python from within the core; what it raises leaves the core. No lock may be held here, since the function may call the
/// core again. The thread of a call that has been cut does not begin another call.
pub fn called<T>(call: impl FnOnce(Python<'_>) -> PyResult<T>) -> T {
    if own_cancel().is_some_and(|cancel| cancel.check().is_err()) {
        leave(interrupt());
    }
    match Python::attach(call) {
        Ok(value) => value,
        Err(raised) => leave(raised),
    }
}

fn interrupt() -> PyErr {
    PyKeyboardInterrupt::new_err("interrupted")
}

/// Short work: runs here without the GIL, a panic becomes an error.
pub fn guarded<T: Send>(py: Python<'_>, work: impl FnOnce() -> Result<T> + Send) -> PyResult<T> {
    let outcome = py.detach(|| catch_unwind(AssertUnwindSafe(work)));
    flatten(outcome)
}

/// How often a call that waits looks for Ctrl-C, and for how long work that was cut may hand over what it has: together less than
/// the fifth of a second within which Ctrl-C has to stop any call.
const LOOK: Duration = Duration::from_millis(40);
const HAND_OVER: Duration = Duration::from_millis(110);

/// A value whose type only the caller knows: workers are the same for all kinds of work, so that they are compiled once.
type Value = Box<dyn Any + Send>;
type Work = Box<dyn FnOnce(&Cancel) -> Result<Value> + Send>;
type Ended = std::thread::Result<Result<Value>>;

/// Work that may be long: runs on a thread of its own while this one looks for Ctrl-C. A faer call cannot be interrupted; the
/// thread then finishes by itself and its result is dropped, so all that it uses must be owned.
pub fn interruptible<T: Send + 'static>(
    py: Python<'_>,
    work: impl FnOnce(&Cancel) -> Result<T> + Send + 'static,
) -> PyResult<T> {
    Worker::start(erased(work))?.wait(py, &mut || Ok(())).map_err(|cut| cut.raised).and_then(typed)
}

/// The same for work that has something to give when it is cut: with its value comes whether Ctrl-C cut it. `look` is called beside
/// each look for Ctrl-C, to show progress.
pub fn interruptible_so_far<T: Send + 'static>(
    py: Python<'_>,
    work: impl FnOnce(&Cancel) -> Result<T> + Send + 'static,
    mut look: impl FnMut() -> PyResult<()>,
) -> PyResult<(T, bool)> {
    match Worker::start(erased(work))?.wait(py, &mut look) {
        Ok(value) => Ok((typed(value)?, false)),
        Err(cut) if cut.raised.is_instance_of::<PyKeyboardInterrupt>(py) => {
            match cut.worker.and_then(|worker| worker.handed_over(py)) {
                Some(value) => Ok((typed(value)?, true)),
                None => Err(cut.raised),
            }
        }
        Err(cut) => Err(cut.raised),
    }
}

fn erased<T: Send + 'static>(work: impl FnOnce(&Cancel) -> Result<T> + Send + 'static) -> Work {
    Box::new(move |cancel| work(cancel).map(|value| Box::new(value) as Value))
}

fn typed<T: 'static>(value: Value) -> PyResult<T> {
    let other = |_| CoreError::new_err("internal error, please report it: a worker returned a value of another type");
    value.downcast::<T>().map(|value| *value).map_err(other)
}

/// Why a call ended without a value: what was raised, and the worker where it still runs.
struct Cut {
    raised: PyErr,
    worker: Option<Worker>,
}

/// Work on a thread of its own, seen from the thread that waits for it.
struct Worker {
    cancel: Arc<Cancel>,
    receiver: Receiver<Ended>,
}

impl Worker {
    fn start(work: Work) -> PyResult<Self> {
        let cancel = Arc::new(Cancel::default());
        let (sender, receiver) = channel();
        let own = cancel.clone();
        std::thread::Builder::new()
            .stack_size(64 << 20)
            .spawn(move || {
                OWN_CANCEL.set(Some(own.clone()));
                let _ = sender.send(catch_unwind(AssertUnwindSafe(|| work(&own))));
            })
            .map_err(|e| {
                let text = "long work runs on a thread with a stack of 64 MB, which could not be started";
                CoreRouteError::new_err(format!("{text} ({e}); raise the limits of this process on memory and threads"))
            })?;
        Ok(Worker { cancel, receiver })
    }

    /// Waits without the GIL.
    fn receive(self, py: Python<'_>, time: Duration) -> (Self, std::result::Result<Ended, RecvTimeoutError>) {
        py.detach(move || {
            let outcome = self.receiver.recv_timeout(time);
            (self, outcome)
        })
    }

    fn wait(mut self, py: Python<'_>, look: &mut dyn FnMut() -> PyResult<()>) -> std::result::Result<Value, Cut> {
        // a call within a callback is cut together with the call that it belongs to
        let outer = own_cancel();
        loop {
            let outcome;
            (self, outcome) = self.receive(py, LOOK);
            let raised = match outcome {
                Ok(ended) => return flatten(ended).map_err(|raised| Cut { raised, worker: None }),
                Err(RecvTimeoutError::Disconnected) => CoreError::new_err("the worker thread ended without a result"),
                Err(RecvTimeoutError::Timeout) => {
                    let asked = outer.as_ref().map_or(Ok(()), |outer| outer.check().map_err(PyErr::from));
                    match py.check_signals().and(asked).and_then(|()| look()) {
                        Ok(()) => continue,
                        Err(raised) => raised,
                    }
                }
            };
            self.cancel.stop();
            return Err(Cut { raised, worker: Some(self) });
        }
    }

    /// What work that was cut gives within a moment.
    fn handed_over(self, py: Python<'_>) -> Option<Value> {
        match self.receive(py, HAND_OVER).1 {
            Ok(ended) => flatten(ended).ok(),
            Err(_) => None,
        }
    }
}

fn flatten<T>(outcome: std::thread::Result<Result<T>>) -> PyResult<T> {
    match outcome {
        Ok(Ok(value)) => Ok(value),
        Ok(Err(error)) => Err(error.into()),
        Err(unwound) => Err(match unwound.downcast::<Raised>() {
            Ok(raised) => raised.0,
            Err(panic) => {
                let text = panic.downcast_ref::<String>().map(String::as_str);
                let text = text.or_else(|| panic.downcast_ref::<&str>().copied()).unwrap_or_default();
                CoreError::new_err(format!("internal error, please report it: {text}"))
            }
        }),
    }
}

/// Bytes that can still be allocated.
#[pyfunction]
fn available_memory() -> f64 {
    memory::available()
}

/// Refuses `what`, which needs so many bytes, where it does not fit into memory.
#[pyfunction]
fn require_memory(bytes: f64, what: &str, remedy: &str) -> PyResult<()> {
    Ok(memory::require(bytes, what, remedy)?)
}

/// A NumPy matrix of any strides as a faer matrix, copied so that it outlives the GIL.
pub fn matrix(array: &PyReadonlyArray2<'_, f64>) -> faer::Mat<f64> {
    let view = array.as_array();
    faer::Mat::from_fn(view.nrows(), view.ncols(), |i, j| view[(i, j)])
}

/// A matrix that may be absent.
pub type Given<'py> = Option<PyReadonlyArray2<'py, f64>>;

pub fn optional(array: &Given<'_>) -> Option<faer::Mat<f64>> {
    array.as_ref().map(matrix)
}

/// Numbers that become a NumPy array (n,) in Python.
pub struct Vector<T>(pub Vec<T>);

impl<'py, T: numpy::Element> IntoPyObject<'py> for Vector<T> {
    type Target = PyArray1<T>;
    type Output = Bound<'py, PyArray1<T>>;
    type Error = std::convert::Infallible;

    fn into_pyobject(self, py: Python<'py>) -> std::result::Result<Self::Output, Self::Error> {
        Ok(PyArray1::from_vec(py, self.0))
    }
}

/// A matrix that becomes a NumPy array (rows, columns) in Python.
pub struct Dense<T>(pub faer::Mat<T>);

impl<'py, T: numpy::Element + Copy> IntoPyObject<'py> for Dense<T> {
    type Target = PyArray2<T>;
    type Output = Bound<'py, PyArray2<T>>;
    type Error = std::convert::Infallible;

    fn into_pyobject(self, py: Python<'py>) -> std::result::Result<Self::Output, Self::Error> {
        let m = &self.0;
        Ok(filled(py, m.nrows(), m.ncols(), |i, j| m[(i, j)]))
    }
}

/// Rows of one length that become a NumPy array (rows, columns) in Python.
pub struct Rows<T>(Vec<Vec<T>>);

impl<T> Rows<T> {
    pub fn new(rows: Vec<Vec<T>>) -> Result<Self> {
        if rows.windows(2).any(|pair| pair[0].len() != pair[1].len()) {
            return Err(Error::model("rows of different lengths are no array"));
        }
        Ok(Rows(rows))
    }
}

impl<'py, T: numpy::Element + Copy> IntoPyObject<'py> for Rows<T> {
    type Target = PyArray2<T>;
    type Output = Bound<'py, PyArray2<T>>;
    type Error = std::convert::Infallible;

    fn into_pyobject(self, py: Python<'py>) -> std::result::Result<Self::Output, Self::Error> {
        let rows = self.0;
        Ok(filled(py, rows.len(), rows.first().map_or(0, Vec::len), |i, j| rows[i][j]))
    }
}

impl<'py> IntoPyObject<'py> for Counts {
    type Target = PyDict;
    type Output = Bound<'py, PyDict>;
    type Error = PyErr;

    fn into_pyobject(self, py: Python<'py>) -> PyResult<Self::Output> {
        counts_dict(py, &self)
    }
}

/// A matrix whose memory goes to Python, column by column, without a copy.
pub fn moved(m: nalgebra::DMatrix<f64>) -> PyResult<Array2<f64>> {
    let shape = m.shape();
    Array2::from_shape_vec(shape.f(), m.data.into()).map_err(|e| Error::model(e.to_string()).into())
}

pub fn to_numpy<'py>(py: Python<'py>, m: MatRef<'_, f64>) -> Bound<'py, PyArray2<f64>> {
    filled(py, m.nrows(), m.ncols(), |i, j| m[(i, j)])
}

pub fn to_numpy_complex<'py>(py: Python<'py>, m: MatRef<'_, Complex64>) -> Bound<'py, PyArray2<Complex64>> {
    filled(py, m.nrows(), m.ncols(), |i, j| m[(i, j)])
}

fn filled<T: numpy::Element + Copy>(
    py: Python<'_>,
    rows: usize,
    columns: usize,
    value: impl Fn(usize, usize) -> T,
) -> Bound<'_, PyArray2<T>> {
    let array = PyArray2::<T>::zeros(py, [rows, columns], false);
    fill(&array, value);
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
