//! The lowest modes of large damped or gyroscopic systems: (s^2 M + s D + S) y = 0 by shift-invert Krylov-Schur on the state form.
//!
//! The 2n state matrix is never formed: (A - sigma I)^-1 needs one factorisation of sigma^2 M + sigma D + S, n by n.
use faer::{Mat, MatMut, MatRef, c64};

use super::sparse_modal::nearer;
use super::sparse_pencil::{Assembled, Pencil};
use crate::error::{Error, Result};
use crate::linalg::krylov::{Operator, Options, Ritz, Space};
use crate::linalg::quadratic::Quadratic;
use crate::linalg::sparse::{ComplexFactor, Csc, Factor, lu_order};
use crate::run::{Cancel, Counts};
use crate::tolerances::modes::PATIENCE;

/// How often the search of crowded roots is moved.
const MOVES: usize = 6;
/// Pairs beyond the wanted ones, so that a search about a frequency sees what lies behind them.
const BUFFER: usize = 3;

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
        if Factor::cholesky(&strain, 1e-12)?.is_some() {
            return Ok(strain);
        }
        let largest = |a: &Csc| a.diagonal().iter().fold(0.0_f64, |x, v| x.max(v.abs()));
        let size = (largest(&strain) / largest(&self.m)).max(f64::MIN_POSITIVE);
        Ok(self.m.combined(size, 0.0, &self.m))
    }

    /// W x of states (y, y'/rate): strains over rate^2, then masses.
    fn energy(&self, strain: &Csc, rate: f64, x: MatRef<'_, f64>, mut out: MatMut<'_, f64>) {
        let n = self.m.rows;
        strain.multiply(x.subrows(0, n), out.as_mut().subrows_mut(0, n), false);
        let scale = 1.0 / (rate * rate);
        for j in 0..x.ncols() {
            for i in 0..n {
                out[(i, j)] *= scale;
            }
        }
        self.m.multiply(x.subrows(n, n), out.subrows_mut(n, n), false);
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

    fn weigh(&self, x: MatRef<'_, f64>, out: MatMut<'_, f64>) {
        self.system.energy(self.strain, self.rate, x, out);
    }
}

/// The `wanted` roots with Im s >= 0 of smallest modulus, or those nearest to i `near` (rad/s).
pub fn lowest(system: &Damped, wanted: usize, near: Option<f64>, cancel: &Cancel) -> Result<DampedModes> {
    let n = system.m.rows;
    if wanted == 0 || wanted > n {
        return Err(Error::model(format!("n = {wanted} modes were asked for; the system has {n} coordinates")));
    }
    if near.is_some_and(|w| !w.is_finite()) {
        return Err(Error::model("the shift is not finite"));
    }
    let mut counts = Counts::default();
    let options = Options::new(2 * wanted, false);
    let widest = Options::new(2 * (wanted + BUFFER), false);
    let is_small = 2 * n < widest.dim + 3 * widest.block;
    let (s, shape, sigma) = match near {
        _ if is_small => {
            counts.add("dense eigensolutions", 1);
            let (s, shape) = every(system)?;
            (s, shape, shift(system, wanted, &mut counts, cancel)?.0)
        }
        Some(near) if near > 0.0 => beside(system, near, widest, &mut counts, cancel)?,
        _ => slowest(system, wanted, (options, widest), &mut counts, cancel)?,
    };
    let shape = normalised(system, shape.as_ref());
    let (s, shape, rigid) = merge_rigid(system, s, shape, sigma);
    let target = c64::new(0.0, near.unwrap_or(0.0));
    let mut order: Vec<usize> = (0..s.len()).collect();
    order.sort_by(|a, b| (s[*a] - target).norm().total_cmp(&(s[*b] - target).norm()));
    order.truncate(wanted);
    order.sort_by(|a, b| s[*a].norm().total_cmp(&s[*b].norm()).then(s[*b].re.total_cmp(&s[*a].re)));
    let s: Vec<c64> = order.iter().map(|k| s[*k]).collect();
    let shape = Mat::from_fn(n, order.len(), |i, j| shape[(i, order[j])]);
    Ok(DampedModes { residual: system.residuals(&s, shape.as_ref()), s, shape, rigid, sigma, counts })
}

type Roots = (Vec<c64>, Mat<c64>, f64);

/// The roots of smallest modulus: about zero, or from where the undamped roots begin if those lie close together far from zero.
fn slowest(
    system: &Damped,
    wanted: usize,
    (options, widest): (Options, Options),
    counts: &mut Counts,
    cancel: &Cancel,
) -> Result<Roots> {
    let (sigma, strain) = shift(system, wanted, counts, cancel)?;
    if sigma != 0.0 {
        return iterated(system, wanted, (sigma, strain), options, counts, cancel);
    }
    let patient = Options { max_cycles: PATIENCE, ..options };
    match iterated(system, wanted, (sigma, strain), patient, counts, cancel) {
        Err(Error::Convergence { .. }) => {}
        found => return found,
    }
    counts.add("moved shifts", 1);
    let undamped = Assembled::new(system.m.clone(), system.stiffness())?;
    let mut near = nearer(&undamped, wanted, counts, cancel)?.1.sqrt();
    let mut before: Vec<f64> = Vec::new();
    for _ in 0..MOVES {
        let found = beside(system, near, widest, counts, cancel)?;
        let mut moduli: Vec<f64> = found.0.iter().map(|s| s.norm()).collect();
        moduli.sort_by(f64::total_cmp);
        let (Some(first), Some(last)) = (moduli.first().copied(), moduli.last().copied()) else {
            break;
        };
        moduli.truncate(wanted);
        let same = |(a, b): (&f64, &f64)| (a - b).abs() <= 1e-9 * b;
        if before.len() == moduli.len() && before.iter().zip(&moduli).all(same) {
            return Ok(found);
        }
        // gyroscopic and circulatory terms let roots fall below those of M and K: look from below the lowest
        near = first - (0.25 * (last - first)).clamp(1e-4 * first, 0.5 * first);
        before = moduli;
    }
    Err(Error::Convergence {
        message: format!(
            "the lowest {wanted} modes lie close together far from zero, and searches about {near:.3e} rad/s do not agree; give shift= in Hz"
        ),
        best: Vec::new(),
        residual: f64::NAN,
    })
}

/// The roots nearest to i w by the real part of (A - i w)^-1, which has the eigenvectors of A: theta = s/(s^2 + w^2)
/// (B. N. Parlett and Y. Saad, Linear Algebra and its Applications 88/89 (1987) 575-595).
fn beside(system: &Damped, w: f64, options: Options, counts: &mut Counts, cancel: &Cancel) -> Result<Roots> {
    counts.add("factorisations", 1);
    let strain = system.strain(w, counts)?;
    let pattern = system.s.combined(1.0, 1.0, &system.d).combined(1.0, 1.0, &system.m);
    let order = lu_order(&pattern)?;
    let parts = [&system.s, &system.d, &system.m].map(|a| a.spread_over(&pattern));
    let [s, d, m] = &parts;
    let value: Vec<c64> = (0..s.len()).map(|k| c64::new(s[k] - w * w * m[k], w * d[k])).collect();
    let Some(factor) = ComplexFactor::new(&order, &pattern, &value)? else {
        return Err(Error::singular(
            "the shifted matrix is singular: the shift lies on an undamped root; move it a little",
        ));
    };
    let op = BesideOperator { system, factor, w, strain: &strain };
    let mut space = Space::new(&op, options)?;
    let ritz = space.converge(cancel)?;
    counts.merge(&space.counts);
    let states = space.vectors(&ritz, options.wanted.min(ritz.value.len()));
    let n = system.m.rows;
    let mut roots = Vec::new();
    for k in 0..states.ncols() {
        let theta = ritz.value[k];
        // s^2 theta - s + w^2 theta = 0: of both roots the one that the vector knows, (s y)/y
        let half = c64::new(0.5, 0.0) / theta;
        let apart = (half * half - w * w).sqrt();
        let ratio = (0..n).map(|i| states[(i, k)].conj() * states[(n + i, k)] * w).sum::<c64>()
            / (0..n).map(|i| states[(i, k)].norm_sqr()).sum::<f64>();
        let (a, b) = (half + apart, half - apart);
        let root = if (a - ratio).norm() <= (b - ratio).norm() { a } else { b };
        if root.im >= 0.0 {
            roots.push((root, k));
        }
    }
    let shape = Mat::from_fn(n, roots.len(), |i, j| states[(i, roots[j].1)]);
    Ok((roots.into_iter().map(|r| r.0).collect(), shape, -w))
}

/// Re (A - i w)^-1 on states (y, y'/w).
struct BesideOperator<'a> {
    system: &'a Damped,
    factor: ComplexFactor<'a>,
    w: f64,
    strain: &'a Csc,
}

impl Operator for BesideOperator<'_> {
    fn dim(&self) -> usize {
        2 * self.system.m.rows
    }

    /// (S - w^2 M + i w D) y = -(M b + D a + i w M a), v = a + i w y, for real a and b.
    fn apply(&self, x: MatRef<'_, f64>, mut out: MatMut<'_, f64>) -> Result<()> {
        let (n, w) = (self.system.m.rows, self.w);
        let (a, b) = (x.subrows(0, n), x.subrows(n, n));
        let mut real = Mat::zeros(n, x.ncols());
        self.system.d.multiply(a, real.as_mut(), false);
        let (mut of_a, mut of_b) = (Mat::zeros(n, x.ncols()), Mat::zeros(n, x.ncols()));
        self.system.m.multiply(a, of_a.as_mut(), false);
        self.system.m.multiply(b, of_b.as_mut(), false);
        let mut y = Mat::from_fn(n, x.ncols(), |i, j| c64::new(-real[(i, j)] - w * of_b[(i, j)], -w * of_a[(i, j)]));
        self.factor.solve(y.as_mut());
        for j in 0..x.ncols() {
            for i in 0..n {
                out[(i, j)] = y[(i, j)].re;
                out[(n + i, j)] = a[(i, j)] / w - y[(i, j)].im;
            }
        }
        Ok(())
    }

    fn weigh(&self, x: MatRef<'_, f64>, out: MatMut<'_, f64>) {
        self.system.energy(self.strain, self.w, x, out);
    }
}

fn iterated(
    system: &Damped,
    wanted: usize,
    (sigma, strain): (f64, Option<Csc>),
    options: Options,
    counts: &mut Counts,
    cancel: &Cancel,
) -> Result<Roots> {
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
        let same = |(a, k): (&c64, &usize)| (a - ritz.value[*k]).norm() <= 1e-8 * a.norm();
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
    Ok((s, states.subrows(0, system.m.rows).to_owned(), sigma))
}

/// All roots of a system so small, or of which so many are wanted, that a Krylov basis would exhaust it.
fn every(system: &Damped) -> Result<(Vec<c64>, Mat<c64>)> {
    let n = system.m.rows;
    let dense = |a: &Csc| Mat::from_fn(n, n, |i, j| a.get(i, j));
    let q = Quadratic::new(dense(&system.m), Some(dense(&system.d)), dense(&system.s))?;
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
    let zero = |s: &c64| s.norm() <= 1e-5 * sigma.abs();
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
