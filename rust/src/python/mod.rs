//! The border to Python: one registration function per group of analyses.
mod border;
mod hbm;
mod hbm_branch;
mod hbm_linear;

use pyo3::prelude::*;

#[pymodule]
fn _core(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    border::register(module)?;
    hbm::register(module)?;
    hbm_branch::register(module)
}
