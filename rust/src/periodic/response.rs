//! A response curve: a branch of periodic solutions with error, stability and events, made point by point.
use num_complex::Complex64 as c64;

use super::basis::Finer;
use super::estimate::Estimator;
use super::linear::Matrices;
use super::problem::Problem;
use crate::error::{Error, Result};
use crate::periodic::stability::{Floquet, Stability};
use crate::run::Cancel;
use crate::solve::Linearisation;
use crate::solve::continuation::{Advance, Branch};
use crate::solve::corrector::{Options, Point, Workspace};
use crate::solve::segment::{Jump, Segment};
use crate::tolerances::periodic::{
    AXIS, AXIS_ROOT, BRANCHING, HIDDEN, NEUTRAL, RESONANT, SAME_CROSSING, SAME_PAIR, STEEPER,
};

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

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    Fold,
    BranchPoint,
    NeimarkSacker,
    PeriodDoubling,
    /// the exponents jump across the axis: a contact opens or closes
    Grazing,
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
    pub step: f64,
    pub iterations: usize,
}

#[derive(Debug, Clone)]
pub struct Event {
    pub kind: Kind,
    pub y: Vec<f64>,
    pub p: f64,
    pub exponent: Option<c64>,
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
    stability: Option<Stability>,
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
        let mut follower = Follower {
            problem,
            settings,
            status: Status::Going,
            records: Vec::new(),
            events: Vec::new(),
            branch,
            estimator,
            stability,
            count: 0,
            trail: Vec::new(),
        };
        follower.record()?;
        Ok(follower)
    }

    pub fn corrections(&self) -> u64 {
        self.branch.work.corrections
    }

    /// Dynamic stiffnesses that were computed, those of the error estimate included.
    pub fn factorisations(&self) -> u64 {
        self.problem.factorisations + self.estimator.factorisations()
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
            let same = |_: &mut Problem, p: &Point, _: &Linearisation| Ok(p.orientation == a.orientation);
            match segment.jump(&mut self.problem, &mut work, cancel, same)? {
                Jump::Between { after, width, .. } => {
                    // at a corner of the equations the determinant jumps through zero, and no branch crosses
                    let typical = a.regularity.max(point.regularity);
                    let crosses = after.regularity <= BRANCHING * width * typical;
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
        let floquet = match self.stability.as_mut() {
            Some(stability) => {
                let jacobian = self.branch.work.out.jacobian.as_ref();
                let mut floquet = stability.exponents(&mut self.problem, jacobian, point.y())?;
                floquet.doubtful =
                    stability.is_doubtful(&mut self.problem, point.y(), &estimate.deviations, floquet.by_hill)?;
                Some(floquet)
            }
            None => None,
        };
        self.pass(floquet.as_ref());
        self.records.push(Record {
            y: point.y().to_vec(),
            p: point.p(),
            error: estimate.error,
            aliasing: estimate.aliasing,
            floquet,
            step: point.step,
            iterations: point.iterations,
        });
        self.count += 1;
        Ok(())
    }

    fn pass(&mut self, floquet: Option<&Floquet>) {
        if self.trail.len() > 3 {
            self.trail.remove(0);
        }
        match floquet {
            Some(floquet) => {
                let place = (self.branch.point().clone(), floquet.exponents.clone(), false);
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
        let mut between = Vec::new();
        if a.p_slope() * b.p_slope() < 0.0 {
            let ends = (a.p_slope(), b.p_slope());
            let work = &mut self.branch.work;
            let found = segment.zero(&mut self.problem, work, cancel, ends, |_, p, _| Ok(p.p_slope()))?;
            between.extend(found.clone());
            self.push_event(Kind::Fold, found, None);
        }
        between.extend(crossed.clone());
        self.push_event(Kind::BranchPoint, crossed, None);
        let [.., before, after] = self.trail.as_slice() else {
            return Ok(());
        };
        let (mut here, present) = (before.place.clone(), after.place.clone());
        let events = self.events.len();
        let plain = between.is_empty();
        between.sort_by(|p, q| segment.distance(p).total_cmp(&segment.distance(q)));
        for point in between {
            let there = (point.clone(), self.exponents_at(&point)?, true);
            self.find_crossings(&here, &there, cancel)?;
            here = there;
        }
        self.find_crossings(&here, &present, cancel)?;
        if let Some(last) = self.trail.last_mut() {
            last.event = !plain || self.events.len() > events;
        }
        Ok(())
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
        let found = self.events.len();
        self.refine(&places, HIDDEN, cancel)?;
        let before = self.count - self.trail.len() + i + 1;
        self.events[found..].iter_mut().for_each(|event| event.before = before);
        Ok(())
    }

    /// Solves for points between the inner two of four neighbours, of which the outer ones may be missing, until no root can have
    /// crossed the axis and come back, or one has.
    fn refine(&mut self, places: &[Option<Place>; 4], trials: usize, cancel: &Cancel) -> Result<()> {
        let [before, Some(a), Some(b), after] = places else {
            return Ok(());
        };
        let w0 = self.problem.base_frequency();
        if unstable(&a.1, w0) != unstable(&b.1, w0) {
            return self.find_crossings(a, b, cancel);
        }
        let options = self.settings.options;
        let segment = Segment::new(&a.0, &b.0, options);
        let length = |p: &Place, q: &Place| Segment::new(&p.0, &q.0, options).length();
        let left = before.as_ref().map(|p| (length(p, a), p.1.as_slice()));
        let right = after.as_ref().map(|p| (length(b, p), p.1.as_slice()));
        let Some(fraction) =
            possible_crossing([left, right], (&a.1, &b.1), segment.length(), w0).filter(|_| trials > 0)
        else {
            return Ok(());
        };
        let Some(point) = segment.point(&mut self.problem, &mut self.branch.work, fraction)? else {
            return Ok(());
        };
        let middle = Some((point.clone(), self.exponents_at(&point)?, false));
        let [before, a, b, after] = places.clone();
        self.refine(&[before, a.clone(), middle.clone(), b.clone()], trials - 1, cancel)?;
        self.refine(&[a, middle, b, after], trials - 1, cancel)
    }

    fn exponents_at(&mut self, point: &Point) -> Result<Vec<c64>> {
        let Some(stability) = self.stability.as_mut() else {
            return Ok(Vec::new());
        };
        let mut out = Linearisation::new(point.y().len());
        self.problem.set_parameter(point.p())?;
        self.problem.linearise_here(point.y(), &mut out)?;
        let floquet = stability.exponents(&mut self.problem, out.jacobian.as_ref(), point.y())?;
        Ok(floquet.exponents)
    }

    /// Roots that cross the imaginary axis otherwise than through zero, between two places of the branch.
    fn find_crossings(&mut self, a: &Place, b: &Place, cancel: &Cancel) -> Result<()> {
        let w0 = self.problem.base_frequency();
        if !changes(a, b, w0) || self.stability.is_none() {
            return Ok(());
        }
        let segment = Segment::new(&a.0, &b.0, self.settings.options);
        let ranks = crossing_ranks(a, b, w0);
        if ranks.is_empty() {
            return self.find_border(a, &segment, cancel);
        }
        let mut found: Vec<(f64, c64)> = Vec::new();
        for rank in ranks {
            let ends = (nth_growth(&a.1, rank), nth_growth(&b.1, rank));
            let Some((point, exponent)) = self.axis_crossing(&segment, rank, ends, cancel)? else {
                continue;
            };
            let at = segment.distance(&point);
            // the two of a conjugate pair grow alike
            let pair = |(other, s): &(f64, c64)| {
                (at - other).abs() <= SAME_CROSSING * segment.length() && same_pair(*s, exponent)
            };
            if !found.iter().any(pair) {
                found.push((at, exponent));
                self.push_crossing(point, exponent, AXIS);
            }
        }
        if found.is_empty() { self.find_border(a, &segment, cancel) } else { Ok(()) }
    }

    /// Where the growth of the root with this rank vanishes or jumps through zero, and the root there.
    fn axis_crossing(
        &mut self,
        segment: &Segment,
        rank: usize,
        ends: (f64, f64),
        cancel: &Cancel,
    ) -> Result<Option<(Point, c64)>> {
        let Some(stability) = self.stability.as_mut() else {
            return Ok(None);
        };
        let mut exponent = c64::new(f64::NAN, 0.0);
        let growth = |problem: &mut Problem, point: &Point, out: &Linearisation| -> Result<f64> {
            problem.set_parameter(point.p())?;
            let floquet = stability.exponents(problem, out.jacobian.as_ref(), point.y())?;
            exponent = by_growth(floquet.exponents).get(rank).copied().unwrap_or(c64::new(f64::NAN, 0.0));
            Ok(exponent.re)
        };
        let found = segment.zero(&mut self.problem, &mut self.branch.work, cancel, ends, growth)?;
        Ok(found.map(|point| (point, exponent)))
    }

    /// The border of stability between two places of which one has roots on the axis, as those of undamped systems are: there the
    /// growth has no sign that changes, so that the border is bracketed by the number of growing roots.
    fn find_border(&mut self, a: &Place, segment: &Segment, cancel: &Cancel) -> Result<()> {
        let Some(stability) = self.stability.as_mut() else {
            return Ok(());
        };
        let first = unstable(&a.1, self.problem.base_frequency());
        let like_first = |problem: &mut Problem, point: &Point, out: &Linearisation| -> Result<bool> {
            problem.set_parameter(point.p())?;
            let found = stability.exponents(problem, out.jacobian.as_ref(), point.y())?;
            Ok(unstable(&found.exponents, problem.base_frequency()) == first)
        };
        let Jump::Between { before, after, .. } =
            segment.jump(&mut self.problem, &mut self.branch.work, cancel, like_first)?
        else {
            return Ok(());
        };
        let (here, there) = (self.exponents_at(&before)?, self.exponents_at(&after)?);
        let w0 = self.problem.base_frequency();
        let grown = |s: &[c64]| by_growth(s.to_vec()).first().copied().unwrap_or(c64::new(f64::NAN, 0.0));
        let (calm, growing) = if grown(&here).re <= grown(&there).re { (&here, &there) } else { (&there, &here) };
        let exponent = grown(growing);
        let calm_growth = grown(calm).re;
        // on the axis on one side and near it on the other: otherwise the exponents jump
        let on_axis = calm_growth.abs() <= AXIS * w0;
        self.push_crossing(*after, exponent, if on_axis { AXIS_ROOT } else { 0.0 });
        Ok(())
    }

    /// The kind follows from where the root crosses, if it does so within a fraction of the base frequency.
    fn push_crossing(&mut self, point: Point, exponent: c64, axis: f64) {
        let kind = crossing(exponent, self.problem.base_frequency(), axis);
        self.push_event(kind, Some(point), Some(exponent));
    }

    fn push_event(&mut self, kind: Kind, point: Option<Point>, exponent: Option<c64>) {
        if let Some(point) = point {
            let before = self.count - 1;
            self.events.push(Event { kind, y: point.y().to_vec(), p: point.p(), exponent, before });
        }
    }
}

/// Exponents with a positive real part.
pub fn unstable(exponents: &[c64], w0: f64) -> usize {
    exponents.iter().filter(|s| s.re > NEUTRAL * w0).count()
}

/// A point with its exponents; true where one of them is zero because the branch folds or meets another one.
type Place = (Point, Vec<c64>, bool);

/// Whether the number of growing exponents changes between two places; the one that is zero at a fold or branch point does so too,
/// and does not count.
fn changes(a: &Place, b: &Place, w0: f64) -> bool {
    let others = |place: &Place| {
        let mut exponents = place.1.clone();
        let least = (0..exponents.len()).min_by(|i, j| exponents[*i].norm().total_cmp(&exponents[*j].norm()));
        if let Some(least) = least.filter(|_| place.2) {
            exponents.swap_remove(least);
        }
        unstable(&exponents, w0) as i64
    };
    let change = others(a) - others(b);
    match (a.2, b.2) {
        (false, false) => change != 0,
        (false, true) => !(0..=1).contains(&change),
        (true, false) => !(-1..=0).contains(&change),
        (true, true) => change.abs() >= 2,
    }
}

/// Where between two places a root may have crossed the axis and come back, as a fraction of the way. A growth that rises to an
/// extremum and falls stays below two lines that are somewhat steeper than those through its neighbours on either side: it can be
/// beyond zero only where both lines are.
/// `outer`: distance and exponents of the places before and behind, where there are such.
fn possible_crossing(outer: [Option<(f64, &[c64])>; 2], ends: (&[c64], &[c64]), length: f64, w0: f64) -> Option<f64> {
    let reach = |outer: Option<(f64, &[c64])>, here: c64, sign: f64| match outer {
        // how far the line through two values, both on one side of zero or not, takes to zero
        Some((distance, exponents)) => {
            let rise = sign * (here.re - nearest(exponents, here)?.re);
            (rise > 0.0).then(|| here.re.abs() * distance / (STEEPER * rise))
        }
        None => Some(0.0),
    };
    if outer.iter().all(Option::is_none) {
        return None;
    }
    ends.0.iter().filter(|s| s.im >= 0.0).find_map(|here| {
        let there = nearest(ends.1, *here)?;
        if here.re * there.re <= 0.0 || here.re.abs().min(there.re.abs()) <= NEUTRAL * w0 {
            return None;
        }
        let sign = -here.re.signum();
        let (first, last) = (reach(outer[0], *here, sign)?, length - reach(outer[1], there, sign)?);
        (first < last).then(|| 0.5 * (first + last) / length)
    })
}

/// The exponent among these that is most like another one, or like its conjugate.
fn nearest(exponents: &[c64], to: c64) -> Option<c64> {
    let off = |s: &c64| (s.re - to.re).hypot(s.im.abs() - to.im.abs());
    exponents.iter().copied().min_by(|a, b| off(a).total_cmp(&off(b)))
}

/// The exponents, in the order of growth, whose growth changes its sign between two places.
fn crossing_ranks(a: &Place, b: &Place, w0: f64) -> Vec<usize> {
    let signs = |rank: &usize| {
        let (x, y) = (nth_growth(&a.1, *rank), nth_growth(&b.1, *rank));
        x * y < 0.0 && x.abs().min(y.abs()) > NEUTRAL * w0
    };
    (0..a.1.len()).filter(signs).collect()
}

/// Whether two exponents are one, or conjugate.
fn same_pair(s: c64, other: c64) -> bool {
    (s.im.abs() - other.im.abs()).abs() <= SAME_PAIR * (s.im.abs() + other.im.abs())
}

fn by_growth(mut exponents: Vec<c64>) -> Vec<c64> {
    exponents.sort_by(|a, b| b.re.total_cmp(&a.re));
    exponents
}

fn nth_growth(exponents: &[c64], n: usize) -> f64 {
    by_growth(exponents.to_vec()).get(n).map_or(f64::NAN, |s| s.re)
}

/// The bifurcation where an exponent is on the imaginary axis.
fn crossing(exponent: c64, w0: f64, axis: f64) -> Kind {
    if exponent.re.is_nan() || exponent.re.abs() > axis * w0 {
        Kind::Grazing
    } else if (exponent.im.abs() / w0 - 0.5).abs() < RESONANT {
        Kind::PeriodDoubling
    } else if exponent.im.abs() < RESONANT * w0 {
        Kind::BranchPoint
    } else {
        Kind::NeimarkSacker
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn where_an_exponent_crosses_tells_the_kind() {
        let w0 = 3.7;
        let kind = |re: f64, im: f64| crossing(c64::new(re * w0, im * w0), w0, AXIS);
        assert_eq!([1e-5, 1e-3].map(|im| kind(0.0, im)), [Kind::BranchPoint, Kind::NeimarkSacker]);
        assert_eq!([1e-5, 1e-3].map(|off| kind(0.0, 0.5 - off)), [Kind::PeriodDoubling, Kind::NeimarkSacker]);
        assert_eq!([1e-7, 1e-5].map(|re| kind(re, 0.0)), [Kind::BranchPoint, Kind::Grazing]);
    }

    #[test]
    fn growth_counts_from_its_bound_on() {
        let w0 = 3.7;
        assert_eq!(unstable(&[1e-10, 1e-8, -1e-8].map(|r| c64::new(r * w0, 1.0)), w0), 1);
    }

    /// Four places on a growth like h - s^2, beside a root that grows like none of them and lies nearer to zero.
    #[test]
    fn a_pair_that_comes_beyond_zero_between_two_places_is_never_excluded() {
        let exponents = |s: f64, h: f64| {
            let growth = 0.05 * (h - s * s);
            vec![c64::new(-1e-3, 0.1), c64::new(growth, 0.3), c64::new(growth, -0.3)]
        };
        for i in 0..1000 {
            let part = |k: usize| ((i * k) as f64 * 0.618_033_988_7).fract();
            let (before, a, b, after) = (-0.3 - part(7), -0.2 * part(3) - 0.02, 0.2 * part(5) + 0.02, 0.3 + part(11));
            let h = a.abs().min(b).powi(2) * (0.05 + 0.9 * part(13));
            let at = possible_crossing(
                [Some((a - before, &exponents(before, h))), Some((after - b, &exponents(after, h)))],
                (&exponents(a, h), &exponents(b, h)),
                b - a,
                1.0,
            );
            assert!(at.is_some_and(|t| 0.0 < t && t < 1.0), "{i}: {at:?}");
            let far = possible_crossing(
                [Some((a - before, &exponents(before, -1.0))), Some((after - b, &exponents(after, -1.0)))],
                (&exponents(a, -1.0), &exponents(b, -1.0)),
                b - a,
                1.0,
            );
            assert_eq!(far, None);
        }
    }

    /// Growths that rise by one on a unit of length to -1 on both sides: lines twice as steep reach zero half a unit further on.
    #[test]
    fn growths_between_two_places_may_be_twice_as_steep_as_beside_them() {
        let growth = |re: f64| vec![c64::new(re, 0.3)];
        let (far, near) = (growth(-2.0), growth(-1.0));
        let at = |length: f64| possible_crossing([Some((1.0, &far)), Some((1.0, &far))], (&near, &near), length, 1.0);
        assert_eq!([0.9, 1.1].map(|length| at(length).is_some()), [false, true]);
    }

    #[test]
    fn exponents_whose_frequencies_differ_by_a_thousandth_are_one_pair() {
        let same = |off: f64| same_pair(c64::new(0.1, -3.0), c64::new(-0.2, 3.0 * (1.0 + off)));
        assert_eq!([1e-3, 1e-2].map(same), [true, false]);
    }
}
