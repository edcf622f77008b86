//! A scalar coordinate e of the relative motion u = A^T (p_B - p_A), R = A^T B of two markers, its gradient and its curvature.
//!
//! With xi the relative twist of b against a at p_B, in the axes A,
//! ```text
//! de = g . xi,    d(g) = h xi      (seen from a frame that moves with a)
//! ```
//! Constraint rows are such coordinates with a multiplier for force, elastic elements with a law: both make
//! the wrench w = -sum g f on b at p_B, and its tangent  dw = -(sum g k g^T + sum h f) xi - (u_t x force).
use std::f64::consts::TAU;

use num_dual::Dual;

use crate::joint::{ANGLE_Z, Coordinate};
use crate::spatial::{M3, Map6, Real, Six, V3, left_jacobian_coefficient, log_so3, outer, product, skew};

/// Relative pose of a marker pair in the axes of A.
#[derive(Debug, Clone, Copy)]
pub struct Relative<T: Real> {
    pub u: V3<T>,
    pub r: M3<T>,
    /// of a rolling disc
    pub radius: T,
    /// of a screw, metres per radian
    pub pitch: T,
    /// about how far its two angles have turned, by the coordinates of hinges
    pub turned: [f64; 2],
}

/// The whole turns next to an angle.
pub fn whole_turns(angle: f64) -> f64 {
    (angle / TAU).round() * TAU
}

/// Value, gradient and curvature of one coordinate.
#[derive(Debug, Clone, Copy)]
pub struct Row<T: Real> {
    pub e: T,
    pub g: Six<T>,
}

fn unit<T: Real>(i: usize) -> V3<T> {
    let mut e = V3::zeros();
    e[i] = T::one();
    e
}

impl<T: Real> Relative<T> {
    pub fn row(&self, coordinate: Coordinate) -> Row<T> {
        let zero = V3::zeros();
        match coordinate {
            Coordinate::Translation(i) => Row { e: self.u[i], g: Six::new(unit(i), zero) },
            Coordinate::Length => {
                let length = self.u.dot(&self.u).sqrt();
                Row { e: length, g: Six::new(self.u / length, zero) }
            }
            Coordinate::Dot(i, j) => Row { e: self.r[(i, j)], g: Six::new(zero, self.entry_gradient(i, j)) },
            Coordinate::Angle { s, c, index } => {
                let (sv, cv) = (self.r[s], self.r[c]);
                let e = sv.atan2(cv);
                let n = self.entry_gradient(s.0, s.1) * cv - self.entry_gradient(c.0, c.1) * sv;
                Row { e: e + whole_turns(self.turned[index] - e.re()), g: Six::new(zero, n / (sv * sv + cv * cv)) }
            }
            Coordinate::RotationVector(i) => {
                let phi = log_so3(&self.r);
                Row { e: phi[i], g: Six::new(zero, inverse_left_transposed(&phi, &unit(i))) }
            }
            Coordinate::Thread => {
                let turn = self.row(ANGLE_Z);
                // the turn of the angle that the way along the axis tells
                let ahead = if self.pitch.re() == 0.0 { 0.0 } else { (self.u[2] / self.pitch - turn.e).re() };
                let angle = turn.e + whole_turns(ahead);
                Row { e: self.u[2] - angle * self.pitch, g: Six::new(unit(2), turn.g.a * -self.pitch) }
            }
            Coordinate::Edge => Row { e: T::zero(), g: Six::new(self.r.column(2).into_owned(), zero) },
            Coordinate::Disc(k) => self.disc_row(k),
        }
    }

    /// The curvature h of the coordinate: the derivative of its gradient by xi.
    pub fn curvature(&self, coordinate: Coordinate) -> Map6<T> {
        let mut h = Map6::zero();
        match coordinate {
            Coordinate::Translation(_) => {}
            Coordinate::Length => {
                let length = self.u.dot(&self.u).sqrt();
                let n = self.u / length;
                h.ll = (M3::identity() - outer(&n, &n)) / length;
            }
            Coordinate::Dot(i, j) => h.aa = self.entry_curvature(i, j),
            Coordinate::Angle { s, c, .. } => h.aa = self.angle_curvature(s, c),
            Coordinate::RotationVector(i) => h.aa = rotation_vector_curvature(&log_so3(&self.r), &unit(i)),
            Coordinate::Thread => h.aa = self.curvature(ANGLE_Z).aa * -self.pitch,
            Coordinate::Edge => h.la = -skew(&self.r.column(2).into_owned()),
            Coordinate::Disc(k) => self.disc_curvature(k, &mut h),
        }
        h
    }

    /// The contact point is at c = r ((n.z) n - z)/rho from the centre, n = B_z, z = A_z, rho = |n x z|; the material point there
    /// moves along t with t . xi_t + (c x t) . xi_r. t: z, n x z/rho (the track), z x (n x z)/rho.
    fn disc_row(&self, k: usize) -> Row<T> {
        let (z, n) = (unit::<T>(2), self.r.column(2).into_owned());
        let track = n.cross(&z);
        let rho = track.dot(&track).sqrt();
        let contact = (n * n[2] - z) * (self.radius / rho);
        let t = match k {
            0 => z,
            1 => track / rho,
            _ => z.cross(&track) / rho,
        };
        let e = if k == 0 { self.u[2] - self.radius * rho } else { T::zero() };
        Row { e, g: Six::new(t, contact.cross(&t)) }
    }

    /// The row turned by dual numbers about each axis in turn.
    fn disc_curvature(&self, k: usize, h: &mut Map6<T>) {
        for axis in 0..3 {
            let spin = unit::<T>(axis);
            let turned = product(&skew(&spin), &self.r);
            let moved = Relative {
                u: self.u.map(Dual::from_re),
                r: M3::from_fn(|i, j| Dual::new(self.r[(i, j)], turned[(i, j)])),
                radius: Dual::from_re(self.radius),
                pitch: Dual::from_re(self.pitch),
                turned: self.turned,
            };
            let g = moved.disc_row(k).g;
            for i in 0..3 {
                h.la[(i, axis)] = g.l[i].eps;
                h.aa[(i, axis)] = g.a[i].eps;
            }
        }
    }

    // R_ij = A_i . w with w = R e_j, dw = xi x w
    fn entry_gradient(&self, i: usize, j: usize) -> V3<T> {
        let w: V3<T> = self.r.column(j).into_owned();
        w.cross(&unit(i))
    }

    fn entry_curvature(&self, i: usize, j: usize) -> M3<T> {
        let w: V3<T> = self.r.column(j).into_owned();
        outer(&w, &unit(i)) - M3::from_diagonal_element(self.r[(i, j)])
    }

    fn angle_curvature(&self, s: (usize, usize), c: (usize, usize)) -> M3<T> {
        let (sv, cv) = (self.r[s], self.r[c]);
        let (ds, dc) = (self.entry_gradient(s.0, s.1), self.entry_gradient(c.0, c.1));
        let d = sv * sv + cv * cv;
        let n = ds * cv - dc * sv;
        let dn = outer(&ds, &dc) - outer(&dc, &ds) + self.entry_curvature(s.0, s.1) * cv
            - self.entry_curvature(c.0, c.1) * sv;
        let dd = (dc * cv + ds * sv) * T::from(2.0);
        dn / d - outer(&n, &dd) / (d * d)
    }
}

/// J_l^-T(phi) f, the moment conjugate to a rotation vector.
fn inverse_left_transposed<T: Real>(phi: &V3<T>, f: &V3<T>) -> V3<T> {
    let (b, _) = left_jacobian_coefficient(phi.dot(phi));
    f + phi.cross(f) * T::from(0.5) + phi.cross(&phi.cross(f)) * b
}

/// The derivative of J_l^-T(phi) f along d(phi) = J_l^-1 xi.
fn rotation_vector_curvature<T: Real>(phi: &V3<T>, f: &V3<T>) -> M3<T> {
    let (b, b_s) = left_jacobian_coefficient(phi.dot(phi));
    let (p, pf) = (skew(phi), phi.cross(f));
    let by_phi = -skew(f) * T::from(0.5) - (skew(&pf) + p * skew(f)) * b + outer(&phi.cross(&pf), phi) * (b_s * 2.0);
    let inverse_left = M3::identity() - p * T::from(0.5) + p * p * b;
    by_phi * inverse_left
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::joint::ANGLE_BETA;
    use crate::spatial::{exp_so3, lift3, lift33};
    use num_dual::Dual64;

    /// Every hand-derived gradient and curvature against duals along six directions, at small and large relative rotations.
    #[test]
    fn gradients_and_curvatures_match_duals() {
        let all = [
            Coordinate::Translation(1),
            Coordinate::Length,
            Coordinate::Dot(0, 2),
            ANGLE_Z,
            ANGLE_BETA,
            Coordinate::RotationVector(0),
            Coordinate::RotationVector(2),
            Coordinate::Thread,
            Coordinate::Edge,
            Coordinate::Disc(0),
            Coordinate::Disc(1),
            Coordinate::Disc(2),
        ];
        for scale in [0.0, 1e-3, 0.7, 2.5] {
            let r = exp_so3(&(V3::new(0.3, -0.6, 0.74) * scale));
            let u = V3::new(0.4, -0.2, 0.9);
            let here = Relative { u, r, radius: 0.3, pitch: -0.21, turned: [0.0; 2] };
            for k in 0..6 {
                let mut xi = [0.0; 6];
                xi[k] = 1.0;
                let dual = |at: usize| V3::from_fn(|i, _| Dual64::new(0.0, xi[at + i]));
                let moved = Relative {
                    u: lift3::<Dual64>(&u) + dual(0),
                    r: exp_so3(&dual(3)) * lift33::<Dual64>(&r),
                    radius: Dual64::from(0.3),
                    pitch: Dual64::from(-0.21),
                    turned: [0.0; 2],
                };
                for coordinate in all {
                    // flat on the plane a disc touches it nowhere in particular
                    if matches!(coordinate, Coordinate::Disc(_)) && scale < 0.1 {
                        continue;
                    }
                    let (row, dual_row) = (here.row(coordinate), moved.row(coordinate));
                    let velocity = matches!(coordinate, Coordinate::Edge | Coordinate::Disc(1) | Coordinate::Disc(2));
                    assert!(velocity || (dual_row.e.eps - row.g.get(k)).abs() < 1e-12, "{coordinate:?} {scale} {k}");
                    let h = here.curvature(coordinate);
                    let expected = h.apply(&Six::new(V3::from_fn(|i, _| xi[i]), V3::from_fn(|i, _| xi[3 + i])));
                    for i in 0..6 {
                        assert!(
                            (dual_row.g.get(i).eps - expected.get(i)).abs() < 1e-11,
                            "{coordinate:?} {scale} {k} {i}"
                        );
                    }
                }
            }
        }
    }
}
