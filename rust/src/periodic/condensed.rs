//! Exact condensation onto a few retained coordinates r: S = Z_rr - Z_rl Z_ll^-1 Z_lr by one sparse factorisation per harmonic.
use std::sync::Arc;

use faer::Mat;
use num_complex::Complex64 as c64;

use super::condensed_banded::{Banded, Task};
use super::factor::{Factor, Ldl, Pattern};
use super::linear::{Block, DynamicStiffness, Forces, Matrices, STABILITY_COORDINATES, reordered};
use super::refined::Solution;
use crate::error::{Error, Result};
use crate::linalg::complex_lanes::LANES;
use crate::tolerances::matrices::SAME_ENTRY;
use crate::tolerances::periodic::{LANE_PRODUCT, MOST_LANES};
use crate::tolerances::roots::FELT;

const REFINEMENTS: usize = 6;

/// One entry of M, C and K at the same place.
#[derive(Debug, Clone, Copy)]
pub struct Entry {
    pub row: usize,
    pub column: usize,
    pub m: f64,
    pub c: f64,
    pub k: f64,
}

impl Entry {
    fn z(&self, w: f64) -> c64 {
        c64::new(self.k - w * w * self.m, w * self.c)
    }

    fn z_slope(&self, w: f64) -> c64 {
        c64::new(-2.0 * w * self.m, self.c)
    }

    /// Sum of the absolute terms of z.
    pub fn size(&self, w: f64) -> f64 {
        self.k.abs() + w * w * self.m.abs() + (w * self.c).abs()
    }
}

/// Matrices split into retained and condensed (local) coordinates; shared by all copies.
pub struct Split {
    n: usize,
    /// old numbers of the retained and of the local coordinates
    pub retained: Vec<usize>,
    pub local: Vec<usize>,
    place: Vec<Place>,
    pub rr: Vec<Entry>,
    pub rl: Vec<Entry>,
    pub lr: Vec<Entry>,
    pub ll: Vec<Entry>,
    /// all entries, kept for stability where the system is small
    all: Vec<Entry>,
    pub symmetric: bool,
    pub forces: Forces,
}

#[derive(Debug, Clone, Copy)]
enum Place {
    Retained(usize),
    Local(usize),
}

impl Split {
    /// Entries without repetition. Coordinates that are free at rest while the retained ones are held join the retained ones.
    pub fn new(n: usize, entries: &[Entry], mut retained: Vec<usize>, forces: Forces) -> Result<Split> {
        loop {
            let split = Split::with(n, entries, retained.clone(), forces.clone());
            if split.local.is_empty() || !split.symmetric {
                return Ok(split);
            }
            let mut at_rest = Ldl::new(&split.pattern())?;
            let values: Vec<c64> = split.ll.iter().map(|e| e.z(0.0)).collect();
            match at_rest.factorise(&values) {
                Ok(()) => return Ok(split),
                Err(pivot) => retained.push(split.local[pivot.0]),
            }
        }
    }

    fn with(n: usize, entries: &[Entry], mut retained: Vec<usize>, forces: Forces) -> Split {
        retained.sort_unstable();
        retained.dedup();
        let mut place = vec![Place::Local(0); n];
        for (i, r) in retained.iter().enumerate() {
            place[*r] = Place::Retained(i);
        }
        let mut local = Vec::new();
        for (i, p) in place.iter_mut().enumerate() {
            if let Place::Local(at) = p {
                *at = local.len();
                local.push(i);
            }
        }
        let mut parts: [Vec<Entry>; 4] = Default::default();
        for e in entries {
            let (part, row, column) = match (place[e.row], place[e.column]) {
                (Place::Retained(i), Place::Retained(j)) => (0, i, j),
                (Place::Retained(i), Place::Local(j)) => (1, i, j),
                (Place::Local(i), Place::Retained(j)) => (2, i, j),
                (Place::Local(i), Place::Local(j)) => (3, i, j),
            };
            parts[part].push(Entry { row, column, ..*e });
        }
        let [rr, rl, lr, mut ll] = parts;
        ll.sort_unstable_by_key(|e| (e.column, e.row));
        let symmetric = is_symmetric(entries);
        Split {
            n,
            retained,
            local,
            place,
            rr,
            rl,
            lr,
            ll,
            all: if n <= STABILITY_COORDINATES { entries.to_vec() } else { Vec::new() },
            symmetric,
            forces,
        }
    }

    /// S = L^T Z R with R = [1; -Z_ll^-1 Z_lr] and L the same of Z^T, its slope L^T Z' R, and the sizes of its terms.
    fn fill(&self, w: f64, right: &Mat<c64>, left: &Mat<c64>, out: &mut Block) {
        let n_r = self.retained.len();
        let pushed = self.pushed(w, right);
        out.s_growth.resize(n_r * n_r, 0.0);
        let mut sizes = vec![0.0; self.local.len()];
        for j in 0..n_r {
            let x = right.col_as_slice(j);
            sizes.fill(0.0);
            for e in &self.ll {
                sizes[e.row] += e.size(w) * x[e.column].l1_norm();
            }
            for i in 0..n_r {
                let (at, l) = (i * n_r + j, left.col_as_slice(i));
                out.s[at] = c64::new(0.0, 0.0);
                out.s_slope[at] = inner(l, pushed.col_as_slice(j));
                out.s_growth[at] = l.iter().zip(&sizes).map(|(l, s)| l.l1_norm() * s).sum();
            }
            for e in &self.rl {
                let at = e.row * n_r + j;
                out.s[at] += e.z(w) * x[e.column];
                out.s_slope[at] += e.z_slope(w) * x[e.column];
                out.s_growth[at] += e.size(w) * x[e.column].l1_norm();
            }
        }
        for e in &self.rr {
            let at = e.row * n_r + e.column;
            out.s[at] += e.z(w);
            out.s_slope[at] += e.z_slope(w);
            out.s_growth[at] += e.size(w);
        }
    }

    /// (Z' R)_l
    fn pushed(&self, w: f64, right: &Mat<c64>) -> Mat<c64> {
        let mut out = Mat::zeros(right.nrows(), right.ncols());
        for e in &self.lr {
            out[(e.row, e.column)] += e.z_slope(w);
        }
        self.add_local(|e| e.z_slope(w), right, &mut out);
        out
    }

    /// Adds A_ll X, column by column.
    fn add_local(&self, a: impl Fn(&Entry) -> c64, x: &Mat<c64>, out: &mut Mat<c64>) {
        for j in 0..x.ncols() {
            let (x, out) = (x.col_as_slice(j), out.col_as_slice_mut(j));
            for e in &self.ll {
                out[e.row] += a(e) * x[e.column];
            }
        }
    }

    fn pattern(&self) -> Pattern {
        let entries: Vec<(usize, usize)> = self.ll.iter().map(|e| (e.row, e.column)).collect();
        Pattern::new(self.local.len(), &entries)
    }
}

/// sum_i a_i b_i, without conjugation
fn inner(a: &[c64], b: &[c64]) -> c64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

fn is_symmetric(entries: &[Entry]) -> bool {
    let mut sorted: Vec<&Entry> = entries.iter().collect();
    sorted.sort_unstable_by_key(|e| (e.row, e.column));
    let mut turned: Vec<&Entry> = entries.iter().collect();
    turned.sort_unstable_by_key(|e| (e.column, e.row));
    let near = |a: f64, b: f64| (a - b).abs() <= SAME_ENTRY * a.abs().max(b.abs());
    sorted
        .iter()
        .zip(&turned)
        .all(|(a, b)| a.row == b.column && a.column == b.row && near(a.m, b.m) && near(a.c, b.c) && near(a.k, b.k))
}

pub struct Condensed {
    pub split: Arc<Split>,
    factor: Factor,
    values: Vec<c64>,
    /// where several terms at once take less time than one by one
    banded: Option<Banded>,
    /// complex products of one term by itself, and of up to `LANES` terms at once
    products: [f64; 2],
}

impl Condensed {
    pub fn new(split: Arc<Split>) -> Result<Condensed> {
        let factor = Factor::new(&split.pattern(), split.symmetric)?;
        let values = vec![c64::new(0.0, 0.0); split.ll.len()];
        let (n_l, n_r) = (split.local.len(), split.retained.len());
        let one = (factor.products(n_r) + (n_r + 1) * split.ll.len()) as f64;
        let most = (LANES as f64 * one / (LANE_PRODUCT * n_l as f64)).sqrt().min(MOST_LANES / n_l as f64);
        let banded = if n_l > 0 { Banded::new(&split, most as usize) } else { None };
        let several = banded.as_ref().map_or(f64::INFINITY, |b| LANE_PRODUCT * b.products(n_r) as f64);
        let banded = banded.filter(|_| several < LANES as f64 * one);
        Ok(Condensed { split, factor, values, banded, products: [one, several] })
    }

    /// Terms that together take less time in lanes than one by one.
    fn in_lanes(&self, terms: usize) -> bool {
        self.banded.is_some() && self.products[1] < terms as f64 * self.products[0]
    }

    /// Blocks of up to `LANES` terms at once; those come back that have to be evaluated one by one.
    fn condense_several(&mut self, tasks: &[Task], blocks: &mut [Block]) -> Vec<Task> {
        let Some(banded) = self.banded.as_mut().filter(|_| tasks.len() > 1) else {
            return tasks.to_vec();
        };
        let left = banded.condense(&self.split, tasks, blocks);
        if left.len() == tasks.len() {
            // rounding that is felt at all of these frequencies is felt at the next ones
            self.banded = None;
        }
        left
    }

    fn factorise(&mut self, w: f64) -> Result<()> {
        for (value, e) in self.values.iter_mut().zip(&self.split.ll) {
            *value = e.z(w);
        }
        self.factor.factorise(&self.values, w)
    }

    /// -Z_ll^-1 Z_lr, and the same for the transposed matrix where that differs.
    fn influence(&mut self, w: f64) -> (Mat<c64>, Option<Mat<c64>>) {
        let (n_l, n_r) = (self.split.local.len(), self.split.retained.len());
        let mut right = Mat::zeros(n_l, n_r);
        for e in &self.split.lr {
            right[(e.row, e.column)] -= e.z(w);
        }
        self.factor.solve(&mut right, false);
        if self.split.symmetric {
            return (right, None);
        }
        let mut left = Mat::zeros(n_l, n_r);
        for e in &self.split.rl {
            left[(e.column, e.row)] -= e.z(w);
        }
        self.factor.solve(&mut left, true);
        (right, Some(left))
    }

    /// -Z_ll^-1 Z_lr and S with what rounding had taken from them; `scale` are the sizes of the entries of S that matter.
    fn refined(
        &mut self,
        w: f64,
        right: Mat<c64>,
        left: Option<&Mat<c64>>,
        scale: &[f64],
        size: &[f64],
    ) -> Result<(Mat<c64>, Vec<c64>)> {
        let split = self.split.clone();
        let n_r = right.ncols();
        let held = Mat::<c64>::identity(n_r, n_r);
        let mut solution = Solution::new(right);
        for _ in 0..REFINEMENTS {
            let mut residual = solution.residual(&split.ll, &split.lr, &held, None, w);
            let missing = left.unwrap_or(&solution.x).transpose() * &residual;
            // the next correction is about the square of this one
            let known = |at: usize| {
                let natural = scale[at] + f64::EPSILON * size[at];
                missing[(at / n_r, at % n_r)].l1_norm() <= f64::EPSILON.sqrt() * natural
            };
            if (0..n_r * n_r).all(known) {
                let s = solution.schur(&split.rr, &split.rl, w) - &missing;
                let s = (0..n_r * n_r).map(|at| s[(at / n_r, at % n_r)]).collect();
                return Ok((solution.x, s));
            }
            self.factor.solve(&mut residual, false);
            solution.add(&residual);
        }
        Err(Error::singular(format!(
            "at {w} rad/s rounding leaves nothing of the condensed stiffness: the structure is divided too finely for numbers of \
             double precision; take fewer elements"
        )))
    }

    /// S and its slope, refined where rounding is felt in one of its entries; L_l comes back.
    fn condense(&mut self, w: f64, out: &mut Block) -> Result<Mat<c64>> {
        self.factorise(w)?;
        let (mut right, left) = self.influence(w);
        let split = self.split.clone();
        split.fill(w, &right, left.as_ref().unwrap_or(&right), out);
        let scale = natural_sizes(w, out);
        if !is_settled(&out.s_growth, &scale) {
            let (x, s) = self.refined(w, right, left.as_ref(), &scale, &out.s_growth)?;
            right = x;
            split.fill(w, &right, left.as_ref().unwrap_or(&right), out);
            out.s = s;
            // what is refined has no other rounding than that of its value
            out.s_growth = scale;
        }
        Ok(left.unwrap_or(right))
    }

    /// The force on the retained coordinates and its slope, given L_l.
    fn condense_force(&mut self, w: f64, force: &[c64], left: &Mat<c64>, out: &mut Block) {
        let split = self.split.clone();
        for (i, old) in split.retained.iter().enumerate() {
            out.force[i] = force[*old];
        }
        if split.local.iter().all(|old| force[*old] == c64::new(0.0, 0.0)) {
            return;
        }
        let v = self.particular(force);
        let mut pushed = Mat::zeros(v.nrows(), 1);
        split.add_local(|e| -e.z_slope(w), &v, &mut pushed);
        for i in 0..split.retained.len() {
            let l = left.col_as_slice(i);
            out.force[i] += l.iter().zip(&split.local).map(|(l, old)| l * force[*old]).sum::<c64>();
            out.force_slope[i] += inner(l, pushed.col_as_slice(0));
        }
        for e in &split.rl {
            out.force_slope[e.row] -= e.z_slope(w) * v[(e.column, 0)];
        }
    }

    /// Z_ll^-1 f_l
    fn particular(&mut self, force: &[c64]) -> Mat<c64> {
        let mut v = Mat::from_fn(self.split.local.len(), 1, |i, _| force[self.split.local[i]]);
        self.factor.solve(&mut v, false);
        v
    }
}

/// sqrt(d_i d_j) with d_i = |S_ii| + w |S_ii'|: sizes of the entries of S in whatever units the coordinates have.
pub fn natural_sizes(w: f64, block: &Block) -> Vec<f64> {
    let n = block.force.len();
    let own = |i: usize| block.s[i * n + i].norm() + w.abs() * block.s_slope[i * n + i].norm();
    let root: Vec<f64> = (0..n).map(|i| own(i).sqrt()).collect();
    (0..n * n).map(|at| root[at / n] * root[at % n]).collect()
}

/// Whether rounding is not felt in any entry; what is not finite is felt.
pub fn is_settled(growth: &[f64], scale: &[f64]) -> bool {
    growth.iter().zip(scale).all(|(growth, scale)| growth.is_finite() && f64::EPSILON * growth <= FELT * scale)
}

fn finite(block: &Block, w: f64) -> Result<()> {
    if block.s.iter().all(|x| x.re.is_finite() && x.im.is_finite()) {
        Ok(())
    } else {
        Err(Error::singular(format!("the condensed coordinates are singular at {w} rad/s; use condense=False")))
    }
}

impl DynamicStiffness for Condensed {
    fn size(&self) -> usize {
        self.split.retained.len()
    }

    fn full_size(&self) -> usize {
        self.split.n
    }

    fn evaluate(&mut self, w: f64, term: usize, block: &mut Block) -> Result<()> {
        let left = self.condense(w, block)?;
        block.force.fill(c64::new(0.0, 0.0));
        block.force_slope.fill(c64::new(0.0, 0.0));
        let forces = self.split.forces.clone();
        if let Some(force) = forces.get(term).and_then(Option::as_ref) {
            self.condense_force(w, force, &left, block);
        }
        finite(block, w)
    }

    fn evaluate_all(&mut self, tasks: &[Task], blocks: &mut [Block]) -> Result<()> {
        let mut alone = Vec::new();
        for some in tasks.chunks(LANES) {
            if self.in_lanes(some.len()) {
                alone.extend(self.condense_several(some, blocks));
            } else {
                alone.extend_from_slice(some);
            }
        }
        alone.into_iter().try_for_each(|(term, w)| self.evaluate(w, term, &mut blocks[term]))
    }

    fn half_bandwidth(&self) -> Option<usize> {
        self.banded.as_ref().map(Banded::half_bandwidth)
    }

    fn products(&self, terms: usize) -> f64 {
        let some = |count: usize| match count as f64 * self.products[0] {
            _ if self.in_lanes(count) => self.products[1],
            alone => alone,
        };
        (terms / LANES) as f64 * some(LANES) + some(terms % LANES)
    }

    fn expand(&mut self, w: f64, term: usize, factor: f64, y: &[c64], x: &mut [c64]) -> Result<()> {
        self.factorise(w)?;
        let split = self.split.clone();
        let mut load = Mat::<c64>::zeros(split.local.len(), 1);
        if let Some(force) = split.forces.get(term).and_then(Option::as_ref) {
            for (l, old) in split.local.iter().enumerate() {
                load[(l, 0)] = force[*old] * factor;
            }
        }
        let held = Mat::from_fn(y.len(), 1, |i, _| y[i]);
        let mut b = load.clone();
        for e in &split.lr {
            b[(e.row, 0)] -= e.z(w) * y[e.column];
        }
        self.factor.solve(&mut b, false);
        let mut solution = Solution::new(b);
        for _ in 0..REFINEMENTS {
            let mut change = solution.residual(&split.ll, &split.lr, &held, Some(&load), w);
            self.factor.solve(&mut change, false);
            solution.add(&change);
            if change.norm_max() <= f64::EPSILON.sqrt() * solution.x.norm_max() {
                break;
            }
        }
        let b = solution.x;
        for (i, old) in split.retained.iter().enumerate() {
            x[*old] = y[i];
        }
        for (l, old) in split.local.iter().enumerate() {
            x[*old] = b[(l, 0)];
        }
        Ok(())
    }

    fn retained(&self) -> Vec<usize> {
        self.split.retained.clone()
    }

    fn matrices(&self) -> Option<Matrices> {
        let n = self.split.n;
        let order = [self.split.retained.as_slice(), &self.split.local].concat();
        let matrix = |part: fn(&Entry) -> f64| {
            let mut out = Mat::zeros(n, n);
            for e in &self.split.all {
                out[(e.row, e.column)] += part(e);
            }
            reordered(&out, &order)
        };
        (n <= STABILITY_COORDINATES).then(|| (matrix(|e| e.m), matrix(|e| e.c), matrix(|e| e.k)))
    }

    fn restrict(&self, x: &[f64], y: &mut [f64]) {
        for (y, old) in y.iter_mut().zip(&self.split.retained) {
            *y = x[*old];
        }
    }

    fn copied(&self) -> Result<Box<dyn DynamicStiffness>> {
        let (factor, banded) = (self.factor.copied(), self.banded.as_ref().map(Banded::copied));
        Ok(Box::new(Condensed { split: self.split.clone(), factor, values: self.values.clone(), banded, ..*self }))
    }

    fn retain(&self, direction: &[(usize, f64)]) -> Result<Vec<(usize, f64)>> {
        let one = |&(i, w): &(usize, f64)| match self.split.place[i] {
            Place::Retained(at) => Ok((at, w)),
            Place::Local(_) => Err(Error::model(format!("an element acts on coordinate {i}, which is condensed"))),
        };
        direction.iter().map(one).collect()
    }
}
