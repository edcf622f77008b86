//! Exact linearisation at a state, in minimal coordinates.
//!
//! ```text
//! M y" + D y' + S y = 0,   X'' = B''^T X B'',   C = sym D, G = skew D, K = sym S, N = skew S
//! ```
//! At a moving state of a closed loop B'' changes in time; with y = B'' z,
//! D'' = B''^T (D B'' + 2 M B''') and S'' = B''^T (S B'' + D B''' + M B''''), dots by second-order dual numbers in time.
//! Velocity rows about a moving state: see `rolling`.
pub mod air_states;
pub mod force_rounding;
pub mod loaded;
pub mod model_modes;
mod nearest_damped;
pub mod parts;
mod reach;
pub mod reactions;
pub mod rolling;
pub mod sparse_bodies;
pub mod sparse_form;
pub mod sparse_motion;
pub mod stiffness_factor;
pub mod strain_rows;

use nalgebra::{DMatrix, DVector};
use num_dual::Dual2;

use crate::constraint::closure::scene_at_rest;
use crate::constraint::loops::{LoopBlocks, Loops, column_scales};
use crate::constraint::singular_pose::reduction;
use crate::error::{Error, Result};
use crate::linalg::entries::Sizes;
use crate::linalg::matrix::Matrix;
use crate::linearize::reach::reach;
use crate::linearize::rolling::{Follow, rolling, rolls};
use crate::model::geometry::Geometry;
use crate::multibody::System;
use crate::multibody::assemble::{Effects, Scene, Tangent};
use crate::multibody::connector::collapsed;
use crate::multibody::flexible::Fold;
use crate::multibody::placement::{Placement, State, advance, place};
use crate::multibody::topology::Topology;
use crate::run::Counts;
use crate::spatial::{Real, Six};
use crate::tolerances::linearisation::UNRESOLVED;

/// Second-order matrices in minimal coordinates: `damping` is D, `stiffness` S; None where nothing acts.
#[derive(Debug, Clone)]
pub struct Matrices<T: Real> {
    pub mass: DMatrix<T>,
    pub damping: Option<DMatrix<T>>,
    pub stiffness: DMatrix<T>,
}

/// Matrices in minimal coordinates at one state, and what they were made of.
#[derive(Debug, Clone)]
pub struct Linearization {
    /// M, D and S
    pub matrices: Matrices<f64>,
    /// how closed loops were reduced
    pub loops: Option<Loops>,
    /// B'' on the dependent coordinates
    pub dependent_map: Option<DMatrix<f64>>,
    /// what closed loops were reduced from
    pub tree: Option<Tree>,
    /// multipliers of the constraint rows
    pub lam: Vec<f64>,
    /// generalised force that is not balanced, minimal coordinates
    pub residual: DVector<f64>,
    /// acceleration of the tree coordinates at z" = 0
    pub acceleration: Option<Vec<f64>>,
    /// 6 n_bodies x dof: twist of each body's origin, world axes, bodies in the order of the model
    pub body_map: DMatrix<f64>,
    /// how far a unit of each coordinate moves the bodies, in characteristic lengths and radians
    pub reach: Vec<f64>,
    /// (dof, 6): momentum of a common rigid motion about the world origin
    pub ground_coupling: DMatrix<f64>,
    /// the size of all forces at work, moments over the characteristic length, times that length
    pub force_scale: f64,
    /// the same of the island that each minimal coordinate moves
    pub force_sizes: Vec<f64>,
    /// do any act in it, but those of strains below a rounding of 1e-8?
    pub acted_on: Vec<bool>,
}

/// Over the tree coordinates of a model with closed loops.
#[derive(Debug, Clone)]
pub struct Tree {
    /// what is left open of each constraint row
    pub phi: DVector<f64>,
    /// its Jacobian
    pub jacobian: DMatrix<f64>,
    /// S, with that of the multipliers
    pub stiffness: DMatrix<f64>,
}

/// Rows of tree coordinates to minimal ones, B''^T X.
pub(crate) fn reduce_rows<T: Real>(x: DMatrix<T>, loops: Option<(&Loops, &DMatrix<T>)>) -> DMatrix<T> {
    match loops {
        None => x,
        Some((l, b)) => {
            let pick = |rows: &[usize]| DMatrix::from_fn(rows.len(), x.ncols(), |i, j| x[(rows[i], j)]);
            pick(&l.independent) + b.transpose() * pick(&l.dependent)
        }
    }
}

/// The sizes of all forces at work in each island, moments over the characteristic length. Forces that the stiffness makes of
/// displacements below a rounding of 1e-8 count as none: what is left of them is no imbalance. And whether any but these act there.
fn force_sizes(scene: &Scene<'_, f64>, tangent: &Tangent<f64>, length: f64) -> (Vec<f64>, Vec<bool>) {
    let mut stiffest = vec![0.0_f64; scene.topology.n_islands()];
    for (i, column) in column_scales(scene.topology, length).into_iter().enumerate() {
        let own = &mut stiffest[scene.topology.island_of(i)];
        *own = own.max(tangent.stiffness[(i, i)].abs() * column * column);
    }
    let (forces, are_loaded) = scene.force_sizes(length);
    let sized = forces.into_iter().zip(stiffest).zip(are_loaded);
    sized.map(|((force, k), loaded)| (force + UNRESOLVED * k, loaded || force > UNRESOLVED * k)).unzip()
}

/// Sizes of the terms that were added up for each entry of the stiffness of a state at rest, minimal coordinates.
pub fn stiffness_terms(setting: &Setting<'_>, made: &Linearization) -> DMatrix<f64> {
    let system = setting.system;
    let placement = place(&system.topology, &system.geometry, &setting.state.q, None);
    let scene = scene_at_rest(system, &placement, setting.effects);
    let n = system.n_tree();
    let tangent = scene.tangent_into(Some(&made.lam), &mut Counts::default(), || Sizes(DMatrix::zeros(n, n)));
    let terms = tangent.stiffness.0;
    match (&made.loops, &made.dependent_map) {
        (Some(l), Some(b)) => l.reduce(&terms, &b.map(f64::abs)),
        _ => terms,
    }
}

impl Linearization {
    /// Tree increments of minimal ones.
    pub fn expand(&self, z: DVector<f64>) -> Result<DVector<f64>> {
        let n = self.matrices.mass.nrows();
        if z.len() != n || z.iter().any(|v| !v.is_finite()) {
            return Err(Error::model(format!("{n} finite increments are needed, {} were given", z.len())));
        }
        Ok(match (&self.loops, &self.dependent_map) {
            (Some(l), Some(b)) => l.expand(b, &z),
            _ => z,
        })
    }

    /// Modal coordinates of all flexible bodies per minimal coordinate.
    pub fn modal_map(&self, topology: &Topology) -> DMatrix<f64> {
        let coordinates = self.coordinates(topology.n_tree);
        let first = topology.modal.first().map_or(topology.n_tree, |m| m.first);
        let mut map = DMatrix::zeros(topology.n_tree - first, coordinates.len());
        for (k, i) in coordinates.iter().enumerate() {
            if *i >= first {
                map[(i - first, k)] = 1.0;
            }
        }
        if let (Some(l), Some(b)) = (&self.loops, &self.dependent_map) {
            for (row, i) in l.dependent.iter().enumerate().filter(|(_, i)| **i >= first) {
                map.row_mut(i - first).copy_from(&b.row(row));
            }
        }
        map
    }

    /// Indices of the minimal coordinates among the tree coordinates.
    pub fn coordinates(&self, n_tree: usize) -> Vec<usize> {
        self.loops.as_ref().map_or_else(|| (0..n_tree).collect(), |l| l.independent.clone())
    }
}

/// Where a model is linearised, and which effects are counted.
pub struct Setting<'a> {
    /// the model
    pub system: &'a System,
    /// coordinates and rates
    pub state: &'a State,
    /// what laws remember; empty means centred
    pub memory: &'a [f64],
    /// of the tree coordinates at z" = 0, such as those of a body that is carried around off the axis; empty means zero
    pub acceleration: &'a [f64],
    /// what is counted
    pub effects: Effects,
}

impl Setting<'_> {
    pub(crate) fn rate<T: Real>(&self) -> Option<Vec<T>> {
        self.state.moving().then(|| self.state.rate.iter().map(|r| T::from(*r)).collect())
    }

    /// What is assembled there; accelerations are left out.
    fn scene<'a>(&'a self, placement: &'a Placement<f64>, rate: Option<&'a [f64]>) -> Scene<'a, f64> {
        let system = self.system;
        Scene { memory: self.memory, rate, ..scene_at_rest(system, placement, self.effects) }
    }
}

/// Rows of tree coordinates in y' = B'' z' + first z, y" = B'' z" + rate z' + second z; of closed loops first = B''',
/// rate = 2 B''', second = B''''.
pub(crate) struct Turning<T: Real> {
    /// of closed loops the dependent coordinates
    pub(crate) rows: Vec<usize>,
    pub(crate) first: DMatrix<T>,
    pub(crate) rate: DMatrix<T>,
    pub(crate) second: DMatrix<T>,
    /// of all tree coordinates at z" = 0, drives at constant rate
    pub(crate) acceleration: Vec<T>,
}

/// What B'' turns along: the numbers, the coordinates and the rates of the tree coordinates.
pub(crate) struct Path<'a, T: Real> {
    pub x: &'a [T],
    pub q: &'a [T],
    pub rate: &'a [T],
}

/// Phi and J of the cut joints, their rank and redundancy, and B'', or None for an open tree.
type Closed = (DVector<f64>, DMatrix<f64>, Option<Loops>, Option<DMatrix<f64>>);

fn closed(setting: &Setting<'_>, scene: &Scene<'_, f64>) -> Result<Closed> {
    let system = setting.system;
    check_directions(system, scene)?;
    let (phi, jacobian) = scene.constraints();
    let decision = system.decision(setting.effects)?;
    let found = reduction(system, scene, &Matrix::Dense(jacobian.clone()), &decision)?;
    let loops = found.map(|l| Loops::dense(l, &decision));
    let b = loops.as_ref().map(|l| l.dependent_map(&jacobian));
    Ok((phi, jacobian, loops, b))
}

fn check_directions(system: &System, scene: &Scene<'_, f64>) -> Result<()> {
    match collapsed(scene.topology, scene.geometry, scene.placement, system.length) {
        None => Ok(()),
        Some(name) => Err(Error::singular(format!(
            "the ends of '{name}' coincide in this state, so that its direction is undefined: start elsewhere, or use a bushing"
        ))),
    }
}

/// Which coordinates are free at rest in this state; of an open tree all, without any work.
pub fn mobility(setting: &Setting<'_>) -> Result<Option<LoopBlocks>> {
    let system = setting.system;
    let placement = place(&system.topology, &system.geometry, &setting.state.q, None);
    let scene = scene_at_rest(system, &placement, setting.effects);
    check_directions(system, &scene)?;
    if system.topology.rows.is_empty() {
        return Ok(None);
    }
    let mut jacobian = Matrix::zeros(system.topology.rows.len(), system.n_tree(), true);
    scene.constraints_into(&mut jacobian);
    let decision = system.decision(setting.effects)?;
    reduction(system, &scene, &jacobian, &decision)
}

/// M, D and S of small motions about a state: M x" + D x' + S x = f in minimal coordinates. Errors where loops do not close or are
/// singular there. O(n^2) without loops.
pub fn linearize(setting: &Setting<'_>, counts: &mut Counts) -> Result<Linearization> {
    let system = setting.system;
    let topology = &*system.topology;
    let rate = setting.rate::<f64>();
    let placement = place(topology, &system.geometry, &setting.state.q, rate.as_deref());
    let mut scene = setting.scene(&placement, rate.as_deref());
    if let Some(name) = scene.changing_constraint().filter(|_| rate.is_some()) {
        return Err(Error::model(format!(
            "constraint '{name}' changes with time by itself, or its derivatives were given: about a state that moves there are no constant \
             matrices then; linearise a state at rest, or follow the motion in time (mb.simulate)"
        )));
    }
    let (phi, jacobian, loops, b) = closed(setting, &scene)?;
    if loops.is_some() {
        counts.add("loop factorisations", 1);
    }
    let mut turning = match (&loops, &rate) {
        (Some(l), Some(rate)) => {
            let path = Path { x: &system.x, q: &setting.state.q, rate };
            Some(turning(setting, l, &path))
        }
        _ => None,
    };
    let given = (rate.is_some() && !setting.acceleration.is_empty()).then(|| setting.acceleration.to_vec());
    let acceleration = turning.as_ref().map(|t| t.acceleration.clone()).or(given);
    let acceleration = acceleration.filter(|_| setting.effects.centrifugal);
    scene.acceleration = acceleration.as_deref();
    let tau = scene.residual(None);
    let lam = loops.as_ref().map_or_else(|| DVector::zeros(0), |l| l.multipliers(&jacobian, &tau));
    let tangent = scene.tangent(Some(lam.as_slice()), counts);
    let (islands, acted_on) = force_sizes(&scene, &tangent, system.length);
    let force_scale = islands.iter().sum();
    check_finite(&scene, &tangent)?;
    if let (Some(loops), Some(b), Some(straight), Some(rate), true) = (&loops, &b, &turning, &rate, rolls(setting)) {
        let path = Path { x: &system.x, q: &setting.state.q, rate };
        let follow = Follow { setting, loops, jacobian: &jacobian, path: &path };
        turning = Some(rolling(&follow, b, straight, &tangent, force_scale)?);
    }
    let (matrices, residual, tree) = match (&loops, &b) {
        (Some(l), Some(b)) => {
            let matrices = reduce(&tangent, l, b, turning.as_ref(), setting.effects);
            (matrices, l.reduce_vector(&tau, b), Some(Tree { phi, jacobian, stiffness: tangent.stiffness }))
        }
        _ => (unreduced(tangent), tau, None),
    };
    let body_map = body_map(system, &system.geometry, &placement, loops.as_ref().zip(b.as_ref()));
    let ground_coupling = reduce_rows(scene.ground_coupling(), loops.as_ref().zip(b.as_ref()));
    let free = loops.as_ref().map_or_else(|| (0..topology.n_tree).collect(), |l| l.independent.clone());
    Ok(Linearization {
        matrices,
        dependent_map: b,
        tree,
        lam: lam.as_slice().to_vec(),
        residual,
        acceleration,
        reach: reach(&body_map, system.length),
        body_map,
        ground_coupling,
        force_scale,
        force_sizes: free.iter().map(|i| islands[topology.island_of(*i)]).collect(),
        acted_on: free.iter().map(|i| acted_on[topology.island_of(*i)]).collect(),
        loops,
    })
}

fn sum<T: Real>(a: Option<DMatrix<T>>, b: Option<DMatrix<T>>) -> Option<DMatrix<T>> {
    match (a, b) {
        (Some(a), Some(b)) => Some(a + b),
        (a, b) => a.or(b),
    }
}

pub(crate) fn unreduced<T: Real>(tangent: Tangent<T>) -> Matrices<T> {
    Matrices { mass: tangent.mass, damping: sum(tangent.damping, tangent.gyroscopic), stiffness: tangent.stiffness }
}

pub(crate) fn reduce<T: Real>(
    tangent: &Tangent<T>,
    loops: &Loops,
    b: &DMatrix<T>,
    turning: Option<&Turning<T>>,
    effects: Effects,
) -> Matrices<T> {
    let reduced = |x: &DMatrix<T>| loops.reduce(x, b);
    let mass = reduced(&tangent.mass);
    let mut damping = tangent.damping.as_ref().map(reduced);
    let mut stiffness = reduced(&tangent.stiffness);
    let gyroscopic = tangent.gyroscopic.as_ref();
    if effects.gyroscopic {
        damping = sum(damping, gyroscopic.map(reduced));
    }
    if let Some(turning) = turning {
        let along = |x: &DMatrix<T>, w: &DMatrix<T>| turned(loops, x, (&turning.rows, w), b);
        if effects.gyroscopic {
            damping = sum(damping, Some(along(&tangent.mass, &turning.rate)));
        }
        let inertial = gyroscopic.filter(|_| effects.centrifugal);
        for d in tangent.damping.as_ref().into_iter().chain(inertial) {
            stiffness += along(d, &turning.first);
        }
        if effects.centrifugal {
            stiffness += along(&tangent.mass, &turning.second);
        }
    }
    Matrices { mass, damping, stiffness }
}

/// B''^T X W for a change W of B'', which has these rows alone.
fn turned<T: Real>(loops: &Loops, x: &DMatrix<T>, (rows, w): (&[usize], &DMatrix<T>), b: &DMatrix<T>) -> DMatrix<T> {
    let columns = DMatrix::from_fn(x.nrows(), rows.len(), |i, k| x[(i, rows[k])]);
    let full = columns * w;
    let mut out = DMatrix::zeros(loops.independent.len(), full.ncols());
    for j in 0..full.ncols() {
        out.set_column(j, &loops.reduce_vector(&full.column(j).into_owned(), b));
    }
    out
}

pub(crate) fn turning<T: Real>(setting: &Setting<'_>, loops: &Loops, path: &Path<'_, T>) -> Turning<T> {
    let jacobian = turning_jacobian(setting, path, None);
    // J y" + J' y' = 0 for y" of the dependent coordinates; the others have the given ones
    let bias = jacobian.map(|v| v.v1) * DVector::from_column_slice(path.rate);
    let mut acceleration: Vec<T> = setting.acceleration.iter().map(|a| T::from(*a)).collect();
    acceleration.resize(path.rate.len(), T::zero());
    for i in &loops.dependent {
        acceleration[*i] = T::zero();
    }
    let bias = bias + jacobian.map(|v| v.re) * DVector::from_column_slice(&acceleration);
    let right = DMatrix::from_column_slice(bias.len(), 1, bias.as_slice());
    let dependent = loops.balanced(&jacobian.map(|v| v.re), &right);
    for (k, v) in dependent.iter().enumerate() {
        acceleration[loops.dependent[k]] = *v;
    }
    let b = loops.dependent_map(&turning_jacobian(setting, path, Some(&acceleration)));
    let first = b.map(|v| v.v1);
    let rows = loops.dependent.clone();
    Turning { rows, rate: &first * T::from(2.0), first, second: b.map(|v| v.v2), acceleration }
}

/// J along y(t) = rate t + acceleration t^2 / 2, to second order in time.
pub(crate) fn turning_jacobian<T: Real>(
    setting: &Setting<'_>,
    path: &Path<'_, T>,
    acceleration: Option<&[T]>,
) -> DMatrix<Dual2<T>> {
    let system = setting.system;
    let x: Vec<Dual2<T>> = path.x.iter().map(|v| Dual2::from_re(*v)).collect();
    let geometry = Geometry::derive(&system.topology.tables, &x);
    let mut q: Vec<Dual2<T>> = path.q.iter().map(|v| Dual2::from_re(*v)).collect();
    let at = |a: Option<&[T]>, i: usize| a.map_or(T::zero(), |a| a[i]);
    let dy: Vec<_> = (0..path.rate.len()).map(|i| Dual2::new(T::zero(), path.rate[i], at(acceleration, i))).collect();
    advance(&system.topology, &mut q, &dy);
    let placement = place(&system.topology, &geometry, &q, None);
    let scene = Scene {
        topology: &system.topology,
        geometry: &geometry,
        x: &x,
        memory: &[],
        placement: &placement,
        rate: None,
        acceleration: None,
        t: 0.0,
        effects: setting.effects,
    };
    scene.constraints().1
}

/// The one way to lose a tangent at finite numbers: an element between coinciding points has no direction.
fn check_finite(scene: &Scene<'_, f64>, tangent: &Tangent<f64>) -> Result<()> {
    if tangent.stiffness.iter().all(|v| v.is_finite()) {
        return Ok(());
    }
    let named = scene.undirected().map_or_else(|| "an element".into(), |name| format!("'{name}'"));
    Err(Error::singular(format!(
        "the end points of {named} coincide in this state, so that its direction is lost; use a bushing there, or move the points apart"
    )))
}

/// Twist of each body's origin per minimal coordinate, world axes.
pub fn body_map<T: Real>(
    system: &System,
    geometry: &Geometry<T>,
    placement: &Placement<T>,
    loops: Option<(&Loops, &DMatrix<T>)>,
) -> DMatrix<T> {
    let topology = &*system.topology;
    let mut map = DMatrix::zeros(6 * topology.nodes.len(), topology.dofs.len());
    let origin: Vec<_> = (topology.nodes.iter().zip(&placement.pose))
        .map(|(node, pose)| pose.p - pose.r * geometry.bodies[node.body].com)
        .collect();
    let mut carried = vec![false; topology.nodes.len()];
    for (k, joint) in topology.nodes.iter().enumerate() {
        // parents come first, so that one pass marks all that joint k carries
        carried[k..].fill(false);
        carried[k] = true;
        for i in k..topology.nodes.len() {
            carried[i] |= topology.nodes[i].parent.is_some_and(|p| p >= k && carried[p]);
            if !carried[i] {
                continue;
            }
            let row = 6 * topology.nodes[i].body;
            let arm = origin[i] - placement.pose[k].p;
            for d in joint.first..joint.first + joint.n {
                let s: Six<T> = placement.column[d].motion_at(&arm);
                for r in 0..6 {
                    map[(row + r, d)] = s.get(r);
                }
            }
        }
    }
    if let Some(fold) = Fold::of(topology, geometry, &placement.modal) {
        map = fold.rows_of(&map.transpose()).transpose();
    }
    match loops {
        None => map,
        Some((l, b)) => {
            let pick = |columns: &[usize]| DMatrix::from_fn(map.nrows(), columns.len(), |i, j| map[(i, columns[j])]);
            pick(&l.independent) + pick(&l.dependent) * b
        }
    }
}
