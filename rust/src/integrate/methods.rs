//! Which scheme runs, and a whole run from any start: consistent initial values first.
use crate::error::{Error, Result};
use crate::force::Class;
use crate::multibody::topology::BoundLaw;
use crate::run::{Cancel, Counts};

use super::ali3p::{Ali3p, Weight};
use super::augmented::Penalty;
use crate::solve::inverse::Family;

use super::bdf::Bdf;
use super::bdf::equations::Form;
use super::driver::{Plan, Progress, Run, Steps, drive};
use super::explicit_minimal::Minimal;
use super::explicit8::{Coordinates, Explicit8};
use super::generalized_alpha::GeneralizedAlpha;
use super::radau::{FIVE, NINE, Radau, Tableau};
use super::share::share;
use super::{Equations, Instant, Motion, Scheme, scaled_size};

#[derive(Debug, Clone, Copy)]
pub enum Method {
    Auto,
    /// None: what the scene lets expect to be cheaper
    Explicit(Option<Coordinates>),
    /// spectral radius at infinity
    GeneralizedAlpha(f64),
    Ali3p(Weight, Option<Penalty>),
    BdfBfgs(Form, Option<Family>),
    Bdf,
    Radau(&'static Tableau),
}

/// What generalised-alpha leaves of infinitely fast oscillations, unless it is told otherwise.
const RHO: f64 = 0.8;

impl Method {
    pub fn named(name: &str, rho: Option<f64>, penalty: Option<Penalty>) -> Result<Self> {
        match name {
            "auto" => Ok(Method::Auto),
            "explicit" => Ok(Method::Explicit(None)),
            "explicit/independent" => Ok(Method::Explicit(Some(Coordinates::Independent))),
            "explicit/tree" => Ok(Method::Explicit(Some(Coordinates::Tree))),
            "bdf" => Ok(Method::Bdf),
            "radau" | "radau/5" => Ok(Method::Radau(&FIVE)),
            "radau/9" => Ok(Method::Radau(&NINE)),
            "generalized-alpha" => Ok(Method::GeneralizedAlpha(rho.unwrap_or(RHO))),
            "ali3p" => Ok(Method::Ali3p(Weight::Tangent, penalty)),
            name if name.starts_with("bdf-bfgs") => {
                let form = if name.contains("/symmetric") { Form::Symmetric } else { Form::Ggl };
                let family = match name.rsplit('/').next() {
                    Some("bfgs") => Some(Family::Bfgs),
                    Some("broyden") => Some(Family::Broyden),
                    _ => None,
                };
                Ok(Method::BdfBfgs(form, family))
            }
            other => Err(Error::model(format!("no method is called '{other}'"))),
        }
    }

    fn name(&self) -> &'static str {
        match self {
            Method::Auto => "auto",
            Method::Explicit(_) => "explicit",
            Method::GeneralizedAlpha(_) => "generalized-alpha",
            Method::Ali3p(..) => "ali3p",
            Method::BdfBfgs(..) => "bdf-bfgs",
            Method::Bdf => "bdf",
            Method::Radau(_) => "radau",
        }
    }

    /// One whose steps are kept, where that is asked for and there is such.
    fn keeping(&self, plan: &Plan) -> Option<Box<dyn Scheme>> {
        let Steps::Controlled { rtol, .. } = plan.steps else { return None };
        plan.kept?;
        match self {
            Method::Bdf => Some(Box::new(Bdf::keeping(rtol))),
            Method::Radau(tableau) => Some(Box::new(Radau::new(tableau, Some(rtol)).until_rounding().recording())),
            _ => None,
        }
    }

    /// `differentiated`: steps are those of a motion that is differentiated.
    fn scheme(&self, steps: Steps, differentiated: bool) -> Box<dyn Scheme> {
        let rtol = match steps {
            Steps::Fixed(_) => None,
            Steps::Controlled { rtol, .. } => Some(rtol),
        };
        match self {
            Method::Auto | Method::Explicit(None) => Box::new(Explicit8::default()),
            Method::Explicit(Some(coordinates)) => Box::new(Explicit8::new(*coordinates, rtol)),
            Method::GeneralizedAlpha(rho) => Box::new(GeneralizedAlpha::new(*rho)),
            Method::Ali3p(weight, penalty) => Box::new(Ali3p::new(*weight, *penalty)),
            Method::BdfBfgs(form, family) => Box::new(Bdf::inverse(*form, *family, rtol)),
            Method::Bdf => match rtol.filter(|_| differentiated) {
                Some(rtol) => Box::new(Bdf::from_rates(rtol)),
                None => Box::new(Bdf::newton(rtol)),
            },
            Method::Radau(tableau) => Box::new(Radau::new(tableau, rtol)),
        }
    }
}

pub struct Simulated {
    pub run: Run,
    pub method: &'static str,
    pub why: String,
    pub measures: Vec<(&'static str, f64)>,
    /// largest change of a joint coordinate by closing the loops at the start, characteristic lengths or radians
    pub position_correction: f64,
    /// the same of a rate, per second
    pub velocity_correction: f64,
}

pub fn simulate(
    eq: &Equations<'_, f64>,
    method: Method,
    start: Motion<f64>,
    mut plan: Plan,
    cancel: &Cancel,
    progress: &Progress,
    counts: &mut Counts,
) -> Result<Simulated> {
    let given = start.clone();
    let mut first = eq.consistent(start, counts).map_err(at_start)?;
    eq.close_states(&mut first.motion);
    // sliders that the start overloads have slipped before it
    eq.remember(&mut first.motion, counts);
    let scales = eq.scales();
    let size = |v: &[f64]| scaled_size(v, &scales);
    let position_correction = size(&eq.difference(&given, &first.motion));
    let changed: Vec<f64> = first.motion.rate.iter().zip(&given.rate).map(|(a, b)| a - b).collect();
    let velocity_correction = size(&changed);
    let (mut method, mut why) = chosen(eq, method, &first, plan.end, counts)?;
    if matches!(method, Method::Explicit(None)) && Minimal::pays(eq, &first.motion) {
        method = Method::Explicit(Some(Coordinates::Independent));
        why = format!("{why}; many loops and few freedoms");
    }
    if matches!(method, Method::GeneralizedAlpha(_) | Method::Ali3p(..)) {
        plan.share = share(eq, &|steps| method.scheme(steps, false), &first, &plan, cancel, counts)?;
    }
    let mut scheme = method.keeping(&plan).unwrap_or_else(|| method.scheme(plan.steps, plan.exact_kinks));
    let run = drive(eq, scheme.as_mut(), first, &plan, cancel, progress, counts)?;
    if let Some(remark) = scheme.remark() {
        why = format!("{why}; {remark}");
    }
    Ok(Simulated {
        run,
        method: method.name(),
        why,
        measures: scheme.measures(),
        position_correction,
        velocity_correction,
    })
}

fn at_start(error: Error) -> Error {
    match error {
        Error::Convergence { message, .. } => Error::Assembly(format!("the motion cannot start: {message}")),
        other => other,
    }
}

/// Vibrations faster than the motion by this factor call for an implicit method: measured on two bodies on oblique springs, below it
/// explicit steps follow them with less work, above it they move too little to be followed at usual tolerances.
pub const STIFF: f64 = 300.0;
/// Decays faster than the motion by this factor: they have died out after a few steps, and explicit steps are bound by them as long as
/// the motion lasts. Measured on two bodies with damped hinges: equal work at 15, a fifth of it at 50.
const DECAY: f64 = 40.0;
/// So many times these factors in the whole time: a short motion costs little by any method.
const MANY: f64 = 10.0;

/// Vibrations and decays times a fixed step up to which explicit steps follow them.
const FOLLOWED: f64 = 1.0;

/// Does an explicit method serve this motion? `step`: of fixed steps.
pub fn explicit_serves(
    eq: &Equations<'_, f64>,
    start: Motion<f64>,
    end: f64,
    step: Option<f64>,
    counts: &mut Counts,
) -> Result<bool> {
    let first = eq.consistent(start, counts).map_err(at_start)?;
    if !matches!(chosen(eq, Method::Auto, &first, end, counts)?.0, Method::Explicit(_)) {
        return Ok(false);
    }
    let Some(step) = step.filter(|_| !eq.topology().connectors.is_empty() || eq.topology().is_flexible()) else {
        return Ok(true);
    };
    let fastest = eq.fastest(&first, counts)?;
    Ok(step * fastest.vibration.max(fastest.decay) <= FOLLOWED)
}

fn chosen(
    eq: &Equations<'_, f64>,
    method: Method,
    first: &Instant,
    end: f64,
    counts: &mut Counts,
) -> Result<(Method, String)> {
    let Method::Auto = method else {
        return Ok((method, "as asked".into()));
    };
    if eq.topology().connectors.is_empty() && !eq.topology().is_flexible() {
        let why = "no spring, damper or law: nothing can be stiff".into();
        return Ok((Method::Explicit(None), why));
    }
    let time = end - first.motion.t;
    let motion = eq.pace(first, time);
    let mut fastest = eq.fastest(first, counts)?;
    if let Some(still) = held_by_friction(eq, first, counts)? {
        fastest = fastest.or(&eq.fastest(&still, counts)?);
    }
    let text = format!(
        "the fastest vibration ({:.2e} 1/s) is {:.1e} times as fast as the motion (implicit steps pay above {STIFF:.0e}), the fastest \
         decay ({:.2e} 1/s) {:.1e} times (above {DECAY:.0e})",
        fastest.vibration,
        fastest.vibration / motion,
        fastest.decay,
        fastest.decay / motion
    );
    let stiff = |fast: f64, factor: f64| fast > factor * motion && fast * time > MANY * factor;
    if stiff(fastest.vibration, STIFF) || stiff(fastest.decay, DECAY) {
        // measured on chains of 20 and 80 hinges: complex factors of large models cost more than the fewer steps spare
        let method = if eq.sparse { Method::Bdf } else { Method::Radau(&FIVE) };
        Ok((method, format!("stiff: {text}")))
    } else {
        Ok((Method::Explicit(None), format!("not stiff: {text}")))
    }
}

/// The start without its rates, where friction is steepest: what slides now may stick later. None without friction.
fn held_by_friction(eq: &Equations<'_, f64>, first: &Instant, counts: &mut Counts) -> Result<Option<Instant>> {
    let rubs = |l: &BoundLaw| l.law.class() == Class::Friction && l.law.uses_velocity();
    let mut connectors = eq.topology().connectors.iter();
    if !eq.effects.friction || !connectors.any(|c| c.laws.iter().any(rubs)) {
        return Ok(None);
    }
    let mut still = first.motion.clone();
    still.rate.fill(0.0);
    eq.instant(still, counts).map(Some)
}
