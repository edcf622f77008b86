//! The constraint rows of a scene: of cut joints, drives, couplers and functions, their values, Jacobian, explicit rates in time, multipliers.
//!
//! ```text
//! joint     e = 0  (distance: e - length;  velocity level: g v = 0)
//! drive     e - m(t) = 0,                       Phi_t = -m',  Phi_tt = -m"
//! coupler   e_second - ratio e_first - offset = 0
//! function  Phi(t, u) = 0, or D(t, u) u' + d(t, u) = 0 of several coordinates u, see `constraint`
//! ```
//! A drive of an angle takes the turn nearest to its motion. Rows of an effect that is left out are zero, which the rank-revealing factorisations take for redundant.
use nalgebra::{DMatrix, DVector};

use crate::joint::Coordinate;
use crate::kinematics::relative::whole_turns;
use crate::linalg::entries::{Entries, Nowhere};
use crate::linalg::rows::Block;
use crate::model::constraint::RowSlopes;
use crate::model::geometry::Geometry;
use crate::model::layout::flag::LENGTH_GIVEN;
use crate::model::layout::{coupler, joint};
use crate::multibody::System;
use crate::multibody::assemble::{Effects, Scene};
use crate::multibody::connector::{constraint_bias, constraint_rates, constraint_rows};
use crate::multibody::flexible::FoldedRows;
use crate::multibody::path::path;
use crate::multibody::topology::{ConstraintRow, Level, Purpose, Topology};
use crate::spatial::{Real, Six};

/// Rows of one joint with their multipliers, and what they are for.
pub struct Carried<T> {
    pub purpose: Purpose,
    pub joint: usize,
    pub rows: Vec<(Coordinate, T)>,
}

impl Effects {
    /// Does this row act, or does it belong to an effect that is left out?
    pub fn row(&self, row: &ConstraintRow) -> bool {
        match (row.purpose, row.level) {
            (Purpose::Drive(_), _) => self.drives,
            (_, Level::Velocity) => self.nonholonomic,
            _ => true,
        }
    }
}

impl System {
    /// Factors that make the rows free of units, with the characteristic length for that of each loop.
    pub fn row_scales(&self) -> &[f64] {
        self.row_scales.get_or_init(|| row_scales(self, |_| self.length))
    }
}

/// Factors that make rows free of units: displacements over a length, functions over what natural units of their coordinates change.
pub fn row_scales(system: &System, length: impl Fn(usize) -> f64) -> Vec<f64> {
    let topology = &*system.topology;
    let unit = |x: Coordinate, i: usize| if x.is_length() { length(i) } else { 1.0 };
    let mut scales: Vec<f64> = Vec::with_capacity(topology.rows.len());
    for group in topology.rows.chunk_by(ConstraintRow::belongs_with) {
        let start = scales.len();
        if let Purpose::Constraint(c) = group[0].purpose {
            let spec = &topology.tables.constraints[c];
            let units: Vec<f64> = topology.tables.motions_of(c).map(|(_, x)| unit(x, start)).collect();
            let p = &system.x[spec.x..spec.x + spec.function.n_params()];
            scales.extend(spec.function.sizes(p, &units).into_iter().map(f64::recip));
        } else {
            scales.extend(group.iter().enumerate().map(|(i, row)| unit(row.coordinate, start + i).recip()));
        }
    }
    scales
}

/// Phi_t and Phi_tt at a time: what drives do by themselves.
pub fn driven_rates<T: Real>(
    topology: &Topology,
    geometry: &Geometry<T>,
    effects: Effects,
    t: f64,
) -> (DVector<T>, DVector<T>) {
    let rows = &topology.rows;
    let (mut first, mut second) = (DVector::zeros(rows.len()), DVector::zeros(rows.len()));
    for (i, row) in rows.iter().enumerate() {
        if let (Purpose::Drive(d), true) = (row.purpose, effects.row(row)) {
            let motion = topology.tables.drives[d].motion;
            let [_, rate, acceleration] = geometry.motions[motion].at(t);
            first[i] = -rate;
            second[i] = -acceleration;
        }
    }
    (first, second)
}

impl<T: Real> Scene<'_, T> {
    pub(crate) fn acts(&self, row: &ConstraintRow) -> bool {
        self.effects.row(row)
    }

    /// Values Phi and Jacobian J of all rows; a velocity row has the value zero and its D for Jacobian.
    pub fn constraints(&self) -> (DVector<T>, DMatrix<T>) {
        let mut jacobian = DMatrix::zeros(self.topology.rows.len(), self.topology.n_tree);
        let phi = self.constraints_into(&mut jacobian);
        (phi, jacobian)
    }

    /// Phi, with J into any place.
    pub fn constraints_into<E: Entries<T>>(&self, jacobian: &mut E) -> DVector<T> {
        match &self.fold() {
            None => self.rows_over_columns(jacobian),
            Some(fold) => self.rows_over_columns(&mut FoldedRows { inner: jacobian, fold }),
        }
    }

    fn rows_over_columns(&self, jacobian: &mut impl Entries<T>) -> DVector<T> {
        let rows = &self.topology.rows;
        let mut phi = DVector::zeros(rows.len());
        let mut start = 0;
        while start < rows.len() {
            let end = start + rows[start..].iter().take_while(|r| r.belongs_with(&rows[start])).count();
            if let Purpose::Constraint(c) = rows[start].purpose {
                self.add_constraint(c, start, &mut phi, jacobian);
                start = end;
                continue;
            }
            let coordinates: Vec<_> = rows[start..end].iter().map(|r| r.coordinate).collect();
            let mut value = vec![T::zero(); end - start];
            self.add_rows(rows[start].joint, &coordinates, T::one(), start, &mut value, jacobian);
            for (i, e) in (start..end).zip(value) {
                if self.acts(&rows[i]) {
                    phi[i] = self.value(&rows[i], e, i, jacobian);
                }
            }
            start = end;
        }
        phi
    }

    /// The values of coordinates of a joint; their gradients over the tree coordinates, times a factor, go into J.
    fn add_rows<E: Entries<T>>(
        &self,
        joint: usize,
        coordinates: &[Coordinate],
        factor: T,
        start: usize,
        values: &mut [T],
        jacobian: &mut E,
    ) {
        let (topology, placement) = (self.topology, self.placement);
        let spec = &topology.tables.joints[joint];
        let (point, rows) = constraint_rows(topology, self.geometry, placement, joint, coordinates);
        let entries = if E::KEPT { path(topology, placement, spec.a, spec.b, &point) } else { Vec::new() };
        for (i, (value, g)) in rows.iter().enumerate() {
            values[i] = *value;
            if !self.acts(&topology.rows[start + i]) {
                continue;
            }
            for entry in &entries {
                jacobian.add(start + i, entry.dof, g.dot(&entry.signed()) * factor);
            }
        }
    }

    /// Phi of a row whose coordinate is e.
    fn value(&self, row: &ConstraintRow, e: T, i: usize, jacobian: &mut impl Entries<T>) -> T {
        match row.purpose {
            Purpose::Joint if self.topology.tables.joints[row.joint].kind.has_length() => e - self.distance(row.joint),
            Purpose::Joint | Purpose::Constraint(_) => e,
            Purpose::Drive(d) => {
                let motion = self.topology.tables.drives[d].motion;
                let phi = e - self.geometry.motions[motion].at(self.t)[0];
                if matches!(row.coordinate, Coordinate::Angle { .. }) { phi - whole_turns(phi.re()) } else { phi }
            }
            Purpose::Coupler(c) => {
                let spec = &self.topology.tables.couplers[c];
                let (ratio, offset) = (self.x[spec.x + coupler::RATIO], self.x[spec.x + coupler::OFFSET]);
                let first = self.topology.tables.joints[spec.joints[0]].kind.free_coordinates()[spec.coordinates[0]];
                let mut value = [T::zero()];
                self.add_rows(spec.joints[0], &[first], -ratio, i, &mut value, jacobian);
                e - ratio * value[0] - offset
            }
        }
    }

    /// Phi alone.
    pub fn row_values(&self) -> DVector<T> {
        self.rows_over_columns(&mut Nowhere)
    }

    /// J v: what all rows do at these rates, explicit rates left out.
    pub fn row_rates(&self) -> DVector<T> {
        self.over_joints(|joint, coordinates| {
            constraint_rates(self.topology, self.geometry, self.placement, joint, coordinates)
        })
    }

    /// gamma of J a + gamma = 0: what all rows do at zero a, drives left out; `accelerations` of the bodies at a = 0.
    pub fn row_bias(&self, accelerations: &[Six<T>]) -> DVector<T> {
        let mut bias = self.over_joints(|joint, coordinates| {
            constraint_bias(self.topology, self.geometry, self.placement, joint, coordinates, accelerations)
        });
        self.add_constraint_bias(&mut bias);
        bias
    }

    /// What is linear in the coordinates of joints, per row: `of` the coordinates of one joint.
    fn over_joints(&self, of: impl Fn(usize, &[Coordinate]) -> Vec<T>) -> DVector<T> {
        let (rows, tables) = (&self.topology.rows, &self.topology.tables);
        let mut out = Vec::with_capacity(rows.len());
        for group in rows.chunk_by(ConstraintRow::belongs_with) {
            if let Purpose::Constraint(c) = group[0].purpose {
                out.extend(self.over_motions(c, self.acts(&group[0]), &of));
                continue;
            }
            let coordinates: Vec<_> = group.iter().map(|r| r.coordinate).collect();
            let mut values = of(group[0].joint, &coordinates);
            for (row, value) in group.iter().zip(&mut values) {
                if let Purpose::Coupler(c) = row.purpose {
                    let spec = &tables.couplers[c];
                    let kind = &tables.joints[spec.joints[0]].kind;
                    let first = kind.free_coordinates()[spec.coordinates[0]];
                    *value -= self.x[spec.x + coupler::RATIO] * of(spec.joints[0], &[first])[0];
                }
                if !self.acts(row) {
                    *value = T::zero();
                }
            }
            out.extend(values);
        }
        DVector::from_vec(out)
    }

    /// sum_k c_k of(u_k) of the rows of a constraint.
    fn over_motions(&self, c: usize, acts: bool, of: impl Fn(usize, &[Coordinate]) -> Vec<T>) -> Vec<T> {
        if !acts {
            return vec![T::zero(); self.topology.tables.constraints[c].function.n_rows()];
        }
        let each: Vec<T> = self.topology.tables.motions_of(c).map(|(j, x)| of(j, &[x])[0]).collect();
        let sum = |row: &RowSlopes<T>| row.c.iter().zip(&each).fold(T::zero(), |sum, (c, v)| sum + *c * *v);
        self.constraint_slopes(c).iter().map(sum).collect()
    }

    fn distance(&self, joint: usize) -> T {
        let spec = &self.topology.tables.joints[joint];
        let x = self.x[spec.x + joint::LENGTH];
        if spec.flags & LENGTH_GIVEN != 0 { x } else { self.geometry.joint_length[joint] + x }
    }

    /// Multipliers of both levels with the coordinates they act on, one group per object and joint.
    pub fn carried(&self, lam: &[T]) -> Vec<Carried<T>> {
        let tables = &self.topology.tables;
        let mut out: Vec<Carried<T>> = Vec::new();
        for (row, l) in self.topology.rows.iter().zip(lam) {
            if !self.acts(row) || matches!(row.purpose, Purpose::Constraint(_)) {
                continue;
            }
            match out.last_mut().filter(|c| c.joint == row.joint && c.purpose == row.purpose) {
                Some(c) => c.rows.push((row.coordinate, *l)),
                None => out.push(Carried { purpose: row.purpose, joint: row.joint, rows: vec![(row.coordinate, *l)] }),
            }
            if let Purpose::Coupler(c) = row.purpose {
                let spec = &tables.couplers[c];
                let joint = spec.joints[0];
                let first = tables.joints[joint].kind.free_coordinates()[spec.coordinates[0]];
                out.push(Carried {
                    purpose: row.purpose,
                    joint,
                    rows: vec![(first, -self.x[spec.x + coupler::RATIO] * *l)],
                });
            }
        }
        self.each_constraint(|c, start| {
            let rows = self.constraint_slopes(c);
            for (k, (joint, coordinate)) in tables.motions_of(c).enumerate() {
                let force = rows.iter().zip(&lam[start..]).fold(T::zero(), |sum, (row, l)| sum + row.c[k] * *l);
                out.push(Carried { purpose: Purpose::Constraint(c), joint, rows: vec![(coordinate, force)] });
            }
        });
        out
    }

    /// The same by joint alone.
    pub fn cut_multipliers(&self, lam: &[T]) -> Vec<(usize, Vec<(Coordinate, T)>)> {
        self.carried(lam).into_iter().map(|c| (c.joint, c.rows)).collect()
    }
}

/// The joints, drives, couplers and constraints of a block, in the order of the model.
pub fn block_names(system: &System, block: &Block) -> Vec<String> {
    let topology = &*system.topology;
    let tables = &topology.tables;
    let mut joints: Vec<usize> = block.rows.iter().map(|i| topology.rows[*i].joint).collect();
    joints.extend(block.columns.iter().filter_map(|c| topology.nodes[topology.dofs[*c].node].joint));
    joints.sort_unstable();
    joints.dedup();
    let imposed = block.rows.iter().filter(|i| topology.rows[**i].purpose != Purpose::Joint);
    let imposed = imposed.map(|i| topology.row_name(*i).to_owned());
    joints.into_iter().map(|j| tables.joints[j].name.clone()).chain(imposed).collect()
}
