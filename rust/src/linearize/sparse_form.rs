//! The linearised model in absolute coordinates, sparse: O(n_bodies), whatever the depth of the tree.
//!
//! Each body moves by a twist about its centre of mass, world axes; modal coordinates follow behind all bodies, and a node of a flexible
//! body is a massless body on constant columns behind its frame. It is the tangent of the same scene whose tree has no joints
//! (`place_free`): elements, loads and multipliers have one text, `path` spreads it over two bodies here and along the tree elsewhere. With
//! the gradients g of the elastic coordinates and of the constraints,
//! ```text
//! M x" + D x' + (S + sum w g g^T) x + Phi^T lam = 0,   Phi x = 0
//! ```
//! All joints are constraints here, those of the spanning tree too; what they carry turns as `tree_joint` tells. On motions that the
//! constraints allow S is symmetric in equilibrium, unless forces have no potential.
use faer::Mat;
use nalgebra::DMatrix;

use crate::constraint::loops::LoopBlocks;
use crate::constraint::singular_pose::reduction;
use crate::error::{Error, Result};
use crate::linalg::entries::{Entries as Collect, Triplets};
use crate::linalg::matrix::Matrix;
use crate::linalg::sparse::Csc;
use crate::linearize::loaded::loaded;
use crate::linearize::sparse_motion::{Motion, motion};
use crate::model::tables::{BodyRef, Tables};
use crate::multibody::System;
use crate::multibody::assemble::{Effects, Scene};
use crate::multibody::connector::{Elastic, Interaction, Wanted, interaction, load_interaction};
use crate::multibody::flexible::{Fold, node_rates};
use crate::multibody::path::{add_tangent, add_wrench, path};
use crate::multibody::placement::{Placement, State, free_rates, place, place_free};
use crate::multibody::potential::has_no_potential;
use crate::multibody::topology::{Purpose, Topology};
use crate::multibody::tree_joint::TreeJoint;
use crate::run::Counts;
use crate::spatial::{Six, V3};
use crate::tolerances::matrices::NO_ENERGY;

pub type Entries = Vec<(usize, usize, f64)>;

pub struct SparseForm {
    /// M
    pub mass: Entries,
    /// rows g of elastic coordinates and of constraints: (row, column, value)
    pub rows: Entries,
    /// 1/w per row; zero for constraints
    pub compliance: Vec<f64>,
    /// connector of each elastic row, behind all connectors the flexible body; None of constraints
    pub connector: Vec<Option<usize>>,
    /// S
    pub stiffness: Entries,
    /// D
    pub damping: Entries,
    /// whether S or D may have parts that are not symmetric
    pub general: bool,
    /// of a state that moves: then rows of joints are there in place of constraints
    pub motion: Option<Motion>,
    pub placement: Placement<f64>,
    /// the topology of the coordinates, and where they are
    pub free: Topology,
    pub free_placement: Placement<f64>,
    pub loops: Option<LoopBlocks>,
    /// largest generalised force out of balance over the size of all forces, and its tree coordinate
    pub unbalanced: (f64, usize),
}

impl SparseForm {
    /// `acceleration` of the tree coordinates at z" = 0, as of a linearisation; empty means zero.
    pub fn new(
        system: &System,
        state: &State,
        acceleration: &[f64],
        effects: Effects,
        counts: &mut Counts,
    ) -> Result<Self> {
        check(system, state, effects)?;
        let topology = &*system.topology;
        let free = Topology::new(Tables { absolute: true, ..topology.tables.clone() })?;
        let rate = state.moving().then_some(state.rate.as_slice());
        let placement = place(topology, &system.geometry, &state.q, rate);
        let free_placement = place_free(&free, topology, &system.geometry, &placement, rate);
        let scene = |topology, placement, rate, acceleration| Scene {
            topology,
            geometry: &system.geometry,
            x: &system.x,
            memory: &[],
            placement,
            rate,
            acceleration,
            t: 0.0,
            effects,
        };
        let given = Some(acceleration).filter(|a| rate.is_some() && !a.is_empty());
        let tree = scene(topology, &placement, rate, given);
        let centres = centres(&tree);
        let moved = rate.zip(placement.velocity.as_ref()).map(|(rate, v)| {
            let rates = free_rates(&free, topology, rate, v);
            (rates, free_accelerations(&free, topology, &centres))
        });
        let (rates, accelerations) = (moved.as_ref().map(|m| m.0.as_slice()), moved.as_ref().map(|m| m.1.as_slice()));
        let motion = rate.map(|_| motion(&tree, &free, &centres));
        let fold = Fold::of(&free, &system.geometry, &placement.modal);
        let columns = free.dofs.len();
        let empty = || Matrix::zeros(columns, columns, true);
        let mut builder = Builder {
            tree,
            free: scene(&free, &free_placement, rates, accelerations),
            system,
            fold: fold.as_ref(),
            general: has_no_potential(system) || rate.is_some(),
            loaded: rate.is_some() || loaded(system, state, effects)?,
            rows: Vec::new(),
            compliance: Vec::new(),
            connector: Vec::new(),
            stiffness: empty(),
            damping: empty(),
        };
        let mass = builder.inertia(counts);
        builder.connectors(counts)?;
        builder.modal()?;
        let (loops, lam) = builder.loops(counts)?;
        if motion.is_none() {
            builder.constraints(loops.as_ref());
        }
        let mut unbalanced = (0.0, 0);
        if builder.loaded {
            builder.loads(counts);
            builder.joint_forces(&lam, counts);
            builder.free.add_switched(&mut builder.stiffness);
            unbalanced = builder.unbalanced(&lam, loops.as_ref());
        }
        counts.add("sparse rows", builder.compliance.len() as u64);
        let Builder { rows, compliance, connector, stiffness, damping, general, .. } = builder;
        let size = free.n_tree;
        let settled = |list: Entries| if general { list } else { symmetrised(size, list) };
        let [stiffness, damping] = [stiffness, damping].map(|m| settled(folded(&m, fold.as_ref())));
        Ok(SparseForm {
            mass,
            rows,
            compliance,
            connector,
            stiffness,
            damping,
            general,
            motion,
            placement,
            free,
            free_placement,
            loops,
            unbalanced,
        })
    }

    /// Number of coordinates.
    pub fn size(&self) -> usize {
        self.free.n_tree
    }

    /// Twists of all bodies about their centres of mass, then of the nodes of flexible ones, from the coordinates.
    pub fn bodies(&self, system: &System, x: &[f64]) -> Vec<f64> {
        let (free, placed) = (&self.free, &self.free_placement);
        let nodes = node_rates(free, &system.geometry, &placed.modal, x);
        let value = |d: usize| if d < x.len() { x[d] } else { nodes[d - x.len()] };
        let mut twist: Vec<Six<f64>> = Vec::with_capacity(free.nodes.len());
        let mut out = vec![0.0; 6 * free.nodes.len()];
        for (i, node) in free.nodes.iter().enumerate() {
            let carried =
                node.parent.map_or_else(Six::zero, |p| twist[p].motion_at(&(placed.pose[i].p - placed.pose[p].p)));
            let own = (node.first..node.first + node.n).fold(carried, |sum, d| sum + placed.column[d].scaled(value(d)));
            (0..6).for_each(|k| out[6 * node.body + k] = own.get(k));
            twist.push(own);
        }
        out
    }

    /// Increments of the minimal coordinates: per tree joint the relative twist along its columns, of shapes themselves.
    pub fn minimal(&self, system: &System, x: &[f64]) -> Vec<f64> {
        let topology = &*system.topology;
        let moved = self.bodies(system, x);
        let mut y = vec![0.0; topology.n_tree];
        for (i, node) in topology.nodes.iter().enumerate().filter(|(_, n)| !n.kind.is_modal()) {
            let joint = TreeJoint::new(topology, &system.geometry, &self.placement, i);
            let moved =
                |n: usize| twist(&moved, topology.nodes[n].body).motion_at(&(joint.point - self.placement.pose[n].p));
            let relative = moved(i) - node.parent.map_or_else(Six::zero, moved);
            for (k, dual) in joint.duals.iter().enumerate() {
                y[node.first + k] = dual.dot(&relative);
            }
        }
        for (own, free) in topology.modal.iter().zip(&self.free.modal) {
            y[own.first..own.first + own.m].copy_from_slice(&x[free.first..free.first + free.m]);
        }
        match &self.loops {
            None => y,
            Some(l) => l.independent.iter().map(|i| y[*i]).collect(),
        }
    }
}

fn twist(x: &[f64], body: usize) -> Six<f64> {
    let at = |k: usize| x[6 * body + k];
    Six::new(V3::new(at(0), at(1), at(2)), V3::new(at(3), at(4), at(5)))
}

/// Per node of the tree: the acceleration of its centre of mass, and its angular acceleration.
fn centres(tree: &Scene<'_, f64>) -> Vec<Six<f64>> {
    let Some(velocity) = tree.placement.velocity.as_ref() else { return Vec::new() };
    let spatial = tree.free_accelerations();
    let centre = |(a, v): (Six<f64>, &Six<f64>)| Six::new(a.l + v.a.cross(&v.l), a.a);
    spatial.into_iter().zip(&velocity.body).map(centre).collect()
}

fn free_accelerations(free: &Topology, topology: &Topology, centres: &[Six<f64>]) -> Vec<f64> {
    let mut out = vec![0.0; free.n_tree];
    for node in &free.nodes {
        let a = &centres[topology.node_of_body[node.body]];
        (0..6).for_each(|k| out[node.first + k] = a.get(k));
    }
    out
}

fn check(system: &System, state: &State, effects: Effects) -> Result<()> {
    let dense = "mb.modes(m) without n= takes the dense route, which knows them";
    let topology = &*system.topology;
    if state.moving() && (!topology.rows.is_empty() || topology.is_flexible()) {
        return Err(Error::route(format!(
            "of states that move the sparse route of large models knows open trees of rigid bodies only, without drives, couplers and constraints: {dense}"
        )));
    }
    if state.moving()
        && !(effects.gyroscopic
            && effects.centrifugal
            && effects.constraint_force_stiffness
            && effects.preload_stiffness)
    {
        return Err(Error::route(format!(
            "of states that move the sparse route of large models leaves out no effect but forces: {dense}"
        )));
    }
    if let Some(air) = system.topology.tables.air.first() {
        return Err(Error::route(format!(
            "'{}' is air, which the sparse route of large models does not know: {dense}",
            air.name
        )));
    }
    Ok(())
}

/// (A + A^T)/2. Duplicates are added up first: each entry and its mirror are then the same sum of two, to the last bit.
pub fn symmetrised(n: usize, entries: Entries) -> Entries {
    let a = Csc::from_entries(n, n, entries);
    a.combined(0.5, 0.5, &a.transposed()).entries().collect()
}

/// From the columns to the coordinates.
fn folded(matrix: &Matrix, fold: Option<&Fold<'_, f64>>) -> Entries {
    let mut list = Vec::new();
    matrix.each(|i, j, v| match fold {
        _ if v == 0.0 => {}
        None => list.push((i, j, v)),
        Some(fold) => fold.each(i, v, |i, v| fold.each(j, v, |j, v| list.push((i, j, v)))),
    });
    list
}

struct Builder<'a> {
    /// along the tree, and with every body free
    tree: Scene<'a, f64>,
    free: Scene<'a, f64>,
    system: &'a System,
    fold: Option<&'a Fold<'a, f64>>,
    general: bool,
    loaded: bool,
    rows: Entries,
    compliance: Vec<f64>,
    connector: Vec<Option<usize>>,
    /// over the columns, behind the coordinates those of nodes
    stiffness: Matrix,
    damping: Matrix,
}

/// A row over the coordinates.
type Spread = Vec<(usize, f64)>;

impl<'a> Builder<'a> {
    fn empty(&self) -> Matrix {
        let columns = self.free.topology.dofs.len();
        Matrix::zeros(columns, columns, true)
    }

    /// M; what gravity and velocities do to shapes and bodies goes into S and D.
    fn inertia(&mut self, counts: &mut Counts) -> Entries {
        let (mass, stiffness, gyroscopic) = self.free.inertia_tangent(counts, || self.empty());
        if self.loaded {
            stiffness.each(|i, j, v| self.stiffness.add(i, j, v));
        }
        if let Some(gyroscopic) = gyroscopic {
            gyroscopic.each(|i, j, v| self.damping.add(i, j, v));
        }
        folded(&mass, self.fold)
    }

    /// g . (x_b - x_a) at a point.
    fn spread(&self, a: BodyRef, b: BodyRef, point: &V3<f64>, g: &Six<f64>) -> Spread {
        let entries = path(self.free.topology, self.free.placement, a, b, point);
        let mut out = Vec::with_capacity(12);
        for entry in entries {
            let v = g.dot(&entry.signed());
            match self.fold {
                _ if v == 0.0 => {}
                None => out.push((entry.dof, v)),
                Some(fold) => fold.each(entry.dof, v, |k, v| out.push((k, v))),
            }
        }
        merged(out)
    }

    fn push_row(&mut self, row: Spread, compliance: f64, connector: Option<usize>) {
        let i = self.compliance.len();
        self.rows.extend(row.into_iter().map(|(j, v)| (i, j, v)));
        self.compliance.push(compliance);
        self.connector.push(connector);
    }

    /// Elastic parts as rows, the rest as entries.
    fn connectors(&mut self, counts: &mut Counts) -> Result<()> {
        let effects = self.free.effects;
        let geometric = self.loaded && effects.preload_stiffness;
        let wanted = Wanted { tangent: true, geometric, laws: effects.law_slopes, ..effects.wanted() };
        let (topology, geometry, placement) = (self.free.topology, self.free.geometry, self.free.placement);
        for (index, c) in topology.connectors.iter().enumerate().filter(|(_, c)| wanted.acts(c)) {
            let mut acting = interaction(topology, geometry, placement, self.free.numbers(), c, wanted);
            if let Some(Elastic { gradients, k, c: slopes }) = acting.elastic.take() {
                let rows: Vec<Spread> = gradients.iter().map(|g| self.spread(c.a, c.b, &acting.point, g)).collect();
                let n = rows.len();
                self.elastic_rows(index, &DMatrix::from_fn(n, n, |i, j| k[i][j]), &rows)?;
                if acting.damped {
                    add_products(&mut self.damping, &DMatrix::from_fn(n, n, |i, j| slopes[i][j]), &rows);
                }
            }
            let damping = acting.damped.then_some(&mut self.damping);
            add_tangent(topology, placement, &acting, geometric, &mut self.stiffness, damping);
            if geometric && !acting.wrench.is_absent() {
                counts.add("preload stiffness", 1);
            }
        }
        Ok(())
    }

    /// Stiffness and damping of shapes.
    fn modal(&mut self) -> Result<()> {
        let first = self.free.topology.connectors.len();
        for (i, (modal, g)) in self.free.topology.modal.iter().zip(&self.free.geometry.flexible).enumerate() {
            let rows: Vec<Spread> = (0..modal.m).map(|k| vec![(modal.first + k, 1.0)]).collect();
            self.elastic_rows(first + i, &DMatrix::from_row_slice(modal.m, modal.m, &g.k), &rows)?;
            if g.damped && self.free.effects.damping {
                add_products(&mut self.damping, &DMatrix::from_row_slice(modal.m, modal.m, &g.c), &rows);
            }
        }
        Ok(())
    }

    /// One row for each principal stiffness, scaled by its diagonal first, so that the units of a bushing do not mix; a skew part goes
    /// into S.
    fn elastic_rows(&mut self, index: usize, k: &DMatrix<f64>, rows: &[Spread]) -> Result<()> {
        let n = rows.len();
        let mean = |i: usize, j: usize| 0.5 * (k[(i, j)] + k[(j, i)]);
        if (0..n).all(|i| (0..n).all(|j| i == j || k[(i, j)] == 0.0)) {
            for (i, row) in rows.iter().enumerate() {
                self.spring(row.clone(), k[(i, i)], index);
            }
            return Ok(());
        }
        let size = |i: usize| {
            let d = k[(i, i)].abs();
            if d > 0.0 { d.sqrt() } else { 1.0 }
        };
        let skewed = (0..n).any(|i| (0..n).any(|j| (k[(i, j)] - k[(j, i)]).abs() > NO_ENERGY * size(i) * size(j)));
        if skewed {
            self.general = true;
            add_products(&mut self.stiffness, &DMatrix::from_fn(n, n, |i, j| k[(i, j)] - mean(i, j)), rows);
        }
        let scaled = Mat::from_fn(n, n, |i, j| mean(i, j) / (size(i) * size(j)));
        let eigen = scaled
            .self_adjoint_eigen(faer::Side::Lower)
            .map_err(|_| Error::singular("a stiffness matrix could not be diagonalised"))?;
        let (u, w) = (eigen.U(), eigen.S().column_vector());
        let largest = (0..n).map(|p| w[p].abs()).fold(0.0, f64::max);
        for p in (0..n).filter(|p| w[*p].abs() > NO_ENERGY * largest) {
            let mut sum: Spread = Vec::new();
            for (i, row) in rows.iter().enumerate() {
                let s = u[(i, p)] * size(i);
                sum.extend(row.iter().map(|(j, v)| (*j, s * v)));
            }
            self.spring(merged(sum), w[p], index);
        }
        Ok(())
    }

    /// A negative stiffness has no place among the compliances, whose energies must be positive.
    fn spring(&mut self, row: Spread, w: f64, index: usize) {
        if w > 0.0 {
            self.push_row(row, 1.0 / w, Some(index));
        } else if w < 0.0 {
            add_products(&mut self.stiffness, &DMatrix::from_element(1, 1, w), &[row]);
        }
    }

    fn loops(&self, counts: &mut Counts) -> Result<(Option<LoopBlocks>, Vec<f64>)> {
        if self.tree.topology.rows.is_empty() {
            return Ok((None, Vec::new()));
        }
        counts.add("loop factorisations", 1);
        let mut jacobian = Matrix::zeros(self.tree.topology.rows.len(), self.system.n_tree(), true);
        self.tree.constraints_into(&mut jacobian);
        let decision = self.system.decision(self.tree.effects)?;
        let loops = reduction(self.system, &self.tree, &jacobian, &decision)?;
        let lam = match (&loops, self.loaded) {
            (Some(l), true) => l.multipliers(&jacobian, &decision.rows, self.tree.residual(None).as_slice()),
            _ => vec![0.0; self.tree.topology.rows.len()],
        };
        Ok((loops, lam))
    }

    /// The rows that are needed: those of tree joints and of cut ones, of drives, couplers and functions.
    fn constraints(&mut self, loops: Option<&LoopBlocks>) {
        let rows = &self.free.topology.rows;
        let mut gradients = Matrix::zeros(rows.len(), self.free.topology.n_tree, true);
        self.free.constraints_into(&mut gradients);
        let mut spread: Vec<Spread> = vec![Vec::new(); rows.len()];
        gradients.each(|i, j, v| {
            if v != 0.0 {
                spread[i].push((j, v));
            }
        });
        let mut needed: Vec<bool> = rows.iter().map(|row| self.free.effects.row(row)).collect();
        for (of_tree, i) in self.row_places().into_iter().enumerate() {
            needed[i] &= loops.is_none_or(|l| l.dropped.binary_search(&of_tree).is_err());
        }
        for (row, _) in spread.into_iter().zip(needed).filter(|(_, needed)| *needed) {
            self.push_row(merged(row), 0.0, None);
        }
    }

    /// Where the rows of the tree are among those with every body free, which has the rows of all joints, in the same order.
    fn row_places(&self) -> Vec<usize> {
        let (own, all) = (&self.tree.topology.rows, &self.free.topology.rows);
        let is_cut = |joint: usize| self.tree.topology.cut.binary_search(&joint).is_ok();
        let kept = (0..all.len()).filter(|i| all[*i].purpose != Purpose::Joint || is_cut(all[*i].joint));
        let places: Vec<usize> = kept.collect();
        debug_assert_eq!(places.len(), own.len());
        places
    }

    fn loads(&mut self, counts: &mut Counts) {
        let (topology, placement) = (self.free.topology, self.free.placement);
        for load in (0..topology.tables.loads.len()).filter(|l| topology.tables.loads[*l].mode.is_none()) {
            let acting = load_interaction(topology, self.free.geometry, placement, load, self.free.t, Wanted::GEOMETRY);
            add_tangent(topology, placement, &acting, true, &mut self.stiffness, None);
            counts.add("load tangents", 1);
        }
    }

    /// The stiffness of all forces in joints; of those that cut joints and further rows carry with the multipliers `lam`.
    fn joint_forces(&mut self, lam: &[f64], counts: &mut Counts) {
        if !self.free.effects.constraint_force_stiffness {
            return;
        }
        let free = &self.free;
        let n = free.topology.n_tree;
        let mut made = Triplets::new(n, n);
        free.multiplier_stiffness_into(&self.on_all_rows(lam), &mut made, counts);
        let mut carried = vec![Six::zero(); free.topology.nodes.len()];
        for acting in self.carrying(lam) {
            add_tangent(free.topology, free.placement, &acting, true, &mut self.stiffness, None);
            add_wrench(free.topology, free.placement, &acting, &mut carried);
            counts.add("constraint-force stiffness", 1);
        }
        if let Some(fold) = self.fold.filter(|f| f.is_quadratic()) {
            let sums = free.body_wrenches(None).into_iter().zip(carried).map(|(sum, w)| sum - w).collect();
            fold.add_turned_forces(&free.over_columns(sums), &mut made);
        }
        made.list.into_iter().for_each(|(i, j, v)| self.stiffness.add(i as usize, j as usize, v));
    }

    /// Multipliers of the rows with every body free; those of tree joints are zero, `carrying` has their wrenches.
    fn on_all_rows(&self, lam: &[f64]) -> Vec<f64> {
        let mut all = vec![0.0; self.free.topology.rows.len()];
        self.row_places().into_iter().zip(lam).for_each(|(i, l)| all[i] = *l);
        all
    }

    /// The wrenches that the joints of the tree carry.
    fn carrying(&self, lam: &[f64]) -> Vec<Interaction<f64>> {
        let (topology, geometry, placement) = (self.tree.topology, self.tree.geometry, self.tree.placement);
        let subtree = self.tree.subtree_wrenches(self.tree.body_wrenches(Some(lam)));
        let joints = (0..topology.nodes.len()).filter(|i| topology.nodes[*i].joint.is_some());
        let loaded = joints.filter(|i| !subtree[*i].is_absent());
        loaded.map(|i| TreeJoint::new(topology, geometry, placement, i).carrying(&subtree[i])).collect()
    }

    fn unbalanced(&self, lam: &[f64], loops: Option<&LoopBlocks>) -> (f64, usize) {
        let residual = self.tree.residual(Some(lam));
        let (topology, length) = (&self.system.topology, self.system.length);
        let (sizes, _) = self.tree.force_sizes(length);
        let places: Vec<usize> = loops.map_or_else(|| (0..residual.len()).collect(), |l| l.independent.clone());
        let part = |i: usize| match sizes[topology.island_of(i)] {
            size if size > 0.0 => residual[i].abs() * topology.scale(i, length) / size,
            _ => 0.0,
        };
        places.into_iter().map(|i| (part(i), i)).max_by(|a, b| a.0.total_cmp(&b.0)).unwrap_or((0.0, 0))
    }
}

/// sum k_ij g_i^T g_j.
fn add_products(out: &mut Matrix, k: &DMatrix<f64>, rows: &[Spread]) {
    for (i, left) in rows.iter().enumerate() {
        for (j, right) in rows.iter().enumerate().filter(|(j, _)| k[(i, *j)] != 0.0) {
            for (p, a) in left {
                right.iter().for_each(|(q, b)| out.add(*p, *q, k[(i, j)] * a * b));
            }
        }
    }
}

fn merged(mut row: Spread) -> Spread {
    row.sort_by_key(|e| e.0);
    let mut out: Spread = Vec::with_capacity(row.len());
    for (j, v) in row {
        match out.last_mut().filter(|last| last.0 == j) {
            Some(last) => last.1 += v,
            None => out.push((j, v)),
        }
    }
    out
}
