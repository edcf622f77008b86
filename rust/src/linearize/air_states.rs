//! States of sections in the air about a linearised state, z = z_s + d: about the states of rest there, or about given ones.
//!
//! ```text
//! M y" + D y' + S y = E d + f,   d' = P y + R y' + A d
//! ```
//! D and S at held states follow from those of a linearisation, where states have come to rest: D - E A^-1 R and S - E A^-1 P.
use nalgebra::{DMatrix, DVector};
use num_dual::Dual64;

use crate::error::{Error, Result};
use crate::linearize::rolling::rolls;
use crate::linearize::{Linearization, Path, Setting, linearize, turning};
use crate::model::geometry::Geometry;
use crate::multibody::air::Here;
use crate::multibody::assemble::Scene;
use crate::multibody::numbers::Numbers;
use crate::multibody::placement::{advance, place};
use crate::multibody::rotations::add_commutator;
use crate::multibody::topology::Topology;
use crate::run::Counts;

/// E (dof, m), P and R (m, dof), A (m, m); the section of each state, and its air.
pub struct AirStates {
    pub effect: DMatrix<f64>,
    pub by_place: DMatrix<f64>,
    pub by_rate: DMatrix<f64>,
    pub own: DMatrix<f64>,
    pub section: Vec<usize>,
    pub air: Vec<usize>,
    /// z_s and its rate
    pub value: Vec<f64>,
    pub rate: Vec<f64>,
}

/// Sections with states: their number, and the states.
type Resting = Vec<(usize, Vec<f64>)>;

/// None where no section has states. `turn`: as of `parts`. `given`: the states one after the other; none are those of rest.
pub fn air_states(
    setting: &Setting<'_>,
    turn: Option<&DMatrix<f64>>,
    given: Option<&[f64]>,
) -> Result<Option<AirStates>> {
    let Some(mut resting) = resting(setting)? else {
        return Ok(None);
    };
    if let Some(given) = given {
        let states = resting.iter_mut().flat_map(|(_, z)| z.iter_mut());
        states.zip(given).for_each(|(z, given)| *z = *given);
    }
    let lin = linearize(setting, &mut Counts::default())?;
    let mut made = reduced(setting, &lin, &resting);
    if let Some(w) = turn {
        made.by_place += &made.by_rate * w;
    }
    Ok(Some(made))
}

/// The sections that have states, None without any.
fn resting(setting: &Setting<'_>) -> Result<Option<Resting>> {
    let topology = &*setting.system.topology;
    let n = if setting.effects.aerodynamics { topology.tables.sections.len() } else { 0 };
    let with = (0..n).filter(|i| !topology.section_memory(*i).is_empty()).collect::<Vec<_>>();
    if with.is_empty() {
        return Ok(None);
    }
    if rolls(setting) {
        return Err(Error::model("states of the air are not known in the linearisation of a state that rolls"));
    }
    let system = setting.system;
    let rate = setting.rate::<f64>();
    let placement = place(topology, &system.geometry, &setting.state.q, rate.as_deref());
    let numbers = Numbers { x: &system.x, memory: &[], t: 0.0 };
    let at_rest = |i: &usize| {
        let here = Here::new(topology, &system.geometry, &placement, numbers, *i);
        (*i, here.flow().states[..topology.section_memory(*i).len() - 1].to_vec())
    };
    Ok(Some(with.iter().map(at_rest).collect()))
}

/// In minimal coordinates.
fn reduced(setting: &Setting<'_>, lin: &Linearization, resting: &Resting) -> AirStates {
    let (system, topology) = (setting.system, &*setting.system.topology);
    let (place_tree, rate_tree) = input(setting, resting);
    let (effect_tree, own, rate) = effect(setting, resting);
    let section: Vec<usize> = resting.iter().flat_map(|(i, z)| vec![*i; z.len()]).collect();
    let air = section.iter().map(|i| topology.tables.sections[*i].air).collect();
    let value = resting.iter().flat_map(|(_, z)| z.clone()).collect();
    let (Some(loops), Some(b)) = (&lin.loops, &lin.dependent_map) else {
        return AirStates {
            effect: effect_tree,
            by_place: place_tree,
            by_rate: rate_tree,
            own,
            section,
            air,
            value,
            rate,
        };
    };
    let columns: Vec<_> = effect_tree.column_iter().map(|c| loops.reduce_vector(&c.into_owned(), b)).collect();
    let onto = |rows: &DMatrix<f64>| {
        let pick = |which: &[usize]| DMatrix::from_fn(rows.nrows(), which.len(), |i, j| rows[(i, which[j])]);
        pick(&loops.independent) + pick(&loops.dependent) * b
    };
    let mut by_place = onto(&place_tree);
    if let Some(rate) = &setting.rate() {
        let turning = turning(setting, loops, &Path { x: &system.x, q: &setting.state.q, rate });
        let moved = DMatrix::from_fn(rate_tree.nrows(), turning.rows.len(), |i, j| rate_tree[(i, turning.rows[j])]);
        by_place += moved * turning.first;
    }
    let effect = DMatrix::from_columns(&columns);
    AirStates { effect, by_place, by_rate: onto(&rate_tree), own, section, air, value, rate }
}

/// P and R by the tree coordinates.
fn input(setting: &Setting<'_>, resting: &Resting) -> (DMatrix<f64>, DMatrix<f64>) {
    let n = setting.system.n_tree();
    let m = resting.iter().map(|(_, z)| z.len()).sum();
    let (mut by_place, mut by_rate) = (DMatrix::zeros(m, n), DMatrix::zeros(m, n));
    for j in 0..n {
        for (out, moves) in [(&mut by_place, true), (&mut by_rate, false)] {
            for (i, v) in rates(setting, resting, j, moves).into_iter().enumerate() {
                out[(i, j)] = v;
            }
        }
    }
    (by_place, by_rate)
}

/// The change of all rates of states, held themselves, along a coordinate or its rate.
fn rates(setting: &Setting<'_>, resting: &Resting, along: usize, moves: bool) -> Vec<f64> {
    let system = setting.system;
    let topology = &*system.topology;
    let n = system.n_tree();
    let geometry: Geometry<Dual64> = system.geometry.map(Dual64::from_re);
    let lift = |v: &[f64]| v.iter().map(|v| Dual64::from_re(*v)).collect::<Vec<_>>();
    let (x, mut q) = (lift(&system.x), lift(&setting.state.q));
    let mut rate = setting.rate::<Dual64>().unwrap_or_else(|| vec![Dual64::from_re(0.0); n]);
    let mut unit = vec![Dual64::from_re(0.0); n];
    unit[along].eps = 1.0;
    if moves {
        advance(topology, &mut q, &unit);
        let before = rate.clone();
        // three rotations carry their rates along
        add_commutator(topology, 1.0, (&unit, &before), &mut rate);
    } else {
        rate[along].eps += 1.0;
    }
    let placement = place(topology, &geometry, &q, Some(&rate));
    let numbers = Numbers { x: &x, memory: &[], t: 0.0 };
    let of = |(i, z): &(usize, Vec<f64>)| {
        let flow = Here::new(topology, &geometry, &placement, numbers, *i).flow_of(&lift(z));
        flow.rates[..z.len()].iter().map(|r| r.eps).collect::<Vec<_>>()
    };
    resting.iter().flat_map(of).collect()
}

/// A memory that holds states of the air as they are given, one after the other: laws with a memory of their own rest.
pub fn holding(topology: &Topology, states: &[f64]) -> Vec<f64> {
    let mut memory = topology.at_rest(&[]);
    let mut rest = states.iter();
    for i in 0..topology.tables.sections.len() {
        let places = topology.section_memory(i);
        for place in places.clone().take(places.len().saturating_sub(1)) {
            memory[place] = rest.next().copied().unwrap_or(0.0);
        }
        if !places.is_empty() {
            memory[places.end - 1] = 0.0;
        }
    }
    memory
}

/// E by the tree coordinates, A, and the rates of the states.
fn effect(setting: &Setting<'_>, resting: &Resting) -> (DMatrix<f64>, DMatrix<f64>, Vec<f64>) {
    let system = setting.system;
    let topology = &*system.topology;
    let m: usize = resting.iter().map(|(_, z)| z.len()).sum();
    let (mut effect, mut own) = (DMatrix::zeros(system.n_tree(), m), DMatrix::zeros(m, m));
    let geometry: Geometry<Dual64> = system.geometry.map(Dual64::from_re);
    let lift = |v: &[f64]| v.iter().map(|v| Dual64::from_re(*v)).collect::<Vec<_>>();
    let (x, q, rate) = (lift(&system.x), lift(&setting.state.q), setting.rate::<Dual64>());
    let placement = place(topology, &geometry, &q, rate.as_deref());
    let held: Vec<f64> = resting.iter().flat_map(|(_, z)| z.clone()).collect();
    let mut memory = lift(&holding(topology, &held));
    let (mut column, mut rates) = (0, Vec::new());
    for (i, z) in resting {
        let first = column;
        let start = topology.section_memory(*i).start;
        for k in 0..z.len() {
            memory[start + k].eps = 1.0;
            let numbers = Numbers { x: &x, memory: &memory, t: 0.0 };
            let flow = Here::new(topology, &geometry, &placement, numbers, *i).flow();
            for (row, r) in flow.rates[..z.len()].iter().enumerate() {
                own[(first + row, column)] = r.eps;
            }
            rates.push(flow.rates[k].re);
            let scene = Scene {
                topology,
                geometry: &geometry,
                x: &x,
                memory: &memory,
                placement: &placement,
                rate: rate.as_deref(),
                acceleration: None,
                t: 0.0,
                effects: setting.effects,
            };
            let force: DVector<Dual64> = scene.residual(None);
            effect.set_column(column, &force.map(|v| -v.eps));
            memory[start + k].eps = 0.0;
            column += 1;
        }
    }
    (effect, own, rates)
}
