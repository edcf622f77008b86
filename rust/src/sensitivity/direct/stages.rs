//! All directions along the stages of a step that are solved for together.
use nalgebra::DMatrix;

use crate::error::Result;
use crate::integrate::Instant;
use crate::run::Counts;

use super::super::runge_kutta::{Stages, weights};
use super::super::stages::{Base, Coupled, Probe, Rows};
use super::along::Along;
use super::chunk::Moving;
use super::slopes::{Slopes, add_mapped, carried};

/// What the base and the numbers leave over in the equations of the stages.
struct Remainder {
    f: DMatrix<f64>,
    g: DMatrix<f64>,
}

impl Along<'_> {
    /// From the start of a step of Radau's method to its end; `stage` is called at every stage.
    pub fn radau(
        &mut self,
        by: &Stages,
        end: &Instant,
        probe: &Probe<'_>,
        stage: &mut dyn FnMut(usize, &Along<'_>, &Instant) -> Result<()>,
        counts: &mut Counts,
    ) -> Result<()> {
        let coupled = Coupled::new(probe, weights(by.h), by, counts)?;
        let s = by.all.len();
        let (theta, v) = (vec![self.zeros(self.eq.n()); s], vec![self.now.v.clone(); s]);
        let base = Base { x: self.now.x.clone(), theta, v, z: self.now.z.clone() };
        self.solved(by, &coupled, &base, probe, stage, counts)?;
        self.ended(by, end, counts)
    }

    /// The stages, solved from their base; the last of them is where all is then, and what comes back are changes of its increment.
    pub fn solved(
        &mut self,
        by: &Stages,
        coupled: &Coupled,
        base: &Base,
        probe: &Probe<'_>,
        stage: &mut dyn FnMut(usize, &Along<'_>, &Instant) -> Result<()>,
        counts: &mut Counts,
    ) -> Result<DMatrix<f64>> {
        let (s, n, rows, k) = (by.all.len(), self.eq.n(), self.eq.n_rows(), probe.states.len());
        let held = coupled.chart.increments(&base.theta, &base.v);
        let left = self.left(by, coupled, (base, &held), probe, counts);
        let (found, lam) = coupled.system.solve(&left.f, &left.g)?;
        let a: Vec<_> = (0..s).map(|i| found.rows(i * n, n).into_owned()).collect();
        let v: Vec<_> = coupled.chart.sums(&a).iter().zip(&base.v).map(|(dv, v0)| v0 + dv).collect();
        let mut theta = coupled.chart.increments(&base.theta, &v);
        for (i, (own, (v, a))) in by.all.iter().zip(v.into_iter().zip(a)).enumerate() {
            let mut z = base.z.clone();
            for (p, place) in probe.states.iter().enumerate() {
                let mut to = z.row_mut(*place);
                to += found.row(s * n + i * k + p);
            }
            let x = self.reached(&base.x, &own.increment, &theta[i]);
            self.now = Slopes { x, v, a, lam: lam.rows(i * rows, rows).into_owned(), z };
            stage(i, self, &own.at)?;
        }
        Ok(theta.pop().unwrap_or_else(|| self.zeros(n)))
    }

    /// Increments of a stage by those of the pose that it counts from and by changes of its own increment.
    pub fn reached(&self, x: &DMatrix<f64>, y: &[f64], dy: &DMatrix<f64>) -> DMatrix<f64> {
        let mut x = carried(self.eq.topology(), y, x);
        add_mapped(&self.eq.rotation_maps(y), dy, &mut x);
        x
    }

    fn left(
        &mut self,
        by: &Stages,
        coupled: &Coupled,
        (base, held): (&Base, &[DMatrix<f64>]),
        probe: &Probe<'_>,
        counts: &mut Counts,
    ) -> Remainder {
        let eq = self.eq;
        let (s, n, rows, k) = (by.all.len(), eq.n(), eq.n_rows(), probe.states.len());
        let (mut f, mut g) = (self.zeros(s * (n + k)), self.zeros(s * rows));
        let (rest, mut rates) = (self.zeros(n), Vec::with_capacity(s));
        self.now.z = base.z.clone();
        for (i, own) in by.all.iter().enumerate() {
            self.now.v = base.v[i].clone();
            self.now.x = self.reached(&base.x, &own.increment, &held[i]);
            let (m, a, lam) = (&own.at.motion, &own.at.acceleration[..], &own.at.lam[..]);
            let (x, v, z) = (&self.now.x, &self.now.v, &self.now.z);
            let r = self.residual(&coupled.linear[i], (m, a, lam), [x, v, &rest], counts);
            f.rows_mut(i * n, n).copy_from(&-r);
            if rows > 0 {
                let mut open = self.zeros(rows);
                for chunk in self.chunks() {
                    let at = Moving { motion: m, x, v, z };
                    match probe.rows {
                        Rows::Accelerations => chunk.row_accelerations(at, (a, &rest), false, &mut open),
                        Rows::Rates => chunk.row_rates(at, &mut open),
                    }
                }
                g.rows_mut(i * rows, rows).copy_from(&(-open / coupled.rows_by));
            }
            if k > 0 {
                rates.push(self.rates(&own.at));
            }
        }
        if k == 0 {
            return Remainder { f, g };
        }
        for (i, sum) in coupled.chart.sums(&rates).iter().enumerate() {
            for (p, place) in probe.states.iter().enumerate() {
                f.row_mut(s * n + i * k + p).copy_from(&sum.row(*place));
            }
        }
        Remainder { f, g }
    }
}
