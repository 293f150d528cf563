// SPDX-License-Identifier: MIT OR Apache-2.0
//! Elementwise operators of ONNX: a table with the expression of each.

use crate::graph::{Binary, Expr, Graph, Rewrites, Unary};
use crate::sink::of_library;

/// Builds an operator's expression from one element of each operand and the parameters.
type Meaning = for<'g> fn(&[Expr<'g>], &[f64]) -> Expr<'g>;

/// Row of the table: an elementwise operator.
pub struct Function {
    /// Operator name in ONNX.
    pub name: &'static str,
    /// Minimum and maximum number of operands.
    pub operands: (usize, usize),
    /// Numeric attributes with their default values.
    pub parameters: &'static [(&'static str, f64)],
    /// Largest measured distance between a program and onnxruntime, in ulps of the larger of the result and 1, for inputs within
    /// [`Function::range`].
    pub error: f64,
    /// Inputs for which the error was measured.
    pub range: (f64, f64),
    pub(super) meaning: Meaning,
}

impl std::fmt::Debug for Function {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.name)
    }
}

/// Rewrites within a policy's expressions, which keep every rounding.
pub(super) const REWRITES: Rewrites = Rewrites { signs: false, ..Rewrites::EXACT };

impl Function {
    /// Plain arithmetic, which a summary leaves out.
    pub(super) fn is_arithmetic(&self) -> bool {
        matches!(
            self.name,
            "Add" | "Sub" | "Mul" | "Div" | "Sum" | "Neg" | "Pow" | "Sqrt" | "Reciprocal" | "Mean"
        )
    }

    /// The operator needs a macro of `<math.s>`.
    pub(super) fn is_long(&self, parameters: &[f64]) -> bool {
        let graph = Graph::new(REWRITES);
        let operands: Vec<Expr<'_>> = (0..self.operands.0.max(1)).map(|index| graph.input(index)).collect();
        (self.meaning)(&operands, parameters);
        (0..graph.len()).any(|index| of_library(graph.node_at(index)))
    }
}

fn number<'g>(like: Expr<'g>, value: f64) -> Expr<'g> {
    like.graph().constant(value)
}

/// A condition as a number: 1 or 0.
fn truth(condition: Expr<'_>) -> Expr<'_> {
    condition.select(number(condition, 1.0), number(condition, 0.0))
}

/// The condition that a number differs from 0.
fn holds(a: Expr<'_>) -> Expr<'_> {
    a.binary(Binary::NotEqual, number(a, 0.0))
}

/// x, or alpha·(eˣ - 1) below 0.
fn elu(x: Expr<'_>, alpha: f64) -> Expr<'_> {
    let zero = number(x, 0.0);
    x.max(zero) + number(x, alpha) * (x.min(zero).exp() - number(x, 1.0))
}

/// ln(1 + eˣ), in a form that never overflows.
fn softplus(x: Expr<'_>) -> Expr<'_> {
    x.max(number(x, 0.0)) + (-x.abs()).exp().unary(Unary::Log1p)
}

fn folded<'g>(x: &[Expr<'g>], f: fn(Expr<'g>, Expr<'g>) -> Expr<'g>) -> Expr<'g> {
    x[1..].iter().fold(x[0], |a, b| f(a, *b))
}

/// A power; exponents 1 to 4 become products, 1/2 a square root.
fn power<'g>(x: Expr<'g>, exponent: Expr<'g>) -> Expr<'g> {
    match exponent.value() {
        Some(0.5) => x.sqrt(),
        Some(1.0) => x,
        Some(2.0) => x * x,
        Some(3.0) => x * x * x,
        Some(4.0) => (x * x) * (x * x),
        _ => x.binary(Binary::Pow, exponent),
    }
}

const fn one(name: &'static str, error: f64, meaning: Meaning) -> Function {
    Function { name, operands: (1, 1), parameters: &[], error, range: (-20.0, 20.0), meaning }
}

const fn two(name: &'static str, error: f64, meaning: Meaning) -> Function {
    Function { operands: (2, 2), ..one(name, error, meaning) }
}

const fn many(name: &'static str, error: f64, meaning: Meaning) -> Function {
    Function { operands: (1, 8), ..one(name, error, meaning) }
}

/// Least and greatest finite binary32 numbers: a `Clip` without bounds.
const LEAST: f64 = f32::MIN as f64;
const GREATEST: f64 = f32::MAX as f64;

/// Table of all elementwise operators that are read.
pub const FUNCTIONS: &[Function] = &[
    two("Add", 0.0, |x, _| x[0] + x[1]),
    two("Sub", 0.0, |x, _| x[0] - x[1]),
    two("Mul", 0.0, |x, _| x[0] * x[1]),
    two("Div", 0.0, |x, _| x[0] / x[1]),
    Function { range: (0.125, 20.0), ..two("Pow", 1.0, |x, _| power(x[0], x[1])) },
    many("Sum", 0.0, |x, _| folded(x, |a, b| a + b)),
    many("Mean", 0.0, |x, _| folded(x, |a, b| a + b) / number(x[0], x.len() as f64)),
    many("Min", 0.0, |x, _| folded(x, Expr::min)),
    many("Max", 0.0, |x, _| folded(x, Expr::max)),
    one("Neg", 0.0, |x, _| -x[0]),
    one("Abs", 0.0, |x, _| x[0].abs()),
    one("Sign", 0.0, |x, _| x[0].unary(Unary::Sign)),
    one("Floor", 0.0, |x, _| x[0].unary(Unary::Floor)),
    one("Ceil", 0.0, |x, _| x[0].unary(Unary::Ceil)),
    Function { range: (0.125, 20.0), ..one("Reciprocal", 0.0, |x, _| x[0].inverse()) },
    Function { range: (0.0, 20.0), ..one("Sqrt", 0.0, |x, _| x[0].sqrt()) },
    Function { range: (-20.0, 3.0), ..one("Exp", 1.0, |x, _| x[0].exp()) },
    Function { range: (0.125, 20.0), ..one("Log", 1.0, |x, _| x[0].log()) },
    one("Sin", 1.0, |x, _| x[0].sin()),
    one("Cos", 1.0, |x, _| x[0].cos()),
    Function { range: (-1.5, 1.5), ..one("Tan", 1.0, |x, _| x[0].unary(Unary::Tan)) },
    Function { range: (-1.0, 1.0), ..one("Asin", 2.0, |x, _| x[0].unary(Unary::Asin)) },
    Function { range: (-1.0, 1.0), ..one("Acos", 3.0, |x, _| x[0].unary(Unary::Acos)) },
    one("Atan", 2.0, |x, _| x[0].unary(Unary::Atan)),
    Function { range: (-5.0, 5.0), ..one("Sinh", 2.0, |x, _| x[0].sinh()) },
    Function { range: (-5.0, 5.0), ..one("Cosh", 2.0, |x, _| x[0].cosh()) },
    one("Asinh", 1.0, |x, _| x[0].asinh()),
    Function { range: (1.0, 20.0), ..one("Acosh", 1.0, |x, _| x[0].acosh()) },
    Function { range: (-0.99, 0.99), ..one("Atanh", 1.0, |x, _| x[0].atanh()) },
    one("Erf", 2.0, |x, _| x[0].unary(Unary::Erf)),
    one("Relu", 0.0, |x, _| x[0].max(number(x[0], 0.0))),
    Function {
        parameters: &[("alpha", 0.01)],
        ..one("LeakyRelu", 1.0, |x, p| {
            x[0].max(number(x[0], 0.0)) + number(x[0], p[0]) * x[0].min(number(x[0], 0.0))
        })
    },
    two("PRelu", 1.0, |x, _| x[0].max(number(x[0], 0.0)) + x[1] * x[0].min(number(x[0], 0.0))),
    Function {
        parameters: &[("alpha", 1.0)],
        ..one("ThresholdedRelu", 0.0, |x, p| {
            number(x[0], p[0]).binary(Binary::Less, x[0]).select(x[0], number(x[0], 0.0))
        })
    },
    one("Tanh", 3.0, |x, _| x[0].tanh()),
    one("Sigmoid", 2.0, |x, _| x[0].unary(Unary::Sigmoid)),
    Function {
        parameters: &[("alpha", 0.2), ("beta", 0.5)],
        ..one("HardSigmoid", 1.0, |x, p| {
            let line = number(x[0], p[0]) * x[0] + number(x[0], p[1]);
            line.max(number(x[0], 0.0)).min(number(x[0], 1.0))
        })
    },
    one("HardSwish", 1.0, |x, _| {
        let line = number(x[0], 1.0 / 6.0) * x[0] + number(x[0], 0.5);
        x[0] * line.max(number(x[0], 0.0)).min(number(x[0], 1.0))
    }),
    Function {
        parameters: &[("alpha", 1.0)],
        ..one("Swish", 16.0, |x, p| x[0] * (number(x[0], p[0]) * x[0]).unary(Unary::Sigmoid))
    },
    Function { parameters: &[("alpha", 1.0)], ..one("Elu", 1.0, |x, p| elu(x[0], p[0])) },
    Function {
        parameters: &[("alpha", 1.673_263_192_176_818_8), ("gamma", 1.050_701_022_148_132_3)],
        ..one("Selu", 1.0, |x, p| number(x[0], p[1]) * elu(x[0], p[0]))
    },
    Function {
        parameters: &[("alpha", 1.0)],
        ..one("Celu", 1.0, |x, p| {
            let (zero, alpha) = (number(x[0], 0.0), number(x[0], p[0]));
            x[0].max(zero) + alpha * ((x[0].min(zero) / alpha).exp() - number(x[0], 1.0))
        })
    },
    one("Softplus", 1.0, |x, _| softplus(x[0])),
    one("Softsign", 1.0, |x, _| x[0] / (1.0 + x[0].abs())),
    // With e = eˣ, tanh(ln(1 + e)) is (e² + 2e)/(e² + 2e + 2), and 1 beyond 20.
    one("Mish", 4.0, |x, _| {
        let e = x[0].min(number(x[0], 20.0)).exp();
        let n = e * (e + number(e, 2.0));
        x[0] * (n / (n + number(n, 2.0)))
    }),
    one("Gelu", 8.0, |x, _| {
        let half = 0.5 * x[0];
        half + half * (std::f64::consts::FRAC_1_SQRT_2 * x[0]).unary(Unary::Erf)
    }),
    // `Gelu` with the attribute `approximate`.
    one("Gelu tanh", 6.0, |x, _| {
        let inner =
            x[0] * (number(x[0], 0.797_884_560_802_865_4) + (0.035_677_408_136_300_125 * x[0]) * x[0]);
        let half = 0.5 * x[0];
        half + half * inner.tanh()
    }),
    Function {
        operands: (1, 3),
        ..one("Clip", 0.0, |x, _| {
            let low = x.get(1).copied().unwrap_or(number(x[0], LEAST));
            let high = x.get(2).copied().unwrap_or(number(x[0], GREATEST));
            x[0].max(low).min(high)
        })
    },
    two("Less", 0.0, |x, _| truth(x[0].binary(Binary::Less, x[1]))),
    two("LessOrEqual", 0.0, |x, _| truth(x[0].binary(Binary::LessEqual, x[1]))),
    two("Greater", 0.0, |x, _| truth(x[1].binary(Binary::Less, x[0]))),
    two("GreaterOrEqual", 0.0, |x, _| truth(x[1].binary(Binary::LessEqual, x[0]))),
    two("Equal", 0.0, |x, _| truth(x[0].binary(Binary::Equal, x[1]))),
    one("Not", 0.0, |x, _| holds(x[0]).select(number(x[0], 0.0), number(x[0], 1.0))),
    two("And", 0.0, |x, _| holds(x[0]).select(truth(holds(x[1])), number(x[0], 0.0))),
    two("Or", 0.0, |x, _| holds(x[0]).select(number(x[0], 1.0), truth(holds(x[1])))),
    Function { operands: (3, 3), ..one("Where", 0.0, |x, _| holds(x[0]).select(x[1], x[2])) },
];

/// Finds an operator by name.
pub(super) fn find(name: &str) -> Option<&'static Function> {
    FUNCTIONS.iter().find(|function| function.name == name)
}
