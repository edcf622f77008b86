//! Inertia of sparse symmetric matrices: how many eigenvalues are negative, by Sylvester's law from P S A S P^T = L D L^T.
//!
//! ```text
//! front       rows and columns of a supernode, of what its children could not eliminate, and of all that they touch
//! pivot       a diagonal entry of at least u of its column, or a 2 x 2 block D with |D^-1| (largest of its columns) <= 1/u
//! delayed     columns of a front without such a pivot; they become columns of the parent
//! ```
//! The multifrontal method with threshold pivoting (I. S. Duff and J. K. Reid, ACM Trans. Math. Software 9 (1983) 302-325): stable on
//! saddle points, whose zero diagonals break a factorisation without pivots. L is not kept. Rows and columns are scaled to entries of
//! at most 1 first (D. Ruiz, RAL-TR-2001-034), which changes no inertia. O(sum of squares of the fronts' sizes).
use std::collections::VecDeque;

use faer::Side;
use faer::sparse::linalg::SupernodalThreshold;
use faer::sparse::linalg::cholesky::{CholeskySymbolicParams, SymbolicCholeskyRaw, factorize_symbolic_cholesky};

use crate::linalg::sparse::Csc;
use crate::tolerances::inertia::{PIVOT, PIVOT_ROUNDING};

const SCALINGS: usize = 4;
const NOWHERE: usize = usize::MAX;

/// Number of negative eigenvalues of a symmetric matrix; None where a pivot is rounding of what was added up for it, so that its sign
/// tells nothing: the matrix is singular, or nearly so.
pub fn negative_eigenvalues(a: &Csc) -> Option<usize> {
    let scale = unit_scale(a)?;
    let tree = Tree::new(a)?;
    let mut size = vec![0.0; a.rows];
    let mut place = vec![NOWHERE; a.rows];
    let mut waiting: Vec<Vec<Update>> = (0..tree.nodes.len()).map(|_| Vec::new()).collect();
    let mut negative = 0;
    for (k, node) in tree.nodes.iter().enumerate() {
        let children = std::mem::take(&mut waiting[k]);
        let mut front = Front::new(node, &children, &mut place);
        front.add_entries(a, &tree, node, &scale, &place);
        for child in &children {
            front.add_update(child, &place);
        }
        front.index.iter().for_each(|i| place[*i] = NOWHERE);
        let (count, update) = front.eliminate(&mut size)?;
        negative += count;
        match (node.parent, update.index.is_empty()) {
            (_, true) => {}
            (Some(parent), _) => waiting[parent].push(update),
            (None, _) => return None,
        }
    }
    Some(negative)
}

/// Factors that bring the largest entry of each row to about 1; None for a row of zeros.
fn unit_scale(a: &Csc) -> Option<Vec<f64>> {
    let mut scale = vec![1.0; a.rows];
    for _ in 0..SCALINGS {
        let mut largest = vec![0.0_f64; a.rows];
        for (i, j, v) in a.entries() {
            largest[i] = largest[i].max((v * scale[i] * scale[j]).abs());
        }
        if largest.iter().any(|v| *v == 0.0 || !v.is_finite()) {
            return None;
        }
        scale.iter_mut().zip(&largest).for_each(|(s, v)| *s /= v.sqrt());
    }
    Some(scale)
}

/// Columns that have the same rows below them.
struct Node {
    first: usize,
    end: usize,
    /// rows below the last column, in the order of elimination
    rows: Vec<usize>,
    parent: Option<usize>,
}

/// The order of elimination and its supernodes, children before parents.
struct Tree {
    nodes: Vec<Node>,
    /// original index of each column in the order of elimination, and the inverse
    order: Vec<usize>,
    position: Vec<usize>,
}

impl Tree {
    fn new(a: &Csc) -> Option<Self> {
        let params = CholeskySymbolicParams {
            supernodal_flop_ratio_threshold: SupernodalThreshold::FORCE_SIMPLICIAL,
            ..Default::default()
        };
        let symbolic = factorize_symbolic_cholesky(a.pattern(), Side::Upper, Default::default(), params).ok()?;
        let n = a.rows;
        let order: Vec<usize> = match symbolic.perm() {
            Some(p) => p.arrays().0.iter().map(|i| *i as usize).collect(),
            None => (0..n).collect(),
        };
        let mut position = vec![0; n];
        order.iter().enumerate().for_each(|(k, i)| position[*i] = k);
        let SymbolicCholeskyRaw::Simplicial(s) = symbolic.raw() else {
            return None;
        };
        let below = |j: usize| {
            let column = &s.row_idx()[s.col_ptr()[j] as usize..s.col_ptr()[j + 1] as usize];
            let mut rows: Vec<usize> = column.iter().map(|i| *i as usize).filter(|i| *i > j).collect();
            rows.sort_unstable();
            rows
        };
        let mut nodes: Vec<Node> = Vec::new();
        let mut node_of = vec![0; n];
        for j in 0..n {
            let rows = below(j);
            // the next column of a node is the first row below it and touches all others
            let joins = |last: &Node| last.rows.first() == Some(&j) && last.rows.len() == rows.len() + 1;
            match nodes.last_mut().filter(|last| joins(last)) {
                Some(last) => (last.end, last.rows) = (j + 1, rows),
                None => nodes.push(Node { first: j, end: j + 1, rows, parent: None }),
            }
            node_of[j] = nodes.len() - 1;
        }
        for node in &mut nodes {
            node.parent = node.rows.first().map(|i| node_of[*i]);
        }
        Some(Tree { nodes, order, position })
    }
}

/// What a front leaves to its parent: columns that found no pivot, then rows that belong to later columns.
struct Update {
    index: Vec<usize>,
    delayed: usize,
    /// symmetric, both halves, column by column
    value: Vec<f64>,
}

struct Front {
    index: Vec<usize>,
    /// how many columns have all their entries
    summed: usize,
    value: Vec<f64>,
}

impl Front {
    /// Zeros over the columns of a node, delayed ones of its children, and the rows below; `place` becomes the place of each.
    fn new(node: &Node, children: &[Update], place: &mut [usize]) -> Self {
        let mut index: Vec<usize> = (node.first..node.end).collect();
        for child in children {
            index.extend_from_slice(&child.index[..child.delayed]);
        }
        let summed = index.len();
        index.extend_from_slice(&node.rows);
        index.iter().enumerate().for_each(|(k, i)| place[*i] = k);
        let value = vec![0.0; index.len() * index.len()];
        Front { index, summed, value }
    }

    fn add_entries(&mut self, a: &Csc, tree: &Tree, node: &Node, scale: &[f64], place: &[usize]) {
        let m = self.index.len();
        for j in node.first..node.end {
            let old = tree.order[j];
            for (i, v) in a.column(old) {
                let row = tree.position[i];
                if row < j {
                    continue;
                }
                let (r, c, v) = (place[row], place[j], v * scale[i] * scale[old]);
                self.value[r + c * m] += v;
                if row != j {
                    self.value[c + r * m] += v;
                }
            }
        }
    }

    fn add_update(&mut self, child: &Update, place: &[usize]) {
        let (m, k) = (self.index.len(), child.index.len());
        for (c, j) in child.index.iter().enumerate() {
            let column = place[*j] * m;
            for (i, v) in child.index.iter().zip(&child.value[c * k..(c + 1) * k]) {
                self.value[place[*i] + column] += v;
            }
        }
    }

    /// Number of negative pivots, and what remains; `size` is the largest that each diagonal entry has been.
    fn eliminate(mut self, size: &mut [f64]) -> Option<(usize, Update)> {
        let m = self.index.len();
        for (k, i) in self.index.iter().enumerate() {
            size[*i] = size[*i].max(self.value[k + k * m].abs());
        }
        let mut active: Vec<usize> = (0..m).collect();
        let mut queue: VecDeque<usize> = (0..self.summed).collect();
        let (mut negative, mut refused) = (0, 0);
        while let Some(k) = queue.pop_front() {
            let (next, most) = self.largest(k, &active, NOWHERE);
            let d = self.value[k + k * m];
            if d.abs() >= PIVOT * most && d != 0.0 {
                if d.abs() <= PIVOT_ROUNDING * f64::EPSILON * size[self.index[k]] {
                    return None;
                }
                negative += usize::from(d < 0.0);
                active.retain(|i| *i != k);
                self.clear_one(k, d, &active, size);
                refused = 0;
                continue;
            }
            if let Some(r) = next.filter(|_| most > 0.0)
                && let Some(block) = self.block(k, r, &active)
            {
                let [a, b, c] = block;
                let det = a * c - b * b;
                negative += if det < 0.0 { 1 } else { 2 * usize::from(a < 0.0) };
                queue.retain(|i| *i != r);
                active.retain(|i| *i != k && *i != r);
                self.clear_two((k, r), block, &active, size);
                refused = 0;
                continue;
            }
            queue.push_back(k);
            refused += 1;
            if refused >= queue.len() {
                break;
            }
        }
        let delayed = queue.len();
        let kept: Vec<usize> = queue.into_iter().chain(active.into_iter().filter(|i| *i >= self.summed)).collect();
        let entry = |c: &usize, r: &usize| self.value[r + c * m];
        let value = kept.iter().flat_map(|c| kept.iter().map(move |r| entry(c, r))).collect();
        Some((negative, Update { index: kept.iter().map(|k| self.index[*k]).collect(), delayed, value }))
    }

    /// The largest entry of a column off its diagonal, and the row of the largest among columns that have all their entries.
    fn largest(&self, k: usize, active: &[usize], without: usize) -> (Option<usize>, f64) {
        let m = self.index.len();
        let (mut row, mut best, mut most) = (None, 0.0, 0.0_f64);
        for i in active.iter().filter(|i| **i != k && **i != without) {
            let v = self.value[i + k * m].abs();
            most = most.max(v);
            if v > best && *i < self.summed {
                (row, best) = (Some(*i), v);
            }
        }
        (row, most)
    }

    /// [a, b; b, c] of two columns where it is a stable pivot.
    fn block(&self, k: usize, r: usize, active: &[usize]) -> Option<[f64; 3]> {
        let m = self.index.len();
        let (a, b, c) = (self.value[k + k * m], self.value[r + k * m], self.value[r + r * m]);
        let det = a * c - b * b;
        let (of_k, of_r) = (self.largest(k, active, r).1, self.largest(r, active, k).1);
        let most = (c.abs() * of_k + b.abs() * of_r).max(b.abs() * of_k + a.abs() * of_r);
        let is_noise = det.abs() <= PIVOT_ROUNDING * f64::EPSILON * ((a * c).abs() + b * b);
        (!is_noise && most * PIVOT <= det.abs()).then_some([a, b, c])
    }

    fn clear_one(&mut self, k: usize, d: f64, active: &[usize], size: &mut [f64]) {
        let m = self.index.len();
        let column: Vec<f64> = active.iter().map(|i| self.value[i + k * m]).collect();
        for (j, v) in active.iter().zip(&column).filter(|(_, v)| **v != 0.0) {
            let factor = v / d;
            for (i, u) in active.iter().zip(&column) {
                self.value[i + j * m] -= u * factor;
            }
            size[self.index[*j]] = size[self.index[*j]].max((v * factor).abs());
        }
    }

    fn clear_two(&mut self, (k, r): (usize, usize), [a, b, c]: [f64; 3], active: &[usize], size: &mut [f64]) {
        let m = self.index.len();
        let det = a * c - b * b;
        let pair = |i: &usize| (self.value[i + k * m], self.value[i + r * m]);
        let columns: Vec<(f64, f64)> = active.iter().map(pair).collect();
        for (j, (u, v)) in active.iter().zip(&columns).filter(|(_, p)| p.0 != 0.0 || p.1 != 0.0) {
            let (x, y) = ((c * u - b * v) / det, (a * v - b * u) / det);
            for (i, (p, q)) in active.iter().zip(&columns) {
                self.value[i + j * m] -= p * x + q * y;
            }
            size[self.index[*j]] = size[self.index[*j]].max((u * x).abs() + (v * y).abs());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use faer::Mat;
    use rand::{Rng, SeedableRng};

    fn tridiagonal(n: usize, diagonal: f64) -> Csc {
        let own = (0..n).map(|i| (i, i, diagonal));
        let beside = (1..n).flat_map(|i| [(i, i - 1, -1.0), (i - 1, i, -1.0)]);
        Csc::from_entries(n, n, own.chain(beside).collect())
    }

    #[test]
    fn a_chain_is_counted_at_any_shift() {
        let n = 50;
        // eigenvalues 2 - 2 cos(j pi / (n + 1)); j = (n + 1) / 3 makes 1, where the matrix is singular and nothing can be counted
        let exact = |j: usize| 2.0 - 2.0 * (std::f64::consts::PI * j as f64 / (n + 1) as f64).cos();
        for shift in [0.05, 0.9, 1.1, 2.0, 2.1, 3.9] {
            let below = (1..=n).filter(|j| exact(*j) < shift).count();
            assert_eq!(negative_eigenvalues(&tridiagonal(n, 2.0 - shift)), Some(below));
        }
        assert_eq!(negative_eigenvalues(&tridiagonal(n, 2.0 - 1.0)), None);
    }

    /// [[-sigma M, G^T], [G, -F]] with graded F, zeros among them, in a random order.
    #[test]
    fn saddle_points_are_counted() {
        let mut rng = rand_pcg::Pcg64::seed_from_u64(11);
        for trial in 0..40 {
            let (n, rows) = (24 + trial % 9, 13 + trial % 8);
            let all = n + rows;
            let mut dense = Mat::<f64>::zeros(all, all);
            for i in 0..n {
                dense[(i, i)] = -10f64.powf(rng.random_range(-4.0..1.0));
            }
            for r in 0..rows {
                for _ in 0..3 {
                    let (c, v) = (rng.random_range(0..n), rng.random_range(-1.0..1.0));
                    dense[(n + r, c)] = v;
                    dense[(c, n + r)] = v;
                }
                dense[(n + r, n + r)] = if r % 3 == 0 { 0.0 } else { -10f64.powf(rng.random_range(-5.0..0.0)) };
                // one of its own, so that no constraint repeats another
                dense[(n + r, r % n)] += 1.3;
                dense[(r % n, n + r)] += 1.3;
            }
            let mut order: Vec<usize> = (0..all).collect();
            for i in (1..all).rev() {
                order.swap(i, rng.random_range(0..=i));
            }
            let places = (0..all).flat_map(|j| (0..all).map(move |i| (i, j)));
            let entries = places.map(|(i, j)| (i, j, dense[(order[i], order[j])])).filter(|e| e.2 != 0.0);
            let sparse = Csc::from_entries(all, all, entries.collect());
            let values = dense.self_adjoint_eigenvalues(faer::Side::Lower).unwrap();
            let below = values.iter().filter(|v| **v < 0.0).count();
            assert_eq!(negative_eigenvalues(&sparse), Some(below), "trial {trial}");
        }
    }
}
