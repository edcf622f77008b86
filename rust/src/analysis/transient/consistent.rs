//! Positions on the constraints, rates along them, accelerations and multipliers that belong to both: what makes an instant.
//!
//! Corrections are the smallest in kinetic energy, min dy^T M dy, so that they leave the free motion alone.
use nalgebra::{DMatrix, DVector};

use crate::error::{Error, Result};
use crate::run::Counts;
use crate::system::placement::advance;
use crate::system::topology::Level;

use super::saddle::Saddle;
use super::{Equations, Instant, Motion};

/// Rows are closed when smaller than this (scaled), or when they get no smaller.
const CLOSED: f64 = 1e-14;
const ACCEPTABLE: f64 = 1e-10;
const CLOSING_STEPS: usize = 12;

impl Equations<'_, f64> {
    fn position_rows(&self) -> Vec<usize> {
        let rows = &self.topology().rows;
        (0..rows.len())
            .filter(|i| rows[*i].level == Level::Position)
            .collect()
    }

    /// The largest of scaled rows, and which.
    pub fn worst_row(&self, rows: &DVector<f64>) -> (f64, usize) {
        let scaled = rows
            .iter()
            .zip(self.row_scales())
            .map(|(v, s)| (v * s).abs());
        scaled.enumerate().fold((0.0, 0), |worst, (i, v)| {
            if v > worst.0 || v.is_nan() {
                (v, i)
            } else {
                worst
            }
        })
    }

    /// Close the position rows.
    pub fn close(&self, m: &mut Motion<f64>, counts: &mut Counts) -> Result<()> {
        let kept = self.position_rows();
        if kept.is_empty() {
            return Ok(());
        }
        let mut last = f64::INFINITY;
        for _ in 0..CLOSING_STEPS {
            let (phi, jacobian) = self.rows(m);
            let phi = DVector::from_fn(phi.len(), |i, _| {
                if self.topology().rows[i].level == Level::Position {
                    phi[i]
                } else {
                    0.0
                }
            });
            let (size, worst) = self.worst_row(&phi);
            if size <= CLOSED || size <= ACCEPTABLE * 0.1 && size > 0.5 * last {
                return Ok(());
            }
            if !size.is_finite() || size > 1e3 {
                return Err(self.open(worst, size));
            }
            last = size;
            counts.add("position projections", 1);
            let closing = DMatrix::from_fn(kept.len(), self.n(), |i, j| jacobian[(kept[i], j)]);
            let miss = DVector::from_fn(kept.len(), |i, _| -phi[kept[i]]);
            let step = Saddle::new(&self.mass(m), &closing)?
                .solve(&DVector::zeros(self.n()), &miss)?
                .0;
            advance(self.topology(), &mut m.relative, step.as_slice());
        }
        if last <= ACCEPTABLE {
            return Ok(());
        }
        let (size, worst) = self.worst_row(&self.rows(m).0);
        Err(self.open(worst, size))
    }

    fn open(&self, row: usize, size: f64) -> Error {
        let topology = self.topology();
        if let Some(error) = topology.tables.failure() {
            return error;
        }
        let name = topology.row_name(row);
        Error::Convergence {
            message: format!("'{name}' stays open by {size:.2e} characteristic lengths or radians"),
            best: Vec::new(),
            residual: size,
        }
    }

    /// Make the rates agree with all rows.
    pub fn align(&self, m: &mut Motion<f64>, counts: &mut Counts) -> Result<()> {
        if self.n_rows() == 0 {
            return Ok(());
        }
        counts.add("velocity projections", 1);
        let jacobian = self.rows(m).1;
        let saddle = Saddle::new(&self.mass(m), &jacobian)?;
        let (none, miss) = (DVector::zeros(self.n()), -self.row_rates(m));
        for (rate, step) in m.rate.iter_mut().zip(saddle.solve(&none, &miss)?.0.iter()) {
            *rate += step;
        }
        Ok(())
    }

    /// Accelerations and multipliers of a consistent motion.
    pub fn instant(&self, motion: Motion<f64>, counts: &mut Counts) -> Result<Instant> {
        let (mass, h) = self.mass_and_forces(&motion, counts);
        self.check_forces(&h)?;
        if self.n_rows() == 0 {
            let (a, _) =
                Saddle::new(&mass, &DMatrix::zeros(0, self.n()))?.solve(&-h, &DVector::zeros(0))?;
            return Ok(Instant {
                motion,
                acceleration: a.as_slice().to_vec(),
                lam: Vec::new(),
            });
        }
        counts.add("multiplier solutions", 1);
        let jacobian = self.rows(&motion).1;
        let gamma = self.row_bias(&motion);
        let (a, lam) = Saddle::new(&mass, &jacobian)?.solve(&-h, &-gamma)?;
        Ok(Instant {
            motion,
            acceleration: a.as_slice().to_vec(),
            lam: lam.as_slice().to_vec(),
        })
    }

    /// Closed, aligned, with accelerations: one factorisation for rates and accelerations.
    pub fn consistent(&self, mut m: Motion<f64>, counts: &mut Counts) -> Result<Instant> {
        if self.n_rows() == 0 {
            return self.instant(m, counts);
        }
        self.close(&mut m, counts)?;
        counts.add("velocity projections", 1);
        counts.add("multiplier solutions", 1);
        let (mass, jacobian) = (self.mass(&m), self.rows(&m).1);
        let saddle = Saddle::new(&mass, &jacobian)?;
        let miss = -self.row_rates_of(&m, &jacobian);
        let step = saddle.solve(&DVector::zeros(self.n()), &miss)?.0;
        for (rate, step) in m.rate.iter_mut().zip(step.iter()) {
            *rate += step;
        }
        let h = self.forces(&m, counts);
        self.check_forces(&h)?;
        let gamma = self.row_bias(&m);
        let (a, lam) = saddle.solve(&-h, &-gamma)?;
        Ok(Instant {
            motion: m,
            acceleration: a.as_slice().to_vec(),
            lam: lam.as_slice().to_vec(),
        })
    }

    /// What position, velocity and acceleration rows leave over, scaled by the characteristic length.
    pub fn residuals(&self, m: &Motion<f64>, a: &[f64]) -> [f64; 3] {
        if self.n_rows() == 0 {
            return [0.0; 3];
        }
        let (phi, jacobian) = self.rows(m);
        let rates = self.row_rates_of(m, &jacobian);
        let accelerations = &jacobian * DVector::from_column_slice(a) + self.row_bias(m);
        [phi, rates, accelerations].map(|r| self.worst_row(&r).0)
    }

    fn check_forces(&self, h: &DVector<f64>) -> Result<()> {
        match h.iter().position(|v| !v.is_finite()) {
            None => Ok(()),
            Some(i) => Err(self
                .topology()
                .tables
                .failure()
                .unwrap_or(Error::Convergence {
                    message: format!(
                        "the force along '{}' is no number",
                        self.topology().names[i]
                    ),
                    best: Vec::new(),
                    residual: f64::NAN,
                })),
        }
    }
}
