//! Many designs of a model: values of its parameters in, numbers of one analysis out.
//!
//! A design is a row of values. The program of the parameters makes the numbers x of the model, and each analysis is that of a single model:
//! assembly or equilibrium, linearisation, modes or transfer functions, directions. What this path does not decide itself (a value out of
//! its range, a loop that does not close, modes that need the factors of the model) is left to the caller, design by design, so that no
//! answer and no error differs between the two paths.
mod frf;
mod inputs;
mod modes;
mod rest;

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::time::Instant;

use rayon::ThreadPoolBuilder;
use rayon::prelude::*;

use crate::constraint::assembly::assemble;
use crate::equilibrium::equilibrium;
use crate::error::Result;
use crate::linalg::dense::exceeds;
use crate::linearize::parts::{Parts, parts};
use crate::linearize::{Linearization, Setting, linearize};
use crate::model::layout::body::{ANGULAR_VELOCITY, VELOCITY};
use crate::model::layout::bushing;
use crate::model::tables::{ElementKind, Tables};
use crate::multibody::System;
use crate::multibody::assemble::Effects;
use crate::multibody::placement::State;
use crate::run::{Cancel, Counts};
use crate::sensitivity::direction::{Common, Directional, directions};
use crate::tolerances::linearisation::BALANCED;

pub use frf::{Point, Port, Transfer};
pub use inputs::{Inputs, Place, Rule};

/// Stack of a thread that computes designs, as large as that of any long work.
const STACK: usize = 64 << 20;

/// What is computed of each design.
#[derive(Debug, Clone)]
pub enum Analysis {
    Modes {
        /// how many of the lowest modes; None: all
        n: Option<usize>,
        /// whether the stiffness holds elastic elements alone; None: that depends on the design
        elastic: Option<bool>,
    },
    Transfer(Transfer),
    /// places of the bodies
    Rest,
}

#[derive(Debug, Clone)]
pub struct Plan {
    pub system: System,
    pub inputs: Inputs,
    pub analysis: Analysis,
    pub by: Vec<Place>,
    /// at the equilibrium; else as drawn
    pub equilibrium: bool,
}

/// The arrays of a design, one behind the other in the order of its analysis; derivatives by `by` come last, entry by entry.
///
/// Modes: frequencies (Hz), damping ratios, their derivatives. Transfer: H (output, input, frequency), real and imaginary parts in
/// turn, and dH. Rest: positions (body, 3), rotations (body, 3, 3), derivatives of the positions (body, 3) and world rotation vectors.
#[derive(Debug, Clone, Default)]
pub struct Numbers {
    pub arrays: Vec<Vec<f64>>,
    /// of modes; 1 for other analyses
    pub count: usize,
    /// the caller has something to say: forces out of balance, velocities that contradict joints, doubtful loops, infinite values
    pub remark: bool,
}

/// One design: its numbers, or None where the caller has to compute it, and the seconds that it took.
pub struct Design {
    pub numbers: Option<Numbers>,
    pub seconds: f64,
}

/// A design at its state, with its linearisation.
struct Scene<'a> {
    setting: Setting<'a>,
    lin: &'a Linearization,
    parts: &'a Parts,
    /// the values of all nodes of the program
    nodes: &'a [f64],
}

/// Derivatives along all directions, and whether the skew parts of dD and dS of each count.
struct Changes {
    all: Vec<Directional>,
    along: Vec<Vec<(usize, f64)>>,
    skew_damping: Vec<bool>,
    skew_stiffness: Vec<bool>,
}

/// All designs, by so many threads. Nothing passes from one design to another, so that bits depend on nothing but the values.
pub fn designs(plan: &Plan, rows: &[Vec<f64>], threads: usize, cancel: &Cancel) -> Result<Vec<Design>> {
    let one = |row: &Vec<f64>| {
        cancel.check()?;
        let start = Instant::now();
        let numbers = catch_unwind(AssertUnwindSafe(|| plan.design(row, cancel))).unwrap_or(Ok(None));
        cancel.check()?;
        Ok(Design { numbers: numbers.unwrap_or(None), seconds: start.elapsed().as_secs_f64() })
    };
    let threads = threads.min(rows.len());
    if threads < 2 {
        return rows.iter().map(one).collect();
    }
    // a pool of this call alone (40 us, beside the milliseconds of its designs): one that is kept would be without threads in a process
    // that was forked after its first use
    match ThreadPoolBuilder::new().num_threads(threads).stack_size(STACK).build() {
        Ok(pool) => pool.install(|| rows.par_iter().with_max_len(1).map(one).collect()),
        Err(_) => rows.iter().map(one).collect(),
    }
}

impl Plan {
    fn design(&self, row: &[f64], cancel: &Cancel) -> Result<Option<Numbers>> {
        let Some((nodes, x)) = self.inputs.numbers(&self.system.x, row) else { return Ok(None) };
        let system = self.system.with_values(x)?;
        let Some((state, remark)) = self.state(&system, cancel)? else { return Ok(None) };
        let setting = Setting { system: &system, state: &state, memory: &[], acceleration: &[], effects: Effects::ALL };
        let lin = linearize(&setting, &mut Counts::default())?;
        let parts = parts(&setting, &lin, None)?;
        let unbalanced = !state.moving() && exceeds(parts.error, BALANCED);
        if unbalanced && self.equilibrium {
            return Ok(None);
        }
        let scene = Scene { setting, lin: &lin, parts: &parts, nodes: &nodes };
        let made = match &self.analysis {
            Analysis::Modes { n, elastic } => self.modes(&scene, *n, *elastic, cancel)?,
            Analysis::Transfer(transfer) => self.transfer(&scene, transfer, cancel)?,
            Analysis::Rest => self.rest(&scene, cancel)?,
        };
        Ok(made.map(|made| Numbers { remark: made.remark || remark || unbalanced, ..made }))
    }

    /// The state, and whether there is something to say of it; None where its analysis has to be the caller's.
    fn state(&self, system: &System, cancel: &Cancel) -> Result<Option<(State, bool)>> {
        let counts = &mut Counts::default();
        let doubtful = !system.topology.rows.is_empty() && !system.decision(Effects::ALL)?.doubts.is_empty();
        let made = assemble(system, !self.equilibrium, Effects::ALL, counts)?;
        if !self.equilibrium {
            let corrected = made.velocities.contradicts();
            return Ok(Some((made.state, doubtful || corrected)));
        }
        let start = State { q: made.state.q, rate: Vec::new() };
        let found = equilibrium(system, &start, Effects::ALL, cancel, counts)?;
        Ok((found.stable && found.unresolved.is_none()).then_some((found.state, doubtful)))
    }

    /// The derivatives of the linearisation, with those of its maps where they are wanted; None at a kink of an expression.
    fn changes(&self, scene: &Scene<'_>, maps: bool, cancel: &Cancel) -> Result<Option<Changes>> {
        let Some(along) = self.inputs.directions(scene.nodes, &self.by) else { return Ok(None) };
        let common = Common { follow: self.equilibrium, drawn: !self.equilibrium, maps, driven: &[] };
        let all = directions(&scene.setting, scene.lin, &along, common, cancel)?;
        let tables = &scene.setting.system.topology.tables;
        let skew = |has: bool, field: usize, moved: bool| {
            let counts =
                |dx: &Vec<(usize, f64)>| has || couples_across(tables, dx, field) || moved && spins(tables, dx);
            along.iter().map(counts).collect()
        };
        let skew_damping = skew(scene.parts.gyroscopic.is_some(), bushing::C, true);
        let skew_stiffness = skew(scene.parts.circulatory.is_some(), bushing::K, false);
        Ok(Some(Changes { all, along, skew_damping, skew_stiffness }))
    }
}

/// Does a direction make a full bushing unsymmetric?
fn couples_across(tables: &Tables, dx: &[(usize, f64)], field: usize) -> bool {
    let slope = |i: usize| dx.iter().filter(|(k, _)| *k == i).map(|(_, d)| d).sum::<f64>();
    tables.elements.iter().filter(|e| e.kind == ElementKind::Bushing).any(|e| {
        let first = e.x + field;
        let touched = dx.iter().any(|(k, _)| (first..first + 36).contains(k));
        touched && (0..6).any(|i| (0..i).any(|j| slope(first + 6 * i + j) != slope(first + 6 * j + i)))
    })
}

/// Does a direction change a given velocity?
fn spins(tables: &Tables, dx: &[(usize, f64)]) -> bool {
    let own = |b: usize, k: usize| (b + VELOCITY..b + ANGULAR_VELOCITY + 3).contains(&k);
    dx.iter().any(|(k, _)| tables.bodies.iter().any(|b| own(b.x, *k)))
}
