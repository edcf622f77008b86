//! Forces of the air on the sections of blades, with exact tangents.
use num_dual::Dual;

use crate::aero::section::{Flow, Place, Section, displaced};
use crate::aero::unsteady::Memory;
use crate::model::air::{AirGeometry, SectionSpec};
use crate::model::geometry::Geometry;
use crate::multibody::assemble::Scene;
use crate::multibody::connector::{Elastic, Interaction};
use crate::multibody::numbers::Numbers;
use crate::multibody::placement::Placement;
use crate::multibody::topology::Topology;
use crate::spatial::{M3, Map6, Real, Six, V3, turned};

/// One section as it is now.
pub struct Here<'p, T: Real> {
    pub spec: &'p SectionSpec,
    pub air: &'p AirGeometry<T>,
    /// the velocity that a wake induces, in the section's axes
    pub induced: V3<T>,
    pub section: Section<'p, T>,
    pub place: Place<T>,
    pub memory: Memory<T>,
}

impl<'p, T: Real> Here<'p, T> {
    pub fn new(
        topology: &'p Topology,
        geometry: &'p Geometry<T>,
        placement: &Placement<T>,
        numbers: Numbers<'_, T>,
        index: usize,
    ) -> Self {
        let tables = &topology.tables;
        let spec = &tables.sections[index];
        let (own, of) = (&geometry.sections[index], &tables.air[spec.air]);
        let air = &geometry.air[spec.air];
        let node = topology.node_of_body[spec.body];
        let pose = &placement.pose[node];
        let arm = turned(&pose.r, &own.local);
        let velocity = placement.velocity.as_ref().map_or_else(Six::zero, |v| v.body[node].motion_at(&arm));
        let history = of.history.as_ref();
        let places = topology.section_memory(index);
        Here {
            spec,
            air,
            induced: history.map_or_else(V3::zeros, |h| h.velocity(numbers.x, spec.number, numbers.t)),
            section: own.section(spec, air, of),
            place: Place { p: pose.p + arm, r: pose.r, velocity },
            memory: Memory::read(numbers.memory.get(places).unwrap_or(&[])),
        }
    }

    /// Velocity of the air at a point, without what annuli induce.
    fn velocity(&self, point: &V3<T>) -> V3<T> {
        self.air.wind(point) + turned(&self.place.r, &self.induced)
    }

    fn wrench(&self) -> Six<T> {
        self.section.wrench(&self.place, &self.memory, |p| self.velocity(p))
    }

    /// What the air does at the section.
    pub fn flow(&self) -> Flow<T> {
        self.section.flow(&self.place, &self.memory, |p| self.velocity(p))
    }

    /// The flow with the states that are given, not solved for.
    pub fn flow_of(&self, states: &[T]) -> Flow<T> {
        let mut memory = Memory { gain: T::zero(), ..self.memory };
        memory.base[..states.len()].copy_from_slice(states);
        self.section.flow(&self.place, &memory, |p| self.velocity(p))
    }

    /// The wrench about the fixed place of the section's point, after a small displacement and a change of the velocity field there.
    pub fn wrench_after(&self, xi: &Six<T>, rate: &Six<T>) -> Six<T> {
        let moved = Here { place: displaced(&self.place, xi, rate), ..*self };
        let mut w = moved.wrench();
        w.a += xi.l.cross(&w.l);
        w
    }
}

impl<T: Real> Scene<'_, T> {
    pub fn here(&self, index: usize) -> Here<'_, T> {
        Here::new(self.topology, self.geometry, self.placement, self.numbers(), index)
    }

    /// Sections that act.
    pub fn airy(&self) -> usize {
        if self.effects.aerodynamics { self.topology.tables.sections.len() } else { 0 }
    }

    /// Do any sections act?
    pub(crate) fn has_air(&self) -> bool {
        self.airy() > 0
    }

    /// The flow at every section, and where the section is.
    pub fn air_flows(&self) -> Vec<(Place<T>, Flow<T>)> {
        let one = |i: usize| {
            let here = self.here(i);
            let mut flow = here.flow();
            flow.induced += turned(&here.place.r, &here.induced);
            (here.place, flow)
        };
        (0..self.topology.tables.sections.len()).map(one).collect()
    }

    /// Wrenches of all sections on their bodies.
    pub fn air_forces(&self) -> impl Iterator<Item = Interaction<T>> {
        (0..self.airy()).map(|i| {
            let here = self.here(i);
            self.acting(&here, here.wrench(), None)
        })
    }

    /// The same with their tangents: the wrench by duals along the six displacements and the six rates of the section.
    pub(crate) fn air_tangents(&self) -> impl Iterator<Item = Interaction<T>> {
        (0..self.airy()).map(|i| {
            let here = self.here(i);
            self.acting(&here, here.wrench(), Some(here.slopes()))
        })
    }

    fn acting(&self, here: &Here<'_, T>, wrench: Six<T>, slopes: Option<(Slopes<T>, Slopes<T>)>) -> Interaction<T> {
        let (elastic, tangent) = slopes.map(|(k, c)| (resisting(&k, &c), (Map6::zero(), map_of(&c)))).unzip();
        Interaction { a: None, b: Some(here.spec.body), point: here.place.p, wrench, damped: true, elastic, tangent }
    }
}

/// Slopes of a wrench: entry (i, j) of part i along j.
type Slopes<T> = [[T; 6]; 6];

impl<T: Real> Here<'_, T> {
    /// dW/dxi and dW/dxi' about the fixed place of the section's point.
    fn slopes(&self) -> (Slopes<T>, Slopes<T>) {
        self.with(Dual::from_re, |here| here.slopes_on_duals())
    }

    /// A function of the same section over other numbers.
    pub fn with<U: Real, R>(&self, lift: impl Fn(T) -> U, f: impl Fn(&Here<'_, U>) -> R) -> R {
        let air = self.air.map(&mut { &lift });
        f(&Here {
            spec: self.spec,
            air: &air,
            induced: self.induced.map(&lift),
            section: self.section.map(&lift),
            place: self.place.map(&lift),
            memory: self.memory.map(&lift),
        })
    }
}

impl<T: Real> Here<'_, Dual<T>> {
    fn slopes_on_duals(&self) -> (Slopes<T>, Slopes<T>) {
        let zero = [[T::zero(); 6]; 6];
        let (mut k, mut c) = (zero, zero);
        for j in 0..6 {
            let along = unit(j).map(|v| Dual::new(T::zero(), v));
            let along = Six::new(V3::from_fn(|i, _| along[i]), V3::from_fn(|i, _| along[3 + i]));
            for (slopes, xi, rate) in [(&mut k, along, Six::zero()), (&mut c, Six::zero(), along)] {
                let w = self.wrench_after(&xi, &rate);
                for (i, row) in slopes.iter_mut().enumerate() {
                    row[j] = w.get(i).eps;
                }
            }
        }
        (k, c)
    }
}

fn unit<T: Real>(k: usize) -> [T; 6] {
    std::array::from_fn(|i| if i == k { T::one() } else { T::zero() })
}

/// Slopes as of a spring on the six coordinates of a body.
fn resisting<T: Real>(k: &Slopes<T>, c: &Slopes<T>) -> Elastic<T> {
    let negative = |m: &Slopes<T>| m.map(|row| row.map(|v| -v));
    let gradient = |k: usize| {
        let e = unit(k);
        Six::new(V3::new(e[0], e[1], e[2]), V3::new(e[3], e[4], e[5]))
    };
    Elastic { gradients: (0..6).map(gradient).collect(), k: negative(k), c: negative(c) }
}

fn map_of<T: Real>(m: &Slopes<T>) -> Map6<T> {
    let block = |i: usize, j: usize| M3::from_fn(|a, b| m[i + a][j + b]);
    Map6 { ll: block(0, 0), la: block(0, 3), al: block(3, 0), aa: block(3, 3) }
}
