//! The monodromy matrix of a periodic motion by splitting: the linear part moves exactly, the tangents of the elements kick.
//!
//! One step of length h is E(h/2) K E(h/2) with E the exact propagator of M x" + C x' + K x = 0 and K a kick with the tangents at
//! the middle of the step. The product is symmetric in time, so that its error has even powers of h only and extrapolation gains two
//! orders per doubling (Hairer, Lubich, Wanner, Geometric Numerical Integration, Springer 2006, II.4, V.3). With few elements in many
//! coordinates a step is made in modal coordinates at O(n_e n^2), else on the states at O(n^3) in real numbers.
//!
//! Parts of a system that nothing connects have their own products: errors and rounding of one that grows are large beside the
//! multipliers of another.
use faer::Mat;
use faer::prelude::*;
use num_complex::Complex64 as c64;

use super::propagator::{Modes, States};
use crate::error::{Error, Result};
use crate::periodic::aft::Aft;
use crate::periodic::linear::Matrices;
use crate::periodic::problem::Problem;
use crate::periodic::rows::{join, root};
use crate::periodic::tangents::{Deviation, Pair, Tangents};
use crate::second_order::SecondOrder;
use crate::second_order::modal::modes;
use crate::tolerances::periodic::MONODROMY;

/// Coarsest number of steps per period, and how often it is doubled at most.
const COARSEST: usize = 32;
const DOUBLINGS: usize = 7;

/// What does not change along a branch: the linear part in coordinates in which its motion is known.
pub struct Splitting {
    n: usize,
    parts: Vec<Part>,
    samplers: Vec<Aft>,
    /// steps of the finest product that was needed last
    pub finest: usize,
}

/// Coordinates that matrices and elements connect.
struct Part {
    own: Vec<usize>,
    /// numbers of the tangents that act on them
    pairs: Vec<usize>,
    /// trace of -M^-1 C and, per tangent, of the effect of its rate
    linear_trace: f64,
    rate_traces: Vec<f64>,
    coordinates: Coordinates,
    /// sqrt(M_ii): coordinates of any units are compared as momenta are
    unit: Vec<f64>,
    /// the eigenvalues of a linear part, which need no steps
    poles: Option<Vec<c64>>,
}

enum Coordinates {
    Modes(Modes),
    States(States),
}

/// Of the states [x; v] of some coordinates over one period.
pub struct Monodromy {
    pub own: Vec<usize>,
    pub matrix: Mat<f64>,
    /// the sum of the exponents (Liouville)
    pub sum: f64,
    /// of the finest product
    pub steps: usize,
}

impl Splitting {
    /// Matrices whose first coordinates are those that the problem retains.
    pub fn new(problem: &Problem, matrices: &Matrices) -> Result<Splitting> {
        let n = matrices.0.nrows();
        let parts = connected(problem, matrices).into_iter().map(|own| Part::new(problem, matrices, own));
        Ok(Splitting { n, parts: parts.collect::<Result<_>>()?, samplers: Vec::new(), finest: 0 })
    }

    /// Coordinates of the state, 2 n.
    pub fn size(&self) -> usize {
        2 * self.n
    }

    /// Coordinates of each part that nothing connects with another.
    pub fn coordinates(&self) -> impl Iterator<Item = &[usize]> {
        self.parts.iter().map(|part| part.own.as_slice())
    }

    /// The eigenvalues of a part that is linear.
    pub fn poles(&self, part: usize) -> Option<&[c64]> {
        self.parts[part].poles.as_deref()
    }

    /// Of these parts, along the motion y.
    pub fn monodromy(&mut self, problem: &mut Problem, y: &[f64], wanted: &[usize]) -> Result<Vec<Monodromy>> {
        if wanted.is_empty() {
            return Ok(Vec::new());
        }
        let w0 = problem.base_frequency();
        let top = problem.basis.reach()[0].max(1);
        let coarsest = COARSEST.max((2 * top + 2).next_power_of_two());
        let mut tables: Vec<Table> = wanted.iter().map(|_| Table::default()).collect();
        for level in 0..=DOUBLINGS {
            let steps = coarsest << level;
            let tangents = self.tangents(problem, y, level, steps)?;
            self.finest = steps;
            for (part, table) in wanted.iter().zip(&mut tables).filter(|(_, table)| !table.settled) {
                self.parts[*part].refine(table, &tangents, steps, w0);
            }
            if tables.iter().all(|table| table.settled) {
                break;
            }
        }
        let made = wanted.iter().zip(&tables).map(|(part, table)| {
            let part = &self.parts[*part];
            let n = part.own.len();
            let unit = |i: usize| if i < n { 1.0 / part.unit[i] } else { w0 / part.unit[i - n] };
            let best = table.best()?;
            let matrix = Mat::from_fn(2 * n, 2 * n, |i, j| best[(i, j)] * unit(i) / unit(j));
            Some(Monodromy { own: part.own.clone(), matrix, sum: table.sum, steps: table.steps })
        });
        made.collect::<Option<_>>().ok_or_else(|| Error::singular("the monodromy matrix has no steps"))
    }

    /// The same on a motion with more terms, whose samplers are not those of the others.
    pub fn monodromy_with(
        &mut self,
        problem: &mut Problem,
        y: &[f64],
        wanted: &[usize],
        samplers: &mut Vec<Aft>,
    ) -> Result<Vec<Monodromy>> {
        let finest = self.finest;
        std::mem::swap(&mut self.samplers, samplers);
        let parts = self.monodromy(problem, y, wanted);
        std::mem::swap(&mut self.samplers, samplers);
        self.finest = finest;
        parts
    }

    /// By how much deviations of the tangents of each part change its M^-1 K and M^-1 C w0, as one of its modes sees it in the mean.
    pub fn changes(&self, deviations: &[Deviation], w0: f64) -> Vec<f64> {
        let one = |(e, own): (&usize, &f64)| {
            let [stiffness, damping] = deviations[*e].changes;
            own * (stiffness + w0 * damping)
        };
        let of = |part: &Part| {
            let sum: f64 = part.pairs.iter().zip(&part.rate_traces).map(one).sum();
            sum / part.own.len() as f64
        };
        self.parts.iter().map(of).collect()
    }

    /// df/du and df/dv of the pairs at the middles of the steps.
    fn tangents(&mut self, problem: &mut Problem, y: &[f64], level: usize, steps: usize) -> Result<Tangents> {
        if self.samplers.len() <= level {
            self.samplers.push(Aft::between(&problem.basis, steps));
        }
        problem.tangents(y, &mut self.samplers[level])
    }
}

/// The extrapolation: products with growing numbers of steps, rates in units of w0.
struct Table {
    last: Vec<Mat<f64>>,
    change: f64,
    sum: f64,
    steps: usize,
    settled: bool,
}

impl Default for Table {
    fn default() -> Self {
        Table { last: Vec::new(), change: f64::INFINITY, sum: 0.0, steps: 0, settled: false }
    }
}

impl Table {
    fn best(&self) -> Option<&Mat<f64>> {
        self.last.last()
    }

    fn add(&mut self, product: Mat<f64>) {
        let mut row = vec![product];
        for (order, coarse) in self.last.iter().enumerate() {
            let gain = 4.0_f64.powi(order as i32 + 1) - 1.0;
            let fine = &row[order];
            row.push(fine + (fine - coarse) * Scale(1.0 / gain));
        }
        let change = match (self.best(), row.last()) {
            (Some(coarser), Some(finer)) => (finer - coarser).norm_max() / finer.norm_max().max(f64::MIN_POSITIVE),
            _ => f64::INFINITY,
        };
        // where changes shrink, the next one shrinks at least as fast: it is the error of the present value
        // larger ones do not tell yet how fast the next ones will shrink
        let next = if change <= MONODROMY.sqrt() { change * (change / self.change).min(1.0) } else { change };
        self.settled = next <= MONODROMY;
        (self.last, self.change) = (row, change);
    }
}

impl Part {
    fn new(problem: &Problem, (mass, damping, stiffness): &Matrices, own: Vec<usize>) -> Result<Part> {
        let n = own.len();
        let of = |m: &Mat<f64>| Mat::from_fn(n, n, |i, j| m[(own[i], own[j])]);
        let mass = of(mass);
        let lu = mass.partial_piv_lu();
        let (c, k) = (lu.solve(of(damping)), lu.solve(of(stiffness)));
        if !(0..n).all(|i| c[(i, i)].is_finite() && k[(i, i)].is_finite()) {
            return Err(Error::singular("stability needs a regular mass matrix; remove coordinates without mass"));
        }
        let all = problem.pairs();
        let retained =
            |at: usize, coordinate: fn(Pair) -> usize| &problem.retained()[all[at].element][coordinate(all[at])];
        let belongs = |at: &usize| problem.retained()[all[*at].element].iter().flatten().any(|(i, _)| own.contains(i));
        let pairs: Vec<usize> = (0..all.len()).filter(belongs).collect();
        let n_e = pairs.len();
        let poles = if n_e == 0 { eigenvalues(&mass, &of(damping), &of(stiffness)) } else { None };
        let columns = |coordinate: fn(Pair) -> usize| {
            let mut out = Mat::<f64>::zeros(n, n_e);
            for (column, at) in pairs.iter().enumerate() {
                for (i, weight) in retained(*at, coordinate) {
                    own.iter().position(|at| at == i).into_iter().for_each(|row| out[(row, column)] += weight);
                }
            }
            out
        };
        let see = columns(|pair| pair.by);
        let push = lu.solve(columns(|pair| pair.force));
        // operations of a step: 8 (2n)^2 (1 + 2 n_e) in complex modes, 2 (2n)^3 + 4 n_e n^2 on the states
        let many = n > 2 + 3 * n_e;
        let modes = many.then(|| Modes::new(&c, &k, &push, &see)).flatten();
        Ok(Part {
            linear_trace: -(0..n).map(|i| c[(i, i)]).sum::<f64>(),
            rate_traces: (0..n_e).map(|e| (0..n).map(|i| see[(i, e)] * push[(i, e)]).sum()).collect(),
            coordinates: match modes {
                Some(modes) => Coordinates::Modes(modes),
                None => Coordinates::States(States::new(c, k, &push, &see)),
            },
            unit: (0..n).map(|i| mass[(i, i)].abs().sqrt()).collect(),
            own,
            pairs,
            poles,
        })
    }

    fn refine(&self, table: &mut Table, tangents: &Tangents, steps: usize, w0: f64) {
        let tangents: Tangents = self.pairs.iter().map(|e| tangents[*e].clone()).collect();
        let mean = |f: &[f64]| f.iter().sum::<f64>() / f.len() as f64;
        let rates = tangents.iter().zip(&self.rate_traces);
        table.sum = self.linear_trace - rates.map(|((_, f_v), own)| own * mean(f_v)).sum::<f64>();
        let product = match &self.coordinates {
            Coordinates::Modes(modes) => modes.product(&tangents, steps, w0),
            Coordinates::States(states) => states.product(&tangents, steps, w0),
        };
        table.steps = steps;
        let n = self.own.len();
        let unit = |i: usize| self.unit[i % n];
        table.add(Mat::from_fn(2 * n, 2 * n, |i, j| product[(i, j)] * (unit(i) / unit(j))));
    }
}

/// All roots of a linear system; None where its mass is not positive.
fn eigenvalues(m: &Mat<f64>, c: &Mat<f64>, k: &Mat<f64>) -> Option<Vec<c64>> {
    let half = |a: &Mat<f64>, sign: f64| (a + a.transpose() * Scale(sign)) * Scale(0.5);
    let halves = |a: &Mat<f64>| (half(a, 1.0), half(a, -1.0));
    let ((c, g), (k, n)) = (halves(c), halves(k));
    let found = modes(&SecondOrder::new(half(m, 1.0), Some(c), Some(g), k, Some(n)).ok()?).ok()?;
    Some(found.s.into_iter().chain(found.partner).collect())
}

/// Coordinates by the parts that entries of the matrices or elements connect.
fn connected(problem: &Problem, (mass, damping, stiffness): &Matrices) -> Vec<Vec<usize>> {
    let n = mass.nrows();
    let mut first: Vec<usize> = (0..n).collect();
    for i in 0..n {
        for j in (0..n).filter(|j| [mass, damping, stiffness].iter().any(|m| m[(i, *j)] != 0.0)) {
            join(&mut first, i, j);
        }
    }
    problem.join_by_elements(&mut first);
    let roots: Vec<usize> = (0..n).map(|i| root(&mut first, i)).collect();
    let of = |r: usize| -> Vec<usize> { (0..n).filter(|i| roots[*i] == r).collect() };
    (0..n).filter(|r| roots[*r] == *r).map(of).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Extrapolated values that change by 1e-3 and then by `change`, of which the next change is the square over 1e-3.
    #[test]
    fn doubling_ends_where_the_next_change_is_below_a_ten_billionth() {
        let settled = |change: f64| {
            let (first, second) = (1.0, 1.0 + 0.75e-3);
            let extrapolated = second + (second - first) / 3.0;
            let third = (3.0 * (extrapolated + 15.0 / 16.0 * change) + second) / 4.0;
            let mut table = Table::default();
            [first, second, third].into_iter().for_each(|v| table.add(Mat::from_fn(1, 1, |_, _| v)));
            table.settled
        };
        assert_eq!([1e-6, 1e-7].map(settled), [false, true]);
    }
}
