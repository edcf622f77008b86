//! Tangents at constant rates and accelerations.
//!
//! A linearisation lets three rotations carry their rates along, dv = y' + y x v and da = y" + y' x v + y x a; in a motion rates and
//! accelerations stay. With Omega y = y x v and A y = y x a in the columns of such rotations
//! ```text
//! D - M Omega,   K - (D + C) Omega + M (Omega Omega - A)
//! ```
use nalgebra::DMatrix;

use crate::linalg::entries::Entries;
use crate::multibody::assemble::Tangent;
use crate::spatial::{M3, Real, V3, skew};

use super::{Equations, Motion};
use crate::linalg::matrix::Matrix;
use crate::multibody::rotations::rotation_triples;

/// A matrix that can be read entry by entry; those of the same place add up.
pub(super) trait Listed<T>: Entries<T> {
    fn columns(&self) -> usize;
    fn visit(&self, each: &mut dyn FnMut(usize, usize, T));
}

impl<T: Real> Listed<T> for DMatrix<T> {
    fn columns(&self) -> usize {
        self.ncols()
    }

    fn visit(&self, each: &mut dyn FnMut(usize, usize, T)) {
        for (j, column) in self.column_iter().enumerate() {
            for (i, v) in column.iter().enumerate() {
                each(i, j, *v);
            }
        }
    }
}

impl Listed<f64> for Matrix {
    fn columns(&self) -> usize {
        self.shape().1
    }

    fn visit(&self, each: &mut dyn FnMut(usize, usize, f64)) {
        self.each(|i, j, v| {
            if v != 0.0 {
                each(i, j, v);
            }
        });
    }
}

/// Entries of columns first..first + 3 times a 3 x 3 matrix, for all such triples.
fn columns_times<T: Real>(matrix: &impl Listed<T>, triples: &[(usize, M3<T>)]) -> Vec<(usize, usize, T)> {
    if triples.is_empty() {
        return Vec::new();
    }
    let mut of = vec![None; matrix.columns()];
    for (first, map) in triples {
        for l in 0..3 {
            of[first + l] = Some((*first, map.row(l).into_owned()));
        }
    }
    let mut out = Vec::new();
    matrix.visit(&mut |i, j, v| {
        if let Some((first, row)) = &of[j] {
            out.extend((0..3).map(|k| (i, first + k, v * row[k])));
        }
    });
    out
}

impl<T: Real> Equations<'_, T> {
    pub(super) fn hold_rates<E: Listed<T>>(&self, m: &Motion<T>, a: &[T], t: &mut Tangent<T, E>) {
        let Some(gyroscopic) = t.gyroscopic.as_mut() else {
            return;
        };
        let turning =
            |v: &[T], first: usize, sign: f64| skew(&(V3::new(v[first], v[first + 1], v[first + 2]) * T::from(sign)));
        let (mut rates, mut accelerations) = (Vec::new(), Vec::new());
        for (first, sign) in rotation_triples(self.topology()) {
            let omega = turning(&m.rate, first, sign);
            rates.push((first, omega));
            accelerations.push((first, omega * omega + turning(a, first, sign)));
        }
        let mut stiff = columns_times(gyroscopic, &rates);
        if let Some(damping) = &t.damping {
            stiff.extend(columns_times(damping, &rates));
        }
        stiff.extend(columns_times(&t.mass, &accelerations));
        for (i, j, v) in columns_times(&t.mass, &rates) {
            gyroscopic.add(i, j, v);
        }
        for (i, j, v) in stiff {
            t.stiffness.add(i, j, v);
        }
    }
}
