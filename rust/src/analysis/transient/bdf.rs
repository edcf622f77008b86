//! Backward differences of orders one to five with variable steps, Newton with factorisations that are kept.
//!
//! The numerical differentiation formulas of L. Shampine and M. Reichelt, SIAM J. Sci. Comput. 18 (1997) 1-22: differences on a
//! grid of equal steps that are mapped when the step changes; with y = (theta, v), theta increments from the pose of a chart,
//! ```text
//! c theta' = psi + d,  theta' = J_l^-1(theta) v;    c a = psi_v + d_v;    M a + h(q, v, t) + J^T lam = 0,  J v + Phi_t = 0
//! ```
//! Newton corrects w = c dv and c^2 lam, so that nothing grows as the step falls. The pose turns by J_l(theta) dtheta =
//! J_l J_l^-1 c dv = w, whatever the chart: the matrix is [M + c D + c^2 K, J^T; J, 0] without J_l, and theta is solved for v. Positions are projected at the end of a step, and the
//! correction enters the differences (as in the projection of C. Lubich's and E. Eich's codes), so that histories stay consistent.
//! With fixed steps the order is four, and a run with small steps of its own gives the first four points.
use std::collections::VecDeque;

use crate::error::{Error, Result};
use crate::run::{Cancel, Counts};

use super::bdf_differences::{Pair, alpha, error_constant, gamma, stretched};
use super::driver::{Plan, Progress, Steps, drive};
use super::interpolate::quintic;
use super::methods::STIFF;
use super::rotations::rotation_triples;
use super::{Equations, Instant, LocalError, Motion, Scheme, Step, scaled_size};
use crate::linalg::kkt::Kkt;
use crate::tolerances::motion::{CORRECTION_ROUNDING, LEAST_MOTION, NEWTON_ITERATIONS, ROTATION_REPETITIONS, SAFETY};

const MOST: usize = 5;
const FIXED: usize = 4;
/// A kept factorisation serves steps within this part of its own.
const NEAR: f64 = 0.25;
/// A kept factorisation with which more iterations than these are to be expected is renewed.
const PATIENCE: f64 = 4.0;
/// Rotations of a chart beyond this (radians) call for a new one.
const WIDE: f64 = 1.0;
/// Tolerance of the run that starts fixed steps.
const START: f64 = 1e-11;

/// Where the differences count from, and the differences on a grid of steps h that ends at t.
struct History {
    t: f64,
    h: f64,
    chart: Motion<f64>,
    d: Vec<Pair>,
    equal: usize,
}

pub struct Bdf {
    order: usize,
    /// steps of one length and order: their errors have no tolerance that could choose
    fixed: bool,
    stiff: bool,
    /// of the whole run: what starts from rest is no slower than this
    time: f64,
    /// allowed remainder of Newton's method, in the units of the tolerance
    solved: f64,
    history: Option<History>,
    /// points of the start of fixed steps
    start: VecDeque<Instant>,
    points: Vec<Instant>,
    kept: Option<(f64, Kkt)>,
    tried: Option<Pair>,
}

struct Trial {
    motion: Motion<f64>,
    y: Vec<f64>,
}

impl Bdf {
    /// None: fixed steps.
    pub fn new(rtol: Option<f64>) -> Self {
        Bdf {
            order: 1,
            fixed: rtol.is_none(),
            stiff: false,
            time: f64::INFINITY,
            solved: rtol.map_or(1e-12, |r| 0.01 * r),
            history: None,
            start: VecDeque::new(),
            points: Vec::new(),
            kept: None,
            tried: None,
        }
    }

    /// Vibrations or decays far faster than the motion?
    fn look_for_stiffness(&mut self, eq: &Equations<'_, f64>, at: &Instant, counts: &mut Counts) -> Result<()> {
        if eq.topology().connectors.is_empty() {
            return Ok(());
        }
        let scales = eq.scales();
        let size = |v: &[f64]| scaled_size(v, &scales);
        let motion = size(&at.motion.rate).max(size(&at.acceleration).sqrt()).max(1.0 / self.time);
        self.stiff = eq.fastest(at, counts)?.most() > STIFF * motion;
        Ok(())
    }

    fn begin(&mut self, eq: &Equations<'_, f64>, from: &Instant, h: f64) {
        let n = from.motion.rate.len();
        let scaled = |v: &[f64]| v.iter().map(|x| x * h).collect();
        let mut d = vec![Pair::zero(n, eq.states(&from.motion).len()); MOST + 3];
        d[0].v.clone_from(&from.motion.rate);
        d[0].z = eq.states(&from.motion);
        let z = scaled(&eq.state_rates(&from.motion));
        d[1] = Pair { y: scaled(&from.motion.rate), v: scaled(&from.acceleration), z };
        self.order = 1;
        self.history = Some(History { t: from.motion.t, h, chart: from.motion.clone(), d, equal: 0 });
    }

    /// The first points of fixed steps, from a run with steps of its own.
    fn prepare(&mut self, eq: &Equations<'_, f64>, from: &Instant, h: f64, counts: &mut Counts) -> Result<()> {
        let times: Vec<f64> = (1..=FIXED).map(|k| from.motion.t + k as f64 * h).collect();
        let plan = Plan {
            end: times[FIXED - 1],
            steps: Steps::Controlled { rtol: START, first: None, longest: h },
            outputs: Some(times),
            breaks: Vec::new(),
            max_steps: 100_000,
        };
        let mut scheme = Bdf::new(Some(START));
        let run = drive(eq, &mut scheme, from.clone(), &plan, &Cancel::default(), &Progress::default(), counts)?;
        if run.outputs.len() < FIXED {
            return Err(Error::Convergence {
                message: "the first steps could not be made".into(),
                best: Vec::new(),
                residual: f64::NAN,
            });
        }
        self.points = vec![from.clone()];
        self.start = run.outputs.into_iter().map(|o| o.instant).collect();
        Ok(())
    }

    /// Differences of equally distant points, the last one first.
    fn collect(&mut self, eq: &Equations<'_, f64>, h: f64) {
        let points = std::mem::take(&mut self.points);
        let Some(last) = points.last() else { return };
        let n = eq.n();
        let mut row: Vec<Pair> = points
            .iter()
            .rev()
            .map(|p| Pair {
                y: eq.difference(&last.motion, &p.motion),
                v: p.motion.rate.clone(),
                z: eq.states(&p.motion),
            })
            .collect();
        let mut d = Vec::with_capacity(MOST + 3);
        while let Some(first) = row.first() {
            d.push(first.clone());
            row = row
                .windows(2)
                .map(|w| {
                    let mut next = w[0].clone();
                    next.add(&w[1], -1.0);
                    next
                })
                .collect();
        }
        d.resize(MOST + 3, Pair::zero(n, eq.states(&last.motion).len()));
        self.order = FIXED;
        self.history = Some(History { t: last.motion.t, h, chart: last.motion.clone(), d, equal: 0 });
    }

    /// Differences from now on count from the last pose; false if they did.
    fn recharts(&mut self, eq: &Equations<'_, f64>) -> bool {
        let order = self.order;
        let Some(history) = self.history.as_mut().filter(|h| eq.widest_rotation(&h.d[0].y) > 0.0) else {
            return false;
        };
        recharted(eq, history, order);
        history.equal = 0;
        true
    }

    #[allow(clippy::too_many_arguments)]
    fn solve(
        &mut self,
        eq: &Equations<'_, f64>,
        guess: &Pair,
        psi: &Pair,
        c: f64,
        from: &Instant,
        t: f64,
        counts: &mut Counts,
    ) -> Result<Trial> {
        let Some(chart) = self.history.as_ref().map(|h| h.chart.clone()) else {
            return Err(Error::singular("a multistep method without history"));
        };
        let scales = eq.scales();
        let size = |v: &[f64]| scaled_size(v, &scales);
        let n = eq.n();
        let speed = size(&guess.v).max(size(&from.motion.rate)).max(c * size(&from.acceleration)).max(LEAST_MOTION / c);
        let (mut v, mut y, mut lam) = (guess.v.clone(), guess.y.clone(), from.lam.clone());
        if self.kept.as_ref().is_some_and(|(kept, _)| (kept / c - 1.0).abs() > NEAR) {
            self.kept = None;
        }
        let known: Vec<f64> = guess.y.iter().zip(&psi.y).map(|(g, p)| g - p).collect();
        let base: Vec<f64> = guess.z.iter().zip(&psi.z).map(|(g, p)| g - p).collect();
        let at = |y: &[f64], v: &[f64]| {
            let mut m = chart.moved(eq.topology(), y);
            m.t = t;
            m.rate = v.to_vec();
            m.memory.clone_from(&from.motion.memory);
            eq.set_states(&mut m, &base, c);
            m
        };
        let mut last = f64::INFINITY;
        let mut fresh = false;
        for iteration in 1..=NEWTON_ITERATIONS {
            counts.add("iterations", 1);
            settle(eq, &known, c, &v, &mut y);
            let m = at(&y, &v);
            let a: Vec<f64> = (0..n).map(|i| (psi.v[i] + v[i] - guess.v[i]) / c).collect();
            let r = eq.residual(&m, &a, &lam, counts) * (c * c);
            let rates = eq.row_rates_sparse(&m) * c;
            if r.iter().chain(rates.iter()).any(|v| !v.is_finite()) {
                return Err(Error::Convergence {
                    message: format!("a force is not a number at t = {t:.9} s"),
                    best: Vec::new(),
                    residual: f64::NAN,
                });
            }
            if self.kept.is_none() {
                let (matrix, jacobian) = eq.iteration_matrices(&m, &a, &lam, (c, c * c), &Vec::new(), counts);
                self.kept = Some((c, Kkt::new(&matrix, &jacobian, &eq.rows, None)?));
                fresh = true;
            }
            let Some((_, saddle)) = &self.kept else { break };
            let (w, mu) = saddle.solve_one(&-r, &-rates)?;
            for (v, w) in v.iter_mut().zip(w.iter()) {
                *v += w / c;
            }
            for (l, d) in lam.iter_mut().zip(mu.iter()) {
                *l += d / (c * c);
            }
            let step = size(w.as_slice()).max(size(w.as_slice()) / (c * speed));
            let rate = step / last;
            let near = step <= 0.1 * self.solved
                || last.is_finite() && rate < 1.0 && step * rate / (1.0 - rate) <= self.solved;
            if near || last.is_finite() && fresh && rate > 0.3 && step < CORRECTION_ROUNDING {
                settle(eq, &known, c, &v, &mut y);
                return Ok(Trial { motion: at(&y, &v), y });
            }
            if last.is_finite() && rate > 2.0 && fresh {
                break;
            }
            if last.is_finite() && !fresh && iteration as f64 + expected(step, rate, self.solved) > PATIENCE {
                self.kept = None;
            }
            last = step;
        }
        self.kept = None;
        Err(Error::Convergence {
            message: format!("the equations of a step to t = {t:.9} s did not converge"),
            best: Vec::new(),
            residual: last,
        })
    }
}

impl Scheme for Bdf {
    fn order(&self) -> u32 {
        self.order as u32
    }

    fn power(&self) -> f64 {
        self.order as f64 + 1.0
    }

    fn step(
        &mut self,
        eq: &Equations<'_, f64>,
        from: &Instant,
        h: f64,
        estimate: bool,
        counts: &mut Counts,
    ) -> Result<Step> {
        if self.history.as_ref().is_none_or(|k| k.t != from.motion.t) {
            self.history = None;
            if estimate {
                self.look_for_stiffness(eq, from, counts)?;
                self.begin(eq, from, h);
            } else {
                if self.start.is_empty() && self.points.is_empty() {
                    self.prepare(eq, from, h, counts)?;
                }
                if let Some(end) = self.start.pop_front().filter(|p| p.motion.t <= from.motion.t + h * (1.0 + 1e-9)) {
                    self.points.push(end.clone());
                    return Ok(Step { end, error: None });
                }
                // the end came before the start was through
                if self.points.len() <= FIXED {
                    self.begin(eq, from, h);
                } else {
                    self.collect(eq, h);
                }
            }
        }
        let k = self.order;
        let Some(history) = self.history.as_mut() else {
            return Err(Error::singular("a multistep method without history"));
        };
        if (history.h / h - 1.0).abs() > 1e-12 {
            stretched(&mut history.d, k, h / history.h);
            history.h = h;
            history.equal = 0;
        }
        let (mut guess, psi) = history.ahead(k);
        let (c, t) = (h / alpha(k), from.motion.t + h);
        let trial = match self.solve(eq, &guess, &psi, c, from, t, counts) {
            // before a shorter step: the same one from the pose that it starts from
            Err(Error::Convergence { .. }) if self.recharts(eq) => {
                let (from_here, psi) = self.history.as_ref().map(|h| h.ahead(k)).unwrap_or((guess, psi));
                guess = from_here;
                self.solve(eq, &guess, &psi, c, from, t, counts)?
            }
            made => made?,
        };
        let end = eq.consistent(trial.motion.clone(), counts)?;
        if estimate {
            eq.same_branch(&trial.motion.rate, &end, h)?;
        }
        let projected = eq.increment_rates(&trial.y, &eq.difference(&trial.motion, &end.motion));
        let mut d = Pair { y: trial.y, v: end.motion.rate.clone(), z: eq.states(&end.motion) };
        for (y, p) in d.y.iter_mut().zip(projected) {
            *y += p;
        }
        d.add(&guess, -1.0);
        let error = estimate.then(|| d.error(error_constant(k)));
        self.tried = Some(d);
        Ok(Step { end, error })
    }

    fn accept(&mut self, eq: &Equations<'_, f64>, _from: &Instant, step: &Step, _h: f64) {
        let k = self.order;
        let (Some(history), Some(d)) = (self.history.as_mut(), self.tried.take()) else {
            return;
        };
        let mut above = d.clone();
        above.add(&history.d[k + 1], -1.0);
        history.d[k + 2] = above;
        history.d[k + 1] = d;
        for i in (0..=k).rev() {
            let next = history.d[i + 1].clone();
            history.d[i].add(&next, 1.0);
        }
        history.equal += 1;
        history.t = step.end.motion.t;
        if eq.widest_rotation(&history.d[0].y) > WIDE {
            recharted(eq, history, k + 2);
        }
    }

    fn over(&mut self, time: f64) {
        self.time = time;
    }

    /// In a stiff scene rates count by what they move within a step: fast vibrations that move little may be stepped over.
    fn rate_time(&self, h: f64) -> f64 {
        if self.stiff { h } else { f64::INFINITY }
    }

    /// In a stiff scene accelerations hold the vibration that steps go over: outputs then lie on the polynomial of the method.
    fn between(
        &mut self,
        eq: &Equations<'_, f64>,
        from: &Instant,
        step: &Step,
        h: f64,
        fractions: &[f64],
        _counts: &mut Counts,
    ) -> Result<Vec<Motion<f64>>> {
        let (Some(history), Some(last), true) = (&self.history, &self.tried, self.stiff) else {
            return Ok(quintic(eq, from, &step.end, h, fractions));
        };
        // differences as they will be at the end of the step
        let mut d = history.d[..=self.order].to_vec();
        let mut above = last.clone();
        for own in d.iter_mut().rev() {
            own.add(&above, 1.0);
            above.clone_from(own);
        }
        let at = |fraction: &f64| {
            let s = fraction - 1.0;
            let (mut sum, mut weight) = (Pair::zero(eq.n(), last.z.len()), 1.0);
            for (m, own) in d.iter().enumerate() {
                sum.add(own, weight);
                weight *= (s + m as f64) / (m as f64 + 1.0);
            }
            let mut motion = history.chart.moved(eq.topology(), &sum.y);
            motion.t = from.motion.t + fraction * h;
            motion.rate = sum.v;
            motion.memory.clone_from(&from.motion.memory);
            eq.set_states(&mut motion, &sum.z, 0.0);
            motion
        };
        Ok(fractions.iter().map(at).collect())
    }

    fn proposal(&mut self, size: &dyn Fn(&LocalError) -> f64) -> Option<f64> {
        if self.fixed {
            return None;
        }
        let k = self.order;
        let history = self.history.as_mut()?;
        if history.equal <= k {
            return Some(1.0);
        }
        let norm = |order: usize, m: usize| size(&history.d[m].error(error_constant(order))).max(1e-12);
        let factor = |order: usize| norm(order, order + 1).powf(-1.0 / (order as f64 + 1.0));
        let same = factor(k);
        let lower = if k > 1 { factor(k - 1) } else { 0.0 };
        let higher = if k < MOST { factor(k + 1) } else { 0.0 };
        let best = same.max(lower).max(higher);
        let mut chosen = k;
        if best == lower && k > 1 {
            chosen = k - 1;
        } else if best == higher && higher > same {
            chosen = k + 1;
        }
        let factor = (SAFETY * best).clamp(0.2, 10.0);
        // a new step costs a factorisation: only for a gain
        if chosen == k && (0.9..1.3).contains(&factor) {
            return Some(1.0);
        }
        self.order = chosen;
        Some(factor)
    }

    fn reset(&mut self) {
        self.history = None;
        self.kept = None;
        self.start.clear();
        self.points.clear();
    }
}

impl History {
    /// What the differences foresee for the next point, and what they add to its slope.
    fn ahead(&self, order: usize) -> (Pair, Pair) {
        let zero = Pair::zero(self.chart.rate.len(), self.d[0].z.len());
        let (mut guess, mut psi) = (zero.clone(), zero);
        for (m, d) in self.d.iter().enumerate().take(order + 1) {
            guess.add(d, 1.0);
            psi.add(d, gamma(m) / alpha(order));
        }
        (guess, psi)
    }
}

/// theta = known + c J_l^-1(theta) v.
fn settle(eq: &Equations<'_, f64>, known: &[f64], c: f64, v: &[f64], y: &mut Vec<f64>) {
    for _ in 0..ROTATION_REPETITIONS {
        let slope = eq.increment_rates(y, v);
        let next: Vec<f64> = known.iter().zip(&slope).map(|(k, s)| k + c * s).collect();
        let turns = |(a, b): (&f64, &f64)| (a - b).abs() > 2.0 * f64::EPSILON * a.abs().max(b.abs());
        let settled = !next.iter().zip(y.iter()).any(turns);
        *y = next;
        if settled {
            return;
        }
    }
}

/// Iterations until the remainder falls below the goal, corrections shrinking as they did.
fn expected(step: f64, rate: f64, goal: f64) -> f64 {
    if rate < 1.0 { ((goal * (1.0 - rate) / step).ln() / rate.ln()).ceil().max(1.0) } else { f64::INFINITY }
}

/// Past points counted from the pose of the last one.
fn recharted(eq: &Equations<'_, f64>, history: &mut History, order: usize) {
    let order = order.min(MOST + 1);
    // y_(n-j) = sum_m (-1)^m C(j, m) D_m
    let zero = Pair::zero(eq.n(), history.d[0].z.len());
    let point = |j: usize| {
        let mut sum = zero.clone();
        let mut binomial = 1.0;
        for (m, d) in history.d.iter().enumerate().take(j + 1) {
            sum.add(d, if m % 2 == 0 { binomial } else { -binomial });
            binomial *= (j - m) as f64 / (m as f64 + 1.0);
        }
        sum
    };
    let points: Vec<Pair> = (0..=order).map(point).collect();
    let motions: Vec<Motion<f64>> = points.iter().map(|p| history.chart.moved(eq.topology(), &p.y)).collect();
    let from_here = |(p, m): (&Pair, &Motion<f64>)| {
        let turned = eq.difference(&motions[0], m);
        // other coordinates than rotations that act together add up, hinges over turns too
        let mut y: Vec<f64> = p.y.iter().zip(&points[0].y).map(|(y, last)| y - last).collect();
        for (first, _) in rotation_triples(eq.topology()) {
            y[first..first + 3].copy_from_slice(&turned[first..first + 3]);
        }
        Pair { y, v: p.v.clone(), z: p.z.clone() }
    };
    let mut row: Vec<Pair> = points.iter().zip(&motions).map(from_here).collect();
    let mut k = 0;
    while let Some(first) = row.first() {
        history.d[k] = first.clone();
        k += 1;
        row = row
            .windows(2)
            .map(|w| {
                let mut next = w[0].clone();
                next.add(&w[1], -1.0);
                next
            })
            .collect();
    }
    let mut chart = history.chart.clone();
    chart.q.clone_from(&motions[0].q);
    history.chart = chart;
}
