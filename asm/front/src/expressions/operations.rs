// SPDX-License-Identifier: MIT OR Apache-2.0
//! Translation of other tools' operations into the graph's, and the operations refused for a reason.

use super::MAX_POWER;
use crate::graph::{Binary, Expr, Unary};

/// Builds the expression of an operation from its operands.
type Meaning = for<'g> fn(&[Expr<'g>]) -> Expr<'g>;

/// Row of the table: an operation of CasADi or SymPy.
pub struct Operation {
    /// Spellings: CasADi's in small letters, SymPy's, or C's.
    pub names: &'static [&'static str],
    /// Minimum and maximum number of operands.
    pub operands: (usize, usize),
    /// Resulting operations, as the documents print them.
    pub becomes: &'static str,
    /// Comment for the head of the source if the operation is used.
    pub note: Option<&'static str>,
    pub(crate) meaning: Meaning,
}

const fn row(
    names: &'static [&'static str],
    operands: usize,
    becomes: &'static str,
    meaning: Meaning,
) -> Operation {
    Operation { names, operands: (operands, operands), becomes, note: None, meaning }
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

fn compared<'g>(x: &[Expr<'g>], op: Binary) -> Expr<'g> {
    truth(x[0].binary(op, x[1]))
}

/// A power; if the exponent is a constant multiple of 1/2 up to [`MAX_POWER`], as products and a square root.
fn power<'g>(a: Expr<'g>, exponent: Expr<'g>) -> Expr<'g> {
    let Some(power) = exponent.value().filter(|p| p.abs() <= MAX_POWER && (2.0 * p).fract() == 0.0) else {
        return a.binary(Binary::Pow, exponent);
    };
    let size = power.abs();
    let mut result = (size.fract() != 0.0).then(|| a.sqrt());
    let (mut square, mut rest) = (a, size as u32);
    while rest > 0 {
        if rest & 1 == 1 {
            result = Some(result.map_or(square, |result| result * square));
        }
        rest >>= 1;
        if rest > 0 {
            square = square * square;
        }
    }
    let one = number(a, 1.0);
    let result = result.unwrap_or(one);
    if power < 0.0 { one / result } else { result }
}

/// Every operation with a meaning, except `input`, `output` and `const`.
pub const OPERATIONS: &[Operation] = &[
    row(&["add"], 2, "x + y", |x| x[0] + x[1]),
    row(&["sub"], 2, "x - y", |x| x[0] - x[1]),
    row(&["mul"], 2, "x·y", |x| x[0] * x[1]),
    row(&["div"], 2, "x/y", |x| x[0] / x[1]),
    row(&["fma"], 3, "x·y + z", |x| x[0] * x[1] + x[2]),
    row(&["neg"], 1, "-x", |x| -x[0]),
    row(&["sq"], 1, "x·x", |x| x[0] * x[0]),
    row(&["twice"], 1, "2·x", |x| 2.0 * x[0]),
    row(&["inv"], 1, "1/x", |x| x[0].inverse()),
    row(&["assign"], 1, "x", |x| x[0]),
    row(&["lift"], 2, "x", |x| x[0]),
    row(&["re", "conjugate"], 1, "x: every number is real", |x| x[0]),
    row(&["im"], 1, "0: every number is real", |x| number(x[0], 0.0)),
    row(&["sqrt", "Sqrt"], 1, "`fsqrt`", |x| x[0].sqrt()),
    row(&["cbrt", "Cbrt"], 1, "`pow`, with the sign of x", |x| {
        x[0].abs().binary(Binary::Pow, number(x[0], 1.0 / 3.0)).copysign(x[0])
    }),
    row(
        &["pow", "constpow"],
        2,
        "products and a square root, where y is a multiple of 1/2 up to ±64; otherwise `pow`",
        |x| power(x[0], x[1]),
    ),
    row(&["hypot"], 2, "√(x·x + y·y)", |x| (x[0] * x[0] + x[1] * x[1]).sqrt()),
    row(&["sin"], 1, "`fsin`", |x| x[0].sin()),
    row(&["cos"], 1, "`fcos`", |x| x[0].cos()),
    row(&["tan"], 1, "`tan`", |x| x[0].unary(Unary::Tan)),
    row(&["cot"], 1, "`fcos`/`fsin`", |x| x[0].cos() / x[0].sin()),
    row(&["sec"], 1, "1/`fcos`", |x| x[0].cos().inverse()),
    row(&["csc"], 1, "1/`fsin`", |x| x[0].sin().inverse()),
    row(&["sinc"], 1, "`fsin`/x, and 1 where x = 0", |x| x[0].sinc()),
    row(&["asin"], 1, "`asin`", |x| x[0].unary(Unary::Asin)),
    row(&["acos"], 1, "`facos`", |x| x[0].unary(Unary::Acos)),
    row(&["atan"], 1, "`atan`", |x| x[0].unary(Unary::Atan)),
    row(&["acot"], 1, "`atan` of 1/x", |x| x[0].inverse().unary(Unary::Atan)),
    row(&["asec"], 1, "`facos` of 1/x", |x| x[0].inverse().unary(Unary::Acos)),
    row(&["acsc"], 1, "`asin` of 1/x", |x| x[0].inverse().unary(Unary::Asin)),
    row(&["atan2"], 2, "`fatan2`", |x| x[0].binary(Binary::Atan2, x[1])),
    row(&["exp"], 1, "`exp`", |x| x[0].exp()),
    row(&["exp2"], 1, "`pow` of 2", |x| number(x[0], 2.0).binary(Binary::Pow, x[0])),
    row(&["expm1"], 1, "`expm1`", |x| x[0].unary(Unary::Expm1)),
    row(&["log"], 1, "`log`", |x| x[0].log()),
    row(&["log2"], 1, "`log`, times 1/ln 2", |x| std::f64::consts::LOG2_E * x[0].log()),
    row(&["log10"], 1, "`log`, times 1/ln 10", |x| std::f64::consts::LOG10_E * x[0].log()),
    row(&["log1p"], 1, "`log1p`", |x| x[0].unary(Unary::Log1p)),
    row(&["sinh"], 1, "(`expm1` of x - `expm1` of -x)/2", |x| x[0].sinh()),
    row(&["cosh"], 1, "(`exp` of x + `exp` of -x)/2", |x| x[0].cosh()),
    row(&["tanh"], 1, "`tanh`", |x| x[0].tanh()),
    row(&["coth"], 1, "1/`tanh`", |x| x[0].tanh().inverse()),
    row(&["sech"], 1, "1/cosh x", |x| x[0].cosh().inverse()),
    row(&["csch"], 1, "1/sinh x", |x| x[0].sinh().inverse()),
    row(&["asinh"], 1, "`log1p`; up to ±10¹⁹", |x| x[0].asinh()),
    row(&["acosh"], 1, "`log1p`", |x| x[0].acosh()),
    row(&["atanh"], 1, "`log1p`, twice", |x| x[0].atanh()),
    row(&["acoth"], 1, "`log1p`", |x| x[0].acoth()),
    row(&["asech"], 1, "`log1p`", |x| x[0].asech()),
    row(&["acsch"], 1, "asinh 1/x", |x| x[0].inverse().asinh()),
    row(&["sigmoid"], 1, "`sigmoid`, which `1/(1 + exp(-x))` becomes, too, unless `--no-strength`", |x| {
        x[0].unary(Unary::Sigmoid)
    }),
    row(&["erf"], 1, "`erf`", |x| x[0].unary(Unary::Erf)),
    row(&["erfc"], 1, "1 - `erf`, whose small results have an absolute error of 10⁻⁷", |x| {
        1.0 - x[0].unary(Unary::Erf)
    }),
    row(&["fabs", "Abs"], 1, "`fabs`", |x| x[0].abs()),
    row(&["sign"], 1, "-1, 0 or 1", |x| x[0].unary(Unary::Sign)),
    row(&["copysign"], 2, "a choice", |x| x[0].copysign(x[1])),
    row(&["floor"], 1, "`floor`", |x| x[0].unary(Unary::Floor)),
    row(&["ceil"], 1, "`ceil`", |x| x[0].unary(Unary::Ceil)),
    row(&["frac"], 1, "x - `floor` of x", |x| x[0] - x[0].unary(Unary::Floor)),
    row(&["fmod"], 2, "`fmod`", |x| x[0].binary(Binary::Fmod, x[1])),
    row(&["fmin"], 2, "`fmin`", |x| x[0].min(x[1])),
    row(&["fmax"], 2, "`fmax`", |x| x[0].max(x[1])),
    Operation {
        operands: (1, 2),
        ..row(&["Heaviside"], 1, "0 where x < 0, 1 where x > 0, at 0 y or 1/2", |x| {
            x[0].step(x.get(1).copied().unwrap_or(number(x[0], 0.5)))
        })
    },
    Operation {
        operands: (1, 2),
        note: Some("DiracDelta is 0: an impulse has no value at a point"),
        ..row(&["DiracDelta"], 1, "0, with a note", |x| number(x[0], 0.0))
    },
    row(&["lt"], 2, "x < y: a comparison, 1 or 0", |x| compared(x, Binary::Less)),
    row(&["le"], 2, "x ≤ y", |x| compared(x, Binary::LessEqual)),
    row(&["eq"], 2, "x = y", |x| compared(x, Binary::Equal)),
    row(&["ne"], 2, "x ≠ y", |x| compared(x, Binary::NotEqual)),
    row(&["not"], 1, "a choice", |x| holds(x[0]).select(number(x[0], 0.0), number(x[0], 1.0))),
    row(&["and"], 2, "a choice", |x| holds(x[0]).select(truth(holds(x[1])), number(x[0], 0.0))),
    row(&["or"], 2, "a choice", |x| holds(x[0]).select(number(x[0], 1.0), truth(holds(x[1])))),
    row(&["xor"], 2, "a choice", |x| {
        let (second, one) = (holds(x[1]), number(x[0], 1.0));
        holds(x[0]).select(one - truth(second), truth(second))
    }),
    row(&["if_else_zero"], 2, "y where x holds, otherwise 0", |x| {
        holds(x[0]).select(x[1], number(x[0], 0.0))
    }),
    row(&["if_else", "ITE"], 3, "y where x holds, otherwise z", |x| holds(x[0]).select(x[1], x[2])),
];

/// Refused operations, each with a remedy. (Names not listed here are refused without a remedy.)
pub const REFUSED: &[(&str, &str)] = &[
    ("erfinv", "it has no macro; a polynomial over the range that is used can take its place"),
    ("remainder", "its quotient is rounded to nearest; fmod(x, y), or x - y*floor(x/y + 0.5), has a meaning"),
    ("Derivative", "`.doit()` carries it out"),
    ("Integral", "`.doit()` carries it out, or a state of the controller adds it up"),
    ("Subs", "`.doit()` carries it out"),
    ("ImaginaryUnit", "every number is real; take `re` and `im` of the expression apart"),
    ("arg", "of a real number it is a choice: Piecewise((0, x >= 0), (pi, True))"),
    ("gamma", "it has no macro"),
    ("LambertW", "it has no macro"),
];
