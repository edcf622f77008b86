//! All directions along the stages of a step of Radau's method, solved for together.
use nalgebra::DMatrix;

use crate::error::Result;
use crate::integrate::Instant;
use crate::run::Counts;

use super::super::radau::{Coupled, Probe};
use super::super::runge_kutta::Stages;
use super::along::Along;
use super::chunk::Moving;
use super::slopes::{Slopes, add_mapped, carried};

/// What the start and the numbers leave over in the equations of the stages.
struct Remainder {
    f: DMatrix<f64>,
    g: DMatrix<f64>,
}

impl Along<'_> {
    /// From the start of a step to its end; `stage` is called at every stage.
    pub fn radau(
        &mut self,
        by: &Stages,
        end: &Instant,
        probe: &Probe<'_>,
        stage: &mut dyn FnMut(usize, &Along<'_>, &Instant) -> Result<()>,
        counts: &mut Counts,
    ) -> Result<()> {
        let (eq, start) = (self.eq, self.now.clone());
        let coupled = Coupled::new(probe, by, counts)?;
        let (s, n, rows, k) = (by.all.len(), eq.n(), eq.n_rows(), probe.states.len());
        let held = coupled.chart.increments(&vec![start.v.clone(); s]);
        let left = self.left(by, &coupled, (&start, &held), probe, counts);
        let (found, lam) = coupled.system.solve(&left.f, &left.g)?;
        let a: Vec<_> = (0..s).map(|i| found.rows(i * n, n).into_owned()).collect();
        let v: Vec<_> = coupled.chart.sums(&a).iter().map(|dv| &start.v + dv).collect();
        let theta = coupled.chart.increments(&v);
        for (i, (own, (v, a))) in by.all.iter().zip(v.into_iter().zip(a)).enumerate() {
            let mut z = start.z.clone();
            for (p, place) in probe.states.iter().enumerate() {
                let mut to = z.row_mut(*place);
                to += found.row(s * n + i * k + p);
            }
            let x = self.reached(&start, &own.increment, &theta[i]);
            self.now = Slopes { x, v, a, lam: lam.rows(i * rows, rows).into_owned(), z };
            stage(i, self, &own.at)?;
        }
        self.ended(by, end, counts)
    }

    /// Increments of a stage by those of the start and by changes of its own increment.
    fn reached(&self, start: &Slopes, y: &[f64], dy: &DMatrix<f64>) -> DMatrix<f64> {
        let mut x = carried(self.eq.topology(), y, &start.x);
        add_mapped(&self.eq.rotation_maps(y), dy, &mut x);
        x
    }

    fn left(
        &mut self,
        by: &Stages,
        coupled: &Coupled,
        (start, held): (&Slopes, &[DMatrix<f64>]),
        probe: &Probe<'_>,
        counts: &mut Counts,
    ) -> Remainder {
        let eq = self.eq;
        let (s, n, rows, k) = (by.all.len(), eq.n(), eq.n_rows(), probe.states.len());
        let (mut f, mut g) = (self.zeros(s * (n + k)), self.zeros(s * rows));
        let (rest, mut rates) = (self.zeros(n), Vec::with_capacity(s));
        self.now.v = start.v.clone();
        self.now.z = start.z.clone();
        for (i, own) in by.all.iter().enumerate() {
            self.now.x = self.reached(start, &own.increment, &held[i]);
            let (m, a, lam) = (&own.at.motion, &own.at.acceleration[..], &own.at.lam[..]);
            let (x, v, z) = (&self.now.x, &self.now.v, &self.now.z);
            let r = self.residual(&coupled.linear[i], (m, a, lam), [x, v, &rest], counts);
            f.rows_mut(i * n, n).copy_from(&-r);
            if rows > 0 {
                let mut open = self.zeros(rows);
                for chunk in self.chunks() {
                    chunk.row_accelerations(Moving { motion: m, x, v, z }, (a, &rest), false, &mut open);
                }
                g.rows_mut(i * rows, rows).copy_from(&-open);
            }
            rates.push(self.rates(&own.at));
        }
        for (i, sum) in coupled.chart.sums(&rates).iter().enumerate() {
            for (p, place) in probe.states.iter().enumerate() {
                f.row_mut(s * n + i * k + p).copy_from(&sum.row(*place));
            }
        }
        Remainder { f, g }
    }
}
