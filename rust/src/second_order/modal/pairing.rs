//! Which two real roots make one mode.
//!
//! Real roots are split into an upper half and a lower half: for symmetric systems by the sign of x^T Q'(s) x (positive on the
//! roots that come first in every scalar quadratic), else by their size. Each upper root takes the lower one whose shape is
//! most like its own, best match first.
use super::RawMode;
use crate::linalg::dense::{C, real};
use crate::tolerances::modes::NEUTRAL;

/// A real root in mass-orthonormal coordinates.
pub struct RealRoot {
    pub s: f64,
    /// x^T Q'(s) x relative to its terms: in [-1, 1].
    pub sign: f64,
    pub x: Vec<C>,
    pub y: Option<Vec<C>>,
    pub zero: bool,
}

pub fn pair(mut roots: Vec<RealRoot>, symmetric: bool) -> Vec<RawMode> {
    roots.sort_by(|a, b| {
        let by_size = b.s.total_cmp(&a.s);
        if symmetric { sign(b).cmp(&sign(a)).then(by_size) } else { by_size }
    });
    let half = roots.len() / 2;
    let lower = roots.split_off(half);
    let matches = best_matches(&roots, &lower);
    let mut lower: Vec<Option<RealRoot>> = lower.into_iter().map(Some).collect();
    roots.into_iter().zip(matches).filter_map(|(a, k)| lower[k].take().map(|b| mode(a, b))).collect()
}

fn sign(root: &RealRoot) -> i8 {
    if root.sign > NEUTRAL {
        1
    } else if root.sign < -NEUTRAL {
        -1
    } else {
        0
    }
}

/// For every upper root the index of its lower one.
fn best_matches(upper: &[RealRoot], lower: &[RealRoot]) -> Vec<usize> {
    // equal likeness must not be decided by rounding
    const STEPS: f64 = 1e6;
    let mut pairs = Vec::with_capacity(upper.len() * lower.len());
    for (i, a) in upper.iter().enumerate() {
        for (j, b) in lower.iter().enumerate() {
            pairs.push(((likeness(&a.x, &b.x) * STEPS).round() as i64, i, j));
        }
    }
    pairs.sort_by_key(|&(like, i, j)| (-like, i, j));
    let mut chosen = vec![usize::MAX; upper.len()];
    let mut taken = vec![false; lower.len()];
    for (_, i, j) in pairs {
        if chosen[i] == usize::MAX && !taken[j] {
            chosen[i] = j;
            taken[j] = true;
        }
    }
    chosen
}

fn likeness(a: &[C], b: &[C]) -> f64 {
    let product: C = a.iter().zip(b).map(|(a, b)| a.conj() * b).sum();
    let norm = |v: &[C]| v.iter().map(|v| v.norm_sqr()).sum::<f64>();
    product.norm_sqr() / (norm(a) * norm(b)).max(f64::MIN_POSITIVE)
}

fn mode(a: RealRoot, b: RealRoot) -> RawMode {
    let (a, b) = if a.s >= b.s { (a, b) } else { (b, a) };
    RawMode {
        s: real(a.s),
        partner: real(b.s),
        rigid: a.zero,
        x: a.x,
        y: a.y,
        partner_x: Some(b.x),
        partner_y: b.y,
        known: None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sign_counts_from_its_bound_on() {
        let of = |value: f64| sign(&RealRoot { s: -1.0, sign: value, x: Vec::new(), y: None, zero: false });
        assert_eq!([1e-9, 1e-11, -1e-11, -1e-9].map(of), [1, 0, 0, -1]);
    }
}
