//! L D L^T of symmetric quasi-definite matrices whose pattern stays: ordered and analysed once, factorised many times.
use faer::dyn_stack::{MemBuffer, MemStack};
use faer::sparse::linalg::cholesky::{LdltRef, SymbolicCholesky, factorize_symbolic_cholesky};
use faer::sparse::{SparseColMatRef, SymbolicSparseColMatRef};
use faer::{Conj, Mat, Par, Side};

use crate::error::{Error, Result};

/// The upper triangle in compressed columns, and where each given entry goes.
pub struct Pattern {
    n: usize,
    start: Vec<u32>,
    row: Vec<u32>,
    /// place of each entry that was given; None below the diagonal
    place: Vec<Option<u32>>,
    symbolic: SymbolicCholesky<u32>,
}

fn failed(what: &str) -> Error {
    Error::singular(format!("the sparse {what} of the equations of motion failed"))
}

impl Pattern {
    /// From the places of all entries, in the order in which values will come.
    pub fn new(n: usize, places: &[(u32, u32)]) -> Result<Self> {
        let mut upper: Vec<(u32, u32)> = places.iter().filter(|(i, j)| i <= j).map(|(i, j)| (*j, *i)).collect();
        upper.sort_unstable();
        upper.dedup();
        let mut start = vec![0_u32; n + 1];
        for (j, _) in &upper {
            start[*j as usize + 1] += 1;
        }
        for j in 0..n {
            start[j + 1] += start[j];
        }
        let row: Vec<u32> = upper.iter().map(|(_, i)| *i).collect();
        let at = |i: u32, j: u32| upper.binary_search(&(j, i)).ok().map(|k| k as u32);
        let place = places.iter().map(|(i, j)| if i <= j { at(*i, *j) } else { None }).collect();
        let pattern = SymbolicSparseColMatRef::new_checked(n, n, &start, None, &row);
        let symbolic = factorize_symbolic_cholesky(pattern, Side::Upper, Default::default(), Default::default())
            .map_err(|_| failed("ordering"))?;
        Ok(Pattern { n, start, row, place, symbolic })
    }

    /// Does it belong to a matrix of this size, with so many entries given?
    pub fn fits(&self, n: usize, entries: usize) -> bool {
        self.n == n && self.place.len() == entries
    }

    /// The factors for the values of all entries; those of the same place add up.
    pub fn factor(self: &std::sync::Arc<Self>, values: impl Iterator<Item = f64>) -> Result<Ldl> {
        let mut upper = vec![0.0; self.row.len()];
        for (place, v) in self.place.iter().zip(values) {
            if let Some(k) = place {
                upper[*k as usize] += v;
            }
        }
        let pattern = SymbolicSparseColMatRef::new_checked(self.n, self.n, &self.start, None, &self.row);
        let mut value = vec![0.0; self.symbolic.len_val()];
        let need = self.symbolic.factorize_numeric_ldlt_scratch::<f64>(Par::Seq, Default::default());
        let mut memory = MemBuffer::try_new(need).map_err(|_| failed("allocation"))?;
        self.symbolic
            .factorize_numeric_ldlt(
                &mut value,
                SparseColMatRef::new(pattern, &upper),
                Side::Upper,
                Default::default(),
                Par::Seq,
                MemStack::new(&mut memory),
                Default::default(),
            )
            .map_err(|_| failed("factorisation"))?;
        Ok(Ldl { pattern: self.clone(), value })
    }
}

pub struct Ldl {
    pattern: std::sync::Arc<Pattern>,
    value: Vec<f64>,
}

impl Ldl {
    pub fn solve(&self, right: &[f64]) -> Vec<f64> {
        let n = self.pattern.n;
        let mut x = Mat::from_fn(n, 1, |i, _| right[i]);
        let symbolic = &self.pattern.symbolic;
        let mut memory = MemBuffer::new(symbolic.solve_in_place_scratch::<f64>(1, Par::Seq));
        LdltRef::<'_, u32, f64>::new(symbolic, &self.value).solve_in_place_with_conj(
            Conj::No,
            x.as_mut(),
            Par::Seq,
            MemStack::new(&mut memory),
        );
        (0..n).map(|i| x[(i, 0)]).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_change_and_the_pattern_stays() {
        let n = 40;
        let mut places = Vec::new();
        for i in 0..n as u32 {
            places.push((i, i));
            if i > 0 {
                places.push((i, i - 1));
                places.push((i - 1, i));
            }
        }
        let pattern = std::sync::Arc::new(Pattern::new(n, &places).unwrap());
        for d in [3.0, -5.0] {
            let values = places.iter().map(|(i, j)| if i == j { d } else { 1.0 });
            let x = pattern.factor(values).unwrap().solve(&vec![1.0; n]);
            for i in 0..n {
                let side = |k: usize| x.get(k).copied().unwrap_or(0.0);
                let sum = d * x[i] + side(i.wrapping_sub(1)) + side(i + 1);
                assert!((sum - 1.0).abs() < 1e-12);
            }
        }
    }
}
