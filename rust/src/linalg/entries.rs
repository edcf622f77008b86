//! Where an assembly puts its entries: a dense matrix, a list for a sparse one, or a product that needs no matrix at all.
use nalgebra::DMatrix;

/// Entries add up.
pub trait Entries<T> {
    /// Are they of use to anyone?
    const KEPT: bool = true;

    fn add(&mut self, i: usize, j: usize, v: T);
}

/// No place at all.
pub struct Nowhere;

impl<T> Entries<T> for Nowhere {
    const KEPT: bool = false;

    fn add(&mut self, _: usize, _: usize, _: T) {}
}

impl<T, E: Entries<T>> Entries<T> for &mut E {
    const KEPT: bool = E::KEPT;

    fn add(&mut self, i: usize, j: usize, v: T) {
        (**self).add(i, j, v);
    }
}

impl<T: nalgebra::Scalar + std::ops::AddAssign + Copy> Entries<T> for DMatrix<T> {
    fn add(&mut self, i: usize, j: usize, v: T) {
        self[(i, j)] += v;
    }
}

/// The sizes of what is added up for each entry.
pub struct Sizes(pub DMatrix<f64>);

impl Entries<f64> for Sizes {
    fn add(&mut self, i: usize, j: usize, v: f64) {
        self.0[(i, j)] += v.abs();
    }
}

/// Entries in the order in which they came; an assembly that depends on structure alone gives the same places every time.
#[derive(Debug, Clone, Default)]
pub struct Triplets {
    pub rows: usize,
    pub cols: usize,
    pub list: Vec<(u32, u32, f64)>,
}

impl Triplets {
    pub fn new(rows: usize, cols: usize) -> Self {
        Triplets { rows, cols, list: Vec::new() }
    }
}

impl Entries<f64> for Triplets {
    fn add(&mut self, i: usize, j: usize, v: f64) {
        self.list.push((i as u32, j as u32, v));
    }
}
