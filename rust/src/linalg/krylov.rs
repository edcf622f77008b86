//! Block Krylov spaces with full orthogonalisation and thick restart, for the largest eigenvalues of an operator.
//!
//! Symmetric operators: thick-restart Lanczos (Wu and Simon, SIAM J. Matrix Anal. Appl. 22(2), 2000); others: the Krylov-Schur
//! idea (Stewart, SIAM J. Matrix Anal. Appl. 23(3), 2002) with an orthonormal basis of the wanted Ritz vectors in the place of a
//! reordered Schur form. Blocks see repeated eigenvalues that one vector would miss. Real operators keep a real basis.
use faer::linalg::matmul::{matmul, matmul_with_conj};
use faer::prelude::*;
use faer::{Accum, Conj, Mat, MatMut, MatRef, Par, Side, c64};

use crate::error::{Error, Result};
use crate::linalg::field::Field;
use crate::run::{Cancel, Counts};
use crate::tolerances::sparse_modes::{CONVERGED, VANISHED};

const PROBE_BLOCKS: usize = 6;

/// x -> Op x, in an inner product <x, y> = x^H W y with a real W. Where W is only semidefinite, Op must ignore its null space.
pub trait Operator<T = f64> {
    fn dim(&self) -> usize;
    fn apply(&self, x: MatRef<'_, T>, out: MatMut<'_, T>) -> Result<()>;
    fn weigh(&self, x: MatRef<'_, T>, out: MatMut<'_, T>);
}

#[derive(Debug, Clone, Copy)]
pub struct Options {
    pub wanted: usize,
    pub block: usize,
    /// columns of the basis before a restart
    pub dim: usize,
    pub tol: f64,
    pub max_cycles: usize,
    pub symmetric: bool,
}

impl Options {
    pub fn new(wanted: usize, symmetric: bool) -> Self {
        let block = 3;
        let dim = (2 * wanted + 4 * block).max(wanted + 30);
        Options { wanted, block, dim: dim.div_ceil(block) * block, tol: CONVERGED, max_cycles: 200, symmetric }
    }
}

/// Op V = V T + Q B with orthonormal [V, Q]; Q is the last block, B sits below T.
///
/// The operator is called through its table, so that all of one number type share one text.
pub struct Space<'a, T: Field = f64> {
    op: &'a dyn Operator<T>,
    options: Options,
    v: Mat<T>,
    t: Mat<T>,
    /// W times a block, room for one
    weighed: Mat<T>,
    /// columns of V
    size: usize,
    random: Random,
    pub counts: Counts,
}

pub struct Ritz {
    /// largest modulus first; conjugate pairs together
    pub value: Vec<c64>,
    /// coefficients over V, columns of unit length
    pub vector: Mat<c64>,
    pub residual: Vec<f64>,
}

/// Deterministic, uniform in (-1/2, 1/2).
struct Random(u64);

impl Random {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        ((self.0 >> 11) as f64) / (1u64 << 53) as f64 - 0.5
    }

    fn scalar<T: Field>(&mut self) -> T {
        T::random(|| self.next())
    }
}

impl<'a, T: Field> Space<'a, T> {
    pub fn new(op: &'a dyn Operator<T>, options: Options) -> Result<Self> {
        let mut space = Self::empty(op, options);
        space.inject(0)?;
        Ok(space)
    }

    /// The space that begins with random combinations of vectors, such as those of a space of a neighbouring operator.
    pub fn from_vectors(op: &'a dyn Operator<T>, options: Options, vectors: MatRef<'_, T>) -> Result<Self> {
        let mut space = Self::empty(op, options);
        let mix: Mat<T> = Mat::from_fn(vectors.ncols(), options.block, |_, _| space.random.scalar());
        space.begin(0, vectors * mix)?;
        Ok(space)
    }

    fn empty(op: &'a dyn Operator<T>, options: Options) -> Self {
        let n = op.dim();
        let columns = options.dim + options.block;
        Space {
            op,
            options,
            v: Mat::zeros(n, columns),
            t: Mat::zeros(columns, columns),
            weighed: Mat::zeros(n, options.block),
            size: 0,
            random: Random(0x9e37_79b9_7f4a_7c15),
            counts: Counts::default(),
        }
    }

    /// Fill the block after the first `at` columns with random vectors, purified by one application of the operator.
    fn inject(&mut self, at: usize) -> Result<()> {
        let (n, b) = (self.op.dim(), self.options.block);
        let x = Mat::from_fn(n, b, |_, _| self.random.scalar());
        self.begin(at, x)
    }

    /// A new block after the first `at` columns, from one application of the operator.
    fn begin(&mut self, at: usize, x: Mat<T>) -> Result<()> {
        self.apply(x.as_ref(), at)?;
        let before = self.block_norms(at)?;
        let mut ignored = Mat::zeros(at, self.options.block);
        self.orthogonalise(at, &mut ignored);
        self.orthonormalise_block(at, &before)?;
        Ok(())
    }

    /// v[:, at..at+b] = Op x.
    fn apply(&mut self, x: MatRef<'_, T>, at: usize) -> Result<()> {
        self.counts.add("operator applications", x.ncols() as u64);
        let out = self.v.as_mut().subcols_mut(at, x.ncols());
        self.op.apply(x, out)
    }

    /// Extend to the full dimension and return the Ritz pairs.
    pub fn cycle(&mut self, cancel: &Cancel) -> Result<Ritz> {
        self.extend(self.options.dim, cancel)
    }

    /// A few blocks only: enough for a Ritz value to appear where one had been overlooked.
    pub fn probe(&mut self, cancel: &Cancel) -> Result<Ritz> {
        let dim = self.size + PROBE_BLOCKS * self.options.block;
        self.extend(dim.min(self.options.dim), cancel)
    }

    fn extend(&mut self, dim: usize, cancel: &Cancel) -> Result<Ritz> {
        let b = self.options.block;
        while self.size + b <= dim {
            cancel.check()?;
            let at = self.size;
            let newest = self.v.subcols(at, b).to_owned();
            self.apply(newest.as_ref(), at + b)?;
            let before = self.block_norms(at + b)?;
            let mut h = Mat::zeros(at + b, b);
            self.orthogonalise(at + b, &mut h);
            self.t.as_mut().submatrix_mut(0, at, at + b, b).copy_from(&h);
            let r = self.orthonormalise_block(at + b, &before)?;
            self.t.as_mut().submatrix_mut(at + b, at, b, b).copy_from(&r);
            self.size = at + b;
        }
        self.counts.add("Krylov cycles", 1);
        self.ritz()
    }

    /// Twice classical Gram-Schmidt of the block at `at` against all columns before it; adds the coefficients to `h`.
    fn orthogonalise(&mut self, at: usize, h: &mut Mat<T>) {
        if at == 0 {
            return;
        }
        let b = self.options.block;
        for _ in 0..2 {
            self.op.weigh(self.v.subcols(at, b), self.weighed.as_mut());
            let (basis, block) = self.v.as_mut().split_at_col_mut(at);
            let basis = basis.rb();
            let coefficients = tall_product(basis, self.weighed.as_ref());
            matmul(block.subcols_mut(0, b), Accum::Add, basis, coefficients.as_ref(), T::real(-1.0), Par::Seq);
            *h += coefficients;
        }
    }

    /// W-orthonormal columns of the block at `at`; returns the upper triangular R. A direction that has vanished, compared with
    /// `before`, is replaced by a random one with a zero row in R; where the space is exhausted, by zero.
    fn orthonormalise_block(&mut self, at: usize, before: &[f64]) -> Result<Mat<T>> {
        let b = self.options.block;
        let mut r = Mat::zeros(b, b);
        for c in 0..b {
            let column = at + c;
            let inside = self.project_out(column, at)?;
            for l in 0..c {
                r[(l, c)] = inside[(l, 0)];
            }
            let norm = self.norm(column)?;
            if norm > VANISHED * before[c] {
                r[(c, c)] = T::real(norm);
                self.divide(column, norm);
            } else {
                self.replace(column)?;
            }
        }
        Ok(r)
    }

    /// A new direction at `column`, orthogonal to all before it; zero where there is none left.
    fn replace(&mut self, column: usize) -> Result<()> {
        let x = Mat::from_fn(self.op.dim(), 1, |_, _| self.random.scalar());
        self.apply(x.as_ref(), column)?;
        let before = self.norm(column)?;
        self.project_out(column, 0)?;
        let norm = self.norm(column)?;
        if norm > VANISHED * before {
            self.divide(column, norm);
        } else {
            self.v.as_mut().col_mut(column).fill(T::real(0.0));
        }
        Ok(())
    }

    /// Twice Gram-Schmidt of one column against those from `start` on; returns the coefficients.
    fn project_out(&mut self, column: usize, start: usize) -> Result<Mat<T>> {
        let mut sum = Mat::zeros(column - start, 1);
        if column == start {
            return Ok(sum);
        }
        for _ in 0..2 {
            let mut weighed = self.weighed.as_mut().subcols_mut(0, 1);
            self.op.weigh(self.v.subcols(column, 1), weighed.rb_mut());
            let (basis, rest) = self.v.as_mut().split_at_col_mut(column);
            let basis = basis.rb().subcols(start, column - start);
            let coefficients = tall_product(basis, weighed.rb());
            matmul(rest.subcols_mut(0, 1), Accum::Add, basis, coefficients.as_ref(), T::real(-1.0), Par::Seq);
            sum += coefficients;
        }
        Ok(sum)
    }

    fn divide(&mut self, column: usize, norm: f64) {
        let mut x = self.v.as_mut().col_mut(column);
        for i in 0..x.nrows() {
            x[i] = x[i] / norm;
        }
    }

    fn block_norms(&mut self, at: usize) -> Result<Vec<f64>> {
        (0..self.options.block).map(|c| self.norm(at + c)).collect()
    }

    /// W-norm of a column.
    fn norm(&mut self, column: usize) -> Result<f64> {
        let x = self.v.subcols(column, 1);
        let mut weighed = self.weighed.as_mut().subcols_mut(0, 1);
        self.op.weigh(x, weighed.rb_mut());
        let sum: f64 = (0..self.op.dim()).map(|i| (x[(i, 0)].conjugate() * weighed[(i, 0)]).wide().re).sum();
        if sum.is_finite() {
            return Ok(sum.max(0.0).sqrt());
        }
        Err(Error::singular("the shifted matrix is singular: its solutions are infinite or NaN"))
    }

    fn ritz(&self) -> Result<Ritz> {
        let (p, b) = (self.size, self.options.block);
        let t = self.t.submatrix(0, 0, p, p);
        let below = self.t.submatrix(p, 0, b, p);
        let failed = || Error::Convergence {
            message: "the projected eigenproblem did not converge".into(),
            best: Vec::new(),
            residual: f64::NAN,
        };
        let (value, vector) = if self.options.symmetric {
            let symmetric = Mat::from_fn(p, p, |i, j| (t[(i, j)] + t[(j, i)].conjugate()) / 2.0);
            let eigen = symmetric.self_adjoint_eigen(Side::Lower).map_err(|_| failed())?;
            let value: Vec<c64> = (0..p).map(|k| eigen.S()[k].wide()).collect();
            let u = eigen.U();
            (value, Mat::from_fn(p, p, |i, j| u[(i, j)].wide()))
        } else {
            let eigen = t.eigen().map_err(|_| failed())?;
            let u = eigen.U();
            let norms: Vec<f64> = (0..p).map(|j| u.col(j).norm_l2()).collect();
            let value = (0..p).map(|k| eigen.S()[k]).collect();
            (value, Mat::from_fn(p, p, |i, j| u[(i, j)] / norms[j]))
        };
        let mut order: Vec<usize> = (0..p).collect();
        // of a pair, whose moduli are equal to the last bit, the one in the upper half plane first
        order.sort_by(|a, b| {
            let (x, y) = (value[*a], value[*b]);
            y.norm().total_cmp(&x.norm()).then(x.re.total_cmp(&y.re)).then(y.im.total_cmp(&x.im))
        });
        let residual = |k: usize| {
            let mut sum = 0.0;
            for i in 0..b {
                let row: c64 = (0..p).map(|j| vector[(j, k)] * below[(i, j)].wide()).sum();
                sum += row.norm_sqr();
            }
            sum.sqrt()
        };
        Ok(Ritz {
            residual: order.iter().map(|k| residual(*k)).collect(),
            value: order.iter().map(|k| value[*k]).collect(),
            vector: Mat::from_fn(p, p, |i, j| vector[(i, order[j])]),
        })
    }

    /// Shrink the space to the first `keep` Ritz vectors (one more where a conjugate pair would be cut).
    pub fn restart(&mut self, ritz: &Ritz, keep: usize) {
        let (p, b) = (self.size, self.options.block);
        let q = basis::<T>(ritz, keep);
        let k = q.ncols();
        let t = q.adjoint() * self.t.submatrix(0, 0, p, p) * &q;
        let below = self.t.submatrix(p, 0, b, p) * &q;
        compress(self.v.as_mut(), q.as_ref(), p, b);
        self.t.fill(T::real(0.0));
        self.t.as_mut().submatrix_mut(0, 0, k, k).copy_from(&t);
        self.t.as_mut().submatrix_mut(k, 0, b, k).copy_from(&below);
        self.size = k;
    }

    /// As `restart`, but going on with new random vectors: what the old ones could not see comes to light. Of those to keep only what has
    /// converged stays, since what the operator makes of the others leads out of the space.
    pub fn restart_afresh(&mut self, ritz: &Ritz, keep: usize) -> Result<()> {
        self.restart(ritz, keep.min(self.converged(ritz)));
        let k = self.size;
        self.t.as_mut().submatrix_mut(k, 0, self.options.block, k).fill(T::real(0.0));
        self.counts.add("random restarts", 1);
        self.inject(k)
    }

    /// Cycles until the wanted pairs have converged.
    pub fn converge(&mut self, cancel: &Cancel) -> Result<Ritz> {
        let ritz = self.best(cancel)?;
        let n = self.converged(&ritz);
        if n >= self.options.wanted {
            return Ok(ritz);
        }
        Err(Error::Convergence {
            message: format!(
                "only {n} of {} modes converged in {} restarts",
                self.options.wanted, self.options.max_cycles
            ),
            best: ritz.value.iter().take(n).map(|v| v.re).collect(),
            residual: ritz.residual.first().copied().unwrap_or(f64::NAN),
        })
    }

    /// Cycles until the wanted pairs have converged, or to the last cycle.
    pub fn best(&mut self, cancel: &Cancel) -> Result<Ritz> {
        let mut ritz = self.cycle(cancel)?;
        for _ in 0..self.options.max_cycles {
            if self.converged(&ritz) >= self.options.wanted {
                break;
            }
            let wanted = self.options.wanted;
            let spare = self.size.saturating_sub(wanted + 2 * self.options.block);
            let keep = (wanted + spare / 2).min(self.size - self.options.block - 1);
            self.restart(&ritz, keep);
            ritz = self.cycle(cancel)?;
        }
        Ok(ritz)
    }

    /// Leading pairs with small residuals.
    pub fn converged(&self, ritz: &Ritz) -> usize {
        let good = |k: &usize| ritz.residual[*k] <= self.options.tol * ritz.value[*k].norm();
        (0..ritz.value.len()).take_while(good).count()
    }

    /// Ritz vectors in the full space.
    pub fn vectors(&self, ritz: &Ritz, count: usize) -> Mat<c64> {
        T::combined(self.v.subcols(0, self.size), ritz.vector.subcols(0, count))
    }
}

impl Space<'_> {
    pub fn real_vectors(&self, ritz: &Ritz, count: usize) -> Mat<f64> {
        let u = Mat::from_fn(self.size, count, |i, j| ritz.vector[(i, j)].re);
        self.v.subcols(0, self.size) * u
    }
}

/// basis^H x in slices of rows that stay in cache.
fn tall_product<T: Field>(basis: MatRef<'_, T>, x: MatRef<'_, T>) -> Mat<T> {
    const SLICE: usize = 512;
    let mut out = Mat::zeros(basis.ncols(), x.ncols());
    let mut row = 0;
    while row < basis.nrows() {
        let len = SLICE.min(basis.nrows() - row);
        matmul_with_conj(
            out.as_mut(),
            Accum::Add,
            basis.subrows(row, len).transpose(),
            Conj::Yes,
            x.subrows(row, len),
            Conj::No,
            T::real(1.0),
            Par::Seq,
        );
        row += len;
    }
    out
}

/// V[:, ..k] = V[:, ..p] Q and the block that follows moves up behind it, slice by slice in place.
fn compress<T: Field>(mut v: MatMut<'_, T>, q: MatRef<'_, T>, p: usize, b: usize) {
    const SLICE: usize = 512;
    let (n, k) = (v.nrows(), q.ncols());
    let mut row = 0;
    while row < n {
        let len = SLICE.min(n - row);
        let mut slice = v.rb_mut().subrows_mut(row, len);
        let rotated = slice.rb().subcols(0, p) * q;
        let block = slice.rb().subcols(p, b).to_owned();
        slice.rb_mut().subcols_mut(0, k).copy_from(&rotated);
        slice.rb_mut().subcols_mut(k, b).copy_from(&block);
        row += len;
    }
}

/// Orthonormal columns that span the leading Ritz vectors; real ones span with each its conjugate.
fn basis<T: Field>(ritz: &Ritz, keep: usize) -> Mat<T> {
    let p = ritz.vector.nrows();
    let mut columns: Vec<Vec<T>> = Vec::new();
    let mut k = 0;
    while k < p && columns.len() < keep {
        let vector: Vec<c64> = (0..p).map(|i| ritz.vector[(i, k)]).collect();
        let paired = T::IS_REAL && ritz.value[k].im != 0.0;
        columns.extend(T::columns(&vector, paired));
        // its conjugate spans the same plane
        k += if paired { 2 } else { 1 };
    }
    let a = Mat::from_fn(p, columns.len(), |i, j| columns[j][i]);
    if columns.is_empty() {
        return a;
    }
    a.qr().compute_thin_Q()
}
