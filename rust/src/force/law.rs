//! The trait of a force law: what one file tells of one law.
use std::fmt::Debug;

use num_dual::DualNum;

/// The numbers that a law computes with: f64, duals, hyper-duals.
pub trait Scalar: DualNum<Primitive = f64> + Copy {}
impl<T: DualNum<Primitive = f64> + Copy> Scalar for T {}

/// Displacement u, its rate v, and the phase of the excitation (rad; zero outside of harmonic balance).
#[derive(Debug, Clone, Copy)]
pub struct At<D> {
    pub phase: f64,
    pub u: D,
    pub v: D,
}

/// The internal state z of a law, and how it goes on in time.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum State {
    None,
    /// so many numbers; `Law::force` makes the new ones from the old ones and the present u, whatever the time between
    Map(usize),
    /// so many numbers with z' = g(u, v, z)
    Rate(usize),
}

/// The effect by whose name a law can be left out.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Class {
    Spring,
    Friction,
    Contact,
}

/// What a law has stored.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Stored {
    /// the work of the force from u = 0
    Work,
    Energy(f64),
    /// the law is not a function of the state alone
    Unknown,
}

/// What crosses a surface: u, v, or the first state.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Crossing {
    Displacement,
    Rate,
    State,
}

/// On which side of a surface a law is held: it goes on smoothly across the surface. `Free`: on that where it is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Side {
    #[default]
    Free,
    Below,
    Above,
}

impl Side {
    /// Above the surface; `here`: where it is.
    pub fn is_above(self, here: bool) -> bool {
        match self {
            Side::Free => here,
            Side::Above => true,
            Side::Below => false,
        }
    }

    /// Of a distance.
    pub fn of(distance: f64) -> Side {
        if distance > 0.0 {
            Side::Above
        } else if distance < 0.0 {
            Side::Below
        } else {
            Side::Free
        }
    }

    pub fn opposite(self) -> Side {
        match self {
            Side::Free => Side::Free,
            Side::Above => Side::Below,
            Side::Below => Side::Above,
        }
    }

    /// Is the distance on the other side?
    pub fn is_left_by(self, distance: f64) -> bool {
        match self {
            Side::Free => false,
            Side::Above => distance < 0.0,
            Side::Below => distance > 0.0,
        }
    }
}

/// Where a law (or the rate of its state) is not smooth: u, v or z passes the value `at`.
#[derive(Debug, Clone, Copy)]
pub struct Surface {
    pub crossing: Crossing,
    pub at: f64,
    /// over which the kink is rounded; infinite where the slope of the force is continuous
    pub width: f64,
    /// a kink of a contact or of friction, not a knot between two smooth pieces
    pub kink: bool,
}

impl Surface {
    pub fn kink(at: f64, width: f64) -> Self {
        Surface { crossing: Crossing::Displacement, at, width, kink: true }
    }

    pub fn knot(at: f64) -> Self {
        Surface { crossing: Crossing::Displacement, at, width: 0.0, kink: false }
    }

    pub fn of_rate() -> Self {
        Surface { crossing: Crossing::Rate, at: 0.0, width: 0.0, kink: false }
    }

    pub fn of_state() -> Self {
        Surface { crossing: Crossing::State, ..Surface::of_rate() }
    }

    /// Signed distance of a displacement, its rate and the states.
    pub fn distance(&self, u: f64, v: f64, z: &[f64]) -> f64 {
        match self.crossing {
            Crossing::Displacement => u - self.at,
            Crossing::Rate => v - self.at,
            Crossing::State => z.first().map_or(0.0, |z| z - self.at),
        }
    }

    /// A kink that no width rounds: steps that go over it lose their order.
    pub fn is_sharp(&self) -> bool {
        match self.crossing {
            Crossing::Displacement => self.kink && (self.width == 0.0 || self.width.is_infinite()),
            Crossing::Rate | Crossing::State => self.width == 0.0,
        }
    }
}

/// A force law f(u, v, z) of one relative coordinate, `p` its parameters. `force` resists: the system feels `w f(w.x, w.x')` on
/// its left-hand side. One text, generic over the number type: tangents, derivatives by parameters and the march of the state all
/// come from it.
pub trait Law: Copy + Debug {
    /// The law with `n` parameters; None where it cannot have so many.
    fn with(n: usize) -> Option<Self>;

    fn n_params(&self) -> usize;

    /// The force. `z` is the state: of `State::Map` the one before, and `after` takes the present one.
    fn force<D: Scalar>(&self, at: At<D>, p: &[D], z: &[D], after: &mut [D]) -> D;

    fn state(&self) -> State {
        State::None
    }

    /// g of z' = g(u, v, z), for `State::Rate`.
    fn rate<D: Scalar>(&self, _at: At<D>, _p: &[D], _z: &[D], _rate: &mut [D]) {}

    /// The state after u came slowly from zero to where it is, and rests there.
    fn rest<D: Scalar>(&self, _u: D, _p: &[D], z: &mut [D]) {
        z.fill(D::from(0.0));
    }

    /// The size that a state has where the law works, for `State::Rate`: errors are measured by it; `length` is the characteristic
    /// value of u.
    fn state_size(&self, _p: &[f64], length: f64) -> f64 {
        length
    }

    /// So many equal laws in parallel, their parameters one after the other, none of which sees the state of another.
    fn parallel(&self) -> usize {
        1
    }

    /// False where neither force nor state depends on v: a velocity tangent is then not even computed.
    fn uses_velocity(&self) -> bool {
        false
    }

    /// Degree of the law as a polynomial in (u, v), None where it is not one: decides how many samples are alias-free.
    fn degree(&self) -> Option<usize> {
        None
    }

    fn class(&self) -> Class {
        Class::Spring
    }

    fn stored(&self, _u: f64, _p: &[f64], _z: &[f64]) -> Stored {
        match (self.state(), self.uses_velocity()) {
            (State::None, false) => Stored::Work,
            _ => Stored::Unknown,
        }
    }

    fn surfaces(&self, _p: &[f64]) -> Vec<Surface> {
        Vec::new()
    }

    /// Held on these sides of its sharp surfaces, in their order.
    fn held(self, _sides: &[Side]) -> Self {
        self
    }

    /// Of a law with sliders, which its states are: how far each of them stays behind u as it slides. Empty where they cannot be held.
    fn sliders(&self, _p: &[f64]) -> Vec<f64> {
        Vec::new()
    }

    /// Its sliders held.
    fn sliding(self, _sliders: &[Slider]) -> Self {
        self
    }
}

/// How a slider is held.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Slider {
    /// sticks or slides as the law says
    #[default]
    Free,
    Sticks,
    SlidesUp,
    SlidesDown,
}

impl Slider {
    /// By the sides of its upper limit, above which it slides up, and of the lower one.
    pub fn of(upper: Side, lower: Side) -> Self {
        match (upper, lower) {
            (Side::Free, _) | (_, Side::Free) => Slider::Free,
            (Side::Above, _) => Slider::SlidesUp,
            (_, Side::Below) => Slider::SlidesDown,
            (Side::Below, Side::Above) => Slider::Sticks,
        }
    }
}
