//! The estimated distance to the exact equilibrium: what forces are left over, what closing leaves of loops, and what rounding of places
//! hides of both.
//!
//! ```text
//! J d = -Phi,   dy = d + B'' z,   B''^T (rho + S dy) = 0
//! ```
//! d moves the dependent coordinates alone. Sources of rounding have no particular direction: the squares of what they make add up.
use nalgebra::{DMatrix, DVector};

use crate::constraint::loop_lengths::bounds_at;
use crate::constraint::loops::{Loops, column_scales};
use crate::equilibrium::local::{Local, Spectrum, nan_or_larger};
use crate::equilibrium::newton::newton_answers;
use crate::error::{Error, Result};
use crate::linearize::{Setting, Tree, reduce_rows};
use crate::multibody::placement::place;
use crate::tolerances::equilibrium::USUAL;

/// Dependent coordinates of loops, free of units; of an open tree there are none.
struct Dependent {
    /// B'' (dependent, dof)
    map: DMatrix<f64>,
    /// B''^T S (dof, dependent)
    stiffness: DMatrix<f64>,
    /// d that closes what is open (dependent, 1)
    open: DMatrix<f64>,
    /// d that closes what rounding of places hides of each row (dependent, rows)
    hidden: DMatrix<f64>,
}

impl Dependent {
    fn none(dof: usize) -> Dependent {
        let (map, stiffness) = (DMatrix::zeros(0, dof), DMatrix::zeros(dof, 0));
        Dependent { map, stiffness, open: DMatrix::zeros(0, 1), hidden: DMatrix::zeros(0, 0) }
    }

    fn new(
        setting: &Setting<'_>,
        local: &Local,
        (loops, map, tree): (&Loops, &DMatrix<f64>, &Tree),
    ) -> Result<Dependent> {
        let system = setting.system;
        let poses = place(&system.topology, &system.geometry, &setting.state.q, None).pose;
        let columns = column_scales(&system.topology, system.length);
        let own = DVector::from_iterator(loops.dependent.len(), loops.dependent.iter().map(|i| columns[*i]));
        let free = DVector::from_column_slice(&local.scale);
        let across = reduce_rows(tree.stiffness.select_columns(&loops.dependent), Some((loops, map)));
        let decision = system.decision(setting.effects)?;
        let bounds = bounds_at(system, &poses, setting.effects, &decision.rows);
        Ok(Dependent {
            map: DMatrix::from_fn(own.len(), free.len(), |k, i| map[(k, i)] * free[i] / own[k]),
            stiffness: DMatrix::from_fn(free.len(), own.len(), |i, k| across[(i, k)] * free[i] * own[k]),
            open: DMatrix::from_columns(&[closed(loops, &tree.phi, &tree.jacobian)?.component_div(&own)]),
            hidden: DMatrix::from_fn(own.len(), bounds.len(), |k, i| {
                loops.left_inverse[(k, i)] / own[k] * bounds[i] / loops.row_scale[i]
            }),
        })
    }

    /// Squares of what sources make of each coordinate, summed up (dof + dependent,): of forces (dof, n) together with d (dependent, n).
    fn squares(
        &self,
        local: &Local,
        spectrum: &Spectrum,
        forces: &DMatrix<f64>,
        d: Option<&DMatrix<f64>>,
    ) -> Result<DVector<f64>> {
        let free = newton_answers(local, spectrum, forces)?;
        let mut own = &self.map * &free;
        if let Some(d) = d {
            own += d;
        }
        let all = sums_of_squares(&free).into_iter().chain(sums_of_squares(&own));
        Ok(DVector::from_iterator(free.nrows() + own.nrows(), all))
    }
}

/// Of each row.
fn sums_of_squares(m: &DMatrix<f64>) -> Vec<f64> {
    let mut sums = vec![0.0; m.nrows()];
    for column in m.column_iter() {
        sums.iter_mut().zip(column.iter()).for_each(|(sum, v)| *sum += v * v);
    }
    sums
}

/// The smallest d of the rows that carry the rank: others may contradict them within the tolerance of the drawing.
fn closed(loops: &Loops, phi: &DVector<f64>, jacobian: &DMatrix<f64>) -> Result<DVector<f64>> {
    let kept: Vec<usize> = (0..phi.len()).filter(|i| loops.dropped.binary_search(i).is_err()).collect();
    let square = jacobian.select_rows(&kept).select_columns(&loops.dependent);
    let d = square.lu().solve(&-phi.select_rows(&kept));
    d.ok_or_else(|| Error::singular("the rows of closed loops depend on each other in this state"))
}

/// Radians or characteristic lengths.
pub(crate) fn distance(setting: &Setting<'_>, local: &Local, spectrum: &Spectrum) -> Result<f64> {
    let made = &local.linearization;
    let dependent = match (&made.loops, &made.dependent_map, &made.tree) {
        (Some(loops), Some(map), Some(tree)) if !loops.dependent.is_empty() => {
            Dependent::new(setting, local, (loops, map, tree))?
        }
        _ => Dependent::none(local.r.len()),
    };
    let largest = |squares: DVector<f64>| squares.iter().map(|v| v.sqrt()).fold(0.0, nan_or_larger);
    let squares = |forces: &DMatrix<f64>, d| dependent.squares(local, spectrum, forces, d);
    let open = &dependent.open;
    let left = &dependent.stiffness * open + DMatrix::from_columns(std::slice::from_ref(&local.r));
    let of_rows = squares(&(&dependent.stiffness * &dependent.hidden), Some(&dependent.hidden))?;
    let hidden = squares(&local.rounding(setting), None)? + of_rows;
    // places themselves are rounded to half of their last digits
    let places = 0.25 * f64::EPSILON * local.far;
    Ok(largest(squares(&left, Some(open))?) + USUAL * largest(hidden) + places)
}
