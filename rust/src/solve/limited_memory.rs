//! The inverse of the Jacobian as a start and the last pairs (s, y) of steps and residual changes: O(m n) memory and work.
use super::line_search::dot;

/// Pairs of the BFGS form, H+ = V H V^T + s s^T/(y^T s) with V = I - s y^T/(y^T s), applied by two loops. The oldest pair makes
/// room for a new one.
#[derive(Debug, Clone, Default)]
pub struct Pairs {
    pub s: Vec<Vec<f64>>,
    pub y: Vec<Vec<f64>>,
    pub room: usize,
}

impl Pairs {
    pub fn new(room: usize) -> Pairs {
        Pairs { room: room.max(1), ..Pairs::default() }
    }

    pub fn push(&mut self, s: &[f64], y: &[f64]) {
        if self.s.len() == self.room {
            self.s.remove(0);
            self.y.remove(0);
        }
        self.s.push(s.to_vec());
        self.y.push(y.to_vec());
    }

    pub fn clear(&mut self) {
        self.s.clear();
        self.y.clear();
    }

    /// r <- H r, with H0 given by `base`.
    pub fn apply_bfgs(&self, r: &mut [f64], base: impl Fn(&mut [f64])) {
        let m = self.s.len();
        let mut weight = vec![0.0; m];
        for i in (0..m).rev() {
            weight[i] = dot(&self.s[i], r) / dot(&self.s[i], &self.y[i]);
            add(r, -weight[i], &self.y[i]);
        }
        base(r);
        for ((s, y), weight) in self.s.iter().zip(&self.y).zip(&weight) {
            let back = dot(y, r) / dot(s, y);
            add(r, weight - back, s);
        }
    }

    /// r <- H r for the good Broyden form H+ = (I + y s^T) H, where `y` holds (s - H y)/(s^T H y): the order of the factors
    /// matters, so a full memory is emptied by the caller instead of losing its oldest pair.
    pub fn apply_broyden(&self, r: &mut [f64], base: impl Fn(&mut [f64])) {
        base(r);
        for (s, a) in self.s.iter().zip(&self.y) {
            let along = dot(s, r);
            add(r, along, a);
        }
    }
}

fn add(r: &mut [f64], factor: f64, v: &[f64]) {
    for (r, v) in r.iter_mut().zip(v) {
        *r += factor * v;
    }
}
