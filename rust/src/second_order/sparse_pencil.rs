//! Symmetric pencils K x = lambda M x that can be shifted and inverted, in two forms.
//!
//! Assembled: K and M as they are. Mixed: [x; f; lam] with element forces and constraints as unknowns,
//! [[K_geo - sigma M, G^T], [G, -compliance]], where a constraint is a row without compliance. Assembling K of a long chain of
//! bushings loses its lowest modes to a condition that grows like n^4; the mixed form keeps them.
use std::cell::RefCell;

use faer::prelude::*;
use faer::{Mat, MatMut, MatRef};

use crate::error::{Error, Result};
use crate::linalg::dense::cholesky;
use crate::linalg::krylov::Operator;
use crate::linalg::sparse::{Csc, Factor, LuPlan, negative_eigenvalues};
use crate::tolerances::matrices::{MASS_PIVOT, STIFFNESS_PIVOT};
use crate::tolerances::modes::SEMIDEFINITE;
use crate::tolerances::sparse_modes::TOLD;

/// Rows of one element, at most.
const LARGEST_BLOCK: usize = 64;

/// A symmetric pencil that can be shifted and inverted.
pub trait Pencil {
    fn dim(&self) -> usize;
    /// Dimension of the space that constraints leave, at least.
    fn free_dim(&self) -> usize;
    fn mass(&self) -> &Csc;
    fn shifted(&self, sigma: f64) -> Result<ShiftInvert<'_>>;
    /// Rayleigh quotients, where they can be had more accurately than the Ritz values.
    fn energies(&self, x: MatRef<'_, f64>) -> Option<Vec<f64>>;
    /// Stretches w of elements with x^T K x = |w|^2, where nothing else has a share in the energy.
    fn strains(&self, _x: MatRef<'_, f64>) -> Option<Mat<f64>> {
        None
    }
    /// Change of each eigenvalue, at most, for a relative change of every entry of the rows, from the forces in them.
    fn row_sensitivity(&self, _forces: MatRef<'_, f64>, y: MatRef<'_, f64>) -> Vec<f64> {
        vec![0.0; y.ncols()]
    }
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
    /// right-hand sides of the augmented system; fresh memory for each solve would cost as much as the solve
    rhs: RefCell<Mat<f64>>,
}

impl<'a> ShiftInvert<'a> {
    fn new(factor: Factor, m: &'a Csc) -> Self {
        ShiftInvert { factor, m, rhs: RefCell::new(Mat::new()) }
    }

    /// The first rows of A^-1 [f; 0].
    pub fn solve(&self, force: MatRef<'_, f64>) -> Mat<f64> {
        let mut rhs = Mat::zeros(self.factor.n(), force.ncols());
        rhs.as_mut().subrows_mut(0, force.nrows()).copy_from(force);
        self.factor.solve(rhs.as_mut());
        rhs.subrows(0, force.nrows()).to_owned()
    }

    /// Forces in the rows of the last solution, one column for each right-hand side.
    pub fn forces(&self, columns: usize) -> Mat<f64> {
        let (solved, n) = (self.rhs.borrow(), self.m.rows);
        Mat::from_fn(self.factor.n() - n, columns, |i, c| solved[(n + i, c)])
    }
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
        let mut rhs = self.rhs.borrow_mut();
        if rhs.ncols() != x.ncols() {
            *rhs = Mat::zeros(self.factor.n(), x.ncols());
        }
        self.m.multiply(x, rhs.as_mut().subrows_mut(0, n), false);
        rhs.as_mut().subrows_mut(n, self.factor.n() - n).fill(0.0);
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
            return Err(Error::model(format!("K is {} x {}, M has {} rows", k.rows, k.cols, m.rows)));
        }
        if !k.is_symmetric() {
            return Err(Error::model("K is not symmetric; pass it with the damping matrix to the general solver"));
        }
        Ok(Assembled { m, k })
    }
}

fn check_mass(m: &Csc) -> Result<()> {
    if m.rows == 0 || m.rows != m.cols {
        return Err(Error::model(format!("M is {} x {}; it must be square", m.rows, m.cols)));
    }
    if !m.is_symmetric() {
        return Err(Error::model("M is not symmetric"));
    }
    if Factor::cholesky(m, MASS_PIVOT)?.is_none() {
        return Err(Error::singular("the mass matrix is not positive definite: give every coordinate a mass"));
    }
    Ok(())
}

fn check_semidefinite(m: &Csc) -> Result<()> {
    if m.rows == 0 || m.rows != m.cols {
        return Err(Error::model(format!("M is {} x {}; it must be square", m.rows, m.cols)));
    }
    if !m.is_symmetric() {
        return Err(Error::model("M is not symmetric"));
    }
    let diagonal = m.diagonal();
    let lifted = |v: f64| if v > 0.0 { SEMIDEFINITE * v } else { 1.0 };
    let added = diagonal.iter().enumerate().map(|(i, v)| (i, i, lifted(*v))).collect();
    let regular = m.combined(1.0, 1.0, &Csc::from_entries(m.rows, m.rows, added));
    if diagonal.iter().all(|v| *v == 0.0) || Factor::cholesky(&regular, 0.0)?.is_none() {
        return Err(Error::singular(
            "the mass matrix is neither positive definite nor semidefinite: check masses and inertias",
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
        Ok(ShiftInvert::new(factor, &self.m))
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
        let factor = Factor::cholesky(&self.k, STIFFNESS_PIVOT)?;
        Ok(factor.map(|factor| ShiftInvert::new(factor, &self.m)))
    }
}

fn ratio(k: &[f64], m: &[f64]) -> f64 {
    let largest = k.iter().zip(m).filter(|(_, m)| **m > 0.0).map(|(k, m)| k.abs() / m).fold(0.0, f64::max);
    if largest > 0.0 && largest.is_finite() { largest } else { 1.0 }
}

/// The augmented form; `a` is the whole matrix at zero shift, its first rows belong to x.
pub struct Mixed {
    m: Csc,
    a: Csc,
    geometric: Csc,
    /// G: rows of elements and constraints over x
    rows: Csc,
    stiffness: Stiffness,
    plan: LuPlan,
}

/// Element stiffness: of rows alone, zero for constraints and for rows of a block, and of blocks of coupled rows.
struct Stiffness {
    single: Vec<f64>,
    blocks: Vec<Coupled>,
}

struct Coupled {
    rows: Vec<usize>,
    stiffness: Mat<f64>,
    /// lower triangular L with L L^T the stiffness
    root: Mat<f64>,
}

impl Coupled {
    /// w of its rows with s^T K s = |w|^2.
    fn weighed(&self, stretch: &Mat<f64>, c: usize) -> Vec<f64> {
        let of = |i: usize| (i..self.rows.len()).map(|j| self.root[(j, i)] * stretch[(self.rows[j], c)]).sum();
        (0..self.rows.len()).map(of).collect()
    }
}

impl Mixed {
    /// M may be semidefinite: point masses have no inertia to turn, rods none about their own axes.
    pub fn new(m: Csc, a: Csc) -> Result<Self> {
        check_semidefinite(&m)?;
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
        let stiffness = Stiffness::new(&a.block(n..all, n..all))?;
        Ok(Mixed {
            geometric: a.block(0..n, 0..n),
            rows: a.block(n..all, 0..n),
            stiffness,
            m,
            a,
            plan: LuPlan::default(),
        })
    }

    fn weighed_stretches(&self, x: MatRef<'_, f64>) -> Mat<f64> {
        let mut stretch = Mat::zeros(self.rows.rows, x.ncols());
        self.rows.multiply(x, stretch.as_mut(), false);
        self.stiffness.weigh(&mut stretch);
        stretch
    }
}

impl Stiffness {
    /// From the lower right corner, -compliance; rows without any are constraints.
    fn new(corner: &Csc) -> Result<Self> {
        let n = corner.rows;
        let refuse = || Error::model("a compliance block (minus the lower right corner) is not positive definite");
        let mut out = Stiffness { single: vec![0.0; n], blocks: Vec::new() };
        let mut done = vec![false; n];
        for first in 0..n {
            if done[first] {
                continue;
            }
            let rows = connected(corner, first, &mut done)?;
            if rows.len() > 1 {
                let block = Mat::from_fn(rows.len(), rows.len(), |i, j| -corner.get(rows[i], rows[j]));
                let llt = block.llt(faer::Side::Lower).map_err(|_| refuse())?;
                let stiffness = llt.solve(Mat::<f64>::identity(rows.len(), rows.len()));
                let root = cholesky(stiffness.as_ref()).map_err(|_| refuse())?;
                out.blocks.push(Coupled { rows, stiffness, root });
                continue;
            }
            let compliance = -corner.get(first, first);
            if compliance < 0.0 {
                return Err(refuse());
            }
            if compliance > 0.0 {
                out.single[first] = 1.0 / compliance;
            }
        }
        Ok(out)
    }

    /// Rows that are not constraints.
    fn elastic_rows(&self) -> usize {
        let single = self.single.iter().filter(|k| **k > 0.0).count();
        single + self.blocks.iter().map(|b| b.rows.len()).sum::<usize>()
    }

    /// Stretches become w with the energies |w|^2; constraints have none.
    fn weigh(&self, stretch: &mut Mat<f64>) {
        for c in 0..stretch.ncols() {
            let own: Vec<Vec<f64>> = self.blocks.iter().map(|b| b.weighed(stretch, c)).collect();
            self.single.iter().enumerate().for_each(|(i, k)| stretch[(i, c)] *= k.sqrt());
            for (block, own) in self.blocks.iter().zip(own) {
                block.rows.iter().zip(own).for_each(|(row, w)| stretch[(*row, c)] = w);
            }
        }
    }

    fn diagonal(&self) -> Vec<f64> {
        let mut diagonal = self.single.clone();
        for block in &self.blocks {
            for (i, row) in block.rows.iter().enumerate() {
                diagonal[*row] = block.stiffness[(i, i)];
            }
        }
        diagonal
    }
}

/// Rows that share compliance with the first one.
fn connected(corner: &Csc, first: usize, done: &mut [bool]) -> Result<Vec<usize>> {
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
        if rows.len() > LARGEST_BLOCK {
            return Err(Error::model(format!(
                "more than {LARGEST_BLOCK} coupled compliances; each element must have a block of its own"
            )));
        }
    }
    Ok(rows)
}

impl Pencil for Mixed {
    fn dim(&self) -> usize {
        self.m.rows
    }

    fn free_dim(&self) -> usize {
        (self.m.rows + self.stiffness.elastic_rows()).saturating_sub(self.rows.rows)
    }

    fn mass(&self) -> &Csc {
        &self.m
    }

    fn shifted(&self, sigma: f64) -> Result<ShiftInvert<'_>> {
        let factor = Factor::lu_as_planned(&self.a.combined(1.0, -sigma, &self.m), &self.plan)?;
        Ok(ShiftInvert::new(factor, &self.m))
    }

    /// Energies are sums of positive terms over elements: accurate where x^T K x of an assembled K is all cancellation.
    fn energies(&self, x: MatRef<'_, f64>) -> Option<Vec<f64>> {
        let w = self.weighed_stretches(x);
        let mut geometric = Mat::zeros(self.m.rows, x.ncols());
        self.geometric.multiply(x, geometric.as_mut(), false);
        let mut inertia = Mat::zeros(self.m.rows, x.ncols());
        self.m.multiply(x, inertia.as_mut(), false);
        let dot = |a: &Mat<f64>, c: usize| (0..x.nrows()).map(|i| x[(i, c)] * a[(i, c)]).sum::<f64>();
        let energy = |c: usize| (0..w.nrows()).map(|i| w[(i, c)] * w[(i, c)]).sum::<f64>() + dot(&geometric, c);
        Some((0..x.ncols()).map(|c| energy(c) / dot(&inertia, c)).collect())
    }

    fn strains(&self, x: MatRef<'_, f64>) -> Option<Mat<f64>> {
        let elastic = self.geometric.entries().all(|(_, _, v)| v == 0.0);
        elastic.then(|| self.weighed_stretches(x))
    }

    /// A change dG of the rows changes lambda by 2 f^T dG y / y^T M y, f the forces in them.
    fn row_sensitivity(&self, forces: MatRef<'_, f64>, y: MatRef<'_, f64>) -> Vec<f64> {
        let n = self.m.rows;
        let mut inertia = Mat::zeros(n, y.ncols());
        self.m.multiply(y, inertia.as_mut(), false);
        let mut sum = vec![0.0; y.ncols()];
        for (c, sum) in sum.iter_mut().enumerate() {
            let terms = self.rows.entries().map(|(i, j, g)| (forces[(i, c)] * g * y[(j, c)]).abs()).sum::<f64>();
            *sum = 2.0 * terms / (0..n).map(|i| y[(i, c)] * inertia[(i, c)]).sum::<f64>();
        }
        sum
    }

    fn count_below(&self, s: f64) -> Option<usize> {
        let negative = negative_eigenvalues(&self.a.combined(1.0, -s, &self.m))?;
        // Haynsworth: each row of an element or constraint adds one
        negative.checked_sub(self.rows.rows)
    }

    fn scale(&self) -> f64 {
        let mut stiffness: Vec<f64> = self.geometric.diagonal().iter().map(|k| k.abs()).collect();
        let of_row = self.stiffness.diagonal();
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
            let regular = (energy - work).abs() <= TOLD * work.abs();
            if !regular {
                return Ok(None);
            }
            w = x;
        }
        Ok(Some(op))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// [[1, c], [c, 1 + p]] with c = 1 or -1: the last pivot is p.
    fn nearly_singular(c: f64, p: f64) -> Csc {
        Csc::from_entries(2, 2, vec![(0, 0, 1.0), (1, 0, c), (0, 1, c), (1, 1, 1.0 + p)])
    }

    fn unit() -> Csc {
        Csc::from_entries(2, 2, vec![(0, 0, 1.0), (1, 1, 1.0)])
    }

    #[test]
    fn masses_are_refused_from_their_bound_on() {
        assert!(Assembled::new(nearly_singular(1.0, 1e-13), unit()).is_ok());
        assert!(Assembled::new(nearly_singular(1.0, 1e-15), unit()).is_err());
    }

    #[test]
    fn a_zero_shift_is_given_up_from_its_bound_on() -> Result<()> {
        let held = |p: f64| -> Result<bool> {
            Ok(Assembled::new(unit(), nearly_singular(-1.0, p))?.shifted_at_zero()?.is_some())
        };
        assert!(held(1e-11)? && !held(1e-13)?);
        Ok(())
    }
}
