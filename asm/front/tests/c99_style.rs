// SPDX-License-Identifier: MIT OR Apache-2.0
//! C in the style of public projects (VESC, Betaflight, Crazyflie, Embedded Coder), and CasADi's own, which it writes when the test runs:
//! outputs against gcc.
#![allow(clippy::print_stdout)]

use crate::c99::word;
use crate::common::gcc::{Program, compiled, difference, emulated, folder, matches_gcc, same, translated};
use crate::common::python;
use rand_pcg::Pcg32;
use rand_pcg::rand_core::SeedableRng;
use std::fmt::Write as _;
use std::path::Path;
use std::process::Command;
use takt_asm::{MemoryLoader, Options as Assembling, Search};
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
        program.loop_bound = (name == "program").then_some(60);
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

/// Marker of the kernels' table in docs/c.md.
const KERNELS: &str = "<!-- table: kernels, written by `TAKT_BLESS=1 cargo test --release -p takt-front --test suite kernels` -->\n";

/// Cycles of a period on t3, in the worst case.
fn cycles(translation: &Translation) -> u64 {
    let loader = Search::new(MemoryLoader::default()).library(takt_programs::LIBRARY);
    let machine = T3.holding(1_024, 4_096).expect("memories");
    let options = Assembling { machine, ..Assembling::default() };
    let text = translation.text.clone().into_bytes();
    let assembled = takt_asm::assemble_bytes("kernel.s", text, &loader, &options);
    let assembled = assembled.unwrap_or_else(|errors| panic!("{}", errors.render(false)));
    takt_analysis::bound(&assembled.program).expect("a bound").worst_period().expect("a period")
}

/// The kernels in C that other processors run (`benches/others`): results against gcc's, cycles beside those of the programs by hand.
#[test]
fn kernels_beside_assembly() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let kernels = std::fs::read_to_string(root.join("benches/others/kernels.c")).expect("the kernels");
    let library = std::fs::read_to_string(root.join("docs/library.md")).expect("docs/library.md");
    let folder = folder("kernels");
    let mut table = "| kernel | by hand | from C | |\n|---|---|---|---|\n".to_owned();
    for name in ["cosf", "deg2rad", "fir2dim", "iir", "lms", "ludcmp", "minver", "st", "qp"] {
        let code = match name {
            "qp" => read("qp.c"),
            _ => format!(
                "#ifndef __TAKT__\n#define __TAKT__ 1\n#endif\n#define KERNEL_{name} 1\n{kernels}\n\
                 float checked(int n) {{ kernel(); return result[(unsigned)n % RESULTS]; }}\n"
            ),
        };
        // Results that the kernel leaves in memory, of known inputs.
        let mut program = Program::new(name, &code);
        (program.step, program.init) = ("checked".to_owned(), Some("prepare".to_owned()));
        let translation = translated(&program, &folder).unwrap_or_else(|error| panic!("{error}"));
        let given = inputs(&translation, 7);
        let expected = compiled(&[(&program, &translation, &given)], &folder).remove(0);
        let found = emulated(&program, &translation, &T3, &given);
        if let Some(text) = difference(&program, &translation, &given, &expected, &found) {
            panic!("{text}");
        }
        (program.step, program.init) = ("kernel".to_owned(), None);
        let translation = translated(&program, &folder).unwrap_or_else(|error| panic!("{error}"));
        let row = library.lines().find(|line| line.starts_with(&format!("| `{name}.s` | ")));
        let by_hand: u64 = row.and_then(|row| row.split('|').nth(3)?.trim().parse().ok()).expect("a row");
        let from_c = cycles(&translation);
        let _ =
            writeln!(table, "| `{name}` | {by_hand} | {from_c} | × {:.2} |", from_c as f64 / by_hand as f64);
    }
    let _ = std::fs::remove_dir_all(folder);
    let path = root.join("docs/c.md");
    let text = std::fs::read_to_string(&path).expect("docs/c.md");
    let at = text.find(KERNELS).expect("the marker") + KERNELS.len();
    let rows = text[at..].split_inclusive('\n').take_while(|line| line.starts_with('|'));
    let end = at + rows.map(str::len).sum::<usize>();
    if std::env::var_os("TAKT_BLESS").is_some() {
        std::fs::write(path, format!("{}{table}{}", &text[..at], &text[end..])).expect("docs/c.md");
        return;
    }
    assert_eq!(&text[at..end], table, "TAKT_BLESS=1 rewrites docs/c.md");
}
