//! The air in the virtual power: - U.W at the sections of blades.
//!
//! What a section feels is a function of its displacement, of the velocity field at its point and of its numbers; that function goes on
//! the tape.
use crate::aero::unsteady::Memory;
use crate::multibody::air::Here;
use crate::multibody::placement::Placement;
use crate::spatial::{Six, V3};

use super::flexible::OnTape;
use super::tree::{Bodies, Twists};
use super::{Power, Slopes};
use crate::ad::tape::clear;

impl<T: OnTape> Power<'_, '_, T> {
    /// - U.W of all sections.
    pub fn air_back(&self, at: &Placement<T>, twists: &Twists<T>, bodies: &mut Bodies<T>, out: &mut Slopes<T>) {
        let topology = self.eq.topology();
        let scene = self.eq.scene(self.motion, at, None);
        let f = T::from(-self.factor);
        for i in 0..scene.airy() {
            let now = scene.here(i);
            let node = topology.node_of_body[now.spec.body];
            let (r, to_com) = (&at.pose[node].r, at.pose[node].p - now.place.p);
            let felt = twists.virtual_[node].motion_at(&-to_com).scaled(f);
            clear();
            let mut n = 0;
            let mut put = |v: T| {
                n += 1;
                v.leaf()
            };
            let none = Six::<T>::zero();
            let [xi, rate, felt] = [none, none, felt].map(|v| Six::new(v.l.map(&mut put), v.a.map(&mut put)));
            let air = now.air.map(&mut put);
            let own = self.eq.geometry.sections[i].map(&mut put);
            let places = topology.section_memory(i);
            let memory = self.motion.memory.get(places.clone()).unwrap_or(&[]);
            let memory: Vec<_> = memory.iter().map(|v| put(*v)).collect();
            // what displacements and rates stand for is held
            let (induced, place) = (now.induced.map(T::leaf), now.place.map(T::leaf));
            let section = own.section(now.spec, &air, &topology.tables.air[now.spec.air]);
            let here = Here { spec: now.spec, air: &air, induced, section, place, memory: Memory::read(&memory) };
            let d = T::slopes(felt.dot(&here.wrench_after(&xi, &rate)), n);
            let mut slopes = d.iter();
            let mut next = move || slopes.next().copied().unwrap_or_else(T::zero);
            let [moved, by_rate, wrench]: [Six<T>; 3] = std::array::from_fn(|_| {
                let l = V3::from_fn(|_, _| next());
                Six::new(l, V3::from_fn(|_, _| next()))
            });
            bodies.displaced[node] += moved.wrench_at(&to_com);
            bodies.velocity[node] += by_rate.wrench_at(&to_com);
            bodies.virtual_[node] += wrench.scaled(f).wrench_at(&to_com);
            let onto = &mut out.geometry.air[now.spec.air];
            *onto = onto.map(&mut |v| v + next());
            let onto = &mut out.geometry.sections[i];
            *onto = onto.map(&mut |v| v + next());
            onto.local += r.transpose() * moved.l;
            if !memory.is_empty() {
                out.memory[places].iter_mut().for_each(|v| *v += next());
            }
        }
    }
}
