//! Sums of products in about 32 digits: what a residual needs when its terms cancel to the last digit.
//!
//! Error-free transformations of Knuth (sum) and Dekker (product). Written without a fused multiply-add, which the baseline
//! x86-64 target would turn into a library call, so that the loops over columns stay vectorisable.
use faer::{Col, MatRef};

use super::widest::widest;

/// An unevaluated sum `hi + lo`.
#[derive(Debug, Clone, Copy, Default)]
pub struct Dd {
    pub hi: f64,
    pub lo: f64,
}

#[inline(always)]
fn two_sum(a: f64, b: f64) -> (f64, f64) {
    let s = a + b;
    let t = s - a;
    (s, (a - (s - t)) + (b - t))
}

#[inline(always)]
fn split(a: f64) -> (f64, f64) {
    const SPLITTER: f64 = 134_217_729.0; // 2^27 + 1
    let t = SPLITTER * a;
    let hi = t - (t - a);
    (hi, a - hi)
}

#[inline(always)]
fn two_prod(a: f64, b: f64) -> (f64, f64) {
    let p = a * b;
    let (ah, al) = split(a);
    let (bh, bl) = split(b);
    (p, ((ah * bh - p) + ah * bl + al * bh) + al * bl)
}

impl Dd {
    pub fn new(hi: f64) -> Self {
        Dd { hi, lo: 0.0 }
    }

    #[inline(always)]
    pub fn add_product(&mut self, a: f64, b: f64) {
        let (p, e) = two_prod(a, b);
        let (s, f) = two_sum(self.hi, p);
        self.hi = s;
        self.lo += e + f;
    }

    #[inline(always)]
    pub fn add(&mut self, x: f64) {
        let (s, f) = two_sum(self.hi, x);
        self.hi = s;
        self.lo += f;
    }

    /// The same value with |lo| below half a unit in the last place of hi, as `times` needs it.
    pub fn normalised(self) -> Self {
        let (hi, lo) = two_sum(self.hi, self.lo);
        Dd { hi, lo }
    }

    pub fn product(a: f64, b: f64) -> Self {
        let (hi, lo) = two_prod(a, b);
        Dd { hi, lo }
    }

    pub fn plus(self, other: Dd) -> Self {
        let (s, e) = two_sum(self.hi, other.hi);
        let (hi, lo) = two_sum(s, e + self.lo + other.lo);
        Dd { hi, lo }
    }

    pub fn times(self, other: Dd) -> Self {
        let (p, e) = two_prod(self.hi, other.hi);
        let (hi, lo) = two_sum(p, e + self.hi * other.lo + self.lo * other.hi);
        Dd { hi, lo }
    }

    pub fn minus(self, other: Dd) -> Self {
        self.plus(Dd { hi: -other.hi, lo: -other.lo })
    }

    pub fn value(self) -> f64 {
        self.hi + self.lo
    }
}

/// Sums of many numbers side by side, their leading and trailing parts apart, so that loops over them fill the lanes of a processor.
#[derive(Debug, Clone)]
pub struct Sums {
    pub hi: Vec<f64>,
    pub lo: Vec<f64>,
}

impl Sums {
    pub fn zeros(n: usize) -> Self {
        Sums { hi: vec![0.0; n], lo: vec![0.0; n] }
    }

    /// `sums += A x`.
    pub fn add_product(&mut self, a: MatRef<'_, f64>, x: impl Fn(usize) -> f64) {
        for j in (0..a.ncols()).filter(|&j| x(j) != 0.0) {
            match a.col(j).try_as_col_major() {
                Some(column) => {
                    let a = column.as_slice();
                    widest!(|_| add_scaled(&mut self.hi, &mut self.lo, a, x(j)))
                }
                None => {
                    for i in 0..a.nrows() {
                        let mut sum = Dd { hi: self.hi[i], lo: self.lo[i] };
                        sum.add_product(a[(i, j)], x(j));
                        (self.hi[i], self.lo[i]) = (sum.hi, sum.lo);
                    }
                }
            }
        }
    }

    /// A^T x.
    fn inner_products(a: MatRef<'_, f64>, x: &[f64]) -> Self {
        let mut sums = Sums::zeros(a.ncols());
        for j in 0..a.ncols() {
            let copied: Vec<f64>;
            let column = match a.col(j).try_as_col_major() {
                Some(column) => column.as_slice(),
                None => {
                    copied = a.col(j).iter().copied().collect();
                    &copied
                }
            };
            let sum = widest!(|_| inner_product(column, x));
            (sums.hi[j], sums.lo[j]) = (sum.hi, sum.lo);
        }
        sums
    }

    pub fn get(&self, i: usize) -> Dd {
        Dd { hi: self.hi[i], lo: self.lo[i] }.normalised()
    }
}

/// `hi + lo += x a`; every processor gives the same bits.
#[inline(always)]
fn add_scaled(hi: &mut [f64], lo: &mut [f64], a: &[f64], x: f64) {
    for ((hi, lo), &a) in hi.iter_mut().zip(lo.iter_mut()).zip(a) {
        let mut sum = Dd { hi: *hi, lo: *lo };
        sum.add_product(a, x);
        (*hi, *lo) = (sum.hi, sum.lo);
    }
}

/// Numbers that the sums of one product are spread over.
const LANES: usize = 8;

/// a^T x with the sums of `LANES` interleaved parts, added up at the end; every processor gives the same bits.
#[inline(always)]
fn inner_product(a: &[f64], x: &[f64]) -> Dd {
    let (mut hi, mut lo) = ([0.0; LANES], [0.0; LANES]);
    let (whole, parts) = (a.chunks_exact(LANES), x.chunks_exact(LANES));
    let rest = whole.remainder().iter().zip(parts.remainder());
    for (a, x) in whole.zip(parts) {
        for l in 0..LANES {
            let mut sum = Dd { hi: hi[l], lo: lo[l] };
            sum.add_product(a[l], x[l]);
            (hi[l], lo[l]) = (sum.hi, sum.lo);
        }
    }
    let mut total = (0..LANES).fold(Dd::default(), |sum, l| sum.plus(Dd { hi: hi[l], lo: lo[l] }));
    rest.for_each(|(a, x)| total.add_product(*a, *x));
    total
}

/// A x, or A^T x where `transposed`, of a double matrix and a vector in double-double; all sums in double-double.
pub fn matrix_times(a: MatRef<'_, f64>, x: &[Dd], transposed: bool) -> Vec<Dd> {
    let leading: Vec<f64> = x.iter().map(|x| x.hi).collect();
    let mut sums = if transposed {
        Sums::inner_products(a, &leading)
    } else {
        let mut sums = Sums::zeros(a.nrows());
        sums.add_product(a, |j| leading[j]);
        sums
    };
    if x.iter().any(|x| x.lo != 0.0) {
        let trailing = Col::from_fn(x.len(), |j| x[j].lo);
        let small = if transposed { a.transpose() * trailing } else { a * trailing };
        sums.lo.iter_mut().zip(small.iter()).for_each(|(lo, small)| *lo += small);
    }
    (0..sums.hi.len()).map(|i| sums.get(i)).collect()
}

/// sum_i a_i b_i of normalised numbers.
pub fn dot(a: &[Dd], b: &[Dd]) -> Dd {
    a.iter().zip(b).fold(Dd::default(), |sum, (a, b)| sum.plus(a.times(*b)))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Terms of both signs over twenty decades, whose sum is small: against exact sums of integers.
    #[test]
    fn products_of_matrices_keep_their_digits() {
        for (rows, columns) in [(1, 1), (3, 7), (13, 21), (40, 19)] {
            let entry = |i: usize, j: usize| ((i * 7919 + j * 104_729) % 8_388_593) as f64 - 4_194_300.0;
            let a = faer::Mat::from_fn(rows, columns, |i, j| entry(i, j) * 1e9 + entry(j, i));
            for transposed in [false, true] {
                let n = if transposed { rows } else { columns };
                let x: Vec<Dd> = (0..n).map(|j| Dd { hi: entry(j, 5) * 1e7, lo: entry(5, j) * 1e-9 }).collect();
                let found = matrix_times(a.as_ref(), &x, transposed);
                for (i, found) in found.iter().enumerate() {
                    let a = |j: usize| if transposed { a[(j, i)] } else { a[(i, j)] };
                    let exact: i128 = (0..n).map(|j| (a(j) as i128) * (x[j].hi as i128)).sum();
                    let small: f64 = (0..n).map(|j| a(j) * x[j].lo).sum();
                    let size: f64 = (0..n).map(|j| (a(j) * x[j].hi).abs()).sum();
                    let error = (found.hi as i128 - exact) as f64 + found.lo - small;
                    assert!(error.abs() <= 1e-30 * size * n as f64 + 1e-15 * small.abs() + 1e-22 * size, "{error:e}");
                }
            }
        }
    }

    #[test]
    fn cancelling_terms_keep_their_digits() {
        let mut s = Dd::default();
        s.add_product(1e16, 1.0 + f64::EPSILON);
        s.add_product(-1e16, 1.0);
        s.add_product(3.0, 1.0 / 3.0);
        let expected = 1e16 * f64::EPSILON + 1.0; // 3 * fl(1/3) = 1 - 2^-54, below the last digit of the sum
        assert!((s.value() - expected).abs() <= 1e-15);
    }
}
