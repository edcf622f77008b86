//! Zeros of a function of one variable between two places where its signs differ: T. R. Chandrupatla, A new hybrid quadratic/bisection
//! algorithm for finding the zero of a nonlinear function without using derivatives, Advances in Engineering Software 28, 1997.

/// Two places around a zero, each with its value, and the one before: the last one first.
pub struct Bracket<X> {
    last: (f64, f64, X),
    across: (f64, f64, X),
    before: Option<(f64, f64)>,
}

impl<X> Bracket<X> {
    /// Place, value and what belongs to it; the values have opposite signs.
    pub fn new(a: (f64, f64, X), b: (f64, f64, X)) -> Bracket<X> {
        let (last, across) = if a.1.abs() < b.1.abs() { (a, b) } else { (b, a) };
        Bracket { last, across, before: None }
    }

    pub fn ends(&self) -> [&(f64, f64, X); 2] {
        [&self.last, &self.across]
    }

    pub fn width(&self) -> f64 {
        (self.across.0 - self.last.0).abs()
    }

    pub fn middle(&self) -> f64 {
        self.last.0 + 0.5 * (self.across.0 - self.last.0)
    }

    /// The next place to try, no nearer to an end than `apart`.
    pub fn next(&self, apart: f64) -> f64 {
        let (x, f) = (self.last.0, self.last.1);
        let (x2, f2) = (self.across.0, self.across.1);
        let secant = f / (f - f2);
        let t = match self.before {
            None => secant,
            Some((x3, f3)) => {
                let (xi, phi) = ((x - x2) / (x3 - x2), (f - f2) / (f3 - f2));
                // where the inverse quadratic through the three stays within the bracket
                if phi * phi < xi && (1.0 - phi).powi(2) < 1.0 - xi {
                    secant * f3 / (f3 - f2) + (x3 - x) / (x2 - x) * f / (f3 - f) * f2 / (f3 - f2)
                } else {
                    0.5
                }
            }
        };
        let least = (apart / self.width()).min(0.5);
        x + (x2 - x) * if t.is_finite() { t.clamp(least, 1.0 - least) } else { 0.5 }
    }

    /// Takes a place between the ends in.
    pub fn add(&mut self, place: (f64, f64, X)) {
        let old = std::mem::replace(&mut self.last, place);
        if (self.last.1 < 0.0) == (old.1 < 0.0) {
            self.before = Some((old.0, old.1));
        } else {
            self.before = Some((self.across.0, self.across.1));
            self.across = old;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Trials until the bracket is `apart` wide, and its middle.
    fn zero(f: impl Fn(f64) -> f64, a: f64, b: f64, apart: f64) -> (usize, f64) {
        let mut bracket = Bracket::new((a, f(a), ()), (b, f(b), ()));
        for trial in 0..200 {
            if bracket.width() <= 2.0 * apart || bracket.last.1 == 0.0 {
                return (trial, bracket.last.0);
            }
            let x = bracket.next(apart);
            bracket.add((x, f(x), ()));
        }
        (200, f64::NAN)
    }

    #[test]
    fn zeros_are_closed_in_by_few_trials() {
        let smooth: [fn(f64) -> f64; 3] = [|x| x.cos() - x, |x| x * x * x - 0.1, |x| (5.0 * x).tanh() - 0.3];
        for (f, expected) in smooth.iter().zip([0.739_085_133_215_160_6, 0.1_f64.cbrt(), 0.3_f64.atanh() / 5.0]) {
            let (trials, x) = zero(f, -0.3, 1.7, 1e-12);
            assert!(trials <= 12 && (x - expected).abs() < 2e-12, "{trials} {x} {expected}");
        }
        // a triple root, a jump, and rounding that is larger than what is looked for
        assert!(zero(|x| (x - 0.4).powi(3), 0.0, 1.0, 1e-12).0 <= 80);
        let (trials, x) = zero(|x| if x < 0.4 { -1.0 } else { 3.0 }, 0.0, 1.0, 1e-12);
        assert!(trials <= 45 && (x - 0.4).abs() < 3e-12, "{trials} {x}");
        let (trials, x) = zero(|x| x.sin() - 0.2 + 1e-11 * (1e13 * x).sin(), 0.0, 1.0, 1e-12);
        assert!(trials <= 16 && (x - 0.2_f64.asin()).abs() < 2e-11, "{trials} {x}");
    }
}
