//! Derivatives of eigenvalues and shapes of dense systems.
use faer::Mat;
use numpy::{Complex64, PyArray3, PyReadonlyArray1, PyReadonlyArray2};
use pyo3::prelude::*;

use super::border::{Dense, guarded, interruptible};
use super::second_order::{LARGE, PySecondOrder};
use crate::error::Result;
use crate::run::Counts;
use crate::second_order::eigen_sensitivity::{Directions, Known, Slices, eigen_sensitivity, shape_derivatives};

pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(eigen_sensitivities, module)?)?;
    module.add_function(wrap_pyfunction!(shape_sensitivities, module)?)
}

/// Eigenvalues, shapes, left vectors, rigid, near-defective, groups.
#[derive(FromPyObject)]
struct Modes<'py>(
    PyReadonlyArray1<'py, Complex64>,
    PyReadonlyArray2<'py, Complex64>,
    Option<PyReadonlyArray2<'py, Complex64>>,
    Vec<bool>,
    Vec<bool>,
    Vec<(usize, usize)>,
);

impl Modes<'_> {
    fn known(&self) -> Known {
        Known {
            s: self.0.as_array().to_vec(),
            x: complex_matrix(&self.1),
            y: self.2.as_ref().map(complex_matrix),
            rigid: self.3.clone(),
            near_defective: self.4.clone(),
            groups: self.5.clone(),
        }
    }
}

/// Rows, columns, directions and values of the entries of one derivative.
#[derive(FromPyObject)]
struct Entries<'py>(
    PyReadonlyArray1<'py, i64>,
    PyReadonlyArray1<'py, i64>,
    PyReadonlyArray1<'py, i64>,
    PyReadonlyArray1<'py, f64>,
);

impl Entries<'_> {
    fn slices(&self, n: usize, count: usize) -> Result<Slices> {
        Slices::new(
            &self.0.as_array().to_vec(),
            &self.1.as_array().to_vec(),
            &self.2.as_array().to_vec(),
            &self.3.as_array().to_vec(),
            n,
            count,
        )
    }
}

/// Derivatives of mass, velocity and position matrix, and the number of directions.
#[derive(FromPyObject)]
struct Changes<'py>(Entries<'py>, Entries<'py>, Entries<'py>, usize);

impl Changes<'_> {
    fn directions(&self, n: usize) -> Result<Directions> {
        let count = self.3;
        Ok(Directions::new(self.0.slices(n, count)?, self.1.slices(n, count)?, self.2.slices(n, count)?, count))
    }
}

fn complex_matrix(array: &PyReadonlyArray2<'_, Complex64>) -> Mat<Complex64> {
    let view = array.as_array();
    Mat::from_fn(view.nrows(), view.ncols(), |i, j| view[(i, j)])
}

/// Derivatives of the roots, and the matrices of the groups of equal ones.
#[derive(IntoPyObject)]
struct Roots<'py> {
    eigenvalue: Dense<Complex64>,
    groups: Vec<Bound<'py, PyArray3<Complex64>>>,
}

/// Derivatives of the shapes.
#[derive(IntoPyObject)]
struct Shapes<'py> {
    shape: Bound<'py, PyArray3<Complex64>>,
    counts: Counts,
}

#[pyfunction]
fn eigen_sensitivities<'py>(
    py: Python<'py>,
    system: PyRef<'py, PySecondOrder>,
    modes: Modes<'py>,
    changes: Changes<'py>,
) -> PyResult<Roots<'py>> {
    let system = system.0.second_order()?;
    let known = modes.known();
    let directions = changes.directions(system.size())?;
    let large = system.size() >= LARGE;
    let work = move || eigen_sensitivity(&system, &known, &directions);
    let result = if large { interruptible(py, move |_| work())? } else { guarded(py, work)? };
    let groups = result.groups.iter().map(|group| stacked(py, group)).collect();
    Ok(Roots { eigenvalue: Dense(result.eigenvalue), groups })
}

#[pyfunction]
fn shape_sensitivities<'py>(
    py: Python<'py>,
    system: PyRef<'py, PySecondOrder>,
    modes: Modes<'py>,
    changes: Changes<'py>,
    ds: PyReadonlyArray2<'py, Complex64>,
) -> PyResult<Shapes<'py>> {
    let system = system.0.second_order()?;
    let known = modes.known();
    let directions = changes.directions(system.size())?;
    let ds = complex_matrix(&ds);
    let large = system.size() >= LARGE;
    let work = move |cancel: &crate::run::Cancel| {
        let mut counts = Counts::default();
        let shapes = shape_derivatives(&system, &known, &directions, &ds, &mut counts, cancel)?;
        Ok((shapes, counts))
    };
    let (shapes, counts) =
        if large { interruptible(py, work)? } else { guarded(py, || work(&crate::run::Cancel::default()))? };
    Ok(Shapes { shape: stacked(py, &shapes), counts })
}

/// Matrices of one size as an array whose first axis counts them.
fn stacked<'py>(py: Python<'py>, matrices: &[Mat<Complex64>]) -> Bound<'py, PyArray3<Complex64>> {
    let (rows, columns) = matrices.first().map_or((0, 0), |m| (m.nrows(), m.ncols()));
    let array = numpy::ndarray::Array3::from_shape_fn((matrices.len(), rows, columns), |(k, i, j)| matrices[k][(i, j)]);
    PyArray3::from_owned_array(py, array)
}
