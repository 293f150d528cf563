// SPDX-License-Identifier: MIT OR Apache-2.0
//! Values of every type in every place: the right value, or an error with advice, but never the bits of another type.
//!
//! The operators and functions come from the instruction table; their expected values are Rust's arithmetic. Places are ports,
//! registers, elements, presets, constants, words of data, alternatives, several targets of one equation, arguments of macros.

use crate::common::{assemble, bad};
use takt_emu::Emulator;
use takt_isa::{F3, Program, ROWS, Type};

/// An operand: text and value.
#[derive(Clone, Copy, Debug)]
enum Operand {
    /// A literal or a constant.
    Number(&'static str, f64),
    Float(&'static str, f32),
    Int(&'static str, i32),
}

use Operand::{Float, Int, Number};

/// Values of every kind, whose bits would be different numbers as another type.
const OPERANDS: &[Operand] = &[
    Number("2.5", 2.5),
    Number("4.0", 4.0),
    Number("3", 3.0),
    Number("C", 0.75),
    Number("N", 5.0),
    Float("x", 0.625),
    Float("t", -1.5),
    Float("A[2]", 1.25),
    Int("n", 7),
    Int("k", -9),
    Int("K[2]", 6),
];

const HEAD: &str = "
.const C = 0.75
.const N = 5
.input x, n:int
.output y, m:int
.reg t s:float k:int j:int P[2] Q[2]:int
.array A[3] = 1, 1.25, 2
.array K[3]:int = 5, 6, 7
";

/// Runs lines that assemble without warnings, and returns an output; an error otherwise.
fn run(declarations: &str, lines: &str, output: &str) -> Result<u32, String> {
    let text = format!(
        "{HEAD}{declarations}.once\n wait period\n.period\nperiod: t = -1.5\n k = -9\n{lines}\n wait period\n"
    );
    let assembled = assemble(&text, &F3).map_err(|report| report.render(false))?;
    // Warnings count as errors, except for unused names.
    if assembled.warnings.list.iter().any(|warning| warning.code != "unused") {
        return Err(assembled.warnings.render(false));
    }
    Ok(result(&assembled.program, output))
}

fn result(program: &Program, output: &str) -> u32 {
    let mut emulator = Emulator::new(program).expect("it fits");
    for (port, bits) in program.inputs.iter().zip([0.625f32.to_bits(), 7]) {
        emulator.set_input_bits(port.register, bits).expect("it is an input");
    }
    for _ in 0..2 {
        emulator.run_period(&[]).expect("it runs");
    }
    let port = program.outputs.iter().find(|port| port.name == output).expect("it is declared");
    emulator.register(port.register).expect("it is written")
}

/// A value of a known type.
#[derive(Clone, Copy, PartialEq, Debug)]
enum Value {
    /// Value of constants only: it takes the type that its use requires.
    Open(f64),
    Single(f32),
    Word(i32),
}

impl Value {
    /// The bits of the value in a type, if it has any.
    fn bits(self, ty: Type) -> Option<u32> {
        match (self, ty) {
            (Value::Open(value), Type::F) => Some((value as f32).to_bits()),
            (Value::Open(value), Type::I) => {
                (value == value.trunc() && value.abs() < 2e9).then_some((value as i32).cast_unsigned())
            }
            (Value::Single(value), Type::F) => Some(value.to_bits()),
            (Value::Word(value), Type::I) => Some(value.cast_unsigned()),
            _ => None,
        }
    }

    fn single(self) -> Option<f32> {
        self.bits(Type::F).map(f32::from_bits)
    }

    fn word(self) -> Option<i32> {
        self.bits(Type::I).map(u32::cast_signed)
    }
}

impl Operand {
    fn text(self) -> &'static str {
        let (Number(text, _) | Float(text, _) | Int(text, _)) = self;
        text
    }

    fn value(self) -> Value {
        match self {
            Number(_, value) => Value::Open(value),
            Float(_, value) => Value::Single(value),
            Int(_, value) => Value::Word(value),
        }
    }
}

fn flag(condition: bool) -> Option<Value> {
    Some(Value::Word(condition.into()))
}

/// Rust's value of a symbol on floats.
fn of_floats(symbol: &str, a: &[f32]) -> Option<Value> {
    let single = |value: f32| Some(Value::Single(value));
    match (symbol, a) {
        ("+", [a, b]) => single(a + b),
        ("-", [a, b]) => single(a - b),
        ("*", [a, b]) => single(a * b),
        ("/", [a, b]) => single(a / b),
        ("-", [a]) => single(-a),
        ("==", [a, b]) => flag(a == b),
        ("!=", [a, b]) => flag(a != b),
        ("<", [a, b]) => flag(a < b),
        ("<=", [a, b]) => flag(a <= b),
        (">", [a, b]) => flag(a > b),
        (">=", [a, b]) => flag(a >= b),
        ("sqrt", [a]) => single(a.sqrt()),
        ("sin", [a]) => single(a.sin()),
        ("cos", [a]) => single(a.cos()),
        ("acos", [a]) => single(a.acos()),
        ("atan2", [a, b]) => single(a.atan2(*b)),
        ("abs", [a]) => single(a.abs()),
        ("sign", [a]) => single(a.signum()),
        ("min", [a, b]) => single(a.min(*b)),
        ("max", [a, b]) => single(a.max(*b)),
        ("sat", [a, b]) => single(a.clamp(-b.abs(), b.abs())),
        ("ftoi", [a]) => Some(Value::Word(a.round_ties_even() as i32)),
        ("fma", [a, b, c]) => single(a.mul_add(*b, *c)),
        ("fms", [a, b, c]) => single(a.mul_add(*b, -c)),
        ("fnma", [a, b, c]) => single((-a).mul_add(*b, *c)),
        ("fnms", [a, b, c]) => single((-a).mul_add(*b, -c)),
        _ => None,
    }
}

/// Rust's value of a symbol on integers.
fn of_integers(symbol: &str, a: &[i32]) -> Option<Value> {
    let word = |value: i32| Some(Value::Word(value));
    match (symbol, a) {
        ("+", [a, b]) => word(a.wrapping_add(*b)),
        ("-", [a, b]) => word(a.wrapping_sub(*b)),
        ("-", [a]) => word(a.wrapping_neg()),
        ("&", [a, b]) => word(a & b),
        ("|", [a, b]) => word(a | b),
        ("xor", [a, b]) => word(a ^ b),
        ("mul24", [a, b]) => {
            let of_24_bits = |n: &i32| n.wrapping_shl(8) >> 8;
            word(of_24_bits(a).wrapping_mul(of_24_bits(b)))
        }
        ("<<", [a, b]) => word(a.wrapping_shl(b.cast_unsigned())),
        (">>", [a, b]) => word(a.wrapping_shr(b.cast_unsigned())),
        ("!", [a]) => word((*a == 0).into()),
        ("==", [a, b]) => flag(a == b),
        ("!=", [a, b]) => flag(a != b),
        ("<", [a, b]) => flag(a < b),
        ("<=", [a, b]) => flag(a <= b),
        (">", [a, b]) => flag(a > b),
        (">=", [a, b]) => flag(a >= b),
        ("itof", [a]) => Some(Value::Single(*a as f32)),
        _ => None,
    }
}

/// The value of a form; `None` if the form does not exist between these types.
fn evaluate(symbol: &str, operands: &[Operand]) -> Option<Value> {
    let values: Vec<Value> = operands.iter().map(|operand| operand.value()).collect();
    let typed: &[Value] = if symbol == "?:" { &values[1..] } else { &values };
    let float = typed.iter().any(|value| matches!(value, Value::Single(_)));
    let int = typed.iter().any(|value| matches!(value, Value::Word(_)));
    let made = symbol == "?:" && matches!(values[0], Value::Open(_));
    if float && int && !made {
        return None;
    }
    if symbol == "?:" {
        let condition = match values[0] {
            Value::Open(value) => value != 0.0,
            condition => condition.word()? != 0,
        };
        let chosen = values[if condition { 1 } else { 2 }];
        // A choice with a constant condition drops its other alternative.
        if let Value::Open(_) = values[0] {
            return Some(chosen);
        }
        return match (float, int) {
            (true, _) => chosen.single().map(Value::Single),
            (_, true) => {
                let all = typed.iter().all(|value| value.word().is_some());
                chosen.word().filter(|_| all).map(Value::Word)
            }
            // Two computed alternatives, one of which is not an integer.
            _ if typed.iter().any(|value| value.word().is_none()) => chosen.single().map(Value::Single),
            _ => Some(chosen),
        };
    }
    let singles: Option<Vec<f32>> = values.iter().map(|value| value.single()).collect();
    let words: Option<Vec<i32>> = values.iter().map(|value| value.word()).collect();
    if int {
        // Quotients are by a power of two.
        if let ("*" | "/" | "%", [a, b]) = (symbol, &words.clone()?[..]) {
            return match symbol {
                "*" => Some(Value::Word(a.wrapping_mul(*b))),
                _ if !matches!(values[1], Value::Open(_)) || !b.unsigned_abs().is_power_of_two() => None,
                "/" => Some(Value::Word(a.wrapping_div(*b))),
                _ => Some(Value::Word(a.wrapping_rem(*b))),
            };
        }
        return of_integers(symbol, &words?);
    }
    let of_floats = of_floats(symbol, &singles?);
    if of_floats.is_none() && !float { of_integers(symbol, &words?) } else { of_floats }
}

/// A form as an equation writes it.
fn written(symbol: &str, operands: &[Operand]) -> String {
    let texts: Vec<&str> = operands.iter().map(|operand| operand.text()).collect();
    let is_name = symbol.starts_with(|c: char| c.is_ascii_alphabetic());
    match texts[..] {
        [c, a, b] if symbol == "?:" => format!("{c} ? {a} : {b}"),
        [a, b] if !is_name => format!("{a} {symbol} {b}"),
        [a] if !is_name && symbol.is_empty() => a.to_owned(),
        [a] if !is_name => format!("{symbol}{a}"),
        _ => format!("{symbol}({})", texts.join(", ")),
    }
}

/// Every symbol that equations have, with its number of operands.
fn symbols() -> Vec<(String, usize)> {
    let mut all: Vec<(String, usize)> =
        ROWS.iter().flat_map(|row| row.forms()).map(|form| (form.symbol, form.sources.len())).collect();
    for symbol in ["!=", "<=", ">=", ">", "%"] {
        all.push((symbol.to_owned(), 2));
    }
    all.retain(|(symbol, _)| !symbol.is_empty());
    all.sort();
    all.dedup();
    all
}

/// All lists of `count` operands.
fn lists(count: usize) -> Vec<Vec<Operand>> {
    // Lists of three take fewer operands: one for every kind.
    let few = [OPERANDS[0], OPERANDS[2], OPERANDS[5], OPERANDS[6], OPERANDS[8], OPERANDS[9]];
    let of = if count < 3 { OPERANDS } else { &few };
    (0..count).fold(vec![Vec::new()], |lists, _| {
        let longer = |list: Vec<Operand>| of.iter().map(move |one| [&list[..], &[*one]].concat());
        lists.into_iter().flat_map(longer).collect()
    })
}

#[test]
fn operators_and_functions_are_right_between_all_types() {
    let (mut right, mut refused) = (0, 0);
    for (symbol, count) in symbols() {
        for operands in lists(count) {
            // A constant expression is the assembler's arithmetic, in binary64.
            if operands.iter().all(|operand| matches!(operand, Number(..))) {
                continue;
            }
            let expression = written(&symbol, &operands);
            let value = evaluate(&symbol, &operands);
            for (target, ty) in [("y", Type::F), ("m", Type::I)] {
                let line = format!(" {target} = {expression}");
                match (run("", &line, target), value.and_then(|value| value.bits(ty))) {
                    (Ok(bits), Some(expected)) => {
                        let (found, exact) = (f32::from_bits(bits), f32::from_bits(expected));
                        let close = ty == Type::F && (found - exact).abs() <= 1e-6 * exact.abs();
                        let nan = ty == Type::F && found.is_nan() && exact.is_nan();
                        assert!(bits == expected || close || nan, "{line}: {bits:#x}, not {expected:#x}");
                        right += 1;
                    }
                    (Ok(bits), None) => panic!("{line} is accepted, and gives {bits:#x}"),
                    (Err(report), Some(_)) if !report.contains("has no unit") => panic!("{line}\n{report}"),
                    (Err(_), _) => refused += 1,
                }
            }
        }
    }
    assert!(right > 500 && refused > 500, "{right} right, {refused} refused");
}

/// Places of a value: lines with `{v}` for it, the output that then holds it, and its type.
const PLACES: &[(&str, &str, &str, Type)] = &[
    ("", " y = {v}", "y", Type::F),
    ("", " m = {v}", "m", Type::I),
    ("", " s = {v}\n y = s", "y", Type::F),
    ("", " j = {v}\n m = j", "m", Type::I),
    ("", " mov y, {v}", "y", Type::F),
    ("", " mov m, {v}", "m", Type::I),
    ("", " A[1] = {v}\n y = A[1]", "y", Type::F),
    ("", " K[1] = {v}\n m = K[1]", "m", Type::I),
    ("", " mov A[1], {v}\n y = A[1]", "y", Type::F),
    ("", " mov K[1], {v}\n m = K[1]", "m", Type::I),
    ("", " A[:] = {v}\n y = A[3]", "y", Type::F),
    ("", " K[:] = {v}\n m = K[3]", "m", Type::I),
    ("", " P[1] = {v}\n y = P[1]", "y", Type::F),
    ("", " Q[1] = {v}\n m = Q[1]", "m", Type::I),
    ("", " y, m = {v}, 3", "y", Type::F),
    ("", " m, y = {v}, 2.5", "m", Type::I),
    ("", " y = x < 1 ? {v} : x", "y", Type::F),
    ("", " m = x < 1 ? {v} : n", "m", Type::I),
    ("", " fadd y, zero, {v}", "y", Type::F),
    ("", " iadd m, zero, {v}", "m", Type::I),
    ("", " sel y, n, {v}, x", "y", Type::F),
    ("", " sel m, n, {v}, n", "m", Type::I),
    (".macro give d:float, v:float\n mov d, v\n.endm\n", " y = give({v})", "y", Type::F),
    (".macro give d:int, v:int\n mov d, v\n.endm\n", " m = give({v})", "m", Type::I),
    (".macro give d:float, v:float\n ior d, v, 0\n.endm\n", " y = give({v})", "y", Type::F),
    (".macro give d:float, v:float\n ior d, v, 0\n.endm\n", " y = give({v})*1.0", "y", Type::F),
    (".macro give d:float, v:float\n ior d, v, 0\n.endm\n", " give A[1], {v}\n y = A[1]", "y", Type::F),
    (".macro give d:int, v:int\n ior d, v, 0\n.endm\n", " m = give({v}) + 0", "m", Type::I),
    (".macro give d:int, v:int\n ior d, v, 0\n.endm\n", " give K[1], {v}\n m = K[1]", "m", Type::I),
    (
        ".macro in d:float, v:bits\n ior d, v, 0\n.endm\n.macro give d:float, v:float\n in d, v\n.endm\n",
        " y = give({v})",
        "y",
        Type::F,
    ),
    (".macro give d, v\n iand d, v, -1\n fadd d, d, zero\n.endm\n", " y = give({v})", "y", Type::F),
    (".macro give d, v\n fadd d, v, zero\n ior d, d, v\n.endm\n", " y = give({v})", "y", Type::F),
    (".macro give d, v\n iadd d, v, 0\n ior d, d, v\n.endm\n", " m = give({v})", "m", Type::I),
    (".macro give d, v\n d = v\n.endm\n", " y = give({v})", "y", Type::F),
    (".macro give d, v\n d = v\n.endm\n", " m = give({v})", "m", Type::I),
    (".macro give d, v\n mov d, v\n.endm\n", " y = give({v})", "y", Type::F),
    (".macro give d, v\n mov d, v\n.endm\n", " m = give({v})", "m", Type::I),
];

/// The least and the greatest integers, and those around the multiples of divisors.
const DIVIDENDS: &[i32] = &[
    0,
    1,
    -1,
    2,
    -2,
    3,
    -3,
    7,
    -7,
    8,
    -8,
    9,
    -9,
    1000,
    -1000,
    i32::MAX,
    i32::MAX - 1,
    i32::MIN,
    i32::MIN + 1,
];

/// A function of Rust that an equation computes.
type Function = Box<dyn Fn(i32) -> i32>;

#[test]
fn integers_are_multiplied_and_divided_as_in_rust() {
    let mut lines: Vec<(String, Function)> = Vec::new();
    let factors = [
        0,
        1,
        -1,
        2,
        3,
        5,
        7,
        10,
        12,
        15,
        -15,
        24,
        100,
        255,
        1000,
        -1000,
        65_535,
        123_456_789,
        i32::MAX,
        i32::MIN,
    ];
    for factor in factors {
        lines.push((format!("n*({factor})"), Box::new(move |n| n.wrapping_mul(factor))));
        lines.push((format!("({factor})*n"), Box::new(move |n| n.wrapping_mul(factor))));
    }
    for power in 0..32 {
        for divisor in [(1u32 << power).cast_signed(), (1u32 << power).cast_signed().wrapping_neg()] {
            lines.push((format!("n/({divisor})"), Box::new(move |n| n.wrapping_div(divisor))));
            lines.push((format!("n % ({divisor})"), Box::new(move |n| n.wrapping_rem(divisor))));
        }
    }
    for fast in ["", ".fast reassociate reciprocal\n"] {
        for lines in lines.chunks(16) {
            let outputs: Vec<String> = (0..lines.len()).map(|number| format!("o{number}:int")).collect();
            let equations =
                lines.iter().enumerate().map(|(number, (text, _))| format!(" o{number} = {text}\n"));
            let text = format!(
                ".input n:int\n.output {}\n{fast}.once\n wait period\n.period\nperiod:\n{} wait period\n",
                outputs.join(", "),
                equations.collect::<String>()
            );
            let assembled = assemble(&text, &F3).unwrap_or_else(|e| panic!("{}", e.render(false)));
            let program = &assembled.program;
            for n in DIVIDENDS {
                let mut emulator = Emulator::new(program).expect("it fits");
                emulator.set_input_bits(program.inputs[0].register, n.cast_unsigned()).expect("it is one");
                for _ in 0..2 {
                    emulator.run_period(&[]).expect("it runs");
                }
                for (number, (text, exact)) in lines.iter().enumerate() {
                    let port = program.outputs.iter().find(|port| port.name == format!("o{number}"));
                    let found = emulator.register(port.expect("it is declared").register);
                    assert_eq!(found.map(u32::cast_signed), Some(exact(*n)), "{text} of {n}");
                }
            }
        }
    }
}

#[test]
fn other_quotients_of_integers_name_the_mend() {
    for (expression, words) in [
        ("n/3", "`itof(n)/3` is the quotient as a float"),
        ("n/k", "`itof(n)/itof(k)`"),
        ("8/n", "`8/itof(n)`"),
        ("n % 3", "`fmod(itof(n), 3)`"),
        ("n/0", "divi"),
        ("n*2.5", "itof(n)"),
    ] {
        let report = run("", &format!(" m = {expression}"), "m").expect_err(expression);
        assert!(report.contains(words), "{expression}: no `{words}` in\n{report}");
    }
}

#[test]
fn places_take_the_value_or_refuse_it() {
    for (declarations, lines, output, ty) in PLACES {
        for operand in OPERANDS {
            let line = lines.replace("{v}", operand.text());
            // A choice and a comparison take the type of their other side.
            match (run(declarations, &line, output), operand.value().bits(*ty)) {
                (Ok(bits), Some(expected)) => assert_eq!(bits, expected, "{declarations}{line}"),
                (Ok(bits), None) => panic!("{declarations}{line} is accepted, and gives {bits:#x}"),
                // A message may ask for the type of an undeclared name, and of a copied literal, too.
                (Err(report), Some(_)) => {
                    let asks = ["nothing states the type of", "write `", "convert it", "copy it first"]
                        .iter()
                        .any(|mend| report.contains(mend));
                    let declared = declarations.contains("d:") || declarations.is_empty();
                    let literal = line.contains("[:]")
                        || matches!(operand, Number(..)) && line.contains("mov") | line.contains("sel");
                    assert!(asks && (!declared || literal), "{declarations}{line}\n{report}");
                }
                (Err(_), None) => {}
            }
        }
    }
}

#[test]
fn initial_values_take_the_type_of_their_place() {
    let places: &[(&str, &str, &str, Type)] = &[
        (".state a\n.preset a = {v}\n", " y = a", "y", Type::F),
        (".state a:int\n.preset a = {v}\n", " m = a", "m", Type::I),
        (".state a[2]\n.preset a = {v}\n", " y = a[2]", "y", Type::F),
        (".state a[2]:int\n.preset a[2] = {v}\n", " m = a[2]", "m", Type::I),
        (".const D = {v}\n", " y = D", "y", Type::F),
        (".const D = {v}\n", " m = D", "m", Type::I),
        (".const D = {v}\n", " y = x*0 + D", "y", Type::F),
        (".const D = {v}\n", " m = n - n + D", "m", Type::I),
        (".array a[2] = 0, {v}\n", " y = a[2]", "y", Type::F),
        (".array a[2]:int = 0, {v}\n", " m = a[2]", "m", Type::I),
        (".data\na: .float {v}\n", " ld y, a", "y", Type::F),
        (".data\na: .word {v}\n", " ld m, a", "m", Type::I),
    ];
    for (declarations, lines, output, ty) in places {
        for operand in OPERANDS {
            let text = declarations.replace("{v}", operand.text());
            let expected = match operand {
                Number(..) => operand.value().bits(*ty),
                // The operand has no value before the program runs.
                _ => None,
            };
            match (run(&text, lines, output), expected) {
                (Ok(bits), Some(expected)) => assert_eq!(bits, expected, "{text}{lines}"),
                (Ok(bits), None) => panic!("{text}{lines} is accepted, and gives {bits:#x}"),
                (Err(report), Some(_)) => panic!("{text}{lines}\n{report}"),
                (Err(_), None) => {}
            }
        }
    }
}

#[test]
fn warns_of_implicit_reinterpretation() {
    for (declarations, lines, output, expected) in [
        (
            ".macro half d:float, v:float\n isub d:bits, v:bits, 0x800000\n.endm\n",
            " y = half(3)",
            "y",
            1.5f32.to_bits(),
        ),
        (".macro raw d:bits, v:bits\n ior d, v, 0\n.endm\n", " m = raw(x)", "m", 0.625f32.to_bits()),
        (".reg w:bits\n", " w = x\n m = w", "m", 0.625f32.to_bits()),
    ] {
        assert_eq!(run(declarations, lines, output), Ok(expected), "{declarations}{lines}");
    }
}

/// Each mistake about the types of arguments, with words that identify its message.
#[test]
fn mistakes_about_arguments_name_the_mend() {
    let macros = "
.macro grow d:float, v:float
 ior d, v, 0
.endm
.macro next d:int, v:int
 iadd d, v, 1
.endm
.macro powers d:float, v:float, times:number
.reg p
 p = v
.rep i, 2, times
 p = p*v
.endr
 d = p
.endm
.macro pick d:float, which:name
 d = {which}1
.endm
.macro untold d, v
 iand d, v, 0x7fffffff
.endm
.macro outer d:float, v:float
 next d, v
.endm
.macro wrong d:float, v:float
 iadd d, v, 1
.endm
";
    for (line, words) in [
        (" y = grow(n)", "convert it: `itof(n)`"),
        (" y = grow(n + 1)", "convert it: `itof(n + 1)`"),
        (" y = grow(K[2])", "convert it: `itof(K[2])`"),
        (" grow y, n", "`n` is an integer, and `v` of `grow` is a float"),
        (" m = grow(x)", "convert it: `ftoi(grow(x))`"),
        (" K[1] = grow(x)", "convert it: `ftoi(grow(x))`"),
        (" grow m, x", "`m = ftoi(t)`"),
        (" m = next(x)", "convert it: `ftoi(x)`"),
        (" m = next(2.5)", "2.5 is not an integer"),
        (" y = next(n)", "convert it: `itof(next(n))`"),
        (" y = powers(x, n)", "`n` is an input port, and `times` of `powers` is a number that is known"),
        (" y = powers(x, n + 1)", "of `powers` is a number that is known"),
        (" y = powers(x, A[1])", "is an element of an array"),
        (" y = powers(x, A)", "`A` is an array in data memory"),
        (" y = pick(3)", "`3` is not a name"),
        (" y = untold(3)", "declare it: `v:float`, `v:int`, or `v:bits`"),
        (" y = outer(x)", "is a float, and"),
        (" y = wrong(x)", "`v` is a float, and `iadd` reads an integer"),
    ] {
        let report = run(macros, line, "y").expect_err(line);
        assert!(report.contains(words), "{line}: no `{words}` in\n{report}");
    }
}

#[test]
fn checks_registers_written_on_later_lines() {
    let text = "
.macro grow d:float, v:float
 ior d, v, 0
.endm
.input x, n:int
.output y
.reg r
.once
 wait period
.period
period: y = grow(r)
 r = n + 1
 wait period
";
    let report = bad(text, &F3).render(false);
    assert!(report.contains("`r` is an integer here, and the parameter `v` is a float"), "{report}");
}

#[test]
fn types_of_parameters_are_words_of_the_language() {
    let report = bad(".macro m d:flaot\n.endm\n.period\np: wait p\n", &F3).render(false);
    assert!(
        report.contains("`flaot` is not a type of parameters")
            && report.contains("float int bits number name"),
        "{report}"
    );
}
