//! The dynamic stiffness of every term at its present frequency.
//!
//! Full and modal forms are evaluated at every frequency. Condensed ones, each a factorisation, are extrapolated to second order as
//! long as the change of every entry hides in the rounding of that entry. An extrapolated S serves Newton's method; the residual
//! of a point that is accepted takes `renew`.
use super::linear::{Block, DynamicStiffness, Expansion};
use crate::error::Result;

#[derive(Clone)]
pub struct Blocks {
    pub each: Vec<Block>,
    /// frequencies to which they belong; nan where nothing is known
    at: Vec<f64>,
    /// where they were factorised last, of forms whose evaluation is not cheap
    expansions: Vec<Option<Expansion>>,
}

impl Blocks {
    /// For so many terms of n coordinates.
    pub fn new(terms: usize, n: usize) -> Blocks {
        Blocks { each: vec![Block::new(n); terms], at: vec![f64::NAN; terms], expansions: vec![None; terms] }
    }

    /// Nothing is known any more.
    pub fn forget(&mut self) {
        self.at.fill(f64::NAN);
        self.expansions.fill(None);
    }

    /// Takes over what another set knows of the same first terms.
    pub fn follow(&mut self, other: &Blocks) {
        for (j, w) in other.at.iter().enumerate() {
            if self.at[j] != *w {
                self.each[j].clone_from(&other.each[j]);
                self.expansions[j].clone_from(&other.expansions[j]);
                self.at[j] = *w;
            }
        }
    }

    /// Brings the block of a term to a frequency; true where it had to be evaluated.
    pub fn update(&mut self, linear: &mut dyn DynamicStiffness, j: usize, w: f64) -> Result<bool> {
        if self.at[j] == w {
            return Ok(false);
        }
        if let Some(expansion) = self.expansions[j].as_ref().filter(|e| e.reaches(w)) {
            expansion.fill(w, &mut self.each[j]);
            self.at[j] = w;
            return Ok(false);
        }
        self.evaluate(linear, j, w)?;
        Ok(true)
    }

    /// The block of a term, evaluated at this very frequency; true where it had to be.
    pub fn renew(&mut self, linear: &mut dyn DynamicStiffness, j: usize, w: f64) -> Result<bool> {
        if self.at[j] == w && self.expansions[j].as_ref().is_none_or(|e| e.w == w) {
            return Ok(false);
        }
        self.evaluate(linear, j, w)?;
        Ok(true)
    }

    /// Sums of absolute terms, the growth of the factorisation included, to which the rounding of the entries of S of a term is in
    /// proportion; None where S is a plain sum.
    pub fn growth(&self, j: usize) -> Option<&[f64]> {
        self.expansions[j].as_ref().map(|e| e.s_growth.as_slice())
    }

    fn evaluate(&mut self, linear: &mut dyn DynamicStiffness, j: usize, w: f64) -> Result<()> {
        self.at[j] = f64::NAN;
        self.expansions[j] = linear.expansion(w, j)?;
        match &self.expansions[j] {
            Some(expansion) => self.each[j].clone_from(&expansion.at),
            None => linear.evaluate(w, j, &mut self.each[j])?,
        }
        self.at[j] = w;
        Ok(())
    }
}
