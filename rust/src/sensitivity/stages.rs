//! Stages that are solved for, as equations to be differentiated: all of a step of Radau's method, or the one of a step of "bdf".
//!
//! ```text
//! theta_i = theta_0i + sum_j w_ij J_l^-1(theta_j) v_j,   v_i = v_0i + sum_j w_ij a_j,   z_i = z_0 + sum_j w_ij g_j,   q_i = exp(theta_i) q_0
//! r(q_i, v_i, a_i, z_i, lam_i) = 0,     J_i a_i + gamma_i = 0  or  J_i v_i + Phi_t = 0,     g_i = g(q_i, v_i, z_i)
//! ```
//! What is given is `Base`: the pose q_0 and theta_0, v_0, z_0 of all stages. Changes of all stages are solved for together, with the
//! tangents of every stage at its solution and nothing left out, so that one system serves all directions and, transposed, the way back:
//! ```text
//! d theta_i = sum_j (S_ij d theta_0j + T_ij dv_j),   S = (1 - w Y_theta)^-1,   T = S w Y_v      of three rotations; 1 and w elsewhere
//! dv_i = dv_0i + sum_j w_ij da_j
//! M_i da_i + D_i dv_i + K_i J_l d theta_i + F_i dz_i + J_i^T dlam_i = -(by the base and the numbers)
//! J_i da_i + (J a + gamma)_v dv_i + (J a + gamma)_q J_l d theta_i = -(by the base and the numbers)
//! ```
//! A scheme gives the weights w, the level of its rows, and its base by what it carries on. The end of a step is the last stage, moved
//! to the constraints (`closing`).
use nalgebra::DMatrix;

use crate::error::{Error, Result};
use crate::integrate::ali3p::Linear;
use crate::integrate::{Equations, Motion};
use crate::linalg::kkt::Kkt;
use crate::linalg::matrix::turn_columns;
use crate::multibody::rotations::{Maps, rotation_triples};
use crate::run::Counts;

use super::Direction;
use super::direct::chunk::{Chunk, Moving, WIDEST, chunk};
use super::direct::explicit::Held;
use super::march::Rule;
use super::runge_kutta::{Stages, slope_maps};

/// On which level the rows of a stage hold.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Rows {
    Rates,
    Accelerations,
}

/// What stages are solved from, by all directions: the pose that increments count from, increments and rates of each stage, memories.
pub struct Base {
    pub x: DMatrix<f64>,
    pub theta: Vec<DMatrix<f64>>,
    pub v: Vec<DMatrix<f64>>,
    pub z: DMatrix<f64>,
}

/// Three rotations that act together: their part of S, of T and of T w, over all stages.
struct Turning {
    first: usize,
    base: DMatrix<f64>,
    rates: DMatrix<f64>,
    accelerations: DMatrix<f64>,
}

/// How increments and rates of the stages follow from rates and accelerations.
pub struct Chart {
    /// w, and its square
    pub weights: DMatrix<f64>,
    square: DMatrix<f64>,
    turning: Vec<Turning>,
}

impl Chart {
    fn new(eq: &Equations<'_, f64>, weights: DMatrix<f64>, by: &Stages) -> Result<Self> {
        let maps: Vec<[Maps; 2]> =
            by.all.iter().map(|own| slope_maps(eq, &own.increment, &own.at.motion.rate)).collect();
        let triples = rotation_triples(eq.topology()).enumerate();
        let turning = triples.map(|(k, (first, _))| Turning::new(&weights, first, &maps, k)).collect::<Result<_>>()?;
        Ok(Chart { square: &weights * &weights, weights, turning })
    }

    fn stages(&self) -> usize {
        self.weights.nrows()
    }

    /// Sums over the stages: w x.
    pub fn sums(&self, x: &[DMatrix<f64>]) -> Vec<DMatrix<f64>> {
        sums(&self.weights, x)
    }

    /// Sums over the stages backwards: w^T x.
    pub fn sums_back(&self, x: &[DMatrix<f64>]) -> Vec<DMatrix<f64>> {
        sums(&self.weights.transpose(), x)
    }

    /// Changes of theta_i by those of theta_0 and of the rates of all stages.
    pub fn increments(&self, theta: &[DMatrix<f64>], v: &[DMatrix<f64>]) -> Vec<DMatrix<f64>> {
        let mut out = self.sums(v);
        out.iter_mut().zip(theta).for_each(|(o, t)| *o += t);
        for t in &self.turning {
            let rows = turned(&t.rates, t.first, v).into_iter().zip(turned(&t.base, t.first, theta));
            out.iter_mut().zip(rows).for_each(|(o, (a, b))| o.rows_mut(t.first, 3).copy_from(&(a + b)));
        }
        out
    }

    /// The same backwards: of theta_0, and of the rates.
    pub fn increments_back(&self, theta: &[DMatrix<f64>]) -> [Vec<DMatrix<f64>>; 2] {
        let mut out = [theta.to_vec(), self.sums_back(theta)];
        for t in &self.turning {
            for (out, map) in out.iter_mut().zip([&t.base, &t.rates]) {
                let rows = turned(&map.transpose(), t.first, theta);
                out.iter_mut().zip(rows).for_each(|(o, r)| o.rows_mut(t.first, 3).copy_from(&r));
            }
        }
        out
    }

    /// What accelerations of stage j do to rates and increments of stage i: by rates, by increments.
    fn block(&self, by_v: &DMatrix<f64>, by_theta: &DMatrix<f64>, i: usize, j: usize) -> DMatrix<f64> {
        let mut out = by_theta * self.square[(i, j)];
        for t in &self.turning {
            let map = t.accelerations.fixed_view::<3, 3>(3 * i, 3 * j);
            out.columns_mut(t.first, 3).copy_from(&(by_theta.columns(t.first, 3) * map));
        }
        out + by_v * self.weights[(i, j)]
    }
}

impl Turning {
    fn new(weights: &DMatrix<f64>, first: usize, maps: &[[Maps; 2]], k: usize) -> Result<Self> {
        let s = weights.nrows();
        let part = |which: usize| {
            DMatrix::from_fn(3 * s, 3 * s, |r, c| weights[(r / 3, c / 3)] * maps[c / 3][which][k].1[r % 3][c % 3])
        };
        let own = DMatrix::identity(3 * s, 3 * s) - part(0);
        let base = own.try_inverse().ok_or_else(|| Error::singular("rotations of a step have no chart"))?;
        let rates = &base * part(1);
        let spread = DMatrix::from_fn(3 * s, 3 * s, |r, c| if r % 3 == c % 3 { weights[(r / 3, c / 3)] } else { 0.0 });
        Ok(Turning { first, base, accelerations: &rates * spread, rates })
    }
}

/// Sums with the weights of each row.
pub fn sums(weights: &DMatrix<f64>, x: &[DMatrix<f64>]) -> Vec<DMatrix<f64>> {
    let one = |i: usize| {
        let mut sum = &x[0] * weights[(i, 0)];
        for (j, x) in x.iter().enumerate().skip(1).filter(|(j, _)| weights[(i, *j)] != 0.0) {
            sum.zip_apply(x, |s, x| *s += weights[(i, j)] * x);
        }
        sum
    };
    (0..weights.nrows()).map(one).collect()
}

/// Three rows of all stages by those of other stages.
fn turned(map: &DMatrix<f64>, first: usize, from: &[DMatrix<f64>]) -> Vec<DMatrix<f64>> {
    let row = |i: usize| {
        let mut rows = DMatrix::zeros(3, from[0].ncols());
        for (j, from) in from.iter().enumerate() {
            rows += map.fixed_view::<3, 3>(3 * i, 3 * j) * from.rows(first, 3);
        }
        rows
    };
    (0..from.len()).map(row).collect()
}

/// Derivatives by increments, rates and states of laws, all of them: what tangents do not hold.
pub struct Probe<'a> {
    eq: &'a Equations<'a, f64>,
    chunks: Vec<Box<dyn Chunk + 'a>>,
    pub rows: Rows,
    /// places in the memory of states of laws that are solved for
    pub states: Vec<usize>,
}

/// What finds the derivatives of stages: of Radau's method, of "bdf".
pub struct Probes<'a> {
    pub radau: Option<Probe<'a>>,
    pub bdf: Option<Probe<'a>>,
}

impl<'a> Probes<'a> {
    pub fn of(eq: &'a Equations<'a, f64>, rule: Rule) -> Self {
        let bdf = matches!(rule, Rule::Bdf);
        Probes {
            radau: (bdf || matches!(rule, Rule::Radau)).then(|| Probe::new(eq, Rows::Accelerations)),
            bdf: bdf.then(|| Probe::new(eq, Rows::Rates)),
        }
    }
}

/// Places in the memory of states of laws.
pub fn places_of_states(eq: &Equations<'_, f64>) -> Vec<usize> {
    let places = eq.state_scales();
    (0..places.len()).filter(|i| places[*i].is_finite()).collect()
}

/// What a stage adds to the system.
struct Parts {
    linear: Linear,
    /// of the rows, by increments and rates
    rows: [DMatrix<f64>; 2],
    /// forces by states, and rates of states by increments, rates and states
    by_states: DMatrix<f64>,
    states: [DMatrix<f64>; 3],
}

impl<'a> Probe<'a> {
    /// Stages with rows on the level of rates know the states of their laws by the tangents.
    pub fn new(eq: &'a Equations<'a, f64>, rows: Rows) -> Self {
        let states = if rows == Rows::Accelerations { places_of_states(eq) } else { Vec::new() };
        let wanted = match rows {
            Rows::Accelerations if eq.n_rows() > 0 || !states.is_empty() => 2 * eq.n() + states.len(),
            Rows::Rates if eq.n_rows() > 0 => eq.n(),
            _ => 0,
        };
        let still = Direction::new();
        let part = |first: usize| {
            let width = WIDEST.min(wanted - first);
            chunk(eq.system, eq.effects, &vec![&still; width], first, false)
        };
        Probe { eq, chunks: (0..wanted).step_by(WIDEST).map(part).collect(), rows, states }
    }

    fn parts(&self, m: &Motion<f64>, a: &[f64], lam: &[f64], counts: &mut Counts) -> Parts {
        let eq = self.eq;
        let (n, k, rows, memory) = (eq.n(), self.states.len(), eq.n_rows(), m.memory.len());
        let width = 2 * n + k;
        let one = |at: bool| if at { 1.0 } else { 0.0 };
        let x = DMatrix::from_fn(n, width, |i, j| one(i == j));
        let v = DMatrix::from_fn(n, width, |i, j| one(n + i == j));
        let z = DMatrix::from_fn(memory, width, |i, j| one(j >= 2 * n && self.states[j - 2 * n] == i));
        let at = Moving { motion: m, x: &x, v: &v, z: &z };
        let (mut by_rows, mut force) = (DMatrix::zeros(rows, width), DMatrix::zeros(n, width));
        let mut rates = DMatrix::zeros(memory, width);
        let rest = DMatrix::zeros(n, width);
        for chunk in &self.chunks {
            match self.rows {
                Rows::Accelerations if rows > 0 => chunk.row_accelerations(at, (a, &rest), false, &mut by_rows),
                Rows::Rates if rows > 0 => chunk.row_rates(at, &mut by_rows),
                _ => {}
            }
            if k > 0 {
                chunk.explicit(&Held::new(eq, m, a, lam), &z, &mut force, counts);
                chunk.state_rates(at, &mut rates);
            }
        }
        let own = |c: usize, w: usize| DMatrix::from_fn(k, w, |p, j| rates[(self.states[p], c + j)]);
        let linear = eq.tangents_of(m, a, lam, counts);
        let by_rates = match self.rows {
            Rows::Accelerations => by_rows.columns(n, n).into_owned(),
            Rows::Rates => linear.jacobian.clone(),
        };
        Parts {
            rows: [by_rows.columns(0, n).into_owned(), by_rates],
            linear,
            by_states: force.columns(2 * n, k).into_owned(),
            states: [own(0, n), own(n, n), own(2 * n, k)],
        }
    }
}

/// The equations of all stages at their solution.
pub struct Coupled {
    pub chart: Chart,
    pub linear: Vec<Linear>,
    /// unknowns: accelerations of all stages, then changes of states beyond those at the start; multipliers of all stages
    pub system: Kkt,
    /// what equations of rows are divided by: rows of rates follow from accelerations by the length of the step
    pub rows_by: f64,
}

impl Coupled {
    pub fn new(probe: &Probe<'_>, weights: DMatrix<f64>, by: &Stages, counts: &mut Counts) -> Result<Self> {
        let eq = probe.eq;
        let chart = Chart::new(eq, weights, by)?;
        let part = |i: usize, counts: &mut Counts| {
            let at = &by.all[i].at;
            probe.parts(&at.motion, &at.acceleration, &at.lam, counts)
        };
        let parts: Vec<Parts> = (0..chart.stages()).map(|i| part(i, counts)).collect();
        let maps: Vec<Maps> = by.all.iter().map(|own| eq.rotation_maps(&own.increment)).collect();
        counts.add("factorisations", 1);
        let rows_by = if probe.rows == Rows::Rates { chart.weights[(0, 0)] } else { 1.0 };
        let system = assembled(eq, (probe.rows, rows_by), &chart, &parts, &maps)?;
        Ok(Coupled { chart, linear: parts.into_iter().map(|p| p.linear).collect(), system, rows_by })
    }
}

fn assembled(
    eq: &Equations<'_, f64>,
    (level, rows_by): (Rows, f64),
    chart: &Chart,
    parts: &[Parts],
    maps: &[Maps],
) -> Result<Kkt> {
    let (s, n, rows) = (chart.stages(), eq.n(), eq.n_rows());
    let k = parts[0].by_states.ncols();
    let mut a = DMatrix::zeros(s * (n + k), s * (n + k));
    let mut left = DMatrix::zeros(s * (n + k), s * rows);
    let mut right = DMatrix::zeros(s * rows, s * (n + k));
    let mut kept = Vec::new();
    for (i, own) in parts.iter().enumerate() {
        let (t, jacobian) = (&own.linear.tangent, &own.linear.jacobian);
        let turned = |m: &DMatrix<f64>| {
            let mut m = m.clone();
            turn_columns(&mut m, &maps[i]);
            m
        };
        let mut damping = DMatrix::zeros(n, n);
        [&t.damping, &t.gyroscopic].into_iter().flatten().for_each(|d| damping += d);
        let (stiffness, row_stiffness) = (turned(&t.stiffness), turned(&own.rows[0]));
        let slope = turned(&own.states[0]);
        for j in 0..s {
            a.view_mut((i * n, j * n), (n, n)).copy_from(&chart.block(&damping, &stiffness, i, j));
            let by_row = chart.block(&own.rows[1], &row_stiffness, i, j) / rows_by;
            right.view_mut((i * rows, j * n), (rows, n)).copy_from(&by_row);
            // the rates of states at stage i are summed up in all stages
            let moved = chart.block(&own.states[1], &slope, i, j);
            for l in 0..s {
                let mut to = a.view_mut((s * n + l * k, j * n), (k, n));
                to -= &moved * chart.weights[(l, i)];
            }
            let mut to = a.view_mut((s * n + j * k, s * n + i * k), (k, k));
            to -= &own.states[2] * chart.weights[(j, i)];
        }
        let mut to = a.view_mut((i * n, i * n), (n, n));
        to += &t.mass;
        let mut to = a.view_mut((s * n + i * k, s * n + i * k), (k, k));
        to += DMatrix::<f64>::identity(k, k);
        a.view_mut((i * n, s * n + i * k), (n, k)).copy_from(&own.by_states);
        if level == Rows::Accelerations {
            let mut to = right.view_mut((i * rows, i * n), (rows, n));
            to += jacobian;
        }
        left.view_mut((i * n, i * rows), (n, rows)).copy_from(&jacobian.transpose());
        let acting = eq.rows.select_dense(jacobian, crate::linalg::rows::Level::All);
        kept.extend(acting.into_iter().map(|r| i * rows + r));
    }
    Kkt::with_columns(&a, &left, &right, kept)
}
