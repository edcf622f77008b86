//! Positions on the constraints, rates along them, accelerations and multipliers that belong to both: what makes an instant.
//!
//! Corrections are the smallest in kinetic energy, min dy^T M dy, so that they leave the free motion alone.
use nalgebra::{DMatrix, DVector};

use crate::error::{Error, Result};
use crate::linalg::kkt::Kkt;
use crate::linalg::matrix::Matrix;
use crate::linalg::rows::Level as Asked;
use crate::multibody::articulated;
use crate::multibody::assemble::Scene;
use crate::multibody::placement::advance;
use crate::multibody::topology::Level;
use crate::run::Counts;
use crate::tolerances::constraints::{CLOSED_ENOUGH, REDUNDANT_OPEN};

use super::{Equations, Instant, Motion, scaled_size};
use crate::tolerances::steps::CLOSED;

const CLOSING_STEPS: usize = 12;
/// Part of all rates that the projection of a controlled step changes at most.
const BRANCH: f64 = 0.05;

/// Everything that the accelerations follow from, at one placement.
struct Evaluation {
    mass: Matrix,
    h: DVector<f64>,
    jacobian: Matrix,
    gamma: DVector<f64>,
}

impl Equations<'_, f64> {
    pub(super) fn matrix(&self, rows: usize) -> Matrix {
        Matrix::zeros(rows, self.n(), self.sparse)
    }

    /// Phi and J, sparse where the model is large.
    pub fn row_matrix(&self, m: &Motion<f64>) -> (DVector<f64>, Matrix) {
        let placement = self.place(m);
        let mut jacobian = self.matrix(self.n_rows());
        let phi = self.scene(m, &placement, None).constraints_into(&mut jacobian);
        (phi, jacobian)
    }

    pub(super) fn mass_of(&self, scene: &Scene<'_, f64>) -> Matrix {
        let mut mass = self.matrix(self.n());
        scene.mass_into(&mut mass, &mut Matrix::zeros(0, 0, self.sparse));
        mass
    }

    pub(super) fn saddle(&self, mass: &Matrix, jacobian: &Matrix, counts: &mut Counts) -> Result<Kkt> {
        counts.add("mass factorisations", 1);
        self.check_mass(mass)?;
        self.kkt(mass, jacobian, self.rows.select(jacobian, Asked::All))
    }

    fn check_mass(&self, mass: &Matrix) -> Result<()> {
        let bare = |d: &f64| *d == 0.0 || !d.is_finite();
        if let Some(i) = mass.diagonal().iter().position(bare) {
            return Err(Error::singular(format!(
                "the equations of motion are singular: '{}' moves no inertia; give the bodies that it moves mass or a rotational \
                 inertia, or lock it with a fixed joint",
                self.topology().names[i]
            )));
        }
        Ok(())
    }

    /// [M R^T; R 0] with some rows.
    fn kkt(&self, mass: &Matrix, jacobian: &Matrix, kept: Vec<usize>) -> Result<Kkt> {
        Kkt::with_rows(mass, jacobian, kept, Some(&self.ordering))
    }

    /// [A J^T; R 0] with the rows that carry J; both dense, R may differ in its columns.
    pub fn kkt_of(&self, a: &DMatrix<f64>, jacobian: &DMatrix<f64>, right: &DMatrix<f64>) -> Result<Kkt> {
        let kept = self.rows.select_dense(jacobian, Asked::All);
        Kkt::with_columns(a, &jacobian.transpose(), right, kept)
    }

    fn evaluated(&self, m: &Motion<f64>, counts: &mut Counts) -> Result<Evaluation> {
        counts.add("force evaluations", 1);
        let placement = self.place(m);
        let scene = self.scene(m, &placement, None);
        let h = scene.residual(None);
        self.check_forces(&h)?;
        let (mut jacobian, mut gamma) = (self.matrix(0), DVector::zeros(0));
        if self.constrained() {
            counts.add("multiplier solutions", 1);
            jacobian = self.matrix(self.n_rows());
            scene.constraints_into(&mut jacobian);
            gamma = scene.row_bias(&scene.carried_accelerations()) + self.explicit_rates(m).1;
        }
        Ok(Evaluation { mass: self.mass_of(&scene), h, jacobian, gamma })
    }

    /// Which rows say where things are.
    pub(super) fn position_rows(&self) -> Vec<bool> {
        self.topology().rows.iter().map(|r| r.level == Level::Position).collect()
    }

    /// The largest of scaled rows, and which.
    pub fn worst_row(&self, rows: &DVector<f64>) -> (f64, usize) {
        let scaled = rows.iter().zip(self.row_scales()).map(|(v, s)| (v * s).abs());
        scaled.enumerate().fold((0.0, 0), |worst, (i, v)| if v > worst.0 || v.is_nan() { (v, i) } else { worst })
    }

    /// Close the position rows that carry their rank; those that are redundant must follow.
    pub fn close(&self, m: &mut Motion<f64>, counts: &mut Counts) -> Result<()> {
        if !self.position_rows().contains(&true) {
            return Ok(());
        }
        let mut last = f64::INFINITY;
        for step in 0..=CLOSING_STEPS {
            let placement = self.place(m);
            let scene = self.scene(m, &placement, None);
            let mut jacobian = self.matrix(self.n_rows());
            let phi = scene.constraints_into(&mut jacobian);
            let kept = self.rows.select(&jacobian, Asked::Position);
            let mut open = DVector::zeros(phi.len());
            kept.iter().for_each(|i| open[*i] = phi[*i]);
            let (size, worst) = self.worst_row(&open);
            let done = size > 0.5 * last || step == CLOSING_STEPS;
            if size <= CLOSED || size <= CLOSED_ENOUGH && done {
                return self.check_redundant(&phi);
            }
            if !size.is_finite() || size > 1e3 || step == CLOSING_STEPS {
                return Err(self.open(worst, size));
            }
            last = size;
            counts.add("position projections", 1);
            counts.add("mass factorisations", 1);
            let mass = self.mass_of(&scene);
            self.check_mass(&mass)?;
            let change = self.kkt(&mass, &jacobian, kept)?.solve_one(&DVector::zeros(self.n()), &-open)?.0;
            advance(self.topology(), &mut m.q, change.as_slice());
        }
        Ok(())
    }

    /// Redundant rows that part from the others: the mechanism has left the motion for which they are redundant.
    fn check_redundant(&self, phi: &DVector<f64>) -> Result<()> {
        let limit = REDUNDANT_OPEN * self.system.tolerance;
        for block in self.rows.blocks.iter().filter(|b| b.is_redundant()) {
            let parted = |i: &&usize| (phi[**i] * self.rows.row_scale[**i]).abs() > limit;
            if let Some(row) = block.rows[..block.n_position].iter().find(parted) {
                return Err(self.open(*row, (phi[*row] * self.rows.row_scale[*row]).abs()));
            }
        }
        Ok(())
    }

    pub(super) fn open(&self, row: usize, size: f64) -> Error {
        let topology = self.topology();
        let name = topology.row_name(row);
        Error::Convergence {
            message: format!("'{name}' stays open by {size:.2e} characteristic lengths or radians"),
            best: Vec::new(),
            residual: size,
        }
    }

    /// [M J^T; J 0] at a motion.
    pub(super) fn saddle_at(&self, m: &Motion<f64>, counts: &mut Counts) -> Result<Kkt> {
        let placement = self.place(m);
        let scene = self.scene(m, &placement, None);
        let mut jacobian = self.matrix(self.n_rows());
        scene.constraints_into(&mut jacobian);
        self.saddle(&self.mass_of(&scene), &jacobian, counts)
    }

    /// The same, with the factors that the accelerations need as well.
    fn aligned(&self, m: &mut Motion<f64>, counts: &mut Counts) -> Result<Kkt> {
        counts.add("velocity projections", 1);
        let placement = self.place(m);
        let scene = self.scene(m, &placement, None);
        let mut jacobian = self.matrix(self.n_rows());
        scene.constraints_into(&mut jacobian);
        let saddle = self.saddle(&self.mass_of(&scene), &jacobian, counts)?;
        let miss = -(jacobian.times(&m.rate) + self.explicit_rates(m).0);
        let step = saddle.solve_one(&DVector::zeros(self.n()), &miss)?.0;
        for (rate, step) in m.rate.iter_mut().zip(step.iter()) {
            *rate += step;
        }
        Ok(saddle)
    }

    /// Accelerations and multipliers of a consistent motion.
    pub fn instant(&self, motion: Motion<f64>, counts: &mut Counts) -> Result<Instant> {
        if let Some(a) = self.tree_accelerations(&motion, counts)? {
            return Ok(self.joined(motion, &DVector::from_vec(a), &DVector::zeros(0)));
        }
        let now = self.evaluated(&motion, counts)?;
        let saddle = self.saddle(&now.mass, &now.jacobian, counts)?;
        let (a, lam) = saddle.solve_one(&-now.h, &-now.gamma)?;
        Ok(self.joined(motion, &a, &lam))
    }

    /// Does the recursion over the tree serve: no row acts, and nothing is flexible?
    fn is_rigid_tree(&self) -> bool {
        !self.constrained() && !self.topology().is_flexible()
    }

    /// x with M x = f by the recursion over the tree; None where it cannot serve.
    pub fn tree_solution(&self, motion: &Motion<f64>, f: &[f64]) -> Option<Vec<f64>> {
        let solved = |placement| articulated::solve(&self.scene(motion, &placement, None).inertia(false), f);
        self.is_rigid_tree().then(|| self.place(motion)).and_then(solved)
    }

    /// Where no row acts and nothing is flexible: the recursion over the tree. None where it cannot serve.
    fn tree_accelerations(&self, motion: &Motion<f64>, counts: &mut Counts) -> Result<Option<Vec<f64>>> {
        if !self.is_rigid_tree() {
            return Ok(None);
        }
        let placement = self.place(motion);
        let scene = self.scene(motion, &placement, None);
        let h = scene.residual(None);
        self.check_forces(&h)?;
        let made = articulated::solve(&scene.inertia(false), (-h).as_slice());
        if made.is_some() {
            counts.add("force evaluations", 1);
            counts.add("tree recursions", 1);
        }
        Ok(made)
    }

    /// Rows of effects that are left out were not solved for: their multipliers are zero.
    fn joined(&self, motion: Motion<f64>, a: &DVector<f64>, lam: &DVector<f64>) -> Instant {
        let mut lam = lam.as_slice().to_vec();
        lam.resize(self.n_rows(), 0.0);
        Instant { motion, acceleration: a.as_slice().to_vec(), lam }
    }

    /// Closed, aligned, with accelerations: one factorisation for rates and accelerations.
    pub fn consistent(&self, mut m: Motion<f64>, counts: &mut Counts) -> Result<Instant> {
        if !self.constrained() {
            return self.instant(m, counts);
        }
        self.close(&mut m, counts)?;
        let saddle = self.aligned(&mut m, counts)?;
        let now = self.evaluated(&m, counts)?;
        let (a, lam) = saddle.solve_one(&-now.h, &-now.gamma)?;
        Ok(self.joined(m, &a, &lam))
    }

    /// Near a singular pose a step may close on another branch than the one it arrives on; there rates turn at once by far more
    /// than a step errs.
    pub fn same_branch(&self, before: &[f64], end: &Instant, h: f64) -> Result<()> {
        if !self.constrained() {
            return Ok(());
        }
        let scales = self.scales();
        let size = |v: &[f64]| scaled_size(v, &scales);
        let change = before.iter().zip(&end.motion.rate).map(|(a, b)| b - a);
        let turned = size(&change.collect::<Vec<f64>>());
        let all = size(before).max(h * size(&end.acceleration));
        if turned <= BRANCH * all || h * turned <= CLOSED_ENOUGH {
            return Ok(());
        }
        Err(Error::Convergence {
            message: format!("the loops turn all rates at once at t = {:.9} s", end.motion.t),
            best: Vec::new(),
            residual: turned,
        })
    }

    /// What position, velocity and acceleration rows leave over, scaled by the characteristic length.
    pub fn residuals(&self, m: &Motion<f64>, a: &[f64]) -> [f64; 3] {
        if self.n_rows() == 0 {
            return [0.0; 3];
        }
        let (phi, jacobian) = self.row_matrix(m);
        let rates = jacobian.times(&m.rate) + self.explicit_rates(m).0;
        let accelerations = jacobian.times(a) + self.row_bias(m);
        [phi, rates, accelerations].map(|r| self.worst_row(&r).0)
    }

    pub(super) fn check_forces(&self, h: &DVector<f64>) -> Result<()> {
        match h.iter().position(|v| !v.is_finite()) {
            None => Ok(()),
            Some(i) => Err(Error::Convergence {
                message: format!("the force along '{}' is not a number", self.topology().names[i]),
                best: Vec::new(),
                residual: f64::NAN,
            }),
        }
    }
}
