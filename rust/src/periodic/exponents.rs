//! Floquet exponents of a periodic motion by the parts of its system that nothing connects: what one part does changes none of another one.
use num_complex::Complex64 as c64;

use crate::tolerances::periodic::NEUTRAL;

/// Exponents (1/s) of one part.
#[derive(Debug, Clone)]
pub struct Own {
    pub roots: Vec<c64>,
    /// no solution of the branch has others: the part is linear
    pub constant: bool,
}

/// Of all parts, in their order; without parts where they are not known.
#[derive(Debug, Clone, Default)]
pub struct Exponents(pub Vec<Own>);

impl Exponents {
    pub fn all(&self) -> impl Iterator<Item = c64> + '_ {
        self.0.iter().flat_map(|own| own.roots.iter().copied())
    }

    pub fn is_known(&self) -> bool {
        !self.0.is_empty()
    }

    /// Those of one part.
    pub fn part(&self, part: usize) -> &[c64] {
        self.0.get(part).map_or(&[], |own| &own.roots)
    }

    /// Numbers of the parts whose exponents change along a branch.
    pub fn changing(&self) -> impl Iterator<Item = usize> + '_ {
        (0..self.0.len()).filter(|part| !self.0[*part].constant)
    }

    /// How many grow.
    pub fn unstable(&self, w0: f64) -> usize {
        self.0.iter().map(|own| unstable(&own.roots, w0)).sum()
    }

    /// Part and number of the one that is nearest to zero, where a branch folds or meets another one.
    pub fn zero(&self) -> Option<(usize, usize)> {
        let own = self.changing().flat_map(|part| (0..self.part(part).len()).map(move |i| (part, i)));
        own.min_by(|a, b| self.part(a.0)[a.1].norm().total_cmp(&self.part(b.0)[b.1].norm()))
    }

    /// In another unit of time.
    pub fn scaled(&self, factor: f64) -> Exponents {
        let one = |own: &Own| Own { roots: own.roots.iter().map(|s| s * factor).collect(), ..*own };
        Exponents(self.0.iter().map(one).collect())
    }
}

/// Exponents with a positive real part.
pub fn unstable(exponents: &[c64], w0: f64) -> usize {
    exponents.iter().filter(|s| s.re > NEUTRAL * w0).count()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn growth_counts_from_its_bound_on() {
        let w0 = 3.7;
        assert_eq!(unstable(&[1e-10, 1e-8, -1e-8].map(|r| c64::new(r * w0, 1.0)), w0), 1);
    }

    #[test]
    fn the_zero_of_a_fold_is_no_exponent_of_a_linear_part() {
        let own = |re: f64, constant: bool| Own { roots: vec![c64::new(-3.0, 0.0), c64::new(re, 0.0)], constant };
        let exponents = Exponents(vec![own(-1e-12, true), own(1e-6, false)]);
        assert_eq!(exponents.zero(), Some((1, 1)));
    }
}
