//! Z(w) = S - w^2 M + i w D of matrices whose entries lie near the diagonal, solved at several w at once, one lane each.
//!
//! Without pivots, so that all lanes do the same; a leading block may be near its own resonance then, and what an elimination has lost
//! shows in the residual, is corrected, and is told where it cannot be.
use super::band_order::order;
use super::complex_lanes::{LANES, Lanes, Reals, add_square, squares};
use super::widest::widest;
use crate::tolerances::matrices::{BACKWARD, CORRECTIONS};

/// M, D, S in an order in which their entries lie near the diagonal.
#[derive(Debug, Clone)]
pub struct Band {
    n: usize,
    half: usize,
    /// new place of each old index
    place: Vec<usize>,
    /// M, D, S by rows of 2 half + 1 entries
    entry: Vec<[f64; 3]>,
}

/// Row, column and the entries of M, D, S there.
pub type Entry = (usize, usize, [f64; 3]);

impl Band {
    /// None where the half-bandwidth that was found exceeds `most`.
    pub fn new(n: usize, entries: &[Entry], most: usize) -> Option<Band> {
        let mut neighbours = vec![Vec::new(); n];
        for &(i, j, _) in entries.iter().filter(|(i, j, _)| i != j) {
            neighbours[i].push(j);
            neighbours[j].push(i);
        }
        for own in &mut neighbours {
            own.sort_unstable();
            own.dedup();
        }
        let mut place = vec![0; n];
        for (new, old) in order(&neighbours).into_iter().enumerate() {
            place[old] = new;
        }
        let half = entries.iter().map(|(i, j, _)| place[*i].abs_diff(place[*j])).max().unwrap_or(0);
        if half > most {
            return None;
        }
        let width = 2 * half + 1;
        let mut entry = vec![[0.0; 3]; n * width];
        for &(i, j, parts) in entries {
            let own = &mut entry[place[i] * width + half + place[j] - place[i]];
            for (own, part) in own.iter_mut().zip(parts) {
                *own += part;
            }
        }
        Some(Band { n, half, place, entry })
    }

    pub fn size(&self) -> usize {
        self.n
    }

    pub fn half_bandwidth(&self) -> usize {
        self.half
    }

    /// New places of the old indices.
    pub fn place(&self) -> &[usize] {
        &self.place
    }

    /// Complex products of one factorisation, and of one right side with its residual, for one lane.
    pub fn products(&self) -> (usize, usize) {
        (self.n * (self.half + 1) * (self.half + 1), 2 * self.n * (2 * self.half + 1))
    }

    /// S + s D + s^2 M, by rows.
    pub fn at(&self, s: &Lanes) -> Vec<Lanes> {
        let square = s.times(s);
        self.each(|[m, d, stiffness]| {
            let mut z = Lanes::real(stiffness);
            z.add_scaled(d, s);
            z.add_scaled(m, &square);
            z
        })
    }

    /// D + 2 s M, by rows.
    pub fn slopes_at(&self, s: &Lanes) -> Vec<Lanes> {
        self.each(|[m, d, _]| {
            let mut z = Lanes::real(d);
            z.add_scaled(2.0 * m, s);
            z
        })
    }

    /// M, by rows.
    pub fn masses(&self) -> Vec<Lanes> {
        self.each(|[m, ..]| Lanes::real(m))
    }

    /// D M^-1 S - S M^-1 D of symmetric matrices at a vector that sees all of them, over the size of its terms: zero where the modes without
    /// damping are those with it.
    pub fn commutator(&self) -> f64 {
        let vector: Vec<Lanes> = (0..self.n).map(|i| Lanes::real((2.399_963 * i as f64).sin() + 1.5)).collect();
        let masses = Band { entry: self.entry.iter().map(|[m, ..]| [0.0, 0.0, *m]).collect(), ..self.clone() };
        let factored = masses.factored(&[0.0; LANES]);
        let after = |first: usize, second: usize| {
            let x = factored.solve(&self.times(first, &vector)).x;
            self.times(second, &x)
        };
        let (one, other) = (after(1, 2), after(2, 1));
        let apart = |(a, b): (&Lanes, &Lanes)| (a.re[0] - b.re[0]).powi(2);
        let left: f64 = one.iter().zip(&other).map(apart).sum();
        (left / (squares(&one)[0] + squares(&other)[0])).sqrt()
    }

    /// A product with M, D or S.
    fn times(&self, part: usize, x: &[Lanes]) -> Vec<Lanes> {
        let (n, half) = (self.n, self.half);
        let row = |i: usize| {
            let mut sum = Lanes::ZERO;
            let (from, to) = (i.saturating_sub(half), (i + half).min(n - 1));
            let entries = &self.entry[i * (2 * half + 1) + half + from - i..];
            entries.iter().zip(&x[from..=to]).for_each(|(e, x)| sum.add_scaled(e[part], x));
            sum
        };
        (0..n).map(row).collect()
    }

    fn each(&self, of: impl Fn([f64; 3]) -> Lanes) -> Vec<Lanes> {
        self.entry.iter().map(|e| of(*e)).collect()
    }

    /// Z at these frequencies.
    pub fn factored(&self, w: &Reals) -> Factored<'_> {
        self.factored_in(w, Memory::default())
    }

    /// The same in memory that is at hand.
    pub fn factored_in(&self, w: &Reals, mut memory: Memory) -> Factored<'_> {
        memory.lu.resize(self.entry.len(), Lanes::ZERO);
        widest!(|_| factorise(self, w, &mut memory.lu));
        Factored { band: self, w: *w, lu: memory.lu, sizes: memory.sizes }
    }

    /// The matrices with rows and columns exchanged.
    pub fn transposed(&self) -> Band {
        let mut entry = vec![[0.0; 3]; self.entry.len()];
        for i in 0..self.n {
            for j in i.saturating_sub(self.half)..=(i + self.half).min(self.n - 1) {
                entry[self.at_place(j, i)] = self.entry[self.at_place(i, j)];
            }
        }
        Band { entry, place: self.place.clone(), ..*self }
    }

    fn at_place(&self, i: usize, j: usize) -> usize {
        i * (2 * self.half + 1) + self.half + j - i
    }
}

/// Factors of Z: L (units on its diagonal) and U (inverses on its diagonal), by rows of 2 half + 1.
pub struct Factored<'a> {
    band: &'a Band,
    w: Reals,
    lu: Vec<Lanes>,
    sizes: Vec<Reals>,
}

/// What a factorisation needs, to be used again.
#[derive(Default)]
pub struct Memory {
    lu: Vec<Lanes>,
    sizes: Vec<Reals>,
}

/// X of Z X = F, (n, columns) by rows in the order of the band.
pub struct Solved {
    pub x: Vec<Lanes>,
    /// what is left of F is no more than rounding, row by row
    pub right: [bool; LANES],
}

impl Factored<'_> {
    pub fn solve(&self, f: &[Lanes]) -> Solved {
        let columns = f.len() / self.band.n;
        let mut x = f.to_vec();
        let mut left = Remainder { residual: f.to_vec(), count: [0.0; LANES] };
        self.substitute(&mut x, columns);
        for pass in 0..=CORRECTIONS {
            widest!(|_| remainder(self, columns, f, &x, &mut left));
            if pass == CORRECTIONS || left.count.iter().all(|l| *l == 0.0) {
                break;
            }
            self.substitute(&mut left.residual, columns);
            x.iter_mut().zip(&left.residual).for_each(|(x, r)| x.add(r));
        }
        Solved { x, right: left.count.map(|l| l == 0.0) }
    }

    /// X = Z^-1 F in the place of F, not corrected, and with the rows of Y beside it Y^T Z' X, where Z' = i D - 2 w M is the slope of Z,
    /// and |Y|^T |L| |U| |X|: what rounding of Y^T F and of Y^T Z X is in proportion to (N. J. Higham, Accuracy and Stability of Numerical
    /// Algorithms, 2nd ed., SIAM 2002, theorem 9.4). Without Y it is X; a row of Y may be longer than `rows`.
    pub fn weighed(&mut self, x: &mut [Lanes], y: Option<&[Lanes]>, rows: usize) -> Vec<(Lanes, Reals)> {
        let columns = x.len() / self.band.n;
        let mut sums = vec![(Lanes::ZERO, [0.0; LANES]); rows * columns];
        let mut sizes = std::mem::take(&mut self.sizes);
        sizes.resize(x.len(), [0.0; LANES]);
        self.substitute(x, columns);
        widest!(|_| {
            absolute(self, columns, x, &mut sizes);
            weigh(self, y.unwrap_or(x), (rows, columns), x, &sizes, &mut sums);
        });
        self.sizes = sizes;
        sums
    }

    fn substitute(&self, x: &mut [Lanes], columns: usize) {
        widest!(|_| substitute(self, columns, x));
    }

    /// Squares of the Frobenius norm of Z.
    pub fn norm_squared(&self) -> Reals {
        let mut out = [0.0; LANES];
        widest!(|_| {
            for e in &self.band.entry {
                add_square(&mut out, &Lanes::dynamic(*e, &self.w));
            }
        });
        out
    }

    /// What `factored_in` was given.
    pub fn into_memory(self) -> Memory {
        Memory { lu: self.lu, sizes: self.sizes }
    }
}

/// F - Z X.
struct Remainder {
    residual: Vec<Lanes>,
    /// entries that exceed rounding of their terms
    count: Reals,
}

#[inline(always)]
fn fill(entry: &[[f64; 3]], w: &Reals, z: &mut [Lanes]) {
    for (z, e) in z.iter_mut().zip(entry) {
        *z = Lanes::dynamic(*e, w);
    }
}

/// L and U, see `Factored`; a row of Z is computed when it is first needed.
#[inline(always)]
fn factorise(band: &Band, w: &Reals, lu: &mut [Lanes]) {
    let (n, half) = (band.n, band.half);
    let width = 2 * half + 1;
    fill(&band.entry[..half * width], w, &mut lu[..half * width]);
    for k in 0..n {
        let new = ((k + half) * width).min(lu.len())..((k + half + 1) * width).min(lu.len());
        fill(&band.entry[new.clone()], w, &mut lu[new]);
        let (done, below) = lu.split_at_mut((k + 1) * width);
        let row = &mut done[k * width..];
        row[half] = row[half].inverse();
        let last = half.min(n - 1 - k);
        for down in 1..=last {
            // column k of row k + down lies `down` before its diagonal
            let own = &mut below[(down - 1) * width..down * width];
            let l = own[half - down].times(&row[half]);
            own[half - down] = l;
            for right in 1..=last {
                own[half - down + right].subtract(&l, &row[half + right]);
            }
        }
    }
}

#[inline(always)]
fn substitute(own: &Factored<'_>, columns: usize, x: &mut [Lanes]) {
    let (n, half) = (own.band.n, own.band.half);
    let width = 2 * half + 1;
    for i in 0..n {
        let row = &own.lu[i * width..(i + 1) * width];
        let (above, rest) = x.split_at_mut(i * columns);
        for back in 1..=half.min(i) {
            let other = &above[(i - back) * columns..(i - back + 1) * columns];
            for (x, o) in rest[..columns].iter_mut().zip(other) {
                x.subtract(&row[half - back], o);
            }
        }
    }
    for i in (0..n).rev() {
        let row = &own.lu[i * width..(i + 1) * width];
        let (above, below) = x.split_at_mut((i + 1) * columns);
        let mine = &mut above[i * columns..];
        for on in 1..=half.min(n - 1 - i) {
            for (x, o) in mine.iter_mut().zip(&below[(on - 1) * columns..on * columns]) {
                x.subtract(&row[half + on], o);
            }
        }
        for x in mine {
            *x = x.times(&row[half]);
        }
    }
}

/// |U| |X|
#[inline(always)]
fn absolute(own: &Factored<'_>, columns: usize, x: &[Lanes], sizes: &mut [Reals]) {
    let (n, half) = (own.band.n, own.band.half);
    for i in 0..n {
        let row = &own.lu[own.band.at_place(i, i)..][..=half.min(n - 1 - i)];
        for c in 0..columns {
            let mut column = x[i * columns + c..].iter().step_by(columns);
            let mut sum = column.next().map_or([0.0; LANES], Lanes::size);
            let inverse = row[0].size();
            (0..LANES).for_each(|l| sum[l] /= inverse[l]);
            for (u, x) in row[1..].iter().zip(column) {
                add_sizes(&mut sum, &u.size(), &x.size());
            }
            sizes[i * columns + c] = sum;
        }
    }
}

#[inline(always)]
fn add_sizes(sum: &mut Reals, a: &Reals, b: &Reals) {
    for l in 0..LANES {
        sum[l] += a[l] * b[l];
    }
}

/// Adds Y^T Z' X and |Y|^T |L| times the sizes.
#[inline(always)]
fn weigh(
    own: &Factored<'_>,
    y: &[Lanes],
    (rows, columns): (usize, usize),
    x: &[Lanes],
    sizes: &[Reals],
    sums: &mut [(Lanes, Reals)],
) {
    let (n, half) = (own.band.n, own.band.half);
    let long = y.len() / n;
    for i in 0..n {
        let (from, to) = (i.saturating_sub(half), (i + half).min(n - 1));
        let at = own.band.at_place(i, from);
        let (entries, lower) = (&own.band.entry[at..][..=to - from], &own.lu[at..][..i - from]);
        for c in 0..columns {
            let moved = slope_times(entries, &own.w, x[from * columns + c..].iter().step_by(columns));
            let mut size = sizes[i * columns + c];
            for (l, s) in lower.iter().zip(sizes[from * columns + c..].iter().step_by(columns)) {
                add_sizes(&mut size, &l.size(), s);
            }
            for (row, y) in y[i * long..][..rows].iter().enumerate() {
                let (sum, rounding) = &mut sums[row * columns + c];
                sum.add_product(y, &moved);
                add_sizes(rounding, &y.size(), &size);
            }
        }
    }
}

/// A row of Z' X = i D X - 2 w M X.
#[inline(always)]
fn slope_times<'a>(entries: &[[f64; 3]], w: &Reals, x: impl Iterator<Item = &'a Lanes>) -> Lanes {
    let (mut masses, mut damping) = (Lanes::ZERO, Lanes::ZERO);
    for ([m, d, _], x) in entries.iter().zip(x) {
        damping.add_scaled(*d, x);
        if *m != 0.0 {
            masses.add_scaled(*m, x);
        }
    }
    let mut out = Lanes::ZERO;
    for (l, w) in w.iter().enumerate() {
        out.re[l] = -2.0 * w * masses.re[l] - damping.im[l];
        out.im[l] = damping.re[l] - 2.0 * w * masses.im[l];
    }
    out
}

/// F - Z X and where an entry exceeds rounding of the terms that it is the sum of.
#[inline(always)]
fn remainder(own: &Factored<'_>, columns: usize, f: &[Lanes], x: &[Lanes], left: &mut Remainder) {
    let (n, half) = (own.band.n, own.band.half);
    left.count = [0.0; LANES];
    for i in 0..n {
        let (from, to) = (i.saturating_sub(half), (i + half).min(n - 1));
        let entries = &own.band.entry[own.band.at_place(i, from)..];
        for c in 0..columns {
            let mut sum = f[i * columns + c];
            let mut terms = sum.size();
            for (e, x) in entries.iter().zip(x[from * columns + c..=to * columns + c].iter().step_by(columns)) {
                let z = Lanes::dynamic(*e, &own.w);
                sum.subtract(&z, x);
                let (z, x) = (z.size(), x.size());
                for l in 0..LANES {
                    terms[l] += z[l] * x[l];
                }
            }
            let size = sum.size();
            for l in 0..LANES {
                // NaN is left, too
                left.count[l] += if size[l] <= BACKWARD * terms[l] + f64::MIN_POSITIVE { 0.0 } else { 1.0 };
            }
            left.residual[i * columns + c] = sum;
        }
    }
}

#[cfg(test)]
mod tests {
    use faer::prelude::*;
    use faer::{Mat, c64};

    use super::*;

    /// A multiplicative congruential generator: numbers in (-1, 1).
    struct Random(u64);

    impl Random {
        fn next(&mut self) -> f64 {
            self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (self.0 >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
        }

        fn below(&mut self, n: usize) -> usize {
            (0.5 * (self.next() + 1.0) * n as f64) as usize % n
        }
    }

    /// An unsymmetric system of this half-bandwidth with shuffled rows and rows of sizes 10^-spread to 10^spread.
    fn example(random: &mut Random, n: usize, half: usize, spread: f64) -> Vec<Entry> {
        let mut name: Vec<usize> = (0..n).collect();
        for i in (1..n).rev() {
            name.swap(i, random.below(i + 1));
        }
        let size: Vec<f64> = (0..n).map(|_| 10.0_f64.powf(spread * random.next())).collect();
        let mut entries = Vec::new();
        for i in 0..n {
            for j in i.saturating_sub(half)..=(i + half).min(n - 1) {
                let own = if i == j { 2.0 * half as f64 + 1.0 } else { 0.0 };
                let parts = [0.3 * random.next() + own, 0.2 * random.next(), random.next() + 2.0 * own];
                entries.push((name[i], name[j], parts.map(|p| p * size[i] * size[j])));
            }
        }
        entries
    }

    fn dense(n: usize, entries: &[Entry], w: f64) -> Mat<c64> {
        let mut z = Mat::zeros(n, n);
        for &(i, j, [m, d, s]) in entries {
            z[(i, j)] += c64::new(s - w * w * m, w * d);
        }
        z
    }

    /// Largest distance from the dense solution over its size, row by row in units of that row, of the lanes that are right.
    fn distance(n: usize, entries: &[Entry], w: &Reals, unit: &[f64], right: &mut usize) -> f64 {
        let band = Band::new(n, entries, n).unwrap();
        let columns = 3;
        let mut f = vec![Lanes::ZERO; n * columns];
        let load = |i: usize, c: usize| if i.is_multiple_of(c + 2) { unit[i] } else { 0.0 };
        for i in 0..n {
            for c in 0..columns {
                f[band.place()[i] * columns + c] = Lanes::real(load(i, c));
            }
        }
        let solved = band.factored(w).solve(&f);
        let mut worst = 0.0_f64;
        for l in (0..LANES).filter(|l| solved.right[*l]) {
            *right += 1;
            let z = dense(n, entries, w[l]);
            let scaled = Mat::from_fn(n, n, |i, j| z[(i, j)] / (unit[i] * unit[j]));
            let expected =
                scaled.partial_piv_lu().solve(Mat::from_fn(n, columns, |i, c| c64::new(load(i, c) / unit[i], 0.0)));
            let error = Mat::from_fn(n, columns, |i, c| {
                let x = &solved.x[band.place()[i] * columns + c];
                c64::new(x.re[l], x.im[l]) * unit[i] - expected[(i, c)]
            });
            worst = worst.max(error.norm_max() / expected.norm_max());
        }
        worst
    }

    #[test]
    fn random_systems_are_solved_as_by_dense_factorisation() {
        let mut random = Random(7);
        let mut right = 0;
        for case in 0..40 {
            let (n, half, spread) = (1 + random.below(60), random.below(7), [0.0, 6.0][case % 2]);
            let entries = example(&mut random, n, half, spread);
            let mut unit = vec![1.0; n];
            for (i, j, parts) in &entries {
                if i == j {
                    unit[*i] = parts[0].sqrt();
                }
            }
            let w: Reals = std::array::from_fn(|l| 0.4 * l as f64);
            let worst = distance(n, &entries, &w, &unit, &mut right);
            assert!(worst < 1e-10, "n = {n}, half = {half}: {worst}");
        }
        assert!(right > 40 * LANES * 9 / 10, "{right}");
    }

    #[test]
    fn a_remainder_counts_from_its_bound_on() {
        let band = Band::new(1, &[(0, 0, [0.0, 0.0, 1.0])], 1).unwrap();
        let own = band.factored(&[0.0; LANES]);
        let counted = |off: f64| {
            let mut left = Remainder { residual: vec![Lanes::ZERO], count: [0.0; LANES] };
            remainder(&own, 1, &[Lanes::real(1.0)], &[Lanes::real(1.0 + off)], &mut left);
            left.count[0] > 0.0
        };
        assert!(!counted(0.0) && !counted(f64::EPSILON) && !counted(1.5e-15));
        assert!(counted(3e-15) && counted(1e-13));
    }

    fn chain(n: usize) -> Vec<Entry> {
        let one = |i: usize| {
            [(i, i, [1.0, 0.0, 2.0]), (i, (i + 1) % n, [0.0, 0.0, -1.0]), ((i + 1) % n, i, [0.0, 0.0, -1.0])]
        };
        (0..n).flat_map(one).filter(|(i, j, _)| i.abs_diff(*j) <= 1).collect()
    }

    #[test]
    fn leading_blocks_in_resonance_are_corrected_or_told() {
        // w^2 = 2 makes every second pivot of a chain zero, and beside it as small as the distance; three lanes are far from it
        let (n, mut right) = (20, 0);
        let w: Reals = std::array::from_fn(|l| {
            [2.0_f64, 2.0 + 1e-3, 2.0 + 1e-6, 2.0 + 1e-9, 2.0 - 1e-12, 0.7, 3.1, 0.5][l].sqrt()
        });
        let worst = distance(n, &chain(n), &w, &vec![1.0; n], &mut right);
        assert!(worst < 1e-11 && right >= 3, "{worst} {right}");
        let exact = [2.0_f64, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
        let entries: Vec<Entry> =
            chain(n).into_iter().map(|(i, j, [_, _, s])| (i, j, [s * (i == j) as u8 as f64, 0.0, s])).collect();
        let band = Band::new(n, &entries, 1).unwrap();
        // S - M of a chain has nothing on its diagonal: regular, but not without pivots
        let solved = band.factored(&exact.map(|w| 0.5 * w)).solve(&vec![Lanes::real(1.0); n]);
        assert_eq!(solved.right, std::array::from_fn(|l| l > 0));
    }

    #[test]
    fn small_motions_far_away_keep_their_digits() {
        // a chain below its band: each mass moves by a constant factor less than the one before
        let n = 80;
        let entries: Vec<Entry> =
            chain(n).into_iter().map(|(i, j, [_, _, s])| (i, j, [0.0, 0.0, if i == j { 20.0 } else { s }])).collect();
        let band = Band::new(n, &entries, 1).unwrap();
        let mut f = vec![Lanes::ZERO; n];
        f[band.place()[0]] = Lanes::real(1.0);
        let solved = band.factored(&[0.0; LANES]).solve(&f);
        let g = 1.0 / (10.0 + 99.0_f64.sqrt());
        for i in 0..n {
            let x = solved.x[band.place()[i]].re[3];
            let expected = g.powi(i as i32 + 1) * (1.0 - g.powi(2 * (n - i) as i32)) / (1.0 - g.powi(2 * n as i32 + 2));
            assert!((x / expected - 1.0).abs() < 1e-12, "{i}: {x} {expected}");
        }
    }

    #[test]
    fn orders_lie_near_the_diagonal() {
        let mut random = Random(3);
        for half in [1, 2, 5] {
            let entries = example(&mut random, 90, half, 0.0);
            let found = Band::new(90, &entries, 90).unwrap().half_bandwidth();
            assert!(half <= found && found <= 2 * half, "{half} {found}");
        }
        // two parts, and one of a single index
        let parts: Vec<Entry> =
            chain(9).into_iter().filter(|(i, j, _)| (*i < 4) == (*j < 4) && i.max(j) < &8).collect();
        assert_eq!(Band::new(9, &parts, 9).unwrap().half_bandwidth(), 1);
        assert!(Band::new(90, &example(&mut random, 90, 5, 0.0), 3).is_none());
    }
}
