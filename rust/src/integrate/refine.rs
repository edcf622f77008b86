//! Between two instants, as accurate as the step between them: polynomials through what holds at both ends and through the
//! accelerations at a few nodes.
//!
//! ```text
//! v'(x) = sum_i a_i l_i(x) + s w(x),   w(x) = prod_i (x - x_i),   x_i: start, end, nodes;   s such that v(1) is the rate of the end
//! theta'(x) = the same through J_l^-1(theta_i) v(x_i),                                      theta(1) the increment of the step
//! ```
//! The accelerations are those of a curve of lower order: its error e in motions makes one of order h e (W. H. Enright, K. R. Jackson,
//! S. P. Norsett, P. G. Thomsen, Interpolants for Runge-Kutta formulas, ACM Transactions on Mathematical Software 12 (1986) 193-218).
//! Nodes are such that the integral of w over the step is not zero, as it is at those of Radau and Lobatto.
use std::sync::LazyLock;

use crate::error::Result;
use crate::run::Counts;

use super::{Equations, Instant, Motion};

/// A motion within a step, and the slope of its rates on the curve that it is on, where a misfit can be told from it.
pub struct Between {
    pub motion: Motion<f64>,
    pub slope: Option<Vec<f64>>,
}

impl From<Motion<f64>> for Between {
    fn from(motion: Motion<f64>) -> Self {
        Between { motion, slope: None }
    }
}

/// Without nodes: rates by the cubic.
static NONE: LazyLock<Basis> = LazyLock::new(|| Basis::new(&[]));
/// What makes of the polynomial of degree five one of an order more.
pub static TWO: LazyLock<Basis> = LazyLock::new(|| Basis::new(&[0.33, 0.67]));
/// The same of one of order seven.
pub static FOUR: LazyLock<Basis> = LazyLock::new(|| Basis::new(&[0.15, 0.33, 0.67, 0.85]));
/// Up to order nine, evaluated three times over.
pub static SIX: LazyLock<Basis> = LazyLock::new(|| Basis::new(&[0.1, 0.22, 0.4, 0.6, 0.78, 0.9]));

/// A step: its ends, its increment, and accelerations at its ends.
pub struct Ends<'i> {
    pub from: &'i Motion<f64>,
    pub to: &'i Motion<f64>,
    pub h: f64,
    pub theta: &'i [f64],
    pub accelerations: (&'i [f64], &'i [f64]),
}

/// What is known at a node: its motion on a curve, its acceleration, and rates of states of laws.
pub struct Node {
    pub motion: Motion<f64>,
    pub acceleration: Vec<f64>,
    pub state_rates: Vec<f64>,
}

/// Polynomials by their coefficients in x - 1/2, zero at the start: one for the slope at each place, and one for the whole change.
pub struct Basis {
    /// fractions of a step at which accelerations are evaluated
    pub nodes: &'static [f64],
    slopes: Vec<Vec<f64>>,
    change: Vec<f64>,
}

/// A polynomial for each coordinate: coefficients in x - 1/2 of the first one, and so on.
struct Track {
    degree: usize,
    coefficients: Vec<f64>,
}

pub struct Curve<'i> {
    from: &'i Motion<f64>,
    h: f64,
    theta: Track,
    rate: Track,
    /// states of laws at the start, and how they change
    state: (Vec<f64>, Track),
}

fn value(p: &[f64], x: f64) -> f64 {
    p.iter().rev().fold(0.0, |sum, c| sum * (x - 0.5) + c)
}

/// The product of x - r over places r.
fn product(places: &[f64]) -> Vec<f64> {
    places.iter().fold(vec![1.0], |p, r| {
        let mut next = vec![0.0; p.len() + 1];
        for (k, c) in p.iter().enumerate() {
            next[k + 1] += c;
            next[k] -= c * (r - 0.5);
        }
        next
    })
}

/// The integral that is zero at the start.
fn integral(p: &[f64]) -> Vec<f64> {
    let mut out: Vec<f64> =
        std::iter::once(0.0).chain(p.iter().enumerate().map(|(k, c)| c / (k as f64 + 1.0))).collect();
    out[0] = -value(&out, 0.0);
    out
}

impl Basis {
    fn new(nodes: &'static [f64]) -> Self {
        let places: Vec<f64> = [0.0, 1.0].into_iter().chain(nodes.iter().copied()).collect();
        let w = integral(&product(&places));
        let whole = value(&w, 1.0);
        let slope = |i: usize| {
            let others: Vec<f64> = places.iter().enumerate().filter(|(k, _)| *k != i).map(|(_, p)| *p).collect();
            let p = integral(&product(&others));
            let (scale, part) = (value(&product(&others), places[i]), value(&p, 1.0) / whole);
            w.iter().enumerate().map(|(k, w)| (p.get(k).unwrap_or(&0.0) - part * w) / scale).collect()
        };
        Basis { nodes, slopes: (0..places.len()).map(slope).collect(), change: w.iter().map(|w| w / whole).collect() }
    }

    fn track(&self, change: &[f64], slopes: &[&[f64]], h: f64) -> Track {
        let degree = self.change.len() - 1;
        let mut coefficients = Vec::with_capacity(change.len() * (degree + 1));
        for (i, change) in change.iter().enumerate() {
            for (k, basis) in self.change.iter().enumerate() {
                let by_slopes: f64 = self.slopes.iter().zip(slopes).map(|(basis, slope)| basis[k] * slope[i]).sum();
                coefficients.push(basis * change + h * by_slopes);
            }
        }
        Track { degree, coefficients }
    }
}

impl Track {
    fn empty() -> Self {
        Track { degree: 0, coefficients: Vec::new() }
    }

    fn each(&self) -> std::slice::ChunksExact<'_, f64> {
        self.coefficients.chunks_exact(self.degree + 1)
    }

    fn at(&self, x: f64) -> Vec<f64> {
        self.each().map(|p| value(p, x)).collect()
    }

    /// By the fraction of the step.
    fn slope(&self, x: f64) -> Vec<f64> {
        let of = |p: &[f64]| (1..p.len()).rev().fold(0.0, |sum, k| sum * (x - 0.5) + k as f64 * p[k]);
        self.each().map(of).collect()
    }
}

impl<'i> Curve<'i> {
    pub fn through(eq: &Equations<'_, f64>, ends: &Ends<'i>, basis: &Basis, inner: &[Node]) -> Self {
        let Ends { from, to, h, theta, accelerations: (start, end) } = *ends;
        let change = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| b - a).collect::<Vec<f64>>();
        let at_nodes = inner.iter().map(|n| &*n.acceleration);
        let slopes: Vec<&[f64]> = [start, end].into_iter().chain(at_nodes).collect();
        let rate = basis.track(&change(&from.rate, &to.rate), &slopes, h);
        let turned = |(node, x): (&Node, &f64)| {
            let v: Vec<f64> = from.rate.iter().zip(rate.at(*x)).map(|(v, d)| v + d).collect();
            eq.increment_rates(&eq.difference(from, &node.motion), &v)
        };
        let last = eq.increment_rates(theta, &to.rate);
        let at_nodes: Vec<Vec<f64>> = inner.iter().zip(basis.nodes).map(turned).collect();
        let slopes: Vec<&[f64]> = [&*from.rate, &last].into_iter().chain(at_nodes.iter().map(|v| &**v)).collect();
        let theta = basis.track(theta, &slopes, h);
        let mut state = (Vec::new(), Track::empty());
        if eq.has_state_rates() {
            let (begin, last) = (eq.states(from), eq.states(to));
            let ends = [from, to].map(|m| eq.state_rates(m));
            let slopes: Vec<&[f64]> = ends.iter().chain(inner.iter().map(|n| &n.state_rates)).map(|v| &**v).collect();
            let track = basis.track(&change(&begin, &last), &slopes, h);
            state = (begin, track);
        }
        Curve { from, h, theta, rate, state }
    }

    /// The motion at a fraction of the step, and the slopes there.
    pub fn at(&self, eq: &Equations<'_, f64>, x: f64) -> Node {
        let mut m = self.from.moved(eq.topology(), &self.theta.at(x));
        m.t += x * self.h;
        m.rate.iter_mut().zip(self.rate.at(x)).for_each(|(v, d)| *v += d);
        let (start, track) = &self.state;
        if !start.is_empty() {
            let states: Vec<f64> = start.iter().zip(track.at(x)).map(|(z, d)| z + d).collect();
            eq.set_states(&mut m, &states, 0.0);
        }
        let slope = |track: &Track| track.slope(x).into_iter().map(|s| s / self.h).collect();
        Node { motion: m, acceleration: slope(&self.rate), state_rates: slope(track) }
    }
}

/// What holds at motions of a curve that is less accurate.
pub fn evaluated<'m>(
    eq: &Equations<'_, f64>,
    motions: impl IntoIterator<Item = &'m Motion<f64>>,
    counts: &mut Counts,
) -> Result<Vec<Node>> {
    let one = |m: &Motion<f64>| {
        let Instant { motion, acceleration, .. } = eq.instant(m.clone(), counts)?;
        let state_rates = eq.state_rates(&motion);
        Ok(Node { motion, acceleration, state_rates })
    };
    motions.into_iter().map(one).collect()
}

/// With rates of their own, through those of both ends and the accelerations there: of schemes of which a step's increment and rates agree
/// to its accuracy only, slopes of increments are less accurate than rates.
pub fn with_own_rates(
    eq: &Equations<'_, f64>,
    from: &Instant,
    to: &Instant,
    h: f64,
    fractions: &[f64],
    motions: Vec<Motion<f64>>,
) -> Vec<Between> {
    let theta = eq.difference(&from.motion, &to.motion);
    let accelerations = (&*from.acceleration, &*to.acceleration);
    let ends = Ends { from: &from.motion, to: &to.motion, h, theta: &theta, accelerations };
    let curve = Curve::through(eq, &ends, &NONE, &[]);
    let with = |(m, x): (Motion<f64>, &f64)| Motion { rate: curve.at(eq, *x).motion.rate, ..m }.into();
    motions.into_iter().zip(fractions).map(with).collect()
}

/// Where nothing is stiff: on the curve through what holds at nodes of another.
pub fn refined(
    eq: &Equations<'_, f64>,
    ends: &Ends<'_>,
    (basis, motions): (&Basis, &[Motion<f64>]),
    fractions: &[f64],
    counts: &mut Counts,
) -> Result<Vec<Between>> {
    let curve = Curve::through(eq, ends, basis, &evaluated(eq, motions, counts)?);
    let at = |x: &f64| {
        let Node { motion, acceleration, .. } = curve.at(eq, *x);
        Between { motion, slope: Some(acceleration) }
    };
    Ok(fractions.iter().map(at).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_polynomial_of_its_degree_is_met() {
        let y = |x: f64| 0.3 * x + 0.7 * x * x - 1.1 * x.powi(3) + 0.4 * x.powi(6) + 2.0 * x.powi(7);
        let d = |x: f64| 0.3 + 1.4 * x - 3.3 * x * x + 2.4 * x.powi(5) + 14.0 * x.powi(6);
        let slopes: Vec<Vec<f64>> = [0.0, 1.0].iter().chain(FOUR.nodes).map(|x| vec![d(*x) / 0.5]).collect();
        let slopes: Vec<&[f64]> = slopes.iter().map(|s| &**s).collect();
        let track = FOUR.track(&[y(1.0)], &slopes, 0.5);
        for x in [0.0, 0.2, 0.77, 1.0] {
            assert!((track.at(x)[0] - y(x)).abs() < 1e-13);
            assert!((track.slope(x)[0] - d(x)).abs() < 1e-12);
        }
    }
}
