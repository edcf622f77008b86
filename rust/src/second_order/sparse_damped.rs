//! The lowest modes of large damped or gyroscopic systems: (s^2 M + s D + S) y = 0 by shift-invert Krylov-Schur on the state form.
//!
//! The 2n state matrix is never formed: (A - sigma I)^-1 needs one factorisation of sigma^2 M + sigma D + S, n by n.
use faer::{Mat, MatMut, MatRef, c64};

use super::sparse_crowded;
use super::sparse_pencil::{Assembled, Pencil};
use super::sparse_polynomial::Polynomial;
use crate::error::{Error, Result};
use crate::linalg::field::Field;
use crate::linalg::krylov::{Operator, Options, Ritz, Space};
use crate::linalg::quadratic::Quadratic;
use crate::linalg::sparse::{Csc, Factor, Lu};
use crate::run::{Cancel, Counts};
use crate::tolerances::matrices::STIFFNESS_PIVOT;
use crate::tolerances::modes::PATIENCE;
use crate::tolerances::sparse_modes::{ENTRY_NOISE, RIGID_PAIR, SAME_VALUE};

pub struct DampedModes {
    /// the roots with Im s >= 0 nearest to the shift, ascending in |s|; a rigid motion counts once, as 0, each other real root
    /// for itself
    pub s: Vec<c64>,
    /// y^H M y = 1, largest component real and positive
    pub shape: Mat<c64>,
    /// |s^2 M y + s D y + S y| / ((|s|^2 |M| + |s| |D| + |S|) |y|)
    pub residual: Vec<f64>,
    /// estimated relative error of s, from the left vectors
    pub error: Vec<f64>,
    pub rigid: usize,
    /// how it was made sure that no lower root is missing
    pub verified: &'static str,
    pub counts: Counts,
}

/// Roots in the closed upper half plane, the first components of their states, and what is known of their number.
pub(crate) struct Found {
    pub s: Vec<c64>,
    pub shape: Mat<c64>,
    pub verified: &'static str,
}

pub struct Damped {
    pub(crate) m: Csc,
    d: Csc,
    s: Csc,
    pub(crate) polynomial: Polynomial,
}

/// States (y, y'/rate), measured by their energies: then an undamped system's operator at no shift is skew, and rounding in fast
/// motions, which the mass norm of y magnifies at every step, stays small.
pub(crate) struct StateOperator<'a, T> {
    system: &'a Damped,
    factor: Lu<T>,
    sigma: T,
    rate: f64,
    strain: &'a Csc,
}

impl Damped {
    pub fn new(m: Csc, d: Csc, s: Csc) -> Result<Self> {
        let n = m.rows;
        for (name, a) in [("D", &d), ("S", &s)] {
            if a.rows != n || a.cols != n {
                return Err(Error::model(format!("{name} is {} x {}, M has {n} rows", a.rows, a.cols)));
            }
        }
        // the checks of M are those of the symmetric problem
        Assembled::new(m.clone(), Csc::from_entries(n, n, Vec::new()))?;
        Ok(Damped { polynomial: Polynomial::new(&m, &d, &s), m, d, s })
    }

    pub(crate) fn operator<'a, T: Field>(
        &'a self,
        sigma: T,
        rate: f64,
        strain: &'a Csc,
    ) -> Result<StateOperator<'a, T>> {
        Ok(StateOperator { factor: self.polynomial.factors(sigma)?, system: self, sigma, rate, strain })
    }

    /// The symmetric part of S.
    pub(crate) fn stiffness(&self) -> Csc {
        let mirrored = self.s.entries().map(|(i, j, v)| (j, i, v)).collect();
        let n = self.m.rows;
        self.s.combined(0.5, 0.5, &Csc::from_entries(n, n, mirrored))
    }

    /// What measures y: S + sigma^2 M where that is positive definite, else M in its size.
    fn strain(&self, sigma: f64, counts: &mut Counts) -> Result<Csc> {
        let strain = self.stiffness().combined(1.0, sigma * sigma, &self.m);
        counts.add("factorisations", 1);
        if Factor::cholesky(&strain, STIFFNESS_PIVOT)?.is_some() {
            return Ok(strain);
        }
        let largest = |a: &Csc| a.diagonal().iter().fold(0.0_f64, |x, v| x.max(v.abs()));
        let size = (largest(&strain) / largest(&self.m)).max(f64::MIN_POSITIVE);
        Ok(self.m.combined(size, 0.0, &self.m))
    }

    pub(crate) fn residuals(&self, s: &[c64], y: MatRef<'_, c64>) -> Vec<f64> {
        let norm = |a: &Csc| a.value.iter().map(|v| v * v).sum::<f64>().sqrt();
        let (nm, nd, ns) = (norm(&self.m), norm(&self.d), norm(&self.s));
        (0..s.len())
            .map(|k| {
                let r = self.at(s[k], y.subcols(k, 1));
                let size = s[k].norm_sqr() * nm + s[k].norm() * nd + ns;
                r.norm_l2() / (size * y.col(k).norm_l2())
            })
            .collect()
    }

    /// (s^2 M + s D + S) y.
    fn at(&self, s: c64, y: MatRef<'_, c64>) -> Mat<c64> {
        let product = |a: &Csc| product(a, y);
        let (m, d, k) = (product(&self.m), product(&self.d), product(&self.s));
        Mat::from_fn(y.nrows(), 1, |i, _| s * s * m[(i, 0)] + s * d[(i, 0)] + k[(i, 0)])
    }

    /// w^T Q y / (s w^T Q' y) with the left vectors w, and what the rounding of the entries hides.
    fn errors(&self, s: &[c64], y: MatRef<'_, c64>, counts: &mut Counts, cancel: &Cancel) -> Result<Vec<f64>> {
        let symmetric = self.d.is_symmetric() && self.s.is_symmetric();
        let sizes = [&self.m, &self.d, &self.s].map(magnitudes);
        let mut out = vec![0.0; s.len()];
        for (k, error) in out.iter_mut().enumerate().filter(|(k, _)| s[*k].norm() > 0.0) {
            cancel.check()?;
            let (s, x) = (s[k], y.subcols(k, 1));
            let w = if symmetric { x.to_owned() } else { self.left(s, x, counts)? };
            let form = |r: &Mat<c64>| (w.transpose() * r)[(0, 0)];
            let rest = form(&self.at(s, x)).norm();
            let slope = s.norm() * (s * 2.0 * form(&product(&self.m, x)) + form(&product(&self.d, x))).norm();
            let (left, right) = (absolute(w.as_ref()), absolute(x));
            let [m, d, k] = sizes.each_ref().map(|a| (left.transpose() * product(a, right.as_ref()))[(0, 0)]);
            let noise = ENTRY_NOISE * f64::EPSILON * (s.norm_sqr() * m + s.norm() * d + k);
            *error = ((rest + noise) / slope).max(f64::EPSILON);
        }
        Ok(out)
    }

    /// The left vector of a root, by inverse iteration from the right one.
    fn left(&self, s: c64, y: MatRef<'_, c64>, counts: &mut Counts) -> Result<Mat<c64>> {
        counts.add("factorisations", 1);
        let factors = self.polynomial.factors(s * (1.0 + SAME_VALUE))?;
        let mut w = Mat::from_fn(y.nrows(), 1, |i, _| y[(i, 0)].conj());
        for _ in 0..3 {
            factors.solve_transposed(w.as_mut());
            let size = w.norm_l2();
            if !size.is_finite() || size <= 0.0 {
                return Err(Error::singular("the factors at a root are singular"));
            }
            w = Mat::from_fn(y.nrows(), 1, |i, _| w[(i, 0)] / size);
        }
        Ok(w)
    }
}

fn product<T: Field>(a: &Csc, x: MatRef<'_, T>) -> Mat<T> {
    let mut out = Mat::zeros(a.rows, x.ncols());
    a.multiply(x, out.as_mut(), false);
    out
}

fn magnitudes(a: &Csc) -> Csc {
    Csc { value: a.value.iter().map(|v| v.abs()).collect(), ..a.clone() }
}

fn absolute(x: MatRef<'_, c64>) -> Mat<f64> {
    Mat::from_fn(x.nrows(), 1, |i, _| x[(i, 0)].norm())
}

impl<T: Field> Operator<T> for StateOperator<'_, T> {
    fn dim(&self) -> usize {
        2 * self.system.m.rows
    }

    /// (A - sigma)^-1 (a, b): (sigma^2 M + sigma D + S) y = -(M b + D a + sigma M a), v = a + sigma y.
    fn apply(&self, x: MatRef<'_, T>, mut out: MatMut<'_, T>) -> Result<()> {
        let n = self.system.m.rows;
        let (a, b) = (x.subrows(0, n), x.subrows(n, n));
        let inertia = Mat::from_fn(n, x.ncols(), |i, j| (b[(i, j)] * self.rate + self.sigma * a[(i, j)]) * -1.0);
        let negative = Mat::from_fn(n, x.ncols(), |i, j| a[(i, j)] * -1.0);
        let mut y = Mat::zeros(n, x.ncols());
        self.system.m.multiply(inertia.as_ref(), y.as_mut(), false);
        self.system.d.multiply(negative.as_ref(), y.as_mut(), true);
        self.factor.solve(y.as_mut());
        for j in 0..x.ncols() {
            for i in 0..n {
                out[(i, j)] = y[(i, j)];
                out[(n + i, j)] = (a[(i, j)] + self.sigma * y[(i, j)]) / self.rate;
            }
        }
        Ok(())
    }

    fn weigh(&self, x: MatRef<'_, T>, mut out: MatMut<'_, T>) {
        let n = self.system.m.rows;
        self.strain.multiply(x.subrows(0, n), out.as_mut().subrows_mut(0, n), false);
        let scale = 1.0 / (self.rate * self.rate);
        for j in 0..x.ncols() {
            for i in 0..n {
                out[(i, j)] = out[(i, j)] * scale;
            }
        }
        self.system.m.multiply(x.subrows(n, n), out.subrows_mut(n, n), false);
    }
}

/// The `wanted` roots with Im s >= 0 of smallest modulus.
pub fn lowest(system: &Damped, wanted: usize, cancel: &Cancel) -> Result<DampedModes> {
    let n = system.m.rows;
    if wanted == 0 || wanted > n {
        return Err(Error::model(format!("n = {wanted} modes were asked for; the system has {n} coordinates")));
    }
    let mut counts = Counts::default();
    let (sigma, strain) = shift(system, wanted, &mut counts, cancel)?;
    let options = Options::new(2 * wanted, false);
    let found = if 2 * n < options.dim + 3 * options.block {
        counts.add("dense eigensolutions", 1);
        every(system)?
    } else {
        // a real shift may lie too far from roots that are close together: then it moves among them
        let patient = if sigma == 0.0 { Options { max_cycles: PATIENCE, ..options } } else { options };
        match iterated(system, wanted, (sigma, &strain), patient, &mut counts, cancel) {
            Err(Error::Convergence { .. }) if sigma == 0.0 => {
                sparse_crowded::lowest(system, wanted, &strain, &mut counts, cancel)?
            }
            found => found?,
        }
    };
    let shape = normalised(system, found.shape.as_ref());
    let (s, shape, rigid) = merge_rigid(system, found.s, shape, sigma);
    let order = lowest_first(&s, wanted);
    let s: Vec<c64> = order.iter().map(|k| s[*k]).collect();
    let shape = Mat::from_fn(n, order.len(), |i, j| shape[(i, order[j])]);
    let residual = system.residuals(&s, shape.as_ref());
    let error = system.errors(&s, shape.as_ref(), &mut counts, cancel)?;
    Ok(DampedModes { residual, error, s, shape, rigid, verified: found.verified, counts })
}

/// Indices of the `wanted` roots of smallest modulus; of equal ones that with more damping last.
pub(crate) fn lowest_first(s: &[c64], wanted: usize) -> Vec<usize> {
    let mut order: Vec<usize> = (0..s.len()).collect();
    order.sort_by(|a, b| s[*a].norm().total_cmp(&s[*b].norm()).then(s[*b].re.total_cmp(&s[*a].re)));
    order.truncate(wanted);
    order
}

fn iterated(
    system: &Damped,
    wanted: usize,
    (sigma, strain): (f64, &Csc),
    options: Options,
    counts: &mut Counts,
    cancel: &Cancel,
) -> Result<Found> {
    counts.add("factorisations", 1);
    let op = system.operator(sigma, rate(system, sigma, strain)?, strain)?;
    // a root of a conjugate pair brings the other along
    let mut space = Space::new(&op, options)?;
    let mut ritz = space.converge(cancel)?;
    let mut verified = "unverified";
    // new random vectors bring to light what the first ones did not see
    for _ in 0..4 {
        let before: Vec<c64> = upper(&ritz, wanted).iter().map(|k| ritz.value[*k]).collect();
        space.restart_afresh(&ritz, 2 * wanted)?;
        ritz = space.converge(cancel)?;
        let now = upper(&ritz, wanted);
        let same = |(a, k): (&c64, &usize)| (a - ritz.value[*k]).norm() <= SAME_VALUE * a.norm();
        if before.len() == now.len() && before.iter().zip(&now).all(same) {
            verified = "random restart";
            break;
        }
    }
    counts.merge(&space.counts);
    let chosen = upper(&ritz, 2 * wanted);
    let picked = Ritz {
        value: chosen.iter().map(|k| ritz.value[*k]).collect(),
        residual: chosen.iter().map(|k| ritz.residual[*k]).collect(),
        vector: Mat::from_fn(ritz.vector.nrows(), chosen.len(), |i, j| ritz.vector[(i, chosen[j])]),
    };
    let states = space.vectors(&picked, chosen.len());
    let s = picked.value.iter().map(|mu| sigma + mu.inv()).collect();
    Ok(Found { s, shape: states.subrows(0, system.m.rows).to_owned(), verified })
}

/// All roots of a system so small, or of which so many are wanted, that a Krylov basis would exhaust it.
fn every(system: &Damped) -> Result<Found> {
    let n = system.m.rows;
    let dense = |a: &Csc| Mat::from_fn(n, n, |i, j| a.get(i, j));
    let q = Quadratic::new(dense(&system.m), Some(dense(&system.d)), dense(&system.s));
    let failed = || Error::singular("the dense eigenproblem of the damped system did not converge");
    let form = q.normal_form().ok_or_else(failed)?;
    let eigen = form.state_matrix(form.rate()).eigen().map_err(|_| failed())?;
    let upper: Vec<usize> = (0..2 * n).filter(|k| eigen.S()[*k].im >= 0.0).collect();
    let s = upper.iter().map(|k| eigen.S()[*k]).collect();
    let part = |f: &dyn Fn(c64) -> f64| {
        let mut x = Mat::from_fn(n, upper.len(), |i, j| f(eigen.U()[(i, upper[j])]));
        form.l.transpose().solve_upper_triangular_in_place(&mut x);
        x
    };
    let (re, im) = (part(&|z| z.re), part(&|z| z.im));
    let shape = Mat::from_fn(n, upper.len(), |i, j| c64::new(re[(i, j)], im[(i, j)]));
    Ok(Found { s, shape, verified: "all computed" })
}

/// Roots that are zero to the accuracy of a double root belong to rigid motions, two to each; one mode of each is left, s = 0.
fn merge_rigid(system: &Damped, s: Vec<c64>, shape: Mat<c64>, sigma: f64) -> (Vec<c64>, Mat<c64>, usize) {
    let n = shape.nrows();
    let zero = |s: &c64| s.norm() <= RIGID_PAIR * sigma.abs();
    let mut rigid: Vec<Mat<f64>> = Vec::new();
    let product = |a: &Mat<f64>, b: &Mat<f64>| {
        let mut weighed = Mat::zeros(n, 1);
        system.m.multiply(b.as_ref(), weighed.as_mut(), false);
        (0..n).map(|i| a[(i, 0)] * weighed[(i, 0)]).sum::<f64>()
    };
    for k in (0..s.len()).filter(|k| zero(&s[*k])) {
        for part in [|z: c64| z.re, |z: c64| z.im] {
            let mut x = Mat::from_fn(n, 1, |i, _| part(shape[(i, k)]));
            for r in &rigid {
                let along = product(r, &x);
                x -= faer::Scale(along) * r;
            }
            let norm = product(&x, &x).sqrt();
            // shapes of a double root are off by about what the root is off; others are of the order of one
            if norm > RIGID_PAIR.sqrt() {
                x *= faer::Scale(1.0 / norm);
                rigid.push(x);
            }
        }
    }
    let others: Vec<usize> = (0..s.len()).filter(|k| !zero(&s[*k])).collect();
    let count = rigid.len();
    let values = std::iter::repeat_n(c64::new(0.0, 0.0), count).chain(others.iter().map(|k| s[*k])).collect();
    let merged = Mat::from_fn(n, count + others.len(), |i, j| {
        if j < count { c64::new(rigid[j][(i, 0)], 0.0) } else { shape[(i, others[j - count])] }
    });
    (values, merged, count)
}

/// Zero where the stiffness is safely positive definite, and then the stiffness as the measure of strain; else a negative shift of
/// the size of the wanted undamped frequencies. With it the measure of strain.
fn shift(system: &Damped, wanted: usize, counts: &mut Counts, cancel: &Cancel) -> Result<(f64, Csc)> {
    let stiffness = system.stiffness();
    let undamped = Assembled::new(system.m.clone(), stiffness.clone())?;
    if undamped.shifted_at_zero()?.is_some() {
        return Ok((0.0, stiffness));
    }
    let modes = super::sparse_modal::lowest(&undamped, wanted, None, cancel)?;
    counts.merge(&modes.counts);
    let highest = modes.lambda.iter().fold(0.0_f64, |a, l| a.max(l.abs()));
    let highest = if highest > 0.0 { highest } else { modes.sigma.abs() };
    let sigma = -0.3 * highest.sqrt();
    Ok((sigma, system.strain(sigma, counts)?))
}

/// |s| of the slowest motion, to bring both halves of the state to one size.
fn rate(system: &Damped, sigma: f64, strain: &Csc) -> Result<f64> {
    let k = system.s.diagonal();
    let m = system.m.diagonal();
    let fastest = k.iter().zip(&m).map(|(k, m)| (k.abs() / m).sqrt()).fold(0.0, f64::max);
    let fastest = if fastest > 0.0 { fastest } else { 1.0 };
    let op = system.operator(sigma, fastest, strain)?;
    let options = Options { dim: 6, ..Options::new(1, false) };
    let mut space = Space::new(&op, options)?;
    let ritz = space.cycle(&Cancel::default())?;
    let slowest = 1.0 / ritz.value[0].norm();
    Ok(if slowest.is_finite() && slowest > 0.0 { slowest } else { fastest })
}

/// Indices of the leading roots in the closed upper half plane.
fn upper(ritz: &Ritz, wanted: usize) -> Vec<usize> {
    // 1/mu has the opposite sign of the imaginary part
    let mut indices: Vec<usize> = (0..ritz.value.len()).filter(|k| ritz.value[*k].im <= 0.0).collect();
    indices.truncate(wanted);
    indices
}

fn normalised(system: &Damped, y: MatRef<'_, c64>) -> Mat<c64> {
    let n = y.nrows();
    let mut out = y.to_owned();
    for k in 0..y.ncols() {
        let mut sum = 0.0;
        for part in [|z: c64| z.re, |z: c64| z.im] {
            let x = Mat::from_fn(n, 1, |i, _| part(y[(i, k)]));
            let mut weighed = Mat::zeros(n, 1);
            system.m.multiply(x.as_ref(), weighed.as_mut(), false);
            sum += (0..n).map(|i| x[(i, 0)] * weighed[(i, 0)]).sum::<f64>();
        }
        let largest = (0..n).max_by(|a, b| y[(*a, k)].norm().total_cmp(&y[(*b, k)].norm())).unwrap_or(0);
        let turn = y[(largest, k)].conj() / y[(largest, k)].norm() / sum.sqrt();
        for i in 0..n {
            out[(i, k)] *= turn;
        }
    }
    out
}
