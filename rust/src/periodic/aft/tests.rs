//! Jacobians against differences.
use super::*;

fn check(code: i64, p: &[f64], basis: &Basis, dims: &[usize], omega: &[f64], tolerance: f64) {
    let law = AnyLaw::from_code(code, p.len()).unwrap();
    let n_c = basis.n_coefficients();
    let u: Vec<f64> = (0..n_c).map(|i| ((3 * i + 1) as f64).sin() / (1.0 + 0.3 * i as f64)).collect();
    let slope = basis.slope(0);
    let mut aft = Aft::new(basis, dims, true);
    let known = Force::Known(law, p.to_vec());
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
