//! Velocity rows D(q) v + d = 0 linearised about a moving state.
//!
//! With v0 the rates of the state the rows of both levels, J v + d = 0, give for increments of rates u of the independent coordinates
//!
//! ```text
//! y' = B'' u + E y,   E y = -J_d^-1 ((dJ/dy y) v0 - J W y) on the dependent coordinates,
//! ```
//! where W y = w x y on each triple of rotations that turns with the rate w (an increment of the rate is y' - W y there). Rates may be
//! counted from any others, u - A y: E + B'' A is chosen such that its image is motions that change nothing, those of the whole model
//! in the plane of rolling and the turning of its wheels. The displacement is y = B'' z + y_e with z' = u and y_e' = E y: y_e, a heading
//! and a path, is what velocity rows leave free. No force depends on it, and the second-order equations of z are complete:
//!
//! ```text
//! D'' = B''^T (D B'' + M E B''),   S'' = B''^T (S B'' + D E B'' + M E E B''),
//! ```
//! after J. P. Meijaard, J. M. Papadopoulos, A. Ruina and A. L. Schwab, Linearized dynamics equations for the balance and steer of a
//! bicycle, Proc. R. Soc. A 463 (2007). `check_rolling` refuses what does not fit this.
use nalgebra::{DMatrix, DVector};

use crate::analysis::linearize::{Path, Setting, Turning, body_map, full_map, turning_jacobian};
use crate::error::{Error, Result};
use crate::model::joint::JointKind;
use crate::spatial::V3;
use crate::system::assemble::Tangent;
use crate::system::loops::{Loops, column_scales};
use crate::system::placement::{Placement, place};
use crate::system::topology::Level;
use crate::tolerances::{ROLLS_STEADILY, ROUNDING_OF_FORCES};

/// Do velocity rows act on a state that moves?
pub(super) fn rolls(setting: &Setting<'_>) -> bool {
    let velocity = setting.system.topology.rows.iter().any(|r| r.level == Level::Velocity);
    velocity && setting.effects.nonholonomic && setting.state.moving()
}

/// A coordinate that rolling moves by an equation of its own.
const DELAY: &str = "has a coordinate that rolling makes follow the others with a delay of its own (as a trailer follows its hitch), a \
                     first-order equation that the second-order ones do not hold; hold that coordinate";

/// `straight`: B''' and the accelerations of the state, which have to vanish.
pub(super) fn rolling(
    setting: &Setting<'_>,
    loops: &Loops,
    b: &DMatrix<f64>,
    jacobian: &DMatrix<f64>,
    path: &Path<'_, f64>,
    straight: &Turning<f64>,
) -> Result<Turning<f64>> {
    let natural = Natural::of(setting, loops);
    let bends = natural.size(&straight.first).max(natural.size_of(&straight.acceleration) / natural.speed);
    if bends > ROLLS_STEADILY * natural.speed {
        return Err(refused(
            setting,
            "moves on a curve or speeds up, so that its linearisation changes with time; linearise a state that rolls straight ahead",
        ));
    }
    let basis = full_map(loops, b);
    let follow = Follow::new(setting, loops, jacobian, path, &basis, &natural)?;
    let first = follow.apply(&basis, 1)?;
    let second = follow.apply(&first, 2)?;
    let third = follow.apply(&second, 3)?;
    if natural.size(&third) > ROLLS_STEADILY * natural.speed.powi(3) {
        return Err(refused(setting, DELAY));
    }
    Ok(Turning { rate: first.clone(), first, second, acceleration: straight.acceleration.clone() })
}

/// No force may depend on the displacements y_e that velocity rows leave free: B''^T (S + D E + M E E) y_e = 0 for all that E reaches.
pub(super) fn check_rolling(
    setting: &Setting<'_>,
    (loops, b): (&Loops, &DMatrix<f64>),
    turning: &Turning<f64>,
    tangent: &Tangent<f64>,
    force_scale: f64,
) -> Result<()> {
    let natural = Natural::of(setting, loops);
    let (f1, f2) = (&turning.first, &turning.second);
    let through = full_map(loops, b).transpose();
    let mut rates = DMatrix::zeros(f1.nrows(), f1.nrows());
    for part in [&tangent.damping, &tangent.gyroscopic].into_iter().flatten() {
        rates += part;
    }
    let forces = [
        (&through * (&tangent.stiffness * f1 + &rates * f2), natural.speed),
        (&through * (&tangent.stiffness * f2), natural.speed.powi(2)),
    ];
    let absolute = |x: &DMatrix<f64>| x.map(f64::abs);
    let stiff = absolute(&through) * absolute(&tangent.stiffness);
    let terms = &stiff * absolute(f1) + absolute(&through) * absolute(&rates) * absolute(f2);
    for (force, speed) in &forces {
        for i in 0..force.nrows() {
            let row = |x: &DMatrix<f64>| (0..x.ncols()).map(|j| x[(i, j)].abs() * natural.independent[j]).fold(0.0, f64::max);
            let size = row(&terms).max(row(&(&stiff * absolute(f2))));
            let rounding = ROUNDING_OF_FORCES * force_scale * speed / natural.independent[i];
            if row(force) > ROLLS_STEADILY * size + rounding {
                let name = &setting.system.topology.names[loops.independent[i]];
                return Err(refused(
                    setting,
                    &format!("meets forces on '{name}' that depend on where it has rolled to; leave such forces out"),
                ));
            }
        }
    }
    Ok(())
}

fn refused(setting: &Setting<'_>, why: &str) -> Error {
    let topology = &setting.system.topology;
    let row = topology.rows.iter().find(|r| r.level == Level::Velocity);
    let name = row.map_or("a joint", |r| topology.tables.joints[r.joint].name.as_str());
    Error::model(format!("the motion that rolls on '{name}' {why}, or follow the motion in time (mb.simulate)"))
}

/// Lengths over the characteristic length; rates are then 1/s.
struct Natural {
    independent: Vec<f64>,
    all: Vec<f64>,
    speed: f64,
}

impl Natural {
    fn of(setting: &Setting<'_>, loops: &Loops) -> Self {
        let all = column_scales(&setting.system.topology, setting.system.length);
        let pick = |places: &[usize]| places.iter().map(|i| all[*i]).collect();
        let rates = setting.state.rate.iter().zip(&all).map(|(r, s)| (r / s).abs());
        let speed = rates.fold(f64::MIN_POSITIVE, f64::max);
        Natural { independent: pick(&loops.independent), speed, all }
    }

    /// Of all tree coordinates over the independent ones.
    fn size(&self, rows: &DMatrix<f64>) -> f64 {
        let entry = |i: usize, j: usize| (rows[(i, j)] * self.independent[j] / self.all[i]).abs();
        (0..rows.nrows()).flat_map(|i| (0..rows.ncols()).map(move |j| (i, j))).map(|(i, j)| entry(i, j)).fold(0.0, f64::max)
    }

    fn size_of(&self, tree: &[f64]) -> f64 {
        tree.iter().zip(&self.all).map(|(v, s)| (v / s).abs()).fold(0.0, f64::max)
    }
}

struct Follow<'a> {
    setting: &'a Setting<'a>,
    loops: &'a Loops,
    jacobian: &'a DMatrix<f64>,
    path: &'a Path<'a, f64>,
    basis: &'a DMatrix<f64>,
    natural: &'a Natural,
    /// (n_tree, k): B'' and the motions that change nothing, rows in natural units, and the pseudo-inverse
    onto: DMatrix<f64>,
    inverse: DMatrix<f64>,
}

impl<'a> Follow<'a> {
    fn new(
        setting: &'a Setting<'a>,
        loops: &'a Loops,
        jacobian: &'a DMatrix<f64>,
        path: &'a Path<'a, f64>,
        basis: &'a DMatrix<f64>,
        natural: &'a Natural,
    ) -> Result<Self> {
        let mut columns: Vec<DVector<f64>> = basis.column_iter().map(|c| c.into_owned()).collect();
        columns.extend(motions_without_effect(setting, path)?);
        for column in &mut columns {
            for (v, s) in column.iter_mut().zip(&natural.all) {
                *v /= s;
            }
            let size = column.norm();
            if size > 0.0 {
                *column /= size;
            }
        }
        let onto = DMatrix::from_columns(&columns);
        let lost = |_| Error::singular("the motions of rolling could not be separated");
        let inverse = onto.clone().pseudo_inverse(ROLLS_STEADILY).map_err(lost)?;
        Ok(Follow { setting, loops, jacobian, path, basis, natural, onto, inverse })
    }

    /// (E + B'' A) Y for columns Y of tree coordinates, the speed's power `order` in it already.
    fn apply(&self, columns: &DMatrix<f64>, order: i32) -> Result<DMatrix<f64>> {
        let rate = DVector::from_column_slice(self.path.rate);
        let mut right = DMatrix::zeros(self.jacobian.nrows(), columns.ncols());
        for (k, y) in columns.column_iter().enumerate() {
            let y: Vec<f64> = y.iter().copied().collect();
            let along = Path { x: self.path.x, relative: self.path.relative, rate: &y };
            let change = turning_jacobian(self.setting, &along, None).map(|v| v.v1);
            let carried = DVector::from_vec(self.carried(&y));
            right.set_column(k, &(change * &rate - self.jacobian * carried));
        }
        let mut out = DMatrix::zeros(columns.nrows(), columns.ncols());
        for (k, row) in self.loops.balanced(self.jacobian, &right).row_iter().enumerate() {
            out.row_mut(self.loops.dependent[k]).copy_from(&row);
        }
        let natural = DMatrix::from_fn(out.nrows(), out.ncols(), |i, j| out[(i, j)] / self.natural.all[i]);
        let parts = &self.inverse * &natural;
        let miss = DMatrix::from_fn(out.nrows(), out.ncols(), |i, j| {
            (natural[(i, j)] - self.onto.row(i).dot(&parts.column(j).transpose())) * self.natural.all[i]
        });
        if self.natural.size(&miss) > ROLLS_STEADILY * self.natural.speed.powi(order) {
            return Err(refused(self.setting, DELAY));
        }
        // what is a motion of B'' belongs to u
        for k in 0..self.basis.ncols() {
            let own = self.basis.column(k);
            let size = own.iter().zip(&self.natural.all).map(|(v, s)| (v / s).powi(2)).sum::<f64>().sqrt();
            for j in 0..out.ncols() {
                out.column_mut(j).axpy(-parts[(k, j)] / size.max(f64::MIN_POSITIVE), &own, 1.0);
            }
        }
        Ok(out)
    }

    /// W y.
    fn carried(&self, y: &[f64]) -> Vec<f64> {
        let mut out = vec![0.0; y.len()];
        let nodes = self.setting.system.topology.nodes.iter();
        for node in nodes.filter(|n| matches!(n.kind, JointKind::Spherical | JointKind::Free)) {
            let at = node.first + node.n - 3;
            let triple = |v: &[f64]| V3::new(v[at], v[at + 1], v[at + 2]);
            let sign = if node.reversed { -1.0 } else { 1.0 };
            let turned = triple(self.path.rate).cross(&triple(y)) * sign;
            out[at..at + 3].copy_from_slice(turned.as_slice());
        }
        out
    }
}

/// Candidates: the whole model moved in the plane of rolling and turned about its normal, the motion itself, and joints that turn.
fn motions_without_effect(setting: &Setting<'_>, path: &Path<'_, f64>) -> Result<Vec<DVector<f64>>> {
    let system = setting.system;
    let topology = &system.topology;
    let n = path.rate.len();
    let mut out = vec![DVector::from_column_slice(path.rate)];
    for node in topology.nodes.iter().filter(|node| node.n == 1) {
        if path.rate.get(node.first).is_some_and(|r| *r != 0.0) {
            let mut one = DVector::zeros(n);
            one[node.first] = 1.0;
            out.push(one);
        }
    }
    let placement = place(topology, &system.geometry, path.relative, None);
    let Some(normal) = normal(setting, &placement) else {
        return Ok(out);
    };
    let lost = |_| Error::singular("the motions of rolling could not be separated");
    let map = body_map(system, &system.geometry, &placement, None);
    let length = system.length;
    let scale = |i: usize| if i % 6 < 3 { 1.0 / length } else { 1.0 };
    let columns = column_scales(topology, length);
    let scaled = DMatrix::from_fn(map.nrows(), n, |i, j| map[(i, j)] * scale(i) * columns[j]);
    let inverse = scaled.pseudo_inverse(ROLLS_STEADILY).map_err(lost)?;
    let across = normal.cross(&if normal.x.abs() < 0.5 { V3::x() } else { V3::y() }).normalize();
    let along = normal.cross(&across);
    for (turn, slide) in [(normal, V3::zeros()), (V3::zeros(), across), (V3::zeros(), along)] {
        let mut twist = DVector::zeros(map.nrows());
        for (node, pose) in topology.nodes.iter().zip(&placement.pose) {
            let origin = pose.p - pose.r * system.geometry.bodies[node.body].com;
            let v = slide * length + turn.cross(&origin);
            for k in 0..3 {
                twist[6 * node.body + k] = v[k] / length;
                twist[6 * node.body + 3 + k] = turn[k];
            }
        }
        let y = &inverse * twist;
        out.push(DVector::from_fn(n, |i, _| y[i] * columns[i]));
    }
    Ok(out)
}

/// Of the plane that discs roll on, else the direction of the weight.
fn normal(setting: &Setting<'_>, placement: &Placement<f64>) -> Option<V3<f64>> {
    let system = setting.system;
    let tables = &system.topology.tables;
    let disc = tables.joints.iter().position(|j| j.kind == JointKind::RollingDisc);
    let from_disc = disc.map(|j| {
        let marker = &system.geometry.joints[j].a;
        let body = tables.joints[j].a.and_then(|b| system.topology.nodes.iter().position(|n| n.body == b));
        let axis: V3<f64> = marker.r.column(2).into_owned();
        body.map_or(axis, |node| placement.pose[node].r * axis)
    });
    let weight = system.geometry.gravity.filter(|g| g.norm() > 0.0).map(|g| g.normalize());
    from_disc.or(weight)
}
