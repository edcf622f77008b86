//! Strains of elastic elements by the coordinates, e = w y, and the size of the terms that were added up in each entry of w.
use faer::Mat;

use crate::spatial::{Six, V3};

/// Twists T (6 n_bodies, dof) of the bodies' origins by the coordinates, world axes, and their positions.
pub struct Motions {
    pub twist: Mat<f64>,
    pub position: Vec<V3<f64>>,
}

/// Rows w (strains, dof) and sizes (strains, dof).
pub struct StrainRows {
    pub rows: Mat<f64>,
    pub sizes: Mat<f64>,
}

/// One elastic element: its bodies (None: ground), its point in the world, the gradients of its strains by the relative twist there.
pub struct Element {
    pub bodies: [Option<usize>; 2],
    pub point: V3<f64>,
    pub gradients: Vec<Six<f64>>,
}

pub fn strain_rows(motions: &Motions, elements: &[Element]) -> StrainRows {
    let (n, count) = (motions.twist.ncols(), elements.iter().map(|e| e.gradients.len()).sum());
    let mut made = StrainRows { rows: Mat::zeros(count, n), sizes: Mat::zeros(count, n) };
    let mut first = 0;
    for element in elements {
        for j in 0..n {
            let end = |k: usize| motions.end(element.bodies[k], &element.point, j);
            let ((a, size_a), (b, size_b)) = (end(0), end(1));
            for (i, g) in element.gradients.iter().enumerate() {
                let (force, moment) = (g.l.norm(), g.a.norm());
                made.rows[(first + i, j)] = g.l.dot(&(b.l - a.l)) + g.a.dot(&(b.a - a.a));
                made.sizes[(first + i, j)] = force * (size_a.0 + size_b.0) + moment * (size_a.1 + size_b.1);
            }
        }
        first += element.gradients.len();
    }
    made
}

impl Motions {
    /// Twist of a body's point in the motion of one coordinate, with the sizes of what was added up in its displacement and rotation.
    fn end(&self, body: Option<usize>, point: &V3<f64>, j: usize) -> (Six<f64>, (f64, f64)) {
        let Some(body) = body else { return (Six::zero(), (0.0, 0.0)) };
        let at = |k: usize| self.twist[(6 * body + k, j)];
        let (moved, turned) = (V3::new(at(0), at(1), at(2)), V3::new(at(3), at(4), at(5)));
        let position = &self.position[body];
        let reach = point.norm() + position.norm();
        let twist = Six::new(moved - (point - position).cross(&turned), turned);
        (twist, (moved.norm() + reach * turned.norm(), turned.norm()))
    }
}
