// SPDX-License-Identifier: MIT OR Apache-2.0
//! Every robot of four Python packages: computed as by MuJoCo or Pinocchio, or refused with a message.
//!
//! Runs with TAKT_FULL (`cargo xtask test --full`). The packages are `example-robot-data` (URDF), `robosuite_models`, `dm_control` and
//! `gymnasium` (MJCF); packages that are not installed are skipped. `--nocapture` shows the result of each file.
#![allow(clippy::print_stdout)]

use crate::common::{Reference, numbers};
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::path::Path;
use takt_front::graph::{Delays, Rewrites};
use takt_front::robot::functions::{Options, RobotFunction, derive};
use takt_front::robot::{self, urdf};

/// Packages with models in MJCF.
const PACKAGES: [&str; 3] = ["robosuite_models", "dm_control", "gymnasium"];
/// Tolerance, relative to the largest output of a state.
const MOST: f64 = 1e-5;

/// Path of a robot's file, and its largest error or the message that refuses it.
type Robot = (String, Result<f64, String>);

/// Largest error of inverse dynamics, or the message that refuses the robot.
fn computed(reference: &mut Reference, key: &str, path: &str) -> Result<f64, String> {
    let bytes = std::fs::read(path).expect("the robot's file");
    let folder = Path::new(path).parent().expect("a folder").to_owned();
    let file = |name: &str| {
        let bytes =
            std::fs::read(folder.join(name)).map_err(|error| format!("cannot open {name}: {error}"))?;
        takt_front::decode(bytes).map(|decoded| decoded.text)
    };
    let told = |error: takt_front::Error| error.located_text("FILE");
    let text = takt_front::decode(bytes)?.text;
    let tree = robot::read(&text, urdf::SNAP, &file).map_err(told)?;
    let robot = tree.held().robot(None, None).map_err(|error| told(error.located(&text)))?;
    let delays = Delays::of(&takt_isa::F3);
    let options = Options { rewrites: Rewrites::ALL, delays, tip: None, kp: 0.0, kd: 0.0 };
    let what = RobotFunction::InverseDynamics;
    let function = derive(&robot, what, &options).map_err(told)?;
    let joints: Vec<&str> = robot.joints.iter().map(|joint| joint.name.as_str()).collect();
    let request = json!({
        key: path, "joints": joints, "base": robot.base, "tip": robot.base, "function": what.name(), "states": 3, "seed": 1, "kp": 0.0,
        "kd": 0.0, "coulomb": true,
    });
    let answer = reference.ask(&request);
    if let Some(error) = answer["error"].as_str() {
        return Err(format!("reference: {error}"));
    }
    let states = answer["inputs"].as_array().expect("states").iter();
    let mut worst: f64 = 0.0;
    for (inputs, outputs) in states.zip(answer["outputs"].as_array().expect("states")) {
        let (found, expected) = (function.evaluate(&numbers(inputs)), numbers(outputs));
        let size = expected.iter().fold(0.0, |size: f64, x| size.max(x.abs()));
        let errors = found.iter().zip(&expected).map(|(found, expected)| (found - expected).abs() / size);
        worst = errors.fold(worst, f64::max);
    }
    Ok(worst)
}

fn paths(answer: &Value) -> Vec<String> {
    let list = answer.as_array().into_iter().flatten();
    list.filter_map(|path| path.as_str().map(str::to_owned)).collect()
}

#[test]
fn robots_of_packages_are_computed_or_refused() {
    if std::env::var_os("TAKT_FULL").is_none() {
        return;
    }
    let mut outcomes: BTreeMap<&str, Vec<Robot>> = BTreeMap::new();
    let mut reference = Reference::start();
    for path in paths(&reference.ask(&json!({ "list": true }))) {
        let outcome = computed(&mut reference, "urdf", &path);
        outcomes.entry("example-robot-data").or_default().push((path, outcome));
    }
    let mut reference = Reference::of("mjcf.py");
    for package in PACKAGES {
        for path in paths(&reference.ask(&json!({ "list": [package] }))) {
            let outcome = computed(&mut reference, "mjcf", &path);
            outcomes.entry(package).or_default().push((path, outcome));
        }
    }
    let mut wrong = Vec::new();
    for (package, outcomes) in &outcomes {
        let count = |good: fn(&Result<f64, String>) -> bool| {
            outcomes.iter().filter(|(_, outcome)| good(outcome)).count()
        };
        println!(
            "{package}: {} files, {} computed, {} refused",
            outcomes.len(),
            count(Result::is_ok),
            count(Result::is_err)
        );
        for (path, outcome) in outcomes {
            let name =
                path.rsplit('/').take(3).collect::<Vec<_>>().into_iter().rev().collect::<Vec<_>>().join("/");
            match outcome {
                Ok(error) => println!("  {name}: {error:.1e}"),
                Err(why) => println!("  {name}: {why}"),
            }
            let good = match outcome {
                Ok(error) => *error < MOST,
                Err(why) => !why.starts_with("reference:"),
            };
            wrong.extend((!good).then(|| format!("{name}: {outcome:?}")));
        }
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
}
