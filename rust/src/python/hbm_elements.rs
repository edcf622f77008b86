//! The elements of harmonic balance for Python: laws of the core, and functions that are traced or called.
use std::sync::Arc;

use numpy::{PyArray1, PyArrayMethods, PyReadonlyArray1, PyReadonlyArrayDyn};
use pyo3::prelude::*;

use super::border::called;
use super::expressions::program;
use crate::error::{Error, Result};
use crate::force::{AnyLaw, FunctionLaw};
use crate::periodic::element::{Element, Force, ForceSlopes, Sampled};

pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(law_force, module)?)?;
    module.add_function(wrap_pyfunction!(law_relaxations, module)?)?;
    module.add_function(wrap_pyfunction!(law_at_rest, module)?)?;
    module.add_class::<HbmElements>()
}

/// Force of one law along a history of displacements and rates, sliders centred at its start. A state by rate rests at every sample.
#[pyfunction]
fn law_force<'py>(
    py: Python<'py>,
    code: i64,
    values: Vec<f64>,
    u: PyReadonlyArray1<'_, f64>,
    v: PyReadonlyArray1<'_, f64>,
) -> PyResult<Bound<'py, PyArray1<f64>>> {
    let law = AnyLaw::from_code(code, values.len())?;
    let (u, v) = (u.as_array(), v.as_array());
    let mut memory = vec![0.0; law.n_memory()];
    let force = |(u, v): (&f64, &f64)| {
        if law.has_rates() {
            memory = law.rest_memory();
        }
        law.eval(*u, *v, &values, &mut memory)
    };
    let force = u.iter().zip(v.iter()).map(force).collect();
    Ok(PyArray1::from_vec(py, force))
}

/// (k, rate) of each state that relaxes about rest at u: there the law is k s / (s + rate) beside its slope at rest.
#[pyfunction]
fn law_relaxations(code: i64, values: Vec<f64>, u: f64) -> PyResult<Vec<(f64, f64)>> {
    let law = AnyLaw::from_code(code, values.len())?;
    Ok(law.relaxations(u, &values).into_iter().map(|r| (r.k, r.rate)).collect())
}

/// The states of a law that rests at u with what it remembers ("memory" of a map, nothing of a rate), and its force there.
#[pyfunction]
fn law_at_rest(code: i64, values: Vec<f64>, u: f64, memory: Vec<f64>) -> PyResult<(Vec<f64>, f64)> {
    let law = AnyLaw::from_code(code, values.len())?;
    let mut states = if memory.is_empty() { law.rest_memory() } else { memory };
    if states.len() != law.n_memory() {
        return Err(Error::model(format!("a law remembers {} numbers, not {}", law.n_memory(), states.len())).into());
    }
    let force = law.eval(u, 0.0, &values, &mut states);
    states.truncate(law.n_states());
    Ok((states, force))
}

/// A law on directions (index, weight) of the coordinates, one for each displacement that it sees.
#[derive(FromPyObject)]
struct Part {
    code: i64,
    numbers: Vec<f64>,
    /// samples (u, v) to (force, df/du, df/dv), or a program (nodes, roots, u0); None of a law of the core
    function: Option<Py<PyAny>>,
    /// states at rest, none where they are zero
    start: Vec<f64>,
    directions: Vec<(Vec<usize>, Vec<f64>)>,
}

impl Part {
    fn element(self, py: Python<'_>, e: usize) -> PyResult<Element> {
        let m = self.directions.len();
        let force = match self.function {
            Some(body) => Force::Sampled(sampled(py, body, m, &self.numbers, e)?),
            None => self.known()?,
        };
        if m != force.coordinates() || self.directions.iter().any(|(index, weight)| index.len() != weight.len()) {
            return Err(Error::model(format!("element {e}: directions that do not fit its law")).into());
        }
        let directions = self.directions.into_iter().map(|(index, weight)| index.into_iter().zip(weight).collect());
        Ok(Element { force, directions: directions.collect() })
    }

    fn known(&self) -> Result<Force> {
        let law = AnyLaw::from_code(self.code, self.numbers.len())?;
        if self.start.is_empty() {
            return Ok(Force::known(law, self.numbers.clone()));
        }
        if self.start.len() != law.n_states() {
            return Err(Error::model(format!(
                "a law of {} states cannot start from {}",
                law.n_states(),
                self.start.len()
            )));
        }
        Ok(Force::Known { law, numbers: self.numbers.clone(), start: self.start.clone() })
    }
}

/// Laws on directions.
#[pyclass(frozen)]
pub struct HbmElements(pub Vec<Element>);

#[pymethods]
impl HbmElements {
    #[new]
    fn new(py: Python<'_>, parts: Vec<Part>) -> PyResult<Self> {
        let made = parts.into_iter().enumerate().map(|(e, part)| part.element(py, e));
        Ok(Self(made.collect::<PyResult<_>>()?))
    }

    /// Forces (m,), df/du and df/dv (m m,) of one element at a phase (rad), displacements and rates (m,); a law with states rests there.
    fn slopes(&self, element: usize, phase: f64, u: Vec<f64>, v: Vec<f64>) -> PyResult<ForceSlopes> {
        let chosen = self.0.get(element).ok_or_else(|| Error::model(format!("there is no element {element}")))?;
        let m = chosen.force.coordinates();
        if u.len() != m || v.len() != m {
            return Err(Error::model(format!("element {element} sees {m} displacements, not {}", u.len())).into());
        }
        Ok(chosen.force.slopes(phase, &u, &v)?)
    }
}

/// A program (nodes, roots, u0), or a callable.
fn sampled(py: Python<'_>, body: Py<PyAny>, m: usize, p: &[f64], element: usize) -> PyResult<Arc<dyn Sampled>> {
    let bound = body.bind(py);
    if bound.is_callable() {
        return Ok(Arc::new(PythonLaw { function: body, element, m }));
    }
    let (nodes, roots, start): (Bound<'_, PyAny>, Vec<usize>, Option<Vec<f64>>) = bound.extract()?;
    let law = FunctionLaw::traced(m, p.len(), program(&nodes, roots)?)?;
    if start.as_ref().is_some_and(|u| u.len() != m) {
        return Err(Error::model(format!("element {element} sees {m} displacements")).into());
    }
    let held = start.as_ref().map_or_else(|| vec![0.0; m], |u| law.force(0.0, u, &vec![0.0; m], p)[..m].to_vec());
    Ok(Arc::new(TracedLaw { law, p: p.to_vec(), start: start.unwrap_or_else(|| vec![0.0; m]), held }))
}

/// f(0, u0 + u, v) - f(0, u0, 0) of a traced function; the second term only where u0 is given.
struct TracedLaw {
    law: FunctionLaw,
    p: Vec<f64>,
    start: Vec<f64>,
    held: Vec<f64>,
}

impl Sampled for TracedLaw {
    fn coordinates(&self) -> usize {
        self.law.m()
    }

    fn has_kinks(&self) -> bool {
        let rest = vec![0.0; self.law.m()];
        !self.law.distances(0.0, &self.start, &rest, &self.p).is_empty()
    }

    fn evaluate(&self, u: &[f64], v: &[f64], f: &mut [f64], f_u: &mut [f64], f_v: &mut [f64]) -> Result<()> {
        let m = self.law.m();
        let n = u.len() / m;
        let (mut here, mut rate) = (vec![0.0; m], vec![0.0; m]);
        for i in 0..n {
            for a in 0..m {
                (here[a], rate[a]) = (self.start[a] + u[a * n + i], v[a * n + i]);
            }
            let made = self.law.slopes(0.0, &here, &rate, &self.p, true);
            for a in 0..m {
                f[a * n + i] = made.force[a] - self.held[a];
                for b in 0..m {
                    let at = (a * m + b) * n + i;
                    (f_u[at], f_v[at]) = (made.k[a][b], made.c[a][b]);
                }
            }
        }
        Ok(())
    }
}

/// A law that is a Python function of samples (n,), or (m, n) of m coordinates: the slow path, with the interpreter held for each
/// evaluation.
struct PythonLaw {
    function: Py<PyAny>,
    element: usize,
    m: usize,
}

impl Sampled for PythonLaw {
    fn coordinates(&self) -> usize {
        self.m
    }

    fn evaluate(&self, u: &[f64], v: &[f64], f: &mut [f64], f_u: &mut [f64], f_v: &mut [f64]) -> Result<()> {
        called(|py| {
            let samples = |x: &[f64]| PyArray1::from_slice(py, x).reshape(shape(self.m, x.len()));
            let answer = self.function.call1(py, (samples(u)?, samples(v)?))?;
            let parts: [PyReadonlyArrayDyn<'_, f64>; 3] = answer.extract(py)?;
            for (part, out) in parts.iter().zip([f, f_u, f_v]) {
                let part = part.as_array();
                if part.len() != out.len() {
                    let (k, got, wanted) = (self.element, part.len(), out.len());
                    let text = format!("elements[{k}], a function, returned {got} values where {wanted} belong");
                    return Err(Error::model(text).into());
                }
                out.iter_mut().zip(part.iter()).for_each(|(o, p)| *o = *p);
            }
            Ok(())
        });
        Ok(())
    }
}

/// Of the samples of m coordinates.
fn shape(m: usize, size: usize) -> Vec<usize> {
    if m == 1 { vec![size] } else { vec![m, size / m] }
}
