//! Roots of det (S + s D + s^2 M) of matrices whose entries lie near the diagonal, by the iteration of Ehrlich and Aberth (O. Aberth,
//! Iteration methods for finding all zeros of a polynomial simultaneously, Math. Comp. 27, 1973): Newton's method for all roots at once,
//! each with the others divided out. A step of one root takes O(n half^2).
use faer::c64;

use super::banded::Band;
use super::complex_lanes::{LANES, Lanes, Reals};
use super::widest::widest;
use crate::tolerances::matrices::{ENCLOSED, MOST_SWEEPS, SETTLED};

/// The roots with Im s > 0, and how many determinants they took.
pub struct Roots {
    pub upper: Vec<c64>,
    pub determinants: u64,
}

impl Band {
    /// All roots, which are near the given ones with Im s > 0 and near their conjugates; None where they are not found: not every disc
    /// around a root that is known to hold one is small.
    pub fn roots(&self, near: Vec<c64>) -> Option<Roots> {
        let mut roots = Roots { upper: near, determinants: 0 };
        let mut moving: Vec<usize> = (0..roots.upper.len()).collect();
        for _ in 0..MOST_SWEEPS {
            moving = self.sweep(&mut roots, &moving)?;
            if moving.is_empty() {
                roots.determinants += roots.upper.len() as u64;
                return self.enclose(&roots.upper).then_some(roots);
            }
        }
        None
    }

    /// One step of those that move; of them those that go on.
    fn sweep(&self, roots: &mut Roots, moving: &[usize]) -> Option<Vec<usize>> {
        let mut on = Vec::new();
        for some in moving.chunks(LANES) {
            roots.determinants += some.len() as u64;
            let steps = self.pivots(&lanes(&roots.upper, some)).step_parts();
            for (l, &i) in some.iter().enumerate() {
                let [last, slope] = steps.each_ref().map(|part| c64::new(part.re[l], part.im[l]));
                let step = last / (slope - last * from_others(&roots.upper, i));
                let moved = roots.upper[i] - step;
                if !moved.is_finite() {
                    return None;
                }
                // the conjugate of a root is one
                roots.upper[i] = c64::new(moved.re, moved.im.abs());
                if step.norm() > SETTLED * moved.norm() {
                    on.push(i);
                }
            }
        }
        Some(on)
    }

    /// Z and its slope at each s, without their lower parts.
    fn pivots(&self, s: &Lanes) -> Pivots {
        self.eliminated(self.at(s), self.slopes_at(s), std::array::from_fn(|l| s.re[l] * s.re[l] + s.im[l] * s.im[l]))
    }

    fn eliminated(&self, z: Vec<Lanes>, slope: Vec<Lanes>, square: Reals) -> Pivots {
        let rounding = square.map(|square| f64::EPSILON * square);
        let mut found = Pivots { n: self.size(), half: self.half_bandwidth(), z, slope, rounding, sum: Lanes::ZERO };
        widest!(|_| eliminate(&mut found));
        found
    }

    /// True where all discs around the roots that together hold all zeros are small: B. T. Smith, Error bounds for zeros of a polynomial
    /// based upon Gerschgorin's theorems, J. ACM 17 (1970).
    fn enclose(&self, upper: &[c64]) -> bool {
        let all: Vec<usize> = (0..upper.len()).collect();
        let masses = self.masses();
        let leading = self.eliminated(masses.clone(), masses, [0.0; LANES]).log_size()[0];
        let sizes = all.chunks(LANES).flat_map(|some| {
            let found = self.pivots(&lanes(upper, some)).log_size();
            some.iter().zip(found).map(|(_, size)| size).collect::<Vec<f64>>()
        });
        let count = 2.0 * upper.len() as f64;
        sizes.zip(&all).all(|(size, &i)| {
            let apart: f64 = upper.iter().enumerate().map(|(j, z)| apart(upper[i], *z, i == j).ln()).sum();
            count * (size - leading - apart).exp() <= ENCLOSED * upper[i].norm()
        })
    }
}

/// Z and its slope by rows after the elimination.
struct Pivots {
    n: usize,
    half: usize,
    z: Vec<Lanes>,
    slope: Vec<Lanes>,
    /// of masses of about one: a leading block that is singular itself is one with this pivot, too
    rounding: Reals,
    /// of the slopes of all pivots but the last, over the pivots
    sum: Lanes,
}

impl Pivots {
    /// The last pivot and that times d/ds ln det Z = tr (Z^-1 Z'): finite at a root, too.
    fn step_parts(&self) -> [Lanes; 2] {
        let at = self.z.len() - 1 - self.half;
        let mut slope = self.slope[at];
        slope.add(&self.sum.times(&self.z[at]));
        [self.z[at], slope]
    }

    /// ln |det Z|
    fn log_size(&self) -> Reals {
        let mut sum = [0.0; LANES];
        for pivot in self.z.iter().skip(self.half).step_by(2 * self.half + 1) {
            for (l, sum) in sum.iter_mut().enumerate() {
                *sum += pivot.re[l].hypot(pivot.im[l]).ln();
            }
        }
        sum
    }
}

/// Some of the numbers, the last lanes all alike.
fn lanes(of: &[c64], some: &[usize]) -> Lanes {
    let at = |l: usize| of[some[l.min(some.len() - 1)]];
    Lanes { re: std::array::from_fn(|l| at(l).re), im: std::array::from_fn(|l| at(l).im) }
}

/// Sum of 1 / (s_i - s) over all other roots s, with those of Im s < 0.
fn from_others(upper: &[c64], i: usize) -> c64 {
    let own = upper[i];
    let mut sum = c64::new(0.0, 0.0);
    for (j, z) in upper.iter().enumerate() {
        if i != j {
            sum += (own - z).inv();
        }
        sum += (own - z.conj()).inv();
    }
    sum
}

/// |s - z| |s - conj z|, without the first where both are one root.
fn apart(s: c64, z: c64, same: bool) -> f64 {
    (s - z.conj()).norm() * if same { 1.0 } else { (s - z).norm() }
}

#[inline(always)]
fn eliminate(own: &mut Pivots) {
    let (n, half) = (own.n, own.half);
    let width = 2 * half + 1;
    for k in 0..n - 1 {
        let (done, below) = own.z.split_at_mut((k + 1) * width);
        let (slope_done, slope_below) = own.slope.split_at_mut((k + 1) * width);
        let (row, slope_row) = (&mut done[k * width..], &slope_done[k * width..]);
        for l in 0..LANES {
            let some = row[half].re[l].abs() + row[half].im[l].abs() > 0.0;
            row[half].re[l] += if some { 0.0 } else { own.rounding[l] };
        }
        let inverse = row[half].inverse();
        let pivot = slope_row[half].times(&inverse);
        own.sum.add(&pivot);
        let last = half.min(n - 1 - k);
        for down in 1..=last {
            // column k of row k + down lies `down` before its diagonal
            let (z, slope) = (&mut below[(down - 1) * width..down * width], &mut slope_below[(down - 1) * width..]);
            let l = z[half - down].times(&inverse);
            let mut slope_l = slope[half - down].times(&inverse);
            slope_l.subtract(&l, &pivot);
            for right in 1..=last {
                let at = half - down + right;
                z[at].subtract(&l, &row[half + right]);
                slope[at].subtract(&slope_l, &row[half + right]);
                slope[at].subtract(&l, &slope_row[half + right]);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::linalg::banded::Entry;

    /// Masses of one, springs of one between neighbours and to the ground at both ends, dampers to the ground, and the squares of the natural
    /// frequencies without them.
    fn chain(dampers: &[f64]) -> (Band, Vec<f64>) {
        let n = dampers.len();
        let mut entries: Vec<Entry> = (0..n).map(|i| (i, i, [1.0, dampers[i], 2.0])).collect();
        entries.extend((1..n).flat_map(|i| [(i - 1, i, [0.0, 0.0, -1.0]), (i, i - 1, [0.0, 0.0, -1.0])]));
        let frequency = |k: usize| 2.0 * (0.5 * std::f64::consts::PI * k as f64 / (n + 1) as f64).sin();
        (Band::new(n, &entries, 1).unwrap(), (1..=n).map(|k| frequency(k).powi(2)).collect())
    }

    fn near(squares: &[f64], decay: f64) -> Vec<c64> {
        squares.iter().map(|square| c64::new(-decay, (square - decay * decay).sqrt())).collect()
    }

    #[test]
    fn equal_dampers_move_all_roots_alike() {
        let (band, squares) = chain(&[0.1; 20]);
        let found = band.roots(near(&squares, 0.02)).unwrap();
        let expected = near(&squares, 0.05);
        let gap = found.upper.iter().zip(&expected).map(|(a, b)| (a - b).norm()).fold(0.0, f64::max);
        assert!(gap < 1e-14 && found.determinants <= 20 * 8, "{gap:e} {}", found.determinants);
    }

    #[test]
    fn discs_tell_roots_that_are_missing_or_inexact() {
        let (band, squares) = chain(&[0.1; 20]);
        let roots = near(&squares, 0.05);
        let with = |k: usize, root: c64| {
            let mut other = roots.clone();
            other[k] = root;
            band.enclose(&other)
        };
        assert!(band.enclose(&roots) && with(7, roots[7] * (1.0 + 1e-12)));
        assert!(!with(7, roots[7] * (1.0 + 1e-9)));
        assert!(!with(7, roots[8]) && !with(7, roots[8] * (1.0 + 1e-6)));
    }

    #[test]
    fn real_roots_are_not_found() {
        let mut dampers = [0.1; 20];
        dampers[9] = 30.0;
        let (band, squares) = chain(&dampers);
        assert!(band.roots(near(&squares, 0.05)).is_none());
    }

    #[test]
    fn equal_dampers_commute_and_others_do_not() {
        let apart = |last: f64| {
            let mut dampers = [0.1; 20];
            dampers[19] = last;
            chain(&dampers).0.commutator()
        };
        assert!(apart(0.1) < 1e-14 && apart(0.2) > 1e-3, "{:e} {:e}", apart(0.1), apart(0.2));
    }
}
