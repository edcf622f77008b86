//! The linearised model in absolute coordinates, sparse: O(n_bodies), whatever the depth of the tree.
//!
//! Each body moves by a twist x about its centre of mass, world axes, bodies in the order of the model. With the gradients g of
//! the elastic coordinates (twist of b against a at p_B) and of the constraints,
//! ```text
//! M x" + C x' + (K_geo + sum w g g^T) x + Phi^T lam = 0,   Phi x = 0
//! ```
//! All joints are constraints here, those of the spanning tree too. An interaction with the wrench W on b about the fixed point P
//! and the tangent K_g proportional to its force changes by dW = K_g (x_b - x_a) + x_a x* W, and its moment about a centre of
//! mass c that moves by dc by -dc x F more: these are the blocks of K_geo, whose sum is symmetric in equilibrium.
use faer::Mat;

use crate::constraint::loop_lengths::bounds;
use crate::constraint::loops::{LoopBlocks, column_scales};
use crate::constraint::singular_pose::reduction;
use crate::error::{Error, Result};
use crate::joint::Coordinate;
use crate::linalg::matrix::Matrix;
use crate::model::layout::flag::{HAS_PRELOAD, LENGTH_GIVEN};
use crate::model::layout::{bushing, joint, spring_damper, torsion};
use crate::model::tables::{BodyRef, Tables};
use crate::multibody::System;
use crate::multibody::assemble::{Effects, Scene};
use crate::multibody::connector::{
    CoordinateTangent, Interaction, Wanted, constraint_interaction, constraint_rows, coordinate_tangent, interaction,
    load_interaction,
};
use crate::multibody::numbers::Numbers;
use crate::multibody::placement;
use crate::multibody::placement::Placement;
use crate::multibody::placement::State;
use crate::multibody::placement::drawn_q;
use crate::multibody::placement::place;
use crate::multibody::topology::Owner;
use crate::run::Counts;
use crate::spatial::{Map6, Six, V3};
use crate::tolerances::constraints::CLOSED_ROUNDING;
use crate::tolerances::coordinates::SAME_POINT;
use crate::tolerances::matrices::{NO_ENERGY, NO_SPRING};

pub type Entries = Vec<(usize, usize, f64)>;

pub struct SparseForm {
    /// 6 x 6 about the centre of mass, per body of the model
    pub mass: Vec<Map6<f64>>,
    /// rows g of elastic coordinates and of constraints: (row, column, value)
    pub rows: Entries,
    /// 1/w per row; zero for constraints
    pub compliance: Vec<f64>,
    /// connector of each elastic row
    pub connector: Vec<Option<usize>>,
    pub geometric: Entries,
    pub damping: Entries,
    pub placement: Placement<f64>,
    pub loops: Option<LoopBlocks>,
    /// largest generalised force out of balance over the size of all forces, and its tree coordinate
    pub unbalanced: (f64, usize),
}

impl SparseForm {
    pub fn new(system: &System, state: &State, effects: Effects, counts: &mut Counts) -> Result<Self> {
        check(system, state)?;
        let topology = &*system.topology;
        let placement = place(topology, &system.geometry, &state.q, None);
        let loaded = loaded(system, state, effects)?;
        let mut builder = Builder {
            scene: Scene {
                topology,
                geometry: &system.geometry,
                x: &system.x,
                memory: &[],
                placement: &placement,
                rate: None,
                acceleration: None,
                t: 0.0,
                effects,
            },
            system,
            rows: Vec::new(),
            compliance: Vec::new(),
            connector: Vec::new(),
            geometric: Vec::new(),
            damping: Vec::new(),
        };
        builder.connectors()?;
        let (loops, lam) = builder.loops(loaded, counts)?;
        builder.constraints(loops.as_ref());
        let mut unbalanced = (0.0, 0);
        if loaded {
            builder.geometric_stiffness(&lam, counts);
            unbalanced = builder.unbalanced(&lam, loops.as_ref());
        }
        counts.add("sparse rows", builder.compliance.len() as u64);
        let Builder { rows, compliance, connector, geometric, damping, .. } = builder;
        Ok(SparseForm {
            mass: masses(system, &placement),
            rows,
            compliance,
            connector,
            geometric: symmetrised(geometric),
            damping: symmetrised(damping),
            placement,
            loops,
            unbalanced,
        })
    }

    /// Increments of the minimal coordinates from a motion of the bodies: per tree joint the relative twist along its columns.
    pub fn minimal(&self, system: &System, x: &[f64]) -> Vec<f64> {
        let topology = &*system.topology;
        let mut y = vec![0.0; topology.dofs.len()];
        let length = system.length;
        for (i, node) in topology.nodes.iter().enumerate() {
            let at = &self.placement.pose[i].p;
            let own = twist(x, node.body);
            let carried = node.parent.map_or_else(Six::zero, |p| {
                twist(x, topology.nodes[p].body).motion_at(&(at - self.placement.pose[p].p))
            });
            let columns = &self.placement.column[node.first..node.first + node.n];
            for (k, v) in along(columns, &(own - carried), length).iter().enumerate() {
                y[node.first + k] = *v;
            }
        }
        match &self.loops {
            None => y,
            Some(l) => l.independent.iter().map(|i| y[*i]).collect(),
        }
    }
}

pub fn twist(x: &[f64], body: usize) -> Six<f64> {
    let at = |k: usize| x[6 * body + k];
    Six::new(V3::new(at(0), at(1), at(2)), V3::new(at(3), at(4), at(5)))
}

/// Least squares on up to six columns; lengths are measured in the characteristic length.
fn along(columns: &[Six<f64>], v: &Six<f64>, length: f64) -> Vec<f64> {
    let weight = |a: &Six<f64>, b: &Six<f64>| a.l.dot(&b.l) / (length * length) + a.a.dot(&b.a);
    let n = columns.len();
    let gram = nalgebra::DMatrix::from_fn(n, n, |i, j| weight(&columns[i], &columns[j]));
    let right = nalgebra::DVector::from_fn(n, |i, _| weight(&columns[i], v));
    match gram.cholesky() {
        Some(c) => c.solve(&right).as_slice().to_vec(),
        None => vec![0.0; n],
    }
}

fn check(system: &System, state: &State) -> Result<()> {
    let topology = &*system.topology;
    let dense = "mb.modes(m) without n= takes the dense route, which knows them";
    if state.moving() {
        return Err(Error::route(format!(
            "the sparse route of large models knows states at rest only; this one moves: {dense}"
        )));
    }
    if topology.tables.loads.iter().any(|l| l.follower || l.torque) {
        return Err(Error::route(format!(
            "follower loads and torques make the stiffness nonsymmetric, which the sparse route of large models does not know: {dense}"
        )));
    }
    if let Some(name) = topology.tables.unusual() {
        return Err(Error::route(format!(
            "'{name}' is a nonholonomic joint, a drive, a coupler, a flexible body or air, which the sparse route of large models does not know: {dense}"
        )));
    }
    Ok(())
}

/// Does anything carry force? A drawn state without cause for force has none; rounding must not make one.
fn loaded(system: &System, state: &State, effects: Effects) -> Result<bool> {
    let topology = &*system.topology;
    let closed = closing(system, state, effects)?;
    let (t, x): (&Tables, _) = (&topology.tables, &system.x);
    let nonzero = |start: usize, n: usize| x[start..start + n].iter().any(|v| *v != 0.0);
    let apart = |a: usize, b: usize| {
        let p = V3::from_fn(|k, _| x[a + k]);
        let q = V3::from_fn(|k, _| x[b + k]);
        (q - p).norm() > SAME_POINT * (system.length + p.norm())
    };
    let gravity = effects.gravity && system.geometry.gravity.is_some_and(|g| g.norm() > 0.0);
    let joint = |j: &crate::model::tables::JointSpec| {
        j.flags & HAS_PRELOAD != 0 && nonzero(j.x + joint::PRELOAD, 6)
            || j.kind.has_length() && (j.flags & LENGTH_GIVEN != 0 || x[j.x + joint::LENGTH] != 0.0)
            || !j.kind.has_length() && apart(j.x + joint::AT_A, j.x + joint::AT_B)
    };
    let element = |e: &crate::model::tables::ElementSpec| {
        use crate::model::tables::ElementKind::*;
        match e.kind {
            Bushing => {
                e.flags & HAS_PRELOAD != 0 && nonzero(e.x + bushing::PRELOAD, 6)
                    || apart(e.x + bushing::AT_A, e.x + bushing::AT_B)
            }
            SpringDamper => {
                x[e.x + spring_damper::LENGTH] != 0.0
                    || e.flags & LENGTH_GIVEN != 0
                    || e.flags & HAS_PRELOAD != 0 && x[e.x + spring_damper::PRELOAD] != 0.0
            }
            Torsion => x[e.x + torsion::ANGLE] != 0.0 || e.flags & HAS_PRELOAD != 0 && x[e.x + torsion::PRELOAD] != 0.0,
        }
    };
    let from_drawn = placement::difference(topology, &drawn_q(topology, &system.geometry), &state.q);
    let scales = column_scales(topology, system.length);
    Ok(gravity
        || !t.loads.is_empty()
        || !t.laws.is_empty()
        || !t.functions.is_empty()
        || t.joints.iter().any(joint)
        || t.elements.iter().any(element)
        || from_drawn.iter().zip(&scales).any(|(d, scale)| d.abs() > closed * scale))
}

/// By how much closing loops that are drawn closed may move joints: rounding of points, in lengths of their loops or radians.
fn closing(system: &System, state: &State, effects: Effects) -> Result<f64> {
    if system.topology.rows.is_empty() {
        return Ok(SAME_POINT);
    }
    let rows = &system.decision(effects)?.rows;
    let rounding = bounds(system, &state.q, effects, rows).into_iter().fold(0.0, f64::max);
    Ok((CLOSED_ROUNDING * rounding).max(SAME_POINT))
}

fn masses(system: &System, placement: &Placement<f64>) -> Vec<Map6<f64>> {
    let topology = &*system.topology;
    let of = |(i, body): (usize, &crate::model::geometry::BodyGeometry<f64>)| {
        let r = &placement.pose[topology.node_of_body[i]].r;
        let inertia = r * body.inertia * r.transpose();
        Map6 {
            ll: crate::spatial::scaled_identity(body.mass),
            aa: (inertia + inertia.transpose()) * 0.5,
            ..Map6::zero()
        }
    };
    system.geometry.bodies.iter().enumerate().map(of).collect()
}

/// (A + A^T)/2 entry by entry; duplicates add up later.
fn symmetrised(entries: Entries) -> Entries {
    let mirrored: Vec<_> = entries.iter().map(|(i, j, v)| (*j, *i, 0.5 * v)).collect();
    let halves = entries.into_iter().map(|(i, j, v)| (i, j, 0.5 * v));
    halves.chain(mirrored).collect()
}

struct Builder<'a> {
    scene: Scene<'a, f64>,
    system: &'a System,
    rows: Entries,
    compliance: Vec<f64>,
    connector: Vec<Option<usize>>,
    geometric: Entries,
    damping: Entries,
}

/// A gradient at P as entries on the columns of its two bodies.
type Spread = Vec<(usize, f64)>;

impl Builder<'_> {
    fn arm(&self, body: usize, point: &V3<f64>) -> V3<f64> {
        let node = self.scene.topology.node_of_body[body];
        point - self.scene.placement.pose[node].p
    }

    /// g . (x_b - x_a) at P as a row over the bodies' twists.
    fn spread(&self, a: BodyRef, b: BodyRef, point: &V3<f64>, g: &Six<f64>) -> Spread {
        let mut out = Vec::with_capacity(12);
        for (body, sign) in [(a, -1.0), (b, 1.0)] {
            let Some(body) = body else { continue };
            // g . motion_at(arm) = (g about the centre of mass) . x
            let own = g.wrench_at(&-self.arm(body, point));
            out.extend((0..6).filter_map(|k| {
                let v = sign * own.get(k);
                (v != 0.0).then_some((6 * body + k, v))
            }));
        }
        out
    }

    fn push_row(&mut self, row: Spread, compliance: f64, connector: Option<usize>) {
        let i = self.compliance.len();
        self.rows.extend(row.into_iter().map(|(j, v)| (i, j, v)));
        self.compliance.push(compliance);
        self.connector.push(connector);
    }

    fn wanted(&self) -> Wanted {
        Wanted {
            tangent: true,
            geometric: false,
            damping: self.scene.effects.damping,
            laws: self.scene.effects.law_slopes,
            friction: self.scene.effects.friction,
            contact: self.scene.effects.contact,
        }
    }

    fn numbers(&self) -> Numbers<'_, f64> {
        self.scene.numbers()
    }

    fn connectors(&mut self) -> Result<()> {
        let topology = self.scene.topology;
        for (index, c) in topology.connectors.iter().enumerate() {
            let t = coordinate_tangent(
                topology,
                self.scene.geometry,
                self.scene.placement,
                self.numbers(),
                c,
                self.wanted(),
            );
            let rows: Vec<Spread> = t.gradients.iter().map(|g| self.spread(c.a, c.b, &t.point, g)).collect();
            self.elastic_rows(index, &t, &rows)?;
            if t.damped {
                self.add_damping(&t, &rows);
            }
        }
        Ok(())
    }

    /// One row for each principal stiffness. Scaled by its diagonal first, so that the units of a bushing do not mix.
    fn elastic_rows(&mut self, index: usize, t: &CoordinateTangent<f64>, rows: &[Spread]) -> Result<()> {
        let n = rows.len();
        let k = |i: usize, j: usize| 0.5 * (t.k[i][j] + t.k[j][i]);
        let diagonal = (0..n).all(|i| (0..n).all(|j| i == j || t.k[i][j] == 0.0));
        if diagonal {
            for (i, row) in rows.iter().enumerate() {
                self.spring(row.clone(), t.k[i][i], index);
            }
            return Ok(());
        }
        let size = |i: usize| {
            let d = k(i, i).abs();
            if d > 0.0 { d.sqrt() } else { 1.0 }
        };
        let skewed = (0..n).any(|i| (0..n).any(|j| (t.k[i][j] - t.k[j][i]).abs() > NO_ENERGY * size(i) * size(j)));
        if skewed {
            let topology = self.scene.topology;
            let name = match topology.connectors[index].owner {
                Owner::Element(e) => &topology.tables.elements[e].name,
                Owner::Joint(j) => &topology.tables.joints[j].name,
            };
            return Err(Error::route(format!(
                "the stiffness of '{name}' is not symmetric, which the sparse route of large models does not know: mb.modes(m) \
                 without n= takes the dense route"
            )));
        }
        let scaled = Mat::from_fn(n, n, |i, j| k(i, j) / (size(i) * size(j)));
        let eigen = scaled
            .self_adjoint_eigen(faer::Side::Lower)
            .map_err(|_| Error::singular("a stiffness matrix could not be diagonalised"))?;
        let (u, w) = (eigen.U(), eigen.S().column_vector());
        let largest = (0..n).map(|p| w[p].abs()).fold(0.0, f64::max);
        for p in 0..n {
            if w[p].abs() <= NO_SPRING * largest {
                continue;
            }
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
            for (i, a) in &row {
                self.geometric.extend(row.iter().map(|(j, b)| (*i, *j, w * a * b)));
            }
        }
    }

    fn add_damping(&mut self, t: &CoordinateTangent<f64>, rows: &[Spread]) {
        for (i, left) in rows.iter().enumerate() {
            for (j, right) in rows.iter().enumerate() {
                let c = t.c[i][j];
                if c == 0.0 {
                    continue;
                }
                for (p, a) in left {
                    self.damping.extend(right.iter().map(|(q, b)| (*p, *q, c * a * b)));
                }
            }
        }
    }

    fn loops(&self, loaded: bool, counts: &mut Counts) -> Result<(Option<LoopBlocks>, Vec<f64>)> {
        if self.scene.topology.rows.is_empty() {
            return Ok((None, Vec::new()));
        }
        counts.add("loop factorisations", 1);
        let mut jacobian = Matrix::zeros(self.scene.topology.rows.len(), self.system.n_tree(), true);
        self.scene.constraints_into(&mut jacobian);
        let decision = self.system.decision(self.scene.effects)?;
        let loops = reduction(self.system, &self.scene, &jacobian, &decision)?;
        let lam = match (&loops, loaded) {
            (Some(l), true) => l.multipliers(&jacobian, &decision.rows, self.scene.residual(None).as_slice()),
            _ => vec![0.0; self.scene.topology.rows.len()],
        };
        Ok((loops, lam))
    }

    fn constraints(&mut self, loops: Option<&LoopBlocks>) {
        let topology = self.scene.topology;
        for node in &topology.nodes {
            if let Some(joint) = node.joint {
                self.constrain(joint, topology.tables.joints[joint].kind.constraints());
            }
        }
        for (i, row) in topology.rows.iter().enumerate() {
            if loops.is_none_or(|l| l.dropped.binary_search(&i).is_err()) {
                self.constrain(row.joint, &[row.coordinate]);
            }
        }
    }

    fn constrain(&mut self, joint: usize, coordinates: &[Coordinate]) {
        let spec = &self.scene.topology.tables.joints[joint];
        let (point, rows) =
            constraint_rows(self.scene.topology, self.scene.geometry, self.scene.placement, joint, coordinates);
        for (_, g) in rows {
            self.push_row(self.spread(spec.a, spec.b, &point, &g), 0.0, None);
        }
    }

    fn geometric_stiffness(&mut self, lam: &[f64], counts: &mut Counts) {
        let topology = self.scene.topology;
        let (geometry, placement) = (self.scene.geometry, self.scene.placement);
        let effects = self.scene.effects;
        if effects.preload_stiffness {
            let wanted = Wanted { geometric: true, ..self.wanted() };
            for c in &topology.connectors {
                let of = |wanted| interaction(topology, geometry, placement, self.numbers(), c, wanted);
                let (with, without) = (of(wanted), of(self.wanted()));
                if let (Some((k, _)), Some((elastic, _))) = (&with.tangent, &without.tangent) {
                    let k = difference(k, elastic);
                    self.add_interaction(&with, &k);
                    counts.add("preload stiffness", 1);
                }
            }
        }
        for load in 0..topology.tables.loads.len() {
            let acting = load_interaction(topology, geometry, placement, load, self.scene.t, Wanted::GEOMETRY);
            if let Some((k, _)) = acting.tangent {
                self.add_interaction(&acting, &k);
                counts.add("load tangents", 1);
            }
        }
        if effects.constraint_force_stiffness {
            let mut carried = self.tree_multipliers(lam);
            carried.extend(self.scene.cut_multipliers(lam));
            for (joint, rows) in carried {
                let acting = constraint_interaction(topology, geometry, placement, joint, &rows, Wanted::GEOMETRY);
                if let Some((k, _)) = acting.tangent {
                    self.add_interaction(&acting, &k);
                    counts.add("constraint-force stiffness", 1);
                }
            }
        }
    }

    /// Multipliers of the tree joints from the wrenches of their subtrees, W = -sum lam g.
    fn tree_multipliers(&self, lam: &[f64]) -> Vec<(usize, Vec<(Coordinate, f64)>)> {
        let topology = self.scene.topology;
        let subtree = self.scene.subtree_wrenches(self.scene.body_wrenches(Some(lam)));
        let mut out = Vec::new();
        for (i, node) in topology.nodes.iter().enumerate() {
            let Some(joint) = node.joint else { continue };
            let coordinates = topology.tables.joints[joint].kind.constraints();
            let (point, rows) =
                constraint_rows(topology, self.scene.geometry, self.scene.placement, joint, coordinates);
            let w = subtree[i].wrench_at(&(point - self.scene.placement.pose[i].p));
            let w = if node.reversed { w } else { -w };
            let gradients: Vec<Six<f64>> = rows.into_iter().map(|(_, g)| g).collect();
            let lam = along(&gradients, &w, 1.0);
            out.push((joint, coordinates.iter().copied().zip(lam).collect()));
        }
        out
    }

    /// The blocks of an interaction, each column the change of wrenches for a unit motion of one body.
    fn add_interaction(&mut self, acting: &Interaction<f64>, k: &Map6<f64>) {
        let force = acting.wrench.l;
        if force.norm() + acting.wrench.a.norm() == 0.0 {
            return;
        }
        for (moved, is_b) in [(acting.a, false), (acting.b, true)] {
            let Some(moved) = moved else { continue };
            for j in 0..6 {
                let mut unit = [0.0; 6];
                unit[j] = 1.0;
                let own = twist(&unit, 0);
                let xi = own.motion_at(&self.arm(moved, &acting.point));
                let dw = if is_b { k.apply(&xi) } else { -k.apply(&xi) + xi.cross_force(&acting.wrench) };
                for (body, sign) in [(acting.a, 1.0), (acting.b, -1.0)] {
                    let Some(body) = body else { continue };
                    let mut change = dw.wrench_at(&-self.arm(body, &acting.point));
                    if body == moved {
                        change.a -= own.l.cross(&force);
                    }
                    let block = (0..6).map(|i| (6 * body + i, 6 * moved + j, sign * change.get(i)));
                    self.geometric.extend(block.filter(|e| e.2 != 0.0));
                }
            }
        }
    }

    fn unbalanced(&self, lam: &[f64], loops: Option<&LoopBlocks>) -> (f64, usize) {
        let residual = self.scene.residual(Some(lam));
        let (topology, length) = (&self.system.topology, self.system.length);
        let sizes = self.scene.force_sizes(length);
        let places: Vec<usize> = loops.map_or_else(|| (0..residual.len()).collect(), |l| l.independent.clone());
        let part = |i: usize| match sizes[topology.island_of(i)] {
            size if size > 0.0 => residual[i].abs() * topology.scale(i, length) / size,
            _ => 0.0,
        };
        places.into_iter().map(|i| (part(i), i)).max_by(|a, b| a.0.total_cmp(&b.0)).unwrap_or((0.0, 0))
    }
}

fn difference(a: &Map6<f64>, b: &Map6<f64>) -> Map6<f64> {
    Map6 { ll: a.ll - b.ll, la: a.la - b.la, al: a.al - b.al, aa: a.aa - b.aa }
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
