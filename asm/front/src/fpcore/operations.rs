// SPDX-License-Identifier: MIT OR Apache-2.0
//! Names of FPCore: operations, constants, and the parts of a file as the table of docs/readers.md has them.

use crate::expressions::{self, Operation};
use crate::graph::{Binary, Expr, Unary};
use std::f64::consts;
use takt_text::readers::{Row, Treatment};

/// Translation of a file's parts.
pub const TABLE: &[Row] = &[
    Row {
        of: "FPCore",
        parts: ":name :description",
        fate: Treatment::Computes,
        text: "the program's title and a comment",
    },
    Row {
        of: "FPCore",
        parts: ":pre",
        fate: Treatment::Computes,
        text: "`.range` of an argument, where a conjunct bounds it by numbers; `.assume` of another comparison by `<`, `<=`, `>` or `>=`; other \
               conjuncts are named in one note",
    },
    Row {
        of: "FPCore",
        parts: ":precision",
        fate: Treatment::Computes,
        text: "`binary32`; `binary64`, the default, and `real` with a note: computed in binary32. Other precisions are refused by name",
    },
    Row {
        of: "FPCore",
        parts: ":round",
        fate: Treatment::Computes,
        text: "`nearestEven`; other directions are refused by name",
    },
    Row {
        of: "FPCore",
        parts: ":cite :fpbench-domain :spec :alt :example :math-library",
        fate: Treatment::PassesOver,
        text: "in one note, with all other properties",
    },
    Row {
        of: "",
        parts: "let let* if cast ! digits",
        fate: Treatment::Computes,
        text: "`if` is a choice: both sides are computed. `!` may change precision and rounding to those above",
    },
    Row {
        of: "",
        parts: "< > <= >= == != and or not TRUE FALSE",
        fate: Treatment::Computes,
        text: "as conditions of `if`, with any number of operands",
    },
    Row {
        of: "",
        parts: "+ - * / fabs fma sqrt cbrt hypot pow exp exp2 expm1 log log2 log10 log1p sin cos tan asin acos atan atan2 sinh cosh tanh asinh \
                acosh atanh erf erfc ceil floor trunc round fmod fmin fmax fdim copysign",
        fate: Treatment::Computes,
        text: "as the table of [expressions](#expressions-of-sympy-and-casadi) says; `fma` is rounded twice, with a note",
    },
    Row {
        of: "",
        parts: "E LOG2E LOG10E LN2 LN10 PI PI_2 PI_4 M_1_PI M_2_PI M_2_SQRTPI SQRT2 SQRT1_2",
        fate: Treatment::Computes,
        text: "constants",
    },
    Row {
        of: "",
        parts: "while while*",
        fate: Treatment::Computes,
        text: "written out, where the condition depends on constants only; otherwise refused by name",
    },
    Row {
        of: "",
        parts: "for for* tensor tensor* array ref dim size",
        fate: Treatment::Refuses,
        text: "loops over indices and tensors",
    },
    Row {
        of: "",
        parts: "remainder nearbyint tgamma lgamma isfinite isinf isnan isnormal signbit INFINITY NAN",
        fate: Treatment::Refuses,
        text: "each with its mend",
    },
];

/// Value of a constant by name.
pub(super) fn constant(name: &str) -> Option<f64> {
    Some(match name {
        "E" => consts::E,
        "LOG2E" => consts::LOG2_E,
        "LOG10E" => consts::LOG10_E,
        "LN2" => consts::LN_2,
        "LN10" => consts::LN_10,
        "PI" => consts::PI,
        "PI_2" => consts::FRAC_PI_2,
        "PI_4" => consts::FRAC_PI_4,
        "M_1_PI" => consts::FRAC_1_PI,
        "M_2_PI" => consts::FRAC_2_PI,
        "M_2_SQRTPI" => consts::FRAC_2_SQRT_PI,
        "SQRT2" => consts::SQRT_2,
        "SQRT1_2" => consts::FRAC_1_SQRT_2,
        _ => return None,
    })
}

/// Operations by the names that FPCore gives them, where the table of expressions has another.
const RENAMED: [(&str, &str); 4] = [("+", "add"), ("-", "sub"), ("*", "mul"), ("/", "div")];
/// Operations of the table of expressions that FPCore has under the same name.
const SAME: &[&str] = &[
    "fabs", "fma", "sqrt", "cbrt", "hypot", "pow", "exp", "exp2", "expm1", "log", "log2", "log10", "log1p",
    "sin", "cos", "tan", "asin", "acos", "atan", "atan2", "sinh", "cosh", "tanh", "asinh", "acosh", "atanh",
    "erf", "erfc", "ceil", "floor", "fmod", "fmin", "fmax", "copysign",
];

/// Row of an operation in the table of expressions.
pub(super) fn operation(name: &str) -> Option<&'static Operation> {
    let renamed = RENAMED.iter().find(|(own, _)| *own == name).map(|(_, theirs)| *theirs);
    let name = renamed.or_else(|| SAME.iter().find(|same| **same == name).copied())?;
    expressions::OPERATIONS.iter().find(|row| row.names.contains(&name))
}

/// Result of an operation that the table of expressions does not have.
pub(super) fn own<'g>(name: &str, x: &[Expr<'g>]) -> Option<Expr<'g>> {
    let number = |like: Expr<'g>, value: f64| like.graph().constant(value);
    let whole = |x: Expr<'g>| {
        let negative = x.binary(Binary::Less, number(x, 0.0));
        negative.select(x.unary(Unary::Ceil), x.unary(Unary::Floor))
    };
    Some(match (name, x) {
        ("-", [x]) => -*x,
        ("fdim", [x, y]) => (*x - *y).max(number(*x, 0.0)),
        ("trunc", [x]) => whole(*x),
        ("round", [x]) => {
            // x - trunc x is exact; halves go away from zero.
            let (whole, half) = (whole(*x), number(*x, 0.5));
            let away = half.binary(Binary::LessEqual, (*x - whole).abs());
            whole + away.select(number(*x, 1.0).copysign(*x), number(*x, 0.0))
        }
        _ => return None,
    })
}

/// Names that are refused, each with its mend.
pub(super) const REFUSED: &[(&str, &str)] = &[
    ("for", "write its iterations out with `let*`"),
    ("for*", "write its iterations out with `let*`"),
    ("tensor", "give each element a name"),
    ("tensor*", "give each element a name"),
    ("array", "give each element a name"),
    ("ref", "give each element a name"),
    ("dim", "give each element a name"),
    ("size", "give each element a name"),
    ("remainder", "its quotient is rounded to nearest; fmod has a meaning, or x - y*floor(x/y + 1/2)"),
    ("nearbyint", "`round` has a meaning, whose halves go away from zero"),
    ("tgamma", "it has no macro; a polynomial over the range that is used can take its place"),
    ("lgamma", "it has no macro; a polynomial over the range that is used can take its place"),
    ("isfinite", "the machine's flags say whether a result was not finite; compare with a largest number"),
    ("isinf", "the machine's flags say whether a result was not finite; compare with a largest number"),
    ("isnan", "the machine's flags say whether a result was no number; check the operands"),
    ("isnormal", "compare the magnitude with the least normal number"),
    ("signbit", "`(< x 0)` has a meaning; a negative zero counts as zero"),
    ("INFINITY", "a largest number, such as 3e38, can take its place"),
    ("NAN", "a number outside of the range can mark what is missing"),
];
