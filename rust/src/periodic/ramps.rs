//! Contacts of a periodic motion without samples: the ramps that the kinks of a law leave, integrated exactly.
//!
//! A law whose slope jumps by s where u passes g is a law without that kink and the ramp s (u - g) beyond g. With chi the function
//! that is 1 while u is beyond, the coefficients of the ramp are those of the product s chi (u - g): the matrix P(chi) of a product
//! applied to those of u - g. Those of chi are known from the instants at which u passes g, and since u - g vanishes there,
//! s P(chi) is the Jacobian as well. Sampled ramps instead make corners in the equations where single samples begin to touch.
use num_complex::Complex64 as c64;
use num_dual::Dual64;

use crate::force::{AnyLaw, Crossing, Surface};

/// Of a phase.
const ROUNDING: f64 = 8.0 * f64::EPSILON;
/// Steps of Newton's method and of halving to an instant.
const STEPS: usize = 60;

/// The force slope (u - at) while u lies beyond `at`, seen from zero.
#[derive(Debug, Clone, Copy)]
pub struct Ramp {
    pub at: f64,
    pub slope: f64,
}

impl Ramp {
    /// Those of a law of the displacement alone whose slope jumps.
    pub fn of(law: AnyLaw, p: &[f64]) -> Vec<Ramp> {
        if law.n_memory() > 0 || law.uses_velocity() || law.degree().is_some() {
            return Vec::new();
        }
        let numbers: Vec<Dual64> = p.iter().map(|x| Dual64::from(*x)).collect();
        let slope = |u: f64| law.force_at(0.0, Dual64::new(u, 1.0), Dual64::from(0.0), &numbers, &[], &mut []).eps;
        let is_sharp = |s: &Surface| s.crossing == Crossing::Displacement && s.width == 0.0;
        let ramp = |at: f64| {
            let jump = slope(at.next_up()) - slope(at.next_down());
            Ramp { at, slope: if at < 0.0 { -jump } else { jump } }
        };
        law.surfaces(p)
            .iter()
            .filter(|s| is_sharp(s))
            .map(|s| ramp(s.at))
            .filter(|r| r.slope != 0.0 && r.slope.is_finite())
            .collect()
    }

    pub fn is_beyond(&self, u: f64) -> bool {
        if self.at < 0.0 { u < self.at } else { u > self.at }
    }

    /// Force and slope.
    pub fn force(&self, u: f64) -> (f64, f64) {
        if self.is_beyond(u) { (self.slope * (u - self.at), self.slope) } else { (0.0, 0.0) }
    }
}

/// An instant at which a motion passes the foot of a ramp: after the sample `after`, at the phase `tau` of the period.
#[derive(Debug, Clone, Copy)]
struct Passage {
    after: usize,
    tau: f64,
    enters: bool,
}

/// A motion of one period: a_0 + sum_j a_j cos(k_j tau) + b_j sin(k_j tau), with its samples.
struct Motion<'a> {
    terms: &'a [i32],
    coefficients: &'a [f64],
    samples: &'a [f64],
}

impl Motion<'_> {
    fn step(&self) -> f64 {
        std::f64::consts::TAU / self.samples.len() as f64
    }

    fn sample(&self, i: isize) -> f64 {
        self.samples[i.rem_euclid(self.samples.len() as isize) as usize]
    }

    /// u and its first two derivatives.
    fn at(&self, tau: f64) -> [f64; 3] {
        let turn = c64::cis(tau);
        let (mut k, mut z) = (0, c64::new(1.0, 0.0));
        let mut out = [self.coefficients[0], 0.0, 0.0];
        for (own, c) in self.terms.iter().zip(self.coefficients[1..].chunks_exact(2)) {
            z = if *own > k { z * turn.powi(own - k) } else { c64::cis(f64::from(*own) * tau) };
            k = *own;
            let h = f64::from(k);
            let (value, quarter) = (c[0] * z.re + c[1] * z.im, c[1] * z.re - c[0] * z.im);
            out[0] += value;
            out[1] += h * quarter;
            out[2] -= h * h * value;
        }
        out
    }

    /// Zero between two phases of the derivative of this order minus `at`, where its signs differ at the ends.
    fn zero(&self, order: usize, at: f64, mut low: f64, mut high: f64) -> f64 {
        let value = |tau: f64| {
            let u = self.at(tau);
            (u[order] - at, u[order + 1])
        };
        let rises = value(high).0 > value(low).0;
        let mut tau = 0.5 * (low + high);
        for _ in 0..STEPS {
            let (f, slope) = value(tau);
            if (f > 0.0) == rises {
                high = tau;
            } else {
                low = tau;
            }
            let step = f / slope;
            if f == 0.0 || step.abs() <= ROUNDING {
                break;
            }
            let next = tau - step;
            tau = if next > low && next < high { next } else { 0.5 * (low + high) };
        }
        tau
    }

    fn passages(&self, ramp: &Ramp) -> Vec<Passage> {
        let (n, h) = (self.samples.len() as isize, self.step());
        let mut out = Vec::new();
        for i in 0..n {
            let (u, next) = (self.sample(i), self.sample(i + 1));
            let (here, there) = (ramp.is_beyond(u), ramp.is_beyond(next));
            if here != there {
                let tau = self.zero(0, ramp.at, i as f64 * h, (i + 1) as f64 * h);
                out.push(Passage { after: i as usize, tau, enters: there });
            } else if here == ramp.is_beyond(self.sample(i - 1)) {
                self.add_touch(ramp, i, &mut out);
            }
        }
        out
    }

    /// Two passages between samples that all lie on one side: around the tip near the sample i.
    fn add_touch(&self, ramp: &Ramp, i: isize, out: &mut Vec<Passage>) {
        let away = |i: isize| (self.sample(i) - ramp.at).abs();
        let (before, here, after) = (away(i - 1), away(i), away(i + 1));
        // the parabola through three samples dips below its least one by an eighth of their second difference
        let near = here <= before && here < after && here < before - 2.0 * here + after;
        if !near {
            return;
        }
        let h = self.step();
        let (low, high) = ((i - 1) as f64 * h, (i + 1) as f64 * h);
        if self.at(low)[1] * self.at(high)[1] >= 0.0 {
            return;
        }
        let inside = ramp.is_beyond(self.sample(i));
        let tip = self.zero(1, 0.0, low, high);
        if ramp.is_beyond(self.at(tip)[0]) == inside {
            return;
        }
        for (low, high, enters) in [(low, tip, !inside), (tip, high, inside)] {
            let tau = self.zero(0, ramp.at, low, high);
            let after = (tau / h).floor() as isize;
            out.push(Passage {
                after: after.rem_euclid(self.samples.len() as isize) as usize,
                tau: tau.rem_euclid(std::f64::consts::TAU),
                enters,
            });
        }
    }
}

/// While a motion is beyond the foot of a ramp.
pub struct Contact {
    passages: Vec<Passage>,
    /// part of the period
    share: f64,
    samples: usize,
}

impl Contact {
    /// `samples` are those of the motion with these terms and coefficients over the period.
    pub fn new(ramp: &Ramp, terms: &[i32], coefficients: &[f64], samples: &[f64]) -> Contact {
        let motion = Motion { terms, coefficients, samples };
        let passages = motion.passages(ramp);
        let length: f64 = passages.iter().map(|p| if p.enters { -p.tau } else { p.tau }).sum();
        let begun = f64::from(u8::from(samples.first().is_some_and(|u| ramp.is_beyond(*u))));
        Contact { share: begun + length / std::f64::consts::TAU, passages, samples: samples.len() }
    }

    /// Coefficients c_l of chi = sum_l c_l exp(i l tau), l = 0 ... top.
    pub fn spectrum(&self, top: usize) -> Vec<c64> {
        let mut out = vec![c64::new(0.0, 0.0); top + 1];
        out[0].re = self.share;
        for passage in &self.passages {
            let turn = c64::cis(-passage.tau);
            let mut z = c64::new(0.0, if passage.enters { -1.0 } else { 1.0 } / std::f64::consts::TAU);
            for (l, c) in out.iter_mut().enumerate().skip(1) {
                z *= turn;
                *c += z / l as f64;
            }
        }
        out
    }

    /// Adds to each sample's value what the mean over the interval around it has more of chi, times a slope.
    pub fn add_means(&self, slope: f64, out: &mut [f64]) {
        let per_step = self.samples as f64 / std::f64::consts::TAU;
        for passage in &self.passages {
            let past = passage.tau * per_step - passage.after as f64;
            let place = if past < 0.5 { passage.after } else { (passage.after + 1) % self.samples };
            out[place] += slope * if passage.enters { 0.5 - past } else { past - 0.5 };
        }
    }
}
