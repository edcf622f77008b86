//! The border to Python: one registration function per group of analyses.
mod border;
mod system;
mod tables;
mod modal;
mod frf;
mod hbm;

use pyo3::prelude::*;

#[pymodule]
fn _core(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    border::register(module)?;
    system::register(module)
    modal::register(module)
    frf::register(module)?;
    border::register(module)
    hbm::register(module)
}
