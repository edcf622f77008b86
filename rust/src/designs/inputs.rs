//! From a row of values to the numbers of a model, with their directions.
use crate::expressions::Program;
use crate::tolerances::coordinates::SAME_POINT;

/// What a column of the designs sets, or a derivative is taken by.
#[derive(Debug, Clone)]
pub enum Place {
    /// an entry of the flat vector V of all parameters
    Parameter(usize),
    /// numbers of x that are one
    Numbers(Vec<usize>),
}

/// A value that surely is possible. Where a rule fails the caller decides.
#[derive(Debug, Clone, Copy)]
pub enum Rule {
    Positive(usize),
    NotNegative(usize),
    /// some of n numbers
    NotZero(usize, usize),
    /// xx, yy, zz, xy, xz, yz of a body: principal moments that a body can have
    Inertia(usize),
    /// the two points of a line, three numbers each
    Apart(usize, usize),
}

impl Rule {
    fn holds(self, x: &[f64]) -> bool {
        match self {
            Rule::Positive(i) => x[i] > 0.0,
            Rule::NotNegative(i) => x[i] >= 0.0,
            Rule::NotZero(i, n) => x[i..i + n].iter().any(|v| *v != 0.0),
            Rule::Inertia(i) => {
                let [xx, yy, zz, xy, xz, yz] = [0, 1, 2, 3, 4, 5].map(|k| x[i + k]);
                let tensor = nalgebra::Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz);
                let mut moments: Vec<f64> = tensor.symmetric_eigenvalues().iter().copied().collect();
                moments.sort_by(f64::total_cmp);
                moments[0] >= 0.0 && moments[2] <= moments[0] + moments[1]
            }
            Rule::Apart(a, b) => {
                let norm = |at: &dyn Fn(usize) -> f64| (0..3).map(|k| at(k).powi(2)).sum::<f64>().sqrt();
                let size = norm(&|k| x[a + k]).max(norm(&|k| x[b + k]));
                // `SAME_POINT` also counts in sizes of the model, which are not known here
                norm(&|k| x[b + k] - x[a + k]) > SAME_POINT.sqrt() * size
            }
        }
    }
}

/// How a row of values becomes the numbers of a model.
#[derive(Debug, Clone)]
pub struct Inputs {
    /// V as the model has it
    pub parameters: Vec<f64>,
    pub columns: Vec<Place>,
    pub program: Program,
    /// places of x that nodes of the program drive
    pub driven: Vec<(usize, usize)>,
    pub rules: Vec<Rule>,
}

impl Inputs {
    /// V, all nodes of the program, and x; None where a value is out of its range.
    pub(super) fn numbers(&self, x: &[f64], row: &[f64]) -> Option<(Vec<f64>, Vec<f64>)> {
        let (mut v, mut x) = (self.parameters.clone(), x.to_vec());
        for (place, value) in self.columns.iter().zip(row) {
            match place {
                Place::Parameter(i) => v[*i] = *value,
                Place::Numbers(all) => all.iter().for_each(|i| x[*i] = *value),
            }
        }
        let nodes = self.program.values(&v);
        for (slot, node) in &self.driven {
            x[*slot] = nodes[*node];
        }
        let finite = row.iter().chain(&nodes).all(|v| v.is_finite());
        (finite && self.rules.iter().all(|rule| rule.holds(&x))).then_some((nodes, x))
    }

    /// dx/dp for each place; None at a kink.
    pub(super) fn directions(&self, nodes: &[f64], by: &[Place]) -> Option<Vec<Vec<(usize, f64)>>> {
        let mut all: Vec<Vec<(usize, f64)>> = Vec::with_capacity(by.len());
        let wanted = by.iter().any(|place| matches!(place, Place::Parameter(_)));
        let slopes = |(slot, node): &(usize, usize)| Some((*slot, self.program.gradient(*node, nodes).ok()?));
        let slopes: Vec<(usize, Vec<(usize, f64)>)> =
            if wanted { self.driven.iter().map(slopes).collect::<Option<_>>()? } else { Vec::new() };
        for place in by {
            all.push(match place {
                Place::Numbers(slots) => slots.iter().map(|i| (*i, 1.0)).collect(),
                Place::Parameter(k) => {
                    let along = |(slot, own): &(usize, Vec<(usize, f64)>)| {
                        own.iter().find(|(input, _)| input == k).map(|(_, slope)| (*slot, *slope))
                    };
                    slopes.iter().filter_map(along).collect()
                }
            });
        }
        Some(all)
    }
}
