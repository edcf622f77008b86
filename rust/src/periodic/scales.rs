//! Sizes of coordinates of different units beside each other: lengths beside angles.
use super::problem::Problem;
use crate::tolerances::periodic::LEAST_SCALE;

impl Problem {
    /// Per coordinate the root of its own dynamic stiffness in the constant term or the first: lengths beside angles, times these, are
    /// roots of energies, whatever their units.
    pub fn weights(&self) -> Vec<f64> {
        let n = self.n();
        let stiffness = |i: usize| {
            let first = self.blocks().iter().take(2);
            first.map(|b| b.s[i * n + i].norm()).fold(0.0, f64::max)
        };
        let weight = |k: f64| if k > 0.0 && k.is_finite() { k.sqrt() } else { 1.0 };
        (0..n).map(|i| weight(stiffness(i))).collect()
    }

    /// Per coordinate the largest of its coefficients, kept from vanishing beside the other coordinates.
    pub fn scales(&self, y: &[f64], out: &mut [f64]) {
        let n = self.n();
        let weights = self.weights();
        let largest = |i: usize| y.iter().skip(i).step_by(n).fold(0.0_f64, |a, b| a.max(b.abs()));
        let own: Vec<f64> = (0..n).map(largest).collect();
        let overall = own.iter().zip(&weights).fold(0.0_f64, |a, (x, w)| a.max(x * w));
        for i in 0..n {
            let size = own[i].max(LEAST_SCALE * overall / weights[i]);
            out.iter_mut().skip(i).step_by(n).for_each(|d| *d = if size > 0.0 { size } else { 1.0 });
        }
    }
}
