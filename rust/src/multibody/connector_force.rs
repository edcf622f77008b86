//! Forces of one connector's coordinates, and their slopes: the linear part and the laws.
use num_dual::Dual;

use crate::multibody::numbers::Numbers;
use crate::multibody::topology::{BoundFunction, BoundLaw, Connector};
use crate::multibody::wanted::Wanted;
use crate::spatial::Real;

/// Forces of a connector's coordinates, and their slopes by displacement and rate.
pub(crate) struct Response<T: Real> {
    pub force: [T; 6],
    pub k: [[T; 6]; 6],
    pub c: [[T; 6]; 6],
    pub damped: bool,
}

/// The linear part and the laws at displacements `e` and rates `v` (None at rest).
pub(crate) fn response<T: Real>(
    connector: &Connector,
    numbers: Numbers<'_, T>,
    e: &[T],
    v: Option<&[T]>,
    wanted: Wanted,
) -> Response<T> {
    let Numbers { x, memory, .. } = numbers;
    let n = e.len();
    let zero = [[T::zero(); 6]; 6];
    let mut out = Response { force: [T::zero(); 6], k: zero, c: zero, damped: wanted.damping && connector.c.is_some() };
    let entry = |start: usize, i: usize, j: usize| {
        if connector.full {
            x[start + i * n + j]
        } else if i == j {
            x[start + i]
        } else {
            T::zero()
        }
    };
    for i in 0..n {
        if let Some(p) = connector.preload {
            out.force[i] += x[p + i];
        }
        for j in 0..n {
            if let Some(k) = connector.k {
                out.k[i][j] = entry(k, i, j);
                out.force[i] += out.k[i][j] * e[j];
            }
            if let Some(c) = connector.c.filter(|_| wanted.damping) {
                out.c[i][j] = entry(c, i, j);
                if let Some(v) = v {
                    out.force[i] += out.c[i][j] * v[j];
                }
            }
        }
    }
    for law in connector.laws.iter().filter(|l| wanted.law(l.law)) {
        add_law(law, x, memory, e[law.component], v.map_or_else(T::zero, |v| v[law.component]), wanted, &mut out);
    }
    for function in &connector.functions {
        add_function(function, numbers, e, v, wanted, &mut out);
    }
    out
}

/// F(t, u, v) of several coordinates, with its slopes.
fn add_function<T: Real>(
    bound: &BoundFunction,
    numbers: Numbers<'_, T>,
    e: &[T],
    v: Option<&[T]>,
    wanted: Wanted,
    out: &mut Response<T>,
) {
    let (law, p, places) = (&bound.law, bound.numbers(numbers.x), &bound.coordinates);
    let (u, v) = (bound.own(Some(e)), bound.own(v));
    if !wanted.tangent || !wanted.laws {
        let force = law.force(numbers.t, &u, &v, p);
        places.iter().zip(force).for_each(|(i, f)| out.force[*i] += f);
        return;
    }
    let made = law.slopes(numbers.t, &u, &v, p, wanted.damping);
    for (a, i) in places.iter().enumerate() {
        out.force[*i] += made.force[a];
        for (b, j) in places.iter().enumerate() {
            out.k[*i][*j] += made.k[a][b];
            out.c[*i][*j] += made.c[a][b];
        }
    }
    out.damped |= law.uses_rate() && wanted.damping;
}

fn add_law<T: Real>(bound: &BoundLaw, x: &[T], memory: &[T], e: T, v: T, wanted: Wanted, out: &mut Response<T>) {
    let i = bound.component;
    let p = &x[bound.x..bound.x + bound.law.n_params()];
    let n = bound.law.n_memory();
    let z = if memory.is_empty() { bound.law.rest_memory() } else { memory[bound.memory..bound.memory + n].to_vec() };
    let mut z_new = vec![T::zero(); n];
    out.force[i] += bound.law.force(e, v, p, &z, &mut z_new);
    if !wanted.tangent || !wanted.laws {
        return;
    }
    let constant = |a: &[T]| -> Vec<Dual<T>> { a.iter().map(|a| Dual::from_re(*a)).collect() };
    let (pd, zd) = (constant(p), constant(&z));
    let mut zd_new = vec![Dual::from_re(T::zero()); n];
    let by_e = bound.law.force(Dual::new(e, T::one()), Dual::from_re(v), &pd, &zd, &mut zd_new);
    out.k[i][i] += by_e.eps;
    if bound.law.uses_velocity() && wanted.damping {
        let by_v = bound.law.force(Dual::from_re(e), Dual::new(v, T::one()), &pd, &zd, &mut zd_new);
        out.c[i][i] += by_v.eps;
        out.damped = true;
    }
}
