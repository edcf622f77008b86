//! What modal coordinates add to a scene: their rows of the residual and the tangent, and their energies.
use nalgebra::DVector;

use crate::linalg::entries::Entries;
use crate::multibody::assemble::Scene;
use crate::multibody::connector::modal_load;
use crate::multibody::flexible_inertia::shapes;
use crate::spatial::{Real, V3};

impl<T: Real> Scene<'_, T> {
    /// Rows of the modal coordinates: their inertia, stiffness and damping, less the loads on them.
    pub(crate) fn add_modal_forces(&self, inertia: Option<Vec<T>>, rho: &mut DVector<T>) {
        let (topology, q) = (self.topology, &self.placement.modal);
        let first = topology.n_tree - q.len();
        for (k, f) in inertia.into_iter().flatten().enumerate() {
            rho[first + k] += f;
        }
        for (modal, g) in topology.modal.iter().zip(&self.geometry.flexible) {
            let m = modal.m;
            let rate = self.rate.filter(|_| self.effects.damping && g.damped);
            for k in 0..m {
                for l in 0..m {
                    rho[modal.first + k] += g.k[k * m + l] * q[modal.first - first + l];
                    if let Some(rate) = rate {
                        rho[modal.first + k] += g.c[k * m + l] * rate[modal.first + l];
                    }
                }
            }
        }
        for (load, spec) in topology.tables.loads.iter().enumerate() {
            if let Some(i) = spec.mode.and_then(|k| topology.modal_coordinate(spec.body, k)) {
                rho[i] -= modal_load(topology, self.geometry, load, self.t);
            }
        }
    }

    /// Kinetic energy that modal coordinates and their rates add to that of the undeformed bodies.
    pub fn modal_kinetic(&self) -> T {
        let Some(velocity) = self.placement.velocity.as_ref() else {
            return T::zero();
        };
        let all = shapes(&self.inertia(true));
        all.iter().fold(T::zero(), |sum, s| sum + s.kinetic(&velocity.body[s.modal.node]))
    }

    /// First moments of deformed bodies about their undeformed centres of mass, world axes.
    pub fn modal_moment(&self) -> V3<T> {
        let all = shapes(&self.inertia(true));
        all.iter().fold(V3::zeros(), |sum, s| sum + s.composite().0)
    }

    pub(crate) fn add_modal_stiffness<E: Entries<T>>(&self, stiffness: &mut E, mut damping: Option<&mut E>) {
        for (modal, g) in self.topology.modal.iter().zip(&self.geometry.flexible) {
            let (m, first) = (modal.m, modal.first);
            for k in 0..m * m {
                stiffness.add(first + k / m, first + k % m, g.k[k]);
                if let Some(damping) = damping.as_deref_mut().filter(|_| g.damped) {
                    damping.add(first + k / m, first + k % m, g.c[k]);
                }
            }
        }
    }
}
