//! All directions on their way: what derivatives of a state do to the equations of a step.
//!
//! ```text
//! dr = K y + D dv + M da + J^T dlam + (by the numbers, the state held)        of every equation of a step
//! ```
//! K, D and M are those of the step and serve all directions at once; what numbers do to a state that is held is found in chunks of
//! directions (`chunk`). The metric of the projections is a derivative of the residual itself: along its two changes, of the rates
//! and of the accelerations, the same formula is differentiated once more (`Jet`).
use std::borrow::Cow;

use nalgebra::DMatrix;

use crate::error::Result;
use crate::integrate::ali3p::Linear;
use crate::integrate::{Equations, Instant, Motion};
use crate::linalg::kkt::Kkt;
use crate::multibody::placement::advance;
use crate::run::Counts;

use super::super::march::Here;
use super::super::quantity::Quantity;
use super::super::start::started;
use super::super::{Direction, Plan};
use super::chunk::{Chunk, Moving, WIDEST, chunk, touched};
use super::explicit::Held;
use super::slopes::{Slopes, crossed};
use crate::ad::lanes::{Jet, constants};

/// All directions on their way.
pub struct Along<'a> {
    pub eq: &'a Equations<'a, f64>,
    /// the same model, constant, along the changes of a projection
    jets: Option<Equations<'a, Jet>>,
    chunks: Vec<Box<dyn Chunk + 'a>>,
    /// the direction of each column
    order: Vec<usize>,
    pub now: Slopes,
}

/// A change of rates or of accelerations by a projection, with its multipliers.
pub type Change<'a> = (&'a [f64], &'a [f64]);

impl<'a> Along<'a> {
    pub fn new(
        eq: &'a Equations<'a, f64>,
        first: &Instant,
        plan: &Plan,
        directions: &[Direction],
        counts: &mut Counts,
    ) -> Result<Self> {
        let (order, chunks) = divided(eq, directions);
        let now = started(eq, first, plan, directions, &order, counts)?;
        Ok(Along { jets: jets(eq), chunks, eq, order, now })
    }

    /// The same directions, over equations of the same model that hold from here on.
    pub fn over(self, eq: &'a Equations<'a, f64>, directions: &[Direction]) -> Self {
        let (order, chunks) = divided(eq, directions);
        Along { jets: jets(eq), chunks, eq, order, now: self.now }
    }

    pub fn chunks(&self) -> impl Iterator<Item = &dyn Chunk> {
        self.chunks.iter().map(|c| c.as_ref())
    }

    pub fn zeros(&self, rows: usize) -> DMatrix<f64> {
        DMatrix::zeros(rows, self.order.len())
    }

    /// The residual at a state, its changes x, v, a given: K x + D v + M a and by the numbers.
    pub fn residual(
        &self,
        linear: &Linear,
        (m, a, lam): (&Motion<f64>, &[f64], &[f64]),
        [x, v, da]: [&DMatrix<f64>; 3],
        counts: &mut Counts,
    ) -> DMatrix<f64> {
        let mut out = linear.along(x, v, da);
        let held = Held::new(self.eq, m, a, lam);
        for chunk in &self.chunks {
            chunk.explicit(&held, &self.now.z, &mut out, counts);
        }
        out
    }

    /// Phi, and rates of velocity rows times a factor.
    pub fn closure(&self, jacobian: &DMatrix<f64>, at: Moving<'_>, factor: f64) -> DMatrix<f64> {
        let mut out = jacobian * at.x;
        let rates = self.eq.topology().has_velocity_rows();
        for chunk in self.chunks.iter().filter(|c| rates || c.touches_rows()) {
            chunk.closure(at, factor, &mut out);
        }
        out
    }

    /// W d + J^T y for both changes of a projection, W = M + cv D + cx K: by the state and the numbers.
    pub fn metrics(
        &self,
        (m, a): (&Motion<f64>, &[f64]),
        changes: [Change<'_>; 2],
        (cv, cx): (f64, f64),
        [x, v, da]: [&DMatrix<f64>; 3],
        counts: &mut Counts,
    ) -> [DMatrix<f64>; 2] {
        let mut out = [self.zeros(self.eq.n()), self.zeros(self.eq.n())];
        let Some(eq) = &self.jets else { return out };
        let topology = self.eq.topology();
        let (motion, a, lam) = bent(eq, m, a, changes, (cv, cx));
        let t = eq.tangent(&motion, &a, &lam, counts);
        for (k, out) in out.iter_mut().enumerate() {
            let part = |t: &DMatrix<Jet>| t.map(|j| j.eps[k]);
            out.gemm(1.0, &part(&t.stiffness), x, 1.0);
            out.gemm(1.0, &part(&t.mass), da, 1.0);
            for d in [&t.damping, &t.gyroscopic].into_iter().flatten() {
                out.gemm(1.0, &part(d), v, 1.0);
            }
            // the change carries the increments x along
            let theta: Vec<f64> = changes[k].0.iter().map(|d| d * cx).collect();
            out.gemm(1.0, &t.stiffness.map(|j| j.re), &crossed(topology, &theta, x), 1.0);
        }
        let held = Held::new(eq, &motion, &a, &lam);
        for chunk in &self.chunks {
            chunk.explicit_jets(&held, &self.now.z, &mut out, counts);
        }
        out
    }

    /// Changes of v and a that projections make of those of v* and a*, at the end of a step; `m`: with v1.
    pub fn projected(
        &self,
        by: &Kkt,
        (m, a): (&Motion<f64>, &[f64]),
        metrics: &[DMatrix<f64>; 2],
        x: &DMatrix<f64>,
        (v, da): (&mut DMatrix<f64>, Option<&mut DMatrix<f64>>),
    ) -> Result<()> {
        let z = &self.now.z;
        let mut g = self.zeros(self.eq.n_rows());
        for chunk in &self.chunks {
            chunk.row_rates(Moving { motion: m, x, v, z }, &mut g);
        }
        *v += by.solve(&-&metrics[0], &-g)?.0;
        let Some(da) = da else { return Ok(()) };
        let mut g = self.zeros(self.eq.n_rows());
        for chunk in &self.chunks {
            chunk.row_accelerations(Moving { motion: m, x, v, z }, (a, da), true, &mut g);
        }
        *da += by.solve(&-&metrics[1], &-g)?.0;
        Ok(())
    }

    /// Accelerations and multipliers of an instant, its motion known with derivatives.
    pub fn accelerate(&mut self, m: &Motion<f64>, there: &Instant, by: &Kkt, counts: &mut Counts) -> Result<()> {
        let eq = self.eq;
        let (a, lam) = (&there.acceleration, &there.lam);
        let linear = eq.tangents_of(m, a, lam, counts);
        let none = self.zeros(eq.n());
        let (x, v, z) = (&self.now.x, &self.now.v, &self.now.z);
        let f = -self.residual(&linear, (m, a, lam), [x, v, &none], counts);
        let mut g = self.zeros(eq.n_rows());
        for chunk in self.chunks.iter().filter(|_| eq.n_rows() > 0) {
            chunk.row_accelerations(Moving { motion: m, x, v, z }, (a, &none), false, &mut g);
        }
        (self.now.a, self.now.lam) = by.solve(&f, &-g)?;
        Ok(())
    }

    /// States of laws as a step of this length solves for them.
    pub fn open<'h>(&mut self, from: &'h Here, h: f64) -> Cow<'h, Here> {
        let opened = from.opened(self.eq, h);
        if let Cow::Owned(_) = opened {
            let mut out = self.zeros(from.instant.motion.memory.len());
            let (x, v, z) = (&self.now.x, &self.now.v, &self.now.z);
            for chunk in &self.chunks {
                chunk.open(Moving { motion: &from.instant.motion, x, v, z }, h, &mut out);
            }
            self.now.z = out;
        }
        opened
    }

    /// Memories of laws at the end of a step.
    pub fn remember(&mut self, from: &Motion<f64>, end: &Motion<f64>, counts: &mut Counts) {
        if self.eq.topology().n_memory == 0 {
            return;
        }
        let motion = Motion { memory: from.memory.clone(), ..end.clone() };
        let (x, v, z) = (&self.now.x, &self.now.v, &self.now.z);
        let at = Moving { motion: &motion, x, v, z };
        let mut out = self.zeros(from.memory.len());
        for chunk in &self.chunks {
            chunk.remember(at, &mut out, counts);
        }
        self.now.z = out;
    }

    /// Derivatives of all wanted numbers (n, n_p), flat.
    pub fn read(&self, now: &Instant, wanted: &[Quantity], out: &mut [f64]) -> Result<()> {
        let n_p = self.order.len();
        let at = (&now.motion, now.acceleration.as_slice(), now.lam.as_slice());
        for chunk in &self.chunks {
            chunk.read(at, &self.now, wanted, &mut |i, column, d| {
                out[i * n_p + self.order[column]] = d;
            })?;
        }
        Ok(())
    }
}

/// The direction of each column, and all of them in chunks that are alike.
fn divided<'a>(eq: &Equations<'a, f64>, directions: &[Direction]) -> (Vec<usize>, Vec<Box<dyn Chunk + 'a>>) {
    let (system, effects) = (eq.system, eq.effects);
    let kind: Vec<(bool, bool)> =
        directions.iter().map(|d| touched(system, effects, d)).map(|t| (!t.whole, !t.rows)).collect();
    let mut order: Vec<usize> = (0..directions.len()).collect();
    order.sort_by_key(|p| kind[*p]);
    let (mut chunks, mut first) = (Vec::new(), 0);
    for alike in order.chunk_by(|a, b| kind[*a] == kind[*b]) {
        for part in alike.chunks(WIDEST) {
            let part: Vec<&Direction> = part.iter().map(|p| &directions[*p]).collect();
            chunks.push(chunk(system, effects, &part, first, eq.n_rows() > 0));
            first += part.len();
        }
    }
    (order, chunks)
}

/// The equations along the changes of a projection, where there is one.
fn jets<'a>(eq: &Equations<'a, f64>) -> Option<Equations<'a, Jet>> {
    let constant = || {
        let geometry = eq.geometry.map(Jet::constant);
        Equations::with_geometry(eq.system, constants(&eq.x), geometry, eq.effects)
    };
    (eq.n_rows() > 0).then(constant)
}

/// A state along both changes (cx d, cv d, d, y) of a projection; multipliers are those of the changes alone.
fn bent(
    eq: &Equations<'_, Jet>,
    m: &Motion<f64>,
    a: &[f64],
    changes: [Change<'_>; 2],
    (cv, cx): (f64, f64),
) -> (Motion<Jet>, Vec<Jet>, Vec<Jet>) {
    let along = |re: &[f64], f: f64| -> Vec<Jet> {
        (re.iter().enumerate()).map(|(i, re)| Jet { re: *re, eps: changes.map(|(d, _)| d[i] * f) }).collect()
    };
    let mut q: Vec<Jet> = constants(&m.q);
    advance(eq.topology(), &mut q, &along(&vec![0.0; a.len()], cx));
    let lam = (0..changes[0].1.len()).map(|i| Jet { re: 0.0, eps: changes.map(|(_, y)| y[i]) });
    let motion = Motion { t: m.t, q, rate: along(&m.rate, cv), memory: constants(&m.memory) };
    (motion, along(a, 1.0), lam.collect())
}
