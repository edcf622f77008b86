//! What acts between two markers: springs and constraint rows, with their derivatives by hand.
//!
//! Of a coordinate e with gradient g and curvature h, at relative velocity xi and relative virtual velocity eta (both of b against a
//! at p_B, axes A), P depends on e, on e' = g.xi and on its virtual rate g.eta. A displacement z of b against a, twists held, gives
//! ```text
//! de = g.z,   de' = z.(h^T xi) + z_t.(g_t x xi_r),   and likewise with eta
//! ```
//! and a displacement of both together is one of all twists the other way.
use num_dual::Dual;

use crate::force::AnyLaw;
use crate::joint::Coordinate;
use crate::model::constraint::RowSlopes;
use crate::model::layout::flag::LENGTH_GIVEN;
use crate::model::layout::{coupler, joint};
use crate::model::tables::BodyRef;
use crate::multibody::connector::{Local, Wanted, local, pair_of, strains};
use crate::multibody::connector_force::response;
use crate::multibody::numbers::Numbers;
use crate::multibody::placement::Placement;
use crate::multibody::topology::{BoundFunction, BoundLaw, Connector, ConstraintRow, Natural, Owner, Purpose};
use crate::spatial::{Real, Six, absent};

use super::flexible::OnTape;
use super::tree::{Bodies, Twists, body_rotation, marker_back};
use super::{Power, Slopes};

/// Derivatives of P by a coordinate, its rate and its virtual rate.
struct Entry<T: Real> {
    coordinate: Coordinate,
    g: Six<T>,
    by: [T; 3],
}

/// A pair of markers with the twists between them.
struct Link<T: Real> {
    a: BodyRef,
    b: BodyRef,
    owner: Owner,
    here: Local<T>,
    /// relative velocity and relative virtual velocity
    xi: Six<T>,
    eta: Six<T>,
}

impl<T: Real> Link<T> {
    /// The three adjoints in the axes of A: of the displacement of b, of both relative twists.
    fn wrenches(&self, entries: &[Entry<T>]) -> [Six<T>; 3] {
        let (mut moved, mut rate, mut virtual_) = (Six::zero(), Six::zero(), Six::zero());
        for e in entries {
            moved += e.g.scaled(e.by[0]);
            rate += e.g.scaled(e.by[1]);
            virtual_ += e.g.scaled(e.by[2]);
            let felt = self.xi.scaled(e.by[1]) + self.eta.scaled(e.by[2]);
            if !matches!(e.coordinate, Coordinate::Translation(_)) {
                moved += self.here.relative.curvature(e.coordinate).apply_transposed(&felt);
            }
            moved.l += e.g.l.cross(&felt.a);
        }
        [moved, rate, virtual_]
    }

    /// d/d(radius) of a rolling disc and d/d(pitch) of a screw.
    fn by_sizes(&self, entries: &[Entry<T>]) -> [T; 2] {
        let (zero, one) = (T::zero(), T::one());
        let disc = entries.iter().any(|e| matches!(e.coordinate, Coordinate::Disc(_)));
        let thread = entries.iter().any(|e| e.coordinate == Coordinate::Thread);
        [
            if disc { self.by_size(entries, [one, zero]) } else { zero },
            if thread { self.by_size(entries, [zero, one]) } else { zero },
        ]
    }

    fn by_size(&self, entries: &[Entry<T>], along: [T; 2]) -> T {
        let r = &self.here.relative;
        let moved = crate::kinematics::relative::Relative {
            u: r.u.map(Dual::from_re),
            r: r.r.map(Dual::from_re),
            radius: Dual::new(r.radius, along[0]),
            pitch: Dual::new(r.pitch, along[1]),
            turned: r.turned,
        };
        let mut sum = T::zero();
        for e in entries {
            let row = moved.row(e.coordinate);
            let g = Six::new(row.g.l.map(|v| v.eps), row.g.a.map(|v| v.eps));
            sum += row.e.eps * e.by[0] + g.dot(&self.xi) * e.by[1] + g.dot(&self.eta) * e.by[2];
        }
        sum
    }
}

impl<T: OnTape> Power<'_, '_, T> {
    fn link(&self, at: &Placement<T>, twists: &Twists<T>, a: BodyRef, b: BodyRef, owner: Owner) -> Link<T> {
        let topology = self.eq.topology();
        let here = local(topology, at, a, b, pair_of(&self.eq.geometry, owner));
        let of = |body: BodyRef| {
            topology.node(body).map_or_else(Six::zero, |n| twists.virtual_[n].motion_at(&(here.b.p - at.pose[n].p)))
        };
        let eta = (of(b) - of(a)).rotated(&here.a.r.transpose());
        let xi = here.twist.unwrap_or_else(Six::zero);
        Link { a, b, owner, here, xi, eta }
    }

    fn link_back(
        &self,
        at: &Placement<T>,
        link: &Link<T>,
        entries: &[Entry<T>],
        bodies: &mut Bodies<T>,
        out: &mut Slopes<T>,
    ) {
        let topology = self.eq.topology();
        let (pa, pb) = (&link.here.a, &link.here.b);
        let [moved, rate, virtual_] = link.wrenches(entries).map(|w| w.rotated(&pa.r));
        let (xi, eta) = (link.xi.rotated(&pa.r), link.eta.rotated(&pa.r));
        let together = -moved - xi.cross_force(&rate) - eta.cross_force(&virtual_);
        for (body, sign, displaced) in [(link.b, 1.0, moved), (link.a, -1.0, together)] {
            let Some(n) = topology.node(body) else {
                continue;
            };
            let d = at.pose[n].p - pb.p;
            let sign = T::from(sign);
            bodies.displaced[n] += displaced.wrench_at(&d);
            bodies.velocity[n] += rate.wrench_at(&d).scaled(sign);
            bodies.virtual_[n] += virtual_.wrench_at(&d).scaled(sign);
        }
        let of = pair_of(&self.eq.geometry, link.owner);
        let onto = match link.owner {
            Owner::Element(i) => &mut out.geometry.elements[i],
            Owner::Joint(i) => &mut out.geometry.joints[i],
        };
        let (ra, rb) = (body_rotation(topology, at, link.a), body_rotation(topology, at, link.b));
        marker_back(&mut onto.b, &of.b, &rb, &moved);
        marker_back(&mut onto.a, &of.a, &ra, &together.wrench_at(&(pa.p - pb.p)));
        let [radius, pitch] = link.by_sizes(entries);
        onto.radius += radius;
        onto.pitch += pitch;
    }

    /// f(e, e') e'(U) of all springs, dampers and laws.
    pub fn springs_back(&self, at: &Placement<T>, twists: &Twists<T>, bodies: &mut Bodies<T>, out: &mut Slopes<T>) {
        for c in &self.eq.topology().connectors {
            let link = self.link(at, twists, c.a, c.b, c.owner);
            let rows: Vec<_> = c.coordinates.iter().map(|x| link.here.relative.row(*x)).collect();
            let numbers = Numbers { x: &self.eq.x, memory: &self.motion.memory, t: self.motion.t };
            let e = strains(c, &self.eq.geometry, numbers, &link.here, &rows);
            let rates: Vec<T> = rows.iter().map(|r| r.g.dot(&link.xi)).collect();
            let f = T::from(self.factor);
            let virtual_: Vec<T> = rows.iter().map(|r| r.g.dot(&link.eta) * f).collect();
            let wanted = Wanted { tangent: true, laws: true, ..self.eq.effects.wanted() };
            let mut made = response(c, numbers, &e, Some(&rates), wanted);
            if !wanted.damping {
                self.add_slopes_by_rate(c, &e, &rates, wanted, &mut made.c);
            }
            let of = |slopes: &[[T; 6]; 6], j: usize| {
                virtual_.iter().enumerate().fold(T::zero(), |s, (i, v)| s + *v * slopes[i][j])
            };
            let entries: Vec<_> = (0..e.len())
                .map(|j| Entry {
                    coordinate: c.coordinates[j],
                    g: rows[j].g,
                    by: [of(&made.k, j), of(&made.c, j), made.force[j] * f],
                })
                .collect();
            self.natural_back(c, entries[0].by[0], out);
            self.numbers_back(c, &e, &rates, &virtual_, wanted, out);
            self.link_back(at, &link, &entries, bodies, out);
        }
    }

    /// Without damping slopes by rates are not made, but a law still feels them.
    fn add_slopes_by_rate(&self, c: &Connector, e: &[T], v: &[T], wanted: Wanted, onto: &mut [[T; 6]; 6]) {
        let feels = |l: &&BoundLaw| wanted.law(l.law) && l.law.uses_velocity();
        for bound in c.laws.iter().filter(feels) {
            let (law, i) = (bound.law, bound.component);
            let numbers = &self.eq.x[bound.x..bound.x + law.n_params()];
            let p: Vec<_> = numbers.iter().map(|v| Dual::from_re(*v)).collect();
            let rate = Dual::new(v[i], T::one());
            let memory = &self.motion.memory[bound.memory..bound.memory + law.n_memory()];
            let z: Vec<_> = memory.iter().map(|v| Dual::from_re(*v)).collect();
            onto[i][i] += law.force(Dual::from_re(e[i]), rate, &p, &z, &mut z.clone()).eps;
        }
        for bound in c.functions.iter().filter(|f| f.law.uses_rate()) {
            let (e, v) = (bound.own(Some(e)), bound.own(Some(v)));
            let made = bound.law.slopes(self.motion.t, &e, &v, bound.numbers(&self.eq.x), true);
            for (a, i) in bound.coordinates.iter().enumerate() {
                for (b, j) in bound.coordinates.iter().enumerate() {
                    onto[*i][*j] += made.c[a][b];
                }
            }
        }
    }

    fn natural_back(&self, c: &Connector, by: T, out: &mut Slopes<T>) {
        match c.natural {
            Natural::Zero => {}
            Natural::Value { x } => out.x[x] -= by,
            Natural::Length { x, given } => {
                out.x[x] -= by;
                if let (false, Owner::Element(i)) = (given, c.owner) {
                    out.geometry.element_length[i] -= by;
                }
            }
        }
    }

    /// By stiffnesses, dampings, preloads and the parameters of laws.
    fn numbers_back(&self, c: &Connector, e: &[T], v: &[T], virtual_: &[T], wanted: Wanted, out: &mut Slopes<T>) {
        let n = e.len();
        let mut linear = |start: Option<usize>, of: &[T]| {
            let Some(start) = start else { return };
            for (i, w) in virtual_.iter().enumerate() {
                if !c.full {
                    out.x[start + i] += *w * of[i];
                    continue;
                }
                for (j, u) in of.iter().enumerate() {
                    out.x[start + i * n + j] += *w * *u;
                }
            }
        };
        linear(c.k, e);
        linear(c.c.filter(|_| wanted.damping), v);
        if let Some(p) = c.preload {
            for (i, w) in virtual_.iter().enumerate() {
                out.x[p + i] += *w;
            }
        }
        for law in c.laws.iter().filter(|l| wanted.law(l.law)) {
            let i = law.component;
            self.law_back(law, e[i], v[i], virtual_[i], out);
        }
        for function in &c.functions {
            self.function_back(function, e, v, virtual_, out);
        }
    }

    /// Each parameter and each memory in turn with a dual number.
    fn law_back(&self, bound: &BoundLaw, e: T, v: T, by: T, out: &mut Slopes<T>) {
        let law: AnyLaw = bound.law;
        let (n, m) = (law.n_params(), law.n_memory());
        let lift = |a: &[T]| a.iter().map(|v| Dual::from_re(*v)).collect::<Vec<_>>();
        let mut p = lift(&self.eq.x[bound.x..bound.x + n]);
        let remembered = self.motion.memory.get(bound.memory..bound.memory + m);
        let mut z = remembered.map_or_else(|| vec![Dual::from_re(T::zero()); m], lift);
        let mut new = z.clone();
        for k in 0..n + m {
            let seed = if k < n { &mut p[k] } else { &mut z[k - n] };
            seed.eps = T::one();
            let force = law.force(Dual::from_re(e), Dual::from_re(v), &p, &z, &mut new);
            if k < n {
                p[k].eps = T::zero();
                out.x[bound.x + k] += force.eps * by;
            } else {
                z[k - n].eps = T::zero();
                if let Some(slot) = out.memory.get_mut(bound.memory + k - n) {
                    *slot += force.eps * by;
                }
            }
        }
    }

    /// Each parameter of a function in turn with a dual number.
    fn function_back(&self, bound: &BoundFunction, e: &[T], v: &[T], by: &[T], out: &mut Slopes<T>) {
        let lift = |a: &[T]| a.iter().map(|v| Dual::from_re(*v)).collect::<Vec<_>>();
        let (e, v) = (lift(&bound.own(Some(e))), lift(&bound.own(Some(v))));
        let (by, mut p) = (bound.own(Some(by)), lift(bound.numbers(&self.eq.x)));
        for k in 0..p.len() {
            p[k].eps = T::one();
            let force = bound.law.force(self.motion.t, &e, &v, &p);
            p[k].eps = T::zero();
            for (f, by) in force.iter().zip(&by) {
                out.x[bound.x + k] += f.eps * *by;
            }
        }
    }

    /// All constraint rows with their weights.
    pub fn rows_back(&self, at: &Placement<T>, twists: &Twists<T>, bodies: &mut Bodies<T>, out: &mut Slopes<T>) {
        let rows = &self.eq.topology().rows;
        let mut start = 0;
        while start < rows.len() {
            let same = rows[start..].iter().take_while(|r| r.belongs_with(&rows[start])).count();
            if let (Purpose::Constraint(c), true) = (rows[start].purpose, self.eq.effects.row(&rows[start])) {
                self.constraint_back(at, twists, c, start, bodies, out);
            }
            let all: Vec<_> = (start..start + same)
                .filter(|i| self.eq.effects.row(&rows[*i]) && !matches!(rows[*i].purpose, Purpose::Constraint(_)))
                .map(|i| (i, rows[i].coordinate))
                .collect();
            let factor = T::one();
            self.coordinates_back(at, twists, rows[start].joint, &all, factor, bodies, out);
            for (i, _) in &all {
                self.purpose_back(at, twists, &rows[*i], *i, bodies, out);
            }
            start += same;
        }
    }

    /// Rows that are functions of several coordinates u: alpha Phi + beta (c u' + s) + kappa c e'(U).
    fn constraint_back(
        &self,
        at: &Placement<T>,
        twists: &Twists<T>,
        c: usize,
        start: usize,
        bodies: &mut Bodies<T>,
        out: &mut Slopes<T>,
    ) {
        let tables = &self.eq.topology().tables;
        let spec = &tables.constraints[c];
        let weights: Vec<[T; 3]> = (start..start + spec.function.n_rows()).map(|i| self.weights(i)).collect();
        if weights.iter().flatten().all(absent) {
            return;
        }
        let links: Vec<_> = (tables.motions_of(c))
            .map(|(j, x)| {
                let joint = &tables.joints[j];
                let link = self.link(at, twists, joint.a, joint.b, Owner::Joint(j));
                let row = link.here.relative.row(x);
                (x, row, [row.g.dot(&link.xi), row.g.dot(&link.eta)], link)
            })
            .collect();
        let lift = |v: T| Dual::from_re(v);
        let time = lift(self.time);
        let mut u: Vec<_> = links.iter().map(|(_, row, ..)| lift(row.e)).collect();
        let mut p: Vec<_> = self.eq.x[spec.x..spec.x + spec.function.n_params()].iter().map(|v| lift(*v)).collect();
        let by = |rows: &[RowSlopes<Dual<T>>]| {
            let mut sum = T::zero();
            for (row, [alpha, beta, kappa]) in rows.iter().zip(&weights) {
                sum += row.value.eps * *alpha + row.s.eps * *beta;
                for (c, (_, _, [rate, virtual_], _)) in row.c.iter().zip(&links) {
                    sum += c.eps * (*rate * *beta + *virtual_ * *kappa);
                }
            }
            sum
        };
        for k in 0..p.len() {
            p[k].eps = T::one();
            out.x[spec.x + k] += by(&spec.function.slopes(time, &u, &p));
            p[k].eps = T::zero();
        }
        for (k, (coordinate, row, _, link)) in links.iter().enumerate() {
            u[k].eps = T::one();
            let rows = spec.function.slopes(time, &u, &p);
            u[k].eps = T::zero();
            let mut entry = Entry { coordinate: *coordinate, g: row.g, by: [by(&rows), T::zero(), T::zero()] };
            for (row, [_, beta, kappa]) in rows.iter().zip(&weights) {
                entry.by[1] += row.c[k].re * *beta;
                entry.by[2] += row.c[k].re * *kappa;
            }
            self.link_back(at, link, &[entry], bodies, out);
        }
    }

    fn weights(&self, i: usize) -> [T; 3] {
        [self.alpha, self.beta, self.kappa].map(|w| w.get(i).copied().unwrap_or_else(T::zero))
    }

    /// Coordinates of a joint, times a factor in their rows; the value and rates of the first.
    #[allow(clippy::too_many_arguments)]
    fn coordinates_back(
        &self,
        at: &Placement<T>,
        twists: &Twists<T>,
        joint: usize,
        coordinates: &[(usize, Coordinate)],
        factor: T,
        bodies: &mut Bodies<T>,
        out: &mut Slopes<T>,
    ) -> Option<[T; 3]> {
        let idle = |(i, _): &(usize, Coordinate)| self.weights(*i).iter().all(absent);
        if coordinates.iter().all(idle) {
            return None;
        }
        let spec = &self.eq.topology().tables.joints[joint];
        let link = self.link(at, twists, spec.a, spec.b, Owner::Joint(joint));
        let mut first = None;
        let mut entries = Vec::with_capacity(coordinates.len());
        for (i, coordinate) in coordinates {
            let row = link.here.relative.row(*coordinate);
            first.get_or_insert_with(|| [row.e, row.g.dot(&link.xi), row.g.dot(&link.eta)]);
            entries.push(Entry { coordinate: *coordinate, g: row.g, by: self.weights(*i).map(|w| w * factor) });
        }
        self.link_back(at, &link, &entries, bodies, out);
        first
    }

    /// What a row holds its coordinate against: a length, a motion, the coordinate of another joint.
    fn purpose_back(
        &self,
        at: &Placement<T>,
        twists: &Twists<T>,
        row: &ConstraintRow,
        i: usize,
        bodies: &mut Bodies<T>,
        out: &mut Slopes<T>,
    ) {
        let (topology, by) = (self.eq.topology(), self.weights(i));
        let tables = &topology.tables;
        match row.purpose {
            Purpose::Constraint(_) => {}
            Purpose::Joint => {
                let spec = &tables.joints[row.joint];
                if spec.kind.has_length() {
                    out.x[spec.x + joint::LENGTH] -= by[0];
                    if spec.flags & LENGTH_GIVEN == 0 {
                        out.geometry.joint_length[row.joint] -= by[0];
                    }
                }
            }
            Purpose::Drive(d) => {
                let onto = &mut out.motions[tables.drives[d].motion];
                onto[0] -= by[0];
                onto[1] -= by[1];
            }
            Purpose::Coupler(c) => {
                let spec = &tables.couplers[c];
                let (joint, ratio) = (spec.joints[0], self.eq.x[spec.x + coupler::RATIO]);
                let first = tables.joints[joint].kind.free_coordinates()[spec.coordinates[0]];
                let one = [(i, first)];
                let found = self.coordinates_back(at, twists, joint, &one, -ratio, bodies, out);
                if let Some([e, rate, virtual_]) = found {
                    out.x[spec.x + coupler::RATIO] -= e * by[0] + rate * by[1] + virtual_ * by[2];
                    out.x[spec.x + coupler::OFFSET] -= by[0];
                }
            }
        }
    }
}
