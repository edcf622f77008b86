//! A response curve: a branch of periodic solutions with error, stability and events, made point by point.
use num_complex::Complex64 as c64;

use super::basis::Finer;
use super::crossings::{Crossing, Kind, Place, Search};
use super::estimate::{Estimate, Estimator};
use super::linear::Matrices;
use super::problem::Problem;
use super::stability::{Floquet, Stability};
use super::truncation::{Judge, Verdict};
use crate::error::{Error, Result};
use crate::run::Cancel;
use crate::solve::Linearisation;
use crate::solve::continuation::{Advance, Branch};
use crate::solve::corrector::{Options, Point, Workspace};
use crate::solve::segment::Jump;
use crate::tolerances::periodic::HIDDEN;

#[derive(Debug, Clone, Copy)]
pub struct Settings {
    pub options: Options,
    pub from: f64,
    pub to: f64,
    pub stability: bool,
    pub events: bool,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Status {
    Going,
    /// the end of the range
    End,
    /// the branch came back to the start of the range
    Start,
    /// the least step did not converge
    Stalled,
}

#[derive(Debug, Clone)]
pub struct Record {
    pub y: Vec<f64>,
    pub p: f64,
    pub error: f64,
    /// the part of it that more samples would remove
    pub aliasing: f64,
    /// None where stability was not asked for or cannot be told
    pub floquet: Option<Floquet>,
    /// false where the truncation of the motion decides which exponents grow
    pub settled: bool,
    pub step: f64,
    pub iterations: usize,
}

#[derive(Debug, Clone)]
pub struct Event {
    pub kind: Kind,
    pub y: Vec<f64>,
    pub p: f64,
    pub exponent: Option<c64>,
    /// false where the truncation of the motion decides whether it lies here
    pub settled: bool,
    /// number of the record that follows
    pub before: usize,
}

pub struct Follower {
    pub problem: Problem,
    pub settings: Settings,
    pub status: Status,
    pub records: Vec<Record>,
    pub events: Vec<Event>,
    branch: Branch,
    estimator: Estimator,
    judge: Option<Judge>,
    count: usize,
    /// the last record, whose reader may have taken it away, and up to three before it, where all have exponents
    trail: Vec<Passed>,
}

/// A place that the branch has passed.
struct Passed {
    place: Place,
    /// whether an event lies between the place before and this one
    event: bool,
}

impl Follower {
    /// Starts at a solution y for the present parameter; the first step has a positive product with `towards`, or goes to the end of
    /// the range where there is none.
    pub fn start(
        mut problem: Problem,
        finer: &Finer,
        y: &[f64],
        towards: Option<&[f64]>,
        settings: Settings,
        model: Option<&Matrices>,
    ) -> Result<Follower> {
        let default = Branch::along_parameter(y.len(), (settings.to - settings.from).signum());
        let p = problem.parameter_value();
        let towards = towards.filter(|t| t.iter().any(|x| *x != 0.0)).unwrap_or(&default);
        let Some(branch) = Branch::start(&mut problem, y, p, towards, settings.options)? else {
            return Err(Error::singular(
                "the branch cannot be started: the first solution is singular; begin elsewhere",
            ));
        };
        let estimator = Estimator::new(&problem, finer)?;
        let stability = if settings.stability { Stability::new(&mut problem, model)? } else { None };
        let judge = stability.map(|stability| Judge::new(stability, finer, settings.options, false));
        let mut follower = Follower {
            problem,
            settings,
            status: Status::Going,
            records: Vec::new(),
            events: Vec::new(),
            branch,
            estimator,
            judge,
            count: 0,
            trail: Vec::new(),
        };
        follower.record()?;
        Ok(follower)
    }

    /// Newton steps, those to solutions with more harmonics included.
    pub fn corrections(&self) -> u64 {
        self.branch.work.corrections + self.judge.as_ref().map_or(0, Judge::corrections)
    }

    /// Dynamic stiffnesses that were computed, those of the error estimate included.
    pub fn factorisations(&self) -> u64 {
        let refined = self.judge.as_ref().map_or(0, Judge::factorisations);
        self.problem.factorisations + self.estimator.factorisations() + refined
    }

    /// Solutions with more harmonics, by which stability was told.
    pub fn refinements(&self) -> u64 {
        self.judge.as_ref().map_or(0, |judge| judge.refinements)
    }

    /// One more point, unless the branch has ended.
    pub fn advance(&mut self, cancel: &Cancel) -> Result<()> {
        if self.status != Status::Going {
            return Ok(());
        }
        let Some(crossed) = self.move_on(cancel)? else {
            self.status = Status::Stalled;
            return self.find_hidden(2, cancel);
        };
        let direction = (self.settings.to - self.settings.from).signum();
        let p = self.branch.point().p();
        let end = if (p - self.settings.to) * direction >= 0.0 {
            Some((self.settings.to, Status::End))
        } else if (p - self.settings.from) * direction < 0.0 {
            Some((self.settings.from, Status::Start))
        } else {
            None
        };
        if let Some((p, status)) = end {
            self.status = status;
            match self.branch.land(&mut self.problem, p)? {
                Some(point) => self.branch.replace(point),
                None => self.status = Status::Stalled,
            }
        }
        self.record()?;
        if self.settings.events {
            self.find_hidden(3, cancel)?;
            self.find_events(crossed, cancel)?;
        }
        if self.status == Status::Going { Ok(()) } else { self.find_hidden(2, cancel) }
    }

    /// A step on the same branch, with the branch point that it passes; None where there is no step. A sign of the determinant that
    /// changes without a point where it vanishes means that the step has landed on another branch.
    fn move_on(&mut self, cancel: &Cancel) -> Result<Option<Option<Point>>> {
        loop {
            if self.branch.advance(&mut self.problem, cancel)? == Advance::Stalled {
                return Ok(None);
            }
            let Some((a, segment)) = self.branch.previous().cloned().zip(self.branch.segment()) else {
                return Ok(Some(None));
            };
            let point = self.branch.point().clone();
            if a.orientation * point.orientation > 0.0 {
                return Ok(Some(None));
            }
            let mut work = Workspace::new(a.y().len());
            let same = |_: &mut Problem, p: &Point, _: &Linearisation| Ok(p.orientation * a.orientation);
            match segment.jump(&mut self.problem, &mut work, cancel, (1.0, -1.0), same)? {
                Jump::Between { after, width, .. } => {
                    // at a corner of the equations the determinant jumps through zero, and no branch crosses: there the regularity
                    // stays, at a branch point it falls with the width
                    let typical = a.regularity.max(point.regularity);
                    let crosses = after.regularity <= width.sqrt() * typical;
                    return Ok(Some(crosses.then_some(*after)));
                }
                Jump::Torn if self.branch.retreat() => {}
                Jump::Torn => return Ok(None),
            }
        }
    }

    /// Error and stability of the present point; the workspace still holds its linearisation.
    fn record(&mut self) -> Result<()> {
        let point = self.branch.point().clone();
        self.problem.set_parameter(point.p())?;
        self.problem.update_blocks()?;
        let estimate = self.estimator.estimate(&self.problem, point.y())?;
        let out = &self.branch.work.out;
        let judge = self.judge.as_mut();
        let verdict =
            judge.map(|judge| judge.judge(&mut self.problem, out, (&point).into(), &estimate, false)).transpose()?;
        self.records.push(Record {
            y: point.y().to_vec(),
            p: point.p(),
            error: estimate.error,
            aliasing: estimate.aliasing,
            floquet: verdict.as_ref().map(|verdict| verdict.floquet.clone()),
            settled: verdict.as_ref().is_none_or(|verdict| verdict.settled),
            step: point.step,
            iterations: point.iterations,
        });
        self.pass(point, estimate, verdict);
        self.count += 1;
        Ok(())
    }

    fn pass(&mut self, point: Point, estimate: Estimate, verdict: Option<Verdict>) {
        if self.trail.len() > 3 {
            self.trail.remove(0);
        }
        match verdict {
            Some(verdict) => {
                let place = Place { point, estimate, verdict, zero: false };
                self.trail.push(Passed { place, event: false });
            }
            None => self.trail.clear(),
        }
    }

    fn find_events(&mut self, crossed: Option<Point>, cancel: &Cancel) -> Result<()> {
        let (Some(a), Some(segment)) = (self.branch.previous().cloned(), self.branch.segment()) else {
            return Ok(());
        };
        let b = self.branch.point().clone();
        let first = self.events.len();
        let mut between = Vec::new();
        if a.p_slope() * b.p_slope() < 0.0 {
            let ends = (a.p_slope(), b.p_slope());
            let work = &mut self.branch.work;
            let found = segment.zero(&mut self.problem, work, cancel, ends, |_, p, _| Ok((p.p_slope(), ())))?;
            let found = found.map(|(point, ())| point);
            between.extend(found.clone());
            self.push_event(Kind::Fold, found);
        }
        between.extend(crossed.clone());
        self.push_event(Kind::BranchPoint, crossed);
        let [.., before, after] = self.trail.as_slice() else {
            return Ok(());
        };
        let (mut here, present) = (before.place.clone(), after.place.clone());
        between.sort_by(|p, q| segment.distance(p).total_cmp(&segment.distance(q)));
        let Some(mut search) = self.search(cancel) else {
            return Ok(());
        };
        for point in between {
            let there = search.place(point, [&here, &present], true)?;
            search.between(&here, &there)?;
            here = there;
        }
        search.between(&here, &present)?;
        let found = search.found;
        self.push_crossings(found, self.count - 1);
        self.doubt_events(first);
        Ok(())
    }

    fn search<'a>(&'a mut self, cancel: &'a Cancel) -> Option<Search<'a>> {
        let (problem, work, options) = (&mut self.problem, &mut self.branch.work, self.settings.options);
        self.judge.as_mut().map(|judge| Search { problem, work, judge, options, cancel, found: Vec::new() })
    }

    fn push_crossings(&mut self, found: Vec<Crossing>, before: usize) {
        self.events.extend(found.into_iter().filter_map(|Crossing { kind, z: mut y, exponent, settled }| {
            let p = y.pop()?;
            Some(Event { kind, y, p, exponent: Some(exponent), settled, before })
        }));
    }

    /// Marks the events of the last segment, from this one on, where its ends are not settled or the number of growing exponents at
    /// solutions with more harmonics does not change as the events say.
    fn doubt_events(&mut self, first: usize) {
        let [.., Passed { place: a, .. }, Passed { place: b, event }] = self.trail.as_mut_slice() else {
            return;
        };
        let events = &mut self.events[first..];
        *event = !events.is_empty();
        let w0 = self.problem.base_frequency();
        let change = a.exponents().unstable(w0) + b.exponents().unstable(w0);
        let crossings: usize = events.iter().map(|event| usize::from(event.kind != Kind::NeimarkSacker)).sum();
        let jumps = events.iter().any(|event| matches!(event.kind, Kind::Grazing | Kind::Unresolved));
        let (a, b) = (&a.verdict, &b.verdict);
        let contrary = a.level.max(b.level) > 0 && !jumps && (change + crossings) % 2 == 1;
        if contrary || !a.settled || !b.settled {
            events.iter_mut().for_each(|event| event.settled = false);
        }
        if contrary && let Some(record) = self.records.last_mut() {
            record.settled = false;
        }
    }

    /// Crossings that come in twos between neighbours, which the number of growing roots does not show: the segment that begins at
    /// this place of the trail, counted from its end.
    fn find_hidden(&mut self, from_end: usize, cancel: &Cancel) -> Result<()> {
        let Some(i) = self.trail.len().checked_sub(from_end).filter(|_| self.settings.events && self.trail.len() > 2)
        else {
            return Ok(());
        };
        if self.trail[i + 1].event {
            return Ok(());
        }
        let place = |i: usize| self.trail.get(i).map(|passed| passed.place.clone());
        let places = [i.checked_sub(1).and_then(place), place(i), place(i + 1), place(i + 2)];
        let Some(mut search) = self.search(cancel) else {
            return Ok(());
        };
        search.divide(&places, HIDDEN)?;
        let found = search.found;
        self.push_crossings(found, self.count - self.trail.len() + i + 1);
        Ok(())
    }

    fn push_event(&mut self, kind: Kind, point: Option<Point>) {
        if let Some(point) = point {
            let (y, p, before) = (point.y().to_vec(), point.p(), self.count - 1);
            self.events.push(Event { kind, y, p, exponent: None, settled: true, before });
        }
    }
}
