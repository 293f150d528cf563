// SPDX-License-Identifier: MIT OR Apache-2.0
//! `takt explore`: its rows are machines that other commands take, its cycles those of `takt run`, its results are kept.

use crate::common::Folder;
use serde_json::Value;

/// Two sums and products that a second adder and a second multiplier make faster.
const SUMS: &str = "\
.input a b c d
.output y z
.schedule on
.once
        wait    p
.period
p:
        y = (a + b) * (c + d) + (a - c) * (b - d)
        z = (a + c) * (b + d) + (a - d) * (b - c)
        wait    p
";

fn workshop() -> Folder {
    let folder = Folder::new();
    folder.write("sums.s", SUMS);
    folder
}

#[test]
fn rows_are_machines_and_cycles_are_the_runs() {
    let folder = workshop();
    let line = "explore sums.s --candidates 60 --json -o found --csv front.csv --svg front.svg";
    let text = folder.line(line).ok();
    let result: Value = serde_json::from_str(&text).unwrap();
    let front = result["front"].as_array().unwrap();
    assert!(front.len() >= 3, "{text}");
    assert_eq!(result["tried"], 60);
    let mut new = 0;
    for one in front {
        let (one, row) = (&one["candidate"], &one["row"]);
        let name = one["machine"].as_str().unwrap();
        let file = format!("found/{name}.toml");
        assert_eq!(&Value::from(folder.read_text(&file)), row);
        new += usize::from(name.starts_with('x'));
        folder.takt(&["asm", "sums.s", "-m", file.as_str(), "-o", "sums.elf", "--effort", "1"]).ok();
        let ran: Value = serde_json::from_str(&folder.line("run sums.elf --periods 4 --json").ok()).unwrap();
        assert_eq!(one["cycles"][0], ran["cycles"]["max"], "{name}");
    }
    assert!(new > 0, "{text}");
    assert_eq!(folder.read_text("front.csv").lines().count(), front.len() + 1);
    assert!(folder.read_text("front.svg").contains("<circle"));
    // The same again, from what was kept.
    assert_eq!(folder.line(line).ok(), text);
}

#[test]
fn a_budget_is_kept() {
    let folder = workshop();
    let text =
        folder.line("explore sums.s --candidates 40 --budget luts=9000,ram=40,multipliers=9 --json").ok();
    let result: Value = serde_json::from_str(&text).unwrap();
    for one in result["front"].as_array().unwrap() {
        let of = |key: &str| one["candidate"][key].as_f64().unwrap();
        assert!(of("luts") <= 9000.0 && of("block_rams") <= 40.0 && of("multipliers") <= 9.0, "{one}");
    }
}

#[test]
fn mistakes() {
    let folder = workshop();
    folder.write("named.s", format!(".machine t3\n{SUMS}"));
    folder.write("wrong.s", "fad a, b\n");
    let mut text = String::new();
    for line in [
        "explore",
        "explore named.s --from t1 --candidates 2",
        "explore wrong.s",
        "explore none.s",
        "explore sums.s --budget lut=3",
        "explore sums.s --budget luts=3 --candidates 3",
        "explore sums.s --deadline 1 --candidates 3",
        "explore sums.s --from t9",
    ] {
        let done = folder.line(line);
        assert_eq!(done.stdout, "", "{line}");
        text += &format!("$ takt {line}\n{}[{}]\n\n", done.stderr, done.status.unwrap());
    }
    insta::assert_snapshot!(text);
}
