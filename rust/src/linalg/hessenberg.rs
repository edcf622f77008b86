//! C (s I - A)^-1 B for many s: A goes to Hessenberg form once, then each s costs O(N^2).
//!
//! One sweep per s: row k of U is final as soon as row k + 1 is eliminated, so the output map is solved against it at once and only
//! two rows are ever held. The two rows stay in cache and the loops over them are contiguous in real and imaginary parts.
use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::evd::hessenberg::{hessenberg_in_place, hessenberg_in_place_scratch};
use faer::linalg::householder;
use faer::{Conj, Mat, MatMut, MatRef, Par, c64};

use super::widest::widest;

pub struct Hessenberg {
    n: usize,
    /// row-major upper Hessenberg matrix
    h: Vec<f64>,
    q: Mat<f64>,
    norm: f64,
}

/// Rows of complex numbers with real and imaginary parts apart.
struct Rows {
    n: usize,
    re: Vec<f64>,
    im: Vec<f64>,
}

impl Rows {
    fn new(rows: usize, n: usize) -> Self {
        Rows { n, re: vec![0.0; rows * n], im: vec![0.0; rows * n] }
    }
}

/// y -= a x on split complex vectors.
#[inline(always)]
fn subtract(y_re: &mut [f64], y_im: &mut [f64], a: c64, x_re: &[f64], x_im: &[f64], fused: bool) {
    let len = y_re.len();
    let (y_im, x_re, x_im) = (&mut y_im[..len], &x_re[..len], &x_im[..len]);
    for i in 0..len {
        if fused {
            y_re[i] = (-a.re).mul_add(x_re[i], a.im.mul_add(x_im[i], y_re[i]));
            y_im[i] = (-a.re).mul_add(x_im[i], (-a.im).mul_add(x_re[i], y_im[i]));
        } else {
            y_re[i] -= a.re * x_re[i] - a.im * x_im[i];
            y_im[i] -= a.re * x_im[i] + a.im * x_re[i];
        }
    }
}

impl Hessenberg {
    pub fn new(a: MatRef<'_, f64>) -> Self {
        let n = a.nrows();
        let mut v = a.to_owned();
        let mut q = Mat::<f64>::identity(n, n);
        if n > 2 {
            let block = faer::linalg::qr::no_pivoting::factor::recommended_block_size::<f64>(n - 1, n - 1);
            let mut taus = Mat::<f64>::zeros(block, n - 1);
            let mut memory =
                MemBuffer::new(hessenberg_in_place_scratch::<f64>(n, block, Par::Seq, Default::default()).or(
                    householder::apply_block_householder_sequence_on_the_right_in_place_scratch::<f64>(n - 1, block, n),
                ));
            hessenberg_in_place(v.as_mut(), taus.as_mut(), Par::Seq, MemStack::new(&mut memory), Default::default());
            accumulate(v.as_ref(), taus.as_ref(), q.as_mut(), &mut memory);
        }
        let mut h = vec![0.0; n * n];
        for i in 0..n {
            for j in i.saturating_sub(1)..n {
                h[i * n + j] = v[(i, j)];
            }
        }
        Hessenberg { n, h, q, norm: a.norm_l2() }
    }

    /// Q^T B, once per input map.
    pub fn inputs(&self, b: MatRef<'_, f64>) -> Mat<f64> {
        self.q.transpose() * b
    }

    /// C Q, once per output map.
    pub fn outputs(&self, c: MatRef<'_, f64>) -> Mat<f64> {
        c * &self.q
    }

    /// C (s I - A)^-1 B from `cq` = C Q and `qb` = Q^T B. None where s is an eigenvalue to working precision.
    pub fn transfer(&self, s: c64, cq: MatRef<'_, f64>, qb: MatRef<'_, f64>) -> Option<Mat<c64>> {
        widest!(|fused| self.sweep(s, cq, qb, fused))
    }

    #[inline(always)]
    fn sweep(&self, s: c64, cq: MatRef<'_, f64>, qb: MatRef<'_, f64>, fused: bool) -> Option<Mat<c64>> {
        let (n, n_out, n_in) = (self.n, cq.nrows(), qb.ncols());
        let tiny = f64::EPSILON * (self.norm + s.norm());
        let mut c = Rows::new(n_out, n);
        for o in 0..n_out {
            for i in 0..n {
                c.re[o * n + i] = cq[(o, i)];
            }
        }
        let mut b: Vec<c64> = (0..n_in).map(|k| c64::new(qb[(0, k)], 0.0)).collect();
        let mut out = Mat::<c64>::zeros(n_out, n_in);
        let (mut row_re, mut row_im) = (vec![0.0; n], vec![0.0; n]);
        let (mut next_re, mut next_im) = (vec![0.0; n], vec![0.0; n]);
        self.shifted_row(0, s, &mut row_re, &mut row_im);
        for k in 0..n {
            let mut b_next: Vec<c64> = Vec::new();
            if k + 1 < n {
                self.shifted_row(k + 1, s, &mut next_re, &mut next_im);
                b_next = (0..n_in).map(|j| c64::new(qb[(k + 1, j)], 0.0)).collect();
                let (top, low) = (c64::new(row_re[k], row_im[k]), c64::new(next_re[k], next_im[k]));
                if low.norm_sqr() > top.norm_sqr() {
                    std::mem::swap(&mut row_re, &mut next_re);
                    std::mem::swap(&mut row_im, &mut next_im);
                    std::mem::swap(&mut b, &mut b_next);
                }
            }
            let pivot = c64::new(row_re[k], row_im[k]);
            if pivot.norm().is_nan() || pivot.norm() <= tiny {
                return None;
            }
            if k + 1 < n {
                let factor = c64::new(next_re[k], next_im[k]) / pivot;
                subtract(
                    &mut next_re[k + 1..],
                    &mut next_im[k + 1..],
                    factor,
                    &row_re[k + 1..],
                    &row_im[k + 1..],
                    fused,
                );
                for (low, top) in b_next.iter_mut().zip(&b) {
                    *low -= factor * top;
                }
            }
            for o in 0..n_out {
                let at = o * c.n + k;
                let y = c64::new(c.re[at], c.im[at]) / pivot;
                let end = (o + 1) * c.n;
                subtract(&mut c.re[at + 1..end], &mut c.im[at + 1..end], y, &row_re[k + 1..], &row_im[k + 1..], fused);
                for (j, value) in b.iter().enumerate() {
                    out[(o, j)] += y * value;
                }
            }
            std::mem::swap(&mut row_re, &mut next_re);
            std::mem::swap(&mut row_im, &mut next_im);
            b = b_next;
        }
        Some(out)
    }

    /// Row i of s I - H.
    fn shifted_row(&self, i: usize, s: c64, re: &mut [f64], im: &mut [f64]) {
        let start = i.saturating_sub(1);
        for (value, h) in re[start..].iter_mut().zip(&self.h[i * self.n + start..(i + 1) * self.n]) {
            *value = -h;
        }
        im[start..].fill(0.0);
        re[i] += s.re;
        im[i] += s.im;
    }
}

fn accumulate(v: MatRef<'_, f64>, taus: MatRef<'_, f64>, q: MatMut<'_, f64>, memory: &mut MemBuffer) {
    let n = v.nrows();
    householder::apply_block_householder_sequence_on_the_right_in_place_with_conj(
        v.submatrix(1, 0, n - 1, n - 1),
        taus,
        Conj::No,
        q.submatrix_mut(1, 1, n - 1, n - 1),
        Par::Seq,
        MemStack::new(memory),
    );
}

#[cfg(test)]
mod tests {
    use super::*;
    use faer::prelude::*;

    #[test]
    fn equals_a_direct_solve() {
        for n in [1, 2, 3, 7, 40] {
            let a = Mat::from_fn(n, n, |i, j| ((7 * i + 3 * j) as f64).sin());
            let b = Mat::from_fn(n, 2, |i, j| ((i + 2 * j) as f64).cos());
            let c = Mat::from_fn(3, n, |i, j| ((i * 5 + j) as f64 + 0.3).sin());
            let h = Hessenberg::new(a.as_ref());
            let s = c64::new(0.1, 1.7);
            let value = h.transfer(s, h.outputs(c.as_ref()).as_ref(), h.inputs(b.as_ref()).as_ref()).unwrap();
            let z = Mat::from_fn(n, n, |i, j| if i == j { s } else { c64::new(0.0, 0.0) } - a[(i, j)]);
            let x = z.partial_piv_lu().solve(Mat::from_fn(n, 2, |i, j| c64::new(b[(i, j)], 0.0)));
            let expected = Mat::from_fn(3, n, |i, j| c64::new(c[(i, j)], 0.0)) * x;
            assert!((&value - &expected).norm_l2() <= 1e-12 * expected.norm_l2(), "n = {n}");
        }
    }
}
