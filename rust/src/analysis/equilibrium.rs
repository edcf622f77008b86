//! Static equilibrium, also of closed loops: B''^T rho(y) = 0, Phi(y) = 0.
//!
//! Newton with the absolute values of the stiffness eigenvalues (so that each step goes downhill in energy and ends at a stable
//! equilibrium wherever the drawn state is not already in balance), a line search on the force along the step or on the next
//! step, and where that stalls dynamic relaxation: implicit steps of (K + sigma M) with sigma falling as the residual does. What has
//! shortened many steps goes on by descent in energy (`equilibrium_descent`).
use faer::Side;
use faer::prelude::*;
use nalgebra::{DMatrix, DVector};

use crate::analysis::equilibrium_descent::{Descent, same_coordinates};
use crate::analysis::linearize::{Linearization, Setting, linearize};
use crate::error::{Error, Result};
use crate::run::{Cancel, Counts};
use crate::system::System;
use crate::system::assemble::Effects;
use crate::system::closure::close;
use crate::system::loops::column_scales;
use crate::system::placement::{State, advance};

const MAX_ITERATIONS: usize = 400;
/// Iterations, and steps that were shortened, after which descent in energy takes over from Newton's method.
const QUICK: usize = 40;
const SHORTENED: u64 = 12;
/// A Newton step, radians or characteristic lengths, so close to the balance that Newton's method is the right one: energies do not
/// resolve more, and loads without a potential have none.
const CLOSE: f64 = 1e-3;
/// Stiffness below this part of the largest counts as none.
const NO_STIFFNESS: f64 = 1e-12;
/// What rounding usually leaves of a balance of forces, and of a pose, relative to their sizes.
const ROUNDING: f64 = 0.05 * f64::EPSILON;
/// Iterations that a force may push along a direction without stiffness before that is an error.
const PATIENCE: usize = 25;
/// Longest step, radians or characteristic lengths.
pub(super) const LONGEST_STEP: f64 = 0.4;
/// A saddle that the search ran into is left by a push of this size downhill, at most so many times.
const PUSH: f64 = 0.05;
const MAX_PUSHES: usize = 20;

pub struct Equilibrium {
    pub state: State,
    pub linearization: Linearization,
    /// largest unbalanced generalised force over the size of all forces
    pub residual: f64,
    /// estimated distance to the exact equilibrium, radians or characteristic lengths
    pub error: f64,
    pub iterations: usize,
    pub stable: bool,
    /// names of the coordinates that dominate each unrestrained direction
    pub free_directions: Vec<String>,
}

/// The scaled problem at one iterate: K and r over coordinates of the order of a radian.
pub(super) struct Local {
    pub k: DMatrix<f64>,
    m: DMatrix<f64>,
    pub r: DVector<f64>,
    scale: Vec<f64>,
    pub linearization: Linearization,
}

impl Local {
    pub fn at(system: &System, state: &State, effects: Effects, counts: &mut Counts) -> Result<Local> {
        let linearization = linearize(&Setting { system, state, memory: &[], acceleration: &[], effects }, counts)?;
        let all = column_scales(&system.topology, system.length);
        let scale: Vec<f64> = linearization.coordinates(system.n_tree()).iter().map(|i| all[*i]).collect();
        let n = scale.len();
        let scaled = |x: &DMatrix<f64>| DMatrix::from_fn(n, n, |i, j| x[(i, j)] * scale[i] * scale[j]);
        let (k, m) = (scaled(&linearization.matrices.stiffness), scaled(&linearization.matrices.mass));
        let r = DVector::from_fn(n, |i, _| linearization.residual[i] * scale[i]);
        Ok(Local { k, m, r, scale, linearization })
    }

    fn skew(&self) -> f64 {
        (&self.k - self.k.transpose()).amax()
    }

    fn conservative(&self) -> bool {
        self.skew() <= 1e-7 * self.k.amax()
    }

    /// Off balance rotations about three axes make K skew by the moments that are left: no sign of missing potential.
    fn may_be_conservative(&self) -> bool {
        self.skew() <= 1e-7 * self.k.amax() + 2.0 * self.r.amax()
    }
}

pub(super) struct Spectrum {
    pub values: Vec<f64>,
    pub vectors: DMatrix<f64>,
    pub none: f64,
}

impl Spectrum {
    /// The largest displacement that forces of this size and no particular direction make.
    fn answer_to(&self, force: f64) -> f64 {
        let held = |k: &usize| self.values[*k].abs() > self.none;
        let square = |i: usize| -> f64 {
            let softness = |k: usize| (self.vectors[(i, k)] / self.values[k]).powi(2);
            (0..self.values.len()).filter(held).map(softness).sum()
        };
        let largest = (0..self.values.len()).map(square).fold(0.0, f64::max);
        force * largest.sqrt()
    }

    /// No stiffness is negative beyond rounding.
    fn stable(&self) -> bool {
        let largest = self.values.iter().fold(0.0, |m: f64, v| m.max(v.abs()));
        self.values.iter().all(|v| *v >= -1e-9 * largest)
    }
}

/// Eigenvalues in ascending order.
fn spectrum(k: &DMatrix<f64>) -> Result<Spectrum> {
    let n = k.nrows();
    if n == 0 {
        return Ok(Spectrum { values: Vec::new(), vectors: DMatrix::zeros(0, 0), none: 0.0 });
    }
    let a = Mat::from_fn(n, n, |i, j| 0.5 * (k[(i, j)] + k[(j, i)]));
    let eigen = a
        .self_adjoint_eigen(Side::Lower)
        .map_err(|_| Error::singular("the stiffness has no eigenvalues: it is not finite"))?;
    let values: Vec<f64> = (0..n).map(|i| eigen.S().column_vector()[i]).collect();
    let vectors = DMatrix::from_fn(n, n, |i, j| eigen.U()[(i, j)]);
    let none = NO_STIFFNESS * values.iter().fold(0.0, |m: f64, v| m.max(v.abs()));
    Ok(Spectrum { values, vectors, none })
}

fn shortened(counts: &Counts) -> u64 {
    counts.0.get("line-search steps").copied().unwrap_or(0)
}

pub fn equilibrium(
    system: &System,
    start: &State,
    effects: Effects,
    cancel: &Cancel,
    counts: &mut Counts,
) -> Result<Equilibrium> {
    let mut state = State { q: start.q.clone(), rate: Vec::new() };
    let mut local = Local::at(system, &state, effects, counts)?;
    let (mut sigma, mut pushed, mut saddles) = (0.0, 0, 0);
    let mut best = (f64::INFINITY, state.clone());
    let mut descent = None;
    let before = shortened(counts);
    for iteration in 0..MAX_ITERATIONS {
        let careful = iteration >= QUICK || shortened(counts) > before + SHORTENED;
        cancel.check()?;
        counts.add("equilibrium iterations", 1);
        let size = local.linearization.force_scale.max(f64::MIN_POSITIVE);
        let residual = local.r.amax() / size;
        if residual < best.0 {
            best = (residual, state.clone());
        }
        let spectrum = spectrum(&local.k)?;
        // no stiffness against a force: relax, since it may come with the motion (a pendulum drawn level); where it does not
        // come, nothing restrains the model
        if pushed_freely(&local, &spectrum, size) {
            pushed += 1;
            sigma = f64::max(sigma, initial_sigma(&local));
            if pushed > PATIENCE {
                return Err(unrestrained(system, &local, &spectrum));
            }
        }
        let step = newton_step(&local, &spectrum, sigma)?;
        let rounding = residual <= 1e-11 && step.amax() <= 1e-9;
        if residual <= 1e-14 || step.amax() <= 1e-14 || rounding {
            if residual > 1e-15 && residual.is_finite() {
                // one last step costs nothing and takes the iterate to rounding level
                let polished = moved(system, &state, &local, &step, 1.0, effects, counts)?;
                let next = Local::at(system, &polished, effects, counts)?;
                if next.r.amax() <= local.r.amax() {
                    state = polished;
                    local = next;
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
            return finish(system, state, local, size, iteration);
        }
        if careful
            && step.amax() > CLOSE
            && let Some((lower, there)) =
                descent.get_or_insert_with(|| Descent::new(system, effects)).step(&state, &local, &spectrum, counts)?
        {
            (state, local, sigma) = (lower, there, 0.0);
            continue;
        }
        let (next_state, next, relaxed) = advance_once(system, &state, &local, &spectrum, sigma, effects, counts)?;
        sigma = if relaxed {
            next.r.norm() / local.r.norm().max(f64::MIN_POSITIVE) * sigma.max(initial_sigma(&local))
        } else {
            0.0
        };
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
    let spectrum = spectrum(&local.k)?;
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

fn pushed_freely(local: &Local, spectrum: &Spectrum, size: f64) -> bool {
    let free = (0..spectrum.values.len()).filter(|k| spectrum.values[*k].abs() <= spectrum.none);
    free.into_iter().any(|k| spectrum.vectors.column(k).dot(&local.r).abs() > 1e-9 * size)
}

fn initial_sigma(local: &Local) -> f64 {
    let m = local.m.diagonal().amax().max(f64::MIN_POSITIVE);
    local.k.amax().max(local.r.amax()) / m
}

/// -K^-1 r; along negative stiffness downhill, along none not at all.
fn newton_step(local: &Local, spectrum: &Spectrum, sigma: f64) -> Result<DVector<f64>> {
    if sigma > 0.0 {
        let a = &local.k + &local.m * sigma;
        if let Some(step) = a.lu().solve(&-&local.r).filter(|s| s.iter().all(|v| v.is_finite())) {
            return Ok(step);
        }
    }
    newton_answer(local, spectrum, &local.r)
}

fn newton_answer(local: &Local, spectrum: &Spectrum, r: &DVector<f64>) -> Result<DVector<f64>> {
    // K itself where it leads downhill anyway; its symmetric part where that decides about up and down
    let definite = spectrum.values.first().is_some_and(|v| *v > spectrum.none);
    if !local.conservative() && (definite || !local.may_be_conservative()) {
        let step = local.k.clone().lu().solve(&-r).filter(|s| s.iter().all(|v| v.is_finite()));
        return step.ok_or_else(|| {
            Error::singular("the tangent stiffness is singular under follower loads; restrain the model")
        });
    }
    let mut step = DVector::zeros(r.len());
    for (k, value) in spectrum.values.iter().enumerate() {
        if value.abs() > spectrum.none {
            let v = spectrum.vectors.column(k);
            step -= v * (v.dot(r) / value.abs());
        }
    }
    Ok(step)
}

pub(super) fn moved(
    system: &System,
    state: &State,
    local: &Local,
    step: &DVector<f64>,
    alpha: f64,
    effects: Effects,
    counts: &mut Counts,
) -> Result<State> {
    let z = DVector::from_fn(step.len(), |i, _| step[i] * alpha * local.scale[i]);
    let dy = match (&local.linearization.loops, &local.linearization.dependent_map) {
        (Some(l), Some(b)) => l.expand(b, &z),
        _ => z,
    };
    let mut next = state.clone();
    advance(&system.topology, &mut next.q, dy.as_slice());
    close(system, &mut next, effects, counts)?;
    Ok(next)
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
            return Err(unrestrained(system, local, spectrum));
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
    if next.r.norm() <= 0.7 * local.r.norm() {
        return true;
    }
    if !local.may_be_conservative() || next.r.len() != local.r.len() {
        return next.r.norm() < local.r.norm();
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
    let named = order.iter().take(3).filter(|i| v[**i].abs() > 0.3 * largest);
    named.map(|i| system.topology.names[coordinates[*i]].clone()).collect::<Vec<_>>().join(" + ")
}

fn unrestrained(system: &System, local: &Local, spectrum: &Spectrum) -> Error {
    let free = (0..spectrum.values.len()).filter(|k| spectrum.values[*k].abs() <= spectrum.none);
    let pushed = free.max_by(|a, b| {
        let along = |k: usize| spectrum.vectors.column(k).dot(&local.r).abs();
        along(*a).total_cmp(&along(*b))
    });
    let name =
        pushed.map_or_else(String::new, |k| direction_names(system, local, &spectrum.vectors.column(k).into_owned()));
    Error::singular(format!(
        "nothing restrains the direction {name} but a force acts along it: add a spring, a joint or an opposing force"
    ))
}

fn finish(system: &System, state: State, local: Local, size: f64, iterations: usize) -> Result<Equilibrium> {
    let spectrum = spectrum(&local.k)?;
    let mut free_directions = Vec::new();
    for (k, value) in spectrum.values.iter().enumerate() {
        let v = spectrum.vectors.column(k).into_owned();
        if value.abs() <= spectrum.none {
            if v.dot(&local.r).abs() > 1e-9 * size {
                return Err(unrestrained(system, &local, &spectrum));
            }
            free_directions.push(direction_names(system, &local, &v));
        }
    }
    let step = newton_step(&local, &spectrum, 0.0).map_or(f64::NAN, |s| s.amax());
    let error = step + spectrum.answer_to(ROUNDING * size) + ROUNDING;
    let stable = spectrum.stable();
    let residual = local.r.amax() / size;
    Ok(Equilibrium { state, residual, error, iterations, stable, free_directions, linearization: local.linearization })
}

/// Solve K'' z = r at an equilibrium; free directions stay where they are unless the right side acts along them.
pub fn equilibrium_solver(
    system: &System,
    linearization: &Linearization,
    driven: &[usize],
) -> Result<impl Fn(&DVector<f64>) -> Result<DVector<f64>> + use<>> {
    let all = column_scales(&system.topology, system.length);
    let coordinates = linearization.coordinates(system.n_tree());
    let dof = coordinates.len();
    let free: Vec<usize> = (0..dof).filter(|k| !driven.contains(&coordinates[*k])).collect();
    let scale: Vec<f64> = free.iter().map(|k| all[coordinates[*k]]).collect();
    let n = scale.len();
    let k = &linearization.matrices.stiffness;
    let scaled = Mat::from_fn(n, n, |i, j| k[(free[i], free[j])] * scale[i] * scale[j]);
    // faer has no decomposition of an empty matrix
    let svd = (n > 0).then(|| scaled.svd()).transpose().map_err(|_| Error::singular("the stiffness is not finite"))?;
    Ok(move |r: &DVector<f64>| {
        let Some(svd) = &svd else {
            return Ok(DVector::zeros(dof));
        };
        let (u, s, v) = (svd.U(), svd.S().column_vector(), svd.V());
        let right = DVector::from_fn(n, |i, _| r[free[i]] * scale[i]);
        let mut z = DVector::<f64>::zeros(n);
        for k in 0..n {
            let along: f64 = (0..n).map(|i| u[(i, k)] * right[i]).sum();
            if s[k] > NO_STIFFNESS * s[0] {
                for i in 0..n {
                    z[i] += v[(i, k)] * along / s[k];
                }
            } else if along.abs() > 1e-9 * right.amax() {
                return Err(Error::singular(
                    "the equilibrium does not follow this parameter: it pushes along a direction that nothing restrains; use equilibrium=\"hold\"",
                ));
            }
        }
        let mut step = DVector::zeros(dof);
        for i in 0..n {
            step[free[i]] = z[i] * scale[i];
        }
        Ok(step)
    })
}
