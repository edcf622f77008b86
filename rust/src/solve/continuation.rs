//! Branches of R(y, p) = 0 by predictor and corrector, in a space where the present solution has length one.
//!
//! The scaling is renewed at every point; the direction is kept by t_k . t_{k-1} > 0 there, never by the sign of dp or of a
//! determinant. Texts: E. L. Allgower, K. Georg, Introduction to Numerical Continuation Methods (SIAM 2003), chapters 2 to 6.
use std::collections::VecDeque;

use super::Curve;
use super::corrector::{Corrector, Options, Point, Predictor, Target, Workspace, across, correct, dot, scaled};
use super::segment::Segment;
use crate::error::Result;
use crate::run::Cancel;

/// Why a branch cannot go on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Advance {
    Moved,
    /// the least step does not converge either
    Stalled,
}

/// A branch that is stepped: the points it keeps are those its predictor needs.
pub struct Branch {
    pub options: Options,
    pub step: f64,
    pub work: Workspace,
    history: VecDeque<Point>,
}

impl Branch {
    /// Starts at a solution and goes where the tangent has a positive product with `towards`, a step [dy, dp].
    pub fn start(
        curve: &mut dyn Curve,
        y: &[f64],
        p: f64,
        towards: &[f64],
        options: Options,
    ) -> Result<Option<Branch>> {
        let n = y.len();
        let mut work = Workspace::new(n);
        let mut z = y.to_vec();
        z.push(p);
        let Some(point) = across(curve, &mut work, (&z, towards), &z, &options)? else {
            return Ok(None);
        };
        Ok(Some(Branch { step: options.first_step, options, work, history: VecDeque::from([point]) }))
    }

    /// The step that leaves y alone and moves p.
    pub fn along_parameter(n: usize, direction: f64) -> Vec<f64> {
        let mut towards = vec![0.0; n + 1];
        towards[n] = direction;
        towards
    }

    pub fn point(&self) -> &Point {
        &self.history[0]
    }

    pub fn previous(&self) -> Option<&Point> {
        self.history.get(1)
    }

    /// Takes one step, as long as the corrector allows.
    pub fn advance(&mut self, curve: &mut dyn Curve, cancel: &Cancel) -> Result<Advance> {
        loop {
            cancel.check()?;
            if let Some(mut point) = self.attempt(curve)? {
                point.step = self.step;
                self.step = (self.step * growth(point.iterations, self.turn(&point))).min(self.options.largest_step);
                self.history.push_front(point);
                self.history.truncate(self.options.predictor.points().max(RETREAT));
                return Ok(Advance::Moved);
            }
            self.step *= 0.5;
            if self.step < self.options.least_step {
                self.step = self.options.least_step;
                return Ok(Advance::Stalled);
            }
        }
    }

    fn attempt(&mut self, curve: &mut dyn Curve) -> Result<Option<Point>> {
        let here = &self.history[0];
        let centre = scaled(&here.z, &here.scale);
        let direction = scaled(&here.tangent, &here.scale);
        let start = self.predict(&centre, &direction);
        let target = Target {
            scale: &here.scale,
            centre: &centre,
            direction: &direction,
            distance: self.step,
            corrector: self.options.corrector,
        };
        let options = self.options;
        let Some(point) = correct(curve, &mut self.work, &target, start.clone(), &options)? else {
            return Ok(None);
        };
        // a correction as long as the step, or a sharp turn, means that another branch was hit or a corner was cut
        let found = scaled(&point.z, &self.history[0].scale);
        let moved: f64 = found.iter().zip(&start).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt();
        let may_shrink = self.step > 4.0 * self.options.least_step;
        let jumped = moved > self.step || self.turn(&point) < 0.5;
        Ok((!(jumped && may_shrink)).then_some(point))
    }

    /// Cosine between the tangents of the present point and of a new one.
    fn turn(&self, point: &Point) -> f64 {
        let here = &self.history[0];
        let (a, b) = (scaled(&here.tangent, &here.scale), scaled(&point.tangent, &here.scale));
        dot(&a, &b) / dot(&b, &b).sqrt()
    }

    fn predict(&self, centre: &[f64], direction: &[f64]) -> Vec<f64> {
        let along = |d: &[f64]| -> Vec<f64> { centre.iter().zip(d).map(|(c, d)| c + self.step * d).collect() };
        let known = self.history.len().min(self.options.predictor.points());
        if known < 2 {
            return along(direction);
        }
        let scale = &self.history[0].scale;
        let old: Vec<Vec<f64>> = self.history.iter().take(known).map(|p| scaled(&p.z, scale)).collect();
        let gap =
            |i: usize| -> f64 { old[i].iter().zip(&old[i + 1]).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt() };
        if self.options.predictor == Predictor::Secant {
            let length = gap(0);
            let secant: Vec<f64> = old[0].iter().zip(&old[1]).map(|(a, b)| (a - b) / length).collect();
            return along(&secant);
        }
        let mut s = vec![0.0];
        (0..known - 1).for_each(|i| s.push(s[i] - gap(i)));
        extrapolated(&s, &old, self.step)
    }

    /// The point at parameter p between the last two points, for landing on the end of a range.
    pub fn land(&mut self, curve: &mut dyn Curve, p: f64) -> Result<Option<Point>> {
        let here = &self.history[0];
        let n = here.z.len() - 1;
        let mut start = scaled(&here.z, &here.scale);
        if let Some(before) = self.history.get(1) {
            let fraction = (p - before.p()) / (here.p() - before.p());
            let old = scaled(&before.z, &here.scale);
            start.iter_mut().zip(&old).for_each(|(x, o)| *x = o + fraction * (*x - o));
        }
        start[n] = p / here.scale[n];
        let mut along = vec![0.0; n + 1];
        along[n] = here.p_slope().signum();
        let target = Target {
            scale: &here.scale,
            centre: &start,
            direction: &along,
            distance: 0.0,
            corrector: Corrector::PseudoArclength,
        };
        let options = self.options;
        let found = correct(curve, &mut self.work, &target, start.clone(), &options)?;
        Ok(found.map(|mut point| {
            point.z[n] = p; // scaling there and back may have moved it by a rounding
            point
        }))
    }

    /// Takes the last step back; the next one is at most a quarter of it. False at the least step.
    pub fn retreat(&mut self) -> bool {
        let Some(point) = self.history.pop_front() else {
            return false;
        };
        self.step = (0.25 * point.step).max(self.options.least_step);
        point.step > self.options.least_step && !self.history.is_empty()
    }

    /// Puts a landed point in the place of the last one.
    pub fn replace(&mut self, mut point: Point) {
        point.step = self.history[0].step;
        self.history[0] = point;
    }

    /// The segment between the last two points, on which events are looked for.
    pub fn segment(&self) -> Option<Segment> {
        let (a, b) = (self.history.get(1)?, &self.history[0]);
        Some(Segment::new(a, b, self.options))
    }
}

/// Points that are kept for steps back, whatever the predictor reads.
const RETREAT: usize = 4;

/// The polynomial through the points x(s_i), in the form of Lagrange, at s.
fn extrapolated(s: &[f64], x: &[Vec<f64>], at: f64) -> Vec<f64> {
    let others = |i: usize| (0..s.len()).filter(move |l| *l != i);
    let weights: Vec<f64> = (0..s.len()).map(|i| others(i).map(|l| (at - s[l]) / (s[i] - s[l])).product()).collect();
    (0..x[0].len()).map(|c| weights.iter().zip(x).map(|(w, x)| w * x[c]).sum()).collect()
}

/// Factor on the step: three linearisations are what a good step needs; a turning branch is not stepped over faster.
fn growth(iterations: usize, turn: f64) -> f64 {
    let by_iterations = match iterations {
        0..=2 => 2.0,
        3 => 1.5,
        4 => 1.0,
        5 => 0.7,
        _ => 0.5,
    };
    // 25 degrees and more between neighbours make a poor plot and a poor predictor
    let by_turn = if turn > 0.97 {
        2.0
    } else if turn > 0.9 {
        1.0
    } else {
        0.6
    };
    f64::min(by_iterations, by_turn)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::solve::Linearisation;
    use crate::solve::segment::Jump;

    /// The circle y^2 + p^2 = 1, and the pitchfork y (p - y^2) = 0.
    struct Plane(fn(f64, f64) -> [f64; 3]);

    impl Curve for Plane {
        fn size(&self) -> usize {
            1
        }

        fn linearise(&mut self, y: &[f64], p: f64, out: &mut Linearisation) -> Result<()> {
            let [r, r_y, r_p] = (self.0)(y[0], p);
            out.residual[0] = r;
            out.jacobian[(0, 0)] = r_y;
            out.slope[0] = r_p;
            Ok(())
        }

        fn scale(&self, _: &[f64], out: &mut [f64]) {
            out[0] = 1.0;
        }

        fn row_excess(&mut self, y: &[f64], p: f64, tolerance: f64) -> Result<f64> {
            Ok((self.0)(y[0], p)[0].abs() / tolerance)
        }
    }

    fn options(predictor: Predictor, corrector: Corrector) -> Options {
        Options {
            predictor,
            corrector,
            tolerance: 1e-10,
            max_corrections: 8,
            first_step: 0.01,
            least_step: 1e-8,
            largest_step: 0.1,
            parameter_scale: 1.0,
        }
    }

    #[test]
    fn a_circle_is_followed_all_around() {
        let orders = (1..=5).map(Predictor::Lagrange);
        for predictor in [Predictor::Tangent, Predictor::Secant].into_iter().chain(orders) {
            for corrector in [Corrector::PseudoArclength, Corrector::Arclength, Corrector::MoorePenrose] {
                let mut circle = Plane(|y, p| [y * y + p * p - 1.0, 2.0 * y, 2.0 * p]);
                let mut branch = Branch::start(&mut circle, &[0.8], 0.6, &[0.0, 1.0], options(predictor, corrector))
                    .unwrap()
                    .unwrap();
                let mut folds = Vec::new();
                let mut angle = 0.0;
                while angle < std::f64::consts::TAU {
                    let before = branch.point().clone();
                    assert_eq!(branch.advance(&mut circle, &Cancel::default()).unwrap(), Advance::Moved);
                    let after = branch.point().clone();
                    assert_eq!(after.orientation, before.orientation);
                    angle += (before.z[0] * after.z[1] - before.z[1] * after.z[0]).asin();
                    let ends = (before.p_slope(), after.p_slope());
                    if ends.0 * ends.1 < 0.0 {
                        let segment = branch.segment().unwrap();
                        let (work, cancel) = (&mut branch.work, Cancel::default());
                        let fold = segment.zero(&mut circle, work, &cancel, ends, |_, p, _| Ok((p.p_slope(), ())));
                        folds.push(fold.unwrap().unwrap().0);
                    }
                }
                assert_eq!(folds.len(), 2, "{predictor:?} {corrector:?}");
                for fold in folds {
                    assert!((fold.p().abs() - 1.0).abs() < 1e-12 && fold.z[0].abs() < 1e-11, "{fold:?}");
                }
            }
        }
    }

    /// Through k + 1 uneven points of a polynomial of order k; a polynomial of the next order is missed.
    #[test]
    fn a_polynomial_of_its_order_is_continued_exactly() {
        let s = [0.0, -0.31, -0.47, -1.13, -1.29, -1.9];
        let polynomial = |order: usize, s: f64| (0..order).fold(0.3, |y, k| y * s + 1.7 - 0.6 * k as f64);
        for order in 1..=5 {
            let points = |degree: usize| -> Vec<Vec<f64>> {
                s[..=order].iter().map(|s| vec![polynomial(degree, *s), -2.0 * polynomial(order, *s)]).collect()
            };
            // the sum of the absolute terms of Lagrange's form: a few roundings of it are what may be off
            let weight = |i: usize| -> f64 {
                let others = (0..=order).filter(|j| *j != i);
                others.map(|j| (0.4 - s[j]) / (s[i] - s[j])).product()
            };
            let terms: f64 = (0..=order).map(|i| (weight(i) * polynomial(order, s[i])).abs()).sum();
            let rounding = 16.0 * f64::EPSILON * terms;
            let off = |degree: usize| {
                let found = extrapolated(&s[..=order], &points(degree), 0.4);
                assert!((found[1] + 2.0 * polynomial(order, 0.4)).abs() < 2.0 * rounding);
                (found[0] - polynomial(degree, 0.4)).abs()
            };
            assert!(off(order) < rounding, "{order}: {} of {rounding}", off(order));
            assert!(off(order + 1) > 1e-3, "{order}: {}", off(order + 1));
        }
    }

    /// A line on which no equation has a value within a gap, of which a jump within the gap is known by its sides alone.
    #[test]
    fn the_sides_of_a_gap_are_one_branch_where_it_is_narrower_than_a_thousandth() {
        let torn = |mut curve: Plane| {
            let options = Options { first_step: 0.1, ..options(Predictor::Tangent, Corrector::PseudoArclength) };
            let mut branch = Branch::start(&mut curve, &[0.0], 0.0, &[0.0, 1.0], options).unwrap().unwrap();
            assert_eq!(branch.advance(&mut curve, &Cancel::default()).unwrap(), Advance::Moved);
            let segment = branch.segment().unwrap();
            let before = |_: &mut Plane, p: &Point, _: &Linearisation| Ok(0.05 - p.p());
            let cancel = Cancel::default();
            let found = segment.jump(&mut curve, &mut branch.work, &cancel, (0.05, -0.05), before).unwrap();
            matches!(found, Jump::Torn)
        };
        assert!(torn(Plane(|y, p| [y - 0.3 * p + if (p - 0.05).abs() < 5e-4 { f64::NAN } else { 0.0 }, 1.0, -0.3])));
        assert!(!torn(Plane(|y, p| [y - 0.3 * p + if (p - 0.05).abs() < 5e-6 { f64::NAN } else { 0.0 }, 1.0, -0.3])));
    }

    #[test]
    fn a_jump_is_bracketed_to_a_billionth_of_its_segment() {
        let mut line = Plane(|y, p| [y - 0.3 * p, 1.0, -0.3]);
        let options = Options { first_step: 0.1, ..options(Predictor::Tangent, Corrector::PseudoArclength) };
        let mut branch = Branch::start(&mut line, &[0.0], 0.0, &[0.0, 1.0], options).unwrap().unwrap();
        assert_eq!(branch.advance(&mut line, &Cancel::default()).unwrap(), Advance::Moved);
        let segment = branch.segment().unwrap();
        let side = |_: &mut Plane, p: &Point, _: &Linearisation| Ok(if p.p() < 0.0512 { 1.0 } else { -1.0 });
        let found = segment.jump(&mut line, &mut branch.work, &Cancel::default(), (1.0, -1.0), side).unwrap();
        let Jump::Between { before, after, width } = found else { panic!("torn") };
        assert!(before.p() < 0.0512 && after.p() >= 0.0512 && (1e-10..=1e-9).contains(&width), "{width:e}");
    }

    #[test]
    fn the_orientation_changes_at_a_branch_point_only() {
        let mut pitchfork = Plane(|y, p| [y * (p - y * y), p - 3.0 * y * y, y]);
        let chosen = options(Predictor::Tangent, Corrector::PseudoArclength);
        let mut branch = Branch::start(&mut pitchfork, &[0.0], -0.55, &[0.0, 1.0], chosen).unwrap().unwrap();
        let first = branch.point().orientation;
        while branch.point().p() < 0.3 {
            branch.advance(&mut pitchfork, &Cancel::default()).unwrap();
            let point = branch.point();
            assert_eq!(point.orientation * first, if point.p() < 0.0 { 1.0 } else { -1.0 });
        }
    }
}
