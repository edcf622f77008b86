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
use crate::tolerances::sparse_modes::{
    BESIDE_CROWD, NARROW, NEARLY_ROOT, NEW_SHAPE, PLAUSIBLE, REAL_ROOT, ROOT_RESIDUAL, SAME_DAMPED,
};

/// Roots beyond the wanted ones, among which a gap is looked for that a circle can pass.
const SPARE: usize = 6;
/// How often the shift moves.
const MOVES: usize = 8;
/// About how many places roots are looked for, as long as the count says that some are missing.
const PLACES: usize = 10;
/// How often new random vectors look for members of repeated roots.
const FRESH: usize = 3;
/// How many times the first number of roots a wider search may look for.
const MANY: usize = 4;

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
    let (mut sigma, first) = search.settle(c64::new(0.0, rate), start, wanted, counts)?;
    let (mut more, mut known, mut verified) = (wanted + SPARE, Roots::default(), "unverified");
    let mut start = Some(first.as_ref());
    for _ in 0..PLACES {
        let near = search.about(sigma, more, start.take(), counts)?;
        let seen = near.s.iter().map(|s| (s - sigma).norm()).fold(0.0, f64::max);
        known.merge(near.upper());
        let Some(radius) = known.circle(wanted) else {
            break;
        };
        let disc = Disc { radius, known: &known.s, centre: sigma, seen };
        match system.polynomial.unknown_inside(&disc, counts, cancel)? {
            Some((0, _)) => {
                verified = "argument principle";
                break;
            }
            Some((count, angle)) => {
                more = (wanted + SPARE + count).min(MANY * (wanted + SPARE)).min(n);
                sigma = c64::from_polar(radius, angle);
            }
            None => break,
        }
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
            sigma = s[lowest] * (1.0 - (BESIDE_CROWD * spread / size).clamp(SAME_DAMPED, BESIDE_CROWD));
            if off(lowest) <= NEARLY_ROOT {
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
    fn about(&self, sigma: c64, wanted: usize, start: Option<MatRef<'_, c64>>, counts: &mut Counts) -> Result<Roots> {
        let op = self.operator(sigma, counts)?;
        let options = Options { max_cycles: 2 * PATIENCE, ..Options::new(wanted, false) };
        let mut space = match start {
            Some(vectors) => Space::from_vectors(&op, options, vectors)?,
            None => Space::new(&op, options)?,
        };
        let mut ritz = space.best(self.cancel)?;
        // new random vectors bring members of repeated roots to light
        for _ in 0..FRESH {
            // those that have not converged would pass for roots: what is left of them would no longer show
            let good = space.converged(&ritz).min(wanted);
            if good == 0 {
                break;
            }
            let before: Vec<c64> = ritz.value.iter().take(good).copied().collect();
            space.restart_afresh(&ritz, good)?;
            ritz = space.best(self.cancel)?;
            if before.iter().zip(&ritz.value).all(|(a, b)| (a - b).norm() <= SAME_DAMPED * a.norm()) {
                break;
            }
        }
        counts.merge(&space.counts);
        let count = space.converged(&ritz).min(wanted);
        let states = space.vectors(&ritz, count);
        let n = self.system.m.rows;
        let s = roots(&ritz, sigma, count);
        // the argument principle counts a wrong root against one that is missing
        let residual = self.system.residuals(&s, states.subrows(0, n));
        let good: Vec<usize> = (0..count).filter(|k| residual[*k] <= ROOT_RESIDUAL).collect();
        let column = |k: &usize| (0..n).map(|i| states[(i, *k)]).collect();
        Ok(Roots { s: good.iter().map(|k| s[*k]).collect(), shape: good.iter().map(column).collect() })
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
            if s.im.abs() <= REAL_ROOT * s.norm() {
                s.im = 0.0;
            }
            if s.im >= 0.0 {
                out.s.push(s);
                out.shape.push(x);
            }
        }
        out
    }

    /// Adds those that are not known.
    fn merge(&mut self, other: Roots) {
        for (s, x) in other.s.into_iter().zip(other.shape) {
            if self.is_new(s, &x) {
                self.s.push(s);
                self.shape.push(x);
            }
        }
    }

    /// Whether a shape is no combination of those at the same place. A root that were known twice would make up for a missing one in
    /// the count; members of a repeated root have shapes of their own.
    fn is_new(&self, s: c64, x: &[c64]) -> bool {
        let near = (0..self.s.len()).filter(|k| (self.s[*k] - s).norm() <= SAME_DAMPED * s.norm());
        let mut columns: Vec<&[c64]> = near.map(|k| self.shape[k].as_slice()).collect();
        columns.push(x);
        let norms: Vec<f64> = columns.iter().map(|x| x.iter().map(|z| z.norm_sqr()).sum::<f64>().sqrt()).collect();
        let units = Mat::from_fn(x.len(), columns.len(), |i, j| columns[j][i] / norms[j]);
        let last = columns.len() - 1;
        units.qr().R()[(last, last)].norm() > NEW_SHAPE
    }

    /// The radius behind the wanted roots with the widest gap in the modulus.
    fn circle(&self, wanted: usize) -> Option<f64> {
        let order = lowest_first(&self.s, self.s.len());
        let size = |k: usize| self.s[order[k]].norm();
        let behind = wanted..(wanted + SPARE / 2 + 1).min(order.len());
        let (gap, radius) = behind
            .map(|k| (size(k) - size(k - 1), 0.5 * (size(k) + size(k - 1))))
            .max_by(|a, b| a.0.total_cmp(&b.0))?;
        (gap > NARROW * radius).then_some(radius)
    }
}
