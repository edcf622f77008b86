//! What the residual of a state that is held does with the numbers of the model.
//!
//! Numbers that move no body are felt by a few parts of the model, which alone are evaluated; others move bodies by the geometry of
//! their joints, and the whole residual is evaluated.
use std::cell::OnceCell;
use std::ops::Range;

use nalgebra::DVector;

use crate::integrate::{Equations, Motion};
use crate::model::layout::{coupler, joint};
use crate::multibody::parts::Parts;
use crate::multibody::placement::{Placement, Velocity};
use crate::multibody::topology::{Connector, Natural, Owner, Purpose};
use crate::run::Counts;
use crate::spatial::{Pose, Real, Six};

use crate::ad::lanes::{Wide, constant_pose, constants, moves};

/// What numbers with derivatives belong to.
#[derive(Debug, Clone, Default)]
pub struct Touched {
    pub parts: Parts,
    /// bodies move: everything is felt
    pub whole: bool,
    /// values of rows change
    pub rows: bool,
}

impl Touched {
    pub fn of<const N: usize>(eq: &Equations<'_, Wide<f64, N>>) -> Self {
        let mut out = Touched {
            parts: Parts {
                connectors: (0..eq.topology().connectors.len())
                    .filter(|c| connector_changes(eq, &eq.topology().connectors[*c]))
                    .collect(),
                inertias: Vec::new(),
                loads: Vec::new(),
                joints: Vec::new(),
            },
            whole: bodies_move(eq),
            rows: false,
        };
        out.add_inertias(eq);
        out.add_loads(eq);
        out.add_rows(eq);
        out
    }

    fn add_inertias<const N: usize>(&mut self, eq: &Equations<'_, Wide<f64, N>>) {
        let topology = eq.topology();
        for (b, body) in eq.geometry.bodies.iter().enumerate() {
            if !body.mass.is_constant() || !body.inertia.iter().all(Wide::is_constant) {
                self.whole |= topology.tables.flexible.iter().any(|f| f.body == b);
                self.parts.inertias.push(topology.node_of_body[b]);
            }
        }
    }

    fn add_loads<const N: usize>(&mut self, eq: &Equations<'_, Wide<f64, N>>) {
        let tables = &eq.topology().tables;
        for (l, (point, value)) in eq.geometry.loads.iter().enumerate() {
            let spec = &tables.loads[l];
            let varies = tables
                .load_motions
                .iter()
                .any(|m| m.load == l && (motion_changes(eq, m.motion) || moves(&eq.geometry.bodies[spec.body].drawn)));
            if varies || !point.iter().chain(value.iter()).all(Wide::is_constant) {
                self.whole |= spec.mode.is_some();
                self.parts.loads.push(l);
            }
        }
    }

    fn add_rows<const N: usize>(&mut self, eq: &Equations<'_, Wide<f64, N>>) {
        let (tables, geometry) = (&eq.topology().tables, &eq.geometry);
        for row in &eq.topology().rows {
            let (j, spec) = (row.joint, &tables.joints[row.joint]);
            let pair = &geometry.joints[j];
            if moves(&pair.a) || moves(&pair.b) || !pair.radius.is_constant() || !pair.pitch.is_constant() {
                self.rows = true;
                if !self.parts.joints.contains(&j) {
                    self.parts.joints.push(j);
                }
            }
            self.rows |= !geometry.joint_length[j].is_constant()
                || changes(eq, spec.x + joint::LENGTH..spec.x + joint::LENGTH + 1);
            match row.purpose {
                Purpose::Joint | Purpose::Constraint(_) => {}
                Purpose::Drive(d) => self.rows |= motion_changes(eq, tables.drives[d].motion),
                Purpose::Coupler(c) => {
                    let x = tables.couplers[c].x;
                    self.whole |= changes(eq, x + coupler::RATIO..x + coupler::RATIO + 1);
                    self.rows |= changes(eq, x..x + coupler::SIZE);
                }
            }
        }
        self.add_constraints(eq);
        self.rows |= self.whole;
    }
}

impl Touched {
    /// A function of several coordinates pulls on each of them by the values of all.
    fn add_constraints<const N: usize>(&mut self, eq: &Equations<'_, Wide<f64, N>>) {
        let tables = &eq.topology().tables;
        for (c, spec) in tables.constraints.iter().enumerate() {
            let pairs = || tables.motions_of(c).map(|(j, _)| &eq.geometry.joints[j]);
            self.whole |= changes(eq, spec.x..spec.x + spec.function.n_params())
                || pairs().any(|p| moves(&p.a) || moves(&p.b) || !p.pitch.is_constant());
        }
    }
}

fn changes<const N: usize>(eq: &Equations<'_, Wide<f64, N>>, x: Range<usize>) -> bool {
    !eq.x[x].iter().all(Wide::is_constant)
}

fn motion_changes<const N: usize>(eq: &Equations<'_, Wide<f64, N>>, motion: usize) -> bool {
    let mut any = false;
    let _ = eq.geometry.motions[motion].map(&mut |v: Wide<f64, N>| {
        any |= !v.is_constant();
        0.0
    });
    any
}

/// Do bodies move although all relative poses stay, or is anything touched that belongs to no part?
fn bodies_move<const N: usize>(eq: &Equations<'_, Wide<f64, N>>) -> bool {
    let geometry = &eq.geometry;
    // forces of the air change with what its sections remember
    let mut any = eq.topology().air_memory.first() != eq.topology().air_memory.last();
    let mut look = |v: Wide<f64, N>| {
        any |= !v.is_constant();
        0.0
    };
    for f in &geometry.flexible {
        let _ = f.map(&mut look);
    }
    for tip in &geometry.tips {
        let _ = tip.map(&mut look);
    }
    for air in &geometry.air {
        let _ = air.map(&mut look);
    }
    for section in &geometry.sections {
        let _ = section.map(&mut look);
    }
    if let Some(g) = geometry.gravity {
        let _ = g.map(&mut look);
    }
    any || eq.topology().nodes.iter().any(|node| match node.joint {
        Some(j) => {
            let pair = &geometry.joints[j];
            moves(&pair.a) || moves(&pair.b) || !pair.pitch.is_constant()
        }
        None => node.is_loose() && moves(&geometry.bodies[node.body].drawn),
    })
}

/// Laws with a memory count: their forces change with what they remember.
fn connector_changes<const N: usize>(eq: &Equations<'_, Wide<f64, N>>, c: &Connector) -> bool {
    let n = c.coordinates.len();
    let entries = if c.full { n * n } else { n };
    let pair = match c.owner {
        Owner::Element(i) => &eq.geometry.elements[i],
        Owner::Joint(i) => &eq.geometry.joints[i],
    };
    let natural = match c.natural {
        Natural::Zero => false,
        Natural::Value { x } => changes(eq, x..x + 1),
        Natural::Length { x, given } => {
            let drawn = match c.owner {
                Owner::Element(i) if !given => !eq.geometry.element_length[i].is_constant(),
                _ => false,
            };
            drawn || changes(eq, x..x + 1)
        }
    };
    let laws =
        |l: &crate::multibody::topology::BoundLaw| l.law.n_memory() > 0 || changes(eq, l.x..l.x + l.law.n_params());
    natural
        || moves(&pair.a)
        || moves(&pair.b)
        || c.k.is_some_and(|k| changes(eq, k..k + entries))
        || c.c.is_some_and(|k| changes(eq, k..k + entries))
        || c.preload.is_some_and(|p| changes(eq, p..p + n))
        || c.laws.iter().any(laws)
        || c.functions.iter().any(|f| changes(eq, f.x..f.x + f.law.n_params()))
}

/// A state that is held, with its placement.
pub struct Held<'a, T: Real> {
    pub eq: &'a Equations<'a, T>,
    pub motion: &'a Motion<T>,
    pub acceleration: &'a [T],
    pub lam: Option<&'a [T]>,
    placement: OnceCell<Placement<T>>,
    accelerations: OnceCell<Vec<Six<T>>>,
}

impl<'a, T: Real> Held<'a, T> {
    pub fn new(eq: &'a Equations<'a, T>, motion: &'a Motion<T>, acceleration: &'a [T], lam: &'a [T]) -> Self {
        Held {
            eq,
            motion,
            acceleration,
            lam: (!lam.is_empty()).then_some(lam),
            placement: OnceCell::new(),
            accelerations: OnceCell::new(),
        }
    }

    fn placement(&self) -> &Placement<T> {
        self.placement.get_or_init(|| self.eq.place(self.motion))
    }

    fn acceleration_of(&self, node: usize) -> Six<T> {
        let all = self.accelerations.get_or_init(|| {
            let scene = self.eq.scene(self.motion, self.placement(), Some(self.acceleration));
            scene.loaded_accelerations()
        });
        all[node]
    }
}

fn constant<T: Real, const N: usize>(w: &Six<T>) -> Six<Wide<T, N>> {
    Six::new(w.l.map(Wide::constant), w.a.map(Wide::constant))
}

/// The derivative of the residual by the numbers of N directions, entry by entry; `memory` may have derivatives too.
pub fn explicit<T: Real, const N: usize>(
    eq: &Equations<'_, Wide<T, N>>,
    touched: &Touched,
    held: &Held<'_, T>,
    memory: Vec<Wide<T, N>>,
    counts: &mut Counts,
    mut to: impl FnMut(usize, usize, T),
) {
    let lam = held.lam.map(constants::<T, N>);
    if !touched.whole {
        return of_parts(eq, &touched.parts, held, (memory, lam.as_deref()), counts, to);
    }
    let m = Motion { t: held.motion.t, q: constants(&held.motion.q), rate: constants(&held.motion.rate), memory };
    let a = constants(held.acceleration);
    let r = eq.residual(&m, &a, lam.as_deref().unwrap_or(&[]), counts);
    for (i, r) in r.iter().enumerate() {
        for (k, d) in r.eps.iter().enumerate() {
            to(i, k, *d);
        }
    }
}

fn of_parts<T: Real, const N: usize>(
    eq: &Equations<'_, Wide<T, N>>,
    parts: &Parts,
    held: &Held<'_, T>,
    (memory, lam): (Vec<Wide<T, N>>, Option<&[Wide<T, N>]>),
    counts: &mut Counts,
    mut to: impl FnMut(usize, usize, T),
) {
    if parts.is_empty() {
        return;
    }
    counts.add("parts differentiated", parts.len() as u64);
    let own = held.eq.scene(held.motion, held.placement(), Some(held.acceleration));
    let nodes = parts.nodes(&own);
    let placement = lifted(held.placement(), &nodes);
    let m = Motion { t: held.motion.t, q: Vec::new(), rate: Vec::new(), memory };
    let scene = eq.scene(&m, &placement, None);
    let sums = scene.part_wrenches(parts, |n| constant(&held.acceleration_of(n)), lam);
    let columns = held.eq.topology().dofs.len();
    let fold = own.fold();
    for k in 0..N {
        let mut all = DVector::zeros(columns);
        for node in &nodes {
            let (l, a) = (&sums[*node].l, &sums[*node].a);
            let w = Six::new(l.map(|x| x.eps[k]), a.map(|x| x.eps[k]));
            own.spread(*node, w, |d, f| all[d] += f);
        }
        let folded = match &fold {
            None => all,
            Some(fold) => fold.vector(&all),
        };
        for (i, f) in folded.iter().enumerate() {
            to(i, k, *f);
        }
    }
}

/// Poses and twists of some nodes as constants.
fn lifted<T: Real, const N: usize>(p: &Placement<T>, nodes: &[usize]) -> Placement<Wide<T, N>> {
    let n = p.pose.len();
    let mut pose = vec![Pose::identity(); n];
    let mut body = vec![Six::zero(); n];
    for node in nodes {
        pose[*node] = constant_pose(&p.pose[*node]);
        if let Some(v) = &p.velocity {
            body[*node] = constant(&v.body[*node]);
        }
    }
    Placement {
        q: constants(&p.q),
        pose,
        column: Vec::new(),
        velocity: p.velocity.is_some().then(|| Velocity { body, before: Vec::new(), nodes: Vec::new() }),
        modal: Vec::new(),
        turns: None,
    }
}
