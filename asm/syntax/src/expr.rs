// SPDX-License-Identifier: MIT OR Apache-2.0
//! The expression language: values, operators, functions, and evaluation.
//!
//! An expression is stored in postfix order: evaluation is a loop over its nodes with a stack of values, so neither the
//! length nor the nesting of an expression can exhaust the thread's stack, and evaluation is linear.
//!
//! Values are 64-bit integers while all operands are integers and the operation has an integer result, else binary64. The
//! elementary functions come from the `libm` crate, not from the host: an image is the same wherever it is assembled.

use crate::ast::{ExprId, Node, NodeKind, Operator};
use crate::name::NameRef;
use smallvec::SmallVec;
use takt_diagnostics::source::Span;
use takt_isa::Type;

/// The value of an expression.
#[derive(Clone, Copy, PartialEq, Debug, serde::Serialize)]
#[serde(untagged)]
pub enum Value {
    /// An integer of 64 bits.
    Int(i64),
    /// A real number in binary64.
    Real(f64),
}

/// Writes the fewest digits that read back exactly, as binary32 where it holds the value.
impl std::fmt::Display for Value {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match *self {
            Value::Int(value) => write!(f, "{value}"),
            Value::Real(value) if f64::from(value as f32).to_bits() == value.to_bits() => {
                write!(f, "{:?}", value as f32)
            }
            Value::Real(value) => write!(f, "{value:?}"),
        }
    }
}

/// Constants that every program knows unless it declares the name itself.
pub const BUILTINS: [(&str, Value); 5] = [
    ("pi", Value::Real(std::f64::consts::PI)),
    ("PI", Value::Real(std::f64::consts::PI)),
    ("e", Value::Real(std::f64::consts::E)),
    ("inf", Value::Real(f64::INFINITY)),
    ("nan", Value::Real(f64::NAN)),
];

macro_rules! functions {
    ($($variant:ident $name:literal $arguments:literal $text:literal;)*) => {
        /// A function of the expression language.
        #[derive(Clone, Copy, PartialEq, Eq, Debug)]
        pub enum Function {
            $(#[doc = $text] $variant,)*
        }

        impl Function {
            /// All functions, in the order of the table.
            pub const ALL: &[Function] = &[$(Function::$variant),*];

            /// Name of the function.
            pub const fn name(self) -> &'static str {
                match self { $(Function::$variant => $name,)* }
            }

            /// Number of arguments; 0 stands for one or more.
            pub const fn arguments(self) -> usize {
                match self { $(Function::$variant => $arguments,)* }
            }

            /// Description of the result.
            pub const fn text(self) -> &'static str {
                match self { $(Function::$variant => $text,)* }
            }
        }
    };
}

functions! {
    Sqrt "sqrt" 1 "Square root.";
    Sin "sin" 1 "Sine of radians.";
    Cos "cos" 1 "Cosine of radians.";
    Tan "tan" 1 "Tangent of radians.";
    Atan2 "atan2" 2 "The angle of the point (x, y), as `atan2(y, x)`.";
    Asin "asin" 1 "Arc sine.";
    Acos "acos" 1 "Arc cosine.";
    Exp "exp" 1 "Power of e.";
    Log "log" 1 "Natural logarithm.";
    Abs "abs" 1 "Absolute value; an integer's is an integer.";
    Min "min" 0 "The least of its arguments; an integer if all are.";
    Max "max" 0 "The greatest of its arguments; an integer if all are.";
    Floor "floor" 1 "The greatest integer that is not above the operand.";
    Ceil "ceil" 1 "The least integer that is not below the operand.";
    Round "round" 1 "The nearest integer, of two equally near the even one, as `ftoi` rounds.";
    Int "int" 1 "The integer part, towards zero.";
    Float "float" 1 "The same value as a real number.";
    Xor "xor" 2 "Exclusive or of two integers.";
    Bits "bits" 1 "The binary32 pattern, as an integer, of the value rounded to binary32.";
}

/// The reason why an expression has no value.
#[derive(Clone, PartialEq, Debug, thiserror::Error)]
pub enum Fault {
    /// A division or remainder by zero.
    #[error("division by zero")]
    DivisionByZero,
    /// An operation without a value, such as the root of a negative number.
    #[error("{0} has no value here: the result is not a number")]
    NotANumber(&'static str),
    /// A result beyond binary64.
    #[error("the result of {0} overflows")]
    Overflow(&'static str),
    /// An integer result beyond 64 bits.
    #[error("the result of {0} does not fit a 64-bit integer")]
    IntegerOverflow(&'static str),
    /// A real number where only integers make sense.
    #[error("{operator} takes integers, and {value} is a real number")]
    NeedsInteger {
        /// Name of the operator or function.
        operator: &'static str,
        /// Operand that is not an integer.
        value: f64,
    },
    /// A shift by less than 0 or more than 63.
    #[error("a shift by {0}: the count is 0 to 63")]
    ShiftCount(i64),
    /// No value has the name.
    #[error("`{0}` is not known")]
    UnknownName(String),
    /// No function has the name.
    #[error("`{0}` is not a function")]
    UnknownFunction(String),
    /// The wrong number of arguments.
    #[error("{name} takes {} argument{}, not {found}", if *.takes == 0 { "at least 1".to_owned() } else { takes.to_string() }, if *.takes == 1 { "" } else { "s" })]
    Arguments {
        /// Name of the function.
        name: &'static str,
        /// Expected number of arguments; 0 stands for one or more.
        takes: usize,
        /// Number of arguments in the call.
        found: usize,
    },
    /// A value beyond binary32.
    #[error("{0:e} overflows binary32: the largest value is 3.4028235e38")]
    FloatRange(f64),
    /// A value beyond 32 bits.
    #[error("{0} does not fit 32 bits: an integer is -2147483648 to 4294967295")]
    IntegerRange(i64),
    /// A real number where an integer is expected.
    #[error("{0} is not an integer")]
    NotInteger(f64),
    /// An element of an array, known only when the program runs.
    #[error("an element of an array has no value before the program runs")]
    Element,
    /// A fault that the implementation of [`Names`] has reported.
    #[error("reported")]
    Reported,
}

/// A [`Fault`] and the part of the expression that has it.
#[derive(Clone, PartialEq, Debug)]
pub struct EvalError {
    /// Source range of the part.
    pub span: Span,
    /// Reason why the part has no value.
    pub fault: Fault,
}

/// The bindings of an expression's names.
pub trait Names {
    /// The value of a name.
    ///
    /// # Errors
    /// [`Fault::Reported`] if the implementation has reported the reason, or another fault, which the caller reports.
    fn value(&mut self, name: NameRef, span: Span) -> Result<Value, EvalError>;
    /// The function of a name.
    ///
    /// # Errors
    /// If no function has the name.
    fn function(&mut self, name: crate::name::NameId, span: Span) -> Result<Function, EvalError>;

    /// Integers are computed as by the machine: [`infix_of_words`].
    fn computes_words(&self) -> bool {
        false
    }
}

/// The value of an expression, given as the nodes of its tree.
///
/// # Errors
/// Returns the first part without a value.
pub fn evaluate(nodes: &[Node], id: ExprId, names: &mut dyn Names) -> Result<Value, EvalError> {
    let nodes = &nodes[id.range()];
    // Most expressions are one literal or one name.
    if let [node] = nodes {
        match node.kind {
            NodeKind::Int(value) => return Ok(Value::Int(value)),
            NodeKind::Real(value) => return Ok(Value::Real(value)),
            NodeKind::Name(name) => return names.value(name, node.span),
            _ => {}
        }
    }
    let mut stack: SmallVec<[Value; 8]> = SmallVec::new();
    for node in nodes {
        let fault = |fault| EvalError { span: node.span, fault };
        // The parser writes complete trees: there is an operand for every operator.
        let mut pop = || stack.pop().unwrap_or(Value::Int(0));
        let value = match node.kind {
            NodeKind::Int(value) => Value::Int(value),
            NodeKind::Real(value) => Value::Real(value),
            NodeKind::Name(name) => names.value(name, node.span)?,
            NodeKind::Prefix(operator) => prefix(operator, pop()).map_err(fault)?,
            NodeKind::Infix(operator) => {
                let b = pop();
                let of = if names.computes_words() { infix_of_words } else { infix };
                of(operator, pop(), b).map_err(fault)?
            }
            NodeKind::Call(name, count) => {
                let function = names.function(name, node.span)?;
                let first = stack.len().saturating_sub(count as usize);
                let value = call(function, &stack[first..]).map_err(fault)?;
                stack.truncate(first);
                value
            }
            NodeKind::Choice => {
                let (b, a) = (pop(), pop());
                if pop().is_zero() { b } else { a }
            }
            NodeKind::Element(_) | NodeKind::All | NodeKind::Range => return Err(fault(Fault::Element)),
        };
        stack.push(value);
    }
    Ok(stack.pop().unwrap_or(Value::Int(0)))
}

/// The first node of the subexpression of each node: the node itself, or the first of its first operand's.
pub fn parts(nodes: &[Node]) -> Vec<u32> {
    let mut parts: Vec<u32> = Vec::with_capacity(nodes.len());
    // The beginnings of the parts that no operator has taken yet.
    let mut open: Vec<u32> = Vec::new();
    for (index, node) in (0..).zip(nodes) {
        let operands = match node.kind {
            NodeKind::Int(_)
            | NodeKind::Real(_)
            | NodeKind::Name(_)
            | NodeKind::Element(_)
            | NodeKind::All => 0,
            NodeKind::Prefix(_) => 1,
            NodeKind::Infix(_) | NodeKind::Range => 2,
            NodeKind::Choice => 3,
            NodeKind::Call(_, count) => count as usize,
        };
        let first = open.len().saturating_sub(operands);
        let start = open.get(first).copied().filter(|_| operands > 0).unwrap_or(index);
        open.truncate(first);
        open.push(start);
        parts.push(start);
    }
    parts
}

/// The operands of a node, in order: first and last node of each. `parts` is the result of [`parts`].
pub fn operands(parts: &[u32], node: u32) -> SmallVec<[(u32, u32); 3]> {
    let (start, mut end) = (parts[node as usize], node);
    let mut operands = SmallVec::new();
    while end > start {
        let first = parts[end as usize - 1];
        operands.push((first, end - 1));
        end = first;
    }
    operands.reverse();
    operands
}

impl Value {
    /// The value in binary64.
    pub fn real(self) -> f64 {
        match self {
            Value::Int(value) => value as f64,
            Value::Real(value) => value,
        }
    }

    /// The value is zero, of either sign.
    pub fn is_zero(self) -> bool {
        match self {
            Value::Int(value) => value == 0,
            Value::Real(value) => value == 0.0,
        }
    }

    /// The number as a literal of a type: a real number for floats, an integer for integers, unchanged for bits.
    ///
    /// # Errors
    /// If the type is an integer and the value is not.
    pub fn of_type(self, ty: Type) -> Result<Value, Fault> {
        Ok(match ty {
            Type::F => Value::Real(self.real()),
            Type::I => Value::Int(self.integer()?),
            Type::B => self,
        })
    }

    /// The value as an integer; a real number without a fraction counts.
    ///
    /// # Errors
    /// If the value is not an integer, or beyond 64 bits.
    pub fn integer(self) -> Result<i64, Fault> {
        match self {
            Value::Int(value) => Ok(value),
            Value::Real(value) => whole(value).ok_or(Fault::NotInteger(value)),
        }
    }

    /// An integer as the low 32 bits of the value, which are signed; a real number as it is.
    pub fn word(self) -> Value {
        match self {
            Value::Int(value) => Value::Int(i64::from(value as i32)),
            Value::Real(_) => self,
        }
    }

    /// The bits of the value in an operand of a type, rounded once.
    ///
    /// # Errors
    /// If the value is out of the type's range.
    pub fn bits(self, ty: Type) -> Result<u32, Fault> {
        match (ty, self) {
            // A 64-bit integer rounds to binary32 in one step, not through binary64.
            (Type::F, Value::Int(value)) => Ok((value as f32).to_bits()),
            (Type::F, Value::Real(value)) | (Type::B, Value::Real(value)) => {
                let rounded = value as f32;
                if value.is_nan() {
                    return Ok(takt_isa::fp::CANONICAL_NAN);
                }
                if rounded.is_infinite() && value.is_finite() {
                    return Err(Fault::FloatRange(value));
                }
                Ok(rounded.to_bits())
            }
            (Type::I, value) => integer_bits(value.integer()?),
            (Type::B, Value::Int(value)) => integer_bits(value),
        }
    }
}

fn integer_bits(value: i64) -> Result<u32, Fault> {
    i32::try_from(value)
        .map(|value| value as u32)
        .or_else(|_| u32::try_from(value))
        .map_err(|_| Fault::IntegerRange(value))
}

/// The integer that equals a real number, if it fits 64 bits.
fn whole(value: f64) -> Option<i64> {
    // 2^63 is the first that does not fit; the comparison is exact.
    (value == libm::trunc(value)
        && (-9_223_372_036_854_775_808.0..9_223_372_036_854_775_808.0).contains(&value))
    .then_some(value as i64)
}

/// Rejects a NaN or an infinity that does not come from an operand.
fn checked(name: &'static str, result: f64, operands: &[f64]) -> Result<Value, Fault> {
    if result.is_nan() && !operands.iter().any(|operand| operand.is_nan()) {
        return Err(Fault::NotANumber(name));
    }
    if result.is_infinite() && operands.iter().all(|operand| operand.is_finite()) {
        return Err(Fault::Overflow(name));
    }
    Ok(Value::Real(result))
}

fn truth(condition: bool) -> Value {
    Value::Int(condition.into())
}

fn only_integer(operator: &'static str, value: Value) -> Result<i64, Fault> {
    value.integer().map_err(|_| Fault::NeedsInteger { operator, value: value.real() })
}

/// The value of an operator before one operand.
pub fn prefix(operator: Operator, a: Value) -> Result<Value, Fault> {
    Ok(match (operator, a) {
        (Operator::Sub, Value::Int(a)) => Value::Int(a.checked_neg().ok_or(Fault::IntegerOverflow("-"))?),
        (Operator::Sub, Value::Real(a)) => Value::Real(-a),
        (Operator::Complement, a) => Value::Int(!only_integer("~", a)?),
        (Operator::Not, a) => truth(a.is_zero()),
        (_, a) => a,
    })
}

/// The value of an operator between two operands.
pub fn infix(operator: Operator, a: Value, b: Value) -> Result<Value, Fault> {
    use Operator::*;
    let name = operator.text();
    let integers = || Ok((only_integer(name, a)?, only_integer(name, b)?));
    let exact = |result: Option<i64>| result.map(Value::Int).ok_or(Fault::IntegerOverflow(name));
    let real = |result: f64| checked(name, result, &[a.real(), b.real()]);
    let compare = |integer: fn(&i64, &i64) -> bool, real: fn(&f64, &f64) -> bool| {
        Ok(truth(match (a, b) {
            (Value::Int(a), Value::Int(b)) => integer(&a, &b),
            _ => real(&a.real(), &b.real()),
        }))
    };
    match (operator, a, b) {
        (Eq, ..) => compare(i64::eq, f64::eq),
        (Ne, ..) => compare(i64::ne, f64::ne),
        (Lt, ..) => compare(i64::lt, f64::lt),
        (Le, ..) => compare(i64::le, f64::le),
        (Gt, ..) => compare(i64::gt, f64::gt),
        (Ge, ..) => compare(i64::ge, f64::ge),
        (Or, ..) => integers().map(|(a, b)| Value::Int(a | b)),
        (And, ..) => integers().map(|(a, b)| Value::Int(a & b)),
        (Shl | Shr, ..) => {
            let (a, count) = integers()?;
            let by = u32::try_from(count).ok().filter(|by| *by < 64).ok_or(Fault::ShiftCount(count))?;
            match operator {
                Shr => Ok(Value::Int(a >> by)),
                _ => exact(Some(a << by).filter(|shifted| shifted >> by == a)),
            }
        }
        (Add, Value::Int(a), Value::Int(b)) => exact(a.checked_add(b)),
        (Sub, Value::Int(a), Value::Int(b)) => exact(a.checked_sub(b)),
        (Mul, Value::Int(a), Value::Int(b)) => exact(a.checked_mul(b)),
        (Add, ..) => real(a.real() + b.real()),
        (Sub, ..) => real(a.real() - b.real()),
        (Mul, ..) => real(a.real() * b.real()),
        (Div | Rem, _, b) if b.is_zero() => Err(Fault::DivisionByZero),
        (Div, Value::Int(a), Value::Int(b)) if a.checked_rem(b) == Some(0) => Ok(Value::Int(a / b)),
        (Div, ..) => real(a.real() / b.real()),
        // The only overflow, i64::MIN % -1, has the remainder 0.
        (Rem, Value::Int(a), Value::Int(b)) => {
            let remainder = a.checked_rem(b).unwrap_or(0);
            Ok(Value::Int(if remainder != 0 && (remainder < 0) != (b < 0) {
                remainder + b
            } else {
                remainder
            }))
        }
        (Rem, ..) => {
            let (a, b) = (a.real(), b.real());
            let remainder = libm::fmod(a, b);
            real(if remainder != 0.0 && (remainder < 0.0) != (b < 0.0) { remainder + b } else { remainder })
        }
        (Power, Value::Int(base), Value::Int(exponent)) if exponent >= 0 => {
            let small = u32::try_from(exponent).ok().and_then(|exponent| base.checked_pow(exponent));
            small.map_or_else(|| real(libm::pow(a.real(), b.real())), |power| Ok(Value::Int(power)))
        }
        (Power, ..) if a.is_zero() && b.real() < 0.0 => Err(Fault::DivisionByZero),
        (Power, ..) => real(libm::pow(a.real(), b.real())),
        (Complement | Not, ..) => Ok(a),
    }
}

/// The value of an infix operator on integers as the machine computes it, with 32 bits: where a result depends on more than the low bits of an
/// operand, and after `<<`. Sums and products keep all their bits until then.
///
/// # Errors
/// The faults of [`infix`].
pub fn infix_of_words(operator: Operator, a: Value, b: Value) -> Result<Value, Fault> {
    use Operator::*;
    match (operator, a, b) {
        (Shl, Value::Int(_), Value::Int(_)) => infix(operator, a.word(), b).map(Value::word),
        (Shr | Div | Rem | And | Or | Eq | Ne | Lt | Le | Gt | Ge, Value::Int(_), Value::Int(_)) => {
            infix(operator, a.word(), b.word())
        }
        _ => infix(operator, a, b),
    }
}

/// The value of a function.
pub fn call(function: Function, arguments: &[Value]) -> Result<Value, Fault> {
    let name = function.name();
    let takes = function.arguments();
    let (Some(&a), true) = (arguments.first(), takes == 0 || takes == arguments.len()) else {
        return Err(Fault::Arguments { name, takes, found: arguments.len() });
    };
    let b = arguments.get(1).copied().unwrap_or(a);
    let real = |f: fn(f64) -> f64| checked(name, f(a.real()), &[a.real()]);
    let whole_of = |f: fn(f64) -> f64| match a {
        Value::Int(_) => Ok(a),
        Value::Real(a) => whole(f(a)).map(Value::Int).ok_or(Fault::IntegerOverflow(name)),
    };
    let pick = |better: fn(f64, f64) -> bool, integer: fn(i64, i64) -> i64| {
        let all = |sum: Option<i64>, value: &Value| match (sum, value) {
            (Some(best), Value::Int(value)) => Some(integer(best, *value)),
            _ => None,
        };
        let first = if let Value::Int(first) = a { Some(first) } else { None };
        if let Some(best) = arguments.iter().fold(first, all) {
            return Ok(Value::Int(best));
        }
        let best = |best: f64, value: &Value| {
            let value = value.real();
            if best.is_nan() || value.is_nan() {
                f64::NAN
            } else if better(value, best) {
                value
            } else {
                best
            }
        };
        Ok(Value::Real(arguments.iter().fold(a.real(), best)))
    };
    match function {
        Function::Sqrt => real(libm::sqrt),
        Function::Sin => real(libm::sin),
        Function::Cos => real(libm::cos),
        Function::Tan => real(libm::tan),
        Function::Atan2 => checked(name, libm::atan2(a.real(), b.real()), &[a.real(), b.real()]),
        Function::Asin => real(libm::asin),
        Function::Acos => real(libm::acos),
        Function::Exp => real(libm::exp),
        Function::Log => real(libm::log),
        Function::Abs => match a {
            Value::Int(a) => a.checked_abs().map(Value::Int).ok_or(Fault::IntegerOverflow(name)),
            Value::Real(a) => Ok(Value::Real(libm::fabs(a))),
        },
        Function::Min => pick(|a, b| a < b, i64::min),
        Function::Max => pick(|a, b| a > b, i64::max),
        Function::Floor => whole_of(libm::floor),
        Function::Ceil => whole_of(libm::ceil),
        Function::Round => whole_of(libm::rint),
        Function::Int => whole_of(libm::trunc),
        Function::Float => Ok(Value::Real(a.real())),
        Function::Xor => Ok(Value::Int(only_integer(name, a)? ^ only_integer(name, b)?)),
        Function::Bits => Ok(Value::Int(a.bits(Type::F)?.into())),
    }
}
