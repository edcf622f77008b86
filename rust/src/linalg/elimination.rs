//! The rank of many sparse rows: Gaussian elimination with a running bound of rounding, pivots where they make little fill.
//!
//! ```text
//! pivot       the shortest row, its entry in the shortest column, at least a tenth of row and column
//! bound       E <- max(E_row, E_pivot row) + eps max|row|    (added, never multiplied: products grow without limit)
//! redundant   max|row| <= E;      rows between that and the limit wait, and are decided together by singular values
//! ```
//! The order follows H. M. Markowitz, Management Science 3 (1957) 255-269. Singular values of all rows together are of no use:
//! the smallest genuine one of a long ladder falls with the square of its length, its pivots do not.
use std::collections::BTreeSet;

use nalgebra::DMatrix;

/// Smallest part of the largest entry of its row and of its column that a pivot may be.
const THRESHOLD: f64 = 0.1;
/// How often a row waits for a better pivot before its best one is taken.
const PATIENCE: usize = 3;

type Row = Vec<(u32, f64)>;

/// A row that is to be eliminated: its entries by ascending column, the rounding in them, and its turn.
pub struct Candidate {
    pub entries: Row,
    pub rounding: f64,
    /// rows of an earlier group are pivots before those of a later one
    pub group: usize,
}

/// What elimination finds.
#[derive(Debug, Default)]
pub struct Found {
    /// rows with a pivot, in the order of their elimination
    pub independent: Vec<usize>,
    /// rows that wait: what is left of them is below the limit, but above rounding
    pub weak: Vec<usize>,
    /// what is left of those rows, over all columns that any of them has
    pub remainder: DMatrix<f64>,
    /// the largest rounding in it
    pub rounding: f64,
}

struct Work {
    rows: Vec<Candidate>,
    /// rows that may hold an entry in each column
    holders: Vec<Vec<u32>>,
    open: Vec<bool>,
    queue: BTreeSet<(usize, usize, usize, usize)>,
    key: Vec<(usize, usize, usize, usize)>,
    tries: Vec<usize>,
}

/// Eliminate rows whose remainders are above `limit`.
pub fn eliminate(rows: Vec<Candidate>, columns: usize, limit: f64) -> Found {
    let mut holders = vec![Vec::new(); columns];
    for (i, row) in rows.iter().enumerate() {
        row.entries.iter().for_each(|(c, _)| holders[*c as usize].push(i as u32));
    }
    let n = rows.len();
    let key: Vec<_> = (rows.iter().enumerate()).map(|(i, r)| (r.group, 0, r.entries.len(), i)).collect();
    let queue = key.iter().copied().collect();
    let mut work = Work { rows, holders, open: vec![true; n], queue, key, tries: vec![0; n] };
    let mut found = Found::default();
    let mut waiting = Vec::new();
    while let Some((_, _, _, i)) = work.queue.pop_first() {
        let largest = work.rows[i].entries.iter().fold(0.0_f64, |a, e| a.max(e.1.abs()));
        if largest <= limit.max(work.rows[i].rounding) {
            waiting.push(i);
            continue;
        }
        match work.pivot(i, largest) {
            Some(column) => {
                found.independent.push(i);
                work.clear(i, column);
            }
            None => work.postpone(i),
        }
    }
    let left = |i: &usize| work.rows[*i].entries.iter().any(|e| e.1.abs() > work.rows[*i].rounding);
    found.weak = waiting.into_iter().filter(left).collect();
    let held: BTreeSet<u32> = found.weak.iter().flat_map(|i| work.rows[*i].entries.iter().map(|e| e.0)).collect();
    let held: Vec<u32> = held.into_iter().collect();
    found.remainder = DMatrix::zeros(found.weak.len(), held.len());
    for (r, i) in found.weak.iter().enumerate() {
        found.rounding = found.rounding.max(work.rows[*i].rounding);
        for (c, v) in &work.rows[*i].entries {
            if let Ok(k) = held.binary_search(c) {
                found.remainder[(r, k)] = *v;
            }
        }
    }
    found
}

impl Work {
    fn entry(&self, row: usize, column: u32) -> f64 {
        let entries = &self.rows[row].entries;
        entries.binary_search_by_key(&column, |e| e.0).map_or(0.0, |k| entries[k].1)
    }

    /// The column of the pivot of a row; None where it should wait for others.
    fn pivot(&mut self, i: usize, largest: f64) -> Option<u32> {
        let mut choice: Vec<(usize, u32, f64)> = (self.rows[i].entries.iter())
            .filter(|e| e.1.abs() >= THRESHOLD * largest)
            .map(|e| (self.holders[e.0 as usize].len(), e.0, e.1.abs()))
            .collect();
        choice.sort_by_key(|c| (c.0, c.1));
        let strong = |c: &&(usize, u32, f64)| {
            let holders = self.holders[c.1 as usize].iter().map(|r| *r as usize);
            holders.filter(|r| self.open[*r]).all(|r| c.2 >= THRESHOLD * self.entry(r, c.1).abs())
        };
        let found = choice.iter().find(strong).map(|c| c.1);
        if found.is_some() || self.tries[i] < PATIENCE {
            return found;
        }
        choice.iter().max_by(|a, b| a.2.total_cmp(&b.2)).map(|c| c.1)
    }

    fn postpone(&mut self, i: usize) {
        self.tries[i] += 1;
        let (group, _, length, _) = self.key[i];
        self.key[i] = (group, self.tries[i], length, i);
        self.queue.insert(self.key[i]);
    }

    /// Take the pivot's column out of all other rows.
    fn clear(&mut self, i: usize, column: u32) {
        self.open[i] = false;
        let pivot = std::mem::take(&mut self.rows[i].entries);
        let rounding = self.rows[i].rounding;
        let Some(value) = pivot.iter().find(|e| e.0 == column).map(|e| e.1) else { return };
        for r in std::mem::take(&mut self.holders[column as usize]) {
            let r = r as usize;
            let factor = self.entry(r, column) / value;
            if !self.open[r] || factor == 0.0 {
                continue;
            }
            let old = std::mem::take(&mut self.rows[r].entries);
            let (new, filled) = combined(&old, &pivot, factor, column);
            filled.into_iter().for_each(|c| self.holders[c as usize].push(r as u32));
            let size = new.iter().fold(0.0_f64, |a, e| a.max(e.1.abs()));
            self.rows[r].rounding = self.rows[r].rounding.max(rounding) + f64::EPSILON * size;
            self.rows[r].entries = new;
            if self.queue.remove(&self.key[r]) {
                let (group, tries, _, _) = self.key[r];
                self.key[r] = (group, tries, self.rows[r].entries.len(), r);
                self.queue.insert(self.key[r]);
            }
        }
        for (c, _) in &pivot {
            self.holders[*c as usize].retain(|r| *r as usize != i);
        }
    }
}

/// a - factor b without one column, and the columns that a did not have.
fn combined(a: &Row, b: &Row, factor: f64, without: u32) -> (Row, Vec<u32>) {
    let (mut out, mut filled) = (Vec::with_capacity(a.len() + b.len()), Vec::new());
    let (mut i, mut j) = (0, 0);
    while i < a.len() || j < b.len() {
        let (ca, cb) = (a.get(i).map_or(u32::MAX, |e| e.0), b.get(j).map_or(u32::MAX, |e| e.0));
        let column = ca.min(cb);
        let value = match ca.cmp(&cb) {
            std::cmp::Ordering::Less => a[i].1,
            std::cmp::Ordering::Greater => -factor * b[j].1,
            std::cmp::Ordering::Equal => a[i].1 - factor * b[j].1,
        };
        if cb < ca {
            filled.push(column);
        }
        i += usize::from(ca == column);
        j += usize::from(cb == column);
        if column != without {
            out.push((column, value));
        }
    }
    (out, filled)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{Rng, SeedableRng};

    #[test]
    fn the_rank_of_a_long_band_with_repeated_rows() {
        let mut rng = rand_pcg::Pcg64::seed_from_u64(7);
        let n = 2000;
        let mut rows = Vec::new();
        for i in 0..n {
            let entries: Row = (i..i + 3).map(|c| (c as u32, rng.random_range(0.2..1.0))).collect();
            rows.push(entries);
        }
        // every third combination of neighbours is repeated
        for i in (0..n - 1).step_by(3) {
            let (sum, _) = combined(&rows[i], &rows[i + 1], -0.7, u32::MAX);
            rows.push(sum);
        }
        let repeated = rows.len() - n;
        let candidates = rows.into_iter().map(|entries| Candidate { entries, rounding: 4.0 * f64::EPSILON, group: 0 });
        let found = eliminate(candidates.collect(), n + 2, 1e-4);
        let singular = |m: &DMatrix<f64>| m.singular_values().iter().filter(|s| **s > 1e-10).count();
        let more = if found.remainder.is_empty() { 0 } else { singular(&found.remainder) };
        assert_eq!(found.independent.len() + more, n, "{} rows remain of {repeated}", found.weak.len());
    }
}
