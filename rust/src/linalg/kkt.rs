//! Saddle systems: the one place where matrices with constraint rows are factorised and solved.
//!
//! ```text
//! [A  L] [x]   [f]        A (n, n), L (n, m), R (m, n); L = R^T where nothing else is said
//! [R  0] [y] = [g]        of the m rows those act that carry their rank; y of the others is zero
//! ```
//! Rows and columns are scaled by the diagonal of A, so that units do not choose pivots. Solutions are refined until their residual
//! is rounding; the zero block stays exactly zero in it, which makes up for the pivots. Where the rows that act depend on each
//! other to rounding (at a singular pose) the answer is that of least norm, if there is one.
use std::cell::RefCell;
use std::sync::{Arc, OnceLock};

use faer::linalg::solvers::PartialPivLu;
use faer::prelude::*;
use nalgebra::{DMatrix, DVector, Dyn, RawStorage};

use crate::error::{Error, Result};
use crate::linalg::matrix::Matrix;
use crate::linalg::rows::{Level, RowBlocks};
use crate::linalg::small_lu::SmallLu;
use crate::linalg::sparse::{Csc, Factor as SparseFactor};
use crate::linalg::symmetric::{Ldl, Pattern};

const REFINEMENTS: usize = 8;
/// Up to this size plain loops are faster than a library. Only speed depends on it.
const SMALL: usize = 24;

/// The ordering of a pattern, kept from one factorisation to the next as long as the same rows act.
pub type Ordering = RefCell<Option<(Vec<usize>, Arc<Pattern>)>>;

type List = Vec<(u32, u32, f64)>;
type Columns<S> = nalgebra::Matrix<f64, Dyn, Dyn, S>;

/// The scaled matrix.
enum Scaled {
    Dense(DMatrix<f64>),
    List(List),
}

enum Factor {
    Small(SmallLu),
    Large(PartialPivLu<f64>),
    /// dense and singular to rounding: its pseudo-inverse
    Singular(DMatrix<f64>),
    /// of a quasi-definite neighbour; LU where refinement by it stalls
    Symmetric(Box<Ldl>, Box<OnceLock<SparseFactor>>),
    Sparse(Box<SparseFactor>, Box<OnceLock<SparseFactor>>),
}

pub struct Kkt {
    n: usize,
    rows: usize,
    kept: Vec<usize>,
    /// scales of the columns of A, then of the rows that act
    scale: Vec<f64>,
    matrix: Scaled,
    factor: Factor,
}

impl Kkt {
    /// [A R^T; R 0] with the rows that carry all blocks. `ordering`: A is symmetric positive definite and keeps its places.
    pub fn new(a: &Matrix, rows: &Matrix, blocks: &RowBlocks, ordering: Option<&Ordering>) -> Result<Self> {
        let kept = blocks.select(rows, Level::All);
        Self::with_rows(a, rows, kept, ordering)
    }

    /// The same with given rows.
    pub fn with_rows(a: &Matrix, rows: &Matrix, kept: Vec<usize>, ordering: Option<&Ordering>) -> Result<Self> {
        let n = a.shape().0;
        let column: Vec<f64> = a.diagonal().iter().map(|d| unit(*d)).collect();
        let place = places(&kept, rows.shape().0);
        let mut squares = vec![0.0; kept.len()];
        rows.each(|i, j, v| {
            if let Some(k) = place[i] {
                squares[k] += (v * column[j]).powi(2);
            }
        });
        let scale: Vec<f64> = column.into_iter().chain(squares.iter().map(|s| unit(*s))).collect();
        let mut list: List = Vec::new();
        a.each(|i, j, v| list.push((i as u32, j as u32, v * scale[i] * scale[j])));
        rows.each(|i, j, v| {
            if let Some(k) = place[i] {
                let v = v * scale[n + k] * scale[j];
                list.push(((n + k) as u32, j as u32, v));
                list.push((j as u32, (n + k) as u32, v));
            }
        });
        if list.iter().any(|e| !e.2.is_finite()) {
            return Err(Error::singular("the equations of motion contain numbers that are not finite"));
        }
        if !a.is_sparse() {
            let mut matrix = DMatrix::zeros(scale.len(), scale.len());
            list.iter().for_each(|(i, j, v)| matrix[(*i as usize, *j as usize)] += v);
            return Self::dense(n, rows.shape().0, kept, scale, matrix);
        }
        let factor = match ordering {
            Some(ordering) => Factor::Symmetric(Box::new(quasi_definite(&list, n, &kept, ordering)?), Box::default()),
            None => Factor::Sparse(Box::new(lu(&list, scale.len(), false)?), Box::default()),
        };
        Ok(Kkt { n, rows: rows.shape().0, kept, scale, matrix: Scaled::List(list), factor })
    }

    /// [A L; R 0] with columns of its own, dense.
    pub fn with_columns(a: &DMatrix<f64>, left: &DMatrix<f64>, right: &DMatrix<f64>, kept: Vec<usize>) -> Result<Self> {
        let n = a.nrows();
        let column: Vec<f64> = (0..n).map(|i| unit(a[(i, i)])).collect();
        let size = |k: usize| (0..n).map(|j| (right[(kept[k], j)] * column[j]).powi(2)).sum::<f64>();
        let rows: Vec<f64> = (0..kept.len()).map(|k| unit(size(k))).collect();
        let scale: Vec<f64> = column.into_iter().chain(rows).collect();
        let entry = |i: usize, j: usize| match (i < n, j < n) {
            (true, true) => a[(i, j)],
            (true, false) => left[(i, kept[j - n])],
            (false, true) => right[(kept[i - n], j)],
            (false, false) => 0.0,
        };
        let matrix = DMatrix::from_fn(scale.len(), scale.len(), |i, j| entry(i, j) * scale[i] * scale[j]);
        Self::dense(n, right.nrows(), kept, scale, matrix)
    }

    fn dense(n: usize, rows: usize, kept: Vec<usize>, scale: Vec<f64>, matrix: DMatrix<f64>) -> Result<Self> {
        if matrix.iter().any(|v| !v.is_finite()) {
            return Err(Error::singular("the equations of a step contain numbers that are not finite"));
        }
        let size = matrix.nrows();
        let (factor, least) = if size <= SMALL {
            let lu = SmallLu::new(matrix.clone());
            let least = lu.smallest_pivot();
            (Factor::Small(lu), least)
        } else {
            let lu = MatRef::from_column_major_slice(matrix.as_slice(), size, size).partial_piv_lu();
            let u = lu.U();
            let least = (0..size).map(|i| u[(i, i)].abs()).fold(f64::INFINITY, f64::min);
            (Factor::Large(lu), least)
        };
        let rounding = size as f64 * f64::EPSILON * matrix.amax();
        let factor = if least > rounding { factor } else { Factor::Singular(pseudo_inverse(&matrix)?) };
        Ok(Kkt { n, rows, kept, scale, matrix: Scaled::Dense(matrix), factor })
    }

    /// The rows that act.
    pub fn kept(&self) -> &[usize] {
        &self.kept
    }

    /// A, without its scales; dense systems alone keep it so.
    pub fn matrix(&self) -> DMatrix<f64> {
        let mut a = DMatrix::zeros(self.n, self.n);
        let mut put = |i: usize, j: usize, v: f64| {
            if i < self.n && j < self.n {
                a[(i, j)] += v / (self.scale[i] * self.scale[j]);
            }
        };
        match &self.matrix {
            Scaled::Dense(m) => (0..self.n).for_each(|j| (0..self.n).for_each(|i| put(i, j, m[(i, j)]))),
            Scaled::List(list) => list.iter().for_each(|(i, j, v)| put(*i as usize, *j as usize, *v)),
        }
        a
    }

    /// x (n, k) and y (m, k) with A x + L y = f, R x = g.
    pub fn solve(&self, f: &DMatrix<f64>, g: &DMatrix<f64>) -> Result<(DMatrix<f64>, DMatrix<f64>)> {
        self.refined(f, g, false)
    }

    /// x and y with A^T x + R^T y = f, L^T x = g.
    pub fn solve_transposed(&self, f: &DMatrix<f64>, g: &DMatrix<f64>) -> Result<(DMatrix<f64>, DMatrix<f64>)> {
        self.refined(f, g, true)
    }

    pub fn solve_one(&self, f: &DVector<f64>, g: &DVector<f64>) -> Result<(DVector<f64>, DVector<f64>)> {
        let as_matrix = |v: &DVector<f64>| DMatrix::from_column_slice(v.len(), 1, v.as_slice());
        let (x, y) = self.solve(&as_matrix(f), &as_matrix(g))?;
        Ok((x.column(0).into_owned(), y.column(0).into_owned()))
    }

    fn refined(&self, f: &DMatrix<f64>, g: &DMatrix<f64>, transposed: bool) -> Result<(DMatrix<f64>, DMatrix<f64>)> {
        let (n, size) = (self.n, self.scale.len());
        let entry = |i: usize, c: usize| if i < n { f[(i, c)] } else { g[(self.kept[i - n], c)] };
        let right = DMatrix::from_fn(size, f.ncols(), |i, c| entry(i, c) * self.scale[i]);
        let z = if size > 0 { self.solution(&right, transposed)? } else { right };
        let mut y = DMatrix::zeros(self.rows, f.ncols());
        for (k, row) in self.kept.iter().enumerate() {
            for c in 0..f.ncols() {
                y[(*row, c)] = z[(n + k, c)] * self.scale[n + k];
            }
        }
        Ok((DMatrix::from_fn(n, f.ncols(), |i, c| z[(i, c)] * self.scale[i]), y))
    }

    /// Solved once, then refined until the remainder is rounding; by LU where a quasi-definite neighbour does not serve.
    fn solution(&self, right: &DMatrix<f64>, transposed: bool) -> Result<DMatrix<f64>> {
        let size = self.scale.len();
        let mut z = self.once(right.clone(), transposed, false)?;
        let (mut left, mut stronger, mut passes) = (f64::INFINITY, false, 0);
        loop {
            let miss = right - self.times(&z, transposed);
            let part = self.remainder(&miss, right, &z);
            if part <= 4.0 * f64::EPSILON {
                break;
            }
            if part > 0.5 * left || passes == REFINEMENTS || part.is_nan() {
                // rounding of a product with many terms is reached
                if part <= size as f64 * f64::EPSILON {
                    break;
                }
                if stronger || !matches!(self.factor, Factor::Symmetric(..)) {
                    self.accept(relative(&miss, right, &z))?;
                    break;
                }
                stronger = true;
                (z, left, passes) = (self.once(right.clone(), transposed, true)?, f64::INFINITY, 0);
                continue;
            }
            (left, passes) = (part, passes + 1);
            z += self.once(miss, transposed, stronger)?;
        }
        if z.iter().all(|v| v.is_finite()) { Ok(z) } else { Err(singular()) }
    }

    /// The largest remainder of the equations and of the constraints, each beside its own terms: constraints know nothing of y, so
    /// the large multipliers of weak rows must not hide what x misses.
    fn remainder(&self, miss: &DMatrix<f64>, right: &DMatrix<f64>, z: &DMatrix<f64>) -> f64 {
        let (n, rows) = (self.n, self.kept.len());
        let constraints = relative(&miss.rows(n, rows), &right.rows(n, rows), &z.rows(0, n));
        worse(relative(miss, right, z), constraints)
    }

    /// A remainder that refinement does not take away: rounding of an ill-conditioned matrix, or no solution.
    fn accept(&self, part: f64) -> Result<()> {
        let bound = match self.factor {
            // what rounding makes of a right side that should agree
            Factor::Singular(_) => f64::EPSILON.sqrt(),
            _ => f64::EPSILON.powf(0.75),
        };
        if part <= bound { Ok(()) } else { Err(singular()) }
    }

    fn times(&self, z: &DMatrix<f64>, transposed: bool) -> DMatrix<f64> {
        match &self.matrix {
            Scaled::Dense(m) if transposed => m.tr_mul(z),
            Scaled::Dense(m) => m * z,
            Scaled::List(list) => {
                let mut out = DMatrix::zeros(z.nrows(), z.ncols());
                for c in 0..z.ncols() {
                    for (i, j, v) in list {
                        let (i, j) = if transposed { (j, i) } else { (i, j) };
                        out[(*i as usize, c)] += v * z[(*j as usize, c)];
                    }
                }
                out
            }
        }
    }

    fn once(&self, mut b: DMatrix<f64>, transposed: bool, stronger: bool) -> Result<DMatrix<f64>> {
        let (size, columns) = b.shape();
        match &self.factor {
            _ if size == 0 => {}
            Factor::Small(lu) if transposed => lu.solve_transposed(&mut b),
            Factor::Small(lu) => lu.solve(&mut b),
            Factor::Large(lu) => {
                let x = MatMut::from_column_major_slice_mut(b.as_mut_slice(), size, columns);
                if transposed {
                    lu.solve_transpose_in_place(x);
                } else {
                    lu.solve_in_place(x);
                }
            }
            Factor::Singular(inverse) => b = if transposed { inverse.tr_mul(&b) } else { inverse * b },
            Factor::Symmetric(ldl, _) if !stronger => {
                for mut column in b.column_iter_mut() {
                    let x = ldl.solve(column.as_slice());
                    column.copy_from_slice(&x);
                }
            }
            Factor::Symmetric(_, full) => self.by_lu(full, &mut b, false)?,
            Factor::Sparse(_, backwards) if transposed => self.by_lu(backwards, &mut b, true)?,
            Factor::Sparse(lu, _) => {
                lu.solve(MatMut::from_column_major_slice_mut(b.as_mut_slice(), size, columns));
            }
        }
        Ok(b)
    }

    /// Solve by sparse LU factors that are made when they are first asked for.
    fn by_lu(&self, kept: &OnceLock<SparseFactor>, b: &mut DMatrix<f64>, transposed: bool) -> Result<()> {
        if kept.get().is_none()
            && let Scaled::List(list) = &self.matrix
        {
            let made = lu(list, self.scale.len(), transposed)?;
            kept.get_or_init(|| made);
        }
        let (size, columns) = b.shape();
        if let Some(lu) = kept.get() {
            lu.solve(MatMut::from_column_major_slice_mut(b.as_mut_slice(), size, columns));
        }
        Ok(())
    }
}

fn singular() -> Error {
    Error::singular(
        "the equations of motion are singular here: a motion without inertia, or constraints that lose rank in this pose",
    )
}

/// The factor that makes a number one; zero stays.
fn unit(square: f64) -> f64 {
    if square == 0.0 || !square.is_finite() { 1.0 } else { 1.0 / square.abs().sqrt() }
}

fn places(kept: &[usize], rows: usize) -> Vec<Option<usize>> {
    let mut place = vec![None; rows];
    kept.iter().enumerate().for_each(|(k, i)| place[*i] = Some(k));
    place
}

/// The largest entry of a remainder over the sizes of right side and solution, column by column.
fn relative<A, B, C>(miss: &Columns<A>, right: &Columns<B>, z: &Columns<C>) -> f64
where
    A: RawStorage<f64, Dyn, Dyn>,
    B: RawStorage<f64, Dyn, Dyn>,
    C: RawStorage<f64, Dyn, Dyn>,
{
    let part = |c: usize| {
        let size = right.column(c).amax() + z.column(c).amax();
        let miss = miss.column(c).amax();
        if miss == 0.0 { 0.0 } else { miss / size }
    };
    (0..miss.ncols()).map(part).fold(0.0, worse)
}

/// The larger of two; nan is the largest.
fn worse(a: f64, b: f64) -> f64 {
    if a > b || a.is_nan() { a } else { b }
}

fn quasi_definite(list: &List, n: usize, rows: &[usize], ordering: &Ordering) -> Result<Ldl> {
    let size = n + rows.len();
    // without pivots the rows need a negative diagonal; refinement takes it out again
    let regular = (n..size).map(|i| (i as u32, i as u32, -f64::EPSILON.sqrt()));
    let all = || list.iter().copied().chain(regular.clone());
    let mut kept = ordering.borrow_mut();
    let fits = |k: &&(Vec<usize>, Arc<Pattern>)| k.0 == rows && k.1.fits(size, list.len() + rows.len());
    let pattern = match kept.as_ref().filter(fits) {
        Some((_, p)) => p.clone(),
        None => {
            let places: Vec<(u32, u32)> = all().map(|(i, j, _)| (i, j)).collect();
            let made = Arc::new(Pattern::new(size, &places)?);
            *kept = Some((rows.to_vec(), made.clone()));
            made
        }
    };
    pattern.factor(all().map(|(_, _, v)| v))
}

fn lu(list: &List, size: usize, transposed: bool) -> Result<SparseFactor> {
    let place = |(i, j, v): &(u32, u32, f64)| match transposed {
        true => (*j as usize, *i as usize, *v),
        false => (*i as usize, *j as usize, *v),
    };
    SparseFactor::lu(&Csc::from_entries(size, size, list.iter().map(place).collect()))
}

/// By singular values; those of rounding are zero.
fn pseudo_inverse(m: &DMatrix<f64>) -> Result<DMatrix<f64>> {
    let size = m.nrows();
    let svd = MatRef::from_column_major_slice(m.as_slice(), size, size).svd().map_err(|_| singular())?;
    let (u, s, v) = (svd.U(), svd.S().column_vector(), svd.V());
    let kept: Vec<usize> = (0..size).filter(|k| s[*k] > 4.0 * size as f64 * f64::EPSILON * s[0]).collect();
    Ok(DMatrix::from_fn(size, size, |i, j| kept.iter().map(|k| v[(i, *k)] / s[*k] * u[(j, *k)]).sum()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::linalg::entries::Entries;
    use crate::linalg::rows::Block;

    fn listed(m: &DMatrix<f64>) -> Matrix {
        let mut t = Matrix::zeros(m.nrows(), m.ncols(), true);
        for i in 0..m.nrows() {
            for j in 0..m.ncols() {
                t.add(i, j, m[(i, j)]);
            }
        }
        t
    }

    fn ranked(rows: usize, columns: usize, rank: usize) -> RowBlocks {
        let mut blocks = RowBlocks::independent(rows, columns);
        blocks.blocks[0] = Block { rank, position_rank: rank, ..blocks.blocks[0].clone() };
        blocks
    }

    fn column(v: &[f64]) -> DVector<f64> {
        DVector::from_row_slice(v)
    }

    #[test]
    fn redundant_rows_change_nothing_by_any_route_and_transposed() -> Result<()> {
        let a = DMatrix::from_fn(4, 4, |i, j| if i == j { 3.0 + i as f64 } else { 0.2 });
        let r = DMatrix::from_row_slice(3, 4, &[1.0, -1.0, 0.5, 0.0, 2.0, -2.0, 1.0, 0.0, 0.0, 1.0, 1.0, 2.0]);
        let (f, g) = (column(&[1.0, 0.2, -0.4, 0.7]), column(&[0.3, 0.6, -0.2]));
        let blocks = ranked(3, 4, 2);
        let dense = Matrix::Dense(a.clone());
        let systems = [
            Kkt::new(&dense, &Matrix::Dense(r.clone()), &blocks, None)?,
            Kkt::new(&listed(&a), &listed(&r), &blocks, Some(&Ordering::default()))?,
            Kkt::new(&listed(&a), &listed(&r), &blocks, None)?,
            Kkt::with_columns(&a, &r.transpose(), &r, vec![1, 2])?,
        ];
        for system in systems {
            assert_eq!(system.kept(), [1, 2]);
            let (x, y) = system.solve_one(&f, &g)?;
            assert!((&a * &x + r.transpose() * &y - &f).amax() < 1e-14);
            assert!((&r * &x - &g).amax() < 1e-14);
            let (x, y) = system.solve_transposed(
                &DMatrix::from_column_slice(4, 1, f.as_slice()),
                &DMatrix::from_column_slice(3, 1, g.as_slice()),
            )?;
            assert!((a.transpose() * &x + r.transpose() * &y - &f).amax() < 1e-14);
        }
        Ok(())
    }

    #[test]
    fn a_row_that_is_independent_only_just_is_enforced() -> Result<()> {
        let a = DMatrix::from_fn(3, 3, |i, j| if i == j { 2.0 + i as f64 } else { 0.3 });
        // without pivots weak rows of large systems are enforced to their remainder only
        for (s, sparse) in [(1e-2, Some(1e-8)), (1e-4, Some(1e-6)), (1e-6, None), (2e-7, None)] {
            let r = DMatrix::from_row_slice(2, 3, &[1.0, -1.0, 0.5, 2.0, -2.0, 1.0 + s]);
            let g = column(&[0.3, 0.6 + 0.1 * s]);
            let blocks = RowBlocks::independent(2, 3);
            let ordering = Ordering::default();
            let dense = Kkt::new(&Matrix::Dense(a.clone()), &Matrix::Dense(r.clone()), &blocks, None)?;
            let mut systems = vec![(dense, 1e-13 / s)];
            if let Some(allowed) = sparse {
                systems.push((Kkt::new(&listed(&a), &listed(&r), &blocks, Some(&ordering))?, allowed));
            }
            for (system, allowed) in systems {
                // x3 = 0.1 follows from both rows whatever s
                let (x, _) = system.solve_one(&column(&[1.0, 0.2, -0.4]), &g)?;
                assert!((x[2] - 0.1).abs() < allowed, "s = {s:e}: {:e}", x[2] - 0.1);
            }
        }
        Ok(())
    }

    #[test]
    fn rows_that_depend_on_each_other_give_the_least_answer_or_none() -> Result<()> {
        let a = DMatrix::identity(3, 3);
        let r = DMatrix::from_row_slice(2, 3, &[1.0, -1.0, 0.5, 2.0, -2.0, 1.0]);
        let system = Kkt::new(&Matrix::Dense(a), &Matrix::Dense(r.clone()), &RowBlocks::independent(2, 3), None)?;
        let (x, _) = system.solve_one(&column(&[1.0, 0.2, -0.4]), &column(&[0.3, 0.6]))?;
        assert!((&r * x - column(&[0.3, 0.6])).amax() < 1e-13);
        assert!(system.solve_one(&column(&[1.0, 0.2, -0.4]), &column(&[0.3, 0.7])).is_err());
        Ok(())
    }
}
