//! Spanning tree and cut joints, tree coordinates, constraint rows and the list of everything that carries force.
use crate::force::{AnyLaw, FunctionLaw};
use crate::joint::{Coordinate, Freedom, JointKind};
use crate::model::geometry::Geometry;
use crate::model::layout::{bushing, joint, spring_damper, torsion};
use crate::model::tables::{BodyRef, ElementKind, Tables};
use crate::spatial::{Real, V3};
use crate::tolerances::coordinates::SAME_POINT;

/// A body in the tree, and the joint that carries it.
#[derive(Debug, Clone)]
pub struct Node {
    pub body: usize,
    /// index of the inner node; None where the inner body is ground
    pub parent: Option<usize>,
    /// None: an implicit free joint to ground, or between a flexible body and its node
    pub joint: Option<usize>,
    /// the inner body is the joint's second one
    pub reversed: bool,
    pub kind: JointKind,
    /// its first column: a tree coordinate, but of a moving node
    pub first: usize,
    pub n: usize,
    /// its first number in q
    pub q: usize,
    pub depth: usize,
}

impl Node {
    /// Does an implicit free joint carry it, which no joint of the model is?
    pub fn is_loose(&self) -> bool {
        self.joint.is_none() && !self.kind.is_modal()
    }

    /// -1 where coordinates count backwards.
    pub fn sign(&self) -> f64 {
        if self.reversed { -1.0 } else { 1.0 }
    }
}

/// A tree coordinate.
#[derive(Debug, Clone)]
pub struct Dof {
    pub node: usize,
    pub freedom: Freedom,
    /// -1 where the joint is reversed: coordinates count the motion of b relative to a
    pub sign: f64,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Level {
    Position,
    Velocity,
}

/// What a constraint row is for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Purpose {
    /// the joint itself, where it is cut
    Joint,
    /// e - motion(t) = 0
    Drive(usize),
    /// e - ratio e_first - offset = 0
    Coupler(usize),
    /// a row of a function of several coordinates
    Constraint(usize),
}

/// A constraint row: a coordinate e of a joint (of a coupler its second one, of a function its first one), and what it is for; its level decides where it enters.
#[derive(Debug, Clone)]
pub struct ConstraintRow {
    pub joint: usize,
    pub coordinate: Coordinate,
    pub level: Level,
    pub purpose: Purpose,
}

impl ConstraintRow {
    /// Rows that one object makes stand together.
    pub fn belongs_with(&self, other: &Self) -> bool {
        self.joint == other.joint && self.purpose == other.purpose
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Owner {
    Element(usize),
    Joint(usize),
}

#[derive(Debug, Clone, Copy)]
pub enum Natural {
    Zero,
    /// e is measured from the drawn distance + x, or from x alone if given
    Length {
        x: usize,
        given: bool,
    },
    Value {
        x: usize,
    },
}

/// Anything elastic or dissipative between two markers: n coordinates and where their numbers are.
#[derive(Debug, Clone)]
pub struct Connector {
    pub owner: Owner,
    pub a: BodyRef,
    pub b: BodyRef,
    pub coordinates: Vec<Coordinate>,
    /// start of k in x; full matrices are row-major with `stride` columns
    pub k: Option<usize>,
    pub c: Option<usize>,
    pub preload: Option<usize>,
    pub full: bool,
    pub natural: Natural,
    pub laws: Vec<BoundLaw>,
    pub functions: Vec<BoundFunction>,
}

impl Connector {
    /// Whether it has anything but springs, dampers and preloads.
    pub fn has_laws(&self) -> bool {
        !self.laws.is_empty() || !self.functions.is_empty()
    }

    pub fn feels_rates(&self) -> bool {
        self.laws.iter().any(|l| l.law.uses_velocity()) || self.functions.iter().any(|f| f.law.uses_rate())
    }
}

/// A law on one coordinate of a connector: where its parameters are in x and its memory in the state.
#[derive(Debug, Clone)]
pub struct BoundLaw {
    pub component: usize,
    pub law: AnyLaw,
    pub x: usize,
    pub memory: usize,
}

/// A function on coordinates of a connector, and where its parameters are in x.
#[derive(Debug, Clone)]
pub struct BoundFunction {
    /// among the functions of the tables
    pub index: usize,
    pub coordinates: Vec<usize>,
    pub law: FunctionLaw,
    pub x: usize,
}

impl BoundFunction {
    /// Its own part of numbers of all coordinates of the connector; zeros where there are none.
    pub fn own<T: Real>(&self, all: Option<&[T]>) -> Vec<T> {
        self.coordinates.iter().map(|i| all.map_or_else(T::zero, |all| all[*i])).collect()
    }

    pub fn numbers<'x, T>(&self, x: &'x [T]) -> &'x [T] {
        &x[self.x..self.x + self.law.n_params()]
    }
}

/// Modal coordinates of a flexible body.
#[derive(Debug, Clone)]
pub struct Modal {
    /// of its frame in the tree
    pub node: usize,
    /// its first tree coordinate, and how many
    pub first: usize,
    pub m: usize,
    /// its first number in q
    pub q: usize,
    /// displacement (root mean square over the mass) for a unit of each
    pub size: Vec<f64>,
}

#[derive(Debug, Clone)]
pub struct Topology {
    pub tables: Tables,
    pub nodes: Vec<Node>,
    pub node_of_body: Vec<usize>,
    /// which nodes are connected otherwise than through ground, see `islands`
    pub island: Vec<usize>,
    /// all columns: tree coordinates, then those of moving nodes, which are no coordinates of their own
    pub dofs: Vec<Dof>,
    /// how many of them are tree coordinates
    pub n_tree: usize,
    /// of each flexible body; empty without any
    pub modal: Vec<Modal>,
    pub names: Vec<String>,
    pub cut: Vec<usize>,
    pub rows: Vec<ConstraintRow>,
    pub connectors: Vec<Connector>,
    /// how many numbers q has: those of the joints by node, then modal coordinates
    pub n_q: usize,
    /// numbers that laws and sections in the air remember
    pub n_memory: usize,
    /// where those of each section begin, and where they end
    pub air_memory: Vec<usize>,
    /// hinges that turn the two angles of each marker pair: joints, then elements
    pub turning: Vec<[Turning; 2]>,
}

/// Tree coordinates that turn an angle between two bodies by about themselves, with their signs.
pub type Turning = Vec<(usize, f64)>;

impl Topology {
    /// A memory with the states of all such laws at rest, whatever they were.
    pub fn at_rest(&self, memory: &[f64]) -> Vec<f64> {
        let mut out = if memory.is_empty() { vec![0.0; self.n_memory] } else { memory.to_vec() };
        for law in self.connectors.iter().flat_map(|c| &c.laws) {
            let rest: Vec<f64> = law.law.rest_memory();
            if law.law.has_rates() {
                out[law.memory..law.memory + rest.len()].copy_from_slice(&rest);
            }
        }
        for own in (0..self.tables.sections.len()).map(|i| self.section_memory(i)).filter(|own| !own.is_empty()) {
            out[own.start..own.end - 1].fill(0.0);
            out[own.end - 1] = f64::INFINITY;
        }
        out
    }

    /// Places in the memory of a section in the air: its states and their gain.
    pub fn section_memory(&self, index: usize) -> std::ops::Range<usize> {
        self.air_memory[index]..self.air_memory[index + 1]
    }

    /// Do other rotations than those of `turning` lie between two bodies? The turns of an angle between them are then not known.
    pub fn loses_turns(&self, pair: usize, a: BodyRef, b: BodyRef) -> bool {
        let counted = |d: usize| self.turning[pair].iter().flatten().any(|(hinge, _)| *hinge == d);
        let between = self.nodes_between(a, b).into_iter().filter(|n| !self.nodes[*n].kind.is_modal());
        let mut dofs = between.flat_map(|n| self.nodes[n].first..self.nodes[n].first + self.nodes[n].n);
        dofs.any(|d| self.dofs[d].freedom.rotation && !counted(d))
    }

    /// About how far the two angles of a marker pair have turned, at coordinates q.
    pub fn turned<T: Real>(&self, q: &[T], pair: usize) -> [f64; 2] {
        let angle = |d: usize| {
            let node = &self.nodes[self.dofs[d].node];
            q[node.q + d - node.first].re()
        };
        let sum = |hinges: &Turning| hinges.iter().map(|(d, sign)| sign * angle(*d)).sum::<f64>();
        self.turning.get(pair).map_or([0.0; 2], |[first, second]| [sum(first), sum(second)])
    }

    /// The bodies of an element or joint.
    pub fn ends(&self, owner: Owner) -> (BodyRef, BodyRef) {
        match owner {
            Owner::Element(i) => (self.tables.elements[i].a, self.tables.elements[i].b),
            Owner::Joint(i) => (self.tables.joints[i].a, self.tables.joints[i].b),
        }
    }

    pub fn owner_name(&self, owner: Owner) -> &str {
        match owner {
            Owner::Element(i) => &self.tables.elements[i].name,
            Owner::Joint(i) => &self.tables.joints[i].name,
        }
    }

    /// The name of what makes a row.
    pub fn row_name(&self, row: usize) -> &str {
        let row = &self.rows[row];
        match row.purpose {
            Purpose::Joint => &self.tables.joints[row.joint].name,
            Purpose::Drive(i) => &self.tables.drives[i].name,
            Purpose::Coupler(i) => &self.tables.couplers[i].name,
            Purpose::Constraint(i) => &self.tables.constraints[i].name,
        }
    }

    pub fn node(&self, body: BodyRef) -> Option<usize> {
        body.map(|b| self.node_of_body[b])
    }

    /// The nodes on the way between two bodies, their common carrier left out.
    pub fn nodes_between(&self, a: BodyRef, b: BodyRef) -> Vec<usize> {
        self.sides_between(a, b).into_iter().map(|(node, _)| node).collect()
    }

    /// The same, and for each whether it carries b and not a.
    pub fn sides_between(&self, a: BodyRef, b: BodyRef) -> Vec<(usize, bool)> {
        let depth = |n: Option<usize>| n.map_or(-1, |n| self.nodes[n].depth as i64);
        let (mut i, mut j) = (self.node(a), self.node(b));
        let mut between = Vec::new();
        while i != j {
            let of_b = depth(j) >= depth(i);
            let side = if of_b { &mut j } else { &mut i };
            let Some(node) = *side else { break };
            between.push((node, of_b));
            *side = self.nodes[node].parent;
        }
        between
    }

    /// Which moving node hangs on a node of the kind `Node`, or carries it.
    pub fn tip(&self, node: &Node) -> usize {
        let carrier = node.parent.map_or(node.body, |p| self.nodes[p].body);
        let body = if node.reversed { carrier } else { node.body };
        self.tables.bodies[body].tip.unwrap_or(0)
    }

    /// The tree coordinate of a body's mode.
    pub fn modal_coordinate(&self, body: usize, mode: usize) -> Option<usize> {
        let own = self.tables.flexible.iter().position(|f| f.body == body)?;
        Some(self.modal[own].first + mode)
    }

    pub fn is_flexible(&self) -> bool {
        !self.modal.is_empty()
    }

    /// The measure of a tree coordinate: an angle 1, a length the given one, a modal coordinate what displaces by it.
    pub fn scale(&self, coordinate: usize, length: f64) -> f64 {
        let own = self.modal.iter().find(|m| (m.first..m.first + m.m).contains(&coordinate));
        match own {
            Some(m) => length / m.size[coordinate - m.first],
            None if self.dofs[coordinate].freedom.rotation => 1.0,
            None => length,
        }
    }

    pub fn has_velocity_rows(&self) -> bool {
        self.rows.iter().any(|r| r.level == Level::Velocity)
    }

    /// The largest distance of any located point from the mean of them all; 1 for a single point.
    pub fn characteristic_length<T: Real>(&self, geometry: &Geometry<T>, x: &[T]) -> T {
        let at = |i: usize| V3::new(x[i], x[i + 1], x[i + 2]);
        let rigid = geometry.bodies.iter().zip(&self.tables.bodies).filter(|(_, b)| b.tip.is_none());
        let mut points: Vec<V3<T>> = rigid.map(|(b, _)| b.drawn.p).collect();
        for j in &self.tables.joints {
            points.extend([at(j.x + joint::AT_A), at(j.x + joint::AT_B)]);
        }
        for e in &self.tables.elements {
            match e.kind {
                ElementKind::SpringDamper => {
                    points.extend([at(e.x + spring_damper::AT_A), at(e.x + spring_damper::AT_B)]);
                }
                ElementKind::Bushing => points.extend([at(e.x + bushing::AT_A), at(e.x + bushing::AT_B)]),
                ElementKind::Torsion => points.push(at(e.x + torsion::AT)),
            }
        }
        let sum = points.iter().fold(V3::zeros(), |sum: V3<T>, p| sum + p);
        let mean = sum * T::from(1.0 / points.len() as f64);
        let squares = points.iter().map(|p| (p - mean).dot(&(p - mean)));
        // points that are one but for rounding make no length
        let far = points.iter().map(|p| p.map(|v| v.re()).amax());
        let rounding = SAME_POINT * far.fold(0.0, f64::max);
        let farthest = squares.fold(T::zero(), |a, b| if b.re() > a.re() { b } else { a });
        if farthest.re() > rounding * rounding { farthest.sqrt() } else { T::one() }
    }
}
