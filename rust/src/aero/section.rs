//! The force of the air on one section of a blade.
//!
//! The section's axes in the world: `span` outwards, `forward` to the leading edge of a section without twist, `suction` to the side that
//! lift pushes to. With the wind u relative to the section across the span,
//! ```text
//! alpha = atan2(u.suction, -u.forward) - twist
//! F = rho c b |u| (cl (u.suction forward - u.forward suction) + cd u) / 2,   M = rho c^2 b |u|^2 cm span / 2
//! ```
//! at the aerodynamic centre, b the width of the strip. u is that at three quarters of the chord.
use super::annulus::Annulus;
use super::polar::Airfoil;
use crate::spatial::{M3, Real, Six, V3, arctan2, skew};

/// How the induced velocity comes about.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Inflow {
    /// given, as by a wake
    Given,
    /// blade elements and momentum of each annulus
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
        }
    }

    fn forward(&self, place: &Place<T>) -> V3<T> {
        let (s, c) = self.twist.sin_cos();
        place.r.column(1) * c - place.r.column(2) * s
    }

    /// `air` is the velocity of the air at a point, without what annuli induce.
    pub fn flow(&self, place: &Place<T>, air: impl Fn(&V3<T>) -> V3<T>) -> Flow<T> {
        let (span, y, z) = (column(&place.r, 0), column(&place.r, 1), column(&place.r, 2));
        let forward = self.forward(place);
        let rear = place.p + forward * self.rear;
        let arm = rear - place.p;
        let wind = air(&rear) - (place.velocity.l + place.velocity.a.cross(&arm));
        let induced = match self.inflow {
            Inflow::Given => V3::zeros(),
            Inflow::Momentum => self.annulus(&span, &y, &z, &wind),
        };
        let u = wind + induced;
        let (normal, along) = (u.dot(&z), -u.dot(&y));
        let square = normal * normal + along * along;
        let still = square.re() == 0.0;
        let (angle, speed) =
            if still { (-self.twist, T::zero()) } else { (arctan2(normal, along) - self.twist, square.sqrt()) };
        let [cl, cd, cm] = self.airfoil.coefficients(angle);
        let size = self.density * self.chord * self.width * speed * 0.5;
        let force = (y * normal + z * along) * (size * cl) + (z * normal - y * along) * (size * cd);
        Flow {
            angle,
            speed,
            circulation: self.chord * speed * cl * 0.5,
            force,
            moment: span * (size * speed * self.chord * cm),
            centre: place.p + forward * self.centre,
            rear,
            forward,
            induced,
        }
    }

    /// Force and moment about the section's point.
    pub fn wrench(&self, place: &Place<T>, air: impl Fn(&V3<T>) -> V3<T>) -> Six<T> {
        let flow = self.flow(place, air);
        Six::new(flow.force, flow.moment + (flow.centre - place.p).cross(&flow.force))
    }

    /// The velocity that the section's annulus adds to the wind. Its axes lie across the span; torsion turns the section in them.
    fn annulus(&self, span: &V3<T>, y: &V3<T>, z: &V3<T>, wind: &V3<T>) -> V3<T> {
        let across = self.axis - span * self.axis.dot(span);
        let size = across.dot(&across);
        if size.re() == 0.0 {
            return V3::zeros();
        }
        let normal = across / size.sqrt();
        let ahead = normal.cross(span);
        let torsion = arctan2(normal.dot(y), normal.dot(z));
        let annulus =
            Annulus { airfoil: self.airfoil, twist: self.twist - torsion, solidity: self.solidity, loss: self.loss };
        let (axial, tangential) = (wind.dot(&normal), -wind.dot(&ahead));
        let (x, t) = annulus.relative_wind(axial, tangential);
        normal * (x - axial) - ahead * (t - tangential)
    }
}

impl<T: Real> Place<T> {
    /// The same place over other numbers.
    pub fn map<U: Real>(&self, f: impl Fn(T) -> U) -> Place<U> {
        let velocity = Six::new(self.velocity.l.map(&f), self.velocity.a.map(&f));
        Place { p: self.p.map(&f), r: self.r.map(&f), velocity }
    }
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
