//! How an equilibrium follows the numbers of a model: K'' dz = -dr.
use std::collections::BTreeMap;

use faer::prelude::*;
use nalgebra::DVector;

use crate::constraint::loops::column_scales;
use crate::error::{Error, Result};
use crate::linearize::Linearization;
use crate::multibody::System;
use crate::tolerances::equilibrium::{NO_STIFFNESS, PUSHED};

/// Solve K'' z = r at an equilibrium; free directions stay where they are unless the right side acts along them.
pub fn equilibrium_solver(
    system: &System,
    linearization: &Linearization,
    driven: &[usize],
) -> Result<impl Fn(&DVector<f64>) -> Result<DVector<f64>> + use<>> {
    let all = column_scales(&system.topology, system.length);
    let coordinates = linearization.coordinates(system.n_tree());
    let dof = coordinates.len();
    let mut islands: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
    for k in (0..dof).filter(|k| !driven.contains(&coordinates[*k])) {
        islands.entry(system.topology.island_of(coordinates[k])).or_default().push(k);
    }
    let scale: Vec<f64> = coordinates.iter().map(|i| all[*i]).collect();
    let k = &linearization.matrices.stiffness;
    let mut parts = Vec::with_capacity(islands.len());
    for own in islands.into_values() {
        let n = own.len();
        let scaled = Mat::from_fn(n, n, |i, j| k[(own[i], own[j])] * scale[own[i]] * scale[own[j]]);
        let svd = scaled.svd().map_err(|_| Error::singular("the stiffness is not finite"))?;
        parts.push((own, svd));
    }
    Ok(move |r: &DVector<f64>| {
        let mut step = DVector::zeros(dof);
        for (own, svd) in &parts {
            let (u, s, v) = (svd.U(), svd.S().column_vector(), svd.V());
            let n = own.len();
            let right = DVector::from_fn(n, |i, _| r[own[i]] * scale[own[i]]);
            for k in 0..n {
                let along: f64 = (0..n).map(|i| u[(i, k)] * right[i]).sum();
                if s[k] > NO_STIFFNESS * s[0] {
                    for i in 0..n {
                        step[own[i]] += v[(i, k)] * along / s[k] * scale[own[i]];
                    }
                } else if along.abs() > PUSHED * right.amax() {
                    return Err(Error::singular(
                        "the equilibrium does not follow this parameter: it pushes along a direction that nothing restrains; use equilibrium=\"hold\"",
                    ));
                }
            }
        }
        Ok(step)
    })
}
