//! Slopes of the elements' forces along a motion: of every force of an element by every one of its displacements and rates.
use super::aft::{Aft, Want};
use super::contact;
use super::element::Direction;
use super::problem::Problem;
use crate::error::Result;

/// The slopes of one force of an element by one of its displacements and its rate.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Pair {
    pub element: usize,
    pub force: usize,
    pub by: usize,
}

/// df/du and df/dv at the samples, for every pair.
pub type Tangents = Vec<(Vec<f64>, Vec<f64>)>;

/// What deviations of the coordinates mean for a tangent: whether they decide about a contact, and by how much df/du and df/dv may
/// change, in the mean over the period.
#[derive(Debug, Clone, Copy)]
pub struct Deviation {
    pub unresolved: bool,
    pub changes: [f64; 2],
}

impl Problem {
    /// The tangents of all elements.
    pub fn pairs(&self) -> Vec<Pair> {
        let of = |(element, directions): (usize, &Vec<Direction>)| {
            let m = directions.len();
            (0..m * m).map(move |at| Pair { element, force: at / m, by: at % m })
        };
        self.retained().iter().enumerate().flat_map(of).collect()
    }

    /// df/du and df/dv of every pair, means over the intervals around the samples of a sampler on the same terms.
    pub fn tangents(&mut self, y: &[f64], sampler: &mut Aft) -> Result<Tangents> {
        let one = |aft: &Aft, pair: Pair, _: &Problem| {
            let (f_u, f_v) = aft.tangents(pair.force, pair.by);
            Ok((f_u.to_vec(), f_v.to_vec()))
        };
        self.of_pairs(y, sampler, Want::Means, one)
    }

    /// Per pair, whether its stiffness jumps so near to an extremum of its displacement that deviations of the coordinates decide,
    /// or only there, and how far they change the tangents: `contact`.
    pub fn deviate(&mut self, y: &[f64], deviations: &[f64], sampler: &mut Aft) -> Result<Vec<Deviation>> {
        let one = |aft: &Aft, pair: Pair, problem: &Problem| {
            let direction = &problem.retained()[pair.element][pair.by];
            let margin: f64 = direction.iter().map(|(i, w)| w.abs() * deviations[*i]).sum();
            let force = &problem.elements[pair.element].force;
            Ok(Deviation {
                unresolved: contact::is_unresolved(force, aft, pair, margin)?,
                changes: contact::changes(force, aft, pair, margin),
            })
        };
        self.of_pairs(y, sampler, Want::Tangents, one)
    }

    /// What `one` says of every pair, whose element `sampler` has evaluated.
    fn of_pairs<T>(
        &mut self,
        y: &[f64],
        sampler: &mut Aft,
        want: Want,
        one: impl Fn(&Aft, Pair, &Problem) -> Result<T>,
    ) -> Result<Vec<T>> {
        std::mem::swap(&mut self.aft, sampler);
        let (mut seen, mut out) = (None, Ok(Vec::new()));
        for pair in self.pairs() {
            let evaluated =
                if seen == Some(pair.element) { Ok(()) } else { self.evaluate_element(pair.element, y, want) };
            seen = Some(pair.element);
            match (evaluated.and_then(|()| one(&self.aft, pair, self)), &mut out) {
                (Ok(made), Ok(all)) => all.push(made),
                (Err(error), _) => {
                    out = Err(error);
                    break;
                }
                (Ok(_), Err(_)) => break,
            }
        }
        std::mem::swap(&mut self.aft, sampler);
        out
    }
}
