//! The periodic state of a law with z' = g(u, v, z) along a periodic motion that is known at samples, and its derivatives.
//!
//! Two intervals of length d at a time by the Lobatto IIIA formula of order four, which needs no other instants than the samples:
//! ```text
//! z1 = z0 + 2 d (5/24 g0 + 1/3 g1 - 1/24 g2),     z2 = z0 + 2 d (1/6 g0 + 2/3 g1 + 1/6 g2)
//! ```
//! The start z0 of the period is found by Newton's method on z(T) = z0, from the state at rest: where the motion leaves it free (a cycle that
//! dissipates nothing) it stays as it is. E. Hairer, G. Wanner, Solving Ordinary Differential Equations II, 1996, table IV.5.7.
use crate::error::{Error, Result};
use crate::force::{AnyLaw, OfState, StateSlopes, constants};
use crate::solve::nan_or_largest;
use crate::tolerances::periodic::ROW_ROUNDING;

/// Weights of g0, g1, g2, over the length of both intervals.
const INNER: [f64; 3] = [5.0 / 24.0, 1.0 / 3.0, -1.0 / 24.0];
const OUTER: [f64; 3] = [1.0 / 6.0, 2.0 / 3.0, 1.0 / 6.0];
const NEWTON_STEPS: usize = 40;
/// Of a step, at most.
const HALVINGS: i32 = 20;
const PERIODS: usize = 200;
/// Interval times slope of the rate below which a first guess follows the rate; only speed depends on it.
const STRAIGHT: f64 = 0.5;

/// Displacements and rates at the samples, and the time between two.
#[derive(Clone, Copy)]
pub struct Samples<'a> {
    pub u: &'a [f64],
    pub v: &'a [f64],
    pub interval: f64,
}

/// A law with one state along a period.
pub struct PeriodicState {
    /// at the samples: force and rate with their slopes
    pub at: Vec<StateSlopes>,
    interval: f64,
    /// dz(T)/dz0
    growth: f64,
}

/// Changes at the samples: of u and v, and of the interval by a part of it.
pub struct Change<'a> {
    pub u: Option<&'a [f64]>,
    pub v: Option<&'a [f64]>,
    pub stretch: f64,
}

impl PeriodicState {
    /// From the state `rest` on.
    pub fn new(law: AnyLaw, p: &[f64], samples: Samples<'_>, rest: f64) -> Result<Self> {
        let n = samples.u.len();
        if n % 2 == 1 {
            return Err(Error::model(
                "laws whose state has a rate need an even number of samples; give another n_samples=",
            ));
        }
        let p = &constants(p);
        let (mut z0, mut out) = (rest, PeriodicState { at: Vec::new(), interval: samples.interval, growth: 1.0 });
        for _ in 0..PERIODS {
            let end = out.march(law, p, samples, z0)?;
            let size = out.at.iter().fold(0.0_f64, |s, at| s.max(at.z.abs()));
            let loss = 1.0 - out.growth;
            let rounding = period_rounding(n);
            if (end - z0).abs() <= rounding * size || loss.abs() < rounding {
                return Ok(out);
            }
            // a start outside of what the law can reach goes on with the period
            let next = z0 + (end - z0) / loss;
            z0 = if next.abs() <= 2.0 * size.max(end.abs()) { next } else { end };
        }
        Err(Error::Convergence {
            message: "the state of a law found no periodic motion".into(),
            best: Vec::new(),
            residual: f64::NAN,
        })
    }

    /// z(T) from z0, with the growth of a change of z0.
    fn march(&mut self, law: AnyLaw, p: &[OfState], samples: Samples<'_>, z0: f64) -> Result<f64> {
        let (n, h) = (samples.u.len(), 2.0 * samples.interval);
        let at = |j: usize, z: f64| law.state_slopes(samples.u[j % n], samples.v[j % n], p, z);
        self.at.clear();
        let mut first = at(0, z0);
        let mut growth = 1.0;
        for j in (0..n).step_by(2) {
            // where a step does not bend much its start tells where it leads
            let onward = if h * first.rate[3].abs() < STRAIGHT { 0.5 * h * first.rate[0] } else { 0.0 };
            let (middle, end) = (at(j + 1, first.z + onward), at(j + 2, first.z + 2.0 * onward));
            let guess = Pair { first, middle, end, h };
            let Some(Pair { middle, end, .. }) = settled(guess, |k, z| at(j + k, z)) else {
                return Err(Error::Convergence {
                    message: "the state of a law has no solution between two samples; take more with n_samples=".into(),
                    best: Vec::new(),
                    residual: f64::NAN,
                });
            };
            growth *= solve(h, &middle, &end, [INNER, OUTER].map(|w| 1.0 + h * w[0] * first.rate[3]))[1];
            self.at.push(first);
            self.at.push(middle);
            first = end;
        }
        self.growth = growth;
        Ok(first.z)
    }

    /// dz at the samples for a change of the motion.
    pub fn along(&self, change: &Change<'_>, dz: &mut [f64]) {
        let loss = 1.0 - self.growth;
        let end = self.carried(change, 0.0, dz);
        if loss.abs() >= period_rounding(self.at.len()) {
            self.carried(change, end / loss, dz);
        }
    }

    fn carried(&self, change: &Change<'_>, start: f64, dz: &mut [f64]) -> f64 {
        let (n, h) = (self.at.len(), 2.0 * self.interval);
        let driven = |j: usize| {
            let rate = self.at[j % n].rate;
            let by = |d: Option<&[f64]>, slope: f64| d.map_or(0.0, |d| d[j % n] * slope);
            by(change.u, rate[1]) + by(change.v, rate[2]) + change.stretch * rate[0]
        };
        let mut d = start;
        for j in (0..n).step_by(2) {
            let (first, middle, end) = (&self.at[j], &self.at[j + 1], &self.at[(j + 2) % n]);
            let driven = [first.rate[3] * d + driven(j), driven(j + 1), driven(j + 2)];
            let [dm, de] = solve(h, middle, end, [INNER, OUTER].map(|w| d + h * weighed(w, driven)));
            dz[j] = d;
            dz[j + 1] = dm;
            d = de;
        }
        d
    }
}

/// Rounding of a state after a period of n intervals, and of what the period leaves of a change of it: relative to each.
fn period_rounding(n: usize) -> f64 {
    ROW_ROUNDING * f64::EPSILON * n as f64
}

/// The start and the two unknown states of two intervals of length h together.
#[derive(Clone, Copy)]
struct Pair {
    first: StateSlopes,
    middle: StateSlopes,
    end: StateSlopes,
    h: f64,
}

impl Pair {
    /// What the two equations lack.
    fn miss(&self) -> [f64; 2] {
        let rates = [self.first.rate[0], self.middle.rate[0], self.end.rate[0]];
        let by = |w, z: f64| self.first.z + self.h * weighed(w, rates) - z;
        [by(INNER, self.middle.z), by(OUTER, self.end.z)]
    }

    /// Whether that is rounding of the terms of each equation.
    fn is_solved(&self) -> bool {
        let all = [self.first, self.middle, self.end];
        let rates = all.map(|at| at.rate_size);
        let allowed = |w: [f64; 3], z: f64| {
            let terms = self.first.z.abs() + z.abs() + self.h * weighed(w.map(f64::abs), rates);
            ROW_ROUNDING * f64::EPSILON * terms
        };
        let miss = self.miss();
        miss[0].abs() <= allowed(INNER, self.middle.z) && miss[1].abs() <= allowed(OUTER, self.end.z)
    }
}

/// Newton's method, whose steps are halved until what the equations lack has become less (rates may bend where z changes its sign);
/// None where the residual that is left is more than rounding. `at(k, z)`: the law at the middle (1) and the end (2).
fn settled(mut here: Pair, at: impl Fn(usize, f64) -> StateSlopes) -> Option<Pair> {
    let size = |pair: &Pair| nan_or_largest(pair.miss().into_iter().map(f64::abs));
    for _ in 0..NEWTON_STEPS {
        let [dm, de] = solve(here.h, &here.middle, &here.end, here.miss());
        let beside =
            |part: f64| Pair { middle: at(1, here.middle.z + part * dm), end: at(2, here.end.z + part * de), ..here };
        let lower = |part: f64, next: &Pair| size(next) <= (1.0 - 0.25 * part) * size(&here);
        let tried = (0..HALVINGS).map(|k| 0.5_f64.powi(k)).map(|part| (part, beside(part)));
        match tried.into_iter().find(|(part, next)| lower(*part, next)) {
            Some((_, next)) => here = next,
            None => break,
        }
        if here.is_solved() {
            return Some(here);
        }
    }
    here.is_solved().then_some(here)
}

fn weighed(w: [f64; 3], g: [f64; 3]) -> f64 {
    w[0] * g[0] + w[1] * g[1] + w[2] * g[2]
}

/// Changes of the middle and the end, whose equations have these right sides.
fn solve(h: f64, middle: &StateSlopes, end: &StateSlopes, right: [f64; 2]) -> [f64; 2] {
    let (gm, ge) = (h * middle.rate[3], h * end.rate[3]);
    let [[a, b], [c, d]] = [[1.0 - INNER[1] * gm, -INNER[2] * ge], [-OUTER[1] * gm, 1.0 - OUTER[2] * ge]];
    let determinant = a * d - b * c;
    [(right[0] * d - b * right[1]) / determinant, (a * right[1] - c * right[0]) / determinant]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// On u = cos t the force is that of the complex stiffness k i tau/(1 + i tau), to the order of the formula.
    #[test]
    fn a_maxwell_element_has_its_complex_stiffness() {
        let (k, tau) = (2.3, 0.7);
        let law = AnyLaw::from_code(12, 2).unwrap();
        let miss = |n: usize| {
            let interval = std::f64::consts::TAU / n as f64;
            let u: Vec<f64> = (0..n).map(|j| (interval * j as f64).cos()).collect();
            let v = vec![0.0; n];
            let state = PeriodicState::new(law, &[k, tau], Samples { u: &u, v: &v, interval }, 0.0).unwrap();
            let (re, im) = (k * tau * tau / (1.0 + tau * tau), k * tau / (1.0 + tau * tau));
            let exact = |j: usize| re * (interval * j as f64).cos() - im * (interval * j as f64).sin();
            (0..n).map(|j| (state.at[j].force[0] - exact(j)).abs()).fold(0.0, f64::max)
        };
        assert!(miss(64) < 1e-5 && miss(64) / miss(128) > 12.0, "{} {}", miss(64), miss(128));
    }

    /// Derivatives of the periodic state against differences of it.
    #[test]
    fn changes_follow_the_motion() {
        let n = 64;
        let interval = std::f64::consts::TAU / n as f64 / 1.3;
        let turn = |j: usize| std::f64::consts::TAU * j as f64 / n as f64;
        let u = |a: f64| -> Vec<f64> { (0..n).map(|j| a * turn(j).cos() + 0.2 * (2.0 * turn(j)).sin()).collect() };
        let v = |a: f64, w: f64| -> Vec<f64> {
            (0..n).map(|j| w * (-a * turn(j).sin() + 0.4 * (2.0 * turn(j)).cos())).collect()
        };
        let laws: [(i64, &[f64]); 3] =
            [(12, &[2.3, 0.7]), (13, &[3.0, 0.1, 4.0, 1.5, 1.7]), (14, &[1.0, 1.5, 0.1, 30.0, 0.6, 0.4])];
        for (code, p) in laws {
            let law = AnyLaw::from_code(code, p.len()).unwrap();
            let z = |a: f64, w: f64| -> Vec<f64> {
                let (u, v) = (u(a), v(a, w));
                let samples = Samples { u: &u, v: &v, interval: interval * 1.3 / w };
                PeriodicState::new(law, p, samples, 0.0).unwrap().at.iter().map(|at| at.z).collect()
            };
            let (u0, v0) = (u(1.0), v(1.0, 1.3));
            let state = PeriodicState::new(law, p, Samples { u: &u0, v: &v0, interval }, 0.0).unwrap();
            let (du, dv): (Vec<f64>, Vec<f64>) =
                ((0..n).map(|j| turn(j).cos()).collect(), (0..n).map(|j| -1.3 * turn(j).sin()).collect());
            let mut dz = vec![0.0; n];
            let h = 1e-6;
            state.along(&Change { u: Some(&du), v: Some(&dv), stretch: 0.0 }, &mut dz);
            let (high, low) = (z(1.0 + h, 1.3), z(1.0 - h, 1.3));
            for j in 0..n {
                assert!((dz[j] - (high[j] - low[j]) / (2.0 * h)).abs() < 1e-6, "{code} {j}");
            }
            let faster: Vec<f64> = v0.iter().map(|v| v / 1.3).collect();
            state.along(&Change { u: None, v: Some(&faster), stretch: -1.0 / 1.3 }, &mut dz);
            let (high, low) = (z(1.0, 1.3 + h), z(1.0, 1.3 - h));
            for j in 0..n {
                assert!((dz[j] - (high[j] - low[j]) / (2.0 * h)).abs() < 1e-6, "{code} {j}");
            }
        }
    }

    /// Two intervals at rest: the equations are the differences of the three states.
    #[test]
    fn states_are_solved_up_to_their_bound() {
        let at = |z: f64| StateSlopes { z, force: [0.0; 4], rate: [0.0; 4], rate_size: 0.0 };
        let solved = |off: f64| Pair { first: at(1.0), middle: at(1.0 + off), end: at(1.0), h: 1.0 }.is_solved();
        assert!(solved(0.0) && solved(30.0 * f64::EPSILON) && !solved(34.0 * f64::EPSILON));
    }

    /// Random laws on random motions in random units, also sampled far too coarsely: what is accepted solves the formula.
    #[test]
    fn every_accepted_state_solves_its_equations() {
        let mut seed = 7_u64;
        let mut random = move || {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (seed >> 11) as f64 / (1_u64 << 53) as f64
        };
        let (mut accepted, mut refused) = (0, 0);
        for trial in 0..600 {
            let n = 2 * (2 + (6.0 * random()) as usize * (1 + (8.0 * random()) as usize));
            let mut log = |decades: f64| 10_f64.powf(decades * (random() - 0.5));
            let (length, time) = (log(12.0), log(12.0));
            let speed = length / time;
            let (code, p) = match trial % 3 {
                0 => (12, vec![log(9.0), log(6.0) * time]),
                1 => {
                    let n = 1.0 + 3.0 * log(2.0);
                    let bound = length * log(4.0);
                    (13, vec![log(9.0), 0.1, bound.powf(-n) * log(0.6), bound.powf(-n) * (log(0.6) - 1.0), n])
                }
                _ => {
                    let force = log(9.0);
                    let most = force * (1.0 + log(1.0));
                    (14, vec![force, most, speed * log(4.0), force / length * log(6.0), 0.0, 0.0])
                }
            };
            let law = AnyLaw::from_code(code, p.len()).unwrap();
            let interval = std::f64::consts::TAU * time / n as f64;
            let (a, b, c) = (random() - 0.5, random() - 0.5, random());
            let turn = |j: usize| std::f64::consts::TAU * j as f64 / n as f64 + c;
            let u: Vec<f64> = (0..n).map(|j| length * (a * turn(j).cos() + b * (3.0 * turn(j)).sin())).collect();
            let v: Vec<f64> = (0..n).map(|j| speed * (-a * turn(j).sin() + 3.0 * b * (3.0 * turn(j)).cos())).collect();
            let samples = Samples { u: &u, v: &v, interval };
            let mut state = PeriodicState { at: Vec::new(), interval, growth: 1.0 };
            let numbers = constants(&p);
            let Ok(end) = state.march(law, &numbers, samples, length * (random() - 0.5)) else {
                refused += 1;
                continue;
            };
            accepted += 1;
            let z: Vec<f64> = state.at.iter().map(|at| at.z).chain([end]).collect();
            let rate = |j: usize, z: f64| -> f64 { law.state_slopes(u[j % n], v[j % n], &numbers, z).rate[0] };
            for j in (0..n).step_by(2) {
                let g = [0, 1, 2].map(|k| rate(j + k, z[j + k]));
                // a change of z by its rounding changes the rates
                let felt = [0, 1, 2].map(|k| {
                    let beside = rate(j + k, z[j + k] * (1.0 + 1e-8)) - g[k];
                    g[k].abs() + v[(j + k) % n].abs() + 1e8 * beside.abs()
                });
                for (k, w) in [(1, INNER), (2, OUTER)] {
                    let h = 2.0 * interval;
                    let miss = z[j] + h * weighed(w, g) - z[j + k];
                    let terms = z[j].abs() + z[j + k].abs() + h * weighed(w.map(f64::abs), felt);
                    assert!(miss.abs() <= 1e-14 * terms, "{trial}: {miss:.1e} of {terms:.1e}");
                }
            }
        }
        assert!(accepted > 400, "{accepted} accepted, {refused} refused");
    }
}
