//! The equations of one implicit step of BDF, without unit and without their Jacobian: what `inverse_updates` solves.
//!
//! ```text
//! ggl:        theta' - T(theta) v + S J^T mu = 0    M v' + h + J^T lam = 0    Phi = 0    J v + Phi_t = 0
//! symmetric:  v = T^-1(theta) theta'                M v' + h + J^T lam = 0    Phi = 0
//! ```
//! theta are increments from the pose of a chart, T = J_l^-1 where three rotations act together, and y' is the derivative of
//! the polynomial through the new and the past values, y' = y/g + (past). With m the mean inertia of the bodies that are connected,
//! sigma_i = (m/M_ii)^1/2 and rho the scales of the rows the unknowns are theta/sigma, g v/sigma, g^2 lam/(m rho) and mu, the equations
//! those above times g/sigma, g^2 sigma/m, rho and g rho: no entry of the Jacobian grows as h falls, and that of the symmetric form is
//! [M + g C + g^2 K, J^T; J, 0] scaled from both sides alike.
use nalgebra::{DMatrix, DVector};

use crate::error::Result;
use crate::multibody::topology::Level;
use crate::run::Counts;
use crate::solve::Residual;

use super::super::{Equations, Motion};

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Form {
    /// Gear, Gupta and Leimkuhler's stabilised index 2: positions and velocities, two sets of multipliers.
    Ggl,
    /// Index 3 in positions and multipliers; velocities are projected at the end of the step.
    Symmetric,
}

/// Sizes that stay as they are from step to step, so that an inverse stays usable.
#[derive(Debug, Clone)]
pub struct Sizes {
    /// of increments
    pub sigma: Vec<f64>,
    /// mean generalised inertia of the island of each coordinate
    pub inertia: Vec<f64>,
    /// the same of each kept row
    pub row_inertia: Vec<f64>,
    /// of the kept rows
    pub rho: Vec<f64>,
    /// rows that are not redundant, position rows first
    pub kept: Vec<usize>,
    pub n_position: usize,
}

impl Sizes {
    pub fn new(eq: &Equations<'_, f64>, mass: &DMatrix<f64>, kept: Vec<usize>) -> Sizes {
        let n = eq.n();
        let scales = eq.scales();
        let topology = eq.topology();
        let mut islands = vec![(0.0, 0_usize); topology.n_islands()];
        for i in 0..n {
            let own = &mut islands[topology.island_of(i)];
            *own = (own.0 + mass[(i, i)] * scales[i].powi(2), own.1 + 1);
        }
        let mean = |island: usize| islands[island].0 / islands[island].1.max(1) as f64;
        let inertia: Vec<f64> = (0..n).map(|i| mean(topology.island_of(i))).collect();
        let row_inertia = |i: &usize| {
            let joint = &topology.tables.joints[topology.rows[*i].joint];
            topology.node(joint.a).or(topology.node(joint.b)).map_or(1.0, |node| mean(topology.island[node]))
        };
        let rows = eq.row_scales();
        let level = |i: &&usize| topology.rows[**i].level == Level::Position;
        Sizes {
            sigma: (0..n).map(|i| (inertia[i] / mass[(i, i)]).sqrt()).collect(),
            row_inertia: kept.iter().map(row_inertia).collect(),
            inertia,
            rho: kept.iter().map(|i| rows[*i]).collect(),
            n_position: kept.iter().filter(level).count(),
            kept,
        }
    }

    pub fn unknowns(&self, form: Form) -> usize {
        let n = self.sigma.len();
        match form {
            Form::Ggl => 2 * n + self.kept.len() + self.n_position,
            Form::Symmetric => n + self.kept.len(),
        }
    }
}

/// Values about which a step is solved.
#[derive(Debug, Clone)]
pub struct Guess {
    pub theta: Vec<f64>,
    pub rate: Vec<f64>,
    /// of the kept rows
    pub lam: Vec<f64>,
}

pub struct BdfStep<'a, 's> {
    pub eq: &'a Equations<'s, f64>,
    pub form: Form,
    pub sizes: &'a Sizes,
    /// the pose from which increments count, and what the laws remember
    pub base: &'a Motion<f64>,
    pub t: f64,
    pub g: f64,
    /// what past values add to theta' and v'
    pub theta_past: Vec<f64>,
    pub rate_past: Vec<f64>,
    /// z0 of the states of laws: z = z0 + g z'
    pub state_base: Vec<f64>,
    pub guess: Guess,
    /// by how much the step moves the increments, as was foreseen
    pub moved: Vec<f64>,
    /// what a fixed step is expected to err in its rates, in the units of the unknowns
    pub rate_error: f64,
    /// factors of the equations, of order one
    pub row_factor: Vec<f64>,
    pub counts: &'a mut Counts,
}

/// What unknowns mean.
pub struct Meaning {
    pub theta: Vec<f64>,
    pub motion: Motion<f64>,
    pub acceleration: Vec<f64>,
    pub lam: Vec<f64>,
    pub mu: Vec<f64>,
}

impl BdfStep<'_, '_> {
    pub fn meaning(&self, x: &[f64]) -> Meaning {
        let (s, n, m) = (self.sizes, self.eq.n(), self.sizes.kept.len());
        let theta: Vec<f64> = (0..n).map(|i| self.guess.theta[i] + s.sigma[i] * x[i]).collect();
        let mut motion = self.base.moved(self.eq.topology(), &theta);
        motion.t = self.t;
        self.eq.set_states(&mut motion, &self.state_base, self.g);
        let (rate, first) = match self.form {
            Form::Ggl => {
                let rate = |i| self.guess.rate[i] + s.sigma[i] * x[n + i] / self.g;
                ((0..n).map(rate).collect(), 2 * n)
            }
            Form::Symmetric => {
                let speed = self.slopes(&theta, &self.theta_past);
                (self.eq.rates_of_increments(&theta, &speed), n)
            }
        };
        motion.rate = rate;
        let unit = |r: usize| s.row_inertia[r] / (self.g * self.g);
        let lam = (0..m).map(|r| self.guess.lam[r] + x[first + r] * s.rho[r] * unit(r)).collect();
        Meaning {
            acceleration: self.slopes(&motion.rate, &self.rate_past),
            mu: x[first + m..].to_vec(),
            theta,
            motion,
            lam,
        }
    }

    fn slopes(&self, now: &[f64], past: &[f64]) -> Vec<f64> {
        now.iter().zip(past).map(|(y, p)| y / self.g + p).collect()
    }

    /// Multipliers of all rows, zero for redundant ones.
    pub fn all_rows(&self, lam: &[f64]) -> Vec<f64> {
        let mut all = vec![0.0; self.eq.n_rows()];
        for (i, l) in self.sizes.kept.iter().zip(lam) {
            all[*i] = *l;
        }
        all
    }

    /// Kept rows of Phi and J v + Phi_t, scaled, and J scaled.
    fn constraints(&self, m: &Motion<f64>) -> (DVector<f64>, DVector<f64>, DMatrix<f64>) {
        let s = self.sizes;
        let (phi, jacobian) = self.eq.rows(m);
        let rates = self.eq.row_rates_of(m, &jacobian);
        let count = s.kept.len();
        (
            DVector::from_fn(count, |r, _| phi[s.kept[r]] * s.rho[r]),
            DVector::from_fn(count, |r, _| rates[s.kept[r]] * s.rho[r] * self.g),
            DMatrix::from_fn(count, self.eq.n(), |r, i| jacobian[(s.kept[r], i)] * s.rho[r]),
        )
    }

    /// g (theta' - T v)/sigma + sigma J^T mu.
    fn kinematic(&self, at: &Meaning, jacobian: &DMatrix<f64>, out: &mut [f64]) {
        let sigma = &self.sizes.sigma;
        let speed = self.slopes(&at.theta, &self.theta_past);
        let moved = self.eq.increment_rates(&at.theta, &at.motion.rate);
        for (i, out) in out.iter_mut().enumerate() {
            let stabilising: f64 = (0..at.mu.len()).map(|p| jacobian[(p, i)] * at.mu[p]).sum();
            *out = self.g * (speed[i] - moved[i]) / sigma[i] + sigma[i] * stabilising;
        }
    }
}

impl Residual for BdfStep<'_, '_> {
    fn residual(&mut self, x: &[f64], out: &mut [f64]) -> Result<()> {
        self.counts.add("residual evaluations", 1);
        let (s, n) = (self.sizes, self.eq.n());
        let (m, p) = (s.kept.len(), s.n_position);
        let at = self.meaning(x);
        let lam = self.all_rows(&at.lam);
        let force = self.eq.residual(&at.motion, &at.acceleration, &lam, self.counts);
        let first = if self.form == Form::Ggl { n } else { 0 };
        for i in 0..n {
            out[first + i] = self.g * self.g / s.inertia[i] * s.sigma[i] * force[i];
        }
        if m > 0 {
            let (phi, rates, jacobian) = self.constraints(&at.motion);
            match self.form {
                Form::Ggl => {
                    self.kinematic(&at, &jacobian, &mut out[..n]);
                    (0..p).for_each(|r| out[2 * n + r] = phi[r]);
                    (0..m).for_each(|r| out[2 * n + p + r] = rates[r]);
                }
                Form::Symmetric => (0..m).for_each(|r| out[n + r] = if r < p { phi[r] } else { rates[r] }),
            }
        } else if self.form == Form::Ggl {
            self.kinematic(&at, &DMatrix::zeros(0, n), &mut out[..n]);
        }
        for (out, factor) in out.iter_mut().zip(&self.row_factor) {
            *out *= factor;
        }
        Ok(())
    }
}
