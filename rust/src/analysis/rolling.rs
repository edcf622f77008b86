//! Velocity rows D(q) v + d = 0 linearised about a moving state.
//!
//! With v0 the rates of the state and z' the increments of the independent ones, the rows of both levels, J v + d = 0, give
//!
//! ```text
//! y' = B'' z' + E y,   E y = -J_d^-1 ((dJ/dy y) v0 - J W y) on the dependent coordinates,
//! ```
//! where W y = w x y on each triple of rotations that turns with the rate w (an increment of the rate is y' - W y there). The
//! displacement is y = B'' z + y_e with y_e' = E y: it does not follow from z, which velocity rows are about (a heading, a path).
//! Where no force depends on y_e the second-order equations of z are complete, with
//!
//! ```text
//! D'' = B''^T (D B'' + M E B''),   S'' = B''^T (S B'' + D E B'' + M E E B''),
//! ```
//! after J. P. Meijaard, J. M. Papadopoulos, A. Ruina and A. L. Schwab, Linearized dynamics equations for the balance and steer of a
//! bicycle, Proc. R. Soc. A 463 (2007). `check_rolling` refuses what does not fit this.
use nalgebra::{DMatrix, DVector};

use crate::analysis::linearize::{Path, Setting, Turning, turning_jacobian};
use crate::analysis::transient::rotations::add_commutator;
use crate::error::{Error, Result};
use crate::system::assemble::Tangent;
use crate::system::loops::{Loops, column_scales};
use crate::system::topology::Level;
use crate::tolerances::rolling::{ROLLS_STEADILY, ROUNDING_OF_FORCES};

/// Do velocity rows act on a state that moves?
pub(super) fn rolls(setting: &Setting<'_>) -> bool {
    let velocity = setting.system.topology.rows.iter().any(|r| r.level == Level::Velocity);
    velocity && setting.effects.nonholonomic && setting.state.moving()
}

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
    // of a disc that turns upright the rows change with the square of time only
    let second = natural.size(&straight.second) / natural.speed;
    let bends = natural.size(&straight.first).max(natural.size_of(&straight.acceleration) / natural.speed).max(second);
    if bends > ROLLS_STEADILY * natural.speed {
        return Err(refused(
            setting,
            "moves on a curve or speeds up, so that its linearisation changes with time; linearise a state that rolls straight ahead",
        ));
    }
    let follow = Follow { setting, loops, jacobian, path };
    let first = follow.apply(&full(loops, b));
    let second = follow.apply(&embedded(loops, &first));
    let third = follow.apply(&embedded(loops, &second));
    if natural.size(&third) > ROLLS_STEADILY * natural.speed.powi(3) {
        return Err(refused(
            setting,
            "has a coordinate that rolling makes follow the others with a delay of its own (as a trailer follows its hitch), a \
             first-order equation that the second-order ones do not hold",
        ));
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
    let (f1, f2) = (embedded(loops, &turning.first), embedded(loops, &turning.second));
    let through = full(loops, b).transpose();
    let mut rates = DMatrix::zeros(f1.nrows(), f1.nrows());
    for part in [&tangent.damping, &tangent.gyroscopic].into_iter().flatten() {
        rates += part;
    }
    let forces = [
        (&through * (&tangent.stiffness * &f1 + &rates * &f2), natural.speed),
        (&through * (&tangent.stiffness * &f2), natural.speed.powi(2)),
    ];
    let absolute = |x: &DMatrix<f64>| x.map(f64::abs);
    let stiff = absolute(&through) * absolute(&tangent.stiffness);
    let terms = &stiff * absolute(&f1) + absolute(&through) * absolute(&rates) * absolute(&f2);
    for (force, speed) in &forces {
        for i in 0..force.nrows() {
            let row =
                |x: &DMatrix<f64>| (0..x.ncols()).map(|j| x[(i, j)].abs() * natural.independent[j]).fold(0.0, f64::max);
            let size = row(&terms).max(row(&(&stiff * absolute(&f2))));
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
    dependent: Vec<f64>,
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
        Natural { dependent: pick(&loops.dependent), independent: pick(&loops.independent), speed, all }
    }

    fn size(&self, rows: &DMatrix<f64>) -> f64 {
        let entry = |i: usize, j: usize| (rows[(i, j)] * self.independent[j] / self.dependent[i]).abs();
        (0..rows.nrows())
            .flat_map(|i| (0..rows.ncols()).map(move |j| (i, j)))
            .map(|(i, j)| entry(i, j))
            .fold(0.0, f64::max)
    }

    fn size_of(&self, tree: &[f64]) -> f64 {
        tree.iter().zip(&self.all).map(|(v, s)| (v / s).abs()).fold(0.0, f64::max)
    }
}

/// (n_tree, dof): B'' with the rows of the independent coordinates.
fn full(loops: &Loops, b: &DMatrix<f64>) -> DMatrix<f64> {
    let mut out = embedded(loops, b);
    for (k, i) in loops.independent.iter().enumerate() {
        out[(*i, k)] = 1.0;
    }
    out
}

/// Rows of the dependent coordinates among all, zero elsewhere.
fn embedded(loops: &Loops, rows: &DMatrix<f64>) -> DMatrix<f64> {
    let mut out = DMatrix::zeros(loops.independent.len() + loops.dependent.len(), rows.ncols());
    for (k, i) in loops.dependent.iter().enumerate() {
        out.row_mut(*i).copy_from(&rows.row(k));
    }
    out
}

struct Follow<'a> {
    setting: &'a Setting<'a>,
    loops: &'a Loops,
    jacobian: &'a DMatrix<f64>,
    path: &'a Path<'a, f64>,
}

impl Follow<'_> {
    /// E Y for columns Y of tree coordinates: its rows on the dependent ones.
    fn apply(&self, columns: &DMatrix<f64>) -> DMatrix<f64> {
        let rate = DVector::from_column_slice(self.path.rate);
        let mut right = DMatrix::zeros(self.jacobian.nrows(), columns.ncols());
        for (k, y) in columns.column_iter().enumerate() {
            let y: Vec<f64> = y.iter().copied().collect();
            let along = Path { x: self.path.x, q: self.path.q, rate: &y };
            let change = turning_jacobian(self.setting, &along, None).map(|v| v.v1);
            let carried = DVector::from_vec(self.carried(&y));
            right.set_column(k, &(change * &rate - self.jacobian * carried));
        }
        self.loops.balanced(self.jacobian, &right)
    }

    /// W y.
    fn carried(&self, y: &[f64]) -> Vec<f64> {
        let mut out = vec![0.0; y.len()];
        add_commutator(&self.setting.system.topology, 1.0, (self.path.rate, y), &mut out);
        out
    }
}
