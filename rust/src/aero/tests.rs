use std::f64::consts::PI;

use super::filaments::{Core, Filaments, velocities};
use crate::run::Cancel;

const CORES: [Core; 5] =
    [Core::RosenheadMoore, Core::LambOseen, Core::Vatistas(1.0), Core::Vatistas(2.0), Core::Vatistas(3.7)];

/// A generator of numbers between -1 and 1.
struct Dice(u64);

impl Dice {
    fn roll(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }
    fn vector(&mut self) -> [f64; 3] {
        std::array::from_fn(|_| self.roll())
    }
}

fn at(core: Core, start: [f64; 3], end: [f64; 3], radius: f64, point: [f64; 3]) -> [f64; 3] {
    let f = Filaments { start: &[start], end: &[end], circulation: &[1.7], core_radius: &[radius] };
    velocities(&f, core, &[point], 1, &Cancel::default()).unwrap()[0]
}

fn norm(a: [f64; 3]) -> f64 {
    a.iter().map(|x| x * x).sum::<f64>().sqrt()
}

#[test]
fn a_filament_without_core_follows_the_law_of_the_two_angles() {
    // v = Gamma (cos b1 - cos b2) / (4 pi h) beside the z axis, from z = -0.7 to 1.9, also very near and far
    for core in CORES {
        for (h, z) in [(0.31, 0.4), (1e-9, 0.4), (2e-7, 3.1), (170.0, -2.3)] {
            let v = at(core, [0.0, 0.0, -0.7], [0.0, 0.0, 1.9], 0.0, [h, 0.0, z]);
            let angle = |end: f64| h / ((z - end).powi(2) + h * h).sqrt();
            let (a, b) = ((z + 0.7) / h * angle(-0.7), (z - 1.9) / h * angle(1.9));
            // the difference of cosines beyond the end, without its cancellation
            let difference = if z > 1.9 { (angle(-0.7).powi(2) - angle(1.9).powi(2)) / -(a + b) } else { a - b };
            let truth = 1.7 * difference / (4.0 * PI * h);
            assert!(v[0].abs() < 1e-15 && v[2].abs() < 1e-15);
            assert!((v[1] - truth).abs() < 1e-12 * truth.abs(), "{core:?} {h} {z}: {} {truth}", v[1]);
        }
    }
}

#[test]
fn cores_turn_as_their_profiles_say() {
    // a filament so long that it is infinite: 2 pi h v / Gamma = K(h)
    for (core, k) in [
        (Core::RosenheadMoore, Box::new(|s: f64| s * s / (s * s + 1.0)) as Box<dyn Fn(f64) -> f64>),
        (Core::LambOseen, Box::new(|s: f64| 1.0 - (-1.256_431_208_626_17 * s * s).exp())),
        (Core::Vatistas(1.0), Box::new(|s: f64| s * s / (s * s + 1.0))),
        (Core::Vatistas(2.0), Box::new(|s: f64| s * s / (s.powi(4) + 1.0).sqrt())),
        (Core::Vatistas(3.7), Box::new(|s: f64| s * s / (s.powf(7.4) + 1.0).powf(1.0 / 3.7))),
    ] {
        for s in [0.03, 0.4, 1.0, 2.7] {
            let v = at(core, [0.0, 0.0, -3e5], [0.0, 0.0, 3e5], 0.13, [0.13 * s, 0.0, 0.0]);
            let truth = 1.7 * k(s) / (2.0 * PI * 0.13 * s);
            assert!((v[1] / truth - 1.0).abs() < 1e-9, "{core:?} at {s}: {} {truth}", v[1]);
        }
        assert_eq!(at(core, [0.0, 0.0, -1.0], [0.0, 0.0, 1.0], 0.13, [0.0, 0.0, 0.2]), [0.0; 3]);
    }
}

#[test]
fn parts_of_a_filament_add_up_and_ends_are_finite() {
    let mut dice = Dice(7);
    for core in CORES {
        for _ in 0..200 {
            let (a, b, p) = (dice.vector(), dice.vector(), dice.vector());
            let radius = 0.1 * dice.roll().abs();
            let split = 0.5 + 0.4 * dice.roll();
            let middle: [f64; 3] = std::array::from_fn(|k| a[k] + split * (b[k] - a[k]));
            let whole = at(core, a, b, radius, p);
            let (one, two) = (at(core, a, middle, radius, p), at(core, middle, b, radius, p));
            for k in 0..3 {
                assert!((whole[k] - one[k] - two[k]).abs() < 1e-11 * (norm(one) + norm(two)));
            }
            for end in [a, b] {
                assert!(at(core, a, b, 0.0, end).iter().all(|x| x.is_finite()));
            }
        }
    }
}

#[test]
fn bits_do_not_depend_on_threads_or_neighbours() {
    let mut dice = Dice(11);
    let n = 137;
    let start: Vec<_> = (0..n).map(|_| dice.vector()).collect();
    let end: Vec<_> = (0..n).map(|_| dice.vector()).collect();
    let circulation: Vec<_> = (0..n).map(|_| dice.roll()).collect();
    let core_radius: Vec<_> = (0..n).map(|_| 0.1 * dice.roll().abs()).collect();
    let points: Vec<_> = (0..91).map(|_| dice.vector()).collect();
    let f = Filaments { start: &start, end: &end, circulation: &circulation, core_radius: &core_radius };
    for core in CORES {
        let one = velocities(&f, core, &points, 1, &Cancel::default()).unwrap();
        for threads in [0, 2, 3, 5, 64] {
            assert_eq!(velocities(&f, core, &points, threads, &Cancel::default()).unwrap(), one);
        }
        for (p, v) in points.iter().zip(&one) {
            assert_eq!(velocities(&f, core, &[*p], 1, &Cancel::default()).unwrap(), [*v]);
        }
    }
}

#[test]
fn a_closed_loop_decays_as_a_dipole() {
    // a square of side 2: v = Gamma A / (2 pi d^3) on its axis far away
    let corners = [[1.0, 1.0, 0.0], [-1.0, 1.0, 0.0], [-1.0, -1.0, 0.0], [1.0, -1.0, 0.0]];
    let end: Vec<_> = (0..4).map(|i| corners[(i + 1) % 4]).collect();
    let f = Filaments { start: &corners, end: &end, circulation: &[0.7; 4], core_radius: &[0.01; 4] };
    for core in CORES {
        for d in [2.0e2, 3.0e3] {
            let v = velocities(&f, core, &[[0.0, 0.0, d]], 1, &Cancel::default()).unwrap()[0];
            assert!((v[2] / (0.7 * 4.0 / (2.0 * PI * d.powi(3))) - 1.0).abs() < 4.0 / (d * d), "{core:?}: {v:?}");
        }
    }
}

#[test]
fn what_cannot_be_is_refused_and_ctrl_c_stops() {
    let f = Filaments { start: &[[0.0; 3]], end: &[], circulation: &[1.0], core_radius: &[0.0] };
    assert!(velocities(&f, Core::LambOseen, &[[1.0; 3]], 1, &Cancel::default()).is_err());
    let f = Filaments { start: &[[0.0; 3]], end: &[[1.0; 3]], circulation: &[1.0], core_radius: &[0.0] };
    assert!(velocities(&f, Core::Vatistas(0.5), &[[1.0; 3]], 1, &Cancel::default()).is_err());
    let cancel = Cancel::default();
    cancel.stop();
    assert!(velocities(&f, Core::LambOseen, &[[1.0; 3]; 100], 2, &cancel).is_err());
}
