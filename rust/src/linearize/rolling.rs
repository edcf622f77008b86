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
//! bicycle, Proc. R. Soc. A 463 (2007).
//!
//! The rates z' + X y with E + B'' X in the place of E describe the same motion. The tree coordinates are X = 0, where a body that
//! rolls askew to the axes of its joint leans a little with every heading, and forces depend on y_e. Let R hold B'' and all that E makes
//! of it, and U be the part of R that no force follows, C E^k U = 0 for all k (observability; T. Kailath, Linear Systems, 1980, section
//! 2.4). Where R = B'' + N with N in U, the X that keeps y_e in N leaves no force there. What has no such N is refused.
use nalgebra::{DMatrix, DVector};

use crate::constraint::loops::{Loops, column_scales};
use crate::constraint::spectrum::singular_values;
use crate::error::{Error, Result};
use crate::linearize::{Path, Setting, Turning, turning_jacobian};
use crate::multibody::assemble::Tangent;
use crate::multibody::rotations::add_commutator;
use crate::multibody::topology::Level;
use crate::tolerances::rolling::{APART, ROLLS_STEADILY, UNFELT};

/// Do velocity rows act on a state that moves?
pub(crate) fn rolls(setting: &Setting<'_>) -> bool {
    let velocity = setting.system.topology.rows.iter().any(|r| r.level == Level::Velocity);
    velocity && setting.effects.nonholonomic && setting.state.moving()
}

/// What rolls straight on: `straight` holds B''' and the accelerations of the state, which have to vanish.
pub(crate) fn rolling(
    follow: &Follow<'_>,
    b: &DMatrix<f64>,
    straight: &Turning<f64>,
    tangent: &Tangent<f64>,
    force_scale: f64,
) -> Result<Turning<f64>> {
    let (setting, loops) = (follow.setting, follow.loops);
    let natural = Natural::of(setting, loops);
    // of a disc that turns upright the rows change with the square of time only
    let second = natural.size(&straight.second, &natural.dependent) / natural.speed;
    let accelerated = natural.size_of(&straight.acceleration) / natural.speed;
    let bends = natural.size(&straight.first, &natural.dependent).max(accelerated).max(second);
    if bends > ROLLS_STEADILY * natural.speed {
        return Err(refused(
            setting,
            "moves on a curve or speeds up, so that its linearisation changes with time; linearise a state that rolls straight ahead",
        ));
    }
    let made = |[first, second, ..]: Chain| Turning {
        rows: (0..first.nrows()).collect(),
        rate: first.clone(),
        first,
        second,
        acceleration: straight.acceleration.clone(),
    };
    let whole = full(loops, b);
    let mut power = whole.clone();
    let plain: Chain = [(); 4].map(|()| {
        power = follow.apply(&power);
        power.clone()
    });
    let delayed = natural.size(&plain[2], &natural.all) > ROLLS_STEADILY * natural.speed.powi(3);
    let forces = Forces::new(loops, &whole, tangent, natural, force_scale);
    let felt = forces.felt(&plain);
    if !delayed && felt.is_none() {
        return Ok(made(plain));
    }
    if let Some(other) = forces.unfelt(follow).filter(|chain| forces.felt(chain).is_none()) {
        return Ok(made(other));
    }
    let name = felt.filter(|_| !delayed).map(|i| &setting.system.topology.names[loops.independent[i]]);
    Err(match name {
        Some(name) => refused(
            setting,
            &format!("meets forces on '{name}' that depend on where it has rolled to; leave such forces out"),
        ),
        None => refused(
            setting,
            "has a coordinate that rolling makes follow the others with a delay of its own (as a trailer follows its hitch), a \
             first-order equation that the second-order ones do not hold",
        ),
    })
}

/// E B'' to E^4 B''.
type Chain = [DMatrix<f64>; 4];

/// Forces B''^T (S y + D y' + M y"), y' = E y, on displacements y.
struct Forces<'a> {
    loops: &'a Loops,
    tangent: &'a Tangent<f64>,
    whole: &'a DMatrix<f64>,
    through: DMatrix<f64>,
    /// damping and gyroscopic terms
    rates: DMatrix<f64>,
    natural: Natural,
    /// forces that are rounding, by independent coordinate
    rounding: Vec<f64>,
}

impl<'a> Forces<'a> {
    fn new(
        loops: &'a Loops,
        whole: &'a DMatrix<f64>,
        tangent: &'a Tangent<f64>,
        natural: Natural,
        force_scale: f64,
    ) -> Self {
        let n = whole.nrows();
        let mut rates = DMatrix::zeros(n, n);
        for part in [&tangent.damping, &tangent.gyroscopic].into_iter().flatten() {
            rates += part;
        }
        let rounding = natural.independent.iter().map(|scale| ROLLS_STEADILY * force_scale / scale).collect();
        Forces { loops, tangent, whole, through: whole.transpose(), rates, natural, rounding }
    }

    /// The independent coordinate that feels a displacement y_e which velocity rows make.
    fn felt(&self, chain: &Chain) -> Option<usize> {
        let (t, speed) = (self.tangent, self.natural.speed);
        let force = |y: &[DMatrix<f64>]| &self.through * (&t.stiffness * &y[0] + &self.rates * &y[1] + &t.mass * &y[2]);
        let forces = [(force(&chain[..3]), speed), (force(&chain[1..]), speed.powi(2))];
        let absolute = |x: &DMatrix<f64>| x.map(f64::abs);
        let stiff = absolute(&self.through) * absolute(&t.stiffness);
        let terms =
            &stiff * absolute(&chain[0]) + absolute(&self.through) * absolute(&self.rates) * absolute(&chain[1]);
        let row = |x: &DMatrix<f64>, i: usize| {
            (0..x.ncols()).map(|j| x[(i, j)].abs() * self.natural.independent[j]).fold(0.0, f64::max)
        };
        let beyond = |i: &usize| {
            let size = row(&terms, *i).max(row(&(&stiff * absolute(&chain[1])), *i));
            forces.iter().any(|(f, speed)| row(f, *i) > ROLLS_STEADILY * size + self.rounding[*i] * speed)
        };
        (0..self.loops.independent.len()).find(beyond)
    }

    /// E B'', E E B'', ... with the E that keeps y_e where no force follows it.
    fn unfelt(&self, follow: &Follow<'_>) -> Option<Chain> {
        let (n, dof, speed) = (self.whole.nrows(), self.whole.ncols(), self.natural.speed);
        let all = &self.natural.all;
        let natural = |x: &DMatrix<f64>| DMatrix::from_fn(n, x.ncols(), |i, j| x[(i, j)] / all[i]);
        let given = |x: &DMatrix<f64>| DMatrix::from_fn(n, x.ncols(), |i, j| x[(i, j)] * all[i]);
        let by_speed = |x: &DMatrix<f64>| natural(&follow.apply(&given(x))) / speed;
        // R, the columns of B'' first
        let start = natural(&DMatrix::from_fn(n, dof, |i, j| self.whole[(i, j)] * self.natural.independent[j]));
        let mut reached = range(&start)?;
        if reached.ncols() < dof {
            return None;
        }
        let mut last = reached.clone();
        while reached.ncols() < n {
            let more = by_speed(&last);
            let new = &more - &reached * (reached.transpose() * &more);
            let new = &new - &reached * (reached.transpose() * &new);
            last = range(&new)?;
            if last.ncols() == 0 {
                break;
            }
            let at = reached.ncols();
            reached = reached.insert_columns(at, last.ncols(), 0.0);
            reached.columns_mut(at, last.ncols()).copy_from(&last);
        }
        let moved = by_speed(&reached);
        let e = reached.transpose() * &moved;
        let free = self.free(&given(&reached), &(given(&moved) * speed), &e)?;
        let kept = staying(&free, &e, dof)?;
        let mut power = reached.transpose() * natural(self.whole);
        Some([1, 2, 3, 4].map(|k| {
            power = &kept * &power;
            given(&(&reached * &power)) * speed.powi(k)
        }))
    }

    /// U, columns in R: its basis `reached`, what E makes of that, and E in R over the speed.
    fn free(&self, reached: &DMatrix<f64>, moved: &DMatrix<f64>, e: &DMatrix<f64>) -> Option<DMatrix<f64>> {
        let speed = self.natural.speed;
        let again = reached * (e * e) * speed.powi(2);
        let t = self.tangent;
        let mut forces = &self.through * (&t.stiffness * reached + &self.rates * moved + &t.mass * &again);
        let absolute = |x: &DMatrix<f64>| x.map(f64::abs);
        let terms = absolute(&self.through)
            * (absolute(&t.stiffness) * absolute(reached)
                + absolute(&self.rates) * absolute(moved)
                + absolute(&t.mass) * absolute(&again));
        for i in 0..forces.nrows() {
            let size = terms.row(i).amax() + self.rounding[i] / ROLLS_STEADILY;
            if size > 0.0 {
                forces.row_mut(i).unscale_mut(size);
            }
        }
        unseen(forces, e)
    }
}

/// U, orthonormal columns: what forces C (over their sizes) do not see under y' = E y, C E^k U = 0.
fn unseen(mut forces: DMatrix<f64>, e: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    let (r, m) = (e.nrows(), forces.nrows());
    let mut seen = DMatrix::zeros(r * m, r);
    for k in 0..r {
        seen.rows_mut(k * m, m).copy_from(&forces);
        forces *= e;
    }
    let (size, _, right) = singular_values(&seen).ok()?;
    let kept: Vec<usize> = (0..r).filter(|i| size[*i] <= UNFELT).collect();
    (!kept.is_empty()).then(|| right.select_columns(&kept))
}

/// N E with the N = [X; 1] in the columns of `free` that takes what follows the first `dof` rows: y_e stays in it.
fn staying(free: &DMatrix<f64>, e: &DMatrix<f64>, dof: usize) -> Option<DMatrix<f64>> {
    let behind = e.nrows() - dof;
    if behind == 0 || behind > free.ncols() {
        return None;
    }
    let (apart, left, right) = singular_values(&free.rows(dof, behind).into_owned()).ok()?;
    if apart.iter().any(|s| *s < APART) {
        return None;
    }
    let over = DMatrix::from_fn(free.ncols(), behind, |i, j| right[(i, j)] / apart[j]);
    Some(free * over * left.transpose() * e.rows(dof, behind))
}

fn refused(setting: &Setting<'_>, why: &str) -> Error {
    let topology = &setting.system.topology;
    let row = topology.rows.iter().position(|r| r.level == Level::Velocity);
    let name = row.map_or("a joint", |i| topology.row_name(i));
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

    fn size(&self, rows: &DMatrix<f64>, scales: &[f64]) -> f64 {
        let entry = |i: usize, j: usize| (rows[(i, j)] * self.independent[j] / scales[i]).abs();
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

/// An orthonormal basis of the columns, without those that are rounding beside one.
fn range(columns: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    let (size, left, _) = singular_values(columns).ok()?;
    let kept: Vec<usize> = (0..size.len()).filter(|i| size[*i] > ROLLS_STEADILY).collect();
    Some(left.select_columns(&kept))
}

/// What displacements make velocity rows do: E.
pub(crate) struct Follow<'a> {
    pub setting: &'a Setting<'a>,
    pub loops: &'a Loops,
    pub jacobian: &'a DMatrix<f64>,
    pub path: &'a Path<'a, f64>,
}

impl Follow<'_> {
    /// E Y for columns Y of tree coordinates; zero on the independent ones.
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
        embedded(self.loops, &self.loops.balanced(self.jacobian, &right))
    }

    /// W y.
    fn carried(&self, y: &[f64]) -> Vec<f64> {
        let mut out = vec![0.0; y.len()];
        add_commutator(&self.setting.system.topology, 1.0, (self.path.rate, y), &mut out);
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// y0' = y1, y1' = 0 with a force c0 on y0 and one on y2: y1 is seen by way of y0.
    #[test]
    fn a_force_is_seen_from_its_bound_on() {
        let e = DMatrix::from_fn(3, 3, |i, j| if (i, j) == (0, 1) { 1.0 } else { 0.0 });
        let unseen_of = |c0: f64| unseen(DMatrix::from_row_slice(2, 3, &[c0, 0.0, 0.0, 0.0, 0.0, 1.0]), &e);
        assert_eq!(unseen_of(0.9e-8).map(|u| u.ncols()), Some(2));
        assert_eq!(unseen_of(1.1e-8).map(|u| u.ncols()), None);
    }

    /// At the smallest angle between U and the rows' motions N E keeps the digits that straight rolling is held to.
    #[test]
    fn directions_are_apart_from_their_bound_on() {
        let e = DMatrix::from_row_slice(2, 2, &[0.0, 0.0, 0.7, 0.0]);
        let at = |sine: f64| staying(&DMatrix::from_column_slice(2, 1, &[(1.0 - sine * sine).sqrt(), sine]), &e, 1);
        assert!(at(0.9e-4).is_none());
        let sine = 1.1e-4_f64;
        let cotangent = (1.0 - sine * sine).sqrt() / sine;
        let made = at(sine).map(|m| (m[(0, 0)], m[(1, 0)]));
        let close = |(x, y): (f64, f64)| {
            (x - 0.7 * cotangent).abs() < ROLLS_STEADILY * cotangent && (y - 0.7).abs() < ROLLS_STEADILY
        };
        assert!(made.is_some_and(close));
        const { assert!(f64::EPSILON / APART < ROLLS_STEADILY) };
    }
}
