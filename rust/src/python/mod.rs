//! The border to Python: one registration function per group of analyses.
mod aero;
mod border;
mod designs;
mod direction;
mod eigen_sensitivity;
mod expressions;
mod frf;
mod gradient;
mod hbm;
mod hbm_branch;
mod hbm_elements;
mod hbm_linear;
mod law_places;
mod modal;
mod model_work;
mod root;
mod second_order;
mod simulate;
mod sparse;
mod sparse_system;
mod strains;
mod system;
mod tables;

use pyo3::prelude::*;

#[pymodule]
fn _core(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    aero::register(module)?;
    border::register(module)?;
    designs::register(module)?;
    direction::register(module)?;
    eigen_sensitivity::register(module)?;
    expressions::register(module)?;
    frf::register(module)?;
    gradient::register(module)?;
    hbm::register(module)?;
    hbm_branch::register(module)?;
    hbm_elements::register(module)?;
    modal::register(module)?;
    root::register(module)?;
    second_order::register(module)?;
    simulate::register(module)?;
    sparse::register(module)?;
    sparse_system::register(module)?;
    system::register(module)?;
    Ok(())
}
