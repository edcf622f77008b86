//! Transfer functions where Z(i omega) is singular: undamped at a resonance, or free to move at omega = 0.
//!
//! Entries that see the singular direction are infinite, or take their limit where derivatives make it finite (the rigid-body
//! mass line of an accelerance); the others are those of the remaining directions.
use faer::linalg::solvers::DenseSolveCore;
use faer::{Mat, MatRef, c64};

use super::linear_system::LinearSystem;
use super::ports::{Ports, complex, i_omega};
use crate::error::{Error, Result};
use crate::linalg::quadratic::is_finite_complex;
use crate::tolerances::frequency_response::{UNRESISTED, UNSEEN};

const INFINITE: c64 = c64::new(f64::INFINITY, 0.0);

/// The system in mass-normalised coordinates where the mass allows it (m is None, an identity), else unchanged.
struct Frame {
    m: Option<Mat<c64>>,
    d: Option<Mat<c64>>,
    s: Mat<c64>,
    l: Mat<c64>,
    f: Mat<c64>,
}

struct Split {
    /// left and right null vectors of the mass-normalised Z, and the part of L Z^-1 F that is regular
    left: Mat<c64>,
    right: Mat<c64>,
    regular: Mat<c64>,
}

/// H without the feedthrough but with all powers of i omega, and whether Z is singular at all.
pub fn transfer(system: &LinearSystem, ports: &Ports, w: f64) -> Result<(Mat<c64>, bool)> {
    let frame = Frame::new(system, ports);
    let split = frame.split(w)?;
    let (l, f) = (&frame.l, &frame.f);
    let order = |j: usize| ports.order_in[j] + ports.order_out;
    let mut value = Mat::from_fn(l.nrows(), f.ncols(), |i, j| split.regular[(i, j)] * i_omega(w, order(j)));
    if split.right.ncols() == 0 {
        return Ok((value, false));
    }
    let seen = l * &split.right;
    let driven = split.left.adjoint() * f;
    for j in 0..f.ncols() {
        let limit = frame.limit(&split, w, order(j));
        for i in 0..l.nrows() {
            let (row, column) = (seen.row(i), driven.col(j));
            let floor = UNSEEN * l.row(i).norm_l2() * f.col(j).norm_l2();
            if row.norm_l2() * column.norm_l2() <= floor {
                continue;
            }
            value[(i, j)] = match &limit {
                Limit::Zero => value[(i, j)],
                Limit::Finite(core) => value[(i, j)] + row * core * column,
                Limit::Infinite => INFINITE,
            };
        }
    }
    Ok((value, true))
}

enum Limit {
    Zero,
    Finite(Mat<c64>),
    Infinite,
}

impl Frame {
    fn new(system: &LinearSystem, ports: &Ports) -> Self {
        let q = system.quadratic();
        match system.normal() {
            Some(form) => Frame {
                m: None,
                d: form.d.as_ref().map(|d| complex(d.as_ref())),
                s: complex(form.s.as_ref()),
                l: complex(form.outputs(ports.l.as_ref()).as_ref()),
                f: complex(form.inputs(ports.f.as_ref()).as_ref()),
            },
            None => Frame {
                m: Some(complex(q.m.as_ref())),
                d: q.d.as_ref().map(|d| complex(d.as_ref())),
                s: complex(q.s.as_ref()),
                l: complex(ports.l.as_ref()),
                f: complex(ports.f.as_ref()),
            },
        }
    }

    /// Limit of (i omega)^order times the singular part, between the null directions.
    fn limit(&self, split: &Split, w: f64, order: u32) -> Limit {
        if w != 0.0 || order == 0 {
            return Limit::Infinite;
        }
        let mass = match &self.m {
            Some(m) => split.left.adjoint() * m * &split.right,
            None => split.left.adjoint() * &split.right,
        };
        let resisted = self
            .d
            .as_ref()
            .map(|d| (d.norm_l2(), split.left.adjoint() * d * &split.right))
            .filter(|(size, core)| core.norm_l2() > UNRESISTED * size)
            .map(|(_, core)| core);
        // near omega = 0 the singular part is core^-1 / (i omega)^pole_order
        let (core, pole_order) = match resisted {
            Some(core) => (core, 1),
            None => (mass, 2),
        };
        if order > pole_order {
            return Limit::Zero;
        }
        if order < pole_order {
            return Limit::Infinite;
        }
        let inverse = core.partial_piv_lu().inverse();
        if is_finite_complex(inverse.as_ref()) {
            Limit::Finite(inverse)
        } else {
            Limit::Infinite // damped and undamped rigid motions mixed: only the largest growth is claimed
        }
    }

    fn split(&self, w: f64) -> Result<Split> {
        let n = self.s.nrows();
        let zero = c64::new(0.0, 0.0);
        let z = Mat::from_fn(n, n, |i, j| {
            let identity = c64::new((i == j) as u8 as f64, 0.0);
            let m = self.m.as_ref().map_or(identity, |m| m[(i, j)]);
            let d = self.d.as_ref().map_or(zero, |d| d[(i, j)]);
            self.s[(i, j)] - m * (w * w) + c64::new(0.0, w) * d
        });
        let svd = z.svd().map_err(|_| {
            Error::singular(format!("the dynamic stiffness at omega = {w} rad/s could not be decomposed"))
        })?;
        let sigma: Vec<f64> = (0..n).map(|k| svd.S()[k].re).collect();
        let size = self.s.norm_l2() + w * w + self.d.as_ref().map_or(0.0, |d| w * d.norm_l2());
        let tol = 4.0 * (n as f64).max(4.0) * f64::EPSILON * size;
        let rank = sigma.iter().filter(|s| **s > tol).count();
        let (u, v): (MatRef<'_, c64>, MatRef<'_, c64>) = (svd.U(), svd.V());
        let mut seen = &self.l * v.subcols(0, rank);
        for k in 0..rank {
            for i in 0..seen.nrows() {
                seen[(i, k)] /= sigma[k];
            }
        }
        Ok(Split {
            left: u.subcols(rank, n - rank).to_owned(),
            right: v.subcols(rank, n - rank).to_owned(),
            regular: seen * (u.subcols(0, rank).adjoint() * &self.f),
        })
    }
}
