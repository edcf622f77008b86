//! The spanning tree: breadth first from ground along the joints, each flexible body reached as a whole.
use std::collections::VecDeque;

use crate::joint::{JointKind, Role};
use crate::model::tables::{BodyRef, Tables};
use crate::multibody::topology::Node;

/// Nodes in the order in which bodies are reached, and the joints that are cut.
pub(crate) fn spanning_tree(tables: &Tables) -> (Vec<Node>, Vec<usize>) {
    let n = tables.bodies.len();
    // joints at each body, ground last
    let mut at: Vec<Vec<usize>> = vec![Vec::new(); n + 1];
    for (j, joint) in tables.joints.iter().enumerate() {
        if joint.kind.role() == Role::Carries && !tables.absolute {
            at[joint.a.unwrap_or(n)].push(j);
            at[joint.b.unwrap_or(n)].push(j);
        }
    }
    let mut tree = Tree {
        tables,
        nodes: Vec::with_capacity(n),
        place: vec![None; n],
        used: vec![false; tables.joints.len()],
        first: 0,
        q: 0,
        free: (0..tables.joints.len())
            .filter(|j| tables.joints[*j].kind.role() == Role::Frees && !tables.absolute)
            .collect(),
        next_body: 0,
    };
    let mut queue = VecDeque::from([None]);
    loop {
        while let Some(inner) = queue.pop_front() {
            for &j in &at[inner.unwrap_or(n)] {
                let joint = &tables.joints[j];
                let outer = if joint.a == inner { joint.b } else { joint.a };
                if let Some(body) = outer.filter(|b| tree.place[*b].is_none()) {
                    tree.reach(body, inner, Some(j), &mut queue);
                }
            }
        }
        match tree.free_start() {
            Some((body, inner, joint)) => tree.reach(body, inner, joint, &mut queue),
            None => break,
        }
    }
    let cut =
        (0..tables.joints.len()).filter(|&j| !tree.used[j] && tables.joints[j].kind.role() != Role::Frees).collect();
    (tree.nodes, cut)
}

struct Tree<'a> {
    tables: &'a Tables,
    nodes: Vec<Node>,
    place: Vec<Option<usize>>,
    used: Vec<bool>,
    first: usize,
    q: usize,
    /// user's free joints that may still lead on
    free: Vec<usize>,
    /// no body before this one is unreached
    next_body: usize,
}

impl Tree<'_> {
    /// Attach a body, and at once all else that belongs to it: no loop may be cut inside a flexible body.
    fn reach(&mut self, body: usize, inner: BodyRef, joint: Option<usize>, queue: &mut VecDeque<BodyRef>) {
        self.attach(body, inner, joint);
        queue.push_back(Some(body));
        let tables = self.tables;
        let tip = tables.bodies[body].tip;
        let frame = tip.map_or(body, |t| tables.flexible[tables.tips[t].flexible].body);
        if frame != body {
            self.push(frame, Some(body), None, JointKind::Node, true);
            queue.push_back(Some(frame));
        }
        for t in &tables.tips {
            if tables.flexible[t.flexible].body == frame && t.body != body {
                self.push(t.body, Some(frame), None, JointKind::Node, false);
                queue.push_back(Some(t.body));
            }
        }
    }

    fn attach(&mut self, body: usize, inner: BodyRef, joint: Option<usize>) {
        let (kind, reversed) = match joint {
            None => (JointKind::Free, false),
            Some(j) => {
                self.used[j] = true;
                (self.tables.joints[j].kind, self.tables.joints[j].b == inner)
            }
        };
        self.push(body, inner, joint, kind, reversed);
    }

    fn push(&mut self, body: usize, inner: BodyRef, joint: Option<usize>, kind: JointKind, reversed: bool) {
        let parent = inner.and_then(|b| self.place[b]);
        let n = kind.freedoms(reversed).len();
        let depth = parent.map_or(0, |p| self.nodes[p].depth + 1);
        self.place[body] = Some(self.nodes.len());
        self.nodes.push(Node { body, parent, joint, reversed, kind, first: self.first, n, q: self.q, depth });
        self.q += kind.nq();
        // columns of moving nodes are counted behind all coordinates
        if !kind.is_modal() {
            self.first += n;
        }
    }

    /// Where the tree goes on when no joint leads further: along a user's free joint, else from ground.
    fn free_start(&mut self) -> Option<(usize, BodyRef, Option<usize>)> {
        let (place, tables) = (&self.place, self.tables);
        let reached = |b: BodyRef| b.is_none_or(|b| place[b].is_some());
        self.free.retain(|j| !(reached(tables.joints[*j].a) && reached(tables.joints[*j].b)));
        for &j in &self.free {
            let joint = &tables.joints[j];
            if reached(joint.a) != reached(joint.b) {
                let (inner, outer) = if reached(joint.a) { (joint.a, joint.b) } else { (joint.b, joint.a) };
                if let Some(body) = outer {
                    return Some((body, inner, Some(j)));
                }
            }
        }
        while self.place.get(self.next_body)?.is_some() {
            self.next_body += 1;
        }
        Some((self.next_body, None, None))
    }
}
