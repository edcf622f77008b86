//! Exact linearisation at a state, in minimal coordinates, and its derivative along any direction of the numbers.
//!
//! ```text
//! M y" + D y' + S y = 0,   X'' = B''^T X B'',   C = sym D, G = skew D, K = sym S, N = skew S
//! ```
//! At a moving state of a closed loop B'' changes in time; with y = B'' z,
//! D'' = B''^T (D B'' + 2 M B''') and S'' = B''^T (S B'' + D B''' + M B''''), dots by second-order dual numbers in time.
use nalgebra::{DMatrix, DVector};
use num_dual::{Dual2_64, Dual64};

use crate::analysis::assembly::{given_rates, minimum_norm};
use crate::error::{Error, Result};
use crate::model::geometry::Geometry;
use crate::run::Counts;
use crate::spatial::{Pose, Real, Six};
use crate::system::System;
use crate::system::assemble::{Effects, Scene, Tangent};
use crate::system::loops::{Loops, column_scales};
use crate::system::placement::{Placement, State, advance, lifted_relative, place};

/// A redundant combination whose second derivative is larger than this (rows and columns scaled) marks a singular pose.
const SINGULAR_POSE: f64 = 1e-6;
/// A parameter that moves redundant rows apart by more than this (relative) breaks the loop open.
const BREAKS_LOOP: f64 = 1e-7;

/// Second-order matrices in minimal coordinates: `damping` is D, `stiffness` S; None where nothing acts.
#[derive(Debug, Clone)]
pub struct Matrices<T: Real> {
    pub mass: DMatrix<T>,
    pub damping: Option<DMatrix<T>>,
    pub stiffness: DMatrix<T>,
}

#[derive(Debug, Clone)]
pub struct Linearization {
    pub matrices: Matrices<f64>,
    pub loops: Option<Loops>,
    /// B'' on the dependent coordinates
    pub dependent_map: Option<DMatrix<f64>>,
    pub lam: Vec<f64>,
    /// generalised force that is not balanced, minimal coordinates
    pub residual: DVector<f64>,
    /// acceleration of the tree coordinates at z" = 0
    pub acceleration: Option<Vec<f64>>,
    /// 6 n_bodies x dof: twist of each body's origin, world axes, bodies in the order of the model
    pub body_map: DMatrix<f64>,
    /// (dof, 6): momentum of a common rigid motion about the world origin
    pub ground_coupling: DMatrix<f64>,
    /// the size of all forces at work, moments over the characteristic length, times that length
    pub force_scale: f64,
}

/// Rows of tree coordinates to minimal ones, B''^T X.
fn reduce_rows<T: Real>(x: DMatrix<T>, loops: Option<(&Loops, &DMatrix<T>)>) -> DMatrix<T> {
    match loops {
        None => x,
        Some((l, b)) => {
            let pick =
                |rows: &[usize]| DMatrix::from_fn(rows.len(), x.ncols(), |i, j| x[(rows[i], j)]);
            pick(&l.independent) + b.transpose() * pick(&l.dependent)
        }
    }
}

fn force_scale(scene: &Scene<'_, f64>, length: f64) -> f64 {
    let size = |w: &Six<f64>| w.l.norm() * length + w.a.norm();
    scene.body_wrenches(None).iter().map(size).sum::<f64>() + scene.connector_sizes(length)
}

impl Linearization {
    /// Tree increments of minimal ones.
    pub fn expand(&self, z: DVector<f64>) -> Result<DVector<f64>> {
        let n = self.matrices.mass.nrows();
        if z.len() != n || z.iter().any(|v| !v.is_finite()) {
            return Err(Error::model(format!(
                "{n} finite increments are needed, {} were given",
                z.len()
            )));
        }
        Ok(match (&self.loops, &self.dependent_map) {
            (Some(l), Some(b)) => l.expand(b, &z),
            _ => z,
        })
    }

    /// Indices of the minimal coordinates among the tree coordinates.
    pub fn coordinates(&self, n_tree: usize) -> Vec<usize> {
        self.loops
            .as_ref()
            .map_or_else(|| (0..n_tree).collect(), |l| l.independent.clone())
    }
}

pub struct Setting<'a> {
    pub system: &'a System,
    pub state: &'a State,
    pub effects: Effects,
}

impl Setting<'_> {
    fn rate<T: Real>(&self) -> Option<Vec<T>> {
        self.state
            .moving()
            .then(|| self.state.rate.iter().map(|r| T::from(*r)).collect())
    }
}

/// B''' and B'''' along the motion.
struct Turning {
    first: DMatrix<f64>,
    second: DMatrix<f64>,
}

pub fn linearize(setting: &Setting<'_>, counts: &mut Counts) -> Result<Linearization> {
    let system = setting.system;
    let topology = &*system.topology;
    let rate = setting.rate::<f64>();
    let placement = place(
        topology,
        &system.geometry,
        &setting.state.relative,
        rate.as_deref(),
    );
    let mut scene = Scene {
        topology,
        geometry: &system.geometry,
        x: &system.x,
        memory: &[],
        placement: &placement,
        rate: rate.as_deref(),
        acceleration: None,
        effects: setting.effects,
    };
    let (_, jacobian) = scene.constraints();
    let loops = Loops::analyse(system, &jacobian)?;
    if loops.is_some() {
        counts.add("loop factorisations", 1);
    }
    let b = loops.as_ref().map(|l| l.dependent_map(&jacobian));
    if let (Some(l), Some(b)) = (&loops, &b) {
        check_pose(system, &scene, l, b)?;
    }
    let turning = match (&loops, &rate) {
        (Some(l), Some(rate)) => Some(turning(setting, l, rate)),
        _ => None,
    };
    let acceleration =
        turning
            .as_ref()
            .zip(loops.as_ref())
            .zip(rate.as_ref())
            .map(|((t, l), rate)| {
                let z = DVector::from_fn(l.independent.len(), |k, _| rate[l.independent[k]]);
                let mut y = vec![0.0; topology.dofs.len()];
                for (k, v) in (&t.first * z).iter().enumerate() {
                    y[l.dependent[k]] = *v;
                }
                y
            });
    let acceleration = acceleration.filter(|_| setting.effects.centrifugal);
    scene.acceleration = acceleration.as_deref();
    let tau = scene.residual(None);
    let lam = loops
        .as_ref()
        .map_or_else(|| DVector::zeros(0), |l| l.multipliers(&jacobian, &tau));
    let tangent = scene.tangent(Some(lam.as_slice()), counts);
    let (matrices, residual) = match (&loops, &b) {
        (Some(l), Some(b)) => (
            reduce(&tangent, l, b, turning.as_ref(), setting.effects),
            l.reduce_vector(&tau, b),
        ),
        _ => (unreduced(tangent), tau),
    };
    let body_map = body_map(
        system,
        &system.geometry,
        &placement,
        loops.as_ref().zip(b.as_ref()),
    );
    let ground_coupling = reduce_rows(scene.ground_coupling(), loops.as_ref().zip(b.as_ref()));
    let force_scale = force_scale(&scene, system.length);
    Ok(Linearization {
        matrices,
        dependent_map: b,
        lam: lam.as_slice().to_vec(),
        residual,
        acceleration,
        body_map,
        ground_coupling,
        force_scale,
        loops,
    })
}

fn sum<T: Real>(a: Option<DMatrix<T>>, b: Option<DMatrix<T>>) -> Option<DMatrix<T>> {
    match (a, b) {
        (Some(a), Some(b)) => Some(a + b),
        (a, b) => a.or(b),
    }
}

fn unreduced<T: Real>(tangent: Tangent<T>) -> Matrices<T> {
    Matrices {
        mass: tangent.mass,
        damping: sum(tangent.damping, tangent.gyroscopic),
        stiffness: tangent.stiffness,
    }
}

fn reduce<T: Real>(
    tangent: &Tangent<T>,
    loops: &Loops,
    b: &DMatrix<T>,
    turning: Option<&Turning>,
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
        let along = |x: &DMatrix<T>, w: &DMatrix<f64>| turned(loops, x, w, b);
        if effects.gyroscopic {
            let first = along(&tangent.mass, &turning.first) * T::from(2.0);
            damping = sum(damping, Some(first));
        }
        let inertial = gyroscopic.filter(|_| effects.centrifugal);
        for d in tangent.damping.as_ref().into_iter().chain(inertial) {
            stiffness += along(d, &turning.first);
        }
        if effects.centrifugal {
            stiffness += along(&tangent.mass, &turning.second);
        }
    }
    Matrices {
        mass,
        damping,
        stiffness,
    }
}

/// B''^T X W for a change W of B'', which has rows on the dependent coordinates alone.
fn turned<T: Real>(loops: &Loops, x: &DMatrix<T>, w: &DMatrix<f64>, b: &DMatrix<T>) -> DMatrix<T> {
    let columns = DMatrix::from_fn(x.nrows(), loops.dependent.len(), |i, k| {
        x[(i, loops.dependent[k])]
    });
    let full = columns * w.map(T::from);
    let mut out = DMatrix::zeros(loops.independent.len(), full.ncols());
    for j in 0..full.ncols() {
        out.set_column(j, &loops.reduce_vector(&full.column(j).into_owned(), b));
    }
    out
}

fn turning(setting: &Setting<'_>, loops: &Loops, rate: &[f64]) -> Turning {
    let first = turning_pass(setting, loops, rate, None).0;
    let z = DVector::from_fn(loops.independent.len(), |k, _| rate[loops.independent[k]]);
    let mut acceleration = vec![0.0; rate.len()];
    for (k, v) in (&first * z).iter().enumerate() {
        acceleration[loops.dependent[k]] = *v;
    }
    let (first, second) = turning_pass(setting, loops, rate, Some(&acceleration));
    Turning { first, second }
}

fn turning_pass(
    setting: &Setting<'_>,
    loops: &Loops,
    rate: &[f64],
    acceleration: Option<&[f64]>,
) -> (DMatrix<f64>, DMatrix<f64>) {
    let system = setting.system;
    let x: Vec<Dual2_64> = system.x.iter().map(|v| Dual2_64::from(*v)).collect();
    let geometry = Geometry::derive(&system.topology.tables, &x);
    let mut relative: Vec<Pose<Dual2_64>> = setting
        .state
        .relative
        .iter()
        .map(Pose::<f64>::lifted)
        .collect();
    let dy: Vec<_> = (0..rate.len())
        .map(|i| Dual2_64::new(0.0, rate[i], acceleration.map_or(0.0, |a| a[i])))
        .collect();
    advance(&system.topology, &mut relative, &dy);
    let placement = place(&system.topology, &geometry, &relative, None);
    let scene = Scene {
        topology: &system.topology,
        geometry: &geometry,
        x: &x,
        memory: &[],
        placement: &placement,
        rate: None,
        acceleration: None,
        effects: setting.effects,
    };
    let b = loops.dependent_map(&scene.constraints().1);
    (b.map(|v| v.v1), b.map(|v| v.v2))
}

/// Redundant rows that agree to first order but not to second: the pose where a mechanism may change its mobility.
fn check_pose(
    system: &System,
    scene: &Scene<'_, f64>,
    loops: &Loops,
    b: &DMatrix<f64>,
) -> Result<()> {
    let n = system.n_tree();
    let scale = column_scales(&system.topology, system.length);
    for k in 0..loops.redundant.ncols() {
        let lam: Vec<f64> = loops
            .redundant
            .column(k)
            .iter()
            .zip(&loops.row_scale)
            .map(|(v, s)| v * s)
            .collect();
        let mut curvature = DMatrix::zeros(n, n);
        scene.add_multiplier_stiffness(&lam, &mut curvature, &mut Counts::default());
        let reduced = loops.reduce(&curvature, b);
        let sym = DMatrix::from_fn(reduced.nrows(), reduced.ncols(), |i, j| {
            0.5 * (reduced[(i, j)] + reduced[(j, i)])
                * scale[loops.independent[i]]
                * scale[loops.independent[j]]
        });
        let size = sym.amax();
        if size > SINGULAR_POSE {
            let worst = lam
                .iter()
                .enumerate()
                .max_by(|a, b| a.1.abs().total_cmp(&b.1.abs()))
                .map_or(0, |(i, _)| i);
            let joint = &system.topology.tables.joints[system.topology.rows[worst].joint].name;
            return Err(Error::singular(format!(
                "the mechanism is in a singular pose: around the loop through joint '{joint}' the constraints lose rank here, where its \
                 mobility changes (second-order mismatch {size:.1e}); draw it slightly off this pose, or add what decides its branch"
            )));
        }
    }
    Ok(())
}

/// Twist of each body's origin per minimal coordinate, world axes.
pub fn body_map<T: Real>(
    system: &System,
    geometry: &Geometry<T>,
    placement: &Placement<T>,
    loops: Option<(&Loops, &DMatrix<T>)>,
) -> DMatrix<T> {
    let topology = &*system.topology;
    let n = topology.dofs.len();
    let mut map = DMatrix::zeros(6 * topology.nodes.len(), n);
    for (i, node) in topology.nodes.iter().enumerate() {
        let pose = &placement.pose[i];
        let origin = pose.p - pose.r * geometry.bodies[node.body].com;
        let mut at = Some(i);
        while let Some(k) = at {
            let inner = &topology.nodes[k];
            let arm = origin - placement.pose[k].p;
            for d in inner.first..inner.first + inner.n {
                let s: Six<T> = placement.column[d].motion_at(&arm);
                for r in 0..6 {
                    map[(6 * node.body + r, d)] = s.get(r);
                }
            }
            at = inner.parent;
        }
    }
    match loops {
        None => map,
        Some((l, b)) => {
            let pick = |columns: &[usize]| {
                DMatrix::from_fn(map.nrows(), columns.len(), |i, j| map[(i, columns[j])])
            };
            pick(&l.independent) + pick(&l.dependent) * b
        }
    }
}

/// The derivative of a linearisation along one direction of the numbers (and of the state).
pub struct Directional {
    pub mass: DMatrix<f64>,
    pub damping: Option<DMatrix<f64>>,
    pub stiffness: DMatrix<f64>,
    pub body_map: DMatrix<f64>,
    pub ground_coupling: DMatrix<f64>,
    /// derivative of the tree coordinates, zero where the configuration is held and closes by itself
    pub dy: Vec<f64>,
    /// derivative of the poses of the centres of mass: translation and world rotation, bodies in the order of the model
    pub body_motion: Vec<f64>,
    pub residual: DVector<f64>,
    pub lam: Vec<f64>,
}

/// How the state answers a change of the numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Follow {
    /// the equilibrium moves along
    Equilibrium,
    /// the configuration stays, but for the smallest change that keeps the loops closed
    Hold,
    /// so it does, and the rates are those that the bodies' given velocities project to
    Drawn,
}

struct DualScene {
    x: Vec<Dual64>,
    geometry: Geometry<Dual64>,
    placement: Placement<Dual64>,
    rate: Option<Vec<Dual64>>,
    acceleration: Option<Vec<Dual64>>,
}

fn dual_scene(
    setting: &Setting<'_>,
    base: &Linearization,
    dx: &[(usize, f64)],
    dy: &[f64],
    follow: Follow,
) -> Result<DualScene> {
    let system = setting.system;
    let mut x: Vec<Dual64> = system.x.iter().map(|v| Dual64::from(*v)).collect();
    for (i, d) in dx {
        x[*i].eps = *d;
    }
    let geometry = Geometry::derive(&system.topology.tables, &x);
    let mut relative = lifted_relative(&system.topology, &geometry, setting.state);
    let increments: Vec<_> = dy.iter().map(|d| Dual64::new(0.0, *d)).collect();
    advance(&system.topology, &mut relative, &increments);
    let mut rate = setting.rate::<Dual64>();
    if follow == Follow::Drawn && rate.is_some() {
        let at_rest = place(&system.topology, &geometry, &relative, None);
        rate = Some(given_rates(system, &geometry, &x, &at_rest)?);
    }
    let placement = place(&system.topology, &geometry, &relative, rate.as_deref());
    let acceleration = base
        .acceleration
        .as_ref()
        .map(|a| a.iter().map(|v| Dual64::from(*v)).collect());
    Ok(DualScene {
        x,
        geometry,
        placement,
        rate,
        acceleration,
    })
}

impl DualScene {
    fn scene<'a>(&'a self, setting: &'a Setting<'_>) -> Scene<'a, Dual64> {
        Scene {
            topology: &setting.system.topology,
            geometry: &self.geometry,
            x: &self.x,
            memory: &[],
            placement: &self.placement,
            rate: self.rate.as_deref(),
            acceleration: self.acceleration.as_deref(),
            effects: setting.effects,
        }
    }
}

/// Derivative of everything in `base` along `dx` (sparse: index, value). `solve` gives K''^-1 r for the equilibrium to follow.
pub fn directional(
    setting: &Setting<'_>,
    base: &Linearization,
    dx: &[(usize, f64)],
    follow: Follow,
    solve: &dyn Fn(&DVector<f64>) -> Result<DVector<f64>>,
) -> Result<Directional> {
    if setting.state.moving() && base.loops.is_some() {
        return Err(Error::NotDifferentiable(
            "derivatives at a moving state of a closed loop are not available yet; linearise at rest, or open the loop".into(),
        ));
    }
    let n = setting.system.n_tree();
    let mut dy = closing(setting, base, dx)?;
    if follow == Follow::Equilibrium {
        let held = dual_scene(setting, base, dx, &dy, follow)?;
        let scene = held.scene(setting);
        let tau = scene.residual(None);
        let r = match &base.loops {
            None => tau.map(|v| v.eps),
            Some(l) => {
                let jacobian = scene.constraints().1;
                let b = l.dependent_map(&jacobian);
                check_agreement(base, &jacobian, &b)?;
                l.reduce_vector(&tau, &b).map(|v| v.eps)
            }
        };
        let dz = -solve(&r)?;
        let step = match (&base.loops, &base.dependent_map) {
            (Some(l), Some(b)) => l.expand(b, &dz),
            _ => dz,
        };
        for i in 0..n {
            dy[i] += step[i];
        }
    }
    derivative_at(setting, base, dx, dy, follow)
}

/// The smallest change of the tree coordinates that keeps the loops closed, as assembly would make it.
fn closing(setting: &Setting<'_>, base: &Linearization, dx: &[(usize, f64)]) -> Result<Vec<f64>> {
    let (system, n) = (setting.system, setting.system.n_tree());
    let Some(loops) = &base.loops else {
        return Ok(vec![0.0; n]);
    };
    let held = dual_scene(setting, base, dx, &vec![0.0; n], Follow::Hold)?;
    let (phi, jacobian) = held.scene(setting).constraints();
    let scaled = DVector::from_fn(phi.len(), |i, _| phi[i].eps * loops.row_scale[i]);
    if scaled.amax() == 0.0 {
        return Ok(vec![0.0; n]);
    }
    let left = loops.redundant.transpose() * &scaled;
    if left.amax() > BREAKS_LOOP * scaled.amax() {
        return Err(breaks_loop(left.amax()));
    }
    let columns = column_scales(&system.topology, system.length);
    let rows = DMatrix::from_fn(phi.len(), n, |i, j| {
        jacobian[(i, j)].re * loops.row_scale[i] * columns[j]
    });
    let step = minimum_norm(&rows, &-scaled)?;
    Ok((0..n).map(|i| step[i] * columns[i]).collect())
}

fn breaks_loop(size: f64) -> Error {
    Error::NotDifferentiable(format!(
        "this parameter breaks a redundant loop open: its constraints agree only at the present value (they part at the rate {size:.1e}), so the \
         derivative does not exist; vary parameters that keep the loop closed together, or release the redundant constraint"
    ))
}

fn check_agreement(
    base: &Linearization,
    jacobian: &DMatrix<Dual64>,
    b: &DMatrix<Dual64>,
) -> Result<()> {
    let Some(loops) = &base.loops else {
        return Ok(());
    };
    if loops.redundant.ncols() == 0 {
        return Ok(());
    }
    let parts = loops.disagreement(jacobian, b).map(|v| v.eps).amax();
    let change = jacobian.map(|v| v.eps);
    let size = (0..change.nrows())
        .map(|i| change.row(i).amax() * loops.row_scale[i])
        .fold(0.0, f64::max);
    if parts > BREAKS_LOOP * size && size > 0.0 {
        Err(breaks_loop(parts))
    } else {
        Ok(())
    }
}

fn derivative_at(
    setting: &Setting<'_>,
    base: &Linearization,
    dx: &[(usize, f64)],
    dy: Vec<f64>,
    follow: Follow,
) -> Result<Directional> {
    let moved = dual_scene(setting, base, dx, &dy, follow)?;
    let scene = moved.scene(setting);
    let tau = scene.residual(None);
    let eps = |m: &DMatrix<Dual64>| m.map(|v| v.eps);
    let (matrices, map, coupling, residual, lam) = match &base.loops {
        None => {
            let tangent = scene.tangent(None, &mut Counts::default());
            let map = body_map(setting.system, &moved.geometry, &moved.placement, None);
            (
                unreduced(tangent),
                map,
                scene.ground_coupling(),
                tau,
                DVector::zeros(0),
            )
        }
        Some(l) => {
            let jacobian = scene.constraints().1;
            let b = l.dependent_map(&jacobian);
            check_agreement(base, &jacobian, &b)?;
            let lam = l.multipliers(&jacobian, &tau);
            let tangent = scene.tangent(Some(lam.as_slice()), &mut Counts::default());
            let map = body_map(
                setting.system,
                &moved.geometry,
                &moved.placement,
                Some((l, &b)),
            );
            let coupling = reduce_rows(scene.ground_coupling(), Some((l, &b)));
            (
                reduce(&tangent, l, &b, None, setting.effects),
                map,
                coupling,
                l.reduce_vector(&tau, &b),
                lam,
            )
        }
    };
    Ok(Directional {
        mass: eps(&matrices.mass),
        damping: matrices.damping.as_ref().map(eps),
        stiffness: eps(&matrices.stiffness),
        body_map: eps(&map),
        ground_coupling: eps(&coupling),
        body_motion: body_motion(setting.system, &moved.placement),
        residual: residual.map(|v| v.eps),
        lam: lam.iter().map(|v| v.eps).collect(),
        dy,
    })
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
