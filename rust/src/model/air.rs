//! Air around blades: where the numbers of its sections are, and what follows from them.
use std::sync::Arc;

use crate::aero::polar::{Airfoil, Polar};
use crate::aero::section::{Inflow, Section};
use crate::aero::unsteady::{Separation, Unsteady};
use crate::model::layout::{air, section};
use crate::spatial::{Real, V3, vector};

/// Wind, and how velocities are induced.
#[derive(Debug, Clone)]
pub struct AirSpec {
    pub name: String,
    pub inflow: Inflow,
    pub unsteady: Unsteady,
    pub x: usize,
    pub history: Option<History>,
}

/// Induced velocities of all sections of an air at some times: three numbers for each in its own axes, straight lines between.
#[derive(Debug, Clone)]
pub struct History {
    pub times: Vec<f64>,
    pub x: usize,
    pub sections: usize,
}

impl History {
    /// The velocity at a section; before and after the times that of the ends.
    pub fn velocity<T: Real>(&self, x: &[T], section: usize, t: f64) -> V3<T> {
        let at = |k: usize| vector(x, self.x + 3 * (k * self.sections + section));
        let after = self.times.partition_point(|s| *s <= t);
        if after == 0 || after == self.times.len() {
            return at(after.max(1) - 1);
        }
        let (from, to) = (self.times[after - 1], self.times[after]);
        let (a, b) = (at(after - 1), at(after));
        a + (b - a) * T::from((t - from) / (to - from))
    }
}

/// A strip of a blade.
#[derive(Debug, Clone)]
pub struct SectionSpec {
    pub air: usize,
    /// among the sections of its air
    pub number: usize,
    pub body: usize,
    pub x: usize,
    pub polars: [Arc<Polar>; 2],
}

#[derive(Debug, Clone)]
pub struct AirGeometry<T: Real> {
    pub density: T,
    pub speed: T,
    pub shear: T,
    pub reference_height: T,
    pub direction: V3<T>,
    pub up: V3<T>,
    pub axis: V3<T>,
    pub pitch: T,
    pub ground: T,
    pub stall: T,
}

#[derive(Debug, Clone)]
pub struct SectionGeometry<T: Real> {
    /// from the centre of mass, body axes
    pub local: V3<T>,
    pub width: T,
    pub chord: T,
    pub twist: T,
    pub centre: T,
    pub rear: T,
    pub share: T,
    pub solidity: T,
    pub loss: [T; 2],
    pub radius: T,
    pub span: T,
    pub slope: T,
    pub zero: T,
}

fn unit<T: Real>(v: &V3<T>) -> V3<T> {
    v / v.dot(v).sqrt()
}

impl<T: Real> AirGeometry<T> {
    pub fn derive(x: &[T]) -> Self {
        let direction = |at: usize| unit(&vector(x, at));
        AirGeometry {
            density: x[air::DENSITY],
            speed: x[air::SPEED],
            shear: x[air::SHEAR],
            reference_height: x[air::REFERENCE_HEIGHT],
            direction: direction(air::DIRECTION),
            up: direction(air::UP),
            axis: direction(air::AXIS),
            pitch: x[air::PITCH],
            ground: x[air::GROUND],
            stall: x[air::STALL],
        }
    }

    /// Velocity of the wind at a point; at and below height zero it is still where there is shear.
    pub fn wind(&self, point: &V3<T>) -> V3<T> {
        if self.shear.re() == 0.0 && T::NDERIV == 0 {
            return self.direction * self.speed;
        }
        let height = (point.dot(&self.up) - self.ground) / self.reference_height;
        if height.re() <= 0.0 {
            let still = self.shear.re() != 0.0;
            return if still { V3::zeros() } else { self.direction * self.speed };
        }
        self.direction * (self.speed * height.powd(self.shear))
    }

    pub fn map<U: Real>(&self, f: &mut impl FnMut(T) -> U) -> AirGeometry<U> {
        AirGeometry {
            density: f(self.density),
            speed: f(self.speed),
            shear: f(self.shear),
            reference_height: f(self.reference_height),
            direction: self.direction.map(&mut *f),
            up: self.up.map(&mut *f),
            axis: self.axis.map(&mut *f),
            pitch: f(self.pitch),
            ground: f(self.ground),
            stall: f(self.stall),
        }
    }
}

impl<T: Real> SectionGeometry<T> {
    pub fn derive(x: &[T], com: &V3<T>) -> Self {
        SectionGeometry {
            local: vector(x, section::POSITION) - com,
            width: x[section::WIDTH],
            chord: x[section::CHORD],
            twist: x[section::TWIST],
            centre: x[section::CENTRE],
            rear: x[section::REAR],
            share: x[section::SHARE],
            solidity: x[section::SOLIDITY],
            loss: [x[section::LOSS], x[section::LOSS + 1]],
            radius: x[section::RADIUS],
            span: x[section::SPAN],
            slope: x[section::SLOPE],
            zero: x[section::ZERO],
        }
    }

    pub fn map<U: Real>(&self, f: &mut impl FnMut(T) -> U) -> SectionGeometry<U> {
        SectionGeometry {
            local: self.local.map(&mut *f),
            width: f(self.width),
            chord: f(self.chord),
            twist: f(self.twist),
            centre: f(self.centre),
            rear: f(self.rear),
            share: f(self.share),
            solidity: f(self.solidity),
            loss: self.loss.map(&mut *f),
            radius: f(self.radius),
            span: f(self.span),
            slope: f(self.slope),
            zero: f(self.zero),
        }
    }

    /// The section in its air.
    pub fn section<'p>(&self, spec: &'p SectionSpec, air: &AirGeometry<T>, of: &AirSpec) -> Section<'p, T> {
        Section {
            airfoil: Airfoil { polars: [&spec.polars[0], &spec.polars[1]], share: self.share },
            density: air.density,
            width: self.width,
            chord: self.chord,
            twist: self.twist + air.pitch,
            centre: self.centre,
            rear: self.rear,
            solidity: self.solidity,
            loss: self.loss,
            inflow: of.inflow,
            axis: air.axis,
            unsteady: of.unsteady,
            radius: self.radius,
            span: self.span,
            separation: Separation { slope: self.slope, zero: self.zero, lag: air.stall },
        }
    }
}
