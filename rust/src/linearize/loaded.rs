//! Whether a state has forces at all.
use crate::constraint::loop_lengths::bounds;
use crate::constraint::loops::column_scales;
use crate::error::Result;
use crate::model::layout::flag::{HAS_PRELOAD, LENGTH_GIVEN};
use crate::model::layout::{bushing, joint, spring_damper, torsion};
use crate::model::tables::Tables;
use crate::multibody::System;
use crate::multibody::assemble::Effects;
use crate::multibody::placement::{self, State, drawn_q};
use crate::spatial::V3;
use crate::tolerances::constraints::POSE_ROUNDING;
use crate::tolerances::coordinates::SAME_POINT;

/// Does anything carry force? A drawn state without cause for force has none; rounding must not make one.
pub fn loaded(system: &System, state: &State, effects: Effects) -> Result<bool> {
    let topology = &*system.topology;
    let closed = closing(system, state, effects)?;
    let (t, x): (&Tables, _) = (&topology.tables, &system.x);
    let nonzero = |start: usize, n: usize| x[start..start + n].iter().any(|v| *v != 0.0);
    let apart = |a: usize, b: usize| {
        let p = V3::from_fn(|k, _| x[a + k]);
        let q = V3::from_fn(|k, _| x[b + k]);
        (q - p).norm() > SAME_POINT * (system.length + p.norm())
    };
    let gravity = effects.gravity && system.geometry.gravity.is_some_and(|g| g.norm() > 0.0);
    let joint = |j: &crate::model::tables::JointSpec| {
        j.flags & HAS_PRELOAD != 0 && nonzero(j.x + joint::PRELOAD, 6)
            || j.kind.has_length() && (j.flags & LENGTH_GIVEN != 0 || x[j.x + joint::LENGTH] != 0.0)
            || !j.kind.has_length() && apart(j.x + joint::AT_A, j.x + joint::AT_B)
    };
    let element = |e: &crate::model::tables::ElementSpec| {
        use crate::model::tables::ElementKind::*;
        match e.kind {
            Bushing => {
                e.flags & HAS_PRELOAD != 0 && nonzero(e.x + bushing::PRELOAD, 6)
                    || apart(e.x + bushing::AT_A, e.x + bushing::AT_B)
            }
            SpringDamper => {
                x[e.x + spring_damper::LENGTH] != 0.0
                    || e.flags & LENGTH_GIVEN != 0
                    || e.flags & HAS_PRELOAD != 0 && x[e.x + spring_damper::PRELOAD] != 0.0
            }
            Torsion => x[e.x + torsion::ANGLE] != 0.0 || e.flags & HAS_PRELOAD != 0 && x[e.x + torsion::PRELOAD] != 0.0,
        }
    };
    let from_drawn = placement::difference(topology, &drawn_q(topology, &system.geometry), &state.q);
    let scales = column_scales(topology, system.length);
    Ok(gravity
        || !t.loads.is_empty()
        || !t.laws.is_empty()
        || !t.functions.is_empty()
        || t.joints.iter().any(joint)
        || t.elements.iter().any(element)
        || from_drawn.iter().zip(&scales).any(|(d, scale)| d.abs() > closed * scale))
}

/// By how much closing loops that are drawn closed may move joints: rounding of points, in lengths of their loops or radians.
fn closing(system: &System, state: &State, effects: Effects) -> Result<f64> {
    if system.topology.rows.is_empty() {
        return Ok(SAME_POINT);
    }
    let rows = &system.decision(effects)?.rows;
    let rounding = bounds(system, &state.q, effects, rows).into_iter().fold(0.0, f64::max);
    Ok((POSE_ROUNDING * rounding).max(SAME_POINT))
}
