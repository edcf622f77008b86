//! Poses near which the rows lose rank, as the parallelogram's whose links align.
//!
//! The motion is smooth there, its equations are not: corrections that close the rows grow as 1/d with the distance d to the pose,
//! so that rates carry the noise eps/d^2 and accelerations eps/d^3. Schemes that end many steps within d of the pose are lost in
//! it; one long step from farther away to the other side is not.
use nalgebra::DVector;

use crate::error::Result;
use crate::multibody::topology::Purpose;
use crate::run::Counts;
use crate::tolerances::matrices::NAMED;
use crate::tolerances::singular_poses::LOOK;

use super::{Equations, Instant, Motion, scaled_size};

/// Points before a pose by which its time is found.
const LOOKS: usize = 4;
/// How far behind a pose drives are tried, over the time to it.
const BEYOND: f64 = 4.0;
const MOST_NAMES: usize = 4;

/// A correction of rows that are open by about one.
struct Correction {
    coordinates: DVector<f64>,
    multipliers: DVector<f64>,
}

impl Equations<'_, f64> {
    /// How firmly the rows hold the coordinates, about their smallest singular value: near a singular pose the distance to it, in
    /// characteristic lengths or radians, but for a factor.
    pub fn hold(&self, m: &Motion<f64>, counts: &mut Counts) -> f64 {
        let size = |c: Correction| scaled_size(c.coordinates.as_slice(), &self.scales());
        self.correction(m, counts).map_or(0.0, |c| 1.0 / size(c).max(f64::MIN_POSITIVE))
    }

    /// The time from `at` to the singular pose ahead: where the hold, which falls in proportion to the distance, is nothing along the
    /// way that the motion begins; None where it does not fall. `hold`: at `at`.
    pub fn way_to_singular_pose(&self, at: &Instant, hold: f64, counts: &mut Counts) -> Option<f64> {
        let speed = scaled_size(&at.motion.rate, &self.scales());
        if speed == 0.0 || hold == 0.0 {
            return None;
        }
        let (mut here, mut next) = ((0.0, hold), LOOK * hold / speed);
        let mut pose = None;
        for _ in 0..LOOKS {
            let held = self.hold(&self.foreseen(at, next), counts);
            let slope = (held - here.1) / (next - here.0);
            if slope >= 0.0 || held == 0.0 {
                return pose;
            }
            let zero = here.0 - here.1 / slope;
            pose = Some(zero);
            here = (next, held);
            next = 0.5 * (next + zero);
        }
        pose
    }

    /// Can drives go on beyond the singular pose ahead? Rows that do not move with time can; others where they can be closed there.
    pub fn goes_beyond(&self, at: &Instant, hold: f64, counts: &mut Counts) -> bool {
        self.way_to_singular_pose(at, hold, counts).is_none_or(|ahead| {
            let mut beyond = at.motion.clone();
            beyond.t += BEYOND * ahead;
            self.close(&mut beyond, counts).is_ok()
        })
    }

    /// Where the motion goes, but for what its accelerations change.
    fn foreseen(&self, at: &Instant, time: f64) -> Motion<f64> {
        let moved = at.motion.rate.iter().zip(&at.acceleration);
        let increment: Vec<f64> = moved.map(|(v, a)| time * (v + 0.5 * time * a)).collect();
        let mut m = at.motion.moved(self.topology(), &increment);
        m.t += time;
        m
    }

    /// How far coordinates move to close rows that are open by about one; no direction is special, and none is left out.
    fn correction(&self, m: &Motion<f64>, counts: &mut Counts) -> Result<Correction> {
        let saddle = self.saddle_at(m, counts)?;
        let scales = self.row_scales();
        let open = DVector::from_fn(self.n_rows(), |i, _| {
            let sign = if (i * 5) % 3 == 0 { -1.0 } else { 1.0 };
            sign * (1.0 + 0.37 * ((i * 7) % 5) as f64) / scales[i]
        });
        let (coordinates, multipliers) = saddle.solve_one(&DVector::zeros(self.n()), &open)?;
        Ok(Correction { coordinates, multipliers })
    }

    /// Whose rows lose rank next to a motion.
    pub fn losing_rank(&self, m: &Motion<f64>, counts: &mut Counts) -> LosingRank {
        let Ok(correction) = self.correction(m, counts) else {
            return LosingRank { names: "its loops and drives".into(), driven: false };
        };
        let scales = self.row_scales();
        let sizes: Vec<f64> = correction.multipliers.iter().zip(&scales).map(|(l, s)| (l / s).abs()).collect();
        let most = sizes.iter().copied().fold(0.0, f64::max);
        let mut rows: Vec<usize> = (0..sizes.len()).filter(|i| sizes[*i] >= NAMED * most).collect();
        let drives = |i: &usize| matches!(self.topology().rows[*i].purpose, Purpose::Drive(_));
        rows.sort_by(|i, j| drives(j).cmp(&drives(i)).then(sizes[*j].total_cmp(&sizes[*i])));
        let mut names: Vec<String> = Vec::new();
        let driven = rows.first().is_some_and(drives);
        for row in rows {
            let what = if drives(&row) { "the drive " } else { "" };
            let name = format!("{what}'{}'", self.topology().row_name(row));
            if !names.contains(&name) && names.len() < MOST_NAMES {
                names.push(name);
            }
        }
        LosingRank { names: names.join(", "), driven }
    }
}

/// Joints and drives whose rows lose rank in a pose, drives first, then those that lose most; and whether a drive is among them.
pub struct LosingRank {
    names: String,
    driven: bool,
}

impl LosingRank {
    /// What is to be said of the pose, and what to do.
    pub fn told(&self, t: f64) -> String {
        let what = match self.driven {
            true => {
                "beyond this pose the loops cannot be closed, or two motions meet in it: let the drive end before it"
            }
            false => "two motions meet in this pose: start elsewhere, or take a larger rtol or another method",
        };
        format!("near t = {t:.9} s the rows of {} lose rank; {what}", self.names)
    }
}
