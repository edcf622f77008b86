//! Stability that the truncation of a periodic motion decides: where the estimated error of the motion may turn the growth of an
//! exponent, the exponents are those of a motion with twice as many harmonics, or four times, and the difference tells whether that is
//! enough.
//!
//! A change of the stiffness along the motion, of the mean size d = w.M^-1 w |dk| / n, moves two exponents whose difference is g by
//! (sqrt(g^2 + 4 d) - g) / 2: by d / g where they are far apart, by sqrt(d) where they meet, which they do modulo i w0. Two exponents
//! that turn at different speeds grow only when they have met. Source: T. Kato, Perturbation Theory for Linear Operators, Springer
//! 1995, II.1 (the two-dimensional case).
use num_complex::Complex64 as c64;

use super::aft::Aft;
use super::basis::Finer;
use super::estimate::Estimate;
use super::exponents::{Exponents, Own};
use super::problem::Problem;
use super::stability::{Floquet, Stability};
use crate::error::{Error, Result};
use crate::solve::corrector::{Options, Point, Workspace, across};
use crate::solve::{Curve as _, Linearisation, nan_or_largest};
use crate::tolerances::periodic::{DECIDED, MOST_REFINED, NEUTRAL, SYMMETRIC, TURNING};

/// A solution z = [y, p] and the direction of its branch; of a free motion that in which its phase changes.
#[derive(Clone, Copy)]
pub struct Solution<'a> {
    pub z: &'a [f64],
    pub along: &'a [f64],
}

impl<'a> From<&'a Point> for Solution<'a> {
    fn from(point: &'a Point) -> Self {
        Solution { z: &point.z, along: &point.tangent }
    }
}

impl Solution<'_> {
    fn y(&self) -> &[f64] {
        &self.z[..self.z.len() - 1]
    }
}

/// Exponents of one solution, and how far they are to be believed.
#[derive(Clone)]
pub struct Verdict {
    pub floquet: Floquet,
    /// the base frequency of the solution
    pub w0: f64,
    /// how often the harmonics were doubled for them
    pub level: usize,
    /// false where also those do not tell which exponents grow
    pub settled: bool,
    /// whether the harmonics that the motion leaves out may move a growth that is zero
    pub truncated: bool,
}

/// A solution with its exponents: z = [y, p], of which y has the terms of the problem only, however many the motion has.
#[derive(Default)]
pub struct Motion {
    pub z: Vec<f64>,
    pub exponents: Exponents,
    /// its base frequency
    pub w0: f64,
}

/// Tells exponents of the solutions of one problem.
pub struct Judge {
    stability: Stability,
    finer: Finer,
    options: Options,
    /// whether the motions are free, so that one exponent is zero
    free: bool,
    /// with twice as many harmonics, four times
    refined: Vec<Refined>,
    /// solutions with more harmonics
    pub refinements: u64,
}

impl Judge {
    pub fn new(stability: Stability, finer: &Finer, options: Options, free: bool) -> Judge {
        Judge { stability, finer: finer.clone(), options, free, refined: Vec::new(), refinements: 0 }
    }

    /// Dynamic stiffnesses of motions with more harmonics.
    pub fn factorisations(&self) -> u64 {
        self.refined.iter().map(|refined| refined.problem.factorisations).sum()
    }

    /// Newton steps to them.
    pub fn corrections(&self) -> u64 {
        self.refined.iter().map(|refined| refined.corrections).sum()
    }

    /// The exponents of a solution, with more harmonics where its error may turn one of them; `zero`: one of them is zero.
    pub fn judge(
        &mut self,
        problem: &mut Problem,
        out: &Linearisation,
        solution: Solution<'_>,
        estimate: &Estimate,
        zero: bool,
    ) -> Result<Verdict> {
        let floquet = self.stability.exponents(problem, out.jacobian.as_ref(), solution.y())?;
        let w0 = problem.base_frequency();
        let (unresolved, parts) =
            self.stability.deviate(problem, solution.y(), &estimate.deviations, floquet.by_hill)?;
        let mut floquet = Floquet { doubtful: unresolved, ..floquet };
        let changes: Vec<f64> = parts.iter().map(|change| TURNING * change).collect();
        let zero = zero || self.free;
        let mut settled = !may_turn(&floquet.exponents, &changes, w0, zero);
        let truncated = moves(&floquet.exponents, &changes, zero, |_| NEUTRAL * w0, w0);
        let mut level = 0;
        while !settled && self.has_level(level + 1, problem, estimate)? {
            let Some(motion) = self.refine(problem, solution, level + 1)? else {
                break;
            };
            // those of the same multipliers for the period of the solution
            let exponents = motion.exponents.scaled(w0 / motion.w0);
            // what the next doubling of the harmonics may still change
            let next = |(coarse, fine): (&Own, &Own)| DECIDED * change_between(&coarse.roots, &fine.roots, w0);
            let moved = floquet.exponents.0.iter().zip(&exponents.0).map(next);
            let changes: Vec<f64> = moved.zip(&parts).map(|(next, c)| if *c == 0.0 { 0.0 } else { next }).collect();
            settled = !may_turn(&exponents, &changes, w0, zero);
            floquet.exponents = exponents;
            level += 1;
        }
        Ok(Verdict { floquet, w0, level, settled, truncated })
    }

    /// Makes the problem with harmonics that are doubled so often; false where they are too many.
    pub fn has_level(&mut self, level: usize, problem: &Problem, estimate: &Estimate) -> Result<bool> {
        if self.refined.len() < level && level <= DOUBLINGS {
            self.refined.extend(Refined::new(problem, &self.finer, estimate, 1 << level)?);
        }
        Ok(self.refined.len() >= level)
    }

    /// A solution with harmonics that are doubled so often, without exponents where there is none.
    pub fn at_level(
        &mut self,
        problem: &mut Problem,
        out: &Linearisation,
        solution: Solution<'_>,
        level: usize,
    ) -> Result<Motion> {
        if level > 0 {
            return Ok(self.refine(problem, solution, level)?.unwrap_or_default());
        }
        let exponents = self.stability.exponents(problem, out.jacobian.as_ref(), solution.y())?.exponents;
        Ok(Motion { z: solution.z.to_vec(), exponents, w0: problem.base_frequency() })
    }

    fn refine(&mut self, problem: &mut Problem, solution: Solution<'_>, level: usize) -> Result<Option<Motion>> {
        let Some(refined) = self.refined.get_mut(level - 1) else {
            return Ok(None);
        };
        self.refinements += 1;
        let Some(point) = refined.solution(problem, solution, self.options)? else {
            return Ok(None);
        };
        self.stability.renew(problem)?;
        let exponents = self.stability.integrated(&mut refined.problem, point.y(), &mut refined.samplers)?;
        // `extended` keeps the order of the old terms
        let own = &point.y()[..problem.size()];
        let z = own.iter().copied().chain([point.p()]).collect();
        Ok(Some(Motion { z, exponents, w0: refined.problem.base_frequency() }))
    }
}

/// How often harmonics are doubled.
const DOUBLINGS: usize = 2;

/// The problem with more harmonics.
struct Refined {
    problem: Problem,
    samplers: Vec<Aft>,
    corrections: u64,
    /// the last solution [y, p], less the one of few harmonics that it was found from
    change: Option<Vec<f64>>,
}

impl Refined {
    /// Up to a multiple of the highest harmonic; even ones only where the motion or its error has some. None where there are too many.
    fn new(problem: &Problem, finer: &Finer, estimate: &Estimate, factor: i32) -> Result<Option<Refined>> {
        let own = &problem.basis.indices;
        let top = factor * (own.iter().map(|k| k[0]).max().unwrap_or(0) + 1);
        let even = own.iter().any(|k| k[0] % 2 == 0) || is_uneven(estimate);
        let wanted = (1..=top).filter(|h| even || h % 2 == 1).map(|h| vec![h]);
        let extra: Vec<Vec<i32>> = wanted.filter(|k| !own.contains(k)).collect();
        let basis = problem.basis.extended(&extra);
        if problem.n() * basis.n_coefficients() > MOST_REFINED {
            return Ok(None);
        }
        let dims: Vec<usize> = finer.dims.iter().map(|n| factor as usize * n).collect();
        let problem = problem.on(basis, &dims)?;
        Ok(Some(Refined { problem, samplers: Vec::new(), corrections: 0, change: None }))
    }

    /// The solution in the plane through another one across its branch: also at a fold, where none may exist at the same parameter. It is
    /// looked for where the harmonics change the motion as they changed the last one, or at the other solution itself.
    fn solution(&mut self, problem: &Problem, from: Solution<'_>, options: Options) -> Result<Option<Point>> {
        self.problem.follow(problem)?;
        let n = self.problem.size();
        let padded = |z: &[f64]| {
            let mut out = vec![0.0; n + 1];
            out[..z.len() - 1].copy_from_slice(&z[..z.len() - 1]);
            out[n] = z[z.len() - 1];
            out
        };
        let (z, along) = (padded(from.z), padded(from.along));
        let mut work = Workspace::new(n);
        let near = self.change.take().map(|change| z.iter().zip(&change).map(|(z, c)| z + c).collect::<Vec<f64>>());
        let mut found = None;
        for start in near.as_ref().into_iter().chain([&z]) {
            found = match across(&mut self.problem, &mut work, (&z, &along), start, &options) {
                Err(Error::Singular(_)) => None,
                other => other?,
            };
            if found.is_some() {
                break;
            }
        }
        self.corrections += work.corrections;
        self.change = found.as_ref().map(|point| point.z.iter().zip(&z).map(|(f, z)| f - z).collect());
        Ok(found)
    }
}

/// The two halves of the period differ: the motion has even harmonics, not their rounding.
fn is_uneven(estimate: &Estimate) -> bool {
    estimate.even > SYMMETRIC * estimate.error
}

/// Whether changes of the stiffness, one for each part of the system, may turn the growth of an exponent.
fn may_turn(exponents: &Exponents, changes: &[f64], w0: f64, zero: bool) -> bool {
    moves(exponents, changes, zero, |s| s.re.abs().max(NEUTRAL * w0), w0)
}

/// Whether they may change the growth of an exponent by what its `margin` is; `zero`: the exponent that is zero does not count.
fn moves(exponents: &Exponents, changes: &[f64], zero: bool, margin: impl Fn(c64) -> f64, w0: f64) -> bool {
    let zero = exponents.zero().filter(|_| zero);
    changes.iter().enumerate().any(|(part, &change)| {
        let own = exponents.part(part);
        let reaches = |i: usize| {
            let largest = largest_shift(own, i, change, w0);
            largest.is_nan() || largest >= margin(own[i])
        };
        change != 0.0 && (0..own.len()).filter(|i| Some((part, *i)) != zero).any(reaches)
    })
}

/// Change of the growth of one exponent by the others of its part of the system.
fn largest_shift(own: &[c64], i: usize, change: f64, w0: f64) -> f64 {
    nan_or_largest((0..own.len()).filter(|j| *j != i).map(|j| shift(gap(own[i], own[j], w0), change)))
}

/// Change of the growth of two exponents with this difference, by a change of either sign.
fn shift(gap: c64, change: f64) -> f64 {
    let growth = |d: f64| (gap * gap + 4.0 * d).sqrt().re - gap.re.abs();
    0.5 * nan_or_largest([change, -change].into_iter().map(|d| growth(d).abs()))
}

/// Difference of two exponents modulo i w0.
pub(super) fn gap(s: c64, other: c64, w0: f64) -> c64 {
    let turn = (s.im - other.im) / w0;
    c64::new(s.re - other.re, w0 * (turn - turn.round()))
}

/// The change of the stiffness that moves exponents to others.
fn change_between(coarse: &[c64], fine: &[c64], w0: f64) -> f64 {
    let nearest = |s: c64, others: &[c64], own: Option<usize>| {
        let apart = |j: usize| gap(s, others[j], w0).norm();
        (0..others.len()).filter(|j| Some(*j) != own).map(apart).fold(w0, f64::min)
    };
    let one = |i: usize| {
        let moved = nearest(coarse[i], fine, None);
        moved * (moved + nearest(coarse[i], coarse, Some(i)))
    };
    nan_or_largest((0..coarse.len()).map(one))
}

#[cfg(test)]
mod tests {
    use super::*;

    const W0: f64 = 2.7;

    fn in_parts(parts: &[Vec<c64>]) -> Exponents {
        Exponents(parts.iter().map(|roots| Own { roots: roots.clone(), constant: false }).collect())
    }

    fn may_turn(exponents: &[c64], change: f64, w0: f64, free: bool) -> bool {
        super::may_turn(&in_parts(&[exponents.to_vec()]), &[change], w0, free)
    }

    fn pair(re: f64, im: f64) -> Vec<c64> {
        vec![c64::new(re, im), c64::new(re, -im)]
    }

    #[test]
    fn growth_turns_where_exponents_meet() {
        // s^2 + c s + k = 0 turns at k = 0
        let (c, k) = (0.1_f64, 0.02);
        let im = (k - 0.25 * c * c).sqrt();
        let turn = |change: f64| may_turn(&pair(-0.5 * c, im), change, W0, false);
        assert_eq!([0.99 * k, 1.01 * k].map(turn), [false, true]);
        // the same modulo i w0, and beside half of it
        let half = |change: f64| may_turn(&pair(-0.5 * c, 0.5 * W0 + im), change, W0, false);
        assert_eq!([0.99 * k, 1.01 * k].map(half), [false, true]);
        let saddle = |change: f64| may_turn(&[c64::new(0.1, 0.0), c64::new(-0.2, 0.0)], change, W0, false);
        assert_eq!([0.99 * 0.02, 1.01 * 0.02].map(saddle), [false, true]);
        let undamped = |change: f64| may_turn(&pair(0.0, 0.3), change, W0, false);
        assert_eq!([0.08, 0.1, f64::NAN].map(undamped), [false, true, true]);
    }

    /// A pair on the axis far from another one, which it meets at no change that is small: it moves, though nothing turns it.
    #[test]
    fn a_crossing_moves_by_changes_that_turn_no_exponent() {
        let exponents = [pair(-0.02, 0.6), pair(-0.3, 1.1)].concat();
        let whole = in_parts(&[exponents.to_vec()]);
        let moved = |change: f64| moves(&whole, &[change], false, |_| NEUTRAL * W0, W0);
        assert!(!may_turn(&exponents, 1e-3, W0, false));
        assert_eq!([0.0, 1e-10, 1e-7].map(moved), [false, false, true]);
    }

    /// Never less, and little more where a pair meets.
    #[test]
    fn the_change_between_two_pairs_moves_one_to_the_other() {
        let pair_of = |k: f64| {
            let root = c64::new(0.0025 - k, 0.0).sqrt();
            vec![-0.05 + root, -0.05 - root]
        };
        for (a, b) in [(0.02, 0.05), (0.05, 0.02), (-0.1, -0.3), (-0.3, -0.1), (-0.01, 0.01)] {
            let found = change_between(&pair_of(a), &pair_of(b), W0);
            let exact = f64::abs(b - a);
            assert!((0.999 * exact..3.0 * exact).contains(&found), "{a} {b}: {found}");
        }
    }

    #[test]
    fn even_harmonics_of_a_millionth_of_the_error_are_rounding() {
        let uneven = |even: f64| is_uneven(&Estimate { error: 1e-3, even: 1e-3 * even, ..Estimate::default() });
        assert_eq!([1e-7, 1e-5].map(uneven), [false, true]);
    }

    #[test]
    fn parts_of_a_system_turn_by_themselves() {
        let parts = [pair(-0.05, 0.6), pair(-0.06, 0.6)];
        assert!(may_turn(&parts.concat(), 0.05, W0, false));
        assert!(!super::may_turn(&in_parts(&parts), &[0.05, 0.05], W0, false));
    }

    #[test]
    fn the_exponent_of_a_free_phase_does_not_count() {
        let exponents = [c64::new(1e-6, 0.0), c64::new(-0.5, 0.0)];
        assert!(may_turn(&exponents, 1e-3, W0, false) && !may_turn(&exponents, 1e-3, W0, true));
    }
}
