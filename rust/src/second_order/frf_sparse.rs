//! Transfer functions of large sparse systems: one ordering, then one complex factorisation per frequency.
use faer::dyn_stack::{MemBuffer, MemStack};
use faer::sparse::SparseColMatRef;
use faer::sparse::linalg::lu::{LuRef, NumericLu, SymbolicLu, factorize_symbolic_lu};
use faer::{Conj, Mat, MatRef, Par, c64};

use super::ports::{Ports, complex, i_omega};
use crate::error::{Error, Result};
use crate::linalg::sparse::Csc;
use crate::run::{Cancel, Counts};

pub struct SparseSystem {
    /// the union of all patterns, its values do not matter
    pattern: Csc,
    m: Vec<f64>,
    d: Vec<f64>,
    s: Vec<f64>,
    symbolic: SymbolicLu<u32>,
}

pub struct SparseValues {
    /// (n_out, n_in, n_freq), last index fastest
    pub h: Vec<c64>,
    /// largest relative correction that one step of refinement made
    pub error: f64,
    pub singular: Vec<usize>,
    pub counts: Counts,
}

impl SparseSystem {
    pub fn new(m: &Csc, d: Option<&Csc>, s: &Csc) -> Result<Self> {
        let n = m.rows;
        for (name, a) in [("D", d), ("S", Some(s))] {
            if let Some(a) = a
                && (a.rows != n || a.cols != n)
            {
                return Err(Error::model(format!("{name} is {} x {}, M has {n} rows", a.rows, a.cols)));
            }
        }
        if n == 0 {
            return Err(Error::model("the system has no coordinates; it needs at least one"));
        }
        let mut pattern = m.combined(1.0, 1.0, s);
        if let Some(d) = d {
            pattern = pattern.combined(1.0, 1.0, d);
        }
        let symbolic = factorize_symbolic_lu(pattern.pattern(), Default::default())
            .map_err(|e| Error::singular(format!("ordering of the sparse system failed: {e:?}")))?;
        Ok(SparseSystem {
            m: m.spread_over(&pattern),
            d: d.map_or_else(Vec::new, |d| d.spread_over(&pattern)),
            s: s.spread_over(&pattern),
            pattern,
            symbolic,
        })
    }

    pub fn evaluate(&self, ports: &Ports, omega: &[f64], cancel: &Cancel) -> Result<SparseValues> {
        ports.check(self.pattern.rows)?;
        if omega.iter().any(|w| !w.is_finite()) {
            return Err(Error::model("omega contains NaN or infinite values"));
        }
        let (n_out, n_in, n_freq) = (ports.n_out(), ports.n_in(), omega.len());
        let (l, f) = (complex(ports.l.as_ref()), complex(ports.f.as_ref()));
        let mut h = vec![c64::new(f64::NAN, f64::NAN); n_out * n_in * n_freq];
        let mut counts = Counts::default();
        let (mut error, mut singular) = (f64::EPSILON, Vec::new());
        for (k, &w) in omega.iter().enumerate() {
            cancel.check()?;
            counts.add("factorisations", 1);
            let Some((x, correction)) = self.solve(w, f.as_ref())? else {
                singular.push(k);
                continue;
            };
            error = error.max(correction);
            let value = &l * x;
            for i in 0..n_out {
                for j in 0..n_in {
                    let feed = ports.d0.as_ref().map_or(0.0, |d| d[(i, j)]);
                    h[(i * n_in + j) * n_freq + k] = value[(i, j)] * i_omega(w, ports.order_in[j] + ports.order_out)
                        + i_omega(w, ports.order_out) * feed;
                }
            }
        }
        Ok(SparseValues { h, error, singular, counts })
    }

    /// Z^-1 F after one step of refinement, and how much that step changed; None where Z is singular.
    fn solve(&self, w: f64, f: MatRef<'_, c64>) -> Result<Option<(Mat<c64>, f64)>> {
        let value: Vec<c64> = (0..self.s.len())
            .map(|k| c64::new(self.s[k] - w * w * self.m[k], self.d.get(k).map_or(0.0, |d| w * d)))
            .collect();
        let z = SparseColMatRef::new(self.pattern.pattern(), &value);
        let mut numeric = NumericLu::new();
        let scratch = self.symbolic.factorize_numeric_lu_scratch::<c64>(Par::Seq, Default::default());
        let mut memory =
            MemBuffer::try_new(scratch).map_err(|e| Error::singular(format!("no memory for the factors: {e:?}")))?;
        let done = self.symbolic.factorize_numeric_lu(
            &mut numeric,
            z,
            Par::Seq,
            MemStack::new(&mut memory),
            Default::default(),
        );
        if done.is_err() {
            return Ok(None);
        }
        let mut memory = MemBuffer::new(self.symbolic.solve_in_place_scratch::<c64>(f.ncols(), Par::Seq));
        let mut apply = |x: &mut Mat<c64>| {
            LuRef::<'_, u32, c64>::new_unchecked(&self.symbolic, &numeric).solve_in_place_with_conj(
                Conj::No,
                x.as_mut(),
                Par::Seq,
                MemStack::new(&mut memory),
            );
        };
        let mut x = f.to_owned();
        apply(&mut x);
        let mut correction = self.residual(&value, x.as_ref(), f);
        apply(&mut correction);
        let ratio = correction.norm_l2() / x.norm_l2().max(f64::MIN_POSITIVE);
        if !ratio.is_finite() || ratio > 0.1 {
            return Ok(None);
        }
        x += correction;
        Ok(Some((x, ratio)))
    }

    fn residual(&self, value: &[c64], x: MatRef<'_, c64>, f: MatRef<'_, c64>) -> Mat<c64> {
        let mut r = f.to_owned();
        for c in 0..x.ncols() {
            for ((i, j, _), v) in self.pattern.entries().zip(value) {
                r[(i, c)] -= v * x[(j, c)];
            }
        }
        r
    }
}
