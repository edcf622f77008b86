//! The Tables (docs/tables.md): what Python hands over, parsed and checked once.
use crate::error::{Error, Result};
use crate::force::FunctionLaw;
use crate::joint::{Coordinate, JointKind};
use crate::model::air::{AirSpec, SectionSpec};
use crate::model::constraint::ConstraintSpec;
use crate::model::flexible::{FlexibleSpec, TipSpec};
use crate::model::layout::{self, body, bushing, coupler, joint, load, pose, spring_damper, torsion};
use crate::model::motion::MotionSpec;

/// None is ground.
pub type BodyRef = Option<usize>;

/// A body.
#[derive(Debug, Clone)]
pub struct BodySpec {
    /// for messages
    pub name: String,
    /// of a moving node that of its flexible body
    pub x: usize,
    /// which moving node it is, of a flexible body
    pub tip: Option<usize>,
}

/// A joint between two bodies.
#[derive(Debug, Clone)]
pub struct JointSpec {
    /// for messages
    pub name: String,
    /// what it is
    pub kind: JointKind,
    /// the first body
    pub a: BodyRef,
    /// the second body
    pub b: BodyRef,
    /// which of its numbers were given, by the bits of `flag`
    pub flags: i64,
    /// its first number
    pub x: usize,
}

/// What an element is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ElementKind {
    /// between two points, along the line that joins them
    SpringDamper,
    /// in three directions and about three axes
    Bushing,
    /// about one axis
    Torsion,
}

impl ElementKind {
    /// By its code in the Tables.
    pub fn from_code(code: i64) -> Result<Self> {
        match code {
            layout::element_type::SPRING_DAMPER => Ok(ElementKind::SpringDamper),
            layout::element_type::BUSHING => Ok(ElementKind::Bushing),
            layout::element_type::TORSION => Ok(ElementKind::Torsion),
            _ => Err(Error::model(format!("element type {code} does not exist"))),
        }
    }

    /// How many numbers it has.
    pub fn size(self) -> usize {
        match self {
            ElementKind::SpringDamper => spring_damper::SIZE,
            ElementKind::Bushing => bushing::SIZE,
            ElementKind::Torsion => torsion::SIZE,
        }
    }
}

/// An element between two bodies.
#[derive(Debug, Clone)]
pub struct ElementSpec {
    /// for messages
    pub name: String,
    /// what it is
    pub kind: ElementKind,
    /// the first body
    pub a: BodyRef,
    /// the second body
    pub b: BodyRef,
    /// which of its numbers were given, by the bits of `flag`
    pub flags: i64,
    /// its first number
    pub x: usize,
}

#[derive(Debug, Clone)]
pub struct LoadSpec {
    pub name: String,
    pub torque: bool,
    pub body: usize,
    /// the modal coordinate on which it acts alone
    pub mode: Option<usize>,
    pub follower: bool,
    pub x: usize,
}

/// Where a law acts: on one coordinate of an element or of a joint.
#[derive(Debug, Clone)]
pub struct LawSpec {
    pub on_joint: bool,
    pub owner: usize,
    pub component: usize,
    pub code: i64,
    pub n: usize,
    pub x: usize,
}

/// A law given as a function of several coordinates of an element or of a joint.
#[derive(Debug, Clone)]
pub struct FunctionSpec {
    pub on_joint: bool,
    pub owner: usize,
    pub coordinates: Vec<usize>,
    pub law: FunctionLaw,
    pub x: usize,
}

/// A joint coordinate that follows a motion.
#[derive(Debug, Clone)]
pub struct DriveSpec {
    pub name: String,
    pub joint: usize,
    /// among the free coordinates of the joint
    pub coordinate: usize,
    pub motion: usize,
}

/// second - ratio first - offset = 0 of two joint coordinates; numbers: ratio 0, offset 1.
#[derive(Debug, Clone)]
pub struct CouplerSpec {
    pub name: String,
    /// first and second
    pub joints: [usize; 2],
    pub coordinates: [usize; 2],
    pub x: usize,
}

/// A motion added to one component of a load's value.
#[derive(Debug, Clone)]
pub struct LoadMotionSpec {
    pub load: usize,
    pub component: usize,
    pub motion: usize,
}

/// A model as Python hands it over: its numbers, and where each object has its own among them (docs/tables.md).
#[derive(Debug, Clone, Default)]
pub struct Tables {
    /// all numbers
    pub x: Vec<f64>,
    /// rigid and flexible bodies, and the moving nodes of these
    pub bodies: Vec<BodySpec>,
    /// what connects bodies
    pub joints: Vec<JointSpec>,
    /// springs and dampers
    pub elements: Vec<ElementSpec>,
    /// forces and torques
    pub loads: Vec<LoadSpec>,
    /// laws of one coordinate of an element or of a joint
    pub laws: Vec<LawSpec>,
    /// laws of several
    pub functions: Vec<FunctionSpec>,
    /// functions of time
    pub motions: Vec<MotionSpec>,
    /// joint coordinates that follow motions
    pub drives: Vec<DriveSpec>,
    /// pairs of joint coordinates that move together
    pub couplers: Vec<CouplerSpec>,
    /// rows that a user gave
    pub constraints: Vec<ConstraintSpec>,
    /// air flows
    pub air: Vec<AirSpec>,
    /// sections of blades in them
    pub sections: Vec<SectionSpec>,
    /// motions that loads follow
    pub load_motions: Vec<LoadMotionSpec>,
    /// its first number
    pub gravity: Option<usize>,
    /// shapes of flexible bodies
    pub flexible: Vec<FlexibleSpec>,
    /// the moving nodes of these
    pub tips: Vec<TipSpec>,
    /// first guesses of body poses: body, start of origin and quaternion
    pub poses: Vec<(usize, usize)>,
    /// accuracy of what was drawn: of lengths over the characteristic length, and of angles (rad)
    pub tolerance: f64,
    /// every body moves by coordinates of its own, and all joints are rows
    pub absolute: bool,
}

impl Tables {
    /// Every number must be finite and every index inside its table, whoever wrote them.
    pub fn check(&self) -> Result<()> {
        if let Some(i) = self.x.iter().position(|v| !v.is_finite()) {
            return Err(Error::model(format!("number {i} of the tables is not finite")));
        }
        if !(self.tolerance > 0.0 && self.tolerance < layout::LARGEST_TOLERANCE) {
            return Err(Error::model(format!(
                "the tolerance {} is not a small share of the model's size",
                self.tolerance
            )));
        }
        for body in &self.bodies {
            self.inside(&body.name, body.x, body::SIZE)?;
        }
        for joint in &self.joints {
            self.inside(&joint.name, joint.x, joint::SIZE)?;
            self.connects(&joint.name, joint.a, joint.b)?;
        }
        for element in &self.elements {
            self.inside(&element.name, element.x, element.kind.size())?;
            self.connects(&element.name, element.a, element.b)?;
        }
        for load in &self.loads {
            self.inside(&load.name, load.x, load::SIZE)?;
            self.connects(&load.name, Some(load.body), None)?;
            let modes = self.flexible.iter().find(|f| f.body == load.body).map(|f| f.m);
            if load.mode.is_some_and(|k| modes.is_none_or(|m| k >= m)) {
                return Err(Error::model(format!("'{}' acts on a modal coordinate that does not exist", load.name)));
            }
        }
        self.check_flexible()?;
        self.check_air()?;
        for law in &self.laws {
            self.inside("a law", law.x, law.n)?;
        }
        for law in &self.functions {
            self.inside("a law", law.x, law.law.n_params())?;
            if law.coordinates.len() != law.law.m() {
                return Err(Error::model("a law of several coordinates acts on another number of them"));
            }
        }
        for motion in &self.motions {
            self.inside("a motion", motion.x, motion.n)?;
        }
        for drive in &self.drives {
            self.drives(&drive.name, drive.joint, drive.coordinate)?;
            self.follows(&drive.name, drive.motion)?;
        }
        for coupler in &self.couplers {
            self.inside(&coupler.name, coupler.x, coupler::SIZE)?;
            for (joint, coordinate) in coupler.joints.iter().zip(coupler.coordinates) {
                self.drives(&coupler.name, *joint, coordinate)?;
            }
        }
        for constraint in &self.constraints {
            self.inside(&constraint.name, constraint.x, constraint.function.n_params())?;
            for (joint, coordinate) in &constraint.motions {
                self.drives(&constraint.name, *joint, *coordinate)?;
            }
            if constraint.motions.len() != constraint.function.m() {
                return Err(Error::model(format!("'{}' reads another number of motions", constraint.name)));
            }
        }
        for m in &self.load_motions {
            if m.load >= self.loads.len() || m.component >= 3 {
                return Err(Error::model("a motion belongs to a load that does not exist"));
            }
            self.follows(&self.loads[m.load].name, m.motion)?;
        }
        for (body, x) in &self.poses {
            self.connects("a pose", Some(*body), None)?;
            self.inside("a pose", *x, pose::SIZE)?;
        }
        self.gravity.map_or(Ok(()), |g| self.inside("gravity", g, layout::gravity::SIZE))
    }

    pub(super) fn inside(&self, name: &str, start: usize, n: usize) -> Result<()> {
        if start.checked_add(n).is_none_or(|end| end > self.x.len()) {
            return Err(Error::model(format!("'{name}': its numbers lie outside the value vector")));
        }
        Ok(())
    }

    fn drives(&self, name: &str, joint: usize, coordinate: usize) -> Result<()> {
        let free = self.joints.get(joint).map(|j| j.kind.free_coordinates());
        if free.is_none_or(|free| coordinate >= free.len()) {
            return Err(Error::model(format!("'{name}' refers to a joint coordinate that does not exist")));
        }
        Ok(())
    }

    fn follows(&self, name: &str, motion: usize) -> Result<()> {
        if motion >= self.motions.len() {
            return Err(Error::model(format!("'{name}' refers to a motion that does not exist")));
        }
        Ok(())
    }

    /// The joints and coordinates that a constraint reads.
    pub fn motions_of(&self, constraint: usize) -> impl Iterator<Item = (usize, Coordinate)> + '_ {
        let motions = &self.constraints[constraint].motions;
        motions.iter().map(|(j, k)| (*j, self.joints[*j].kind.free_coordinates()[*k]))
    }

    /// The first nonholonomic joint, drive, coupler, constraint, flexible body or air.
    pub fn unusual(&self) -> Option<&str> {
        let joints = self.joints.iter().filter(|j| j.kind.is_nonholonomic());
        let drives = self.drives.iter().map(|d| d.name.as_str());
        let couplers = self.couplers.iter().map(|c| c.name.as_str());
        let constraints = self.constraints.iter().map(|c| c.name.as_str());
        let flexible = self.flexible.iter();
        let flexible = flexible.map(|f| self.bodies[f.body].name.as_str());
        let air = self.air.iter().map(|a| a.name.as_str());
        let all = joints.map(|j| j.name.as_str()).chain(drives).chain(couplers);
        let mut all = all.chain(constraints).chain(flexible).chain(air);
        all.next()
    }

    fn connects(&self, name: &str, a: BodyRef, b: BodyRef) -> Result<()> {
        if a.into_iter().chain(b).any(|body| body >= self.bodies.len()) {
            return Err(Error::model(format!("'{name}' refers to a body that does not exist")));
        }
        if a == b {
            return Err(Error::model(format!("'{name}' connects a body with itself")));
        }
        Ok(())
    }

    /// Its name; that of ground is "ground".
    pub fn body_name(&self, body: BodyRef) -> &str {
        body.map_or("ground", |b| &self.bodies[b].name)
    }
}
