//! Motion in time for Python: a run with its options, and quantities of the instants it gave.
use std::sync::Arc;

use numpy::ndarray::{Array1, Array2, Array3};
use numpy::{IntoPyArray, PyReadonlyArray1, PyReadonlyArray2};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};

use crate::aero::section::{Flow, Place, column};
use crate::constraint::loops::Loops;
use crate::error::{Error, Result};
use crate::force::Side;
use crate::integrate::augmented::Penalty;
use crate::integrate::driver::{End, Output, Plan, Progress, Run, Steps};
use crate::integrate::methods::{Method, simulate};
use crate::integrate::{Equations, Motion};
use crate::linearize::reactions::shared;
use crate::memory;
use crate::multibody::System;
use crate::multibody::assemble::Effects;
use crate::multibody::topology::Owner;
use crate::run::{Cancel, Counts};
use crate::sensitivity::march::{KeptMotion, Rule};
use crate::spatial::{V3, quaternion_of_rotation};

use super::border::{counts_dict, interruptible, interruptible_so_far};
use super::gradient::PyKeptMotion;
use super::system::{PySystem, effects, state_of};
use super::tables::values;

pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(simulate_motion, module)?)?;
    module.add_function(wrap_pyfunction!(motion_quantities, module)?)?;
    module.add_function(wrap_pyfunction!(motion_air, module)?)?;
    module.add_function(wrap_pyfunction!(motion_reactions, module)?)?;
    module.add_function(wrap_pyfunction!(motion_of_element, module)?)?;
    module.add_function(wrap_pyfunction!(motion_of_joint, module)?)
}

/// One finite number of the options, or None.
fn number(options: &Bound<'_, PyDict>, name: &str) -> PyResult<Option<f64>> {
    options.get_item(name)?.filter(|v| !v.is_none()).map(|v| v.extract()).transpose()
}

fn numbers(options: &Bound<'_, PyDict>, name: &str) -> PyResult<Option<Vec<f64>>> {
    options.get_item(name)?.filter(|v| !v.is_none()).map(|v| v.extract()).transpose()
}

fn plan(options: &Bound<'_, PyDict>) -> PyResult<Plan> {
    let need = |name: &str| -> PyResult<f64> {
        number(options, name)?.ok_or_else(|| Error::model(format!("the option '{name}' is missing")).into())
    };
    let steps = match number(options, "step")? {
        Some(h) => Steps::Fixed(h),
        None => Steps::Controlled {
            rtol: need("rtol")?,
            first: number(options, "first_step")?,
            longest: number(options, "max_step")?.unwrap_or(f64::INFINITY),
        },
    };
    Ok(Plan {
        end: need("end")?,
        steps,
        outputs: numbers(options, "outputs")?,
        breaks: numbers(options, "breaks")?.unwrap_or_default(),
        max_steps: number(options, "max_steps")?.map_or(usize::MAX, |n| n as usize),
        kept: None,
        exact_kinks: number(options, "exact_kinks")?.is_some(),
        ends: numbers(options, "ends")?,
        share: 1.0,
    })
}

/// Square matrices of the tree coordinates that a motion holds at most: mass, iteration matrix, its factors and their products.
const MATRICES: f64 = 10.0;

/// A run from a state. `options`: method, end, step or rtol, outputs, breaks, t, memory, ...; see mbrs/motion/options.py.
#[pyfunction]
#[pyo3(signature = (system, q, rate, without, options, report=None))]
fn simulate_motion<'py>(
    py: Python<'py>,
    system: &PySystem,
    q: PyReadonlyArray1<'py, f64>,
    rate: PyReadonlyArray1<'py, f64>,
    without: Vec<String>,
    options: &Bound<'py, PyDict>,
    report: Option<Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyDict>> {
    let system = system.0.clone();
    let mut state = state_of(&system, &q, &rate)?;
    state.rate.resize(system.n_tree(), 0.0);
    let memory = numbers(options, "memory")?.unwrap_or_default();
    let n_memory = system.topology.n_memory;
    if !memory.is_empty() && memory.len() != n_memory {
        return Err(Error::model(format!(
            "a state of this model has {n_memory} numbers of memory, not {}",
            memory.len()
        ))
        .into());
    }
    let motion = Motion {
        t: number(options, "t")?.unwrap_or(0.0),
        q: state.q,
        rate: state.rate,
        memory: if memory.is_empty() { system.topology.at_rest(&[]) } else { memory },
    };
    let method: String = match options.get_item("method")? {
        Some(name) => name.extract()?,
        None => "auto".to_string(),
    };
    let penalty = number(options, "penalty")?;
    let passes = number(options, "passes")?.unwrap_or(1.0) as usize;
    let penalty = penalty.map(|factor| Penalty { factor, passes });
    let method = Method::named(&method, number(options, "rho")?, penalty)?;
    let (effects, mut plan) = (effects(&without)?, plan(options)?);
    plan.breaks.extend(system.kinks(motion.t));
    if matches!(plan.steps, Steps::Controlled { .. }) {
        plan.breaks.extend(system.wakes(motion.t));
    }
    plan.breaks.sort_by(f64::total_cmp);
    plan.breaks.dedup();
    let n = system.n_tree() as f64;
    memory::require(MATRICES * 8.0 * n * n, &format!("a motion of {n} tree coordinates"), "divide the model")?;
    let progress = Arc::new(Progress::default());
    let (shared, own) = (system.clone(), progress.clone());
    let keep = number(options, "keep")?;
    let work = move |cancel: &Cancel| {
        let mut counts = Counts::default();
        let eq = Equations::new(&shared, shared.x.to_vec(), effects);
        plan.kept = keep.zip(Rule::of(&method)).map(|(keep, rule)| keep as usize / rule.numbers(&eq)[1].max(1));
        simulate(&eq, method, motion, plan, cancel, &own, &mut counts).map(|out| (out, counts))
    };
    let show = || report.as_ref().map_or(Ok(()), |report| report.call1((progress.get(),)).map(|_| ()));
    let ((mut out, counts), cut) = interruptible_so_far(py, work, show)?;
    let dict = put_run(py, &out.run)?;
    if cut {
        dict.set_item("status", "interrupted")?;
    }
    if let Some(mut steps) = out.run.kept.take() {
        steps.counts.clone_from(&counts);
        let kept = KeptMotion { steps, times: out.run.steps.clone(), x: system.x.to_vec() };
        dict.set_item("kept", PyKeptMotion(Arc::new(kept)))?;
    }
    dict.set_item("method", out.method)?;
    dict.set_item("why", out.why)?;
    let measures = PyDict::new(py);
    out.measures.iter().try_for_each(|(name, value)| measures.set_item(name, value))?;
    dict.set_item("measures", measures)?;
    dict.set_item("position_correction", out.position_correction)?;
    dict.set_item("velocity_correction", out.velocity_correction)?;
    dict.set_item("counts", counts_dict(py, &counts)?)?;
    Ok(dict)
}

fn put_run<'py>(py: Python<'py>, run: &Run) -> PyResult<Bound<'py, PyDict>> {
    let out = PyDict::new(py);
    let all = &run.outputs;
    let n = all.len();
    let rows = |of: &dyn Fn(&Output) -> &[f64]| {
        // a run that ended before its first output has none, of the usual width
        let width = of(&run.last).len();
        Array2::from_shape_fn((n, width), |(i, k)| of(&all[i])[k]).into_pyarray(py)
    };
    out.set_item("t", Array1::from_shape_fn(n, |i| all[i].instant.motion.t).into_pyarray(py))?;
    out.set_item("q", rows(&|o| &o.instant.motion.q))?;
    out.set_item("rate", rows(&|o| &o.instant.motion.rate))?;
    out.set_item("memory", rows(&|o| &o.instant.motion.memory))?;
    out.set_item("acceleration", rows(&|o| &o.instant.acceleration))?;
    out.set_item("multipliers", rows(&|o| &o.instant.lam))?;
    out.set_item("joints", rows(&|o| &o.joints))?;
    out.set_item("steps", run.steps.clone().into_pyarray(py))?;
    out.set_item("orders", run.formulas.clone().into_pyarray(py))?;
    out.set_item("local_error", run.local.clone().into_pyarray(py))?;
    out.set_item("rejected", run.rejected)?;
    let side = |s: &Side| match s {
        Side::Free => 0,
        Side::Below => -1,
        Side::Above => 1,
    };
    let smooth = run.at_kinks.smooth.iter().map(|s| (s.from, s.sides.iter().map(side).collect::<Vec<i8>>()));
    out.set_item("smooth", smooth.collect::<Vec<_>>())?;
    out.set_item("missed", run.at_kinks.missed.clone())?;
    let (status, t, message) = match &run.end {
        End::Finished => ("finished", run.last.instant.motion.t, String::new()),
        End::Interrupted => ("interrupted", run.last.instant.motion.t, String::new()),
        End::Stopped { t, message } => ("stopped", *t, message.clone()),
    };
    out.set_item("status", status)?;
    out.set_item("end", t)?;
    out.set_item("message", message)?;
    Ok(out)
}

/// Rows of rates or memories without columns are those of states at rest, and of laws at rest.
fn motions(
    system: &System,
    t: &PyReadonlyArray1<'_, f64>,
    q: &PyReadonlyArray2<'_, f64>,
    rate: &PyReadonlyArray2<'_, f64>,
    memory: &PyReadonlyArray2<'_, f64>,
) -> Result<Vec<Motion<f64>>> {
    let (t, q, v, z) = (values(t), q.as_array(), rate.as_array(), memory.as_array());
    let n = t.len();
    let fits = |found: &[usize], size: usize| found == [n, size] || found == [n, 0];
    if q.shape() != [n, system.topology.n_q]
        || !fits(v.shape(), system.n_tree())
        || !fits(z.shape(), system.topology.n_memory)
    {
        return Err(Error::model("the instants do not fit the model"));
    }
    let rate = |i: usize| if v.ncols() == 0 { vec![0.0; system.n_tree()] } else { v.row(i).to_vec() };
    let memory = |i: usize| if z.ncols() == 0 { system.topology.at_rest(&[]) } else { z.row(i).to_vec() };
    Ok((0..n).map(|i| Motion { t: t[i], q: q.row(i).to_vec(), rate: rate(i), memory: memory(i) }).collect())
}

/// Of an instant at which a drive has a kink: it ends what was before, or begins what follows.
fn residuals(eq: &Equations<'_, f64>, kinks: &[f64], m: &Motion<f64>, a: &[f64]) -> [f64; 3] {
    let after = eq.residuals(m, a);
    if !kinks.contains(&m.t) {
        return after;
    }
    let earlier = Motion { t: m.t - 4.0 * f64::EPSILON * m.t.abs(), ..m.clone() };
    let before = eq.residuals(&earlier, a);
    if before[1].max(before[2]) < after[1].max(after[2]) { before } else { after }
}

/// Per instant: position (n, b, 3), quaternion (n, b, 4), velocity, angular_velocity (n, b, 3); kinetic, gravity (n,); stored and
/// power (n, elements) with their names; residual (n, 3) of position, velocity and acceleration rows, scaled.
#[pyfunction]
#[allow(clippy::too_many_arguments)]
fn motion_quantities<'py>(
    py: Python<'py>,
    system: &PySystem,
    t: PyReadonlyArray1<'py, f64>,
    q: PyReadonlyArray2<'py, f64>,
    rate: PyReadonlyArray2<'py, f64>,
    memory: PyReadonlyArray2<'py, f64>,
    acceleration: PyReadonlyArray2<'py, f64>,
    without: Vec<String>,
) -> PyResult<Bound<'py, PyDict>> {
    let system = system.0.clone();
    let all = motions(&system, &t, &q, &rate, &memory)?;
    let effects = effects(&without)?;
    let a = acceleration.as_array().to_owned();
    if a.shape() != [all.len(), system.n_tree()] {
        return Err(Error::model("the accelerations do not fit the model").into());
    }
    let shared = system.clone();
    let found = interruptible(py, move |cancel| {
        let system = &shared;
        let eq = Equations::new(system, system.x.to_vec(), effects);
        let kinks = system.kinks(f64::NEG_INFINITY);
        all.iter()
            .enumerate()
            .map(|(i, m)| {
                cancel.check()?;
                let placement = eq.place(m);
                let mut rotations = vec![[0.0; 4]; system.n_bodies()];
                for (node, pose) in system.topology.nodes.iter().zip(&placement.pose) {
                    rotations[node.body] = quaternion_of_rotation(&pose.r);
                }
                let acceleration: Vec<f64> = a.row(i).to_vec();
                Ok((eq.origins(&placement), rotations, eq.energies(m), residuals(&eq, &kinks, m, &acceleration)))
            })
            .collect::<Result<Vec<_>>>()
    })?;
    let (n, bodies) = (found.len(), system.n_bodies());
    let out = PyDict::new(py);
    let vectors = |of: &dyn Fn(usize, usize, usize) -> f64, w: usize| {
        Array3::from_shape_fn((n, bodies, w), |(i, b, k)| of(i, b, k)).into_pyarray(py)
    };
    out.set_item("position", vectors(&|i, b, k| found[i].0[b].0[k], 3))?;
    out.set_item("orientation", vectors(&|i, b, k| found[i].1[b][k], 4))?;
    out.set_item("velocity", vectors(&|i, b, k| found[i].0[b].1.l[k], 3))?;
    out.set_item("angular_velocity", vectors(&|i, b, k| found[i].0[b].1.a[k], 3))?;
    let series = |of: &dyn Fn(usize) -> f64| Array1::from_shape_fn(n, of).into_pyarray(py);
    out.set_item("kinetic", series(&|i| found[i].2.kinetic))?;
    out.set_item("gravity", series(&|i| found[i].2.gravity))?;
    let tables = &system.topology.tables;
    let names = system.topology.connectors.iter().map(|c| match c.owner {
        Owner::Element(i) => tables.elements[i].name.as_str(),
        Owner::Joint(i) => tables.joints[i].name.as_str(),
    });
    let flexible = tables.flexible.iter();
    let flexible = flexible.map(|f| tables.bodies[f.body].name.as_str());
    let loads = tables.loads.iter().map(|l| l.name.as_str());
    let air = tables.air.iter().map(|a| a.name.as_str());
    let names: Vec<_> = names.chain(flexible).chain(loads).chain(air).collect();
    let first_air = names.len() - tables.air.len();
    let first_load = first_air - tables.loads.len();
    let table =
        |of: &dyn Fn(usize, usize) -> f64| Array2::from_shape_fn((n, names.len()), |(i, k)| of(i, k)).into_pyarray(py);
    out.set_item(
        "stored",
        table(&|i, k| {
            let element = found[i].2.elements.get(k);
            element.and_then(|e| e.stored).unwrap_or(f64::NAN)
        }),
    )?;
    out.set_item(
        "power",
        table(&|i, k| match found[i].2.elements.get(k) {
            Some(element) => element.power,
            None if k < first_air => found[i].2.loads[k - first_load],
            None => found[i].2.air[k - first_air],
        }),
    )?;
    out.set_item("residual", Array2::from_shape_fn((n, 3), |(i, k)| found[i].3[k]).into_pyarray(py))?;
    out.set_item("elements", PyList::new(py, names)?)?;
    Ok(out)
}

/// What the air does at each section at each time: (n, sections, 36) numbers, in the order of `mbrs.motion.air.FLOW`.
#[pyfunction]
#[allow(clippy::too_many_arguments)]
fn motion_air<'py>(
    py: Python<'py>,
    system: &PySystem,
    t: PyReadonlyArray1<'py, f64>,
    q: PyReadonlyArray2<'py, f64>,
    rate: PyReadonlyArray2<'py, f64>,
    memory: PyReadonlyArray2<'py, f64>,
) -> PyResult<Bound<'py, numpy::PyArray3<f64>>> {
    let system = system.0.clone();
    let all = motions(&system, &t, &q, &rate, &memory)?;
    let sections = system.topology.tables.sections.len();
    let found = interruptible(py, move |cancel| {
        let eq = Equations::new(&system, system.x.to_vec(), Effects::ALL);
        let one = |m: &Motion<f64>| {
            cancel.check()?;
            let placement = eq.place(m);
            Ok(eq.scene(m, &placement, None).air_flows().iter().map(flow_row).collect::<Vec<_>>())
        };
        all.iter().map(one).collect::<Result<Vec<_>>>()
    })?;
    Ok(Array3::from_shape_fn((found.len(), sections, FLOW), |(i, j, k)| found[i][j][k]).into_pyarray(py))
}

/// Numbers of a row of `motion_air`.
const FLOW: usize = 36;

fn flow_row((place, flow): &(Place<f64>, Flow<f64>)) -> [f64; FLOW] {
    let moved = |p: &V3<f64>| place.velocity.l + place.velocity.a.cross(&(p - place.p));
    let vectors = [
        flow.force,
        flow.moment,
        flow.centre,
        flow.rear,
        flow.forward,
        column(&place.r, 0),
        column(&place.r, 1),
        column(&place.r, 2),
        moved(&flow.centre),
        moved(&flow.rear),
        flow.induced,
    ];
    let mut row = [0.0; FLOW];
    row[..3].copy_from_slice(&[flow.angle, flow.speed, flow.circulation]);
    for (k, v) in vectors.iter().enumerate() {
        row[3 + 3 * k..6 + 3 * k].copy_from_slice(v.as_slice());
    }
    row
}

/// Wrench of every joint on its second body at the joint's point, world axes: (n, joints, 6).
#[pyfunction]
#[allow(clippy::too_many_arguments)]
fn motion_reactions<'py>(
    py: Python<'py>,
    system: &PySystem,
    t: PyReadonlyArray1<'py, f64>,
    q: PyReadonlyArray2<'py, f64>,
    rate: PyReadonlyArray2<'py, f64>,
    memory: PyReadonlyArray2<'py, f64>,
    acceleration: PyReadonlyArray2<'py, f64>,
    multipliers: PyReadonlyArray2<'py, f64>,
    without: Vec<String>,
) -> PyResult<Bound<'py, numpy::PyArray3<f64>>> {
    let system = system.0.clone();
    let all = motions(&system, &t, &q, &rate, &memory)?;
    let effects = effects(&without)?;
    let (a, lam) = (acceleration.as_array().to_owned(), multipliers.as_array().to_owned());
    let rows = system.topology.rows.len();
    if a.shape() != [all.len(), system.n_tree()] || lam.shape() != [all.len(), rows] {
        return Err(Error::model("the accelerations and multipliers do not fit the model").into());
    }
    let shared_system = system.clone();
    let found = interruptible(py, move |cancel| {
        let system = &shared_system;
        let eq = Equations::new(system, system.x.to_vec(), effects);
        let one = |(i, m): (usize, &Motion<f64>)| {
            cancel.check()?;
            let placement = eq.place(m);
            let acceleration = a.row(i).to_vec();
            let scene = eq.scene(m, &placement, Some(&acceleration));
            let decision = system.decision(scene.effects)?;
            let loops = Loops::analyse(system, &scene.constraints().1, &decision)?;
            shared(system, &scene, &placement, &lam.row(i).to_vec(), loops.as_ref())
        };
        all.iter().enumerate().map(one).collect::<Result<Vec<_>>>()
    })?;
    let tables = &system.topology.tables;
    let wrenches = tables.joints.len() + tables.drives.len();
    Ok(Array3::from_shape_fn((found.len(), wrenches, 6), |(i, j, k)| found[i][j].get(k)).into_pyarray(py))
}

/// Per instant and coordinate of an element: coordinate, displacement, rate, force, (n, coordinates, 4).
#[pyfunction]
#[allow(clippy::too_many_arguments)]
fn motion_of_element<'py>(
    py: Python<'py>,
    system: &PySystem,
    element: usize,
    t: PyReadonlyArray1<'py, f64>,
    q: PyReadonlyArray2<'py, f64>,
    rate: PyReadonlyArray2<'py, f64>,
    memory: PyReadonlyArray2<'py, f64>,
    without: Vec<String>,
) -> PyResult<Bound<'py, numpy::PyArray3<f64>>> {
    let system = system.0.clone();
    let all = motions(&system, &t, &q, &rate, &memory)?;
    let effects = effects(&without)?;
    if element >= system.topology.tables.elements.len() {
        return Err(Error::model("the model has no element of this number").into());
    }
    let n = system.topology.connectors[element].coordinates.len();
    let found = instants(py, system, all, effects, move |eq, m| eq.element_motion(m, element))?;
    let numbers = |i: usize, k: usize| {
        let c = found[i][k];
        [c.coordinate, c.displacement, c.rate, c.force]
    };
    Ok(Array3::from_shape_fn((found.len(), n, 4), |(i, k, j)| numbers(i, k)[j]).into_pyarray(py))
}

/// Rates of the free coordinates of a joint per instant, (n, coordinates).
#[pyfunction]
fn motion_of_joint<'py>(
    py: Python<'py>,
    system: &PySystem,
    joint: usize,
    t: PyReadonlyArray1<'py, f64>,
    q: PyReadonlyArray2<'py, f64>,
    rate: PyReadonlyArray2<'py, f64>,
    memory: PyReadonlyArray2<'py, f64>,
) -> PyResult<Bound<'py, numpy::PyArray2<f64>>> {
    let system = system.0.clone();
    let all = motions(&system, &t, &q, &rate, &memory)?;
    let Some(spec) = system.topology.tables.joints.get(joint) else {
        return Err(Error::model("the model has no joint of this number").into());
    };
    let n = spec.kind.free_coordinates().len();
    let found = instants(py, system, all, Effects::ALL, move |eq, m| eq.joint_rates(m, joint))?;
    Ok(Array2::from_shape_fn((found.len(), n), |(i, k)| found[i][k]).into_pyarray(py))
}

/// One answer for each instant, away from Python.
fn instants<O: Send + 'static>(
    py: Python<'_>,
    system: System,
    all: Vec<Motion<f64>>,
    effects: Effects,
    one: impl Fn(&Equations<'_, f64>, &Motion<f64>) -> O + Send + 'static,
) -> PyResult<Vec<O>> {
    interruptible(py, move |cancel| {
        let eq = Equations::new(&system, system.x.to_vec(), effects);
        all.iter().map(|m| cancel.check().map(|()| one(&eq, m))).collect::<Result<Vec<_>>>()
    })
}
