//! The n lowest modes of large sparse systems by shift-invert: K x = lambda M x, symmetric.
//!
//! The basis comes from a block Krylov space, completeness is shown by inertia counts, residuals are computed anew.
use faer::linalg::solvers::SelfAdjointEigen;
use faer::{Mat, MatRef};

use super::sparse_pencil::{Pencil, ShiftInvert};
use crate::error::{Error, Result};
use crate::linalg::dense::cholesky;
use crate::linalg::krylov::{Operator, Options, Ritz, Space};
use crate::linalg::sparse::Csc;
use crate::run::{Cancel, Counts};
use crate::tolerances::modes::{BISECTIONS, DATA_ROUNDING, PATIENCE, SEMIDEFINITE, SHARP};
use crate::tolerances::sparse_modes::{ELASTIC, ENTRY_NOISE, FIRST_SHIFT, RIGID, SAME_VALUE, VANISHED};

/// Largest system of which the whole operator is formed where nearly all modes are wanted.
const LARGEST_DENSE: usize = 2000;

pub struct SymmetricModes {
    /// lambda = omega^2, ascending; rigid ones exactly zero
    pub lambda: Vec<f64>,
    /// mass-normalised
    pub shape: Mat<f64>,
    /// |phi - (lambda - sigma) Op phi| in the mass norm: a bound of the relative error of lambda - sigma
    pub residual: Vec<f64>,
    /// estimated relative error of lambda; for rigid modes the absolute one, below which lambda cannot be told from zero
    pub error: Vec<f64>,
    pub rigid: usize,
    pub sigma: f64,
    /// a shift that would resolve modes which lie too close to zero for this one
    softer: Option<f64>,
    /// how it was made sure that no mode is missing: "inertia", "random restart" or "unverified"
    pub verified: &'static str,
    pub counts: Counts,
}

/// The `wanted` modes nearest to the shift, by default the lowest.
pub fn lowest(pencil: &impl Pencil, wanted: usize, sigma: Option<f64>, cancel: &Cancel) -> Result<SymmetricModes> {
    if wanted == 0 || wanted > pencil.dim() {
        return Err(Error::model(format!(
            "n = {wanted} modes were asked for; the system has {} coordinates",
            pencil.dim()
        )));
    }
    let mut counts = Counts::default();
    let first = start(pencil, wanted, sigma, &mut counts, cancel)?;
    let usual = Options::new(wanted, true);
    let mut modes = if is_small(pencil, &usual) {
        small(pencil, wanted, first, sigma)?
    } else if sigma.is_none() && first.1 == 0.0 {
        // the shift may lie too far below eigenvalues that are close together, or too near to one of a nearly free motion: then it moves
        match around(pencil, wanted, first, Options { max_cycles: PATIENCE, ..usual }, cancel) {
            Err(Error::Convergence { .. }) => {
                let moved = nearer(pencil, wanted, &mut counts, cancel)?;
                around(pencil, wanted, moved, usual, cancel)?
            }
            found if is_blurred(&found) => {
                counts.add("factorisations", 1);
                let moved = below_zero(pencil, wanted, &mut counts, cancel)?;
                let again = around(pencil, wanted, moved, usual, cancel);
                cancel.check()?;
                sharper(found, again)?
            }
            found => found?,
        }
    } else {
        around(pencil, wanted, first, usual, cancel)?
    };
    counts.merge(&modes.counts);
    for _ in 0..4 {
        let Some(softer) = modes.softer.filter(|_| sigma.is_none()) else {
            break;
        };
        counts.add("factorisations", 1);
        let found = pencil.shifted(softer).and_then(|op| match is_small(pencil, &usual) {
            true => small(pencil, wanted, (op, softer), Some(softer)),
            false => around(pencil, wanted, (op, softer), usual, cancel),
        });
        match found {
            // so near to rigid modes that nothing is known of others
            Ok(found) if worst(&found) >= 1.0 => break,
            Ok(found) => modes = found,
            Err(Error::Interrupted) => return Err(Error::Interrupted),
            // the shifted matrix is singular but for rounding: the modes that are there keep their errors
            Err(_) => break,
        }
        counts.merge(&modes.counts);
    }
    modes.counts = counts;
    Ok(modes)
}

fn around(
    pencil: &impl Pencil,
    wanted: usize,
    shift: (ShiftInvert<'_>, f64),
    options: Options,
    cancel: &Cancel,
) -> Result<SymmetricModes> {
    let (op, sigma) = shift;
    let mut counts = Counts::default();
    let mut space = Space::new(&op, options)?;
    let mut ritz = space.converge(cancel)?;
    let mut verified = "unverified";
    // each restart brings one block of a repeated eigenvalue to light
    for _ in 0..5 + wanted.div_ceil(options.block) {
        match missed(pencil, &ritz, wanted, sigma, &mut counts) {
            Some(false) => {
                verified = "inertia";
                break;
            }
            Some(true) => {
                space.restart_afresh(&ritz, wanted)?;
                ritz = space.converge(cancel)?;
            }
            None => {
                let known: Vec<f64> = ritz.value.iter().take(wanted).map(|v| v.re).collect();
                space.restart_afresh(&ritz, wanted)?;
                ritz = space.probe(cancel)?;
                let same = |(a, b): (&f64, &faer::c64)| (a - b.re).abs() <= SAME_VALUE * a.abs();
                if known.iter().zip(&ritz.value).all(same) {
                    verified = "random restart";
                    break;
                }
                ritz = space.converge(cancel)?;
            }
        }
    }
    counts.merge(&space.counts);
    let theta: Vec<f64> = ritz.value.iter().take(wanted).map(|v| v.re).collect();
    let mut modes = finish(pencil, &op, space.real_vectors(&ritz, wanted), &theta, sigma)?;
    modes.verified = verified;
    modes.counts = counts;
    Ok(modes)
}

/// The largest error of an elastic mode; of rigid ones it is an eigenvalue.
fn worst(modes: &SymmetricModes) -> f64 {
    let elastic = modes.lambda.iter().zip(&modes.error).filter(|(lambda, _)| **lambda != 0.0);
    elastic.map(|(_, error)| *error).fold(0.0, f64::max)
}

/// Does one eigenvalue, next to the shift, outweigh all others?
fn is_blurred(found: &Result<SymmetricModes>) -> bool {
    match found {
        Ok(modes) => modes.residual.iter().any(|residual| residual.powi(2) > SHARP),
        Err(error) => matches!(error, Error::Singular(_)),
    }
}

/// The second try, unless it is worse.
fn sharper<E>(
    first: std::result::Result<SymmetricModes, E>,
    second: std::result::Result<SymmetricModes, E>,
) -> std::result::Result<SymmetricModes, E> {
    match (first, second) {
        (Ok(first), Ok(second)) if worst(&second) > worst(&first) => Ok(first),
        (Ok(first), Err(_)) => Ok(first),
        (_, second) => second,
    }
}

/// A Krylov basis would exhaust the space: then the operator is taken whole.
fn is_small(pencil: &impl Pencil, options: &Options) -> bool {
    pencil.free_dim() < options.dim + 3 * options.block
}

/// Modes from the whole operator. At zero shift, and near to it, stiff modes may be as small in it as what rounding leaves of constraints.
/// Far below all eigenvalues the operator is (lambda - sigma)^-1 with one order of magnitude less than the largest of them, and constraints
/// are zeros beside it, however different stiffnesses are.
fn small(
    pencil: &impl Pencil,
    wanted: usize,
    (op, shift): (ShiftInvert<'_>, f64),
    given: Option<f64>,
) -> Result<SymmetricModes> {
    let mut counts = Counts::default();
    let mut solved = |op: &ShiftInvert<'_>, shift: f64| -> Result<std::result::Result<SymmetricModes, usize>> {
        counts.add("dense eigensolutions", 1);
        let (theta, x) = every(pencil, op, wanted)?;
        if theta.len() < wanted { Ok(Err(theta.len())) } else { finish(pencil, op, x, &theta, shift).map(Ok) }
    };
    let mut found = solved(&op, shift)?;
    let coarse = -FIRST_SHIFT * pencil.scale();
    let poor = given.is_none() && shift != coarse && found.as_ref().map_or(true, |m| worst(m) > SHARP);
    if poor {
        found = sharper(found, solved(&pencil.shifted(coarse)?, coarse)?);
    }
    counts.add("factorisations", u64::from(poor));
    let mut modes = found.map_err(|left| {
        let far = if given.is_some() { " or lie too far from sigma: leave sigma out" } else { "" };
        Error::model(format!("n = {wanted} modes were asked for, but the constraints leave {left}{far}"))
    })?;
    (modes.verified, modes.counts) = ("all computed", counts);
    Ok(modes)
}

/// All eigenpairs of L^T A^-1 L with M = L L^T, of which the `wanted` largest are returned, fewer where constraints leave fewer. O(n^3).
fn every(pencil: &impl Pencil, op: &ShiftInvert<'_>, wanted: usize) -> Result<(Vec<f64>, Mat<f64>)> {
    let n = pencil.dim();
    if n > LARGEST_DENSE {
        return Err(Error::model(format!(
            "{wanted} modes were asked for and about {} exist among {n} coordinates: use minimal coordinates",
            pencil.free_dim()
        )));
    }
    let (l, pseudo_inverse) = mass_factor(&Mat::from_fn(n, n, |i, j| pencil.mass().get(i, j)))?;
    let mut x = Mat::zeros(n, l.ncols());
    op.apply(pseudo_inverse.as_ref(), x.as_mut())?;
    let b = l.transpose() * &x;
    if !crate::linalg::quadratic::is_finite(b.as_ref()) {
        return Err(Error::singular("the shifted matrix is singular"));
    }
    let symmetric = Mat::from_fn(b.nrows(), b.nrows(), |i, j| 0.5 * (b[(i, j)] + b[(j, i)]));
    let eigen = eigen_of(&symmetric)?;
    let mut order: Vec<usize> = (0..b.nrows()).collect();
    order.sort_by(|a, b| eigen.S()[*b].abs().total_cmp(&eigen.S()[*a].abs()));
    let largest = order.first().map_or(0.0, |k| eigen.S()[*k].abs());
    // constraints leave exact zeros, which rounding blurs
    order.retain(|k| eigen.S()[*k].abs() > VANISHED * largest);
    order.truncate(wanted);
    let wanted = order.len();
    let value: Vec<f64> = order.iter().map(|k| eigen.S()[*k]).collect();
    let chosen = Mat::from_fn(b.nrows(), wanted, |i, j| eigen.U()[(i, order[j])]);
    let mut shape = &pseudo_inverse * &chosen;
    if l.ncols() < n {
        // coordinates without mass follow the others
        let whole = &x * Mat::from_fn(b.nrows(), wanted, |i, j| chosen[(i, j)] / value[j]);
        shape += &whole - &pseudo_inverse * (l.transpose() * &whole);
    }
    Ok((value, shape))
}

/// L and the transpose of its pseudo-inverse for M = L L^T, M semidefinite: the inertia of a rod about its own axis is zero or rounding.
fn mass_factor(m: &Mat<f64>) -> Result<(Mat<f64>, Mat<f64>)> {
    let n = m.nrows();
    let size: Vec<f64> = (0..n).map(|i| if m[(i, i)] > 0.0 { m[(i, i)].sqrt() } else { 1.0 }).collect();
    let eigen = eigen_of(&Mat::from_fn(n, n, |i, j| m[(i, j)] / (size[i] * size[j])))?;
    let value = |k: usize| eigen.S()[k];
    if (0..n).any(|k| value(k) < -SEMIDEFINITE) {
        return Err(Error::singular("the mass matrix is not positive definite: give every coordinate a mass"));
    }
    let inert: Vec<usize> = (0..n).filter(|&k| value(k) > n as f64 * f64::EPSILON).collect();
    let entry = |i: usize, j: usize| (eigen.U()[(i, inert[j])], value(inert[j]).sqrt());
    let l = Mat::from_fn(n, inert.len(), |i, j| size[i] * entry(i, j).0 * entry(i, j).1);
    Ok((l, Mat::from_fn(n, inert.len(), |i, j| entry(i, j).0 / (size[i] * entry(i, j).1))))
}

fn eigen_of(a: &Mat<f64>) -> Result<SelfAdjointEigen<f64>> {
    a.self_adjoint_eigen(faer::Side::Lower).map_err(|_| Error::singular("the dense eigenproblem did not converge"))
}

fn start<'a>(
    pencil: &'a impl Pencil,
    wanted: usize,
    sigma: Option<f64>,
    counts: &mut Counts,
    cancel: &Cancel,
) -> Result<(ShiftInvert<'a>, f64)> {
    counts.add("factorisations", 1);
    if let Some(sigma) = sigma {
        if !sigma.is_finite() {
            return Err(Error::model(format!("sigma = {sigma} is not finite")));
        }
        return Ok((pencil.shifted(sigma)?, sigma));
    }
    match pencil.shifted_at_zero()? {
        Some(op) => Ok((op, 0.0)),
        None => below_zero(pencil, wanted, counts, cancel),
    }
}

/// Of a system that is free, or nearly so: a negative shift between the first elastic eigenvalue and the last wanted one, found from coarse
/// Ritz values; these lie too high, so the shift only ever comes down.
fn below_zero<'a>(
    pencil: &'a impl Pencil,
    wanted: usize,
    counts: &mut Counts,
    cancel: &Cancel,
) -> Result<(ShiftInvert<'a>, f64)> {
    let mut sigma = -FIRST_SHIFT * pencil.scale();
    if is_small(pencil, &Options::new(wanted, true)) {
        return Ok((pencil.shifted(sigma)?, sigma));
    }
    let mut op = pencil.shifted(sigma)?;
    let mut before = None;
    for _ in 0..12 {
        counts.add("factorisations", 1);
        let options = Options::new(wanted, true);
        let coarse = Options { dim: (wanted + 2 * options.block).div_ceil(options.block) * options.block, ..options };
        let cycled = Space::new(&op, coarse).and_then(|mut space| Ok((space.cycle(cancel)?, space.counts)));
        // what rounding leaves of a rigid motion was followed as if it were elastic: the shifted matrix is singular
        if let (Err(Error::Singular(_)), Some(last)) = (&cycled, before.take()) {
            return Ok(last);
        }
        let (ritz, work) = cycled?;
        counts.merge(&work);
        let elastic = ritz.value.iter().filter(|theta| theta.re > 0.0).map(|theta| sigma + 1.0 / theta.re);
        let first = elastic.filter(|l| *l > ELASTIC * sigma.abs()).fold(f64::INFINITY, f64::min);
        if 30.0 * first >= sigma.abs() {
            return Ok((op, sigma));
        }
        // the coarse value lies above the true one, mostly far above: a bold step saves factorisations
        let Ok(moved) = pencil.shifted(-0.1 * first) else { break };
        before = Some((std::mem::replace(&mut op, moved), sigma));
        sigma = -0.1 * first;
    }
    Ok((op, sigma))
}

/// A shift below the first eigenvalue, as near to it as the first few are to each other, by bisection with inertia counts.
fn nearer<'a>(
    pencil: &'a impl Pencil,
    wanted: usize,
    counts: &mut Counts,
    cancel: &Cancel,
) -> Result<(ShiftInvert<'a>, f64)> {
    // not halves: a zero on the diagonal of a shifted matrix leaves its inertia open
    const PARTS: [f64; 3] = [0.4837, 0.5291, 0.4462];
    let enough = 2 * wanted + 10;
    let (mut low, mut high) = (0.0, 4.0 * pencil.scale());
    for _ in 0..BISECTIONS {
        cancel.check()?;
        let mut found = None;
        for middle in PARTS.map(|part| low + part * (high - low)) {
            counts.add("inertia counts", 1);
            if let Some(count) = pencil.count_below(middle) {
                found = Some((middle, count));
                break;
            }
        }
        match found {
            Some((middle, 0)) => low = middle,
            Some((middle, count)) => {
                high = middle;
                if count <= enough {
                    break;
                }
            }
            None => break,
        }
    }
    counts.add("moved shifts", 1);
    counts.add("factorisations", 1);
    Ok((pencil.shifted(low)?, low))
}

/// Whether eigenvalues nearer to the shift than the wanted ones were overlooked; None where inertia cannot tell.
fn missed(pencil: &impl Pencil, ritz: &Ritz, wanted: usize, sigma: f64, counts: &mut Counts) -> Option<bool> {
    let distance = |k: usize| 1.0 / ritz.value[k].norm();
    // the last of the wanted ones that is followed by a gap, so that a group cut in two is not counted
    let total = ritz.value.iter().take_while(|v| v.norm() > 0.0).count();
    let cut =
        (1..=wanted.min(total)).rev().find(|c| *c == total || distance(*c) > distance(c - 1) * (1.0 + SAME_VALUE))?;
    // to the middle of the gap, or where nothing is known behind it as far
    let last = distance(cut - 1);
    let gap = if cut < total { distance(cut) - last } else { last };
    let radius = last + 0.5 * gap.min(last);
    counts.add("inertia counts", 2);
    let above = pencil.count_below(sigma + radius)?;
    let below = pencil.count_below(sigma - radius)?;
    Some(above.saturating_sub(below) > cut)
}

fn finish(
    pencil: &impl Pencil,
    op: &ShiftInvert<'_>,
    x: Mat<f64>,
    values: &[f64],
    sigma: f64,
) -> Result<SymmetricModes> {
    let (n, wanted) = (pencil.dim(), values.len());
    // one more inverse iteration: it shows the residual and improves the shapes
    let mut y = Mat::zeros(n, wanted);
    op.apply(x.as_ref(), y.as_mut())?;
    let mut forces = op.forces(wanted);
    let mut residual = vec![0.0; wanted];
    for k in 0..wanted {
        let theta = values[k];
        let difference = Mat::from_fn(n, 1, |i, _| y[(i, k)] / theta - x[(i, k)]);
        residual[k] = mass_norm(pencil.mass(), difference.as_ref());
        let norm = mass_norm(pencil.mass(), y.subcols(k, 1));
        if !norm.is_finite() || norm == 0.0 {
            return Err(Error::singular(
                "the shifted matrix is singular: a shape is infinite or NaN; give another sigma",
            ));
        }
        for scaled in [&mut y, &mut forces] {
            scaled.col_mut(k).iter_mut().for_each(|v| *v /= norm);
        }
    }
    orthonormalise(pencil.mass(), &mut y, &mut forces);
    separate(pencil, sigma, &mut y, &mut forces, &mut residual)?;
    for k in 0..wanted {
        // deterministic sign: the largest component is positive
        let largest = (0..n).fold(0, |a, i| if y[(i, k)].abs() > y[(a, k)].abs() { i } else { a });
        if y[(largest, k)] < 0.0 {
            y.col_mut(k).iter_mut().for_each(|v| *v = -*v);
        }
    }
    let of_rows = pencil.row_sensitivity(forces.as_ref(), y.as_ref());
    let from_energy = pencil.energies(y.as_ref());
    // what the entries of an assembled K leave of its low eigenvalues; sums of energies lose nothing of the kind
    let exact = from_energy.is_some();
    let data = if exact { 0.0 } else { ENTRY_NOISE * f64::EPSILON * pencil.scale() };
    let mut lambda = from_energy.unwrap_or_else(|| (0..wanted).map(|k| sigma + 1.0 / values[k]).collect());
    let mut error = vec![0.0; wanted];
    // rounding of a sum of positive energies
    let of_sum = f64::EPSILON * (n as f64).sqrt();
    let (mut rigid, mut softest) = (0, f64::INFINITY);
    for k in 0..wanted {
        let from_vector = residual[k].powi(2) * ((lambda[k] - sigma) / lambda[k]).abs();
        // below it lambda cannot be told from zero
        let floor = match exact {
            true => 1e3 * residual[k].powi(2) * sigma.abs() + VANISHED.powi(2) * pencil.scale(),
            false => RIGID * sigma.abs() + 1e2 * data,
        };
        if sigma != 0.0 && lambda[k].abs() <= floor {
            error[k] = floor;
            lambda[k] = 0.0;
            rigid += 1;
            continue;
        }
        let rows = DATA_ROUNDING * 0.5 * f64::EPSILON * of_rows[k];
        // shapes are rounded, and with them the stretch of what they should not stretch
        let of_shape = f64::EPSILON.powi(2) * pencil.scale();
        error[k] = (data + rows + of_shape) / lambda[k].abs() + from_vector + of_sum;
        if lambda[k] > 0.0 && lambda[k] < ELASTIC * sigma.abs() && (!exact || from_vector > SHARP) {
            softest = softest.min(lambda[k]);
        }
    }
    let mut order: Vec<usize> = (0..wanted).collect();
    order.sort_by(|a, b| lambda[*a].total_cmp(&lambda[*b]));
    Ok(SymmetricModes {
        lambda: order.iter().map(|k| lambda[*k]).collect(),
        residual: order.iter().map(|k| residual[*k]).collect(),
        error: order.iter().map(|k| error[*k]).collect(),
        shape: Mat::from_fn(n, wanted, |i, j| y[(i, order[j])]),
        rigid,
        sigma,
        softer: softest.is_finite().then_some(-10.0 * softest),
        verified: "unverified",
        counts: Counts::default(),
    })
}

/// Takes out of each shape what rounding of the solution left of those nearer to the shift, which is most where these are nearest.
fn orthonormalise(mass: &Csc, y: &mut Mat<f64>, forces: &mut Mat<f64>) {
    let mut weighed = Mat::zeros(y.nrows(), y.ncols());
    mass.multiply(y.as_ref(), weighed.as_mut(), false);
    let Ok(l) = cholesky((y.transpose() * &weighed).as_ref()) else { return };
    for a in [y, forces] {
        l.solve_lower_triangular_in_place(a.as_mut().transpose_mut());
    }
}

/// Modes much nearer to zero than the shift, and rigid ones, are one repeated value to the operator, and rounding mixes their shapes. The
/// singular values of their stretches tell them apart.
fn separate(
    pencil: &impl Pencil,
    sigma: f64,
    y: &mut Mat<f64>,
    forces: &mut Mat<f64>,
    residual: &mut [f64],
) -> Result<()> {
    let Some(lambda) = pencil.energies(y.as_ref()) else { return Ok(()) };
    let soft: Vec<usize> = (0..lambda.len()).filter(|k| lambda[*k].abs() <= ELASTIC * sigma.abs()).collect();
    let own = |a: &Mat<f64>| Mat::from_fn(a.nrows(), soft.len(), |i, k| a[(i, soft[k])]);
    let shapes = own(y);
    let Some(strains) = pencil.strains(shapes.as_ref()).filter(|_| soft.len() > 1) else { return Ok(()) };
    // enough rows for all singular values
    let rows = strains.nrows().max(soft.len());
    let w = Mat::from_fn(rows, soft.len(), |i, k| if i < strains.nrows() { strains[(i, k)] } else { 0.0 });
    let svd =
        w.thin_svd().map_err(|_| Error::singular("stretches of soft modes are not finite: give another sigma"))?;
    let turn = svd.V();
    for a in [y, forces] {
        let mixed = own(a) * turn;
        soft.iter().enumerate().for_each(|(c, k)| a.col_mut(*k).copy_from(mixed.col(c)));
    }
    let all = soft.iter().map(|k| residual[*k].powi(2)).sum::<f64>().sqrt();
    soft.iter().for_each(|k| residual[*k] = all);
    Ok(())
}

fn mass_norm(m: &Csc, x: MatRef<'_, f64>) -> f64 {
    let mut weighed = Mat::zeros(m.rows, 1);
    m.multiply(x, weighed.as_mut(), false);
    let sum: f64 = (0..m.rows).map(|i| x[(i, 0)] * weighed[(i, 0)]).sum();
    sum.max(0.0).sqrt()
}
