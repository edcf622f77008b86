//! All directions along the stages of a Runge-Kutta step.
use nalgebra::DMatrix;

use crate::error::Result;
use crate::integrate::Instant;
use crate::integrate::dop853_numbers::Row;
use crate::multibody::rotations::Maps;
use crate::run::Counts;

use super::super::closing::accelerating;
use super::super::runge_kutta::{Stages, end_row, slope_maps, stage_row};
use super::along::Along;
use super::chunk::Moving;

/// Derivatives of Y, a and g of a stage.
struct Slope {
    y: DMatrix<f64>,
    v: DMatrix<f64>,
    z: DMatrix<f64>,
}

impl Along<'_> {
    /// From the start of a step to its end; `stage` is called at every stage, the first of which is the start.
    pub fn runge_kutta(
        &mut self,
        by: &Stages,
        end: &Instant,
        stage: &mut dyn FnMut(usize, &Along<'_>, &Instant) -> Result<()>,
        counts: &mut Counts,
    ) -> Result<()> {
        let (eq, start) = (self.eq, self.now.clone());
        let mut slopes: Vec<Slope> = Vec::with_capacity(by.all.len());
        for (i, own) in by.all.iter().enumerate() {
            let (at, y) = (&own.at, &own.increment);
            if i > 0 {
                let [dy, dv, dz] = self.sums(&slopes, stage_row(i), by.h);
                self.now.x = self.reached(&start.x, y, &dy);
                (self.now.v, self.now.z) = (&start.v + dv, &start.z + dz);
                let factor = accelerating(eq, &at.motion)?.0;
                self.accelerate(&at.motion, at, &factor, counts)?;
                let y = self.slope((y, &at.motion.rate), (&dy, &self.now.v));
                slopes.push(Slope { y, v: self.now.a.clone(), z: self.rates(at) });
            } else {
                slopes.push(Slope { y: start.v.clone(), v: start.a.clone(), z: self.rates(at) });
            }
            stage(i, self, at)?;
        }
        let [dy, dv, dz] = self.sums(&slopes, end_row(), by.h);
        self.now.x = self.reached(&start.x, &by.increment, &dy);
        (self.now.v, self.now.z) = (&start.v + dv, &start.z + dz);
        self.ended(by, end, counts)
    }

    fn sums(&self, slopes: &[Slope], row: Row, h: f64) -> [DMatrix<f64>; 3] {
        let n = self.eq.n();
        let mut out = [self.zeros(n), self.zeros(n), self.zeros(self.now.z.nrows())];
        for (i, weight) in row {
            let own = &slopes[*i];
            for (sum, part) in out.iter_mut().zip([&own.y, &own.v, &own.z]) {
                sum.zip_apply(part, |s, p| *s += h * weight * p);
            }
        }
        out
    }

    /// Changes of Y = J_l^-1(y) v by those of y and v.
    pub fn slope(&self, (y, v): (&[f64], &[f64]), (dy, dv): (&DMatrix<f64>, &DMatrix<f64>)) -> DMatrix<f64> {
        let [by_y, by_v] = slope_maps(self.eq, y, v);
        let mut out = dv.clone();
        let times = |maps: &Maps, k: usize, from: &DMatrix<f64>, column: usize, row: usize| -> f64 {
            let (first, map) = &maps[k];
            (0..3).map(|l| map[row][l] * from[(first + l, column)]).sum()
        };
        for (k, (first, _)) in by_y.iter().enumerate() {
            for column in 0..out.ncols() {
                for row in 0..3 {
                    out[(first + row, column)] = times(&by_y, k, dy, column, row) + times(&by_v, k, dv, column, row);
                }
            }
        }
        out
    }

    /// g of laws with states.
    pub fn rates(&self, at: &Instant) -> DMatrix<f64> {
        let mut out = self.zeros(self.now.z.nrows());
        if self.eq.has_state_rates() {
            let (x, v, z) = (&self.now.x, &self.now.v, &self.now.z);
            for chunk in self.chunks() {
                chunk.state_rates(Moving { motion: &at.motion, x, v, z }, &mut out);
            }
        }
        out
    }
}
