//! Lowest roots of large damped, gyroscopic or circulatory systems that lie close together far from zero.
//!
//! A complex shift starts at the lowest undamped root and moves to the lowest Ritz value until that is a root; about it a block Krylov
//! space finds the neighbours. The argument principle counts the roots of smaller modulus: none may be unknown.
use faer::{Mat, MatRef, c64};

use super::sparse_damped::{Damped, Found, StateOperator, lowest_first};
use super::sparse_modal;
use super::sparse_pencil::Assembled;
use super::sparse_polynomial::Disc;
use crate::error::{Error, Result};
use crate::linalg::krylov::{Options, Ritz, Space};
use crate::linalg::sparse::Csc;
use crate::run::{Cancel, Counts};
use crate::tolerances::modes::PATIENCE;
use crate::tolerances::sparse_modes::{BESIDE_CROWD, PLAUSIBLE, SAME_VALUE};

/// Roots beyond the wanted ones, among which a gap is looked for that a circle can pass.
const SPARE: usize = 6;
/// How often the shift moves.
const MOVES: usize = 8;
/// How often the search widens where the count says that roots are missing.
const WIDER: usize = 3;
/// Where else on the circle roots are looked for that are not near the others, in half turns.
const ELSEWHERE: [f64; 6] = [1.0, 0.75, 0.875, 0.625, 0.25, 0.0];

struct Search<'a> {
    system: &'a Damped,
    strain: &'a Csc,
    rate: f64,
    cancel: &'a Cancel,
}

/// Roots and the columns of their shapes.
#[derive(Clone, Default)]
struct Roots {
    s: Vec<c64>,
    shape: Vec<Vec<c64>>,
}

pub(crate) fn lowest(
    system: &Damped,
    wanted: usize,
    strain: &Csc,
    counts: &mut Counts,
    cancel: &Cancel,
) -> Result<Found> {
    let undamped = Assembled::new(system.m.clone(), system.stiffness())?;
    let modes = sparse_modal::lowest(&undamped, wanted, None, cancel)?;
    counts.merge(&modes.counts);
    let rate = modes.lambda[0].sqrt();
    let n = system.m.rows;
    let start = Mat::from_fn(2 * n, wanted, |i, j| {
        if i < n { c64::new(modes.shape[(i, j)], 0.0) } else { c64::new(0.0, modes.shape[(i - n, j)]) }
    });
    let search = Search { system, strain, rate, cancel };
    let (mut sigma, start) = search.settle(c64::new(0.0, rate), start, wanted, counts)?;
    let (mut more, mut known, mut verified) = (wanted + SPARE, Roots::default(), "unverified");
    for _ in 0..WIDER {
        let near = search.about(sigma, more, start.as_ref(), counts)?;
        let seen = near.s.iter().map(|s| (s - sigma).norm()).fold(0.0, f64::max);
        let before = std::mem::replace(&mut known, near.upper());
        known.merge(before);
        match search.missing(&mut known, wanted, (sigma, seen), counts)? {
            Some(0) => {
                verified = "argument principle";
                break;
            }
            Some(count) => more += count + SPARE,
            None => break,
        }
        // the middle of those of smallest modulus sees more of them
        let first = lowest_first(&known.s, wanted);
        sigma = first.iter().map(|k| known.s[*k]).sum::<c64>() / first.len().max(1) as f64;
    }
    if known.s.len() < wanted {
        return Err(unfound(known.s.len(), wanted));
    }
    let shape = Mat::from_fn(n, known.s.len(), |i, j| known.shape[j][i]);
    Ok(Found { s: known.s, shape, verified })
}

fn unfound(found: usize, wanted: usize) -> Error {
    Error::Convergence {
        message: format!("only {found} of {wanted} modes converged about a shift that moved among the lowest roots"),
        best: Vec::new(),
        residual: f64::NAN,
    }
}

impl Search<'_> {
    /// A shift beside the root of smallest modulus that the space sees, and vectors near those of its neighbours.
    fn settle(
        &self,
        mut sigma: c64,
        mut start: Mat<c64>,
        wanted: usize,
        counts: &mut Counts,
    ) -> Result<(c64, Mat<c64>)> {
        for _ in 0..MOVES {
            let op = self.operator(sigma, counts)?;
            let mut space = Space::from_vectors(&op, Options::new(wanted + SPARE, false), start.as_ref())?;
            let ritz = space.cycle(self.cancel)?;
            counts.merge(&space.counts);
            counts.add("moved shifts", 1);
            let s: Vec<c64> = ritz.value.iter().map(|mu| sigma + mu.inv()).collect();
            let off = |k: usize| ritz.residual[k] / ritz.value[k].norm();
            let plausible = |k: &usize| s[*k].im >= 0.0 && off(*k) <= PLAUSIBLE;
            let mut order: Vec<usize> = (0..s.len()).filter(plausible).collect();
            if order.is_empty() {
                order = (0..s.len()).filter(|k| s[*k].im >= 0.0).take(1).collect();
            }
            order.sort_by(|a, b| s[*a].norm().total_cmp(&s[*b].norm()));
            let Some(&lowest) = order.first() else {
                break;
            };
            let vectors = space.vectors(&ritz, ritz.value.len());
            order.truncate(wanted + SPARE);
            let spread = order.iter().map(|k| (s[*k] - s[lowest]).norm()).fold(0.0, f64::max);
            start = Mat::from_fn(vectors.nrows(), order.len(), |i, j| vectors[(i, order[j])]);
            // beside the root, not on it: factors there would see nothing else
            let size = s[lowest].norm();
            sigma = s[lowest] * (1.0 - (BESIDE_CROWD * spread / size).clamp(SAME_VALUE, BESIDE_CROWD));
            if off(lowest) <= PLAUSIBLE {
                break;
            }
        }
        Ok((sigma, start))
    }

    fn operator(&self, sigma: c64, counts: &mut Counts) -> Result<StateOperator<'_, c64>> {
        counts.add("factorisations", 1);
        self.system.operator(sigma, self.rate, self.strain)
    }

    /// Roots nearest to a shift, up to `wanted`: those that converge.
    fn about(&self, sigma: c64, wanted: usize, start: MatRef<'_, c64>, counts: &mut Counts) -> Result<Roots> {
        let op = self.operator(sigma, counts)?;
        let options = Options { max_cycles: PATIENCE, ..Options::new(wanted, false) };
        let mut space =
            if start.ncols() > 0 { Space::from_vectors(&op, options, start)? } else { Space::new(&op, options)? };
        let mut ritz = space.best(self.cancel)?;
        // new random vectors bring members of repeated roots to light
        for _ in 0..WIDER {
            let before: Vec<c64> = ritz.value.iter().take(wanted).copied().collect();
            space.restart_afresh(&ritz, wanted)?;
            ritz = space.best(self.cancel)?;
            if before.iter().zip(&ritz.value).all(|(a, b)| (a - b).norm() <= SAME_VALUE * a.norm()) {
                break;
            }
        }
        counts.merge(&space.counts);
        let count = space.converged(&ritz).min(wanted);
        let states = space.vectors(&ritz, count);
        let n = self.system.m.rows;
        let column = |k: usize| (0..n).map(|i| states[(i, k)]).collect();
        Ok(Roots { s: roots(&ritz, sigma, count), shape: (0..count).map(column).collect() })
    }

    /// How many roots of smaller modulus than the wanted ones, or equal, are unknown after a look elsewhere; None where no count is possible.
    fn missing(
        &self,
        known: &mut Roots,
        wanted: usize,
        (centre, seen): (c64, f64),
        counts: &mut Counts,
    ) -> Result<Option<usize>> {
        let none = Mat::zeros(2 * self.system.m.rows, 0);
        for place in [None].into_iter().chain(ELSEWHERE.map(Some)) {
            let Some(radius) = known.circle(wanted) else {
                return Ok(None);
            };
            if let Some(place) = place {
                let there = c64::from_polar(radius, std::f64::consts::PI * place);
                known.merge(self.about(there, 2, none.as_ref(), counts)?.upper());
            }
            let Some(radius) = known.circle(wanted) else {
                return Ok(None);
            };
            let disc = Disc { radius, known: &known.s, centre, seen };
            match self.system.polynomial.unknown_inside(&disc, counts, self.cancel)? {
                Some(count) if count > 0 && place != ELSEWHERE.last().copied() => {}
                other => return Ok(other),
            }
        }
        Ok(None)
    }
}

fn roots(ritz: &Ritz, sigma: c64, count: usize) -> Vec<c64> {
    ritz.value.iter().take(count).map(|mu| sigma + mu.inv()).collect()
}

impl Roots {
    /// Those in the upper half plane; roots that are real but for rounding are real.
    fn upper(self) -> Roots {
        let mut out = Roots::default();
        for (mut s, x) in self.s.into_iter().zip(self.shape) {
            if (s - s.conj()).norm() <= SAME_VALUE * s.norm() {
                s.im = 0.0;
            }
            if s.im >= 0.0 {
                out.s.push(s);
                out.shape.push(x);
            }
        }
        out
    }

    fn merge(&mut self, other: Roots) {
        for (s, x) in other.s.into_iter().zip(other.shape) {
            if self.s.iter().all(|k| (k - s).norm() > SAME_VALUE * s.norm()) {
                self.s.push(s);
                self.shape.push(x);
            }
        }
    }

    /// The radius behind the wanted roots with the widest gap in the modulus.
    fn circle(&self, wanted: usize) -> Option<f64> {
        let order = lowest_first(&self.s, self.s.len());
        let size = |k: usize| self.s[order[k]].norm();
        let behind = wanted..(wanted + SPARE / 2 + 1).min(order.len());
        let (gap, radius) = behind
            .map(|k| (size(k) - size(k - 1), 0.5 * (size(k) + size(k - 1))))
            .max_by(|a, b| a.0.total_cmp(&b.0))?;
        (gap > SAME_VALUE * radius).then_some(radius)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn roots(s: &[c64]) -> Roots {
        Roots { s: s.to_vec(), shape: vec![Vec::new(); s.len()] }
    }

    #[test]
    fn roots_that_differ_by_more_than_a_hundred_millionth_are_told_apart() {
        let count = |apart: f64| {
            let mut known = roots(&[c64::new(-0.1, 1.0)]);
            known.merge(roots(&[c64::new(-0.1, 1.0 + apart)]));
            (known.s.len(), known.circle(1).is_some())
        };
        assert_eq!([1e-9, 1e-7].map(count), [(1, false), (2, true)]);
    }

    #[test]
    fn heavily_damped_roots_are_a_pair_while_their_frequency_is_no_rounding() {
        let frequency =
            |im: f64| roots(&[c64::new(-1.0, im), c64::new(-1.0, -im)]).upper().s.iter().map(|s| s.im).sum::<f64>();
        assert_eq!([1e-9, 1e-7].map(frequency), [0.0, 1e-7]);
    }
}
