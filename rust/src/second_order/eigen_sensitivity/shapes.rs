//! Derivatives of shapes, by one bordered factorisation for each mode that serves all directions.
//!
//! `[Q, Q' phi; phi^H, 0] [v; -] = [-(dQ + ds Q') phi; 0]` gives the part of the derivative outside phi; the normalisation of the
//! modes gives the part along it.
use faer::Mat;
use faer::prelude::*;

use super::{Directions, Known, undefined};
use crate::error::{Error, Result};
use crate::linalg::dense::C;
use crate::run::{Cancel, Counts};
use crate::second_order::SecondOrder;
use crate::second_order::modal::largest_component;

/// Matrices scaled to unit masses: shape derivatives mix coordinates of different units in one factorisation.
struct Scaled {
    system: SecondOrder,
    d: Option<Mat<f64>>,
    s: Mat<f64>,
    directions: Directions,
    scale: Vec<f64>,
    symmetric: bool,
}

/// dphi/dp of mode j as a (dof, directions) matrix for every mode; nan for members of repeated groups, near-defective modes and
/// wherever ds/dp is nan. O(modes (dof^3 + directions dof^2)).
pub fn shape_derivatives(
    system: &SecondOrder,
    known: &Known,
    directions: &Directions,
    ds: &Mat<C>,
    counts: &mut Counts,
    cancel: &Cancel,
) -> Result<Vec<Mat<C>>> {
    known.check(system.size())?;
    if ds.nrows() != known.s.len() || ds.ncols() != directions.count() {
        return Err(Error::model("ds must have one row for each mode and one column for each direction"));
    }
    let symmetric = system.is_symmetric();
    let (system, scale) = system.scaled()?;
    let scaled = Scaled {
        d: system.velocity(),
        s: system.position(),
        directions: directions.scaled(&scale),
        system,
        scale,
        symmetric,
    };
    (0..known.s.len())
        .map(|j| {
            cancel.check()?;
            if known.near_defective[j] || known.in_group(j) {
                return Ok(Mat::from_fn(scaled.scale.len(), directions.count(), |_, _| undefined()));
            }
            counts.add("bordered factorisations", 1);
            Ok(scaled.derivative(known, j, ds))
        })
        .collect()
}

/// One mode in scaled coordinates, with M phi and Q' phi.
struct Mode {
    s: C,
    x: Vec<C>,
    mx: Vec<C>,
    slope: Vec<C>,
}

impl Scaled {
    fn derivative(&self, known: &Known, j: usize, ds: &Mat<C>) -> Mat<C> {
        let n = self.scale.len();
        let (s, rigid) = (known.s[j], known.rigid[j]);
        let x: Vec<C> = (0..n).map(|i| known.x[(i, j)] / self.scale[i]).collect();
        let mx = times(&self.system.m, &x);
        let slope = self.slope(s, &x, &mx);
        let mode = Mode { s, x, mx, slope };
        // a free rigid mode has no Q' phi; its zero root is one of s^2, whose derivative by s^2 is M phi
        let border = if rigid { &mode.mx } else { &mode.slope };
        let lu = self.bordered(s, &mode.x, border).partial_piv_lu();
        let count = self.directions.count();
        let mut v = Mat::<C>::zeros(n + 1, count);
        for p in 0..count {
            let mut load = vec![C::ZERO; n];
            self.directions.add_product(p, s, &mode.x, &mut load);
            for i in 0..n {
                v[(i, p)] = -load[i] - ds[(j, p)] * mode.slope[i];
            }
        }
        lu.solve_in_place(v.as_mut());
        let modal = self.symmetric && s.im > 0.0;
        for p in 0..count {
            let part: Vec<C> = (0..n).map(|i| v[(i, p)]).collect();
            let along =
                if modal { self.along_modal(&mode, ds[(j, p)], &part, p) } else { self.along_unit(&mode, &part, p) };
            for i in 0..n {
                v[(i, p)] = self.scale[i] * (part[i] + along * mode.x[i]);
            }
        }
        v.subrows(0, n).to_owned()
    }

    fn slope(&self, s: C, x: &[C], mx: &[C]) -> Vec<C> {
        let mut slope: Vec<C> = mx.iter().map(|v| 2.0 * s * v).collect();
        if let Some(d) = &self.d {
            for (slope, dx) in slope.iter_mut().zip(times(d, x)) {
                *slope += dx;
            }
        }
        slope
    }

    fn bordered(&self, s: C, x: &[C], border: &[C]) -> Mat<C> {
        let n = x.len();
        let q = |i: usize, j: usize| {
            let damping = self.d.as_ref().map_or(C::ZERO, |d| s * d[(i, j)]);
            s * s * self.system.m[(i, j)] + damping + self.s[(i, j)]
        };
        let size = self.s.norm_max().max(s.norm_sqr());
        let norm = |v: &[C]| v.iter().map(|v| v.norm_sqr()).sum::<f64>().sqrt().max(f64::MIN_POSITIVE);
        let (column, row) = (size / norm(border), size / norm(x));
        Mat::from_fn(n + 1, n + 1, |i, j| match (i < n, j < n) {
            (true, true) => q(i, j),
            (true, false) => border[i] * column,
            (false, true) => x[j].conj() * row,
            (false, false) => C::ZERO,
        })
    }

    /// From phi^T (2 s M + C) phi = 2i Im s.
    fn along_modal(&self, mode: &Mode, ds: C, part: &[C], p: usize) -> C {
        let dot = |a: &[C], b: &[C]| a.iter().zip(b).map(|(a, b)| a * b).sum::<C>();
        let Mode { s, x, mx, slope } = mode;
        let explicit = 2.0 * ds * dot(x, mx)
            + 2.0 * s * self.directions.mass_form(p, x, x)
            + self.directions.velocity_form(p, x, x);
        let change = C::new(0.0, 2.0 * ds.im) - explicit - 2.0 * dot(slope, part);
        change / (2.0 * dot(slope, x))
    }

    /// From phi^H M phi = 1 with a real largest component.
    fn along_unit(&self, mode: &Mode, part: &[C], p: usize) -> C {
        let Mode { x, mx, .. } = mode;
        let conjugate: Vec<C> = x.iter().map(|v| v.conj()).collect();
        let inner: C = mx.iter().zip(part).map(|(m, v)| m.conj() * v).sum();
        let explicit = self.directions.mass_form(p, &conjugate, x);
        let column = Mat::from_fn(x.len(), 1, |i, _| x[i]);
        let k = largest_component(column.col(0), &self.scale);
        let phase = if x[k] == C::ZERO { 0.0 } else { -(part[k] / x[k]).im };
        C::new(-inner.re - 0.5 * explicit.re, phase)
    }
}

fn times(a: &Mat<f64>, x: &[C]) -> Vec<C> {
    let mut out = vec![C::ZERO; a.nrows()];
    for (j, value) in x.iter().enumerate() {
        for (i, out) in out.iter_mut().enumerate() {
            *out += value * a[(i, j)];
        }
    }
    out
}
