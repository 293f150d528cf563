// SPDX-License-Identifier: MIT OR Apache-2.0
//! Syntax tree of a source file, before any name is resolved.
//!
//! Everything is kept in a few flat lists that refer to each other by index: a file of a million lines is a handful of
//! allocations, and a statement within a repetition is read again and again without being copied.

use crate::name::{NameId, NameRef};
use crate::report::source::Span;
use std::collections::BTreeSet;

/// A name and its place.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Name {
    /// The name.
    pub name: NameRef,
    /// Its place.
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

/// `head{e}middle{e}tail`: what precedes each braced expression, the expression, and the tail.
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
    /// Its kind.
    pub kind: NodeKind,
    /// The part of the source that it stands for.
    pub span: Span,
}

/// The kind of a node. Operands precede their operator.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum NodeKind {
    /// An integer literal.
    Int(i64),
    /// A real literal.
    Real(f64),
    /// A name.
    Name(NameRef),
    /// An operator before the one operand that precedes the node.
    Prefix(Operator),
    /// An operator between the two operands that precede the node.
    Infix(Operator),
    /// A function, by name, of as many arguments as precede the node.
    Call(NameId, u32),
    /// `c ? a : b` of the three operands that precede the node.
    Choice,
    /// `name[i, j]`: an index into [`Ast::elements`].
    Element(u32),
    /// In an index, `:`: all there are.
    All,
    /// In an index, `a:b` of the two operands that precede the node: those from `a` to `b`.
    Range,
}

impl NodeKind {
    /// True if an index is a slice, given its last node.
    pub const fn is_slice(self) -> bool {
        matches!(self, NodeKind::All | NodeKind::Range)
    }
}

/// An expression: a range of nodes.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct ExprId {
    /// First node.
    pub first: u32,
    /// Number of nodes.
    pub count: u32,
}

impl ExprId {
    /// The nodes' indices.
    #[inline]
    pub fn range(self) -> std::ops::Range<usize> {
        self.first as usize..(self.first + self.count) as usize
    }
}

/// An expression and its place.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Expr {
    /// The expression.
    pub id: ExprId,
    /// Its place.
    pub span: Span,
}

/// An operand as written.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Operand {
    /// Its kind.
    pub kind: OperandKind,
    /// Its place.
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
    /// Any other expression.
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
    /// The array.
    pub name: Name,
    /// The nodes of each index.
    pub indices: Vec<Vec<Node>>,
}

impl Element {
    /// True if it is several elements.
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
    /// All of it.
    pub span: Span,
}

/// `register:type`: its bits are taken as another type.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Cast {
    /// The operand before the colon.
    pub operand: Operand,
    /// The type's name.
    pub ty: Name,
}

/// `offset[register]`.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Memory {
    /// The offset; none is 0.
    pub offset: Option<Expr>,
    /// The operand in the brackets.
    pub base: Operand,
}

/// An operation of a bundle, or the use of a macro.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Operation {
    /// The mnemonic, the macro's name, or `.raw`.
    pub mnemonic: Name,
    /// Its first operand in [`Ast::operands`].
    pub first: u32,
    /// The number of its operands.
    pub count: u32,
    /// Line, from 1.
    pub line: u32,
    /// From the mnemonic to the last operand.
    pub span: Span,
}

/// A line: an optional label, and what follows.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Statement {
    /// The label.
    pub label: Option<Name>,
    /// The rest of the line.
    pub kind: StatementKind,
    /// Line, from 1.
    pub line: u32,
}

/// The kind of a line.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum StatementKind {
    /// Nothing: a label alone, or a line that could not be read.
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
pub enum Declares {
    /// Registers.
    Register,
    /// Registers whose value outlives the period.
    State,
    /// Input ports.
    Input,
    /// Output ports.
    Output,
}

/// One name of a declaration.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Declaration {
    /// The name.
    pub name: Name,
    /// Of an array, how many elements it has in each direction: where they begin in [`Ast::sizes`], and how many there are.
    pub sizes: (u32, u32),
    /// The type after its colon.
    pub ty: Option<Name>,
    /// The operand of its `@`: the name of a register, or the number of a port.
    pub place: Option<Expr>,
}

/// A section of the program.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Hash, PartialOrd, Ord)]
pub enum Section {
    /// The section that runs once, after reset.
    Once,
    /// The section that runs every period.
    Period,
    /// Data memory.
    Data,
}

impl Section {
    /// Its name, without the point.
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
    /// The directive.
    pub kind: DirectiveKind,
    /// The directive's place and, where it has operands, theirs.
    pub span: Span,
}

/// A directive and its operands. `end` and `next` are indices into [`Ast::statements`], known once the file is read.
#[derive(Clone, PartialEq, Debug)]
pub enum DirectiveKind {
    /// `.reg`, `.state`, `.input`, `.output`.
    Declare(Declares, Vec<Declaration>),
    /// `.machine`, and its options with their values.
    Machine(MachineName, Vec<(Name, Expr)>),
    /// `.array`: the arrays, and the values of the last one's elements; zeros if there are none.
    Array(Vec<Declaration>, Vec<Expr>),
    /// `.const`.
    Const(Name, Expr),
    /// `.preset`.
    Preset {
        /// The register, by its name or its place; or an element of an array.
        register: Operand,
        /// True if `@` precedes it: then it is an address.
        placed: bool,
        /// The value that the loader writes there.
        value: Expr,
    },
    /// `.once`, `.period`, `.data`.
    Section(Section),
    /// `.float`.
    Float(Vec<Expr>),
    /// `.word`.
    Word(Vec<Expr>),
    /// `.space`.
    Space(Expr),
    /// `.macro`, its parameters, and the statement of its `.endm`.
    Macro {
        /// The macro.
        name: Name,
        /// Its parameters.
        parameters: Vec<Name>,
        /// The statement after its end.
        end: u32,
    },
    /// `.rep` and the statement of its `.endr`.
    Rep {
        /// The name that counts.
        variable: Name,
        /// Its first value.
        first: Expr,
        /// Its last value.
        last: Expr,
        /// The statement after its end.
        end: u32,
    },
    /// `.for` and the statement of its `.endfor`.
    For {
        /// The name that counts.
        variable: Name,
        /// Its first value.
        first: Expr,
        /// Its last value.
        last: Expr,
        /// `step`, `unroll` and `max`, each with its value.
        options: Vec<(Name, Expr)>,
        /// The statement after its end.
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
    /// A `.macro`, `.rep`, `.for` or `.if` that could not be read, and where it ends: what it encloses is passed over.
    Broken(Directive, u32),
    /// `.include`, and whether the name stands in `<>`: in the library rather than beside this file.
    Include(String, bool),
    /// `.loc`: one place for all that follows, or one for each operation of each bundle that follows.
    Loc(Vec<Loc>),
    /// `.error`.
    Error(String),
    /// `.schedule` and `on` or `off`.
    Schedule(Name),
    /// `.contract` and `on` or `off`.
    Contract(Name),
    /// `.fast` and what it allows, or `off`.
    Fast(Vec<Name>),
    /// `.ports` and `latched` or `direct`.
    Ports(Name),
    /// `.loop_bound`, the most iterations each time that the loop is entered, and `total` with the most of a section.
    LoopBound(Expr, Option<(Name, Expr)>),
    /// `.range`, the registers, whether `@` stands before them, the least and the largest value.
    Range {
        /// The registers, by their names or their places; or elements of arrays.
        registers: Vec<Operand>,
        /// True if `@` precedes them: then they are addresses.
        placed: bool,
        /// The least value.
        low: Expr,
        /// The largest value.
        high: Expr,
    },
    /// `.deadline`, the ports, and the cycle.
    Deadline(Vec<Name>, Expr),
    /// `.order` and the ports.
    Order(Vec<Name>),
    /// `.late`, the ports, and the cycles that it may cost.
    Late(Vec<Name>, Option<Expr>),
}

/// One place of a `.loc`.
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
            /// Every directive.
            pub const ALL: &[Directive] = &[$(Directive::$variant),*];

            /// Its name, with the point.
            pub const fn name(self) -> &'static str {
                match self { $(Directive::$variant => $name,)* }
            }

            /// Its operands, as a message shows them.
            pub const fn operands(self) -> &'static str {
                match self { $(Directive::$variant => $operands,)* }
            }

            /// Its meaning, in a sentence.
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
    Array ".array" "A[12,12], x[12], k[3]:int = 1, 2, 3" "Arrays in data memory; the values are those of the last one.";
    Const ".const" "NAME = expression" "A named constant, evaluated in binary64 or as an integer, rounded once where it is used.";
    Preset ".preset" "m12 = expression" "A register that the loader sets.";
    Once ".once" "" "What follows runs once, after reset.";
    Period ".period" "" "What follows runs every period.";
    Data ".data" "" "What follows is data memory.";
    Float ".float" "expression, …" "Words of data: binary32.";
    Word ".word" "expression, …" "Words of data: 32-bit integers.";
    Space ".space" "words" "Words of data: zeros.";
    Macro ".macro" "name p, q" "A macro; its use writes out the body with the arguments for the parameters.";
    EndMacro ".endm" "" "The end of a macro's body.";
    Rep ".rep" "i, first, last" "Repeats its body with the name = first … last.";
    EndRep ".endr" "" "The end of a repetition's body.";
    For ".for" "i, first, last step s unroll n max m" "A counted loop: its body runs with the name = first … last.";
    EndFor ".endfor" "" "The end of a counted loop's body.";
    If ".if" "expression" "Assembles what follows if the value is not zero.";
    Elif ".elif" "expression" "Assembles what follows if no branch before was taken and the value is not zero.";
    Else ".else" "" "Assembles what follows if no branch before was taken.";
    EndIf ".endif" "" "The end of the branches.";
    Include ".include" "\"file\"|<file>" "The named file: beside this one, or of the library.";
    Loc ".loc" "\"file\" line" "What follows is attributed to that line of that file.";
    Error ".error" "\"text\"" "An error with that text.";
    Schedule ".schedule" "on|off" "Whether the assembler packs what follows into bundles and orders it.";
    Contract ".contract" "on|off" "Whether a product that only one sum uses becomes a fused operation with it.";
    Fast ".fast" "reassociate reciprocal|off" "What equations may do beyond what is written.";
    Ports ".ports" "latched|direct" "Whether inputs are taken together at the tick and outputs published together at `wait`.";
    LoopBound ".loop_bound" "n total m" "The bundle that follows heads a loop of at most n iterations, in one section at most m.";
    Range ".range" "a, b = least, largest" "Between which values inputs or states lie when a period begins: `takt accuracy` rests on it.";
    Deadline ".deadline" "port, port = cycle" "Each output is written for the last time in that cycle or before.";
    Order ".order" "port, port, …" "Every use of one port comes before the first of the next.";
    Late ".late" "port, port = cycles" "The inputs are read as late as the length of the schedule allows.";
    Raw ".raw" "slot 0x…" "48 bits for a slot, whatever they mean.";
}

/// A source file, read.
#[derive(Clone, Default, Debug)]
pub struct Ast {
    /// Lines that say something, in order.
    pub statements: Vec<Statement>,
    /// Operations of the bundles.
    pub operations: Vec<Operation>,
    /// Operands of the operations.
    pub operands: Vec<Operand>,
    /// Nodes of the expressions.
    pub nodes: Vec<Node>,
    /// Memory operands.
    pub memories: Vec<Memory>,
    /// Operands with a type.
    pub casts: Vec<Cast>,
    /// Elements of arrays.
    pub elements: Vec<Element>,
    /// Equations.
    pub equations: Vec<Equation>,
    /// Sizes of declared arrays.
    pub sizes: Vec<Expr>,
    /// Name templates.
    pub templates: Vec<Template>,
    /// Directives.
    pub directives: Vec<DirectiveLine>,
    /// Names in lines that could not be read and may have declared them: that they are unknown is no further error.
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
    /// Every operator.
    pub const ALL: [Operator; 18] = {
        use Operator::*;
        [Eq, Ne, Lt, Le, Gt, Ge, Or, And, Shl, Shr, Add, Sub, Mul, Div, Rem, Complement, Not, Power]
    };

    /// Its spelling in the source.
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

    /// Precedence of prefix operators: less than powers.
    pub const PREFIX: u16 = 7;

    /// Its precedence as a binary operator, from 1; 0 if it is not one.
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

    /// True if it compares two values: its result is 1 or 0.
    pub const fn compares(self) -> bool {
        self.precedence() == Operator::Eq.precedence()
    }

    /// True if it joins conditions, and other integers, bit by bit.
    pub const fn joins(self) -> bool {
        matches!(self, Operator::And | Operator::Or)
    }

    /// True if it may be a prefix operator.
    pub const fn is_prefix(self) -> bool {
        matches!(self, Operator::Add | Operator::Sub | Operator::Complement | Operator::Not)
    }
}
