//! Sizes of the rows of the residual: what a residual is measured against before a solution is accepted.
//!
//! A row is one harmonic of the equation of one coordinate. Its size is the sum of its absolute terms, each coefficient replaced by the
//! largest one of its coordinate, so that a change of all coordinates by a part tau of themselves changes no row by more than tau
//! times its size. Rows that vanish by symmetry are measured against the natural force of their connected part: with the energy E of
//! the part, the largest of size times amplitude, that of coordinate i is sqrt(E |S_ii|), whatever the units.
use super::problem::Problem;

/// Of one row.
#[derive(Debug, Clone, Copy, Default)]
pub struct Size {
    pub terms: f64,
    /// sizes of what the entries of S are summed of, times amplitudes
    pub grown: f64,
    /// what rounding is in proportion to
    pub rounding: f64,
}

/// Of all rows, in the order of the residual, given the sizes of the entries of S per term.
pub fn sizes(problem: &Problem, y: &[f64], entries: &[Vec<f64>]) -> Vec<Size> {
    let amplitude = amplitudes(problem, y);
    let mut by_term = sums(problem, &amplitude, entries);
    add_natural_forces(problem, &amplitude, &mut by_term);
    in_order(&by_term)
}

/// The same without natural forces: what rows are summed of.
pub fn own_sizes(problem: &Problem, y: &[f64], entries: &[Vec<f64>]) -> Vec<Size> {
    in_order(&sums(problem, &amplitudes(problem, y), entries))
}

/// The largest coefficient of each coordinate.
fn amplitudes(problem: &Problem, y: &[f64]) -> Vec<f64> {
    let n = problem.n();
    (0..n).map(|i| y.iter().skip(i).step_by(n).fold(0.0_f64, |a, x| a.max(x.abs()))).collect()
}

/// The unknowns: the constant term, then cosine and sine of each harmonic.
fn in_order(by_term: &[Vec<Size>]) -> Vec<Size> {
    let mut out = by_term[0].clone();
    for rows in &by_term[1..] {
        out.extend_from_slice(rows);
        out.extend_from_slice(rows);
    }
    out
}

/// Sizes of what rows are summed of, per term and coordinate.
fn sums(problem: &Problem, amplitude: &[f64], entries: &[Vec<f64>]) -> Vec<Vec<Size>> {
    let n = problem.n();
    let mut pushes = vec![0.0; n];
    for (direction, push) in problem.pushes() {
        for &(i, w) in direction {
            pushes[i] += w.abs() * push;
        }
    }
    let mut by_term: Vec<Vec<Size>> = Vec::new();
    for (j, block) in problem.blocks().iter().enumerate() {
        let factor = problem.force_factor(j).0.abs();
        let row = |i: usize| {
            let s = &block.s[i * n..][..n];
            let linear: f64 = s.iter().zip(amplitude).map(|(s, a)| s.norm() * a).sum();
            let grown: f64 = entries[j][i * n..][..n].iter().zip(amplitude).map(|(size, a)| size * a).sum();
            let terms = linear + pushes[i] + block.force[i].norm() * factor;
            Size { terms, grown, rounding: terms + grown }
        };
        by_term.push((0..n).map(row).collect());
    }
    by_term
}

fn add_natural_forces(problem: &Problem, amplitude: &[f64], by_term: &mut [Vec<Size>]) {
    let part = parts(problem);
    let mut energy = vec![0.0_f64; amplitude.len()];
    for rows in by_term.iter() {
        for (i, row) in rows.iter().enumerate() {
            energy[part[i]] = energy[part[i]].max(row.terms * amplitude[i]);
        }
    }
    let n = amplitude.len();
    for (block, rows) in problem.blocks().iter().zip(by_term) {
        for (i, row) in rows.iter_mut().enumerate() {
            row.rounding += (energy[part[i]] * block.s[i * n + i].norm()).sqrt();
        }
    }
}

/// Per coordinate the first one of its connected part: coupled by an entry of S or by an element.
fn parts(problem: &Problem) -> Vec<usize> {
    let n = problem.n();
    let mut first: Vec<usize> = (0..n).collect();
    for block in problem.blocks() {
        for at in 0..n * n {
            if block.s[at].norm() != 0.0 {
                join(&mut first, at / n, at % n);
            }
        }
    }
    problem.join_by_elements(&mut first);
    (0..n).map(|i| root(&mut first, i)).collect()
}

/// The first one of the part of i.
pub fn root(first: &mut [usize], mut i: usize) -> usize {
    while first[i] != i {
        first[i] = first[first[i]];
        i = first[i];
    }
    i
}

/// i and j are of one part.
pub fn join(first: &mut [usize], i: usize, j: usize) {
    let (a, b) = (root(first, i), root(first, j));
    first[a.max(b)] = a.min(b);
}
