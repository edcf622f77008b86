//! How fast a model can vibrate or decay at its start: power iteration on differences of accelerations, without any tangent.
use crate::error::Result;
use crate::multibody::assemble::Tangent;
use crate::run::Counts;

use super::methods::STIFF;
use super::{Equations, Instant, Motion, scaled_size};
use crate::linalg::matrix::Matrix;
use crate::multibody::rotations::Maps;
use nalgebra::DVector;

const ITERATIONS: usize = 12;

/// Largest rates (1/s) at which displacements (vibration) and velocities (decay) act back on accelerations.
#[derive(Debug, Clone, Copy)]
pub struct Fastest {
    pub vibration: f64,
    pub decay: f64,
}

impl Fastest {
    pub fn most(&self) -> f64 {
        self.vibration.max(self.decay)
    }

    pub fn or(&self, o: &Fastest) -> Self {
        Fastest { vibration: self.vibration.max(o.vibration), decay: self.decay.max(o.decay) }
    }
}

impl Equations<'_, f64> {
    /// How fast the motion itself goes (1/s), over the time of a run: the largest of its rates and of what its accelerations make.
    pub fn pace(&self, at: &Instant, time: f64) -> f64 {
        let scales = self.scales();
        let size = |v: &[f64]| scaled_size(v, &scales);
        size(&at.motion.rate).max(size(&at.acceleration).sqrt()).max(1.0 / time)
    }

    /// Vibrations or decays far faster than the motion?
    pub fn is_stiff(&self, at: &Instant, time: f64, counts: &mut Counts) -> Result<bool> {
        if self.topology().connectors.is_empty() {
            return Ok(false);
        }
        Ok(self.fastest(at, counts)?.most() > STIFF * self.pace(at, time))
    }

    pub fn fastest(&self, at: &Instant, counts: &mut Counts) -> Result<Fastest> {
        let scales = self.scales();
        let size = |v: &[f64]| scaled_size(v, &scales);
        let n = self.n();
        let mut fastest = Fastest { vibration: 0.0, decay: 0.0 };
        let own = size(&at.motion.rate).max(size(&at.acceleration).sqrt());
        for displaced in [true, false] {
            // no direction is special, and none is left out
            let mut x: Vec<f64> = (0..n).map(|i| scales[i] * (1.0 + 0.37 * ((i * 7) % 5) as f64)).collect();
            let mut growth = 0.0;
            // rates are changed by a part of the motion's own, or of what the vibration would have
            let natural =
                if displaced { 1.0 } else { [own, fastest.vibration].into_iter().find(|r| *r > 0.0).unwrap_or(1.0) };
            let change = f64::EPSILON.sqrt() * natural;
            for _ in 0..ITERATIONS {
                let unit = change / size(&x).max(f64::MIN_POSITIVE);
                let nudge: Vec<f64> = x.iter().map(|v| v * unit).collect();
                let mut m = at.motion.clone();
                if displaced {
                    m = m.moved(self.topology(), &nudge);
                    self.carry_states(&at.motion, &nudge, &mut m);
                } else {
                    m.rate.iter_mut().zip(&nudge).for_each(|(r, d)| *r += d);
                }
                let there = self.instant(m, counts)?;
                x = there.acceleration.iter().zip(&at.acceleration).map(|(a, b)| a - b).collect();
                growth = size(&x) / change;
                if growth == 0.0 {
                    break;
                }
            }
            if displaced {
                fastest.vibration = growth.sqrt();
            } else {
                fastest.decay = growth;
            }
        }
        Ok(fastest)
    }

    /// J v + Phi_t of all rows without a dense J.
    pub fn row_rates_sparse(&self, m: &Motion<f64>) -> DVector<f64> {
        self.row_matrix(m).1.times(&m.rate) + self.explicit_rates(m).0
    }

    /// M + cd D + ck K and J, for changes of the pose or of what `maps` turns into them.
    pub fn iteration_matrices(
        &self,
        m: &Motion<f64>,
        a: &[f64],
        lam: &[f64],
        (cd, ck): (f64, f64),
        maps: &Maps,
        counts: &mut Counts,
    ) -> (Matrix, Matrix) {
        counts.add("tangents", 1);
        counts.add("factorisations", 1);
        let placement = self.place(m);
        let scene = self.scene(m, &placement, Some(a));
        let lam = (!lam.is_empty()).then_some(lam);
        let n = self.n();
        let mut tangent: Tangent<f64, Matrix> = scene.tangent_into(lam, counts, || Matrix::zeros(n, n, self.sparse));
        self.hold_rates(m, a, &mut tangent);
        let mut jacobian = Matrix::zeros(self.n_rows(), n, self.sparse);
        scene.constraints_into(&mut jacobian);
        let mut stiffness = tangent.stiffness;
        stiffness.turn_columns(maps);
        jacobian.turn_columns(maps);
        let mut matrix = tangent.mass;
        matrix.add_scaled(&stiffness, ck);
        for d in [&tangent.damping, &tangent.gyroscopic].into_iter().flatten() {
            matrix.add_scaled(d, cd);
        }
        (matrix, jacobian)
    }
}
