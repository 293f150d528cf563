// SPDX-License-Identifier: MIT OR Apache-2.0
//! Parameters that the host sets between periods: `.param`.

use crate::common::{bad, bundles, good};
use takt_asm::{disasm, image};
use takt_emu::{Emulator, Number, PortError};
use takt_isa::program::ParameterError;
use takt_isa::{F1, F3, Type};

/// Name, bits at the start, and range of a parameter.
type Found = (String, u32, Option<(f64, f64)>);

/// The parameters of a source, in the order of declaration.
fn parameters(text: &str) -> Vec<Found> {
    let program = good(text).program;
    let of = |port: &takt_isa::program::Port| {
        let range = program.range(port.register).map(takt_isa::program::Range::ends);
        (port.name.clone(), program.initial(port.register).expect("it has a value"), range)
    };
    program.parameters.iter().map(of).collect()
}

const BODY: &str = ".input x\n.output F\n.period\np: F = kp*x\n wait p\n";

#[test]
fn values_and_ranges_are_those_of_the_source() {
    for (line, value, range) in [
        ("kp = 2.0", 2.0f32, None),
        ("kp = 2", 2.0, None),
        ("kp = 2.0 range 0..50", 2.0, Some((0.0, 50.0))),
        ("kp = -2.5 range -3..-1", -2.5, Some((-3.0, -1.0))),
        ("kp = 1e-3 range 1e-6..1e+3", 1e-3, Some((f64::from(1e-6f32), 1000.0))),
        ("kp = .5 range .25...75", 0.5, Some((0.25, 0.75))),
        ("kp = 2 range 0 .. 2*pi", 2.0, Some((0.0, f64::from((2.0 * std::f64::consts::PI) as f32)))),
        ("kp = 16 range 0x10..0x20", 16.0, Some((16.0, 32.0))),
        ("kp = LOW range LOW..HIGH", 1.0, Some((1.0, 9.0))),
    ] {
        let text = format!(".const LOW = 1\n.const HIGH = 9\n.param {line}\n{BODY}");
        let text = if line.contains("LOW") { text } else { format!(".param {line}\n{BODY}") };
        assert_eq!(parameters(&text), [("kp".to_owned(), value.to_bits(), range)], "{line}");
    }
}

#[test]
fn arrays_and_integers_are_parameters_too() {
    let text = ".param K[2,2] = 1, 2, 3, 4 range 0..9\n.param n:int = -3 range -8..7\n.param mask:bits = 0xff00\n\
                .param same[3] = 0.5\n.input x\n.output F, k:int\n.period\np: F = K[1,2]*x + same[3]\n iand k, mask, n\n wait p\n";
    let found = parameters(text);
    let names: Vec<&str> = found.iter().map(|parameter| parameter.0.as_str()).collect();
    assert_eq!(names, ["K[1,1]", "K[1,2]", "K[2,1]", "K[2,2]", "n", "mask", "same[1]", "same[2]", "same[3]"]);
    assert_eq!(found[1].1, 2.0f32.to_bits());
    assert_eq!(found[4], ("n".to_owned(), (-3i32).cast_unsigned(), Some((-8.0, 7.0))));
    assert_eq!((found[5].1, found[8].1), (0xff00, 0.5f32.to_bits()));
}

/// Inputs keep the numbers that they have without parameters.
#[test]
fn parameters_are_numbered_behind_the_inputs() {
    let program = good(&format!(".param kp = 2\n.param ki @ 5 = 1\n.input a, b @ 1\n{BODY}")).program;
    let number = |port: &takt_isa::program::Port| F3.input_number(port.register).expect("an input");
    let inputs: Vec<u16> = program.inputs.iter().map(number).collect();
    let parameters: Vec<u16> = program.parameters.iter().map(number).collect();
    assert_eq!((inputs, parameters), (vec![0, 1, 2], vec![3, 5]));
}

/// A parameter does not change within a period: equal subexpressions of it are computed once. An input port may change.
#[test]
fn parameters_are_constant_within_a_period() {
    let text = |declaration: &str| {
        format!("{declaration}\n.input x\n.output F, G\n.period\np: F = kp*kp + x\n G = kp*kp - x\n wait p\n")
    };
    let products = |text: &str| bundles(&good(text)).join("\n").matches("fmul").count();
    assert_eq!(products(&text(".param kp = 2")), 1);
    assert_eq!(products(&text(".input kp")), 2);
}

#[test]
fn mistakes_are_named() {
    for (lines, wanted) in [
        (".param kp", "`=`"),
        (".param kp = 60 range 0..50", "the value at the start lies outside of the range"),
        (".param kp = 2 range 50..0", "this range is invalid: its least value is above its largest"),
        (".param kp = 2 range 0", "`..`"),
        (".param kp = 2 between 0..50", "behind a parameter's value stands `range`"),
        (".param kp = inf", "a parameter's value is finite"),
        (".param kp = 1, 2, 3", "has 1 elements, and these are 3 values"),
        (".param k:int = 1.5\n.param kp = 1", "1.5"),
        (".param kp = 2\n.preset kp = 3", "`.param` states a parameter's value at the start"),
        (".param kp = 2 range 0..5\n.range kp = 0, 4", "this register has a range already"),
        (".param kp = 2\n.param kp = 3", "declared"),
        (".param kp = x", "x"),
    ] {
        let errors = bad(&format!("{lines}\n{BODY}"), &F3).render(false);
        assert!(errors.contains(wanted), "{lines}: {errors}");
    }
    let written = bad(".param kp = 2\n.input x\n.period\np: kp = x\n wait p\n", &F3).render(false);
    assert!(written.contains("`kp` is a parameter: it is set from outside only"), "{written}");
    // Elsewhere, a range in place of a number is a mistake with its own help.
    let range = bad(&format!(".input kp\n.const n = 1..3\n{BODY}"), &F3).render(false);
    assert!(range.contains("`1..3` is not a number"), "{range}");
}

/// Image and disassembly hold parameters with their values and ranges.
#[test]
fn images_and_disassembly_keep_parameters() {
    let text = format!(
        ".param K[2] = 0.1, -1e-42 range -1..1\n.param n:int = 7\n.param kp = 2\n.output k:int\n{BODY} k = n\n"
    );
    for machine in [&F3, &F1] {
        let program = crate::common::assemble(&text, machine).expect("it is valid").program;
        let read = image::read(&image::write(&program).expect("it can be written")).expect("it is an image");
        assert_eq!(read, program);
        let again =
            crate::common::assemble(&disasm::disassemble(&program), machine).expect("it assembles").program;
        assert_eq!(again.parameters, program.parameters);
        assert_eq!((again.constants, again.ranges), (program.constants, program.ranges));
    }
}

/// A set acts from the next period on; a value outside of the range is refused and changes nothing.
#[test]
fn parameters_act_from_the_next_period_on() {
    for latched in ["", ".ports latched\n"] {
        let program = good(
            &format!("{latched}.param kp = 2 range 0..50\n.param n:int = 1\n.output k:int\n{BODY}")
                .replace("F = kp*x", "F = kp*x\n k = n"),
        )
        .program;
        let mut emulator = Emulator::new(&program).expect("it fits");
        emulator.set_input("x", Number::Float(3.0)).expect("a port");
        let mut period = |set: &[(&str, Number)]| {
            for (name, value) in set {
                emulator.set_parameter(name, *value).expect("a value in the range");
            }
            emulator.run_period(&[]).expect("it waits");
            let refused = emulator.set_parameter("kp", Number::Float(51.0));
            assert!(
                matches!(refused, Err(PortError::Parameter(ParameterError::Outside { .. }))),
                "{refused:?}"
            );
            let refused = emulator.set_parameter("kq", Number::Float(1.0));
            assert!(refused.is_err_and(|error| error.to_string().contains("there are `kp`, `n`")));
            assert!(emulator.set_parameter("n", Number::Float(1.0)).is_err(), "another type");
            (emulator.output("F").expect("a port"), emulator.output("k").expect("a port"))
        };
        let expect = |f: f32, k: i32| (Some(Number::Float(f)), Some(Number::Integer(k)));
        assert_eq!(period(&[]), expect(6.0, 1), "the value of the source");
        assert_eq!(period(&[("kp", Number::Float(50.0)), ("n", Number::Integer(-4))]), expect(150.0, -4));
        assert_eq!(period(&[]), expect(150.0, -4), "it keeps its value");
    }
}

#[test]
fn the_value_at_the_start_can_be_another() {
    let mut program = good(&format!(".param kp = 2 range 0..50\n{BODY}")).program;
    assert!(program.set_parameter("kp", f32::NAN.to_bits()).is_err());
    assert!(program.set_parameter("kp", (-1.0f32).to_bits()).is_err());
    program.set_parameter("kp", 5.0f32.to_bits()).expect("it is in the range");
    let port = program.parameter("kp").expect("it is there").clone();
    assert_eq!((program.initial(port.register), port.ty), (Some(5.0f32.to_bits()), Type::F));
}
