//! The border to Python: one registration function per group of analyses.
mod border;
mod eigen_sensitivity;
mod modal;

use pyo3::prelude::*;

#[pymodule]
fn _core(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    border::register(module)?;
    modal::register(module)?;
    eigen_sensitivity::register(module)
}
