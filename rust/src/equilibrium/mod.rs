//! Static equilibrium, also of closed loops: B''^T rho(y) = 0, Phi(y) = 0.
//!
//! Newton with the absolute values of the stiffness eigenvalues (so that each step goes downhill in energy and ends at a stable
//! equilibrium wherever the drawn state is not already in balance), a line search on the force along the step or on the next
//! step, and where that stalls dynamic relaxation: implicit steps of (K + sigma M) with sigma falling as the residual does. What has
//! shortened many steps goes on by descent in energy (`descent`).
pub mod descent;
pub mod distance;
pub mod follow;
pub mod followers;
pub mod local;
pub mod newton;
pub mod steering;

use nalgebra::DVector;

use crate::constraint::closure::close;
use crate::equilibrium::descent::{Descent, same_coordinates};
use crate::equilibrium::distance::distance;
use crate::equilibrium::local::{LONGEST_STEP, Local, Spectrum, moved, spectrum};
use crate::equilibrium::newton::{initial_sigma, newton_answer, newton_step, pushed_freely};
use crate::equilibrium::steering::steering_joints;
use crate::error::{Error, Result};
use crate::linearize::{Linearization, Setting, linearize};
use crate::multibody::System;
use crate::multibody::assemble::Effects;
use crate::multibody::placement::State;
use crate::run::{Cancel, Counts};
use crate::tolerances::equilibrium::{BALANCED, CLOSE, NEARLY_BALANCED, PUSHED, SETTLED};
use crate::tolerances::matrices::NAMED;

const MAX_ITERATIONS: usize = 400;
/// Iterations, and steps that were shortened, after which descent in energy takes over from Newton's method.
const QUICK: usize = 40;
const SHORTENED: u64 = 12;
/// Iterations that a force may push along a direction without stiffness before that is an error.
const PATIENCE: usize = 25;
/// A saddle that the search ran into is left by a push of this size downhill, at most so many times.
const PUSH: f64 = 0.05;
const MAX_PUSHES: usize = 20;

/// A place at which all forces balance, and how well it is known.
pub struct Equilibrium {
    /// the place
    pub state: State,
    /// the matrices there
    pub linearization: Linearization,
    /// largest unbalanced generalised force over the size of all forces
    pub residual: f64,
    /// estimated distance to the exact equilibrium, radians or characteristic lengths
    pub error: f64,
    /// steps of the search
    pub iterations: usize,
    /// no displacement has a negative stiffness beyond rounding
    pub stable: bool,
    /// names of the coordinates that dominate each unrestrained direction
    pub free_directions: Vec<String>,
    /// joints that hold the place by a force, though it could be any other of a family
    pub family: Vec<String>,
    /// coordinates along which the force that is left over counts as a push: stiffness makes more of the rounding of places
    pub unresolved: Option<String>,
}

fn shortened(counts: &Counts) -> u64 {
    counts.0.get("line-search steps").copied().unwrap_or(0)
}

/// Where velocity rows steer, every place can be reached, and rest is where they carry no force; where nothing but them restrains a
/// direction, they hold what the search finds, one of a family.
pub fn equilibrium(
    system: &System,
    start: &State,
    effects: Effects,
    cancel: &Cancel,
    counts: &mut Counts,
) -> Result<Equilibrium> {
    if !effects.nonholonomic || !system.topology.has_velocity_rows() {
        return search(system, start, effects, cancel, counts);
    }
    let still = State { q: start.q.clone(), rate: Vec::new() };
    let setting = at_rest(system, &still, effects);
    let edges = linearize(&setting, counts).map_or_else(|_| Vec::new(), |made| steering_joints(&setting, &made));
    let free = Effects { nonholonomic: false, ..effects };
    if edges.is_empty() {
        return search(system, start, effects, cancel, counts);
    }
    match search(system, start, free, cancel, counts) {
        Ok(found) => {
            let held = search(system, &found.state, effects, cancel, counts)?;
            Ok(Equilibrium { stable: found.stable, iterations: found.iterations + held.iterations, ..held })
        }
        Err(Error::Singular(_) | Error::Convergence { .. } | Error::Assembly(_)) => {
            let held = search(system, start, effects, cancel, counts)?;
            let carries = Local::at(system, &held.state, free, counts).map_or(true, |l| l.unbalance() > PUSHED);
            Ok(Equilibrium { family: if carries { edges } else { Vec::new() }, ..held })
        }
        Err(other) => Err(other),
    }
}

fn search(
    system: &System,
    start: &State,
    effects: Effects,
    cancel: &Cancel,
    counts: &mut Counts,
) -> Result<Equilibrium> {
    let mut state = State { q: start.q.clone(), rate: Vec::new() };
    // the place of other parameters, or another time of drives: forces may balance there with loops open
    close(system, &mut state, effects, counts)?;
    let mut local = Local::at(system, &state, effects, counts)?;
    let (mut sigma, mut pushed, mut saddles) = (0.0, 0, 0);
    let mut best = (f64::INFINITY, state.clone());
    let mut descent = None;
    let before = shortened(counts);
    // the last step was shortened
    let mut is_slow = false;
    for iteration in 0..MAX_ITERATIONS {
        let careful = iteration >= QUICK || shortened(counts) > before + SHORTENED;
        cancel.check()?;
        counts.add("equilibrium iterations", 1);
        let residual = local.unbalance();
        if residual < best.0 {
            best = (residual, state.clone());
        }
        let spectrum = spectrum(&local)?;
        // no stiffness against a force: relax, since it may come with the motion (a pendulum drawn level); where it does not
        // come, nothing restrains the model
        let freely = pushed_freely(&local, &spectrum)?;
        if let Some(direction) = &freely {
            pushed += 1;
            sigma = f64::max(sigma, initial_sigma(&local));
            if pushed > PATIENCE {
                return Err(unrestrained(system, &local, direction));
            }
        }
        // where Newton's step is short relaxation has done its work
        let short = |step: &DVector<f64>| sigma == 0.0 || freely.is_none() && step.amax() <= CLOSE;
        let plain = newton_step(&local, &spectrum, 0.0).ok();
        // a step that relaxation keeps short says nothing of the distance
        let is_far = plain.as_ref().is_none_or(|step| step.amax() > CLOSE);
        let plain = plain.filter(short);
        if plain.is_some() {
            sigma = 0.0;
        }
        let step = plain.map_or_else(|| newton_step(&local, &spectrum, sigma), Ok)?;
        // of such a step the square is left
        let near = residual <= NEARLY_BALANCED && step.amax() <= f64::EPSILON.sqrt();
        let done = residual <= BALANCED || step.amax() <= BALANCED || near;
        if done || local.is_rounding(&at_rest(system, &state, effects)) {
            if residual > 4.0 * f64::EPSILON && residual.is_finite() {
                // one last step costs nothing and takes the iterate to rounding level
                let polished = moved(system, &state, &local, &step, 1.0, effects, counts)?;
                let next = Local::at(system, &polished, effects, counts)?;
                let left = next.unbalance();
                // rounding in stiff parts hides in the forces what soft ones have still to go
                let shorter = same_coordinates(system, &local, &next)
                    && newton_answer(&local, &spectrum, &next.r).is_ok_and(|s| s.amax() < SETTLED * step.amax());
                let shorter = shorter && (next.unresolved().is_none() || local.unresolved().is_some());
                if left <= residual || shorter {
                    state = polished;
                    local = next;
                }
                if !done && (left < SETTLED * residual || shorter) {
                    continue;
                }
            }
            // where the drawn state was in balance its balance is the answer, stable or not; a saddle on the way is not
            if iteration > 0
                && saddles < MAX_PUSHES
                && let Some((next_state, next)) = leave_saddle(system, &state, &local, effects, counts)?
            {
                saddles += 1;
                state = next_state;
                local = next;
                sigma = 0.0;
                continue;
            }
            return finish(system, state, local, effects, iteration);
        }
        if careful
            && (is_far || is_slow)
            && let Some((lower, there)) =
                descent.get_or_insert_with(|| Descent::new(system, effects)).step(&state, &local, &spectrum, counts)?
        {
            (state, local, sigma) = (lower, there, 0.0);
            continue;
        }
        let already = shortened(counts);
        let (next_state, next, relaxed) = advance_once(system, &state, &local, &spectrum, sigma, effects, counts)?;
        sigma = if relaxed {
            next.r.norm() / local.r.norm().max(f64::MIN_POSITIVE) * sigma.max(initial_sigma(&local))
        } else {
            0.0
        };
        is_slow = shortened(counts) > already;
        state = next_state;
        local = next;
    }
    Err(Error::Convergence {
        message: format!(
            "no equilibrium was found within {MAX_ITERATIONS} iterations: the best unbalanced force is {:.1e} of the applied ones; start from a state closer \
             to it (draw the model there), or add stiffness where the model is a mechanism",
            best.0
        ),
        best: best.1.q.clone(),
        residual: best.0,
    })
}

/// A state beside an unstable one, along its most negative stiffness; None where it is stable or has no potential.
fn leave_saddle(
    system: &System,
    state: &State,
    local: &Local,
    effects: Effects,
    counts: &mut Counts,
) -> Result<Option<(State, Local)>> {
    let spectrum = spectrum(local)?;
    if !local.conservative() || spectrum.stable() {
        return Ok(None);
    }
    let v = spectrum.vectors.column(0).into_owned();
    for size in [PUSH, -PUSH, 0.1 * PUSH, -0.1 * PUSH] {
        let push = &v * (size / v.amax());
        if let Ok(beside) = moved(system, state, local, &push, 1.0, effects, counts)
            && let Ok(next) = Local::at(system, &beside, effects, counts)
        {
            counts.add("saddles left", 1);
            return Ok(Some((beside, next)));
        }
    }
    Ok(None)
}

/// One accepted step: full or shortened, or of the relaxation; the flag says which.
fn advance_once(
    system: &System,
    state: &State,
    local: &Local,
    spectrum: &Spectrum,
    sigma: f64,
    effects: Effects,
    counts: &mut Counts,
) -> Result<(State, Local, bool)> {
    let mut sigma = sigma;
    let mut last = None;
    for attempt in 0..40 {
        let step = newton_step(local, spectrum, sigma)?;
        if step.amax() == 0.0 {
            let direction = pushed_freely(local, spectrum)?.unwrap_or_else(|| local.r.clone());
            return Err(unrestrained(system, local, &direction));
        }
        let mut alpha = (LONGEST_STEP / step.amax()).min(1.0);
        for _ in 0..8 {
            let trial = moved(system, state, local, &step, alpha, effects, counts)
                .and_then(|s| Local::at(system, &s, effects, counts).map(|l| (s, l)));
            match trial {
                Ok((next_state, next))
                    if acceptable(local, &next, &step)
                        || sigma == 0.0 && nearer(system, local, &next, spectrum, &step, alpha) =>
                {
                    return Ok((next_state, next, sigma > 0.0));
                }
                Ok(pair) => last = Some(pair),
                // a step that tears a loop open is too long
                Err(Error::Assembly(_) | Error::Singular(_)) => {}
                Err(other) => return Err(other),
            }
            alpha *= 0.4;
            counts.add("line-search steps", 1);
        }
        counts.add("relaxation steps", 1);
        sigma = if sigma > 0.0 { 10.0 * sigma } else { initial_sigma(local) };
        if attempt > 25 && last.is_some() {
            break;
        }
    }
    match last {
        Some((s, l)) => Ok((s, l, true)),
        None => Err(Error::singular(
            "no step keeps the loops closed: the mechanism is locked or at the border of its range",
        )),
    }
}

/// The force along the step must not have grown, nor turned against it by more than half; without a potential its norm must fall.
fn acceptable(local: &Local, next: &Local, step: &DVector<f64>) -> bool {
    if !next.r.iter().all(|v| v.is_finite()) {
        return false;
    }
    let (here, there) = (local.relative(&local.r), local.relative(&next.r));
    if there <= 0.7 * here {
        return true;
    }
    if !local.may_be_conservative() || next.r.len() != local.r.len() {
        return there < here;
    }
    let (before, after) = (local.r.dot(step), next.r.dot(step));
    before < 0.0 && after <= 0.5 * before.abs()
}

/// The full step from the next state, by the old stiffness, is shorter (the natural monotonicity test of P. Deuflhard, Newton Methods
/// for Nonlinear Problems, Springer 2004, eq. 3.21): straight steps stretch what is stiff on curved paths, and that
/// raises forces and energy without being far from balance.
fn nearer(system: &System, local: &Local, next: &Local, spectrum: &Spectrum, step: &DVector<f64>, alpha: f64) -> bool {
    if !same_coordinates(system, local, next) {
        return false;
    }
    let ahead = newton_answer(local, spectrum, &next.r);
    ahead.is_ok_and(|ahead| ahead.norm() <= (1.0 - 0.25 * alpha) * step.norm())
}

/// What keeps a direction from being in balance, said by the names of its largest coordinates.
fn direction_names(system: &System, local: &Local, v: &DVector<f64>) -> String {
    let coordinates = local.linearization.coordinates(system.n_tree());
    let mut order: Vec<usize> = (0..v.len()).collect();
    order.sort_by(|a, b| v[*b].abs().total_cmp(&v[*a].abs()));
    let largest = order.first().map_or(0.0, |i| v[*i].abs());
    let named = order.iter().take(3).filter(|i| v[**i].abs() >= NAMED * largest);
    named.map(|i| system.topology.names[coordinates[*i]].clone()).collect::<Vec<_>>().join(" + ")
}

fn unrestrained(system: &System, local: &Local, direction: &DVector<f64>) -> Error {
    let name = direction_names(system, local, direction);
    Error::singular(format!(
        "nothing restrains the direction {name} but a force acts along it: add a spring, a joint or an opposing force"
    ))
}

fn at_rest<'a>(system: &'a System, state: &'a State, effects: Effects) -> Setting<'a> {
    Setting { system, state, memory: &[], acceleration: &[], effects }
}

fn finish(system: &System, state: State, local: Local, effects: Effects, iterations: usize) -> Result<Equilibrium> {
    let spectrum = spectrum(&local)?;
    if let Some(direction) = pushed_freely(&local, &spectrum)? {
        return Err(unrestrained(system, &local, &direction));
    }
    let free = (0..spectrum.values.len()).filter(|k| !spectrum.is_held(*k));
    let free_directions =
        free.map(|k| direction_names(system, &local, &spectrum.vectors.column(k).into_owned())).collect();
    let error = distance(&at_rest(system, &state, effects), &local, &spectrum).unwrap_or(f64::NAN);
    let stable = spectrum.stable();
    let residual = local.unbalance();
    let unresolved = local.unresolved().map(|left| direction_names(system, &local, &left));
    let (family, linearization) = (Vec::new(), local.linearization);
    Ok(Equilibrium { state, residual, error, iterations, stable, free_directions, family, unresolved, linearization })
}

/// The largest force that is left over at a state at rest, over the size of the forces of its island.
pub fn unbalance(system: &System, state: &State, effects: Effects) -> Result<f64> {
    Ok(Local::at(system, state, effects, &mut Counts::default())?.unbalance())
}
