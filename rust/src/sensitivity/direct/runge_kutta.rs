//! All directions along the stages of a Runge-Kutta step.
use nalgebra::DMatrix;

use crate::error::Result;
use crate::integrate::Instant;
use crate::integrate::dop853_numbers::Row;
use crate::multibody::rotations::Maps;
use crate::run::Counts;

use super::super::alpha::accelerating;
use super::super::runge_kutta::{Stages, closing, end_row, slope_maps, stage_row};
use super::along::Along;
use super::chunk::Moving;
use super::slopes::{add_mapped, carried};

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
                self.now.x = carried(eq.topology(), y, &start.x);
                add_mapped(&eq.rotation_maps(y), &dy, &mut self.now.x);
                (self.now.v, self.now.z) = (&start.v + dv, &start.z + dz);
                let factor = accelerating(eq, &at.motion)?.0;
                self.accelerate(&at.motion, at, &factor, counts)?;
                slopes.push(Slope { y: self.slope(y, &at.motion.rate, &dy), v: self.now.a.clone(), z: self.rates(at) });
            } else {
                slopes.push(Slope { y: start.v.clone(), v: start.a.clone(), z: self.rates(at) });
            }
            stage(i, self, at)?;
        }
        let [dy, dv, dz] = self.sums(&slopes, end_row(), by.h);
        self.now.x = carried(eq.topology(), &by.increment, &start.x);
        add_mapped(&eq.rotation_maps(&by.increment), &dy, &mut self.now.x);
        (self.now.v, self.now.z) = (&start.v + dv, &start.z + dz);
        self.ended(by, end, counts)
    }

    /// The end of a step, moved to the constraints, with its accelerations.
    pub fn ended(&mut self, by: &Stages, end: &Instant, counts: &mut Counts) -> Result<()> {
        let eq = self.eq;
        let (factor, jacobian) = accelerating(eq, &by.end)?;
        if eq.n_rows() > 0 {
            self.onto_rows(by, &jacobian)?;
            let none = [self.zeros(eq.n()), self.zeros(0)];
            let (x, mut v) = (self.now.x.clone(), self.now.v.clone());
            self.projected(&factor, (&by.end, &end.acceleration), &none, &x, (&mut v, None))?;
            self.now.v = v;
        }
        self.accelerate(&by.end, end, &factor, counts)
    }

    /// Increments that keep the loops closed.
    fn onto_rows(&mut self, by: &Stages, jacobian: &DMatrix<f64>) -> Result<()> {
        let at = Moving { motion: &by.end, x: &self.now.x, v: &self.now.v, z: &self.now.z };
        let open = -self.closure(jacobian, at, 0.0);
        self.now.x += closing(self.eq, &by.end)?.solve(&self.zeros(self.eq.n()), &open)?.0;
        Ok(())
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

    /// Y, from changes of the increment and, in `now`, of the rates.
    fn slope(&self, y: &[f64], rate: &[f64], dy: &DMatrix<f64>) -> DMatrix<f64> {
        let [by_y, by_v] = slope_maps(self.eq, y, rate);
        let mut out = self.now.v.clone();
        let times = |maps: &Maps, k: usize, from: &DMatrix<f64>, column: usize, row: usize| -> f64 {
            let (first, map) = &maps[k];
            (0..3).map(|l| map[row][l] * from[(first + l, column)]).sum()
        };
        for (k, (first, _)) in by_y.iter().enumerate() {
            for column in 0..out.ncols() {
                for row in 0..3 {
                    out[(first + row, column)] =
                        times(&by_y, k, dy, column, row) + times(&by_v, k, &self.now.v, column, row);
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
