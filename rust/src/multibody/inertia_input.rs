//! What the recursions of inertia work on: a tree at a pose, at rest or moving.
use crate::model::geometry::Geometry;
use crate::multibody::placement::Placement;
use crate::multibody::topology::Topology;
use crate::spatial::{Real, V3};

/// A tree at a pose; rates, accelerations and gravity where they act.
pub struct InertiaInput<'a, T: Real> {
    pub topology: &'a Topology,
    pub geometry: &'a Geometry<T>,
    pub placement: &'a Placement<T>,
    pub rate: Option<&'a [T]>,
    pub acceleration: Option<&'a [T]>,
    pub gravity: Option<V3<T>>,
}
