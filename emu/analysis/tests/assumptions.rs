// SPDX-License-Identifier: MIT OR Apache-2.0
//! Enclosures that rely on `.assume`, and results in arrays (`.result`).

use crate::accuracy::source;
use takt_analysis::accuracy::{Enclosure, OutputPlace, Problem, Shadow, enclose};
use takt_emu::Emulator;
use takt_emu::testing::Random;
use takt_isa::{F3, Program, Type};

const INVERSE: &str = "\
.ports  latched
.input  x, y
.range  x, y = 0, 4
.output a, b
.reg    d
.once
        wait    p
.period
p:      d = x*x - y
        ASSUME
        a = 1/d
        b = x + 1
        wait    p
";

fn enclosed(text: &str) -> (Program, Enclosure) {
    let program = source(text, &F3);
    let enclosure = enclose(&program).unwrap();
    (program, enclosure)
}

#[test]
fn an_assumption_keeps_a_divisor_from_zero() {
    let (_, without) = enclosed(&INVERSE.replace("ASSUME", ""));
    assert_eq!(
        without.hazards.iter().map(|hazard| hazard.problem).collect::<Vec<_>>(),
        [Problem::DivisionByZero]
    );
    assert!(without.relied.is_empty() && without.outputs[0].range.is_none());
    let (program, with) = enclosed(&INVERSE.replace("ASSUME", ".assume d >= 0.5"));
    assert!(with.hazards.is_empty(), "{with:#?}");
    let range = with.outputs[0].range.unwrap();
    assert!((range.high - 2.0).abs() < 1e-6 && range.low > 0.06, "{range:?}");
    let [relied] = &with.relied[..] else { panic!("{with:#?}") };
    assert_eq!(
        (program.register_text(relied.register).as_str(), &relied.outputs[..]),
        ("d", &["a".to_owned()][..])
    );
    assert_eq!(relied.assumption.bounds(), [(">=", "0.5".to_owned())]);
    // The operation's own result is within the range: nothing relies on the assumption.
    let (_, loose) = enclosed(&INVERSE.replace("ASSUME", ".assume d <= 100"));
    assert!(loose.relied.is_empty());
    // The condition narrows the operands, too.
    let (_, back) = enclosed(&INVERSE.replace("ASSUME", ".assume d >= 0.5\n.assume d <= 2"));
    let range = back.outputs[1].range.unwrap();
    assert!(range.low > 1.1 && range.high < 4.6, "{range:?}");
}

/// No run that keeps the assumption exceeds a bound that relies on it.
#[test]
fn no_run_that_keeps_an_assumption_exceeds_a_bound() {
    let mut random = Random::new(4);
    let (mut kept, mut tight) = (0, 0);
    for round in 0..60u32 {
        let [f, g, h] =
            [(); 3].map(|()| ["x*y - z", "x - y*z", "x*x - y", "z*z - x*y"][random.below(4) as usize]);
        let least = f64::from(random.below(100)) / 50.0 - 1.0;
        let sign = if round % 3 == 0 { "<=" } else { ">=" };
        let text = format!(
            ".ports latched\n.input x, y, z\n.range x = -1, 2\n.range y = 0.5, 3\n.range z = -2, 1\n.output a, b, d\n.reg t\n.schedule on\n\
             .once\n wait p\n.period\np: d = {f}\n.assume d {sign} {least:?}\n t = {g}\n a = t*d\n b = {h} + d\n wait p\n"
        );
        let program = source(&text, &F3);
        let assumption = program.assumptions[0];
        let enclosure = enclose(&program).unwrap();
        for _ in 0..200 {
            let mut emulator = Emulator::new(&program).unwrap();
            let mut shadow = Shadow::new(&program).each_period_afresh().keeping_assumptions();
            shadow.run_period(&mut emulator).unwrap();
            for range in &program.ranges {
                let (low, high) = range.ends();
                let part = f64::from(random.below(1 << 20)) / f64::from(1 << 20);
                let value = ((low + part * (high - low)) as f32).clamp(low as f32, high as f32);
                emulator.set_input_bits(range.register, value.to_bits()).unwrap();
            }
            shadow.run_period(&mut emulator).unwrap();
            let place = |name: &str| program.outputs.iter().find(|port| port.name == name).unwrap().register;
            if !assumption.holds(emulator.register(place("d")).unwrap()) {
                continue;
            }
            kept += 1;
            for (bound, output) in enclosure.outputs.iter().zip(shadow.outputs()) {
                let Some(worst) = output.absolute else { continue };
                let range = bound.range.unwrap();
                assert!(range.contains(worst.value), "{text}{}: {worst:?} of {range:?}", bound.name);
                assert!(worst.error <= bound.error.unwrap() + 1e-12, "{text}{}: {worst:?}", bound.name);
                tight += usize::from(worst.value < range.low + 0.1 * (range.high - range.low));
            }
        }
    }
    assert!(kept > 3000 && tight > 500, "{kept} periods, {tight} close to an end");
}

/// An assumption holds for the exact value, too: where the error may exceed it, the exact divisor is not zero. A period in which either value
/// breaks the assumption is left out of a measurement that keeps them.
#[test]
fn the_exact_value_keeps_an_assumption() {
    let text = "\
.ports  latched
.input  x, y
.range  x, y = 1e8, 2e8
.output a
.reg    d
.once
        wait    p
.period
p:      d = x*1.1 - y*1.1
        .assume d >= 0.5
        a = 1/d
        wait    p
";
    let (program, enclosure) = enclosed(text);
    assert!(enclosure.hazards.is_empty() && enclosure.relied.len() == 1, "{enclosure:?}");
    let measured = |x: f32, y: f32| {
        let mut emulator = Emulator::new(&program).unwrap();
        let mut shadow = Shadow::new(&program).each_period_afresh().keeping_assumptions();
        shadow.run_period(&mut emulator).unwrap();
        for (port, value) in program.inputs.iter().zip([x, y]) {
            emulator.set_input_bits(port.register, value.to_bits()).unwrap();
        }
        shadow.run_period(&mut emulator).unwrap();
        shadow.outputs()[0].absolute
    };
    let bound = enclosure.outputs[0].error.unwrap();
    assert!(measured(2e8, 1e8).is_some_and(|worst| worst.error <= bound));
    assert_eq!(measured(1e8, 2e8), None);
}

#[test]
fn assumptions_survive_images_disassembly_and_the_scheduler() {
    let text = INVERSE.replace("ASSUME", ".assume d >= 0.5\n.assume d <= 8");
    for text in [text.clone(), format!(".schedule on\n{text}")] {
        let program = source(&text, &F3);
        let [assumption] = program.assumptions[..] else { panic!("{:?}", program.assumptions) };
        assert_eq!((assumption.ty, assumption.ends()), (Type::F, (0.5, 8.0)));
        // The difference computes d, in whichever bundle.
        let line = program.lines[assumption.word as usize].unwrap().line;
        assert_eq!(program.files.len(), 1);
        assert!(text.lines().nth(line as usize - 1).unwrap().contains("d = x*x - y"));
        let bytes = takt_asm::image::write(&program).unwrap();
        assert_eq!(takt_asm::image::read(&bytes).unwrap().assumptions, program.assumptions);
        let again = source(&takt_asm::disasm::disassemble(&program), &F3);
        assert_eq!(again.assumptions, program.assumptions);
        // It costs nothing.
        let plain = source(&text.replace(".assume d >= 0.5", "").replace(".assume d <= 8", ""), &F3);
        assert_eq!(plain.code, program.code);
    }
}

/// Error message of a program.
fn refused(text: &str) -> String {
    let loader = takt_asm::MemoryLoader::new(&[]);
    let options = takt_asm::Options { machine: &F3, ..takt_asm::Options::default() };
    let result = takt_asm::assemble_bytes("test.s", text.into(), &loader, &options);
    result.err().map(|diagnostics| diagnostics.render(false)).unwrap_or_default()
}

#[test]
fn mistakes_in_assumptions_and_results_are_reported() {
    let cases = [
        (".assume e >= 0", "`e`"),
        (".assume d >= 1/0", "error"),
        (".assume b >= 1", "no operation since the last label or jump writes `b`"),
        (
            ".assume d >= 2\n.assume d <= 1",
            "this assumption is invalid: its least value is above its largest",
        ),
        (".assume d = 1", "`>=`"),
        (".result d", "`d` is no array in data memory"),
        (".result nothing", "nothing"),
    ];
    for (line, expected) in cases {
        let message = refused(&INVERSE.replace("ASSUME", line));
        assert!(message.contains(expected), "{line}: {message}");
    }
    let twice = ".array A[2]\n.result A, A\n.output y\n.period\np: y = 1\n wait p\n";
    assert!(refused(twice).contains("this array is a result already"), "{}", refused(twice));
}

#[test]
fn results_in_arrays_are_outputs() {
    let text = ".input x\n.range x = 1, 2\n.output y\n.array A[3] B[2]:int\n.result A, B\n.once\n wait p\n.period\n\
                p: y = x\n A[1] = x\n A[2] = x*x*x\n A[3] = x + 1\n B[2] = 7\n wait p\n";
    let (program, enclosure) = enclosed(text);
    let names: Vec<&str> = enclosure.outputs.iter().map(|output| output.name.as_str()).collect();
    assert_eq!(names, ["y", "A+1", "B+1"]);
    let [_, a, b] = &enclosure.outputs[..] else { panic!() };
    let first = program.results[0].first;
    assert_eq!(a.place, OutputPlace::Array(first));
    let range = a.range.unwrap();
    assert!(range.low == 1.0 && range.high >= 8.0 && range.high < 8.001, "{range:?}");
    let range = b.range.unwrap();
    assert_eq!((range.low, range.high, b.error), (0.0, 7.0, None));
    // Measured: the product is the only element with an error.
    let mut emulator = Emulator::new(&program).unwrap();
    let mut shadow = Shadow::new(&program);
    for value in [1.1f32, 1.3, 1.7] {
        emulator.set_input_bits(program.inputs[0].register, value.to_bits()).unwrap();
        shadow.run_period(&mut emulator).unwrap();
    }
    let measured = &shadow.outputs()[1];
    assert_eq!(measured.place, a.place);
    assert_eq!((shadow.outputs().len(), measured.name.as_str()), (2, "A+1"));
    let error = measured.absolute.unwrap().error;
    assert!(error > 0.0 && error <= a.error.unwrap(), "{error} of {:?}", a.error);
    let bytes = takt_asm::image::write(&program).unwrap();
    assert_eq!(takt_asm::image::read(&bytes).unwrap().results, program.results);
    let again = source(&takt_asm::disasm::disassemble(&program), &F3);
    assert_eq!(again.results.len(), 2);
}
