//! Reactions of all joints over any number type, as `analysis::reactions` reports them: redundant ones with the smallest norm.
//!
//! ```text
//! w = w0 - S (S^T S)^-1 S^T w0,   S = the wrenches of multipliers N with J^T N = 0
//! ```
//! Newton corrections of the real solution carry derivatives exactly: N - L^T J_d^T N with the left inverse L of J_d, and
//! 2 - S^T S for (S^T S)^-1 where the columns of S are orthonormal.
use nalgebra::{DMatrix, DVector};

use crate::constraint::loops::Loops;
use crate::error::{Error, Result};
use crate::integrate::Equations;
use crate::linearize::reactions::joint_wrenches;
use crate::multibody::assemble::Scene;
use crate::multibody::placement::Placement;
use crate::spatial::{Real, Six};

use super::quantity::Point;
use crate::tolerances::constraints::FELT;

/// Wrench on the second body of every joint at its point, world.
pub fn joint_reactions<T: Real>(
    eq: &Equations<'_, T>,
    at: &Point<'_, T>,
    placement: &Placement<T>,
) -> Result<Vec<Six<T>>> {
    let scene: Scene<'_, T> = eq.scene(at.motion, placement, Some(at.acceleration));
    let lam = (!at.lam.is_empty()).then_some(at.lam);
    let wrenches =
        |sums: Vec<Six<T>>, lam: &[T]| joint_wrenches(eq.topology(), &eq.geometry, &scene, placement, sums, lam);
    let mut all = wrenches(scene.body_wrenches(lam), at.lam);
    let jacobian = scene.constraints().1;
    let real = jacobian.map(|v| v.re());
    let decision = eq.system.decision(eq.effects)?;
    let Some(loops) = Loops::analyse(eq.system, &real, &decision)?.filter(|l| l.redundant.ncols() > 0) else {
        return Ok(all);
    };
    let length = eq.topology().characteristic_length(&eq.geometry, &eq.x);
    let flat = |w: &[Six<T>]| {
        DVector::from_fn(6 * w.len(), |i, _| {
            let v = w[i / 6].get(i % 6);
            if i % 6 < 3 { v } else { v / length }
        })
    };
    let null = null_space(&loops, &jacobian);
    let states: Vec<Vec<Six<T>>> = (0..null.ncols())
        .map(|k| {
            let lam: Vec<T> = null.column(k).iter().copied().collect();
            wrenches(scene.multiplier_wrenches(&lam), &lam)
        })
        .collect();
    let columns: Vec<DVector<T>> = states.iter().map(|s| flat(s)).collect();
    let raw = DMatrix::from_fn(6 * all.len(), columns.len(), |i, k| columns[k][i]);
    let mix = orthonormal(&raw.map(|v| v.re()))?;
    let s = &raw * mix.map(T::from);
    let right = s.transpose() * flat(&all);
    let twice = DMatrix::<T>::identity(right.len(), right.len()) * T::from(2.0);
    let share = mix.map(T::from) * ((twice - s.transpose() * &s) * right);
    for (k, state) in states.iter().enumerate() {
        for (w, s) in all.iter_mut().zip(state) {
            *w += s.scaled(-share[k]);
        }
    }
    Ok(all)
}

/// Multipliers that balance each other, (rows, redundant).
fn null_space<T: Real>(loops: &Loops, jacobian: &DMatrix<T>) -> DMatrix<T> {
    let jd = DMatrix::from_fn(jacobian.nrows(), loops.dependent.len(), |i, k| jacobian[(i, loops.dependent[k])]);
    let real = DMatrix::from_fn(loops.row_scale.len(), loops.redundant.ncols(), |i, k| {
        loops.redundant[(i, k)] * loops.row_scale[i]
    });
    let mut null = real.map(T::from);
    let inverse = loops.left_inverse.transpose().map(T::from);
    null -= inverse * (jd.transpose() * &null);
    null
}

/// A with M A orthonormal; combinations that no joint feels are left out.
fn orthonormal(m: &DMatrix<f64>) -> Result<DMatrix<f64>> {
    let svd = m.clone().svd(false, true);
    let v = svd.v_t.ok_or_else(|| Error::singular("redundant reactions could not be shared"))?;
    let largest = svd.singular_values.amax();
    let kept: Vec<usize> =
        (0..svd.singular_values.len()).filter(|k| svd.singular_values[*k] > FELT * largest).collect();
    Ok(DMatrix::from_fn(m.ncols(), kept.len(), |i, k| v[(kept[k], i)] / svd.singular_values[kept[k]]))
}
