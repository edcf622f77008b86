//! Loops are closed: from the drawn configuration by the smallest change, and after any increment with ranks that are known.
//!
//! ```text
//! rank known           dy = -J_r^+ Phi_r                                          (rows that carry the rank, smallest change)
//! rank not known yet   dy = -sum_{s_k > t} v_k s_k/(s_k^2 + |Phi|^2) u_k^T Phi     (all rows; a linkage drawn open has full rank)
//! ```
//! The second is the Levenberg-Marquardt method with the residual for damping (N. Yamashita, M. Fukushima, Computing Suppl. 15
//! (2001) 239-249), which converges quadratically although rows are redundant at the end; weak directions must not run away.
use nalgebra::{DMatrix, DVector};

use crate::constraint::loops::column_scales;
use crate::constraint::rows::block_names;
use crate::constraint::spectrum::spectrum;
use crate::error::{Error, Result};
use crate::joint::Coordinate;
use crate::linalg::dense::minimum_norm;
use crate::linalg::entries::Entries;
use crate::linalg::kkt::{Kkt, Ordering};
use crate::linalg::matrix::Matrix;
use crate::linalg::rows::{Block, Level as Asked, RowBlocks, Units, parts};
use crate::model::layout;
use crate::multibody::System;
use crate::multibody::assemble::{Effects, Scene};
use crate::multibody::decision::Decision;
use crate::multibody::placement::{Placement, State, advance, coordinates_of_poses, drawn_q, marker_pose, place};
use crate::multibody::topology::{Node, Purpose};
use crate::run::Counts;
use crate::spatial::{Pose, V3, rotation_of_quaternion};
use crate::tolerances::constraints::{CLOSED_ENOUGH, DOUBTFUL, FELT, POSE_ROUNDING};

const MAX_ITERATIONS: usize = 60;
/// Blocks of more rows and columns are closed by sparse factors.
const DENSE: usize = 300;
/// No step is longer, in characteristic lengths or radians: rotations are not linear.
const LONGEST: f64 = 0.5;

/// The drawn coordinates, or those of the user's first guess.
pub fn drawn_start(system: &System) -> Vec<f64> {
    let topology = &system.topology;
    let mut q = drawn_q(topology, &system.geometry);
    if topology.tables.poses.is_empty() {
        return q;
    }
    let mut poses: Vec<Pose<f64>> = system.geometry.bodies.iter().map(|b| b.drawn).collect();
    for &(body, x) in &topology.tables.poses {
        let r = rotation_of_quaternion(&system.x[x + layout::pose::ORIENTATION..x + layout::pose::ORIENTATION + 4]);
        let origin = V3::from_fn(|k, _| system.x[x + layout::pose::AT + k]);
        poses[body] = Pose { p: origin + r * system.geometry.bodies[body].com, r };
    }
    let guessed = coordinates_of_poses(topology, &system.geometry, &poses);
    let touched = |node: &Node| {
        let given = |b: usize| topology.tables.poses.iter().any(|(body, _)| *body == b);
        given(node.body) || node.parent.is_some_and(|p| given(topology.nodes[p].body))
    };
    for (i, node) in topology.nodes.iter().enumerate() {
        if touched(node) {
            q[node.q..node.q + guessed[i].len()].copy_from_slice(&guessed[i]);
        }
    }
    q
}

/// The scene of a placement at rest, t = 0.
pub fn scene_at_rest<'a>(system: &'a System, placement: &'a Placement<f64>, effects: Effects) -> Scene<'a, f64> {
    Scene {
        topology: &system.topology,
        geometry: &system.geometry,
        x: &system.x,
        memory: &[],
        placement,
        rate: None,
        acceleration: None,
        t: 0.0,
        effects,
    }
}

/// Phi, with J into any place.
pub(crate) fn rows_into<E: Entries<f64>>(
    system: &System,
    q: &[f64],
    effects: Effects,
    jacobian: &mut E,
) -> DVector<f64> {
    let placement = place(&system.topology, &system.geometry, q, None);
    scene_at_rest(system, &placement, effects).constraints_into(jacobian)
}

/// Phi and J, sparse where the model is large.
pub fn rows_at(system: &System, q: &[f64], effects: Effects) -> (DVector<f64>, Matrix) {
    let (rows, columns) = (system.topology.rows.len(), system.n_tree());
    let mut jacobian = Matrix::zeros(rows, columns, rows + columns > DENSE);
    let phi = rows_into(system, q, effects, &mut jacobian);
    (phi, jacobian)
}

/// Close the loops of a state by the smallest change; returns the number of steps.
pub fn close(system: &System, state: &mut State, effects: Effects, counts: &mut Counts) -> Result<usize> {
    if system.topology.rows.is_empty() {
        return Ok(0);
    }
    let decision = system.decision(effects)?;
    let steps = close_with(system, &mut state.q, effects, &decision.rows)?;
    check_redundant(system, &state.q, effects, &decision)?;
    counts.add("assembly iterations", steps as u64);
    Ok(steps)
}

/// What rounding leaves of each row, free of units.
fn rounding(system: &System, q: &[f64], effects: Effects, rows: &RowBlocks) -> Vec<f64> {
    let bounds = crate::constraint::loop_lengths::bounds(system, q, effects, rows);
    bounds.into_iter().map(|b| POSE_ROUNDING * b).collect()
}

/// The largest of some rows, free of units, and whether all are rounding.
fn largest(phi: &DVector<f64>, own: &[usize], rows: &RowBlocks, rounding: &[f64]) -> (f64, Option<usize>, bool) {
    let mut worst = (0.0, None, true);
    for i in own {
        let value = (phi[*i] * rows.row_scale[*i]).abs();
        worst.2 &= value <= rounding[*i];
        if value > worst.0 {
            worst = (value, Some(*i), worst.2);
        }
    }
    worst
}

/// Newton's method on the rows that carry the known ranks.
pub(crate) fn close_with(system: &System, q: &mut [f64], effects: Effects, rows: &RowBlocks) -> Result<usize> {
    let columns = column_scales(&system.topology, system.length);
    let rounding = rounding(system, q, effects, rows);
    let mut best = f64::INFINITY;
    for iteration in 0..=MAX_ITERATIONS {
        let (phi, jacobian) = rows_at(system, q, effects);
        check_finite(system, &phi)?;
        let kept = rows.select(&jacobian, Asked::Position);
        let (size, worst, closed) = largest(&phi, &kept, rows, &rounding);
        let stalled = iteration > 3 && size >= best;
        if closed || stalled && best < CLOSED_ENOUGH {
            check_orientation(system, q)?;
            return Ok(iteration);
        }
        if iteration == MAX_ITERATIONS || iteration > 12 && size > 0.9 * best {
            return Err(cannot_close(system, &phi, worst, size));
        }
        best = best.min(size);
        let mut dy = vec![0.0; columns.len()];
        let small = parts(&jacobian, &rows.blocks, Asked::Position, natural(rows, &columns), is_dense);
        for (block, part) in rows.blocks.iter().zip(&small) {
            let (own, places): (Vec<usize>, Vec<usize>) = (block.rows_at(Asked::Position).0.iter().enumerate())
                .filter(|(_, i)| kept.binary_search(i).is_ok())
                .map(|(r, i)| (*i, r))
                .unzip();
            if largest(&phi, &own, rows, &rounding).0 == 0.0 {
                continue;
            }
            match part {
                Some(m) => smallest_dense_step(&m.select_rows(&places), &phi, &own, block, (rows, &columns), &mut dy)?,
                None => smallest_step(&jacobian, &phi, &own, &columns, &mut dy)?,
            }
        }
        move_by(system, q, dy, &columns);
    }
    Ok(MAX_ITERATIONS)
}

/// Rows free of units, columns in characteristic lengths: the measure of the smallest change.
fn natural<'a>(rows: &'a RowBlocks, columns: &'a [f64]) -> Units<'a> {
    Units { row: &rows.row_scale, column: columns }
}

fn is_dense(block: &Block) -> bool {
    block.n_position + block.columns.len() <= DENSE
}

/// The smallest change that closes rows of a block to first order, in characteristic lengths and radians.
fn smallest_dense_step(
    m: &DMatrix<f64>,
    phi: &DVector<f64>,
    own: &[usize],
    block: &Block,
    (rows, columns): (&RowBlocks, &[f64]),
    dy: &mut [f64],
) -> Result<()> {
    let right = DVector::from_fn(own.len(), |k, _| -phi[own[k]] * rows.row_scale[own[k]]);
    let step = minimum_norm(m, &right)?;
    for (c, s) in block.columns.iter().zip(step.iter()) {
        dy[*c] += s * columns[*c];
    }
    Ok(())
}

/// The same by a sparse factor.
fn smallest_step(jacobian: &Matrix, phi: &DVector<f64>, own: &[usize], columns: &[f64], dy: &mut [f64]) -> Result<()> {
    let n = columns.len();
    let mut weight = Matrix::zeros(n, n, true);
    (0..n).for_each(|i| weight.add(i, i, columns[i].powi(-2)));
    let kkt = Kkt::with_rows(&weight, jacobian, own.to_vec(), Some(&Ordering::default()))?;
    let mut all = DVector::zeros(phi.len());
    own.iter().for_each(|i| all[*i] = -phi[*i]);
    let step = kkt.solve_one(&DVector::zeros(n), &all)?.0;
    dy.iter_mut().zip(step.iter()).for_each(|(d, s)| *d += s);
    Ok(())
}

fn move_by(system: &System, q: &mut [f64], mut dy: Vec<f64>, columns: &[f64]) {
    let longest = dy.iter().zip(columns).fold(0.0, |a: f64, (d, c)| a.max((d / c).abs()));
    if longest > LONGEST {
        dy.iter_mut().for_each(|d| *d *= LONGEST / longest);
    }
    advance(&system.topology, q, &dy);
}

/// From the drawing, before ranks are known.
pub(crate) fn close_drawn(system: &System, q: &mut [f64], effects: Effects, rows: &RowBlocks) -> Result<usize> {
    let columns = column_scales(&system.topology, system.length);
    let limits = rounding(system, q, effects, rows);
    let mut best = f64::INFINITY;
    for iteration in 0..=MAX_ITERATIONS {
        let (phi, jacobian) = rows_at(system, q, effects);
        check_finite(system, &phi)?;
        let of = |b: &Block| largest(&phi, &b.rows[..b.n_position], rows, &limits);
        let open: Vec<&Block> = rows.blocks.iter().filter(|b| !of(b).2).collect();
        let (size, worst) = open.iter().map(|b| of(b)).fold((0.0, None), |a, b| if b.0 > a.0 { (b.0, b.1) } else { a });
        let stalled = iteration > 3 && size >= best;
        if open.is_empty() || stalled && best < CLOSED_ENOUGH {
            return Ok(iteration);
        }
        if iteration == MAX_ITERATIONS || iteration > 12 && size > 0.9 * best {
            // rows that contradict each other by less are doubtful, not wrong
            return if size <= system.tolerance { Ok(iteration) } else { Err(cannot_close(system, &phi, worst, size)) };
        }
        best = best.min(size);
        let mut dy = vec![0.0; columns.len()];
        let open: Vec<Block> = open.into_iter().cloned().collect();
        let small = parts(&jacobian, &open, Asked::Position, rows.units(), is_dense);
        for (block, part) in open.iter().zip(small) {
            match part {
                Some(m) => drawn_step(system, m, &phi, block, (rows, &columns), &mut dy)?,
                None => smallest_step(&jacobian, &phi, &block.rows[..block.n_position], &columns, &mut dy)?,
            }
        }
        move_by(system, q, dy, &columns);
    }
    Ok(MAX_ITERATIONS)
}

/// Newton's step where rows are independent by far, and the damped one where they may become redundant; from the rows of positions.
fn drawn_step(
    system: &System,
    m: DMatrix<f64>,
    phi: &DVector<f64>,
    block: &Block,
    (rows, columns): (&RowBlocks, &[f64]),
    dy: &mut [f64],
) -> Result<()> {
    let own = &block.rows[..block.n_position];
    let found = spectrum(&m, &vec![0.0; own.len()], system.tolerance)?;
    let open = DVector::from_fn(own.len(), |k, _| phi[own[k]] * rows.row_scale[own[k]]);
    let size = open.norm();
    // rows that repeat others exactly do no harm; weak ones run away
    let (least, most) = ((DOUBTFUL * system.tolerance).max(size), found.values.first().copied().unwrap_or(0.0));
    if found.values.iter().all(|s| *s > least || *s <= found.floor.max(FELT * most)) {
        let measure = |c: usize| columns[block.columns[c]] / rows.column_scale[block.columns[c]];
        let measured = DMatrix::from_fn(m.nrows(), m.ncols(), |r, c| m[(r, c)] * measure(c));
        return smallest_dense_step(&measured, phi, own, block, (rows, columns), dy);
    }
    for (k, s) in found.values.iter().enumerate().filter(|(_, s)| **s > system.tolerance.max(found.floor)) {
        let part = found.left.column(k).dot(&open) * s / (s * s + size * size);
        for (c, v) in block.columns.iter().zip(found.right.column(k).iter()) {
            dy[*c] -= part * v * rows.column_scale[*c];
        }
    }
    Ok(())
}

/// Rows that were taken for redundant must agree with those that carry them, within the tolerance of the drawing.
pub(crate) fn check_redundant(system: &System, q: &[f64], effects: Effects, decision: &Decision) -> Result<()> {
    if !decision.rows.is_redundant() {
        return Ok(());
    }
    let (phi, _) = rows_at(system, q, effects);
    let limits = rounding(system, q, effects, &decision.rows);
    for block in decision.rows.blocks.iter().filter(|b| b.is_redundant()) {
        let (size, worst, _) = largest(&phi, &block.rows[..block.n_position], &decision.rows, &limits);
        let limit = worst.map_or(0.0, |i| limits[i]).max(decision.tolerance);
        if size > limit {
            return Err(contradiction(system, block, &phi, worst, size));
        }
    }
    Ok(())
}

fn contradiction(system: &System, block: &Block, phi: &DVector<f64>, worst: Option<usize>, size: f64) -> Error {
    let row = worst.map(|i| &system.topology.rows[i]);
    match row.filter(|r| r.purpose == Purpose::Joint) {
        Some(r) => {
            let unit = if r.coordinate.is_length() { "m" } else { "rad" };
            let off = worst.map_or(0.0, |i| phi[i].abs());
            Error::Assembly(format!(
                "the loop cannot close at joint '{}': the other joints of the loop ({}) leave it open by {off:.3e} {unit} (relative gap \
                 {size:.1e}) in a direction in which none of them can move; draw them so that they agree, or give Model(tolerance=...) \
                 above that gap if the drawing is no more accurate",
                system.topology.tables.joints[r.joint].name,
                shown(&block_names(system, block)),
            ))
        }
        None => cannot_close(system, phi, worst, size),
    }
}

/// Names in quotes, the first ones where they are many.
pub fn shown(names: &[String]) -> String {
    const SHOWN: usize = 6;
    let list: Vec<String> = names.iter().take(SHOWN).map(|n| format!("'{n}'")).collect();
    match names.len() {
        n if n > SHOWN => format!("{} and {} more", list.join(", "), n - SHOWN),
        _ => list.join(", "),
    }
}

/// Is a row one of a function of several coordinates?
fn is_function(system: &System, row: usize) -> bool {
    matches!(system.topology.rows[row].purpose, Purpose::Constraint(_))
}

fn check_finite(system: &System, phi: &DVector<f64>) -> Result<()> {
    if phi.iter().all(|v| v.is_finite()) {
        return Ok(());
    }
    let undefined = phi.iter().position(|v| !v.is_finite()).filter(|i| is_function(system, *i));
    Err(Error::Assembly(match undefined {
        Some(i) => format!(
            "constraint '{}' is not a number in this state; write its function so that it is defined there, or draw the bodies elsewhere",
            system.topology.row_name(i)
        ),
        None => "the constraints cannot be evaluated in this state".into(),
    }))
}

fn cannot_close(system: &System, phi: &DVector<f64>, worst: Option<usize>, size: f64) -> Error {
    let Some(row) = worst else {
        return Error::Assembly("the loops cannot close".into());
    };
    let spec = &system.topology.rows[row];
    if is_function(system, row) {
        return Error::Assembly(format!(
            "constraint '{}' cannot be satisfied: its function is {:.6} at the closest approach (relative gap {size:.1e}); check it at \
             t = 0 and whether joints, drives or other constraints already fix its motions",
            system.topology.row_name(row),
            phi[row]
        ));
    }
    let joint = &system.topology.tables.joints[spec.joint];
    let (what, unit) = match spec.coordinate {
        c if spec.purpose != Purpose::Joint => {
            let kind = if matches!(spec.purpose, Purpose::Drive(_)) { "drive" } else { "coupler" };
            let unit = if c.is_length() { "m" } else { "rad" };
            return Error::Assembly(format!(
                "{kind} '{}' asks for a value of joint '{}' that the model cannot take: it is off by {:.6} {unit} at the closest approach; \
                 check its value at t = 0 and whether another drive or a closed loop already fixes this coordinate",
                system.topology.row_name(row),
                joint.name,
                phi[row].abs()
            ));
        }
        c if c.is_length() => ("points are apart by", "m"),
        _ => ("axes are off by", "rad"),
    };
    let bodies =
        format!("'{}' and '{}'", system.topology.tables.body_name(joint.a), system.topology.tables.body_name(joint.b));
    Error::Assembly(format!(
        "the loop cannot close at joint '{}' between {bodies}: its {what} {:.6} {unit} at the closest approach (relative gap {size:.1e}); \
         check the points and lengths of the joints in this loop",
        joint.name,
        phi[row].abs()
    ))
}

/// Dot rows also vanish for axes that point opposite ways; a joint assembled so would work backwards.
fn check_orientation(system: &System, q: &[f64]) -> Result<()> {
    let placement = place(&system.topology, &system.geometry, q, None);
    for &j in &system.topology.cut {
        let spec = &system.topology.tables.joints[j];
        let aligned = spec.kind.constraints().contains(&Coordinate::Dot(0, 2));
        let pair = &system.geometry.joints[j];
        let world = |body, local: &Pose<f64>| marker_pose(&system.topology, &placement.pose, body, local);
        let (a, b) = (world(spec.a, &pair.a), world(spec.b, &pair.b));
        if aligned && a.r.column(2).dot(&b.r.column(2)) < 0.0 {
            return Err(Error::Assembly(format!(
                "joint '{}' closes only with its axis reversed; draw its bodies closer to the assembled pose",
                spec.name
            )));
        }
    }
    Ok(())
}
