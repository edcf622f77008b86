//! Contacts that the samples of a motion do not resolve: at an extremum of the displacement the stiffness jumps within the error of the
//! motion, between two samples, or for fewer samples than the product of small steps needs.
use super::aft::Aft;
use super::element::Force;
use super::tangents::Pair;
use crate::error::Result;
use crate::solve::nan_or_largest;
use crate::tolerances::periodic::{CONTACT_JUMP, CONTACT_STEPS};

/// Samples from which on a smooth law does not change over a few of them.
const MANY: usize = 1024;

/// By how much df/du and df/dv of a pair, whose element `aft` evaluated last, change in the mean over the period, where the
/// displacement moves by `margin`.
pub fn changes(force: &Force, aft: &Aft, pair: Pair, margin: f64) -> [f64; 2] {
    let linear = matches!(force, Force::Known { law, .. } if law.degree().is_some_and(|degree| degree < 2));
    if linear || margin == 0.0 {
        return [0.0; 2];
    }
    let (u, (f_u, f_v)) = (aft.displacements(pair.by), aft.tangents(pair.force, pair.by));
    let n = u.len();
    let mean = |f: &[f64]| {
        let range = nan_or_largest(f.iter().copied()) + nan_or_largest(f.iter().map(|x| -x));
        let one = |i: usize| {
            let (du, df) = ((u[(i + 1) % n] - u[i]).abs(), (f[(i + 1) % n] - f[i]).abs());
            if df == 0.0 { 0.0 } else { (df * margin / du).min(range) }
        };
        (0..n).map(one).sum::<f64>() / n as f64
    };
    [mean(f_u), mean(f_v)]
}

/// Whether the samples of a pair, whose element `aft` evaluated last, leave a contact unresolved; the displacement may be off by
/// `margin`.
pub fn is_unresolved(force: &Force, aft: &Aft, pair: Pair, margin: f64) -> Result<bool> {
    let margin = match force {
        Force::Known { law, .. } if law.n_memory() > 0 || law.degree().is_some() => return Ok(false),
        Force::Known { .. } => margin,
        // a function may bend fast without a contact
        Force::Sampled(_) => 0.0,
    };
    let (u, (f_u, _)) = (aft.displacements(pair.by), aft.tangents(pair.force, pair.by));
    let n = u.len();
    let mut tips: Vec<(usize, [f64; 3])> = Vec::new();
    for i in 0..n {
        let (before, here, after) = (u[(i + n - 1) % n], u[i], u[(i + 1) % n]);
        if (here - before) * (after - here) > 0.0 || (before == here && here == after) {
            continue;
        }
        // the parabola through three samples has its tip between them
        let bend = after - 2.0 * here + before;
        let tip = here - (after - before).powi(2) / (8.0 * bend);
        let mut values = [0.0; 3];
        let (mut all, mut rate) = aft.motion_at(i);
        rate[pair.by] = 0.0;
        for (value, u) in values.iter_mut().zip([tip, tip + margin, tip - margin]) {
            all[pair.by] = u;
            *value = force.slopes(aft.phases()[i], &all, &rate)?.1[pair.force * all.len() + pair.by];
        }
        tips.push((i, values));
    }
    let all = || f_u.iter().copied().chain(tips.iter().flat_map(|t| t.1));
    let (most, least) = (nan_or_largest(all()), -nan_or_largest(all().map(|x| -x)));
    let jumps = |a: f64, b: f64| (a - b).abs() > CONTACT_JUMP * (most - least.min(0.0)).abs();
    let far = CONTACT_STEPS / 2;
    Ok(tips.iter().any(|(i, values)| {
        let within = values.iter().any(|v| jumps(*v, f_u[*i]));
        let short = n >= MANY && jumps(f_u[*i], f_u[(i + far) % n]) && jumps(f_u[*i], f_u[(i + n - far) % n]);
        within || short
    }))
}
