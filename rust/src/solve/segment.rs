//! Points between two neighbours of a branch: where a function along the branch vanishes, or where it jumps.
use super::bracket::Bracket;
use super::corrector::{Corrector, Options, Point, Target, Workspace, correct, scaled};
use super::{Curve, Linearisation};
use crate::error::Result;
use crate::run::Cancel;
use crate::tolerances::roots::{EVENT_SOLVED, NARROW, NARROWED};

/// The branch between two points, parametrised by the distance s along the tangent of the first. Every trial is corrected onto the
/// branch, so that what comes back is a solution as well.
pub struct Segment {
    scale: Vec<f64>,
    centre: Vec<f64>,
    direction: Vec<f64>,
    far: Vec<f64>,
    length: f64,
    ends: (Point, Point),
    options: Options,
}

/// Trials after which a bracket is taken as it is.
const MOST_TRIALS: usize = 60;

/// A place on the segment: distance, value of the function, scaled unknowns.
type Place = (f64, f64, Vec<f64>);

impl Segment {
    pub fn new(a: &Point, b: &Point, options: Options) -> Segment {
        let scale = a.scale.clone();
        let centre = scaled(&a.z, &scale);
        let direction = scaled(&a.tangent, &scale);
        let far = scaled(&b.z, &scale);
        let length = far.iter().zip(&centre).zip(&direction).map(|((f, c), d)| (f - c) * d).sum();
        let options = Options { tolerance: options.tolerance.min(EVENT_SOLVED), ..options };
        Segment { scale, centre, direction, far, length, ends: (a.clone(), b.clone()), options }
    }

    pub fn length(&self) -> f64 {
        self.length.abs()
    }

    /// How far along the segment a point lies.
    pub fn distance(&self, point: &Point) -> f64 {
        scaled(&point.z, &self.scale).iter().zip(&self.centre).zip(&self.direction).map(|((x, c), d)| (x - c) * d).sum()
    }

    /// The solution at the distance s, started between two places.
    fn at(
        &self,
        curve: &mut dyn Curve,
        work: &mut Workspace,
        s: f64,
        low: &Place,
        high: &Place,
    ) -> Result<Option<Point>> {
        let t = (s - low.0) / (high.0 - low.0);
        let start = low.2.iter().zip(&high.2).map(|(l, h)| l + t * (h - l)).collect();
        let target = Target {
            scale: &self.scale,
            centre: &self.centre,
            direction: &self.direction,
            distance: s,
            corrector: Corrector::PseudoArclength,
        };
        correct(curve, work, &target, start, &self.options)
    }

    /// The solution at the first of some fractions of the way between two places where the corrector succeeds.
    fn between(
        &self,
        curve: &mut dyn Curve,
        work: &mut Workspace,
        fractions: &[f64],
        low: &Place,
        high: &Place,
    ) -> Result<Option<(f64, Point)>> {
        for t in fractions {
            let s = low.0 + t * (high.0 - low.0);
            if let Some(point) = self.at(curve, work, s, low, high)? {
                return Ok(Some((s, point)));
            }
        }
        Ok(None)
    }

    /// The solution at a fraction of the way.
    pub fn point(&self, curve: &mut dyn Curve, work: &mut Workspace, fraction: f64) -> Result<Option<Point>> {
        let low = (0.0, 0.0, self.centre.clone());
        let high = (self.length, 0.0, self.far.clone());
        Ok(self.between(curve, work, &[fraction], &low, &high)?.map(|(_, point)| point))
    }

    /// Zero of the first value of `f`, which has opposite signs at the ends, or where it jumps through zero, and the second value there;
    /// None where it was not closed in. `f` also sees the linearisation at the trial.
    pub fn zero<C: Curve, T>(
        &self,
        curve: &mut C,
        work: &mut Workspace,
        cancel: &Cancel,
        ends: (f64, f64),
        mut f: impl FnMut(&mut C, &Point, &Linearisation) -> Result<(f64, T)>,
    ) -> Result<Option<(Point, T)>> {
        let mut bracket = Bracket::new((0.0, ends.0, self.centre.clone()), (self.length, ends.1, self.far.clone()));
        let apart = 0.5 * EVENT_SOLVED * self.length();
        let mut best: Option<(f64, Point, T)> = None;
        for _ in 0..MOST_TRIALS {
            cancel.check()?;
            let s = bracket.next(apart);
            let [one, other] = bracket.ends();
            let fraction = (s - one.0) / (other.0 - one.0);
            let Some((s, point)) = self.between(curve, work, &[fraction, 0.5, 0.37, 0.71], one, other)? else {
                return Ok(None);
            };
            let (value, there) = f(curve, &point, &work.out)?;
            if !value.is_finite() {
                return Ok(None);
            }
            bracket.add((s, value, scaled(&point.z, &self.scale)));
            if best.as_ref().is_none_or(|(least, ..)| value.abs() <= *least) {
                best = Some((value.abs(), point, there));
            }
            if bracket.width() <= 2.0 * apart || value.abs() <= EVENT_SOLVED * ends.0.abs().max(ends.1.abs()) {
                break;
            }
        }
        Ok(best.map(|(_, point, there)| (point, there)))
    }

    /// Where the sign of `side`, which is positive at the first end, turns: for properties that jump, such as the sign of a determinant. Its
    /// size only tells where to look: where it vanishes towards the border fewer trials are needed.
    pub fn jump<C: Curve>(
        &self,
        curve: &mut C,
        work: &mut Workspace,
        cancel: &Cancel,
        ends: (f64, f64),
        mut side: impl FnMut(&mut C, &Point, &Linearisation) -> Result<f64>,
    ) -> Result<Jump> {
        let mut bracket = Bracket::new((0.0, ends.0, self.centre.clone()), (self.length, ends.1, self.far.clone()));
        let (mut before, mut after) = self.ends.clone();
        for _ in 0..MOST_TRIALS {
            cancel.check()?;
            if bracket.width() <= NARROW * self.length() {
                break;
            }
            let s = bracket.next(0.5 * NARROW * self.length());
            let [one, other] = bracket.ends();
            let fraction = (s - one.0) / (other.0 - one.0);
            // the corrector may fail at the point itself, where the equations are singular, but not also beside it
            let found = self.between(curve, work, &[fraction, 0.5, 0.37, 0.71], one, other)?;
            let Some((s, point)) = found else {
                break;
            };
            let value = side(curve, &point, &work.out)?;
            bracket.add((s, value, scaled(&point.z, &self.scale)));
            *(if value < 0.0 { &mut after } else { &mut before }) = point;
        }
        let [low, high] = bracket.ends();
        let gap = low.2.iter().zip(&high.2).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt();
        // on one branch the two sides approach each other as s does, but for what is left of solutions where a row is singular
        let narrowed = (high.0 - low.0).abs() < NARROWED * self.length.abs();
        if !narrowed || gap > 10.0 * (high.0 - low.0).abs() + EVENT_SOLVED.sqrt() {
            return Ok(Jump::Torn);
        }
        let width = (high.0 - low.0).abs() / self.length.abs();
        Ok(Jump::Between { before: Box::new(before), after: Box::new(after), width })
    }
}

/// What lies between two points with different properties.
pub enum Jump {
    /// the last points on both sides, and how far apart they are relative to the segment
    Between { before: Box<Point>, after: Box<Point>, width: f64 },
    /// the points belong to different branches
    Torn,
}
