//! The operations of programs: one table with name, value and the places without a derivative.
//!
//! Derivatives come from the numbers that an operation is evaluated with. Beside a kink the slope is that of the side on which the
//! arguments lie; on it the operation takes the first of two equal arguments, and the slope of sqrt, cbrt and hypot at zero
//! counts as zero (elsewhere it would be infinite, and infinity times zero is not a number).
use crate::spatial::Real;

/// Whole powers up to this one are products; of larger ones the logarithm is as accurate.
const LARGEST_WHOLE_POWER: f64 = 1024.0;
const DEGREE: f64 = std::f64::consts::PI / 180.0;

fn truth<T: Real>(yes: bool) -> T {
    T::from(f64::from(u8::from(yes)))
}

fn constant<T: Real>(x: &T, f: impl Fn(f64) -> f64) -> T {
    T::from(f(x.re()))
}

fn is_true<T: Real>(x: &T) -> bool {
    x.re() != 0.0
}

fn absolute<T: Real>(x: T) -> T {
    if x.re() < 0.0 { -x } else { x }
}

/// With expm1 of a negative number: sinh/cosh, which dual numbers use, overflows.
fn tanh<T: Real>(x: T) -> T {
    let y = absolute(x) * -2.0;
    let t = -y.exp_m1() / (y.exp() + 1.0);
    if x.re() < 0.0 { -t } else { t }
}

fn asinh<T: Real>(x: T) -> T {
    let a = absolute(x);
    let y = (a + a * a / ((a * a + 1.0).sqrt() + 1.0)).ln_1p();
    if x.re() < 0.0 { -y } else { y }
}

fn root<T: Real>(x: T, f: impl Fn(T) -> T) -> T {
    if x.re() == 0.0 { T::from(0.0) } else { f(x) }
}

fn cbrt<T: Real>(x: T) -> T {
    let y = absolute(x).cbrt();
    if x.re() < 0.0 { -y } else { y }
}

/// The larger of the two is taken out, so that squares neither overflow nor vanish.
fn hypot<T: Real>(a: T, b: T) -> T {
    let (a, b) = (absolute(a), absolute(b));
    let (long, short) = if a.re() < b.re() { (b, a) } else { (a, b) };
    if long.re() == 0.0 {
        return T::from(0.0);
    }
    let ratio = short / long;
    long * (ratio * ratio + 1.0).sqrt()
}

/// a^b. At a = 0 the slopes of a positive power count as zero where they are infinite.
fn power<T: Real>(a: T, b: T) -> T {
    if a.re() == 0.0 && b.re() > 0.0 { T::from(0.0) } else { a.powd(b) }
}

/// a^c of a constant c.
pub fn constant_power<T: Real>(a: T, c: f64) -> T {
    if c.fract() == 0.0 && c.abs() <= LARGEST_WHOLE_POWER {
        a.powi(c as i32)
    } else if a.re() == 0.0 && c > 0.0 {
        T::from(0.0)
    } else {
        a.powf(c)
    }
}

macro_rules! operations {
    ($($variant:ident($n:literal, $name:literal, |$x:ident| $value:expr, $kink:expr)),* $(,)?) => {
        /// An operation on one, two or three numbers.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
        pub enum Op { $($variant),* }

        impl Op {
            pub const ALL: &[Op] = &[$(Op::$variant),*];

            /// The name in NumPy.
            pub fn name(self) -> &'static str {
                match self { $(Op::$variant => $name),* }
            }

            pub fn arity(self) -> usize {
                match self { $(Op::$variant => $n),* }
            }

            #[inline]
            pub fn value<T: Real>(self, x: [T; 3]) -> T {
                match self { $(Op::$variant => { let $x = x; $value })* }
            }

            /// Whether it has no derivative at these arguments.
            pub fn has_kink(self, x: [f64; 3]) -> bool {
                match self { $(Op::$variant => { let kink: fn([f64; 3]) -> bool = $kink; kink(x) })* }
            }
        }
    };
}

fn smooth(_: [f64; 3]) -> bool {
    false
}

operations! {
    Add(2, "add", |x| x[0] + x[1], smooth),
    Subtract(2, "subtract", |x| x[0] - x[1], smooth),
    Multiply(2, "multiply", |x| x[0] * x[1], smooth),
    Divide(2, "divide", |x| x[0] / x[1], smooth),
    Negative(1, "negative", |x| -x[0], smooth),
    Power(2, "power", |x| power(x[0], x[1]), |x| x[0] == 0.0 && x[1] < 1.0 && x[1] != 0.0),
    Abs(1, "abs", |x| absolute(x[0]), |x| x[0] == 0.0),
    Sqrt(1, "sqrt", |x| root(x[0], |x| x.sqrt()), |x| x[0] == 0.0),
    Cbrt(1, "cbrt", |x| root(x[0], cbrt), |x| x[0] == 0.0),
    Square(1, "square", |x| x[0] * x[0], smooth),
    Reciprocal(1, "reciprocal", |x| x[0].recip(), smooth),
    Exp(1, "exp", |x| x[0].exp(), smooth),
    ExpM1(1, "expm1", |x| x[0].exp_m1(), smooth),
    Log(1, "log", |x| x[0].ln(), smooth),
    Log1P(1, "log1p", |x| x[0].ln_1p(), smooth),
    Log2(1, "log2", |x| x[0].log2(), smooth),
    Log10(1, "log10", |x| x[0].log10(), smooth),
    Sin(1, "sin", |x| x[0].sin(), smooth),
    Cos(1, "cos", |x| x[0].cos(), smooth),
    Tan(1, "tan", |x| x[0].tan(), smooth),
    Arcsin(1, "arcsin", |x| x[0].asin(), smooth),
    Arccos(1, "arccos", |x| x[0].acos(), smooth),
    Arctan(1, "arctan", |x| x[0].atan(), smooth),
    Sinh(1, "sinh", |x| x[0].sinh(), smooth),
    Cosh(1, "cosh", |x| x[0].cosh(), smooth),
    Tanh(1, "tanh", |x| tanh(x[0]), smooth),
    Arcsinh(1, "arcsinh", |x| asinh(x[0]), smooth),
    Arccosh(1, "arccosh", |x| x[0].acosh(), smooth),
    Arctanh(1, "arctanh", |x| x[0].atanh(), smooth),
    Radians(1, "radians", |x| x[0] * DEGREE, smooth),
    Degrees(1, "degrees", |x| x[0] / DEGREE, smooth),
    Sign(1, "sign", |x| constant(&x[0], |x| if x == 0.0 { 0.0 } else { x.signum() }), |x| x[0] == 0.0),
    Floor(1, "floor", |x| constant(&x[0], f64::floor), |x| x[0].fract() == 0.0),
    Arctan2(2, "arctan2", |x| x[0].atan2(x[1]), |x| x[0] == 0.0 && x[1] == 0.0),
    Hypot(2, "hypot", |x| hypot(x[0], x[1]), |x| x[0] == 0.0 && x[1] == 0.0),
    Maximum(2, "maximum", |x| if x[0].re() < x[1].re() { x[1] } else { x[0] }, |x| x[0] == x[1]),
    Minimum(2, "minimum", |x| if x[1].re() < x[0].re() { x[1] } else { x[0] }, |x| x[0] == x[1]),
    Less(2, "less", |x| truth(x[0].re() < x[1].re()), smooth),
    LessEqual(2, "less_equal", |x| truth(x[0].re() <= x[1].re()), smooth),
    Equal(2, "equal", |x| truth(x[0].re() == x[1].re()), smooth),
    And(2, "logical_and", |x| truth(is_true(&x[0]) && is_true(&x[1])), smooth),
    Or(2, "logical_or", |x| truth(is_true(&x[0]) || is_true(&x[1])), smooth),
    Not(1, "logical_not", |x| truth(!is_true(&x[0])), smooth),
    Where(3, "where", |x| if is_true(&x[0]) { x[1] } else { x[2] }, smooth),
}

/// What an operation is on one side of its switch.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Branch {
    /// one of its arguments
    Argument(usize),
    Negative,
    Constant(f64),
}

impl Op {
    /// The number at whose zero the operation changes from one smooth branch to another, none of smooth ones.
    pub fn switch(self, x: [f64; 3]) -> Option<f64> {
        match self {
            Op::Abs | Op::Sign => Some(x[0]),
            Op::Maximum | Op::Minimum | Op::Less | Op::LessEqual => Some(x[0] - x[1]),
            _ => None,
        }
    }

    /// The branch above or below the zero of its switch.
    pub fn branch(self, above: bool) -> Option<Branch> {
        let one = |above: Branch, below: Branch, yes: bool| Some(if yes { above } else { below });
        match self {
            Op::Abs => one(Branch::Argument(0), Branch::Negative, above),
            Op::Sign => one(Branch::Constant(1.0), Branch::Constant(-1.0), above),
            Op::Maximum => one(Branch::Argument(0), Branch::Argument(1), above),
            Op::Minimum => one(Branch::Argument(1), Branch::Argument(0), above),
            Op::Less | Op::LessEqual => one(Branch::Constant(0.0), Branch::Constant(1.0), above),
            _ => None,
        }
    }

    pub fn named(name: &str) -> Option<Op> {
        Op::ALL.iter().copied().find(|op| op.name() == name)
    }
}
