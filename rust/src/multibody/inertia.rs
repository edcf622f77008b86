//! Inertia of the tree by recursion from the tips: M, the gyroscopic and velocity terms, gravity and its stiffness.
//!
//! Derivatives of recursive inverse dynamics in world axes (Singh, Russo and Wensing, IEEE Robotics and Automation Letters 7(2),
//! 2022, equations for dtau/dq and dtau/dq'), each vector taken at the centre of mass of the body that owns it and moved from
//! body to body, so that a model far from the origin loses nothing. Gravity is the acceleration -g of ground.
use nalgebra::DMatrix;

use crate::linalg::entries::Entries;
use crate::multibody::flexible::node_accelerations;
use crate::multibody::flexible_inertia::{Shapes, shapes};
use crate::multibody::inertia_input::InertiaInput;
use crate::spatial::{M3, Map6, Real, Six, V3, conjugated, outer, product, skew, turned};

/// Mass, first moment and inertia of a subtree about a point.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Composite<T: Real> {
    pub m: T,
    h: V3<T>,
    pub j: M3<T>,
}

impl<T: Real> Composite<T> {
    pub fn apply(&self, v: &Six<T>) -> Six<T> {
        Six::new(v.l * self.m + v.a.cross(&self.h), self.h.cross(&v.l) + turned(&self.j, &v.a))
    }

    /// About a point displaced by `d` from this one's.
    pub fn at(&self, d: &V3<T>) -> Self {
        let r = -d;
        let hr = self.h.dot(&r) * T::from(2.0) + self.m * r.dot(&r);
        let cross = outer(&self.h, &r) + outer(&r, &self.h) + outer(&r, &r) * self.m;
        Composite { m: self.m, h: self.h + r * self.m, j: self.j + M3::from_diagonal_element(hr) - cross }
    }

    pub fn add(&mut self, o: &Self) {
        self.m += o.m;
        self.h += o.h;
        self.j += o.j;
    }

    fn map(&self) -> Map6<T> {
        let s = skew(&self.h);
        Map6 { ll: M3::from_diagonal_element(self.m), la: -s, al: s, aa: self.j }
    }
}

/// Accelerations of the state: of bodies, and of the frames that carry each coordinate's axis; -g included.
struct Accelerations<T: Real> {
    body: Vec<Six<T>>,
    before: Vec<Six<T>>,
}

impl<T: Real> InertiaInput<'_, T> {
    fn loaded(&self) -> bool {
        self.rate.is_some() || self.acceleration.is_some() || self.gravity.is_some()
    }

    fn rigid(&self, node: usize) -> Composite<T> {
        let body = &self.geometry.bodies[self.topology.nodes[node].body];
        let r = &self.placement.pose[node].r;
        Composite { m: body.mass, h: V3::zeros(), j: conjugated(r, &body.inertia) }
    }

    pub(crate) fn rigid_composites(&self) -> Vec<Composite<T>> {
        (0..self.topology.nodes.len()).map(|node| self.rigid(node)).collect()
    }

    fn composites(&self, flexible: &[Shapes<'_, T>]) -> Vec<Composite<T>> {
        let mut all = self.rigid_composites();
        for shapes in flexible {
            let (h, j) = shapes.composite();
            let own = &mut all[shapes.modal.node];
            own.h += h;
            own.j += j;
        }
        all
    }

    /// The twist of a node, where motion counts.
    fn twist(&self, node: usize) -> Option<&Six<T>> {
        let velocity = self.rate.and(self.placement.velocity.as_ref())?;
        Some(&velocity.body[node])
    }

    fn to_parent(&self, node: usize) -> Option<(usize, V3<T>)> {
        let parent = self.topology.nodes[node].parent?;
        Some((parent, self.placement.pose[parent].p - self.placement.pose[node].p))
    }

    fn accelerations(&self) -> Accelerations<T> {
        let base = Six::new(self.gravity.map_or_else(V3::zeros, |g| -g), V3::zeros());
        let mut body: Vec<Six<T>> = Vec::with_capacity(self.topology.nodes.len());
        let mut before = vec![Six::zero(); self.topology.dofs.len()];
        let (nodes, n) = (self.node_accelerations(), self.topology.n_tree);
        for (i, node) in self.topology.nodes.iter().enumerate() {
            let mut a = self.to_parent(i).map_or(base, |(p, d)| body[p].motion_at(&-d));
            for stage in 0..node.kind.stages() {
                let carried = a;
                for d in (node.first..node.first + node.n).filter(|d| self.topology.dofs[*d].freedom.stage == stage) {
                    before[d] = carried;
                    let s = &self.placement.column[d];
                    if let (Some(rate), Some(v)) = (self.rate, self.placement.velocity.as_ref()) {
                        a += v.before[d].cross_motion(s).scaled(v.of(rate, d));
                    }
                    match self.acceleration {
                        _ if d >= n => a += s.scaled(nodes[d - n]),
                        Some(acceleration) => a += s.scaled(acceleration[d]),
                        None => {}
                    }
                }
            }
            body.push(a);
        }
        Accelerations { body, before }
    }

    /// Those of the columns of moving nodes, as far as accelerations and rates count.
    fn node_accelerations(&self) -> Vec<T> {
        node_accelerations(self.topology, self.geometry, &self.placement.modal, self.rate, self.acceleration)
    }

    /// Per node: the spatial acceleration about the centre of mass.
    pub fn body_accelerations(&self) -> Vec<Six<T>> {
        self.accelerations().body
    }

    /// First and second rate of each motion column by the motion of what carries it, gravity left out.
    pub fn column_rates(&self) -> (Vec<Six<T>>, Vec<Six<T>>) {
        let free = InertiaInput { gravity: None, ..*self };
        let made = carried_columns(&free, &free.accelerations());
        (made.first.unwrap_or_else(|| vec![Six::zero(); made.second.len()]), made.second)
    }

    /// The same of one rigid body, whose acceleration is given.
    pub fn rigid_force(&self, node: usize, a: &Six<T>) -> Six<T> {
        let own = self.rigid(node);
        let mut f = own.apply(a);
        if let Some(v) = self.twist(node) {
            f += v.cross_force(&own.apply(v));
        }
        f
    }

    /// Per node: the inertia force I a + v x* I v - gravity about the centre of mass.
    pub fn forces(&self) -> Option<Vec<Six<T>>> {
        if !self.loaded() {
            return None;
        }
        let (a, flexible) = (self.accelerations(), shapes(self));
        Some(self.forces_of(&self.composites(&flexible), &flexible, &a))
    }

    /// The same with the inertia forces of all modal coordinates.
    pub fn all_forces(&self) -> Option<(Vec<Six<T>>, Vec<T>)> {
        if !self.loaded() {
            return None;
        }
        let (a, flexible) = (self.accelerations(), shapes(self));
        let forces = self.forces_of(&self.composites(&flexible), &flexible, &a);
        let modal = flexible.iter().flat_map(|s| {
            let node = s.modal.node;
            s.residual(self.twist(node), Some(&a.body[node]))
        });
        Some((forces, modal.collect()))
    }

    fn forces_of(&self, own: &[Composite<T>], flexible: &[Shapes<'_, T>], a: &Accelerations<T>) -> Vec<Six<T>> {
        let mut all: Vec<_> = (0..own.len())
            .map(|n| {
                let mut f = own[n].apply(&a.body[n]);
                if let (Some(_), Some(v)) = (self.rate, self.placement.velocity.as_ref()) {
                    f += v.body[n].cross_force(&own[n].apply(&v.body[n]));
                }
                f
            })
            .collect();
        for shapes in flexible {
            let node = shapes.modal.node;
            all[node] += shapes.force(self.twist(node));
        }
        all
    }
}

/// Momentum of the whole tree per tree coordinate, about the world origin: T^T M of a common rigid motion, (n_tree, 6).
pub fn ground_coupling<T: Real>(input: &InertiaInput<'_, T>) -> DMatrix<T> {
    let flexible = shapes(input);
    let mut composite = input.composites(&flexible);
    let mut coupling = DMatrix::zeros(input.topology.dofs.len(), 6);
    for shapes in &flexible {
        for k in 0..shapes.modal.m {
            let at = &input.placement.pose[shapes.modal.node].p;
            let momentum = shapes.momentum(k).wrench_at(&-at);
            for i in 0..6 {
                coupling[(shapes.modal.first + k, i)] = momentum.get(i);
            }
        }
    }
    for node in (0..composite.len()).rev() {
        let spec = &input.topology.nodes[node];
        for i in spec.first..spec.first + spec.n {
            let momentum = composite[node].apply(&input.placement.column[i]).wrench_at(&-input.placement.pose[node].p);
            for k in 0..6 {
                coupling[(i, k)] = momentum.get(k);
            }
        }
        if let Some((parent, d)) = input.to_parent(node) {
            let moved = composite[node].at(&d);
            composite[parent].add(&moved);
        }
    }
    coupling
}

/// Add M; with gravity or motion K; with motion D, all over the tree coordinates.
pub fn add_inertia<T: Real, E: Entries<T>>(
    input: &InertiaInput<'_, T>,
    mass: &mut E,
    stiffness: &mut E,
    mut gyroscopic: Option<&mut E>,
) {
    let flexible = shapes(input);
    let own = input.composites(&flexible);
    let loads = input.loaded().then(|| {
        let a = input.accelerations();
        let f = input.forces_of(&own, &flexible, &a);
        (a, f)
    });
    let mut composite = own;
    let mut coriolis = coriolis_maps(input, &composite, &flexible);
    let columns = loads.as_ref().map(|(a, _)| carried_columns(input, a));
    for shapes in &flexible {
        let node = shapes.modal.node;
        let a = loads.as_ref().map(|(a, _)| a.body[node]);
        let gyroscopic = gyroscopic.as_deref_mut();
        add_modal(input, shapes, a, columns.as_ref(), mass, stiffness, gyroscopic);
    }
    let mut force = loads.map(|(_, f)| f);
    for node in (0..composite.len()).rev() {
        let spec = &input.topology.nodes[node];
        for i in spec.first..spec.first + spec.n {
            let walk = Walk::start(
                input,
                i,
                &composite[node],
                coriolis.as_ref().map(|c| &c[node]),
                force.as_ref().map(|f| &f[node]),
                columns.as_ref(),
            );
            walk.run(input, (node, Some(node)), i, columns.as_ref(), mass, stiffness, gyroscopic.as_deref_mut());
        }
        if let Some((parent, d)) = input.to_parent(node) {
            let moved = composite[node].at(&d);
            composite[parent].add(&moved);
            if let Some(c) = coriolis.as_mut() {
                let moved = c[node].at(&d);
                c[parent].add(&moved);
            }
            if let Some(f) = force.as_mut() {
                let moved = f[node].wrench_at(&d);
                f[parent] += moved;
            }
        }
    }
}

/// Psi' and Psi": first and second rate of each motion column by the motion of what carries it.
struct Carried<T: Real> {
    first: Option<Vec<Six<T>>>,
    second: Vec<Six<T>>,
}

fn carried_columns<T: Real>(input: &InertiaInput<'_, T>, a: &Accelerations<T>) -> Carried<T> {
    let s = &input.placement.column;
    let velocity = input.rate.and(input.placement.velocity.as_ref());
    let first: Option<Vec<_>> = velocity.map(|v| (0..s.len()).map(|d| v.before[d].cross_motion(&s[d])).collect());
    let second = (0..s.len())
        .map(|d| {
            let by_acceleration = a.before[d].cross_motion(&s[d]);
            match (velocity, first.as_ref()) {
                (Some(v), Some(first)) => by_acceleration + v.before[d].cross_motion(&first[d]),
                _ => by_acceleration,
            }
        })
        .collect();
    Carried { first, second }
}

/// v x* I - I v x + (I v) x*: what a change of velocity does to the inertia force, in axes that move along.
fn coriolis_maps<T: Real>(
    input: &InertiaInput<'_, T>,
    own: &[Composite<T>],
    flexible: &[Shapes<'_, T>],
) -> Option<Vec<Map6<T>>> {
    let velocity = input.rate.and(input.placement.velocity.as_ref())?;
    let map = |n: usize| {
        let (v, i) = (&velocity.body[n], own[n].map());
        let p = own[n].apply(v);
        let (w, l) = (skew(&v.a), skew(&v.l));
        // v x* = [[w, 0], [l, w]] and v x = [[w, l], [0, w]] on (translation, rotation)
        let mut b = Map6 {
            ll: product(&w, &i.ll),
            la: product(&w, &i.la),
            al: product(&l, &i.ll) + product(&w, &i.al),
            aa: product(&l, &i.la) + product(&w, &i.aa),
        };
        b.ll -= product(&i.ll, &w);
        b.la -= product(&i.ll, &l) + product(&i.la, &w);
        b.al -= product(&i.al, &w);
        b.aa -= product(&i.al, &l) + product(&i.aa, &w);
        // m x* p = (m.a x p.l, m.a x p.a + m.l x p.l)
        b.la -= skew(&p.l);
        b.al -= skew(&p.l);
        b.aa -= skew(&p.a);
        b
    };
    let mut all: Vec<_> = (0..own.len()).map(map).collect();
    for shapes in flexible {
        if let Some(c) = shapes.coriolis() {
            all[shapes.modal.node].add(&c);
        }
    }
    Some(all)
}

/// The modal coordinates of one body: among each other, and with all that carries their frame.
fn add_modal<T: Real, E: Entries<T>>(
    input: &InertiaInput<'_, T>,
    shapes: &Shapes<'_, T>,
    acceleration: Option<Six<T>>,
    columns: Option<&Carried<T>>,
    mass: &mut E,
    stiffness: &mut E,
    mut gyroscopic: Option<&mut E>,
) {
    let (m, first, node) = (shapes.modal.m, shapes.modal.first, shapes.modal.node);
    let v = input.twist(node);
    for k in 0..m {
        for l in 0..m {
            mass.add(first + k, first + l, shapes.mass(k, l));
        }
    }
    if let Some(a) = &acceleration {
        for (kl, (by_position, by_rate)) in shapes.modal_tangent(v, a).into_iter().enumerate() {
            let (i, j) = (first + kl / m, first + kl % m);
            stiffness.add(i, j, by_position);
            if let (Some(g), Some(_)) = (gyroscopic.as_deref_mut(), v) {
                g.add(i, j, by_rate);
            }
        }
    }
    for k in 0..m {
        let walk = match &acceleration {
            None => Walk { momentum: shapes.momentum(k), coriolis_row: None, position_column: None, rate_column: None },
            Some(a) => {
                let column = shapes.column(k, v, a);
                Walk {
                    momentum: column.momentum,
                    coriolis_row: v.map(|_| column.coriolis_row),
                    position_column: Some(column.position_column),
                    rate_column: v.map(|_| column.rate_column),
                }
            }
        };
        let gyroscopic = gyroscopic.as_deref_mut();
        walk.run(input, (node, None), first + k, columns, mass, stiffness, gyroscopic);
    }
}

/// The vectors of one coordinate on their way to ground.
struct Walk<T: Real> {
    momentum: Six<T>,
    coriolis_row: Option<Six<T>>,
    position_column: Option<Six<T>>,
    rate_column: Option<Six<T>>,
}

impl<T: Real> Walk<T> {
    fn start(
        input: &InertiaInput<'_, T>,
        i: usize,
        composite: &Composite<T>,
        coriolis: Option<&Map6<T>>,
        force: Option<&Six<T>>,
        columns: Option<&Carried<T>>,
    ) -> Self {
        let s = &input.placement.column[i];
        let first = columns.and_then(|c| c.first.as_ref());
        let position_column = columns.zip(force).map(|(c, f)| {
            let mut q = composite.apply(&c.second[i]) + s.cross_force(f);
            if let (Some(b), Some(first)) = (coriolis, first) {
                q += b.apply(&first[i]);
            }
            q
        });
        let rate_column =
            coriolis.zip(first).map(|(b, first)| b.apply(s) + composite.apply(&first[i]).scaled(T::from(2.0)));
        Walk {
            momentum: composite.apply(s),
            coriolis_row: coriolis.map(|b| b.apply_transposed(s)),
            position_column,
            rate_column,
        }
    }

    #[allow(clippy::too_many_arguments)]
    fn run<E: Entries<T>>(
        mut self,
        input: &InertiaInput<'_, T>,
        (from, node): (usize, Option<usize>),
        i: usize,
        columns: Option<&Carried<T>>,
        mass: &mut E,
        stiffness: &mut E,
        mut gyroscopic: Option<&mut E>,
    ) {
        let topology = input.topology;
        let stage = topology.dofs[i].freedom.stage;
        let mut at = from;
        loop {
            let spec = &topology.nodes[at];
            for j in spec.first..spec.first + spec.n {
                let s = &input.placement.column[j];
                let own = node == Some(at);
                if !own || j <= i {
                    let m = self.momentum.dot(s);
                    mass.add(i, j, m);
                    if i != j {
                        mass.add(j, i, m);
                    }
                }
                let j_stage = topology.dofs[j].freedom.stage;
                if own && j_stage > stage {
                    continue;
                }
                let carries = !own || j_stage < stage;
                self.add_stiffness(i, j, s, carries, columns, stiffness);
                if let Some(g) = gyroscopic.as_deref_mut() {
                    self.add_gyroscopic(i, j, s, carries, columns, g);
                }
            }
            let Some((parent, d)) = input.to_parent(at) else {
                break;
            };
            self.move_by(&d);
            at = parent;
        }
    }

    fn add_stiffness(
        &self,
        i: usize,
        j: usize,
        s: &Six<T>,
        carries: bool,
        columns: Option<&Carried<T>>,
        k: &mut impl Entries<T>,
    ) {
        let (Some(q), Some(columns)) = (self.position_column.as_ref(), columns) else {
            return;
        };
        k.add(j, i, s.dot(q));
        if carries {
            k.add(i, j, self.momentum.dot(&columns.second[j]));
            if let (Some(b), Some(first)) = (self.coriolis_row.as_ref(), columns.first.as_ref()) {
                k.add(i, j, b.dot(&first[j]));
            }
        }
    }

    fn add_gyroscopic(
        &self,
        i: usize,
        j: usize,
        s: &Six<T>,
        carries: bool,
        columns: Option<&Carried<T>>,
        g: &mut impl Entries<T>,
    ) {
        let (Some(column), Some(b), Some(first)) =
            (self.rate_column.as_ref(), self.coriolis_row.as_ref(), columns.and_then(|c| c.first.as_ref()))
        else {
            return;
        };
        g.add(j, i, s.dot(column));
        if carries {
            g.add(i, j, b.dot(s) + self.momentum.dot(&first[j]) * T::from(2.0));
        }
    }

    fn move_by(&mut self, d: &V3<T>) {
        self.momentum = self.momentum.wrench_at(d);
        for w in [&mut self.coriolis_row, &mut self.position_column, &mut self.rate_column].into_iter().flatten() {
            *w = w.wrench_at(d);
        }
    }
}
