//! The derivative of a linearisation along a direction of the numbers, the state following or held.
//!
//! One pass of dual numbers through assembly and linearisation. The equilibrium follows by dz = -K''^-1 d(B''^T rho), loops by the
//! smallest change, dy = -J^+ dPhi. What touches single elements or masses alone takes the short way of `local_direction`.
use nalgebra::{DMatrix, DVector};
use num_dual::{Dual64, DualNum};

use crate::constraint::assembly::given_rates;
use crate::constraint::loops::{Loops, column_scales};
use crate::equilibrium::follow::equilibrium_solver;
use crate::equilibrium::steering::steering_joints;
use crate::equilibrium::unbalance;
use crate::error::{Error, Result};
use crate::linalg::dense::minimum_norm;
use crate::linalg::rows::Level as Asked;
use crate::linearize::rolling::rolls;
use crate::linearize::{
    Linearization, Path, Setting, Turning, body_map, linearize, reduce, reduce_rows, turning, unreduced,
};
use crate::model::geometry::Geometry;
use crate::model::tables::Tables;
use crate::multibody::System;
use crate::multibody::assemble::{Effects, Scene};
use crate::multibody::placement::{Placement, advance, lifted_q, place};
use crate::run::{Cancel, Counts};
use crate::sensitivity::local_direction::local_direction;
use crate::spatial::Pose;
use crate::tolerances::constraints::{POSE_ROUNDING, REDUNDANT_OPEN};
use crate::tolerances::equilibrium::FAMILY;

/// The derivative of a linearisation along one direction of the numbers (and of the state).
pub struct Directional {
    pub mass: Entries,
    pub damping: Entries,
    pub stiffness: Entries,
    /// None where it does not change, or was not asked for
    pub body_map: Option<DMatrix<f64>>,
    pub ground_coupling: Option<DMatrix<f64>>,
    /// derivative of the tree coordinates, zero where the configuration is held and closes by itself
    pub dy: Vec<f64>,
    /// derivative of the poses of the centres of mass: translation and world rotation, bodies in the order of the model
    pub body_motion: Vec<f64>,
    pub lam: Vec<f64>,
}

/// What else is wanted beside the matrices, and how the equilibrium is followed: `solve` gives K''^-1 r; None holds the
/// configuration, but for what closing the loops needs. `drawn`: the rates are those that the bodies' given velocities project to.
#[derive(Clone, Copy)]
pub struct Request<'a> {
    pub maps: bool,
    pub solve: Option<&'a Solve>,
    /// the equilibrium is that of this setting instead: without velocity rows that steer
    pub free: Option<(&'a Setting<'a>, &'a Linearization)>,
    pub drawn: bool,
}

pub type Solve = dyn Fn(&DVector<f64>) -> Result<DVector<f64>>;

/// What the directions of one linearisation have in common. `follow`: the equilibrium moves along, on all tree coordinates but the
/// `driven` ones; `drawn`: see `Request`.
#[derive(Clone, Copy)]
pub struct Common<'a> {
    pub follow: bool,
    pub drawn: bool,
    pub maps: bool,
    pub driven: &'a [usize],
}

/// The derivatives of `base` along many sparse directions.
pub fn directions(
    setting: &Setting<'_>,
    base: &Linearization,
    all: &[Vec<(usize, f64)>],
    common: Common<'_>,
    cancel: &Cancel,
) -> Result<Vec<Directional>> {
    let (system, follow) = (setting.system, common.follow);
    let edges = if follow { steering_joints(setting, base) } else { Vec::new() };
    let unsteered = Effects { nonholonomic: false, ..setting.effects };
    if !edges.is_empty() && unbalance(system, setting.state, unsteered)? > FAMILY {
        return Err(Error::NotDifferentiable(format!(
            "the equilibrium that '{}' holds by a force is one of a family, which no parameter moves in a way of its own; use \
             equilibrium=\"hold\", or draw the model where its edges carry nothing",
            edges.join("', '")
        )));
    }
    let free = Setting { effects: unsteered, ..*setting };
    let free = match edges.is_empty() {
        true => None,
        false => Some((&free, linearize(&free, &mut Counts::default())?)),
    };
    let solver =
        follow.then(|| equilibrium_solver(system, free.as_ref().map_or(base, |f| &f.1), common.driven)).transpose()?;
    let free = free.as_ref().map(|(at, made)| (*at, made));
    let request = Request { maps: common.maps, solve: solver.as_ref().map(|s| s as _), free, drawn: common.drawn };
    let one = |dx: &Vec<(usize, f64)>| {
        cancel.check()?;
        directional(setting, base, dx, request)
    };
    all.iter().map(one).collect()
}

/// Entries of a matrix that are not zero.
#[derive(Debug, Clone, Default)]
pub struct Entries {
    pub rows: Vec<i64>,
    pub columns: Vec<i64>,
    pub values: Vec<f64>,
}

impl Entries {
    pub fn push(&mut self, i: usize, j: usize, value: f64) {
        if value != 0.0 {
            self.rows.push(i as i64);
            self.columns.push(j as i64);
            self.values.push(value);
        }
    }

    /// The derivative part of a matrix of dual numbers.
    pub fn of(matrix: &DMatrix<Dual64>) -> Self {
        Entries::filled(&slopes(matrix))
    }

    pub fn filled(matrix: &DMatrix<f64>) -> Self {
        let count = matrix.iter().filter(|v| **v != 0.0).count();
        let [rows, columns] = [0, 1].map(|_| Vec::with_capacity(count));
        let mut all = Entries { rows, columns, values: Vec::with_capacity(count) };
        for j in 0..matrix.ncols() {
            for i in 0..matrix.nrows() {
                all.push(i, j, matrix[(i, j)]);
            }
        }
        all
    }
}

struct DualScene {
    x: Vec<Dual64>,
    memory: Vec<Dual64>,
    geometry: Geometry<Dual64>,
    placement: Placement<Dual64>,
    rate: Option<Vec<Dual64>>,
    acceleration: Option<Vec<Dual64>>,
    turning: Option<Turning<Dual64>>,
}

/// How the rates change along a direction.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Rates {
    /// Those of the independent coordinates stay; a loop decides the others.
    Held,
    /// They are those that the bodies' given velocities project to.
    Drawn,
}

fn dual_scene(
    setting: &Setting<'_>,
    base: &Linearization,
    dx: &[(usize, f64)],
    dy: &[f64],
    rates: Rates,
) -> Result<DualScene> {
    let system = setting.system;
    let (x, geometry, q) = varied(setting, dx, dy);
    let moving = setting.state.moving() || rates == Rates::Drawn && gives_velocity(&system.topology.tables, dx);
    let mut made = DualScene {
        placement: place(&system.topology, &geometry, &q, None),
        memory: setting.memory.iter().map(|z| Dual64::from(*z)).collect(),
        x,
        geometry,
        rate: None,
        acceleration: None,
        turning: None,
    };
    if !moving {
        return Ok(made);
    }
    let loops = base.loops.as_ref().map(|l| {
        let jacobian = made.scene(setting).constraints().1;
        (l, l.dependent_map(&jacobian))
    });
    let rate = match rates {
        Rates::Drawn => {
            let given = given_rates(system, &made.geometry, &made.x, &made.placement)?;
            match &loops {
                None => given,
                Some((l, b)) => projected(&made, system, l, b, &given)?,
            }
        }
        Rates::Held => held_rates(setting, loops.as_ref().map(|(l, b)| (*l, b))),
    };
    if let Some((l, _)) = &loops {
        let path = Path { x: &made.x, q: &q, rate: &rate };
        let turning = turning(setting, l, &path);
        let acceleration = turning.acceleration.clone();
        made.acceleration = setting.effects.centrifugal.then_some(acceleration);
        made.turning = Some(turning);
    }
    made.placement = place(&system.topology, &made.geometry, &q, Some(&rate));
    made.rate = Some(rate);
    Ok(made)
}

type Varied = (Vec<Dual64>, Geometry<Dual64>, Vec<Dual64>);

fn varied(setting: &Setting<'_>, dx: &[(usize, f64)], dy: &[f64]) -> Varied {
    let system = setting.system;
    let mut x: Vec<Dual64> = system.x.iter().map(|v| Dual64::from(*v)).collect();
    for (i, d) in dx {
        x[*i].eps = *d;
    }
    let geometry = Geometry::derive(&system.topology.tables, &x);
    let mut q = lifted_q(&system.topology, &geometry, setting.state);
    let increments: Vec<_> = dy.iter().map(|d| Dual64::new(0.0, *d)).collect();
    advance(&system.topology, &mut q, &increments);
    (x, geometry, q)
}

fn held_rates(setting: &Setting<'_>, loops: Option<(&Loops, &DMatrix<Dual64>)>) -> Vec<Dual64> {
    let mut rate: Vec<Dual64> = setting.state.rate.iter().map(|r| Dual64::from(*r)).collect();
    rate.resize(setting.system.n_tree(), Dual64::from(0.0));
    let Some((l, b)) = loops else { return rate };
    let z = DVector::from_fn(l.independent.len(), |k, _| rate[l.independent[k]]);
    // the rounding of the state's own rates stays
    for (k, v) in (b * z).iter().enumerate() {
        rate[l.dependent[k]].eps = v.eps;
    }
    rate
}

/// The rates nearest to the given ones that the loops allow, y = N z with N^T W (N z - given) = 0, W the inverse squares of the
/// column scales.
fn projected(
    made: &DualScene,
    system: &System,
    loops: &Loops,
    b: &DMatrix<Dual64>,
    given: &[Dual64],
) -> Result<Vec<Dual64>> {
    let length = system.topology.characteristic_length(&made.geometry, &made.x);
    let weight = |i: usize| match system.topology.dofs[i].freedom.rotation {
        true => Dual64::from(1.0),
        false => {
            let size = system.topology.scale(i, 1.0);
            (length * length * size * size).recip()
        }
    };
    let n = loops.independent.len();
    let mut map = DMatrix::from_element(given.len(), n, Dual64::from(0.0));
    for k in 0..n {
        map[(loops.independent[k], k)] = Dual64::from(1.0);
        for (row, i) in loops.dependent.iter().enumerate() {
            map[(*i, k)] = b[(row, k)];
        }
    }
    let weighted = DMatrix::from_fn(given.len(), n, |i, k| map[(i, k)] * weight(i));
    let normal = weighted.transpose() * &map;
    let right = weighted.transpose() * DVector::from_row_slice(given);
    let inner = normal.map(|v| v.re);
    let z = minimum_norm(&inner, &right.map(|v| v.re))?.map(Dual64::from);
    let miss = right - &normal * &z;
    let slope = minimum_norm(&inner, &miss.map(|v| v.eps))?;
    let z = DVector::from_fn(n, |k, _| Dual64::new(z[k].re, slope[k]));
    Ok((map * z).as_slice().to_vec())
}

fn gives_velocity(tables: &Tables, dx: &[(usize, f64)]) -> bool {
    use crate::model::layout::body::{ANGULAR_VELOCITY, VELOCITY};
    let of = |i: usize| tables.bodies.iter().any(|b| (b.x + VELOCITY..b.x + ANGULAR_VELOCITY + 3).contains(&i));
    dx.iter().any(|(i, d)| *d != 0.0 && of(*i))
}

impl DualScene {
    /// How far redundant rows may part that follow the changes of poses and of the points and axes of joints, free of units: what the
    /// tolerance of the drawing makes of these changes, and rounding.
    fn allowed(&self, system: &System) -> f64 {
        let size = |pose: &Pose<Dual64>| pose.p.map(|v| v.eps).norm() / system.length + pose.r.map(|v| v.eps).norm();
        let markers = self.geometry.joints.iter().flat_map(|pair| [&pair.a, &pair.b]);
        let moved = self.placement.pose.iter().chain(markers).map(size).fold(0.0, f64::max);
        let far = self.placement.pose.iter().map(|pose| pose.p.map(|v| v.re).norm()).fold(0.0, f64::max);
        let rounding = POSE_ROUNDING * f64::EPSILON * (1.0 + far / system.length);
        (REDUNDANT_OPEN * system.tolerance + rounding) * moved
    }

    fn scene<'a>(&'a self, setting: &'a Setting<'_>) -> Scene<'a, Dual64> {
        Scene {
            topology: &setting.system.topology,
            geometry: &self.geometry,
            x: &self.x,
            memory: &self.memory,
            placement: &self.placement,
            rate: self.rate.as_deref(),
            acceleration: self.acceleration.as_deref(),
            t: 0.0,
            effects: setting.effects,
        }
    }
}

/// Derivative of everything in `base` along `dx` (sparse: index, value).
pub fn directional(
    setting: &Setting<'_>,
    base: &Linearization,
    dx: &[(usize, f64)],
    request: Request<'_>,
) -> Result<Directional> {
    if rolls(setting) {
        return Err(Error::NotDifferentiable(
            "derivatives of a linearisation that rolls in motion do not exist here; take differences of two models"
                .into(),
        ));
    }
    if let Some(local) = local_direction(setting, base, dx, request) {
        return Ok(local);
    }
    let n = setting.system.n_tree();
    let rates = if request.drawn { Rates::Drawn } else { Rates::Held };
    let (at, balanced) = request.free.unwrap_or((setting, base));
    let mut dy = closing(at, balanced, dx)?;
    if let Some(solve) = request.solve {
        let held = dual_scene(at, balanced, dx, &dy, rates)?;
        let scene = held.scene(at);
        let tau = scene.residual(None);
        let r = match &balanced.loops {
            None => tau.map(|v| v.eps),
            Some(l) => {
                let jacobian = scene.constraints().1;
                let b = l.dependent_map(&jacobian);
                check_agreement(at.system, balanced, &held, &jacobian, &b)?;
                l.reduce_vector(&tau, &b).map(|v| v.eps)
            }
        };
        let dz = -solve(&r)?;
        let step = match (&balanced.loops, &balanced.dependent_map) {
            (Some(l), Some(b)) => l.expand(b, &dz),
            _ => dz,
        };
        for i in 0..n {
            dy[i] += step[i];
        }
    }
    derivative_at(setting, base, dx, dy, request, rates)
}

/// The smallest change of the tree coordinates that keeps the loops closed, as assembly would make it.
fn closing(setting: &Setting<'_>, base: &Linearization, dx: &[(usize, f64)]) -> Result<Vec<f64>> {
    let (system, n) = (setting.system, setting.system.n_tree());
    let Some(loops) = &base.loops else {
        return Ok(vec![0.0; n]);
    };
    let (x, geometry, q) = varied(setting, dx, &vec![0.0; n]);
    let held = DualScene {
        placement: place(&system.topology, &geometry, &q, None),
        memory: setting.memory.iter().map(|z| Dual64::from(*z)).collect(),
        x,
        geometry,
        rate: None,
        acceleration: None,
        turning: None,
    };
    let (phi, jacobian) = held.scene(setting).constraints();
    let scaled = DVector::from_fn(phi.len(), |i, _| phi[i].eps * loops.row_scale[i]);
    if scaled.amax() == 0.0 {
        return Ok(vec![0.0; n]);
    }
    let left = loops.redundant.transpose() * &scaled;
    if left.amax() > held.allowed(system) {
        return Err(breaks_loop(left.amax()));
    }
    let columns = column_scales(&system.topology, system.length);
    // velocity rows do not say where anything is
    let real = jacobian.map(|v| v.re);
    let kept = system.decision(setting.effects)?.rows.select_dense(&real, Asked::Position);
    let rows = DMatrix::from_fn(kept.len(), n, |k, j| real[(kept[k], j)] * loops.row_scale[kept[k]] * columns[j]);
    let step = minimum_norm(&rows, &DVector::from_fn(kept.len(), |k, _| -scaled[kept[k]]))?;
    Ok((0..n).map(|i| step[i] * columns[i]).collect())
}

fn breaks_loop(size: f64) -> Error {
    Error::NotDifferentiable(format!(
        "this parameter breaks a redundant loop open: its constraints agree only at the present value (they part at the rate {size:.1e}), so the \
         derivative does not exist; vary parameters that keep the loop closed together, or release the redundant constraint"
    ))
}

fn check_agreement(
    system: &System,
    base: &Linearization,
    made: &DualScene,
    jacobian: &DMatrix<Dual64>,
    b: &DMatrix<Dual64>,
) -> Result<()> {
    let Some(loops) = &base.loops else {
        return Ok(());
    };
    if loops.redundant.ncols() == 0 {
        return Ok(());
    }
    let columns = column_scales(&system.topology, system.length);
    let parts = loops.disagreement(jacobian, b).map(|v| v.eps);
    let natural = |k: usize| parts.column(k).amax() * columns[loops.independent[k]];
    let parts = (0..parts.ncols()).map(natural).fold(0.0, f64::max);
    if parts > made.allowed(system) { Err(breaks_loop(parts)) } else { Ok(()) }
}

fn derivative_at(
    setting: &Setting<'_>,
    base: &Linearization,
    dx: &[(usize, f64)],
    dy: Vec<f64>,
    request: Request<'_>,
    rates: Rates,
) -> Result<Directional> {
    let moved = dual_scene(setting, base, dx, &dy, rates)?;
    let scene = moved.scene(setting);
    let tau = scene.residual(None);
    let (matrices, lam, loops) = match &base.loops {
        None => (unreduced(scene.tangent(None, &mut Counts::default())), DVector::zeros(0), None),
        Some(l) => {
            let jacobian = scene.constraints().1;
            let b = l.dependent_map(&jacobian);
            check_agreement(setting.system, base, &moved, &jacobian, &b)?;
            let lam = l.multipliers(&jacobian, &tau);
            let tangent = scene.tangent(Some(lam.as_slice()), &mut Counts::default());
            (reduce(&tangent, l, &b, moved.turning.as_ref(), setting.effects), lam, Some((l, b)))
        }
    };
    let (map, coupling) = if request.maps {
        let loops = loops.as_ref().map(|(l, b)| (*l, b));
        let map = body_map(setting.system, &moved.geometry, &moved.placement, loops);
        (Some(slopes(&map)), Some(slopes(&reduce_rows(scene.ground_coupling(), loops))))
    } else {
        (None, None)
    };
    Ok(Directional {
        mass: Entries::of(&matrices.mass),
        damping: matrices.damping.as_ref().map_or_else(Entries::default, Entries::of),
        stiffness: Entries::of(&matrices.stiffness),
        body_map: map,
        ground_coupling: coupling,
        body_motion: body_motion(setting.system, &moved.placement),
        lam: lam.iter().map(|v| v.eps).collect(),
        dy,
    })
}

fn slopes(m: &DMatrix<Dual64>) -> DMatrix<f64> {
    m.map(|v| v.eps)
}

fn body_motion(system: &System, placement: &Placement<Dual64>) -> Vec<f64> {
    let mut motion = vec![0.0; 6 * system.n_bodies()];
    for (node, pose) in system.topology.nodes.iter().zip(&placement.pose) {
        let out = &mut motion[6 * node.body..6 * node.body + 6];
        let spin = pose.r.map(|v| v.eps) * pose.r.map(|v| v.re).transpose();
        out[..3].copy_from_slice(pose.p.map(|v| v.eps).as_slice());
        out[3..].copy_from_slice(&[spin[(2, 1)], spin[(0, 2)], spin[(1, 0)]]);
    }
    motion
}
