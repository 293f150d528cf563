// SPDX-License-Identifier: MIT OR Apache-2.0
//! Syntax tree of a program.

use crate::packet::{JogMode, Profile};
use takt_diagnostics::source::Span;

/// Name with its place.
#[derive(Clone, Debug, PartialEq)]
pub struct Name {
    /// Text of the name.
    pub text: String,
    /// Place in the sources.
    pub span: Span,
}

/// Expression with its place.
#[derive(Clone, Debug, PartialEq)]
pub struct Expression {
    /// Place in the sources.
    pub span: Span,
    /// Kind with its operands.
    pub kind: ExpressionKind,
}

/// Kinds of expressions, with their operands.
#[derive(Clone, Debug, PartialEq)]
pub enum ExpressionKind {
    /// Literal number without a unit.
    Number(f64),
    /// Hole `_`: the present value of a component.
    Hole,
    /// Variable, referred to by name.
    Name(String),
    /// Function call with arguments.
    Call(Name, Vec<Expression>),
    /// Component of a value: `of.name`.
    Component(Box<Expression>, Name),
    /// Prefix operator with its operand.
    Unary(Unary, Box<Expression>),
    /// Infix operator with its operands.
    Binary(Binary, Box<Expression>, Box<Expression>),
}

/// Operators before their operand.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unary {
    /// Arithmetic negation of the operand, `-`
    Minus,
    /// Logical negation of the operand, `not`
    Not,
}

/// Operators between their operands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Binary {
    /// Logical or, with short circuit: `or`
    Or,
    /// Logical and, with short circuit: `and`
    And,
    /// Test for equality, `==`
    Equal,
    /// Test for inequality, `!=`
    Unequal,
    /// Test for a smaller left operand, `<`
    Less,
    /// Less or equal, `<=`
    AtMost,
    /// Test for a larger left operand, `>`
    Greater,
    /// Greater or equal, `>=`
    AtLeast,
    /// Sum of operands, `+`
    Plus,
    /// Difference of operands, `-`
    Minus,
    /// Product of operands, `*`
    Times,
    /// Quotient of operands, `/`
    Over,
}

impl Binary {
    /// Spelling in a program.
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

/// Sequence of statements, in order.
pub type Block = Vec<Statement>;

/// Statement with its place.
#[derive(Clone, Debug, PartialEq)]
pub struct Statement {
    /// First line of the statement; the whole statement if it has one line.
    pub span: Span,
    /// Kind with its operands and blocks.
    pub kind: StatementKind,
}

/// Kinds of statements, with their operands.
#[derive(Clone, Debug, PartialEq)]
pub enum StatementKind {
    /// Statement without a block.
    Do(Action),
    /// Conditions with their blocks, and the `else` block.
    If(Vec<(Expression, Block)>, Block),
    /// Loop with a number of rounds.
    Repeat(Expression, Block),
    /// Loop while a condition holds.
    While(Expression, Block),
    /// Definition of a subprogram.
    Sub(Name, Vec<Name>, Block),
    /// Call of a subprogram.
    Call(Name, Vec<Expression>),
    /// Return from a subprogram.
    Return,
    /// Block, and its handler for a refusal or stop of the robot.
    Try(Block, Block),
    /// Command for the prompt alone.
    Console(Console),
}

/// Speed or time of a motion.
#[derive(Clone, Debug, PartialEq)]
pub enum Pace {
    /// Keyword `at`: deg/s of the fastest joint, or mm/s along the line.
    At(Expression),
    /// Keyword `in`: duration, s.
    In(Expression),
    /// Keyword `fast`: as the limits allow.
    Fast,
}

/// Execution of a motion by the program.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Course {
    /// The program waits for the motion's end.
    Whole,
    /// Keyword `via`: the motion blends into the next one.
    Via,
    /// Keyword `start`: the program continues during the motion.
    Start,
    /// Keyword `check`: the motion is checked and not executed.
    Check,
}

/// Statements without a block.
#[derive(Clone, Debug, PartialEq)]
pub enum Action {
    /// Gives a name to a value.
    Let(Name, Expression),
    /// Motion to a target.
    Move {
        /// Straight line in the world; else in joint space.
        line: bool,
        /// Course of the program during the motion.
        course: Course,
        /// Target pose or joint angles.
        target: Expression,
        /// Speed or time, if the motion has its own.
        pace: Option<Pace>,
        /// Profile, if the motion has its own.
        profile: Option<Profile>,
    },
    /// Jog at these rates for a duration; without one, until the next jog.
    Jog(JogMode, Vec<Expression>, Option<Expression>),
    /// Ends the jog: all rates become 0.
    JogOff,
    /// Stops the robot at once.
    Stop,
    /// Sets the speeds of joints and along lines.
    Speed(Expression, Option<Expression>),
    /// Lets motions run as fast as the limits allow.
    SpeedFast,
    /// Sets the profile of the following motions.
    Profile(Profile),
    /// Sets a digital output.
    Signal(Expression, bool),
    /// Sets an analogue output.
    Level(Expression, Expression),
    /// Waits for a time, s.
    Wait(Expression),
    /// Waits until the robot stands.
    WaitDone,
    /// Waits until a condition holds; the second value limits the time.
    WaitUntil(Expression, Option<Expression>),
    /// Sets the tool point, mm.
    Tool(Vec<Expression>),
    /// Limits the joint velocities, deg/s.
    LimitSpeed(Vec<Expression>),
    /// Limits the torques, N·m.
    LimitTorque(Vec<Expression>),
    /// Ends the state after an error.
    Reset,
    /// Shows the position of the robot.
    Where,
    /// Shows texts and values.
    Say(Vec<Item>),
    /// Gives a name to the present position; the flag selects joint angles.
    Teach(Name, bool),
    /// Schedules an event around the robot, after a delay if given.
    Simulate(Simulation, Option<Expression>),
}

/// Part of a message of `say`.
#[derive(Clone, Debug, PartialEq)]
pub enum Item {
    /// Literal text in the message.
    Text(String),
    /// Value of an expression.
    Value(Expression),
}

/// Simulated events around the robot.
#[derive(Clone, Debug, PartialEq)]
pub enum Simulation {
    /// Change of a digital input.
    Input(Expression, bool),
    /// Change of an analogue input.
    Analogue(Expression, Expression),
    /// Fault of the link.
    Fault(crate::host::LinkFault),
}

/// Commands for the prompt alone.
#[derive(Clone, Debug, PartialEq)]
pub enum Console {
    /// Shows help on a command, or on all.
    Help(Option<Name>),
    /// Ends the session at the prompt.
    Quit,
    /// Runs a file, or the session's program.
    Run(Option<Name>),
    /// Runs a program in a copy of the robot.
    Check(Option<Name>),
    /// Makes a file the session's program.
    Load(Name),
    /// Writes the session's program to a file.
    Save(Name),
    /// Shows the session's program.
    List,
    /// Empties the session's program.
    New,
    /// Starts or ends the recording of commands into the program.
    Record(bool),
    /// Executes the program's next statement.
    Step,
    /// Executes the remaining statements.
    Continue,
}
