// SPDX-License-Identifier: MIT OR Apache-2.0
//! The command `takt explore`: its rows are valid machines for other commands, its cycles equal those of `takt run`, and its results are
//! cached.

use crate::common::{Folder, RunOutput};
use serde_json::Value;
use std::path::{Path, PathBuf};

/// Two sums and two products, which gain from a second adder and a second multiplier.
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
    // A second search finds all results in the cache.
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

/// For a small device, rows have just what the program uses, fit beside a board's logic, and take no more cycles than the machine that they
/// come from.
#[test]
fn a_device_gets_machines_that_fit_it() {
    let folder = workshop();
    let line = "explore sums.s --device up5k --from t1 --candidates 30 --json";
    let text = folder.line(line).ok();
    let result: Value = serde_json::from_str(&text).unwrap();
    let front = result["front"].as_array().unwrap();
    assert!(!front.is_empty(), "{text}");
    folder.line("asm sums.s -m t1 -o sums.elf --effort 1").ok();
    let ran: Value = serde_json::from_str(&folder.line("run sums.elf --periods 4 --json").ok()).unwrap();
    let most = ran["cycles"]["max"].as_u64().unwrap();
    assert!(front.iter().any(|one| one["candidate"]["cycles"][0].as_u64().unwrap() <= most), "{text}");
    for one in front {
        let of = |key: &str| one["candidate"][key].as_f64().unwrap();
        // The iCE40UP5K has 5,280 cells, 30 block RAMs and 8 multipliers.
        assert!(of("luts") <= 4680.0 && of("block_rams") <= 30.0 && of("multipliers") <= 8.0, "{one}");
        let row = one["row"].as_str().unwrap();
        assert!(row.contains("\nloop_depth = 0\n") && row.contains("\noutputs_per_bank = 2\n"), "{row}");
        assert!(!row.contains("sine") && !row.contains("recurrence"), "{row}");
    }
}

/// Workers of a HyperQueue server find the same front as this process. HyperQueue is in the Python environment that `cargo xtask test`
/// creates (`TAKT_VENV`, or `.venv`).
#[test]
fn a_search_elsewhere_is_the_same() {
    let folder = workshop();
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let venv = std::env::var_os("TAKT_VENV").map_or_else(|| root.join(".venv"), PathBuf::from);
    let line = |more: &str, cache: &str| {
        let line = format!("explore sums.s --candidates 30 --effort 0 --json{more}");
        let mut command = folder.command(&line.split(' ').collect::<Vec<_>>());
        // Use a separate cache; otherwise earlier results would be found.
        command.env("XDG_CACHE_HOME", folder.path().join(cache)).env("TAKT_VENV", &venv);
        RunOutput::of(command).ok()
    };
    let here = line("", "one");
    assert_eq!(line(" --hq", "two"), here);
    let left: Vec<_> = std::fs::read_dir(folder.path().join("two/takt/explore/units")).unwrap().collect();
    assert_eq!(left.len(), 0, "{left:?}");
}

#[test]
fn mistakes() {
    let folder = workshop();
    folder.write("named.s", format!(".machine t3\n{SUMS}"));
    folder.write("wrong.s", "fad a, b\n");
    // A valid machine row that has no circuit: a branch takes too few cycles.
    let row = folder.line("machines t3 --toml").ok().replace("name = \"t3\"", "name = \"bare\"");
    folder.write("bare.toml", row.replace("refill = 6", "refill = 4"));
    let mut text = String::new();
    for line in [
        "explore",
        "explore named.s --from t1 --candidates 2",
        "explore wrong.s",
        "explore none.s",
        "explore sums.s --budget lut=3",
        "explore sums.s --device up6k",
        "explore sums.s --device 45f",
        "explore sums.s --device up5k --from t4 --candidates 3",
        "explore sums.s --budget luts=3 --candidates 3",
        "explore sums.s --deadline 1 --candidates 3",
        "explore sums.s --from t9",
        "explore sums.s --from bare.toml",
        "explore - --hq",
        "explore sums.s --seeds 3",
        "explore sums.s --hq --hq-server there",
        "explore sums.s --unit sums.s --result there",
    ] {
        let done = folder.line(line);
        assert_eq!(done.stdout, "", "{line}");
        text += &format!("$ takt {line}\n{}[{}]\n\n", done.stderr, done.status.unwrap());
    }
    insta::assert_snapshot!(text);
}
