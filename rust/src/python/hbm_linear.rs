//! The linear part of harmonic balance for Python: full matrices, condensed by sparse factorisation, condensed by modes.
use std::sync::{Arc, Mutex};

use faer::Mat;
use numpy::{Complex64, PyReadonlyArray1, PyReadonlyArray2};
use pyo3::prelude::*;

use super::border::{interruptible, matrix};
use super::hbm::lock;
use super::second_order::PySecondOrder;
use crate::error::Error;
use crate::periodic::condensed::{Condensed, Entry, Split};
use crate::periodic::linear::{DynamicStiffness, Forces, Full};
use crate::periodic::modal::{Modal, Modes};

/// A dynamic stiffness with the forces of all terms, (n_terms + 1, n) complex.
#[pyclass(frozen)]
pub struct HbmLinear(pub Mutex<Box<dyn DynamicStiffness>>);

fn rows(m: &Mat<f64>) -> Vec<f64> {
    (0..m.nrows() * m.ncols()).map(|i| m[(i / m.ncols(), i % m.ncols())]).collect()
}

fn terms(forces: &PyReadonlyArray2<'_, Complex64>) -> Forces {
    let row = |f: numpy::ndarray::ArrayView1<'_, Complex64>| f.iter().any(|x| x.norm() > 0.0).then(|| f.to_vec());
    Arc::new(forces.as_array().outer_iter().map(row).collect())
}

fn of_size(what: &str, found: usize, expected: usize) -> PyResult<()> {
    if found == expected {
        Ok(())
    } else {
        Err(Error::model(format!("{what} has the length {found} instead of {expected}")).into())
    }
}

#[pymethods]
impl HbmLinear {
    /// Nothing condensed.
    #[staticmethod]
    fn full(system: &PySecondOrder, forces: PyReadonlyArray2<'_, Complex64>) -> PyResult<Self> {
        let q = system.0.quadratic();
        let n = q.n();
        of_size("the force", forces.as_array().ncols(), n)?;
        let c = q.d.as_ref().map_or_else(|| vec![0.0; n * n], rows);
        Ok(Self(Mutex::new(Box::new(Full { n, m: rows(&q.m), c, k: rows(&q.s), forces: terms(&forces) }))))
    }

    /// Entries (row, column, m, c, k) without repetition; `retained` coordinates, to which free ones are added.
    #[staticmethod]
    #[expect(clippy::too_many_arguments)]
    fn sparse(
        py: Python<'_>,
        n: usize,
        row: Vec<usize>,
        column: Vec<usize>,
        m: Vec<f64>,
        c: Vec<f64>,
        k: Vec<f64>,
        retained: Vec<usize>,
        forces: PyReadonlyArray2<'_, Complex64>,
    ) -> PyResult<Self> {
        for length in [column.len(), m.len(), c.len(), k.len()] {
            of_size("a column of entries", length, row.len())?;
        }
        of_size("the force", forces.as_array().ncols(), n)?;
        if row.iter().chain(&column).chain(&retained).any(|i| *i >= n) {
            return Err(Error::model("an entry lies outside the matrix").into());
        }
        let entry = |i: usize| Entry { row: row[i], column: column[i], m: m[i], c: c[i], k: k[i] };
        let entries: Vec<Entry> = (0..row.len()).map(entry).collect();
        let forces = terms(&forces);
        let condensed =
            interruptible(py, move |_| Condensed::new(Arc::new(Split::new(n, &entries, retained, forces)?)))?;
        Ok(Self(Mutex::new(Box::new(condensed))))
    }

    /// All modes of the local coordinates with the retained ones held; `rr`, `lr` are triples of M, C, K parts;
    /// `matrices` are M, C, K themselves if stability is to be told.
    #[staticmethod]
    #[expect(clippy::too_many_arguments)]
    fn modal(
        py: Python<'_>,
        retained: Vec<usize>,
        local: Vec<usize>,
        rr: [PyReadonlyArray2<'_, f64>; 3],
        lr: [PyReadonlyArray2<'_, f64>; 3],
        stiffness: PyReadonlyArray1<'_, f64>,
        damping: PyReadonlyArray1<'_, f64>,
        shape: PyReadonlyArray2<'_, f64>,
        forces: PyReadonlyArray2<'_, Complex64>,
        matrices: Option<[PyReadonlyArray2<'_, f64>; 3]>,
    ) -> PyResult<Self> {
        let (n_r, n_l) = (retained.len(), local.len());
        let [rr, lr] = [rr, lr].map(|parts| parts.map(|p| rows(&matrix(&p))));
        for (part, other) in rr.iter().zip(&lr) {
            of_size("a retained block", part.len(), n_r * n_r)?;
            of_size("a coupling block", other.len(), n_l * n_r)?;
        }
        let shape = matrix(&shape);
        of_size("the modes", shape.nrows() * shape.ncols(), n_l * n_l)?;
        of_size("the force", forces.as_array().ncols(), n_r + n_l)?;
        let (stiffness, damping) = (stiffness.as_slice()?.to_vec(), damping.as_slice()?.to_vec());
        of_size("the modal stiffness", stiffness.len(), n_l)?;
        of_size("the modal damping", damping.len(), n_l)?;
        if !retained.is_sorted() || retained.iter().chain(&local).any(|i| *i >= n_r + n_l) {
            return Err(Error::model("retained coordinates must ascend").into());
        }
        let forces = terms(&forces);
        let modal_forces = Vec::new();
        let matrices = matrices.map(|parts| parts.map(|p| matrix(&p)).into());
        let n = n_r + n_l;
        let mut modes = Modes { n, retained, local, rr, lr, stiffness, damping, shape, forces, matrices, modal_forces };
        let modes = interruptible(py, move |_| {
            modes.project_forces();
            Ok(modes)
        })?;
        Ok(Self(Mutex::new(Box::new(Modal(Arc::new(modes))))))
    }

    /// Retained coordinates, by their numbers in the system.
    #[getter]
    fn retained(&self) -> Vec<usize> {
        lock(&self.0).retained()
    }

    /// Where the factors are those of a band, several frequencies at once.
    #[getter]
    fn half_bandwidth(&self) -> Option<usize> {
        lock(&self.0).half_bandwidth()
    }

    /// About as many complex products does it take to evaluate so many terms once.
    fn products(&self, terms: usize) -> f64 {
        lock(&self.0).products(terms)
    }

    /// Number of retained coordinates.
    #[getter]
    fn size(&self) -> usize {
        lock(&self.0).size()
    }
}
