//! What one element or joint does at an instant of a motion: coordinates, displacements, rates and forces.
use super::{Equations, Motion};
use crate::multibody::connector::{local, pair_of, strains};
use crate::multibody::connector_force::response;
use crate::multibody::numbers::Numbers;
use crate::spatial::Six;

/// One coordinate of an element: itself, its displacement from where the spring is relaxed, its rate, and the force along it.
#[derive(Debug, Clone, Copy)]
pub struct ElementCoordinate {
    pub coordinate: f64,
    pub displacement: f64,
    pub rate: f64,
    pub force: f64,
}

impl Equations<'_, f64> {
    /// f = preload + k e + c e' + laws of an element, coordinate by coordinate; laws have the states of the motion.
    pub fn element_motion(&self, m: &Motion<f64>, element: usize) -> Vec<ElementCoordinate> {
        let topology = self.topology();
        let c = &topology.connectors[element];
        let placement = self.place(m);
        let here = local(topology, &placement, c.a, c.b, pair_of(&self.geometry, c.owner));
        let rows: Vec<_> = c.coordinates.iter().map(|k| here.relative.row(*k)).collect();
        let numbers = Numbers { x: &self.x, memory: &m.memory, t: m.t };
        let e = strains(c, &self.geometry, numbers, &here, &rows);
        let v: Vec<f64> = rows.iter().map(|r| here.twist.as_ref().map_or(0.0, |twist| r.g.dot(twist))).collect();
        let force = response(c, numbers, &e, Some(&v), self.effects.wanted()).force;
        (0..e.len())
            .map(|i| ElementCoordinate { coordinate: rows[i].e, displacement: e[i], rate: v[i], force: force[i] })
            .collect()
    }

    /// Rates of the free coordinates of a joint.
    pub fn joint_rates(&self, m: &Motion<f64>, joint: usize) -> Vec<f64> {
        let topology = self.topology();
        let spec = &topology.tables.joints[joint];
        let here = local(topology, &self.place(m), spec.a, spec.b, &self.geometry.joints[joint]);
        let rate = |g: &Six<f64>| here.twist.as_ref().map_or(0.0, |twist| g.dot(twist));
        spec.kind.free_coordinates().iter().map(|k| rate(&here.relative.row(*k).g)).collect()
    }
}
