//! Transfer functions H(omega) = L Z^-1 F, Z = S - omega^2 M + i omega D, time dependence exp(+i omega t).
//!
//! Reduced once, then cheap per frequency, by the cheapest route that passes a check against refined direct solves:
//! real modes (undamped or proportional) O(n) per entry, complex modes O(n), Hessenberg O(n^2), direct O(n^3).
use std::sync::OnceLock;

use faer::linalg::matmul::matmul;
use faer::prelude::*;
use faer::{Accum, Mat, MatRef, Par, Side, c64};

use super::frf_singular;
use crate::error::{Error, Result};
use crate::linalg::hessenberg::Hessenberg;
use crate::linalg::quadratic::{NormalForm, Quadratic, is_finite};
use crate::run::{Cancel, Counts};

/// A route is taken where it agrees with refined direct solves this well, or as well as unrefined ones do.
const ACCEPT: f64 = 1e-11;
const WORST_ACCEPTED: f64 = 1e-9;
/// Complex modes with worse conditioned vectors are not worth a check.
const WORST_VECTORS: f64 = 1e7;

/// What is driven and what is seen: H = (i omega)^order_out (L Z^-1 F (i omega)^order_in + D0).
#[derive(Debug, Clone)]
pub struct Ports {
    pub l: Mat<f64>,
    pub f: Mat<f64>,
    pub order_in: Vec<u32>,
    pub order_out: u32,
    pub d0: Option<Mat<f64>>,
}

pub struct RealModes {
    /// (n, n) mass-normalised shapes and the squares of the natural frequencies; rigid modes are exactly zero
    pub shape: Mat<f64>,
    pub lambda: Vec<f64>,
    pub damping: Vec<f64>,
}

pub struct ComplexModes {
    pub pole: Vec<c64>,
    /// rows of the eigenvectors that belong to z
    top: Mat<c64>,
    lu: faer::linalg::solvers::PartialPivLu<c64>,
    /// 1-norm condition estimate of the eigenvectors
    pub condition: f64,
    rate: f64,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Route {
    RealModes,
    ComplexModes,
    Hessenberg,
    Direct,
}

impl Route {
    pub fn name(self) -> &'static str {
        match self {
            Route::RealModes => "real modes",
            Route::ComplexModes => "complex modes",
            Route::Hessenberg => "Hessenberg",
            Route::Direct => "direct",
        }
    }
}

/// Everything that does not depend on frequency or ports.
pub struct Reduction {
    pub q: Quadratic,
    pub normal: Option<NormalForm>,
    pub real: Option<RealModes>,
    pub complex: Option<ComplexModes>,
    hessenberg: OnceLock<Hessenberg>,
    scale: Vec<f64>,
    pub counts: Counts,
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

impl Ports {
    pub fn check(&self, n: usize) -> Result<()> {
        let (n_out, n_in) = (self.l.nrows(), self.f.ncols());
        if self.l.ncols() != n || self.f.nrows() != n {
            return Err(Error::model(format!(
                "the output map is {} x {} and the input map {} x {}; they must be (outputs, {n}) and ({n}, inputs)",
                self.l.nrows(),
                self.l.ncols(),
                self.f.nrows(),
                self.f.ncols()
            )));
        }
        if n_out == 0 || n_in == 0 {
            return Err(Error::model(
                "a transfer function needs at least one input and one output",
            ));
        }
        if self.order_in.len() != n_in {
            return Err(Error::model(format!(
                "there are {n_in} inputs but {} derivative orders",
                self.order_in.len()
            )));
        }
        if let Some(d0) = &self.d0
            && (d0.nrows() != n_out || d0.ncols() != n_in)
        {
            return Err(Error::model(format!(
                "the feedthrough is {} x {}; it must be {n_out} x {n_in}",
                d0.nrows(),
                d0.ncols()
            )));
        }
        let finite = is_finite(self.l.as_ref())
            && is_finite(self.f.as_ref())
            && self.d0.as_ref().is_none_or(|d| is_finite(d.as_ref()));
        if !finite {
            return Err(Error::model(
                "an input or output map contains NaN or infinite entries",
            ));
        }
        Ok(())
    }

    fn n_out(&self) -> usize {
        self.l.nrows()
    }

    fn n_in(&self) -> usize {
        self.f.ncols()
    }
}

impl ComplexModes {
    /// V^-1 B: real states in modal coordinates.
    pub fn coordinates(&self, states: MatRef<'_, f64>) -> Mat<c64> {
        let mut x = complex(states);
        self.lu.solve_in_place(&mut x);
        x
    }

    /// C V for an output map of the states that sees their first half only.
    pub fn outputs(&self, c: MatRef<'_, f64>) -> Mat<c64> {
        complex(c.subcols(0, self.top.nrows())) * &self.top
    }
}

impl Reduction {
    pub fn new(q: Quadratic) -> Result<Self> {
        let mut counts = Counts::default();
        let normal = q.normal_form();
        let mut real = None;
        let mut complex = None;
        if let Some(form) = &normal {
            if form.is_symmetric() {
                counts.add("eigensolutions", 1);
                real = real_modes(form)?;
            }
            if real.is_none() {
                counts.add("eigensolutions", 1);
                complex = complex_modes(form);
            }
        }
        Ok(Reduction {
            scale: q.unit_scale(),
            q,
            normal,
            real,
            complex,
            hessenberg: OnceLock::new(),
            counts,
        })
    }

    /// All 2n poles in rad/s, or None where no reduction was possible.
    pub fn poles(&self) -> Option<Vec<c64>> {
        if let Some(modes) = &self.real {
            let pairs = modes.lambda.iter().zip(&modes.damping);
            return Some(pairs.flat_map(|(&l, &c)| quadratic_roots(l, c)).collect());
        }
        self.complex.as_ref().map(|modes| modes.pole.clone())
    }

    fn routes(&self) -> Vec<Route> {
        let mut routes = Vec::new();
        if self.real.is_some() {
            routes.push(Route::RealModes);
        }
        if self
            .complex
            .as_ref()
            .is_some_and(|m| m.condition < WORST_VECTORS)
        {
            routes.push(Route::ComplexModes);
        }
        if self.normal.is_some() && self.real.is_none() {
            routes.push(Route::Hessenberg);
        }
        routes.push(Route::Direct);
        routes
    }

    pub fn evaluate(&self, ports: &Ports, omega: &[f64], cancel: &Cancel) -> Result<Values> {
        ports.check(self.q.n())?;
        if omega.iter().any(|w| !w.is_finite()) {
            return Err(Error::model("omega contains NaN or infinite values"));
        }
        let mut counts = Counts::default();
        let samples = self.samples(omega);
        let checks = self.references(ports, omega, &samples, &mut counts);
        let direct_error = checks.iter().map(|c| c.plain_error).fold(0.0, f64::max);
        let mut accepted = (Route::Direct, direct_error);
        for route in self.routes() {
            if route == Route::Direct {
                break;
            }
            let evaluator = self.prepare(route, ports, &mut counts);
            let error = checks
                .iter()
                .map(|check| check.distance(evaluator.at(omega[check.index])))
                .fold(0.0, f64::max);
            if error <= (10.0 * direct_error).clamp(ACCEPT, WORST_ACCEPTED) {
                accepted = (route, error);
                break;
            }
        }
        let (route, mut error) = accepted;
        let refine = route == Route::Direct && direct_error > ACCEPT;
        if refine {
            error = f64::EPSILON;
        }
        let evaluator = match route {
            Route::Direct => self.direct(ports, if refine { 3 } else { 0 }),
            _ => self.prepare(route, ports, &mut counts),
        };
        counts.add("frequencies", omega.len() as u64);
        let (h, singular) = self.sweep(&evaluator, ports, omega, &mut counts, cancel)?;
        Ok(Values {
            h,
            route,
            error: error.max(f64::EPSILON),
            singular,
            counts,
        })
    }

    /// Complex modes whose expansion agrees with refined direct solves from the slowest to the fastest motion.
    pub fn trusted_modes(&self, ports: &Ports, counts: &mut Counts) -> Option<&ComplexModes> {
        let (modes, form) = (self.complex.as_ref()?, self.normal.as_ref()?);
        if modes.condition >= WORST_VECTORS {
            return None;
        }
        let sizes = || modes.pole.iter().map(|s| s.norm());
        let (slow, fast) = (
            sizes().fold(f64::MAX, f64::min),
            sizes().fold(0.0, f64::max),
        );
        let slow = slow.max(1e-6 * fast);
        let omega: Vec<f64> = (0..5)
            .map(|k| slow * (fast / slow).powf(k as f64 / 4.0))
            .collect();
        let checks = self.references(ports, &omega, &[0, 1, 2, 3, 4], counts);
        let evaluator = self.complex_evaluator(form, ports);
        let good =
            |check: &Check| check.distance(evaluator.at(omega[check.index])) < WORST_ACCEPTED;
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
        for (k, &w) in omega.iter().enumerate() {
            cancel.check()?;
            let (value, powers_done) = match evaluator.at(w) {
                Some(value) => (value, false),
                None => {
                    let (value, is_singular) = frf_singular::transfer(self, ports, w)?;
                    counts.add("singular frequencies", is_singular as u64);
                    if is_singular {
                        singular.push(k);
                    }
                    (value, true)
                }
            };
            for i in 0..n_out {
                for j in 0..n_in {
                    let order = ports.order_in[j] + ports.order_out;
                    let factor = if powers_done {
                        c64::new(1.0, 0.0)
                    } else {
                        i_omega(w, order)
                    };
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

    /// Frequencies at which a route is compared with refined direct solves: the ends, the middle, and next to the sharpest peaks.
    fn samples(&self, omega: &[f64]) -> Vec<usize> {
        let n = omega.len();
        if n == 0 {
            return Vec::new();
        }
        let mut samples = vec![0, n / 2, n - 1];
        let mut poles: Vec<c64> = self.poles().unwrap_or_default();
        poles.retain(|p| p.im > 0.0);
        let sharpness = |p: &c64| p.re.abs() / p.im;
        poles.sort_by(|a, b| sharpness(a).total_cmp(&sharpness(b)));
        let (low, high) = omega.iter().fold((f64::MAX, 0.0_f64), |(l, h), w| {
            (l.min(w.abs()), h.max(w.abs()))
        });
        for pole in poles.iter().filter(|p| p.im >= low && p.im <= high).take(3) {
            let distance = |k: &usize| (omega[*k].abs() - pole.im).abs();
            if let Some(k) = (0..n).min_by(|a, b| distance(a).total_cmp(&distance(b))) {
                samples.push(k);
            }
        }
        samples.sort_unstable();
        samples.dedup();
        samples
    }

    fn references(
        &self,
        ports: &Ports,
        omega: &[f64],
        samples: &[usize],
        counts: &mut Counts,
    ) -> Vec<Check> {
        let mix = input_mix(ports);
        let load = Mat::from_fn(self.q.n(), 1, |i, _| {
            let sum: f64 = mix
                .iter()
                .enumerate()
                .map(|(j, r)| ports.f[(i, j)] * r)
                .sum();
            c64::new(sum, 0.0)
        });
        let mut checks = Vec::new();
        for &index in samples {
            counts.add("check solves", 1);
            if let Some(solved) = self.q.solve(omega[index], load.as_ref(), &self.scale, 3) {
                let motion = (0..self.q.n()).map(|i| solved.x[(i, 0)].norm() / self.scale[i]);
                checks.push(Check {
                    index,
                    plain_error: solved.error,
                    reference: complex(ports.l.as_ref()) * &solved.x,
                    motion: motion.fold(0.0, f64::max),
                    mix: mix.clone(),
                    unit: self.output_units(ports),
                });
            }
        }
        checks
    }

    fn output_units(&self, ports: &Ports) -> Vec<f64> {
        (0..ports.n_out())
            .map(|i| {
                let squares = (0..self.q.n()).map(|j| (ports.l[(i, j)] * self.scale[j]).powi(2));
                squares.sum::<f64>().sqrt()
            })
            .collect()
    }

    fn prepare<'a>(&'a self, route: Route, ports: &'a Ports, counts: &mut Counts) -> Evaluator<'a> {
        match (route, &self.normal) {
            (Route::RealModes, _) if self.real.is_some() => self.real_evaluator(ports),
            (Route::ComplexModes, Some(form)) if self.complex.is_some() => {
                self.complex_evaluator(form, ports)
            }
            (Route::Hessenberg, Some(form)) => {
                let rate = form.rate();
                let reduced = self.hessenberg.get_or_init(|| {
                    counts.add("Hessenberg reductions", 1);
                    Hessenberg::new(form.state_matrix(rate).as_ref())
                });
                let n = self.q.n();
                let (l, f) = (
                    form.outputs(ports.l.as_ref()),
                    form.inputs(ports.f.as_ref()),
                );
                let c = Mat::from_fn(l.nrows(), 2 * n, |i, j| if j < n { l[(i, j)] } else { 0.0 });
                let b = Mat::from_fn(2 * n, f.ncols(), |i, j| {
                    if i < n { 0.0 } else { f[(i - n, j)] / rate }
                });
                Evaluator::Hessenberg {
                    reduced,
                    cq: reduced.outputs(c.as_ref()),
                    qb: reduced.inputs(b.as_ref()),
                }
            }
            _ => self.direct(ports, 0),
        }
    }

    fn direct<'a>(&'a self, ports: &'a Ports, refinements: usize) -> Evaluator<'a> {
        Evaluator::Direct {
            reduction: self,
            l: complex(ports.l.as_ref()),
            f: complex(ports.f.as_ref()),
            refinements,
        }
    }

    fn real_evaluator<'a>(&'a self, ports: &Ports) -> Evaluator<'a> {
        let Some(modes) = &self.real else {
            return self.direct_empty();
        };
        let highest = modes.lambda.iter().fold(0.0_f64, |a, l| a.max(l.abs()));
        Evaluator::Real {
            modes,
            left: &ports.l * &modes.shape,
            right: complex((modes.shape.transpose() * &ports.f).as_ref()),
            noise: 4.0 * f64::EPSILON * highest,
        }
    }

    fn complex_evaluator<'a>(&'a self, form: &NormalForm, ports: &Ports) -> Evaluator<'a> {
        let Some(modes) = &self.complex else {
            return self.direct_empty();
        };
        let n = form.n();
        let f = form.inputs(ports.f.as_ref());
        let mut right = Mat::from_fn(2 * n, f.ncols(), |i, j| {
            c64::new(
                if i < n {
                    0.0
                } else {
                    f[(i - n, j)] / modes.rate
                },
                0.0,
            )
        });
        modes.lu.solve_in_place(&mut right);
        let largest = modes.pole.iter().fold(0.0_f64, |a, s| a.max(s.norm()));
        Evaluator::Complex {
            modes,
            left: complex(form.outputs(ports.l.as_ref()).as_ref()) * &modes.top,
            right,
            noise: 4.0 * f64::EPSILON * largest,
            largest,
        }
    }

    fn direct_empty(&self) -> Evaluator<'_> {
        Evaluator::Direct {
            reduction: self,
            l: Mat::zeros(0, self.q.n()),
            f: Mat::zeros(self.q.n(), 0),
            refinements: 0,
        }
    }
}

/// One route bound to its ports; `at` gives L Z^-1 F, or None where Z is (nearly) singular.
enum Evaluator<'a> {
    Real {
        modes: &'a RealModes,
        left: Mat<f64>,
        right: Mat<c64>,
        noise: f64,
    },
    Complex {
        modes: &'a ComplexModes,
        left: Mat<c64>,
        right: Mat<c64>,
        noise: f64,
        largest: f64,
    },
    Hessenberg {
        reduced: &'a Hessenberg,
        cq: Mat<f64>,
        qb: Mat<f64>,
    },
    Direct {
        reduction: &'a Reduction,
        l: Mat<c64>,
        f: Mat<c64>,
        refinements: usize,
    },
}

impl Evaluator<'_> {
    fn at(&self, w: f64) -> Option<Mat<c64>> {
        match self {
            Evaluator::Real {
                modes,
                left,
                right,
                noise,
            } => {
                let mut receptance = Vec::with_capacity(modes.lambda.len());
                for (l, c) in modes.lambda.iter().zip(&modes.damping) {
                    let den = c64::new(l - w * w, w * c);
                    if den.norm() <= *noise {
                        return None;
                    }
                    receptance.push(den.inv());
                }
                let weighted = Mat::from_fn(left.nrows(), left.ncols(), |i, r| {
                    left[(i, r)] * receptance[r]
                });
                Some(product(weighted.as_ref(), right.as_ref()))
            }
            Evaluator::Complex {
                modes,
                left,
                right,
                noise,
                largest,
            } => {
                let s = c64::new(0.0, w);
                let mut factor = Vec::with_capacity(modes.pole.len());
                for pole in &modes.pole {
                    // a zero root is known to the accuracy of a defective one only, so omega = 0 is judged by S itself
                    let limit = if w == 0.0 { 1e-6 * largest } else { *noise };
                    if (s - pole).norm() <= limit {
                        return None;
                    }
                    factor.push((s - pole).inv());
                }
                let weighted =
                    Mat::from_fn(left.nrows(), left.ncols(), |i, r| left[(i, r)] * factor[r]);
                Some(product(weighted.as_ref(), right.as_ref()))
            }
            Evaluator::Hessenberg { reduced, cq, qb } => {
                if w == 0.0 {
                    return None;
                }
                reduced.transfer(c64::new(0.0, w), cq.as_ref(), qb.as_ref())
            }
            Evaluator::Direct {
                reduction,
                l,
                f,
                refinements,
            } => {
                let solved = reduction
                    .q
                    .solve(w, f.as_ref(), &reduction.scale, *refinements)?;
                Some(product(l.as_ref(), solved.x.as_ref()))
            }
        }
    }
}

/// A refined direct solution for one mix of the inputs.
struct Check {
    index: usize,
    plain_error: f64,
    reference: Mat<c64>,
    /// largest mass-normalised coordinate: an output that is eps of it counts as zero
    motion: f64,
    mix: Vec<f64>,
    unit: Vec<f64>,
}

impl Check {
    /// Relative to the largest output, each output measured in units of its map.
    fn distance(&self, value: Option<Mat<c64>>) -> f64 {
        let Some(value) = value else {
            return 0.0; // singular: another routine answers there
        };
        let (mut worst, mut size) = (0.0_f64, f64::EPSILON * self.motion);
        for (i, unit) in self
            .unit
            .iter()
            .enumerate()
            .filter(|(_, unit)| **unit > 0.0)
        {
            let mixed: c64 = (0..value.ncols())
                .map(|j| value[(i, j)] * self.mix[j])
                .sum();
            worst = worst.max((mixed - self.reference[(i, 0)]).norm() / unit);
            size = size.max(self.reference[(i, 0)].norm() / unit);
        }
        if worst == 0.0 { 0.0 } else { worst / size }
    }
}

/// Inputs weighed alike, with signs that do not let symmetric ones cancel.
fn input_mix(ports: &Ports) -> Vec<f64> {
    (0..ports.n_in())
        .map(|j| {
            let size = ports.f.col(j).norm_l2();
            let weight = 0.7 + 0.3 * ((j as f64) * 2.399_963).sin();
            if size > 0.0 { weight / size } else { 0.0 }
        })
        .collect()
}

fn real_modes(form: &NormalForm) -> Result<Option<RealModes>> {
    let n = form.n();
    let Ok(eigen) = form.s.self_adjoint_eigen(Side::Lower) else {
        return Ok(None);
    };
    let mut lambda: Vec<f64> = (0..n).map(|r| eigen.S()[r]).collect();
    let largest = lambda.iter().fold(0.0_f64, |a, l| a.max(l.abs()));
    for l in &mut lambda {
        if l.abs() <= n as f64 * f64::EPSILON * largest {
            *l = 0.0;
        }
    }
    let mut damping = vec![0.0; n];
    if let Some(d) = &form.d {
        let modal = eigen.U().transpose() * d * eigen.U();
        // coupling that a rounding of D could have made: the damping is proportional
        let tol = 1e-13 * modal.norm_max();
        for j in 0..n {
            for i in 0..n {
                if i != j && modal[(i, j)].abs() > tol {
                    return Ok(None);
                }
            }
            damping[j] = if modal[(j, j)].abs() <= tol {
                0.0
            } else {
                modal[(j, j)]
            };
        }
    }
    let mut shape = eigen.U().to_owned();
    form.l
        .transpose()
        .solve_upper_triangular_in_place(&mut shape);
    Ok(Some(RealModes {
        shape,
        lambda,
        damping,
    }))
}

fn complex_modes(form: &NormalForm) -> Option<ComplexModes> {
    let rate = form.rate();
    let eigen = form.state_matrix(rate).eigen().ok()?;
    let n = form.n();
    let vectors = eigen.U().to_owned();
    let finite = (0..2 * n).all(|j| eigen.S()[j].is_finite());
    if !finite {
        return None;
    }
    let lu = vectors.partial_piv_lu();
    let condition = vectors_condition(vectors.as_ref(), &lu);
    Some(ComplexModes {
        pole: (0..2 * n).map(|j| eigen.S()[j]).collect(),
        top: vectors.subrows(0, n).to_owned(),
        lu,
        condition,
        rate,
    })
}

/// Hager's estimate of |V|_1 |V^-1|_1 (Higham, Accuracy and Stability of Numerical Algorithms, algorithm 15.4 without its last test).
fn vectors_condition(v: MatRef<'_, c64>, lu: &faer::linalg::solvers::PartialPivLu<c64>) -> f64 {
    let n = v.nrows();
    let column_sum = |a: MatRef<'_, c64>, j: usize| (0..n).map(|i| a[(i, j)].norm()).sum::<f64>();
    let norm = (0..n).map(|j| column_sum(v, j)).fold(0.0, f64::max);
    let mut x = Mat::from_fn(n, 1, |_, _| c64::new(1.0 / n as f64, 0.0));
    let mut estimate = 0.0_f64;
    for _ in 0..5 {
        lu.solve_in_place(&mut x);
        let size = column_sum(x.as_ref(), 0);
        if !size.is_finite() {
            return f64::INFINITY;
        }
        if size <= estimate {
            break;
        }
        estimate = size;
        let mut sign = Mat::from_fn(n, 1, |i, _| {
            let a = x[(i, 0)];
            if a.norm() > 0.0 {
                a / a.norm()
            } else {
                c64::new(1.0, 0.0)
            }
        });
        lu.solve_adjoint_in_place(&mut sign);
        let largest = (0..n).max_by(|a, b| sign[(*a, 0)].norm().total_cmp(&sign[(*b, 0)].norm()));
        let Some(largest) = largest else { break };
        x = Mat::zeros(n, 1);
        x[(largest, 0)] = c64::new(1.0, 0.0);
    }
    norm * estimate
}

/// Roots of s^2 + c s + lambda without cancellation.
pub fn quadratic_roots(lambda: f64, c: f64) -> [c64; 2] {
    let discriminant = 0.25 * c * c - lambda;
    if discriminant < 0.0 {
        let im = (-discriminant).sqrt();
        [c64::new(-0.5 * c, im), c64::new(-0.5 * c, -im)]
    } else {
        let large = -0.5 * c - discriminant.sqrt().copysign(c);
        let small = if large != 0.0 { lambda / large } else { 0.0 };
        [c64::new(small, 0.0), c64::new(large, 0.0)]
    }
}

pub fn complex(a: MatRef<'_, f64>) -> Mat<c64> {
    Mat::from_fn(a.nrows(), a.ncols(), |i, j| c64::new(a[(i, j)], 0.0))
}

/// (i omega)^order, exactly real or imaginary.
pub fn i_omega(w: f64, order: u32) -> c64 {
    let size = w.powi(order as i32);
    match order % 4 {
        0 => c64::new(size, 0.0),
        1 => c64::new(0.0, size),
        2 => c64::new(-size, 0.0),
        _ => c64::new(0.0, -size),
    }
}

/// A product that leaves infinite entries infinite instead of making NaN of inf * 0.
fn scaled(value: c64, factor: c64) -> c64 {
    if value.is_finite() {
        value * factor
    } else {
        value
    }
}

fn product(a: MatRef<'_, c64>, b: MatRef<'_, c64>) -> Mat<c64> {
    let mut out = Mat::zeros(a.nrows(), b.ncols());
    matmul(&mut out, Accum::Replace, a, b, c64::new(1.0, 0.0), Par::Seq);
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chain(n: usize, c: impl Fn(usize) -> f64) -> Quadratic {
        let tri = |i: usize, j: usize| match i.abs_diff(j) {
            0 => 2.0,
            1 => -1.0,
            _ => 0.0,
        };
        let m = Mat::identity(n, n);
        let d = Mat::from_fn(n, n, |i, j| if i == j { c(i) } else { 0.0 });
        Quadratic::new(m, Some(d), Mat::from_fn(n, n, tri)).unwrap()
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
        let cases: [(Quadratic, Route); 3] = [
            (chain(12, |_| 0.0), Route::RealModes),
            (chain(12, |_| 0.03), Route::RealModes),
            (chain(12, |i| 0.01 * i as f64), Route::ComplexModes),
        ];
        for (q, route) in cases {
            let reduction = Reduction::new(q).unwrap();
            let values = reduction
                .evaluate(&end_to_end(12), &omega, &Cancel::default())
                .unwrap();
            assert_eq!(values.route, route);
            let ports = end_to_end(12);
            let direct = reduction.direct(&ports, 3);
            for (k, w) in omega.iter().enumerate() {
                let expected = direct.at(*w).unwrap()[(0, 0)];
                assert!((values.h[k] - expected).norm() < 1e-11 * expected.norm().max(1e-3));
            }
        }
    }

    #[test]
    fn critical_damping_falls_back_to_hessenberg() {
        // two equal critically damped oscillators, weakly coupled through N: defective state matrix
        let m = Mat::identity(2, 2);
        let d = Mat::from_fn(2, 2, |i, j| if i == j { 2.0 } else { 0.0 });
        let s = Mat::from_fn(2, 2, |i, j| [[1.0, 1e-3], [0.0, 1.0]][i][j]);
        let reduction = Reduction::new(Quadratic::new(m, Some(d), s).unwrap()).unwrap();
        let values = reduction
            .evaluate(&end_to_end(2), &[0.0, 1.0], &Cancel::default())
            .unwrap();
        assert_eq!(values.route, Route::Hessenberg);
        // triangular S: the force on x0 does not reach x1
        assert!(values.h[1].norm() < 1e-14);
    }
}
