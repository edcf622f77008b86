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
