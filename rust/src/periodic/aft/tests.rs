//! Jacobians against differences.
use std::sync::Arc;

use super::*;
use crate::periodic::element::Sampled;

fn check(code: i64, p: &[f64], basis: &Basis, dims: &[usize], omega: &[f64], tolerance: f64) {
    let law = AnyLaw::from_code(code, p.len()).unwrap();
    let n_c = basis.n_coefficients();
    let u: Vec<f64> = (0..n_c).map(|i| ((3 * i + 1) as f64).sin() / (1.0 + 0.3 * i as f64)).collect();
    let slope = basis.slope(0);
    let mut aft = Aft::new(basis, dims, true);
    let known = Force::known(law, p.to_vec());
    aft.element(&known, &u, &basis.frequencies(omega), &slope, Want::Jacobian).unwrap();
    let (jacobian, force_slope) = (aft.jacobian.clone(), aft.force_slope.clone());
    let h = 1e-6;
    let mut force = |u: &[f64], omega: &[f64]| {
        aft.element(&known, u, &basis.frequencies(omega), &slope, Want::Force).unwrap();
        aft.force.clone()
    };
    for c in 0..=n_c {
        let (mut high, mut low) = (u.clone(), u.clone());
        let (mut fast, mut slow) = (omega.to_vec(), omega.to_vec());
        if c < n_c {
            high[c] += h;
            low[c] -= h;
        } else {
            fast[0] += h;
            slow[0] -= h;
        }
        let (high, low) = (force(&high, &fast), force(&low, &slow));
        for row in 0..n_c {
            let difference = (high[row] - low[row]) / (2.0 * h);
            let exact = if c < n_c { jacobian[row * n_c + c] } else { force_slope[row] };
            assert!((difference - exact).abs() < tolerance, "{law:?} row {row} column {c}: {difference} {exact}");
        }
    }
}

#[test]
fn jacobian_of_periodic_motion() {
    let basis = Basis::periodic(&[1, 2, 3], 1);
    check(0, &[0.7], &basis, &[13], &[1.3], 1e-8);
    check(0, &[0.7], &basis, &[8], &[1.3], 1e-8); // aliased: still the derivative of what is computed
    check(8, &[0.7], &basis, &[16], &[1.3], 1e-8);
    check(5, &[0.7, 0.5], &basis, &[64], &[1.3], 1e-7);
    check(3, &[3.0, 0.1, 0.0], &basis, &[64], &[1.3], 1e-5);
    check(11, &[3.0, 2.0, 0.3], &basis, &[16], &[1.3], 1e-8);
    check(8, &[0.7], &Basis::periodic(&[1, 3, 4], 3), &[32], &[1.3], 1e-8);
}

#[test]
fn jacobian_of_laws_with_memory() {
    let basis = Basis::periodic(&[1, 2, 3], 1);
    check(9, &[2.0, 0.4], &basis, &[64], &[1.3], 1e-7);
    check(9, &[2.0, 1e3], &basis, &[64], &[1.3], 1e-7);
    check(10, &[2.0, 0.4, 1.0, 1.2], &basis, &[64], &[1.3], 1e-7);
    check(12, &[2.0, 0.4, 1.0, 1.2], &basis, &[64], &[1.3], 1e-8);
    check(13, &[3.0, 0.1, 4.0, 1.5, 1.7], &basis, &[64], &[1.3], 1e-6);
    check(14, &[1.0, 1.5, 0.5, 3.0, 0.6, 0.4], &basis, &[64], &[1.3], 1e-6);
    check(12, &[2.0, 0.4], &Basis::periodic(&[1, 3, 4], 3), &[32], &[1.3], 1e-8);
}

#[test]
fn jacobian_of_quasi_periodic_motion() {
    let indices = vec![vec![0, 1], vec![1, -1], vec![1, 0], vec![0, 2], vec![2, 0], vec![1, 1]];
    let basis = Basis { indices, subharmonic: 1.0 };
    check(0, &[0.7], &basis, &[9, 10], &[1.3, 0.8], 1e-8);
    check(8, &[0.7], &basis, &[9, 12], &[1.3, 0.8], 1e-8);
}

/// F = (a u0 u1^2 + b v1, c u0^2 u1 + d u1 v0), whose blocks are not symmetric.
struct Joined;

impl Sampled for Joined {
    fn coordinates(&self) -> usize {
        2
    }

    fn evaluate(&self, u: &[f64], v: &[f64], f: &mut [f64], f_u: &mut [f64], f_v: &mut [f64]) -> Result<()> {
        let (a, b, c, d) = (0.7, 0.31, -0.4, 0.23);
        let n = u.len() / 2;
        for i in 0..n {
            let (x, y, vx, vy) = (u[i], u[n + i], v[i], v[n + i]);
            (f[i], f[n + i]) = (a * x * y * y + b * vy, c * x * x * y + d * y * vx);
            (f_u[i], f_u[n + i]) = (a * y * y, 2.0 * a * x * y);
            (f_u[2 * n + i], f_u[3 * n + i]) = (2.0 * c * x * y, c * x * x + d * vx);
            (f_v[i], f_v[n + i], f_v[2 * n + i], f_v[3 * n + i]) = (0.0, b, d * y, 0.0);
        }
        Ok(())
    }
}

#[test]
fn jacobian_of_a_law_of_two_coordinates() {
    let (n_c, h) = (7, 1e-6);
    let basis = Basis::periodic(&[1, 2, 3], 1);
    let u: Vec<f64> = (0..2 * n_c).map(|i| ((3 * i + 1) as f64).sin() / (1.0 + 0.3 * i as f64)).collect();
    let law = Force::Sampled(Arc::new(Joined));
    let mut aft = Aft::new(&basis, &[32], false);
    let mut made = |u: &[f64], omega: f64, want: Want| {
        aft.element(&law, u, &basis.frequencies(&[omega]), &basis.slope(0), want).unwrap();
        (aft.force.clone(), aft.jacobian.clone(), aft.force_slope.clone())
    };
    let (_, jacobian, force_slope) = made(&u, 1.3, Want::Jacobian);
    for c in 0..=2 * n_c {
        let moved = |by: f64| {
            let mut moved = u.clone();
            moved.iter_mut().skip(c).take(1).for_each(|x| *x += by);
            (moved, if c == 2 * n_c { 1.3 + by } else { 1.3 })
        };
        let (high, low) = (moved(h), moved(-h));
        let (high, low) = (made(&high.0, high.1, Want::Force).0, made(&low.0, low.1, Want::Force).0);
        for row in 0..2 * n_c {
            let difference = (high[row] - low[row]) / (2.0 * h);
            let at = |c: usize| (2 * (row / n_c) + c / n_c) * n_c * n_c + (row % n_c) * n_c + c % n_c;
            let exact = if c < 2 * n_c { jacobian[at(c)] } else { force_slope[row] };
            assert!((difference - exact).abs() < 1e-8, "row {row} column {c}: {difference} {exact}");
        }
    }
}
