//! Sparse matrices in compressed columns, and factorisations that are checked: faer's pivots silently turn into infinities.
use std::cell::RefCell;
use std::sync::{Arc, Mutex, PoisonError};

use faer::dyn_stack::{MemBuffer, MemStack, StackReq};
use faer::sparse::linalg::SupernodalThreshold;
use faer::sparse::linalg::cholesky::{
    CholeskySymbolicParams, LdltRef, LltRef, SymbolicCholesky, SymbolicCholeskyRaw, factorize_symbolic_cholesky,
};
use faer::sparse::linalg::lu::simplicial::{
    SimplicialLu, factorize_simplicial_numeric_lu, factorize_simplicial_numeric_lu_scratch,
};
use faer::sparse::linalg::lu::{LuRef, NumericLu, SymbolicLu, factorize_symbolic_lu};
use faer::sparse::{SparseColMatRef, SymbolicSparseColMatRef};
use faer::{Conj, Mat, MatMut, MatRef, Par, Side, c64};

use crate::error::{Error, Result};
use crate::linalg::field::Field;
use crate::tolerances::matrices::{INERTIA_RESIDUAL, SAME_ENTRY};

/// Compressed columns with sorted, unique row indices.
#[derive(Debug, Clone)]
pub struct Csc {
    pub rows: usize,
    pub cols: usize,
    pub start: Vec<u32>,
    pub row: Vec<u32>,
    pub value: Vec<f64>,
}

impl Csc {
    /// From the three arrays of `scipy.sparse.csc_matrix`; duplicates are summed, rows are sorted.
    pub fn new(name: &str, rows: usize, cols: usize, start: &[i64], row: &[i64], value: &[f64]) -> Result<Self> {
        let bad = |why: &str| Err(Error::model(format!("sparse matrix {name}: {why}")));
        if start.len() != cols + 1 || start.first() != Some(&0) || start.windows(2).any(|w| w[1] < w[0]) {
            return bad("its column pointers do not describe its columns");
        }
        if start[cols] as usize != row.len() || row.len() != value.len() {
            return bad("its indices and values have different lengths");
        }
        if row.iter().any(|r| *r < 0 || *r as usize >= rows) {
            return bad("a row index lies outside");
        }
        if value.iter().any(|v| !v.is_finite()) {
            return bad("it contains NaN or infinite entries");
        }
        if value.len() > (u32::MAX / 4) as usize || rows.max(cols) > (u32::MAX / 4) as usize {
            return bad("it is too large for 32-bit indices");
        }
        let triplets = (0..cols).flat_map(|j| (start[j] as usize..start[j + 1] as usize).map(move |k| (j, k)));
        let entries = triplets.map(|(j, k)| (row[k] as usize, j, value[k])).collect();
        Ok(Self::from_entries(rows, cols, entries))
    }

    pub fn from_entries(rows: usize, cols: usize, mut entries: Vec<(usize, usize, f64)>) -> Self {
        if !entries.windows(2).all(|w| (w[0].1, w[0].0) < (w[1].1, w[1].0)) {
            entries.sort_by_key(|e| (e.1, e.0));
        }
        let mut out = Csc {
            rows,
            cols,
            start: vec![0; cols + 1],
            row: Vec::with_capacity(entries.len()),
            value: Vec::with_capacity(entries.len()),
        };
        let mut last = None;
        for (i, j, v) in entries {
            if last == Some((i, j)) {
                if let Some(sum) = out.value.last_mut() {
                    *sum += v;
                }
                continue;
            }
            last = Some((i, j));
            out.row.push(i as u32);
            out.value.push(v);
            out.start[j + 1] = out.row.len() as u32;
        }
        for j in 0..cols {
            out.start[j + 1] = out.start[j + 1].max(out.start[j]);
        }
        out
    }

    pub fn entries(&self) -> impl Iterator<Item = (usize, usize, f64)> + '_ {
        (0..self.cols).flat_map(move |j| self.column(j).map(move |(i, v)| (i, j, v)))
    }

    pub fn column(&self, j: usize) -> impl Iterator<Item = (usize, f64)> + '_ {
        let range = self.start[j] as usize..self.start[j + 1] as usize;
        self.row[range.clone()].iter().zip(&self.value[range]).map(|(i, v)| (*i as usize, *v))
    }

    /// a self + b other, on the union of both patterns. `other` may be smaller; it then takes the leading block.
    pub fn combined(&self, a: f64, b: f64, other: &Csc) -> Csc {
        let first = self.entries().map(|(i, j, v)| (i, j, a * v));
        let second = other.entries().map(|(i, j, v)| (i, j, b * v));
        let mut entries: Vec<_> = first.collect();
        if b != 0.0 {
            entries.extend(second);
        }
        Csc::from_entries(self.rows, self.cols, entries)
    }

    pub fn transposed(&self) -> Csc {
        Csc::from_entries(self.cols, self.rows, self.entries().map(|(i, j, v)| (j, i, v)).collect())
    }

    pub fn diagonal(&self) -> Vec<f64> {
        (0..self.cols).map(|j| self.column(j).find(|(i, _)| *i == j).map_or(0.0, |(_, v)| v)).collect()
    }

    /// Rows and columns of the leading block that starts at `first`.
    pub fn block(&self, rows: std::ops::Range<usize>, cols: std::ops::Range<usize>) -> Csc {
        let inside = self.entries().filter(|(i, j, _)| rows.contains(i) && cols.contains(j));
        let entries = inside.map(|(i, j, v)| (i - rows.start, j - cols.start, v)).collect();
        Csc::from_entries(rows.len(), cols.len(), entries)
    }

    /// Symmetric up to rounding of each entry.
    pub fn is_symmetric(&self) -> bool {
        if self.rows != self.cols {
            return false;
        }
        let tol = SAME_ENTRY * self.value.iter().fold(0.0_f64, |a, v| a.max(v.abs()));
        // one pointer per column walks down the entries below the diagonal while the mirrored ones come by in order
        let mut next: Vec<u32> = self.start[..self.cols].to_vec();
        for (i, j, v) in self.entries() {
            if v.abs() <= tol {
                continue;
            }
            let end = self.start[i + 1];
            while next[i] < end && (self.row[next[i] as usize] as usize) < j {
                next[i] += 1;
            }
            let at = next[i] as usize;
            let mirror = if next[i] < end && self.row[at] as usize == j { self.value[at] } else { 0.0 };
            if (v - mirror).abs() > tol {
                return false;
            }
        }
        true
    }

    pub fn get(&self, i: usize, j: usize) -> f64 {
        let range = self.start[j] as usize..self.start[j + 1] as usize;
        match self.row[range.clone()].binary_search(&(i as u32)) {
            Ok(k) => self.value[range.start + k],
            Err(_) => 0.0,
        }
    }

    /// out = A x, or out += A x.
    pub fn multiply<T: Field>(&self, x: MatRef<'_, T>, mut out: MatMut<'_, T>, add: bool) {
        if !add {
            out.fill(T::real(0.0));
        }
        for c in 0..x.ncols() {
            let (Some(x), Some(y)) = (x.col(c).try_as_col_major().map(|x| x.as_slice()), out.rb_mut_col(c)) else {
                continue;
            };
            for (j, xj) in x.iter().enumerate() {
                let range = self.start[j] as usize..self.start[j + 1] as usize;
                for (i, v) in self.row[range.clone()].iter().zip(&self.value[range]) {
                    y[*i as usize] += *xj * *v;
                }
            }
        }
    }

    fn as_faer(&self) -> SparseColMatRef<'_, u32, f64> {
        SparseColMatRef::new(self.pattern(), &self.value)
    }

    pub fn pattern(&self) -> SymbolicSparseColMatRef<'_, u32> {
        SymbolicSparseColMatRef::new_checked(self.rows, self.cols, &self.start, None, &self.row)
    }

    /// The values of this matrix at the entries of a pattern that contains its own.
    pub fn spread_over(&self, pattern: &Csc) -> Vec<f64> {
        pattern.entries().map(|(i, j, _)| self.get(i, j)).collect()
    }
}

/// A column of a column-major matrix as a slice.
trait ColumnSlice<T> {
    fn rb_mut_col(&mut self, j: usize) -> Option<&mut [T]>;
}

impl<T> ColumnSlice<T> for MatMut<'_, T> {
    fn rb_mut_col(&mut self, j: usize) -> Option<&mut [T]> {
        use faer::prelude::ReborrowMut;
        self.rb_mut().col_mut(j).try_as_col_major_mut().map(|c| c.as_slice_mut())
    }
}

enum Kind {
    Llt { symbolic: SymbolicCholesky<u32>, value: Vec<f64> },
    Lu(Lu<f64>),
}

/// Factors of a square matrix, real or complex.
pub struct Lu<T> {
    symbolic: Arc<SymbolicLu<u32>>,
    numeric: NumericLu<u32, T>,
}

impl<T: Field> Lu<T> {
    /// Of the matrix with the entries of `pattern` and these values.
    pub fn new(pattern: &Csc, value: &[T], plan: &LuPlan) -> Result<Self> {
        let symbolic = plan.of(pattern)?;
        let mut numeric = NumericLu::new();
        let mut memory = MemBuffer::try_new(symbolic.factorize_numeric_lu_scratch::<T>(Par::Seq, Default::default()))
            .map_err(|e| failed("allocation", e))?;
        let a = SparseColMatRef::new(pattern.pattern(), value);
        symbolic
            .factorize_numeric_lu(&mut numeric, a, Par::Seq, MemStack::new(&mut memory), Default::default())
            .map_err(|e| failed("factorisation", e))?;
        Ok(Lu { symbolic, numeric })
    }

    fn factors(&self) -> LuRef<'_, u32, T> {
        LuRef::new_unchecked(&self.symbolic, &self.numeric)
    }

    pub fn solve(&self, rhs: MatMut<'_, T>) {
        let mut memory = MemBuffer::new(self.symbolic.solve_in_place_scratch::<T>(rhs.ncols(), Par::Seq));
        self.factors().solve_in_place_with_conj(Conj::No, rhs, Par::Seq, MemStack::new(&mut memory));
    }

    pub fn solve_transposed(&self, rhs: MatMut<'_, T>) {
        let mut memory = MemBuffer::new(self.symbolic.solve_transpose_in_place_scratch::<T>(rhs.ncols(), Par::Seq));
        self.factors().solve_transpose_in_place_with_conj(Conj::No, rhs, Par::Seq, MemStack::new(&mut memory));
    }
}

/// The argument of the determinant of a complex matrix, up to whole turns; None where a pivot is zero.
pub fn argument_of_determinant(pattern: &Csc, value: &[c64], plan: &LuPlan) -> Result<Option<f64>> {
    let n = pattern.rows;
    let symbolic = plan.of(pattern)?;
    let (mut row, mut inverse) = (vec![0_u32; n], vec![0_u32; n]);
    let mut factors = SimplicialLu::<u32, c64>::new();
    let mut memory = MemBuffer::try_new(factorize_simplicial_numeric_lu_scratch::<u32, c64>(n, n))
        .map_err(|e| failed("allocation", e))?;
    let done = factorize_simplicial_numeric_lu(
        &mut row,
        &mut inverse,
        &mut factors,
        SparseColMatRef::new(pattern.pattern(), value),
        symbolic.col_perm(),
        MemStack::new(&mut memory),
    );
    if done.is_err() {
        return Ok(None);
    }
    let upper = factors.u_factor_unsorted();
    let mut product = c64::new(1.0, 0.0);
    for j in 0..n {
        // the pivot is the last entry of its column
        let pivot = upper.val()[upper.col_ptr()[j + 1] as usize - 1];
        let size = pivot.norm();
        if size.is_nan() || size <= 0.0 || size.is_infinite() {
            return Ok(None);
        }
        product *= pivot / size;
    }
    let odd = is_odd(&row) != is_odd(symbolic.col_perm().arrays().0);
    Ok(Some(if odd { -product } else { product }.arg()))
}

fn is_odd(permutation: &[u32]) -> bool {
    let mut seen = vec![false; permutation.len()];
    let mut odd = false;
    for first in 0..permutation.len() {
        let mut at = first;
        while !seen[at] {
            seen[at] = true;
            at = permutation[at] as usize;
            odd ^= at != first;
        }
    }
    odd
}

/// The elimination order of a pattern, kept for matrices that differ in values alone.
#[derive(Default)]
pub struct LuPlan(RefCell<Option<Ordered>>);

struct Ordered {
    start: Vec<u32>,
    row: Vec<u32>,
    symbolic: Arc<SymbolicLu<u32>>,
}

impl LuPlan {
    fn of(&self, a: &Csc) -> Result<Arc<SymbolicLu<u32>>> {
        let mut kept = self.0.borrow_mut();
        if let Some(known) = kept.as_ref()
            && known.start == a.start
            && known.row == a.row
        {
            return Ok(known.symbolic.clone());
        }
        let symbolic =
            factorize_symbolic_lu(a.as_faer().symbolic(), Default::default()).map_err(|e| failed("ordering", e))?;
        let symbolic = Arc::new(symbolic);
        *kept = Some(Ordered { start: a.start.clone(), row: a.row.clone(), symbolic: symbolic.clone() });
        Ok(symbolic)
    }
}

/// A sparse matrix ready for solves.
pub struct Factor {
    n: usize,
    kind: Kind,
    memory: Mutex<MemBuffer>,
}

impl Factor {
    fn with(n: usize, kind: Kind) -> Self {
        Factor { n, kind, memory: Mutex::new(MemBuffer::new(StackReq::EMPTY)) }
    }
}

fn failed(what: &str, error: impl std::fmt::Debug) -> Error {
    Error::singular(format!("sparse {what} failed: {error:?}"))
}

impl Factor {
    /// Cholesky; None where the matrix is not safely positive definite: a pivot is noise of the diagonal entry it came from.
    pub fn cholesky(a: &Csc, smallest_pivot: f64) -> Result<Option<Self>> {
        let diagonal = a.diagonal();
        if diagonal.iter().any(|d| *d <= 0.0) {
            return Ok(None);
        }
        let symbolic =
            factorize_symbolic_cholesky(a.as_faer().symbolic(), Side::Upper, Default::default(), Default::default())
                .map_err(|e| failed("ordering", e))?;
        let mut value = vec![0.0; symbolic.len_val()];
        let mut memory =
            MemBuffer::try_new(symbolic.factorize_numeric_llt_scratch::<f64>(Par::Seq, Default::default()))
                .map_err(|e| failed("allocation", e))?;
        let done = symbolic.factorize_numeric_llt(
            &mut value,
            a.as_faer(),
            Side::Upper,
            Default::default(),
            Par::Seq,
            MemStack::new(&mut memory),
            Default::default(),
        );
        if done.is_err() {
            return Ok(None);
        }
        let pivots = pivots(&symbolic, &value);
        let order = symbolic.perm().map(|p| p.arrays().0.to_vec());
        let safe = pivots.iter().enumerate().all(|(k, p)| {
            let i = order.as_ref().map_or(k, |o| o[k] as usize);
            p * p > smallest_pivot * diagonal[i]
        });
        if !safe {
            return Ok(None);
        }
        Ok(Some(Factor::with(a.rows, Kind::Llt { symbolic, value })))
    }

    pub fn lu(a: &Csc) -> Result<Self> {
        Self::lu_as_planned(a, &LuPlan::default())
    }

    /// The same with an order that serves several matrices.
    pub fn lu_as_planned(a: &Csc, plan: &LuPlan) -> Result<Self> {
        Ok(Factor::with(a.rows, Kind::Lu(Lu::new(a, &a.value, plan)?)))
    }

    pub fn solve(&self, rhs: MatMut<'_, f64>) {
        let need = match &self.kind {
            Kind::Llt { symbolic, .. } => symbolic.solve_in_place_scratch::<f64>(rhs.ncols(), Par::Seq),
            Kind::Lu(lu) => lu.symbolic.solve_in_place_scratch::<f64>(rhs.ncols(), Par::Seq),
        };
        let mut memory = self.memory.lock().unwrap_or_else(PoisonError::into_inner);
        if memory.len() < need.unaligned_bytes_required() {
            *memory = MemBuffer::new(need);
        }
        let stack = MemStack::new(&mut memory);
        match &self.kind {
            Kind::Llt { symbolic, value } => {
                LltRef::<'_, u32, f64>::new(symbolic, value).solve_in_place_with_conj(Conj::No, rhs, Par::Seq, stack)
            }
            Kind::Lu(lu) => lu.factors().solve_in_place_with_conj(Conj::No, rhs, Par::Seq, stack),
        }
    }

    pub fn n(&self) -> usize {
        self.n
    }
}

/// Diagonal of the factor in its own order.
fn pivots(symbolic: &SymbolicCholesky<u32>, value: &[f64]) -> Vec<f64> {
    match symbolic.raw() {
        SymbolicCholeskyRaw::Simplicial(s) => (0..s.ncols()).map(|j| value[s.col_ptr()[j] as usize]).collect(),
        SymbolicCholeskyRaw::Supernodal(s) => {
            let mut out = vec![0.0; s.nrows()];
            let llt = faer::sparse::linalg::cholesky::supernodal::SupernodalLltRef::<'_, u32, f64>::new(s, value);
            for k in 0..s.n_supernodes() {
                let node = llt.supernode(k);
                let width = node.val().ncols();
                for c in 0..width {
                    out[node.start() + c] = node.val()[(c, c)];
                }
            }
            out
        }
    }
}

/// Number of negative eigenvalues of a symmetric matrix by Sylvester's law of inertia, from L D L^T without pivoting. None where
/// that factorisation is not accurate: a solve with it leaves too large a residual.
pub fn negative_eigenvalues(a: &Csc) -> Option<usize> {
    let params = CholeskySymbolicParams {
        supernodal_flop_ratio_threshold: SupernodalThreshold::FORCE_SIMPLICIAL,
        ..Default::default()
    };
    let symbolic = factorize_symbolic_cholesky(a.as_faer().symbolic(), Side::Upper, Default::default(), params).ok()?;
    let mut value = vec![0.0; symbolic.len_val()];
    let mut memory =
        MemBuffer::try_new(symbolic.factorize_numeric_ldlt_scratch::<f64>(Par::Seq, Default::default())).ok()?;
    symbolic
        .factorize_numeric_ldlt(
            &mut value,
            a.as_faer(),
            Side::Upper,
            Default::default(),
            Par::Seq,
            MemStack::new(&mut memory),
            Default::default(),
        )
        .ok()?;
    let n = a.rows;
    let b = Mat::from_fn(n, 1, |i, _| ((i as f64) * 0.618_034 + 0.3).fract() - 0.5);
    let mut x = b.clone();
    let mut memory = MemBuffer::new(symbolic.solve_in_place_scratch::<f64>(1, Par::Seq));
    LdltRef::<'_, u32, f64>::new(&symbolic, &value).solve_in_place_with_conj(
        Conj::No,
        x.as_mut(),
        Par::Seq,
        MemStack::new(&mut memory),
    );
    let mut r = Mat::zeros(n, 1);
    a.multiply(x.as_ref(), r.as_mut(), false);
    let worst = (0..n).map(|i| (r[(i, 0)] - b[(i, 0)]).abs()).fold(0.0, f64::max);
    // inertia is right as long as the factors are those of a matrix close to a: ask for the residual of a stable solve
    let rows = row_sizes(a, x.as_ref());
    let scale = rows.iter().fold(0.0_f64, |s, v| s.max(*v)) + 0.5;
    if worst.is_nan() || worst > INERTIA_RESIDUAL * scale {
        return None;
    }
    let d = pivots(&symbolic, &value);
    Some(d.iter().filter(|p| **p < 0.0).count())
}

/// |A| |x|: what a residual is to be compared with.
fn row_sizes(a: &Csc, x: MatRef<'_, f64>) -> Vec<f64> {
    let mut out = vec![0.0; a.rows];
    for (i, j, v) in a.entries() {
        out[i] += (v * x[(j, 0)]).abs();
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tridiagonal(n: usize, diagonal: f64) -> Csc {
        let mut entries = Vec::new();
        for i in 0..n {
            entries.push((i, i, diagonal));
            if i > 0 {
                entries.push((i, i - 1, -1.0));
                entries.push((i - 1, i, -1.0));
            }
        }
        Csc::from_entries(n, n, entries)
    }

    #[test]
    fn factors_solve_and_inertia_counts() {
        let n = 50;
        let a = tridiagonal(n, 2.0);
        let b = Mat::from_fn(n, 2, |i, j| (i + j) as f64);
        let factors = [Factor::cholesky(&a, 1e-12).unwrap().unwrap(), Factor::lu(&a).unwrap()];
        for factor in factors {
            let mut x = b.clone();
            factor.solve(x.as_mut());
            let mut r = Mat::zeros(n, 2);
            a.multiply(x.as_ref(), r.as_mut(), false);
            assert!((&r - &b).norm_max() < 1e-10);
        }
        // eigenvalues 2 - 2 cos(j pi / (n + 1)); j = (n + 1) / 3 makes 1, where the matrix is singular and nothing can be counted
        let exact = |j: usize| 2.0 - 2.0 * (std::f64::consts::PI * j as f64 / (n + 1) as f64).cos();
        for shift in [0.05, 0.9, 1.1, 2.1, 3.9] {
            assert_eq!(
                negative_eigenvalues(&tridiagonal(n, 2.0 - shift)),
                Some((1..=n).filter(|j| exact(*j) < shift).count())
            );
        }
        assert_eq!(negative_eigenvalues(&tridiagonal(n, 2.0 - 1.0)), None);
        assert!(Factor::cholesky(&tridiagonal(n, 1.0), 1e-12).unwrap().is_none());
    }

    /// Pairs of rows with a small pivot each, whose eigenvalues are about 1 and -1: elimination without exchange loses the digits by which
    /// it is small.
    #[test]
    fn inertia_is_told_where_small_pivots_leave_eleven_digits() {
        let n = 20;
        let count = |pivot: f64| {
            let pair = |i: usize| {
                let d = pivot * (1.0 + 0.37 * i as f64);
                [(2 * i, 2 * i, d), (2 * i + 1, 2 * i, 1.0), (2 * i, 2 * i + 1, 1.0), (2 * i + 1, 2 * i + 1, d)]
            };
            negative_eigenvalues(&Csc::from_entries(2 * n, 2 * n, (0..n).flat_map(pair).collect()))
        };
        assert_eq!([1e-5, 1e-7].map(count), [Some(n), None]);
    }
}
