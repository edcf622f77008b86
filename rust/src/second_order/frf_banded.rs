//! Transfer functions of systems whose matrices have a narrow band in some order, such as chains: several frequencies at once.
use faer::{Mat, c64};

use super::linear_system::LinearSystem;
use super::ports::Ports;
use crate::linalg::banded::{Band, Entry};
use crate::linalg::complex_lanes::{LANES, Lanes, Reals, squares};
use crate::linalg::quadratic::Quadratic;
use crate::tolerances::frequency_response::{NARROW, RESONANT};

/// L Z^-1 F in coordinates of unit masses.
pub struct Banded<'a> {
    band: &'a Band,
    n_in: usize,
    load: Vec<Lanes>,
    load_squared: f64,
    /// of each output the places that it sees
    outputs: Vec<Vec<(usize, f64)>>,
}

/// The matrices in units of their masses, where their band is narrow.
pub fn band(q: &Quadratic, scale: &[f64]) -> Option<Band> {
    let n = q.n();
    let most = (NARROW * n as f64) as usize;
    let mut entries: Vec<Entry> = Vec::new();
    for j in 0..n {
        for i in 0..n {
            let parts = [q.m[(i, j)], q.d.as_ref().map_or(0.0, |d| d[(i, j)]), q.s[(i, j)]];
            if parts != [0.0; 3] {
                entries.push((i, j, parts.map(|p| p * scale[i] * scale[j])));
            }
        }
        if most == 0 || entries.len() > n * (2 * most + 1) {
            return None;
        }
    }
    Band::new(n, &entries, most)
}

impl<'a> Banded<'a> {
    pub fn new(band: &'a Band, system: &LinearSystem, ports: &Ports) -> Banded<'a> {
        let (n, n_in, scale, place) = (system.size(), ports.n_in(), system.scale(), band.place());
        let mut load = vec![Lanes::ZERO; n * n_in];
        let mut load_squared = 0.0;
        for i in 0..n {
            for j in 0..n_in {
                let f = ports.f[(i, j)] * scale[i];
                load[place[i] * n_in + j] = Lanes::real(f);
                load_squared += f * f;
            }
        }
        let seen = |o: usize| {
            let places = (0..n).filter(|i| ports.l[(o, *i)] != 0.0);
            places.map(|i| (place[i], ports.l[(o, i)] * scale[i])).collect()
        };
        let outputs = (0..ports.n_out()).map(seen).collect();
        Banded { band, n_in, load, load_squared, outputs }
    }

    /// Values at up to `LANES` frequencies; None where rounding is felt or Z is nearly singular.
    pub fn several(&self, w: &[f64]) -> Vec<Option<Mat<c64>>> {
        let all: Reals = std::array::from_fn(|l| w[l.min(w.len() - 1)]);
        let factored = self.band.factored(&all);
        let solved = factored.solve(&self.load);
        let (size, motion) = (factored.norm_squared(), squares(&solved.x));
        let mut values = vec![Lanes::ZERO; self.outputs.len() * self.n_in];
        for (own, places) in values.chunks_exact_mut(self.n_in).zip(&self.outputs) {
            for (place, l) in places {
                for (value, x) in own.iter_mut().zip(&solved.x[place * self.n_in..]) {
                    value.add_scaled(*l, x);
                }
            }
        }
        let one = |l: usize| {
            let calm = motion[l].sqrt() * size[l].sqrt() <= RESONANT * self.load_squared.sqrt();
            let value = |i: usize, j: usize| {
                let v = &values[i * self.n_in + j];
                c64::new(v.re[l], v.im[l])
            };
            (calm && solved.right[l]).then(|| Mat::from_fn(self.outputs.len(), self.n_in, value))
        };
        (0..w.len().min(LANES)).map(one).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::second_order::linear_system::Matrices;

    fn chain(n: usize) -> LinearSystem {
        let k = Mat::from_fn(n, n, |i, j| [2.0, -1.0].get(i.abs_diff(j)).copied().unwrap_or(0.0));
        LinearSystem::new(Matrices { m: Mat::identity(n, n), c: None, g: None, k, n: None }).unwrap()
    }

    #[test]
    fn near_a_resonance_another_route_answers() {
        let n = 40;
        let system = chain(n);
        let ports = Ports {
            l: Mat::from_fn(1, n, |_, j| (j == 0) as u8 as f64),
            f: Mat::from_fn(n, 1, |i, _| (i == 0) as u8 as f64),
            order_in: vec![0],
            order_out: 0,
            d0: None,
        };
        let banded = Banded::new(system.band().unwrap(), &system, &ports);
        let lowest = 2.0 * (0.5 * std::f64::consts::PI / (n + 1) as f64).sin();
        let answers = |apart: f64| banded.several(&[lowest * (1.0 + apart)])[0].is_some();
        // motion times dynamic stiffness over the load is 22 over this distance
        assert!(answers(1e-3) && answers(1e-10) && !answers(4e-12) && !answers(1e-13));
    }

    #[test]
    fn a_band_is_narrow_up_to_its_bound() {
        let half = |n: usize| {
            let tri = Mat::from_fn(n, n, |i, j| (i.abs_diff(j) <= 2) as u8 as f64 + if i == j { 4.0 } else { 0.0 });
            band(&Quadratic::new(Mat::identity(n, n), None, tri), &vec![1.0; n]).map(|b| b.half_bandwidth())
        };
        assert_eq!((half(31), half(32)), (None, Some(2)));
    }
}
