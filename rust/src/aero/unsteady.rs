//! Air that takes its time at a section: laws with states z, each z' = r (target - z).
//!
//! ```text
//! dynamic inflow    t1 Y' = (1 - k) W - Y,   t2 V' = Y + k W - V,   k = 0.6
//!                   t1 = 1.1 / (1 - 1.3 a) R / U,   t2 = (.39 - .26 (r/R)^2) t1
//! attached flow     z_i' = 2 b_i |u| / c (w - z_i),   w_eff = w + sum A_i (z_i - w)
//! dynamic stall     f' = |u| / (lag c) (f_st - f),    cl = cl_st + (f - f_st) (cl_att - cl_sep)
//! ```
//! W is the induced velocity that balances momentum at once, V the one that acts, both along the annulus's axis and around it (S. Oeye,
//! in H. Snel and J. G. Schepers, ECN-C--94-107, 1995); w the downwash at three quarters of the chord, w_eff the one that lift sees (R. T.
//! Jones, NACA Report 681, 1940); f the attached part of the chord (S. Oeye, ETSU-N-118, 1991; M. H. Hansen, M. Gaunaa and H. A. Madsen,
//! Risoe-R-1354, 2004). No target and no rate sees a later state, so that each equation z = z0 + c r (target - z) has its closed form.
use crate::spatial::Real;

/// Share of the quasi-steady induced velocity that the first lag passes at once.
const SHARE: f64 = 0.6;
/// Largest axial induction in the time constants: the fit holds below it.
const MOST_INDUCTION: f64 = 0.5;
/// Jones' weights and rates of Wagner's function, 1 - sum A exp(-b s), s in half chords.
pub const WEIGHTS: [f64; 2] = [0.165, 0.335];
pub const RATES: [f64; 2] = [0.0455, 0.3];

/// The most states of a section.
pub const MOST: usize = 7;

/// The laws that act, whose states follow each other in this order.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Unsteady {
    /// Y and V, each along the axis and around it
    pub inflow: bool,
    /// z_1 and z_2
    pub attached: bool,
    /// f
    pub stall: bool,
}

impl Unsteady {
    pub fn states(&self) -> usize {
        4 * usize::from(self.inflow) + 2 * usize::from(self.attached) + usize::from(self.stall)
    }

    /// Numbers that a motion remembers of a section.
    pub fn memory(&self) -> usize {
        let n = self.states();
        if n == 0 { 0 } else { n + 1 }
    }

    /// Is this state a velocity? The others are shares.
    pub fn is_velocity(&self, state: usize) -> bool {
        state < self.states() - usize::from(self.stall)
    }
}

/// What a motion remembers, (z0, c) of z = z0 + c z'; c is infinite where the states rest, as of the laws of `force`.
#[derive(Debug, Clone, Copy)]
pub struct Memory<T> {
    pub base: [T; MOST],
    pub gain: T,
}

impl<T: Real> Memory<T> {
    pub fn resting() -> Self {
        Memory { base: [T::zero(); MOST], gain: T::from(f64::INFINITY) }
    }

    /// From the numbers of a section; none are at rest.
    pub fn read(numbers: &[T]) -> Self {
        let mut out = Memory::resting();
        if let Some((gain, base)) = numbers.split_last() {
            out.base[..base.len()].copy_from_slice(base);
            out.gain = *gain;
        }
        out
    }

    pub fn map<U: Real>(&self, f: impl Fn(T) -> U) -> Memory<U> {
        Memory { base: self.base.map(&f), gain: f(self.gain) }
    }
}

/// The states one after the other, as a section works them out.
#[derive(Debug, Clone, Copy)]
pub struct States<T> {
    memory: Memory<T>,
    known: usize,
    pub value: [T; MOST],
    pub rate: [T; MOST],
}

impl<T: Real> States<T> {
    pub fn new(memory: Memory<T>) -> Self {
        States { memory, known: 0, value: [T::zero(); MOST], rate: [T::zero(); MOST] }
    }

    /// The next state, of z' = r (target - z).
    pub fn next(&mut self, r: T, target: T) -> T {
        let (k, gain) = (self.known, self.memory.gain);
        let z =
            if gain.re().is_infinite() { target } else { (self.memory.base[k] + gain * r * target) / (gain * r + 1.0) };
        self.value[k] = z;
        self.rate[k] = r * (target - z);
        self.known += 1;
        z
    }

    /// The velocities that act, along the axis and around it, of those that balance; U is the wind along the axis.
    pub fn lagging(&mut self, balanced: [T; 2], wind: T, radius: T, share: T) -> [T; 2] {
        let speed = if wind.re() < 0.0 { -wind } else { wind };
        let mut induction = if speed.re() > 0.0 { -balanced[0] / wind } else { T::zero() };
        induction = if induction.re() < 0.0 {
            T::zero()
        } else if induction.re() > MOST_INDUCTION {
            T::from(MOST_INDUCTION)
        } else {
            induction
        };
        let r = speed / radius * (-induction * 1.3 + 1.0) / 1.1;
        let inner = balanced.map(|w| self.next(r, w * (1.0 - SHARE)));
        let r = r / (-share * share * 0.26 + 0.39);
        [self.next(r, inner[0] + balanced[0] * SHARE), self.next(r, inner[1] + balanced[1] * SHARE)]
    }

    /// The downwash that lift sees; `passage` is the speed over the half chord.
    pub fn attached(&mut self, downwash: T, passage: T) -> T {
        let late = [0, 1].map(|i| (self.next(passage * RATES[i], downwash) - downwash) * WEIGHTS[i]);
        downwash + late[0] + late[1]
    }
}

/// Kirchhoff's flow behind a section: slope and angle of no lift of its attached flow, and the lag of separation in chords.
#[derive(Debug, Clone, Copy)]
pub struct Separation<T> {
    pub slope: T,
    pub zero: T,
    pub lag: T,
}

impl<T: Real> Separation<T> {
    /// The attached part that the static lift tells, cl_att = slope (alpha - zero), and cl_att - cl_sep;
    /// cl = cl_att ((1 + sqrt f) / 2)^2.
    pub fn parts(&self, angle: T, lift: T) -> (T, T) {
        let attached = self.slope * (angle - self.zero);
        let share = if attached.re() == 0.0 { T::one() } else { lift / attached };
        if share.re() >= 1.0 {
            // cl_sep of f = 1 is half of cl_att
            return (T::one(), attached * 0.5);
        }
        if share.re() <= 0.25 {
            return (T::zero(), attached - lift);
        }
        let root = share.sqrt();
        let f = root * 2.0 - 1.0;
        (f * f, attached - attached * (root * 3.0 - 1.0) / (root * 4.0))
    }

    pub fn map<U: Real>(&self, f: impl Fn(T) -> U) -> Separation<U> {
        Separation { slope: f(self.slope), zero: f(self.zero), lag: f(self.lag) }
    }
}
