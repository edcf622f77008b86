//! What a step does at its end: positions moved to the constraints, rates along them, accelerations.
//!
//! ```text
//! q <- exp(dy) q:   M dy + J^T mu = 0,   J dy = -Phi                   until Phi is closed, M and J at each q
//! v <- v + dv:      M dv + J^T kappa = 0,   J (v + dv) + Phi_t = 0     at the end
//! ```
//! Derivatives follow every correction, M and J with it. The last one is that of a closed pose, dy = 0: what is open there is rounding,
//! but its derivative need not be.
use nalgebra::{DMatrix, DVector};

use crate::error::Result;
use crate::integrate::{Equations, Motion};
use crate::linalg::kkt::Kkt;
use crate::linalg::rows::Level as Asked;
use crate::tolerances::steps::CLOSED;

/// Corrections of a step at most; each squares what is open.
const CORRECTIONS: usize = 6;

/// [M J^T; J 0] of an instant, and J.
pub fn accelerating(eq: &Equations<'_, f64>, m: &Motion<f64>) -> Result<(Kkt, DMatrix<f64>)> {
    let jacobian = eq.rows(m).1;
    let by = eq.kkt_of(&eq.mass(m), &jacobian, &jacobian)?;
    Ok((by, jacobian))
}

/// A correction of positions, from a pose.
pub struct Correction {
    pub at: Motion<f64>,
    /// [M J^T; J 0] with the rows of positions
    pub by: Kkt,
    pub jacobian: DMatrix<f64>,
    pub dy: Vec<f64>,
    pub mu: Vec<f64>,
}

impl Correction {
    /// The same pose with the correction for its rates.
    pub fn moving(&self) -> Motion<f64> {
        Motion { rate: self.dy.clone(), ..self.at.clone() }
    }

    pub fn still(&self) -> Motion<f64> {
        Motion { rate: vec![0.0; self.dy.len()], ..self.at.clone() }
    }

    pub fn is_none(&self) -> bool {
        self.dy.iter().all(|d| *d == 0.0)
    }
}

/// From where a step arrived to its end; without loops there are none.
pub fn corrections(eq: &Equations<'_, f64>, open: &Motion<f64>, end: &Motion<f64>) -> Result<Vec<Correction>> {
    let mut out = Vec::new();
    let mut at = open.clone();
    while eq.n_rows() > 0 {
        let (phi, jacobian) = eq.rows(&at);
        let kept = eq.rows.select_dense(&jacobian, Asked::Position);
        let mut gap = DVector::zeros(phi.len());
        kept.iter().for_each(|i| gap[*i] = phi[*i]);
        let closed = eq.worst_row(&gap).0 <= CLOSED || out.len() == CORRECTIONS;
        if closed {
            at.q.clone_from(&end.q);
        }
        let by = Kkt::with_columns(&eq.mass(&at), &jacobian.transpose(), &jacobian, kept)?;
        let (dy, mu) = match closed {
            true => (vec![0.0; eq.n()], vec![0.0; eq.n_rows()]),
            false => {
                let (dy, mu) = by.solve_one(&DVector::zeros(eq.n()), &-gap)?;
                (dy.as_slice().to_vec(), mu.as_slice().to_vec())
            }
        };
        let next = at.moved(eq.topology(), &dy);
        out.push(Correction { at: std::mem::replace(&mut at, next), by, jacobian, dy, mu });
        if closed {
            break;
        }
    }
    Ok(out)
}

/// The correction of rates at the end of a step.
pub struct Aligned {
    /// [M J^T; J 0] there
    pub by: Kkt,
    pub dv: Vec<f64>,
    pub kappa: Vec<f64>,
}

impl Aligned {
    /// From rates `star` to those of the end.
    pub fn new(eq: &Equations<'_, f64>, end: &Motion<f64>, star: &[f64]) -> Result<Self> {
        let (by, jacobian) = accelerating(eq, end)?;
        let dv: Vec<f64> = end.rate.iter().zip(star).map(|(v, star)| v - star).collect();
        let made = &jacobian * DVector::from_column_slice(&dv);
        let kappa = by.solve_one(&DVector::zeros(eq.n()), &made)?.1;
        Ok(Aligned { by, dv, kappa: kappa.as_slice().to_vec() })
    }
}
