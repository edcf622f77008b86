//! M x = f on a tree in as many operations as there are bodies: the articulated-body recursion.
//!
//! From the tips, with the articulated inertia I of a body and the wrench p that right sides leave on it, each coordinate with its
//! column S takes its part away,
//! ```text
//! U = I S,  D = S.U,  u = f - S.p:        I -= U U^T/D,   p += U u/D        then both move to the parent
//! x = (u - U.a)/D,                        a += S x                          from the root
//! ```
//! R. Featherstone, Rigid Body Dynamics Algorithms, Springer 2008, section 7.3. Coordinates of one joint are those of joints in a row
//! between which there is no mass, so that no block of a joint is inverted. I = [A B; B^T C] maps twists to wrenches.
use crate::multibody::inertia_input::InertiaInput;
use crate::spatial::{M3, Pose, Six, V3, outer, skew};
use crate::tolerances::motion::ARTICULATED;

#[derive(Clone)]
struct Articulated {
    a: M3<f64>,
    b: M3<f64>,
    c: M3<f64>,
}

impl Articulated {
    fn apply(&self, v: &Six<f64>) -> Six<f64> {
        Six::new(self.a * v.l + self.b * v.a, self.b.tr_mul(&v.l) + self.c * v.a)
    }

    fn subtract(&mut self, u: &Six<f64>, d: f64) {
        let scaled = u.scaled(1.0 / d);
        self.a -= outer(&u.l, &scaled.l);
        self.b -= outer(&u.l, &scaled.a);
        self.c -= outer(&u.a, &scaled.a);
    }

    /// Add what another is about a point displaced by `d` from its own.
    fn add_at(&mut self, o: &Articulated, d: &V3<f64>) {
        let s = skew(d);
        let b = o.a * s + o.b;
        self.a += o.a;
        self.b += b;
        self.c += o.c + o.b.tr_mul(&s) - s * b;
    }
}

/// What a coordinate leaves for the way back.
struct Eliminated {
    u: Six<f64>,
    d: f64,
    left: f64,
}

/// x with M x = f; None where M is singular to rounding, or where bodies are flexible.
pub fn solve(input: &InertiaInput<'_, f64>, f: &[f64]) -> Option<Vec<f64>> {
    let topology = input.topology;
    if topology.is_flexible() {
        return None;
    }
    let (pose, column) = (&input.placement.pose, &input.placement.column);
    let mut whole = input.rigid_composites();
    let mut own: Vec<Articulated> =
        whole.iter().map(|c| Articulated { a: M3::from_diagonal_element(c.m), b: M3::zeros(), c: c.j }).collect();
    let mut wrench = vec![Six::zero(); own.len()];
    let mut kept: Vec<Option<Eliminated>> = f.iter().map(|_| None).collect();
    for (i, node) in topology.nodes.iter().enumerate().rev() {
        for k in (node.first..node.first + node.n).rev() {
            let s = &column[k];
            let u = own[i].apply(s);
            let d = s.dot(&u);
            // the diagonal of M: what D would be without the joints farther out
            if d.is_nan() || d <= ARTICULATED * s.dot(&whole[i].apply(s)) {
                return None;
            }
            let left = f[k] - s.dot(&wrench[i]);
            own[i].subtract(&u, d);
            wrench[i] += u.scaled(left / d);
            kept[k] = Some(Eliminated { u, d, left });
        }
        if let Some(parent) = node.parent {
            let way = to(&pose[i], &pose[parent]);
            let (before, after) = own.split_at_mut(i);
            before[parent].add_at(&after[0], &way);
            let moved = whole[i].at(&way);
            whole[parent].add(&moved);
            let moved = wrench[i].wrench_at(&way);
            wrench[parent] += moved;
        }
    }
    let mut x = vec![0.0; f.len()];
    let mut accelerations: Vec<Six<f64>> = Vec::with_capacity(own.len());
    for (i, node) in topology.nodes.iter().enumerate() {
        let carried = |p: usize| accelerations[p].motion_at(&to(&pose[p], &pose[i]));
        let mut a = node.parent.map_or_else(Six::zero, carried);
        for k in node.first..node.first + node.n {
            let Some(e) = &kept[k] else { return None };
            x[k] = (e.left - e.u.dot(&a)) / e.d;
            a += column[k].scaled(x[k]);
        }
        accelerations.push(a);
    }
    Some(x)
}

fn to(from: &Pose<f64>, there: &Pose<f64>) -> V3<f64> {
    there.p - from.p
}
