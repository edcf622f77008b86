//! Transfer functions of large sparse systems: one ordering, then one complex factorisation per frequency, whose solutions are corrected
//! by residuals in twice the precision until rounding is all that is left.
use faer::dyn_stack::{MemBuffer, MemStack};
use faer::sparse::SparseColMatRef;
use faer::sparse::linalg::lu::{LuRef, NumericLu, SymbolicLu, factorize_symbolic_lu};
use faer::{Conj, Mat, MatRef, Par, c64};

use super::ports::{Ports, complex, i_omega};
use crate::error::{Error, Result};
use crate::linalg::double_double::Dd;
use crate::linalg::sparse::Csc;
use crate::run::{Cancel, Counts};

/// Corrections of a solution at most.
const CORRECTIONS: usize = 8;

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
    /// largest relative correction that another step of refinement would make
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

    /// Z^-1 F, refined, and what another step would change; None where Z is singular.
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
        let (mut contraction, mut error) = (None, f64::INFINITY);
        for _ in 0..CORRECTIONS {
            let mut correction = self.residual(w, x.as_ref(), f);
            apply(&mut correction);
            let ratio = correction.norm_l2() / x.norm_l2().max(f64::MIN_POSITIVE);
            let first = *contraction.get_or_insert(ratio);
            if !ratio.is_finite() || first > 0.1 {
                return Ok(None);
            }
            x += correction;
            // each correction leaves of the error the part that the first one was of the solution
            error = first * ratio;
            if error <= f64::EPSILON {
                break;
            }
        }
        Ok(Some((x, error)))
    }

    /// f - Z(i w) x in twice the precision.
    fn residual(&self, w: f64, x: MatRef<'_, c64>, f: MatRef<'_, c64>) -> Mat<c64> {
        let w2 = Dd::product(w, w);
        let mut r = f.to_owned();
        for c in 0..x.ncols() {
            let mut parts = vec![[Dd::new(0.0); 6]; f.nrows()];
            for (i, j, at) in self.pattern.entries().enumerate().map(|(at, (i, j, _))| (i, j, at)) {
                let (x, to) = (x[(j, c)], &mut parts[i]);
                let values = [self.s[at], self.m[at], self.d.get(at).copied().unwrap_or(0.0)];
                for (pair, v) in to.chunks_exact_mut(2).zip(values) {
                    pair[0].add_product(v, x.re);
                    pair[1].add_product(v, x.im);
                }
            }
            for (i, sums) in parts.into_iter().enumerate() {
                let [s_re, s_im, m_re, m_im, d_re, d_im] = sums.map(Dd::normalised);
                let damped = |part: Dd| Dd::new(w).times(part);
                let re = Dd::new(f[(i, c)].re).minus(s_re).plus(w2.times(m_re)).plus(damped(d_im));
                let im = Dd::new(f[(i, c)].im).minus(s_im).plus(w2.times(m_im)).minus(damped(d_re));
                r[(i, c)] = c64::new(re.value(), im.value());
            }
        }
        r
    }
}
