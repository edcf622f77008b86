//! A step of "bdf" as equations to be differentiated: one stage (`stages`) whose base is made of the history, which every step moves on.
//!
//! ```text
//! D <- S D        on a grid with steps of this length, S by R. U of Shampine and Reichelt
//! theta_0, v_0, z_0 = sum_m (1 - gamma_m/alpha) D_m,  m = 0 .. k;    w = c = h/alpha;    rows J v + Phi_t = 0
//! D_i <- Y - sum_(m<i) D_m,  i = 0 .. k + 2                          Y: increments, rates and states at the end
//! ```
//! Increments D_m^y count from the pose of a chart. A new chart, and the points that begin a history, are poses seen from the last of
//! them: y = log(q_j q_0^-1). Orders, lengths and charts are those of the motion.
use nalgebra::DMatrix;

use crate::integrate::bdf::FIXED;
use crate::integrate::bdf::MOST;
use crate::integrate::bdf::differences::{Formula, gamma, stretching};
use crate::integrate::bdf::record::{Kind, Recorded};

use super::direct::slopes::Slopes;
use super::march::Quadrature;
use super::stages::sums;

/// Differences that a history holds.
pub const HELD: usize = MOST + 3;

/// Changes of a history along directions, or its adjoints in one column.
#[derive(Clone)]
pub struct Past {
    /// of the pose of the chart
    pub x: DMatrix<f64>,
    /// differences of increments, rates and states
    pub d: [Vec<DMatrix<f64>>; 3],
    /// of the points that are to begin a history, the last one last
    pub points: Vec<Slopes>,
}

impl Past {
    pub fn none(n: usize, memory: usize, columns: usize) -> Self {
        let all = |rows: usize| vec![DMatrix::zeros(rows, columns); HELD];
        Past { x: DMatrix::zeros(n, columns), d: [all(n), all(n), all(memory)], points: Vec::new() }
    }

    /// All differences by the first of others.
    pub fn map(&mut self, weights: &DMatrix<f64>) {
        for d in &mut self.d {
            *d = sums(weights, d);
        }
    }
}

/// What a step makes of the differences.
pub struct Formulas {
    pub stretch: DMatrix<f64>,
    /// what the base weighs them by
    pub base: DMatrix<f64>,
    /// differences at the end by those at the start and by the end
    pub next: DMatrix<f64>,
    pub new: DMatrix<f64>,
}

impl Formulas {
    pub fn of(step: &Recorded) -> Self {
        Formulas::new(step.order, step.stretch)
    }

    /// With an order, on a grid with steps longer by `factor`.
    fn new(k: usize, factor: f64) -> Self {
        let identity = DMatrix::<f64>::identity(HELD, HELD);
        let mut stretch = identity.clone();
        if factor != 1.0 {
            stretch.view_mut((0, 0), (k + 1, k + 1)).copy_from(&stretching(k, factor));
        }
        let alpha = Formula::NDF.alpha(k);
        let (mut next, mut new) = (identity, DMatrix::zeros(HELD, 1));
        for i in 0..=k + 2 {
            next.row_mut(i).fill(0.0);
            next.view_mut((i, 0), (1, i)).fill(-1.0);
            new[i] = 1.0;
        }
        let base = DMatrix::from_fn(1, HELD, |_, m| if m <= k { 1.0 - gamma(m) / alpha } else { 0.0 });
        Formulas { stretch, base, next, new }
    }
}

/// Differences of points, the last one first, and points by differences: the same sums.
pub fn binomials(points: usize) -> DMatrix<f64> {
    let mut out = DMatrix::zeros(points, points);
    for i in 0..points {
        let mut binomial = 1.0;
        for j in 0..=i {
            out[(i, j)] = if j % 2 == 0 { binomial } else { -binomial };
            binomial *= (i - j) as f64 / (j as f64 + 1.0);
        }
    }
    out
}

/// The differences that begin a history by its points, the last one first.
pub fn collected(points: usize) -> DMatrix<f64> {
    let mut out = DMatrix::zeros(HELD, points);
    out.view_mut((0, 0), (points, points)).copy_from(&binomials(points));
    out
}

/// What an integral counts of all ends of steps, then of the nodes inside the first ones: those of a further state of the motion, by
/// the way backwards through its history.
pub fn weights(times: &[f64], kinds: &[Kind], start: &Quadrature) -> Vec<f64> {
    let (n, inner) = (kinds.len(), start.inner.len());
    let mut out = vec![0.0; n + 1 + n * inner];
    let step = |i: usize| times[i + 1] - times[i];
    // of the state itself, of a history at the end of a step, and of points before it
    let (mut own, mut d, mut points) = (1.0, DMatrix::zeros(HELD, 1), Vec::new());
    for (i, kind) in kinds.iter().enumerate().rev() {
        let h = step(i);
        let order = match kind {
            Kind::Start => {
                for (k, (_, weight)) in start.inner.iter().enumerate() {
                    out[n + 1 + i * inner + k] = own * weight * h;
                }
                own += points.pop().unwrap_or(0.0);
                continue;
            }
            Kind::Rates => 1,
            Kind::Points => FIXED,
            Kind::Goes(order) => *order,
        };
        let factor = if let Kind::Goes(_) = kind { h / step(i - 1) } else { 1.0 };
        let formulas = Formulas::new(order, factor);
        d[0] += own;
        own = 0.0;
        let new = (formulas.new.transpose() * &d)[0];
        out[i + 1] += new * h / Formula::NDF.alpha(order);
        d = formulas.stretch.transpose() * (formulas.next.transpose() * &d + formulas.base.transpose() * new);
        match kind {
            Kind::Rates => {
                own = d[0];
                out[i] += d[1] * h;
                d.fill(0.0);
            }
            Kind::Points => {
                let back = collected(FIXED + 1).transpose() * &d;
                points = back.iter().rev().copied().collect();
                own = points.pop().unwrap_or(0.0);
                d.fill(0.0);
            }
            _ => {}
        }
    }
    out
}
