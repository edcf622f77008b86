//! Explicit motion of order eight in joint increments (RKMK: theta' = J_l^-1(theta) omega), without any tangent, and in an open
//! tree without any multiplier. With loops, drives or rolling there are two ways:
//!
//! | `Coordinates` | stages | end of a step |
//! |---|---|---|
//! | `Tree` | all tree coordinates, constraints at acceleration level | closed and aligned by the smallest change in kinetic energy |
//! | `Independent` | independent coordinates, the others from the constraints (`explicit_minimal`) | the same |
//!
//! Both give the same errors in as many steps. Measured: independent coordinates take a fifth less time for ten and forty
//! four-bars, where few degrees of freedom spare many multipliers, and about as much to 1.7 times as much for single loops, whose
//! positions are closed by one to two more evaluations of the rows in each stage.
//!
//! Steps are controlled by the combined estimate of orders 5 and 3 of Hairer, Norsett, Wanner.
use crate::error::Result;
use crate::run::Counts;

use super::dop853_numbers::{A, B, C, D, E3, E5, Row, STAGES};
use super::explicit_minimal::Minimal;
use super::refine::{self, Between, FOUR};
use super::{Equations, Instant, LocalError, Motion, Scheme, Step};

/// The estimate exceeds that of order 5 at most by this factor.
const MOST: f64 = 10.0;

/// What the stages integrate where there are constraints.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Coordinates {
    Tree,
    Independent,
}

#[derive(Default)]
pub struct Explicit8 {
    /// slopes (theta', v') of the stages of the last step, and of its end
    slopes: Vec<Slope>,
    end: Option<Ends>,
    /// None: tree coordinates
    minimal: Option<Minimal>,
    /// where the last step began in a pose without rank, in tree coordinates
    aside: Option<Minimal>,
    /// tree coordinates, but stages are closed and aligned too
    careful: bool,
    /// stages of the last step in tree coordinates, where they are asked for
    record: Option<Vec<RecordedStage>>,
}

/// A stage: its increment from the start of the step, and its motion with accelerations and multipliers.
#[derive(Debug, Clone)]
pub struct RecordedStage {
    pub increment: Vec<f64>,
    pub at: Instant,
}

#[derive(Clone)]
struct Slope {
    y: Vec<f64>,
    v: Vec<f64>,
    /// of states of laws
    z: Vec<f64>,
}

/// What the last step changed.
struct Ends {
    dy: Vec<f64>,
    dv: Vec<f64>,
    dz: Vec<f64>,
}

fn weighted(slopes: &[Slope], row: Row, h: f64) -> (Vec<f64>, Vec<f64>, Vec<f64>) {
    let zeros = |of: &Vec<f64>| vec![0.0; of.len()];
    let (mut y, mut v, mut z) = (zeros(&slopes[0].y), zeros(&slopes[0].v), zeros(&slopes[0].z));
    for (stage, weight) in row {
        let slope = &slopes[*stage];
        for (sum, part) in [(&mut y, &slope.y), (&mut v, &slope.v), (&mut z, &slope.z)] {
            sum.iter_mut().zip(part).for_each(|(s, p)| *s += h * weight * p);
        }
    }
    (y, v, z)
}

fn trial(eq: &Equations<'_, f64>, from: &Motion<f64>, h: f64, y: &[f64], v: &[f64]) -> Motion<f64> {
    let mut m = from.moved(eq.topology(), y);
    m.t = from.t + h;
    for (rate, dv) in m.rate.iter_mut().zip(v) {
        *rate += dv;
    }
    m
}

impl Explicit8 {
    /// `rtol` of controlled steps.
    pub fn new(coordinates: Coordinates, rtol: Option<f64>) -> Self {
        Explicit8 {
            minimal: (coordinates == Coordinates::Independent).then(|| Minimal::new(rtol)),
            ..Explicit8::default()
        }
    }

    /// Keep the stages of each step.
    pub fn recording(self) -> Self {
        Explicit8 { record: Some(Vec::new()), ..self }
    }

    /// The stages of the last step.
    pub fn recorded(self) -> Vec<RecordedStage> {
        self.record.unwrap_or_default()
    }

    fn note(&mut self, increment: &[f64], at: &Instant) {
        if let Some(record) = &mut self.record {
            record.push(RecordedStage { increment: increment.to_vec(), at: at.clone() });
        }
    }

    /// One long step from one side of a singular pose to the other, for schemes whose own steps collapse there.
    pub fn across_singular_poses() -> Box<dyn Scheme> {
        Box::new(Explicit8 { careful: true, ..Explicit8::default() })
    }

    fn stage(
        &mut self,
        eq: &Equations<'_, f64>,
        from: &Motion<f64>,
        stage: usize,
        h: f64,
        counts: &mut Counts,
    ) -> Result<()> {
        let (y, v, z) = weighted(&self.slopes, A[stage], h);
        let from = &*eq.with_states(from, &z);
        if let Some(minimal) = &mut self.minimal {
            let rate = from.rate.iter().zip(&v).map(|(r, dv)| r + dv).collect();
            let at = minimal.settle(eq, from, from.t + C[stage] * h, (y, rate), false, counts)?;
            let v = minimal.accelerations(eq, &at, counts)?;
            let y = eq.increment_rates(&at.increment, &at.motion.rate);
            self.slopes.push(Slope { y, v, z: eq.state_rates(&at.motion) });
            return Ok(());
        }
        let m = trial(eq, from, C[stage] * h, &y, &v);
        if self.careful {
            let at = eq.consistent(m, counts)?;
            let y = eq.difference(from, &at.motion);
            let z = eq.state_rates(&at.motion);
            self.slopes.push(Slope { y: eq.increment_rates(&y, &at.motion.rate), v: at.acceleration, z });
            return Ok(());
        }
        let slope_y = eq.increment_rates(&y, &m.rate);
        let at = eq.instant(m, counts)?;
        self.note(&y, &at);
        self.slopes.push(Slope { y: slope_y, v: at.acceleration, z: eq.state_rates(&at.motion) });
        Ok(())
    }

    /// The end of a step on all constraints, and its increments from the start.
    fn ended(
        &mut self,
        eq: &Equations<'_, f64>,
        from: &Motion<f64>,
        h: f64,
        (y, v): (&[f64], &[f64]),
        counts: &mut Counts,
    ) -> Result<(Instant, Vec<f64>)> {
        let reached = trial(eq, from, h, y, v);
        let Some(minimal) = &mut self.minimal else {
            return Ok((eq.consistent(reached, counts)?, y.to_vec()));
        };
        let at = minimal.settle(eq, from, reached.t, (y.to_vec(), reached.rate), true, counts)?;
        Ok((eq.instant(at.motion, counts)?, at.increment))
    }
}

/// e5 |e5|/(0.1 |e3|): of the order of the method, from two estimates of low order (II.10 of the book takes less where e5 is the
/// larger one; there the estimate would fall with the sixth power of the step only).
fn combined(e5: Vec<f64>, e3: &[f64], scales: &[f64]) -> Vec<f64> {
    let size = |e: &[f64]| e.iter().zip(scales).map(|(v, c)| (v / c).powi(2)).sum::<f64>().sqrt();
    let (five, three) = (size(&e5), size(e3));
    let factor = if five > 0.0 { (five / (0.1 * three)).min(MOST) } else { 0.0 };
    e5.iter().map(|e| e * factor).collect()
}

impl Scheme for Explicit8 {
    fn order(&self) -> u32 {
        8
    }

    fn step(
        &mut self,
        eq: &Equations<'_, f64>,
        from: &Instant,
        h: f64,
        estimate: bool,
        counts: &mut Counts,
    ) -> Result<Step> {
        self.slopes.clear();
        self.end = None;
        self.record = self.record.take().map(|_| Vec::new());
        self.note(&vec![0.0; eq.n()], from);
        let z = eq.state_rates(&from.motion);
        self.slopes.push(Slope { y: from.motion.rate.clone(), v: from.acceleration.clone(), z });
        self.minimal = self.aside.take().or(self.minimal.take()).filter(|_| eq.constrained());
        if let Some(minimal) = &mut self.minimal {
            minimal.choose(eq, &from.motion, counts)?;
            if !minimal.decides(eq) {
                counts.add("steps from singular poses", 1);
                self.aside = self.minimal.take();
            }
        }
        for stage in 1..STAGES {
            self.stage(eq, &from.motion, stage, h, counts)?;
        }
        let (dy, mut dv, dz) = weighted(&self.slopes, B, h);
        let (end, dy) = self.ended(eq, &eq.with_states(&from.motion, &dz), h, (&dy, &dv), counts)?;
        let start = &from.motion.rate;
        if estimate {
            let before: Vec<f64> = start.iter().zip(&dv).map(|(r, d)| r + d).collect();
            eq.same_branch(&before, &end, h)?;
        }
        if self.minimal.is_some() {
            dv = end.motion.rate.iter().zip(start).map(|(e, s)| e - s).collect();
        }
        let error = estimate.then(|| {
            let [five, three] = [E5, E3].map(|row| {
                let (mut y, mut v, z) = weighted(&self.slopes, row, h);
                if let Some(minimal) = &self.minimal {
                    minimal.follow(&mut y, &mut v);
                }
                (y, v, z)
            });
            let scales = eq.scales();
            LocalError {
                position: combined(five.0, &three.0, &scales),
                rate: combined(five.1, &three.1, &scales),
                state: combined(five.2, &three.2, &eq.state_scales()),
            }
        });
        let z = eq.state_rates(&end.motion);
        self.slopes.push(Slope { y: eq.increment_rates(&dy, &end.motion.rate), v: end.acceleration.clone(), z });
        self.end = Some(Ends { dy, dv, dz });
        Ok(Step { end, error })
    }

    fn crossing(&self) -> Option<bool> {
        (!self.careful).then_some(true)
    }

    fn remark(&self) -> Option<String> {
        self.minimal.as_ref().or(self.aside.as_ref())?.remark()
    }

    fn between(
        &mut self,
        eq: &Equations<'_, f64>,
        from: &Instant,
        _step: &Step,
        h: f64,
        fractions: &[f64],
        counts: &mut Counts,
    ) -> Result<Vec<Motion<f64>>> {
        let Some(ends) = self.end.take() else {
            return Ok(Vec::new());
        };
        for stage in self.slopes.len()..A.len() {
            self.stage(eq, &from.motion, stage, h, counts)?;
        }
        let terms: Vec<_> = D.iter().map(|row| weighted(&self.slopes, row, h)).collect();
        let (first, last) = (&self.slopes[0], &self.slopes[STAGES]);
        let at = |x: f64, total: &[f64], f0: &[f64], f1: &[f64], high: &dyn Fn(usize, usize) -> f64| -> Vec<f64> {
            (0..total.len())
                .map(|i| {
                    let f = [
                        total[i],
                        h * f0[i] - total[i],
                        2.0 * total[i] - h * (f0[i] + f1[i]),
                        high(0, i),
                        high(1, i),
                        high(2, i),
                        high(3, i),
                    ];
                    f.iter().rev().enumerate().fold(0.0, |y, (k, f)| (y + f) * if k % 2 == 0 { x } else { 1.0 - x })
                })
                .collect()
        };
        let motions = fractions
            .iter()
            .map(|x| {
                let y = at(*x, &ends.dy, &first.y, &last.y, &|k, i| terms[k].0[i]);
                let v = at(*x, &ends.dv, &first.v, &last.v, &|k, i| terms[k].1[i]);
                let z = at(*x, &ends.dz, &first.z, &last.z, &|k, i| terms[k].2[i]);
                trial(eq, &eq.with_states(&from.motion, &z), x * h, &y, &v)
            })
            .collect();
        self.end = Some(ends);
        Ok(motions)
    }

    /// Accelerations at nodes of the polynomial of order seven make one of order eight.
    fn outputs(
        &mut self,
        eq: &Equations<'_, f64>,
        from: &Instant,
        step: &Step,
        h: f64,
        fractions: &[f64],
        counts: &mut Counts,
    ) -> Result<Vec<Between>> {
        let turned = self.end.as_ref().is_none_or(|own| eq.widest_rotation(&own.dy) >= std::f64::consts::PI);
        if turned {
            // rotation vectors from the start are ambiguous
            let motions = self.between(eq, from, step, h, fractions, counts)?;
            return Ok(motions.into_iter().map(Between::from).collect());
        }
        let inner = self.between(eq, from, step, h, FOUR.nodes, counts)?;
        let Some(own) = &self.end else { return Ok(Vec::new()) };
        let accelerations = (&*from.acceleration, &*step.end.acceleration);
        let ends = refine::Ends { from: &from.motion, to: &step.end.motion, h, theta: &own.dy, accelerations };
        refine::refined(eq, &ends, (&FOUR, &inner), fractions, counts)
    }

    /// What a difference of accelerations moves on the way between two nodes. Steps that are longer than a stiff scene is stable at may end
    /// well by chance, but not go well.
    fn misfit(&self, h: f64, difference: &[f64], _filtered: bool) -> Result<Option<LocalError>> {
        let c = h / (FOUR.nodes.len() + 2) as f64;
        let position = difference.iter().map(|d| c * c * d).collect();
        Ok(Some(LocalError { position, rate: Vec::new(), state: Vec::new() }))
    }
}
