//! Derivative matrices by their nonzero entries, sorted by direction.
use faer::Mat;
use faer::prelude::*;

use crate::error::{Error, Result};
use crate::linalg::dense::{C, dot, real_times};

/// A matrix with one entry in this many is filled: the product with all shapes is then faster than single entries.
const FILLED: usize = 8;

fn not_finite() -> Error {
    Error::model("a derivative of the matrices contains NaN or infinite entries")
}

/// dA/dp for all directions p.
#[derive(Debug, Clone, Default)]
pub struct Slices {
    /// Entries of direction p are `entries[start[p]..start[p + 1]]`.
    start: Vec<usize>,
    entries: Vec<(usize, usize, f64)>,
}

impl Slices {
    /// From unsorted triplets: row, column and value of each entry, and the direction it belongs to.
    pub fn new(
        rows: &[i64],
        columns: &[i64],
        direction: &[i64],
        values: &[f64],
        n: usize,
        count: usize,
    ) -> Result<Self> {
        let length = values.len();
        if rows.len() != length || columns.len() != length || direction.len() != length {
            return Err(Error::model(
                "the entries of a derivative need as many rows, columns and directions as values",
            ));
        }
        let inside = |index: i64, bound: usize| usize::try_from(index).ok().filter(|&i| i < bound);
        let mut sorted = Vec::with_capacity(length);
        for k in 0..length {
            let place = (inside(rows[k], n), inside(columns[k], n), inside(direction[k], count));
            let (Some(i), Some(j), Some(p)) = place else {
                return Err(Error::model(format!("entry {k} of a derivative lies outside the matrices")));
            };
            if !values[k].is_finite() {
                return Err(not_finite());
            }
            sorted.push((p, j, i, values[k]));
        }
        sorted.sort_by_key(|&(p, j, i, _)| (p, j, i));
        let mut start = vec![0; count + 1];
        for &(p, ..) in &sorted {
            start[p + 1] += 1;
        }
        for p in 0..count {
            start[p + 1] += start[p];
        }
        let entries = sorted.into_iter().map(|(_, j, i, v)| (i, j, v)).collect();
        Ok(Slices { start, entries })
    }

    /// One direction more: the entries of a matrix (columns one behind the other) that are not zero, of an empty one none.
    pub fn push(&mut self, matrix: &[f64], n: usize) -> Result<()> {
        if matrix.iter().any(|v| !v.is_finite()) {
            return Err(not_finite());
        }
        if self.start.is_empty() {
            self.start.push(0);
        }
        let filled = matrix.iter().enumerate().filter(|(_, v)| **v != 0.0);
        self.entries.extend(filled.map(|(k, v)| (k % n, k / n, *v)));
        self.start.push(self.entries.len());
        Ok(())
    }

    pub fn of(&self, p: usize) -> &[(usize, usize, f64)] {
        &self.entries[self.start[p]..self.start[p + 1]]
    }

    /// y^T A_p x.
    fn bilinear(&self, p: usize, y: &[C], x: &[C]) -> C {
        self.of(p).iter().map(|&(i, j, v)| y[i] * x[j] * v).sum()
    }

    fn dense(&self, p: usize, n: usize) -> Mat<f64> {
        let mut a = Mat::zeros(n, n);
        for &(i, j, v) in self.of(p) {
            a[(i, j)] += v;
        }
        a
    }

    fn bilinear_real(&self, p: usize, y: &[f64], x: &[f64]) -> f64 {
        self.of(p).iter().map(|&(i, j, v)| y[i] * x[j] * v).sum()
    }
}

/// Derivatives of mass, of the velocity matrix C + G and of the position matrix K + N.
pub struct Directions {
    pub m: Slices,
    pub d: Slices,
    pub s: Slices,
    count: usize,
}

impl Directions {
    pub fn new(m: Slices, d: Slices, s: Slices, count: usize) -> Self {
        Directions { m, d, s, count }
    }

    pub fn count(&self) -> usize {
        self.count
    }

    /// y^T (s^2 dM + s dD + dS) x for every direction.
    pub fn bilinear(&self, s: C, y: ColRef<'_, C>, x: ColRef<'_, C>) -> Vec<C> {
        let (y, x): (Vec<C>, Vec<C>) = (y.iter().copied().collect(), x.iter().copied().collect());
        if y.iter().chain(&x).all(|v| v.im == 0.0) {
            let parts = |v: &[C]| v.iter().map(|v| v.re).collect::<Vec<f64>>();
            let (y, x) = (parts(&y), parts(&x));
            let of = |a: &Slices, p: usize| a.bilinear_real(p, &y, &x);
            return (0..self.count).map(|p| s * s * of(&self.m, p) + s * of(&self.d, p) + of(&self.s, p)).collect();
        }
        let of = |a: &Slices, p: usize| a.bilinear(p, &y, &x);
        (0..self.count).map(|p| s * s * of(&self.m, p) + s * of(&self.d, p) + of(&self.s, p)).collect()
    }

    /// y_j^T (s_j^2 dM + s_j dD + dS) x_j for every mode j (row) and direction (column). Filled matrices are multiplied as such,
    /// others entry by entry.
    pub fn diagonal(&self, s: &[C], y: MatRef<'_, C>, x: MatRef<'_, C>) -> Mat<C> {
        let mut out = Mat::<C>::zeros(s.len(), self.count);
        let columns =
            |a: MatRef<'_, C>| -> Vec<Vec<C>> { (0..a.ncols()).map(|j| a.col(j).iter().copied().collect()).collect() };
        let (ys, xs) = (columns(y), columns(x));
        for (a, power) in [(&self.m, 2), (&self.d, 1), (&self.s, 0)] {
            for p in (0..self.count).filter(|&p| !a.of(p).is_empty()) {
                let filled = a.of(p).len() * FILLED >= x.nrows() * x.nrows();
                let product = filled.then(|| real_times(a.dense(p, x.nrows()).as_ref(), x));
                for (j, s) in s.iter().enumerate() {
                    let form = match &product {
                        Some(ax) => dot(y.col(j), ax.col(j)),
                        None => a.bilinear(p, &ys[j], &xs[j]),
                    };
                    out[(j, p)] += s.powi(power) * form;
                }
            }
        }
        out
    }

    /// |y|^T |dS| |x| for every direction.
    pub fn absolute_stiffness(&self, y: ColRef<'_, C>, x: ColRef<'_, C>) -> Vec<f64> {
        (0..self.count).map(|p| self.s.of(p).iter().map(|&(i, j, v)| (y[i] * x[j] * v).norm()).sum()).collect()
    }

    /// out += (s^2 dM_p + s dD_p + dS_p) x.
    pub fn add_product(&self, p: usize, s: C, x: &[C], out: &mut [C]) {
        for (a, factor) in [(&self.m, s * s), (&self.d, s), (&self.s, C::ONE)] {
            for &(i, j, v) in a.of(p) {
                out[i] += factor * x[j] * v;
            }
        }
    }

    /// x^T dM_p y without conjugation.
    pub fn mass_form(&self, p: usize, x: &[C], y: &[C]) -> C {
        self.m.bilinear(p, x, y)
    }

    pub fn velocity_form(&self, p: usize, x: &[C], y: &[C]) -> C {
        self.d.bilinear(p, x, y)
    }

    /// The same derivatives in coordinates x_i = d_i x'_i.
    pub fn scaled(&self, d: &[f64]) -> Directions {
        let scale = |a: &Slices| Slices {
            start: a.start.clone(),
            entries: a.entries.iter().map(|&(i, j, v)| (i, j, v * d[i] * d[j])).collect(),
        };
        Directions { m: scale(&self.m), d: scale(&self.d), s: scale(&self.s), count: self.count }
    }
}
