//! Programs: expressions of parameters and users' functions as flat lists of operations, children first.
//!
//! One evaluator for all of them, generic over numbers: values, exact first and second derivatives, the lanes and the tape of gradients
//! come from the same text. The slopes of parameters come from the reverse sweep over duals of single operations:
//! A. Griewank, A. Walther, Evaluating Derivatives, 2nd ed., SIAM 2008, section 3.2.
mod op;

use num_dual::Dual;

use op::Branch;
pub use op::Op;

use crate::error::{Error, Result};
use crate::spatial::Real;
use op::constant_power;

/// A number of a program: its arguments come before it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Node {
    Constant(f64),
    /// one of the numbers that the program is given
    Input(usize),
    Apply(Op, [usize; 3]),
    /// a^c of a constant c
    Power(usize, f64),
}

/// A list of nodes, and which of them are wanted.
#[derive(Debug, Clone, PartialEq)]
pub struct Program {
    nodes: Vec<Node>,
    roots: Vec<usize>,
    n_inputs: usize,
}

impl Program {
    /// # Errors
    /// Nodes that do not come after their arguments, and roots that do not exist.
    pub fn new(nodes: Vec<Node>, roots: Vec<usize>) -> Result<Program> {
        let mut n_inputs = 0;
        let mut made = Vec::with_capacity(nodes.len());
        for (i, node) in nodes.into_iter().enumerate() {
            let node = match node {
                Node::Apply(Op::Power, [a, b, _]) => match made.get(b) {
                    Some(Node::Constant(c)) => Node::Power(a, *c),
                    _ => node,
                },
                _ => node,
            };
            let earlier = match node {
                Node::Apply(op, args) => args[..op.arity()].iter().all(|a| *a < i),
                Node::Power(a, _) => a < i,
                Node::Constant(_) => true,
                Node::Input(k) => {
                    n_inputs = n_inputs.max(k + 1);
                    true
                }
            };
            if !earlier {
                return Err(Error::model("a program uses a number before it is computed"));
            }
            made.push(node);
        }
        if roots.iter().any(|r| *r >= made.len()) {
            return Err(Error::model("a program has no such result"));
        }
        Ok(Program { nodes: made, roots, n_inputs })
    }

    pub fn n_inputs(&self) -> usize {
        self.n_inputs
    }

    pub fn n_outputs(&self) -> usize {
        self.roots.len()
    }

    /// The number that a result always is.
    pub fn constant(&self, output: usize) -> Option<f64> {
        match self.roots.get(output).map(|r| self.nodes[*r]) {
            Some(Node::Constant(c)) => Some(c),
            _ => None,
        }
    }

    pub fn n_nodes(&self) -> usize {
        self.nodes.len()
    }

    /// All nodes at the given inputs, into `w`. O(nodes).
    fn fill<T: Real>(&self, inputs: impl Fn(usize) -> T, w: &mut Vec<T>) {
        w.clear();
        w.reserve(self.nodes.len());
        for node in &self.nodes {
            let value = match *node {
                Node::Constant(c) => T::from(c),
                Node::Input(k) => inputs(k),
                Node::Power(a, c) => constant_power(w[a], c),
                Node::Apply(op, [a, b, c]) => match op.arity() {
                    1 => op.value([w[a]; 3]),
                    2 => op.value([w[a], w[b], w[b]]),
                    _ => op.value([w[a], w[b], w[c]]),
                },
            };
            w.push(value);
        }
    }

    /// The results at the given inputs.
    pub fn evaluate<T: Real>(&self, inputs: impl Fn(usize) -> T, out: &mut [T]) {
        let mut w = Vec::new();
        self.fill(inputs, &mut w);
        for (out, root) in out.iter_mut().zip(&self.roots) {
            *out = w[*root];
        }
    }

    /// The values of all nodes.
    pub fn values(&self, inputs: &[f64]) -> Vec<f64> {
        let mut w = Vec::new();
        self.fill(|k| inputs.get(k).copied().unwrap_or(f64::NAN), &mut w);
        w
    }

    /// d(node `root`)/d(inputs) by the reverse sweep, as (input, slope); `w` holds the values of all nodes.
    ///
    /// # Errors
    /// The node without a derivative there.
    pub fn gradient(&self, root: usize, w: &[f64]) -> std::result::Result<Vec<(usize, f64)>, usize> {
        let mut adjoint = vec![None; root + 1];
        if let Some(seed) = adjoint.last_mut() {
            *seed = Some(1.0);
        }
        let mut out: Vec<(usize, f64)> = Vec::new();
        for i in (0..=root).rev() {
            let Some(seed): Option<f64> = adjoint[i] else { continue };
            if let Node::Input(k) = self.nodes[i] {
                match out.iter_mut().find(|(place, _)| *place == k) {
                    Some((_, slope)) => *slope += seed,
                    None => out.push((k, seed)),
                }
            }
            for (a, slope) in self.slopes(i, w)? {
                *adjoint[a].get_or_insert(0.0) += seed * slope;
            }
        }
        Ok(out)
    }

    /// The slopes of a node by those of its arguments that are not constant.
    fn slopes(&self, i: usize, w: &[f64]) -> std::result::Result<Vec<(usize, f64)>, usize> {
        let varies = |a: &usize| !matches!(self.nodes[*a], Node::Constant(_));
        let seeded = |value: f64, yes: bool| Dual::new(value, f64::from(u8::from(yes)));
        let (kink, made): (bool, Vec<(usize, f64)>) = match self.nodes[i] {
            Node::Constant(_) | Node::Input(_) => return Ok(Vec::new()),
            Node::Power(a, c) => {
                let slope = constant_power(seeded(w[a], true), c).eps;
                (Op::Power.has_kink([w[a], c, 0.0]), vec![(a, slope)])
            }
            Node::Apply(op, args) => {
                let n = op.arity();
                let at = |k: usize| w[args[k.min(n - 1)]];
                let along = |k: usize| {
                    let x = [0, 1, 2].map(|j| seeded(at(j), j == k));
                    (args[k], op.value(x).eps)
                };
                let one = |k: usize| varies(&args[k]);
                (op.has_kink([at(0), at(1), at(2)]), (0..n).filter(|k| one(*k)).map(along).collect())
            }
        };
        if !made.is_empty() && (kink || made.iter().any(|(_, slope)| !slope.is_finite())) {
            return Err(i);
        }
        Ok(made)
    }

    /// The switches of its nodes at these values of all nodes, in the order of the nodes.
    pub fn switches(&self, w: &[f64]) -> Vec<f64> {
        let switch = |node: &Node| match node {
            Node::Apply(op, args) => op.switch([0, 1, 2].map(|k: usize| w[args[k.min(op.arity() - 1)]])),
            _ => None,
        };
        self.nodes.iter().filter_map(switch).collect()
    }

    /// The same program on one branch of each switch, smooth across its zero; switches without a side are left as they are.
    pub fn on_branches(&self, above: &[Option<bool>]) -> Program {
        let mut sides = above.iter();
        let held = |node: &Node| {
            let Node::Apply(op, args) = node else { return *node };
            op.switch([0.0; 3]).and_then(|_| op.branch((*sides.next()?)?)).map_or(*node, |branch| match branch {
                Branch::Argument(k) => Node::Power(args[k], 1.0),
                Branch::Negative => Node::Apply(Op::Negative, *args),
                Branch::Constant(c) => Node::Constant(c),
            })
        };
        Program { nodes: self.nodes.iter().map(held).collect(), ..self.clone() }
    }

    /// Which inputs the results depend on, `n_inputs` of them.
    pub fn uses(&self) -> Vec<bool> {
        let (mut used, mut inputs) = (vec![false; self.nodes.len()], vec![false; self.n_inputs]);
        self.roots.iter().for_each(|r| used[*r] = true);
        for i in (0..self.nodes.len()).rev() {
            match self.nodes[i] {
                _ if !used[i] => {}
                Node::Constant(_) => {}
                Node::Input(k) => inputs[k] = true,
                Node::Power(a, _) => used[a] = true,
                Node::Apply(op, args) => args[..op.arity()].iter().for_each(|a| used[*a] = true),
            }
        }
        inputs
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use num_dual::Dual64;

    /// One operation on inputs.
    fn single(op: Op) -> Program {
        let mut nodes: Vec<Node> = (0..op.arity()).map(Node::Input).collect();
        let args = [0, 1, 2].map(|k: usize| k.min(op.arity() - 1));
        nodes.push(Node::Apply(op, args));
        Program::new(nodes, vec![op.arity()]).unwrap()
    }

    fn value<T: Real>(op: Op, x: [T; 3]) -> T {
        let mut out = [T::from(0.0)];
        single(op).evaluate(|k| x[k], &mut out);
        out[0]
    }

    /// First and second slopes along a direction against differences of order four; reverse against forward.
    #[test]
    fn slopes_are_those_of_differences() {
        for op in Op::ALL.iter().copied() {
            for x in [[0.371, 0.613, -0.284], [0.762, 0.229, 0.431]] {
                let x = if op == Op::Arccosh { x.map(|x| x + 1.7) } else { x };
                let d = [0.83, -0.47, 0.29];
                let at = |h: f64| value(op, [0, 1, 2].map(|k| x[k] + h * d[k]));
                let h = 2e-3;
                let [a, b, c, e, f] = [-2.0, -1.0, 0.0, 1.0, 2.0].map(|k| at(k * h));
                let first = (a - 8.0 * b + 8.0 * e - f) / (12.0 * h);
                let second = (-a + 16.0 * b - 30.0 * c + 16.0 * e - f) / (12.0 * h * h);
                let seed = |k: usize| Dual::new(Dual64::new(x[k], d[k]), Dual64::new(d[k], 0.0));
                let found = value(op, [0, 1, 2].map(seed));
                assert!((found.re.eps - first).abs() < 1e-7 * (1.0 + first.abs()), "{op:?} {first} {}", found.re.eps);
                assert!((found.eps.eps - second).abs() < 1e-5 * (1.0 + second.abs()), "{op:?} {second}");
                let program = single(op);
                let w = program.values(&x[..op.arity()]);
                let reverse = program.gradient(op.arity(), &w).unwrap();
                let along: f64 = reverse.iter().map(|(k, s)| s * d[*k]).sum();
                assert!((along - found.re.eps).abs() < 1e-14 * (1.0 + along.abs()), "{op:?}");
            }
        }
    }

    /// Whole and broken powers, also at zero, against the closed forms.
    #[test]
    fn powers_have_their_slopes() {
        for c in [-2.0, -1.0, -0.5, 0.0, 0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 7.0] {
            let nodes = vec![Node::Input(0), Node::Constant(c), Node::Apply(Op::Power, [0, 1, 1])];
            let program = Program::new(nodes, vec![2]).unwrap();
            let x: f64 = 0.317;
            let mut out = [Dual::from_re(Dual64::from(0.0))];
            program.evaluate(|_| Dual::new(Dual64::new(x, 1.0), Dual64::from(1.0)), &mut out);
            let exact = [x.powf(c), c * x.powf(c - 1.0), c * (c - 1.0) * x.powf(c - 2.0)];
            for (found, exact) in [out[0].re.re, out[0].re.eps, out[0].eps.eps].into_iter().zip(exact) {
                assert!((found - exact).abs() < 1e-13 * (1.0 + exact.abs()), "{c} {found} {exact}");
            }
            if c > 1.0 {
                program.evaluate(|_| Dual::new(Dual64::new(0.0, 1.0), Dual64::from(1.0)), &mut out);
                assert!(out[0].re.re == 0.0 && out[0].re.eps == 0.0, "{c}");
            }
        }
    }

    #[test]
    fn large_numbers_and_zeros_are_not_lost() {
        let big = Dual64::new(1e200, 1.0);
        let length = value(Op::Hypot, [big, Dual64::from(1e200), big]);
        assert!(
            (length.re / 2e200_f64.sqrt() / 1e100 - 1.0).abs() < 1e-15 && (length.eps - 0.5_f64.sqrt()).abs() < 1e-15
        );
        assert!(value(Op::Tanh, [Dual64::new(-1e6, 1.0); 3]).re == -1.0);
        let zero = Dual64::new(0.0, 0.0);
        assert!([Op::Hypot, Op::Sqrt, Op::Cbrt].into_iter().all(|op| value(op, [zero; 3]).eps == 0.0));
    }

    #[test]
    fn kinks_and_wrong_programs_are_named() {
        for (op, x) in [(Op::Abs, [0.0; 3]), (Op::Maximum, [2.5; 3]), (Op::Sqrt, [0.0; 3]), (Op::Hypot, [0.0; 3])] {
            let program = single(op);
            assert_eq!(program.gradient(op.arity(), &program.values(&x[..op.arity()])), Err(op.arity()), "{op:?}");
        }
        assert!(Program::new(vec![Node::Apply(Op::Sin, [0, 0, 0])], vec![0]).is_err());
        assert!(Program::new(vec![Node::Constant(1.0)], vec![1]).is_err());
        assert_eq!(single(Op::Where).uses(), vec![true; 3]);
    }
}
