//! A dense linear system and what analyses have found of it: its modes are solved for once, whoever asks for them.
use std::sync::OnceLock;

use faer::Mat;

use super::frf::Reduction;
use super::modal::{Modal, modes};
use crate::error::Result;
use crate::linalg::quadratic::Quadratic;
use crate::run::Counts;
use crate::second_order::SecondOrder;

/// (s^2 M + s (C + G) + K + N) x = f with its modal solution and the reduction that transfer functions and responses share.
pub struct LinearSystem {
    c: Option<Mat<f64>>,
    g: Option<Mat<f64>>,
    k: Mat<f64>,
    n: Option<Mat<f64>>,
    /// M, C + G and K + N
    pub q: Quadratic,
    modes: OnceLock<Modal>,
    reduction: OnceLock<Reduction>,
}

impl LinearSystem {
    /// Checks sizes and finiteness; symmetry is a matter of the modes.
    pub fn new(
        m: Mat<f64>,
        c: Option<Mat<f64>>,
        g: Option<Mat<f64>>,
        k: Mat<f64>,
        n: Option<Mat<f64>>,
    ) -> Result<Self> {
        for (name, a) in [("D", &c), ("D", &g), ("S", &n)] {
            if let Some(a) = a {
                Quadratic::check(name, a, m.nrows())?;
            }
        }
        Quadratic::check("S", &k, m.nrows())?;
        let d = match (&c, &g) {
            (Some(c), Some(g)) => Some(c + g),
            (Some(a), None) | (None, Some(a)) => Some(a.clone()),
            (None, None) => None,
        };
        let s = n.as_ref().map_or_else(|| k.clone(), |n| &k + n);
        let q = Quadratic::new(m, d, s)?;
        Ok(LinearSystem { c, g, k, n, q, modes: OnceLock::new(), reduction: OnceLock::new() })
    }

    /// Is there neither damping nor anything skew?
    pub fn is_symmetric(&self) -> bool {
        self.c.is_none() && self.g.is_none() && self.n.is_none()
    }

    /// The matrices with their symmetries, which are checked, and a factor of K if there is one.
    pub fn matrices(&self, kf: Option<Mat<f64>>) -> Result<SecondOrder> {
        SecondOrder::new(self.q.m.clone(), self.c.clone(), self.g.clone(), self.k.clone(), self.n.clone(), kf)
    }

    /// All modes, and the work that this call did. O(n^3) the first time.
    pub fn modes(&self) -> Result<(&Modal, Counts)> {
        if let Some(known) = self.modes.get() {
            let mut counts = Counts::default();
            counts.add("modes reused", 1);
            return Ok((known, counts));
        }
        let made = modes(&self.matrices(None)?)?;
        let counts = made.counts.clone();
        Ok((self.modes.get_or_init(|| made), counts))
    }

    /// What transfer functions and responses need, and the work that this call did. From the modes where there are any.
    pub fn reduction(&self) -> (&Reduction, Counts) {
        if let Some(known) = self.reduction.get() {
            return (known, Counts::default());
        }
        let (made, counts) = match (self.matrices(None), self.modes()) {
            // matrices without the symmetries of their names are split into parts that have them
            (Err(_), _) => {
                let made = Reduction::new(self.q.clone());
                let counts = made.counts.clone();
                (made, counts)
            }
            (Ok(_), Ok((modal, counts))) => (Reduction::with_modes(self.q.clone(), Some(modal)), counts),
            (Ok(_), Err(_)) => (Reduction::with_modes(self.q.clone(), None), Counts::default()),
        };
        (self.reduction.get_or_init(|| made), counts)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_modes_are_solved_for_once() {
        let n = 7;
        let own = |f: &dyn Fn(usize) -> f64| Mat::from_fn(n, n, |i, j| if i == j { f(i) } else { 0.0 });
        let k = Mat::from_fn(n, n, |i, j| {
            if i == j {
                2.3
            } else if i.abs_diff(j) == 1 {
                -1.0
            } else {
                0.0
            }
        });
        let system =
            LinearSystem::new(own(&|i| 1.0 + 0.1 * i as f64), Some(own(&|i| 0.03 * i as f64)), None, k, None).unwrap();
        let solved = |counts: &Counts| counts.0.iter().filter(|c| c.0.contains("eigensolutions")).count();
        assert_eq!(solved(&system.modes().unwrap().1), 1);
        assert_eq!(solved(&system.modes().unwrap().1), 0);
        assert_eq!(solved(&system.reduction().1), 0);
        assert!(system.reduction().0.complex.is_some());
    }
}
