//! Flexible bodies: where their numbers are, and the integrals of their shapes about the centre of mass, body axes.
//!
//! ```text
//! displacement u = phi_k q_k + psi_kl q_k q_l / 2,   S_k = int rho phi_k,   P1_k = int rho r phi_k^T,   P2_kl = int rho phi_k phi_l^T
//! S2_kl = int rho psi_kl,   P12_kl = int rho r psi_kl^T: the twelve geometric stiffnesses
//! ```
use crate::model::layout::{flexible, node};
use crate::spatial::{M3, Real, V3, outer};

/// A body with modal coordinates.
#[derive(Debug, Clone)]
pub struct FlexibleSpec {
    pub body: usize,
    /// number of modes
    pub m: usize,
    /// start of S, P1, P2, K, C, KG
    pub x: usize,
}

/// A node that moves against its frame: a massless body of its own in the tree.
#[derive(Debug, Clone)]
pub struct TipSpec {
    pub flexible: usize,
    /// its number among the bodies
    pub body: usize,
    /// start of its position and shape
    pub x: usize,
    /// start of its second-order displacements, where it has any
    pub quadratic: Option<usize>,
}

impl FlexibleSpec {
    pub fn stiffness(&self) -> usize {
        self.x + flexible::k(self.m)
    }

    pub fn damping(&self) -> usize {
        self.x + flexible::c(self.m)
    }

    pub fn size(&self) -> usize {
        flexible::size(self.m)
    }
}

#[derive(Debug, Clone)]
pub struct FlexibleGeometry<T: Real> {
    pub s: Vec<V3<T>>,
    pub p1: Vec<M3<T>>,
    /// m x m, row by row
    pub p2: Vec<M3<T>>,
    pub k: Vec<T>,
    pub c: Vec<T>,
    /// Does `c` count? Derivatives by it do where it is zero, too.
    pub damped: bool,
    /// empty without geometric stiffness
    pub s2: Vec<V3<T>>,
    pub p12: Vec<M3<T>>,
}

impl<T: Real> FlexibleGeometry<T> {
    pub fn derive(spec: &FlexibleSpec, x: &[T], com: &V3<T>) -> Self {
        let m = spec.m;
        let n = &x[spec.x..spec.x + spec.size()];
        let s: Vec<V3<T>> = (0..m).map(|k| V3::from_fn(|i, _| n[flexible::S + i * m + k])).collect();
        let square = |at: usize| M3::from_fn(|i, j| n[at + 3 * i + j]);
        let p1 = (0..m).map(|k| square(flexible::p1(m) + 9 * k) - outer(com, &s[k])).collect();
        let p2 = (0..m * m).map(|i| square(flexible::p2(m) + 9 * i)).collect();
        let (k, c) = (flexible::k(m), flexible::c(m));
        let kg = &n[flexible::kg(m)..];
        let field = |i: usize, kl: usize| kg[i * m * m + kl];
        let stiffened = kg.iter().any(|v| v.re() != 0.0);
        let pairs = if stiffened { m * m } else { 0 };
        let s2: Vec<V3<T>> = (0..pairs).map(|kl| V3::from_fn(|i, _| field(i, kl))).collect();
        let p12 = (0..pairs).map(|kl| M3::from_fn(|j, i| field(3 + 3 * i + j, kl)) - outer(com, &s2[kl])).collect();
        let damped = n[c..c + m * m].iter().any(|v| v.re() != 0.0 || T::NDERIV > 0);
        FlexibleGeometry { s, p1, p2, k: n[k..k + m * m].to_vec(), c: n[c..c + m * m].to_vec(), damped, s2, p12 }
    }

    pub fn m(&self) -> usize {
        self.s.len()
    }

    /// The same numbers as others, one by one in a fixed order.
    pub fn map<U: Real>(&self, f: &mut impl FnMut(T) -> U) -> FlexibleGeometry<U> {
        fn vectors<T: Real, U: Real>(all: &[V3<T>], f: &mut impl FnMut(T) -> U) -> Vec<V3<U>> {
            all.iter().map(|v| v.map(&mut *f)).collect()
        }
        fn squares<T: Real, U: Real>(all: &[M3<T>], f: &mut impl FnMut(T) -> U) -> Vec<M3<U>> {
            all.iter().map(|v| v.map(&mut *f)).collect()
        }
        FlexibleGeometry {
            s: vectors(&self.s, f),
            p1: squares(&self.p1, f),
            p2: squares(&self.p2, f),
            k: self.k.iter().map(|v| f(*v)).collect(),
            c: self.c.iter().map(|v| f(*v)).collect(),
            damped: self.damped || U::NDERIV > 0,
            s2: vectors(&self.s2, f),
            p12: squares(&self.p12, f),
        }
    }
}

/// Place of a moving node from the centre of mass, and its shape, body axes: w = phi_k q_k + psi_kl q_k q_l / 2.
#[derive(Debug, Clone)]
pub struct TipGeometry<T: Real> {
    pub offset: V3<T>,
    /// displacement and rotation for each mode
    pub shape: Vec<[T; 6]>,
    /// psi, displacements of second order (foreshortening), m x m, row by row; empty without
    pub quadratic: Vec<V3<T>>,
}

impl<T: Real> TipGeometry<T> {
    pub fn derive(spec: &TipSpec, x: &[T], m: usize, com: &V3<T>) -> Self {
        let own = &x[spec.x..];
        let second = |x: &[T]| (0..m * m).map(|kl| V3::from_fn(|i, _| x[i * m * m + kl])).collect();
        TipGeometry {
            offset: V3::from_fn(|i, _| own[node::POSITION + i]) - com,
            shape: (0..m).map(|k| std::array::from_fn(|i| own[node::SHAPE + i * m + k])).collect(),
            quadratic: spec.quadratic.map_or_else(Vec::new, |start| second(&x[start..])),
        }
    }

    pub fn map<U: Real>(&self, f: &mut impl FnMut(T) -> U) -> TipGeometry<U> {
        TipGeometry {
            offset: self.offset.map(&mut *f),
            shape: self.shape.iter().map(|row| row.map(&mut *f)).collect(),
            quadratic: self.quadratic.iter().map(|v| v.map(&mut *f)).collect(),
        }
    }

    /// w: three displacements and three successive rotations.
    pub fn of(&self, modal: &[T]) -> [T; 6] {
        let mut out = self.linear(modal);
        if !self.quadratic.is_empty() {
            let second = self.second(modal, modal);
            (0..3).for_each(|i| out[i] += second[i] * 0.5);
        }
        out
    }

    /// w' = (phi_k + psi_kl q_l) q_k'.
    pub fn rate(&self, modal: &[T], rate: &[T]) -> [T; 6] {
        let mut out = self.linear(rate);
        if !self.quadratic.is_empty() {
            let second = self.second(modal, rate);
            (0..3).for_each(|i| out[i] += second[i]);
        }
        out
    }

    /// phi_k v_k.
    fn linear(&self, v: &[T]) -> [T; 6] {
        let mut out = [T::zero(); 6];
        for (row, v) in self.shape.iter().zip(v) {
            for (o, w) in out.iter_mut().zip(row) {
                *o += *w * *v;
            }
        }
        out
    }

    /// psi_kl a_k b_l.
    pub fn second(&self, a: &[T], b: &[T]) -> V3<T> {
        let mut out = V3::zeros();
        for (row, a) in self.quadratic.chunks_exact(b.len().max(1)).zip(a) {
            for (psi, b) in row.iter().zip(b) {
                out += psi * (*a * *b);
            }
        }
        out
    }

    /// psi_kl v_l for each mode k; empty without psi.
    pub fn turned(&self, v: &[T]) -> Vec<V3<T>> {
        let sum = |row: &[V3<T>]| row.iter().zip(v).fold(V3::zeros(), |sum, (psi, v)| sum + psi * *v);
        self.quadratic.chunks_exact(v.len().max(1)).map(sum).collect()
    }
}
