//! Force laws of one relative coordinate: u displacement, v its rate, p parameters, z internal state.
//!
//! A law is one file with an `impl Law`, and one line in the table below; whatever an analysis asks of a law it asks the trait.
//!
//! | code | law | parameters |
//! |---|---|---|
//! | 0 | cubic | k3 |
//! | 1 | polynomial in u | c_0 c_1 ... |
//! | 2 | polynomials in u and in v | c_0 ... c_m d_0 ... d_m (same length) |
//! | 3 | one-sided gap | k, gap, smoothing |
//! | 4 | two-sided gap | k, gap, smoothing |
//! | 5 | regularised Coulomb friction | friction force, v_ref |
//! | 6 | Hertz contact | k, exponent, gap |
//! | 7 | table, monotone cubic spline | u_0 ... u_m f_0 ... f_m |
//! | 8 | Van der Pol | mu |
//! | 9 | Jenkins | k, slip force |
//! | 10 | Iwan | k_1 f_1 k_2 f_2 ... |
//! | 11 | stiffness that varies with the phase | k, order, phase |
//! | 12 | Maxwell, generalised | k_1 tau_1 k_2 tau_2 ... |
//! | 13 | Bouc-Wen | k, alpha, beta, gamma, n |
//! | 14 | LuGre | f_c, f_s, v_s, s0, s1, s2 |
//!
//! What a motion remembers of a law with a map are its states. Of a law with z' = g(u, v, z) it remembers the pair (z0, c) of the
//! equation z = z0 + c g(u, v, z), which every implicit scheme solves for a stage: `memory` = [z0 ..., c]. Between steps c = 0, and
//! c is infinite where the law rests: then g(u, 0, z) = 0.
mod bouc_wen;
mod coulomb_tanh;
mod cubic;
mod function;
mod gap;
mod hertz;
mod iwan;
mod jenkins;
mod law;
mod lugre;
mod maxwell;
mod polynomial;
mod polynomial_velocity;
mod table;
mod van_der_pol;
mod varying_stiffness;

use nalgebra::Const;
use num_dual::{Derivative, Dual, DualSVec64};

pub use function::{External, FunctionLaw};
pub use law::{At, Class, Crossing, Scalar, Side, Slider, State, Stored, Surface};

use crate::error::{Error, Result};

use law::Law;

macro_rules! laws {
    ($($code:literal => $file:ident::$name:ident),* $(,)?) => {
        /// Any of the laws.
        #[derive(Debug, Clone, Copy, PartialEq, Eq)]
        pub enum AnyLaw {
            $($name($file::$name)),*
        }

        impl AnyLaw {
            /// The law with this code and `n` parameters.
            pub fn from_code(code: i64, n: usize) -> Result<AnyLaw> {
                let law = match code {
                    $($code => $file::$name::with(n).map(AnyLaw::$name),)*
                    _ => return Err(Error::model(format!("no law has the code {code}"))),
                };
                law.ok_or_else(|| Error::model(format!("a law of the code {code} cannot have {n} parameters")))
            }

            pub fn code(&self) -> i64 {
                match self { $(AnyLaw::$name(_) => $code),* }
            }

            pub fn n_params(&self) -> usize {
                match self { $(AnyLaw::$name(law) => law.n_params()),* }
            }

            pub fn state(&self) -> State {
                match self { $(AnyLaw::$name(law) => law.state()),* }
            }

            /// So many equal laws in parallel, none of which sees the state of another.
            pub fn parallel(&self) -> usize {
                match self { $(AnyLaw::$name(law) => law.parallel()),* }
            }

            /// False where the force does not depend on v: a velocity tangent is then not even computed.
            pub fn uses_velocity(&self) -> bool {
                match self { $(AnyLaw::$name(law) => law.uses_velocity()),* }
            }

            /// Degree of the law as a polynomial in (u, v), None where it is not one.
            pub fn degree(&self) -> Option<usize> {
                match self { $(AnyLaw::$name(law) => law.degree()),* }
            }

            pub fn class(&self) -> Class {
                match self { $(AnyLaw::$name(law) => law.class()),* }
            }

            pub fn surfaces(&self, p: &[f64]) -> Vec<Surface> {
                match self { $(AnyLaw::$name(law) => law.surfaces(p)),* }
            }

            /// Held on these sides of its sharp surfaces, in their order.
            pub fn held(self, sides: &[Side]) -> Self {
                match self { $(AnyLaw::$name(law) => AnyLaw::$name(law.held(sides))),* }
            }

            /// How far each slider stays behind u as it slides.
            pub fn sliders(&self, p: &[f64]) -> Vec<f64> {
                match self { $(AnyLaw::$name(law) => law.sliders(p)),* }
            }

            /// Its sliders held.
            pub fn sliding(self, sliders: &[Slider]) -> Self {
                match self { $(AnyLaw::$name(law) => AnyLaw::$name(law.sliding(sliders))),* }
            }

            pub fn stored(&self, u: f64, p: &[f64], z: &[f64]) -> Stored {
                match self { $(AnyLaw::$name(law) => law.stored(u, p, z)),* }
            }

            pub fn state_size(&self, p: &[f64], length: f64) -> f64 {
                match self { $(AnyLaw::$name(law) => law.state_size(p, length)),* }
            }

            fn law_force<D: Scalar>(&self, at: At<D>, p: &[D], z: &[D], after: &mut [D]) -> D {
                match self { $(AnyLaw::$name(law) => law.force(at, p, z, after)),* }
            }

            fn law_rate<D: Scalar>(&self, at: At<D>, p: &[D], z: &[D], rate: &mut [D]) {
                match self { $(AnyLaw::$name(law) => law.rate(at, p, z, rate)),* }
            }

            fn law_rest<D: Scalar>(&self, u: D, p: &[D], z: &mut [D]) {
                match self { $(AnyLaw::$name(law) => law.rest(u, p, z)),* }
            }
        }
    };
}

laws! {
    0 => cubic::Cubic,
    1 => polynomial::Polynomial,
    2 => polynomial_velocity::PolynomialVelocity,
    3 => gap::Gap,
    4 => gap::GapBilateral,
    5 => coulomb_tanh::CoulombTanh,
    6 => hertz::Hertz,
    7 => table::Table,
    8 => van_der_pol::VanDerPol,
    9 => jenkins::Jenkins,
    10 => iwan::Iwan,
    11 => varying_stiffness::VaryingStiffness,
    12 => maxwell::Maxwell,
    13 => bouc_wen::BoucWen,
    14 => lugre::LuGre,
}

/// Newton steps of a state; beyond, it is not a number.
const ITERATIONS: usize = 60;

/// A spring k with a dashpot in series, k s / (s + rate): how a law with a relaxing state answers small motions about rest, beside
/// its slope at rest.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Relaxation {
    pub k: f64,
    pub rate: f64,
}

/// Numbers with their slopes by u, v and a state z.
pub type OfState = DualSVec64<3>;

/// The one of these along which its slope is one.
fn along(x: f64, which: usize) -> OfState {
    OfState::new(x, Derivative::derivative_generic(Const::<3>, Const::<1>, which))
}

/// Numbers of a law, which depend on none of them.
pub fn constants(p: &[f64]) -> Vec<OfState> {
    p.iter().map(|x| OfState::from_re(*x)).collect()
}

/// Force and rate of a state z: values and slopes by u, v and z.
#[derive(Debug, Clone, Copy)]
pub struct StateSlopes {
    pub z: f64,
    pub force: [f64; 4],
    pub rate: [f64; 4],
    /// |g| + |u g_u| + |v g_v| + |z g_z|: what rounding of the rate is in proportion to
    pub rate_size: f64,
}

impl AnyLaw {
    /// Internal states.
    pub fn n_states(&self) -> usize {
        match self.state() {
            State::None => 0,
            State::Map(n) | State::Rate(n) => n,
        }
    }

    /// Numbers that a motion remembers of it.
    pub fn n_memory(&self) -> usize {
        match self.state() {
            State::None => 0,
            State::Map(n) => n,
            State::Rate(n) => n + 1,
        }
    }

    pub fn has_rates(&self) -> bool {
        matches!(self.state(), State::Rate(_))
    }

    pub fn has_map(&self) -> bool {
        matches!(self.state(), State::Map(_))
    }

    /// The force; `memory` is the one before, `after` the present one (both of length `n_memory`), `p` the `n_params` parameters.
    pub fn force<D: Scalar>(&self, u: D, v: D, p: &[D], memory: &[D], after: &mut [D]) -> D {
        self.force_at(0.0, u, v, p, memory, after)
    }

    /// The force at a phase of the excitation (rad).
    #[inline]
    pub fn force_at<D: Scalar>(&self, phase: f64, u: D, v: D, p: &[D], memory: &[D], after: &mut [D]) -> D {
        let at = At { phase, u, v };
        let State::Rate(n) = self.state() else {
            return self.law_force(at, p, memory, after);
        };
        after.copy_from_slice(memory);
        after[n] = D::from(0.0);
        if memory[n].re().is_infinite() {
            self.law_rest(u, p, &mut after[..n]);
        } else if memory[n].re() != 0.0 {
            self.close(at, p, (&memory[..n], memory[n]), &mut after[..n]);
        }
        self.law_force(at, p, &after[..n], &mut [])
    }

    /// The force, the memory updated in place.
    pub fn eval<D: Scalar>(&self, u: D, v: D, p: &[D], memory: &mut [D]) -> D {
        let mut old = [D::from(0.0); 8];
        if memory.len() <= old.len() {
            let old = &mut old[..memory.len()];
            old.copy_from_slice(memory);
            self.force(u, v, p, old, memory)
        } else {
            let old = memory.to_vec();
            self.force(u, v, p, &old, memory)
        }
    }

    /// z' at the state that belongs to the memory; zero of laws without rates. Length `n_memory`.
    pub fn state_rate<D: Scalar>(&self, u: D, v: D, p: &[D], memory: &[D]) -> Vec<D> {
        let mut out = vec![D::from(0.0); memory.len()];
        if let State::Rate(n) = self.state() {
            let mut z = memory.to_vec();
            self.eval(u, v, p, &mut z);
            self.law_rate(At { phase: 0.0, u, v }, p, &z[..n], &mut out[..n]);
        }
        out
    }

    /// The memory of rest, wherever that is.
    pub fn rest_memory<D: Scalar>(&self) -> Vec<D> {
        let mut out = vec![D::from(0.0); self.n_memory()];
        if let (true, Some(gain)) = (self.has_rates(), out.last_mut()) {
            *gain = D::from(f64::INFINITY);
        }
        out
    }

    /// The states of rest at u, and c = 0.
    fn resting<D: Scalar>(&self, u: D, p: &[D]) -> Vec<D> {
        let mut out = vec![D::from(0.0); self.n_memory()];
        self.law_rest(u, p, &mut out[..self.n_states()]);
        out
    }

    /// The part of the law with so many in parallel: itself, and the places of its parameters and of its states.
    pub fn part(&self, i: usize) -> Result<(AnyLaw, std::ops::Range<usize>)> {
        let n = self.n_params() / self.parallel();
        Ok((AnyLaw::from_code(self.code(), n)?, i * n..(i + 1) * n))
    }

    /// Force and rate of a law with one state, with their slopes.
    pub fn state_slopes(&self, u: f64, v: f64, p: &[OfState], z: f64) -> StateSlopes {
        let (at, z) = (At { phase: 0.0, u: along(u, 0), v: along(v, 1) }, [along(z, 2)]);
        let mut rate = z;
        self.law_rate(at, p, &z, &mut rate);
        let all = |x: OfState| {
            let slopes = x.eps.unwrap_generic(Const::<3>, Const::<1>);
            [x.re, slopes[0], slopes[1], slopes[2]]
        };
        let (force, rate) = (all(self.law_force(at, p, &z, &mut [])), all(rate[0]));
        let sizes = [1.0, u, v, z[0].re];
        let rate_size = rate.iter().zip(sizes).map(|(slope, size)| (slope * size).abs()).sum();
        StateSlopes { z: z[0].re, force, rate, rate_size }
    }

    /// How its states answer small motions about rest at u, one for each state that relaxes.
    pub fn relaxations(&self, u: f64, p: &[f64]) -> Vec<Relaxation> {
        let State::Rate(n) = self.state() else {
            return Vec::new();
        };
        let lift = |x: &[f64]| x.iter().map(|x| Dual::<f64>::from_re(*x)).collect::<Vec<_>>();
        let (pd, z) = (lift(p), lift(&self.resting(u, p)[..n]));
        let along = |i: usize, du: f64, dv: f64, dz: f64| {
            let mut z = z.clone();
            z[i].eps = dz;
            let at = At { phase: 0.0, u: Dual::new(u, du), v: Dual::new(0.0, dv) };
            let mut rate = z.clone();
            self.law_rate(at, &pd, &z, &mut rate);
            (self.law_force(at, &pd, &z, &mut []).eps, rate[i].eps)
        };
        let of = |i: usize| {
            let (f_z, g_z) = along(i, 0.0, 0.0, 1.0);
            let (g_u, g_v) = (along(i, 1.0, 0.0, 0.0).1, along(i, 0.0, 1.0, 0.0).1);
            (g_z != 0.0).then(|| Relaxation { k: f_z * (g_v + g_u / g_z), rate: -g_z })
        };
        (0..n).filter_map(of).collect()
    }

    /// z = z0 + c g(u, v, z): Newton's method on values, and once more for each order of derivative. Each state by itself: no
    /// state of a law sees another.
    fn close<D: Scalar>(&self, at: At<D>, p: &[D], (z0, c): (&[D], D), z: &mut [D]) {
        let slopes = self.settle(at, p, (z0, c), z);
        let mut rate = z.to_vec();
        for _ in 0..=D::NDERIV {
            self.law_rate(at, p, z, &mut rate);
            for (i, slope) in slopes.iter().enumerate() {
                z[i] -= (z[i] - z0[i] - c * rate[i]) / *slope;
            }
        }
    }

    /// The values of z, and 1 - c dg/dz there.
    fn settle<D: Scalar>(&self, at: At<D>, p: &[D], (z0, c): (&[D], D), z: &mut [D]) -> Vec<f64> {
        let lift = |x: &D| Dual::<f64>::from_re(x.re());
        let here = At { phase: at.phase, u: lift(&at.u), v: lift(&at.v) };
        let (p, c): (Vec<_>, f64) = (p.iter().map(lift).collect(), c.re());
        let mut y: Vec<Dual<f64>> = z0.iter().map(lift).collect();
        let mut rate = y.clone();
        let mut slopes = vec![1.0; y.len()];
        let mut converged = false;
        for _ in 0..ITERATIONS {
            // one sweep gives all slopes: a state sees itself alone
            y.iter_mut().for_each(|y| y.eps = 1.0);
            self.law_rate(here, &p, &y, &mut rate);
            converged = true;
            for (i, y) in y.iter_mut().enumerate() {
                slopes[i] = 1.0 - c * rate[i].eps;
                let step = (y.re - z0[i].re() - c * rate[i].re) / slopes[i];
                y.re -= step;
                converged &= step.abs() <= 4.0 * f64::EPSILON * (y.re.abs() + z0[i].re().abs());
            }
            if converged {
                break;
            }
        }
        for (z, y) in z.iter_mut().zip(&y) {
            *z = D::from(if converged { y.re } else { f64::NAN });
        }
        slopes
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use num_dual::Dual64;

    fn law(code: i64, p: &[f64]) -> AnyLaw {
        AnyLaw::from_code(code, p.len()).unwrap()
    }

    fn all() -> Vec<(AnyLaw, Vec<f64>)> {
        let numbers: [(i64, &[f64]); 16] = [
            (0, &[0.7]),
            (1, &[0.1, 2.0, -0.3, 0.5]),
            (2, &[0.0, 1.0, 0.2, 0.0, 0.3, 0.4]),
            (3, &[5.0, 0.2, 0.0]),
            (3, &[5.0, 0.2, 0.05]),
            (4, &[5.0, 0.2, 0.01]),
            (5, &[2.0, 0.1]),
            (6, &[3.0, 1.5, 0.1]),
            (7, &[-1.0, -0.5, 0.0, 0.5, 1.0, -3.0, -1.0, 0.0, 0.4, 2.0]),
            (8, &[1.3]),
            (9, &[4.0, 1.1]),
            (10, &[4.0, 1.1, 2.0, 0.3]),
            (11, &[2.0, 1.0, 0.3]),
            (12, &[2.0, 0.7, 1.1, 3.0]),
            (13, &[3.0, 0.1, 4.0, 1.5, 1.7]),
            (14, &[1.0, 1.5, 0.1, 30.0, 0.6, 0.4]),
        ];
        numbers.into_iter().map(|(code, p)| (law(code, p), p.to_vec())).collect()
    }

    fn value(law: AnyLaw, x: [f64; 2], p: &[f64]) -> f64 {
        let z = vec![0.05; law.n_memory()];
        law.force(x[0], x[1], p, &z, &mut z.clone())
    }

    #[test]
    fn tangents_are_the_slopes_of_the_force() {
        for (law, p) in all() {
            assert_eq!(AnyLaw::from_code(law.code(), p.len()).ok(), Some(law));
            for (u, v) in [(0.37, -0.2), (-0.61, 0.4), (1.4, 0.03), (0.0, 0.0)] {
                let pd: Vec<Dual64> = p.iter().map(|&x| Dual64::from(x)).collect();
                let z = vec![Dual64::from(0.05); law.n_memory()];
                for arg in 0..2 {
                    let seed = |i: usize, x: f64| Dual64::new(x, f64::from(u8::from(i == arg)));
                    let slope = law.force(seed(0, u), seed(1, v), &pd, &z, &mut z.clone()).eps;
                    let h = 1e-6;
                    let at = |d: f64| value(law, if arg == 0 { [u + d, v] } else { [u, v + d] }, &p);
                    // on a kink of the rate the slope is that of the side of positive rates
                    let is_kink = |s: &Surface| matches!(s.crossing, Crossing::Rate) && s.at == v;
                    let difference = if arg == 1 && law.surfaces(&p).iter().any(is_kink) {
                        (4.0 * at(h) - 3.0 * at(0.0) - at(2.0 * h)) / (2.0 * h)
                    } else {
                        (at(h) - at(-h)) / (2.0 * h)
                    };
                    assert!(
                        (slope - difference).abs() < 1e-7 * (1.0 + slope.abs()),
                        "{law:?} {u} {v} {slope} {difference}"
                    );
                }
            }
        }
    }

    #[test]
    fn a_table_is_monotone_and_goes_through_its_points() {
        let (u, f): ([f64; 5], [f64; 5]) = ([0.0, 1.0, 2.0, 3.0, 10.0], [0.0, 0.1, 5.0, 5.0, 6.0]);
        for (x, y) in u.iter().zip(f) {
            assert!((table::pchip(*x, &u, &f) - y).abs() < 1e-14);
        }
        let samples: Vec<f64> = (0..=1000).map(|i| table::pchip(0.01 * f64::from(i), &u, &f)).collect();
        assert!(samples.windows(2).all(|w| w[1] >= w[0] - 1e-14));
    }

    #[test]
    fn friction_far_from_the_sticking_point_has_no_nan() {
        let slope = law(5, &[2.0, 1e-6]).force(
            Dual64::from(0.0),
            Dual64::new(1e6, 1.0),
            &[Dual64::from(2.0), Dual64::from(1e-6)],
            &[],
            &mut [],
        );
        assert!(slope.re == 2.0 && slope.eps == 0.0);
    }

    #[test]
    fn wrong_codes_and_counts_are_errors() {
        assert!(AnyLaw::from_code(99, 1).is_err());
        assert!(AnyLaw::from_code(0, 2).is_err());
        assert!(AnyLaw::from_code(7, 5).is_err());
        assert!(AnyLaw::from_code(1, 0).is_err());
    }

    /// For gains c of implicit stages as for c = 0: the state that the memory stands for meets its equation.
    #[test]
    fn states_meet_their_implicit_equation() {
        for (law, p) in all().into_iter().filter(|(law, _)| law.has_rates()) {
            let n = law.n_states();
            for (u, v, c) in [(0.37, -0.2, 0.05), (-0.61, 0.4, 3.0), (0.1, 0.0, 0.2), (0.2, 5.0, 0.0)] {
                let mut memory = vec![0.03; n + 1];
                memory[n] = c;
                let mut after = memory.clone();
                law.force(u, v, &p, &memory, &mut after);
                let rate = law.state_rate(u, v, &p, &after);
                for i in 0..n {
                    assert!((after[i] - 0.03 - c * rate[i]).abs() < 1e-14, "{law:?} {u} {v} {c}");
                }
                assert!(after[n] == 0.0 && rate[n] == 0.0);
            }
        }
    }

    /// At rest nothing changes; the slope of the resting force is that of first loading.
    #[test]
    fn resting_states_are_those_of_slow_loading() {
        for (law, p) in all().into_iter().filter(|(law, _)| law.has_rates()) {
            for u in [0.3, -0.2] {
                let z = law.resting(u, &p);
                assert!(law.state_rate(u, 0.0, &p, &z).iter().all(|g| g.abs() < 1e-14), "{law:?}");
                let h = 1e-4;
                let ahead = law.resting(u + h, &p);
                let behind = law.resting(u - h, &p);
                let slow = 1e-9_f64.copysign(u);
                let rate = law.state_rate(u, slow, &p, &z)[0] / slow;
                if !law.relaxations(u, &p).is_empty() {
                    continue;
                }
                assert!(((ahead[0] - behind[0]) / (2.0 * h) - rate).abs() < 1e-6, "{law:?} {rate}");
            }
        }
    }

    /// k i w tau / (1 + i w tau) of every branch.
    #[test]
    fn maxwell_elements_relax() {
        let p = [2.0, 0.7, 1.1, 3.0];
        let found = law(12, &p).relaxations(0.4, &p);
        for (r, p) in found.iter().zip(p.chunks_exact(2)) {
            assert!((r.k - p[0]).abs() < 1e-15 && (r.rate - 1.0 / p[1]).abs() < 1e-15);
        }
        assert_eq!(found.len(), 2);
        assert!(
            law(14, &[1.0, 1.5, 0.1, 30.0, 0.6, 0.4]).relaxations(0.0, &[1.0, 1.5, 0.1, 30.0, 0.6, 0.4]).is_empty()
        );
    }
}
