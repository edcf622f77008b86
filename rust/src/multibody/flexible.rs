//! Modal coordinates and the nodes that they move.
//!
//! A moving node is a massless body on six columns behind the frame (three displacements w and three successive rotations), or
//! before it where the tree comes from there. The columns are not coordinates. With the shapes phi and, where a body has them, the
//! displacements of second order psi (foreshortening), all that is assembled over columns comes to the coordinates by E:
//! ```text
//! w_i = phi_ik q_k + psi_ikl q_k q_l / 2,   E_ik = phi_ik + psi_ikl q_l,   w' = E q',   w" = E q" + psi q' q'
//! f -> E^T f,   X -> E^T X E,   and the forces f turn with E: psi_ikl f_i is a stiffness
//! ```
//! After D. J. Segalman and C. R. Dohrmann, "A Method for Calculating the Dynamics of Rotating Flexible Structures", J. Vib. Acoust.
//! 118 (1996) 313-317 (quadratic components).
use std::borrow::Cow;

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

/// The node's numbers, and the modal coordinates of its body.
fn moved<'a, T: Real>(
    topology: &Topology,
    geometry: &'a Geometry<T>,
    node: &Node,
    modal: &'a [T],
) -> (&'a TipGeometry<T>, &'a [T], std::ops::Range<usize>) {
    let (tip, own) = movers(topology, node);
    (&geometry.tips[tip], &modal[own.clone()], own)
}

/// Displacements and angles of a node's columns.
pub fn node_values<T: Real>(topology: &Topology, geometry: &Geometry<T>, node: &Node, modal: &[T]) -> [T; 6] {
    let (tip, q, _) = moved(topology, geometry, node, modal);
    tip.of(q)
}

/// w' of the columns of all moving nodes at modal coordinates, from the rates of the tree coordinates.
pub fn node_rates<T: Real>(topology: &Topology, geometry: &Geometry<T>, modal: &[T], rate: &[T]) -> Vec<T> {
    let Some(first) = topology.modal.first().map(|m| m.first) else {
        return Vec::new();
    };
    let of = |n: &Node| {
        let (tip, q, own) = moved(topology, geometry, n, modal);
        tip.rate(q, &rate[first..][own])
    };
    topology.nodes.iter().filter(|n| n.kind.is_modal()).flat_map(of).collect()
}

/// w" of the same columns.
pub fn node_accelerations<T: Real>(
    topology: &Topology,
    geometry: &Geometry<T>,
    modal: &[T],
    rate: Option<&[T]>,
    acceleration: Option<&[T]>,
) -> Vec<T> {
    let none = || vec![T::zero(); topology.dofs.len() - topology.n_tree];
    let mut out = acceleration.map_or_else(none, |a| node_rates(topology, geometry, modal, a));
    let (Some(rate), Some(first)) = (rate, topology.modal.first().map(|m| m.first)) else {
        return out;
    };
    for (node, out) in topology.nodes.iter().filter(|n| n.kind.is_modal()).zip(out.chunks_exact_mut(6)) {
        let (tip, own) = movers(topology, node);
        let tip = &geometry.tips[tip];
        if !tip.quadratic.is_empty() {
            let rate = &rate[first..][own];
            let second = tip.second(rate, rate);
            (0..3).for_each(|i| out[i] += second[i]);
        }
    }
    out
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

/// E at a place: the rows of the columns of moving nodes; those of the coordinates are the identity.
pub struct Fold<'g, T: Real> {
    n_tree: usize,
    nodes: Vec<Folding<'g, T>>,
}

/// Six columns of a moving node: its first modal coordinate, its shape, and E for each mode.
struct Folding<'g, T: Real> {
    first: usize,
    tip: &'g TipGeometry<T>,
    rows: Cow<'g, [[T; 6]]>,
}

impl<'g, T: Real> Fold<'g, T> {
    /// None without flexible bodies.
    pub fn of(topology: &Topology, geometry: &'g Geometry<T>, modal: &[T]) -> Option<Self> {
        let first = topology.modal.first()?.first;
        let of = |node: &Node| {
            let (tip, own) = movers(topology, node);
            let tip = &geometry.tips[tip];
            let mut rows = Cow::Borrowed(tip.shape.as_slice());
            for (k, turned) in tip.turned(&modal[own.clone()]).iter().enumerate() {
                (0..3).for_each(|i| rows.to_mut()[k][i] += turned[i]);
            }
            Folding { first: first + own.start, tip, rows }
        };
        let nodes = topology.nodes.iter().filter(|n| n.kind.is_modal());
        Some(Fold { n_tree: topology.n_tree, nodes: nodes.map(of).collect() })
    }

    /// The coordinates that a column belongs to, with its weights in them.
    pub(crate) fn each(&self, column: usize, v: T, mut to: impl FnMut(usize, T)) {
        if column < self.n_tree {
            return to(column, v);
        }
        let behind = column - self.n_tree;
        let node = &self.nodes[behind / 6];
        for (k, row) in node.rows.iter().enumerate() {
            let w = row[behind % 6];
            if !absent(&w) {
                to(node.first + k, v * w);
            }
        }
    }

    /// Does any node move in second order?
    pub fn is_quadratic(&self) -> bool {
        self.nodes.iter().any(|n| !n.tip.quadratic.is_empty())
    }

    /// psi_ikl f_i of forces on the columns: the stiffness of what turns with E.
    pub fn add_turned_forces(&self, f: &DVector<T>, into: &mut impl Entries<T>) {
        for (i, node) in self.nodes.iter().enumerate() {
            let start = self.n_tree + 6 * i;
            let force = V3::new(f[start], f[start + 1], f[start + 2]);
            let m = node.rows.len();
            for (kl, psi) in node.tip.quadratic.iter().enumerate() {
                into.add(node.first + kl / m, node.first + kl % m, psi.dot(&force));
            }
        }
    }

    /// E^T X dE of entries X over the columns, where dE_ik = psi_ikl d_l along d of the tree coordinates.
    pub fn add_along(&self, entries: &[(usize, usize, T)], d: &[T], into: &mut impl Entries<T>) {
        let turned: Vec<_> = self.nodes.iter().map(|n| n.tip.turned(&d[n.first..n.first + n.rows.len()])).collect();
        for (i, j, v) in entries {
            let Some(behind) = j.checked_sub(self.n_tree).filter(|b| b % 6 < 3) else { continue };
            let node = behind / 6;
            self.each(*i, *v, |i, v| {
                for (k, row) in turned[node].iter().enumerate() {
                    into.add(i, self.nodes[node].first + k, v * row[behind % 6]);
                }
            });
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

/// Takes entries over the columns to E^T X E, and keeps them if they are asked for.
pub struct Folded<'a, T: Real, E> {
    pub inner: E,
    pub fold: &'a Fold<'a, T>,
    pub kept: Option<Vec<(usize, usize, T)>>,
}

impl<'a, T: Real, E> Folded<'a, T, E> {
    pub fn new(inner: E, fold: &'a Fold<'a, T>) -> Self {
        Folded { inner, fold, kept: None }
    }
}

impl<T: Real, E: Entries<T>> Entries<T> for Folded<'_, T, E> {
    fn add(&mut self, i: usize, j: usize, v: T) {
        let (fold, inner) = (self.fold, &mut self.inner);
        if let Some(kept) = &mut self.kept {
            kept.push((i, j, v));
        }
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
