//! Newton's step of an equilibrium, and the one of relaxation: (K + sigma M)^-1.
use nalgebra::{DMatrix, DVector};

use crate::equilibrium::followers;
use crate::equilibrium::local::{Local, Spectrum};
use crate::error::Result;
use crate::tolerances::equilibrium::PUSHED;

/// Where relaxation begins: stiffness, or what the forces make of the masses, over the largest mass.
pub(crate) fn initial_sigma(local: &Local) -> f64 {
    let m = local.m.diagonal().amax().max(f64::MIN_POSITIVE);
    local.k.amax().max(local.r.amax()) / m
}

/// -K^-1 r; along negative stiffness downhill, along none not at all.
pub(crate) fn newton_step(local: &Local, spectrum: &Spectrum, sigma: f64) -> Result<DVector<f64>> {
    if sigma > 0.0 {
        let a = &local.k + &local.m * sigma;
        if let Some(step) = a.lu().solve(&-&local.r).filter(|s| s.iter().all(|v| v.is_finite())) {
            return Ok(step);
        }
    }
    newton_answer(local, spectrum, &local.r)
}

pub(crate) fn newton_answer(local: &Local, spectrum: &Spectrum, r: &DVector<f64>) -> Result<DVector<f64>> {
    let all = newton_answers(local, spectrum, &DMatrix::from_column_slice(r.len(), 1, r.as_slice()))?;
    Ok(all.column(0).into_owned())
}

/// K itself where it leads downhill anyway; its symmetric part where that decides about up and down.
fn by_whole(local: &Local, spectrum: &Spectrum) -> bool {
    let definite = (0..spectrum.values.len()).all(|k| spectrum.values[k] > spectrum.none[k]);
    !local.conservative() && (definite || !local.may_be_conservative())
}

/// A direction along which a force works and nothing restrains the model.
pub(crate) fn pushed_freely(local: &Local, spectrum: &Spectrum) -> Result<Option<DVector<f64>>> {
    let free = (0..spectrum.values.len()).filter(|k| !spectrum.is_held(*k));
    let pushed = free.max_by(|a, b| spectrum.push(*a, &local.r).total_cmp(&spectrum.push(*b, &local.r)));
    if let Some(k) = pushed.filter(|k| spectrum.push(*k, &local.r) > PUSHED) {
        return Ok(Some(spectrum.vectors.column(k).into_owned()));
    }
    if !by_whole(local, spectrum) {
        return Ok(None);
    }
    let found = followers::loose(local)?.into_iter().find(|loose| loose.is_pushed);
    Ok(found.map(|loose| loose.direction))
}

/// The same for each column of forces.
pub(crate) fn newton_answers(local: &Local, spectrum: &Spectrum, r: &DMatrix<f64>) -> Result<DMatrix<f64>> {
    if by_whole(local, spectrum) {
        return followers::answers(local, r);
    }
    let mut along = spectrum.vectors.transpose() * r;
    for (k, mut row) in along.row_iter_mut().enumerate() {
        row *= if spectrum.is_held(k) { -1.0 / spectrum.values[k].abs() } else { 0.0 };
    }
    Ok(&spectrum.vectors * along)
}
