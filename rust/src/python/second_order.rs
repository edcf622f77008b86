//! The handle of a linear system: what linearisations and a user's matrices become, and what modes, transfer functions and responses
//! take.
use std::sync::Arc;

use faer::Mat;
use numpy::{Complex64, IntoPyArray, PyArray1, PyArray2, PyReadonlyArray2};
use pyo3::prelude::*;

use super::border::{Given, guarded, interruptible, optional, to_numpy};
use super::frf::{self, Changes, Loads, Maps, Moved, Omega};
use super::modal::{self, Modes};
use super::system::table;
use crate::error::Result;
use crate::linearize::stiffness_factor;
use crate::run::Counts;
use crate::second_order::linear_system::{LinearSystem, Matrices};
use crate::second_order::modal::{is_light, modes};

pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<PySecondOrder>()
}

/// Sizes from which on a solve may outlast what a user waits for Ctrl-C, and a thread of its own costs nothing in comparison.
pub(super) const LARGE: usize = 64;

type Square<'py> = Bound<'py, PyArray2<f64>>;

/// M, C, G, K, N.
type Parts<'py> =
    (Option<Square<'py>>, Option<Square<'py>>, Option<Square<'py>>, Option<Square<'py>>, Option<Square<'py>>);

/// A linear system and what has been derived from it so far.
#[pyclass(frozen, name = "SecondOrder", module = "mbrs._core")]
#[derive(Clone)]
pub struct PySecondOrder(pub Arc<LinearSystem>);

impl PySecondOrder {
    /// Work on the system: on a thread of its own where it may be long.
    pub(super) fn run<T: Send + 'static>(
        &self,
        py: Python<'_>,
        work: impl FnOnce(&LinearSystem) -> Result<T> + Send + 'static,
    ) -> PyResult<T> {
        let system = self.0.clone();
        if system.size() < LARGE {
            guarded(py, move || work(&system))
        } else {
            interruptible(py, move |_| work(&system))
        }
    }

    fn view<'py>(&self, py: Python<'py>, of: impl Fn(&Matrices) -> Option<&Mat<f64>>) -> Option<Square<'py>> {
        of(self.0.given()).map(|a| to_numpy(py, a.as_ref()))
    }
}

#[pymethods]
#[allow(non_snake_case)]
impl PySecondOrder {
    #[new]
    #[pyo3(signature = (m, c, g, k, n))]
    fn new(
        m: PyReadonlyArray2<'_, f64>,
        c: Given<'_>,
        g: Given<'_>,
        k: PyReadonlyArray2<'_, f64>,
        n: Given<'_>,
    ) -> PyResult<Self> {
        let parts = 2 + [&c, &g, &n].iter().filter(|part| part.is_some()).count();
        modal::holds(m.as_array().len(), parts)?;
        let [c, g, n] = [&c, &g, &n].map(optional);
        let given = Matrices { m: super::border::matrix(&m), c, g, k: super::border::matrix(&k), n };
        Ok(Self(Arc::new(LinearSystem::new(given)?)))
    }

    /// Made again from its matrices, without what was derived from them.
    fn __reduce__<'py>(&self, py: Python<'py>) -> (Bound<'py, PyAny>, Parts<'py>) {
        (py.get_type::<Self>().into_any(), (self.M(py), self.C(py), self.G(py), self.K(py), self.N(py)))
    }

    #[getter]
    fn size(&self) -> usize {
        self.0.size()
    }

    #[getter]
    fn M<'py>(&self, py: Python<'py>) -> Option<Square<'py>> {
        self.view(py, |a| Some(&a.m))
    }

    #[getter]
    fn C<'py>(&self, py: Python<'py>) -> Option<Square<'py>> {
        self.view(py, |a| a.c.as_ref())
    }

    #[getter]
    fn G<'py>(&self, py: Python<'py>) -> Option<Square<'py>> {
        self.view(py, |a| a.g.as_ref())
    }

    #[getter]
    fn K<'py>(&self, py: Python<'py>) -> Option<Square<'py>> {
        self.view(py, |a| Some(&a.k))
    }

    #[getter]
    fn N<'py>(&self, py: Python<'py>) -> Option<Square<'py>> {
        self.view(py, |a| a.n.as_ref())
    }

    /// True where light bodies may be lost in M beside heavy ones, so that modes need a factor of M.
    fn is_light(&self, py: Python<'_>) -> PyResult<bool> {
        modal::fits(&self.0)?;
        self.run(py, |system| Ok(is_light(&system.given().m)))
    }

    /// All modes. With a factor `kf` of K, or `mf` of M, they are computed anew from it, else once.
    #[pyo3(signature = (kf=None, mf=None))]
    fn modes(&self, py: Python<'_>, kf: Given<'_>, mf: Given<'_>) -> PyResult<Modes> {
        modal::fits(&self.0)?;
        let (kf, mf) = (optional(&kf), optional(&mf));
        if kf.is_none() && mf.is_none() {
            let (found, counts) = self.run(py, |system| {
                let mut counts = Counts::default();
                Ok((system.modes(&mut counts)?.clone(), counts))
            })?;
            return Ok(Modes::new(found, counts));
        }
        let found = self.run(py, move |system| {
            let system = system.second_order()?.with_stiffness_factor(kf)?;
            match mf {
                None => modes(&system),
                Some(mf) => modes(&system.with_mass_factor(mf)?),
            }
        })?;
        let counts = found.counts.clone();
        Ok(Modes::new(found, counts))
    }

    /// Does a column of `shape` (phi^T M phi = 1) strain a row of the stiffness factor by more than rounding?
    fn is_strained(&self, factor: PyReadonlyArray2<'_, f64>, shape: PyReadonlyArray2<'_, f64>) -> bool {
        let m = &self.0.given().m;
        let mass = nalgebra::DMatrix::from_fn(m.nrows(), m.ncols(), |i, j| m[(i, j)]);
        stiffness_factor::is_strained(&table(&factor), &table(&shape), &mass)
    }

    /// Poles in rad/s, or None where the mass matrix is not positive definite, and what it took to know them.
    fn poles<'py>(&self, py: Python<'py>) -> PyResult<(Option<Bound<'py, PyArray1<Complex64>>>, Counts)> {
        frf::fits(&self.0)?;
        let (poles, counts) = self.run(py, |system| {
            let mut counts = Counts::default();
            Ok((system.poles(&mut counts).map(|poles| poles.to_vec()), counts))
        })?;
        Ok((poles.map(|p| p.into_pyarray(py)), counts))
    }

    /// H (n_out, n_in, n_freq).
    #[pyo3(signature = (maps, order_out, omega, modes=None, checked=true))]
    fn evaluate<'py>(
        &self,
        py: Python<'py>,
        maps: Maps<'_>,
        order_out: u32,
        omega: Omega<'_>,
        modes: Option<usize>,
        checked: bool,
    ) -> PyResult<frf::Values<'py>> {
        frf::evaluate(py, self.0.clone(), maps.ports(order_out), &omega, modes, checked)
    }

    /// dH along parameters.
    fn sensitivity<'py>(
        &self,
        py: Python<'py>,
        maps: Maps<'_>,
        order_out: u32,
        omega: Omega<'_>,
        changes: Changes<'_>,
    ) -> PyResult<frf::Derivatives<'py>> {
        frf::sensitivity(py, self.0.clone(), maps.ports(order_out), &omega, &changes)
    }

    /// Motion of the outputs under loads that are linear between the times.
    fn response(&self, py: Python<'_>, maps: Maps<'_>, loads: Loads<'_>) -> PyResult<Moved> {
        frf::response(py, self.0.clone(), maps.ports(0), loads)
    }

    /// Derivative of the motion along parameters, one dict for each.
    fn response_sensitivity(
        &self,
        py: Python<'_>,
        maps: Maps<'_>,
        loads: Loads<'_>,
        changes: Changes<'_>,
    ) -> PyResult<Vec<Moved>> {
        frf::response_sensitivity(py, self.0.clone(), maps.ports(0), loads, &changes)
    }
}
