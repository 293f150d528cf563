// SPDX-License-Identifier: MIT OR Apache-2.0
//! A hand-written law with a body made by `takt model` (`programs/examples/panda`): its torques compared with the same law in binary64 with
//! Pinocchio's inverse dynamics. Also bodies by themselves.

use crate::common::{Reference, numbers};
use serde_json::json;
use std::f64::consts::{PI, TAU};
use std::path::{Path, PathBuf};
use takt_asm::{FileLoader, MemoryLoader, Options as Assembling, Search};
use takt_emu::{Emulator, Number};
use takt_front::graph::{Delays, Function, Rewrites};
use takt_front::robot::functions::{Options, RobotFunction, derive};
use takt_front::robot::urdf;
use takt_front::sink::{Layout, source};
use takt_isa::T3;

const JOINTS: usize = 7;
const PERIODS: usize = 400;
const PERIOD: f64 = 1e-3;
const COUNTS: f64 = (1 << 20) as f64;
/// Tolerance, relative to the largest torque of all axes.
const CLOSE: f64 = 1e-5;

type Axes = [f64; JOINTS];

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../programs/examples/panda")
}

fn of(axis: impl FnMut(usize) -> f64) -> Axes {
    std::array::from_fn(axis)
}

/// Reference positions, velocities and accelerations of period `k`.
fn reference(k: usize) -> [Axes; 3] {
    let (t, rate) = (k as f64 * PERIOD, |i: usize| 3.0 + i as f64);
    let rest = [0.0, -0.5, 0.0, -2.2, 0.0, 1.8, 0.8];
    // Rounded to binary32, as the machine reads them.
    let rounded = |x: f64| f64::from(x as f32);
    [
        of(|i| rounded(rest[i] + 0.4 * (rate(i) * t).sin())),
        of(|i| rounded(0.4 * rate(i) * (rate(i) * t).cos())),
        of(|i| rounded(-0.4 * rate(i).powi(2) * (rate(i) * t).sin())),
    ]
}

/// Encoder counts of a robot that lags behind and trembles.
fn counts(k: usize) -> [i32; JOINTS] {
    let behind = reference(k.saturating_sub(4))[0];
    std::array::from_fn(|i| {
        ((behind[i] + 0.002 * (0.7 * k as f64 + i as f64).sin()) * COUNTS / TAU).round() as i32
    })
}

#[test]
fn a_law_with_a_body_is_the_law_in_binary64() {
    let loader = Search::new(FileLoader::new(folder())).library(takt_programs::LIBRARY);
    let text = std::fs::read(folder().join("law.s")).expect("the law");
    let assembled = takt_asm::assemble_bytes("law.s", text, &loader, &Assembling::default());
    let program = assembled.unwrap_or_else(|errors| panic!("{}", errors.render(false))).program;
    let mut emulator = Emulator::new(&program).expect("the program");
    // The law, written again in binary64. The filter and the differences of counts are states.
    let alpha = 1.0 - (-2.0 * PI * 80.0 * PERIOD).exp();
    let (mut v, mut before, mut states) = ([0.0; JOINTS], counts(0), Vec::new());
    let mut computed = Vec::new();
    for k in 0..PERIODS {
        let ([qr, qdr, qddr], n) = (reference(k), counts(k));
        let q = of(|i| f64::from(n[i]) * TAU / COUNTS);
        v = of(|i| v[i] + alpha * (f64::from(n[i] - before[i]) * TAU / COUNTS / PERIOD - v[i]));
        before = n;
        let qdd = of(|i| qddr[i] + 40.0 * (qdr[i] - v[i]) + 400.0 * (qr[i] - q[i]));
        states.push([q, v, qdd].concat());
        for i in 0..JOINTS {
            let mut set = |name: &str, value| {
                emulator.set_input(&format!("{name}[{}]", i + 1), value).expect("a port");
            };
            set("n", Number::Integer(n[i]));
            for (name, values) in [("qr", qr), ("qdr", qdr), ("qddr", qddr)] {
                set(name, Number::Float(values[i] as f32));
            }
        }
        let report = emulator.run_period(&[]).expect("a period");
        assert!(report.cycles < 400, "{}", report.cycles);
        computed.push(of(|i| match emulator.output(&format!("tau[{}]", i + 1)).expect("a port") {
            Some(Number::Float(value)) => f64::from(value),
            other => panic!("{other:?}"),
        }));
    }
    let joints: Vec<String> = (1..=JOINTS).map(|i| format!("panda_joint{i}")).collect();
    let answer = Reference::start().ask(&json!({
        "urdf": folder().join("panda.urdf"), "joints": joints, "base": "panda_link0", "function": "inverse-dynamics", "states": states,
    }));
    let dynamics = answer["outputs"].as_array().expect("rows");
    let viscous = [0.8, 1.0, 0.6, 0.7, 0.3, 0.2, 0.2];
    let coulomb = [0.6, 0.9, 0.5, 0.9, 0.7, 0.3, 0.4];
    let (mut limited, mut worst) = (0, 0.0_f64);
    for (k, (tau, row)) in computed.iter().zip(dynamics).enumerate() {
        let (row, qdr) = (numbers(row), reference(k)[1]);
        let expected = of(|i| {
            let most = if i < 4 { 87.0 } else { 12.0 };
            let dry = (qdr[i] / 0.02).clamp(-1.0, 1.0);
            (row[i] + viscous[i] * qdr[i] + coulomb[i] * dry).clamp(-most, most)
        });
        limited += usize::from(expected.iter().any(|tau| tau.abs() == 87.0));
        let size = expected.iter().fold(0.0, |size: f64, x| size.max(x.abs()));
        worst = tau.iter().zip(&expected).fold(worst, |worst, (x, y)| worst.max((x - y).abs() / size));
    }
    assert!(worst < CLOSE, "{worst:.1e}");
    // The comparison covers periods with and without saturation.
    assert!(limited > 0 && limited < PERIODS / 2, "{limited}");
}

fn panda(what: RobotFunction, tip: &str) -> Function {
    let text = std::fs::read_to_string(folder().join("panda.urdf")).expect("the robot");
    let robot = urdf::read(&text, urdf::SNAP).expect("URDF").robot(None, None).expect("a robot");
    let options =
        Options { rewrites: Rewrites::ALL, delays: Delays::of(&T3), tip: Some(tip), kp: 100.0, kd: 20.0 };
    derive(&robot, what, &options).expect("equations")
}

/// Every function as a body, twice in one program under two prefixes: values equal the graph's, and constants, structural zeros and inputs
/// without effect have locations.
#[test]
fn every_function_can_be_a_body() {
    for (what, name, _) in RobotFunction::ALL {
        let function = panda(what, "panda_hand");
        let body = |prefix: &str| source(&function, &Layout::body(&function, prefix).expect("a body"));
        let mut law = ".output y\n.schedule on\n.period\nperiod:\n".to_owned();
        let mut inputs = vec![0.0; function.inputs.len()];
        for array in &function.input_arrays {
            for (k, index) in array.elements.iter().enumerate() {
                let (index, value) = (index.expect("dense"), 0.25 * (k as f64 + 1.0));
                inputs[index] = value;
                for prefix in ["a_", "b_"] {
                    law += &format!("        {prefix}{}[{}] = {value:?}\n", array.name, k + 1);
                }
            }
        }
        law += ".include \"a.s\"\n.include \"b.s\"\n        y = 0.0\n";
        let expected = function.evaluate(&inputs);
        let mut loader = MemoryLoader::default();
        for prefix in ["a", "b"] {
            loader.add(format!("{prefix}.s"), body(&format!("{prefix}_")));
        }
        let mut places = Vec::new();
        for array in &function.output_arrays {
            for (flat, index) in array.elements.iter().enumerate() {
                let (row, column) =
                    (flat / array.shape[array.shape.len() - 1], flat % array.shape[array.shape.len() - 1]);
                let place = match array.shape.len() {
                    1 => format!("{}[{}]", array.name, flat + 1),
                    _ if array.is_symmetric() && column > row => continue,
                    _ => format!("{}[{},{}]", array.name, row + 1, column + 1),
                };
                places.push((place, index.map_or(0.0, |index| expected[index])));
            }
        }
        // A single output collects all comparisons: 1 if a body differs from the graph, 2 if the bodies differ.
        let size = expected.iter().fold(0.0, |size: f64, x| size.max(x.abs()));
        for (place, value) in &places {
            law += &format!("        y = abs(a_{place} - ({value:?})) > {:?} ? 1.0 : y\n", 1e-5 * size);
            law += &format!("        y = abs(b_{place} - a_{place}) > 0.0 ? 2.0 : y\n");
        }
        law += "        wait    period\n";
        let options = Assembling { machine: T3.holding(8192, 0).expect("a depth"), ..Assembling::default() };
        let assembled = takt_asm::assemble_bytes("law.s", law.into_bytes(), &Search::new(loader), &options);
        let program = assembled.unwrap_or_else(|errors| panic!("{name}: {}", errors.render(false))).program;
        let mut emulator = Emulator::new(&program).expect("the program");
        emulator.run_period(&[]).expect("a period");
        assert_eq!(emulator.output("y").expect("a port"), Some(Number::Float(0.0)), "{name}");
    }
    let function = panda(RobotFunction::Gravity, "panda_hand");
    for prefix in ["", "7x_", "a b", "é_", "_id"] {
        let error = Layout::body(&function, prefix).err().expect("an error").to_string();
        assert!(error.contains("cannot begin a name"), "{error}");
    }
}
