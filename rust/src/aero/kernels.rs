//! How a vortex core bounds the velocity beside a straight filament.
//!
//! ```text
//! v = Gamma / (4 pi) (r1 x r2) (R1 + R2) / (R1 R2 (R1 R2 + r1.r2)) K(h),   h = |r1 x r2| / |r1 - r2|
//! ```
//! r1, r2 lead from the ends of the filament to the point. Near the filament, where R1 R2 + r1.r2 cancels, the same is written with
//! (R1 R2 - r1.r2) / |r1 x r2|^2, and K(h) / h^2 is bounded.

/// Points that are computed side by side; a point's bits do not depend on its neighbours.
pub const LANES: usize = 8;
pub type Lanes = [f64; LANES];

/// A model of the core of radius rc.
pub trait Kernel: Copy + Send + Sync {
    /// What is added to the squares of the distances from the ends, and to their scalar product.
    fn smoothing(self, rc2: f64) -> f64;
    /// K(h) from h^2.
    fn factor(self, h2: f64, rc2: f64) -> f64;
    /// K(h) / h^2, also where h is zero; zero there without a core.
    fn factor_over(self, h2: f64, rc2: f64) -> f64;
}

/// The kernel 1 / (r^2 + rc^2)^(3/2), integrated exactly along the filament (Rosenhead 1930, Moore 1972).
#[derive(Debug, Clone, Copy)]
pub struct RosenheadMoore;

/// K = 1 - exp(-a h^2 / rc^2), a such that the velocity is largest at rc (Lamb 1932, Oseen 1912).
#[derive(Debug, Clone, Copy)]
pub struct LambOseen;

/// K = h^2 / (h^2n + rc^2n)^(1/n) (Vatistas, Kozel and Mih 1991); n = 1 is Scully's.
#[derive(Debug, Clone, Copy)]
pub struct Vatistas(pub f64);

/// The root of exp(a) = 1 + 2 a beside zero: Lamb and Oseen's swirl is largest at h = rc.
const LAMB_OSEEN: f64 = 1.256_431_208_626_169_7;

fn inverse(x: f64) -> f64 {
    if x > 0.0 { 1.0 / x } else { 0.0 }
}

impl Kernel for RosenheadMoore {
    fn smoothing(self, rc2: f64) -> f64 {
        rc2
    }
    fn factor(self, _: f64, _: f64) -> f64 {
        1.0
    }
    fn factor_over(self, h2: f64, rc2: f64) -> f64 {
        inverse(h2 + rc2)
    }
}

impl Kernel for LambOseen {
    fn smoothing(self, _: f64) -> f64 {
        0.0
    }
    fn factor(self, h2: f64, rc2: f64) -> f64 {
        if rc2 > 0.0 { -(-LAMB_OSEEN * h2 / rc2).exp_m1() } else { 1.0 }
    }
    fn factor_over(self, h2: f64, rc2: f64) -> f64 {
        if h2 > 0.0 { self.factor(h2, rc2) / h2 } else { LAMB_OSEEN * inverse(rc2) }
    }
}

impl Kernel for Vatistas {
    fn smoothing(self, _: f64) -> f64 {
        0.0
    }
    fn factor(self, h2: f64, rc2: f64) -> f64 {
        h2 * self.factor_over(h2, rc2)
    }
    fn factor_over(self, h2: f64, rc2: f64) -> f64 {
        let n = self.0;
        if n == 1.0 {
            inverse(h2 + rc2)
        } else if n == 2.0 {
            inverse((h2 * h2 + rc2 * rc2).sqrt())
        } else {
            let large = h2.max(rc2);
            let small = h2.min(rc2) * inverse(large);
            inverse(large * (1.0 + small.powf(n)).powf(1.0 / n))
        }
    }
}

/// One straight filament.
#[derive(Debug, Clone, Copy)]
pub struct Segment {
    pub start: [f64; 3],
    pub end: [f64; 3],
    /// Square of its length.
    pub length2: f64,
    /// Circulation over 4 pi.
    pub strength: f64,
    /// Square of the radius of its core.
    pub core2: f64,
}

/// Adds what one filament induces at some points to their velocities.
#[inline(always)]
pub fn add<K: Kernel>(kernel: K, s: &Segment, p: &[Lanes; 3], v: &mut [Lanes; 3]) {
    let smooth = kernel.smoothing(s.core2);
    for i in 0..LANES {
        let (x, y, z) = (p[0][i] - s.start[0], p[1][i] - s.start[1], p[2][i] - s.start[2]);
        let (u, t, w) = (p[0][i] - s.end[0], p[1][i] - s.end[1], p[2][i] - s.end[2]);
        let (lx, ly, lz) = (s.end[0] - s.start[0], s.end[1] - s.start[1], s.end[2] - s.start[2]);
        // l x r1 = r1 x r2: without the cancellation of the latter far away
        let (cx, cy, cz) = (ly * z - lz * y, lz * x - lx * z, lx * y - ly * x);
        let square = cx * cx + cy * cy + cz * cz;
        let one = (x * x + y * y + z * z + smooth).sqrt();
        let two = (u * u + t * t + w * w + smooth).sqrt();
        let product = one * two;
        let dot = x * u + y * t + z * w + smooth;
        let h2 = square / s.length2;
        let near = (product - dot) / s.length2 * kernel.factor_over(h2, s.core2);
        let far = kernel.factor(h2, s.core2) / (product + dot);
        let shape = if dot < 0.0 { near } else { far };
        let f = if product > 0.0 && square > 0.0 { s.strength * (one + two) / product * shape } else { 0.0 };
        v[0][i] += f * cx;
        v[1][i] += f * cy;
        v[2][i] += f * cz;
    }
}
