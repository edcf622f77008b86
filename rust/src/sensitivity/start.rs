//! The derivative of the first instant: loops close by the smallest change, rates follow the bodies' given velocities and agree
//! with the rows, accelerations and multipliers follow from both.
//!
//! ```text
//! dy:  dy + J^T . = 0,  J dy = -dPhi          v - v_g + J^T mu = 0,  J v + Phi_t = 0   (scaled by the characteristic length)
//! M a + h + J^T lam = 0,  J a + gamma = 0
//! ```
use nalgebra::{DMatrix, DVector};
use num_dual::Dual64;

use crate::constraint::assembly::given_rates;
use crate::constraint::closure::drawn_start;
use crate::error::{Error, Result};
use crate::integrate::ali3p::pulled;
use crate::integrate::{Equations, Instant, Motion};
use crate::linalg::kkt::Kkt;
use crate::linalg::rows::Level as Asked;
use crate::multibody::placement::{State, advance, difference, lifted_q, place};
use crate::multibody::topology::Level;
use crate::run::Counts;
use crate::tolerances::constraints::{CLOSED_ENOUGH, REDUNDANT_OPEN};

use super::direct::slopes::Slopes;
use super::{Direction, Follow, Plan};

/// The first instant with its derivative along one direction.
pub struct Start {
    pub motion: Motion<Dual64>,
    pub acceleration: Vec<Dual64>,
    pub lam: Vec<Dual64>,
}

/// What the derivatives along all directions share.
pub struct Starting<'a> {
    eq: &'a Equations<'a, f64>,
    first: &'a Instant,
    follow: &'a Follow,
    /// [S^-2 J^T; J 0] of the position rows and of all rows; [M J^T; J 0]
    closing: Option<Kkt>,
    aligning: Option<Kkt>,
    accelerating: Kkt,
    position: Vec<usize>,
    jacobian: DMatrix<f64>,
    /// how the drawn loops were closed, if they were drawn open
    path: Vec<Closing>,
}

/// A Newton step of the assembly from a configuration: dy = -J^+ Phi in the metric S^-2, and its multipliers.
struct Closing {
    by: Kkt,
    dy: Vec<f64>,
    mu: Vec<f64>,
}

impl<'a> Starting<'a> {
    pub fn new(eq: &'a Equations<'a, f64>, first: &'a Instant, follow: &'a Follow) -> Result<Self> {
        let jacobian = eq.rows(&first.motion).1;
        let rows = &eq.topology().rows;
        let position: Vec<usize> = (0..rows.len()).filter(|i| rows[*i].level == Level::Position).collect();
        let scales = eq.scales();
        let weight = DMatrix::from_fn(eq.n(), eq.n(), |i, j| if i == j { scales[i].powi(-2) } else { 0.0 });
        let closing = (!position.is_empty()).then(|| closing_by(eq, &weight, &jacobian, &position).map(|c| c.0));
        let closing = closing.transpose()?;
        let path = if follow.drawn && follow.shift.is_empty() && closing.is_some() {
            assembled(eq, first, &position, &weight)?
        } else {
            Vec::new()
        };
        Ok(Starting {
            path,
            closing,
            aligning: (jacobian.nrows() > 0).then(|| eq.kkt_of(&weight, &jacobian, &jacobian)).transpose()?,
            accelerating: eq.kkt_of(&eq.mass(&first.motion), &jacobian, &jacobian)?,
            eq,
            first,
            follow,
            position,
            jacobian,
        })
    }

    /// [M J^T; J 0] at the start.
    pub fn accelerating(&self) -> &Kkt {
        &self.accelerating
    }

    /// Do positions and rates of the start depend on numbers at all?
    pub fn is_constant(&self) -> bool {
        let topology = self.eq.topology();
        let two_points = topology
            .nodes
            .iter()
            .any(|n| n.joint.is_some_and(|_| !n.kind.freedoms(n.reversed).iter().all(|f| f.rotation)));
        topology.rows.is_empty()
            && self.follow.shift.is_empty()
            && !(two_points && self.follow.drawn)
            && !self.follow.velocities
    }

    /// Positions and rates alone, along direction p.
    pub fn motion(&self, dual: &Equations<'_, Dual64>, p: usize) -> Result<Motion<Dual64>> {
        let (eq, first) = (self.eq, &self.first.motion);
        let topology = eq.topology();
        let state = State { q: first.q.clone(), rate: first.rate.clone() };
        let lift = |v: &[f64]| v.iter().map(|x| Dual64::from(*x)).collect::<Vec<_>>();
        let q = if self.follow.drawn { lifted_q(topology, &dual.geometry, &state) } else { lift(&first.q) };
        let mut m = Motion { t: first.t, q, rate: lift(&first.rate), memory: lift(&first.memory) };
        if !self.path.is_empty() {
            m.q = self.assembled(dual, &m)?;
        }
        if let Some(shift) = self.follow.shift.get(p) {
            let dy: Vec<_> = shift.iter().map(|d| Dual64::new(0.0, *d)).collect();
            advance(topology, &mut m.q, &dy);
        }
        if let Some(closing) = &self.closing {
            let dy = self.close(&dual.rows(&m).0, closing)?;
            advance(topology, &mut m.q, &dy);
        }
        self.rates(dual, &mut m)?;
        Ok(m)
    }

    /// The configuration after all steps of the assembly, with its derivative at the values of the first instant.
    fn assembled(&self, dual: &Equations<'_, Dual64>, m: &Motion<Dual64>) -> Result<Vec<Dual64>> {
        let topology = self.eq.topology();
        let state = State { q: drawn_start(self.eq.system), rate: Vec::new() };
        let mut here = Motion { q: lifted_q(topology, &dual.geometry, &state), ..m.clone() };
        let slope = self.weight_slopes(dual);
        for step in &self.path {
            let (phi, jacobian) = dual.rows(&here);
            let rows = self.position.len();
            let jacobian = DMatrix::from_fn(rows, step.dy.len(), |i, j| jacobian[(self.position[i], j)]);
            let turned = pulled(&jacobian, &step.mu);
            let f = DVector::from_fn(step.dy.len(), |i, _| -turned[i].eps - slope[i] * step.dy[i]);
            let g = DVector::from_fn(rows, |i, _| {
                let moved: f64 = (0..step.dy.len()).map(|j| jacobian[(i, j)].eps * step.dy[j]).sum();
                -phi[self.position[i]].eps - moved
            });
            let (d, _) = step.by.solve_one(&f, &g)?;
            let dy: Vec<_> = (step.dy.iter().zip(d.iter())).map(|(y, d)| Dual64::new(*y, *d)).collect();
            advance(topology, &mut here.q, &dy);
        }
        // the derivative along the increments, at the coordinates of the first instant
        let held: Vec<_> = here.q.iter().map(|d| Dual64::from(d.re)).collect();
        let slope: Vec<_> = difference(topology, &held, &here.q).iter().map(|d| Dual64::new(0.0, d.eps)).collect();
        let mut q: Vec<_> = self.first.motion.q.iter().map(|v| Dual64::from(*v)).collect();
        advance(topology, &mut q, &slope);
        Ok(q)
    }

    /// Derivative of S^-2 along a direction: the characteristic length moves with the points of the model.
    fn weight_slopes(&self, dual: &Equations<'_, Dual64>) -> Vec<f64> {
        let eq = self.eq;
        let length = eq.topology().characteristic_length(&dual.geometry, &dual.x);
        let (part, unit) = (length.eps / length.re, eq.scales());
        let held = eq.topology();
        (0..eq.n())
            .map(|i| match held.scale(i, 2.0) / held.scale(i, 1.0) > 1.5 {
                true => -2.0 * part / (unit[i] * unit[i]),
                false => 0.0,
            })
            .collect()
    }

    fn close(&self, phi: &DVector<Dual64>, closing: &Kkt) -> Result<Vec<Dual64>> {
        let scale = self.eq.row_scales();
        let miss = DVector::from_fn(self.position.len(), |i, _| -phi[self.position[i]].eps);
        let (dy, _) = closing.solve_one(&DVector::zeros(self.eq.n()), &miss)?;
        let whole = |i: usize| scale[self.position[i]];
        let size = (0..miss.len()).map(|i| (miss[i] * whole(i)).abs()).fold(0.0, f64::max);
        let left = (0..miss.len())
            .map(|i| {
                let reached: f64 = (0..dy.len()).map(|j| self.jacobian[(self.position[i], j)] * dy[j]).sum();
                ((reached - miss[i]) * whole(i)).abs()
            })
            .fold(0.0, f64::max);
        // below the second bound both are rounding
        if left > REDUNDANT_OPEN * self.eq.system.tolerance * size && left > CLOSED_ENOUGH {
            return Err(Error::NotDifferentiable(format!(
                "this parameter breaks a redundant loop open: its constraints agree only at the present value (they part at the rate \
                 {left:.1e}), so the derivative does not exist; vary parameters that keep the loop closed together, or release the \
                 redundant constraint"
            )));
        }
        Ok(dy.iter().map(|d| Dual64::new(0.0, *d)).collect())
    }

    /// Rates: those of the bodies' given velocities where the start is drawn, with the smallest change that the rows ask for.
    fn rates(&self, dual: &Equations<'_, Dual64>, m: &mut Motion<Dual64>) -> Result<()> {
        let eq = self.eq;
        let n = eq.n();
        let now = &self.first.motion.rate;
        if self.follow.velocities {
            let placement = place(eq.topology(), &dual.geometry, &m.q, None);
            m.rate = given_rates(eq.system, &dual.geometry, &dual.x, &placement)?;
        }
        let Some(aligning) = &self.aligning else {
            return Ok(());
        };
        let given: Vec<f64> = m.rate.iter().map(|v| v.re).collect();
        let slope: Vec<f64> = m.rate.iter().map(|v| v.eps).collect();
        let change = DVector::from_fn(n, |i, _| now[i] - given[i]);
        let (_, mu) = aligning.solve_one(&DVector::zeros(n), &(&self.jacobian * &change))?;
        m.rate = (0..n).map(|i| Dual64::new(now[i], slope[i])).collect();
        let (_, jacobian) = dual.rows(m);
        let (pull, slope) = (pulled(&jacobian, mu.as_slice()), self.weight_slopes(dual));
        let turned = DVector::from_fn(n, |i, _| -pull[i].eps - slope[i] * change[i]);
        let miss = dual.row_rates_of(m, &jacobian).map(|v| -v.eps);
        let (d, _) = aligning.solve_one(&turned, &miss)?;
        for (v, d) in m.rate.iter_mut().zip(d.iter()) {
            v.eps += d;
        }
        Ok(())
    }

    /// Everything along direction p, which `dual` was seeded with.
    pub fn along(&self, dual: &Equations<'_, Dual64>, p: usize, counts: &mut Counts) -> Result<Start> {
        let motion = self.motion(dual, p)?;
        let lift = |v: &[f64]| v.iter().map(|x| Dual64::from(*x)).collect::<Vec<_>>();
        let (a, lam) = (lift(&self.first.acceleration), lift(&self.first.lam));
        let f = dual.residual(&motion, &a, &lam, counts).map(|v| -v.eps);
        let g = if self.jacobian.nrows() > 0 {
            let jacobian = dual.rows(&motion).1;
            (dual.row_bias(&motion) + jacobian * DVector::from_vec(a.clone())).map(|v| -v.eps)
        } else {
            DVector::zeros(0)
        };
        let (da, dlam) = self.accelerating.solve_one(&f, &g)?;
        let with = |v: &[f64], d: &DVector<f64>| v.iter().zip(d.iter()).map(|(v, d)| Dual64::new(*v, *d)).collect();
        Ok(Start { motion, acceleration: with(&self.first.acceleration, &da), lam: with(&self.first.lam, &dlam) })
    }

    /// Coordinates and rates of the start along a direction, times weights.
    pub fn weighed(
        &self,
        eq: &Equations<'_, f64>,
        direction: &Direction,
        p: usize,
        q_weights: &[f64],
        rate_weights: &[f64],
    ) -> Result<f64> {
        let mut x: Vec<Dual64> = eq.x.iter().map(|v| Dual64::from(*v)).collect();
        for (i, d) in direction {
            x[*i].eps += d;
        }
        let m = self.motion(&Equations::new(eq.system, x, eq.effects), p)?;
        let sum: f64 = (m.q.iter().zip(q_weights)).map(|(v, w)| v.eps * w).sum();
        let rates: f64 = (m.rate.iter().zip(rate_weights)).map(|(v, w)| v.eps * w).sum();
        Ok(sum + rates)
    }
}

/// The first instant along all directions.
pub fn started(
    eq: &Equations<'_, f64>,
    first: &Instant,
    plan: &Plan,
    directions: &[Direction],
    order: &[usize],
    counts: &mut Counts,
) -> Result<Slopes> {
    let none = |rows: usize| DMatrix::zeros(rows, order.len());
    let (n, memory) = (eq.n(), first.motion.memory.len());
    let mut out = Slopes { x: none(n), v: none(n), a: none(n), lam: none(eq.n_rows()), z: none(memory) };
    if order.is_empty() {
        return Ok(out);
    }
    let starting = Starting::new(eq, first, &plan.follow)?;
    let held = Motion {
        t: first.motion.t,
        q: first.motion.q.iter().map(|v| Dual64::from(*v)).collect(),
        rate: Vec::new(),
        memory: Vec::new(),
    };
    for (column, p) in order.iter().enumerate() {
        let mut x: Vec<Dual64> = eq.x.iter().map(|v| Dual64::from(*v)).collect();
        for (i, d) in &directions[*p] {
            x[*i].eps += d;
        }
        let dual = Equations::new(eq.system, x, eq.effects);
        let start = starting.along(&dual, *p, counts)?;
        let put = |to: &mut DMatrix<f64>, d: &[Dual64]| {
            for (i, d) in d.iter().enumerate() {
                to[(i, column)] = d.eps;
            }
        };
        put(&mut out.x, &dual.difference(&held, &start.motion));
        put(&mut out.v, &start.motion.rate);
        put(&mut out.a, &start.acceleration);
        put(&mut out.lam, &start.lam);
        put(&mut out.z, &start.motion.memory);
    }
    Ok(out)
}

/// [S^-2 R^T; R 0] of the position rows R that carry their rank, and R.
fn closing_by(
    eq: &Equations<'_, f64>,
    weight: &DMatrix<f64>,
    jacobian: &DMatrix<f64>,
    position: &[usize],
) -> Result<(Kkt, DMatrix<f64>)> {
    let rows = DMatrix::from_fn(position.len(), eq.n(), |i, j| jacobian[(position[i], j)]);
    let kept = eq.rows.select_dense(jacobian, Asked::Position);
    let kept = kept.iter().filter_map(|i| position.binary_search(i).ok()).collect();
    Ok((Kkt::with_columns(weight, &rows.transpose(), &rows, kept)?, rows))
}

const CLOSING_STEPS: usize = 100;

/// The Newton steps of the assembly once more, as `assembly::close` makes them; none where the loops are drawn closed.
fn assembled(
    eq: &Equations<'_, f64>,
    first: &Instant,
    position: &[usize],
    weight: &DMatrix<f64>,
) -> Result<Vec<Closing>> {
    let scale = eq.row_scales();
    let mut m = Motion { q: drawn_start(eq.system), ..first.motion.clone() };
    let mut path = Vec::new();
    for _ in 0..CLOSING_STEPS {
        let (phi, all) = eq.rows(&m);
        let phi = DVector::from_fn(position.len(), |i, _| phi[position[i]]);
        let size = (0..phi.len()).map(|i| (phi[i] * scale[position[i]]).abs()).fold(0.0, f64::max);
        // the remainder is closed by the last step that all starts have in common
        if size <= CLOSED_ENOUGH {
            return Ok(path);
        }
        let by = closing_by(eq, weight, &all, position)?.0;
        let (dy, mu) = by.solve_one(&DVector::zeros(eq.n()), &-phi)?;
        let unit = eq.scales();
        let longest = dy.iter().zip(&unit).fold(0.0_f64, |s, (d, u)| s.max((d / u).abs()));
        if longest > 0.5 {
            return Err(Error::NotDifferentiable(
                "the loops are drawn so far open that the assembly shortened its steps, by which the assembled pose has no derivative                  here; draw the bodies closer to the assembled pose"
                    .into(),
            ));
        }
        advance(eq.topology(), &mut m.q, dy.as_slice());
        path.push(Closing { by, dy: dy.as_slice().to_vec(), mu: mu.as_slice().to_vec() });
    }
    Ok(path)
}
