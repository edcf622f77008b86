//! The force of the air on one section of a blade.
//!
//! The section's axes in the world: `span` outwards, `forward` to the leading edge of a section without twist, `suction` to the side that
//! lift pushes to. With the wind u relative to the section across the span,
//! ```text
//! alpha = atan2(u.suction, -u.forward) - twist
//! F = rho c b |u| (cl (u.suction forward - u.forward suction) + cd u) / 2,   M = rho c^2 b |u|^2 cm span / 2
//! ```
//! at the aerodynamic centre, b the width of the strip. u is that at three quarters of the chord. Laws with states: see `unsteady`.
//! In attached flow that changes in time the turning section carries air along: pi rho c^2 b |u_c| w / 4 at three quarters of the chord,
//! w its rate about the span, u_c the wind along the chord (Theodorsen's term U alpha'). Terms with accelerations are left out.
use std::f64::consts::FRAC_PI_4;

use super::annulus::Annulus;
use super::polar::Airfoil;
use super::unsteady::{MOST, Memory, Separation, States, Unsteady};
use crate::spatial::{M3, Real, Six, V3, arctan2, skew};

/// How the induced velocity comes about.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Inflow {
    /// given, as by a wake
    Given,
    /// blade elements and momentum of each annulus, at once or behind two lags
    Momentum,
}

/// Numbers of one section.
#[derive(Debug, Clone, Copy)]
pub struct Section<'p, T: Real> {
    pub airfoil: Airfoil<'p, T>,
    pub density: T,
    pub width: T,
    pub chord: T,
    /// of the section to the untwisted axes, pitch included
    pub twist: T,
    /// places of the aerodynamic centre and of three quarters of the chord ahead of the section's point
    pub centre: T,
    pub rear: T,
    pub solidity: T,
    pub loss: [T; 2],
    pub inflow: Inflow,
    /// axis of the annuli, down the wind
    pub axis: V3<T>,
    pub unsteady: Unsteady,
    /// of the rotor, and the section's over it
    pub radius: T,
    pub span: T,
    pub separation: Separation<T>,
}

/// Where a section is and how it moves.
#[derive(Debug, Clone, Copy)]
pub struct Place<T: Real> {
    pub p: V3<T>,
    /// columns: span, forward, suction
    pub r: M3<T>,
    pub velocity: Six<T>,
}

/// What the air does at a section.
#[derive(Debug, Clone, Copy)]
pub struct Flow<T: Real> {
    pub angle: T,
    pub speed: T,
    /// m^2/s
    pub circulation: T,
    /// N: of the whole strip, at the aerodynamic centre
    pub force: V3<T>,
    pub moment: V3<T>,
    /// the aerodynamic centre, and three quarters of the chord
    pub centre: V3<T>,
    pub rear: V3<T>,
    /// to the leading edge, with the twist
    pub forward: V3<T>,
    /// what annuli or a wake induce
    pub induced: V3<T>,
    /// states of the laws that take their time, and their rates
    pub states: [T; MOST],
    pub rates: [T; MOST],
}

impl<'p, T: Real> Section<'p, T> {
    /// The same section with other numbers.
    pub fn map<U: Real>(&self, f: impl Fn(T) -> U) -> Section<'p, U> {
        Section {
            airfoil: self.airfoil.with_share(f(self.airfoil.share)),
            density: f(self.density),
            width: f(self.width),
            chord: f(self.chord),
            twist: f(self.twist),
            centre: f(self.centre),
            rear: f(self.rear),
            solidity: f(self.solidity),
            loss: self.loss.map(&f),
            inflow: self.inflow,
            axis: self.axis.map(&f),
            unsteady: self.unsteady,
            radius: f(self.radius),
            span: f(self.span),
            separation: self.separation.map(&f),
        }
    }

    fn forward(&self, place: &Place<T>) -> V3<T> {
        let (s, c) = self.twist.sin_cos();
        place.r.column(1) * c - place.r.column(2) * s
    }

    /// `air` is the velocity of the air at a point, without what annuli induce.
    pub fn flow(&self, place: &Place<T>, memory: &Memory<T>, air: impl Fn(&V3<T>) -> V3<T>) -> Flow<T> {
        let (span, y, z) = (column(&place.r, 0), column(&place.r, 1), column(&place.r, 2));
        let forward = self.forward(place);
        let rear = place.p + forward * self.rear;
        let arm = rear - place.p;
        let outside = air(&rear);
        let wind = outside - (place.velocity.l + place.velocity.a.cross(&arm));
        let mut states = States::new(*memory);
        let induced = match self.inflow {
            Inflow::Given => V3::zeros(),
            Inflow::Momentum => self.annulus(&[span, y, z], &wind, &outside, &mut states),
        };
        let u = wind + induced;
        let passage = if self.unsteady == Unsteady::default() { T::zero() } else { speed_of(u.dot(&z), u.dot(&y)) };
        let (u, carried) = self.attached(u, &[span, forward], place, passage, &mut states);
        let (normal, along) = (u.dot(&z), -u.dot(&y));
        let speed = speed_of(normal, along);
        let angle = if speed.re() == 0.0 { -self.twist } else { arctan2(normal, along) - self.twist };
        let [mut cl, cd, cm] = self.airfoil.coefficients(angle);
        if self.unsteady.stall {
            let (steady, gap) = self.separation.parts(angle, cl);
            let f = states.next(passage / (self.separation.lag * self.chord), steady);
            cl += (f - steady) * gap;
        }
        let size = self.density * self.chord * self.width * speed * 0.5;
        let force = (y * normal + z * along) * (size * cl) + (z * normal - y * along) * (size * cd);
        let centre = place.p + forward * self.centre;
        Flow {
            angle,
            speed,
            circulation: self.chord * speed * cl * 0.5,
            force: force + carried,
            moment: span * (size * speed * self.chord * cm) + (rear - centre).cross(&carried),
            centre,
            rear,
            forward,
            induced,
            states: states.value,
            rates: states.rate,
        }
    }

    /// The wind that acts in attached flow, and the force of the air that the turning section carries along, at its rear.
    fn attached(
        &self,
        u: V3<T>,
        [span, forward]: &[V3<T>; 2],
        place: &Place<T>,
        speed: T,
        states: &mut States<T>,
    ) -> (V3<T>, V3<T>) {
        if !self.unsteady.attached {
            return (u, V3::zeros());
        }
        let suction = span.cross(forward);
        let downwash = u.dot(&suction);
        let acting = states.attached(downwash, speed * 2.0 / self.chord);
        // nose up turns forward towards suction, about the span
        let carried = self.density * self.chord * self.chord * self.width * FRAC_PI_4;
        let along = -u.dot(forward);
        (u + suction * (acting - downwash), suction * (carried * along * place.velocity.a.dot(span)))
    }

    /// Force and moment about the section's point.
    pub fn wrench(&self, place: &Place<T>, memory: &Memory<T>, air: impl Fn(&V3<T>) -> V3<T>) -> Six<T> {
        let flow = self.flow(place, memory, air);
        Six::new(flow.force, flow.moment + (flow.centre - place.p).cross(&flow.force))
    }

    /// The velocity that the section's annulus adds to the wind. Its axes lie across the span; torsion turns the section in them.
    fn annulus(&self, [span, y, z]: &[V3<T>; 3], wind: &V3<T>, outside: &V3<T>, states: &mut States<T>) -> V3<T> {
        let across = self.axis - span * self.axis.dot(span);
        let size = across.dot(&across);
        if size.re() == 0.0 {
            if self.unsteady.inflow {
                states.lagging([T::zero(); 2], T::zero(), self.radius, self.span);
            }
            return V3::zeros();
        }
        let normal = across / size.sqrt();
        let ahead = normal.cross(span);
        let torsion = arctan2(normal.dot(y), normal.dot(z));
        let annulus =
            Annulus { airfoil: self.airfoil, twist: self.twist - torsion, solidity: self.solidity, loss: self.loss };
        let (axial, tangential) = (wind.dot(&normal), -wind.dot(&ahead));
        let (x, t) = annulus.relative_wind(axial, tangential);
        let mut induced = [x - axial, t - tangential];
        if self.unsteady.inflow {
            induced = states.lagging(induced, outside.dot(&normal), self.radius, self.span);
        }
        normal * induced[0] - ahead * induced[1]
    }
}

impl<T: Real> Place<T> {
    /// The same place over other numbers.
    pub fn map<U: Real>(&self, f: impl Fn(T) -> U) -> Place<U> {
        let velocity = Six::new(self.velocity.l.map(&f), self.velocity.a.map(&f));
        Place { p: self.p.map(&f), r: self.r.map(&f), velocity }
    }
}

fn speed_of<T: Real>(a: T, b: T) -> T {
    let square = a * a + b * b;
    if square.re() == 0.0 { T::zero() } else { square.sqrt() }
}

pub fn column<T: Real>(r: &M3<T>, k: usize) -> V3<T> {
    V3::new(r[(0, k)], r[(1, k)], r[(2, k)])
}

/// The place after a small displacement about its point, and the change of the velocity field at that point.
pub fn displaced<T: Real>(place: &Place<T>, xi: &Six<T>, rate: &Six<T>) -> Place<T> {
    let a = place.velocity.a + rate.a;
    let l = place.velocity.l + rate.l + a.cross(&xi.l);
    Place { p: place.p + xi.l, r: place.r + skew(&xi.a) * place.r, velocity: Six::new(l, a) }
}
