// SPDX-License-Identifier: MIT OR Apache-2.0
//! The command `takt model`: generated programs compared with other tools, and mistakes in descriptions.

use crate::common::Folder;

const UR5: &str = include_str!("../../../asm/front/tests/data/ur5.urdf");

fn folder() -> Folder {
    let folder = Folder::new();
    folder.write("ur5.urdf", UR5);
    folder
}

#[test]
fn a_robot_becomes_a_program_that_runs() {
    let folder = folder();
    let text = folder.line("model ur5.urdf -f gravity -o gravity.s").ok();
    assert!(text.starts_with("gravity of ur5: joint forces that hold the robot at rest\n"), "{text}");
    assert!(text.contains("  link 3: elbow_joint, on link 2: origin 0.425 0 0 m, axis 0 0 1\n"), "{text}");
    assert!(
        text.contains("\noperations: 21 (sums 5, products 10, divisions and roots 0, trigonometric 6"),
        "{text}"
    );
    assert!(text.contains(" cycles on t3 (") && text.contains(" or later), bound "), "{text}");
    let source = folder.read_text("gravity.s");
    assert!(source.contains("\n.output tau_elbow ; force of elbow_joint, N m\n"), "{source}");
    // Once with the arm vertical except for the wrist, and once at an angle: Pinocchio's values to within binary32.
    folder.write("q.csv", "q_shoulder_lift,q_elbow,q_wrist_1,q_wrist_2\n-1.5707964,0,0,0\n0,0.5,-0.25,1\n");
    let rows = folder.line("run gravity.s --inputs q.csv --outputs -").ok();
    let rows: Vec<Vec<&str>> = rows.lines().map(|line| line.split(',').collect()).collect();
    let column = rows[0].iter().position(|name| *name == "tau_shoulder_lift").expect("the port");
    let tau: Vec<f64> = rows[1..].iter().map(|row| row[column].parse().expect("a number")).collect();
    assert!((tau[0] - TAU[0]).abs() < 1e-4 && (tau[1] - TAU[1]).abs() < 1e-4, "{tau:?}");
}

/// `pinocchio.computeGeneralizedGravity` for the two states.
const TAU: [f64; 2] = [-0.174_463_92, -57.207_66];

#[test]
fn output_goes_to_the_named_file() {
    let folder = folder();
    let source = folder.line("model ur5.urdf -f inverse-dynamics -o -").ok();
    assert!(
        source.starts_with("; inverse-dynamics of ur5") && source.ends_with("wait    period\n"),
        "{source}"
    );
    let json = folder.line("model ur5.urdf -f jacobian --tip tool0 --json -m t1").ok();
    let json: serde_json::Value = serde_json::from_str(&json).expect("JSON");
    assert_eq!(json["machine"], "t1");
    assert_eq!(json["operations"], 65);
    assert!(
        json["cycles"].as_u64() >= json["bound"].as_u64() && json["bound"].as_u64() >= json["chain"].as_u64()
    );
    assert_eq!(json["constants"].as_array().expect("a list").len(), 10);
}

#[test]
fn rewrites_can_be_switched_off() {
    let folder = folder();
    let operations = |options: &str| {
        let json = folder.line(&format!("model ur5.urdf -f gravity --json {options}")).ok();
        let json: serde_json::Value = serde_json::from_str(&json).expect("JSON");
        json["operations"].as_u64().expect("a number")
    };
    let all = operations("");
    for option in ["fold", "identities", "share", "signs", "strength", "factor", "balance", "scale"] {
        assert!(operations(&format!("--no-{option}")) >= all, "{option}");
    }
    assert!(operations("--exact") > all && operations("--no-scale") > all);
    for (name, _) in takt_front::graph::Rewrites::NAMES {
        folder.line(&format!("model ur5.urdf -f gravity --no-{name}")).ok();
    }
}

/// The command in the first lines of `programs/examples/panda/law.s` regenerates the body beside it, and the law assembles without
/// warnings.
#[test]
fn stored_body_equals_the_commands_output() {
    let panda = concat!(env!("CARGO_MANIFEST_DIR"), "/../../programs/examples/panda");
    let read = |name: &str| std::fs::read_to_string(format!("{panda}/{name}")).expect("the file");
    let law = read("law.s");
    let command = law.lines().find_map(|line| line.strip_prefix(";   takt ")).expect("the command");
    let folder = Folder::new();
    for name in ["panda.urdf", "law.s"] {
        folder.write(name, read(name));
    }
    let text = folder.line(command).ok();
    assert!(text.contains(" cycles on t3 (") && text.contains(" or later) by itself, bound "), "{text}");
    // `cargo xtask lint --fix` appends the licence line.
    let made = folder.read_text("dynamics.s") + "; SPDX-License-Identifier: MIT OR Apache-2.0\n";
    assert_eq!(made, read("dynamics.s"), "takt {command} in {panda}, and cargo xtask lint --fix");
    folder.line("asm law.s -W error").ok();
    let json: serde_json::Value =
        serde_json::from_str(&folder.line("model panda.urdf -f jacobian --body --json").ok()).expect("JSON");
    assert_eq!(
        (&json["inputs"][6]["name"], &json["outputs"][0]["name"]),
        (&"model_q[7]".into(), &"model_J[1,1]".into())
    );
    for (line, expected) in [
        (
            "model panda.urdf -f gravity --prefix id_",
            "the following required arguments were not provided:\n  --body",
        ),
        ("model panda.urdf -f gravity --body --prefix 7x", "`7x` cannot begin a name: a prefix has letters,"),
    ] {
        let done = folder.line(line);
        assert!(done.status == Some(2) && done.stderr.contains(expected), "{line}: {}", done.stderr);
    }
}

#[test]
fn expressions_become_programs() {
    let folder = Folder::new();
    let list = r#"{"format": "takt-expressions 1", "name": "f", "inputs": [{"name": "x", "rows": 2, "columns": 1}],
 "outputs": [{"name": "y", "rows": 1, "columns": 1}],
 "code": [
  {"op": "input", "to": 0, "port": [0, 0]},
  {"op": "input", "to": 1, "port": [0, 1]},
  {"op": "OP", "to": 2, "of": [0, 1]},
  {"op": "output", "of": [2], "port": [0, 0]}
]}"#;
    folder.write("f.json", list.replace("OP", "atan2"));
    assert!(folder.line("model f.json -o f.s").ok().contains("operations: 1 ("));
    assert!(folder.read_text("f.s").contains("        y = atan2(x_1, x_2)\n"));
    // A function that has no instruction comes from the library.
    folder.write("e.json", list.replace("OP", "exp").replace("\"of\": [0, 1]", "\"of\": [0]"));
    assert!(folder.line("model e.json -o e.s").ok().contains("operations: 1 ("));
    assert!(folder.read_text("e.s").contains(".include <math.s>\n"));
    folder.write("e.csv", "x_1\n1\n-2.5\n");
    folder.line("run e.s --inputs e.csv --outputs y.csv").ok();
    let values: Vec<f64> = folder
        .read_text("y.csv")
        .lines()
        .skip(1)
        .map(|line| line.split(',').next().unwrap().parse().unwrap())
        .collect();
    assert_eq!(values.len(), 2);
    for (y, x) in values.into_iter().zip([1_f64, -2.5]) {
        assert!((y / x.exp() - 1.0).abs() < 1e-7, "{y}");
    }
    folder.write("f.json", list.replace("OP", "lgamma"));
    let done = folder.line("model f.json");
    assert_eq!(done.status, Some(1));
    assert!(
        done.stderr.contains("f.json:6: operation `lgamma` is not supported; in `lgamma(x_1, x_2)`"),
        "{}",
        done.stderr
    );
}

#[test]
fn a_policy_becomes_a_program_that_runs() {
    let folder = Folder::new();
    let policies =
        std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../asm/front/tests/data/policies");
    for name in ["relu", "bad_conv"] {
        let bytes = std::fs::read(policies.join(format!("{name}.onnx"))).expect("the file");
        folder.write(format!("{name}.onnx"), bytes);
    }
    let text = folder.line("model relu.onnx -o relu.s --range -1,1").ok();
    assert!(text.starts_with("relu: a policy 20-40-24-4, Relu\n  written by policies.py\n"), "{text}");
    assert!(text.contains("\n1856 weights, "), "{text}");
    let json: serde_json::Value =
        serde_json::from_str(&folder.line("model relu.onnx --json").ok()).expect("JSON");
    assert_eq!(json["weights"], 1856);
    assert_eq!(json["inputs"][19]["name"], "obs[20]");
    let cycles = json["cycles"].as_u64().expect("a number");
    let waiting = json["cycles_waiting"].as_u64().expect("a number");
    let both = format!(
        "\n{cycles} cycles on t3,data=4096 ({waiting} if the tick comes 6 cycles after the wait or later), "
    );
    assert!(text.contains(&both), "{text}");
    // Both figures equal the bound.
    let bound = folder.line("bound relu.s").ok();
    assert!(bound.contains(&format!("  period          {waiting} ")), "{bound}");
    assert!(
        bound.contains(&format!(
            "period: {waiting} to {cycles} if the tick comes less than 6 cycles after the wait"
        )),
        "{bound}"
    );
    // Error bounds also cover arrays that a period writes before reading them.
    let accuracy = folder.line("accuracy relu.s").ok();
    assert!(accuracy.contains("\nno NaN, no overflow, no division by zero"), "{accuracy}");
    for (line, status, expected) in [
        (
            "model bad_conv.onnx",
            1,
            "bad_conv.onnx: node `/Conv_1` (Conv): this operator is not supported: convolutions and pooling are not read;",
        ),
        (
            "model relu.onnx -f gravity",
            2,
            "--function applies to robot descriptions, but relu.onnx contains a policy",
        ),
        (
            "model relu.onnx --body",
            2,
            "--body applies to robots and expressions, but relu.onnx contains a policy,",
        ),
        ("model relu.onnx --range 1", 2, "expected two numbers with a comma between them, as -1,1"),
        ("model relu.onnx --range 1,-1", 2, "the first number must not be greater than the second"),
    ] {
        let done = folder.line(line);
        assert!(done.status == Some(status) && done.stderr.contains(expected), "{line}: {}", done.stderr);
    }
}

#[test]
fn a_model_of_mujoco_is_read() {
    let folder = folder();
    folder.write("leg.xml", PENDULUM);
    let text = folder.line("model leg.xml -f inverse-dynamics -o leg.s").ok();
    assert!(text.starts_with("inverse-dynamics of leg: joint forces"), "{text}");
    // A mass of 2 kg at 0.5 m, a rotor, and both kinds of friction.
    folder.write("in.csv", "q_hip,qd_hip,qdd_hip\n0,2,3\n");
    let result = folder.line("run leg.s --inputs in.csv --outputs -").ok();
    let row = result.lines().nth(1).and_then(|row| row.split(',').next()).map(str::parse::<f64>);
    let expected = (2.0 * 0.25 + 0.01 + 0.1) * 3.0 + 0.2 * 2.0 + 0.05;
    let torque = row.expect("a row").expect("a number");
    assert!((torque - expected).abs() < 1e-6, "{result}");
}

/// A leg in MJCF.
const PENDULUM: &str = r#"<mujoco model="leg"><worldbody><body name="leg"><joint name="hip" axis="0 1 0" armature="0.1" damping="0.2" frictionloss="0.05"/>
<inertial mass="2" pos="0 0 -0.5" diaginertia="0.01 0.01 0.01"/></body></worldbody></mujoco>"#;

/// Files in common variants: floating base, included file, encodings, export from a spreadsheet.
#[test]
fn reads_descriptions_of_every_origin() {
    let folder = folder();
    folder.write("floating.urdf", UR5.replacen("type=\"revolute\"", "type=\"floating\"", 1));
    let text = folder.line("model floating.urdf -f gravity").ok();
    let held = "  the base is held, though it floats: `shoulder_pan_joint` (`--floating error` refuses)\n";
    assert!(text.contains(held), "{text}");
    folder.write("leg.xml", PENDULUM.replace("<worldbody>", "<include file=\"look.xml\"/><worldbody>"));
    folder.write("look.xml", "<mujocoinclude><option gravity=\"0 0 -1\"/></mujocoinclude>");
    assert!(folder.line("model leg.xml -f gravity").ok().contains("  gravity is 0 0 -1 m/s²\n"));
    folder.write("look.xml", "<mujocoinclude>\n<option gravity=\"0\"/></mujocoinclude>");
    let done = folder.line("model leg.xml -f gravity");
    assert!(
        done.stderr.contains("look.xml:2: `gravity` is `0`: it has 1 numbers, expected 3"),
        "{}",
        done.stderr
    );
    let latin: Vec<u8> =
        UR5.replace("The arm", "Der Arm für").chars().map(|c| u8::try_from(c).unwrap_or(b'?')).collect();
    folder.write("latin.urdf", latin);
    let text = folder.line("model latin.urdf -f gravity").ok();
    assert!(
        text.contains("  line 2 is not UTF-8: the file was taken for Latin-1 (Windows-1252)\n"),
        "{text}"
    );
    let wide: Vec<u8> = [0xfeff].into_iter().chain(UR5.encode_utf16()).flat_map(u16::to_le_bytes).collect();
    folder.write("wide.urdf", wide);
    folder.line("model wide.urdf -f gravity").ok();
    folder.write(
        "t.csv",
        "\u{feff}# convention: modified;;;;;\r\njoint;kind;a;alpha_deg;d;theta\r\nj;revolute;0.1;90;0;0\r\n",
    );
    folder.line("model t.csv -f forward-kinematics").ok();
    folder.write("empty.urdf", b"\0\0\0");
    let done = folder.line("model empty.urdf -f gravity");
    assert!(done.stderr.contains("empty.urdf: it has zero bytes: it is not text"), "{}", done.stderr);
}

/// The chosen penalty, advice on an unsuitable penalty, and Python's number syntax.
#[test]
fn reports_an_unusable_penalty() {
    let folder = Folder::new();
    let problem = "{\"format\": \"takt-mpc 1\", \"A\": [[1, 0.1], [0, 1]], \"B\": [[0.005], [0.1]], \"Q\": 1, \"R\": [1e-6],\n\
                   \"u_max\": Infinity, \"u_min\": -1, \"horizon\": 3, \"iterations\": 4}";
    folder.write("p.json", problem);
    let text = folder.line("model p.json").ok();
    let rho =
        text.lines().next().and_then(|line| line.split_once("4 iterations, rho ")).expect("the penalty").1;
    assert!(!text.contains("does not suit") && rho.parse::<f64>().is_ok_and(|rho| rho > 0.005), "{text}");
    folder.write("p.json", problem.replace("\"iterations\"", "\"rho\": 1000, \"iterations\""));
    let text = folder.line("model p.json").ok();
    let advice = format!(
        "\n`rho` 1000 does not suit the weights `R`: iterations hardly move; `rho` {rho} would, by 0."
    );
    assert!(text.contains(&advice), "{text}");
    for (from, to, expected) in [
        ("[1e-6]", "[NaN]", "p.json:1: `R`: expected a finite number, found NaN"),
        ("4}", "4,}", "p.json:2: this is not a control problem: trailing comma"),
    ] {
        folder.write("p.json", problem.replace(from, to));
        let done = folder.line("model p.json");
        assert!(done.stderr.contains(expected), "{}", done.stderr);
    }
}

#[test]
fn mistakes_have_one_message() {
    let folder = folder();
    folder.write("floating.urdf", UR5.replacen("type=\"revolute\"", "type=\"floating\"", 1));
    folder.write("robot.txt", UR5);
    folder.write("ball.xml", PENDULUM.replace("name=\"hip\"", "name=\"hip\" type=\"ball\""));
    folder.write("f.json", "{");
    for (line, status, expected) in [
        ("model ur5.urdf", 2, "name what to compute with --function: forward-kinematics, jacobian,"),
        ("model ur5.urdf -f gravty", 2, "there is no such function; did you mean `gravity`?"),
        (
            "model ur5.urdf -f gravity --tip wrist",
            1,
            "ur5.urdf: --tip: there is no link `wrist`; the links are",
        ),
        (
            "model ball.xml -f gravity",
            1,
            "ball.xml:1: `hip`: a ball joint: only hinges and slides are known; take the part of the robot behind it with `--base leg`",
        ),
        (
            "model floating.urdf -f gravity --floating error",
            1,
            "floating.urdf:12: `shoulder_pan_joint`: a floating joint:",
        ),
        (
            "model robot.txt -f gravity",
            1,
            "robot.txt: the format is determined by the extension, which must be .urdf, .xml, .csv, .json, .fpcore or .onnx",
        ),
        ("model none.urdf -f gravity", 1, "cannot open none.urdf"),
        (
            "model f.json -f gravity",
            2,
            "--function applies to robot descriptions, but f.json contains expressions",
        ),
        ("model f.json", 1, "f.json:1: this is not a list of instructions: EOF while parsing an object"),
        ("model ur5.urdf -f gravity --snap 1", 2, "between 0 and 0.01 rad"),
        ("model ur5.urdf -f computed-torque --kp -1", 2, "a gain must be finite and not negative"),
    ] {
        let done = folder.line(line);
        assert!(done.status == Some(status) && done.stderr.contains(expected), "{line}: {}", done.stderr);
        assert_eq!(done.stderr.matches("error:").count(), 1, "{line}: {}", done.stderr);
    }
}

/// Recursive parsers stop at a maximum depth, for every format of other tools.
#[test]
fn excessive_nesting_has_one_message() {
    const DEEP: usize = 200_000;
    let folder = folder();
    let nested =
        |head: &str, open: &str, close: &str| format!("{head}{}{}", open.repeat(DEEP), close.repeat(DEEP));
    folder.write("deep.urdf", nested("", "<a>", "</a>"));
    folder.write("array.json", nested("{\"format\": ", "[", "]"));
    folder.write("object.json", nested("{\"inputs\": [{\"name\": ", "{\"a\":", "}"));
    folder.write("array.toml", nested("tick = ", "[", "]\n"));
    folder.write("table.toml", nested("tick = ", "{a=", "}\n"));
    folder.write("key.toml", format!("{}a = 1\n", "a.".repeat(DEEP)));
    folder.write("head.toml", format!("[{}a]\n", "a.".repeat(DEEP)));
    folder.write("moves.robot", nested("x = ", "(", ")\n"));
    folder.write("sum.s", nested(".output y\n.period\np: y = ", "(", ")\n wait p\n"));
    folder.write("path.ngc", nested("", "(", ")\n"));
    let tracking = format!("{}/../../programs/hybrid/tracking.s", env!("CARGO_MANIFEST_DIR"));
    let mut lines: Vec<(String, &str)> = vec![
        (
            "model deep.urdf -f gravity".to_owned(),
            "deep.urdf:1: more than 64 elements are within one another here",
        ),
        ("model array.json".to_owned(), "array.json:1: this is not a list of instructions"),
        ("model object.json".to_owned(), "object.json:1: this is not a list of instructions"),
        ("asm sum.s".to_owned(), "sum.s"),
        ("track --gcode path.ngc".to_owned(), "path.ngc:1:"),
        ("robot --check moves.robot".to_owned(), "moves.robot"),
    ];
    for name in ["array", "table", "key", "head"] {
        lines.push((format!("run {name}.toml"), "recur"));
        lines.push((format!("bound {tracking} --pins --wiring {name}.toml --board ulx3s-85f"), "recur"));
    }
    for (line, says) in lines {
        let done = folder.line(&line);
        let told = &done.stderr[..done.stderr.len().min(500)];
        assert!(
            matches!(done.status, Some(1 | 2)) && done.stderr.contains(says),
            "{line}: {:?} {told}",
            done.status
        );
    }
}
