use faer::{Mat, mat};

use super::{Kind, modes};
use crate::second_order::SecondOrder;

fn system(m: Mat<f64>, c: Option<Mat<f64>>, k: Mat<f64>) -> SecondOrder {
    SecondOrder::new(m, c, None, k, None).unwrap()
}

#[test]
fn one_degree_of_freedom() {
    let r = modes(&system(mat![[2.0]], Some(mat![[0.4]]), mat![[8.0]])).unwrap();
    assert_eq!(r.route, "proportional");
    assert!((r.s[0].re + 0.1).abs() < 1e-15);
    assert!((r.s[0].im - (4.0f64 - 0.01).sqrt()).abs() < 1e-15);
    assert!((r.shape[(0, 0)].re - 0.5f64.sqrt()).abs() < 1e-15);
}

#[test]
fn general_damping_takes_the_state_matrix() {
    let k = mat![[3.0, -1.0], [-1.0, 2.0]];
    let c = mat![[0.3, 0.0], [0.0, 0.0]];
    let r = modes(&system(Mat::identity(2, 2), Some(c), k)).unwrap();
    assert_eq!(r.route, "general damping");
    assert_eq!(r.counts.0.get("general eigensolutions"), Some(&1));
    assert!(r.kind.iter().all(|k| *k == Kind::Vibration));
    let trace: f64 = r.s.iter().map(|s| 2.0 * s.re).sum();
    assert!((trace + 0.3).abs() < 1e-14);
    assert!(r.backward_error.iter().all(|e| *e < 1e-15));
}

#[test]
fn free_body_on_a_damper_is_rigid_with_a_real_partner() {
    let k = mat![[1.0, -1.0], [-1.0, 1.0]];
    let c = mat![[0.5, 0.0], [0.0, 0.0]];
    let r = modes(&system(Mat::identity(2, 2), Some(c), k)).unwrap();
    assert_eq!(r.kind[0], Kind::Rigid);
    assert_eq!(r.s[0].norm(), 0.0);
    assert!(r.partner[0].re < 0.0);
    let total: f64 = r.s.iter().chain(&r.partner).map(|s| s.re).sum();
    assert!((total + 0.5).abs() < 1e-14);
}

/// A chain of unequal masses with a damper on every fifth spring.
fn damped_chain(n: usize, damper: f64) -> SecondOrder {
    let mass = |i: usize| 1.3 + 0.7 * (1.7 * i as f64).sin();
    let spring = |i: usize| 370.0 + 140.0 * (2.3 * i as f64).cos();
    let damping = |i: usize| if i % 5 == 2 { damper } else { 0.0 };
    let rows = |size: &dyn Fn(usize) -> f64| {
        Mat::from_fn(n, n, |i, j| match i.abs_diff(j) {
            0 => size(i) + size(i + 1),
            1 => -size(i.max(j)),
            _ => 0.0,
        })
    };
    let m = Mat::from_fn(n, n, |i, j| if i == j { mass(i) } else { 0.0 });
    system(m, Some(rows(&damping)), rows(&spring))
}

#[test]
fn light_damping_takes_no_state_matrix() {
    let work = |damper: f64| {
        let counts = modes(&damped_chain(60, damper)).unwrap().counts.0;
        ["general eigensolutions", "corrections of modes"].map(|what| counts.contains_key(what))
    };
    assert_eq!([work(0.05), work(0.9)], [[false, true]; 2]);
    assert_eq!(work(10.0), [true, false]); // no pass is made in vain
}

#[test]
fn the_roots_of_light_damping_have_the_sum_of_the_damping() {
    let chain = damped_chain(60, 0.9);
    let r = modes(&chain).unwrap();
    let trace: f64 = r.s.iter().map(|s| -2.0 * s.re).sum();
    let exact: f64 = (0..60).map(|i| chain.c.as_ref().unwrap()[(i, i)] / chain.m[(i, i)]).sum();
    assert!((trace - exact).abs() < 1e-12 * exact, "{trace} {exact}");
    assert!(r.backward_error.iter().all(|e| *e < 1e-14));
}
