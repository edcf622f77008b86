//! Velocity rows that restrain no place: where they steer, a body gets anywhere by going to and fro, though it cannot go there straight.
//!
//! ```text
//! omega = D(q) dq,   d omega(X, Y) = X(omega(Y)) - Y(omega(X)) - omega([X, Y]),   X, Y motions that all rows allow
//! ```
//! A row with d omega = 0 for all X, Y comes from a position (a wheel that is led along a rail); one with d omega != 0 does not
//! (Frobenius; A. M. Bloch, Nonholonomic Mechanics and Control, 2nd ed., Springer 2015, section 2.11). Increments of three rotations that
//! act together are fields with [x, y] = -x cross y.
use nalgebra::DVector;

use crate::constraint::loops::column_scales;
use crate::linearize::{Linearization, Path, Setting, turning_jacobian};
use crate::multibody::rotations::add_commutator;
use crate::multibody::topology::Level;
use crate::tolerances::constraints::SINGULAR_POSE;

/// The names of what makes velocity rows of a state at rest, where each of them steers; none where some come from positions.
pub fn steering_joints(setting: &Setting<'_>, made: &Linearization) -> Vec<String> {
    let system = setting.system;
    let topology = &*system.topology;
    let velocity: Vec<usize> =
        (0..topology.rows.len()).filter(|i| topology.rows[*i].level == Level::Velocity).collect();
    let (Some(loops), Some(b)) = (&made.loops, &made.dependent_map) else {
        return Vec::new();
    };
    if velocity.is_empty() || !setting.effects.nonholonomic || setting.state.moving() {
        return Vec::new();
    }
    let columns = column_scales(topology, system.length);
    let motion = |k: usize| {
        let mut z = DVector::zeros(loops.independent.len());
        z[k] = columns[loops.independent[k]];
        loops.expand(b, &z)
    };
    let motions: Vec<DVector<f64>> = (0..loops.independent.len()).map(motion).collect();
    let size: Vec<f64> = motions.iter().map(|m| m.iter().zip(&columns).map(|(m, c)| (m / c).abs()).sum()).collect();
    let along = |x: &DVector<f64>| {
        let path = Path { x: &system.x, q: &setting.state.q, rate: x.as_slice() };
        turning_jacobian(setting, &path, None)
    };
    let turned: Vec<_> = motions.iter().map(along).collect();
    let mut steers = vec![false; topology.rows.len()];
    for i in 0..motions.len() {
        for j in 0..i {
            let mut bracket = vec![0.0; motions[i].len()];
            add_commutator(topology, 1.0, (motions[i].as_slice(), motions[j].as_slice()), &mut bracket);
            let curl = turned[i].map(|v| v.v1) * &motions[j] - turned[j].map(|v| v.v1) * &motions[i]
                + turned[i].map(|v| v.re) * DVector::from_vec(bracket);
            let limit = SINGULAR_POSE * system.tolerance * size[i] * size[j];
            for r in velocity.iter().filter(|r| (curl[**r] * loops.row_scale[**r]).abs() > limit) {
                steers[*r] = true;
            }
        }
    }
    let mut names: Vec<&str> = velocity.iter().map(|r| topology.row_name(*r)).collect();
    names.dedup();
    let one_steers = |name: &&str| velocity.iter().any(|r| steers[*r] && topology.row_name(*r) == *name);
    match names.iter().all(one_steers) {
        true => names.into_iter().map(str::to_owned).collect(),
        false => Vec::new(),
    }
}
