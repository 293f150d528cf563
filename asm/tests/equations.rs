// SPDX-License-Identifier: MIT OR Apache-2.0
//! Values of equations: random equations on the emulator against their evaluation here, operation by operation in the order
//! written; equal parts, names that are written in between, limits.

use crate::common;
use crate::common::{assemble, bad, bundles, good};
use proptest::prelude::*;
use takt_asm::expr::Value;
use takt_asm::{Expression, listing};
use takt_emu::Emulator;
use takt_isa::fp::Host;
use takt_isa::{F1, F3, MACHINES, Op, Program, Type, compute};

/// An expression as a tree.
#[derive(Clone, Debug)]
enum Tree {
    /// A literal, in its spelling.
    Literal(&'static str),
    /// A register, by its name.
    Name(&'static str),
    Prefix(&'static str, Box<Tree>),
    Infix(&'static str, Box<Tree>, Box<Tree>),
    Call(&'static str, Vec<Tree>),
    Choice(Box<Tree>, Box<Tree>, Box<Tree>),
}

use Tree::{Call, Choice, Infix, Literal, Name, Prefix};

/// The precedence of the head of an expression.
fn level(tree: &Tree) -> u8 {
    match tree {
        Choice(..) => 0,
        Infix("==" | "!=" | "<" | "<=" | ">" | ">=", ..) => 1,
        Infix("|", ..) => 2,
        Infix("&", ..) => 3,
        Infix("<<" | ">>", ..) => 4,
        Infix("+" | "-", ..) => 5,
        Infix(..) => 6,
        Prefix(..) => 7,
        Literal(_) | Name(_) | Call(..) => 9,
    }
}

/// The text of an expression, with no more parentheses than it needs.
fn text(tree: &Tree) -> String {
    let at = |tree: &Tree, least: u8| {
        if level(tree) < least { format!("({})", text(tree)) } else { text(tree) }
    };
    match tree {
        Literal(text) => (*text).to_owned(),
        Name(name) => (*name).to_owned(),
        Prefix(operator, a) => format!("{operator}{}", at(a, 7)),
        Infix(operator, a, b) => format!("{} {operator} {}", at(a, level(tree)), at(b, level(tree) + 1)),
        Call(name, arguments) => {
            format!("{name}({})", arguments.iter().map(text).collect::<Vec<_>>().join(", "))
        }
        Choice(c, a, b) => format!("{} ? {} : {}", at(c, 1), text(a), text(b)),
    }
}

/// A value while an expression is evaluated.
#[derive(Clone, Copy, Debug)]
enum ExpectedValue {
    Constant(Value),
    Float(u32),
    Int(u32),
}

/// The registers of the test's programs.
type Registers = std::collections::BTreeMap<&'static str, u32>;

fn is_int(name: &str) -> bool {
    matches!(name, "n" | "k" | "j")
}

/// A constant part without a value, which the assembler reports.
struct NoValue;

fn bits(seen: ExpectedValue, ty: Type) -> Result<u32, NoValue> {
    match seen {
        ExpectedValue::Constant(value) => value.bits(ty).map_err(|_| NoValue),
        ExpectedValue::Float(bits) | ExpectedValue::Int(bits) => Ok(bits),
    }
}

fn run(op: Op, sources: &[ExpectedValue], ty: Type) -> Result<u32, NoValue> {
    let mut all = [0; 3];
    for (bits_of, source) in all.iter_mut().zip(sources) {
        *bits_of = bits(*source, ty)?;
    }
    Ok(compute::<Host>(op, all[0], all[1], all[2]).bits)
}

/// Value of an operation on constants. Computed from the operands' values: a decided choice drops its other alternative.
fn folded(tree: &Tree, operands: &[ExpectedValue]) -> Result<ExpectedValue, NoValue> {
    let written: Vec<String> = operands
        .iter()
        .map(|operand| match operand {
            ExpectedValue::Constant(Value::Int(value)) => format!("({value})"),
            ExpectedValue::Constant(Value::Real(value)) => format!("({value:?})"),
            ExpectedValue::Float(_) | ExpectedValue::Int(_) => String::new(),
        })
        .collect();
    let folded = match tree {
        Prefix(operator, _) => format!("{operator}{}", written[0]),
        Infix(operator, ..) => format!("{} {operator} {}", written[0], written[1]),
        Call(name, _) => format!("{name}({})", written.join(", ")),
        _ => text(tree),
    };
    let parsed = Expression::parse(&folded).map_err(|_| NoValue)?;
    parsed.evaluate(|_| None).map(ExpectedValue::Constant).map_err(|_| NoValue)
}

fn int_infix(operator: &str, a: u32, b: u32) -> Result<u32, NoValue> {
    let (x, y) = (a.cast_signed(), b.cast_signed());
    Ok(match operator {
        "+" => a.wrapping_add(b),
        "-" => a.wrapping_sub(b),
        "*" => a.wrapping_mul(b),
        "&" => a & b,
        "|" => a | b,
        "<<" => a << (b & 31),
        ">>" => (x >> (b & 31)).cast_unsigned(),
        "==" => u32::from(a == b),
        "!=" => u32::from(a != b),
        "<" => u32::from(x < y),
        "<=" => u32::from(x <= y),
        ">" => u32::from(x > y),
        ">=" => u32::from(x >= y),
        _ => return Err(NoValue),
    })
}

fn float_infix(operator: &str, operands: &[ExpectedValue]) -> Result<ExpectedValue, NoValue> {
    let (a, b) = (f32::from_bits(bits(operands[0], Type::F)?), f32::from_bits(bits(operands[1], Type::F)?));
    let truth = |condition: bool| ExpectedValue::Int(condition.into());
    Ok(match operator {
        "+" => ExpectedValue::Float(run(Op::fadd, operands, Type::F)?),
        "-" => ExpectedValue::Float(run(Op::fsub, operands, Type::F)?),
        "*" => ExpectedValue::Float(run(Op::fmul, operands, Type::F)?),
        "/" => ExpectedValue::Float(run(Op::fdiv, operands, Type::F)?),
        "==" => truth(a == b),
        "!=" => truth(a != b),
        "<" => truth(a < b),
        "<=" => truth(a <= b),
        ">" => truth(a > b),
        ">=" => truth(a >= b),
        _ => return Err(NoValue),
    })
}

/// Evaluates an expression: constant parts in binary64, all else by one operation each, in the order written.
fn evaluate(tree: &Tree, registers: &Registers) -> Result<ExpectedValue, NoValue> {
    let operands = match tree {
        Literal(_) | Name(_) => vec![],
        Prefix(_, a) => vec![evaluate(a, registers)?],
        Infix(_, a, b) => vec![evaluate(a, registers)?, evaluate(b, registers)?],
        Call(_, arguments) => {
            arguments.iter().map(|tree| evaluate(tree, registers)).collect::<Result<_, _>>()?
        }
        Choice(condition, a, b) => {
            let condition = evaluate(condition, registers)?;
            if let ExpectedValue::Constant(value) = condition {
                return evaluate(if value.is_zero() { b } else { a }, registers);
            }
            vec![condition, evaluate(a, registers)?, evaluate(b, registers)?]
        }
    };
    let constant = |operand: &ExpectedValue| matches!(operand, ExpectedValue::Constant(_));
    let folds = !matches!(tree, Name(_) | Choice(..) | Call("sat" | "sign" | "itof" | "ftoi", _));
    if folds && operands.iter().all(constant) {
        return folded(tree, &operands);
    }
    let is_int_one = |seen: &ExpectedValue| matches!(seen, ExpectedValue::Int(_));
    Ok(match tree {
        Literal(_) => return Err(NoValue),
        Name(name) if is_int(name) => ExpectedValue::Int(registers[name]),
        Name(name) => ExpectedValue::Float(registers[name]),
        Choice(..) => {
            let ty = if operands[1..].iter().any(is_int_one) { Type::I } else { Type::F };
            let chosen = operands[if bits(operands[0], Type::I)? != 0 { 1 } else { 2 }];
            let value = bits(chosen, ty)?;
            if ty == Type::I { ExpectedValue::Int(value) } else { ExpectedValue::Float(value) }
        }
        Prefix("!", _) => ExpectedValue::Int(u32::from(bits(operands[0], Type::I)? == 0)),
        Prefix(_, _) if is_int_one(&operands[0]) => {
            ExpectedValue::Int(bits(operands[0], Type::I)?.wrapping_neg())
        }
        Prefix(..) => ExpectedValue::Float(run(Op::fneg, &operands, Type::F)?),
        Infix(operator, ..) if operands.iter().any(is_int_one) => {
            let (a, b) = (bits(operands[0], Type::I)?, bits(operands[1], Type::I)?);
            ExpectedValue::Int(int_infix(operator, a, b)?)
        }
        Infix(operator, ..) => float_infix(operator, &operands)?,
        Call("xor", _) => ExpectedValue::Int(bits(operands[0], Type::I)? ^ bits(operands[1], Type::I)?),
        Call("itof", _) => ExpectedValue::Float(run(Op::itof, &operands, Type::I)?),
        Call("ftoi", _) => ExpectedValue::Int(run(Op::ftoi, &operands, Type::F)?),
        Call(name, _) => {
            let op = match *name {
                "sqrt" => Op::fsqrt,
                "abs" => Op::fabs,
                "sign" => Op::fsign,
                "min" => Op::fmin,
                "max" => Op::fmax,
                "sat" => Op::fsat,
                "sin" => Op::fsin,
                "cos" => Op::fcos,
                _ => return Err(NoValue),
            };
            ExpectedValue::Float(run(op, &operands, Type::F)?)
        }
    })
}

/// Trees from a stream of choices, which proptest generates and shrinks.
struct Choices<'c>(std::slice::Iter<'c, u8>);

impl Choices<'_> {
    fn below(&mut self, n: u8) -> u8 {
        self.0.next().map_or(0, |byte| byte % n)
    }

    fn one(&mut self, of: &[&'static str]) -> &'static str {
        of[usize::from(self.below(of.len() as u8))]
    }

    fn boxed(&mut self, float: bool, depth: u8) -> Box<Tree> {
        Box::new(if float { self.float(depth) } else { self.int(depth) })
    }

    fn float(&mut self, depth: u8) -> Tree {
        if depth == 0 {
            return match self.below(8) {
                0 => Literal(self.one(&["2", "0.5", "3.1", "1e-3", "7"])),
                _ => Name(self.one(&["x", "y", "t", "u", "v"])),
            };
        }
        let d = depth - 1;
        match self.below(10) {
            0 => self.float(0),
            1 => Prefix("-", self.boxed(true, d)),
            2..=6 => Infix(self.one(&["+", "-", "*", "/"]), self.boxed(true, d), self.boxed(true, d)),
            7 => match self.below(3) {
                0 => Call(self.one(&["sqrt", "abs", "sin", "cos"]), vec![self.float(d)]),
                1 => Call("sign", vec![Infix("+", Box::new(Name("x")), self.boxed(true, d))]),
                _ => Call("itof", vec![Infix("+", Box::new(Name("n")), self.boxed(false, d))]),
            },
            8 => match self.below(3) {
                0 => Call(self.one(&["min", "max"]), vec![self.float(d), self.float(d)]),
                _ => Call("sat", vec![Name(self.one(&["x", "u"])), self.float(d)]),
            },
            _ => Choice(self.boxed(false, d), Box::new(Name(self.one(&["x", "v"]))), self.boxed(true, d)),
        }
    }

    fn int(&mut self, depth: u8) -> Tree {
        if depth == 0 {
            return match self.below(6) {
                0 => Literal(self.one(&["0", "1", "3", "17"])),
                _ => Name(self.one(&["n", "k", "j"])),
            };
        }
        let d = depth - 1;
        const COMPARE: &[&str] = &["==", "!=", "<", "<=", ">", ">="];
        match self.below(9) {
            0 => self.int(0),
            1 => Prefix(self.one(&["-", "!"]), self.boxed(false, d)),
            2 | 3 => Infix(self.one(&["+", "-", "&", "|", "*"]), self.boxed(false, d), self.boxed(false, d)),
            4 => Infix(self.one(&["<<", ">>"]), self.boxed(false, d), Box::new(Literal("3"))),
            5 => Infix(self.one(COMPARE), self.boxed(true, d), self.boxed(true, d)),
            6 => Infix(self.one(COMPARE), self.boxed(false, d), self.boxed(false, d)),
            7 => match self.below(2) {
                0 => Call("xor", vec![self.int(d), self.int(d)]),
                _ => Call("ftoi", vec![Infix("*", Box::new(Name("y")), self.boxed(true, d))]),
            },
            _ => Choice(self.boxed(false, d), Box::new(Name(self.one(&["n", "k"]))), self.boxed(false, d)),
        }
    }
}

/// Some equations: targets and values.
fn equations(choices: &[u8]) -> Vec<(&'static str, Tree)> {
    let mut choices = Choices(choices.iter());
    (0..6)
        .map(|_| {
            let target = choices.one(&["t", "u", "v", "k", "j"]);
            let depth = choices.below(5);
            (target, if is_int(target) { choices.int(depth) } else { choices.float(depth) })
        })
        .collect()
}

const STATES: [&str; 5] = ["t", "u", "v", "k", "j"];
const VALUES: [u32; 8] =
    [0x3f80_0000, 0xc020_0000, 0x0000_0000, 0x8000_0000, 0x7f80_0000, 0x7fc0_0000, 0x0000_0007, 0x42f6_e979];

/// A program of these equations, in three periods.
fn source(equations: &[(&'static str, Tree)], ports: &str) -> String {
    let mut source = format!(
        ".ports {ports}\n.schedule on\n.input x, y, n:int\n.state t, u, v, k:int, j:int\n\
         .output ot, ou, ov, ok:int, oj:int\n.once\n t, u, v, k, j = 1, 2, 3, 4, 5\n wait period\n.period\nperiod:\n"
    );
    for (target, tree) in equations {
        source.push_str(&format!(" {target} = {}\n", text(tree)));
    }
    source.push_str(" ot, ou, ov, ok, oj = t, u, v, k, j\n wait period\n");
    source
}

fn set(emulator: &mut Emulator, program: &Program, name: &str, bits: u32) {
    if let Some(port) = program.inputs.iter().find(|port| port.name == name) {
        emulator.set_input_bits(port.register, bits).expect("it is an input");
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 120, ..ProptestConfig::default() })]

    /// On every machine, bit for bit, with NaNs and infinities among the values.
    #[test]
    fn equations_compute_the_written_values(choices in prop::collection::vec(any::<u8>(), 1..160), latched in any::<bool>()) {
        let equations = equations(&choices);
        let source = source(&equations, if latched { "latched" } else { "direct" });
        let mut expected: Registers = [("t", 1.0f32), ("u", 2.0), ("v", 3.0)].map(|(name, value)| (name, value.to_bits())).into();
        expected.extend([("k", 4), ("j", 5)]);
        let mut outputs: Vec<Option<Registers>> = Vec::new();
        for period in 0..3 {
            let values = |i: usize| VALUES[(usize::from(choices[0]) + 3 * i + 5 * period) % VALUES.len()];
            expected.extend([("x", values(0)), ("y", values(1)), ("n", values(2))]);
            for (target, tree) in &equations {
                let ty = if is_int(target) { Type::I } else { Type::F };
                let value = evaluate(tree, &expected).and_then(|seen| bits(seen, ty));
                let Ok(value) = value else {
                    // A constant part without a value: exactly one error, at its place.
                    let report = bad(&source, &F3);
                    let mut errors = report.list.iter().filter(|d| d.severity == takt_asm::diag::Severity::Error);
                    prop_assert!(errors.all(|error| error.code == "expression"), "{source}{}", report.render(false));
                    return Ok(());
                };
                expected.insert(target, value);
            }
            outputs.push(Some(expected.clone()));
        }
        for machine in MACHINES {
            // The search for short schedules is not under test.
            let options = takt_asm::Options { effort: 0, ..common::options(machine) };
            let assembled = takt_asm::assemble("test.s", &takt_asm::MemoryLoader::of("test.s", source.as_str()), &options);
            let assembled = match assembled {
                Ok(assembled) => assembled,
                Err(report) => return Err(TestCaseError::fail(format!("{source}{}", report.render(false)))),
            };
            let program = &assembled.program;
            let mut emulator = Emulator::new(program).expect("it fits");
            for (period, outputs) in outputs.iter().flatten().enumerate() {
                for name in ["x", "y", "n"] {
                    set(&mut emulator, program, name, outputs[name]);
                }
                emulator.run_period(&[]).expect("it runs");
                for name in STATES {
                    let port = program.outputs.iter().find(|port| port.name == format!("o{name}"));
                    let seen = emulator.register(port.expect("it is declared").register);
                    prop_assert_eq!(seen, Some(outputs[name]), "{} on {}, period {}:\n{}", name, machine.name, period, source);
                }
            }
        }
    }
}

/// The operations of a period with these lines, none scheduled.
fn period(declarations: &str, lines: &str) -> Vec<String> {
    let source = format!(
        ".input x, y, n:int\n.output a, b\n.reg t u v w\n{declarations}\n.once\n t, u, v, w = 0, 0, 0, 0\n wait period\n.period\nperiod:\n{lines}\n wait period\n"
    );
    let assembled = good(&source);
    let start = assembled.program.sections[1].start.index();
    bundles(&assembled)[start..].to_vec()
}

fn count(operations: &[String], mnemonic: &str) -> usize {
    operations.iter().filter(|operation| operation.starts_with(mnemonic)).count()
}

#[test]
fn equal_parts_are_computed_once() {
    let once = |declarations: &str, lines: &str| count(&period(declarations, lines), "fmul");
    // Shared within an equation, ports included.
    assert_eq!(once("", " a = x*y + x*y\n b = t"), 1);
    // In the equations of a run.
    assert_eq!(once("", " a = t*u + 1\n b = t*u - 1"), 1);
    // If the part is a whole equation, its register has the value.
    assert_eq!(once("", " v = t*u\n a = t*u - 1\n b = v"), 1);
    // A value is not reused once a source of it, or its register, is written.
    assert_eq!(once("", " a = t*u + 1\n t = x\n b = t*u - 1"), 2);
    assert_eq!(once("", " a = t*u + 1\n fadd t, x, y\n b = t*u - 1"), 2);
    assert_eq!(once("", " v = t*u\n v = x\n a = t*u - 1\n b = v"), 2);
    // Not across a label, a branch, a loop's head, or an operation on the flags.
    assert_eq!(once("", " a = t*u + 1\nhere:\n b = t*u - 1"), 2);
    assert_eq!(once("", " a = t*u + 1\n bz n, period\n b = t*u - 1"), 2);
    assert_eq!(once("", " a = t*u + 1\n clrflags\n b = t*u - 1"), 2);
    assert_eq!(once("", " a = t*u + 1\n .loop_bound 3\n b = t*u - 1"), 2);
    // A port that may change is read again in each equation; a latched one is not.
    assert_eq!(once("", " a = x*y + 1\n b = x*y - 1"), 2);
    assert_eq!(once(".ports latched", " a = x*y + 1\n b = x*y - 1"), 1);
    // The order of a sum is kept: these are different parts.
    assert_eq!(once("", " a = t*u*v\n b = u*v*t"), 4);
}

/// A jump by number between a shared computation and its use would skip the computation.
#[test]
fn jumps_by_number_do_not_skip_shared_subexpressions() {
    let text = |target: u32| {
        format!(
            ".input x, n:int\n.output a, b\n.reg t\n.once\n t = x\n wait period\n.period\nperiod: bz n, {target}\n a = t*t + 1\n b = t*t - 1\n wait period\n"
        )
    };
    let codes =
        |report: takt_asm::diag::Diagnostics| report.list.iter().map(|error| error.code).collect::<Vec<_>>();
    // Bundles: mov, wait, bz, fmul, fadd, fsub, wait.
    assert!(assemble(&text(3), &F3).is_ok());
    assert_eq!(codes(bad(&text(4), &F3)), ["target"]);
    assert_eq!(codes(bad(&text(5), &F3)), ["target"]);
    assert!(assemble(&text(6), &F3).is_ok());
}

#[test]
fn constants_are_folded_where_they_are_a_part() {
    let products = |line: &str| count(&period("", &format!("{line}\n b = t")), "fmul");
    assert_eq!(products(" a = x*(2*pi/3)"), 1);
    assert_eq!(products(" a = 2*pi/3*x"), 1);
    // In the order written: (x·2)·π.
    assert_eq!(products(" a = x*2*pi"), 2);
    // A division remains a division.
    assert_eq!((products(" a = x/3"), count(&period("", " a = x/3\n b = t"), "fdiv")), (0, 1));
}

/// An instruction that the machine lacks is an error at the operator; a choice by `has.` computes only instructions of the
/// machine.
#[test]
fn reports_operations_that_the_machine_lacks() {
    let lacks = |row: &&takt_isa::Row| F1.host(row.function).is_none() && !row.forms.is_empty();
    for row in takt_isa::ROWS.iter().filter(lacks) {
        let form = row.forms[0];
        let text = |value: &str| {
            format!(".input a, b, c\n.output y\n.once\n wait p\n.period\np: y = {value}\n wait p\n")
        };
        let report = bad(&text(form), &F1);
        assert_eq!(report.list[0].code, "no-unit", "{}", report.render(false));
        let chosen = format!("has.{} ? {form} : a*b*c", row.mnemonic);
        assert!(assemble(&text(&chosen), &F1).is_ok());
    }
}

/// Thousands of names, as generated code has them.
#[test]
fn many_temporaries() {
    let names: Vec<String> = (0..5000).map(|i| format!("_u{i}")).collect();
    let mut text = format!(
        ".schedule on\n.input x, y\n.output a\n.reg t[400]\n.reg {}\n.once\n wait p\n.period\np: t[1] = x + y\n",
        names.join(" ")
    );
    for i in 2..=400 {
        text.push_str(&format!(" t[{i}] = t[{}]*3 + x\n", 1 + i / 2));
    }
    text.push_str(" a = t[400]\n wait p\n");
    let program = good(&text).program;
    assert!(program.bundles() < 1024);
    assert!(program.registers.iter().all(|port| !port.name.starts_with('=')));
}

/// Each word of an equation knows its part of the line, and the image keeps it.
#[test]
fn words_know_their_part_of_the_line() {
    let text = ".input x, y\n.output a\n.once\n wait p\n.period\np: a = sqrt(x*x + y*y)\n wait p\n";
    let assembled = good(text);
    let program = &assembled.program;
    let line: Vec<char> = text.lines().nth(5).expect("there are so many").chars().collect();
    let parts: Vec<String> = program
        .parts
        .iter()
        .map(|(_, part)| line[part.first as usize - 1..part.last as usize].iter().collect())
        .collect();
    assert_eq!(parts, ["x*x", "y*y", "x*x + y*y", "sqrt(x*x + y*y)"]);
    assert_eq!(program.word_place(program.parts[1].0 as usize).as_deref(), Some("test.s:6:19-21"));
    let listing = listing::listing(&assembled);
    assert!(listing.contains("; x*x + y*y\n"), "{listing}");
    let image = takt_asm::image::write(program).expect("an image holds it");
    assert_eq!(takt_asm::image::read(&image).as_ref(), Ok(program));
}

#[test]
fn limits_are_finite() {
    let code = |line: &str, declarations: &str| {
        let text = format!(
            ".input x\n.output a\n{declarations}\n.once\n wait p\n.period\np:\n a = x\n {line}\n wait p\n"
        );
        let report = bad(&text, &F3);
        assert_eq!(report.list.len(), 1, "{}", report.render(false));
        report.list[0].code
    };
    assert_eq!(code("a = sum(i, 1, 5000000, 0)", ""), "limit");
    assert_eq!(code("a = sum(i, 1, 5000, sum(j, 1, 5000, 0))", ""), "limit");
    assert_eq!(code(&format!("a = {}x", "x ? 1 : ".repeat(200)), ""), "limit");
    assert_eq!(code(&format!("a = {}x{}", "(".repeat(200), ")".repeat(200)), ""), "limit");
    assert_eq!(code("", ".reg P[300,300]"), "limit");
    assert_eq!(code("", ".reg P[1,1,1,1,1,1,1,1,1]"), "limit");
    let names: Vec<String> = (1..=65).map(|i| format!("t[{i}]")).collect();
    let values = vec!["x"; 65].join(", ");
    assert_eq!(code(&format!("{} = {values}", names.join(", ")), ".reg t[65]"), "limit");
    // An expression that is long, but not deep, is read.
    let long = vec!["x*x"; 200].join(" + ");
    assert!(
        good(&format!(".input x\n.output a\n.once\n wait p\n.period\np: a = {long}\n wait p\n"))
            .program
            .bundles()
            > 200
    );
}

/// `.fast` allows rewrites that round otherwise; without it nothing changes.
#[test]
fn fast_allows_only_the_named_rewrites() {
    let lines = " a = x + t - u + 3 - v + w - 5 + y\n b = x/3*t";
    let text = |fast: &str| {
        format!(
            ".schedule on\n{fast}.input x, y, t, u, v, w\n.output a, b\n.once\n wait period\n.period\nperiod:\n{lines}\n wait period\n"
        )
    };
    let run = |fast: &str| {
        let program = good(&text(fast)).program;
        let mut emulator = Emulator::new(&program).expect("it fits");
        for (port, value) in program.inputs.iter().zip([1.0f32, 20.0, 300.0, 4000.0, 50_000.0, 600_000.0]) {
            emulator.set_input_bits(port.register, value.to_bits()).expect("it is an input");
        }
        emulator.run_period(&[]).expect("it runs");
        let report = emulator.run_period(&[]).expect("it runs");
        let output = |number: usize| {
            let register = program.outputs[number].register;
            f32::from_bits(emulator.register(register).expect("it is written"))
        };
        (output(0), output(1), report.cycles, bundles(&good(&text(fast))))
    };
    let (a, b, cycles, written) = run("");
    // All of it is exact but the quotient: 1 + 300 - 4000 + 3 - 50000 + 600000 - 5 + 20.
    assert_eq!((a, b), (546_319.0, 1.0 / 3.0 * 300.0));
    assert_eq!(run(".fast off\n"), (a, b, cycles, written.clone()));
    let (sum, product, shorter, _) = run(".fast reassociate\n");
    assert_eq!(sum, a);
    assert!((product - b).abs() <= 1e-4);
    assert!(shorter < cycles, "{shorter} cycles, {cycles} in the order written");
    let (_, _, _, multiplied) = run(".fast reciprocal\n");
    let quotients = |bundles: &[String]| bundles.iter().filter(|bundle| bundle.contains("fdiv")).count();
    assert_eq!((quotients(&written), quotients(&multiplied)), (1, 0));
    // Two constants of the sum become one.
    let sums = |bundles: &[String]| {
        bundles
            .iter()
            .map(|bundle| bundle.matches("fadd").count() + bundle.matches("fsub").count())
            .sum::<usize>()
    };
    assert_eq!((sums(&written), sums(&run(".fast reassociate, reciprocal\n").3)), (7, 6));
    let report = bad(&text(".fast associate\n"), &F3);
    assert_eq!(report.list[0].code, "fast");
}

/// An array counts as used if any value of any element is used.
#[test]
fn arrays_are_used_as_a_whole() {
    let warnings = |lines: &str| {
        let text = format!(
            ".schedule on\n.input x\n.output a\n.reg t[3]\n.once\n wait p\n.period\np:\n{lines} wait p\n"
        );
        good(&text).warnings.list.iter().map(|warning| warning.message.clone()).collect::<Vec<_>>()
    };
    assert_eq!(warnings(" t[1] = x\n t[1] = x*x\n t[2] = x\n a = t[1]\n"), [""; 0]);
    assert_eq!(warnings(" a = x\n"), ["register `t` is never used"]);
    assert_eq!(warnings(" t[1] = x\n a = x\n"), ["register `t` is written and never read"]);
}

/// A macro may write its result from several slots, and an argument may be computed for it.
#[test]
fn macros_are_functions() {
    let text = ".schedule on\n.input x, y\n.output a\n\
        .macro poly d, u, k\n d = u*u\n d = d + k\n fabs d, d\n.endm\n.macro twice d, u\n fadd d, u, u\n.endm\n\
        .once\n wait p\n.period\np: a = poly(x - y, -2*4) + twice(poly(twice(y), x))*0.5\n wait p\n";
    for machine in MACHINES {
        let program = match assemble(text, machine) {
            Ok(assembled) => assembled.program,
            Err(report) => panic!("{}", report.render(false)),
        };
        let mut emulator = Emulator::new(&program).expect("it fits");
        set(&mut emulator, &program, "x", 5.0f32.to_bits());
        set(&mut emulator, &program, "y", 1.5f32.to_bits());
        emulator.run_period(&[]).expect("it runs");
        let a = emulator.register(program.outputs[0].register);
        assert_eq!(a.map(f32::from_bits), Some(4.25 + 14.0), "{}", machine.name);
    }
}

/// A register with a given place is written by the slot of its bank, even if several slots have the unit.
#[test]
fn placed_registers_are_written_by_their_slot() {
    for machine in MACHINES {
        for (index, slot) in machine.slots.iter().enumerate() {
            let hosts = |op: Op| {
                let of = |slot: &takt_isa::Slot| {
                    slot.units.iter().any(|unit| unit.functions.contains(&op.row().function))
                };
                machine.slots.iter().filter(|slot| of(slot)).count() > 1 && of(&machine.slots[index])
            };
            let some = takt_isa::ROWS.iter().find(|row| {
                hosts(row.op)
                    && row
                        .forms
                        .iter()
                        .any(|form| form.contains("a, b") || form.contains("a + b") || form.contains("a & b"))
            });
            let Some(row) = some else { continue };
            let ty = |index: usize| match row.types.get(index) {
                Some(Type::F) => "float",
                Some(Type::I) => "int",
                Some(Type::B) | None => "bits",
            };
            let [t, a, b, c] = [0, 1, 2, 3].map(ty);
            let text = format!(
                ".schedule on\n.input a:{a}, b:{b}, c:{c}\n.output y:{t}\n.reg t:{t} @ {}7\n.once\n wait p\n.period\np: t = {}\n y = t\n wait p\n",
                slot.bank.name, row.forms[0]
            );
            if let Err(report) = assemble(&text, machine) {
                panic!("{} on {}: {}", row.mnemonic, machine.name, report.render(false));
            }
        }
    }
}

/// A load has the type of its table's words, with an index or without; a store of another type is counted.
#[test]
fn loads_have_the_type_of_their_table() {
    let source = |load: &str, equation: &str| {
        format!(
            ".input x, i:int\n.output y\n.reg d\n.data\nV: .float 1.5, 2.5\nW: .word 1, 2\nS: .space 4\n.period\np: {load}\n y = {equation}\n wait p\n"
        )
    };
    for place in ["V[i]", "V+1", "V", "V[1]", "S[i]", "[i]", "S"] {
        good(&source(&format!("ld d, {place}"), "d*x"));
    }
    for place in ["W[i]", "W+1", "W", "W[1]", "S[i]", "[i]"] {
        good(&source(&format!("ld d, {place}"), "itof(d)*x"));
    }
    let refused = |load: &str, equation: &str, help: &str| {
        let text = bad(&source(load, equation), &F3).render(false);
        assert!(text.contains(help), "{load}, {equation}: {text}");
    };
    for place in ["W[i]", "W+1", "W"] {
        refused(&format!("ld d, {place}"), "d*x", "`itof(d)`");
    }
    for place in ["V[i]", "V+1", "V"] {
        refused(&format!("ld d, {place}"), "itof(d)", "`d` is a float");
    }
    // The words of a table with floats and integers may be either; so may the words of a table that another type is stored in.
    good(&source("ld d, V[i]", "d*x").replace(".float 1.5, 2.5", ".float 1.5\n .word 2"));
    good(&source("st V[i], i\n ld d, V[i]", "itof(d)"));
    good(&source("ld d:int, V[i]", "itof(d)"));
    // A label within a table does not end the table.
    good(&source("ld d, V[i]", "itof(d)").replace("2.5\n", "2.5\n_part: .word 1\n"));
}

/// Elements stand wherever registers do.
#[test]
fn elements_have_presets_and_ranges() {
    let text = ".input q\n.output y\n.reg k[2] t\n.state s[2,2]\n.const N = 2\n.preset k[1] = 0.5\n.preset k[N] = 1.5\n\
                .rep i, 1, 2\n.rep j, 1, 2\n.preset s[i,j] = i + 10*j\n.endr\n.endr\n.range s[1,2], q = -1, 1\n\
                .macro half v\n.preset v[1] = 2\n.endm\n.reg w[1]\n half w\n.period\n\
                p: t = k[1]*q + k[2]*s[2,1] + w[1]\n s[2,1] = t\n s[1,2] = t\n y = s[1,1] + s[1,2] + s[2,2]\n wait p\n";
    let program = good(text).program;
    let preset = |name: &str| {
        let register = program.registers.iter().find(|port| port.name == name).expect("it is named").register;
        let bits = program.constants.iter().find(|constant| constant.0 == register).expect("it is preset").1;
        f32::from_bits(bits)
    };
    let all = ["k[1]", "k[2]", "s[1,1]", "s[1,2]", "s[2,1]", "s[2,2]", "w[1]"].map(preset);
    assert_eq!(all, [0.5, 1.5, 11.0, 21.0, 12.0, 22.0, 2.0]);
    assert_eq!(program.ranges.len(), 2);
    for (wrong, said) in [
        (".preset k = 1", "this register is preset already"),
        (".preset k[3] = 1", "has no element 3"),
        (".preset k[1,1] = 1", "has 1 index, not 2"),
        (".preset t[1] = 1", "is a register, not an array"),
        (".preset @m3[1] = 1", "a register is needed here"),
        (".preset k[1] 3", "expected `=`"),
    ] {
        let report = bad(&format!("{text}{wrong}\n"), &F3).render(false);
        assert!(report.contains(said), "{wrong}: {report}");
    }
}
