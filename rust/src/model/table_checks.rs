//! What the Tables of flexible bodies and of blades must hold before anything is computed with them.
use crate::error::{Error, Result};
use crate::model::layout::{air, node, quadratic, section};
use crate::model::tables::Tables;

impl Tables {
    pub(super) fn check_flexible(&self) -> Result<()> {
        let outside = || Error::model("the numbers of a flexible body lie outside the value vector");
        for f in &self.flexible {
            let end = f.x.checked_add(f.size()).ok_or_else(outside)?;
            if end > self.x.len() || f.m == 0 || f.body >= self.bodies.len() {
                return Err(outside());
            }
        }
        for tip in &self.tips {
            let f = self.flexible.get(tip.flexible).ok_or_else(outside)?;
            let end = tip.x.checked_add(node::size(f.m)).ok_or_else(outside)?;
            let second = tip.quadratic.map_or(Some(0), |start| start.checked_add(quadratic::size(f.m)));
            if end.max(second.ok_or_else(outside)?) > self.x.len() || tip.body >= self.bodies.len() {
                return Err(outside());
            }
        }
        Ok(())
    }

    pub(super) fn check_air(&self) -> Result<()> {
        for one in &self.air {
            self.inside(&one.name, one.x, air::SIZE)?;
            if let Some(h) = &one.history {
                let n = h.times.len().saturating_mul(3 * h.sections);
                self.inside(&one.name, h.x, n)?;
                if h.times.is_empty() || h.times.windows(2).any(|w| w[0].is_nan() || w[0] >= w[1]) {
                    return Err(Error::model(format!(
                        "'{}': the times of its induced velocities must increase",
                        one.name
                    )));
                }
            }
        }
        for one in &self.sections {
            self.inside("a section of a blade", one.x, section::SIZE)?;
            if one.air >= self.air.len() || one.body >= self.bodies.len() {
                return Err(Error::model("a section belongs to no blade"));
            }
        }
        Ok(())
    }
}
