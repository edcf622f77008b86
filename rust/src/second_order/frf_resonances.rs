//! Resonances of a transfer function, and those that a set of frequencies does not see.
use faer::c64;

use crate::linalg::dense::exceeds;
use crate::tolerances::frequency_response::{SAME_POLE, SHOWS};

/// Poles in a range of rad/s that make a peak (damping ratio below 1/sqrt 2), repeated ones once.
pub fn resonances(poles: &[c64], low: f64, high: f64) -> Vec<c64> {
    let peaks = |p: &c64| low <= p.im && p.im <= high && p.im > p.re.abs();
    let mut found: Vec<c64> = poles.iter().copied().filter(peaks).collect();
    found.sort_by(|a, b| a.im.total_cmp(&b.im).then(a.re.total_cmp(&b.re)));
    found.dedup_by(|p, kept| (*p - *kept).norm() <= SAME_POLE * p.norm());
    found
}

/// Resonances (rad/s) whose half-power band lies between two neighbouring points.
pub fn unseen(poles: &[c64], omega: &[f64]) -> Vec<f64> {
    let mut grid: Vec<f64> = omega.iter().map(|w| w.abs()).collect();
    grid.sort_by(f64::total_cmp);
    grid.dedup();
    let [low, .., high] = grid[..] else { return Vec::new() };
    let inside = |p: &c64| {
        let k = grid.partition_point(|w| *w < p.im);
        grid[k.saturating_sub(1)..(k + 1).min(grid.len())].iter().any(|w| (w - p.im).abs() <= p.re.abs())
    };
    resonances(poles, low, high).into_iter().filter(|p| !inside(p)).map(|p| p.im).collect()
}

/// Those of the suspects (rad/s) whose `peaks` show: H (entries, omega) and peaks (entries, suspects), last index fastest.
pub fn missed(omega: &[f64], h: &[c64], suspects: &[f64], peaks: &[c64]) -> Vec<f64> {
    let mut place: Vec<usize> = (0..omega.len()).collect();
    place.sort_by(|a, b| omega[*a].abs().total_cmp(&omega[*b].abs()));
    let shows = |(s, w): &(usize, &f64)| {
        let k = place.partition_point(|i| omega[*i].abs() < **w);
        let sides = &place[k.saturating_sub(1)..(k + 1).min(place.len())];
        let entries = h.chunks_exact(omega.len()).zip(peaks.chunks_exact(suspects.len()));
        let mut hidden = entries.map(|(own, peak)| {
            let around = sides.iter().map(|i| own[*i].norm()).fold(0.0, f64::max);
            exceeds(peak[*s].norm(), SHOWS * around)
        });
        hidden.any(|hidden| hidden)
    };
    suspects.iter().enumerate().filter(shows).map(|(_, w)| *w).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn poles_make_one_peak_within_their_bound() {
        let count = |apart: f64| resonances(&[c64::new(-0.1, 1.0), c64::new(-0.1, 1.0 + apart)], 0.5, 2.0).len();
        assert!(count(1e-10) == 1 && count(1e-8) == 2);
    }

    #[test]
    fn a_peak_is_told_where_it_exceeds_its_neighbours() {
        let told = |peak: f64| missed(&[1.0, 2.0], &[c64::new(1.0, 0.0); 2], &[1.5], &[c64::new(peak, 0.0)]).len();
        assert!(told(1.01) == 0 && told(1.5) == 1);
    }
}
