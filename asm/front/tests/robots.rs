// SPDX-License-Identifier: MIT OR Apache-2.0
//! Descriptions of robots: tables compared with URDF, and messages about mistakes.

use takt_front::graph::{Delays, Function, Rewrites};
use takt_front::robot::MAX_LINKS;
use takt_front::robot::functions::{Options, RobotFunction, derive};
use takt_front::robot::{Robot, dh, urdf, xml};

const UR5: &str = include_str!("data/ur5.urdf");

fn function(robot: &Robot, what: RobotFunction, tip: Option<&str>) -> Function {
    let delays = Delays::of(&takt_isa::F3);
    let options = Options { rewrites: Rewrites::ALL, delays, tip, kp: 100.0, kd: 20.0 };
    derive(robot, what, &options).expect("equations")
}

fn ur5() -> Robot {
    urdf::read(UR5, urdf::SNAP).expect("URDF").robot(None, None).expect("a robot")
}

/// The maker's table: <https://www.universal-robots.com/articles/ur/application-installation/dh-parameters-for-calculations-of-kinematics-and-dynamics/>
const UR5_TABLE: &str = "\
# convention: standard
joint, kind,     a,        alpha, d,        theta
j1,    revolute, 0,        pi/2,  0.089159, 0
j2,    revolute, -0.425,   0,     0,        0
j3,    revolute, -0.39225, 0,     0,        0
j4,    revolute, 0,        pi/2,  0.10915,  0
j5,    revolute, 0,        -pi/2, 0.09465,  0
j6,    revolute, 0,        0,     0.0823,   0
";

/// An equal table in Craig's convention.
const UR5_MODIFIED: &str = "\
# convention: modified
theta, joint, kind,     a,        alpha, d
0,     j1,    revolute, 0,        0,     0.089159
0,     j2,    revolute, 0,        pi/2,  0
0,     j3,    revolute, -0.425,   0,     0
0,     j4,    revolute, -0.39225, 0,     0.10915
0,     j5,    revolute, 0,        pi/2,  0.09465
0,     j6,    revolute, 0,        -pi/2, 0.0823
";

#[test]
fn tables_are_the_robot() {
    let from_urdf = function(&ur5(), RobotFunction::ForwardKinematics, Some("tool0"));
    for table in [UR5_TABLE, UR5_MODIFIED] {
        let robot = dh::read(table, "ur5", urdf::SNAP).expect("a table").robot(None, None).expect("a robot");
        let from_table = function(&robot, RobotFunction::ForwardKinematics, None);
        for seed in 0..20 {
            let q: Vec<f64> = (0..6).map(|i| f64::from((seed * 37 + i * 11) % 29) / 5.0 - 2.5).collect();
            // The table's base is turned by half a turn relative to the URDF's.
            let expected = from_urdf.evaluate(&q);
            let computed = from_table.evaluate(&q);
            for (i, (x, y)) in computed.iter().zip(&expected).enumerate() {
                let sign = if i < 6 || i == 9 || i == 10 { -1.0 } else { 1.0 };
                assert!((x - sign * y).abs() < 1e-9, "{i}: {x} {y}");
            }
        }
    }
}

#[test]
fn masses_of_tables_count() {
    // A pendulum: a mass m at distance l from a horizontal axis.
    let table =
        "# convention: modified\njoint,kind,a,alpha,d,theta,mass,cx\nswing,revolute,0,-pi/2,0,0,2,0.5\n";
    let robot = dh::read(table, "pendulum", urdf::SNAP).expect("a table").robot(None, None).expect("a robot");
    let tau = function(&robot, RobotFunction::InverseDynamics, None).evaluate(&[0.3, 0.7, 1.1]);
    let expected = 2.0 * 0.25 * 1.1 - 2.0 * 9.81 * 0.5 * 0.3f64.cos();
    assert!((tau[0] - expected).abs() < 1e-12, "{tau:?} {expected}");
    // A joint that slides upwards.
    let table = "# convention: standard\njoint,kind,a,alpha,d,theta,mass\nlift,prismatic,0,0,0,0,3\n";
    let robot = dh::read(table, "lift", urdf::SNAP).expect("a table").robot(None, None).expect("a robot");
    let tau = function(&robot, RobotFunction::InverseDynamics, None).evaluate(&[0.3, 0.7, 2.0]);
    assert!((tau[0] - 3.0 * (2.0 + 9.81)).abs() < 1e-12, "{tau:?}");
}

#[test]
fn parameters_without_effect_have_no_port() {
    let function = function(&ur5(), RobotFunction::InverseDynamics, None);
    let read = takt_front::sink::inputs_read(&function);
    assert_eq!(function.inputs[0].name, "q_shoulder_pan");
    assert!(!read[0] && read[1..].iter().all(|read| *read));
    let layout = takt_front::sink::Layout::program(&function, &takt_isa::F3).expect("ports");
    let source = takt_front::sink::source(&function, &layout);
    assert!(source.contains("; q_shoulder_pan has no effect") && !source.contains(".input  q_shoulder_pan"));
    assert!(source.contains("; 5 angles within 0.000001 rad of a quarter turn were taken for it"));
}

#[test]
fn counts_stay() {
    let robot = ur5();
    let count = |what| function(&robot, what, Some("tool0")).count().total();
    let counts = RobotFunction::ALL.map(|(what, ..)| count(what));
    // CasADi's counts are 123, 148, 432, 123, 247, 789 and 468: docs/models.md.
    assert_eq!(counts, [70, 65, 244, 21, 117, 433, 280]);
}

fn message(source: &str, base: Option<&str>, tip: Option<&str>) -> String {
    let tree = urdf::read(source, urdf::SNAP);
    match tree.and_then(|tree| tree.robot(base, tip).map_err(|error| error.located(source))) {
        Ok(_) => String::new(),
        Err(error) => error.line.map_or_else(|| error.to_string(), |line| format!("{line}: {error}")),
    }
}

#[test]
fn wrong_robots_are_refused() {
    let changed = |from: &str, to: &str| {
        assert!(UR5.contains(from), "{from}");
        message(&UR5.replacen(from, to, 1), None, None)
    };
    assert_eq!(changed("<robot", "<robot"), "");
    for (from, to, expected) in [
        (
            "type=\"revolute\"",
            "type=\"floating\"",
            "12: `shoulder_pan_joint`: a floating joint: only revolute, continuous, prismatic and fixed ones are known; take the part of the robot behind it with `--base shoulder_link`",
        ),
        ("xyz=\"0 0 1\"", "xyz=\"0 0 0\"", "12: `shoulder_pan_joint`: its axis has no direction"),
        (
            "xyz=\"0 0 1\"",
            "xyz=\"0 0 nan\"",
            "16: `xyz` is `0 0 nan`: 3 numbers are expected, finite and separated by spaces",
        ),
        ("xyz=\"0 0 1\"", "xyz=\"0 0\"", "16: `xyz` is `0 0`: it has 2 numbers, expected 3"),
        (
            "value=\"3.7\"",
            "value=\"-3.7\"",
            "19: `shoulder_link`: its mass is -3.7; a mass must be finite and not negative",
        ),
        (
            "ixx=\"0.010267495893\"",
            "ixx=\"inf\"",
            "23: `ixx` is `inf`: a number is expected, finite and separated by spaces",
        ),
        ("ixx=\"0.010267495893\"", "", "23: `inertia` needs `ixx`"),
        ("<mass value=\"3.7\" />", "", "20: `inertial` needs `mass`"),
        (
            "type=\"revolute\"",
            "type=\"screw\"",
            "12: `shoulder_pan_joint`: `screw` is not a type of joint; there are revolute, continuous, prismatic and fixed ones, floating and planar",
        ),
        ("<parent link=\"base_link\" />", "", "12: `shoulder_pan_joint`: it has no `parent`"),
        (
            "xyz=\"0 0 1\"",
            "xyz=\"0 0 1\" quat_xyzw=\"0 0 0 1\"",
            "16: `quat_xyzw` of `axis` is not known: docs/readers.md lists what is read",
        ),
        (
            "value=\"3.7\"",
            "value=\"${mass}\"",
            "21: this is a file for xacro, which makes URDF of it: `xacro FILE > robot.urdf`",
        ),
        (
            "<robot name=\"ur5\">",
            "<!DOCTYPE robot [<!ENTITY a \"a\">]><robot name=\"ur5\">",
            "4: a document type with declarations is not read: leave `<!DOCTYPE …>` out",
        ),
        (
            "parent link=\"shoulder_link\"",
            "parent link=\"shoulder\"",
            "26: `shoulder_lift_joint`: there is no link `shoulder`",
        ),
        (
            "child link=\"upper_arm_link\"",
            "child link=\"shoulder_link\"",
            "26: `shoulder_lift_joint`: link `shoulder_link` is already carried by joint `shoulder_pan_joint`: a robot is a tree, without loops",
        ),
        (
            "name=\"shoulder_lift_joint\"",
            "name=\"shoulder_pan_joint\"",
            "26: `shoulder_pan_joint`: two joints have this name",
        ),
        ("name=\"shoulder_link\"", "name=\"base_link\"", "19: `base_link`: two links have this name"),
        ("</robot>", "", "this is not XML: the root node was opened but never closed"),
        (
            "<robot name=\"ur5\">",
            "<robot name=\"ur5\"><link name=\"alone\"/>",
            "links `alone` and `world` are both carried by no joint: a robot has one base",
        ),
    ] {
        assert_eq!(changed(from, to), expected);
    }
}

#[test]
fn wrong_trees_are_refused() {
    // A refused joint may lie before the base.
    let floating = UR5.replacen("type=\"revolute\"", "type=\"floating\"", 1);
    assert_eq!(message(&floating, Some("shoulder_link"), None), "");
    assert_eq!(message("", None, None), "this is not XML: the document does not have a root node");
    assert_eq!(message("<a/>", None, None), "this is not a URDF: its root element is `a`, not `robot`");
    assert_eq!(message("<robot name=\"x\"/>", None, None), "the robot has no link");
    assert_eq!(
        message("<robot name=\"x\"><link name=\"a\"/></robot>", None, None),
        "no joint that `a` carries moves"
    );
    let loops = "<robot name=\"x\"><link name=\"a\"/><link name=\"b\"/>\
        <joint name=\"j\" type=\"fixed\"><parent link=\"a\"/><child link=\"b\"/></joint>\
        <joint name=\"k\" type=\"fixed\"><parent link=\"b\"/><child link=\"a\"/></joint></robot>";
    assert_eq!(message(loops, None, None), "every link is carried by a joint: a robot is a tree with a base");
    assert!(
        message(UR5, None, Some("tool"))
            .starts_with("--tip: there is no link `tool`; the links are `base_link`,")
    );
    assert_eq!(
        message(UR5, Some("tool0"), Some("forearm_link")),
        "--tip: link `forearm_link` is not carried by `tool0`"
    );
    assert_eq!(
        message(UR5, Some("wrist_3_link"), Some("tool0")),
        "no joint moves between `wrist_3_link` and `tool0`"
    );
}

/// A chain of links; the last joint turns, the others are fixed.
fn chain(links: usize) -> String {
    let link = |number: usize| format!("<link name=\"l{number}\"/>\n");
    let joint = |number: usize| {
        let (kind, child) = (if number + 2 == links { "continuous" } else { "fixed" }, number + 1);
        format!(
            "<joint name=\"j{number}\" type=\"{kind}\"><parent link=\"l{number}\"/><child link=\"l{child}\"/><axis xyz=\"0 0 1\"/></joint>\n"
        )
    };
    let [links, joints]: [String; 2] = [(0..links).map(link).collect(), (0..links - 1).map(joint).collect()];
    format!("<robot name=\"chain\">\n{links}{joints}</robot>")
}

#[test]
fn rejects_excessive_nesting_and_length() {
    let within =
        |depth: usize| format!("<robot name=\"x\">\n{}{}</robot>", "<a>".repeat(depth), "</a>".repeat(depth));
    assert_eq!(message(&within(xml::MAX_DEPTH - 1), None, None), "the robot has no link");
    for depth in [xml::MAX_DEPTH, 10_000, 1_000_000] {
        let text = "2: more than 64 elements are within one another here; a robot needs fewer";
        assert_eq!(message(&within(depth), None, None), text);
    }
    assert_eq!(message(&chain(MAX_LINKS), None, None), "");
    assert_eq!(message(&chain(MAX_LINKS), Some("l0"), Some("l4095")), "");
    let line = MAX_LINKS + 2;
    let text = "the robot has more than 4096 links: leave out what does not move";
    for links in [MAX_LINKS + 1, 100_000] {
        assert_eq!(message(&chain(links), None, None), format!("{line}: {text}"));
    }
    let joints = chain(MAX_LINKS).replace("</robot>", &"<joint/>".repeat(2)).to_owned() + "</robot>";
    assert!(message(&joints, None, None).contains("more than 4096 joints, fixed ones included"));
    let wide = format!("<robot name=\"x\">{}</robot>", "<a/>".repeat(xml::MAX_NODES as usize));
    assert_eq!(message(&wide, None, None), "the file has more than 1048576 elements and texts");
}

#[test]
fn wrong_tables_are_refused() {
    let head = "# convention: modified\njoint,kind,a,alpha,d,theta\n";
    let message = |source: &str| match dh::read(source, "table", urdf::SNAP) {
        Ok(_) => String::new(),
        Err(error) => format!("{}: {error}", error.line.unwrap_or(0)),
    };
    assert_eq!(message(&format!("{head}j,revolute,0,3*pi/4,-.5,1e-3\n")), "");
    for (row, expected) in [
        ("j,revolute,0,0,0", "3: 5 fields; the header has 6"),
        ("j,sliding,0,0,0,0", "3: unknown kind `sliding`; expected `revolute`, `prismatic` or `fixed`"),
        ("j,revolute,0,pi/0,0,0", "3: `alpha`: `pi/0` is not a finite number, such as 0.5 or -pi/2"),
        ("j,revolute,0,tau,0,0", "3: `alpha`: `tau` is not a finite number, such as 0.5 or -pi/2"),
        (",revolute,0,0,0,0", "3: joint ``: every joint needs a name of its own"),
        ("j,revolute,0,0,0,0\nj,revolute,0,0,0,0", "4: joint `j`: every joint needs a name of its own"),
    ] {
        assert_eq!(message(&format!("{head}{row}\n")), expected);
    }
    assert_eq!(message(head), "0: the table has no joint");
    assert_eq!(
        message("# convention: other\n"),
        "1: unknown convention `other`; expected `standard` or `modified`"
    );
    assert_eq!(
        message("joint,kind,a,alpha,d\n"),
        "1: the header has no column `theta`; needed are joint, kind, a, alpha, d, theta"
    );
    assert!(message("joint,size\n").starts_with("1: column `size` is not known; the columns are joint,"));
    assert_eq!(message("joint,joint\n"), "1: column `joint` is there twice");
    assert_eq!(
        message("joint,kind,a,alpha,d,theta\nj,revolute,0,0,0,0\n"),
        "2: state above the table which frames it uses: `# convention: standard` or `# convention: modified`"
    );
}
