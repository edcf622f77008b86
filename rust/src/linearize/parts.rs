//! The matrices of a linearisation by their kind, without what rounding left in them.
//!
//! ```text
//! C = sym D,  G = skew D,  K = sym S,  N = skew S
//! ```
//! An entry is rounding where it is below eps times the sum of the sizes of the terms that were added up for it; no choice of units
//! matters. Terms that cannot be there are absent by structure: G of dampers at rest, N of forces with a potential.
use nalgebra::DMatrix;

use crate::error::{Error, Result};
use crate::linearize::strain_rows::{Clear, clear_strains, stiffest};
use crate::linearize::{Linearization, Setting};
use crate::model::layout::bushing;
use crate::multibody::placement::place;
use crate::multibody::potential::{cross_coupled, has_no_potential};
use crate::tolerances::linearisation::{CANCELLED, ENTRY};

/// C, G, K and N; None where nothing acts.
#[derive(Debug, Clone)]
pub struct Parts {
    pub damping: Option<DMatrix<f64>>,
    pub gyroscopic: Option<DMatrix<f64>>,
    pub stiffness: DMatrix<f64>,
    pub circulatory: Option<DMatrix<f64>>,
    /// the unbalanced part of the forces, the largest of all coordinates, each over the forces on the bodies that it is connected with
    pub error: f64,
}

/// The parts of a linearisation. `turn` W (dof, dof) in rad/s: of increments z in the axes of a steady motion, y = exp(W t) z, which have
/// D + 2 M W and S + D W + M W^2. O(dof^2), and where entries of K may be rounding O(strains) for each of those.
pub fn parts(setting: &Setting<'_>, made: &Linearization, turn: Option<&DMatrix<f64>>) -> Result<Parts> {
    let (system, moving) = (setting.system, setting.state.moving());
    let (mut damping, mut position) = (made.matrices.damping.clone(), made.matrices.stiffness.clone());
    if let Some(w) = turn {
        seen_from(w, &made.matrices.mass, &mut damping, &mut position)?;
    }
    if moving {
        clean_spinning(setting, &made.matrices.mass, &mut damping, &mut position);
    }
    let reach = &made.reach;
    let forces: Vec<f64> = made.force_sizes.iter().zip(reach).map(|(f, r)| f.sqrt() * r).collect();
    // forces of air have no potential and couple across
    let airy = setting.effects.aerodynamics && !system.topology.tables.sections.is_empty();
    let (damping, gyroscopic) = split_damping(damping, moving || airy || cross_coupled(system, bushing::C));
    let (stiffness, circulatory) = split_stiffness(position, &forces, !(moving || airy || has_no_potential(system)));
    let mut out = Parts { damping, gyroscopic, stiffness, circulatory, error: unbalance(made, reach) };
    if !moving {
        drop_rounding(setting, made, (reach, &forces), &mut out.stiffness);
    }
    Ok(out)
}

fn seen_from(w: &DMatrix<f64>, m: &DMatrix<f64>, d: &mut Option<DMatrix<f64>>, s: &mut DMatrix<f64>) -> Result<()> {
    if w.shape() != m.shape() {
        return Err(Error::model(format!(
            "at= is a steady motion with {} degrees of freedom, which are {} here; compute it again from this model, with the same effects",
            w.nrows(),
            m.nrows()
        )));
    }
    let before = d.take().unwrap_or_else(|| DMatrix::zeros(m.nrows(), m.nrows()));
    *s += &before * w + m * w * w;
    *d = Some(before + m * w * 2.0);
    Ok(())
}

/// Takes entries out of D and S that inertia terms leave where they cancel.
///
/// Rotation at w adds terms of size w^2 sqrt(M_ii M_jj) to S_ij and w sqrt(M_ii M_jj) to D_ij. Their rounding in a row that nothing
/// else holds, that of the turning itself, would pass for a stiffness there. It is taken out here, where w is known: the matrices alone
/// do not tell it from a weak spring beside a stiff one, and in a plane motion D is rounding as well.
fn clean_spinning(setting: &Setting<'_>, m: &DMatrix<f64>, d: &mut Option<DMatrix<f64>>, s: &mut DMatrix<f64>) {
    let system = setting.system;
    let placement = place(&system.topology, &system.geometry, &setting.state.q, Some(&setting.state.rate));
    let spins = placement.velocity.iter().flat_map(|v| v.body.iter().map(|b| b.a.norm()));
    let w = spins.fold(0.0, f64::max);
    let size: Vec<f64> = m.diagonal().iter().map(|v| v.sqrt()).collect();
    let clean = |x: &mut DMatrix<f64>, scale: f64| {
        for j in 0..x.ncols() {
            for i in 0..x.nrows() {
                if x[(i, j)].abs() <= scale * CANCELLED * size[i] * size[j] {
                    x[(i, j)] = 0.0;
                }
            }
        }
    };
    if let Some(d) = d {
        clean(d, w);
    }
    clean(s, w * w);
}

/// The largest |residual| over the forces at work; nan where there is one.
fn unbalance(made: &Linearization, reach: &[f64]) -> f64 {
    let natural = made.force_sizes.iter().zip(reach).map(|(f, r)| f * r);
    let part = |(r, n): (&f64, f64)| if n > 0.0 { r.abs() / n } else { 0.0 };
    let worst = |a: f64, b: f64| if a >= b || a.is_nan() { a } else { b };
    made.residual.iter().zip(natural).map(part).fold(0.0, worst)
}

/// C and G of D. `skew`: there may be a G; at rest dampers alone act, and theirs is symmetric unless they couple across.
fn split_damping(d: Option<DMatrix<f64>>, skew: bool) -> (Option<DMatrix<f64>>, Option<DMatrix<f64>>) {
    let Some(d) = d.filter(|d| d.iter().any(|v| *v != 0.0)) else { return (None, None) };
    if !skew {
        return (Some(symmetric(d)), None);
    }
    let (c, g) = halves(&d);
    let root: Vec<f64> = d.diagonal().iter().map(|v| v.abs().sqrt()).collect();
    let size = |i: usize, j: usize| 2.0 * entry_size(&d, &root, i, j);
    (Some(c).filter(|c| !is_rounding(c, size)), Some(g).filter(|g| !is_rounding(g, size)))
}

/// K and N of S; `forces` are roots of the sizes of the terms that forces at work add. With a potential a skew part is what unbalanced
/// moments leave in the increments of rotations.
fn split_stiffness(s: DMatrix<f64>, forces: &[f64], conservative: bool) -> (DMatrix<f64>, Option<DMatrix<f64>>) {
    if conservative {
        return (symmetric(s), None);
    }
    let (k, n) = halves(&s);
    let root: Vec<f64> = s.diagonal().iter().map(|v| v.abs().sqrt()).collect();
    let size = |i: usize, j: usize| 2.0 * (entry_size(&s, &root, i, j) + forces[i] * forces[j]);
    (k, Some(n).filter(|n| !is_rounding(n, size)))
}

fn symmetric(mut x: DMatrix<f64>) -> DMatrix<f64> {
    for j in 0..x.ncols() {
        for i in 0..j {
            let mean = (x[(i, j)] + x[(j, i)]) * 0.5;
            (x[(i, j)], x[(j, i)]) = (mean, mean);
        }
    }
    x
}

fn halves(x: &DMatrix<f64>) -> (DMatrix<f64>, DMatrix<f64>) {
    let half = |sign: f64| DMatrix::from_fn(x.nrows(), x.ncols(), |i, j| 0.5 * (x[(i, j)] + sign * x[(j, i)]));
    (half(1.0), half(-1.0))
}

/// Size of the terms of an entry as far as the matrix shows it: of sums of squares by Cauchy and Schwarz.
fn entry_size(x: &DMatrix<f64>, root: &[f64], i: usize, j: usize) -> f64 {
    x[(i, j)].abs().max(x[(j, i)].abs()).max(root[i] * root[j])
}

/// True where no entry exceeds the rounding of the terms of an entry and its mirror image, which have this size together.
fn is_rounding(part: &DMatrix<f64>, size: impl Fn(usize, usize) -> f64) -> bool {
    let clear = |i: usize, j: usize| part[(i, j)].abs() > 0.5 * ENTRY * f64::EPSILON * size(i, j);
    !(0..part.ncols()).any(|j| (0..part.nrows()).any(|i| clear(i, j)))
}

/// Entries of K at rest that may be rounding: those far below what their coordinates could have, by other coordinates and by the stiffest
/// of the elements.
fn suspicious(k: &DMatrix<f64>, reach: &[f64], forces: &[f64], stiffest: f64) -> Vec<(usize, usize)> {
    let n = k.nrows();
    let own = (0..n).filter(|i| reach[*i] > 0.0).map(|i| k[(i, i)].abs() / reach[i].powi(2));
    let natural = own.fold(stiffest, f64::max);
    let mut found = Vec::new();
    for j in 0..n {
        for i in 0..=j {
            let v = k[(i, j)].abs();
            if v != 0.0 && v <= f64::EPSILON.sqrt() * (natural * reach[i] * reach[j] + forces[i] * forces[j]) {
                found.push((i, j));
            }
        }
    }
    found
}

/// Takes entries of rounding out of K at rest.
fn drop_rounding(setting: &Setting<'_>, made: &Linearization, (reach, forces): (&[f64], &[f64]), k: &mut DMatrix<f64>) {
    let of_forces = |i: usize, j: usize| ENTRY * f64::EPSILON * forces[i] * forces[j];
    let (mut rounding, open): (Vec<_>, Vec<_>) = suspicious(k, reach, forces, stiffest(setting))
        .into_iter()
        .partition(|(i, j)| k[(*i, *j)].abs() <= of_forces(*i, *j));
    if !open.is_empty() {
        let mut columns: Vec<usize> = open.iter().flat_map(|(i, j)| [*i, *j]).collect();
        columns.sort_unstable();
        columns.dedup();
        let sizes = Sizes::new(clear_strains(setting, made, &columns));
        let place = |i: usize| columns.partition_point(|c| *c < i);
        let bound = |i: usize, j: usize| of_forces(i, j) + sizes.rounding(place(i), place(j));
        rounding.extend(open.into_iter().filter(|(i, j)| k[(*i, *j)].abs() <= bound(*i, *j)));
    }
    for (i, j) in rounding {
        (k[(i, j)], k[(j, i)]) = (0.0, 0.0);
    }
}

/// Sums over the elements of w^T |k| w, for rows w as they are kept and with the bounds of what was dropped.
struct Sizes {
    kept: DMatrix<f64>,
    dropped: DMatrix<f64>,
    /// |k| of each element times its rows of `kept` and of `dropped`
    weighed: [DMatrix<f64>; 2],
}

impl Sizes {
    fn new(clear: Clear) -> Self {
        let kept = clear.rows.abs();
        let weigh = |x: &DMatrix<f64>| {
            let mut out = DMatrix::zeros(x.nrows(), x.ncols());
            let mut first = 0;
            for k in &clear.stiffness {
                let size = k.abs().sup(&k.transpose().abs());
                let n = size.nrows();
                size.mul_to(&x.rows(first, n), &mut out.rows_mut(first, n));
                first += n;
            }
            out
        };
        let weighed = [weigh(&kept), weigh(&clear.dropped)];
        Sizes { kept, dropped: clear.dropped, weighed }
    }

    /// Rounding of the sum of an entry, and what the dropped parts of its rows could have added.
    fn rounding(&self, i: usize, j: usize) -> f64 {
        let dot = |a: &DMatrix<f64>, b: &DMatrix<f64>| a.column(i).dot(&b.column(j));
        let [kept, dropped] = &self.weighed;
        let lost = dot(&self.kept, dropped) + dot(&self.dropped, kept) + dot(&self.dropped, dropped);
        ENTRY * f64::EPSILON * dot(&self.kept, kept) + lost
    }
}
