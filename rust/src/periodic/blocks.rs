//! The dynamic stiffness of every term at its present frequency, evaluated there and nowhere near.
use super::linear::{Block, DynamicStiffness};
use crate::error::Result;

#[derive(Clone)]
pub struct Blocks {
    pub each: Vec<Block>,
    /// frequencies to which they belong; nan where nothing is known
    at: Vec<f64>,
}

impl Blocks {
    /// For so many terms of n coordinates.
    pub fn new(terms: usize, n: usize) -> Blocks {
        Blocks { each: vec![Block::new(n); terms], at: vec![f64::NAN; terms] }
    }

    /// Nothing is known any more.
    pub fn forget(&mut self) {
        self.at.fill(f64::NAN);
    }

    /// Takes over what another set knows of the same first terms.
    pub fn follow(&mut self, other: &Blocks) {
        for (j, w) in other.at.iter().enumerate() {
            if self.at[j] != *w {
                self.each[j].clone_from(&other.each[j]);
                self.at[j] = *w;
            }
        }
    }

    /// Brings the blocks of all terms to their frequencies; how many had to be evaluated.
    pub fn update(&mut self, linear: &mut dyn DynamicStiffness, frequencies: &[f64]) -> Result<u64> {
        let tasks: Vec<(usize, f64)> =
            frequencies.iter().copied().enumerate().filter(|(j, w)| self.at[*j] != *w).collect();
        for (j, _) in &tasks {
            self.at[*j] = f64::NAN;
            self.each[*j].s_growth.clear();
        }
        linear.evaluate_all(&tasks, &mut self.each)?;
        tasks.iter().for_each(|(j, w)| self.at[*j] = *w);
        Ok(tasks.len() as u64)
    }
}
