//! Derivatives of the time response: M dy" + D dy' + S dy = dF u - dM y" - dD y' - dS y, exact in the same sense as the motion.
//!
//! The state x and its derivative follow [[A, 0], [dA, A]]. The exponential of that is [[E, 0], [dE, E]] with the derivative dE of E
//! along dA, so a parameter costs two products where the exponential costs one, and one E serves all.
use std::collections::BTreeMap;

use faer::{Mat, MatRef};

use super::history::History;
use super::linear_system::LinearSystem;
use super::ports::Ports;
use super::response::{Motion, Propagator, add_direct, add_outputs, check_state, column};
use super::state::{StateSpace, initial, massless};
use crate::error::Result;
use crate::linalg::expm::phi_derivatives;
use crate::linalg::quadratic::NormalForm;
use crate::run::{Cancel, Counts};

/// Bytes that the derivative matrices of one pass may take.
const MEMORY: usize = 400 << 20;

/// What one parameter changes.
pub struct Variation {
    pub dm: Mat<f64>,
    pub dd: Mat<f64>,
    pub ds: Mat<f64>,
    pub df: Mat<f64>,
    pub dl: Mat<f64>,
    pub dd0: Mat<f64>,
}

/// The derivative of one system: dA, dB and the outputs over (x, dx).
struct Direction {
    da: Mat<f64>,
    db: Mat<f64>,
    c: [Mat<f64>; 3],
    direct: [Vec<Mat<f64>>; 3],
}

/// The motion's derivative along each parameter.
pub fn sensitivities(
    system: &LinearSystem,
    ports: &Ports,
    variations: &[Variation],
    start: (&[f64], &[f64]),
    history: &History,
    cancel: &Cancel,
) -> Result<Vec<Motion>> {
    let n = system.quadratic().n();
    let (x0, v0) = start;
    ports.check(n)?;
    check_state(n, x0, v0)?;
    history.check(ports.n_in())?;
    let Some(form) = system.normal() else {
        return Err(massless(system.quadratic()));
    };
    let state = StateSpace::new(form, ports);
    let x0 = column(&initial(form, x0, v0), 0);
    // about twelve matrices of the size of the augmented exponential live at once
    let size = 2 * n + 3 * ports.n_in();
    let batch = (MEMORY / (12 * 8 * size * size)).max(1);
    let mut motions = Vec::new();
    for some in variations.chunks(batch) {
        let directions: Vec<Direction> = some.iter().map(|v| Direction::new(form, ports, &state, v)).collect();
        motions.extend(propagate(&state, ports, &directions, &x0, history, cancel)?);
    }
    Ok(motions)
}

fn propagate(
    state: &StateSpace,
    ports: &Ports,
    directions: &[Direction],
    x0: &[f64],
    history: &History,
    cancel: &Cancel,
) -> Result<Vec<Motion>> {
    let (index, steps) = history.steps();
    let b = state.driven(&ports.order_in);
    let mut cache = BTreeMap::new();
    for (which, h) in steps.iter().enumerate() {
        cancel.check()?;
        cache.insert(which, propagators(state, &b, directions, *h)?);
    }
    let blank = || std::array::from_fn(|_| Mat::zeros(ports.n_out(), history.t.len()));
    let mut motions: Vec<Motion> = directions
        .iter()
        .map(|direction| {
            let mut y = blank();
            add_direct(&direction.direct, &mut y, history);
            let mut counts = Counts::default();
            counts.add("propagators", steps.len() as u64);
            counts.add("steps", index.len() as u64);
            Motion { y, error: blank(), counts }
        })
        .collect();
    let mut x = x0.to_vec();
    let mut e = vec![0.0; x.len()];
    let mut dx = vec![vec![0.0; x.len()]; directions.len()];
    let mut de = dx.clone();
    let both = |x: &[f64], dx: &[f64]| [x, dx].concat();
    for (p, direction) in directions.iter().enumerate() {
        add_outputs(&direction.c, &both(&x, &dx[p]), &mut motions[p].y, 0);
    }
    for (step, which) in index.iter().enumerate() {
        if step % 64 == 0 {
            cancel.check()?;
        }
        let Some((base, along)) = cache.get(which) else {
            continue;
        };
        let (u, next) = (column(&history.u, step), column(&history.u, step + 1));
        let bulge = column(&history.bulge, step);
        let none = vec![0.0; u.len()];
        let (x1, e1) = (base.advance(&x, &u, &next), base.advance_error(&e, &bulge));
        for (p, direction) in directions.iter().enumerate() {
            let sum = |a: Vec<f64>, b: Vec<f64>| a.iter().zip(&b).map(|(a, b)| a + b).collect::<Vec<f64>>();
            dx[p] = sum(base.advance(&dx[p], &none, &none), along[p].advance(&x, &u, &next));
            de[p] = sum(base.advance_error(&de[p], &none), along[p].advance_error(&e, &bulge));
            add_outputs(&direction.c, &both(&x1, &dx[p]), &mut motions[p].y, step + 1);
            add_outputs(&direction.c, &both(&e1, &de[p]), &mut motions[p].error, step + 1);
        }
        (x, e) = (x1, e1);
    }
    Ok(motions)
}

/// The step of the motion, and its derivative along each direction.
fn propagators(
    state: &StateSpace,
    b: &Mat<f64>,
    directions: &[Direction],
    h: f64,
) -> Result<(Propagator, Vec<Propagator>)> {
    let scaled = |a: &Mat<f64>| faer::Scale(h) * a;
    let along: Vec<_> = directions.iter().map(|d| (scaled(&d.da), d.db.clone())).collect();
    let ((e, phi), derivatives) = phi_derivatives(scaled(&state.a).as_ref(), b.as_ref(), &along)?;
    let along = derivatives.iter().map(|(e, phi)| Propagator::from_functions(e, phi, h));
    Ok((Propagator::from_functions(&e, &phi, h), along.collect()))
}

impl Direction {
    /// In the mass-normalised coordinates of the nominal system, where M = 1 and dM is what it is there.
    fn new(form: &NormalForm, ports: &Ports, state: &StateSpace, change: &Variation) -> Self {
        let n = form.n();
        let rate = form.rate();
        let congruent = |a: MatRef<'_, f64>| form.outputs(form.outputs(a).transpose()).transpose().to_owned();
        let dm = congruent(change.dm.as_ref());
        let ds = congruent(change.ds.as_ref()) - &dm * &form.s;
        let mut dd = congruent(change.dd.as_ref());
        if let Some(d) = &form.d {
            dd -= &dm * d;
        }
        let f = form.inputs(ports.f.as_ref());
        let df = form.inputs(change.df.as_ref()) - &dm * &f;
        let dl = form.outputs(change.dl.as_ref());
        let (n2, n_in, n_out) = (2 * n, f.ncols(), dl.nrows());
        let da = Mat::from_fn(n2, n2, |i, j| match (i < n, j < n) {
            (true, _) => 0.0,
            (false, true) => -ds[(i - n, j)] / rate,
            (false, false) => -dd[(i - n, j - n)],
        });
        // maps of the state and its derivative together: derivative orders and direct terms come from the same text as the motion's
        let both = StateSpace {
            a: Mat::from_fn(2 * n2, 2 * n2, |i, j| match (i < n2, j < n2) {
                (true, true) => state.a[(i, j)],
                (false, false) => state.a[(i - n2, j - n2)],
                (true, false) => 0.0,
                (false, true) => da[(i - n2, j)],
            }),
            b: Mat::from_fn(2 * n2, n_in, |i, j| match i {
                i if i < n2 => state.b[(i, j)],
                i if i < n2 + n => 0.0,
                _ => df[(i - n2 - n, j)] / rate,
            }),
            c: Mat::from_fn(n_out, 2 * n2, |i, j| match j {
                j if j < n => dl[(i, j)],
                j if j < n2 => 0.0,
                j => state.c[(i, j - n2)],
            }),
        };
        let driven = both.driven(&ports.order_in);
        Direction {
            db: driven.subrows(n2, n2).to_owned(),
            c: both.outputs(),
            direct: both.direct(&ports.order_in, Some(&change.dd0)),
            da,
        }
    }
}
