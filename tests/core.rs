//! The public Rust API from Tables to modes and transfer functions, without Python.
mod models;

use std::f64::consts::TAU;

use faer::Mat;
use mbrs::{
    Cancel, Counts, Effects, Equilibrium, Error, Kind, LinearSystem, Linearization, Matrices, Ports, Result,
    SecondOrder, Setting, System, Tables, assemble, equilibrium, linearize, modes,
};

fn dense(m: &nalgebra::DMatrix<f64>) -> Mat<f64> {
    Mat::from_fn(m.nrows(), m.ncols(), |i, j| m[(i, j)])
}

/// Models without gyroscopic and circulatory terms, as all of these are.
fn second_order(lin: &Linearization) -> Result<SecondOrder> {
    let m = &lin.matrices;
    let c = m.damping.as_ref().map(dense);
    SecondOrder::new(dense(&m.mass), c, None, dense(&m.stiffness), None)
}

fn linearized(system: &System) -> Result<Linearization> {
    let mut counts = Counts::default();
    let state = assemble(system, true, Effects::ALL, &mut counts)?.state;
    let effects = Effects::ALL;
    let setting = Setting { system, state: &state, memory: &[], acceleration: &[], effects };
    linearize(&setting, &mut counts)
}

fn balanced(tables: Tables, cancel: &Cancel) -> Result<Equilibrium> {
    let system = System::new(tables)?;
    let mut counts = Counts::default();
    let state = assemble(&system, true, Effects::ALL, &mut counts)?.state;
    equilibrium(&system, &state, Effects::ALL, cancel, &mut counts)
}

fn frequencies(lin: &Linearization) -> Result<Vec<f64>> {
    let found = modes(&second_order(lin)?)?;
    Ok(found.s.iter().map(|s| s.norm() / TAU).collect())
}

#[test]
fn hexapod_has_its_closed_form() -> Result<()> {
    let (edge, k, c, mass, inertia) = (0.2_f64, 1e5, 30.0, 20.0, 0.15);
    let system = System::new(models::cubic_hexapod(edge, k, c, mass, inertia))?;
    let found = modes(&second_order(&linearized(&system)?)?)?;
    // K = diag(2k, 2k, 2k) for translations, and k L^2/2 twice, 2 k L^2 once for rotations.
    let tilt = k * edge.powi(2) / (2.0 * inertia);
    let squares = [2.0 * k / mass; 3].into_iter().chain([tilt, tilt, 4.0 * tilt]);
    let exact: Vec<f64> = squares.map(f64::sqrt).collect();
    let worst = (0..6).map(|i| (found.s[i].norm() / exact[i] - 1.0).abs()).fold(0.0, f64::max);
    println!("hexapod: {worst:.1e}, route {}", found.route);
    assert!(worst < 1e-12);
    assert_eq!(found.groups, [(0, 3), (3, 2)]);
    // c = (30/1e5) k in every leg, so zeta = c omega/(2 k)
    let zeta = -found.s[5].re / found.s[5].norm();
    assert!((zeta / (0.5 * c / k * exact[5]) - 1.0).abs() < 1e-10);
    Ok(())
}

#[test]
fn constraint_forces_stiffen_hanging_mechanisms() -> Result<()> {
    // sqrt(m g l/2 / (m l^2/3)) and sqrt(2 m g l / (5/3 m l^2))
    for (tables, square, digits) in
        [(models::hanging_rod(), 1.5 * 9.81, "0.610521"), (models::hanging_four_bar(), 1.2 * 9.81, "0.546066")]
    {
        let found = balanced(tables, &Cancel::default())?;
        let f = frequencies(&found.linearization)?;
        assert_eq!(f.len(), 1);
        assert_eq!(format!("{:.6}", f[0]), digits);
        assert!((f[0] * TAU / f64::sqrt(square) - 1.0).abs() < 1e-12);
        assert!(found.stable && found.residual < 1e-12);
    }
    Ok(())
}

#[test]
fn new_values_keep_the_topology() -> Result<()> {
    let system = System::new(models::chain(12))?;
    let mut x = system.x.to_vec();
    for element in &system.topology.tables.elements {
        // stiffness and damping by four: frequencies by two
        x[element.x + 10..element.x + 82].iter_mut().for_each(|v| *v *= 4.0);
    }
    let stiffer = system.with_values(x)?;
    assert!(std::sync::Arc::ptr_eq(&system.topology, &stiffer.topology));
    let (soft, hard) = (frequencies(&linearized(&system)?)?, frequencies(&linearized(&stiffer)?)?);
    assert_eq!(soft.len(), 12);
    for (a, b) in soft.iter().zip(&hard) {
        assert!((b / a - 2.0).abs() < 1e-9, "{a} {b}");
    }
    Ok(())
}

#[test]
fn receptance_of_the_hexapod_is_that_of_one_oscillator() -> Result<()> {
    let (k, c, mass) = (1e5, 30.0, 20.0);
    let system = System::new(models::cubic_hexapod(0.2, k, c, mass, 0.15))?;
    let lin = linearized(&system)?;
    let damping = lin.matrices.damping.as_ref().map(dense);
    let (mass_matrix, stiffness) = (dense(&lin.matrices.mass), dense(&lin.matrices.stiffness));
    let matrices = Matrices { m: mass_matrix, c: damping, g: None, k: stiffness, n: None };
    let l = Mat::from_fn(1, 6, |_, j| lin.body_map[(2, j)]);
    let ports = Ports { f: l.transpose().to_owned(), l, order_in: vec![0], order_out: 0, d0: None };
    let omega: Vec<f64> = (1..200).map(|i| f64::from(i) * TAU).collect();
    let values = LinearSystem::new(matrices)?.evaluate(&ports, &omega, None, true, &Cancel::default())?;
    for (w, h) in omega.iter().zip(&values.h) {
        let z = faer::c64::new(2.0 * k - w * w * mass, 2.0 * w * c);
        assert!((h * z - 1.0).norm() < 1e-10, "{w} {h}");
    }
    Ok(())
}

#[test]
fn a_free_body_has_six_rigid_modes() -> Result<()> {
    let mut b = models::Builder::default();
    b.body(2.0, [0.1, 0.2, 0.25], [1.0, 2.0, 3.0]);
    let found = modes(&second_order(&linearized(&System::new(b.tables())?)?)?)?;
    assert_eq!(found.kind, [Kind::Rigid; 6]);
    Ok(())
}

#[test]
fn wrong_tables_are_errors_and_no_panics() {
    let mut tables = models::chain(2);
    tables.x[0] = f64::NAN;
    assert!(matches!(System::new(tables), Err(Error::Model(text)) if text.contains("finite")));
    let mut tables = models::chain(2);
    tables.joints[1].b = Some(7);
    assert!(matches!(System::new(tables), Err(Error::Model(text)) if text.contains("joint 1")));
    let mut tables = models::chain(2);
    tables.elements[0].x = usize::MAX - 3;
    assert!(matches!(System::new(tables), Err(Error::Model(text)) if text.contains("element 0")));
}

#[test]
fn a_stopped_search_says_so() {
    let cancel = Cancel::default();
    cancel.stop();
    let stopped = balanced(models::hanging_four_bar(), &cancel);
    assert!(matches!(stopped, Err(Error::Interrupted)));
}
