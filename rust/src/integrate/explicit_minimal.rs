//! Motion in independent coordinates of closed loops, which may change from step to step.
//!
//! ```text
//! Phi(q_d, q_i, t) = 0                      dependent positions: Newton's method
//! J_d v_d = -Phi_t - J_i v_i                dependent rates: one linear solution
//! B^T M B a_i = -B^T (h + M g)              B = [-J_d^-1 J_i; 1],  g = [-J_d^-1 gamma; 0],  a = B a_i + g
//! ```
//! Increments are counted from the start of the step, so that three rotations that act together are split in the tangent space
//! there: dPhi/dtheta = J J_l(theta). The choice of `explicit_pivots` is kept while its pivots are the largest entries of their
//! rows but for a factor; what a step begins with are all positions and rates, so that a switch between steps changes nothing else.
use nalgebra::{DMatrix, DVector};

use crate::error::{Error, Result};
use crate::multibody::placement::{advance, place};
use crate::run::Counts;
use crate::tolerances::constraints::{CLOSED_ENOUGH, DOUBTFUL};

use super::explicit_pivots::{Factors, Plan};
use super::{Equations, Motion, scaled_size};
use crate::linalg::matrix::Matrix;
use crate::tolerances::steps::{CLOSED, SHARE_OF_TOLERANCE};

/// Another choice is taken where it has a pivot that is larger by this factor.
const WORN: f64 = 4.0;
const NEWTON_STEPS: usize = 12;
/// Sparse models: degrees of freedom times dependent coordinates, over rows and coordinates, up to which B is cheaper than multipliers.
const FEW: usize = 4;
/// Beyond so many tree coordinates the choice of pivots and the fill of their elimination cost more than multipliers of all loops
/// (measured on rows of four-bars: a fifth less time for 40 of them, as much for 100, half as much again for 1000).
const LARGEST: usize = 150;
/// So many coordinates are named.
const SHOWN: usize = 6;

pub struct Minimal {
    plan: Option<Plan>,
    /// of J, for rates; and of dPhi/dtheta where that is another
    rates: Factors,
    places: Factors,
    worn: bool,
    /// of positions of stages
    tolerance: f64,
    switches: usize,
    names: String,
}

/// A pose on the constraints: increments from the start of the step, and the motion with rates along the constraints.
pub struct Settled {
    pub increment: Vec<f64>,
    pub motion: Motion<f64>,
    jacobian: Matrix,
}

impl Minimal {
    /// `rtol` of controlled steps.
    pub fn new(rtol: Option<f64>) -> Self {
        Minimal {
            plan: None,
            rates: Factors::default(),
            places: Factors::default(),
            worn: false,
            // accelerations miss by that over the square of the smallest pivot
            tolerance: rtol.map_or(CLOSED, |r| SHARE_OF_TOLERANCE * r),
            switches: 0,
            names: String::new(),
        }
    }

    /// Before a step: a choice that serves.
    pub fn choose(&mut self, eq: &Equations<'_, f64>, from: &Motion<f64>, counts: &mut Counts) -> Result<()> {
        if self.plan.is_some() && !self.worn {
            return Ok(());
        }
        counts.add("coordinate choices", 1);
        let jacobian = eq.row_matrix(from).1;
        let plan = Plan::choose(eq, &jacobian);
        if self.plan.as_ref().is_some_and(|old| !old.agrees(&plan)) {
            counts.add("coordinate switches", 1);
            self.switches += 1;
        }
        plan.factor(&jacobian, &mut self.rates)?;
        self.names = shown(&plan, &eq.topology().names);
        self.plan = Some(plan);
        self.worn = false;
        Ok(())
    }

    /// Do the rows decide the dependent coordinates here by more than a drawing may be off? If not another choice has to be made later.
    pub fn decides(&mut self, eq: &Equations<'_, f64>) -> bool {
        let lost = self.plan.as_ref().is_some_and(|plan| plan.pivots.len() < plan.n_rows);
        let singular = lost || self.rates.least <= DOUBTFUL * eq.system.tolerance;
        self.worn |= singular;
        !singular
    }

    /// Dependent positions and rates, from all coordinates as the stages before foretell them: increments from the start of the step,
    /// and rates. To the accuracy of a stage; or, at the `end` of a step, to rounding, where all rows must be met, and where it is
    /// seen whether the choice still serves.
    pub fn settle(
        &mut self,
        eq: &Equations<'_, f64>,
        from: &Motion<f64>,
        t: f64,
        (y, rate): (Vec<f64>, Vec<f64>),
        end: bool,
        counts: &mut Counts,
    ) -> Result<Settled> {
        let found = self.settled(eq, from, t, (y, rate), end, counts);
        if end {
            self.worn |= found.is_err() || self.rates.worn > WORN;
        }
        found
    }

    fn settled(
        &mut self,
        eq: &Equations<'_, f64>,
        from: &Motion<f64>,
        t: f64,
        (mut y, mut rate): (Vec<f64>, Vec<f64>),
        end: bool,
        counts: &mut Counts,
    ) -> Result<Settled> {
        let plan = self.plan.as_ref().ok_or_else(no_choice)?;
        let tolerance = |least: f64| match end {
            true => CLOSED,
            false => (self.tolerance * least * least).max(CLOSED),
        };
        let scales = eq.scales();
        let (mut m, mut last, mut left) = (from.moved(eq.topology(), &y), f64::INFINITY, NEWTON_STEPS);
        m.t = t;
        let jacobian = loop {
            left -= 1;
            let (phi, jacobian) = rows_at(eq, &m);
            counts.add("row evaluations", 1);
            plan.factor(&jacobian, &mut self.rates)?;
            if plan.n_position == 0 {
                break jacobian;
            }
            let maps = eq.rotation_maps(&y);
            let mut places = &self.rates;
            if !maps.is_empty() {
                let mut turned = jacobian.clone();
                turned.turn_columns(&maps);
                plan.factor(&turned, &mut self.places)?;
                places = &self.places;
            }
            let mut d = vec![0.0; eq.n()];
            plan.depend(places, Some((-&phi).as_slice()), &mut d, plan.n_position);
            let size = scaled_size(&d, &scales);
            let (open, worst) = eq.worst_row(&plan.carried(&phi));
            // what rounding leaves of a row is larger by the pivot in the coordinate
            let rounding = size <= CLOSED_ENOUGH || open <= CLOSED;
            let lost = left == 0 || size > last && !rounding;
            if !size.is_finite() || size > 1.0 || lost {
                return Err(eq.open(worst, open));
            }
            y.iter_mut().zip(&d).for_each(|(y, d)| *y += d);
            m.q.clone_from(&from.q);
            advance(eq.topology(), &mut m.q, &y);
            if size <= tolerance(self.rates.least) || rounding && size > 0.5 * last {
                if end && open > CLOSED_ENOUGH {
                    return Err(eq.open(worst, open));
                }
                break jacobian;
            }
            last = size;
        };
        let explicit = -eq.explicit_rates(&m).0;
        plan.depend(&self.rates, Some(explicit.as_slice()), &mut rate, plan.pivots.len());
        m.rate = rate;
        Ok(Settled { increment: y, motion: m, jacobian })
    }

    /// What follows from changes of independent increments and rates at the last pose.
    pub fn follow(&self, y: &mut [f64], v: &mut [f64]) {
        if let Some(plan) = &self.plan {
            plan.depend(&self.rates, None, y, plan.n_position);
            plan.depend(&self.rates, None, v, plan.pivots.len());
        }
    }

    /// Are B and M so small, or B so narrow, that they are cheaper than the multipliers?
    fn narrow(&self, eq: &Equations<'_, f64>) -> bool {
        let wide = |p: &Plan| p.independent.len() * p.pivots.len() > FEW * (eq.n() + eq.n_rows());
        !eq.sparse || !self.plan.as_ref().is_none_or(wide)
    }

    /// Large models with few degrees of freedom: stages in independent coordinates are cheaper than multipliers of all loops. In small ones
    /// they are not, since positions have to be closed in every stage.
    pub fn pays(eq: &Equations<'_, f64>, at: &Motion<f64>) -> bool {
        if !eq.sparse || !eq.constrained() || eq.n() > LARGEST {
            return false;
        }
        let mut trial = Minimal::new(None);
        trial.choose(eq, at, &mut Counts::default()).is_ok() && trial.narrow(eq)
    }

    /// Accelerations of all coordinates at the pose that was settled last.
    pub fn accelerations(&self, eq: &Equations<'_, f64>, at: &Settled, counts: &mut Counts) -> Result<Vec<f64>> {
        let plan = self.plan.as_ref().ok_or_else(no_choice)?;
        counts.add("force evaluations", 1);
        counts.add("multiplier solutions", 1);
        let placement = eq.place(&at.motion);
        let scene = eq.scene(&at.motion, &placement, None);
        let h = scene.residual(None);
        eq.check_forces(&h)?;
        let gamma = scene.row_bias(&scene.carried_accelerations()) + eq.explicit_rates(&at.motion).1;
        let mass = eq.mass_of(&scene);
        let (n, f, r) = (eq.n(), plan.independent.len(), plan.pivots.len());
        if !self.narrow(eq) {
            let saddle = eq.saddle(&mass, &at.jacobian, counts)?;
            return Ok(saddle.solve_one(&-h, &-gamma)?.0.as_slice().to_vec());
        }
        let mut g = DVector::zeros(n);
        plan.depend(&self.rates, Some((-gamma).as_slice()), g.as_mut_slice(), r);
        if f == 0 {
            return Ok(g.as_slice().to_vec());
        }
        let mut basis = DMatrix::zeros(n, f);
        for (k, c) in plan.independent.iter().enumerate() {
            basis[(*c, k)] = 1.0;
            let column = &mut basis.as_mut_slice()[k * n..(k + 1) * n];
            plan.depend(&self.rates, None, column, r);
        }
        counts.add("reduced factorisations", 1);
        let right = -basis.tr_mul(&(h + mass.times(g.as_slice())));
        let reduced = basis.tr_mul(&times_columns(&mass, &basis));
        let free = reduced.cholesky().ok_or_else(weightless)?.solve(&right);
        Ok((basis * free + g).as_slice().to_vec())
    }

    /// What a reader should know of the choice.
    pub fn remark(&self) -> Option<String> {
        let counted = match self.switches {
            1 => "1 switch".to_string(),
            n => format!("{n} switches"),
        };
        self.plan.as_ref()?;
        Some(format!("independent coordinates: {}, {counted}", self.names))
    }
}

/// Coordinates by name, unless they are many.
fn shown(plan: &Plan, names: &[String]) -> String {
    let of: Vec<&str> = plan.independent.iter().map(|i| names[*i].as_str()).collect();
    match of.len() {
        0 => "none".into(),
        1..=SHOWN => format!("'{}'", of.join("', '")),
        n => format!("{n} of {}", names.len()),
    }
}

fn no_choice() -> Error {
    Error::singular("no independent coordinates were chosen")
}

fn weightless() -> Error {
    Error::singular("the equations of motion are singular here: a motion without inertia")
}

/// Phi and J at a pose, without rates.
fn rows_at(eq: &Equations<'_, f64>, m: &Motion<f64>) -> (DVector<f64>, Matrix) {
    let placement = place(eq.topology(), &eq.geometry, &m.q, None);
    let mut jacobian = eq.matrix(eq.n_rows());
    let phi = eq.scene(m, &placement, None).constraints_into(&mut jacobian);
    (phi, jacobian)
}

fn times_columns(mass: &Matrix, basis: &DMatrix<f64>) -> DMatrix<f64> {
    if let Matrix::Dense(mass) = mass {
        return mass * basis;
    }
    let mut out = DMatrix::zeros(basis.nrows(), basis.ncols());
    for k in 0..basis.ncols() {
        let column = basis.column(k);
        mass.each(|i, j, v| out[(i, k)] += v * column[j]);
    }
    out
}
