//! The lowest modes of large damped or gyroscopic systems: (s^2 M + s D + S) y = 0 by shift-invert Krylov-Schur on the state form.
//!
//! The 2n state matrix is never formed: (A - sigma I)^-1 needs one factorisation of sigma^2 M + sigma D + S, n by n.
use faer::{Mat, MatMut, MatRef, c64};

use super::sparse_pencil::{Assembled, Pencil};
use crate::error::{Error, Result};
use crate::linalg::krylov::{Operator, Options, Ritz, Space};
use crate::linalg::quadratic::Quadratic;
use crate::linalg::sparse::{Csc, Factor};
use crate::run::{Cancel, Counts};
use crate::tolerances::matrices::STIFFNESS_PIVOT;
use crate::tolerances::sparse_modes::{RIGID_PAIR, SAME_DAMPED};

pub struct DampedModes {
    /// the roots with Im s >= 0 nearest to the shift, ascending in |s|; a rigid motion counts once, as 0, each other real root
    /// for itself
    pub s: Vec<c64>,
    /// y^H M y = 1, largest component real and positive
    pub shape: Mat<c64>,
    /// |s^2 M y + s D y + S y| / ((|s|^2 |M| + |s| |D| + |S|) |y|)
    pub residual: Vec<f64>,
    pub rigid: usize,
    pub sigma: f64,
    pub counts: Counts,
}

pub struct Damped {
    m: Csc,
    d: Csc,
    s: Csc,
}

/// States (y, y'/rate), measured by their energies: then an undamped system's operator at no shift is skew, and rounding in fast
/// motions, which the mass norm of y magnifies at every step, stays small.
struct StateOperator<'a> {
    system: &'a Damped,
    factor: Factor,
    sigma: f64,
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
        Ok(Damped { m, d, s })
    }

    fn polynomial(&self, sigma: f64) -> Csc {
        self.s.combined(1.0, sigma, &self.d).combined(1.0, sigma * sigma, &self.m)
    }

    fn operator<'a>(&'a self, sigma: f64, rate: f64, strain: &'a Csc) -> Result<StateOperator<'a>> {
        Ok(StateOperator { factor: Factor::lu(&self.polynomial(sigma))?, system: self, sigma, rate, strain })
    }

    /// The symmetric part of S.
    fn stiffness(&self) -> Csc {
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

    fn residuals(&self, s: &[c64], y: MatRef<'_, c64>) -> Vec<f64> {
        let norm = |a: &Csc| a.value.iter().map(|v| v * v).sum::<f64>().sqrt();
        let (nm, nd, ns) = (norm(&self.m), norm(&self.d), norm(&self.s));
        let n = self.m.rows;
        let parts = |k: usize, f: &dyn Fn(c64) -> f64| Mat::from_fn(n, 1, |i, _| f(y[(i, k)]));
        (0..s.len())
            .map(|k| {
                let (re, im) = (parts(k, &|z| z.re), parts(k, &|z| z.im));
                let apply = |a: &Csc| {
                    let (mut x, mut z) = (Mat::zeros(n, 1), Mat::zeros(n, 1));
                    a.multiply(re.as_ref(), x.as_mut(), false);
                    a.multiply(im.as_ref(), z.as_mut(), false);
                    (0..n).map(|i| c64::new(x[(i, 0)], z[(i, 0)])).collect::<Vec<_>>()
                };
                let (my, dy, sy) = (apply(&self.m), apply(&self.d), apply(&self.s));
                let r: f64 = (0..n).map(|i| (s[k] * s[k] * my[i] + s[k] * dy[i] + sy[i]).norm_sqr()).sum();
                let size = s[k].norm_sqr() * nm + s[k].norm() * nd + ns;
                r.sqrt() / (size * y.col(k).norm_l2())
            })
            .collect()
    }
}

impl Operator for StateOperator<'_> {
    fn dim(&self) -> usize {
        2 * self.system.m.rows
    }

    /// (A - sigma)^-1 (a, b): (sigma^2 M + sigma D + S) y = -(M b + D a + sigma M a), v = a + sigma y.
    fn apply(&self, x: MatRef<'_, f64>, mut out: MatMut<'_, f64>) -> Result<()> {
        let n = self.system.m.rows;
        let (a, b) = (x.subrows(0, n), x.subrows(n, n));
        let inertia = Mat::from_fn(n, x.ncols(), |i, j| -(self.rate * b[(i, j)] + self.sigma * a[(i, j)]));
        let negative = Mat::from_fn(n, x.ncols(), |i, j| -a[(i, j)]);
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

    fn weigh(&self, x: MatRef<'_, f64>, mut out: MatMut<'_, f64>) {
        let n = self.system.m.rows;
        self.strain.multiply(x.subrows(0, n), out.as_mut().subrows_mut(0, n), false);
        let scale = 1.0 / (self.rate * self.rate);
        for j in 0..x.ncols() {
            for i in 0..n {
                out[(i, j)] *= scale;
            }
        }
        self.system.m.multiply(x.subrows(n, n), out.subrows_mut(n, n), false);
    }
}

/// The `wanted` roots with Im s >= 0 nearest to the real shift, by default those of smallest modulus.
pub fn lowest(system: &Damped, wanted: usize, sigma: Option<f64>, cancel: &Cancel) -> Result<DampedModes> {
    let n = system.m.rows;
    if wanted == 0 || wanted > n {
        return Err(Error::model(format!("n = {wanted} modes were asked for; the system has {n} coordinates")));
    }
    let mut counts = Counts::default();
    let (sigma, strain) = match sigma {
        Some(sigma) if !sigma.is_finite() => {
            return Err(Error::model(format!("sigma = {sigma} is not finite")));
        }
        Some(sigma) => (sigma, None),
        None => shift(system, wanted, &mut counts, cancel)?,
    };
    let options = Options::new(2 * wanted, false);
    let (s, shape) = if 2 * n < options.dim + 3 * options.block {
        counts.add("dense eigensolutions", 1);
        every(system)?
    } else {
        iterated(system, wanted, (sigma, strain), options, &mut counts, cancel)?
    };
    let shape = normalised(system, shape.as_ref());
    let (s, shape, rigid) = merge_rigid(system, s, shape, sigma);
    let mut order: Vec<usize> = (0..s.len()).collect();
    order.sort_by(|a, b| s[*a].norm().total_cmp(&s[*b].norm()).then(s[*b].re.total_cmp(&s[*a].re)));
    order.truncate(wanted);
    let s: Vec<c64> = order.iter().map(|k| s[*k]).collect();
    let shape = Mat::from_fn(n, order.len(), |i, j| shape[(i, order[j])]);
    Ok(DampedModes { residual: system.residuals(&s, shape.as_ref()), s, shape, rigid, sigma, counts })
}

fn iterated(
    system: &Damped,
    wanted: usize,
    (sigma, strain): (f64, Option<Csc>),
    options: Options,
    counts: &mut Counts,
    cancel: &Cancel,
) -> Result<(Vec<c64>, Mat<c64>)> {
    counts.add("factorisations", 1);
    let strain = match strain {
        Some(strain) => strain,
        None => system.strain(sigma, counts)?,
    };
    let op = system.operator(sigma, rate(system, sigma, &strain)?, &strain)?;
    // a root of a conjugate pair brings the other along
    let mut space = Space::new(&op, options)?;
    let mut ritz = space.converge(cancel)?;
    // new random vectors bring to light what the first ones did not see
    for _ in 0..4 {
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
    let chosen = upper(&ritz, 2 * wanted);
    let picked = Ritz {
        value: chosen.iter().map(|k| ritz.value[*k]).collect(),
        residual: chosen.iter().map(|k| ritz.residual[*k]).collect(),
        vector: Mat::from_fn(ritz.vector.nrows(), chosen.len(), |i, j| ritz.vector[(i, chosen[j])]),
    };
    let states = space.vectors(&picked, chosen.len());
    let s = picked.value.iter().map(|mu| sigma + mu.inv()).collect();
    Ok((s, states.subrows(0, system.m.rows).to_owned()))
}

/// All roots of a system so small, or of which so many are wanted, that a Krylov basis would exhaust it.
fn every(system: &Damped) -> Result<(Vec<c64>, Mat<c64>)> {
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
    Ok((s, Mat::from_fn(n, upper.len(), |i, j| c64::new(re[(i, j)], im[(i, j)]))))
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
            // shapes of a double root are right to about the root of the precision only
            if norm > 1e-3 {
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
/// the size of the wanted undamped frequencies.
fn shift(system: &Damped, wanted: usize, counts: &mut Counts, cancel: &Cancel) -> Result<(f64, Option<Csc>)> {
    let stiffness = system.stiffness();
    let undamped = Assembled::new(system.m.clone(), stiffness.clone())?;
    if undamped.shifted_at_zero()?.is_some() {
        return Ok((0.0, Some(stiffness)));
    }
    let modes = super::sparse_modal::lowest(&undamped, wanted, None, cancel)?;
    counts.merge(&modes.counts);
    let highest = modes.lambda.iter().fold(0.0_f64, |a, l| a.max(l.abs()));
    let highest = if highest > 0.0 { highest } else { modes.sigma.abs() };
    Ok((-0.3 * highest.sqrt(), None))
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
