//! Rows that are functions of several joint coordinates u_k with gradients G_k over the tree coordinates.
//!
//! ```text
//! J = sum_k c_k G_k,    gamma = sum_k c_k (G_k)' v + c_k' u_k' + s',    d(J^T lam)/dy = lam (sum_k c_k dG_k/dy + sum_kl (dc_k/du_l) G_k^T G_l)
//! ```
use nalgebra::DVector;

use crate::constraint::rows::driven_rates;
use crate::joint::Coordinate;
use crate::linalg::entries::Entries;
use crate::model::constraint::{ConstraintSpec, RowSlopes};
use crate::multibody::assemble::Scene;
use crate::multibody::connector::{constraint_rates, constraint_rows};
use crate::multibody::path::path;
use crate::multibody::topology::{Purpose, Topology};
use crate::spatial::{Real, absent};

/// Do rows of functions have rates by themselves?
pub fn has_explicit_rates(topology: &Topology) -> bool {
    topology.tables.constraints.iter().any(|c| c.function.has_explicit_rates())
}

impl<T: Real> Scene<'_, T> {
    fn constraint(&self, c: usize) -> (&ConstraintSpec, &[T]) {
        let spec = &self.topology.tables.constraints[c];
        (spec, &self.x[spec.x..spec.x + spec.function.n_params()])
    }

    /// u.
    fn constraint_motions(&self, c: usize) -> Vec<T> {
        let (topology, geometry, placement) = (self.topology, self.geometry, self.placement);
        let value = |(j, x): (usize, Coordinate)| constraint_rows(topology, geometry, placement, j, &[x]).1[0].0;
        topology.tables.motions_of(c).map(value).collect()
    }

    /// u', zero at rest.
    fn constraint_motion_rates(&self, c: usize) -> Vec<T> {
        let (topology, geometry, placement) = (self.topology, self.geometry, self.placement);
        let rate = |(j, x): (usize, Coordinate)| constraint_rates(topology, geometry, placement, j, &[x])[0];
        topology.tables.motions_of(c).map(rate).collect()
    }

    /// Its rows here.
    pub(crate) fn constraint_slopes(&self, c: usize) -> Vec<RowSlopes<T>> {
        let (spec, p) = self.constraint(c);
        spec.function.slopes(T::from(self.t), &self.constraint_motions(c), p)
    }

    /// The gradient of each motion, by tree coordinate.
    fn constraint_gradients(&self, c: usize) -> Vec<Vec<(usize, T)>> {
        let (topology, placement) = (self.topology, self.placement);
        let gradient = |(j, x): (usize, Coordinate)| {
            let spec = &topology.tables.joints[j];
            let (point, rows) = constraint_rows(topology, self.geometry, placement, j, &[x]);
            let entries = path(topology, placement, spec.a, spec.b, &point);
            entries.iter().map(|e| (e.dof, rows[0].1.dot(&e.signed()))).collect()
        };
        topology.tables.motions_of(c).map(gradient).collect()
    }

    /// Phi of its rows, which begin at `start`; their gradients go into J.
    pub(crate) fn add_constraint<E: Entries<T>>(&self, c: usize, start: usize, phi: &mut DVector<T>, jacobian: &mut E) {
        let rows = self.constraint_slopes(c);
        let gradients = if E::KEPT { self.constraint_gradients(c) } else { Vec::new() };
        for (i, row) in rows.iter().enumerate().filter(|(i, _)| self.acts(&self.topology.rows[start + i])) {
            phi[start + i] = row.value;
            for (c, gradient) in row.c.iter().zip(&gradients) {
                gradient.iter().for_each(|(dof, g)| jacobian.add(start + i, *dof, *g * *c));
            }
        }
    }

    /// Phi_t of drives and of functions, d of velocity rows.
    pub fn explicit_rates(&self) -> DVector<T> {
        let mut rates = driven_rates(self.topology, self.geometry, self.effects, self.t).0;
        self.add_explicit_rates(&mut rates);
        rates
    }

    /// The name of a constraint whose rows change by themselves, or whose changes are not known, so that the equations about a moving
    /// state have no constant matrices.
    pub fn changing_constraint(&self) -> Option<&str> {
        let mut name = None;
        self.each_constraint(|c, _| {
            let (spec, p) = self.constraint(c);
            let u = self.constraint_motions(c);
            let none = vec![T::zero(); u.len()];
            let later = spec.function.along((T::from(self.t), T::one()), &u, &none, p);
            let mut changes = !spec.function.is_traced()
                || later.iter().any(|row| !absent(&row.s.eps) || row.c.iter().any(|c| !absent(&c.eps)));
            for l in 0..u.len() {
                let mut du = none.clone();
                du[l] = T::one();
                let moved = spec.function.along((T::from(self.t), T::zero()), &u, &du, p);
                changes |= moved.iter().any(|row| !absent(&row.s.eps));
            }
            if changes {
                name = name.or(Some(c));
            }
        });
        name.map(|c: usize| self.topology.tables.constraints[c].name.as_str())
    }

    /// The part of functions in them.
    pub fn add_explicit_rates(&self, rates: &mut DVector<T>) {
        self.each_constraint(|c, start| {
            if !self.constraint(c).0.function.has_explicit_rates() {
                return;
            }
            for (i, row) in self.constraint_slopes(c).iter().enumerate() {
                rates[start + i] += row.s;
            }
        });
    }

    /// c' u' + s' of all rows.
    pub(crate) fn add_constraint_bias(&self, bias: &mut DVector<T>) {
        self.each_constraint(|c, start| {
            let (spec, p) = self.constraint(c);
            let (u, du) = (self.constraint_motions(c), self.constraint_motion_rates(c));
            let rows = spec.function.along((T::from(self.t), T::one()), &u, &du, p);
            for (i, row) in rows.iter().enumerate() {
                bias[start + i] += row.c.iter().zip(&du).fold(row.s.eps, |sum, (c, v)| sum + c.eps * *v);
            }
        });
    }

    /// lam (dc_k/du_l) G_k^T G_l of all rows.
    pub(crate) fn add_constraint_stiffness(&self, lam: &[T], stiffness: &mut impl Entries<T>) {
        self.each_constraint(|c, start| {
            let (spec, p) = self.constraint(c);
            let (m, n) = (spec.function.m(), spec.function.n_rows());
            let lam = &lam[start..start + n];
            if lam.iter().all(absent) {
                return;
            }
            let (u, gradients) = (self.constraint_motions(c), self.constraint_gradients(c));
            for l in 0..m {
                let mut du = vec![T::zero(); m];
                du[l] = T::one();
                let rows = spec.function.along((T::from(self.t), T::zero()), &u, &du, p);
                for k in 0..m {
                    let slope = rows.iter().zip(lam).fold(T::zero(), |sum, (row, lam)| sum + row.c[k].eps * *lam);
                    if absent(&slope) {
                        continue;
                    }
                    for (i, a) in &gradients[k] {
                        gradients[l].iter().for_each(|(j, b)| stiffness.add(*i, *j, slope * *a * *b));
                    }
                }
            }
        });
    }

    /// Constraints that act, each with its first row.
    pub(crate) fn each_constraint(&self, mut to: impl FnMut(usize, usize)) {
        let mut start = 0;
        for group in self.topology.rows.chunk_by(|a, b| a.belongs_with(b)) {
            if let (Purpose::Constraint(c), true) = (group[0].purpose, self.acts(&group[0])) {
                to(c, start);
            }
            start += group.len();
        }
    }
}
