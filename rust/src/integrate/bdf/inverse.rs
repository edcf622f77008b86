//! The equations of a step without any tangent, by inverse quasi-Newton updates: the derivative-free multibody solver of
//! J. Algorithms & Comput. Technol. (2017), doi 10.1177/1748301817729990.
//!
//! Positions and velocities of the rows are equations of the step (`equations`); the inverse goes on from step to step
//! (`inverse_updates`). Fixed steps start the iteration at the Taylor polynomial of second order, as the source does; with a
//! tolerance it starts where the differences foresee the point.
use nalgebra::DVector;

use crate::error::Result;
use crate::linalg::kkt::Kkt;
use crate::linalg::rows::Level as Asked;
use crate::run::Counts;
use crate::solve::inverse::Family;

use super::super::{Equations, Instant, LocalError, Motion};
use super::equations::{BdfStep, Form, Guess, Sizes};
use super::inverse_updates::StepSolver;
use super::{Ahead, Corrector, Trial};
use crate::tolerances::steps::FIXED_SOLVED;

/// A difference of high order sums values with weights up to this: what it may show of the norm that the equations of a step are
/// left with.
const UNSOLVED: f64 = 32.0;

pub struct Inverse {
    form: Form,
    /// the steps are held to a tolerance
    controlled: bool,
    solver: StepSolver,
    sizes: Option<Sizes>,
    /// multipliers of the kept rows at the end of the last step that was solved
    lam: Option<(f64, Vec<f64>)>,
}

impl Inverse {
    pub fn new(form: Form, family: Option<Family>, rtol: Option<f64>) -> Self {
        let solver = StepSolver::new(family, rtol);
        Inverse { form, controlled: rtol.is_some(), solver, sizes: None, lam: None }
    }

    fn sizes(&mut self, eq: &Equations<'_, f64>, m: &Motion<f64>) -> Sizes {
        let make = || {
            let jacobian = eq.rows(m).1;
            let kept = eq.rows.select_dense(&jacobian, Asked::All);
            Sizes::new(eq, &eq.mass(m), kept)
        };
        self.sizes.get_or_insert_with(make).clone()
    }

    /// Multipliers of the kept rows at an instant.
    fn multipliers(&self, eq: &Equations<'_, f64>, from: &Instant, sizes: &Sizes) -> Result<Vec<f64>> {
        if let Some((t, lam)) = &self.lam
            && *t == from.motion.t
        {
            return Ok(lam.clone());
        }
        if sizes.kept.is_empty() {
            return Ok(Vec::new());
        }
        let jacobian = eq.rows(&from.motion).1;
        let load = jacobian.transpose() * DVector::from_column_slice(&from.lam);
        // M x + J_k^T lam_k = J^T lam with J_k x = 0: x vanishes, the kept rows carry what all carried
        let mass = eq.mass(&from.motion);
        let saddle = Kkt::with_columns(&mass, &jacobian.transpose(), &jacobian, sizes.kept.clone())?;
        let (_, lam) = saddle.solve_one(&load, &DVector::zeros(eq.n_rows()))?;
        Ok(sizes.kept.iter().map(|i| lam[*i]).collect())
    }

    /// Where the iteration starts.
    fn first(&self, eq: &Equations<'_, f64>, ahead: &Ahead<'_>, lam: Vec<f64>) -> Guess {
        if self.controlled {
            return Guess { theta: ahead.guess.y.clone(), rate: ahead.guess.v.clone(), lam };
        }
        let (h, v, a) = (ahead.h, &ahead.from.motion.rate, &ahead.from.acceleration);
        let moved: Vec<f64> = v.iter().zip(a).map(|(v, a)| h * v + 0.5 * h * h * a).collect();
        let moved = eq.increment_rates(ahead.last, &moved);
        Guess {
            theta: ahead.last.iter().zip(moved).map(|(y, m)| y + m).collect(),
            rate: v.iter().zip(a).map(|(v, a)| v + h * a).collect(),
            lam,
        }
    }
}

/// What a fixed step errs in its rates, in the units of the unknowns, as long as that adds up to no more than its positions err: what
/// equations are left with enters rates as it is and adds up over the run, where fast decays forget the errors of their steps.
fn rate_error(ahead: &Ahead<'_>, sizes: &Sizes) -> f64 {
    let Some((difference, factor)) = ahead.error else { return 0.0 };
    let largest =
        |errors: &[f64]| errors.iter().zip(&sizes.sigma).fold(0.0_f64, |a, (e, s)| a.max((factor * e / s).abs()));
    ahead.c * largest(&difference.v).min(largest(&difference.y) / ahead.time)
}

impl Corrector for Inverse {
    fn solve(&mut self, eq: &Equations<'_, f64>, ahead: &Ahead<'_>, counts: &mut Counts) -> Result<Trial> {
        let sizes = self.sizes(eq, &ahead.from.motion);
        let lam = self.multipliers(eq, ahead.from, &sizes)?;
        let guess = self.first(eq, ahead, lam);
        let n = sizes.unknowns(self.form);
        let past = |psi: &[f64], guess: &[f64]| psi.iter().zip(guess).map(|(p, g)| (p - g) / ahead.c).collect();
        let mut base = ahead.chart.clone();
        base.memory.clone_from(&ahead.from.motion.memory);
        let mut step = BdfStep {
            eq,
            form: self.form,
            sizes: &sizes,
            base: &base,
            t: ahead.t,
            g: ahead.c,
            theta_past: past(&ahead.psi.y, &ahead.guess.y),
            rate_past: past(&ahead.psi.v, &ahead.guess.v),
            state_base: ahead.state_base(),
            moved: guess.theta.iter().zip(ahead.last).map(|(y, last)| y - last).collect(),
            rate_error: if self.controlled { 0.0 } else { rate_error(ahead, &sizes) },
            guess,
            row_factor: vec![1.0; n],
            counts,
        };
        let x = self.solver.solve(&mut step, n)?;
        let at = step.meaning(&x);
        let lam = step.all_rows(&at.lam);
        self.lam = Some((ahead.t, at.lam));
        // what the equations leave unsolved says nothing about the length of the step
        let unsolved = UNSOLVED * self.solver.reached;
        Ok(Trial {
            motion: at.motion,
            y: at.theta,
            lam,
            unsolved: Some(LocalError {
                position: sizes.sigma.iter().map(|s| unsolved * s).collect(),
                rate: sizes.sigma.iter().map(|s| unsolved * s / ahead.c).collect(),
                state: vec![0.0; ahead.guess.z.len()],
            }),
        })
    }

    fn rounding(&self) -> f64 {
        FIXED_SOLVED
    }

    fn per_unit_step(&self) -> bool {
        self.controlled
    }

    /// An inverse that goes on from step to step belongs to small increments.
    fn widest_chart(&self) -> f64 {
        0.0
    }

    fn reset(&mut self) {
        self.lam = None;
    }

    fn remark(&self) -> Option<String> {
        self.solver.remark()
    }
}
