//! Between the start and the end of a step of Radau's method.
//!
//! Outputs lie on `refine`'s curve, of which what is fast beside the step is left as the stages have it: accelerations at points of a
//! curve that is a little off differ by its error times the stiffness, and pass the filter of the estimate. Where a fast motion dies out
//! within a small part of the step, no such curve through its start is right, and the polynomial through the stages alone is taken; what
//! neither follows, `misfit` tells, and the step ends at the output.
use crate::error::Result;
use crate::run::Counts;
use crate::tolerances::steps::SHARE_OF_TOLERANCE;

use super::super::interpolate::inside;
use super::super::refine::{Basis, Between, Curve, Ends, Node, SIX, TWO, evaluated};
use super::super::{Equations, Instant, LocalError, Motion, Scheme, Step, scaled_size};
use super::numbers::{lagrange, lagrange_slopes};
use super::{Past, Radau, Trial};

fn differences(a: &[f64], b: &[f64]) -> Vec<f64> {
    a.iter().zip(b).map(|(a, b)| a - b).collect()
}

impl Radau {
    /// Those of the last stages of this step and of the one before, in place of those of projected instants, which hold the vibration
    /// that steps go over.
    pub(super) fn end_accelerations(&self, from: &Instant, step: &Step) -> (Vec<f64>, Vec<f64>) {
        let last = |p: &Past| p.stages.a.last().map(|a| a.as_slice().to_vec());
        let before = self.past.as_ref().filter(|p| p.t == from.motion.t).and_then(last);
        let own = self.tried.as_ref().and_then(last);
        (before.unwrap_or_else(|| from.acceleration.clone()), own.unwrap_or_else(|| step.end.acceleration.clone()))
    }

    pub(super) fn outputs_within(
        &mut self,
        eq: &Equations<'_, f64>,
        from: &Instant,
        step: &Step,
        h: f64,
        fractions: &[f64],
        counts: &mut Counts,
    ) -> Result<Vec<Between>> {
        let (basis, passes): (&Basis, _) = if self.tableau.stages() == 3 { (&TWO, 1) } else { (&SIX, 3) };
        let nodes = basis.nodes;
        let motions = self.between(eq, from, step, h, nodes, counts)?;
        let theta = eq.difference(&from.motion, &step.end.motion);
        let (start, end) = self.end_accelerations(from, step);
        let (from, to) = (&from.motion, &step.end.motion);
        let ends = Ends { from, to, h, theta: &theta, accelerations: (&start, &end) };
        let mut guess = self.by_stages(eq, from, h, nodes, motions);
        let (mut curve, mut off) = (None, 0.0);
        for _ in 0..passes {
            let mut inner = evaluated(eq, guess.iter().map(|n| &n.motion), counts)?;
            off = self.worst_misfit(eq, h, &inner, &guess)?;
            for (node, guess) in inner.iter_mut().zip(&guess) {
                let damped = self.damped(&differences(&node.acceleration, &guess.acceleration))?;
                node.acceleration = guess.acceleration.iter().zip(damped).map(|(s, d)| s + d).collect();
                let c = h / self.tableau.real.mu;
                let damped = eq.filtered_states(&node.motion, &differences(&node.state_rates, &guess.state_rates), c);
                node.state_rates = guess.state_rates.iter().zip(damped).map(|(s, d)| s + d / c).collect();
            }
            let next = Curve::through(eq, &ends, basis, &inner);
            guess = nodes.iter().map(|x| next.at(eq, *x)).collect();
            curve = Some(next);
        }
        if off > self.solved / SHARE_OF_TOLERANCE {
            let other = self.through_stage_values(eq, from, to, h, nodes);
            let there = evaluated(eq, other.iter().map(|n| &n.motion), counts)?;
            if self.worst_misfit(eq, h, &there, &other)? < off {
                return Ok(with_slopes(self.through_stage_values(eq, from, to, h, fractions)));
            }
        }
        let Some(curve) = curve else { return Ok(Vec::new()) };
        Ok(with_slopes(fractions.iter().map(|x| curve.at(eq, *x)).collect()))
    }

    /// Motions with the slopes of the polynomials through the rates of the stages, and states on the one through theirs and the start.
    fn by_stages(
        &self,
        eq: &Equations<'_, f64>,
        from: &Motion<f64>,
        h: f64,
        nodes: &[f64],
        motions: Vec<Motion<f64>>,
    ) -> Vec<Node> {
        let with = |(motion, x): (Motion<f64>, &f64)| {
            let mut node = Node { motion, acceleration: self.stage_slope(*x), state_rates: Vec::new() };
            self.set_stage_states(eq, Some(from), h, *x, &mut node);
            node
        };
        motions.into_iter().zip(nodes).map(with).collect()
    }

    /// Of the polynomial through the rates of the stages.
    fn stage_slope(&self, x: f64) -> Vec<f64> {
        let stages = self.tried.iter().flat_map(|own| &own.stages.a);
        lagrange(self.tableau.c, x).iter().zip(stages).fold(Vec::new(), |sum, (w, a)| {
            let before = sum.into_iter().chain(std::iter::repeat(0.0));
            a.iter().zip(before).map(|(a, s)| s + w * a).collect()
        })
    }

    /// The largest over some nodes, as a step is measured.
    fn worst_misfit(&self, eq: &Equations<'_, f64>, h: f64, there: &[Node], guess: &[Node]) -> Result<f64> {
        let scales = eq.scales();
        let mut worst = 0.0_f64;
        for (node, guess) in there.iter().zip(guess) {
            let error = self.misfit_of(h, &differences(&node.acceleration, &guess.acceleration), true)?;
            let rate = scaled_size(&error.rate, &scales) / self.speed.max(f64::MIN_POSITIVE);
            worst = worst.max(rate).max(scaled_size(&error.position, &scales));
        }
        Ok(worst)
    }

    fn damped(&self, difference: &[f64]) -> Result<Vec<f64>> {
        self.linear.as_ref().map_or_else(|| Ok(difference.to_vec()), |l| l.damped(difference))
    }

    /// What the difference of accelerations means in motions: one of it lasts for a part of the step.
    pub(super) fn misfit_of(&self, h: f64, difference: &[f64], filtered: bool) -> Result<LocalError> {
        let c = h / self.tableau.real.mu;
        let left = if filtered { self.damped(difference)? } else { difference.to_vec() };
        let times = |f: f64| left.iter().map(|d| f * d).collect();
        Ok(LocalError { position: times(c * c), rate: times(c), state: Vec::new() })
    }

    /// Between start and end where what the step begins with dies out within a small part of it: theta' is the polynomial through those
    /// of the stages alone, which do not feel it. With the slopes of the rates.
    fn through_stage_values(
        &self,
        eq: &Equations<'_, f64>,
        from: &Motion<f64>,
        to: &Motion<f64>,
        h: f64,
        fractions: &[f64],
    ) -> Vec<Node> {
        let Some(own) = &self.tried else { return Vec::new() };
        let (c, trial) = (self.tableau.c, &own.trial);
        let turned = |(theta, m): (&Vec<f64>, &Motion<f64>)| eq.increment_rates(theta, &m.rate);
        let turned: Vec<Vec<f64>> = trial.theta.iter().zip(&trial.motions).map(turned).collect();
        let projected = eq.difference(&trial.motions[c.len() - 1], to);
        let sum = |weights: &[f64], v: &dyn Fn(usize) -> f64| weights.iter().enumerate().map(|(i, w)| w * v(i)).sum();
        let one = |x: &f64| {
            let (whole, here, ahead) = (self.tableau.integrals(*x), lagrange(c, *x), lagrange_slopes(c, *x));
            let along = |k: usize| h * sum(&whole, &|i| turned[i][k]) + x * projected[k];
            let mut motion = from.moved(eq.topology(), &(0..eq.n()).map(along).collect::<Vec<f64>>());
            motion.t += x * h;
            motion.rate = (0..eq.n()).map(|k| sum(&here, &|i| trial.motions[i].rate[k])).collect();
            let acceleration = (0..eq.n()).map(|k| sum(&ahead, &|i| trial.motions[i].rate[k] / h)).collect();
            let mut node = Node { motion, acceleration, state_rates: Vec::new() };
            self.set_stage_states(eq, None, h, *x, &mut node);
            node
        };
        fractions.iter().map(one).collect()
    }

    /// States of laws on the polynomial through those of the stages, and of the start where that counts.
    fn set_stage_states(&self, eq: &Equations<'_, f64>, start: Option<&Motion<f64>>, h: f64, x: f64, node: &mut Node) {
        let Some(own) = self.tried.as_ref().filter(|_| eq.has_state_rates()) else { return };
        let stages = self.tableau.c.iter().copied().zip(&own.trial.motions);
        let all = start.map(|m| (0.0, m)).into_iter().chain(stages);
        let (places, states): (Vec<f64>, Vec<_>) = all.map(|(x, m)| (x, eq.states(m))).unzip();
        let sum = |weights: Vec<f64>| {
            let mut z = vec![0.0; states[0].len()];
            for (w, own) in weights.iter().zip(&states) {
                z.iter_mut().zip(own).for_each(|(z, own)| *z += w * own);
            }
            z
        };
        eq.set_states(&mut node.motion, &sum(lagrange(&places, x)), 0.0);
        node.state_rates = sum(lagrange_slopes(&places, x).into_iter().map(|w| w / h).collect());
    }

    /// Between start and end: theta' is the polynomial through those of the start and of all stages, of degree s; the cubic of what the
    /// projection moved is added.
    pub(super) fn through_stages(
        &self,
        eq: &Equations<'_, f64>,
        from: &Instant,
        to: &Instant,
        (h, trial): (f64, &Trial),
        fractions: &[f64],
    ) -> Vec<Motion<f64>> {
        let slope = |(theta, m): (&Vec<f64>, &Motion<f64>)| eq.increment_rates(theta, &m.rate);
        let stages = trial.theta.iter().zip(&trial.motions).map(slope);
        let slopes: Vec<Vec<f64>> = std::iter::once(from.motion.rate.clone()).chain(stages).collect();
        let end = eq.difference(&from.motion, &to.motion);
        let speed = eq.increment_rates(&end, &to.motion.rate);
        let ((moved, _), last) = (self.tableau.curve(1.0, h, &slopes), &slopes[slopes.len() - 1]);
        let curve = |x: f64| {
            let (mut theta, mut rate) = self.tableau.curve(x, h, &slopes);
            for i in 0..theta.len() {
                let (r, d) = (end[i] - moved[i], h * (speed[i] - last[i]));
                theta[i] += x * x * (r * (3.0 - 2.0 * x) + d * (x - 1.0));
                rate[i] += x * (6.0 * r * (1.0 - x) + d * (3.0 * x - 2.0)) / h;
            }
            (theta, rate)
        };
        inside(eq, from, to, (h, fractions), &curve)
    }
}

fn with_slopes(nodes: Vec<Node>) -> Vec<Between> {
    nodes.into_iter().map(|n| Between { motion: n.motion, slope: Some(n.acceleration) }).collect()
}
