//! Numbers that remember how they were made: one pass backwards gives the derivative of a result by everything it came from.
//!
//! A number is its value and its place on the tape of the thread; place 0 is a constant, and what is made of constants alone is not
//! written down. The generic text of the core runs over them like over duals.
use std::cell::RefCell;
use std::fmt;
use std::iter::{Product, Sum};
use std::ops::{Add, AddAssign, Div, DivAssign, Mul, MulAssign, Neg, Rem, RemAssign, Sub, SubAssign};

use num_dual::{DualNum, DualStruct, Mappable};
use realfft::num_traits::{FromPrimitive, Inv, Num, One, Signed, Zero};

#[derive(Clone, Copy)]
struct Node {
    from: [u32; 2],
    slope: [f64; 2],
}

const NOTHING: Node = Node { from: [0, 0], slope: [0.0, 0.0] };

/// What is written, and room for the pass backwards.
struct Tape {
    nodes: Vec<Node>,
    adjoint: Vec<f64>,
}

thread_local! {
    static TAPE: RefCell<Tape> = const {
        RefCell::new(Tape {
            nodes: Vec::new(),
            adjoint: Vec::new(),
        })
    };
}

#[inline]
fn write(node: Node) -> u32 {
    TAPE.with_borrow_mut(|t| {
        t.nodes.push(node);
        (t.nodes.len() - 1) as u32
    })
}

/// A number on the tape.
#[derive(Clone, Copy, Debug)]
pub struct Taped {
    re: f64,
    at: u32,
}

/// Start anew on this thread; before the first number there is no tape.
pub fn clear() {
    TAPE.with_borrow_mut(|t| {
        t.nodes.clear();
        t.nodes.push(NOTHING);
    });
}

/// An independent number; its place is its rank among them where they come first.
pub fn leaf(re: f64) -> Taped {
    Taped { re, at: write(NOTHING) }
}

/// Derivatives of `sum` by the first n leaves after `clear`.
pub fn backwards(sum: Taped, n: usize) -> Vec<f64> {
    TAPE.with_borrow_mut(|t| {
        let Tape { nodes, adjoint } = t;
        adjoint.clear();
        adjoint.resize(nodes.len(), 0.0);
        adjoint[sum.at as usize] = 1.0;
        for i in (n + 1..nodes.len()).rev() {
            let a = adjoint[i];
            if a != 0.0 {
                let node = nodes[i];
                adjoint[node.from[0] as usize] += a * node.slope[0];
                adjoint[node.from[1] as usize] += a * node.slope[1];
            }
        }
        adjoint[1..=n].to_vec()
    })
}

impl Taped {
    #[inline]
    fn constant(re: f64) -> Self {
        Taped { re, at: 0 }
    }

    #[inline]
    fn one_of(self, re: f64, slope: f64) -> Self {
        if self.at == 0 {
            return Taped::constant(re);
        }
        let at = write(Node { from: [self.at, 0], slope: [slope, 0.0] });
        Taped { re, at }
    }

    #[inline]
    fn two_of(self, other: Self, re: f64, slope: [f64; 2]) -> Self {
        match (self.at, other.at) {
            (0, 0) => Taped::constant(re),
            (_, 0) => self.one_of(re, slope[0]),
            (0, _) => other.one_of(re, slope[1]),
            (a, b) => Taped { re, at: write(Node { from: [a, b], slope }) },
        }
    }

    #[inline]
    fn is_nothing(&self) -> bool {
        self.at == 0 && self.re == 0.0
    }
}

impl Add for Taped {
    type Output = Self;
    #[inline]
    fn add(self, o: Self) -> Self {
        if self.is_nothing() {
            return o;
        }
        if o.is_nothing() {
            return self;
        }
        self.two_of(o, self.re + o.re, [1.0, 1.0])
    }
}

impl Sub for Taped {
    type Output = Self;
    #[inline]
    fn sub(self, o: Self) -> Self {
        if o.is_nothing() {
            return self;
        }
        self.two_of(o, self.re - o.re, [1.0, -1.0])
    }
}

impl Mul for Taped {
    type Output = Self;
    #[inline]
    fn mul(self, o: Self) -> Self {
        if self.is_nothing() || o.is_nothing() {
            return Taped::constant(0.0);
        }
        self.two_of(o, self.re * o.re, [o.re, self.re])
    }
}

impl Div for Taped {
    type Output = Self;
    #[inline]
    fn div(self, o: Self) -> Self {
        let inverse = 1.0 / o.re;
        let re = self.re * inverse;
        self.two_of(o, re, [inverse, -re * inverse])
    }
}

impl Rem for Taped {
    type Output = Self;
    #[inline]
    fn rem(self, o: Self) -> Self {
        let whole = (self.re / o.re).trunc();
        self.two_of(o, self.re % o.re, [1.0, -whole])
    }
}

impl Neg for Taped {
    type Output = Self;
    #[inline]
    fn neg(self) -> Self {
        self.one_of(-self.re, -1.0)
    }
}

macro_rules! forward {
    ($($op:ident $method:ident $assign:ident $assign_method:ident),*) => {$(
        impl $op<&Taped> for Taped {
            type Output = Taped;
            #[inline]
            fn $method(self, o: &Taped) -> Taped {
                self.$method(*o)
            }
        }
        impl $op<f64> for Taped {
            type Output = Taped;
            #[inline]
            fn $method(self, o: f64) -> Taped {
                self.$method(Taped::constant(o))
            }
        }
        impl $assign for Taped {
            #[inline]
            fn $assign_method(&mut self, o: Taped) {
                *self = self.$method(o);
            }
        }
        impl $assign<f64> for Taped {
            #[inline]
            fn $assign_method(&mut self, o: f64) {
                *self = self.$method(Taped::constant(o));
            }
        }
    )*};
}

forward!(
    Add add AddAssign add_assign,
    Sub sub SubAssign sub_assign,
    Mul mul MulAssign mul_assign,
    Div div DivAssign div_assign,
    Rem rem RemAssign rem_assign
);

impl PartialEq for Taped {
    fn eq(&self, o: &Self) -> bool {
        self.re == o.re
    }
}

impl PartialEq<f64> for Taped {
    fn eq(&self, o: &f64) -> bool {
        self.re == *o
    }
}

impl PartialOrd for Taped {
    fn partial_cmp(&self, o: &Self) -> Option<std::cmp::Ordering> {
        self.re.partial_cmp(&o.re)
    }
}

impl PartialOrd<f64> for Taped {
    fn partial_cmp(&self, o: &f64) -> Option<std::cmp::Ordering> {
        self.re.partial_cmp(o)
    }
}

impl From<f64> for Taped {
    #[inline]
    fn from(re: f64) -> Self {
        Taped::constant(re)
    }
}

impl Zero for Taped {
    #[inline]
    fn zero() -> Self {
        Taped::constant(0.0)
    }

    #[inline]
    fn is_zero(&self) -> bool {
        self.re == 0.0
    }
}

impl One for Taped {
    fn one() -> Self {
        Taped::constant(1.0)
    }
}

impl Num for Taped {
    type FromStrRadixErr = <f64 as Num>::FromStrRadixErr;

    fn from_str_radix(text: &str, radix: u32) -> Result<Self, Self::FromStrRadixErr> {
        f64::from_str_radix(text, radix).map(Taped::constant)
    }
}

impl Signed for Taped {
    fn abs(&self) -> Self {
        if self.re < 0.0 { -*self } else { *self }
    }

    fn abs_sub(&self, o: &Self) -> Self {
        if self.re > o.re { *self - *o } else { Taped::zero() }
    }

    fn signum(&self) -> Self {
        Taped::constant(self.re.signum())
    }

    fn is_positive(&self) -> bool {
        self.re > 0.0
    }

    fn is_negative(&self) -> bool {
        self.re < 0.0
    }
}

impl Inv for Taped {
    type Output = Self;
    fn inv(self) -> Self {
        self.recip()
    }
}

impl Sum for Taped {
    fn sum<I: Iterator<Item = Self>>(all: I) -> Self {
        all.fold(Taped::zero(), |s, x| s + x)
    }
}

impl Product for Taped {
    fn product<I: Iterator<Item = Self>>(all: I) -> Self {
        all.fold(Taped::one(), |s, x| s * x)
    }
}

impl FromPrimitive for Taped {
    fn from_i64(n: i64) -> Option<Self> {
        Some(Taped::constant(n as f64))
    }

    fn from_u64(n: u64) -> Option<Self> {
        Some(Taped::constant(n as f64))
    }

    fn from_f64(n: f64) -> Option<Self> {
        Some(Taped::constant(n))
    }
}

impl fmt::Display for Taped {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.re)
    }
}

impl DualStruct for Taped {
    type Real = f64;
    type Inner = f64;

    fn re(&self) -> f64 {
        self.re
    }

    fn from_inner(inner: &f64) -> Self {
        Taped::constant(*inner)
    }
}

impl Mappable<Self> for Taped {
    type Output<O> = O;

    fn map_dual<M: Fn(Self) -> O, O>(self, f: M) -> O {
        f(self)
    }
}

impl DualNum for Taped {
    type Primitive = f64;
    type InnerDual = f64;
    const NDERIV: usize = 1;

    #[inline]
    fn from_re(re: f64) -> Self {
        Taped::constant(re)
    }

    fn scale(self, factor: &f64) -> Self {
        self * *factor
    }

    fn recip(&self) -> Self {
        let r = 1.0 / self.re;
        self.one_of(r, -r * r)
    }

    fn powi(&self, n: i32) -> Self {
        self.one_of(self.re.powi(n), f64::from(n) * self.re.powi(n - 1))
    }

    fn powf(&self, n: f64) -> Self {
        self.one_of(self.re.powf(n), n * self.re.powf(n - 1.0))
    }

    fn sqrt(&self) -> Self {
        let r = self.re.sqrt();
        self.one_of(r, 0.5 / r)
    }

    fn cbrt(&self) -> Self {
        let r = self.re.cbrt();
        self.one_of(r, 1.0 / (3.0 * r * r))
    }

    fn exp(&self) -> Self {
        let e = self.re.exp();
        self.one_of(e, e)
    }

    fn exp2(&self) -> Self {
        let e = self.re.exp2();
        self.one_of(e, e * std::f64::consts::LN_2)
    }

    fn exp_m1(&self) -> Self {
        self.one_of(self.re.exp_m1(), self.re.exp())
    }

    fn ln(&self) -> Self {
        self.one_of(self.re.ln(), 1.0 / self.re)
    }

    fn log(&self, base: f64) -> Self {
        self.one_of(self.re.log(base), 1.0 / (self.re * base.ln()))
    }

    fn log2(&self) -> Self {
        self.one_of(self.re.log2(), std::f64::consts::LOG2_E / self.re)
    }

    fn log10(&self) -> Self {
        self.one_of(self.re.log10(), std::f64::consts::LOG10_E / self.re)
    }

    fn ln_1p(&self) -> Self {
        self.one_of(self.re.ln_1p(), 1.0 / (1.0 + self.re))
    }

    fn sin(&self) -> Self {
        self.one_of(self.re.sin(), self.re.cos())
    }

    fn cos(&self) -> Self {
        self.one_of(self.re.cos(), -self.re.sin())
    }

    fn tan(&self) -> Self {
        let t = self.re.tan();
        self.one_of(t, 1.0 + t * t)
    }

    fn sin_cos(&self) -> (Self, Self) {
        (self.sin(), self.cos())
    }

    fn asin(&self) -> Self {
        self.one_of(self.re.asin(), 1.0 / (1.0 - self.re * self.re).sqrt())
    }

    fn acos(&self) -> Self {
        self.one_of(self.re.acos(), -1.0 / (1.0 - self.re * self.re).sqrt())
    }

    fn atan(&self) -> Self {
        self.one_of(self.re.atan(), 1.0 / (1.0 + self.re * self.re))
    }

    fn atan2(&self, x: Self) -> Self {
        let s = self.re * self.re + x.re * x.re;
        self.two_of(x, self.re.atan2(x.re), [x.re / s, -self.re / s])
    }

    fn sinh(&self) -> Self {
        self.one_of(self.re.sinh(), self.re.cosh())
    }

    fn cosh(&self) -> Self {
        self.one_of(self.re.cosh(), self.re.sinh())
    }

    fn tanh(&self) -> Self {
        let t = self.re.tanh();
        self.one_of(t, 1.0 - t * t)
    }

    fn asinh(&self) -> Self {
        self.one_of(self.re.asinh(), 1.0 / (1.0 + self.re * self.re).sqrt())
    }

    fn acosh(&self) -> Self {
        self.one_of(self.re.acosh(), 1.0 / (self.re * self.re - 1.0).sqrt())
    }

    fn atanh(&self) -> Self {
        self.one_of(self.re.atanh(), 1.0 / (1.0 - self.re * self.re))
    }

    // no law uses Bessel functions: by their closed forms, with the series where the next term of that of the first is below rounding
    fn sph_j0(&self) -> Self {
        if self.re.powi(4) < f64::EPSILON { -*self * *self * (1.0 / 6.0) + 1.0 } else { self.sin() / *self }
    }

    fn sph_j1(&self) -> Self {
        if self.re.powi(4) < f64::EPSILON {
            *self * (1.0 / 3.0)
        } else {
            (self.sin() - self.cos() * *self) / (*self * *self)
        }
    }

    fn sph_j2(&self) -> Self {
        if self.re.abs() >= 0.1 {
            return self.sph_j1() * 3.0 / *self - self.sph_j0();
        }
        let square = *self * *self;
        let last = -square * (1.0 / 66.0) + 1.0;
        let series = -square * (-square * last * (1.0 / 36.0) + 1.0) * (1.0 / 14.0) + 1.0;
        square * series * (1.0 / 15.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use num_dual::Dual;

    #[test]
    fn agrees_with_duals_and_nests_in_them() {
        fn f<T: DualNum<Primitive = f64> + Copy>(x: T, y: T) -> T {
            (x * y).sin() / (x * x + 1.5).sqrt() + y.atan2(x) * x.exp() - y.powi(3) * 0.3
        }
        let (x, y) = (0.7, -1.2);
        clear();
        let (a, b) = (leaf(x), leaf(y));
        let d = backwards(f(a, b), 2);
        let by_x = f(Dual::new(x, 1.0), Dual::new(y, 0.0)).eps;
        let by_y = f(Dual::new(x, 0.0), Dual::new(y, 1.0)).eps;
        assert!((d[0] - by_x).abs() < 1e-15 && (d[1] - by_y).abs() < 1e-15);
        // second derivatives: the tape under a dual
        clear();
        let (a, b) = (leaf(x), leaf(y));
        let inner = f(Dual::new(a, Taped::one()), Dual::new(b, Taped::zero())).eps;
        let d = backwards(inner, 2);
        let second =
            f(Dual::new(Dual::new(x, 1.0), Dual::new(1.0, 0.0)), Dual::new(Dual::new(y, 0.0), Dual::new(0.0, 0.0)))
                .eps
                .eps;
        assert!((d[0] - second).abs() < 1e-14);
    }
}
