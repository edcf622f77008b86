//! ALI3-P: index-3 augmented Lagrangian with the trapezoidal rule and projections, on the Lie group.
//!
//! ```text
//! v* = 2/h x - v0,  a* = 2/h (v* - v0) - a0,  q1 = q0 exp(x - h^2/12 v0 x v*),  c = h^2/4
//! c (M a* + h(q1, v*) + J^T lam) = 0,   Phi(q1) = 0   (rows on velocity level: J v* + Phi_t = 0)
//! W (v1 - v*) + J^T kappa = 0,  J v1 + Phi_t = 0;   W (a1 - a*) + J^T nu = 0,  J a1 + gamma = 0
//! ```
//! for x, the increment h/2 (v0 + v*) of the trapezoidal rule; the product, of three rotations that act together, is their commutator
//! (`rotations`). W = M + h/2 D + c K at (q1, v*, a*), or M. Every linear system is solved as the saddle system to which penalties and
//! multiplier updates converge, so that no penalty leaves a trace; those who ask for them get both (`augmented`). Docs: docs/theory.md (17.14) to (17.17), after D. Dopico and
//! co-workers, Nonlinear Dynamics 93 (2018) 2039-2056. The functions are generic: `gradient` differentiates the very same text.
use nalgebra::{DMatrix, DVector};
use num_dual::{Dual, Dual64};

use crate::error::{Error, Result};
use crate::multibody::assemble::Tangent;
use crate::multibody::topology::Level;
use crate::run::Counts;
use crate::spatial::Real;

use super::augmented::{Augmented, Penalty};
use super::{Equations, Instant, LocalError, Motion, Scheme, Step, scaled_size};
use crate::linalg::kkt::Kkt;
use crate::linalg::matrix::turn_columns;
use crate::multibody::rotations::{Maps, add_turning};
use crate::tolerances::steps::{FIXED_SOLVED, QUADRATIC};

const MAX_ITERATIONS: usize = 25;

/// Corrections below this many times the rounding of a pose that no longer shrink are rounding.
const ROUNDED: f64 = 4096.0;

/// The metric of the projections.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Weight {
    #[default]
    Tangent,
    Mass,
}

/// All that is needed to repeat a step without iterating.
#[derive(Debug, Clone, Default)]
pub struct Record {
    pub h: f64,
    /// x
    pub straight: Vec<f64>,
    pub lam: Vec<f64>,
    /// v1 - v* and a1 - a*, and the multipliers that made them
    pub dv: Vec<f64>,
    pub kappa: Vec<f64>,
    pub da: Vec<f64>,
    pub nu: Vec<f64>,
    /// largest miss of the rows of velocities before and behind their projection, of accelerations before and behind it: in
    /// characteristic lengths and radians per s and s2
    pub misses: [f64; 4],
}

/// The matrices of a step, factorised; that of the step at the last iterate but one, from which the solution differs by rounding.
pub struct Factors {
    pub step: Kkt,
    pub projection: Option<Kkt>,
    pub weight: Weight,
    /// what the first one was made of, for those who differentiate
    pub linear: Option<Linear>,
    /// was the last correction so small that this is the tangent at the solution?
    pub exact: bool,
    /// did the last correction leave the multipliers, of which the tangent is made, as they were?
    pub settled: bool,
}

/// Derivatives of the residual and of the rows by the motion, in increments of the tree coordinates.
pub struct Linear {
    pub tangent: Tangent<f64>,
    pub jacobian: DMatrix<f64>,
}

impl Linear {
    /// M + d D + k K.
    pub fn combined(&self, d: f64, k: f64) -> DMatrix<f64> {
        let t = &self.tangent;
        let mut out = &t.mass + &t.stiffness * k;
        for part in [&t.damping, &t.gyroscopic].into_iter().flatten() {
            out.zip_apply(part, |a, b| *a += b * d);
        }
        out
    }
}

/// How accelerations changed over the last steps, from which the next ones are foreseen: a polynomial through three of them.
#[derive(Debug, Clone, Default)]
pub struct Trend {
    /// changes over the last two steps by their lengths, and these
    slopes: Vec<(Vec<f64>, f64)>,
}

impl Trend {
    /// A step was made.
    pub fn pass(&mut self, from: &[f64], to: &[f64], h: f64) {
        let slope = to.iter().zip(from).map(|(a, b)| (a - b) / h).collect();
        if self.slopes.len() == 2 {
            self.slopes.remove(0);
        }
        self.slopes.push((slope, h));
    }

    /// Accelerations after another step.
    fn ahead(&self, a0: &[f64], h: f64) -> Vec<f64> {
        let mut a = a0.to_vec();
        let Some((slope, last)) = self.slopes.last() else {
            return a;
        };
        for (a, s) in a.iter_mut().zip(slope) {
            *a += h * s;
        }
        if let [(before, first), _] = self.slopes.as_slice() {
            let factor = h * (h + last) / (last + first);
            for (a, (s, b)) in a.iter_mut().zip(slope.iter().zip(before)) {
                *a += factor * (s - b);
            }
        }
        a
    }
}

/// What the trapezoidal rule makes of x: the increment, the motion with v*, and a*.
pub fn stars<T: Real>(
    eq: &Equations<'_, T>,
    from: &Motion<T>,
    a0: &[T],
    x: &[T],
    h: f64,
) -> (Vec<T>, Motion<T>, Vec<T>) {
    let f = 2.0 / h;
    let rate: Vec<T> = x.iter().zip(&from.rate).map(|(x, v0)| *x * f - *v0).collect();
    let a = (0..x.len()).map(|i| (rate[i] - from.rate[i]) * f - a0[i]).collect();
    let mut dq = x.to_vec();
    add_turning(eq.topology(), h, (&from.rate, &rate), &mut dq);
    let mut m = from.moved(eq.topology(), &dq);
    m.t = from.t + h;
    m.rate = rate;
    (dq, m, a)
}

/// Phi of position rows, h/2 (J v* + Phi_t) of velocity rows.
pub fn closure<T: Real>(eq: &Equations<'_, T>, m: &Motion<T>, h: f64) -> DVector<T> {
    closure_by(eq, m, 0.5 * h)
}

/// The same with another factor of velocity rows.
pub fn closure_by<T: Real>(eq: &Equations<'_, T>, m: &Motion<T>, factor: f64) -> DVector<T> {
    let (mut phi, jacobian) = eq.rows(m);
    eq.close_rates(m, &jacobian, factor, &mut phi);
    phi
}

/// The closure without its Jacobian.
pub fn closure_values<T: Real>(eq: &Equations<'_, T>, m: &Motion<T>, factor: f64) -> DVector<T> {
    let placement = eq.place(m);
    let mut phi = eq.scene(m, &placement, None).row_values();
    if eq.topology().has_velocity_rows() {
        let rates = eq.row_rates(m);
        for (i, row) in eq.topology().rows.iter().enumerate() {
            if row.level == Level::Velocity {
                phi[i] = rates[i] * factor;
            }
        }
    }
    phi
}

impl<T: Real> Equations<'_, T> {
    /// Velocity rows of a closure: J v + Phi_t times a factor.
    fn close_rates(&self, m: &Motion<T>, jacobian: &DMatrix<T>, factor: f64, phi: &mut DVector<T>) {
        if !self.topology().has_velocity_rows() {
            return;
        }
        let rates = self.row_rates_of(m, jacobian);
        for (i, row) in self.topology().rows.iter().enumerate() {
            if row.level == Level::Velocity {
                phi[i] = rates[i] * factor;
            }
        }
    }
}

/// The same equations over duals of their numbers.
pub fn lifted<'a, T: Real>(eq: &Equations<'a, T>) -> Equations<'a, Dual<T>> {
    let x = eq.x.iter().map(|v| Dual::from_re(*v)).collect();
    Equations::with_geometry(eq.system, x, eq.geometry.map(Dual::from_re), eq.effects)
}

/// J^T y, y one number per row.
pub fn pulled<T: Real>(jacobian: &DMatrix<T>, y: &[f64]) -> DVector<T> {
    DVector::from_fn(jacobian.ncols(), |j, _| (0..jacobian.nrows()).fold(T::zero(), |s, i| s + jacobian[(i, j)] * y[i]))
}

impl Equations<'_, f64> {
    /// X J_l(theta): columns of three rotations together, so that X acts on changes of an increment theta.
    pub fn turned_columns(&self, mut x: DMatrix<f64>, theta: &[f64]) -> DMatrix<f64> {
        turn_columns(&mut x, &self.rotation_maps(theta));
        x
    }

    /// The matrix of a step: derivative of balance and closure by (x, c lam); `maps`: what x does to the pose.
    fn step_matrix(
        &self,
        from: &Instant,
        (x, maps): (&[f64], &Maps),
        linear: &Linear,
        h: f64,
        penalty: Option<Penalty>,
        counts: &mut Counts,
    ) -> Result<(Kkt, Option<Augmented>)> {
        let t = &linear.tangent;
        let mut matrix = &t.stiffness * (0.25 * h * h);
        turn_columns(&mut matrix, maps);
        matrix += &t.mass;
        for part in [&t.damping, &t.gyroscopic].into_iter().flatten() {
            matrix.zip_apply(part, |a, b| *a += b * (0.5 * h));
        }
        let mut right = linear.jacobian.clone();
        turn_columns(&mut right, maps);
        if self.topology().has_velocity_rows() {
            self.velocity_row_slopes(from, x, h, &mut right);
        }
        self.systems(&matrix, &linear.jacobian, &right, penalty, counts)
    }

    /// The saddle system, and beside it the one with penalties where it is asked for.
    fn systems(
        &self,
        matrix: &DMatrix<f64>,
        jacobian: &DMatrix<f64>,
        right: &DMatrix<f64>,
        penalty: Option<Penalty>,
        counts: &mut Counts,
    ) -> Result<(Kkt, Option<Augmented>)> {
        counts.add("factorisations", 1);
        let kkt = self.kkt_of(matrix, jacobian, right)?;
        let augmented = penalty.map(|by| Augmented::new(matrix, jacobian, right, kkt.kept(), by));
        Ok((kkt, augmented))
    }

    /// Rows of velocity level: h/2 d(J v*)/dx, column by column with a dual number.
    fn velocity_row_slopes(&self, from: &Instant, x: &[f64], h: f64, right: &mut DMatrix<f64>) {
        let dual = lifted(self);
        let lift = |v: &[f64]| v.iter().map(|x| Dual64::from(*x)).collect::<Vec<_>>();
        let start = Motion {
            t: from.motion.t,
            q: lift(&from.motion.q),
            rate: lift(&from.motion.rate),
            memory: lift(&from.motion.memory),
        };
        let a = lift(&from.acceleration);
        for j in 0..x.len() {
            let mut increment = lift(x);
            increment[j].eps = 1.0;
            let (_, m, _) = stars(&dual, &start, &a, &increment, h);
            let rates = closure(&dual, &m, h);
            for (i, row) in self.topology().rows.iter().enumerate() {
                if row.level == Level::Velocity {
                    right[(i, j)] = rates[i].eps;
                }
            }
        }
    }

    /// The matrix of both projections.
    fn projection_matrix(
        &self,
        m: &Motion<f64>,
        a: &[f64],
        jacobian: &DMatrix<f64>,
        h: f64,
        (weight, penalty): (Weight, Option<Penalty>),
        counts: &mut Counts,
    ) -> Result<(Kkt, Option<Augmented>)> {
        let matrix = match weight {
            Weight::Mass => self.mass(m),
            Weight::Tangent => Linear { tangent: self.tangent(m, a, &[], counts), jacobian: DMatrix::zeros(0, 0) }
                .combined(0.5 * h, 0.25 * h * h),
        };
        self.systems(&matrix, jacobian, jacobian, penalty, counts)
    }

    /// One step, with what is needed to repeat it; the accelerations at its end are foreseen by those before.
    pub fn ali3p_step(
        &self,
        from: &Instant,
        h: f64,
        trend: &Trend,
        (weight, penalty): (Weight, Option<Penalty>),
        counts: &mut Counts,
    ) -> Result<(Instant, Record, Factors)> {
        let n = self.n();
        let (v0, a0) = (&from.motion.rate, &from.acceleration);
        let ahead = trend.ahead(a0, h);
        let c = 0.25 * h * h;
        let mut x: Vec<f64> = (0..n).map(|i| h * v0[i] + c * (a0[i] + ahead[i])).collect();
        let mut lam = from.lam.clone();
        let (step, linear, exact, settled) = self.newton(from, h, (&mut x, &mut lam), penalty, counts)?;
        let (_, m, a) = stars(self, &from.motion, a0, &x, h);
        let mut record = Record { h, straight: x, lam, ..Record::default() };
        let mut end = Instant { motion: m, acceleration: a, lam: record.lam.clone() };
        let projection =
            (self.n_rows() > 0).then(|| self.project(&mut end, &mut record, (weight, penalty), counts)).transpose()?;
        let factors = Factors { step, projection, weight, linear: Some(linear), exact, settled };
        Ok((end, record, factors))
    }

    /// The matrix of a step at its solution, for those who differentiate: one correction may solve a short step, and its matrix was made
    /// of the multipliers before.
    pub fn renew(&self, from: &Instant, record: &Record, factors: &mut Factors, counts: &mut Counts) -> Result<()> {
        let (x, h) = (&record.straight, record.h);
        let (dq, m, a) = stars(self, &from.motion, &from.acceleration, x, h);
        let linear = self.linearised(&m, &a, &record.lam, 0.5 * h, counts).2;
        let maps = self.step_maps(&dq, &from.motion.rate, h, 2.0 / h);
        factors.step = self.step_matrix(from, (x, &maps), &linear, h, None, counts)?.0;
        (factors.linear, factors.exact, factors.settled) = (Some(linear), true, true);
        Ok(())
    }

    fn project(
        &self,
        end: &mut Instant,
        record: &mut Record,
        by: (Weight, Option<Penalty>),
        counts: &mut Counts,
    ) -> Result<Kkt> {
        let jacobian = self.rows(&end.motion).1;
        let (kkt, augmented) =
            self.projection_matrix(&end.motion, &end.acceleration, &jacobian, record.h, by, counts)?;
        let scales = self.row_scales();
        let size = |miss: &DVector<f64>| miss.iter().zip(&scales).fold(0.0, |s: f64, (m, c)| s.max((m * c).abs()));
        counts.add("velocity projections", 1);
        counts.add("acceleration projections", 1);
        let none = DVector::zeros(self.n());
        let rates = self.row_rates_of(&end.motion, &jacobian);
        let (dv, kappa) = solved(&kkt, augmented.as_ref(), &none, &-&rates, counts)?;
        for (v, d) in end.motion.rate.iter_mut().zip(dv.iter()) {
            *v += d;
        }
        let miss = self.row_bias(&end.motion) + &jacobian * DVector::from_column_slice(&end.acceleration);
        let (da, nu) = solved(&kkt, augmented.as_ref(), &none, &-&miss, counts)?;
        let behind = [&rates + &jacobian * &dv, &miss + &jacobian * &da];
        record.misses = [size(&rates), size(&behind[0]), size(&miss), size(&behind[1])];
        for (a, d) in end.acceleration.iter_mut().zip(da.iter()) {
            *a += d;
        }
        record.dv = dv.as_slice().to_vec();
        record.kappa = kappa.as_slice().to_vec();
        record.da = da.as_slice().to_vec();
        record.nu = nu.as_slice().to_vec();
        Ok(kkt)
    }

    /// Residual, closure (velocity rows times a factor) and their derivatives, all of one placement.
    pub fn linearised(
        &self,
        m: &Motion<f64>,
        a: &[f64],
        lam: &[f64],
        factor: f64,
        counts: &mut Counts,
    ) -> (DVector<f64>, DVector<f64>, Linear) {
        counts.add("force evaluations", 1);
        let placement = self.place(m);
        let carried = (!lam.is_empty()).then_some(lam);
        let r = self.scene(m, &placement, Some(a)).residual(carried);
        let tangent = self.tangent_at(m, &placement, a, lam, counts);
        let (mut phi, jacobian) = match self.n_rows() {
            0 => (DVector::zeros(0), DMatrix::zeros(0, self.n())),
            _ => self.scene(m, &placement, None).constraints(),
        };
        self.close_rates(m, &jacobian, factor, &mut phi);
        (r, phi, Linear { tangent, jacobian })
    }

    /// Derivatives alone of the same.
    pub fn tangents_of(&self, m: &Motion<f64>, a: &[f64], lam: &[f64], counts: &mut Counts) -> Linear {
        let placement = self.place(m);
        let jacobian = match self.n_rows() {
            0 => DMatrix::zeros(0, self.n()),
            _ => self.scene(m, &placement, None).constraints().1,
        };
        Linear { tangent: self.tangent_at(m, &placement, a, lam, counts), jacobian }
    }

    fn newton(
        &self,
        from: &Instant,
        h: f64,
        (x, lam): (&mut [f64], &mut [f64]),
        penalty: Option<Penalty>,
        counts: &mut Counts,
    ) -> Result<(Kkt, Linear, bool, bool)> {
        let scales = self.scales();
        let size = |v: &[f64]| scaled_size(v, &scales);
        // multipliers as energies, whatever the units of their rows
        let row_scales = self.row_scales();
        let largest = |l: &[f64]| l.iter().zip(&row_scales).fold(0.0_f64, |most, (l, s)| most.max((l / s).abs()));
        let c = 0.25 * h * h;
        let mut last = f64::INFINITY;
        for _ in 0..MAX_ITERATIONS {
            counts.add("iterations", 1);
            let (dq, m, a) = stars(self, &from.motion, &from.acceleration, x, h);
            let (mut r, phi, linear) = self.linearised(&m, &a, lam, 0.5 * h, counts);
            r *= -c;
            if r.iter().chain(phi.iter()).any(|v| !v.is_finite()) {
                return Err(unsolved(h, f64::NAN));
            }
            let maps = self.step_maps(&dq, &from.motion.rate, h, 2.0 / h);
            let penalty = penalty.filter(|_| self.n_rows() > 0);
            let (by, augmented) = self.step_matrix(from, (x, &maps), &linear, h, penalty, counts)?;
            let (dx, y) = solved(&by, augmented.as_ref(), &r, &-phi, counts)?;
            for (x, d) in x.iter_mut().zip(dx.iter()) {
                *x += d;
            }
            for (l, y) in lam.iter_mut().zip(y.iter()) {
                *l += y / c;
            }
            let step = size(dx.as_slice());
            let whole = size(x).max(c * size(&from.acceleration));
            // what the last correction leaves, by how fast they shrink
            let left = if last.is_finite() { step * step / last } else { 0.0 };
            if step <= QUADRATIC * whole && left <= 16.0 * f64::EPSILON * whole || step <= 4.0 * f64::EPSILON {
                return Ok((
                    by,
                    linear,
                    step <= FIXED_SOLVED * whole,
                    largest(y.as_slice()) <= QUADRATIC * c * largest(lam),
                ));
            }
            if step > 2.0 * last && step > 1.0 {
                break;
            }
            // rounding of a long way or of stiff forces: no further progress
            if step > 0.5 * last && step < ROUNDED * self.rounding(&m) {
                return Ok((by, linear, false, largest(y.as_slice()) <= QUADRATIC * c * largest(lam)));
            }
            last = step;
        }
        Err(unsolved(h, last))
    }
}

/// The saddle point, or what the passes make of it.
fn solved(
    kkt: &Kkt,
    augmented: Option<&Augmented>,
    f: &DVector<f64>,
    g: &DVector<f64>,
    counts: &mut Counts,
) -> Result<(DVector<f64>, DVector<f64>)> {
    let Some(augmented) = augmented else {
        return kkt.solve_one(f, g);
    };
    counts.add("multiplier passes", augmented.passes() as u64);
    augmented.solve(f, g)
}

fn unsolved(h: f64, residual: f64) -> Error {
    Error::Convergence {
        message: format!("the equations of a step of {h:.2e} s did not converge"),
        best: Vec::new(),
        residual,
    }
}

/// The scheme as a driver sees it.
#[derive(Default)]
pub struct Ali3p {
    pub weight: Weight,
    penalty: Option<Penalty>,
    trend: Trend,
    /// of the step just made, and the largest of those accepted
    misses: [f64; 4],
    largest: [f64; 4],
}

impl Ali3p {
    pub fn new(weight: Weight, penalty: Option<Penalty>) -> Self {
        Ali3p { weight, penalty, ..Ali3p::default() }
    }

    /// Leading terms of the trapezoidal rule: h^3/12 of the third and of the fourth derivative.
    fn estimate(&self, from: &Instant, end: &Instant, h: f64) -> LocalError {
        let n = end.acceleration.len();
        let slope = |i: usize| (end.acceleration[i] - from.acceleration[i]) / h;
        let second = |i: usize| {
            let last = self.trend.slopes.last();
            last.map_or(0.0, |(s, before)| 2.0 * (slope(i) - s[i]) / (h + before))
        };
        let factor = h * h * h / 12.0;
        LocalError {
            position: (0..n).map(|i| factor * slope(i)).collect(),
            rate: (0..n).map(|i| factor * second(i)).collect(),
            state: Vec::new(),
        }
    }
}

impl Scheme for Ali3p {
    fn order(&self) -> u32 {
        2
    }

    fn step(
        &mut self,
        eq: &Equations<'_, f64>,
        from: &Instant,
        h: f64,
        estimate: bool,
        counts: &mut Counts,
    ) -> Result<Step> {
        let (end, record, _) =
            eq.ali3p_step(&eq.opened(from, h), h, &self.trend, (self.weight, self.penalty), counts)?;
        self.misses = record.misses;
        if estimate {
            let projected = end.motion.rate.iter().zip(&record.dv);
            let before: Vec<f64> = projected.map(|(v, d)| v - d).collect();
            eq.same_branch(&before, &end, h)?;
        }
        let state = || eq.state_error(&from.motion, &end.motion, h);
        let error = estimate.then(|| LocalError { state: state(), ..self.estimate(from, &end, h) });
        Ok(Step { end, error })
    }

    fn accept(&mut self, _eq: &Equations<'_, f64>, from: &Instant, step: &Step, h: f64) {
        self.trend.pass(&from.acceleration, &step.end.acceleration, h);
        self.largest.iter_mut().zip(self.misses).for_each(|(all, one)| *all = all.max(one));
    }

    fn per_unit_step(&self) -> bool {
        true
    }

    fn reset(&mut self) {
        self.trend = Trend::default();
    }

    fn measures(&self) -> Vec<(&'static str, f64)> {
        const NAMES: [&str; 4] = [
            "velocity residual before projection",
            "velocity residual after projection",
            "acceleration residual before projection",
            "acceleration residual after projection",
        ];
        let mut all: Vec<_> = NAMES.into_iter().zip(self.largest).collect();
        if let Some(by) = self.penalty {
            all.extend([("penalty factor", by.factor), ("passes", by.passes as f64)]);
        }
        all
    }
}
