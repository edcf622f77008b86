//! Which damped modes lie nearest to a frequency, and whether none is missing.
//!
//! With -tau H <= C <= tau H, H = K + mu M, every root of s^2 M + s C + K has a root lambda of K x = lambda M x with
//!
//! ```text
//! |s^2 + lambda| <= tau |s| (lambda + mu),   |s| within -+ a/2 + sqrt(a^2/4 + |lambda|),   a = tau (lambda + mu)
//! ```
//! The same holds while damping grows from zero to C. Intervals of |s| that touch make a cluster, no root enters or leaves it on the
//! way, and it holds two roots for each of its lambda. Inertia proves tau, and that all lambda near the shift are known.
use crate::error::Result;
use crate::linalg::sparse::Csc;
use crate::linearize::sparse_bodies::augmented;
use crate::linearize::sparse_form::SparseForm;
use crate::second_order::modal::Modal;
use crate::second_order::sparse_pencil::{Mixed, Pencil};
use crate::tolerances::sparse_modes::SAME_VALUE;

/// Steps by which tau grows, and how often the last of them is halved.
const GROWTH: f64 = 4.0;
const HALVINGS: usize = 3;

/// |s|^2 - sigma of a root, without its sign.
fn distance(modal: &Modal, k: usize, sigma: f64) -> f64 {
    (modal.s[k].norm_sqr() - sigma).abs()
}

/// Modes of which at least half belongs to the first `known` vectors of an orthonormal basis: what widens the basis has roots of its own.
pub fn candidates(modal: &Modal, known: usize) -> Vec<usize> {
    let part = |k: usize, rows: usize| (0..rows).map(|i| modal.shape[(i, k)].norm_sqr()).sum::<f64>();
    let all = modal.shape.nrows();
    (0..modal.s.len()).filter(|k| 2.0 * part(*k, known.min(all)) >= part(*k, all)).collect()
}

/// The n candidates nearest to the shift, in ascending order.
pub fn nearest(modal: &Modal, known: usize, n: usize, sigma: f64) -> Vec<usize> {
    let mut all = candidates(modal, known);
    all.sort_by(|a, b| distance(modal, *a, sigma).total_cmp(&distance(modal, *b, sigma)));
    all.truncate(n);
    all.sort_unstable();
    all
}

/// What is known of a damped system around a shift.
pub struct Around<'a> {
    pub form: &'a SparseForm,
    pub pencil: &'a Mixed,
    pub sigma: f64,
    /// all lambda nearer to the shift than the last of them
    pub lambda: &'a [f64],
    /// the largest x^T C x of their shapes, of unit mass, over lambda + mu is a first guess of tau
    pub work: &'a [f64],
}

impl Around<'_> {
    /// True if it is proved that no root is nearer to the shift than the chosen ones. `error` of the candidates is relative.
    pub fn is_complete(&self, modal: &Modal, chosen: &[usize], candidates: &[usize], error: &[f64]) -> Result<bool> {
        let sigma = self.sigma;
        let blur = |i: usize| 2.0 * error[i] * modal.s[candidates[i]].norm_sqr();
        let is_chosen = |i: &usize| chosen.contains(&candidates[*i]);
        let places: Vec<usize> = (0..candidates.len()).collect();
        let far = |i: &usize| distance(modal, candidates[*i], sigma);
        let reach = places.iter().filter(|i| is_chosen(i)).map(far).fold(0.0, f64::max);
        let blurred = places.iter().filter(|i| is_chosen(i)).map(|i| far(i) + blur(*i)).fold(0.0, f64::max);
        let mu = sigma + blurred;
        let known = self.lambda.iter().map(|l| (l - sigma).abs()).fold(0.0, f64::max) * (1.0 - SAME_VALUE);
        let edge = sigma - known;
        // whether an unknown lambda below zero is as near as one above
        if self.pencil.count_below(-edge.abs() * (1.0 + SAME_VALUE)) != Some(0) {
            return Ok(false);
        }
        let Some(tau) = self.tau(mu)? else { return Ok(false) };
        let interval = |lambda: f64| {
            let a = 0.5 * tau * (lambda + mu).max(0.0);
            let root = (a * a + lambda.abs()).sqrt();
            (if lambda == 0.0 { 0.0 } else { lambda.abs() / (a + root) }, a + root)
        };
        let mut window = ((sigma - blurred).max(0.0).sqrt(), (sigma + blurred).sqrt());
        let own: Vec<(f64, f64)> = self.lambda.iter().map(|l| interval(*l)).collect();
        loop {
            let touching = own.iter().filter(|i| i.0 <= window.1 && window.0 <= i.1);
            let wider = touching.fold(window, |w, i| (w.0.min(i.0), w.1.max(i.1)));
            if wider == window {
                break;
            }
            window = wider;
        }
        let clear = window.1 < interval(sigma + known).0 && (edge <= 0.0 || interval(edge).1 < window.0);
        let inside = |r: f64| window.0 <= r && r <= window.1;
        let there = 2 * own.iter().filter(|i| inside(i.0) && inside(i.1)).count();
        let roots = |i: &usize| {
            let k = candidates[*i];
            usize::from(inside(modal.s[k].norm())) + usize::from(inside(modal.partner[k].norm()))
        };
        let found: usize = places.iter().map(roots).sum();
        let farther = |i: &usize| is_chosen(i) || roots(i) == 0 || far(i) - blur(*i) >= reach * (1.0 - SAME_VALUE);
        Ok(clear && there == found && places.iter().all(farther))
    }

    /// The least tau, to a fifth, with -tau H <= C <= tau H; None where it would part nothing.
    fn tau(&self, mu: f64) -> Result<Option<f64>> {
        let guess = self.work.iter().zip(self.lambda).map(|(w, l)| w.abs() / (l + mu)).fold(0.0, f64::max);
        // damping as large as the critical one at the shift
        let most = 1.0 / mu.sqrt();
        let (mut low, mut high) = (f64::NAN, guess.max(SAME_VALUE * most));
        while !self.bounds(high, mu)? {
            (low, high) = (high, GROWTH * high);
            if high.is_nan() || high > most {
                return Ok(None);
            }
        }
        for _ in 0..if low.is_nan() { 0 } else { HALVINGS } {
            let middle = (low * high).sqrt();
            if self.bounds(middle, mu)? { high = middle } else { low = middle }
        }
        Ok(Some(high))
    }

    /// Is tau (K + mu M) -+ C positive definite? In the mixed form, over tau.
    fn bounds(&self, tau: f64, mu: f64) -> Result<bool> {
        let n = self.form.size();
        for sign in [1.0, -1.0] {
            let mut entries = self.form.stiffness.clone();
            entries.extend(self.form.damping.iter().map(|(i, j, v)| (*i, *j, sign * v / tau)));
            let mass = Csc::from_entries(n, n, self.form.mass.clone());
            if Mixed::new(mass, augmented(self.form, entries))?.count_below(-mu) != Some(0) {
                return Ok(false);
            }
        }
        Ok(true)
    }
}
