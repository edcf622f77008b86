//! Prescribed functions of time: of drives (value, rate, acceleration) and of loads (value).
//!
//! ```text
//! ramp        offset + rate (t - start) for t >= start, offset before
//! sine        offset + amplitude sin(omega t + phase)
//! polynomial  c_0 + c_1 t + c_2 t^2 + ...
//! table       straight lines, or the natural cubic spline, through (t_i, v_i); the end values outside
//! function    a Python function
//! ```
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use crate::error::{Error, Result};
use crate::spatial::Real;
use crate::tolerances::motion::QUIET;

/// A function from outside: all its outputs at a time.
pub struct Function {
    call: Box<dyn Fn(f64) -> Vec<f64> + Send + Sync>,
    /// several rows and iterations ask for the same time
    last: Mutex<Option<(f64, Arc<[f64]>)>>,
}

impl std::fmt::Debug for Function {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Function")
    }
}

impl Function {
    /// `call` cannot return an error, since it is used deep in the equations, which have no use for one: it unwinds.
    pub fn new(call: impl Fn(f64) -> Vec<f64> + Send + Sync + 'static) -> Self {
        Function { call: Box::new(call), last: Mutex::new(None) }
    }

    fn output(&self, t: f64, k: usize) -> f64 {
        let known = self.last().as_ref().filter(|(at, _)| *at == t).map(|(_, values)| values.clone());
        let values = known.unwrap_or_else(|| {
            // the lock is free meanwhile: the function may evaluate this model itself
            let values: Arc<[f64]> = (self.call)(t).into();
            *self.last() = Some((t, values.clone()));
            values
        });
        values.get(k).copied().unwrap_or(f64::NAN)
    }

    fn last(&self) -> MutexGuard<'_, Option<(f64, Arc<[f64]>)>> {
        self.last.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum MotionKind {
    Ramp,
    /// angular frequency in rad/s
    Sine,
    /// frequency in hertz
    SineHertz,
    Polynomial,
    Table,
    Lines,
    Function,
}

/// A motion as Tables hold it: `n` numbers at `x`, or a function and the first of its outputs.
#[derive(Debug, Clone)]
pub struct MotionSpec {
    pub kind: MotionKind,
    pub n: usize,
    pub x: usize,
    pub function: Option<Arc<Function>>,
    pub output: usize,
}

impl MotionKind {
    pub fn from_code(code: i64, n: usize) -> Result<Self> {
        use MotionKind::*;
        let (kind, fits) = match code {
            0 => (Ramp, n == 3),
            1 => (Sine, n == 4),
            2 => (SineHertz, n == 4),
            3 => (Polynomial, n >= 1),
            4 => (Table, n >= 4 && n.is_multiple_of(2)),
            5 => (Lines, n >= 4 && n.is_multiple_of(2)),
            6 => (Function, n == 0),
            _ => return Err(Error::model(format!("motion type {code} does not exist"))),
        };
        if fits { Ok(kind) } else { Err(Error::model(format!("a motion of type {code} cannot have {n} numbers"))) }
    }
}

/// A motion with its numbers, ready to be evaluated.
#[derive(Debug, Clone)]
pub enum MotionLaw<T: Real> {
    Ramp {
        rate: T,
        offset: T,
        start: T,
    },
    Sine {
        amplitude: T,
        omega: T,
        phase: T,
        offset: T,
    },
    Polynomial(Vec<T>),
    Table {
        t: Vec<T>,
        v: Vec<T>,
        /// second derivatives at the knots; none of straight lines
        curvature: Vec<T>,
    },
    Function(Option<Arc<Function>>, usize),
}

impl<T: Real> MotionLaw<T> {
    /// The same numbers as others, one by one in a fixed order.
    pub fn map<U: Real>(&self, f: &mut impl FnMut(T) -> U) -> MotionLaw<U> {
        let mut all = |v: &[T]| v.iter().map(|x| f(*x)).collect::<Vec<U>>();
        match self {
            MotionLaw::Ramp { rate, offset, start } => {
                MotionLaw::Ramp { rate: f(*rate), offset: f(*offset), start: f(*start) }
            }
            MotionLaw::Sine { amplitude, omega, phase, offset } => {
                MotionLaw::Sine { amplitude: f(*amplitude), omega: f(*omega), phase: f(*phase), offset: f(*offset) }
            }
            MotionLaw::Polynomial(c) => MotionLaw::Polynomial(all(c)),
            MotionLaw::Table { t, v, curvature } => {
                MotionLaw::Table { t: all(t), v: all(v), curvature: all(curvature) }
            }
            MotionLaw::Function(function, output) => MotionLaw::Function(function.clone(), *output),
        }
    }

    pub fn derive(spec: &MotionSpec, x: &[T]) -> Self {
        let p = &x[spec.x..spec.x + spec.n];
        let sine = |omega: T| MotionLaw::Sine { amplitude: p[0], omega, phase: p[2], offset: p[3] };
        let knots = || (p[..spec.n / 2].to_vec(), p[spec.n / 2..].to_vec());
        match spec.kind {
            MotionKind::Ramp => MotionLaw::Ramp { rate: p[0], offset: p[1], start: p[2] },
            MotionKind::Sine => sine(p[1]),
            MotionKind::SineHertz => sine(p[1] * std::f64::consts::TAU),
            MotionKind::Polynomial => MotionLaw::Polynomial(p.to_vec()),
            MotionKind::Table => {
                let (t, v) = knots();
                let curvature = natural_spline(&t, &v);
                MotionLaw::Table { t, v, curvature }
            }
            MotionKind::Lines => {
                let (t, v) = knots();
                let curvature = Vec::new();
                MotionLaw::Table { t, v, curvature }
            }
            MotionKind::Function => MotionLaw::Function(spec.function.clone(), spec.output),
        }
    }

    /// Value, rate and acceleration; at a kink those that follow it.
    pub fn at(&self, t: f64) -> [T; 3] {
        match self {
            MotionLaw::Ramp { rate, offset, start } => {
                if t < start.re() {
                    [*offset, T::zero(), T::zero()]
                } else {
                    [*offset + *rate * (-*start + t), *rate, T::zero()]
                }
            }
            MotionLaw::Sine { amplitude, omega, phase, offset } => {
                let (s, c) = (*omega * t + *phase).sin_cos();
                let swing = *amplitude * s;
                [*offset + swing, *amplitude * *omega * c, -(*omega * *omega * swing)]
            }
            MotionLaw::Polynomial(c) => {
                c.iter().rev().fold([T::zero(); 3], |[v, d, dd], c| [v * t + *c, d * t + v, dd * t + d * 2.0])
            }
            MotionLaw::Table { t: at, v, curvature } => table(at, v, curvature, t),
            MotionLaw::Function(None, _) => [T::from(f64::NAN); 3],
            MotionLaw::Function(Some(f), output) => std::array::from_fn(|k| T::from(f.output(t, output + k))),
        }
    }

    /// Times at which the rate jumps, or what a table is made of ends.
    pub fn kinks(&self) -> Vec<f64> {
        match self {
            MotionLaw::Ramp { start, .. } => vec![start.re()],
            MotionLaw::Table { t, curvature, .. } if curvature.is_empty() => t.iter().map(|t| t.re()).collect(),
            MotionLaw::Table { t, .. } => vec![t[0].re(), t[t.len() - 1].re()],
            _ => Vec::new(),
        }
    }

    /// Knots of a spline between which it leaves a quiet stretch: long steps there would not see what comes.
    pub fn wakes(&self) -> Vec<f64> {
        let MotionLaw::Table { t, curvature, .. } = self else {
            return Vec::new();
        };
        let largest = curvature.iter().map(|m| m.re().abs()).fold(0.0, f64::max);
        let quiet: Vec<bool> = curvature.iter().map(|m| m.re().abs() <= QUIET * largest).collect();
        let wakes = |i: &usize| !quiet[*i] && quiet[i - QUIET_KNOTS..*i].iter().all(|q| *q);
        let all = (QUIET_KNOTS..quiet.len()).filter(wakes);
        all.flat_map(|i| [t[i - 1].re(), t[i].re()]).collect()
    }
}

/// A spline is quiet where its curvature is small over so many knots.
const QUIET_KNOTS: usize = 3;

fn table<T: Real>(at: &[T], v: &[T], curvature: &[T], t: f64) -> [T; 3] {
    let n = at.len();
    if t < at[0].re() {
        return [v[0], T::zero(), T::zero()];
    }
    if t >= at[n - 1].re() {
        return [v[n - 1], T::zero(), T::zero()];
    }
    let i = at.partition_point(|knot| knot.re() <= t) - 1;
    let h = at[i + 1] - at[i];
    let (b, a) = (-at[i] + t, at[i + 1] - t);
    let slope = (v[i + 1] - v[i]) / h;
    let (mut value, mut rate, mut acceleration) = (v[i] + slope * b, slope, T::zero());
    if let (Some(p), Some(q)) = (curvature.get(i), curvature.get(i + 1)) {
        // the cubic with these second derivatives at the ends, and zero there
        value += (*p * a * (a * a - h * h) + *q * b * (b * b - h * h)) / (h * 6.0);
        rate += (*p * (h * h - a * a * 3.0) + *q * (b * b * 3.0 - h * h)) / (h * 6.0);
        acceleration = (*p * a + *q * b) / h;
    }
    [value, rate, acceleration]
}

/// Second derivatives of the natural cubic spline at its knots: h_i-1 m_i-1 + 2 (h_i-1 + h_i) m_i + h_i m_i+1 = 6 (s_i - s_i-1).
fn natural_spline<T: Real>(t: &[T], v: &[T]) -> Vec<T> {
    let n = t.len();
    let mut m = vec![T::zero(); n];
    let h: Vec<T> = (0..n - 1).map(|i| t[i + 1] - t[i]).collect();
    let s: Vec<T> = (0..n - 1).map(|i| (v[i + 1] - v[i]) / h[i]).collect();
    let mut diagonal = vec![T::one(); n];
    for i in 1..n - 1 {
        diagonal[i] = (h[i - 1] + h[i]) * 2.0;
        m[i] = (s[i] - s[i - 1]) * 6.0;
        if i > 1 {
            let w = h[i - 1] / diagonal[i - 1];
            diagonal[i] -= w * h[i - 1];
            let before = m[i - 1];
            m[i] -= w * before;
        }
    }
    for i in (1..n - 1).rev() {
        let after = m[i + 1];
        m[i] = (m[i] - h[i] * after) / diagonal[i];
    }
    m
}

#[cfg(test)]
mod tests {
    use super::*;
    use num_dual::Dual2_64;

    /// Rate and acceleration against a dual number in the coefficients: shifting the start of time is the same as time itself.
    #[test]
    fn rates_are_derivatives_of_the_value() {
        let cases = [
            (MotionKind::Ramp, vec![0.7, 0.2, 0.4]),
            (MotionKind::Sine, vec![0.7, 3.0, 0.4, 0.1]),
            (MotionKind::SineHertz, vec![0.7, 0.5, 0.4, 0.1]),
            (MotionKind::Polynomial, vec![0.7, 3.0, -0.4, 0.1]),
            (MotionKind::Table, vec![0.0, 0.5, 1.1, 2.0, 0.3, 0.9, -0.2, 0.5]),
            (MotionKind::Lines, vec![0.0, 0.5, 1.1, 2.0, 0.3, 0.9, -0.2, 0.5]),
        ];
        for (kind, numbers) in cases {
            let spec = MotionSpec { kind, n: numbers.len(), x: 0, function: None, output: 0 };
            let law = MotionLaw::derive(&spec, &numbers);
            for t in [0.61, 1.3, 1.95] {
                let [_, rate, acceleration] = law.at(t);
                let h = 1e-4;
                let at = |dt: f64| law.at(t + dt)[0];
                let slope = (at(h) - at(-h)) / (2.0 * h);
                let bend = (at(h) - 2.0 * at(0.0) + at(-h)) / (h * h);
                assert!((slope - rate).abs() < 1e-6, "{kind:?} {t}");
                assert!((bend - acceleration).abs() < 1e-5, "{kind:?} {t}");
            }
        }
        let linear: Vec<Dual2_64> = [1.0, 2.0].iter().map(|v| Dual2_64::from(*v)).collect();
        assert_eq!(MotionLaw::Polynomial(linear).at(2.0)[0].re, 5.0);
    }

    /// Five knots that bend little before one that bends by one: a long step there would pass it.
    #[test]
    fn a_spline_wakes_behind_a_stretch_that_bends_by_less_than_a_thousandth() {
        let at: Vec<f64> = (0..6).map(f64::from).collect();
        let wakes = |little: f64| {
            let curvature = vec![little, -little, little, -little, little, 1.0];
            MotionLaw::Table { t: at.clone(), v: vec![0.0; 6], curvature }.wakes()
        };
        assert_eq!(wakes(1e-4), [4.0, 5.0]);
        assert!(wakes(1e-2).is_empty());
    }

    /// A function that evaluates the law it belongs to must not wait for itself; each time is computed once.
    #[test]
    fn a_function_may_use_its_own_law_and_is_called_once_a_time() {
        let itself: Arc<std::sync::OnceLock<Arc<Function>>> = Arc::default();
        let calls = Arc::new(std::sync::atomic::AtomicUsize::new(0));
        let (own, counted) = (itself.clone(), calls.clone());
        let f = Arc::new(Function::new(move |t| {
            counted.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
            let before = if t > 0.3 { own.get().map_or(0.0, |f| f.output(t - 0.31, 1)) } else { 0.0 };
            vec![t, 1.0 + before, 0.0]
        }));
        itself.set(f.clone()).unwrap();
        let law: MotionLaw<f64> = MotionLaw::Function(Some(f), 0);
        assert_eq!(law.at(0.7)[1], 3.0);
        assert_eq!(calls.load(std::sync::atomic::Ordering::Relaxed), 3);
        assert_eq!(law.at(0.7)[0], 0.7);
    }

    /// What unwinds out of a function is not kept: the next call is a call.
    #[test]
    fn a_function_that_unwinds_can_be_called_again() {
        let f = Function::new(|t| if t > 1.0 { std::panic::resume_unwind(Box::new("late")) } else { vec![t] });
        let outcome = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| f.output(1.7, 0)));
        assert_eq!(outcome.unwrap_err().downcast_ref::<&str>(), Some(&"late"));
        assert_eq!(f.output(0.6, 0), 0.6);
    }
}
