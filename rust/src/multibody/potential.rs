//! Which forces have no potential, by structure: their stiffness has a skew part.
use crate::model::layout::bushing;
use crate::model::tables::ElementKind;
use crate::multibody::System;

/// True where loads turn with a body, torques are fixed in the world (their work depends on the order of turns), or bushings couple
/// across.
pub fn has_no_potential(system: &System) -> bool {
    let tables = &system.topology.tables;
    tables.loads.iter().any(|l| l.mode.is_none() && (l.follower || l.torque)) || cross_coupled(system, bushing::K)
}

/// True where a full bushing is not symmetric, such as that of a journal bearing, and where a law sees several coordinates.
pub fn cross_coupled(system: &System, field: usize) -> bool {
    let tables = &system.topology.tables;
    let skewed = |x: usize| {
        let at = |i: usize, j: usize| system.x[x + field + 6 * i + j];
        (0..6).any(|i| (0..i).any(|j| at(i, j) != at(j, i)))
    };
    tables.functions.iter().any(|f| f.coordinates.len() > 1)
        || tables.elements.iter().any(|e| e.kind == ElementKind::Bushing && skewed(e.x))
}
