//! The residual of harmonic balance, R(y, p) = S y + sum_e W_e F_e(W_e^T y) - f, with dR/dy and dR/dp.
//!
//! Unknowns by harmonic: n constants, then per term n cosine and n sine coefficients of the retained coordinates.
use faer::Mat;
use num_complex::Complex64 as c64;

use super::aft::{Aft, Want};
use super::basis::Basis;
use super::blocks::Blocks;
use super::element::{Direction, Element, add_product, retained_of};
use super::family::{Member, Placed};
use super::linear::{Block, DynamicStiffness};
use super::rows;
use crate::error::{Error, Result};
use crate::solve::{Curve, Linearisation, largest, nan_or_largest};
use crate::tolerances::periodic::ROW_ROUNDING;

/// What the continuation parameter is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Parameter {
    /// the base frequency with this number
    Omega(usize),
    /// factor on all frequencies
    Scale,
    /// factor on all forces but the static one
    Level,
    /// factor on all forces, by which a first solution is approached
    Ramp,
    /// a number of the system itself, which its family turns into matrices and laws
    Family,
}

pub struct Problem {
    pub basis: Basis,
    pub linear: Box<dyn DynamicStiffness>,
    pub elements: Vec<Element>,
    pub omega: Vec<f64>,
    /// the frequencies that `Parameter::Scale` multiplies
    pub unit: Vec<f64>,
    pub level: f64,
    pub ramp: f64,
    pub parameter: Parameter,
    pub aft: Aft,
    pub family: Option<Placed>,
    n: usize,
    retained: Vec<Vec<Direction>>,
    blocks: Blocks,
    coefficients: Vec<f64>,
    /// per element the largest coefficient of each of its forces at the last evaluation
    pushes: Vec<Vec<f64>>,
    /// forces of the elements at the last evaluation in the terms that the samples resolve beyond the basis, term by term, where asked for
    tail: Vec<c64>,
    /// the first element whose force was not finite at the last evaluation
    pub broken: Option<usize>,
    /// the last element of which that was true at any evaluation since this was cleared
    pub ever_broken: Option<usize>,
    pub evaluations: u64,
    /// dynamic stiffnesses that were computed
    pub factorisations: u64,
}

impl Problem {
    pub fn new(
        basis: Basis,
        linear: Box<dyn DynamicStiffness>,
        elements: Vec<Element>,
        omega: Vec<f64>,
        dims: &[usize],
    ) -> Result<Problem> {
        let n = linear.size();
        let with_memory = elements.iter().any(|e| e.force.has_memory());
        let aft = Aft::new(&basis, dims, with_memory);
        let retained = retained_of(linear.as_ref(), &elements)?;
        Ok(Problem {
            retained,
            blocks: Blocks::new(basis.n_harmonics() + 1, n),
            coefficients: Vec::new(),
            pushes: elements.iter().map(|e| vec![0.0; e.directions.len()]).collect(),
            tail: Vec::new(),
            n,
            aft,
            basis,
            linear,
            elements,
            unit: omega.clone(),
            omega,
            level: 1.0,
            ramp: 1.0,
            family: None,
            parameter: Parameter::Omega(0),
            broken: None,
            ever_broken: None,
            evaluations: 0,
            factorisations: 0,
        })
    }

    /// The same problem on other terms and another grid; the first terms must be the same.
    pub fn on(&self, basis: Basis, dims: &[usize]) -> Result<Problem> {
        let (linear, elements) = (self.linear.copied()?, self.elements.clone());
        let mut other = Problem::new(basis, linear, elements, self.omega.clone(), dims)?;
        other.unit.clone_from(&self.unit);
        other.level = self.level;
        other.ramp = self.ramp;
        other.parameter = self.parameter;
        other.family.clone_from(&self.family);
        Ok(other)
    }

    /// Takes over frequencies, forces and the blocks of a problem with the same first terms.
    pub fn follow(&mut self, other: &Problem) -> Result<()> {
        if let (Some(own), Some(theirs)) = (&self.family, &other.family)
            && own.value != theirs.value
        {
            let (linear, elements) = (other.linear.copied()?, other.elements.clone());
            self.install(Member { linear, elements })?;
            self.family.clone_from(&other.family);
        }
        self.omega.clone_from(&other.omega);
        self.unit.clone_from(&other.unit);
        self.level = other.level;
        self.ramp = other.ramp;
        self.parameter = other.parameter;
        self.blocks.follow(&other.blocks);
        Ok(())
    }

    /// Samples per dimension.
    pub fn dims(&self) -> Vec<usize> {
        self.aft.dims().to_vec()
    }

    /// Forces also in the terms that the samples resolve beyond the basis, whose index vectors come back.
    pub fn resolve_tail(&mut self) -> Vec<Vec<i32>> {
        let indices = self.aft.resolve_tail(&self.basis);
        self.tail = vec![c64::new(0.0, 0.0); indices.len() * self.n];
        indices
    }

    /// Those forces at the last evaluation, n per term.
    pub fn tail(&self) -> &[c64] {
        &self.tail
    }

    /// Retained coordinates.
    pub fn n(&self) -> usize {
        self.n
    }

    /// Blocks of all terms, as they were evaluated last.
    pub fn blocks(&self) -> &[Block] {
        &self.blocks.each
    }

    /// Per term the sums of absolute terms, with the growth of a factorisation, to which the rounding of the entries of S is in
    /// proportion; `measured` tells those that blocks do not have.
    pub fn entry_sizes(&self, measured: fn(&dyn DynamicStiffness, f64, &mut [f64])) -> Vec<Vec<f64>> {
        let size = |(j, w): (usize, f64)| {
            let mut out = self.blocks.each[j].s_growth.clone();
            if out.is_empty() {
                out.resize(self.n * self.n, 0.0);
                measured(self.linear.as_ref(), w, &mut out);
            }
            out
        };
        self.all_frequencies().into_iter().enumerate().map(size).collect()
    }

    /// What rounding may change in each row of the residual of y, in the order of the residual. Errors of n terms leave the root of n of
    /// their sum where their signs are those of chance, and all of it where steps of a factorisation repeat: a part between.
    pub fn row_rounding(&self, y: &[f64]) -> Vec<f64> {
        let entries = self.entry_sizes(|linear, w, out| linear.uncertain_sizes(w, out));
        let share = (self.linear.full_size() as f64).cbrt().recip();
        let of = |row: rows::Size| f64::EPSILON * (row.terms + share * row.grown);
        rows::own_sizes(self, y, &entries).into_iter().map(of).collect()
    }

    /// The elements' directions in retained coordinates, with the largest coefficient of each force at the last evaluation.
    pub fn pushes(&self) -> impl Iterator<Item = (&Direction, f64)> {
        let of = |(directions, pushes): (_, _)| {
            let (directions, pushes): (&Vec<Direction>, &Vec<f64>) = (directions, pushes);
            directions.iter().zip(pushes.iter().copied())
        };
        self.retained.iter().zip(&self.pushes).flat_map(of)
    }

    /// Per element its directions in retained coordinates.
    pub fn retained(&self) -> &[Vec<Direction>] {
        &self.retained
    }

    /// Joins the coordinates that elements connect, in a list of the first one of each part.
    pub fn join_by_elements(&self, first: &mut [usize]) {
        for directions in &self.retained {
            let touched: Vec<usize> = directions.iter().flatten().map(|(i, _)| *i).collect();
            for pair in touched.windows(2) {
                rows::join(first, pair[0], pair[1]);
            }
        }
    }

    /// Another linear part and other laws in the place of the present ones.
    fn install(&mut self, member: Member) -> Result<()> {
        let Member { linear, elements } = member;
        let coordinates = |elements: &[Element]| elements.iter().map(|e| e.directions.len()).collect::<Vec<_>>();
        if linear.size() != self.n || coordinates(&elements) != coordinates(&self.elements) {
            return Err(Error::model(
                "the family changes the number of coordinates or elements with its parameter; keep them",
            ));
        }
        self.retained = retained_of(linear.as_ref(), &elements)?;
        (self.linear, self.elements) = (linear, elements);
        self.blocks.forget();
        Ok(())
    }

    /// dR/dp by a central difference between two other members of the family; folds do not depend on its accuracy.
    fn family_slope(&mut self, y: &[f64], out: &mut Linearisation) -> Result<()> {
        let Some(Placed { family, value, step }) = self.family.clone() else {
            return Ok(());
        };
        let (linear, elements) = (self.linear.copied()?, self.elements.clone());
        let blocks = self.blocks.clone();
        let mut other = Linearisation::without_jacobian(y.len());
        out.slope.fill(0.0);
        for sign in [1.0, -1.0] {
            self.install(family.member(value + sign * step)?)?;
            self.run(y, &mut other, Want::Force)?;
            for (slope, r) in out.slope.iter_mut().zip(&other.residual) {
                *slope += sign * r / (2.0 * step);
            }
        }
        self.install(Member { linear, elements })?;
        self.blocks = blocks;
        Ok(())
    }

    pub fn set_parameter(&mut self, value: f64) -> Result<()> {
        match self.parameter {
            Parameter::Omega(i) => self.omega[i] = value,
            Parameter::Scale => self.omega = self.unit.iter().map(|w| w * value).collect(),
            Parameter::Level => self.level = value,
            Parameter::Ramp => self.ramp = value,
            Parameter::Family => {
                if let Some(family) = self.family.clone().filter(|f| f.value != value) {
                    self.install(family.family.member(value)?)?;
                    self.family = Some(Placed { value, ..family });
                }
            }
        }
        Ok(())
    }

    pub fn parameter_value(&self) -> f64 {
        match self.parameter {
            Parameter::Omega(i) => self.omega[i],
            Parameter::Scale => self.omega[0] / self.unit[0],
            Parameter::Level => self.level,
            Parameter::Ramp => self.ramp,
            Parameter::Family => self.family.as_ref().map_or(f64::NAN, |f| f.value),
        }
    }

    /// d(term frequency)/d(parameter)
    fn frequency_slope(&self) -> Vec<f64> {
        match self.parameter {
            Parameter::Omega(i) => self.basis.slope(i),
            Parameter::Scale => self.basis.frequencies(&self.unit),
            Parameter::Level | Parameter::Ramp | Parameter::Family => {
                vec![0.0; self.basis.n_harmonics()]
            }
        }
    }

    /// Factor on the force of a term and its derivative by the parameter.
    pub fn force_factor(&self, term: usize) -> (f64, f64) {
        let level = if term > 0 { self.level } else { 1.0 };
        let slope = match self.parameter {
            Parameter::Level if term > 0 => self.ramp,
            Parameter::Ramp => level,
            _ => 0.0,
        };
        (self.ramp * level, slope)
    }

    /// The blocks at the present frequencies, on which alone they depend.
    pub fn update_blocks(&mut self) -> Result<()> {
        let frequencies = self.all_frequencies();
        self.factorisations += self.blocks.update(self.linear.as_mut(), &frequencies)?;
        Ok(())
    }

    fn all_frequencies(&self) -> Vec<f64> {
        let mut frequencies = vec![0.0];
        frequencies.extend(self.basis.frequencies(&self.omega));
        frequencies
    }

    fn add_linear(&self, y: &[f64], slope: &[f64], out: &mut Linearisation, want: Want) {
        let n = self.n;
        for (j, block) in self.blocks.each.iter().enumerate() {
            let (cos, sin) = ((2 * j).saturating_sub(1) * n, 2 * j * n);
            let rate = if j == 0 { 0.0 } else { slope[j - 1] };
            let (factor, factor_slope) = self.force_factor(j);
            for i in 0..n {
                let mut sum = -block.force[i] * factor;
                let mut sum_slope = -block.force_slope[i] * (rate * factor) - block.force[i] * factor_slope;
                for l in 0..n {
                    let x = c64::new(y[cos + l], if j == 0 { 0.0 } else { -y[sin + l] });
                    let s = block.s[i * n + l];
                    sum += s * x;
                    sum_slope += block.s_slope[i * n + l] * x * rate;
                    if want == Want::Jacobian {
                        out.jacobian[(cos + i, cos + l)] = s.re;
                        if j > 0 {
                            out.jacobian[(cos + i, sin + l)] = s.im;
                            out.jacobian[(sin + i, cos + l)] = -s.im;
                            out.jacobian[(sin + i, sin + l)] = s.re;
                        }
                    }
                }
                out.residual[cos + i] = sum.re;
                out.slope[cos + i] = sum_slope.re;
                if j > 0 {
                    out.residual[sin + i] = -sum.im;
                    out.slope[sin + i] = -sum_slope.im;
                }
            }
        }
    }

    /// Coefficients of u = w . x of each coordinate of one element.
    fn collect_coefficients(&mut self, e: usize, y: &[f64]) {
        let n_c = self.basis.n_coefficients();
        self.coefficients.resize(self.retained[e].len() * n_c, 0.0);
        for (direction, own) in self.retained[e].iter().zip(self.coefficients.chunks_exact_mut(n_c)) {
            for (c, part) in own.iter_mut().zip(y.chunks_exact(self.n)) {
                *c = direction.iter().map(|&(i, w)| w * part[i]).sum();
            }
        }
    }

    /// One element by itself; the answer is in `aft`.
    pub fn evaluate_element(&mut self, e: usize, y: &[f64], want: Want) -> Result<()> {
        let (frequency, slope) = (self.basis.frequencies(&self.omega), self.frequency_slope());
        self.collect_coefficients(e, y);
        let element = &self.elements[e];
        self.aft.element(&element.force, &self.coefficients, &frequency, &slope, want)
    }

    fn add_element(
        &mut self,
        e: usize,
        y: &[f64],
        frequency: &[f64],
        slope: &[f64],
        out: &mut Linearisation,
        want: Want,
    ) -> Result<()> {
        let (n, n_c) = (self.n, self.basis.n_coefficients());
        self.collect_coefficients(e, y);
        let element = &self.elements[e];
        self.aft.element(&element.force, &self.coefficients, frequency, slope, want)?;
        if self.broken.is_none() && !self.aft.force.iter().all(|f| f.is_finite()) {
            self.broken = Some(e);
            self.ever_broken = Some(e);
        }
        for (a, direction) in self.retained[e].iter().enumerate() {
            let own = a * n_c..(a + 1) * n_c;
            let (force, force_slope) = (&self.aft.force[own.clone()], &self.aft.force_slope[own]);
            self.pushes[e][a] = largest(force);
            add_tail(direction, &self.aft.tail.force[a * self.aft.tail.len()..], n, &mut self.tail);
            for &(i, wi) in direction {
                for (row, f) in force.iter().enumerate() {
                    out.residual[row * n + i] += wi * f;
                }
                if want != Want::Force {
                    for (row, f) in force_slope.iter().enumerate() {
                        out.slope[row * n + i] += wi * f;
                    }
                }
            }
        }
        if want != Want::Force {
            add_product(&self.retained[e], &self.aft.jacobian, (n, n_c), &mut out.jacobian);
        }
        Ok(())
    }

    fn run(&mut self, y: &[f64], out: &mut Linearisation, want: Want) -> Result<()> {
        self.evaluations += 1;
        self.broken = None;
        self.update_blocks()?;
        let slope = self.frequency_slope();
        let frequency = self.basis.frequencies(&self.omega);
        if want == Want::Jacobian {
            out.jacobian.fill(0.0);
        }
        self.add_linear(y, &slope, out, want);
        self.tail.fill(c64::new(0.0, 0.0));
        for e in 0..self.elements.len() {
            self.add_element(e, y, &frequency, &slope, out, want)?;
        }
        Ok(())
    }

    /// Residual and Jacobian at the present parameter; the slope counts only where the parameter is none of the system.
    pub fn linearise_here(&mut self, y: &[f64], out: &mut Linearisation) -> Result<()> {
        self.run(y, out, Want::Jacobian)
    }

    /// Frequency of the slowest possible term of a periodic motion.
    pub fn base_frequency(&self) -> f64 {
        self.omega[0] / self.basis.subharmonic
    }

    /// sum_e W_e (matrix of df/dv) W_e^T on the coefficients, for stability.
    pub fn rate_matrix(&mut self, y: &[f64]) -> Result<Mat<f64>> {
        let (n, n_c) = (self.n, self.basis.n_coefficients());
        let mut out = Mat::zeros(n * n_c, n * n_c);
        for e in 0..self.elements.len() {
            if !self.elements[e].force.uses_velocity() {
                continue;
            }
            self.evaluate_element(e, y, Want::Jacobian)?;
            add_product(&self.retained[e], &self.aft.damping, (n, n_c), &mut out);
        }
        Ok(out)
    }

    /// Coefficients of all coordinates, full_size x n_c by rows.
    pub fn expand(&mut self, y: &[f64]) -> Result<Mat<f64>> {
        let (n, n_full) = (self.n, self.linear.full_size());
        let mut out = Mat::zeros(n_full, self.basis.n_coefficients());
        let frequencies = self.all_frequencies();
        let mut x = vec![c64::new(0.0, 0.0); n_full];
        for (j, w) in frequencies.iter().enumerate() {
            let (cos, sin) = ((2 * j).saturating_sub(1), 2 * j);
            let part = |i: usize| c64::new(y[cos * n + i], if j == 0 { 0.0 } else { -y[sin * n + i] });
            let retained: Vec<c64> = (0..n).map(part).collect();
            let factor = self.force_factor(j).0;
            self.linear.expand(*w, j, factor, &retained, &mut x)?;
            for i in 0..n_full {
                out[(i, cos)] = x[i].re;
                if j > 0 {
                    out[(i, sin)] = -x[i].im;
                }
            }
        }
        Ok(out)
    }
}

/// Adds the force along a direction, term by term.
fn add_tail(direction: &[(usize, f64)], force: &[c64], n: usize, out: &mut [c64]) {
    for (force, out) in force.iter().zip(out.chunks_exact_mut(n)) {
        for &(i, w) in direction {
            out[i] += w * force;
        }
    }
}

impl Curve for Problem {
    fn size(&self) -> usize {
        self.n * self.basis.n_coefficients()
    }

    fn linearise(&mut self, y: &[f64], parameter: f64, out: &mut Linearisation) -> Result<()> {
        self.set_parameter(parameter)?;
        self.run(y, out, Want::Jacobian)?;
        if self.parameter == Parameter::Family {
            self.family_slope(y, out)?;
        }
        Ok(())
    }

    fn row_excess(&mut self, y: &[f64], parameter: f64, tolerance: f64) -> Result<f64> {
        self.set_parameter(parameter)?;
        let mut out = Linearisation::without_jacobian(y.len());
        self.run(y, &mut out, Want::Force)?;
        let sizes = rows::sizes(self, y, &self.entry_sizes(|linear, w, out| linear.sizes(w, out)));
        let excess = |(r, size): (&f64, &rows::Size)| {
            let allowed = tolerance * size.terms + ROW_ROUNDING * f64::EPSILON * size.rounding;
            if *r == 0.0 { 0.0 } else { r.abs() / allowed }
        };
        Ok(nan_or_largest(out.residual.iter().zip(&sizes).map(excess)))
    }

    fn scale(&self, y: &[f64], out: &mut [f64]) {
        self.scales(y, out);
    }
}

#[cfg(test)]
mod tests {
    use super::super::family::Family;
    use super::super::linear::Full;
    use super::*;
    use crate::force::AnyLaw;
    use crate::periodic::element::Force;
    use std::sync::Arc;

    struct Springs;

    impl Family for Springs {
        fn member(&self, value: f64) -> Result<Member> {
            let other = two_masses(Parameter::Level);
            let mut elements = other.elements.clone();
            elements[0].force = Force::known(AnyLaw::from_code(0, 1).unwrap(), vec![0.5 * value]);
            let linear = Full {
                n: 2,
                m: vec![1.0, 0.1, 0.1, 2.0],
                c: vec![0.1, -0.3, 0.4, 0.05],
                k: vec![2.0 * value, -1.0, -0.8, 3.0],
                forces: Arc::new(Vec::new()),
            };
            Ok(Member { linear: Box::new(linear), elements })
        }
    }

    fn two_masses(parameter: Parameter) -> Problem {
        let force = |a: f64, b: f64| Some(vec![c64::new(a, b), c64::new(b, 0.0)]);
        let forces = vec![Some(vec![c64::new(0.2, 0.0), c64::new(0.0, 0.0)]), force(1.0, 0.4), None, force(0.1, 0.0)];
        let linear = Full {
            n: 2,
            m: vec![1.0, 0.1, 0.1, 2.0],
            c: vec![0.1, -0.3, 0.4, 0.05],
            k: vec![2.0, -1.0, -0.8, 3.0],
            forces: Arc::new(forces),
        };
        let element = |code, params: &[f64], direction: &[(usize, f64)]| Element {
            force: Force::known(AnyLaw::from_code(code, params.len()).unwrap(), params.to_vec()),
            directions: vec![direction.to_vec()],
        };
        let elements = vec![
            element(0, &[0.5], &[(0, 1.0), (1, -1.0)]),
            element(8, &[0.3], &[(1, 2.0)]),
            element(9, &[0.7, 0.2], &[(0, 1.0)]),
        ];
        let basis = Basis::periodic(&[1, 2, 3], 1);
        let mut problem = Problem::new(basis, Box::new(linear), elements, vec![1.1], &[64]).unwrap();
        problem.parameter = parameter;
        problem
    }

    #[test]
    fn jacobian_is_the_slope_of_the_residual() {
        for parameter in [Parameter::Omega(0), Parameter::Scale, Parameter::Level, Parameter::Ramp, Parameter::Family] {
            let mut problem = two_masses(parameter);
            problem.family = Some(Placed { family: Arc::new(Springs), value: 0.0, step: 1e-5 });
            let n = problem.size();
            let y: Vec<f64> = (0..n).map(|i| ((2 * i + 1) as f64).sin()).collect();
            let mut out = Linearisation::new(n);
            problem.linearise(&y, 1.1, &mut out).unwrap();
            let h = 1e-6;
            let (mut high, mut low) = (Linearisation::new(n), Linearisation::new(n));
            for c in 0..=n {
                let (mut up, mut down, mut p) = (y.clone(), y.clone(), 0.0);
                if c < n {
                    up[c] += h;
                    down[c] -= h;
                } else {
                    p = h;
                }
                problem.linearise(&up, 1.1 + p, &mut high).unwrap();
                problem.linearise(&down, 1.1 - p, &mut low).unwrap();
                for r in 0..n {
                    let difference = (high.residual[r] - low.residual[r]) / (2.0 * h);
                    let exact = if c < n { out.jacobian[(r, c)] } else { out.slope[r] };
                    assert!((difference - exact).abs() < 1e-7, "{parameter:?} {r} {c} {difference} {exact}");
                }
            }
        }
    }
}
