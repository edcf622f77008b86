//! Poses near which the rows lose rank, as the parallelogram's whose links align.
//!
//! The motion is smooth there, its equations are not: corrections that close the rows grow as 1/d with the distance d to the pose,
//! so that rates carry the noise eps/d^2 and accelerations eps/d^3. Schemes that end many steps within d of the pose are lost in
//! it; one long step from farther away to the other side is not.
use nalgebra::DVector;

use crate::error::Result;
use crate::run::Counts;

use super::{Equations, Instant, scaled_size};

/// What the look ahead moves, characteristic lengths or radians.
const AHEAD: f64 = 2e-3;
/// Corrections that change by this factor over that way belong to a pose nearer than about twenty times that way.
const CHANGE: f64 = 1.1;

impl Equations<'_, f64> {
    /// The time to the pose near which corrections change much over a small way ahead, negative behind it; None far from any.
    pub fn way_to_singular_pose(&self, at: &Instant, counts: &mut Counts) -> Result<Option<f64>> {
        let speed = scaled_size(&at.motion.rate, &self.scales());
        if !self.constrained() || speed == 0.0 {
            return Ok(None);
        }
        let mut sizes = [0.0; 3];
        for (part, size) in [0.0, 0.5, 1.0].iter().zip(&mut sizes) {
            let way = part * AHEAD / speed;
            let increment: Vec<f64> = at.motion.rate.iter().map(|v| v * way).collect();
            let mut m = at.motion.moved(self.topology(), &increment);
            m.t += way;
            *size = self.correction(&m, counts)?;
        }
        let [here, between, there] = sizes;
        let most = here.max(between).max(there);
        if most <= CHANGE * here.min(between).min(there) {
            return Ok(None);
        }
        // corrections grow as 1/d
        let part = if between >= most { 0.5 } else { 1.0 / (1.0 - here / there) };
        Ok(Some(part * AHEAD / speed))
    }

    /// How far coordinates move to close rows that are open by about one; no direction is special, and none is left out.
    fn correction(&self, m: &super::Motion<f64>, counts: &mut Counts) -> Result<f64> {
        let saddle = self.saddle_at(m, counts)?;
        let scales = self.row_scales();
        let open = DVector::from_fn(self.n_rows(), |i, _| {
            let sign = if (i * 5) % 3 == 0 { -1.0 } else { 1.0 };
            sign * (1.0 + 0.37 * ((i * 7) % 5) as f64) / scales[i]
        });
        let (x, _) = saddle.solve_one(&DVector::zeros(self.n()), &open)?;
        Ok(scaled_size(x.as_slice(), &self.scales()))
    }
}
