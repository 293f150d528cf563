// SPDX-License-Identifier: MIT OR Apache-2.0
//! Every function of every robot of `robots.json` compared with Pinocchio in binary64, which checks the equations. (The table in
//! docs/models.md has their rounding errors in binary32.)
//!
//! `cargo xtask test` installs Pinocchio and the robots; TAKT_VENV names another environment that has them.

use crate::common::{Case, Reference, cases, numbers, robot};
use serde_json::json;
use std::path::Path;
use takt_front::graph::{Delays, Rewrites};
use takt_front::robot::functions::{Options, RobotFunction, derive};
use takt_front::robot::urdf;

/// Largest error of any output, relative to the largest output of its state.
fn error(
    reference: &mut Reference,
    case: &Case,
    what: RobotFunction,
    rewrites: Rewrites,
    snap: f64,
    states: usize,
) -> f64 {
    let robot = robot(case, snap);
    let delays = Delays::of(&takt_isa::F3);
    let options = Options { rewrites, delays, tip: Some(&case.end), kp: 100.0, kd: 20.0 };
    let function = derive(&robot, what, &options).expect("equations");
    let joints: Vec<&str> = robot.joints.iter().map(|joint| joint.name.as_str()).collect();
    let answer = reference.ask(&json!({
        "urdf": case.urdf, "joints": joints, "base": robot.base, "tip": case.end, "function": what.name(),
        "states": states, "seed": 1, "kp": options.kp, "kd": options.kd,
    }));
    let states = answer["inputs"]
        .as_array()
        .expect("states")
        .iter()
        .zip(answer["outputs"].as_array().expect("states"));
    let mut worst: f64 = 0.0;
    for (inputs, outputs) in states {
        let expected = numbers(outputs);
        let computed = function.evaluate(&numbers(inputs));
        assert_eq!(computed.len(), expected.len());
        let size = expected.iter().fold(0.0, |size: f64, x| size.max(x.abs()));
        for (computed, expected) in computed.iter().zip(&expected) {
            let error = (computed - expected).abs() / size;
            assert!(error.is_finite(), "{}: {}", case.name, what.name());
            worst = worst.max(error);
        }
    }
    worst
}

fn states() -> usize {
    if std::env::var_os("TAKT_FULL").is_some() { 10_000 } else { 10 }
}

#[test]
fn equations_are_right() {
    let mut reference = Reference::start();
    for case in cases(&mut reference) {
        for (what, name, _) in RobotFunction::ALL {
            // Angles that are rounded to quarter turns are off by up to 3e-9 in these files.
            let error = error(&mut reference, &case, what, Rewrites::ALL, urdf::SNAP, states());
            assert!(error < 1e-6, "{}: {name}: {error:.1e}", case.name);
        }
    }
}

/// Random trees: skew axes of any length, prismatic joints in between, fixed ones, parallel and opposite axes, inertias without zeros. Half
/// of them use exact rewrites only.
#[test]
fn equations_are_right_for_any_tree() {
    let mut reference = Reference::start();
    let trees = if std::env::var_os("TAKT_FULL").is_some() { 200 } else { 12 };
    let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("tree-{}.urdf", std::process::id()));
    for seed in 0..trees {
        let (source, end) = any_tree(seed);
        std::fs::write(&path, &source).expect("a file");
        let case = Case {
            name: format!("tree {seed}"),
            urdf: path.to_string_lossy().into_owned(),
            source,
            base: None,
            tip: None,
            end,
        };
        let rewrites = if seed % 2 == 0 { Rewrites::ALL } else { Rewrites::EXACT };
        for (what, name, _) in RobotFunction::ALL {
            let error = error(&mut reference, &case, what, rewrites, 0.0, 5);
            assert!(error < 1e-9, "{}: {name}: {error:.1e}\n{}", case.name, case.source);
        }
    }
    std::fs::remove_file(path).expect("removed");
}

/// Pseudorandom numbers from a seed.
struct Numbers(u64);

impl Numbers {
    fn below(&mut self, n: u64) -> u64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) % n
    }

    fn within(&mut self, size: f64) -> f64 {
        size * (self.below(2_000_001) as f64 / 1e6 - 1.0)
    }

    fn three(&mut self, size: f64) -> String {
        format!("{} {} {}", self.within(size), self.within(size), self.within(size))
    }
}

/// A random tree in URDF, and its last link.
fn any_tree(seed: u64) -> (String, String) {
    let mut random = Numbers(seed.wrapping_mul(7919) + 1);
    let joints = 3 + random.below(7);
    let mut text = "<robot name=\"tree\"><link name=\"l0\"/>".to_owned();
    for joint in 1..=joints {
        let kind = ["revolute", "continuous", "revolute", "prismatic", "fixed"][random.below(5) as usize];
        // The last joint moves, and so does the first.
        let kind = if joint == joints || joint == 1 { "revolute" } else { kind };
        let parent = if random.below(4) == 0 { random.below(joint) } else { joint - 1 };
        let parent = if joint == 1 { 0 } else { parent };
        let rpy = match random.below(4) {
            0 => "0 0 0".to_owned(),
            1 => format!("{} 0 0", [1.0, -1.0, 2.0][random.below(3) as usize] * std::f64::consts::FRAC_PI_2),
            _ => random.three(3.0),
        };
        let axis = match random.below(3) {
            0 => "0 0 1".to_owned(),
            1 => ["0 0 -2", "1 0 0", "0 -1 0", "0 1 1"][random.below(4) as usize].to_owned(),
            _ => random.three(1.0),
        };
        let (xyz, centre, turned) = (random.three(0.5), random.three(0.2), random.three(3.0));
        let mass = 0.1 + random.within(1.0).abs();
        let [a, b, c] = [0; 3].map(|_: i32| 0.05 + random.within(0.05).abs());
        text += &format!(
            "<link name=\"l{joint}\"><inertial><origin xyz=\"{centre}\" rpy=\"{turned}\"/><mass value=\"{mass}\"/>\
             <inertia ixx=\"{a}\" ixy=\"0.001\" ixz=\"-0.002\" iyy=\"{b}\" iyz=\"0.003\" izz=\"{c}\"/></inertial></link>\
             <joint name=\"j{joint}\" type=\"{kind}\"><parent link=\"l{parent}\"/><child link=\"l{joint}\"/>\
             <origin xyz=\"{xyz}\" rpy=\"{rpy}\"/><axis xyz=\"{axis}\"/>\
             <limit lower=\"-3\" upper=\"3\" effort=\"1\" velocity=\"1\"/></joint>"
        );
    }
    (text + "</robot>", format!("l{joints}"))
}
