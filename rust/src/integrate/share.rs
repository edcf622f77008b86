//! How much of the tolerance each unit of time may have.
//!
//! Methods of order two hold the sum of their local errors to a part of the tolerance. The error of the whole motion is far smaller than
//! that sum in a motion that is damped, or in which errors take turns, and larger where they grow: over the zoo of motions between a
//! fiftieth and eleven times, at every tolerance alike. Two trial runs with looser tolerances, a thirtieth and a sixtieth of the steps,
//! measure it: their distance over the tolerance is the part that lasts, since their errors are in proportion to their tolerances.
use crate::error::Result;
use crate::run::{Cancel, Counts};
use crate::tolerances::steps::{LASTING, LEAST_SHARE, LOOSEST_TRIAL, TRIAL};

use super::driver::{End, Plan, Progress, Steps, drive};
use super::{Equations, Instant, Scheme, scaled_size};

/// The second trial is tighter by this factor.
const TIGHTER: f64 = 4.0;
/// Instants at which both are compared.
const COMPARED: usize = 32;
/// Trials that are less looser than this would cost as much as they save.
const WORTHWHILE: f64 = 4.0;

/// How many tolerances local errors may add up to in this motion.
pub(super) fn share(
    eq: &Equations<'_, f64>,
    scheme: &dyn Fn(Steps) -> Box<dyn Scheme>,
    first: &Instant,
    plan: &Plan,
    cancel: &Cancel,
    counts: &mut Counts,
) -> Result<f64> {
    let Steps::Controlled { rtol, first: length, longest } = plan.steps else { return Ok(1.0) };
    let loose = (TRIAL * TIGHTER * rtol).min(LOOSEST_TRIAL);
    if !scheme(plan.steps).per_unit_step() || loose < WORTHWHILE * TIGHTER * rtol {
        return Ok(1.0);
    }
    let mut work = Counts::default();
    let mut trial = |rtol: f64| -> Result<Option<Vec<Instant>>> {
        let steps = Steps::Controlled { rtol, first: length, longest };
        let from = first.motion.t;
        let times = (1..=COMPARED).map(|k| from + (plan.end - from) * k as f64 / COMPARED as f64).collect();
        let plan = Plan {
            end: plan.end,
            steps,
            outputs: Some(times),
            breaks: plan.breaks.clone(),
            max_steps: plan.max_steps,
            kept: None,
            // as motions are made: what derivatives need costs time
            exact_kinks: false,
            ends: None,
            share: 1.0,
        };
        let run = drive(eq, scheme(steps).as_mut(), first.clone(), &plan, cancel, &Progress::default(), &mut work)?;
        let ended = matches!(run.end, End::Finished);
        Ok(ended.then(|| run.outputs.into_iter().map(|o| o.instant).collect()))
    };
    let runs = (trial(loose)?, trial(loose / TIGHTER)?);
    counts.add("trial steps", work.0.get("steps").copied().unwrap_or(0));
    for what in ["force evaluations", "tangents", "factorisations"] {
        counts.add(what, work.0.get(what).copied().unwrap_or(0));
    }
    let (Some(a), Some(b)) = runs else { return Ok(1.0) };
    let scales = eq.scales();
    let apart = |(a, b): (&Instant, &Instant)| scaled_size(&eq.difference(&a.motion, &b.motion), &scales);
    let most = a.iter().zip(&b).map(apart).fold(0.0, f64::max);
    let lasts = most / (1.0 - 1.0 / TIGHTER) / loose;
    Ok((LASTING / lasts.max(f64::MIN_POSITIVE)).clamp(LEAST_SHARE, TRIAL))
}
