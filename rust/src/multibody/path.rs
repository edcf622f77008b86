//! The way of a connector's forces and tangents to the tree coordinates.
//!
//! A connector is invariant under common rigid motion, so only the coordinates between its two bodies feel it. With the wrench W
//! on b about the fixed point where p_B is now, and its tangent dW = -sum g k (g . xi) + K xi + C xi', the tree coordinates i, j
//! on the path with signs s (+ on b's side, - on a's) and twists S at that point get
//! ```text
//! tau_i    = -s_i S_i . W
//! K_ij     = (s_i S_i . g) k (g . s_j S_j) - s_i S_i . K (s_j S_j)
//!            - s_i (S_j x S_i) . W   [j carries i]   - s_i S_i . (S_j x* W)   [j on a's side]
//! D_ij     = (s_i S_i . g) c (g . s_j S_j)
//! ```
use crate::linalg::entries::Entries;
use crate::model::tables::BodyRef;
use crate::multibody::connector::Interaction;
use crate::multibody::placement::Placement;
use crate::multibody::topology::Topology;
use crate::spatial::{Real, Six, V3, absent};

/// One tree coordinate on the way between two bodies.
#[derive(Debug, Clone, Copy)]
pub struct PathEntry<T: Real> {
    pub dof: usize,
    pub on_b: bool,
    pub s: Six<T>,
    node: usize,
    stage: usize,
    order: usize,
}

impl<T: Real> PathEntry<T> {
    /// The relative twist of b against a that this coordinate makes.
    pub fn signed(&self) -> Six<T> {
        if self.on_b { self.s } else { -self.s }
    }

    /// Does `other` carry this coordinate's axis?
    fn carried_by(&self, other: &Self) -> bool {
        self.on_b == other.on_b && other.order > self.order && (other.node != self.node || other.stage < self.stage)
    }
}

/// The coordinates that move b against a, each with its twist at `point`.
pub fn path<T: Real>(
    topology: &Topology,
    placement: &Placement<T>,
    a: BodyRef,
    b: BodyRef,
    point: &V3<T>,
) -> Vec<PathEntry<T>> {
    let mut entries = Vec::new();
    let (mut i, mut j) = (topology.node(a), topology.node(b));
    let depth = |node: Option<usize>| node.map_or(-1, |n| topology.nodes[n].depth as i64);
    while i != j {
        let on_b = depth(j) >= depth(i);
        let side = if on_b { &mut j } else { &mut i };
        let Some(node) = *side else { break };
        let spec = &topology.nodes[node];
        let arm = point - placement.pose[node].p;
        // outermost stage first, so that what carries an axis always comes later
        for stage in (0..spec.kind.stages()).rev() {
            for dof in (spec.first..spec.first + spec.n).filter(|d| topology.dofs[*d].freedom.stage == stage) {
                let order = entries.len();
                entries.push(PathEntry { dof, on_b, s: placement.column[dof].motion_at(&arm), node, stage, order });
            }
        }
        *side = spec.parent;
    }
    entries
}

/// The path formula of the module's head, added to K and D.
pub fn add_tangent<T: Real, E: Entries<T>>(
    topology: &Topology,
    placement: &Placement<T>,
    interaction: &Interaction<T>,
    geometric: bool,
    stiffness: &mut E,
    mut damping: Option<&mut E>,
) {
    let entries = path(topology, placement, interaction.a, interaction.b, &interaction.point);
    if let Some(elastic) = &interaction.elastic {
        add_slopes(&entries, &elastic.gradients, &elastic.k, stiffness);
        if let Some(damping) = damping.as_deref_mut() {
            add_slopes(&entries, &elastic.gradients, &elastic.c, damping);
        }
    }
    let moving = placement.velocity.is_some() && interaction.damped && damping.is_some();
    if moving || (geometric && !interaction.wrench.is_absent()) {
        let damped = damping.is_some();
        add_carried(topology, placement, interaction, &entries, (geometric, damped), stiffness);
    }
}

/// F^T k F with F = g . s S.
pub fn add_slopes<T: Real>(entries: &[PathEntry<T>], gradients: &[Six<T>], k: &[[T; 6]; 6], out: &mut impl Entries<T>) {
    let n = gradients.len();
    if k[..n].iter().all(|row| row[..n].iter().all(absent)) {
        return;
    }
    let strains: Vec<[T; 6]> = entries
        .iter()
        .map(|entry| {
            let s = entry.signed();
            let mut row = [T::zero(); 6];
            for (r, g) in row.iter_mut().zip(gradients) {
                *r = g.dot(&s);
            }
            row
        })
        .collect();
    for (j, fj) in entries.iter().zip(&strains) {
        let mut force = [T::zero(); 6];
        for a in 0..n {
            for b in 0..n {
                if !absent(&k[a][b]) {
                    force[a] += k[a][b] * fj[b];
                }
            }
        }
        for (i, fi) in entries.iter().zip(&strains) {
            let sum = (0..n).fold(T::zero(), |sum, a| sum + fi[a] * force[a]);
            out.add(i.dof, j.dof, sum);
        }
    }
}

/// What is proportional to the force, and what dampers do because the axes themselves move.
fn add_carried<T: Real>(
    topology: &Topology,
    placement: &Placement<T>,
    interaction: &Interaction<T>,
    entries: &[PathEntry<T>],
    (geometric, damped): (bool, bool),
    stiffness: &mut impl Entries<T>,
) {
    let Some((k, c)) = &interaction.tangent else {
        return;
    };
    let moving_b = placement.velocity.as_ref().map(|velocity| {
        let at = |node: usize| velocity.body[node].motion_at(&(interaction.point - placement.pose[node].p));
        topology.node(interaction.b).map_or_else(Six::zero, at)
    });
    let turned = geometric && !interaction.wrench.is_absent();
    for j in entries {
        let mut dw = k.apply(&j.signed());
        if turned && !j.on_b {
            dw += j.s.cross_force(&interaction.wrench);
        }
        if damped && let (Some(velocity), Some(vb)) = (placement.velocity.as_ref(), moving_b.as_ref()) {
            let arm = interaction.point - placement.pose[j.node].p;
            let relative = *vb - velocity.before[j.dof].motion_at(&arm);
            let change = j.s.cross_motion(&relative);
            dw += c.apply(&if j.on_b { change } else { -change });
        }
        for i in entries {
            let si = i.signed();
            let mut kij = si.dot(&dw);
            if turned && i.carried_by(j) {
                let ds = j.s.cross_motion(&i.s);
                kij += if i.on_b { ds.dot(&interaction.wrench) } else { -ds.dot(&interaction.wrench) };
            }
            stiffness.add(i.dof, j.dof, -kij);
        }
    }
}

/// Add the wrenches of an interaction to the bodies' sums, each about the body's centre of mass.
pub fn add_wrench<T: Real>(
    topology: &Topology,
    placement: &Placement<T>,
    interaction: &Interaction<T>,
    sums: &mut [Six<T>],
) {
    if let Some(n) = topology.node(interaction.b) {
        sums[n] += interaction.wrench.wrench_at(&(placement.pose[n].p - interaction.point));
    }
    if let Some(n) = topology.node(interaction.a) {
        sums[n] += -interaction.wrench.wrench_at(&(placement.pose[n].p - interaction.point));
    }
}
