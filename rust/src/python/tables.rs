//! Tables from the dict that Python writes (docs/tables.md).
use std::sync::Arc;

use numpy::PyReadonlyArray1;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::aero::polar::Polar;
use crate::aero::section::Inflow;
use crate::aero::unsteady::Unsteady;
use crate::error::{Error, Result};
use crate::force::{External, FunctionLaw};
use crate::joint::JointKind;
use crate::model::air::{AirSpec, History, SectionSpec};
use crate::model::constraint::{ConstraintFunction, ConstraintSpec};
use crate::model::flexible::{FlexibleSpec, TipSpec};
use crate::model::layout::{air_inflow, air_unsteady, joint_type, load_type};
use crate::model::motion::{Function, MotionKind, MotionSpec};
use crate::model::tables::{
    BodyRef, BodySpec, CouplerSpec, DriveSpec, ElementKind, ElementSpec, FunctionSpec, JointSpec, LawSpec,
    LoadMotionSpec, LoadSpec, Tables,
};

use super::border::called;
use super::expressions::program;

struct Reader<'a, 'py>(&'a Bound<'py, PyDict>);

impl Reader<'_, '_> {
    fn item(&self, key: &str) -> PyResult<Bound<'_, PyAny>> {
        self.0.get_item(key)?.ok_or_else(|| Error::model(format!("the tables have no '{key}'")).into())
    }

    fn ints(&self, key: &str) -> PyResult<Vec<i64>> {
        let item = self.item(key)?;
        if let Ok(array) = item.extract::<PyReadonlyArray1<'_, i64>>() {
            return Ok(array.as_array().to_vec());
        }
        item.extract()
    }

    fn names(&self, key: &str) -> PyResult<Vec<String>> {
        self.item(key)?.extract()
    }
}

fn offset(x: i64) -> Result<usize> {
    usize::try_from(x).map_err(|_| Error::model(format!("{x} is not an offset into the value vector")))
}

fn body(b: i64) -> BodyRef {
    usize::try_from(b).ok()
}

fn same_length(key: &str, lengths: &[usize]) -> Result<()> {
    if lengths.windows(2).any(|w| w[0] != w[1]) {
        return Err(Error::model(format!("the '{key}' tables have different lengths {lengths:?}")));
    }
    Ok(())
}

pub fn values(array: &PyReadonlyArray1<'_, f64>) -> Vec<f64> {
    array.as_array().iter().copied().collect()
}

pub fn tables(dict: &Bound<'_, PyDict>) -> PyResult<Tables> {
    let reader = Reader(dict);
    let x = values(&reader.item("x")?.extract::<PyReadonlyArray1<'_, f64>>()?);
    let gravity = reader.ints("gravity_x")?.first().copied().and_then(|g| usize::try_from(g).ok());
    let mut bodies = bodies(&reader)?;
    let flexible = Flexible::read(&reader, &bodies)?;
    let (joints, elements) = (joints(&reader, &flexible)?, elements(&reader, &flexible)?);
    let loads = loads(&reader, &flexible)?;
    let (air, sections) = air(&reader, &flexible)?;
    bodies.extend(flexible.tip_bodies);
    let tables = Tables {
        x,
        bodies,
        joints,
        elements,
        loads,
        flexible: flexible.bodies,
        tips: flexible.tips,
        laws: laws(&reader)?,
        functions: functions(&reader)?,
        motions: motions(&reader)?,
        drives: drives(&reader)?,
        couplers: couplers(&reader)?,
        constraints: constraints(&reader)?,
        air,
        sections,
        load_motions: load_motions(&reader)?,
        gravity,
        poses: poses(&reader)?,
        tolerance: reader.item("tolerance")?.extract()?,
        absolute: dict.get_item("absolute")?.is_some(),
    };
    tables.check()?;
    Ok(tables)
}

fn bodies(reader: &Reader<'_, '_>) -> PyResult<Vec<BodySpec>> {
    let (names, x) = (reader.names("body_name")?, reader.ints("body_x")?);
    same_length("body", &[names.len(), x.len()])?;
    names.into_iter().zip(x).map(|(name, x)| Ok(BodySpec { name, x: offset(x)?, tip: None })).collect()
}

/// Flexible bodies and the frame of each node: its body, or a body of its own behind the others.
#[derive(Default)]
struct Flexible {
    bodies: Vec<FlexibleSpec>,
    tips: Vec<TipSpec>,
    tip_bodies: Vec<BodySpec>,
    frame: Vec<Option<usize>>,
}

impl Flexible {
    fn read(reader: &Reader<'_, '_>, bodies: &[BodySpec]) -> PyResult<Self> {
        let Some([body, modes, x]) = optional(reader, "flexible", ["body", "modes", "x"])? else {
            return Ok(Flexible::default());
        };
        let mut made = Flexible::default();
        for i in 0..body.len() {
            made.bodies.push(FlexibleSpec { body: offset(body[i])?, m: offset(modes[i])?, x: offset(x[i])? });
        }
        let names = reader.names("flexible_node_name")?;
        let [on, x, second] = columns(reader, "flexible_node", ["body", "x", "quadratic"], names.len())?;
        made.frame = vec![None; names.len()];
        for i in reader.ints("moving_node")? {
            let node = offset(i)?;
            let owner = on.get(node).copied().unwrap_or(-1);
            let flexible = made.bodies.iter().position(|f| f.body as i64 == owner);
            let (Some(flexible), Some(frame)) = (flexible, bodies.get(offset(owner)?)) else {
                return Err(Error::model("a node belongs to no flexible body").into());
            };
            let number = bodies.len() + made.tips.len();
            made.frame[node] = Some(number);
            made.tip_bodies.push(BodySpec {
                name: format!("{}.{}", frame.name, names[node]),
                x: frame.x,
                tip: Some(made.tips.len()),
            });
            let quadratic = usize::try_from(second[node]).ok();
            made.tips.push(TipSpec { flexible, body: number, x: offset(x[node])?, quadratic });
        }
        Ok(made)
    }

    /// The bodies in a column of `stem`, nodes taken for what they stand for.
    fn placed(&self, reader: &Reader<'_, '_>, key: &str, bodies: Vec<i64>) -> PyResult<Vec<i64>> {
        if self.bodies.is_empty() {
            return Ok(bodies);
        }
        let nodes = reader.ints(key)?;
        same_length(key, &[nodes.len(), bodies.len()])?;
        let frame = |(b, n): (i64, i64)| {
            let own = usize::try_from(n).ok().and_then(|n| self.frame.get(n).copied());
            own.flatten().map_or(b, |f| f as i64)
        };
        Ok(bodies.into_iter().zip(nodes).map(frame).collect())
    }
}

fn joints(reader: &Reader<'_, '_>, flexible: &Flexible) -> PyResult<Vec<JointSpec>> {
    let names = reader.names("joint_name")?;
    let [kind, a, b, flags, x] = columns(reader, "joint", ["type", "a", "b", "flags", "x"], names.len())?;
    let a = flexible.placed(reader, "joint_a_node", a)?;
    let b = flexible.placed(reader, "joint_b_node", b)?;
    let one = |(i, name): (usize, String)| {
        Ok(JointSpec {
            name,
            kind: joint_kind(kind[i])?,
            a: body(a[i]),
            b: body(b[i]),
            flags: flags[i],
            x: offset(x[i])?,
        })
    };
    names.into_iter().enumerate().map(one).collect()
}

/// The joint of a code in the Tables.
fn joint_kind(code: i64) -> Result<JointKind> {
    let name = usize::try_from(code).ok().and_then(|code| joint_type::NAMES.get(code));
    let name = name.ok_or_else(|| Error::model(format!("joint type {code} does not exist")))?;
    JointKind::named(name)
}

fn elements(reader: &Reader<'_, '_>, flexible: &Flexible) -> PyResult<Vec<ElementSpec>> {
    let names = reader.names("element_name")?;
    let [kind, a, b, flags, x] = columns(reader, "element", ["type", "a", "b", "flags", "x"], names.len())?;
    let a = flexible.placed(reader, "element_a_node", a)?;
    let b = flexible.placed(reader, "element_b_node", b)?;
    let one = |(i, name): (usize, String)| {
        let kind = ElementKind::from_code(kind[i])?;
        Ok(ElementSpec { name, kind, a: body(a[i]), b: body(b[i]), flags: flags[i], x: offset(x[i])? })
    };
    names.into_iter().enumerate().map(one).collect()
}

fn loads(reader: &Reader<'_, '_>, flexible: &Flexible) -> PyResult<Vec<LoadSpec>> {
    let names = reader.names("load_name")?;
    let [kind, on, frame, x] = columns(reader, "load", ["type", "body", "frame", "x"], names.len())?;
    let on = flexible.placed(reader, "load_node", on)?;
    let one = |(i, name): (usize, String)| {
        let modal = kind[i] == load_type::MODAL_FORCE;
        Ok(LoadSpec {
            name,
            torque: kind[i] == load_type::TORQUE,
            body: offset(on[i])?,
            mode: if modal { Some(offset(frame[i])?) } else { None },
            follower: !modal && frame[i] == 1,
            x: offset(x[i])?,
        })
    };
    names.into_iter().enumerate().map(one).collect()
}

fn laws(reader: &Reader<'_, '_>) -> PyResult<Vec<LawSpec>> {
    let owner = reader.ints("law_owner")?;
    let [kind, component, code, n, x] =
        columns(reader, "law", ["owner_kind", "component", "type", "n", "x"], owner.len())?;
    let one = |(i, owner): (usize, i64)| {
        let (owner, component) = (offset(owner)?, offset(component[i])?);
        Ok(LawSpec { on_joint: kind[i] == 1, owner, component, code: code[i], n: offset(n[i])?, x: offset(x[i])? })
    };
    owner.into_iter().enumerate().map(one).collect()
}

/// Laws that are functions; tables without any need not have their keys. A program is (nodes, roots), `mbrs.model.expressions.Program`;
/// a callable returns the forces and their slopes as one list of floats, checked, or raises an error that names its owner.
fn functions(reader: &Reader<'_, '_>) -> PyResult<Vec<FunctionSpec>> {
    let Some([kind, owner, n, x]) = optional(reader, "function", ["owner_kind", "owner", "n", "x"])? else {
        return Ok(Vec::new());
    };
    let coordinates: Vec<Vec<usize>> = reader.item("function_coordinates")?.extract()?;
    let bodies: Vec<Bound<'_, PyAny>> = reader.item("function_body")?.extract()?;
    same_length("function", &[owner.len(), coordinates.len(), bodies.len()])?;
    let one = |(i, coordinates): (usize, Vec<usize>)| {
        let law = function_law(coordinates.len(), offset(n[i])?, &bodies[i])?;
        Ok(FunctionSpec { on_joint: kind[i] == 1, owner: offset(owner[i])?, coordinates, law, x: offset(x[i])? })
    };
    coordinates.into_iter().enumerate().map(one).collect()
}

/// A law of `m` coordinates from a program (nodes, roots) or a callable.
pub fn function_law(m: usize, n: usize, body: &Bound<'_, PyAny>) -> PyResult<FunctionLaw> {
    if body.is_callable() {
        let call = body.clone().unbind();
        let answer = move |t: f64, u: &[f64], v: &[f64]| {
            called(|py| call.call1(py, (t, u.to_vec(), v.to_vec()))?.extract::<Vec<f64>>(py))
        };
        return Ok(FunctionLaw::external(m, answer)?);
    }
    let (nodes, roots): (Bound<'_, PyAny>, Vec<usize>) = body.extract()?;
    Ok(FunctionLaw::traced(m, n, program(&nodes, roots)?)?)
}

/// Tables without motions need not have their keys.
fn optional<const N: usize>(reader: &Reader<'_, '_>, stem: &str, keys: [&str; N]) -> PyResult<Option<[Vec<i64>; N]>> {
    let first = format!("{stem}_{}", keys[0]);
    if reader.0.get_item(&first)?.is_none() {
        return Ok(None);
    }
    let n = reader.ints(&first)?.len();
    columns(reader, stem, keys, n).map(Some)
}

fn motions(reader: &Reader<'_, '_>) -> PyResult<Vec<MotionSpec>> {
    let keys = ["type", "n", "x", "function", "output"];
    let Some([code, n, x, function, output]) = optional(reader, "motion", keys)? else {
        return Ok(Vec::new());
    };
    let functions: Vec<Arc<Function>> = match reader.0.get_item("functions")? {
        Some(all) => all.extract::<Vec<Py<PyAny>>>()?.into_iter().map(|f| Arc::new(python_function(f))).collect(),
        None => Vec::new(),
    };
    let one = |i: usize| {
        let n = offset(n[i])?;
        let kind = MotionKind::from_code(code[i], n)?;
        let own = usize::try_from(function[i]).ok().and_then(|f| functions.get(f).cloned());
        if kind == MotionKind::Function && own.is_none() {
            return Err(Error::model("a motion refers to a function that does not exist").into());
        }
        Ok(MotionSpec { kind, n, x: offset(x[i])?, function: own, output: offset(output[i])? })
    };
    (0..code.len()).map(one).collect()
}

/// mbrs.model.motions makes callables that return a list of floats, checked, or raise an error that names their owner.
fn python_function(f: Py<PyAny>) -> Function {
    Function::new(move |t| called(|py| f.call1(py, (t,))?.extract(py)))
}

fn drives(reader: &Reader<'_, '_>) -> PyResult<Vec<DriveSpec>> {
    let keys = ["joint", "coordinate", "motion"];
    let Some([joint, coordinate, motion]) = optional(reader, "drive", keys)? else {
        return Ok(Vec::new());
    };
    let names = reader.names("drive_name")?;
    same_length("drive", &[names.len(), joint.len()])?;
    let one = |(i, name)| {
        Ok(DriveSpec { name, joint: offset(joint[i])?, coordinate: offset(coordinate[i])?, motion: offset(motion[i])? })
    };
    names.into_iter().enumerate().map(one).collect()
}

fn couplers(reader: &Reader<'_, '_>) -> PyResult<Vec<CouplerSpec>> {
    let keys = ["first", "second", "first_coordinate", "second_coordinate", "x"];
    let Some([first, second, of_first, of_second, x]) = optional(reader, "coupler", keys)? else {
        return Ok(Vec::new());
    };
    let names = reader.names("coupler_name")?;
    same_length("coupler", &[names.len(), x.len()])?;
    let one = |(i, name)| {
        Ok(CouplerSpec {
            name,
            joints: [offset(first[i])?, offset(second[i])?],
            coordinates: [offset(of_first[i])?, offset(of_second[i])?],
            x: offset(x[i])?,
        })
    };
    names.into_iter().enumerate().map(one).collect()
}

/// Constraints that are functions of joint coordinates; tables without any need not have their keys. A program is (nodes, roots); a
/// callable returns values and slopes as one list of floats, checked, or raises an error that names its owner.
fn constraints(reader: &Reader<'_, '_>) -> PyResult<Vec<ConstraintSpec>> {
    let Some([level, rows, n, x]) = optional(reader, "constraint", ["level", "rows", "n", "x"])? else {
        return Ok(Vec::new());
    };
    let names = reader.names("constraint_name")?;
    let motions: Vec<Vec<(usize, usize)>> = reader.item("constraint_motions")?.extract()?;
    let bodies: Vec<Bound<'_, PyAny>> = reader.item("constraint_body")?.extract()?;
    same_length("constraint", &[x.len(), names.len(), motions.len(), bodies.len()])?;
    let one = |(i, (name, motions)): (usize, (String, Vec<(usize, usize)>))| {
        let (m, of_velocities, body) = (motions.len(), level[i] == 1, &bodies[i]);
        let function = if body.is_callable() {
            let call = body.clone().unbind();
            let answer = move |t: f64, u: &[f64], _: &[f64]| {
                called(|py| call.call1(py, (t, u.to_vec()))?.extract::<Vec<f64>>(py))
            };
            ConstraintFunction::external(m, offset(rows[i])?, of_velocities, External::new(answer))?
        } else {
            let (nodes, roots): (Bound<'_, PyAny>, Vec<usize>) = body.extract()?;
            ConstraintFunction::traced(m, offset(n[i])?, of_velocities, program(&nodes, roots)?)?
        };
        Ok(ConstraintSpec { name, motions, function, x: offset(x[i])? })
    };
    names.into_iter().zip(motions).enumerate().map(one).collect()
}

fn load_motions(reader: &Reader<'_, '_>) -> PyResult<Vec<LoadMotionSpec>> {
    let keys = ["load", "component", "motion"];
    let Some([load, component, motion]) = optional(reader, "load_motion", keys)? else {
        return Ok(Vec::new());
    };
    let one = |i: usize| {
        Ok(LoadMotionSpec { load: offset(load[i])?, component: offset(component[i])?, motion: offset(motion[i])? })
    };
    (0..load.len()).map(one).collect()
}

/// Air and its sections; tables without any need not have their keys.
fn air(reader: &Reader<'_, '_>, flexible: &Flexible) -> PyResult<(Vec<AirSpec>, Vec<SectionSpec>)> {
    let keys = ["inflow", "x", "history_x", "unsteady"];
    let Some([inflow, x, history, unsteady]) = optional(reader, "air", keys)? else {
        return Ok((Vec::new(), Vec::new()));
    };
    let names = reader.names("air_name")?;
    same_length("air", &[names.len(), x.len()])?;
    let of = reader.ints("section_air")?;
    let times: Vec<Vec<f64>> = reader.item("air_times")?.extract()?;
    same_length("air", &[names.len(), times.len()])?;
    let one = |(i, name): (usize, String)| {
        let inflow = match inflow[i] {
            air_inflow::GIVEN => Inflow::Given,
            air_inflow::MOMENTUM => Inflow::Momentum,
            code => return Err(Error::model(format!("inflow {code} does not exist")).into()),
        };
        let sections = of.iter().filter(|a| **a == i as i64).count();
        let history = usize::try_from(history[i]).ok().map(|x| History { times: times[i].clone(), x, sections });
        let bit = |b: i64| unsteady[i] & b != 0;
        let unsteady = Unsteady {
            inflow: bit(air_unsteady::INFLOW),
            attached: bit(air_unsteady::ATTACHED),
            stall: bit(air_unsteady::STALL),
        };
        Ok(AirSpec { name, inflow, unsteady, x: offset(x[i])?, history })
    };
    let airs = names.into_iter().enumerate().map(one).collect::<PyResult<_>>()?;
    let angles: Vec<Vec<f64>> = reader.item("polar_angle")?.extract()?;
    let pieces: Vec<Vec<f64>> = reader.item("polar_pieces")?.extract()?;
    same_length("polar", &[angles.len(), pieces.len()])?;
    let polars = angles.into_iter().zip(pieces).map(|(a, p)| Polar::new(a, &p).map(Arc::new));
    let polars = polars.collect::<Result<Vec<_>>>()?;
    let polar = |i: i64| {
        let found = usize::try_from(i).ok().and_then(|i| polars.get(i).cloned());
        found.ok_or_else(|| Error::model("a section refers to a polar that does not exist"))
    };
    let [on, first, second, x] = columns(reader, "section", ["body", "polar", "second_polar", "x"], of.len())?;
    let on = flexible.placed(reader, "section_node", on)?;
    let one = |i: usize| {
        let polars = [polar(first[i])?, polar(second[i])?];
        let number = of[..i].iter().filter(|a| **a == of[i]).count();
        Ok(SectionSpec { air: offset(of[i])?, number, body: offset(on[i])?, x: offset(x[i])?, polars })
    };
    Ok((airs, (0..of.len()).map(one).collect::<PyResult<_>>()?))
}

fn poses(reader: &Reader<'_, '_>) -> PyResult<Vec<(usize, usize)>> {
    if reader.0.get_item("pose_body")?.is_none() {
        return Ok(Vec::new());
    }
    let (on, x) = (reader.ints("pose_body")?, reader.ints("pose_x")?);
    same_length("pose", &[on.len(), x.len()])?;
    on.into_iter().zip(x).map(|(b, x)| Ok((offset(b)?, offset(x)?))).collect()
}

fn columns<const N: usize>(reader: &Reader<'_, '_>, stem: &str, keys: [&str; N], n: usize) -> PyResult<[Vec<i64>; N]> {
    let mut all = [const { Vec::new() }; N];
    for (column, key) in all.iter_mut().zip(keys) {
        *column = reader.ints(&format!("{stem}_{key}"))?;
        same_length(stem, &[n, column.len()])?;
    }
    Ok(all)
}
