//! The second-order linear system that all linear analyses see: (s^2 M + s (C + G) + K + N) x = f.
pub mod eigen_sensitivity;
mod expansion;
pub mod frf;
pub mod frf_banded;
pub mod frf_poles;
pub mod frf_resonances;
pub mod frf_routes;
pub mod frf_sensitivity;
pub mod frf_singular;
pub mod frf_sparse;
pub mod history;
pub mod linear_system;
pub mod modal;
pub mod ports;
pub mod response;
pub mod response_sensitivity;
pub mod sparse_crowded;
pub mod sparse_damped;
pub mod sparse_general;
pub mod sparse_modal;
pub mod sparse_pencil;
pub mod sparse_polynomial;
pub mod state;

use faer::Mat;

use crate::error::{Error, Result};
use crate::linalg::dense::{asymmetry, is_finite, is_zero, symmetrised};
use crate::linalg::quadratic::Quadratic;
use crate::tolerances::matrices::ASYMMETRY;
use crate::tolerances::matrices::ENTRY_ROUNDING;
use crate::tolerances::modes::INDEFINITE;

/// Dense matrices, n x n. Absent ones are None, so that what is absent costs nothing.
#[derive(Debug, Clone)]
pub struct SecondOrder {
    /// Mass, symmetric positive definite.
    pub m: Mat<f64>,
    /// Damping, symmetric.
    pub c: Option<Mat<f64>>,
    /// Gyroscopic, skew.
    pub g: Option<Mat<f64>>,
    /// Stiffness, symmetric.
    pub k: Mat<f64>,
    /// Circulatory, skew.
    pub n: Option<Mat<f64>>,
    /// Any factor with K = kf^T kf; it holds low frequencies that rounding has erased from an assembled K.
    pub kf: Option<Mat<f64>>,
    /// Any factor with M = mf^T mf; it holds light bodies that rounding has erased from an assembled M.
    pub mf: Option<Mat<f64>>,
}

impl SecondOrder {
    /// Checks sizes, symmetry and finiteness; matrices that are zero become absent.
    pub fn new(
        m: Mat<f64>,
        c: Option<Mat<f64>>,
        g: Option<Mat<f64>>,
        k: Mat<f64>,
        n: Option<Mat<f64>>,
    ) -> Result<Self> {
        let size = m.nrows();
        if size == 0 {
            return Err(Error::model("the system has no degrees of freedom"));
        }
        let m = checked("M", m, size, 1.0)?;
        let k = checked("K", k, size, 1.0)?;
        let c = present("C", c, size, 1.0)?;
        let g = present("G", g, size, -1.0)?;
        let n = present("N", n, size, -1.0)?;
        Ok(SecondOrder { m, c, g, k, n, kf: None, mf: None })
    }

    /// The same system with a factor of its stiffness matrix, if there is one.
    pub fn with_stiffness_factor(self, kf: Option<Mat<f64>>) -> Result<Self> {
        let size = self.size();
        if let Some(kf) = &kf {
            if kf.ncols() != size {
                return Err(Error::model(format!(
                    "the stiffness factor has {} columns but M is {size} x {size}",
                    kf.ncols()
                )));
            }
            if !is_finite(kf.as_ref()) {
                return Err(Error::model("the stiffness factor contains NaN or infinite entries"));
            }
        }
        Ok(SecondOrder { kf, ..self })
    }

    /// M, D and S, with D and S in their symmetric and skew parts.
    pub fn split(q: &Quadratic) -> Result<Self> {
        let part =
            |a: &Mat<f64>, sign: f64| Mat::from_fn(a.nrows(), a.ncols(), |i, j| 0.5 * (a[(i, j)] + sign * a[(j, i)]));
        let of = |sign: f64| q.d.as_ref().map(|d| part(d, sign));
        SecondOrder::new(q.m.clone(), of(1.0), of(-1.0), part(&q.s, 1.0), Some(part(&q.s, -1.0)))
    }

    /// The same system with a factor of its mass matrix.
    pub fn with_mass_factor(self, mf: Mat<f64>) -> Result<Self> {
        let size = self.size();
        if mf.ncols() != size || mf.nrows() < size || !is_finite(mf.as_ref()) {
            return Err(Error::model(format!("the mass factor must be finite, with {size} columns and no fewer rows")));
        }
        Ok(SecondOrder { mf: Some(mf), ..self })
    }

    /// The same system (in units of its masses) without entries of K and C that can only be rounding: no semidefinite matrix has
    /// K_ij^2 > K_ii K_jj, and an entry of a few units in the last place of a neighbour's is what assembly leaves where nothing is.
    /// Solved as it is, such an entry makes rigid directions diverge.
    pub fn without_rounding(self) -> SecondOrder {
        SecondOrder { k: cleaned(self.k), c: self.c.map(cleaned).filter(|c| !is_zero(c.as_ref())), ..self }
    }

    /// Number of coordinates.
    pub fn size(&self) -> usize {
        self.m.nrows()
    }

    /// C + G, or None where both are absent.
    pub fn velocity(&self) -> Option<Mat<f64>> {
        match (&self.c, &self.g) {
            (Some(c), Some(g)) => Some(c + g),
            (Some(d), None) | (None, Some(d)) => Some(d.clone()),
            (None, None) => None,
        }
    }

    /// K + N.
    pub fn position(&self) -> Mat<f64> {
        match &self.n {
            Some(n) => &self.k + n,
            None => self.k.clone(),
        }
    }

    /// True where (s^2 M + s (C + G) + K + N) is a symmetric matrix, so that left and right vectors agree.
    pub fn is_symmetric(&self) -> bool {
        self.g.is_none() && self.n.is_none()
    }

    /// The same system in coordinates d_i x'_i = x_i with unit masses, as nearly as powers of two can, and d.
    /// Units no longer matter then, and the scaling itself makes no rounding error.
    pub fn scaled(&self) -> Result<(SecondOrder, Vec<f64>)> {
        let n = self.size();
        let mut d = Vec::with_capacity(n);
        for i in 0..n {
            let mass = self.m[(i, i)];
            if mass <= 0.0 {
                return Err(massless(i));
            }
            d.push((-0.5 * mass.log2()).round().exp2());
        }
        let both = |a: &Mat<f64>| Mat::from_fn(n, n, |i, j| a[(i, j)] * d[i] * d[j]);
        let columns = |f: &Mat<f64>| Mat::from_fn(f.nrows(), n, |i, j| f[(i, j)] * d[j]);
        let scaled = SecondOrder {
            m: both(&self.m),
            c: self.c.as_ref().map(both),
            g: self.g.as_ref().map(both),
            k: both(&self.k),
            n: self.n.as_ref().map(both),
            kf: self.kf.as_ref().map(columns),
            mf: self.mf.as_ref().map(columns),
        };
        Ok((scaled, d))
    }
}

fn cleaned(a: Mat<f64>) -> Mat<f64> {
    let size: Vec<f64> = (0..a.nrows()).map(|i| a[(i, i)].abs()).collect();
    let is_rounding = |i: usize, j: usize, v: f64| {
        v * v > size[i] * size[j] * (1.0 + INDEFINITE)
            && v.abs() <= ENTRY_ROUNDING * f64::EPSILON * size[i].max(size[j])
    };
    Mat::from_fn(a.nrows(), a.ncols(), |i, j| if i != j && is_rounding(i, j, a[(i, j)]) { 0.0 } else { a[(i, j)] })
}

/// The error of a mass matrix that is not positive definite. `{coordinate i}` is replaced by its name at the border.
pub fn massless(i: usize) -> Error {
    Error::singular(format!(
        "the mass matrix is not positive definite: {{coordinate {i}}} carries no inertia of its own; give it mass or \
         inertia, or remove it"
    ))
}

fn present(name: &str, a: Option<Mat<f64>>, size: usize, sign: f64) -> Result<Option<Mat<f64>>> {
    let checked = a.map(|a| checked(name, a, size, sign)).transpose()?;
    Ok(checked.filter(|a| !is_zero(a.as_ref())))
}

fn checked(name: &str, a: Mat<f64>, size: usize, sign: f64) -> Result<Mat<f64>> {
    if a.nrows() != size || a.ncols() != size {
        return Err(Error::model(format!("{name} is {} x {} but M is {size} x {size}", a.nrows(), a.ncols())));
    }
    if !is_finite(a.as_ref()) {
        return Err(Error::model(format!("{name} contains NaN or infinite entries")));
    }
    let (gap, i, j) = asymmetry(a.as_ref(), sign);
    check_symmetry(name, gap, i, j)?;
    Ok(if sign > 0.0 { symmetrised(a) } else { Mat::from_fn(size, size, |i, j| 0.5 * (a[(i, j)] - a[(j, i)])) })
}

/// The matrix of this name must be symmetric (M, C, K) or skew (G, N): an error where entries i, j differ by more than rounding, `gap`
/// of the largest entry.
pub fn check_symmetry(name: &str, gap: f64, i: usize, j: usize) -> Result<()> {
    if gap <= ASYMMETRY {
        return Ok(());
    }
    let wanted = if matches!(name, "G" | "N") { "skew-symmetric" } else { "symmetric" };
    let remedy = match name {
        "M" => "a mass matrix must be symmetric",
        "C" | "G" => "pass the symmetric part as C and the skew part as G",
        _ => "pass the symmetric part as K and the skew part as N",
    };
    Err(Error::model(format!("{name} is not {wanted} (entries {i}, {j} differ by {gap:.1e} of the largest); {remedy}")))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn asymmetry_counts_from_its_bound_on() {
        assert!(check_symmetry("K", 1e-11, 0, 1).is_ok());
        assert!(check_symmetry("K", 1e-9, 0, 1).is_err() && check_symmetry("K", f64::NAN, 0, 1).is_err());
    }

    #[test]
    fn an_entry_of_rounding_that_no_semidefinite_matrix_has_is_dropped() {
        let left = |excess: f64| {
            let v = 1e-16 * (1.0 + excess).sqrt();
            cleaned(faer::mat![[1.0, v], [v, 1e-32]])[(0, 1)]
        };
        assert!(left(1e-11) == 0.0 && left(1e-13) != 0.0);
    }
}
