//! Modes of many designs of a model and their derivatives: values of its parameters in, numbers out.
//!
//! A design is a row of values. The program of the parameters makes the numbers x of the model, and each analysis is that of a single model:
//! assembly or equilibrium, linearisation, modes, directions. What this path does not decide itself (a value out of its range, a loop that
//! does not close, modes that need the factors of the model) is left to the caller, design by design, so that no answer and no error
//! differs between the two paths.
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::time::Instant;

use faer::Mat;

use crate::analysis::assembly::assemble;
use crate::analysis::direction::{Common, Directional, Entries, directions};
use crate::analysis::eigen_sensitivity::{Directions, Known, Slices, eigen_sensitivity};
use crate::analysis::equilibrium::equilibrium;
use crate::analysis::linearize::{Setting, linearize};
use crate::analysis::modal::{Kind, Modal};
use crate::analysis::model_modes::{model_modes, second_order};
use crate::analysis::parts::parts;
use crate::error::Result;
use crate::expressions::Program;
use crate::linalg::dense::{C, exceeds};
use crate::model::layout::body::{ANGULAR_VELOCITY, VELOCITY};
use crate::model::layout::bushing;
use crate::model::tables::{ElementKind, Tables};
use crate::run::{Cancel, Counts};
use crate::second_order::SecondOrder;
use crate::system::System;
use crate::system::assemble::Effects;
use crate::system::placement::State;
use crate::tolerances::linearisation::{BALANCED, VELOCITY_CORRECTED};
use crate::tolerances::modes::SAME_ROOT;

/// What a column of the designs sets, or a derivative is taken by.
#[derive(Debug, Clone)]
pub enum Place {
    /// an entry of the flat vector V of all parameters
    Parameter(usize),
    /// numbers of x that are one
    Numbers(Vec<usize>),
}

/// A value that surely is possible. Where a rule fails the caller decides.
#[derive(Debug, Clone, Copy)]
pub enum Rule {
    Positive(usize),
    NotNegative(usize),
    /// some of n numbers
    NotZero(usize, usize),
    /// xx, yy, zz, xy, xz, yz of a body: principal moments that a body can have
    Inertia(usize),
    /// the two points of a line, three numbers each
    Apart(usize, usize),
}

/// Points nearer to each other than this share of their distances from the origin are left to the caller.
const NEAR: f64 = 1e-6;

impl Rule {
    fn holds(self, x: &[f64]) -> bool {
        match self {
            Rule::Positive(i) => x[i] > 0.0,
            Rule::NotNegative(i) => x[i] >= 0.0,
            Rule::NotZero(i, n) => x[i..i + n].iter().any(|v| *v != 0.0),
            Rule::Inertia(i) => {
                let [xx, yy, zz, xy, xz, yz] = [0, 1, 2, 3, 4, 5].map(|k| x[i + k]);
                let tensor = nalgebra::Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz);
                let mut moments: Vec<f64> = tensor.symmetric_eigenvalues().iter().copied().collect();
                moments.sort_by(f64::total_cmp);
                moments[0] >= 0.0 && moments[2] <= moments[0] + moments[1]
            }
            Rule::Apart(a, b) => {
                let norm = |at: &dyn Fn(usize) -> f64| (0..3).map(|k| at(k).powi(2)).sum::<f64>().sqrt();
                let size = norm(&|k| x[a + k]).max(norm(&|k| x[b + k]));
                norm(&|k| x[b + k] - x[a + k]) > NEAR * size
            }
        }
    }
}

/// How a row of values becomes the numbers of a model.
#[derive(Debug, Clone)]
pub struct Inputs {
    /// V as the model has it
    pub parameters: Vec<f64>,
    pub columns: Vec<Place>,
    pub program: Program,
    /// places of x that nodes of the program drive
    pub driven: Vec<(usize, usize)>,
    pub rules: Vec<Rule>,
}

/// What is computed of each design.
#[derive(Debug, Clone)]
pub struct Plan {
    pub system: System,
    pub inputs: Inputs,
    /// how many of the lowest modes; None: all
    pub n: Option<usize>,
    pub by: Vec<Place>,
    /// at the equilibrium; else as drawn
    pub equilibrium: bool,
    /// whether the stiffness holds elastic elements alone; None: that depends on the design
    pub elastic: Option<bool>,
}

/// Frequencies (Hz) and damping ratios of the modes, and their derivatives, mode by mode.
#[derive(Debug, Clone, Default)]
pub struct Numbers {
    pub frequency: Vec<f64>,
    pub damping: Vec<f64>,
    pub frequency_derivative: Vec<f64>,
    pub damping_derivative: Vec<f64>,
    /// the caller has something to say of the state: forces out of balance, velocities that contradict joints, doubtful loops
    pub remark: bool,
}

/// One design: its numbers, or None where the caller has to compute it, and the seconds that it took.
pub struct Design {
    pub numbers: Option<Numbers>,
    pub seconds: f64,
}

/// Designs one after the other. Nothing passes from one to the next, so that their bits depend on nothing but their values.
pub fn designs(plan: &Plan, rows: &[Vec<f64>], cancel: &Cancel) -> Result<Vec<Design>> {
    let one = |row: &Vec<f64>| {
        cancel.check()?;
        let start = Instant::now();
        let numbers = catch_unwind(AssertUnwindSafe(|| plan.design(row, cancel))).unwrap_or(Ok(None));
        cancel.check()?;
        Ok(Design { numbers: numbers.unwrap_or(None), seconds: start.elapsed().as_secs_f64() })
    };
    rows.iter().map(one).collect()
}

impl Inputs {
    /// V, all nodes of the program, and x; None where a value is out of its range.
    fn numbers(&self, x: &[f64], row: &[f64]) -> Option<(Vec<f64>, Vec<f64>)> {
        let (mut v, mut x) = (self.parameters.clone(), x.to_vec());
        for (place, value) in self.columns.iter().zip(row) {
            match place {
                Place::Parameter(i) => v[*i] = *value,
                Place::Numbers(all) => all.iter().for_each(|i| x[*i] = *value),
            }
        }
        let nodes = self.program.values(&v);
        for (slot, node) in &self.driven {
            x[*slot] = nodes[*node];
        }
        let finite = row.iter().chain(&nodes).all(|v| v.is_finite());
        (finite && self.rules.iter().all(|rule| rule.holds(&x))).then_some((nodes, x))
    }

    /// dx/dp for each place; None at a kink.
    fn directions(&self, nodes: &[f64], by: &[Place]) -> Option<Vec<Vec<(usize, f64)>>> {
        let mut all: Vec<Vec<(usize, f64)>> = Vec::with_capacity(by.len());
        let wanted = by.iter().any(|place| matches!(place, Place::Parameter(_)));
        let slopes = |(slot, node): &(usize, usize)| Some((*slot, self.program.gradient(*node, nodes).ok()?));
        let slopes: Vec<(usize, Vec<(usize, f64)>)> =
            if wanted { self.driven.iter().map(slopes).collect::<Option<_>>()? } else { Vec::new() };
        for place in by {
            all.push(match place {
                Place::Numbers(slots) => slots.iter().map(|i| (*i, 1.0)).collect(),
                Place::Parameter(k) => {
                    let along = |(slot, own): &(usize, Vec<(usize, f64)>)| {
                        own.iter().find(|(input, _)| input == k).map(|(_, slope)| (*slot, *slope))
                    };
                    slopes.iter().filter_map(along).collect()
                }
            });
        }
        Some(all)
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
        let matrices = second_order(&lin, &parts)?;
        let Some(modal) = model_modes(&setting, &lin, &parts, &matrices, self.elastic)? else { return Ok(None) };
        let chosen = Chosen::new(&modal, self.n);
        let mut out = Numbers { remark: remark || unbalanced, ..chosen.numbers() };
        if !self.by.is_empty() {
            let Some(along) = self.inputs.directions(&nodes, &self.by) else { return Ok(None) };
            let common = Common { follow: self.equilibrium, drawn: !self.equilibrium, maps: false, driven: &[] };
            let changes = directions(&setting, &lin, &along, common, cancel)?;
            let skew = |has: bool, field: usize, moved: bool| {
                along
                    .iter()
                    .map(|dx| {
                        has || couples_across(&system.topology.tables, dx, field)
                            || moved && spins(&system.topology.tables, dx)
                    })
                    .collect()
            };
            let kept = [
                skew(parts.gyroscopic.is_some(), bushing::C, true),
                skew(parts.circulatory.is_some(), bushing::K, false),
            ];
            chosen.derive(&matrices, &changes, &kept, &mut out)?;
        }
        Ok(Some(out))
    }

    /// The state, and whether there is something to say of it; None where its analysis has to be the caller's.
    fn state(&self, system: &System, cancel: &Cancel) -> Result<Option<(State, bool)>> {
        let counts = &mut Counts::default();
        let doubtful = !system.topology.rows.is_empty() && !system.decision(Effects::ALL)?.doubts.is_empty();
        let made = assemble(system, !self.equilibrium, Effects::ALL, counts)?;
        if !self.equilibrium {
            let fastest = made.state.rate.iter().fold(1.0, |a: f64, b| a.max(b.abs()));
            let corrected = made.velocity_correction > VELOCITY_CORRECTED * fastest;
            return Ok(Some((made.state, doubtful || corrected)));
        }
        let start = State { q: made.state.q, rate: Vec::new() };
        let found = equilibrium(system, &start, Effects::ALL, cancel, counts)?;
        Ok((found.stable && found.unresolved.is_none()).then_some((found.state, doubtful)))
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

/// The lowest modes of a result, and which of them share a root.
struct Chosen<'a> {
    modal: &'a Modal,
    n: usize,
    clusters: Vec<(usize, usize)>,
    /// modes of a group that `n` has cut
    cut: std::ops::Range<usize>,
}

impl<'a> Chosen<'a> {
    fn new(modal: &'a Modal, n: Option<usize>) -> Self {
        let n = n.map_or(modal.s.len(), |n| n.min(modal.s.len()));
        let cut = modal.groups.iter().find(|(a, count)| *a < n && n < a + count).map_or(0..0, |(a, _)| *a..n);
        let group =
            |i: usize| modal.groups.iter().position(|(a, count)| *count > 1 && (*a..(a + count).min(n)).contains(&i));
        let mut clusters: Vec<(usize, usize)> = Vec::new();
        for i in 0..n {
            let together = i > 0
                && match (group(i - 1), group(i)) {
                    (Some(a), Some(b)) if a == b => true,
                    _ => same(modal, i - 1, i),
                };
            match clusters.last_mut().filter(|_| together) {
                Some((_, count)) => *count += 1,
                None => clusters.push((i, 1)),
            }
        }
        clusters.retain(|(_, count)| *count > 1);
        Chosen { modal, n, clusters, cut }
    }

    fn numbers(&self) -> Numbers {
        let s = &self.modal.s[..self.n];
        let damping = |s: &C| if s.norm() > 0.0 { -s.re / s.norm() + 0.0 } else { f64::NAN };
        Numbers {
            frequency: s.iter().map(|s| s.norm() / std::f64::consts::TAU).collect(),
            damping: s.iter().map(damping).collect(),
            ..Numbers::default()
        }
    }

    /// Derivatives along directions; `kept` tells of each whether the skew parts of its dD and dS count.
    fn derive(
        &self,
        system: &SecondOrder,
        changes: &[Directional],
        kept: &[Vec<bool>; 2],
        out: &mut Numbers,
    ) -> Result<()> {
        let (modal, size) = (self.modal, system.size());
        let first = |x: &Mat<C>| x.subcols(0, self.n).to_owned();
        let known = Known {
            s: modal.s[..self.n].to_vec(),
            x: first(&modal.shape),
            y: modal.left.as_ref().map(first),
            rigid: modal.kind[..self.n].iter().map(|k| *k == Kind::Rigid).collect(),
            near_defective: modal.near_defective[..self.n].to_vec(),
            groups: self.clusters.clone(),
        };
        let whole = vec![true; changes.len()];
        let along = Directions::new(
            slices(changes, |d| &d.mass, &whole, size)?,
            slices(changes, |d| &d.damping, &kept[0], size)?,
            slices(changes, |d| &d.stiffness, &kept[1], size)?,
            changes.len(),
        );
        let found = eigen_sensitivity(system, &known, &along)?.eigenvalue;
        for i in 0..self.n {
            let s = modal.s[i];
            for p in 0..changes.len() {
                let ds = if self.cut.contains(&i) { C::new(f64::NAN, f64::NAN) } else { found[(i, p)] };
                let (frequency, damping) = slopes(s, ds);
                out.frequency_derivative.push(frequency);
                out.damping_derivative.push(damping);
            }
        }
        Ok(())
    }
}

/// Neighbours that a symmetry makes equal and the rounding of positions and of closed loops parts.
fn same(modal: &Modal, i: usize, j: usize) -> bool {
    let apart = |k: usize| modal.kind[k] == Kind::Rigid || modal.near_defective[k];
    !apart(i) && !apart(j) && (modal.s[i] - modal.s[j]).norm() <= SAME_ROOT * modal.s[j].norm()
}

/// d(|s|/2 pi) and d(-Re s/|s|) of ds.
fn slopes(s: C, ds: C) -> (f64, f64) {
    let size = s.norm();
    if size == 0.0 {
        return (if ds == C::ZERO { 0.0 } else { f64::NAN }, f64::NAN);
    }
    let growth = (s.conj() * ds).re;
    (growth / size / std::f64::consts::TAU, -ds.re / size + s.re * growth / size.powi(3))
}

/// The entries of one matrix along all directions; symmetric parts but for the directions where all of it counts.
fn slices(
    changes: &[Directional],
    pick: impl Fn(&Directional) -> &Entries,
    whole: &[bool],
    size: usize,
) -> Result<Slices> {
    let (mut rows, mut columns, mut direction, mut values) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    for mirrored in [false, true] {
        for (p, change) in changes.iter().enumerate().filter(|(p, _)| !mirrored || !whole[*p]) {
            let entries = pick(change);
            let (i, j) = if mirrored { (&entries.columns, &entries.rows) } else { (&entries.rows, &entries.columns) };
            rows.extend(i);
            columns.extend(j);
            direction.resize(rows.len(), p as i64);
            let share = if whole[p] { 1.0 } else { 0.5 };
            values.extend(entries.values.iter().map(|v| share * v));
        }
    }
    Slices::new(&rows, &columns, &direction, &values, size, changes.len())
}
