//! A table of points, joined by a monotone cubic spline (PCHIP: F. N. Fritsch and J. Butland, SIAM J. Sci. Stat. Comput. 5
//! (1984) 300-304), straight beyond its ends.
use super::law::{At, Law, Scalar, Surface};

/// Parameters u_0 ... u_m f_0 ... f_m.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Table {
    /// points
    n: usize,
}

impl Law for Table {
    fn with(n: usize) -> Option<Self> {
        (n >= 4 && n.is_multiple_of(2)).then_some(Table { n: n / 2 })
    }

    fn n_params(&self) -> usize {
        2 * self.n
    }

    fn force<D: Scalar>(&self, at: At<D>, p: &[D], _z: &[D], _after: &mut [D]) -> D {
        pchip(at.u, &p[..self.n], &p[self.n..])
    }

    fn surfaces(&self, p: &[f64]) -> Vec<Surface> {
        p[..self.n].iter().map(|u| Surface::knot(*u)).collect()
    }
}

/// The spline through (x_i, y_i), x ascending, at u.
pub fn pchip<D: Scalar>(u: D, x: &[D], y: &[D]) -> D {
    let last = x.len() - 1;
    if u.re() <= x[0].re() {
        return y[0] + slope(0, x, y) * (u - x[0]);
    }
    if u.re() >= x[last].re() {
        return y[last] + slope(last, x, y) * (u - x[last]);
    }
    let i = x.partition_point(|x| x.re() <= u.re()).clamp(1, last) - 1;
    let h = x[i + 1] - x[i];
    let t = (u - x[i]) / h;
    let (d0, d1) = (slope(i, x, y) * h, slope(i + 1, x, y) * h);
    let rise = y[i + 1] - y[i];
    let (c2, c3) = (rise * 3.0 - d0 * 2.0 - d1, d0 + d1 - rise * 2.0);
    y[i] + t * (d0 + t * (c2 + t * c3))
}

fn slope<D: Scalar>(i: usize, x: &[D], y: &[D]) -> D {
    let last = x.len() - 1;
    let h = |i: usize| x[i + 1] - x[i];
    let secant = |i: usize| (y[i + 1] - y[i]) / h(i);
    if last == 1 {
        return secant(0);
    }
    if i == 0 {
        return end_slope(h(0), h(1), secant(0), secant(1));
    }
    if i == last {
        return end_slope(h(last - 1), h(last - 2), secant(last - 1), secant(last - 2));
    }
    let (s0, s1) = (secant(i - 1), secant(i));
    if s0.re() * s1.re() <= 0.0 {
        return D::from(0.0);
    }
    // weighted harmonic mean of the two secants
    let (w0, w1) = (h(i) * 2.0 + h(i - 1), h(i) + h(i - 1) * 2.0);
    (w0 + w1) / (w0 / s0 + w1 / s1)
}

/// Three-point slope at an end, limited so that the first piece stays monotone.
fn end_slope<D: Scalar>(h0: D, h1: D, s0: D, s1: D) -> D {
    let d = ((h0 * 2.0 + h1) * s0 - h0 * s1) / (h0 + h1);
    if d.re() * s0.re() <= 0.0 {
        D::from(0.0)
    } else if s0.re() * s1.re() <= 0.0 && d.re().abs() > 3.0 * s0.re().abs() {
        s0 * 3.0
    } else {
        d
    }
}
