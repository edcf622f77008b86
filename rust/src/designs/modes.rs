//! Modes of a design, and their derivatives.
use faer::Mat;

use super::{Changes, Numbers, Plan, Scene};
use crate::error::Result;
use crate::linalg::dense::C;
use crate::linearize::model_modes::{linear_system, model_modes};
use crate::run::Cancel;
use crate::second_order::SecondOrder;
use crate::second_order::eigen_sensitivity::{Directions, Known, Slices, eigen_sensitivity};
use crate::second_order::modal::{Kind, Modal};
use crate::sensitivity::direction::{Directional, Entries};
use crate::tolerances::modes::SAME_ROOT;

impl Plan {
    pub(super) fn modes(
        &self,
        scene: &Scene<'_>,
        n: Option<usize>,
        elastic: Option<bool>,
        cancel: &Cancel,
    ) -> Result<Option<Numbers>> {
        let matrices = linear_system(scene.lin, scene.parts)?.second_order()?;
        let Some(modal) = model_modes(&scene.setting, scene.lin, scene.parts, &matrices, elastic)? else {
            return Ok(None);
        };
        let chosen = Chosen::new(&modal, n);
        let mut arrays = chosen.numbers();
        if !self.by.is_empty() {
            let Some(changes) = self.changes(scene, false, cancel)? else { return Ok(None) };
            arrays.extend(chosen.derive(&matrices, &changes)?);
        }
        Ok(Some(Numbers { arrays, count: chosen.n, remark: false }))
    }
}

/// The lowest modes of a result, and which of them share a root.
struct Chosen<'a> {
    modal: &'a Modal,
    n: usize,
    clusters: Vec<(usize, usize)>,
    /// modes of a group that `n` has cut
    cut: std::ops::Range<usize>,
}

impl<'a> Chosen<'a> {
    fn new(modal: &'a Modal, n: Option<usize>) -> Self {
        let n = n.map_or(modal.s.len(), |n| n.min(modal.s.len()));
        let cut = modal.groups.iter().find(|(a, count)| *a < n && n < a + count).map_or(0..0, |(a, _)| *a..n);
        let group =
            |i: usize| modal.groups.iter().position(|(a, count)| *count > 1 && (*a..(a + count).min(n)).contains(&i));
        let mut clusters: Vec<(usize, usize)> = Vec::new();
        for i in 0..n {
            let together = i > 0
                && match (group(i - 1), group(i)) {
                    (Some(a), Some(b)) if a == b => true,
                    _ => same(modal, i - 1, i),
                };
            match clusters.last_mut().filter(|_| together) {
                Some((_, count)) => *count += 1,
                None => clusters.push((i, 1)),
            }
        }
        clusters.retain(|(_, count)| *count > 1);
        Chosen { modal, n, clusters, cut }
    }

    /// Frequencies and damping ratios.
    fn numbers(&self) -> Vec<Vec<f64>> {
        let s = &self.modal.s[..self.n];
        let damping = |s: &C| if s.norm() > 0.0 { -s.re / s.norm() + 0.0 } else { f64::NAN };
        vec![s.iter().map(|s| s.norm() / std::f64::consts::TAU).collect(), s.iter().map(damping).collect()]
    }

    /// Their derivatives along all directions.
    fn derive(&self, system: &SecondOrder, changes: &Changes) -> Result<[Vec<f64>; 2]> {
        let (modal, size) = (self.modal, system.size());
        let first = |x: &Mat<C>| x.subcols(0, self.n).to_owned();
        let known = Known {
            s: modal.s[..self.n].to_vec(),
            x: first(&modal.shape),
            y: modal.left.as_ref().map(first),
            rigid: modal.kind[..self.n].iter().map(|k| *k == Kind::Rigid).collect(),
            near_defective: modal.near_defective[..self.n].to_vec(),
            groups: self.clusters.clone(),
        };
        let all = &changes.all;
        let along = Directions::new(
            slices(all, |d| &d.mass, |_| true, size)?,
            slices(all, |d| &d.damping, |p| changes.skew_damping[p], size)?,
            slices(all, |d| &d.stiffness, |p| changes.skew_stiffness[p], size)?,
            all.len(),
        );
        let found = eigen_sensitivity(system, &known, &along)?.eigenvalue;
        let [mut frequencies, mut dampings] = [0, 1].map(|_| Vec::with_capacity(self.n * all.len()));
        for i in 0..self.n {
            let s = modal.s[i];
            for p in 0..all.len() {
                let ds = if self.cut.contains(&i) { C::new(f64::NAN, f64::NAN) } else { found[(i, p)] };
                let (frequency, damping) = slopes(s, ds);
                frequencies.push(frequency);
                dampings.push(damping);
            }
        }
        Ok([frequencies, dampings])
    }
}

/// Neighbours that a symmetry makes equal and the rounding of positions and of closed loops parts.
fn same(modal: &Modal, i: usize, j: usize) -> bool {
    let apart = |k: usize| modal.kind[k] == Kind::Rigid || modal.near_defective[k];
    !apart(i) && !apart(j) && (modal.s[i] - modal.s[j]).norm() <= SAME_ROOT * modal.s[j].norm()
}

/// d(|s|/2 pi) and d(-Re s/|s|) of ds.
fn slopes(s: C, ds: C) -> (f64, f64) {
    let size = s.norm();
    if size == 0.0 {
        return (if ds == C::ZERO { 0.0 } else { f64::NAN }, f64::NAN);
    }
    let growth = (s.conj() * ds).re;
    (growth / size / std::f64::consts::TAU, -ds.re / size + s.re * growth / size.powi(3))
}

/// The entries of one matrix along all directions; symmetric parts but for the directions where all of it counts.
fn slices(
    changes: &[Directional],
    pick: impl Fn(&Directional) -> &Entries,
    whole: impl Fn(usize) -> bool,
    size: usize,
) -> Result<Slices> {
    let (mut made, mut dense) = (Slices::default(), vec![0.0; size * size]);
    for (p, change) in changes.iter().enumerate() {
        let entries = pick(change);
        let share = if whole(p) { 1.0 } else { 0.5 };
        for ((i, j), v) in entries.rows.iter().zip(&entries.columns).zip(&entries.values) {
            let (i, j) = (*i as usize, *j as usize);
            dense[i + size * j] += share * v;
            if !whole(p) {
                dense[j + size * i] += share * v;
            }
        }
        made.push(if entries.values.is_empty() { &[] } else { &dense }, size)?;
        if !entries.values.is_empty() {
            dense.fill(0.0);
        }
    }
    Ok(made)
}
