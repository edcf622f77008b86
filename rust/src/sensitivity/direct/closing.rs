//! All directions along the end of a step.
use nalgebra::DMatrix;

use crate::error::Result;
use crate::integrate::{Instant, Motion};
use crate::run::Counts;

use super::super::closing::{Aligned, Correction, corrections};
use super::super::runge_kutta::Stages;
use super::along::Along;
use super::chunk::Moving;

impl Along<'_> {
    /// The end of a step, moved to the constraints, with its accelerations.
    pub fn ended(&mut self, by: &Stages, end: &Instant, counts: &mut Counts) -> Result<()> {
        for one in corrections(self.eq, &by.open, &by.end)? {
            self.corrected(&one, counts)?;
        }
        let aligned = Aligned::new(self.eq, &by.end, &by.open.rate)?;
        self.aligned(&aligned, &by.end, counts)?;
        self.accelerate(&by.end, end, &aligned.by, counts)
    }

    fn corrected(&mut self, one: &Correction, counts: &mut Counts) -> Result<()> {
        let none = self.zeros(self.eq.n());
        let at = Moving { motion: &one.at, x: &self.now.x, v: &none, z: &self.now.z };
        let mut open = self.closure(&one.jacobian, at, 0.0);
        let mut metric = self.zeros(self.eq.n());
        if !one.is_none() {
            let (mut moved, mut held) = (self.zeros(open.nrows()), self.zeros(open.nrows()));
            let (moving, still) = (one.moving(), one.still());
            for chunk in self.chunks() {
                chunk.row_rates(Moving { motion: &moving, ..at }, &mut moved);
                chunk.row_rates(Moving { motion: &still, ..at }, &mut held);
            }
            open += moved - held;
            metric = self.metric(&one.at, (&one.dy, &one.mu), counts);
        }
        let dy = one.by.solve(&-metric, &-open)?.0;
        self.now.x = self.reached(&self.now.x, &one.dy, &dy);
        Ok(())
    }

    /// Rates of the end, from those before; `end` has those of the end.
    pub fn aligned(&mut self, by: &Aligned, end: &Motion<f64>, counts: &mut Counts) -> Result<()> {
        if self.eq.n_rows() == 0 {
            return Ok(());
        }
        let metric = self.metric(end, (&by.dv, &by.kappa), counts);
        let (x, v, z) = (&self.now.x, &self.now.v, &self.now.z);
        let mut miss = self.zeros(self.eq.n_rows());
        for chunk in self.chunks() {
            chunk.row_rates(Moving { motion: end, x, v, z }, &mut miss);
        }
        self.now.v += by.by.solve(&-metric, &-miss)?.0;
        Ok(())
    }

    /// M d + J^T y by the pose and the numbers.
    fn metric(&self, m: &Motion<f64>, change: (&[f64], &[f64]), counts: &mut Counts) -> DMatrix<f64> {
        let (none, rest, idle) = (self.zeros(self.eq.n()), vec![0.0; self.eq.n()], vec![0.0; self.eq.n_rows()]);
        let [out, _] =
            self.metrics((m, &rest), [change, (&rest, &idle)], (0.0, 0.0), [&self.now.x, &none, &none], counts);
        out
    }
}
