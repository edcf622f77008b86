//! Products of many small steps of M x" + C x' + K x + sum_e p_e (f_u w_e.x + f_v w_e.x') = 0 with tangents that vary in time, as
//! matrices of the states [x; x'/w0]: see `monodromy`.
use faer::Mat;
use faer::prelude::*;
use num_complex::Complex64 as c64;

use crate::periodic::tangents::Tangents;

/// Modes worse conditioned than this are not used as coordinates.
const SKEW: f64 = 1e6;

/// Modal coordinates z with [x; v] = to_state z, in which the linear part only turns and decays.
pub struct Modes {
    n: usize,
    poles: Vec<c64>,
    to_state: Mat<c64>,
    from_state: Mat<c64>,
    /// effect of element forces on z, (2n, n_e), and displacements and rates of the elements, (n_e, 2n)
    kick: Mat<c64>,
    see_u: Mat<c64>,
    see_v: Mat<c64>,
}

impl Modes {
    /// From M^-1 C, M^-1 K, M^-1 P and W; None where the modes are too skew to be coordinates.
    pub fn new(c: &Mat<f64>, k: &Mat<f64>, push: &Mat<f64>, see: &Mat<f64>) -> Option<Modes> {
        let (n, n_e) = (c.nrows(), see.ncols());
        let companion = companion(c, k, 1.0);
        let eigen = companion.eigen().ok()?;
        let poles: Vec<c64> = eigen.S().column_vector().iter().copied().collect();
        let mut to_state = eigen.U().to_owned();
        for j in 0..to_state.ncols() {
            let length = to_state.col(j).norm_l2();
            for x in to_state.col_as_slice_mut(j) {
                *x /= length;
            }
        }
        let from_state = to_state.partial_piv_lu().solve(Mat::<c64>::identity(2 * n, 2 * n));
        if to_state.norm_l2() * from_state.norm_l2() >= SKEW {
            return None;
        }
        let at = |m: &Mat<f64>, offset: usize| {
            Mat::from_fn(2 * n, n_e, |i, e| {
                let inside = i >= offset && i < offset + n;
                c64::new(if inside { m[(i - offset, e)] } else { 0.0 }, 0.0)
            })
        };
        Some(Modes {
            n,
            kick: &from_state * at(push, n) * Scale(c64::new(-1.0, 0.0)),
            see_u: at(see, 0).transpose() * &to_state,
            see_v: at(see, n).transpose() * &to_state,
            poles,
            to_state,
            from_state,
        })
    }

    /// The motion over one period 2 pi / w0.
    pub fn product(&self, tangents: &Tangents, steps: usize, w0: f64) -> Mat<f64> {
        let h = std::f64::consts::TAU / w0 / steps as f64;
        let size = 2 * self.n;
        let mut phi = Mat::<c64>::identity(size, size);
        let whole: Vec<c64> = self.poles.iter().map(|s| (s * h).exp()).collect();
        let half: Vec<c64> = self.poles.iter().map(|s| (s * (0.5 * h)).exp()).collect();
        scale_rows(&mut phi, &half);
        for step in 0..steps {
            self.apply(tangents, step, h, &mut phi);
            scale_rows(&mut phi, if step + 1 < steps { &whole } else { &half });
        }
        let states = &self.to_state * phi * &self.from_state;
        let unit = |i: usize| if i < self.n { 1.0 } else { w0 };
        Mat::from_fn(size, size, |i, j| states[(i, j)].re * unit(j) / unit(i))
    }

    /// z += h B g with (1 - h/2 F_v P) g = F_u u + F_v v: exact where there is no F_v, the midpoint rule otherwise.
    fn apply(&self, tangents: &Tangents, step: usize, h: f64, phi: &mut Mat<c64>) {
        let n_e = tangents.len();
        let f = |e: usize| (tangents[e].0[step], tangents[e].1[step]);
        if n_e == 1 {
            let (f_u, f_v) = f(0);
            let own: c64 = (0..phi.nrows()).map(|i| self.see_v[(0, i)] * self.kick[(i, 0)]).sum();
            let factor = h / (1.0 - 0.5 * h * f_v * own);
            let kick = self.kick.col_as_slice(0);
            let seen: Vec<c64> =
                (0..phi.nrows()).map(|i| (self.see_u[(0, i)] * f_u + self.see_v[(0, i)] * f_v) * factor).collect();
            for j in 0..phi.ncols() {
                let column = phi.col_as_slice_mut(j);
                let g: c64 = column.iter().zip(&seen).map(|(z, s)| s * z).sum();
                for (z, b) in column.iter_mut().zip(kick) {
                    *z += b * g;
                }
            }
            return;
        }
        let seen = Mat::from_fn(n_e, phi.nrows(), |e, i| self.see_u[(e, i)] * f(e).0 + self.see_v[(e, i)] * f(e).1);
        let mut g = &seen * &*phi;
        if tangents.iter().any(|t| t.1[step] != 0.0) {
            let own = &self.see_v * &self.kick;
            let matrix = Mat::from_fn(n_e, n_e, |a, b| {
                c64::new(f64::from(u8::from(a == b)), 0.0) - own[(a, b)] * (0.5 * h * f(a).1)
            });
            matrix.partial_piv_lu().solve_in_place(&mut g);
        }
        *phi += &self.kick * g * Scale(c64::new(h, 0.0));
    }
}

fn scale_rows(phi: &mut Mat<c64>, factors: &[c64]) {
    for j in 0..phi.ncols() {
        for (x, f) in phi.col_as_slice_mut(j).iter_mut().zip(factors) {
            *x *= f;
        }
    }
}

/// The states themselves, rates in units of w0 and time in units of 1/w0.
pub struct States {
    c: Mat<f64>,
    k: Mat<f64>,
    /// per tangent M^-1 p w^T by columns
    rank_one: Vec<Vec<f64>>,
}

impl States {
    /// From M^-1 C, M^-1 K, M^-1 P and W.
    pub fn new(c: Mat<f64>, k: Mat<f64>, push: &Mat<f64>, see: &Mat<f64>) -> States {
        let n = c.nrows();
        let outer = |e: usize| -> Vec<f64> {
            let entry = |at: usize| push[(at % n, e)] * see[(at / n, e)];
            (0..n * n).map(entry).collect()
        };
        States { c, k, rank_one: (0..see.ncols()).map(outer).collect() }
    }

    /// The motion over one period 2 pi / w0.
    pub fn product(&self, tangents: &Tangents, steps: usize, w0: f64) -> Mat<f64> {
        let n = self.c.nrows();
        let size = 2 * n;
        let h = std::f64::consts::TAU / steps as f64;
        let half = exponential(&(companion(&self.c, &self.k, w0) * Scale(0.5 * h)));
        let whole = by_columns(&(&half * &half));
        let half = by_columns(&half);
        let mut phi = half.clone();
        let mut next = vec![0.0; size * size];
        let (mut g_u, mut g_v) = (vec![0.0; n * n], vec![0.0; n * n]);
        let moving = tangents.iter().any(|t| t.1.iter().any(|f| *f != 0.0));
        for step in 0..steps {
            self.gather(tangents, step, h / (w0 * w0), |t| &t.0, &mut g_u);
            if moving {
                self.gather(tangents, step, h / w0, |t| &t.1, &mut g_v);
                kick_moving(n, &g_u, &g_v, &mut phi);
            } else {
                kick(n, &g_u, &mut phi);
            }
            let linear = if step + 1 < steps { &whole } else { &half };
            multiply(size, linear, &phi, &mut next);
            std::mem::swap(&mut phi, &mut next);
        }
        Mat::from_fn(size, size, |i, j| phi[j * size + i])
    }

    /// factor M^-1 sum_e p_e f_e w_e^T
    fn gather(
        &self,
        tangents: &Tangents,
        step: usize,
        factor: f64,
        part: impl Fn(&(Vec<f64>, Vec<f64>)) -> &Vec<f64>,
        out: &mut [f64],
    ) {
        out.fill(0.0);
        for (r, t) in self.rank_one.iter().zip(tangents) {
            let f = factor * part(t)[step];
            out.iter_mut().zip(r).for_each(|(o, r)| *o += f * r);
        }
    }
}

fn by_columns(a: &Mat<f64>) -> Vec<f64> {
    let n = a.nrows();
    (0..n * n).map(|at| a[(at % n, at / n)]).collect()
}

/// C = A B, all n x n by columns.
fn multiply(n: usize, a: &[f64], b: &[f64], c: &mut [f64]) {
    c.fill(0.0);
    for (b, c) in b.chunks_exact(n).zip(c.chunks_exact_mut(n)) {
        for (a, b) in a.chunks_exact(n).zip(b) {
            c.iter_mut().zip(a).for_each(|(c, a)| *c += a * b);
        }
    }
}

/// v -= G_u x in every column [x; v].
fn kick(n: usize, g_u: &[f64], phi: &mut [f64]) {
    for column in phi.chunks_exact_mut(2 * n) {
        let (x, v) = column.split_at_mut(n);
        for (g, x) in g_u.chunks_exact(n).zip(x) {
            v.iter_mut().zip(g).for_each(|(v, g)| *v -= g * *x);
        }
    }
}

/// v' = v - G_u x - G_v (v + v') / 2 in every column.
fn kick_moving(n: usize, g_u: &[f64], g_v: &[f64], phi: &mut [f64]) {
    let mut change = Mat::<f64>::zeros(n, 2 * n);
    for (j, column) in phi.chunks_exact(2 * n).enumerate() {
        let out = change.col_as_slice_mut(j);
        for (l, (gu, gv)) in g_u.chunks_exact(n).zip(g_v.chunks_exact(n)).enumerate() {
            let (x, v) = (column[l], column[n + l]);
            let entries = out.iter_mut().zip(gu.iter().zip(gv));
            entries.for_each(|(o, (gu, gv))| *o -= gu * x + gv * v);
        }
    }
    if n == 1 {
        let factor = 1.0 / (1.0 + 0.5 * g_v[0]);
        (0..2).for_each(|j| change[(0, j)] *= factor);
    } else {
        let one = |i: usize, j: usize| f64::from(u8::from(i == j));
        Mat::from_fn(n, n, |i, j| one(i, j) + 0.5 * g_v[j * n + i]).partial_piv_lu().solve_in_place(&mut change);
    }
    for (j, column) in phi.chunks_exact_mut(2 * n).enumerate() {
        let entries = column[n..].iter_mut().zip(change.col_as_slice(j));
        entries.for_each(|(v, d)| *v += d);
    }
}

/// d/dt [x; x'/w] in units of w: [[0, 1], [-K/w^2, -C/w]].
fn companion(c: &Mat<f64>, k: &Mat<f64>, w: f64) -> Mat<f64> {
    let n = c.nrows();
    Mat::from_fn(2 * n, 2 * n, |i, j| match (i < n, j < n) {
        (true, _) => f64::from(u8::from(j == i + n)),
        (false, true) => -k[(i - n, j)] / (w * w),
        (false, false) => -c[(i - n, j - n)] / w,
    })
}

/// exp(A) by Taylor's series on A / 2^k with norm below 1/4, squared back.
fn exponential(a: &Mat<f64>) -> Mat<f64> {
    let n = a.nrows();
    let norm = (0..n).map(|i| (0..n).map(|j| a[(i, j)].abs()).sum::<f64>()).fold(0.0, f64::max);
    let halvings = if norm > 0.25 { (norm / 0.25).log2().ceil() as i32 } else { 0 };
    let small = a * Scale(0.5_f64.powi(halvings));
    let mut sum = Mat::<f64>::identity(n, n);
    for order in (1..=11).rev() {
        let next = &small * &sum * Scale(1.0 / f64::from(order));
        sum = Mat::<f64>::identity(n, n) + next;
    }
    for _ in 0..halvings {
        sum = &sum * &sum;
    }
    sum
}
