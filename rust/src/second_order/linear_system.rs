//! A linear system M y" + (C + G) y' + (K + N) y = F u with all that is derived from its matrices, each of it computed once, when it is
//! first asked for: sums and scales, the mass-normalised form, modes, their expansion, the Hessenberg form.
use std::sync::OnceLock;

use faer::{Mat, c64};

use super::SecondOrder;
use super::expansion::Expansion;
use super::frf_banded;
use super::frf_poles;
use super::modal::{Eigensolution, Modal, eigensolution};
use crate::error::{Error, Result};
use crate::linalg::banded::Band;
use crate::linalg::dense::{is_finite, is_zero};
use crate::linalg::hessenberg::Hessenberg;
use crate::linalg::quadratic::{NormalForm, Quadratic};
use crate::run::Counts;

/// The matrices as they were given.
#[derive(Debug, Clone)]
pub struct Matrices {
    /// Mass.
    pub m: Mat<f64>,
    /// Damping.
    pub c: Option<Mat<f64>>,
    /// Gyroscopic.
    pub g: Option<Mat<f64>>,
    /// Stiffness.
    pub k: Mat<f64>,
    /// Circulatory.
    pub n: Option<Mat<f64>>,
}

impl Matrices {
    fn all(&self) -> [(&'static str, Option<&Mat<f64>>); 5] {
        [
            ("M", Some(&self.m)),
            ("C", self.c.as_ref()),
            ("G", self.g.as_ref()),
            ("K", Some(&self.k)),
            ("N", self.n.as_ref()),
        ]
    }

    /// True where nothing acts but mass and stiffness.
    pub fn is_undamped(&self) -> bool {
        self.c.is_none() && self.g.is_none() && self.n.is_none()
    }
}

/// See the head of this file.
pub struct LinearSystem {
    given: Matrices,
    quadratic: OnceLock<Quadratic>,
    scale: OnceLock<Vec<f64>>,
    normal: OnceLock<Option<NormalForm>>,
    band: OnceLock<Option<Band>>,
    solved: OnceLock<Result<Eigensolution>>,
    modes: OnceLock<Result<Modal>>,
    expansion: OnceLock<Expansion>,
    poles: OnceLock<Option<Vec<c64>>>,
    pub(crate) hessenberg: OnceLock<Hessenberg>,
}

impl LinearSystem {
    /// Errors unless the matrices are finite and of one size. Zero matrices of C, G and N are left out.
    pub fn new(mut given: Matrices) -> Result<Self> {
        let n = given.m.nrows();
        for (name, a) in given.all() {
            let Some(a) = a else { continue };
            if a.nrows() != n || a.ncols() != n {
                return Err(Error::model(format!(
                    "{name} is {} x {} but M has {n} rows; all matrices must be {n} x {n}",
                    a.nrows(),
                    a.ncols()
                )));
            }
            if !is_finite(a.as_ref()) {
                return Err(Error::model(format!("{name} contains NaN or infinite entries")));
            }
        }
        for part in [&mut given.c, &mut given.g, &mut given.n] {
            if part.as_ref().is_some_and(|a| is_zero(a.as_ref())) {
                *part = None;
            }
        }
        Ok(LinearSystem {
            given,
            quadratic: OnceLock::new(),
            scale: OnceLock::new(),
            normal: OnceLock::new(),
            band: OnceLock::new(),
            solved: OnceLock::new(),
            modes: OnceLock::new(),
            expansion: OnceLock::new(),
            poles: OnceLock::new(),
            hessenberg: OnceLock::new(),
        })
    }

    /// M, C, G, K, N.
    pub fn given(&self) -> &Matrices {
        &self.given
    }

    /// Number of coordinates.
    pub fn size(&self) -> usize {
        self.given.m.nrows()
    }

    /// The matrices for analyses that need M, C, K symmetric and G, N skew; an error where they are not.
    pub fn second_order(&self) -> Result<SecondOrder> {
        let Matrices { m, c, g, k, n } = self.given.clone();
        SecondOrder::new(m, c, g, k, n)
    }

    /// Roots and shapes before they are judged; what it costs is counted in the call that computes them.
    fn solved(&self, counts: &mut Counts) -> Result<&Eigensolution> {
        let found = self.solved.get_or_init(|| {
            let found = self.second_order().and_then(|system| eigensolution(&system));
            found.inspect(|found| counts.merge(&found.counts))
        });
        found.as_ref().map_err(Clone::clone)
    }

    /// All modes; what it costs is counted in the call that computes them.
    pub fn modes(&self, counts: &mut Counts) -> Result<&Modal> {
        let solved = self.solved(counts)?;
        let found = self.modes.get_or_init(|| solved.judged().inspect(|found| counts.merge(&found.counts)));
        found.as_ref().map_err(Clone::clone)
    }

    /// M, D = C + G and S = K + N.
    pub fn quadratic(&self) -> &Quadratic {
        self.quadratic.get_or_init(|| {
            let Matrices { m, c, g, k, n } = &self.given;
            let sum = |a: &Option<Mat<f64>>, b: &Option<Mat<f64>>| match (a, b) {
                (Some(a), Some(b)) => Some(a + b),
                (a, b) => a.as_ref().or(b.as_ref()).cloned(),
            };
            Quadratic::new(m.clone(), sum(c, g), n.as_ref().map_or_else(|| k.clone(), |n| k + n))
        })
    }

    /// Powers of two that bring the masses to about one.
    pub fn scale(&self) -> &[f64] {
        self.scale.get_or_init(|| self.quadratic().unit_scale())
    }

    /// The mass-normalised form, or None where M is not symmetric and positive definite.
    pub fn normal(&self) -> Option<&NormalForm> {
        self.normal.get_or_init(|| self.quadratic().normal_form()).as_ref()
    }

    /// The matrices in an order in which they have a narrow band, if there is one.
    pub fn band(&self) -> Option<&Band> {
        self.band.get_or_init(|| frf_banded::band(self.quadratic(), self.scale())).as_ref()
    }

    /// Modes as sums over them take them.
    pub fn expansion(&self, counts: &mut Counts) -> &Expansion {
        self.expansion.get_or_init(|| {
            if let Ok(solved) = self.solved(counts) {
                return Expansion::new(solved, || self.normal());
            }
            // damping or stiffness that was not given in symmetric and skew parts
            match SecondOrder::split(self.quadratic()).and_then(|system| eigensolution(&system)) {
                Ok(solved) => {
                    counts.merge(&solved.counts);
                    Expansion::new(&solved, || self.normal())
                }
                Err(_) => Expansion::None,
            }
        })
    }

    /// Poles that are known without modes, in ascending |s|, conjugates side by side.
    pub fn own_poles(&self, counts: &mut Counts) -> Option<&[c64]> {
        self.poles.get_or_init(|| frf_poles::poles(self, counts)).as_deref()
    }

    /// All 2n poles in rad/s, or None where there are no modes.
    pub fn poles(&self, counts: &mut Counts) -> Option<&[c64]> {
        match self.own_poles(counts) {
            None => self.expansion(counts).poles(),
            own => own,
        }
    }
}
