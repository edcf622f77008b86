//! Factorisations of the dynamic stiffness of the condensed coordinates, one per harmonic with one symbolic analysis for all.
//!
//! Symmetric matrices take L D L^T in complex arithmetic with a fixed order (up-looking, T. A. Davis, ACM TOMS 31 (2005) 587-591):
//! several times cheaper than LU with pivoting, and checked, since without pivots a small one may spoil it.
use faer::prelude::*;
use faer::sparse::linalg::amd;
use faer::sparse::linalg::solvers::{Lu, SymbolicLu};
use faer::sparse::{SparseColMat, SymbolicSparseColMat, SymbolicSparseColMatRef};
use faer::{Mat, dyn_stack};
use num_complex::Complex64 as c64;

use crate::error::{Error, Result};
use crate::tolerances::matrices::PIVOT;

/// Entries (row, column, position of the value) of a sparse matrix by columns.
#[derive(Clone)]
pub struct Pattern {
    pub n: usize,
    pub start: Vec<usize>,
    pub row: Vec<usize>,
}

impl Pattern {
    /// From entries sorted by column and row without repetition.
    pub fn new(n: usize, entries: &[(usize, usize)]) -> Pattern {
        let mut start = vec![0; n + 1];
        for (_, column) in entries {
            start[column + 1] += 1;
        }
        for i in 0..n {
            start[i + 1] += start[i];
        }
        Pattern { n, start, row: entries.iter().map(|e| e.0).collect() }
    }
}

pub enum Factor {
    Symmetric(Box<Ldl>),
    General(Box<General>),
}

/// LU with partial pivoting.
pub struct General {
    symbolic: SymbolicLu<usize>,
    pattern: SymbolicSparseColMat<usize>,
    lu: Option<Lu<usize, c64>>,
}

impl Factor {
    pub fn new(pattern: &Pattern, symmetric: bool) -> Result<Factor> {
        if symmetric {
            return Ok(Factor::Symmetric(Box::new(Ldl::new(pattern)?)));
        }
        let own =
            SymbolicSparseColMat::new_checked(pattern.n, pattern.n, pattern.start.clone(), None, pattern.row.clone());
        let symbolic = SymbolicLu::try_new(own.as_ref()).map_err(out_of_memory)?;
        Ok(Factor::General(Box::new(General { symbolic, pattern: own, lu: None })))
    }

    /// The same analysis, for other values.
    pub fn copied(&self) -> Factor {
        match self {
            Factor::Symmetric(ldl) => Factor::Symmetric(ldl.clone()),
            Factor::General(general) => {
                let (symbolic, pattern) = (general.symbolic.clone(), general.pattern.clone());
                Factor::General(Box::new(General { symbolic, pattern, lu: None }))
            }
        }
    }

    /// Values in the order of the pattern. `SingularError` names the frequency.
    pub fn factorise(&mut self, values: &[c64], w: f64) -> Result<()> {
        let singular = || {
            Error::singular(format!("the coordinates that are condensed are singular at {w} rad/s; use condense=False"))
        };
        match self {
            Factor::Symmetric(ldl) => ldl.factorise(values).map_err(|_| singular()),
            Factor::General(general) => {
                let matrix = SparseColMat::new(general.pattern.clone(), values.to_vec());
                let symbolic = general.symbolic.clone();
                let lu = Lu::try_new_with_symbolic(symbolic, matrix.as_ref()).map_err(|_| singular())?;
                general.lu = Some(lu);
                Ok(())
            }
        }
    }

    /// About as many complex products take one factorisation and solutions with so many right sides; where pivots decide on the entries
    /// of the factors, at least.
    pub fn products(&self, columns: usize) -> usize {
        match self {
            Factor::Symmetric(ldl) => products(&ldl.l_start, columns),
            Factor::General(general) => 2 * products(general.pattern.col_ptr(), columns),
        }
    }

    /// X <- A^-1 X, or A^-T X.
    pub fn solve(&mut self, x: &mut Mat<c64>, transposed: bool) {
        match self {
            Factor::Symmetric(ldl) => {
                for column in 0..x.ncols() {
                    ldl.solve(x.col_mut(column));
                }
            }
            Factor::General(general) => match &general.lu {
                Some(lu) if transposed => lu.solve_transpose_in_place(x),
                Some(lu) => lu.solve_in_place(x),
                None => {}
            },
        }
    }
}

/// Of factors whose columns begin there.
fn products(start: &[usize], columns: usize) -> usize {
    let each = start.windows(2).map(|at| at[1] - at[0]);
    each.map(|entries| 1 + entries * (entries + 2 * columns)).sum()
}

fn out_of_memory<E>(_: E) -> Error {
    Error::singular("the sparse factorisation ran out of memory; reduce the system first")
}

/// L D L^T of a complex symmetric matrix (not Hermitian); the order is that of approximate minimum degree, or the given one where
/// that fills in no more, and its numbers follow the elimination tree, so that neighbours lie near each other in memory.
#[derive(Clone)]
pub struct Ldl {
    n: usize,
    /// new place of each old index, and the reverse
    place: Vec<usize>,
    old: Vec<usize>,
    /// upper triangle in the new order: per column the rows and the positions of their values
    start: Vec<usize>,
    row: Vec<usize>,
    position: Vec<usize>,
    /// per row of L its columns, in the order in which they are eliminated
    order_start: Vec<usize>,
    order: Vec<usize>,
    l_start: Vec<usize>,
    l_row: Vec<usize>,
    l: Vec<c64>,
    inverse: Vec<c64>,
    scratch: Vec<c64>,
    /// entries of each column of L so far
    filled: Vec<usize>,
}

/// The old index whose pivot vanished.
#[derive(Debug, Clone, Copy)]
pub struct ZeroPivot(pub usize);

const NONE: usize = usize::MAX;

/// Upper triangle by columns in a new order.
struct Upper {
    start: Vec<usize>,
    row: Vec<usize>,
    position: Vec<usize>,
}

impl Upper {
    fn new(pattern: &Pattern, place: &[usize]) -> Upper {
        let mut columns: Vec<Vec<(usize, usize)>> = vec![Vec::new(); pattern.n];
        for column in 0..pattern.n {
            for at in pattern.start[column]..pattern.start[column + 1] {
                let (i, j) = (place[pattern.row[at]], place[column]);
                if i <= j {
                    columns[j].push((i, at));
                }
            }
        }
        let mut start = vec![0];
        let (mut row, mut position) = (Vec::new(), Vec::new());
        for mut column in columns {
            column.sort_unstable();
            for (i, at) in column {
                row.push(i);
                position.push(at);
            }
            start.push(row.len());
        }
        Upper { start, row, position }
    }
}

fn minimum_degree(pattern: &Pattern) -> Result<Vec<usize>> {
    let n = pattern.n;
    let (mut old, mut place) = (vec![0_usize; n], vec![0_usize; n]);
    let symbolic = SymbolicSparseColMatRef::new_checked(n, n, &pattern.start, None, &pattern.row);
    let scratch = amd::order_scratch::<usize>(n, pattern.row.len());
    let mut memory = dyn_stack::MemBuffer::try_new(scratch).map_err(out_of_memory)?;
    amd::order(&mut old, &mut place, symbolic, amd::Control::default(), dyn_stack::MemStack::new(&mut memory))
        .map_err(out_of_memory)?;
    Ok(old)
}

fn inverse_of(old: &[usize]) -> Vec<usize> {
    let mut place = vec![0; old.len()];
    for (new, o) in old.iter().enumerate() {
        place[*o] = new;
    }
    place
}

impl Ldl {
    pub fn new(pattern: &Pattern) -> Result<Ldl> {
        let n = pattern.n;
        let given: Vec<usize> = (0..n).collect();
        let degree = minimum_degree(pattern)?;
        let found = Upper::new(pattern, &inverse_of(&degree));
        let (parent, l_start) = elimination_tree(n, &found, usize::MAX).ok_or_else(|| out_of_memory(()))?;
        let old = match elimination_tree(n, &Upper::new(pattern, &given), l_start[n]) {
            Some(_) => given,
            None => postorder(&parent).into_iter().map(|i| degree[i]).collect(),
        };
        let place = inverse_of(&old);
        let upper = Upper::new(pattern, &place);
        let (parent, l_start) = elimination_tree(n, &upper, usize::MAX).ok_or_else(|| out_of_memory(()))?;
        let (order_start, order) = elimination_order(n, &upper, &parent);
        let zero = c64::new(0.0, 0.0);
        let nonzeros = l_start[n];
        let mut ldl = Ldl {
            n,
            place,
            old,
            start: upper.start,
            row: upper.row,
            position: upper.position,
            order_start,
            order,
            l_row: vec![0; nonzeros],
            l: vec![zero; nonzeros],
            l_start,
            inverse: vec![zero; n],
            scratch: vec![zero; n],
            filled: vec![0; n],
        };
        ldl.place_rows();
        Ok(ldl)
    }

    /// Where the entries of L lie does not depend on their values.
    fn place_rows(&mut self) {
        for k in 0..self.n {
            for &i in &self.order[self.order_start[k]..self.order_start[k + 1]] {
                self.l_row[self.l_start[i] + self.filled[i]] = k;
                self.filled[i] += 1;
            }
        }
    }

    pub fn factorise(&mut self, values: &[c64]) -> std::result::Result<(), ZeroPivot> {
        let y = &mut self.scratch;
        self.filled.fill(0);
        for k in 0..self.n {
            let mut size = 0.0_f64;
            for at in self.start[k]..self.start[k + 1] {
                let value = values[self.position[at]];
                y[self.row[at]] += value;
                size = size.max(value.l1_norm());
            }
            let mut d = y[k];
            y[k] = c64::new(0.0, 0.0);
            for &i in &self.order[self.order_start[k]..self.order_start[k + 1]] {
                let y_i = y[i];
                y[i] = c64::new(0.0, 0.0);
                let (first, end) = (self.l_start[i], self.l_start[i] + self.filled[i]);
                for (l, row) in self.l[first..end].iter().zip(&self.l_row[first..end]) {
                    y[*row] -= l * y_i;
                }
                let l = y_i * self.inverse[i];
                d -= l * y_i;
                self.l[end] = l;
                self.filled[i] += 1;
            }
            let pivot = d.l1_norm();
            if pivot <= PIVOT * size || !pivot.is_finite() {
                y.fill(c64::new(0.0, 0.0));
                return Err(ZeroPivot(self.old[k]));
            }
            self.inverse[k] = 1.0 / d;
        }
        Ok(())
    }

    pub fn solve(&mut self, mut x: faer::ColMut<'_, c64>) {
        let y = &mut self.scratch;
        for (i, place) in self.place.iter().enumerate() {
            y[*place] = x[i];
        }
        // what comes before the first entry stays zero
        let first = y.iter().position(|y| *y != c64::new(0.0, 0.0)).unwrap_or(self.n);
        for j in first..self.n {
            let y_j = y[j];
            let part = self.l_start[j]..self.l_start[j + 1];
            for (l, row) in self.l[part.clone()].iter().zip(&self.l_row[part]) {
                y[*row] -= l * y_j;
            }
        }
        for j in (0..self.n).rev() {
            let mut sum = y[j] * self.inverse[j];
            let part = self.l_start[j]..self.l_start[j + 1];
            for (l, row) in self.l[part.clone()].iter().zip(&self.l_row[part]) {
                sum -= l * y[*row];
            }
            y[j] = sum;
        }
        for (i, place) in self.place.iter().enumerate() {
            x[i] = y[*place];
        }
        y.fill(c64::new(0.0, 0.0));
    }
}

/// Parents of the elimination tree and where the columns of L begin; None where L has more than `most` entries.
fn elimination_tree(n: usize, upper: &Upper, most: usize) -> Option<(Vec<usize>, Vec<usize>)> {
    let (mut parent, mut count, mut mark) = (vec![NONE; n], vec![0; n], vec![NONE; n]);
    let mut entries = 0;
    for k in 0..n {
        mark[k] = k;
        for r in &upper.row[upper.start[k]..upper.start[k + 1]] {
            let mut i = *r;
            while mark[i] != k {
                if parent[i] == NONE {
                    parent[i] = k;
                }
                count[i] += 1;
                entries += 1;
                mark[i] = k;
                i = parent[i];
            }
        }
        if entries > most {
            return None;
        }
    }
    let mut l_start = vec![0; n + 1];
    for i in 0..n {
        l_start[i + 1] = l_start[i] + count[i];
    }
    Some((parent, l_start))
}

/// Children before their parents, each subtree together.
fn postorder(parent: &[usize]) -> Vec<usize> {
    let n = parent.len();
    let (mut first, mut next) = (vec![NONE; n], vec![NONE; n]);
    let mut stack = Vec::new();
    for i in (0..n).rev() {
        match parent[i] {
            NONE => stack.push(i),
            p => (next[i], first[p]) = (first[p], i),
        }
    }
    stack.reverse();
    let mut out = Vec::with_capacity(n);
    while let Some(&i) = stack.last() {
        let child = first[i];
        if child == NONE {
            out.push(i);
            stack.pop();
        } else {
            first[i] = next[child];
            stack.push(child);
        }
    }
    out
}

/// Per row of L the columns of its entries: a path of the tree is eliminated before what was found of the row so far.
fn elimination_order(n: usize, upper: &Upper, parent: &[usize]) -> (Vec<usize>, Vec<usize>) {
    let mut mark = vec![NONE; n];
    let (mut starts, mut all) = (vec![0], Vec::new());
    let (mut path, mut order) = (Vec::new(), Vec::new());
    for k in 0..n {
        mark[k] = k;
        order.clear();
        for r in &upper.row[upper.start[k]..upper.start[k + 1]] {
            let mut i = *r;
            path.clear();
            while mark[i] != k {
                path.push(i);
                mark[i] = k;
                i = parent[i];
            }
            order.extend(path.drain(..).rev());
        }
        all.extend(order.iter().rev());
        starts.push(all.len());
    }
    (starts, all)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A ring with chords: fill-in, and an elimination tree that is not a path.
    fn example(n: usize, symmetric: bool) -> (Pattern, Vec<c64>, Mat<c64>) {
        let mut a = Mat::<c64>::zeros(n, n);
        for i in 0..n {
            a[(i, i)] += c64::new(2.0 + 0.3 * i as f64, 0.1);
            for (step, value) in [(1, -1.0), (7, 0.4)] {
                let j = (i + step) % n;
                a[(i, j)] += c64::new(value, 0.05 * i as f64);
                a[(j, i)] += if symmetric { c64::new(value, 0.05 * i as f64) } else { c64::new(0.5 * value, 0.2) };
            }
        }
        let mut entries = Vec::new();
        for j in 0..n {
            entries.extend((0..n).filter(|i| a[(*i, j)].norm() > 0.0).map(|i| (i, j)));
        }
        let values = entries.iter().map(|e| a[*e]).collect();
        (Pattern::new(n, &entries), values, a)
    }

    #[test]
    fn both_factorisations_solve() {
        for symmetric in [true, false] {
            let (pattern, values, a) = example(40, symmetric);
            let mut factor = Factor::new(&pattern, symmetric).unwrap();
            for _ in 0..2 {
                factor.factorise(&values, 1.0).unwrap();
                let x = Mat::from_fn(40, 2, |i, j| c64::new((i + j) as f64, 1.0));
                for transposed in [false, true] {
                    let mut b = if transposed { a.transpose() * &x } else { &a * &x };
                    factor.solve(&mut b, transposed);
                    assert!((b - &x).norm_max() < 1e-12);
                }
            }
        }
    }

    #[test]
    fn a_vanishing_pivot_is_named() {
        let pattern = Pattern::new(2, &[(0, 0), (1, 0), (0, 1), (1, 1)]);
        let one = c64::new(1.0, 0.0);
        let mut ldl = Ldl::new(&pattern).unwrap();
        assert!(ldl.factorise(&[one, -one, -one, one]).is_err());
        assert!(ldl.factorise(&[one, -one, -one, one * 2.0]).is_ok());
    }
}
