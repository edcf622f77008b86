//! Inertia of modal coordinates in the floating frame of their body (docs/tables.md has the equations).
//!
//! The rigid part of a deformed body is that of a rigid one with its first moment h and inertia J: the recursion of `inertia`
//! carries it. Here is what modal rates and accelerations add to the frame's force, and the rows of the modal coordinates, by
//! hand-derived derivatives: about the undeformed centre of mass, body axes inside, world axes outside.
use crate::model::flexible::FlexibleGeometry;
use crate::multibody::inertia_input::InertiaInput;
use crate::multibody::topology::Modal;
use crate::spatial::{M3, Map6, Real, Six, V3, skew};

/// int rho a x b of int rho a b^T.
fn axial<T: Real>(p: &M3<T>) -> V3<T> {
    V3::new(p[(1, 2)] - p[(2, 1)], p[(2, 0)] - p[(0, 2)], p[(0, 1)] - p[(1, 0)])
}

fn complement<T: Real>(n: &M3<T>) -> M3<T> {
    M3::from_diagonal_element(n.trace()) - n
}

/// A flexible body at its modal coordinates: S_k and Q_k of its shapes now, its first moment and what deformation adds to the inertia.
pub struct Shapes<'a, T: Real> {
    pub modal: &'a Modal,
    geometry: &'a FlexibleGeometry<T>,
    r: M3<T>,
    s: Vec<V3<T>>,
    q: Vec<M3<T>>,
    h: V3<T>,
    j: M3<T>,
    rate: Option<&'a [T]>,
    acceleration: Option<&'a [T]>,
}

/// Twist and acceleration of the frame in body axes about the centre of mass.
struct Frame<T: Real> {
    v: Six<T>,
    a: Six<T>,
}

impl<T: Real> Frame<T> {
    /// Acceleration of the material point there, gravity included.
    fn a0(&self) -> V3<T> {
        self.a.l + self.v.a.cross(&self.v.l)
    }

    fn field(&self) -> M3<T> {
        let w = skew(&self.v.a);
        skew(&self.a.a) + w * w
    }
}

/// What one modal coordinate does on its way to ground (world axes), and to the other modal coordinates.
pub struct ModalColumn<T: Real> {
    pub momentum: Six<T>,
    pub coriolis_row: Six<T>,
    pub position_column: Six<T>,
    pub rate_column: Six<T>,
}

/// All flexible bodies of a state.
pub fn shapes<'a, T: Real>(input: &InertiaInput<'a, T>) -> Vec<Shapes<'a, T>> {
    let all = &input.topology.modal;
    let Some(base) = all.first().map(|m| m.first) else {
        return Vec::new();
    };
    all.iter()
        .zip(&input.geometry.flexible)
        .map(|(modal, g)| {
            let own = modal.first..modal.first + modal.m;
            let q = &input.placement.modal[own.start - base..own.end - base];
            let rate = input.rate.filter(|_| input.placement.velocity.is_some());
            let r = input.placement.pose[modal.node].r;
            Shapes::new(modal, g, r, q, rate.map(|v| &v[own.clone()]), input.acceleration.map(|a| &a[own]))
        })
        .collect()
}

impl<'a, T: Real> Shapes<'a, T> {
    pub fn new(
        modal: &'a Modal,
        g: &'a FlexibleGeometry<T>,
        r: M3<T>,
        q: &[T],
        rate: Option<&'a [T]>,
        acceleration: Option<&'a [T]>,
    ) -> Self {
        let (m, half) = (g.m(), T::from(0.5));
        let (mut s, mut now) = (g.s.clone(), g.p1.clone());
        let mut h = V3::zeros();
        // int rho (r u^T + u r^T + u u^T)
        let mut n = M3::zeros();
        for k in 0..m {
            let mut second = M3::zeros();
            let mut linear = g.p1[k];
            let mut moment = g.s[k];
            for (l, ql) in q.iter().enumerate() {
                second += g.p2[l * m + k] * *ql;
                if !g.s2.is_empty() {
                    let (s2, p12) = (g.s2[k * m + l] * *ql, g.p12[k * m + l] * *ql);
                    s[k] += s2;
                    now[k] += p12;
                    moment += s2 * half;
                    linear += p12 * half;
                }
            }
            now[k] += second;
            h += moment * q[k];
            n += (linear + linear.transpose() + second) * q[k];
        }
        Shapes { modal, geometry: g, r, s, q: now, h, j: complement(&n), rate, acceleration }
    }

    /// First moment, and the inertia that deformation adds, world axes.
    pub fn composite(&self) -> (V3<T>, M3<T>) {
        (self.r * self.h, self.r * self.j * self.r.transpose())
    }

    fn frame(&self, v: Option<&Six<T>>, a: Option<&Six<T>>) -> Frame<T> {
        let t = self.r.transpose();
        let own = |x: Option<&Six<T>>| x.map_or_else(Six::zero, |x| x.rotated(&t));
        Frame { v: own(v.filter(|_| self.rate.is_some())), a: own(a) }
    }

    fn m(&self) -> usize {
        self.s.len()
    }

    /// d Q_l / d q_k.
    fn slope(&self, k: usize, l: usize) -> M3<T> {
        let m = self.m();
        let first = self.geometry.p2[k * m + l];
        match self.geometry.p12.get(l * m + k) {
            Some(second) => first + second,
            None => first,
        }
    }

    fn second(&self, k: usize, l: usize) -> Option<(&V3<T>, &M3<T>)> {
        let at = k * self.m() + l;
        Some((self.geometry.s2.get(at)?, self.geometry.p12.get(at)?))
    }

    /// S_k q'_k and (tr(Q_k) 1 - Q_k^T) q'_k: what the angular velocity makes a force of.
    fn carried(&self) -> Option<(V3<T>, M3<T>)> {
        let rate = self.rate?;
        let (mut s, mut q) = (V3::zeros(), M3::zeros());
        for (k, v) in rate.iter().enumerate() {
            s += self.s[k] * *v;
            q += complement(&self.q[k].transpose()) * *v;
        }
        Some((s, q))
    }

    /// What modal rates and accelerations add to the frame's inertia force.
    pub fn force(&self, v: Option<&Six<T>>) -> Six<T> {
        let two = T::from(2.0);
        let mut f = Six::zero();
        if let Some(acceleration) = self.acceleration {
            for (k, a) in acceleration.iter().enumerate() {
                f += self.own(k).scaled(*a);
            }
        }
        if let (Some((s, q)), Some(rate)) = (self.carried(), self.rate) {
            let w = self.frame(v, None).v.a;
            f += Six::new(w.cross(&s) * two, q * w * two);
            for (k, vk) in rate.iter().enumerate() {
                for (l, vl) in rate.iter().enumerate() {
                    if let Some((s2, p12)) = self.second(k, l) {
                        f += Six::new(*s2, axial(p12)).scaled(*vk * *vl);
                    }
                }
            }
        }
        f.rotated(&self.r)
    }

    fn own(&self, k: usize) -> Six<T> {
        Six::new(self.s[k], axial(&self.q[k]))
    }

    /// The frame's force by a unit modal acceleration, which is also the modal force by a unit acceleration of the frame.
    pub fn momentum(&self, k: usize) -> Six<T> {
        self.own(k).rotated(&self.r)
    }

    /// d(force)/d(twist), to be added to the rigid part's.
    pub fn coriolis(&self) -> Option<Map6<T>> {
        let (s, q) = self.carried()?;
        let two = T::from(2.0);
        let mut map = Map6::zero();
        map.la = skew(&s) * -two;
        map.aa = q * two;
        Some(map.rotated(&self.r))
    }

    /// sum_l int rho phi_l x phi_k q'_l.
    fn swirl(&self, k: usize) -> V3<T> {
        let m = self.m();
        let mut sum = V3::zeros();
        for (l, v) in self.rate.into_iter().flatten().enumerate() {
            sum += axial(&self.geometry.p2[l * m + k]) * *v;
        }
        sum
    }

    /// Inertia forces on the modal coordinates.
    pub fn residual(&self, v: Option<&Six<T>>, a: Option<&Six<T>>) -> Vec<T> {
        let frame = self.frame(v, a);
        let (a0, field) = (frame.a0(), frame.field());
        let one = |k: usize| {
            let mut f = self.s[k].dot(&a0) + (field * self.q[k]).trace();
            f += frame.v.a.dot(&self.swirl(k)) * T::from(2.0);
            for (l, a) in self.acceleration.into_iter().flatten().enumerate() {
                f += self.mass(k, l) * *a;
            }
            f
        };
        (0..self.m()).map(one).collect()
    }

    pub fn mass(&self, k: usize, l: usize) -> T {
        self.geometry.p2[k * self.m() + l].trace()
    }

    /// d(row k)/d(q_l) and d(row k)/d(q'_l) of the inertia forces.
    pub fn modal_tangent(&self, v: Option<&Six<T>>, a: &Six<T>) -> Vec<(T, T)> {
        let m = self.m();
        let frame = self.frame(v, Some(a));
        let (a0, field) = (frame.a0(), frame.field());
        let mut out = Vec::with_capacity(m * m);
        for k in 0..m {
            for l in 0..m {
                // Q_k by q_l
                let mut stiffness = (field * self.slope(l, k)).trace();
                if let Some((s2, _)) = self.second(k, l) {
                    stiffness += s2.dot(&a0);
                }
                let turning = axial(&self.geometry.p2[l * m + k]);
                out.push((stiffness, frame.v.a.dot(&turning) * T::from(2.0)));
            }
        }
        out
    }

    /// Of the modal coordinate k at a motion of the frame.
    pub fn column(&self, k: usize, v: Option<&Six<T>>, a: &Six<T>) -> ModalColumn<T> {
        let frame = self.frame(v, Some(a));
        let (w, two) = (frame.v.a, T::from(2.0));
        let (s, q) = (&self.s[k], &self.q[k]);
        // by the twist of the frame, in axes that move along (`coriolis_maps` says why the acceleration has a share)
        let turned = (q + q.transpose()) * w - w * (q.trace() * two);
        let own = self.own(k);
        let mut row = Six::zero();
        row.a = frame.v.l.cross(s) * two + turned - own.a.cross(&w) + self.swirl(k) * two;
        let mut by_rate = Six::new(w.cross(s) * two, complement(&q.transpose()) * w * two);
        let mut by_position = self.rigid_slope(k, &frame);
        for (l, vl) in self.rate.into_iter().flatten().enumerate() {
            let d = self.slope(k, l);
            by_position.a += complement(&d.transpose()) * w * (two * *vl);
            if let Some((s2, p12)) = self.second(k, l) {
                by_position.l += w.cross(s2) * (two * *vl);
                by_rate += Six::new(*s2, axial(p12)).scaled(two * *vl);
            }
        }
        for (l, al) in self.acceleration.into_iter().flatten().enumerate() {
            by_position.a += axial(&self.slope(k, l)) * *al;
            if let Some((s2, _)) = self.second(k, l) {
                by_position.l += s2 * *al;
            }
        }
        ModalColumn {
            momentum: own.rotated(&self.r),
            coriolis_row: row.rotated(&self.r),
            position_column: by_position.rotated(&self.r),
            rate_column: by_rate.rotated(&self.r),
        }
    }

    /// The inertia force of the frame with the changes of first moment and inertia by q_k.
    fn rigid_slope(&self, k: usize, frame: &Frame<T>) -> Six<T> {
        let (w, alpha) = (frame.v.a, frame.a.a);
        let (s, q) = (&self.s[k], &self.q[k]);
        let j = complement(&(q + q.transpose()));
        Six::new(frame.field() * s, s.cross(&frame.a0()) + j * alpha + w.cross(&(j * w)))
    }

    /// Kinetic energy that modal coordinates and rates add at a twist of the frame.
    pub fn kinetic(&self, v: &Six<T>) -> T {
        let own = v.rotated(&self.r.transpose());
        let half = T::from(0.5);
        let mut energy = own.l.dot(&own.a.cross(&self.h)) + own.a.dot(&(self.j * own.a)) * half;
        for (k, vk) in self.rate.into_iter().flatten().enumerate() {
            energy += self.own(k).dot(&own) * *vk;
            for (l, vl) in self.rate.into_iter().flatten().enumerate() {
                energy += self.mass(k, l) * *vk * *vl * half;
            }
        }
        energy
    }
}
