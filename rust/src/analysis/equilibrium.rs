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
use crate::analysis::linearize::{Linearization, Setting, linearize, stiffness_terms};
use crate::analysis::steering::steering_joints;
use crate::error::{Error, Result};
use crate::run::{Cancel, Counts};
use crate::system::System;
use crate::system::assemble::Effects;
use crate::system::closure::close;
use crate::system::loops::column_scales;
use crate::system::placement::{State, advance, place};
use crate::tolerances::equilibrium::{
    BALANCED, ENTRY_ROUNDING, FALLS, GRADED, NEARLY_BALANCED, NO_POTENTIAL, NO_STIFFNESS, PUSHED, SETTLED, SMALL_STEP,
    UNLOADED,
};

const MAX_ITERATIONS: usize = 400;
/// Iterations, and steps that were shortened, after which descent in energy takes over from Newton's method.
const QUICK: usize = 40;
const SHORTENED: u64 = 12;
/// A Newton step, radians or characteristic lengths, so close to the balance that Newton's method is the right one: energies do not
/// resolve more, and loads without a potential have none.
const CLOSE: f64 = 1e-3;
/// What rounding usually leaves of a balance of forces, and of a pose, relative to their sizes.
const ROUNDING: f64 = 0.05 * f64::EPSILON;
/// Iterations that a force may push along a direction without stiffness before that is an error.
const PATIENCE: usize = 25;
/// Longest step, radians or characteristic lengths.
pub(super) const LONGEST_STEP: f64 = 0.4;
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

/// The scaled problem at one iterate: K and r over coordinates of the order of a radian.
pub(super) struct Local {
    pub k: DMatrix<f64>,
    m: DMatrix<f64>,
    pub r: DVector<f64>,
    scale: Vec<f64>,
    pub linearization: Linearization,
    /// sizes of the forces in the island of each coordinate
    sizes: Vec<f64>,
    islands: Vec<usize>,
    /// distance of the farthest body from the origin of the world, characteristic lengths
    far: f64,
    /// what a unit of each coordinate counts as where a step is judged, and whether its stiffness is more than rounding
    weight: Vec<f64>,
}

impl Local {
    pub fn at(system: &System, state: &State, effects: Effects, counts: &mut Counts) -> Result<Local> {
        let setting = Setting { system, state, memory: &[], acceleration: &[], effects };
        let linearization = linearize(&setting, counts)?;
        let topology = &*system.topology;
        let all = column_scales(topology, system.length);
        let coordinates = linearization.coordinates(system.n_tree());
        let scale: Vec<f64> = coordinates.iter().map(|i| all[*i]).collect();
        let n = scale.len();
        let scaled = |x: &DMatrix<f64>| DMatrix::from_fn(n, n, |i, j| x[(i, j)] * scale[i] * scale[j]);
        let (k, m) = (scaled(&linearization.matrices.stiffness), scaled(&linearization.matrices.mass));
        let r = DVector::from_fn(n, |i, _| linearization.residual[i] * scale[i]);
        let sizes = linearization.force_sizes.iter().map(|f| f.max(f64::MIN_POSITIVE)).collect();
        let islands: Vec<usize> = coordinates.iter().map(|i| topology.island_of(*i)).collect();
        let poses = place(topology, &system.geometry, &state.q, None).pose;
        let far = poses.iter().map(|p| p.p.norm()).fold(0.0, f64::max) / system.length;
        let weight = vec![1.0; n];
        let scale = scale.clone();
        let mut made = Local { k, m, r, scale, linearization, sizes, islands, far, weight };
        if made.is_graded() {
            made.weigh(&scaled(&stiffness_terms(&setting, &made.linearization)));
        }
        Ok(made)
    }

    /// The largest entry of the stiffness among the coordinates that coordinate i has to do with.
    fn stiffest(&self, i: usize) -> f64 {
        self.together(i).map(|j| self.k[(j, j)].abs()).fold(0.0, f64::max)
    }

    fn together(&self, i: usize) -> impl Iterator<Item = usize> + '_ {
        (0..self.islands.len()).filter(move |j| self.islands[*j] == self.islands[i])
    }

    fn is_graded(&self) -> bool {
        (0..self.r.len()).any(|i| self.k[(i, i)].abs() < GRADED * self.stiffest(i))
    }

    /// Coordinates that are held softly beside stiff ones are stretched, those that are not held at all are not.
    fn weigh(&mut self, terms: &DMatrix<f64>) {
        for i in 0..self.r.len() {
            let own = self.k[(i, i)].abs();
            let rounding = ENTRY_ROUNDING * f64::EPSILON * (1.0 + self.far) * terms[(i, i)];
            let least = GRADED * self.stiffest(i);
            if own > rounding && own < least {
                self.weight[i] = (least / own).sqrt();
            }
        }
    }

    /// The largest force that is left over, each over the size of the forces in its island.
    fn unbalance(&self) -> f64 {
        self.r.iter().zip(&self.sizes).map(|(r, size)| (r / size).abs()).fold(0.0, nan_or_larger)
    }

    fn relative(&self, r: &DVector<f64>) -> f64 {
        r.iter().zip(&self.sizes).map(|(r, size)| (r / size).powi(2)).sum::<f64>().sqrt()
    }

    /// What is left over may be rounding of the places of bodies, and with them of arms and of the lengths of springs.
    fn is_rounding(&self) -> bool {
        let unit = ENTRY_ROUNDING * f64::EPSILON * (1.0 + self.far);
        let noise = |i: usize| unit * (self.sizes[i] + self.k.row(i).iter().map(|k| k.abs()).sum::<f64>());
        (0..self.r.len()).all(|i| self.r[i].abs() <= noise(i))
    }

    /// Coordinates along which more is left over than a balance may leave of the forces at work, if there are any.
    fn unresolved(&self) -> Option<DVector<f64>> {
        let stiffness = |i: usize| self.k.row(i).iter().map(|k| k.abs()).sum::<f64>();
        let natural = |i: usize| self.together(i).map(stiffness).fold(0.0, f64::max);
        let left = DVector::from_fn(self.r.len(), |i, _| {
            let unloaded = self.sizes[i] <= UNLOADED * natural(i) && self.is_rounding();
            if unloaded { 0.0 } else { self.r[i] / self.sizes[i] }
        });
        let balanced = left.iter().all(|r| r.abs() <= PUSHED);
        (!balanced).then_some(left)
    }

    /// The skew part of the stiffness is small in every island.
    fn skew_below(&self, stiffness: f64, force: f64) -> bool {
        let n = self.r.len();
        let mut bounds = vec![(0.0_f64, 0.0_f64); self.islands.iter().max().map_or(0, |i| i + 1)];
        for (i, island) in self.islands.iter().enumerate() {
            let own = &mut bounds[*island];
            *own = (own.0.max(self.k.row(i).amax()), own.1.max(self.r[i].abs()));
        }
        let bound = |i: usize| stiffness * bounds[self.islands[i]].0 + force * bounds[self.islands[i]].1;
        (0..n).all(|i| {
            let most = bound(i);
            (0..i).all(|j| (self.k[(i, j)] - self.k[(j, i)]).abs() <= most)
        })
    }

    fn conservative(&self) -> bool {
        self.skew_below(NO_POTENTIAL, 0.0)
    }

    /// Off balance rotations about three axes make K skew by the moments that are left: no sign of missing potential.
    fn may_be_conservative(&self) -> bool {
        self.skew_below(NO_POTENTIAL, 2.0)
    }
}

/// W K W v_k = kappa_k v_k with W the weights of the coordinates, island by island: K^-1 = sum_k (W v_k)(W v_k)^T/kappa_k.
pub(super) struct Spectrum {
    pub values: Vec<f64>,
    /// columns W v_k
    pub vectors: DMatrix<f64>,
    /// below this a value counts as none
    pub none: Vec<f64>,
    /// the size of the forces that work along each vector
    forces: Vec<f64>,
}

impl Spectrum {
    pub fn is_held(&self, k: usize) -> bool {
        self.values[k].abs() > self.none[k]
    }

    /// The force along a vector, over the size of the forces there.
    fn push(&self, k: usize, r: &DVector<f64>) -> f64 {
        let v = self.vectors.column(k);
        v.dot(r).abs() / (v.norm() * self.forces[k])
    }

    /// The largest displacement that this part of the forces, in no particular direction, makes.
    fn answer_to(&self, part: f64) -> f64 {
        let square = |i: usize| -> f64 {
            let softness = |k: usize| {
                self.vectors[(i, k)] / self.values[k] * self.vectors.column(k).norm() * part * self.forces[k]
            };
            (0..self.values.len()).filter(|k| self.is_held(*k)).map(|k| softness(k).powi(2)).sum()
        };
        (0..self.values.len()).map(square).fold(0.0, f64::max).sqrt()
    }

    /// No stiffness is negative beyond rounding.
    fn stable(&self) -> bool {
        self.values.iter().zip(&self.none).all(|(v, none)| *v >= -FALLS / NO_STIFFNESS * none)
    }
}

/// Eigenvalues in ascending order.
fn spectrum(local: &Local) -> Result<Spectrum> {
    let n = local.r.len();
    let mut found: Vec<(f64, f64, f64, DVector<f64>)> = Vec::with_capacity(n);
    let mut islands = local.islands.clone();
    islands.sort_unstable();
    islands.dedup();
    for island in islands {
        let own: Vec<usize> = (0..n).filter(|i| local.islands[*i] == island).collect();
        let w = |i: usize| local.weight[own[i]];
        let entry = |i: usize, j: usize| 0.5 * (local.k[(own[i], own[j])] + local.k[(own[j], own[i])]) * w(i) * w(j);
        let eigen = Mat::from_fn(own.len(), own.len(), entry)
            .self_adjoint_eigen(Side::Lower)
            .map_err(|_| Error::singular("the stiffness has no eigenvalues: it is not finite"))?;
        let values: Vec<f64> = (0..own.len()).map(|i| eigen.S().column_vector()[i]).collect();
        let none = NO_STIFFNESS * values.iter().fold(0.0, |m: f64, v| m.max(v.abs()));
        let size = own.first().map_or(0.0, |i| local.sizes[*i]);
        for (k, value) in values.into_iter().enumerate() {
            let mut vector = DVector::zeros(n);
            own.iter().enumerate().for_each(|(i, at)| vector[*at] = eigen.U()[(i, k)] * w(i));
            found.push((value, none, size, vector));
        }
    }
    found.sort_by(|a, b| a.0.total_cmp(&b.0));
    Ok(Spectrum {
        values: found.iter().map(|f| f.0).collect(),
        none: found.iter().map(|f| f.1).collect(),
        forces: found.iter().map(|f| f.2).collect(),
        vectors: DMatrix::from_fn(n, n, |i, k| found[k].3[i]),
    })
}

fn nan_or_larger(a: f64, b: f64) -> f64 {
    if a.is_nan() || a > b { a } else { b }
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
    let setting = Setting { system, state: &still, memory: &[], acceleration: &[], effects };
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
    let mut local = Local::at(system, &state, effects, counts)?;
    let (mut sigma, mut pushed, mut saddles) = (0.0, 0, 0);
    let mut best = (f64::INFINITY, state.clone());
    let mut descent = None;
    let before = shortened(counts);
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
        if pushed_freely(&local, &spectrum) {
            pushed += 1;
            sigma = f64::max(sigma, initial_sigma(&local));
            if pushed > PATIENCE {
                return Err(unrestrained(system, &local, &spectrum));
            }
        }
        let step = newton_step(&local, &spectrum, sigma)?;
        let near = residual <= NEARLY_BALANCED && step.amax() <= SMALL_STEP;
        let done = residual <= BALANCED || step.amax() <= BALANCED || near;
        if done || local.is_rounding() {
            if residual > 4.0 * f64::EPSILON && residual.is_finite() {
                // one last step costs nothing and takes the iterate to rounding level
                let polished = moved(system, &state, &local, &step, 1.0, effects, counts)?;
                let next = Local::at(system, &polished, effects, counts)?;
                let left = next.unbalance();
                if left <= residual {
                    state = polished;
                    local = next;
                }
                if !done && left < SETTLED * residual {
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
            return finish(system, state, local, iteration);
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

fn pushed_freely(local: &Local, spectrum: &Spectrum) -> bool {
    (0..spectrum.values.len()).any(|k| !spectrum.is_held(k) && spectrum.push(k, &local.r) > PUSHED)
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
    let definite = (0..spectrum.values.len()).all(|k| spectrum.values[k] > spectrum.none[k]);
    if !local.conservative() && (definite || !local.may_be_conservative()) {
        let step = local.k.clone().lu().solve(&-r).filter(|s| s.iter().all(|v| v.is_finite()));
        return step.ok_or_else(|| {
            Error::singular("the tangent stiffness is singular under follower loads; restrain the model")
        });
    }
    let mut step = DVector::zeros(r.len());
    for (k, value) in spectrum.values.iter().enumerate() {
        if spectrum.is_held(k) {
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
    let named = order.iter().take(3).filter(|i| v[**i].abs() > 0.3 * largest);
    named.map(|i| system.topology.names[coordinates[*i]].clone()).collect::<Vec<_>>().join(" + ")
}

fn unrestrained(system: &System, local: &Local, spectrum: &Spectrum) -> Error {
    let free = (0..spectrum.values.len()).filter(|k| !spectrum.is_held(*k));
    let pushed = free.max_by(|a, b| spectrum.push(*a, &local.r).total_cmp(&spectrum.push(*b, &local.r)));
    let name =
        pushed.map_or_else(String::new, |k| direction_names(system, local, &spectrum.vectors.column(k).into_owned()));
    Error::singular(format!(
        "nothing restrains the direction {name} but a force acts along it: add a spring, a joint or an opposing force"
    ))
}

fn finish(system: &System, state: State, local: Local, iterations: usize) -> Result<Equilibrium> {
    let spectrum = spectrum(&local)?;
    let mut free_directions = Vec::new();
    for k in (0..spectrum.values.len()).filter(|k| !spectrum.is_held(*k)) {
        if spectrum.push(k, &local.r) > PUSHED {
            return Err(unrestrained(system, &local, &spectrum));
        }
        free_directions.push(direction_names(system, &local, &spectrum.vectors.column(k).into_owned()));
    }
    let step = newton_step(&local, &spectrum, 0.0).map_or(f64::NAN, |s| s.amax());
    let error = step + spectrum.answer_to(ROUNDING) + ROUNDING * (1.0 + local.far);
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
