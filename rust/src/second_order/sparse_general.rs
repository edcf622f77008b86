//! The lowest modes of large models whose equations are not symmetric: followers, gyroscopic and circulatory terms.
//!
//! ```text
//! P(s) u = 0,   P(s) = A + s D + s^2 M,   D and M in the leading rows and columns alone
//! ```
//! A holds stiffness, constraints, compliances and whatever else is without s: it is sparse and may be singular. Krylov-Schur on the
//! states (u, s u) of the leading unknowns finds the roots nearest to a real shift with one factorisation of P(shift), for P and for P^T;
//! both vectors of a root give the stationary quotient w^T P(s) u = 0, whose error is the product of theirs (Lancaster, Lambda-matrices
//! and Vibrating Systems, 1966, section 6.3).
use faer::{Mat, MatMut, MatRef, c64};

use crate::error::{Error, Result};
use crate::linalg::krylov::{Operator, Options, Ritz, Space};
use crate::linalg::sparse::{Csc, Factor};
use crate::run::{Cancel, Counts};
use crate::tolerances::modes::DATA_ROUNDING;
use crate::tolerances::sparse_modes::{CONVERGED, FIRST_SHIFT, HELD, RIGID_PAIR, SAME_ROOT, SAME_VALUE, TOLD};

/// Modes beyond the wanted ones: they are the nearest to a shift, which is not at zero. Searches with more of them, at most.
const SPARE: usize = 2;
const SEARCHES: usize = 4;
/// Restarts with new random vectors at most, beside those that repeated roots need.
const RESTARTS: usize = 4;
/// Shifts that are tried at most.
const SHIFTS: usize = 12;
/// Distance of a shift over the slowest root, from which on it comes nearer; how near then; and how far where roots cannot be told apart.
const TOO_FAR: f64 = 1.0;
const NEARER: f64 = 0.3;
const APPROACH: f64 = 0.1;
/// Blur of a root over it, above which it is not told apart.
const BLURRED: f64 = 0.3;
/// Likeness of the shapes of two real roots from which on they are a pair.
const ALIKE: f64 = 0.5;

/// Matrices of P: M and D (n, n), A over all unknowns; `strain` (n, n), positive semidefinite, measures displacements by their energy, of
/// right vectors and of left ones.
pub struct Problem {
    pub m: Csc,
    pub d: Csc,
    pub a: Csc,
    pub strain: [Csc; 2],
}

/// One of each pair of roots, in ascending modulus.
pub struct GeneralModes {
    /// of a complex pair the root with Im > 0, of two real ones the larger
    pub s: Vec<c64>,
    /// the other root; nan where it lies beyond what was computed
    pub partner: Vec<c64>,
    /// leading unknowns, y^H M y = 1
    pub shape: Mat<c64>,
    /// |y - Op y/mu| over |y|, by a solve of its own
    pub residual: Vec<f64>,
    /// estimated relative error of s
    pub error: Vec<f64>,
    pub counts: Counts,
}

/// Roots with the vectors of all unknowns.
struct Roots {
    s: Vec<c64>,
    /// modulus up to which none is missing
    reach: f64,
    full: Mat<c64>,
    residual: Vec<f64>,
}

/// (u, v/rate) -> (P - shift)^-1, where u is measured by its strain and v by its kinetic energy.
struct States<'a> {
    problem: &'a Problem,
    factor: &'a Factor,
    sigma: f64,
    rate: f64,
    strain: Csc,
}

impl Problem {
    fn n(&self) -> usize {
        self.m.rows
    }

    fn factor(&self, sigma: f64) -> Result<Factor> {
        Factor::lu(&self.a.combined(1.0, sigma, &self.d).combined(1.0, sigma * sigma, &self.m))
    }

    fn transposed(&self) -> Problem {
        Problem {
            m: self.m.transposed(),
            d: self.d.transposed(),
            a: self.a.transposed(),
            strain: [self.strain[1].clone(), self.strain[0].clone()],
        }
    }

    /// The frequency that the largest ratio of strain and kinetic energy of a single unknown has.
    fn fastest(&self) -> f64 {
        let pairs = self.strain[0].diagonal().into_iter().zip(self.m.diagonal());
        let largest = pairs.filter(|(_, m)| *m > 0.0).map(|(k, m)| k / m).fold(0.0, f64::max);
        if largest > 0.0 && largest.is_finite() { largest.sqrt() } else { 1.0 }
    }

    fn states<'a>(&'a self, factor: &'a Factor, sigma: f64, rate: f64) -> States<'a> {
        States { problem: self, factor, sigma, rate, strain: self.strain[0].combined(1.0, rate * rate, &self.m) }
    }

    /// P(s) u.
    fn times(&self, s: c64, u: &[c64]) -> Vec<c64> {
        let mut out = vec![c64::new(0.0, 0.0); self.a.rows];
        for (x, f) in [(&self.a, c64::new(1.0, 0.0)), (&self.d, s), (&self.m, s * s)] {
            x.entries().for_each(|(i, j, v)| out[i] += f * u[j] * v);
        }
        out
    }

    fn slope(&self, s: c64, w: &[c64], u: &[c64]) -> c64 {
        let sum = |x: &Csc| x.entries().map(|(i, j, v)| w[i] * u[j] * v).sum::<c64>();
        sum(&self.d) + 2.0 * s * sum(&self.m)
    }

    /// Sizes of the terms of stiffnesses and of rows of elements and constraints, whose entries are rounded.
    fn row_terms(&self, w: &[c64], u: &[c64]) -> f64 {
        let n = self.n();
        let rounded = self.a.entries().filter(|(i, j, _)| *i < n || *j < n);
        rounded.map(|(i, j, v)| (w[i] * u[j] * v).norm()).sum()
    }
}

impl States<'_> {
    /// The vector of all unknowns, of real states.
    fn solve(&self, x: MatRef<'_, f64>) -> Mat<f64> {
        let n = self.problem.n();
        let (a, b) = (x.subrows(0, n), x.subrows(n, n));
        let inertia = Mat::from_fn(n, x.ncols(), |i, j| -(self.rate * b[(i, j)] + self.sigma * a[(i, j)]));
        let negative = Mat::from_fn(n, x.ncols(), |i, j| -a[(i, j)]);
        let mut out = Mat::zeros(self.factor.n(), x.ncols());
        let mut leading = Mat::zeros(n, x.ncols());
        self.problem.m.multiply(inertia.as_ref(), leading.as_mut(), false);
        self.problem.d.multiply(negative.as_ref(), leading.as_mut(), true);
        out.as_mut().subrows_mut(0, n).copy_from(&leading);
        self.factor.solve(out.as_mut());
        out
    }

    /// Strain energy of a complex vector.
    fn size(&self, y: &[c64]) -> f64 {
        self.strain.entries().map(|(i, j, v)| (y[i].conj() * y[j]).re * v).sum::<f64>().max(0.0).sqrt()
    }
}

impl Operator for States<'_> {
    fn dim(&self) -> usize {
        2 * self.problem.n()
    }

    fn apply(&self, x: MatRef<'_, f64>, mut out: MatMut<'_, f64>) -> Result<()> {
        let n = self.problem.n();
        let u = self.solve(x);
        for j in 0..x.ncols() {
            for i in 0..n {
                out[(i, j)] = u[(i, j)];
                out[(n + i, j)] = (x[(i, j)] + self.sigma * u[(i, j)]) / self.rate;
            }
        }
        Ok(())
    }

    fn weigh(&self, x: MatRef<'_, f64>, mut out: MatMut<'_, f64>) {
        let n = self.problem.n();
        self.strain.multiply(x.subrows(0, n), out.as_mut().subrows_mut(0, n), false);
        let scale = 1.0 / (self.rate * self.rate);
        for j in 0..x.ncols() {
            for i in 0..n {
                out[(i, j)] *= scale;
            }
        }
        self.problem.m.multiply(x.subrows(n, n), out.subrows_mut(n, n), false);
    }
}

/// The `wanted` modes of smallest modulus. `free`: how many degrees of freedom there are. `held`: P(0) is known to be regular.
pub fn lowest(problem: &Problem, wanted: usize, free: usize, held: bool, cancel: &Cancel) -> Result<GeneralModes> {
    search(problem, wanted, free, held, cancel).map_err(|e| match e {
        Error::Convergence { message, .. } => {
            Error::route(format!("{message}: take the dense route, mb.modes(m) without n=, which computes all of them"))
        }
        other => other,
    })
}

fn search(problem: &Problem, wanted: usize, free: usize, held: bool, cancel: &Cancel) -> Result<GeneralModes> {
    let fits = |options: &Options| 2 * free >= options.dim + 3 * options.block;
    if !fits(&Options::new(2 * wanted, false)) {
        return Err(Error::route(format!(
            "{wanted} modes were asked for and {free} degrees of freedom exist: the sparse route of large models finds few of many modes \
             where forces are not symmetric; mb.modes(m) without n= computes all of them"
        )));
    }
    let mut counts = Counts::default();
    let (sigma, rate, factor) = shift(problem, held, &mut counts, cancel)?;
    let states = problem.states(&factor, sigma, rate);
    let mut count = if sigma == 0.0 { wanted } else { wanted + SPARE };
    for _ in 0..SEARCHES {
        let options = Options::new(2 * count, false);
        if !fits(&options) {
            break;
        }
        let right = roots(&states, count, options, &mut counts, cancel)?;
        // the shift lies below all roots that are not zero
        if right.s.iter().any(|s| s.norm() < BLURRED * sigma.abs()) {
            return Err(Error::route(
                "nothing restrains this model, and its forces are not symmetric or it moves: how many rigid motions it has the sparse route of \
                 large models does not prove; hold it, or take the dense route, mb.modes(m) without n=",
            ));
        }
        let modes = paired(problem, &right.full, &right.s);
        if modes.iter().take_while(|(k, _)| right.s[*k].norm() <= right.reach).count() < wanted {
            count += wanted.max(2 * SPARE);
            continue;
        }
        let turned = problem.transposed();
        let of_turned = turned.factor(sigma)?;
        counts.add("factorisations", 1);
        let left = roots(&turned.states(&of_turned, sigma, rate), count, options, &mut counts, cancel)?;
        return told(problem, settled(problem, &right, &left, wanted, counts));
    }
    Err(Error::route(format!(
        "the {wanted} lowest roots of this model were not told from those behind them: take the dense route, mb.modes(m) without n="
    )))
}

/// The modes, where the search tells what they are.
fn told(problem: &Problem, found: GeneralModes) -> Result<GeneralModes> {
    if (0..found.s.len()).any(|k| found.s[k].im == 0.0 && !is_mirrored(problem, &found, k)) {
        return Err(Error::route(
            "some of the lowest roots of this model are real, and which two of them make one mode only all of them tell: take the dense route, \
             mb.modes(m) without n=",
        ));
    }
    if found.error.iter().all(|e| *e <= TOLD) {
        return Ok(found);
    }
    Err(Error::route(
        "some of the lowest roots of this model are nearly defective or lost in rounding: take the dense route, mb.modes(m) without n=",
    ))
}

/// Two real roots s and -s, as forces without any of velocities make them.
fn is_mirrored(problem: &Problem, found: &GeneralModes, k: usize) -> bool {
    let s = found.s[k];
    problem.d.entries().all(|e| e.2 == 0.0) && (s + found.partner[k]).norm() <= SAME_VALUE * s.norm()
}

/// A shift, the rate of the slowest motion that it sees, and the factor: zero where P(0) is regular, else a negative one of the size of
/// the slowest motion that is not rigid. From afar all roots look alike: the shift comes nearer until it tells the slowest one apart.
fn shift(problem: &Problem, held: bool, counts: &mut Counts, cancel: &Cancel) -> Result<(f64, f64, Factor)> {
    let fastest = problem.fastest();
    if held {
        let factor = problem.factor(0.0)?;
        counts.add("factorisations", 1);
        let (rate, resolved) = slowest(problem, (&factor, 0.0, fastest), counts, cancel)?;
        if resolved && rate > HELD * fastest {
            return Ok((0.0, rate, factor));
        }
    }
    let (mut sigma, mut before) = (-fastest * FIRST_SHIFT.sqrt(), fastest);
    for _ in 0..SHIFTS {
        let factor = problem.factor(sigma)?;
        counts.add("factorisations", 1);
        let (rate, resolved) = slowest(problem, (&factor, sigma, before), counts, cancel)?;
        if resolved && TOO_FAR * rate >= sigma.abs() {
            return Ok((sigma, rate, factor));
        }
        (sigma, before) = if resolved { (-NEARER * rate, rate) } else { (APPROACH * sigma, rate.min(before)) };
    }
    Err(Error::route(
        "no shift was found from which the slow motions of this model are seen: take the dense route, mb.modes(m) without n=",
    ))
}

/// About the modulus of the slowest root that is not rigid, and whether it is told apart. Twice, since displacements and velocities are
/// measured beside each other by the rate of the slowest motion, which the first time is a guess.
fn slowest(
    problem: &Problem,
    (factor, sigma, guess): (&Factor, f64, f64),
    counts: &mut Counts,
    cancel: &Cancel,
) -> Result<(f64, bool)> {
    match seen(&problem.states(factor, sigma, guess), counts, cancel)? {
        Some((rate, _)) => Ok(seen(&problem.states(factor, sigma, rate), counts, cancel)?.unwrap_or((rate, false))),
        None => Ok((guess, false)),
    }
}

/// The same as few vectors see it; None where the factor is singular.
fn seen(op: &States<'_>, counts: &mut Counts, cancel: &Cancel) -> Result<Option<(f64, bool)>> {
    let few = Options { dim: 24, ..Options::new(6, false) };
    let (counted, ritz) = match Space::new(op, few).and_then(|mut s| s.cycle(cancel).map(|ritz| (s.counts, ritz))) {
        Err(Error::Singular(_)) => return Ok(None),
        other => other?,
    };
    counts.merge(&counted);
    let root = |k: usize| op.sigma + ritz.value[k].inv();
    let told = (0..ritz.value.len()).filter(|k| ritz.value[*k].norm() > 0.0 && root(*k).norm().is_finite());
    let elastic = told.filter(|k| !is_rigid(root(*k), op.sigma));
    let lowest = elastic.min_by(|a, b| root(*a).norm().total_cmp(&root(*b).norm()));
    Ok(lowest.map(|k| {
        let blur = ritz.residual[k] / ritz.value[k].norm_sqr();
        (root(k).norm(), blur <= BLURRED * root(k).norm())
    }))
}

/// The roots in the closed upper half plane nearest to the shift.
fn roots(op: &States<'_>, wanted: usize, options: Options, counts: &mut Counts, cancel: &Cancel) -> Result<Roots> {
    let mut space = Space::new(op, options)?;
    let mut ritz = space.converge(cancel)?;
    // each restart brings one block of a repeated root to light
    let mut all = false;
    for _ in 0..RESTARTS + wanted.div_ceil(options.block) {
        let before: Vec<f64> = upper(&ritz, wanted).iter().map(|k| ritz.value[*k].norm()).collect();
        space.restart_afresh(&ritz, 2 * wanted)?;
        ritz = space.converge(cancel)?;
        let now = upper(&ritz, wanted);
        // moduli, since those of equal ones come in any order
        let same = |(a, k): (&f64, &usize)| (a - ritz.value[*k].norm()).abs() <= SAME_VALUE * a;
        all = before.len() == now.len() && before.iter().zip(&now).all(same);
        if all {
            break;
        }
    }
    if !all {
        return Err(Error::route(
            "the lowest roots of this model change with each new search: take the dense route, mb.modes(m) without n=",
        ));
    }
    counts.merge(&space.counts);
    // only those that have converged
    let good = space.converged(&ritz);
    let chosen: Vec<usize> = upper(&ritz, usize::MAX).into_iter().filter(|k| *k < good).collect();
    let picked = Ritz {
        value: chosen.iter().map(|k| ritz.value[*k]).collect(),
        residual: chosen.iter().map(|k| ritz.residual[*k]).collect(),
        vector: Mat::from_fn(ritz.vector.nrows(), chosen.len(), |i, j| ritz.vector[(i, chosen[j])]),
    };
    let states = space.vectors(&picked, chosen.len());
    let part = |f: &dyn Fn(c64) -> f64| {
        op.solve(Mat::from_fn(states.nrows(), states.ncols(), |i, j| f(states[(i, j)])).as_ref())
    };
    let (re, im) = (part(&|z| z.re), part(&|z| z.im));
    let full = Mat::from_fn(re.nrows(), re.ncols(), |i, j| c64::new(re[(i, j)], im[(i, j)]));
    let n = op.problem.n();
    let residual = |k: usize| {
        let old: Vec<c64> = (0..n).map(|i| states[(i, k)]).collect();
        let change: Vec<c64> = (0..n).map(|i| full[(i, k)] / picked.value[k] - old[i]).collect();
        op.size(&change) / op.size(&old)
    };
    // all that are nearer to the shift than the last are there
    let radius = good.checked_sub(1).map_or(0.0, |k| ritz.value[k].inv().norm());
    Ok(Roots {
        reach: (1.0 + SAME_ROOT) * radius - op.sigma.abs(),
        residual: (0..chosen.len()).map(residual).collect(),
        s: picked.value.iter().map(|mu| op.sigma + mu.inv()).collect(),
        full,
    })
}

/// Indices of the leading roots in the closed upper half plane; 1/mu has the opposite sign of the imaginary part.
fn upper(ritz: &Ritz, wanted: usize) -> Vec<usize> {
    let mut indices: Vec<usize> = (0..ritz.value.len()).filter(|k| ritz.value[*k].im <= 0.0).collect();
    indices.truncate(wanted);
    indices
}

fn column(x: &Mat<c64>, k: usize) -> Vec<c64> {
    (0..x.nrows()).map(|i| x[(i, k)]).collect()
}

fn is_rigid(s: c64, sigma: f64) -> bool {
    s.norm() <= RIGID_PAIR * sigma.abs()
}

/// Stationary quotients, one of each pair, order and size.
fn settled(problem: &Problem, right: &Roots, left: &Roots, wanted: usize, counts: Counts) -> GeneralModes {
    let (s, error): (Vec<c64>, Vec<f64>) = (0..right.s.len()).map(|k| quotient(problem, right, left, k)).unzip();
    let mut modes = paired(problem, &right.full, &s);
    modes.truncate(wanted);
    let n = problem.n();
    let shapes: Vec<Vec<c64>> = modes.iter().map(|(k, _)| unit(problem, &column(&right.full, *k)[..n])).collect();
    GeneralModes {
        s: modes.iter().map(|(k, _)| s[*k]).collect(),
        partner: modes.iter().map(|(_, partner)| *partner).collect(),
        shape: Mat::from_fn(n, modes.len(), |i, j| shapes[j][i]),
        residual: modes.iter().map(|(k, _)| right.residual[*k]).collect(),
        error: modes.iter().map(|(k, _)| error[*k]).collect(),
        counts,
    }
}

/// The root of w^T P(s) u = 0 and its error: how far the two searches are from it, and what rounding of the rows moves. Of repeated roots,
/// whose left and right vectors are no pairs, the root as it was found.
fn quotient(problem: &Problem, right: &Roots, left: &Roots, k: usize) -> (c64, f64) {
    let found = right.s[k];
    let near = |s: &c64| (s - found).norm();
    let Some(j) = (0..left.s.len()).min_by(|a, b| near(&left.s[*a]).total_cmp(&near(&left.s[*b]))) else {
        return (found, f64::INFINITY);
    };
    let apart = near(&left.s[j]) / found.norm();
    let repeated = (0..right.s.len()).any(|i| i != k && near(&right.s[i]) <= SAME_ROOT * found.norm());
    if repeated {
        return (found, apart.max(right.residual[k]));
    }
    let (u, w) = (column(&right.full, k), column(&left.full, j));
    let mut s = found;
    for _ in 0..2 {
        let rest: c64 = problem.times(s, &u).iter().zip(&w).map(|(r, w)| r * w).sum();
        s -= rest / problem.slope(s, &w, &u);
    }
    let rows = DATA_ROUNDING * 0.5 * f64::EPSILON * problem.row_terms(&w, &u) / problem.slope(s, &w, &u).norm();
    let moved = (s - found).norm().max((s - left.s[j]).norm());
    (s, (moved + rows) / s.norm())
}

/// y^H M y = 1, the largest component real and positive.
fn unit(problem: &Problem, y: &[c64]) -> Vec<c64> {
    let energy = problem.m.entries().map(|(i, j, v)| (y[i].conj() * y[j]).re * v).sum::<f64>();
    let largest = y.iter().fold(c64::new(0.0, 0.0), |a, v| if v.norm() > a.norm() { *v } else { a });
    let factor = largest.conj() / largest.norm() / energy.sqrt();
    y.iter().map(|v| v * factor).collect()
}

/// One root of each pair with the other, in ascending modulus: complex ones with their conjugates, of real ones the larger with the one of
/// the likest shape.
fn paired(problem: &Problem, full: &Mat<c64>, s: &[c64]) -> Vec<(usize, c64)> {
    let mut order: Vec<usize> = (0..s.len()).collect();
    order.sort_by(|a, b| s[*a].norm().total_cmp(&s[*b].norm()));
    // of equal moduli the one that grows first
    for run in order.chunk_by_mut(|a, b| s[*b].norm() - s[*a].norm() <= CONVERGED * s[*b].norm()) {
        run.sort_by(|a, b| s[*b].re.total_cmp(&s[*a].re));
    }
    let product = |a: usize, b: usize| {
        problem.m.entries().map(|(i, j, v)| (full[(i, a)].conj() * full[(j, b)]) * v).sum::<c64>().norm()
    };
    let size = |k: usize| product(k, k).sqrt();
    let mut taken = vec![false; s.len()];
    let mut out = Vec::new();
    for (at, &k) in order.iter().enumerate() {
        if taken[k] {
            continue;
        }
        taken[k] = true;
        if s[k].im != 0.0 {
            out.push((k, s[k].conj()));
            continue;
        }
        let others = order[at + 1..].iter().copied().filter(|j| s[*j].im == 0.0 && !taken[*j]);
        let likeness = |j: usize| product(k, j) / (size(k) * size(j));
        let best = others.map(|j| (likeness(j), j)).max_by(|a, b| a.0.total_cmp(&b.0)).filter(|b| b.0 > ALIKE);
        match best {
            None => out.push((k, c64::new(f64::NAN, f64::NAN))),
            Some((_, j)) => {
                taken[j] = true;
                out.push(if s[k].re >= s[j].re { (k, s[j]) } else { (j, s[k]) });
            }
        }
    }
    out
}
