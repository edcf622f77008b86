//! The border to Python: one registration function per group of analyses.
mod border;
mod frf;
mod sparse;

use pyo3::prelude::*;

#[pymodule]
fn _core(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    frf::register(module)?;
    sparse::register(module)?;
    border::register(module)
}
