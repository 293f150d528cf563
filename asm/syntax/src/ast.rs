// SPDX-License-Identifier: MIT OR Apache-2.0
//! Syntax tree of a source file, before any name is resolved.
//!
//! Everything is kept in a few flat lists that refer to each other by index: a file of a million lines is a handful of
//! allocations, and a statement within a repetition is read again and again without being copied.

use crate::name::{NameId, NameRef};
use std::collections::BTreeSet;
use takt_diagnostics::source::Span;

/// A name and its place.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Name {
    /// Plain name or template, not yet resolved.
    pub name: NameRef,
    /// Source range of the name.
    pub span: Span,
}

/// The machine that a source names.
#[derive(Clone, PartialEq, Debug)]
pub enum MachineName {
    /// A row of the table, by its name.
    Row(Name),
    /// A file, by its path and its place.
    File(String, Span),
}

/// `head{e}middle{e}tail`: the text before each braced expression, the expression, and the tail.
#[derive(Clone, PartialEq, Debug)]
pub struct Template {
    /// Text and expression, in turn.
    pub parts: Vec<(NameId, Vec<Node>)>,
    /// The text after the last expression.
    pub tail: NameId,
}

/// A node of an expression's tree.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Node {
    /// Literal, name, operator, call or index.
    pub kind: NodeKind,
    /// Source range of the subexpression.
    pub span: Span,
}

/// The kind of a node. Operands precede their operator.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum NodeKind {
    /// An integer literal of 64 bits.
    Int(i64),
    /// A real literal in binary64.
    Real(f64),
    /// A name, not yet resolved.
    Name(NameRef),
    /// An operator of one operand, which precedes the node.
    Prefix(Operator),
    /// An operator of two operands, which precede the node.
    Infix(Operator),
    /// A call of a function, by name, with the number of arguments that precede the node.
    Call(NameId, u32),
    /// `c ? a : b` of the three operands that precede the node.
    Choice,
    /// `name[i, j]`: an index into [`Ast::elements`].
    Element(u32),
    /// In an index, `:`: all elements in this direction.
    All,
    /// In an index, `a:b` of the two operands that precede the node: the elements from `a` to `b`.
    Range,
}

impl NodeKind {
    /// An index that ends in this node is a slice.
    pub const fn is_slice(self) -> bool {
        matches!(self, NodeKind::All | NodeKind::Range)
    }
}

/// An expression: a range of nodes.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct ExprId {
    /// Index of the first node in [`Ast::nodes`], or in a list of its own.
    pub first: u32,
    /// Number of nodes; the last is the root.
    pub count: u32,
}

impl ExprId {
    /// Indices of the nodes in their list.
    #[inline]
    pub fn range(self) -> std::ops::Range<usize> {
        self.first as usize..(self.first + self.count) as usize
    }
}

/// An expression and its place.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Expr {
    /// Nodes of the expression.
    pub id: ExprId,
    /// Source range of the expression.
    pub span: Span,
}

/// An operand as written.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Operand {
    /// Form of the operand.
    pub kind: OperandKind,
    /// Source range of the operand.
    pub span: Span,
}

impl From<Expr> for Operand {
    fn from(Expr { id, span }: Expr) -> Operand {
        Operand { kind: OperandKind::Expr(id), span }
    }
}

/// The form of an operand.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum OperandKind {
    /// A name alone: a register, port, label, constant or parameter.
    Name(NameRef),
    /// An expression other than a name alone.
    Expr(ExprId),
    /// `@m12`: a register by its canonical name.
    Place(NameRef),
    /// `offset[register]`: an index into [`Ast::memories`].
    Memory(u32),
    /// `register:type`: an index into [`Ast::casts`].
    Cast(u32),
    /// `name[i, j]`: an index into [`Ast::elements`].
    Element(u32),
}

/// `name[i, j]`: an element of an array; or a slice of one, if an index ends in [`NodeKind::All`] or [`NodeKind::Range`].
#[derive(Clone, PartialEq, Debug)]
pub struct Element {
    /// Name of the array.
    pub name: Name,
    /// The nodes of each index.
    pub indices: Vec<Vec<Node>>,
}

impl Element {
    /// At least one index is a slice.
    pub fn is_slice(&self) -> bool {
        self.indices.iter().any(|index| index.last().is_some_and(|node| node.kind.is_slice()))
    }
}

/// `target, … = value, …`: computed when the program runs.
#[derive(Clone, PartialEq, Debug)]
pub struct Equation {
    /// The targets on the left.
    pub targets: Vec<Operand>,
    /// The values on the right.
    pub values: Vec<Expr>,
    /// Source range from the first target to the last value.
    pub span: Span,
}

/// `register:type`: the register's bits, read as another type.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Cast {
    /// The operand before the colon.
    pub operand: Operand,
    /// Name of the type.
    pub ty: Name,
}

/// `offset[register]`: a word of data memory.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Memory {
    /// The offset; `None` stands for 0.
    pub offset: Option<Expr>,
    /// The operand in the brackets.
    pub base: Operand,
}

/// An operation of a bundle, or the use of a macro.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Operation {
    /// The mnemonic, the macro's name, or `.raw`.
    pub mnemonic: Name,
    /// Index of the first operand in [`Ast::operands`].
    pub first: u32,
    /// Number of operands from there on.
    pub count: u32,
    /// Line of the mnemonic, from 1.
    pub line: u32,
    /// Source range from the mnemonic to the last operand.
    pub span: Span,
}

/// A line: an optional label, and its content.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Statement {
    /// Label before the content, if any.
    pub label: Option<Name>,
    /// Content of the line after the label.
    pub kind: StatementKind,
    /// Line number, from 1; the first number of a continued line.
    pub line: u32,
}

/// The kind of a line.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum StatementKind {
    /// No content: a label alone, or a line that could not be read.
    Empty,
    /// Operations: their first in [`Ast::operations`] and their number, at most [`BUNDLE_OPERATIONS`](crate::limits::BUNDLE_OPERATIONS).
    Bundle(u32, u8),
    /// A directive: its index in [`Ast::directives`].
    Directive(u32),
    /// An equation: its index in [`Ast::equations`].
    Equation(u32),
}

/// The kind of a declaration.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum DeclarationKind {
    /// Registers in general: `.reg`.
    Register,
    /// Registers whose value outlives the period: `.state`.
    State,
    /// Ports that the program reads: `.input`.
    Input,
    /// Ports that the program writes: `.output`.
    Output,
    /// Ports that the host sets between periods: `.param`.
    Parameter,
}

/// A declared name, with sizes, type and place as written.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Declaration {
    /// Name that is declared.
    pub name: Name,
    /// Sizes of an array in each direction: index of the first in [`Ast::sizes`], and their number, 0 for a single register.
    pub sizes: (u32, u32),
    /// Type after the colon, if any.
    pub ty: Option<Name>,
    /// Operand of `@`: the name of a register, or the number of a port.
    pub place: Option<Expr>,
}

/// The values of an array's elements.
#[derive(Clone, PartialEq, Eq, Debug)]
pub enum ArrayValues {
    /// Values as listed; zeros if the list is empty.
    Listed(Vec<Expr>),
    /// Numbers of a file, by path and place of the path.
    File(String, Span),
}

/// A parameter of a macro.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Parameter {
    /// Name of the parameter.
    pub name: Name,
    /// Type after the colon, if any.
    pub ty: Option<Name>,
}

/// A section of the program.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Hash, PartialOrd, Ord)]
pub enum Section {
    /// The section that runs once, after reset.
    Once,
    /// The section that runs every period.
    Period,
    /// Contents of data memory.
    Data,
}

impl Section {
    /// Name of the section, without the point.
    pub const fn name(self) -> &'static str {
        match self {
            Section::Once => "once",
            Section::Period => "period",
            Section::Data => "data",
        }
    }
}

/// A directive and its operands.
#[derive(Clone, PartialEq, Debug)]
pub struct DirectiveLine {
    /// Directive with its operands.
    pub kind: DirectiveKind,
    /// Source range of the directive with its operands.
    pub span: Span,
}

/// A directive and its operands. `end` and `next` are indices into [`Ast::statements`], known once the file is read.
#[derive(Clone, PartialEq, Debug)]
pub enum DirectiveKind {
    /// `.reg`, `.state`, `.input`, `.output`.
    Declare(DeclarationKind, Vec<Declaration>),
    /// `.machine`, and its options with their values.
    Machine(MachineName, Vec<(Name, Expr)>),
    /// `.array`: the arrays, and the values of the last one's elements.
    Array(Vec<Declaration>, ArrayValues),
    /// `.const`, the name and its value.
    Const(Name, Expr),
    /// `.param`.
    Param {
        /// Parameter, or array of parameters.
        declaration: Declaration,
        /// Values at the start: one for all elements, or one for each.
        values: Vec<Expr>,
        /// Option's name, least and largest value.
        range: Option<(Name, Expr, Expr)>,
    },
    /// `.preset`, the register and its value.
    Preset {
        /// The register, by its name or its place; or an element of an array.
        register: Operand,
        /// `@` precedes the register, which is then named by its address.
        placed: bool,
        /// The value that the loader writes there.
        value: Expr,
    },
    /// `.once`, `.period` or `.data`: the section that begins.
    Section(Section),
    /// `.float` and the values of the words.
    Float(Vec<Expr>),
    /// `.word` and the values of the words.
    Word(Vec<Expr>),
    /// `.space` and the number of words.
    Space(Expr),
    /// `.macro`, its parameters, and the statement of its `.endm`.
    Macro {
        /// Name of the macro.
        name: Name,
        /// Parameters of the macro, in order.
        parameters: Vec<Parameter>,
        /// Statement of the `.endm`.
        end: u32,
    },
    /// `.rep` and the statement of its `.endr`.
    Rep {
        /// Index variable.
        variable: Name,
        /// First value of the index variable.
        first: Expr,
        /// Last value of the index variable, included.
        last: Expr,
        /// Statement of the `.endr`.
        end: u32,
    },
    /// `.for` and the statement of its `.endfor`.
    For {
        /// Index variable.
        variable: Name,
        /// First value of the index variable.
        first: Expr,
        /// Last value of the index variable, included.
        last: Expr,
        /// `step`, `unroll` and `max`, each with its value.
        options: Vec<(Name, Expr)>,
        /// Statement of the `.endfor`.
        end: u32,
    },
    /// `.if` and the statement of the next branch or its `.endif`.
    If(Expr, u32),
    /// `.elif`, the next branch, and the `.endif`.
    Elif(Expr, u32, u32),
    /// `.else` and the `.endif`.
    Else(u32),
    /// `.endm`, `.endr`, `.endfor`, `.endif`.
    End(Directive),
    /// A `.macro`, `.rep`, `.for` or `.if` that could not be read, and the statement of its end: everything between is passed
    /// over.
    Broken(Directive, u32),
    /// `.include`, and whether the name stands in `<>`: in the library rather than beside this file.
    Include(String, bool),
    /// `.loc`: one place for all that follows, or one for each operation of each bundle that follows.
    Loc(Vec<Loc>),
    /// `.error` and its text.
    Error(String),
    /// `.schedule` and `on` or `off`.
    Schedule(Name),
    /// `.contract` and `on` or `off`.
    Contract(Name),
    /// `.fast` and the changes that it allows, or `off`.
    Fast(Vec<Name>),
    /// `.ports` and `latched` or `direct`.
    Ports(Name),
    /// `.loop_bound`, the maximum number of iterations per entry of the loop, and `total` with the maximum in a section.
    LoopBound(Expr, Option<(Name, Expr)>),
    /// `.range`, the registers, whether `@` stands before them, the least and the largest value.
    Range {
        /// The registers, by their names or their places; or elements of arrays.
        registers: Vec<Operand>,
        /// `@` precedes the registers, which are then named by their addresses.
        placed: bool,
        /// Least value of each register.
        low: Expr,
        /// Largest value of each register.
        high: Expr,
    },
    /// `.result` and the arrays.
    Result(Vec<Name>),
    /// `.assume`, the register, and the bound of the value that the operation before it writes there.
    Assume {
        /// Register by its name, or an element of an array of registers.
        register: Operand,
        /// The bound is the least value; otherwise the largest.
        least: bool,
        /// Bound of the value.
        bound: Expr,
    },
    /// `.deadline`, the ports, and the cycle.
    Deadline(Vec<Name>, Expr),
    /// `.order` and the ports.
    Order(Vec<Name>),
    /// `.late`, the ports, and the cycles by which the schedule may grow for them.
    Late(Vec<Name>, Option<Expr>),
}

/// A place of a `.loc`.
#[derive(Clone, PartialEq, Debug)]
pub enum Loc {
    /// `none`, or another name by mistake.
    None(Name),
    /// A file, a line, and perhaps the first and the last column of a part of it.
    At(String, Expr, Option<(Expr, Expr)>),
}

macro_rules! directives {
    ($($variant:ident $name:literal $operands:literal $text:literal;)*) => {
        /// The directives, by name.
        #[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
        #[allow(missing_docs)]
        pub enum Directive {
            $($variant,)*
        }

        impl Directive {
            /// All directives, in the order of the table.
            pub const ALL: &[Directive] = &[$(Directive::$variant),*];

            /// Name of the directive, with the point.
            pub const fn name(self) -> &'static str {
                match self { $(Directive::$variant => $name,)* }
            }

            /// Operands of the directive, as a message shows them.
            pub const fn operands(self) -> &'static str {
                match self { $(Directive::$variant => $operands,)* }
            }

            /// Meaning of the directive, in a sentence.
            pub const fn text(self) -> &'static str {
                match self { $(Directive::$variant => $text,)* }
            }
        }
    };
}

directives! {
    Machine ".machine" "t3|\"file\" code=4096 data=32768" "The machine that the program is for, by name or by file, and the depths of its memories; the program's first line.";
    Reg ".reg" "a, b:int, c @ m3, P[4,4]" "Registers, placed by the assembler or with `@`.";
    State ".state" "a, b:int, c @ m3, P[4,4]" "Registers whose value outlives the period.";
    Input ".input" "a, b:int, z[3]" "Input ports; `@ 4` gives one its number.";
    Output ".output" "a, b:int, u[4]" "Output ports; `@ 3` gives one its number.";
    Array ".array" "A[12,12], x[12], k[3]:int = 1, 2, 3|\"file\"" "Arrays in data memory; the values are those of the last one, listed or in a file of numbers.";
    Const ".const" "NAME = expression" "A named constant, evaluated in binary64 or as an integer, rounded once where it is used.";
    Param ".param" "kp = 2.0 range 0..50" "A parameter: an input that keeps its value until the host sets another between two periods; a set acts at once.";
    Preset ".preset" "m12 = expression" "A register that the loader sets.";
    Once ".once" "" "The following code runs once, after reset.";
    Period ".period" "" "The following code runs in every period.";
    Data ".data" "" "The following lines fill data memory.";
    Float ".float" "expression, …" "Words of data: binary32.";
    Word ".word" "expression, …" "Words of data: 32-bit integers.";
    Space ".space" "words" "Words of data: zeros.";
    Macro ".macro" "name d:float, x:float, n:number" "A macro; its use writes out the body with the arguments for the parameters, whose types are float, int, bits, number or name.";
    EndMacro ".endm" "" "The end of a macro's body.";
    Rep ".rep" "i, first, last" "Repeats its body with the name = first … last.";
    EndRep ".endr" "" "The end of a repetition's body.";
    For ".for" "i, first, last step s unroll n max m" "A counted loop: its body runs with the name = first … last.";
    EndFor ".endfor" "" "The end of a counted loop's body.";
    If ".if" "expression" "Assembles the following lines if the value is not zero.";
    Elif ".elif" "expression" "Assembles the following lines if no branch before was taken and the value is not zero.";
    Else ".else" "" "Assembles the following lines if no branch before was taken.";
    EndIf ".endif" "" "The end of the branches.";
    Include ".include" "\"file\"|<file>" "The named file: beside this one, or of the library.";
    Loc ".loc" "\"file\" line" "Attributes the following lines to this line of this file.";
    Error ".error" "\"text\"" "An error with that text.";
    Schedule ".schedule" "on|off" "Turns the scheduler on or off, which packs the following operations into bundles and orders them.";
    Contract ".contract" "on|off" "Turns contraction on or off: a product with a single use, in a sum, is fused with this sum.";
    Fast ".fast" "reassociate reciprocal|off" "Rewrites of equations that are allowed although they change rounding.";
    Ports ".ports" "latched|direct" "Latches ports: inputs are taken together at the tick, outputs published together at `wait`.";
    LoopBound ".loop_bound" "n total m" "The bundle that follows heads a loop of at most n iterations, in one section at most m.";
    Range ".range" "a, b = least, largest" "Between which values inputs or states lie when a period begins: `takt accuracy` rests on it.";
    Result ".result" "A, B" "Arrays in data memory whose words are results when a period ends, as output ports are: `takt accuracy` bounds their worst element.";
    Assume ".assume" "a >= least|a <= largest" "What the author knows of the value that the operation before writes into a register: `takt accuracy` relies on it, `takt run --deny range` checks it.";
    Deadline ".deadline" "port, port = cycle" "Each output is written for the last time in that cycle or before.";
    Order ".order" "port, port, …" "Every use of one port comes before the first of the next.";
    Late ".late" "port, port = cycles" "The inputs are read as late as the length of the schedule allows.";
    Raw ".raw" "slot 0x…" "48 bits for a slot, whatever they mean.";
}

impl Directive {
    /// Words with a meaning of their own among the operands.
    pub const fn options(self) -> &'static [&'static str] {
        match self {
            Directive::Machine => &["code", "data"],
            Directive::Param => &["range"],
            Directive::For => &["step", "unroll", "max"],
            Directive::LoopBound => &["total"],
            Directive::Schedule | Directive::Contract => &["on", "off"],
            Directive::Fast => &["reassociate", "reciprocal", "off"],
            Directive::Ports => &["latched", "direct"],
            _ => &[],
        }
    }
}

/// A source file as a tree, in flat lists.
#[derive(Clone, Default, Debug)]
pub struct Ast {
    /// Lines with a label or content, in order.
    pub statements: Vec<Statement>,
    /// Operations of the bundles.
    pub operations: Vec<Operation>,
    /// Operands of the operations.
    pub operands: Vec<Operand>,
    /// Nodes of the expressions.
    pub nodes: Vec<Node>,
    /// Operands in data memory, `offset[register]`.
    pub memories: Vec<Memory>,
    /// Operands with a type.
    pub casts: Vec<Cast>,
    /// Elements and slices of arrays.
    pub elements: Vec<Element>,
    /// Equations, in the order of the lines.
    pub equations: Vec<Equation>,
    /// Sizes of declared arrays.
    pub sizes: Vec<Expr>,
    /// Templates of names, such as `l{i}`.
    pub templates: Vec<Template>,
    /// Directives, in the order of the lines.
    pub directives: Vec<DirectiveLine>,
    /// Names that an unreadable line may have declared: their use is not reported again.
    pub doubtful: BTreeSet<NameId>,
    /// Lines, from 1, that could not be read.
    pub broken: Vec<u32>,
}

/// A binary or unary operator.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[allow(missing_docs)]
pub enum Operator {
    Eq,
    Ne,
    Lt,
    Le,
    Gt,
    Ge,
    Or,
    And,
    Shl,
    Shr,
    Add,
    Sub,
    Mul,
    Div,
    Rem,
    Complement,
    Not,
    Power,
}

impl Operator {
    /// All operators, prefix operators included.
    pub const ALL: [Operator; 18] = {
        use Operator::*;
        [Eq, Ne, Lt, Le, Gt, Ge, Or, And, Shl, Shr, Add, Sub, Mul, Div, Rem, Complement, Not, Power]
    };

    /// Spelling of the operator in the source.
    pub const fn text(self) -> &'static str {
        match self {
            Operator::Eq => "==",
            Operator::Ne => "!=",
            Operator::Lt => "<",
            Operator::Le => "<=",
            Operator::Gt => ">",
            Operator::Ge => ">=",
            Operator::Or => "|",
            Operator::And => "&",
            Operator::Shl => "<<",
            Operator::Shr => ">>",
            Operator::Add => "+",
            Operator::Sub => "-",
            Operator::Mul => "*",
            Operator::Div => "/",
            Operator::Rem => "%",
            Operator::Complement => "~",
            Operator::Not => "!",
            Operator::Power => "^",
        }
    }

    /// Precedence of prefix operators: below powers.
    pub const PREFIX: u16 = 7;

    /// Precedence as a binary operator, from 1; 0 for an operator that is only a prefix.
    pub const fn precedence(self) -> u16 {
        match self {
            Operator::Eq | Operator::Ne | Operator::Lt | Operator::Le | Operator::Gt | Operator::Ge => 1,
            Operator::Or => 2,
            Operator::And => 3,
            Operator::Shl | Operator::Shr => 4,
            Operator::Add | Operator::Sub => 5,
            Operator::Mul | Operator::Div | Operator::Rem => 6,
            Operator::Power => 8,
            Operator::Complement | Operator::Not => 0,
        }
    }

    /// The operators that compare two values.
    pub const COMPARISONS: &[Operator] =
        &[Operator::Eq, Operator::Ne, Operator::Lt, Operator::Le, Operator::Gt, Operator::Ge];

    /// The operator compares two values: its result is 1 or 0.
    pub const fn compares(self) -> bool {
        self.precedence() == Operator::Eq.precedence()
    }

    /// The operator is `&` or `|`: it joins conditions, and other integers bit by bit.
    pub const fn joins(self) -> bool {
        matches!(self, Operator::And | Operator::Or)
    }

    /// The operator may stand before a single operand.
    pub const fn is_prefix(self) -> bool {
        matches!(self, Operator::Add | Operator::Sub | Operator::Complement | Operator::Not)
    }
}
