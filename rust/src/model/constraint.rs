//! A constraint given as a function of time and of relative motions u_k of joints.
//!
//! ```text
//! positions    Phi_i(t, u; p) = 0                              c_ik = dPhi_i/du_k,  s_i = dPhi_i/dt
//! velocities   sum_k D_ik(t, u; p) u_k' + d_i(t, u; p) = 0     c = D,  s = d
//! of both      c u' + s = 0,    c u" + c' u' + s' = 0
//! ```
//! Traced, it is a program with the inputs t, u_0 ..., p_0 ...; otherwise Python gives its values and slopes.
use std::sync::Arc;

use num_dual::Dual;

use crate::error::{Error, Result};
use crate::expressions::Program;
use crate::force::External;
use crate::spatial::Real;

/// A constraint of the Tables: the joint coordinates that it reads, by joint and place among the free ones.
#[derive(Debug, Clone)]
pub struct ConstraintSpec {
    pub name: String,
    pub motions: Vec<(usize, usize)>,
    pub function: ConstraintFunction,
    pub x: usize,
}

/// The rows of one constraint over `m` motions.
#[derive(Debug, Clone)]
pub struct ConstraintFunction {
    m: usize,
    n_rows: usize,
    n_params: usize,
    of_velocities: bool,
    body: Arc<Body>,
    explicit: bool,
}

#[derive(Debug)]
enum Body {
    Program(Program),
    External(External),
}

/// Value, slopes c by the motions and the explicit rate s of one row; the value of a velocity row is zero.
#[derive(Debug, Clone)]
pub struct RowSlopes<T> {
    pub value: T,
    pub c: Vec<T>,
    pub s: T,
}

impl ConstraintFunction {
    /// The results of the program are Phi_i, or of velocity rows D_i1 ... D_im, d_i for each row.
    ///
    /// # Errors
    /// A program that does not fit.
    pub fn traced(m: usize, n_params: usize, of_velocities: bool, program: Program) -> Result<Self> {
        let each = if of_velocities { m + 1 } else { 1 };
        let out = program.n_outputs();
        if m == 0 || out == 0 || !out.is_multiple_of(each) || program.n_inputs() > 1 + m + n_params {
            let n = program.n_inputs();
            return Err(Error::model(format!(
                "a program of {n} inputs and {out} results is not a constraint of {m} motions"
            )));
        }
        let explicit = if of_velocities {
            (0..out / each).any(|i| program.constant(i * each + m) != Some(0.0))
        } else {
            program.uses().first() == Some(&true)
        };
        let body = Arc::new(Body::Program(program));
        Ok(ConstraintFunction { m, n_rows: out / each, n_params, of_velocities, body, explicit })
    }

    /// `call(t, u)` returns for each result its value, its 1 + m slopes by (t, u) and, of position rows, the (1 + m)^2 second ones.
    ///
    /// # Errors
    /// No motion or no row.
    pub fn external(m: usize, n_rows: usize, of_velocities: bool, call: External) -> Result<Self> {
        if m == 0 || n_rows == 0 {
            return Err(Error::model("a constraint needs a motion and a row"));
        }
        let body = Arc::new(Body::External(call));
        Ok(ConstraintFunction { m, n_rows, n_params: 0, of_velocities, body, explicit: true })
    }

    pub fn m(&self) -> usize {
        self.m
    }

    pub fn n_rows(&self) -> usize {
        self.n_rows
    }

    pub fn n_params(&self) -> usize {
        self.n_params
    }

    pub fn of_velocities(&self) -> bool {
        self.of_velocities
    }

    /// May the explicit rates s differ from zero?
    pub fn has_explicit_rates(&self) -> bool {
        self.explicit
    }

    /// Exact derivatives of every order; a function from outside has the first two.
    pub fn is_traced(&self) -> bool {
        matches!(*self.body, Body::Program(_))
    }

    fn outputs<T: Real>(&self, t: T, u: &[T], p: &[T]) -> Vec<T> {
        let n = self.n_rows * if self.of_velocities { self.m + 1 } else { 1 };
        let mut out = vec![T::zero(); n];
        match &*self.body {
            Body::Program(program) => {
                let input = |k: usize| match k {
                    0 => t,
                    k if k <= self.m => u[k - 1],
                    k => p[k - 1 - self.m],
                };
                program.evaluate(input, &mut out);
            }
            Body::External(external) => self.touching(external, t, u, &mut out),
        }
        out
    }

    /// The polynomials in (t, u) that have the values and slopes of a function from outside.
    fn touching<T: Real>(&self, external: &External, t: T, u: &[T], out: &mut [T]) {
        let real: Vec<f64> = u.iter().map(|u| u.re()).collect();
        let answer = external.answer(t.re(), &real, &[]);
        let n = 1 + self.m;
        let size = 1 + n + if self.of_velocities { 0 } else { n * n };
        let entry = |k: usize| answer.get(k).copied().unwrap_or(f64::NAN);
        let moved: Vec<T> = std::iter::once(t).chain(u.iter().copied()).map(|v| v - v.re()).collect();
        for (i, out) in out.iter_mut().enumerate() {
            let at = i * size;
            *out = T::from(entry(at));
            for (j, a) in moved.iter().enumerate() {
                *out += *a * entry(at + 1 + j);
                if self.of_velocities {
                    continue;
                }
                for (k, b) in moved.iter().enumerate() {
                    *out += *a * *b * (0.5 * entry(at + 1 + n + j * n + k));
                }
            }
        }
    }

    /// The rows at motions `u` of m numbers, with parameters `p`.
    pub fn slopes<T: Real>(&self, t: T, u: &[T], p: &[T]) -> Vec<RowSlopes<T>> {
        if self.of_velocities {
            let out = self.outputs(t, u, p);
            let row = |r: &[T]| RowSlopes { value: T::zero(), c: r[..self.m].to_vec(), s: r[self.m] };
            return out.chunks(self.m + 1).map(row).collect();
        }
        let lift = |a: &[T]| a.iter().map(|x| Dual::from_re(*x)).collect::<Vec<_>>();
        let (mut ud, pd) = (lift(u), lift(p));
        let mut rows = vec![RowSlopes { value: T::zero(), c: vec![T::zero(); self.m], s: T::zero() }; self.n_rows];
        for k in 0..=self.m {
            let td = Dual::new(t, if k == self.m { T::one() } else { T::zero() });
            if let Some(u) = ud.get_mut(k) {
                u.eps = T::one();
            }
            for (row, along) in rows.iter_mut().zip(self.outputs(td, &ud, &pd)) {
                row.value = along.re;
                *row.c.get_mut(k).unwrap_or(&mut row.s) = along.eps;
            }
            if let Some(u) = ud.get_mut(k) {
                u.eps = T::zero();
            }
        }
        rows
    }

    /// The rows over dual numbers: their derivative along (t, u) moving at the rates (dt, du).
    pub fn along<T: Real>(&self, (t, dt): (T, T), u: &[T], du: &[T], p: &[T]) -> Vec<RowSlopes<Dual<T>>> {
        let u: Vec<_> = u.iter().zip(du).map(|(u, d)| Dual::new(*u, *d)).collect();
        let p: Vec<_> = p.iter().map(|p| Dual::from_re(*p)).collect();
        self.slopes(Dual::new(t, dt), &u, &p)
    }

    /// What one natural unit of all motions changes in each row, as drawn (u = 0, t = 0): slopes and half of their own changes, so
    /// that a row without a slope there still has a size. One where that is zero or not a number.
    pub fn sizes(&self, p: &[f64], units: &[f64]) -> Vec<f64> {
        let at = vec![0.0; self.m];
        let mut sizes = vec![0.0; self.n_rows];
        for (l, unit) in units.iter().enumerate() {
            let mut du = at.clone();
            du[l] = 1.0;
            for (size, row) in sizes.iter_mut().zip(self.along((0.0, 0.0), &at, &du, p)) {
                let bent: f64 = row.c.iter().zip(units).map(|(c, unit)| c.eps.abs() * unit).sum();
                *size += unit * (row.c[l].re.abs() + 0.5 * bent);
            }
        }
        sizes.into_iter().map(|s| if s.is_finite() && s > 0.0 { s } else { 1.0 }).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::expressions::{Node, Op};

    /// Phi = p0 u0 u1 + t u1 traced and from outside: values, slopes and their changes by hand.
    #[test]
    fn slopes_are_those_of_the_function() {
        // 0 t, 1 u0, 2 u1, 3 p0
        let mut nodes: Vec<Node> = (0..4).map(Node::Input).collect();
        let ops = [(Op::Multiply, [1, 2]), (Op::Multiply, [3, 4]), (Op::Multiply, [0, 2]), (Op::Add, [5, 6])];
        nodes.extend(ops.map(|(op, [a, b])| Node::Apply(op, [a, b, b])));
        let traced = ConstraintFunction::traced(2, 1, false, Program::new(nodes, vec![7]).unwrap()).unwrap();
        let p0 = 1.3;
        let call = External::new(move |t, u, _| {
            let value = vec![p0 * u[0] * u[1] + t * u[1]];
            let slopes = vec![u[1], p0 * u[1], p0 * u[0] + t];
            let second = vec![0.0, 0.0, 1.0, 0.0, 0.0, p0, 1.0, p0, 0.0];
            [value, slopes, second].concat()
        });
        let outside = ConstraintFunction::external(2, 1, false, call).unwrap();
        let (t, u, du) = (0.7, [0.37, -0.61], [0.23, 1.9]);
        let expected = [p0 * u[1], p0 * u[0] + t];
        let change = [p0 * du[1], p0 * du[0] + 1.0];
        for (f, p) in [(&traced, &[p0][..]), (&outside, &[])] {
            let row = &f.along((t, 1.0), &u, &du, p)[0];
            for k in 0..2 {
                assert!((row.c[k].re - expected[k]).abs() < 1e-15 && (row.c[k].eps - change[k]).abs() < 1e-15);
            }
            assert!((row.s.re - u[1]).abs() < 1e-15 && (row.s.eps - du[1]).abs() < 1e-15);
            assert!(f.has_explicit_rates());
        }
        assert!((traced.sizes(&[p0], &[2.0, 3.0])[0] - p0 * 6.0).abs() < 1e-14);
    }
}
