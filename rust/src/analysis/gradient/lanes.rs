//! Numbers with one or several derivatives.
use nalgebra::{Const, SVector, U1};
use num_dual::{Derivative, Dual64, DualSVec64};

use crate::spatial::Real;

/// A value with the derivatives along N directions.
pub trait Lanes: Real {
    const N: usize;
    /// `slope`: the derivative along direction k.
    fn with(re: f64, slope: impl Fn(usize) -> f64) -> Self;
    fn value(&self) -> f64;
    fn slope(&self, k: usize) -> f64;

    /// The same number moved along its directions.
    fn moved(&self, d: impl Fn(usize) -> f64) -> Self {
        Self::with(self.value(), |k| self.slope(k) + d(k))
    }

    /// The same derivatives at another value.
    fn at(&self, re: f64) -> Self {
        Self::with(re, |k| self.slope(k))
    }
}

impl Lanes for Dual64 {
    const N: usize = 1;

    fn with(re: f64, slope: impl Fn(usize) -> f64) -> Self {
        Dual64::new(re, slope(0))
    }

    fn value(&self) -> f64 {
        self.re
    }

    fn slope(&self, _: usize) -> f64 {
        self.eps
    }
}

impl<const M: usize> Lanes for DualSVec64<M>
where
    DualSVec64<M>: Real,
{
    const N: usize = M;

    fn with(re: f64, slope: impl Fn(usize) -> f64) -> Self {
        let slopes = SVector::from_fn(|k, _| slope(k));
        DualSVec64::new(re, Derivative::some(slopes))
    }

    fn value(&self) -> f64 {
        self.re
    }

    fn slope(&self, k: usize) -> f64 {
        self.eps.unwrap_generic(Const::<M>, U1)[k]
    }
}
