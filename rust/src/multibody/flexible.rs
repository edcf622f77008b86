//! Modal coordinates and the nodes that they move.
//!
//! A moving node is a massless body on six columns behind the frame (three displacements w and three successive rotations), or
//! before it where the tree comes from there. The columns are not coordinates: w = phi q is linear, so that all that is assembled
//! over columns comes to the coordinates by the constant map E, X -> E^T X E, f -> E^T f.
use nalgebra::DVector;

use crate::linalg::entries::Entries;
use crate::model::flexible::TipGeometry;
use crate::model::geometry::Geometry;
use crate::multibody::topology::{Node, Topology};
use crate::spatial::{M3, Pose, Real, Six, V3, absent, exp_so3};

/// Modal coordinates of all flexible bodies.
pub fn modal_coordinates<T: Real>(topology: &Topology, q: &[T]) -> Vec<T> {
    topology.modal.first().map_or_else(Vec::new, |m| q[m.q..].to_vec())
}

/// Which modal coordinates move a node, counted among the modal ones.
pub fn movers(topology: &Topology, node: &Node) -> (usize, std::ops::Range<usize>) {
    let tip = topology.tip(node);
    let own = &topology.modal[topology.tables.tips[tip].flexible];
    let first = own.first - topology.modal[0].first;
    (tip, first..first + own.m)
}

/// Displacements and angles of a node's columns from values of the modal coordinates.
pub fn node_values<T: Real>(topology: &Topology, geometry: &Geometry<T>, node: &Node, modal: &[T]) -> [T; 6] {
    let (tip, own) = movers(topology, node);
    geometry.tips[tip].of(&modal[own])
}

/// Rates (or accelerations) of the columns of all moving nodes from those of the tree coordinates.
pub fn node_rates<T: Real>(topology: &Topology, geometry: &Geometry<T>, rate: &[T]) -> Vec<T> {
    let Some(modal) = topology.modal.first() else {
        return Vec::new();
    };
    let values = &rate[modal.first..];
    let nodes = topology.nodes.iter().filter(|n| n.kind.is_modal());
    nodes.flat_map(|n| node_values(topology, geometry, n, values)).collect()
}

fn about<T: Real>(axis: usize, angle: T) -> M3<T> {
    let mut w = V3::zeros();
    w[axis] = angle;
    exp_so3(&w)
}

/// The pose of a displaced node in its undeformed place, or the other way round.
pub fn deformed<T: Real>(w: &[T; 6], reversed: bool) -> Pose<T> {
    let pose = Pose { p: V3::new(w[0], w[1], w[2]), r: about(0, w[3]) * about(1, w[4]) * about(2, w[5]) };
    if reversed { pose.inverse() } else { pose }
}

/// The six columns of a node: twists of the outer body, at `at`.
pub fn node_columns<T: Real>(
    frame: &Pose<T>,
    tip: &V3<T>,
    at: &V3<T>,
    w: &[T; 6],
    reversed: bool,
    columns: &mut [Six<T>],
) {
    let sign = T::from(if reversed { -1.0 } else { 1.0 });
    let first = frame.r * about(0, w[3]);
    let second = first * about(1, w[4]);
    let arm = at - tip;
    for (i, column) in columns.iter_mut().enumerate().take(3) {
        *column = Six::new(frame.r.column(i) * sign, V3::zeros());
    }
    for (i, axes) in [frame.r, first, second].iter().enumerate() {
        let axis: V3<T> = axes.column(i) * sign;
        columns[3 + i] = Six::new(axis.cross(&arm), axis);
    }
}

/// E: the rows of the columns of moving nodes; those of the coordinates are the identity.
pub struct Fold<'g, T: Real> {
    n_tree: usize,
    /// of each moving node, six columns: its first modal coordinate and its shape
    nodes: Vec<(usize, &'g TipGeometry<T>)>,
}

impl<'g, T: Real> Fold<'g, T> {
    /// None without flexible bodies.
    pub fn of(topology: &Topology, geometry: &'g Geometry<T>) -> Option<Self> {
        let first = topology.modal.first()?.first;
        let nodes = topology.nodes.iter().filter(|n| n.kind.is_modal());
        let of = |node: &Node| {
            let (tip, own) = movers(topology, node);
            (first + own.start, &geometry.tips[tip])
        };
        Some(Fold { n_tree: topology.n_tree, nodes: nodes.map(of).collect() })
    }

    /// The coordinates that a column belongs to, with its weights in them.
    pub(crate) fn each(&self, column: usize, v: T, mut to: impl FnMut(usize, T)) {
        if column < self.n_tree {
            return to(column, v);
        }
        let behind = column - self.n_tree;
        let (first, tip) = self.nodes[behind / 6];
        for (k, row) in tip.shape.iter().enumerate() {
            let w = row[behind % 6];
            if !absent(&w) {
                to(first + k, v * w);
            }
        }
    }

    /// E^T f.
    pub fn vector(&self, f: &DVector<T>) -> DVector<T> {
        let mut out = DVector::zeros(self.n_tree);
        for (i, v) in f.iter().enumerate() {
            self.each(i, *v, |k, v| out[k] += v);
        }
        out
    }

    /// E^T X of a matrix over the columns.
    pub fn rows_of(&self, x: &nalgebra::DMatrix<T>) -> nalgebra::DMatrix<T> {
        let mut out = nalgebra::DMatrix::zeros(self.n_tree, x.ncols());
        for i in 0..x.nrows() {
            for j in 0..x.ncols() {
                self.each(i, x[(i, j)], |k, v| out[(k, j)] += v);
            }
        }
        out
    }
}

/// Takes entries over the columns to E^T X E.
pub struct Folded<'a, T: Real, E> {
    pub inner: E,
    pub fold: &'a Fold<'a, T>,
}

impl<T: Real, E: Entries<T>> Entries<T> for Folded<'_, T, E> {
    fn add(&mut self, i: usize, j: usize, v: T) {
        let (fold, inner) = (self.fold, &mut self.inner);
        fold.each(i, v, |i, v| fold.each(j, v, |j, v| inner.add(i, j, v)));
    }
}

/// Takes rows over the columns to J E.
pub struct FoldedRows<'a, T: Real, E> {
    pub inner: &'a mut E,
    pub fold: &'a Fold<'a, T>,
}

impl<T: Real, E: Entries<T>> Entries<T> for FoldedRows<'_, T, E> {
    fn add(&mut self, i: usize, j: usize, v: T) {
        let inner = &mut self.inner;
        self.fold.each(j, v, |j, v| inner.add(i, j, v));
    }
}
