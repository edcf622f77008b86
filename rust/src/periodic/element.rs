//! Elements: a law on relative displacements of the coordinates, and what it does to their equations.
use std::sync::Arc;

use faer::Mat;
use num_dual::Dual64;

use super::linear::DynamicStiffness;
use crate::error::Result;
use crate::force::{AnyLaw, Class};

/// A relative displacement u = w . x: coordinates with their weights.
pub type Direction = Vec<(usize, f64)>;

/// A law on relative displacements, one for each of its coordinates.
#[derive(Clone)]
pub struct Element {
    pub force: Force,
    pub directions: Vec<Direction>,
}

/// A law that is evaluated for all samples at once, by whatever lies behind it.
pub trait Sampled: Send + Sync {
    /// Relative displacements that it sees, and forces on them.
    fn coordinates(&self) -> usize;

    /// Forces and their slopes by u and v at n samples: u, v and f (m, n), slopes (m, m, n).
    fn evaluate(&self, u: &[f64], v: &[f64], f: &mut [f64], f_u: &mut [f64], f_v: &mut [f64]) -> Result<()>;

    /// Whether its slopes jump somewhere; false also where that is not known.
    fn has_kinks(&self) -> bool {
        false
    }
}

/// The law of an element.
#[derive(Clone)]
pub enum Force {
    /// one of the core's with its numbers, and the states at rest from which it starts
    Known {
        law: AnyLaw,
        numbers: Vec<f64>,
        start: Vec<f64>,
    },
    Sampled(Arc<dyn Sampled>),
}

/// Forces (m,) and their slopes by displacements and rates, (m, m) by rows.
pub type ForceSlopes = (Vec<f64>, Vec<f64>, Vec<f64>);

impl Force {
    /// One of the core's laws, whose states start at zero.
    pub fn known(law: AnyLaw, numbers: Vec<f64>) -> Force {
        Force::Known { law, numbers, start: vec![0.0; law.n_states()] }
    }

    pub fn coordinates(&self) -> usize {
        match self {
            Force::Known { .. } => 1,
            Force::Sampled(law) => law.coordinates(),
        }
    }

    pub fn uses_velocity(&self) -> bool {
        match self {
            Force::Known { law, .. } => law.uses_velocity(),
            Force::Sampled(_) => true,
        }
    }

    /// Whether a contact, or a kink of a function, makes its slopes jump.
    pub fn has_contact(&self) -> bool {
        match self {
            Force::Known { law, .. } => law.class() == Class::Contact,
            Force::Sampled(law) => law.has_kinks(),
        }
    }

    pub fn has_memory(&self) -> bool {
        matches!(self, Force::Known { law, .. } if law.n_memory() > 0)
    }

    /// Forces and slopes at a phase (rad) of the excitation, displacements and rates; a law with states rests there.
    pub fn slopes(&self, phase: f64, u: &[f64], v: &[f64]) -> Result<ForceSlopes> {
        match self {
            Force::Known { law, numbers, .. } => {
                let p: Vec<Dual64> = numbers.iter().map(|&x| Dual64::from(x)).collect();
                let rest = law.rest_memory();
                let force = |u, v| law.force_at(phase, u, v, &p, &rest, &mut rest.clone());
                let by_u = force(Dual64::new(u[0], 1.0), Dual64::from(v[0]));
                let by_v = force(Dual64::from(u[0]), Dual64::new(v[0], 1.0));
                Ok((vec![by_u.re], vec![by_u.eps], vec![by_v.eps]))
            }
            Force::Sampled(law) => {
                let m = law.coordinates();
                let (mut f, mut f_u, mut f_v) = (vec![0.0; m], vec![0.0; m * m], vec![0.0; m * m]);
                law.evaluate(u, v, &mut f, &mut f_u, &mut f_v)?;
                Ok((f, f_u, f_v))
            }
        }
    }
}

/// Directions of the elements in the coordinates that the linear part retains.
pub fn retained_of(linear: &dyn DynamicStiffness, elements: &[Element]) -> Result<Vec<Vec<Direction>>> {
    elements.iter().map(|e| e.directions.iter().map(|d| linear.retain(d)).collect()).collect()
}

/// out += W B W^T with the blocks B_ab (n_c x n_c by rows, one after the other) of the coordinates of an element.
pub fn add_product(directions: &[Direction], blocks: &[f64], (n, n_c): (usize, usize), out: &mut Mat<f64>) {
    let m = directions.len();
    for (at, block) in blocks.chunks_exact(n_c * n_c).enumerate() {
        for &(i, wi) in &directions[at / m] {
            for &(l, wl) in &directions[at % m] {
                let w = wi * wl;
                for c in 0..n_c {
                    for row in 0..n_c {
                        out[(row * n + i, c * n + l)] += w * block[row * n_c + c];
                    }
                }
            }
        }
    }
}
