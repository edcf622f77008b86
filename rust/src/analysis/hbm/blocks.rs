//! The dynamic stiffness of every term at its present frequency: computed where it is not known, kept where it is.
use super::linear::{Block, DynamicStiffness};
use crate::error::Result;

/// Relative change of a block below which a new factorisation, told apart from the old one by its slope, shows its rounding.
const NEIGHBOURS: f64 = 1e-3;
/// Rounding of factorisations that no estimate needs to show.
const QUIET: f64 = 1e-10;

#[derive(Clone)]
pub struct Blocks {
    pub each: Vec<Block>,
    at: Vec<f64>,
    /// frequencies at which they were computed last; from there on the slope may have done
    from: Vec<f64>,
    /// relative rounding, as two neighbours have shown it
    pub noise: f64,
}

impl Blocks {
    /// For so many terms of n coordinates.
    pub fn new(terms: usize, n: usize) -> Blocks {
        Blocks { each: vec![Block::new(n); terms], at: vec![f64::NAN; terms], from: vec![f64::NAN; terms], noise: 0.0 }
    }

    /// Nothing is known any more.
    pub fn forget(&mut self) {
        self.at.fill(f64::NAN);
        self.from.fill(f64::NAN);
    }

    /// Takes over what another set knows of the same first terms.
    pub fn follow(&mut self, other: &Blocks) {
        // where rounding is felt, another evaluation shows it in the estimate
        if other.noise > QUIET {
            return;
        }
        for (j, w) in other.at.iter().enumerate() {
            if self.at[j] != *w {
                self.each[j].clone_from(&other.each[j]);
                (self.at[j], self.from[j]) = (*w, other.from[j]);
            }
        }
    }

    /// Brings the block of a term to a frequency; true where it had to be computed.
    pub fn update(&mut self, linear: &mut dyn DynamicStiffness, j: usize, w: f64) -> Result<bool> {
        if self.at[j] == w {
            return Ok(false);
        }
        let block = &mut self.each[j];
        let moved = block.change(w - self.from[j]);
        let near = linear.extrapolates().max(self.noise.sqrt()).min(NEIGHBOURS);
        let close = moved <= NEIGHBOURS;
        if close {
            block.extrapolate(w - self.at[j]);
            self.at[j] = w;
        }
        // the next term of the series is about the square of the change: as small as the rounding of a computation
        if moved <= near {
            return Ok(false);
        }
        let expected = close.then(|| block.s.clone());
        self.at[j] = f64::NAN;
        linear.evaluate(w, j, block)?;
        (self.at[j], self.from[j]) = (w, w);
        if let Some(expected) = expected {
            let off = block.distance(&expected);
            if off > 100.0 * moved * moved {
                self.noise = self.noise.max(off);
            }
        }
        Ok(true)
    }
}
