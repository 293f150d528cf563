// SPDX-License-Identifier: MIT OR Apache-2.0
//! FPCore: the kernels of FPBench beside an evaluator of another maker, preconditions, and files with mistakes.

use crate::common;
use serde_json::Value;
use std::path::{Path, PathBuf};
use takt_analysis::accuracy::{Reals, enclose_reals};
use takt_emu::testing::Random;
use takt_emu::{Emulator, Number};
use takt_front::fpcore::{Core, MAX_DEPTH, read};
use takt_front::graph::{Bound, Delays, Function, Node, Rewrites};
use takt_isa::Program;

fn kernels() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../programs/fpbench")
}

fn assembled(function: &Function) -> Program {
    let assembled = common::assembled(function);
    assert!(assembled.warnings.is_empty(), "{}", assembled.warnings.render(false));
    assembled.program
}

/// Real numbers that the constants of a function stand for.
fn constants(function: &Function) -> Vec<f64> {
    let graph = &function.graph;
    let node = |index| match graph.node_at(index) {
        Node::Constant(bits) => Some(f64::from_bits(bits)),
        _ => None,
    };
    (0..graph.len()).filter_map(node).collect()
}

/// Every kernel of `programs/fpbench` in binary32, compared with the exact value for the same operands (fpcore.py computes it in 60
/// digits): the difference is at most the bound of the enclosure, which counts the rounding of constants. In binary64, the function has the
/// exact value.
#[test]
fn kernels_have_the_values_of_another_evaluator() {
    let rows: Value = serde_json::from_str(include_str!("data/fpbench.json")).expect("JSON");
    let (mut compared, mut largest, mut file, mut cores) = (0, 0.0f64, String::new(), Vec::new());
    for kernel in rows.as_array().expect("kernels") {
        let [path, name] = ["file", "name"].map(|key| kernel[key].as_str().expect("a text"));
        if path != file {
            path.clone_into(&mut file);
            let text = std::fs::read_to_string(kernels().join(path)).expect("a file");
            cores =
                [Rewrites::EXACT, Rewrites::ALL].map(|rewrites| read(&text, rewrites).expect("cores")).into();
        }
        let function = |cores: &mut Vec<Core>| {
            let at = cores.iter().position(|core| core.name == name).expect("the core");
            cores.remove(at).function.expect(name).optimised(&Delays::of(&takt_isa::T3))
        };
        let [exact, rewritten] = [0, 1].map(|which: usize| function(&mut cores[which]));
        let program = assembled(&exact);
        let enclosure = enclose_reals(&program, &Reals { inputs: false, constants: constants(&exact) });
        let bound = enclosure.expect("an enclosure").outputs[0].error;
        let mut emulator = Emulator::new(&program).expect("it fits");
        for row in kernel["rows"].as_array().expect("rows") {
            let numbers = |value: &Value| {
                value.as_array().expect("numbers").iter().filter_map(Value::as_f64).collect::<Vec<_>>()
            };
            let (operands, expected) = (numbers(&row["operands"]), row["value"].as_f64().expect("a number"));
            for function in [&exact, &rewritten] {
                let found = function.evaluate(&operands)[0];
                // The largest quotients of differences lose six of binary64's digits.
                assert!(
                    (found - expected).abs() <= 1e-9 * expected.abs().max(1.0),
                    "{name} of {operands:?}: {found}, not {expected}"
                );
            }
            let ports = exact.inputs.iter().zip(&operands);
            let ports = ports.filter(|(port, _)| program.inputs.iter().any(|input| input.name == port.name));
            let values: Vec<(&str, Number)> =
                ports.map(|(port, x)| (port.name.as_str(), Number::Float(*x as f32))).collect();
            emulator.run_period(&values).expect("a period");
            let found = match emulator.output("result") {
                Ok(Some(Number::Float(value))) => f64::from(value),
                other => panic!("{other:?}"),
            };
            if bound.is_none() && found.is_nan() {
                // An angle beyond those that the machine's sine takes.
                continue;
            }
            let bound = bound.unwrap_or(1e-3 * expected.abs().max(1.0));
            assert!(
                (found - expected).abs() <= bound,
                "{name} of {operands:?}: {found}, not {expected} within {bound:e}"
            );
            largest = largest.max((found - expected).abs() / bound);
            compared += 1;
        }
    }
    assert!(
        compared >= 450 && largest > 0.3,
        "{compared} values, the largest difference is {largest} of its bound"
    );
}

fn only(source: &str) -> Function {
    let mut cores = read(source, Rewrites::EXACT)
        .unwrap_or_else(|error| panic!("{}: {source}", error.located_text("k.fpcore")));
    cores.remove(0).function.unwrap_or_else(|error| panic!("{}: {source}", error.located_text("k.fpcore")))
}

#[test]
fn preconditions_become_ranges_and_assumptions() {
    let range =
        |pre: &str| only(&format!("(FPCore (x y) :precision binary32 :pre {pre} (+ x y))")).inputs[0].range;
    let next = f64::from(1f32.next_up());
    for (pre, expected) in [
        ("(and (<= 1 x 2) (<= 0 y 1))", Some((1.0, 2.0))),
        ("(and (<= -3/2 x) (>= 0x1p1 x))", Some((-1.5, 2.0))),
        ("(< 1 x 2)", Some((next, f64::from(2f32.next_down())))),
        ("(and (< 1 x) (<= x 4) (<= x 3))", Some((next, 3.0))),
        ("(<= (fabs x) 2)", Some((-2.0, 2.0))),
        ("(== x 5)", Some((5.0, 5.0))),
        ("(let ([a 2]) (<= (- a) x (* a 2)))", Some((-2.0, 4.0))),
        ("(not (or (< x 1) (> x 2)))", Some((1.0, 2.0))),
        ("(<= (- x) 1)", None),
        ("TRUE", None),
    ] {
        assert_eq!(range(pre), expected, "{pre}");
    }
    // A real number below 0.1 is rounded to a binary32 that may lie above.
    assert_eq!(range("(< 0.1 x 0.3)"), Some((f64::from(0.1f32), f64::from(0.3f32))));
    let pre = |pre: &str| only(&format!("(FPCore (x y) :precision binary32 :pre {pre} (+ x y))"));
    let assumed = |function: &Function| -> Vec<(Bound, f64)> {
        function.assumptions.iter().map(|assumption| (assumption.bound, assumption.value)).collect()
    };
    assert_eq!(assumed(&pre("(< (+ x y) 3)")), [(Bound::AtMost, 3.0)]);
    assert_eq!(assumed(&pre("(<= (* x x) y)")), [(Bound::AtLeast, 0.0)]);
    let function = pre("(and (>= x 0) (!= y 0) (or (< x 1) (> x 2)) (<= (- x) 1))");
    assert_eq!(
        function.notes,
        ["of the precondition, no range or assumption: y != 0.0; (x < 1.0 or 2.0 < x); x >= 0.0"]
    );
    // An assumption needs no other reader, and narrows what follows.
    let text = "(FPCore (x y) :pre (and (<= 0 x 4) (<= 0 y 4) (>= (- x y) 1)) (/ 1 (- x y)))";
    let program = assembled(&only(text));
    assert_eq!(program.assumptions.len(), 1);
    let enclosure = enclose_reals(&program, &Reals::default()).expect("an enclosure");
    assert!(enclosure.hazards.is_empty() && enclosure.relied.len() == 1, "{enclosure:?}");
    assert!(program.latched);
}

#[test]
fn every_construct_has_its_value() {
    for (body, x, expected) in [
        ("(let ([x 1] [y x]) (+ x y))", 2.0, 3.0),
        ("(let* ([x 1] [y x]) (+ x y))", 2.0, 2.0),
        ("(if (and (< 0 x 5) (not (== x 3))) 1 (if (or (> x 7) (<= x -1)) 2 3))", 2.0, 1.0),
        ("(if (and (< 0 x 5) (not (== x 3))) 1 (if (or (> x 7) (<= x -1)) 2 3))", 3.0, 3.0),
        ("(if (and (< 0 x 5) (not (== x 3))) 1 (if (or (> x 7) (<= x -1)) 2 3))", 9.0, 2.0),
        ("(if (if (< x 0) (< x -5) (!= x 1 2)) 1 0)", 2.0, 0.0),
        ("(if (if (< x 0) (< x -5) (!= x 1 2)) 1 0)", -6.0, 1.0),
        ("(! :precision binary32 :round nearestEven (cast (- x)))", 2.0, -2.0),
        ("(while (< i 4) ([i 0 (+ i 1)] [p 1 (* p x)]) p)", 2.0, 16.0),
        ("(while* (< i 4) ([i 0 (+ i 1)] [s 0 (+ s i)]) (* s x))", 2.0, 20.0),
        ("(trunc x)", -2.75, -2.0),
        ("(round x)", -2.5, -3.0),
        ("(round x)", 0.499_999_97, 0.0),
        ("(fdim x 1)", 3.5, 2.5),
        ("(fdim x 5)", 3.5, 0.0),
        ("(fma x x 1)", 3.0, 10.0),
        ("(+ x (digits 3 2 10))", 1.0, 301.0),
        ("(* x (square (square 2)))", 1.0, 16.0),
        ("(+ PI (* 0 x))", 1.0, std::f64::consts::PI),
        ("(pow x 5/2)", 4.0, 32.0),
    ] {
        let text = format!("(FPCore (x) {body}) (FPCore square (y) (* y y))");
        let found = only(&text).evaluate(&[x])[0];
        assert!((found - expected).abs() < 1e-6, "{body} of {x}: {found}, not {expected}");
    }
    let function = only("(FPCore named (sl* e e* T) :name \"two\nlines\" (+ (* sl* e) (* e* T)))");
    let names: Vec<&str> = function.inputs.iter().map(|port| port.name.as_str()).collect();
    assert_eq!(names, ["sl_", "e", "e_", "T"]);
    assert_eq!(function.notes, ["written for binary64 or real numbers: computed in binary32"]);
    assembled(&function);
}

#[test]
fn mistakes_have_a_line_and_a_mend() {
    let deep = format!("(FPCore (x) {}x{})", "(- ".repeat(MAX_DEPTH), ")".repeat(MAX_DEPTH));
    let wide = format!("(FPCore f (x) (+ x x))\n(FPCore (x) {}x{})", "(f ".repeat(30), ")".repeat(30));
    assert_eq!(read(&wide, Rewrites::ALL).expect("cores").len(), 2);
    for (source, expected) in [
        ("", "0: the file has no `(FPCore (arguments) expression)`"),
        ("(FPCore (x)\n (+ x 1)", "1: the list that begins here is not closed: a `)` is missing"),
        ("(FPCore (x) x))", "1: `)` closes nothing"),
        ("(FPCore (x) \"a\n)", "1: this text has no closing quote"),
        ("\n(FPImp (x) x)", "2: expected `(FPCore (arguments) expression)`; found `(FPImp (x) x)`"),
        ("(FPCore (x x) x)", "1: two arguments are `x`: rename one"),
        ("(FPCore ((A 3)) (+ 1 1))", "1: `A` is a tensor: give each element an argument of its own"),
        ("(FPCore (x))", "1: a core has one expression behind its properties; this one has 0"),
        ("(FPCore (x)\n y)", "2: there is no value `y` here"),
        ("(FPCore (x) (sine x))", "1: there is no operation `sine`; in `(sine x)`"),
        ("(FPCore (x) (sqrt x x))", "1: `sqrt` cannot have 2 operands; in `(sqrt x x)`"),
        ("(FPCore (x) (if x 1 2))", "1: `x` is a number; expected a condition"),
        ("(FPCore (x) (< x 1))", "1: `(< x 1)` is a condition; expected a number"),
        (
            "(FPCore (x) :precision binary80 x)",
            "1: `:precision binary80` is not supported: the machine computes in binary32",
        ),
        (
            "(FPCore (x) :round toZero x)",
            "1: `:round toZero` is not supported: the machine rounds to nearest, ties to even",
        ),
        ("(FPCore (x) (* x 1e39))", "1: 1e39 does not fit binary32, whose largest number is 3.4028235e38"),
        (
            "(FPCore (x) (while (< x 4) ([x x (+ x 1)]) x))",
            "1: the loop's condition `(< x 4)` depends on the arguments; a loop is written out only if its condition depends on constants",
        ),
        (
            "(FPCore (x) (for ([i 3]) ([x x x]) x))",
            "1: `for` is not supported: write its iterations out with `let*`",
        ),
        (
            "(FPCore (x) (tgamma x))",
            "1: `tgamma` is not supported: it has no macro; a polynomial over the range that is used can take its place",
        ),
        ("(FPCore (x) :pre (< 2 x 1) x)", "1: `:pre` leaves no number for `x`"),
        ("(FPCore (x) :pre (< 2 1) x)", "1: no argument fulfils `:pre`"),
        ("(FPCore f (x) (f x))", "1: expressions and calls nest deeper than 400"),
        (deep.as_str(), "1: expressions nest deeper than 400: name parts of them with `let*`"),
        (
            "(FPCore (x) (while TRUE ([i 0 (+ i 1)]) x))",
            "1: the core has more than 200000 expressions, loops and calls written out",
        ),
    ] {
        let error = match read(source, Rewrites::ALL) {
            Err(error) => error,
            Ok(mut cores) => cores.remove(0).function.err().unwrap_or_else(|| panic!("it is read: {source}")),
        };
        assert_eq!(format!("{}: {error}", error.line.unwrap_or(0)), expected);
    }
    // A core with a mistake does not keep the others from being read.
    let cores = read("(FPCore ((! :precision integer n)) n) (FPCore (x) x)", Rewrites::ALL).expect("cores");
    assert!(cores[0].function.is_err() && cores[1].function.is_ok());
}

/// Files with random damage: an error or a function, never a panic.
#[test]
fn damaged_files_are_read_or_refused() {
    let text = std::fs::read_to_string(kernels().join("rosa.fpcore")).expect("a file");
    let tokens: Vec<&str> = text.split_inclusive([' ', '(', ')', '\n']).collect();
    let mut random = Random::new(54);
    let mut below = |most: usize| random.below(most as u32) as usize;
    let scraps = [
        "(", ")", "[", "]", "\"", ";", "while", "let", "if", "!", ":pre", "1/0", "-", "0x", "<", "é",
        "1e999", "let*",
    ];
    let (mut refused, mut functions) = (0, 0);
    for _ in 0..300 {
        let start = below(tokens.len() - 60);
        let mut piece: Vec<&str> = tokens[start..start + 60].to_vec();
        for _ in 0..1 + below(4) {
            let at = below(piece.len());
            match below(3) {
                0 => piece.insert(at, scraps[below(scraps.len())]),
                1 => _ = piece.remove(at),
                _ => {
                    let next = (at + 1) % piece.len();
                    piece.swap(at, next);
                }
            }
        }
        let source = format!("(FPCore (x y){}", piece.concat());
        match read(&source, Rewrites::ALL) {
            Err(_) => refused += 1,
            Ok(cores) => functions += cores.iter().filter(|core| core.function.is_ok()).count(),
        }
    }
    assert!(refused > 50, "{refused} refused, {functions} functions");
}
