//! The n lowest modes of large sparse systems by shift-invert: K x = lambda M x, symmetric.
//!
//! Two forms. Assembled: K and M as they are. Mixed: [x; f; lam] with element forces and constraints as unknowns,
//! [[K_geo - sigma M, G^T], [G, -compliance]], where a constraint is a row without compliance. Assembling K of a long chain of
//! bushings loses its lowest modes to a condition that grows like n^4; the mixed form keeps them.
use faer::prelude::*;
use faer::{Mat, MatMut, MatRef};

use crate::error::{Error, Result};
use crate::linalg::krylov::{Operator, Options, Ritz, Space};
use crate::linalg::sparse::{Csc, Factor, negative_eigenvalues};
use crate::run::{Cancel, Counts};

/// Share of eps |K|/|M| that the rounding of an assembled K moves its eigenvalues by, typical of chains (measured).
const ENTRY_NOISE: f64 = 0.05;
/// Rounding of a sum of some ten thousand positive energies.
const ROUNDING: f64 = 1e-14;
/// Largest system of which the whole operator is formed where nearly all modes are wanted.
const LARGEST_DENSE: usize = 2000;

pub struct SymmetricModes {
    /// lambda = omega^2, ascending; rigid ones exactly zero
    pub lambda: Vec<f64>,
    /// mass-normalised
    pub shape: Mat<f64>,
    /// |phi - (lambda - sigma) Op phi| in the mass norm: a bound of the relative error of lambda - sigma
    pub residual: Vec<f64>,
    /// estimated relative error of lambda; for rigid modes the absolute one, below which lambda cannot be told from zero
    pub error: Vec<f64>,
    pub rigid: usize,
    pub sigma: f64,
    /// a shift that would resolve modes which lie too close to zero for this one
    softer: Option<f64>,
    /// how it was made sure that no mode is missing: "inertia", "random restart" or "unverified"
    pub verified: &'static str,
    pub counts: Counts,
}

/// A symmetric pencil that can be shifted and inverted.
pub trait Pencil {
    fn dim(&self) -> usize;
    /// Dimension of the space that constraints leave, at least.
    fn free_dim(&self) -> usize;
    fn mass(&self) -> &Csc;
    fn shifted(&self, sigma: f64) -> Result<ShiftInvert<'_>>;
    /// Rayleigh quotients, where they can be had more accurately than the Ritz values.
    fn energies(&self, x: MatRef<'_, f64>) -> Option<Vec<f64>>;
    /// Number of eigenvalues below s, None where it cannot be told.
    fn count_below(&self, s: f64) -> Option<usize>;
    /// Upper bound of the order of magnitude of the largest eigenvalue.
    fn scale(&self) -> f64;
    /// Whether a factor at zero shift can be trusted to be that of a regular matrix.
    fn shifted_at_zero(&self) -> Result<Option<ShiftInvert<'_>>>;
}

/// x -> the first rows of A^-1 [M x; 0].
pub struct ShiftInvert<'a> {
    factor: Factor,
    m: &'a Csc,
}

impl Operator for ShiftInvert<'_> {
    fn dim(&self) -> usize {
        self.m.rows
    }

    fn apply(&self, x: MatRef<'_, f64>, mut out: MatMut<'_, f64>) -> Result<()> {
        let n = self.m.rows;
        if self.factor.n() == n {
            self.m.multiply(x, out.as_mut(), false);
            self.factor.solve(out);
            return Ok(());
        }
        let mut rhs = Mat::zeros(self.factor.n(), x.ncols());
        self.m.multiply(x, rhs.as_mut().subrows_mut(0, n), false);
        self.factor.solve(rhs.as_mut());
        out.copy_from(rhs.subrows(0, n));
        Ok(())
    }

    fn weigh(&self, x: MatRef<'_, f64>, out: MatMut<'_, f64>) {
        self.m.multiply(x, out, false);
    }
}

pub struct Assembled {
    pub m: Csc,
    pub k: Csc,
}

impl Assembled {
    pub fn new(m: Csc, k: Csc) -> Result<Self> {
        check_mass(&m)?;
        if k.rows != m.rows || k.cols != m.rows {
            return Err(Error::model(format!(
                "K is {} x {}, M has {} rows",
                k.rows, k.cols, m.rows
            )));
        }
        if !k.is_symmetric() {
            return Err(Error::model(
                "K is not symmetric; pass it with the damping matrix to the general solver",
            ));
        }
        Ok(Assembled { m, k })
    }
}

fn check_mass(m: &Csc) -> Result<()> {
    if m.rows == 0 || m.rows != m.cols {
        return Err(Error::model(format!(
            "M is {} x {}; it must be square",
            m.rows, m.cols
        )));
    }
    if !m.is_symmetric() {
        return Err(Error::model("M is not symmetric"));
    }
    if Factor::cholesky(m, 1e-14)?.is_none() {
        return Err(Error::singular(
            "the mass matrix is not positive definite: give every coordinate a mass",
        ));
    }
    Ok(())
}

impl Pencil for Assembled {
    fn dim(&self) -> usize {
        self.m.rows
    }

    fn free_dim(&self) -> usize {
        self.m.rows
    }

    fn mass(&self) -> &Csc {
        &self.m
    }

    fn shifted(&self, sigma: f64) -> Result<ShiftInvert<'_>> {
        let a = self.k.combined(1.0, -sigma, &self.m);
        let factor = match Factor::cholesky(&a, 0.0)? {
            Some(factor) => factor,
            None => Factor::lu(&a)?,
        };
        Ok(ShiftInvert { factor, m: &self.m })
    }

    fn energies(&self, _: MatRef<'_, f64>) -> Option<Vec<f64>> {
        None
    }

    fn count_below(&self, s: f64) -> Option<usize> {
        negative_eigenvalues(&self.k.combined(1.0, -s, &self.m))
    }

    fn scale(&self) -> f64 {
        ratio(&self.k.diagonal(), &self.m.diagonal())
    }

    fn shifted_at_zero(&self) -> Result<Option<ShiftInvert<'_>>> {
        let factor = Factor::cholesky(&self.k, 1e-12)?;
        Ok(factor.map(|factor| ShiftInvert { factor, m: &self.m }))
    }
}

fn ratio(k: &[f64], m: &[f64]) -> f64 {
    let largest = k
        .iter()
        .zip(m)
        .map(|(k, m)| k.abs() / m.max(f64::MIN_POSITIVE))
        .fold(0.0, f64::max);
    if largest > 0.0 && largest.is_finite() {
        largest
    } else {
        1.0
    }
}

/// The augmented form; `a` is the whole matrix at zero shift, its first rows belong to x.
pub struct Mixed {
    m: Csc,
    a: Csc,
    geometric: Csc,
    /// G: rows of elements and constraints over x
    rows: Csc,
    compliances: Vec<Compliance>,
}

/// Rows that share one block of compliance, and that block's inverse.
struct Compliance {
    rows: Vec<usize>,
    stiffness: Mat<f64>,
}

impl Mixed {
    pub fn new(m: Csc, a: Csc) -> Result<Self> {
        check_mass(&m)?;
        let (n, all) = (m.rows, a.rows);
        if a.cols != all || all < n {
            return Err(Error::model(format!(
                "the augmented matrix is {} x {}; it must be square with at least the {n} rows of M",
                a.rows, a.cols
            )));
        }
        if !a.is_symmetric() {
            return Err(Error::model("the augmented matrix is not symmetric"));
        }
        let compliances = compliances(&a.block(n..all, n..all))?;
        Ok(Mixed {
            geometric: a.block(0..n, 0..n),
            rows: a.block(n..all, 0..n),
            compliances,
            m,
            a,
        })
    }
}

/// Connected blocks of the lower right corner, -compliance; rows without any are constraints.
fn compliances(corner: &Csc) -> Result<Vec<Compliance>> {
    let n = corner.rows;
    let mut done = vec![false; n];
    let mut out = Vec::new();
    for first in 0..n {
        if done[first] || corner.column(first).all(|(_, v)| v == 0.0) {
            continue;
        }
        let mut rows = vec![first];
        done[first] = true;
        let mut next = 0;
        while next < rows.len() {
            for (i, v) in corner.column(rows[next]) {
                if v != 0.0 && !done[i] {
                    done[i] = true;
                    rows.push(i);
                }
            }
            next += 1;
        }
        let size = rows.len();
        if size > 64 {
            return Err(Error::model(format!(
                "a block of {size} coupled compliances; each element must have its own block of at most 64"
            )));
        }
        let block = Mat::from_fn(size, size, |i, j| -corner.get(rows[i], rows[j]));
        let llt = block.llt(faer::Side::Lower).map_err(|_| {
            Error::model(
                "a compliance block (minus the lower right corner) is not positive definite",
            )
        })?;
        let stiffness = llt.solve(Mat::<f64>::identity(size, size));
        out.push(Compliance { rows, stiffness });
    }
    Ok(out)
}

impl Pencil for Mixed {
    fn dim(&self) -> usize {
        self.m.rows
    }

    fn free_dim(&self) -> usize {
        let elastic: usize = self.compliances.iter().map(|c| c.rows.len()).sum();
        (self.m.rows + elastic).saturating_sub(self.rows.rows)
    }

    fn mass(&self) -> &Csc {
        &self.m
    }

    fn shifted(&self, sigma: f64) -> Result<ShiftInvert<'_>> {
        let factor = Factor::lu(&self.a.combined(1.0, -sigma, &self.m))?;
        Ok(ShiftInvert { factor, m: &self.m })
    }

    /// Energies are sums of positive terms over elements: accurate where x^T K x of an assembled K is all cancellation.
    fn energies(&self, x: MatRef<'_, f64>) -> Option<Vec<f64>> {
        let mut stretch = Mat::zeros(self.rows.rows, x.ncols());
        self.rows.multiply(x, stretch.as_mut(), false);
        let mut geometric = Mat::zeros(self.m.rows, x.ncols());
        self.geometric.multiply(x, geometric.as_mut(), false);
        let mut inertia = Mat::zeros(self.m.rows, x.ncols());
        self.m.multiply(x, inertia.as_mut(), false);
        let dot =
            |a: &Mat<f64>, c: usize| (0..x.nrows()).map(|i| x[(i, c)] * a[(i, c)]).sum::<f64>();
        let quotient = |c: usize| {
            let mut energy = 0.0;
            for element in &self.compliances {
                for (i, row) in element.rows.iter().enumerate() {
                    for (j, other) in element.rows.iter().enumerate() {
                        energy +=
                            stretch[(*row, c)] * element.stiffness[(i, j)] * stretch[(*other, c)];
                    }
                }
            }
            (energy + dot(&geometric, c)) / dot(&inertia, c)
        };
        Some((0..x.ncols()).map(quotient).collect())
    }

    fn count_below(&self, s: f64) -> Option<usize> {
        let negative = negative_eigenvalues(&self.a.combined(1.0, -s, &self.m))?;
        // Haynsworth: each row of an element or constraint adds one
        negative.checked_sub(self.rows.rows)
    }

    fn scale(&self) -> f64 {
        let mut stiffness: Vec<f64> = self.geometric.diagonal().iter().map(|k| k.abs()).collect();
        let mut of_row = vec![0.0; self.rows.rows];
        for element in &self.compliances {
            for (i, row) in element.rows.iter().enumerate() {
                of_row[*row] = element.stiffness[(i, i)];
            }
        }
        for (i, j, g) in self.rows.entries() {
            stiffness[j] += g * g * of_row[i];
        }
        ratio(&stiffness, &self.m.diagonal())
    }

    /// A singular matrix gives a factor all the same. What it solves for then violates x^T K x = x^T M w of x = K^-1 M w.
    fn shifted_at_zero(&self) -> Result<Option<ShiftInvert<'_>>> {
        let Ok(op) = self.shifted(0.0) else {
            return Ok(None);
        };
        let n = self.m.rows;
        let mut w = Mat::from_fn(n, 1, |i, _| ((i as f64) * 0.618_034 + 0.3).fract() - 0.5);
        for _ in 0..2 {
            let mut x = Mat::zeros(n, 1);
            op.apply(w.as_ref(), x.as_mut())?;
            let (mut mw, mut mx) = (Mat::zeros(n, 1), Mat::zeros(n, 1));
            self.m.multiply(w.as_ref(), mw.as_mut(), false);
            self.m.multiply(x.as_ref(), mx.as_mut(), false);
            let dot = |a: &Mat<f64>| (0..n).map(|i| x[(i, 0)] * a[(i, 0)]).sum::<f64>();
            let energy = self.energies(x.as_ref()).map_or(f64::NAN, |e| e[0]) * dot(&mx);
            let work = dot(&mw);
            let regular = (energy - work).abs() <= 1e-5 * work.abs();
            if !regular {
                return Ok(None);
            }
            w = x;
        }
        Ok(Some(op))
    }
}

/// The `wanted` modes nearest to the shift, by default the lowest.
pub fn lowest(
    pencil: &impl Pencil,
    wanted: usize,
    sigma: Option<f64>,
    cancel: &Cancel,
) -> Result<SymmetricModes> {
    if wanted == 0 || wanted > pencil.dim() {
        return Err(Error::model(format!(
            "n = {wanted} modes were asked for; the system has {} coordinates",
            pencil.dim()
        )));
    }
    let mut counts = Counts::default();
    let mut modes = around(
        pencil,
        wanted,
        start(pencil, wanted, sigma, &mut counts, cancel)?,
        cancel,
    )?;
    counts.merge(&modes.counts);
    for _ in 0..4 {
        let Some(softer) = modes.softer.filter(|_| sigma.is_none()) else {
            break;
        };
        counts.add("factorisations", 1);
        modes = around(pencil, wanted, (pencil.shifted(softer)?, softer), cancel)?;
        counts.merge(&modes.counts);
    }
    modes.counts = counts;
    Ok(modes)
}

fn around(
    pencil: &impl Pencil,
    wanted: usize,
    shift: (ShiftInvert<'_>, f64),
    cancel: &Cancel,
) -> Result<SymmetricModes> {
    let (op, sigma) = shift;
    let mut counts = Counts::default();
    let options = Options::new(wanted, true);
    if is_small(pencil, &options) {
        counts.add("dense eigensolutions", 1);
        let (theta, x) = every(pencil, &op, wanted)?;
        let mut modes = finish(pencil, &op, x, &theta, sigma)?;
        (modes.verified, modes.counts) = ("all computed", counts);
        return Ok(modes);
    }
    let mut space = Space::new(&op, options)?;
    let mut ritz = space.converge(cancel)?;
    let mut verified = "unverified";
    for _ in 0..5 {
        match missed(pencil, &ritz, wanted, sigma, &mut counts) {
            Some(false) => {
                verified = "inertia";
                break;
            }
            Some(true) => {
                space.restart_afresh(&ritz, wanted)?;
                ritz = space.converge(cancel)?;
            }
            None => {
                let known: Vec<f64> = ritz.value.iter().take(wanted).map(|v| v.re).collect();
                space.restart_afresh(&ritz, wanted)?;
                ritz = space.converge(cancel)?;
                let same = |(a, b): (&f64, &faer::c64)| (a - b.re).abs() <= 1e-9 * a.abs();
                if known.iter().zip(&ritz.value).all(same) {
                    verified = "random restart";
                    break;
                }
            }
        }
    }
    counts.merge(&space.counts);
    let theta: Vec<f64> = ritz.value.iter().take(wanted).map(|v| v.re).collect();
    let mut modes = finish(
        pencil,
        &op,
        space.real_vectors(&ritz, wanted),
        &theta,
        sigma,
    )?;
    modes.verified = verified;
    modes.counts = counts;
    Ok(modes)
}

/// A Krylov basis would exhaust the space: then the operator is taken whole.
fn is_small(pencil: &impl Pencil, options: &Options) -> bool {
    pencil.free_dim() < options.dim + 3 * options.block
}

/// All eigenpairs of L^T Op L^-T, of which the `wanted` largest are returned.
fn every(
    pencil: &impl Pencil,
    op: &ShiftInvert<'_>,
    wanted: usize,
) -> Result<(Vec<f64>, Mat<f64>)> {
    let n = pencil.dim();
    if n > LARGEST_DENSE {
        return Err(Error::model(format!(
            "{wanted} modes were asked for and about {} exist among {n} coordinates: use minimal coordinates",
            pencil.free_dim()
        )));
    }
    let m = Mat::from_fn(n, n, |i, j| pencil.mass().get(i, j));
    let l = m
        .llt(faer::Side::Lower)
        .map_err(|_| Error::singular("the mass matrix is not positive definite"))?;
    let l = l.L();
    // Op L^-T = A^-1 L restricted to the coordinates
    let mut columns = Mat::<f64>::identity(n, n);
    l.transpose().solve_upper_triangular_in_place(&mut columns);
    let mut x = Mat::zeros(n, n);
    op.apply(columns.as_ref(), x.as_mut())?;
    let b = l.transpose() * &x;
    if !crate::linalg::quadratic::is_finite(b.as_ref()) {
        return Err(Error::singular(
            "the shifted matrix is singular; use another shift sigma",
        ));
    }
    let symmetric = Mat::from_fn(n, n, |i, j| 0.5 * (b[(i, j)] + b[(j, i)]));
    let eigen = symmetric
        .self_adjoint_eigen(faer::Side::Lower)
        .map_err(|_| Error::singular("the dense eigenproblem did not converge"))?;
    let mut order: Vec<usize> = (0..n).collect();
    order.sort_by(|a, b| eigen.S()[*b].abs().total_cmp(&eigen.S()[*a].abs()));
    let largest = order.first().map_or(0.0, |k| eigen.S()[*k].abs());
    // constraints leave exact zeros, which rounding blurs
    order.retain(|k| eigen.S()[*k].abs() > 1e-13 * largest);
    if order.len() < wanted {
        return Err(Error::model(format!(
            "n = {wanted} modes were asked for, but the constraints leave {}",
            order.len()
        )));
    }
    order.truncate(wanted);
    let mut shape = Mat::from_fn(n, wanted, |i, j| eigen.U()[(i, order[j])]);
    l.transpose().solve_upper_triangular_in_place(&mut shape);
    Ok((order.iter().map(|k| eigen.S()[*k]).collect(), shape))
}

fn start<'a>(
    pencil: &'a impl Pencil,
    wanted: usize,
    sigma: Option<f64>,
    counts: &mut Counts,
    cancel: &Cancel,
) -> Result<(ShiftInvert<'a>, f64)> {
    counts.add("factorisations", 1);
    if let Some(sigma) = sigma {
        if !sigma.is_finite() {
            return Err(Error::model(format!("sigma = {sigma} is not finite")));
        }
        return Ok((pencil.shifted(sigma)?, sigma));
    }
    if let Some(op) = pencil.shifted_at_zero()? {
        return Ok((op, 0.0));
    }
    // free or nearly so: a negative shift between the first elastic eigenvalue and the last wanted one, found from coarse
    // Ritz values; these lie too high, so the shift only ever comes down
    let mut sigma = -1e-4 * pencil.scale();
    if is_small(pencil, &Options::new(wanted, true)) {
        return Ok((pencil.shifted(sigma)?, sigma));
    }
    for _ in 0..12 {
        counts.add("factorisations", 1);
        let op = pencil.shifted(sigma)?;
        let options = Options::new(wanted, true);
        let coarse = Options {
            dim: (wanted + 2 * options.block).div_ceil(options.block) * options.block,
            ..options
        };
        let mut space = Space::new(&op, coarse)?;
        let ritz = space.cycle(cancel)?;
        counts.merge(&space.counts);
        let elastic = ritz
            .value
            .iter()
            .filter(|theta| theta.re > 0.0)
            .map(|theta| sigma + 1.0 / theta.re);
        let first = elastic
            .filter(|l| *l > 1e-7 * sigma.abs())
            .fold(f64::INFINITY, f64::min);
        if 30.0 * first >= sigma.abs() {
            return Ok((op, sigma));
        }
        sigma = -10.0 * first;
    }
    counts.add("factorisations", 1);
    Ok((pencil.shifted(sigma)?, sigma))
}

/// Whether eigenvalues nearer to the shift than the wanted ones were overlooked; None where inertia cannot tell.
fn missed(
    pencil: &impl Pencil,
    ritz: &Ritz,
    wanted: usize,
    sigma: f64,
    counts: &mut Counts,
) -> Option<bool> {
    let distance = |k: usize| 1.0 / ritz.value[k].norm();
    // the last of the wanted ones that is followed by a gap, so that a group cut in two is not counted
    let total = ritz.value.iter().take_while(|v| v.norm() > 0.0).count();
    let cut = (1..=wanted.min(total))
        .rev()
        .find(|c| *c == total || distance(*c) > distance(c - 1) * (1.0 + 1e-6))?;
    let gap = if cut < total {
        distance(cut) - distance(cut - 1)
    } else {
        f64::INFINITY
    };
    let radius = distance(cut - 1) + (0.5 * gap).min(1e-3 * distance(cut - 1));
    counts.add("inertia counts", 2);
    let above = pencil.count_below(sigma + radius)?;
    let below = pencil.count_below(sigma - radius)?;
    Some(above.saturating_sub(below) > cut)
}

fn finish(
    pencil: &impl Pencil,
    op: &ShiftInvert<'_>,
    x: Mat<f64>,
    values: &[f64],
    sigma: f64,
) -> Result<SymmetricModes> {
    let (n, wanted) = (pencil.dim(), values.len());
    // one more inverse iteration: it shows the residual and improves the shapes
    let mut y = Mat::zeros(n, wanted);
    op.apply(x.as_ref(), y.as_mut())?;
    let mut residual = vec![0.0; wanted];
    for k in 0..wanted {
        let theta = values[k];
        let difference = Mat::from_fn(n, 1, |i, _| y[(i, k)] / theta - x[(i, k)]);
        residual[k] = mass_norm(pencil.mass(), difference.as_ref());
        // deterministic sign: the largest component is positive
        let largest = (0..n).fold(0, |a, i| {
            if y[(i, k)].abs() > y[(a, k)].abs() {
                i
            } else {
                a
            }
        });
        let norm = mass_norm(pencil.mass(), y.subcols(k, 1)).copysign(y[(largest, k)]);
        for i in 0..n {
            y[(i, k)] /= norm;
        }
    }
    let from_energy = pencil.energies(y.as_ref());
    // what the entries of an assembled K leave of its low eigenvalues; sums of energies lose nothing of the kind
    let exact = from_energy.is_some();
    let data = if exact {
        0.0
    } else {
        ENTRY_NOISE * f64::EPSILON * pencil.scale()
    };
    let mut lambda =
        from_energy.unwrap_or_else(|| (0..wanted).map(|k| sigma + 1.0 / values[k]).collect());
    let mut error = vec![0.0; wanted];
    let (mut rigid, mut softest) = (0, f64::INFINITY);
    for k in 0..wanted {
        let from_vector = residual[k].powi(2) * ((lambda[k] - sigma) / lambda[k]).abs();
        // below it lambda cannot be told from zero
        let floor = match exact {
            true => 1e3 * residual[k].powi(2) * sigma.abs() + 1e-26 * pencil.scale(),
            false => 1e-12 * sigma.abs() + 1e2 * data,
        };
        if sigma != 0.0 && lambda[k].abs() <= floor {
            error[k] = floor;
            lambda[k] = 0.0;
            rigid += 1;
            continue;
        }
        if lambda[k] > 0.0 && lambda[k] < 1e-6 * sigma.abs() {
            softest = softest.min(lambda[k]);
        }
        error[k] = data / lambda[k].abs() + from_vector + ROUNDING;
    }
    let mut order: Vec<usize> = (0..wanted).collect();
    order.sort_by(|a, b| lambda[*a].total_cmp(&lambda[*b]));
    Ok(SymmetricModes {
        lambda: order.iter().map(|k| lambda[*k]).collect(),
        residual: order.iter().map(|k| residual[*k]).collect(),
        error: order.iter().map(|k| error[*k]).collect(),
        shape: Mat::from_fn(n, wanted, |i, j| y[(i, order[j])]),
        rigid,
        sigma,
        softer: softest.is_finite().then_some(-10.0 * softest),
        verified: "unverified",
        counts: Counts::default(),
    })
}

fn mass_norm(m: &Csc, x: MatRef<'_, f64>) -> f64 {
    let mut weighed = Mat::zeros(m.rows, 1);
    m.multiply(x, weighed.as_mut(), false);
    let sum: f64 = (0..m.rows).map(|i| x[(i, 0)] * weighed[(i, 0)]).sum();
    sum.max(0.0).sqrt()
}
