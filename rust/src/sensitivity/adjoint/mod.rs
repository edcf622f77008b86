//! The steps backwards: the exact reverse of what `direct` does forwards, whatever the number of parameters.
//!
//! Steps are reversed by hand (`ali3p`, `alpha`, `runge_kutta`, `stages`, `bdf`), what an objective reads on the tape. Instants are kept at
//! checkpoints; a stretch between two is run again.
//!
//! | file | |
//! |---|---|
//! | `ali3p`, `alpha`, `runge_kutta`, `stages`, `bdf`, `closing`, `by_hand`, `increments` | a step backwards |
//! | `recorder` | quantities, memories and the geometry backwards, on the tape |
mod ali3p;
mod alpha;
mod bdf;
mod by_hand;
mod closing;
mod increments;
mod recorder;
mod runge_kutta;
mod stages;

use crate::error::{Error, Result};
use crate::integrate::kept::KeptSteps;
use crate::integrate::{Equations, Instant};
use crate::run::{Cancel, Counts};

use self::recorder::{Adjoint, Recorder, opened_back, seed};
use super::kinks::{Kink, Watch};
use super::march::{Here, Made, March, Rule};
use super::quantity::{Quantity, read};
use super::stages::Probes;
use super::start::Starting;
use super::stretches::Stretches;
use super::{Direction, Plan};

/// The first instant: accelerations and multipliers backwards; what is left are adjoints of coordinates and rates.
fn first_back(
    recorder: &mut Recorder<'_>,
    starting: &Starting<'_>,
    first: &Instant,
    mut at: Adjoint,
) -> Result<Adjoint> {
    at.first();
    let mut before = at.clone();
    let solved = closing::by_saddle(starting.accelerating(), &at)?;
    closing::accelerations_back(recorder, &first.motion, first, solved, &mut at, &mut before);
    Ok(at)
}

/// The motion with its values, kept for going back.
pub struct Forward {
    pub values: Vec<f64>,
    pub width: usize,
    /// the steps are those of the plan
    is_kept: bool,
    every: usize,
    /// the first instant, before the states of laws at rest are told apart from it
    start: Here,
    checkpoints: Vec<Here>,
    /// all of a short motion
    whole: Option<Stretch>,
    pub kinks: Vec<Kink>,
}

/// A step, and its end where the scheme then started anew.
type Gone = (Made, Option<Here>);

struct Stretch {
    places: Vec<Here>,
    steps: Vec<Gone>,
}

impl Stretch {
    fn at(first: &Here) -> Self {
        Stretch { places: vec![first.clone()], steps: Vec::new() }
    }
}

/// Steps between checkpoints: all of a motion that may be kept whole, else so many that checkpoints and the stretch between two of
/// them need about the same.
fn stride(eq: &Equations<'_, f64>, plan: &Plan) -> usize {
    let n = plan.n_steps();
    let [place, step] = plan.rule.numbers(eq);
    if n * step <= plan.keep {
        return n.max(1);
    }
    let balanced = (n as f64 * place as f64 / step as f64).sqrt().ceil() as usize;
    balanced.clamp(1, n)
}

/// The motion forwards, with its values at all instants.
pub fn forward(
    eqs: &Stretches<'_>,
    first: Instant,
    plan: &Plan,
    wanted: &[Quantity],
    cancel: &Cancel,
    counts: &mut Counts,
) -> Result<Forward> {
    plan.check()?;
    let (n, eq) = (plan.n_steps(), eqs.first());
    let every = stride(eq, plan);
    let start = Here::first(first, plan.rule);
    let mut here = match plan.rule.opens_states() {
        true => start.clone(),
        false => start.opened(eq, 0.0).into_owned(),
    };
    let mut out = Forward {
        values: Vec::new(),
        width: wanted.iter().map(|q| q.width(eq)).sum(),
        is_kept: false,
        every,
        start,
        checkpoints: Vec::new(),
        kinks: Vec::new(),
        whole: (every >= n).then(|| Stretch::at(&here)),
    };
    let mut inner = Vec::new();
    let kept = plan.kept_from(eq, &here, counts);
    out.is_kept = kept.is_some();
    let (mut march, mut watch) = (March::new(eqs, plan, kept), Watch::new(eq, &here.instant, !plan.smooth.is_empty()));
    for i in 0..=n {
        if i > 0 {
            let (end, gone) = stepped(&mut march, i - 1, &here, cancel, counts)?;
            watch.pass(&here.instant, &end.instant);
            let read_inside = inner.len() + plan.n_inner() * out.width;
            for at in gone.0.inner().into_iter().filter(|_| plan.inner) {
                inner.extend(read(eq, at, wanted)?);
            }
            inner.resize(read_inside, 0.0);
            if let Some(whole) = &mut out.whole {
                whole.places.push(end.clone());
                whole.steps.push(gone);
            }
            here = end;
        }
        if i % every == 0 && i < n.max(1) {
            out.checkpoints.push(here.clone());
            march.forget();
        }
        out.values.extend(read(eq, &here.instant, wanted)?);
    }
    out.values.extend(inner);
    out.kinks = watch.found;
    counts.add("checkpoints", out.checkpoints.len() as u64);
    let whole = out.whole.as_ref().map_or(0, |w| w.steps.len());
    counts.add("stored states", (out.checkpoints.len() + whole) as u64);
    Ok(out)
}

/// The next place, and how it came about.
fn stepped(march: &mut March<'_>, i: usize, from: &Here, cancel: &Cancel, counts: &mut Counts) -> Result<(Here, Gone)> {
    let (end, made) = march.step(i, from, cancel, counts)?;
    Ok(match march.anew(i, &end, counts)? {
        None => (end, (made, None)),
        Some(anew) => (anew, (made, Some(end))),
    })
}

fn repeat(
    eqs: &Stretches<'_>,
    plan: &Plan,
    (from, kept): (&Here, Option<&KeptSteps>),
    steps: std::ops::Range<usize>,
    cancel: &Cancel,
    counts: &mut Counts,
) -> Result<Stretch> {
    let mut out = Stretch::at(from);
    let mut march = March::new(eqs, plan, kept);
    for (k, i) in steps.enumerate() {
        let (end, gone) = stepped(&mut march, i, &out.places[k], cancel, counts)?;
        out.places.push(end);
        out.steps.push(gone);
    }
    Ok(out)
}

/// Derivatives of sum(seeds * values) along directions, for one set of seeds (n_r, width).
#[allow(clippy::too_many_arguments)]
pub fn backward(
    eqs: &Stretches<'_>,
    run: &Forward,
    plan: &Plan,
    wanted: &[Quantity],
    seeds: &[f64],
    directions: &[Direction],
    cancel: &Cancel,
    counts: &mut Counts,
) -> Result<Vec<f64>> {
    let (n, w) = (plan.n_steps(), run.width);
    let last = eqs.from(plan.times[n]);
    let mut recorder = Recorder::new(last);
    let mut probes = Probes::of(last, plan.rule);
    let first = &run.checkpoints[0];
    let mut at = Adjoint::none(first);
    let mut longest = 0;
    let kept = plan.kept.as_ref().filter(|_| run.is_kept).map(|k| &k.steps);
    for (k, checkpoint) in run.checkpoints.iter().enumerate().rev() {
        let (a, b) = (k * run.every, ((k + 1) * run.every).min(n));
        let again;
        let stretch = match &run.whole {
            Some(whole) => whole,
            None => {
                again = repeat(eqs, plan, (checkpoint, kept), a..b, cancel, counts)?;
                longest = longest.max(again.steps.len());
                &again
            }
        };
        for i in (a..b).rev() {
            cancel.check()?;
            let (from, end) = (&stretch.places[i - a], &stretch.places[i - a + 1]);
            let own = &seeds[(i + 1) * w..(i + 2) * w];
            seed(&mut recorder, &end.instant, wanted, own, &mut at)?;
            counts.add("adjoint steps", 1);
            let (made, before) = &stretch.steps[i - a];
            let end = match before {
                None => end,
                Some(before) => {
                    at = alpha::anew_back(&mut recorder, before, end, at)?;
                    before
                }
            };
            let eq = eqs.from(plan.times[i]);
            if recorder.over(eq) {
                probes = Probes::of(eq, plan.rule);
            }
            let start = &*made.start(eq, from);
            let inner = plan.inner_row(i);
            let mut own = |recorder: &mut Recorder<'_>, stage: usize, here: &Instant, onto: &mut Adjoint| {
                let Some(k) = made.node_of(stage).filter(|_| plan.inner) else { return Ok(()) };
                seed(recorder, here, wanted, &seeds[(inner + k) * w..(inner + k + 1) * w], onto)
            };
            at = match (made, plan.rule) {
                (Made::Ali3p(record, by), Rule::Ali3p(weight)) => {
                    let parts = (record, by.as_ref());
                    ali3p::step_back(&mut recorder, (start, end), parts, weight, at)?
                }
                (Made::Alpha(p, h), _) => alpha::step_back(&mut recorder, start, end, *p, *h, at, counts)?,
                (Made::RungeKutta(stages), _) => {
                    runge_kutta::step_back(&mut recorder, (start, end), stages, at, &mut own)?
                }
                (Made::Radau(stages), _) => {
                    let past = at.past.take();
                    let Some(probe) = &probes.radau else { return Err(unprepared()) };
                    let mut before =
                        stages::radau_back(&mut recorder, (start, end), (stages, probe), at, &mut own, counts)?;
                    before.past = past.map(|mut past| {
                        bdf::pointed_back(eq, &start.instant.motion, &mut past, &mut before);
                        past
                    });
                    before
                }
                (Made::Bdf(stages, step), _) => {
                    let Some(probe) = &probes.bdf else { return Err(unprepared()) };
                    bdf::step_back(&mut recorder, (start, end), (stages, step, probe), at, counts)?
                }
                _ => at,
            };
            if eq.has_state_rates() && plan.rule.opens_states() {
                opened_back(&mut recorder, from, made.length(), &mut at);
            }
        }
    }
    counts.add("stored states", longest as u64);
    seed(&mut recorder, &first.instant, wanted, &seeds[..w], &mut at)?;
    let (start, eq) = (&run.start, eqs.first());
    recorder.over(eq);
    if eq.has_state_rates() && !plan.rule.opens_states() {
        opened_back(&mut recorder, start, 0.0, &mut at);
    }
    let starting = Starting::new(eq, &start.instant, &plan.follow)?;
    let at = first_back(&mut recorder, &starting, &start.instant, at)?;
    let numbers = recorder.numbers();
    directions
        .iter()
        .enumerate()
        .map(|(p, direction)| {
            let mut d: f64 = direction.iter().map(|(i, v)| numbers[*i] * v).sum();
            if !starting.is_constant() {
                d += starting.weighed(eq, direction, p, &at.q, &at.rate)?;
            }
            Ok(d)
        })
        .collect()
}

fn unprepared() -> Error {
    Error::model("a step was not prepared for its derivative")
}
