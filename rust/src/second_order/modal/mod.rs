//! Modes of `(s^2 M + s (C + G) + K + N) phi = 0` with dense matrices: n modes of n degrees of freedom, always.
//!
//! The route is the cheapest stable one: a symmetric eigenproblem without damping or with damping that the undamped
//! modes diagonalise, a Hermitian one for conservative gyroscopic systems, else a general one on a state matrix in energy
//! coordinates. All routes work on the matrices scaled to unit masses and hand over `RawMode`s, which `finish` orders,
//! groups, normalises and judges.
mod certificate;
mod finish;
mod general;
mod graded;
mod light_damping;
mod pairing;
mod quality;
mod refine;
mod rigid;
mod simultaneous;
mod state;
mod subspace;
mod symmetric;

use faer::Mat;

use crate::error::Result;
use crate::linalg::dense::{C, cholesky};
use crate::run::Counts;
use crate::second_order::{SecondOrder, massless};

use crate::tolerances::matrices::PIVOT;
use crate::tolerances::modes::{GRADED, LIGHTEST, MASSLESS};
use quality::{Correction, Terms, corrected_roots};
pub use subspace::largest_component;

/// What a mode is. The list is closed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// s = 0: nothing holds it.
    Rigid,
    /// A complex pair with Re s <= 0.
    Vibration,
    /// Two real roots, none of them positive.
    Overdamped,
    /// A complex pair with Re s > 0.
    Flutter,
    /// Two real roots, one of them positive.
    Divergence,
}

impl Kind {
    /// As results tell it.
    pub fn name(self) -> &'static str {
        match self {
            Kind::Rigid => "rigid",
            Kind::Vibration => "vibration",
            Kind::Overdamped => "overdamped",
            Kind::Flutter => "flutter",
            Kind::Divergence => "divergence",
        }
    }
}

/// Modes in ascending |s|.
#[derive(Debug, Clone)]
pub struct Modal {
    /// Of a complex pair the root with Im > 0, of two real roots the larger one.
    pub s: Vec<C>,
    /// The other root of each pair.
    pub partner: Vec<C>,
    pub shape: Mat<C>,
    /// Left vectors, `psi^T Q(s) = 0`; None where they equal the shapes.
    pub left: Option<Mat<C>>,
    /// Shapes (and left vectors) of those partners that are real roots with a shape of their own: mode and column.
    pub partner_mode: Vec<usize>,
    pub partner_shape: Mat<C>,
    pub partner_left: Option<Mat<C>>,
    pub kind: Vec<Kind>,
    pub near_defective: Vec<bool>,
    /// Groups of repeated roots: first mode and number of modes.
    pub groups: Vec<(usize, usize)>,
    pub backward_error: Vec<f64>,
    pub condition: Vec<f64>,
    pub error: Vec<f64>,
    pub route: &'static str,
    pub counts: Counts,
}

/// True where light bodies may be lost in M beside heavy ones: a factor of M knows them. O(n^3), a small share of `modes`.
pub fn is_light(m: &Mat<f64>) -> bool {
    !cholesky(m.as_ref()).is_ok_and(|l| smallest_pivot(&l, m) >= LIGHTEST)
}

/// Of M = L L^T, relative to its diagonal: what elimination has left of the lightest motion.
fn smallest_pivot(l: &Mat<f64>, m: &Mat<f64>) -> f64 {
    (0..l.nrows()).map(|i| l[(i, i)].powi(2) / m[(i, i)]).fold(1.0, f64::min)
}

impl Modal {
    /// True where a frequency of an assembled model is less accurate than the factor of its stiffness would make it.
    pub fn blurred(&self) -> bool {
        let elastic = self.kind.iter().zip(&self.error).filter(|(kind, _)| **kind != Kind::Rigid);
        elastic.into_iter().any(|(_, error)| error.is_nan() || *error > GRADED)
    }

    /// Some of the modes, in ascending order, without shapes of their partners. A group that the choice cuts off keeps its number of modes,
    /// where its last modes are those that are missing.
    pub fn subset(&self, chosen: &[usize]) -> Modal {
        let columns = |a: &Mat<C>| Mat::from_fn(a.nrows(), chosen.len(), |i, k| a[(i, chosen[k])]);
        let roots = |a: &[C]| chosen.iter().map(|k| a[*k]).collect();
        let numbers = |a: &[f64]| chosen.iter().map(|k| a[*k]).collect();
        let group = |(first, count): &(usize, usize)| {
            let own = |k: &usize| (*first..first + count).contains(k);
            let (place, kept) = (chosen.iter().position(own)?, chosen.iter().filter(|k| own(k)).count());
            let is_last = place + kept == chosen.len() && chosen[place] == *first;
            Some((place, if is_last { *count } else { kept })).filter(|(_, count)| *count > 1)
        };
        Modal {
            s: roots(&self.s),
            partner: roots(&self.partner),
            shape: columns(&self.shape),
            left: self.left.as_ref().map(columns),
            partner_mode: Vec::new(),
            partner_shape: Mat::zeros(self.shape.nrows(), 0),
            partner_left: None,
            kind: chosen.iter().map(|k| self.kind[*k]).collect(),
            near_defective: chosen.iter().map(|k| self.near_defective[*k]).collect(),
            groups: self.groups.iter().filter_map(group).collect(),
            backward_error: numbers(&self.backward_error),
            condition: numbers(&self.condition),
            error: numbers(&self.error),
            route: self.route,
            counts: self.counts.clone(),
        }
    }
}

/// A mode as the routes find it: coordinates scaled to unit mass, any normalisation.
#[derive(Debug, Clone)]
pub(crate) struct RawMode {
    pub s: C,
    pub partner: C,
    pub x: Vec<C>,
    /// None where it equals x.
    pub y: Option<Vec<C>>,
    /// None where it is the conjugate of x.
    pub partner_x: Option<Vec<C>>,
    pub partner_y: Option<Vec<C>>,
    pub rigid: bool,
    /// What the route knows better than the residual of the assembled matrices.
    pub known: Option<Known>,
}

impl RawMode {
    /// All vectors that it has.
    fn vectors(&mut self) -> impl Iterator<Item = &mut Vec<C>> {
        let others = [&mut self.y, &mut self.partner_x, &mut self.partner_y];
        std::iter::once(&mut self.x).chain(others.into_iter().flatten())
    }
}

#[derive(Debug, Clone, Copy)]
pub(crate) struct Known {
    /// Relative error of s; of a rigid mode the root (rad/s) that rounding of the matrices may hide.
    pub error: f64,
    pub condition: f64,
    /// False where assembled matrices no longer hold what the factors know, so that their residual says nothing.
    pub residual_counts: bool,
}

#[derive(Debug, Clone)]
pub(crate) struct Raw {
    pub modes: Vec<RawMode>,
    pub route: &'static str,
    /// False where the two roots of every pair are known to be apart or the pair cannot be defective.
    pub may_be_defective: bool,
    pub correction: Correction,
}

/// All modes of a dense system. O(n^3).
pub fn modes(system: &SecondOrder) -> Result<Modal> {
    let solved = eigensolution(system)?;
    let mut found = solved.judged()?;
    found.counts.merge(&solved.counts);
    Ok(found)
}

/// The two roots of each mode.
pub type Pairs = Vec<(C, C)>;

/// Roots and shapes as a route has found them: neither ordered, grouped and normalised nor judged.
#[derive(Debug, Clone)]
pub struct Eigensolution {
    /// In units of its masses, by `scale`.
    system: SecondOrder,
    scale: Vec<f64>,
    raw: Raw,
    mass_pivot: f64,
    pub counts: Counts,
}

impl Eigensolution {
    /// Modes with their estimates of error. The counts are those of this step alone.
    pub fn judged(&self) -> Result<Modal> {
        finish::finish(&self.system, &self.scale, self.raw.clone(), Counts::default())
    }

    /// True where modes are real and uncoupled.
    pub fn is_uncoupled(&self) -> bool {
        matches!(self.raw.route, "undamped" | "proportional")
    }

    /// What rounding may hide in the squared frequency of each mode.
    pub fn noise(&self) -> Vec<f64> {
        let own = |mode: &RawMode| {
            let (error, square) = (mode.known.map_or(f64::NAN, |known| known.error), (mode.s * mode.partner).norm());
            if mode.rigid { error * error } else { (2.0 * error + 4.0 * f64::EPSILON) * square }
        };
        self.raw.modes.iter().map(own).collect()
    }

    /// All roots in ascending order of their modes, of a complex pair the one with Im > 0, with shapes of any size (columns): corrected to
    /// first order, not judged.
    pub fn roots(&self) -> (Vec<C>, Mat<C>) {
        let mut modes: Vec<&RawMode> = self.raw.modes.iter().collect();
        modes.sort_by(|a, b| a.s.norm().total_cmp(&b.s.norm()));
        let (mut s, mut vectors) = (Vec::new(), Vec::new());
        for mode in modes {
            s.push(mode.s);
            vectors.push((&mode.x, mode.y.as_ref().unwrap_or(&mode.x)));
            if mode.s.im == 0.0 {
                let x = mode.partner_x.as_ref().unwrap_or(&mode.x);
                s.push(mode.partner);
                vectors.push((x, mode.partner_y.as_ref().unwrap_or(x)));
            }
        }
        let n = self.scale.len();
        let mut x = Mat::from_fn(n, s.len(), |i, j| vectors[j].0[i]);
        let y = (!self.system.is_symmetric()).then(|| Mat::from_fn(n, s.len(), |i, j| vectors[j].1[i]));
        let y = y.as_ref().map_or(x.as_ref(), |y| y.as_ref());
        corrected_roots(&Terms::new(&self.system), &mut s, x.as_ref(), y, self.raw.correction);
        for j in 0..s.len() {
            for i in 0..n {
                x[(i, j)] *= self.scale[i];
            }
        }
        (s, x)
    }

    /// Pairs of roots with shapes of unit mass (columns) where modes are uncoupled; None where the mass matrix has a pivot of rounding.
    pub fn uncoupled(&self) -> Option<(Pairs, Mat<f64>)> {
        let modes = &self.raw.modes;
        if !self.is_uncoupled() || self.mass_pivot <= PIVOT {
            return None;
        }
        let shape = Mat::from_fn(self.scale.len(), modes.len(), |i, j| modes[j].x[i].re * self.scale[i]);
        Some((modes.iter().map(|mode| (mode.s, mode.partner)).collect(), shape))
    }
}

/// The first part of `modes`, which sums over modes need alone.
pub fn eigensolution(system: &SecondOrder) -> Result<Eigensolution> {
    let (system, scale) = system.scaled()?;
    let mut system = system.without_rounding();
    let mut counts = Counts::default();
    counts.add("cholesky factorisations", 1);
    let l = match &system.mf {
        None => cholesky(system.m.as_ref()).map_err(massless)?,
        Some(mf) => triangular(mf).map_err(massless)?,
    };
    if system.mf.as_ref().is_some_and(|mf| mf.nrows() > mf.ncols()) {
        system.mf = Some(l.transpose().to_owned()); // the same mass from as many rows as coordinates
    }
    let raw = solve(&system, &l, &mut counts)?;
    let mass_pivot = smallest_pivot(&l, &system.m);
    Ok(Eigensolution { system, scale, raw, mass_pivot, counts })
}

/// L of M = L L^T from a factor of M, heavy rows first: Householder's reflections then keep what the light rows hold.
fn triangular(mf: &Mat<f64>) -> std::result::Result<Mat<f64>, usize> {
    let n = mf.ncols();
    let size = |i: usize| (0..n).fold(0.0f64, |m, j| m.max(mf[(i, j)].abs()));
    let mut order: Vec<usize> = (0..mf.nrows()).collect();
    order.sort_by(|&a, &b| size(b).total_cmp(&size(a)));
    let sorted = Mat::from_fn(mf.nrows(), n, |i, j| mf[(order[i], j)]);
    let qr = sorted.qr();
    let r = qr.thin_R();
    let column = |j: usize| (0..=j).map(|i| r[(i, j)].powi(2)).sum::<f64>().sqrt();
    let massless = |i: &usize| r[(*i, *i)].abs() <= MASSLESS * column(*i) || !r[(*i, *i)].is_finite();
    match (0..n).find(massless) {
        Some(i) => Err(i),
        None => Ok(Mat::from_fn(n, n, |i, j| if i >= j { r[(j, i)] * r[(j, j)].signum() } else { 0.0 })),
    }
}

fn solve(system: &SecondOrder, l: &Mat<f64>, counts: &mut Counts) -> Result<Raw> {
    if system.is_symmetric() {
        match symmetric::solve(system, l, counts)? {
            Some(raw) => return Ok(raw),
            None => counts.add("proportionality tests failed", 1),
        }
    }
    general::solve(system, l, counts)
}

#[cfg(test)]
mod tests;
