//! Stiffness without a potential, as follower loads make it: solved island by island, but for what nothing restrains.
//!
//! Whether an island is restrained its smallest singular value tells, over the size of its stiffness: pivots that vanish exactly do so by
//! chance, in one order of definition and not in another.
use faer::linalg::solvers::PartialPivLu;
use faer::prelude::*;
use nalgebra::{DMatrix, DVector};

use crate::equilibrium::local::Local;
use crate::error::{Error, Result};
use crate::tolerances::equilibrium::{NO_STIFFNESS, PUSHED};

/// Steps of inverse iteration that show the smallest singular value to a few per cent, or to be far away.
const LOOKS: usize = 4;

/// A direction that nothing restrains, over all coordinates, and whether a force works along it.
pub(crate) struct Loose {
    pub direction: DVector<f64>,
    pub is_pushed: bool,
}

/// The stiffness of an island, of the coordinates `own`, each in its weight.
struct Island {
    own: Vec<usize>,
    k: Mat<f64>,
}

/// -K^-1 r for each column of forces; along what nothing restrains not at all.
pub(crate) fn answers(local: &Local, r: &DMatrix<f64>) -> Result<DMatrix<f64>> {
    let mut out = DMatrix::zeros(r.nrows(), r.ncols());
    for island in islands(local) {
        let weight = |i: usize| local.weight[island.own[i]];
        let forces = Mat::from_fn(island.own.len(), r.ncols(), |i, j| -r[(island.own[i], j)] * weight(i));
        let found = match island.factors() {
            Some(lu) => lu.solve(&forces),
            None => island.restrained(&forces)?,
        };
        for (i, at) in island.own.iter().enumerate() {
            (0..r.ncols()).for_each(|j| out[(*at, j)] = found[(i, j)] * weight(i));
        }
    }
    Ok(out)
}

/// The directions that nothing restrains.
pub(crate) fn loose(local: &Local) -> Result<Vec<Loose>> {
    let mut out = Vec::new();
    for island in islands(local).iter().filter(|island| island.factors().is_none()) {
        let (values, left, right) = island.singular()?;
        let none = island.none();
        for k in (0..values.len()).filter(|k| values[*k] <= none) {
            let over = |u: &Mat<f64>| {
                let mut v = DVector::zeros(local.r.len());
                island.own.iter().enumerate().for_each(|(i, at)| v[*at] = u[(i, k)] * local.weight[*at]);
                v
            };
            let (works, direction) = (over(&left), over(&right));
            let push = works.dot(&local.r).abs() / (works.norm() * local.sizes[island.own[0]]);
            out.push(Loose { direction, is_pushed: push > PUSHED });
        }
    }
    Ok(out)
}

fn islands(local: &Local) -> Vec<Island> {
    let mut numbers = local.islands.clone();
    numbers.sort_unstable();
    numbers.dedup();
    let of = |island: usize| {
        let own: Vec<usize> = (0..local.islands.len()).filter(|i| local.islands[*i] == island).collect();
        let w = |i: usize| local.weight[own[i]];
        let k = Mat::from_fn(own.len(), own.len(), |i, j| local.k[(own[i], own[j])] * w(i) * w(j));
        Island { own, k }
    };
    numbers.into_iter().map(of).collect()
}

impl Island {
    /// Singular values up to here are none.
    fn none(&self) -> f64 {
        NO_STIFFNESS * self.k.norm_l2()
    }

    /// Factors of a stiffness that restrains every direction.
    fn factors(&self) -> Option<PartialPivLu<f64>> {
        let lu = self.k.partial_piv_lu();
        let mut x = Mat::from_fn(self.own.len(), 1, |i, _| ((i + 1) as f64).cos());
        let mut growth = 0.0;
        for _ in 0..LOOKS {
            lu.solve_in_place(&mut x);
            lu.solve_transpose_in_place(&mut x);
            growth = x.norm_l2();
            if !growth.is_normal() {
                return None;
            }
            x *= faer::Scale(1.0 / growth);
        }
        (growth.sqrt().recip() > self.none()).then_some(lu)
    }

    fn singular(&self) -> Result<(Vec<f64>, Mat<f64>, Mat<f64>)> {
        let svd = self.k.svd().map_err(|_| Error::singular("the stiffness is not finite"))?;
        let values = svd.S().column_vector().iter().copied().collect();
        Ok((values, svd.U().to_owned(), svd.V().to_owned()))
    }

    /// K^-1 f over the singular values that are more than none.
    fn restrained(&self, forces: &Mat<f64>) -> Result<Mat<f64>> {
        let (values, left, right) = self.singular()?;
        let none = self.none();
        let mut along = left.transpose() * forces;
        for (k, value) in values.iter().enumerate() {
            let factor = if *value > none { value.recip() } else { 0.0 };
            (0..along.ncols()).for_each(|j| along[(k, j)] *= factor);
        }
        Ok(right * along)
    }
}
