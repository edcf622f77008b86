//! How far a squared frequency can be from the exact one, without units, and what improves it.
//!
//! With approximate shapes X, quotients lambda_j and residuals r_j = K x_j - lambda_j M x_j, X^T K X and X^T M X have the same roots
//! as K and M. Scaled by 1/sqrt(lambda_i lambda_j) their off-diagonal part is e_ij = x_i^T r_j / sqrt(lambda_i lambda_j); a root moves by
//! at most about sum_i e_ij min(1, e_ij/gap_ij) of itself, gap_ij = |lambda_i - lambda_j|/sqrt(lambda_i lambda_j) (J. Barlow and
//! J. Demmel, SIAM J. Numer. Anal. 27 (1990) 762-791, and two-by-two blocks for the second order). The step X += X C,
//! C_ij = x_i^T r_j/(lambda_j - lambda_i), with residuals in twice the precision squares the error (P. I. Davies and M. I. Modi,
//! Linear Algebra Appl. 79 (1986) 73-81; T. Ogita and K. Aishima, Japan J. Indust. Appl. Math. 35 (2018) 1007-1035).
use faer::{Mat, MatRef};

use crate::linalg::dense::{EPS, absolute, exceeds, symmetrised};
use crate::linalg::double_double::{Dd, dot, matrix_times};
use crate::linalg::eigen;
use crate::run::Counts;
use crate::second_order::SecondOrder;
use crate::tolerances::matrices::ENTRY_ROUNDING;
use crate::tolerances::modes::{CANCELLING, CLOSEST, DATA_ROUNDING, SHARP};

const PASSES: usize = 4;
/// Half the distance between 1 and the next number.
const U: f64 = 0.5 * EPS;

/// Shapes in two parts (hi + lo), x^T M x = 1, with squared frequencies; the first `rigid` have none.
pub struct Approximation<'a> {
    system: &'a SecondOrder,
    pub x: Mat<f64>,
    low: Option<Mat<f64>>,
    pub lambda: Vec<f64>,
    pub rigid: usize,
    /// K X and M X in working precision.
    images: (Mat<f64>, Mat<f64>),
    /// What the terms of each quotient add up to: of K with the sizes of the terms that were added up in each entry, of its factor
    /// |F x|^T |F| |x|, of M as |x|^T |M| |x|.
    stiffness: Vec<f64>,
    mass: Vec<f64>,
    /// | |F| |x| |^2 of a factor, else as `stiffness`.
    size: Vec<f64>,
    /// Relative error of lambda by the algorithm.
    pub bound: Vec<f64>,
}

impl<'a> Approximation<'a> {
    /// The first `candidates` columns are those that a rank decision calls free; each is rigid only if its own strain energy is
    /// rounding of what was added up.
    pub fn new(system: &'a SecondOrder, x: Mat<f64>, candidates: usize, counts: &mut Counts) -> Self {
        let mut made = Approximation::of(system, x);
        made.rotate(0, candidates, 0.0);
        made.low = None;
        made.measure();
        made.sort(candidates);
        made.judge(counts);
        made
    }

    /// With a factor of K, whose geometry has decided that the first `rigid` columns are rigid.
    pub fn with_rigid(system: &'a SecondOrder, x: Mat<f64>, rigid: usize, counts: &mut Counts) -> Self {
        let mut made = Approximation::of(system, x);
        made.low = Some(Mat::zeros(made.x.nrows(), made.x.ncols()));
        made.rigid = rigid;
        made.measure();
        made.lambda[..rigid].fill(0.0);
        made.judge(counts);
        made
    }

    fn of(system: &'a SecondOrder, x: Mat<f64>) -> Self {
        let n = x.ncols();
        Approximation {
            system,
            x,
            low: None,
            lambda: vec![0.0; n],
            rigid: 0,
            images: (Mat::zeros(0, 0), Mat::zeros(0, 0)),
            stiffness: vec![0.0; n],
            mass: vec![1.0; n],
            size: vec![0.0; n],
            bound: vec![0.0; n],
        }
    }

    /// Relative error of s by rounding of the entries of K and M before they were given.
    pub fn data(&self, j: usize) -> f64 {
        match self.system.kf {
            Some(_) => DATA_ROUNDING * U * self.condition(j),
            None => 0.5 * DATA_ROUNDING * U * (self.size[j] / self.lambda[j].abs() + self.mass[j]),
        }
    }

    /// Squared frequency that the same rounding may give to a rigid mode.
    pub fn noise(&self, j: usize) -> f64 {
        if self.system.kf.is_some() {
            return (DATA_ROUNDING * U).powi(2) * self.size[j];
        }
        // an entry that was taken for rounding may have been a coupling with the stiffest coordinate
        let largest = (0..self.x.nrows()).fold(0.0f64, |m, i| m.max(self.system.k[(i, i)].abs()));
        DATA_ROUNDING * U * self.size[j] + (ENTRY_ROUNDING * EPS).powi(2) * largest
    }

    /// Relative change of s for a relative change of every entry, of M and of K or its factor.
    pub fn condition(&self, j: usize) -> f64 {
        let share = if self.system.kf.is_some() { 1.0 } else { 0.5 };
        share * self.stiffness[j] / self.lambda[j].abs() + 0.5 * self.mass[j]
    }

    /// Where the algorithm adds to the error of the data, or to the last digits.
    fn is_poor(&self, j: usize) -> bool {
        j >= self.rigid && exceeds(self.bound[j], SHARP.max(0.5 * self.data(j)))
    }

    pub fn is_sharp(&self) -> bool {
        (0..self.lambda.len()).all(|j| !self.is_poor(j))
    }

    pub fn worst(&self) -> f64 {
        let excess = |j: usize| self.bound[j] / SHARP.max(0.5 * self.data(j));
        (self.rigid..self.lambda.len()).map(excess).fold(0.0, |m, v| if v.is_nan() { f64::INFINITY } else { m.max(v) })
    }

    fn column(&self, j: usize) -> Vec<Dd> {
        let low = |i: usize| self.low.as_ref().map_or(0.0, |l| l[(i, j)]);
        (0..self.x.nrows()).map(|i| Dd { hi: self.x[(i, j)], lo: low(i) }).collect()
    }

    fn set_column(&mut self, j: usize, x: &[Dd]) {
        let n = x.len();
        let low = self.low.get_or_insert_with(|| Mat::zeros(n, n));
        for (i, x) in x.iter().enumerate() {
            let x = x.normalised();
            (self.x[(i, j)], low[(i, j)]) = (x.hi, x.lo);
        }
    }

    fn mass_times(&self, x: &[Dd]) -> Vec<Dd> {
        match &self.system.mf {
            None => matrix_times(self.system.m.as_ref(), x, false),
            Some(mf) => matrix_times(mf.as_ref(), &matrix_times(mf.as_ref(), x, false), true),
        }
    }

    fn stiffness_times(&self, x: &[Dd]) -> Vec<Dd> {
        match &self.system.kf {
            None => matrix_times(self.system.k.as_ref(), x, false),
            Some(kf) => matrix_times(kf.as_ref(), &matrix_times(kf.as_ref(), x, false), true),
        }
    }

    /// Rayleigh quotient and mass of one column in twice the precision.
    fn quotient(&self, x: &[Dd]) -> (f64, f64) {
        let energy = match &self.system.kf {
            None => dot(x, &self.stiffness_times(x)),
            Some(kf) => {
                let strain = matrix_times(kf.as_ref(), x, false);
                dot(&strain, &strain)
            }
        };
        let mass = dot(x, &self.mass_times(x)).value();
        (energy.value() / mass, mass)
    }

    /// Rayleigh-Ritz inside a group of columns whose quotients are near `shift`.
    fn rotate(&mut self, first: usize, count: usize, shift: f64) {
        if count < 2 {
            return;
        }
        let columns: Vec<Vec<Dd>> = (first..first + count).map(|j| self.column(j)).collect();
        let images: Vec<Vec<f64>> =
            columns.iter().map(|x| residual(&self.stiffness_times(x), &self.mass_times(x), shift)).collect();
        let product = |i: usize, j: usize| columns[i].iter().zip(&images[j]).map(|(x, r)| x.hi * r).sum::<f64>();
        let inner = symmetrised(Mat::from_fn(count, count, product));
        let Ok((_, turn)) = eigen::symmetric(inner.as_ref()) else { return };
        for j in 0..count {
            let mut x = vec![Dd::default(); self.x.nrows()];
            for (k, column) in columns.iter().enumerate() {
                for (x, c) in x.iter_mut().zip(column) {
                    *x = x.plus(c.times(Dd::new(turn[(k, j)])));
                }
            }
            self.set_column(first + j, &x);
        }
    }

    /// Quotients, and what their terms add up to. Quotients of many cancelling terms are taken in twice the precision.
    fn measure(&mut self) {
        let n = self.x.ncols();
        let moduli = absolute(self.x.as_ref());
        let m = absolute(self.system.m.as_ref());
        (self.stiffness, self.size) = match &self.system.kf {
            None => {
                let size = quadratic(&moduli, &(sizes(self.system.k.as_ref()) * &moduli));
                (size.clone(), size)
            }
            Some(kf) => {
                let (strain, terms) = (absolute((kf * &self.x).as_ref()), absolute(kf.as_ref()) * &moduli);
                (quadratic(&strain, &terms), quadratic(&terms, &terms))
            }
        };
        let kx = &self.system.k * &self.x;
        let mx = match &self.system.mf {
            None => {
                self.mass = quadratic(&moduli, &(&m * &moduli));
                &self.system.m * &self.x
            }
            Some(mf) => mf.transpose() * (mf * &self.x),
        };
        let (strain, kinetic) = (quadratic(&self.x, &kx), quadratic(&self.x, &mx));
        let mut masses = kinetic.clone();
        for j in 0..n {
            let (mut lambda, mut mass) = (strain[j] / kinetic[j], kinetic[j]);
            let is_two_part = self.low.is_some() || self.system.mf.is_some();
            if is_two_part || self.stiffness[j] > CANCELLING * strain[j].abs() || self.mass[j] > CANCELLING * mass {
                (lambda, mass) = self.quotient(&self.column(j));
            }
            self.lambda[j] = lambda;
            masses[j] = mass;
            let share = 1.0 / mass;
            self.stiffness[j] *= share;
            self.size[j] *= share;
            self.mass[j] = if self.system.mf.is_some() { 1.0 } else { self.mass[j] * share };
            self.scale(j, 1.0 / mass.sqrt());
        }
        let scaled = |a: &Mat<f64>| Mat::from_fn(a.nrows(), n, |i, j| a[(i, j)] / masses[j].sqrt());
        self.images = (scaled(&kx), scaled(&mx));
    }

    fn scale(&mut self, j: usize, factor: f64) {
        match self.low {
            None => self.x.col_mut(j).iter_mut().for_each(|v| *v *= factor),
            Some(_) => {
                let x: Vec<Dd> = self.column(j).iter().map(|v| v.times(Dd::new(factor))).collect();
                self.set_column(j, &x);
            }
        }
    }

    /// Rigid modes first, the others in ascending order.
    fn sort(&mut self, candidates: usize) {
        let rigid = |j: usize| j < candidates && self.lambda[j].abs() <= self.noise(j);
        let mut order: Vec<usize> = (0..self.lambda.len()).collect();
        order.sort_by(|&a, &b| (!rigid(a)).cmp(&!rigid(b)).then(self.lambda[a].total_cmp(&self.lambda[b])));
        let count = order.iter().filter(|&&j| rigid(j)).count();
        let columns = |a: &Mat<f64>| Mat::from_fn(a.nrows(), a.ncols(), |i, j| a[(i, order[j])]);
        let values = |v: &[f64]| order.iter().map(|&j| v[j]).collect::<Vec<f64>>();
        (self.x, self.low) = (columns(&self.x), self.low.as_ref().map(columns));
        self.images = (columns(&self.images.0), columns(&self.images.1));
        self.lambda = values(&self.lambda);
        (self.stiffness, self.size, self.mass) = (values(&self.stiffness), values(&self.size), values(&self.mass));
        self.rigid = count;
        self.lambda[..count].fill(0.0);
    }

    /// Bounds of all modes from residuals in working precision and a bound of their rounding, or from residuals in twice the
    /// precision where the shapes have two parts.
    fn judge(&mut self, counts: &mut Counts) {
        let n = self.lambda.len();
        let products = match self.low {
            None => {
                let (kx, mx) = &self.images;
                self.x.transpose() * Mat::from_fn(n, n, |i, j| kx[(i, j)] - self.lambda[j] * mx[(i, j)])
            }
            Some(_) => {
                counts.add("residuals in twice the precision", (n - self.rigid) as u64);
                self.x.transpose() * self.fine_residuals()
            }
        };
        self.bound = (0..n).map(|j| if j < self.rigid { 0.0 } else { self.bounded(products.as_ref(), j) }).collect();
    }

    fn fine_residuals(&self) -> Mat<f64> {
        let n = self.lambda.len();
        let mut out = Mat::zeros(n, n);
        for j in self.rigid..n {
            let x = self.column(j);
            let r = residual(&self.stiffness_times(&x), &self.mass_times(&x), self.lambda[j]);
            r.iter().enumerate().for_each(|(i, r)| out[(i, j)] = *r);
        }
        out
    }

    fn bounded(&self, products: MatRef<'_, f64>, j: usize) -> f64 {
        let rounding = |i: usize| self.stiffness[i] + self.lambda[i].abs() * self.mass[i];
        let mut sum = 4.0 * U;
        for i in (0..self.lambda.len()).filter(|&i| i != j) {
            let hidden = if self.low.is_none() { U * (rounding(i) * rounding(j)).sqrt() } else { 0.0 };
            let product = products[(i, j)].abs() + hidden;
            let (own, other) = (self.lambda[j].abs(), self.lambda[i].abs());
            if i < self.rigid {
                sum += (product / own).powi(2);
            } else {
                let mean = (own * other).sqrt();
                let gap = ((self.lambda[i] - self.lambda[j]).abs() / mean).min(1.0);
                let e = product / mean;
                sum += e * (e / gap).min(1.0);
            }
        }
        sum
    }

    /// Improves all poor modes until none is, or nothing changes any more.
    pub fn improve(&mut self, counts: &mut Counts) {
        if self.low.is_none() {
            self.low = Some(Mat::zeros(self.x.nrows(), self.x.ncols()));
            self.measure();
            self.judge(counts);
        }
        for _ in 0..PASSES {
            if self.is_sharp() && self.worst() < 0.5 {
                break;
            }
            let before = (self.x.clone(), self.low.clone(), self.lambda.clone(), self.bound.clone());
            let worst = self.worst();
            counts.add("refinement passes", 1);
            self.step();
            self.measure();
            self.lambda[..self.rigid].fill(0.0);
            self.judge(counts);
            if self.worst() >= worst {
                (self.x, self.low, self.lambda, self.bound) = before;
                self.measure();
                self.lambda[..self.rigid].fill(0.0);
                break;
            }
        }
        self.check_distinct();
    }

    fn step(&mut self) {
        let n = self.lambda.len();
        let products = self.x.transpose() * self.fine_residuals();
        let x = self.x.clone();
        let blurred: Vec<usize> = (self.rigid..n).filter(|&j| self.is_poor(j) || self.bound[j] > 8.0 * U).collect();
        for j in blurred {
            let mut own = self.column(j);
            for i in (0..n).filter(|&i| i != j) {
                let gap = self.lambda[j] - self.lambda[i];
                if gap.abs() <= CLOSEST * (self.lambda[i] * self.lambda[j]).abs().sqrt() {
                    continue;
                }
                let c = products[(i, j)] / gap;
                if c.is_finite() && c != 0.0 {
                    own.iter_mut().zip(x.col(i).iter()).for_each(|(own, x)| own.add(c * x));
                }
            }
            self.set_column(j, &own);
        }
        let mut first = self.rigid;
        while first < n {
            let mut end = first + 1;
            while end < n && {
                let (a, b) = (self.lambda[end - 1], self.lambda[end]);
                (b - a).abs() <= CLOSEST * (a * b).abs().sqrt()
            } {
                end += 1;
            }
            self.rotate(first, end - first, self.lambda[first]);
            first = end;
        }
    }

    /// Two columns that became one shape leave another root out: no bound holds then. Columns are independent where the cosines
    /// between each and all others add up to less than one (Gershgorin).
    fn check_distinct(&mut self) {
        let cosine = self.x.transpose() * &self.images.1;
        for j in self.rigid..self.lambda.len() {
            let others: f64 = (0..cosine.nrows()).filter(|i| *i != j).map(|i| cosine[(i, j)].abs()).sum();
            if others.is_nan() || others >= 1.0 {
                self.bound[j] = f64::INFINITY;
            }
        }
    }
}

fn residual(kx: &[Dd], mx: &[Dd], lambda: f64) -> Vec<f64> {
    kx.iter().zip(mx).map(|(k, m)| k.minus(m.times(Dd::new(lambda))).value()).collect()
}

/// x_j^T y_j of every column.
fn quadratic(x: &Mat<f64>, y: &Mat<f64>) -> Vec<f64> {
    (0..x.ncols()).map(|j| x.col(j).transpose() * y.col(j)).collect()
}

/// Bounds of the sizes of the terms that were added up in the entries of K: of a sum of squares by Cauchy and Schwarz.
fn sizes(k: MatRef<'_, f64>) -> Mat<f64> {
    let root: Vec<f64> = (0..k.nrows()).map(|i| k[(i, i)].abs().sqrt()).collect();
    Mat::from_fn(k.nrows(), k.ncols(), |i, j| match k[(i, j)] {
        0.0 => 0.0,
        entry => entry.abs().max(root[i] * root[j]),
    })
}
