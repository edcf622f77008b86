//! Wall times of the core through its Rust API: `cargo bench`. What they mean stands in benches/README.md.
// the tests use the models that no bench needs
#[allow(dead_code)]
#[path = "../tests/models.rs"]
mod models;

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use faer::Mat;
use mbrs::{
    Cancel, Counts, Effects, LinearSystem, Linearization, Matrices, Ports, Result, SecondOrder, Setting, System,
    Tables, assemble, linearize, modes,
};
use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64;

fn dense(m: &nalgebra::DMatrix<f64>) -> Mat<f64> {
    Mat::from_fn(m.nrows(), m.ncols(), |i, j| m[(i, j)])
}

fn linearized(system: &System) -> Result<Linearization> {
    let mut counts = Counts::default();
    let state = assemble(system, true, Effects::ALL, &mut counts)?.state;
    let effects = Effects::ALL;
    let setting = Setting { system, state: &state, memory: &[], acceleration: &[], effects };
    linearize(&setting, &mut counts)
}

fn second_order(lin: &Linearization) -> Result<SecondOrder> {
    let m = &lin.matrices;
    let c = m.damping.as_ref().map(dense);
    SecondOrder::new(dense(&m.mass), c, None, dense(&m.stiffness), None)
}

/// From numbers to modes.
fn through(system: &System) -> Result<usize> {
    Ok(modes(&second_order(&linearized(system)?)?)?.s.len())
}

fn models(c: &mut Criterion) -> Result<()> {
    let named: [(&str, Tables); 3] = [
        ("hexapod", models::cubic_hexapod(0.2, 1e5, 30.0, 20.0, 0.15)),
        ("four-bar", models::hanging_four_bar()),
        ("chain 200", models::chain(200)),
    ];
    for (name, tables) in named {
        let system = System::new(tables.clone())?;
        let x = system.x.to_vec();
        c.bench_function(&format!("{name}: compile"), |b| {
            b.iter(|| System::new(black_box(tables.clone())));
        });
        c.bench_function(&format!("{name}: linearise"), |b| {
            b.iter(|| linearized(black_box(&system)));
        });
        if system.n_tree() < 50 {
            c.bench_function(&format!("{name}: new values to modes"), |b| {
                b.iter(|| through(&system.with_values(black_box(x.clone()))?));
            });
        }
    }
    Ok(())
}

/// Random positive definite matrices with the given share of each kind of term.
fn random(n: usize, damped: bool, gyroscopic: bool) -> Result<SecondOrder> {
    let mut rng = Pcg64::seed_from_u64(n as u64);
    let mut any = || Mat::from_fn(n, n, |_, _| rng.random_range(-1.0..1.0));
    let positive = |a: &Mat<f64>, shift: f64| {
        let p = a * a.transpose();
        Mat::from_fn(n, n, |i, j| 0.5 * (p[(i, j)] + p[(j, i)]) + if i == j { shift } else { 0.0 })
    };
    let (a, b, d, g) = (any(), any(), any(), any());
    let skew = Mat::from_fn(n, n, |i, j| g[(i, j)] - g[(j, i)]);
    SecondOrder::new(
        positive(&a, n as f64),
        damped.then(|| positive(&d, 0.1)),
        gyroscopic.then_some(skew),
        positive(&b, 1.0),
        None,
    )
}

fn eigen_routes(c: &mut Criterion) -> Result<()> {
    for (name, damped, gyroscopic) in [("undamped", false, false), ("damped", true, false), ("gyroscopic", false, true)]
    {
        let system = random(60, damped, gyroscopic)?;
        c.bench_function(&format!("60 degrees of freedom: {name} modes"), |b| {
            b.iter(|| modes(black_box(&system)));
        });
    }
    let proportional = second_order(&linearized(&System::new(models::chain(200))?)?)?;
    let mut group = c.benchmark_group("chain 200");
    group.sample_size(10);
    group.bench_function("proportional modes", |b| {
        b.iter(|| modes(black_box(&proportional)));
    });
    group.finish();
    Ok(())
}

fn transfer_functions(c: &mut Criterion) -> Result<()> {
    let n = 150;
    let system = random(n, true, false)?;
    let matrices = Matrices { m: system.m, c: system.c, g: system.g, k: system.k, n: system.n };
    let l = Mat::from_fn(6, n, |i, j| f64::from(u8::from(j == 20 * i)));
    let ports = Ports { f: l.transpose().to_owned(), l, order_in: vec![0; 6], order_out: 0, d0: None };
    let omega: Vec<f64> = (0..400).map(|i| 0.01 * f64::from(i)).collect();
    let mut group = c.benchmark_group("300 states, 6 x 6 x 400");
    group.sample_size(10);
    group.bench_function("reduce and evaluate", |b| {
        b.iter(|| LinearSystem::new(matrices.clone())?.evaluate(&ports, &omega, None, true, &Cancel::default()));
    });
    group.finish();
    Ok(())
}

/// A bench that cannot set up its models has nothing to measure.
fn checked(work: fn(&mut Criterion) -> Result<()>, c: &mut Criterion) {
    if let Err(problem) = work(c) {
        panic!("{problem}");
    }
}

fn all(c: &mut Criterion) {
    checked(models, c);
    checked(eigen_routes, c);
    checked(transfer_functions, c);
}

criterion_group!(benches, all);
criterion_main!(benches);
