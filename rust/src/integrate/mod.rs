//! Motion in time. This file is the common interface: the equations, what one instant holds, and what a scheme is.
//!
//! ```text
//! r = M(q) a + h(q, v, t) + J^T lam = 0         h: velocity terms and gravity minus applied forces
//! Phi(q, t) = 0,   J v + Phi_t = 0 (also rows that exist on velocity level alone),   J a + gamma(q, v, t) = 0
//! ```
//! q are the coordinates of the tree joints and modal coordinates, v and a their rates and accelerations. They move by
//! `advance(q, dy)`; every increment dy, rate and acceleration is in the tree coordinates of docs/tables.md. All rows of cut joints
//! stand in the order of `topology.rows`, redundant ones too: `linalg::kkt` solves with those that carry their rank.
//!
//! | file | |
//! |---|---|
//! | `consistent` | closing, projection of rates, accelerations and multipliers: all that makes an `Instant` |
//! | `singular` | poses where rows lose rank |
//! | `detour` | across them |
//! | `kinks`, `sides`, `kink_search`, `kink_rest` | steps that end at kinks of laws, and laws held on one side of them |
//! | `watch` | whether the motion goes on behind them as it came |
//! | `plan`, `driver`, `way` | fixed or controlled steps, output times, stops, detours |
//! | `share` | how much of the tolerance a unit of time may have |
//! | `states` | internal states of laws |
//! | `rotations` | three rotations that act together |
//! | `held_rates` | tangents at constant rates |
//! | `interpolate`, `refine` | between two instants |
//! | `kept` | the steps of a run, for its derivatives |
//! | one file for each scheme | implements `Scheme` |
pub mod ali3p;
pub mod augmented;
pub mod bdf;
pub mod consistent;
mod detour;
pub mod dop853_numbers;
pub mod driver;
mod element_motion;
pub mod energy;
pub mod explicit8;
mod explicit_minimal;
mod explicit_pivots;
pub mod generalized_alpha;
mod held_rates;
pub mod interpolate;
pub mod kept;
mod kink_rest;
mod kink_search;
pub mod kinks;
pub mod methods;
pub mod plan;
pub mod radau;
pub mod refine;
mod reversal;
pub mod rotations;
mod share;
mod sides;
mod singular;
mod states;
pub mod stiffness;
mod watch;
mod way;

use std::sync::Arc;

use nalgebra::{DMatrix, DVector};
use states::close_section;

use crate::constraint::functions::has_explicit_rates;
use crate::constraint::loops::column_scales;
use crate::constraint::rows::driven_rates;
use crate::error::Result;
use crate::linalg::kkt::Ordering;
use crate::linalg::rows::RowBlocks;
use crate::model::geometry::Geometry;
use crate::multibody::System;
use crate::multibody::air::Here;
use crate::multibody::assemble::{Effects, Scene, Tangent};
use crate::multibody::connector::motion_of;
use crate::multibody::numbers::Numbers;
use crate::multibody::placement::{Placement, advance, difference, place};
use crate::multibody::topology::Topology;
use crate::run::Counts;
use crate::spatial::Real;
use crate::tolerances::constraints::CLOSED_ENOUGH;
use crate::tolerances::steps::SAME_INSTANT;
use kept::Parts;
use refine::Between;

/// Where the model is, how it moves, and what its laws remember.
#[derive(Debug, Clone)]
pub struct Motion<T: Real> {
    pub t: f64,
    /// coordinates of the joints by node, then modal coordinates (`crate::joint`)
    pub q: Vec<T>,
    pub rate: Vec<T>,
    pub memory: Vec<T>,
}

impl<T: Real> Motion<T> {
    /// Moved by increments of the tree coordinates; time and rates stay.
    pub fn moved(&self, topology: &Topology, increment: &[T]) -> Self {
        let mut out = self.clone();
        advance(topology, &mut out.q, increment);
        out
    }
}

/// A motion with the accelerations and multipliers that belong to it.
#[derive(Debug, Clone)]
pub struct Instant {
    pub motion: Motion<f64>,
    pub acceleration: Vec<f64>,
    /// one per row of `topology.rows`, with the sign of r = M a + h + J^T lam
    pub lam: Vec<f64>,
}

/// One step of a scheme, not accepted yet.
#[derive(Debug, Clone)]
pub struct Step {
    pub end: Instant,
    /// local error estimates, not scaled, in tree coordinates; None where none was asked for
    pub error: Option<LocalError>,
}

#[derive(Debug, Clone)]
pub struct LocalError {
    pub position: Vec<f64>,
    pub rate: Vec<f64>,
    /// of the states of laws, in the places of the memory; empty without any
    pub state: Vec<f64>,
}

/// A way to get from one instant to the next. Fields may keep histories and factorisations from step to step.
pub trait Scheme {
    /// Power of the step in the error of the whole motion.
    fn order(&self) -> u32;

    /// From `from` over the time h; `estimate` asks for the local error. An `Error::Convergence` or `Error::Singular` makes the
    /// driver try a smaller step; other errors end the run.
    fn step(
        &mut self,
        eq: &Equations<'_, f64>,
        from: &Instant,
        h: f64,
        estimate: bool,
        counts: &mut Counts,
    ) -> Result<Step>;

    /// The order of the step just made; 0 and -1 as in `bdf::record`. Of schemes that choose it, before `accept`.
    fn formula(&self) -> i32 {
        0
    }

    /// Power of the step in the controlled error.
    fn power(&self) -> f64 {
        f64::from(self.order())
    }

    /// A run over this time begins.
    fn over(&mut self, _time: f64) {}

    /// One that extrapolates locally holds the error of a step to the tolerance, others that of a unit of time.
    fn per_unit_step(&self) -> bool {
        false
    }

    /// What its equations leave of constraint rows.
    fn rounding(&self) -> f64 {
        f64::EPSILON
    }

    /// Factor of the next step, for schemes that choose their order; `size` of an error is one at its tolerance. Called after
    /// `accept`.
    fn proposal(&mut self, _size: &dyn Fn(&LocalError) -> f64) -> Option<f64> {
        None
    }

    /// The driver goes on from the end of this step (of length h): the place to move histories on.
    fn accept(&mut self, _eq: &Equations<'_, f64>, _from: &Instant, _step: &Step, _h: f64) {}

    /// Whether its own steps are as long as one across a singular pose; None where it never leaves such a pose to another scheme.
    fn crossing(&self) -> Option<bool> {
        Some(false)
    }

    /// How long an error of the rates counts in positions; the driver takes the time of the motion where that is shorter.
    fn rate_time(&self, _h: f64) -> f64 {
        f64::INFINITY
    }

    /// What the step was made of that the driver just went on from; of schemes that keep it.
    fn parts(&mut self) -> Option<Parts> {
        None
    }

    /// Something jumped (a restart, a kink): histories are worthless.
    fn reset(&mut self) {}

    /// Steps will end at kinks of laws, and are looked at for them.
    fn end_at_kinks(&mut self) {}

    /// What a reader of the result should know of how it went.
    fn remark(&self) -> Option<String> {
        None
    }

    /// Numbers of the run by name, largest values over its steps.
    fn measures(&self) -> Vec<(&'static str, f64)> {
        Vec::new()
    }

    /// Motions at fractions of the step just made; the driver projects them. Called before `accept`.
    fn between(
        &mut self,
        eq: &Equations<'_, f64>,
        from: &Instant,
        step: &Step,
        h: f64,
        fractions: &[f64],
        _counts: &mut Counts,
    ) -> Result<Vec<Motion<f64>>> {
        Ok(interpolate::quintic(eq, from, &step.end, h, fractions))
    }

    /// The same for outputs, as accurate as the step; more may be evaluated for it.
    fn outputs(
        &mut self,
        eq: &Equations<'_, f64>,
        from: &Instant,
        step: &Step,
        h: f64,
        fractions: &[f64],
        counts: &mut Counts,
    ) -> Result<Vec<Between>> {
        let motions = self.between(eq, from, step, h, fractions, counts)?;
        Ok(refine::with_own_rates(eq, from, &step.end, h, fractions, motions))
    }

    /// The error of such a motion, from how far its acceleration is from the slope of its rates; of schemes that can tell it. `filtered`:
    /// without what is fast beside the step, for one solution.
    fn misfit(&self, _h: f64, _difference: &[f64], _filtered: bool) -> Result<Option<LocalError>> {
        Ok(None)
    }
}

/// The length of a step to where a load or a drive is not smooth: it ends just before, what jumps there belongs to what follows.
pub fn before_break(length: f64, start: f64, end: f64) -> f64 {
    length - (SAME_INSTANT * end.abs().max(end - start)).min(0.5 * length)
}

/// Motions within a step below this, characteristic lengths or radians, are solved as if they were of this size: of it `CLOSED_ENOUGH`,
/// to which corrections of rounding may stay, is the rounding of poses.
pub fn least_motion() -> f64 {
    f64::EPSILON / CLOSED_ENOUGH
}

/// The largest entry over its scale; entries that are nan do not count.
pub fn scaled_size(v: &[f64], scales: &[f64]) -> f64 {
    v.iter().zip(scales).fold(0.0, |s, (v, c)| s.max((v / c).abs()))
}

impl Equations<'_, f64> {
    /// Rounding of coordinates and places, in characteristic lengths and radians: those far from zero have more of it.
    pub fn rounding(&self, m: &Motion<f64>) -> f64 {
        let scales = self.scales();
        let run = |q: usize, first: usize, n: usize| (0..n).map(move |k| (q + k, first + k));
        let nodes = self.topology().nodes.iter();
        let joints = nodes.flat_map(|n| run(n.q, n.first, n.kind.quaternion().unwrap_or(n.kind.nq())));
        let modal = self.topology().modal.iter().flat_map(|m| run(m.q, m.first, m.m));
        let farthest = joints.chain(modal).fold(0.0_f64, |far, (q, d)| far.max((m.q[q] / scales[d]).abs()));
        f64::EPSILON * (1.0 + farthest + self.far)
    }
}

/// The equations of motion of a system: values lifted to T once, evaluated at motions.
pub struct Equations<'a, T: Real> {
    pub system: &'a System,
    pub geometry: Geometry<T>,
    pub x: Vec<T>,
    pub effects: Effects,
    /// large models: lists of entries instead of dense matrices
    pub sparse: bool,
    /// ranks of the rows
    pub rows: Arc<RowBlocks>,
    /// connectors with laws whose states have rates
    rated: Vec<usize>,
    /// sections in the air with such states
    rated_air: Vec<usize>,
    /// distance of the farthest body from the origin of the world as drawn, characteristic lengths
    far: f64,
    ordering: Ordering,
}

/// Sections in the air that act and have states.
fn sections_with_states(topology: &Topology, effects: Effects) -> Vec<usize> {
    let n = if effects.aerodynamics { topology.tables.sections.len() } else { 0 };
    (0..n).filter(|i| !topology.section_memory(*i).is_empty()).collect()
}

/// Above this number of coordinates and rows sparse factorisations are faster.
const DENSE: usize = 60;

/// The decided ranks; where the loops cannot be closed, which other analyses refuse, every row by itself.
fn row_blocks(system: &System, effects: Effects) -> Arc<RowBlocks> {
    let unknown = || Arc::new(RowBlocks::independent(system.topology.rows.len(), system.n_tree()));
    if system.topology.rows.is_empty() {
        return unknown();
    }
    system.decision(effects).map_or_else(|_| unknown(), |d| d.rows.clone())
}

impl<'a, T: Real> Equations<'a, T> {
    pub fn new(system: &'a System, x: Vec<T>, effects: Effects) -> Self {
        let geometry = Geometry::derive(&system.topology.tables, &x);
        Equations::with_geometry(system, x, geometry, effects)
    }

    /// With a geometry that was derived before.
    pub fn with_geometry(system: &'a System, x: Vec<T>, geometry: Geometry<T>, effects: Effects) -> Self {
        let far = geometry.bodies.iter().map(|b| b.drawn.p.map(|v| v.re()).norm()).fold(0.0, f64::max) / system.length;
        Equations {
            system,
            geometry,
            x,
            effects,
            sparse: system.n_tree() + system.topology.rows.len() > DENSE,
            rows: row_blocks(system, effects),
            rated: effects.wanted().with_state_rates(&system.topology),
            rated_air: sections_with_states(&system.topology, effects),
            far,
            ordering: Ordering::default(),
        }
    }

    pub fn topology(&self) -> &'a Topology {
        &self.system.topology
    }

    /// Number of tree coordinates.
    pub fn n(&self) -> usize {
        self.system.n_tree()
    }

    pub fn n_rows(&self) -> usize {
        self.topology().rows.len()
    }

    /// Is there a row that acts, and not only rows of effects that are left out?
    pub fn constrained(&self) -> bool {
        self.topology().rows.iter().any(|r| self.effects.row(r))
    }

    /// Whether the size of a correction of rates or accelerations tells what is left: kept matrices of rows that have turned leave
    /// (J - J_kept)^T times the correction of the multipliers, which the next one sees.
    pub fn correction_tells(&self, fresh: bool, iteration: usize) -> bool {
        fresh || iteration > 1 || !self.constrained()
    }

    /// Characteristic length of lengths, one of angles: an increment over it is dimensionless.
    pub fn scales(&self) -> Vec<f64> {
        column_scales(self.topology(), self.system.length)
    }

    /// Factors that make the rows dimensionless.
    pub fn row_scales(&self) -> Vec<f64> {
        self.system.row_scales().to_vec()
    }

    pub fn place(&self, m: &Motion<T>) -> Placement<T> {
        place(self.topology(), &self.geometry, &m.q, Some(m.rate.as_slice()))
    }

    /// The one place where the time of a motion meets the system.
    pub fn scene<'s>(
        &'s self,
        m: &'s Motion<T>,
        placement: &'s Placement<T>,
        acceleration: Option<&'s [T]>,
    ) -> Scene<'s, T> {
        Scene {
            topology: self.topology(),
            geometry: &self.geometry,
            x: &self.x,
            memory: &m.memory,
            placement,
            rate: Some(&m.rate),
            acceleration,
            t: m.t,
            effects: self.effects,
        }
    }

    pub fn mass(&self, m: &Motion<T>) -> DMatrix<T> {
        let placement = self.place(m);
        self.scene(m, &placement, None).mass()
    }

    /// r = M a + h + J^T lam, without ever forming M or J.
    pub fn residual(&self, m: &Motion<T>, a: &[T], lam: &[T], counts: &mut Counts) -> DVector<T> {
        counts.add("force evaluations", 1);
        let placement = self.place(m);
        let lam = (!lam.is_empty()).then_some(lam);
        self.scene(m, &placement, Some(a)).residual(lam)
    }

    /// Phi(q, t) and J; a velocity row has the value zero and its D for a row of J.
    pub fn rows(&self, m: &Motion<T>) -> (DVector<T>, DMatrix<T>) {
        let placement = self.place(m);
        self.scene(m, &placement, None).constraints()
    }

    /// J v + Phi_t.
    pub fn row_rates(&self, m: &Motion<T>) -> DVector<T> {
        self.row_rates_at(m, &self.place(m))
    }

    pub fn row_rates_at(&self, m: &Motion<T>, placement: &Placement<T>) -> DVector<T> {
        self.scene(m, placement, None).row_rates() + self.explicit_rates(m).0
    }

    /// J a + gamma, without ever forming J.
    pub fn row_accelerations(&self, m: &Motion<T>, placement: &Placement<T>, a: &[T]) -> DVector<T> {
        let scene = self.scene(m, placement, Some(a));
        scene.row_bias(&scene.free_accelerations()) + self.explicit_rates(m).1
    }

    /// The same where J is known already.
    pub fn row_rates_of(&self, m: &Motion<T>, jacobian: &DMatrix<T>) -> DVector<T> {
        jacobian * DVector::from_column_slice(&m.rate) + self.explicit_rates(m).0
    }

    /// Phi_t, and Phi_tt of drives.
    fn explicit_rates(&self, m: &Motion<T>) -> (DVector<T>, DVector<T>) {
        let (mut first, second) = driven_rates(self.topology(), &self.geometry, self.effects, m.t);
        if has_explicit_rates(self.topology()) {
            let placement = self.place(m);
            self.scene(m, &placement, None).add_explicit_rates(&mut first);
        }
        (first, second)
    }

    /// gamma: what J a must cancel; the rate of J v + Phi_t at a = 0.
    pub fn row_bias(&self, m: &Motion<T>) -> DVector<T> {
        let placement = self.place(m);
        let scene = self.scene(m, &placement, None);
        scene.row_bias(&scene.carried_accelerations()) + self.explicit_rates(m).1
    }

    /// M, D = dr/dv (damping and gyroscopic), K = dr/dq at constant v, a, lam.
    pub fn tangent(&self, m: &Motion<T>, a: &[T], lam: &[T], counts: &mut Counts) -> Tangent<T> {
        self.tangent_at(m, &self.place(m), a, lam, counts)
    }

    /// The same where the placement is known already.
    pub fn tangent_at(
        &self,
        m: &Motion<T>,
        placement: &Placement<T>,
        a: &[T],
        lam: &[T],
        counts: &mut Counts,
    ) -> Tangent<T> {
        counts.add("tangents", 1);
        let lam = (!lam.is_empty()).then_some(lam);
        let mut made = self.scene(m, placement, Some(a)).tangent(lam, counts);
        self.hold_rates(m, a, &mut made);
        made
    }

    /// Memories of laws marched to this motion: for accepted steps only.
    pub fn remember(&self, m: &mut Motion<T>, counts: &mut Counts) {
        if m.memory.is_empty() {
            return;
        }
        counts.add("memory updates", 1);
        let topology = self.topology();
        let placement = self.place(m);
        for c in topology.connectors.iter().filter(|c| !c.laws.is_empty()) {
            let moved = motion_of(topology, &self.geometry, &placement, &self.x, c);
            for law in &c.laws {
                let (e, v) = moved[law.component];
                let p = &self.x[law.x..law.x + law.law.n_params()];
                let memory = law.memory..law.memory + law.law.n_memory();
                law.law.eval(e, v, p, &mut m.memory[memory]);
            }
        }
        for i in &self.rated_air {
            let own = topology.section_memory(*i);
            let here = Here::new(topology, &self.geometry, &placement, self.numbers(m), *i);
            close_section(&here, &mut m.memory[own]);
        }
    }

    fn numbers<'s>(&'s self, m: &'s Motion<T>) -> Numbers<'s, T> {
        Numbers { x: &self.x, memory: &m.memory, t: m.t }
    }

    /// The increments that lead from one motion to another; three rotations together are less than half a turn.
    pub fn difference(&self, from: &Motion<T>, to: &Motion<T>) -> Vec<T> {
        difference(self.topology(), &from.q, &to.q)
    }
}
