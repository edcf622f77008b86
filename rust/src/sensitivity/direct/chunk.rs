//! Some directions together, in numbers with as many derivatives: what the tangents of a step do not give.
use std::cell::RefCell;

use nalgebra::DMatrix;

use crate::error::Result;
use crate::integrate::ali3p::closure_values;
use crate::integrate::{Equations, Motion};
use crate::multibody::System;
use crate::multibody::assemble::Effects;
use crate::multibody::placement::{Placement, advance};
use crate::run::Counts;

use super::super::Direction;
use super::super::quantity::{Point, Quantity, evaluate};
use super::explicit::{Held, Touched, explicit};
use super::slopes::Slopes;
use crate::ad::lanes::{Jet, Wide, constants};

/// A motion with derivatives along all directions, one column for each; multipliers and accelerations where they are read.
#[derive(Clone, Copy)]
pub struct Moving<'a> {
    pub motion: &'a Motion<f64>,
    pub x: &'a DMatrix<f64>,
    pub v: &'a DMatrix<f64>,
    pub z: &'a DMatrix<f64>,
}

/// Directions in neighbouring columns. What is found is added to these columns of a matrix.
pub trait Chunk {
    /// By the numbers alone: the residual of a state that is held, and its derivatives along two changes of that state.
    fn explicit(&self, at: &Held<'_, f64>, z: &DMatrix<f64>, out: &mut DMatrix<f64>, c: &mut Counts);
    fn explicit_jets(&self, at: &Held<'_, Jet>, z: &DMatrix<f64>, out: &mut [DMatrix<f64>; 2], c: &mut Counts);
    /// Do numbers change the values of the rows?
    fn touches_rows(&self) -> bool;
    /// Phi of position rows, J v + Phi_t times a factor of velocity rows, in place of what is there.
    fn closure(&self, at: Moving<'_>, factor: f64, out: &mut DMatrix<f64>);
    /// J v + Phi_t.
    fn row_rates(&self, at: Moving<'_>, out: &mut DMatrix<f64>);
    /// J a + gamma; `placed`: configuration and increments are those of the last `row_rates`.
    fn row_accelerations(&self, at: Moving<'_>, a: (&[f64], &DMatrix<f64>), placed: bool, out: &mut DMatrix<f64>);
    /// States of laws for a step of this length.
    fn open(&self, at: Moving<'_>, h: f64, out: &mut DMatrix<f64>);
    /// Rates of states of laws.
    fn state_rates(&self, at: Moving<'_>, out: &mut DMatrix<f64>);
    fn remember(&self, at: Moving<'_>, out: &mut DMatrix<f64>, counts: &mut Counts);
    /// Derivatives of quantities, to `out` with (number, column).
    fn read(
        &self,
        at: (&Motion<f64>, &[f64], &[f64]),
        slopes: &Slopes,
        wanted: &[Quantity],
        to: &mut dyn FnMut(usize, usize, f64),
    ) -> Result<()>;
}

struct Lanes<'a, const N: usize> {
    eq: Equations<'a, Wide<f64, N>>,
    /// the same over the two changes of a projection, where there is one
    jets: Option<Equations<'a, Wide<Jet, N>>>,
    touched: Touched,
    first: usize,
    used: usize,
    /// where all is at the end of the step
    placed: RefCell<Option<Placed<N>>>,
}

type Placed<const N: usize> = (Motion<Wide<f64, N>>, Placement<Wide<f64, N>>);

/// Directions of a chunk at most. Numbers with eight derivatives leave the registers: two chunks of four are a tenth faster than one of eight.
pub const WIDEST: usize = 4;

/// A chunk of directions from a column on.
pub fn chunk<'a>(
    system: &'a System,
    effects: Effects,
    directions: &[&Direction],
    first: usize,
    projected: bool,
) -> Box<dyn Chunk + 'a> {
    match directions.len() {
        1 => Box::new(Lanes::<1>::new(system, effects, directions, first, projected)),
        _ => Box::new(Lanes::<WIDEST>::new(system, effects, directions, first, projected)),
    }
}

/// What a direction alone belongs to.
pub fn touched(system: &System, effects: Effects, direction: &Direction) -> Touched {
    Lanes::<1>::new(system, effects, &[direction], 0, false).touched
}

impl<'a, const N: usize> Lanes<'a, N> {
    fn new(system: &'a System, effects: Effects, directions: &[&Direction], first: usize, projected: bool) -> Self {
        let mut x: Vec<Wide<f64, N>> = system.x.iter().map(|v| Wide::constant(*v)).collect();
        for (k, direction) in directions.iter().enumerate() {
            for (i, d) in direction.iter() {
                x[*i].eps[k] += d;
            }
        }
        let eq = Equations::new(system, x, effects);
        let jets = projected.then(|| {
            let x = eq.x.iter().map(|v| Wide::<f64, N>::over(*v)).collect();
            Equations::with_geometry(system, x, eq.geometry.map(Wide::<f64, N>::over), effects)
        });
        Lanes { touched: Touched::of(&eq), eq, jets, first, used: directions.len(), placed: RefCell::default() }
    }

    /// Numbers with the derivatives in the rows of a matrix.
    fn with(&self, re: &[f64], d: &DMatrix<f64>) -> Vec<Wide<f64, N>> {
        let slope = |i: usize, k: usize| match k < self.used {
            true => d[(i, self.first + k)],
            false => 0.0,
        };
        (re.iter().enumerate()).map(|(i, re)| Wide { re: *re, eps: std::array::from_fn(|k| slope(i, k)) }).collect()
    }

    fn moving(&self, at: Moving<'_>) -> Motion<Wide<f64, N>> {
        let mut q = constants(&at.motion.q);
        let none = vec![0.0; at.x.nrows()];
        advance(self.eq.topology(), &mut q, &self.with(&none, at.x));
        Motion { t: at.motion.t, q, rate: self.with(&at.motion.rate, at.v), memory: self.with(&at.motion.memory, at.z) }
    }

    fn add<'w>(&self, values: impl IntoIterator<Item = &'w Wide<f64, N>>, out: &mut DMatrix<f64>) {
        for (i, value) in values.into_iter().enumerate() {
            for k in 0..self.used {
                out[(i, self.first + k)] += value.eps[k];
            }
        }
    }
}

impl<const N: usize> Chunk for Lanes<'_, N> {
    fn explicit(&self, at: &Held<'_, f64>, z: &DMatrix<f64>, out: &mut DMatrix<f64>, c: &mut Counts) {
        let memory = self.with(&at.motion.memory, z);
        explicit(&self.eq, &self.touched, at, memory, c, |i, k, d| {
            if k < self.used {
                out[(i, self.first + k)] += d;
            }
        });
    }

    fn explicit_jets(&self, at: &Held<'_, Jet>, z: &DMatrix<f64>, out: &mut [DMatrix<f64>; 2], c: &mut Counts) {
        let Some(eq) = &self.jets else { return };
        let memory: Vec<f64> = at.motion.memory.iter().map(|m| m.re).collect();
        let memory = self.with(&memory, z).into_iter().map(Wide::<f64, N>::over);
        explicit(eq, &self.touched, at, memory.collect(), c, |i, k, d| {
            if k < self.used {
                for (out, d) in out.iter_mut().zip(d.eps) {
                    out[(i, self.first + k)] += d;
                }
            }
        });
    }

    fn touches_rows(&self) -> bool {
        self.touched.rows
    }

    fn closure(&self, at: Moving<'_>, factor: f64, out: &mut DMatrix<f64>) {
        out.columns_mut(self.first, self.used).fill(0.0);
        self.add(&closure_values(&self.eq, &self.moving(at), factor), out);
    }

    fn row_rates(&self, at: Moving<'_>, out: &mut DMatrix<f64>) {
        let m = self.moving(at);
        let placement = self.eq.place(&m);
        self.add(&self.eq.row_rates_at(&m, &placement), out);
        *self.placed.borrow_mut() = Some((m, placement));
    }

    fn row_accelerations(
        &self,
        at: Moving<'_>,
        (a, da): (&[f64], &DMatrix<f64>),
        placed: bool,
        out: &mut DMatrix<f64>,
    ) {
        let a = self.with(a, da);
        let (m, placement) = match self.placed.take().filter(|_| placed) {
            Some((mut m, placement)) => {
                m.rate = self.with(&at.motion.rate, at.v);
                let at = placement.at_rates(self.eq.topology(), &self.eq.geometry, &m.rate);
                (m, at)
            }
            None => {
                let m = self.moving(at);
                let placement = self.eq.place(&m);
                (m, placement)
            }
        };
        self.add(&self.eq.row_accelerations(&m, &placement, &a), out);
    }

    fn open(&self, at: Moving<'_>, h: f64, out: &mut DMatrix<f64>) {
        let mut m = self.moving(at);
        self.eq.open_states(&mut m, 0.5 * h);
        self.add(&m.memory, out);
    }

    fn state_rates(&self, at: Moving<'_>, out: &mut DMatrix<f64>) {
        self.add(&self.eq.state_rates(&self.moving(at)), out);
    }

    fn remember(&self, at: Moving<'_>, out: &mut DMatrix<f64>, counts: &mut Counts) {
        let mut m = self.moving(at);
        self.eq.remember(&mut m, counts);
        self.add(&m.memory, out);
    }

    fn read(
        &self,
        (motion, a, lam): (&Motion<f64>, &[f64], &[f64]),
        slopes: &Slopes,
        wanted: &[Quantity],
        to: &mut dyn FnMut(usize, usize, f64),
    ) -> Result<()> {
        let (x, v, z) = (&slopes.x, &slopes.v, &slopes.z);
        let at = Point {
            motion: &self.moving(Moving { motion, x, v, z }),
            acceleration: &self.with(a, &slopes.a),
            lam: &self.with(lam, &slopes.lam),
        };
        for (i, value) in evaluate(&self.eq, &at, wanted)?.iter().enumerate() {
            for k in 0..self.used {
                to(i, self.first + k, value.eps[k]);
            }
        }
        Ok(())
    }
}
