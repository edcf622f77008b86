//! Adjoints of coordinates: by the numbers of q, as the tape reads them, or by increments of the tree coordinates.
use crate::integrate::{Equations, Motion};
use crate::multibody::rotations::{add_commutator, rotation_triples};
use crate::multibody::topology::Node;
use crate::spatial::{V3, exp_so3};

/// By tree increments: what the numbers of q count along every increment.
pub fn by_increments(eq: &Equations<'_, f64>, m: &Motion<f64>, by_q: &[f64]) -> Vec<f64> {
    let mut out = vec![0.0; eq.n()];
    for modal in &eq.topology().modal {
        out[modal.first..modal.first + modal.m].copy_from_slice(&by_q[modal.q..modal.q + modal.m]);
    }
    for node in joints(eq) {
        let (own, columns) = (node.q..node.q + node.kind.nq(), node.first..node.first + node.n);
        node.kind.pull(node.reversed, &m.q[own.clone()], &by_q[own], &mut out[columns]);
    }
    out
}

/// Numbers along q that count the same along every increment, added up.
pub fn add_numbers(eq: &Equations<'_, f64>, m: &Motion<f64>, by: &[f64], onto: &mut [f64]) {
    for modal in &eq.topology().modal {
        for k in 0..modal.m {
            onto[modal.q + k] += by[modal.first + k];
        }
    }
    for node in joints(eq) {
        let (own, columns) = (node.q..node.q + node.kind.nq(), node.first..node.first + node.n);
        node.kind.push(node.reversed, &m.q[own.clone()], &by[columns], &mut onto[own]);
    }
}

/// Nodes with coordinates of their own.
fn joints<'a>(eq: &Equations<'a, f64>) -> impl Iterator<Item = &'a Node> + use<'a> {
    eq.topology().nodes.iter().filter(|n| n.kind.nq() > 0)
}

fn three(v: &[f64], first: usize) -> V3<f64> {
    V3::new(v[first], v[first + 1], v[first + 2])
}

/// From increments after a move by theta to those before it: turned with exp(theta) where three rotations act together.
pub fn before_move(eq: &Equations<'_, f64>, theta: &[f64], by: &mut [f64]) {
    for (first, sign) in rotation_triples(eq.topology()) {
        let back = exp_so3(&(three(theta, first) * -sign)) * three(by, first);
        by[first..first + 3].copy_from_slice(back.as_slice());
    }
}

/// The same for a small move by epsilon theta: what is first order in epsilon, added up.
pub fn add_small_move(eq: &Equations<'_, f64>, theta: &[f64], by: &[f64], onto: &mut [f64]) {
    for (first, sign) in rotation_triples(eq.topology()) {
        let change = three(by, first).cross(&three(theta, first)) * sign;
        for k in 0..3 {
            onto[first + k] += change[k];
        }
    }
}

/// -h^2/12 v0 x v1 backwards: from adjoints of an increment to those of both rates, added up.
pub fn add_turning_back(
    eq: &Equations<'_, f64>,
    h: f64,
    (v0, v1): (&[f64], &[f64]),
    by: &[f64],
    (onto0, onto1): (&mut [f64], &mut [f64]),
) {
    // by . (d0 x v1) = d0 . (v1 x by)
    add_commutator(eq.topology(), -h * h / 12.0, (v1, by), onto0);
    add_commutator(eq.topology(), -h * h / 12.0, (by, v0), onto1);
}
