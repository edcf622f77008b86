//! F(x) = 0 without derivatives: inverse quasi-Newton updates, d = -H F(x), with the line search of `line_search`.
//!
//! The method of J. Algorithms & Comput. Technol. (2017), doi 10.1177/1748301817729990 (initialise, test, backtrack, update the
//! inverse with a test of its determinant), and what it needs in practice: a start from differences, restarts where it stalls and
//! a fallback to Broyden's first update, since BFGS keeps H symmetric while few Jacobians are (docs/root.md).
use std::sync::{Arc, Mutex};

use super::Residual;
use super::differences;
use super::inverse::{Base, Family, Guard, Inverse, Step};
use super::line_search::{self, Rule, norm2};
use crate::error::Result;
use crate::linalg::sparse::{Csc, Factor};

/// Parts of the norm that iterations leave beyond this foresee nothing.
const FORESEEABLE: f64 = 0.5;

/// How H is formed anew, at the start and after a stall.
pub enum Start {
    /// The unit matrix; a stall forms it from differences unless the memory is limited.
    Identity,
    /// The inverse of a forward-difference Jacobian.
    Differences,
    /// The same over a known pattern, kept as sparse factors.
    Pattern(Csc),
}

pub struct Options {
    pub family: Family,
    pub tolerance: f64,
    pub max_iterations: usize,
    pub max_evaluations: u64,
    pub rule: Rule,
    pub guard: Guard,
    pub start: Start,
    /// Pairs kept; None stores H itself.
    pub memory: Option<usize>,
    /// Relative increment of the differences.
    pub difference: f64,
    /// The largest part of the norm that iterations behind the first one left lately: where the norm, falling like that or as it just did,
    /// ends within the tolerance, the last step passes without an evaluation. None: each is evaluated.
    pub left: Option<f64>,
    /// Iterations within which the norm has to halve.
    pub patience: usize,
    pub restarts: usize,
    /// Broyden's first update once the restarts are used up.
    pub fallback: bool,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Status {
    Converged,
    MaxIterations,
    MaxEvaluations,
    /// No step along d passed the line search, and nothing was left to try.
    LineSearch,
    /// The norm no longer fell, and nothing was left to try.
    Stalled,
    /// The observer asked to stop.
    Stopped,
    /// H or d is not finite.
    Broken,
}

pub struct Outcome {
    pub status: Status,
    pub x: Vec<f64>,
    pub f: Vec<f64>,
    /// |f|, or what was foreseen of it
    pub reached: f64,
    /// Whether the last step was not evaluated: f is that before it.
    pub foreseen: bool,
    pub norms: Vec<f64>,
    pub iterations: usize,
    pub backtracks: usize,
    pub evaluations: u64,
    /// Updates that the guard left out.
    pub skipped: usize,
    pub restarts: usize,
    /// Difference Jacobians that were singular, so that a bounded stand-in was inverted.
    pub singular: usize,
    /// Iteration at which Broyden's update took over.
    pub fallback: Option<usize>,
    pub family: Family,
}

/// Solves from x; `inverse` is used as it is if given (reuse) and holds the last H at the end. One of limited memory that belongs
/// to the other family is formed anew.
pub fn solve(
    problem: &mut dyn Residual,
    x: &[f64],
    options: &Options,
    inverse: &mut Option<Inverse>,
) -> Result<Outcome> {
    let mut run = Run::new(problem, x, options)?;
    if inverse.as_ref().is_some_and(|h| !h.serves(options.family)) {
        *inverse = None;
    }
    if inverse.is_none() && run.norm > options.tolerance {
        *inverse = Some(run.form(true)?);
    }
    loop {
        if let Some(status) = run.finished() {
            return Ok(run.close(status));
        }
        let Some(h) = inverse.as_mut() else {
            return Ok(run.close(Status::Broken));
        };
        if let Some(trouble) = run.iterate(h)? {
            if trouble == Status::Stopped {
                return Ok(run.close(trouble));
            }
            match run.recover()? {
                Some(h) => *inverse = Some(h),
                None => return Ok(run.close(trouble)),
            }
        }
    }
}

struct Run<'a> {
    problem: &'a mut dyn Residual,
    options: &'a Options,
    x: Vec<f64>,
    f: Vec<f64>,
    norm: f64,
    start: (Vec<f64>, Vec<f64>),
    best: (Vec<f64>, Vec<f64>, f64),
    /// Best norm and iteration at which it was last halved.
    halved: (f64, usize),
    tries: usize,
    /// iteration that left the first point: eta counts from there
    first: usize,
    /// factor of the line search since H was formed
    unit: Option<f64>,
    out: Outcome,
}

impl<'a> Run<'a> {
    fn new(problem: &'a mut dyn Residual, x: &[f64], options: &'a Options) -> Result<Self> {
        let mut f = vec![0.0; x.len()];
        problem.residual(x, &mut f)?;
        let norm = norm2(&f);
        let out = Outcome {
            status: Status::Converged,
            x: Vec::new(),
            f: Vec::new(),
            reached: norm,
            foreseen: false,
            norms: vec![norm],
            iterations: 0,
            backtracks: 0,
            evaluations: 1,
            skipped: 0,
            restarts: 0,
            singular: 0,
            fallback: None,
            family: options.family,
        };
        Ok(Run {
            problem,
            options,
            start: (x.to_vec(), f.clone()),
            best: (x.to_vec(), f.clone(), norm),
            halved: (norm, 0),
            tries: 0,
            first: 0,
            unit: None,
            x: x.to_vec(),
            f,
            norm,
            out,
        })
    }

    fn finished(&self) -> Option<Status> {
        if self.norm <= self.options.tolerance {
            Some(Status::Converged)
        } else if self.out.iterations >= self.options.max_iterations {
            Some(Status::MaxIterations)
        } else if self.out.evaluations >= self.options.max_evaluations {
            Some(Status::MaxEvaluations)
        } else {
            None
        }
    }

    /// One step; what went wrong, if anything did.
    fn iterate(&mut self, h: &mut Inverse) -> Result<Option<Status>> {
        let n = self.x.len();
        let mut d = vec![0.0; n];
        h.apply(&self.f, &mut d);
        d.iter_mut().for_each(|v| *v = -*v);
        if !d.iter().all(|v| v.is_finite()) {
            return Ok(Some(Status::Broken));
        }
        if let Some(rest) = self.foreseen() {
            self.x.iter_mut().zip(&d).for_each(|(x, d)| *x += d);
            self.norm = rest;
            self.out.foreseen = true;
            return Ok(None);
        }
        let (mut trial, mut reached) = (vec![0.0; n], vec![0.0; n]);
        let rule = &self.options.rule;
        let own = if rule.invariant { f64::min(1.0, self.norm / line_search::dot(&d, &d)) } else { 1.0 };
        let unit = *self.unit.get_or_insert(own);
        let from = line_search::From { x: &self.x, d: &d, norm: self.norm, k: self.out.iterations - self.first, unit };
        let (taken, evaluations) = line_search::search(self.problem, rule, &from, &mut trial, &mut reached)?;
        self.out.evaluations += evaluations as u64;
        self.out.backtracks += evaluations - 1;
        let Some(taken) = taken else {
            return Ok(Some(Status::LineSearch));
        };
        let s: Vec<f64> = d.iter().map(|d| taken.lambda * d).collect();
        let y: Vec<f64> = reached.iter().zip(&self.f).map(|(a, b)| a - b).collect();
        let step = Step { s: &s, y: &y, f: &self.f, lambda: taken.lambda };
        // an inverse as good as differences make it would lose: BFGS drops what is not symmetric, Broyden's update takes rounding in
        let is_exact = taken.norm <= f64::EPSILON.sqrt() * self.norm;
        let is_due = taken.norm > self.options.tolerance && !is_exact;
        if is_due && !h.update(self.out.family, &self.options.guard, &step) {
            self.out.skipped += 1;
        }
        self.accept(trial, reached, taken.norm)
    }

    /// The norm behind the next step, if it falls no less than it did lately and just did, where that is within the tolerance.
    fn foreseen(&self) -> Option<f64> {
        let (Some(left), [.., before, now]) = (self.options.left, self.out.norms.as_slice()) else { return None };
        let left = left.max(now / before);
        let rest = left / (1.0 - left) * now;
        (left < FORESEEABLE && rest <= self.options.tolerance).then_some(rest)
    }

    fn accept(&mut self, x: Vec<f64>, f: Vec<f64>, norm: f64) -> Result<Option<Status>> {
        (self.x, self.f, self.norm) = (x, f, norm);
        self.out.iterations += 1;
        self.out.norms.push(norm);
        if norm < self.best.2 {
            self.best = (self.x.clone(), self.f.clone(), norm);
        }
        if norm <= 0.5 * self.halved.0 {
            self.halved = (norm, self.out.iterations);
        }
        if self.problem.accepted(&self.x, &self.f)? {
            return Ok(Some(Status::Stopped));
        }
        let waited = self.out.iterations - self.halved.1;
        Ok((waited >= self.options.patience && norm > self.options.tolerance).then_some(Status::Stalled))
    }

    /// After a stall: H anew at the best point, then Broyden's update from there, then Broyden's update from the first point.
    fn recover(&mut self) -> Result<Option<Inverse>> {
        self.tries += 1;
        let restarts = self.options.restarts;
        let fall = self.options.fallback && self.options.family == Family::Bfgs;
        if self.tries <= restarts {
            self.out.restarts += 1;
            self.go_to(self.best.0.clone(), self.best.1.clone(), self.best.2);
        } else if fall && self.tries <= restarts + 2 {
            self.out.family = Family::Broyden;
            self.out.fallback.get_or_insert(self.out.iterations);
            if self.tries == restarts + 1 {
                self.go_to(self.best.0.clone(), self.best.1.clone(), self.best.2);
            } else {
                let (x, f) = self.start.clone();
                let norm = norm2(&f);
                self.go_to(x, f, norm);
                self.first = self.out.iterations;
            }
        } else {
            return Ok(None);
        }
        self.form(false).map(Some)
    }

    fn go_to(&mut self, x: Vec<f64>, f: Vec<f64>, norm: f64) {
        (self.x, self.f, self.norm) = (x, f, norm);
        self.halved = (norm, self.out.iterations);
        self.unit = None;
    }

    /// H formed anew at the present point.
    fn form(&mut self, first: bool) -> Result<Inverse> {
        let n = self.x.len();
        let (problem, count) = (&mut *self.problem, &mut self.out.evaluations);
        let relative = self.options.difference;
        if let (Start::Pattern(pattern), Some(room)) = (&self.options.start, self.options.memory) {
            let j = differences::sparse(problem, &self.x, &self.f, relative, pattern, count)?;
            let base = match Factor::lu(&j) {
                Ok(factor) => Base::Lu(Arc::new(Mutex::new(factor))),
                Err(_) => {
                    self.out.singular += 1;
                    Base::Identity
                }
            };
            return Ok(Inverse::limited(base, room, self.out.family));
        }
        if let Some(room) = self.options.memory {
            return Ok(Inverse::limited(Base::Identity, room, self.out.family));
        }
        if first && matches!(self.options.start, Start::Identity) {
            return Ok(Inverse::identity(n));
        }
        let j = match &self.options.start {
            Start::Pattern(p) => {
                let j = differences::sparse(problem, &self.x, &self.f, relative, p, count)?;
                faer::Mat::from_fn(n, n, |r, c| j.get(r, c))
            }
            _ => differences::dense(problem, &self.x, &self.f, relative, count)?,
        };
        Ok(Inverse::of(&j).unwrap_or_else(|| {
            self.out.singular += 1;
            Inverse::regularised(&j).unwrap_or_else(|| Inverse::identity(n))
        }))
    }

    fn close(mut self, status: Status) -> Outcome {
        let failed = !matches!(status, Status::Converged | Status::Stopped);
        (self.out.x, self.out.f) = if failed { (self.best.0, self.best.1) } else { (self.x, self.f) };
        self.out.status = status;
        self.out.reached = if failed { norm2(&self.out.f) } else { self.norm };
        self.out
    }
}
