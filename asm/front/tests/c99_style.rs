// SPDX-License-Identifier: MIT OR Apache-2.0
//! C in the style of public projects (VESC, Betaflight, Crazyflie, Embedded Coder), and CasADi's own, which it writes when the test runs:
//! outputs against gcc.
#![allow(clippy::print_stdout)]

use crate::c99::word;
use crate::common::gcc::{Program, compiled, emulated, folder, matches_gcc, same, translated};
use crate::common::python;
use rand_pcg::Pcg32;
use rand_pcg::rand_core::SeedableRng;
use std::path::Path;
use std::process::Command;
use takt_front::c::Translation;
use takt_isa::T3;

const PERIODS: usize = 60;

fn inputs(translation: &Translation, seed: u64) -> Vec<Vec<u32>> {
    let mut random = Pcg32::seed_from_u64(seed);
    let row = |_| translation.inputs.iter().map(|port| word(&mut random, port.float)).collect();
    (0..PERIODS).map(row).collect()
}

fn read(file: &str) -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/c").join(file);
    std::fs::read_to_string(path).expect("a file of the tests")
}

/// Translates a file, and compares all periods bit for bit on every machine.
fn check(name: &str, double_is_float: bool) -> Translation {
    let mut program = Program::new(name, &read(&format!("{name}.c")));
    program.double_is_float = double_is_float;
    matches_gcc(&program, |translation| inputs(translation, 3))
}

#[test]
fn motor_control_in_the_style_of_vesc() {
    let text = check("foc", true).text;
    // Names and lines of the C are in the program.
    assert!(text.contains("m_motor_1_m_motor_state_vd_int = ") && text.contains("; foc.c:"), "{text}");
}

#[test]
fn rates_in_the_style_of_betaflight() {
    let text = check("betaflight", false).text;
    // Axes are written out, gains are numbers, filters states: no memory, no branches.
    assert!(!text.contains(".array") && !text.contains("bz "), "{text}");
}

#[test]
fn an_attitude_in_the_style_of_crazyflie() {
    check("crazyflie", false);
}

#[test]
fn fixed_point_in_the_style_of_embedded_coder() {
    let translation = check("simulink", false);
    let names: Vec<&str> = translation.inputs.iter().map(|port| port.c.as_str()).collect();
    assert_eq!(names, ["rtU.speed", "rtU.target", "rtU.enable", "rtU.current"]);
}

/// CasADi's functions, exported as C: within some ulps of gcc's results where they have sines.
#[test]
fn functions_that_casadi_writes() {
    let folder = folder("casadi");
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/c/casadi_code.py");
    let done = Command::new(python()).arg(script).arg(&folder).output().expect("Python");
    assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
    for name in String::from_utf8_lossy(&done.stdout).split_whitespace() {
        let code = std::fs::read_to_string(folder.join(format!("{name}.c"))).expect("written");
        let mut program = Program::new(name, &code);
        program.double_is_float = true;
        let translation = translated(&program, &folder).unwrap_or_else(|error| panic!("{error}"));
        let mut inputs = inputs(&translation, 5);
        for word in inputs.iter_mut().flatten() {
            let small = f32::from_bits(*word);
            *word = (small % 3.0).to_bits();
        }
        let expected = compiled(&[(&program, &translation, &inputs)], &folder).remove(0);
        let found = emulated(&program, &translation, &T3, &inputs);
        let mut worst = 0.0_f32;
        for (expected, found) in expected.iter().zip(&found) {
            let size = expected.iter().map(|word| f32::from_bits(*word).abs()).fold(1.0, f32::max);
            for (a, b) in expected.iter().zip(found) {
                if !same(true, *a, *b) {
                    worst = worst.max((f32::from_bits(*a) - f32::from_bits(*b)).abs() / size);
                }
            }
        }
        println!(
            "{name}: {} inputs, {} outputs, within {worst:e}",
            translation.inputs.len(),
            translation.outputs.len()
        );
        assert!(worst < 1e-5, "{name}: {worst:e}");
    }
    let _ = std::fs::remove_dir_all(folder);
}
