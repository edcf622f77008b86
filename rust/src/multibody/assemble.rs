//! Residual and tangent of the whole model in tree coordinates.
//!
//! ```text
//! rho(y, y', y") = inertia - applied + J^T lam,   M = d rho/dy",  D = d rho/dy',  K = d rho/dy at constant lam
//! ```
use std::marker::PhantomData;

use nalgebra::{DMatrix, DVector};

use crate::linalg::entries::Entries;
use crate::model::geometry::Geometry;
use crate::multibody::connector::{Wanted, constraint_interaction, interaction, load_interaction};
use crate::multibody::flexible::{Fold, Folded};
use crate::multibody::inertia::{add_inertia, ground_coupling};
use crate::multibody::inertia_input::InertiaInput;
use crate::multibody::numbers::Numbers;
use crate::multibody::path::{add_tangent, add_wrench};
use crate::multibody::placement::Placement;
use crate::multibody::topology::{Connector, Owner, Topology};
use crate::run::Counts;
use crate::spatial::{Real, Six, absent};

/// What is computed: an effect that a model does not contain costs nothing anyway; these switch off what it contains.
#[derive(Debug, Clone, Copy)]
pub struct Effects {
    /// weight
    pub gravity: bool,
    /// forces of velocities
    pub damping: bool,
    /// Coriolis terms of a linearisation
    pub gyroscopic: bool,
    /// forces of inertia that are quadratic in velocities
    pub centrifugal: bool,
    /// stiffness of forces in springs and of loads that turn
    pub preload_stiffness: bool,
    /// stiffness of forces in joints
    pub constraint_force_stiffness: bool,
    /// slopes of nonlinear laws: off where harmonic balance adds the laws themselves
    pub law_slopes: bool,
    /// laws of dry friction
    pub friction: bool,
    /// laws of contact
    pub contact: bool,
    /// rows that restrict velocities alone
    pub nonholonomic: bool,
    /// motions that joints follow
    pub drives: bool,
    /// forces of the air
    pub aerodynamics: bool,
}

impl Effects {
    /// Everything that the model contains.
    pub const ALL: Effects = Effects {
        gravity: true,
        damping: true,
        gyroscopic: true,
        centrifugal: true,
        preload_stiffness: true,
        constraint_force_stiffness: true,
        law_slopes: true,
        friction: true,
        contact: true,
        nonholonomic: true,
        drives: true,
        aerodynamics: true,
    };

    /// The same forces with tangents that are their derivatives, whatever a linearisation should leave out.
    pub fn with_exact_tangents(self) -> Self {
        Effects {
            preload_stiffness: true,
            constraint_force_stiffness: true,
            law_slopes: true,
            gyroscopic: self.centrifugal,
            ..self
        }
    }

    /// Which forces of connectors and loads act.
    pub(crate) fn wanted(&self) -> Wanted {
        Wanted { damping: self.damping, friction: self.friction, contact: self.contact, ..Wanted::FORCES }
    }
}

/// Everything the assembly reads, over T.
pub struct Scene<'a, T: Real> {
    pub topology: &'a Topology,
    pub geometry: &'a Geometry<T>,
    pub x: &'a [T],
    /// what laws remember; empty means centred
    pub memory: &'a [T],
    pub placement: &'a Placement<T>,
    pub rate: Option<&'a [T]>,
    pub acceleration: Option<&'a [T]>,
    /// what drives and loads read; linear analyses hold it at zero
    pub t: f64,
    pub effects: Effects,
}

#[derive(Debug, Clone)]
pub struct Tangent<T: Real, E = DMatrix<T>> {
    pub mass: E,
    pub damping: Option<E>,
    pub gyroscopic: Option<E>,
    pub stiffness: E,
    pub number: PhantomData<T>,
}

impl<T: Real> Scene<'_, T> {
    pub(crate) fn inertia(&self, with_rates: bool) -> InertiaInput<'_, T> {
        InertiaInput {
            topology: self.topology,
            geometry: self.geometry,
            placement: self.placement,
            rate: self.rate.filter(|_| with_rates),
            acceleration: self.acceleration,
            gravity: self.geometry.gravity.filter(|_| self.effects.gravity),
        }
    }

    /// Per node: what its acceleration would be if no tree coordinate accelerated, gravity left out.
    pub fn carried_accelerations(&self) -> Vec<Six<T>> {
        InertiaInput { acceleration: None, gravity: None, ..self.inertia(true) }.body_accelerations()
    }

    fn damped(&self) -> bool {
        let damps = |c: &Connector| c.c.is_some() || self.effects.law_slopes && c.feels_rates();
        let modal = || self.geometry.flexible.iter().any(|f| f.damped);
        self.has_air() || self.effects.damping && (self.topology.connectors.iter().any(damps) || modal())
    }

    /// How columns of moving nodes come to the coordinates; None without flexible bodies.
    pub fn fold(&self) -> Option<Fold<'_, T>> {
        Fold::of(self.topology, self.geometry, &self.placement.modal)
    }

    pub(crate) fn numbers(&self) -> Numbers<'_, T> {
        Numbers { x: self.x, memory: self.memory, t: self.t }
    }

    /// Per node: applied wrenches about the centre of mass, without inertia and multipliers.
    fn applied(&self) -> Vec<Six<T>> {
        let mut sums = self.connected();
        let wanted = self.effects.wanted();
        for load in 0..self.topology.tables.loads.len() {
            if self.topology.tables.loads[load].mode.is_some() {
                continue;
            }
            let acting = load_interaction(self.topology, self.geometry, self.placement, load, self.t, wanted);
            add_wrench(self.topology, self.placement, &acting, &mut sums);
        }
        for acting in self.air_forces() {
            add_wrench(self.topology, self.placement, &acting, &mut sums);
        }
        sums
    }

    /// The part of springs and dampers in them.
    fn connected(&self) -> Vec<Six<T>> {
        let mut sums = vec![Six::zero(); self.topology.nodes.len()];
        let wanted = self.effects.wanted();
        for c in self.topology.connectors.iter().filter(|c| wanted.acts(c)) {
            let acting = interaction(self.topology, self.geometry, self.placement, self.numbers(), c, wanted);
            add_wrench(self.topology, self.placement, &acting, &mut sums);
        }
        sums
    }

    /// Wrench of every body, inertia - applied (+ constraints of cut joints if `lam` is given), about its centre of mass.
    pub fn body_wrenches(&self, lam: Option<&[T]>) -> Vec<Six<T>> {
        self.wrenches_with(self.inertia(self.effects.centrifugal).forces(), lam)
    }

    fn wrenches_with(&self, inertia: Option<Vec<Six<T>>>, lam: Option<&[T]>) -> Vec<Six<T>> {
        let mut sums: Vec<_> = self.applied().into_iter().map(|w| -w).collect();
        if let Some(forces) = inertia {
            for (sum, f) in sums.iter_mut().zip(forces) {
                *sum += f;
            }
        }
        if let Some(lam) = lam {
            for (sum, w) in sums.iter_mut().zip(self.multiplier_wrenches(lam)) {
                *sum += w;
            }
        }
        sums
    }

    /// J^T lam as wrenches on the bodies, with the sign they have in rho.
    pub fn multiplier_wrenches(&self, lam: &[T]) -> Vec<Six<T>> {
        let mut sums = vec![Six::zero(); self.topology.nodes.len()];
        let wanted = Wanted::FORCES;
        for (joint, rows) in self.cut_multipliers(lam) {
            let acting = constraint_interaction(self.topology, self.geometry, self.placement, joint, &rows, wanted);
            add_wrench(self.topology, self.placement, &acting, &mut sums);
        }
        sums.into_iter().map(|w| -w).collect()
    }

    /// The mass matrix alone.
    pub fn mass(&self) -> DMatrix<T> {
        let n = self.topology.n_tree;
        let mut mass = DMatrix::zeros(n, n);
        self.mass_into(&mut mass, &mut DMatrix::zeros(0, 0));
        mass
    }

    /// The same into any place; `unused` stays as it is.
    pub fn mass_into<E: Entries<T>>(&self, mass: &mut E, unused: &mut E) {
        let unloaded = InertiaInput { rate: None, acceleration: None, gravity: None, ..self.inertia(false) };
        match &self.fold() {
            None => add_inertia(&unloaded, mass, unused, None),
            Some(fold) => {
                let (mut mass, mut unused) = (Folded::new(mass, fold), Folded::new(unused, fold));
                add_inertia(&unloaded, &mut mass, &mut unused, None);
            }
        }
    }

    /// Momentum of a common rigid motion of everything, about the world origin, per tree coordinate (n_tree, 6).
    pub fn ground_coupling(&self) -> DMatrix<T> {
        let coupling = ground_coupling(&self.inertia(false));
        match self.fold() {
            None => coupling,
            Some(fold) => fold.rows_of(&coupling),
        }
    }

    /// The first connector whose force is no number.
    pub fn undirected(&self) -> Option<&str> {
        let tables = &self.topology.tables;
        let lost = |c: &&Connector| {
            let (geometry, placement) = (self.geometry, self.placement);
            let w = interaction(self.topology, geometry, placement, self.numbers(), c, Wanted::FORCES).wrench;
            (0..6).any(|i| !w.get(i).re().is_finite())
        };
        self.topology.connectors.iter().find(lost).map(|c| match c.owner {
            Owner::Element(i) => tables.elements[i].name.as_str(),
            Owner::Joint(i) => tables.joints[i].name.as_str(),
        })
    }

    /// Sum body wrenches to subtrees, about each node's centre of mass.
    pub fn subtree_wrenches(&self, mut sums: Vec<Six<T>>) -> Vec<Six<T>> {
        for node in (0..sums.len()).rev() {
            if let Some(parent) = self.topology.nodes[node].parent {
                let moved = sums[node].wrench_at(&(self.placement.pose[parent].p - self.placement.pose[node].p));
                sums[parent] += moved;
            }
        }
        sums
    }

    /// Generalised forces of body wrenches over the columns.
    pub(crate) fn over_columns(&self, wrenches: Vec<Six<T>>) -> DVector<T> {
        let sums = self.subtree_wrenches(wrenches);
        let columns = self.topology.dofs.iter().zip(&self.placement.column);
        DVector::from_iterator(self.topology.dofs.len(), columns.map(|(dof, s)| s.dot(&sums[dof.node])))
    }

    /// rho in tree coordinates; without `lam` the multipliers are left out.
    pub fn residual(&self, lam: Option<&[T]>) -> DVector<T> {
        let (inertia, modal) = self.inertia(self.effects.centrifugal).all_forces().unzip();
        let all = self.over_columns(self.wrenches_with(inertia, lam));
        match self.fold() {
            None => all,
            Some(fold) => {
                let mut rho = fold.vector(&all);
                self.add_modal_forces(modal, &mut rho);
                rho
            }
        }
    }

    pub fn tangent(&self, lam: Option<&[T]>, counts: &mut Counts) -> Tangent<T> {
        let n = self.topology.n_tree;
        self.tangent_into(lam, counts, || DMatrix::zeros(n, n))
    }

    /// The same into any places.
    pub fn tangent_into<E: Entries<T>>(
        &self,
        lam: Option<&[T]>,
        counts: &mut Counts,
        empty: impl Fn() -> E,
    ) -> Tangent<T, E> {
        let Some(fold) = &self.fold() else {
            return self.tangent_over_columns(lam, counts, empty);
        };
        counts.add("flexible bodies", self.topology.modal.len() as u64);
        let quadratic = fold.is_quadratic();
        let keeps = quadratic && self.rate.or(self.acceleration).is_some();
        let kept = || keeps.then(Vec::new);
        let mut made = self.tangent_over_columns(lam, counts, || Folded { inner: empty(), fold, kept: kept() });
        if quadratic && self.effects.constraint_force_stiffness {
            let forces = self.over_columns(self.body_wrenches(lam));
            fold.add_turned_forces(&forces, &mut made.stiffness.inner);
            counts.add("turning node forces", 1);
        }
        if keeps {
            self.add_moving_fold(fold, &mut made);
        }
        Tangent {
            mass: made.mass.inner,
            damping: made.damping.map(|d| d.inner),
            gyroscopic: made.gyroscopic.map(|g| g.inner),
            stiffness: made.stiffness.inner,
            number: PhantomData,
        }
    }

    /// Rates and accelerations of nodes that move in second order depend on the modal coordinates: w' = E q', w" = E q" + psi q' q'.
    fn add_moving_fold<E: Entries<T>>(&self, fold: &Fold<'_, T>, made: &mut Tangent<T, Folded<'_, T, E>>) {
        let mut take = |from: Option<&mut Folded<'_, T, E>>| from.and_then(|f| f.kept.take()).unwrap_or_default();
        let mass = take(Some(&mut made.mass));
        let [damping, gyroscopic] = [made.damping.as_mut(), made.gyroscopic.as_mut()].map(&mut take);
        let stiffness = &mut made.stiffness.inner;
        if let Some(rate) = self.rate {
            let twice: Vec<T> = rate.iter().map(|v| *v * 2.0).collect();
            if let Some(gyroscopic) = &mut made.gyroscopic {
                fold.add_along(&mass, &twice, &mut gyroscopic.inner);
            }
            fold.add_along(&damping, rate, stiffness);
            if self.effects.centrifugal {
                fold.add_along(&gyroscopic, rate, stiffness);
            }
        }
        if let Some(acceleration) = self.acceleration {
            fold.add_along(&mass, acceleration, stiffness);
        }
    }

    fn tangent_over_columns<E: Entries<T>>(
        &self,
        lam: Option<&[T]>,
        counts: &mut Counts,
        empty: impl Fn() -> E,
    ) -> Tangent<T, E> {
        let (mass, mut stiffness, gyroscopic) = self.inertia_tangent(counts, &empty);
        let mut damping = self.damped().then(&empty);
        self.add_connectors(&mut stiffness, damping.as_mut(), counts);
        self.add_modal_stiffness(&mut stiffness, damping.as_mut().filter(|_| self.effects.damping));
        self.add_loads(&mut stiffness, counts);
        self.add_air(&mut stiffness, damping.as_mut(), counts);
        if let Some(lam) = lam.filter(|_| self.effects.constraint_force_stiffness) {
            self.add_multiplier_stiffness(lam, &mut stiffness, counts);
        }
        self.add_switched(&mut stiffness);
        if self.effects.constraint_force_stiffness && T::NDERIV == 0 {
            self.count_carrying_joints(counts);
        }
        Tangent { mass, damping, gyroscopic, stiffness, number: PhantomData }
    }

    /// M, K of gravity and of velocities, and the gyroscopic matrix of a state that moves.
    pub(crate) fn inertia_tangent<E: Entries<T>>(
        &self,
        counts: &mut Counts,
        empty: impl Fn() -> E,
    ) -> (E, E, Option<E>) {
        let (mut mass, mut stiffness) = (empty(), empty());
        let moving = self.rate.is_some();
        // of a closed loop the stiffness reads them too, since B'' turns
        let turning = self.effects.centrifugal && !self.topology.rows.is_empty();
        let mut gyroscopic = (moving && (self.effects.gyroscopic || turning)).then(&empty);
        add_inertia(
            &self.inertia(self.effects.centrifugal || gyroscopic.is_some()),
            &mut mass,
            &mut stiffness,
            gyroscopic.as_mut(),
        );
        if moving && !self.effects.centrifugal {
            // the velocity terms of K came along with the gyroscopic ones: take them out again
            let mut unused = empty();
            stiffness = empty();
            add_inertia(&self.inertia(false), &mut unused, &mut stiffness, None);
        }
        if self.geometry.gravity.is_some() && self.effects.gravity {
            counts.add("gravity stiffness", 1);
        }
        if moving && (self.effects.gyroscopic || self.effects.centrifugal) {
            counts.add("velocity terms", 1);
        }
        (mass, stiffness, gyroscopic)
    }

    fn add_connectors<E: Entries<T>>(&self, stiffness: &mut E, mut damping: Option<&mut E>, counts: &mut Counts) {
        let geometric = self.effects.preload_stiffness;
        let wanted = Wanted { tangent: true, geometric, laws: self.effects.law_slopes, ..self.effects.wanted() };
        let (mut all, mut laws, mut damped, mut loaded) = (0, 0, 0, 0);
        for c in self.topology.connectors.iter().filter(|c| wanted.acts(c)) {
            let acting = interaction(self.topology, self.geometry, self.placement, self.numbers(), c, wanted);
            let own = damping.as_deref_mut().filter(|_| acting.damped);
            add_tangent(self.topology, self.placement, &acting, geometric, stiffness, own);
            if self.effects.law_slopes {
                laws += (c.laws.len() + c.functions.len()) as u64;
            }
            all += 1;
            damped += u64::from(acting.damped);
            loaded += u64::from(geometric && !acting.wrench.is_absent());
        }
        for (what, n) in [
            ("connector tangents", all),
            ("law tangents", laws),
            ("damper tangents", damped),
            ("preload stiffness", loaded),
        ] {
            if n > 0 {
                counts.add(what, n);
            }
        }
    }

    fn add_loads<E: Entries<T>>(&self, stiffness: &mut E, counts: &mut Counts) {
        let (topology, wanted) = (self.topology, Wanted::GEOMETRY);
        for load in 0..topology.tables.loads.len() {
            if topology.tables.loads[load].mode.is_some() {
                continue;
            }
            let acting = load_interaction(topology, self.geometry, self.placement, load, self.t, wanted);
            add_tangent(topology, self.placement, &acting, true, stiffness, None);
            counts.add("load tangents", 1);
        }
    }

    fn add_air<E: Entries<T>>(&self, stiffness: &mut E, mut damping: Option<&mut E>, counts: &mut Counts) {
        for acting in self.air_tangents() {
            add_tangent(self.topology, self.placement, &acting, true, stiffness, damping.as_deref_mut());
            counts.add("section tangents", 1);
        }
    }

    /// d(J^T lam)/dy of the cut joints, into any place.
    pub fn multiplier_stiffness_into<E: Entries<T>>(&self, lam: &[T], into: &mut E, counts: &mut Counts) {
        match &self.fold() {
            None => self.add_multiplier_stiffness(lam, into, counts),
            Some(fold) => {
                self.add_multiplier_stiffness(lam, &mut Folded::new(&mut *into, fold), counts);
                if fold.is_quadratic() {
                    fold.add_turned_forces(&self.over_columns(self.multiplier_wrenches(lam)), into);
                }
            }
        }
    }

    fn add_multiplier_stiffness<E: Entries<T>>(&self, lam: &[T], stiffness: &mut E, counts: &mut Counts) {
        let wanted = Wanted::GEOMETRY;
        for (joint, rows) in self.cut_multipliers(lam) {
            if rows.iter().all(|(_, l)| absent(l)) {
                continue;
            }
            let acting = constraint_interaction(self.topology, self.geometry, self.placement, joint, &rows, wanted);
            add_tangent(self.topology, self.placement, &acting, true, stiffness, None);
            counts.add("constraint-force stiffness", 1);
        }
        self.add_constraint_stiffness(lam, stiffness);
    }

    /// Effects are switched off in the sense of absolute coordinates (wrenches at the centres of mass, world axes): without the
    /// stiffness of constraint forces S is T^T (df/dq) T. In tree coordinates those forces appear as (dT/dy)^T f of all other
    /// forces, which is taken out here; left-out forces of springs had their share in it, which comes back.
    pub(crate) fn add_switched(&self, stiffness: &mut impl Entries<T>) {
        if !self.effects.constraint_force_stiffness {
            self.add_map_changes(&self.body_wrenches(None), -T::one(), stiffness);
        }
        if !self.effects.preload_stiffness {
            self.add_map_changes(&self.connected(), -T::one(), stiffness);
        }
    }

    /// In tree coordinates the forces of tree joints have their stiffness in the turning columns of all other forces: joints that
    /// carry a force count as work done.
    fn count_carrying_joints(&self, counts: &mut Counts) {
        let sums = self.subtree_wrenches(self.body_wrenches(None));
        let loaded = sums.iter().filter(|w| !w.is_absent()).count();
        if loaded > 0 {
            counts.add("constraint-force stiffness", loaded as u64);
        }
    }

    /// factor x (dT/dy_j)_i . f summed over bodies: with v, w the motion of a body's centre of mass per coordinate, the
    /// translation of the inner of two coordinates turns that of the other, and a carried axis turns with its carrier.
    fn add_map_changes(&self, wrenches: &[Six<T>], factor: T, stiffness: &mut impl Entries<T>) {
        for (node, f) in wrenches.iter().enumerate() {
            if f.is_absent() {
                continue;
            }
            let chain = self.chain(node);
            for (rank_i, i, si) in &chain {
                for (rank_j, j, sj) in &chain {
                    // smaller rank: nearer to ground; equal: axes that do not carry each other
                    let (inner, outer) = if rank_j < rank_i { (sj, si) } else { (si, sj) };
                    let mut change = inner.a.cross(&outer.l).dot(&f.l);
                    if rank_j < rank_i {
                        change += sj.a.cross(&si.a).dot(&f.a);
                    }
                    stiffness.add(*i, *j, change * factor);
                }
            }
        }
    }

    /// The coordinates that move a body: rank along the chain, index, twist at the body's centre of mass.
    fn chain(&self, node: usize) -> Vec<(usize, usize, Six<T>)> {
        let mut out = Vec::new();
        let mut at = Some(node);
        while let Some(n) = at {
            let spec = &self.topology.nodes[n];
            let arm = self.placement.pose[node].p - self.placement.pose[n].p;
            for d in spec.first..spec.first + spec.n {
                let rank = 4 * spec.depth + self.topology.dofs[d].freedom.stage;
                out.push((rank, d, self.placement.column[d].motion_at(&arm)));
            }
            at = spec.parent;
        }
        out
    }
}
