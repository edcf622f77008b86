//! The residual of harmonic balance, R(y, p) = S y + sum_e W_e F_e(W_e^T y) - f, with dR/dy and dR/dp.
//!
//! Unknowns by harmonic: n constants, then per term n cosine and n sine coefficients of the retained coordinates.
use std::sync::Arc;

use faer::Mat;
use num_complex::Complex64 as c64;

use super::aft::{Aft, Want};
use super::basis::Basis;
use super::linear::{Block, DynamicStiffness};
use crate::error::Result;
use crate::laws::Law;
use crate::solve::{Curve, Linearisation};

/// A law on the relative displacement u = w . x.
#[derive(Debug, Clone)]
pub struct Element {
    pub law: Law,
    pub params: Vec<f64>,
    pub direction: Vec<(usize, f64)>,
}

/// What the continuation parameter is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Parameter {
    /// the base frequency with this number
    Omega(usize),
    /// factor on the forces; with or without the static ones
    Level { with_static: bool },
}

pub struct Problem {
    pub basis: Basis,
    pub linear: Box<dyn DynamicStiffness>,
    pub elements: Vec<Element>,
    /// per term (0 is the constant one) the complex force on all coordinates: f(t) = Re sum f_j exp(i phi_j)
    /// shared by problems on other terms, as long as the first terms are the same
    pub forces: Arc<Vec<Option<Vec<c64>>>>,
    pub omega: Vec<f64>,
    pub level: f64,
    pub parameter: Parameter,
    pub aft: Aft,
    n: usize,
    retained: Vec<Vec<(usize, f64)>>,
    blocks: Vec<Block>,
    blocks_at: Vec<f64>,
    coefficients: Vec<f64>,
    /// the first element whose force was not finite at the last evaluation
    pub broken: Option<usize>,
    pub evaluations: u64,
}

impl Problem {
    pub fn new(
        basis: Basis,
        linear: Box<dyn DynamicStiffness>,
        elements: Vec<Element>,
        forces: Arc<Vec<Option<Vec<c64>>>>,
        omega: Vec<f64>,
        dims: &[usize],
    ) -> Problem {
        let n = linear.size();
        let with_memory = elements.iter().any(|e| e.law.n_memory() > 0);
        let aft = Aft::new(&basis, dims, with_memory);
        Problem {
            retained: elements
                .iter()
                .map(|e| linear.retain(&e.direction))
                .collect(),
            blocks: vec![Block::new(n); basis.n_harmonics() + 1],
            blocks_at: Vec::new(),
            coefficients: vec![0.0; basis.n_coefficients()],
            n,
            aft,
            basis,
            linear,
            elements,
            forces,
            omega,
            level: 1.0,
            parameter: Parameter::Omega(0),
            broken: None,
            evaluations: 0,
        }
    }

    /// The same problem on other terms and another grid.
    pub fn on(&self, basis: Basis, dims: &[usize]) -> Problem {
        let (linear, elements, forces) = (
            self.linear.copied(),
            self.elements.clone(),
            self.forces.clone(),
        );
        let mut other = Problem::new(basis, linear, elements, forces, self.omega.clone(), dims);
        other.level = self.level;
        other.parameter = self.parameter;
        other
    }

    /// Retained coordinates.
    pub fn n(&self) -> usize {
        self.n
    }

    pub fn set_parameter(&mut self, value: f64) {
        match self.parameter {
            Parameter::Omega(i) => self.omega[i] = value,
            Parameter::Level { .. } => self.level = value,
        }
    }

    pub fn parameter_value(&self) -> f64 {
        match self.parameter {
            Parameter::Omega(i) => self.omega[i],
            Parameter::Level { .. } => self.level,
        }
    }

    /// d(term frequency)/d(parameter)
    fn frequency_slope(&self) -> Vec<f64> {
        match self.parameter {
            Parameter::Omega(i) => self.basis.slope(i),
            Parameter::Level { .. } => vec![0.0; self.basis.n_harmonics()],
        }
    }

    /// Factor on the force of a term and its derivative by the parameter.
    fn force_factor(&self, term: usize) -> (f64, f64) {
        match self.parameter {
            Parameter::Level { with_static } if term > 0 || with_static => (self.level, 1.0),
            _ if term > 0 => (self.level, 0.0),
            _ => (1.0, 0.0),
        }
    }

    /// The blocks depend on frequencies alone, and those often stay.
    fn update_blocks(&mut self) -> Result<()> {
        let mut frequencies = vec![0.0];
        frequencies.extend(self.basis.frequencies(&self.omega));
        if self.blocks_at != frequencies {
            for (j, w) in frequencies.iter().enumerate() {
                let force = self.forces.get(j).and_then(Option::as_deref);
                self.linear.evaluate(*w, force, &mut self.blocks[j])?;
            }
            self.blocks_at = frequencies;
        }
        Ok(())
    }

    fn add_linear(&self, y: &[f64], slope: &[f64], out: &mut Linearisation, want: Want) {
        let n = self.n;
        for (j, block) in self.blocks.iter().enumerate() {
            let (cos, sin) = ((2 * j).saturating_sub(1) * n, 2 * j * n);
            let rate = if j == 0 { 0.0 } else { slope[j - 1] };
            let (factor, factor_slope) = self.force_factor(j);
            for i in 0..n {
                let mut sum = -block.force[i] * factor;
                let mut sum_slope =
                    -block.force_slope[i] * (rate * factor) - block.force[i] * factor_slope;
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

    fn add_element(
        &mut self,
        e: usize,
        y: &[f64],
        frequency: &[f64],
        slope: &[f64],
        out: &mut Linearisation,
        want: Want,
    ) {
        let (n, n_c) = (self.n, self.basis.n_coefficients());
        let direction = &self.retained[e];
        for c in 0..n_c {
            self.coefficients[c] = direction.iter().map(|&(i, w)| w * y[c * n + i]).sum();
        }
        let element = &self.elements[e];
        self.aft.element(
            element.law,
            &element.params,
            &self.coefficients,
            frequency,
            slope,
            want,
        );
        if self.broken.is_none() && !self.aft.force.iter().all(|f| f.is_finite()) {
            self.broken = Some(e);
        }
        for &(i, wi) in direction {
            for row in 0..n_c {
                out.residual[row * n + i] += wi * self.aft.force[row];
            }
            if want == Want::Force {
                continue;
            }
            for row in 0..n_c {
                out.slope[row * n + i] += wi * self.aft.force_slope[row];
            }
            for &(l, wl) in direction {
                let w = wi * wl;
                for c in 0..n_c {
                    for row in 0..n_c {
                        out.jacobian[(row * n + i, c * n + l)] +=
                            w * self.aft.jacobian[row * n_c + c];
                    }
                }
            }
        }
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
        for e in 0..self.elements.len() {
            self.add_element(e, y, &frequency, &slope, out, want);
        }
        Ok(())
    }

    /// Coefficients of all coordinates, full_size x n_c by rows.
    pub fn expand(&mut self, y: &[f64]) -> Result<Mat<f64>> {
        let (n, n_full) = (self.n, self.linear.full_size());
        let mut out = Mat::zeros(n_full, self.basis.n_coefficients());
        let mut frequencies = vec![0.0];
        frequencies.extend(self.basis.frequencies(&self.omega));
        let mut x = vec![c64::new(0.0, 0.0); n_full];
        for (j, w) in frequencies.iter().enumerate() {
            let (cos, sin) = ((2 * j).saturating_sub(1), 2 * j);
            let part =
                |i: usize| c64::new(y[cos * n + i], if j == 0 { 0.0 } else { -y[sin * n + i] });
            let retained: Vec<c64> = (0..n).map(part).collect();
            let factor = self.force_factor(j).0;
            let force: Option<Vec<c64>> = self
                .forces
                .get(j)
                .and_then(Option::as_ref)
                .map(|f| f.iter().map(|f| f * factor).collect());
            self.linear
                .expand(*w, force.as_deref(), &retained, &mut x)?;
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

impl Curve for Problem {
    fn size(&self) -> usize {
        self.n * self.basis.n_coefficients()
    }

    fn linearise(&mut self, y: &[f64], parameter: f64, out: &mut Linearisation) -> Result<()> {
        self.set_parameter(parameter);
        self.run(y, out, Want::Jacobian)
    }

    fn residual(&mut self, y: &[f64], parameter: f64, out: &mut Linearisation) -> Result<()> {
        self.set_parameter(parameter);
        self.run(y, out, Want::Force)
    }

    /// Per coordinate the largest of its coefficients, kept from vanishing beside the other coordinates.
    fn scale(&self, y: &[f64], out: &mut [f64]) {
        let n = self.n;
        let overall = y.iter().fold(0.0_f64, |a, b| a.max(b.abs()));
        for i in 0..n {
            let own = y
                .iter()
                .skip(i)
                .step_by(n)
                .fold(0.0_f64, |a, b| a.max(b.abs()));
            let size = own.max(1e-6 * overall);
            out.iter_mut()
                .skip(i)
                .step_by(n)
                .for_each(|d| *d = if size > 0.0 { size } else { 1.0 });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::linear::Full;
    use super::*;

    fn two_masses(parameter: Parameter) -> Problem {
        let linear = Full {
            n: 2,
            m: vec![1.0, 0.1, 0.1, 2.0],
            c: vec![0.1, -0.3, 0.4, 0.05],
            k: vec![2.0, -1.0, -0.8, 3.0],
        };
        let element = |law, params: &[f64], direction: &[(usize, f64)]| Element {
            law,
            params: params.to_vec(),
            direction: direction.to_vec(),
        };
        let elements = vec![
            element(Law::Cubic, &[0.5], &[(0, 1.0), (1, -1.0)]),
            element(Law::VanDerPol, &[0.3], &[(1, 2.0)]),
            element(Law::Jenkins, &[0.7, 0.2], &[(0, 1.0)]),
        ];
        let force = |a: f64, b: f64| Some(vec![c64::new(a, b), c64::new(b, 0.0)]);
        let forces = vec![
            Some(vec![c64::new(0.2, 0.0), c64::new(0.0, 0.0)]),
            force(1.0, 0.4),
            None,
            force(0.1, 0.0),
        ];
        let basis = Basis::periodic(&[1, 2, 3], 1);
        let mut problem = Problem::new(
            basis,
            Box::new(linear),
            elements,
            Arc::new(forces),
            vec![1.1],
            &[64],
        );
        problem.parameter = parameter;
        problem
    }

    #[test]
    fn jacobian_is_the_slope_of_the_residual() {
        for parameter in [
            Parameter::Omega(0),
            Parameter::Level { with_static: false },
            Parameter::Level { with_static: true },
        ] {
            let mut problem = two_masses(parameter);
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
                problem.residual(&up, 1.1 + p, &mut high).unwrap();
                problem.residual(&down, 1.1 - p, &mut low).unwrap();
                for r in 0..n {
                    let difference = (high.residual[r] - low.residual[r]) / (2.0 * h);
                    let exact = if c < n {
                        out.jacobian[(r, c)]
                    } else {
                        out.slope[r]
                    };
                    assert!(
                        (difference - exact).abs() < 1e-7,
                        "{parameter:?} {r} {c} {difference} {exact}"
                    );
                }
            }
        }
    }
}
