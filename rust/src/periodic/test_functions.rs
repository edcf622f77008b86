//! Functions of the multipliers mu of a motion that vanish where one of them, or a pair, passes the unit circle:
//!
//! ```text
//! prod_i (mu_i - 1),    prod_i (mu_i + 1),    prod_{i<j} (mu_i mu_j - 1)
//! ```
//!
//! They are polynomials of the entries of the monodromy matrix, so that they are smooth along a branch, also where two multipliers meet and
//! part like a root. Source: Yu. A. Kuznetsov, Elements of Applied Bifurcation Theory, Springer 2004, 10.2.
use num_complex::Complex64 as c64;

use crate::tolerances::periodic::{NEUTRAL, STEEPER};

/// Largest logarithm of a multiplier.
const LARGEST: f64 = 300.0;

/// A value that may be beyond the range of numbers: its sign and the logarithm of its size.
#[derive(Debug, Clone, Copy)]
struct Value {
    sign: f64,
    log: f64,
}

/// Exponents and the base frequency of their motion.
pub type Told<'a> = (&'a [c64], f64);

/// Where between two places one of the functions may have passed zero and come back, as a fraction of the way: where two lines that are
/// somewhat steeper than those through its neighbours on either side are both beyond zero. `outer`: the places before and behind with
/// their distances, where there are such.
pub fn possible_meeting(outer: [Option<(f64, Told<'_>)>; 2], ends: [Told<'_>; 2], length: f64) -> Option<f64> {
    if outer.iter().all(Option::is_none) {
        return None;
    }
    let ends = ends.map(values);
    let outer = outer.map(|side| side.map(|(distance, told)| (distance, values(told))));
    (0..3).find_map(|k| {
        let [here, there] = [ends[0][k]?, ends[1][k]?];
        if here.sign != there.sign {
            return None;
        }
        let side = |at: usize| match &outer[at] {
            Some((distance, values)) => Some((*distance, values[k]?)),
            None => None,
        };
        let first = if outer[0].is_some() { reach(side(0)?, here)? } else { 0.0 };
        let last = length - if outer[1].is_some() { reach(side(1)?, there)? } else { 0.0 };
        (first < last).then(|| 0.5 * (first + last) / length)
    })
}

/// How far a line that is somewhat steeper than that through two values takes to zero, if it comes nearer.
fn reach((distance, before): (f64, Value), here: Value) -> Option<f64> {
    let fall = before.sign * here.sign * (before.log - here.log).exp() - 1.0;
    (fall > 0.0).then(|| distance / (STEEPER * fall))
}

/// The three; None where it is rounding: of exponents on the axis.
fn values((exponents, w0): Told<'_>) -> [Option<Value>; 3] {
    let period = std::f64::consts::TAU / w0;
    let power = |s: c64| c64::from_polar((s.re * period).min(LARGEST).exp(), s.im * period);
    let multipliers = || exponents.iter().map(|s| power(*s));
    let pairs = || (0..exponents.len()).flat_map(|i| (0..i).map(move |j| (i, j)));
    let sums = || pairs().map(|(i, j)| exponents[i] + exponents[j]);
    let neutral = exponents.iter().any(|s| s.re.abs() <= NEUTRAL * w0);
    [
        product(multipliers().map(|m| m - 1.0)),
        product(multipliers().map(|m| m + 1.0)),
        product(sums().map(|s| power(s) - 1.0)).filter(|_| !neutral),
    ]
}

fn product(factors: impl Iterator<Item = c64>) -> Option<Value> {
    let (turn, log) = factors.fold((c64::new(1.0, 0.0), 0.0), |(turn, log), factor| {
        let size = factor.norm();
        (turn * (factor / size), log + size.ln())
    });
    (log.is_finite() && turn.re.is_finite()).then(|| Value { sign: turn.re.signum(), log })
}

#[cfg(test)]
mod tests {
    use super::*;

    const W0: f64 = 2.7;

    /// Four places around the one where the pairs of `at` meet; whether they are looked for between the inner two.
    fn is_looked_for(at: impl Fn(f64) -> Vec<c64>) -> bool {
        let [before, a, b, after] = [-0.4, -0.1, 0.15, 0.5].map(at);
        let told = |exponents| (exponents, W0);
        let (left, right) = (Some((0.3, told(&before[..]))), Some((0.35, told(&after[..]))));
        possible_meeting([left, right], [told(&a), told(&b)], 0.25).is_some()
    }

    /// A pair with this discriminant around a mean.
    fn pair(mean: c64, discriminant: f64) -> [c64; 2] {
        let root = c64::new(discriminant, 0.0).sqrt();
        [mean + root, mean - root]
    }

    /// The growth is -0.01 at all four places: they tell of the band by where the exponents are.
    #[test]
    fn a_band_between_places_of_equal_growth_is_looked_for() {
        let square = |s: f64| 1e-3 - s * s;
        assert!(is_looked_for(|s| pair(c64::new(-0.01, 0.0), square(s)).to_vec()));
        assert!(is_looked_for(|s| pair(c64::new(-0.01, 0.5 * W0), square(s)).to_vec()));
        assert!(is_looked_for(|s| {
            let upper = pair(c64::new(-0.01, 0.6), square(s));
            [upper, upper.map(|s| s.conj())].concat()
        }));
    }

    #[test]
    fn pairs_that_stay_apart_are_not_looked_for() {
        assert!(!is_looked_for(|s| pair(c64::new(-0.01, 0.0), -0.3 - s * s).to_vec()));
    }
}
