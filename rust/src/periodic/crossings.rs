//! Where exponents cross the imaginary axis between points of a branch.
//!
//! The place of a crossing depends on the branch only, not on the points around it: where the truncation of the motion moves the
//! exponents, it is that of a motion with more harmonics, however many tell the stability of those points.
use num_complex::Complex64 as c64;

use super::estimate::Estimate;
use super::exponents::{Exponents, unstable};
use super::problem::Problem;
use super::test_functions::{Told, possible_meeting};
use super::truncation::{Judge, Motion, Verdict, gap};
use crate::error::Result;
use crate::run::Cancel;
use crate::solve::Linearisation;
use crate::solve::corrector::{Options, Point, Workspace};
use crate::solve::segment::{Jump, Segment};
use crate::tolerances::periodic::{CROSSED, EXPONENT, NEUTRAL, RESONANT, SAME_PAIR, STEEPER};
use crate::tolerances::roots::EVENT_SOLVED;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    Fold,
    BranchPoint,
    NeimarkSacker,
    PeriodDoubling,
    /// the exponents jump across the axis: a contact opens or closes
    Grazing,
    /// they are on both sides of the axis, and no motion that was found has them on it
    Unresolved,
}

/// A point with its exponents.
#[derive(Clone)]
pub struct Place {
    pub point: Point,
    pub estimate: Estimate,
    pub verdict: Verdict,
    /// whether an exponent is zero because the branch folds or meets another one
    pub zero: bool,
}

impl Place {
    pub fn exponents(&self) -> &Exponents {
        &self.verdict.floquet.exponents
    }

    fn told(&self, part: usize) -> Told<'_> {
        (self.exponents().part(part), self.verdict.w0)
    }
}

/// A root on the axis.
pub struct Crossing {
    pub kind: Kind,
    /// [y, p] of the motion that has it
    pub z: Vec<f64>,
    pub exponent: c64,
    /// false where the truncation of the motion decides whether it lies here
    pub settled: bool,
}

/// A part of the system and the rank of one of its exponents in the order of growth.
type Own = (usize, usize);

/// A motion [y, p] with one of its exponents and its base frequency.
struct Root {
    z: Vec<f64>,
    exponent: c64,
    w0: f64,
}

/// Solves for points between others, and tells their exponents.
pub struct Search<'a> {
    pub problem: &'a mut Problem,
    pub work: &'a mut Workspace,
    pub judge: &'a mut Judge,
    pub options: Options,
    pub cancel: &'a Cancel,
    pub found: Vec<Crossing>,
}

impl Search<'_> {
    /// Solves for points between the inner two of four neighbours, of which the outer ones may be missing, until no root can have
    /// crossed the axis and come back, or one has.
    pub fn divide(&mut self, places: &[Option<Place>; 4], trials: usize) -> Result<()> {
        let [before, Some(a), Some(b), after] = places else {
            return Ok(());
        };
        let w0 = self.problem.base_frequency();
        if a.exponents().changing().any(|part| changes(a, b, part, w0)) {
            return self.between(a, b);
        }
        let segment = Segment::new(&a.point, &b.point, self.options);
        let length = |p: &Place, q: &Place| Segment::new(&p.point, &q.point, self.options).length();
        let left = before.as_ref().map(|p| (length(p, a), p));
        let right = after.as_ref().map(|p| (length(b, p), p));
        let reaches = |part: usize| {
            let ends = [a.told(part), b.told(part)];
            let outer = [left, right].map(|side| side.map(|(at, place)| (at, place.told(part))));
            let growths = outer.map(|side| side.map(|(at, (exponents, _))| (at, exponents)));
            possible_crossing(growths, (ends[0].0, ends[1].0), segment.length(), w0)
                .or_else(|| possible_meeting(outer, ends, segment.length()))
        };
        let Some(fraction) = a.exponents().changing().find_map(reaches).filter(|_| trials > 0) else {
            return Ok(());
        };
        let Some(point) = segment.point(self.problem, self.work, fraction)? else {
            return Ok(());
        };
        let middle = Some(self.place(point, [a, b], false)?);
        let [before, a, b, after] = places.clone();
        self.divide(&[before, a.clone(), middle.clone(), b.clone()], trials - 1)?;
        self.divide(&[a, middle, b, after], trials - 1)
    }

    /// A point between two others, whose error is at most theirs.
    pub fn place(&mut self, point: Point, [a, b]: [&Place; 2], zero: bool) -> Result<Place> {
        let estimate = a.estimate.larger(&b.estimate);
        let out = self.linearised(&point)?;
        let verdict = self.judge.judge(self.problem, &out, (&point).into(), &estimate, zero)?;
        Ok(Place { point, estimate, verdict, zero })
    }

    fn linearised(&mut self, point: &Point) -> Result<Linearisation> {
        let mut out = Linearisation::new(point.y().len());
        self.problem.set_parameter(point.p())?;
        self.problem.linearise_here(point.y(), &mut out)?;
        Ok(out)
    }

    fn motion(&mut self, point: &Point, level: usize) -> Result<Motion> {
        let out = self.linearised(point)?;
        self.judge.at_level(self.problem, &out, point.into(), level)
    }

    /// Roots that cross the imaginary axis otherwise than through zero, between two places of the branch.
    pub fn between(&mut self, a: &Place, b: &Place) -> Result<()> {
        let w0 = self.problem.base_frequency();
        let parts: Vec<usize> = a.exponents().changing().filter(|part| changes(a, b, *part, w0)).collect();
        parts.into_iter().try_for_each(|part| self.of_part(a, b, part))
    }

    /// Those of one part of the system.
    fn of_part(&mut self, a: &Place, b: &Place, part: usize) -> Result<()> {
        let w0 = self.problem.base_frequency();
        let segment = Segment::new(&a.point, &b.point, self.options);
        let settled = a.verdict.settled && b.verdict.settled;
        let mut found: Vec<(f64, c64)> = Vec::new();
        for rank in crossing_ranks(a.exponents().part(part), b.exponents().part(part), w0) {
            let Some((point, root)) = self.axis_crossing(a, b, (part, rank))? else {
                continue;
            };
            let at = segment.distance(&point);
            // the two of a conjugate pair grow alike
            let pair = |(other, s): &(f64, c64)| {
                (at - other).abs() <= EVENT_SOLVED.sqrt() * segment.length() && same_pair(*s, root.exponent)
            };
            if !found.iter().any(pair) {
                found.push((at, root.exponent));
                self.push(root, EXPONENT, settled);
            }
        }
        if found.is_empty() { self.border(a, b, part, settled) } else { Ok(()) }
    }

    /// The kind follows from where the root crosses, if it does so within a fraction of the base frequency.
    fn push(&mut self, Root { z, exponent, w0 }: Root, axis: f64, settled: bool) {
        let contact = self.problem.elements.iter().any(|element| element.force.has_contact());
        let kind = crossing(exponent, w0, axis, contact);
        let settled = settled && kind != Kind::Unresolved;
        self.found.push(Crossing { kind, z, exponent, settled });
    }

    /// Where the growth of the root with this rank vanishes or jumps through zero, and the root there: with twice as many harmonics until
    /// the root of that point is on the axis with twice as many again.
    fn axis_crossing(&mut self, a: &Place, b: &Place, (part, rank): Own) -> Result<Option<(Point, Root)>> {
        let w0 = self.problem.base_frequency();
        let crossed = [a, b].map(|place| ranked(place.exponents().part(part), rank)).into_iter().find(|s| s.re > 0.0);
        let through = crossed.and_then(|s| real_multiplier(s, w0));
        let side = |exponents: &Exponents, w0: f64| growth_side(exponents.part(part), rank, w0, through);
        let mut ends = [a, b].map(|place| (place.point.clone(), side(place.exponents(), w0)));
        let mut level = a.verdict.level.max(b.verdict.level);
        let mut found = self.zero(&ends, ((part, rank), &side), level)?;
        let truncated = a.verdict.truncated || b.verdict.truncated;
        while let Some(point) = found.as_ref().map(|(point, _)| point.clone()).filter(|_| truncated)
            && self.judge.has_level(level + 1, self.problem, &a.estimate)?
        {
            level += 1;
            let Motion { exponents, w0, .. } = self.motion(&point, level)?;
            let growth = ranked(exponents.part(part), rank).re;
            // also where there is no motion with so many harmonics
            if growth.is_nan() || growth.abs() <= NEUTRAL * w0 {
                break;
            }
            ends[usize::from(growth * ends[0].1 < 0.0)] = (point, side(&exponents, w0));
            found = self.zero(&ends, ((part, rank), &side), level)?.or(found);
        }
        Ok(found)
    }

    /// Where the growth of the root with this rank, told at both ends by its side, vanishes or jumps through zero with harmonics doubled so
    /// often.
    fn zero(
        &mut self,
        ends: &[(Point, f64); 2],
        ((part, rank), side): (Own, &impl Fn(&Exponents, f64) -> f64),
        level: usize,
    ) -> Result<Option<(Point, Root)>> {
        let [(a, first), (b, last)] = ends;
        let judge = &mut *self.judge;
        let growth = |problem: &mut Problem, point: &Point, out: &Linearisation| -> Result<(f64, Root)> {
            problem.set_parameter(point.p())?;
            let Motion { z, exponents, w0 } = judge.at_level(problem, out, point.into(), level)?;
            let exponent = ranked(exponents.part(part), rank);
            Ok((side(&exponents, w0), Root { z, exponent, w0 }))
        };
        Segment::new(a, b, self.options).zero(self.problem, self.work, self.cancel, (*first, *last), growth)
    }

    /// The border of stability between two places of which one has roots on the axis, as those of undamped systems are: there the
    /// growth has no sign that changes, so that the border is bracketed by the number of growing roots; with as many harmonics as
    /// there may be where the truncation moves them.
    fn border(&mut self, a: &Place, b: &Place, part: usize, settled: bool) -> Result<()> {
        let mut level = a.verdict.level.max(b.verdict.level);
        while (a.verdict.truncated || b.verdict.truncated)
            && self.judge.has_level(level + 1, self.problem, &a.estimate)?
        {
            level += 1;
        }
        let w0 = self.problem.base_frequency();
        let (first, mut known) = (unstable(a.exponents().part(part), w0), true);
        let judge = &mut *self.judge;
        let side = |problem: &mut Problem, point: &Point, out: &Linearisation| -> Result<f64> {
            problem.set_parameter(point.p())?;
            let found = judge.at_level(problem, out, point.into(), level)?;
            known &= found.exponents.is_known();
            let own = found.exponents.part(part);
            Ok(apart(own, found.w0) * if unstable(own, found.w0) == first { 1.0 } else { -1.0 })
        };
        let segment = Segment::new(&a.point, &b.point, self.options);
        let ends = (apart(a.exponents().part(part), w0), -apart(b.exponents().part(part), w0));
        let jump = segment.jump(self.problem, self.work, self.cancel, ends, side)?;
        let (Jump::Between { before, after, .. }, true) = (jump, known) else {
            return Ok(());
        };
        let (here, Motion { z, exponents, w0 }) = (self.motion(&before, level)?, self.motion(&after, level)?);
        let (here, there) = (ranked(here.exponents.part(part), 0), ranked(exponents.part(part), 0));
        let (calm, exponent) = if here.re <= there.re { (here, there) } else { (there, here) };
        // on the axis on one side and near it on the other, where two that meet part like the root of the distance: otherwise
        // the exponents jump
        let axis = if calm.re.abs() <= EXPONENT * w0 { EXPONENT.sqrt() } else { 0.0 };
        self.push(Root { z, exponent, w0 }, axis, settled);
        Ok(())
    }
}

/// Whether the number of growing exponents of a part changes between two places; the one that is zero at a fold or branch point does so
/// too, and does not count.
fn changes(a: &Place, b: &Place, part: usize, w0: f64) -> bool {
    let zero = |place: &Place| place.exponents().zero().filter(|(own, _)| place.zero && *own == part).map(|(_, i)| i);
    let others = |place: &Place| {
        let mut exponents = place.exponents().part(part).to_vec();
        if let Some(least) = zero(place) {
            exponents.swap_remove(least);
        }
        unstable(&exponents, w0) as i64
    };
    let change = others(a) - others(b);
    match (zero(a).is_some(), zero(b).is_some()) {
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
fn crossing_ranks(a: &[c64], b: &[c64], w0: f64) -> Vec<usize> {
    let signs = |rank: &usize| {
        let (x, y) = (ranked(a, *rank).re, ranked(b, *rank).re);
        x * y < 0.0 && x.abs().min(y.abs()) > NEUTRAL * w0
    };
    (0..a.len()).filter(signs).collect()
}

/// 1 or -1 where this is the multiplier's sign and it is real.
fn real_multiplier(s: c64, w0: f64) -> Option<f64> {
    let turn = s.im.abs() / w0;
    let near = |place: f64| (turn - place).abs() < RESONANT;
    if near(0.0) { Some(1.0) } else { near(0.5).then_some(-1.0) }
}

/// A value with the sign of the growth of the exponent with this rank, zero where it is on the axis. Where it crosses `through` a real
/// multiplier m, 1 or -1, the size is that of the product of m - mu over all multipliers mu, since two that have just met part like a root, which
/// no search for zeros likes, but not their product.
fn growth_side(exponents: &[c64], rank: usize, w0: f64, through: Option<f64>) -> f64 {
    let growth = ranked(exponents, rank).re;
    if growth.abs() <= CROSSED * w0 {
        return 0.0;
    }
    let Some(real) = through else { return growth };
    let multiplier = |s: &c64| (s * (std::f64::consts::TAU / w0)).exp();
    let size: f64 = exponents.iter().map(|s| (multiplier(s) - real).norm()).product();
    growth.signum() * size.min(f64::MAX.sqrt())
}

/// Whether two exponents are one, or conjugate.
fn same_pair(s: c64, other: c64) -> bool {
    (s.im.abs() - other.im.abs()).abs() <= SAME_PAIR * (s.im.abs() + other.im.abs())
}

/// How far the two exponents that meet at a border of stability are from each other, squared, in units of the base frequency: the one that
/// grows most, or the two nearest ones modulo i w0 where none grows. Along a branch it vanishes linearly at the border.
fn apart(exponents: &[c64], w0: f64) -> f64 {
    let most = ranked(exponents, 0);
    if most.re > NEUTRAL * w0 {
        return (2.0 * most.re / w0).powi(2);
    }
    let n = exponents.len();
    let gaps = (0..n).flat_map(|i| (0..i).map(move |j| gap(exponents[i], exponents[j], w0).norm() / w0));
    gaps.filter(|g| *g > 0.0).fold(1.0, f64::min).powi(2)
}

/// The exponent with this rank in the order of growth.
fn ranked(exponents: &[c64], rank: usize) -> c64 {
    let mut sorted = exponents.to_vec();
    sorted.sort_by(|a, b| b.re.total_cmp(&a.re));
    sorted.get(rank).copied().unwrap_or(c64::new(f64::NAN, 0.0))
}

/// The bifurcation where an exponent is on the imaginary axis; beside it a contact has made it jump, if there is one.
fn crossing(exponent: c64, w0: f64, axis: f64, contact: bool) -> Kind {
    if exponent.re.is_nan() || exponent.re.abs() > axis * w0 {
        if contact { Kind::Grazing } else { Kind::Unresolved }
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
        let kind = |re: f64, im: f64| crossing(c64::new(re * w0, im * w0), w0, EXPONENT, true);
        assert_eq!([1e-5, 1e-3].map(|im| kind(0.0, im)), [Kind::BranchPoint, Kind::NeimarkSacker]);
        assert_eq!([1e-5, 1e-3].map(|off| kind(0.0, 0.5 - off)), [Kind::PeriodDoubling, Kind::NeimarkSacker]);
        assert_eq!([1e-7, 1e-5].map(|re| kind(re, 0.0)), [Kind::BranchPoint, Kind::Grazing]);
        let smooth = [1e-5, f64::NAN].map(|re| crossing(c64::new(re * w0, 0.0), w0, EXPONENT, false));
        assert_eq!(smooth, [Kind::Unresolved; 2]);
    }

    /// Two exponents that meet at 0 and part like a root: the growth of one of them vanishes at d = c^2, where the side is a straight line.
    #[test]
    fn the_side_of_a_pair_that_has_just_met_is_smooth() {
        let (w0, c) = (3.7, 1e-3);
        let side = |d: f64, turn: f64| {
            let root = c64::new(d, 0.0).sqrt();
            let exponents = [-c + root, -c - root].map(|s| c64::new(s.re, s.im + turn));
            growth_side(&exponents, 0, w0, real_multiplier(exponents[0], w0))
        };
        for turn in [0.0, 0.5 * w0] {
            let [low, middle, high] = [-1e-8, 1e-8, 3e-8].map(|off| side(c * c + off, turn));
            assert!(
                low < 0.0 && middle > 0.0 && ((high - middle) / (middle - low) - 1.0).abs() < 1e-2,
                "{low} {middle} {high}"
            );
        }
        assert_eq!(side(c * c, 0.0), 0.0);
        assert_eq!(real_multiplier(c64::new(0.1, 0.3 * w0), w0), None);
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
