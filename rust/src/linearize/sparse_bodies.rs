//! The lowest modes of models with thousands of bodies, in absolute coordinates.
//!
//! Undamped: shift-invert on the mixed form of `sparse_modal`, which keeps the lowest modes of long chains. Damped: the quadratic
//! problem on the subspace of the undamped modes, widened by K^-1 times the residuals of the damped pairs until these are small.
//! A residual counts as the accelerations it would cause in the constrained system, so neither large stiffnesses nor constraint
//! forces hide it.
use std::cell::OnceCell;

use faer::{Mat, MatRef, c64};

use crate::error::{Error, Result};
use crate::linalg::sparse::{Csc, Factor};
use crate::linearize::nearest_damped::{Around, candidates, nearest};
use crate::linearize::sparse_form::{Entries, SparseForm, symmetrised};
use crate::linearize::sparse_motion::Motion;
use crate::multibody::System;
use crate::multibody::assemble::Effects;
use crate::multibody::placement::State;
use crate::run::{Cancel, Counts};
use crate::second_order::SecondOrder;
use crate::second_order::modal::{Kind, Modal, modes as dense_modes};
use crate::second_order::sparse_general::{self, GeneralModes, Problem};
use crate::second_order::sparse_modal::lowest;
use crate::second_order::sparse_pencil::{Mixed, Pencil, ShiftInvert};
use crate::tolerances::modes::SHARP;
use crate::tolerances::sparse_modes::SAME_ROOT;

/// Rounds of widening, and the estimated error of an eigenvalue at which they stop.
const ROUNDS: usize = 6;
/// Undamped modes beyond the wanted ones, for damped problems: they speed up the last of the wanted, and prove that none is missing; the
/// next number follows where one is not enough for the proof.
const BUFFERS: [usize; 3] = [8, 24, 72];

pub struct BodyModes {
    pub form: SparseForm,
    /// the small problem whose solutions the modes are
    pub modal: Modal,
    /// the modes over the coordinates of the form
    pub shape: Mat<c64>,
    /// estimated relative error of each eigenvalue, and the residual it comes from
    pub error: Vec<f64>,
    pub residual: Vec<f64>,
    pub verified: &'static str,
    pub counts: Counts,
}

pub fn modes(
    system: &System,
    (state, acceleration): (&State, &[f64]),
    effects: Effects,
    n: usize,
    sigma: Option<f64>,
    cancel: &Cancel,
) -> Result<BodyModes> {
    let mut counts = Counts::default();
    let form = SparseForm::new(system, state, acceleration, effects, &mut counts)?;
    cancel.check()?;
    let dof = dof(system, &form);
    if form.general {
        return general(form, n.min(dof), dof, sigma, counts, cancel);
    }
    if form.damping.iter().any(|e| e.2 != 0.0) {
        return damped(form, n.min(dof), dof, sigma, counts, cancel);
    }
    let pencil = pencil(&form, form.stiffness.clone())?;
    let found = lowest(&pencil, n.min(dof), sigma, cancel)?;
    counts.merge(&found.counts);
    let space = Subspace::new(&form, &pencil, &found.lambda, found.shape.as_ref());
    let modal = space.solve(false)?;
    let shape = combine(&space.z, modal.shape.as_ref());
    Ok(BodyModes {
        error: found.error.iter().zip(&found.lambda).map(|(e, l)| if *l == 0.0 { 0.0 } else { *e }).collect(),
        residual: found.residual,
        verified: found.verified,
        modal: modal.subset(&Vec::from_iter(0..found.lambda.len())),
        shape,
        form,
        counts,
    })
}

/// The lowest modes, or those nearest to a shift, where no other is proved to be nearer.
fn damped(
    form: SparseForm,
    n: usize,
    dof: usize,
    sigma: Option<f64>,
    mut counts: Counts,
    cancel: &Cancel,
) -> Result<BodyModes> {
    let pencil = pencil(&form, form.stiffness.clone())?;
    for buffer in BUFFERS {
        let wanted = (n + buffer).min(dof);
        let found = lowest(&pencil, wanted, sigma, cancel)?;
        counts.merge(&found.counts);
        let known = found.lambda.len();
        let mut space = Subspace::new(&form, &pencil, &found.lambda, found.shape.as_ref());
        let work: Vec<f64> =
            (0..known).map(|k| (0..space.z.nrows()).map(|i| space.z[(i, k)] * space.cz[(i, k)]).sum()).collect();
        let choose = |modal: &Modal| match sigma {
            None => (0..n).collect(),
            Some(sigma) => nearest(modal, known, n, sigma),
        };
        let (modal, chosen, residual) = space.resolve(found.sigma, choose, &mut counts, cancel)?;
        let is_complete = match sigma {
            _ if wanted == dof => true,
            None => true,
            Some(_) if !["inertia", "all computed"].contains(&found.verified) => false,
            Some(sigma) => {
                let around = Around { form: &form, pencil: &pencil, sigma, lambda: &found.lambda, work: &work };
                let all = candidates(&modal, known);
                let error = eigenvalue_errors(&modal, &all, &space.residuals(&modal, &all)?.1);
                chosen.len() == n && around.is_complete(&modal, &chosen, &all, &error)?
            }
        };
        if is_complete {
            return Ok(BodyModes {
                error: eigenvalue_errors(&modal, &chosen, &residual),
                shape: combine(&space.z, columns(&modal.shape, &chosen).as_ref()),
                modal: modal.subset(&chosen),
                residual,
                verified: found.verified,
                form,
                counts,
            });
        }
    }
    Err(Error::route(
        "the damping of this large model is too strong to prove which modes lie nearest to shift=: leave it out, or leave n= out as \
         well for the dense route",
    ))
}

pub fn dof(system: &System, form: &SparseForm) -> usize {
    form.loops.as_ref().map_or(system.n_tree(), |l| l.independent.len())
}

/// Forces without a potential, gyroscopic terms: right and left vectors.
fn general(
    form: SparseForm,
    n: usize,
    dof: usize,
    sigma: Option<f64>,
    mut counts: Counts,
    cancel: &Cancel,
) -> Result<BodyModes> {
    if sigma.is_some() {
        return Err(Error::route(
            "shift= of a large model needs forces with a potential: leave it out, or leave n= out as well for the dense route",
        ));
    }
    let (problem, held) = match &form.motion {
        Some(motion) => (moving(&form, motion), false),
        None => {
            let symmetric = pencil(&form, symmetrised(form.size(), form.stiffness.clone()))?;
            (at_rest(&form), symmetric.shifted_at_zero()?.is_some())
        }
    };
    let found = sparse_general::lowest(&problem, n, dof, held, cancel)?;
    counts.merge(&found.counts);
    let (residual, error) = (found.residual.clone(), found.error.clone());
    let modal = as_modal(&found);
    Ok(BodyModes {
        shape: found.shape.subrows(0, form.size()).to_owned(),
        error,
        residual,
        verified: "random restart",
        modal,
        form,
        counts,
    })
}

fn at_rest(form: &SparseForm) -> Problem {
    let n = form.size();
    let matrix = |entries: Entries| Csc::from_entries(n, n, entries);
    let strain = matrix(strain(form));
    Problem {
        m: matrix(form.mass.clone()),
        d: matrix(form.damping.clone()),
        a: augmented(form, form.stiffness.clone()),
        strain: [strain.clone(), strain],
    }
}

/// Unknowns x_f, d, e of the bodies, y of the tree, forces of joints and of elements; see `sparse_motion`.
fn moving(form: &SparseForm, motion: &Motion) -> Problem {
    let (n, ny) = (form.size(), motion.n_tree);
    let (e, y, joint, element) = (2 * n, 3 * n, 3 * n + ny, 4 * n + ny);
    let matrix = |entries: &Entries| Csc::from_entries(n, n, entries.clone());
    let (mass, damping) = (matrix(&form.mass), matrix(&form.damping));
    let [turned, turned_again] = motion.turned.each_ref().map(matrix);
    let gyric = |factor: f64| damping.combined(1.0, factor, &times(&mass, &turned));
    let static_part = times(&damping, &turned).combined(1.0, 1.0, &times(&mass, &turned_again));
    let moved =
        |x: &Csc, at: usize, factor: f64| -> Entries { x.entries().map(|(i, j, v)| (i, at + j, factor * v)).collect() };
    let mut a = form.stiffness.clone();
    a.extend(moved(&static_part, 0, 1.0));
    a.extend(moved(&gyric(2.0), n, 1.0));
    a.extend(moved(&mass, e, 1.0));
    for (unknown, row, columns) in [(0, joint, 0), (n, n, 1), (e, e, 2)] {
        a.extend((0..n).map(|i| (row + i, unknown + i, 1.0)));
        a.extend(motion.carried.iter().map(|(i, j, v)| (row + i, unknown + j, -v)));
        a.extend(motion.columns[columns].iter().map(|(i, j, v)| (row + i, y + j, -v)));
    }
    a.extend((0..n).map(|i| (i, joint + i, 1.0)));
    a.extend(motion.carried.iter().map(|(i, j, v)| (*j, joint + i, -v)));
    a.extend(motion.columns[0].iter().map(|(i, j, v)| (y + j, joint + i, -v)));
    a.extend(form.rows.iter().flat_map(|(i, j, v)| [(element + i, *j, *v), (*j, element + i, *v)]));
    a.extend(form.compliance.iter().enumerate().map(|(i, c)| (element + i, element + i, -c)));
    let all = element + form.compliance.len();
    let leading = |entries: Entries| Csc::from_entries(2 * n, 2 * n, entries);
    let mut d = moved(&gyric(2.0), 0, 1.0);
    d.extend(moved(&mass, n, 2.0));
    let left = strain(form);
    let mut right = left.clone();
    right.extend(form.mass.iter().map(|(i, j, v)| (n + i, n + j, *v)));
    Problem {
        m: leading(form.mass.clone()),
        d: leading(d),
        a: Csc::from_entries(all, all, a),
        strain: [leading(right), leading(left)],
    }
}

fn times(a: &Csc, b: &Csc) -> Csc {
    let entries = b.entries().flat_map(|(k, j, v)| a.column(k).map(move |(i, w)| (i, j, w * v)));
    Csc::from_entries(a.rows, b.cols, entries.collect())
}

fn as_modal(found: &GeneralModes) -> Modal {
    let n = found.s.len();
    let kind = |k: usize| {
        let s = found.s[k];
        let grows = s.re > found.error[k] * s.norm();
        match s.im != 0.0 {
            true if grows => Kind::Flutter,
            true => Kind::Vibration,
            // s and -s
            false => Kind::Divergence,
        }
    };
    let mut groups: Vec<(usize, usize)> = Vec::new();
    for k in 0..n {
        match groups.last_mut() {
            Some((first, count)) if (found.s[k] - found.s[*first]).norm() <= SAME_ROOT * found.s[k].norm() => {
                *count += 1
            }
            _ => groups.push((k, 1)),
        }
    }
    groups.retain(|g| g.1 > 1);
    Modal {
        s: found.s.clone(),
        partner: found.partner.clone(),
        shape: Mat::zeros(0, n),
        left: None,
        partner_mode: Vec::new(),
        partner_shape: Mat::zeros(0, 0),
        partner_left: None,
        kind: (0..n).map(kind).collect(),
        near_defective: vec![false; n],
        groups,
        backward_error: found.residual.clone(),
        condition: vec![f64::NAN; n],
        error: found.error.clone(),
        route: "general",
        counts: Counts::default(),
    }
}

/// Twice the strain energy of the rows: sum w g^T g.
fn strain(form: &SparseForm) -> Entries {
    let mut rows: Vec<Vec<(usize, f64)>> = vec![Vec::new(); form.compliance.len()];
    form.rows.iter().for_each(|(i, j, v)| rows[*i].push((*j, *v)));
    let elastic = rows.iter().zip(&form.compliance).filter(|(_, c)| **c > 0.0);
    let products = elastic
        .flat_map(|(row, c)| row.iter().flat_map(move |(i, a)| row.iter().map(move |(j, b)| (*i, *j, a * b / c))));
    products.collect()
}

/// M, and the augmented matrix [[S, G^T], [G, -compliance]].
fn pencil(form: &SparseForm, stiffness: Entries) -> Result<Mixed> {
    let n = form.size();
    Mixed::new(Csc::from_entries(n, n, form.mass.clone()), augmented(form, stiffness))
}

pub(super) fn augmented(form: &SparseForm, stiffness: Entries) -> Csc {
    let n = form.size();
    let all = n + form.compliance.len();
    let mut a = stiffness;
    a.reserve(2 * form.rows.len() + form.compliance.len());
    for (i, j, v) in &form.rows {
        a.push((n + i, *j, *v));
        a.push((*j, n + i, *v));
    }
    for (i, c) in form.compliance.iter().enumerate() {
        a.push((n + i, n + i, -c));
    }
    Csc::from_entries(all, all, a)
}

/// [[M, Phi^T], [Phi, 0]]: accelerations of the constrained system.
fn constrained_mass(form: &SparseForm, m: &Csc) -> Result<Factor> {
    let n = m.rows;
    let mut place = vec![None; form.compliance.len()];
    let mut count = 0;
    for (i, c) in form.compliance.iter().enumerate() {
        if *c == 0.0 {
            place[i] = Some(n + count);
            count += 1;
        }
    }
    let mut a: Vec<_> = m.entries().collect();
    for (i, j, v) in &form.rows {
        if let Some(i) = place[*i] {
            a.push((i, *j, *v));
            a.push((*j, i, *v));
        }
    }
    Factor::lu(&Csc::from_entries(n + count, n + count, a))
}

/// A basis Z with M Z, C Z and K Z, the last up to forces of constraints: known exactly, where multiplying by K of a long chain
/// would be all rounding.
struct Subspace<'a> {
    form: &'a SparseForm,
    pencil: &'a Mixed,
    c: Csc,
    lambda: Vec<f64>,
    z: Mat<f64>,
    mz: Mat<f64>,
    cz: Mat<f64>,
    kz: Mat<f64>,
    /// of the constrained masses
    accelerations: OnceCell<Factor>,
}

fn product(a: &Csc, x: MatRef<'_, f64>) -> Mat<f64> {
    let mut out = Mat::zeros(a.rows, x.ncols());
    a.multiply(x, out.as_mut(), false);
    out
}

impl<'a> Subspace<'a> {
    fn new(form: &'a SparseForm, pencil: &'a Mixed, lambda: &[f64], x: MatRef<'_, f64>) -> Self {
        let n = x.nrows();
        let c = Csc::from_entries(n, n, form.damping.clone());
        let mz = product(pencil.mass(), x);
        Subspace {
            kz: Mat::from_fn(n, x.ncols(), |i, j| mz[(i, j)] * lambda[j]),
            cz: product(&c, x),
            z: x.to_owned(),
            lambda: lambda.to_vec(),
            mz,
            c,
            form,
            pencil,
            accelerations: OnceCell::new(),
        }
    }

    /// Z^T (M, C, K) Z. The basis is M-orthonormal, and M phi of the undamped modes meets nothing else: what products make of
    /// these zeros is rounding times the largest eigenvalue.
    fn solve(&self, damped: bool) -> Result<Modal> {
        let (n, known) = (self.z.ncols(), self.lambda.len());
        let m = Mat::identity(n, n);
        let k = self.z.transpose() * &self.kz;
        let k = Mat::from_fn(n, n, |i, j| match (i < known, j < known) {
            (true, true) if i == j => self.lambda[i],
            (true, true) => 0.0,
            (true, false) => k[(j, i)],
            (false, true) => k[(i, j)],
            (false, false) => 0.5 * (k[(i, j)] + k[(j, i)]),
        });
        let c = damped.then(|| {
            let c = self.z.transpose() * &self.cz;
            Mat::from_fn(n, n, |i, j| 0.5 * (c[(i, j)] + c[(j, i)]))
        });
        dense_modes(&SecondOrder::new(m, c, None, k, None)?)
    }

    /// Widen until the residuals of the chosen pairs are small.
    fn resolve(
        &mut self,
        sigma: f64,
        choose: impl Fn(&Modal) -> Vec<usize>,
        counts: &mut Counts,
        cancel: &Cancel,
    ) -> Result<(Modal, Vec<usize>, Vec<f64>)> {
        counts.add("factorisations", 1);
        let mut inverse: Option<ShiftInvert<'_>> = None;
        let pencil = self.pencil;
        let mut before = f64::INFINITY;
        for round in 0..=ROUNDS {
            cancel.check()?;
            let modal = self.solve(true)?;
            let chosen = choose(&modal);
            let (r, residual) = self.residuals(&modal, &chosen)?;
            counts.add("damped subspaces", 1);
            let error = eigenvalue_errors(&modal, &chosen, &residual);
            let open: Vec<usize> = (0..chosen.len()).filter(|k| error[*k] > SHARP).collect();
            let worst = open.iter().map(|k| residual[*k]).fold(0.0, f64::max);
            // rounding sets a floor to residuals, which count the highest accelerations most
            let stalled = round > 1 && worst > 0.5 * before;
            if open.is_empty() || stalled || round == ROUNDS {
                return Ok((modal, chosen, residual));
            }
            before = worst;
            let op = match &inverse {
                Some(op) => op,
                None => {
                    counts.add("factorisations", 1);
                    inverse.insert(pencil.shifted(sigma)?)
                }
            };
            self.widen(op, sigma, &r, &open)?;
        }
        Err(Error::singular("the damped subspace was not solved"))
    }

    /// r = s^2 M y + s C y + K y, and its size as acceleration over that of s^2 y.
    fn residuals(&self, modal: &Modal, chosen: &[usize]) -> Result<(Mat<c64>, Vec<f64>)> {
        let factor = match self.accelerations.get() {
            Some(factor) => factor,
            None => {
                let made = constrained_mass(self.form, self.pencil.mass())?;
                self.accelerations.get_or_init(|| made)
            }
        };
        let (n, q) = (chosen.len(), columns(&modal.shape, chosen));
        let [my, cy, ky] = [&self.mz, &self.cz, &self.kz].map(|a| combine(a, q.as_ref()));
        let rows = self.z.nrows();
        let s: Vec<c64> = chosen.iter().map(|k| modal.s[*k]).collect();
        let r = Mat::from_fn(rows, n, |i, k| s[k] * s[k] * my[(i, k)] + s[k] * cy[(i, k)] + ky[(i, k)]);
        let accelerate = |a: &Mat<c64>| {
            let mut rhs = Mat::zeros(factor.n(), 2 * n);
            for k in 0..n {
                for i in 0..rows {
                    rhs[(i, k)] = a[(i, k)].re;
                    rhs[(i, n + k)] = a[(i, k)].im;
                }
            }
            let given = rhs.clone();
            factor.solve(rhs.as_mut());
            let energy = |k: usize| (0..rows).map(|i| given[(i, k)] * rhs[(i, k)]).sum::<f64>().max(0.0);
            (0..n).map(|k| (energy(k) + energy(n + k)).sqrt()).collect::<Vec<_>>()
        };
        let (size, inertia, elastic) = (accelerate(&r), accelerate(&my), accelerate(&ky));
        let relative = (0..n)
            .map(|k| {
                let scale = s[k].norm_sqr() * inertia[k] + elastic[k];
                if scale > 0.0 { size[k] / scale } else { 0.0 }
            })
            .collect();
        Ok((r, relative))
    }

    /// Add K^-1 r, orthogonal to what is there; (K - sigma M) w = r gives K w = r + sigma M w.
    fn widen(&mut self, op: &ShiftInvert<'_>, sigma: f64, r: &Mat<c64>, open: &[usize]) -> Result<()> {
        let rows = self.z.nrows();
        let mut force = Mat::zeros(rows, 2 * open.len());
        for (k, column) in open.iter().enumerate() {
            for i in 0..rows {
                force[(i, 2 * k)] = r[(i, *column)].re;
                force[(i, 2 * k + 1)] = r[(i, *column)].im;
            }
        }
        let w = op.solve(force.as_ref());
        let mut kw = force;
        let mw = product(self.pencil.mass(), w.as_ref());
        kw += faer::Scale(sigma) * &mw;
        for c in 0..w.ncols() {
            self.append(w.col(c).to_owned(), kw.col(c).to_owned());
        }
        Ok(())
    }

    fn append(&mut self, mut w: faer::Col<f64>, mut kw: faer::Col<f64>) {
        let m = self.pencil.mass();
        let norm = |x: &faer::Col<f64>| {
            let mx = product(m, x.as_mat());
            (0..x.nrows()).map(|i| x[i] * mx[(i, 0)]).sum::<f64>().max(0.0).sqrt()
        };
        let before = norm(&w);
        for _ in 0..2 {
            let h = self.mz.transpose() * &w;
            w -= &self.z * &h;
            kw -= &self.kz * &h;
        }
        let after = norm(&w);
        // the rounding of a vector counts for as much more as it shrank: K z is not known to `SHARP` then
        if after.is_nan() || SHARP * after <= f64::EPSILON * before {
            return;
        }
        w *= faer::Scale(1.0 / after);
        kw *= faer::Scale(1.0 / after);
        let (mw, cw) = (product(m, w.as_mat()), product(&self.c, w.as_mat()));
        self.z = beside(&self.z, w.as_mat());
        self.kz = beside(&self.kz, kw.as_mat());
        self.mz = beside(&self.mz, mw.as_ref());
        self.cz = beside(&self.cz, cw.as_ref());
    }
}

/// Relative errors of the eigenvalues: quadratic in the residual over the distance to the next root, as for all problems
/// whose left vectors are the shapes (Parlett, The Symmetric Eigenvalue Problem, section 11.7), but never better than linear
/// where roots meet.
fn eigenvalue_errors(modal: &Modal, chosen: &[usize], residual: &[f64]) -> Vec<f64> {
    let estimate = |(&k, r): (&usize, &f64)| {
        let s = modal.s[k];
        let own = modal
            .groups
            .iter()
            .find(|(first, n)| (*first..first + n).contains(&k))
            .map_or(k..k + 1, |(first, n)| *first..first + n);
        let others = (0..modal.s.len()).filter(|j| !own.contains(j)).map(|j| (modal.s[j] - s).norm());
        let gap = others.fold((modal.partner[k] - s).norm(), f64::min) / s.norm();
        let quadratic = 4.0 * r * r / gap;
        let linear = *r;
        let found = if modal.near_defective[k] || !quadratic.is_finite() { linear } else { quadratic.min(linear) };
        found + modal.error[k]
    };
    chosen.iter().zip(residual).map(estimate).collect()
}

fn columns(a: &Mat<c64>, chosen: &[usize]) -> Mat<c64> {
    Mat::from_fn(a.nrows(), chosen.len(), |i, k| a[(i, chosen[k])])
}

fn beside(a: &Mat<f64>, b: MatRef<'_, f64>) -> Mat<f64> {
    let n = a.ncols();
    let mut out = Mat::zeros(a.nrows(), n + b.ncols());
    out.as_mut().subcols_mut(0, n).copy_from(a);
    out.as_mut().subcols_mut(n, b.ncols()).copy_from(b);
    out
}

fn combine(z: &Mat<f64>, q: MatRef<'_, c64>) -> Mat<c64> {
    let part = |f: &dyn Fn(c64) -> f64| {
        let q = Mat::from_fn(q.nrows(), q.ncols(), |i, j| f(q[(i, j)]));
        z * q
    };
    let (re, im) = (part(&|v| v.re), part(&|v| v.im));
    Mat::from_fn(z.nrows(), q.ncols(), |i, j| c64::new(re[(i, j)], im[(i, j)]))
}
