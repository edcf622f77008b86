//! Adjoints of poses: with twelve numbers each, as the tape reads them, or by increments of the tree coordinates.
use crate::analysis::transient::rotations::{add_commutator, rotation_triples};
use crate::analysis::transient::{Equations, Motion};
use crate::joint::Freedom;
use crate::spatial::{V3, exp_so3};
use crate::system::topology::Node;

use super::super::power::tree::turned;

/// Nodes with coordinates of their own: not those that modal coordinates move.
fn joints<'a>(eq: &Equations<'a, f64>) -> impl Iterator<Item = (usize, &'a Node)> + use<'a> {
    let nodes = eq.topology().nodes.iter().enumerate();
    nodes.filter(|(_, n)| !n.kind.is_modal())
}

/// The axis about which a rotation turns the relative rotation from the left.
fn axis(m: &Motion<f64>, node: usize, f: &Freedom) -> V3<f64> {
    if f.outer {
        m.relative[node].r.column(f.axis).into_owned()
    } else {
        V3::from_fn(|i, _| if i == f.axis { 1.0 } else { 0.0 })
    }
}

/// By tree increments: what twelve numbers of each pose count along every increment.
pub fn by_increments(eq: &Equations<'_, f64>, m: &Motion<f64>, twelve: &[f64]) -> Vec<f64> {
    let mut out = vec![0.0; eq.n()];
    for modal in &eq.topology().modal {
        for k in 0..modal.m {
            out[modal.first + k] = twelve[12 * (modal.pose + k / 3) + k % 3];
        }
    }
    for (i, node) in joints(eq) {
        let own = &twelve[12 * i..12 * i + 12];
        for (k, f) in node.kind.freedoms(node.reversed).iter().enumerate() {
            let d = if f.rotation {
                let moved = axis(m, i, f).cross_matrix() * m.relative[i].r;
                (0..9).map(|e| own[3 + e] * moved[(e / 3, e % 3)]).sum()
            } else {
                own[f.axis]
            };
            out[node.first + k] = node.sign() * d;
        }
    }
    out
}

/// Twelve numbers of each pose that count the same along every increment, added up.
pub fn add_numbers(eq: &Equations<'_, f64>, m: &Motion<f64>, by: &[f64], onto: &mut [f64]) {
    for modal in &eq.topology().modal {
        for k in 0..modal.m {
            onto[12 * (modal.pose + k / 3) + k % 3] += by[modal.first + k];
        }
    }
    for (i, node) in joints(eq) {
        let own = &mut onto[12 * i..12 * i + 12];
        let mut moment = V3::zeros();
        for (k, f) in node.kind.freedoms(node.reversed).iter().enumerate() {
            let d = node.sign() * by[node.first + k];
            // the axes of a joint are perpendicular to each other
            if f.rotation {
                moment += axis(m, i, f) * d;
            } else {
                own[f.axis] += d;
            }
        }
        let r = turned(&moment, &m.relative[i].r);
        for e in 0..9 {
            own[3 + e] += r[(e / 3, e % 3)];
        }
    }
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
