// SPDX-License-Identifier: MIT OR Apache-2.0
//! Values of programs, and the semantics of operators and functions.

use crate::dynamics::Joints;
use crate::geometry::Transform;
use crate::language::code::{FRAME_COMPONENTS, JOINT_COMPONENTS, POSE_COMPONENTS};
use crate::language::tree::{Binary, Expression, ExpressionKind, Name, Unary};
use std::fmt;
use takt_diagnostics::diag::Diagnostic;

/// Value of an expression. In poses and joint angles, NaN stands for an open component, `_`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Value {
    /// Number; as a condition, 0 is false.
    Number(f64),
    /// Joint angles in degrees.
    Joints(Joints),
    /// Pose x, y, z, roll, pitch, yaw: mm, deg.
    Pose([f64; 6]),
    /// Frame x, y, z, rx, ry, rz: mm, deg.
    Frame([f64; 6]),
}

impl Value {
    /// Kind of the value, for messages.
    pub const fn kind(&self) -> &'static str {
        match self {
            Value::Number(_) => "a number",
            Value::Joints(_) => "joint angles",
            Value::Pose(_) => "a pose",
            Value::Frame(_) => "a frame",
        }
    }
}

/// Formats a number with at most three decimals; NaN as `_`.
pub fn short(number: f64) -> String {
    if number.is_nan() {
        return "_".to_owned();
    }
    if number.abs() >= 1e9 {
        return format!("{number:e}");
    }
    let text = format!("{number:.3}");
    let text = text.trim_end_matches('0').trim_end_matches('.');
    if text == "-0" { "0".to_owned() } else { text.to_owned() }
}

impl fmt::Display for Value {
    /// Formats the value as program text.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (name, numbers) = match self {
            Value::Number(number) => return f.write_str(&short(*number)),
            Value::Joints(numbers) => ("joints", numbers),
            Value::Pose(numbers) => ("pose", numbers),
            Value::Frame(numbers) => ("frame", numbers),
        };
        let numbers: Vec<String> = numbers.iter().map(|number| short(*number)).collect();
        write!(f, "{name}({})", numbers.join(", "))
    }
}

/// Environment of an expression: names, inputs, the robot.
pub trait Surroundings {
    /// Value of a name, if it has been assigned.
    fn value(&self, name: &str) -> Option<Value>;
    /// Present joint angles, deg.
    fn joints(&self) -> Joints;
    /// Present pose, mm and deg.
    fn pose(&self) -> [f64; 6];
    /// State of a digital input; `None` if there is no such input.
    fn input(&self, number: f64) -> Option<bool>;
    /// Value of an analogue input; `None` if there is no such channel.
    fn analogue(&self, channel: f64) -> Option<f64>;
    /// Time since power-up, s.
    fn time(&self) -> f64;
    /// Cause of the last error, as a number; 0 without one.
    fn cause(&self) -> u32;
}

type Outcome<T> = Result<T, Box<Diagnostic>>;

fn wrong<T>(expression: &Expression, message: String) -> Outcome<T> {
    Err(Box::new(Diagnostic::error("value", expression.span, message)))
}

/// Evaluates an expression in its surroundings.
///
/// # Errors
/// If the kinds of the operands do not fit, or the result is NaN.
pub fn evaluate(expression: &Expression, around: &dyn Surroundings) -> Outcome<Value> {
    let value = match &expression.kind {
        ExpressionKind::Number(number) => Value::Number(*number),
        ExpressionKind::Hole => Value::Number(f64::NAN),
        ExpressionKind::Name(name) => match around.value(name) {
            Some(value) => value,
            None => return wrong(expression, format!("`{name}` has no value yet")),
        },
        ExpressionKind::Call(name, arguments) => call(expression, name, arguments, around)?,
        ExpressionKind::Component(of, name) => component(of, name, around)?,
        ExpressionKind::Unary(unary, of) => match (unary, evaluate(of, around)?) {
            (Unary::Minus, Value::Number(number)) => Value::Number(-number),
            (Unary::Minus, Value::Joints(joints)) => Value::Joints(joints.map(|angle| -angle)),
            (Unary::Not, Value::Number(number)) => truth(number == 0.0),
            (_, other) => return wrong(of, format!("expected a number, but this is {}", other.kind())),
        },
        ExpressionKind::Binary(binary, left, right) => {
            // Short circuit: the first operand may decide alone, as in `input(1) or risky`.
            let first = evaluate(left, around)?;
            match (binary, first) {
                (Binary::And, Value::Number(0.0)) => return Ok(truth(false)),
                (Binary::Or, Value::Number(number)) if number != 0.0 => return Ok(truth(true)),
                _ => {}
            }
            let second = evaluate(right, around)?;
            match combine(*binary, first, second) {
                Some(value) => value,
                None => {
                    let (a, b, op) = (first.kind(), second.kind(), binary.text());
                    return wrong(expression, format!("`{op}` does not go with {a} and {b}"));
                }
            }
        }
    };
    if let Value::Number(number) = value
        && !number.is_finite()
        && expression.kind != ExpressionKind::Hole
    {
        return wrong(expression, "this is not a finite number".to_owned());
    }
    Ok(value)
}

fn truth(holds: bool) -> Value {
    Value::Number(f64::from(u8::from(holds)))
}

fn whole(numbers: &[f64; 6]) -> bool {
    numbers.iter().all(|number| number.is_finite())
}

fn combine(binary: Binary, left: Value, right: Value) -> Option<Value> {
    Some(match (left, right) {
        (Value::Number(a), Value::Number(b)) => match binary {
            Binary::Or => truth(a != 0.0 || b != 0.0),
            Binary::And => truth(a != 0.0 && b != 0.0),
            Binary::Equal => truth(a == b),
            Binary::Unequal => truth(a != b),
            Binary::Less => truth(a < b),
            Binary::AtMost => truth(a <= b),
            Binary::Greater => truth(a > b),
            Binary::AtLeast => truth(a >= b),
            Binary::Plus => Value::Number(a + b),
            Binary::Minus => Value::Number(a - b),
            Binary::Times => Value::Number(a * b),
            Binary::Over => Value::Number(a / b),
        },
        (Value::Joints(a), Value::Joints(b)) => match binary {
            Binary::Plus => Value::Joints(std::array::from_fn(|i| a[i] + b[i])),
            Binary::Minus => Value::Joints(std::array::from_fn(|i| a[i] - b[i])),
            _ => return None,
        },
        (Value::Joints(a), Value::Number(b)) | (Value::Number(b), Value::Joints(a))
            if binary == Binary::Times =>
        {
            Value::Joints(a.map(|angle| angle * b))
        }
        (Value::Frame(a), Value::Frame(b)) if binary == Binary::Times => {
            Value::Frame(Transform::of_frame(&a).times(&Transform::of_frame(&b)).frame())
        }
        (Value::Frame(a), Value::Pose(b)) if binary == Binary::Times && whole(&b) => {
            Value::Pose(Transform::of_frame(&a).times(&Transform::of_pose(&b)).pose())
        }
        (Value::Pose(a), Value::Frame(b)) if binary == Binary::Times && whole(&a) => {
            Value::Pose(Transform::of_pose(&a).times(&Transform::of_frame(&b)).pose())
        }
        _ => return None,
    })
}

/// Evaluates an expression that must be a number.
///
/// # Errors
/// If the value is of another kind.
pub fn number(expression: &Expression, around: &dyn Surroundings) -> Outcome<f64> {
    match evaluate(expression, around)? {
        Value::Number(number) => Ok(number),
        other => wrong(expression, format!("expected a number, but this is {}", other.kind())),
    }
}

/// Evaluates a number within bounds.
///
/// # Errors
/// If the value is of another kind or out of bounds.
pub fn number_in(
    expression: &Expression,
    what: &str,
    low: f64,
    high: f64,
    around: &dyn Surroundings,
) -> Outcome<f64> {
    let value = number(expression, around)?;
    if (low..=high).contains(&value) {
        return Ok(value);
    }
    let bounds = format!("{what} must be from {} to {}, not {}", short(low), short(high), short(value));
    wrong(expression, bounds)
}

fn component(of: &Expression, name: &Name, around: &dyn Surroundings) -> Outcome<Value> {
    let value = evaluate(of, around)?;
    let (names, numbers) = match value {
        Value::Number(_) => return wrong(of, "a number has no components".to_owned()),
        Value::Joints(numbers) => (JOINT_COMPONENTS, numbers),
        Value::Pose(numbers) => (POSE_COMPONENTS, numbers),
        Value::Frame(numbers) => (FRAME_COMPONENTS, numbers),
    };
    match names.iter().position(|known| *known == name.text) {
        Some(place) if numbers[place].is_nan() => {
            wrong(of, format!("its `{}` is left open by `_`", name.text))
        }
        Some(place) => Ok(Value::Number(numbers[place])),
        None => {
            let message = format!("there is no `{}` in {}", name.text, value.kind());
            let mistake = Diagnostic::error("value", name.span, message);
            Err(Box::new(mistake.help(format!("there are {}", names.join(", ")))))
        }
    }
}

fn call(
    whole: &Expression,
    name: &Name,
    arguments: &[Expression],
    around: &dyn Surroundings,
) -> Outcome<Value> {
    // The functions `frame(pose)` and `inverse(frame)` take no numbers.
    match (name.text.as_str(), arguments) {
        ("frame", [of]) => {
            return match evaluate(of, around)? {
                Value::Pose(pose) if self::whole(&pose) => {
                    Ok(Value::Frame(Transform::of_pose(&pose).frame()))
                }
                other => wrong(of, format!("expected a whole pose, but this is {}", other.kind())),
            };
        }
        ("inverse", [of]) => {
            return match evaluate(of, around)? {
                Value::Frame(frame) => Ok(Value::Frame(Transform::of_frame(&frame).inverse().frame())),
                other => wrong(of, format!("expected a frame, but this is {}", other.kind())),
            };
        }
        _ => {}
    }
    let mut numbers = Vec::with_capacity(arguments.len());
    for argument in arguments {
        numbers.push(number(argument, around)?);
    }
    let six = || -> [f64; 6] { std::array::from_fn(|i| numbers.get(i).copied().unwrap_or(0.0)) };
    let (a, b) = (numbers.first().copied().unwrap_or(0.0), numbers.get(1).copied().unwrap_or(0.0));
    Ok(match (name.text.as_str(), numbers.len()) {
        ("joints", 0) => Value::Joints(around.joints()),
        ("joints", _) => Value::Joints(six()),
        ("pose", 0) => Value::Pose(around.pose()),
        ("pose", _) => Value::Pose(six()),
        ("frame", _) => Value::Frame(six()),
        ("input", _) => match around.input(a) {
            Some(on) => truth(on),
            None => {
                return wrong(
                    whole,
                    format!("there is no digital input {}: the inputs are 1 to 32", short(a)),
                );
            }
        },
        ("analogue", _) => match around.analogue(a) {
            Some(value) => Value::Number(value),
            None => {
                return wrong(
                    whole,
                    format!("there is no analogue input {}: the inputs are 1 and 2", short(a)),
                );
            }
        },
        ("time", _) => Value::Number(around.time()),
        ("cause", _) => Value::Number(f64::from(around.cause())),
        ("abs", _) => Value::Number(a.abs()),
        ("sqrt", _) => Value::Number(a.sqrt()),
        ("sin", _) => Value::Number(a.to_radians().sin()),
        ("cos", _) => Value::Number(a.to_radians().cos()),
        ("atan2", _) => Value::Number(a.atan2(b).to_degrees()),
        ("min", _) => Value::Number(a.min(b)),
        ("max", _) => Value::Number(a.max(b)),
        ("floor", _) => Value::Number(a.floor()),
        (other, _) => return wrong(whole, format!("there is no function `{other}`")),
    })
}
