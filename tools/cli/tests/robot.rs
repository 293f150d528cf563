// SPDX-License-Identifier: MIT OR Apache-2.0
//! The command `takt robot` on the command line. programs/robot/tests covers the language.

use crate::common::Folder;
use serde_json::Value;

#[test]
fn a_session_from_a_pipe() {
    let folder = Folder::new();
    let script = "where\nmove joints(20, _, _, _, _, _) in 0.3\nrecord on\nteach p\nif input(1) == 0\n  say \"off\"\nend\n\
                  save \"mine.robot\"\nhelp jog\nmoev p\nmovel pose(3000, _, _, _, _, _)\nsay joints().q1\n";
    let done = folder.fed("robot --plot out.svg", script.as_bytes());
    assert_eq!(done.status, Some(1), "{done:?}");
    for text in ["joints(0, 90, 0, 0, -45, 0)", "p = pose(", "off\n", "jog joints|world|gripper", " s  20\n"]
    {
        assert!(done.stdout.contains(text), "{text}\n{}", done.stdout);
    }
    assert!(done.stdout.contains("Tracking error") && done.stdout.contains("kinematic"), "{}", done.stdout);
    assert!(done.stderr.contains("did you mean `move`?"), "{}", done.stderr);
    assert!(done.stderr.contains("refused: the target is out of reach"), "{}", done.stderr);
    let saved = folder.read_text("mine.robot");
    assert!(saved.starts_with("let p = pose(") && saved.contains("if input(1) == 0\n"), "{saved}");
    assert!(folder.read_text("out.svg").starts_with("<svg"));
}

#[test]
fn a_program_with_a_fault_of_the_link() {
    let folder = Folder::new();
    folder.write("a.robot", "start move joints(20, _, _, _, _, _) in 1\nwait 0.3\nsignal 1 on\nwait done\n");
    let done = folder.line("robot a.robot --faults corrupt@0.1 --json");
    assert_eq!((done.status, done.stderr.as_str()), (Some(1), ""), "{done:?}");
    let json: Value = serde_json::from_str(&done.stdout).unwrap();
    assert_eq!(json["messages"][0]["kind"], "stopped");
    assert_eq!(json["errors"][0]["message"], "the robot was stopped: a packet's checksum is wrong");
    assert!(json["tracking"]["largest"][0].as_f64().unwrap() > 0.0);
    assert_eq!(json["cores"].as_array().unwrap().len(), 3);
    let text = folder.line("robot a.robot --check").ok();
    assert!(text.contains("a.robot can run: it takes 1."), "{text}");
}

/// `--record` writes the inputs from host and encoders; `takt run --inputs` replays them to the same outputs and pose.
#[test]
fn a_session_is_recorded() {
    let folder = Folder::new();
    folder.write("a.robot", "signal 3 on\nmove joints(2, _, _, _, _, _)\n");
    folder.line("robot a.robot --record in.csv").ok();
    let toml = format!("{}/../../programs/three/controller.toml", env!("CARGO_MANIFEST_DIR"));
    let run = folder.line(&format!("run {toml} --inputs in.csv --json")).ok();
    let json: Value = serde_json::from_str(&run).unwrap();
    assert_eq!((&json["outputs"]["outputs"], &json["outputs"]["enable"]), (&4.into(), &1.into()), "{json}");
    let angle = json["outputs"]["state.q1"].as_f64().unwrap();
    assert!((angle - 2f64.to_radians()).abs() < 1e-6, "{json}");
}

#[test]
fn mistakes_on_the_command_line() {
    let folder = Folder::new();
    folder.write("a.robot", "mov 1\n");
    folder.write("a.svg", "mov 1\n");
    folder.write("b.toml", "tick = 10\n");
    for (line, status, text) in [
        ("robot a.robot --faults flood@1", 2, "there is no fault `flood`"),
        ("robot a.robot --faults corrupt", 2, "expected a fault with its time"),
        ("robot a.robot --faults corrupt@-1", 2, "is not a time"),
        ("robot --check", 2, "FILE"),
        ("robot none.robot", 1, "none.robot"),
        ("robot a.svg --plot a.svg", 2, "--plot would overwrite"),
        ("robot a.robot --record a.robot", 2, "--record would overwrite"),
    ] {
        let done = folder.line(line);
        assert_eq!(done.status, Some(status), "{line}: {done:?}");
        assert!(done.stderr.contains(text), "{line}: {}", done.stderr);
    }
    // Another system lacks the ports that the host requires.
    let speed = format!("{}/../../programs/systems/speed.toml", env!("CARGO_MANIFEST_DIR"));
    let done = folder.line(&format!("robot a.robot --system {speed}"));
    assert_eq!(done.status, Some(1));
    assert!(done.stderr.contains("the system is not a robot controller"), "{}", done.stderr);
}
