//! From elements, joints with springs and their laws to connectors: what carries force between two bodies.
use std::collections::HashMap;

use crate::error::{Error, Result};
use crate::force::AnyLaw;
use crate::joint::{ANGLE_Z, Coordinate, JointKind};
use crate::model::layout::flag::{HAS_C, HAS_K, HAS_PRELOAD, LENGTH_GIVEN};
use crate::model::layout::{bushing, joint, spring_damper, torsion};
use crate::model::tables::{ElementKind, ElementSpec, LawSpec, Tables};
use crate::multibody::topology::{BoundFunction, BoundLaw, Connector, Natural, Owner};

/// Laws bound to their places, memory numbered in the order in which connectors ask for it.
struct LawBinder<'a> {
    of_owner: HashMap<(bool, usize), Vec<&'a LawSpec>>,
    memory: usize,
}

impl<'a> LawBinder<'a> {
    fn new(tables: &'a Tables) -> Self {
        let mut of_owner: HashMap<_, Vec<_>> = HashMap::new();
        for l in &tables.laws {
            of_owner.entry((l.on_joint, l.owner)).or_default().push(l);
        }
        LawBinder { of_owner, memory: 0 }
    }

    fn of(&mut self, on_joint: bool, owner: usize, n: usize) -> Result<Vec<BoundLaw>> {
        let here = self.of_owner.remove(&(on_joint, owner)).unwrap_or_default();
        let bound = here.into_iter().map(|l| {
            if l.component >= n {
                return Err(Error::model(format!(
                    "a law acts on coordinate {} of a connector that has {n}",
                    l.component
                )));
            }
            let law = AnyLaw::from_code(l.code, l.n)?;
            let memory = self.memory;
            self.memory += law.n_memory();
            Ok(BoundLaw { component: l.component, law, x: l.x, memory })
        });
        bound.collect()
    }
}

/// The functions on one element or joint of `n` coordinates.
fn functions(tables: &Tables, on_joint: bool, owner: usize, n: usize) -> Result<Vec<BoundFunction>> {
    let here = tables.functions.iter().enumerate().filter(|(_, f)| f.on_joint == on_joint && f.owner == owner);
    let bound = here.map(|(index, f)| {
        if f.coordinates.iter().any(|c| *c >= n) {
            return Err(Error::model(format!("a law acts on coordinates of a connector that has {n}")));
        }
        Ok(BoundFunction { index, coordinates: f.coordinates.clone(), law: f.law.clone(), x: f.x })
    });
    bound.collect()
}

fn present(flags: i64, bit: i64, x: usize) -> Option<usize> {
    (flags & bit != 0).then_some(x)
}

pub(crate) fn connectors(tables: &Tables) -> Result<(Vec<Connector>, usize)> {
    let mut all = Vec::new();
    let mut binder = LawBinder::new(tables);
    for (i, e) in tables.elements.iter().enumerate() {
        let mut connector = element_connector(i, e);
        connector.laws = binder.of(false, i, connector.coordinates.len())?;
        connector.functions = functions(tables, false, i, connector.coordinates.len())?;
        all.push(connector);
    }
    for (i, j) in tables.joints.iter().enumerate() {
        let coordinates = j.kind.free_coordinates().to_vec();
        let laws = binder.of(true, i, coordinates.len())?;
        let functions = functions(tables, true, i, coordinates.len())?;
        let acts = j.flags & (HAS_K | HAS_C | HAS_PRELOAD) != 0 || !laws.is_empty() || !functions.is_empty();
        if coordinates.is_empty() || !acts {
            continue;
        }
        all.push(Connector {
            owner: Owner::Joint(i),
            a: j.a,
            b: j.b,
            coordinates,
            k: present(j.flags, HAS_K, j.x + joint::K),
            c: present(j.flags, HAS_C, j.x + joint::C),
            preload: present(j.flags, HAS_PRELOAD, j.x + joint::PRELOAD),
            full: false,
            natural: Natural::Zero,
            laws,
            functions,
        });
    }
    Ok((all, binder.memory))
}

fn element_connector(i: usize, e: &ElementSpec) -> Connector {
    let (coordinates, k, c, preload, natural) = match e.kind {
        ElementKind::SpringDamper => {
            use spring_damper::{C, K, LENGTH, PRELOAD};
            let natural = Natural::Length { x: e.x + LENGTH, given: e.flags & LENGTH_GIVEN != 0 };
            (vec![Coordinate::Length], e.x + K, e.x + C, e.x + PRELOAD, natural)
        }
        ElementKind::Bushing => {
            let free = JointKind::Free.free_coordinates().to_vec();
            (free, e.x + bushing::K, e.x + bushing::C, e.x + bushing::PRELOAD, Natural::Zero)
        }
        ElementKind::Torsion => {
            use torsion::{ANGLE, C, K, PRELOAD};
            (vec![ANGLE_Z], e.x + K, e.x + C, e.x + PRELOAD, Natural::Value { x: e.x + ANGLE })
        }
    };
    Connector {
        owner: Owner::Element(i),
        a: e.a,
        b: e.b,
        coordinates,
        k: present(e.flags, HAS_K, k),
        c: present(e.flags, HAS_C, c),
        preload: present(e.flags, HAS_PRELOAD, preload),
        full: e.kind == ElementKind::Bushing,
        natural,
        laws: Vec::new(),
        functions: Vec::new(),
    }
}
