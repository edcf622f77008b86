//! Gradients of a motion for Python.
use numpy::ndarray::{Array1, Array2, Array3};
use numpy::{IntoPyArray, PyArray1, PyArray2, PyReadonlyArray1, PyReadonlyArray2};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::sync::Arc;

use crate::error::{Error, Result};
use crate::force::Side;
use crate::integrate::ali3p::Weight;
use crate::integrate::bdf::record::{Kind, RATES, START};
use crate::integrate::kinks::Smooth;
use crate::integrate::methods::explicit_serves;
use crate::integrate::{Equations, Instant, Motion};
use crate::multibody::System;
use crate::run::Counts;
use crate::sensitivity::adjoint::{Forward, backward, forward};
use crate::sensitivity::direct::{Sensitivities, direct};
use crate::sensitivity::kinks::{Kink, no_impact};
use crate::sensitivity::march::{KeptMotion, Rule};
use crate::sensitivity::quantity::{Drawn, Quantity, check};
use crate::sensitivity::stretches::{Stretches, systems};
use crate::sensitivity::{Direction, Follow, Plan, first};

use super::border::{counts_dict, interruptible};
use super::system::{PySystem, effects, state_of};

pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<MotionForward>()?;
    module.add_class::<PyKeptMotion>()?;
    module.add_function(wrap_pyfunction!(motion_breaks, module)?)?;
    module.add_function(wrap_pyfunction!(motion_has_kinks, module)?)?;
    module.add_function(wrap_pyfunction!(motion_quadrature, module)?)?;
    module.add_function(wrap_pyfunction!(motion_is_explicit, module)?)?;
    module.add_function(wrap_pyfunction!(motion_directions, module)?)
}

/// (kind, index of body or joint, order, start of a drawn point in x, a drawn point)
type Asked = (String, i64, u8, Option<usize>, Option<[f64; 3]>);

fn quantity(asked: &Asked) -> Result<Quantity> {
    let (kind, index, order, at, fixed) = asked;
    let whole = usize::try_from(*index);
    let some = || whole.map_err(|_| Error::model("a quantity of ground has no such number"));
    Ok(match kind.as_str() {
        "point" => {
            let drawn = match (at, fixed) {
                (Some(x), _) => Drawn::At(*x),
                (None, Some(p)) => Drawn::Fixed(*p),
                (None, None) => Drawn::Origin,
            };
            Quantity::Point(whole.ok(), drawn, *order)
        }
        "rotation" => Quantity::Rotation(some()?),
        "turning" => Quantity::Turning(some()?, *order),
        "joint" => Quantity::Joint(some()?),
        "reaction" => Quantity::Reaction(some()?),
        "modal" => Quantity::Modal(some()?, *order),
        other => return Err(Error::model(format!("no quantity is called '{other}'"))),
    })
}

fn need<'py, T>(options: &Bound<'py, PyDict>, name: &str) -> PyResult<T>
where
    T: for<'a> FromPyObject<'a, 'py, Error = PyErr>,
{
    options
        .get_item(name)?
        .ok_or_else(|| PyErr::from(Error::model(format!("the option '{name}' is missing"))))?
        .extract()
}

/// What both ways share.
struct Task {
    start: Motion<f64>,
    plan: Plan,
    wanted: Vec<Quantity>,
    directions: Vec<Direction>,
    effects: crate::multibody::assemble::Effects,
}

fn task<'py>(
    system: &System,
    q: &PyReadonlyArray1<'py, f64>,
    rate: &PyReadonlyArray1<'py, f64>,
    without: &[String],
    options: &Bound<'py, PyDict>,
) -> PyResult<Task> {
    let mut state = state_of(system, q, rate)?;
    state.rate.resize(system.n_tree(), 0.0);
    let memory: Vec<f64> = need(options, "memory")?;
    let n_memory = system.topology.n_memory;
    let times: Vec<f64> = need(options, "times")?;
    let asked: Vec<Asked> = need(options, "quantities")?;
    let pairs: Vec<(Vec<usize>, Vec<f64>)> = need(options, "directions")?;
    let n_x = system.x.len();
    if pairs.iter().any(|(i, v)| i.len() != v.len() || i.iter().any(|i| *i >= n_x)) {
        return Err(Error::model("a direction does not fit the value vector").into());
    }
    let weight = match need::<String>(options, "weight")?.as_str() {
        "mass" => Weight::Mass,
        _ => Weight::Tangent,
    };
    let rule = rule(&need::<String>(options, "scheme")?, need(options, "rho")?, weight)?;
    let orders: Vec<i32> = need(options, "orders")?;
    let shift: Vec<Vec<f64>> = need(options, "shift")?;
    if !shift.is_empty() && (shift.len() != pairs.len() || shift.iter().any(|s| s.len() != system.n_tree())) {
        return Err(Error::model("the shifts of the start do not fit the directions").into());
    }
    let smooth = stretches(need(options, "smooth")?);
    let anew = breaks(system, &times, smooth.iter().skip(1).map(|s| s.from));
    Ok(Task {
        start: Motion {
            t: times.first().copied().unwrap_or(0.0),
            q: state.q,
            rate: state.rate,
            memory: if memory.len() == n_memory { memory } else { system.topology.at_rest(&[]) },
        },
        plan: Plan {
            kinds: kinds(rule, &times, &orders, &anew)?,
            breaks: system.kinks(times.first().copied().unwrap_or(0.0)),
            smooth,
            times,
            rule,
            keep: need(options, "keep")?,
            read: need(options, "read")?,
            inner: need(options, "inner")?,
            kept: kept(options)?,
            follow: Follow { drawn: need(options, "drawn")?, velocities: need(options, "velocities")?, shift },
        },
        wanted: asked.iter().map(quantity).collect::<Result<_>>()?,
        directions: pairs.into_iter().map(|(i, v)| i.into_iter().zip(v).collect()).collect(),
        effects: effects(without)?.with_exact_tangents(),
    })
}

/// (start, sides: -1, 0, 1) of each stretch between kinks of laws.
fn stretches(all: Vec<(f64, Vec<i8>)>) -> Vec<Smooth> {
    let smooth = |(from, sides): (f64, Vec<i8>)| {
        let sides = sides.into_iter().map(|s| Side::of(f64::from(s))).collect();
        Smooth { from, sides }
    };
    all.into_iter().map(smooth).collect()
}

/// Times at which schemes start anew: breaks and kinks.
fn breaks(system: &System, times: &[f64], kinks: impl Iterator<Item = f64>) -> Vec<f64> {
    let mut all = system.kinks(times.first().copied().unwrap_or(0.0));
    all.extend(kinks);
    all.sort_by(f64::total_cmp);
    all
}

/// The run that chose the steps, where it kept them.
fn kept(options: &Bound<'_, PyDict>) -> PyResult<Option<Arc<KeptMotion>>> {
    let found = options.get_item("kept")?.filter(|kept| !kept.is_none());
    found.map(|kept| Ok(kept.cast::<PyKeptMotion>().map_err(PyErr::from)?.get().0.clone())).transpose()
}

fn begin(eq: &Equations<'_, f64>, task: &Task, counts: &mut Counts) -> Result<Instant> {
    task.plan.check()?;
    if let (Some(start), Some(end)) = (task.plan.times.first(), task.plan.times.last()) {
        no_impact(eq, *start, *end)?;
    }
    let start = first(eq, task.start.clone(), counts)?;
    check(eq, &task.wanted)?;
    Ok(start)
}

/// (t, element, what) of each.
fn listed(kinks: &[Kink]) -> Vec<(f64, String, &'static str)> {
    kinks.iter().map(|k| (k.t, k.element.clone(), k.what)).collect()
}

/// The quadrature of a scheme over a motion: weights of all ends of steps, then of the nodes inside them, whose places in the step
/// (fractions) are the second; `orders` of the steps of "bdf" as the motion gives them, none of fixed ones.
#[pyfunction]
fn motion_quadrature(
    system: PyRef<'_, PySystem>,
    scheme: &str,
    times: Vec<f64>,
    orders: Vec<i32>,
    kinks: Vec<f64>,
) -> PyResult<(Vec<f64>, Vec<f64>)> {
    let rule = rule(scheme, 1.0, Weight::Tangent)?;
    let breaks = breaks(&system.0, &times, kinks.into_iter());
    let kinds = kinds(rule, &times, &orders, &breaks)?;
    let fractions = rule.quadrature().inner.into_iter().map(|(c, _)| c).collect();
    Ok((rule.weights(&times, &kinds), fractions))
}

fn rule(scheme: &str, rho: f64, weight: Weight) -> Result<Rule> {
    match scheme {
        "ali3p" => Ok(Rule::Ali3p(weight)),
        "generalized-alpha" => Ok(Rule::Alpha(rho)),
        "explicit" => Ok(Rule::Explicit),
        "radau" => Ok(Rule::Radau),
        "bdf" => Ok(Rule::Bdf),
        other => Err(Error::model(format!("the scheme '{other}' has no sensitivities"))),
    }
}

/// How each step of "bdf" comes about.
fn kinds(rule: Rule, times: &[f64], orders: &[i32], breaks: &[f64]) -> Result<Vec<Kind>> {
    if !matches!(rule, Rule::Bdf) || times.len() < 2 {
        return Ok(Vec::new());
    }
    // those of fixed steps follow from their lengths
    if orders.first().is_none_or(|o| *o == START) {
        return Ok(Kind::fixed(times, breaks));
    }
    let all: Vec<Kind> = orders.iter().map(|o| Kind::of(*o)).collect();
    if all.len() + 1 != times.len() {
        return Err(Error::model(format!("bdf has {} orders for {} steps", all.len(), times.len() - 1)));
    }
    let bare = |i: &usize| *i == 0 || breaks.contains(&times[*i]) || all[*i - 1] == Kind::Start;
    match (0..all.len()).find(|i| bare(i) && matches!(all[*i], Kind::Goes(_))) {
        None => Ok(all),
        Some(i) => Err(Error::model(format!(
            "the step of bdf from t = {} s has no history, since the motion begins there or a load or a drive is not smooth; \
             its order is {RATES} (from rates) or {START} (by another method)",
            times[i]
        ))),
    }
}

/// Does the explicit scheme serve a motion from this state to `end`, with fixed steps of length `step` if one is given?
#[pyfunction]
#[pyo3(signature = (system, q, rate, memory, without, span, step=None))]
fn motion_is_explicit<'py>(
    system: PyRef<'py, PySystem>,
    q: PyReadonlyArray1<'py, f64>,
    rate: PyReadonlyArray1<'py, f64>,
    memory: Vec<f64>,
    without: Vec<String>,
    span: (f64, f64),
    step: Option<f64>,
) -> PyResult<bool> {
    let system = &system.0;
    let mut state = state_of(system, &q, &rate)?;
    state.rate.resize(system.n_tree(), 0.0);
    let memory = if memory.len() == system.topology.n_memory { memory } else { system.topology.at_rest(&[]) };
    let start = Motion { t: span.0, q: state.q, rate: state.rate, memory };
    let eq = Equations::new(system, system.x.to_vec(), effects(&without)?);
    Ok(explicit_serves(&eq, start, span.1, step, &mut Counts::default())?)
}

/// Have laws sharp kinks, at which the steps of a motion end? Those of one that is differentiated do not end where sliders (`with_sliders`)
/// begin or cease to slide.
#[pyfunction]
fn motion_has_kinks(system: PyRef<'_, PySystem>, without: Vec<String>, with_sliders: bool) -> PyResult<bool> {
    let system = &system.0;
    Ok(Equations::new(system, system.x.to_vec(), effects(&without)?).has_kinks(with_sliders))
}

/// Times after `start` at which a load or a drive is not smooth: a step ends there.
#[pyfunction]
fn motion_breaks(system: PyRef<'_, PySystem>, start: f64) -> Vec<f64> {
    system.0.kinks(start)
}

fn put_instants(out: &Bound<'_, PyDict>, all: &[Instant]) -> PyResult<()> {
    let py = out.py();
    let n = all.len();
    let rows = |of: &dyn Fn(&Instant) -> &[f64]| {
        let width = all.first().map_or(0, |o| of(o).len());
        Array2::from_shape_fn((n, width), |(i, k)| of(&all[i])[k]).into_pyarray(py)
    };
    out.set_item("t", Array1::from_shape_fn(n, |i| all[i].motion.t).into_pyarray(py))?;
    out.set_item("q", rows(&|i| &i.motion.q))?;
    out.set_item("rate", rows(&|i| &i.motion.rate))?;
    out.set_item("memory", rows(&|i| &i.motion.memory))?;
    out.set_item("acceleration", rows(&|i| &i.acceleration))?;
    out.set_item("multipliers", rows(&|i| &i.lam))
}

/// A motion over given step times, quantities at all of them (n_t, n) and their derivatives (n_t, n, n_p) along directions.
/// `options`: times, orders, memory, scheme, rho, weight, keep, drawn, quantities, directions; see mbrs/gradients/gradient.py.
#[pyfunction]
fn motion_directions<'py>(
    py: Python<'py>,
    system: PyRef<'py, PySystem>,
    q: PyReadonlyArray1<'py, f64>,
    rate: PyReadonlyArray1<'py, f64>,
    without: Vec<String>,
    options: &Bound<'py, PyDict>,
) -> PyResult<Bound<'py, PyDict>> {
    let task = task(&system.0, &q, &rate, &without, options)?;
    let (n_p, task_rows) = (task.directions.len(), task.plan.n_values());
    let system = system.0.clone();
    let (found, counts): (Sensitivities, Counts) = interruptible(py, move |cancel| {
        let system = &system;
        let mut counts = Counts::default();
        let systems = systems(system, task.effects, &task.plan.smooth);
        let eqs = Stretches::new(&systems, task.effects, &task.plan.smooth);
        let start = begin(eqs.first(), &task, &mut counts)?;
        let found = direct(&eqs, start, &task.plan, &task.wanted, &task.directions, cancel, &mut counts)?;
        Ok((found, counts))
    })?;
    let out = PyDict::new(py);
    put_instants(&out, &found.instants)?;
    out.set_item("kinks", listed(&found.kinks))?;
    let (n, w) = (task_rows, found.width);
    let (values, derivatives) = (found.values, found.derivatives);
    out.set_item("values", Array2::from_shape_fn((n, w), |(i, k)| values[i * w + k]).into_pyarray(py))?;
    out.set_item(
        "derivatives",
        Array3::from_shape_fn((n, w, n_p), |(i, k, p)| derivatives[(i * w + k) * n_p + p]).into_pyarray(py),
    )?;
    out.set_item("counts", counts_dict(py, &counts)?)?;
    Ok(out)
}

/// Steps of a run that chose them: a motion that is differentiated over them is not made again.
#[pyclass(frozen, name = "KeptMotion", module = "mbrs._core")]
pub struct PyKeptMotion(pub Arc<KeptMotion>);

/// A motion, kept for going backwards.
#[pyclass(frozen, module = "mbrs._core")]
pub struct MotionForward {
    system: System,
    task: Arc<Task>,
    run: Arc<Forward>,
    counts: Counts,
}

#[pymethods]
impl MotionForward {
    /// Arguments as of `motion_directions`; the directions are those of `gradient`.
    #[new]
    fn new(
        py: Python<'_>,
        system: PyRef<'_, PySystem>,
        q: PyReadonlyArray1<'_, f64>,
        rate: PyReadonlyArray1<'_, f64>,
        without: Vec<String>,
        options: &Bound<'_, PyDict>,
    ) -> PyResult<Self> {
        let task = Arc::new(task(&system.0, &q, &rate, &without, options)?);
        let (system, own) = (system.0.clone(), task.clone());
        let inner = system.clone();
        let (run, counts) = interruptible(py, move |cancel| {
            let mut counts = Counts::default();
            let systems = systems(&inner, own.effects, &own.plan.smooth);
            let eqs = Stretches::new(&systems, own.effects, &own.plan.smooth);
            let start = begin(eqs.first(), &own, &mut counts)?;
            let run = forward(&eqs, start, &own.plan, &own.wanted, cancel, &mut counts)?;
            Ok((run, counts))
        })?;
        Ok(MotionForward { system, task, run: Arc::new(run), counts })
    }

    /// (n_r, n) the wanted quantities: at all instants, then at the nodes inside all steps.
    fn values<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        let (n, w) = (self.task.plan.n_values(), self.run.width);
        Array2::from_shape_fn((n, w), |(i, k)| self.run.values[i * w + k]).into_pyarray(py)
    }

    /// (t, element, what) of the kinks that it passed.
    fn kinks(&self) -> Vec<(f64, String, &'static str)> {
        listed(&self.run.kinks)
    }

    /// Work of the way forwards.
    fn counts<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        counts_dict(py, &self.counts)
    }

    /// (n_p,) derivatives of sum(seeds * values), and the work of the way backwards.
    fn gradient<'py>(
        &self,
        py: Python<'py>,
        seeds: PyReadonlyArray2<'py, f64>,
    ) -> PyResult<(Bound<'py, PyArray1<f64>>, Bound<'py, PyDict>)> {
        let (system, task, run) = (self.system.clone(), self.task.clone(), self.run.clone());
        let seeds = seeds.as_array().to_owned();
        if seeds.shape() != [task.plan.n_values(), run.width] {
            return Err(Error::model("the seeds do not fit the motion").into());
        }
        let seeds: Vec<f64> = seeds.iter().copied().collect();
        let (found, counts) = interruptible(py, move |cancel| {
            let mut counts = Counts::default();
            let systems = systems(&system, task.effects, &task.plan.smooth);
            let eqs = Stretches::new(&systems, task.effects, &task.plan.smooth);
            let found = backward(&eqs, &run, &task.plan, &task.wanted, &seeds, &task.directions, cancel, &mut counts)?;
            Ok((found, counts))
        })?;
        Ok((found.into_pyarray(py), counts_dict(py, &counts)?))
    }
}
