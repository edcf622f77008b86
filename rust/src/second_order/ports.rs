//! Input and output maps with their derivative orders.
use faer::{Mat, MatRef, c64};

use crate::error::{Error, Result};
use crate::linalg::quadratic::is_finite;

/// What is driven and what is seen: H = (i omega)^order_out (L Z^-1 F (i omega)^order_in + D0).
#[derive(Debug, Clone)]
pub struct Ports {
    /// output map, (outputs, n)
    pub l: Mat<f64>,
    /// input map, (n, inputs)
    pub f: Mat<f64>,
    /// derivatives of each input that act
    pub order_in: Vec<u32>,
    /// derivatives of the outputs that are seen
    pub order_out: u32,
    /// what of the inputs is seen at once, (outputs, inputs)
    pub d0: Option<Mat<f64>>,
}

impl Ports {
    /// Errors unless all maps are finite and fit n coordinates.
    pub fn check(&self, n: usize) -> Result<()> {
        let (n_out, n_in) = (self.l.nrows(), self.f.ncols());
        if n == 0 {
            return Err(Error::model("the system has no coordinates; it needs at least one"));
        }
        if self.l.ncols() != n || self.f.nrows() != n {
            return Err(Error::model(format!(
                "the output map is {} x {} and the input map {} x {}; they must be (outputs, {n}) and ({n}, inputs)",
                self.l.nrows(),
                self.l.ncols(),
                self.f.nrows(),
                self.f.ncols()
            )));
        }
        if self.order_in.len() != n_in {
            return Err(Error::model(format!("there are {n_in} inputs but {} derivative orders", self.order_in.len())));
        }
        if let Some(d0) = &self.d0
            && (d0.nrows() != n_out || d0.ncols() != n_in)
        {
            return Err(Error::model(format!(
                "the feedthrough is {} x {}; it must be {n_out} x {n_in}",
                d0.nrows(),
                d0.ncols()
            )));
        }
        let finite = is_finite(self.l.as_ref())
            && is_finite(self.f.as_ref())
            && self.d0.as_ref().is_none_or(|d| is_finite(d.as_ref()));
        if !finite {
            return Err(Error::model("an input or output map contains NaN or infinite entries"));
        }
        Ok(())
    }

    /// Number of outputs.
    pub fn n_out(&self) -> usize {
        self.l.nrows()
    }

    /// Number of inputs.
    pub fn n_in(&self) -> usize {
        self.f.ncols()
    }
}

pub fn complex(a: MatRef<'_, f64>) -> Mat<c64> {
    Mat::from_fn(a.nrows(), a.ncols(), |i, j| c64::new(a[(i, j)], 0.0))
}

/// (i omega)^order, exactly real or imaginary.
pub fn i_omega(w: f64, order: u32) -> c64 {
    let size = w.powi(order as i32);
    match order % 4 {
        0 => c64::new(size, 0.0),
        1 => c64::new(0.0, size),
        2 => c64::new(-size, 0.0),
        _ => c64::new(0.0, -size),
    }
}
