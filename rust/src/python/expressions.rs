//! Programs of expressions for Python: values of all nodes, and slopes by the reverse sweep.
use pyo3::prelude::*;
use pyo3::types::PyTuple;

use crate::error::{Error, Result};
use crate::expressions::{Node, Op, Program};

pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(operation, module)?)?;
    module.add_class::<PyProgram>()
}

fn named(name: &str) -> Result<Op> {
    Op::named(name).ok_or_else(|| Error::model(format!("no operation of expressions is called '{name}'")))
}

/// A program from nodes (None, number), (input, label) and (name, places of arguments).
pub fn program(nodes: &Bound<'_, PyAny>, roots: Vec<usize>) -> PyResult<Program> {
    let mut made = Vec::new();
    for node in nodes.try_iter()? {
        let (head, body): (Bound<'_, PyAny>, Bound<'_, PyAny>) = node?.extract()?;
        made.push(if head.is_none() {
            Node::Constant(body.extract()?)
        } else if let Ok(input) = head.extract::<usize>() {
            Node::Input(input)
        } else {
            let op = named(&head.extract::<String>()?)?;
            let args: Vec<usize> = body.extract()?;
            if args.len() != op.arity() {
                let (name, got) = (op.name(), args.len());
                return Err(Error::model(format!("{name} takes {} arguments, got {got}", op.arity())).into());
            }
            Node::Apply(op, [0, 1, 2].map(|k: usize| args[k.min(args.len() - 1)]))
        });
    }
    Ok(Program::new(made, roots)?)
}

/// The value of one operation; nan where it has none.
#[pyfunction]
fn operation(name: &str, values: Vec<f64>) -> PyResult<f64> {
    let op = named(name)?;
    if values.len() != op.arity() {
        return Err(Error::model(format!("{name} takes {} arguments, got {}", op.arity(), values.len())).into());
    }
    Ok(op.value([0, 1, 2].map(|k: usize| values[k.min(values.len() - 1)])))
}

/// The nodes of some expressions, children first.
#[pyclass(frozen, name = "Program")]
pub struct PyProgram(Program);

#[pymethods]
impl PyProgram {
    #[new]
    fn new(nodes: &Bound<'_, PyAny>, roots: Vec<usize>) -> PyResult<Self> {
        Ok(PyProgram(program(nodes, roots)?))
    }

    /// The number of every node at the inputs.
    fn values(&self, inputs: Vec<f64>) -> Vec<f64> {
        self.0.values(&inputs)
    }

    /// d(node)/d(inputs) as ([(input, slope)], None); where it has no derivative ([], the node to blame).
    fn gradient<'py>(&self, py: Python<'py>, node: usize, values: Vec<f64>) -> PyResult<Bound<'py, PyTuple>> {
        if node >= self.0.n_nodes() || values.len() != self.0.n_nodes() {
            return Err(Error::model("a program has no such node").into());
        }
        match self.0.gradient(node, &values) {
            Ok(slopes) => (slopes, None::<usize>).into_pyobject(py),
            Err(node) => (Vec::<(usize, f64)>::new(), Some(node)).into_pyobject(py),
        }
    }

    /// Which inputs the results depend on.
    fn uses(&self) -> Vec<bool> {
        self.0.uses()
    }
}
