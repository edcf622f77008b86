//! Matrices of the equations of motion: dense while they are small, lists of entries when they are large.
use nalgebra::{DMatrix, DVector};

use crate::linalg::entries::{Entries, Triplets};

#[derive(Debug, Clone)]
pub enum Matrix {
    Dense(DMatrix<f64>),
    Sparse(Triplets),
}

/// Columns first..first + 3 times a 3 x 3 matrix, for all such triples.
pub fn turn_columns(m: &mut DMatrix<f64>, triples: &[(usize, [[f64; 3]; 3])]) {
    for (first, map) in triples {
        for r in 0..m.nrows() {
            let old = [m[(r, *first)], m[(r, first + 1)], m[(r, first + 2)]];
            for k in 0..3 {
                m[(r, first + k)] = (0..3).map(|l| old[l] * map[l][k]).sum();
            }
        }
    }
}

impl Entries<f64> for Matrix {
    fn add(&mut self, i: usize, j: usize, v: f64) {
        match self {
            Matrix::Dense(m) => m[(i, j)] += v,
            Matrix::Sparse(t) => t.add(i, j, v),
        }
    }
}

impl Matrix {
    pub fn zeros(rows: usize, cols: usize, sparse: bool) -> Self {
        if sparse { Matrix::Sparse(Triplets::new(rows, cols)) } else { Matrix::Dense(DMatrix::zeros(rows, cols)) }
    }

    pub fn shape(&self) -> (usize, usize) {
        match self {
            Matrix::Dense(m) => m.shape(),
            Matrix::Sparse(t) => (t.rows, t.cols),
        }
    }

    pub fn is_sparse(&self) -> bool {
        matches!(self, Matrix::Sparse(_))
    }

    pub fn times(&self, x: &[f64]) -> DVector<f64> {
        let mut out = DVector::zeros(self.shape().0);
        self.each(|i, j, v| out[i] += v * x[j]);
        out
    }

    /// Visit all entries; those of the same place add up.
    pub fn each(&self, mut visit: impl FnMut(usize, usize, f64)) {
        match self {
            Matrix::Dense(m) => {
                for j in 0..m.ncols() {
                    for i in 0..m.nrows() {
                        visit(i, j, m[(i, j)]);
                    }
                }
            }
            Matrix::Sparse(t) => {
                for (i, j, v) in &t.list {
                    visit(*i as usize, *j as usize, *v);
                }
            }
        }
    }

    /// Rows and columns times factors.
    pub fn scaled(&self, row: impl Fn(usize) -> f64, column: impl Fn(usize) -> f64) -> Matrix {
        let mut out = self.clone();
        match &mut out {
            Matrix::Dense(m) => {
                for (j, mut c) in m.column_iter_mut().enumerate() {
                    for (i, v) in c.iter_mut().enumerate() {
                        *v *= row(i) * column(j);
                    }
                }
            }
            Matrix::Sparse(t) => {
                for (i, j, v) in &mut t.list {
                    *v *= row(*i as usize) * column(*j as usize);
                }
            }
        }
        out
    }

    pub fn diagonal(&self) -> Vec<f64> {
        let mut out = vec![0.0; self.shape().0];
        match self {
            Matrix::Dense(m) => (0..out.len()).for_each(|i| out[i] = m[(i, i)]),
            Matrix::Sparse(_) => self.each(|i, j, v| {
                if i == j {
                    out[i] += v;
                }
            }),
        }
        out
    }

    pub fn add_scaled(&mut self, other: &Matrix, factor: f64) {
        match (self, other) {
            (Matrix::Dense(m), Matrix::Dense(o)) => {
                for (m, o) in m.iter_mut().zip(o.iter()) {
                    *m += o * factor;
                }
            }
            (m, o) => o.each(|i, j, v| m.add(i, j, v * factor)),
        }
    }

    /// Rows with `kept` false become zero; the places of a sparse matrix stay.
    pub fn keep_rows(&mut self, kept: &[bool]) {
        match self {
            Matrix::Dense(m) => {
                for (i, _) in kept.iter().enumerate().filter(|(_, k)| !**k) {
                    m.row_mut(i).fill(0.0);
                }
            }
            Matrix::Sparse(t) => {
                for (i, _, v) in &mut t.list {
                    if !kept[*i as usize] {
                        *v = 0.0;
                    }
                }
            }
        }
    }

    /// Columns first..first + 3 times a 3 x 3 matrix, for all such triples.
    pub fn turn_columns(&mut self, triples: &[(usize, [[f64; 3]; 3])]) {
        if triples.is_empty() {
            return;
        }
        match self {
            Matrix::Dense(m) => turn_columns(m, triples),
            Matrix::Sparse(t) => {
                let mut of = vec![None; t.cols];
                for (first, map) in triples {
                    for l in 0..3 {
                        of[first + l] = Some((*first, map[l]));
                    }
                }
                let mut list = Vec::with_capacity(t.list.len());
                for (i, j, v) in &t.list {
                    match of[*j as usize] {
                        None => list.push((*i, *j, *v)),
                        Some((first, row)) => {
                            list.extend((0..3).map(|k| (*i, (first + k) as u32, v * row[k])));
                        }
                    }
                }
                t.list = list;
            }
        }
    }
}
