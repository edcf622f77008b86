//! Complex numbers for eight frequencies at once, which a processor computes with at the same time.

/// Frequencies at once.
pub const LANES: usize = 8;

/// One number for each lane.
pub type Reals = [f64; LANES];

/// One complex number for each lane.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Lanes {
    pub re: Reals,
    pub im: Reals,
}

impl Lanes {
    pub const ZERO: Lanes = Lanes { re: [0.0; LANES], im: [0.0; LANES] };

    /// The same real number in all lanes.
    pub fn real(x: f64) -> Lanes {
        Lanes { re: [x; LANES], im: [0.0; LANES] }
    }

    /// S - w^2 M + i w D of one entry.
    #[inline(always)]
    pub fn dynamic([m, d, s]: [f64; 3], w: &Reals) -> Lanes {
        let mut z = Lanes::ZERO;
        for (l, w) in w.iter().enumerate() {
            z.re[l] = s - w * w * m;
            z.im[l] = w * d;
        }
        z
    }

    #[inline(always)]
    pub fn add(&mut self, a: &Lanes) {
        for l in 0..LANES {
            self.re[l] += a.re[l];
            self.im[l] += a.im[l];
        }
    }

    /// `self += x a`
    #[inline(always)]
    pub fn add_scaled(&mut self, x: f64, a: &Lanes) {
        for l in 0..LANES {
            self.re[l] += x * a.re[l];
            self.im[l] += x * a.im[l];
        }
    }

    /// `self -= a b`
    #[inline(always)]
    pub fn subtract(&mut self, a: &Lanes, b: &Lanes) {
        for l in 0..LANES {
            self.re[l] -= a.re[l] * b.re[l] - a.im[l] * b.im[l];
            self.im[l] -= a.re[l] * b.im[l] + a.im[l] * b.re[l];
        }
    }

    /// `self += a b`
    #[inline(always)]
    pub fn add_product(&mut self, a: &Lanes, b: &Lanes) {
        for l in 0..LANES {
            self.re[l] += a.re[l] * b.re[l] - a.im[l] * b.im[l];
            self.im[l] += a.re[l] * b.im[l] + a.im[l] * b.re[l];
        }
    }

    #[inline(always)]
    pub fn times(&self, b: &Lanes) -> Lanes {
        let mut out = Lanes::ZERO;
        for l in 0..LANES {
            out.re[l] = self.re[l] * b.re[l] - self.im[l] * b.im[l];
            out.im[l] = self.re[l] * b.im[l] + self.im[l] * b.re[l];
        }
        out
    }

    #[inline(always)]
    pub fn inverse(&self) -> Lanes {
        let mut out = Lanes::ZERO;
        for l in 0..LANES {
            let part = 1.0 / (self.re[l] * self.re[l] + self.im[l] * self.im[l]);
            out.re[l] = self.re[l] * part;
            out.im[l] = -self.im[l] * part;
        }
        out
    }

    /// |re| + |im|
    #[inline(always)]
    pub fn size(&self) -> Reals {
        let mut out = [0.0; LANES];
        for (l, out) in out.iter_mut().enumerate() {
            *out = self.re[l].abs() + self.im[l].abs();
        }
        out
    }
}

/// Sums of squares.
pub fn squares(x: &[Lanes]) -> Reals {
    let mut out = [0.0; LANES];
    x.iter().for_each(|x| add_square(&mut out, x));
    out
}

#[inline(always)]
pub fn add_square(sum: &mut Reals, x: &Lanes) {
    for (l, sum) in sum.iter_mut().enumerate() {
        *sum += x.re[l] * x.re[l] + x.im[l] * x.im[l];
    }
}
