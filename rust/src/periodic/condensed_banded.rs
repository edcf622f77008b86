//! Exact condensation of matrices with a narrow band, eight terms at once: S = Z_rr + Z_rl R with Z_ll R = -Z_lr.
//!
//! There are no pivots: the sizes of the factors bound what rounding may have done to each entry, and terms in which it is felt are left to
//! `condensed`.
use super::condensed::{Entry, Split, is_settled, natural_sizes};
use super::linear::Block;
use crate::linalg::banded::{Band, Memory};
use crate::linalg::complex_lanes::{LANES, Lanes, Reals};
use num_complex::Complex64 as c64;

/// A term and its circular frequency.
pub type Task = (usize, f64);

pub struct Banded {
    right: Band,
    /// of matrices that are not symmetric the transposed ones
    left: Option<Band>,
    /// per term the forces on local coordinates, by their places
    loads: Vec<Vec<(usize, c64)>>,
    memory: Memory,
    x: Vec<Lanes>,
}

/// Entries of S, of its slope and of what rounding is in proportion to; the last column, if there is one, belongs to forces.
struct Sums {
    rows: usize,
    columns: usize,
    s: Vec<Lanes>,
    slope: Vec<Lanes>,
    growth: Vec<Reals>,
}

impl Banded {
    /// None where the half-bandwidth exceeds `most`.
    pub fn new(split: &Split, most: usize) -> Option<Banded> {
        let entries: Vec<_> = split.ll.iter().map(|e| (e.row, e.column, e.parts())).collect();
        let right = Band::new(split.local.len(), &entries, most)?;
        let left = (!split.symmetric).then(|| right.transposed());
        let loads = split.forces.iter().map(|force| match force {
            Some(f) => loads(split, &right, f),
            None => Vec::new(),
        });
        Some(Banded { loads: loads.collect(), right, left, memory: Memory::default(), x: Vec::new() })
    }

    pub fn copied(&self) -> Banded {
        let (right, left, loads) = (self.right.clone(), self.left.clone(), self.loads.clone());
        Banded { right, left, loads, memory: Memory::default(), x: Vec::new() }
    }

    pub fn half_bandwidth(&self) -> usize {
        self.right.half_bandwidth()
    }

    /// Complex products of one factorisation and one solution with so many right sides, for one lane.
    pub fn products(&self, n_r: usize) -> usize {
        let (factorise, solve) = self.right.products();
        (factorise + n_r * solve) * if self.left.is_some() { 2 } else { 1 }
    }

    /// Fills the blocks of up to `LANES` terms; those come back that rounding is felt in.
    pub fn condense(&mut self, split: &Split, tasks: &[Task], blocks: &mut [Block]) -> Vec<Task> {
        let w: Reals = std::array::from_fn(|l| tasks[l.min(tasks.len() - 1)].1);
        let mut x = self.right_sides(split, tasks, &w);
        let left = self.left.as_ref().map(|band| {
            let entries = split.rl.iter().map(|e| (band.place()[e.column], e.row, e));
            let mut f = Vec::new();
            set_sides(&mut f, split.local.len(), split.retained.len(), entries, &w);
            band.factored(&w).solve(&f)
        });
        let mut factored = self.right.factored_in(&w, std::mem::take(&mut self.memory));
        let weighed = factored.weighed(&mut x, left.as_ref().map(|left| left.x.as_slice()), split.retained.len());
        self.memory = factored.into_memory();
        let sums = self.sums(split, &w, weighed, &x, left.as_ref().map_or(&x, |left| &left.x));
        self.x = x;
        let good = |l: usize| left.as_ref().is_none_or(|left| left.right[l]);
        let each = tasks.iter().enumerate();
        each.filter(|(l, (term, w))| !(good(*l) && sums.fill(split, *l, (*term, *w), &mut blocks[*term])))
            .map(|(_, task)| *task)
            .collect()
    }

    /// -Z_lr, and a column of forces where there are any on local coordinates.
    fn right_sides(&mut self, split: &Split, tasks: &[Task], w: &Reals) -> Vec<Lanes> {
        let loads: Vec<&[(usize, c64)]> =
            tasks.iter().map(|(term, _)| self.loads.get(*term).map_or(&[][..], Vec::as_slice)).collect();
        let columns = split.retained.len() + usize::from(loads.iter().any(|load| !load.is_empty()));
        let entries = split.lr.iter().map(|e| (self.right.place()[e.row], e.column, e));
        let mut out = std::mem::take(&mut self.x);
        set_sides(&mut out, split.local.len(), columns, entries, w);
        for (l, load) in loads.iter().enumerate() {
            for (place, force) in *load {
                let own = &mut out[(place + 1) * columns - 1];
                (own.re[l], own.im[l]) = (force.re, force.im);
            }
        }
        out
    }

    fn sums(&self, split: &Split, w: &Reals, weighed: Vec<(Lanes, Reals)>, right: &[Lanes], left: &[Lanes]) -> Sums {
        let n_l = split.local.len();
        let (rows, columns, long) = (split.retained.len(), right.len() / n_l, left.len() / n_l);
        let (slope, growth) = weighed.into_iter().unzip();
        let mut sums = Sums { rows, columns, s: vec![Lanes::ZERO; rows * columns], slope, growth };
        for e in &split.lr {
            let from = self.right.place()[e.row] * long;
            for (i, l) in left[from..from + rows].iter().enumerate() {
                sums.slope[i * columns + e.column].add_product(l, &e.slope_in_lanes(w));
            }
        }
        for e in &split.rl {
            let from = self.right.place()[e.column] * columns;
            sums.add_row(e, w, right[from..from + columns].iter().enumerate());
        }
        for e in &split.rr {
            sums.add_row(e, w, std::iter::once((e.column, &Lanes::real(1.0))));
        }
        sums
    }
}

/// A force on local coordinates by their places.
fn loads(split: &Split, band: &Band, force: &[c64]) -> Vec<(usize, c64)> {
    let each = split.local.iter().zip(band.place()).map(|(old, place)| (*place, force[*old]));
    each.filter(|(_, f)| *f != c64::new(0.0, 0.0)).collect()
}

impl Entry {
    fn parts(&self) -> [f64; 3] {
        [self.m, self.c, self.k]
    }

    fn slope_in_lanes(&self, w: &Reals) -> Lanes {
        Lanes { re: w.map(|w| -2.0 * w * self.m), im: [self.c; LANES] }
    }
}

/// -Z of a border by (place, column, entry), in so many columns.
fn set_sides<'a>(
    f: &mut Vec<Lanes>,
    n: usize,
    columns: usize,
    entries: impl Iterator<Item = (usize, usize, &'a Entry)>,
    w: &Reals,
) {
    f.clear();
    f.resize(n * columns, Lanes::ZERO);
    for (place, column, e) in entries {
        f[place * columns + column].add_scaled(-1.0, &Lanes::dynamic(e.parts(), w));
    }
}

impl Sums {
    /// An entry of the rows of the retained coordinates times what stands in each column.
    fn add_row<'a>(&mut self, e: &Entry, w: &Reals, columns: impl Iterator<Item = (usize, &'a Lanes)>) {
        let (z, slope) = (Lanes::dynamic(e.parts(), w), e.slope_in_lanes(w));
        for (j, x) in columns {
            let at = e.row * self.columns + j;
            self.s[at].add_product(&z, x);
            self.slope[at].add_product(&slope, x);
            let size = x.size();
            (0..LANES).for_each(|l| self.growth[at][l] += e.size(w[l]) * size[l]);
        }
    }

    /// One lane; false where rounding is felt.
    fn fill(&self, split: &Split, lane: usize, (term, w): Task, block: &mut Block) -> bool {
        let number = |z: &Lanes| c64::new(z.re[lane], z.im[lane]);
        let square = |at: usize| at / self.rows * self.columns + at % self.rows;
        for at in 0..self.rows * self.rows {
            block.s[at] = number(&self.s[square(at)]);
            block.s_slope[at] = number(&self.slope[square(at)]);
        }
        block.s_growth = (0..self.rows * self.rows).map(|at| self.growth[square(at)][lane]).collect();
        let force = split.forces.get(term).and_then(Option::as_ref);
        for (i, old) in split.retained.iter().enumerate() {
            let driven = (self.columns > self.rows).then_some((i + 1) * self.columns - 1);
            let of = |part: &[Lanes]| driven.map_or(c64::new(0.0, 0.0), |at| number(&part[at]));
            block.force[i] = force.map_or(c64::new(0.0, 0.0), |f| f[*old]) - of(&self.s);
            block.force_slope[i] = -of(&self.slope);
        }
        is_settled(&block.s_growth, &natural_sizes(w, block))
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use faer::Mat;
    use faer::prelude::Solve;

    use super::*;
    use crate::periodic::condensed::Condensed;
    use crate::periodic::linear::DynamicStiffness;

    fn random(seed: &mut u64) -> f64 {
        *seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (*seed >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// Matrices of a half-bandwidth with general damping, in a random numbering and in units that differ by `decades`; not symmetric
    /// ones have gyroscopic and circulatory terms.
    fn example(n: usize, band: usize, decades: f64, symmetric: bool, seed: &mut u64) -> Vec<Entry> {
        let mut order: Vec<usize> = (0..n).collect();
        for i in (1..n).rev() {
            order.swap(i, (random(seed) * (i + 1) as f64) as usize);
        }
        let unit: Vec<f64> = (0..n).map(|_| 10_f64.powf(decades * (random(seed) - 0.5))).collect();
        let mut out = Vec::new();
        for i in 0..n {
            for j in i..n.min(i + band + 1) {
                let scale = unit[i] * unit[j];
                let mut add = |i: usize, j: usize, m: f64, c: f64, k: f64| {
                    let (row, column) = (order[i], order[j]);
                    out.push(Entry { row, column, m: m * scale, c: c * scale, k: k * scale });
                };
                if i == j {
                    add(i, j, 1.0 + random(seed), 0.1 * random(seed), 2.0 * band as f64 + random(seed));
                    continue;
                }
                let (m, c, k) = (0.1 * random(seed) / band as f64, 0.02 * random(seed) - 0.01, -random(seed));
                let (g, n) = if symmetric { (0.0, 0.0) } else { (random(seed) - 0.5, 0.3 * random(seed)) };
                add(i, j, m, c + g, k + n);
                add(j, i, m, c - g, k - n);
            }
        }
        out
    }

    fn diagonal(entries: &[Entry], i: usize) -> f64 {
        entries.iter().find(|e| e.row == i && e.column == i).map_or(1.0, |e| e.k.sqrt())
    }

    /// S and its slope by dense matrices in units of their diagonals.
    fn exact(n: usize, entries: &[Entry], retained: &[usize], w: f64) -> (Mat<c64>, Mat<c64>) {
        let unit: Vec<f64> = (0..n).map(|i| diagonal(entries, i)).collect();
        let local: Vec<usize> = (0..n).filter(|i| !retained.contains(i)).collect();
        let (mut z, mut slope) = (Mat::<c64>::zeros(n, n), Mat::<c64>::zeros(n, n));
        for e in entries {
            let at = (e.row, e.column);
            z[at] += c64::new(e.k - w * w * e.m, w * e.c) / (unit[e.row] * unit[e.column]);
            slope[at] += c64::new(-2.0 * w * e.m, e.c) / (unit[e.row] * unit[e.column]);
        }
        let part = |a: &Mat<c64>, rows: &[usize], columns: &[usize]| {
            Mat::from_fn(rows.len(), columns.len(), |i, j| a[(rows[i], columns[j])])
        };
        let inner = part(&z, &local, &local).partial_piv_lu();
        let right = -inner.solve(part(&z, &local, retained));
        let left = -part(&z, &local, &local).transpose().partial_piv_lu().solve(part(&z, retained, &local).transpose());
        let s = part(&z, retained, retained) + part(&z, retained, &local) * &right;
        let slope = part(&slope, retained, retained)
            + part(&slope, retained, &local) * &right
            + left.transpose() * (part(&slope, &local, retained) + part(&slope, &local, &local) * &right);
        let scaled = |a: Mat<c64>| {
            Mat::from_fn(a.nrows(), a.ncols(), |i, j| a[(i, j)] * (unit[retained[i]] * unit[retained[j]]))
        };
        (scaled(s), scaled(slope))
    }

    /// The blocks of all terms, and how many of them lanes leave to other means.
    fn blocks(n: usize, entries: &[Entry], retained: &[usize], w: &[f64]) -> (Vec<Block>, usize) {
        let split = Split::new(n, entries, retained.to_vec(), Arc::new(vec![None; w.len()])).unwrap();
        let mut found = vec![Block::new(retained.len()); w.len()];
        let tasks: Vec<Task> = w.iter().copied().enumerate().collect();
        let mut banded = Banded::new(&split, n).unwrap();
        let mut left: Vec<Task> = Vec::new();
        tasks.chunks(LANES).for_each(|some| left.extend(banded.condense(&split, some, &mut found)));
        let mut alone = Condensed::new(Arc::new(split)).unwrap();
        left.iter().for_each(|&(term, w)| alone.evaluate(w, term, &mut found[term]).unwrap());
        (found, left.len())
    }

    /// Largest error of an entry and of a slope in units of the diagonal of S.
    fn worst(n: usize, entries: &[Entry], retained: &[usize], w: &[f64]) -> (f64, usize) {
        let (found, left) = blocks(n, entries, retained, w);
        let (mut worst, n_r) = (0.0_f64, retained.len());
        for (block, w) in found.iter().zip(w) {
            let (s, slope) = exact(n, entries, retained, *w);
            let own = |i: usize| s[(i, i)].norm() + w * slope[(i, i)].norm();
            for i in 0..n_r {
                for j in 0..n_r {
                    let (at, size) = (i * n_r + j, (own(i) * own(j)).sqrt());
                    worst = worst.max((block.s[at] - s[(i, j)]).norm() / size);
                    worst = worst.max(w * (block.s_slope[at] - slope[(i, j)]).norm() / size);
                }
            }
        }
        (worst, left)
    }

    #[test]
    fn eight_frequencies_at_once_are_those_of_dense_matrices() {
        let (mut seed, mut all, mut left) = (7, 0, 0);
        for symmetric in [true, false] {
            for (n, band, decades) in [(12, 1, 0.0), (60, 1, 8.0), (60, 2, 0.0), (50, 5, 12.0), (40, 11, 4.0)] {
                for n_r in [1, 2, 4] {
                    let entries = example(n, band, decades, symmetric, &mut seed);
                    let retained: Vec<usize> = (0..n_r).map(|i| i * n / n_r + 1).collect();
                    let w: Vec<f64> = (0..11).map(|h| 0.37 * h as f64).collect();
                    let (off, others) = worst(n, &entries, &retained, &w);
                    assert!(off < 1e-10, "n {n}, band {band}, 1e{decades}, {n_r} retained: {off:e}");
                    (all, left) = (all + w.len(), left + others);
                }
            }
        }
        assert!(10 * left < all, "{left} of {all} frequencies were left to others");
    }

    #[test]
    fn forces_on_local_coordinates_are_those_of_one_frequency() {
        for symmetric in [true, false] {
            let mut seed = 11;
            let (n, w) = (40, 0.6);
            let entries = example(n, 3, 6.0, symmetric, &mut seed);
            let forces: Vec<Option<Vec<c64>>> = (0..8)
                .map(|h| {
                    let mut f = |i: usize| c64::new(random(&mut seed) - 0.5, random(&mut seed)) * diagonal(&entries, i);
                    (h % 3 > 0).then(|| (0..n).map(&mut f).collect())
                })
                .collect();
            let split = Arc::new(Split::new(n, &entries, vec![3, 20], Arc::new(forces)).unwrap());
            let tasks: Vec<Task> = (0..8).map(|h| (h, w * h as f64)).collect();
            let mut found = vec![Block::new(2); 8];
            assert!(Banded::new(&split, n).unwrap().condense(&split, &tasks, &mut found).is_empty());
            let mut single = Condensed::new(split).unwrap();
            for &(h, w) in &tasks {
                let mut one = Block::new(2);
                single.evaluate(w, h, &mut one).unwrap();
                for j in 0..2 {
                    let unit = diagonal(&entries, [3, 20][j]);
                    assert!((found[h].force[j] - one.force[j]).norm() < 1e-11 * unit, "{h} {j}");
                    assert!((found[h].force_slope[j] - one.force_slope[j]).norm() < 1e-10 * unit, "{h} {j}");
                    assert!(h % 3 == 0 || one.force_slope[j].norm() > 1e-3 * unit, "{h} {j}");
                }
            }
        }
    }

    fn chain(n: usize) -> Vec<Entry> {
        let mut entries = Vec::new();
        for i in 0..n {
            entries.push(Entry { row: i, column: i, m: 1.0, c: 0.0, k: 2.0 });
            if i > 0 {
                entries.push(Entry { row: i, column: i - 1, m: 0.0, c: 0.0, k: -1.0 });
                entries.push(Entry { row: i - 1, column: i, m: 0.0, c: 0.0, k: -1.0 });
            }
        }
        entries
    }

    #[test]
    fn a_small_leading_pivot_is_noticed() {
        // undamped; the first pivot k - w^2 m is small where the coordinate by itself is near its resonance
        for gap in [1e-3, 1e-6, 1e-9, 1e-11] {
            let (off, _) = worst(12, &chain(12), &[11], &[0.5, (2.0_f64 - gap).sqrt(), 1.3]);
            assert!(off < 1e-10, "gap {gap:e}: {off:e}");
        }
        // k - w^2 m = 0 exactly: regular, but not without pivots
        let heavy: Vec<Entry> = chain(13).into_iter().map(|e| Entry { m: 2.0 * e.m, ..e }).collect();
        let split = Split::new(13, &heavy, vec![12], Arc::new(vec![None; 2])).unwrap();
        let mut found = vec![Block::new(1); 2];
        let left = Banded::new(&split, 1).unwrap().condense(&split, &[(0, 0.5), (1, 1.0)], &mut found);
        assert_eq!(left, [(1, 1.0)]);
    }

    #[test]
    fn narrow_bands_are_condensed_in_lanes() {
        let condensed = |n: usize, entries: &[Entry]| {
            Condensed::new(Arc::new(Split::new(n, entries, vec![n / 2], Arc::new(vec![None; 8])).unwrap())).unwrap()
        };
        // eight terms of a chain take less time than two by themselves, up to the length at which memory ends it
        let ratio = |c: Condensed| c.products(8) / c.products(1);
        assert!(ratio(condensed(100, &chain(100))) < 2.5);
        let longest = 500_001;
        assert!(ratio(condensed(longest, &chain(longest))) < 2.5);
        assert!(ratio(condensed(longest + 1, &chain(longest + 1))) == 8.0);
        // a square grid has a wide band, and sparse factors of few entries
        let side = 40;
        let mut grid = Vec::new();
        for i in 0..side * side {
            grid.push(Entry { row: i, column: i, m: 1.0, c: 0.0, k: 4.0 });
            for j in [i + 1, i + side] {
                if j < side * side && (j != i + 1 || j % side > 0) {
                    grid.push(Entry { row: i, column: j, m: 0.0, c: 0.0, k: -1.0 });
                    grid.push(Entry { row: j, column: i, m: 0.0, c: 0.0, k: -1.0 });
                }
            }
        }
        assert!(ratio(condensed(side * side, &grid)) == 8.0);
    }
}
