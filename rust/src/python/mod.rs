//! The border to Python: one registration function per group of analyses.
mod border;
mod frf;
mod hbm;
mod modal;
mod system;
mod tables;

use pyo3::prelude::*;

#[pymodule]
fn _core(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    border::register(module)?;
    frf::register(module)?;
    hbm::register(module)?;
    modal::register(module)?;
    system::register(module)
}
