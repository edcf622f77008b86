//! A law given as a function of time and of several relative coordinates.
//!
//! ```text
//! F(t, u, v; p),   u, v, F of m coordinates;    K_ij = dF_i/du_j,   C_ij = dF_i/dv_j
//! ```
//! Traced, it is a program with the inputs t, u_0 ..., v_0 ..., p_0 ...; otherwise Python gives its values and first slopes.
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use num_dual::Dual;

use crate::error::{Error, Result};
use crate::expressions::Program;
use crate::spatial::Real;

use super::law::Side;

/// Most coordinates of one law.
pub const MOST: usize = 6;

type Slopes<T> = [[T; MOST]; MOST];

/// A law of `m` coordinates, which resists: the system feels W F(W^T x, W^T x') on its left-hand side.
#[derive(Debug, Clone)]
pub struct FunctionLaw {
    m: usize,
    n_params: usize,
    body: Arc<Body>,
    /// on one side of each kink
    held: Option<Arc<Program>>,
    uses_rate: bool,
    uses_time: bool,
}

#[derive(Debug)]
enum Body {
    Program(Program),
    External(External),
}

/// At one point the forces, their slopes by u and those by v.
#[derive(Debug, Clone)]
pub struct ForceSlopes<T> {
    pub force: [T; MOST],
    pub k: Slopes<T>,
    pub c: Slopes<T>,
}

impl FunctionLaw {
    /// # Errors
    /// A program that does not fit.
    pub fn traced(m: usize, n_params: usize, program: Program) -> Result<Self> {
        few(m)?;
        if program.n_outputs() != m || program.n_inputs() > 1 + 2 * m + n_params {
            let (n, out) = (program.n_inputs(), program.n_outputs());
            return Err(Error::model(format!(
                "a program of {n} inputs and {out} results is not a law of {m} coordinates"
            )));
        }
        let used = program.uses();
        let any = |from: usize, to: usize| (from..to).any(|k| used.get(k) == Some(&true));
        let (uses_time, uses_rate) = (any(0, 1), any(1 + m, 1 + 2 * m));
        Ok(FunctionLaw { m, n_params, body: Arc::new(Body::Program(program)), held: None, uses_rate, uses_time })
    }

    /// `call(t, u, v)` returns the m forces, m x m slopes by u and m x m slopes by v.
    ///
    /// # Errors
    /// More than six coordinates.
    pub fn external(m: usize, call: impl Fn(f64, &[f64], &[f64]) -> Vec<f64> + Send + Sync + 'static) -> Result<Self> {
        few(m)?;
        let body = Body::External(External::new(call));
        Ok(FunctionLaw { m, n_params: 0, body: Arc::new(body), held: None, uses_rate: true, uses_time: true })
    }

    pub fn m(&self) -> usize {
        self.m
    }

    pub fn n_params(&self) -> usize {
        self.n_params
    }

    pub fn uses_rate(&self) -> bool {
        self.uses_rate
    }

    pub fn uses_time(&self) -> bool {
        self.uses_time
    }

    /// Exact derivatives of every order; an external law has those of order one alone.
    pub fn is_traced(&self) -> bool {
        matches!(*self.body, Body::Program(_))
    }

    /// The forces; `u` and `v` of m numbers, `p` of `n_params`.
    pub fn force<T: Real>(&self, t: f64, u: &[T], v: &[T], p: &[T]) -> [T; MOST] {
        let mut out = [T::from(0.0); MOST];
        match &*self.body {
            Body::Program(program) => {
                let m = self.m;
                let input = |k: usize| match k {
                    0 => T::from(t),
                    k if k <= m => u[k - 1],
                    k if k <= 2 * m => v[k - 1 - m],
                    k => p[k - 1 - 2 * m],
                };
                if let Some(held) = &self.held {
                    held.evaluate(input, &mut out);
                }
                // a root or a power may have no value beyond its kink
                if self.held.is_none() || out.iter().any(|f| !f.re().is_finite()) {
                    program.evaluate(input, &mut out);
                }
            }
            Body::External(external) => external.force(t, u, v, &mut out[..self.m]),
        }
        out
    }

    /// Signed distances from its kinks; one from outside knows none.
    pub fn distances(&self, t: f64, u: &[f64], v: &[f64], p: &[f64]) -> Vec<f64> {
        match &*self.body {
            Body::Program(program) => program.switches(&program.values(&[&[t], u, v, p].concat())),
            Body::External(_) => Vec::new(),
        }
    }

    /// Held on these sides of its kinks, beyond them as far as it has values there.
    pub fn held(&self, sides: &[Side]) -> FunctionLaw {
        let Body::Program(program) = &*self.body else { return self.clone() };
        let above: Vec<_> = sides.iter().map(|s| (*s != Side::Free).then_some(*s == Side::Above)).collect();
        FunctionLaw { held: Some(Arc::new(program.on_branches(&above))), ..self.clone() }
    }

    /// Forces and slopes; those by the rate only where `rates`.
    pub fn slopes<T: Real>(&self, t: f64, u: &[T], v: &[T], p: &[T], rates: bool) -> ForceSlopes<T> {
        let zero = [[T::from(0.0); MOST]; MOST];
        let mut made = ForceSlopes { force: [T::from(0.0); MOST], k: zero, c: zero };
        let lift = |a: &[T]| a.iter().map(|x| Dual::from_re(*x)).collect::<Vec<_>>();
        let (mut ud, mut vd, pd) = (lift(u), lift(v), lift(p));
        for j in 0..self.m {
            ud[j].eps = T::from(1.0);
            let along = self.force(t, &ud, &vd, &pd);
            ud[j].eps = T::from(0.0);
            for (i, f) in along.iter().take(self.m).enumerate() {
                (made.force[i], made.k[i][j]) = (f.re, f.eps);
            }
            if !(rates && self.uses_rate) {
                continue;
            }
            vd[j].eps = T::from(1.0);
            let along = self.force(t, &ud, &vd, &pd);
            vd[j].eps = T::from(0.0);
            for (i, f) in along.iter().take(self.m).enumerate() {
                made.c[i][j] = f.eps;
            }
        }
        made
    }
}

fn few(m: usize) -> Result<()> {
    if (1..=MOST).contains(&m) {
        return Ok(());
    }
    Err(Error::model(format!("a law acts on one to {MOST} coordinates, not on {m}; divide it into several")))
}

type Call = Box<dyn Fn(f64, &[f64], &[f64]) -> Vec<f64> + Send + Sync>;
type Known = (Vec<f64>, Arc<[f64]>);

/// Values and slopes from outside, at one point after the other.
pub struct External {
    call: Call,
    /// the slopes along several directions are asked for at one point
    last: Mutex<Option<Known>>,
}

impl std::fmt::Debug for External {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("External")
    }
}

impl External {
    /// `call(t, u, v)` returns the values and slopes of a law or a constraint.
    pub fn new(call: impl Fn(f64, &[f64], &[f64]) -> Vec<f64> + Send + Sync + 'static) -> Self {
        External { call: Box::new(call), last: Mutex::new(None) }
    }

    fn last(&self) -> MutexGuard<'_, Option<Known>> {
        self.last.lock().unwrap_or_else(PoisonError::into_inner)
    }

    pub fn answer(&self, t: f64, u: &[f64], v: &[f64]) -> Arc<[f64]> {
        let place: Vec<f64> = [t].iter().chain(u).chain(v).copied().collect();
        let known = self.last().as_ref().filter(|(at, _)| *at == place).map(|(_, answer)| answer.clone());
        known.unwrap_or_else(|| {
            // the lock is free meanwhile: the function may evaluate this model itself
            let answer: Arc<[f64]> = (self.call)(t, u, v).into();
            *self.last() = Some((place, answer.clone()));
            answer
        })
    }

    /// The plane that touches the function at the values of u and v.
    fn force<T: Real>(&self, t: f64, u: &[T], v: &[T], out: &mut [T]) {
        let m = out.len();
        let real = |a: &[T]| a.iter().map(|x| x.re()).collect::<Vec<_>>();
        let (u0, v0) = (real(u), real(v));
        let answer = self.answer(t, &u0, &v0);
        let entry = |k: usize| answer.get(k).copied().unwrap_or(f64::NAN);
        for (i, out) in out.iter_mut().enumerate() {
            *out = T::from(entry(i));
            for j in 0..m {
                *out += (u[j] - u0[j]) * entry(m + i * m + j) + (v[j] - v0[j]) * entry(m + m * m + i * m + j);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::expressions::{Node, Op};

    /// F = (p0 u0 u1 + t v1, u1^2 v0): slopes by hand, traced and from outside.
    #[test]
    fn slopes_are_those_of_the_function() {
        // 0 t, 1 u0, 2 u1, 3 v0, 4 v1, 5 p0
        let mut nodes: Vec<Node> = (0..6).map(Node::Input).collect();
        let ops = [
            (Op::Multiply, [1, 2]),
            (Op::Multiply, [5, 6]),
            (Op::Multiply, [0, 4]),
            (Op::Add, [7, 8]),
            (Op::Multiply, [2, 2]),
            (Op::Multiply, [10, 3]),
        ];
        nodes.extend(ops.map(|(op, [a, b])| Node::Apply(op, [a, b, b])));
        let traced = FunctionLaw::traced(2, 1, Program::new(nodes, vec![9, 11]).unwrap()).unwrap();
        let (t, p0) = (0.7, 1.3);
        let outside = FunctionLaw::external(2, move |t, u, v| {
            let f = [p0 * u[0] * u[1] + t * v[1], u[1] * u[1] * v[0]];
            let k = [p0 * u[1], p0 * u[0], 0.0, 2.0 * u[1] * v[0]];
            let c = [0.0, t, u[1] * u[1], 0.0];
            [&f[..], &k, &c].concat()
        })
        .unwrap();
        assert!(traced.uses_rate() && traced.uses_time() && traced.is_traced() && !outside.is_traced());
        let (u, v) = ([0.37, -0.61], [0.23, 1.9]);
        let a = traced.slopes(t, &u, &v, &[p0], true);
        let b = outside.slopes(t, &u, &v, &[], true);
        for i in 0..2 {
            assert!((a.force[i] - b.force[i]).abs() < 1e-15);
            for j in 0..2 {
                assert!((a.k[i][j] - b.k[i][j]).abs() < 1e-15 && (a.c[i][j] - b.c[i][j]).abs() < 1e-15);
            }
        }
    }
}
