//! The linear part seen by harmonic balance: dynamic stiffness S(w) of the retained coordinates, S = K - w^2 M + i w C.
use std::sync::Arc;

use faer::Mat;
use num_complex::Complex64 as c64;

use crate::error::Result;

/// Largest condensed system that carries its own matrices for stability; larger ones need a reduced model.
pub const STABILITY_COORDINATES: usize = 64;

/// S and dS/dw (n x n by rows), the force on the retained coordinates and its slope.
#[derive(Debug, Clone)]
pub struct Block {
    pub s: Vec<c64>,
    pub s_slope: Vec<c64>,
    pub force: Vec<c64>,
    pub force_slope: Vec<c64>,
    /// sums of the absolute terms of the entries of S with the growth of the factorisation, to which their rounding is in proportion;
    /// empty where S is a plain sum
    pub s_growth: Vec<f64>,
}

impl Block {
    pub fn new(n: usize) -> Block {
        let zero = c64::new(0.0, 0.0);
        Block {
            s: vec![zero; n * n],
            s_slope: vec![zero; n * n],
            force: vec![zero; n],
            force_slope: vec![zero; n],
            s_growth: Vec::new(),
        }
    }
}

/// Per term (0 is the constant one) the complex force on all coordinates: f(t) = Re sum f_j exp(i phi_j).
pub type Forces = Arc<Vec<Option<Vec<c64>>>>;

/// Condensed or not: everything that the residual needs to know of the linear part and of the forces on it.
pub trait DynamicStiffness: Send {
    /// Number of retained coordinates.
    fn size(&self) -> usize;
    /// Number of coordinates of the system.
    fn full_size(&self) -> usize;
    /// Fills `block` at the circular frequency w, with the force of this term.
    fn evaluate(&mut self, w: f64, term: usize, block: &mut Block) -> Result<()>;
    /// The blocks of these terms at their frequencies.
    fn evaluate_all(&mut self, tasks: &[(usize, f64)], blocks: &mut [Block]) -> Result<()> {
        tasks.iter().try_for_each(|&(term, w)| self.evaluate(w, term, &mut blocks[term]))
    }
    /// Where the terms are factorised as a band, several at once.
    fn half_bandwidth(&self) -> Option<usize> {
        None
    }
    /// About as many complex products does it take to evaluate so many terms once.
    fn products(&self, _terms: usize) -> f64 {
        0.0
    }
    /// Sums of the absolute terms of the entries of S at the frequency w, with the growth of a division: an ulp of these is their
    /// rounding. Of forms that are factorised the block has them.
    fn sizes(&self, _w: f64, out: &mut [f64]) {
        out.fill(0.0);
    }
    /// The same, with what is uncertain in numbers that S is made of.
    fn uncertain_sizes(&self, w: f64, out: &mut [f64]) {
        self.sizes(w, out);
    }
    /// All coordinates, given the retained ones and the factor on the force.
    fn expand(&mut self, w: f64, term: usize, factor: f64, y: &[c64], x: &mut [c64]) -> Result<()>;
    /// The retained coordinates, by their numbers in the system.
    fn retained(&self) -> Vec<usize>;
    /// M, C, K of all coordinates, the retained ones first, where they are at hand.
    fn matrices(&self) -> Option<Matrices> {
        None
    }
    /// The retained coordinates of a vector of all coordinates.
    fn restrict(&self, x: &[f64], y: &mut [f64]);
    /// The same operator for another thread or another set of terms.
    fn copied(&self) -> Result<Box<dyn DynamicStiffness>>;
    /// The retained part of a direction given in all coordinates; it must vanish on the others.
    fn retain(&self, direction: &[(usize, f64)]) -> Result<Vec<(usize, f64)>>;
}

/// M, C, K.
pub type Matrices = (Mat<f64>, Mat<f64>, Mat<f64>);

/// The same matrix with rows and columns in another order.
pub fn reordered(a: &Mat<f64>, order: &[usize]) -> Mat<f64> {
    Mat::from_fn(order.len(), order.len(), |i, j| a[(order[i], order[j])])
}

/// Nothing condensed: dense matrices by rows; C and K may hold gyroscopic and circulatory parts.
#[derive(Clone)]
pub struct Full {
    pub n: usize,
    pub m: Vec<f64>,
    pub c: Vec<f64>,
    pub k: Vec<f64>,
    pub forces: Forces,
}

impl DynamicStiffness for Full {
    fn size(&self) -> usize {
        self.n
    }

    fn full_size(&self) -> usize {
        self.n
    }

    fn evaluate(&mut self, w: f64, term: usize, block: &mut Block) -> Result<()> {
        for i in 0..self.n * self.n {
            block.s[i] = c64::new(self.k[i] - w * w * self.m[i], w * self.c[i]);
            block.s_slope[i] = c64::new(-2.0 * w * self.m[i], self.c[i]);
        }
        match self.forces.get(term).and_then(Option::as_ref) {
            Some(f) => block.force.copy_from_slice(f),
            None => block.force.fill(c64::new(0.0, 0.0)),
        }
        Ok(())
    }

    fn sizes(&self, w: f64, out: &mut [f64]) {
        for (i, size) in out.iter_mut().enumerate() {
            *size = self.k[i].abs() + w * w * self.m[i].abs() + (w * self.c[i]).abs();
        }
    }

    fn expand(&mut self, _: f64, _: usize, _: f64, y: &[c64], x: &mut [c64]) -> Result<()> {
        x.copy_from_slice(y);
        Ok(())
    }

    fn restrict(&self, x: &[f64], y: &mut [f64]) {
        y.copy_from_slice(x);
    }

    fn retained(&self) -> Vec<usize> {
        (0..self.n).collect()
    }

    fn matrices(&self) -> Option<Matrices> {
        let matrix = |a: &[f64]| Mat::from_fn(self.n, self.n, |i, j| a[i * self.n + j]);
        Some((matrix(&self.m), matrix(&self.c), matrix(&self.k)))
    }

    fn copied(&self) -> Result<Box<dyn DynamicStiffness>> {
        Ok(Box::new(self.clone()))
    }

    fn retain(&self, direction: &[(usize, f64)]) -> Result<Vec<(usize, f64)>> {
        Ok(direction.to_vec())
    }
}
