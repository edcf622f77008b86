//! How far bodies are from the origin of the world, in their own arms.
//!
//! Points are drawn in the world, so that each carries eps times its distance from the origin. What a body contributes to M and K
//! goes by its arms: from the centre of mass to where it is joined, and its radius of gyration.
use crate::multibody::System;
use crate::multibody::placement::place;
use crate::tolerances::constraints::POSE_ROUNDING;

impl System {
    /// The largest distance from the origin over the longest arm of a body, in a pose: rounding of M and K by places, over eps. Where an arm
    /// is itself rounding of places, the body is joined at its origin, and nothing goes by its arms.
    pub fn remoteness(&self, q: &[f64]) -> f64 {
        let topology = &*self.topology;
        let poses = place(topology, &self.geometry, q, None).pose;
        let arms = self.arms();
        let ratio = |(body, arm): (usize, &f64)| {
            let distance = poses[topology.node_of_body[body]].p.norm();
            if *arm > POSE_ROUNDING * f64::EPSILON * distance { distance / arm } else { 0.0 }
        };
        arms.iter().enumerate().map(ratio).fold(0.0, f64::max)
    }

    /// The longest arm of each body; zero where it is a point. Nodes of a flexible body have no arms of their own: they are points of it.
    fn arms(&self) -> Vec<f64> {
        let geometry = &*self.geometry;
        let gyration = |b: &crate::model::geometry::BodyGeometry<f64>| match b.mass > 0.0 {
            true => (0.5 * b.inertia.trace().max(0.0) / b.mass).sqrt(),
            false => 0.0,
        };
        let mut arms: Vec<f64> = geometry.bodies.iter().map(gyration).collect();
        let tables = &self.topology.tables;
        let joints = tables.joints.iter().map(|j| (j.a, j.b)).zip(&geometry.joints);
        let elements = tables.elements.iter().map(|e| (e.a, e.b)).zip(&geometry.elements);
        for ((a, b), pair) in joints.chain(elements) {
            for (body, at) in [(a, &pair.a), (b, &pair.b)] {
                if let Some(body) = body {
                    arms[body] = arms[body].max(at.p.norm());
                }
            }
        }
        for (tip, shape) in tables.tips.iter().zip(&geometry.tips) {
            let frame = tables.flexible[tip.flexible].body;
            arms[frame] = arms[frame].max(shape.offset.norm() + arms[tip.body]);
            arms[tip.body] = 0.0;
        }
        arms
    }
}
