//! The compiled model in Python: assembly, equilibrium, linearisation and its derivatives.
//!
//! A state crosses as `q` (n_q,: coordinates of the joints in tree order, then modal ones) and `rate` (n_tree,) or an empty array at rest. Bodies in all other arrays stand in the order of the model.
use std::sync::Arc;

use numpy::ndarray::{Array2, Array3};
use numpy::{IntoPyArray, PyReadonlyArray1, PyReadonlyArray2};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};

use crate::constraint::assembly::assemble;
use crate::constraint::closure::{close, scene_at_rest};
use crate::constraint::loops::redundant_names;
use crate::equilibrium::{Equilibrium, equilibrium};
use crate::error::{Error, Result};
use crate::integrate::{Equations, Motion};
use crate::linearize::air_states::{air_states, holding};
use crate::linearize::force_rounding::hidden_forces;
use crate::linearize::loaded::loaded;
use crate::linearize::model_modes::linear_system;
use crate::linearize::parts::{Parts, parts};
use crate::linearize::reactions::reactions;
use crate::linearize::{Linearization, Setting, linearize, mobility};
use crate::multibody::System;
use crate::multibody::assemble::Effects;
use crate::multibody::decision::Doubt;
use crate::multibody::placement::{State, advance, place};
use crate::run::Counts;
use crate::tolerances::coordinates::UNIT_QUATERNION;

use super::border::{counts_dict, moved};
use super::law_places;
use super::model_work::{EQUILIBRIUM, LINEARIZATION, REACTIONS, compile, fits, run, run_pass};
use super::second_order::PySecondOrder;
use super::strains;
use super::tables::{tables, values};

/// Joints, singular value, taken for redundant?, tolerance.
type DoubtRow = (Vec<String>, f64, bool, f64);

#[pyclass(frozen, name = "System", module = "mbrs._core")]
pub struct PySystem(pub System);

pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<PySystem>()
}

pub fn effects(without: &[String]) -> Result<Effects> {
    let mut effects = Effects::ALL;
    for name in without {
        match name.as_str() {
            "gravity" => effects.gravity = false,
            "damping" => effects.damping = false,
            "gyroscopic" => effects.gyroscopic = false,
            "centrifugal" => effects.centrifugal = false,
            "preload-stiffness" => effects.preload_stiffness = false,
            "constraint-force-stiffness" => effects.constraint_force_stiffness = false,
            "friction" => effects.friction = false,
            "contact" => effects.contact = false,
            "nonholonomic" => effects.nonholonomic = false,
            "drives" => effects.drives = false,
            "aerodynamics" => effects.aerodynamics = false,
            // harmonic balance adds the laws themselves
            "law-slopes" => effects.law_slopes = false,
            // belong to other analyses: nothing to leave out here
            "flexibility" => {}
            other => {
                return Err(Error::model(format!("the effect '{other}' cannot be switched off in this analysis")));
            }
        }
    }
    Ok(effects)
}

pub fn state_of(system: &System, q: &PyReadonlyArray1<'_, f64>, rate: &PyReadonlyArray1<'_, f64>) -> Result<State> {
    let mut q = values(q);
    let n_q = system.topology.n_q;
    if q.len() != n_q {
        return Err(Error::model(format!("a state of this model has {n_q} coordinates, not {}", q.len())));
    }
    let rate = values(rate);
    if !rate.is_empty() && rate.len() != system.n_tree() {
        return Err(Error::model(format!("a state of this model has {} rates, not {}", system.n_tree(), rate.len())));
    }
    if q.iter().chain(&rate).any(|v| !v.is_finite()) {
        return Err(Error::model("the state contains NaN or infinite numbers"));
    }
    for node in &system.topology.nodes {
        let Some(k) = node.kind.quaternion() else { continue };
        let own = &mut q[node.q + k..node.q + k + 4];
        let length = own.iter().map(|v| v * v).sum::<f64>().sqrt();
        if (length - 1.0).abs() > UNIT_QUATERNION {
            let name = &system.topology.tables.bodies[node.body].name;
            return Err(Error::model(format!("the state of '{name}' holds a quaternion of length {length:.3}, not 1")));
        }
        own.iter_mut().for_each(|v| *v /= length);
    }
    Ok(State { q, rate })
}

fn empty(py: Python<'_>) -> PyResult<PyReadonlyArray1<'_, f64>> {
    numpy::PyArray1::<f64>::zeros(py, 0, false).extract()
}

fn put_state(py: Python<'_>, out: &Bound<'_, PyDict>, state: &State) -> PyResult<()> {
    out.set_item("q", state.q.clone().into_pyarray(py))?;
    out.set_item("rate", state.rate.clone().into_pyarray(py))
}

pub fn table(given: &PyReadonlyArray2<'_, f64>) -> nalgebra::DMatrix<f64> {
    let view = given.as_array();
    nalgebra::DMatrix::from_fn(view.nrows(), view.ncols(), |i, j| view[(i, j)])
}

/// Column by column: a copy of the memory.
pub fn array(m: &nalgebra::DMatrix<f64>) -> Array2<f64> {
    use numpy::ndarray::ShapeBuilder;
    let shape = m.shape();
    Array2::from_shape_vec(shape.f(), m.as_slice().to_vec())
        .unwrap_or_else(|_| Array2::from_shape_fn(shape, |(i, j)| m[(i, j)]))
}

fn put_parts(out: &Bound<'_, PyDict>, lin: &Linearization, parts: &Parts) -> PyResult<()> {
    out.set_item("second_order", PySecondOrder(Arc::new(linear_system(lin, parts)?)))?;
    out.set_item("error", parts.error)
}

/// The matrices stay; what is copied to nobody else moves.
fn put_linearization(py: Python<'_>, out: &Bound<'_, PyDict>, system: &System, lin: Linearization) -> PyResult<()> {
    let names: Vec<_> = lin.coordinates(system.n_tree()).iter().map(|i| system.topology.names[*i].clone()).collect();
    out.set_item("coordinates", names)?;
    if system.topology.is_flexible() {
        let map = array(&lin.modal_map(&system.topology));
        out.set_item("modal_map", map.into_pyarray(py))?;
    }
    out.set_item("T", moved(lin.body_map)?.into_pyarray(py))?;
    out.set_item("residual", Vec::from(lin.residual.data).into_pyarray(py))?;
    out.set_item("ground_coupling", moved(lin.ground_coupling)?.into_pyarray(py))?;
    out.set_item("force_scale", lin.force_scale)?;
    out.set_item("force_sizes", lin.force_sizes.into_pyarray(py))?;
    out.set_item("reach", lin.reach.into_pyarray(py))?;
    out.set_item("multipliers", lin.lam.into_pyarray(py))
}

#[pymethods]
impl PySystem {
    #[new]
    fn new(py: Python<'_>, tables_dict: &Bound<'_, PyDict>) -> PyResult<Self> {
        let read = tables(tables_dict)?;
        compile(py, read).map(PySystem)
    }

    fn with_values(&self, py: Python<'_>, x: PyReadonlyArray1<'_, f64>) -> PyResult<Self> {
        let x = values(&x);
        run_pass(py, &self.0, move |system, _| system.with_values(x)).map(PySystem)
    }

    #[getter]
    fn n_bodies(&self) -> usize {
        self.0.n_bodies()
    }

    /// Coordinates of a state: of the joints by node, then modal ones.
    #[getter]
    fn n_q(&self) -> usize {
        self.0.topology.n_q
    }

    #[getter]
    fn n_tree(&self) -> usize {
        self.0.n_tree()
    }

    #[getter]
    fn characteristic_length(&self) -> f64 {
        self.0.length
    }

    /// Rounding of M and K by places that are drawn in the world, over eps.
    fn remoteness(&self, q: PyReadonlyArray1<'_, f64>) -> PyResult<f64> {
        let q = state_of(&self.0, &q, &empty(q.py())?)?.q;
        Ok(self.0.remoteness(&q))
    }

    /// Tree, cut joints and coordinates: what the structure alone decides.
    fn topology<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let topology = &self.0.topology;
        let out = PyDict::new(py);
        let tree = PyList::empty(py);
        for node in &topology.nodes {
            let parent = node.parent.map(|p| topology.tables.bodies[topology.nodes[p].body].name.as_str());
            let joint = node.joint.map(|j| topology.tables.joints[j].name.as_str());
            tree.append((&topology.tables.bodies[node.body].name, parent, joint, node.kind.name()))?;
        }
        out.set_item("tree", tree)?;
        out.set_item("cut", topology.cut.iter().map(|j| topology.tables.joints[*j].name.clone()).collect::<Vec<_>>())?;
        out.set_item("coordinates", topology.names.clone())?;
        let rows = 0..topology.rows.len();
        let names: Vec<_> = rows.map(|i| topology.row_name(i).to_owned()).collect();
        out.set_item("row_joint", names)?;
        Ok(out)
    }

    /// The drawn state, loops closed and velocities made consistent; `hold`: with drives that stand still.
    #[pyo3(signature = (hold=false, without=Vec::new()))]
    fn assemble<'py>(&self, py: Python<'py>, hold: bool, without: Vec<String>) -> PyResult<Bound<'py, PyDict>> {
        let effects = effects(&without)?;
        let (assembled, counts) = run_pass(py, &self.0, move |system, _| {
            let mut counts = Counts::default();
            assemble(system, hold, effects, &mut counts).map(|a| (a, counts))
        })?;
        let out = PyDict::new(py);
        put_state(py, &out, &assembled.state)?;
        out.set_item("velocity_correction", assembled.velocities.change)?;
        out.set_item("velocities_contradict", assembled.velocities.contradicts())?;
        out.set_item("iterations", assembled.iterations)?;
        out.set_item("counts", counts_dict(py, &counts)?)?;
        Ok(out)
    }

    /// Pose and velocity of each body's origin: position (n, 3), rotation (n, 3, 3), velocity and angular velocity (n, 3), world.
    fn bodies<'py>(
        &self,
        py: Python<'py>,
        q: PyReadonlyArray1<'py, f64>,
        rate: PyReadonlyArray1<'py, f64>,
    ) -> PyResult<Bound<'py, PyDict>> {
        let state = state_of(&self.0, &q, &rate)?;
        let topology = &self.0.topology;
        let rate = state.moving().then_some(state.rate.as_slice());
        let placement = place(topology, &self.0.geometry, &state.q, rate);
        let n = self.0.n_bodies();
        let (mut position, mut velocity, mut omega) =
            (Array2::zeros((n, 3)), Array2::zeros((n, 3)), Array2::zeros((n, 3)));
        let mut rotation = Array3::zeros((n, 3, 3));
        for (i, node) in topology.nodes.iter().enumerate() {
            let pose = &placement.pose[i];
            let arm = -(pose.r * self.0.geometry.bodies[node.body].com);
            for k in 0..3 {
                position[(node.body, k)] = pose.p[k] + arm[k];
                for l in 0..3 {
                    rotation[(node.body, k, l)] = pose.r[(k, l)];
                }
            }
            if let Some(v) = placement.velocity.as_ref().map(|v| v.body[i].motion_at(&arm)) {
                for k in 0..3 {
                    velocity[(node.body, k)] = v.l[k];
                    omega[(node.body, k)] = v.a[k];
                }
            }
        }
        let out = PyDict::new(py);
        out.set_item("position", position.into_pyarray(py))?;
        out.set_item("rotation", rotation.into_pyarray(py))?;
        out.set_item("velocity", velocity.into_pyarray(py))?;
        out.set_item("angular_velocity", omega.into_pyarray(py))?;
        Ok(out)
    }

    fn equilibrium<'py>(
        &self,
        py: Python<'py>,
        q: PyReadonlyArray1<'py, f64>,
        without: Vec<String>,
    ) -> PyResult<Bound<'py, PyDict>> {
        let start = state_of(&self.0, &q, &empty(py)?)?;
        let effects = effects(&without)?;
        fits(&self.0, &EQUILIBRIUM)?;
        let (eq, parts, counts): (Equilibrium, Parts, Counts) = run(py, &self.0, move |system, cancel| {
            let mut counts = Counts::default();
            let found = equilibrium(system, &start, effects, cancel, &mut counts)?;
            let setting = Setting { system, state: &found.state, memory: &[], acceleration: &[], effects };
            let parts = parts(&setting, &found.linearization, None)?;
            Ok((found, parts, counts))
        })?;
        let out = PyDict::new(py);
        put_state(py, &out, &eq.state)?;
        put_parts(&out, &eq.linearization, &parts)?;
        out.set_item("relative_residual", eq.residual)?;
        out.set_item("error", eq.error)?;
        out.set_item("iterations", eq.iterations)?;
        out.set_item("stable", eq.stable)?;
        out.set_item("free_directions", eq.free_directions)?;
        out.set_item("family", eq.family)?;
        out.set_item("unresolved", eq.unresolved)?;
        out.set_item("counts", counts_dict(py, &counts)?)?;
        put_linearization(py, &out, &self.0, eq.linearization)?;
        Ok(out)
    }

    /// `acceleration` (n_tree,) of the tree coordinates where their rates do not stay, or empty. `turn` (dof, dof): the axes of a steady
    /// motion. `raw`: D and S as they are assembled, in place of C, G, K and N. `held`: states of the air that are held there, in the order of
    /// `air_states`; none are at rest.
    #[pyo3(signature = (q, rate, without, memory=Vec::new(), acceleration=Vec::new(), turn=None, raw=false, held=Vec::new()))]
    #[allow(clippy::too_many_arguments)]
    fn linearize<'py>(
        &self,
        py: Python<'py>,
        q: PyReadonlyArray1<'py, f64>,
        rate: PyReadonlyArray1<'py, f64>,
        without: Vec<String>,
        memory: Vec<f64>,
        acceleration: Vec<f64>,
        turn: Option<PyReadonlyArray2<'py, f64>>,
        raw: bool,
        held: Vec<f64>,
    ) -> PyResult<Bound<'py, PyDict>> {
        let state = state_of(&self.0, &q, &rate)?;
        let effects = effects(&without)?;
        let memory = if held.is_empty() {
            super::direction::remembered(&self.0, &memory)?
        } else {
            holding(&self.0.topology, &held)
        };
        fits(&self.0, &LINEARIZATION)?;
        if !acceleration.is_empty() && acceleration.len() != self.0.n_tree() {
            let n = self.0.n_tree();
            return Err(Error::model(format!(
                "a state of this model has {n} accelerations, not {}",
                acceleration.len()
            ))
            .into());
        }
        let turn = turn.as_ref().map(table);
        let (lin, parts, hidden, counts) = run_pass(py, &self.0, move |system, _| {
            let mut counts = Counts::default();
            let setting = Setting { system, state: &state, memory: &memory, acceleration: &acceleration, effects };
            let lin = linearize(&setting, &mut counts)?;
            let hidden = raw.then(|| hidden_forces(&setting, &lin));
            let parts = if raw { None } else { Some(parts(&setting, &lin, turn.as_ref())?) };
            Ok((lin, parts, hidden, counts))
        })?;
        let out = PyDict::new(py);
        match &parts {
            Some(parts) => put_parts(&out, &lin, parts)?,
            None => {
                if let Some(hidden) = hidden {
                    out.set_item("hidden_forces", hidden.force.into_pyarray(py))?;
                    out.set_item("hidden_centrifugal", hidden.centrifugal.into_pyarray(py))?;
                    out.set_item("is_idle", hidden.is_idle.into_pyarray(py))?;
                }
                out.set_item("M", array(&lin.matrices.mass).into_pyarray(py))?;
                out.set_item("D", lin.matrices.damping.as_ref().map(|d| array(d).into_pyarray(py)))?;
                out.set_item("S", array(&lin.matrices.stiffness).into_pyarray(py))?;
            }
        }
        out.set_item("moving", lin.acceleration.is_some() || rate.as_array().iter().any(|r| *r != 0.0))?;
        if let Some(l) = &lin.loops {
            out.set_item("rank", l.dependent.len())?;
            let named = redundant_names(&self.0.topology, &l.dropped, |row| effects.row(row));
            out.set_item("redundant", named)?;
        }
        out.set_item("counts", counts_dict(py, &counts)?)?;
        put_linearization(py, &out, &self.0, lin)?;
        Ok(out)
    }

    /// Minimal coordinates at rest, with the rank of the loops and what is redundant in them.
    fn mobility<'py>(&self, py: Python<'py>, q: PyReadonlyArray1<'py, f64>) -> PyResult<Bound<'py, PyDict>> {
        let state = state_of(&self.0, &q, &empty(py)?)?;
        let loops = run(py, &self.0, move |system, _| {
            mobility(&Setting { system, state: &state, memory: &[], acceleration: &[], effects: Effects::ALL })
        })?;
        let out = PyDict::new(py);
        let topology = &self.0.topology;
        let free = match &loops {
            Some(l) => l.independent.clone(),
            None => (0..self.0.n_tree()).collect(),
        };
        let names: Vec<_> = free.iter().map(|i| topology.names[*i].as_str()).collect();
        out.set_item("coordinates", names)?;
        if let Some(l) = &loops {
            out.set_item("rank", l.dependent.len())?;
            out.set_item("redundant", redundant_names(topology, &l.dropped, |_| true))?;
        }
        Ok(out)
    }

    /// What the drawing decides only just: (joints, singular value, taken for redundant?, tolerance) each.
    #[pyo3(signature = (without=Vec::new()))]
    fn doubts(&self, py: Python<'_>, without: Vec<String>) -> PyResult<Vec<DoubtRow>> {
        let effects = effects(&without)?;
        if self.0.topology.rows.is_empty() {
            return Ok(Vec::new());
        }
        let decision = run(py, &self.0, move |system, _| system.decision(effects))?;
        let one = |d: &Doubt| (d.joints.clone(), d.singular_value, d.redundant, decision.tolerance);
        Ok(decision.doubts.iter().map(one).collect())
    }

    /// A state advanced by increments of the minimal coordinates, loops closed.
    #[pyo3(signature = (q, increments, without=Vec::new()))]
    fn advance<'py>(
        &self,
        py: Python<'py>,
        q: PyReadonlyArray1<'py, f64>,
        increments: PyReadonlyArray1<'py, f64>,
        without: Vec<String>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let mut state = state_of(&self.0, &q, &empty(py)?)?;
        let effects = effects(&without)?;
        let z = nalgebra::DVector::from_vec(values(&increments));
        fits(&self.0, &LINEARIZATION)?;
        let moved = run(py, &self.0, move |system, _| {
            let setting = Setting { system, state: &state, memory: &[], acceleration: &[], effects };
            let base = linearize(&setting, &mut Counts::default())?;
            let dy = base.expand(z)?;
            advance(&system.topology, &mut state.q, dy.as_slice());
            close(system, &mut state, effects, &mut Counts::default())?;
            Ok(state)
        })?;
        let out = PyDict::new(py);
        put_state(py, &out, &moved)?;
        out.as_any().get_item("q")
    }

    /// All constraint rows at a state and time: `phi`, `jacobian` over the tree coordinates, `rates` J v + Phi_t and `bias`, their
    /// rate at constant v.
    fn rows<'py>(
        &self,
        py: Python<'py>,
        q: PyReadonlyArray1<'py, f64>,
        rate: PyReadonlyArray1<'py, f64>,
        t: f64,
        without: Vec<String>,
    ) -> PyResult<Bound<'py, PyDict>> {
        let mut state = state_of(&self.0, &q, &rate)?;
        state.rate.resize(self.0.n_tree(), 0.0);
        let effects = effects(&without)?;
        let motion = Motion { t, q: state.q, rate: state.rate, memory: Vec::new() };
        let (phi, jacobian, rates, bias) = run(py, &self.0, move |system, _| {
            let eq = Equations::new(system, system.x.to_vec(), effects);
            let (phi, jacobian) = eq.rows(&motion);
            Ok((phi, jacobian, eq.row_rates(&motion), eq.row_bias(&motion)))
        })?;
        let out = PyDict::new(py);
        out.set_item("jacobian", array(&jacobian).into_pyarray(py))?;
        for (name, v) in [("phi", phi), ("rates", rates), ("bias", bias)] {
            out.set_item(name, v.as_slice().to_vec().into_pyarray(py))?;
        }
        Ok(out)
    }

    /// How far given rates of the tree coordinates violate the rows at t = 0, in rates of the scaled rows.
    #[pyo3(signature = (q, rate, without=Vec::new()))]
    fn rate_mismatch(
        &self,
        py: Python<'_>,
        q: PyReadonlyArray1<'_, f64>,
        rate: PyReadonlyArray1<'_, f64>,
        without: Vec<String>,
    ) -> PyResult<f64> {
        let state = state_of(&self.0, &q, &rate)?;
        let effects = effects(&without)?;
        run(py, &self.0, move |system, _| {
            let (topology, geometry) = (&system.topology, &system.geometry);
            let placement = place(topology, geometry, &state.q, None);
            let scene = scene_at_rest(system, &placement, effects);
            let (jacobian, prescribed) = (scene.constraints().1, scene.explicit_rates());
            let scales = system.row_scales();
            let miss = jacobian * nalgebra::DVector::from_vec(state.rate.clone()) + prescribed;
            Ok(miss.iter().zip(scales).map(|(m, s)| (m * s).abs()).fold(0.0, f64::max))
        })
    }

    /// States of sections in the air about a linearised state, see `linearize::air_states`; None without any. `held`: states that do not rest.
    #[pyo3(signature = (q, rate, without, acceleration=Vec::new(), turn=None, held=None))]
    #[expect(clippy::too_many_arguments)]
    fn air_states<'py>(
        &self,
        py: Python<'py>,
        q: PyReadonlyArray1<'py, f64>,
        rate: PyReadonlyArray1<'py, f64>,
        without: Vec<String>,
        acceleration: Vec<f64>,
        turn: Option<PyReadonlyArray2<'py, f64>>,
        held: Option<Vec<f64>>,
    ) -> PyResult<Option<Bound<'py, PyDict>>> {
        let state = state_of(&self.0, &q, &rate)?;
        let effects = effects(&without)?;
        let turn = turn.as_ref().map(table);
        let found = run(py, &self.0, move |system, _| {
            let setting = Setting { system, state: &state, memory: &[], acceleration: &acceleration, effects };
            air_states(&setting, turn.as_ref(), held.as_deref())
        })?;
        let Some(found) = found else { return Ok(None) };
        let out = PyDict::new(py);
        for (name, m) in
            [("effect", &found.effect), ("by_place", &found.by_place), ("by_rate", &found.by_rate), ("own", &found.own)]
        {
            out.set_item(name, array(m).into_pyarray(py))?;
        }
        out.set_item("air", found.air)?;
        out.set_item("section", found.section)?;
        out.set_item("memory", holding(&self.0.topology, &found.value).into_pyarray(py))?;
        out.set_item("value", found.value.into_pyarray(py))?;
        out.set_item("rate", found.rate.into_pyarray(py))?;
        Ok(Some(out))
    }

    /// Where the laws act at a state, see `law_places::law_places`.
    fn law_places<'py>(
        &self,
        py: Python<'py>,
        q: PyReadonlyArray1<'py, f64>,
        rate: PyReadonlyArray1<'py, f64>,
    ) -> PyResult<Bound<'py, PyList>> {
        law_places::law_places(py, &self.0, &state_of(&self.0, &q, &rate)?)
    }

    /// Where the functions of several coordinates act, see `law_places::function_places`.
    fn function_places<'py>(
        &self,
        py: Python<'py>,
        q: PyReadonlyArray1<'py, f64>,
        rate: PyReadonlyArray1<'py, f64>,
    ) -> PyResult<Bound<'py, PyList>> {
        law_places::function_places(py, &self.0, &state_of(&self.0, &q, &rate)?)
    }

    /// Strains of the elastic connectors by the coordinates whose twists (6 n_bodies, dof) of the bodies' origins at `position` are
    /// given, with the sizes of their terms; of each connector its bodies, gradients (k, 6) of its strains by the relative twist at its
    /// point, world axes, and stiffness (k, k) with the slopes of its laws.
    fn strains<'py>(
        &self,
        py: Python<'py>,
        q: PyReadonlyArray1<'py, f64>,
        without: Vec<String>,
        twist: PyReadonlyArray2<'py, f64>,
        position: PyReadonlyArray2<'py, f64>,
    ) -> PyResult<Bound<'py, PyDict>> {
        strains::strains(py, &self.0, &state_of(&self.0, &q, &empty(py)?)?, effects(&without)?, (&twist, &position))
    }

    /// F (rows, dof) with F^T F the stiffness of all that is elastic at a state at rest; None where it has no such factor.
    fn stiffness_factor<'py>(
        &self,
        py: Python<'py>,
        q: PyReadonlyArray1<'py, f64>,
        without: Vec<String>,
    ) -> PyResult<Option<Bound<'py, numpy::PyArray2<f64>>>> {
        strains::stiffness_factor(py, &self.0, state_of(&self.0, &q, &empty(py)?)?, effects(&without)?)
    }

    /// Does anything carry force at a state at rest? A drawn state without cause for force has none, whatever rounding makes of it.
    fn is_loaded(&self, py: Python<'_>, q: PyReadonlyArray1<'_, f64>, without: Vec<String>) -> PyResult<bool> {
        Ok(loaded(&self.0, &state_of(&self.0, &q, &empty(py)?)?, effects(&without)?)?)
    }

    /// Wrench of every joint on its second body at the joint's point, (n_joints, 6), world axes.
    fn reactions<'py>(
        &self,
        py: Python<'py>,
        q: PyReadonlyArray1<'py, f64>,
        rate: PyReadonlyArray1<'py, f64>,
        without: Vec<String>,
    ) -> PyResult<Bound<'py, numpy::PyArray2<f64>>> {
        let state = state_of(&self.0, &q, &rate)?;
        let effects = effects(&without)?;
        fits(&self.0, &REACTIONS)?;
        let all = run(py, &self.0, move |system, _| {
            let setting = Setting { system, state: &state, memory: &[], acceleration: &[], effects };
            let base = linearize(&setting, &mut Counts::default())?;
            reactions(&setting, &base)
        })?;
        Ok(Array2::from_shape_fn((all.len(), 6), |(i, k)| all[i].get(k)).into_pyarray(py))
    }
}
