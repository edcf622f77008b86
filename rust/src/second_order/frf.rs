//! Transfer functions H(omega) = L Z^-1 F, Z = S - omega^2 M + i omega D, time dependence exp(+i omega t).
//!
//! Reduced once, then cheap per frequency, by the cheapest route that passes a check against refined direct solves:
//! real modes (undamped or proportional) O(n) per entry, complex modes O(n), a band of half-width b O(n b^2) at all, Hessenberg O(n^2),
//! direct O(n^3). Poles, which tell where to check and what points miss, are those of the modes but for damped bands (`frf_poles`).
use std::sync::Arc;

use faer::{Mat, c64};

use super::expansion::{ComplexModes, Expansion, RealModes};
use super::frf_banded::Banded;
use super::frf_routes::{Check, Entries, Evaluator, Solution, input_mix};
use super::frf_singular;
use super::linear_system::LinearSystem;
use super::ports::{Ports, complex, i_omega};
use super::state::StateSpace;
use crate::error::{Error, Result};
use crate::linalg::banded::Band;
use crate::linalg::complex_lanes::LANES;
use crate::linalg::hessenberg::Hessenberg;
use crate::linalg::quadratic::{Factored, NormalForm};
use crate::run::{Cancel, Counts};
use crate::tolerances::frequency_response::{
    ACCEPTED, ALL_MODES, BAND_FIRST, FEW, MOST_PORTS, REFINEMENTS, SAME_POLE, WORST_ACCEPTED, WORST_VECTORS, ZERO_ENTRY,
};

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Route {
    RealModes,
    ComplexModes,
    Banded,
    Hessenberg,
    Direct,
}

impl Route {
    pub fn name(self) -> &'static str {
        match self {
            Route::RealModes => "real modes",
            Route::ComplexModes => "complex modes",
            Route::Banded => "banded",
            Route::Hessenberg => "Hessenberg",
            Route::Direct => "direct",
        }
    }
}

pub struct Values {
    /// (n_out, n_in, n_freq), last index fastest
    pub h: Vec<c64>,
    pub route: Route,
    /// largest relative difference from refined direct solves at the checked frequencies
    pub error: f64,
    /// indices of frequencies where Z is singular
    pub singular: Vec<usize>,
    pub counts: Counts,
}

impl LinearSystem {
    /// After a band that goes before modes.
    fn routes(&self, expansion: &Expansion, banded_first: bool, ports: &Ports) -> Vec<Route> {
        let mut routes = Vec::new();
        match expansion {
            Expansion::Real(_) => routes.push(Route::RealModes),
            Expansion::Complex(modes) if modes.condition < WORST_VECTORS => routes.push(Route::ComplexModes),
            _ => {}
        }
        if !banded_first && self.band().is_some() {
            routes.push(Route::Banded);
        }
        // per frequency 4 n^2 (1 + outputs) operations against n^3 of a factorisation that runs about eight times faster
        let worth_reducing = self.size() > 22 * (1 + ports.n_out());
        if !matches!(expansion, Expansion::Real(_)) && worth_reducing && self.normal().is_some() {
            routes.push(Route::Hessenberg);
        }
        routes.push(Route::Direct);
        routes
    }

    /// H at the given frequencies, by the cheapest route that passes its check; with `keep` by that many lowest modes, checked
    /// alike but taken whatever comes out. Without `checked` the cheapest route is taken on trust.
    pub fn evaluate(
        &self,
        ports: &Ports,
        omega: &[f64],
        keep: Option<usize>,
        checked: bool,
        cancel: &Cancel,
    ) -> Result<Values> {
        ports.check(self.size())?;
        if ports.n_out() == 0 || ports.n_in() == 0 {
            return Err(Error::model("a transfer function needs at least one input and one output"));
        }
        if omega.iter().any(|w| !w.is_finite()) {
            return Err(Error::model("omega contains NaN or infinite values"));
        }
        let mut counts = Counts::default();
        let samples = if checked { samples(self.poles(&mut counts), omega) } else { Vec::new() };
        let checks = self.references(ports, omega, &samples, &mut counts);
        let limit = accepted(&checks);
        let measured = |evaluator: &Evaluator<'_>| {
            let distances = checks.iter().map(|check| {
                let w = omega[check.index];
                check.distance(evaluator.at(w)).max(check.entries.distance(evaluator, w, limit))
            });
            distances.fold(if checks.is_empty() { f64::NAN } else { f64::EPSILON }, f64::max)
        };
        let (route, evaluator, error) = match keep {
            Some(keep) => {
                let (route, evaluator) = self.truncated(self.expansion(&mut counts), ports, keep)?;
                let error = measured(&evaluator);
                (route, evaluator, error)
            }
            None if omega.len() <= FEW && !checks.is_empty() => self.refined(ports, &checks),
            None => self.cheapest(ports, omega.len(), &checks, measured, &mut counts),
        };
        counts.add("frequencies", omega.len() as u64);
        let (h, singular) = self.sweep(&evaluator, ports, omega, &mut counts, cancel)?;
        Ok(Values { h, route, error, singular, counts })
    }

    fn cheapest<'a>(
        &'a self,
        ports: &'a Ports,
        frequencies: usize,
        checks: &[Check<'_>],
        measured: impl Fn(&Evaluator<'_>) -> f64,
        counts: &mut Counts,
    ) -> (Route, Evaluator<'a>, f64) {
        let good = |route: Route, evaluator: Evaluator<'a>| {
            let error = measured(&evaluator);
            (error.is_nan() || error <= accepted(checks)).then_some((route, evaluator, error))
        };
        let band = self.band().filter(|band| self.banded_first(band, ports, frequencies, counts));
        if let Some(found) = band.and_then(|band| good(Route::Banded, self.banded(band, ports))) {
            return found;
        }
        let expansion = self.expansion(counts);
        let mut routes = self.routes(expansion, band.is_some(), ports).into_iter();
        let found = routes.find_map(|route| good(route, self.prepare(route, expansion, ports, counts)));
        found.unwrap_or_else(|| self.refined(ports, checks))
    }

    /// Is a band worth a try before modes, which lose the digits of small entries far away?
    fn banded_first(&self, band: &Band, ports: &Ports, frequencies: usize, counts: &mut Counts) -> bool {
        let (factorisation, column) = band.products();
        let own = (factorisation + column * ports.n_in()) as f64;
        let entries = (band.size() * ports.n_out() * ports.n_in()) as f64;
        if self.own_poles(counts).is_some() {
            // there are no modes yet, which are complex
            let modes = ALL_MODES * (band.size() as f64).powi(3);
            return frequencies as f64 * (own - BAND_FIRST * 2.0 * entries) <= modes;
        }
        match self.expansion(counts) {
            Expansion::Real(_) => own <= BAND_FIRST * entries,
            Expansion::Complex(_) => own <= BAND_FIRST * 2.0 * entries,
            Expansion::None => true,
        }
    }

    fn banded<'a>(&'a self, band: &'a Band, ports: &'a Ports) -> Evaluator<'a> {
        Evaluator::Banded { banded: Banded::new(band, self, ports), direct: Box::new(self.direct(ports, 0)) }
    }

    /// Direct solves with corrections from exact residuals, which keep every entry.
    fn refined<'a>(&'a self, ports: &'a Ports, checks: &[Check<'_>]) -> (Route, Evaluator<'a>, f64) {
        // each refinement contracts the error by what the first correction was
        (Route::Direct, self.direct(ports, REFINEMENTS), plain_error(checks).powi(4).max(f64::EPSILON))
    }

    /// Real or complex modes of the `keep` smallest |s|, a conjugate pair counting as one.
    fn truncated<'a>(&'a self, expansion: &Expansion, ports: &'a Ports, keep: usize) -> Result<(Route, Evaluator<'a>)> {
        let refuse = |why: &str| Err(Error::model(format!("modes = {keep}: {why}")));
        if keep == 0 || keep > self.size() {
            return refuse(&format!("the system has {}", self.size()));
        }
        match expansion {
            Expansion::Real(modes) => Ok((Route::RealModes, real_evaluator(modes, ports, keep))),
            Expansion::Complex(modes) if modes.condition < WORST_VECTORS => match self.normal() {
                Some(form) => Ok((Route::ComplexModes, complex_evaluator(form, modes, ports, keep))),
                None => refuse("its mass matrix is not positive definite"),
            },
            _ => refuse("the system has no well-conditioned modes to sum up; leave modes= out"),
        }
    }

    /// Complex modes whose expansion agrees with refined direct solves from the slowest to the fastest motion.
    pub fn trusted_modes(&self, ports: &Ports, counts: &mut Counts) -> Option<&ComplexModes> {
        let Expansion::Complex(modes) = self.expansion(counts) else { return None };
        let form = self.normal()?;
        if modes.condition >= WORST_VECTORS {
            return None;
        }
        // poles of free motions are zero
        let sizes = || modes.pole.iter().map(|s| s.norm()).filter(|s| *s > 0.0);
        let (slow, fast) = (sizes().fold(f64::MAX, f64::min), sizes().reduce(f64::max)?);
        let omega: Vec<f64> = (0..5).map(|k| slow * (fast / slow).powf(k as f64 / 4.0)).collect();
        let checks = self.references(ports, &omega, &[0, 1, 2, 3, 4], counts);
        let evaluator = complex_evaluator(form, modes, ports, self.size());
        let good = |check: &Check| check.distance(evaluator.at(omega[check.index])) < WORST_ACCEPTED;
        checks.iter().all(good).then_some(modes)
    }

    fn sweep(
        &self,
        evaluator: &Evaluator<'_>,
        ports: &Ports,
        omega: &[f64],
        counts: &mut Counts,
        cancel: &Cancel,
    ) -> Result<(Vec<c64>, Vec<usize>)> {
        let (n_out, n_in, n_freq) = (ports.n_out(), ports.n_in(), omega.len());
        let mut h = vec![c64::new(0.0, 0.0); n_out * n_in * n_freq];
        let mut singular = Vec::new();
        let found = omega.chunks(LANES).flat_map(|some| evaluator.several(some));
        for ((k, &w), value) in omega.iter().enumerate().zip(found) {
            cancel.check()?;
            let (value, powers_done) = match value {
                Some(value) => (value, false),
                None => {
                    let (value, is_singular) = frf_singular::transfer(self, ports, w)?;
                    counts.add("singular frequencies", is_singular as u64);
                    if is_singular {
                        singular.push(k);
                    }
                    // what only lies near a pole keeps the digits of the matrices themselves
                    match if is_singular { None } else { self.direct(ports, REFINEMENTS).at(w) } {
                        Some(refined) => (refined, false),
                        None => (value, true),
                    }
                }
            };
            for i in 0..n_out {
                for j in 0..n_in {
                    let order = ports.order_in[j] + ports.order_out;
                    let factor = if powers_done { c64::new(1.0, 0.0) } else { i_omega(w, order) };
                    let direct = ports.d0.as_ref().map_or(0.0, |d| d[(i, j)]);
                    let mut entry = scaled(value[(i, j)], factor);
                    if direct != 0.0 {
                        entry += i_omega(w, ports.order_out) * direct;
                    }
                    h[(i * n_in + j) * n_freq + k] = entry;
                }
            }
        }
        Ok((h, singular))
    }

    fn references<'a>(
        &'a self,
        ports: &'a Ports,
        omega: &[f64],
        samples: &[usize],
        counts: &mut Counts,
    ) -> Vec<Check<'a>> {
        let mix = input_mix(ports);
        let (inputs, outputs) = (spread(ports.n_in()), spread(ports.n_out()));
        let load = Mat::from_fn(self.size(), 1, |i, _| {
            let sum: f64 = mix.iter().enumerate().map(|(j, r)| ports.f[(i, j)] * r).sum();
            c64::new(sum, 0.0)
        });
        let each = Arc::new(Each::new(ports, inputs, outputs));
        let mut checks = Vec::new();
        for &index in samples {
            counts.add("check solves", 1);
            let factored = self.quadratic().factored(omega[index], self.scale());
            if let Some(solved) = factored.solve(load.as_ref(), REFINEMENTS) {
                let motion = (0..self.size()).map(|i| solved.x[(i, 0)].norm() / self.scale()[i]);
                checks.push(Check {
                    index,
                    plain_error: solved.error,
                    reference: complex(ports.l.as_ref()) * &solved.x,
                    motion: motion.fold(0.0, f64::max),
                    mix: mix.clone(),
                    unit: self.output_units(ports),
                    entries: each.clone().entries(ports, factored),
                });
            }
        }
        checks
    }

    fn output_units(&self, ports: &Ports) -> Vec<f64> {
        (0..ports.n_out())
            .map(|i| {
                let squares = (0..self.size()).map(|j| (ports.l[(i, j)] * self.scale()[j]).powi(2));
                squares.sum::<f64>().sqrt()
            })
            .collect()
    }

    fn prepare<'a>(
        &'a self,
        route: Route,
        expansion: &Expansion,
        ports: &'a Ports,
        counts: &mut Counts,
    ) -> Evaluator<'a> {
        if let (Route::RealModes, Expansion::Real(modes)) = (route, expansion) {
            return real_evaluator(modes, ports, self.size());
        }
        if let (Route::Banded, Some(band)) = (route, self.band()) {
            return self.banded(band, ports);
        }
        match (route, expansion, self.normal()) {
            (Route::ComplexModes, Expansion::Complex(modes), Some(form)) => {
                complex_evaluator(form, modes, ports, self.size())
            }
            (Route::Hessenberg, _, Some(form)) => {
                let state = StateSpace::new(form, ports);
                let reduced = self.hessenberg.get_or_init(|| {
                    counts.add("Hessenberg reductions", 1);
                    Hessenberg::new(state.a.as_ref())
                });
                Evaluator::Hessenberg {
                    reduced,
                    cq: reduced.outputs(state.c.as_ref()),
                    qb: reduced.inputs(state.b.as_ref()),
                }
            }
            _ => self.direct(ports, 0),
        }
    }

    fn direct<'a>(&'a self, ports: &'a Ports, refinements: usize) -> Evaluator<'a> {
        Evaluator::Direct {
            q: self.quadratic(),
            scale: self.scale(),
            l: complex(ports.l.as_ref()),
            f: complex(ports.f.as_ref()),
            refinements,
        }
    }
}

/// What a route may differ from refined direct solves.
fn accepted(checks: &[Check<'_>]) -> f64 {
    (10.0 * plain_error(checks)).clamp(ACCEPTED, WORST_ACCEPTED)
}

fn plain_error(checks: &[Check<'_>]) -> f64 {
    checks.iter().map(|c| c.plain_error).fold(0.0, f64::max)
}

/// Some of `count` ports, evenly.
fn spread(count: usize) -> Vec<usize> {
    let kept = count.min(MOST_PORTS);
    (0..kept).map(|k| k * count / kept).collect()
}

/// The inputs and outputs whose entries are compared, and their columns as right sides.
struct Each {
    inputs: Vec<usize>,
    outputs: Vec<usize>,
    /// Column of each output.
    column: Vec<usize>,
    /// Each input, each output as an input unless it equals one.
    load: Mat<c64>,
}

impl Each {
    fn new(ports: &Ports, inputs: Vec<usize>, outputs: Vec<usize>) -> Self {
        let n = ports.f.nrows();
        let (mut alone, mut column) = (Vec::new(), Vec::new());
        for &output in &outputs {
            let same = |&j: &usize| (0..n).all(|i| ports.f[(i, j)] == ports.l[(output, i)]);
            column.push(inputs.iter().position(same).unwrap_or(inputs.len() + alone.len()));
            if column.last().is_some_and(|j| *j >= inputs.len()) {
                alone.push(output);
            }
        }
        let load = Mat::from_fn(n, inputs.len() + alone.len(), |i, j| {
            let own = j < inputs.len();
            c64::new(if own { ports.f[(i, inputs[j])] } else { ports.l[(alone[j - inputs.len()], i)] }, 0.0)
        });
        Each { inputs, outputs, column, load }
    }

    fn entries<'a>(self: Arc<Self>, ports: &'a Ports, factored: Factored<'a>) -> Entries<'a> {
        let plain = self.solution(ports, &factored.plain(self.load.as_ref()));
        Entries {
            outputs: self.outputs.clone(),
            inputs: self.inputs.clone(),
            plain,
            refined: Box::new(move || {
                let solved = factored.solve(self.load.as_ref(), REFINEMENTS)?;
                Some(self.solution(ports, &solved.x))
            }),
        }
    }

    fn solution(&self, ports: &Ports, x: &Mat<c64>) -> Solution {
        let under_itself = |j: usize| (0..x.nrows()).map(|i| x[(i, j)] * self.load[(i, j)].re).sum::<c64>().norm();
        let (n_out, n_in) = (self.outputs.len(), self.inputs.len());
        let seen = |i: usize, j: usize| (0..x.nrows()).map(|k| x[(k, j)] * ports.l[(self.outputs[i], k)]).sum::<c64>();
        let zero = |i: usize, j: usize| ZERO_ENTRY * (under_itself(self.column[i]) * under_itself(j)).sqrt();
        Solution { value: Mat::from_fn(n_out, n_in, seen), zero: Mat::from_fn(n_out, n_in, zero) }
    }
}

/// Frequencies at which a route is compared with refined direct solves: the one that lies nearest to a pole, measured by its size, where
/// any error is largest, and the slowest and the fastest, where entries of weak couplings are smallest.
fn samples(poles: Option<&[c64]>, omega: &[f64]) -> Vec<usize> {
    let mut poles: Vec<c64> = poles.unwrap_or_default().iter().copied().filter(|p| p.im > 0.0).collect();
    poles.sort_by(|a, b| a.im.total_cmp(&b.im));
    let distance = |w: f64| {
        let at = poles.partition_point(|p| p.im < w.abs());
        let near = at.saturating_sub(1)..(at + 1).min(poles.len());
        let relative = near.map(|k| (c64::new(0.0, w.abs()) - poles[k]).norm() / poles[k].norm());
        relative.fold(f64::INFINITY, f64::min)
    };
    let mut found: Vec<usize> = Vec::new();
    let size = |k: usize| omega[k].abs();
    let orders: [&dyn Fn(usize) -> f64; 3] = [&|k| distance(omega[k]), &size, &|k| -size(k)];
    for order in orders {
        let left = (0..omega.len()).filter(|k| !found.contains(k));
        found.extend(left.min_by(|a, b| order(*a).total_cmp(&order(*b))));
    }
    found
}

fn real_evaluator<'a>(modes: &RealModes, ports: &Ports, keep: usize) -> Evaluator<'a> {
    let highest = modes.lambda.iter().fold(0.0_f64, |a, l| a.max(l.abs()));
    let kept = lowest(&modes.lambda, keep, |l| l.abs());
    let shape = columns(&modes.shape, &kept);
    Evaluator::Real {
        lambda: kept.iter().map(|k| modes.lambda[*k]).collect(),
        noise: kept.iter().map(|k| modes.noise[*k].min(4.0 * f64::EPSILON * highest)).collect(),
        damping: kept.iter().map(|k| modes.damping[*k]).collect(),
        left: &ports.l * &shape,
        right: complex((shape.transpose() * &ports.f).as_ref()),
    }
}

fn complex_evaluator<'a>(form: &NormalForm, modes: &ComplexModes, ports: &Ports, keep: usize) -> Evaluator<'a> {
    let state = StateSpace::new(form, ports);
    let largest = modes.pole.iter().fold(0.0_f64, |a, s| a.max(s.norm()));
    let kept = lowest(&modes.pole, 2 * keep, |s| s.norm());
    let right = modes.coordinates(state.b.as_ref());
    Evaluator::Complex {
        pole: kept.iter().map(|k| modes.pole[*k]).collect(),
        left: columns(&modes.outputs(state.c.as_ref()), &kept),
        right: Mat::from_fn(kept.len(), right.ncols(), |i, j| right[(kept[i], j)]),
        noise: 4.0 * f64::EPSILON * largest,
    }
}

fn columns<T: Copy>(a: &Mat<T>, kept: &[usize]) -> Mat<T> {
    Mat::from_fn(a.nrows(), kept.len(), |i, j| a[(i, kept[j])])
}

/// Indices of the `keep` smallest in their own order; equal sizes, such as conjugate pairs, are not cut apart.
fn lowest<T: Copy>(values: &[T], keep: usize, size: impl Fn(T) -> f64) -> Vec<usize> {
    let mut sizes: Vec<f64> = values.iter().map(|v| size(*v)).collect();
    if keep >= values.len() {
        return (0..values.len()).collect();
    }
    sizes.sort_by(f64::total_cmp);
    let limit = sizes[keep - 1] * (1.0 + SAME_POLE);
    (0..values.len()).filter(|k| size(values[*k]) <= limit).collect()
}

/// A product that leaves infinite entries infinite instead of making NaN of inf * 0.
fn scaled(value: c64, factor: c64) -> c64 {
    if value.is_finite() { value * factor } else { value }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::second_order::linear_system::Matrices;

    fn chain(n: usize, c: impl Fn(usize) -> f64) -> LinearSystem {
        let tri = |i: usize, j: usize| match i.abs_diff(j) {
            0 => 2.0,
            1 => -1.0,
            _ => 0.0,
        };
        let m = Mat::identity(n, n);
        let d = Mat::from_fn(n, n, |i, j| if i == j { c(i) } else { 0.0 });
        LinearSystem::new(Matrices { m, c: Some(d), g: None, k: Mat::from_fn(n, n, tri), n: None }).unwrap()
    }

    fn end_to_end(n: usize) -> Ports {
        Ports {
            l: Mat::from_fn(1, n, |_, j| (j + 1 == n) as u8 as f64),
            f: Mat::from_fn(n, 1, |i, _| (i == 0) as u8 as f64),
            order_in: vec![0],
            order_out: 0,
            d0: None,
        }
    }

    #[test]
    fn each_damping_takes_its_route_and_agrees_with_direct_solves() {
        let omega: Vec<f64> = (0..40).map(|k| 0.05 * k as f64 + 0.01).collect();
        let cases: [(LinearSystem, Route); 3] = [
            (chain(12, |_| 0.0), Route::RealModes),
            (chain(12, |_| 0.03), Route::RealModes),
            (chain(12, |i| 0.01 * i as f64), Route::ComplexModes),
        ];
        for (system, route) in cases {
            let values = system.evaluate(&end_to_end(12), &omega, None, true, &Cancel::default()).unwrap();
            assert_eq!(values.route, route);
            let ports = end_to_end(12);
            let direct = system.direct(&ports, 3);
            for (k, w) in omega.iter().enumerate() {
                let expected = direct.at(*w).unwrap()[(0, 0)];
                assert!((values.h[k] - expected).norm() < 1e-11 * expected.norm().max(1e-3));
            }
        }
    }

    #[test]
    fn critical_damping_falls_back_to_hessenberg() {
        // a row of equal critically damped oscillators, each driven by the next: one defective double root
        let n = 60;
        let m = Mat::identity(n, n);
        let d = Mat::from_fn(n, n, |i, j| if i == j { 2.0 } else { 0.0 });
        let s = Mat::from_fn(n, n, |i, j| match j.wrapping_sub(i) {
            0 => 1.0,
            1 => -0.9,
            _ => 0.0,
        });
        // in coordinates that mix all of them: the row itself is a narrow band
        let u = |i: usize| (1.0 + i as f64).cos();
        let square: f64 = (0..n).map(|i| u(i) * u(i)).sum();
        let mixed = Mat::from_fn(n, n, |i, j| f64::from(u8::from(i == j)) - 2.0 * u(i) * u(j) / square);
        let k = &mixed * s * &mixed;
        let system = LinearSystem::new(Matrices { m, c: Some(d), g: None, k, n: None }).unwrap();
        let mut ports = end_to_end(n);
        ports.l = mixed.subrows(50, 1).to_owned();
        ports.f = mixed.subcols(n - 1, 1).to_owned();
        let omega: Vec<f64> = (0..9).map(|k| 0.2 + 0.1 * k as f64).collect();
        let values = system.evaluate(&ports, &omega, None, true, &Cancel::default()).unwrap();
        assert_eq!(values.route, Route::Hessenberg);
        for (h, w) in values.h.iter().zip(omega) {
            // 1 / (1 + i w)^2 per oscillator, 0.9 per link
            let one = (c64::new(1.0, w) * c64::new(1.0, w)).inv();
            let expected = (one * 0.9).powu(9) * one;
            assert!((h - expected).norm() < 1e-11 * expected.norm());
        }
    }

    #[test]
    fn few_frequencies_are_solved_directly() {
        let route = |count: usize| {
            let omega: Vec<f64> = (0..count).map(|k| 0.11 + 0.2 * k as f64).collect();
            let system = chain(12, |i| 0.01 * i as f64);
            system.evaluate(&end_to_end(12), &omega, None, true, &Cancel::default()).unwrap().route
        };
        assert_eq!((route(1), route(8), route(9)), (Route::Direct, Route::Direct, Route::ComplexModes));
    }

    #[test]
    fn bands_go_before_modes_for_several_ports() {
        let n = 40;
        let route = |count: usize| {
            let ports = Ports {
                l: Mat::from_fn(count, n, |i, j| (j == i) as u8 as f64),
                f: Mat::from_fn(n, count, |i, j| (i == j) as u8 as f64),
                order_in: vec![0; count],
                order_out: 0,
                d0: None,
            };
            let omega: Vec<f64> = (0..9).map(|k| 0.11 + 0.2 * k as f64).collect();
            chain(n, |_| 0.03).evaluate(&ports, &omega, None, true, &Cancel::default()).unwrap().route
        };
        assert_eq!((route(1), route(6)), (Route::RealModes, Route::Banded));
    }

    #[test]
    fn of_many_ports_some_are_compared() {
        assert_eq!(spread(12), (0..12).collect::<Vec<_>>());
        let some = spread(40);
        assert!(some.len() == 12 && some[0] == 0 && some[11] == 36 && some.is_sorted_by(|a, b| a < b));
    }
}
