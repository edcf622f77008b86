//! Backward differences with variable steps of orders one to five, or of order four with fixed steps.
//!
//! The numerical differentiation formulas of L. Shampine and M. Reichelt, SIAM J. Sci. Comput. 18 (1997) 1-22: differences on a
//! grid of equal steps that are mapped when the step changes; with y = (theta, v), theta increments from the pose of a chart,
//! ```text
//! c theta' = psi + d,  theta' = J_l^-1(theta) v;    c a = psi_v + d_v;    M a + h(q, v, t) + J^T lam = 0,  J v + Phi_t = 0
//! ```
//! A `Corrector` solves these equations: `newton` for w = c dv and c^2 lam, so that nothing grows as the step falls (the pose turns by
//! J_l(theta) dtheta = J_l J_l^-1 c dv = w, whatever the chart: the matrix is [M + c D + c^2 K, J^T; J, 0] without J_l, and theta is
//! solved for v), or `inverse` without any tangent. Positions are projected at the end of a step, and the correction enters the
//! differences (as in the projection of C. Lubich's and E. Eich's codes), so that histories stay consistent.
//! How the history begins: `begin`.
mod begin;
pub mod differences;
pub mod equations;
mod inverse;
mod inverse_updates;
mod newton;
pub mod record;
mod start;

use crate::error::{Error, Result};
use crate::run::Counts;
use crate::solve::inverse::Family;
use crate::tolerances::motion::SAFETY;

use super::interpolate::quintic;
use super::kept::Parts;
use super::radau::{FIVE, Radau};
use super::refine::{Between, Ends, TWO, refined};
use super::{Equations, Instant, LocalError, Motion, Scheme, Step};
use crate::multibody::rotations::rotation_triples;
use begin::{Begin, OneStep};
use differences::{Formula, Pair, backward_differences, gamma, stretched};
use equations::Form;
use inverse::Inverse;
use newton::Newton;
use record::{Kind, Recharted, Recorded};
use start::Start;

pub const MOST: usize = 5;
pub const FIXED: usize = 4;
/// Rotations of a chart beyond this (radians) call for a new one.
const WIDE: f64 = 1.0;
/// A step shorter than this part of the last one leaves its points behind, where the corrector holds shares of the tolerance.
const WIDEST: f64 = 1.6;
/// Fixed steps longer by this factor than the last one, which was divided, foresee nothing from it but its rates.
pub const LONGER: f64 = 2.0;
/// The least order that holds shares of the tolerance: below it the error of a unit of time hardly falls with the step.
const LEAST_OF_SHARES: usize = 3;

/// Where the differences count from, and the differences on a grid of steps h that ends at t.
#[derive(Clone)]
struct History {
    t: f64,
    h: f64,
    chart: Motion<f64>,
    d: Vec<Pair>,
    equal: usize,
    /// length of the last step that was made
    made: f64,
}

/// A new point as the equations of its step see it: c theta' = psi + d and c a = psi_v + d_v, d being what it lies beyond `guess`.
struct Ahead<'a> {
    chart: &'a Motion<f64>,
    from: &'a Instant,
    /// increments of the last point from the chart
    last: &'a [f64],
    guess: Pair,
    psi: Pair,
    /// the difference that the error of the last step is a multiple of, and the factor, where that step was as long as this one
    error: Option<(&'a Pair, f64)>,
    h: f64,
    c: f64,
    t: f64,
    /// of the whole run
    time: f64,
}

impl Ahead<'_> {
    /// z0 of the states of laws: z = z0 + c z'.
    fn state_base(&self) -> Vec<f64> {
        self.guess.z.iter().zip(&self.psi.z).map(|(g, p)| g - p).collect()
    }
}

/// What solves the equations of a step.
trait Corrector {
    fn solve(&mut self, eq: &Equations<'_, f64>, ahead: &Ahead<'_>, counts: &mut Counts) -> Result<Trial>;

    /// The tolerance is that of the whole motion, of which each step has its share.
    fn per_unit_step(&self) -> bool {
        false
    }

    /// What it leaves of constraint rows.
    fn rounding(&self) -> f64 {
        f64::EPSILON
    }

    /// Rotations of a chart (radians) beyond which the next step gets one of its own.
    fn widest_chart(&self) -> f64 {
        WIDE
    }

    /// Something jumped.
    fn reset(&mut self);

    fn remark(&self) -> Option<String> {
        None
    }
}

struct Trial {
    motion: Motion<f64>,
    /// increments from the chart
    y: Vec<f64>,
    /// multipliers of all rows
    lam: Vec<f64>,
    /// what differences may show of the remainder of the equations
    unsolved: Option<LocalError>,
}

pub struct Bdf {
    corrector: Box<dyn Corrector>,
    formula: Formula,
    order: usize,
    /// steps of one length and order: their errors have no tolerance that could choose
    fixed: bool,
    /// vibrations or decays are much faster than the motion; looked for once
    stiff: Option<bool>,
    /// of the whole run: what starts from rest is no slower than this
    time: f64,
    history: Option<History>,
    begin: Begin,
    /// points of equal first steps
    points: Vec<Instant>,
    /// length of the last step with a history
    usual: f64,
    tried: Option<Pair>,
    /// what differences may show of the remainder of the equations of the last step
    unsolved: Option<LocalError>,
    /// how the next step comes about, where that was chosen before
    script: Option<Kind>,
    /// of the last step, where it is asked for
    record: Option<Recorded>,
    /// of every step
    keeps: bool,
    /// the last step began a history at order one
    begun: bool,
}

impl Bdf {
    /// With Newton's method; without a tolerance, fixed steps.
    pub fn newton(rtol: Option<f64>) -> Self {
        let begin = match rtol {
            Some(_) => Begin::OneStep(OneStep::stiff(rtol)),
            None => Begin::Radau(Box::new(Radau::new(&FIVE, None))),
        };
        Bdf::with(Box::new(Newton::new(rtol)), Formula::NDF, begin, rtol.is_none())
    }

    /// With inverse quasi-Newton updates; fixed steps take the backward differentiation formula itself.
    pub fn inverse(form: Form, family: Option<Family>, rtol: Option<f64>) -> Self {
        let formula = if rtol.is_none() { Formula::BDF } else { Formula::NDF };
        let begin = Begin::Parts(Start::new(rtol));
        Bdf::with(Box::new(Inverse::new(form, family, rtol)), formula, begin, rtol.is_none())
    }

    fn with(corrector: Box<dyn Corrector>, formula: Formula, begin: Begin, fixed: bool) -> Self {
        Bdf {
            corrector,
            formula,
            order: if matches!(begin, Begin::Rates) { 1 } else { FIXED },
            begin,
            fixed,
            stiff: None,
            time: f64::INFINITY,
            history: None,
            points: Vec::new(),
            usual: 0.0,
            tried: None,
            unsolved: None,
            script: None,
            record: None,
            keeps: false,
            begun: false,
        }
    }

    /// Values between old points keep the slope error of their steps however short the new one is: a share of the tolerance in
    /// each unit of time then calls for new points.
    fn too_coarse(&self, history: &History, h: f64) -> bool {
        self.per_unit_step() && history.made > WIDEST * h
    }

    /// The error of the formula of an order that a difference shows beyond what the equations leave unsolved.
    fn shown(&self, difference: &Pair, order: usize) -> LocalError {
        let mut error = difference.error(self.formula.error_constant(order));
        if let Some(unsolved) = &self.unsolved {
            error.lessen(unsolved);
        }
        error
    }

    /// Power of the step in the controlled error of a formula.
    fn power_of(&self, order: usize) -> f64 {
        order as f64 + if self.corrector.per_unit_step() { 0.0 } else { 1.0 }
    }

    /// The point a step ahead, and what was foreseen of it.
    fn solved(&mut self, eq: &Equations<'_, f64>, from: &Instant, counts: &mut Counts) -> Result<(Trial, Pair)> {
        let Some(history) = &self.history else {
            return Err(Error::singular("a multistep method without history"));
        };
        let (guess, psi) = history.ahead(&self.formula, self.order);
        let (h, c) = (history.h, history.h / self.formula.alpha(self.order));
        let (chart, last) = (&history.chart, &history.d[0].y);
        let error = (history.equal > 0).then(|| (&history.d[self.order + 1], self.formula.error_constant(self.order)));
        let (t, time) = (from.motion.t + h, self.time);
        let ahead = Ahead { chart, from, last, guess, psi, error, h, c, t, time };
        let trial = self.corrector.solve(eq, &ahead, counts)?;
        if let Some(record) = &mut self.record {
            let slopes = ahead.psi.v.iter().zip(&ahead.guess.v).zip(&trial.motion.rate);
            let acceleration = slopes.map(|((p, g), v)| (p + v - g) / c).collect();
            record.solved(self.order, c, &trial, acceleration);
        }
        Ok((trial, ahead.guess))
    }
}

impl Scheme for Bdf {
    fn order(&self) -> u32 {
        self.order as u32
    }

    fn power(&self) -> f64 {
        match &self.begin {
            Begin::OneStep(start) if self.history.is_none() => start.power(),
            _ => self.power_of(self.order),
        }
    }

    fn rounding(&self) -> f64 {
        self.corrector.rounding()
    }

    /// First steps hold a part of the tolerance in each of their parts.
    fn per_unit_step(&self) -> bool {
        self.corrector.per_unit_step() && self.history.is_some()
    }

    fn step(
        &mut self,
        eq: &Equations<'_, f64>,
        from: &Instant,
        h: f64,
        estimate: bool,
        counts: &mut Counts,
    ) -> Result<Step> {
        if let Some(kind) = self.script {
            if let Some(step) = self.follow(eq, from, h, kind, counts)? {
                return Ok(step);
            }
        } else if self.history.as_ref().is_none_or(|k| k.t != from.motion.t || self.too_coarse(k, h)) {
            self.history = None;
            if let Some(step) = self.begins(eq, from, h, estimate, counts)? {
                return Ok(step);
            }
        }
        self.keep_next();
        let Some(history) = self.history.as_mut() else {
            return Err(Error::singular("a multistep method without history"));
        };
        if self.fixed && h > LONGER * history.h {
            // behind a step that was divided: the order climbs again
            self.order = 1;
        }
        let k = self.order;
        if history.h != h {
            stretched(&mut history.d, k, h / history.h);
            // rates that begin a history have no grid yet
            if let Some(record) = self.record.as_mut().filter(|_| !self.begun) {
                record.stretch *= h / history.h;
            }
            history.h = h;
            history.equal = 0;
        }
        let (trial, guess) = match self.solved(eq, from, counts) {
            // before a shorter step: the same one from the pose that it starts from
            Err(Error::Convergence { .. }) if self.recharts(eq) => self.solved(eq, from, counts)?,
            made => made?,
        };
        let end = eq.consistent(trial.motion.clone(), counts)?;
        if estimate {
            eq.same_branch(&trial.motion.rate, &end, h)?;
        }
        let projected = eq.increment_rates(&trial.y, &eq.difference(&trial.motion, &end.motion));
        let mut d = Pair { y: trial.y.clone(), v: end.motion.rate.clone(), z: eq.states(&end.motion) };
        for (y, p) in d.y.iter_mut().zip(projected) {
            *y += p;
        }
        d.add(&guess, -1.0);
        let error = estimate.then(|| {
            self.unsolved.clone_from(&trial.unsolved);
            self.shown(&d, k)
        });
        self.tried = Some(d);
        Ok(Step { end, error })
    }

    fn accept(&mut self, eq: &Equations<'_, f64>, from: &Instant, step: &Step, h: f64) {
        let k = self.order;
        let (Some(history), Some(d)) = (self.history.as_mut(), self.tried.take()) else {
            self.begun_by(eq, from, step, h);
            return;
        };
        self.begun = false;
        let mut above = d.clone();
        above.add(&history.d[k + 1], -1.0);
        history.d[k + 2] = above;
        history.d[k + 1] = d;
        for i in (0..=k).rev() {
            let next = history.d[i + 1].clone();
            history.d[i].add(&next, 1.0);
        }
        history.equal += 1;
        if self.fixed && self.order < FIXED {
            self.order += 1;
        }
        history.made = history.h;
        self.usual = history.h;
        history.t = step.end.motion.t;
        if eq.widest_rotation(&history.d[0].y) > self.corrector.widest_chart() {
            let turned = recharted(eq, history, k + 2);
            if let Some(record) = &mut self.record {
                record.after = Some(turned);
            }
        }
    }

    fn formula(&self) -> i32 {
        match (&self.history, self.begun) {
            (None, _) => record::START,
            (Some(_), true) => record::RATES,
            (Some(_), false) => self.order as i32,
        }
    }

    fn over(&mut self, time: f64) {
        self.time = time;
        if let Begin::OneStep(start) = &mut self.begin {
            start.scheme.over(time);
        }
    }

    /// In a stiff scene rates count by what they move within a step: fast vibrations that move little may be stepped over.
    fn rate_time(&self, h: f64) -> f64 {
        if self.stiff == Some(true) { h } else { f64::INFINITY }
    }

    fn outputs(
        &mut self,
        eq: &Equations<'_, f64>,
        from: &Instant,
        step: &Step,
        h: f64,
        fractions: &[f64],
        counts: &mut Counts,
    ) -> Result<Vec<Between>> {
        if let (None, Begin::OneStep(start)) = (&self.history, &mut self.begin) {
            return start.scheme.outputs(eq, from, step, h, fractions, counts);
        }
        if self.history.is_some() && self.stiff != Some(true) {
            let motions = quintic(eq, from, &step.end, h, TWO.nodes);
            let theta = eq.difference(&from.motion, &step.end.motion);
            let accelerations = (&*from.acceleration, &*step.end.acceleration);
            let ends = Ends { from: &from.motion, to: &step.end.motion, h, theta: &theta, accelerations };
            return refined(eq, &ends, (&TWO, &motions), fractions, counts);
        }
        Ok(self.between(eq, from, step, h, fractions, counts)?.into_iter().map(Between::from).collect())
    }

    fn misfit(&self, h: f64, difference: &[f64], filtered: bool) -> Result<Option<LocalError>> {
        match (&self.history, &self.begin) {
            (None, Begin::OneStep(start)) => start.scheme.misfit(h, difference, filtered),
            _ => Ok(None),
        }
    }

    /// In a stiff scene accelerations hold the vibration that steps go over: outputs then lie on the polynomial of the method.
    fn between(
        &mut self,
        eq: &Equations<'_, f64>,
        from: &Instant,
        step: &Step,
        h: f64,
        fractions: &[f64],
        counts: &mut Counts,
    ) -> Result<Vec<Motion<f64>>> {
        match (&self.history, &mut self.begin) {
            (None, Begin::Parts(start)) => {
                let at = |x: &f64| start.between(eq, from.motion.t + x * h, counts);
                return Ok(fractions.iter().map(at).collect::<Result<Vec<_>>>()?.into_iter().flatten().collect());
            }
            (None, Begin::OneStep(start)) => return start.scheme.between(eq, from, step, h, fractions, counts),
            _ => {}
        }
        let (Some(history), Some(last), Some(true)) = (&self.history, &self.tried, self.stiff) else {
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
        let Some(history) = &self.history else { return Some(self.first_factor(size)) };
        if history.equal <= k {
            return Some(1.0);
        }
        let norm = |order: usize| size(&self.shown(&history.d[order + 1], order)).max(f64::MIN_POSITIVE);
        let factor = |order: usize| norm(order).powf(-1.0 / self.power_of(order));
        let same = factor(k);
        let least = if self.corrector.per_unit_step() { LEAST_OF_SHARES } else { 1 };
        let lower = if k > least { factor(k - 1) } else { 0.0 };
        let higher = if k < MOST { factor(k + 1) } else { 0.0 };
        let best = same.max(lower).max(higher);
        let mut chosen = k;
        if best == lower && k > least {
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

    fn parts(&mut self) -> Option<Parts> {
        self.kept_parts()
    }

    /// A step in many parts would hide them.
    fn end_at_kinks(&mut self) {
        if let Begin::Parts(start) = &self.begin {
            self.begin = Begin::OneStep(OneStep::smooth(start));
        }
    }

    fn reset(&mut self) {
        self.history = None;
        self.record = None;
        self.corrector.reset();
        self.points.clear();
        match &mut self.begin {
            Begin::Radau(start) => start.reset(),
            Begin::OneStep(start) => start.scheme.reset(),
            Begin::Rates | Begin::Parts(_) => {}
        }
    }

    fn remark(&self) -> Option<String> {
        self.corrector.remark()
    }
}

impl History {
    /// The points of the grid in the order of time, the last one first.
    fn points(&self, order: usize) -> Vec<Pair> {
        // y_(n-j) = sum_m (-1)^m C(j, m) D_m
        let point = |j: usize| {
            let mut sum = Pair::zero(self.chart.rate.len(), self.d[0].z.len());
            let mut binomial = 1.0;
            for (m, d) in self.d.iter().enumerate().take(j + 1) {
                sum.add(d, if m % 2 == 0 { binomial } else { -binomial });
                binomial *= (j - m) as f64 / (m as f64 + 1.0);
            }
            sum
        };
        (0..=order).map(point).collect()
    }

    /// What the differences foresee for the next point, and what they add to its slope.
    fn ahead(&self, formula: &Formula, order: usize) -> (Pair, Pair) {
        let zero = Pair::zero(self.chart.rate.len(), self.d[0].z.len());
        let (mut guess, mut psi) = (zero.clone(), zero);
        for (m, d) in self.d.iter().enumerate().take(order + 1) {
            guess.add(d, 1.0);
            psi.add(d, gamma(m) / formula.alpha(order));
        }
        (guess, psi)
    }
}

/// Past points counted from the pose of the last one.
fn recharted(eq: &Equations<'_, f64>, history: &mut History, order: usize) -> Recharted {
    let order = order.min(MOST + 1);
    let points = history.points(order);
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
    let from_here: Vec<Pair> = points.iter().zip(&motions).map(from_here).collect();
    let of = |all: &[Pair]| all.iter().map(|p| p.y.clone()).collect();
    let turned = Recharted { before: of(&points), after: of(&from_here) };
    for (d, new) in history.d.iter_mut().zip(backward_differences(from_here)) {
        *d = new;
    }
    let mut chart = history.chart.clone();
    chart.q.clone_from(&motions[0].q);
    history.chart = chart;
    turned
}
