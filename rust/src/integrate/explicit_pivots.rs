//! Which tree coordinates depend on which: Gaussian elimination of the rows of J in an order that is chosen once and kept.
//!
//! ```text
//! R J C = [J_d J_i],   J_d = L U  (lower, upper after ordering by pivots),   x_d = J_d^-1 (b - J_i x_i)
//! ```
//! R and C make rows and columns dimensionless by the characteristic length. The choice takes the largest entries for pivots
//! (generalised coordinate partitioning: Wehage and Haug, J. Mech. Des. 104 (1982) 247-255), position rows before rows of velocities
//! alone, so that the first pivots are those of positions. The rows are those that carry the decided rank. Later values are
//! eliminated in the same order; an entry that has outgrown its pivot tells that another choice would be better.
use std::collections::{BTreeMap, BTreeSet};

use nalgebra::DVector;

use crate::error::{Error, Result};
use crate::multibody::topology::Level;
use crate::tolerances::matrices::TIE;

use super::Equations;
use crate::linalg::matrix::Matrix;
use crate::linalg::rows::Level as Asked;
use crate::multibody::rotations::rotation_triples;

type Row = BTreeMap<usize, f64>;

/// A choice of dependent coordinates, and where its elimination has entries.
pub struct Plan {
    n: usize,
    /// row and column of every pivot, in order
    pub pivots: Vec<(usize, usize)>,
    /// how many of them belong to positions
    pub n_position: usize,
    /// rows that carry the decided rank: more than pivots where the pose has lost rank
    pub n_rows: usize,
    /// coordinates whose rates depend on no others
    pub independent: Vec<usize>,
    row_scale: Vec<f64>,
    column_scale: Vec<f64>,
    /// earlier pivots that act on each row
    lower: Lists,
    /// columns that are left of each row, its pivot's first
    upper: Lists,
}

/// Lists of numbers, one after the other.
#[derive(Default)]
struct Lists {
    start: Vec<usize>,
    item: Vec<usize>,
}

impl Lists {
    fn push(&mut self, items: impl Iterator<Item = usize>) {
        if self.start.is_empty() {
            self.start.push(0);
        }
        self.item.extend(items);
        self.start.push(self.item.len());
    }

    fn range(&self, i: usize) -> std::ops::Range<usize> {
        self.start[i]..self.start[i + 1]
    }
}

/// L and U of one pose.
#[derive(Default)]
pub struct Factors {
    lower: Vec<f64>,
    upper: Vec<f64>,
    /// the largest entry of a row of U over its pivot: one where the choice is the best
    pub worn: f64,
    /// the smallest size of a pivot
    pub least: f64,
}

/// Rows of a matrix, scaled; entries of one place added up.
fn scaled_rows(j: &Matrix, row: &[f64], column: &[f64]) -> Vec<Row> {
    let mut rows = vec![Row::new(); row.len()];
    j.each(|i, k, v| *rows[i].entry(k).or_insert(0.0) += v * row[i] * column[k]);
    rows
}

/// Takes away from a row what earlier pivots eliminate, in their order.
fn reduce(row: &mut Row, pivot_of: &[usize], upper: &[(usize, Row)]) {
    let mut open: BTreeSet<usize> = row.keys().map(|c| pivot_of[*c]).filter(|k| *k != usize::MAX).collect();
    while let Some(k) = open.pop_first() {
        let (column, other) = &upper[k];
        let Some(entry) = row.remove(column) else {
            continue;
        };
        let factor = entry / other[column];
        for (c, v) in other.iter().filter(|(c, _)| *c != column) {
            *row.entry(*c).or_insert(0.0) -= factor * v;
            if pivot_of[*c] != usize::MAX {
                open.insert(pivot_of[*c]);
            }
        }
    }
}

impl Plan {
    /// The choice by the largest pivots: of all rows in small models, of the rows of one joint after the other in large ones.
    pub fn choose(eq: &Equations<'_, f64>, jacobian: &Matrix) -> Self {
        let rows = &eq.topology().rows;
        let (row_scale, column_scale) = (eq.row_scales(), eq.scales());
        let mut values = scaled_rows(jacobian, &row_scale, &column_scale);
        let mut pivot_of = vec![usize::MAX; eq.n()];
        let mut upper: Vec<(usize, Row)> = Vec::new();
        let mut pivots = Vec::new();
        let kept = eq.rows.select(jacobian, Asked::All);
        let mut n_position = 0;
        for level in [Level::Position, Level::Velocity] {
            let of_level: Vec<usize> = kept.iter().copied().filter(|i| rows[*i].level == level).collect();
            let windows: Vec<&[usize]> = if eq.sparse {
                of_level.chunk_by(|a, b| rows[*a].joint == rows[*b].joint).collect()
            } else {
                vec![&of_level]
            };
            for window in windows {
                let mut left = window.to_vec();
                for i in window {
                    reduce(&mut values[*i], &pivot_of, &upper);
                }
                while let Some((at, column)) = largest_entry(&left, &values) {
                    let i = left.remove(at);
                    let row = std::mem::take(&mut values[i]);
                    for other in &left {
                        eliminate(&mut values[*other], &row, column);
                    }
                    pivot_of[column] = pivots.len();
                    pivots.push((i, column));
                    upper.push((column, row));
                }
            }
            if level == Level::Position {
                n_position = pivots.len();
            }
        }
        let independent = (0..eq.n()).filter(|c| pivot_of[*c] == usize::MAX).collect();
        let mut plan = Plan {
            n: eq.n(),
            pivots,
            n_position,
            n_rows: kept.len(),
            independent,
            row_scale,
            column_scale,
            lower: Lists::default(),
            upper: Lists::default(),
        };
        plan.analyse(eq, jacobian, &pivot_of);
        plan
    }

    /// Where elimination fills in: depends on where J has entries, not on their values.
    fn analyse(&mut self, eq: &Equations<'_, f64>, jacobian: &Matrix, pivot_of: &[usize]) {
        let mut places = vec![BTreeSet::new(); self.row_scale.len()];
        jacobian.each(|i, j, _| {
            places[i].insert(j);
        });
        for (first, _) in rotation_triples(eq.topology()) {
            let triple = first..first + 3;
            for row in places.iter_mut().filter(|r| triple.clone().any(|c| r.contains(&c))) {
                row.extend(triple.clone());
            }
        }
        let mut filled: Vec<BTreeSet<usize>> = Vec::new();
        let order: Vec<usize> = self.pivots.iter().map(|p| p.0).collect();
        for (k, i) in order.into_iter().enumerate() {
            let mut row = std::mem::take(&mut places[i]);
            let earlier = |c: &usize| pivot_of[*c] < k;
            let mut open: BTreeSet<usize> = row.iter().filter(|c| earlier(c)).map(|c| pivot_of[*c]).collect();
            let mut acting = Vec::new();
            while let Some(j) = open.pop_first() {
                acting.push(j);
                row.extend(filled[j].iter().copied());
                open.extend(filled[j].iter().filter(|c| earlier(c)).map(|c| pivot_of[*c]).filter(|p| *p > j));
            }
            self.lower.push(acting.into_iter());
            let pivot = self.pivots.get(k).map(|p| p.1);
            row.retain(|c| !earlier(c) && Some(*c) != pivot);
            self.upper.push(pivot.into_iter().chain(row.iter().copied()));
            row.extend(pivot);
            filled.push(row);
        }
    }

    /// Eliminates the rows of J at another pose.
    pub fn factor(&self, jacobian: &Matrix, into: &mut Factors) -> Result<()> {
        let by_row = RowsOf::new(jacobian, self.row_scale.len());
        let n = self.n;
        into.lower.resize(self.lower.item.len(), 0.0);
        into.upper.resize(self.upper.item.len(), 0.0);
        (into.worn, into.least) = (0.0, f64::INFINITY);
        let mut work = vec![0.0; n];
        for (k, i) in self.pivots.iter().map(|p| p.0).enumerate() {
            by_row.each(i, |c, v| work[c] += v * self.row_scale[i] * self.column_scale[c]);
            for at in self.lower.range(k) {
                let pivot = self.upper.range(self.lower.item[at]);
                let column = self.upper.item[pivot.start];
                let factor = work[column] / into.upper[pivot.start];
                work[column] = 0.0;
                into.lower[at] = factor;
                for u in pivot.start + 1..pivot.end {
                    work[self.upper.item[u]] -= factor * into.upper[u];
                }
            }
            let row = self.upper.range(k);
            let pivot = work[self.upper.item[row.start]];
            if pivot == 0.0 || !pivot.is_finite() {
                return Err(Error::singular("the chosen coordinates determine no others here"));
            }
            into.least = into.least.min(pivot.abs());
            for u in row {
                let c = self.upper.item[u];
                into.upper[u] = std::mem::take(&mut work[c]);
                into.worn = into.worn.max((into.upper[u] / pivot).abs());
            }
        }
        Ok(())
    }

    /// x_d of J x = b in the first `pivots` rows, b = 0 where there is none; x holds the independent ones and takes the others.
    pub fn depend(&self, f: &Factors, b: Option<&[f64]>, x: &mut [f64], pivots: usize) {
        let mut z = vec![0.0; pivots];
        if let Some(b) = b {
            for k in 0..pivots {
                let i = self.pivots[k].0;
                let mut sum = b[i] * self.row_scale[i];
                for at in self.lower.range(k) {
                    sum -= f.lower[at] * z[self.lower.item[at]];
                }
                z[k] = sum;
            }
        }
        for k in (0..pivots).rev() {
            let row = self.upper.range(k);
            let column = self.upper.item[row.start];
            let mut sum = z[k];
            for u in row.start + 1..row.end {
                let c = self.upper.item[u];
                sum -= f.upper[u] * x[c] / self.column_scale[c];
            }
            x[column] = sum / f.upper[row.start] * self.column_scale[column];
        }
    }

    /// What the rows of its position pivots have of these values; zero elsewhere.
    pub fn carried(&self, phi: &DVector<f64>) -> DVector<f64> {
        let mut out = DVector::zeros(phi.len());
        self.pivots[..self.n_position].iter().for_each(|(i, _)| out[*i] = phi[*i]);
        out
    }

    /// The same coordinates depend on the same others.
    pub fn agrees(&self, other: &Self) -> bool {
        let places = |p: &Self| p.pivots[..p.n_position].iter().map(|p| p.1).collect::<BTreeSet<_>>();
        self.independent == other.independent && places(self) == places(other)
    }
}

/// The largest entry of some rows, where there is one: place in `rows`, and column.
fn largest_entry(rows: &[usize], values: &[Row]) -> Option<(usize, usize)> {
    let of = |(at, i): (usize, &usize)| values[*i].iter().map(move |(c, v)| (at, *c, v.abs()));
    let all: Vec<_> = rows.iter().enumerate().flat_map(of).collect();
    let most = all.iter().fold(0.0_f64, |s, e| s.max(e.2));
    (most > 0.0).then(|| all.iter().find(|e| e.2 >= (1.0 - TIE) * most)).flatten().map(|e| (e.0, e.1))
}

fn eliminate(row: &mut Row, pivot: &Row, column: usize) {
    let Some(entry) = row.remove(&column) else {
        return;
    };
    let factor = entry / pivot[&column];
    for (c, v) in pivot.iter().filter(|(c, _)| **c != column) {
        *row.entry(*c).or_insert(0.0) -= factor * v;
    }
}

/// Entries of a matrix row by row.
enum RowsOf<'a> {
    Dense(&'a nalgebra::DMatrix<f64>),
    List { start: Vec<u32>, entry: Vec<(u32, f64)> },
}

impl<'a> RowsOf<'a> {
    fn new(m: &'a Matrix, rows: usize) -> Self {
        let t = match m {
            Matrix::Dense(m) => return RowsOf::Dense(m),
            Matrix::Sparse(t) => t,
        };
        let mut start = vec![0_u32; rows + 1];
        for (i, _, _) in &t.list {
            start[*i as usize + 1] += 1;
        }
        for i in 0..rows {
            start[i + 1] += start[i];
        }
        let mut next = start.clone();
        let mut entry = vec![(0, 0.0); t.list.len()];
        for (i, j, v) in &t.list {
            entry[next[*i as usize] as usize] = (*j, *v);
            next[*i as usize] += 1;
        }
        RowsOf::List { start, entry }
    }

    fn each(&self, i: usize, mut visit: impl FnMut(usize, f64)) {
        match self {
            RowsOf::Dense(m) => (0..m.ncols()).for_each(|c| visit(c, m[(i, c)])),
            RowsOf::List { start, entry } => {
                for (c, v) in &entry[start[i] as usize..start[i + 1] as usize] {
                    visit(*c as usize, *v);
                }
            }
        }
    }
}
