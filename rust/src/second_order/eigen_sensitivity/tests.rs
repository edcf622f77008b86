use faer::Mat;

use super::{Directions, Known, Slices, eigen_sensitivity};
use crate::second_order::SecondOrder;
use crate::second_order::modal::modes;

#[test]
fn one_degree_of_freedom_in_closed_form() {
    let one = |v: f64| Mat::from_fn(1, 1, |_, _| v);
    let system = SecondOrder::new(one(2.0), Some(one(0.4)), None, one(8.0), None).unwrap();
    let r = modes(&system).unwrap();
    let known = Known {
        s: r.s.clone(),
        x: r.shape.clone(),
        y: None,
        rigid: vec![false],
        near_defective: vec![false],
        groups: Vec::new(),
    };
    let slice = |p: i64| Slices::new(&[0], &[0], &[p], &[1.0], 1, 3).unwrap();
    let directions = Directions::new(slice(0), slice(1), slice(2), 3);
    let ds = eigen_sensitivity(&system, &known, &directions).unwrap().eigenvalue;
    // s = (-c + i r)/(2 m), r = sqrt(4 k m - c^2)
    let r = (4.0f64 * 8.0 * 2.0 - 0.16).sqrt();
    assert!((ds[(0, 2)].im - 1.0 / r).abs() < 1e-15 && ds[(0, 2)].re.abs() < 1e-15);
    assert!((ds[(0, 1)].re + 0.25).abs() < 1e-15);
    assert!((ds[(0, 0)].re - 0.4 / 8.0).abs() < 1e-15);
}
