//! Which Fourier terms represent a motion, and how their frequencies depend on the base frequencies.
use super::grid::{Grid, Slot};

/// x(t) = a_0 + sum_j a_j cos(phi_j) + b_j sin(phi_j), phi_j = (k_j . omega) t / subharmonic. One of each pair +-k is kept.
#[derive(Debug, Clone)]
pub struct Basis {
    pub indices: Vec<Vec<i32>>,
    pub subharmonic: f64,
}

impl Basis {
    pub fn periodic(harmonics: &[i32], subharmonic: i32) -> Basis {
        Basis { indices: harmonics.iter().map(|&h| vec![h]).collect(), subharmonic: f64::from(subharmonic) }
    }

    pub fn n_harmonics(&self) -> usize {
        self.indices.len()
    }

    /// Coefficients per coordinate: 2 n + 1.
    pub fn n_coefficients(&self) -> usize {
        2 * self.indices.len() + 1
    }

    /// d(k.omega)/d omega_i of every term.
    pub fn slope(&self, i: usize) -> Vec<f64> {
        self.indices.iter().map(|k| f64::from(k[i]) / self.subharmonic).collect()
    }

    /// Circular frequency of every term.
    pub fn frequencies(&self, omega: &[f64]) -> Vec<f64> {
        let dot = |k: &Vec<i32>| k.iter().zip(omega).map(|(&k, w)| f64::from(k) * w).sum::<f64>();
        self.indices.iter().map(|k| dot(k) / self.subharmonic).collect()
    }

    /// Largest |k_i| per dimension.
    pub fn reach(&self) -> Vec<usize> {
        let p = self.indices.first().map_or(1, Vec::len);
        (0..p).map(|i| self.indices.iter().map(|k| k[i].unsigned_abs() as usize).max().unwrap_or(0)).collect()
    }

    /// The same terms and more of them.
    pub fn extended(&self, extra: &[Vec<i32>]) -> Basis {
        let mut indices = self.indices.clone();
        indices.extend_from_slice(extra);
        Basis { indices, subharmonic: self.subharmonic }
    }
}

/// Terms and samples per dimension of an error estimate.
#[derive(Debug, Clone)]
pub struct Finer {
    pub extra: Vec<Vec<i32>>,
    pub dims: Vec<usize>,
}

/// Where on a grid the terms of a basis lie, and the terms k_j - k_h and k_j + k_h of its products.
pub struct Slots {
    pub own: Vec<Slot>,
    /// (j, h) row by row, index 0 being the constant
    pub minus: Vec<Slot>,
    pub plus: Vec<Slot>,
    /// for terms whose last index is zero both signs lie in the half spectrum
    pub mirror: Vec<Option<Slot>>,
}

impl Slots {
    pub fn new(basis: &Basis, grid: &Grid) -> Slots {
        let p = grid.dims().len();
        let zero = vec![0; p];
        let all: Vec<&Vec<i32>> = std::iter::once(&zero).chain(&basis.indices).collect();
        let combine = |j: &[i32], h: &[i32], sign: i32| -> Slot {
            let sum: Vec<i32> = j.iter().zip(h).map(|(a, b)| a + sign * b).collect();
            grid.slot(&sum)
        };
        let table = |sign: i32| -> Vec<Slot> {
            all.iter().flat_map(|j| all.iter().map(move |h| (j, h))).map(|(j, h)| combine(j, h, sign)).collect()
        };
        let negative = |k: &Vec<i32>| -> Vec<i32> { k.iter().map(|k| -k).collect() };
        Slots {
            own: basis.indices.iter().map(|k| grid.slot(k)).collect(),
            minus: table(-1),
            plus: table(1),
            mirror: basis.indices.iter().map(|k| (k[p - 1] == 0).then(|| grid.slot(&negative(k)))).collect(),
        }
    }
}
