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
use crate::tolerances::sparse_modes::{FIRST_SHIFT, RIGID_PAIR, SAME_DAMPED, SAME_ROOT};

/// Restarts with new random vectors at most.
const RESTARTS: usize = 4;
/// Shifts that are tried at most.
const SHIFTS: usize = 12;
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
    pub rigid: usize,
    pub counts: Counts,
}

/// Roots with the vectors of all unknowns.
struct Roots {
    s: Vec<c64>,
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
        let turn = |x: &Csc| Csc::from_entries(x.cols, x.rows, x.entries().map(|(i, j, v)| (j, i, v)).collect());
        Problem {
            m: turn(&self.m),
            d: turn(&self.d),
            a: turn(&self.a),
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

    /// Sizes of the terms of rows of elements and constraints, whose entries are rounded.
    fn row_terms(&self, w: &[c64], u: &[c64]) -> f64 {
        let n = self.n();
        let behind = self.a.entries().filter(|(i, j, _)| (*i >= n) != (*j >= n));
        behind.map(|(i, j, v)| (w[i] * u[j] * v).norm()).sum()
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
    let options = Options::new(2 * wanted, false);
    if 2 * free < options.dim + 3 * options.block {
        return Err(Error::route(format!(
            "{wanted} modes were asked for and {free} degrees of freedom exist: the sparse route of large models finds few of many modes \
             where forces are not symmetric; mb.modes(m) without n= computes all of them"
        )));
    }
    let mut counts = Counts::default();
    let (sigma, rate, factor) = shift(problem, held, &mut counts, cancel)?;
    let right = roots(&problem.states(&factor, sigma, rate), wanted, options, &mut counts, cancel)?;
    let turned = problem.transposed();
    let of_turned = turned.factor(sigma)?;
    counts.add("factorisations", 1);
    let left = roots(&turned.states(&of_turned, sigma, rate), wanted, options, &mut counts, cancel)?;
    Ok(settled(problem, right, &left, (wanted, sigma), counts))
}

/// A shift, the rate of the slowest motion that it sees, and the factor: zero where P(0) is regular, else a negative one of the size of
/// the slowest motion that is not rigid.
fn shift(problem: &Problem, held: bool, counts: &mut Counts, cancel: &Cancel) -> Result<(f64, f64, Factor)> {
    let fastest = problem.fastest();
    let mut sigma = if held { 0.0 } else { -fastest * FIRST_SHIFT.sqrt() };
    let mut before = fastest;
    for _ in 0..SHIFTS {
        let factor = problem.factor(sigma)?;
        counts.add("factorisations", 1);
        let rate = slowest(&problem.states(&factor, sigma, before), counts, cancel)?.unwrap_or(fastest);
        if held || 10.0 * rate >= sigma.abs() {
            return Ok((sigma, rate, factor));
        }
        (sigma, before) = (-0.3 * rate, rate);
    }
    Err(Error::route(
        "no shift was found from which the slow motions of this model are seen: take the dense route, mb.modes(m) without n=",
    ))
}

/// About the modulus of the slowest root that is not rigid, as few vectors see it.
fn slowest(op: &States<'_>, counts: &mut Counts, cancel: &Cancel) -> Result<Option<f64>> {
    let mut space = Space::new(op, Options { dim: 24, ..Options::new(6, false) })?;
    let ritz = space.cycle(cancel)?;
    counts.merge(&space.counts);
    let moduli = ritz.value.iter().filter(|v| v.norm() > 0.0).map(|v| (op.sigma + v.inv()).norm());
    let least = moduli.filter(|s| *s > RIGID_PAIR * op.sigma.abs()).fold(f64::INFINITY, f64::min);
    Ok(Some(least).filter(|s| s.is_finite() && *s > 0.0))
}

/// The roots in the closed upper half plane nearest to the shift.
fn roots(op: &States<'_>, wanted: usize, options: Options, counts: &mut Counts, cancel: &Cancel) -> Result<Roots> {
    let mut space = Space::new(op, options)?;
    let mut ritz = space.converge(cancel)?;
    for _ in 0..RESTARTS {
        let before: Vec<c64> = upper(&ritz, wanted).iter().map(|k| ritz.value[*k]).collect();
        space.restart_afresh(&ritz, 2 * wanted)?;
        ritz = space.converge(cancel)?;
        let now = upper(&ritz, wanted);
        let same = |(a, k): (&c64, &usize)| (a - ritz.value[*k]).norm() <= SAME_DAMPED * a.norm();
        if before.len() == now.len() && before.iter().zip(&now).all(same) {
            break;
        }
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
    Ok(Roots {
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

/// Stationary quotients, rigid motions, pairs of real roots, order and size.
fn settled(
    problem: &Problem,
    right: Roots,
    left: &Roots,
    (wanted, sigma): (usize, f64),
    counts: Counts,
) -> GeneralModes {
    let rigid = |s: c64| s.norm() <= RIGID_PAIR * sigma.abs();
    let (mut s, mut error) = (right.s.clone(), vec![f64::INFINITY; right.s.len()]);
    for k in (0..s.len()).filter(|k| !rigid(right.s[*k])) {
        (s[k], error[k]) = quotient(problem, &right, left, k);
    }
    let still = rigid_motions(problem, &right, |k| rigid(right.s[k]));
    let mut order: Vec<usize> = (0..s.len()).filter(|k| !rigid(right.s[*k])).collect();
    order.sort_by(|a, b| s[*a].norm().total_cmp(&s[*b].norm()).then(s[*b].re.total_cmp(&s[*a].re)));
    let pairs = paired(problem, &s, &right.full, &order);
    let n = problem.n();
    let count = still.len();
    let mut out = GeneralModes {
        s: vec![c64::new(0.0, 0.0); count],
        partner: vec![c64::new(0.0, 0.0); count],
        shape: Mat::zeros(n, 0),
        residual: vec![0.0; count],
        error: vec![0.0; count],
        rigid: count,
        counts,
    };
    let mut shapes = still;
    for (k, partner) in pairs {
        out.s.push(s[k]);
        out.partner.push(partner);
        out.residual.push(right.residual[k]);
        out.error.push(error[k]);
        shapes.push(unit(problem, &column(&right.full, k)[..n]));
    }
    let kept = wanted.min(shapes.len());
    out.s.truncate(kept);
    out.partner.truncate(kept);
    out.residual.truncate(kept);
    out.error.truncate(kept);
    out.shape = Mat::from_fn(n, kept, |i, j| shapes[j][i]);
    out
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

/// An M-orthonormal basis of the motions whose roots are zero.
fn rigid_motions(problem: &Problem, roots: &Roots, rigid: impl Fn(usize) -> bool) -> Vec<Vec<c64>> {
    let n = problem.n();
    let product = |a: &[f64], b: &[f64]| problem.m.entries().map(|(i, j, v)| a[i] * b[j] * v).sum::<f64>();
    let mut basis: Vec<Vec<f64>> = Vec::new();
    for k in (0..roots.s.len()).filter(|k| rigid(*k)) {
        for part in [|z: c64| z.re, |z: c64| z.im] {
            let mut x: Vec<f64> = (0..n).map(|i| part(roots.full[(i, k)])).collect();
            let before = product(&x, &x).sqrt();
            for b in &basis {
                let along = product(b, &x);
                x.iter_mut().zip(b).for_each(|(x, b)| *x -= along * b);
            }
            let norm = product(&x, &x).sqrt();
            // shapes of a double root are right to about the root of the precision only
            if norm > 1e-3 * before && norm > 0.0 {
                x.iter_mut().for_each(|x| *x /= norm);
                basis.push(x);
            }
        }
    }
    basis.into_iter().map(|x| x.into_iter().map(|v| c64::new(v, 0.0)).collect()).collect()
}

/// One root of each pair with the other: complex ones with their conjugates, of real ones the larger with the one of the likest shape.
fn paired(problem: &Problem, s: &[c64], full: &Mat<c64>, order: &[usize]) -> Vec<(usize, c64)> {
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
