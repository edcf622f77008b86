//! Poles of a damped system whose matrices have a narrow band, without its modes.
use faer::c64;

use super::linear_system::LinearSystem;
use crate::linalg::dense::symmetrised;
use crate::linalg::eigen;
use crate::run::Counts;
use crate::tolerances::frequency_response::NARROW_ROOTS;
use crate::tolerances::modes::{CLEARLY_REGULAR, COMMUTING};

/// All poles, from the natural frequencies without damping on; None where modes are known as fast or have to be asked: where damping couples
/// none of them, where something may be rigid, where a root is real.
pub fn poles(system: &LinearSystem, counts: &mut Counts) -> Option<Vec<c64>> {
    if system.given().is_undamped() {
        return None;
    }
    let n = system.size();
    let band = system.band().filter(|band| (band.half_bandwidth() + 1).pow(2) as f64 <= NARROW_ROOTS * n as f64)?;
    if band.commutator() <= COMMUTING || !system.second_order().is_ok_and(|given| given.is_symmetric()) {
        return None;
    }
    let form = system.normal()?;
    let (k, c) = (symmetrised(form.s.clone()), form.d.as_ref()?);
    counts.add("symmetric eigenvalues", 1);
    let lambda = eigen::symmetric_values(k.as_ref()).ok()?;
    if lambda[0] <= CLEARLY_REGULAR * lambda[n - 1] {
        return None;
    }
    let decay = 0.5 * (0..n).map(|i| c[(i, i)]).sum::<f64>() / n as f64;
    // two that are equal go different ways
    let near = |(k, lambda): (usize, &f64)| {
        let decay = (decay * [0.9, 1.1][k % 2]).clamp(0.0, 0.5 * lambda.sqrt());
        c64::new(-decay, (lambda - decay * decay).sqrt())
    };
    let mut roots = band.roots(lambda.iter().enumerate().map(near).collect())?;
    counts.add("determinants", roots.determinants);
    roots.upper.sort_by(|a, b| a.norm().total_cmp(&b.norm()));
    Some(roots.upper.iter().flat_map(|s| [*s, s.conj()]).collect())
}

#[cfg(test)]
mod tests {
    use faer::Mat;

    use super::*;
    use crate::run::Cancel;
    use crate::second_order::frf::Route;
    use crate::second_order::linear_system::Matrices;
    use crate::second_order::ports::Ports;

    /// A chain with dampers to the ground and weak springs between masses that are up to `half` apart.
    fn chain(n: usize, half: usize) -> LinearSystem {
        let spring = |i: usize, j: usize| match i.abs_diff(j) {
            0 => 2.0 + 0.02 * (half - 1) as f64,
            1 => -1.0,
            apart if apart <= half => -0.01,
            _ => 0.0,
        };
        let c = Mat::from_fn(n, n, |i, j| if i == j { 0.01 * (1.0 + (i as f64).sin()) } else { 0.0 });
        let k = Mat::from_fn(n, n, spring);
        LinearSystem::new(Matrices { m: Mat::identity(n, n), c: Some(c), g: None, k, n: None }).unwrap()
    }

    #[test]
    fn poles_of_narrow_bands_need_no_modes() {
        let mut counts = Counts::default();
        let found = [13, 14, 15].map(|half| {
            let system = chain(240, half);
            assert_eq!(system.band().map(|band| band.half_bandwidth()), Some(half));
            poles(&system, &mut counts).map_or(0, |poles| poles.len())
        });
        assert_eq!(found, [480, 480, 0]);
    }

    #[test]
    fn modes_are_worth_their_time_for_very_many_frequencies() {
        let n = 40;
        let ports = Ports {
            l: Mat::from_fn(1, n, |_, j| (j + 1 == n) as u8 as f64),
            f: Mat::from_fn(n, 1, |i, _| (i == 0) as u8 as f64),
            order_in: vec![0],
            order_out: 0,
            d0: None,
        };
        let route = |count: usize| {
            let omega: Vec<f64> = (1..=count).map(|k| 2.0 * k as f64 / count as f64).collect();
            chain(n, 1).evaluate(&ports, &omega, None, true, &Cancel::default()).unwrap().route
        };
        assert_eq!((route(100), route(2000), route(2300)), (Route::Banded, Route::Banded, Route::ComplexModes));
    }
}
