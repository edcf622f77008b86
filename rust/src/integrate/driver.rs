//! From instant to instant: steps of fixed or controlled length, output times, breaks, and what happened when it ends early.
mod judge;
mod lengths;
mod outputs;

use crate::error::Result;
use crate::multibody::System;
use crate::run::{Cancel, Counts};

use super::detour::{Approach, Detour, Passage, again, noisy, passage};
use super::kept::KeptSteps;
use super::kinks::AtKinks;
use super::sides::Sides;
use super::watch::{Mark, Seen, Watch};
use super::way::{Aim, Uncounted, Verdict, Way, active, scaled};
use super::{Equations, Instant, LocalError, Scheme, Step};
use crate::tolerances::constraints::CLOSED_ENOUGH;
use crate::tolerances::singular_poses::{FARTHEST_CROSSING, LOOK};
use crate::tolerances::steps::{FROM_REST, SAME_INSTANT};

pub use super::plan::{End, Output, Plan, Progress, Run, Steps};

const GROW: f64 = 3.0;
const MAX_FAILURES: usize = 60;
/// Local errors of one step below so many times the rounding of a pose are rounding themselves, where only a part of the tolerance
/// is theirs: estimates divide differences of rates by the step, and no shorter one makes them smaller.
const NOISE: f64 = 256.0;
const DIVISIONS: usize = 5;

struct Driver<'e, 's, 'p> {
    eq: &'e Equations<'s, f64>,
    plan: &'p Plan,
    scales: Vec<f64>,
    /// sizes of the states of laws
    states: Vec<f64>,
    start: f64,
    /// largest rate so far, in characteristic lengths or radians per second
    speed: f64,
    next_output: usize,
    /// outputs within the step that is to be accepted
    inside: Vec<Instant>,
    uncounted: Uncounted<'e, 's>,
    watch: Watch,
    sides: Option<Sides<'e, 's>>,
    run: Run,
}

pub fn drive(
    eq: &Equations<'_, f64>,
    scheme: &mut dyn Scheme,
    start: Instant,
    plan: &Plan,
    cancel: &Cancel,
    progress: &Progress,
    counts: &mut Counts,
) -> Result<Run> {
    // fixed steps are those that were asked for
    let with_kinks = plan.exact_kinks || matches!(plan.steps, Steps::Controlled { .. });
    let mut driver = Driver {
        eq,
        plan,
        scales: eq.scales(),
        states: eq.state_scales(),
        start: start.motion.t,
        speed: 0.0,
        next_output: 0,
        inside: Vec::new(),
        uncounted: Uncounted::new(eq),
        watch: Watch::new(eq, &start, counts),
        sides: with_kinks.then(|| Sides::new(eq, &start, plan.steps.tolerance(), plan.exact_kinks)).flatten(),
        run: Run {
            outputs: Vec::new(),
            steps: vec![start.motion.t],
            formulas: Vec::new(),
            local: Vec::new(),
            rejected: 0,
            kept: plan.kept.map(|_| KeptSteps::from(&start)),
            at_kinks: AtKinks::default(),
            end: End::Finished,
            last: Output { instant: start.clone(), joints: Vec::new() },
        },
    };
    driver.at_start(&start);
    if driver.sides.is_some() {
        scheme.end_at_kinks();
    }
    scheme.over(plan.end - start.motion.t);
    driver.march(scheme, start, cancel, progress, counts)?;
    driver.run.at_kinks = driver.sides.map(|s| s.passed(counts)).unwrap_or_default();
    Ok(driver.run)
}

impl Driver<'_, '_, '_> {
    fn scaled(&self, v: &[f64]) -> f64 {
        scaled(v, &self.scales)
    }

    fn at_start(&mut self, start: &Instant) {
        match &self.plan.outputs {
            None => self.put(start.clone()),
            Some(times) => {
                let n = times.iter().take_while(|t| **t <= start.motion.t).count();
                for _ in 0..n {
                    self.put(start.clone());
                }
                self.next_output = n;
            }
        }
    }

    fn put(&mut self, instant: Instant) {
        let joints = self.eq.joint_coordinates(&instant.motion);
        self.run.outputs.push(Output { instant, joints });
    }

    fn march(
        &mut self,
        scheme: &mut dyn Scheme,
        start: Instant,
        cancel: &Cancel,
        progress: &Progress,
        counts: &mut Counts,
    ) -> Result<()> {
        let mut way = self.departure(scheme, start);
        while self.stretch(&mut way, scheme, cancel, progress, counts)? {}
        let joints = self.eq.joint_coordinates(&way.here.motion);
        self.run.last = Output { instant: way.here, joints };
        Ok(())
    }

    /// As far as laws are on one side of their kinks; true where the motion goes on from there.
    fn stretch(
        &mut self,
        way: &mut Way,
        scheme: &mut dyn Scheme,
        cancel: &Cancel,
        progress: &Progress,
        counts: &mut Counts,
    ) -> Result<bool> {
        let (t0, end) = (self.start, self.plan.end);
        let total = end - t0;
        let held = self.held(way, counts);
        let held = held.as_ref().map(|system| self.eq.on_sides(system));
        let eq = held.as_ref().unwrap_or(self.eq);
        if self.run.steps.len() > 1 && self.sides.is_some() {
            match eq.instant(way.here.motion.clone(), counts) {
                Ok(anew) => way.here = self.run.begun_anew(anew),
                Err(error) => return Ok(self.lost(way, scheme, &error.to_string(), counts)),
            }
        }
        while !self.vanishes(end - way.here.motion.t, end) {
            if cancel.check().is_err() {
                self.run.end = End::Interrupted;
                break;
            }
            if self.run.steps.len() > self.plan.max_steps {
                let most = self.plan.max_steps;
                let why = format!("{most} steps were not enough; give more with max_steps=");
                self.stop(way.here.motion.t, why);
                break;
            }
            self.speed = self
                .speed
                .max(self.scaled(&way.here.motion.rate))
                .max(self.scaled(&way.here.acceleration) * way.h.min(FROM_REST * total))
                .max(FROM_REST / total);
            let t = way.here.motion.t;
            if let Some(d) = way.detour.take_if(|d| t >= d.until) {
                way.recent = d.before;
                way.h = way.recent;
                scheme.reset();
            }
            self.look_ahead(way, scheme, counts);
            let aim = self.aim(way);
            let estimate = self.controlled();
            let finest = self.finest(way);
            let active = active(&mut way.detour, scheme);
            let tried = active.step(eq, &way.here, aim.length, estimate, counts);
            let (per_unit, patience) = (active.per_unit_step(), active.rate_time(aim.length));
            let (power, tolerance) = (active.power(), self.tolerance(active, aim.length));
            let noise = if per_unit { NOISE * self.eq.rounding(&way.here.motion) } else { 0.0 };
            let allowed = tolerance.max(finest).max(noise);
            let judged = self.judged(tried, way, (allowed, per_unit), (patience, power));
            let judged = self.at_kinks(judged, eq, way, scheme, aim.length, counts);
            let going_on = match self.at_outputs(judged, eq, way, scheme, &aim, counts) {
                Verdict::Accepted(step, size, allowed) => {
                    self.accepted(eq, way, scheme, *step, (size, allowed), &aim, counts)?
                }
                Verdict::Rejected(factor, why) => self.rejected(way, scheme, aim.length * factor, why, counts),
                Verdict::Turned(part) => self.turned(way, aim.length * part, counts),
                Verdict::Kinked(part) => self.kinked(way, scheme, aim.length * part, counts),
                Verdict::Cut(t) => self.cut(way, t, counts),
                Verdict::Fatal(error) => {
                    self.stop(way.here.motion.t, error.to_string());
                    false
                }
            };
            if !going_on {
                break;
            }
            progress.set((way.here.motion.t - t0) / total);
            if self.sides.as_ref().is_some_and(Sides::have_changed) {
                return Ok(true);
            }
        }
        Ok(false)
    }

    /// The system that holds from here on, where laws have kinks.
    fn held(&mut self, way: &Way, counts: &mut Counts) -> Option<System> {
        let total = self.plan.end - self.start;
        let moment = f64::EPSILON.cbrt() * self.first_step(&way.here, 1.0, 1).min(way.h).min(total);
        let sides = self.sides.as_mut()?;
        sides.look_ahead(&way.here, moment, counts);
        Some(sides.held())
    }

    fn controlled(&self) -> bool {
        matches!(self.plan.steps, Steps::Controlled { .. })
    }

    /// Goes on from the end of a step; false where that is impossible.
    #[allow(clippy::too_many_arguments)]
    fn accepted(
        &mut self,
        eq: &Equations<'_, f64>,
        way: &mut Way,
        scheme: &mut dyn Scheme,
        mut step: Step,
        (size, allowed): (f64, f64),
        aim: &Aim,
        counts: &mut Counts,
    ) -> Result<bool> {
        if let Some(t) = aim.target {
            step.end.motion.t = t;
        }
        if let Some(name) = self.uncounted.jump(&way.here.motion, &step.end.motion) {
            self.stop(
                way.here.motion.t,
                format!(
                    "the angle of '{name}' goes over half a turn, which no coordinate of the joints between its bodies counts; carry \
                     them by hinges (revolute, cylindrical, planar) about nearly that axis"
                ),
            );
            return Ok(false);
        }
        let mark = self.mark();
        let memory = self.run.kept.as_ref().map(|_| step.end.motion.memory.clone());
        let active = active(&mut way.detour, scheme);
        way.kinked = active.per_unit_step() && self.passes_kink(&way.here.motion, &step.end.motion);
        self.record(eq, &mut step, counts);
        self.run.formulas.push(active.formula());
        active.accept(eq, &way.here, &step, aim.length);
        self.run.keep(active, &step, (memory, aim.length), self.plan.kept);
        let patience = active.rate_time(aim.length);
        let tolerance = |e: &LocalError| self.size(e, self.speed, patience) / allowed;
        let next = match active.proposal(&tolerance) {
            Some(factor) => self.plan.steps.proposed(way.h, aim.length, factor),
            None => {
                let growth = if way.after_rejection { 1.0 } else { GROW };
                self.plan.steps.next(way.h, aim.length, size, active.power(), growth)
            }
        };
        way.h = next;
        (way.to_kink, way.to_output) = (None, None);
        way.failures = 0;
        way.after_rejection = false;
        way.recent = aim.length;
        let crossed = way.detour.is_some();
        let seen = self.watch.see(self.eq, (&way.here, &step.end), (mark, crossed), counts);
        way.here = step.end;
        self.run.local.push(size);
        self.run.steps.push(aim.broken.unwrap_or(way.here.motion.t));
        counts.add("steps", 1);
        if seen == Seen::Impossible {
            return Ok(self.ended(&way.here, "rates grow beyond all bounds", counts));
        }
        if seen == Seen::Turned {
            return Ok(self.cross_again(way, scheme, counts) || self.ended(&way.here, "the motion turned", counts));
        }
        if let (Some(sides), None) = (&mut self.sides, aim.broken) {
            sides.accept(&way.here);
            if sides.have_turned() {
                scheme.reset();
                way.h = way.h.min(sides.longest());
            }
        }
        if let Some(t) = aim.broken {
            // rates of drives may jump: an impact
            way.here.motion.t = t;
            scheme.reset();
            self.watch.forget();
            match self.eq.consistent(way.here.motion.clone(), counts) {
                Ok(after) => {
                    way.here = self.run.begun_anew(after);
                    self.sides.iter_mut().for_each(|s| s.restart(&way.here));
                }
                Err(error) => {
                    self.stop(t, error.to_string());
                    return Ok(false);
                }
            }
        }
        Ok(true)
    }

    /// A shorter step, or a way around; false where neither helps.
    fn rejected(
        &mut self,
        way: &mut Way,
        scheme: &mut dyn Scheme,
        shorter: f64,
        why: String,
        counts: &mut Counts,
    ) -> bool {
        let t = way.here.motion.t;
        (way.to_kink, way.to_output) = (None, None);
        self.sides.iter_mut().for_each(Sides::give_up);
        self.run.rejected += 1;
        counts.add("rejected steps", 1);
        way.failures += 1;
        way.after_rejection = true;
        way.h = shorter;
        if let Some(detour) = way.detour.take() {
            // nearer to the pose first
            self.watch.own_until = t + detour.nearer;
            way.h = detour.before.min(detour.nearer);
            way.after_rejection = false;
        } else if self.watch.collapsed(shorter) && self.cross_again(way, scheme, counts) {
            return true;
        }
        // a fixed step is divided where its equations have no solution, as in singular poses
        let most = if self.controlled() { MAX_FAILURES } else { DIVISIONS };
        if self.vanishes(shorter, t) || way.failures > most {
            // steps that were accepted are as short beside the whole as this one
            let why = if t > self.start && self.vanishes(way.recent, t) {
                format!("1e14 steps of {shorter:.1e} s would not reach the end; take a shorter time ({why})")
            } else {
                why
            };
            return self.lost(way, scheme, &why, counts);
        }
        true
    }

    /// The smallest tolerance that rounding allows near a singular pose; none far from one.
    fn finest(&self, way: &Way) -> f64 {
        if way.detour.is_some() { CLOSED_ENOUGH } else { self.watch.noise().min(CLOSED_ENOUGH) }
    }

    fn mark(&self) -> Mark {
        Mark { outputs: self.run.outputs.len(), next_output: self.next_output, steps: self.run.steps.len() }
    }

    /// Is a singular pose so near that a step would end or have a stage in its noise? Then the step is made shorter, or another crosses.
    fn look_ahead(&mut self, way: &mut Way, scheme: &dyn Scheme, counts: &mut Counts) {
        let Steps::Controlled { rtol, .. } = self.plan.steps else { return };
        let t = way.here.motion.t;
        let wanted = scheme.crossing().filter(|_| way.detour.is_none() && t >= self.watch.own_until);
        let rounding = scheme.rounding();
        let Some(own) = wanted.filter(|_| self.eq.minds_singular_poses(&way.here.motion.rate, way.h, rtol, rounding))
        else {
            return;
        };
        let speed = self.scaled(&way.here.motion.rate);
        let reach = way.h * 2.0 + if own { 0.0 } else { FARTHEST_CROSSING / speed };
        let Some(hold) = self.watch.near(self.eq, &way.here, speed * reach, counts) else { return };
        let seen = self.eq.way_to_singular_pose(&way.here, hold, counts);
        let Some(ahead) = seen.filter(|a| *a <= reach) else {
            self.watch.own_until = t + LOOK * hold / speed;
            return;
        };
        match passage(&Approach { ahead, h: way.h, speed, slope: hold / ahead, rtol }, scheme) {
            Passage::Own => self.watch.own_until = t + LOOK * ahead,
            Passage::Shorter(h) => way.h = h,
            // nearer to it a crossing begins in its own noise
            Passage::Crossing(length) if hold > noisy(rtol, f64::EPSILON) => {
                counts.add("detours", 1);
                way.detour = Some(Detour::of((t, ahead), length, way.h, self.watch.again));
                way.h = length;
            }
            Passage::Crossing(_) => self.watch.own_until = t + 2.0 * ahead,
        }
    }

    /// Back to before the singular pose, and across it by another step; false where that was done often enough.
    fn cross_again(&mut self, way: &mut Way, scheme: &mut dyn Scheme, counts: &mut Counts) -> bool {
        let Steps::Controlled { .. } = self.plan.steps else { return false };
        let (Some(gap), true) = (again(self.watch.again), scheme.crossing().is_some()) else { return false };
        let Some(shore) = self.watch.shore.take_if(|s| s.is_passable(&self.scales)) else { return false };
        counts.add("crossings again", 1);
        self.run.cut(shore.mark.outputs, shore.mark.steps);
        self.next_output = shore.mark.next_output;
        let passed = shore.pose_after();
        (way.here, way.h, way.failures, way.after_rejection) = (shore.instant, shore.h, 0, false);
        self.watch.return_to(self.eq, &way.here, counts);
        self.sides.iter_mut().for_each(|s| s.return_to(&way.here));
        let ahead = self.eq.way_to_singular_pose(&way.here, self.watch.hold, counts);
        let ahead = ahead.filter(|a| *a <= 2.0 * passed).unwrap_or(passed);
        let t = way.here.motion.t;
        way.detour = Some(Detour::of((t, ahead), ahead / gap, shore.h, self.watch.again));
        way.h = ahead / gap;
        scheme.reset();
        true
    }

    /// No step can be made: laws that were held are let go, or the run ends.
    fn lost(&mut self, way: &mut Way, scheme: &mut dyn Scheme, why: &str, counts: &mut Counts) -> bool {
        if !self.sides.as_mut().is_some_and(|s| s.let_go(&way.here)) {
            return self.ended(&way.here, why, counts);
        }
        let fresh = self.departure(scheme, way.here.clone());
        way.h = fresh.h.max(way.recent).min(self.plan.steps.longest());
        (way.failures, way.after_rejection) = (0, false);
        scheme.reset();
        true
    }

    /// The run ends; where rows lose rank, they are the reason.
    fn ended(&mut self, here: &Instant, why: &str, counts: &mut Counts) -> bool {
        let message = match self.watch.losing_rank(self.eq, here, counts) {
            None => why.to_string(),
            Some((t, lost)) => format!("{} ({why})", lost.told(t)),
        };
        self.stop(here.motion.t, message);
        false
    }

    /// A shorter step that ends where a slider turns.
    fn turned(&mut self, way: &mut Way, shorter: f64, counts: &mut Counts) -> bool {
        let t = way.here.motion.t;
        counts.add("turns of sliders", 1);
        (way.to_kink, way.to_output) = (None, None);
        self.sides.iter_mut().for_each(Sides::give_up);
        way.failures += 1;
        way.h = shorter;
        if self.vanishes(shorter, t) || way.failures > MAX_FAILURES {
            self.stop(t, "a slider turns again and again".into());
            return false;
        }
        true
    }

    /// Another step, of a length that may end at a kink.
    fn kinked(&mut self, way: &mut Way, scheme: &mut dyn Scheme, length: f64, counts: &mut Counts) -> bool {
        let t = way.here.motion.t;
        counts.add("steps to kinks", 1);
        way.to_output = None;
        way.to_kink = (!self.vanishes(length, t)).then_some(length);
        if let (None, Some(sides)) = (way.to_kink, &mut self.sides) {
            scheme.reset();
            sides.is_here(&way.here);
            way.h = way.h.min(sides.longest());
        }
        true
    }

    /// Such a step would not change the time.
    fn vanishes(&self, step: f64, t: f64) -> bool {
        step <= SAME_INSTANT * t.abs().max(self.plan.end - self.start)
    }

    fn stop(&mut self, t: f64, message: String) {
        self.run.end = End::Stopped { t, message };
    }
}
