//! Derivatives of eigenvalues and shapes along directions of the matrices.
//!
//! A simple root: `ds = -psi^T (s^2 dM + s dD + dS) phi / psi^T (2 s M + D) phi` with D = C + G, S = K + N. A repeated root has the
//! matrix `-(Psi^T Q'(s) Phi)^-1 Psi^T (s^2 dM + s dD + dS) Phi` for every direction; its eigenvalues are the derivatives along that
//! direction, and those of a sum of matrices belong to the sum of directions.
mod shapes;
mod slices;

use faer::Mat;
use faer::prelude::*;

use crate::error::{Error, Result};
use crate::linalg::dense::{C, dot, real_times};
use crate::second_order::SecondOrder;
use crate::tolerances::modes::STILL_RIGID;

pub use shapes::shape_derivatives;
pub use slices::{Directions, Slices};

/// What is known of the modes: roots, shapes and left vectors as columns, and which of them need care.
pub struct Known {
    pub s: Vec<C>,
    pub x: Mat<C>,
    /// None where they equal x.
    pub y: Option<Mat<C>>,
    pub rigid: Vec<bool>,
    pub near_defective: Vec<bool>,
    /// First mode and number of modes of each repeated root.
    pub groups: Vec<(usize, usize)>,
}

impl Known {
    pub fn check(&self, n: usize) -> Result<()> {
        let m = self.s.len();
        let fits = |a: &Mat<C>| a.nrows() == n && a.ncols() == m;
        let groups = self.groups.iter().all(|&(first, count)| first + count <= m && count > 0);
        if fits(&self.x)
            && self.y.as_ref().is_none_or(fits)
            && self.rigid.len() == m
            && self.near_defective.len() == m
            && groups
        {
            Ok(())
        } else {
            Err(Error::model("the modal result does not belong to these matrices"))
        }
    }

    fn left(&self) -> &Mat<C> {
        self.y.as_ref().unwrap_or(&self.x)
    }

    fn in_group(&self, j: usize) -> bool {
        self.groups.iter().any(|&(first, count)| (first..first + count).contains(&j))
    }
}

/// ds/dp as (mode, direction); for every group its matrices, one per direction.
pub struct EigenSensitivity {
    pub eigenvalue: Mat<C>,
    pub groups: Vec<Vec<Mat<C>>>,
}

fn undefined() -> C {
    C::new(f64::NAN, f64::NAN)
}

/// O(entries of the directions x modes).
pub fn eigen_sensitivity(system: &SecondOrder, known: &Known, directions: &Directions) -> Result<EigenSensitivity> {
    known.check(system.size())?;
    let (modes, count) = (known.s.len(), directions.count());
    let denominator = denominators(system, known);
    let forms = directions.diagonal(&known.s, known.left().as_ref(), known.x.as_ref());
    let mut eigenvalue = Mat::from_fn(modes, count, |_, _| undefined());
    for j in (0..modes).filter(|&j| !known.near_defective[j] && !known.in_group(j)) {
        let row: Vec<C> = if known.rigid[j] {
            rigid_row(known, directions, j, denominator[j])
        } else {
            (0..count).map(|p| -forms[(j, p)] / denominator[j]).collect()
        };
        for (p, value) in row.into_iter().enumerate() {
            eigenvalue[(j, p)] = value;
        }
    }
    let mut groups = Vec::with_capacity(known.groups.len());
    for &(first, size) in &known.groups {
        let matrices = group_matrices(system, known, directions, first, size);
        for (p, matrix) in matrices.iter().enumerate() {
            for (k, value) in splits(matrix, known.s[first]).into_iter().enumerate() {
                eigenvalue[(first + k, p)] = value;
            }
        }
        groups.push(matrices);
    }
    Ok(EigenSensitivity { eigenvalue, groups })
}

/// psi^T (2 s M + D) phi of every mode.
fn denominators(system: &SecondOrder, known: &Known) -> Vec<C> {
    let mx = real_times(system.m.as_ref(), known.x.as_ref());
    let dx = system.velocity().map(|d| real_times(d.as_ref(), known.x.as_ref()));
    let y = known.left();
    (0..known.s.len())
        .map(|j| {
            let damping = dx.as_ref().map_or(C::ZERO, |dx| dot(y.col(j), dx.col(j)));
            2.0 * known.s[j] * dot(y.col(j), mx.col(j)) + damping
        })
        .collect()
}

/// A rigid mode stays rigid (0), moves as -psi^T dS phi / psi^T D phi, or, without a velocity term, leaves zero like a square
/// root (undefined).
fn rigid_row(known: &Known, directions: &Directions, j: usize, denominator: C) -> Vec<C> {
    let (y, x) = (known.left().col(j), known.x.col(j));
    let form = directions.bilinear(C::ZERO, y, x);
    let size = directions.absolute_stiffness(y, x);
    form.into_iter()
        .zip(size)
        .map(|(f, size)| {
            if f.norm() <= STILL_RIGID * size {
                C::ZERO
            } else if denominator == C::ZERO {
                undefined()
            } else {
                -f / denominator
            }
        })
        .collect()
}

fn group_matrices(
    system: &SecondOrder,
    known: &Known,
    directions: &Directions,
    first: usize,
    size: usize,
) -> Vec<Mat<C>> {
    let s = (first..first + size).map(|j| known.s[j]).sum::<C>() / size as f64;
    let (x, y) = (known.x.subcols(first, size), known.left().subcols(first, size));
    if known.near_defective[first..first + size].iter().any(|&d| d) {
        return vec![Mat::from_fn(size, size, |_, _| undefined()); directions.count()];
    }
    let mut forms = vec![Mat::<C>::zeros(size, size); directions.count()];
    for i in 0..size {
        for k in 0..size {
            for (p, f) in directions.bilinear(s, y.col(i), x.col(k)).into_iter().enumerate() {
                forms[p][(i, k)] = f;
            }
        }
    }
    let slope = slope_form(system, s, x, y);
    if known.rigid[first] && (0..size).all(|k| slope[(k, k)].norm() == 0.0) {
        return still_rigid(&forms, directions, x, y);
    }
    let lu = slope.partial_piv_lu();
    forms.iter().map(|form| -lu.solve(form)).collect()
}

/// Psi^T Q'(s) Phi.
fn slope_form(system: &SecondOrder, s: C, x: MatRef<'_, C>, y: MatRef<'_, C>) -> Mat<C> {
    let mx = real_times(system.m.as_ref(), x);
    let dx = system.velocity().map(|d| real_times(d.as_ref(), x));
    Mat::from_fn(x.ncols(), x.ncols(), |i, k| {
        let damping = dx.as_ref().map_or(C::ZERO, |dx| dot(y.col(i), dx.col(k)));
        2.0 * s * dot(y.col(i), mx.col(k)) + damping
    })
}

fn still_rigid(forms: &[Mat<C>], directions: &Directions, x: MatRef<'_, C>, y: MatRef<'_, C>) -> Vec<Mat<C>> {
    let mut sizes = vec![0.0f64; forms.len()];
    for i in 0..x.ncols() {
        for k in 0..x.ncols() {
            for (largest, size) in sizes.iter_mut().zip(directions.absolute_stiffness(y.col(i), x.col(k))) {
                *largest = largest.max(size);
            }
        }
    }
    forms
        .iter()
        .zip(sizes)
        .map(|(form, size)| {
            let rigid = form.norm_max() <= STILL_RIGID * size;
            let value = if rigid { C::ZERO } else { undefined() };
            Mat::from_fn(form.nrows(), form.nrows(), |_, _| value)
        })
        .collect()
}

/// Eigenvalues of a group's matrix in ascending d|s|, then ascending imaginary part.
fn splits(matrix: &Mat<C>, s: C) -> Vec<C> {
    let g = matrix.nrows();
    let finite = (0..g).all(|j| (0..g).all(|i| matrix[(i, j)].is_finite()));
    let Some(mut values) = finite.then(|| eigenvalues(matrix)).flatten() else {
        return vec![undefined(); g];
    };
    let growth = |v: &C| {
        if s == C::ZERO { v.re } else { (s.conj() * v).re / s.norm() }
    };
    values.sort_by(|a, b| growth(a).total_cmp(&growth(b)).then(a.im.total_cmp(&b.im)));
    values
}

fn eigenvalues(matrix: &Mat<C>) -> Option<Vec<C>> {
    if matrix.nrows() != 2 {
        return matrix.eigenvalues().ok();
    }
    let [mean, half] = [1.0, -1.0].map(|sign| (matrix[(0, 0)] + matrix[(1, 1)] * sign) * 0.5);
    let root = (half * half + matrix[(0, 1)] * matrix[(1, 0)]).sqrt();
    Some(vec![mean - root, mean + root])
}

#[cfg(test)]
mod tests;
