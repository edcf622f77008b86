//! From raw modes to the result: order, groups of repeated roots, normalisation, signs, kinds and error estimates.
use faer::linalg::solvers::DenseSolveCore;
use faer::{Mat, MatRef};

use super::quality::{Correction, Quality, Terms, evaluate};
use super::refine::refine;
use super::subspace::{aligned, bilinear_gram_schmidt, hermitian_gram_schmidt, largest_component, mass_times, rescale};
use super::{Kind, Modal, Raw, RawMode};
use crate::error::Result;
use crate::linalg::dense::{C, EPS, abs, real_times};
use crate::run::Counts;
use crate::second_order::SecondOrder;
use crate::tolerances::matrices::TIE;
use crate::tolerances::modes::NEAR_DEFECTIVE;

pub fn finish(system: &SecondOrder, d: &[f64], raw: Raw, mut counts: Counts) -> Result<Modal> {
    let terms = Terms::new(system);
    let mut modes = raw.modes;
    let mut quality = qualities(&terms, &mut modes, raw.correction);
    refine(&terms, &mut modes, &mut quality, &mut counts);
    refine_partners(&terms, &mut modes, &mut counts);
    heed_neighbours(&modes, &mut quality);
    for (mode, quality) in modes.iter_mut().zip(&mut quality) {
        settle(mode, quality);
    }
    let order = ordered(&modes, &quality);
    let mut modes: Vec<RawMode> = pick(modes, &order);
    let mut quality: Vec<Quality> = order.iter().map(|&j| quality[j]).collect();
    let groups = grouped(&modes, &quality);
    let near_defective: Vec<bool> = modes
        .iter()
        .zip(&quality)
        .map(|(m, q)| raw.may_be_defective && !m.rigid && q.separation < NEAR_DEFECTIVE)
        .collect();
    let mut work = Shapes::new(system, d, &modes);
    for &(first, count) in &groups {
        work.align(&terms, first, count, &modes, near_defective[first]);
    }
    if !groups.is_empty() {
        for (mode, j) in modes.iter_mut().zip(0..) {
            mode.x = (0..work.x.nrows()).map(|i| work.x[(i, j)]).collect();
            mode.y = work.y.as_ref().map(|y| (0..y.nrows()).map(|i| y[(i, j)]).collect());
        }
        let known = qualities(&terms, &mut modes, Correction::None);
        for (q, new) in quality.iter_mut().zip(known) {
            q.denominator = new.denominator;
            q.backward = new.backward;
        }
    }
    work.mx = real_times(system.m.as_ref(), work.x.as_ref());
    for j in 0..modes.len() {
        let grouped = groups.iter().any(|&(first, count)| (first..first + count).contains(&j));
        work.normalise(j, &modes[j], quality[j].denominator, near_defective[j], grouped);
    }
    let settled = Settled { modes, quality, groups, near_defective };
    Ok(settled.assembled(d, work, raw.route, counts))
}

fn qualities(terms: &Terms, modes: &mut [RawMode], correction: Correction) -> Vec<Quality> {
    let mut s: Vec<C> = modes.iter().map(|m| m.s).collect();
    let (x, y) = (columns(modes, |m| &m.x), left_columns(modes));
    let left = y.as_ref().map(|y| y.as_ref());
    let mut quality = evaluate(terms, &mut s, x.as_ref(), left, correction);
    for ((quality, mode), s) in quality.iter_mut().zip(modes).zip(s) {
        if s != mode.s && !mode.rigid {
            mode.s = s;
            mode.partner = if mode.partner.im == 0.0 { mode.partner } else { s.conj() };
        }
        if let Some(known) = mode.known.filter(|_| !mode.rigid) {
            if known.residual_counts {
                quality.error = quality.error.max(known.error);
            } else {
                (quality.error, quality.condition, quality.backward) = (known.error, known.condition, known.error);
            }
            quality.tolerance = quality.tolerance.min(mode.s.norm() * (quality.error + 16.0 * EPS * known.condition));
        }
        if mode.rigid {
            let noise = mode.known.map_or(0.0, |known| known.error);
            (quality.error, quality.condition, quality.tolerance) = (noise, f64::NAN, 0.0);
        }
    }
    quality
}

/// Real partners with a shape of their own deserve the same care.
fn refine_partners(terms: &Terms, modes: &mut [RawMode], counts: &mut Counts) {
    let own: Vec<usize> = (0..modes.len()).filter(|&j| modes[j].partner_x.is_some()).collect();
    if own.is_empty() {
        return;
    }
    let mut partners: Vec<RawMode> = own
        .iter()
        .map(|&j| RawMode {
            s: modes[j].partner,
            partner: modes[j].s,
            x: modes[j].partner_x.take().unwrap_or_default(),
            y: modes[j].partner_y.take(),
            partner_x: None,
            partner_y: None,
            rigid: modes[j].partner == C::ZERO,
            known: None,
        })
        .collect();
    let mut quality = qualities(terms, &mut partners, Correction::Any);
    refine(terms, &mut partners, &mut quality, counts);
    for (j, partner) in own.into_iter().zip(partners) {
        modes[j].partner = partner.s;
        modes[j].partner_x = Some(partner.x);
        modes[j].partner_y = partner.y;
    }
}

fn heed_neighbours(modes: &[RawMode], quality: &mut [Quality]) {
    let roots: Vec<C> = modes.iter().flat_map(|m| [m.s, m.partner]).collect();
    for (j, quality) in quality.iter_mut().enumerate().filter(|(j, _)| !modes[*j].rigid && modes[*j].known.is_none()) {
        let others = roots.iter().enumerate().filter(|(k, _)| *k != 2 * j);
        let distances: Vec<f64> = others.map(|(_, s)| abs(s - modes[j].s)).collect();
        quality.heed_neighbours(modes[j].s, &distances);
    }
}

fn columns<'a>(modes: &'a [RawMode], of: impl Fn(&'a RawMode) -> &'a Vec<C>) -> Mat<C> {
    let n = modes.first().map_or(0, |m| m.x.len());
    Mat::from_fn(n, modes.len(), |i, j| of(&modes[j])[i])
}

fn left_columns(modes: &[RawMode]) -> Option<Mat<C>> {
    modes.iter().all(|m| m.y.is_some()).then(|| {
        let n = modes.first().map_or(0, |m| m.x.len());
        Mat::from_fn(n, modes.len(), |i, j| modes[j].y.as_ref().map_or(C::ZERO, |y| y[i]))
    })
}

/// Real parts that are nothing but the root's own error become zero.
fn settle(mode: &mut RawMode, quality: &Quality) {
    if mode.s.im > 0.0 {
        let blur = mode.s.norm() * (quality.error + 4.0 * EPS * quality.condition);
        if mode.s.re.abs() <= blur {
            mode.s.re = 0.0;
            mode.partner = mode.s.conj();
        }
    }
}

/// Ascending |s|; equal |s| by damping ratio; rigid modes with a double zero root before those with a single one.
fn ordered(modes: &[RawMode], quality: &[Quality]) -> Vec<usize> {
    let mut order: Vec<usize> = (0..modes.len()).collect();
    let size = |j: usize| modes[j].s.norm();
    order.sort_by(|&a, &b| size(a).total_cmp(&size(b)));
    let ratio = |j: usize| -modes[j].s.re / size(j).max(f64::MIN_POSITIVE);
    let single = |j: usize| modes[j].partner != C::ZERO;
    let mut start = 0;
    while start < order.len() {
        let mut end = start + 1;
        while end < order.len() && {
            let (a, b) = (order[end - 1], order[end]);
            size(b) - size(a) <= quality[a].tolerance + quality[b].tolerance
        } {
            end += 1;
        }
        order[start..end].sort_by(|&a, &b| {
            (!modes[a].rigid)
                .cmp(&!modes[b].rigid)
                .then((modes[a].rigid && single(a)).cmp(&(modes[b].rigid && single(b))))
                .then(ratio(a).total_cmp(&ratio(b)))
        });
        start = end;
    }
    order
}

fn pick(modes: Vec<RawMode>, order: &[usize]) -> Vec<RawMode> {
    let mut slots: Vec<Option<RawMode>> = modes.into_iter().map(Some).collect();
    order.iter().filter_map(|&j| slots[j].take()).collect()
}

/// Chains of neighbours that cannot be told apart, with more than one member.
fn grouped(modes: &[RawMode], quality: &[Quality]) -> Vec<(usize, usize)> {
    let same = |a: usize, b: usize| {
        if modes[a].rigid || modes[b].rigid {
            let double = |j: usize| modes[j].partner == C::ZERO;
            modes[a].rigid && modes[b].rigid && double(a) == double(b)
        } else {
            (modes[a].s - modes[b].s).norm() <= quality[a].tolerance + quality[b].tolerance
        }
    };
    let (mut groups, mut start) = (Vec::new(), 0);
    while start < modes.len() {
        let mut end = start + 1;
        while end < modes.len() && same(end - 1, end) {
            end += 1;
        }
        if end - start > 1 {
            groups.push((start, end - start));
        }
        start = end;
    }
    groups
}

struct Shapes<'a> {
    m: MatRef<'a, f64>,
    scale: &'a [f64],
    x: Mat<C>,
    y: Option<Mat<C>>,
    /// M x, once the bases are settled.
    mx: Mat<C>,
}

impl<'a> Shapes<'a> {
    fn new(system: &'a SecondOrder, scale: &'a [f64], modes: &[RawMode]) -> Self {
        Shapes {
            m: system.m.as_ref(),
            scale,
            x: columns(modes, |m| &m.x),
            y: left_columns(modes),
            mx: Mat::zeros(0, 0),
        }
    }

    /// A basis of a repeated root's shapes that depends on their span only.
    fn align(&mut self, terms: &Terms, first: usize, count: usize, modes: &[RawMode], defective: bool) {
        let members = &modes[first..first + count];
        // rigid modes with a real partner have been aligned and matched with their partners already
        if defective || members.iter().any(|m| m.rigid && m.partner != C::ZERO) {
            return;
        }
        let s = members.iter().map(|m| m.s).sum::<C>() / count as f64;
        let turned = aligned(self.x.subcols(first, count));
        let mut x = turned.clone();
        let bilinear = self.y.is_none() && s.im > 0.0 && !is_real(x.as_ref());
        if bilinear {
            let form = |v: faer::ColRef<'_, C>| slope_times(terms, s, v);
            if !bilinear_gram_schmidt(&mut x, form, C::new(0.0, 2.0 * s.im)) {
                return;
            }
        } else {
            hermitian_gram_schmidt(&mut x, self.m);
        }
        self.x.subcols_mut(first, count).copy_from(&x);
        if let Some(y) = &mut self.y {
            let members = y.subcols(first, count).to_owned();
            let dual = dual_basis(terms, s, &x, &members);
            y.subcols_mut(first, count).copy_from(&dual);
        }
    }

    fn normalise(&mut self, j: usize, mode: &RawMode, denominator: C, defective: bool, grouped: bool) {
        let target = C::new(0.0, 2.0 * mode.s.im);
        let modal = mode.s.im > 0.0 && !defective && denominator != C::ZERO;
        if self.y.is_none() && modal && !is_real(self.x.subcols(j, 1)) {
            rescale(&mut self.x, j, (target / denominator).sqrt());
            let flip = -self.sign(j);
            if flip > 0.0 {
                rescale(&mut self.x, j, C::new(-1.0, 0.0));
            }
            return;
        }
        let before = self.unit_mass(j);
        let Some(y) = &mut self.y else { return };
        if modal {
            rescale(y, j, target / (denominator * before));
        } else if !grouped || mode.rigid {
            let my = mass_times(self.m, y.col(j));
            unit_mass(y, j, &my, self.scale);
        }
    }

    /// phi^H M phi = 1 with a positive largest component; returns the factor that did it.
    fn unit_mass(&mut self, j: usize) -> C {
        let mx: Vec<C> = self.mx.col(j).iter().copied().collect();
        unit_mass(&mut self.x, j, &mx, self.scale)
    }

    /// Sign of the real part of the largest component, of the imaginary part where that vanishes.
    fn sign(&self, j: usize) -> f64 {
        let x = self.x.col(j);
        let value = x[largest_component(x, self.scale)];
        let decisive = if value.re.abs() > TIE * value.norm() { value.re } else { value.im };
        decisive.signum()
    }
}

/// Shapes that are real but for rounding have the same norm either way.
fn is_real(x: MatRef<'_, C>) -> bool {
    (0..x.ncols()).all(|j| (0..x.nrows()).all(|i| x[(i, j)].im == 0.0))
}

fn unit_mass(x: &mut Mat<C>, j: usize, mx: &[C], scale: &[f64]) -> C {
    let square: f64 = (0..x.nrows()).map(|i| (x[(i, j)].conj() * mx[i]).re).sum();
    let largest = x[(largest_component(x.col(j), scale), j)];
    if square <= 0.0 || largest == C::ZERO {
        return C::new(1.0, 0.0);
    }
    let phase = if largest.im == 0.0 { C::new(largest.re.signum(), 0.0) } else { largest.conj() / largest.norm() };
    let factor = phase / square.sqrt();
    rescale(x, j, factor);
    factor
}

fn slope_times(terms: &Terms, s: C, x: faer::ColRef<'_, C>) -> Vec<C> {
    let mut out = mass_times(terms.m.as_ref(), x);
    out.iter_mut().for_each(|v| *v *= 2.0 * s);
    if let Some(d) = &terms.d {
        for (o, v) in out.iter_mut().zip(mass_times(d.as_ref(), x)) {
            *o += v;
        }
    }
    out
}

/// Left vectors with y_i^T Q'(s) x_j = 0 for i != j.
fn dual_basis(terms: &Terms, s: C, x: &Mat<C>, y: &Mat<C>) -> Mat<C> {
    let g = x.ncols();
    let slopes: Vec<Vec<C>> = (0..g).map(|j| slope_times(terms, s, x.col(j))).collect();
    let w = Mat::from_fn(g, g, |i, j| (0..x.nrows()).map(|r| y[(r, i)] * slopes[j][r]).sum::<C>());
    let lu = w.transpose().to_owned().partial_piv_lu();
    let inverse = lu.inverse();
    let dual = y * inverse;
    let finite = (0..g).all(|j| (0..x.nrows()).all(|i| dual[(i, j)].is_finite()));
    if finite { dual } else { y.clone() }
}

fn kind(mode: &RawMode, quality: &Quality) -> Kind {
    let blur = mode.s.norm() * (quality.error + 4.0 * EPS * quality.condition);
    let unstable = mode.s.re > blur;
    if mode.rigid {
        Kind::Rigid
    } else if mode.s.im > 0.0 {
        if unstable { Kind::Flutter } else { Kind::Vibration }
    } else if unstable {
        Kind::Divergence
    } else {
        Kind::Overdamped
    }
}

/// Modes in their final order.
struct Settled {
    modes: Vec<RawMode>,
    quality: Vec<Quality>,
    groups: Vec<(usize, usize)>,
    near_defective: Vec<bool>,
}

impl Settled {
    fn assembled(self, d: &[f64], work: Shapes<'_>, route: &'static str, counts: Counts) -> Modal {
        let (modes, quality) = (&self.modes, &self.quality);
        let unscaled = |x: &Mat<C>| Mat::from_fn(x.nrows(), x.ncols(), |i, j| x[(i, j)] * d[i]);
        let own: Vec<usize> = (0..modes.len()).filter(|&j| modes[j].partner_x.is_some()).collect();
        let partner = |of: &dyn Fn(&RawMode) -> Option<&Vec<C>>| {
            Mat::from_fn(d.len(), own.len(), |i, k| of(&modes[own[k]]).map_or(C::ZERO, |v| v[i] * d[i]))
        };
        let partner_shape = partner(&|m| m.partner_x.as_ref());
        let partner_left = work.y.as_ref().map(|_| partner(&|m| m.partner_y.as_ref()));
        Modal {
            s: modes.iter().map(|m| m.s).collect(),
            partner: modes.iter().map(|m| m.partner).collect(),
            shape: unscaled(&work.x),
            left: work.y.as_ref().map(unscaled),
            kind: modes.iter().zip(quality).map(|(m, q)| kind(m, q)).collect(),
            backward_error: quality.iter().map(|q| q.backward).collect(),
            condition: quality.iter().map(|q| q.condition).collect(),
            error: quality.iter().map(|q| q.error).collect(),
            partner_mode: own,
            partner_shape,
            partner_left,
            near_defective: self.near_defective,
            groups: self.groups,
            route,
            counts,
        }
    }
}
