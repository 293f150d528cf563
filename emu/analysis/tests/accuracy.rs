// SPDX-License-Identifier: MIT OR Apache-2.0
//! Measured errors against formulas in binary64, and proved enclosures against measured errors.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use takt_analysis::Refusal;
use takt_analysis::accuracy::{Enclosure, OutputBound, OutputPlace, Problem, Shadow, enclose, ulp};
use takt_asm::{MemoryLoader, Options, Search, assemble};
use takt_emu::Emulator;
use takt_emu::testing::Random;
use takt_isa::program::Range;
use takt_isa::{F3, MACHINES, Machine, Program, ROWS, Register, Type};

pub(crate) fn source(text: &str, machine: &'static Machine) -> Program {
    let options = Options { machine, ..Options::default() };
    let assembled = takt_asm::assemble_bytes("test.s", text.into(), &MemoryLoader::new(&[]), &options);
    assembled.unwrap_or_else(|diagnostics| panic!("{}\n{text}", diagnostics.render(false))).program
}

fn shipped(path: &str, machine: &'static Machine) -> Program {
    let options = Options { machine, ..Options::default() };
    assemble(path, &MemoryLoader::new(takt_programs::SOURCES), &options).unwrap().program
}

fn input(program: &Program, name: &str) -> Register {
    program.inputs.iter().find(|port| port.name == name).unwrap().register
}

/// Runs the section `.once`, if any, and periods with these inputs.
fn run(program: &Program, mut shadow: Shadow, inputs: &[Vec<(Register, u32)>]) -> (Shadow, Emulator) {
    let mut emulator = Emulator::new(program).unwrap();
    let mut first = true;
    for row in inputs {
        for &(register, bits) in row {
            emulator.set_input_bits(register, bits).unwrap();
        }
        if std::mem::take(&mut first) {
            shadow.run_period(&mut emulator).unwrap();
        }
        shadow.run_period(&mut emulator).unwrap();
    }
    (shadow, emulator)
}

fn floats(program: &Program, values: &[(&str, f32)]) -> Vec<(Register, u32)> {
    values.iter().map(|(name, value)| (input(program, name), value.to_bits())).collect()
}

/// Register of an output that is a port.
pub(crate) fn port(bound: &OutputBound) -> Register {
    let OutputPlace::Port(register) = bound.place else { panic!("{} is no port", bound.name) };
    register
}

pub(crate) const HEAD: &str = ".once\n wait p\n.period\np:\n";

#[test]
fn absorption_and_cancellation_are_located() {
    let text = format!(
        ".input x\n.output y, w\n.reg t\n{HEAD} fadd t, x, 1.0\n fsub y, t, 1.0\n fmul w, y, 3.0\n wait p\n"
    );
    let program = source(&text, &F3);
    let (shadow, _) = run(&program, Shadow::new(&program), &[floats(&program, &[("x", 1e-8)])]);
    let [y, w] = shadow.outputs() else { panic!() };
    let x = f64::from(1e-8f32);
    // In binary32, 1 + x is 1: the sum loses all of x.
    let worst = y.absolute.unwrap();
    assert_eq!((worst.error, worst.value, worst.period), (1.0 + x - 1.0, 0.0, 1));
    let lines = |word: u32| program.lines[word as usize].unwrap().line;
    assert_eq!(y.parts.iter().map(|part| lines(part.word)).collect::<Vec<_>>(), [8]);
    assert!((w.absolute.unwrap().error / (3.0 * x) - 1.0).abs() < 1e-7);
    let at = |line| shadow.operations().iter().find(|(word, _)| lines(**word) == line).unwrap().1;
    assert_eq!((at(8).absorbed, at(9).absorbed), (1, 0));
    // The difference cancels all 24 digits of the sum.
    let cancelled = 1f64.log2() - (1.0f64 + x - 1.0).log2();
    assert!(at(9).cancelled >= 24.0 && cancelled > 24.0, "{}", at(9).cancelled);
    assert_eq!(at(10).cancelled, 0.0);
}

#[test]
fn exact_values_equal_binary64() {
    // Constants that binary32 holds exactly, so that a formula in binary64 is the same program.
    let text = format!(
        ".input x, z\n.output y\n.reg a b c s\n{HEAD} fmul a, x, x\n fmul b, z, 0.75\n fadd c, a, b\n fsqrt c, c\n \
         fsin s, x\n fatan2 a, s, z\n fdiv c, c, a\n fsub y, c, x\n wait p\n"
    );
    let program = source(&text, &F3);
    let mut random = Random::new(7);
    let mut seen = 0;
    for _ in 0..500 {
        let mut number = || 0.1 + random.below(1 << 20) as f32 / 1e6;
        let (x, z) = (number(), number());
        let (shadow, emulator) =
            run(&program, Shadow::new(&program), &[floats(&program, &[("x", x), ("z", z)])]);
        let (x, z) = (f64::from(x), f64::from(z));
        let expected = (x * x + z * 0.75).sqrt() / x.sin().atan2(z) - x;
        let (value, exact, parts) = shadow.value(&emulator, program.outputs[0].register).unwrap();
        assert!((exact - expected).abs() <= 1e-13 * expected.abs().max(1.0), "{exact} for {expected}");
        let all: f64 = parts.iter().map(|part| part.error).sum();
        assert!((value - exact - all).abs() <= 1e-13, "the parts make {all}, the error is {}", value - exact);
        seen += usize::from(value != exact);
    }
    assert!(seen > 490, "{seen}");
}

#[test]
fn reports_decisions_changed_by_rounding() {
    let text = format!(
        ".input x\n.output y\n.reg t c:int\n{HEAD} fadd t, x, 1e-9\n feq c, t, x\n sel y, c, 2.0, 3.0\n wait p\n"
    );
    let program = source(&text, &F3);
    for (x, turned) in [(1.0, 1), (1e-9, 0)] {
        let (shadow, _) = run(&program, Shadow::new(&program), &[floats(&program, &[("x", x)])]);
        let decisions: Vec<u64> = shadow.decisions().values().map(|decision| decision.count).collect();
        assert_eq!(decisions, vec![1; turned], "{x}");
        // The shadow follows the run's choice: the output is as exact as the chosen operand.
        assert_eq!(shadow.outputs()[0].absolute.unwrap().error, 0.0);
    }
}

/// Random inputs within their ranges, ends included.
fn sample(program: &Program, random: &mut Random) -> Vec<(Register, u32)> {
    let one = |range: &Range| {
        let (low, high) = range.ends();
        let part = f64::from(random.below(1 << 30)) / f64::from(1 << 30);
        let value = match random.below(8) {
            0 => low,
            1 => high,
            _ => low + part * (high - low),
        };
        let bits = match range.ty {
            Type::F => (value as f32).clamp(low as f32, high as f32).to_bits(),
            _ => (value as i32).cast_unsigned(),
        };
        (range.register, bits)
    };
    let inputs = program.ranges.iter().filter(|range| program.machine.is_input(range.register));
    inputs.map(one).collect()
}

/// Checks bounds against `periods` random periods. Returns the largest measured fraction of a bound.
pub(crate) fn check(program: &Program, enclosure: &Enclosure, periods: usize, random: &mut Random) -> f64 {
    let rows: Vec<_> = (0..periods).map(|_| sample(program, random)).collect();
    let (shadow, emulator) = run(program, Shadow::new(program).each_period_afresh(), &rows);
    if enclosure.hazards.is_empty() {
        assert!(emulator.flags().is_empty(), "{}", emulator.flags());
    }
    let mut most: f64 = 0.0;
    for bound in &enclosure.outputs {
        let (Some(error), Some(range)) = (bound.error, bound.range) else { continue };
        let measured = shadow.outputs().iter().find(|output| output.place == bound.place).unwrap();
        let Some(worst) = measured.absolute else { continue };
        // Allowance for the rounding of binary64 itself.
        let slack = 1e-12 * range.magnitude() + 1e-40;
        assert!(worst.error <= error + slack, "{}: {worst:?} beyond {error}", bound.name);
        for worst in [measured.absolute, measured.ulp].into_iter().flatten() {
            assert!(range.contains(worst.value), "{}: {worst:?} beyond {range:?}", bound.name);
        }
        if error > 0.0 {
            most = most.max(worst.error / error);
        }
    }
    most
}

/// Straight line of random operations on floats, on inputs with ranges.
fn random_line(machine: &'static Machine, random: &mut Random) -> String {
    let offered = |row: &&takt_isa::Row| {
        let float = |ty: &Type| *ty == Type::F;
        row.ulp.is_some()
            && row.types.iter().all(float)
            && machine.slots.iter().any(|slot| slot.unit(row.function).is_some())
    };
    let rows: Vec<_> = ROWS.iter().filter(offered).collect();
    let mut text = ".schedule on\n.input i0, i1, i2\n.output o0, o1, o2\n".to_owned();
    for i in 0..3 {
        let low = random.below(400) as f32 / 100.0 - 2.0;
        let high = low + random.below(300) as f32 / 100.0;
        writeln!(text, ".range i{i} = {low:?}, {high:?}").unwrap();
    }
    let count = 2 + random.below(8);
    let names: Vec<String> = (0..count).map(|k| format!("t{k}")).collect();
    writeln!(text, ".reg {}\n{HEAD}", names.join(" ")).unwrap();
    let mut operands: Vec<String> = (0..3).map(|i| format!("i{i}")).collect();
    for name in names {
        let row = rows[random.below(rows.len() as u32) as usize];
        write!(text, " {} {name}", row.mnemonic).unwrap();
        for _ in 0..row.shape.sources() {
            // Mixes in constants.
            let operand = match random.below(8) {
                0 => "0.7".to_owned(),
                _ => operands[random.below(operands.len() as u32) as usize].clone(),
            };
            write!(text, ", {operand}").unwrap();
        }
        text.push('\n');
        operands.push(name);
    }
    for (i, operand) in operands.iter().rev().take(3).enumerate() {
        writeln!(text, " mov o{i}, {operand}").unwrap();
    }
    text + " wait p\n"
}

#[test]
fn no_run_exceeds_a_bound() {
    let mut random = Random::new(15);
    let (mut bounded, mut tight) = (0, 0);
    for round in 0..240 {
        let machine = MACHINES[round % MACHINES.len()];
        let text = random_line(machine, &mut random);
        let program = source(&text, machine);
        let enclosure = enclose(&program).unwrap();
        let result = std::panic::catch_unwind(|| {
            let mut random = Random::new(round as u64);
            check(&program, &enclosure, 40, &mut random)
        });
        let most = result.unwrap_or_else(|_| panic!("round {round}:\n{text}{enclosure:#?}"));
        bounded += usize::from(enclosure.outputs.iter().any(|output| output.error.is_some()));
        tight += usize::from(most > 0.3);
    }
    // Loose bounds would prove little: count the tight ones.
    assert!(bounded > 160 && tight > 40, "{bounded} bounded, {tight} tight");
}

#[test]
fn the_shipped_programs_stay_within_their_bounds() {
    let mut random = Random::new(3);
    let pi = include_str!("../../../programs/examples/pi.s");
    for machine in [&F3, MACHINES[MACHINES.len() - 1]] {
        let programs = [("tracking.s", shipped("hybrid/tracking.s", machine)), ("pi.s", source(pi, machine))];
        for (path, program) in programs {
            let enclosure = enclose(&program).unwrap();
            let named: Vec<_> =
                enclosure.hazards.iter().map(|h| program.word_place(h.word as usize)).collect();
            assert!(
                enclosure.hazards.is_empty(),
                "{path} on {}: {named:?} {:?}",
                machine.name,
                enclosure.hazards
            );
            assert!(enclosure.outputs.iter().all(|output| output.error.is_some()), "{path}");
            check(&program, &enclosure, 60, &mut random);
        }
    }
}

#[test]
fn hazards_name_the_operation_and_its_operands() {
    let cases = [
        ("fdiv y, a, b", "b = -1, 1", Some(Problem::DivisionByZero)),
        ("fdiv y, a, b", "b = 0.5, 1", None),
        ("fsqrt y, b", "b = -0.5, 1", Some(Problem::Domain)),
        ("fsqrt y, b", "b = 0, 1", None),
        ("facos y, b", "b = 0, 1.5", Some(Problem::Domain)),
        ("facos y, b", "b = -1, 1", None),
        ("fsin y, b", "b = 0, 500", Some(Problem::Domain)),
        ("fsin y, b", "b = 0, 400", None),
        ("fmul y, b, b", "b = 0, 1e20", Some(Problem::Overflow)),
        ("fmul y, b, b", "b = 0, 1e19", None),
    ];
    for (operation, range, expected) in cases {
        let text =
            format!(".input a, b\n.output y\n.range a = 1, 2\n.range {range}\n{HEAD} {operation}\n wait p\n");
        let program = source(&text, &F3);
        let enclosure = enclose(&program).unwrap();
        let found: Vec<Problem> = enclosure.hazards.iter().map(|hazard| hazard.problem).collect();
        assert_eq!(found, expected.into_iter().collect::<Vec<_>>(), "{operation} with {range}");
        assert_eq!(enclosure.outputs[0].error.is_some(), expected.is_none());
        for hazard in &enclosure.hazards {
            let (register, interval) = hazard.operands.last().unwrap();
            let declared = program.ranges.iter().find(|range| range.register == *register).unwrap();
            assert_eq!(interval.map(|interval| (interval.low, interval.high)), Some(declared.ends()));
        }
    }
}

/// Problems that the analysis lists for a period, given its declarations.
pub(crate) fn problems(declarations: &str, period: &str) -> (Vec<Problem>, Enclosure) {
    let text = format!("{declarations}{HEAD}{period} wait p\n");
    let enclosure = enclose(&source(&text, &F3)).unwrap();
    (enclosure.hazards.iter().map(|hazard| hazard.problem).collect(), enclosure)
}

const ONE_INPUT: &str = ".input x\n.output y\n.reg t:int u:int f g\n";

#[test]
fn integers_wrap_as_in_the_machine() {
    // The subtraction 0x3f800000 - 0x80000000 wraps to a negative number, whose float cancels the constant at x = 1.
    let (found, _) = problems(
        &format!("{ONE_INPUT}.range x = 1, 1.5\n"),
        " isub t, x:bits, 0x80000000\n itof f, t\n fadd f, f, 1082130432.0\n fdiv y, 1.0, f\n",
    );
    assert_eq!(found, [Problem::DivisionByZero]);
    // Taking two from the exponent of zero borrows from the sign: -1.7e38.
    let quarter = " isub y:float, x:bits, 2<<23\n";
    let (found, enclosure) = problems(&format!("{ONE_INPUT}.range x = -1, 0\n"), quarter);
    assert_eq!((found, enclosure.outputs[0].range), (vec![Problem::Output], None));
    let (found, enclosure) = problems(&format!("{ONE_INPUT}.range x = 1, 2\n"), quarter);
    let range = enclosure.outputs[0].range.unwrap();
    assert!(found.is_empty() && (range.low, range.high) == (0.25, 0.5), "{range:?}");
}

#[test]
fn integer_after_a_hazard_is_unbounded() {
    let (found, enclosure) = problems(
        ".input x, z\n.output y\n.reg n:int f\n.range x = 30, 40\n.range z = 0, 40\n",
        " fsub f, x, z\n fsqrt f, f\n ftoi n, f\n itof f, n\n fsub f, f, 5.0\n fdiv y, 1.0, f\n",
    );
    assert_eq!(found, [Problem::Domain, Problem::DivisionByZero]);
    assert_eq!(enclosure.outputs[0].error, None);
    // A comparison gives 1 or 0 even after a hazard.
    let (found, enclosure) = problems(
        ".input x\n.output y\n.reg c:int f\n.range x = -1, 40\n",
        " fsqrt f, x\n flt c, f, 2.0\n itof y, c\n",
    );
    let range = enclosure.outputs[0].range.unwrap();
    assert_eq!((found, range.low, range.high), (vec![Problem::Domain], 0.0, 1.0));
}

#[test]
fn an_input_that_is_not_latched_may_change_between_reads() {
    let twice = " mov f, x\n fsub y, f, x\n";
    let ports = format!("{ONE_INPUT}.range x = 1, 2\n");
    let (_, enclosure) = problems(&format!(".ports latched\n{ports}"), twice);
    assert!(enclosure.outputs[0].range.unwrap().magnitude() < 1e-12);
    let (_, enclosure) = problems(&ports, twice);
    assert_eq!(enclosure.outputs[0].range.unwrap().magnitude(), 1.0);
    // A bundle reads each input once.
    let (_, enclosure) = problems(&ports, " fsub y, x, x\n");
    assert!(enclosure.outputs[0].range.unwrap().magnitude() < 1e-12);
}

#[test]
fn first_period_must_begin_in_the_ranges_of_used_states() {
    let first = |once: &str, range: &str| {
        let text = format!(
            ".input x\n.range x = 0, 1\n.output y\n.state s\n{range}\n{once}\n wait q\n.period\nq: nop\np: mov y, s\n mov s, 0.5\n wait p\n"
        );
        let enclosure = enclose(&source(&text, &F3)).unwrap();
        let found: Vec<_> =
            enclosure.first().map(|state| state.found.map(|found| (found.low, found.high))).collect();
        assert_eq!(enclosure.later().count(), 0);
        found
    };
    let range = ".range s = -1, 1";
    assert_eq!(first(".once\n mov s, 2.0", range), [Some((2.0, 2.0))]);
    assert_eq!(first(".preset s = -3\n.once", range), [Some((-3.0, -3.0))]);
    assert_eq!(first(".once\n mov s, x", range), []);
    assert_eq!(first(".once\n mov s, x", ".range s = 0.25, 0.75"), [Some((0.0, 1.0))]);
    // Integer states are compared as integers.
    let text = ".output y\n.state n:int\n.range n = 0, 5\n.preset n = 0\n.once\n wait p\n.period\np: itof y, n\n mov n, 100\n wait p\n";
    let enclosure = enclose(&source(text, &F3)).unwrap();
    let later: Vec<_> = enclosure.later().map(|state| state.found.unwrap().high).collect();
    assert_eq!((enclosure.first().count(), later), (0, vec![100.0]));
    // A state that the first period writes before any read may begin anywhere, like the last positions of the tracking program.
    let text = ".input x\n.range x = 0, 1\n.output y\n.state s\n.range s = 0, 1\n.once\n wait q\nq: mov s, x\n.period\np: mov y, s\n mov s, x\n wait p\n";
    assert!(enclose(&source(text, &F3)).unwrap().assumed.is_empty());
}

#[test]
fn conversions_and_outputs_are_hazards_too() {
    let convert = " ftoi t, x\n itof y, t\n";
    let (found, enclosure) = problems(&format!("{ONE_INPUT}.range x = 0, 3e9\n"), convert);
    let range = enclosure.outputs[0].range.unwrap();
    assert_eq!((found, range.low, range.high), (vec![Problem::Conversion], 0.0, 2_147_483_648.0));
    assert!(problems(&format!("{ONE_INPUT}.range x = -2147483648, 2147483520\n"), convert).0.is_empty());
    // Constants are converted like any number.
    assert_eq!(problems(ONE_INPUT, " ftoi t, 3e9\n itof y, t\n").0, [Problem::Conversion]);
    assert_eq!(problems(ONE_INPUT, " mov y:bits, 0x7fc00000\n").0, [Problem::Output]);
    assert_eq!(problems(ONE_INPUT, " li y, 0x7f800000\n").0, [Problem::Output]);
}

#[test]
fn unenclosable_program_names_the_missing_range() {
    let refused = |text: &str| enclose(&source(text, &F3)).unwrap_err().to_string();
    let state = format!(
        ".input a\n.range a = 0, 1\n.output y\n.state s\n.preset s = 0\n{HEAD} fadd s, s, a\n mov y, s\n wait p\n"
    );
    assert!(refused(&state).contains("the state `s` is read here and has no range"), "{}", refused(&state));
    let input = format!(".input a\n.output y\n{HEAD} mov y, a\n wait p\n");
    assert!(refused(&input).contains("the input `a`"), "{}", refused(&input));
    // A loop without a bound may have any number of iterations: a sum grows beyond every limit, a product of the input does not.
    let endless = |body: &str| {
        let text = format!(
            ".input a\n.range a = 0, 1\n.output y, z\n{HEAD} mov z, zero\nq: fmul y, a, a\n{body} bnz a, q\n wait p\n"
        );
        enclose(&source(&text, &F3)).unwrap()
    };
    let ranges =
        |enclosure: &Enclosure| enclosure.outputs.iter().map(|output| output.range).collect::<Vec<_>>();
    let bounded = ranges(&endless(" fmul z, a, 0.5\n"));
    assert!(bounded.iter().all(|range| range.is_some_and(|range| range.high <= 1.0)), "{bounded:?}");
    let [Some(_), None] = ranges(&endless(" fadd z, z, 0.5\n"))[..] else { panic!("a sum without limit") };
    // A range bounds the state; a range that a period does not keep is listed.
    let program = source(&state.replace(".state s", ".state s\n.range s = 0, 10"), &F3);
    let enclosure = enclose(&program).unwrap();
    assert_eq!(enclosure.assumed.len(), 1);
    let found = enclosure.assumed[0].found.unwrap();
    assert!(found.low == 0.0 && (11.0..11.001).contains(&found.high), "{found:?}");
}

#[test]
fn loops_are_followed_turn_by_turn() {
    // The ninth power of x in a counted loop; then a loop whose end depends on data.
    let text = format!(
        ".input x\n.range x = 0.9, 1.1\n.output y\n.reg p n:int\n{HEAD} mov p, x\n li n, 8\n.loop_bound 8\n\
         q: fmul p, p, x\n isub n, n, 1\n bnz n, q\n mov y, p\n wait p\n"
    )
    .replace("wait p\n.period\np:", "wait b\n.period\nb:")
    .replace("\n wait p\n", "\n wait b\n");
    let program = source(&text, &F3);
    let enclosure = enclose(&program).unwrap();
    let output = &enclosure.outputs[0];
    let range = output.range.unwrap();
    assert!(
        range.contains(0.9f64.powi(9)) && range.contains(1.1f64.powi(9)) && range.high < 3.0,
        "{range:?}"
    );
    // The first of the eight roundings is amplified by seven products.
    let (error, least) = (output.error.unwrap(), 4.0 * ulp(1.1f64.powi(9)));
    assert!(error > 0.5 * least && error < 4.0 * least, "{error:e}");
    let mut random = Random::new(1);
    check(&program, &enclosure, 200, &mut random);
}

#[test]
fn ranges_survive_images_and_disassembly() {
    let text = "\
.input  x, n:int
.output y
.state  s, q[2]
.range  x = -pi, 2*pi
.range  n = -5, 7
.range  s, q = 0, 1
.once
        mov     s, zero
        mov     q[1], zero
        mov     q[2], zero
        wait    p
.period
p:      fadd    y, s, x
        fadd    s, q[1], q[2]
        fadd    q[1], s, y
        fadd    q[2], s, x
        wait    p
";
    let program = source(text, &F3);
    let ends: Vec<(f64, f64)> = program.ranges.iter().map(Range::ends).collect();
    let pi = f64::from(std::f32::consts::PI);
    // Bank order: the states precede the inputs; no instruction reads `n`.
    assert!(ends.contains(&(-pi, 2.0 * pi)) && ends.contains(&(-5.0, 7.0)), "{ends:?}");
    assert_eq!(ends.iter().filter(|ends| **ends == (0.0, 1.0)).count(), 3, "{ends:?}");
    let bytes = takt_asm::image::write(&program).unwrap();
    assert_eq!(takt_asm::image::read(&bytes).unwrap().ranges, program.ranges);
    let again = source(&takt_asm::disasm::disassemble(&program), &F3);
    assert_eq!(again.ranges, program.ranges);

    let refused = |line: &str| {
        let text = format!(".input x\n.output y\n.range {line}\n{HEAD} mov y, x\n wait p\n");
        let loader = MemoryLoader::new(&[]);
        let result = takt_asm::assemble_bytes("test.s", text.into(), &loader, &Options::default());
        result.err().map(|diagnostics| diagnostics.render(false)).unwrap_or_default()
    };
    assert!(refused("x = 2, 1").contains("its least value is above its largest"), "{}", refused("x = 2, 1"));
    assert!(refused("x = 0, 1/0").contains("error"), "{}", refused("x = 0, 1/0"));
    assert!(refused("z = 0, 1").contains('z'), "{}", refused("z = 0, 1"));
    let twice = refused("x = 0, 1\n.range x = 0, 2");
    assert!(twice.contains("this register has a range already"), "{twice}");
}

/// Program that applies a macro of the library, inline or as a subroutine, to an input with this range.
fn of_library(function: &str, (low, high): (f64, f64), called: bool, machine: &'static Machine) -> Program {
    // Latched ports: the functions read their operand several times.
    let once = ".ports latched\n.include <math.s>\n.input x\n.output y\n";
    let text = match called {
        false => format!("{once}.range x = {low}, {high}\n{HEAD} {function} y, x\n wait p\n"),
        true => format!(
            "{once}.range x = {low}, {high}\n.reg arg result\n.once\n wait p\n.period\np: mov arg, x\n call f\n mov y, result\n wait p\n\
             f: {function} result, arg\n ret\n"
        ),
    };
    let loader = Search::new(MemoryLoader::default()).library(takt_programs::LIBRARY);
    let options = Options { machine, ..Options::default() };
    let assembled = takt_asm::assemble_bytes("test.s", text.clone().into(), &loader, &options);
    assembled.unwrap_or_else(|diagnostics| panic!("{}\n{text}", diagnostics.render(false))).program
}

/// Functions that take floats apart: their bounds hold, and are finite and tight.
#[test]
fn functions_of_the_library_are_enclosed() {
    type Case = (&'static str, (f64, f64), fn(f64) -> f64, f64);
    // Last column: limit on the bound, in ulps of the largest value.
    let cases: [Case; 14] = [
        ("exp", (-1.0, 1.0), f64::exp, 2.0),
        ("exp", (-10.0, 3.0), f64::exp, 2.0),
        ("exp", (-50.0, 50.0), f64::exp, 2.0),
        ("log", (0.7, 1.3), f64::ln, 3.0),
        ("log", (0.001, 500.0), f64::ln, 1.0),
        ("tanh", (-0.5, 0.5), f64::tanh, 1.0),
        ("tanh", (1.0, 1.5), f64::tanh, 60.0),
        ("tan", (-0.7, 0.7), f64::tan, 8.0),
        ("tan", (0.9, 1.0), f64::tan, 10.0),
        ("asin", (-0.45, 0.45), f64::asin, 1.0),
        ("asin", (0.55, 0.95), f64::asin, 5.0),
        ("rint", (0.6, 900.0), f64::round_ties_even, 1.0),
        ("trunc", (2.1, 3.9), f64::trunc, 1.0),
        ("floor", (64.2, 100.0), f64::floor, 1.0),
    ];
    for (function, (low, high), exact, most) in cases {
        for called in [false, true] {
            for machine in [&F3, MACHINES[MACHINES.len() - 1]] {
                let program = of_library(function, (low, high), called, machine);
                let enclosure = enclose(&program).unwrap();
                let about = format!("{function} of {low} to {high} on {}: {enclosure:#?}", machine.name);
                assert!(enclosure.hazards.is_empty(), "{about}");
                let output = &enclosure.outputs[0];
                let range = output.range.unwrap();
                let ends = [low, high].map(|end| exact(f64::from(end as f32)));
                // Allow for the error of the run itself.
                let slack = 4.0 * ulp(range.magnitude());
                assert!(range.low <= ends[0] + slack && ends[1] - slack <= range.high, "{about}");
                let ulps = output.ulps().unwrap();
                assert!(ulps <= most, "{ulps} ulps, {about}");
                // The range is at most three times as wide as the exact one.
                assert!(range.high - range.low <= 3.0 * (ends[1] - ends[0]).abs() + 3.0, "{about}");
                let mut random = Random::new(8);
                check(&program, &enclosure, 60, &mut random);
            }
        }
    }
}

/// Soundness over random ranges: where a bound is given, no run exceeds it.
#[test]
fn no_run_of_a_function_exceeds_its_bound() {
    let mut random = Random::new(99);
    let functions = ["exp", "log", "tan", "asin", "atan", "tanh", "rint", "trunc", "floor", "ceil", "round"];
    let mut bounded = BTreeMap::new();
    for round in 0..330 {
        let function = functions[round % functions.len()];
        let machine = MACHINES[round / functions.len() % MACHINES.len()];
        let size = [0.1, 1.0, 3.0, 20.0, 80.0][random.below(5) as usize];
        let low = (f64::from(random.below(2000)) / 1000.0 - 1.0) * size;
        let high = low + f64::from(random.below(1000)) / 1000.0 * size;
        let range = if ["log"].contains(&function) {
            (low.abs() + 0.01, low.abs() + 0.01 + high - low)
        } else {
            (low, high)
        };
        let program = of_library(function, range, round % 2 == 1, machine);
        let enclosure = enclose(&program).unwrap();
        let result = std::panic::catch_unwind(|| {
            let mut random = Random::new(round as u64);
            check(&program, &enclosure, 40, &mut random);
        });
        assert!(result.is_ok(), "{function} of {range:?} on {}: {enclosure:#?}", machine.name);
        *bounded.entry(function).or_insert(0) += usize::from(enclosure.outputs[0].error.is_some());
    }
    let least =
        [("exp", 30), ("log", 30), ("rint", 30), ("atan", 25), ("tanh", 20), ("floor", 20), ("trunc", 15)];
    assert!(least.iter().all(|(function, least)| bounded[function] >= *least), "{bounded:?}");
}

/// Range of a period's output, given its declarations; the enclosure must list no hazard.
fn range(declarations: &str, period: &str) -> (f64, f64) {
    let (found, enclosure) = problems(declarations, period);
    let range = enclosure.outputs[0].range.unwrap();
    assert_eq!(found, [], "{enclosure:?}");
    (range.low, range.high)
}

#[test]
fn each_iteration_is_a_place_of_its_own() {
    let ports = ".input n:int, m:int\n.output y\n.reg s\n.range n = 0, 1\n.range m = 0, 1\n";
    // A loop whose body is one bundle.
    let one = " mov s, 2.0\n.loop_bound 3\nh: bnz n, h\n mov y, s\n";
    assert_eq!(range(ports, one), (2.0, 2.0));
    // Two back edges to the head, which executes three times: the last time by the first edge, since the second does not lead out.
    let two = " mov s, zero\n.loop_bound 3\nh: bz n, far\n fadd s, s, 1.0\n bnz m, h\n jmp out\nfar: fadd s, s, 2.0\n jmp h\n\
               out: mov y, s\n";
    assert_eq!(range(ports, two), (1.0, 5.0));
}

#[test]
fn an_error_of_one_sign_moves_the_range_to_its_side() {
    // The sum is 1 in the run and larger exactly, so the difference's range begins at 0 in the run.
    let (low, high) =
        range(&format!("{ONE_INPUT}.range x = 0.9, 1\n"), " mov f, 1.0\n fadd f, f, 5.9e-8\n fsub y, f, x\n");
    assert!(low <= 0.0 && high >= f64::from(1.0 - 0.9f32), "{low} {high}");
}

#[test]
fn magnitude_of_a_non_negative_value_is_itself() {
    let (low, high) =
        range(&format!(".ports latched\n{ONE_INPUT}.range x = 0, 2\n"), " fabs f, x\n fsub y, f, x\n");
    assert!(-1e-3 < low && high < 1e-3, "{low} {high}");
}

#[test]
fn rejects_loads_from_too_many_words() {
    let machine = Box::leak(Box::new(Machine { data_depth: 8192, ..F3 }));
    let of = |last: u32| {
        let text = format!(
            ".input n:int\n.output y\n.range n = 0, {last}\n{HEAD} ld y, V[n]\n wait p\n.data\nV: .space 8192\n"
        );
        enclose(&source(&text, machine)).map_err(|error| error.refusal)
    };
    assert!(of(4095).is_ok());
    assert!(matches!(of(4096), Err(Refusal::Limit { limit: 4096, .. })));
}

#[test]
fn bits_of_a_float_with_an_error_are_no_integer() {
    let program = source(
        &format!(".input x\n.output y\n.reg f\n{HEAD} fmul f, x, 0.1\n itof y, f:bits\n wait p\n"),
        &F3,
    );
    let (shadow, _) = run(&program, Shadow::new(&program), &[floats(&program, &[("x", 0.7)])]);
    let lost: Vec<(u64, bool)> = shadow.lost().values().map(|lost| (lost.count, lost.infinite)).collect();
    assert_eq!(lost, [(1, false)]);
}

/// Terms added to 2^23 are rounded to integers, unless they are so large that the sum lies in another binade.
#[test]
fn a_large_term_is_no_integer_to_round_to() {
    let program = source(&format!(".input x\n.output y\n{HEAD} fadd y, x, 8388608.0\n wait p\n"), &F3);
    for (x, error) in [(3.25, 0.0), (5_000_000.5, 0.5)] {
        let (shadow, _) = run(&program, Shadow::new(&program), &[floats(&program, &[("x", x)])]);
        assert_eq!(shadow.outputs()[0].absolute.unwrap().error, error, "{x}");
    }
}
