//! Sums of products in about 32 digits: what a residual needs when its terms cancel to the last digit.
//!
//! Error-free transformations of Knuth (sum) and Dekker (product). Written without a fused multiply-add, which the baseline
//! x86-64 target would turn into a library call, so that the loops over columns stay vectorisable.

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

/// `out += A x` for one column-major matrix and one vector, every sum in double-double.
pub fn add_product(out: &mut [Dd], a: faer::MatRef<'_, f64>, x: impl Fn(usize) -> f64) {
    for j in 0..a.ncols() {
        let xj = x(j);
        if xj == 0.0 {
            continue;
        }
        for (i, sum) in out.iter_mut().enumerate() {
            sum.add_product(a[(i, j)], xj);
        }
    }
}

/// A x, or A^T x where `transposed`, of a double matrix and a vector in double-double; all sums in double-double.
pub fn matrix_times(a: faer::MatRef<'_, f64>, x: &[Dd], transposed: bool) -> Vec<Dd> {
    let a = if transposed { a.transpose() } else { a };
    let mut out = vec![Dd::default(); a.nrows()];
    add_product(&mut out, a, |j| x[j].hi);
    for (j, x) in x.iter().enumerate().filter(|(_, x)| x.lo != 0.0) {
        for (i, sum) in out.iter_mut().enumerate() {
            sum.lo += a[(i, j)] * x.lo;
        }
    }
    out.into_iter().map(Dd::normalised).collect()
}

/// sum_i a_i b_i of normalised numbers.
pub fn dot(a: &[Dd], b: &[Dd]) -> Dd {
    a.iter().zip(b).fold(Dd::default(), |sum, (a, b)| sum.plus(a.times(*b)))
}

#[cfg(test)]
mod tests {
    use super::*;

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
