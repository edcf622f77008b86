//! Three-dimensional kinematics over any number type: rotations, twists and wrenches, 6 x 6 maps between them.
//!
//! Everything is generic over `Real`, so that one text serves values (`f64`) and exact derivatives (dual numbers). Twists and
//! wrenches are `Six`: the translation part first, taken at a point that the caller names.
use std::f64::consts::FRAC_PI_2;

use nalgebra::{Matrix3, Vector3};
use num_dual::DualNum;

/// Numbers that the assembly works on: f64, and dual numbers over it.
pub trait Real: DualNum<Primitive = f64> + Copy + Send + Sync {}
impl<T: DualNum<Primitive = f64> + Copy + Send + Sync> Real for T {}

pub type V3<T> = Vector3<T>;
pub type M3<T> = Matrix3<T>;

/// Is it zero with all its derivatives? Work on such numbers may be left out. A dual number's own `is_zero` looks at the value
/// alone, so with duals nothing is left out.
pub fn absent<T: Real>(x: &T) -> bool {
    T::NDERIV == 0 && x.is_zero()
}

/// The angle of the direction (x, y). That of dual numbers goes over y / x, whose derivatives are not finite where x is zero.
#[inline(never)]
pub fn arctan2<T: Real>(y: T, x: T) -> T {
    if x.re().abs() < f64::EPSILON * y.re().abs() {
        return T::from(FRAC_PI_2.copysign(y.re())) - (x / y).atan();
    }
    y.atan2(x)
}

pub fn lift<T: Real>(x: f64) -> T {
    T::from(x)
}

pub fn lift3<T: Real>(v: &V3<f64>) -> V3<T> {
    v.map(T::from)
}

pub fn lift33<T: Real>(m: &M3<f64>) -> M3<T> {
    m.map(T::from)
}

pub fn real3<T: Real>(v: &V3<T>) -> V3<f64> {
    v.map(|x| x.re())
}

pub fn real33<T: Real>(m: &M3<T>) -> M3<f64> {
    m.map(|x| x.re())
}

/// The cross-product matrix: skew(a) b = a x b.
pub fn skew<T: Real>(a: &V3<T>) -> M3<T> {
    let o = T::zero();
    M3::new(o, -a.z, a.y, a.z, o, -a.x, -a.y, a.x, o)
}

/// r a, written out: general products of matrices are slow for numbers with derivatives.
#[inline]
pub fn turned<T: Real>(r: &M3<T>, a: &V3<T>) -> V3<T> {
    let row = |i: usize| r[(i, 0)] * a[0] + r[(i, 1)] * a[1] + r[(i, 2)] * a[2];
    V3::new(row(0), row(1), row(2))
}

/// r^T a.
#[inline]
pub fn turned_back<T: Real>(r: &M3<T>, a: &V3<T>) -> V3<T> {
    let column = |j: usize| r[(0, j)] * a[0] + r[(1, j)] * a[1] + r[(2, j)] * a[2];
    V3::new(column(0), column(1), column(2))
}

/// a b.
#[inline]
pub fn product<T: Real>(a: &M3<T>, b: &M3<T>) -> M3<T> {
    M3::from_fn(|i, j| a[(i, 0)] * b[(0, j)] + a[(i, 1)] * b[(1, j)] + a[(i, 2)] * b[(2, j)])
}

/// a^T b.
#[inline]
pub fn product_of_transpose<T: Real>(a: &M3<T>, b: &M3<T>) -> M3<T> {
    M3::from_fn(|i, j| a[(0, i)] * b[(0, j)] + a[(1, i)] * b[(1, j)] + a[(2, i)] * b[(2, j)])
}

/// r m r^T.
#[inline]
pub fn conjugated<T: Real>(r: &M3<T>, m: &M3<T>) -> M3<T> {
    let half = product(r, m);
    M3::from_fn(|i, j| half[(i, 0)] * r[(j, 0)] + half[(i, 1)] * r[(j, 1)] + half[(i, 2)] * r[(j, 2)])
}

pub fn outer<T: Real>(a: &V3<T>, b: &V3<T>) -> M3<T> {
    a * b.transpose()
}

/// A twist (velocity or small motion) or a wrench: translation or force `l`, rotation or moment `a`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Six<T: Real> {
    pub l: V3<T>,
    pub a: V3<T>,
}

impl<T: Real> Six<T> {
    pub fn new(l: V3<T>, a: V3<T>) -> Self {
        Six { l, a }
    }

    pub fn zero() -> Self {
        Six { l: V3::zeros(), a: V3::zeros() }
    }

    /// Power or virtual work of a twist with a wrench at the same point.
    pub fn dot(&self, other: &Self) -> T {
        self.l.dot(&other.l) + self.a.dot(&other.a)
    }

    /// The same rigid motion at a point displaced by `d` from this one's.
    pub fn motion_at(&self, d: &V3<T>) -> Self {
        Six { l: self.l + self.a.cross(d), a: self.a }
    }

    /// The same wrench about a point displaced by `d` from this one's.
    pub fn wrench_at(&self, d: &V3<T>) -> Self {
        Six { l: self.l, a: self.a - d.cross(&self.l) }
    }

    /// v x m: how the rigid motion `m` changes when it is carried along by the rigid motion v.
    pub fn cross_motion(&self, m: &Self) -> Self {
        Six { l: self.a.cross(&m.l) + self.l.cross(&m.a), a: self.a.cross(&m.a) }
    }

    /// v x* w: how the wrench `w` about a fixed point changes when it is carried along by the rigid motion v.
    pub fn cross_force(&self, w: &Self) -> Self {
        Six { l: self.a.cross(&w.l), a: self.a.cross(&w.a) + self.l.cross(&w.l) }
    }

    pub fn rotated(&self, r: &M3<T>) -> Self {
        Six { l: turned(r, &self.l), a: turned(r, &self.a) }
    }

    pub fn rotated_back(&self, r: &M3<T>) -> Self {
        Six { l: turned_back(r, &self.l), a: turned_back(r, &self.a) }
    }

    pub fn scaled(&self, s: T) -> Self {
        Six { l: self.l * s, a: self.a * s }
    }

    pub fn is_absent(&self) -> bool {
        self.l.iter().chain(self.a.iter()).all(absent)
    }

    pub fn get(&self, i: usize) -> T {
        if i < 3 { self.l[i] } else { self.a[i - 3] }
    }
}

impl<T: Real> std::ops::Add for Six<T> {
    type Output = Self;
    fn add(self, o: Self) -> Self {
        Six { l: self.l + o.l, a: self.a + o.a }
    }
}

impl<T: Real> std::ops::Sub for Six<T> {
    type Output = Self;
    fn sub(self, o: Self) -> Self {
        Six { l: self.l - o.l, a: self.a - o.a }
    }
}

impl<T: Real> std::ops::Neg for Six<T> {
    type Output = Self;
    fn neg(self) -> Self {
        Six { l: -self.l, a: -self.a }
    }
}

impl<T: Real> std::ops::AddAssign for Six<T> {
    fn add_assign(&mut self, o: Self) {
        self.l += o.l;
        self.a += o.a;
    }
}

/// A linear map from twists to wrenches (a stiffness, a damping, an inertia) in 3 x 3 blocks.
#[derive(Debug, Clone, Copy)]
pub struct Map6<T: Real> {
    pub ll: M3<T>,
    pub la: M3<T>,
    pub al: M3<T>,
    pub aa: M3<T>,
}

impl<T: Real> Map6<T> {
    pub fn zero() -> Self {
        let o = M3::zeros();
        Map6 { ll: o, la: o, al: o, aa: o }
    }

    pub fn apply(&self, m: &Six<T>) -> Six<T> {
        Six { l: turned(&self.ll, &m.l) + turned(&self.la, &m.a), a: turned(&self.al, &m.l) + turned(&self.aa, &m.a) }
    }

    pub fn apply_transposed(&self, m: &Six<T>) -> Six<T> {
        Six {
            l: turned_back(&self.ll, &m.l) + turned_back(&self.al, &m.a),
            a: turned_back(&self.la, &m.l) + turned_back(&self.aa, &m.a),
        }
    }

    /// The sum of `s` a b^T.
    pub fn add_outer(&mut self, a: &Six<T>, b: &Six<T>, s: T) {
        let (al, aa) = (a.l * s, a.a * s);
        self.ll += outer(&al, &b.l);
        self.la += outer(&al, &b.a);
        self.al += outer(&aa, &b.l);
        self.aa += outer(&aa, &b.a);
    }

    pub fn add(&mut self, o: &Self) {
        self.ll += o.ll;
        self.la += o.la;
        self.al += o.al;
        self.aa += o.aa;
    }

    pub fn rotated(&self, r: &M3<T>) -> Self {
        Map6 {
            ll: conjugated(r, &self.ll),
            la: conjugated(r, &self.la),
            al: conjugated(r, &self.al),
            aa: conjugated(r, &self.aa),
        }
    }

    /// The same map for twists and wrenches at a point displaced by `d` from this one's: X^T (.) X.
    pub fn at(&self, d: &V3<T>) -> Self {
        // motion here = motion there displaced by -d: l = l' - a' x d = l' + skew(d) a'
        let s = skew(d);
        let la = self.la + product(&self.ll, &s);
        let aa = self.aa + product(&self.al, &s);
        Map6 { ll: self.ll, la, al: self.al - product(&s, &self.ll), aa: aa - product(&s, &la) }
    }
}

/// Position and orientation of one frame in another.
#[derive(Debug, Clone, Copy)]
pub struct Pose<T: Real> {
    pub p: V3<T>,
    pub r: M3<T>,
}

impl<T: Real> Pose<T> {
    pub fn identity() -> Self {
        Pose { p: V3::zeros(), r: M3::identity() }
    }

    pub fn then(&self, inner: &Self) -> Self {
        Pose { p: self.p + turned(&self.r, &inner.p), r: product(&self.r, &inner.r) }
    }

    pub fn inverse(&self) -> Self {
        let t = self.r.transpose();
        Pose { p: -turned(&t, &self.p), r: t }
    }

    pub fn lifted<U: Real>(pose: &Pose<f64>) -> Pose<U> {
        Pose { p: lift3(&pose.p), r: lift33(&pose.r) }
    }

    pub fn real(&self) -> Pose<f64> {
        Pose { p: real3(&self.p), r: real33(&self.r) }
    }
}

/// Rotation matrix of a scalar-first quaternion of any positive length.
pub fn rotation_of_quaternion<T: Real>(q: &[T]) -> M3<T> {
    let [w, x, y, z] = [q[0], q[1], q[2], q[3]];
    let s = T::from(2.0) / (w * w + x * x + y * y + z * z);
    let one = T::one();
    M3::new(
        one - s * (y * y + z * z),
        s * (x * y - w * z),
        s * (x * z + w * y),
        s * (x * y + w * z),
        one - s * (x * x + z * z),
        s * (y * z - w * x),
        s * (x * z - w * y),
        s * (y * z + w * x),
        one - s * (x * x + y * y),
    )
}

/// Scalar-first unit quaternion of a rotation matrix, with a non-negative scalar part (Shepperd's choice of the largest divisor).
pub fn quaternion_of_rotation<T: Real>(r: &M3<T>) -> [T; 4] {
    let (a, b, c) = (r[(0, 0)], r[(1, 1)], r[(2, 2)]);
    let one = T::one();
    let four = [one + a + b + c, one + a - b - c, one - a + b - c, one - a - b + c];
    let mut k = 0;
    for i in 1..4 {
        if four[i].re() > four[k].re() {
            k = i;
        }
    }
    let root = four[k].sqrt();
    let half = root * 0.5;
    let s = T::from(0.5) / root;
    let (x, y, z) = (r[(2, 1)] - r[(1, 2)], r[(0, 2)] - r[(2, 0)], r[(1, 0)] - r[(0, 1)]);
    let (xy, xz, yz) = (r[(0, 1)] + r[(1, 0)], r[(0, 2)] + r[(2, 0)], r[(1, 2)] + r[(2, 1)]);
    let q = match k {
        0 => [half, x * s, y * s, z * s],
        1 => [x * s, half, xy * s, xz * s],
        2 => [y * s, xy * s, half, yz * s],
        _ => [z * s, xz * s, yz * s, half],
    };
    if q[0].re() < 0.0 { q.map(|v| -v) } else { q }
}

/// The product a b of two scalar-first quaternions: rotation b, then a.
pub fn quaternion_product<T: Real>(a: &[T; 4], b: &[T; 4]) -> [T; 4] {
    [
        a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
        a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
        a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1],
        a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0],
    ]
}

/// The unit quaternion of a rotation vector.
pub fn quaternion_of_vector<T: Real>(w: &V3<T>) -> [T; 4] {
    let s = w.dot(w);
    // cos(t/2) and sin(t/2)/t of s = t^2
    let (c, f) = if s.re() < SMALL {
        let u = s * 0.25;
        (
            series(u, &[1.0, -1.0 / 2.0, 1.0 / 24.0, -1.0 / 720.0, 1.0 / 40_320.0, -1.0 / 3_628_800.0]),
            series(u, &[0.5, -1.0 / 12.0, 1.0 / 240.0, -1.0 / 10_080.0, 1.0 / 725_760.0, -1.0 / 79_833_600.0]),
        )
    } else {
        let t = s.sqrt();
        let half = t * 0.5;
        (half.cos(), half.sin() / t)
    };
    [c, w.x * f, w.y * f, w.z * f]
}

/// Rotation about an axis of the frame.
pub fn rotation_about<T: Real>(axis: usize, angle: T) -> M3<T> {
    let (s, c) = (angle.sin(), angle.cos());
    let (i, j) = ((axis + 1) % 3, (axis + 2) % 3);
    let mut r = M3::identity();
    (r[(i, i)], r[(j, j)]) = (c, c);
    (r[(i, j)], r[(j, i)]) = (-s, s);
    r
}

// Below this square of an angle the closed forms lose digits, and their square roots would make duals NaN at zero.
const SMALL: f64 = 0.05;

/// exp of the cross-product matrix of a rotation vector.
pub fn exp_so3<T: Real>(w: &V3<T>) -> M3<T> {
    let s = w.dot(w);
    let (a, b) = if s.re() < SMALL {
        (
            series(s, &[1.0, -1.0 / 6.0, 1.0 / 120.0, -1.0 / 5040.0, 1.0 / 362_880.0, -1.0 / 39_916_800.0]),
            series(s, &[0.5, -1.0 / 24.0, 1.0 / 720.0, -1.0 / 40_320.0, 1.0 / 3_628_800.0, -1.0 / 479_001_600.0]),
        )
    } else {
        let t = s.sqrt();
        (t.sin() / t, (T::one() - t.cos()) / s)
    };
    let [x, y, z] = [w.x, w.y, w.z];
    let (xy, xz, yz) = (x * y * b, x * z * b, y * z * b);
    let (ax, ay, az) = (x * a, y * a, z * a);
    let (xx, yy, zz) = (x * x, y * y, z * z);
    let diagonal = |sum: T| T::one() - sum * b;
    M3::new(
        diagonal(yy + zz),
        xy - az,
        xz + ay,
        xy + az,
        diagonal(xx + zz),
        yz - ax,
        xz - ay,
        yz + ax,
        diagonal(xx + yy),
    )
}

/// The rotation vector of a rotation matrix, of length at most pi.
pub fn log_so3<T: Real>(r: &M3<T>) -> V3<T> {
    let [w, x, y, z] = quaternion_of_rotation(r);
    let v = V3::new(x, y, z);
    let s = v.dot(&v);
    let factor = if s.re() < 1e-3 {
        // 2 asin(n)/n in powers of n^2, n = |v|
        series(s, &[2.0, 1.0 / 3.0, 3.0 / 20.0, 5.0 / 56.0, 35.0 / 576.0, 63.0 / 1408.0])
    } else {
        let n = s.sqrt();
        n.atan2(w) * 2.0 / n
    };
    v * factor
}

fn series<T: Real>(x: T, coefficients: &[f64]) -> T {
    coefficients.iter().rev().fold(T::zero(), |sum, c| sum * x + *c)
}

/// The coefficient b(s), s = |phi|^2, of J_l^-1 = 1 - phi^/2 + b phi^ phi^, and db/ds.
pub fn left_jacobian_coefficient<T: Real>(s: T) -> (T, T) {
    if s.re() < SMALL {
        let c =
            [1.0 / 12.0, 1.0 / 720.0, 1.0 / 30_240.0, 1.0 / 1_209_600.0, 1.0 / 47_900_160.0, 5.284_190_138_687_494e-10];
        let d = [c[1], 2.0 * c[2], 3.0 * c[3], 4.0 * c[4], 5.0 * c[5]];
        return (series(s, &c), series(s, &d));
    }
    let h = s.sqrt() * 0.5;
    let cot = h.cos() / h.sin();
    let b = (T::one() - h * cot) / s;
    let slope = (cot - h / (h.sin() * h.sin())) / (h * 8.0);
    (b, -(b + slope) / s)
}

/// A unit vector and its deterministic companion: the rotation matrix whose z is `axis` (docs/tables.md).
pub fn frame_of_axis<T: Real>(axis: &V3<T>) -> M3<T> {
    let z = axis / axis.dot(axis).sqrt();
    let mut k = 0;
    for i in 1..3 {
        if z[i].re().abs() < z[k].re().abs() {
            k = i;
        }
    }
    let mut e = V3::zeros();
    e[k] = T::one();
    let x = e - z * z[k];
    let x = x / x.dot(&x).sqrt();
    M3::from_columns(&[x, z.cross(&x), z])
}

/// Three numbers of a list from a place on.
pub fn vector<T: Real>(x: &[T], at: usize) -> V3<T> {
    V3::new(x[at], x[at + 1], x[at + 2])
}

#[cfg(test)]
mod tests {
    use super::*;
    use num_dual::Dual64;

    #[test]
    fn an_angle_has_its_derivatives_on_all_axes() {
        for (y, x) in [(1.3, 0.0), (-0.4, 0.0), (2.1, 1e-300), (-2.1, -1e-18), (0.3, -0.7), (0.0, -1.1), (0.0, 0.2)] {
            let s: f64 = x * x + y * y;
            for (dy, dx) in [(1.0, 0.0), (0.0, 1.0)] {
                let angle = arctan2(Dual64::new(y, dy), Dual64::new(x, dx));
                assert!((angle.re - y.atan2(x)).abs() < 1e-15, "{y} {x}");
                assert!((angle.eps - (x * dy - y * dx) / s).abs() < 1e-15 / s.sqrt(), "{y} {x}");
            }
        }
    }

    #[test]
    fn exp_and_log_invert_each_other_for_small_and_large_angles() {
        for angle in [0.0, 1e-9, 1e-3, 0.2, 0.3, 1.0, 3.0, 3.1] {
            let w = V3::new(0.3, -0.5, 0.81).normalize() * angle;
            assert!((log_so3(&exp_so3(&w)) - w).norm() < 1e-12 * (1.0 + angle), "{angle}");
        }
    }

    #[test]
    fn the_left_jacobian_is_the_derivative_of_the_exponential() {
        for angle in [0.0, 1e-4, 0.15, 0.3, 2.0] {
            let w = V3::new(0.3, -0.5, 0.81).normalize() * angle;
            let d = V3::new(0.1, 0.7, -0.4);
            let moved = w.zip_map(&d, Dual64::new);
            let r = exp_so3(&moved);
            let dr = r.map(|x| x.eps) * real33(&r).transpose();
            let xi = V3::new(dr[(2, 1)], dr[(0, 2)], dr[(1, 0)]);
            let (b, _) = left_jacobian_coefficient(w.dot(&w));
            let back = xi - w.cross(&xi) * 0.5 + w.cross(&w.cross(&xi)) * b;
            assert!((back - d).norm() < 1e-13, "{angle}: {}", (back - d).norm());
        }
    }

    #[test]
    fn the_slope_of_the_coefficient_is_continuous_at_the_switch() {
        for s in [0.02, 0.0499, 0.0501, 1.0] {
            let value = left_jacobian_coefficient(Dual64::new(s, 1.0));
            assert!((value.0.eps - value.1.re).abs() < 1e-11, "{s}: {} {}", value.0.eps, value.1.re);
        }
    }

    #[test]
    fn moving_the_point_of_a_map_keeps_its_work() {
        let m = |k: f64| M3::new(1.0 + k, 2.0, k, 0.3, 1.5, -k, 0.2 * k, 0.7, 1.1);
        let map = Map6 { ll: m(0.1), la: m(0.2), al: m(0.3), aa: m(0.4) };
        let d = V3::new(0.4, -1.2, 0.3);
        let here = Six::new(V3::new(1.0, 2.0, 3.0), V3::new(-0.3, 0.2, 0.9));
        let there = here.motion_at(&d);
        assert!((here.dot(&map.apply(&here)) - there.dot(&map.at(&d).apply(&there))).abs() < 1e-12);
    }
}
