//! Models written as Tables (docs/tables.md), for the integration tests and the benchmarks of the Rust API.
use mbrs::flag::{HAS_C, HAS_K};
use mbrs::{BodyRef, BodySpec, DRAWING_TOLERANCE, ElementKind, ElementSpec, JointKind, JointSpec, Tables};

const UPRIGHT: [f64; 4] = [1.0, 0.0, 0.0, 0.0];

/// Collects numbers and says where they start.
#[derive(Default)]
pub struct Builder(Tables);

impl Builder {
    pub fn gravity(mut self, g: [f64; 3]) -> Self {
        self.0.gravity = Some(self.put(&[&g]));
        self
    }

    fn put(&mut self, parts: &[&[f64]]) -> usize {
        let start = self.0.x.len();
        self.0.x.extend(parts.iter().copied().flatten());
        start
    }

    pub fn body(&mut self, mass: f64, inertia: [f64; 3], at: [f64; 3]) -> BodyRef {
        let x = self.put(&[&at, &UPRIGHT, &[0.0; 3], &[mass], &inertia, &[0.0; 9]]);
        let name = format!("body {}", self.0.bodies.len());
        self.0.bodies.push(BodySpec { name, x, tip: None });
        Some(self.0.bodies.len() - 1)
    }

    pub fn revolute_z(&mut self, a: BodyRef, b: BodyRef, at: [f64; 3]) {
        let numbers: [&[f64]; 6] = [&at, &at, &[0.0, 0.0, 1.0], &[0.0; 3], &UPRIGHT, &[0.0; 21]];
        let x = self.put(&numbers);
        self.0.joints.push(JointSpec {
            name: format!("joint {}", self.0.joints.len()),
            kind: JointKind::Revolute,
            a,
            b,
            flags: 0,
            x,
        });
    }

    pub fn spring(&mut self, a: BodyRef, b: BodyRef, at: [[f64; 3]; 2], k: f64, c: f64) {
        let x = self.put(&[&at[0], &at[1], &[k, c, 0.0, 0.0]]);
        self.element(ElementKind::SpringDamper, a, b, x);
    }

    pub fn bushing(&mut self, a: BodyRef, b: BodyRef, at: [f64; 3], k: [f64; 6], c: [f64; 6]) {
        let x = self.put(&[&at, &at, &UPRIGHT, &diagonal(k), &diagonal(c), &[0.0; 6]]);
        self.element(ElementKind::Bushing, a, b, x);
    }

    fn element(&mut self, kind: ElementKind, a: BodyRef, b: BodyRef, x: usize) {
        self.0.elements.push(ElementSpec {
            name: format!("element {}", self.0.elements.len()),
            kind,
            a,
            b,
            flags: HAS_K | HAS_C,
            x,
        });
    }

    pub fn tables(self) -> Tables {
        Tables { tolerance: DRAWING_TOLERANCE, ..self.0 }
    }
}

fn diagonal(values: [f64; 6]) -> [f64; 36] {
    ::core::array::from_fn(|i| if i % 7 == 0 { values[i / 7] } else { 0.0 })
}

/// The isolator of docs/theory.md (23.1): 15.9155 Hz three times, 18.3776 Hz twice, 36.7553 Hz.
pub fn cubic_hexapod(edge: f64, k: f64, c: f64, mass: f64, inertia: f64) -> Tables {
    let mut b = Builder::default();
    let payload = b.body(mass, [inertia; 3], [0.0; 3]);
    let corner = |signs: [f64; 3]| signs.map(|s| 0.5 * edge * s);
    // The six edges of a cube that touch neither of two opposite corners, (-1, -1, -1) and (1, 1, 1).
    for i in 0..3 {
        for j in [(i + 1) % 3, (i + 2) % 3] {
            let mut foot = [-1.0; 3];
            foot[i] = 1.0;
            let mut head = foot;
            head[j] = 1.0;
            b.spring(None, payload, [corner(foot), corner(head)], k, c);
        }
    }
    b.tables()
}

/// A uniform rod of 1 kg and 1 m that hangs from a hinge.
pub fn hanging_rod() -> Tables {
    let mut b = Builder::default().gravity([0.0, -9.81, 0.0]);
    let rod = b.body(1.0, [1.0 / 12.0, 1e-3, 1.0 / 12.0], [0.0, -0.5, 0.0]);
    b.revolute_z(None, rod, [0.0; 3]);
    b.tables()
}

/// Three such rods, two of them hanging side by side and joined below by the third: one loop, three redundant rows.
pub fn hanging_four_bar() -> Tables {
    let mut b = Builder::default().gravity([0.0, -9.81, 0.0]);
    let upright = [1.0 / 12.0, 1e-3, 1.0 / 12.0];
    let left = b.body(1.0, upright, [0.0, -0.5, 0.0]);
    let right = b.body(1.0, upright, [1.0, -0.5, 0.0]);
    let low = b.body(1.0, [1e-3, 1.0 / 12.0, 1.0 / 12.0], [0.5, -1.0, 0.0]);
    b.revolute_z(None, left, [0.0, 0.0, 0.0]);
    b.revolute_z(None, right, [1.0, 0.0, 0.0]);
    b.revolute_z(left, low, [0.0, -1.0, 0.0]);
    b.revolute_z(low, right, [1.0, -1.0, 0.0]);
    b.tables()
}

/// n hinged bodies in a row, 0.2 m each, with a six-component bushing at every hinge; invented data.
pub fn chain(n: usize) -> Tables {
    let mut b = Builder::default();
    let (mut before, reach) = (None, 0.2);
    for i in 0..n {
        let x = reach * i as f64;
        let body = b.body(1.0, [4e-3, 3e-3, 5e-3], [x + 0.5 * reach, 0.0, 0.0]);
        b.revolute_z(before, body, [x, 0.0, 0.0]);
        let k = [2e4, 2.5e4, 3e4, 40.0, 50.0, 60.0];
        b.bushing(before, body, [x, 0.0, 0.0], k, k.map(|k| 5e-4 * k));
        before = body;
    }
    b.tables()
}
