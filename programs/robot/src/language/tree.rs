// SPDX-License-Identifier: MIT OR Apache-2.0
//! The tree of a program.

use crate::packet::{JogMode, Profile};
use takt_diagnostics::source::Span;

/// A name and its place.
#[derive(Clone, Debug, PartialEq)]
pub struct Name {
    /// The name.
    pub text: String,
    /// Its place.
    pub span: Span,
}

/// A value to be computed.
#[derive(Clone, Debug, PartialEq)]
pub struct Expression {
    /// Its place.
    pub span: Span,
    /// Its kind.
    pub kind: ExpressionKind,
}

/// The kinds of expressions.
#[derive(Clone, Debug, PartialEq)]
pub enum ExpressionKind {
    /// A number.
    Number(f64),
    /// `_`: as it is.
    Hole,
    /// A variable.
    Name(String),
    /// A function.
    Call(Name, Vec<Expression>),
    /// `of.name`.
    Component(Box<Expression>, Name),
    /// `-` or `not`.
    Unary(Unary, Box<Expression>),
    /// Two values.
    Binary(Binary, Box<Expression>, Box<Expression>),
}

/// Operators before a value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unary {
    /// `-`
    Minus,
    /// `not`
    Not,
}

/// Operators between values.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Binary {
    /// `or`
    Or,
    /// `and`
    And,
    /// `==`
    Equal,
    /// `!=`
    Unequal,
    /// `<`
    Less,
    /// `<=`
    AtMost,
    /// `>`
    Greater,
    /// `>=`
    AtLeast,
    /// `+`
    Plus,
    /// `-`
    Minus,
    /// `*`
    Times,
    /// `/`
    Over,
}

impl Binary {
    /// Its name in a program.
    pub const fn text(self) -> &'static str {
        match self {
            Binary::Or => "or",
            Binary::And => "and",
            Binary::Equal => "==",
            Binary::Unequal => "!=",
            Binary::Less => "<",
            Binary::AtMost => "<=",
            Binary::Greater => ">",
            Binary::AtLeast => ">=",
            Binary::Plus => "+",
            Binary::Minus => "-",
            Binary::Times => "*",
            Binary::Over => "/",
        }
    }
}

/// Statements that follow one another.
pub type Block = Vec<Statement>;

/// A statement.
#[derive(Clone, Debug, PartialEq)]
pub struct Statement {
    /// Its first line, or the whole of it if it has one line.
    pub span: Span,
    /// Its kind.
    pub kind: StatementKind,
}

/// The kinds of statements.
#[derive(Clone, Debug, PartialEq)]
pub enum StatementKind {
    /// A statement that is done at once.
    Do(Action),
    /// Conditions with their blocks, and what is done if none holds.
    If(Vec<(Expression, Block)>, Block),
    /// A number of times.
    Repeat(Expression, Block),
    /// As long as it holds.
    While(Expression, Block),
    /// A subprogram.
    Sub(Name, Vec<Name>, Block),
    /// A call of one.
    Call(Name, Vec<Expression>),
    /// Back from one.
    Return,
    /// A block, and another that runs if the robot refuses or stops.
    Try(Block, Block),
    /// A command of the prompt alone.
    Console(Console),
}

/// Speed or time of a motion.
#[derive(Clone, Debug, PartialEq)]
pub enum Pace {
    /// `at`: deg/s of the fastest joint, or mm/s along the line.
    At(Expression),
    /// `in`: s.
    In(Expression),
    /// `fast`: as the limits allow.
    Fast,
}

/// The manner in which the program carries out a motion.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Course {
    /// The program waits for its end.
    Whole,
    /// `via`: it goes on into the next one.
    Via,
    /// `start`: the program goes on while it moves.
    Start,
    /// `check`: it is only checked.
    Check,
}

/// Statements without a block.
#[derive(Clone, Debug, PartialEq)]
pub enum Action {
    /// A value gets a name.
    Let(Name, Expression),
    /// A motion.
    Move {
        /// Along a line in the world.
        line: bool,
        /// The manner in which the program goes on.
        course: Course,
        /// The target.
        target: Expression,
        /// The speed, if the motion has its own.
        pace: Option<Pace>,
        /// Its profile, if it says so itself.
        profile: Option<Profile>,
    },
    /// Rates, and for how long; without that until the next one.
    Jog(JogMode, Vec<Expression>, Option<Expression>),
    /// All rates 0.
    JogOff,
    /// At once.
    Stop,
    /// Of joints, and along lines.
    Speed(Expression, Option<Expression>),
    /// Everything as fast as the limits allow.
    SpeedFast,
    /// Of the motions that follow.
    Profile(Profile),
    /// A digital output.
    Signal(Expression, bool),
    /// An analogue output.
    Level(Expression, Expression),
    /// s.
    Wait(Expression),
    /// Until the robot stands.
    WaitDone,
    /// Until it holds, and how long at most.
    WaitUntil(Expression, Option<Expression>),
    /// The tool's point, mm.
    Tool(Vec<Expression>),
    /// Velocities, deg/s.
    LimitSpeed(Vec<Expression>),
    /// Torques, N·m.
    LimitTorque(Vec<Expression>),
    /// After an error.
    Reset,
    /// Shows where the robot is.
    Where,
    /// Texts and values.
    Say(Vec<Item>),
    /// The present place gets a name: as joint angles if so.
    Teach(Name, bool),
    /// Something happens in the robot's surroundings, perhaps later.
    Simulate(Simulation, Option<Expression>),
}

/// A part of what `say` shows.
#[derive(Clone, Debug, PartialEq)]
pub enum Item {
    /// As it stands.
    Text(String),
    /// A value.
    Value(Expression),
}

/// Events around the robot.
#[derive(Clone, Debug, PartialEq)]
pub enum Simulation {
    /// A digital input.
    Input(Expression, bool),
    /// An analogue input.
    Analogue(Expression, Expression),
    /// On the link.
    Fault(crate::host::LinkFault),
}

/// Commands of the prompt alone.
#[derive(Clone, Debug, PartialEq)]
pub enum Console {
    /// Of a command, or of all.
    Help(Option<Name>),
    /// Ends the session.
    Quit,
    /// Runs a file, or the session's program.
    Run(Option<Name>),
    /// Runs it in a copy of the robot.
    Check(Option<Name>),
    /// Makes a file the session's program.
    Load(Name),
    /// Writes the session's program.
    Save(Name),
    /// Shows it.
    List,
    /// Empties it.
    New,
    /// True if commands go into it.
    Record(bool),
    /// Executes the program's next statement.
    Step,
    /// Executes the rest of them.
    Continue,
}
