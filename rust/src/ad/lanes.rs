//! Numbers with derivatives along N directions, over any number type: plain arrays, which the compiler turns into vectors.
use std::fmt;
use std::iter::{Product, Sum};
use std::ops::{Add, AddAssign, Div, DivAssign, Mul, MulAssign, Neg, Rem, RemAssign, Sub, SubAssign};

use num_dual::{DualNum, DualStruct, Mappable};
use realfft::num_traits::{FromPrimitive, Inv, Num, One, Signed, Zero};

use crate::spatial::{Pose, Real};

/// A value with its derivatives along N directions.
#[derive(Clone, Copy, Debug)]
pub struct Wide<T, const N: usize> {
    pub re: T,
    pub eps: [T; N],
}

/// Derivatives along the two changes of a projection: of the rates and of the accelerations.
pub type Jet = Wide<f64, 2>;

impl<T: Real, const N: usize> Wide<T, N> {
    pub fn constant(re: T) -> Self {
        Wide { re, eps: [T::zero(); N] }
    }

    /// The same derivatives over numbers that are constant otherwise.
    pub fn over<U: Real>(x: Wide<f64, N>) -> Wide<U, N> {
        Wide { re: U::from(x.re), eps: x.eps.map(U::from) }
    }

    pub fn is_constant(&self) -> bool {
        self.eps.iter().all(T::is_zero)
    }

    #[inline]
    fn chain(self, re: T, slope: T) -> Self {
        Wide { re, eps: self.eps.map(|d| d * slope) }
    }

    #[inline]
    fn chain_two(self, other: Self, re: T, [a, b]: [T; 2]) -> Self {
        Wide { re, eps: std::array::from_fn(|k| self.eps[k] * a + other.eps[k] * b) }
    }
}

/// A vector of constants.
pub fn constants<T: Real, const N: usize>(v: &[T]) -> Vec<Wide<T, N>> {
    v.iter().map(|x| Wide::constant(*x)).collect()
}

pub fn constant_pose<T: Real, const N: usize>(p: &Pose<T>) -> Pose<Wide<T, N>> {
    Pose { p: p.p.map(Wide::constant), r: p.r.map(Wide::constant) }
}

/// Does anything in a pose change?
pub fn moves<const N: usize>(p: &Pose<Wide<f64, N>>) -> bool {
    !p.p.iter().chain(p.r.iter()).all(Wide::is_constant)
}

impl<T: Real, const N: usize> Add for Wide<T, N> {
    type Output = Self;
    #[inline]
    fn add(mut self, o: Self) -> Self {
        self += o;
        self
    }
}

impl<T: Real, const N: usize> Sub for Wide<T, N> {
    type Output = Self;
    #[inline]
    fn sub(mut self, o: Self) -> Self {
        self -= o;
        self
    }
}

impl<T: Real, const N: usize> Mul for Wide<T, N> {
    type Output = Self;
    #[inline]
    fn mul(self, o: Self) -> Self {
        self.chain_two(o, self.re * o.re, [o.re, self.re])
    }
}

impl<T: Real, const N: usize> Div for Wide<T, N> {
    type Output = Self;
    fn div(self, o: Self) -> Self {
        let inverse = o.re.recip();
        let re = self.re * inverse;
        self.chain_two(o, re, [inverse, -re * inverse])
    }
}

impl<T: Real, const N: usize> Rem for Wide<T, N> {
    type Output = Self;
    fn rem(self, o: Self) -> Self {
        let whole = T::from((self.re.re() / o.re.re()).trunc());
        self.chain_two(o, self.re - o.re * whole, [T::one(), -whole])
    }
}

impl<T: Real, const N: usize> AddAssign for Wide<T, N> {
    #[inline]
    fn add_assign(&mut self, o: Self) {
        self.re += o.re;
        for (d, e) in self.eps.iter_mut().zip(o.eps) {
            *d += e;
        }
    }
}

impl<T: Real, const N: usize> SubAssign for Wide<T, N> {
    #[inline]
    fn sub_assign(&mut self, o: Self) {
        self.re -= o.re;
        for (d, e) in self.eps.iter_mut().zip(o.eps) {
            *d -= e;
        }
    }
}

impl<T: Real, const N: usize> Neg for Wide<T, N> {
    type Output = Self;
    #[inline]
    fn neg(self) -> Self {
        Wide { re: -self.re, eps: self.eps.map(|d| -d) }
    }
}

impl<T: Real, const N: usize> Add<f64> for Wide<T, N> {
    type Output = Self;
    fn add(mut self, o: f64) -> Self {
        self.re += o;
        self
    }
}

impl<T: Real, const N: usize> Sub<f64> for Wide<T, N> {
    type Output = Self;
    fn sub(mut self, o: f64) -> Self {
        self.re -= o;
        self
    }
}

impl<T: Real, const N: usize> Mul<f64> for Wide<T, N> {
    type Output = Self;
    #[inline]
    fn mul(self, o: f64) -> Self {
        Wide { re: self.re * o, eps: self.eps.map(|d| d * o) }
    }
}

impl<T: Real, const N: usize> Div<f64> for Wide<T, N> {
    type Output = Self;
    fn div(self, o: f64) -> Self {
        Wide { re: self.re / o, eps: self.eps.map(|d| d / o) }
    }
}

impl<T: Real, const N: usize> Rem<f64> for Wide<T, N> {
    type Output = Self;
    fn rem(self, o: f64) -> Self {
        self % Wide::from(o)
    }
}

macro_rules! assign {
    ($($op:ident $method:ident $name:ident $name_method:ident $by:ty),*) => {$(
        impl<T: Real, const N: usize> $name<$by> for Wide<T, N> {
            fn $name_method(&mut self, o: $by) {
                *self = self.$method(o);
            }
        }
    )*};
}

assign!(
    Mul mul MulAssign mul_assign Wide<T, N>,
    Div div DivAssign div_assign Wide<T, N>,
    Rem rem RemAssign rem_assign Wide<T, N>,
    Add add AddAssign add_assign f64,
    Sub sub SubAssign sub_assign f64,
    Mul mul MulAssign mul_assign f64,
    Div div DivAssign div_assign f64,
    Rem rem RemAssign rem_assign f64
);

macro_rules! by_reference {
    ($($op:ident $method:ident),*) => {$(
        impl<T: Real, const N: usize> $op<&Wide<T, N>> for Wide<T, N> {
            type Output = Self;
            fn $method(self, o: &Self) -> Self {
                self.$method(*o)
            }
        }
    )*};
}

by_reference!(Add add, Sub sub, Mul mul, Div div, Rem rem);

impl<T: Real, const N: usize> PartialEq for Wide<T, N> {
    fn eq(&self, o: &Self) -> bool {
        self.re == o.re
    }
}

impl<T: Real, const N: usize> PartialEq<f64> for Wide<T, N> {
    fn eq(&self, o: &f64) -> bool {
        self.re.re() == *o
    }
}

impl<T: Real, const N: usize> PartialOrd for Wide<T, N> {
    fn partial_cmp(&self, o: &Self) -> Option<std::cmp::Ordering> {
        self.re.partial_cmp(&o.re)
    }
}

impl<T: Real, const N: usize> PartialOrd<f64> for Wide<T, N> {
    fn partial_cmp(&self, o: &f64) -> Option<std::cmp::Ordering> {
        self.re.partial_cmp(o)
    }
}

impl<T: Real, const N: usize> From<f64> for Wide<T, N> {
    fn from(re: f64) -> Self {
        Wide::constant(T::from(re))
    }
}

impl<T: Real, const N: usize> Zero for Wide<T, N> {
    fn zero() -> Self {
        Wide::constant(T::zero())
    }

    fn is_zero(&self) -> bool {
        self.re.is_zero()
    }
}

impl<T: Real, const N: usize> One for Wide<T, N> {
    fn one() -> Self {
        Wide::constant(T::one())
    }
}

impl<T: Real, const N: usize> Num for Wide<T, N> {
    type FromStrRadixErr = <f64 as Num>::FromStrRadixErr;

    fn from_str_radix(text: &str, radix: u32) -> Result<Self, Self::FromStrRadixErr> {
        f64::from_str_radix(text, radix).map(Wide::from)
    }
}

impl<T: Real, const N: usize> Signed for Wide<T, N> {
    fn abs(&self) -> Self {
        if self.re.re() < 0.0 { -*self } else { *self }
    }

    fn abs_sub(&self, o: &Self) -> Self {
        if self.re > o.re { *self - *o } else { Wide::zero() }
    }

    fn signum(&self) -> Self {
        Wide::from(self.re.re().signum())
    }

    fn is_positive(&self) -> bool {
        self.re.re() > 0.0
    }

    fn is_negative(&self) -> bool {
        self.re.re() < 0.0
    }
}

impl<T: Real, const N: usize> Inv for Wide<T, N> {
    type Output = Self;
    fn inv(self) -> Self {
        self.recip()
    }
}

impl<T: Real, const N: usize> Sum for Wide<T, N> {
    fn sum<I: Iterator<Item = Self>>(all: I) -> Self {
        all.fold(Wide::zero(), |s, x| s + x)
    }
}

impl<T: Real, const N: usize> Product for Wide<T, N> {
    fn product<I: Iterator<Item = Self>>(all: I) -> Self {
        all.fold(Wide::one(), |s, x| s * x)
    }
}

impl<T: Real, const N: usize> FromPrimitive for Wide<T, N> {
    fn from_i64(n: i64) -> Option<Self> {
        Some(Wide::from(n as f64))
    }

    fn from_u64(n: u64) -> Option<Self> {
        Some(Wide::from(n as f64))
    }

    fn from_f64(n: f64) -> Option<Self> {
        Some(Wide::from(n))
    }
}

impl<T: Real, const N: usize> fmt::Display for Wide<T, N> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.re)
    }
}

impl<T: Real, const N: usize> DualStruct for Wide<T, N> {
    type Real = f64;
    type Inner = T;

    fn re(&self) -> f64 {
        self.re.re()
    }

    fn from_inner(inner: &T) -> Self {
        Wide::constant(*inner)
    }
}

impl<T: Real, const N: usize> Mappable<Self> for Wide<T, N> {
    type Output<O> = O;

    fn map_dual<M: Fn(Self) -> O, O>(self, f: M) -> O {
        f(self)
    }
}

/// Functions by their value and slope at `x`.
macro_rules! functions {
    ($($name:ident $x:ident $value:expr, $slope:expr;)*) => {$(
        fn $name(&self) -> Self {
            let $x = self.re;
            self.chain($value, $slope)
        }
    )*};
}

impl<T: Real, const N: usize> DualNum for Wide<T, N> {
    type Primitive = f64;
    type InnerDual = T;
    const NDERIV: usize = T::NDERIV + 1;

    fn from_re(re: T) -> Self {
        Wide::constant(re)
    }

    fn scale(self, factor: &T) -> Self {
        self.chain(self.re * *factor, *factor)
    }

    functions! {
        recip x x.recip(), -(x * x).recip();
        sqrt x x.sqrt(), x.sqrt().recip() * 0.5;
        cbrt x x.cbrt(), (x.cbrt() * x.cbrt() * 3.0).recip();
        exp x x.exp(), x.exp();
        exp2 x x.exp2(), x.exp2() * std::f64::consts::LN_2;
        exp_m1 x x.exp_m1(), x.exp();
        ln x x.ln(), x.recip();
        log2 x x.log2(), x.recip() * std::f64::consts::LOG2_E;
        log10 x x.log10(), x.recip() * std::f64::consts::LOG10_E;
        ln_1p x x.ln_1p(), (x + 1.0).recip();
        sin x x.sin(), x.cos();
        cos x x.cos(), -x.sin();
        tan x x.tan(), x.tan() * x.tan() + 1.0;
        asin x x.asin(), (-x * x + 1.0).sqrt().recip();
        acos x x.acos(), -(-x * x + 1.0).sqrt().recip();
        atan x x.atan(), (x * x + 1.0).recip();
        sinh x x.sinh(), x.cosh();
        cosh x x.cosh(), x.sinh();
        tanh x x.tanh(), -x.tanh() * x.tanh() + 1.0;
        asinh x x.asinh(), (x * x + 1.0).sqrt().recip();
        acosh x x.acosh(), (x * x - 1.0).sqrt().recip();
        atanh x x.atanh(), (-x * x + 1.0).recip();
        // no law uses Bessel functions: by j0' = -j1, j1' = j0 - 2 j1/x, j2' = j1 - 3 j2/x
        sph_j0 x x.sph_j0(), -x.sph_j1();
        sph_j1 x x.sph_j1(), if x.re() == 0.0 { T::from(1.0 / 3.0) } else { x.sph_j0() - x.sph_j1() * 2.0 / x };
        sph_j2 x x.sph_j2(), if x.re() == 0.0 { T::zero() } else { x.sph_j1() - x.sph_j2() * 3.0 / x };
    }

    fn powi(&self, n: i32) -> Self {
        let slope = match n {
            0 => T::zero(),
            _ => self.re.powi(n - 1) * f64::from(n),
        };
        self.chain(self.re.powi(n), slope)
    }

    fn powf(&self, n: f64) -> Self {
        let slope = match n {
            0.0 => T::zero(),
            _ => self.re.powf(n - 1.0) * n,
        };
        self.chain(self.re.powf(n), slope)
    }

    fn log(&self, base: f64) -> Self {
        self.chain(self.re.log(base), (self.re * base.ln()).recip())
    }

    fn sin_cos(&self) -> (Self, Self) {
        let (s, c) = self.re.sin_cos();
        (self.chain(s, c), self.chain(c, -s))
    }

    fn atan2(&self, x: Self) -> Self {
        let s = self.re * self.re + x.re * x.re;
        self.chain_two(x, self.re.atan2(x.re), [x.re / s, -self.re / s])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use num_dual::Dual;

    fn f<T: DualNum<Primitive = f64> + Copy>(x: T, y: T) -> T {
        (x * y).sin() / (x * x + 1.5).sqrt() + y.atan2(x) * x.exp() - y.powi(3) * 0.3 + x.tanh()
    }

    #[test]
    fn agrees_with_duals_and_nests() {
        let (x, y) = (0.7, -1.2);
        let both = f(Wide::<f64, 2> { re: x, eps: [1.0, 0.0] }, Wide { re: y, eps: [0.0, 1.0] });
        let by_x = f(Dual::new(x, 1.0), Dual::from(y)).eps;
        let by_y = f(Dual::from(x), Dual::new(y, 1.0)).eps;
        assert!((both.eps[0] - by_x).abs() < 1e-15 && (both.eps[1] - by_y).abs() < 1e-15);
        let jet = |re: f64, a: f64, b: f64| Jet { re, eps: [a, b] };
        let second =
            f(Wide::<Jet, 1> { re: jet(x, 1.0, 0.0), eps: [jet(1.0, 0.0, 0.0)] }, Wide::constant(jet(y, 0.0, 1.0)));
        let exact = |dx: f64, dy: f64| {
            f(Dual::new(Dual::new(x, dx), Dual::new(1.0, 0.0)), Dual::new(Dual::new(y, dy), Dual::new(0.0, 0.0)))
                .eps
                .eps
        };
        assert!((second.eps[0].eps[0] - exact(1.0, 0.0)).abs() < 1e-14);
        assert!((second.eps[0].eps[1] - exact(0.0, 1.0)).abs() < 1e-14);
    }

    #[test]
    fn functions_have_the_slopes_of_duals() {
        type Function<T> = fn(&T) -> T;
        fn all<T: DualNum<Primitive = f64> + Copy>() -> Vec<Function<T>> {
            vec![
                T::recip,
                T::sqrt,
                T::cbrt,
                T::exp,
                T::exp2,
                T::exp_m1,
                T::ln,
                T::log2,
                T::log10,
                T::ln_1p,
                T::sin,
                T::cos,
                T::tan,
                T::asin,
                T::acos,
                T::atan,
                T::sinh,
                T::cosh,
                T::tanh,
                T::asinh,
                T::atanh,
                T::sph_j0,
                T::sph_j1,
                T::sph_j2,
            ]
        }
        for (i, (wide, dual)) in all::<Wide<f64, 1>>().iter().zip(all::<Dual<f64>>()).enumerate() {
            let a = wide(&Wide { re: 0.4, eps: [1.0] });
            let b = dual(&Dual::new(0.4, 1.0));
            assert!((a.re - b.re).abs() < 1e-14, "{i}");
            assert!((a.eps[0] - b.eps).abs() < 1e-9 * (1.0 + b.eps.abs()), "{i}");
        }
    }
}
