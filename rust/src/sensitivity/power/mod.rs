//! Virtual power: the one number u.r + (rows, weighed), and its derivative by everything it is made of, by hand.
//!
//! ```text
//! P = f u.(M a + h(q, v, t)) + sum_i [ alpha_i Phi_i + beta_i (J v + Phi_t)_i + kappa_i (J u)_i ]
//! u.(M a + h) = sum over bodies U.(I A) + (U x V).(I V)  +  sum over springs f(e, e') e'(U)  -  sum over loads and sections U.W
//! ```
//! What a step backwards asks for is such a number: residual and rows at once; J v in the direction of a motion gives J a + gamma, the
//! residual along (c d, h/2 d, d) the metric of the projections, both with dual numbers for T, of which the derivatives are read.
//! A sum of products over bodies costs about what the residual itself does, where a tape writes down every operation of it.
//!
//! | file | |
//! |---|---|
//! | `tree` | bodies and their inertia |
//! | `links`, `loads`, `air`, `flexible` | connectors and rows, loads, sections of blades, flexible bodies |
mod air;
mod flexible;
mod links;
mod loads;
pub(crate) mod tree;

use crate::integrate::{Equations, Motion};
use crate::model::geometry::Geometry;
use crate::multibody::placement::Placement;
use crate::spatial::{M3, Real, Six, V3};

use self::flexible::OnTape;
use self::tree::{Bodies, Twists};

/// Which forces count.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Forces {
    None,
    /// M a alone
    Mass,
    All,
}

/// The number to be differentiated. Empty lists are zero.
pub struct Power<'a, 'b, T: Real> {
    pub eq: &'b Equations<'a, T>,
    pub motion: &'b Motion<T>,
    /// of the motion, with its rate where it runs along
    pub time: T,
    pub acceleration: &'b [T],
    /// u
    pub rates: &'b [f64],
    /// f
    pub factor: f64,
    pub forces: Forces,
    /// weights of the rows' values, rates and virtual rates
    pub alpha: &'b [T],
    pub beta: &'b [T],
    pub kappa: &'b [T],
}

/// Derivatives: by tree increments, rates, accelerations and memories; those by numbers and geometry add up over calls.
pub struct Slopes<T: Real> {
    pub q: Vec<T>,
    pub rate: Vec<T>,
    pub acceleration: Vec<T>,
    /// what the columns of moving nodes hand on to their shapes
    pub virtual_: Vec<T>,
    pub memory: Vec<T>,
    pub x: Vec<T>,
    pub geometry: Geometry<T>,
    /// by value and rate of each motion
    pub motions: Vec<[T; 2]>,
}

impl<T: Real> Slopes<T> {
    pub fn none(eq: &Equations<'_, f64>) -> Self {
        Slopes {
            q: Vec::new(),
            rate: Vec::new(),
            acceleration: Vec::new(),
            virtual_: Vec::new(),
            memory: Vec::new(),
            x: vec![T::zero(); eq.x.len()],
            geometry: eq.geometry.map(|_| T::zero()),
            motions: Vec::new(),
        }
    }

    fn start(&mut self, n: usize, memory: usize, motions: usize) {
        for (v, n) in [
            (&mut self.q, n),
            (&mut self.rate, n),
            (&mut self.acceleration, n),
            (&mut self.virtual_, n),
            (&mut self.memory, memory),
        ] {
            v.clear();
            v.resize(n, T::zero());
        }
        self.motions.clear();
        self.motions.resize(motions, [T::zero(); 2]);
    }
}

/// Rates, accelerations and virtual rates of all columns: of the coordinates, then of the nodes that modal ones move.
pub struct Columns<T: Real> {
    pub rate: Vec<T>,
    pub acceleration: Vec<T>,
    pub virtual_: Vec<T>,
}

impl<T: OnTape> Power<'_, '_, T> {
    pub(crate) fn gravity(&self) -> Option<V3<T>> {
        let acts = self.forces == Forces::All && self.eq.effects.gravity;
        self.eq.geometry.gravity.filter(|_| acts)
    }

    /// Do rates make inertia forces?
    pub(crate) fn turning(&self) -> bool {
        self.forces == Forces::All && self.eq.effects.centrifugal
    }

    /// Differentiate; `out` starts anew but for numbers and geometry.
    pub fn back(&self, out: &mut Slopes<T>) {
        let topology = self.eq.topology();
        let motions = topology.tables.motions.len();
        out.start(topology.dofs.len(), self.motion.memory.len(), motions);
        let at = self.eq.place(self.motion);
        let columns = self.columns(&at);
        let twists = self.twists(&at, &columns);
        let mut bodies = Bodies::none(topology.nodes.len());
        if self.forces != Forces::None {
            self.inertia_back(&at, &twists, &mut bodies, out);
            self.flexible_back(&at, &twists, &columns, &mut bodies, out);
        }
        if self.forces == Forces::All {
            self.springs_back(&at, &twists, &mut bodies, out);
            self.loads_back(&at, &twists, &columns, &mut bodies, out);
            self.air_back(&at, &twists, &mut bodies, out);
        }
        if ![self.alpha, self.beta, self.kappa].iter().all(|w| w.is_empty()) {
            self.rows_back(&at, &twists, &mut bodies, out);
        }
        self.tree_back(&at, &columns, bodies, out);
        self.fold_back(&at, &columns, out);
        for v in [&mut out.q, &mut out.rate, &mut out.acceleration] {
            v.truncate(self.eq.n());
        }
    }

    /// U.(I A) + Y.(I V), Y = U x V. An inertia carried along changes by d x* I - I d x.
    fn inertia_back(&self, at: &Placement<T>, twists: &Twists<T>, bodies: &mut Bodies<T>, out: &mut Slopes<T>) {
        let f = T::from(self.factor);
        let topology = self.eq.topology();
        for (i, node) in topology.nodes.iter().enumerate() {
            if topology.modal.iter().any(|m| m.node == i) {
                continue;
            }
            let body = &self.eq.geometry.bodies[node.body];
            let onto = &mut out.geometry.bodies[node.body];
            let r = &at.pose[i].r;
            let j = r * body.inertia * r.transpose();
            let inertia = |v: &Six<T>| Six::new(v.l * body.mass, j * v.a);
            let own = |v: &V3<T>| r.transpose() * v;
            let u = twists.virtual_[i].scaled(f);
            let a = &twists.acceleration[i];
            let (iu, ia) = (inertia(&u), inertia(a));
            bodies.acceleration[i] += iu;
            let mut carried = u.cross_force(&ia) + a.cross_force(&iu);
            onto.mass += u.l.dot(&a.l);
            let mut by_inertia: M3<T> = own(&u.a) * own(&a.a).transpose();
            let mut by_virtual = ia;
            if let (true, Some(velocity)) = (self.turning(), &at.velocity) {
                let v = &velocity.body[i];
                let y = u.cross_motion(v);
                let (iv, iy) = (inertia(v), inertia(&y));
                by_virtual += v.cross_force(&iv);
                bodies.velocity[i] += iy - u.cross_force(&iv);
                carried += y.cross_force(&iv) + v.cross_force(&iy);
                onto.mass += y.l.dot(&v.l);
                by_inertia += own(&y.a) * own(&v.a).transpose();
            }
            onto.inertia += by_inertia;
            bodies.virtual_[i] += by_virtual.scaled(f);
            bodies.displaced[i] += -carried;
        }
    }
}
