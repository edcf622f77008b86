//! Loads in the virtual power: - U.W, at points of bodies and on modal coordinates.
use crate::multibody::connector::load_parts;
use crate::multibody::placement::Placement;
use crate::spatial::{M3, Six, V3};

use super::flexible::OnTape;
use super::tree::{Bodies, Twists};
use super::{Columns, Power, Slopes};

impl<T: OnTape> Power<'_, '_, T> {
    /// - U.W of all loads.
    pub fn loads_back(
        &self,
        at: &Placement<T>,
        twists: &Twists<T>,
        columns: &Columns<T>,
        bodies: &mut Bodies<T>,
        out: &mut Slopes<T>,
    ) {
        let topology = self.eq.topology();
        let f = T::from(-self.factor);
        for (load, spec) in topology.tables.loads.iter().enumerate() {
            if spec.mode.is_some() {
                self.modal_load_back(load, columns, out);
                continue;
            }
            let n = topology.node_of_body[spec.body];
            let r = &at.pose[n].r;
            let (local, value) = load_parts(topology, &self.eq.geometry, load, self.motion.t);
            let arm = r * local;
            let world: V3<T> = if spec.follower { r * value } else { value } * f;
            // at its point
            let u = twists.virtual_[n].motion_at(&arm);
            let zero = V3::zeros();
            let (virtual_, moved, felt) = if spec.torque {
                let moved = if spec.follower { world.cross(&u.a) } else { zero };
                (Six::new(zero, world), Six::new(zero, moved), u.a)
            } else {
                let moved = if spec.follower { world.cross(&u.l) } else { zero };
                (Six::new(world, zero), Six::new(world.cross(&u.a), moved), u.l)
            };
            let to_com = -arm;
            bodies.virtual_[n] += virtual_.wrench_at(&to_com);
            bodies.displaced[n] += moved.wrench_at(&to_com);
            out.geometry.loads[load].0 += r.transpose() * moved.l;
            let by_value = if spec.follower { r.transpose() * felt } else { felt } * f;
            out.geometry.loads[load].1 += by_value;
            self.load_motions_back(load, &by_value, out);
        }
    }

    /// A load on a modal coordinate.
    fn modal_load_back(&self, load: usize, columns: &Columns<T>, out: &mut Slopes<T>) {
        let topology = self.eq.topology();
        let spec = &topology.tables.loads[load];
        let coordinate = spec.mode.and_then(|k| topology.modal_coordinate(spec.body, k));
        let Some(i) = coordinate else { return };
        let by = V3::new(columns.virtual_[i] * -self.factor, T::zero(), T::zero());
        out.geometry.loads[load].1 += by;
        self.load_motions_back(load, &by, out);
    }

    /// Motions add to a load in the drawn world; a follower carries the sum along from there.
    fn load_motions_back(&self, load: usize, by_value: &V3<T>, out: &mut Slopes<T>) {
        let (tables, geometry) = (&self.eq.topology().tables, &self.eq.geometry);
        let spec = &tables.loads[load];
        let drawn: M3<T> = match spec.follower {
            true => geometry.bodies[spec.body].drawn.r,
            false => M3::identity(),
        };
        let by_world = drawn * by_value;
        for m in tables.load_motions.iter().filter(|m| m.load == load) {
            out.motions[m.motion][0] += by_world[m.component];
            if spec.follower {
                let v = geometry.motions[m.motion].at(self.motion.t)[0];
                for k in 0..3 {
                    out.geometry.bodies[spec.body].drawn.r[(m.component, k)] += v * by_value[k];
                }
            }
        }
    }
}
