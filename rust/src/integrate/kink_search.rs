//! The search for the length of a step that ends at a kink.
//!
//! The distance from a kink at the end of a step is a function of the length of the step. Its zero follows from the slope that the motion within
//! the first step has at the kink, and where that leads out of what is known, by the rule of false position with the weights of Illinois.

/// Bounds of a guess by false position in the rest of the step, so that its ends move.
const EDGE: f64 = 0.01;
/// Guesses by slopes; then they are not those of the steps.
const BY_SLOPE: usize = 4;

/// A fraction or the length of a step, and the distances there.
pub(super) type Place = (f64, Vec<f64>);

/// Lengths and distances of steps that end before and behind a kink.
pub(super) struct Search {
    pub from: f64,
    /// kinks that steps of some length pass
    pub targets: Vec<usize>,
    pub before: Place,
    pub behind: Place,
    /// rates of the distances near the kink, by the motion within the first step
    slopes: Vec<f64>,
    /// weights of the distances, and which end moved last
    weights: [f64; 2],
    moved: Option<bool>,
    pub tries: usize,
    /// tries with both ends at the kink but for the noise of steps
    pub near: usize,
    /// distances do not come nearer to zero: the step before is the one
    pub is_last: bool,
    /// kinks that the last step ended so near to that no error shows it
    pub found: Vec<usize>,
}

/// Where a distance is zero between two of different sign, as a part; the middle where they have the same one.
fn zero_between(f0: f64, f1: f64) -> f64 {
    if f0 * f1 < 0.0 { f0 / (f0 - f1) } else { 0.5 }
}

/// The first zero of some distances between two places.
pub(super) fn first_zero((x0, d0): &Place, (x1, d1): &Place, left: &[usize]) -> f64 {
    let first = left.iter().map(|k| zero_between(d0[*k], d1[*k])).fold(1.0, f64::min);
    x0 + first.clamp(EDGE, 1.0 - EDGE) * (x1 - x0)
}

/// The first zero of some distances on the line through two places.
pub(super) fn secant((x0, d0): &Place, (x1, d1): &Place, left: &[usize]) -> f64 {
    let zero = |k: &usize| x1 - d1[*k] * (x1 - x0) / (d1[*k] - d0[*k]);
    left.iter().map(zero).fold(f64::INFINITY, f64::min)
}

impl Search {
    /// From a time, between a step of no length and one that ends behind; `near`: places in the step about the kink, as parts of it.
    pub fn new(from: f64, before: Place, behind: Place, near: [&Place; 2], targets: Vec<usize>) -> Self {
        let [(x0, d0), (x1, d1)] = near;
        let slopes = d0.iter().zip(d1).map(|(a, b)| (b - a) / ((x1 - x0) * behind.0)).collect();
        Search {
            from,
            targets,
            before,
            behind,
            slopes,
            weights: [1.0; 2],
            moved: None,
            tries: 0,
            near: 0,
            is_last: false,
            found: Vec::new(),
        }
    }

    /// How long a distance takes to its kink, by the slopes near it.
    pub fn time(&self, k: usize, distance: f64) -> f64 {
        (distance / self.slopes[k]).abs()
    }

    /// The length of the next step, between both.
    pub fn guess(&self, left: &[usize]) -> f64 {
        left.iter().map(|k| self.zero(*k)).fold(self.behind.0, f64::min)
    }

    fn zero(&self, k: usize) -> f64 {
        let ends = [&self.before, &self.behind];
        let near = usize::from(ends[1].1[k].abs() < ends[0].1[k].abs());
        let (x, d) = (ends[near].0, ends[near].1[k]);
        let by_slope = x - d / self.slopes[k];
        if self.tries <= BY_SLOPE && by_slope > self.before.0 && by_slope < self.behind.0 {
            return by_slope;
        }
        let [a, b] = self.weights;
        let part = zero_between(a * ends[0].1[k], b * ends[1].1[k]);
        self.before.0 + part.clamp(EDGE, 1.0 - EDGE) * (self.behind.0 - self.before.0)
    }

    pub fn narrow(&mut self, h: f64, distances: Vec<f64>, is_behind: bool) {
        self.tries += 1;
        self.weights = match (is_behind, self.moved == Some(is_behind)) {
            (true, true) => [0.5 * self.weights[0], 1.0],
            (false, true) => [1.0, 0.5 * self.weights[1]],
            _ => [1.0, 1.0],
        };
        self.moved = Some(is_behind);
        *(if is_behind { &mut self.behind } else { &mut self.before }) = (h, distances);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Tries until a step ends within `at` of the zero of a distance.
    fn tries(distance: impl Fn(f64) -> f64, near: [f64; 2], at: f64) -> usize {
        let place = |x: f64| (x, vec![distance(x)]);
        let [a, b] = near.map(place);
        let mut search = Search::new(0.0, place(0.0), place(1.0), [&a, &b], vec![0]);
        let mut x = first_zero(&a, &b, &[0]);
        for n in 1..60 {
            if distance(x).abs() < at {
                return n;
            }
            search.narrow(x, vec![distance(x)], distance(x) > 0.0);
            x = search.guess(&[0]);
        }
        60
    }

    #[test]
    fn a_slope_that_is_known_is_followed() {
        assert!(tries(|x| (3.0 * x).sin() - 0.5, [0.17, 0.18], 1e-13) <= 4);
    }

    #[test]
    fn a_slope_that_is_wrong_is_left() {
        // a corner behind which the distance is a hundred times as steep
        let bent = |x: f64| if x < 0.7 { x - 0.71 } else { 100.0 * x - 70.01 };
        assert!(tries(bent, [0.1, 0.9], 1e-13) < 30);
    }
}
