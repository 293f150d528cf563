// SPDX-License-Identifier: MIT OR Apache-2.0
//! Names and expressions of Verilog.

use std::borrow::Cow;
use std::fmt::{self, Write as _};
use std::ops::{BitAnd, BitOr, BitXor, Not};

/// Width of the continuation lines of an expression.
const LINE: usize = 118;

/// Declared name: a port, a wire, a register or a parameter. It prints as its name.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct Net {
    name: Cow<'static, str>,
    /// Highest and lowest bit; `None` for a bit without a range.
    range: Option<(u32, u32)>,
}

impl Net {
    /// Net of a single bit.
    pub const fn bit(name: &'static str) -> Net {
        Net { name: Cow::Borrowed(name), range: None }
    }

    /// Net with bits `width - 1` to 0; at least one bit.
    pub const fn bus(name: &'static str, width: u32) -> Net {
        Net { name: Cow::Borrowed(name), range: Some((width.saturating_sub(1), 0)) }
    }

    /// Net of a single bit, with a computed name.
    pub fn named(name: String) -> Net {
        Net { name: Cow::Owned(name), range: None }
    }

    /// The net with bits `width - 1` to 0.
    pub fn wide(self, width: u32) -> Net {
        self.range(width.saturating_sub(1), 0)
    }

    /// The net with bits `high` to `low`.
    pub fn range(self, high: u32, low: u32) -> Net {
        Net { range: Some((high, low)), ..self }
    }

    /// Name in the module.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Number of bits of the net.
    pub fn width(&self) -> u32 {
        self.range.map_or(1, |(high, low)| high - low + 1)
    }

    /// Text of the range, such as `[7:0] `; empty for a bit without a range.
    pub(super) fn range_text(&self) -> String {
        self.range.map_or_else(String::new, |(high, low)| format!("[{high}:{low}] "))
    }

    fn select(&self, select: Select) -> Expr {
        Expr::Net { net: self.clone(), select: Some(select) }
    }

    /// Bit at an index.
    pub fn at(&self, place: impl Into<Offset>) -> Expr {
        self.select(Select::Bit(place.into()))
    }

    /// Bits `high` to `low`.
    pub fn slice(&self, high: u32, low: u32) -> Expr {
        self.select(Select::Slice(high, low))
    }

    /// The lowest `width` bits.
    pub fn low(&self, width: u32) -> Expr {
        self.slice(width.saturating_sub(1), 0)
    }

    /// Bits from an index upwards, `width` of them.
    pub fn part(&self, place: impl Into<Offset>, width: u32) -> Expr {
        self.select(Select::Part(place.into(), width))
    }
}

impl fmt::Display for Net {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.name)
    }
}

/// Index of a bit in a net.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Offset {
    /// Index that is known when generating.
    Number(u32),
    /// Multiple of a parameter or of a loop variable: factor, then net.
    Multiple(u32, Net),
}

impl From<u32> for Offset {
    fn from(number: u32) -> Offset {
        Offset::Number(number)
    }
}

impl From<Net> for Offset {
    fn from(net: Net) -> Offset {
        Offset::Multiple(1, net)
    }
}

impl fmt::Display for Offset {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Offset::Number(number) => write!(f, "{number}"),
            Offset::Multiple(1, net) => write!(f, "{net}"),
            Offset::Multiple(factor, net) => write!(f, "{factor}*{net}"),
        }
    }
}

/// Part of a net that an expression uses.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Select {
    /// Single bit at an index.
    Bit(Offset),
    /// Bits from the first index down to the second.
    Slice(u32, u32),
    /// Bits from an index upwards; the second field is their number.
    Part(Offset, u32),
}

/// An expression. Nested operators are always put in parentheses, whatever their precedence.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Expr {
    /// Literal, in Verilog's syntax.
    Literal(String),
    /// Net, or a part of it.
    Net {
        /// Net that is read.
        net: Net,
        /// Selected part; `None` for the whole net.
        select: Option<Select>,
    },
    /// Negation of every bit: `~x`.
    Not(Box<Expr>),
    /// Reduction over all bits: `&x`, `|x`, `^x`.
    Reduce(&'static str, Box<Expr>),
    /// Terms with an associative operator: `x & y & z`; a single term prints alone.
    Chain(&'static str, Vec<Expr>),
    /// Comparison: `x == y`.
    Compare(&'static str, Box<Expr>, Box<Expr>),
    /// Choice: `x ? y : z`.
    Choose(Box<[Expr; 3]>),
    /// Concatenation `{x, y}`, the most significant first; a single term prints alone.
    Concat(Vec<Expr>),
    /// Repetition of a term: `{n{x}}`.
    Repeat(u32, Box<Expr>),
}

/// Literal with its width, in decimal.
pub fn decimal(width: u32, value: impl Into<u64>) -> Expr {
    Expr::Literal(format!("{width}'d{}", value.into()))
}

/// Literal without a width, for parameters.
pub fn number(value: u32) -> Expr {
    Expr::Literal(value.to_string())
}

/// String literal, for parameters.
pub fn string(text: &str) -> Expr {
    Expr::Literal(format!("\"{text}\""))
}

/// Literal in hexadecimal, with leading zeros.
pub fn hexadecimal(width: u32, value: u64) -> Expr {
    Expr::Literal(format!("{width}'h{value:0digits$x}", digits = width.div_ceil(4) as usize))
}

/// Literal of several binary fields, the most significant first, each with its width, separated by underscores.
pub fn binary(fields: &[(u32, u64)]) -> Expr {
    let width: u32 = fields.iter().map(|(width, _)| width).sum();
    let digits: Vec<_> =
        fields.iter().map(|&(width, value)| format!("{value:0width$b}", width = width as usize)).collect();
    Expr::Literal(format!("{width}'b{}", digits.join("_")))
}

/// Literal of a bit that is 0.
pub fn no() -> Expr {
    Expr::Literal("1'b0".to_owned())
}

/// Literal of a bit that is 1.
pub fn yes() -> Expr {
    Expr::Literal("1'b1".to_owned())
}

/// Disjunction of the terms; 0 without terms.
pub fn any<T: Into<Expr>>(terms: impl IntoIterator<Item = T>) -> Expr {
    let terms: Vec<Expr> = terms.into_iter().map(Into::into).collect();
    if terms.is_empty() { no() } else { Expr::Chain("|", terms) }
}

/// Concatenation of the terms, the least significant first.
pub fn concat<T: Into<Expr>>(terms: impl IntoIterator<Item = T, IntoIter: DoubleEndedIterator>) -> Expr {
    Expr::Concat(terms.into_iter().rev().map(Into::into).collect())
}

/// Replication of a term.
pub fn repeat(times: u32, of: impl Into<Expr>) -> Expr {
    Expr::Repeat(times, Box::new(of.into()))
}

/// `value` if the bit `valid` is 1, otherwise 0.
pub fn gated(width: u32, valid: impl Into<Expr>, value: impl Into<Expr>) -> Expr {
    repeat(width, valid) & value
}

/// `yes` if `condition` is 1, otherwise `no`.
pub fn choose(condition: impl Into<Expr>, yes: impl Into<Expr>, no: impl Into<Expr>) -> Expr {
    Expr::Choose(Box::new([condition.into(), yes.into(), no.into()]))
}

impl Expr {
    /// 1 if any bit is 1.
    pub fn any_bit(self) -> Expr {
        Expr::Reduce("|", Box::new(self))
    }

    /// 1 if every bit is 1.
    pub fn every_bit(self) -> Expr {
        Expr::Reduce("&", Box::new(self))
    }

    /// 1 if both expressions are equal.
    pub fn is(self, other: impl Into<Expr>) -> Expr {
        Expr::Compare("==", Box::new(self), Box::new(other.into()))
    }

    /// 1 if the expressions differ.
    pub fn is_not(self, other: impl Into<Expr>) -> Expr {
        Expr::Compare("!=", Box::new(self), Box::new(other.into()))
    }

    fn chain(self, operator: &'static str, other: Expr) -> Expr {
        match self {
            // A chain of one term, as `any` makes it, stays a term of its own.
            Expr::Chain(own, mut terms) if own == operator && terms.len() > 1 => {
                terms.push(other);
                Expr::Chain(own, terms)
            }
            first => Expr::Chain(operator, vec![first, other]),
        }
    }

    /// Calls `see` with every net of the expression.
    pub(super) fn nets<'a>(&'a self, see: &mut dyn FnMut(&'a Net)) {
        match self {
            Expr::Literal(_) => {}
            Expr::Net { net, select } => {
                see(net);
                if let Some(
                    Select::Bit(Offset::Multiple(_, place)) | Select::Part(Offset::Multiple(_, place), _),
                ) = select
                {
                    see(place);
                }
            }
            Expr::Not(of) | Expr::Reduce(_, of) | Expr::Repeat(_, of) => of.nets(see),
            Expr::Chain(_, terms) | Expr::Concat(terms) => terms.iter().for_each(|term| term.nets(see)),
            Expr::Compare(_, left, right) => {
                left.nets(see);
                right.nets(see);
            }
            Expr::Choose(parts) => parts.iter().for_each(|part| part.nets(see)),
        }
    }

    /// Text as an operand of an operator.
    fn nested(&self) -> String {
        match self {
            Expr::Chain(_, terms) if terms.len() == 1 => terms[0].nested(),
            Expr::Reduce(..) | Expr::Chain(..) | Expr::Compare(..) | Expr::Choose(_) => format!("({self})"),
            _ => self.to_string(),
        }
    }

    /// Text of the expression. If it is longer than `room`, it is broken before operators or after commas, with `indent` at the start of
    /// each further line.
    pub(super) fn broken(&self, room: usize, indent: &str) -> String {
        let whole = self.to_string();
        if whole.len() <= room {
            return whole;
        }
        match self {
            Expr::Chain(operator, terms) if terms.len() > 1 => {
                let terms: Vec<_> = terms.iter().map(Expr::nested).collect();
                // Names fill a line; longer terms stand alone.
                let long = terms.iter().any(|term| term.contains(' '));
                let mut text = String::new();
                let mut left = if long { 0 } else { room };
                for (i, term) in terms.iter().enumerate() {
                    let piece = format!("{operator} {term}");
                    let (breaks, piece) = match i {
                        0 => (false, term.as_str()),
                        _ => (left < piece.len() + 1, piece.as_str()),
                    };
                    if breaks {
                        let _ = write!(text, "\n{indent}");
                        left = if long { 0 } else { LINE.saturating_sub(indent.len()) };
                    } else if i > 0 {
                        text.push(' ');
                    }
                    text.push_str(piece);
                    left = left.saturating_sub(piece.len() + 1);
                }
                text
            }
            Expr::Concat(terms) if terms.len() > 1 => {
                let terms: Vec<_> = terms.iter().map(Expr::to_string).collect();
                format!("{{{}}}", terms.join(&format!(",\n{indent}")))
            }
            Expr::Not(of) if matches!(**of, Expr::Chain(..)) => {
                format!("~({})", of.broken(room.saturating_sub(3), indent))
            }
            _ => whole,
        }
    }
}

impl fmt::Display for Expr {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Expr::Literal(text) => f.write_str(text),
            Expr::Net { net, select: None } => write!(f, "{net}"),
            Expr::Net { net, select: Some(Select::Bit(place)) } => write!(f, "{net}[{place}]"),
            Expr::Net { net, select: Some(Select::Slice(high, low)) } => write!(f, "{net}[{high}:{low}]"),
            Expr::Net { net, select: Some(Select::Part(place, width)) } => {
                write!(f, "{net}[{place} +: {width}]")
            }
            Expr::Not(of) => write!(f, "~{}", of.nested()),
            Expr::Reduce(operator, of) => write!(f, "{operator}{}", of.nested()),
            Expr::Chain(operator, terms) => match terms.as_slice() {
                [one] => write!(f, "{one}"),
                _ => {
                    let terms: Vec<_> = terms.iter().map(Expr::nested).collect();
                    f.write_str(&terms.join(&format!(" {operator} ")))
                }
            },
            Expr::Compare(operator, left, right) => {
                write!(f, "{} {operator} {}", left.nested(), right.nested())
            }
            Expr::Choose(parts) => {
                let [condition, yes, no] = parts.each_ref();
                write!(f, "{} ? {} : {}", condition.nested(), yes.nested(), no.nested())
            }
            Expr::Concat(terms) => match terms.as_slice() {
                [one] => write!(f, "{one}"),
                _ => {
                    let terms: Vec<_> = terms.iter().map(Expr::to_string).collect();
                    write!(f, "{{{}}}", terms.join(", "))
                }
            },
            Expr::Repeat(times, of) => write!(f, "{{{times}{{{of}}}}}"),
        }
    }
}

impl From<Net> for Expr {
    fn from(net: Net) -> Expr {
        Expr::Net { net, select: None }
    }
}

impl From<&Net> for Expr {
    fn from(net: &Net) -> Expr {
        net.clone().into()
    }
}

macro_rules! operator {
    ($trait:ident $method:ident $text:literal) => {
        impl<R: Into<Expr>> $trait<R> for Expr {
            type Output = Expr;
            fn $method(self, other: R) -> Expr {
                self.chain($text, other.into())
            }
        }
        impl<R: Into<Expr>> $trait<R> for Net {
            type Output = Expr;
            fn $method(self, other: R) -> Expr {
                Expr::from(self).chain($text, other.into())
            }
        }
    };
}

operator!(BitAnd bitand "&");
operator!(BitOr bitor "|");
operator!(BitXor bitxor "^");

impl Not for Expr {
    type Output = Expr;
    fn not(self) -> Expr {
        Expr::Not(Box::new(self))
    }
}

impl Not for Net {
    type Output = Expr;
    fn not(self) -> Expr {
        !Expr::from(self)
    }
}
