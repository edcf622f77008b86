//! Where a step passes a singular pose of loops.
//!
//! There the pivot of a row that depends on the others goes through zero. A stage at the distance d (radians) from such a pose has
//! positions to eps/d, rates to eps/d^2 and accelerations to eps/d^3, whatever the coordinates, so that short steps are worse than
//! long ones. A step passes best where the pose lies in the middle of the widest gap between its stages.

/// The middle of the widest gap between stages, as a part of the step, and how far from it the pose may lie.
const GAP: f64 = 0.5 * (1.0 / 3.0 + 0.6);
const BESIDE: f64 = 0.07;

/// Errors of rates below this many units of rounding, times v^2/d^3, are rounding.
const UNITS: f64 = 4.0;
const MOST: f64 = 1e-6;

/// Pivots of the stages of one step, by their place in it.
pub struct Passing {
    seen: Vec<(f64, Vec<f64>)>,
    least: f64,
}

impl Default for Passing {
    fn default() -> Self {
        Passing {
            seen: Vec::new(),
            least: f64::INFINITY,
        }
    }
}

impl Passing {
    pub fn start(&mut self, pivots: Vec<f64>) {
        *self = Passing::default();
        self.see(0.0, pivots);
    }

    pub fn see(&mut self, part: f64, pivots: Vec<f64>) {
        self.least = pivots.iter().fold(self.least, |s, p| s.min(p.abs()));
        self.seen.push((part, pivots));
    }

    /// What rounding does to rates within a step of length h at this speed (radians or characteristic lengths per second); where
    /// that would be too much, a step has to keep further away.
    pub fn rounding(&self, speed: f64, h: f64) -> f64 {
        let found = UNITS * f64::EPSILON * h * speed * speed / self.least.powi(3);
        found.min(MOST * speed).max(0.0)
    }

    /// The part of the step at which the first pivot changes its sign.
    fn place(&self) -> Option<f64> {
        let mut seen: Vec<_> = self.seen.iter().collect();
        seen.sort_by(|a, b| a.0.total_cmp(&b.0));
        for pair in seen.windows(2) {
            let [(x0, before), (x1, after)] = [pair[0], pair[1]];
            let crossing = before.iter().zip(after).find(|(p, q)| *p * *q < 0.0);
            if let Some((p, q)) = crossing {
                return Some(x0 + (x1 - x0) * p / (p - q));
            }
        }
        None
    }

    /// The part of this step after which it should end, for the pose to lie well.
    pub fn better_end(&self) -> Option<f64> {
        let place = self.place()?;
        let part = if place < GAP {
            place / GAP
        } else {
            place - GAP
        };
        ((place - GAP).abs() > BESIDE).then_some(part)
    }
}

#[cfg(test)]
mod tests {
    use super::{GAP, Passing};

    #[test]
    fn a_pose_is_placed_in_the_gap() {
        for place in [0.1, 0.3, 0.7, 0.95] {
            let mut passing = Passing::default();
            passing.start(vec![1.0, -place]);
            passing.see(1.0, vec![2.0, 1.0 - place]);
            passing.see(0.25, vec![1.2, 0.25 - place]);
            let end = passing.better_end().unwrap_or(1.0);
            let then = if place < GAP {
                place / end
            } else {
                place - end
            };
            assert!((then - GAP).abs() < 1e-12, "{place}: {then}");
        }
    }

    #[test]
    fn without_a_singular_pose_nothing_is_asked() {
        let mut passing = Passing::default();
        passing.start(vec![1.0, -0.2]);
        passing.see(1.0, vec![0.5, -0.4]);
        assert!(passing.better_end().is_none());
    }
}
