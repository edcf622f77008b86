//! Explicit motion in tree coordinates: the classical Runge-Kutta method of order four on joint increments.
//!
//! ```text
//! [M J^T] [y"]     [-h(y, y') ]        theta' = J_l^-1(theta) omega for rotation vectors, y' elsewhere
//! [J  0 ] [lam]  = [-J' y' - Phi_tt]
//! ```
//! Rows of both levels enter the accelerations alike. After each step position rows are closed by themselves, then all rates
//! projected, both with the smallest change in the norm of M. Generic over the
//! number type: with dual numbers the whole discrete motion is differentiated along a direction of the numbers. Memories of laws
//! are frozen within a step.
use nalgebra::{DMatrix, DVector};
use num_dual::Dual;

use crate::error::{Error, Result};
use crate::linalg::rows::Level as Asked;
use crate::model::geometry::Geometry;
use crate::run::{Cancel, Counts};
use crate::spatial::{Real, V3};
use crate::system::System;
use crate::system::assemble::{Effects, Scene};
use crate::system::closure::scene_at_rest;
use crate::system::connector::motion_of;
use crate::system::placement::{Placement, advance, place};
use crate::system::rows::explicit_rates;
use crate::system::topology::Level;

pub use super::Motion;
use super::rotations::increment_rates;

/// The fixed numbers of a run.
pub struct Run<'a, T: Real> {
    pub system: &'a System,
    pub geometry: Geometry<T>,
    pub x: Vec<T>,
    /// cut rows that are kept, position rows first: redundant ones are dropped once, at the start
    rows: Vec<usize>,
    /// how many of them are position rows
    n_position: usize,
}

impl<'a, T: Real> Run<'a, T> {
    pub fn new(system: &'a System, x: Vec<T>, start: &Motion<T>) -> Self {
        let geometry = Geometry::derive(&system.topology.tables, &x);
        let q: Vec<f64> = start.q.iter().map(|v| v.re()).collect();
        let placement = place(&system.topology, &system.geometry, &q, None);
        let jacobian = scene_at_rest(system, &placement, Effects::ALL).constraints().1;
        let level = |i: &usize| system.topology.rows[*i].level == Level::Velocity;
        let decided = system.decision(Effects::ALL);
        let mut rows = decided.map_or_else(|_| Vec::new(), |d| d.rows.select_dense(&jacobian, Asked::All));
        rows.sort_by_key(level);
        let n_position = rows.iter().take_while(|i| system.topology.rows[**i].level == Level::Position).count();
        Run { system, geometry, x, rows, n_position }
    }

    fn scene<'s>(&'s self, motion: &'s Motion<T>, placement: &'s Placement<T>) -> Scene<'s, T> {
        Scene {
            topology: &self.system.topology,
            geometry: &self.geometry,
            x: &self.x,
            memory: &motion.memory,
            placement,
            rate: Some(&motion.rate),
            acceleration: None,
            t: motion.t,
            effects: Effects::ALL,
        }
    }

    fn place(&self, motion: &Motion<T>) -> Placement<T> {
        place(&self.system.topology, &self.geometry, &motion.q, Some(&motion.rate))
    }

    fn kept(&self, jacobian: &DMatrix<T>) -> DMatrix<T> {
        DMatrix::from_fn(self.rows.len(), jacobian.ncols(), |i, j| jacobian[(self.rows[i], j)])
    }

    /// J' y' + Phi_tt of the kept rows: the Jacobian carried along the motion by a dual number in time.
    fn turning(&self, motion: &Motion<T>) -> DVector<T> {
        let still = |v: &T| Dual::from_re(*v);
        let x: Vec<Dual<T>> = self.x.iter().map(still).collect();
        let geometry = Geometry::derive(&self.system.topology.tables, &x);
        let mut q: Vec<Dual<T>> = motion.q.iter().map(still).collect();
        let dy: Vec<_> = motion.rate.iter().map(|r| Dual::new(T::zero(), *r)).collect();
        advance(&self.system.topology, &mut q, &dy);
        let placement = place(&self.system.topology, &geometry, &q, None);
        let scene = Scene {
            topology: &self.system.topology,
            geometry: &geometry,
            x: &x,
            memory: &[],
            placement: &placement,
            rate: None,
            acceleration: None,
            t: motion.t,
            effects: Effects::ALL,
        };
        let rate = DVector::from_column_slice(&motion.rate);
        let prescribed = self.prescribed(motion.t).1;
        self.kept_dual(&scene.constraints().1) * rate + prescribed
    }

    /// Phi_t and Phi_tt of the kept rows.
    fn prescribed(&self, t: f64) -> (DVector<T>, DVector<T>) {
        let topology = &self.system.topology;
        let (first, second) = explicit_rates(topology, &self.geometry, Effects::ALL, t);
        let kept = |v: &DVector<T>| DVector::from_fn(self.rows.len(), |i, _| v[self.rows[i]]);
        (kept(&first), kept(&second))
    }

    fn kept_dual(&self, jacobian: &DMatrix<Dual<T>>) -> DMatrix<T> {
        DMatrix::from_fn(self.rows.len(), jacobian.ncols(), |i, j| jacobian[(self.rows[i], j)].eps)
    }

    fn accelerations(&self, motion: &Motion<T>, counts: &mut Counts) -> Result<Vec<T>> {
        counts.add("force evaluations", 1);
        let placement = self.place(motion);
        let scene = self.scene(motion, &placement);
        let h = scene.residual(None);
        let mass = scene.mass();
        if self.rows.is_empty() {
            return Ok(solve(&mass, &-h)?.as_slice().to_vec());
        }
        counts.add("multiplier solutions", 1);
        let jacobian = self.kept(&scene.constraints().1);
        let turning = self.turning(motion);
        let both = solve(&saddle(&mass, &jacobian), &stacked(&-h, &-turning))?;
        Ok(both.as_slice()[..mass.nrows()].to_vec())
    }

    /// Close position rows and make rates satisfy all rows, with the smallest change in kinetic energy.
    fn project(&self, motion: &mut Motion<T>) -> Result<()> {
        if self.rows.is_empty() {
            return Ok(());
        }
        let topology = &self.system.topology;
        if self.n_position > 0 {
            for _ in 0..3 {
                let placement = self.place(motion);
                let scene = self.scene(motion, &placement);
                let (phi, jacobian) = scene.constraints();
                let closing = self.kept(&jacobian).rows(0, self.n_position).into_owned();
                let miss = DVector::from_fn(self.n_position, |i, _| -phi[self.rows[i]]);
                let step = correction(&scene, &closing, &miss)?;
                advance(topology, &mut motion.q, &step);
            }
        }
        let placement = self.place(motion);
        let scene = self.scene(motion, &placement);
        let jacobian = self.kept(&scene.constraints().1);
        let rate = DVector::from_column_slice(&motion.rate);
        let miss = -(&jacobian * rate + self.prescribed(motion.t).0);
        let step = correction(&scene, &jacobian, &miss)?;
        for (rate, step) in motion.rate.iter_mut().zip(step) {
            *rate += step;
        }
        Ok(())
    }

    fn remember(&self, motion: &mut Motion<T>, counts: &mut Counts) {
        if motion.memory.is_empty() {
            return;
        }
        counts.add("memory updates", 1);
        let placement = self.place(motion);
        for connector in self.system.topology.connectors.iter().filter(|c| !c.laws.is_empty()) {
            let moved = motion_of(&self.system.topology, &self.geometry, &placement, &self.x, connector);
            for law in &connector.laws {
                let (e, v) = moved[law.component];
                let p = &self.x[law.x..law.x + law.law.n_params()];
                law.law.eval(e, v, p, &mut motion.memory[law.memory..law.memory + law.law.n_memory()]);
            }
        }
    }

    /// One step of length h.
    pub fn step(&self, motion: &mut Motion<T>, h: f64, counts: &mut Counts) -> Result<()> {
        let n = motion.rate.len();
        let half = T::from(0.5 * h);
        let full = T::from(h);
        let mut slopes: Vec<(Vec<T>, Vec<T>)> = Vec::with_capacity(4);
        for fraction in [None, Some(half), Some(half), Some(full)] {
            let mut trial = motion.clone();
            let mut increment = vec![T::zero(); n];
            if let (Some(f), Some((dy, dv))) = (fraction, slopes.last()) {
                trial.t += f.re();
                for i in 0..n {
                    increment[i] = dy[i] * f;
                    trial.rate[i] += dv[i] * f;
                }
                advance(&self.system.topology, &mut trial.q, &increment);
            }
            let acceleration = self.accelerations(&trial, counts)?;
            slopes.push((increment_rates(&self.system.topology, &increment, &trial.rate), acceleration));
        }
        let weights = [h / 6.0, h / 3.0, h / 3.0, h / 6.0];
        let mut increment = vec![T::zero(); n];
        for ((dy, dv), w) in slopes.iter().zip(weights) {
            for i in 0..n {
                increment[i] += dy[i] * w;
                motion.rate[i] += dv[i] * w;
            }
        }
        advance(&self.system.topology, &mut motion.q, &increment);
        motion.t += h;
        self.project(motion)?;
        self.remember(motion, counts);
        counts.add("steps", 1);
        Ok(())
    }

    /// Positions of all bodies' origins, in the order of the model.
    pub fn positions(&self, motion: &Motion<T>) -> Vec<V3<T>> {
        let placement = self.place(motion);
        let mut out = vec![V3::zeros(); self.system.n_bodies()];
        for (node, pose) in self.system.topology.nodes.iter().zip(&placement.pose) {
            out[node.body] = pose.p - pose.r * self.geometry.bodies[node.body].com;
        }
        out
    }

    /// The motion after every step, the start included.
    pub fn integrate(
        &self,
        mut motion: Motion<T>,
        h: f64,
        n: usize,
        cancel: &Cancel,
        counts: &mut Counts,
    ) -> Result<Vec<Motion<T>>> {
        let rated = Effects::ALL.wanted().with_state_rates(&self.system.topology);
        if let Some(c) = rated.first() {
            let name = self.system.topology.owner_name(self.system.topology.connectors[*c].owner);
            return Err(Error::model(format!(
                "the law of '{name}' has a state with a rate, which these steps do not integrate; use simulate"
            )));
        }
        let mut history = vec![motion.clone()];
        for _ in 0..n {
            cancel.check()?;
            self.step(&mut motion, h, counts)?;
            history.push(motion.clone());
        }
        Ok(history)
    }
}

/// The smallest change of the increments, in the norm of M, that makes rows take the values `miss`.
fn correction<T: Real>(scene: &Scene<'_, T>, jacobian: &DMatrix<T>, miss: &DVector<T>) -> Result<Vec<T>> {
    let mass = scene.mass();
    let n = mass.nrows();
    let both = solve(&saddle(&mass, jacobian), &stacked(&DVector::zeros(n), miss))?;
    Ok(both.as_slice()[..n].to_vec())
}

fn saddle<T: Real>(mass: &DMatrix<T>, jacobian: &DMatrix<T>) -> DMatrix<T> {
    let (n, m) = (mass.nrows(), jacobian.nrows());
    DMatrix::from_fn(n + m, n + m, |i, j| match (i < n, j < n) {
        (true, true) => mass[(i, j)],
        (true, false) => jacobian[(j - n, i)],
        (false, true) => jacobian[(i - n, j)],
        (false, false) => T::zero(),
    })
}

fn stacked<T: Real>(a: &DVector<T>, b: &DVector<T>) -> DVector<T> {
    DVector::from_iterator(a.len() + b.len(), a.iter().chain(b.iter()).copied())
}

/// A linear system over any number type: the real inverse, corrected once for each order of derivative.
fn solve<T: Real>(a: &DMatrix<T>, b: &DVector<T>) -> Result<DVector<T>> {
    let inverse = a
        .map(|v| v.re())
        .try_inverse()
        .filter(|m| m.iter().all(|v| v.is_finite()))
        .ok_or_else(|| Error::singular("the equations of motion are singular here"))?
        .map(T::from);
    let mut x = &inverse * b;
    for _ in 0..T::NDERIV.max(1) {
        x += &inverse * (b - a * &x);
    }
    Ok(x)
}
